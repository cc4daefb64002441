"""Meshes of a glTF file at rest: primitives, attributes, joint weights, and welded seams."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.container import read_varint
from meshreel.errors import FormatError, MeshReelError
from meshreel.formats.gltf.accessors import WIDTHS, Accessors, Values, declared_type
from meshreel.formats.gltf.document import DRACO, JsonObject
from meshreel.formats.gltf.materials import MaterialReader
from meshreel.formats.gltf.primitives import (
    Block,
    block_key,
    count_targets,
    read_attributes,
    read_block,
    read_triangles,
    triangle_primitives,
)
from meshreel.formats.surfaces.hard_edges import HardEdges, NormalNotes, find_hard_edges
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.surfaces.welding import SplitMesh, weld_rows
from meshreel.model.sequence import Faces
from meshreel.model.surface import Attribute, Domain, FaceGroups, Surface
from meshreel.runtime.counting import counted
from meshreel.runtime.extras import DRACO as LIBRARY

Matrices = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Skin:
    """The joints to which a mesh is bound.

    Attributes
    ----------
    joints : list of int
        Nodes of the joints.
    inverse_binds : float64 array of shape (J, 4, 4)
        Transforms from the bind pose to each joint.
    """

    joints: list[int]
    inverse_binds: Matrices


@dataclass(frozen=True, eq=False)
class Influences:
    """The joints that move each vertex, and their weights.

    Attributes
    ----------
    joints : int64 array of shape (V, K)
        Indices into the joints of a skin; 0 where the weight is 0.
    weights : float64 array of shape (V, K)
        Nonnegative, with row sums of 1.
    """

    joints: npt.NDArray[np.int64]
    weights: npt.NDArray[np.float64]

    def select(self, rows: npt.NDArray[np.int64]) -> "Influences":
        """Return the influences on some of the vertices."""
        return Influences(self.joints[rows], self.weights[rows])

    def blend(self, matrices: Matrices) -> Matrices:
        """Return the blended transform of each vertex, of shape (V, 3, 4).

        Parameters
        ----------
        matrices : float64 array of shape (J, 3, 4)
            Transforms of the joints from the bind pose to the current pose.
        """
        blended = np.zeros((len(self.joints), 3, 4))
        for joints, weights in zip(self.joints.T, self.weights.T, strict=True):
            blended += weights[:, np.newaxis, np.newaxis] * matrices[joints]
        return blended


def read_skin(skin: JsonObject, accessors: Accessors) -> Skin:
    """Return a skin of the file.

    Raises
    ------
    FormatError
        If it has no joints, or fewer matrices than joints.
    """
    joints = skin.indices("joints", len(accessors.document.lists["nodes"]))
    if not joints:
        raise skin.error("joints", "a list of at least one node")
    if "inverseBindMatrices" not in skin:
        return Skin(joints, np.tile(np.eye(4), (len(joints), 1, 1)))
    columns = accessors.read(skin, "inverseBindMatrices", "MAT4").floats().astype(np.float64)
    if len(columns) < len(joints) or not np.isfinite(columns).all():
        raise FormatError(
            f"{skin.place}: has {len(columns)} inverse bind matrices for {len(joints)} joints; "
            "expected one finite matrix per joint"
        )
    return Skin(joints, columns[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1))


def read_influences(blocks: Sequence[Block], place: str) -> Influences | None:
    """Return the influences on the concatenated vertices of all blocks, or None without joints.

    Weights are normalized; a vertex without weights follows its first joint, as in other programs.

    Raises
    ------
    FormatError
        If only some blocks have joints, or a weight is negative or not finite.
    """
    n_sets = {_count_sets(block) for block in blocks}
    if n_sets == {0}:
        return None
    if 0 in n_sets:
        raise FormatError(f"{place}: only some of its primitives have joints")
    width = 4 * max(n_sets)
    joints = np.concatenate([_joined_sets(block, "JOINTS", width) for block in blocks])
    weights = np.concatenate([_joined_sets(block, "WEIGHTS", width) for block in blocks])
    if not (np.isfinite(weights).all() and (weights >= 0).all()):
        raise FormatError(f"{place}: joint weights must be finite and at least 0")
    weights[weights.max(axis=1) == 0, 0] = 1.0
    weights /= weights.max(axis=1, keepdims=True)  # first, since sums of huge weights overflow
    weights /= weights.sum(axis=1, keepdims=True)
    return Influences(np.where(weights > 0, joints, 0).astype(np.int64), weights)


def transform_points(
    positions: npt.NDArray[np.float64], transforms: Matrices
) -> npt.NDArray[np.float64]:
    """Return positions of shape (V, 3), transformed by (3, 4) or (V, 3, 4) matrices."""
    if transforms.ndim == 2:
        return positions @ transforms[:, :3].T + transforms[:, 3]
    moved: npt.NDArray[np.float64] = np.einsum("vij,vj->vi", transforms[:, :, :3], positions)
    return moved + transforms[:, :, 3]


def _count_sets(block: Block) -> int:
    number = 0
    while {f"JOINTS_{number}", f"WEIGHTS_{number}"} <= block.values.keys():
        number += 1
    return number


def _joined_sets(block: Block, name: str, width: int) -> npt.NDArray[Any]:
    """Return all sets of joints or weights side by side, padded with zeros to `width` columns."""
    joined = np.zeros((block.n_verts, width))
    for number in range(_count_sets(block)):
        values = block.values[f"{name}_{number}"]
        if name == "JOINTS" and values.array.dtype.kind != "u":
            raise FormatError(f"{name}_{number} must be unsigned integers")
        array = values.array if name == "JOINTS" else values.floats()
        joined[:, 4 * number : 4 * number + 4] = array
    return joined


HEADER_START = b"DRACO\x02\x02\x01"
"""Start of a triangle mesh with bitstream version 2.2, the only one that glTF allows."""

HEADER_BYTES = 11

SEQUENTIAL = 0


@dataclass(frozen=True, eq=False)
class Geometry:
    """A mesh at rest.

    Attributes
    ----------
    positions : float array of shape (V, 3)
    displacements : tuple of float arrays of shape (V, 3)
        Displacements by each morph target; None for a target without positions.
    influences : Influences, optional
        Influences of joints; None for a mesh without joints.
    faces : int32 array of shape (M, 3)
    surface : Surface
        Attributes and materials.
    n_split : int
        Number of vertices in the file, before welding.
    """

    positions: npt.NDArray[Any]
    displacements: tuple[npt.NDArray[Any] | None, ...]
    influences: Influences | None
    faces: Faces
    surface: Surface
    n_split: int

    def morphed(self, weights: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return the positions with morph targets applied, of shape (V, 3)."""
        positions = self.positions.astype(np.float64)
        for weight, displacement in zip(weights, self.displacements, strict=True):
            if displacement is not None and weight != 0:
                positions += np.multiply(displacement, weight, dtype=np.float64)
        return positions

    def with_reversed_faces(self) -> "Geometry":
        """Return the mesh with reversed faces, for a transform that mirrors."""
        attributes = tuple(_reversed_attribute(one) for one in self.surface.attributes)
        faces = np.ascontiguousarray(reversed_triangles(self.faces))
        return replace(self, faces=faces, surface=replace(self.surface, attributes=attributes))


