import json
import os
import sys
import tracemalloc
import zipfile

import numpy as np
import pytest

import meshreel
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.file_errors import FOLDER_MARK
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.load import load
from meshreel.formats.registry import FORMATS
from meshreel.model.sequence import MeshSequence, positions_size_bytes
from meshreel.operations.save import save
from samples.meshes import quad_sheet, waving_grid
from samples.opening import count_runs, open_source

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def write_frames(folder, *texts):
    for index, text in enumerate(texts):
        (folder / f"frame_{index}.obj").write_text(text)


LFS_POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n"
ONE_POINT = {
    "asset": {"version": "2.0"},
    "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 1}],
    "bufferViews": [{"buffer": 0, "byteLength": 12}],
    "buffers": [{"uri": "b.bin", "byteLength": 12}],
}
REFERRING = {
    "a.pvd": (
        "<VTKFile type='Collection'><Collection><DataSet file='b.vtu'/></Collection></VTKFile>"
    ),
    "a.gltf": json.dumps(ONE_POINT),
    "a.usda": "#usda 1.0\n(\nsubLayers = [@./b.usda@]\n)\n",
    "a.case": "FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: b.geo\n",
    "a.d3plot": "a root, which the file a.d3plot01 continues",
}
"""Files that refer to one that cannot be read."""


@pytest.mark.parametrize(
    ("text", "message"),
    [("", "is empty"), (LFS_POINTER, r"is a Git LFS pointer; run `git lfs pull`")],
)
@pytest.mark.parametrize(
    "name", [*REFERRING, *(f"b{extension}" for extension in FORMATS if extension != FOLDER_MARK)]
)
def test_empty_files_and_git_lfs_pointers_are_named(tmp_path, text, message, name):
    if name == "a.usda":
        pytest.importorskip("pxr")
    for other in ("b.vtu", "b.bin", "b.usda", "b.geo", "a.d3plot01", name):
        (tmp_path / other).write_text(text)
    if name in REFERRING:
        (tmp_path / name).write_text(REFERRING[name])
    for read in (load, *([meshreel.decode, meshreel.open] if name == "b.reel" else [])):
        with pytest.raises(FormatError, match=rf"(b\.\w+|a\.d3plot01): {message}$"):
            read(tmp_path / name)


@pytest.mark.parametrize("extension", ["obj", "ply", "off"])
@pytest.mark.parametrize(
    ("dtype", "offset"), [(np.float32, 90.0), (np.float32, 1e5), (np.float64, 1e5)]
)
def test_frame_formats_round_trip(tmp_path, make_sequence, extension, dtype, offset):
    sequence = make_sequence(11, dtype, offset)
    save(sequence, tmp_path / f"f_%d.{extension}")
    loaded = load(tmp_path)
    assert loaded.vertices.dtype == dtype
    np.testing.assert_array_equal(loaded.vertices, sequence.vertices)
    np.testing.assert_array_equal(loaded.faces, sequence.faces)


@pytest.mark.parametrize(
    ("extension", "expected"),
    [("obj", np.float32), ("off", np.float32), ("stl", np.float32), ("ply", np.float64)],
)
def test_float64_near_the_origin_is_float32_in_decimal_text(
    tmp_path, make_sequence, extension, expected
):
    save(make_sequence(2, np.float64), tmp_path / f"f_%d.{extension}")
    assert load(tmp_path).vertices.dtype == expected


def test_stl_frames_round_trip_geometry_with_a_note_on_the_weld(tmp_path, make_sequence, read):
    sequence, notes = make_sequence(3), []
    save(sequence, tmp_path / "f_%d.stl")
    result = read(tmp_path, notes=notes)
    vertices = result.read(0, 3)
    assert vertices.shape == sequence.vertices.shape
    np.testing.assert_array_equal(vertices[:, result.faces], sequence.vertices[:, sequence.faces])
    assert notes == ["welded 24 STL corners to 6 vertices"]


def test_load_keeps_quads_without_a_note(tmp_path, notes):
    write_frames(tmp_path, *[SQUARE + "f 1 2 3 4\n"] * 2)
    loaded = load(tmp_path, notes=notes)
    assert loaded.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert (loaded.surface.face_sizes.tolist(), notes) == ([4], [])


