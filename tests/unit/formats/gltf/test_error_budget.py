import math
import re

import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.formats.error_budget import requested_budget
from meshreel.formats.options import Origin, WriteOptions
from meshreel.formats.save import save, save_part
from meshreel.model.sequence import MeshSequence
from samples.glb import Glb, largest_error_percent

GUARANTEE = 0.1
AGAINST_THE_ORIGINAL = re.compile(
    r"against the original the largest error is at most ([\de.-]+) % of the diagonal, "
    r"of which the stream contributes ([\de.-]+) %"
)


@pytest.fixture(scope="module")
def waves():
    """A sheet with waves of several lengths, in 40 frames."""
    x, y = np.meshgrid(np.linspace(0, 1, 14), np.linspace(0, 1, 14))
    times = np.arange(40)[:, None, None] / 12
    z = sum(np.sin(k * (3 * x + 2 * y) - (k + 1) * times) / k**2 for k in range(1, 7)) / 8
    vertices = np.stack([x + 0 * z, y + 0 * z, z], axis=-1).reshape(40, -1, 3)
    corners = (np.arange(13) + 14 * np.arange(13)[:, None]).ravel()
    faces = np.concatenate([np.add.outer(corners, one) for one in ([0, 1, 15], [0, 15, 14])])
    return MeshSequence(vertices.astype(np.float32), faces, 24.0, "sheet")


@pytest.fixture(scope="module")
def stream_path(waves, tmp_path_factory):
    """A stream of the sheet with an error guarantee."""
    path = tmp_path_factory.mktemp("budget") / "waves.reel"
    path.write_bytes(meshreel.encode(waves, max_error=GUARANTEE))
    return path


def write_frames(reel, path, frames=None, **options):
    """Write frames of a stream, and return the positions in the file and the notes."""
    notes = []
    wanted = range(reel.n_frames) if frames is None else frames
    plain = WriteOptions(**options, compression=False)  # keeps the order of vertices
    save_part(reel, wanted, path, options=plain, notes=notes)
    return Glb.read(path.read_bytes()).world("sheet"), notes


def stated(notes):
    [result] = [result for note in notes if (result := AGAINST_THE_ORIGINAL.fullmatch(note))]
    return float(result[1]), float(result[2])


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"max_error": 0.2}, {"max_error": 0.12}, {"targets": 5}])
def test_stated_error_against_the_original_holds(waves, stream_path, tmp_path, options):
    with meshreel.open(stream_path) as reel:
        positions, notes = write_frames(reel, tmp_path / "a.glb", **options)
    total, of_stream = stated(notes)
    measured = largest_error_percent(waves, positions)
    assert of_stream == GUARANTEE
    assert measured <= total <= options.get("max_error", math.inf)


@pytest.mark.slow
def test_targets_use_the_rest_of_a_total_bound(stream_path, tmp_path):
    counts = {}
    with meshreel.open(stream_path) as reel:
        for bound in (0.11, 0.2, 0.4):
            notes = write_frames(reel, tmp_path / f"{bound}.glb", max_error=bound)[1]
            match = re.search(
                r"the largest error added is ([\d.]+) % .* with (\d+) morph", " ".join(notes)
            )
            assert float(match[1]) <= bound - GUARANTEE
            counts[bound] = int(match[2])
    assert counts[0.11] > counts[0.2] > counts[0.4]


@pytest.mark.parametrize("bound", [0.05, 0.1])
def test_bound_below_the_error_of_the_stream_is_rejected(stream_path, tmp_path, bound):
    with (
        meshreel.open(stream_path) as reel,
        pytest.raises(
            InvalidInputError,
            match=rf"max_error {bound} % leaves nothing .* error of up to 0\.1 % of the diagonal",
        ),
    ):
        save(reel, tmp_path / "a.glb", options=WriteOptions(max_error=bound))
    assert list(tmp_path.iterdir()) == []


def test_part_with_a_smaller_box_keeps_the_bound(waves, stream_path, tmp_path):
    with meshreel.open(stream_path) as reel:
        positions, notes = write_frames(reel, tmp_path / "a.glb", range(3, 9), max_error=0.3)
    kept = waves.vertices[3:9].astype(np.float64)
    error = np.linalg.norm(positions - kept, axis=2).max()
    box = np.ptp(waves.vertices.astype(np.float64), axis=(0, 1))
    assert 100 * error / np.linalg.norm(box) <= stated(notes)[0] <= 0.3


@pytest.mark.parametrize(("options", "n_modes"), [({"quality": 70}, None), ({"max_error": 0.1}, 2)])
def test_note_says_that_a_stream_without_guarantee_limits_only_added_errors(
    waves, tmp_path, options, n_modes
):
    path = tmp_path / "a.reel"
    path.write_bytes(meshreel.encode(waves, **options))
    with meshreel.open(path, n_modes=n_modes) as reel:
        notes = write_frames(reel, tmp_path / "a.glb")[1]
    start = "errors are measured against the decoded animation, since the stream guarantees none"
    assert any(note.startswith(start) for note in notes)


def test_notes_on_an_original_do_not_mention_streams(waves, tmp_path, notes):
    save(waves, tmp_path / "a.glb", notes=notes)
    assert not any("original" in note or "stream" in note for note in notes)
    assert notes[0].startswith("the largest error is ")


def test_total_error_is_stated_for_a_static_mesh(waves, stream_path, tmp_path):
    with meshreel.open(stream_path) as reel:
        positions, notes = write_frames(reel, tmp_path / "a.glb", max_error=60.0)
    assert notes[0] == "no vertex moves by more than the error bound: written as a static mesh"
    assert largest_error_percent(waves, positions) <= stated(notes)[0] <= 60


def budget_of(diagonal, origin, max_error=None):
    """Return the budget of frames in a box with this diagonal; 0.5 % may be added by default."""
    options, high = WriteOptions(origin=origin, max_error=max_error), np.array([diagonal, 0, 0])
    return requested_budget(np.zeros(3), high, options, 0.5, consumer="morph targets")[1]


@pytest.mark.parametrize("diagonal", [2.0, 2.002, 1.0])
def test_budget_is_relative_to_the_smaller_diagonal(diagonal):
    budget = budget_of(diagonal, Origin(0.002, 2.0), max_error=0.5)
    smaller = min(diagonal, 2.0)
    assert budget.diagonal == smaller
    assert budget.added == pytest.approx(0.005 * smaller - 0.002, rel=1e-3)
    assert budget.added < 0.005 * smaller - 0.002


def test_budget_exists_if_all_frames_are_one_point():
    budget = budget_of(0.0, Origin(0.001, 2.0), max_error=0.5)
    assert 0 < budget.added < 0.009


@pytest.mark.parametrize("total", [0.2, 0.1999999, 0.123456, 1e-7, 37.00001])
def test_stated_total_is_never_rounded_down(total):
    budget = budget_of(100.0, Origin(0.0, 100.0))
    [note] = budget.describe(total)
    assert total <= float(AGAINST_THE_ORIGINAL.fullmatch(note)[1]) <= 1.002 * total + 5e-5
