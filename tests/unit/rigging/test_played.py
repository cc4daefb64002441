"""A written rig, played by an independent reader of the file, is within the bounds of its rig."""

import numpy as np
import pytest

import meshreel
from meshreel.formats.gltf.read import ERROR_BOUND
from meshreel.model.surface import Part, Surface
from samples.glb import Glb, largest_error_percent, nearest_trajectories
from samples.rigs import bending_tube, boxes, turn

TUBE, BULGING = bending_tube(), bending_tube(bulge=0.3)[:20]  # ends in another pose
UNEVEN_S = np.cumsum(np.where(np.arange(60) < 20, 0.1, 0.3))


def two_tubes():
    """Two bulging tubes side by side, as parts."""
    other = 0.7 * BULGING.vertices[::-1] + np.float32([3, 0, 0])
    parts = tuple(Part(name, BULGING.n_verts, len(BULGING.faces)) for name in ("left", "right"))
    return BULGING.replace(
        vertices=np.concatenate([BULGING.vertices, other], axis=1),
        faces=np.concatenate([BULGING.faces, BULGING.faces + BULGING.n_verts]),
        surface=Surface(parts=parts),
    )


def turning(angle):
    """A box at rest, and one that turns by an angle per frame."""
    return boxes([lambda frame: np.eye(3), lambda frame: turn(angle * frame)], n_frames=60)


def played(path, sequence):
    """Return the played vertices of a file, in the order of the sequence."""
    times_s = sequence.times.astype(np.float32).astype(np.float64)
    positions = Glb.read(path.read_bytes()).skinned(times_s)
    numbers = nearest_trajectories(sequence.vertices, positions)
    assert set(numbers) == set(range(sequence.n_verts))
    ordered = np.empty(sequence.vertices.shape)
    ordered[:, numbers] = positions
    return ordered


def kg_error_percent(sequence, positions):
    """Return the KG error by its definition."""
    vertices = sequence.vertices.astype(np.float64)
    deviations = vertices - vertices.mean(axis=1, keepdims=True)
    return 100 * np.linalg.norm(positions - vertices) / np.linalg.norm(deviations)


def mean_normal_angle_deg(sequence, positions):
    """Return the mean angle between normals of faces, by its definition."""
    normals = []
    for vertices in (sequence.vertices.astype(np.float64), positions):
        corners = vertices[:, sequence.faces]
        sides = np.diff(corners, axis=2)
        normals.append(np.cross(sides[:, :, 0], sides[:, :, 1]))
    lengths = np.linalg.norm(normals, axis=-1).prod(axis=0)
    cosines = np.einsum("tmc,tmc->tm", *normals) / lengths
    return np.degrees(np.arccos(np.clip(cosines, -1, 1))).mean()


CASES = {
    "KG error": (TUBE, {"kg": 0.03, "max_error": 50}, (5, 1), 10528),
    "largest error": (TUBE, {"kg": 5, "max_error": 0.05}, (2, 1), 7828),
    "correctives": (BULGING, {"rig": 2, "kg": 0.1, "max_error": 1}, (2, 4), 9684),
    "corrected largest error": (BULGING, {"rig": 2, "kg": 1, "max_error": 0.2}, (2, 2), 7996),
    "parts": (two_tubes(), {"rig": 4, "kg": 0.5, "max_error": 1}, (4, 4), 18472),
    "turns": (turning(0.3), {"max_error": 0.1}, (2, 0), 3880),
    "two frames": (turning(0.3)[:2], {"max_error": 0.1}, (2, 0), 3000),
    "uneven times": (turning(0.1).replace(times=UNEVEN_S), {"max_error": 0.1}, (2, 0), 3520),
}
"""Sequence, options, numbers of bones and of correctives, and bytes of the compressed file."""


@pytest.mark.every_case
@pytest.mark.parametrize("meshopt", [True, False])
@pytest.mark.parametrize("name", CASES)
def test_played_rig_meets_its_bounds(tmp_path, name, meshopt):
    sequence, options, counts, n_bytes = CASES[name]
    path, notes = tmp_path / "rig.glb", []
    options = {"rig": True, "kg": 0.5} | options
    meshreel.save(sequence, path, meshopt=meshopt, notes=notes, **options)
    glb = Glb.read(path.read_bytes())
    targets = glb.document["meshes"][0]["primitives"][0].get("targets", [])
    assert (len(glb.document["skins"][0]["joints"]), len(targets)) == counts
    assert path.stat().st_size <= 1.03 * n_bytes or not meshopt
    found = played(path, sequence)
    kg, largest = kg_error_percent(sequence, found), largest_error_percent(sequence, found)
    assert kg <= options["kg"]
    assert largest <= options["max_error"]
    angle = mean_normal_angle_deg(sequence, found)
    text = f"KG error {kg:.3g} %, largest error {largest:.3g} % of the diagonal, mean error of "
    assert any(f"{text}face normals {angle:.2g} degrees" in note for note in notes)
    stated = glb.document["asset"]["extras"][ERROR_BOUND]
    assert np.linalg.norm(found - sequence.vertices, axis=2).max() <= stated
    for node in glb.document["nodes"]:  # what a viewer shows while nothing plays
        if "skin" in node and (keys := glb.weights(node["name"])) is not None:
            weights = glb.document["meshes"][node["mesh"]]["weights"]
            np.testing.assert_array_equal(np.float32(weights), keys[1][0])
