"""Animated meshes of a file with one or several meshes, whose frames are read on demand."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import MeshReelError
from meshreel.formats.options import Reading
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.sequence import Vertices
from meshreel.model.surface import PLAIN, Surface
from meshreel.model.tracks import TrackSource

BLOCK_BYTES = 1 << 22
"""Memory for the positions of frames that are computed, read or checked at once."""


@dataclass(frozen=True, eq=False)
class Visibility:
    """When a file shows a mesh."""

    times_s: Floats
    """float64 array of shape (N,). Ascending times in seconds."""
    is_shown: npt.NDArray[np.bool_]
    """bool array of shape (N,). Whether the mesh is shown from each time until the next one."""
    reason: str = ""
    """Why it is hidden, such as "purpose proxy", unless the file simply says so."""

    def at(self, times_s: Floats) -> npt.NDArray[np.bool_]:
        """Return whether the mesh is shown at ascending times of shape (T,)."""
        margin_s = np.diff(times_s).min(initial=np.inf) / 2 if len(times_s) > 1 else 0.0
        rows = np.searchsorted(self.times_s, times_s + margin_s, "right") - 1
        shown: npt.NDArray[np.bool_] = self.is_shown[np.maximum(rows, 0)]
        return shown


SHOWN = Visibility(np.zeros(1), np.ones(1, np.bool_))
"""A mesh that is always shown."""


@dataclass(frozen=True, eq=False)
class SceneMesh:
    """An animated mesh of a file, whose frames are read on demand."""

    name: str
    """Its path in the file, such as "/root/body"; unique in the file."""
    times_s: npt.NDArray[np.float64]
    """float64 array of shape (T,). Ascending times of its frames in seconds; one for a static mesh.
    There is a frame at each sample of the positions or of a transform above the mesh.
    """
    frame: Callable[[int], PolygonMesh]
    """Returns the mesh in world space. Its faces may differ between frames; callers check that."""
    surface: Callable[[int], Surface] = lambda frame: PLAIN
    """Returns attributes and groups for the faces of a frame, without face sizes. Called only
    for the first frame of a sequence.
    """
    fps: float | None = None
    """Frames per second that the file declares; None to infer it from the times, 0 if unknown."""
    tracks: Callable[[range], Mapping[str, TrackSource]] = lambda frames: {}
    """Returns the tracks of these frames, which share their faces and have all been read before.
    Frame 0 of a track is the first frame of the range.
    """
    positions: Callable[[int, int], Vertices] | None = None
    """Returns the positions of frames start..stop - 1 of a mesh whose faces never change, of shape
    (K, V, 3), faster than frame by frame.
    """
    visibility: Visibility = SHOWN
    keeps_surface: Callable[[int], bool] = lambda frame: True
    """Whether a frame has the surface of the frame before it; otherwise it begins a segment."""
    note_unread: Callable[[], None] = lambda: None
    """Adds notes on contents of the mesh that were not read; called after everything was read.
    Meshes of a file may share the function, which then covers all that were read.
    """
    error_bound: float | None = 0.0
    """As of a `MeshSequence`."""


def read_or_defer_error(name: str, read: Callable[[], SceneMesh]) -> SceneMesh:
    """Read a mesh; if that fails, return a mesh that raises the error when a frame is read.

    This way a damaged mesh does not prevent reading the other meshes of the file.
    """
    try:
        return read()
    except MeshReelError as error:
        kind, parts = type(error), error.message.parts

    def fail(frame: int) -> NoReturn:
        raise kind(*parts)

    return SceneMesh(name, np.zeros(1), fail)


ReadMeshes = Callable[[Path, Reading], Sequence[SceneMesh]]
"""Returns the meshes of a file, at least one; raises `FormatError` if the file is invalid."""
