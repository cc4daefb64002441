import sys

import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.load import load
from meshreel.formats.vtk.legacy import read_vtk_legacy
from meshreel.model.notes import Notes
from meshreel.model.surface import Domain, Kind
from meshreel.operations.save import save
from samples.datasets import plain_sequence, positions_of, read_damaged
from samples.opening import open_source

pytest.importorskip("vtkmodules")
from vtkmodules.vtkIOLegacy import vtkPolyDataWriter, vtkUnstructuredGridWriter
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

from samples.vtk import COLORS, HEAT, POINTS, POLYGONS, UV, grid, poly_data, write_mesh
from samples.vtk_text import write_pvd

TEXT, BINARY, APPENDED = 0, 1, 2
PACKINGS = ["None", "ZLib", "LZ4", "LZMA"]


def xml_writer(kind, mode=APPENDED, packing="None", *, header=64, order="<", raw=True, block=0):
    writer = vtkXMLPolyDataWriter() if kind == "vtp" else vtkXMLUnstructuredGridWriter()
    writer.SetDataMode(mode)
    writer.SetEncodeAppendedData(not raw)
    getattr(writer, f"SetCompressorTypeTo{packing}")()
    if block:
        writer.SetBlockSize(block)
    (writer.SetHeaderTypeToUInt64 if header == 64 else writer.SetHeaderTypeToUInt32)()
    (writer.SetByteOrderToLittleEndian if order == "<" else writer.SetByteOrderToBigEndian)()
    return writer


def legacy_writer(kind, *, is_text, version=51):
    writer = vtkPolyDataWriter() if kind == "polydata" else vtkUnstructuredGridWriter()
    (writer.SetFileTypeToASCII if is_text else writer.SetFileTypeToBinary)()
    writer.SetFileVersion(version)
    return writer


def assert_is_sample(found, dtype, *, is_text=False):
    tolerance = {np.float32: 1e-5, np.float64: 1e-9}[dtype] if is_text else 0
    assert found.vertices.dtype == dtype
    np.testing.assert_allclose(found.vertices[0], POINTS.astype(dtype), rtol=tolerance, atol=0)
    assert found.surface.face_sizes.tolist() == [4, 3, 5]
    corners = [corner for polygon in POLYGONS for corner in polygon]
    assert found.faces[0].tolist() == corners[:3]
    assert found.faces[-1].tolist() == [5, 8, 9]
    uv, paint = sorted(found.surface.attributes, key=lambda attribute: attribute.name, reverse=True)
    assert (uv.name, uv.kind, uv.domain) == ("uv set", Kind.UV, Domain.VERTEX)
    assert (paint.name, paint.kind, paint.domain) == ("paint", Kind.COLOR, Domain.VERTEX)
    np.testing.assert_allclose(uv.values, UV, rtol=1e-5 if is_text else 0)
    np.testing.assert_array_equal(paint.values, COLORS)


