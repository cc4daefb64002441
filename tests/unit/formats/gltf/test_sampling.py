"""Sample times of glTF animations, and meshes that are visible in turn."""

import json

import numpy as np
import pytest

import meshreel
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.gltf.animation import common_rate, sample_times
from meshreel.formats.gltf.scene import CUBICSPLINE, INTERPOLATIONS, LINEAR, STEP, Curve, slerp
from meshreel.formats.options import WriteOptions
from meshreel.model.notes import Notes
from samples.gltf import Gltf
from samples.meshes import waving_grid


def float32(times):
    return np.unique(np.asarray(times, np.float32)).astype(np.float64)


def sample(keys, fps=0.0, *, is_curved=True):
    notes = Notes()
    return sample_times(float32(keys), fps, is_curved=is_curved, notes=notes), notes


@pytest.mark.parametrize("fps", [12, 24, 25, 30000 / 1001, 60, 240])
@pytest.mark.parametrize("start", [0, 1, 100, 86_400])
def test_rate_of_even_keys_is_exact(fps, start):
    result, notes = sample((start + np.arange(50)) / fps)
    assert (result.fps, notes) == (pytest.approx(fps, rel=1e-12), [])
    np.testing.assert_array_equal(result.times_s, (start + np.arange(50)) / result.fps)


@pytest.mark.parametrize(
    ("frames", "fps"),
    [([0, 5, 7, 30], 24), ([0, 2, 3, 4, 6], 24), ([0, 2, 5, 20], 24), ([10, 13, 17], 60)],
)
def test_rate_of_keys_with_gaps_is_the_common_one(frames, fps):
    result, notes = sample(np.array(frames) / fps)
    assert (result.fps, notes) == (fps, [])
    assert len(result.times_s) == frames[-1] - frames[0] + 1


@pytest.mark.parametrize("keys", [[0, 0.1, 0.31, 0.97], [0, 0.999, 1, 2], [0, 1e-4, 5]])
def test_rate_of_irregular_keys_is_thirty_and_noted(keys):
    result, [note, *_] = sample(keys)
    assert result.fps == 30
    assert "not evenly spaced; sampled at 30 frames per second" in note


@pytest.mark.parametrize(("is_curved", "fps", "n_frames"), [(True, 30, 16), (False, 4, 3)])
def test_rate_of_sparse_keys_on_a_curve_is_thirty_and_noted(is_curved, fps, n_frames):
    result, notes = sample([0, 0.25, 0.5], is_curved=is_curved)
    assert (result.fps, len(result.times_s), len(notes)) == (fps, n_frames, is_curved)
    assert all("at 4 per second with curved motion between them" in note for note in notes)


@pytest.mark.parametrize(("fps", "n_frames"), [(24, 25), (10, 11), (7, 8)])
@pytest.mark.parametrize("start", [2, np.float32(2.005)])  # half a tenth of a frame after one
def test_times_span_the_keys_at_a_requested_rate(fps, n_frames, start):
    result, notes = sample([start, start + 0.3, start + 1], fps)
    assert (result.fps, notes) == (fps, [])
    expected = float(start) + np.arange(n_frames) / fps
    np.testing.assert_allclose(result.times_s, expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("end", "fps", "n_frames", "last"),
    [
        (0.25, 30, 9, "0.266667"),
        (1, 0.5, 2, "2"),
        (1, 24.5, 26, "1.02041"),
        (0.01, 30, 2, "0.0333"),
    ],
)
def test_last_frame_shows_the_last_key_between_two_frames(end, fps, n_frames, last):
    result, [note] = sample([2, 2 + end / 3, 2 + end], fps)
    np.testing.assert_allclose(result.times_s, 2 + np.arange(n_frames) / fps, rtol=0, atol=1e-15)
    assert result.curve_times_s[-1] == float32([2 + end])[0]
    assert f"the last frame, {last}" in note
    assert note.endswith("s after the first, shows its final pose")


@pytest.mark.parametrize("end", [0.25, 2_000.0003])
def test_last_frame_snaps_to_the_last_key(end):
    result, _ = sample([0, 0.1, end], 40)
    assert result.curve_times_s[-1] == float32([end])[0]
    assert abs(result.times_s[-1] - end) <= 0.05 / 40


def test_curve_times_snap_to_rounded_keys():
    keys = float32(np.arange(1, 49) / 24)
    result, _ = sample(keys)
    np.testing.assert_array_equal(result.curve_times_s, keys)
    np.testing.assert_array_equal(result.times_s, np.arange(1, 49) / 24)


def test_single_key_gives_one_frame():
    result, notes = sample([1.5])
    assert (result.times_s.tolist(), result.fps, notes) == ([1.5], 0, [])
    assert [len(sample([0, end])[0].times_s) for end in (9e-6, 2e-5)] == [1, 2]


