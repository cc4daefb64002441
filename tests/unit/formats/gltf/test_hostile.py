"""Reading any glTF JSON or bytes returns a sequence or raises an error of meshreel."""

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
from samples.datasets import read_damaged
from samples.gltf import Gltf, glb, moving_triangle, rich_gltf
from samples.json import DELETED, ODD, changed, places
from samples.opening import open_source

pytestmark = pytest.mark.damaged

N_CHANGED = draws(500)


def read_all(path):
    """Read a file with `load` and `open_source`; only errors of meshreel are allowed."""
    with contextlib.suppress(MeshReelError):
        load(path, merge=True)
    with contextlib.suppress(MeshReelError):
        opened = open_source(path, fps=24)
        opened.read(0, opened.n_frames)


def crowded_gltf():
    """Return a skinned body and an animated triangle."""
    file = rich_gltf()
    node = file.node(mesh=file.mesh(), name="tri")
    file.animate(node, "translation", [0, 0.5], np.eye(2, 3))
    return file


@pytest.mark.slow
def test_load_raises_only_our_errors_for_changed_values(tmp_path):
    file, rng = crowded_gltf(), np.random.default_rng(0)
    document = {**file.json, "buffers": [{"byteLength": len(file.data)}]}
    cases = [(path, value) for path in places(document) for value in [*ODD, DELETED]]
    file_path = tmp_path / "a.glb"
    for number in rng.choice(len(cases), N_CHANGED, replace=False):
        file_path.write_bytes(glb(changed(document, *cases[number]), file.data))
        read_all(file_path)


def test_load_raises_only_our_errors_for_changed_bytes(tmp_path):
    path = crowded_gltf().save(tmp_path / "a.glb")
    read_damaged(path, 1000, n_header=path.stat().st_size, readers=(read_all,))


def test_load_rejects_truncated_glb_files(tmp_path):
    path = crowded_gltf().save(tmp_path / "a.glb")
    data = path.read_bytes()
    for size in [*range(40), *range(40, len(data), 97), len(data) - 1]:
        path.write_bytes(data[:size])
        with pytest.raises(FormatError, match=r"a\.glb: "):
            load(path)


@pytest.mark.parametrize("size", [1, 10, 100, 1000])
def test_load_rejects_truncated_text_files(tmp_path, size):
    path = crowded_gltf().save(tmp_path / "a.gltf")
    path.write_bytes(path.read_bytes()[:size])
    with pytest.raises(FormatError, match=r"a\.gltf: is not a glTF file"):
        load(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"[" * 100_000, "nested too deeply"),
        (b'{"a":' * 100_000, "nested too deeply"),
        (b'{"asset": {"version": "2.0", "x": NaN}}', "NaN is not a JSON number"),
        (b'{"asset": {"version": "2.0", "x": -Infinity}}', "-Infinity is not a JSON number"),
        (b'{"x": ' + b"9" * 5000 + b"}", "its JSON cannot be read"),
        (b"\xff\xfe{}", "its JSON cannot be read"),
        (b"[]", "its JSON is not an object"),
        (b"{}", "the file: has no 'asset'"),
        (b'{"asset": {"version": "1.0"}}', r"is glTF '1\.0'; only glTF 2\.0 is supported"),
        (b'{"asset": {"version": "2.0", "minVersion": "2.1"}}', r"is glTF '2\.1'"),
        (b'{"asset": {"version": "2.0"}, "nodes": 3}', "'nodes' must be a list of objects"),
        (b'{"asset": {"version": "2.0"}}', "contains no mesh"),
        (
            b'{"asset": {"version": 1}, "meshes": {"a": {}}}',
            r"is glTF 1\.0; only glTF 2\.0 is supported",
        ),
        (b'{"meshes": {"a": {}}}', r"is glTF 1\.0 or older; .* convert it \(gltf-pipeline\)"),
        (b'{"asset": {"version": ""}}', "the version of its asset is ''; only glTF 2.0 is"),
        (
            b'{"asset": {"version": "' + b"9" * 10**6 + b'"}}',
            r"is glTF '9+ \.\.\. 9+'; only glTF 2\.0 is",
        ),
    ],
)
def test_load_explains_why_json_is_not_a_gltf_file(tmp_path, text, message):
    (tmp_path / "a.gltf").write_bytes(text)
    with pytest.raises(FormatError, match=rf"a\.gltf: .*{message}") as caught:
        load(tmp_path / "a.gltf")
    assert len(str(caught.value)) < 2000


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"glTF\x01\0\0\0\x14\0\0\0" + bytes(8), "is a GLB file of version 1; only version 2 is"),
        (b"glTF\x02\0\0\0\x0c\0\0\0", "does not start with JSON"),
        (b"glTF\x02\0\0\0", "ends after 8 bytes, within the header"),
        (b"glTF" + struct.pack("<III4s", 2, 20, 9, b"JSON"), "chunk 0 declares 9 bytes; only 0"),
        (b"glTF" + struct.pack("<III4s", 2, 20, 0, b"BIN\0"), "does not start with JSON"),
    ],
)
def test_load_describes_the_damage_of_a_glb_file(tmp_path, data, message):
    (tmp_path / "a.glb").write_bytes(data)
    with pytest.raises(FormatError, match=rf"a\.glb: .*{message}"):
        load(tmp_path / "a.glb")


