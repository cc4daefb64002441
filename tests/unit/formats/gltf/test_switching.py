"""Meshes of glTF files that are shown in turn, by visibility or by scale."""

import json

import numpy as np
import pytest

import meshreel
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.options import WriteOptions
from samples.gltf import Gltf
from samples.meshes import waving_grid

VISIBILITY, POINTER = "KHR_node_visibility", "KHR_animation_pointer"
TIMES = [0.0, 0.25, 0.5, 0.75, 1.0]
SQUARE = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
FACES = {
    "tri": [[0, 1, 2]],
    "quad": [[0, 1, 2], [0, 2, 3]],
    "back": [[0, 2, 1], [0, 3, 2]],
}


def pointer_target(node, end=f"extensions/{VISIBILITY}/visible"):
    pointer = {"pointer": f"/nodes/{node}/{end}"}
    return {"path": "pointer", "extensions": {POINTER: pointer}}


def show(file, node, shown, by, keys=TIMES):
    """Animate whether a node is shown, by "visible" or "scale"."""
    if by == "scale":
        file.animate(node, "scale", keys, [[scale] * 3 for scale in shown], "STEP")
        return
    file.animate(node, "scale", keys, [[scale] * 3 for scale in shown], "STEP")
    animation = file.json["animations"][0]
    animation["samplers"][-1]["output"] = file.accessor(np.uint8(shown), "u1")
    animation["channels"][-1]["target"] = pointer_target(node)
    file.json["nodes"][node]["extensions"] = {VISIBILITY: {"visible": bool(shown[0])}}


def switching(by, shown):
    """Return a file with nodes of a triangle and squares that are shown at some of `TIMES`."""
    file = Gltf()
    file.json["extensionsUsed"] = file.json["extensionsRequired"] = [VISIBILITY, POINTER]
    for name, values in shown.items():
        points = SQUARE[:3] if name == "tri" else SQUARE
        node = file.node(mesh=file.mesh(points, FACES[name]), name=name)
        show(file, node, values, by)
    return file


@pytest.mark.parametrize("by", ["visible", "scale"])
def test_meshes_shown_in_turn_are_segments(tmp_path, by):
    shown = {"tri": [1, 1, 0, 0, 0], "quad": [0, 0, 1, 0, 0], "back": [0, 0, 0, 1, 1]}
    loaded = meshreel.load(switching(by, shown).save(tmp_path / "a.glb"))
    assert loaded.starts == (0, 2, 3, 5)
    assert loaded.fps == 4
    for segment, faces in zip(loaded.segments, FACES.values(), strict=True):
        np.testing.assert_array_equal(segment.faces, faces)
        np.testing.assert_array_equal(
            segment.read(0, segment.n_frames)[0], SQUARE[: segment.n_verts]
        )


@pytest.mark.parametrize("by", ["visible", "scale"])
def test_a_mesh_that_returns_is_a_further_segment(tmp_path, by):
    shown = {"tri": [1, 0, 0, 1, 1], "quad": [0, 1, 1, 0, 0]}
    loaded = meshreel.load(switching(by, shown).save(tmp_path / "a.gltf"))
    assert loaded.starts == (0, 1, 3, 5)
    assert (loaded.n_segments, loaded.n_meshes) == (3, 2)


def test_nodes_shown_together_are_parts_of_a_segment(tmp_path):
    shown = {"tri": [1, 1, 0, 0, 0], "quad": [0, 0, 1, 1, 1], "back": [0, 0, 1, 1, 1]}
    loaded = meshreel.load(switching("visible", shown).save(tmp_path / "a.glb"))
    assert loaded.starts == (0, 2, 5)
    assert [part.name for part in loaded.segments[1].surface.parts] == ["/quad", "/back"]


def test_visibility_of_a_node_above_hides_its_meshes(tmp_path):
    file = switching("visible", {"tri": [1, 1, 0, 0, 0]})
    child = file.node(mesh=file.mesh(SQUARE, FACES["quad"]), name="quad", is_root=False)
    parent = file.node(children=[child], name="group")
    show(file, parent, [0, 0, 1, 1, 1], "visible")
    loaded = meshreel.load(file.save(tmp_path / "a.glb"))
    assert loaded.starts == (0, 2, 5)
    assert loaded.segments[1].n_verts == 4


def test_frames_without_a_mesh_at_the_ends_are_left_out(tmp_path):
    shown = {"tri": [0, 1, 0, 0, 0], "quad": [0, 0, 1, 1, 0]}
    loaded = meshreel.load(switching("visible", shown).save(tmp_path / "a.glb"))
    assert (loaded.starts, loaded.start_s) == ((0, 1, 3), 0.25)


def test_animation_of_meshes_continues_while_they_are_shown(tmp_path):
    file = switching("visible", {"tri": [1, 1, 0, 0, 0], "quad": [0, 0, 1, 1, 1]})
    for node in (0, 1):
        file.animate(node, "translation", [0, 1], [[0, 0, 0], [4, 0, 0]])
    loaded = meshreel.load(file.save(tmp_path / "a.glb"), fps=4)
    moved = [frame.vertices[0, 0] for frame in loaded]
    np.testing.assert_allclose(moved, [0, 1, 2, 3, 4], atol=1e-6)


