"""Files of other programs that were once misread or refused, compared with other readers."""

import re

import numpy as np
import pytest
import trimesh

import meshreel
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.load import load
from meshreel.formats.options import WriteOptions
from meshreel.operations.save import save
from samples.glb import Glb, largest_error_percent

pytestmark = pytest.mark.real


@pytest.fixture(scope="module")
def odd(existing):
    return existing("native/odd")


def sorted_triangles(vertices, faces):
    """Return the corners of all triangles in a canonical order."""
    corners = np.asarray(vertices, np.float64)[np.asarray(faces)]
    first = np.lexsort(np.moveaxis(corners.round(5), 2, 0)[::-1], axis=1)[:, 0]
    rotated = (first[:, None] + np.arange(3)) % 3
    corners = np.take_along_axis(corners, rotated[:, :, None], axis=1).reshape(-1, 9)
    return corners[np.lexsort(corners.round(5).T[::-1])]


def trimesh_triangles(path):
    """Return all triangles that trimesh reads, in world space."""
    mesh = trimesh.load_scene(path).to_mesh()
    return sorted_triangles(mesh.vertices, mesh.faces)


def test_an_inner_node_in_the_scene_adds_no_duplicate_slices(odd):
    notes = []
    loaded = load(odd / "cakeBirthday.glb", merge=True, notes=notes)
    assert (len(loaded.surface.parts), loaded.n_faces) == (6, 1332)
    triangles = sorted_triangles(loaded.vertices[0], loaded.faces)
    expected = trimesh_triangles(odd / "cakeBirthday.glb")
    np.testing.assert_allclose(triangles, expected, rtol=0, atol=1e-6)
    assert notes[0].startswith("scene 0 lists nodes that are not roots: cakeBirthday; ")


def test_a_scene_that_lists_an_inner_node_is_read(odd):
    assert load(odd / "bowl-cereal" / "model.gltf").n_faces == 137


def test_instances_are_noted(odd):
    notes = []
    assert load(odd / "simple-instancing.glb", notes=notes).n_faces == 12
    assert any("EXT_mesh_gpu_instancing" in note for note in notes)


def test_gltf_1_is_refused(odd):
    with pytest.raises(FormatError, match=r"is glTF 1\.0; only glTF 2\.0 is supported"):
        load(odd / "CesiumMilkTruck.gltf")


def test_vtkhdf_parts_with_shared_empty_groups_match_vtk(odd):
    vtk = pytest.importorskip("vtkmodules.vtkIOHDF")
    numpy_of = pytest.importorskip("vtkmodules.util.numpy_support").vtk_to_numpy
    loaded = load(odd / "warping_spheres.vtkhdf")
    assert (loaded.n_frames, loaded.n_verts, loaded.n_faces) == (100, 1684, 3360)
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(odd / "warping_spheres.vtkhdf"))
    reader.UpdateInformation()
    for step in range(100):
        reader.SetStep(step)
        reader.Update()
        parts = [reader.GetOutputDataObject(0).GetPartition(number) for number in range(2)]
        points = np.concatenate([numpy_of(part.GetPoints().GetData()) for part in parts])
        np.testing.assert_array_equal(loaded.vertices[step], points)
        corners = [numpy_of(part.GetPolys().GetConnectivityArray()) for part in parts]
        np.testing.assert_array_equal(
            loaded.faces.ravel(), np.concatenate([corners[0], corners[1] + 842])
        )


def test_pvd_files_without_part_numbers_are_merged_at_each_time(odd):
    path = odd / "dualSphereAnimation4NoPart.pvd"
    with pytest.raises(InvalidInputError, match=r"lists 2 files for the time 1 .* with merge=True"):
        load(path)
    first, rest = load(path, merge=True).segments
    assert (first.n_frames, first.n_verts, len(first.faces)) == (1, 50, 96)
    assert (rest.n_frames, rest.n_verts, len(rest.faces)) == (4, 112, 192)
    for index in range(4):
        pieces = [
            load(odd / "dualSphereAnimation" / f"dualSphereAnimation_P0{piece}T000{index + 1}.vtp")
            for piece in range(2)
        ]
        expected = np.concatenate([piece.vertices[0] for piece in pieces])
        np.testing.assert_array_equal(rest.read(index, index + 1)[0], expected)
    merged = meshreel.load(path, merge=True)
    decoded = meshreel.decode(meshreel.encode(merged, lossless=True))
    assert decoded.starts == merged.starts == (0, 1, 5)
    for one, other in zip(decoded.segments, merged.segments, strict=True):
        np.testing.assert_array_equal(*(each.read(0, each.n_frames) for each in (one, other)))
        np.testing.assert_array_equal(one.faces, other.faces)


@pytest.mark.parametrize("name", ["cube_binary_header_with_RN_newline.ply", "whitespace.off"])
def test_cubes_with_unusual_headers_match_trimesh(odd, name):
    loaded = load(odd / name)
    assert (loaded.n_verts, loaded.n_faces) == (8, 12)
    corners = loaded.vertices[0][loaded.faces].astype(np.float64)
    volume = np.linalg.det(corners).sum() / 6
    expected = trimesh.load_mesh(odd / "whitespace.off") if name.endswith("off") else None
    assert abs(volume) == pytest.approx(1.0 if expected is None else abs(expected.volume), rel=1e-5)


def test_utf_16_text_is_refused(odd):
    with pytest.raises(FormatError, match=r"is text in UTF-16, .* save it as UTF-8"):
        load(odd / "box_UTF16BE.obj")


@pytest.mark.parametrize("name", ["cesium_man", "balloons"])
@pytest.mark.parametrize("bound", [None, 0.2])
def test_glb_of_a_stream_with_a_bound_is_within_the_stated_total(
    sequence_named, tmp_path, name, bound
):
    original = sequence_named(name)
    (tmp_path / "a.reel").write_bytes(meshreel.encode(original, max_error=0.1))
    notes = []
    with meshreel.open(tmp_path / "a.reel") as reel:
        options = WriteOptions(max_error=bound)  # keeps the order
        save(reel, tmp_path / "a.glb", options=options, notes=notes)
        shown = reel.name or "mesh"
    [note] = [note for note in notes if note.startswith("against the original ")]
    total = float(re.search(r"largest error is at most (\S+) %", note)[1])
    measured = largest_error_percent(
        original, Glb.read((tmp_path / "a.glb").read_bytes()).world(shown)
    )
    assert measured <= total
    assert bound is None or total <= bound


def test_a_changing_vtkhdf_field_is_a_track(odd):
    h5py = pytest.importorskip("h5py")
    notes = []
    loaded = load(odd / "warping_spheres.vtkhdf", notes=notes)
    [(name, track)] = loaded.tracks.items()
    with h5py.File(odd / "warping_spheres.vtkhdf") as file:
        stored = file["VTKHDF/PointData/SpatioTemporalHarmonics"][()]
    assert (name, track.shape) == ("SpatioTemporalHarmonics", (100, loaded.n_verts, 1))
    assert track.values.tobytes() == stored.tobytes()
    assert notes == []