@pytest.mark.parametrize(
    ("name", "fps", "expected"),
    [("f_%d.obj", None, 0), ("f_%d.obj", 24, 24), ("a.npz", None, 30), ("a.npz", 24, 24)],
)
def test_fps_argument_precedes_the_rate_of_the_file(tmp_path, make_sequence, name, fps, expected):
    save(make_sequence(2, fps=30), tmp_path / name)
    assert load(tmp_path / name.replace("%d", "*"), fps=fps).fps == expected


@pytest.mark.parametrize("extension", ["obj", "stl"])
def test_progress_is_reported_for_every_frame(tmp_path, make_sequence, read, extension):
    save(make_sequence(4), tmp_path / f"f_%d.{extension}")
    seen = []
    read(tmp_path, progress=lambda stage, fraction: seen.append((stage, fraction)))
    assert seen == [("reading", 0.25), ("reading", 0.5), ("reading", 0.75), ("reading", 1.0)]


def test_later_float64_frame_widens_the_sequence(tmp_path, make_sequence):
    wide = make_sequence(1, np.float64)
    save(make_sequence(1, np.float32), tmp_path / "f_0.ply")
    save(wide, tmp_path / "f_1.ply")
    assert load(tmp_path).vertices[1].tobytes() == wide.vertices[0].tobytes()


@pytest.mark.parametrize(
    "second",
    [
        SQUARE + "v 2 2 2\nf 1 2 3\n",
        SQUARE + "f 1 2 3\nf 1 3 4\n",
        SQUARE + "f 1 2 3 4\n",
        SQUARE + "f 1 2 4\n",
    ],
)
def test_other_vertices_or_faces_begin_another_segment(tmp_path, second):
    write_frames(tmp_path, SQUARE + "f 1 2 3\n", second)
    assert count_runs(tmp_path) == 2


def test_other_number_of_stl_triangles_begins_another_segment(tmp_path, make_sequence):
    save(make_sequence(1), tmp_path / "f_0.stl")
    (tmp_path / "f_1.stl").write_bytes(bytes(84 - 4) + b"\1\0\0\0" + bytes(50))
    assert [len(one.faces) for one in load(tmp_path).segments] == [8, 1]


@pytest.mark.parametrize("bad", ["nan", "inf", "-inf"])
def test_error_names_file_and_vertex_of_a_non_finite_position(tmp_path, read, bad):
    good = SQUARE + "f 1 2 3\n"
    write_frames(tmp_path, good, good.replace("v 1 1 0", f"v 1 {bad} 0"), good)
    message = rf"frame_1\.obj: every position must be finite; vertex 2 of frame 1 has y = {bad}"
    with pytest.raises(InvalidInputError, match=message):
        read(tmp_path)


def test_parse_error_names_the_file(tmp_path):
    write_frames(tmp_path, SQUARE + "f 1 2 3\n", SQUARE + "f 1 2 x\n")
    with pytest.raises(FormatError, match=r"frame_1\.obj: line 5: expected an integer; got 'x'"):
        load(tmp_path)


@pytest.mark.parametrize("extension", ["obj", "ply", "off", "stl"])
def test_error_for_an_empty_file_names_it(tmp_path, extension):
    (tmp_path / f"a.{extension}").touch()
    with pytest.raises(FormatError, match=rf"a\.{extension}: is empty"):
        load(tmp_path)


def test_reel_streams_are_decoded_at_the_given_rate(tmp_path, read):
    sequence = waving_grid()
    save(sequence, tmp_path / "a.reel")
    result = read(tmp_path / "a.reel", fps=50)
    np.testing.assert_array_equal(result.read(0, 12), decode(encode(sequence)).vertices)
    assert (result.fps, result.name) == (50, "grid")


EXTENSIONS = ["obj", "ply", "off", "stl"]
CASES = [
    (np.float32, 0.0),
    (np.float32, 300.0),
    (np.float64, 0.0),
    (np.float64, 1e5),
    (np.float64, 2.0**40),
    (np.float32, 1e30),
]


