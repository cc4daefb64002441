"""Room on the disk for an Alembic file, known before the library writes it."""

import os
import shutil
import tempfile
from pathlib import Path

from meshreel.errors import InvalidInputError
from meshreel.formats.frames.frame_stream import FrameStream

BYTES_OF_SAMPLE = 256
"""Of a part in a frame, beside positions; 124 were found."""

BYTES_OF_PART = 1 << 14
"""Of headers and names; some 1.5 kB were found."""


def check_room(path: Path, stream: FrameStream) -> None:
    """Refuse a disk that is too small: when it is full, the library ends the process.

    The room is taken once and given back, so that quotas and limits on the size of files count.

    Raises
    ------
    InvalidInputError
        Naming the file, if there is less room than it may take.
    """
    needed = _most_bytes(stream)
    try:
        if hasattr(os, "posix_fallocate"):
            with tempfile.TemporaryFile(dir=path.parent) as trial:
                os.posix_fallocate(trial.fileno(), 0, needed)
        is_there, reason = shutil.disk_usage(path.parent).free >= needed, "the disk is too full"
    except OSError as error:
        is_there, reason = False, str(error.strerror)
    if not is_there:
        raise InvalidInputError(
            f"{path.name} takes up to {needed} bytes as an Alembic file, for which there is no "
            f"room ({reason}); write it to another disk"
        )


def _most_bytes(stream: FrameStream) -> int:
    """More than an Alembic file of the stream takes."""
    n_parts = max(1, len(stream.surface.parts))
    n_corners = 3 * len(stream.faces)
    once = 4 * (n_corners + len(stream.faces)) + 4 * stream.surface.size_bytes
    each = 12 * stream.n_verts + BYTES_OF_SAMPLE * n_parts
    return int(once + each * stream.n_frames + BYTES_OF_PART * n_parts)
