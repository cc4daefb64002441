"""Frame files are read and parsed once, whether their faces change or not, and on demand."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.formats.frames.frame_files import FrameFiles, read_runs
from meshreel.formats.frames.stored_frames import FrameSurvey, StoredFrames
from meshreel.formats.options import ReadOptions
from meshreel.formats.registry import FRAME_FORMATS
from meshreel.formats.save import save
from meshreel.model.extent import extent_of
from meshreel.model.sequence import MeshSequence
from meshreel.model.tracks import Track
from samples.meshes import quad_sheet, waving_grid
from samples.tracks import assert_same_tracks

EXTENSIONS = [form.extension for form in FRAME_FORMATS.values() if form.encoder is not None]


def frames_of(folder, extension, *, is_changing=False):
    """Write frames with a track, if the format stores tracks; one or two kinds of faces."""
    sheets = [quad_sheet(6), *([waving_grid(4), quad_sheet(1)] if is_changing else [])]
    for number, sheet in enumerate(sheets):
        tracks = {}
        if FRAME_FORMATS[extension].holds_tracks:
            values = np.random.default_rng(number).random((sheet.n_frames, sheet.n_verts, 3))
            tracks = {"normals": Track(values.astype("f4"), kind="vector")}
        if extension in (".ply", ".vtp", ".vtu") and tracks:
            tracks = {"heat": Track(tracks["normals"].values[..., :1])}
        save(sheet.replace(tracks=tracks), folder / f"{number}_%02d{extension}", notes=[])
    return folder


@pytest.fixture
def reads(monkeypatch):
    """How often each file was read."""
    counts, read_bytes = Counter(), Path.read_bytes

    def read_counted(path):
        counts[path.name] += 1
        return read_bytes(path)

    monkeypatch.setattr(Path, "read_bytes", read_counted)
    return counts


def with_counted_parses(extension):
    """The format with a list that grows with every parsed file."""
    form, parsed = FRAME_FORMATS[extension], []

    def read(data):
        parsed.append(data)
        return form.read(data)

    return replace(form, read=read), parsed


@pytest.mark.parametrize("is_changing", [False, True])
@pytest.mark.parametrize("extension", EXTENSIONS)
def test_load_reads_each_file_once(tmp_path, reads, extension, is_changing):
    folder = frames_of(tmp_path, extension, is_changing=is_changing)
    sequence = meshreel.load(folder)
    assert sequence.n_segments == (3 if is_changing else 1)
    assert reads == dict.fromkeys((path.name for path in folder.iterdir()), 1)


@pytest.mark.parametrize("is_changing", [False, True])
@pytest.mark.parametrize("max_bytes", [None, 0])
@pytest.mark.parametrize("extension", EXTENSIONS)
def test_frames_are_parsed_once(tmp_path, extension, max_bytes, is_changing):
    folder = frames_of(tmp_path, extension, is_changing=is_changing)
    form, parsed = with_counted_parses(extension)
    paths = sorted(folder.iterdir())
    options = ReadOptions(max_loaded_bytes=max_bytes)
    runs = list(read_runs(FrameFiles(paths, form), "walk", options))
    assert [run.n_frames for run in runs] == ([6, 4, 1] if is_changing else [6])
    assert len(parsed) == len(paths)
    assert isinstance(runs[0], MeshSequence if max_bytes is None else StoredFrames)


@pytest.mark.parametrize("extension", [".ply", ".vtp", ".stl"])
def test_runs_stay_in_their_files_once_they_take_the_limit_together(tmp_path, extension):
    folder = frames_of(tmp_path, extension, is_changing=True)
    paths, form = sorted(folder.iterdir()), FRAME_FORMATS[extension]
    loaded = list(read_runs(FrameFiles(paths, form), "walk", ReadOptions()))
    size = 3 * loaded[0].read(0, 6).nbytes
    options = ReadOptions(max_loaded_bytes=size)
    mixed = list(read_runs(FrameFiles(paths, form), "walk", options))
    kinds = [type(run) for run in mixed]
    assert kinds == [MeshSequence, StoredFrames, MeshSequence]  # single frames are always loaded
    for run, other in zip(mixed, loaded, strict=True):
        positions = [one.read(0, run.n_frames) for one in (run, other)]
        np.testing.assert_array_equal(*positions, strict=True)
        np.testing.assert_array_equal(run.faces, other.faces)
        assert_same_tracks(run.tracks, other.tracks)


def survey_of(*blocks, is_decimal=True):
    survey = FrameSurvey(is_decimal=is_decimal)
    for block in blocks:
        survey.add(block)
    return survey


def moving(dtype=np.float64):
    return np.random.default_rng(0).standard_normal((3, 50, 3)).astype(dtype)


def test_decimal_text_near_the_origin_is_float32():
    assert survey_of(moving()).dtype == np.float32


def test_decimal_text_with_one_distant_frame_is_float64():
    vertices = moving()
    vertices[2] += 1e4
    assert survey_of(vertices).dtype == np.float64


def test_decimal_text_with_one_collapsed_frame_is_float32():
    vertices = moving()
    vertices[1] = 0.1
    assert survey_of(vertices).dtype == np.float32


@pytest.mark.parametrize("largest", [1e39, 1.7e308])
def test_decimal_text_beyond_float32_is_float64(largest):
    assert survey_of(np.array([[[-largest, 0, 0], [largest, 0, 0]]])).dtype == np.float64


@pytest.mark.parametrize("order", [(np.float32, np.float64), (np.float64, np.float32)])
def test_mixed_declared_types_are_float64(order):
    assert survey_of(*map(moving, order), is_decimal=False).dtype == np.float64


def test_declared_float32_stays_float32():
    assert survey_of(moving(np.float32), is_decimal=False).dtype == np.float32


@pytest.mark.parametrize("is_decimal", [False, True])
def test_survey_extent_covers_all_blocks(is_decimal):
    vertices = moving()
    survey = survey_of(vertices[:1], vertices[1:], is_decimal=is_decimal)
    expected = extent_of(vertices.astype(survey.dtype))
    assert survey.extent.low.tobytes() == expected.low.tobytes()
    assert survey.extent.high.tobytes() == expected.high.tobytes()
    assert survey.extent.mean_diagonal == expected.mean_diagonal
