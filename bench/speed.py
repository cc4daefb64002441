"""Seconds of encoding and decoding, relative to Draco and to lower bounds of the work.

    python bench/speed.py samba.npz cow.npz --efforts 1,5,9
    python bench/speed.py --subdivided horse_gallop.npz --sphere 6 100 --memory --serial
    python bench/speed.py            # the embedded flag

Draco codes every frame independently. The floors are the minimal work of a modal encoder or
decoder: a Gram matrix and one projection for each axis; the product of basis and coefficients for
each axis, and writing the frames; with all and with one BLAS thread. The paper's serial decoding
solves a system for each frame. All others are timed in alternating rounds; tables list medians
without the first round. First frame: from the stored stream to its first frame; random frame: the
middle frame of a newly opened stream; next frame: the frame after it.
"""

import argparse
import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import meshreel
from inputs import add_inputs, first_frames, sources
from measuring import is_unsteady, machine_text, medians, peak_mib, print_table, rounds, store
from meshreel.codec.subspace.pca import autocorrelation
from meshreel.codec.subspace.trajectories import bounding_frame, from_matrices, to_matrices
from meshreel.evaluation import draco
from meshreel.evaluation.peers import Shape, pack_frames, unpack_frames
from meshreel.model.sequence import Vertices
from meshreel.paper.basis import expand, project
from meshreel.runtime.threads import n_cores, one_blas_thread
from meshreel.studies.timing import Seconds, timed_once

DRACO, DRACO_BITS = "Draco", 10
FLOORS = ("floor, all BLAS threads", "floor, one BLAS thread")
SERIAL_METHOD, SERIAL_BUDGET_S = "pca-qs", 30.0
SERIAL_FRAMES = 250
"""Limit of frames for the serial method, whose eigen-decomposition takes minutes beyond."""

TASKS = ("encode", "decode", "first frame", "random frame", "next frame")

Tasks = dict[tuple[str, str], Callable[[], Any]]
"""By the name of a coder and of the task."""


@dataclass(frozen=True)
class Coder:
    """A coder of sequences.

    Attributes
    ----------
    encode, decode : callable
        A prepared sequence to bytes, and back to positions of a shape.
    open : callable
        Returns a function from a frame's number to its positions, which reads stored bytes.
    prepare : callable, optional
        Returns the sequence to encode instead; not timed.
    """

    name: str
    encode: Callable[[meshreel.MeshSequence], bytes]
    decode: Callable[[bytes, Shape], Vertices]
    open: Callable[[Path, Shape], Callable[[int], Vertices]]
    prepare: Callable[[meshreel.MeshSequence], meshreel.MeshSequence] | None = None


def decode_ours(data: bytes, _: Shape) -> Vertices:
    """The positions of every frame."""
    return meshreel.decode(data).vertices


def open_ours(path: Path, _: Shape) -> Callable[[int], Vertices]:
    """Open a `.reel` file."""
    reel = meshreel.open(path)
    return lambda number: reel[number].vertices


def ours(name: str, method: str, **options: Any) -> Coder:
    """One of our methods; its streams keep the order of vertices and faces."""
    encode = partial(meshreel.encode, method=method, **options)
    return Coder(name, encode, decode_ours, open_ours)


def decode_draco(data: bytes, shape: Shape) -> Vertices:
    """The positions of every frame, in Draco's order."""
    return draco.decode(data, shape, "float32")


def open_draco(path: Path, shape: Shape) -> Callable[[int], Vertices]:
    """Split a file into the streams of its frames."""
    frames = unpack_frames(path.read_bytes())
    return lambda number: decode_draco(pack_frames([frames[number]]), shape)[0]


def coders_of(options: argparse.Namespace) -> list[Coder]:
    """Every coder of a run, Draco first; `reel` at default quality, which needs no search."""
    encode = partial(draco.encode, bits=DRACO_BITS)
    coders = [Coder(DRACO, encode, decode_draco, open_draco, draco.prepare)]
    coders += [ours(f"reel, effort {n}", "reel", effort=n) for n in options.efforts]
    if not options.without_paper:
        name = f"pca-qp, {options.modes} modes"
        coders.append(ours(name, "pca-qp", n_modes=options.modes))
    return coders


