"""Inspection of files without loading a sequence."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.formats.inspection import inspect_source
from meshreel.formats.kinds import AnimationInfo
from meshreel.formats.options import Reading
from meshreel.model.notes import Note, NoteKind
from meshreel.operations.save import save
from samples.gltf import moving_triangle
from samples.meshes import quad_sheet, two_sheets, waving_grid
from samples.tracks import tracked_sheet


def only_mesh(source, **options):
    result = inspect_source(source, Reading(**options))
    assert len(result.meshes) == 1
    return result.meshes[0]


@pytest.mark.parametrize("extension", [".npz", ".glb", ".usda", ".abc", ".h5", ".vtkhdf", ".reel"])
def test_inspection_agrees_with_the_loaded_sequence(tmp_path, extension):
    sequence = waving_grid()
    save(sequence, tmp_path / f"a{extension}")
    result = only_mesh(tmp_path / f"a{extension}")
    assert (result.n_frames, result.n_verts, result.n_faces) == (12, 99, 160)
    assert result.fps == pytest.approx(sequence.fps)
    assert result.duration_s == pytest.approx(12 / sequence.fps)
    off = 0.02 if extension in (".glb", ".reel") else 1e-6
    np.testing.assert_allclose(result.low, sequence.extent.low, atol=off)
    np.testing.assert_allclose(result.high, sequence.extent.high, atol=off)


def test_the_duration_of_uneven_times_is_that_between_the_ends(tmp_path):
    uneven = waving_grid().replace(times=[*range(11), 20])
    save(uneven, tmp_path / "a.npz")
    assert only_mesh(tmp_path / "a.npz").duration_s == 20
    assert info(encode(uneven)).as_dict()["duration_s"] == 20


def test_inspection_counts_frame_files(tmp_path):
    save(waving_grid(5), tmp_path / "f_%d.obj")
    result = inspect_source(tmp_path, Reading(fps=10))
    size = sum(path.stat().st_size for path in tmp_path.iterdir())
    assert (result.n_files, result.size_bytes, result.format) == (5, size, "Wavefront OBJ")
    assert (result.meshes[0].n_frames, result.meshes[0].duration_s) == (5, 0.5)


@pytest.mark.parametrize("extension", [".npz", ".h5", ".vtkhdf"])
def test_inspection_lists_tracks(tmp_path, extension):
    pytest.importorskip("h5py")
    save(tracked_sheet(3, ("vertex",)), tmp_path / f"a{extension}")
    assert set(only_mesh(tmp_path / f"a{extension}").tracks) == {
        "heat of vertex/s: scalar of each vertex, float32 in K",
        "flow_vertex: velocity of each vertex, 3 x float64",
        "shade_vertex: color of each vertex, 4 x uint8",
        "step_vertex: scalar of each vertex, int64",
        "tensor_vertex: other of each vertex, 9 x float32",
    }


def test_inspection_lists_each_mesh(tmp_path):
    save(two_sheets(), tmp_path / "two.usda")
    result = inspect_source(tmp_path / "two.usda", Reading()).meshes
    assert [mesh.name for mesh in result] == ["/root/a", "/root/b"]
    sheets = [quad_sheet(), quad_sheet(shift=2)]
    for mesh, sheet in zip(result, sheets, strict=True):
        np.testing.assert_allclose(mesh.high, sheet.extent.high, rtol=1e-6)
        assert (mesh.n_verts, mesh.n_polygons, mesh.n_faces) == (30, 21, len(sheet.faces))
        assert mesh.attributes[0].startswith("uv 'st' of ")


@pytest.mark.parametrize(
    ("options", "name"), [({"object": "b"}, "/root/b"), ({"merge": True}, "two")]
)
def test_inspection_follows_object_and_merge(tmp_path, options, name):
    save(two_sheets(), tmp_path / "two.usda")
    assert only_mesh(tmp_path / "two.usda", **options).name == name


def test_inspection_counts_the_segments_of_changing_faces(tmp_path):
    for number, rows in enumerate((5, 5, 6)):
        save(waving_grid(1, rows, 6), tmp_path / f"s_{number}.obj")
    (mesh,) = inspect_source(tmp_path, Reading()).meshes
    assert (mesh.n_frames, mesh.n_segments, mesh.n_verts) == (3, 2, 36)


def test_inspection_reports_the_problem_of_an_unreadable_mesh(tmp_path):
    save(two_sheets(), tmp_path / "two.usda")
    text = (tmp_path / "two.usda").read_text()
    head, mesh, rest = text.partition('def Mesh "b"')
    points = rest.index("(", rest.index("points.timeSamples"))
    (tmp_path / "bad.usda").write_text(head + mesh + rest[:points] + "(nan, 0" + rest[rest.index(
        ",", rest.index(",", points) + 1):])  # fmt: skip
    good, bad = inspect_source(tmp_path / "bad.usda", Reading()).meshes
    assert good.problem is None
    assert "must be finite" in bad.problem


def test_inspection_lists_what_is_left_out(tmp_path):
    save(waving_grid(), tmp_path / "a.npz")
    result = inspect_source(tmp_path / "a.npz", Reading())
    notes = (
        Note(NoteKind.LEFT_OUT, "lights", ["sun"]),
        Note(NoteKind.CHANGED, "left out: other words"),
        Note(NoteKind.CHANGED, "welded 3 points"),
    )
    noted = replace(result, notes=notes)
    assert noted.left_out == ("lights: sun",)
    assert noted.as_dict()["left_out"] == ["lights: sun"]


def test_inspection_lists_gltf_animations(tmp_path):
    file = moving_triangle()
    camera = file.node(name="camera")
    file.animate(0, "scale", [0.5, 1.75], np.ones((2, 3)), animation=1)
    file.animate(camera, "translation", [0, 1], np.eye(2, 3), animation=2)
    file.animate(0, "scale", [1, 0], np.ones((2, 3)), animation=3)
    for one, name in zip(file.json["animations"], ["walk", "run", "pan", "bad"], strict=True):
        one["name"] = name
    result = inspect_source(file.save(tmp_path / "a.glb"), Reading())
    problem = "animation 3, sampler 0: key times must be ascending"
    assert result.animations == (
        AnimationInfo("walk", 0.0, 1.0, moves_mesh=True),
        AnimationInfo("run", 0.5, 1.25, moves_mesh=True),
        AnimationInfo("pan", 0.0, 1.0, moves_mesh=False),
        AnimationInfo("bad", problem=problem),
    )
    assert result.as_dict()["animations"][1] == {
        "name": "run", "start_s": 0.5, "duration_s": 1.25, "moves_mesh": True, "problem": None,
    }  # fmt: skip
