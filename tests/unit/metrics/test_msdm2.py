"""MSDM2: properties, and agreement with a plain traversal vertex by vertex."""

import numpy as np
import pytest

import meshreel
from meshreel.errors import ConnectivityChangeError, InvalidInputError
from meshreel.metrics.msdm2 import SCALES, Msdm2
from samples.meshes import grid_faces, irregular_sequence, waving_grid


def bumpy(amplitude, seed=0):
    """A fine sheet with bumps, so that neighborhoods reach beyond the first ring."""
    rng = np.random.default_rng(seed)
    grid = waving_grid(1, 41, 41)
    vertices = grid.vertices.astype(float) * 0.02
    vertices[..., 2] += amplitude * rng.normal(size=vertices.shape[:2])
    return grid.replace(vertices=vertices)


def neighbors_of(faces, n_verts):
    found = [set() for _ in range(n_verts)]
    for a, b, c in faces:
        for first, second in ((a, b), (b, c), (c, a)):
            found[first].add(second)
            found[second].add(first)
    return found


def clipped(center, radius, start, vector):
    """Whether a sphere clips a vector, and the share within."""
    offset = start - center
    a, b, c = vector @ vector, 2 * vector @ offset, offset @ offset - radius**2
    delta = b * b - 4 * a * c
    if a == 0 or delta < 0:
        return True, 1.0
    share = (-b + delta**0.5) / (2 * a)
    if share < 0:
        return True, 1.0
    if share >= 1:
        return False, 1.0
    return True, 0.01 if share < 1e-16 else share


def walked(points, neighbors, center, radius):
    """Edges of the neighborhood of a vertex: start, end, share, whether the end is a sample."""
    stack, seen, edges = [center], {center}, []
    while stack:
        start = stack.pop()
        for end in neighbors[start]:
            vector = points[end] - points[start]
            if start != center and vector @ (points[start] - points[center]) <= 0:
                continue
            is_clipped, share = clipped(points[center], radius, points[start], vector)
            is_sample = is_clipped or end not in seen
            if not is_clipped and end not in seen:
                seen.add(end)
                stack.append(end)
            edges.append((start, end, share, is_sample))
    return edges


def plain_curvature(points, faces, radius):
    neighbors, curvature = neighbors_of(faces, len(points)), np.zeros(len(points))
    normals = np.cross(points[faces[:, 1]] - points[faces[:, 0]],
                       points[faces[:, 2]] - points[faces[:, 0]])  # fmt: skip
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    left = {}
    for number, (a, b, c) in enumerate(faces):
        left |= {(a, b): number, (b, c): number, (c, a): number}
    for center in range(len(points)):
        tensor = np.zeros((3, 3))
        for start, end, share, _ in walked(points, neighbors, center, radius):
            if (start, end) in left and (end, start) in left:
                vector = points[end] - points[start]
                length = np.linalg.norm(vector)
                turn = np.cross(normals[left[start, end]], normals[left[end, start]])
                beta = np.arcsin(np.clip(turn @ vector / length, -1, 1))
                part = share * vector
                tensor += beta / (share * length) * np.outer(part, part)
        values = sorted(np.abs(np.linalg.eigvalsh(tensor / (np.pi * radius**2))))
        curvature[center] = (values[1] + values[2]) / 2
    return curvature


@pytest.mark.parametrize("scale", SCALES)
def test_curvature_equals_a_walk_from_each_vertex(scale):
    [frame], faces = bumpy(0.003).vertices, bumpy(0.003).faces
    size = np.ptp(frame, axis=0).max()
    radius = 5 * scale * size  # three rings
    measure = Msdm2(faces, faces)
    expected = plain_curvature(frame, faces, radius)
    np.testing.assert_allclose(measure._decoded.curvature(frame, radius), expected, rtol=1e-9)
    near = measure._decoded.within(frame, radius)
    neighbors = neighbors_of(faces, len(frame))
    for center in (0, 20, 840):
        mine = near.centers == center
        found = zip(near.starts[mine], near.ends[mine], near.is_sample[mine], strict=True)
        walk = list(walked(frame, neighbors, center, radius))
        assert sorted(pair[:2] for pair in found) == sorted(edge[:2] for edge in walk)
        assert near.is_sample[mine].sum() == sum(edge[3] for edge in walk)