@pytest.mark.parametrize("kind", ["vtp", "vtu"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("mode", [TEXT, BINARY, APPENDED])
@pytest.mark.parametrize("packing", PACKINGS)
@pytest.mark.parametrize("header", [32, 64])
def test_load_reads_xml_files_of_vtk_exactly(tmp_path, kind, dtype, mode, packing, header):
    mesh = {"vtp": poly_data, "vtu": grid}[kind](POINTS.astype(dtype))
    writer = xml_writer(kind, mode, packing, header=header)
    path = write_mesh(writer, mesh, tmp_path / f"a.{kind}")
    assert_is_sample(load(path), dtype, is_text=mode == TEXT)


@pytest.mark.parametrize("packing", PACKINGS)
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("raw", [True, False])
def test_load_reads_every_byte_order_and_encoding(tmp_path, packing, order, raw):
    writer = xml_writer("vtu", APPENDED, packing, order=order, raw=raw)
    assert_is_sample(load(write_mesh(writer, grid(), tmp_path / "a.vtu")), np.float64)


@pytest.mark.parametrize("packing", PACKINGS)
def test_load_reads_all_compressed_blocks(tmp_path, packing):
    points = np.round(np.random.default_rng(0).standard_normal((4000, 3)), 1)
    mesh = poly_data(points, np.arange(3999).reshape(-1, 3).tolist())
    for data in (mesh.GetPointData(), mesh.GetCellData()):
        data.Initialize()
    path = write_mesh(xml_writer("vtp", BINARY, packing, block=4096), mesh, tmp_path / "a.vtp")
    assert load(path).vertices.tobytes() == points.tobytes()


def test_load_names_the_extra_for_lz4_when_it_is_missing(tmp_path, monkeypatch):
    path = write_mesh(xml_writer("vtp", packing="LZ4"), poly_data(), tmp_path / "a.vtp")
    monkeypatch.setitem(sys.modules, "imagecodecs", None)
    with pytest.raises(FormatError, match=r"a\.vtp: .*needs imagecodecs.*pip install .*\[vtk\]"):
        load(path)


def test_load_reads_sizes_that_are_encoded_separately(tmp_path):
    import base64

    path = write_mesh(xml_writer("vtu", BINARY, header=32), grid(), tmp_path / "a.vtu")
    joint = base64.b64encode(np.uint32(POINTS.nbytes).tobytes() + POINTS.tobytes())
    apart = base64.b64encode(np.uint32(POINTS.nbytes).tobytes()) + base64.b64encode(
        POINTS.tobytes()
    )
    data = path.read_bytes()
    assert joint in data
    path.write_bytes(data.replace(joint, apart))
    assert_is_sample(load(path), np.float64)


@pytest.mark.parametrize("kind", ["polydata", "grid"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("is_text", [True, False])
@pytest.mark.parametrize("version", [42, 51])
def test_load_reads_legacy_files_of_vtk(tmp_path, kind, dtype, is_text, version):
    mesh = {"polydata": poly_data, "grid": grid}[kind](POINTS.astype(dtype))
    writer = legacy_writer(kind, is_text=is_text, version=version)
    path = write_mesh(writer, mesh, tmp_path / "a.vtk")
    assert_is_sample(load(path), dtype, is_text=is_text)


LEGACY = """# vtk DataFile Version 2.0
by hand
ASCII
DATASET POLYDATA

POINTS 4 int
0 0 0 1 0 0
1 1 0 0 1 0
LINES 1 3
2 0 1
TRIANGLE_STRIPS 1 5
4 0 1 3 2
CELL_DATA 2
SCALARS heat float
LOOKUP_TABLE default
7 8
LOOKUP_TABLE default 1
0 0 0 1
POINT_DATA 4
COLOR_SCALARS paint 3
1 0 0 0 1 0 0 0 1 1 1 .5
SCALARS plain int 1
1 2 3 4
NORMALS up float
0 0 1 0 0 1 0 0 1 0 0 1
TEXTURE_COORDINATES map%20a 2 double
0 0 .5 0 1 1 0 .25
FIELD FieldData 2
two 2 4 short
1 2 3 4 5 6 7 8
one 1 1 float
9
VECTORS v float
1 2 3 4 5 6 7 8 9 10 11 12
"""


def test_load_reads_every_section_of_a_legacy_file(tmp_path):
    (tmp_path / "a.vtk").write_text(LEGACY)
    loaded = load(tmp_path / "a.vtk")
    assert loaded.vertices[0].tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert loaded.faces.tolist() == [
        [0, 1, 3],
        [1, 2, 3],
    ]  # the second triangle of a strip is reversed
    paint, uv = loaded.surface.attributes
    assert (paint.name, paint.kind, paint.values.tolist()) == (
        "paint", Kind.COLOR, [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 128]],
    )  # fmt: skip
    assert (uv.name, uv.values.tolist()) == ("map a", [[0, 0], [0.5, 0], [1, 1], [0, 0.25]])
    step = read_vtk_legacy(LEGACY.encode())
    names = [array.name for array in step.arrays if array.domain is Domain.VERTEX]
    assert names == ["paint", "plain", "up", "map a", "two", "v"]
    heat = step.attributes(step.arrays, Notes()).attributes[-1]
    assert (heat.name, heat.domain, heat.values.ravel().tolist()) == ("heat", Domain.FACE, [8, 8])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("# vtk", "# VTK", "does not begin with '# vtk DataFile Version'"),
        ("ASCII", "EBCDIC", "has 'EBCDIC' in line 3; expected ASCII or BINARY there"),
        ("ASCII\n", "", "has 'DATASET POLYDATA' in line 3; expected ASCII or BINARY there"),
        ("POLYDATA", "STRUCTURED_POINTS", "is a STRUCTURED_POINTS; POLYDATA and"),
        ("POINTS 4 int", "POINTS 4 string", "has values of type 'string'"),
        ("POINTS 4 int", "POINTS 99999999999 int", "declares 299999999997 numbers in a file of"),
        ("POINTS 4 int", "POINTS -4 int", "declares -12 numbers"),
        ("POINTS 4 int", "POINTS 9 int", "expected numbers before byte"),
        ("POINTS 4 int", "POINTS four int", "has an invalid line 'POINTS four int'"),
        ("POINTS 4 int", "POINTS", "has an invalid line 'POINTS'"),
        ("4 0 1 3 2", "4 0 1 3 9", "face 1: uses vertex 9"),
        ("4 0 1 3 2", "9 0 1 3 2", "lists of 1 cells do not fit their 5 numbers"),
        ("4 0 1 3 2", "2 0 1 3 2", "lists of 1 cells do not fit their 5 numbers"),
        ("NORMALS", "PARANORMALS", "has an unknown section 'PARANORMALS'"),
        ("7 8", "7 8 9", "has an unknown section '9'"),
        ("10 11 12", "10 11", "ends within 12 numbers"),
        ("POINT_DATA 4", "POINT_DATA 3", "has an unknown section"),
    ],
)
def test_load_explains_errors_of_invalid_legacy_files(tmp_path, old, new, message):
    assert old in LEGACY
    (tmp_path / "a.vtk").write_text(LEGACY.replace(old, new, 1))
    with pytest.raises(FormatError, match=rf"a\.vtk: .*{message}"):
        load(tmp_path / "a.vtk")


CUBE = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float64)
SOLIDS = {
    10: [0, 1, 2, 4],
    11: [0, 1, 2, 3, 4, 5, 6, 7],
    12: [0, 1, 3, 2, 4, 5, 7, 6],
    13: [0, 1, 2, 4, 5, 6],
    14: [0, 1, 3, 2, 4],
}


