"""Manifests of Universal Volumetric captures."""

import json

import numpy as np
import pytest

import meshreel
from meshreel.errors import FormatError
from samples.commands import run_json
from samples.meshes import quad_sheet, waving_grid


def save_frames(folder, first=0, extension=".obj"):
    """Write two frames of a grid and one of a sheet, with numbers of five digits."""
    for number, sequence in ((first, waving_grid(2, 4, 5)), (first + 2, quad_sheet(1))):
        meshreel.save(sequence, folder / f"%05d{extension}", start_number=number)


def write_manifest(path, **contents):
    path.write_text(json.dumps(contents))
    return path


def v2(path="out/geometry_[target]/[#####][ext]", **targets):
    targets = targets or {"low": {"frameRate": 25, "frameCount": 3, "format": "obj"}}
    return {"version": "v2", "geometry": {"targets": targets, "path": path}}


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize(
    "counts",
    [
        {"TotalFrames": 3, "FrameRate": 25},
        {"GeometryFrameCount": 3, "GeometryFrameRate": 25, "TextureFrameRate": 12},
    ],
)
def test_frames_of_a_pattern_are_read_with_their_rate(tmp_path, first, counts, notes):
    save_frames(tmp_path / "geo", first)
    path = write_manifest(tmp_path / "liam.manifest", DRCURLPattern="geo/#####.obj", **counts)
    loaded = meshreel.load(path, notes=notes)
    assert (loaded.starts, loaded.fps, loaded.name) == ((0, 2, 3), 25, "liam")
    expected = meshreel.load(tmp_path / "geo")
    for one, other in zip(loaded, expected, strict=True):
        np.testing.assert_array_equal(one.vertices, other.vertices)
    assert not any("left out: textures" in note for note in notes)
    assert meshreel.load(path, fps=50).fps == 50


def test_frames_of_version_2_are_read_without_textures_and_sound(tmp_path, notes):
    save_frames(tmp_path / "out" / "geometry_low")
    contents = {**v2(), "audio": {"path": "a[ext]"}, "texture": {"path": "t", "targets": {}}}
    path = write_manifest(tmp_path / "liam.uvol.json", **contents)
    loaded = meshreel.load(path, notes=notes)
    assert (loaded.starts, loaded.fps, loaded.name) == ((0, 2, 3), 25, "liam")
    assert notes.count("left out: textures, sound of the manifest") == 1


def test_draco_frames_are_read(tmp_path):
    draco = pytest.importorskip("DracoPy")
    sheet = waving_grid(2, 4, 5)
    for number, frame in enumerate(sheet.vertices):
        data = draco.encode(frame, sheet.faces.astype(np.uint32), quantization_bits=16)
        (tmp_path / f"{number:05d}.drc").write_bytes(data)
    target = {"frameRate": 30, "frameCount": 2, "format": "draco"}
    path = write_manifest(tmp_path / "a.json", **v2("[#####][ext]", draco=target))
    loaded = meshreel.load(path)
    assert (loaded.n_frames, loaded.n_verts, loaded.fps) == (2, sheet.n_verts, 30)


def test_encode_and_info_take_a_manifest(tmp_path):
    save_frames(tmp_path / "out" / "geometry_low")
    path = write_manifest(tmp_path / "liam.json", **v2())
    figures = run_json("encode", path, "-o", tmp_path / "a.reel")
    assert figures["n_segments"] == 2
    assert meshreel.decode(tmp_path / "a.reel").fps == 25
    [mesh] = run_json("info", path)["meshes"]
    assert (mesh["n_segments"], mesh["fps"]) == (2, 25)
    split = run_json("convert", path, "-o", tmp_path / "b.npz", "--split")
    assert [one["n_frames"] for one in split["outputs"]] == [2, 1]
    assert split["outputs"][0]["fps"] == 25


PATTERN = {"DRCURLPattern": "geo/#####.obj", "TotalFrames": 3, "FrameRate": 25}


@pytest.mark.parametrize(
    ("contents", "message"),
    [
        ({}, "is no UVOL manifest: it has neither DRCURLPattern nor geometry"),
        ({"frameData": []}, "is a manifest of UVOL 1, .* Corto"),
        ({**PATTERN, "TotalFrames": 5}, r"2 of its 5 frames do not exist: 00003.obj, 00004.obj"),
        ({**PATTERN, "TotalFrames": 0}, "number of its frames must be 1 to 1000000; it is 0"),
        ({**PATTERN, "TotalFrames": 10**9}, "number of its frames must be"),
        ({**PATTERN, "FrameRate": "fast"}, "frame rate must be a number"),
        ({**PATTERN, "DRCURLPattern": 3}, "DRCURLPattern must be text"),
        ({**PATTERN, "DRCURLPattern": "geo/a.obj"}, "needs one number"),
        ({**PATTERN, "DRCURLPattern": "no/##.obj"}, "first frame, 00.obj or 01.obj, does not"),
        ({**PATTERN, "DRCURLPattern": "../x/##.obj"}, "outside of its folder, '../x/00.obj'"),
        ({**PATTERN, "DRCURLPattern": "https://a.b/##.obj"}, "by the address 'https://a.b/##.obj'"),
        (v2(a={"format": "mp4"}), "format of its geometry must be one of draco, obj"),
        (v2(a={"format": "obj"}, b={}), r"several targets, a, b; .*out/geometry_a/\*, out/geom"),
        ({"geometry": {"path": "x"}}, "its geometry has no targets"),
    ],
)
def test_other_manifests_are_refused_with_the_reason(tmp_path, contents, message):
    save_frames(tmp_path / "geo")
    path = write_manifest(tmp_path / "a.manifest", **contents)
    with pytest.raises(FormatError, match=rf"a\.manifest: .*{message}"):
        meshreel.load(path)


def test_json_of_other_contents_is_refused(tmp_path):
    for text, message in (("{", "is not JSON"), ("[1]", "not a JSON object")):
        (tmp_path / "a.json").write_text(text)
        with pytest.raises(FormatError, match=message):
            meshreel.load(tmp_path / "a.json")