def read_geometry(
    mesh: JsonObject,
    accessors: Accessors,
    materials: MaterialReader,
    notes: list[str],
    normal_notes: NormalNotes,
) -> Geometry:
    """Return a mesh of the file, from its triangle primitives.

    Vertices that always coincide, split at seams of UVs or normals, are welded; the order of
    vertices is that of the file.

    Parameters
    ----------
    mesh : JsonObject
        A mesh with at least one triangle primitive.
    accessors : Accessors
    materials : MaterialReader
        Materials of the file.
    notes : list of str
        Gains a sentence for each attribute that is left out or filled in.
    normal_notes : NormalNotes
        Collects how normals are treated.
    """
    count_targets(mesh)
    blocks, triangles, numbers = _read_primitives(mesh, accessors, len(materials.labels))
    positions = np.concatenate([one.values["POSITION"].floats() for one in blocks])
    displacements = tuple(_join(blocks, number) for number in range(len(blocks[0].displacements)))
    influences = read_influences(blocks, mesh.place)
    bound = [] if influences is None else [influences.joints, influences.weights]
    animated = [positions, *(one for one in displacements if one is not None)]
    vertex_of, first = weld_rows([*(one + 0 for one in animated), *bound])
    split = SplitMesh(vertex_of, first, triangles.ravel())
    attributes = read_attributes(blocks, split, mesh.place, notes)
    groups = _groups(numbers, materials.labels)
    faces = vertex_of[triangles].astype(np.int32)
    hard_edges = _hard_edges(blocks, triangles, positions[first], faces)
    if hard_edges is not None:
        normal_notes.add(mesh.place, hard_edges)
    look = materials.look(int(one) for one in np.unique(numbers) if one >= 0)
    return Geometry(
        positions[first],
        tuple(None if one is None else one[first] for one in displacements),
        None if influences is None else influences.select(first),
        faces,
        Surface(
            None, attributes, groups, (), *look, None if hard_edges is None else hard_edges.edges
        ),
        len(vertex_of),
    )