@pytest.fixture
def save_as(tmp_path, make_sequence):
    """Save a sequence in a format; return the source to read it from."""

    def write(extension, *args, **kwargs):
        name = "a.npz" if extension == "npz" else f"f_%d.{extension}"
        save(make_sequence(*args, **kwargs), tmp_path / name)
        return tmp_path / name if extension == "npz" else tmp_path

    return write


@pytest.mark.parametrize("extension", [*EXTENSIONS, "npz"])
@pytest.mark.parametrize(("dtype", "offset"), CASES)
def test_stored_frames_equal_loaded_ones_in_positions_and_metadata(
    save_as, extension, dtype, offset
):
    source = save_as(extension, 11, dtype, offset)
    opened, loaded = open_source(source, fps=24), load(source, fps=24)
    assert isinstance(opened, StoredFrames)
    for start, stop in [(0, 11), (3, 4), (4, 9), (9, 20), (5, 5), (7, 2), (-2, 11)]:
        expected = loaded.vertices[start:stop]
        result = opened.read(start, stop)
        assert (result.dtype, result.shape) == (expected.dtype, expected.shape)
        assert result.tobytes() == expected.tobytes()
    for name in ("n_frames", "n_verts", "fps", "name", "dtype"):
        assert getattr(opened, name) == getattr(loaded, name)
    assert opened.faces.tobytes() == loaded.faces.tobytes()
    assert opened.extent.low.tobytes() == loaded.extent.low.tobytes()
    assert opened.extent.high.tobytes() == loaded.extent.high.tobytes()
    assert opened.extent.mean_diagonal == loaded.extent.mean_diagonal
    assert positions_size_bytes(opened) == loaded.vertices.nbytes


@pytest.mark.parametrize("first", [np.float32, np.float64])
def test_stored_frames_of_mixed_types_equal_loaded_ones(tmp_path, make_sequence, first):
    types = [first, np.float64, np.float32]
    for index, dtype in enumerate(types):
        save(make_sequence(1, dtype, offset=index), tmp_path / f"f_{index}.ply")
    opened = open_source(tmp_path)
    assert opened.dtype == np.float64
    assert opened.read(0, 3).tobytes() == load(tmp_path).vertices.tobytes()


def test_stored_frames_of_mixed_stl_equal_loaded_ones(tmp_path):
    corners = np.array([[[0.1, 0, 1e4], [1, 0, 1e4], [0, 1, 1e4]]], np.float32)
    save(MeshSequence(corners, np.array([[0, 1, 2]])), tmp_path / "f_0.stl")
    lines = "".join(f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in (corners[0] / 3 + 0.7).tolist())
    facet = f"solid\nfacet normal 0 0 1\nouter loop\n{lines}endloop\nendfacet\nendsolid\n"
    (tmp_path / "f_1.stl").write_text(facet)
    opened, loaded = open_source(tmp_path), load(tmp_path)
    assert opened.read(0, 2).tobytes() == loaded.vertices.tobytes()


@pytest.mark.parametrize("extension", ["obj", "npz"])
@pytest.mark.parametrize(("surplus", "expected"), [(0, MeshSequence), (-1, StoredFrames)])
def test_open_source_loads_up_to_max_loaded_bytes(save_as, extension, surplus, expected):
    size = 4 * 6 * 3 * (8 if extension == "obj" else 4)  # text is read as float64
    opened = open_source(save_as(extension, 4), max_loaded_bytes=size + surplus)
    assert isinstance(opened, expected)


def test_open_source_loads_a_single_mesh(save_as):
    assert isinstance(open_source(save_as("obj", 1)), MeshSequence)


@pytest.mark.parametrize("shape", [{"fortran": True}, {"packed": True}])
def test_open_source_loads_compressed_npz(tmp_path, make_sequence, shape):
    sequence = make_sequence(3)
    order = np.asfortranarray if "fortran" in shape else np.asarray
    store = np.savez_compressed if "packed" in shape else np.savez
    store(tmp_path / "a.npz", vertices=order(sequence.vertices), faces=sequence.faces)
    opened = open_source(tmp_path / "a.npz")
    assert isinstance(opened, MeshSequence)
    np.testing.assert_array_equal(opened.vertices, sequence.vertices)


