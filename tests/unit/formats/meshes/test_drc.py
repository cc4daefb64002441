"""Draco frames, with files that DracoPy writes."""

import sys

import DracoPy
import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load
from meshreel.formats.meshes.drc import read_drc
from meshreel.formats.registry import described_formats
from samples.meshes import grid_faces, waving_grid

COLUMNS, ROWS = 12, 5
POSITION_STEP = 2.0 / (2**16 - 1)
"""Quantization step of the tube in each axis, for 16 bits."""


def tube(lift=0.0):
    """Return points, texture coordinates and triangles of a tube that is split along a seam."""
    turns, heights = np.meshgrid(np.arange(COLUMNS + 1), np.arange(ROWS))
    angles = 2 * np.pi * (turns % COLUMNS) / COLUMNS
    points = np.stack([np.cos(angles), np.sin(angles), heights * 0.4 + lift], axis=-1)
    uv = np.stack([turns / COLUMNS, heights / ROWS], axis=-1)
    faces = grid_faces(ROWS, COLUMNS + 1)
    return points.reshape(-1, 3).astype(np.float32), uv.reshape(-1, 2), faces.astype(np.uint32)


def written(path, points, faces=None, **options):
    """Write a Draco file."""
    path.write_bytes(DracoPy.encode(points, faces, quantization_bits=16, **options))
    return path


def split_tube(path, lift=0.0, uv_shift=0.0, **options):
    """Write a tube with texture coordinates."""
    points, uv, faces = tube(lift)
    return written(path, points, faces, tex_coord=uv + uv_shift, **options)


def sides(faces):
    """Return the sorted vertex pairs of the edges of all triangles."""
    return np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)


def sorted_corners(positions, uv):
    """Return position and texture coordinate of all corners of triangles in canonical order."""
    rows = np.concatenate([positions, uv], axis=2).round(2) + 0.0
    first = np.lexsort(np.moveaxis(rows, 2, 0)[::-1], axis=1)[:, :1]
    rolled = np.take_along_axis(rows, ((first + np.arange(3)) % 3)[:, :, None], axis=1)
    return np.array(sorted(rolled.reshape(len(rows), -1).tolist()))


@pytest.mark.parametrize("options", [{}, {"preserve_order": True}, {"compression_level": 10}])
def test_seams_are_welded_when_texture_coordinates_differ(tmp_path, options, notes):
    loaded = load(split_tube(tmp_path / "a.drc", **options), notes=notes)
    points, uv, faces = tube()
    assert (loaded.n_verts, loaded.n_faces) == (COLUMNS * ROWS, len(faces))
    _, n_faces = np.unique(sides(loaded.faces), axis=0, return_counts=True)
    assert (n_faces == 1).sum() == 2 * COLUMNS  # both ends of the tube
    assert f"welded {len(points)} points that Draco split at seams to 60 vertices" in notes
    [attribute] = loaded.surface.attributes
    assert (attribute.name, attribute.kind, attribute.domain) == ("uv", "uv", "corner")
    np.testing.assert_allclose(
        sorted_corners(loaded.vertices[0][loaded.faces], attribute.per_item().reshape(-1, 3, 2)),
        sorted_corners(points[faces], uv[faces]),
        rtol=0, atol=0.011,
    )  # fmt: skip


def test_positions_are_those_of_draco(tmp_path):
    path = split_tube(tmp_path / "a.drc")
    decoded = DracoPy.decode(path.read_bytes())
    loaded = load(path)
    np.testing.assert_array_equal(loaded.vertices[0][loaded.faces], decoded.points[decoded.faces])
    distance = abs(decoded.points[:, None] - tube()[0]).max(axis=2).min(axis=1)
    assert distance.max() < 0.51 * POSITION_STEP


