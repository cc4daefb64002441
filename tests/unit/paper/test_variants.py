"""Properties of the variants of the paper, and of choices that it leaves open."""

import numpy as np
import pytest

import meshreel
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.codec.method_names import METHOD_NAMES
from meshreel.codec.options import config_of
from meshreel.codec.subspace.pca import autocorrelation, eigen_trajectories
from meshreel.codec.subspace.trajectories import bounding_frame, to_matrices
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from meshreel.paper import graph_fourier, synthesis
from meshreel.paper.choices import PaperChoices, choices_of
from meshreel.paper.decoder import coded_blocks
from samples.meshes import irregular_sequence, kg_error_percent, waving_grid

NAMES = list(METHOD_NAMES)


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


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in NAMES if name != "reel"])
def test_one_frame_equals_that_of_the_whole_bit_for_bit(name):
    grid = waving_grid(37, 9, 11, dtype=np.float64)
    noise = np.random.default_rng(8).normal(0, 0.01, grid.vertices.shape)
    sequence = MeshSequence(grid.vertices + noise, grid.faces)
    data = encode(sequence, name, block_frames=23, **needed(name))
    whole = decode(data).vertices
    assert whole.dtype == np.float64
    for frame in range(37):
        one = decode(data, frames=slice(frame, frame + 1)).vertices[0]
        np.testing.assert_array_equal(one, whole[frame])


def test_frames_do_not_depend_on_how_residuals_of_anchors_are_solved(monkeypatch):
    data = encode(waving_grid(24, dtype=np.float64), "blocks", n_modes=2, block_frames=8)
    by_anchor = decode(data).vertices
    monkeypatch.setattr(synthesis, "MAX_RESPONSES", 0)
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
    monkeypatch.setattr(graph_fourier, "basis_bytes", lambda *_: 2**31 + 1)
    with pytest.raises(InvalidInputError, match=r"2\.15 GB are allowed; allow more with memory"):
        encode(waving_grid(2, 4, 4), "gft", n_modes=16)


def error(**options):
    sequence = waving_grid(20)
    options = {"method": "pca-qp", "n_modes": 2, "bits": 12, "anchors": 0.05} | options
    return kg_error_percent(sequence.vertices, decode(encode(sequence, **options)).vertices)


@pytest.mark.every_case
def test_choices_as_text_and_mapping_give_the_same_stream():
    given = "anchor-values=coefficients, dictionary-bits=12"
    assert choices_of(given) == PaperChoices(anchor_values="coefficients", dictionary_bits=12)
    assert choices_of({"anchor_set": "random", "anchor_seed": 3}).changed == {
        "anchor_set": "random",
        "anchor_seed": 3,
    }
    assert choices_of(None) == PaperChoices()


REFUSED = {
    "anchor_valeus=positions": "choice 'anchor_valeus' is unknown; did you mean 'anchor_values'?",
    "anchor-values=places": "choice anchor_values must be 'positions' or 'coefficients'",
    "dictionary-bits=25": r"choice dictionary_bits must be 2\.\.24; got 25",
    "anchor-seed=-1": r"choice anchor_seed must be 0\.\.9.*; got '-1'",
    "anchor-bits=": "choices are NAME=VALUE, separated by commas",
}


@pytest.mark.every_case
@pytest.mark.parametrize("text", REFUSED)
def test_invalid_choices_are_refused_with_a_message(text):
    with pytest.raises(InvalidInputError, match=REFUSED[text]):
        encode(waving_grid(3), "pca-qp", choices=text)


IDLE = {
    "v2v": {"centering": "none"},
    "pca": {"anchor_set": "random"},
    "pca-q": {"anchor_values": "coefficients"},
    "pca-qp": {"dictionary": "whole"},
    "pca-qs": {"anchor_seed": 4},
    "gft": {"dictionary_bits": 12},
}


@pytest.mark.every_case
@pytest.mark.parametrize("method", IDLE)
def test_choice_without_effect_is_an_error(method):
    with pytest.raises(InvalidInputError, match="has no effect"):
        encode(waving_grid(3), method, choices=IDLE[method])


def test_other_methods_refuse_choices():
    with pytest.raises(InvalidInputError, match="method reel does not take choices"):
        encode(waving_grid(3), choices={"anchor_bits": 12})


def test_random_anchors_follow_their_seed_and_reach_every_component():
    sequence = irregular_sequence()

    def stream(seed):
        choices = {"anchor_set": "random", "anchor_seed": seed}
        return encode(sequence, "pca-qp", n_modes=8, bits=24, anchors=0.3, choices=choices)

    assert stream(1) == stream(1) != stream(2)
    assert kg_error_percent(sequence.vertices, decode(stream(1)).vertices) < 0.5