@pytest.mark.parametrize(("end", "fps"), [(1e30, 0), (1e5, 0), (10, 1e9), (3.4e38, 24)])
def test_sampling_rejects_too_many_frames(end, fps):
    with pytest.raises(FormatError, match=r"the limit is 100000; choose a lower rate"):
        sample([0, 0.1, end], fps)


@pytest.mark.parametrize("keys", [[1.0], [1.0, 1.0 + 1e-7]])
def test_keys_at_one_time_have_no_rate(keys):
    assert common_rate(np.array(keys)) == 0


KEYS = np.array([1.0, 1.5, 3.0])
VALUES = np.array([[0.0, 1.0], [2.0, 1.0], [-1.0, 4.0]])
TIMES = np.array([0.0, 1.0, 1.25, 1.5, 2.0, 2.999, 3.0, 9.0])


def rotation(degrees, axis=(0, 0, 1)):
    half = np.radians(degrees) / 2
    return np.append(np.sin(half) * np.array(axis, float), np.cos(half))


def test_linear_curve_is_piecewise_linear():
    result = Curve(KEYS, VALUES, LINEAR).values_at(TIMES)
    expected = [np.interp(TIMES, KEYS, column) for column in VALUES.T]
    np.testing.assert_allclose(result, np.transpose(expected), rtol=0, atol=1e-15)


def test_curve_has_the_exact_values_at_keys():
    values = np.array([[0.1, 1 / 3], [1e9, 2e-9], [np.pi, -np.e]])
    for interpolation in (LINEAR, STEP):
        np.testing.assert_array_equal(Curve(KEYS, values, interpolation).values_at(KEYS), values)


def test_step_curve_is_constant_until_the_next_key():
    result = Curve(KEYS, VALUES, STEP).values_at(TIMES)
    np.testing.assert_array_equal(result, VALUES[[0, 0, 0, 1, 1, 1, 2, 2]])


def test_spline_curve_reproduces_a_cubic():
    def cubic(t):
        return np.stack([t**3 - 2 * t, 0.5 * t**2 + t], axis=1)

    slopes = np.stack([3 * KEYS**2 - 2, KEYS + 1], axis=1)
    curve = Curve(KEYS, cubic(KEYS), CUBICSPLINE, (slopes, slopes))
    times = np.linspace(1, 3, 41)
    np.testing.assert_allclose(curve.values_at(times), cubic(times), rtol=0, atol=1e-13)


def test_spline_curve_uses_out_and_in_tangents_of_the_interval():
    in_tangents, out_tangents = np.full((3, 1), 100.0), np.zeros((3, 1))
    in_tangents[1], out_tangents[0] = 4, 2
    curve = Curve(KEYS, np.zeros((3, 1)), CUBICSPLINE, (in_tangents, out_tangents))
    # Hermite at one half: an eighth of the interval times the difference of slopes.
    np.testing.assert_allclose(curve.values_at(np.array([1.25])), [[0.5 * (2 - 4) / 8]], atol=1e-15)


def test_curve_with_one_key_is_constant():
    curve = Curve(KEYS[:1], VALUES[:1], LINEAR)
    np.testing.assert_array_equal(curve.values_at(TIMES), np.repeat(VALUES[:1], len(TIMES), axis=0))


def test_curve_has_the_later_value_of_two_keys_at_one_time():
    curve = Curve(np.array([0.0, 1, 1, 2]), np.array([[0.0], [1], [5], [6]]), LINEAR)
    np.testing.assert_array_equal(curve.values_at(np.array([0.5, 1, 1.5])), [[0.5], [5], [5.5]])


@pytest.mark.parametrize("degrees", [1e-9, 1e-4, 1, 90, 179, 179.9999])
def test_slerp_rotates_at_constant_speed(degrees):
    weights = np.linspace(0, 1, 11)[:, np.newaxis]
    ends = np.tile(rotation(0), (11, 1)), np.tile(rotation(degrees), (11, 1))
    expected = np.array([rotation(degrees * weight) for weight in weights[:, 0]])
    np.testing.assert_allclose(slerp(*ends, weights), expected, rtol=0, atol=2e-12)


def test_slerp_takes_the_shorter_arc():
    result = slerp(rotation(0)[np.newaxis], -rotation(60)[np.newaxis], np.array([[0.5]]))
    np.testing.assert_allclose(result, [rotation(30)], rtol=0, atol=1e-15)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_rotation_curve_has_unit_quaternions(interpolation):
    values = np.array([rotation(0), rotation(80), -rotation(200)])
    tangents = (values, values) if interpolation == CUBICSPLINE else None
    result = Curve(KEYS, values, interpolation, tangents, is_rotation=True).values_at(TIMES)
    np.testing.assert_allclose(np.linalg.norm(result, axis=1), 1, rtol=0, atol=1e-15)


