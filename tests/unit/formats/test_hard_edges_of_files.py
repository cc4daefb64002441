"""Hard edges of a cylinder and a box, read from every format with corner normals."""

import numpy as np
import pytest

from meshreel.formats.load import load
from meshreel.formats.notes import NORMALS
from meshreel.kernel.polygons import triangle_corners
from meshreel.model.geometry.polygons import join_triangles
from samples.gltf import Gltf
from samples.meshes import BOX_CORNERS, BOX_QUADS, cake, cake_normals

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


def test_all_gltf_instances_have_hard_rims(read):
    file = cake_file()
    shifts = file.accessor([[0, 0, 0], [5, 0, 0], [0, 7, 0]])
    file.json["nodes"][0]["extensions"] = {
        "EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": shifts}}
    }
    result, _ = read(file)
    base = places(CAKE)
    moved = {
        frozenset((round(x + a, 3), round(y + b, 3), z) for x, y, z in edge)
        for edge in base
        for a, b in ((0, 0), (5, 0), (0, 7))
    }
    assert places(result) == moved


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


def test_sharp_usd_creases_are_hard(read, pxr):
    loop = [*range(24), 0]
    more = f"""int[] creaseIndices = {[*loop, *(24 + np.array(loop)).tolist()]}
  int[] creaseLengths = [25, 25]
  float[] creaseSharpnesses = [10, 3.5]"""
    result, _ = read(usda(more, scheme="catmullClark"), ".usda")
    assert places(result) == {e for e in places(CAKE) if not any(z for _, _, z in e)}


@pytest.mark.parametrize(
    "more",
    [
        "int[] creaseIndices = [0, 1]\nint[] creaseLengths = [3]\nfloat[] creaseSharpnesses = [10]",
        "int[] creaseIndices = [0, 1]\nint[] creaseLengths = [2]\nfloat[] creaseSharpnesses = []",
        "int[] creaseIndices = [0, 99]\nint[] creaseLengths = [2]\n"
        "float[] creaseSharpnesses = [10]",
        "int[] creaseLengths = [-1]",
    ],
)
def test_invalid_usd_creases_are_ignored(read, pxr, more):
    result, notes = read(usda(more, scheme="catmullClark"), ".usda")
    assert result.surface.hard_edges is None
    assert not any("hard edges" in note for note in notes)


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
