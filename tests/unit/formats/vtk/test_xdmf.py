import sys

import numpy as np
import pytest

from conformance.sources import mixed_cells as mixed_cells_of_volumes
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.load import load
from meshreel.model.surface import Domain, Kind
from meshreel.operations.save import save
from samples.datasets import CORNERS, COUNTS, N_VERTS, positions_of, read_damaged
from samples.meshes import waving_grid
from samples.opening import open_source
from samples.vtk_text import inline_item as inline
from samples.vtk_text import xdmf_item as item

POSITIONS = np.random.default_rng(0).standard_normal((5, N_VERTS, 3)).astype(np.float32)
TRIANGLES = np.array([[0, 1, 2], [2, 3, 4], [5, 6, 10]])
UV = np.random.default_rng(1).random((N_VERTS, 2))


def topology(data=None, kind="Triangle", more=""):
    data = inline(TRIANGLES) if data is None else data
    return f'<Topology TopologyType="{kind}" {more}>{data}</Topology>'


def geometry(data, kind="XYZ"):
    return f'<Geometry GeometryType="{kind}">{data}</Geometry>'


def attribute(name, data, center="Node"):
    return f'<Attribute Name="{name}" Center="{center}">{data}</Attribute>'


def step(points, time=None, more="", faces=None, name="body"):
    value = "" if time is None else f'<Time Value="{time!r}"/>'
    faces = topology() if faces is None else faces
    return f'<Grid Name="{name}">{value}{faces}{geometry(inline(points))}{more}</Grid>'


def temporal(*grids, time="", name="walk"):
    head = f'<Grid Name="{name}" GridType="Collection" CollectionType="Temporal">'
    return f"{head}{time}{''.join(grids)}</Grid>"


def store(folder, *grids, name="a.xdmf"):
    text = f'<Xdmf Version="3.0"><Domain>{"".join(grids)}</Domain></Xdmf>'
    entities = '<!ENTITY HeavyData "a.h5"><!ENTITY folder "/">'
    doctype = f'<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" [{entities}]>'
    (folder / name).write_text(f'<?xml version="1.0" ?>\n{doctype}\n{text}')
    return folder / name


