"""Cache of open files, shared by all objects that play them."""

import hashlib
import os
from bisect import bisect_right
from collections import OrderedDict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

import meshreel
from meshreel.errors import MeshReelError
from meshreel.formats.scenes.parts import PartMesh, split_parts

Positions = npt.NDArray[np.floating[Any]]


class UnplayableError(Exception):
    """An object cannot play its file; the message is one sentence for the user."""


MAX_MESHES = 4
"""Meshes of segments of a file that are kept, as `meshreel` keeps their streams."""


class SegmentMesh(NamedTuple):
    """The mesh of a segment.

    Attributes
    ----------
    parts : dict of str to PartMesh
        By name, to which a number is added if another part has it.
    fingerprint : str
        Fingerprint of its faces: equal for the same vertices in the same order.
    """

    parts: dict[str, PartMesh]
    fingerprint: str


class Shown(NamedTuple):
    """A segment, and positions (V, 3) of its vertices."""

    segment: int
    positions: Positions


class OpenReel:
    """An open `.reel` file.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    reel : meshreel.ReelFile
    uneven_times : list of float, or None
        Seconds from the first frame to each, if they are not evenly spaced.

    Raises
    ------
    MeshReelError, OSError
        If it cannot be opened, or its first mesh is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.reel = meshreel.open(path)
        times = self.reel.timing.times
        self.uneven_times = None if times is None else (times - times[0]).tolist()
        self._name = self.reel.name or path.stem
        self._meshes: OrderedDict[int, SegmentMesh] = OrderedDict()
        self._shown: tuple[float, Shown] | None = None
        try:
            self.mesh(0)
        except BaseException:
            self.reel.close()
            raise

    def mesh(self, segment: int) -> SegmentMesh:
        """Return the mesh of a segment."""
        if segment not in self._meshes:
            reel = self.reel.segments[segment]
            parts: dict[str, PartMesh] = {}
            for part in split_parts(reel.faces, reel.surface, reel.n_verts, self._name):
                name, number = part.name, 1
                while name in parts:  # names of parts may be equal
                    number += 1
                    name = f"{part.name} {number}"
                parts[name] = part
            digest = hashlib.sha256(reel.faces.astype("<i4").tobytes()).hexdigest()[:16]
            self._meshes[segment] = SegmentMesh(parts, digest)
            if len(self._meshes) > MAX_MESHES:
                self._meshes.popitem(last=False)
        self._meshes.move_to_end(segment)
        return self._meshes[segment]

    def part_names(self) -> list[str]:
        """Return the names of the parts of all segments; opens each segment."""
        meshes = map(self.mesh, range(self.reel.n_segments))
        return list(dict.fromkeys(name for mesh in meshes for name in mesh.parts))

    def shown(self, position: float) -> Shown:
        """Return the shape at a position, linearly interpolated between frames of a segment."""
        if self._shown is None or self._shown[0] != position:
            self._shown = position, self._decoded(position)
        return self._shown[1]

    def _decoded(self, position: float) -> Shown:
        before = int(position)
        share = position - before
        segment = bisect_right(self.reel.starts, before) - 1
        start, stop = self.reel.starts[segment : segment + 2]
        reel = self.reel.segments[segment]
        first = reel[before - start].vertices
        if share == 0 or before + 1 == stop:
            return Shown(segment, first)
        second = reel[before + 1 - start].vertices
        return Shown(segment, ((1 - share) * first + share * second).astype(first.dtype))


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