PRISM_SIDES = {13: 3, 15: 5, 16: 6}
ANY_SOLID = [10, 11, 12, 13, 14, 15, 16]


@pytest.mark.parametrize("kind", ANY_SOLID)
def test_faces_of_solid_cells_point_outward(tmp_path, kind):
    points = CUBE[SOLIDS[kind]] if kind in SOLIDS else None
    if n_sides := PRISM_SIDES.get(kind):
        turn = np.exp(2j * np.pi * np.arange(n_sides) / n_sides)
        ring = np.stack([turn.real, turn.imag, np.zeros(n_sides)], axis=1)
        points = np.concatenate([ring, ring + np.array([0, 0, 1])])
    loaded = load(write_mesh(xml_writer("vtu"), grid(points, [(kind, [*range(len(points))])]),
                         tmp_path / "a.vtu"))  # fmt: skip
    a, b, c = np.moveaxis(loaded.vertices[0][loaded.faces].astype(float), 1, 0)
    outwards = np.cross(b - a, c - a)
    assert np.all(np.einsum("ij,ij->i", outwards, (a + b + c) / 3 - points.mean(axis=0)) > 0.01)


@pytest.mark.parametrize(
    ("kind", "n_points", "linear"), [(22, 6, 3), (69, 6, 3), (70, 9, 4), (25, 20, 8)]
)
def test_load_ignores_mid_edge_points_of_curved_cells(tmp_path, kind, n_points, linear):
    points = np.random.default_rng(0).standard_normal((n_points, 3))
    mesh = grid(points, [(kind, list(range(n_points)))])
    loaded = load(write_mesh(xml_writer("vtu"), mesh, tmp_path / "a.vtu"))
    assert loaded.faces.max() == linear - 1


