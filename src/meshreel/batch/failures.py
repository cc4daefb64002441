"""Why an input could not be encoded, in one line."""

import os
from pathlib import Path

from meshreel.errors import MeshReelError


def reason_of(error: BaseException, name: str, input_dir: Path) -> str:
    """What an error says of the input of this name; paths are as seen from the folder of inputs."""
    if isinstance(error, MeshReelError):
        text = str(error)
    elif isinstance(error, MemoryError):
        text = "not enough memory; fewer --workers or a shorter --block-frames need less"
    elif isinstance(error, OSError) and error.filename:
        text = f"{error.strerror or error}: {error.filename}"
    else:
        text = f"{type(error).__name__}: {error}"
    text = text.replace(f"{input_dir.absolute()}{os.sep}", "").removeprefix(f"{name}: ")
    return " ".join(text.split())
