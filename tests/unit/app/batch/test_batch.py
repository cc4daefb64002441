"""Runs of a batch: encoded, unchanged, failed and rejected inputs."""

import itertools
import json
import math
import os
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.app.batch.encode_input import EncodeOptions, encode_input
from meshreel.app.batch.manifest import MANIFEST_NAME, Manifest
from meshreel.app.batch.plan import plan_batch
from meshreel.app.batch.run import run_batch
from meshreel.codec.options import config_of
from meshreel.errors import InvalidInputError, WorkerDiedError
from meshreel.formats.options import Reading
from meshreel.model.tracks import Track
from meshreel.runtime.workers.executors import ProcessExecutor
from samples.engines import InlineExecutor
from samples.materials import dressed_sheet
from samples.meshes import quad_sheet, waving_grid
from samples.tasks import encode_or_die

OPTIONS = EncodeOptions(config_of(quality=60))


@pytest.fixture
def inputs(tmp_path):
    """A folder of two sequences: walk.npz, and frames in a/cloth."""
    folder = tmp_path / "in"
    (folder / "a" / "cloth").mkdir(parents=True)
    meshreel.save(waving_grid(), folder / "walk.npz")
    meshreel.save(waving_grid(4), f"{folder}/a/cloth/f_%03d.obj")
    return folder


@pytest.fixture
def out(tmp_path):
    return tmp_path / "out"


def run(inputs, out, options=OPTIONS, **arguments):
    return run_batch(plan_batch(inputs, out, options, **arguments), InlineExecutor())


def records_in(out):
    return json.loads((out / MANIFEST_NAME).read_text())["inputs"]


def files_in(out):
    return {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}


def test_run_writes_the_streams_of_encode_to_the_same_subfolders(inputs, out):
    report = run(inputs, out)
    assert report.summary == "0 up to date, 2 encoded, 0 failed"
    assert files_in(out) == {MANIFEST_NAME, "walk.reel", "a/cloth.reel"}
    for name, stream in (("walk.npz", "walk.reel"), ("a/cloth", "a/cloth.reel")):
        expected = meshreel.encode(meshreel.load(inputs / name), quality=60)
        assert (out / stream).read_bytes() == expected


def test_manifest_contains_the_figures_of_compare_and_info(inputs, out):
    run(inputs, out)
    results = records_in(out)["walk.npz"]
    quality = meshreel.compare(meshreel.load(inputs / "walk.npz"), meshreel.load(out / "walk.reel"))
    stream = meshreel.info((out / "walk.reel").read_bytes())
    assert results["state"] == "done"
    assert results["kg_error_percent"] == pytest.approx(quality.kg_error_percent)
    assert results["max_error_percent"] == pytest.approx(quality.max_error_percent)
    assert results["normal_angle_mean_deg"] == pytest.approx(quality.normal_angle_mean_deg, rel=0.2)
    assert results["size_bytes"] == stream.size_bytes == (out / "walk.reel").stat().st_size
    assert results["raw_size_bytes"] == stream.raw_size_bytes
    assert results["ratio"] == pytest.approx(stream.ratio)
    assert results["seconds"] > 0
    assert results["options"] == {"quality": 60}
    assert results["version"] == meshreel.__version__


