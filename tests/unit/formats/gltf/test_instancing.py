import tracemalloc

import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load
from samples.gltf import TRIANGLE, Gltf, shifted

HALF = np.sqrt(0.5)
QUARTER_Z = [0, 0, HALF, HALF]
BAKED = "baked 2 instances, one mesh per node"


def instanced(file, *, more=None, **attributes):
    """Return the extensions of a node with instances; attributes are rows or accessor indices."""
    numbers = {
        name: attribute if isinstance(attribute, int) else file.accessor(attribute)
        for name, attribute in attributes.items()
    }
    return {"EXT_mesh_gpu_instancing": {"attributes": {**numbers, **(more or {})}}}


def test_instances_are_scaled_then_rotated_then_translated(read):
    file = Gltf()
    extensions = instanced(
        file,
        TRANSLATION=[[0, 0, 0], [5, 0, 0]],
        ROTATION=[[0, 0, 0, 1], QUARTER_Z],
        SCALE=[[1, 1, 1], [2, 3, 1]],
    )
    file.node(mesh=file.mesh(), extensions=extensions)
    result, notes = read(file)
    expected = [*TRIANGLE, [5, 0, 0], [5, 2, 0], [2, 0, 0]]
    np.testing.assert_allclose(result.vertices[0], expected, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(result.faces, [[0, 1, 2], [3, 4, 5]])
    assert notes == [BAKED]


@pytest.mark.parametrize("dtype", ["i1", "i2"])
def test_rotations_of_instances_may_be_normalized_integers(read, dtype):
    file, maximum = Gltf(), np.iinfo(dtype).max
    quaternions = [[0, 0, 0, maximum], [0, 0, maximum, 0]]
    rotations = file.accessor(quaternions, dtype, normalized=True)
    file.node(mesh=file.mesh(), extensions=instanced(file, ROTATION=rotations))
    expected = [*TRIANGLE, [0, 0, 0], [-1, 0, 0], [0, -1, 0]]
    np.testing.assert_array_equal(read(file)[0].vertices[0], expected)


def test_instances_move_with_their_node(read):
    file = Gltf()
    extensions = instanced(file, TRANSLATION=[[0, 0, 0], [1, 0, 0]])
    node = file.node(mesh=file.mesh(), extensions=extensions)
    file.animate(node, "scale", [0, 1], [[1, 1, 1], [3, 1, 1]], "STEP")
    file.animate(node, "translation", [0, 1], [[0, 0, 0], [0, 7, 0]])
    result, _ = read(file)
    both = np.concatenate([TRIANGLE, shifted(TRIANGLE, [1, 0, 0])])
    np.testing.assert_array_equal(result.vertices, [both, both * [3, 1, 1] + [0, 7, 0]])


def test_morph_targets_are_transformed_with_each_instance(read):
    file = Gltf()
    mesh = file.mesh(targets=[[[0, 0, 1], [0, 0, 0], [0, 0, 0]]])
    extensions = instanced(file, SCALE=[[1, 1, 1], [1, 1, -2]])
    node = file.node(mesh=mesh, extensions=extensions)
    file.animate(node, "weights", [0, 1], [0, 1])
    result, _ = read(file)
    np.testing.assert_array_equal(result.vertices[1][[0, 3]], [[0, 0, 1], [0, 0, -2]])


@pytest.mark.parametrize("node_scale", [[1, 1, 1], [1, -1, 1]])
def test_faces_of_mirroring_instances_are_reversed(read, node_scale):
    file = Gltf()
    uv = file.accessor([[0, 0], [0.5, 0], [0, 0.25], [1, 1]])
    mesh = file.mesh([*TRIANGLE, TRIANGLE[0]], [0, 1, 2, 3, 2, 1], attributes={"TEXCOORD_0": uv})
    extensions = instanced(file, SCALE=[[1, 1, 1], [-1, 1, 1]])
    file.node(mesh=mesh, extensions=extensions, scale=node_scale)
    result, _ = read(file)
    kept, mirrored = [[0, 1, 2], [0, 2, 1]], [[0, 2, 1], [0, 1, 2]]
    if node_scale[1] < 0:
        kept, mirrored = mirrored, kept
    np.testing.assert_array_equal(result.faces, [*kept, *np.add(mirrored, 3)])
    rows = {0: [0, 1], 1: [0.5, 1], 2: [0, 0.75], 3: [1, 0]}
    split = [[0, 1, 2], [3, 2, 1]], [[0, 2, 1], [3, 1, 2]]
    order = split if node_scale[1] > 0 else split[::-1]
    expected = [rows[one] for faces in order for face in faces for one in face]
    [attribute] = result.surface.attributes
    np.testing.assert_array_equal(attribute.per_item(), expected)


def test_instances_have_the_colors_and_materials_of_the_mesh(read):
    file = Gltf()
    colors = np.arange(9).reshape(3, 3) / 8
    mesh = file.mesh(attributes={"COLOR_0": file.accessor(colors)})
    file.json["meshes"][mesh]["primitives"][0]["material"] = file.add("materials", name="leaf")
    extensions = instanced(file, TRANSLATION=[[0, 0, 0], [5, 0, 0]])
    file.node(mesh=mesh, extensions=extensions)
    result, _ = read(file)
    [attribute], [groups] = result.surface.attributes, result.surface.groups
    np.testing.assert_array_equal(attribute.per_item(), np.tile(colors, (2, 1)))
    assert (groups.labels, groups.numbers.tolist()) == (("leaf",), [0, 0])


def test_load_reads_a_file_that_requires_instancing(read):
    file = Gltf()
    file.json["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    extensions = instanced(file, TRANSLATION=[[0, 0, 0], [5, 0, 0]])
    file.node(mesh=file.mesh(), extensions=extensions)
    assert read(file)[0].n_faces == 2


def test_load_notes_attributes_of_instances_that_are_left_out(read):
    file = Gltf()
    number = file.accessor([1, 2])
    extensions = instanced(file, TRANSLATION=[[0, 0, 0], [5, 0, 0]], more={"_ID": number})
    file.node(mesh=file.mesh(), extensions=extensions)
    assert read(file)[1] == [BAKED, "left out: attributes of instances: _ID"]


def test_load_counts_the_instances_of_all_nodes(read):
    file = Gltf()
    extensions = instanced(file, TRANSLATION=[[0, 0, 0], [5, 0, 0]])
    mesh = file.mesh()
    file.node(mesh=mesh, extensions=extensions)
    file.node(mesh=mesh, extensions=extensions, translation=[0, 9, 0])
    result, notes = read(file, merge=True)
    assert notes[0] == "baked 4 instances of 2 nodes, one mesh per node"
    assert [part.n_faces for part in result.surface.parts] == [2, 2]


def test_load_leaves_out_instances_of_skinned_meshes(read):
    file = Gltf()
    joints = file.accessor([[0, 0, 0, 0]] * 3, "u1")
    weights = file.accessor([[1, 0, 0, 0]] * 3)
    mesh = file.mesh(attributes={"JOINTS_0": joints, "WEIGHTS_0": weights})
    skin = file.add("skins", joints=[1])
    extensions = instanced(file, TRANSLATION=[[0, 0, 0], [5, 0, 0]])
    file.node(mesh=mesh, skin=skin, extensions=extensions, name="tail")
    file.node()
    result, notes = read(file)
    assert (result.n_faces, notes) == (1, ["left out: instances of skinned meshes: tail"])


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"TRANSLATION": [[0, 0, 0]], "SCALE": [[1, 1, 1]] * 2}, "'count' must be 1, as"),
        ({"TRANSLATION": [[0, 0, 0, 0]]}, "'type' must be VEC3; got 'VEC4'"),
        ({"SCALE": [[1, 1, np.inf]]}, "node 0, .*: the numbers of 'SCALE' must be finite"),
        ({"TRANSLATION": 99}, "'TRANSLATION' must be below"),
    ],
)
def test_load_describes_what_is_wrong_with_instances(read, attributes, message):
    file = Gltf()
    file.node(mesh=file.mesh(), extensions=instanced(file, **attributes))
    with pytest.raises(FormatError, match=message):
        read(file)


@pytest.mark.slow
@pytest.mark.parametrize(("n_instances", "n_verts"), [(1 << 30, 3), (1 << 18, 3000), (1 << 20, 99)])
def test_load_uses_little_memory_for_a_small_file_with_many_instances(
    tmp_path, n_instances, n_verts
):
    file = Gltf()
    zeros = file.add("accessors", componentType=5126, count=n_instances, type="VEC3")
    rng = np.random.default_rng(1)
    mesh = file.mesh(rng.random((n_verts, 3)))
    file.node(mesh=mesh, extensions=instanced(file, TRANSLATION=zeros))
    path = file.save(tmp_path / "a.glb")
    tracemalloc.start()
    try:
        with pytest.raises(FormatError, match=rf"node 0, with {n_instances} instances: .* 1 GiB"):
            load(path)
        assert tracemalloc.get_traced_memory()[1] < 1 << 30
    finally:
        tracemalloc.stop()