def test_load_names_required_extensions_that_are_not_supported(tmp_path):
    file = moving_triangle()
    file.json["extensionsRequired"] = ["KHR_materials_unlit", "ACME_magic"]
    message = "requires the unsupported extension ACME_magic; export it without"
    with pytest.raises(FormatError, match=message):
        load(file.save(tmp_path / "a.glb"))


def chain(n_nodes, **leaf):
    """Return a file with a chain of nodes, each the child of the previous one."""
    file = Gltf()
    nodes = [{"children": [number + 1], "name": "n" * 9} for number in range(n_nodes - 1)]
    file.json["nodes"] = [*nodes, {"mesh": file.mesh(), **leaf}]
    file.json["scenes"] = [{"nodes": [0]}]
    return file


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"children": [0]}, "node 0 is its own ancestor"),
        ({"children": [2]}, "node 2 is a child of nodes 1 and 2"),
        ({"children": [1]}, "node 1 is a child of nodes 0 and 2"),
        ({"children": [3]}, "node 2: 'children' must be a list of indices below 3"),
        ({"children": [-1]}, "node 2: 'children' must be a list of integers"),
        ({"mesh": 1}, "node 2: 'mesh' must be below 1"),
        ({"rotation": [0, 0, 0, 0]}, "node 2: 'rotation' must be a quaternion of length 1"),
        ({"rotation": [0, 0, 0]}, "'rotation' must be a list of 4 finite numbers"),
        ({"translation": [0, 0, 1e400]}, "'translation' must be a list of 3 finite numbers"),
        ({"matrix": [0] * 15}, "'matrix' must be a list of 16 finite numbers"),
        ({"name": 3}, "node 2: 'name' must be text; got 3"),
        ({"weights": [1]}, "node 2: 'weights' must be a list of 0 finite numbers"),
    ],
)
def test_load_describes_what_is_wrong_with_nodes(tmp_path, change, message):
    file = chain(3, **change)
    text = json.dumps(file.json).replace("Infinity", "1e400")
    uri = "data:;base64," + "A" * 100
    text = text[:-1] + f', "buffers": [{{"byteLength": 36, "uri": "{uri}"}}]}}'
    (tmp_path / "a.gltf").write_text(text)
    with pytest.raises(FormatError, match=message):
        load(tmp_path / "a.gltf")


@pytest.mark.slow
def test_load_reads_a_deep_hierarchy_but_rejects_a_deeper_one(tmp_path):
    assert load(chain(400).save(tmp_path / "a.glb")).n_frames == 1
    with pytest.raises(FormatError, match="its path is longer than 4096 characters"):
        load(chain(100_000).save(tmp_path / "b.glb"))


