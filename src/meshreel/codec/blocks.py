"""Blocks of frames to sections and back."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from meshreel.bitstream.layout import Section
from meshreel.bitstream.reader import Stream
from meshreel.codec import payloads
from meshreel.codec.methods import Basis, Method
from meshreel.entropy.field_coder import decode_fields, encode_fields
from meshreel.errors import CorruptStreamError
from meshreel.paper.mesh_model import MeshModel
from meshreel.paper.pipeline import CodedBlock, Quantized
from meshreel.reel.agreed.corrections import Corrections
from meshreel.reel.agreed.field_mesh import FieldMesh
from meshreel.reel.agreed.fields import FieldBlock
from meshreel.runtime.profiling import stage
from meshreel.runtime.threads import in_background


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
    """All blocks of a stream; raises as `stored_block`."""
    return [stored_block(stream, method, number) for number in range(len(stream.places))]


def stored_block(stream: Stream, method: Method, number: int) -> StoredBlock:
    """A block of a stream.

    Parameters
    ----------
    stream : Stream
    method : Method
    number : int

    Raises
    ------
    CorruptStreamError
        If it is damaged, has more modes than its method can have, or other frames than the index
        says.
    """
    sections = stream.block(number)
    n_frames, n_modes = payloads.read_block(sections[Section.BLOCK])
    if n_frames != stream.places[number].n_frames:
        raise CorruptStreamError(
            f"block {number} has {n_frames} frames; the index says {stream.places[number].n_frames}"
        )
    limit = _most_modes(method, n_frames, stream.header.n_verts)
    if n_modes > limit:
        raise CorruptStreamError(
            f"a block of {n_frames} frames has {n_modes} modes; {limit} are possible"
        )
    return StoredBlock(stream.starts[number], n_frames, n_modes, sections)


def write_coded_block(
    block: CodedBlock,
    n_frames: int,
    method: Method,
    before: Quantized | None,
    exact: bytes = b"",
) -> Iterator[tuple[Section, bytes]]:
    """The sections of a block.

    Parameters
    ----------
    block : CodedBlock
    n_frames : int
    method : Method
    before : Quantized or None
        Dictionary of the block before, if this one's is stored as the difference to it.
    exact : bytes, optional
        Positions of isolated vertices.
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
    if exact:
        yield Section.EXACT, exact
    yield Section.COEFFICIENTS, payloads.write_rows(block.coefficients, shared=on_graph)


def write_field_block(
    block: FieldBlock, mesh: FieldMesh, corrections: Corrections | None = None
) -> Iterator[tuple[Section, bytes]]:
    """The sections of a block of `reel`."""
    yield Section.BLOCK, payloads.write_block(len(block.times), block.n_modes)
    yield Section.FIELDS, payloads.write_layout(block.layout, block.taps)
    yield Section.BASIS, payloads.write_times(block.times)
    if corrections is not None:
        yield Section.CORRECTIONS, payloads.write_corrections(corrections)
    yield Section.COEFFICIENTS, encode_fields(block.fields, mesh.passes)


def read_corrections(stored: StoredBlock, n_verts: int) -> Corrections | None:
    """The corrections of a block of `reel`, if it has some."""
    if Section.CORRECTIONS not in stored.sections:
        return None
    payload = stored.payload(Section.CORRECTIONS)
    return payloads.read_corrections(payload, stored.n_frames, n_verts)


def read_field_block(
    stored: StoredBlock, mesh: MeshModel, before: FieldMesh | None
) -> tuple[FieldBlock, FieldMesh]:
    """The block, and the mesh of its layout: that of the block before where it serves."""
    n_modes, n_frames = stored.n_modes, stored.n_frames
    layout, taps = payloads.read_layout(stored.payload(Section.FIELDS), n_modes)
    serves = before is not None and before.stencil_size == layout.stencil_size
    field_mesh = before if before is not None and serves else FieldMesh(mesh, layout.stencil_size)
    scales = in_background(lambda: field_mesh.scales)
    times = payloads.read_times(stored.payload(Section.BASIS), n_modes, n_frames)
    with stage("waiting"):
        scales.result()
    stencils = in_background(lambda: field_mesh.stencils)
    coded = stored.payload(Section.COEFFICIENTS)
    fields = decode_fields(coded, n_modes, mesh.n_verts, field_mesh.passes)
    stencils.result()
    return FieldBlock(layout, times, fields, taps), field_mesh


def _most_modes(method: Method, n_frames: int, n_verts: int) -> int:
    """Modes that a block of this many frames can have."""
    if method.basis is Basis.GRAPH:
        return n_verts
    return 3 * n_frames if method.basis is Basis.JOINT else n_frames


class Dictionaries:
    """Dictionaries of the paper's blocks; of tracked ones the differences are added up.

    Nothing but dictionaries is decoded of the blocks before the one that is asked for.

    Parameters
    ----------
    blocks : callable
        Gives the stored block of a number.
    method : Method
    """

    def __init__(self, blocks: Callable[[int], StoredBlock], method: Method) -> None:
        self._blocks = blocks
        self._method = method
        self._found: tuple[int, Quantized] | None = None

    def of(self, number: int) -> Quantized | None:
        """The dictionary of a block; None if its method has none.

        Raises
        ------
        CorruptStreamError
            If it is damaged, or does not follow those before.
        """
        if self._method.basis is Basis.GRAPH:
            return None
        if self._method.basis is not Basis.TRACKED:
            return _read_dictionary(self._blocks(number), None)
        first, before = -1, None
        if self._found is not None and self._found[0] <= number:
            first, before = self._found
        for one in range(first + 1, number + 1):
            stored = self._blocks(one)
            before = _read_dictionary(stored, tracked_from(self._method, before, stored.n_frames))
            self._found = one, before
        return before


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


def read_coded_block(
    stored: StoredBlock, mesh: MeshModel, method: Method, basis: Quantized | None
) -> CodedBlock:
    """The integers of a block of the paper's methods, given its dictionary."""
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
