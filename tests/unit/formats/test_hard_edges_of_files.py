"""Hard edges that every format stores, or has as corner normals, read and written."""

import numpy as np
import pytest

import meshreel
from meshreel.formats.load import load
from meshreel.kernel.polygons import triangle_corners
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.notes import NORMALS
from meshreel.operations.save import save
from samples.glb import written
from samples.gltf import Gltf
from samples.meshes import (
    BOX_CORNERS,
    BOX_QUADS,
    assert_same_surface,
    cake,
    cake_normals,
    hard_box,
    hard_sheet,
    waving_grid,
)

CAKE = cake(1)
SIZES = CAKE.surface.face_sizes
CORNERS = join_triangles(SIZES, CAKE.faces)


def places(sequence):
    """Hard edges of a sequence, as pairs of positions in its first frame."""
    ends = np.round(sequence.vertices[0].astype(float), 3)[sequence.surface.hard_edges] + 0.0
    return {frozenset(map(tuple, edge.tolist())) for edge in ends}


def cake_file(n_split=1, **node):
    """Write a GLB of unconnected triangles with corner normals."""
    file = Gltf()
    corner_of = triangle_corners(SIZES, CAKE.faces).ravel()
    normals = cake_normals(CAKE)[corner_of]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    values = {"NORMAL": file.accessor(normals)}
    mesh = file.mesh(CAKE.vertices[0][CORNERS[corner_of]], attributes=values)
    file.node(mesh=mesh, **node)
    return file


@pytest.fixture
def read(tmp_path):
    def loaded(file, extension=".glb", **options):
        path = tmp_path / f"a{extension}"
        if isinstance(file, str):
            path.write_text(file)
        else:
            file.save(path)
        notes = []
        return load(path, notes=notes, **options), notes

    return loaded


def test_glb_with_split_vertices_has_hard_rims(read):
    result, notes = read(cake_file())
    assert result.n_verts == CAKE.n_verts
    assert places(result) == places(CAKE)
    assert any(note.startswith("kept 48 of 144 edges as hard edges") for note in notes)
    assert f"left out: {NORMALS}" not in notes


def test_mirrored_glb_node_has_hard_rims(read):
    result, _ = read(cake_file(scale=[-1, 1, 1]))
    assert len(result.surface.hard_edges) == 48


def test_merged_mesh_has_the_hard_edges_of_all_parts(read):
    file = cake_file()
    file.node(mesh=file.mesh([[0, 0, 9], [1, 0, 9], [0, 1, 9]]))
    file.node(mesh=0, translation=[5, 0, 0])
    result, _ = read(file, merge=True)
    assert len(result.surface.parts) == 3
    assert len(result.surface.hard_edges) == 96
    assert result.surface.hard_edges.max() == result.n_verts - 2 - 1


def test_diagonals_of_a_glb_box_are_not_hard(read):
    file = Gltf()
    quads = BOX_CORNERS[BOX_QUADS]
    normals = np.cross(quads[:, 1] - quads[:, 0], quads[:, 2] - quads[:, 0])
    faces = np.arange(24).reshape(6, 4)[:, [0, 1, 2, 0, 2, 3]]
    values = {"NORMAL": file.accessor(np.repeat(normals, 4, axis=0))}
    file.node(mesh=file.mesh(quads.reshape(-1, 3), faces, attributes=values))
    result, notes = read(file)
    assert len(result.surface.hard_edges) == 12
    assert any(note.startswith("kept 12 of 18 edges") for note in notes)


def rows(values):
    return ", ".join(str(tuple(np.round(value, 6).tolist())) for value in values)


def usda(more="", *, corners=CORNERS, normals=None, scheme="none"):
    listed = "" if normals is None else f"normal3f[] normals = [{rows(normals)}] (\n"
    end = "" if normals is None else 'interpolation = "faceVarying")\n'
    return f"""#usda 1.0
def Mesh "m" {{
  point3f[] points = [{rows(CAKE.vertices[0])}]
  uniform token subdivisionScheme = "{scheme}"
  int[] faceVertexCounts = {SIZES.tolist()}
  int[] faceVertexIndices = {np.asarray(corners).tolist()}
  {listed}{end}{more}
}}
"""


@pytest.fixture
def pxr():
    pytest.importorskip("pxr")


def test_usd_corner_normals_give_hard_rims(read, pxr):
    result, notes = read(usda(normals=cake_normals(CAKE)), ".usda")
    assert places(result) == places(CAKE)
    assert "kept 48 of 120 edges as hard edges" in notes[-1]


def test_left_handed_usd_mesh_has_hard_rims(read, pxr):
    starts = np.repeat(np.cumsum(SIZES) - SIZES, SIZES)
    turned = starts + (starts - np.arange(len(starts))) % np.repeat(SIZES, SIZES)
    text = usda('uniform token orientation = "leftHanded"', corners=CORNERS[turned],
                normals=cake_normals(CAKE)[turned])  # fmt: skip
    result, notes = read(text, ".usda")
    assert places(result) == places(CAKE)
    assert not any("do not follow" in note for note in notes)


