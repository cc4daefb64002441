"""How often a call changes file: a measure of how far a reader has to jump to follow it.

    python bench/call_path.py cow.npz

Counts, for encoding with the defaults, encoding with a largest error, and decoding, how often a
function of `src/meshreel` is entered in another file than the one entered before it, and in how
many files. Only the calling thread counts. Prints a Markdown table; `--pairs` lists which files
follow which, the most frequent first.
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

ROOT = f"{Path(meshreel.__file__).parent}/"


def file_changes(function: Callable[[], object]) -> Counter[tuple[str, str]]:
    """How often a call of the function goes from one file to another, by the names of both.

    The function is called twice, so that imports do not count.
    """
    function()
    found: Counter[tuple[str, str]] = Counter()
    last = ""

    def enter(frame: FrameType, event: str, _: Any) -> None:
        nonlocal last
        path = frame.f_code.co_filename
        if event != "call" or not path.startswith(ROOT):
            return
        if last and path != last:
            found[last.removeprefix(ROOT), path.removeprefix(ROOT)] += 1
        last = path

    before = sys.getprofile()
    sys.setprofile(enter)
    try:
        function()
    finally:
        sys.setprofile(before)
    return found


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", help="a sequence; flag is the embedded one")
    parser.add_argument("--max-error", default="0.1", help="largest error, in percent")
    parser.add_argument("--pairs", action="store_true", help="list which files follow which")
    given = parser.parse_args()
    flag = given.source == "flag"
    sequence = meshreel.simulate_flag(100) if flag else meshreel.load(given.source)
    data = meshreel.encode(sequence)
    calls: dict[str, Callable[[], object]] = {
        "encode": partial(meshreel.encode, sequence),
        f"encode, max_error={given.max_error}": partial(
            meshreel.encode, sequence, max_error=given.max_error
        ),
        "decode": partial(meshreel.decode, data),
    }
    print("| call | changes of file | files |\n|---|---|---|")
    for name, call in calls.items():
        found = file_changes(call)
        files = {path for pair in found for path in pair}
        print(f"| {name} | {found.total()} | {len(files)} |")
        for (first, second), count in found.most_common() if given.pairs else ():
            print(f"  {count} {first} -> {second}")


if __name__ == "__main__":
    main()
