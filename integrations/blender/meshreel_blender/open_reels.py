"""Cache of open files, shared by all objects that play them."""

import hashlib
import os
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import meshreel
from meshreel.errors import MeshReelError
from meshreel.formats.scenes.parts import PartMesh, split_parts

Positions = npt.NDArray[np.floating[Any]]


class UnplayableError(Exception):
    """An object cannot play its file; the message is one sentence for the user."""


class OpenReel:
    """An open `.reel` file.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    reel : meshreel.ReelFile
    parts : list of PartMesh
    fingerprint : str
        Fingerprint of its faces: equal for files with the same vertices in the same order.

    Raises
    ------
    MeshReelError, OSError
        If it cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self.reel = meshreel.open(path)
        try:
            faces = self.reel.faces
            name = self.reel.name or path.stem
            self.parts: list[PartMesh] = list(
                split_parts(faces, self.reel.surface, self.reel.n_verts, name)
            )
        except BaseException:
            self.reel.close()
            raise
        self.fingerprint = hashlib.sha256(faces.astype("<i4").tobytes()).hexdigest()[:16]
        self._shown: tuple[float, Positions] | None = None

    def positions(self, position: float) -> Positions:
        """Positions (V, 3), linearly interpolated between two frames of the file."""
        if self._shown is None or self._shown[0] != position:
            self._shown = position, self._decoded(position)
        return self._shown[1]

    def _decoded(self, position: float) -> Positions:
        before = int(position)
        share = position - before
        first = self.reel[before]
        if share == 0:
            return first
        return ((1 - share) * first + share * self.reel[before + 1]).astype(first.dtype)


Stamp = tuple[int, int]

_opened: dict[Path, tuple[Stamp, OpenReel | UnplayableError]] = {}


def open_reel(path: Path) -> OpenReel:
    """Return the open file of a path; reopens it if it has changed.

    Raises
    ------
    UnplayableError
        If the file is missing or cannot be read. A file that could not be read is not tried again
        until it changes.
    """
    try:
        stat = path.stat()
    except OSError:
        release(path)
        raise UnplayableError(f"{path} is missing; restore it, or select another file") from None
    stamp = stat.st_mtime_ns, stat.st_size
    if path not in _opened or _opened[path][0] != stamp:
        release(path)
        _opened[path] = stamp, _try_open(path)
    found = _opened[path][1]
    if isinstance(found, UnplayableError):
        raise found
    return found


def _try_open(path: Path) -> OpenReel | UnplayableError:
    try:
        return OpenReel(path)
    except (MeshReelError, OSError) as error:
        return UnplayableError(_naming(path, error))


def _naming(path: Path, error: Exception) -> str:
    text = str(error)
    return text if os.fspath(path) in text else f"{path}: {text}"


def release(path: Path) -> None:
    """Close a file, so that it can be replaced."""
    _, found = _opened.pop(path, (None, None))
    if isinstance(found, OpenReel):
        found.reel.close()


def release_all() -> None:
    """Close all files."""
    for path in list(_opened):
        release(path)
