"""What the page asks for, and what it is told."""

import json
from dataclasses import replace

import numpy as np
import pytest

from meshreel.codec.encoder import encode
from meshreel.errors import InvalidInputError
from meshreel.metrics.heat import HEATS
from meshreel.sequence import MeshSequence
from meshreel.surface import Attribute, Domain, Kind, Surface
from meshreel.viewer.api import vertex_colors
from samples.meshes import quad_sheet, waving_grid
from samples.packets import read_packet
from samples.players import opened_api

KEYS = [
    "name", "n_frames", "n_verts", "n_faces", "fps", "start_s", "origin", "low", "high",
    "swept", "diagonal", "up", "is_whole", "blocks", "rows", "budget", "original",
]  # fmt: skip


def asked(api, path):
    """The answer to a path, taken apart."""
    answer = api.answer(path)
    if answer.content_type == "application/json":
        return json.loads(answer.body)
    return read_packet(answer.body)


def test_reel_is_described_by_its_header_when_it_is_asked_for():
    sheet = quad_sheet(6)
    with opened_api(sheet) as api:
        told = asked(api, "api/reel")
        info = api.info
    assert list(told) == KEYS
    assert (told["name"], told["n_frames"], told["n_verts"]) == ("sheet", 6, 30)
    assert (told["n_faces"], told["fps"], told["is_whole"]) == (sheet.n_faces, 24.0, True)
    assert told["start_s"] == sheet.start_s
    assert told["blocks"] == [
        {
            "start": 0,
            "n_frames": 6,
            "n_modes": info.n_modes[0],
            "size_bytes": info.block_bytes[0],
        }
    ]
    assert told["rows"] == [["size", "6 kB"]]
    assert sum(size for _, size in told["budget"]) == info.size_bytes
    assert told["original"] is None


def test_name_is_that_of_the_file_when_the_stream_has_none():
    with opened_api(replace(waving_grid(3), name="")) as api:
        assert asked(api, "api/reel")["name"] == "file"


@pytest.mark.parametrize("block_frames", [None, 4])
def test_box_holds_all_frames_when_they_are_in_one_block_or_several(block_frames):
    grid = waving_grid(12, dtype=np.float64)
    with opened_api(grid, encoding={"block_frames": block_frames, "max_error": 0.01}) as api:
        told = asked(api, "api/reel")
        low, high = np.array(told["low"]), np.array(told["high"])
    slack = 0.001 * told["diagonal"] if block_frames is None else 0.1 * told["diagonal"]
    np.testing.assert_allclose(low, grid.vertices.min(axis=(0, 1)), atol=slack)
    np.testing.assert_allclose(high, grid.vertices.max(axis=(0, 1)), atol=slack)
    assert np.linalg.norm(high - low) == pytest.approx(told["diagonal"], rel=0.01)


def test_swept_points_are_the_outermost_of_all_frames_when_there_is_one_block():
    grid = waving_grid(12, dtype=np.float64)
    with opened_api(grid, encoding={"max_error": 0.01}) as api:
        told = asked(api, "api/reel")
    swept = np.array(told["swept"]) + told["origin"]
    for direction in ([1, 0, 0], [0, -1, 0], [1, 1, 0], [-1, 1, 1], [1, -1, 1]):
        farthest = (grid.vertices @ direction).max()
        assert (swept @ direction).max() == pytest.approx(farthest, abs=1e-3 * told["diagonal"])


def test_swept_points_are_of_what_is_drawn_when_a_vertex_has_no_face():
    grid = waving_grid(3, dtype=np.float64)
    away = np.full((3, 1, 3), 50.0)
    lonely = replace(grid, vertices=np.concatenate([grid.vertices, away], axis=1))
    with opened_api(lonely, encoding={"step": 1e-6}) as api:
        told = asked(api, "api/reel")
    swept = np.array(told["swept"]) + told["origin"]
    assert swept.max() < 1.1 * grid.vertices.max()


def test_faces_are_those_decoded_when_they_are_asked_for():
    sheet = quad_sheet(2)
    with opened_api(sheet) as api:
        _, arrays = asked(api, "api/faces")
    np.testing.assert_array_equal(arrays["faces"], sheet.faces)
    np.testing.assert_array_equal(arrays["colors"], sheet.surface.attributes[1].values)
    with opened_api(waving_grid(2)) as api:
        assert list(asked(api, "api/faces")[1]) == ["faces"]


