"""Record frames of a camera, and read the file while it is written.

    python examples/record.py recording.reel --seconds 4

The camera is simulated: a flag with sensor noise. If the recording is interrupted, the file opens
up to the last complete block.
"""

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import meshreel

FPS = 25
NOISE_M = 5e-4


def camera(seconds: float) -> tuple[np.ndarray, Iterator[np.ndarray]]:
    """Return faces of shape (M, 3), and an iterator of frames of shape (V, 3) in real time."""
    flag = meshreel.simulate_flag(int(seconds * FPS), fps=FPS)
    rng = np.random.default_rng(1)

    def frames() -> Iterator[np.ndarray]:
        for frame in flag:
            time.sleep(1 / FPS)
            yield frame + rng.normal(0, NOISE_M, frame.shape).astype(np.float32)

    return flag.faces, frames()


def main() -> None:
    """Record, and read the file before and after its end."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("output", type=Path)
    parser.add_argument("--seconds", type=float, default=4.0)
    arguments = parser.parse_args()
    faces, frames = camera(arguments.seconds)
    with meshreel.Encoder(faces, arguments.output, fps=FPS, max_latency_s=1) as encoder:
        for frame in frames:
            encoder.push(frame)
        print(f"pushed {encoder.n_frames} frames, {encoder.size_bytes} bytes are written")
        if encoder.latency_s:  # the first block is complete
            with meshreel.open(arguments.output) as reel:
                print(f"{len(reel)} of them can be read already")
    with meshreel.open(arguments.output) as reel:
        stream = reel.info()
        print(f"{len(reel)} frames in {stream.size_bytes} bytes, {stream.rate_bpvf:.2f} bpvf")


if __name__ == "__main__":
    main()
