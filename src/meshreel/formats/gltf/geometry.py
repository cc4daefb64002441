"""Reading a glTF mesh at rest, with vertices welded that were split at seams."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.container import read_varint
from meshreel.errors import FormatError, MeshReelError
from meshreel.formats.gltf.accessors import WIDTHS, Accessors, Values, declared_type
from meshreel.formats.gltf.document import DRACO
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.material_reading import MaterialReader
from meshreel.formats.gltf.primitives import (
    Block,
    block_key,
    count_targets,
    read_attributes,
    read_block,
    read_triangles,
    triangle_primitives,
)
from meshreel.formats.gltf.skinning import Influences, read_influences
from meshreel.formats.surfaces.hard_edges import HardEdges, NormalNotes, find_hard_edges
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.surfaces.welding import SplitMesh, weld_rows
from meshreel.model.sequence import Faces
from meshreel.model.surface import Attribute, Domain, FaceGroups, Surface
from meshreel.runtime.counting import counted
from meshreel.runtime.extras import DRACO as LIBRARY

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
