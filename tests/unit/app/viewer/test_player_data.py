"""Data that the player page requests, and its comparison with the original."""

import json
from io import BytesIO

import numpy as np
import pytest

from conformance.sources import boxes, of_type, shuffled_cells, waving
from meshreel.app.viewer import playable
from meshreel.app.viewer.measuring import PAGE_HEATS, Comparison, Measuring
from meshreel.app.viewer.original import Original
from meshreel.app.viewer.player_data import PlayerData
from meshreel.app.viewer.server import answer_of
from meshreel.app.viewer.track_comparison import TrackComparison
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import ConnectivityChangeError, CorruptStreamError, InvalidInputError
from meshreel.metrics.compare import compare
from meshreel.metrics.heat import HEATS
from meshreel.model.sequence import MeshSequence, concatenate
from meshreel.model.surface import Surface
from meshreel.model.tracks import Track
from meshreel.rendering.looks import TrackLook
from samples.meshes import irregular_sequence, quad_sheet, waving_grid
from samples.players import opened_api

KEYS = ["name", "rows", "budget", "original", "colored_by", "texture"]


def get_json(api, path):
    answer = answer_of(api, path)
    assert answer.content_type == "application/json"
    return json.loads(answer.body)


def test_facts_describe_the_file():
    with opened_api(quad_sheet(6)) as api:
        facts = get_json(api, "api/facts")
        info = api.reel.info()
    assert list(facts) == KEYS
    assert facts["name"] == "sheet"
    assert facts["rows"] == [["size", "6 kB"]]
    assert sum(size for _, size in facts["budget"]) == info.size_bytes
    assert facts["original"] is None


def test_name_is_that_of_the_file_when_the_stream_has_no_name():
    with opened_api(waving_grid(3).replace(name="")) as api:
        assert get_json(api, "api/facts")["name"] == "file"


def test_frames_of_the_original_are_answered_when_there_is_one():
    grid = waving_grid(5)
    with opened_api(grid, grid, encoding={"quality": 40}) as api:
        facts = get_json(api, "api/facts")
        positions = np.frombuffer(answer_of(api, "api/original/3").body, "<f4").reshape(-1, 3)
        center = np.array(api.reel.frame.origin)
    np.testing.assert_allclose(positions + center, grid.vertices[3], atol=1e-6)
    assert [heat["kind"] for heat in facts["original"]["heats"]] == ["distance", "angle"]
    assert (facts["original"]["plots"], facts["original"]["rows"]) == ([], [])


@pytest.mark.parametrize("method", ["pca-qp", "lossless"])
def test_stream_is_reencoded_when_its_method_is_unsupported_or_it_is_too_long(method, monkeypatch):
    monkeypatch.setattr(playable, "MAX_EXACT_POSITIONS", 4 * 99 - 1)
    grid = waving_grid(4)
    far = MeshSequence(grid.vertices + np.float32(3e4), grid.faces, grid.fps)
    grid = far if method == "lossless" else grid
    with opened_api(grid, encoding={"method": method}) as api:
        assert api.is_reencoded
        assert api.reel.info().method == "reel"
        facts = get_json(api, "api/facts")
        decoded = decode(encode(grid, method))
        error = np.linalg.norm(api.reel[:].vertices - decoded.vertices, axis=2).max()
        assert error < 1.01e-5 * api.reel.frame.scale
    assert "re-encoded as reel" in dict(facts["rows"])["shown"]


def test_plots_cover_all_frames_when_all_are_measured():
    grid = waving_grid(5)
    options = {"encoding": {"quality": 40}, "measured_rows": lambda measured: {"KG": "1 %"}}
    with opened_api(grid, grid, **options) as api:
        assert get_json(api, "api/plots")["ready"] is False
        api.measuring.run()
        facts = get_json(api, "api/plots")
        assert get_json(api, "api/facts")["original"]["plots"] == facts["plots"]
    assert (facts["ready"], facts["share"], facts["error"]) == (True, 1.0, "")
    assert facts["rows"] == [["KG", "1 %"]]
    assert [len(plot["values"]) for plot in facts["plots"]] == [5, 5]


def test_worst_frame_has_the_largest_error_when_all_are_measured():
    grid = waving_grid(5, dtype=np.float64)
    other = grid.vertices.copy()
    other[3, 7] += 0.3
    with opened_api(grid, grid.replace(vertices=other), encoding={"step": 1e-6}) as api:
        assert get_json(api, "api/plots")["worst_frame"] is None
        api.measuring.run()
        assert get_json(api, "api/plots")["worst_frame"] == 3
        assert get_json(api, "api/facts")["original"]["worst_frame"] == 3


