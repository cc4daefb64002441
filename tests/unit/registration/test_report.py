"""Figures on registered and decoded surfaces, against those of `compare`."""

import numpy as np
import pytest

import meshreel
from meshreel.metrics.surface_distance import compare_surfaces
from meshreel.registration import report as report_of
from meshreel.registration.register import register
from meshreel.registration.report import MIN_FRAMES, MIN_POINT_FRAMES, Report
from samples.captures import capture

pytestmark = pytest.mark.usefixtures("few_grid_lines")


@pytest.fixture(scope="module")
def registered():
    return register(capture(3, 0.3), tolerance=0.5)


def with_noise(registered):
    (segment,) = registered.sequence.segments
    noise = np.random.default_rng(0).normal(0, 0.004, segment.vertices.shape)
    positions = (segment.vertices + noise).astype(np.float32)
    return meshreel.concatenate([segment.replace(vertices=positions)])


@pytest.mark.slow
def test_d1_and_d2_are_those_of_compare(registered, monkeypatch):
    monkeypatch.setattr(report_of, "MIN_POINT_FRAMES", 3)
    decoded = with_noise(registered)
    points = Report.measured(registered, decoded).points
    expected = compare_surfaces(registered.raw, decoded, n_samples=100)
    assert points.frames == (0, 1, 2)
    assert points.d1_psnr_db == pytest.approx(expected.d1_psnr_db, rel=1e-9)
    assert points.d2_psnr_db == pytest.approx(expected.d2_psnr_db, rel=1e-9)


@pytest.mark.slow
def test_surface_psnr_is_close_to_that_of_compare(registered):
    decoded = with_noise(registered)
    report = Report.measured(registered, decoded)
    expected = compare_surfaces(registered.raw, decoded, n_samples=20_000)
    assert report.decoded.psnr_db == pytest.approx(expected.psnr_db, abs=0.7)
    assert report.decoded.max_percent == pytest.approx(expected.worse.max_percent, rel=0.05)


def test_progress_of_each_stage_begins_before_its_work_and_ends_with_it(registered):
    calls = []
    Report.measured(registered, registered.sequence, lambda stage, n: calls.append((stage, n)))
    stages = [calls[i][0] for i in range(len(calls)) if calls[i][1] == 0]
    assert stages == ["measuring", "measuring D1 and D2"]
    assert calls[-1][1] == 1


@pytest.mark.slow
def test_the_measured_frames_are_few_and_named():
    result = register(capture(7, 0.5), tolerance=0.5)
    report = Report.measured(result, result.sequence)
    assert len(set(report.points.frames)) == MIN_POINT_FRAMES
    assert len(set(report.frames)) == MIN_FRAMES
    rows = report.rows(1)
    assert rows["decoded"].endswith("; of 3 of 7 frames")
    assert rows["D1 and D2 PSNR"].endswith("; of 1 of 7 frames")