def test_coordinates_that_agree_at_vertices_belong_to_vertices(tmp_path):
    grid = waving_grid(1)
    uv = grid.vertices[0][:, :2].astype(np.float64)
    path = written(tmp_path / "a.drc", grid.vertices[0], grid.faces.astype(np.uint32), tex_coord=uv)
    loaded = load(path)
    [attribute] = loaded.surface.attributes
    assert (attribute.domain, loaded.n_verts) == ("vertex", grid.n_verts)
    np.testing.assert_allclose(attribute.values, loaded.vertices[0][:, :2], rtol=0, atol=1e-4)


def test_colors_are_read_as_bytes(tmp_path):
    points, _, faces = tube()
    colors = np.random.default_rng(1).integers(0, 256, (len(points), 4)).astype(np.uint8)
    colors[COLUMNS :: COLUMNS + 1] = colors[:: COLUMNS + 1]
    loaded = load(written(tmp_path / "a.drc", points, faces, colors=colors))
    [attribute] = loaded.surface.attributes
    assert (attribute.name, attribute.kind, attribute.domain) == ("color", "color", "vertex")
    assert attribute.values.dtype == np.uint8
    by_place = {tuple(one): row for one, row in zip(points.round(2).tolist(), colors, strict=True)}
    for place, row in zip(loaded.vertices[0].round(2).tolist(), attribute.values, strict=True):
        np.testing.assert_array_equal(by_place[tuple(one + 0.0 for one in place)], row)


def test_normals_that_differ_across_an_edge_make_it_hard(tmp_path, notes):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0, 0], [0, 0, 1]], "f4")
    normals = np.array([[0, 0, 1]] * 3 + [[0, 1, 0]] * 3, np.float64)
    faces = np.array([[0, 1, 2], [3, 4, 5]], np.uint32)
    loaded = load(written(tmp_path / "a.drc", points, faces, normals=normals), notes=notes)
    assert loaded.n_verts == 4
    assert len(loaded.surface.hard_edges) == 1
    assert any(note.startswith("kept 1 of 1 edge as hard edges") for note in notes)


def test_generic_attributes_are_listed_in_a_note(tmp_path, notes):
    points, _, faces = tube()
    weights = np.ones((len(points), 2), np.float32)
    path = written(
        tmp_path / "a.drc", points, faces, generic_attributes={"weights": weights, 7: weights}
    )
    loaded = load(path, notes=notes)
    assert loaded.surface.attributes == ()
    assert "left out: attributes of Draco: weights, generic 7" in notes


def test_second_normals_are_listed_in_a_note(tmp_path, notes, monkeypatch):
    path = split_tube(tmp_path / "a.drc")
    decoded = DracoPy.decode(path.read_bytes())
    points = next(one for one in decoded.attributes if one["attribute_type"] == 0)
    decoded.attributes.extend([{**points, "attribute_type": 1, "name": "bent"}] * 2)
    monkeypatch.setattr(DracoPy, "decode", lambda data: decoded)
    load(path, notes=notes)
    assert "left out: attributes of Draco: bent" in notes


def test_equal_positions_without_a_common_edge_stay_apart(tmp_path):
    """Two triangles touch in a point, and a third has two coinciding corners."""
    points = np.array(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [-1, 0, 0], [0, -1, 0], [5, 5, 5], [5, 5, 5],
         [6, 5, 5]], np.float32,
    )  # fmt: skip
    faces = np.array([[0, 1, 2], [3, 4, 5], [6, 7, 8]], np.uint32)
    ids = np.arange(9, dtype=np.uint8)[:, None]
    path = written(
        tmp_path / "a.drc", points, faces, preserve_order=True, generic_attributes={1: ids}
    )
    loaded = load(path)
    assert loaded.n_verts == 9
    np.testing.assert_array_equal(loaded.faces, faces)


def test_frames_with_equal_faces_are_one_sequence_with_tracks(tmp_path):
    for number in range(3):
        split_tube(tmp_path / f"{number}.drc", lift=number, uv_shift=0.1 * number)
    loaded = load(tmp_path, fps=10)
    assert (loaded.n_frames, loaded.n_verts) == (3, COLUMNS * ROWS)
    np.testing.assert_allclose(np.diff(loaded.vertices[:, :, 2], axis=0), 1, rtol=0, atol=1e-3)
    track = loaded.tracks["uv"]
    assert (track.domain, track.kind) == ("corner", "uv")
    np.testing.assert_allclose(np.diff(track.values, axis=0), 0.1, rtol=0, atol=1e-5)


