"""The method `reel`: a block of frames to the sections of a stream."""

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.container import read_block_counts
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.corrections import Corrections
from meshreel.codec.reel.encoding.analysis import (
    AnalysedFields,
    FieldChoices,
    analyse_fields,
)
from meshreel.codec.reel.encoding.block_frames import BlockFrames
from meshreel.codec.reel.encoding.corrections import check_promise, corrections_of_block
from meshreel.codec.reel.encoding.effort import choices_of
from meshreel.codec.reel.normative.blocks import layout_of, read_field_block, write_field_block
from meshreel.codec.reel.normative.fields import FieldBlock, KeyFields
from meshreel.codec.reel.normative.mesh import Connectivity, FieldMesh, shared_field_mesh
from meshreel.codec.source import CodedMesh, Piece
from meshreel.codec.stored_blocks import StoredBlock
from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.runtime.threads import chunks, in_threads, one_blas_thread

Vertices = npt.NDArray[np.floating]
Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
SectionsOf = Callable[[FieldBlock, FieldMesh, Corrections | None], Iterator[tuple[Section, bytes]]]

DECODED_FRAMES = 64
"""Frames that are decoded at once."""

MAX_NEW_MODE_RATIO = 2.0
"""A block with more new modes than this many times the modes of its key gains nothing from the key
and becomes a key block itself."""

ROUNDING_BESIDE, ENERGY_BESIDE = 100.0, 1e-9
"""Squared errors are told from fields if they are this many times the squared errors by rounding,
and this share of all squared coordinates."""


@dataclass(frozen=True)
class FieldBlockCoder:
    """Codes blocks of frames; those that refer to a key block do not depend on any other.

    Attributes
    ----------
    mesh : FieldMesh
    frame : BoundingFrame
    choices : FieldChoices
    bound : float or None
        Largest error of a position, in diagonals of the frame; None promises nothing.
    sections_of : callable
        Gives the sections of a block, its mesh and corrections: of positions or of another track.
    each_column : bool, default False
        Whether the bound is of each number by itself, and not of the length of all.
    """

    mesh: FieldMesh
    frame: BoundingFrame
    choices: FieldChoices
    bound: float | None = None
    sections_of: SectionsOf = write_field_block
    each_column: bool = False

    def with_step(self, position_step: float, bound: float | None) -> "FieldBlockCoder":
        """The same with another step, as `FieldChoices` has it, and bound."""
        choices = replace(self.choices, position_step=position_step)
        return replace(self, choices=choices, bound=bound)

    def leading_sections(self) -> Iterator[tuple[Section, bytes]]:
        """The sections before the first block, behind the connectivity."""
        if self.bound is not None:
            yield Section.PROMISE, write_promise(100.0 * self.bound)

    def frames(self, vertices: Vertices, order: Integers | None = None) -> "FieldFrames":
        """A block of positions of shape (T_b, V, 3), or of (T_b, N, C) values, ready to be coded.

        They are in internal order, or `order` is the number of each internal vertex.
        """
        numbers = None if order is None else order.astype(np.int32)
        given = np.ascontiguousarray(vertices)
        return FieldFrames(BlockFrames(given, self.frame, numbers))

    def code(
        self, frames: "FieldFrames", key: "KeyBlock | None" = None, reference: int = 0
    ) -> "CodedFrames":
        """Encode a block.

        Sums do not depend on the number of cores, so the bytes do not either.

        Parameters
        ----------
        frames : FieldFrames
        key : KeyBlock, optional
            The block that this one refers to.
        reference : int, default 0
            How many blocks the key precedes this one by.
        """
        with one_blas_thread():
            own_key = None if key is None else key.fields
            found = analyse_fields(frames.block, self.mesh, self.choices, own_key, reference)
            if key is not None and len(found.block.fields) > MAX_NEW_MODE_RATIO * key.block.n_modes:
                found = analyse_fields(frames.block, self.mesh, self.choices)
            corrections = None
            if self.bound is not None:
                corrections = corrections_of_block(
                    frames.block,
                    found.decoded,
                    self.bound,
                    frames.rounding,
                    each_column=self.each_column,
                )
        return CodedFrames(
            sections=self.sections_of(found.block, self.mesh, corrections),
            analysed=found,
            key=KeyBlock(self.mesh, found.block, found.own),
            is_key=not found.block.layout.reference,
        )

    def code_piece(self, piece: Piece, key: "KeyBlock", reference: int) -> "CodedPiece":
        """Read a block and encode it."""
        frames = self.frames(piece.read_given(), piece.order)
        coded = self.code(frames, key, reference)
        new_key = coded.key if coded.is_key else None
        return CodedPiece(frames.block.n_frames, list(coded.sections), new_key)


@dataclass(frozen=True)
class CodedPiece:
    """A block of frames as bytes.

    Attributes
    ----------
    n_frames : int
    sections : list of (Section, bytes)
    key : KeyBlock or None
        The block, where the following ones are to refer to it.
    """

    n_frames: int
    sections: list[tuple[Section, bytes]]
    key: "KeyBlock | None"


