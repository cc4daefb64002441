"""Blender reads our Alembic files exactly, and meshreel reads Blender's."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from meshreel.formats.load import load
from meshreel.kernel.polygons import triangulate
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.operations.save import save

PYTHON = os.environ.get("MESHREEL_BPY_PYTHON", sys.executable)
"""Python interpreter with bpy: this one, or that of the tested Blender."""

SIZES = np.array([4, 3, 5], np.int32)
CORNERS = np.array([0, 1, 2, 3, 4, 5, 6, 7, 0, 2, 4, 6], np.int32)
FLOAT32_STEPS = 2e-6
"""Tolerance of positions up to 5 after Blender's transforms in float32."""


@pytest.fixture(scope="module")
def has_blender():
    if subprocess.run([PYTHON, "-c", "import bpy"], capture_output=True, check=False).returncode:
        pytest.skip(f"no Blender in {PYTHON}; pip install 'meshreel[verify]'")


@pytest.fixture(scope="module")
def sent(has_blender, tmp_path_factory):
    """A sequence exported by Blender, as read by meshreel, and Blender's data."""
    path = tmp_path_factory.mktemp("sent") / "monkey.abc"
    known = in_blender("send", path)
    return load(path), known


@pytest.fixture(scope="module")
def brought(has_blender, tmp_path_factory):
    """A sequence written by meshreel, and Blender's import."""
    path = tmp_path_factory.mktemp("brought") / "model.abc"
    rng = np.random.default_rng(0)
    texture = rng.random((7, 2)).astype(np.float32)
    rows = np.arange(12, dtype=np.int32) % 7
    surface = Surface(
        SIZES,
        (Attribute("map", Kind.UV, Domain.CORNER, texture, rows),),
        (FaceGroups("material", ("red", "blue"), np.array([1, 0, 1], np.int32)),),
    )
    vertices = rng.standard_normal((6, 8, 3)).astype(np.float32)
    faces, _ = triangulate(SIZES, CORNERS, vertices[0])
    sequence = MeshSequence(vertices, faces, 30, "model", 5 / 30, surface)
    save(sequence, path)
    return sequence, in_blender("bring", path)


def in_blender(action, path):
    script = Path(__file__).with_name("alembic_in_blender.py")
    result = path.with_suffix(".npz")
    command = [PYTHON, str(script), action, str(path), str(result)]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert ran.returncode == 0, ran.stderr
    with np.load(result) as opened:
        return {name: opened[name] for name in opened.files}


def upright(positions):
    """Convert positions from y up, as in Alembic files, to z up, as in Blender."""
    return np.stack([positions[..., 0], -positions[..., 2], positions[..., 1]], axis=-1)


def test_blender_imports_our_positions_exactly(brought):
    sequence, known = brought
    assert known["range"].tolist() == [5, 10]
    for frame in (5, 8, 10):
        expected = upright(sequence.vertices[frame - 5])
        np.testing.assert_array_equal(known[f"frame_{frame}"], expected)


def test_blender_imports_our_polygons_exactly(brought):
    _, known = brought
    np.testing.assert_array_equal(known["sizes"], SIZES)
    np.testing.assert_array_equal(known["corners"], CORNERS)


def test_blender_imports_our_textures_and_materials(brought):
    sequence, known = brought
    [texture] = sequence.surface.attributes
    np.testing.assert_array_equal(known["uv_map"], texture.per_item())
    assert known["materials"].tolist() == ["blue", "red", "blue"]


def test_load_reads_positions_exported_by_blender(sent):
    results, known = sent
    assert (results.n_frames, results.fps, results.start_s) == (10, 30.0, 5 / 30)
    for index, frame in enumerate(upright(results.vertices)):
        assert np.abs(frame - known[f"frame_{index + 5}"]).max() < FLOAT32_STEPS


def test_load_reads_polygons_exported_by_blender(sent):
    results, known = sent
    sizes = results.surface.sizes(results.n_faces)
    np.testing.assert_array_equal(sizes, known["sizes"])
    np.testing.assert_array_equal(join_triangles(sizes, results.faces), known["corners"])


def test_load_reads_textures_and_materials_exported_by_blender(sent):
    results, known = sent
    textures = {one.name: one.per_item() for one in results.surface.of_kind(Kind.UV)}
    assert set(textures) == {"UVMap", "second"}
    for name, numbers in textures.items():
        np.testing.assert_array_equal(numbers, known[f"uv_{name}"])
    [groups] = results.surface.groups
    assert groups.name == "material"
    assert [groups.labels[number] for number in groups.numbers] == known["materials"].tolist()
