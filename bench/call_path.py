"""Count how often a call crosses files: how often a reader must jump to follow it.

    python bench/call_path.py cow.npz

For encoding (by default, with a largest error, with two tracks), decoding, saving as GLB, and
decoding to GLB on the command line, counts how often consecutive function calls inside
`src/meshreel` are in different files, and the number of files. Only the calling thread counts.
Prints a Markdown table; `--pairs` lists pairs of consecutive files by frequency.
"""

import argparse
import gc
import io
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from contextlib import redirect_stdout
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

import meshreel
from measuring import start_table
from meshreel.app.cli.app import app

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
    gc.collect()  # finalizers of other objects do not count either
    gc.disable()
    sys.setprofile(enter)
    try:
        function()
    finally:
        sys.setprofile(previous)
        gc.enable()
    return changes


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", help="a sequence")
    parser.add_argument("--pairs", action="store_true", help="list pairs of consecutive files")
    arguments = parser.parse_args()
    sequence = meshreel.load(arguments.source)
    velocities = np.gradient(sequence.vertices, axis=0)
    speeds = np.linalg.norm(velocities, axis=2, keepdims=True)
    tracks = {"velocity": meshreel.Track(velocities), "speed": meshreel.Track(speeds)}
    data, folder = meshreel.encode(sequence), Path(tempfile.mkdtemp())
    reel, glb = folder / "a.reel", folder / "a.glb"
    reel.write_bytes(data)
    decode_to_glb = partial(app, ["decode", str(reel), "-o", str(glb), "--force"])
    calls: dict[str, Callable[[], object]] = {
        "encode": partial(meshreel.encode, sequence),
        "encode, max_error=0.1": partial(meshreel.encode, sequence, max_error=0.1),
        "encode, two tracks": partial(meshreel.encode, sequence.replace(tracks=tracks)),
        "decode": partial(meshreel.decode, data),
        "save GLB": partial(meshreel.save, sequence, glb, overwrite=True),
        "meshreel decode to GLB": partial(decode_to_glb, standalone_mode=False),
    }
    print_row = start_table("call", "changes of file", "files")
    for name, call in calls.items():
        with redirect_stdout(io.StringIO()):
            changes = file_changes(call)
        files = {path for pair in changes for path in pair}
        print_row(name, str(changes.total()), str(len(files)))
        for (first, second), count in changes.most_common() if arguments.pairs else ():
            print(f"  {count} {first} -> {second}")


if __name__ == "__main__":
    main()
