"""Cached weights of a mesh."""

import numpy as np

import meshreel
from meshreel.codec.reel.normative.mesh import MAX_PREPARED_VERTICES, FieldMesh
from samples.meshes import grid_faces, waving_grid


def test_prepared_weights_are_cached_unless_the_mesh_is_large(monkeypatch):
    mesh = FieldMesh(grid_faces(8, 9), 72, 16)
    assert mesh.prepared is mesh.prepared is not None
    monkeypatch.setattr("meshreel.codec.reel.normative.mesh.MAX_PREPARED_VERTICES", 71)
    assert FieldMesh(grid_faces(8, 9), 72, 16).prepared is None
    assert MAX_PREPARED_VERTICES * 608 <= 40e6


def test_positions_do_not_depend_on_concurrent_preparation_of_weights(monkeypatch):
    data = meshreel.encode(waving_grid(9), block_frames=3)
    expected = meshreel.decode(data).vertices
    monkeypatch.setattr("meshreel.codec.reel.normative.mesh.MAX_PREPARED_VERTICES", 71)
    monkeypatch.setattr("meshreel.codec.reel.normative.blocks.n_cores", lambda: 2)
    np.testing.assert_array_equal(meshreel.decode(data).vertices, expected)
