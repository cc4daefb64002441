"""Sizes of a sequence as raw arrays, glTF with a morph target per frame, our glTF, and reel.

    python bench/gltf_sizes.py samba.npz jumping.npz --errors 0.5,0.1,0.05 --out sizes.json

Exporters write a morph target per frame: positions minus those of the first frame, as float32 or as
scaled int16; its weight is 1 in one frame and 0 in all others. gzip is the size of the compressed
file, as a web server sends it.
"""

import argparse
import gzip
import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt

import meshreel
from measuring import machine_text, print_table, store
from meshreel.formats.frames.frame_stream import SegmentedStream
from meshreel.formats.gltf.container import BufferWriter
from meshreel.formats.gltf.morphs import place_frames
from meshreel.formats.gltf.write import write_gltf
from meshreel.formats.options import WriteOptions
from meshreel.model.notes import Notes
from meshreel.studies.timing import timed_once

HEADER = [
    "name",
    "morph targets",
    "MB",
    "MB as gzip",
    "times smaller than raw",
    "largest error %",
    "s",
]


@dataclass(frozen=True)
class Size:
    """Size, error in percent of the diagonal of all frames, and writing time of a file."""

    name: str
    n_morphs: int
    size_bytes: int
    gzip_bytes: int
    error_percent: float
    seconds: float


def diagonal(sequence: meshreel.MeshSequence) -> float:
    """Diagonal of the bounding box of all frames."""
    return float(np.linalg.norm(sequence.extent.high - sequence.extent.low))


Written = tuple[int, bytes, float]
"""Number of morph targets, bytes of a file, and error in percent."""


def size_of(name: str, write: Callable[[], Written]) -> Size:
    """The size of a file, and the seconds to write it."""
    (n_morphs, data, error_percent), seconds = timed_once(write)
    packed = len(gzip.compress(data, 6))
    return Size(name, n_morphs, len(data), packed, error_percent, seconds.wall)


def morph_per_frame(sequence: meshreel.MeshSequence, dtype: npt.DTypeLike) -> Written:
    """The buffer of a file with a morph target for each frame but the first."""
    first, n_morphs = sequence.vertices[0], sequence.n_frames - 1
    moves = (sequence.vertices[1:] - first).astype(np.float64)
    base, error = first, 0.0
    if np.dtype(dtype).kind == "i":
        _, base, _ = place_frames(sequence.vertices, first.astype(np.float64))
        scales = np.maximum(np.abs(moves).max(axis=(1, 2), keepdims=True), 1e-30)
        rounded = np.rint(moves / scales * 32767)
        errors = np.linalg.norm(rounded / 32767 * scales - moves, axis=2)
        moves, error = rounded, 100 * float(errors.max()) / diagonal(sequence)
    buffer = BufferWriter()
    for values in (base, *moves.astype(dtype)):
        (view,) = buffer.add_vertices([values])
        buffer.vertex_accessor("POSITION", view, slice(0, len(values)))
    buffer.add_indices(sequence.faces.ravel())
    buffer.add_rows(np.arange(sequence.n_frames, dtype=np.float32)[:, np.newaxis], has_bounds=True)
    buffer.add_rows(np.eye(sequence.n_frames, n_morphs, -1), width=1)
    described = json.dumps([buffer.accessors, buffer.views]).encode()
    return n_morphs, b"".join([*buffer.pieces, described]), error


VARIANTS: dict[str, dict[str, Any]] = {
    "--no-compression": {"compression": False},
    "--no-normals": {"normals": False},
    "--normals": {"normals": True},
}
"""Options of our files besides their error, by their names in the table."""


def ours(
    sequence: meshreel.MeshSequence, folder: Path, max_error: float, variant: str = ""
) -> Size:
    """Write our file, and read error and number of morph targets from its notes."""
    notes = Notes()
    plain = meshreel.MeshSequence(sequence.vertices, sequence.faces, fps=25.0)
    stream = SegmentedStream(plain, notes=notes)
    options = WriteOptions(max_error=max_error, **VARIANTS.get(variant, {}))

    def write() -> Written:
        write_gltf(folder / "ours.glb", stream, options)
        words = next(note for note in notes if note.startswith("the largest error is")).split()
        n_morphs = int(words[words.index("morph") - 1])
        return n_morphs, (folder / "ours.glb").read_bytes(), float(words[4])

    return size_of(f"our .glb, at most {max_error:g} %, {variant}".removesuffix(", "), write)


def reel(sequence: meshreel.MeshSequence) -> Written:
    """A stream with default quality."""
    data = meshreel.encode(sequence)
    return 0, data, meshreel.compare(sequence, meshreel.decode(data)).max_error_percent


def measure(sequence: meshreel.MeshSequence, errors: list[float]) -> Iterator[Size]:
    """Yield the size of a sequence in every representation."""
    raw = sequence.vertices.tobytes() + sequence.faces.tobytes()
    yield size_of("raw arrays", lambda: (0, raw, 0.0))
    for name in ("float32", "int16"):
        write = partial(morph_per_frame, sequence, name)
        yield size_of(f"a morph target per frame, {name}", write)
    with TemporaryDirectory() as folder:
        for max_error in errors:
            yield ours(sequence, Path(folder), max_error)
        for variant in VARIANTS:
            yield ours(sequence, Path(folder), errors[0], variant)
    yield size_of(".reel, default quality", partial(reel, sequence))


def row(size: Size, raw_bytes: int) -> list[str]:
    """The cells of one representation."""
    return [
        size.name,
        str(size.n_morphs or ""),
        f"{size.size_bytes / 1e6:.3f}",
        f"{size.gzip_bytes / 1e6:.3f}",
        f"{raw_bytes / size.size_bytes:.1f}",
        f"{size.error_percent:.4f}",
        f"{size.seconds:.1f}",
    ]


def main() -> None:
    """Measure, print tables, and write JSON if requested."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--errors", default="0.1,0.5,0.05", help="percent; variants by the first")
    parser.add_argument("--out", type=Path, help="write the figures here as JSON")
    options, results = parser.parse_args(), []
    for file in options.files:
        sequence = meshreel.load(file)
        sizes = list(measure(sequence, [float(text) for text in options.errors.split(",")]))
        results.append({"sequence": sequence.name, "sizes": [asdict(size) for size in sizes]})
        print(f"**{sequence.name}**: {sequence.n_frames} frames of {sequence.n_verts} vertices. "
              f"{machine_text()}\n")  # fmt: skip
        print_table("", HEADER, (row(size, sizes[0].size_bytes) for size in sizes))
    store(options.out, results=results)


if __name__ == "__main__":
    main()
