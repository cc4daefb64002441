"""Whatever a glTF file says, reading it gives a sequence or an error of meshreel."""

import contextlib
import json
import re
import struct
import tracemalloc

import numpy as np
import pytest

from meshreel.errors import FormatError, MeshReelError
from meshreel.formats.load import load
from samples.costs import draws
from samples.gltf import Gltf, glb, moving_triangle, rich_gltf
from samples.json import DELETED, ODD, changed, places
from samples.opening import open_source

N_CHANGED = draws(500)


def read_all(path):
    """Read a file in both ways; an error of another kind comes out."""
    with contextlib.suppress(MeshReelError):
        load(path, merge=True)
    with contextlib.suppress(MeshReelError):
        opened = open_source(path, fps=24)
        opened.read(0, opened.n_frames)


def crowded_gltf():
    """A skinned body beside a triangle that moves."""
    file = rich_gltf()
    node = file.node(mesh=file.mesh(), name="tri")
    file.animate(node, "translation", [0, 0.5], np.eye(2, 3))
    return file


def test_load_raises_only_our_errors_when_any_value_is_changed(tmp_path):
    file, rng = crowded_gltf(), np.random.default_rng(0)
    document = {**file.json, "buffers": [{"byteLength": len(file.data)}]}
    cases = [(place, value) for place in places(document) for value in [*ODD, DELETED]]
    path = tmp_path / "a.glb"
    for number in rng.choice(len(cases), N_CHANGED, replace=False):
        path.write_bytes(glb(changed(document, *cases[number]), file.data))
        read_all(path)


def test_load_raises_only_our_errors_when_bytes_are_changed(tmp_path):
    path, rng = crowded_gltf().save(tmp_path / "a.glb"), np.random.default_rng(1)
    data = path.read_bytes()
    for _ in range(N_CHANGED):
        damaged = bytearray(data)
        for place in rng.integers(0, len(data), rng.integers(1, 4)):
            damaged[place] = rng.integers(256)
        path.write_bytes(damaged)
        read_all(path)


def test_load_is_refused_when_a_file_is_cut_short_anywhere(tmp_path):
    path = crowded_gltf().save(tmp_path / "a.glb")
    data = path.read_bytes()
    for size in [*range(40), *range(40, len(data), 97), len(data) - 1]:
        path.write_bytes(data[:size])
        with pytest.raises(FormatError, match=r"a\.glb: "):
            load(path)


@pytest.mark.parametrize("size", [0, 1, 10, 100, 1000])
def test_load_is_refused_when_a_text_file_is_cut_short(tmp_path, size):
    path = crowded_gltf().save(tmp_path / "a.gltf")
    path.write_bytes(path.read_bytes()[:size])
    with pytest.raises(FormatError, match=r"a\.gltf: is no glTF file"):
        load(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"[" * 100_000, "nested too deeply"),
        (b'{"a":' * 100_000, "nested too deeply"),
        (b'{"asset": {"version": "2.0", "x": NaN}}', "NaN is no number of JSON"),
        (b'{"asset": {"version": "2.0", "x": -Infinity}}', "-Infinity is no number of JSON"),
        (b'{"x": ' + b"9" * 5000 + b"}", "its JSON cannot be read"),
        (b"\xff\xfe{}", "its JSON cannot be read"),
        (b"[]", "its JSON is no object"),
        (b"{}", "the file: has no 'asset'"),
        (b'{"asset": {"version": "1.0"}}', r"is glTF '1\.0'; glTF 2\.0 is read"),
        (b'{"asset": {"version": "2.0", "minVersion": "2.1"}}', r"is glTF '2\.1'"),
        (b'{"asset": {"version": "2.0"}, "nodes": 3}', "'nodes' must be a list of objects"),
        (b'{"asset": {"version": "2.0"}}', "holds no mesh"),
        (b'{"asset": {"version": 1}, "meshes": {"a": {}}}', r"is glTF 1\.0; glTF 2\.0 is read"),
        (b'{"meshes": {"a": {}}}', r"is glTF 1\.0 or older; .* convert it \(gltf-pipeline\)"),
        (b'{"asset": {"version": ""}}', "the version of its asset is ''; glTF 2.0 is read"),
    ],
)
def test_load_says_what_is_wrong_when_the_json_is_no_gltf(tmp_path, text, message):
    (tmp_path / "a.gltf").write_bytes(text)
    with pytest.raises(FormatError, match=rf"a\.gltf: .*{message}"):
        load(tmp_path / "a.gltf")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"glTF\x01\0\0\0\x14\0\0\0" + bytes(8), "is a GLB file of version 1; version 2 is read"),
        (b"glTF\x02\0\0\0\x0c\0\0\0", "does not begin with JSON"),
        (b"glTF\x02\0\0\0", "ends after 8 bytes, within the header"),
        (b"glTF" + struct.pack("<III4s", 2, 20, 9, b"JSON"), "chunk 0 announces 9 bytes; 0 are"),
        (b"glTF" + struct.pack("<III4s", 2, 20, 0, b"BIN\0"), "does not begin with JSON"),
    ],
)
def test_load_says_what_is_wrong_when_a_glb_is_damaged(tmp_path, data, message):
    (tmp_path / "a.glb").write_bytes(data)
    with pytest.raises(FormatError, match=rf"a\.glb: .*{message}"):
        load(tmp_path / "a.glb")


def test_load_names_the_extension_when_a_file_requires_one_that_is_not_read(tmp_path):
    file = moving_triangle()
    file.json["extensionsRequired"] = ["KHR_materials_unlit", "ACME_magic"]
    message = "requires the extension ACME_magic, which is not read; export it without"
    with pytest.raises(FormatError, match=message):
        load(file.save(tmp_path / "a.glb"))


