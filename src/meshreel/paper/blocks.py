"""Write and read the sections of blocks of the paper's variants (`docs/format.md`)."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Integers
from meshreel.codec.bitstream.container import (
    read_block_counts,
    read_varint,
    write_block_counts,
    write_varint,
)
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.open_stream import OpenStream
from meshreel.errors import CorruptStreamError, TruncatedStreamError
from meshreel.kernel.integers import decode_integers, encode_integers
from meshreel.paper.coded_values import Anchors, CodedBlock, Quantized
from meshreel.paper.mesh_model import MeshModel
from meshreel.paper.quantization import Steps
from meshreel.paper.variants import Basis, Decoding, Variant, variant_named

MODE_BYTES = 48
"""Memory of a value of a mode during decoding: three axes."""


@dataclass(frozen=True)
class StoredBlock:
    """Sections of a block, with the number of its first frame."""

    start: int
    n_frames: int
    n_modes: int
    sections: dict[Section, bytes]

    def payload(self, section: Section) -> bytes:
        """The payload of a section; raises CorruptStreamError if it is missing."""
        if section not in self.sections:
            raise CorruptStreamError(
                f"the block of frames {self.start}..{self.start + self.n_frames - 1} has no "
                f"section {section.name}"
            )
        return self.sections[section]


def stored_block(opened: OpenStream, number: int) -> StoredBlock:
    """Read a block of a stream.

    Raises
    ------
    CorruptStreamError
        If it is damaged, or its number of modes is not allowed.
    MemoryLimitError
        If decoding it would take more than allowed.
    """
    entry, sections, n_verts = opened.file.block(number), dict(opened.group(number)), opened.n_verts
    n_frames, n_modes = read_block_counts(sections[Section.BLOCK])
    if n_frames != entry.n_frames:
        raise CorruptStreamError(
            f"block {number} has {n_frames} frames; the index has {entry.n_frames}"
        )
    is_on_graph = variant_named(opened.method).basis is Basis.GRAPH
    max_modes = n_verts if is_on_graph else n_frames
    if not 1 <= n_modes <= max_modes:
        raise CorruptStreamError(
            f"a block of {n_frames} frames has {n_modes} modes; 1 to {max_modes} are allowed"
        )
    n_bytes = MODE_BYTES * n_modes * (n_verts + 3 * n_frames)
    n_bytes += 3 * n_frames * n_verts * opened.dtype.itemsize
    description = f"block {number} of {n_frames} frames, {n_verts} vertices and {n_modes} modes"
    opened.limit.require(n_bytes, description)
    return StoredBlock(entry.first_frame, n_frames, n_modes, sections)


def only_section(opened: OpenStream, section: Section) -> bytes:
    """The only section of this id before the first block.

    Raises
    ------
    CorruptStreamError
        If there is none, or more than one.
    """
    payloads = [opened.payload(row) for row in opened.file.leading if row.id == section]
    if len(payloads) != 1:
        raise CorruptStreamError(
            f"the stream has {len(payloads)} sections {section.name}; exactly 1 is allowed"
        )
    return payloads[0]


MAX_DIFFERENCE = 2
"""Maximum order of temporal differences."""


def write_anchor_vertices(anchors: Integers) -> bytes:
    """Payload of ascending vertex numbers: their count and differences."""
    return write_varint(len(anchors)) + encode_integers([np.diff(anchors, prepend=0)])


def read_anchor_vertices(payload: bytes, n_verts: int) -> Integers:
    """The inverse of `write_anchor_vertices`.

    Raises
    ------
    CorruptStreamError
        If they are not ascending vertex numbers.
    """
    n_anchors, position = read_varint(payload, 0)
    if n_anchors > n_verts:
        raise CorruptStreamError(f"{n_anchors} anchors are declared for {n_verts} vertices")
    (gaps,) = decode_integers(payload[position:], [n_anchors])
    anchors = np.cumsum(gaps)
    if np.any(gaps[1:] < 1) or np.any(anchors < 0) or np.any(anchors >= n_verts):
        raise CorruptStreamError("the anchors are not ascending vertex numbers")
    return anchors


def write_curves(curves: Quantized) -> bytes:
    """Payload of rows over time, each with its best order of differences."""
    n_rows, n_frames = curves.integers.shape[1:]
    orders, rows = [], []
    for row in curves.integers.reshape(-1, n_frames):
        candidates = [row]
        for _ in range(MAX_DIFFERENCE):
            candidates.append(np.diff(candidates[-1], prepend=0))
        bits = [int(np.sum(np.frexp(np.abs(each).astype(float))[1])) for each in candidates]
        orders.append(int(np.argmin(bits)))
        rows.append(candidates[orders[-1]])
    coded = encode_integers([np.array(orders, np.int64), *rows], [0, *_shared_tables(n_rows, 1)])
    return _write_steps(curves.steps) + coded


def read_curves(payload: bytes, n_rows: int, n_frames: int) -> Quantized:
    """The inverse of `write_curves`, with integers of shape (3, rows, T)."""
    steps, coded = _read_steps(payload, n_rows)
    lengths = [3 * n_rows, *[n_frames] * (3 * n_rows)]
    orders, *rows = decode_integers(coded, lengths, [0, *_shared_tables(n_rows, 1)])
    if np.any((orders < 0) | (orders > MAX_DIFFERENCE)):
        raise CorruptStreamError(
            f"a row over time has an order of differences outside 0..{MAX_DIFFERENCE}"
        )
    curves = np.empty((3 * n_rows, n_frames), np.int64)
    for curve, order, row in zip(curves, orders, rows, strict=True):
        curve[:] = row
        for _ in range(int(order)):
            curve[:] = np.cumsum(curve)
    return Quantized(curves.reshape(3, n_rows, n_frames), steps)


def write_rows(rows: Quantized) -> bytes:
    """Payload of rows of coefficients; similar modes share a table."""
    n_rows, length = rows.integers.shape[1:]
    flat = list(rows.integers.reshape(3 * n_rows, length))
    return _write_steps(rows.steps) + encode_integers(flat, _shared_tables(n_rows, 0))


def read_rows(payload: bytes, n_rows: int, length: int) -> Quantized:
    """The inverse of `write_rows`, with integers of shape (3, rows, length)."""
    steps, coded = _read_steps(payload, n_rows)
    rows = decode_integers(coded, [length] * (3 * n_rows), _shared_tables(n_rows, 0))
    return Quantized(np.stack(rows).reshape(3, n_rows, length), steps)


def _shared_tables(n_modes: int, first: int) -> list[int]:
    """Table of each row: modes 1, 2-3, 4-7, ... of all axes share one."""
    return [first + (mode + 1).bit_length() - 1 for mode in range(n_modes)] * 3


def _write_steps(steps: Steps) -> bytes:
    return write_varint(len(steps)) + steps.astype("<f4").tobytes()


def _read_steps(payload: bytes, n_rows: int) -> tuple[Steps, bytes]:
    n_steps, start = read_varint(payload, 0)
    if n_steps not in (1, n_rows):
        raise CorruptStreamError(
            f"{n_steps} quantization steps are declared for {n_rows} rows; must be 1 or {n_rows}"
        )
    end = start + 4 * n_steps
    if end > len(payload):
        raise TruncatedStreamError("a section ends inside its quantization steps")
    steps = np.frombuffer(payload[start:end], "<f4").astype(np.float32)
    if not (np.isfinite(steps) & (steps >= 0)).all():
        raise CorruptStreamError("a quantization step is not a positive number")
    return steps, payload[end:]


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
        yield Section.BASIS, kind + write_curves(basis)
    if block.anchors is not None and block.anchors.coefficients is not None:
        has_residuals = bytes([block.anchors.residuals is not None])
        yield Section.ANCHORS, has_residuals + write_rows(block.anchors.coefficients)
    if block.anchors is not None and block.anchors.residuals is not None:
        yield Section.ANCHOR_RESIDUALS, write_curves(block.anchors.residuals)
    if exact:
        yield Section.EXACT, exact
    yield Section.COEFFICIENTS, write_rows(block.coefficients)


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
    return read_curves(payload, stored.n_modes, stored.n_frames)


def _read_tracked_dictionary(stored: StoredBlock, previous: Quantized | None) -> Quantized:
    """A dictionary that is stored whole, or as the difference from the previous one."""
    payload = stored.payload(Section.BASIS)
    if payload[:1] not in (b"\0", b"\1"):
        raise CorruptStreamError("a tracked dictionary begins with neither 0 (whole) nor 1")
    basis = _read_dictionary(stored, payload[1:])
    if payload[0] == 0:
        return basis
    if previous is None or previous.integers.shape != basis.integers.shape:
        raise CorruptStreamError(
            f"the dictionary of the block at frame {stored.start} is a difference from one of "
            "another shape"
        )
    return Quantized(previous.integers + basis.integers, basis.steps)


def is_difference(stored: StoredBlock, method: Variant) -> bool:
    """Whether a block stores the difference of its dictionary from the previous one."""
    is_tracked = method.basis is Basis.TRACKED
    return is_tracked and stored.payload(Section.BASIS)[:1] == b"\1"


def initial_basis(method: Variant, previous: Quantized | None, n_frames: int) -> Quantized | None:
    """Return the dictionary that orthogonal iterations start from; None for a decomposition.

    A block of another length than the previous one (usually the last) cannot be tracked.
    """
    if method.basis is not Basis.TRACKED or previous is None:
        return None
    return previous if previous.integers.shape[2] == n_frames else None


def read_coded_block(
    stored: StoredBlock, mesh: MeshModel, method: Variant, basis: Quantized | None
) -> CodedBlock:
    """Read the integers of a block of the paper's variants, given its dictionary."""
    n_modes, on_graph = stored.n_modes, method.basis is Basis.GRAPH
    row_length = stored.n_frames if on_graph else mesh.n_verts
    coefficients = read_rows(stored.payload(Section.COEFFICIENTS), n_modes, row_length)
    if not method.has_anchors:
        return CodedBlock(basis, None, coefficients)
    n_anchors, has_residuals = len(mesh.anchors), on_graph
    of_anchors = residuals = None
    if not on_graph:
        payload = stored.payload(Section.ANCHORS)
        if payload[:1] not in (b"\0", b"\1"):
            raise CorruptStreamError("the flag for residuals of anchors is neither 0 nor 1")
        of_anchors = read_rows(payload[1:], n_modes, n_anchors)
        has_residuals = payload[0] == 1
    if has_residuals:
        if method.decoding is not Decoding.ANCHORED:
            raise CorruptStreamError(f"a block of {method.name} has residuals of anchors")
        payload = stored.payload(Section.ANCHOR_RESIDUALS)
        residuals = read_curves(payload, n_anchors, stored.n_frames)
    return CodedBlock(basis, Anchors(of_anchors, residuals), coefficients)
