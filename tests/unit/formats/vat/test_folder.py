"""Writing folders of vertex animation textures: file names, options and existing files."""

import json

import numpy as np
import pytest
from scipy.spatial import cKDTree

import meshreel
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.options import WriteOptions
from meshreel.formats.outputs import check_output
from meshreel.formats.vat.layouts import fit_grid
from meshreel.model.geometry.normals import vertex_normals
from meshreel.model.sequence import MeshSequence
from meshreel.model.tracks import Track
from samples.meshes import irregular_sequence, quad_sheet, waving_grid
from samples.vat_player import PLAYERS, read_glb

NAMES = ["walk.glb", "walk_vat.exr", "walk-remap_info.json"]

LAYOUTS = list(PLAYERS)
BIG = pytest.param(65_537, 2, marks=pytest.mark.slow)
ERROR = 0.1
"""Percent of the diagonal."""


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("output", ["walk.vat", "walk.vat/", "WALK.VAT/"])
def test_files_are_named_after_the_folder(tmp_path, layout, output):
    options = WriteOptions(layout=layout)
    written = meshreel.save(waving_grid(), f"{tmp_path}/{output}", options=options)
    assert sorted(path.name.lower() for path in written) == sorted(NAMES)
    assert sorted(written) == sorted(tmp_path.glob("*/*"))


def test_existing_files_are_replaced_only_with_overwrite(tmp_path):
    meshreel.save(waving_grid(), tmp_path / "walk.vat")
    before = {path: path.read_bytes() for path in (tmp_path / "walk.vat").iterdir()}
    with pytest.raises(InvalidInputError, match="already exists"):
        meshreel.save(waving_grid(3), tmp_path / "walk.vat")
    assert {path: path.read_bytes() for path in (tmp_path / "walk.vat").iterdir()} == before
    meshreel.save(waving_grid(3), tmp_path / "walk.vat", overwrite=True)
    after = (tmp_path / "walk.vat" / "walk_vat.exr").read_bytes()
    assert after != before[tmp_path / "walk.vat" / "walk_vat.exr"]


def test_textures_of_another_kind_are_not_added_to_a_folder(tmp_path):
    meshreel.save(waving_grid(), tmp_path / "walk.vat")
    with pytest.raises(
        InvalidInputError, match=r"must not be mixed with the output: walk_vat\.exr"
    ):
        meshreel.save(
            waving_grid(), tmp_path / "walk.vat", overwrite=True,
            options=WriteOptions(textures="png"),
        )  # fmt: skip
    (tmp_path / "walk.vat" / "walk_vat.exr.import").touch()  # files that engines add are ignored
    meshreel.save(waving_grid(), tmp_path / "walk.vat", overwrite=True)


@pytest.mark.parametrize(
    ("output", "options", "message"),
    [
        ("a.vat", {"layout": "opengl"}, r"layout .* openvat, openvat-unity; got 'opengl'"),
        ("a.vat", {"textures": "tga"}, r"textures .* exr, png; got 'tga'"),
        ("a.vat", {"meshopt": True}, r"meshopt .* no effect on a \.vat folder"),
        ("a.vat", {"lossless": True}, r"lossless .* no effect on a \.vat folder"),
        ("a.vat", {"max_error": "far"}, "max_error takes"),
        ("a.glb", {"layout": "openvat"}, r"layout .* no effect on a \.glb file; it is for \.vat"),
        ("a.npz", {"textures": "png"}, r"textures .* it is for \.vat"),
        ("a_%d.vat", {}, "has a number field"),
    ],
)
def test_invalid_options_are_rejected_before_writing(tmp_path, output, options, message):
    with pytest.raises(InvalidInputError, match=message):
        check_output(tmp_path / output, overwrite=False, options=WriteOptions(**options))
    assert not list(tmp_path.iterdir())


def test_start_number_and_a_file_at_the_folder_path_are_rejected(tmp_path):
    with pytest.raises(InvalidInputError, match="start_number"):
        check_output(tmp_path / "a.vat", overwrite=False, start_number=3)
    (tmp_path / "a.vat").touch()
    with pytest.raises(InvalidInputError, match="is a file; name a folder"):
        check_output(tmp_path / "a.vat", overwrite=True)


def test_folder_cannot_be_loaded(tmp_path):
    meshreel.save(waving_grid(), tmp_path / "walk.vat")
    with pytest.raises(FormatError, match=r"contains no frames .* it contains walk\.glb"):
        meshreel.load(tmp_path / "walk.vat")


