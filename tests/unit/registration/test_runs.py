"""Long captures: runs of frames, on workers, joined into segments."""

import os
import signal
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

import meshreel
from meshreel import InvalidInputError
from meshreel.formats.options import Reading
from meshreel.operations.convert import Target, convert
from meshreel.operations.registering import open_part
from meshreel.registration import runs
from meshreel.registration.capture import Topology
from meshreel.registration.growing import Segment
from meshreel.registration.joining import Embedding, Piece, best_key, chains, merged
from meshreel.registration.options import RegisterOptions
from meshreel.registration.refining import KeyMesh
from meshreel.registration.register import register
from meshreel.registration.runs import ranges_of
from meshreel.registration.stores import TemporaryStore
from meshreel.registration.triangle_mesh import TriangleMesh
from meshreel.registration.verification import FrameErrors
from meshreel.runtime.workers import cluster, executors
from samples.captures import capture
from samples.clusters import local_cluster
from samples.engines import InlineExecutor
from samples.shapes import square

TOLERANCE = 0.5


class InterruptionError(Exception):
    """Raised by the progress callback in place of a signal."""


@pytest.fixture(scope="module")
def raw():
    return capture(16, 0.6)


@pytest.fixture(autouse=True)
def short_runs(monkeypatch):
    monkeypatch.setattr(runs, "RUN_FRAMES", 5)


@pytest.fixture(scope="module")
def expected(raw):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runs, "RUN_FRAMES", 5)
        return register(raw, tolerance=TOLERANCE)


def assert_equal(found, expected):
    assert found.n_segments == expected.n_segments
    for frame, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(frame.vertices, other.vertices)
        np.testing.assert_array_equal(frame.faces, other.faces)


def test_runs_cover_all_frames_and_overlap():
    assert ranges_of(1) == [range(1)]
    assert ranges_of(7) == [range(7)]
    assert ranges_of(16) == [range(6), range(5, 11), range(10, 16)]


@pytest.mark.slow
def test_the_mesh_of_one_key_continues_in_all_runs(expected):
    (segment,) = expected.segments
    assert segment.numbers == range(16)
    assert not any(errors.exceeds(expected.tolerance) for errors in segment.errors)
    measured = expected.distances_of(expected.sequence, range(expected.raw.n_frames))
    assert measured.psnr_db == pytest.approx(expected.distances.psnr_db, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("n_workers", [1, 2])
def test_frames_are_equal_for_any_number_of_workers(raw, expected, tmp_path, n_workers):
    """The workers read the frames from their files."""
    meshreel.save(raw, tmp_path / "frame_%02d.ply")
    registered = meshreel.register(tmp_path, tolerance=TOLERANCE, workers=n_workers)
    assert_equal(registered, expected.sequence)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_frames_are_equal_if_a_worker_of_a_cluster_is_killed(raw, expected):
    pytest.importorskip("distributed", reason="the extra [dask] is not installed")
    killed = []

    def kill_once(stage, _):
        if stage == "registering" and not killed:
            killed.append(next(iter(running.workers.values())).pid)
            os.kill(killed[0], signal.SIGKILL)

    with local_cluster(2) as running:
        scheduler = running.scheduler_address
        found = register(raw, tolerance=TOLERANCE, scheduler=scheduler, progress=kill_once)
    assert killed
    assert_equal(found.sequence, expected.sequence)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stage", "n_done", "remaining"),
    [("registering", 11, [range(5, 11), range(10, 16)]), ("joining", 1, [])],
)
def test_finished_runs_are_not_registered_again(
    raw, expected, tmp_path, monkeypatch, stage, n_done, remaining
):
    def interrupt(name, count):
        if name.startswith(stage) and count.done >= n_done:
            raise InterruptionError

    options = {"tolerance": TOLERANCE, "folder": tmp_path}
    with pytest.raises(InterruptionError):
        register(raw, progress=interrupt, **options)
    registered, register_run = [], runs.register_run

    def counted(frames, topologies, **options):
        registered.append(range(min(topologies), max(topologies) + 1))
        return register_run(frames, topologies, **options)

    monkeypatch.setattr(runs, "register_run", counted)
    found = register(raw, **options)
    assert registered == remaining
    assert_equal(found.sequence, expected.sequence)
    assert "continued an earlier run" in found.changes


@pytest.mark.slow
def test_progress_says_that_runs_wait_for_workers(raw, monkeypatch):
    def without_workers(address):
        return nullcontext((InlineExecutor(), 0))

    stages = []
    monkeypatch.setattr(executors, "cluster_executor", without_workers)
    register(raw[:3], scheduler="tcp://a:1", progress=lambda stage, _: stages.append(stage))
    assert stages[:2] == ["waiting for workers; 'dask worker tcp://a:1' starts one", "cleaning"]


