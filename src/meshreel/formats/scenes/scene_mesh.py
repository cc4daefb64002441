"""Animated meshes of a file that holds one or several, each frame read when it is asked for."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from meshreel.errors import MeshReelError
from meshreel.formats.options import ReadOptions
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.surface import PLAIN, Surface
from meshreel.model.tracks import TrackSource


def no_surface(frame: int) -> Surface:
    """The surface of a mesh that has nothing but positions and faces, in any frame."""
    return PLAIN


def no_tracks(frames: range) -> Mapping[str, TrackSource]:
    """The tracks of a mesh that has none, in any frames."""
    return {}


@dataclass(frozen=True, eq=False)
class SceneMesh:
    """An animated mesh of a file, each frame of which is read when it is asked for.

    Parameters
    ----------
    name : str
        Its path in the file, such as "/root/body"; no other mesh of the file has it.
    times_s : float64 array of shape (T,)
        When its frames are, in seconds, ascending; one for a mesh that does not move. Frames are
        where positions, or any transform above the mesh, are sampled.
    frame : function of a frame number
        The mesh in world space. Its faces may differ between frames: that is looked for.
    surface : function of a frame number, optional
        Attributes and groups of the mesh, by its faces as that frame has them; without face
        sizes, which the frame says. Only the first frame of a sequence is asked for them.
    fps : float, optional
        Frames per second, if the file says so; else it follows from the times.
    tracks : function of a range of frame numbers, optional
        What changes over time beside the positions in these frames, whose faces are the same and
        which were all asked for before. Of a track, frame 0 is the first of the range.
    """

    name: str
    times_s: npt.NDArray[np.float64]
    frame: Callable[[int], PolygonMesh]
    surface: Callable[[int], Surface] = no_surface
    fps: float | None = None
    tracks: Callable[[range], Mapping[str, TrackSource]] = no_tracks


def readable_mesh(name: str, read: Callable[[], SceneMesh]) -> SceneMesh:
    """The mesh that a function gives; if it fails, one that fails so when a frame is asked for.

    One bad mesh does not stand in the way of those beside it then.
    """
    try:
        return read()
    except MeshReelError as error:
        kind, reason = type(error), str(error)

    def fail(frame: int) -> NoReturn:
        raise kind(reason)

    return SceneMesh(name, np.zeros(1), fail)


ReadMeshes = Callable[[Path, ReadOptions], Sequence[SceneMesh]]
"""Gives the meshes of a file, at least one; raises `FormatError` naming what is wrong with it."""