def test_frames_with_changing_faces_are_segments(tmp_path, notes):
    split_tube(tmp_path / "0.drc")
    split_tube(tmp_path / "1.drc", lift=0.5)
    grid = waving_grid(2)
    for number, frame in enumerate(grid.vertices):
        written(tmp_path / f"{number + 2}.drc", frame, grid.faces.astype(np.uint32))
    loaded = load(tmp_path, notes=notes)
    assert [segment.n_frames for segment in loaded.segments] == [2, 2]
    assert [segment.n_verts for segment in loaded.segments] == [60, grid.n_verts]


def test_notes_of_segments_that_differ_in_numbers_are_combined(tmp_path, notes):
    split_tube(tmp_path / "0.drc")
    points, uv, faces = tube()
    for number, n_faces in enumerate((80, 90), 1):
        written(tmp_path / f"{number}.drc", points, faces[:n_faces], tex_coord=uv)
    load(tmp_path, notes=notes)
    [welded] = [note for note in notes if note.startswith("welded")]
    assert welded == (
        "welded 65 points that Draco split at seams to 60 vertices; other segments similarly"
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: b"ply\n" + data, "is not a Draco file"),
        (lambda data: data[:5], "is not a Draco file"),
        (lambda data: data[:200], "is damaged or incomplete: Draco cannot decode it"),
        (
            lambda data: data[:7] + b"\x05" + data[8:],
            "declares geometry of type 5; 1 is a triangle",
        ),
    ],
)
def test_damaged_files_are_described(tmp_path, change, message):
    path = split_tube(tmp_path / "a.drc")
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(FormatError, match=f"a.drc.* {message}"):
        load(path)


def test_point_clouds_are_rejected(tmp_path):
    path = written(tmp_path / "a.drc", tube()[0])
    with pytest.raises(FormatError, match="contains a point cloud without faces"):
        load(path)


def test_integer_positions_become_floats(tmp_path):
    points = np.arange(9, dtype=np.uint32).reshape(3, 3)
    loaded = load(written(tmp_path / "a.drc", points, np.array([[0, 1, 2]], np.uint32)))
    np.testing.assert_array_equal(loaded.vertices[0], points)
    assert loaded.vertices.dtype == np.float64  # as for other formats with 32-bit integers


def test_missing_positions_are_rejected(tmp_path, monkeypatch):
    """DracoPy gives no values of the types that it does not decode."""
    path = split_tube(tmp_path / "a.drc")
    decoded = DracoPy.decode(path.read_bytes())
    for attribute in decoded.attributes:
        attribute["data"] = attribute["data"] if attribute["attribute_type"] else None
    monkeypatch.setattr(DracoPy, "decode", lambda data: decoded)
    with pytest.raises(FormatError, match="has no positions of three numbers"):
        load(path)


def test_missing_library_is_named(tmp_path, monkeypatch):
    path = split_tube(tmp_path / "a.drc")
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    with pytest.raises(FormatError, match=r"needs DracoPy .*pip install 'meshreel\[draco\]'"):
        load(path)
    [described] = [one for one in described_formats() if one["extension"] == ".drc"]
    assert (described["reads"], described["writes"], described["extra"]) == (True, False, "draco")


def test_surface_belongs_to_the_given_file():
    """Decoding is cached, which must not mix the surfaces of two files."""
    points, uv, faces = tube()
    plain = DracoPy.encode(points, faces)
    textured = DracoPy.encode(points, faces, tex_coord=uv)
    for data, n_attributes in ((plain, 0), (textured, 1), (plain, 0)):
        assert len(read_drc(data).mesh.counts) == len(faces)
        assert len(read_drc(data).surface.attributes) == n_attributes
