"""Cached weights of a mesh."""

from meshreel.codec.reel.normative.mesh import MAX_PREPARED_VERTICES, FieldMesh
from samples.meshes import grid_faces


def test_prepared_weights_are_cached_unless_the_mesh_is_large(monkeypatch):
    mesh = FieldMesh(grid_faces(8, 9), 72, 16)
    assert mesh.prepared is mesh.prepared is not None
    monkeypatch.setattr("meshreel.codec.reel.normative.mesh.MAX_PREPARED_VERTICES", 71)
    assert FieldMesh(grid_faces(8, 9), 72, 16).prepared is None
    assert MAX_PREPARED_VERTICES * 608 <= 40e6