def bowls():
    """A dense bowl and a rough one above it, so that all closest points are within faces."""
    y, x = np.mgrid[0:31, 0:121] / 120 - 0.5
    number = np.arange(x.size).reshape(x.shape)
    x, y = x + 0.0002 * np.sin(37 * number), y + 0.0002 * np.cos(53 * number)

    def bowl(x, y):
        return np.stack([x, y, 0.8 * x**2 + 0.6 * (y + 0.37) ** 2], axis=-1).reshape(1, -1, 3)

    original, decoded = bowl(x, y), bowl(0.97 * x, 0.97 * (y + 0.375) - 0.375)
    decoded[..., 2] += 0.003 + 0.0004 * np.sin(900 * decoded[..., 0]) * np.cos(
        700 * decoded[..., 1]
    )
    return [meshreel.MeshSequence(each, grid_faces(*x.shape)) for each in (original, decoded)]


def test_the_result_is_that_of_the_authors_implementation():
    """Expected: MEPP2 at commit d977d05, three scales, from decoded to original."""
    assert meshreel.msdm2(*bowls())[0] == pytest.approx(0.368560185987404, rel=1e-9)


def moved(sequence):
    """The sequence rotated, larger, elsewhere."""
    return sequence.replace(vertices=7 * sequence.vertices[..., [1, 2, 0]] + 3)


def test_it_is_invariant_to_position_and_size():
    bowl, rough = bowls()
    expected = meshreel.msdm2(bowl, rough)[0]
    assert meshreel.msdm2(moved(bowl), moved(rough))[0] == pytest.approx(expected, rel=1e-9)


def test_curvature_of_a_sphere_is_that_of_its_radius():
    sphere = meshreel.MeshSequence(*fine_sphere(0.5))
    measure = Msdm2(sphere.faces, sphere.faces)
    values = measure._original.curvature(sphere.vertices[0], 0.2)
    assert np.median(values) == pytest.approx(2.0, rel=0.15)


def fine_sphere(radius):
    """A sphere by latitude and longitude, outward faces."""
    n = 48
    v, u = np.meshgrid(np.linspace(0.02, np.pi - 0.02, n), np.arange(2 * n) * np.pi / n,
                       indexing="ij")  # fmt: skip
    points = np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], axis=2)
    i, j = np.meshgrid(np.arange(n - 1), np.arange(2 * n), indexing="ij")
    corner = i * 2 * n + j
    beside = i * 2 * n + (j + 1) % (2 * n)
    quads = np.stack([corner, corner + 2 * n, beside + 2 * n, beside], axis=2).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return radius * points.reshape(1, -1, 3), faces


@pytest.mark.parametrize("sequence", [waving_grid(3), irregular_sequence()], ids=["grid", "odd"])
def test_equal_meshes_have_no_error(sequence):
    assert meshreel.msdm2(sequence, sequence).max() == pytest.approx(0, abs=1e-7)


def test_it_grows_with_noise_and_moving_the_models_hardly_matters():
    smooth, errors = bumpy(0.0005), []
    for amplitude in (0.0001, 0.0005, 0.002):
        noisy = smooth.replace(vertices=smooth.vertices + bumpy(amplitude, 1).vertices
                               - bumpy(0.0, 1).vertices)  # fmt: skip
        [error] = meshreel.msdm2(smooth, noisy)
        # Rounding selects among the faces of closest points on edges and vertices.
        turned = meshreel.msdm2(moved(smooth), moved(noisy))[0]
        assert turned == pytest.approx(error, rel=2e-3)
        errors.append(error)
    assert 0 < errors[0] < errors[1] < errors[2] < 1


def test_meshes_may_differ_and_frames_are_evenly_spaced():
    fine, coarse = waving_grid(9, 21, 21), waving_grid(9, 11, 11)
    values = meshreel.msdm2(fine, coarse, n_frames=3)
    assert values.shape == (3,)
    assert (values > 0).all()
    single = meshreel.msdm2(*(each.replace(vertices=each.vertices[4:5]) for each in (fine, coarse)))
    assert values[1] == pytest.approx(single[0])


def test_a_point_and_a_degenerate_face_have_no_error():
    grid = waving_grid(1)
    point = grid.replace(vertices=0 * grid.vertices)
    assert meshreel.msdm2(grid, point)[0] == 0
    faces = np.concatenate([grid.faces, [[0, 0, 1], [5, 6, 5]]])
    odd = meshreel.MeshSequence(grid.vertices, faces)
    assert np.isfinite(meshreel.msdm2(odd, odd)).all()


def test_wrong_inputs_are_refused():
    with pytest.raises(InvalidInputError, match="equal numbers of frames"):
        meshreel.msdm2(waving_grid(2), waving_grid(3))
    with pytest.raises(InvalidInputError, match="n_frames must be at least 1; got 0"):
        meshreel.msdm2(waving_grid(2), waving_grid(2), n_frames=0)
    changing = meshreel.concatenate([waving_grid(2), waving_grid(2, 4, 4)])
    with pytest.raises(ConnectivityChangeError, match="MSDM2"):
        meshreel.msdm2(changing, changing)
