"""Tracks from point and cell arrays that every frame stores: XDMF, PVD and VTK frame files."""

from itertools import chain
from typing import Any

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.load import load
from meshreel.model.tracks import TrackKind
from samples.opening import open_source

pytest.importorskip("vtkmodules")
from vtkmodules.vtkIOLegacy import vtkUnstructuredGridWriter
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

from samples.vtk import HEAT, POINTS, add_arrays, grid, poly_data, write_mesh
from samples.vtk_text import inline_item, write_pvd

RNG = np.random.default_rng(4)
N_POINTS, N_CELLS = 10, 3

XDMF = """<Xdmf Version="3.0"><Domain>
<Grid Name="walk" GridType="Collection" CollectionType="Temporal">{}</Grid></Domain></Xdmf>"""
STEP = """<Grid Name="body"><Time Value="{time}"/>
<Topology TopologyType="Triangle"><DataItem Dimensions="3 3" NumberType="Int">{faces}</DataItem>
</Topology><Geometry GeometryType="XYZ">{points}</Geometry>{attributes}</Grid>"""


def xdmf(folder, frames):
    """Write a temporal XDMF collection; each frame lists ((center, name), values) pairs."""
    steps = []
    for index, arrays in enumerate(frames):
        attributes = "".join(
            f'<Attribute Name="{name}" Center="{center}">{inline_item(values)}</Attribute>'
            for (center, name), values in arrays
        )
        faces = "0 1 2 2 3 4 5 6 7"
        steps.append(
            STEP.format(
                time=index / 10,
                faces=faces,
                points=inline_item(POINTS + index),
                attributes=attributes,
            )
        )
    (folder / "a.xdmf").write_text(XDMF.format("".join(steps)))
    return folder / "a.xdmf"


def with_arrays(mesh, arrays):
    """Add arrays to the points and cells of a VTK mesh."""
    mesh.GetCellData().RemoveArray("heat")
    for (center, name), values in arrays:
        data = mesh.GetPointData() if center == "Node" else mesh.GetCellData()
        add_arrays(data, **{name: values})
    return mesh


def pvd(folder, frames, extension="vtp"):
    """Write a PVD collection with VTK; frames as in `xdmf`."""
    rows = []
    for index, arrays in enumerate(frames):
        mesh = with_arrays((poly_data if extension == "vtp" else grid)(POINTS + index), arrays)
        writer = vtkXMLPolyDataWriter() if extension == "vtp" else vtkXMLUnstructuredGridWriter()
        write_mesh(writer, mesh, folder / f"f_{index}.{extension}")
        rows.append(f'timestep="{index / 10}" file="f_{index}.{extension}"')
    return write_pvd(folder, rows)


def vtu(folder, frames):
    return pvd(folder, frames, "vtu")


def vtp_frames(folder, frames):
    pvd(folder, frames)
    return folder / "f_*.vtp"


def vtk_frames(folder, frames):
    """Write legacy files with VTK; frames as in `xdmf`."""
    for index, arrays in enumerate(frames):
        mesh = with_arrays(grid(POINTS + index), arrays)
        writer = vtkUnstructuredGridWriter()
        writer.SetFileTypeToBinary()
        write_mesh(writer, mesh, folder / f"f_{index}.vtk")
    return folder / "f_*.vtk"


COLLECTIONS = pytest.mark.parametrize("make", [xdmf, pvd, vtu])
ALL = pytest.mark.parametrize("make", [xdmf, pvd, vtu, vtp_frames, vtk_frames])


def frames_of(center, name, values):
    return [[((center, name), value)] for value in values]


def join_frames(*columns):
    return [list(chain(*row)) for row in zip(*columns, strict=True)]


@ALL
@pytest.mark.parametrize("dtype", ["f4", "f8", "i4", "i8", "u1"])
@pytest.mark.parametrize("width", [1, 3, 9])
def test_changing_point_and_cell_data_become_tracks(tmp_path, make, read, dtype, width, notes):
    at_points, at_cells = (
        (100 * RNG.random((4, n, width))).astype(dtype) for n in (N_POINTS, N_CELLS)
    )
    frames = join_frames(
        frames_of("Node", "stress", at_points), frames_of("Cell", "area", at_cells)
    )
    tracks = read(make(tmp_path, frames), notes=notes).tracks
    for name, values, domain in (("stress", at_points, "vertex"), ("area", at_cells, "face")):
        assert (tracks[name].domain, tracks[name].dtype) == (domain, np.dtype(dtype))
        assert tracks[name].read(0, 4).tobytes() == values.tobytes()
        assert tracks[name].read(2, 4).tobytes() == values[2:].tobytes()
    assert notes == []