@pytest.mark.slow
def test_input_whose_faces_change_becomes_segments(tmp_path, out):
    folder = tmp_path / "in" / "scan"
    folder.mkdir(parents=True)
    heat = np.random.default_rng(2).random((3, 99)).astype(np.float32)
    meshreel.save(waving_grid(3).replace(tracks={"heat": Track(heat)}), folder / "a_%d.ply")
    meshreel.save(quad_sheet(2), folder / "b_%d.ply")
    reading = Reading(attributes=["uv", "none such"])
    config = config_of(max_error=0.3)
    options = EncodeOptions(config, reading, tracks={"heat": "1%", "cold": 1.0})
    report = run(tmp_path / "in", out, options)
    assert report.summary == "0 up to date, 1 encoded, 0 failed"
    results = records_in(out)["scan"]
    decoded = meshreel.decode(out / "scan.reel")
    assert [segment.n_frames for segment in decoded.segments] == [3, 2]
    assert [[a.name for a in segment.surface.attributes] for segment in decoded.segments] == [
        [],
        ["uv"],
    ]
    assert 0.1 < results["max_error_percent"] <= 0.3
    assert results["size_bytes"] == (out / "scan.reel").stat().st_size
    assert 0 < results["tracks"]["heat"]["largest"] <= 0.01
    for note in (
        "the faces change: 5 frames in 2 segments of constant connectivity",
        "has no track cold",
    ):
        assert note in results["notes"]
    [missing] = [note for note in results["notes"] if "no attribute or group" in note]
    assert missing.startswith("has no attribute or group 'none such'; ")


@pytest.mark.parametrize(("bits", "is_noted"), [("uv", False), ("none", True)])
def test_texture_coordinates_of_some_segments_are_quantized(tmp_path, out, bits, is_noted):
    folder = tmp_path / "in" / "scan"
    folder.mkdir(parents=True)
    meshreel.save(waving_grid(1), folder / "a.ply")
    meshreel.save(quad_sheet(1), folder / "b.ply")
    config = config_of(quality=60, uv_bits=8)
    run(tmp_path / "in", out, EncodeOptions(config, Reading(attributes=bits)))
    results = records_in(out)["scan"]
    assert results["state"] == "done"
    assert (results["uv_error"] is None) == is_noted
    assert ("has no texture coordinates for uv_bits to quantize" in results["notes"]) == is_noted


def test_images_of_some_inputs_are_reencoded_and_counted_apart(tmp_path, out):
    folder = tmp_path / "in"
    folder.mkdir()
    meshreel.save(dressed_sheet(2), folder / "a.glb")
    meshreel.save(quad_sheet(2), folder / "b.npz")
    run(folder, out, EncodeOptions(config_of(images="webp"), Reading()))
    with_images, without = records_in(out)["a.glb"], records_in(out)["b.npz"]
    assert with_images["state"] == without["state"] == "done"
    assert with_images["image_bytes"] == meshreel.info(out / "a.reel").image_bytes > 0
    assert without["image_bytes"] == 0
    assert "has no images of materials for images" in without["notes"]


@pytest.mark.slow
def test_manifest_lists_non_default_options(inputs, out):
    run(inputs, out, EncodeOptions(config_of(kg=0.5, order="drop"), Reading(fps=12.0)))
    assert records_in(out)["walk.npz"]["options"] == {"kg": 0.5, "order": "drop", "fps": 12.0}
    assert records_in(out)["walk.npz"]["kg_error_percent"] <= 0.5
    assert meshreel.info((out / "walk.reel").read_bytes()).fps == 12


def test_second_run_without_changes_encodes_nothing_unless_forced(inputs, out):
    run(inputs, out)
    before = (out / MANIFEST_NAME).read_text()
    plan = plan_batch(inputs, out, OPTIONS)
    assert plan.to_encode == {}
    assert run_batch(plan, None).summary == "2 up to date, 0 encoded, 0 failed"
    assert (out / MANIFEST_NAME).read_text() == before
    assert run(inputs, out, force=True).summary == "0 up to date, 2 encoded, 0 failed"


def change_input(inputs, out):
    meshreel.save(waving_grid(13), inputs / "walk.npz", overwrite=True)


def touch_input(inputs, out):
    os.utime(inputs / "walk.npz", ns=(0, 10**18))


def remove_output(inputs, out):
    (out / "walk.reel").unlink()


def cut_output(inputs, out):
    (out / "walk.reel").write_bytes((out / "walk.reel").read_bytes()[:-1])


