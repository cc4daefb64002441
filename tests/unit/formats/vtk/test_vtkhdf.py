import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.load import load
from meshreel.model.surface import PLAIN, Surface
from meshreel.operations.save import save
from samples.datasets import (
    CORNERS,
    COUNTS,
    assert_same_positions,
    full_surface,
    plain_sequence,
    surface_of_arrays,
    surfaced_sequence,
)
from samples.meshes import assert_same_surface
from samples.opening import open_source

h5py = pytest.importorskip("h5py")

RATES = [24.0, 25.0, 60.0, 29.97, 30000 / 1001, 23.98765]


@pytest.mark.parametrize("extension", ["vtkhdf", "hdf"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("n_frames", [1, 5])
def test_vtkhdf_round_trips_exactly(tmp_path, extension, dtype, n_frames, read):
    sequence = surfaced_sequence(n_frames, dtype, 29.97, 1 / 3)
    [path] = save(sequence, tmp_path / "a.vtkhdf")
    path = path.rename(tmp_path / f"a.{extension}")
    result = read(path)
    assert isinstance(result, StoredFrames) == (read is open_source)
    assert_same_positions(result, sequence)
    assert_same_surface(result.surface, surface_of_arrays(sequence.surface))
    fps = 29.97 if n_frames > 1 else 0.0
    assert (result.fps, result.start_s, result.name) == (fps, 1 / 3, "walk")


@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("start_s", [0.0, 2.0, -1.5])
def test_vtkhdf_round_trips_frame_rate_and_start(tmp_path, fps, start_s):
    [path] = save(plain_sequence(fps=fps, start_s=start_s), tmp_path / "a.vtkhdf")
    loaded = load(path)
    assert loaded.fps == pytest.approx(fps, rel=1e-15 if fps != RATES[-1] else 1e-12)
    assert loaded.start_s == start_s
    assert load(path, fps=48).fps == 48


def test_save_notes_what_is_left_out_and_unknown_frame_rate(tmp_path, notes):
    save(surfaced_sequence(fps=0.0), tmp_path / "a.vtkhdf", notes=notes)
    assert notes == [
        "the frame rate is unknown; written as 24 fps",
        "left out, as .vtkhdf files cannot store it: 'UVMap' (uv) of each corner, "
        "the names of 2 parts",
        "labels left out: groups 'material'; .vtkhdf stores only their numbers",
    ]


@pytest.mark.parametrize("surface", [PLAIN, Surface(COUNTS), full_surface()])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_vtk_reads_every_step_exactly(tmp_path, surface, dtype):
    pytest.importorskip("vtkmodules")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
    from vtkmodules.vtkIOHDF import vtkHDFReader

    sequence = surfaced_sequence(6, dtype, 29.97, 2.0, surface)
    save(sequence, tmp_path / "a.vtkhdf")
    reader = vtkHDFReader()
    reader.SetFileName(str(tmp_path / "a.vtkhdf"))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    np.testing.assert_array_equal(times, 2.0 + np.arange(6) / 29.97)
    for step in (3, 0, 5):
        reader.SetStep(step)
        reader.Update()
        data = reader.GetOutput()
        points = vtk_to_numpy(data.GetPoints().GetData())
        assert points.dtype == dtype
        assert points.tobytes() == sequence.vertices[step].tobytes()
        corners = vtk_to_numpy(data.GetPolys().GetConnectivityArray())
        if surface.face_sizes is not None:
            np.testing.assert_array_equal(corners, CORNERS)
            offsets = vtk_to_numpy(data.GetPolys().GetOffsetsArray())
            np.testing.assert_array_equal(np.diff(offsets), COUNTS)
        else:
            np.testing.assert_array_equal(corners.reshape(-1, 3), sequence.faces)
    if surface.attributes:
        uv = vtk_to_numpy(data.GetPointData().GetTCoords())
        np.testing.assert_array_equal(uv, surface.attributes[1].values)
        colours = vtk_to_numpy(data.GetPointData().GetArray("Cd"))
        np.testing.assert_array_equal(colours, surface.attributes[2].values)
        heat = vtk_to_numpy(data.GetCellData().GetArray("wärme"))
        np.testing.assert_array_equal(heat.reshape(-1, 1), surface.attributes[3].values)
        material = vtk_to_numpy(data.GetCellData().GetArray("material"))
        np.testing.assert_array_equal(material, surface.groups[0].numbers)


def store_grid(path, points, types, counts, corners, **options):
    """Write an unstructured grid with a partition for each row of `counts`, points (T, V, 3)."""
    points = np.asarray(points, np.float32)
    with h5py.File(path, "w") as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = [2, 0]
        root.attrs.create("Type", np.bytes_("UnstructuredGrid"))
        n_steps = points.shape[0]
        root["Points"] = points.reshape(-1, 3)
        per_part = [points.shape[1] // len(counts)] * len(counts)
        root["NumberOfPoints"] = per_part
        root["NumberOfCells"] = [len(part) for part in counts]
        root["NumberOfConnectivityIds"] = [sum(part) for part in counts]
        root["Offsets"] = np.concatenate([np.cumsum([0, *part]) for part in counts])
        root["Connectivity"] = corners
        root["Types"] = np.array(types, np.uint8)
        steps = root.create_group("Steps")
        steps.attrs["NSteps"] = n_steps
        steps["Values"] = np.arange(n_steps) / 10
        steps["PointOffsets"] = np.arange(n_steps) * points.shape[1]
        steps["NumberOfParts"] = [len(counts)] * n_steps
        for name, (data, offsets) in options.items():
            root[f"PointData/{name}"] = data
            root[f"Steps/PointDataOffsets/{name}"] = offsets
    return path


CUBE = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float32)
HEXAHEDRON = [0, 1, 3, 2, 4, 5, 7, 6]


def test_load_keeps_solid_cells_and_finds_their_boundary(tmp_path):
    cube = np.concatenate([np.full((1, 3), 9, np.float32), CUBE])
    points = np.stack([cube, 2 * cube])
    path = store_grid(tmp_path / "a.vtkhdf", points, [12], [[8]], np.array(HEXAHEDRON) + 1)
    loaded = load(path)
    assert loaded.vertices.tobytes() == points.tobytes()
    assert loaded.surface.cells.nodes.tolist() == (np.array(HEXAHEDRON) + 1).tolist()
    assert loaded.surface.face_sizes.tolist() == [4] * 6
    assert loaded.fps == 10
    triangles = loaded.vertices[0][loaded.faces]
    volume = np.linalg.det(triangles.astype(np.float64)).sum() / 6
    assert volume == pytest.approx(1)  # only if all faces point outward


def test_load_joins_partitions(tmp_path, notes):
    points = np.random.default_rng(0).random((3, 8, 3), np.float32)
    corners = [0, 1, 2, 0, 1, 2, 3, 3, 2, 1]
    path = store_grid(
        tmp_path / "a.vtkhdf", points, [5, 9, 5], [[3, 4], [3]], corners,
        still=(np.arange(8.0), [0, 0, 0]), moving=(np.arange(24.0), [0, 8, 16]),
    )  # fmt: skip
    loaded = load(path, notes=notes)
    assert loaded.vertices.tobytes() == points.tobytes()
    assert loaded.surface.face_sizes.tolist() == [3, 4, 3]
    assert loaded.faces.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3], [7, 6, 5]]
    assert loaded.tracks["still"].values.reshape(3, -1).tolist() == [list(range(8))] * 3
    moving = loaded.tracks["moving"]
    assert (moving.domain, moving.kind) == ("vertex", "scalar")
    assert moving.values.ravel().tolist() == list(range(24))
    assert notes == []
    with h5py.File(path, "r+") as file:
        for name in ("Steps", "PointData", "Points"):
            del file["VTKHDF"][name]
        file["VTKHDF/Points"] = points[0]
    still = load(path)
    assert still.vertices.tobytes() == points[:1].tobytes()
    assert still.surface.face_sizes.tolist() == [3, 4, 3]