VTU = """<VTKFile type="UnstructuredGrid"><UnstructuredGrid>
<FieldData><DataArray type="Float64" Name="energy">{time}</DataArray>
<DataArray type="Float64" Name="TimeValue">{time}</DataArray></FieldData>
<Piece NumberOfPoints="5" NumberOfCells="3"><Points><DataArray type="Float64"
NumberOfComponents="3">0 0 0 1 0 0 1 1 0 0 1 0 0 0 {time}</DataArray></Points><Cells>
<DataArray type="Int64" Name="connectivity">0 1 2 0 2 3 1 2 4</DataArray>
<DataArray type="Int64" Name="offsets">3 6 9</DataArray>
<DataArray type="UInt8" Name="types">5 5 5</DataArray></Cells><CellData>
<Array type="String" Name="part">{part}</Array>
<DataArray type="UInt8" Name="vtkGhostType">{ghosts}</DataArray>
<DataArray type="Int64" Name="id">{ids}</DataArray></CellData></Piece>
</UnstructuredGrid></VTKFile>"""
PARTS = "65 0 0 66 66 0"
IDS = np.array([0, 2**53 + 1, -(2**62) - 1])


def write_parallel(folder, n_frames=2, **changes):
    """Write a collection of two pieces for each time, the second of which repeats a cell."""
    rows = []
    for time in range(n_frames):
        for number, ghosts in enumerate(("0 0 0", "0 0 1")):
            facts = {"part": PARTS, "ids": " ".join(map(str, IDS)), "ghosts": ghosts, "time": time}
            (folder / f"p_{time}_{number}.vtu").write_text(VTU.format(**facts | changes))
        pieces = "".join(f'<Piece Source="p_{time}_{number}.vtu"/>' for number in (0, 1))
        text = f'<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid>{pieces}'
        (folder / f"p_{time}.pvtu").write_text(f"{text}</PUnstructuredGrid></VTKFile>")
        rows.append(f'timestep="{time}" file="p_{time}.pvtu"')
    return write_pvd(folder, rows)


def test_contents_of_parallel_files_are_kept_or_named(tmp_path, notes, read):
    result = read(write_parallel(tmp_path), notes=notes)
    assert result.faces.tolist() == [[0, 1, 2], [0, 2, 3], [1, 2, 4], [5, 6, 7], [5, 7, 8]]
    [group] = result.surface.groups
    assert (group.name, group.labels) == ("part", ("A", "BB"))
    assert group.numbers.tolist() == [0, -1, 1, 0, -1]
    assert result.tracks["id"].dtype == np.int64
    assert result.tracks["id"].read(0, 2)[..., 0].tolist() == [[*IDS, *IDS[:2]]] * 2
    assert result.surface.attributes == ()
    assert notes == [
        "left out: field data: energy",
        "left out: cells: 1 ghost that other pieces contain",
    ]


@ALL
def test_non_finite_values_are_preserved(tmp_path, make):
    if make is xdmf:
        values = RNG.random((2, N_POINTS))
        values[0, :3] = np.nan, np.inf, -np.inf
    else:
        values = RNG.random((2, N_POINTS)).astype(np.float32)
        values.view(np.uint32)[0, :3] = 0x7FC12345, 0x7F800000, 0xFF800000  # a NaN with payload
    result = load(make(tmp_path, frames_of("Node", "heat", values))).tracks["heat"]
    assert result.values.tobytes() == values.tobytes()


@ALL
@pytest.mark.parametrize(
    ("dtype", "read_as", "type_note"),
    [("f4", "f4", ""), ("f8", "f8", ""), ("i4", "f8", ", as float64")],
)
def test_field_of_some_frames_is_nan_in_the_others(tmp_path, make, dtype, read_as, type_note):
    values = np.arange(3 * N_CELLS).reshape(3, N_CELLS).astype(dtype)
    frames = frames_of("Cell", "damage", values)
    frames[1] = []
    notes = []
    track = load(make(tmp_path, frames), notes=notes).tracks["damage"]
    assert track.dtype == read_as
    assert np.array_equal(track[[0, 2]][..., 0], values[[0, 2]])
    assert np.isnan(track[1]).all()
    assert notes == [f"'damage' is in 2 of 3 frames, and NaN in the others{type_note}"]


