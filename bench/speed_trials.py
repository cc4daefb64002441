"""Timed tasks on a sequence: coders, floors, and the paper's serial decoding."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import meshreel
from meshreel.codec.subspace.pca import autocorrelation
from meshreel.codec.subspace.trajectories import bounding_frame, from_matrices, to_matrices
from meshreel.paper.subspace.basis import expand, project
from meshreel.runtime.threads import n_cores, one_blas_thread
from speed_coders import Coder
from speed_inputs import first_frames
from speed_timing import Tasks, seconds

FLOORS = ("floor, all BLAS threads", "floor, one BLAS thread")
SERIAL_METHOD = "pca-qs"
SERIAL_BUDGET_S = 30.0
SERIAL_FRAMES = 250
"""Limit of frames for the serial method, whose eigen-decomposition takes minutes beyond."""


class Trial:
    """A coder on a sequence; it decodes its last encoding.

    Random access reads the middle frame of a newly opened stream, then the next one.
    """

    def __init__(self, coder: Coder, sequence: meshreel.MeshSequence, folder: Path) -> None:
        self.coder = coder
        self.sequence = coder.prepare(sequence)
        self.shape = (sequence.n_frames, sequence.n_verts, 3)
        self.path = folder / f"{coder.name}.reel"
        self.data = b""

    def encode(self) -> None:
        """Encode and store the stream."""
        self.data = self.coder.encode(self.sequence)

    def open(self) -> None:
        """Open the stored stream."""
        self.frame_at = self.coder.open(self.path, self.shape)

    def coding_tasks(self) -> Tasks:
        """Encoding, then decoding, of all frames."""
        return {"encode": self.encode, "decode": lambda: self.coder.decode(self.data, self.shape)}

    def tasks(self) -> Tasks:
        """The tasks to time, by name, in this order."""
        middle = self.shape[0] // 2
        return {
            **self.coding_tasks(),
            "store": lambda: self.path.write_bytes(self.data),
            "first_frame": lambda: self.coder.open(self.path, self.shape)(0),
            "open": self.open,
            "random_frame": lambda: self.frame_at(middle),
            "next_frame": lambda: self.frame_at(min(middle + 1, self.shape[0] - 1)),
        }


def floor_tasks(sequence: meshreel.MeshSequence, n_modes: int) -> dict[str, Tasks]:
    """The minimal work of a modal encoder and decoder.

    Encoding: the smaller Gram matrix and one projection for each axis. Decoding: the product of
    basis and coefficients for each axis, and writing the frames. Each with one and with all BLAS
    threads, which spin while waiting and are much slower on a busy machine.
    """
    frame = bounding_frame(sequence.extent)
    matrices = to_matrices(sequence.vertices, frame)
    n_frames, n_verts = matrices.shape[1:]
    # Any orthonormal basis: time does not depend on its values.
    columns = np.random.default_rng(0).normal(size=(3, n_frames, min(n_modes, n_frames)))
    basis = np.linalg.qr(columns).Q
    coefficients = project(basis, matrices)
    slim = matrices if n_frames <= n_verts else np.swapaxes(matrices, 1, 2)

    def encode_floor() -> None:
        autocorrelation(slim)
        project(basis, matrices)

    def decode_floor() -> None:
        from_matrices(expand(basis, coefficients), frame, sequence.vertices.dtype)

    def alone(work: Callable[[], None]) -> Callable[[], None]:
        def work_alone() -> None:
            with one_blas_thread():
                work()

        return work_alone

    tasks: Tasks = {"encode": encode_floor, "decode": decode_floor}
    return dict(zip(FLOORS, (tasks, {name: alone(tasks[name]) for name in tasks}), strict=True))


def serial_seconds(sequence: meshreel.MeshSequence, n_modes: int) -> dict[str, Any]:
    """Seconds of decoding with a solve for each frame, timed once.

    If that takes too long, only `n_timed` frames are decoded and the total is extrapolated.
    """
    head = first_frames(sequence, SERIAL_FRAMES)
    data = meshreel.encode(head, SERIAL_METHOD, n_modes=min(n_modes, head.n_frames))

    def decoding(n_frames: int) -> Callable[[], Any]:
        return lambda: meshreel.decode(data, frames=slice(0, n_frames))

    one_s = seconds(decoding(1))
    n_more = max(n_cores(), int(SERIAL_BUDGET_S / one_s))
    n_timed = min(1 + n_more, head.n_frames)
    timed_s = seconds(decoding(n_timed))
    n_left = sequence.n_frames - n_timed
    each_s = (timed_s - one_s) / max(n_timed - 1, 1)
    return {
        "method": f"{SERIAL_METHOD}, {n_modes} modes",
        "decode_s": timed_s + n_left * each_s,
        "n_timed": n_timed,
        "n_frames": sequence.n_frames,
    }