class Trial:
    """A coder on a sequence; it decodes its last encoding."""

    def __init__(self, coder: Coder, sequence: meshreel.MeshSequence, path: Path) -> None:
        self.coder, self.path, self.data = coder, path, b""
        self.sequence = coder.prepare(sequence) if coder.prepare else sequence
        self.shape = (sequence.n_frames, sequence.n_verts, 3)

    def encode(self) -> None:
        """Encode the sequence."""
        self.data = self.coder.encode(self.sequence)

    def open(self) -> None:
        """Open the stored stream."""
        self.frame_at = self.coder.open(self.path, self.shape)

    def tasks(self) -> Tasks:
        """The tasks to time, in this order."""
        middle, last = self.shape[0] // 2, self.shape[0] - 1
        tasks = {
            "encode": self.encode,
            "decode": lambda: self.coder.decode(self.data, self.shape),
            "store": lambda: self.path.write_bytes(self.data),
            "first frame": lambda: self.coder.open(self.path, self.shape)(0),
            "open": self.open,
            "random frame": lambda: self.frame_at(middle),
            "next frame": lambda: self.frame_at(min(middle + 1, last)),
        }
        return {(self.coder.name, task): work for task, work in tasks.items()}


def floor_tasks(sequence: meshreel.MeshSequence, n_modes: int) -> Tasks:
    """The minimal work of a modal encoder and decoder.

    BLAS threads spin while waiting and are much slower on a busy machine.
    """
    frame = bounding_frame(sequence.extent)
    matrices = to_matrices(sequence.vertices, frame)
    n_frames, n_verts = matrices.shape[1:]
    # Any orthonormal basis: time does not depend on its values.
    columns = np.random.default_rng(0).normal(size=(3, n_frames, min(n_modes, n_frames)))
    basis = np.linalg.qr(columns).Q
    coefficients = project(basis, matrices)
    slim = matrices if n_frames <= n_verts else np.swapaxes(matrices, 1, 2)

    def encode() -> None:
        autocorrelation(slim)
        project(basis, matrices)

    def decode() -> None:
        from_matrices(expand(basis, coefficients), frame, sequence.vertices.dtype)

    def alone(work: Callable[[], None]) -> None:
        with one_blas_thread():
            work()

    tasks: Tasks = {}
    for task, work in (("encode", encode), ("decode", decode)):
        tasks |= {(FLOORS[0], task): work, (FLOORS[1], task): partial(alone, work)}
    return tasks


def measure(
    sequence: meshreel.MeshSequence, coders: Sequence[Coder], options: argparse.Namespace
) -> dict[str, Any]:
    """Medians in seconds by coder and task; memory and the serial method if requested."""
    with TemporaryDirectory() as folder:
        trials = [Trial(coder, sequence, Path(folder) / str(n)) for n, coder in enumerate(coders)]
        tasks = floor_tasks(sequence, options.modes)
        for trial in trials:
            tasks |= trial.tasks()
        runs = rounds(tasks, options.repeats, budget_s=options.seconds)
    result: dict[str, Any] = {
        "sequence": f"{sequence.name} ({sequence.n_verts} x {sequence.n_frames})",
        "size_bytes": {trial.coder.name: len(trial.data) for trial in trials},
        "seconds": nested(medians(runs)),
        "unsteady": [" ".join(key) for key, times in runs.items() if is_unsteady(times)],
    }
    if options.serial:
        result["serial"] = serial_seconds(sequence, options.modes)
    if options.memory:
        result["peak_mib"] = {trial.coder.name: peaks_mib(trial) for trial in trials}
    return result


def nested(seconds: dict[tuple[str, str], Seconds]) -> dict[str, dict[str, float]]:
    """Wall-clock seconds by coder, then by task."""
    by_coder: dict[str, dict[str, float]] = {}
    for (coder, task), value in seconds.items():
        by_coder.setdefault(coder, {})[task] = value.wall
    return by_coder


def serial_seconds(sequence: meshreel.MeshSequence, n_modes: int) -> dict[str, Any]:
    """Seconds of decoding with a solve for each frame, timed once.

    If that takes too long, only `n_timed` frames are decoded and the total is extrapolated.
    """
    head = first_frames(sequence, SERIAL_FRAMES)
    data = meshreel.encode(head, SERIAL_METHOD, n_modes=min(n_modes, head.n_frames))

    def seconds(n_frames: int) -> float:
        return timed_once(partial(meshreel.decode, data, frames=slice(0, n_frames)))[1].wall

    first_s = seconds(1)
    n_timed = min(1 + max(n_cores(), int(SERIAL_BUDGET_S / first_s)), head.n_frames)
    timed_s = seconds(n_timed)
    each_s = (timed_s - first_s) / max(n_timed - 1, 1)
    return {"decode_s": timed_s + (sequence.n_frames - n_timed) * each_s, "n_timed": n_timed}