@ALL
def test_bytes_of_a_color_become_fractions_where_frames_have_none(tmp_path, make):
    frames = frames_of("Cell", "paint", np.full((3, N_CELLS, 3), 51, np.uint8))
    frames[1] = []
    track = load(make(tmp_path, frames)).tracks["paint"]
    assert track.kind == "color"
    np.testing.assert_allclose(track[[0, 2]], 0.2)
    assert np.isnan(track[1]).all()


@COLLECTIONS
def test_constant_integers_of_a_collection_are_an_attribute(tmp_path, make):
    material = np.arange(N_CELLS, dtype=np.int32)
    loaded = load(make(tmp_path, frames_of("Cell", "material", [material] * 3)))
    assert "material" in {attribute.name for attribute in loaded.surface.attributes}
    assert not loaded.tracks


@ALL
@pytest.mark.parametrize("n_frames", [1, 3])
def test_constant_results_are_a_track(tmp_path, make, n_frames):
    loaded = load(make(tmp_path, frames_of("Cell", "still", [HEAT] * n_frames)))
    assert {attribute.name for attribute in loaded.surface.attributes} <= {"uv set", "paint"}
    assert loaded.tracks["still"].values.tolist() == [HEAT[:, None].tolist()] * n_frames


def test_reading_a_track_fails_if_its_file_has_changed(tmp_path):
    heat = frames_of("Cell", "heat", RNG.random((2, N_CELLS)))
    track = open_source(vtp_frames(tmp_path, heat)).tracks["heat"]
    assert np.array_equal(track.read(0, 1).ravel(), heat[0][0][1])
    vtp_frames(tmp_path, frames_of("Cell", "heat", RNG.random((2, N_CELLS))))
    with pytest.raises(InvalidInputError, match=r"f_1\.vtp \(frame 1\) changed"):
        track.read(1, 2)


@ALL
def test_track_has_the_common_type_of_its_frames(tmp_path, make):
    values: list[Any] = [
        np.arange(N_POINTS, dtype=np.int16),
        np.linspace(0, 1, N_POINTS, dtype=np.float32),
    ]
    if make is xdmf:
        values[0] = values[0].astype(np.int8)
    track = load(make(tmp_path, frames_of("Node", "mix", values))).tracks["mix"]
    assert track.dtype == np.float32
    assert [row.ravel().tolist() for row in track] == [row.tolist() for row in values]


@ALL
def test_field_with_varying_components_is_left_out_with_a_note(tmp_path, make, notes):
    values = [np.zeros((N_POINTS, 2)), np.zeros((N_POINTS, 3))]
    assert not load(make(tmp_path, frames_of("Node", "odd", values)), notes=notes).tracks
    assert notes == ["left out: 'odd', which has 2 or 3 components in different frames"]


@ALL
def test_changing_colors_and_normals_are_recognized(tmp_path, make):
    shades = RNG.integers(0, 256, (2, N_POINTS, 3)).astype(np.uint8)
    normals = RNG.normal(size=(2, N_CELLS, 3))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    frames = join_frames(frames_of("Node", "shade", shades), frames_of("Cell", "Normals", normals))
    tracks = load(make(tmp_path, frames)).tracks
    assert tracks["shade"].kind is TrackKind.COLOR
    assert tracks["Normals"].kind is TrackKind.NORMAL
    assert tracks["Normals"].values.tobytes() == normals.tobytes()


@ALL
def test_face_track_is_renamed_if_a_vertex_track_has_its_name(tmp_path, make):
    frames = join_frames(
        frames_of("Node", "heat", RNG.random((2, N_POINTS))),
        frames_of("Cell", "heat", RNG.random((2, N_CELLS))),
    )
    tracks = load(make(tmp_path, frames)).tracks
    assert {name: str(track.domain) for name, track in tracks.items()} == {
        "heat": "vertex",
        "heat (faces)": "face",
    }