def test_given_anchors_with_many_bits_are_nearly_exact():
    sequence = waving_grid(20)
    anchors = [5, 40, 98]
    choices = {"anchor_bits": 24}
    data = encode(sequence, "pca-qp", n_modes=1, bits=4, anchors=anchors, choices=choices)
    assert len(coded_blocks(data)[0].anchors.residuals.integers[0]) == 3
    errors = np.linalg.norm(decode(data).vertices - sequence.vertices, axis=2).mean(axis=0)
    # Anchors have weight 1, like the rows of L: not exact, but more accurate than other vertices.
    assert errors[anchors].max() < np.median(errors)


def test_given_anchors_that_do_not_fit_the_mesh_are_refused():
    with pytest.raises(InvalidInputError, match=r"anchors must be vertices 0\.\.37"):
        encode(irregular_sequence(), "pca-qp", anchors=[2, 99])


def test_whole_dictionaries_have_their_own_steps_and_decode_to_nearly_the_same_frames():
    options = {"n_modes": 3, "block_frames": 10}
    sequence = waving_grid(34)
    difference = encode(sequence, "blocks", **options)
    whole = encode(sequence, "blocks", choices={"dictionary": "whole"}, **options)
    assert difference != whole
    np.testing.assert_allclose(decode(difference).vertices, decode(whole).vertices, atol=2e-3)
    assert [block.basis.integers.max() for block in coded_blocks(whole)] == [2**15 - 1] * 4


def test_fewer_dictionary_bits_make_a_smaller_basis_and_a_larger_error():
    coarse = {"dictionary_bits": 6}
    sizes = [
        info(encode(waving_grid(20), "v2v", n_modes=6, choices=choices)).budget_bytes["basis"]
        for choices in (coarse, None)
    ]
    assert sizes[0] < 0.7 * sizes[1]
    # Six modes omit 0.01 %, so nearly the whole error is due to coarse entries of the basis.
    assert error(n_modes=6, choices=coarse) > 10 * error(n_modes=6)


def test_quantized_deltas_cost_bits_of_fine_coefficients_and_keep_the_error_of_coarse_deltas():
    sequence = waving_grid(20)
    coarse, fine, projected = (
        encode(sequence, "pca-q", n_modes=8, bits=bits, choices=choices)
        for bits, choices in ((5, None), (16, None), (5, {"quantize": "deltas"}))
    )
    sizes = [info(data).budget_bytes["coefficients"] for data in (coarse, projected)]
    assert sizes[0] < 0.7 * sizes[1]
    errors = [
        kg_error_percent(sequence.vertices, decode(data).vertices) for data in (projected, fine)
    ]
    assert errors[0] > 10 * errors[1]


@pytest.mark.every_case
@pytest.mark.parametrize("method", ["pca-qp", "pca-qs", "blocks", "pca"])
def test_frames_round_trip_with_cotangent_weights(method):
    sequence = irregular_sequence(7)
    options = {"n_modes": 7, "bits": 24, "laplacian": "cotangent"}
    data = encode(sequence, method, **options)
    assert info(data).budget_bytes["shape"] > 0
    assert kg_error_percent(sequence.vertices, decode(data).vertices) < 0.5


@pytest.mark.slow
@pytest.mark.every_case
@pytest.mark.parametrize(
    ("method", "names"),
    [
        *((method, "dictionary_bits anchor_bits") for method in ("pca-qp", "pca-qs", "blocks")),
        ("v2v", "dictionary_bits"),
        ("pca-q", "dictionary_bits"),
        ("gft", "anchor_bits"),
        ("pca-qp", "dictionary_bits anchor_bits anchor_values"),
        ("pca-qs", "dictionary_bits anchor_bits anchor_values"),
    ],
)
def test_first_rows_decode_to_what_encoding_them_alone_gives(method, names):
    """`decode(n_modes=)` is Eq. 10, and Eq. 12 for coefficients of anchors, with a smaller k_l."""
    sequence = waving_grid(20, dtype=np.float64)
    fine = {"dictionary_bits": 24, "anchor_bits": 24, "anchor_values": "coefficients"}
    choices = {name: fine[name] for name in names.split()}
    many, few = (
        encode(sequence, method, n_modes=n_modes, bits=20, choices=choices) for n_modes in (8, 3)
    )
    result = decode(many, n_modes=3).vertices
    np.testing.assert_allclose(result, decode(few).vertices, atol=2e-4)
    assert np.abs(result - decode(many).vertices).max() > 1e-3
