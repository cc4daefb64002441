"""Compare a `.reel` in a page with one Draco file per frame, as UVOL sends them.

    python bench/web_against_draco.py samba.npz --rounds 5 --out web.json

Both play alternately in the same page of a headless Chromium with software rendering; results are
medians. Build the package first (`npm run build` in `npm/`), and install `DracoPy` and
`playwright`.

The player of Draco files is bench/web_pages/draco_player.js. Like UVOL's, it decodes in four
workers of three.js's DRACOLoader, prefetches four seconds of files, and swaps geometries. It shows
the first frame as soon as it is decoded, while UVOL waits for four seconds of frames; on the slow
network its decoder is already loaded. Its files contain only positions; ours also provide normals.
Main-thread time and memory are measured with files in memory, and exclude the files.

Draco uses 11 bits, UVOL's default, and the smallest number of bits whose KG error does not exceed
that of a `.reel` with default quality; the second `.reel` has the largest error of the 11 bits.
"""

import argparse
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import DracoPy
import numpy as np

import meshreel
from measuring import machine_text, print_table, store
from web_browser import bundled, opened, page_files, served

UVOL_BITS = 11
LEVEL = 7
NETWORK_BITS_A_SECOND = 2e6
LATENCY_MS = 40
STILL_S = 5

FIGURES = {
    "first_ms": "first frame, ms from the bytes' arrival",
    "first_slow_s": "first frame over 2 Mbit/s, s",
    "pass_slow_s": "played to the end over 2 Mbit/s, s",
    "main_first_ms": "main thread, ms a frame, while it loads",
    "main_again_ms": "main thread, ms a frame, played again",
    "memory_mb": "memory of the page's process, MB",
    "gl_mb": "buffers and textures of WebGL, MB",
}


@dataclass(frozen=True)
class Way:
    """Files of a sequence, and their errors."""

    name: str
    kind: str
    files: dict[str, bytes]
    address: str
    max_error_percent: float
    kg_error_percent: float

    @property
    def size_bytes(self) -> int:
        """Bytes of all files."""
        return sum(map(len, self.files.values()))


def reel(sequence: meshreel.MeshSequence, name: str, address: str, **options: Any) -> Way:
    """A `.reel` of a sequence."""
    data = meshreel.encode(sequence, **options)
    errors = meshreel.compare(sequence, meshreel.decode(data))
    columns = (errors.max_error_percent, errors.kg_error_percent)
    return Way(name, "reel", {address: data}, address, *columns)


def draco(sequence: meshreel.MeshSequence, bits: int) -> Way:
    """A Draco file of each frame."""
    files, frames, address = {}, [], f"/{bits}/NUMBER.drc"
    options = {"quantization_bits": bits, "compression_level": LEVEL}
    for number, vertices in enumerate(sequence.vertices):
        data = DracoPy.encode(vertices, sequence.faces, **options)
        files[address.replace("NUMBER", str(number))] = data
        # Vertices are rounded to the same grid, and stay in order.
        kept = DracoPy.encode(vertices, sequence.faces, preserve_order=True, **options)
        frames.append(DracoPy.decode(kept).points)
    decoded = meshreel.MeshSequence(
        np.asarray(frames, np.float32), sequence.faces, fps=sequence.fps
    )
    errors = meshreel.compare(sequence, decoded)
    columns = (errors.max_error_percent, errors.kg_error_percent)
    return Way(f"Draco, {bits} bits", "draco", files, address, *columns)


def ways(sequence: meshreel.MeshSequence) -> list[Way]:
    """Pairs of a `.reel` and Draco files with similar errors."""
    usual = reel(sequence, ".reel, default quality", "/usual.reel")
    finest = draco(sequence, UVOL_BITS)
    bits, matched = UVOL_BITS, finest
    while (coarser := draco(sequence, bits - 1)).kg_error_percent <= usual.kg_error_percent:
        bits, matched = bits - 1, coarser
    percent = finest.max_error_percent
    fine = reel(sequence, f".reel, --max-error {percent:.3f}", "/fine.reel", max_error=percent)
    return [usual, matched, fine, finest]


