"""Live encoding: speed relative to real time, and latency.

    python bench/live.py samba.npz --fps 25 --latencies 0.5,1,2,4 --out live.json

Frames are pushed as fast as the encoder accepts them, the sequence repeated up to a given number of
frames. Speed is the duration of the frames divided by the time until the file is finished. Every
latency is measured for `reel` and for the paper's tracked basis.
"""

import argparse
from functools import partial
from io import BytesIO
from pathlib import Path
from statistics import median
from typing import Any

import meshreel
from inputs import add_inputs, sources
from measuring import machine_text, print_table, store
from meshreel.studies.timing import timed_once

HEADER = ["requested latency s", "method", "frames per block", "x real time",
          "longest push s", "latency at real time s", "bits per vertex and frame",
          "KG error %"]  # fmt: skip


def record(
    sequence: meshreel.MeshSequence, n_frames: int, fps: float, options: dict[str, Any]
) -> tuple[bytes, dict[str, float]]:
    """Push frames sequentially; return the stream and times."""
    file = BytesIO()

    def push_all() -> float:
        longest_s = 0.0
        with meshreel.Encoder(sequence.faces, file, fps=fps, **options) as encoder:
            for number in range(n_frames):
                frame = sequence.vertices[number % sequence.n_frames]
                _, seconds = timed_once(partial(encoder.push, frame))
                longest_s = max(longest_s, seconds.wall)
        return longest_s

    longest_s, seconds = timed_once(push_all)
    return file.getvalue(), {"seconds": seconds.wall, "longest_push_s": longest_s}


def measure(
    sequence: meshreel.MeshSequence,
    n_frames: int,
    fps: float,
    options: dict[str, Any],
    repeats: int,
) -> dict[str, Any]:
    """Medians of several recordings, without the first."""
    runs = [record(sequence, n_frames, fps, options) for _ in range(repeats + 1)]
    data, times = runs[-1][0], [figures for _, figures in runs[1:]]
    stream = meshreel.info(data)
    seconds = median(run["seconds"] for run in times)
    block_frames = max(stream.block_frames)
    decoded = meshreel.decode(data, frames=slice(0, sequence.n_frames))
    return {
        "options": options,
        "block_frames": block_frames,
        "real_time": n_frames / fps / seconds,
        "longest_push_s": median(run["longest_push_s"] for run in times),
        # A block's first frame waits for the others, and for the block to be coded.
        "latency_s": (block_frames - 1) / fps + seconds * block_frames / n_frames,
        "rate_bpvf": stream.rate_bpvf,
        "kg_error_percent": meshreel.compare(sequence, decoded).kg_error_percent,
        "runs": times,
    }


def row(result: dict[str, Any]) -> list[str]:
    """The cells of one setting."""
    options = result["options"]
    return [
        format(options["max_latency_s"], "g"),
        options["method"],
        str(result["block_frames"]),
        *(format(result[key], ".1f") for key in ("real_time",)),
        *(format(result[key], ".2f") for key in ("longest_push_s", "latency_s")),
        *(format(result[key], ".3f") for key in ("rate_bpvf", "kg_error_percent")),
    ]


def main() -> None:
    """Measure, print tables, and write JSON if requested."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    add_inputs(parser)
    parser.add_argument("--fps", type=float, default=25.0)
    parser.add_argument("--latencies", default="0.5,1,2,4", help="in seconds")
    parser.add_argument("--frames", type=int, help="to push; default: each frame once")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--out", type=Path, help="write the figures here as JSON")
    options, results = parser.parse_args(), []
    for source in sources(options):
        sequence = source()
        n_frames = options.frames or sequence.n_frames
        settings: list[dict[str, Any]] = [
            {"max_latency_s": float(text), "method": "reel"}
            for text in options.latencies.split(",")
        ]
        settings.append({"max_latency_s": 2.0, "method": "blocks"})
        rows = [
            measure(sequence, n_frames, options.fps, setting, options.repeats)
            for setting in settings
        ]
        results.append({"sequence": sequence.name, "n_frames": n_frames, "settings": rows})
        print(f"**{sequence.name}**: {n_frames} frames of {sequence.n_verts} vertices pushed one "
              f"by one, {options.fps:g} frames per second. Medians of {options.repeats} runs. "
              f"{machine_text()}\n")  # fmt: skip
        print_table("", HEADER, map(row, rows))
    store(options.out, fps=options.fps, results=results)


if __name__ == "__main__":
    main()