def test_load_keeps_solid_cells_and_finds_their_surface(tmp_path, notes):
    size = 4
    axis = np.arange(size + 1.0)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    number = np.arange((size + 1) ** 3).reshape((size + 1,) * 3)
    cells = []
    for x, y, z in np.ndindex(size, size, size):
        low = [number[x, y, z], number[x + 1, y, z], number[x + 1, y + 1, z], number[x, y + 1, z]]
        cells.append((12, [int(one) for one in [*low, *(np.array(low) + 1)]]))
    cells += [(5, [0, 1, 2]), (3, [0, 1])]
    mesh = grid(points, cells)
    loaded = load(write_mesh(xml_writer("vtu"), mesh, tmp_path / "a.vtu"), notes=notes)
    assert notes == []
    assert loaded.surface.cells.types.tolist() == [12] * 64 + [5, 3]
    assert loaded.surface.cells.nodes.tolist() == [one for _, cell in cells for one in cell]
    assert loaded.n_verts == (size + 1) ** 3
    assert len(loaded.surface.face_sizes) == 6 * size**2 + 1


def test_load_rejects_unknown_cells_and_files_without_faces(tmp_path):
    path = write_mesh(xml_writer("vtu"), grid(CUBE, [(3, [0, 1])]), tmp_path / "a.vtu")
    with pytest.raises(FormatError, match=r"a\.vtu: holds 8 vertices and 0 faces"):
        load(path)
    path.write_bytes(
        write_mesh(xml_writer("vtu", TEXT), grid(CUBE, [(5, [0, 1, 2])]), path)
        .read_bytes()
        .replace(b"          5\n", b"          41\n")
    )
    with pytest.raises(FormatError, match=r"a\.vtu: contains cells of unsupported type 41 "):
        load(path)


def write_series(folder, n_frames, name="f_{}.vtu", dtype=np.float32):
    noise = np.random.default_rng(1).standard_normal((n_frames, *POINTS.shape))
    positions = (POINTS + 0.1 * noise).astype(dtype)
    for index, points in enumerate(positions):
        path = folder / name.format(index)
        mesh = {"vtu": grid, "vtp": poly_data}[path.suffix[1:]](points)
        write_mesh(xml_writer(path.suffix[1:]), mesh, path)
    return positions


@pytest.mark.parametrize("extension", ["vtu", "vtp"])
def test_folder_or_pattern_of_frame_files_is_read_in_natural_order(tmp_path, extension, read):
    positions = write_series(tmp_path, 11, f"f_{{}}.{extension}")
    for source in (tmp_path, tmp_path / f"f_*.{extension}"):
        result = read(source, fps=24)
        assert positions_of(result).tobytes() == positions.tobytes()
        assert result.surface.face_sizes.tolist() == [4, 3, 5]
        assert {attribute.name for attribute in result.surface.attributes} == {"uv set", "paint"}


@pytest.mark.parametrize("fps", [24.0, 29.97, 60.0])
def test_collection_gives_times_and_files_of_the_frames(tmp_path, fps, read):
    (tmp_path / "parts").mkdir()
    positions = write_series(tmp_path, 5, "parts/f_{}.vtp")
    rows = [f'timestep="{2 + i / fps!r}" file="parts/f_{i}.vtp"' for i in (3, 0, 1, 2, 4)]
    result = read(write_pvd(tmp_path, rows))
    assert isinstance(result, StoredFrames) == (read is open_source)
    assert positions_of(result).tobytes() == positions.tobytes()
    assert (result.fps, result.start_s, result.name) == (fps, 2.0, "a")
    assert {attribute.name for attribute in result.surface.attributes} == {"uv set", "paint"}
    heat = result.tracks["heat"]
    assert heat.domain == Domain.FACE
    assert heat.read(0, 5).reshape(5, -1).tolist() == [HEAT.tolist()] * 5


