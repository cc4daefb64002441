"""Each layout, written to files and played as its program's shader plays it."""

import json

import numpy as np
import pytest
from scipy.spatial import cKDTree

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.formats.options import WriteOptions
from meshreel.formats.vat.grid import fit_grid
from meshreel.formats.vat.labs import coded_box
from meshreel.model.geometry.normals import vertex_normals
from meshreel.model.sequence import MeshSequence
from samples.meshes import irregular_sequence, quad_sheet, waving_grid
from samples.vat_player import PLAYERS, read_glb

LAYOUTS = list(PLAYERS)
BIG = pytest.param(65_537, 2, marks=pytest.mark.slow)
ERROR = 0.1
"""Percent of the diagonal."""


def strip(n_verts, n_frames, *, shift=0.0, dtype=np.float32):
    """A strip of triangles that waves, of any number of vertices."""
    rng = np.random.default_rng(n_verts)
    rest = rng.random((n_verts, 3))
    way = np.sin(np.arange(n_frames) / 3)[:, None, None] * rng.normal(size=(n_verts, 3)) / 4
    if n_verts < 3:
        faces = np.zeros((1, 3), np.int32)
        faces[0, 1:] = n_verts - 1
    else:
        faces = (np.arange(n_verts - 2)[:, None] + np.arange(3)).astype(np.int32)
    return MeshSequence((rest + way + shift).astype(dtype), faces, 24.0, "strip")


def saved(sequence, folder, **options):
    notes = []
    meshreel.save(sequence, folder, options=WriteOptions(**options), notes=notes)
    return notes


def rows_of(player, vertices):
    """Which vertex of the sequence each vertex of the mesh is, found by where it is at rest."""
    distances, rows = cKDTree(vertices).query(player.rest[~player.is_hidden])
    assert distances.max() <= 1e-6 * np.abs(vertices).max()
    return rows


def largest_error(sequence, folder, layout):
    """The largest distance of any vertex of any frame as it is played, in model units."""
    player = PLAYERS[layout](folder)
    assert player.n_frames >= sequence.n_frames
    rows = rows_of(player, sequence.vertices[0] - player.shift)
    used = np.unique(sequence.faces)
    assert set(rows) == set(used)
    found = []
    for frame in range(sequence.n_frames):
        played = player.positions(frame)[~player.is_hidden]
        found.append(np.linalg.norm(played + player.shift - sequence.vertices[frame][rows], axis=1))
    return max(one.max() for one in found)


def diagonal(sequence):
    extent = sequence.extent
    return float(np.linalg.norm(extent.high - extent.low))


