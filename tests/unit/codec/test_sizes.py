"""Sizes of streams of simulated sequences, which a change of the codec must not increase."""

import json
from pathlib import Path

import numpy as np
import pytest

import meshreel
from samples.captures import as_frames, capture
from samples.meshes import irregular_sequence, quad_sheet
from samples.rigs import bending_tube, boxes, turn
from samples.shapes import cube, torus

STORED = Path(__file__).with_name("sizes.json")
"""Bytes of each stream. PYTHONPATH=tests python tests/unit/codec/test_sizes.py replaces them."""

MAX_GROWTH = 0.003
"""Mean over all streams, so that each has the same weight."""

OPTIONS = {
    "q60": {"quality": 60},
    "q80": {},
    "0.01%": {"max_error": "0.01%"},
    "lossless": {"lossless": True},
}


def sequences():
    """Sequences of the kinds in the corpus, by name."""
    torus_vertices, torus_faces = torus(32, 64, bend=0.1)
    cube_vertices, cube_faces = cube()
    on_grid = np.round(torus_vertices * 1000) / 1000
    return {
        "cloth": meshreel.simulate_flag(40),
        "skinned": bending_tube(n_rings=48, n_around=20),
        "rigid parts": boxes([lambda t: turn(0.2 * t), lambda t: turn(-0.1 * t, 1)]),
        "remeshed": as_frames(capture(4)),
        "polygons with attributes": quad_sheet(),
        "irregular": irregular_sequence(),
        "single": meshreel.MeshSequence(torus_vertices[None].astype(np.float32), torus_faces),
        "single, decimal": meshreel.MeshSequence(on_grid[None].astype(np.float32), torus_faces),
        "tiny": meshreel.MeshSequence(cube_vertices[None].astype(np.float32), cube_faces),
    }


def sizes():
    """Bytes of each sequence, by options."""
    return {
        name: {key: len(meshreel.encode(one, **options)) for key, options in OPTIONS.items()}
        for name, one in sequences().items()
    }


@pytest.mark.every_case
def test_streams_do_not_grow():
    stored, found = json.loads(STORED.read_text(encoding="utf-8")), sizes()
    growth = {
        f"{name}, {key}": size / stored[name][key] - 1
        for name, row in found.items()
        for key, size in row.items()
    }
    grown = {name: f"{value:+.1%}" for name, value in growth.items() if value > MAX_GROWTH}
    assert np.mean(list(growth.values())) <= MAX_GROWTH, grown


if __name__ == "__main__":
    STORED.write_text(json.dumps(sizes(), indent=1) + "\n", encoding="utf-8")