def measure(url: str, way: Way, sequence: meshreel.MeshSequence) -> dict[str, float]:
    """Measure one round in fresh pages."""
    low, high = sequence.extent.low, sequence.extent.high
    described = {
        "kind": way.kind,
        "address": way.address,
        "nFrames": sequence.n_frames,
        "fps": sequence.fps,
        "center": ((low + high) / 2).tolist(),
        "size": float((high - low).max()),
    }
    with opened(url) as page:
        page.ask("prepare", described, 1)
        first_ms = page.ask("first")
    with opened(url) as page:
        page.ask("prepare", described, 0, way.kind == "draco")
        page.slow_network(NETWORK_BITS_A_SECOND, LATENCY_MS)
        first_slow_s = page.ask("first") / 1000
        pass_slow_s = first_slow_s + page.ask("pass")["seconds"]
    with opened(url) as page:
        page.ask("prepare", described, len(way.files))
        page.ask("still", 1)
        before_bytes, before_s = page.memory_bytes(), page.main_thread_s()
        page.ask("first")
        shown = page.ask("pass")["shown"]
        between_s = page.main_thread_s()
        shown_again = page.ask("pass")["shown"]
        after_s = page.main_thread_s()
        return {
            "first_ms": first_ms,
            "first_slow_s": first_slow_s,
            "pass_slow_s": pass_slow_s,
            "main_first_ms": 1000 * (between_s - before_s) / shown,
            "main_again_ms": 1000 * (after_s - between_s) / shown_again,
            "memory_mb": (page.memory_bytes() - before_bytes) / 1e6,
            "gl_mb": page.ask("glBytes") / 1e6,
            "shown": shown,
            "shown_again": shown_again,
        }


def still_ms(url: str, fps: float) -> float:
    """Milliseconds of the main thread per frame while a static picture is drawn."""
    with opened(url) as page:
        page.ask("still", 1)
        before_s = page.main_thread_s()
        page.ask("still", STILL_S)
        return 1000 * (page.main_thread_s() - before_s) / (STILL_S * fps)


def rows(columns: list[Way], medians: dict[str, dict[str, float]]) -> list[list[str]]:
    """A row for each quantity, a column for each way."""
    lines = [
        ["MB", *(f"{way.size_bytes / 1e6:.3f}" for way in columns)],
        ["largest error, % of the diagonal", *(f"{way.max_error_percent:.3f}" for way in columns)],
        ["KG error, %", *(f"{way.kg_error_percent:.3f}" for way in columns)],
    ]
    for key, title in FIGURES.items():
        lines.append([title, *(f"{medians[way.name][key]:.3g}" for way in columns)])
    return lines


def main() -> None:
    """Measure, print a table, and write JSON if requested."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--fps", type=float, default=25.0)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--out", type=Path, help="write the figures here as JSON")
    options = parser.parse_args()
    loaded = meshreel.load(options.file)
    sequence = meshreel.MeshSequence(loaded.vertices, loaded.faces, fps=options.fps)
    columns, rounds = ways(sequence), defaultdict(list)
    with TemporaryDirectory() as folder:
        files = page_files(bundled("against_draco.js", Path(folder)))
    for way in columns:
        files |= way.files
    with served(files) as server:
        url = f"{server}/index.html"
        still = median(still_ms(url, options.fps) for _ in range(3))
        for _ in range(options.rounds):
            for way in columns:
                rounds[way.name].append(measure(url, way, sequence))
                print(way.name, rounds[way.name][-1], flush=True)
    medians = {
        name: {key: median(run[key] for run in runs) for key in runs[0]}
        for name, runs in rounds.items()
    }
    print(f"\n**{options.file.stem}**: {sequence.n_frames} frames of {sequence.n_verts} vertices, "
          f"{options.fps:g} a second. Medians of {options.rounds} rounds. A still picture takes "
          f"{still:.2f} ms of the main thread in the time of a frame. "
          f"{machine_text()}\n")  # fmt: skip
    print_table("", ["", *(way.name for way in columns)], rows(columns, medians))
    store(options.out, still_ms=still, rounds=rounds)


if __name__ == "__main__":
    main()