def test_lost_tracks_and_the_assumed_frame_rate_are_noted(tmp_path, notes):
    grid = waving_grid()
    heat = Track(np.zeros((12, grid.n_verts), np.float32))
    sequence = MeshSequence(grid.vertices, grid.faces, 0.0, "walk", tracks={"heat": heat})
    meshreel.save(sequence, tmp_path / "walk.vat", notes=notes)
    assert "tracks left out: heat: .vat cannot store them" in notes
    assert "the frame rate is unknown; written as 24 fps" in notes


@pytest.mark.slow
def test_textures_of_a_stream_use_the_rest_of_its_error_bound(tmp_path, notes):
    meshreel.save(waving_grid(), tmp_path / "walk.reel", options=WriteOptions(max_error=0.05))
    with meshreel.open(tmp_path / "walk.reel") as reel:
        options = WriteOptions(max_error=0.2)
        meshreel.save(reel, tmp_path / "walk.vat", options=options, notes=notes)
        [total] = [note for note in notes if note.startswith("against the original")]
        assert float(total.split(" % ")[0].split()[-1]) <= 0.2
        options = WriteOptions(max_error=0.04)
        with pytest.raises(InvalidInputError, match="leaves nothing for textures"):
            meshreel.save(reel, tmp_path / "b.vat", options=options)


def strip(n_verts, n_frames, *, shift=0.0, dtype=np.float32):
    """Return a waving strip of triangles with any number of vertices."""
    rng = np.random.default_rng(n_verts)
    rest = rng.random((n_verts, 3))
    motion = np.sin(np.arange(n_frames) / 3)[:, None, None] * rng.normal(size=(n_verts, 3)) / 4
    if n_verts < 3:
        faces = np.zeros((1, 3), np.int32)
        faces[0, 1:] = n_verts - 1
    else:
        faces = (np.arange(n_verts - 2)[:, None] + np.arange(3)).astype(np.int32)
    return MeshSequence((rest + motion + shift).astype(dtype), faces, 24.0, "strip")


def saved(sequence, folder, **options):
    notes = []
    meshreel.save(sequence, folder, options=WriteOptions(**options), notes=notes)
    return notes


def vertex_indices(player, vertices):
    """Return the sequence vertex of each mesh vertex, matched by rest position."""
    distances, rows = cKDTree(vertices).query(player.rest)
    assert distances.max() <= 1e-6 * np.abs(vertices).max()
    return rows


def largest_error(sequence, folder, layout):
    """Return the largest distance of a played vertex from its original, in model units."""
    player = PLAYERS[layout](folder)
    assert player.n_frames >= sequence.n_frames
    rows = vertex_indices(player, sequence.vertices[0] - player.shift)
    used = np.unique(sequence.faces)
    assert set(rows) == set(used)
    errors = []
    for frame in range(sequence.n_frames):
        positions = player.positions(frame)
        errors.append(
            np.linalg.norm(positions + player.shift - sequence.vertices[frame][rows], axis=1)
        )
    return max(distances.max() for distances in errors)


def diagonal(sequence):
    extent = sequence.extent
    return float(np.linalg.norm(extent.high - extent.low))


