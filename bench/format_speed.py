"""Seconds of reading and writing every file format, relative to reading and writing its bytes.

    python bench/format_speed.py
    python bench/format_speed.py .obj .ply --repeats 11 --out formats.json

A waving sphere of 10,242 vertices and 20 frames is written in each format that meshreel knows and
whose library is installed; all are timed in turn, round by round, and medians are given; the first
round is not counted. "Bytes" is the time of NumPy for as many files of as many bytes, unparsed.
Files "from disk" were evicted from the page cache before, where the system allows it; all others
are in the cache, as they are just after writing.
"""

import argparse
import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import meshreel
from meshreel.evaluation.runs.machine import machine_facts, machine_line
from meshreel.formats.kinds import FrameFormat, SequenceFormat
from meshreel.formats.registry import FORMATS, is_written
from speed_inputs import waving_sphere
from speed_tables import table
from speed_timing import is_unsteady, seconds

SPHERE = (5, 20)
"""Subdivisions, which make 10,242 vertices, and frames."""

CAN_EVICT = hasattr(os, "posix_fadvise")

RATIOS = {"read": "read_bytes", "read_disk": "read_bytes_disk", "write": "write_bytes"}
HEADER = ["format", "MB", "read s", "by bytes", "from disk s", "by bytes", "write s", "by bytes"]

Seconds = dict[str, float]


@dataclass(frozen=True)
class Case:
    """A format, and the files that a sequence takes in it."""

    extension: str
    paths: list[Path]
    read: Callable[[], Any]
    write: Callable[[], Any]

    @property
    def size_bytes(self) -> int:
        return sum(path.stat().st_size for path in self.paths)


def parsed_options() -> argparse.Namespace:
    """The command line."""
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


def why_not(found: FrameFormat | SequenceFormat) -> str:
    """Reason why a format cannot be measured; empty if it can."""
    extra = found.extra if isinstance(found, SequenceFormat) else None
    if extra is not None and not extra.is_installed:
        return f"{extra.library} is not installed"
    return "" if is_written(found) else "it is only read"


def case_of(
    found: FrameFormat | SequenceFormat, sequence: meshreel.MeshSequence, folder: Path
) -> Case:
    """The tasks to time for a format; its files are written."""
    folder.mkdir()
    is_whole = isinstance(found, SequenceFormat)
    output = folder / f"sphere{'' if is_whole else '_%04d'}{found.extension}"
    write = partial(meshreel.save, sequence, output, overwrite=True)
    paths = [Path(path) for path in write()]
    source = paths[0] if is_whole else paths
    return Case(found.extension, paths, partial(meshreel.load, source), write)


def read_bytes(paths: list[Path]) -> None:
    """Read files without parsing them."""
    for path in paths:
        np.fromfile(path, np.uint8)


def write_bytes(contents: list[np.ndarray], folder: Path) -> None:
    """Write as many files of as many bytes."""
    for index, content in enumerate(contents):
        content.tofile(folder / f"bytes_{index}")


def evict(paths: list[Path]) -> None:
    """Evict the files from the system's page cache."""
    for path in paths:
        with path.open("rb") as file:
            os.fsync(file.fileno())
            os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def one_round(case: Case) -> Seconds:
    """Seconds of everything once."""
    contents = [np.fromfile(path, np.uint8) for path in case.paths]
    plain = partial(read_bytes, case.paths)
    found = {
        "write_bytes": seconds(partial(write_bytes, contents, case.paths[0].parent)),
        "write": seconds(case.write),
        "read_bytes": seconds(plain),
        "read": seconds(case.read),
    }
    if CAN_EVICT:
        evict(case.paths)
        found["read_bytes_disk"] = seconds(plain)
        evict(case.paths)
        found["read_disk"] = seconds(case.read)
    return found


def measured(cases: list[Case], n_rounds: int) -> list[dict[str, Any]]:
    """The figures of each case, all timed in turn."""
    rounds = [[one_round(case) for case in cases] for _ in range(n_rounds + 1)][1:]
    results = []
    for index, case in enumerate(cases):
        runs = {name: [turn[index][name] for turn in rounds] for name in rounds[0][index]}
        medians = {name: median(own) for name, own in runs.items()}
        results.append(
            {
                "format": case.extension,
                "size_bytes": case.size_bytes,
                "seconds": medians,
                "ratios": {a: medians[a] / medians[b] for a, b in RATIOS.items() if a in medians},
                "unsteady": [name for name, own in runs.items() if is_unsteady(own)],
            }
        )
    return results


def row(result: dict[str, Any]) -> list[str]:
    """The cells of one format; figures of disturbed runs have a question mark."""
    cells = [result["format"], f"{result['size_bytes'] / 1e6:.1f}"]
    for name, base in RATIOS.items():
        if name not in result["seconds"]:
            cells += ["-", "-"]
            continue
        doubt = {one: "?" if one in result["unsteady"] else "" for one in (name, base)}
        cells.append(f"{result['seconds'][name]:.4f}{doubt[name]}")
        cells.append(f"{result['ratios'][name]:.1f}{doubt[name] or doubt[base]}")
    return cells


def main() -> None:
    """Measure what the command line asks for; print a table, and write JSON where asked."""
    options = parsed_options()
    chosen = [FORMATS[extension] for extension in options.extensions or FORMATS]
    reasons = {found.extension: why_not(found) for found in chosen}
    sequence = waving_sphere(*SPHERE)
    with TemporaryDirectory() as folder:
        cases = [
            case_of(found, sequence, Path(folder) / found.extension[1:])
            for found in chosen
            if not reasons[found.extension]
        ]
        results = measured(cases, options.repeats)
    machine = machine_facts()
    print(f"# Speed of formats\n\n{machine_line(machine)}. {sequence!r}. ", end="")
    print(f"Medians of {options.repeats} rounds, all in turn; ?: runs differ too much.\n")
    print(table(HEADER, map(row, results)))
    for extension, reason in reasons.items():
        if reason:
            print(f"\n{extension} is not measured: {reason}.")
    if options.out:
        options.out.write_text(
            json.dumps({"machine": machine, "results": results}, indent=2) + "\n"
        )


if __name__ == "__main__":
    main()
