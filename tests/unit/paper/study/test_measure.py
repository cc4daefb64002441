from dataclasses import asdict

import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.evaluation.pipeline import evaluate
from meshreel.evaluation.runs.store import Store, result_of
from meshreel.model.flag import simulate_flag
from meshreel.paper.decoder import coded_blocks
from meshreel.paper.study import measure
from meshreel.paper.study.measure import (
    fixed_length_bits,
    paper_anchors_bpvf,
    paper_coefficients_bpvf,
    paper_count,
    paper_dictionary_bpvf_as_printed,
    paper_dictionary_bpvf_as_stored,
)
from meshreel.paper.study.study import PaperStudy
from meshreel.paper.sweeps import Setting
from samples.figures import coarse_figures
from samples.meshes import waving_grid

SETTING = Setting("pca-qp", 4, anchors=0.05)

N, K = 99, 12  # vertices and frames of the grid


@pytest.fixture
def calls(monkeypatch):
    """The options of every call of `encode` by the runs."""
    made = []

    def counted(sequence, **options):
        made.append(options)
        return meshreel.encode(sequence, **options)

    monkeypatch.setattr(measure, "encode", counted)
    return made


@pytest.fixture
def store(tmp_path):
    return Store.for_sequence(tmp_path, waving_grid())


def test_stored_result_is_not_encoded_again(store, calls):
    first = result_of(measure.variant_run(waving_grid(), SETTING), store)
    assert len(calls) == 2  # order kept, order dropped
    assert result_of(measure.variant_run(waving_grid(), SETTING), store) == first
    assert len(calls) == 2


@pytest.mark.slow
def test_second_evaluation_encodes_nothing(tmp_path, calls):
    flag = simulate_flag(4, n_rows=4, n_columns=5)
    texts = []
    for _ in range(2):
        with coarse_figures():
            made = evaluate(PaperStudy(["v2v"], quick=True), [flag], tmp_path)
        texts.append(made.html.read_text(encoding="utf-8"))
        calls.append("run")
    assert calls.index("run") > 0
    assert calls[calls.index("run") :] == ["run", "run"]
    assert texts[0] == texts[1]


def test_changed_content_is_encoded_again(tmp_path, calls):
    sequence = waving_grid()
    moved = meshreel.MeshSequence(sequence.vertices + 1, sequence.faces, 25.0, "grid")
    for each in (sequence, moved):
        result_of(measure.variant_run(each, SETTING), Store.for_sequence(tmp_path, each))
    assert len(calls) == 4


def test_changed_version_is_encoded_again(store, calls, monkeypatch):
    result_of(measure.variant_run(waving_grid(), SETTING), store)
    monkeypatch.setattr("meshreel.evaluation.runs.store.__version__", "99")
    result_of(measure.variant_run(waving_grid(), SETTING), store)
    assert len(calls) == 4


@pytest.mark.parametrize("text", ["", "{", "[1]", '{"identity": {}}', "\udcff"])
def test_damaged_result_is_encoded_again(store, calls, text):
    first = result_of(measure.variant_run(waving_grid(), SETTING), store)
    store.path(SETTING.key, "json").write_text(text, errors="surrogateescape")
    again = result_of(measure.variant_run(waving_grid(), SETTING), store)
    assert len(calls) == 4
    assert again["quality"] == first["quality"]


def test_missing_stream_is_encoded_again(store, calls):
    result_of(measure.variant_run(waving_grid(), SETTING), store)
    store.path(SETTING.key, "reel").unlink()
    result_of(measure.variant_run(waving_grid(), SETTING), store)
    assert len(calls) == 4


def test_result_agrees_with_its_stored_stream(store):
    sequence = waving_grid()
    result = result_of(measure.variant_run(sequence, SETTING, shown_frame=3), store)
    data = store.path(SETTING.key, "reel").read_bytes()
    smallest = meshreel.encode(sequence, **SETTING.options(), order="drop")
    decoded = meshreel.decode(data)
    assert result["rate_bpvf"] == 8 * len(data) / (12 * 99)
    assert result["rate_order_dropped_bpvf"] == 8 * len(smallest) / (12 * 99)
    assert result["quality"] == meshreel.compare(sequence, decoded).as_dict()
    np.testing.assert_array_equal(np.load(store.path(SETTING.key, "npy")), decoded.vertices[3])
    assert set(result["machine"]) >= {"cpu", "cores", "python", "numpy", "scipy"}


def test_refusal_of_a_method_is_stored_as_the_result(store, monkeypatch):
    def refuse(sequence, **options):
        raise InvalidInputError("too many vertices")

    monkeypatch.setattr(measure, "encode", refuse)
    result = result_of(measure.variant_run(waving_grid(), SETTING), store)
    assert result["refused"] == "too many vertices"
    assert store.find(SETTING.key, asdict(SETTING)) == result


