"""Searches on small sequences: which streams they measure, and what they store."""

import json

import pytest

import meshreel
from meshreel.runtime.progress import silent
from meshreel.studies.runs import Store, result_of
from questions import search
from questions.search import grid_points, measured, search_runs
from samples.meshes import kg_error_percent, waving_grid


@pytest.fixture
def small_grid(monkeypatch):
    """Few settings, so that searches take a second."""
    monkeypatch.setattr(search, "ROWS", (2, 4, 80))
    monkeypatch.setattr(search, "BIT_COUNTS", (7, 8))
    monkeypatch.setattr(search, "BLOCK_COUNTS", (1, 2, 3, 16))
    monkeypatch.setattr(search, "BLOCK_ROWS", (1, 2, 30))
    monkeypatch.setattr(search, "BLOCK_BIT_COUNTS", (8,))


def figures(sequence, name):
    return search_runs(sequence)[name].measure(silent).figures


@pytest.mark.parametrize("method", ["pca-qp", "blocks"])
def test_rate_is_that_of_a_stream_without_order(method):
    sequence = waving_grid(20)
    options = {"n_modes": 3, "bits": 8, "block_frames": 10}
    result = measured(sequence, meshreel.encode(sequence, method, **options))
    data = meshreel.encode(sequence, method, order="drop", **options)
    # The number of sections may take another byte.
    n_values = sequence.n_verts * sequence.n_frames
    assert abs(result["rate_bpvf"] * n_values / 8 - len(data)) <= 1


def test_errors_are_those_of_the_decoded_frames():
    sequence = waving_grid(20)
    data = meshreel.encode(sequence, "pca-qp", n_modes=3, bits=8)
    decoded = meshreel.decode(data)
    result = measured(sequence, data, ("kg_error_percent", "sted"))
    quality = meshreel.compare(sequence, decoded)
    assert result["kg_error_percent"] == pytest.approx(
        kg_error_percent(sequence.vertices, decoded.vertices)
    )
    assert result["sted"] == pytest.approx(quality.sted)


def test_grid_is_complete_while_errors_fall():
    points = grid_points((1, 2, 3), (5, 6), lambda modes, bits: {"sted": 1 / (modes * bits)})
    assert len(list(points)) == 6


def test_more_rows_are_omitted_after_a_step_without_gain():
    def point(modes, bits):
        return {"at": (modes, bits), "kg_error_percent": max(1 / modes, 0.5), "sted": None}

    points = grid_points((1, 2, 3, 4), (5,), point)
    assert [one["at"] for one in points] == [(1, 5), (2, 5), (3, 5)]


def test_more_bits_are_omitted_for_rows_after_a_step_without_gain():
    def point(modes, bits):
        # Bits beyond 6 help 9 rows only.
        return {"at": (modes, bits), "sted": 1 / (modes * (bits if modes > 8 else min(bits, 6)))}

    results = [one["at"] for one in grid_points((2, 9), (5, 6, 7, 8), point)]
    assert results == [(2, 5), (9, 5), (2, 6), (9, 6), (2, 7), (9, 7), (9, 8)]


def test_one_error_that_falls_keeps_the_search_going():
    def point(modes, bits):
        return {"kg_error_percent": 1.0, "sted": 1 / modes}

    assert len(list(grid_points((1, 2, 3, 4), (5,), point))) == 4


@pytest.mark.usefixtures("small_grid")
def test_rows_are_searched_up_to_the_number_of_frames():
    points = figures(waving_grid(12), "rows")["points"]
    assert {point["modes"] for point in points} == {2, 4, 12}
    assert {point["bits"] for point in points} == {7, 8}


@pytest.mark.slow
@pytest.mark.usefixtures("small_grid")
def test_blocks_have_equal_lengths_and_each_number_its_own_rows():
    result = figures(waving_grid(60), "blocks")
    rows = {}
    for one in result["points"]:
        rows.setdefault(one["blocks"], set()).add(one["modes"])
    assert sorted(rows) == [1, 2, 3, 16]
    assert max(rows[1]) == 30
    assert max(rows[16]) <= 4  # frames of a block
    assert result["usual_blocks"] == 3


@pytest.mark.usefixtures("small_grid")
def test_numbers_of_blocks_are_limited_by_frames():
    result = figures(waving_grid(2, 4, 4), "blocks")
    assert {one["blocks"] for one in result["points"]} == {1, 2}


@pytest.mark.slow
@pytest.mark.usefixtures("small_grid")
def test_stored_searches_are_reused(tmp_path, monkeypatch):
    sequence = waving_grid(6, 5, 5)
    store = Store.for_sequence(tmp_path, sequence)
    first = [result_of(run, store) for run in search_runs(sequence).values()]
    monkeypatch.setattr(search, "encode", None)
    again = [result_of(run, store) for run in search_runs(sequence).values()]
    assert first == again
    json.dumps(first, allow_nan=False)
