"""Calls pass through few files, so that a reader can follow them."""

import importlib.util
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import meshreel
from samples.gltf import TRIANGLE, Gltf, shifted

SCRIPT = Path(__file__).parents[2] / "bench" / "call_path.py"


def file_changes(function):
    spec = importlib.util.spec_from_file_location("call_path", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.file_changes(function)


@pytest.mark.slow
@pytest.mark.parametrize(("options", "most"), [({}, 140), ({"max_error": 0.5}, 438)], ids=str)
def test_encoding_rarely_changes_file(options, most):
    sequence = meshreel.simulate_flag(30, n_rows=20, n_columns=20)
    assert file_changes(partial(meshreel.encode, sequence, **options)).total() <= most


@pytest.mark.slow
def test_decoding_rarely_changes_file():
    data = meshreel.encode(meshreel.simulate_flag(30, n_rows=20, n_columns=20))
    assert file_changes(partial(meshreel.decode, data)).total() <= 35


@pytest.mark.slow
def test_loading_gltf_rarely_changes_file(tmp_path):
    sequence = meshreel.simulate_flag(60, n_rows=20, n_columns=20)
    meshreel.save(sequence, tmp_path / "flag.glb")
    assert file_changes(partial(meshreel.load, tmp_path / "flag.glb")).total() <= 270


def loading_changes(path, n_nodes):
    """Count changes of file when loading a mesh below nodes that are all animated."""
    file = Gltf()
    node = file.node(mesh=file.mesh(TRIANGLE), is_root=n_nodes == 1)
    for number in range(n_nodes):
        if number:
            node = file.node(children=[node], is_root=number == n_nodes - 1)
        file.animate(node, "scale", [0, 1], [[1, 1, 1], [2, 2, 2]])
    return file_changes(partial(meshreel.load, file.save(path))).total()


def test_loading_gltf_rarely_changes_file_when_many_nodes_are_animated(tmp_path):
    few, many = (loading_changes(tmp_path / "a.glb", n_nodes) for n_nodes in (1, 50))
    assert many <= few + 10


def test_loading_gltf_rarely_changes_file_when_it_has_many_meshes(tmp_path):
    file = Gltf()
    for number in range(60):
        file.node(mesh=file.mesh(shifted(TRIANGLE, [number, 0, 0])))
    path = file.save(tmp_path / "many.glb")
    assert file_changes(partial(meshreel.load, path, merge=True)).total() <= 400


def animated_nodes():
    """Return a file of 60 meshes at animated nodes."""
    file = Gltf()
    for number in range(60):
        node = file.node(mesh=file.mesh(shifted(TRIANGLE, [number, 0, 0])))
        animate(file, node, seed=number)
    return file


def animated_joints():
    """Return a file of a mesh with a chain of 30 animated joints."""
    file = Gltf()
    chain: list[int] = []
    for number in range(30):
        chain.append(file.node(children=chain[-1:], is_root=number == 29, translation=[0, 1, 0]))
        animate(file, chain[-1], seed=number)
    skin = file.add("skins", joints=chain)
    joints = file.accessor(np.arange(12).reshape(3, 4), "u1")
    attributes = {"JOINTS_0": joints, "WEIGHTS_0": file.accessor(np.full((3, 4), 0.25))}
    file.node(mesh=file.mesh(attributes=attributes), skin=skin)
    return file


def animate(file, node, seed):
    rng, keys = np.random.default_rng(seed), np.arange(60) / 30
    file.animate(node, "translation", keys, rng.random((60, 3)))
    rotations = rng.normal(size=(60, 4))
    rotations /= np.linalg.norm(rotations, axis=1, keepdims=True)
    file.animate(node, "rotation", keys, rotations)


@pytest.mark.parametrize("make", [animated_nodes, animated_joints])
def test_loading_gltf_rarely_changes_file_when_animated(tmp_path, make):
    path = make().save(tmp_path / "animated.glb")
    assert file_changes(partial(meshreel.load, path, merge=True)).total() <= 400


def test_changes_are_counted_by_file():
    result = file_changes(lambda: meshreel.simulate_flag(2, n_rows=4, n_columns=4))
    assert all(first != second for first, second in result)
    assert any(second == "model/sequence.py" for _, second in result)
