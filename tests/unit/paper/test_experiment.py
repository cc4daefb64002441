"""Experiments: the paper's variants with steps of one's own."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse

import meshreel
from meshreel import paper
from meshreel.errors import InvalidInputError
from meshreel.paper.experiment import ExperimentSeries
from samples.meshes import irregular_sequence, waving_grid

VARIANTS = {
    "pca-qp": {"n_modes": 4, "bits": 8, "anchors": 0.05},
    "pca-qs": {"n_modes": 4},
    "pca": {"n_modes": 3},
    "v2v": {"n_modes": 5},
    "blocks": {"n_modes": 3, "block_frames": 5},
    "gft": {"n_modes": 20},
}


@pytest.mark.every_case
@pytest.mark.parametrize("sequence", [waving_grid(), irregular_sequence()], ids=["grid", "odd"])
@pytest.mark.parametrize("method", VARIANTS)
def test_experiment_without_changes_is_the_variant(method, sequence):
    options = VARIANTS[method]
    data = meshreel.encode(sequence, method, order="drop", **options)
    result = paper.experiment(sequence, method, **options)
    given = np.argsort(result.stream.order)  # number of each decoded vertex
    np.testing.assert_array_equal(result.vertices[:, given], meshreel.decode(data).vertices)
    assert result.size_bytes == len(data)
    assert repr(result.rates) == repr(paper.rates(data))
    quality = meshreel.compare(sequence, sequence.replace(vertices=result.vertices))
    assert result.quality.as_dict() == quality.as_dict()
    read = paper.read(data)
    np.testing.assert_array_equal(np.sort(given[read.anchors]), result.stream.anchors)
    for block, other in zip(result.stream.blocks, read.blocks, strict=True):
        columns = np.arange(block.n_frames) if method == "gft" else given
        np.testing.assert_array_equal(block.coefficients[:, :, columns], other.coefficients)


def leading(matrices, previous):
    return paper.eigen_trajectories(paper.autocorrelation(matrices), 4)[1]


def test_own_laplacian_basis_and_anchors_replace_those_of_the_variant():
    sequence = waving_grid()
    usual = paper.experiment(sequence, n_modes=4, bits=8, laplacian="combinatorial")
    own = paper.experiment(
        sequence,
        bits=8,
        laplacian=lambda each: paper.uniform_laplacian(each.faces, each.n_verts),
        basis=leading,
        anchors=lambda each: usual.stream.anchors[::-1],
    )
    # Sums over vertices in another order may change entries of the dictionary by a step.
    np.testing.assert_allclose(own.vertices, usual.vertices, atol=1e-3)
    assert own.rates.stored.q_s == pytest.approx(usual.rates.stored.q_s, rel=0.01)
    np.testing.assert_array_equal(own.stream.laplacian.toarray(), usual.stream.laplacian.toarray())


def test_own_matrix_is_in_the_given_order_of_vertices():
    # Weights that differ by vertex number: the order of the stream would not fit them.
    sequence = irregular_sequence()
    weights = scipy.sparse.diags_array(np.arange(1.0, sequence.n_verts + 1))
    matrix = weights @ paper.uniform_laplacian(sequence.faces, sequence.n_verts)
    result = paper.experiment(sequence, n_modes=4, bits=16, laplacian=matrix)
    np.testing.assert_allclose(result.stream.laplacian.toarray(), matrix.toarray())
    assert result.quality.kg_error_percent < 2


def test_bases_of_blocks_may_have_any_size_and_see_the_previous_one():
    seen = []

    def growing(matrices, previous):
        seen.append(None if previous is None else previous.shape)
        n_modes = min(len(seen) + 1, matrices.shape[1])
        return paper.eigen_trajectories(paper.autocorrelation(matrices), n_modes)[1]

    result = paper.experiment(waving_grid(), "blocks", block_frames=4, basis=growing)
    assert [block.n_modes for block in result.stream.blocks] == [2, 3, 4]
    assert seen == [None, (3, 4, 2), (3, 4, 3)]
    assert not any(block.is_difference for block in result.stream.blocks)
    assert result.quality.kg_error_percent < 5


def harmonic(known):
    """Deltas of the surface that least squares spans between the anchors."""
    fields = paper.project(known.basis, known.anchor_positions)
    system = paper.ReconstructionSystem(known.laplacian, known.anchors)
    zeros = np.zeros((known.laplacian.shape[0], fields.shape[1]))
    return np.stack([(known.laplacian @ system.solve(zeros, axis.T)).T for axis in fields])


def test_residuals_of_a_predictor_have_the_steps_of_coefficients():
    options = {"n_modes": 4, "bits": 9, "anchors": 0.2}
    plain = paper.experiment(waving_grid(), **options)
    predicted = paper.experiment(waving_grid(), **options, predictor=harmonic)
    block, other = predicted.stream.blocks[0], plain.stream.blocks[0]
    np.testing.assert_array_equal(block.coefficient_steps, other.coefficient_steps)
    step = float(block.coefficient_steps[0])
    assert 0 < np.abs(block.coefficients - other.coefficients).max() <= step
    np.testing.assert_array_equal(predicted.stream.reconstruct(), predicted.vertices)
    assert repr(paper.rates(predicted.stream)) == repr(predicted.rates)


def test_perfect_prediction_takes_no_bits():
    plain = paper.experiment(waving_grid(), n_modes=4, bits=9)
    [block] = plain.stream.blocks
    perfect = paper.experiment(
        waving_grid(), n_modes=4, bits=9, predictor=lambda known: block.coefficients
    )
    assert perfect.rates.q_entropy == perfect.rates.eq13.q == 0
    np.testing.assert_array_equal(perfect.vertices, plain.vertices)


def test_predictor_sees_earlier_blocks():
    counts = []

    def last(known):
        counts.append(len(known.previous))
        shape = 3, known.basis.shape[2], len(known.faces) and known.laplacian.shape[0]
        return known.previous[-1].coefficients if known.previous else np.zeros(shape)

    paper.experiment(waving_grid(), "blocks", block_frames=4, n_modes=2, predictor=last)
    assert counts == [0, 1, 2]


def test_rates_of_replaced_arrays_follow_them():
    stream = paper.read(meshreel.encode(waving_grid(), "pca-qp", n_modes=4))
    [block] = stream.blocks
    fewer = replace(
        block,
        **{
            name: getattr(block, name)[..., :2] if name == "basis" else getattr(block, name)[:, :2]
            for name in ("basis", "coefficients", "anchor_coefficients")
        },
    )
    usual, changed = paper.rates(stream), paper.rates(replace(stream, blocks=(fewer,)))
    np.testing.assert_array_equal(changed.eq13.bits_per_row[0], usual.eq13.bits_per_row[0][:, :2])
    assert changed.stored.q < usual.stored.q


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"coefficients": 1.1}, "coefficients of the block at frame 0 are not multiples"),
        ({"coefficient_steps": np.ones(3, np.float32)}, "need 1 or 4 quantization steps; got 3"),
    ],
)
def test_rates_refuse_arrays_that_are_not_quantized(changes, words):
    stream = paper.read(meshreel.encode(waving_grid(), "pca-qp", n_modes=4))
    [block] = stream.blocks
    changed = {
        name: getattr(block, name) * value if name == "coefficients" else value
        for name, value in changes.items()
    }
    with pytest.raises(InvalidInputError, match=words):
        paper.rates(replace(stream, blocks=(replace(block, **changed),)))


def test_whole_dictionaries_count_their_stated_bits():
    options = {"block_frames": 4, "n_modes": 2}
    result = paper.experiment(waving_grid(), "blocks", **options, choices="dictionary=whole")
    assert result.rates.dictionary_bits == 16
    assert paper.experiment(waving_grid(), "blocks", **options).rates.dictionary_bits != 16


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"method": "reel"}, "not one of the paper's"),
        ({"order": "keep"}, "order has no effect"),
        ({"laplacian": np.eye(99)}, r"sparse matrix of shape \(99, 99\)"),
        ({"laplacian": scipy.sparse.eye_array(98).tocsr()}, r"got csr_array of shape \(98, 98\)"),
        ({"method": "v2v", "laplacian": scipy.sparse.eye_array(99)}, "codes no deltas"),
        ({"method": "gft", "basis": leading}, "without basis"),
        ({"method": "gft", "predictor": harmonic}, "without predictor"),
        ({"basis": leading, "n_modes": 4}, "n_modes has no effect"),
        ({"basis": lambda matrices, _: matrices[0]}, r"of shape \(3, 12, K\)"),
        ({"basis": lambda matrices, _: np.full((3, 12, 2), np.nan)}, "not finite"),
        ({"predictor": lambda known: np.zeros((3, 2, 2)), "n_modes": 4}, r"shape \(3, 4, 99\)"),
        ({"anchors": lambda _: [5, 5]}, "lists vertex 5 twice"),
    ],
)
def test_steps_without_effect_or_of_wrong_shape_are_refused(options, words):
    with pytest.raises(InvalidInputError, match=words):
        paper.experiment(waving_grid(), **options)


def test_errors_of_some_frames_are_those_of_these_frames():
    sequence = waving_grid()
    encoded = ExperimentSeries(sequence).run("blocks", VARIANTS["blocks"])
    whole, errors = encoded.measure(), encoded.errors_of([0, 7, 11])
    part = meshreel.compare(
        *(sequence.replace(vertices=each.vertices[[0, 7, 11]]) for each in (sequence, whole))
    )
    assert errors["kg_error_percent"] == pytest.approx(part.kg_error_percent, rel=1e-6)
    assert errors["nmsve_mean"] == pytest.approx(part.nmsve_mean, rel=1e-6)
    assert errors["sted"] == pytest.approx(part.sted, rel=1e-6)


def test_experiments_of_a_series_share_larger_graph_bases():
    series = ExperimentSeries(waving_grid())
    for n_modes in (12, 30, 20, 99, 5):
        shared = series.run("gft", {"n_modes": n_modes})
        alone = ExperimentSeries(waving_grid()).run("gft", {"n_modes": n_modes})
        assert shared.size_bytes == pytest.approx(alone.size_bytes, rel=0.02)
        assert shared.errors_of([0, 5]) == pytest.approx(alone.errors_of([0, 5]), rel=1e-3)
