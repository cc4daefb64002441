"""One small evaluation of tracks, from runs to the report."""

import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.evaluation.comparison import refusals_of, runs_table
from meshreel.evaluation.peers import Package, TrackPeer
from meshreel.evaluation.tracks import (
    CLOSE_ENOUGH,
    coarsest_tolerance,
    compare_track,
    level_of,
    levels_of,
    size_table,
    with_track_alone,
)
from meshreel.studies.study import evaluate


def encode_steps(values, tolerance):
    steps = np.rint(values / tolerance).astype(np.int16)
    return np.float64(tolerance).tobytes() + steps.tobytes()


def decode_steps(data, shape, dtype):
    steps = np.frombuffer(data[8:], np.int16).reshape(shape)
    return (steps * np.frombuffer(data[:8])[0]).astype(dtype)


STEPS = TrackPeer(
    name="steps", summary="steps of the tolerance", package=Package(name=None),
    encode=encode_steps, decode=decode_steps, is_reversible=False,
)  # fmt: skip
"""Numbers quantized by the tolerance, with an error of half of it."""

WORSE = replace(
    STEPS, name="worse", is_reversible=True, encode=lambda values, tolerance: b"?",
    decode=lambda data, shape, dtype: np.full(shape, 1e6, dtype),
)  # fmt: skip
MISSING = replace(STEPS, name="future", package=Package(name="package_of_the_future"))


@pytest.fixture(scope="module")
def waving():
    flag = meshreel.simulate_flag(12, n_rows=8, n_columns=9)
    at = flag.vertices.astype(float)
    tracks = {
        "height": meshreel.Track(at[..., 1].astype(np.float32), unit="m"),
        "speed": meshreel.Track(np.gradient(at, axis=0).astype(np.float32), kind="velocity"),
        "flags": meshreel.Track((at[..., 1] > 0).astype(np.uint8)),
    }
    return meshreel.MeshSequence(flag.vertices, flag.faces, 25, "flag", tracks=tracks)


@pytest.fixture(scope="module")
def evaluation(waving, tmp_path_factory):
    out = tmp_path_factory.mktemp("track")
    study = compare_track("height", (STEPS, WORSE, MISSING), quick=True)
    return evaluate(study, [waving], out, command="meshreel evaluate flag.npz --track height")


@pytest.fixture(scope="module")
def results(evaluation):
    return evaluation.measured[0][0]


@pytest.mark.slow
def test_result_of_reel_is_that_of_the_track_in_a_stream(waving, results):
    (result,) = [
        run for run in results.measured if run["codec"] == "reel" and run["params"] == "0.1%"
    ]
    data = meshreel.encode(with_track_alone(waving, "height"), tracks={"height": "0.1%"})
    (track,) = meshreel.info(data).tracks
    assert result["size_bytes"] == track.size_bytes
    assert (
        result["quality"]["largest_error"]
        == meshreel.compare(waving, data).tracks["height"].largest
    )
    plain = meshreel.encode(with_track_alone(waving, "height"), tracks={"height": "drop"})
    assert results.about["positions_bytes"] == len(plain)


def test_errors_are_within_their_limit_and_close_to_it(waving, results):
    span = np.ptp(waving.tracks["height"].values)
    for run in results.measured:
        if "refused" in run or run["params"] == "exact":
            continue
        limit = float(run["params"].rstrip("%")) / 100 * span
        assert run["limit"] == pytest.approx(limit)
        assert run["quality"]["largest_error"] <= run["limit"]
        if run["codec"] == "steps":
            assert run["quality"]["largest_error"] >= CLOSE_ENOUGH * 0.9 * limit
            assert run["tolerance"] > 1.5 * limit


def test_refusals_state_why_a_codec_keeps_no_bound(results):
    lines = refusals_of(results)
    assert len(lines) == 5
    assert any("`worse`" in line and "no tolerance keeps errors" in line for line in lines)
    assert any("`worse`" in line and "(exact): its lossless mode changes" in line for line in lines)
    assert any("`steps`" in line and "it has no lossless mode" in line for line in lines)