@pytest.mark.parametrize("extension", ["xdmf", "xmf"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("fps", [24.0, 29.97, 60.0])
def test_reading_gives_steps_and_times_of_inline_numbers(tmp_path, extension, dtype, fps, read):
    positions = POSITIONS.astype(dtype)
    steps = [step(points, 2 + index / fps) for index, points in enumerate(positions)]
    result = read(store(tmp_path, temporal(*steps), name=f"a.{extension}"))
    assert isinstance(result, StoredFrames) == (read is open_source)
    assert result.dtype == dtype
    assert positions_of(result).tobytes() == positions.tobytes()
    assert result.faces.tolist() == TRIANGLES.tolist()
    assert (result.fps, result.start_s, result.name) == (fps, 2.0, "walk")


def write_hdf_steps(folder, make_points):
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "a.h5", "w") as file:
        file["faces"] = TRIANGLES
        file["all"] = POSITIONS
        file["xy"] = POSITIONS[:, :, :2]
        for index, points in enumerate(POSITIONS):
            file[f"step_{index}/points"] = points
    faces = topology(item("a.h5:/faces", Dimensions="3 3", NumberType="Int", Format="HDF"))
    steps = [
        f'<Grid><Time Value="{index / 25!r}"/>{faces}{geometry(make_points(index))}</Grid>'
        for index in range(5)
    ]
    return store(folder, temporal(*steps))


def dataset_of_step(index):
    return item(f" a.h5:/step_{index}/points\n", Dimensions=f"{N_VERTS} 3", Format="HDF")


def slab_of_step(index):
    place = inline(np.array([[index, 0, 0], [1, 1, 1], [1, N_VERTS, 3]]))
    whole = item("a.h5:/all", Dimensions=f"5 {N_VERTS} 3", Format="HDF")
    return item(place + whole, ItemType="HyperSlab", Dimensions=f"1 {N_VERTS} 3")


def selection_of_step(index):
    """A part of a dataset selected after its path, as XDMF 3 writes it."""
    place = f"a.h5:/all|{index} 0 0:1 1 1:1 {N_VERTS} 3:5 {N_VERTS} 3"
    return item(place, Dimensions=f"{N_VERTS} 3", Format="HDF")


def entity_of_step(index):
    return dataset_of_step(index).replace("a.h5:/", "&HeavyData;:&folder;")


def columns_of_step(index):
    """The columns of a dataset, joined; the last one is computed."""
    xy = item("a.h5:/xy", Dimensions=f"5 {N_VERTS} 2", Format="HDF")
    x, y = (
        item(
            inline(np.array([[index, 0, axis], [1, 1, 1], [1, N_VERTS, 1]])) + xy,
            ItemType="HyperSlab",
            Dimensions=f"{N_VERTS} 1",
        )
        for axis in (0, 1)
    )
    z = item(x + y, ItemType="Function", Function="($0 - 2.5 * -$1) / 2", Dimensions=N_VERTS)
    return item(
        x + y + z, ItemType="Function", Function="JOIN($0; $1, $2)", Dimensions=f"{N_VERTS} 3"
    )


@pytest.mark.parametrize(
    "make_points",
    [dataset_of_step, slab_of_step, selection_of_step, entity_of_step, columns_of_step],
)
def test_reading_gives_numbers_of_hdf5_files(tmp_path, make_points, read):
    result = read(write_hdf_steps(tmp_path, make_points))
    if make_points is columns_of_step:
        x, y = POSITIONS[:, :, 0], POSITIONS[:, :, 1]
        expected = np.stack([x, y, (x + 2.5 * y) / 2], axis=2)
        np.testing.assert_allclose(positions_of(result), expected, rtol=1e-6)
    else:
        assert positions_of(result).tobytes() == POSITIONS.tobytes()
    assert result.faces.tolist() == TRIANGLES.tolist()
    assert result.fps == 25


@pytest.mark.parametrize(
    ("selection", "message"),
    [
        ("0 0 0:1 1 1:6 11 3:5 11 3", "has a HyperSlab outside its source"),
        ("0 0 0:0 1 1:1 11 3:5 11 3", "has a HyperSlab outside its source"),
        ("0 0 0:1 1 1:1 11 3", "expected start:stride:count:size with this size"),
        ("0 0 0:1 1 1:1 11 3:6 11 3", r"of an array of shape \(5, 11, 3\)"),
        ("0 0:1 1 1:1 11 3:5 11 3", "has a HyperSlab without start, stride and count"),
        ("0 -1 0:1 1 1:1 11 3:5 11 3", "has '-1' where a non-negative integer is expected"),
        ("", "expected start:stride:count:size"),
    ],
)
def test_invalid_parts_of_datasets_are_errors(tmp_path, selection, message):
    place = item(f"a.h5:/all|{selection}", Dimensions=f"{N_VERTS} 3", Format="HDF")
    with pytest.raises(FormatError, match=message):
        load(write_hdf_steps(tmp_path, lambda index: place))


def test_data_stored_once_may_be_declared_for_each_step(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["points"], file["faces"] = POSITIONS[:1], TRIANGLES.astype(float)
        file["heat"] = np.arange(3.0 * N_VERTS).reshape(3, N_VERTS)
    points = item(f"a.h5:/points|0 0 0:1 1 1:1 {N_VERTS} 3:3 {N_VERTS} 3", Format="HDF")
    faces = topology(item("a.h5:/faces", Format="HDF"))
    rows = item("a.h5:/heat", Dimensions=f"3 {N_VERTS} 1", Format="HDF")
    heat = [
        item(
            f"{inline(np.array([[index, 0, 0], [1, 1, 1], [1, N_VERTS, 1]]))}{rows}",
            ItemType="HyperSlab",
            Dimensions=f"1 {N_VERTS} 1",
        )
        for index in range(3)
    ]
    mesh = faces + geometry(points)
    steps = [
        f'<Grid><Time Value="{index}"/>{mesh}{attribute("heat", values)}</Grid>'
        for index, values in enumerate(heat)
    ]
    loaded = load(store(tmp_path, temporal(*steps)))
    assert loaded.vertices.tobytes() == POSITIONS[[0, 0, 0]].tobytes()
    assert loaded.faces.tolist() == TRIANGLES.tolist()
    assert loaded.tracks["heat"].values.ravel().tolist() == list(range(3 * N_VERTS))


def test_time_of_a_single_grid_is_its_start(tmp_path, notes):
    assert load(store(tmp_path, step(POSITIONS[0], 2.5)), notes=notes).start_s == 2.5
    assert notes == []


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        ("", "has a Attribute with 0 DataItems; expected 1"),
        (item("a.h5:/gone", Format="HDF"), "has no dataset /gone"),
        (item("&#65;"), "has a DataItem that is not numbers"),
        (item(inline([1]), ItemType="Function", Function="SIN($0)"), "only +, -, *, / and JOIN of"),
        (item(inline([1]), ItemType="Function", Function="$0 + $1"), "cannot compute the function"),
        (item(inline([1]), ItemType="Function", Function="(" * 190), "cannot compute the functi"),
        (item("", ItemType="Function", Function="1" * 201), "longer than 200 characters"),
    ],
)
def test_attributes_that_cannot_be_read_are_left_out(tmp_path, data, reason, notes, read):
    path = write_hdf_steps(tmp_path, dataset_of_step)
    text = path.read_text().replace("</Geometry>", f"</Geometry>{attribute('heat', data)}")
    path.write_text(text)
    assert read(path, notes=notes).tracks == {}
    [note] = notes
    assert note.startswith("left out: array 'heat', which ")
    assert reason in note