def test_changing_data_of_a_collection_are_a_track(tmp_path, notes):
    write_series(tmp_path, 2, "f_{}.vtp")
    mesh = poly_data()
    mesh.GetCellData().GetArray("heat").SetValue(0, 9.0)
    write_mesh(xml_writer("vtp"), mesh, tmp_path / "f_1.vtp")
    path = write_pvd(tmp_path, [f'timestep="{i}" file="f_{i}.vtp"' for i in range(2)])
    write_mesh(xml_writer("vtp"), poly_data(POINTS.astype(np.float32)), tmp_path / "f_0.vtp")
    loaded = load(path, notes=notes)
    assert {attribute.name for attribute in loaded.surface.attributes} == {"uv set", "paint"}
    assert (list(loaded.tracks), notes) == (["heat"], [])


def test_load_lists_the_parts_of_a_collection(tmp_path):
    positions = write_series(tmp_path, 4, "f_{}.vtu")
    path = write_pvd(
        tmp_path, [f'timestep="{i // 2}" part="{i % 2}" file="f_{i}.vtu"' for i in range(4)]
    )
    with pytest.raises(InvalidInputError, match="holds 2 meshes: /part_0, /part_1; choose one"):
        load(path)
    assert load(path, object="part_1").vertices.tobytes() == positions[1::2].tobytes()
    assert load(path, merge=True).n_verts == 20


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ('timestep="0" file="../f_0.vtu"', r"refers to the file '../f_0.vtu' outside its folder"),
        ('timestep="0" file="/etc/passwd"', "refers to the file '/etc/passwd' outside its folder"),
        ('timestep="0" file="out/f_0.vtu"', "refers to the file 'out/f_0.vtu' outside its folder"),
        ('timestep="0" file="gone.vtu"', "refers to the file 'gone.vtu', which does not exist"),
        ('timestep="0" file=""', "refers to the file '', which does not exist"),
        (
            'timestep="0" file="a.pvd"',
            r"refers to a.pvd; .vtu, .vtp, .vtk, .pvtu, .pvtp files are supported",
        ),
        ('timestep="soon" file="f_0.vtu"', "has the timestep 'soon'; expected a finite number"),
        ('timestep="nan" file="f_0.vtu"', "has the timestep 'nan'; expected a finite number"),
    ],
)
def test_load_rejects_collections_with_invalid_files_or_times(tmp_path, row, message):
    folder = tmp_path / "within"
    folder.mkdir()
    write_series(tmp_path, 1)
    write_series(folder, 1)
    (folder / "out").symlink_to(tmp_path)
    with pytest.raises(FormatError, match=rf"a\.pvd: {message}"):
        load(write_pvd(folder, [row]))


def unnamed_pieces(folder, times=(0, 0, 1, 1)):
    """Write a collection whose files have times but no parts; return it and the positions."""
    positions = write_series(folder, len(times), "f_{}.vtp")
    rows = [f'timestep="{time}" file="f_{i}.vtp"' for i, time in enumerate(times)]
    return write_pvd(folder, rows), positions


@pytest.mark.parametrize("choice", [{}, {"object": "a"}])
def test_load_suggests_merging_files_of_one_time(tmp_path, choice):
    path, _ = unnamed_pieces(tmp_path)
    with pytest.raises(InvalidInputError, match=r"lists 2 files for the time 0 .* with merge"):
        load(path, **choice)


def test_load_does_not_suggest_merging_first_after_a_restart(tmp_path):
    path, _ = unnamed_pieces(tmp_path, (0, 1, 2, 1, 2, 3))
    message = (
        r"2 files for the time 1 and 1 for the time 0, as after a restart; delete the older "
        r"entries of such times, or read .* with fps; if they are pieces of one mesh, .* with merge"
    )
    with pytest.raises(InvalidInputError, match=message):
        load(path)