@dataclass(frozen=True)
class CodedFrames:
    """A block of frames as integers.

    Attributes
    ----------
    sections : iterator of (Section, bytes)
        Encoded when they are iterated, which is possible once.
    analysed : AnalysedFields
        Fields, without corrections.
    key : KeyBlock
        The block, for others to refer to it.
    is_key : bool
        Whether it refers to no block, so that others may refer to it.
    """

    sections: Iterator[tuple[Section, bytes]]
    analysed: AnalysedFields
    key: "KeyBlock"
    is_key: bool

    def decoded(self, frames: "FieldFrames") -> Vertices:
        """The positions that these frames decode to, without corrections."""
        out = np.empty(frames.block.vertices.shape, frames.block.vertices.dtype)
        pieces = chunks(len(out), DECODED_FRAMES)

        def fill(piece: slice) -> None:
            numbers = range(piece.start, piece.stop)
            self.analysed.decoded.fill(out[piece], numbers, frames.block.frame.placement)

        self.analysed.decoded.pack()
        in_threads(fill, pieces)
        return out

    def squared_error(self, frames: "FieldFrames") -> float:
        """Sum of the squared distances of decoded positions from these frames, in diagonals.

        Found from the fields, where that tells it exactly enough: rounding of positions only adds
        what it does on average, and must be small beside the error; as must the last bits of the
        energy.
        """
        found = self.analysed.squared_error
        n_positions = frames.block.n_frames * frames.block.n_verts
        by_rounding = float(frames.rounding**2) / 12.0 * n_positions
        if found > max(ROUNDING_BESIDE * by_rounding, ENERGY_BESIDE * frames.block.energy):
            return found + by_rounding
        apart: Floats = self.decoded(frames).astype(np.float64) - frames.vertices
        apart /= frames.block.frame.scale
        return float(np.vdot(apart, apart))


@dataclass(frozen=True)
class KeyBlock:
    """A block that others refer to.

    Only its sections are pickled: another process decodes them, and keeps the result for when
    it is given the same again.

    Attributes
    ----------
    mesh : FieldMesh
    block : FieldBlock
    fields : KeyFields
    """

    mesh: FieldMesh
    block: FieldBlock
    fields: KeyFields

    @cached_property
    def _sections(self) -> tuple[tuple[Section, bytes], ...]:
        return tuple(write_field_block(self.block, self.mesh))

    def __reduce__(self) -> tuple[Any, ...]:
        return _decoded_key, (self.mesh.connectivity, self._sections)


@lru_cache(maxsize=1)
def _decoded_key(
    connectivity: Connectivity, sections: tuple[tuple[Section, bytes], ...]
) -> KeyBlock:
    mesh, own = shared_field_mesh(*connectivity), dict(sections)
    n_frames, n_modes = read_block_counts(own[Section.BLOCK])
    stored = StoredBlock(0, n_frames, n_modes, own)
    with one_blas_thread():
        read = read_field_block(stored, layout_of(stored), mesh)
        fields = KeyFields(read.values(mesh))
    return KeyBlock(mesh, FieldBlock(read.layout, read.basis, read.fields), fields)


@dataclass(frozen=True)
class FieldFrames:
    """A block of frames as `reel` takes it.

    Attributes
    ----------
    block : BlockFrames
    """

    block: BlockFrames

    @property
    def vertices(self) -> Vertices:
        """Positions of shape (T_b, V, 3), in internal order."""
        found, order = self.block.vertices, self.block.order
        return found if order is None else found.take(order, axis=1)

    @cached_property
    def rounding(self) -> float:
        """Largest error, in diagonals, that the number type of the positions alone makes."""
        found = self.block.vertices
        return largest_rounding(found.min(), found.max(), found.dtype, self.block.frame)


class KeyedBlocks:
    """Blocks coded one after another, each of which refers to the last key block.

    The first block is one, and so are those that the last one does not help with.

    Parameters
    ----------
    coder : FieldBlockCoder
    """

    def __init__(self, coder: FieldBlockCoder) -> None:
        self._coder = coder
        self._key: KeyBlock | None = None
        self._n_behind = 0

    def code(self, frames: FieldFrames) -> CodedFrames:
        """The next block, coded."""
        coded = self._coder.code(frames, self._key, self._n_behind)
        if coded.is_key:
            self._key, self._n_behind = coded.key, 0
        self._n_behind += 1
        return coded


def coder_of(mesh: CodedMesh, frame: BoundingFrame) -> FieldBlockCoder:
    """The coder of a mesh with the choices that its options mean; its step is still to be set."""
    choices = choices_of(mesh.config)
    field_mesh = FieldMesh(mesh.faces, mesh.n_verts, choices.stencil_size)
    return FieldBlockCoder(field_mesh, frame, choices)


def largest_rounding(
    low: float, high: float, dtype: np.dtype[np.floating], frame: BoundingFrame
) -> float:
    """Largest error of a position between two coordinates, in diagonals, by its type alone."""
    spacing = float(np.spacing(np.maximum(abs(low), abs(high)).astype(dtype)))
    return float(np.sqrt(len(frame.origin)) * spacing / frame.scale)


def checked_frames(coder: FieldBlockCoder, vertices: Vertices) -> FieldFrames:
    """A block that is ready to be coded, and whose number type allows the promised bound.

    Raises
    ------
    InvalidInputError
        If it does not.
    """
    frames = coder.frames(vertices)
    if coder.bound is not None:
        check_promise(coder.bound, frames.rounding, vertices.dtype)
    return frames


def write_promise(max_error_percent: float) -> bytes:
    """Return the payload of the section PROMISE: the error bound that the encoder guarantees."""
    return struct.pack("<d", max_error_percent)
