"""Bytes of tracks compared with array compressors at equal largest error.

    python bench/tracks.py --vertices 10000 --frames 150
    python bench/tracks.py samba.npz

Without a file: the tracks of `bench/heat_on_a_sphere.py`. With a file: velocities (differences
of positions) and normals of vertices. All are coded within 0.1 % of the range, normals within 0.5
degrees; `meshreel evaluate --track` describes the other codecs. Needs `pip install '.[peers]'`.
"""

import argparse
import runpy
from pathlib import Path
from typing import Any

import numpy as np

import meshreel
from meshreel.evaluation.track_peers import TRACK_PEERS
from meshreel.evaluation.tracks import TrackInput, level_of, track_runs, with_track_alone
from meshreel.model.geometry.normals import vertex_normals
from meshreel.runtime.progress import silent

SIMULATION = Path(__file__).with_name("heat_on_a_sphere.py")


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


def rows(sequence: meshreel.MeshSequence) -> list[list[Any]]:
    """For each track, bytes of our codec and the others at the same bound, and our seconds."""
    cells = []
    for name in sequence.tracks:
        source = TrackInput(with_track_alone(sequence, name), name)
        track = source.track
        level = level_of("0.5deg" if track.kind == "normal" else "0.1%", track)
        runs = track_runs(source, [level], TRACK_PEERS)
        figures = [run.measure(silent).figures for run in runs]
        ours, *others = figures
        sizes = [other["size_bytes"] for other in others]
        share = ours["size_bytes"] / min(sizes)
        seconds = [ours["seconds"][way] for way in ("encode", "decode")]
        cells.append([name, ours["positions_bytes"], ours["size_bytes"], *sizes, share, *seconds])
    return cells


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("inputs", nargs="*")
    parser.add_argument("--vertices", type=int, default=10_000)
    parser.add_argument("--frames", type=int, default=150)
    arguments = parser.parse_args()
    sequences = {path: derived(path) for path in arguments.inputs}
    if not sequences:
        simulate = runpy.run_path(str(SIMULATION))["simulate"]
        sequences = {"sphere": simulate(arguments.vertices, arguments.frames)}
    others = [peer.name for peer in TRACK_PEERS if peer.package.is_available]
    head = ["track", "positions", "bytes", *others, "of the best", "encoding, s", "decoding, s"]
    print("| " + " | ".join(head) + " |")
    print("|" + len(head) * "---|")
    for name, sequence in sequences.items():
        for row in rows(sequence):
            cells = [f"{cell:.2f}" if isinstance(cell, float) else str(cell) for cell in row]
            print("| " + " | ".join([f"{Path(name).stem}, {cells[0]}", *cells[1:]]) + " |")


if __name__ == "__main__":
    main()