def mark_input(state):
    """Return a function that sets the state of walk.npz in the manifest."""

    def mark(inputs, out):
        head, name, tail = (out / MANIFEST_NAME).read_text().partition('"walk.npz"')
        (out / MANIFEST_NAME).write_text(head + name + tail.replace("done", state, 1))

    return mark


@pytest.mark.slow
@pytest.mark.parametrize(
    "change",
    [
        change_input,
        touch_input,
        remove_output,
        cut_output,
        mark_input("failed"),
        mark_input("pending"),
    ],
)
def test_second_run_encodes_only_changed_inputs(inputs, out, change):
    run(inputs, out)
    change(inputs, out)
    report = run(inputs, out)
    assert set(report.encoded) == {"walk.npz"}
    assert set(report.up_to_date) == {"a/cloth"}
    expected = meshreel.encode(meshreel.load(inputs / "walk.npz"), quality=60)
    assert (out / "walk.reel").read_bytes() == expected


def test_changed_options_reencode_everything(inputs, out):
    run(inputs, out)
    report = run(inputs, out, EncodeOptions(config_of(quality=70)))
    assert set(report.encoded) == {"walk.npz", "a/cloth"}
    expected = meshreel.encode(meshreel.load(inputs / "walk.npz"), quality=70)
    assert (out / "walk.reel").read_bytes() == expected


def test_failing_input_is_reported_and_does_not_stop_the_others(inputs, out):
    (inputs / "bad.npz").write_bytes(b"no archive")
    report = run(inputs, out)
    assert report.summary == "0 up to date, 2 encoded, 1 failed"
    assert records_in(out)["bad.npz"]["state"] == "failed"
    assert records_in(out)["bad.npz"]["error"].startswith("is not a numpy archive")
    assert records_in(out)["bad.npz"]["size_bytes"] is None
    assert files_in(out) == {MANIFEST_NAME, "walk.reel", "a/cloth.reel"}
    summary = json.loads((out / MANIFEST_NAME).read_text())["summary"]
    records = [record for record in records_in(out).values() if record["state"] == "done"]
    assert (summary["done"], summary["failed"]) == (2, 1)
    assert summary["size_bytes"] == sum(record["size_bytes"] for record in records)
    assert summary["max_error_percent"] == max(record["max_error_percent"] for record in records)


def test_earlier_stream_is_kept_when_its_input_fails(inputs, out):
    run(inputs, out)
    before = (out / "walk.reel").read_bytes()
    (inputs / "walk.npz").write_bytes(b"no archive")
    assert set(run(inputs, out).failed) == {"walk.npz"}
    assert (out / "walk.reel").read_bytes() == before
    meshreel.save(waving_grid(), inputs / "walk.npz", overwrite=True)
    assert set(run(inputs, out).encoded) == {"walk.npz"}


def test_error_names_the_frame_relative_to_the_input_folder(inputs, out):
    (inputs / "a" / "cloth" / "f_002.obj").write_text("v 1 2 no\n")
    [record] = run(inputs, out).failed.values()
    assert record.error.startswith("a/cloth/f_002.obj")
    assert "\n" not in record.error


def test_two_inputs_of_one_output_both_fail(inputs, out):
    meshreel.save(waving_grid(), inputs / "a" / "cloth.npz")
    report = run(inputs, out, force=True)
    assert set(report.encoded) == {"walk.npz"}
    assert set(report.failed) == {"a/cloth", "a/cloth.npz"}
    for record in report.failed.values():
        assert "a/cloth.npz and a/cloth would both become a/cloth.reel" in record.error
    assert not (out / "a").exists()


def test_foreign_output_is_replaced_only_with_force(inputs, out):
    out.mkdir()
    (out / "walk.reel").write_bytes(b"mine")
    for _ in range(2):
        report = run(inputs, out)
        assert set(report.failed) == {"walk.npz"}
        assert "force=True" in report.failed["walk.npz"].error
        assert (out / "walk.reel").read_bytes() == b"mine"
    assert set(run(inputs, out, force=True).failed) == set()
    assert (out / "walk.reel").read_bytes() != b"mine"