def test_load_lists_the_blocks_of_a_collection(tmp_path):
    sequence = surfaced_sequence()
    [path] = save(sequence, tmp_path / "a.vtkhdf")
    with h5py.File(path, "a") as file:
        root = file.create_group("new")
        root.attrs["Version"] = [2, 1]
        root.attrs.create("Type", np.bytes_("PartitionedDataSetCollection"))
        file.copy("VTKHDF", root, "body")
        file.copy("VTKHDF", root, "head")
        root.create_group("Assembly")["body"] = h5py.SoftLink("/VTKHDF/body")
        del file["VTKHDF"]
        file.move("new", "VTKHDF")
    with pytest.raises(InvalidInputError, match="holds 2 meshes: /body, /head; choose one"):
        load(path)
    assert load(path, object="head").vertices.tobytes() == sequence.vertices.tobytes()
    assert [part.name for part in load(path, merge=True).surface.parts] == ["/body", "/head"]


@pytest.mark.damaged  # no step has the last points
@pytest.mark.parametrize(
    ("table", "values", "n_faces"),
    [
        ("PartOffsets", [0, 1], [2, 6]),
        ("NumberOfParts", [1, 2], [2, 8]),
        ("CellOffsets", [0, 1], [2, 4]),
        ("ConnectivityIdOffsets", [0, 4], [2, 2]),
    ],
)
def test_a_step_of_which_one_offset_differs_has_its_own_cells(tmp_path, table, values, n_faces):
    points = np.random.default_rng(0).random((2, 8, 3))
    corners = [0, 1, 2, 3, 1, 0, 3, 2, 0, 1, 3, 2]
    path = store_grid(tmp_path / "a.vtkhdf", points, [9, 10, 9], [[4], [4, 4]], corners)
    with h5py.File(path, "a") as file:
        replaced("Offsets", np.arange(0, 20, 4))(file["VTKHDF"])
        del file["VTKHDF/Steps/NumberOfParts"]
        for name, data in {"NumberOfParts": [1, 1], table: values}.items():
            file["VTKHDF/Steps"][name] = data
    assert [len(segment.faces) for segment in load(path).segments] == n_faces


