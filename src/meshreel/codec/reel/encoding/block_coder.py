"""Encoder of blocks of the method `reel`."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, starmap

import numpy as np

from meshreel.arrays import Floats, Integers, Vertices
from meshreel.codec.bitstream.container import error_bound_sections
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.reel.encoding.analysis import AnalyzedFields, FieldChoices, analyze_fields
from meshreel.codec.reel.encoding.block_frames import BlockFrames
from meshreel.codec.reel.encoding.corrections import corrections_of_block
from meshreel.codec.reel.encoding.effort import choices_of
from meshreel.codec.reel.normative.blocks import Corrections, write_field_block
from meshreel.codec.reel.normative.fields import FieldBlock
from meshreel.codec.reel.normative.mesh import FieldMesh, ItemGraph
from meshreel.codec.reel_options import ReelOptions
from meshreel.codec.source import CodedMesh
from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.metrics.reference import relative
from meshreel.model.surface import Domain
from meshreel.runtime.threads import in_chunks, one_blas_thread

SectionsOf = Callable[[FieldBlock, FieldMesh, Corrections | None], list[tuple[Section, bytes]]]

DECODED_FRAMES = 64
"""Number of frames decoded per task."""

MAX_NEW_MODE_RATIO = 2.0
"""A block with more new modes than this many times the modes of its key becomes a key block."""

MAX_ROUNDING_RATIO, MIN_ENERGY_RATIO = 1e-13, 1e-9
"""Squared errors are computed from fields if squared rounding errors are at most this share of them
for each position, so that four standard deviations of their product with other errors are below the
slack of `KgMeter`; and if they exceed this share of all squared coordinates."""

SLACK = 1e-6
"""Relative margin of errors that are computed from fields."""


@dataclass(frozen=True)
class FieldBlockCoder:
    """Codes blocks of frames; each depends on at most one other, its key block."""

    mesh: FieldMesh
    frame: BoundingFrame
    choices: FieldChoices
    bound: float | None = None
    """Guaranteed largest error of a position, in diagonals of the frame; None: no guarantee."""
    sections_of: SectionsOf = write_field_block
    """Encodes a block of positions or of another track, given its mesh and corrections."""
    each_column: bool = False
    """Whether the bound applies to each column, as in `find_corrections`."""

    def with_step(self, position_step: float, bound: float | None) -> "FieldBlockCoder":
        """Return the coder with another step, as in `FieldChoices`, and bound."""
        choices = replace(self.choices, position_step=position_step)
        return replace(self, choices=choices, bound=bound)

    def leading_sections(self) -> list[tuple[Section, bytes]]:
        """Return the sections before the first block, after the connectivity."""
        return error_bound_sections(None if self.bound is None else 100.0 * self.bound)

    def frames(self, vertices: Vertices, order: Integers | None = None) -> BlockFrames:
        """Wrap a block of positions of shape (T_b, V, 3), or of values of shape (T_b, N, C).

        `order` is the given number of each internal vertex; None means internal order.
        """
        numbers = None if order is None else order.astype(np.int32)
        return BlockFrames(np.ascontiguousarray(vertices), self.frame, numbers)

    def code(
        self, frames: BlockFrames, key: Floats | None = None, reference: int = 0
    ) -> "CodedFrames":
        """Encode a block; the bytes do not depend on the number of cores.

        Parameters
        ----------
        key : float64 array of shape (V, K), optional
            Fields of the block that this one refers to.
        reference : int, default 0
            Number of blocks from that one to this one.
        """
        with one_blas_thread():
            analyzed = analyze_fields(frames, self.mesh, self.choices, key, reference)
            if key is not None and len(analyzed.block.fields) > MAX_NEW_MODE_RATIO * key.shape[1]:
                analyzed = analyze_fields(frames, self.mesh, self.choices)
            corrections = None
            if self.bound is not None:
                corrections = corrections_of_block(
                    frames,
                    analyzed.decoded,
                    self.bound,
                    frames.rounding,
                    each_column=self.each_column,
                )
        return CodedFrames(
            # `starmap` defers the entropy coding, `sections_of`, until a section is needed.
            sections=chain.from_iterable(
                starmap(self.sections_of, [(analyzed.block, self.mesh, corrections)])
            ),
            analyzed=analyzed,
            corrections=corrections,
            is_key=not analyzed.block.layout.reference,
        )


@dataclass(frozen=True)
class CodedFrames:
    """A block of frames as integers."""

    sections: Iterator[tuple[Section, bytes]]
    """Iterator of (Section, bytes). Entropy coded while iterated, which is possible once."""
    analyzed: AnalyzedFields
    corrections: Corrections | None
    is_key: bool
    """Whether the block refers to no other one, so that others may refer to it."""

    def decoded(self, frames: BlockFrames) -> Vertices:
        """Decoded positions of these frames, in internal order."""
        out = np.empty(frames.vertices.shape, frames.vertices.dtype)
        corrections = None if self.corrections is None else self.corrections.by_frame(len(out))

        def fill(piece: slice) -> None:
            numbers = range(piece.start, piece.stop)
            batch_corrections = None if corrections is None else corrections.of_frames(numbers)
            joint.fill(out[piece], numbers, frames.frame.placement, batch_corrections)

        joint = self.analyzed.decoded
        joint.pack()
        in_chunks(fill, len(out), DECODED_FRAMES)
        return out

    def squared_error(self, frames: BlockFrames) -> float:
        """Sum of squared distances of decoded positions from these frames, in diagonals.

        Computed from the fields if this is accurate enough. It then includes the mean effect of
        rounding positions.
        """
        squared_error = self.analyzed.squared_error
        n_positions = frames.n_frames * frames.n_verts
        by_rounding = float(frames.rounding**2) / 12.0 * n_positions
        is_accurate = by_rounding < MAX_ROUNDING_RATIO * n_positions * squared_error
        if is_accurate and squared_error > MIN_ENERGY_RATIO * frames.energy:
            return squared_error + by_rounding
        errors: Floats = self.decoded(frames).astype(np.float64) - frames.internal_vertices
        errors /= frames.frame.scale
        return float(np.vdot(errors, errors))


class KgMeter:
    """KG error in percent, computed from fields; frames are decoded only if errors are tiny."""

    def __init__(self) -> None:
        self._error = self._spread = 0.0

    def add(self, frames: BlockFrames, coded: CodedFrames) -> None:
        """Add the next frames, original and coded."""
        self.add_squares(coded.squared_error(frames), frames.spread)

    def add_squares(self, error: float, spread: float) -> None:
        """Add the squared errors of frames, and the squared distances from their means."""
        self._error += error
        self._spread += spread

    @property
    def value(self) -> float:
        """Error of all frames so far."""
        return 100.0 * (1.0 + SLACK) * relative(math.sqrt(self._error), math.sqrt(self._spread))


class KeyedBlocks:
    """Codes consecutive blocks; each refers to the last key block.

    The first block is a key block, and so are those that gain nothing from the last one.
    """

    def __init__(self, coder: FieldBlockCoder) -> None:
        self._coder = coder
        self._key: Floats | None = None
        self._reference = 0

    def code(self, frames: BlockFrames) -> CodedFrames:
        """Encode the next block."""
        coded = self._coder.code(frames, self._key, self._reference)
        if coded.is_key:
            self._key, self._reference = coded.analyzed.new_fields, 0
        self._reference += 1
        return coded

    def skip(self) -> None:
        """Count a block that is coded in another way."""
        self._reference += self._key is not None


def coder_of(mesh: CodedMesh, frame: BoundingFrame) -> FieldBlockCoder:
    """Return the coder of a mesh with its options; its step is still to be set."""
    assert isinstance(mesh.config, ReelOptions)  # the options of this method
    choices = choices_of(mesh.config)
    graph = ItemGraph(mesh.links, mesh.n_verts)
    field_mesh = shared_field_mesh(mesh, Domain.VERTEX, graph, choices.stencil_size)
    return FieldBlockCoder(field_mesh, frame, choices)


def shared_field_mesh(
    mesh: CodedMesh, domain: Domain, graph: ItemGraph, stencil_size: int
) -> FieldMesh:
    """Return the hierarchy of the items of a domain, which positions and tracks share."""
    key = FieldMesh, domain, stencil_size
    if key not in mesh.derived:
        mesh.derived[key] = FieldMesh(graph.faces, graph.n_items, stencil_size)
    result = mesh.derived[key]
    assert isinstance(result, FieldMesh)
    return result
