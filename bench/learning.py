"""Random windows of many sequences, as training reads them: meshreel against arrays in files.

    python bench/learning.py samba.npz cow.npz dance.npz --work /tmp/learning
    python bench/learning.py reels/*.reel --work /tmp/learning --device cuda --workers 0 8

Makes `--sequences` sequences, each a range of frames of one of the inputs (without inputs: of
simulated flags), and stores them in float32 as `.reel` files (default options, and within 0.1 % of
the diagonal), NPZ (compressed), HDF5 and Zarr (chunks of a window; gzip 4 with and without shuffle;
zstd), and as plain NPY. Prints for each:

- bytes, and how many times NPZ takes them;
- milliseconds from opening the folder to the first batch, in a new process that has imported all;
- windows per second in one process with all cores, and per processor second, after one pass over
  all sequences: median of `--rounds` rounds, in which the formats alternate, lowest and highest;
- the same through a `DataLoader` of PyTorch, for each number of workers;
- with `--device`: on the device, from decoded windows in pinned memory.

Formats whose library is missing are omitted with a note. Windows are checked: those of arrays must
be equal to the input, those of `.reel` files within 2 % of the diagonal.
"""

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import numpy.typing as npt

import meshreel
from measuring import start_table
from meshreel.studies.timing import timed_once

Vertices = npt.NDArray[np.float32]
Read = Callable[[int, int], Vertices]
"""Returns a range of frames."""

MIN_FRAMES = 48
MAX_ERROR = 0.02
"""Of the largest error of a window of a `.reel` file, in diagonals."""


@dataclass(frozen=True)
class Format:
    """A way to store positions: how it writes a file, and opens it for reading of windows."""

    name: str
    suffix: str
    module: str
    write: Callable[[Path, meshreel.MeshSequence, int], None]
    open: Callable[[Path], Read]

    def folder(self, work: Path) -> Path:
        """Return the folder of its files."""
        return work / self.name.replace(" ", "-")

    def files(self, work: Path) -> list[Path]:
        """Return its files, in the order of the sequences."""
        return sorted(self.folder(work).glob(f"*{self.suffix}"))


def write_reel(**options: Any) -> Callable[[Path, meshreel.MeshSequence, int], None]:
    """Return a function that encodes with these options."""

    def write(path: Path, sequence: meshreel.MeshSequence, _: int) -> None:
        path.write_bytes(meshreel.encode(sequence, **options))

    return write


def open_reel(path: Path) -> Read:
    """Open a `.reel` file."""
    return meshreel.open(path).read


def write_npz(path: Path, sequence: meshreel.MeshSequence, _: int) -> None:
    """Write compressed NPZ."""
    np.savez_compressed(path, vertices=sequence.vertices, faces=sequence.faces)


def open_npz(path: Path) -> Read:
    """Read and decompress the whole array for each window."""

    def read(start: int, stop: int) -> Vertices:
        with np.load(path) as arrays:
            return np.ascontiguousarray(arrays["vertices"][start:stop])

    return read


def open_npy(path: Path) -> Read:
    """Map a file to memory."""
    mapped = np.load(path, mmap_mode="r")
    return lambda start, stop: np.array(mapped[start:stop])


def write_hdf5(**options: Any) -> Callable[[Path, meshreel.MeshSequence, int], None]:
    """Return a function that writes chunks of a window with these filters."""

    def write(path: Path, sequence: meshreel.MeshSequence, window: int) -> None:
        with import_module("h5py").File(path, "w") as file:
            chunks = chunks_of(sequence, window)
            file.create_dataset("vertices", data=sequence.vertices, chunks=chunks, **options)
            file.create_dataset("faces", data=sequence.faces, compression="gzip")

    return write


def chunks_of(sequence: meshreel.MeshSequence, window: int) -> tuple[int, ...]:
    """Return the shape of chunks of a window."""
    return (min(window, len(sequence)), *sequence.vertices.shape[1:])


def open_hdf5(path: Path) -> Read:
    """Open an HDF5 file."""
    values = import_module("h5py").File(path)["vertices"]
    return lambda start, stop: values[start:stop]