VISIBILITY, POINTER = "KHR_node_visibility", "KHR_animation_pointer"
SWITCH_TIMES = [0.0, 0.25, 0.5, 0.75, 1.0]
CORNERS = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
FACES = {"tri": [[0, 1, 2]], "quad": [[0, 1, 2], [0, 2, 3]], "back": [[0, 2, 1], [0, 3, 2]]}


def pointer_target(node, end=f"extensions/{VISIBILITY}/visible"):
    pointer = {"pointer": f"/nodes/{node}/{end}"}
    return {"path": "pointer", "extensions": {POINTER: pointer}}


def animate_visibility(file, node, shown, by, keys=SWITCH_TIMES):
    """Animate whether a node is shown, by "visible" or "scale"."""
    if by == "scale":
        file.animate(node, "scale", keys, [[scale] * 3 for scale in shown], "STEP")
        return
    file.animate(node, "scale", keys, [[scale] * 3 for scale in shown], "STEP")
    animation = file.json["animations"][0]
    animation["samplers"][-1]["output"] = file.accessor(np.uint8(shown), "u1")
    animation["channels"][-1]["target"] = pointer_target(node)
    file.json["nodes"][node]["extensions"] = {VISIBILITY: {"visible": bool(shown[0])}}


def switching_file(by, shown):
    """Return a file with nodes of a triangle and squares that are shown at some `SWITCH_TIMES`."""
    file = Gltf()
    file.json["extensionsUsed"] = file.json["extensionsRequired"] = [VISIBILITY, POINTER]
    for name, values in shown.items():
        points = CORNERS[:3] if name == "tri" else CORNERS
        node = file.node(mesh=file.mesh(points, FACES[name]), name=name)
        animate_visibility(file, node, values, by)
    return file


@pytest.mark.parametrize("by", ["visible", "scale"])
@pytest.mark.parametrize(
    ("shown", "starts", "groups"),
    [
        ([[1, 1, 0, 0, 0], [0, 0, 1, 0, 0], [0, 0, 0, 1, 1]], (0, 2, 3, 5), "tri|quad|back"),
        ([[1, 0, 0, 1, 1], [0, 1, 1, 0, 0]], (0, 1, 3, 5), "tri|quad|tri"),
        ([[1, 1, 0, 0, 0], [0, 0, 1, 1, 1], [0, 0, 1, 1, 1]], (0, 2, 5), "tri|quad back"),
    ],
)
def test_meshes_shown_in_turn_are_segments(tmp_path, by, shown, starts, groups):
    file = switching_file(by, dict(zip(FACES, shown, strict=False)))
    loaded = meshreel.load(file.save(tmp_path / "a.glb"))
    assert (loaded.starts, loaded.fps, loaded.n_meshes) == (starts, 4, len({*groups.split("|")}))
    for segment, group in zip(loaded.segments, groups.split("|"), strict=True):
        points, faces = np.empty((0, 3), np.float32), []
        for name in group.split():
            faces += (np.array(FACES[name]) + len(points)).tolist()
            points = np.concatenate([points, CORNERS[: 3 + (name != "tri")]])
        np.testing.assert_array_equal(segment.faces, faces)
        np.testing.assert_array_equal(segment.read(0, segment.n_frames)[0], points)


def test_visibility_of_a_node_above_hides_its_meshes(tmp_path):
    file = switching_file("visible", {"tri": [1, 1, 0, 0, 0]})
    child = file.node(mesh=file.mesh(CORNERS, FACES["quad"]), name="quad", is_root=False)
    parent = file.node(children=[child], name="group")
    animate_visibility(file, parent, [0, 0, 1, 1, 1], "visible")
    loaded = meshreel.load(file.save(tmp_path / "a.glb"))
    assert loaded.starts == (0, 2, 5)
    assert loaded.segments[1].n_verts == 4


def test_frames_without_a_mesh_at_the_ends_are_left_out(tmp_path, notes):
    shown = {"tri": [0, 1, 0, 0, 0], "quad": [0, 0, 1, 1, 0]}
    path = switching_file("visible", shown).save(tmp_path / "a.glb")
    loaded = meshreel.load(path, notes=notes)
    assert (loaded.starts, loaded.start_s) == ((0, 1, 3), 0.25)
    assert "left out: 2 frames without a mesh" in notes


def test_animation_of_meshes_continues_while_they_are_shown(tmp_path):
    file = switching_file("visible", {"tri": [1, 1, 0, 0, 0], "quad": [0, 0, 1, 1, 1]})
    for node in (0, 1):
        file.animate(node, "translation", [0, 1], [[0, 0, 0], [4, 0, 0]])
    loaded = meshreel.load(file.save(tmp_path / "a.glb"), fps=4)
    moved = [frame.vertices[0, 0] for frame in loaded]
    np.testing.assert_allclose(moved, [0, 1, 2, 3, 4], atol=1e-6)


