import numpy as np
import pytest

import meshreel
from meshreel.errors import ConnectivityChangeError, FormatError, InvalidInputError
from meshreel.formats.gltf.write import align_influences
from meshreel.formats.load import load
from meshreel.runtime.counting import size_text
from samples.glb import Glb
from samples.gltf import TRIANGLE, Gltf, shifted
from samples.meshes import waving_grid
from samples.rigs import bending_tube, boxes, turn
from unit.formats.gltf.test_write import two_parts

HALF = np.sqrt(0.5)


def skinned(joints, weights, *, binds=None, dtype="u1", weight_dtype="f4", **node):
    """Return a triangle bound to a root and, at (0, 1, 0), a tip that rotates by 90 degrees."""
    file = Gltf()
    normalized = {} if weight_dtype == "f4" else {"normalized": True}
    attributes = {}
    for number, (one, other) in enumerate(zip(joints, weights, strict=True)):
        attributes[f"JOINTS_{number}"] = file.accessor(one, dtype)
        attributes[f"WEIGHTS_{number}"] = file.accessor(other, weight_dtype, **normalized)
    mesh = file.mesh(TRIANGLE, attributes=attributes)
    tip = file.node(is_root=False, translation=[0, 1, 0])
    root = file.node(children=[tip])
    skin = file.add("skins", joints=[root, tip])
    if binds is not None:
        columns = np.transpose(binds, (0, 2, 1))
        file.json["skins"][skin]["inverseBindMatrices"] = file.accessor(columns)
    file.node(mesh=mesh, skin=skin, **node)
    file.animate(tip, "rotation", [0, 0.5], [[0, 0, 0, 1], [0, 0, HALF, HALF]], "STEP")
    file.animate(root, "translation", [0, 0.5], [[0, 0, 0], [0, 0, 5]])
    return file


def translated_binds():
    binds = np.tile(np.eye(4), (2, 1, 1))
    binds[1, 1, 3] = -1
    return binds


ROOT_TIP_BOTH = [[0, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]]
ONE_ONE_HALVES = [[1, 0, 0, 0], [1, 0, 0, 0], [0.5, 0.5, 0, 0]]


@pytest.fixture
def read(tmp_path):

    def loaded(file, **options):
        return load(file.save(tmp_path / "a.glb"), **options)

    return loaded


def test_vertices_follow_their_joints(read):
    result = read(skinned([ROOT_TIP_BOTH], [ONE_ONE_HALVES], binds=translated_binds()))
    # The tip rotates about (0, 1, 0), so (1, 0, 0) moves to (1, 2, 0); all move by 5 along z.
    np.testing.assert_allclose(result.vertices[0], TRIANGLE, rtol=0, atol=1e-7)
    expected = [[0, 0, 5], [1, 2, 5], [0, 1, 5]]
    np.testing.assert_allclose(result.vertices[1], expected, rtol=0, atol=1e-6)


def test_missing_bind_matrices_are_identities(read):
    result = read(skinned([ROOT_TIP_BOTH], [ONE_ONE_HALVES]))
    np.testing.assert_allclose(result.vertices[0], [[0, 0, 0], [1, 1, 0], [0, 1.5, 0]], atol=1e-7)
    # Half of the root's (0, 1, 5), half of the tip's (-1, 1, 5).
    expected = [[0, 0, 5], [0, 2, 5], [-0.5, 1, 5]]
    np.testing.assert_allclose(result.vertices[1], expected, rtol=0, atol=1e-6)


def test_transform_of_a_skinned_mesh_is_ignored(read):
    plain = read(skinned([ROOT_TIP_BOTH], [ONE_ONE_HALVES]))
    moved = skinned([ROOT_TIP_BOTH], [ONE_ONE_HALVES], translation=[9, 9, 9], scale=[-1, 1, 1])
    result = read(moved)
    assert result.vertices.tobytes() == plain.vertices.tobytes()
    np.testing.assert_array_equal(result.faces, plain.faces)