def test_other_elements_are_noted(tmp_path, notes):
    info = '<Information Name="{}" Value="1"/>'.format
    unused = inline(UV, Name="spare")
    grids = [step(points, index, info("mass")) for index, points in enumerate(POSITIONS)]
    other = step(POSITIONS[0], name="other")
    load(store(tmp_path, info("code"), unused, temporal(*grids), other), notes=notes)
    assert notes == [
        "left out: data to which no grid refers: spare",
        "left out: information: code, mass",
        "left out: grids: other",
    ]


@pytest.mark.parametrize(("endian", "order"), [("Little", "<"), ("Big", ">"), ("Native", "<")])
def test_load_reads_numbers_of_binary_files(tmp_path, endian, order):
    points = POSITIONS[0].astype(order + "f4")
    (tmp_path / "points.bin").write_bytes(b"12345" + points.tobytes())
    facts = {"Dimensions": f"{N_VERTS} 3", "Precision": 4, "Endian": endian, "Seek": 5}
    data = item("points.bin", Format="Binary", **facts)
    loaded = load(store(tmp_path, f"<Grid>{topology()}{geometry(data)}</Grid>"))
    assert loaded.vertices[0].tobytes() == POSITIONS[0].tobytes()


@pytest.mark.skipif(sys.platform == "win32", reason="names of files have no colons there")
def test_name_of_a_data_file_may_contain_a_colon(tmp_path):
    path = write_hdf_steps(tmp_path, dataset_of_step)
    (tmp_path / "a.h5").rename(tmp_path / "shot:1.h5")
    path.write_text(path.read_text().replace("a.h5", "shot:1.h5"))
    assert positions_of(load(path)).tobytes() == POSITIONS.tobytes()


@pytest.mark.parametrize("extension", ["xdmf", "xmf"])
def test_error_for_writing_names_formats_that_paraview_reads(tmp_path, extension):
    message = rf"\.{extension} files can be read, but not written; .* read \.vtkhdf and \.pvd$"
    with pytest.raises(FormatError, match=message):
        save(waving_grid(2), tmp_path / f"a.{extension}")
    assert list(tmp_path.iterdir()) == []