@pytest.mark.parametrize("textures", ["exr", "png"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_sheet_is_played_within_the_error_bounds_of_positions_and_normals(
    tmp_path, layout, textures
):
    sequence = waving_grid()
    notes = saved(sequence, tmp_path / "a.vat", layout=layout, textures=textures, max_error=ERROR)
    assert largest_error(sequence, tmp_path / "a.vat", layout) <= ERROR / 100 * diagonal(sequence)
    player = PLAYERS[layout](tmp_path / "a.vat")
    rows = vertex_indices(player, sequence.vertices[0])
    noted = next(float(note.split()[6]) for note in notes if "error of normals" in note)
    for frame in range(sequence.n_frames):
        expected = vertex_normals(sequence.vertices[frame], sequence.faces)[rows]
        normals = player.normals(frame).astype(float)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        angle = np.degrees(np.arccos(np.clip((normals * expected).sum(axis=1), -1, 1))).max()
        assert angle <= 1.1 * noted + 0.05  # the note is rounded, and cosines are coarse near 1


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(
    ("n_verts", "n_frames"), [(1, 3), (2, 1), (3, 300), (8192, 2), (8193, 1), (8193, 3), BIG]
)
def test_vertices_find_their_texels_for_all_counts(tmp_path, layout, n_verts, n_frames):
    sequence = strip(n_verts, n_frames)
    saved(sequence, tmp_path / "a.vat", layout=layout, max_error=ERROR, normals=False)
    assert largest_error(sequence, tmp_path / "a.vat", layout) <= ERROR / 100 * diagonal(sequence)


@pytest.mark.parametrize("textures", ["exr", "png"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_flat_and_static_sequences_are_played(tmp_path, layout, textures):
    grid = waving_grid()
    flat = MeshSequence(grid.vertices * np.float32([1, 1, 0]), grid.faces, 25.0, "flat")
    saved(flat, tmp_path / "a.vat", layout=layout, textures=textures)
    assert largest_error(flat, tmp_path / "a.vat", layout) <= ERROR / 100 * diagonal(flat)
    static = MeshSequence(np.repeat(grid.vertices[:1], 5, axis=0), grid.faces, 25.0, "static")
    saved(static, tmp_path / "b.vat", layout=layout, textures=textures)
    assert largest_error(static, tmp_path / "b.vat", layout) <= 1e-3 * diagonal(static)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_node_moves_a_centered_mesh_far_from_the_origin(tmp_path, layout):
    sequence = strip(40, 5, shift=np.array([1, -2e6, 3]), dtype=np.float64)
    notes = saved(sequence, tmp_path / "a.vat", layout=layout, max_error=0.05)
    assert any("centered at the origin" in note for note in notes)
    player = PLAYERS[layout](tmp_path / "a.vat")
    assert player.shift.any()
    # Rest positions are not unique in float32, so match vertices by their order.
    order = np.argsort(player.u)
    for frame in range(5):
        positions = player.positions(frame)[order] + player.shift
        errors = np.linalg.norm(positions - sequence.vertices[frame], axis=1)
        assert errors.max() <= 0.05 / 100 * diagonal(sequence)


def test_mesh_near_the_origin_is_not_moved(tmp_path):
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
def test_max_error_selects_the_smallest_texel_type(tmp_path, textures, max_error, expected):
    sequence = waving_grid()
    saved(sequence, tmp_path / "a.vat", textures=textures, max_error=max_error)
    player = PLAYERS["openvat"](tmp_path / "a.vat")
    assert player.image.dtype == expected
    assert largest_error(sequence, tmp_path / "a.vat", "openvat") <= max_error / 100 * diagonal(
        sequence
    )


def test_error_bound_below_all_texel_types_is_rejected_without_files(tmp_path):
    with pytest.raises(InvalidInputError, match=r"with 16-bit PNG is .* or choose textures 'exr'"):
        saved(waving_grid(), tmp_path / "a.vat", textures="png", max_error=1e-5)
    assert not (tmp_path / "a.vat").exists()


def test_note_states_the_error_of_the_files(tmp_path):
    sequence = waving_grid()
    notes = saved(sequence, tmp_path / "a.vat", textures="png", max_error=0.5)
    [noted] = [note for note in notes if note.startswith("the largest error is")]
    percent = 100 * largest_error(sequence, tmp_path / "a.vat", "openvat") / diagonal(sequence)
    assert float(noted.split()[4]) == pytest.approx(percent, rel=0.01)
    assert noted.endswith("as decoded from 8-bit PNG")
    [video] = [note for note in notes if "video memory" in note]
    assert video == "1 texture of 99 x 24 texels: 0.0095 MB of video memory"


def test_vertices_split_at_seams_share_a_texel_and_unused_ones_have_none(tmp_path):
    sheet = quad_sheet()
    notes = saved(sheet, tmp_path / "a.vat")
    mesh, triangles, _ = read_glb(tmp_path / "a.vat" / "a.glb")
    assert len(mesh["POSITION"]) > 30
    assert len(np.unique(mesh["TEXCOORD_1"], axis=0)) == 30
    assert len(triangles) == len(sheet.faces)
    assert any("starts at 0 s" in note for note in notes)
    odd = irregular_sequence()
    notes = saved(odd, tmp_path / "b.vat")
    assert "left out 2 vertices that no face uses" in notes
    assert largest_error(odd, tmp_path / "b.vat", "openvat") <= 1e-3 * diagonal(odd)


def test_json_of_openvat_matches_its_importers(tmp_path):
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


def test_grid_rejects_too_many_rows():
    with pytest.raises(InvalidInputError, match="GPUs support 16384 rows; use fewer frames"):
        fit_grid(6, 9000, n_halves=2)
    assert fit_grid(6, 9000).height == 9000
    assert fit_grid(65_537, 1000).n_rows == 5  # nine rows per frame would be 9,000 rows


def test_textures_beyond_the_limits_of_some_gpus_are_noted(tmp_path, monkeypatch):
    monkeypatch.setattr("meshreel.formats.vat.folder.WIDTHS", (64, 128))
    notes = saved(waving_grid(), tmp_path / "a.vat")
    assert any("support at most 64 texels per side" in note for note in notes)