def test_edges_of_usd_holes_are_not_hard(read, pxr):
    holes = f"int[] holeIndices = {list(range(24, 48))}"  # the bottom
    result, _ = read(usda(holes, normals=cake_normals(CAKE)), ".usda")
    assert places(result) == {e for e in places(CAKE) if all(z for _, _, z in e)}


def test_usd_creases_are_left_out_with_the_subdivision(read, pxr):
    creases = (
        "int[] creaseIndices = [0, 1]\nint[] creaseLengths = [2]\nfloat[] creaseSharpnesses = [10]"
    )
    for scheme, n_notes in (("catmullClark", 1), ("none", 0)):
        result, notes = read(usda(creases, scheme=scheme), ".usda")
        assert result.surface.hard_edges is None
        assert sum("subdivision, whose cages" in note for note in notes) == n_notes


def test_alembic_corner_normals_give_hard_rims(tmp_path, notes):
    sample = pytest.importorskip("samples.alembic")
    from alembic3d import AbcGeom

    path = tmp_path / "a.abc"
    archive = sample.archive(path)
    mesh = AbcGeom.OPolyMesh(archive.getTop(), "cake")
    order = np.concatenate([row[::-1] for row in np.split(np.arange(len(CORNERS)),
                                                          np.cumsum(SIZES)[:-1])])  # fmt: skip
    normals = AbcGeom.ON3fGeomParamSample()
    normals.setVals(sample.points_array(cake_normals(CAKE)[order]))
    normals.setScope(AbcGeom.GeometryScope.kFacevaryingScope)
    one = AbcGeom.OPolyMeshSchemaSample(
        sample.points_array(CAKE.vertices[0]),
        sample.int_array(CORNERS[order]),
        sample.int_array(SIZES),
    )
    one.setNormals(normals)
    mesh.getSchema().set(one)
    del mesh, archive
    result = load(path, notes=notes)
    assert places(result) == places(CAKE)
    assert "kept 48 of 120 edges as hard edges" in notes[-1]


def obj(face_lines, normals=()):
    points = "".join("v {} {} {}\n".format(*one) for one in CAKE.vertices[0].tolist())
    return (
        points
        + "".join("vn {} {} {}\n".format(*normal) for normal in normals)
        + "".join(face_lines)
    )


def cake_lines(word="{}", statements=None):
    words = [word.format(v + 1, c + 1) for c, v in enumerate(CORNERS.tolist())]
    lines = []
    for face, one in enumerate(np.split(np.array(words, object), np.cumsum(SIZES)[:-1])):
        lines += [(statements or {}).get(face, ""), f"f {' '.join(one)}\n"]
    return lines


def test_obj_normals_give_hard_rims(read):
    result, notes = read(obj(cake_lines("{}//{}"), cake_normals(CAKE).tolist()), ".obj")
    assert places(result) == places(CAKE)
    assert "kept 48 of 120 edges as hard edges" in notes[-1]


def test_obj_smoothing_groups_give_hard_rims(read):
    result, _ = read(obj(cake_lines(statements={0: "s 1\n", 24: "s 2\n", 48: "s off\n"})), ".obj")
    inner = {e for e in places(result) if (0.0, 0.0, 0.5) in e}
    assert places(result) - inner == places(CAKE)
    assert len(inner) == 24  # faces without a group are not smoothed


def test_single_obj_smoothing_group_gives_no_hard_edges(read):
    result, notes = read(obj(cake_lines(statements={0: "s 1\n"})), ".obj")
    assert result.surface.hard_edges is None
    assert not any("normals" in note for note in notes)


def test_invalid_obj_normals_give_no_hard_edges(read):
    result, _ = read(obj(cake_lines("{}//{}"), [["x", 0, 0]]), ".obj")
    assert result.surface.hard_edges is None


def ascending(edges):
    return np.unique(np.sort(edges, axis=1), axis=0)


def loaded(path):
    notes = []
    return load(path, notes=notes), notes


def assert_same_normals(found, expected, atol=1e-5):
    """Corner normals of all frames of a sequence."""
    one, other = (
        meshreel.corner_normals(x.vertices, x.faces, x.surface) for x in (found, expected)
    )
    np.testing.assert_allclose(one, other, atol=atol)


@pytest.mark.parametrize("extension", [".npz", ".h5"])
def test_array_formats_round_trip_hard_edges(tmp_path, extension):
    if extension == ".h5":
        pytest.importorskip("h5py")
    box = hard_box()
    save(box, tmp_path / f"a{extension}")
    result, notes = loaded(tmp_path / f"a{extension}")
    assert_same_surface(result.surface, box.surface)
    assert notes == []


@pytest.mark.parametrize("make", [hard_box, cake, hard_sheet])
@pytest.mark.parametrize("extension", [".usdc", ".abc"])
def test_scene_formats_round_trip_hard_edges_without_a_track(tmp_path, make, extension):
    pytest.importorskip("pxr" if extension == ".usdc" else "alembic3d")
    sequence = make()
    save(sequence, tmp_path / f"a{extension}")
    result, notes = loaded(tmp_path / f"a{extension}")
    assert_same_normals(result, sequence, 1e-4)
    assert result.tracks == {}
    assert not any("do not follow" in note for note in notes)


