"""Comparison of a file and its original: vertex matching and errors."""

from io import BytesIO

import numpy as np
import pytest

from meshreel.app.viewer.measuring import PAGE_HEATS, Comparison, Measuring
from meshreel.app.viewer.original import Original
from meshreel.app.viewer.track_comparison import TrackComparison
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.metrics.compare import compare
from meshreel.metrics.heat import HEATS
from meshreel.model.sequence import MeshSequence
from meshreel.model.tracks import Track
from samples.meshes import irregular_sequence, waving_grid


def shuffled_grid(n_frames=6):
    """Return a sheet with shuffled vertices and faces."""
    grid, rng = waving_grid(n_frames, dtype=np.float64), np.random.default_rng(1)
    order = rng.permutation(grid.n_verts)
    return MeshSequence(grid.vertices[:, np.argsort(order)], rng.permutation(order[grid.faces]))


@pytest.fixture
def opened():
    """Function that opens a stream until the end of the test."""
    reels = []

    def open_stream(data):
        reels.append(ReelFile(BytesIO(data)))
        return reels[-1]

    yield open_stream
    for reel in reels:
        reel.close()


@pytest.mark.parametrize("order", ["keep", "vertices", "drop"])
def test_original_has_the_vertex_order_of_the_file(order, opened):
    sequence = shuffled_grid()
    reel = opened(encode(sequence, order=order, max_error=0.05))
    original, diagonal = Original(sequence, reel), reel.frame.scale
    errors = [np.abs(original.frame(n) - reel[n].vertices).max() for n in range(6)]
    assert max(errors) <= 0.0005 * diagonal


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda grid: waving_grid(7), "the original has 7 frames and the file 6"),
        (lambda grid: waving_grid(6, 8, 11), "the original has 88 vertices and the file 99"),
        (
            lambda grid: MeshSequence(grid.vertices, grid.faces[1:]),
            "the original has 159 faces and the file 160",
        ),
        (
            lambda grid: MeshSequence(grid.vertices, grid.faces[:, ::-1]),
            "is missing from the decoded faces|the original has other faces than the file",
        ),
    ],
)
@pytest.mark.parametrize("order", ["keep", "drop"])
def test_original_is_rejected_when_it_is_another_mesh(change, message, order, opened):
    grid = waving_grid(6)
    reel = opened(encode(grid, order=order))
    with pytest.raises(InvalidInputError, match=message):
        Original(change(grid), reel)


def test_original_may_be_longer_only_when_the_file_is_truncated(opened):
    sequence = irregular_sequence(11)
    data = encode(sequence, block_frames=4)
    assert opened(data[:-200]).n_frames == 8
    original = Original(sequence, opened(data[:-200]))
    np.testing.assert_array_equal(original.frame(7), sequence.vertices[7])
    with pytest.raises(InvalidInputError, match="the original has 8 frames and the file 11"):
        Original(sequence.replace(vertices=sequence.vertices[:8]), opened(data))


def test_measured_errors_equal_those_of_compare(opened):
    sequence = waving_grid(12)
    data = encode(sequence, quality=40)
    comparison = Comparison(opened(data), Original(sequence, opened(data)))
    measuring = Measuring(comparison)
    assert not measuring.is_ready
    measuring.run()
    assert measuring.is_ready
    expected, figures = compare(sequence, decode(data)), measuring.figures
    measured = figures.measured
    assert measured.errors.kg_error_percent == pytest.approx(expected.kg_error_percent)
    assert measured.errors.max_error_percent == pytest.approx(expected.max_error_percent)
    assert measured.errors.rms_error_percent == pytest.approx(expected.rms_error_percent)
    assert measured.sted_spatial == pytest.approx(expected.sted_spatial)
    np.testing.assert_allclose(figures.nmsve, expected.nmsve)
    assert max(figures.largest_percent) == pytest.approx(expected.max_error_percent)


def test_ranges_cover_all_frames_when_all_are_measured(opened):
    sequence = waving_grid(12)
    data = encode(sequence, quality=40)
    comparison = Comparison(opened(data), Original(sequence, opened(data)))
    measuring = Measuring(comparison)
    first = {heat["kind"]: heat for heat in measuring.figures.described_heats()}
    measuring.run()
    heats = {heat["kind"]: heat for heat in measuring.figures.described_heats()}
    assert list(heats) == list(PAGE_HEATS)
    for kind, heat in heats.items():
        values = [comparison.heat(kind, comparison.pair(number)) for number in range(12)]
        assert heat["maximum"] == np.max(values) >= first[kind]["maximum"]
        assert heat["range"] == pytest.approx(np.percentile(values, 99.5), rel=0.1)
        assert heat["range"] <= heat["maximum"]


def test_measuring_stores_the_error_when_a_block_is_damaged(opened, monkeypatch):
    sequence = waving_grid(12)
    data = encode(sequence, block_frames=4)
    reel = opened(data)
    measuring = Measuring(Comparison(reel, Original(sequence, reel)))

    def damaged(self, number):
        raise CorruptStreamError(f"frame {number} is damaged")

    monkeypatch.setattr(ReelFile, "__getitem__", damaged)
    measuring.start()
    measuring._thread.join()
    assert measuring.error == "frame 0 is damaged"
    assert not measuring.is_ready
    measuring.close()


def test_measuring_stops_immediately_when_closed(opened):
    sequence = waving_grid(12)
    reel = opened(encode(sequence))
    measuring = Measuring(Comparison(reel, Original(sequence, reel)))
    measuring.close()
    measuring.start()
    measuring.close()
    assert (measuring.share, measuring.error) == (0.0, "")


def test_heat_is_finite_when_the_model_is_a_point(opened):
    sequence = MeshSequence(np.zeros((3, 3, 3)), np.array([[0, 1, 2]]))
    reel = opened(encode(sequence))
    moved = sequence.replace(vertices=np.zeros((3, 3, 3)))
    comparison = Comparison(reel, Original(moved, reel))
    pair = comparison.pair(0)[0], comparison.pair(0)[1] + np.arange(3)
    for kind in HEATS:
        assert np.isfinite(comparison.heat(kind, pair)).all()


@pytest.mark.parametrize("place", [(0, 3), (5, 0), (11, 98)])
def test_errors_of_tracks_without_a_bound_are_sampled_up_to_both_ends(opened, place):
    grid = waving_grid(12)
    values = np.sin(np.arange(12 * 99.0)).reshape(12, 99)
    sequence = grid.replace(tracks={"heat": Track(values, unit="K")})
    reel = opened(encode(sequence, tracks={"heat": "1%"}))
    reel.tracks["heat"].error_bound = None  # as of a live recording
    values = values.copy()
    values[place] += 7.0
    original = Original(grid.replace(tracks={"heat": Track(values, unit="K")}), reel)
    [heat] = TrackComparison(reel, original).described()
    is_sampled = place[0] in (0, 5, 11)
    assert heat["maximum"] == pytest.approx(7.0 if is_sampled else 0.0, abs=0.02)
    assert (heat["label"], heat["unit"]) == ("error of heat", "K")