def test_transforms_are_read_from_pointers(tmp_path):
    file = Gltf.of_mesh(SQUARE, FACES["quad"], name="quad")
    file.animate(0, "translation", [0, 1], [[0, 0, 0], [4, 0, 0]])
    file.json["animations"][0]["channels"][0]["target"] = pointer_target(0, "translation")
    loaded = meshreel.load(file.save(tmp_path / "a.glb"), fps=4)
    np.testing.assert_allclose(loaded.vertices[:, 0, 0], [0, 1, 2, 3, 4], atol=1e-6)


@pytest.mark.parametrize(
    "shown",
    [
        {"tri": [1, 1, 1, 0, 0], "quad": [0, 0, 1, 1, 1]},  # both at 0.5 s
        {"tri": [1, 1, 0, 0, 0], "quad": [0, 0, 0, 1, 1]},  # none at 0.5 s
        {"tri": [1, 1, 1, 1, 1], "quad": [0, 0, 1, 1, 1]},  # one is always shown
    ],
)
def test_other_changes_of_visibility_are_left_out_with_a_note(tmp_path, shown, notes):
    path = switching("visible", shown).save(tmp_path / "a.glb")
    with pytest.raises(InvalidInputError, match="2 meshes"):
        meshreel.load(path)
    loaded = meshreel.load(path, merge=True, notes=notes)
    assert loaded.n_verts == 7
    assert "left out: changes of the visibility of /tri, /quad" in notes


def test_a_selected_mesh_is_read_alone(tmp_path, notes):
    shown = {"tri": [1, 1, 0, 0, 0], "quad": [0, 0, 1, 1, 1]}
    path = switching("visible", shown).save(tmp_path / "a.glb")
    assert meshreel.load(path, object="quad", notes=notes).n_verts == 4
    assert "left out: changes of the visibility of /tri, /quad" in notes


def test_hidden_meshes_are_left_out_with_a_note(tmp_path, notes):
    file = Gltf()
    file.json["extensionsUsed"] = [VISIBILITY]
    file.node(mesh=file.mesh(SQUARE, FACES["quad"]), name="quad")
    hidden = {VISIBILITY: {"visible": False}}
    child = file.node(mesh=file.mesh(), name="tri", is_root=False)
    file.node(children=[child], name="group", extensions=hidden)
    assert meshreel.load(file.save(tmp_path / "a.glb"), notes=notes).n_verts == 4
    assert notes == ["left out: hidden meshes: tri"]
    file.json["nodes"][0]["extensions"] = hidden
    assert meshreel.load(file.save(tmp_path / "b.glb"), merge=True, notes=notes).n_verts == 7
    assert "all meshes are hidden" in notes[-1]


def test_visibility_must_step(tmp_path):
    file = switching("visible", {"tri": [1, 1, 0, 0, 0], "quad": [0, 0, 1, 1, 1]})
    file.json["animations"][0]["samplers"][0]["interpolation"] = "LINEAR"
    with pytest.raises(FormatError, match="STEP, as visibility is not a number"):
        meshreel.load(file.save(tmp_path / "a.glb"), animation=0)


def test_pointers_to_missing_nodes_and_other_properties(tmp_path, notes):
    file = switching("visible", {"tri": [1, 1, 0, 0, 0], "quad": [0, 0, 1, 1, 1]})
    file.animate(0, "scale", TIMES, [[1, 1, 1]] * 5)
    other = {"pointer": "/materials/0/pbrMetallicRoughness/baseColorFactor"}
    channel = file.json["animations"][0]["channels"][-1]
    channel["target"] = {"path": "pointer", "extensions": {POINTER: other}}
    assert meshreel.load(file.save(tmp_path / "a.glb"), notes=notes).n_segments == 2
    assert f"left out: animated properties: {other['pointer']}" in notes
    channel["target"] = pointer_target(2)
    with pytest.raises(FormatError, match="a pointer to one of 2 nodes"):
        meshreel.load(file.save(tmp_path / "b.glb"), animation=0)


def changing():
    grids = [waving_grid(3, 5, 6), waving_grid(1, 4, 5), waving_grid(2, 5, 6)]
    return meshreel.concatenate(grids)


@pytest.mark.parametrize("keeps_extras", [True, False])
def test_segments_survive_writing_and_reading(tmp_path, keeps_extras):
    sequence = changing()
    options = WriteOptions(max_error=0.01)
    meshreel.save(sequence, tmp_path / "a.gltf", options=options)
    if not keeps_extras:  # as files of other programs
        document = json.loads((tmp_path / "a.gltf").read_text())
        removed = [node.pop("extras") for node in document["nodes"] if "extras" in node]
        assert len(removed) == 3
        (tmp_path / "a.gltf").write_text(json.dumps(document))
    loaded = meshreel.load(tmp_path / "a.gltf")
    assert loaded.starts == sequence.starts
    for actual, expected in zip(loaded, sequence, strict=True):
        assert len(actual.faces) == len(expected.faces)
        np.testing.assert_allclose(
            actual.vertices.min(axis=0), expected.vertices.min(axis=0), atol=2e-4
        )
        np.testing.assert_allclose(
            actual.vertices.max(axis=0), expected.vertices.max(axis=0), atol=2e-4
        )