def test_vertex_colors_are_bytes_when_they_were_shares():
    values = np.array([[0, 0.5, 1], [2, -1, np.nan]])
    color = Attribute("c", Kind.COLOR, Domain.VERTEX, values)
    found = vertex_colors(Surface(attributes=(color,)))
    np.testing.assert_array_equal(found, [[0, 128, 255], [255, 0, 0]])
    at_corners = replace(color, domain=Domain.CORNER)
    assert vertex_colors(Surface(attributes=(at_corners,))) is None


def test_original_and_heats_are_told_frame_by_frame_when_there_is_one():
    grid = waving_grid(5)
    with opened_api(grid, grid, encoding={"quality": 40}) as api:
        told = asked(api, "api/reel")
        _, original = asked(api, "api/original/3")
        heats = {kind: asked(api, f"api/heat/{kind}/3")[1]["values"] for kind in HEATS}
        pair = api.comparison.pair(3)
        expected = {kind: api.comparison.heat(kind, pair) for kind in HEATS}
    positions = original["positions"] + np.array(told["origin"])
    np.testing.assert_allclose(positions, grid.vertices[3], atol=1e-6)
    for kind, values in heats.items():
        np.testing.assert_allclose(values, expected[kind], rtol=1e-6)
    assert told["original"]["name"] == "grid"
    assert [heat["kind"] for heat in told["original"]["heats"]] == list(HEATS)
    assert (told["original"]["plots"], told["original"]["rows"]) == ([], [])


def test_plots_are_told_when_all_frames_are_measured():
    grid = waving_grid(5)
    options = {"encoding": {"quality": 40}, "measured_rows": lambda measured: {"KG": "1 %"}}
    with opened_api(grid, grid, **options) as api:
        assert asked(api, "api/plots")["ready"] is False
        api.measuring.run()
        told = asked(api, "api/plots")
        assert asked(api, "api/reel")["original"]["plots"] == told["plots"]
    assert (told["ready"], told["share"], told["error"]) == (True, 1.0, "")
    assert told["rows"] == [["KG", "1 %"]]
    assert [len(plot["values"]) for plot in told["plots"]] == [5, 5]


def test_worst_frame_is_that_of_the_largest_error_when_all_are_measured():
    grid = waving_grid(5, dtype=np.float64)
    other = grid.vertices.copy()
    other[3, 7] += 0.3
    with opened_api(grid, replace(grid, vertices=other), encoding={"step": 1e-6}) as api:
        assert asked(api, "api/plots")["worst_frame"] is None
        api.measuring.run()
        assert asked(api, "api/plots")["worst_frame"] == 3
        assert asked(api, "api/reel")["original"]["worst_frame"] == 3


def test_heat_is_computed_once_when_it_is_asked_for_twice(monkeypatch):
    grid = waving_grid(3)
    with opened_api(grid, grid) as api:
        first = api.answer("api/heat/sted/1")
        monkeypatch.setattr(type(api.comparison), "pair", None)
        assert api.answer("api/heat/sted/1").body is first.body


@pytest.mark.parametrize(
    "path",
    [
        "", "api", "api/", "api/block", "api/block/", "api/block/1", "api/block/-1",
        "api/block/0x0", "api/block/99999999999999999999", "api/block/\u0660", "api/reel/",
        "/api/reel", "API/reel", "api/block/0/", "api/original/5",
        "api/heat/fire/0", "api/heat/sted/5", "api/heat/sted", "api/../page", "api/block/0\n",
    ],
)  # fmt: skip
def test_nothing_is_told_when_the_path_names_nothing(path):
    grid = waving_grid(5)
    with opened_api(grid, grid) as api:
        assert api.answer(path) is None


@pytest.mark.parametrize("path", ["api/original/0", "api/heat/sted/0", "api/plots"])
def test_nothing_is_told_of_an_original_when_there_is_none(path):
    with opened_api(waving_grid(2)) as api:
        assert api.answer(path) is None


@pytest.mark.parametrize("size", [1e-200, 1e200])
def test_a_model_is_refused_when_it_cannot_be_drawn(size):
    grid = waving_grid(2, dtype=np.float64)
    data = encode(MeshSequence(grid.vertices * size, grid.faces))
    with pytest.raises(InvalidInputError, match="player draws from 1e-30 to 1e\\+30: scale it"):
        opened_api(None, data=data).__enter__()


def test_json_has_null_when_a_number_is_not_finite():
    with opened_api(waving_grid(2)) as api:
        nothing, everything = np.full(3, np.nan), np.full(3, np.inf)
        api._reach = replace(api._reach, low=nothing, high=everything)
        told = asked(api, "api/reel")
    assert (told["low"], told["high"]) == ([None] * 3, [None] * 3)
