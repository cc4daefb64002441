"""Blocks of frames to sections and back."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.bitstream.layout import Section
from meshreel.bitstream.reader import Stream
from meshreel.codec import payloads
from meshreel.codec.corrections import Corrections, corrected
from meshreel.codec.field_mesh import FieldMesh
from meshreel.codec.mesh_model import MeshModel
from meshreel.codec.methods import Basis, Method
from meshreel.codec.pipeline import (
    CodedBlock,
    FramesOf,
    Quantized,
    product_frames,
    synthesise,
)
from meshreel.codec.reel import FieldBlock, synthesise_fields
from meshreel.entropy.field_coder import IncomingFields, encode_fields
from meshreel.errors import CorruptStreamError
from meshreel.threads import in_background

Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class StoredBlock:
    """A block as it lies in a stream, and where its frames belong.

    Attributes
    ----------
    start, n_frames, n_modes : int
    sections : dict of Section to bytes
    """

    start: int
    n_frames: int
    n_modes: int
    sections: dict[Section, bytes]

    def payload(self, section: Section) -> bytes:
        """Payload of a section.

        Raises
        ------
        CorruptStreamError
            If the block has none.
        """
        if section not in self.sections:
            raise CorruptStreamError(
                f"the block of frames {self.start}..{self.start + self.n_frames - 1} has no "
                f"section {section.name}"
            )
        return self.sections[section]


def stored_blocks(stream: Stream, method: Method) -> list[StoredBlock]:
    """The blocks of a stream, checked to hold all its frames.

    Raises
    ------
    CorruptStreamError
        If their frames are not as many as the header announces, or a block has more modes than
        its method can have.
    """
    blocks: list[StoredBlock] = []
    start = 0
    for sections in stream.blocks():
        n_frames, n_modes = payloads.read_block(sections[Section.BLOCK])
        limit = _most_modes(method, n_frames, stream.header.n_verts)
        if n_modes > limit:
            raise CorruptStreamError(
                f"a block of {n_frames} frames has {n_modes} modes; {limit} are possible"
            )
        blocks.append(StoredBlock(start, n_frames, n_modes, sections))
        start += n_frames
    if start != stream.header.n_frames:
        raise CorruptStreamError(
            f"the blocks hold {start} frames; the header announces {stream.header.n_frames}"
        )
    return blocks


def write_coded_block(
    block: CodedBlock, n_frames: int, method: Method, before: Quantized | None
) -> Iterator[tuple[Section, bytes]]:
    """The sections of a block.

    Parameters
    ----------
    block : CodedBlock
    n_frames : int
    method : Method
    before : Quantized or None
        Dictionary of the block before, if this one's is stored as the difference to it.
    """
    yield Section.BLOCK, payloads.write_block(n_frames, block.n_modes)
    if block.basis is not None:
        integers = (
            block.basis.integers if before is None else block.basis.integers - before.integers
        )
        yield Section.BASIS, payloads.write_curves(Quantized(integers, block.basis.steps))
    on_graph = method.basis is Basis.GRAPH
    if block.anchors is not None:
        yield (
            Section.ANCHORS,
            payloads.write_curves(block.anchors)
            if on_graph
            else payloads.write_rows(block.anchors, shared=True),
        )
    yield Section.COEFFICIENTS, payloads.write_rows(block.coefficients, shared=on_graph)


def write_field_block(block: FieldBlock, mesh: FieldMesh) -> Iterator[tuple[Section, bytes]]:
    """The sections of a block of `reel`."""
    yield Section.BLOCK, payloads.write_block(len(block.times), block.n_modes)
    yield Section.FIELDS, payloads.write_layout(block.layout, block.taps)
    yield Section.BASIS, payloads.write_times(block.times)
    yield Section.COEFFICIENTS, encode_fields(block.fields[:], mesh.passes)


def frame_sources(
    stream: Stream,
    mesh: MeshModel,
    method: Method,
    wanted: range,
    order: Integers,
    n_modes: int | None = None,
) -> Iterator[tuple[StoredBlock, FramesOf]]:
    """For each block that holds any of the wanted frames, what gives its frames.

    Parameters
    ----------
    stream : Stream
    mesh : MeshModel
    method : Method
    wanted : range
    order : integer array of shape (V,)
        Internal number of each vertex that goes out.
    n_modes : int, optional
        Of `reel`, the first so many modes only, without corrections.
    """
    if method.basis is not Basis.JOINT:
        for stored, block in read_coded_blocks(stream, mesh, method, wanted):
            yield stored, synthesise(block, mesh, method, order)
        return
    field_mesh: FieldMesh | None = None
    for stored in stored_blocks(stream, method):
        if stored.start < wanted.stop and stored.start + stored.n_frames > wanted.start:
            field_block, field_mesh = _read_field_block(stored, mesh, field_mesh)
            if n_modes is not None:
                field_block = field_block.first_modes(n_modes)
            basis, fields = synthesise_fields(field_block, field_mesh)
            frames_of = product_frames(basis, fields[:, :, order])
            if n_modes is None and Section.CORRECTIONS in stored.sections:
                frames_of = corrected(frames_of, _read_corrections(stored, mesh), order)
            yield stored, frames_of


def _read_corrections(stored: StoredBlock, mesh: MeshModel) -> Corrections:
    payload = stored.payload(Section.CORRECTIONS)
    return payloads.read_corrections(payload, stored.n_frames, mesh.n_verts)


def _read_field_block(
    stored: StoredBlock, mesh: MeshModel, before: FieldMesh | None
) -> tuple[FieldBlock, FieldMesh]:
    """The block, and the mesh of its layout: that of the block before where it serves."""
    n_modes, n_frames = stored.n_modes, stored.n_frames
    layout, taps = payloads.read_layout(stored.payload(Section.FIELDS), n_modes)
    serves = before is not None and before.stencil_size == layout.stencil_size
    field_mesh = before if before is not None and serves else FieldMesh(mesh, layout.stencil_size)
    scales = in_background(lambda: field_mesh.scales)
    times = payloads.read_times(stored.payload(Section.BASIS), n_modes, n_frames)
    scales.result()
    coded = stored.payload(Section.COEFFICIENTS)
    fields = IncomingFields(coded, n_modes, mesh.n_verts, field_mesh.passes)
    return FieldBlock(layout, times, fields, taps), field_mesh


def _most_modes(method: Method, n_frames: int, n_verts: int) -> int:
    """Modes that a block of this many frames can have."""
    if method.basis is Basis.GRAPH:
        return n_verts
    return 3 * n_frames if method.basis is Basis.JOINT else n_frames


def read_coded_blocks(
    stream: Stream, mesh: MeshModel, method: Method, wanted: range
) -> Iterator[tuple[StoredBlock, CodedBlock]]:
    """The blocks that hold any of the wanted frames, in order.

    Of a tracked dictionary the differences of all blocks before are added up; nothing else of
    them is decoded.
    """
    before: Quantized | None = None
    for stored in stored_blocks(stream, method):
        if stored.start >= wanted.stop:
            return
        is_wanted = stored.start + stored.n_frames > wanted.start
        if method.basis is Basis.TRACKED or (is_wanted and method.basis is Basis.TRAJECTORIES):
            before = _read_dictionary(stored, tracked_from(method, before, stored.n_frames))
        if is_wanted:
            yield stored, _read_coded_block(stored, mesh, method, before)


def _read_dictionary(stored: StoredBlock, before: Quantized | None) -> Quantized:
    basis = payloads.read_curves(stored.payload(Section.BASIS), stored.n_modes, stored.n_frames)
    if before is None:
        return basis
    if before.integers.shape != basis.integers.shape:
        raise CorruptStreamError(
            f"a block of {stored.n_modes} modes cannot follow one of {before.integers.shape[1]}"
        )
    return Quantized(before.integers + basis.integers, basis.steps)


def tracked_from(method: Method, before: Quantized | None, n_frames: int) -> Quantized | None:
    """The dictionary that a block's is stored as the difference to; None if it starts anew.

    A block of another length (the last, as a rule) starts anew.
    """
    if method.basis is not Basis.TRACKED or before is None:
        return None
    return before if before.integers.shape[2] == n_frames else None


def _read_coded_block(
    stored: StoredBlock, mesh: MeshModel, method: Method, basis: Quantized | None
) -> CodedBlock:
    n_frames, n_modes, n_anchors = stored.n_frames, stored.n_modes, len(mesh.anchors)
    coefficients = stored.payload(Section.COEFFICIENTS)
    if method.basis is Basis.GRAPH:
        return CodedBlock(
            None,
            payloads.read_curves(stored.payload(Section.ANCHORS), n_anchors, n_frames),
            payloads.read_rows(coefficients, n_modes, n_frames, shared=True),
        )
    anchors = None
    if method.has_anchors:
        anchors = payloads.read_rows(
            stored.payload(Section.ANCHORS), n_modes, n_anchors, shared=True
        )
    return CodedBlock(
        basis, anchors, payloads.read_rows(coefficients, n_modes, mesh.n_verts, shared=False)
    )
