"""Lossless coders of numbers over time: `python bench/lossless.py FILE...`.

Prints bytes, ratio, and MB of values per processor second, for encoding and decoding: of whole
files (`meshreel.encode(sequence, lossless=True)`, which verifies its stream; for others the
positions, with the faces by zstd), of the positions, and of tracks derived from them. Uses the
packages pcodec, fpzip, blosc2 and zstandard; missing ones are listed and skipped.
"""

import argparse
import importlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import meshreel
from measuring import start_table
from meshreel.kernel.exact import decode_exact, encode_exact
from meshreel.kernel.mesh import Neighbors, neighbors
from meshreel.model.geometry.normals import vertex_normals
from meshreel.studies.timing import timed_once

Numbers = npt.NDArray[Any]
Coder = tuple[Callable[[Numbers], Any], Callable[[Any], Any]]
ZSTD_LEVEL = 19
BLOSC_LEVEL = 9


def ours(graph: Neighbors, shape: tuple[int, int, int], dtype: np.dtype[Any]) -> Coder:
    return (
        lambda values: encode_exact(values, graph),
        lambda data: decode_exact(data, shape, dtype, graph),
    )


def our_file(sequence: meshreel.MeshSequence) -> Coder:
    return (
        lambda _: meshreel.encode(sequence, lossless=True),
        lambda data: meshreel.decode(data).vertices,
    )


def peers(values: Numbers) -> Iterator[tuple[str, Coder]]:
    """Yield other coders; each decodes to an object with the original bytes."""
    zstd = importable("zstandard")
    if zstd:
        coder = zstd.ZstdCompressor(level=ZSTD_LEVEL)
        yield (
            f"zstd -{ZSTD_LEVEL}",
            (lambda v: coder.compress(v.tobytes()), zstd.ZstdDecompressor().decompress),
        )
    pcodec = importable("pcodec")
    if pcodec and values.dtype.itemsize > 1:
        simple, config = pcodec.standalone, pcodec.ChunkConfig(compression_level=12)
        yield (
            "pcodec",
            (
                lambda v: simple.simple_compress(v.ravel(), config),
                simple.simple_decompress,
            ),
        )
    fpzip = importable("fpzip")
    if fpzip and values.dtype.kind == "f":
        yield (
            "fpzip",
            (
                lambda v: fpzip.compress(np.ascontiguousarray(v.transpose(2, 0, 1)), order="C"),
                lambda data: np.ascontiguousarray(
                    fpzip.decompress(data, order="C")[0].transpose(1, 2, 0)
                ),
            ),
        )
    blosc = importable("blosc2")
    if blosc:
        for name, kind in (
            ("shuffle", blosc.Filter.SHUFFLE),
            ("bitshuffle", blosc.Filter.BITSHUFFLE),
        ):
            yield f"blosc2 {name}", blosc_coder(blosc, kind)


def blosc_coder(blosc: Any, kind: Any) -> Coder:
    def encode(values: Numbers) -> Any:
        return blosc.compress2(
            values,
            typesize=values.dtype.itemsize,
            codec=blosc.Codec.ZSTD,
            clevel=BLOSC_LEVEL,
            filters=[kind],
            nthreads=1,
        )

    return encode, lambda data: blosc.decompress2(data, nthreads=1)


def importable(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


def derived(sequence: meshreel.MeshSequence) -> Iterator[tuple[str, Numbers]]:
    """Yield positions and typical tracks of simulations."""
    positions = sequence.vertices
    n_frames, n_verts = positions.shape[:2]
    yield "positions", positions
    normals = [vertex_normals(frame, sequence.faces) for frame in positions]
    yield "normals", np.stack(normals).astype(np.float32)
    yield "velocities", np.gradient(positions, axis=0).astype(positions.dtype)
    ids = np.broadcast_to(np.arange(n_verts, dtype=np.int32) // 100, (n_frames, n_verts))
    yield "constant ids", np.ascontiguousarray(ids)[..., None]
    speed = np.linalg.norm(np.gradient(positions, axis=0), axis=2)
    zones = np.digitize(speed, np.quantile(speed[::8], [0.5, 0.9])).astype(np.int32)
    yield "zones of speed", zones[..., None]
    yield "mask", (positions[..., :1] > np.quantile(positions[::8, :, 0], 0.9)).astype(np.uint8)


def bytes_of_faces(faces: Numbers) -> int:
    """Bytes of the faces, which other coders compress with zstd."""
    coder = importable("zstandard").ZstdCompressor(level=ZSTD_LEVEL)
    return len(coder.compress(faces.tobytes()))


def measure(values: Numbers, coder: Coder) -> tuple[int, float, float]:
    """Bytes, and MB/s of encoding and decoding.

    Raises
    ------
    RuntimeError
        If decoded bytes differ.
    """
    data, encoding = timed_once(partial(coder[0], values))
    decoded, decoding = timed_once(partial(coder[1], data))
    decoded_bytes = decoded.tobytes() if isinstance(decoded, np.ndarray) else bytes(decoded)
    if decoded_bytes != values.tobytes():
        raise RuntimeError("decoded values differ from the original")
    size = values.nbytes / 1e6
    encode_s, decode_s = (max(seconds.processor, 1e-9) for seconds in (encoding, decoding))
    return len(data), size / encode_s, size / decode_s


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--positions", action="store_true", help="no derived tracks")
    parser.add_argument("--whole", action="store_true", help="only whole files")
    parser.add_argument("--frames", type=int, help="number of first frames; default: all")
    given = parser.parse_args()
    missing = [n for n in ("zstandard", "pcodec", "fpzip", "blosc2") if not importable(n)]
    if missing:
        print(f"not installed, skipped: {', '.join(missing)}")
    print_row = start_table("file", "values", "coder", "bytes", "ratio", "enc MB/s", "dec MB/s")

    def report(
        file: Path, values: str, coder: str, raw: int, size: int, encoded: float, decoded: float
    ) -> None:
        figures = str(size), f"{raw / size:.3f}", f"{encoded:.1f}", f"{decoded:.1f}"
        print_row(file.stem, values, coder, *figures)

    for file in given.files:
        sequence = meshreel.load(file)
        bare = meshreel.MeshSequence(sequence.vertices[: given.frames], sequence.faces)
        others = []
        if importable("zstandard"):
            n_face_bytes = bytes_of_faces(bare.faces)
            others = [(name, coder, n_face_bytes) for name, coder in peers(bare.vertices)]
        for coder_name, coder, n_extra in [("meshreel", our_file(bare), 0), *others]:
            size, *speeds = measure(bare.vertices, coder)
            report(file, "whole file", coder_name, bare.raw_size_bytes, size + n_extra, *speeds)
        if given.whole:
            continue
        graph = neighbors(sequence.faces, sequence.vertices.shape[1])
        for name, values in derived(sequence):
            values = np.ascontiguousarray(values)
            if given.frames:
                values = values[: given.frames]
            own = ours(graph, values.shape, values.dtype)
            for coder_name, coder in [("meshreel", own), *peers(values)]:
                report(file, name, coder_name, values.nbytes, *measure(values, coder))
            if given.positions:
                break


if __name__ == "__main__":
    main()
