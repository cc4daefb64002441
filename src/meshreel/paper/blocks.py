"""Sections of the blocks of the paper's variants, written and read."""

from collections.abc import Callable, Iterator

from meshreel.bitstream.layout import Section
from meshreel.codec.stored_blocks import StoredBlock, write_block
from meshreel.errors import CorruptStreamError
from meshreel.paper import payloads
from meshreel.paper.mesh_model import MeshModel
from meshreel.paper.pipeline import CodedBlock, Quantized
from meshreel.paper.variants import Basis, Variant


def write_coded_block(
    block: CodedBlock,
    n_frames: int,
    method: Variant,
    before: Quantized | None,
    exact: bytes = b"",
) -> Iterator[tuple[Section, bytes]]:
    """The sections of a block.

    Parameters
    ----------
    block : CodedBlock
    n_frames : int
    method : Variant
    before : Quantized or None
        Dictionary of the block before, if this one's is stored as a difference from it.
    exact : bytes, optional
        Positions of isolated vertices.
    """
    yield Section.BLOCK, write_block(n_frames, block.n_modes)
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
            else payloads.write_rows(block.anchors),
        )
    if exact:
        yield Section.EXACT, exact
    yield Section.COEFFICIENTS, payloads.write_rows(block.coefficients)


class Dictionaries:
    """The dictionaries of a stream's blocks; tracked ones are sums of stored differences.

    Of the blocks before the requested one, only dictionaries are decoded.

    Parameters
    ----------
    blocks : callable
        From the number of a block to the stored block.
    method : Variant
    """

    def __init__(self, blocks: Callable[[int], StoredBlock], method: Variant) -> None:
        self._blocks = blocks
        self._method = method
        self._found: tuple[int, Quantized] | None = None

    def of(self, number: int) -> Quantized | None:
        """The dictionary of a block; None if its variant has none.

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


def tracked_from(method: Variant, before: Quantized | None, n_frames: int) -> Quantized | None:
    """The dictionary from which a block's is a difference; None if it is stored as it is.

    The dictionary of a block of another length (usually the last) is stored as it is.
    """
    if method.basis is not Basis.TRACKED or before is None:
        return None
    return before if before.integers.shape[2] == n_frames else None


def read_coded_block(
    stored: StoredBlock, mesh: MeshModel, method: Variant, basis: Quantized | None
) -> CodedBlock:
    """The integers of a block of the paper's variants, given its dictionary."""
    n_frames, n_modes, n_anchors = stored.n_frames, stored.n_modes, len(mesh.anchors)
    coefficients = stored.payload(Section.COEFFICIENTS)
    if method.basis is Basis.GRAPH:
        return CodedBlock(
            None,
            payloads.read_curves(stored.payload(Section.ANCHORS), n_anchors, n_frames),
            payloads.read_rows(coefficients, n_modes, n_frames),
        )
    anchors = None
    if method.has_anchors:
        anchors = payloads.read_rows(stored.payload(Section.ANCHORS), n_modes, n_anchors)
    return CodedBlock(basis, anchors, payloads.read_rows(coefficients, n_modes, mesh.n_verts))