def test_output_created_after_a_failure_is_kept(inputs, out):
    (inputs / "bad.npz").write_bytes(b"no archive")
    run(inputs, out)
    (out / "bad.reel").write_bytes(b"mine")
    meshreel.save(waving_grid(), inputs / "bad.npz", overwrite=True)
    assert set(run(inputs, out).failed) == {"bad.npz"}
    assert (out / "bad.reel").read_bytes() == b"mine"


def test_output_created_during_the_run_is_kept(inputs, out):
    plan = plan_batch(inputs, out, OPTIONS)
    out.mkdir()
    (out / "walk.reel").write_bytes(b"mine")
    for _ in range(2):
        assert set(run_batch(plan, InlineExecutor()).failed) == {"walk.npz"}
        assert (out / "walk.reel").read_bytes() == b"mine"
        plan = plan_batch(inputs, out, OPTIONS)


def test_folder_at_an_output_path_fails_only_that_input(inputs, out):
    (out / "walk.reel").mkdir(parents=True)
    report = run(inputs, out, force=True)
    assert set(report.failed) == {"walk.npz"}
    assert set(report.encoded) == {"a/cloth"}


def test_record_of_a_removed_input_is_kept(inputs, out):
    run(inputs, out)
    (inputs / "walk.npz").unlink()
    assert run(inputs, out).summary == "1 up to date, 0 encoded, 0 failed"
    assert records_in(out)["walk.npz"]["state"] == "done"


def test_manifest_is_complete_after_each_input(inputs, out, monkeypatch):
    monkeypatch.setattr("meshreel.app.batch.manifest.QUICK_S", math.inf)
    seen = []

    def record_states(stage, fraction):
        seen.append(sorted(record["state"] for record in records_in(out).values()))

    plan = plan_batch(inputs, out, OPTIONS)
    run_batch(plan, InlineExecutor(), progress=record_states)
    assert seen == [["pending", "pending"], ["done", "pending"], ["done", "done"]]


def test_slow_writes_of_the_manifest_take_a_tenth_of_the_time(inputs, out, monkeypatch):
    """Each write takes a second, and encoding no time: the first of three inputs is recorded."""
    meshreel.save(waving_grid(5), inputs / "run.pc2")
    clock, seen, write = itertools.count(), [], Manifest.write
    monkeypatch.setattr("meshreel.app.batch.manifest.monotonic", lambda: float(next(clock)))

    def write_and_record(manifest):
        seen.append([record.state for record in manifest.records.values()])
        write(manifest)

    monkeypatch.setattr(Manifest, "write", write_and_record)
    assert run(inputs, out).summary == "0 up to date, 3 encoded, 0 failed"
    assert [states.count("done") for states in seen] == [0, 1, 3]
    assert json.loads((out / MANIFEST_NAME).read_text())["summary"]["done"] == 3


def test_finished_inputs_are_kept_when_the_run_is_stopped(inputs, out):
    def stop(stage, fraction):
        if fraction:
            raise KeyboardInterrupt

    plan = plan_batch(inputs, out, OPTIONS)
    with pytest.raises(KeyboardInterrupt):
        run_batch(plan, InlineExecutor(), progress=stop)
    assert sorted(record["state"] for record in records_in(out).values()) == ["done", "pending"]
    assert run(inputs, out).summary == "1 up to date, 1 encoded, 0 failed"


@pytest.mark.parametrize(("n_workers", "words"), [(0, "encoding"), (2, "encoding, 2 at a time")])
def test_stage_states_the_number_of_workers(inputs, out, n_workers, words):
    stages = set()
    plan = plan_batch(inputs, out, OPTIONS)
    run_batch(plan, InlineExecutor(), n_workers, progress=lambda stage, _: stages.add(stage))
    assert stages == {words}


