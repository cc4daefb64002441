"""The extras that files need, judging by their names, so that one error lists all missing ones."""

import os
from collections.abc import Iterable
from pathlib import Path

from meshreel.formats.registry import FOLDER_FORMATS, FORMATS, extension_of
from meshreel.formats.sources import AnyPath, Source
from meshreel.runtime.extras import REGISTER_PILLOW, REGISTER_SCIPY, REGISTER_XATLAS, VIDEO, Extra

VIDEOS = (".mp4", ".mov", ".webm", ".mkv", ".avi")
"""Extensions of texture videos."""

REGISTRATION = (REGISTER_SCIPY,)


def extras_to_read(files: Iterable[AnyPath]) -> list[Extra]:
    """Return the extras that reading certainly needs."""
    formats = (FORMATS.get(extension) for extension in dict.fromkeys(map(extension_of, files)))
    return [
        file_format.extra
        for file_format in formats
        if file_format is not None and file_format.extra is not None
        if not file_format.reads_without_extra
    ]


def extras_to_write(output: AnyPath) -> list[Extra]:
    """Return the extras that writing certainly needs."""
    extension = extension_of(output)
    file_format = FOLDER_FORMATS.get(extension) or FORMATS.get(extension)
    return [file_format.extra] if file_format is not None and file_format.extra is not None else []


def extras_to_bake(textures: Source, output: AnyPath) -> list[Extra]:
    """Return the extras that baking textures into the images or the video `output` needs."""
    names = [textures] if isinstance(textures, str | os.PathLike) else [*textures]
    has_video = any(Path(name).suffix.lower() in VIDEOS for name in [*names, output])
    return [REGISTER_PILLOW, REGISTER_XATLAS, *([VIDEO] if has_video else [])]
