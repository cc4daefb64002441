"""Live encoding: the first block determines the quantization step of all.

Decoded positions of the blocks just written predict tracks.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import numpy as np

from meshreel.arrays import Vertices
from meshreel.codec.bitstream.container import Sections
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.methods import LiveStart
from meshreel.codec.reel.encoding.block_coder import (
    CodedFrames,
    FieldBlockCoder,
    KeyedBlocks,
    checked_frames,
    coder_of,
)
from meshreel.codec.reel.encoding.block_frames import BlockFrames
from meshreel.codec.reel.encoding.effort import FINEST_STEP
from meshreel.codec.reel.encoding.target_step import step_for_target
from meshreel.codec.reel.encoding.tracks import live_track_coders
from meshreel.codec.reel.encoding.visibility import error_scale, steps_of_quality
from meshreel.codec.reel_options import ReelOptions
from meshreel.model.extent import extent_of
from meshreel.model.tracks import Track

MAX_LIVE_STEP = 1.5e-4
"""Largest step at the default quality, in diagonals of the model: that of 50 modes."""


@dataclass(frozen=True)
class FirstBlock:
    """The first block of a live sequence, a `RateModel`."""

    coder: FieldBlockCoder
    vertices: Vertices
    """float array of shape (T_b, V, 3). In internal order."""

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box, in model units."""
        return self.coder.frame.scale

    @property
    def model_size(self) -> float:
        """Mean diagonal of single frames, in diagonals of the bounding box."""
        return extent_of(self.vertices).mean_diagonal / self.diagonal or 1.0

    def step_of_quality(self, quality: float) -> float:
        """Return the step of a quality, in diagonals; limited, as later blocks may move more."""
        size = self.model_size * self.diagonal
        steps = steps_of_quality(quality, self.coder.mesh.faces, [self.vertices], size)
        return min(steps.modes, MAX_LIVE_STEP * error_scale(quality) * size) / self.diagonal

    @property
    def rounding(self) -> float:
        """Largest rounding error of a position by its number type, in diagonals."""
        return self._frames.rounding

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Number type of the positions."""
        return self.vertices.dtype

    @cached_property
    def _frames(self) -> BlockFrames:
        return self.coder.frames(self.vertices)

    def size_bytes(self, step: float, bound: float) -> float:
        """Return the bytes of the block for a step, with corrections that keep a bound."""
        coded = self.coder.with_step(max(FINEST_STEP, step), bound).code(self._frames)
        return float(sum(len(payload) for _, payload in coded.sections))

    def measure(self, step: float) -> float:
        """Unused: `check_live` rejects targets that limit a measured quantity."""
        raise AssertionError("live encoding does not measure sizes or errors")


class LiveCoder:
    """Encodes blocks of live frames with the step of the first block.

    Raises
    ------
    InvalidInputError
        If a target cannot be met.
    """

    def __init__(self, start: LiveStart) -> None:
        self._mesh = start.mesh
        coder = coder_of(start.mesh, start.frame)
        config = start.mesh.config
        assert isinstance(config, ReelOptions)  # the options of this method
        self._coder = coder.with_step(*step_for_target(config, FirstBlock(coder, start.first)))
        self._blocks = KeyedBlocks(self._coder)

        def decoded() -> Vertices:
            frames = self._coder.frames(start.first)
            return self._decoded(KeyedBlocks(self._coder).code(frames), frames)

        self._tracks = live_track_coders(start, decoded)
        self._has_predicted_tracks = any(
            track.header.coding.is_predicted for track in self._tracks.values()
        )

    def _decoded(self, coded: CodedFrames, frames: BlockFrames) -> Vertices:
        """Decoded positions of a block, in output order."""
        return coded.decoded(frames).take(self._mesh.output_order, axis=1)

    def leading_sections(self) -> Iterator[tuple[Section, bytes]]:
        """Return the sections between those of the mesh and the first block."""
        track_sections = (track.leading_section() for track in self._tracks.values())
        return chain(track_sections, self._coder.leading_sections())

    def code(self, vertices: Vertices, tracks: Mapping[str, Track]) -> Sections:
        """Encode the next block; positions are in internal order, tracks in the given one.

        Raises
        ------
        InvalidInputError
            If its number type, or values of a track, exceed the guaranteed bound.
        """
        frames = checked_frames(self._coder, vertices)
        coded = self._blocks.code(frames)
        positions = self._decoded(coded, frames) if self._has_predicted_tracks else None
        track_sections = [
            coder.code(tracks[name].values, positions) for name, coder in self._tracks.items()
        ]
        return chain(coded.sections, *track_sections)
