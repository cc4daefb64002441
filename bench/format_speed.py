"""Seconds to read and write every file format, relative to reading and writing its bytes.

    python bench/format_speed.py
    python bench/format_speed.py .obj .ply --repeats 11 --out formats.json

A waving sphere of 10,242 vertices and 20 frames is written in each format of meshreel whose library
is installed. Formats are timed in alternating rounds; the table lists medians without the first
round. "Bytes" is the time of NumPy for the same files without parsing. Files "from disk" are
evicted from the page cache first if the system allows it; all others are cached.
"""

import argparse
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import meshreel
from inputs import waving_sphere
from measuring import is_unsteady, machine_text, medians, print_table, store
from meshreel.formats.kinds import FrameFormat, SequenceFormat
from meshreel.formats.registry import FORMATS, is_written
from meshreel.studies.timing import timed_once

SPHERE = (5, 20)
"""Subdivisions (10,242 vertices) and frames."""

CAN_EVICT = hasattr(os, "posix_fadvise")

RATIOS = {"read": "read_bytes", "read_disk": "read_bytes_disk", "write": "write_bytes"}
HEADER = ["format", "MB", "read s", "by bytes", "from disk s", "by bytes", "write s", "by bytes"]

Seconds = dict[str, float]


@dataclass(frozen=True)
class Case:
    """A format and the files of a sequence in it."""

    extension: str
    paths: list[Path]
    read: Callable[[], Any]
    write: Callable[[], Any]

    @property
    def size_bytes(self) -> int:
        return sum(path.stat().st_size for path in self.paths)


def parse_options() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "extensions", nargs="*", metavar="EXTENSION", help=".obj and others; default: all"
    )
    parser.add_argument("--repeats", type=int, default=5, help="rounds of each format")
    parser.add_argument("--out", type=Path, help="write the figures here as JSON")
    options = parser.parse_args()
    if unknown := [extension for extension in options.extensions if extension not in FORMATS]:
        parser.error(f"unknown extensions {', '.join(unknown)}; known are {', '.join(FORMATS)}")
    return options


def why_not(file_format: FrameFormat | SequenceFormat) -> str:
    """Reason why a format cannot be measured; empty if it can."""
    extra = file_format.extra if isinstance(file_format, SequenceFormat) else None
    if extra is not None and not extra.is_installed:
        return f"{extra.library} is not installed"
    return "" if is_written(file_format) else "it is only read"


def case_of(
    file_format: FrameFormat | SequenceFormat, sequence: meshreel.MeshSequence, folder: Path
) -> Case:
    """Write a sequence in a format, and return the tasks to time."""
    folder.mkdir()
    is_whole = isinstance(file_format, SequenceFormat)
    output = folder / f"sphere{'' if is_whole else '_%04d'}{file_format.extension}"
    write = partial(meshreel.save, sequence, output, overwrite=True)
    paths = [Path(path) for path in write()]
    source = paths[0] if is_whole else paths
    return Case(file_format.extension, paths, partial(meshreel.load, source), write)


def read_bytes(paths: list[Path]) -> None:
    """Read files without parsing them."""
    for path in paths:
        np.fromfile(path, np.uint8)


def write_bytes(contents: list[np.ndarray], folder: Path) -> None:
    """Write files with the same contents."""
    for index, content in enumerate(contents):
        content.tofile(folder / f"bytes_{index}")


def evict(paths: list[Path]) -> None:
    """Evict the files from the system's page cache."""
    for path in paths:
        with path.open("rb") as file:
            os.fsync(file.fileno())
            os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def one_round(case: Case) -> Seconds:
    """Time every task once."""
    contents = [np.fromfile(path, np.uint8) for path in case.paths]
    plain = partial(read_bytes, case.paths)
    tasks: dict[str, Callable[[], Any]] = {
        "write_bytes": partial(write_bytes, contents, case.paths[0].parent),
        "write": case.write,
        "read_bytes": plain,
        "read": case.read,
    }
    times = {name: timed_once(task)[1].wall for name, task in tasks.items()}
    for name in ("read_bytes", "read") if CAN_EVICT else ():
        evict(case.paths)
        times[f"{name}_disk"] = timed_once(tasks[name])[1].wall
    return times


def measure(cases: list[Case], n_rounds: int) -> list[dict[str, Any]]:
    """Time all cases in alternating rounds, and return the results of each."""
    rounds = [[one_round(case) for case in cases] for _ in range(n_rounds + 1)][1:]
    results = []
    for index, case in enumerate(cases):
        runs = {name: [turn[index][name] for turn in rounds] for name in rounds[0][index]}
        seconds = medians(runs)
        results.append(
            {
                "format": case.extension,
                "size_bytes": case.size_bytes,
                "seconds": seconds,
                "ratios": {a: seconds[a] / seconds[b] for a, b in RATIOS.items() if a in seconds},
                "unsteady": [name for name, times in runs.items() if is_unsteady(times)],
            }
        )
    return results


def row(result: dict[str, Any]) -> list[str]:
    """The cells of one format; unsteady times have a question mark."""
    cells = [result["format"], f"{result['size_bytes'] / 1e6:.1f}"]
    for name, base in RATIOS.items():
        if name not in result["seconds"]:
            cells += ["-", "-"]
            continue
        marks = {key: "?" if key in result["unsteady"] else "" for key in (name, base)}
        cells.append(f"{result['seconds'][name]:.4f}{marks[name]}")
        cells.append(f"{result['ratios'][name]:.1f}{marks[name] or marks[base]}")
    return cells


def main() -> None:
    """Measure, print a table, and write JSON if requested."""
    options = parse_options()
    formats = [FORMATS[extension] for extension in options.extensions or FORMATS]
    reasons = {file_format.extension: why_not(file_format) for file_format in formats}
    sequence = waving_sphere(*SPHERE)
    with TemporaryDirectory() as folder:
        cases = [
            case_of(file_format, sequence, Path(folder) / file_format.extension[1:])
            for file_format in formats
            if not reasons[file_format.extension]
        ]
        results = measure(cases, options.repeats)
    print(f"# Speed of formats\n\n{machine_text()} {sequence!r}. ", end="")
    print(f"Medians of {options.repeats} alternating rounds; ?: runs differ too much.\n")
    print_table("", HEADER, map(row, results))
    for extension, reason in reasons.items():
        if reason:
            print(f"\n{extension} is not measured: {reason}.")
    store(options.out, results=results)


if __name__ == "__main__":
    main()
