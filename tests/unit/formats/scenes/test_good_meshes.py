"""The option skip_bad, which skips meshes that cannot be read."""

import json
from dataclasses import replace

import numpy as np
import pytest

import meshreel
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.load import load
from meshreel.formats.options import Reading
from meshreel.formats.scenes.scene_mesh import SceneMesh, read_or_defer_error
from meshreel.formats.scenes.scene_source import readable_meshes
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from samples.meshes import two_sheets, waving_grid

TRIANGLE = """point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
int[] faceVertexCounts = [3]
int[] faceVertexIndices = [0, 1, %d]"""
CHANGING = """point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]
int[] faceVertexCounts.timeSamples = { 0: [3], 1: [4] }
int[] faceVertexIndices.timeSamples = { 0: [0, 1, 2], 1: [0, 1, 2, 3] }"""

FAR = """
double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 1e30: (1, 0, 0) }
uniform token[] xformOpOrder = ["xformOp:translate"]"""


def triangle(corner=2, x=0.0):
    vertices = np.array([[x, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    return PolygonMesh(vertices, np.array([3]), np.array([0, 1, corner], np.int32))


def fail_to_read(frame):
    raise FormatError("its points are damaged")


def surface_of_five_vertices(frame):
    values = np.zeros((5, 1), np.float32)
    return Surface(None, (Attribute("a", Kind.OTHER, Domain.VERTEX, values),))


GOOD = SceneMesh("/good", np.arange(2.0), lambda frame: triangle())
BAD = {
    "its points are damaged": SceneMesh("/bad", np.arange(2.0), fail_to_read),
    "every position must be finite": SceneMesh(
        "/bad", np.arange(2.0), lambda frame: triangle(2, [0, np.nan][frame])
    ),
    "needs 3": SceneMesh("/bad", np.zeros(1), lambda frame: triangle(), surface_of_five_vertices),
}


@pytest.mark.parametrize("reason", BAD)
def test_unreadable_mesh_is_left_out_with_a_note(reason):
    options = Reading()
    result = readable_meshes([BAD[reason], GOOD], options)
    assert [mesh.name for mesh in result] == ["/good"]
    assert options.notes[0].startswith("left out: meshes that cannot be read: /bad (")


def test_meshes_with_changing_faces_are_kept():
    changing = SceneMesh("/late", np.arange(2.0), lambda frame: triangle(2 - frame))
    result = readable_meshes([changing, GOOD], Reading())
    assert [mesh.name for mesh in result] == ["/late", "/good"]


def test_file_without_readable_meshes_is_an_error():
    with pytest.raises(FormatError, match=r"has no readable mesh: /bad \(its points are"):
        readable_meshes([BAD["its points are damaged"]], Reading())


def test_surface_of_a_readable_mesh_is_read_once():
    read_frames = []
    mesh = replace(GOOD, surface=lambda frame: read_frames.append(frame) or Surface())
    result = readable_meshes([mesh], Reading())
    result[0].surface(0)
    assert read_frames == [0]


def test_deferred_error_is_raised_when_a_frame_is_read():
    with pytest.raises(FormatError, match="its points are damaged"):
        read_or_defer_error("/bad", lambda: fail_to_read(0)).frame(0)


@pytest.fixture
def usd_file(tmp_path):
    pytest.importorskip("pxr")
    path = tmp_path / "a.usda"
    meshes = {
        "good": TRIANGLE % 2,
        "bad": TRIANGLE % 7,
        "late": CHANGING,
        "far": TRIANGLE % 2 + FAR,
    }
    path.write_text(
        "#usda 1.0\n" + "".join(f'def Mesh "{k}" {{\n{v}\n}}\n' for k, v in meshes.items())
    )
    return path


def test_skip_bad_merges_the_readable_meshes(usd_file, notes):
    opened = load(usd_file, merge=True, skip_bad=True, notes=notes)
    parts = [[part.name for part in segment.surface.parts] for segment in opened.segments]
    assert parts == 2 * [["/good", "/late"]]
    note = next(note for note in notes if "cannot be read" in note)
    for name in ("/bad (mesh /bad, face 0: uses vertex 7", "/far (has"):
        assert name in note


def test_selected_mesh_is_read_despite_unreadable_ones(usd_file):
    assert load(usd_file, object="good").n_verts == 3
    with pytest.raises(FormatError, match=r"a.usda: mesh /bad, face 0: uses vertex 7"):
        load(usd_file, object="bad")
    with pytest.raises(FormatError, match=r"a.usda: has samples from time code 0 to 1e\+30"):
        load(usd_file, object="far")


def test_skip_bad_keeps_changing_faces_for_segments(usd_file):
    assert load(usd_file, merge=True, skip_bad=True).starts == (0, 1, 2)


def test_skip_bad_skips_the_damaged_mesh_of_a_gltf(tmp_path, notes):
    meshreel.save(two_sheets(), tmp_path / "a.gltf")
    text = json.loads((tmp_path / "a.gltf").read_text())
    text["meshes"][0]["primitives"][0]["indices"] = 0  # the accessor of its positions
    (tmp_path / "a.gltf").write_text(json.dumps(text))
    names = [part.name for part in two_sheets().surface.parts]
    with pytest.raises(FormatError):
        load(tmp_path / "a.gltf", merge=True)
    loaded = load(tmp_path / "a.gltf", skip_bad=True, notes=notes)
    assert loaded.name == names[1].rpartition("/")[2]
    assert any(names[0] in note for note in notes if "cannot be read" in note)


@pytest.mark.parametrize("name", ["a.npz", "a.obj", "a.reel"])
@pytest.mark.parametrize("option", ["skip_bad", "allow_outside"])
def test_options_of_scenes_are_rejected_for_single_mesh_formats(tmp_path, name, option):
    meshreel.save(waving_grid(1), tmp_path / name)
    with pytest.raises(InvalidInputError, match=f"^{option} has no effect on a"):
        load(tmp_path / name, **{option: True})


def test_skip_bad_is_rejected_with_object(usd_file):
    with pytest.raises(InvalidInputError, match=r"object selects one mesh, so skip"):
        load(usd_file, object="good", skip_bad=True)