def test_usd_stores_corner_normals_for_other_programs(tmp_path):
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom

    box = hard_box()
    save(box, tmp_path / "a.usda")
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    mesh = next(prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh))
    normals = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("normals")
    assert normals.GetInterpolation() == "faceVarying"
    for frame, code in enumerate(normals.GetTimeSamples()):
        expected = meshreel.corner_normals(box.vertices[frame], box.faces, box.surface)
        np.testing.assert_allclose(normals.ComputeFlattened(code), expected, atol=1e-6)


def test_normals_of_all_parts_are_written(tmp_path):
    pytest.importorskip("pxr")
    box = hard_box()
    save(box, tmp_path / "a.usda")
    save(load(tmp_path / "a.usda", merge=True), tmp_path / "b.usda")
    assert len(load(tmp_path / "b.usda").surface.hard_edges) == 12


@pytest.mark.parametrize("make", [hard_box, cake])
def test_glb_splits_vertices_at_hard_edges(tmp_path, make, notes):
    sequence = make()
    glb = written(tmp_path, sequence, notes)
    primitive = glb.document["meshes"][0]["primitives"][0]
    normals = glb.array(primitive["attributes"]["NORMAL"])
    corners = glb.array(primitive["indices"]).ravel()
    count = {8: 24, 50: 98}[sequence.n_verts]
    assert len(normals) == count
    sizes = sequence.surface.face_sizes
    still = sequence.replace(vertices=sequence.vertices.mean(axis=0, keepdims=True))
    expected = meshreel.corner_normals(still.vertices[0], still.faces, still.surface)
    of_corner = dict(zip(corners_of_triangles(sizes), corners.tolist(), strict=True))
    for corner, normal in enumerate(expected):
        assert normals[of_corner[corner]] @ normal > 0.99
    assert any("smooth except at hard edges" in note for note in notes)


def corners_of_triangles(sizes):
    """Face corner of each triangle corner."""
    starts = np.cumsum(sizes) - sizes
    return [
        start + k
        for start, size in zip(starts.tolist(), sizes.tolist(), strict=True)
        for second in range(1, size - 1)
        for k in (0, second, second + 1)
    ]


@pytest.mark.parametrize("make", [hard_box, cake])
def test_glb_round_trips_hard_edges(tmp_path, make):
    sequence = make(1)
    save(sequence, tmp_path / "a.glb")
    result, _ = loaded(tmp_path / "a.glb")
    assert result.n_verts == sequence.n_verts
    assert len(result.surface.hard_edges) == len(sequence.surface.hard_edges)


def test_glb_without_normals_splits_no_vertices(tmp_path):
    glb = written(tmp_path, hard_box(), normals=False)
    attributes = glb.document["meshes"][0]["primitives"][0]["attributes"]
    assert "NORMAL" not in attributes
    assert len(glb.array(attributes["POSITION"])) == 8


@pytest.mark.parametrize("make", [hard_box, cake])
def test_obj_hard_edges_become_smoothing_groups(tmp_path, make):
    sequence = make(2)
    save(sequence, tmp_path / "a_%04d.obj")
    text = next(tmp_path.glob("*.obj")).read_text()
    assert "vn " not in text
    n_groups = {8: 1, 50: 3}[sequence.n_verts]
    assert text.count("\ns ") == n_groups
    assert ("\ns off\n" in text) == (n_groups == 1)
    result, notes = loaded(tmp_path)
    np.testing.assert_array_equal(
        ascending(result.surface.hard_edges), ascending(sequence.surface.hard_edges)
    )
    assert not any("left out" in note for note in notes)


def test_obj_falls_back_to_normals_for_hard_edges(tmp_path):
    sheet = hard_sheet(1)
    save(sheet, tmp_path / "a.obj")
    text = (tmp_path / "a.obj").read_text()
    assert "\ns " not in text
    rows = np.array([line.split()[1:] for line in text.splitlines() if line.startswith("vn ")])
    words = " ".join(line[2:] for line in text.splitlines() if line.startswith("f ")).split()
    named = rows.astype(float)[[int(word.split("/")[2]) - 1 for word in words]]
    expected = meshreel.corner_normals(sheet.vertices[0], sheet.faces, sheet.surface)
    np.testing.assert_allclose(named, expected, atol=1e-6)
    result, _ = loaded(tmp_path / "a.obj")
    assert_same_normals(result, sheet, 1e-4)


@pytest.mark.parametrize("extension", [".ply", ".off", ".stl", ".pvd"])
def test_unsupported_hard_edges_are_noted(tmp_path, extension, notes):
    save(hard_box(1), tmp_path / f"a{extension}", notes=notes)
    assert any("12 hard edges" in note for note in notes)


def test_surface_without_hard_edges_adds_no_note(tmp_path, notes):
    save(waving_grid(1), tmp_path / "a.ply", notes=notes)
    assert notes == []