def counted(setting):
    data = meshreel.encode(waving_grid(), **setting.options())
    stream = meshreel.info(data)
    return paper_count(setting, stream, coded_blocks(data)), stream


def test_count_with_one_dictionary_is_that_of_eq_13():
    count, stream = counted(Setting("pca-qp", 3, anchors=0.05))
    assert count["q"] == pytest.approx(8 * stream.budget_bytes["coefficients"] / 3 / (N * K))
    carried = stream.budget_bytes["anchors"] + stream.budget_bytes["anchor residuals"]
    assert count["q_a"] == pytest.approx(8 * carried / 3 / (N * K))
    assert count["q_a_printed"] == pytest.approx(16 * 5 / N)  # ceil(0.05 * 99) = 5 anchors
    assert count["q_d"] == count["q_d_as_stored"] == pytest.approx(16 * K / N)
    assert count["q_s"] == pytest.approx(count["q"] + count["q_a"] + count["q_d"])


@pytest.mark.parametrize("method", ["pca-q", "v2v"])
def test_count_of_methods_without_anchors_has_none(method):
    count, _ = counted(Setting(method, 3))
    assert count["q_a"] is None
    assert count["q_s"] == pytest.approx(count["q"] + count["q_d"])


def test_count_of_blocks_includes_every_dictionary():
    count, stream = counted(Setting("blocks", 3, anchors=0.05, block_frames=4))
    bits = 8 * stream.budget_bytes["basis"] / (3 * 3 * K)  # 3 axes, 3 modes, 12 frames in all
    assert count["dictionary_bits"] == pytest.approx(bits)
    assert count["q_d"] == pytest.approx(bits * 3**2 * 4**2 / (N * K))  # as printed: n_b^2
    assert count["q_d_as_stored"] == pytest.approx(bits * 3 * 4**2 / (N * K))


def test_count_has_no_dictionary_derived_from_connectivity():
    count, _ = counted(Setting("gft", 10, anchors=0.05))
    assert count["q_d"] is None
    assert count["q_s"] == pytest.approx(count["q"] + count["q_a"])


def test_fixed_length_is_bits_of_the_largest_integer_of_each_row():
    data = meshreel.encode(waving_grid(), "v2v", n_modes=3, bits=8)
    (block,) = coded_blocks(data)
    # A sign and the bits of the magnitude for each vertex of a row.
    each = [
        len(f"{max(abs(int(one)) for one in row):b}") + 1 if row.any() else 0
        for axis in block.coefficients.integers
        for row in axis
    ]
    assert fixed_length_bits([block]) == N * sum(each)
    assert max(each) == 8


def test_q_is_a_third_of_the_coefficients_of_all_axes():
    count, stream = counted(Setting("v2v", 3))
    bits = 8 * stream.budget_bytes["coefficients"]
    assert np.isclose(3 * count["q"] * N * K, bits)


def test_coefficients_rate_is_the_common_number_of_bits():
    # Eq. 13: q = bits n k / (n k).
    assert paper_coefficients_bpvf(6 * 9971 * 175, 9971, 175) == 6


def test_anchors_rate_of_one_percent_is_that_of_table_1():
    # Eq. 13: q_a = 16 * 100 k / (10002 k) = 0.15997, printed 0.1600 for Handstand.
    assert paper_anchors_bpvf(100, 10002) == pytest.approx(0.1600, abs=5e-5)


@pytest.mark.parametrize(("n_verts", "printed"), [(9971, 0.2808), (10002, 0.2799)])
def test_dictionary_rate_of_one_block_is_that_of_table_1(n_verts, printed):
    # Eq. 13 with n_b = 1, k_f = k = 175: 16 * 175 / n.
    assert paper_dictionary_bpvf_as_printed(1, 175, n_verts, 175) == pytest.approx(
        printed, abs=5e-5
    )


def test_printed_dictionary_rate_does_not_depend_on_blocks():
    # Eq. 13 prints n_b^2 k_f^2 = k^2 for 7 blocks of 25 frames.
    whole = paper_dictionary_bpvf_as_printed(1, 175, 9971, 175)
    assert paper_dictionary_bpvf_as_printed(7, 25, 9971, 175) == pytest.approx(whole, rel=1e-15)


def test_stored_dictionary_rate_falls_with_the_number_of_blocks():
    # 7 dictionaries of 25 x 25 hold a seventh of one of 175 x 175.
    whole = paper_dictionary_bpvf_as_stored(1, 175, 9971, 175)
    found = paper_dictionary_bpvf_as_stored(7, 25, 9971, 175)
    assert found == pytest.approx(whole / 7, rel=1e-15)


def test_printed_and_stored_dictionary_rates_of_one_block_agree():
    arguments = (1, 175, 10002, 175)
    assert paper_dictionary_bpvf_as_stored(*arguments) == paper_dictionary_bpvf_as_printed(
        *arguments
    )
