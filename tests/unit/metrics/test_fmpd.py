"""FMPD: the authors' results, a case by hand, and invariance."""

import numpy as np
import pytest

import meshreel
from meshreel import MeshSequence
from meshreel.errors import ConnectivityChangeError, InvalidInputError
from meshreel.metrics.fmpd import Roughness
from samples.meshes import irregular_sequence, octahedron_faces, torus_faces, waving_grid


def torus():
    """A closed mesh of 192 vertices."""
    u, v = np.meshgrid(np.arange(12) * np.pi / 6, np.arange(16) * np.pi / 8, indexing="ij")
    radius = 3 + np.cos(v)
    points = np.stack([radius * np.cos(u), radius * np.sin(u), np.sin(v)], axis=2)
    return MeshSequence(points.reshape(1, -1, 3), torus_faces(12, 16))


def sheet(rows=21, columns=17, n_frames=1):
    return waving_grid(n_frames, rows, columns, np.float64)


def distorted(sequence, amplitude):
    waves = amplitude * np.sin(50 * sequence.vertices[..., [1, 2, 0]])
    return sequence.replace(vertices=sequence.vertices + waves)


@pytest.mark.parametrize(
    ("original", "decoded", "expected"),
    [
        (torus(), distorted(torus(), 0.002), 0.0562105271910254),
        (sheet(), distorted(sheet(), 0.0005), 0.0109518963482358),
        (sheet(), sheet(11, 9), 0.0490952553701116),
    ],
    ids=["closed", "boundary", "other mesh"],
)
def test_results_are_those_of_the_authors_program(original, decoded, expected):
    """Expected values: Wang's MATLAB program, run by Octave 7.3."""
    assert meshreel.fmpd(original, decoded)[0] == pytest.approx(expected, rel=1e-9)


def test_roughness_of_a_flat_hexagon_by_hand():
    turns = np.arange(6) * np.pi / 3
    ring = np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1)
    points = np.concatenate([[[0.0, 0, 0]], ring])
    faces = np.array([[0, 1 + k, 1 + (k + 1) % 6] for k in range(6)], np.int32)
    roughness, areas = Roughness(faces, 7).of(points)
    # The center is flat; the boundary turns by pi/3. An edge to the center has twice the weight
    # of one along the boundary, so that the mean around a boundary vertex is pi/6.
    np.testing.assert_allclose(roughness, [np.pi / 3] + [np.pi / 6] * 6)
    np.testing.assert_allclose(areas, np.sqrt(3) / 4 * np.array([2] + [2 / 3] * 6))


@pytest.mark.parametrize("sequence", [sheet(n_frames=3), irregular_sequence(), torus()])
def test_equal_meshes_have_no_error(sequence):
    np.testing.assert_array_equal(meshreel.fmpd(sequence, sequence), 0)


def test_it_grows_with_noise_up_to_1_and_is_invariant_to_motion_and_size():
    original, errors = sheet(), []
    for amplitude in (0.0005, 0.002, 0.01, 0.3):
        decoded = distorted(original, amplitude)
        [error] = meshreel.fmpd(original, decoded)
        turned = decoded.replace(vertices=7 * decoded.vertices[..., [1, 2, 0]] + 3)
        assert meshreel.fmpd(original, turned)[0] == pytest.approx(error, rel=1e-9)
        errors.append(error)
    assert 0 < errors[0] < errors[1] < errors[2] < errors[3] == 1


def test_frames_are_measured_one_by_one():
    original = sheet(n_frames=4)
    decoded = distorted(original, 0.0005)
    values = meshreel.fmpd(original, decoded)
    assert values.shape == (4,)
    assert len(set(values)) == 4
    [third] = meshreel.fmpd(original.part(range(2, 3)), decoded.part(range(2, 3)))
    assert values[2] == third


def test_isolated_vertices_and_copies_change_nothing():
    original, decoded = torus(), distorted(torus(), 0.002)
    expected = meshreel.fmpd(original, decoded)
    n = original.n_verts

    def twice(sequence):
        moved = sequence.vertices + 9
        loose = np.full((1, 5, 3), 4.0)
        faces = np.concatenate([sequence.faces, sequence.faces + n])
        return MeshSequence(np.concatenate([sequence.vertices, moved, loose], axis=1), faces)

    np.testing.assert_allclose(meshreel.fmpd(twice(original), twice(decoded)), expected)


def test_degenerate_faces_give_numbers():
    faces = octahedron_faces()
    points = np.array([[[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]])
    folded = points.copy()
    folded[0, 4] = folded[0, 0]
    [value] = meshreel.fmpd(MeshSequence(points, faces), MeshSequence(folded, faces))
    assert 0 < value <= 1


def test_wrong_inputs_are_refused():
    with pytest.raises(InvalidInputError, match="2 frames and the decoded 3; FMPD compares equal"):
        meshreel.fmpd(waving_grid(2), waving_grid(3))
    flat = waving_grid(2)
    point = flat.replace(vertices=0 * flat.vertices)
    with pytest.raises(InvalidInputError, match="frame 0 of the decoded has no face with an area"):
        meshreel.fmpd(flat, point)
    changing = meshreel.concatenate([waving_grid(2), waving_grid(2, 4, 4)])
    with pytest.raises(ConnectivityChangeError, match="FMPD"):
        meshreel.fmpd(changing, changing)
