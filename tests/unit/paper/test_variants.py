"""Properties of the variants of the paper."""

import numpy as np
import pytest

import meshreel
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.codec.methods import METHOD_NAMES
from meshreel.codec.options import config_of
from meshreel.codec.subspace.pca import autocorrelation, eigen_trajectories
from meshreel.codec.subspace.trajectories import bounding_frame, to_matrices
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from meshreel.paper import graph_fourier, pipeline
from meshreel.paper.decoder import coded_blocks
from samples.meshes import irregular_sequence, kg_error_percent, waving_grid

NAMES = list(METHOD_NAMES)
OURS = ("reel", "lossless", "grid")


def fine(name, n_frames, n_verts):
    """Return options that keep all rows with fine steps."""
    if name == "reel":
        return {"step": 1e-7}
    if name == "lossless":
        return {}
    if name == "grid":
        return {"max_error": 1e-4}
    return {"n_modes": n_verts if name == "gft" else n_frames, "bits": 24}


def needed(name):
    """Return the required options of a method."""
    return {"max_error": 0.1} if name == "grid" else {}


@pytest.mark.parametrize("name", NAMES)
def test_vertices_in_any_order_round_trip_with_all_rows_and_fine_steps(name):
    grid = waving_grid(10, dtype=np.float64)
    shuffle = np.random.default_rng(3).permutation(grid.n_verts)
    sequence = MeshSequence(grid.vertices[:, np.argsort(shuffle)], shuffle[grid.faces])
    data = encode(sequence, name, **fine(name, 10, sequence.n_verts))
    assert info(data).method == name
    # Only the dictionary and the anchors are rounded, to 16 bits.
    assert kg_error_percent(sequence.vertices, decode(data).vertices) < 0.05


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("n_frames", [1, 7])
def test_irregular_mesh_round_trips_with_every_method(name, n_frames):
    sequence = irregular_sequence(n_frames)
    options = fine(name, min(n_frames, 3), sequence.n_verts)
    decoded = decode(encode(sequence, name, block_frames=3, **options))
    np.testing.assert_array_equal(decoded.faces, sequence.faces)
    assert kg_error_percent(sequence.vertices, decoded.vertices) < 0.5


def test_isolated_vertices_are_coded_like_others_by_reel():
    sequence = irregular_sequence(7)
    data = encode(sequence, step=1e-4, block_frames=3)
    assert "isolated vertices" not in info(data).budget_bytes
    error = np.linalg.norm(decode(data).vertices - sequence.vertices, axis=2)
    diagonal = np.linalg.norm(np.ptp(sequence.vertices, axis=(0, 1)))
    assert 0 < error[:, [0, -1]].max() < 1e-3 * diagonal


@pytest.mark.parametrize("name", NAMES)
def test_range_of_frames_equals_that_of_the_whole(name):
    data = encode(waving_grid(12), name, block_frames=5, **needed(name))
    part = decode(data, frames=slice(6, 9)).vertices
    np.testing.assert_allclose(part, decode(data).vertices[6:9], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in NAMES if name not in OURS])
def test_one_frame_equals_that_of_the_whole_bit_for_bit(name):
    grid = waving_grid(37, 9, 11, dtype=np.float64)
    noise = np.random.default_rng(8).normal(0, 0.01, grid.vertices.shape)
    data = encode(MeshSequence(grid.vertices + noise, grid.faces), name, block_frames=23)
    whole = decode(data).vertices
    assert whole.dtype == np.float64
    for frame in range(37):
        one = decode(data, frames=slice(frame, frame + 1)).vertices[0]
        np.testing.assert_array_equal(one, whole[frame])


def test_frames_do_not_depend_on_how_residuals_of_anchors_are_solved(monkeypatch):
    data = encode(waving_grid(24, dtype=np.float64), "blocks", n_modes=2, block_frames=8)
    by_anchor = decode(data).vertices
    monkeypatch.setattr(pipeline, "MAX_RESPONSES", 0)
    np.testing.assert_allclose(decode(data).vertices, by_anchor, atol=1e-9)


def test_single_block_equals_the_whole():
    sequence = waving_grid(12)
    blocks = decode(encode(sequence, "blocks", n_modes=6, block_frames=12))
    whole = decode(encode(sequence, "pca-qp", n_modes=6))
    np.testing.assert_array_equal(blocks.vertices, whole.vertices)


def test_tracked_dictionary_spans_the_leading_eigenvectors():
    sequence = waving_grid(40, dtype=np.float64)
    blocks = coded_blocks(encode(sequence, "blocks", n_modes=3, block_frames=10, n_iterations=30))
    matrices = to_matrices(sequence.vertices, bounding_frame(sequence.extent))
    _, direct = eigen_trajectories(autocorrelation(matrices[:, 30:]), 3)
    # Along z: along x and y the grid has no third mode.
    products = np.linalg.svd(blocks[3].basis.values[2] @ direct[2])[1]
    assert products.min() > 0.999


