"""The paper's variants against a second implementation: dense NumPy, on a tiny mesh.

What follows the imports is written from the paper alone and calls nothing of the package, so that
a mistake in either shows. Streams have fine steps where frames are compared: what remains is the
truncation to K modes, which both sides must do alike.
"""

import numpy as np
import pytest

import meshreel

N_FRAMES, ROWS, COLUMNS, N_MODES = 14, 5, 7, 3
ANCHORS = [0, 9, 20, 34]


def sheet():
    """A sheet with an irregular triangulation that bends in several ways at once."""
    rng = np.random.default_rng(5)
    y, x = np.divmod(np.arange(ROWS * COLUMNS), COLUMNS)
    t = np.arange(N_FRAMES)[:, None]
    z = np.sin(0.9 * x + 0.7 * t) + 0.4 * np.cos(0.8 * y - 0.45 * t) + 0.1 * np.sin(x * y + t)
    vertices = np.stack([x + 0.3 * np.sin(0.5 * t + y), y + 0.1 * z + 0 * t, z], axis=2)
    faces = []
    for row in range(ROWS - 1):
        for column in range(COLUMNS - 1):
            a = row * COLUMNS + column
            b, c, d = a + 1, a + COLUMNS, a + COLUMNS + 1
            faces += [[a, b, d], [a, d, c]] if rng.random() < 0.5 else [[a, b, c], [b, d, c]]
    return vertices + 0.02 * rng.normal(size=vertices.shape), np.array(faces)


VERTICES, FACES = sheet()
CORNER = VERTICES.min(axis=(0, 1))


def laplacian():
    """L with the rows of Eq. 3: a vertex less the mean of its neighbors."""
    n_verts = VERTICES.shape[1]
    adjacent = np.zeros((n_verts, n_verts))
    for a, b, c in FACES:
        adjacent[[a, b, b, c, c, a], [b, a, c, b, a, c]] = 1
    return np.eye(n_verts) - adjacent / adjacent.sum(axis=1, keepdims=True)


def centered():
    """Coordinate matrices A (Eq. 7), one for each axis, from the center of the bounding box."""
    center = CORNER / 2 + VERTICES.max(axis=(0, 1)) / 2
    return [VERTICES[:, :, axis] - center[axis] for axis in range(3)]


def leading(matrix, n_modes=N_MODES):
    """Leading eigenvectors of A A^T (Eqs. 5 and 7), by the singular vectors of A."""
    return np.linalg.svd(matrix, full_matrices=False)[0][:, :n_modes]


def solved(operator, deltas, anchors, values):
    """Least squares of Eq. 12, dense."""
    rows = np.eye(operator.shape[0])[anchors]
    stacked = np.concatenate([operator, rows])
    return np.linalg.lstsq(stacked, np.concatenate([deltas, values]), rcond=None)[0]


def expected(method, operator=None, values="positions"):
    """Frames (T, V, 3) less the center, without quantization."""
    operator = laplacian() if operator is None else operator
    results = []
    for matrix in centered():
        basis = leading(matrix)
        projected = basis @ basis.T @ matrix
        deltas = operator @ projected.T  # Eqs. 8 and 9 back on frames: L A^T U U^T
        if method == "v2v":
            results.append(projected)
        elif method in ("pca", "pca-q"):
            results.append((np.linalg.pinv(operator, rcond=1e-10) @ deltas).T)  # Eq. 11
        else:
            known = matrix if values == "positions" else projected
            results.append(solved(operator, deltas, ANCHORS, known[:, ANCHORS].T).T)
    return np.stack(results, axis=2)


def decoded(method, **options):
    """Frames of a stream, less the center."""
    sequence = meshreel.MeshSequence(VERTICES, FACES)
    data = meshreel.encode(sequence, method, n_modes=N_MODES, **options)
    center = CORNER / 2 + VERTICES.max(axis=(0, 1)) / 2
    return meshreel.decode(data).vertices - center


FINE = {"bits": 24}
FINE_DICTIONARY = {"dictionary_bits": 24, "anchor_bits": 24}


