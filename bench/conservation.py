"""Check that everything in files is kept or named when meshreel reads them.

    python bench/conservation.py FOLDER [FILE ...]

Each file of a known format is listed by a reader that is independent of ours (`contents`), and
compared with the sequence that `meshreel.load` returns and with its notes. The table counts, for
each format, the values listed, kept, named in a note, and silent, which should be 0. Files run in
processes of their own, with limits of time and memory; `--list` prints each silent value.
"""

import argparse
import multiprocessing
import resource
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from importlib import import_module
from importlib.util import find_spec
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import contents
import meshreel
from contents.items import Balance, Item, balance, items_of
from meshreel.formats.kinds import SequenceFormat
from meshreel.formats.registry import FORMATS, extension_of
from meshreel.studies.study import markdown_table

HELPERS = ("__init__", "items")
"""Modules of `contents` that read no format."""

LIBRARIES = {"usd": "pxr"}
"""Libraries that modules of `contents` import at once; without them, their formats are omitted."""

BY_VTK = (
    ".vtu", ".vtp", ".vtk", ".pvd", ".case", ".encas", ".e", ".ex2", ".exo", ".g", ".cgns", ".foam",
    ".cas",
)  # fmt: skip
"""Formats that our readers or the walks read with the library vtk."""

FORK = multiprocessing.get_context("fork")
"""Starts processes that have imported all libraries already."""

TIMEOUT_S = 120.0
MAX_BYTES = 8 << 30
MAX_FILE_BYTES = 256 << 20

Walk = Callable[[Path], Iterator[Item]]


def walks() -> Mapping[str, Walk]:
    """Return the independent readers by file extension."""
    names = {path.stem for path in Path(contents.__file__).parent.glob("*.py")}
    names -= {*HELPERS, *(name for name in LIBRARIES if find_spec(LIBRARIES[name]) is None)}
    modules = [import_module(f"contents.{name}") for name in sorted(names)]
    return {extension: module.walk for module in modules for extension in module.EXTENSIONS}


def balance_of_reading(path: Path, walk: Walk, **options: Any) -> Balance:
    """Compare what a file holds with what `meshreel.load` returns of it.

    Parameters
    ----------
    options
        Further options of `meshreel.load`; all meshes of a file are merged.
    """
    notes: list[str] = []
    sequence = meshreel.load(path, notes=notes, **{"merge": merges(path), **options})
    return balance(list(walk(path)), list(items_of(sequence)), notes)


def balance_of_writing(sequence: meshreel.MeshSequence, path: Path, walk: Walk) -> Balance:
    """Save a sequence, and compare what it holds with what the file does."""
    notes: list[str] = []
    meshreel.save(sequence, path, notes=notes)
    return balance(list(items_of(sequence)), list(walk(path)), notes)


def merges(path: Path) -> bool:
    """Return whether files of this format may have several meshes, which are to be merged."""
    kind = FORMATS[extension_of(path)]
    return isinstance(kind, SequenceFormat) and kind.read_meshes is not None


def check_apart(path: Path, walk: Walk) -> Balance | str:
    """Check a file in a separate process; returns the message of an error instead."""
    receiver, sender = FORK.Pipe(duplex=False)
    process = FORK.Process(target=_send_balance, args=(path, walk, sender))
    process.start()
    sender.close()
    result: Balance | str = f"timed out after {TIMEOUT_S:g} s"
    try:
        if receiver.poll(TIMEOUT_S):
            result = receiver.recv()
    except EOFError:
        process.join()
        result = f"ended with {process.exitcode}"
    process.kill()
    process.join()
    return result


def _send_balance(path: Path, walk: Walk, sender: Connection) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MAX_BYTES, MAX_BYTES))
    try:
        sender.send(balance_of_reading(path, walk))
    except Exception as error:
        sender.send(f"{type(error).__name__}: {error}"[:200])


def main() -> None:
    """Check files, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("paths", nargs="+", type=Path, help="files, or folders of files")
    parser.add_argument("--list", action="store_true", help="print silent values and failures")
    arguments = parser.parse_args()
    readers = walks()
    found = [
        path
        for start in arguments.paths
        for path in (sorted(start.rglob("*")) if start.is_dir() else [start])
        if extension_of(path) in readers and path.is_file()
        and path.stat().st_size <= MAX_FILE_BYTES
    ]  # fmt: skip
    totals: dict[str, Counter[str]] = defaultdict(Counter)
    for path in found:
        result = check_apart(path, readers[extension_of(path)])
        counts = totals[extension_of(path)]
        counts["files"] += 1
        if isinstance(result, str):
            counts["refused"] += 1
            if arguments.list:
                print(f"{path}: {result}")
            continue
        counts.update(asdict(result) | {"silent": len(result.silent)})
        if arguments.list and result.silent:
            print(f"{path}: {', '.join(result.silent)}")
    columns = ("files", "refused", "listed", "kept", "named", "silent")
    rows = [
        [name, *(str(counts[column]) for column in columns)]
        for name, counts in sorted(totals.items())
    ]
    print(markdown_table(["format", *columns], rows))


if __name__ == "__main__":
    main()
