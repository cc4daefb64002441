"""Frames streamed to a writer as they are produced."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import Faces, MeshSequence, Vertices
from meshreel.model.surface import PLAIN, Surface
from meshreel.model.tracks import TrackSource, check_tracks, read_track
from meshreel.model.validation import (
    validate_faces,
    validate_finite,
    validate_fps,
    validate_start,
    validate_vertices,
)
from meshreel.runtime.counting import counted
from meshreel.runtime.progress import Count, Progress, silent


class FrameStream:
    """A sequence whose positions can be read once, in blocks of frames.

    Parameters
    ----------
    blocks : iterable of float arrays of shape (T, V, 3)
        Positions in model units, in order. The first block with frames is read immediately.
        Blocks may differ in T, and T may be 0.
    faces : integer array of shape (M, 3)
    n_frames : int
        Total of all blocks.
    fps, name, start_s, surface
        As in `MeshSequence`.
    progress : Progress, default silent
        Called after every frame.
    notes : list of str, optional
        Receives a sentence for each thing that a format cannot store exactly.
    tracks : mapping of str to TrackSource, optional
        Tracks to write.

    Attributes
    ----------
    wants_notes : bool
        Whether the caller passed a list for notes.
    n_verts : int
    dtype : dtype
        Type of all positions.
    first : float array of shape (V, 3)
        Positions of the first frame, available before `frames` is read.
    image_folder : str
        Name of the folder next to the file for the images of the surface, whose file names are
        those of `meshreel.formats.surfaces.images.image_names`; empty if there is none.
    data_files : list of tuple of str and Path
        Further files that the file refers to: name in the file, and path to write.

    Raises
    ------
    InvalidInputError
        As `MeshSequence` and for invalid tracks; also while frames are read, if blocks differ in
        vertex count or type, a position is not finite, or the number of frames is not `n_frames`.
    """

    def __init__(
        self,
        blocks: Iterable[Vertices],
        faces: npt.NDArray[np.integer],
        *,
        n_frames: int,
        fps: float = 0.0,
        name: str = "",
        start_s: float = 0.0,
        surface: Surface = PLAIN,
        progress: Progress = silent,
        notes: list[str] | None = None,
        tracks: Mapping[str, TrackSource] | None = None,
    ) -> None:
        arrays: Iterator[Any] = (np.asarray(block) for block in blocks)
        filled = (block for block in arrays if block.size > 0)
        if (first := next(filled, None)) is None:
            raise InvalidInputError("a sequence needs at least one frame; got none")
        self.n_frames = n_frames
        self.n_verts: int = validate_vertices(first).shape[1]
        self.dtype: np.dtype[np.floating] = first.dtype
        self.faces: Faces = validate_faces(faces, self.n_verts)
        self.fps: float = validate_fps(fps)
        self.name: str = name
        self.start_s: float = validate_start(start_s)
        self.surface: Surface = surface.validated(self.n_verts, len(self.faces))
        self.tracks: dict[str, TrackSource] = dict(tracks or {})
        check_tracks(self.tracks, n_frames, self.n_verts, len(self.faces), self.surface)
        self.first: Vertices = first[0]
        self.wants_notes: bool = notes is not None
        self.notes: list[str] = notes if notes is not None else []
        self._blocks: Iterator[Vertices] = chain([first], filled)
        self.progress = progress
        self.image_folder = ""
        self.data_files: list[tuple[str, Path]] = []

    def frames(self) -> Iterator[Vertices]:
        """Yield the positions of each frame, of shape (V, 3); can be called only once."""
        index = 0
        for block in self._checked_blocks():
            for frame in block:
                yield frame
                index += 1
                self.progress("writing", Count(index, self.n_frames, "frames"))

    def values(self, index: int) -> dict[str, Values]:
        """Read the values of each track in a frame, of shape (N, C)."""
        return {name: track.read(index, index + 1)[0] for name, track in self.tracks.items()}

    def gather(self) -> MeshSequence:
        """Load all frames into memory; can be called only once."""
        vertices = np.concatenate(list(self._checked_blocks()))
        tracks = {name: read_track(one, range(self.n_frames)) for name, one in self.tracks.items()}
        return MeshSequence(
            vertices, self.faces, self.fps, self.name, self.start_s, self.surface, tracks
        )

    def _checked_blocks(self) -> Iterator[Vertices]:
        n_seen = 0
        for block in self._blocks:
            expected = (len(block), self.n_verts, 3)
            if block.shape != expected or block.dtype != self.dtype:
                raise InvalidInputError(
                    f"the block at frame {n_seen} has shape {block.shape} and type {block.dtype}; "
                    f"expected {expected} and {self.dtype}"
                )
            validate_finite(block, first_frame=n_seen)
            n_seen += len(block)
            if n_seen > self.n_frames:
                break
            yield block
        if n_seen != self.n_frames:
            received = f"{n_seen} or more" if n_seen > self.n_frames else str(n_seen)
            raise InvalidInputError(
                f"expected {counted(self.n_frames, 'frame')}; received {received}"
            )