def test_worker_with_another_version_is_rejected():
    with pytest.raises(InvalidInputError, match=r"the worker has meshreel .* install the same"):
        encode_input("walk.npz", OPTIONS, "0.0.0")


def test_file_as_output_folder_is_rejected(inputs, out):
    out.write_bytes(b"")
    with pytest.raises(InvalidInputError, match="is a file"):
        plan_batch(inputs, out, OPTIONS)


def test_output_folder_may_be_the_input_folder(inputs):
    assert run(inputs, inputs).summary == "0 up to date, 2 encoded, 0 failed"
    assert (inputs / "a" / "cloth.reel").is_file()
    assert run(inputs, inputs).summary == "2 up to date, 0 encoded, 0 failed"


@pytest.mark.slow
def test_input_that_kills_its_workers_fails_alone(inputs, out, monkeypatch):
    """One input kills its worker once and is encoded; another always, and only it fails."""
    monkeypatch.setattr("meshreel.app.batch.run.encode_input", encode_or_die)
    for name in ("deadly", "dies_once"):
        meshreel.save(waving_grid(), inputs / f"{name}.npz")
    with ProcessExecutor(2) as executor:
        report = run_batch(plan_batch(inputs, out, OPTIONS), executor, 2)
    assert set(report.encoded) == {"walk.npz", "a/cloth", "dies_once.npz"}
    assert set(report.failed) == {"deadly.npz"}
    assert "died" in report.failed["deadly.npz"].error
    assert files_in(out) == {MANIFEST_NAME, "walk.reel", "a/cloth.reel", "dies_once.reel"}


class TightExecutor(InlineExecutor):
    """Workers with too little memory for the initial block size."""

    def __init__(self, error, least_share):
        super().__init__()
        self.error, self.least_share, self.shares = error, least_share, []

    def submit(self, function, /, *args):  # type: ignore[override]
        source, options, version = args

        def call():
            if not source.endswith("walk.npz"):
                return function(source, options, version)
            self.shares.append(options.block_share)
            if options.block_share > self.least_share:
                raise self.error
            return function(source, options, version)

        return super().submit(call)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("error", "shares"),
    [(MemoryError(), [1 / 4, 1 / 16]), (WorkerDiedError("died during this call"), [1 / 16])],
)
def test_input_is_retried_in_smaller_blocks_without_memory(inputs, out, error, shares):
    meshreel.save(waving_grid(40), inputs / "walk.npz", overwrite=True)
    executor = TightExecutor(error, 1 / 16)
    report = run_batch(plan_batch(inputs, out, OPTIONS), executor)
    assert report.summary == "0 up to date, 2 encoded, 0 failed"
    assert executor.shares == [1.0, *shares]
    [note] = report.encoded["walk.npz"].notes
    assert "with blocks of 40 frames; coded in blocks of 2" in note
    assert set(meshreel.info(out / "walk.reel").block_frames) == {2}
    [note] = report.encoded["a/cloth"].notes
    assert note.startswith("the frame rate is unknown")
    assert run(inputs, out).summary == "2 up to date, 0 encoded, 0 failed"


def test_input_without_memory_for_small_blocks_fails_alone(inputs, out):
    report = run_batch(plan_batch(inputs, out, OPTIONS), TightExecutor(MemoryError(), 0))
    assert set(report.encoded) == {"a/cloth"}
    assert "not enough memory, even with smaller blocks" in report.failed["walk.npz"].error


@pytest.mark.slow
def test_long_inputs_are_encoded_first(inputs, out):
    for name, n_frames in (("b", 30), ("c", 60), ("d", 20)):
        meshreel.save(waving_grid(n_frames), inputs / f"{name}.npz")
    executor = InlineExecutor()
    run_batch(plan_batch(inputs, out, OPTIONS), executor)
    names = [Path(source).stem for source, *_ in executor.calls]
    assert [name for name in names if name in "bcd"] == ["c", "b", "d"]