def animated(
    keys=(0, 0.5), values=((0, 0, 0), (1, 0, 0)), path="translation", *, channel=(), **sampler
):
    file = Gltf.of_mesh()
    file.animate(0, path, keys, values)
    file.json["animations"][0]["samplers"][0].update(sampler)
    file.json["animations"][0]["channels"][0].update(channel)
    return file


@pytest.mark.parametrize(
    ("file", "message"),
    [
        (animated([0.5, 0]), "key times must be ascending"),
        (animated([0, np.nan]), "the numbers of 'input' must be finite"),
        (animated(values=[[0, 0, np.nan]] * 2), "the numbers of 'output' must be finite"),
        (animated(values=[[0, 0, 0]] * 3), "has 9 numbers for 2 keys; expected 6"),
        (animated(interpolation="CUBICSPLINE"), "has 6 numbers for 2 keys; expected 18"),
        (animated(interpolation="SMOOTH"), "must be one of LINEAR, STEP, CUBICSPLINE; got 'SMOO"),
        (animated(input=99), "sampler 0: 'input' must be below 3"),
        (animated(path="rotation"), "'type' must be VEC4; got 'VEC3'"),
        (animated(values=[1, 2], path="weights"), "has 2 numbers for 2 keys; expected 0"),
        (animated(channel={"sampler": 7}), "channel 0: 'sampler' must be below"),
        (animated(channel={"target": 0}), "channel 0: 'target' must be an object"),
        (animated(channel={"target": {"path": "scale", "node": 7}}), "'node' must be below 1"),
    ],
)
def test_load_leaves_out_malformed_channels_and_says_why(tmp_path, file, message, notes):
    path = file.save(tmp_path / "a.glb")
    assert load(path, notes=notes).n_frames == 1
    [note] = notes
    assert re.match(r"left out: malformed animations: animation_0 \(", note)
    assert re.search(message, note)
    with pytest.raises(FormatError, match=message):
        load(path, animation=0)
    file.animate(0, "scale", [0, 3], [[1, 1, 1], [5, 1, 1]])  # other keys than the malformed one
    file.json["animations"][0]["channels"][1]["sampler"] = 1
    del notes[:]
    loaded = load(file.save(tmp_path / "b.glb"), notes=notes)
    np.testing.assert_allclose(np.ptp(loaded.vertices, axis=1)[:, 0], [1, 5])
    assert re.match("left out: malformed channels: animation 0, channel 0[,:] ", notes[0])
    assert load(path.with_name("b.glb"), animation=0).n_frames == 2


def test_load_leaves_out_a_channel_of_a_node_with_a_matrix(tmp_path, notes):
    file = animated()
    file.json["nodes"][0]["matrix"] = np.eye(4).ravel().tolist()
    assert load(file.save(tmp_path / "a.glb"), notes=notes).n_frames == 1
    assert "animates the translation of node 0, which has a matrix" in notes[0]


def test_load_rejects_an_animation_with_too_many_frames(tmp_path):
    file = animated([0, 1, 1e9], np.zeros((3, 3)))
    with pytest.raises(FormatError, match=r"takes 1e.09 s, which is 30000000000 frames at 30"):
        load(file.save(tmp_path / "a.glb"), fps=30)


@pytest.mark.slow
def test_load_uses_little_memory_for_a_small_file_with_huge_counts(tmp_path):
    file = Gltf()
    zeros = file.add("accessors", componentType=5126, count=1 << 24, type="VEC3")
    target = {"POSITION": zeros}
    primitive = {"attributes": target, "targets": [target] * 10_000}
    file.node(mesh=file.add("meshes", primitives=[primitive]))
    path = file.save(tmp_path / "a.glb")
    tracemalloc.start()
    try:
        with pytest.raises(FormatError, match="would need more than 32 times its size"):
            load(path)
        # Untouched zeros count as allocated: five arrays of 192 MiB, and the file.
        assert tracemalloc.get_traced_memory()[1] < 3 << 29
    finally:
        tracemalloc.stop()