def write_zarr(path: Path, sequence: meshreel.MeshSequence, window: int) -> None:
    """Write chunks of a window with Zarr's default compression."""
    group = import_module("zarr").create_group(path)
    group.create_array("vertices", data=sequence.vertices, chunks=chunks_of(sequence, window))
    group.create_array("faces", data=sequence.faces)


def open_zarr(path: Path) -> Read:
    """Open a Zarr group."""
    values = import_module("zarr").open_group(path, mode="r")["vertices"]
    return lambda start, stop: np.asarray(values[start:stop])


FORMATS = (
    Format("reel", ".reel", "meshreel", write_reel(), open_reel),
    Format(
        "reel 0.1 %",
        ".reel",
        "meshreel",
        write_reel(max_error=0.1),
        lambda path: meshreel.open(path).read,
    ),
    Format("npz", ".npz", "numpy", write_npz, open_npz),
    Format("hdf5 gzip", ".h5", "h5py", write_hdf5(compression="gzip"), open_hdf5),
    Format(
        "hdf5 gzip shuffle", ".h5", "h5py", write_hdf5(compression="gzip", shuffle=True), open_hdf5
    ),
    Format("zarr zstd", ".zarr", "zarr", write_zarr, open_zarr),
    Format("npy", ".npy", "numpy", lambda path, given, _: np.save(path, given.vertices), open_npy),
)


def cut_sequences(inputs: Sequence[Path], count: int) -> Iterator[meshreel.MeshSequence]:
    """Yield ranges of frames of the inputs, of random position and length; deterministic."""
    rng = np.random.default_rng(1)
    sources = [meshreel.load(path) for path in inputs]
    if not sources:
        sizes = ((52, 52), (40, 70), (80, 60), (30, 30))
        sources = [
            meshreel.simulate_flag(150, n_rows=rows, n_columns=columns) for rows, columns in sizes
        ]
    for number in range(count):
        source = sources[number % len(sources)]
        n_frames = int(rng.integers(min(MIN_FRAMES, len(source)), len(source) + 1))
        start = int(rng.integers(len(source) - n_frames + 1))
        vertices = source.vertices[start : start + n_frames].astype(np.float32)
        yield meshreel.MeshSequence(vertices, source.faces, source.fps or 30.0)


def store(formats: Sequence[Format], inputs: Sequence[Path], count: int, options: Any) -> None:
    """Write all sequences in all formats, unless that was done."""
    if all(len(layout.files(options.work)) == count for layout in formats):
        return
    for layout in formats:
        layout.folder(options.work).mkdir(parents=True, exist_ok=True)
    for number, sequence in enumerate(cut_sequences(inputs, count)):
        for layout in formats:
            path = layout.folder(options.work) / f"{number:03d}{layout.suffix}"
            if not path.exists():
                layout.write(path, sequence, options.window)


def size_of(path: Path) -> int:
    """Return the bytes of a file or a folder."""
    return sum(file.stat().st_size for file in (path, *path.rglob("*")) if file.is_file())


class Windows:
    """Windows of the files of a format by number; the dataset of a `DataLoader`."""

    def __init__(self, layout: Format, options: Any, lengths: Sequence[int]) -> None:
        self._format, self._files = FORMATS.index(layout), layout.files(options.work)
        self._window = options.window
        self._ends = np.cumsum([length - options.window + 1 for length in lengths])
        self._open: dict[int, Read] = {}

    def __len__(self) -> int:
        return int(self._ends[-1])

    def __getitem__(self, index: int) -> Vertices:
        number = int(np.searchsorted(self._ends, index, side="right"))
        start = index - (int(self._ends[number - 1]) if number else 0)
        if number not in self._open:
            self._open[number] = FORMATS[self._format].open(self._files[number])
        return self._open[number](start, start + self._window)


def check(layout: Format, windows: Windows, truth: Windows, rng: np.random.Generator) -> None:
    """Raise an error if windows differ from those of the plain arrays."""
    for index in rng.integers(len(windows), size=20).tolist():
        expected = truth[index]
        error = np.abs(windows[index] - expected).max()
        diagonal = np.linalg.norm(np.ptp(expected.reshape(-1, 3), axis=0))
        if error > (MAX_ERROR * diagonal if layout.suffix == ".reel" else 0):
            raise SystemExit(f"{layout.name}: window {index} is off by {error}")


