"""The Khronos validator and three.js accept and play written glTF files."""

import json
import os
import shutil
import subprocess
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.formats.gltf.mesh_writer import split_at_seams
from meshreel.formats.gltf.write import write_gltf
from meshreel.formats.load import load
from meshreel.formats.options import WriteOptions
from meshreel.formats.scenes.parts import split_parts
from meshreel.model.flag import simulate_flag
from meshreel.model.notes import Notes
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Part, Surface
from samples.browser import FOLDER, driven_browser, play, shown_title
from samples.glb import largest_error_percent, stream_of
from samples.materials import look, png
from samples.meshes import quad_sheet
from samples.rigs import bending_tube, boxes, turn
from samples.vat_player import PLAYERS

MODULES = FOLDER / "node_modules"

needs_node = pytest.mark.skipif(not shutil.which("npm"), reason="needs Node.js (npm)")
INSTALL = ("npm", "ci", "--no-audit", "--no-fund", "--fetch-retries=1")


@pytest.fixture(scope="module", autouse=True)
def node_modules():
    """Install the validator and three.js, once per checkout."""
    if MODULES.is_dir() or not shutil.which("npm"):
        return
    done = subprocess.run(INSTALL, cwd=FOLDER, capture_output=True, text=True, timeout=300)
    if done.returncode:
        shutil.rmtree(MODULES, ignore_errors=True)
        pytest.skip(f"`npm ci` failed in {FOLDER}: {done.stderr.strip()[:200]}")


@pytest.fixture(scope="module")
def page():
    """A page of one browser for all files."""
    with driven_browser() as browser:
        yield browser.new_page()


def flag(n_frames=40):
    return simulate_flag(n_frames, n_rows=20, n_columns=24)


def dressed(n_frames=20):
    """Two flags side by side: parts with materials, texture coordinates and colors."""
    one = flag(n_frames)
    n_faces, rng = one.n_faces, np.random.default_rng(6)
    steps = one.vertices[0, :, :2]
    uv = np.concatenate([steps, steps + 1])[np.concatenate([one.faces, one.faces + 480]).ravel()]
    colors = rng.integers(0, 256, (2 * n_faces, 3)).astype(np.uint8) // 64 * 64
    materials = np.arange(2 * n_faces, dtype=np.int32) // 100 % 3 - 1
    surface = Surface(
        None,
        (
            Attribute("uv", Kind.UV, Domain.CORNER, uv),
            Attribute("color", Kind.COLOR, Domain.FACE, colors),
            Attribute("heat", Kind.OTHER, Domain.VERTEX, rng.random((960, 1)).astype(np.float32)),
        ),
        (FaceGroups("material", ("silk", "linen"), materials),),
        (Part("/pole/front", 480, n_faces), Part("/pole", 480, n_faces)),
    )
    vertices = np.concatenate([one.vertices, one.vertices[::-1] + np.float32([0, 0, 1])], axis=1)
    faces = np.concatenate([one.faces, one.faces + 480])
    return MeshSequence(vertices, faces, 24.0, "two", start_s=0.5, surface=surface)


def still():
    return dressed(1).replace(name="still")


def textured():
    """Two flags whose materials use every feature."""
    materials, _ = look()
    named = [
        material.with_textures({slot: replace(t, uv="uv") for slot, t in material.textures.items()})
        for material in materials
    ]
    silk, linen = (
        replace(one, name=name) for one, name in zip(named, ("silk", "linen"), strict=True)
    )
    silk = replace(silk, emissive=(3.0, 1.0, 0.5))
    sequence = dressed()
    surface = replace(sequence.surface, materials=(silk, linen), images=(png(), png(64, "dark")))
    return sequence.replace(surface=surface)


CASES = {
    "flag": (flag, {}),
    "coarse": (flag, {"max_error": 2.0}),
    "meshopt": (flag, {"meshopt": True}),
    "normals": (flag, {"normals": True}),
    "no normals": (flag, {"normals": False}),
    "dressed": (dressed, {}),
    "dressed with normals": (dressed, {"normals": True}),
    "textured": (textured, {}),
    "still": (still, {}),
    "still with normals": (still, {"normals": True}),
}


def reports_of(*paths):
    """Return the report of the validator for each file."""
    command = ["node", FOLDER / "validate.cjs", *paths]
    return json.loads(subprocess.run(command, check=True, capture_output=True).stdout)


def split_sources(sequence, *, is_compressed):
    """Return the original vertex of each vertex in the order of three.js."""
    results = []
    parts = split_parts(sequence.faces, sequence.surface, sequence.n_verts, sequence.name)
    for part in sorted(parts, key=lambda item: item.name):  # nodes above come first
        split = split_at_seams(part)
        split = split.along_edges() if is_compressed else split
        results.append(split.sources + part.verts.start)
    return np.concatenate(results)


@needs_node
def test_the_validator_accepts_written_files(tmp_path):
    paths = []
    for case, (make, options) in CASES.items():
        for extension in ("glb", "gltf"):
            paths.append(tmp_path / f"{case}.{extension}")
            write_gltf(paths[-1], stream_of(make()), WriteOptions(**options))
    paths.append(tmp_path / "segments.glb")
    meshreel.save(
        meshreel.concatenate([dressed(4), flag(3).replace(fps=24.0), dressed(1)]), paths[-1]
    )
    for path, report in zip(paths, reports_of(*paths), strict=True):
        messages = [one for one in report["issues"]["messages"] if not is_harmless(one)]
        assert (messages, report["issues"]["truncated"]) == ([], False), path.name


