"""Bytes of tracks within a bound, against SZ3, zfp and pcodec on the same array.

    python bench/tracks.py --vertices 10000 --frames 150
    python bench/tracks.py samba.npz

Without a file: the tracks of `examples/heat_on_a_sphere.py`. Of a file: velocities (differences of
positions) and normals of the vertices. The bound of each number of the others is the largest error
of one that ours came to; pcodec gets numbers that are rounded to twice that. Needs `pysz`, `zfpy`
and `pcodec`.
"""

import argparse
import runpy
import time
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import zfpy
from pcodec import ChunkConfig, standalone
from pysz import szConfig, szErrorBoundMode
from pysz.sz import sz

import meshreel
from meshreel.geometry.normals import vertex_normals

Values = npt.NDArray[np.floating]
EXAMPLE = Path(__file__).parents[1] / "examples" / "heat_on_a_sphere.py"


def derived(path: str) -> meshreel.MeshSequence:
    """A sequence with its velocities and normals as tracks."""
    plain = meshreel.load(path)
    fps = plain.fps or 25.0
    vertices = np.asarray(plain.vertices, np.float32)
    velocity = np.gradient(vertices, axis=0) * np.float32(fps)
    normals = np.stack([vertex_normals(frame, plain.faces) for frame in vertices])
    tracks = {
        "velocity": meshreel.Track(velocity.astype(np.float32), kind="velocity"),
        "normal": meshreel.Track(normals.astype(np.float32), kind="normal"),
    }
    return meshreel.MeshSequence(vertices, plain.faces, fps, tracks=tracks)


def of_sz(values: Values, bound: float) -> int:
    """Bytes of SZ3."""
    config = szConfig(values.shape)
    config.errorBoundMode = szErrorBoundMode.ABS
    config.absErrorBound = bound
    coded, _ = sz.compress(np.ascontiguousarray(values), config)
    back, _ = sz.decompress(coded, values.dtype, values.shape)
    assert np.abs(back.astype(float) - values).max() <= bound * 1.001
    return int(coded.nbytes)


def of_zfp(values: Values, bound: float) -> int:
    """Bytes of zfp, with the largest tolerance that keeps the bound: its own is cautious."""
    tolerance, best = bound, None
    for _ in range(8):
        coded = zfpy.compress_numpy(np.ascontiguousarray(values), tolerance=tolerance)
        if np.abs(zfpy.decompress_numpy(coded).astype(float) - values).max() > bound:
            break
        best, tolerance = len(coded), 2 * tolerance
    assert best is not None
    return best


def of_pcodec(values: Values, bound: float) -> int:
    """Bytes of pcodec, of integers in steps of twice the bound; the differences over time."""
    steps = np.rint(values / (2 * bound)).astype(np.int32)
    steps = np.diff(steps, axis=0, prepend=0)
    return len(standalone.simple_compress(np.ascontiguousarray(steps.ravel()), ChunkConfig()))


def rows(sequence: meshreel.MeshSequence) -> list[list[Any]]:
    """Of each track: bytes of ours, of the others, and seconds."""
    names = list(sequence.tracks)
    without = len(meshreel.encode(sequence, tracks=dict.fromkeys(names, "drop")))
    found = [["positions, faces, order", without]]
    for name, track in sequence.tracks.items():
        others = {other: "drop" for other in names if other != name}
        began = time.perf_counter()
        data = meshreel.encode(sequence, tracks=others)
        encoded = time.perf_counter() - began
        size = meshreel.info(data).tracks[0].size_bytes
        began = time.perf_counter()
        back = meshreel.decode(data)
        decoded = time.perf_counter() - began
        apart = back.tracks[name].values.astype(float) - track.values
        bound = float(np.abs(apart).max())
        flat = track.values if track.shape[2] > 1 else track.values[..., 0]
        columns = [np.ascontiguousarray(track.values[..., c]) for c in range(track.shape[2])]
        sz3 = sum(of_sz(column, bound) for column in columns)
        zfp = sum(of_zfp(column, bound) for column in columns)
        pco = of_pcodec(flat, bound)
        best = min(sz3, zfp, pco)
        found.append([name, size, sz3, zfp, pco, size / best, encoded, decoded])
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("inputs", nargs="*")
    parser.add_argument("--vertices", type=int, default=10_000)
    parser.add_argument("--frames", type=int, default=150)
    arguments = parser.parse_args()
    sequences = {path: derived(path) for path in arguments.inputs}
    if not sequences:
        simulate = runpy.run_path(str(EXAMPLE))["simulate"]
        sequences = {"sphere": simulate(arguments.vertices, arguments.frames)}
    print("| track | bytes | SZ3 | zfp | pcodec | of the best | encoding, s | decoding, s |")
    print("|---|---|---|---|---|---|---|---|")
    for name, sequence in sequences.items():
        for row in rows(sequence):
            cells = [f"{one:.2f}" if isinstance(one, float) else str(one) for one in row]
            print("| " + " | ".join([f"{Path(name).stem}, {cells[0]}", *cells[1:]]) + " |")


if __name__ == "__main__":
    main()