def test_data_files_outside_the_folder_need_allow_outside(tmp_path):
    POSITIONS[0].astype("<f4").tofile(tmp_path / "a.bin")
    (tmp_path / "in").mkdir()
    shape = " ".join(map(str, POSITIONS[0].shape))
    data = item("../a.bin", Format="Binary", Dimensions=shape, Endian="Little")
    path = store(tmp_path / "in", f"<Grid>{topology()}{geometry(data)}</Grid>")
    with pytest.raises(FormatError, match="outside its folder; move it into the folder"):
        load(path)
    loaded = load(path, allow_outside=True)
    assert loaded.vertices[0].tobytes() == POSITIONS[0].astype(np.float32).tobytes()


def mixed_cells():
    """The sample polygons, a line and a point as a mixed topology."""
    ends = np.cumsum(COUNTS)
    cells = [CORNERS[end - count : end].tolist() for end, count in zip(ends, COUNTS, strict=True)]
    heads = {3: [4], 4: [5], 5: [3, 5]}
    return np.array([2, 2, 0, 1] + [one for cell in cells for one in heads[len(cell)] + cell])


@pytest.mark.parametrize(
    ("kind", "cells", "more", "sizes"),
    [
        ("Mixed", mixed_cells(), "", [4, 3, 5, 3]),
        ("Quadrilateral", [[0, 1, 2, 3], [3, 4, 5, 6]], "", [4, 4]),
        ("Polygon", [[0, 1, 2, 3, 4]], 'NodesPerElement="5"', [5]),
        ("Polygon", [[0, 1, 2, 3, 4]], "", [5]),
        ("Tri_6", [[0, 1, 2, 3, 4, 5]], "", None),
        ("Tetrahedron", [0, 1, 2, 3], "", None),
    ],
)
def test_load_reads_every_type_of_cells(tmp_path, kind, cells, more, sizes):
    faces = topology(inline(np.array(cells)), kind, more)
    loaded = load(store(tmp_path, step(POSITIONS[0], faces=faces)))
    sizes_found = loaded.surface.face_sizes
    assert (None if sizes_found is None else sizes_found.tolist()) == sizes
    assert loaded.n_verts == N_VERTS
    assert (loaded.surface.cells is not None) == (kind == "Tetrahedron")


XDMF_TYPES = {
    5: 4, 9: 5, 10: 6, 12: 9, 13: 8, 14: 7, 21: 34, 22: 36, 23: 37, 24: 38, 25: 48, 26: 40, 27: 39,
    28: 35, 29: 50, 32: 41, 33: 49,
}  # fmt: skip
"""Type in XDMF of each type of VTK with a fixed number of nodes."""


def test_mixed_cells_may_have_all_types(tmp_path):
    cells = mixed_cells_of_volumes(80, N_VERTS * 6)
    nodes = np.split(cells.nodes.tolist(), cells.starts[1:-1])
    pairs = zip(cells.types.tolist(), nodes, strict=True)
    rows = [(kind, row.tolist()) for kind, row in pairs if kind in XDMF_TYPES]
    mixed = [number for kind, row in rows for number in (XDMF_TYPES[kind], *row)]
    points = np.random.default_rng(2).random((N_VERTS * 6, 3))
    faces = topology(inline(np.array(mixed)), "Mixed")
    found = load(store(tmp_path, step(points, faces=faces))).surface.cells
    assert found.types.tolist() == [kind for kind, _ in rows]
    assert found.nodes.tolist() == [node for _, row in rows for node in row]