def peaks_mib(trial: Trial) -> dict[str, float]:
    """Peak memory of new processes that encode and decode, with Python and the input."""
    # Not "spawn": Linux adds the peak of the parent process to that of a started program.
    context, peaks = multiprocessing.get_context("forkserver"), {}
    with TemporaryDirectory() as folder:
        path = Path(folder) / "sequence.npz"
        np.savez(path, vertices=trial.sequence.vertices, faces=trial.sequence.faces)
        for task in TASKS[:2]:
            with ProcessPoolExecutor(1, mp_context=context) as pool:
                peaks[task] = pool.submit(peak_mib_of, trial.coder, task, path).result()
    return peaks


def peak_mib_of(coder: Coder, task: str, path: Path) -> float:
    """Encode a stored sequence, or decode its stream, and return the peak of this process."""
    stream = path.with_suffix(".stream")
    if task == "encode":
        with np.load(path) as arrays:
            sequence = meshreel.MeshSequence(arrays["vertices"], arrays["faces"])
        stream.write_bytes(coder.encode(sequence))
    else:
        with np.load(path, mmap_mode="r") as arrays:
            shape = arrays["vertices"].shape
        coder.decode(stream.read_bytes(), shape)
    return peak_mib()


def print_case(result: dict[str, Any]) -> None:
    """Print seconds, and ratios to Draco, to the faster floor and of the serial decoding."""
    seconds = result["seconds"]
    floor = {task: min(seconds[name][task] for name in FLOORS) for task in TASKS[:2]}
    peaks, serial = result.get("peak_mib", {}), result.get("serial")
    rows = []
    for name, own in seconds.items():
        cells = [f"{own[task]:.4f}" if task in own else "-" for task in TASKS]
        for base in (seconds[DRACO], floor):
            cells.append(", ".join(f"{own[task] / base[task]:.2f}" for task in TASKS[:2]))
        cells.append(f"{serial['decode_s'] / own['decode']:.0f}" if serial else "-")
        cells.append(", ".join(f"{peak:.0f}" for peak in peaks[name].values())
                     if name in peaks else "-")  # fmt: skip
        rows.append([name, str(result["size_bytes"].get(name, "-")), *cells])
    header = ["coder", "bytes", *(f"{task} s" for task in TASKS), "encode, decode / Draco",
              "encode, decode / floor", "paper's serial / decode",
              "peak MiB, encode, decode"]  # fmt: skip
    print_table(f"## {result['sequence']}", header, rows)
    if serial:
        print(f"Serial: {serial['decode_s']:.1f} s, from {serial['n_timed']} frames.\n")
    if result["unsteady"]:
        print(f"Unsteady, not to be relied on: {', '.join(result['unsteady'])}.\n", flush=True)


def main() -> None:
    """Measure as requested; print tables, and write JSON if requested."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    add_inputs(parser)
    parser.add_argument("--efforts", type=lambda text: [int(part) for part in text.split(",")],
                        default=[1, 5, 9], help="of reel; default 1,5,9")  # fmt: skip
    parser.add_argument("--modes", type=int, default=20, help="of the floors and of pca-qp, pca-qs")
    parser.add_argument("--without-paper", action="store_true", help="skip pca-qp")
    parser.add_argument("--repeats", type=int, default=5, help="maximum rounds per case")
    parser.add_argument("--seconds", type=float, default=60.0,
                        help="time limit per case, after at least three rounds")  # fmt: skip
    parser.add_argument("--memory", action="store_true", help="also measure peak memory")
    parser.add_argument("--serial", action="store_true", help="also time pca-qs")
    parser.add_argument("--out", type=Path, help="write the figures here as JSON")
    options = parser.parse_args()
    print(f"# Speed\n\n{machine_text()}\n", flush=True)
    results = []
    for source in sources(options):
        results.append(measure(source(), coders_of(options), options))
        print_case(results[-1])
    store(options.out, results=results)


if __name__ == "__main__":
    main()