@pytest.mark.parametrize(
    "path",
    [
        "", "api", "api/", "api/original", "api/original/", "api/original/-1",
        "api/original/0x0", "api/original/99999999999999999999", "api/original/\u0660",
        "api/facts/", "/api/facts", "API/facts", "api/original/0/", "api/original/5",
        "api/../page", "api/original/0\n",
    ],
)  # fmt: skip
def test_answer_is_none_when_the_path_is_unknown(path):
    grid = waving_grid(5)
    with opened_api(grid, grid) as api:
        assert answer_of(api, path) is None


@pytest.mark.parametrize("path", ["api/original/0", "api/plots"])
def test_answer_is_none_for_an_original_when_there_is_none(path):
    with opened_api(waving_grid(2)) as api:
        assert answer_of(api, path) is None


@pytest.mark.parametrize("size", [1e-200, 1e200])
def test_model_is_rejected_when_it_is_too_large_or_small_to_draw(size):
    grid = waving_grid(2, dtype=np.float64)
    data = encode(MeshSequence(grid.vertices * size, grid.faces))
    with pytest.raises(InvalidInputError, match="player draws from 1e-30 to 1e\\+30: scale"):
        opened_api(None, data=data).__enter__()


def test_json_contains_null_for_numbers_that_are_not_finite():
    with opened_api(waving_grid(2)) as api:
        api._budget = {"none": np.nan, "infinite": np.inf, "one": 1.5}
        facts = get_json(api, "api/facts")
    assert facts["budget"] == [["none", None], ["infinite", None], ["one", 1.5]]


def with_tracks(grid):
    """Return the grid with a vertex track, a face track and an exact integer track."""
    height = grid.vertices[:, :, 2].astype(np.float32)
    heat = grid.vertices[:, grid.faces, 0].mean(axis=2).astype(np.float32)
    tracks = {
        "height": Track(height, unit="m"),
        "heat": Track(heat, domain="face"),
        "part": Track((9 * height).astype(np.int32)),
    }
    return grid.replace(tracks=tracks)


def test_facts_contain_the_look_of_the_initial_track():
    grid = with_tracks(waving_grid(4))
    with opened_api(grid, look=TrackLook("height", range="0:1")) as api:
        expected = {"track": "height", "component": None, "range": "0:1", "colormap": None}
        assert get_json(api, "api/facts")["colored_by"] == expected
    with opened_api(grid) as api:
        assert get_json(api, "api/facts")["colored_by"] is None
    unknown = pytest.raises(InvalidInputError, match="no track 'hight'; did you mean 'height'")
    with unknown, opened_api(grid, look=TrackLook("hight")):
        pass


def test_facts_contain_tracks_of_the_original_when_there_is_one():
    grid = with_tracks(waving_grid(4))
    with opened_api(grid, grid, encoding={"tracks": {"height": "5%", "heat": "3%"}}) as api:
        facts = get_json(api, "api/facts")["original"]
        bound = api.reel.track("height").error_bound
        values = [
            np.frombuffer(
                answer_of(api, f"api/original_track/{i}/2").body, "<f8" if i == 2 else "<f4"
            )
            for i in range(3)
        ]
        assert answer_of(api, "api/original_track/3/0") is None
        assert answer_of(api, "api/original_track/0/4") is None
    assert facts["tracks"] == ["height", "heat", "part"]
    assert [heat["kind"] for heat in facts["track_heats"]] == ["track 0", "track 1"]
    assert [heat["track"] for heat in facts["track_heats"]] == ["height", "heat"]
    first = facts["track_heats"][0]
    assert first["label"].startswith("error of height, up to ")
    assert (first["unit"], first["range"]) == ("m", bound)
    for name, answer in zip(facts["tracks"], values, strict=True):
        np.testing.assert_array_equal(answer, grid.tracks[name].values[2].ravel())


def test_tracks_of_the_original_have_the_decoded_vertex_order_when_the_order_is_dropped():
    grid = with_tracks(waving_grid(4)).replace(tracks={})
    height = Track(grid.vertices[:, :, 2].astype(np.float32))
    grid = grid.replace(tracks={"height": height})
    with opened_api(grid, grid, encoding={"order": "drop"}) as api:
        original = np.frombuffer(answer_of(api, "api/original_track/0/3").body, "<f4")
        errors = np.abs(original - api.reel.track("height")[3].ravel())
        bound = api.reel.track("height").error_bound
    assert 0 < errors.max() <= bound


