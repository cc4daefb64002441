"""The extension plays reels in Blender; skipped without it."""

import os
from pathlib import Path

import numpy as np
import pytest

import meshreel
from integration.blender_session import why_not
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Part, Surface
from samples.meshes import hard_box

QUADS = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
if why_not():
    pytest.skip(why_not(), allow_module_level=True)


def strip(n_frames=5, fps=24.0, dtype=np.float32, **rest):
    """Six rising vertices in two rows."""
    flat = np.array([[x, y, 0.0] for y in (0, 1) for x in (0, 1, 2)])
    frames = [flat + np.array([0.1 * t, 0, t * t]) for t in range(n_frames)]
    faces = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]
    return meshreel.MeshSequence(np.array(frames, dtype), faces, fps, "strip", **rest)


def write(path, sequence):
    path.write_bytes(meshreel.encode(sequence))
    return meshreel.decode(path.read_bytes()).vertices


@pytest.fixture
def strip_file(tmp_path):
    write(tmp_path / "strip.reel", strip())
    return tmp_path / "strip.reel"


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_shape_is_the_decoded_frame(blender, tmp_path, dtype):
    decoded = write(tmp_path / "strip.reel", strip(dtype=dtype)).astype(np.float32)
    result = blender("play", path=tmp_path / "strip.reel", frames=[3, 0, 4])
    np.testing.assert_array_equal(result["own"], decoded[[3, 0, 4]])
    np.testing.assert_array_equal(result["evaluated"], decoded[[3, 0, 4]])


@pytest.mark.real
def test_the_shape_is_the_decoded_frame_of_samba(blender, tmp_path):
    if "MESHREEL_DATA" not in os.environ:
        pytest.skip("MESHREEL_DATA is not set")
    samba = meshreel.load(Path(os.environ["MESHREEL_DATA"]) / "samba.npz")
    decoded = write(tmp_path / "samba.reel", samba)
    result = blender("play", path=tmp_path / "samba.reel", frames=[0, 87, 174])
    np.testing.assert_array_equal(result["own"], decoded[[0, 87, 174]])
    np.testing.assert_array_equal(result["evaluated"], decoded[[0, 87, 174]])


PLAYED = {
    "one frame": ({"n_frames": 1}, {}, {-5: 0, 0: 0, 30: 0}),
    "held outside": ({}, {"settings": {"start_frame": 10}}, {7: 0, 9: 0, 14: 4, 15: 4, 90: 4}),
    "loop": ({}, {"settings": {"end": "LOOP"}}, {4: 4, 5: 0, 11: 1, -1: 4}),
    "other scene rate": ({}, {"fps": 48}, {0: 0, 2: 1, 4: 2, 8: 4}),
    "no blending": ({}, {"fps": 48, "settings": {"interpolate": False}}, {1: 0, 3: 1, 4: 2}),
    "uneven": (
        {"fps": 0, "times": [1, 1.5, 2, 2.5, 2.75]},
        {"fps": 8},
        {8: 0, 12: 1, 16: 2, 20: 3, 22: 4, 99: 4},
    ),
    "no rate": ({"fps": 0}, {"fps": 60}, {0: 0, 1: 1, 4: 4}),
}
"""Options of the sequence and of the scene, and the shown frame at each scene frame."""


@pytest.mark.parametrize("name", PLAYED)
def test_the_shown_frame_follows_the_scene(blender, tmp_path, name):
    options, scene, shown = PLAYED[name]
    decoded = write(tmp_path / "strip.reel", strip(**options))
    result = blender("play", path=tmp_path / "strip.reel", frames=list(shown), **scene)
    np.testing.assert_array_equal(result["own"], decoded[list(shown.values())])


def test_frames_are_blended_between_two(blender, strip_file):
    decoded = meshreel.decode(strip_file.read_bytes()).vertices
    result = blender("play", path=strip_file, frames=[1, 1.5], fps=48)["own"]
    expected = [(decoded[0] + decoded[1]) / 2, (decoded[0] + 3 * decoded[1]) / 4]
    np.testing.assert_array_equal(result, np.array(expected))