@pytest.mark.parametrize(("dtype", "weight_dtype"), [("u2", "f4"), ("u1", "u1"), ("u2", "u2")])
def test_all_types_of_joints_and_weights_give_the_same_result(read, dtype, weight_dtype):
    maximum = 1 if weight_dtype == "f4" else np.iinfo(weight_dtype).max
    weights = np.array(ONE_ONE_HALVES) * maximum  # truncated halves are normalized again
    result = read(skinned([ROOT_TIP_BOTH], [weights], dtype=dtype, weight_dtype=weight_dtype))
    expected = read(skinned([ROOT_TIP_BOTH], [ONE_ONE_HALVES]))
    np.testing.assert_allclose(result.vertices, expected.vertices, rtol=0, atol=1e-6)


def test_weights_are_normalized(read):
    scaled = np.array(ONE_ONE_HALVES) * [[3], [1e-30], [0.25]]
    result = read(skinned([ROOT_TIP_BOTH], [scaled]))
    expected = read(skinned([ROOT_TIP_BOTH], [ONE_ONE_HALVES]))
    np.testing.assert_allclose(result.vertices, expected.vertices, rtol=0, atol=1e-6)


@pytest.mark.parametrize("weight", [0.0, np.nan])  # FBX2glTF writes NaN
def test_vertex_without_weights_follows_its_first_joint(read, weight):
    result = read(skinned([np.ones((3, 4))], [np.full((3, 4), weight)]))
    expected = read(skinned([np.ones((3, 4))], [np.tile([1, 0, 0, 0], (3, 1))]))
    assert result.vertices.tobytes() == expected.vertices.tobytes()


def test_vertices_follow_the_joints_of_all_sets(read):
    none, tip = np.zeros((3, 4)), np.tile([0, 0, 0, 1], (3, 1))
    weights = np.tile([0.5, 0, 0, 0], (3, 1)), np.tile([0, 0, 0, 0.5], (3, 1))
    result = read(skinned([none, tip], weights))
    both = read(skinned([np.tile([0, 1, 0, 0], (3, 1))], [np.tile([0.5, 0.5, 0, 0], (3, 1))]))
    np.testing.assert_allclose(result.vertices, both.vertices, rtol=0, atol=1e-7)


def test_morph_targets_are_applied_before_skinning(read):
    file = skinned([ROOT_TIP_BOTH], [ONE_ONE_HALVES], binds=translated_binds())
    [primitive] = file.json["meshes"][0]["primitives"]
    primitive["targets"] = [{"POSITION": file.accessor([[0, 0, 0], [1, 0, 0], [0, 0, 0]])}]
    file.json["meshes"][0]["weights"] = [1]
    np.testing.assert_allclose(read(file).vertices[1, 1], [1, 3, 5], rtol=0, atol=1e-6)


def test_mesh_without_joints_at_a_node_with_a_skin_is_rigid(read):
    file = skinned([], [], translation=[0, 0, 3])
    np.testing.assert_array_equal(read(file).vertices, [shifted(TRIANGLE, [0, 0, 3])])


def test_joints_outside_of_the_scene_move_a_mesh(read):
    file = skinned([ROOT_TIP_BOTH], [ONE_ONE_HALVES])
    expected = read(file)
    file.json["scenes"][0]["nodes"] = [2]
    assert read(file).vertices.tobytes() == expected.vertices.tobytes()


def broken(change):
    file = skinned([ROOT_TIP_BOTH], [ONE_ONE_HALVES], binds=translated_binds())
    change(file)
    return file


def one_joint(file):
    file.json["skins"][0]["joints"] = [1]


def few_matrices(file):
    file.json["accessors"][file.json["skins"][0]["inverseBindMatrices"]]["count"] = 1


def no_joints(file):
    file.json["skins"][0]["joints"] = []


def far_joint(file):
    file.json["skins"][0]["joints"] = [0, 7]


def float_joints(file):
    [primitive] = file.json["meshes"][0]["primitives"]
    primitive["attributes"]["JOINTS_0"] = primitive["attributes"]["WEIGHTS_0"]


def some_joints(file):
    [primitive] = file.json["meshes"][0]["primitives"]
    attributes = {"POSITION": primitive["attributes"]["POSITION"]}
    file.json["meshes"][0]["primitives"].append({"attributes": attributes})


def negative_weights(file):
    [primitive] = file.json["meshes"][0]["primitives"]
    primitive["attributes"]["WEIGHTS_0"] = file.accessor(-np.ones((3, 4)))