@pytest.mark.parametrize("empty", [0, 1])
def test_skip_bad_leaves_out_steps_without_faces(tmp_path, empty, notes):
    positions, times = write_series(tmp_path, 4), [0, 0.5, 0.75, 3]
    write_mesh(xml_writer("vtu"), grid(POINTS[:0], []), tmp_path / f"f_{empty}.vtu")
    rows = [f'timestep="{time}" file="f_{i}.vtu"' for i, time in enumerate(times)]
    path = write_pvd(tmp_path, rows)
    name, time = f"f_{empty}.vtu", times.pop(empty)
    message = rf"{name}: holds 0 vertices .* step at time {time:g}, .* with skip_bad=True"
    with pytest.raises(FormatError, match=message):
        load(path)
    found = load(path, skip_bad=True, notes=notes)
    np.testing.assert_array_equal(found.vertices, np.delete(positions, empty, axis=0))
    assert found.times.tolist() == times
    assert f"left out: steps without faces: {name} (time {time:g})" in notes
    with pytest.raises(FormatError, match=rf"only files without faces: {name}"):
        load(write_pvd(tmp_path, [rows[empty]]), skip_bad=True)


def test_merge_joins_the_files_of_a_time(tmp_path, read):
    path, positions = unnamed_pieces(tmp_path)
    result = read(path, merge=True)
    expected = positions.reshape(2, -1, 3)
    assert positions_of(result).tobytes() == expected.tobytes()
    assert [part.name for part in result.surface.parts] == ["/piece_0", "/piece_1"]
    assert {attribute.name for attribute in result.surface.attributes} == {"uv set", "paint"}
    assert set(result.tracks) == {"heat"}


def test_files_of_a_time_keep_the_order_of_the_collection(tmp_path):
    positions = write_series(tmp_path, 4, "f_{}.vtp")
    rows = [f'timestep="{time}" file="f_{i}.vtp"' for time, i in ((0, 1), (1, 3), (0, 0), (1, 2))]
    path = write_pvd(tmp_path, rows)
    joined = load(path, merge=True)
    assert joined.vertices.tobytes() == positions[[1, 0, 3, 2]].tobytes()
    apart = load(path, fps=12)
    assert apart.vertices.tobytes() == positions[[1, 3, 0, 2]].tobytes()


@pytest.mark.parametrize("times", [(0, 0, 1, 1), (0, 1, 2, 1), (0, 0, 0, 0)])
def test_frame_rate_reads_files_of_equal_times_in_file_order(tmp_path, read, times, notes):
    path, positions = unnamed_pieces(tmp_path, times)
    with pytest.raises(InvalidInputError, match=r"or read each file as a frame, .* with fps"):
        read(path)
    result = read(path, fps=12, notes=notes)
    assert positions_of(result).tobytes() == positions.tobytes()
    assert (result.fps, result.start_s, result.n_frames) == (12, 0, 4)
    assert notes == ["frame times are not ascending; read in file order at 12 frames per second"]


def test_load_sorts_files_with_distinct_times(tmp_path):
    path, positions = unnamed_pieces(tmp_path, (3, 1, 2, 0))
    assert load(path, fps=12).vertices.tobytes() == positions[[3, 1, 2, 0]].tobytes()


def test_merge_joins_files_of_a_time_at_a_given_rate(tmp_path):
    path, positions = unnamed_pieces(tmp_path)
    loaded = load(path, merge=True, fps=12)
    assert (loaded.fps, loaded.n_verts) == (12, 2 * positions.shape[1])


def test_merge_does_not_invent_missing_pieces(tmp_path):
    path, positions = unnamed_pieces(tmp_path, (0, 1, 1, 2, 3, 3))
    segments = load(path, merge=True).segments
    shapes = [(segment.n_frames, segment.n_verts, segment.timing.start_s) for segment in segments]
    assert shapes == [(1, 10, 0), (1, 20, 1), (1, 10, 2), (1, 20, 3)]
    read = np.concatenate([segment.read(0, 1).reshape(-1, 3) for segment in segments])
    assert read.tobytes() == positions.tobytes()


@pytest.mark.parametrize("file", ["../f_0.vtu", "{above}/f_0.vtu", "out/f_0.vtu"])
def test_allow_outside_reads_files_outside_the_folder(tmp_path, file):
    folder = tmp_path / "within"
    folder.mkdir()
    positions = write_series(tmp_path, 1)
    (folder / "out").symlink_to(tmp_path)
    path = write_pvd(folder, [f'timestep="0" file="{file.format(above=tmp_path)}"'])
    assert load(path, allow_outside=True).vertices.tobytes() == positions.tobytes()


