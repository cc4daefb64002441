"""Sequences whose faces change, written and read back."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

import meshreel
from meshreel.errors import ConnectivityChangeError
from meshreel.formats.options import WriteOptions
from meshreel.model.sequence import segment_of_frame
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.model.tracks import Track
from samples.datasets import positions_of
from samples.glb import Glb
from samples.materials import dressed_sheet
from samples.meshes import assert_same_surface, quad_sheet, waving_grid
from samples.tracks import assert_same_tracks

FPS = 25.0


def with_heat(sequence, seed):
    rng = np.random.default_rng(seed)
    heat = rng.random((sequence.n_frames, sequence.n_verts)).astype(np.float32)
    return sequence.replace(fps=FPS, tracks={"heat": Track(heat)})


@pytest.fixture
def changing():
    """Three segments of a grid, a sheet of quads and the grid again, with a track each."""
    grid = waving_grid(4)
    meshes = [grid, quad_sheet(3), grid.replace(vertices=2 * grid.vertices[:1])]
    return meshreel.concatenate(
        [with_heat(mesh.replace(name="mesh"), seed) for seed, mesh in enumerate(meshes)]
    )


def textured_grid(n_frames, *size):
    """Return a grid with UVs of vertices and corners, materials and tracks of each domain."""
    grid = waving_grid(n_frames, *size)
    rng = np.random.default_rng(len(grid.faces))
    n_faces = len(grid.faces)
    surface = Surface(
        attributes=(
            Attribute("map", Kind.UV, Domain.VERTEX, grid.vertices[0, :, :2].copy()),
            Attribute("seams", Kind.UV, Domain.CORNER, rng.random((3 * n_faces, 2), np.float32)),
            Attribute("weight", Kind.OTHER, Domain.FACE, rng.random((n_faces, 1), np.float32)),
        ),
        groups=(FaceGroups("material", ("skin", "cloth"), np.arange(n_faces, dtype=np.int32) % 2),),
    )
    tracks = {
        "heat": Track(rng.random((n_frames, grid.n_verts), np.float32)),
        "flow": Track(rng.random((n_frames, grid.n_verts, 3), np.float32), kind="velocity"),
        "stress": Track(rng.random((n_frames, n_faces), np.float32), Domain.FACE),
    }
    return grid.replace(fps=FPS, name="mesh", surface=surface, tracks=tracks)


def inner_edges(faces):
    sides = np.sort(np.concatenate([faces[:, :2], faces[:, 1:], faces[:, ::2]]), axis=1)
    edges, counts = np.unique(sides, axis=0, return_counts=True)
    return edges[counts == 2]


@pytest.fixture
def textured():
    """Segments of four meshes with the same data, the second and third of one size."""
    sizes = (3, 4, 3), (2, 3, 5), (2, 5, 3), (2, 4, 3)
    return meshreel.concatenate([textured_grid(*size) for size in sizes])


def assert_same_frames(found, expected, *, atol=0.0):
    assert found.starts == expected.starts
    for one, other in zip(found.segments, expected.segments, strict=True):
        np.testing.assert_array_equal(one.faces, other.faces)
        np.testing.assert_allclose(positions_of(one), positions_of(other), rtol=0, atol=atol)


def assert_data_as_of_single_segments(found, expected, folder, output):
    """Assert that each segment has the surface and tracks of a file of that segment alone."""
    for number, (one, segment) in enumerate(zip(found.segments, expected.segments, strict=True)):
        alone = folder / f"alone{number}"
        alone.mkdir()
        meshreel.save(segment, alone / output)
        is_pattern = "%" in output
        other = meshreel.load(alone if is_pattern else alone / output, fps=FPS)
        assert_same_surface(one.surface, other.surface)
        assert_same_tracks(one.tracks, other.tracks)


@pytest.mark.parametrize("extension", [".ply", ".obj", ".vtp", ".vtu", ".off"])
def test_frame_files_have_the_mesh_of_their_segment(changing, tmp_path, extension):
    written = meshreel.save(changing, tmp_path / f"f_%02d{extension}")
    assert len(written) == changing.n_frames
    loaded = meshreel.load(str(tmp_path / f"f_*{extension}"), fps=FPS)
    assert_same_frames(loaded, changing)
    assert_data_as_of_single_segments(loaded, changing, tmp_path, f"f_%02d{extension}")


@pytest.mark.parametrize("extension", [".npz", ".mdd", ".pc2", ".h5", ".vat"])
def test_formats_with_constant_faces_refuse_changes(changing, tmp_path, extension):
    message = r"8 frames in 3 segments.*--split.*one file per frame"
    with pytest.raises(ConnectivityChangeError, match=message):
        meshreel.save(changing, tmp_path / f"a{extension}")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("extension", [".npz", ".mdd"])
def test_frames_of_one_segment_are_written_in_any_format(changing, tmp_path, extension):
    meshreel.save(changing[4:7], tmp_path / f"a{extension}")
    loaded = meshreel.load(tmp_path / f"a{extension}")
    np.testing.assert_array_equal(loaded.vertices, changing.segments[1].vertices)


def test_progress_counts_the_frames_of_all_segments(changing, tmp_path):
    shares = []
    meshreel.save(changing, tmp_path / "f_%d.ply", progress=lambda _, share: shares.append(share))
    assert [share.done for share in shares if hasattr(share, "done")] == [*range(1, 9)]


def test_notes_name_what_is_left_out_once(changing, tmp_path, notes):
    meshreel.save(changing, tmp_path / "f_%d.stl", notes=notes)
    assert len(notes) == len(set(notes)) > 0


@pytest.mark.slow
@pytest.mark.parametrize("extension", [".vtkhdf", ".abc", ".usdc", ".usda", ".usdz", ".pvd"])
def test_one_file_has_the_mesh_of_each_segment(textured, tmp_path, extension, notes):
    meshreel.save(textured, tmp_path / f"a{extension}", notes=notes)
    loaded = meshreel.load(tmp_path / f"a{extension}")
    name = "a" if extension == ".pvd" else "mesh"  # a collection has no name
    assert (loaded.fps, loaded.name) == (FPS, name)
    assert_same_frames(loaded, textured)
    assert_data_as_of_single_segments(loaded, textured, tmp_path, f"a{extension}")
    assert not any("segments" in note for note in notes)


@pytest.mark.parametrize("extension", [".vtkhdf", ".abc", ".usdc"])
def test_one_file_of_segments_with_different_data(changing, tmp_path, extension, notes):
    meshreel.save(changing, tmp_path / f"a{extension}", notes=notes)
    loaded = meshreel.load(tmp_path / f"a{extension}")
    assert_same_frames(loaded, changing)
    assert_same_tracks(loaded.segments[1].tracks, changing.segments[1].tracks)
    assert any("only some segments have" in note and "st" in note for note in notes)


@pytest.mark.slow
def test_vtk_reads_the_mesh_of_each_step(textured, tmp_path):
    vtk = pytest.importorskip("vtk")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    meshreel.save(textured, tmp_path / "a.vtkhdf")
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(tmp_path / "a.vtkhdf"))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == textured.n_frames
    for number, frame in enumerate(textured):
        reader.SetStep(number)
        reader.Update()
        mesh = reader.GetOutput()
        segment_number, local = segment_of_frame(textured.starts, number)
        segment = textured.segments[segment_number]
        np.testing.assert_array_equal(vtk_to_numpy(mesh.GetPoints().GetData()), frame.vertices)
        corners = vtk_to_numpy(mesh.GetPolys().GetConnectivityArray())
        np.testing.assert_array_equal(corners.reshape(-1, 3), frame.faces)
        heat = vtk_to_numpy(mesh.GetPointData().GetArray("heat"))
        np.testing.assert_array_equal(heat, segment.tracks["heat"].read(local, local + 1)[0, :, 0])
        uv = vtk_to_numpy(mesh.GetPointData().GetTCoords())
        np.testing.assert_array_equal(uv, segment.surface.attributes[0].values)
        labels = vtk_to_numpy(mesh.GetCellData().GetArray("material"))
        np.testing.assert_array_equal(labels, segment.surface.groups[0].numbers)


def test_the_alembic_library_reads_the_faces_of_each_frame(textured, tmp_path):
    pytest.importorskip("alembic3d")
    from samples.alembic import library_samples

    meshreel.save(textured, tmp_path / "a.abc")
    result = list(library_samples(tmp_path / "a.abc"))
    for (points, counts, corners), frame in zip(result, textured, strict=True):
        np.testing.assert_array_equal(points, frame.vertices)
        assert (counts == 3).all()
        np.testing.assert_array_equal(corners.reshape(-1, 3)[:, ::-1], frame.faces)


@pytest.mark.parametrize("extension", [".abc", ".usdc"])
def test_materials_of_some_segments_and_hard_edges(tmp_path, extension):
    grids = [textured_grid(2, 4, 3), textured_grid(2, 3, 5)]
    for number, grid in enumerate(grids):
        [groups] = grid.surface.groups
        hard = inner_edges(grid.faces) if number else None
        labels = ("skin", f"cloth {number}")
        surface = replace(grid.surface, groups=(replace(groups, labels=labels),), hard_edges=hard)
        grids[number] = grid.replace(surface=surface)
    meshreel.save(meshreel.concatenate(grids), tmp_path / f"a{extension}")
    loaded = meshreel.load(tmp_path / f"a{extension}")
    expected = meshreel.concatenate(grids)
    assert_data_as_of_single_segments(loaded, expected, tmp_path, f"a{extension}")


@pytest.mark.parametrize("extension", [".glb", ".gltf"])
def test_gltf_shows_the_mesh_of_each_segment(textured, tmp_path, extension, notes):
    options = WriteOptions(max_error=0.01)
    meshreel.save(textured, tmp_path / f"a{extension}", options=options, notes=notes)
    loaded = meshreel.load(tmp_path / f"a{extension}")
    assert (loaded.starts, loaded.name) == (textured.starts, "mesh")
    assert loaded.fps == pytest.approx(FPS)
    diagonal, largest = np.linalg.norm(textured.extent.high - textured.extent.low), 0.0
    for one, other in zip(loaded, textured, strict=True):
        distance, nearest = cKDTree(one.vertices).query(other.vertices)
        largest = max(largest, 100 * distance.max() / diagonal)
        expected = np.sort(np.sort(nearest[other.faces], axis=1), axis=0)
        np.testing.assert_array_equal(np.sort(np.sort(one.faces, axis=1), axis=0), expected)
    assert any(f"the largest error is {largest:.4f} % of the diagonal" in note for note in notes)
    assert largest <= 0.0101
    for segment in loaded.segments:
        [groups] = segment.surface.groups
        assert set(groups.labels) == {"skin", "cloth"}


def test_gltf_scales_the_segments_of_other_frames_to_zero(textured, tmp_path):
    meshreel.save(textured, tmp_path / "a.glb")
    result = Glb.read((tmp_path / "a.glb").read_bytes())
    nodes, [animation] = result.document["nodes"], result.document["animations"]
    times = textured.start_s + np.arange(textured.n_frames) / FPS
    n_segments = 0
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        if channel["target"]["path"] != "scale":
            continue
        assert sampler["interpolation"] == "STEP"
        keys, scales = result.array(sampler["input"])[:, 0], result.array(sampler["output"])
        before = np.searchsorted(keys, times + 1e-4, side="right") - 1
        segments = [
            segment_of_frame(textured.starts, number)[0] for number in range(textured.n_frames)
        ]
        expected = np.equal(segments, n_segments)[:, np.newaxis]
        np.testing.assert_array_equal(scales[before], np.repeat(expected, 3, axis=1))
        node = nodes[channel["target"]["node"]]
        assert node.get("scale", [1, 1, 1])[0] == (n_segments == 0)
        assert node["extras"] == {"meshreelSegmentStart": times[textured.starts[n_segments]]}
        n_segments += 1
    assert n_segments == 4


def test_trimesh_reads_the_meshes_of_all_segments(textured, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    meshreel.save(textured, tmp_path / "a.glb")
    scene = trimesh.load(tmp_path / "a.glb", process=False)
    n_faces = sum(len(one.faces) for one in scene.geometry.values())
    assert n_faces == sum(len(segment.faces) for segment in textured.segments)


def dressed_segments():
    """Return two sheets whose materials differ in roughness."""
    sheets = [dressed_sheet(n).replace(fps=FPS) for n in (2, 1)]
    materials = sheets[1].surface.materials
    other = tuple(replace(material, roughness=0.125) for material in materials)
    surface = replace(sheets[1].surface, materials=other)
    return [sheets[0], sheets[1].replace(surface=surface)]


def test_gltf_keeps_materials_of_each_segment(tmp_path):
    sheets = dressed_segments()
    materials = sheets[1].surface.materials
    meshreel.save(meshreel.concatenate(sheets), tmp_path / "a.glb")
    document = Glb.read((tmp_path / "a.glb").read_bytes()).document
    names = [one["name"] for one in document["materials"] if "name" in one]
    assert len(names) == len(set(names)) == 2 * len(materials)
    assert len(document["images"]) == len(sheets[0].surface.images)


def test_usd_has_the_faces_and_primvars_of_each_frame(textured, tmp_path):
    usd, geometry = (pytest.importorskip(f"pxr.{name}") for name in ("Usd", "UsdGeom"))
    meshreel.save(textured, tmp_path / "a.usdc")
    stage = usd.Stage.Open(str(tmp_path / "a.usdc"))
    [prim] = [one for one in stage.Traverse() if one.IsA(geometry.Mesh)]
    mesh, primvars = geometry.Mesh(prim), geometry.PrimvarsAPI(prim)
    first = stage.GetStartTimeCode()
    for number, frame in enumerate(textured):
        segment = textured.segments[segment_of_frame(textured.starts, number)[0]]
        code = first + number
        np.testing.assert_array_equal(mesh.GetPointsAttr().Get(code), frame.vertices)
        corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(code)).reshape(-1, 3)
        np.testing.assert_array_equal(corners, frame.faces)
        assert list(mesh.GetFaceVertexCountsAttr().Get(code)) == [3] * len(frame.faces)
        uv, weight = segment.surface.attributes[0], segment.surface.attributes[2]
        np.testing.assert_array_equal(primvars.GetPrimvar("st").Get(code), uv.values)
        result = np.array(primvars.GetPrimvar("weight").Get(code))
        np.testing.assert_array_equal(result, weight.values[:, 0])
        for subset in geometry.Subset.GetAllGeomSubsets(geometry.Imageable(prim)):
            label = ("skin", "cloth").index(subset.GetPrim().GetName())
            faces = np.flatnonzero(segment.surface.groups[0].numbers == label)
            np.testing.assert_array_equal(subset.GetIndicesAttr().Get(code), faces)


@pytest.mark.parametrize("extension", [".usdc", ".usdz"])
def test_usd_keeps_materials_and_images_of_each_segment(tmp_path, extension):
    shade = pytest.importorskip("pxr.UsdShade")
    usd = pytest.importorskip("pxr.Usd")
    sheets = dressed_segments()
    written = meshreel.save(meshreel.concatenate(sheets), tmp_path / f"a{extension}")
    images = sheets[0].surface.images
    assert len(written) == (1 + len(images) if extension == ".usdc" else 1)
    stage = usd.Stage.Open(str(tmp_path / f"a{extension}"))
    results = [one for one in stage.Traverse() if one.IsA(shade.Material)]
    used = {label for sheet in sheets for label in sheet.surface.groups[0].labels}
    assert len(results) == 2 * len(used)
    roughness = [
        one.GetAttribute("inputs:roughness").Get()
        for one in stage.Traverse()
        if one.IsA(shade.Shader) and one.HasAttribute("inputs:roughness")
    ]
    assert roughness.count(0.125) == len([one for one in roughness if one is not None]) / 2


def test_vtk_reads_the_pieces_of_a_collection(textured, tmp_path):
    xml = pytest.importorskip("vtkmodules.vtkIOXML")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    meshreel.save(textured, tmp_path / "a.pvd")
    pieces = sorted((tmp_path / "a_frames").iterdir())
    for piece, frame in zip(pieces, textured, strict=True):
        reader = xml.vtkXMLUnstructuredGridReader()
        reader.SetFileName(str(piece))
        reader.Update()
        mesh = reader.GetOutput()
        np.testing.assert_array_equal(vtk_to_numpy(mesh.GetPoints().GetData()), frame.vertices)
        corners = vtk_to_numpy(mesh.GetCells().GetConnectivityArray())
        np.testing.assert_array_equal(corners.reshape(-1, 3), frame.faces)
