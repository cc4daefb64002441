"""Times of frames that are not evenly spaced."""

import re

import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load
from meshreel.formats.options import Reading
from meshreel.formats.scenes.timing import ascending_times
from meshreel.operations.save import save
from samples.meshes import waving_grid

TIMES = [0, 0.3171, 1, 1.3171, 2]  # as with motion blur
EXACT = {
    ".npz": None,
    ".reel": None,
    ".pvd": None,
    ".h5": "h5py",
    ".vtkhdf": "h5py",
    ".usda": "pxr",
    ".abc": "alembic3d",
}


def uneven():
    return waving_grid(5).replace(times=TIMES)


@pytest.mark.parametrize(("extension", "library"), EXACT.items(), ids=EXACT)
def test_times_come_back_exactly(tmp_path, extension, library, notes):
    if library:
        pytest.importorskip(library)
    path = tmp_path / f"a{extension}"
    save(uneven(), path, notes=notes)
    assert load(path, notes=notes).times.tolist() == TIMES
    assert not [note for note in notes if "time" in str(note)]


@pytest.mark.parametrize("extension", [".glb", ".mdd"])
def test_times_come_back_in_single_precision(tmp_path, extension, notes):
    written = save(uneven(), tmp_path / f"a{extension}", notes=notes)
    assert any(" stores times as float32, to which these are rounded" in note for note in notes)
    topology = {"topology": written[1]} if extension == ".mdd" else {}
    loaded = load(tmp_path / f"a{extension}", **topology)
    np.testing.assert_array_equal(loaded.times.astype(np.float32), np.float32(TIMES))


@pytest.mark.parametrize("extension", [".pvd", ".reel"])
def test_a_frame_rate_replaces_times(tmp_path, extension):
    save(uneven().replace(start_s=2.0), tmp_path / f"a{extension}")
    loaded = load(tmp_path / f"a{extension}", fps=10)
    assert loaded.times.tolist() == pytest.approx([2.0, 2.1, 2.2, 2.3, 2.4])


def test_a_note_says_that_a_format_has_a_rate_only(tmp_path, notes):
    save(uneven(), tmp_path / "a.pc2", notes=notes)
    assert any("PC2 has no frame times" in str(note) for note in notes)


def test_times_that_do_not_fit_the_frames_are_refused(tmp_path):
    grid = waving_grid(3)
    np.savez(tmp_path / "a.npz", vertices=grid.vertices, faces=grid.faces, times=[0.0, 1.0])
    with pytest.raises(ValueError, match=r"times must have shape \(3,\)"):
        load(tmp_path / "a.npz")


@pytest.mark.parametrize("times", [[0, 2, 1], [0, 1, 1]])
def test_times_that_do_not_ascend_need_a_rate(times, notes):
    times_s = np.array(times, float)
    with pytest.raises(FormatError, match=f"step 1 at time {times[1]} and step 2 at 1; .* fps"):
        ascending_times(times_s, "step", Reading())
    options = Reading(fps=10, notes=notes)
    np.testing.assert_allclose(ascending_times(times_s, "step", options), [0, 0.1, 0.2])
    assert notes == ["frame times are not ascending; read in file order at 10 frames per second"]


GAP = "frames 3 and 4 are missing"


@pytest.mark.parametrize(
    ("numbers", "note", "times"),
    [
        ("1 2 5 6", GAP, [0, 0.1, 0.4, 0.5]),
        ("31 33 35", "frame numbers are 2 apart", [0, 0.2, 0.4]),
        ("0 2 6 8", "frame numbers are 2 apart and frame 4 is missing", [0, 0.2, 0.6, 0.8]),
        ("1 3 9 10", "frames 2 and 4 to 8 are missing", [0, 0.2, 0.8, 0.9]),
        (
            " ".join(map(str, [*range(0, 40, 3), 40])),
            "frames 1, 2, 4, 5, 7, 8, 10, 11 and 18",
            None,
        ),
        ("08 09 10", None, [0, 0.1, 0.2]),
        ("1 a 5", None, [0, 0.1, 0.2]),
        ("1_7 2_8 5_9", None, [0, 0.1, 0.2]),
    ],
)
@pytest.mark.parametrize("extension", [".obj", ".usda"])
def test_missing_frame_numbers_are_noted_and_keep_their_time(
    tmp_path, numbers, note, times, extension
):
    if extension == ".usda":
        pytest.importorskip("pxr")
    for number in numbers.split():
        save(waving_grid(1), tmp_path / f"lod2_{number}{extension}")
    for fps in (None, 10):
        notes = []
        loaded = load(tmp_path / f"*{extension}", fps=fps, notes=notes)
        found = [text for text in notes if "missing" in text or " apart" in text]
        condition = "" if fps else "with fps, "
        expected = [] if note is None else [f"{note}.*; {condition}times follow the numbers"]
        assert len(found) == len(expected)
        assert all(map(re.match, expected, found))
    if times is not None:
        np.testing.assert_allclose(loaded.times, times, atol=1e-12)


def test_a_note_names_the_order_of_decimal_numbers_that_are_no_times(tmp_path, notes):
    for number, name in enumerate(["t_0.25", "t_0.5", "t_1.0", "v1.2", "v1.10", "w0.1", "w0.2"]):
        save(waving_grid(7)[number : number + 1], tmp_path / f"{name}.obj")
    for letter, frames in ("t", slice(3)), ("v", slice(3, 5)), ("w", slice(5, 7)):
        loaded = load(tmp_path / f"{letter}*.obj", fps=10, notes=notes)
        np.testing.assert_allclose(loaded.vertices, waving_grid(7).vertices[frames])
        assert loaded.fps == (1.25 if letter == "v" else 10)
    first, second = [note for note in notes if "files are in order of" in note]
    assert "decimal numbers in their names, t_0.25.obj before t_0.5.obj; rename" in first
    assert "numbers after the point in their names, v1.2.obj before v1.10.obj" in second


def test_gaps_between_segments_and_in_lists_keep_their_time(tmp_path, notes):
    for number in (1, 2, 5, 6):
        save(waving_grid(1, rows=8 + number // 5), tmp_path / f"f_{number}.ply")
    files = [tmp_path / f"f_{number}.ply" for number in (1, 2, 5, 6)]
    for source in (tmp_path, files):
        loaded = load(source, fps=10, notes=notes)
        assert [*map(len, (loaded.segments, loaded.times))] == [2, 4]
        np.testing.assert_allclose(loaded.segments[1].timing.seconds(2), [0.4, 0.5])
    assert sum(note.startswith(GAP) for note in notes) == 2
    assert load([*files[1:], files[0]], fps=10).times.tolist() == pytest.approx([0, 0.1, 0.2, 0.3])
