"""Small glTF files for tests, assembled step by step."""

import base64
import json
import struct
from typing import Any

import numpy as np

COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}

TRIANGLE = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
SQUARE_FACES = [0, 1, 2, 0, 2, 3]


def shifted(points, by):
    """Return translated points."""
    return np.add(points, by)


class Gltf:
    """Builder of a glTF file; tests may change `json`."""

    def __init__(self):
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": []}],
        }
        self.data = bytearray()

    @classmethod
    def of_mesh(cls, *shape, **node):
        """Return a file with node 0, of a mesh with these positions, faces and targets."""
        file = cls()
        file.node(mesh=file.mesh(*shape), **node)
        return file

    def add(self, kind, **values):
        """Add an item to a list of the file; return its number."""
        items = self.json.setdefault(kind, [])
        items.append(values)
        return len(items) - 1

    def view(self, data, **values):
        """Add a buffer view of these bytes; return its number."""
        self.data += bytes(-len(self.data) % 4)
        values = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), **values}
        self.data += data
        return self.add("bufferViews", **values)

    def accessor(self, values, dtype="f4", **more):
        """Add an accessor of values of shape (N,), (N, C) or (N, 4, 4); return its number."""
        array = np.asarray(values)
        array = array.reshape(len(array), -1).astype(f"<{dtype}")
        return self.add(
            "accessors",
            bufferView=self.view(array.tobytes()),
            componentType=COMPONENTS[dtype],
            count=len(array),
            type=KINDS[array.shape[1]],
            **more,
        )

    def mesh(self, positions=TRIANGLE, faces=None, targets=(), *, attributes=None, **more):
        """Add a mesh of one primitive; attributes are accessor numbers. Return its number."""
        primitive: dict[str, Any] = {
            "attributes": {"POSITION": self.accessor(positions), **(attributes or {})}
        }
        if faces is not None:
            primitive["indices"] = self.accessor(np.ravel(faces), "u2")
        if len(targets):
            primitive["targets"] = [{"POSITION": self.accessor(target)} for target in targets]
        return self.add("meshes", primitives=[primitive], **more)

    def node(self, *, is_root=True, **values):
        """Add a node, a root unless it is a child of another; return its number."""
        number = self.add("nodes", **values)
        if is_root:
            self.json["scenes"][0]["nodes"].append(number)
        return number

    def animate(self, node, path, keys, values, interpolation=None, *, dtype="f4", animation=0):
        """Animate a node; creates the animation if necessary."""
        animations = self.json.setdefault("animations", [])
        while len(animations) <= animation:
            animations.append({"samplers": [], "channels": []})
        result = animations[animation]
        sampler = {
            "input": self.accessor(keys),
            "output": self.accessor(
                values, dtype, **({} if dtype == "f4" else {"normalized": True})
            ),
        }
        if interpolation:
            sampler["interpolation"] = interpolation
        result["samplers"].append(sampler)
        target = {"node": node, "path": path}
        result["channels"].append({"sampler": len(result["samplers"]) - 1, "target": target})

    def save(self, path):
        """Write a `.glb`, or a `.gltf` with embedded data; return the path."""
        whole = dict(self.json)
        if path.suffix == ".glb":
            path.write_bytes(glb({**whole, "buffers": [{"byteLength": len(self.data)}]}, self.data))
        else:
            uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
            whole.setdefault("buffers", [{"byteLength": len(self.data), "uri": uri}])
            path.write_text(json.dumps(whole))
        return path


def glb(document, data):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data = bytes(data) + bytes(-len(data) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(data), b"BIN\x00") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def moving_triangle():
    """Return a triangle that moves from 0 to 2 along x within a second, at three keys."""
    file = Gltf()
    node = file.node(mesh=file.mesh(), name="tri")
    file.animate(node, "translation", [0, 0.5, 1], [[0, 0, 0], [1, 0, 0], [2, 0, 0]])
    return file


def rich_gltf():
    """Return a file with a skin, morph targets, materials, seams and an armature."""
    file = Gltf()
    joints = file.accessor(np.tile([0, 1, 0, 0], (4, 1)), "u1")
    weights = file.accessor(np.tile([128, 127, 0, 0], (4, 1)), "u1", normalized=True)
    uv = file.accessor(np.random.default_rng(0).random((4, 2)))
    color = file.accessor([[255, 0, 0, 255]] * 4, "u1", normalized=True)
    mesh = file.mesh(
        [*SQUARE[:3], SQUARE[0]],
        [0, 1, 2, 3, 2, 1],
        [np.ones((4, 3)), -np.ones((4, 3))],
        attributes={"JOINTS_0": joints, "WEIGHTS_0": weights, "TEXCOORD_0": uv, "COLOR_0": color},
        weights=[0.25, 0],
    )
    file.json["meshes"][mesh]["primitives"][0]["material"] = file.add("materials", name="skin")
    sparse = {
        "count": 1,
        "indices": {"bufferView": file.view(b"\x01"), "componentType": 5121},
        "values": {"bufferView": file.view(np.array([0, 0, 3], "<f4").tobytes())},
    }
    target = file.add("accessors", componentType=5126, count=4, type="VEC3", sparse=sparse)
    file.json["meshes"][mesh]["primitives"][0]["targets"][1]["POSITION"] = target
    tip = file.node(is_root=False, name="tip", translation=[0, 1, 0], rotation=[0, 0, 0, 1])
    root = file.node(name="root", children=[tip], scale=[1, 1, 2])
    binds = file.accessor(np.tile(np.eye(4), (2, 1, 1)))
    skin = file.add("skins", joints=[root, tip], inverseBindMatrices=binds)
    body = file.node(name="body", mesh=mesh, skin=skin)
    half = np.sqrt(0.5)
    file.animate(tip, "rotation", [0, 0.5], [[0, 0, 0, 1], [0, 0, half, half]])
    file.animate(root, "translation", [0, 0.5], np.ones((6, 3)), "CUBICSPLINE")
    file.animate(body, "weights", [0, 0.5], [0, 1, 1, 0], "STEP")
    return file
