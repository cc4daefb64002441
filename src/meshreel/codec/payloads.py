"""Integers to the payloads of sections and back: the layouts of `docs/format.md`."""

import struct

import numpy as np
import numpy.typing as npt

from meshreel.codec.pipeline import Quantized
from meshreel.entropy.coder import decode_integers, encode_integers
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError, TruncatedStreamError

Integers = npt.NDArray[np.int64]

_STEP = struct.Struct("<f")
MAX_DIFFERENCE = 2


def write_anchor_vertices(anchors: Integers) -> bytes:
    """Ascending vertex numbers: their count and their differences."""
    return write_varint(len(anchors)) + encode_integers([np.diff(anchors, prepend=0)])


def read_anchor_vertices(payload: bytes, n_verts: int) -> Integers:
    """Undo `write_anchor_vertices`.

    Raises
    ------
    CorruptStreamError
        If they are not ascending vertex numbers.
    """
    n_anchors, position = read_varint(payload, 0)
    if n_anchors > n_verts:
        raise CorruptStreamError(f"{n_anchors} anchors are announced for {n_verts} vertices")
    (steps,) = decode_integers(payload[position:], [n_anchors])
    anchors = np.cumsum(steps)
    if np.any(steps[1:] < 1) or np.any(anchors < 0) or np.any(anchors >= n_verts):
        raise CorruptStreamError("the anchors are not ascending vertex numbers")
    return anchors


def write_block(n_frames: int, n_modes: int) -> bytes:
    """Numbers of frames and modes of a block."""
    return write_varint(n_frames) + write_varint(n_modes)


def read_block(payload: bytes) -> tuple[int, int]:
    """Undo `write_block`.

    Raises
    ------
    CorruptStreamError
        If a number is 0, there are more modes than frames, or bytes are left over.
    """
    n_frames, position = read_varint(payload, 0)
    n_modes, position = read_varint(payload, position)
    if not 1 <= n_modes <= n_frames or position != len(payload):
        raise CorruptStreamError(
            f"a block announces {n_modes} modes for {n_frames} frames; 1 to as many as frames "
            "are allowed"
        )
    return n_frames, n_modes


def write_basis(basis: Quantized) -> bytes:
    """The dictionary: for each row the difference in time that makes it smallest, then it."""
    n_modes, n_frames = basis.integers.shape[1:]
    differenced = [_best_difference(row) for row in basis.integers.reshape(-1, n_frames)]
    orders = np.array([order for order, _ in differenced])
    rows = [orders, *(row for _, row in differenced)]
    return _write_step(basis.step) + encode_integers(rows, [0, *_shared_tables(n_modes, 1)])


def read_basis(payload: bytes, n_modes: int, n_frames: int) -> Quantized:
    """Undo `write_basis`: integers of shape (3, K, T)."""
    step, coded = _read_step(payload)
    lengths = [3 * n_modes, *[n_frames] * (3 * n_modes)]
    orders, *rows = decode_integers(coded, lengths, [0, *_shared_tables(n_modes, 1)])
    if np.any((orders < 0) | (orders > MAX_DIFFERENCE)):
        raise CorruptStreamError(f"a dictionary row is differenced more than {MAX_DIFFERENCE} x")
    summed = [_sum_up(row, int(order)) for order, row in zip(orders, rows, strict=True)]
    return Quantized(np.stack(summed).reshape(3, n_modes, n_frames), step)


def write_anchors(anchors: Quantized) -> bytes:
    """Coefficients of the anchors; modes of similar number share a table."""
    n_modes, n_anchors = anchors.integers.shape[1:]
    rows = list(anchors.integers.reshape(3 * n_modes, n_anchors))
    return _write_step(anchors.step) + encode_integers(rows, _shared_tables(n_modes, 0))


def read_anchors(payload: bytes, n_modes: int, n_anchors: int) -> Quantized:
    """Undo `write_anchors`: integers of shape (3, K, A)."""
    step, coded = _read_step(payload)
    rows = decode_integers(coded, [n_anchors] * (3 * n_modes), _shared_tables(n_modes, 0))
    return Quantized(np.stack(rows).reshape(3, n_modes, n_anchors), step)


def write_coefficients(coefficients: Quantized) -> bytes:
    """Coefficients of the deltas; each row has a table of its own."""
    rows = list(coefficients.integers.reshape(-1, coefficients.integers.shape[2]))
    return _write_step(coefficients.step) + encode_integers(rows)


def read_coefficients(payload: bytes, n_modes: int, n_verts: int) -> Quantized:
    """Undo `write_coefficients`: integers of shape (3, K, V)."""
    step, coded = _read_step(payload)
    rows = decode_integers(coded, [n_verts] * (3 * n_modes))
    return Quantized(np.stack(rows).reshape(3, n_modes, n_verts), step)


def _best_difference(row: Integers) -> tuple[int, Integers]:
    """How often to difference a row in time so that its bits are fewest, and the result."""
    candidates = [row]
    for _ in range(MAX_DIFFERENCE):
        candidates.append(np.diff(candidates[-1], prepend=0))
    bits = [int(np.sum(np.frexp(np.abs(row).astype(float))[1])) for row in candidates]
    order = int(np.argmin(bits))
    return order, candidates[order]


def _sum_up(row: Integers, order: int) -> Integers:
    for _ in range(order):
        row = np.cumsum(row)
    return row


def _shared_tables(n_modes: int, first: int) -> list[int]:
    """Table of each row: modes 1, 2-3, 4-7, ... of all axes share one."""
    return [first + (mode + 1).bit_length() - 1 for mode in range(n_modes)] * 3


def _write_step(step: np.float32) -> bytes:
    return _STEP.pack(step)


def _read_step(payload: bytes) -> tuple[np.float32, bytes]:
    if len(payload) < _STEP.size:
        raise TruncatedStreamError("a section ends inside its quantisation step")
    (step,) = _STEP.unpack_from(payload)
    if not 0 <= step < float("inf"):
        raise CorruptStreamError(f"the quantisation step {step} is not a positive number")
    return np.float32(step), payload[_STEP.size :]
