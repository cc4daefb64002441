"""Independent parser of GLB files, written from the specification, for tests."""

import json
import struct
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation, Slerp

from meshreel.formats.frames.frame_stream import SegmentedStream
from meshreel.formats.gltf.meshopt import decode_view
from meshreel.formats.gltf.write import write_gltf
from meshreel.formats.options import WriteOptions

DTYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def stream_of(sequence, notes=None):
    """Return a stream of all frames of a sequence, without tracks."""
    stream = SegmentedStream(sequence, notes=notes)
    return stream.map_segments(lambda mesh: replace(mesh, tracks={}))


def written(folder, sequence, notes=None, **options):
    """Write a sequence as GLB, and parse it."""
    path = folder / "written.glb"
    write_gltf(path, stream_of(sequence, notes), WriteOptions(**options))
    return Glb.read(path.read_bytes())


@dataclass
class Glb:
    """The JSON and the buffer of a file."""

    document: dict
    buffer: bytes

    @classmethod
    def read(cls, data):
        magic, version, size, length, kind = struct.unpack_from("<4sIII4s", data)
        assert (magic, version, size, kind) == (b"glTF", 2, len(data), b"JSON")
        text, rest = data[20 : 20 + length], data[20 + length :]
        length, kind = struct.unpack_from("<I4s", rest)
        assert (length, kind) == (len(rest) - 8, b"BIN\0")
        return cls(json.loads(text), rest[8:])

    def array(self, number):
        """Return the values of an accessor, of shape (count, width); floats if normalized."""
        accessor = self.document["accessors"][number]
        view = self.document["bufferViews"][accessor["bufferView"]]
        dtype, width = np.dtype(DTYPES[accessor["componentType"]]), WIDTHS[accessor["type"]]
        buffer, start = self._buffer_of(view)
        start += accessor.get("byteOffset", 0)
        strides = (view.get("byteStride", width * dtype.itemsize), dtype.itemsize)
        shape = (accessor["count"], width)
        values = np.ndarray(shape, dtype, buffer, start, strides)
        for bound, reduce in (("min", np.min), ("max", np.max)):
            if bound in accessor:
                assert reduce(values, axis=0).tolist() == accessor[bound]
        if not accessor.get("normalized"):
            return values
        largest = np.iinfo(dtype).max
        return np.maximum(values / np.float64(largest), -1)

    def _buffer_of(self, view):
        """Return the buffer with the values of a view, and their offset."""
        compression = next(iter(view.get("extensions", {}).values()), None)
        if compression is None:
            return self.buffer, view["byteOffset"]
        start, end = (
            compression["byteOffset"],
            compression["byteOffset"] + compression["byteLength"],
        )
        names = ("count", "byteStride", "mode", "filter")
        return decode_view(self.buffer[start:end], *map(compression.get, names)), 0

    def node(self, name):
        """Return the first node with a name."""
        return next(one for one in self.document["nodes"] if one["name"] == name)

    def primitives(self, name):
        return self.document["meshes"][self.node(name)["mesh"]]["primitives"]

    def weights(self, name):
        """Return key times and weights of a node's mesh; None if it is not animated."""
        return self.keys(self.document["nodes"].index(self.node(name)), "weights")

    def keys(self, number, path):
        """Return key times and values of a property of a node; None if it is not animated."""
        animation = self.document.get("animations", [{"channels": []}])[0]
        for channel in animation["channels"]:
            if channel["target"] == {"node": number, "path": path}:
                sampler = animation["samplers"][channel["sampler"]]
                assert sampler.get("interpolation", "LINEAR") == "LINEAR"
                times = self.array(sampler["input"])[:, 0]
                return times, self.array(sampler["output"]).reshape(len(times), -1)
        return None

    def sampled(self, number, path, times_s, default):
        """Return a property of a node at some times, as players interpolate it: (T, C)."""
        stored = self.document["nodes"][number].get(path, default)
        keys, values = self.keys(number, path) or (np.zeros(1), np.reshape(stored, (1, -1)))
        if len(keys) == 1:
            return np.tile(np.float64(values), (len(times_s), 1))
        times_s = np.clip(times_s, keys[0], keys[-1])
        if path == "rotation":
            return Slerp(keys, Rotation.from_quat(values))(times_s).as_quat()
        return np.stack([np.interp(times_s, keys, column) for column in values.T], axis=1)

    def poses(self, times_s):
        """Return the matrices from nodes to world space at some times, of shape (N, T, 4, 4)."""
        nodes = self.document["nodes"]
        parents = {child: i for i, node in enumerate(nodes) for child in node.get("children", [])}
        local = np.tile(np.eye(4), (len(nodes), len(times_s), 1, 1))
        for number, matrices in enumerate(local):
            turns = Rotation.from_quat(self.sampled(number, "rotation", times_s, [0, 0, 0, 1]))
            scales = self.sampled(number, "scale", times_s, [1, 1, 1])
            matrices[:, :3, :3] = turns.as_matrix() * scales[:, np.newaxis]
            matrices[:, :3, 3] = self.sampled(number, "translation", times_s, [0, 0, 0])

        def world(number):
            above = parents.get(number)
            return local[number] if above is None else world(above) @ local[number]

        return np.stack([world(number) for number in range(len(nodes))])

    def skinned(self, times_s):
        """Return the positions of all skinned meshes at some times, in order: (T, N, 3)."""
        poses, frames = self.poses(times_s), []
        for number, node in enumerate(self.document["nodes"]):
            if "skin" not in node:
                continue
            skin, mesh = self.document["skins"][node["skin"]], self.document["meshes"][node["mesh"]]
            binds = self.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
            bones = poses[skin["joints"]] @ binds[:, np.newaxis]
            for primitive in mesh["primitives"]:
                names = primitive["attributes"]
                points = np.tile(self.array(names["POSITION"]), (len(times_s), 1, 1))
                for target, weights in zip(
                    primitive.get("targets", []),
                    self.sampled(number, "weights", times_s, mesh.get("weights", [])).T,
                    strict=True,
                ):
                    points = points + weights[:, np.newaxis, np.newaxis] * self.array(
                        target["POSITION"]
                    )
                shares, joints = self.array(names["WEIGHTS_0"]), self.array(names["JOINTS_0"])
                blended = np.einsum("vj,vjtab->tvab", shares, bones[joints])
                homogeneous = np.insert(points, 3, 1, axis=2)
                frames.append(np.einsum("tvab,tvb->tva", blended, homogeneous)[..., :3])
        return np.concatenate(frames, axis=1)

    def morphed(self, name, attribute="POSITION"):
        """Return values of all frames and primitives, of shape (T, N, 3), in node space."""
        animated = self.weights(name)
        weights = np.zeros((1, 0)) if animated is None else animated[1].astype(np.float64)
        frames = []
        for primitive in self.primitives(name):
            base = self.array(primitive["attributes"][attribute]).astype(np.float64)
            targets = [self.array(one[attribute]) for one in primitive.get("targets", [])]
            moves = np.reshape(targets, (len(targets), base.size))
            frames.append(base + (weights @ moves).reshape(len(weights), *base.shape))
        return np.concatenate(frames, axis=1)

    def world(self, name):
        """Return the positions of all frames in world space."""
        positions = self.morphed(name)
        chain = [self.document["nodes"].index(self.node(name))]
        while above := [
            number
            for number, node in enumerate(self.document["nodes"])
            if chain[-1] in node.get("children", [])
        ]:
            chain += above
        for number in chain:
            node = self.document["nodes"][number]
            positions = positions * node.get("scale", [1, 1, 1]) + node.get("translation", 0)
        return positions

    def triangles(self, name):
        """Return the triangles of all primitives, with joint vertex numbers."""
        result, start = [], 0
        for primitive in self.primitives(name):
            indices = self.array(primitive["indices"]).astype(int).reshape(-1, 3)
            result.append(indices + start)
            start += len(self.array(primitive["attributes"]["POSITION"]))
        return np.concatenate(result)


def largest_error_percent(sequence, positions):
    """Return the largest vertex error, in percent of the diagonal."""
    vertices = sequence.vertices.astype(np.float64)
    diagonal = np.linalg.norm(vertices.max(axis=(0, 1)) - vertices.min(axis=(0, 1)))
    return 100 * np.linalg.norm(positions - vertices, axis=2).max() / diagonal


def nearest_trajectories(vertices, positions):
    """Return, for each vertex of a file, the number of the vertex that moves most alike."""
    original, found = (
        np.moveaxis(frames, 1, 0).reshape(frames.shape[1], -1) for frames in (vertices, positions)
    )
    return KDTree(original).query(found)[1]