def _read_primitives(
    mesh: JsonObject, accessors: Accessors, n_materials: int
) -> tuple[list[Block], npt.NDArray[np.int64], npt.NDArray[np.int32]]:
    """Return vertex blocks, triangles into their concatenation, and material indices or -1."""
    blocks: dict[str, tuple[int, Block]] = {}
    n_verts, triangles, numbers = 0, [], []
    for primitive in triangle_primitives(mesh):
        decoded = decode_draco(primitive, accessors)
        key = block_key(primitive)
        if key not in blocks:
            blocks[key] = n_verts, read_block(primitive, accessors, decoded)
            n_verts += blocks[key][1].n_verts
        start, block = blocks[key]
        rows = read_triangles(primitive, accessors, decoded, block.n_verts)
        material = primitive.index("material", n_materials)
        triangles.append(start + rows)
        numbers.append(np.full(len(rows), -1 if material is None else material, np.int32))
    return [one for _, one in blocks.values()], np.concatenate(triangles), np.concatenate(numbers)


def _hard_edges(
    blocks: Sequence[Block],
    triangles: npt.NDArray[np.int64],
    positions: npt.NDArray[Any],
    faces: Faces,
) -> HardEdges | None:
    """Return the hard edges of the mesh at rest, or None without normals."""
    if not len(faces) or not any("NORMAL" in one.values for one in blocks):
        return None
    normals = [
        one.values["NORMAL"].floats() if "NORMAL" in one.values else np.zeros((one.n_verts, 3))
        for one in blocks
    ]
    counts = np.full(len(faces), 3, np.int64)
    mesh = PolygonMesh(positions, counts, faces.ravel())
    return find_hard_edges(mesh, np.concatenate(normals)[triangles.ravel()])


def _join(blocks: Sequence[Block], target: int) -> npt.NDArray[Any] | None:
    """Return the concatenated displacements of all blocks by a morph target, or None."""
    stored = [block.displacements[target] for block in blocks]
    if all(one is None for one in stored):
        return None
    filled = [
        np.zeros((block.n_verts, 3), np.float32) if one is None else one
        for one, block in zip(stored, blocks, strict=True)
    ]
    return np.concatenate(filled)


