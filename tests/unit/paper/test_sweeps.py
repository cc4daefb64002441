import pytest

from meshreel.codec.methods import METHOD_NAMES as CODED
from meshreel.codec.options import config_of
from meshreel.errors import InvalidInputError
from meshreel.paper.sweeps import (
    COEFFICIENTS,
    METHOD_NAMES,
    PRESETS,
    Setting,
    TableSettings,
    alternatives,
    check_table,
    row_settings,
    sweep,
    variants,
)
from meshreel.paper.variants import equal_blocks
from meshreel.studies.plots import METHOD_COLORS


def test_variants_cover_every_method_of_the_paper():
    assert set(METHOD_NAMES) == set(CODED) - {"reel", "lossless", "grid"}
    assert set(CODED) <= set(METHOD_COLORS)


def test_different_settings_have_different_keys():
    settings = {*variants(175), *row_settings(175), *sweep(175, 9971), *alternatives(175)}
    assert len({setting.key for setting in settings}) == len(settings)


@pytest.mark.parametrize(("n_frames", "expected"), [(175, 25), (48, 24), (26, 13), (12, 12)])
def test_blocks_are_of_equal_length(n_frames, expected):
    assert equal_blocks(n_frames) == expected
    assert config_of("blocks").frames_in_block(n_frames, 99, 4) == expected
    assert variants(n_frames, ["blocks"])[0].block_frames == expected


def test_number_of_modes_is_at_most_the_number_of_frames():
    modes = [s.n_modes for s in variants(12) if s.n_modes is not None]
    assert max(modes) == 12


def test_slow_methods_are_omitted_from_the_sweep():
    methods = [setting.method for setting in sweep(175, 9971)]
    assert "pca-qs" not in methods
    assert methods.count("gft") == 2
    assert "gft" not in {setting.method for setting in sweep(175, 9971, quick=True)}


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
