"""Rigs of real animations meet their error bounds, and are small."""

import pytest

import meshreel

pytestmark = pytest.mark.real


def test_rig_of_a_walk_meets_its_bounds_in_60_kb(data, tmp_path):
    walk, path = meshreel.load(data / "cesium_man.npz"), tmp_path / "walk.glb"
    meshreel.save(walk, path, rig=True, normals=False, meshopt=True)
    quality = meshreel.compare(walk, meshreel.load(path))
    assert quality.kg_error_percent <= 0.5
    assert quality.max_error_percent <= 1
    assert path.stat().st_size <= 60_000


def test_rig_of_many_components_needs_no_morph_targets(data):
    chicken = meshreel.load(data / "chicken.npz")
    rig = meshreel.rig(meshreel.MeshSequence(chicken.vertices[::20], chicken.faces), kg=1)
    assert rig.n_targets == 0
    assert rig.errors.kg_percent <= 1