def test_import_can_set_rate_and_range_of_the_scene(blender, tmp_path):
    rate = 30000 / 1001
    write(tmp_path / "strip.reel", strip(fps=rate, start_s=10 / rate))
    result = blender("describe_import", path=tmp_path / "strip.reel", set_rate=True, scale=2.0)
    assert abs(result["rate"] / rate - 1) < 1e-7
    assert result["range"].tolist() == [10, 14]
    assert result["starts"].tolist() == [10.0]
    assert result["scales"].tolist() == [[2.0, 2.0, 2.0]]


@pytest.mark.parametrize(("up", "angle"), [("Y", np.pi / 2), ("Z", 0.0)])
def test_the_up_axis_rotates_the_object(blender, strip_file, up, angle):
    result = blender("describe_import", path=strip_file, up=up)
    np.testing.assert_allclose(result["rotations"], [[angle, 0, 0]], atol=1e-7)


def test_normals_follow_the_frame(blender, tmp_path):
    tilted = np.array(strip(2).vertices)
    tilted[1] = tilted[0] @ np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]], np.float32)
    write(tmp_path / "strip.reel", meshreel.MeshSequence(tilted, strip().faces, 24))
    result = blender("describe_import", path=tmp_path / "strip.reel")
    assert result["frame"] == 1
    np.testing.assert_allclose(result["normals"], [[1, 0, 0]] * 6, atol=1e-2)


def test_the_surface_is_imported_exactly(blender, tmp_path):
    rng = np.random.default_rng(0)
    uv, tint = rng.random((5, 2), np.float32), rng.random((6, 3), np.float32)
    paint = rng.integers(0, 256, (8, 4), np.uint8)
    indices = np.array([0, 1, 2, 3, 4, 2, 1, 0], np.int32)
    surface = Surface(
        [4, 4],
        (
            Attribute("map", Kind.UV, Domain.CORNER, uv, indices),
            Attribute("tint", Kind.COLOR, Domain.VERTEX, tint),
            Attribute("paint", Kind.COLOR, Domain.CORNER, paint),
            Attribute("patch", Kind.COLOR, Domain.FACE, paint[:2]),
        ),
        (FaceGroups("material", ("cloth",), [0, -1]),),
    )
    write(tmp_path / "strip.reel", strip(surface=surface))
    result = blender("import_surface", path=tmp_path / "strip.reel")
    assert result["strip counts"].tolist() == [4, 4]
    np.testing.assert_array_equal(result["strip corners"], QUADS.ravel())
    np.testing.assert_array_equal(result["strip uv map"].astype(np.float32), uv[indices])
    opaque = np.column_stack([tint, np.ones(6)]).astype(np.float32)
    np.testing.assert_array_equal(result["strip FLOAT_COLOR POINT tint"].astype("f4"), opaque)
    bytes_found = np.rint(255 * result["strip BYTE_COLOR CORNER paint"])
    np.testing.assert_array_equal(bytes_found, paint)
    patch = np.rint(255 * result["strip BYTE_COLOR CORNER patch"])
    np.testing.assert_array_equal(patch, np.repeat(paint[:2], 4, axis=0))
    assert result["strip materials"].tolist() == ["cloth", ""]
    assert result["strip material_indices"].tolist() == [0, 1]


@pytest.mark.parametrize("names", [("/root/body", "/root/arm"), ("/body", "/body")])
def test_parts_become_objects(blender, tmp_path, names):
    sheet = strip(2)
    vertices = np.concatenate([sheet.vertices, sheet.vertices + np.float32(5)], axis=1)
    faces = np.concatenate([sheet.faces, sheet.faces + 6])
    surface = Surface(parts=tuple(Part(name, 6, 4) for name in names))
    sequence = meshreel.MeshSequence(vertices, faces, 24, surface=surface)
    decoded = write(tmp_path / "two.reel", sequence)
    result = blender("import_surface", path=tmp_path / "two.reel")
    second = "arm" if names[1] == "/root/arm" else "body 2"
    np.testing.assert_array_equal(result["body positions"], decoded[1, :6])
    np.testing.assert_array_equal(result[f"{second} positions"], decoded[1, 6:])
    np.testing.assert_array_equal(result[f"{second} corners"].reshape(-1, 3), sheet.faces)


