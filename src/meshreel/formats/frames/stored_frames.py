"""Sequences whose frames stay in their files until they are read."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from meshreel.errors import InvalidInputError
from meshreel.model.sequence import (
    Extent,
    Faces,
    Vertices,
    read_only,
    validate_faces,
    validate_fps,
    validate_start,
)
from meshreel.model.surface import PLAIN, Surface
from meshreel.model.tracks import TrackSource, check_tracks


@dataclass(frozen=True, eq=False)
class StoredFrames:
    """A `FrameSource` whose positions are in files.

    Parameters
    ----------
    faces : integer array of shape (M, 3)
    dtype : float32 or float64
    extent : Extent
        Bounding box of all frames, in `dtype`.
    read_range : function of a start and a stop
        Reads the positions of frames start..stop - 1, of shape (stop - start, V, 3).
    start_s : float, default 0
    files : tuple of Path
        Files with the positions.
    is_portable : bool, default False
        Whether `read_range` can be pickled and used in another process.
    tracks : mapping of str to TrackSource, optional

    Raises
    ------
    InvalidInputError
        If a face has a vertex index out of range, the frame rate is negative or not finite, or the
        surface or a track does not fit.
    """

    n_frames: int
    n_verts: int
    faces: Faces
    fps: float
    name: str
    dtype: np.dtype[np.floating]
    extent: Extent
    read_range: Callable[[int, int], Vertices]
    start_s: float = 0.0
    surface: Surface = PLAIN
    files: tuple[Path, ...] = ()
    is_portable: bool = False
    tracks: Mapping[str, TrackSource] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "faces", read_only(validate_faces(self.faces, self.n_verts)))
        object.__setattr__(self, "fps", validate_fps(self.fps))
        object.__setattr__(self, "start_s", validate_start(self.start_s))
        surface = self.surface.validated(self.n_verts, len(self.faces))
        object.__setattr__(self, "surface", surface)
        check_tracks(self.tracks, self.n_frames, self.n_verts, len(self.faces), surface)

    def read(self, start: int, stop: int) -> Vertices:
        """Read the positions of frames start..stop - 1, with the index rules of slices."""
        start, stop, _ = slice(start, stop).indices(self.n_frames)
        return self.read_range(start, max(start, stop))


def changed_error(place: str) -> InvalidInputError:
    """Error for a file whose contents differ from those that were read first."""
    return InvalidInputError(
        f"{place} changed after it was first read; start again, and do not change the files "
        "until it is done"
    )