@pytest.mark.every_case
@pytest.mark.parametrize("method", ["pca-qp", "pca-qs"])
@pytest.mark.parametrize("values", ["positions", "coefficients"])
def test_frames_are_the_dense_solution_of_eq_12(method, values):
    choices = {**FINE_DICTIONARY, "anchor_values": values}
    result = decoded(method, anchors=ANCHORS, choices=choices, **FINE)
    np.testing.assert_allclose(result, expected(method, values=values), atol=2e-5)


@pytest.mark.every_case
@pytest.mark.parametrize("method", ["pca", "pca-q"])
def test_frames_are_the_pseudo_inverse_of_eq_11_up_to_translation(method):
    result = decoded(method, choices=FINE_DICTIONARY, **FINE)
    wanted = expected(method)
    result, wanted = (frames - frames.mean(axis=1, keepdims=True) for frames in (result, wanted))
    np.testing.assert_allclose(result, wanted, atol=2e-5)


def test_frames_of_v2v_are_the_projection():
    result = decoded("v2v", choices={"dictionary_bits": 24}, **FINE)
    np.testing.assert_allclose(result, expected("v2v"), atol=2e-5)


def test_uncentered_trajectories_are_those_of_eq_7_as_printed():
    """U of A A^T with the positions as given; deltas and anchors do not depend on the offset."""
    result = decoded(
        "pca-qp", anchors=ANCHORS, choices={**FINE_DICTIONARY, "centering": "none"}, **FINE
    )
    wanted = []
    for axis, matrix in enumerate(centered()):
        basis = leading(VERTICES[:, :, axis])
        deltas = laplacian() @ (basis @ basis.T @ matrix).T
        wanted.append(solved(laplacian(), deltas, ANCHORS, matrix[:, ANCHORS].T).T)
    np.testing.assert_allclose(result, np.stack(wanted, axis=2), atol=2e-5)
    assert np.abs(result - expected("pca-qp")).max() > 1e-3


def test_blocks_follow_algorithm_1_with_and_without_ritz_vectors():
    """Both span the same subspace: U[i] = QR(R[i] U[i-1]), repeated (Alg. 1)."""
    half = N_FRAMES // 2
    wanted = []
    for matrix in centered():
        basis = leading(matrix[:half])
        for _ in range(4):
            basis = np.linalg.qr(matrix[half:] @ matrix[half:].T @ basis).Q
        deltas = laplacian() @ (basis @ basis.T @ matrix[half:]).T
        wanted.append(solved(laplacian(), deltas, ANCHORS, matrix[half:, ANCHORS].T).T)
    for rotation in ("ritz", "none"):
        choices = {**FINE_DICTIONARY, "rotation": rotation}
        result = decoded("blocks", block_frames=half, anchors=ANCHORS, choices=choices, **FINE)
        np.testing.assert_allclose(result[half:], np.stack(wanted, axis=2), atol=5e-5)


def test_coarse_streams_have_the_error_of_dense_quantization():
    """8 bits: one step for all rows of all axes, of the largest coefficient (Eq. 10)."""
    sizes = VERTICES.max(axis=(0, 1)) - CORNER
    matrices = [matrix / np.linalg.norm(sizes) for matrix in centered()]
    bases = [leading(matrix) for matrix in matrices]
    rows = [
        basis.T @ (laplacian() @ matrix.T).T for basis, matrix in zip(bases, matrices, strict=True)
    ]
    step = np.abs(rows).max() / 127
    errors = []
    for basis, matrix, row in zip(bases, matrices, rows, strict=True):
        deltas = (basis @ (step * np.rint(row / step))).T
        errors.append(solved(laplacian(), deltas, ANCHORS, matrix[:, ANCHORS].T).T - matrix)
    frames = decoded("pca-qp", bits=8, anchors=ANCHORS, choices=FINE_DICTIONARY)
    result = np.stack([frames[:, :, axis] for axis in range(3)]) - centered()
    assert np.linalg.norm(result) / np.linalg.norm(sizes) == pytest.approx(
        np.linalg.norm(errors), rel=0.02
    )