def lengths_of(options: Any) -> list[int]:
    """Return the number of frames of each sequence."""
    plain = next(layout for layout in FORMATS if layout.name == "npy")
    return [len(np.load(path, mmap_mode="r")) for path in plain.files(options.work)]


def first_batch(layout: Format, options: Any) -> float:
    """Return the milliseconds from opening a folder to the first batch."""
    lengths = lengths_of(options)
    rng = np.random.default_rng(2)

    def load() -> None:
        windows = Windows(layout, options, lengths)
        for index in rng.integers(len(windows), size=options.batch).tolist():
            _ = windows[index]

    return 1e3 * timed_once(load)[1].wall


def first_batch_in_process(layout: Format, options: Any) -> float:
    """Return the median of `first_batch` in several new processes."""
    command = [sys.executable, __file__, "--work", str(options.work), "--first", layout.name]
    command += ["--window", str(options.window), "--batch", str(options.batch)]
    runs = (subprocess.run(command, check=True, stdout=subprocess.PIPE) for _ in range(3))
    return float(median(json.loads(run.stdout) for run in runs))


def per_second(windows: Windows, options: Any) -> tuple[float, float]:
    """Return windows per second, and per processor second, of random batches."""
    rng, count = np.random.default_rng(time.perf_counter_ns()), 0
    started, processor = time.perf_counter(), time.process_time()
    while time.perf_counter() < started + options.seconds:
        _ = [windows[index] for index in rng.integers(len(windows), size=options.batch).tolist()]
        count += options.batch
    return count / (time.perf_counter() - started), count / (time.process_time() - processor)


def text_of(speeds: Sequence[float]) -> str:
    """Return the median, and the range."""
    return f"{median(speeds):.0f} ({min(speeds):.0f}..{max(speeds):.0f})"


def compare(formats: Sequence[Format], options: Any) -> None:
    """Print bytes, latency and speed in one process."""
    lengths = lengths_of(options)
    datasets = {layout.name: Windows(layout, options, lengths) for layout in formats}
    truth = datasets["npy"]
    speeds: dict[str, list[tuple[float, float]]] = {layout.name: [] for layout in formats}
    for layout in formats:
        check(layout, datasets[layout.name], truth, np.random.default_rng(3))
        first_of_each = np.concatenate(([0], truth._ends[:-1]))
        for index in first_of_each.tolist() if layout.name != "npz" else ():
            _ = datasets[layout.name][index]
    for _ in range(options.rounds):
        for name, windows in datasets.items():
            speeds[name].append(per_second(windows, options))
    sizes = {layout.name: sum(map(size_of, layout.files(options.work))) for layout in formats}
    print(f"{len(lengths)} sequences, {sum(lengths)} frames, {len(truth)} windows")
    print_row = start_table(
        "format", "MB", "npz/it", "first batch, ms", "windows per second", "per processor second"
    )
    for layout in formats:
        size, latency = sizes[layout.name], first_batch_in_process(layout, options)
        figures = f"{size / 1e6:.2f}", f"{sizes['npz'] / size:.1f}", f"{latency:.1f}"
        print_row(layout.name, *figures, *map(text_of, zip(*speeds[layout.name], strict=True)))


def epochs(loader: Any) -> Iterator[Any]:
    """Yield batches forever."""
    while True:
        yield from loader


def loaded_per_second(loader: Any, place: Callable[[Any], Any], options: Any) -> list[float]:
    """Return windows per second of a loader, of several rounds after a first pass."""
    import torch

    batches, speeds = epochs(loader), []
    n_warm = 4 * max(1, loader.num_workers) + options.sequences
    for batch in islice(batches, n_warm):
        place(batch)
    for _ in range(options.rounds):
        count, started = 0, time.perf_counter()
        while time.perf_counter() < started + options.seconds:
            placed = place(next(batches))
            count += len(placed[0])
        if placed[0].is_cuda:
            torch.cuda.synchronize()
        speeds.append(count / (time.perf_counter() - started))
    return speeds


