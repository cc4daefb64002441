"""Choices that the paper leaves open: effects, and invalid values."""

import numpy as np
import pytest

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.errors import InvalidInputError
from meshreel.paper.choices import PaperChoices, choices_of
from meshreel.paper.decoder import coded_blocks
from samples.meshes import irregular_sequence, kg_error_percent, waving_grid


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


def test_whole_dictionaries_decode_to_the_same_frames_as_differences():
    options = {"n_modes": 3, "block_frames": 10}
    sequence = waving_grid(34)
    difference = encode(sequence, "blocks", **options)
    whole = encode(sequence, "blocks", choices={"dictionary": "whole"}, **options)
    assert difference != whole
    np.testing.assert_array_equal(decode(difference).vertices, decode(whole).vertices)


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
