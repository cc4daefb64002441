"""One small evaluation of codecs, from runs to the report."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import meshreel
from meshreel.codec.connectivity.coder import encode_connectivity
from meshreel.codec.method_names import METHOD_NAMES
from meshreel.evaluation.comparison import (
    ERRORS,
    CodecResults,
    bd_rate_parts,
    rate_table,
    refusals_of,
    seconds_table,
    shown_curves,
)
from meshreel.evaluation.draco import DRACO
from meshreel.evaluation.peers import ARRAY_PEERS
from meshreel.evaluation.positions import (
    arrange,
    compare_positions,
    measure_method,
    measure_peer,
    method_sweeps,
)
from meshreel.model.flag import simulate_flag
from meshreel.model.sequence import MeshSequence
from meshreel.paper.sweeps import option_sweeps
from meshreel.runtime.extras import Extra
from meshreel.runtime.progress import silent
from meshreel.studies.runs import Store, result_of
from meshreel.studies.study import evaluate

SWEEPS = {**option_sweeps(quick=True), **method_sweeps(quick=True)}
KG, STED, _ = ERRORS
[NPZ] = [peer for peer in ARRAY_PEERS if peer.name == "npz"]
MISSING = replace(
    NPZ, name="future", package=Extra("peers", "package_of_the_future", "package_of_the_future")
)


def fail(sequence, setting):
    raise RuntimeError("no memory of it")


BROKEN = replace(NPZ, name="broken", encode=fail)


def recorded(codec, rate, error):
    quality = {
        "kg_error_percent": error, "max_error_percent": 3 * error, "rms_error_percent": error,
    }  # fmt: skip
    sequence = {"name": "flag", "n_verts": 72, "n_frames": 8}
    seconds = {"encode": 1.0, "decode": 2.0}
    return {"sequence": sequence, "codec": f"{codec} (recorded)", "params": "q",
            "rate_bpvf": rate, "quality": quality, "seconds": seconds}  # fmt: skip


RECORDED = [
    recorded(codec, rate, 20 / rate) for codec in ("famc", "draco_9") for rate in (2.0, 8.0, 80.0)
]


def methods(*names):
    return {name: SWEEPS[name] for name in names}


@pytest.fixture(scope="module")
def small_flag():
    return simulate_flag(8, n_rows=8, n_columns=9)


@pytest.fixture(scope="module")
def evaluation(small_flag, tmp_path_factory):
    stray = RECORDED[0] | {"sequence": {"name": "flag", "n_verts": 72, "n_frames": 9}}
    peers = (DRACO, NPZ, MISSING, BROKEN)
    study = compare_positions(methods("pca-qp", "v2v"), peers, [*RECORDED, stray], quick=True)
    out = tmp_path_factory.mktemp("codecs")
    return evaluate(study, [small_flag], out, command="meshreel evaluate flag.npz")


@pytest.fixture(scope="module")
def results(evaluation):
    return evaluation.measured[0][0]


def test_rate_of_a_method_is_that_of_a_stream_without_order(small_flag):
    result = measure_method(small_flag, "v2v", {"n_modes": 4, "bits": 10}, silent)
    data = meshreel.encode(small_flag, "v2v", n_modes=4, bits=10, order="drop")
    assert result["size_bytes"] == len(data)
    assert result["rate_bpvf"] == pytest.approx(8 * len(data) / (72 * 8))
    kept = meshreel.decode(meshreel.encode(small_flag, "v2v", n_modes=4, bits=10))
    quality = meshreel.compare(small_flag, kept).as_dict()
    assert {name: quality[name] for name in result["quality"]} == pytest.approx(result["quality"])


@pytest.mark.parametrize("order", ["coded", "given"])
def test_rate_of_a_peer_without_faces_includes_our_connectivity(small_flag, order):
    def arrangement(name):
        actual = arrange(small_flag, name)
        return actual if name == order else replace(actual, size_bytes=10**6)

    result = measure_peer(small_flag, arrangement, NPZ, 0, silent)
    kept = "drop" if order == "coded" else "vertices"
    coded = encode_connectivity(small_flag.faces, 72, order=kept)
    places = coded.internal_to_given if order == "coded" else np.arange(72)
    alone = NPZ.encode(MeshSequence(small_flag.vertices[:, places], small_flag.faces), 0)
    n_connectivity = len(coded.payload) + len(coded.order_payload)
    assert result["vertex_order"] == order
    assert result["connectivity_bytes"] == n_connectivity
    assert result["size_bytes"] == len(alone) + n_connectivity
    assert result["quality"]["max_error_percent"] == 0


def test_stored_run_is_reused_unless_it_is_damaged(small_flag, tmp_path):
    store = Store.for_sequence(tmp_path, small_flag)
    runs = [
        compare_positions({}, [peer]).plan(small_flag)["measured"][0]
        for peer in (NPZ, replace(BROKEN, name="npz"))
    ]
    first = result_of(runs[0], store)
    assert result_of(runs[1], store) == first
    path = store.path("npz", "json")
    path.write_text(path.read_text()[:-20])
    assert result_of(runs[0], store)["size_bytes"] == first["size_bytes"]
    assert json.loads(path.read_text())["codec"] == "npz"


@pytest.mark.slow
def test_failure_of_a_package_is_reported(results):
    refused = [result for result in results.measured if "refused" in result]
    assert [result["codec"] for result in refused] == ["broken"]
    assert refusals_of(results) == (
        "`broken` has no figures for flag (its one setting): RuntimeError: no memory of it",
    )


def test_notes_name_package_and_extra_of_a_missing_peer(evaluation):
    (note,) = evaluation.notes
    assert "`future` was not measured: it needs the package package_of_the_future" in note
    assert "pip install 'meshreel[peers]'" in note
    assert note in evaluation.report.read_text(encoding="utf-8")


@pytest.mark.slow
def test_notes_mention_a_sequence_without_recorded_rows(small_flag, tmp_path):
    stray = RECORDED[0] | {"sequence": {"name": "flag", "n_verts": 71, "n_frames": 8}}
    study = compare_positions(methods("v2v"), (), [stray], quick=True)
    evaluation = evaluate(study, [small_flag], tmp_path)
    assert evaluation.notes == [
        "no recorded row matches flag with 72 vertices (n) and 8 frames (k)"
    ]


def test_curves_contain_methods_peers_and_matching_rows(results):
    labels = ["pca-qp", "v2v", "draco", "famc (recorded)", "draco_9 (recorded)"]
    assert list(results.curves(KG)) == labels
    assert list(results.curves(STED)) == labels[:3]
    assert list(shown_curves(results.curves(KG))) == labels[:4]


def test_bd_rate_table_has_a_row_for_each_comparable_codec(results):
    table = bd_rate_parts(results, KG)[0]
    assert table.header == ("codec", "pca-qp", "v2v")
    rows = {row[0]: row[1:] for row in table.rows}
    assert "%" in rows["famc (recorded)"][0]


def test_bd_rate_parts_list_codecs_without_a_common_error(results):
    far = [recorded("far", rate, 1e-9 / rate) for rate in (1.0, 2.0)]
    *_, paragraph = bd_rate_parts(replace(results, recorded=far), KG)
    assert "far (recorded)" in paragraph
    assert "(no common errors)" in paragraph


def test_rate_table_interpolates_between_points():
    points = [recorded("famc", rate, 0.4 / rate) for rate in (0.5, 1.0, 8.0)]
    table = rate_table(CodecResults("flag", {"name": "flag"}, [], points))
    assert table.rows == (("famc (recorded)", "0.8", "2", "4", "-", "-", "-"),)


def test_seconds_table_counts_the_settings_of_each_codec(results):
    assert [row[:2] for row in seconds_table(results).rows] == [
        ("pca-qp", "4"), ("v2v", "2"), ("draco", "2"), ("npz", "1"),
    ]  # fmt: skip


@pytest.mark.slow
def test_plots_are_not_blank(evaluation):
    pictures = evaluation.measured[0][1]
    assert len(pictures) == 3
    for picture in pictures:
        with Image.open(picture.path) as image:
            colors = image.convert("RGB").getcolors(maxcolors=1 << 24)
        assert len(colors) > 50


def test_report_contains_tables_and_the_command(evaluation):
    text = evaluation.report.read_text(encoding="utf-8")
    for part in ("meshreel evaluate flag.npz", "Bits per vertex and frame at equal error, flag",
                 "BD-rate at equal KG error", "Lossless, flag", "Seconds, flag"):  # fmt: skip
        assert part in text
    assert text.count("](figures/") == 3


def test_figures_are_serializable_and_finite(evaluation):
    figures = json.loads(json.dumps(evaluation.as_dict()))
    rates = [
        run["rate_bpvf"] for run in figures["sequences"][0]["measured"] if "refused" not in run
    ]
    assert len(rates) == 9
    assert all(math.isfinite(rate) and rate > 0 for rate in rates)


@pytest.mark.parametrize("method", METHOD_NAMES)
def test_settings_of_every_method_encode(method, small_flag):
    settings = SWEEPS[method](small_flag.n_frames, small_flag.n_verts)
    assert settings
    assert all(settings.count(options) == 1 for options in settings)
    decoded = meshreel.decode(meshreel.encode(small_flag, method, **settings[0]))
    assert np.isfinite(decoded.vertices).all()
