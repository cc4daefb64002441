"""Memory and smoothness of a `.reel` in a page, over long play and many seeks.

    python bench/web_memory.py samba.npz --out memory.json

Frames are repeated to ten seconds in blocks of one second, so that blocks are decoded ahead
continuously. Measures, in a headless Chromium with software rendering, the memory of the page's
process after loops and seeks, then frame times and main-thread tasks during playback and with a
static picture. Build the package first (`npm run build` in `npm/`), and install `playwright`.
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import meshreel
from measuring import machine_text, print_table, store
from web_browser import MeasuredPage, bundled, opened, page_files, served

DURATION_S = 10
N_LOOPS = 100
N_SEEKS = 1000
PARTS = 5
"""Memory is measured after each of these parts of the loops and seeks."""
SPEED = 20.0
PLAYED_LOOPS = 2
PICTURE_MS = 1000 / 60


def repeated(sequence: meshreel.MeshSequence, fps: float) -> meshreel.MeshSequence:
    """Ten seconds, forwards and back."""
    forwards = np.arange(sequence.n_frames)
    period = np.concatenate([forwards, forwards[-2:0:-1]])
    frames = np.resize(period, round(fps * DURATION_S))
    return meshreel.MeshSequence(sequence.vertices[frames], sequence.faces, fps=fps)


def memory(page: MeasuredPage, stage: str) -> dict[str, Any]:
    """Measure and print the memory of the page."""
    process_mb, gl_mb = page.memory_bytes() / 1e6, page.ask("glBytes") / 1e6
    print(f"{stage}: {process_mb:.1f} MB, {gl_mb:.2f} MB of WebGL", flush=True)
    return {"after": stage, "process_mb": process_mb, "gl_mb": gl_mb}


def memory_over_time(page: MeasuredPage) -> list[dict[str, Any]]:
    """Measure memory after parts of the loops and seeks; the first part is a warm-up."""
    samples = []
    for part in range(1, PARTS + 1):
        page.ask("loop", N_LOOPS // PARTS, SPEED)
        samples.append(memory(page, f"{part * N_LOOPS // PARTS} loops"))
    for part in range(1, PARTS + 1):
        page.ask("seek", N_SEEKS // PARTS)
        samples.append(memory(page, f"{part * N_SEEKS // PARTS} seeks"))
    return samples


def smoothness(page: MeasuredPage, call: str, *given: float) -> dict[str, Any]:
    """Measure frame times and task times."""
    tasks: list[float] = []
    with page.tasks_ms(tasks):
        answer = page.ask(call, *given)
    intervals = np.array(answer["intervals"] if isinstance(answer, dict) else answer)
    return {
        "pictures": len(intervals),
        "waits": answer["nWaits"] if isinstance(answer, dict) else 0,
        "pictures dropped": int(np.sum(np.rint(intervals / PICTURE_MS) - 1)),
        "longest_interval_ms": float(intervals.max()),
        "tasks": len(tasks),
        "long_tasks": sum(task > PICTURE_MS for task in tasks),
        "longest_task_ms": max(tasks),
    }


def main() -> None:
    """Measure, print tables, and write JSON if requested."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--fps", type=float, default=25.0)
    parser.add_argument("--out", type=Path, help="write the figures here as JSON")
    options = parser.parse_args()
    sequence = repeated(meshreel.load(options.file), options.fps)
    data = meshreel.encode(sequence, block_frames=round(options.fps))
    with TemporaryDirectory() as folder:
        files = page_files(bundled("memory.js", Path(folder)))
    with served(files | {"/long.reel": data}) as server, opened(f"{server}/index.html") as page:
        page.ask("still", 1)
        before = memory(page, "nothing")
        fields_mb = page.ask("open", "/long.reel") / 1e6
        played = [memory(page, "opening"), *memory_over_time(page)]
        smooth = {
            "plays": smoothness(page, "loop", PLAYED_LOOPS, 1),
            "still": smoothness(page, "still", DURATION_S),
        }
    n_blocks = len(meshreel.info(data).block_frames)
    print(f"\n**{options.file.stem}**: {sequence.n_frames} frames of {sequence.n_verts} vertices, "
          f"{n_blocks} blocks, {len(data) / 1e6:.3f} MB; fields of a block {fields_mb:.2f} MB. "
          f"{machine_text()}\n")  # fmt: skip
    lines = [
        [peak["after"], f"{peak['process_mb'] - before['process_mb']:.1f}", f"{peak['gl_mb']:.2f}"]
        for peak in played
    ]
    print_table("", ["after", "MB more than without", "MB of WebGL"], lines)
    titles = ["", *(key.replace("_", " ") for key in smooth["plays"])]
    rows = ([how, *(f"{figure:.4g}" for figure in each.values())] for how, each in smooth.items())
    print_table("", titles, rows)
    store(options.out, fields_mb=fields_mb, before=before, memory=played, **smooth)


if __name__ == "__main__":
    main()