def compare_loaders(formats: Sequence[Format], options: Any) -> None:
    """Print the speed of loaders, to memory or to the device."""
    import torch
    from torch.utils.data import DataLoader, RandomSampler

    from meshreel.torch import Batch, ReelDataset, ReelStream, collate

    torch.set_num_threads(1)  # its threads wait in loops, which distorts times on busy cores
    device = options.device
    lengths = lengths_of(options)

    def stacked(windows: Sequence[Vertices]) -> tuple[Any, ...]:
        n_verts = max(window.shape[1] for window in windows)
        result = torch.zeros((len(windows), options.window, n_verts, 3))
        for row, window in zip(result, windows, strict=True):
            row[:, : window.shape[1]] = torch.from_numpy(window)
        return (result,)

    def place(batch: Any) -> tuple[Any, ...]:
        return (batch[0].to(device or "cpu", non_blocking=True),)

    def report(name: str, dataset: Any, n_workers: int, collate_fn: Any, *, pin: bool) -> None:
        is_stream = isinstance(dataset, ReelStream)
        sampler = None if is_stream else RandomSampler(dataset, replacement=True, num_samples=10**6)
        loader: DataLoader[Any] = DataLoader(
            dataset,
            options.batch,
            sampler=sampler,
            num_workers=n_workers,
            collate_fn=collate_fn,
            pin_memory=pin,
            persistent_workers=n_workers > 0,
        )
        speeds = loaded_per_second(loader, place, options)
        print(f"{name:34} {n_workers:2} workers {text_of(speeds)} windows per second", flush=True)

    def report_first() -> None:
        """Print the milliseconds of the first batch of new datasets, whose blocks load at once."""

        def load() -> None:
            dataset = ReelDataset(reels[0].folder(options.work), options.window)
            _ = next(iter(DataLoader(dataset, options.batch, shuffle=True, collate_fn=collate)))

        seconds = [timed_once(load)[1].wall for _ in range(options.rounds)]
        print(f"reel, first batch: {1e3 * median(seconds):.0f} ms", flush=True)

    pin = device is not None and device.startswith("cuda")
    print(f"DataLoader, batches of {options.batch}, to {device or 'memory'}")
    reels = [layout for layout in formats if layout.suffix == ".reel"]
    report_first()
    for n_workers in options.workers:
        for layout in reels:
            dataset = ReelDataset(
                layout.folder(options.work), options.window, memory=options.memory
            )
            report(layout.name, dataset, n_workers, collate, pin=pin)
        dataset = ReelDataset(reels[0].folder(options.work), options.window, memory=options.memory)
        report("reel, stream", ReelStream(dataset), n_workers, collate, pin=pin)
        half = ReelDataset(
            reels[0].folder(options.work), options.window, dtype=torch.float16, normalize=True
        )
        report("reel, float16", half, n_workers, collate, pin=pin)
        for layout in formats:
            if layout.suffix != ".reel" and (layout.name != "npz" or n_workers):
                report(layout.name, Windows(layout, options, lengths), n_workers, stacked, pin=pin)
    assert Batch._fields[0] == "vertices"


def main() -> None:
    """Compare all formats."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("inputs", nargs="*", type=Path)
    parser.add_argument("--work", type=Path, required=True, help="folder of the stored sequences")
    parser.add_argument("--sequences", type=int, default=50)
    parser.add_argument("--window", type=int, default=16)
    parser.add_argument("--batch", type=int, default=16)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=1.0, help="of each round")
    parser.add_argument("--workers", nargs="*", type=int, default=[], help="those of PyTorch")
    parser.add_argument("--memory", default="2GiB", help="of `.reel` datasets on the CPU")
    parser.add_argument("--device", help="such as cuda")
    parser.add_argument("--first", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.first:
        layout = next(layout for layout in FORMATS if layout.name == options.first)
        __import__(layout.module)
        print(json.dumps(first_batch(layout, options)))
        return
    formats = [layout for layout in FORMATS if find_spec(layout.module)]
    for layout in set(FORMATS) - set(formats):
        print(f"{layout.name} is left out: {layout.module} is not installed")
    store(formats, options.inputs, options.sequences, options)
    compare(formats, options)
    if options.workers or options.device:
        compare_loaders(formats, options)


if __name__ == "__main__":
    main()
