import numpy as np
import pytest

from meshreel.codec.bitstream.container import write_varint
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.method_names import METHOD_NAMES as CODED
from meshreel.codec.options import config_of
from meshreel.codec.paper_options import equal_blocks
from meshreel.errors import CorruptStreamError, InvalidInputError, TruncatedStreamError
from meshreel.kernel.integers import decode_integers, encode_integers
from meshreel.paper import blocks
from meshreel.paper.blocks import StoredBlock, _read_tracked_dictionary
from meshreel.paper.coded_values import Quantized
from meshreel.paper.sweeps import (
    COEFFICIENTS,
    METHOD_NAMES,
    PRESETS,
    Setting,
    TableSettings,
    alternatives,
    check_table,
    option_sweeps,
    row_settings,
    variants,
)
from meshreel.studies.plots import METHOD_COLORS


def quantized(*shape):
    integers = np.random.default_rng(8).integers(-900, 900, shape)
    return Quantized(integers, np.array([0.125], np.float32))


@pytest.mark.parametrize("anchors", [[3, 3], [5, 2], [0, 100], [-1, 4]])
def test_anchor_vertices_out_of_order_or_range_are_refused(anchors):
    with pytest.raises(CorruptStreamError, match="ascending"):
        blocks.read_anchor_vertices(blocks.write_anchor_vertices(np.array(anchors)), 100)


def test_too_many_anchor_vertices_are_refused():
    all_of_them = blocks.write_anchor_vertices(np.arange(4))
    assert blocks.read_anchor_vertices(all_of_them, 4).tolist() == [0, 1, 2, 3]
    with pytest.raises(CorruptStreamError, match="4 anchors are declared for 3 vertices"):
        blocks.read_anchor_vertices(all_of_them, 3)


@pytest.mark.parametrize(("order", "curve"), [(0, [0, 9, 0, -9]), (1, [7, 8, 7, 7]),
                                              (2, [50, 100, 150, 201])])  # fmt: skip
def test_curves_are_differenced_until_smallest(order, curve):
    rows = np.repeat(np.tile(curve, 40).cumsum() if order > 1 else np.tile(curve, 40), 3)
    rows = rows.reshape(-1, 3).T[:, None]
    payload = blocks.write_curves(Quantized(rows, np.ones(1, np.float32)))
    orders, *_ = decode_integers(payload[5:], [3, 160, 160, 160], [0, 1, 1, 1])
    assert orders.tolist() == [order] * 3


@pytest.mark.parametrize("order", [-1, 3])
def test_too_many_differences_are_refused(order):
    coded = encode_integers([np.full(3, order), *np.zeros((3, 5), np.int64)], [0, 1, 1, 1])
    payload = write_varint(1) + np.ones(1, "<f4").tobytes() + coded
    with pytest.raises(CorruptStreamError, match=r"outside 0\.\.2"):
        blocks.read_curves(payload, 1, 5)


def test_rows_of_similar_modes_share_a_table():
    rows = quantized(3, 8, 5).integers
    tables = [0, 1, 1, 2, 2, 2, 2, 3]
    payload = blocks.write_rows(Quantized(rows, np.ones(1, np.float32)))
    assert payload[5:] == encode_integers(list(rows.reshape(24, 5)), tables * 3)


def test_smooth_basis_takes_fewer_bytes():
    phase = np.linspace(0, 9, 300)
    smooth = np.rint(3000 * np.sin(phase + np.arange(12)[:, None])).astype(int)
    shuffled = np.random.default_rng(0).permuted(smooth, axis=1)
    sizes = [
        len(blocks.write_curves(Quantized(rows.reshape(3, 4, 300), np.ones(1, np.float32))))
        for rows in (smooth, shuffled)
    ]
    assert sizes[0] < 0.5 * sizes[1]


@pytest.mark.parametrize("step", [np.nan, np.inf, -1.0])
def test_invalid_step_is_refused(step):
    rows = Quantized(np.zeros((3, 1, 1), int), np.array([step], np.float32))
    with pytest.raises(CorruptStreamError, match="step"):
        blocks.read_rows(blocks.write_rows(rows), 1, 1)


def test_step_of_zero_rows_may_be_zero():
    rows = Quantized(np.zeros((3, 1, 1), int), np.zeros(1, np.float32))
    assert blocks.read_rows(blocks.write_rows(rows), 1, 1).steps.tolist() == [0]


def test_another_number_of_steps_than_rows_is_refused():
    rows = Quantized(np.zeros((3, 4, 1), int), np.ones(3, np.float32))
    with pytest.raises(CorruptStreamError, match="3 quantization steps are declared for 4 rows"):
        blocks.read_rows(blocks.write_rows(rows), 4, 1)