def test_stored_frames_of_big_endian_npz_are_native(tmp_path, make_sequence):
    sequence = make_sequence(3)
    vertices = sequence.vertices.astype(">f4")
    np.savez(tmp_path / "a.npz", faces=sequence.faces, vertices=vertices, fps=30, name="b")
    opened = open_source(tmp_path / "a.npz")
    assert (opened.dtype, opened.fps, opened.name) == (np.dtype(np.float32), 30, "b")
    assert opened.read(1, 3).tobytes() == sequence.vertices[1:].tobytes()


def with_nan(*, frame, vertex, axis):
    vertices = np.zeros((5, 3, 3))
    vertices[frame, vertex, axis] = np.nan
    return vertices


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"verts": np.zeros((2, 3, 3))}, "has no array 'vertices'"),
        (
            {"vertices": np.zeros((3, 3))},
            r"vertices must have shape \(T, V, 3\) or \(V, 3, T\); got \(3, 3\)",
        ),
        ({"vertices": np.zeros((2, 3, 3), np.int32)}, "must be float32 or float64; got int32"),
        ({"vertices": np.zeros((0, 3, 3))}, "needs at least one frame"),
        ({"vertices": np.zeros((2, 2, 3))}, r"face 0 is \[0, 1, 2\]; indices must be in 0..1"),
        ({"vertices": np.zeros((2, 3, 3)), "fps": "fast"}, "fps must be one number"),
        ({"vertices": with_nan(frame=3, vertex=2, axis=1)}, "vertex 2 of frame 3 has y = nan"),
    ],
)
def test_open_source_raises_the_errors_of_load(tmp_path, arrays, message):
    np.savez(tmp_path / "a.npz", faces=np.array([[0, 1, 2]]), **arrays)
    with pytest.raises((FormatError, InvalidInputError), match=rf"a\.npz: .*{message}") as result:
        open_source(tmp_path / "a.npz")
    with pytest.raises(result.type) as expected:
        load(tmp_path / "a.npz")
    assert str(result.value) == str(expected.value)


@pytest.mark.parametrize("fps", [-1, float("nan")])
@pytest.mark.parametrize("extension", ["obj", "npz"])
def test_open_source_rejects_an_invalid_fps(save_as, extension, fps):
    with pytest.raises(InvalidInputError, match="fps must be finite and at least 0"):
        open_source(save_as(extension, 2), fps=fps)


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_reading_frames_fails_if_a_file_has_changed(tmp_path, save_as, extension):
    opened = open_source(save_as(extension, 4))
    path = tmp_path / f"f_2.{extension}"
    path.write_bytes(path.read_bytes() + b" ")
    assert len(opened.read(0, 2)) == 2
    with pytest.raises(InvalidInputError, match=rf"f_2\.{extension} \(frame 2\) changed after"):
        opened.read(0, 4)


@pytest.mark.parametrize(("extension", "name"), [("obj", "f_1.obj"), ("npz", "a.npz")])
def test_reading_frames_fails_if_a_file_is_gone(tmp_path, save_as, extension, name):
    opened = open_source(save_as(extension, 4))
    (tmp_path / name).unlink()
    with pytest.raises(InvalidInputError, match=f"{name} cannot be read: No such file"):
        opened.read(1, 2)


def vertex_bytes(path, frame):
    """Offset of the positions of a frame of six float32 vertices in an npz file."""
    with zipfile.ZipFile(path) as archive, archive.open("vertices.npy") as member:
        header = member.read(128)
    return path.read_bytes().index(header) + 128 + frame * 72


def test_reading_frames_fails_if_an_npz_has_changed(save_as):
    path = save_as("npz", 4)
    opened = open_source(path)
    data = bytearray(path.read_bytes())
    data[vertex_bytes(path, 2) + 5] ^= 1
    path.write_bytes(data)
    assert len(opened.read(0, 2)) == len(opened.read(3, 4)) + 1 == 2
    with pytest.raises(InvalidInputError, match=r"a\.npz \(frame 2\) changed after"):
        opened.read(1, 4)


