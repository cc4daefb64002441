"""Rate-distortion sweeps that refine until their envelopes settle."""

import math

import pytest

from meshreel.errors import InvalidInputError
from meshreel.paper.study import rate_sweeps
from meshreel.paper.study.rate_sweeps import (
    Axis,
    axes_of,
    geometric,
    lower_hull,
    starts,
    swept,
    window_around,
)
from meshreel.paper.sweeps import COEFFICIENTS, METHOD_NAMES, Setting
from meshreel.studies.rate_distortion import error_at_equal_rate
from samples.paper_results import made_result, made_sequence

FRAMES, VERTS = 60, 2904


def modeled(setting, noise=0.0):
    """A result by a model: modes omit 1 / K of the motion, bits add noise of 2^-bits."""
    rate = 0.002 * setting.n_modes * (setting.bits + 1)
    omitted, rounding = 10 / setting.n_modes, 40 * 2.0**-setting.bits
    result = made_result(setting.method, rate=rate, error=math.hypot(omitted, rounding))
    return {**result, "identity": {"setting": vars(setting)}}


def sweep_of(measure=modeled, **options):
    [start] = starts(FRAMES, VERTS, ["v2v"])
    axes = axes_of(start, FRAMES, VERTS)
    return swept(start, axes, measure, window_around(measure(start)["rate_order_dropped_bpvf"]),
                 **options)  # fmt: skip


def test_sweep_finds_the_envelope_of_the_whole_lattice():
    sweep = sweep_of()
    [start] = starts(FRAMES, VERTS, ["v2v"])
    rows, bits = (axis.values for axis in axes_of(start, FRAMES, VERTS))
    everything = [modeled(Setting("v2v", n_modes, number)) for n_modes in rows for number in bits]
    low, high = sweep.window
    curves = [
        [
            (each["rate_order_dropped_bpvf"], each["quality"]["kg_error_percent"])
            for each in results
            if low <= each["rate_order_dropped_bpvf"] <= high
        ]
        for results in (sweep.results, everything)
    ]
    assert abs(error_at_equal_rate(*curves).percent) < 2
    assert sweep.moved_percent < 2
    assert 20 < len(sweep.results) < 0.6 * len(everything)


def test_sweep_that_starts_outside_the_window_reaches_it():
    [start] = starts(FRAMES, VERTS, ["v2v"])
    rate = modeled(start)["rate_order_dropped_bpvf"]
    sweep = swept(start, axes_of(start, FRAMES, VERTS), modeled, (rate / 16, rate / 4))
    rates = [each["rate_order_dropped_bpvf"] for each in sweep.results]
    assert min(rates) < rate / 15


def test_quick_sweep_measures_the_start_and_its_neighbors():
    sweep = sweep_of(is_quick=True)
    assert len(sweep.results) == 5  # two rows, two bits
    assert sweep.moved_percent is None


def test_sweep_that_does_not_settle_says_so(monkeypatch):
    monkeypatch.setattr(rate_sweeps, "MAX_POINTS", 12)
    sweep = sweep_of()
    assert sweep.moved_percent is None
    assert "(cut short)" in sweep.text
    assert len(sweep.results) < 30


def test_refused_points_are_kept_and_not_refined():
    def measure(setting):
        if setting.bits > 11:
            return {"refused": "too fine", "identity": {"setting": vars(setting)}}
        return modeled(setting)

    sweep = sweep_of(measure)
    assert any("refused" in each for each in sweep.results)
    assert max(each["identity"]["setting"]["bits"] for each in sweep.results) == 12


def test_streams_that_lose_the_shape_are_not_compared():
    def measure(setting):
        result = modeled(setting)
        if setting.n_modes < 10:  # components collapse: a large KG error, and no STED
            result["quality"] |= {"kg_error_percent": 52.0, "sted": 1e-3}
        return result

    sweep = sweep_of(measure)
    assert any(each["quality"]["kg_error_percent"] == 52 for each in sweep.results)
    results = made_sequence("x", sweep=sweep.results)
    assert min(error for _, error in results.points("STED")["v2v"]) > 1e-3


def test_all_methods_begin_at_the_settings_of_the_tables_on_the_same_axes():
    found = starts(FRAMES, VERTS, METHOD_NAMES)
    labels = [(start.method, start.choices) for start in found]
    assert ("pca-qp", COEFFICIENTS) in labels
    assert ("blocks", COEFFICIENTS) in labels
    names = {start.method: [axis.name for axis in axes_of(start, FRAMES, VERTS)] for start in found}
    assert names["v2v"] == ["n_modes", "bits"]
    assert names["gft"] == names["pca-qp"] == ["n_modes", "bits", "anchors"]
    assert names["blocks"] == ["n_modes", "bits", "anchors", "block_frames"]
    for start in found:
        for axis in axes_of(start, FRAMES, VERTS):
            assert getattr(start, axis.name) in axis.values


@pytest.mark.parametrize(
    ("start", "ratio", "low", "high", "values"),
    [
        (20, 2.0, 1, 60, (1, 2, 5, 10, 20, 40)),
        (0.01, 2.0, 0.004, 0.03, (0.005, 0.01, 0.02)),
        (3, 2**0.5, 1, 7, (1, 2, 3, 4, 6)),
    ],
)
def test_axes_are_geometric_around_the_start(start, ratio, low, high, values):
    assert geometric(start, ratio, low, high) == pytest.approx(values)


def test_neighbors_are_one_step_away():
    axis = Axis("bits", (6, 7, 8))
    assert [each.bits for each in axis.neighbors(Setting("v2v", bits=8))] == [7]
    assert [each.bits for each in axis.neighbors(Setting("v2v", bits=7))] == [6, 8]


def test_hull_omits_points_above_lines_between_others():
    points = [(1.0, 8.0), (2.0, 5.0), (4.0, 1.9), (8.0, 1.8), (16.0, 0.5)]
    assert lower_hull(points) == [(1.0, 8.0), (4.0, 1.9), (16.0, 0.5)]


def test_modes_never_exceed_the_frames_of_a_block():
    [start] = starts(FRAMES, VERTS, ["blocks"])[:1]
    seen = []

    def measure(setting):
        if setting.n_modes > setting.block_frames:
            raise InvalidInputError("more modes than frames")
        seen.append(setting)
        return modeled(setting)

    swept(start, axes_of(start, FRAMES, VERTS), measure, (0.0, math.inf))
    assert {each.block_frames for each in seen} > {start.block_frames}