def test_load_reads_xy_points_and_separate_columns(tmp_path):
    flat = f"<Grid>{topology()}{geometry(inline(POSITIONS[0, :, :2]), 'XY')}</Grid>"
    loaded = load(store(tmp_path, flat))
    np.testing.assert_array_equal(loaded.vertices[0, :, :2], POSITIONS[0, :, :2])
    assert not loaded.vertices[0, :, 2].any()
    columns = "".join(inline(POSITIONS[0, :, axis]) for axis in range(3))
    loaded = load(store(tmp_path, f"<Grid>{topology()}{geometry(columns, 'X_Y_Z')}</Grid>"))
    assert loaded.vertices[0].tobytes() == POSITIONS[0].tobytes()


@pytest.mark.parametrize(
    ("time", "fps", "start_s"),
    [
        (f'<Time TimeType="List">{inline(np.arange(5) / 50 + 1)}</Time>', 50, 1),
        (f'<Time TimeType="HyperSlab">{inline(np.array([1, 0.5, 5]))}</Time>', 2, 1),
        ('<Time TimeType="Range">1 2</Time>', 4, 1),
    ],
)
def test_load_reads_the_times_of_a_collection(tmp_path, time, fps, start_s):
    steps = [step(points) for points in POSITIONS]
    loaded = load(store(tmp_path, temporal(*steps, time=time)))
    assert (loaded.fps, loaded.start_s) == (fps, start_s)


def test_missing_times_are_noted(tmp_path, notes):
    loaded = load(store(tmp_path, temporal(*map(step, POSITIONS))), notes=notes)
    assert loaded.fps == 1
    assert "has no times; read as one frame per second" in notes[0]


def test_frame_rate_keeps_the_start_of_ascending_times(tmp_path, notes):
    steps = [step(points, 2 + index) for index, points in enumerate(POSITIONS)]
    loaded = load(store(tmp_path, temporal(*steps)), fps=12, notes=notes)
    assert (loaded.fps, loaded.start_s, notes) == (12, 2, [])


def test_grids_of_points_are_left_out_with_a_note(tmp_path, notes):
    points = '<Topology TopologyType="Polyvertex" NodesPerElement="9"/>'
    swarm = temporal(step(POSITIONS[0], 0.0, faces=points), name="swarm")
    loaded = load(store(tmp_path, temporal(step(POSITIONS[0], 0.0)), swarm), notes=notes)
    assert (loaded.name, notes) == ("walk", ["left out: grids of points: /swarm"])
    with pytest.raises(FormatError, match="has only grids of points"):
        load(store(tmp_path, swarm))


def test_constant_data_are_attributes_and_changing_data_tracks(tmp_path, notes):
    same = attribute("uv", inline(UV)) + attribute("heat", inline(np.arange(3)), "Cell")
    same += attribute("total", inline(np.arange(1)), "Grid")
    steps = [
        step(points, index, same + attribute("speed", inline(np.full(N_VERTS, index))))
        for index, points in enumerate(POSITIONS)
    ]
    loaded = load(store(tmp_path, temporal(*steps)), notes=notes)
    uv, heat = loaded.surface.attributes
    assert (uv.name, uv.kind, uv.domain) == ("uv", Kind.UV, Domain.VERTEX)
    assert uv.values.tobytes() == UV.tobytes()
    assert (heat.name, heat.domain, heat.values.ravel().tolist()) == (
        "heat",
        Domain.FACE,
        [0, 1, 2],
    )
    assert loaded.tracks["speed"].values.tolist() == [
        [[index]] * N_VERTS for index in range(len(POSITIONS))
    ]
    assert not any("speed" in note for note in notes)


