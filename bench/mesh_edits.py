"""Bytes of sequences that lose faces in many places, as those of a solver that deletes elements.

    python bench/mesh_edits.py samba.npz cow.npz --shares 0.005 0.02 --frames 1 8

From each segment a further share of the faces disappears: all faces at random vertices, which are
dropped with them, so that the numbers of the other vertices shift in many places. Compares the
bytes with those of the same segments without edits.
"""

import argparse
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import meshreel
from measuring import start_table
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.mesh_edits import MeshEdits
from meshreel.codec.open_stream import OpenStream

N_SEGMENTS = 10


def eroded(sequence: Any, share: float, n_frames: int) -> meshreel.MeshSequence:
    """Return segments of some frames, each without a further share of the faces."""
    rng = np.random.default_rng(1)
    faces, segments = np.asarray(sequence.faces), []
    vertices, n_lost = rng.permutation(sequence.n_verts), round(share * len(faces))
    for start in range(0, min(N_SEGMENTS * n_frames, sequence.n_frames), n_frames):
        used, numbers = np.unique(faces, return_inverse=True)
        frames = sequence.read(start, start + n_frames)[:, used]
        own_faces: Any = numbers.reshape(-1, 3).astype(np.int32)
        segments.append(meshreel.MeshSequence(frames, own_faces, sequence.fps))
        n_left = len(faces) - n_lost
        while len(faces) > n_left:
            faces = faces[(faces != vertices[0]).all(axis=1)]
            vertices = vertices[1:]
    return meshreel.MeshSequence.of_segments(segments)


def main() -> None:
    """Print a table of bytes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sequences", nargs="+", type=Path)
    parser.add_argument("--shares", nargs="+", type=float, default=[0.005, 0.02])
    parser.add_argument("--frames", nargs="+", type=int, default=[1, 8], help="per segment")
    arguments = parser.parse_args()
    header = ["", "share", "frames", "segments", "edits", "bytes without edits", "bytes"]
    print_row = start_table(*header)
    for path in arguments.sequences:
        sequence = meshreel.load(path)
        for share in arguments.shares:
            for n_frames in arguments.frames:
                segments = eroded(sequence, share, n_frames)
                data = meshreel.encode(segments, order="keep")
                with patch.object(MeshEdits, "edit_to", lambda *_: None):
                    alone = len(meshreel.encode(segments, order="keep"))
                n_edits = sum(
                    any(
                        section.id == Section.EDIT
                        for section in OpenStream(data, segment=i).leading
                    )
                    for i in range(segments.n_segments)
                )
                counts = map(str, (n_frames, segments.n_segments, n_edits))
                print_row(path.stem, f"{share:.1%}", *counts, f"{alone:,}", f"{len(data):,}")


if __name__ == "__main__":
    main()