@pytest.mark.parametrize(("rotation", "is_diagonal"), [("ritz", True), ("none", False)])
def test_ritz_rotation_separates_columns_of_a_tracked_dictionary(rotation, is_diagonal):
    sequence, choices = waving_grid(20, dtype=np.float64), {"rotation": rotation}
    _, block = coded_blocks(encode(sequence, "blocks", n_modes=3, block_frames=10, choices=choices))
    matrices = to_matrices(sequence.vertices, bounding_frame(sequence.extent))
    columns = block.basis.values[2]
    products = columns @ autocorrelation(matrices[:, 10:])[2] @ columns.T
    coupling = np.abs(products - np.diag(np.diag(products))).max() / np.abs(products).max()
    assert (coupling < 1e-3) == is_diagonal


def test_differences_of_coherent_dictionaries_take_fewer_bytes():
    # Motion of full rank: columns beyond the rank would be rounding errors, of any size in bits.
    grid = waving_grid(10)
    frames = grid.vertices + np.random.default_rng(4).normal(scale=0.1, size=grid.vertices.shape)
    sequence = MeshSequence(np.concatenate([frames] * 4), grid.faces)
    options = {"n_modes": 5, "block_frames": 10, "bits": 6}
    tracked = info(encode(sequence, "blocks", **options)).budget_bytes["basis"]
    fresh = info(encode(sequence, "pca-qp", **options)).budget_bytes["basis"]
    assert tracked < 0.4 * fresh


def test_shorter_last_block_restarts_the_dictionary():
    sequence = waving_grid(23)
    data = encode(sequence, "blocks", n_modes=8, block_frames=10)
    assert info(data).block_frames == (10, 10, 3)
    assert info(data).n_modes == (8, 8, 3)
    assert kg_error_percent(sequence.vertices, decode(data).vertices) < 2


def test_pca_uses_16_bits_by_default():
    assert encode(waving_grid(), "pca") == encode(waving_grid(), "pca", bits=16)


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("method", "options", "words"),
    [
        ("blocks", {"n_modes": 11}, r"n_modes=11 exceeds the 10 frames of a block"),
        ("pca-qp", {"n_modes": 31, "block_frames": None}, "exceeds the 30 frames"),
        ("gft", {"n_modes": 100, "block_frames": None}, "exceeds the 99 graph frequencies"),
    ],
)
def test_more_modes_than_a_block_has_are_refused(method, options, words):
    with pytest.raises(InvalidInputError, match=words):
        encode(waving_grid(30), method, **{"block_frames": 10, **options})


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("printed", "own"),
    [("PCA", "pca"), ("PCA+q", "pca-q"), ("PCA+qs", "pca-qs"), ("PCA+qp", "pca-qp"),
     ("v2v", "v2v"), ("Blocks", "blocks"), ("per mesh", "gft"), ("per-mesh", "gft")],
)  # fmt: skip
def test_methods_are_understood_by_their_names_in_the_paper(printed, own):
    assert config_of(printed).method == own


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("letter", "words"),
    [("k_l", "n_modes"), ("n_c", "n_c / n"), ("n_b", "k / n_b"), ("t_max", "t_max - 1")],
)
def test_letters_of_the_paper_are_answered_with_our_option(letter, words):
    with pytest.raises(InvalidInputError, match=f"'{letter}' is unknown; .*{words}"):
        meshreel.encode(waving_grid(3), "blocks", **{letter: 2})


@pytest.mark.parametrize("options", [{}, {"block_frames": 5}])
def test_gft_encodes_any_chosen_number_of_frequencies(options, monkeypatch):
    grid, stages = waving_grid(9, 5, 6), []
    monkeypatch.setattr(graph_fourier, "MAX_WORK", 1)
    with pytest.raises(InvalidInputError, match="encode with n_modes"):
        encode(grid, "gft", **options)
    data = encode(
        grid, "gft", n_modes=30, progress=lambda stage, _: stages.append(stage), **options
    )
    assert set(info(data).n_modes) == {30}
    stated = next(stage for stage in stages if "(an estimate)" in stage)
    assert stages.index(stated) < stages.index("encoding")


def test_gft_with_all_frequencies_has_only_errors_of_rounding():
    grid = waving_grid(9, 12, 14)
    errors = [
        kg_error_percent(
            grid.vertices, decode(encode(grid, "gft", n_modes=n_modes, bits=16)).vertices
        )
        for n_modes in (9, 84, 168)
    ]
    assert errors[2] < 0.01
    assert errors[2] < 0.1 * errors[1] < 0.1 * errors[0]


def test_gft_refuses_frequencies_beyond_the_memory_limit(monkeypatch):
    monkeypatch.setattr(graph_fourier, "basis_bytes", lambda *_: 2**33 + 1)
    with pytest.raises(InvalidInputError, match=r"8\.59 GB are allowed; allow more with memory"):
        encode(waving_grid(2, 4, 4), "gft", n_modes=16)
