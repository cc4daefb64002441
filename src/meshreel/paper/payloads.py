"""Write and read the payloads of sections of the paper's variants (`docs/format.md`)."""

import numpy as np

from meshreel.arrays import Integers
from meshreel.codec.bitstream.container import read_varint, write_varint
from meshreel.errors import CorruptStreamError, TruncatedStreamError
from meshreel.kernel.integers import decode_integers, encode_integers
from meshreel.paper.pipeline import Quantized
from meshreel.paper.quantization import Steps
from meshreel.runtime.profiling import staged

MAX_DIFFERENCE = 2


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


@staged("entropy coding")
def write_curves(curves: Quantized) -> bytes:
    """Payload of rows over time, each with its best order of differences."""
    n_rows, n_frames = curves.integers.shape[1:]
    differenced = [_best_difference(row) for row in curves.integers.reshape(-1, n_frames)]
    orders = np.array([order for order, _ in differenced], np.int64)
    rows = [orders, *(row for _, row in differenced)]
    return _write_steps(curves.steps) + encode_integers(rows, [0, *_shared_tables(n_rows, 1)])


def read_curves(payload: bytes, n_rows: int, n_frames: int) -> Quantized:
    """The inverse of `write_curves`, with integers of shape (3, rows, T)."""
    steps, coded = _read_steps(payload, n_rows)
    lengths = [3 * n_rows, *[n_frames] * (3 * n_rows)]
    orders, *rows = decode_integers(coded, lengths, [0, *_shared_tables(n_rows, 1)])
    _check_orders(orders)
    summed = np.empty((3 * n_rows, n_frames), np.int64)
    for curve, order, row in zip(summed, orders, rows, strict=True):
        curve[:] = _integrate(row, int(order))
    return Quantized(summed.reshape(3, n_rows, n_frames), steps)


@staged("entropy coding")
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


def _check_orders(orders: Integers) -> None:
    if np.any((orders < 0) | (orders > MAX_DIFFERENCE)):
        raise CorruptStreamError(
            f"a row over time has an order of differences outside 0..{MAX_DIFFERENCE}"
        )


def _best_difference(row: Integers) -> tuple[int, Integers]:
    """The order of temporal differences with the fewest bits, and the differenced row."""
    candidates = [row]
    for _ in range(MAX_DIFFERENCE):
        candidates.append(np.diff(candidates[-1], prepend=0))
    bits = [int(np.sum(np.frexp(np.abs(row).astype(float))[1])) for row in candidates]
    order = int(np.argmin(bits))
    return order, candidates[order]


def _integrate(row: Integers, order: int) -> Integers:
    for _ in range(order):
        row = np.cumsum(row)
    return row


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
