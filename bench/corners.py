"""Bytes of corner tracks, coded per corner and with shared values.

    python bench/corners.py horse_gallop.npz --frames 48

Corner normals are averaged over vertices, or over faces connected by edges with small dihedral
angles; stretch (the change of face areas) jumps between charts, or is scaled per chart; and the
texture coordinates of charts move. All tracks are coded by modes only, within 0.1 % of the range,
normals within 0.5 degrees.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

import meshreel
from measuring import start_table
from meshreel.codec.options import config_of
from meshreel.codec.reel.encoding.shared_corners import shared_track
from meshreel.codec.reel.encoding.tracks import MAX_TRIALS, block_ranges, encode_track
from meshreel.codec.source import Source
from meshreel.codec.track_bounds import kept_bounds
from meshreel.kernel.order import opposite_sides
from meshreel.model.geometry.normals import face_normals

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

N_CHARTS = 12


def connected_corners(faces: Integers, normals: Floats, n_verts: int, max_deg: float) -> Integers:
    """Group corners of a vertex that are connected across edges with a smaller dihedral angle."""
    twins = opposite_sides(faces, n_verts)
    sides = np.flatnonzero(twins > np.arange(len(twins)))
    others = twins[sides]
    unit = _unit(normals)
    cosines = (unit[sides // 3] * unit[others // 3]).sum(axis=1)
    sides, others = (one[cosines > np.cos(np.radians(max_deg))] for one in (sides, others))
    ahead = np.arange(len(twins)).reshape(-1, 3)[:, [1, 2, 0]].reshape(-1)
    vertices = faces.reshape(-1)
    runs_back = vertices[sides] == vertices[ahead[others]]
    ends = [np.where(runs_back, ahead[others], others), np.where(runs_back, others, ahead[others])]
    pairs = np.concatenate([sides, ahead[sides]]), np.concatenate(ends)
    graph = coo_array((np.ones(len(pairs[0])), pairs), (len(twins), len(twins)))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def sums(groups: Integers, of_faces: Floats) -> Floats:
    """For each corner, the sum of face values of shape (T, M, C) over its group."""
    of_corners = np.repeat(of_faces, 3, axis=1)
    totals = np.zeros((len(of_faces), groups.max() + 1, of_faces.shape[2]))
    for frame, values in zip(totals, of_corners, strict=True):
        np.add.at(frame, groups, values)
    return totals[:, groups]


def tracks_of_corners(sequence: meshreel.MeshSequence) -> Iterator[tuple[str, meshreel.Track]]:
    """Yield names and tracks."""
    faces, vertices = sequence.faces.astype(np.int64), np.asarray(sequence.vertices, np.float64)
    normals = np.stack([face_normals(frame, sequence.faces) for frame in vertices])
    of_vertices = faces.reshape(-1)
    ways = {"no seams": of_vertices} | {
        f"creases from {deg} degrees": connected_corners(faces, normals[0], sequence.n_verts, deg)
        for deg in (40, 20)
    }
    for name, groups in ways.items():
        yield f"normals, {name}", _track(_unit(sums(groups, normals)), "normal")
    rng = np.random.default_rng(1)
    middles = vertices[0][faces].mean(axis=1)
    seeds = middles[rng.choice(len(middles), N_CHARTS, replace=False)]
    chart = np.repeat(((middles[:, None] - seeds) ** 2).sum(axis=2).argmin(axis=1), 3)
    areas = np.linalg.norm(normals, axis=2, keepdims=True)
    stretch = np.log(areas / areas.mean(axis=0) + 0.5)
    smooth = sums(of_vertices, stretch)
    offsets = rng.normal(size=(N_CHARTS, 1))[chart]
    by_chart = sums(of_vertices * N_CHARTS + chart, stretch)
    yield "stretch, jumps between charts", _track(by_chart + offsets)
    yield "stretch, multiplied in charts", _track(smooth * (1 + offsets))
    time = np.arange(len(vertices))[:, None, None] / 25
    flat = vertices[0][of_vertices, :2] + rng.random((N_CHARTS, 2))[chart]
    yield "flowing texture coordinates", _track(flat + [0.05, 0.02] * (time + smooth), "uv")


def sizes(sequence: meshreel.MeshSequence, track: meshreel.Track) -> list[int]:
    """Bytes of the track per corner, with shared values, and of the sharing itself."""
    bound = "0.5deg" if track.kind == "normal" else "0.1%"
    tracks, config = {"x": track}, config_of()
    whole = meshreel.MeshSequence(sequence.vertices, sequence.faces, 25, tracks=tracks)
    source = Source(whole, config, bounds=kept_bounds(config, tracks, {"x": bound}))
    shared = shared_track(track, source.mesh)
    assert shared is not None
    own_bytes, shared_bytes = (
        encode_track(
            "x", one, source.bounds["x"], source.mesh, block_ranges(source), MAX_TRIALS
        ).size_bytes
        for one in (track, shared)
    )
    return [own_bytes, shared_bytes + len(shared.rows), len(shared.rows)]


def _unit(vectors: Floats) -> Floats:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    unit: Floats = np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0)
    return unit


def _track(values: Any, kind: str | None = None) -> meshreel.Track:
    return meshreel.Track(values.astype(np.float32), "corner", kind)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("inputs", nargs="+")
    parser.add_argument("--frames", type=int, default=48)
    arguments = parser.parse_args()
    print_row = start_table("sequence", "track", "own", "shared", "rows", "share")
    for path in arguments.inputs:
        given = meshreel.load(path)
        vertices = np.asarray(given.vertices[: arguments.frames], np.float32)
        sequence = meshreel.MeshSequence(vertices, given.faces)
        for name, track in tracks_of_corners(sequence):
            own, shared, rows = sizes(sequence, track)
            counts = f"{own:,}", f"{shared:,}", f"{rows:,}"
            print_row(Path(path).stem, name, *counts, f"{shared / own:.2f}")


if __name__ == "__main__":
    main()