SHORT_TEXT = "declares the entity 'a'; only short plain text is supported"


@pytest.mark.parametrize(
    ("declarations", "text", "message"),
    [
        ('<!ENTITY a SYSTEM "file:///etc/passwd">', "&a;", SHORT_TEXT),
        ('<!ENTITY % a "b">', "", SHORT_TEXT),
        ('<!ENTITY b "x"><!ENTITY a "&b;">', "&a;", SHORT_TEXT),
        (f'<!ENTITY a "{"x" * 9999}">', "&a;" * 2000, SHORT_TEXT),
        ("", "&a;", "refers to the entity b'a', which is not declared"),
    ],
)
def test_load_rejects_entities_without_bound(tmp_path, declarations, text, message):
    head = f'<!DOCTYPE a SYSTEM "a.dtd" [{declarations}]>'
    (tmp_path / "a.pvd").write_text(f"{head}<VTKFile type='Collection'>{text}</VTKFile>")
    with pytest.raises(FormatError, match=message):
        load(tmp_path / "a.pvd")


def test_load_rejects_deep_nesting(tmp_path):
    (tmp_path / "a.pvd").write_text("<a>" * 300)
    with pytest.raises(FormatError, match="nested deeper than 200 levels"):
        load(tmp_path / "a.pvd")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"VTKFile type", b"File type", "is not XML, or is damaged"),
        (b"<VTKFile", b"# vtk", "is a legacy file of VTK; give it the extension .vtk"),
        (b'type="UnstructuredGrid"', b'type="ImageData"', "is VTKFile of type 'ImageData'"),
        (b'Name="types"', b'Name="tips"', "Cells has no array 'types'"),
        (
            b'type="Float64" Name="Points"',
            b'type="String" Name="Points"',
            "array 'Points' has type 'String'",
        ),
        (b'format="ascii"', b'format="riddle"', "unknown format 'riddle'"),
        (b'NumberOfComponents="3"', b'NumberOfComponents="7"', "array 'Points' is damaged"),
        (b"4 7 12", b"4 3 12", "offsets of Cells must ascend from 0"),
        (b"4 7 12", b"4 7 999", "must ascend from 0, in steps of at most"),
        (
            b"4 7 12",
            b"4 7 11",
            "'connectivity' is damaged .it has 12 numbers; the file declares 11",
        ),
        (b"0 1 2 3 1 4", b"0 1 2 3 1 99", "face 1: uses vertex 99; indices must be in 0..9"),
        (b"0 1 2 3 1 4", b"0 1 2 3 1 x", "array 'connectivity' is damaged"),
    ],
)
def test_load_explains_errors_of_invalid_xml_files(tmp_path, old, new, message):
    path = write_mesh(xml_writer("vtu", TEXT), grid(), tmp_path / "a.vtu")
    data = path.read_bytes()
    assert old in data
    path.write_bytes(data.replace(old, new, 1))
    with pytest.raises(FormatError, match=rf"a\.vtu: .*{message}"):
        load(path)


def test_load_rejects_blocks_that_declare_too_many_bytes(tmp_path):
    path = write_mesh(xml_writer("vtu", APPENDED, "ZLib", header=32), grid(), tmp_path / "a.vtu")
    data = bytearray(path.read_bytes())
    start = data.index(b"_", data.index(b"<AppendedData")) + 1
    data[start + 4 : start + 12] = np.array([1 << 31, 0], np.uint32).tobytes()
    path.write_bytes(data)
    with pytest.raises(
        FormatError, match="it has 2147483648 bytes; the counts of the file allow 80"
    ):
        load(path)
    data[start : start + 4] = np.uint32((1 << 32) - 1).tobytes()
    path.write_bytes(data)
    with pytest.raises(FormatError, match="bytes; 17179869192 are declared"):
        load(path)