def test_truncated_steps_are_refused():
    with pytest.raises(TruncatedStreamError):
        blocks.read_rows(b"\1\0\0", 1, 1)


def test_unknown_kind_of_dictionary_is_refused():
    curves = blocks.write_curves(quantized(3, 2, 5))
    for kind, message in ((b"\2", "neither 0"), (b"", "neither 0"), (b"\1", "another shape")):
        stored = StoredBlock(0, 5, 2, {Section.BASIS: kind + curves if kind else b""})
        with pytest.raises(CorruptStreamError, match=message):
            _read_tracked_dictionary(stored, None)
    whole = StoredBlock(0, 5, 2, {Section.BASIS: b"\0" + curves})
    before = _read_tracked_dictionary(whole, None)
    after = StoredBlock(5, 5, 2, {Section.BASIS: b"\1" + curves})
    sums = _read_tracked_dictionary(after, before)
    np.testing.assert_array_equal(sums.integers, 2 * before.integers)


def test_variants_cover_every_method_of_the_paper():
    assert set(METHOD_NAMES) == set(CODED) - {"reel", "lossless", "grid"}
    assert set(CODED) <= set(METHOD_COLORS)


def test_different_settings_have_different_keys():
    settings = {*variants(175), *row_settings(175), *alternatives(175)}
    assert len({setting.key for setting in settings}) == len(settings)


@pytest.mark.parametrize(("n_frames", "expected"), [(175, 25), (48, 24), (26, 13), (12, 12)])
def test_blocks_are_of_equal_length(n_frames, expected):
    assert equal_blocks(n_frames) == expected
    assert config_of("blocks").frames_in_block(n_frames, 99, 4) == expected
    assert variants(n_frames, ["blocks"])[0].block_frames == expected


def test_number_of_modes_is_at_most_the_number_of_frames():
    modes = [s.n_modes for s in variants(12) if s.n_modes is not None]
    assert max(modes) == 12


def test_slow_methods_have_one_setting_and_others_all_modes_and_bits():
    counts = [
        {method: len(sweep(12, 99)) for method, sweep in option_sweeps(quick=quick).items()}
        for quick in (False, True)
    ]
    # 5, 10 and 12 modes remain with 12 frames; anchors as positions and as coefficients.
    assert counts[0] == {
        "pca": 3, "pca-q": 6, "v2v": 12, "pca-qs": 1, "pca-qp": 18, "blocks": 30, "gft": 1
    }  # fmt: skip
    assert all(0 < counts[1][method] < count or count == 1 for method, count in counts[0].items())


def test_options_omit_those_fixed_by_the_method():
    assert Setting("gft", None, anchors=0.01).options() == {
        "method": "gft",
        "bits": 8,
        "anchors": 0.01,
    }


def test_labels_in_a_table_are_unique():
    for result in (variants(175), alternatives(175), [*variants(175), *alternatives(175)]):
        assert len({setting.label for setting in result}) == len(result)


def test_rows_of_the_printed_preset_have_constant_bits():
    samba = {setting.method: setting for setting in variants(175, table=PRESETS["printed"])}
    printed = {"pca": 0.7289, "pca-q": 0.1827, "v2v": 0.4362, "blocks": 0.3057}
    for method, q in printed.items():
        one = samba[method]
        assert one.options()["allocation"] == "constant"
        assert one.bits * one.n_modes / (one.block_frames or 175) == pytest.approx(q, rel=0.05)
    assert "allocation" not in samba["gft"].options()


def test_alternatives_of_the_printed_preset_are_valid_options():
    for setting in alternatives(175, table=PRESETS["printed"]):
        config_of(**setting.options())


def test_keys_differ_by_allocation():
    keys = [variants(175, ["pca-q"], TableSettings(allocation=name))[0].key
            for name in ("energy", "constant")]  # fmt: skip
    assert len(set(keys)) == 2


def test_choices_of_a_table_reach_the_variants_that_take_them():
    table = TableSettings(choices=COEFFICIENTS)
    results = {
        variant.method: variant.options().get("choices") for variant in variants(175, table=table)
    }
    assert results["pca-qp"] == results["blocks"] == "anchor_values=coefficients"
    assert results["v2v"] is None
    assert results["pca"] is None
    # Labels omit settings that all streams share.
    assert {variant.label for variant in variants(175, table=table)} == {
        variant.label for variant in variants(175)
    }


@pytest.mark.every_case
def test_tables_without_a_suitable_method_are_refused():
    with pytest.raises(InvalidInputError, match="choice anchor_values has no effect on v2v"):
        check_table(TableSettings(choices=COEFFICIENTS), ["v2v"])
    with pytest.raises(InvalidInputError, match="bits"):
        check_table(TableSettings(bits=99), ["pca-qp"])
