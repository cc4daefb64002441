import json

from meshreel.evaluation.runs.store import Store, finite, sequence_identity
from meshreel.model.sequence import MeshSequence
from samples.meshes import waving_grid


def test_identity_depends_on_every_position():
    sequence = waving_grid()
    vertices = sequence.vertices.copy()
    vertices[3, 5, 1] += 1e-3
    other = MeshSequence(vertices, sequence.faces, sequence.fps, sequence.name)
    assert sequence_identity(other)["sha256"] != sequence_identity(sequence)["sha256"]
    assert sequence_identity(sequence) == sequence_identity(waving_grid())


def test_sequences_of_one_name_do_not_share_a_folder(tmp_path):
    sequence = waving_grid()
    other = MeshSequence(sequence.vertices * 2, sequence.faces, sequence.fps, sequence.name)
    stores = [Store.for_sequence(tmp_path, each) for each in (sequence, other)]
    assert stores[0].folder != stores[1].folder


def test_non_finite_figures_are_stored_as_valid_json():
    figures = finite({"a": [1.0, float("nan")], "b": {"c": float("inf")}, "d": "x"})
    assert figures == {"a": [1.0, None], "b": {"c": None}, "d": "x"}
    json.dumps(figures, allow_nan=False)