def test_tables_have_sizes_and_ratios(results):
    table = size_table(results)
    assert table.header == ("codec", "1 %", "0.1 %", "0.01 %", "exact")
    assert [row[0] for row in table.rows] == ["reel", "steps", "reel / best of the others"]
    assert table.rows[1][1:] == ("1,736", "1,736", "1,736", "-")
    ours = int(table.rows[0][1])
    assert table.rows[2][1:] == (f"{ours / 1736:.3g}", *table.rows[2][2:4], "-")
    assert runs_table(results).header[3] == "largest error, m"
    run = results.measured[0]
    assert run["bits_per_number"] == pytest.approx(8 * run["size_bytes"] / (12 * 72))


@pytest.mark.slow
def test_report_contains_plot_tables_and_bytes_of_positions(evaluation, results):
    text = evaluation.markdown.read_text(encoding="utf-8")
    for part in (
        "meshreel evaluate flag.npz --track height",
        "`height` is scalar of each vertex, float32 in m: 3,456 bytes uncompressed. Positions, "
        f"faces and order take another {results.about['positions_bytes']:,} bytes.",
        "Bytes of the track at equal largest error, flag, height",
        "`future` was not measured: it needs the package package_of_the_future",
        "`steps`: steps of the tolerance",
    ):
        assert part in text
    ((_, (picture,)),) = evaluation.measured
    with Image.open(picture.path) as image:
        assert len(image.convert("RGB").getcolors(maxcolors=1 << 24)) > 50
    figures = json.loads(json.dumps(evaluation.as_dict()))
    assert figures["sequences"][0]["track"]["described"] == "scalar of each vertex, float32 in m"


@pytest.mark.slow
def test_runs_are_repeated_when_the_values_of_the_track_change(waving, evaluation):
    out = evaluation.markdown.parent
    values = waving.tracks["height"].values * 2
    other = with_track_alone(waving, "height")
    other = meshreel.MeshSequence(
        other.vertices, other.faces, 25, "flag", tracks={"height": meshreel.Track(values, unit="m")}
    )
    again = evaluate(compare_track("height", (), quick=True), [other], out)
    (first, _) = evaluation.measured[0]
    (second, _) = again.measured[0]
    assert second.about["sha256"] != first.about["sha256"]
    assert second.measured[0]["limit"] == pytest.approx(2 * first.measured[0]["limit"])


def test_levels_depend_on_the_kind_of_the_track(waving):
    unit = np.tile(np.float32([0, 0, 1]), (2, 5, 1))
    of = {kind: meshreel.Track(unit, kind=kind) for kind in ("normal", "color", "vector")}
    assert [one.text for one in levels_of(of["normal"], quick=True)] == ["2deg", "0.5deg", "exact"]
    assert [one.limit for one in levels_of(of["color"], quick=True)] == [0.5 / 63, 0.5 / 255, 0.0]
    assert [one.text for one in levels_of(of["vector"], quick=True)] == ["exact"]  # no range
    assert [one.text for one in levels_of(waving.tracks["flags"], quick=False)] == ["exact"]
    assert level_of("0.5m", waving.tracks["height"]).limit == 0.5


def test_level_drop_is_rejected(waving):
    with pytest.raises(InvalidInputError, match="dropped cannot be measured"):
        level_of("drop", waving.tracks["height"])


def test_coarsest_tolerance_is_found_for_errors_in_powers_of_two():
    tried = []

    def largest_error(tolerance):
        tried.append(tolerance)
        return 0.1 * 2.0 ** np.floor(np.log2(tolerance))

    result = coarsest_tolerance(largest_error, 1.0, 1.0, 2.0)
    assert 8 <= result < 16
    assert len(tried) <= 5


def test_error_for_an_unknown_track_suggests_a_name(waving, tmp_path):
    with pytest.raises(InvalidInputError, match="there is no track 'hight'; did you mean 'height'"):
        evaluate(compare_track("hight", ()), [waving], tmp_path / "r")