def test_reading_frames_fails_if_an_npz_is_truncated(save_as):
    path = save_as("npz", 4)
    opened = open_source(path)
    os.truncate(path, vertex_bytes(path, 3) + 10)
    with pytest.raises(InvalidInputError, match=r"a\.npz \(frame 3\) changed after"):
        opened.read(2, 4)


def test_open_source_verifies_the_checksum_of_npz(save_as):
    path = save_as("npz", 200)
    data = bytearray(path.read_bytes())
    data[vertex_bytes(path, 150)] ^= 1  # beyond what reading the header buffers
    path.write_bytes(data)
    with pytest.raises(FormatError, match=r"a\.npz: is damaged: vertices\.npy"):
        open_source(path)


def peak_bytes(work):
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["f_%03d.ply", "a.npz"])
def test_stored_frames_need_an_eighth_of_the_memory(tmp_path, name, monkeypatch):
    monkeypatch.setattr("meshreel.formats.frames.stored_frames.BLOCK_BYTES", 1 << 16)
    vertices = np.random.default_rng(0).standard_normal((200, 3000, 3)).astype(np.float32)
    save(MeshSequence(vertices, np.arange(3000).reshape(-1, 3)), tmp_path / name)

    def read_all():
        opened = open_source(tmp_path / name if name == "a.npz" else tmp_path)
        for index in range(200):
            opened.read(index, index + 1)

    read_all()  # first use imports modules and fills caches, which must not count
    assert peak_bytes(read_all) < vertices.nbytes / 8


def test_frames_of_trimesh_become_segments_of_equal_faces():
    pytest.importorskip("trimesh")
    grid, sheet = waving_grid(3), quad_sheet(2)
    meshes = [meshreel.to_trimesh(one, frame) for one in (grid, sheet) for frame in (0, -1)]
    assert meshes[1].vertices.tolist() == grid.vertices[-1].tolist()
    found = meshreel.from_trimesh(meshes, fps=25)
    assert (found.n_frames, found.n_segments, found.fps) == (4, 2, 25)
    for frame, one in enumerate((grid, grid, sheet, sheet)):
        assert np.array_equal(found[frame].vertices, one.vertices[-(frame % 2)])
        assert np.array_equal(found[frame].faces, one.faces)
    [color] = found.segments[1].surface.attributes
    assert np.array_equal(color.values, sheet.surface.attributes[1].values)
    assert found.segments[0].surface.attributes == ()


def test_colors_of_trimesh_that_change_become_a_track():
    pytest.importorskip("trimesh")
    meshes = [meshreel.to_trimesh(quad_sheet(2), frame) for frame in (0, 1)]
    meshes[1].visual.vertex_colors = np.full((30, 4), 7, np.uint8)
    colors = meshreel.from_trimesh(meshes).tracks["color"].values
    assert np.array_equal(colors, [mesh.visual.vertex_colors for mesh in meshes])


@pytest.mark.slow
def test_frames_of_pyvista_keep_polygons_and_arrays():
    pytest.importorskip("pyvista")
    sheet = quad_sheet(3)
    meshes = [meshreel.to_pyvista(sheet, frame) for frame in range(3)]
    assert meshes[0].n_cells == len(sheet.surface.face_sizes)
    for frame, mesh in enumerate(meshes):
        mesh.point_data["heat"] = np.full(sheet.n_verts, frame, np.float32)
    found = meshreel.from_pyvista(meshes, fps=24)
    assert np.array_equal(found.vertices, sheet.vertices)
    assert np.array_equal(found.surface.face_sizes, sheet.surface.face_sizes)
    assert found.tracks["heat"].values[:, 0, 0].tolist() == [0, 1, 2]
    assert (found.fps, found.name) == (24, "")


@pytest.mark.slow
@pytest.mark.parametrize("convert", [meshreel.to_trimesh, meshreel.to_pyvista])
def test_frames_that_do_not_exist_are_refused(convert):
    pytest.importorskip(convert.__name__.removeprefix("to_"))
    with pytest.raises(IndexError):
        convert(waving_grid(3), 3)


def test_a_library_that_is_not_installed_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(meshreel.InvalidInputError, match="pip install trimesh"):
        meshreel.to_trimesh(waving_grid(3))