EMPTY = ("Vertices", "Lines", "Strips")


def split_into_partitions(path, n_frames):
    """Rewrite a file to store its mesh twice, as two partitions in every step."""
    with h5py.File(path, "a") as file:
        root = file["VTKHDF"]
        points = root["Points"][:].reshape(n_frames, 11, 3)
        for name, data in {
            "Points": np.concatenate([points, points + 9], axis=1).reshape(-1, 3),
            "NumberOfPoints": [11, 11] * n_frames,
            "Polygons/Connectivity": np.tile(CORNERS, 2),
            "Polygons/Offsets": np.tile(np.concatenate([[0], np.cumsum(COUNTS)]), 2),
            "Polygons/NumberOfCells": [4, 4] * n_frames,
            "Polygons/NumberOfConnectivityIds": [15, 15] * n_frames,
            "Steps/PartOffsets": 2 * np.arange(n_frames),
            "Steps/NumberOfParts": [2] * n_frames,
            "Steps/PointOffsets": 22 * np.arange(n_frames),
        }.items():
            if name in root:
                del root[name]
            root[name] = data
        for name in EMPTY:
            for key in ("NumberOfCells", "NumberOfConnectivityIds"):
                del root[name][key]
                root[name][key] = [0, 0] * n_frames


@pytest.mark.slow
@pytest.mark.parametrize("n_offsets", [0, 1, 2])
def test_load_reads_partitions_that_share_cells_and_empty_groups(tmp_path, n_offsets):
    sequence = surfaced_sequence(surface=Surface(COUNTS))
    [path] = save(sequence, tmp_path / "a.vtkhdf")
    split_into_partitions(path, sequence.n_frames)
    with h5py.File(path, "a") as file:
        for name in EMPTY:
            del file["VTKHDF"][name]["Offsets"]
            file["VTKHDF"][name]["Offsets"] = [0] * n_offsets
    loaded = load(path)
    expected = np.concatenate([sequence.vertices, sequence.vertices + np.float32(9)], axis=1)
    np.testing.assert_array_equal(loaded.vertices, expected)
    np.testing.assert_array_equal(
        loaded.faces, np.concatenate([sequence.faces, sequence.faces + 11])
    )


def test_load_finds_the_cells_of_each_step(tmp_path):
    n_frames = 3
    sequence = surfaced_sequence(n_frames, surface=Surface(COUNTS))
    [path] = save(sequence, tmp_path / "a.vtkhdf")
    split_into_partitions(path, n_frames)
    with h5py.File(path, "a") as file:
        root = file["VTKHDF"]
        for name in ("Polygons/Connectivity", "Polygons/Offsets"):
            data = np.tile(root[name][:], n_frames)
            del root[name]
            root[name] = data
        for name, step in {"CellOffsets": 8, "ConnectivityIdOffsets": 30}.items():
            starts = np.zeros((n_frames, 4), int)
            starts[:, 2] = step * np.arange(n_frames)
            del root["Steps"][name]
            root["Steps"][name] = starts
    expected = np.concatenate([sequence.faces, sequence.faces + 11])
    np.testing.assert_array_equal(load(path).faces, expected)


def drop(*names):
    def change(root):
        for name in names:
            del root[name]

    return change