def test_a_mesh_with_faces_that_blender_drops_plays(blender, tmp_path):
    bad = strip(2)
    faces = np.concatenate([bad.faces, [[0, 0, 1]], bad.faces[:1]])
    decoded = write(tmp_path / "bad.reel", meshreel.MeshSequence(bad.vertices, faces, 24))
    result = blender("notes_of_import", path=tmp_path / "bad.reel")
    assert result["n_faces"] == 4
    np.testing.assert_array_equal(result["own"], decoded)


@pytest.mark.parametrize("share", [None, 0.0, 0.02, 0.5])
def test_import_reports_a_missing_or_damaged_file(blender, strip_file, share):
    data = strip_file.read_bytes()
    strip_file.unlink()
    if share is not None:
        strip_file.write_bytes(data[: int(share * len(data))])
    result = blender("import_error", path=strip_file)
    words = str(strip_file) if share is not None else f"{strip_file} is missing"
    assert words in str(result["error"])
    assert result["n_objects"] == 0


def test_a_lost_file_keeps_the_shape_and_is_reported(blender, tmp_path, strip_file):
    decoded = meshreel.decode(strip_file.read_bytes()).vertices
    result = blender("lose_and_find", path=strip_file, away=tmp_path / "away.reel")
    np.testing.assert_array_equal(result["lost"], result["before"])
    assert result["is_error"]
    assert "is missing" in str(result["text"])
    np.testing.assert_array_equal(result["found"], decoded[[2]])
    assert str(result["problem_after"]) == ""


def test_a_rewritten_file_shows_its_new_frames(blender, tmp_path, strip_file):
    shifted = meshreel.MeshSequence(strip().vertices + np.float32(7), strip().faces, 24)
    decoded = write(tmp_path / "other.reel", shifted)
    result = blender("change", path=strip_file, other=tmp_path / "other.reel")
    np.testing.assert_array_equal(result["own"], decoded[[2]])
    assert str(result["problem"]) == ""


def test_a_file_with_other_faces_keeps_the_shape(blender, tmp_path, strip_file):
    turned = meshreel.MeshSequence(strip().vertices, strip().faces[:, ::-1], 24)
    write(tmp_path / "other.reel", turned)
    result = blender("change", path=strip_file, other=tmp_path / "other.reel")
    np.testing.assert_array_equal(result["own"], result["before"])
    assert "has other faces" in str(result["problem"])


def test_an_edited_mesh_is_reported(blender, strip_file):
    result = blender("edit_mesh", path=strip_file)
    assert "has 7 vertices and its reel 6" in str(result["problem"])


def test_a_reopened_scene_plays_the_reel(blender, tmp_path, strip_file):
    decoded = meshreel.decode(strip_file.read_bytes()).vertices
    (tmp_path / "here").mkdir()
    os.rename(strip_file, tmp_path / "here" / "strip.reel")
    blend = tmp_path / "here" / "scene.blend"
    stored = blender("save_scene", path=tmp_path / "here" / "strip.reel", blend=blend, frame=3)
    assert str(stored["stored"]) == "//strip.reel"
    os.rename(tmp_path / "here", tmp_path / "there")
    result = blender("open_scene", blend=tmp_path / "there" / "scene.blend", frames=[1, 4])
    np.testing.assert_array_equal(result["opened"], decoded[3])
    np.testing.assert_array_equal(result["own"], decoded[[1, 4]])


def test_a_scene_without_its_reel_opens_and_reports_why(blender, tmp_path, strip_file):
    decoded = meshreel.decode(strip_file.read_bytes()).vertices
    blend = tmp_path / "scene.blend"
    blender("save_scene", path=strip_file, blend=blend, frame=3)
    strip_file.unlink()
    result = blender("open_scene", blend=blend, frames=[1])
    np.testing.assert_array_equal(result["opened"], decoded[3])
    assert "is missing" in str(result["problem"])


