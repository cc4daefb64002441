"""Frames that come one after the other, to be written as they come."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import (
    MeshSequence,
    Vertices,
    validate_faces,
    validate_finite,
    validate_fps,
    validate_start,
    validate_vertices,
)
from meshreel.model.surface import PLAIN, Surface
from meshreel.model.tracks import TrackSource, check_tracks, copied
from meshreel.runtime.counting import counted
from meshreel.runtime.progress import Count, Progress, silent


class FrameStream:
    """A sequence whose positions pass by once, some frames at a time.

    Parameters
    ----------
    blocks : iterable of float arrays of shape (T, V, 3)
        The positions in model units, in order; the first block that has frames is read at once.
        Blocks may differ in T, which may be 0.
    faces : integer array of shape (M, 3)
    n_frames : int
        Of all blocks together.
    fps, name, start_s, surface
        As in `MeshSequence`.
    progress : Progress, default silent
        Told of every frame that was done with.
    notes : list of str, optional
        Gains one sentence for each thing that a format cannot hold as it is.
    tracks : mapping of str to TrackSource, optional
        Those that the file is to hold.

    Attributes
    ----------
    is_told : bool
        Whether anybody reads the notes.

    Attributes
    ----------
    n_verts : int
    dtype : dtype
        Of every block.
    first : float array of shape (V, 3)
        Positions of the first frame, known before any frame has passed.
    image_folder : str
        Name of the folder beside the file that is to have the images of the surface, in files of
        the names of `meshreel.formats.surfaces.image_files.image_names`; empty if there is none.
    beside : list of tuple of str and Path
        Files to be written beside the file, for it names them: by which name, and where to.

    Raises
    ------
    InvalidInputError
        As `MeshSequence`, of tracks too; while frames pass too, if blocks differ in their vertex
        count or type, a position is not finite, or there are not as many frames as were announced.
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
        self.n_verts, self.dtype = validate_vertices(first).shape[1], first.dtype
        self.faces = validate_faces(faces, self.n_verts)
        self.fps, self.name, self.start_s = validate_fps(fps), name, validate_start(start_s)
        self.surface = surface.validated(self.n_verts, len(self.faces))
        self.tracks = dict(tracks or {})
        check_tracks(self.tracks, n_frames, self.n_verts, len(self.faces), self.surface)
        self.first: Vertices = first[0]
        self.is_told = notes is not None
        self.notes = notes if notes is not None else []
        self._blocks: Iterator[Vertices] = chain([first], filled)
        self.progress = progress
        self.image_folder = ""
        self.beside: list[tuple[str, Path]] = []

    def frames(self) -> Iterator[Vertices]:
        """Positions of each frame, of shape (V, 3); they can be had only once."""
        index = 0
        for block in self._checked_blocks():
            for frame in block:
                yield frame
                index += 1
                self.progress("writing", Count(index, self.n_frames, "frames"))

    def values(self, index: int) -> dict[str, Values]:
        """Values of each track in a frame, of shape (N, C); they are read now."""
        return {name: track.read(index, index + 1)[0] for name, track in self.tracks.items()}

    def gather(self) -> MeshSequence:
        """All frames in memory; they can be had only once."""
        vertices = np.concatenate(list(self._checked_blocks()))
        tracks = {name: copied(one, range(self.n_frames)) for name, one in self.tracks.items()}
        return MeshSequence(
            vertices, self.faces, self.fps, self.name, self.start_s, self.surface, tracks
        )

    def _checked_blocks(self) -> Iterator[Vertices]:
        n_seen = 0
        for block in self._blocks:
            expected = (len(block), self.n_verts, 3)
            if block.shape != expected or block.dtype != self.dtype:
                raise InvalidInputError(
                    f"frames {n_seen} and after have shape {block.shape} and type {block.dtype}; "
                    f"those before have {expected} and {self.dtype}"
                )
            validate_finite(block, first_frame=n_seen)
            n_seen += len(block)
            if n_seen > self.n_frames:
                break
            yield block
        if n_seen != self.n_frames:
            come = f"{n_seen} or more" if n_seen > self.n_frames else str(n_seen)
            raise InvalidInputError(
                f"{counted(self.n_frames, 'frame')} were announced; {come} came"
            )