def some_weights_nan(file):
    [primitive] = file.json["meshes"][0]["primitives"]
    primitive["attributes"]["WEIGHTS_0"] = file.accessor([[1, np.nan, 0, 0]] * 3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (one_joint, "node 2: its mesh refers to joint 1, but its skin has 1"),
        (few_matrices, "skin 0: has 1 inverse bind matrices for 2 joints"),
        (no_joints, "skin 0: 'joints' must be a list of at least one node"),
        (far_joint, "skin 0: 'joints' must be a list of indices below 3"),
        (float_joints, "JOINTS_0 must be unsigned integers"),
        (some_joints, "mesh 0: only some of its primitives have joints"),
        (negative_weights, "mesh 0: joint weights must be finite and at least 0"),
        (some_weights_nan, "mesh 0: joint weights must be finite and at least 0"),
    ],
)
def test_invalid_skins_are_rejected(read, change, message):
    with pytest.raises(FormatError, match=message):
        read(broken(change))


def saved(tmp_path, sequence, **options):
    notes, path = [], tmp_path / "rig.glb"
    meshreel.save(sequence, path, notes=notes, rig=True, **options)
    return path, notes


@pytest.mark.parametrize("meshopt", [True, False])
@pytest.mark.parametrize("bulge", [0.0, 0.3])
def test_read_back_positions_are_those_of_the_rig(tmp_path, meshopt, bulge):
    tube = bending_tube(bulge=bulge)
    options = {"rig": 2} if bulge else {}
    path = tmp_path / "tube.glb"
    meshreel.save(tube, path, meshopt=meshopt, **{"rig": True, **options})
    rig, back = meshreel.rig(tube, options.get("rig")), meshreel.load(path)
    assert (rig.n_targets > 0) == bool(bulge)
    assert (back.n_frames, back.fps) == (tube.n_frames, 25)
    document = Glb.read(path.read_bytes()).document
    [joints] = {mesh["primitives"][0]["attributes"]["JOINTS_0"] for mesh in document["meshes"]}
    assert "normalized" not in document["accessors"][joints]
    shown, found = rig.positions() + rig.origin, back.vertices
    if meshopt:  # vertices are reordered
        quality = meshreel.compare(tube, back)
        assert quality.kg_error_percent == pytest.approx(rig.errors.kg_percent, abs=1e-4)
    difference = np.sort(found, axis=1) - np.sort(shown, axis=1)
    assert np.abs(difference).max() <= 1e-5 * np.ptp(shown)


def test_notes_name_errors_and_bytes(tmp_path):
    path, notes = saved(tmp_path, bending_tube())
    assert notes[0].startswith("the rig has ")
    assert "KG error" in notes[0]
    assert notes[1].startswith(f"{size_text(path.stat().st_size)}: mesh ")


def test_skeleton_is_a_tree_of_named_nodes_below_one(tmp_path):
    glb = Glb.read(saved(tmp_path, bending_tube())[0].read_bytes())
    [skin] = glb.document["skins"]
    nodes = glb.document["nodes"]
    names = [nodes[joint]["name"] for joint in skin["joints"]]
    assert names[0].startswith("bone_")
    children = [child for node in nodes for child in node.get("children", [])]
    assert set(skin["joints"]) <= set(children)
    assert sorted(children) == sorted(set(children))
    [mesh] = [node for node in nodes if "mesh" in node]
    assert mesh["skin"] == 0


def test_parts_with_attributes_share_the_skeleton(tmp_path):
    pair = two_parts()
    path, _ = saved(tmp_path, pair)
    glb = Glb.read(path.read_bytes())
    assert [node.get("skin") for node in glb.document["nodes"] if "mesh" in node] == [0, 0]
    back = meshreel.load(path, merge=True)
    assert [part.name for part in back.surface.parts] == ["/left", "/right"]


def test_vertices_without_faces_are_left_out(tmp_path):
    tube = bending_tube()
    extra = np.concatenate([tube.vertices, tube.vertices[:, :1] + 1], axis=1)
    path, notes = saved(tmp_path, tube.replace(vertices=extra))
    assert "left out 1 vertex that no face uses" in notes
    assert meshreel.load(path).n_verts == tube.n_verts