def test_duplicate_array_names_in_a_step_are_an_error(tmp_path):
    heat = frames_of("Node", "heat", RNG.random((2, N_POINTS)))
    path = xdmf(
        tmp_path, join_frames(heat, frames_of("Node", "heat", RNG.random((2, N_POINTS, 3))))
    )
    with pytest.raises(
        InvalidInputError, match="two arrays 'heat' at points in a frame, with 1 and"
    ):
        load(path)


def test_array_of_wrong_size_is_left_out_with_a_note(tmp_path, notes):
    path = xdmf(tmp_path, frames_of("Node", "odd", RNG.random((2, N_POINTS - 1))))
    assert not load(path, notes=notes).tracks
    assert notes == [
        "left out: array 'odd', which has 9 numbers in step 0; arrays of each node need 10 or a "
        "multiple of it"
    ]


def test_values_of_solid_cells_are_kept(tmp_path):
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], float)
    cells = [(10, [0, 1, 2, 3]), (10, [1, 2, 3, 4])]
    rows = []
    for index in range(2):
        mesh = grid(corners * (index + 1), cells)
        add_arrays(mesh.GetCellData(), stress=np.array([1.0, 2.0]) + 10 * index)
        write_mesh(vtkXMLUnstructuredGridWriter(), mesh, tmp_path / f"f_{index}.vtu")
        rows.append(f'timestep="{index}" file="f_{index}.vtu"')
    track = load(write_pvd(tmp_path, rows)).tracks["stress"]
    assert track.domain == "cell"
    assert track[0].ravel().tolist() == [1, 2]
    assert track[1].ravel().tolist() == [11, 12]


@pytest.mark.parametrize("make", [pvd, vtu])
def test_merged_files_share_one_track(tmp_path, make, notes):
    heat = RNG.random((2, N_POINTS))
    whole = make(tmp_path, frames_of("Node", "heat", heat))
    text = whole.read_text()
    one = tmp_path / "one"
    one.mkdir()
    other = make(one, [[], []])
    rows = text.replace("</Collection></VTKFile>", "").partition("<Collection>")[2]
    attributes = other.read_text().partition("<Collection>")[2].replace('file="', 'file="one/')
    whole.write_text(f'<VTKFile type="Collection"><Collection>{rows}{attributes}')
    track = load(whole, merge=True, notes=notes).tracks["heat"]
    assert track.shape == (2, 2 * N_POINTS, 1)
    assert np.array_equal(track.values[:, :N_POINTS, 0], heat)
    assert np.isnan(track.values[:, N_POINTS:]).all()
    assert "track 'heat' is in 1 of 2 meshes, and NaN in the others" in notes


def test_segments_have_their_part_of_a_track(tmp_path):
    heat = RNG.random((3, N_POINTS))
    path = pvd(tmp_path, frames_of("Node", "heat", heat))
    mesh = poly_data(POINTS, [[0, 1, 2], [2, 3, 4]])
    mesh.GetCellData().RemoveArray("heat")
    add_arrays(mesh.GetPointData(), heat=heat[2])
    write_mesh(vtkXMLPolyDataWriter(), mesh, tmp_path / "f_2.vtp")
    results = [segment.tracks["heat"].read(0, 3)[..., 0] for segment in load(path).segments]
    assert [len(values) for values in results] == [2, 1]
    assert np.array_equal(np.concatenate(results), heat)


@pytest.mark.parametrize("n_frames", [1, 2])
def test_arrays_of_points_and_cells_of_a_volume_mesh_share_a_name(tmp_path, n_frames, notes):
    corners = np.concatenate([np.zeros((1, 3)), np.eye(3)])
    nodes, cells = np.arange(4.0), np.array([7.0])
    paths = []
    for number in range(n_frames):
        mesh = grid(corners, [(10, [0, 1, 2, 3])])
        add_arrays(mesh.GetPointData(), A=nodes)
        add_arrays(mesh.GetCellData(), A=cells)
        paths.append(f"{number}.vtu")
        write_mesh(vtkXMLUnstructuredGridWriter(), mesh, tmp_path / paths[-1])
    rows = [f'timestep="{i}" file="{path}"' for i, path in enumerate(paths)]
    tracks = load(write_pvd(tmp_path, rows), notes=notes).tracks
    assert tracks["A"].values.tolist() == [nodes[:, None].tolist()] * n_frames
    assert tracks["A (cells)"].values.tolist() == [[[7.0]]] * n_frames
    assert notes == ["'A' is at points and at cells; the one of cells is called 'A (cells)'"]
