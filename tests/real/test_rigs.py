"""Rigs of real animations meet their bounds in few bytes."""

import pytest

import meshreel

pytestmark = pytest.mark.real


def test_walk_is_a_small_rig(data, tmp_path):
    walk, path = meshreel.load(data / "cesium_man.npz"), tmp_path / "walk.glb"
    meshreel.save(walk, path, rig=True, normals=False)
    quality = meshreel.compare(walk, meshreel.load(path))
    assert quality.kg_error_percent <= 0.5
    assert quality.max_error_percent <= 1
    assert path.stat().st_size <= 60_000


def test_many_components_have_bones_of_their_own(data):
    chicken = meshreel.load(data / "chicken.npz")
    rig = meshreel.rig(meshreel.MeshSequence(chicken.vertices[::20], chicken.faces), kg=1)
    assert rig.n_targets == 0
    assert rig.errors.kg_percent <= 1
