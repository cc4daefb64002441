"""Long sequences: pace, memory, random access, and bytes by the length of blocks at equal KG error.

    python bench/long_sequences.py jumping.npz --kinds loops,mixed,held --frames 10000
    python bench/long_sequences.py jumping.npz --frames 2000 --blocks 250,500,1000,2000

Sequences are made of a performance by `long_sources`: looped at changing speed; mixed (the upper
half of the body from another place, turned, slow, held); mostly held. With `--blocks` every length
is coded at two qualities, and its bytes (of connectivity and order nothing) are those at the KG
error of the first length at the first quality, on a line between logarithms. Without it the
encoder's own choice is measured, errors included.
"""

import argparse
import math
import resource
import time
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import meshreel
from long_sources import KINDS, LongSequence
from meshreel.codec.achieved import measure_stream
from meshreel.codec.reel_file import ReelFile
from speed_tables import table

QUALITIES = (80.0, 87.0)


@dataclass(frozen=True)
class Point:
    """A stream and what it was found to be.

    Attributes
    ----------
    data : bytes
    moving_bytes : int
        Of it without connectivity and order.
    kg_error_percent : float
    seconds, processor_s : float
        Of encoding, frames made included.
    """

    data: bytes
    moving_bytes: int
    kg_error_percent: float
    seconds: float
    processor_s: float


def measured(sequence: LongSequence, quality: float, **options: Any) -> Point:
    """A stream of a sequence, and its error."""
    start, processor_start = time.perf_counter(), time.process_time()
    data = meshreel.encode(sequence, quality=quality, **options)
    seconds = time.perf_counter() - start
    processor_s = time.process_time() - processor_start
    budget = meshreel.info(data).budget_bytes
    still = budget["order"] + budget["connectivity"]
    error = measure_stream(sequence, data, order="keep").kg_error_percent
    return Point(data, len(data) - still, error, seconds, processor_s)


def bytes_at(points: list[Point], kg_error_percent: float) -> float:
    """Bytes at an error, on the line through two points, in logarithms."""
    (first, second) = [
        (math.log(one.kg_error_percent), math.log(one.moving_bytes)) for one in points
    ]
    slope = (second[1] - first[1]) / (second[0] - first[0])
    return math.exp(first[1] + slope * (math.log(kg_error_percent) - first[0]))


def access_ms(data: bytes) -> tuple[float, float, float]:
    """Milliseconds to the first frame of a file, and to one of another block: mean and largest, but
    of the first, with which what serves all others is found."""
    start = time.perf_counter()
    reel = ReelFile(BytesIO(data))
    reel.read(0, 1)
    first, others = time.perf_counter() - start, []
    for number in reel.starts[1:-1]:
        start = time.perf_counter()
        reel.read(number, number + 1)
        others.append(time.perf_counter() - start)
    others = others[1:] or others or [first]
    return 1e3 * first, 1e3 * sum(others) / len(others), 1e3 * max(others)


def own_choice(sequence: LongSequence) -> list[str]:
    """A row of the table of the encoder's own choice."""
    point = measured(sequence, QUALITIES[0])
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    first, mean, largest = access_ms(point.data)
    info = meshreel.info(point.data)
    pace = sequence.n_frames / point.seconds
    of_processor = 1e3 * point.processor_s / sequence.n_frames
    return [
        f"{sequence.name}, {sequence.n_frames}",
        f"{len(info.block_frames)} of {max(info.block_frames)}",
        f"{max(info.n_modes)}",
        f"{pace:.0f}",
        f"{of_processor:.1f}",
        f"{memory_mb:.0f}",
        f"{first:.0f}; {mean:.0f}, {largest:.0f}",
        f"{len(point.data)}",
        f"{point.kg_error_percent:.3f}",
    ]


def by_length(sequence: LongSequence, lengths: list[int]) -> list[list[str]]:
    """Rows of the table of lengths of blocks."""
    rows: list[list[str]] = []
    error = 0.0
    for length in lengths:
        points = [measured(sequence, quality, block_frames=length) for quality in QUALITIES]
        error = error or points[0].kg_error_percent
        found = bytes_at(points, error)
        of_processor = 1e3 * points[0].processor_s / sequence.n_frames
        rows.append(
            [sequence.name, str(length), f"{error:.3f}", f"{found:.0f}", f"{of_processor:.1f}"]
        )
    return rows


def main() -> None:
    """Measure and print Markdown tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source", help="a performance, such as jumping.npz")
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--frames", type=int, default=10_000)
    parser.add_argument("--blocks", help="lengths of blocks to compare, such as 250,500")
    arguments = parser.parse_args()
    base = meshreel.load(arguments.source)
    sequences = [LongSequence(base, kind, arguments.frames) for kind in arguments.kinds.split(",")]
    if arguments.blocks:
        lengths = [int(one) for one in arguments.blocks.split(",")]
        rows = [row for one in sequences for row in by_length(one, lengths)]
        print(table(["sequence", "block", "KG %", "bytes", "processor ms a frame"], rows))
        return
    header = ["sequence", "blocks", "modes", "frames/s", "processor ms a frame", "peak MB",
              "ms to the first frame; another block: mean, largest",
              "bytes", "KG %"]  # fmt: skip
    print(table(header, [own_choice(one) for one in sequences]))


if __name__ == "__main__":
    main()