def test_transforms_are_read_from_pointers(tmp_path):
    file = Gltf.of_mesh(CORNERS, FACES["quad"], name="quad")
    file.animate(0, "translation", [0, 1], [[0, 0, 0], [4, 0, 0]])
    file.json["animations"][0]["channels"][0]["target"] = pointer_target(0, "translation")
    loaded = meshreel.load(file.save(tmp_path / "a.glb"), fps=4)
    np.testing.assert_allclose(loaded.vertices[:, 0, 0], [0, 1, 2, 3, 4], atol=1e-6)


@pytest.mark.parametrize("last", [1, 0])
def test_meshes_shown_with_several_others_are_segments_if_merged(tmp_path, last):
    shown = {"tri": [1, 1, 1, last, last], "quad": [0, 0, 1, 1, 1]}
    path = switching_file("visible", shown).save(tmp_path / "a.glb")
    with pytest.raises(InvalidInputError, match="2 meshes"):
        meshreel.load(path)
    loaded = meshreel.load(path, merge=True)
    assert [segment.n_verts for segment in loaded.segments] == ([3, 7] if last else [3, 7, 4])


def test_frames_without_a_mesh_keep_all_meshes_with_a_note(tmp_path, notes):
    shown = {"tri": [1, 1, 0, 0, 0], "quad": [0, 0, 0, 1, 1]}
    path = switching_file("visible", shown).save(tmp_path / "a.glb")
    assert meshreel.load(path, merge=True, notes=notes).n_verts == 7
    assert "left out: changes of visibility: /tri, /quad" in notes


def test_a_selected_mesh_is_read_alone(tmp_path, notes):
    shown = {"tri": [1, 1, 0, 0, 0], "quad": [0, 0, 1, 1, 1]}
    path = switching_file("visible", shown).save(tmp_path / "a.glb")
    assert meshreel.load(path, object="quad", notes=notes).n_verts == 4
    assert "left out: changes of visibility: /quad" in notes


def test_hidden_meshes_are_left_out_with_a_note(tmp_path, notes):
    file = Gltf()
    file.json["extensionsUsed"] = [VISIBILITY]
    file.node(mesh=file.mesh(CORNERS, FACES["quad"]), name="quad")
    hidden = {VISIBILITY: {"visible": False}}
    child = file.node(mesh=file.mesh(), name="tri", is_root=False)
    file.node(children=[child], name="group", extensions=hidden)
    assert meshreel.load(file.save(tmp_path / "a.glb"), notes=notes).n_verts == 4
    assert notes == ["left out: hidden meshes: /group/tri"]
    file.json["nodes"][0]["extensions"] = hidden
    assert meshreel.load(file.save(tmp_path / "b.glb"), merge=True, notes=notes).n_verts == 7
    assert "all meshes are hidden" in notes[-1]


def test_visibility_must_step(tmp_path, notes):
    file = switching_file("visible", {"tri": [1, 1, 0, 0, 0], "quad": [0, 0, 1, 1, 1]})
    file.json["animations"][0]["samplers"][0]["interpolation"] = "LINEAR"
    meshreel.load(file.save(tmp_path / "a.glb"), merge=True, notes=notes)
    assert any("STEP, as visibility is not a number" in note for note in notes)


def test_pointers_to_missing_nodes_and_other_properties(tmp_path, notes):
    file = switching_file("visible", {"tri": [1, 1, 0, 0, 0], "quad": [0, 0, 1, 1, 1]})
    file.animate(0, "scale", SWITCH_TIMES, [[1, 1, 1]] * 5)
    other = {"pointer": "/materials/0/pbrMetallicRoughness/baseColorFactor"}
    channel = file.json["animations"][0]["channels"][-1]
    channel["target"] = {"path": "pointer", "extensions": {POINTER: other}}
    assert meshreel.load(file.save(tmp_path / "a.glb"), notes=notes).n_segments == 2
    assert f"left out: animated properties: {other['pointer']}" in notes
    channel["target"] = pointer_target(2)
    meshreel.load(file.save(tmp_path / "b.glb"), merge=True, notes=notes)
    assert any("a pointer to one of 2 nodes" in note for note in notes)


def changing_grids():
    grids = [waving_grid(3, 5, 6), waving_grid(1, 4, 5), waving_grid(2, 5, 6)]
    return meshreel.concatenate(grids)


@pytest.mark.parametrize("keeps_extras", [True, False])
def test_segments_survive_writing_and_reading(tmp_path, keeps_extras):
    sequence = changing_grids()
    options = WriteOptions(max_error=0.01)
    meshreel.save(sequence, tmp_path / "a.gltf", options=options)
    if not keeps_extras:  # like files of other programs
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
