"""`meshreel info` on files of other programs."""

import pytest

from meshreel.formats.inspection import inspect_source
from meshreel.formats.load import load
from meshreel.formats.options import Reading

pytestmark = pytest.mark.real


def test_both_meshes_of_a_package_are_listed(existing):
    path = existing("native/odd/BoxAnimated.usdz")
    result = inspect_source(path, Reading()).meshes
    assert [(mesh.name.rpartition("/")[2], mesh.n_verts, mesh.n_faces) for mesh in result] == [
        ("node_3", 224, 192),
        ("node_2", 96, 62),
    ]


@pytest.mark.parametrize("name", ["bone.abc", "cesium_man.glb", "cesium_man.usdz"])
def test_reported_figures_match_the_loaded_sequence(existing, name):
    path = existing(f"native/{name}")
    sequence = load(path)
    [result] = inspect_source(path, Reading()).meshes
    assert (result.n_frames, result.n_verts, result.n_faces) == (
        sequence.n_frames,
        sequence.n_verts,
        sequence.n_faces,
    )
    assert (result.fps, result.start_s) == (sequence.fps, sequence.start_s)
    assert result.low == tuple(sequence.extent.low.tolist())
    assert result.high == tuple(sequence.extent.high.tolist())


def test_the_root_selects_its_only_mesh(existing):
    path = existing("native/bone.abc")
    [result] = inspect_source(path, Reading()).meshes
    root = "/" + result.name.strip("/").partition("/")[0]
    assert inspect_source(path, Reading(object=root)).meshes == (result,)