def test_rendered_frames_differ(blender, tmp_path):
    left = np.array([[-2, -2, 0], [0, -2, 0], [0, 2, 0], [-2, 2, 0]], np.float32)
    sequence = meshreel.MeshSequence(
        [left, left + np.float32([2, 0, 0])], [[0, 1, 2], [0, 2, 3]], 24
    )
    write(tmp_path / "wipe.reel", sequence)
    (tmp_path / "out").mkdir()
    alphas = blender("render", path=tmp_path / "wipe.reel", folder=tmp_path / "out")["alphas"]
    assert alphas.shape == (2, 16, 16)
    covered = alphas.mean(axis=1) > 0.5
    assert covered[0].tolist() == [True] * 8 + [False] * 8
    assert covered[1].tolist() == [False] * 8 + [True] * 8


def test_hard_edges_are_sharp_and_part_normals_in_every_frame(blender, tmp_path):
    box = hard_box(3)
    write(tmp_path / "box.reel", box)
    result = blender("import_hard_edges", path=tmp_path / "box.reel", frames=[0, 2])
    np.testing.assert_array_equal(
        np.unique(result["edges"], axis=0), np.unique(box.surface.hard_edges, axis=0)
    )
    for normals in result["normals"]:
        expected = meshreel.corner_normals(box.vertices[0], box.faces, box.surface)
        np.testing.assert_allclose(normals, expected, atol=1e-3)


def with_material(sequence, label):
    groups = FaceGroups("material", (label,), np.zeros(sequence.n_faces, np.int32))
    return meshreel.MeshSequence(
        sequence.vertices, sequence.faces, sequence.fps, surface=Surface(groups=(groups,))
    )


def write_segments(path, *segments):
    data = meshreel.encode(meshreel.concatenate(segments))
    path.write_bytes(data)
    return meshreel.decode(data)


def test_the_mesh_is_that_of_the_segment_when_faces_change(blender, tmp_path):
    box = meshreel.MeshSequence(hard_box(2).vertices, hard_box(2).faces, 24)
    decoded = write_segments(tmp_path / "two.reel", strip(3), box)
    frames = [0, 2, 3, 4, 1, 2.5, 90]
    result = blender("play_segments", path=tmp_path / "two.reel", frames=frames)
    for frame in frames:
        vertices, faces = decoded[min(int(frame), 4)]  # not blended across segments
        np.testing.assert_array_equal(result[f"{frame} strip positions"], vertices)
        np.testing.assert_array_equal(result[f"{frame} strip corners"], faces.ravel())
        assert str(result[f"{frame} strip problem"]) == ""
    assert str(result["text"]).startswith("5 frames in 2 segments, 24 fps, ")


def test_material_slots_are_kept_when_faces_change(blender, tmp_path):
    first, second = with_material(strip(2), "cloth"), with_material(strip(1), "skin")
    write_segments(tmp_path / "a.reel", first, second, first)
    options = {"frames": [0, 2, 3], "material": "mine"}
    result = blender("play_segments", path=tmp_path / "a.reel", **options)
    name = next(key.split()[1] for key in result if key.endswith("materials"))
    shown = [set(result[f"{frame} {name} materials"].tolist()) for frame in (0, 2, 3)]
    assert shown == [{"mine"}, {"skin"}, {"mine"}]


def test_a_part_is_empty_in_segments_without_it(blender, tmp_path):
    named = [
        meshreel.MeshSequence(
            strip(1).vertices, strip().faces, 24, surface=Surface(parts=(Part(name, 6, 4),))
        )
        for name in ("/body", "/arm")
    ]
    write_segments(tmp_path / "a.reel", *named)
    result = blender("play_segments", path=tmp_path / "a.reel", frames=[0, 1, 0])
    counts = {
        (frame, name): len(result[f"{frame} {name} positions"])
        for frame in (0, 1)
        for name in ("body", "arm")
    }
    assert counts == {(0, "body"): 6, (0, "arm"): 0, (1, "body"): 0, (1, "arm"): 6}
