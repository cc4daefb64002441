"""Count how often a call crosses files: how often a reader must jump to follow it.

    python bench/call_path.py cow.npz

For encoding with default options, encoding with a largest error, and decoding, counts how often
consecutive function calls inside `src/meshreel` are in different files, and the number of files.
Only the calling thread counts. Prints a Markdown table; `--pairs` lists pairs of consecutive files
by frequency.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

import meshreel
from measuring import start_table

ROOT = f"{Path(meshreel.__file__).parent}/"


def file_changes(function: Callable[[], object]) -> Counter[tuple[str, str]]:
    """Count changes of file during a call, by pair of files.

    The function is called twice, so that imports do not count.
    """
    function()
    changes: Counter[tuple[str, str]] = Counter()
    last = ""

    def enter(frame: FrameType, event: str, _: Any) -> None:
        nonlocal last
        path = frame.f_code.co_filename
        if event != "call" or not path.startswith(ROOT):
            return
        if last and path != last:
            changes[last.removeprefix(ROOT), path.removeprefix(ROOT)] += 1
        last = path

    previous = sys.getprofile()
    sys.setprofile(enter)
    try:
        function()
    finally:
        sys.setprofile(previous)
    return changes


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", help="a sequence; flag is the embedded one")
    parser.add_argument("--max-error", default="0.1", help="largest error, in percent")
    parser.add_argument("--pairs", action="store_true", help="list pairs of consecutive files")
    arguments = parser.parse_args()
    is_flag = arguments.source == "flag"
    sequence = meshreel.simulate_flag(100) if is_flag else meshreel.load(arguments.source)
    data = meshreel.encode(sequence)
    calls: dict[str, Callable[[], object]] = {
        "encode": partial(meshreel.encode, sequence),
        f"encode, max_error={arguments.max_error}": partial(
            meshreel.encode, sequence, max_error=arguments.max_error
        ),
        "decode": partial(meshreel.decode, data),
    }
    print_row = start_table("call", "changes of file", "files")
    for name, call in calls.items():
        changes = file_changes(call)
        files = {path for pair in changes for path in pair}
        print_row(name, str(changes.total()), str(len(files)))
        for (first, second), count in changes.most_common() if arguments.pairs else ():
            print(f"  {count} {first} -> {second}")


if __name__ == "__main__":
    main()