@needs_node
def test_validator_has_nothing_to_say_of_meshes_of_vertex_animation_textures(tmp_path):
    paths = []
    for layout in PLAYERS:
        folder = tmp_path / f"{layout}.vat"
        meshreel.save(quad_sheet(), folder, options=WriteOptions(layout=layout))
        paths += folder.glob("*.glb")
    for report in reports_of(*paths):
        messages = [one for one in report["issues"]["messages"] if not is_harmless(one)]
        assert (messages, report["issues"]["truncated"]) == ([], False)


def is_harmless(message):
    """Texture coordinates are kept without a texture, because a program may add one.

    Where a material has a normal texture, viewers make tangents. The validator does not know
    compression, so that compressed data seem unused to it.
    """
    if message["code"] == "MESH_PRIMITIVE_GENERATED_TANGENT_SPACE":
        return True
    if message["code"] == "UNSUPPORTED_EXTENSION":
        return "_meshopt_compression'" in message["message"]
    is_known = "TEXCOORD_" in message["pointer"] or message["pointer"] == "/buffers/0"
    return message["code"] == "UNUSED_OBJECT" and is_known


@needs_node
@pytest.mark.parametrize("case", CASES)
def test_the_browser_plays_the_frames(page, tmp_path, case):
    make, options = CASES[case]
    sequence, notes = make(), Notes()
    writing = WriteOptions(**options)
    write_gltf(tmp_path / "a.glb", stream_of(sequence, notes), writing)
    frames = sorted({0, sequence.n_frames // 3, sequence.n_frames - 1})
    times = [sequence.start_s + frame / sequence.fps for frame in frames]
    positions, picture = play(page, tmp_path / "a.glb", times)
    sources = split_sources(sequence, is_compressed=writing.meshopt)
    shown = sequence.replace(vertices=sequence.vertices[frames][:, sources], surface=Surface())
    error = largest_error_percent(shown, positions)
    # Chosen frames may have a smaller diagonal than all of them.
    whole, part = (np.linalg.norm(one.extent.high - one.extent.low) for one in (sequence, shown))
    assert error * part / whole <= achieved_percent(notes) + 2e-5
    assert picture.startswith(b"\x89PNG")


RIGS = {
    "bones": (bending_tube, {"rig": 8}),
    "correctives": (partial(bending_tube, bulge=0.3), {"rig": 2, "kg": 2, "max_error": 2}),
    "meshopt": (bending_tube, {"rig": 8, "meshopt": True}),
    "rigid": (lambda: boxes([turn, lambda frame: turn(-frame, 1)]), {"rig": True}),
}


@needs_node
@pytest.mark.parametrize("case", RIGS)
def test_the_browser_moves_rigs_as_they_are_read(page, tmp_path, case):
    make, options = RIGS[case]
    meshreel.save(make(), tmp_path / "a.glb", **options)
    (report,) = reports_of(tmp_path / "a.glb")
    assert [one for one in report["issues"]["messages"] if not is_harmless(one)] == []
    sequence = load(tmp_path / "a.glb")
    frames = [0, 3, sequence.n_frames - 1]
    positions, _ = play(page, tmp_path / "a.glb", [frame / sequence.fps for frame in frames])
    distances = np.linalg.norm(positions - sequence.vertices[frames], axis=2)
    assert distances.max() <= 1e-4 * np.linalg.norm(sequence.extent.high - sequence.extent.low)


def achieved_percent(notes):
    """Return the error stated in the notes; 0 if nothing moves."""
    results = [note.split() for note in notes if note.startswith("the largest error is")]
    return float(results[0][4]) + 5e-5 if results else 0.0


@needs_node
@pytest.mark.parametrize(("options", "title"), [({}, "plays 1"), ({"rig": 8}, "plays 1")])
def test_model_viewer_shows_files_without_a_setting(page, tmp_path, options, title):
    meshreel.save(bending_tube(), tmp_path / "a.glb", **options)
    assert shown_title(page, tmp_path / "a.glb") == title


@needs_node
def test_model_viewer_needs_a_decoder_for_meshopt(page, tmp_path):
    """If this changes, meshopt can become the default."""
    meshreel.save(bending_tube(), tmp_path / "a.glb", meshopt=True)
    assert shown_title(page, tmp_path / "a.glb").startswith("error")


@pytest.mark.real
@needs_node
def test_samba_is_valid_and_plays_within_a_tenth_of_a_percent(page, tmp_path):
    folder = os.environ.get("MESHREEL_DATA")
    if not folder:
        pytest.skip("MESHREEL_DATA names no folder of real sequences")
    samba = load(Path(folder) / "samba.npz").replace(fps=25.0)
    write_gltf(tmp_path / "samba.glb", stream_of(samba), WriteOptions())
    (report,) = reports_of(tmp_path / "samba.glb")
    assert all(map(is_harmless, report["issues"]["messages"]))
    frames = [0, 50, 103, 174]
    positions, _ = play(page, tmp_path / "samba.glb", [frame / 25 for frame in frames])
    expected = samba.vertices[frames][:, split_sources(samba, is_compressed=False)]
    distances = np.linalg.norm(positions - expected, axis=2)
    assert distances.max() <= 0.001 * np.linalg.norm(samba.extent.high - samba.extent.low)