@pytest.mark.parametrize("textures", ["exr", "png"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_sheet_is_played_within_the_error_and_with_its_normals(tmp_path, layout, textures):
    sequence = waving_grid()
    notes = saved(sequence, tmp_path / "a.vat", layout=layout, textures=textures, max_error=ERROR)
    assert largest_error(sequence, tmp_path / "a.vat", layout) <= ERROR / 100 * diagonal(sequence)
    player = PLAYERS[layout](tmp_path / "a.vat")
    rows = rows_of(player, sequence.vertices[0])
    told = next(float(one.split()[4]) for one in notes if one.startswith("normals are off by"))
    for frame in range(sequence.n_frames):
        expected = vertex_normals(sequence.vertices[frame], sequence.faces)[rows]
        found = player.normals(frame)[~player.is_hidden].astype(float)
        found /= np.linalg.norm(found, axis=1, keepdims=True)
        angle = np.degrees(np.arccos(np.clip((found * expected).sum(axis=1), -1, 1))).max()
        assert angle <= 1.1 * told + 0.05  # the note rounds; the cosine is coarse near 1


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(
    ("n_verts", "n_frames"),
    [(1, 3), (2, 1), (3, 300), (8192, 2), (8193, 1), (8193, 3), BIG],
)
def test_every_vertex_has_its_texel_when_counts_are_awkward(tmp_path, layout, n_verts, n_frames):
    sequence = strip(n_verts, n_frames)
    saved(sequence, tmp_path / "a.vat", layout=layout, max_error=ERROR, normals=False)
    assert largest_error(sequence, tmp_path / "a.vat", layout) <= ERROR / 100 * diagonal(sequence)


def test_box_tells_of_hundreds_of_rows():
    """Rows of hundreds are told apart from what else the same decimals say."""
    for n_rows in (1, 99, 100, 101, 950, 1000, 1900, 1980):
        low, high = coded_box(np.zeros(3), np.ones(3), n_rows, is_raw=True, rows_matter=True)
        code = round(100 * float(high[2] * np.float32(10) % 1))
        hundreds = 0 if code % 25 == 0 or code % 10 == 0 else code % 50
        rest = round(100 * float(np.ceil(low[1] * 10) - low[1] * 10))
        assert 100 * (hundreds - hundreds // 10) + rest == n_rows
        assert code >= 50


def test_box_is_refused_where_float32_has_no_decimals():
    with pytest.raises(InvalidInputError, match="take layout 'openvat'"):
        coded_box(np.full(3, 2e7), np.full(3, 2.1e7), 3, is_raw=True, rows_matter=True)


@pytest.mark.parametrize("textures", ["exr", "png"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_sequence_that_is_flat_or_still_is_played(tmp_path, layout, textures):
    grid = waving_grid()
    flat = MeshSequence(grid.vertices * np.float32([1, 1, 0]), grid.faces, 25.0, "flat")
    saved(flat, tmp_path / "a.vat", layout=layout, textures=textures)
    assert largest_error(flat, tmp_path / "a.vat", layout) <= ERROR / 100 * diagonal(flat)
    still = MeshSequence(np.repeat(grid.vertices[:1], 5, axis=0), grid.faces, 25.0, "still")
    saved(still, tmp_path / "b.vat", layout=layout, textures=textures)
    assert largest_error(still, tmp_path / "b.vat", layout) <= 1e-3 * diagonal(still)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_mesh_far_from_the_origin_is_put_there_by_its_node(tmp_path, layout):
    sequence = strip(40, 5, shift=np.array([1e6, -2e6, 3e5]), dtype=np.float64)
    notes = saved(sequence, tmp_path / "a.vat", layout=layout, max_error=0.05)
    assert any("around its own middle" in one for one in notes)
    player = PLAYERS[layout](tmp_path / "a.vat")
    assert player.shift.any()
    # Where two vertices are at rest cannot be told apart from the outside: order decides.
    shown = ~player.is_hidden
    order = np.argsort(player.u[shown])
    for frame in range(5):
        played = player.positions(frame)[shown][order] + player.shift
        far = np.linalg.norm(played - sequence.vertices[frame], axis=1)
        assert far.max() <= 0.05 / 100 * diagonal(sequence)


def test_near_mesh_stays_where_it_is(tmp_path):
    saved(strip(40, 5, shift=100.0), tmp_path / "a.vat")
    assert "translation" not in PLAYERS["openvat"](tmp_path / "a.vat").node


@pytest.mark.parametrize(
    ("textures", "max_error", "expected"),
    [
        ("png", 1.0, np.uint8),
        ("png", 0.01, np.uint16),
        ("exr", 0.1, np.float16),
        ("exr", 0.001, np.float32),
    ],
)
def test_max_error_chooses_the_smallest_texels(tmp_path, textures, max_error, expected):
    sequence = waving_grid()
    saved(sequence, tmp_path / "a.vat", textures=textures, max_error=max_error)
    player = PLAYERS["openvat"](tmp_path / "a.vat")
    assert player.image.dtype == expected
    found = largest_error(sequence, tmp_path / "a.vat", "openvat")
    assert found <= max_error / 100 * diagonal(sequence)


def test_error_that_no_texels_keep_is_refused_and_nothing_is_written(tmp_path):
    with pytest.raises(InvalidInputError, match=r"16-bit PNG is off by .* or take textures 'exr'"):
        saved(waving_grid(), tmp_path / "a.vat", textures="png", max_error=1e-5)
    assert not (tmp_path / "a.vat").exists()


def test_note_says_what_the_files_achieve(tmp_path):
    sequence = waving_grid()
    notes = saved(sequence, tmp_path / "a.vat", textures="png", max_error=0.5)
    [told] = [one for one in notes if one.startswith("the largest error is")]
    percent = 100 * largest_error(sequence, tmp_path / "a.vat", "openvat") / diagonal(sequence)
    assert float(told.split()[4]) == pytest.approx(percent, rel=0.01)
    assert told.endswith("as read back from 8-bit PNG")
    [video] = [one for one in notes if "video memory" in one]
    assert video == "1 texture of 99 x 24 texels: 0.0095 MB of video memory"


def test_vertices_split_at_seams_share_a_texel_and_isolated_ones_have_none(tmp_path):
    sheet = quad_sheet()
    notes = saved(sheet, tmp_path / "a.vat")
    mesh, triangles, _ = read_glb(tmp_path / "a.vat" / "a.glb")
    assert len(mesh["POSITION"]) > 30
    assert len(np.unique(mesh["TEXCOORD_1"], axis=0)) == 30
    assert len(triangles) == len(sheet.faces)
    assert any("begins at 0 s" in one for one in notes)
    odd = irregular_sequence()
    notes = saved(odd, tmp_path / "b.vat")
    assert "left out 2 vertices that no face uses" in notes
    assert largest_error(odd, tmp_path / "b.vat", "openvat") <= 1e-3 * diagonal(odd)


@pytest.mark.parametrize("layout", ["labs", "labs-unreal"])
def test_mesh_of_labs_fills_the_box_that_shaders_read(tmp_path, layout):
    sequence = waving_grid()
    saved(sequence, tmp_path / "a.vat", layout=layout)
    mesh, triangles, _ = read_glb(tmp_path / "a.vat" / "a_mesh.glb")
    [about] = json.loads((tmp_path / "a.vat" / "a_data.json").read_text("utf-8"))
    scale = 100 if layout == "labs-unreal" else 1
    order = [0, 2, 1] if layout == "labs-unreal" else [0, 1, 2]
    for which, corner in (("Min", mesh["POSITION"].min(0)), ("Max", mesh["POSITION"].max(0))):
        told = [about[f"Bound {which} {axis}"] for axis in "XYZ"]
        np.testing.assert_allclose(told, scale * corner[order], rtol=1e-6)
    assert (mesh["TEXCOORD_1"][-6:] == (0, 1)).all()
    assert len(triangles) == len(sequence.faces) + 2


def test_single_frame_of_several_rows_is_there_twice(tmp_path):
    notes = saved(strip(8193, 1), tmp_path / "a.vat", layout="labs", normals=False)
    assert any(one.startswith("the frame is there twice") for one in notes)
    [about] = json.loads((tmp_path / "a.vat" / "a_data.json").read_text("utf-8"))
    assert about["Frame Count"] == 2


def test_json_of_openvat_is_what_its_importers_read(tmp_path):
    sequence = waving_grid()
    saved(sequence, tmp_path / "a.vat")
    data = json.loads((tmp_path / "a.vat" / "a-remap_info.json").read_text("utf-8"))
    assert data["os-remap"]["Frames"] == 12
    offsets = sequence.vertices.astype(float) - sequence.vertices[0]
    blender = offsets[..., [0, 2, 1]] * [1, -1, 1]
    np.testing.assert_allclose(data["os-remap"]["Min"], blender.min((0, 1)), atol=1e-7)
    np.testing.assert_allclose(data["os-remap"]["Max"], blender.max((0, 1)), atol=1e-7)
    expected = {"startFrame": 1, "endFrame": 12, "framerate": 25, "looping": True}
    assert data["animations"] == {"grid": expected}


def test_too_many_rows_for_a_texture_are_refused():
    with pytest.raises(InvalidInputError, match="GPUs hold 16384 rows; take fewer frames"):
        fit_grid(6, 9000, frame_by_frame=False, n_halves=2)
    assert fit_grid(6, 9000, frame_by_frame=False).height == 9000
    assert fit_grid(65_537, 1000, frame_by_frame=True).n_rows == 5  # nine would be 9,000 in all


def test_textures_that_some_gpus_do_not_hold_are_said(tmp_path, monkeypatch):
    monkeypatch.setattr("meshreel.formats.vat.plain.WIDTHS", (64, 128))
    notes = saved(waving_grid(), tmp_path / "a.vat")
    assert any("hold no more than 64 texels a side" in one for one in notes)
