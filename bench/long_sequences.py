"""Long sequences: speed, memory, random access, and bytes by block length at equal KG error.

    python bench/long_sequences.py jumping.npz --kinds loops,mixed,held --frames 10000
    python bench/long_sequences.py jumping.npz --frames 2000 --blocks 250,500,1000,2000

`long_sources` builds sequences from a performance: looped at varying speed; mixed (upper and lower
half of the body from different frames, rotation, slow motion, pauses); mostly paused. With
`--blocks` every length is coded at two qualities, and its bytes, without connectivity and order,
are interpolated logarithmically at the KG error of the first length and quality. Without it the
encoder's default length is measured.
"""

import argparse
import math
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from typing import Any

import meshreel
from long_sources import KINDS, LongSequence
from measuring import peak_mib, print_table
from meshreel.codec.achieved import measure_stream
from meshreel.codec.reel_file import ReelFile
from meshreel.studies.timing import timed_once

QUALITIES = (80.0, 87.0)


@dataclass(frozen=True)
class Point:
    """A stream with its size, error and encoding time.

    Attributes
    ----------
    data : bytes
    moving_bytes : int
        Size without connectivity and order.
    kg_error_percent : float
    seconds, processor_s : float
        Encoding time, including the generation of frames.
    """

    data: bytes
    moving_bytes: int
    kg_error_percent: float
    seconds: float
    processor_s: float


def measure(sequence: LongSequence, quality: float, **options: Any) -> Point:
    """Encode a sequence, and measure the error of the stream."""
    data, seconds = timed_once(partial(meshreel.encode, sequence, quality=quality, **options))
    budget = meshreel.info(data).budget_bytes
    still = budget["order"] + budget["connectivity"]
    error = measure_stream(meshreel.MeshSequence.of_segments([sequence]), data).kg_error_percent
    return Point(data, len(data) - still, error, *seconds)


def bytes_at(points: list[Point], kg_error_percent: float) -> float:
    """Bytes at an error, interpolated logarithmically between two points."""
    first, second = (
        (math.log(point.kg_error_percent), math.log(point.moving_bytes)) for point in points
    )
    slope = (second[1] - first[1]) / (second[0] - first[0])
    return math.exp(first[1] + slope * (math.log(kg_error_percent) - first[0]))


def access_ms(data: bytes) -> tuple[float, float, float]:
    """Milliseconds to the first frame of a file, and mean and largest to one of a later block.

    The second block is excluded, because it loads data that all later blocks share.
    """

    def opened() -> ReelFile:
        reel = ReelFile(BytesIO(data))
        reel.read(0, 1)
        return reel

    reel, (first, _) = timed_once(opened)
    reads = (partial(reel.read, number, number + 1) for number in reel.starts[1:-1])
    others = [timed_once(read)[1].wall for read in reads]
    others = others[1:] or others or [first]
    return 1e3 * first, 1e3 * sum(others) / len(others), 1e3 * max(others)


def default_row(sequence: LongSequence) -> list[str]:
    """Measure the encoder's default block length, and return the row of the table."""
    point = measure(sequence, QUALITIES[0])
    memory_mb = peak_mib()
    first, mean, largest = access_ms(point.data)
    info = meshreel.info(point.data)
    frames_per_s = sequence.n_frames / point.seconds
    processor_ms = 1e3 * point.processor_s / sequence.n_frames
    return [
        f"{sequence.name}, {sequence.n_frames}",
        f"{len(info.block_frames)} of {max(info.block_frames)}",
        f"{max(info.n_modes)}",
        f"{frames_per_s:.0f}",
        f"{processor_ms:.1f}",
        f"{memory_mb:.0f}",
        f"{first:.0f}; {mean:.0f}, {largest:.0f}",
        f"{len(point.data)}",
        f"{point.kg_error_percent:.3f}",
    ]


def length_rows(sequence: LongSequence, lengths: list[int]) -> list[list[str]]:
    """Measure block lengths, and return the rows of the table."""
    rows: list[list[str]] = []
    error = 0.0
    for length in lengths:
        points = [measure(sequence, quality, block_frames=length) for quality in QUALITIES]
        error = error or points[0].kg_error_percent
        size = bytes_at(points, error)
        processor_ms = 1e3 * points[0].processor_s / sequence.n_frames
        rows.append(
            [sequence.name, str(length), f"{error:.3f}", f"{size:.0f}", f"{processor_ms:.1f}"]
        )
    return rows


def main() -> None:
    """Measure and print Markdown tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source", help="a performance, such as jumping.npz")
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--frames", type=int, default=10_000)
    parser.add_argument("--blocks", help="block lengths to compare, such as 250,500")
    arguments = parser.parse_args()
    base = meshreel.load(arguments.source)
    sequences = [LongSequence(base, kind, arguments.frames) for kind in arguments.kinds.split(",")]
    if arguments.blocks:
        lengths = [int(text) for text in arguments.blocks.split(",")]
        rows = [row for sequence in sequences for row in length_rows(sequence, lengths)]
        header = ["sequence", "block", "KG %", "bytes", "processor ms per frame"]
        print_table("", header, rows)
        return
    header = ["sequence", "blocks", "modes", "frames/s", "processor ms per frame", "peak MB",
              "ms to the first frame; another block: mean, largest",
              "bytes", "KG %"]  # fmt: skip
    print_table("", header, map(default_row, sequences))


if __name__ == "__main__":
    main()