FILES = {
    "text.vtu": lambda: (xml_writer("vtu", TEXT), grid()),
    "raw.vtu": lambda: (xml_writer("vtu", APPENDED), grid()),
    "zlib.vtp": lambda: (xml_writer("vtp", BINARY, "ZLib"), poly_data()),
    "lz4.vtu": lambda: (xml_writer("vtu", APPENDED, "LZ4"), grid()),
    "lzma.vtp": lambda: (xml_writer("vtp", APPENDED, "LZMA", raw=False), poly_data()),
    "text.vtk": lambda: (legacy_writer("grid", is_text=True), grid()),
    "binary.vtk": lambda: (legacy_writer("polydata", is_text=False), poly_data()),
    "old.vtk": lambda: (legacy_writer("grid", is_text=False, version=42), grid()),
}


@pytest.mark.damaged
@pytest.mark.parametrize("name", FILES)
def test_damaged_files_raise_only_meshreel_errors(tmp_path, name, capfd):
    path = write_mesh(*FILES[name](), tmp_path / name)
    load(path)
    read_damaged(path, 300, n_header=2500)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("name", ["text.vtu", "zlib.vtp", "text.vtk", "binary.vtk"])
@pytest.mark.parametrize("share", [0, 0.01, 0.3, 0.7, 0.95])
def test_error_for_a_truncated_file_names_it(tmp_path, name, share):
    path = write_mesh(*FILES[name](), tmp_path / name)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(FormatError, match=rf"{name}: "):
        load(path)


def test_save_rejects_read_only_formats(tmp_path):
    message = r"a\.vtk: \.vtk files can be read, but not written; writable are \.obj, "
    with pytest.raises(FormatError, match=message):
        save(plain_sequence(n_frames=1), tmp_path / "a.vtk")


PIECE = """<VTKFile type="{kind}" byte_order="LittleEndian"><{kind}>
<Piece NumberOfPoints="{n_points}" {count}="{n_cells}">
<Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">
0 0 0 1 0 0 0 1 0 1 1 0</DataArray></Points>
<{group}><DataArray type="Int64" Name="connectivity" format="ascii">0 1 2 1 3 2</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">3 6</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">5 5</DataArray></{group}>
</Piece></{kind}></VTKFile>"""
KINDS = {"vtu": ("UnstructuredGrid", "NumberOfCells", "Cells"),
         "vtp": ("PolyData", "NumberOfPolys", "Polys")}  # fmt: skip


def small_file(folder, extension, n_points="4", n_cells="2"):
    kind, count, group = KINDS[extension]
    path = folder / f"small.{extension}"
    text = PIECE.format(kind=kind, count=count, group=group, n_points=n_points, n_cells=n_cells)
    path.write_text(text)
    return path


@pytest.mark.every_case
@pytest.mark.parametrize("extension", KINDS)
def test_load_accepts_matching_counts(tmp_path, extension):
    assert load(small_file(tmp_path, extension)).faces.tolist() == [[0, 1, 2], [1, 3, 2]]


@pytest.mark.every_case
@pytest.mark.parametrize("extension", KINDS)
@pytest.mark.parametrize("given", [{"n_points": "5"}, {"n_cells": "1"}, {"n_cells": "-2"},
                                   {"n_points": "9999999999"}, {"n_cells": "two"}])  # fmt: skip
def test_load_rejects_counts_that_differ_from_the_arrays(tmp_path, extension, given):
    (value,) = given.values()
    message = f"numbers; the file declares|declares NumberOf.*={value!r}; expected a number"
    with pytest.raises(FormatError, match=message):
        load(small_file(tmp_path, extension, **given))


@pytest.mark.parametrize("data", [b"<svg/>", b'<?xml version="1.0"?><VTKFile type="PolyData">'])
def test_other_files_named_vtk_are_rejected(tmp_path, data):
    (tmp_path / "a.vtk").write_bytes(data)
    message = "does not begin with '# vtk DataFile Version'.*VTK XML files is .vtp, .vtu or .pvd"
    with pytest.raises(FormatError, match=message):
        load(tmp_path / "a.vtk")
