"""Plays vertex animation textures like the shaders of engines, in float32.

Written from the sources of those programs; uses only the files. See
docs/guides/vertex_textures.md. Vectors come back in the axes and units of the glTF file.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.formats.vat.textures import read_texture
from samples.glb import Glb

F = np.float32


def read_glb(path):
    """The attributes of the first mesh, its primitives joined, its triangles, and its node."""
    file = Glb.read(Path(path).read_bytes())
    blocks, triangles, n_verts = [], [], 0
    for primitive in file.document["meshes"][0]["primitives"]:
        block = {name: file.array(number) for name, number in primitive["attributes"].items()}
        triangles.append(file.array(primitive["indices"]).reshape(-1, 3).astype(int) + n_verts)
        n_verts += len(block["POSITION"])
        blocks.append(block)
    joined = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    return joined, np.concatenate(triangles), file.document["nodes"][0]


def texels_at(image, u, v):
    """Nearest texels, as floats from 0 to 1 of integers; v is 0 at the top. Wraps as GPUs do."""
    height, width = image.shape[:2]
    column = np.floor((u % 1) * F(width)).astype(int)
    row = np.floor((v % 1) * F(height)).astype(int)
    texels = image[row, column]
    if texels.dtype.kind == "u":
        return texels.astype(F) / F(np.iinfo(texels.dtype).max)
    return texels.astype(F)


def only(folder, pattern):
    [path] = sorted(Path(folder).glob(pattern))
    return path


class Player:
    """A folder of textures, with positions and normals of its mesh in each frame.

    Attributes
    ----------
    n_frames : int
        As in the shader.
    """

    def __init__(self, folder):
        self.mesh, self.triangles, self.node = read_glb(only(folder, "*.glb"))
        self.data = json.loads(only(folder, "*.json").read_text("utf-8"))
        self.rest = self.mesh["POSITION"]
        self.u, self.v = self.mesh["TEXCOORD_1"].T

    @property
    def shift(self):
        """Return the translation of the mesh node."""
        return np.array(self.node.get("translation", [0, 0, 0]), float)


class OpenVatPlayer(Player):
    """The shader for Godot, in the axes of the glTF file."""

    def __init__(self, folder):
        super().__init__(folder)
        self.image = read_texture(only(folder, "*_vat.*"))
        remap = self.data["os-remap"]
        self.n_frames = remap["Frames"]
        self.low, self.high = np.array(remap["Min"], F), np.array(remap["Max"], F)

    def positions(self, frame):
        values = texels_at(self.image, self.u, self.v + F(frame) * (F(1) / F(len(self.image))))
        return self.rest + from_blender(self.low + values * (self.high - self.low))

    def normals(self, frame):
        v = self.v + F(frame) * (F(1) / F(len(self.image))) + F(0.5)
        return from_blender(F(2) * texels_at(self.image, self.u, v) - F(1))


class OpenVatUnityPlayer(OpenVatPlayer):
    """The shader graph for Unity: hundredths in Blender's axes, of which importers mirror x."""

    def __init__(self, folder):
        super().__init__(folder)
        self.object_rest, self.upwards = mirrored(self.rest), 1 - self.v
        self.rest = self.placed(self.object_rest)

    def sample(self, frame, lower):
        v = self.upwards - F(frame) / F(len(self.image)) - F(lower)
        return texels_at(self.image, self.u, 1 - v)

    def positions(self, frame):
        offsets = self.low + self.sample(frame, 0) * (self.high - self.low)
        return self.placed(self.object_rest + mirrored(offsets * F(0.01)))

    def normals(self, frame):
        return rotated_by_node(mirrored(mirrored(F(2) * self.sample(frame, 0.5) - F(1))), self.node)

    def placed(self, points):
        """Points of the mesh in Unity, in glTF's axes: the node scales and turns them."""
        return rotated_by_node(mirrored(points) * np.array(self.node["scale"], F), self.node)


def rotated_by_node(vectors, node):
    axis, w = np.array(node["rotation"][:3], F), F(node["rotation"][3])
    return vectors + F(2) * np.cross(axis, np.cross(axis, vectors) + w * vectors)


def from_blender(vectors):
    return np.stack([vectors[:, 0], vectors[:, 2], -vectors[:, 1]], axis=1)


def mirrored(vectors):
    return vectors * np.array([-1, 1, 1], F)


PLAYERS: dict[str, Any] = {"openvat": OpenVatPlayer, "openvat-unity": OpenVatUnityPlayer}
