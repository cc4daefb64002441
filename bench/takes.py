"""Register a long take in runs on workers; measure memory, seconds, and bytes of the joins.

    python bench/takes.py liam/ --frames 1000 --workers 2
    python bench/takes.py liam/ --frames 240 --compare

The frames of the folder are repeated back and forth. Prints the peak memory of the process and of
its largest child, the processor seconds of each kind of call with their mean and their largest,
and the critical path: the seconds that remain with a worker for each run. `--compare` also
registers the take as one run, and prints the bytes of both files. Geometry only.
"""

import argparse
import resource
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshreel
from meshreel.formats.load import load_any
from meshreel.formats.options import Reading
from meshreel.formats.sources import find_files
from meshreel.operations.registering import MAX_LOADED_BYTES, open_part
from meshreel.registration import runs
from meshreel.registration.options import RegisterOptions
from meshreel.registration.register import Registration, register_files

CALLS: dict[str, Callable[..., Any]] = {
    name: getattr(runs, name) for name in ("survey_run", "register_run", "join_run")
}


class Timed:
    """Calls a function of `runs`, and appends the processor seconds of each call to a file."""

    def __init__(self, name: str, path: Path) -> None:
        self._name, self._path = name, path

    def __call__(self, *args: Any) -> Any:
        began = time.process_time()
        result = CALLS[self._name](*args)
        with self._path.open("a") as file:
            file.write(f"{self._name} {time.process_time() - began}\n")
        return result


def repeated(source: str, n_frames: int, folder: Path) -> list[Path]:
    """Link the frames of a folder, back and forth, in a new one; return the links."""
    files = list(find_files(source).paths)
    files += files[-2:0:-1]
    links = [folder / f"{number:06d}{files[0].suffix}" for number in range(n_frames)]
    for number, link in enumerate(links):
        link.symlink_to(files[number % len(files)].resolve())
    return links


def registered(files: list[Path], options: RegisterOptions) -> tuple[Registration, float]:
    """Register frame files; return also the processor seconds of opening them."""
    reading = Reading(
        attributes="none", matches_frames=False, max_loaded_bytes=MAX_LOADED_BYTES, fps=30.0
    )
    began = time.process_time()
    raw = load_any(files, reading)
    opening = time.process_time() - began
    return register_files(raw, options, open_part(files, reading)), opening


def main() -> None:
    """Measure, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", help="a folder with a file per frame")
    parser.add_argument("--frames", type=int, default=1000)
    parser.add_argument("--workers", type=int)
    parser.add_argument("--tolerance", default="0.2%")
    parser.add_argument("--quality", type=float, default=80.0)
    parser.add_argument("--run", type=int, default=runs.RUN_FRAMES, help="frames of a run")
    parser.add_argument("--compare", action="store_true", help="also register the take as one run")
    arguments = parser.parse_args()
    options = RegisterOptions(
        tolerance=arguments.tolerance, quality=arguments.quality, workers=arguments.workers
    )
    runs.RUN_FRAMES = arguments.run
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "seconds.txt"
        for name in CALLS:
            setattr(runs, name, Timed(name, log))
        (Path(folder) / "frames").mkdir()
        files = repeated(arguments.source, arguments.frames, Path(folder) / "frames")
        began = time.perf_counter()
        result, opening = registered(files, options)
        wall = time.perf_counter() - began
        calls = defaultdict(list)
        for line in log.read_text().splitlines() if log.exists() else []:
            name, seconds = line.split()
            calls[name].append(float(seconds))
        began = time.process_time()
        size = encoded_bytes(result, arguments.quality)
        encoding = time.process_time() - began
        print(f"{wall:.0f} s; segments of {[each.n_frames for each in result.segments]} frames")
        print(result.distances)
        print(f"{opening:.0f} processor seconds to open the files, {encoding:.0f} to encode")
        for name, times in calls.items():
            mean, largest = sum(times) / len(times), max(times)
            print(f"{name}: {len(times)} calls, mean {mean:.1f} s, largest {largest:.1f} s")
        path = opening + encoding + sum(map(max, calls.values()))
        total = opening + encoding + sum(map(sum, calls.values()))
        print(f"critical path {path:.0f} of {total:.0f} processor seconds")
        for who, name in ((resource.RUSAGE_SELF, "process"), (resource.RUSAGE_CHILDREN, "child")):
            print(f"{name}: peak memory {resource.getrusage(who).ru_maxrss / 1e3:.0f} MB")
        if arguments.compare:
            runs.RUN_FRAMES = arguments.frames
            whole = encoded_bytes(registered(files, options)[0], arguments.quality)
            print(f"joined {size} bytes, one run {whole}: {100 * (size / whole - 1):+.2f} %")


def encoded_bytes(registration: Registration, quality: float) -> int:
    """Return the size of the encoded segments."""
    sequence = registration.sequence
    return len(meshreel.encode(sequence, quality=quality, tune="surface", order="drop"))


if __name__ == "__main__":
    main()
