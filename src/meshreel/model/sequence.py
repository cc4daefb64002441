"""MeshSequence: an animated triangle mesh of fixed connectivity."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from meshreel.model.extent import Extent, Vertices, extent_of
from meshreel.model.frame_choice import FrameChoice, chosen_frames
from meshreel.model.showing import notebook_html, show
from meshreel.model.surface import PLAIN, Surface
from meshreel.model.tracks import Track, TrackSource, validated_tracks
from meshreel.model.validation import (
    Faces,
    read_only,
    validate_faces,
    validate_fps,
    validate_start,
    validate_vertices,
)

__all__ = [
    "Faces",
    "FrameContents",
    "FrameSource",
    "MeshSequence",
    "Vertices",
    "positions_size_bytes",
]


class FrameContents(Protocol):
    """Frames of constant connectivity, and what belongs to them."""

    @property
    def faces(self) -> Faces:
        """Vertex indices of each triangle, of shape (M, 3)."""

    @property
    def fps(self) -> float:
        """Frames per second; 0 = unknown."""

    @property
    def start_s(self) -> float:
        """Time of the first frame, in seconds."""

    @property
    def name(self) -> str:
        """A name for display."""

    @property
    def surface(self) -> Surface:
        """Polygons, attributes, groups, parts and materials of the mesh."""

    @property
    def tracks(self) -> Mapping[str, TrackSource]:
        """Quantities that change over time, other than the positions, by name."""

    def read(self, start: int, stop: int) -> Vertices:
        """Positions of frames start..stop - 1, of shape (stop - start, V, 3), all finite."""


class FrameSource(FrameContents, Protocol):
    """An animated mesh whose frames are read on demand.

    A `MeshSequence` is one; so are frame files that need not fit into memory together.
    """

    @property
    def n_frames(self) -> int:
        """Number of frames, T."""

    @property
    def n_verts(self) -> int:
        """Number of vertices, V."""

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Number type of the positions: float32 or float64."""

    @property
    def extent(self) -> Extent:
        """Extent of the positions of all frames."""

    @property
    def is_portable(self) -> bool:
        """Whether another process can read the frames through a pickled copy without frames."""


@dataclass(frozen=True, eq=False)
class MeshSequence:
    """An animated triangle mesh whose connectivity is the same in every frame.

    Its length is the number of frames. ``sequence[3]`` returns the positions of a frame, of shape
    (V, 3); a slice or a list of numbers selects several frames; iteration yields all in order.
    Arrays are validated on construction and stored as read-only views (faces as int32).

    Parameters
    ----------
    vertices : float32 or float64 array of shape (T, V, 3)
        Positions in model units; every value finite. T and V are at least 1.
    faces : integer array of shape (M, 3)
        Vertex indices of each triangle, in 0..V-1. M is at least 1.
    fps : float, default 0
        Frames per second; 0 means unknown.
    name : str, default ""
        A name for display; it has no other effect.
    start_s : float, default 0
        Time of the first frame, in seconds.
    surface : Surface, optional
        Polygons, texture coordinates, colors, materials and merged parts of the mesh. Default:
        none.
    tracks : mapping of str to Track, or to arrays of shape (T, N) or (T, N, C), optional
        Quantities that change over time, such as stress or velocity, by name. An array belongs to
        vertices, faces or corners: the first that number N. ``sequence.tracks[name]`` is a `Track`.
        Default: none.

    Raises
    ------
    InvalidInputError
        If an array has another shape or type, a position is not finite, a face refers to a vertex
        that does not exist, the frame rate is negative or not finite, or the surface or a track
        does not fit.
    """

    vertices: Vertices
    faces: Faces
    fps: float = 0.0
    name: str = ""
    start_s: float = 0.0
    surface: Surface = PLAIN
    tracks: Mapping[str, Track] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._validate(validate_vertices(self.vertices))

    @classmethod
    def of_finite(
        cls,
        vertices: Vertices,
        faces: Faces,
        fps: float,
        name: str,
        start_s: float,
        surface: Surface,
        tracks: Mapping[str, Track],
    ) -> "MeshSequence":
        """Return a sequence of positions of shape (T, V, 3) that the caller knows to be finite.

        Decoders have checked them already; everything else is validated.
        """
        sequence = cls.__new__(cls)
        vars(sequence).update(faces=faces, fps=fps, name=name, start_s=start_s)
        vars(sequence).update(surface=surface, tracks=tracks)
        sequence._validate(vertices)
        return sequence

    def _validate(self, vertices: Vertices) -> None:
        """Validate all but the positions, and store the arrays as read-only views."""
        object.__setattr__(self, "vertices", read_only(vertices))
        object.__setattr__(self, "faces", read_only(validate_faces(self.faces, len(vertices[0]))))
        object.__setattr__(self, "fps", validate_fps(self.fps))
        object.__setattr__(self, "start_s", validate_start(self.start_s))
        (n_frames, n_verts, _), n_faces = vertices.shape, len(self.faces)
        if self.surface is not PLAIN:
            object.__setattr__(self, "surface", self.surface.validated(n_verts, n_faces))
        tracks = self.tracks and validated_tracks(
            self.tracks, n_frames, n_verts, n_faces, self.surface
        )
        object.__setattr__(self, "tracks", dict(tracks or {}))

    @property
    def n_frames(self) -> int:
        """Number of frames, T."""
        return int(self.vertices.shape[0])

    @property
    def n_verts(self) -> int:
        """Number of vertices, V."""
        return int(self.vertices.shape[1])

    @property
    def n_faces(self) -> int:
        """Number of triangles, M."""
        return int(self.faces.shape[0])

    @property
    def raw_size_bytes(self) -> int:
        """Size of the uncompressed arrays: positions, tracks, faces and surface."""
        tracks_bytes = sum(track.values.nbytes for track in self.tracks.values())
        mesh_bytes = self.faces.nbytes + self.surface.size_bytes
        return int(self.vertices.nbytes + mesh_bytes + tracks_bytes)

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Number type of the positions."""
        return self.vertices.dtype

    @property
    def is_portable(self) -> bool:
        """False: a copy for another process contains all frames."""
        return False

    @cached_property
    def extent(self) -> Extent:
        """Extent of the positions of all frames."""
        return extent_of(self.vertices)

    def read(self, start: int, stop: int) -> Vertices:
        """Positions of frames start..stop - 1, of shape (stop - start, V, 3)."""
        return self.vertices[start:stop]

    def __len__(self) -> int:
        return self.n_frames

    def __getitem__(self, choice: FrameChoice) -> Vertices:
        """A frame of shape (V, 3), or frames of shape (T, V, 3); read-only."""
        numbers = chosen_frames(choice, self.n_frames)
        if isinstance(choice, slice):
            return self.vertices[choice]
        frames: Vertices = read_only(self.vertices[numbers])
        return frames

    def __iter__(self) -> Iterator[Vertices]:
        return iter(self.vertices)

    _repr_html_ = notebook_html
    show = show

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        tracks = f"; tracks {', '.join(self.tracks)}" if self.tracks else ""
        return (
            f"<MeshSequence{name}: {self.n_frames} frames, {self.n_verts} vertices, "
            f"{self.n_faces} faces, {self.fps:g} fps, {self.vertices.dtype}{tracks}>"
        )


def positions_size_bytes(source: FrameSource) -> int:
    """Size of the positions of all frames in memory, in bytes."""
    return source.n_frames * source.n_verts * 3 * source.dtype.itemsize
