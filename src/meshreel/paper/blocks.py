"""Write and read the sections of blocks of the paper's variants."""

from collections.abc import Callable, Iterator

from meshreel.codec.bitstream.container import write_block_counts
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.open_stream import StoredBlock
from meshreel.errors import CorruptStreamError
from meshreel.paper import payloads
from meshreel.paper.mesh_model import MeshModel
from meshreel.paper.pipeline import Anchors, CodedBlock, Quantized
from meshreel.paper.variants import Basis, Decoding, Variant


def write_coded_block(
    block: CodedBlock,
    n_frames: int,
    method: Variant,
    reference: Quantized | None,
    exact: bytes = b"",
) -> Iterator[tuple[Section, bytes]]:
    """Yield the sections of a block.

    Parameters
    ----------
    reference : Quantized or None
        Dictionary of the previous block, if the dictionary is stored as a difference from it.
    exact : bytes, optional
        Positions of isolated vertices.
    """
    yield Section.BLOCK, write_block_counts(n_frames, block.n_modes)
    if block.basis is not None:
        basis = block.basis
        if reference is not None:
            basis = Quantized(basis.integers - reference.integers, basis.steps)
        is_tracked = method.basis is Basis.TRACKED
        kind = bytes([reference is not None]) if is_tracked else b""
        yield Section.BASIS, kind + payloads.write_curves(basis)
    if block.anchors is not None and block.anchors.coefficients is not None:
        has_residuals = bytes([block.anchors.residuals is not None])
        yield Section.ANCHORS, has_residuals + payloads.write_rows(block.anchors.coefficients)
    if block.anchors is not None and block.anchors.residuals is not None:
        yield Section.ANCHOR_RESIDUALS, payloads.write_curves(block.anchors.residuals)
    if exact:
        yield Section.EXACT, exact
    yield Section.COEFFICIENTS, payloads.write_rows(block.coefficients)


class Dictionaries:
    """The dictionaries of a stream's blocks; tracked ones are sums of stored differences.

    Of blocks that precede the requested one, only the dictionary is decoded.

    Parameters
    ----------
    blocks : callable
        Maps the number of a block to the stored block.
    """

    def __init__(self, blocks: Callable[[int], StoredBlock], method: Variant) -> None:
        self._blocks = blocks
        self._method = method
        self._latest: tuple[int, Quantized] | None = None

    def of(self, number: int) -> Quantized | None:
        """The dictionary of a block; None if the variant has none.

        Raises
        ------
        CorruptStreamError
            If it is damaged, or inconsistent with previous ones.
        """
        if self._method.basis is Basis.GRAPH:
            return None
        if self._method.basis is not Basis.TRACKED:
            stored = self._blocks(number)
            return _read_dictionary(stored, stored.payload(Section.BASIS))
        first, dictionary = -1, None
        if self._latest is not None and self._latest[0] <= number:
            first, dictionary = self._latest
        for block in range(first + 1, number + 1):
            dictionary = _read_tracked_dictionary(self._blocks(block), dictionary)
            self._latest = block, dictionary
        return dictionary


def _read_dictionary(stored: StoredBlock, payload: bytes) -> Quantized:
    return payloads.read_curves(payload, stored.n_modes, stored.n_frames)


def _read_tracked_dictionary(stored: StoredBlock, before: Quantized | None) -> Quantized:
    """A dictionary that is stored whole, or as the difference from the one before."""
    payload = stored.payload(Section.BASIS)
    if payload[:1] not in (b"\0", b"\1"):
        raise CorruptStreamError("a tracked dictionary begins with neither 0 (whole) nor 1")
    basis = _read_dictionary(stored, payload[1:])
    if payload[0] == 0:
        return basis
    if before is None or before.integers.shape != basis.integers.shape:
        raise CorruptStreamError(
            f"the dictionary of the block at frame {stored.start} is a difference from one of "
            "another shape"
        )
    return Quantized(before.integers + basis.integers, basis.steps)


def tracked_from(method: Variant, before: Quantized | None, n_frames: int) -> Quantized | None:
    """Return the dictionary that orthogonal iterations start from; None for a decomposition.

    A block of another length than the one before (usually the last) cannot be tracked.
    """
    if method.basis is not Basis.TRACKED or before is None:
        return None
    return before if before.integers.shape[2] == n_frames else None


def read_coded_block(
    stored: StoredBlock, mesh: MeshModel, method: Variant, basis: Quantized | None
) -> CodedBlock:
    """Read the integers of a block of the paper's variants, given its dictionary."""
    n_modes, on_graph = stored.n_modes, method.basis is Basis.GRAPH
    row_length = stored.n_frames if on_graph else mesh.n_verts
    coefficients = payloads.read_rows(stored.payload(Section.COEFFICIENTS), n_modes, row_length)
    anchors = _read_anchors(stored, len(mesh.anchors), method) if method.has_anchors else None
    return CodedBlock(basis, anchors, coefficients)


def _read_anchors(stored: StoredBlock, n_anchors: int, method: Variant) -> Anchors:
    coefficients = residuals = None
    has_residuals = method.basis is Basis.GRAPH
    if not has_residuals:
        payload = stored.payload(Section.ANCHORS)
        if payload[:1] not in (b"\0", b"\1"):
            raise CorruptStreamError("anchors begin with neither 0 nor 1, which residuals follow")
        coefficients = payloads.read_rows(payload[1:], stored.n_modes, n_anchors)
        has_residuals = payload[0] == 1
    if has_residuals:
        if method.decoding is not Decoding.ANCHORED:
            raise CorruptStreamError(f"a block of {method.name} has residuals of anchors")
        payload = stored.payload(Section.ANCHOR_RESIDUALS)
        residuals = payloads.read_curves(payload, n_anchors, stored.n_frames)
    return Anchors(coefficients, residuals)