def test_workers_and_scheduler_cannot_be_combined(raw):
    with pytest.raises(InvalidInputError, match="cannot be combined"):
        register(raw, workers=2, scheduler="tcp://127.0.0.1:9")


def test_the_scheduler_must_answer_before_frames_are_read(tmp_path, monkeypatch):
    pytest.importorskip("distributed", reason="the extra [dask] is not installed")
    monkeypatch.setattr(cluster, "CONNECT_TIMEOUT_S", 0.1)
    (tmp_path / "frame_0.ply").write_bytes(b"damaged")
    address, target = "tcp://127.0.0.1:9", Target(output=tmp_path / "a.reel")
    with pytest.raises(InvalidInputError, match="no Dask scheduler answers"):
        meshreel.register(tmp_path, scheduler=address)
    with pytest.raises(InvalidInputError, match="no Dask scheduler answers"):
        convert(tmp_path, target, Reading(), registering=RegisterOptions(scheduler=address))


def test_a_worker_of_another_version_refuses_a_run(raw):
    with pytest.raises(InvalidInputError, match=r"and the caller 0\.0; install the same"):
        runs.on_worker(None, 0, None, "0.0", runs.survey_run)


def test_workers_open_frames_of_files_and_of_a_file(raw, tmp_path):
    meshreel.save(raw, tmp_path / "frames" / "frame_%02d.ply")
    meshreel.save(raw, tmp_path / "whole.vtkhdf")
    for source in ("frames", "whole.vtkhdf"):
        with open_part(tmp_path / source, Reading())(range(4, 7))() as part:
            for frame, other in zip(part, raw[4:7], strict=True):
                np.testing.assert_array_equal(frame.vertices, other.vertices)


def test_embedded_vertices_move_with_another_mesh():
    base, fine = (TriangleMesh(*square(0.0, n)) for n in (5, 8))
    fine = TriangleMesh(np.add(fine.vertices, [0, 0, 0.004]), fine.faces)
    moved = TriangleMesh(np.add(base.vertices[:, [1, 2, 0]], [0, 0, 2.0]), base.faces)
    positions = Embedding.of_vertices(fine, base).positions(moved)
    expected = np.add(fine.vertices[:, [1, 2, 0]], [0, 0, 2.0])
    np.testing.assert_allclose(positions, expected, atol=1e-12)


ERRORS = FrameErrors(*9 * [0.0])


def segment(first, stop, key, n=2):
    """A segment whose positions are all the number of its key."""
    mesh, n_frames = TriangleMesh(*square(0.0, n)), stop - first
    positions = np.full((n_frames, n * n, 3), key, np.float32)
    ends = ((first - 1, f"before {key}"), (stop, f"after {key}"))
    own = tuple(range(first, stop))
    return Segment(
        first, key, positions, KeyMesh.of_mesh(mesh), n_frames * (ERRORS,), own, ends,
        may_lack_vertices=False,
    )  # fmt: skip


def test_runs_are_joined_at_the_frame_that_they_share():
    one = range(11), [segment(0, 11, 5)]
    two = range(10, 20), [segment(10, 15, 12), segment(15, 20, 17)]
    first, second = chains([one, two])
    assert [(piece.segment.key, piece.numbers) for piece in first] == [
        (5, range(10)), (12, range(10, 15)),
    ]  # fmt: skip
    assert [(piece.segment.key, piece.numbers) for piece in second] == [(17, range(15, 20))]
    topologies = {5: Topology(1, 2), 12: Topology(2, 2)}
    assert best_key(first, topologies) == 1


@pytest.mark.parametrize(
    ("n_before", "reasons", "remaining"),
    [
        (0, {4: "missed", 15: "after 7"}, [[range(5)]]),
        (2, {2: "missed", 15: "after 7"}, [[range(3)]]),
        (5, {-1: "missed", 15: "after 7"}, []),
    ],
)
def test_frames_that_do_not_follow_the_key_stay_with_their_own(n_before, reasons, remaining):
    """Of the frames of the piece before the key's, the last `n_before` follow it."""
    segments = segment(0, 7, 2), segment(5, 12, 7), segment(10, 15, 12)
    ranges = range(5), range(5, 10), range(10, 15)
    missed = ((4 - n_before, "missed"),)
    joined = {0: replace(segment(5 - n_before, 5, 7), reasons=missed), 2: segment(10, 15, 7)}
    whole, rest = merged([*map(Piece, segments, ranges)], 1, joined, TemporaryStore())
    assert whole.numbers == range(5 - n_before, 15)
    assert np.all(whole.positions == 7)
    assert whole.n_folded == tuple(whole.numbers)
    assert dict(whole.reasons) == reasons
    assert [[piece.numbers for piece in part] for part in rest] == remaining