def chain(n_nodes, **leaf):
    """Nodes that are each a child of the one before."""
    file = Gltf()
    nodes = [{"children": [number + 1], "name": "n" * 9} for number in range(n_nodes - 1)]
    file.json["nodes"] = [*nodes, {"mesh": file.mesh(), **leaf}]
    file.json["scenes"] = [{"nodes": [0]}]
    return file


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"children": [0]}, "node 0 is above itself"),
        ({"children": [2]}, "node 2 is a child of nodes 1 and 2"),
        ({"children": [1]}, "node 1 is a child of nodes 0 and 2"),
        ({"children": [3]}, "node 2: 'children' must be a list of numbers below 3"),
        ({"children": [-1]}, "node 2: 'children' must be a list of whole numbers"),
        ({"mesh": 1}, "node 2: 'mesh' must be below 1"),
        ({"rotation": [0, 0, 0, 0]}, "node 2: 'rotation' must be a quaternion of length 1"),
        ({"rotation": [0, 0, 0]}, "'rotation' must be a list of 4 finite numbers"),
        ({"translation": [0, 0, 1e400]}, "'translation' must be a list of 3 finite numbers"),
        ({"matrix": [0] * 15}, "'matrix' must be a list of 16 finite numbers"),
        ({"name": 3}, "node 2: 'name' must be text; got 3"),
        ({"weights": [1]}, "node 2: 'weights' must be a list of 0 finite numbers"),
    ],
)
def test_load_says_what_is_wrong_when_nodes_are_no_tree(tmp_path, change, message):
    file = chain(3, **change)
    text = json.dumps(file.json).replace("Infinity", "1e400")
    uri = "data:;base64," + "A" * 100
    text = text[:-1] + f', "buffers": [{{"byteLength": 36, "uri": "{uri}"}}]}}'
    (tmp_path / "a.gltf").write_text(text)
    with pytest.raises(FormatError, match=message):
        load(tmp_path / "a.gltf")


@pytest.mark.slow
def test_load_reads_a_deep_tree_and_refuses_a_deeper_one(tmp_path):
    assert load(chain(400).save(tmp_path / "a.glb")).n_frames == 1
    with pytest.raises(FormatError, match="its path is longer than 4096 characters"):
        load(chain(100_000).save(tmp_path / "b.glb"))


def animated(keys=(0, 0.5), values=((0, 0, 0), (1, 0, 0)), path="translation", **sampler):
    file = Gltf()
    file.node(mesh=file.mesh())
    file.animate(0, path, keys, values)
    file.json["animations"][0]["samplers"][0].update(sampler)
    return file


@pytest.mark.parametrize(
    ("file", "message"),
    [
        (animated([0.5, 0]), "times of keys must be finite and ascending"),
        (animated([0, np.nan]), "times of keys must be finite and ascending"),
        (animated([0, np.inf]), "times of keys must be finite and ascending"),
        (animated(values=[[0, 0, np.nan]] * 2), "values of keys must be finite"),
        (animated(values=[[0, 0, 0]] * 3), "has 9 numbers for 2 keys; 6 are needed"),
        (animated(interpolation="CUBICSPLINE"), "has 6 numbers for 2 keys; 18 are needed"),
        (animated(interpolation="SMOOTH"), "must be one of LINEAR, STEP, CUBICSPLINE; got 'SMOO"),
        (animated(input=99), "sampler 0: 'input' must be below 3"),
        (animated(path="rotation"), "'type' must be VEC4 here; got 'VEC3'"),
        (animated(values=[1, 2], path="weights"), "has 2 numbers for 2 keys; 0 are needed"),
    ],
)
def test_load_leaves_out_an_animation_and_says_why_when_it_is_malformed(tmp_path, file, message):
    path, notes = file.save(tmp_path / "a.glb"), []
    assert load(path, notes=notes).n_frames == 1
    [note] = notes
    assert re.match(r"left out: malformed animations: animation_0 \(", note)
    assert re.search(message, note)
    with pytest.raises(FormatError, match=message):
        load(path, animation=0)


def test_load_leaves_out_an_animation_when_a_node_that_it_moves_has_a_matrix(tmp_path):
    file, notes = animated(), []
    file.json["nodes"][0]["matrix"] = np.eye(4).ravel().tolist()
    assert load(file.save(tmp_path / "a.glb"), notes=notes).n_frames == 1
    [note] = notes
    assert "moves the translation of node 0, which has a matrix" in note


def test_load_is_refused_when_an_animation_takes_too_many_frames(tmp_path):
    file = animated([0, 1, 1e9], np.zeros((3, 3)))
    with pytest.raises(FormatError, match=r"takes 1e.09 s, which is 30000000000 frames at 30"):
        load(file.save(tmp_path / "a.glb"))


def test_load_takes_little_memory_when_a_small_file_announces_much(tmp_path):
    file = Gltf()
    zeros = file.add("accessors", componentType=5126, count=1 << 24, type="VEC3")
    target = {"POSITION": zeros}
    primitive = {"attributes": target, "targets": [target] * 10_000}
    file.node(mesh=file.add("meshes", primitives=[primitive]))
    path = file.save(tmp_path / "a.glb")
    tracemalloc.start()
    try:
        with pytest.raises(FormatError, match="would take more than 32 times its size"):
            load(path)
        # Zeros are not touched, but count as taken: five of 192 MiB, and the file.
        assert tracemalloc.get_traced_memory()[1] < 3 << 29
    finally:
        tracemalloc.stop()