def test_load_follows_references_and_includes(tmp_path):
    mesh = step(POSITIONS[0], name="mesh")
    include = (
        '<xi:include xpointer="xpointer(//Grid[@Name=&quot;mesh&quot;]'
        '/*[self::Topology or self::Geometry])"/>'
    )
    grids = [f'<Grid><Time Value="{index}"/>{include}</Grid>' for index in range(3)]
    assert load(store(tmp_path, mesh, temporal(*grids))).n_frames == 3
    reference = '<Topology Reference="/Xdmf/Domain/Grid[1]/Topology"/>'
    by_text = '<Topology Reference="XML">/Xdmf/Domain/Grid/Topology</Topology>'
    steps = [step(POSITIONS[i], i, faces=one) for i, one in enumerate([reference, by_text])]
    loaded = load(store(tmp_path, mesh, temporal(*steps)))
    assert loaded.faces.tolist() == TRIANGLES.tolist()
    assert positions_of(loaded).tobytes() == POSITIONS[:2].tobytes()


def test_load_lists_the_grids(tmp_path):
    spatial = [
        '<Grid GridType="Collection" CollectionType="Spatial">'
        f'<Time Value="{i}"/>{step(POSITIONS[i], name="left")}'
        f"{step(POSITIONS[i + 1], name='right')}</Grid>"
        for i in range(3)
    ]
    path = store(tmp_path, temporal(*spatial))
    with pytest.raises(InvalidInputError, match="holds 2 meshes: /left, /right; choose one"):
        load(path)
    loaded = load(path, object="right")
    assert positions_of(loaded).tobytes() == POSITIONS[1:4].tobytes()
    path = store(tmp_path, step(POSITIONS[0]), step(POSITIONS[1]))
    with pytest.raises(InvalidInputError, match="holds 2 meshes: /body_0, /body_1"):
        load(path)
    assert load(path, merge=True).n_verts == 2 * N_VERTS


def at(data):
    return f"<Grid>{topology()}{geometry(data)}</Grid>"


def slab(*numbers):
    whole = inline(POSITIONS)
    return at(item(inline(np.array(numbers)) + whole, ItemType="HyperSlab"))


SELF = '<DataItem Reference="/Xdmf/Domain/Grid/Geometry/DataItem"/>'
OF_FIRST = '<Topology Reference="XML">/Xdmf/Domain/Grid/Grid/Topology</Topology>'
WITHIN = item(SELF + "<DataItem/>", ItemType="HyperSlab", Dimensions="1")