def test_one_frame_is_written_without_animation(tmp_path):
    path, _ = saved(tmp_path, bending_tube()[:1])
    assert "animations" not in Glb.read(path.read_bytes()).document
    assert meshreel.load(path).n_frames == 1


def test_rigid_motion_has_no_more_channels_than_it_needs(tmp_path):
    sequence = boxes([lambda t: np.eye(3), lambda t: turn(0.2 * t)])
    path, _ = saved(tmp_path, sequence)
    assert len(Glb.read(path.read_bytes()).document["animations"][0]["channels"]) <= 3
    assert (meshreel.load(path).n_frames, meshreel.load(path).fps) == (12, 25)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rig": None, "kg": 1.0}, "kg is a bound of rigs; add rig"),
        ({"rig": None, "quality": 50}, "quality is a bound of rigs; add rig"),
        ({"quality": 50, "kg": 1.0}, "omit it, or kg"),
        ({"quality": 50, "max_error": 1.0}, "omit it, or max_error"),
        ({"rig": 300}, "rig takes 1 to 256 bones; got 300"),
    ],
)
def test_contradicting_options_are_refused(tmp_path, options, message):
    with pytest.raises(InvalidInputError, match=message):
        meshreel.save(bending_tube(), tmp_path / "a.glb", **{"rig": True, **options})
    assert not list(tmp_path.iterdir())


def test_changing_faces_are_refused(tmp_path):
    both = meshreel.concatenate([bending_tube(), boxes([lambda t: np.eye(3)])])
    with pytest.raises(ConnectivityChangeError, match="meshreel register"):
        saved(tmp_path, both)


def test_no_option_writes_a_rig_beyond_its_bounds(tmp_path):
    noise = np.random.default_rng(6).normal(size=(150, 60, 3))
    faces = np.arange(60, dtype=np.int32).reshape(-1, 3)
    sequence = meshreel.MeshSequence(noise, faces, 25.0)
    with pytest.raises(InvalidInputError, match="or up to 256 bones, or write morph targets"):
        meshreel.save(sequence, tmp_path / "a.glb", rig=2, overwrite=True)
    with pytest.raises(InvalidInputError, match="force"):
        meshreel.save(sequence, tmp_path / "a.glb", rig=2, force=True)
    assert not list(tmp_path.iterdir())


def test_influences_stay_in_their_columns():
    joints = np.array([[3, 5, 0, 0], [5, 3, 0, 0], [5, 8, 3, 0]], np.uint8)
    weights = np.array([[200, 55, 0, 0], [200, 55, 0, 0], [100, 100, 55, 0]], np.uint8)
    aligned, shares = align_influences(joints, weights)
    assert aligned.tolist() == [[3, 5, 0, 0], [3, 5, 0, 0], [3, 5, 8, 0]]
    assert shares.tolist() == [[200, 55, 0, 0], [55, 200, 0, 0], [55, 100, 100, 0]]


def test_smaller_of_rig_and_morph_targets_is_written_within_a_bound(tmp_path):
    sizes = {}
    for name, options in {"chosen": {}, "rig": {"rig": True}, "morphs": {"rig": 0}}.items():
        notes = []
        path = tmp_path / f"{name}.glb"
        meshreel.save(bending_tube(), path, max_error=1.0, notes=notes, **options)
        sizes[name] = path.stat().st_size
        assert ("skins" in Glb.read(path.read_bytes()).document) == (name != "morphs")
        is_chosen = any("since morph targets within the bound take" in note for note in notes)
        assert is_chosen == (name == "chosen")
        assert any("morph target" in note for note in notes) == (name != "rig")
    assert sizes["chosen"] == sizes["rig"] < sizes["morphs"]


@pytest.mark.parametrize("make", [waving_grid, lambda: boxes([turn] * 60)])
def test_morph_targets_are_kept_where_a_rig_is_larger(tmp_path, make):
    sequence = make()
    for name, options in {"chosen": {}, "morphs": {"rig": False}}.items():
        meshreel.save(sequence, tmp_path / f"{name}.glb", max_error=0.5, **options)
    assert (tmp_path / "chosen.glb").read_bytes() == (tmp_path / "morphs.glb").read_bytes()