def test_original_of_cells_has_their_decoded_order_when_the_order_is_dropped(opened):
    points, hexahedra = shuffled_cells(*boxes(4, 3, 3))
    vertices = waving(points)
    stress = Track(vertices[:, hexahedra].mean(axis=2)[..., 0], "cell")
    given = MeshSequence(vertices, cells=of_type(12, hexahedra), tracks={"stress": stress})
    reel = opened(encode(given, order="drop", max_error="0.1%"))
    original = Original(given, reel)
    for number in range(given.n_frames):
        decoded = reel[number].vertices
        assert np.abs(original.frame(number) - decoded).max() <= 0.001 * reel.frame.scale
        [values] = reel.tracks["stress"].read(number, number + 1)
        errors = np.abs(original.values("stress", number) - values)
        assert errors.max() <= reel.tracks["stress"].error_bound


def test_tracks_are_not_compared_when_their_kinds_differ():
    grid = with_tracks(waving_grid(4))
    height = grid.tracks["height"].values
    others = {"height": Track(height, kind="other"), "heat": height, "part": height}
    with opened_api(grid, grid.replace(tracks=others)) as api:
        facts = get_json(api, "api/facts")["original"]
        assert (facts["tracks"], facts["track_heats"]) == ([], [])
        assert answer_of(api, "api/original_track/0/0") is None


@pytest.mark.parametrize("encoding", [{"method": "lossless"}, {"method": "grid", "max_error": 1}])
def test_stream_is_played_unchanged_when_its_positions_are_exact(encoding):
    grid = waving_grid(4)
    data = encode(grid, **encoding)
    with opened_api(grid, data=data) as api:
        assert not api.is_reencoded
        assert api.reel.stored(0, api.reel.size_bytes) == data
        facts = get_json(api, "api/facts")
    assert "shown" not in dict(facts["rows"])


def test_tracks_of_a_lossless_file_are_exact_when_it_is_reencoded(monkeypatch):
    monkeypatch.setattr(playable, "MAX_EXACT_POSITIONS", 0)
    grid = with_tracks(waving_grid(4))
    with opened_api(grid, encoding={"lossless": True}, look=TrackLook("heat")) as api:
        assert api.is_reencoded
        for name, track in grid.tracks.items():
            np.testing.assert_array_equal(api.reel.track(name).read(0, 4), track.values)


@pytest.fixture
def segmented():
    grid, sheet = waving_grid(6).replace(fps=24.0), quad_sheet(4)
    data = encode(concatenate([grid, sheet]))
    with ReelFile(BytesIO(data)) as file:
        yield file, data


def test_facts_describe_all_segments(segmented):
    file, _ = segmented
    facts = PlayerData(file, "two", lambda info: {"frames": str(info.n_frames)}).facts()
    assert list(facts) == KEYS
    assert facts["rows"] == [["frames", "10"]]


def test_stored_bytes_are_those_of_all_segments(segmented):
    file, data = segmented
    api = PlayerData(file, "two", lambda _: {})
    assert api.file.stored(0, api.file.size_bytes) == data
    assert api.file.stored(5, 9) == data[5:9]
    assert api.file.stored(len(data) - 2, len(data) + 7) == data[-2:]


def test_several_segments_cannot_be_colored_by_a_track(segmented):
    file, _ = segmented
    with pytest.raises(ConnectivityChangeError, match="coloring by a track in the player needs"):
        PlayerData(file, "two", lambda _: {}, look=TrackLook("heat"))


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
    first = {heat["kind"]: heat for heat in measuring.figures.heat_maps()}
    measuring.run()
    heats = {heat["kind"]: heat for heat in measuring.figures.heat_maps()}
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


def test_values_of_faces_are_in_the_order_of_the_file(opened):
    grid = waving_grid(2)
    ids = Track(np.tile(np.arange(grid.n_faces), (2, 1)), "face")
    sequence = grid.replace(tracks={"id": ids}, surface=Surface(is_ordered=False))
    reel = opened(encode(sequence))
    values = Original(sequence, reel).values("id", 1)
    assert np.array_equal(values, reel.tracks["id"].read(1, 2)[0])
    assert not np.array_equal(values, ids[1])


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
    [heat] = TrackComparison(reel, original).heat_maps()
    is_sampled = place[0] in (0, 5, 11)
    assert heat["maximum"] == pytest.approx(7.0 if is_sampled else 0.0, abs=0.02)
    assert (heat["label"], heat["unit"]) == ("error of heat", "K")