@pytest.mark.parametrize(
    ("grid", "message"),
    [
        ("", "has no Grid in a Domain"),
        ("<Grid/>", "has a grid '' without Geometry"),
        (f"<Grid>{geometry(inline(POSITIONS[0]))}</Grid>", "has a grid '' without Topology"),
        (at(""), "has a Geometry with 0 DataItems"),
        (at(item("../a.h5:/x", Format="HDF")), "refers to the file '../a.h5' outside its folder"),
        (at(item("/etc/passwd", Format="Binary")), "refers to the file '/etc/passwd' outside its"),
        (
            at(item("gone.h5:/x", Format="HDF")),
            "refers to the file 'gone.h5', which does not exist",
        ),
        (at(item("a.xdmf:/x", Format="HDF")), "a.xdmf: is not an HDF5 file, or is damaged"),
        (at(item("a.xdmf", Format="Binary", Dimensions="9999999 3")), "needs 119999988 bytes"),
        (
            at(item("a.xdmf", Format="Binary", Compression="Zlib")),
            "has a compressed binary DataItem",
        ),
        (at(item("1", Format="TIFF")), "has a DataItem of format 'TIFF'"),
        (at(item("1", ItemType="Tree")), "has a DataItem of unsupported type 'tree'"),
        (at(item("1 2 x")), "has a DataItem that is not numbers"),
        (at(item("1 2 3", Dimensions="999999999999999 3")), "has 3 numbers in a DataItem with"),
        (at(item("1 2 3", Dimensions="-1")), "has '-1' where a non-negative integer is expected"),
        (at(item("1 2 3", Precision="3")), "has a DataItem of 'float' with Precision '3'"),
        (at(item("1 2", Dimensions="2")), "has a Geometry of type XYZ with 2 numbers"),
        (at(inline(POSITIONS[0, :3])), "face 1: uses vertex 3; indices must be in 0..2"),
        (at(SELF), "has circular references"),
        (at(WITHIN), "has DataItems nested deeper than 3 levels"),
        (
            at('<DataItem Reference="/Xdmf/x["/>'),
            r"refers to '/Xdmf/x\[', which is not a supported path",
        ),
        (at('<DataItem Reference="//*//*//*"/>'), "which is not a supported path"),
        (at('<DataItem Reference="/Xdmf/Domain[2]"/>'), "which does not exist"),
        (at('<DataItem Reference="/Xdmf/x"/>'), "refers to '/Xdmf/x', which does not exist"),
        (slab([0, 0], [1, 1], [1, 11]), "has a HyperSlab outside its source"),
        (slab([0, 0, 0], [1, 1, 1]), "has a HyperSlab outside its source"),
        (temporal(), "has a collection 'walk' without grids"),
        (
            temporal(step(POSITIONS[0], 0), step(POSITIONS[0], 1), step(POSITIONS[0], 1)),
            "has grid 1 at time 1 and grid 2 at 1; times must ascend",
        ),
        (
            temporal(step(POSITIONS[0], 0), step(POSITIONS[0], np.inf)),
            "has a Time that is not finite",
        ),
        (temporal(step(POSITIONS[0], "x")), "has a Time that is not a number"),
        (
            temporal(step(POSITIONS[0], 0), step(POSITIONS[0, :6], 1, faces=OF_FIRST)),
            r"uses vertex 6; indices must be in 0\.\.5",
        ),
        (temporal(temporal(step(POSITIONS[0]))), "has a grid of type 'Collection' in a step"),
        (
            step(POSITIONS[0], faces=topology(kind="3DSMesh")),
            "has a Topology of unsupported type '3DSMesh'",
        ),
        (step(POSITIONS[0], faces=topology(kind="Wedge")), "of 9 numbers; cells of wedge have 6"),
        (
            step(POSITIONS[0], faces=topology(inline(np.array([77, 1])), "Mixed")),
            "has a cell of unsupported type 77",
        ),
        (
            step(POSITIONS[0], faces=topology(inline(np.array([3, 99, 1])), "Mixed")),
            "has a Topology that ends within a cell",
        ),
        (
            step(POSITIONS[0], faces=topology(inline(np.array([0.5])), "Triangle")),
            "has a Topology with numbers that are not integers",
        ),
        (
            f'<Grid><xi:include href="http://a/b.xdmf"/>{geometry(inline(POSITIONS[0]))}</Grid>',
            "includes 'http://a/b.xdmf'; other files cannot be",
        ),
    ],
)
def test_load_explains_errors_of_invalid_files(tmp_path, grid, message):
    path = store(tmp_path, grid)
    with pytest.raises(FormatError, match=rf"a\.xdmf: .*({message})"):
        load(path)


def test_load_rejects_other_xml(tmp_path):
    (tmp_path / "a.xdmf").write_text("<html/>")
    with pytest.raises(FormatError, match=r"a\.xdmf: is html; expected Xdmf"):
        load(tmp_path / "a.xdmf")


def test_load_reads_xdmf_of_vtk(tmp_path):
    pytest.importorskip("vtkmodules")
    from vtkmodules.vtkIOXdmf2 import vtkXdmfWriter

    from samples.vtk import COLORS, POINTS, grid, write_mesh

    loaded = load(write_mesh(vtkXdmfWriter(), grid(), tmp_path / "a.xmf"))
    np.testing.assert_allclose(loaded.vertices[0], POINTS, rtol=1e-5)
    assert loaded.surface.face_sizes.tolist() == [4, 3, 5]
    [paint] = loaded.surface.of_kind(Kind.COLOR)
    np.testing.assert_array_equal(paint.values, COLORS)


@pytest.mark.damaged
def test_damaged_files_raise_only_meshreel_errors(tmp_path):
    path = write_hdf_steps(tmp_path, slab_of_step)
    read_damaged(path, 300, n_header=3000)
