import pytest

from meshreel.codec.methods import METHOD_NAMES as CODED
from meshreel.evaluation.paper.settings import (
    METHOD_NAMES,
    Setting,
    equal_blocks,
    row_settings,
    sweep,
    variants,
)
from meshreel.evaluation.plots.palette import METHOD_COLORS


def test_variants_cover_every_method_when_it_is_of_the_paper():
    assert set(METHOD_NAMES) == set(CODED) - {"reel", "lossless", "grid"}
    assert set(CODED) <= set(METHOD_COLORS)


def test_keys_differ_when_settings_differ():
    settings = {*variants(175), *row_settings(175), *sweep(175, 9971)}
    assert len({setting.key for setting in settings}) == len(settings)


@pytest.mark.parametrize(("n_frames", "expected"), [(175, 25), (48, 24), (26, 13), (12, 12)])
def test_blocks_are_of_equal_length_when_frames_are_shared_out(n_frames, expected):
    assert equal_blocks(n_frames) == expected


def test_modes_are_at_most_the_frames_when_the_sequence_is_short():
    modes = [s.n_modes for s in variants(12) if s.n_modes is not None]
    assert max(modes) == 12


def test_slow_methods_are_left_out_of_the_sweep():
    methods = [setting.method for setting in sweep(175, 9971)]
    assert "pca-qs" not in methods
    assert methods.count("gft") == 2
    assert "gft" not in {setting.method for setting in sweep(175, 9971, quick=True)}


def test_options_leave_out_what_the_method_decides():
    assert Setting("gft", None, anchors=0.01).options() == {
        "method": "gft",
        "bits": 8,
        "anchors": 0.01,
    }