def replaced(name, data):
    def change(root):
        del root[name]
        root[name] = data

    return change


def without_polygons(n_points):
    def change(root):
        del root["Polygons"]
        replaced("NumberOfPoints", [n_points])(root)

    return change


def retyped(root):
    root.attrs.create("Type", np.bytes_("ImageData"))


def newer(root):
    root.attrs["Version"] = [3, 0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (drop("Points"), "has no dataset /VTKHDF/Points"),
        (drop("Steps/Values"), "has no dataset /VTKHDF/Steps/Values"),
        (drop("Polygons"), "holds 11 vertices and 0 faces; a triangle mesh needs both"),
        (retyped, "is VTKHDF of type ImageData; PolyData and UnstructuredGrid are supported"),
        (newer, r"has VTKHDF version \[3, 0\]; up to 2.x is supported"),
        (replaced("Points", np.zeros((4, 2))), r"Points must have shape \(N, 3\)"),
        (replaced("Points", np.zeros((4, 3), np.int32)), "Points must be float32 or float64"),
        (replaced("Points", np.zeros((30, 3))), "Points has 30 rows; step 2 has 11 from row 22 on"),
        (replaced("NumberOfPoints", [1 << 60]), "Points has 55 rows; "),
        (replaced("NumberOfPoints", [-1]), r"has point indices out of range"),
        (without_polygons(-1), "Points has 55 rows; step 0 has -1 from row 0 on"),
        (without_polygons(0), "holds 0 vertices and 0 faces; a triangle mesh needs both"),
        (replaced("NumberOfPoints", [0.5]), "NumberOfPoints must be integers"),
        (replaced("Steps/Values", np.zeros(5)), "step times that are not ascending"),
        (replaced("Steps/Values", np.arange(4)), r"declares \[5\] steps, but has 4 times"),
        (
            replaced("Steps/PointOffsets", [0, 1]),
            r"Steps/PointOffsets must be non-negative of shape \(5, 1\)",
        ),
        (replaced("Steps/PartOffsets", [1] * 5), "step 0 has partitions 1 to 1 of 1"),
        (replaced("Polygons/NumberOfCells", [1 << 60]), "Offsets has 5 rows"),
        (
            replaced("Polygons/NumberOfCells", [-4]),
            "NumberOfCells has counts that are negative or too large",
        ),
        (
            replaced("Polygons/NumberOfCells", [1 << 62] * 3),
            "NumberOfCells has counts that are negative",
        ),
        (replaced("Polygons/NumberOfConnectivityIds", [1 << 60]), "Connectivity has 15 rows"),
        (replaced("Polygons/Connectivity", [99] * 15), "has point indices out of range"),
        (replaced("Polygons/Offsets", [0, 9, 3, 4, 15]), "Offsets must be ascending"),
        (replaced("Polygons/Offsets", [0, 4, 7, 12, 14]), "do not agree with NumberOf"),
        (replaced("Polygons/Offsets", [0, 2, 7, 12, 15]), "at least three corners; got 2"),
    ],
)
def test_load_explains_errors_of_invalid_datasets(tmp_path, change, message):
    [path] = save(surfaced_sequence(surface=Surface(COUNTS)), tmp_path / "a.vtkhdf")
    with h5py.File(path, "a") as file:
        change(file["VTKHDF"])
    with pytest.raises(FormatError, match=rf"a\.vtkhdf: .*{message}"):
        load(path)


def test_load_rejects_vtkhdf_without_the_vtkhdf_group(tmp_path):
    [path] = save(plain_sequence(), tmp_path / "a.h5")
    path = path.rename(tmp_path / "a.vtkhdf")
    with pytest.raises(FormatError, match=r"a\.vtkhdf: has no group VTKHDF"):
        load(path)


def test_load_rejects_the_dataset_option_for_vtkhdf(tmp_path):
    [path] = save(plain_sequence(), tmp_path / "a.vtkhdf")
    path = path.rename(tmp_path / "a.hdf")
    with pytest.raises(InvalidInputError, match=r"where dataset has no effect"):
        load(path, dataset="Points")


def test_load_names_a_damaged_vtkhdf_called_hdf_once(tmp_path):
    [path] = save(plain_sequence(), tmp_path / "a.vtkhdf")
    path = path.rename(tmp_path / "a.hdf")
    with h5py.File(path, "a") as file:
        del file["VTKHDF/Points"]
    with pytest.raises(FormatError) as error:
        load(path)
    assert str(error.value).count(str(path)) == 1
