"""Record frames of a camera into a file that survives a crash.

    python examples/record.py --out recording.reel
    python examples/record.py --crash-after 3 --out crashed.reel

The camera is simulated: a flag with sensor noise. With `--crash-after`, the recorder runs in a
process that is killed, without a chance to close the file; all complete blocks can be read.
"""

import argparse
import multiprocessing
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

import meshreel

FPS, NOISE_M, LATENCY_S = 25, 5e-4, 1.0
QUALITY = 65  # a higher one would store the noise

FLAG = meshreel.simulate_flag(100, n_rows=36, n_columns=36, fps=FPS)


def camera(seconds: float) -> Iterator[npt.NDArray[np.floating]]:
    """Yield frames of shape (V, 3) in real time."""
    rng, begin = np.random.default_rng(1), time.monotonic()
    for number in range(round(seconds * FPS)):
        time.sleep(max(0, begin + number / FPS - time.monotonic()))
        frame = FLAG.vertices[number % len(FLAG)]
        yield frame + rng.normal(0, NOISE_M, frame.shape).astype(frame.dtype)


def record(output: Path, seconds: float) -> None:
    """Push each frame when it arrives; a block is in the file at most LATENCY_S later."""
    with meshreel.Encoder(
        FLAG.faces, output, fps=FPS, max_latency_s=LATENCY_S, quality=QUALITY
    ) as encoder:
        for frame in camera(seconds):
            encoder.push(frame)
    print(f"recorded {encoder.n_frames} frames, {encoder.latency_s:.2f} s from frame to file")


def main() -> None:
    """Record, kill the recorder if asked to, and read the file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="a .reel to write")
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--crash-after", type=float, metavar="SECONDS")
    arguments = parser.parse_args()
    if arguments.out.exists():
        parser.error(f"{arguments.out} exists")
    if arguments.crash_after is None:
        record(arguments.out, arguments.seconds)
    else:
        recorder = multiprocessing.get_context("spawn").Process(
            target=record, args=(arguments.out, arguments.seconds)
        )
        recorder.start()
        while not arguments.out.exists():
            time.sleep(0.01)
        time.sleep(arguments.crash_after)
        recorder.kill()
        recorder.join()
        print(f"killed the recorder after {arguments.crash_after:g} s")
    with meshreel.open(arguments.out) as reel:
        n_bytes = sum(frame.vertices.nbytes for frame in reel)
        print(f"{len(reel)} frames, {len(reel) / FPS:.2f} s, can be read: {n_bytes / 1e6:.1f} MB")
    print(f"{arguments.out}: {arguments.out.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
