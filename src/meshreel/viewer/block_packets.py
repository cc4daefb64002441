"""Blocks of frames as packets: fields as integers, weights, and corrections frame by frame."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.codec.corrections import Corrections
from meshreel.codec.decoded_block import DecodedBlock
from meshreel.viewer.modes import Modes, modes_of
from meshreel.viewer.packets import packet
from meshreel.viewer.rounding import rounded_to

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.integer]

LARGEST = 32767
"""Of an int16 field."""

ROUNDING_OF_WEIGHTS = 1 / 8
"""Largest error from rounding the weights of one mode, as a share of the allowed error."""

FIRST_STEP = 4.0
"""Quantisation step of fields that is tried first, in allowed errors: mostly too coarse."""

CHUNK_VALUES = 1 << 21


@dataclass(frozen=True)
class IntegerFields:
    """Fields as integers of shape (K, V), and the quantisation step of each, (K,), in diagonals."""

    integers: npt.NDArray[np.int16]
    steps: npt.NDArray[np.float32]

    @property
    def values(self) -> Floats:
        """Fields as the page dequantises them, float64 of shape (K, V), in diagonals."""
        return self.integers * self.steps.astype(np.float64)[:, None]


def block_packet(block: DecodedBlock, allowed_error: float = 0.0) -> bytes:
    """The packet of a block of frames.

    Vertices without an edge, which are not drawn, are left at the origin by the paper's methods.

    Parameters
    ----------
    block : DecodedBlock
    allowed_error : float, default 0
        How far rounding may move a vertex, in diagonals: steps are as coarse as that allows, so
        that the packet deflates well. 0 stands for the finest steps.

    Raises
    ------
    CorruptStreamError
        As `modes_of`.
    """
    modes = modes_of(block)
    weights = modes.weights
    if allowed_error:
        weights = rounded_weights(modes, allowed_error)
        fields = coarse_fields(modes, weights, allowed_error)
    else:
        fields = integer_fields(modes.fields, finest_steps(modes.fields))
    scale = block.frame.scale
    return packet(
        {
            "fields": fields.integers,
            "field_scales": (fields.steps * scale).astype(np.float32),
            "weights": weights.astype(np.float32),
            **correction_arrays(block.corrections, block.n_frames, scale),
        },
        n_modes=len(modes.fields),
        n_frames=block.n_frames,
    )


def finest_steps(fields: Floats) -> Floats:
    """Quantisation steps of shape (K,) that use all of int16."""
    largest = np.abs(fields).max(axis=1)
    # A little more, for the step itself is rounded to float32.
    return np.where(largest > 0, largest / LARGEST * (1 + 1e-6), 1.0)


def integer_fields(fields: Floats, steps: Floats) -> IntegerFields:
    """Fields of shape (K, V), quantised in steps of shape (K,)."""
    rounded = steps.astype(np.float32)
    integers = np.rint(fields / rounded.astype(np.float64)[:, None])
    return IntegerFields(integers.clip(-LARGEST, LARGEST).astype(np.int16), rounded)


def rounded_weights(modes: Modes, allowed_error: float) -> Floats:
    """Weights with as few digits as they need."""
    largest = np.maximum(np.abs(modes.fields).max(axis=1), np.finfo(np.float32).tiny)
    steps = ROUNDING_OF_WEIGHTS * allowed_error / largest
    return rounded_to(modes.weights, steps[:, None])


def coarse_fields(modes: Modes, weights: Floats, allowed_error: float) -> IntegerFields:
    """Fields in the coarsest steps with which no vertex moves by more than is allowed.

    A step is inversely proportional to the length of the field's temporal basis vector: that is
    the least error of all for so many bits. No step is finer than int16 can hold, whatever is
    allowed.
    """
    lengths = np.linalg.norm(modes.weights, axis=(0, 2))
    finest = finest_steps(modes.fields)
    step = FIRST_STEP * allowed_error
    while True:
        steps = np.maximum(step / np.where(lengths > 0, lengths, 1.0), finest)
        fields = integer_fields(modes.fields, steps)
        error = _largest_error(modes, Modes(fields.values, weights))
        if error <= allowed_error or (steps == finest).all():
            return fields
        step *= max(0.2, 0.95 * allowed_error / error)


def correction_arrays(
    corrections: Corrections | None, n_frames: int, scale: float
) -> dict[str, Integers | npt.NDArray[np.float32]]:
    """Corrections of vertices, in lists of one frame after another."""
    if corrections is None:
        nothing = np.zeros(0, np.int64)
        corrections = Corrections(np.float32(1), nothing, nothing, nothing.reshape(0, 3))
    by_frame = np.argsort(corrections.frames, kind="stable")
    frames = corrections.frames[by_frame]
    return {
        "correction_starts": np.searchsorted(frames, np.arange(n_frames + 1)).astype(np.uint32),
        "correction_vertices": corrections.vertices[by_frame].astype(np.uint32),
        "correction_values": (corrections.moves[by_frame] * scale).astype(np.float32),
    }


def _largest_error(modes: Modes, rounded: Modes) -> float:
    """How far rounding moves a vertex at most, in diagonals."""
    together = Modes(
        np.concatenate([modes.fields, rounded.fields]),
        np.concatenate([modes.weights, -rounded.weights], axis=1),
    )
    n_frames, n_verts = len(modes.weights), modes.fields.shape[1]
    size = max(1, CHUNK_VALUES // (3 * n_verts))
    return max(
        float(np.sqrt(np.square(together.frames(slice(start, start + size))).sum(axis=0).max()))
        for start in range(0, n_frames, size)
    )
