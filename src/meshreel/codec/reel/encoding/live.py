"""Live encoding: the first block determines the quantization step of all.

Decoded positions of the blocks just written predict tracks.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import chain

import numpy as np

from meshreel.arrays import Values, Vertices
from meshreel.codec.achieved import require_same_bits
from meshreel.codec.bitstream.container import Sections, payload_bytes
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.method_names import LOSSLESS
from meshreel.codec.methods import LiveStart
from meshreel.codec.reel.encoding.block_coder import (
    FieldBlockCoder,
    KeyedBlocks,
    coder_of,
)
from meshreel.codec.reel.encoding.block_frames import BlockFrames
from meshreel.codec.reel.encoding.corrections import check_error_bound
from meshreel.codec.reel.encoding.effort import FINEST_STEP
from meshreel.codec.reel.encoding.exact_positions import ExactPositionCoder, PositionCoder
from meshreel.codec.reel.encoding.grid_positions import grid_coder
from meshreel.codec.reel.encoding.target_step import step_for_target
from meshreel.codec.reel.encoding.track_coders import ExactTrackCoder, in_order
from meshreel.codec.reel.encoding.tracks import live_track_coders
from meshreel.codec.reel.encoding.visibility import steps_of_quality
from meshreel.codec.reel_options import ReelOptions
from meshreel.codec.targets import error_scale
from meshreel.kernel.exact import decode_exact
from meshreel.kernel.mesh import Neighbors
from meshreel.model.extent import extent_of
from meshreel.model.tracks import Track

Decoded = Callable[[], Vertices] | None
"""Decodes the positions of a block, in internal order; None if they predict no tracks."""

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
        return float(payload_bytes(coded.sections))

    def measure(self, step: float) -> float:
        """Unused: `check_live` rejects targets that limit a measured quantity."""
        raise AssertionError("live encoding does not measure sizes or errors")


class _ModeBlocks:
    """Encodes blocks of positions with the step of the first block; raises as `LiveCoder`."""

    def __init__(self, start: LiveStart) -> None:
        config, coder = start.mesh.config, coder_of(start.mesh, start.frame)
        assert isinstance(config, ReelOptions)  # the options of this method
        self._coder = coder.with_step(*step_for_target(config, FirstBlock(coder, start.first)))
        self._blocks = KeyedBlocks(self._coder)
        self.leading_sections = self._coder.leading_sections

    def code(self, vertices: Vertices) -> tuple[Sections, Decoded]:
        frames, bound = self._coder.frames(vertices), self._coder.bound
        if bound is not None:
            check_error_bound(bound, frames.rounding, vertices.dtype)
        coded = self._blocks.code(frames)
        return coded.sections, lambda: coded.decoded(frames)

    def decoded_first(self, vertices: Vertices) -> Decoded:
        frames, blocks = self._coder.frames(vertices), KeyedBlocks(self._coder)
        return lambda: blocks.code(frames).decoded(frames)


class _ExactBlocks:
    """Encodes blocks of positions losslessly or on a grid; raises as `LiveCoder`."""

    def __init__(self, start: LiveStart) -> None:
        mesh, first = start.mesh, start.first
        self._coder: PositionCoder = ExactPositionCoder(mesh.links, mesh.n_verts)
        if mesh.config.method != LOSSLESS:
            self._coder = grid_coder(mesh, start.frame, extent_of(first), first.dtype)
        self.leading_sections = self._coder.leading_sections

    def code(self, vertices: Vertices) -> tuple[Sections, Decoded]:
        coded = self._coder.code(vertices)
        if self._coder.is_exact:
            _verify("positions", vertices, coded, self._coder.graph)
        return coded, self.decoded_first(vertices)

    def decoded_first(self, vertices: Vertices) -> Decoded:
        return (lambda: vertices) if self._coder.is_exact else None


class LiveCoder:
    """Encodes blocks of live frames.

    Raises
    ------
    InvalidInputError
        If a target cannot be met, or the bound of a track cannot be guaranteed.
    """

    def __init__(self, start: LiveStart) -> None:
        self._mesh = start.mesh
        has_modes = start.mesh.config.method == "reel"
        self._blocks = _ModeBlocks(start) if has_modes else _ExactBlocks(start)
        first = self._blocks.decoded_first(start.first)
        positions = None if first is None else partial(self._in_output_order, first)
        self._tracks = live_track_coders(start, positions)
        self._needs_positions = any(track.needs_positions for track in self._tracks.values())

    def _in_output_order(self, decoded: Callable[[], Vertices]) -> Vertices:
        """Return decoded positions in output order."""
        return decoded().take(self._mesh.output_order, axis=1)

    def leading_sections(self) -> Iterator[tuple[Section, bytes]]:
        """Return the sections between those of the mesh and the first block."""
        track_sections = (track.leading_section() for track in self._tracks.values())
        return chain(track_sections, self._blocks.leading_sections())

    def code(self, vertices: Vertices, tracks: Mapping[str, Track]) -> Sections:
        """Encode the next block; positions are in internal order, tracks in the given one.

        Raises
        ------
        InvalidInputError
            If its number type, or values of a track, exceed the guaranteed bound.
        SolverError
            If lossless values do not decode to the same bits.
        """
        sections, decoded = self._blocks.code(vertices)
        positions = self._in_output_order(decoded) if decoded and self._needs_positions else None
        of_tracks = []
        for name, coder in self._tracks.items():
            values = tracks[name].values
            of_tracks.append(coded := coder.code(values, positions))
            if isinstance(coder, ExactTrackCoder):
                values = in_order(values, coder.order)
                _verify(f"values of track {name!r}", values, coded, coder.graph)
        return chain(sections, *of_tracks)


def _verify(
    name: str, values: Values, coded: list[tuple[Section, bytes]], graph: Neighbors
) -> None:
    """Raise SolverError if the last section does not decode to the same bits."""
    require_same_bits(name, values, decode_exact(coded[-1][1], values.shape, values.dtype, graph))