def _groups(numbers: npt.NDArray[np.int32], labels: Sequence[str]) -> tuple[FaceGroups, ...]:
    """Return the materials in use, in file order; unnamed ones form no group."""
    used = np.array([one for one in np.unique(numbers) if one >= 0 and labels[one]], np.int64)
    if len(used) == 0:
        return ()
    with_indices = np.full(
        len(labels) + 1, -1, np.int32
    )  # the last entry is for faces without a material
    with_indices[used] = np.arange(len(used))
    return (FaceGroups("material", tuple(labels[one] for one in used), with_indices[numbers]),)


def reversed_triangles(triangles: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return triangles of shape (..., 3) with reversed orientation."""
    return triangles[..., [0, 2, 1]]


def _reversed_attribute(attribute: Attribute) -> Attribute:
    if attribute.domain is not Domain.CORNER or attribute.indices is None:
        return attribute
    indices = reversed_triangles(attribute.indices.reshape(-1, 3)).ravel()
    return replace(attribute, indices=indices)


def decode_draco(primitive: JsonObject, accessors: Accessors) -> dict[str, Values]:
    """Return the Draco-compressed arrays of a primitive, by attribute name and "indices".

    The result is empty if the primitive is not compressed.

    Raises
    ------
    FormatError
        If the data cannot be decoded, or do not have the declared shapes.
    """
    compressed = primitive.extension(DRACO)
    if compressed is None:
        return {}
    names, ids = primitive.required_child("attributes"), compressed.required_child("attributes")
    accessors.document.item(compressed, "bufferView", "bufferViews")
    data = bytes(accessors.buffers.view(compressed.integer("bufferView"))[0])
    n_corners = accessors.count(primitive, "indices")
    _check_counts(data, accessors.count(names, "POSITION"), n_corners, compressed.place)
    accessors.reserve(4 * n_corners, compressed.place)
    library = LIBRARY.load()
    try:
        mesh = library.decode(data)
        decoded = {one["unique_id"]: np.asarray(one["data"]) for one in mesh.attributes}
        corners = np.asarray(mesh.faces).reshape(-1, 1)
    except Exception as error:  # DracoPy raises TypeError, ValueError and its own types
        raise FormatError(f"{compressed.place}: Draco cannot decode it ({error})") from None
    decoded_values = {"indices": Values(corners)}
    for name in ids.values:
        accessor = accessors.document.item(names, name, "accessors")
        decoded_values[name] = _values(decoded.get(ids.integer(name)), accessor, compressed)
    return decoded_values


def _check_counts(data: bytes, n_verts: int, n_corners: int, place: str) -> None:
    """Reject a stream with larger counts than the file declares, which Draco would allocate."""
    if not data.startswith(HEADER_START) or data[8:9] not in (b"\x00", b"\x01"):
        raise FormatError(f"{place}: is not a triangle mesh of Draco 2.2")
    is_sequential = data[8] == SEQUENTIAL
    try:
        first, position = read_varint(data, HEADER_BYTES + (0 if is_sequential else 1))
        second, _ = read_varint(data, position)
    except MeshReelError:
        raise FormatError(f"{place}: ends within the header of its Draco stream") from None
    n_draco_faces, n_draco_verts = (first, second) if is_sequential else (second, first)
    if n_draco_verts > n_verts or n_draco_faces * 3 > n_corners:
        raise FormatError(
            f"{place}: the Draco stream has {counted(n_draco_verts, 'vertex')} and "
            f"{counted(n_draco_faces, 'face')}; "
            f"the file declares {n_verts} and {n_corners // 3}"
        )


def _values(
    decoded: npt.NDArray[Any] | None, accessor: JsonObject, compressed: JsonObject
) -> Values:
    dtype, width = declared_type(accessor, tuple(WIDTHS))
    expected = accessor.integer("count"), width
    if decoded is None or decoded.shape != expected:
        description = "no values" if decoded is None else f"values of shape {decoded.shape}"
        raise FormatError(
            f"{compressed.place}: the Draco stream has {description} for {accessor.place}; "
            f"expected {expected}"
        )
    return Values(decoded.astype(dtype), accessor.flag("normalized"))
