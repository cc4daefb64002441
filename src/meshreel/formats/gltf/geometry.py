"""A glTF mesh at rest: what it is made of, with vertices that were split at seams welded."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.container import read_varint
from meshreel.errors import FormatError, MeshReelError
from meshreel.formats.extras import DRACO as LIBRARY
from meshreel.formats.gltf.accessors import WIDTHS, Accessors, Values, declared_type
from meshreel.formats.gltf.attributes import SplitMesh, read_attributes
from meshreel.formats.gltf.document import DRACO
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.material_reading import MaterialReader
from meshreel.formats.gltf.primitives import (
    Block,
    block_key,
    count_targets,
    read_block,
    read_triangles,
    surfaces,
)
from meshreel.formats.gltf.skinning import Influences, read_influences
from meshreel.formats.surfaces.hard_edges import HardEdges, NormalNotes, find_hard_edges
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.surfaces.welding import weld_rows
from meshreel.model.sequence import Faces
from meshreel.model.surface import Attribute, Domain, FaceGroups, Surface
from meshreel.runtime.counting import counted

HEAD = b"DRACO\x02\x02\x01"
"""Of a triangle mesh in the bitstream 2.2, the only one that glTF allows."""

HEAD_BYTES = 11

SEQUENTIAL = 0


@dataclass(frozen=True, eq=False)
class Geometry:
    """A mesh at rest.

    Attributes
    ----------
    positions : float array of shape (V, 3)
    displacements : tuple of float arrays of shape (V, 3)
        By each morph target; None where it has none.
    influences : Influences, optional
        Of joints; None for a mesh that no skin can move.
    faces : int32 array of shape (M, 3)
    surface : Surface
        Attributes and materials.
    n_split : int
        Number of vertices in the file, where they are split at seams.
    """

    positions: npt.NDArray[Any]
    displacements: tuple[npt.NDArray[Any] | None, ...]
    influences: Influences | None
    faces: Faces
    surface: Surface
    n_split: int

    def morphed(self, weights: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Positions moved by the morph targets, of shape (V, 3)."""
        positions = self.positions.astype(np.float64)
        for weight, displacement in zip(weights, self.displacements, strict=True):
            if displacement is not None and weight != 0:
                positions += np.multiply(displacement, weight, dtype=np.float64)
        return positions

    def mirrored(self) -> "Geometry":
        """The mesh whose faces are turned, as a transform that mirrors asks for."""
        attributes = tuple(_turned(one) for one in self.surface.attributes)
        faces = np.ascontiguousarray(turned(self.faces))
        return replace(self, faces=faces, surface=replace(self.surface, attributes=attributes))


def read_geometry(
    mesh: JsonObject,
    accessors: Accessors,
    materials: MaterialReader,
    notes: list[str],
    normal_notes: NormalNotes,
) -> Geometry:
    """A mesh of the file, of the primitives that are made of triangles.

    Vertices that coincide however the mesh moves, as files have them at seams of texture
    coordinates or normals, become one; vertices stay in the order of the file.

    Parameters
    ----------
    mesh : JsonObject
        With at least one such primitive.
    materials : MaterialReader
        Those of the file.
    notes : list of str
        Gains a sentence for each attribute that was left out or made up.
    normal_notes : NormalNotes
        Told what became of its normals.
    """
    count_targets(mesh)
    blocks, triangles, numbers = _read_primitives(mesh, accessors, len(materials.labels))
    positions = np.concatenate([one.values["POSITION"].floats() for one in blocks])
    displacements = tuple(_join(blocks, number) for number in range(len(blocks[0].displacements)))
    influences = read_influences(blocks, mesh.place)
    still = [] if influences is None else [influences.joints, influences.weights]
    moving = [positions, *(one for one in displacements if one is not None)]
    vertex_of, first = weld_rows([*(one + 0 for one in moving), *still])
    split = SplitMesh(vertex_of, first, triangles.ravel())
    attributes = read_attributes(blocks, split, mesh.place, notes)
    groups = _groups(numbers, materials.labels)
    faces = vertex_of[triangles].astype(np.int32)
    hard = _hard_edges(blocks, triangles, positions[first], faces)
    if hard is not None:
        normal_notes.add(mesh.place, hard)
    look = materials.look(int(one) for one in np.unique(numbers) if one >= 0)
    return Geometry(
        positions[first],
        tuple(None if one is None else one[first] for one in displacements),
        None if influences is None else influences.of(first),
        faces,
        Surface(None, attributes, groups, (), *look, None if hard is None else hard.edges),
        len(vertex_of),
    )


def _read_primitives(
    mesh: JsonObject, accessors: Accessors, n_materials: int
) -> tuple[list[Block], npt.NDArray[np.int64], npt.NDArray[np.int32]]:
    """Blocks, triangles in the vertices of all of them, and the material of each; -1 is none."""
    blocks: dict[str, tuple[int, Block]] = {}
    n_verts, triangles, numbers = 0, [], []
    for primitive in surfaces(mesh):
        packed = decode_draco(primitive, accessors)
        key = block_key(primitive)
        if key not in blocks:
            blocks[key] = n_verts, read_block(primitive, accessors, packed)
            n_verts += blocks[key][1].n_verts
        start, block = blocks[key]
        found = read_triangles(primitive, accessors, packed, block.n_verts)
        material = primitive.index("material", n_materials)
        triangles.append(start + found)
        numbers.append(np.full(len(found), -1 if material is None else material, np.int32))
    return [one for _, one in blocks.values()], np.concatenate(triangles), np.concatenate(numbers)


def _hard_edges(
    blocks: Sequence[Block],
    triangles: npt.NDArray[np.int64],
    positions: npt.NDArray[Any],
    faces: Faces,
) -> HardEdges | None:
    """The hard edges of the mesh at rest; None if no primitive has normals."""
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
    """Displacements of all blocks by a morph target, one after the other."""
    own = [block.displacements[target] for block in blocks]
    if all(one is None for one in own):
        return None
    filled = [
        np.zeros((block.n_verts, 3), np.float32) if one is None else one
        for one, block in zip(own, blocks, strict=True)
    ]
    return np.concatenate(filled)


def _groups(numbers: npt.NDArray[np.int32], labels: Sequence[str]) -> tuple[FaceGroups, ...]:
    """The materials in use, in the order of the file; one without a name is none."""
    used = np.array([one for one in np.unique(numbers) if one >= 0 and labels[one]], np.int64)
    if len(used) == 0:
        return ()
    renumbered = np.full(len(labels) + 1, -1, np.int32)  # the last is of those without any
    renumbered[used] = np.arange(len(used))
    return (FaceGroups("material", tuple(labels[one] for one in used), renumbered[numbers]),)


def turned(triangles: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Triangles of shape (..., 3) seen from the other side."""
    return triangles[..., [0, 2, 1]]


def _turned(attribute: Attribute) -> Attribute:
    if attribute.domain is not Domain.CORNER or attribute.indices is None:
        return attribute
    indices = turned(attribute.indices.reshape(-1, 3)).ravel()
    return replace(attribute, indices=indices)


def decode_draco(primitive: JsonObject, accessors: Accessors) -> dict[str, Values]:
    """The arrays that Draco holds of a primitive, by the name of the attribute, and its "indices".

    Empty if it is not compressed.

    Raises
    ------
    FormatError
        If it cannot be decoded, or is not of the shapes that the file announces.
    """
    packed = primitive.extension(DRACO)
    if packed is None:
        return {}
    names, ids = primitive.needed("attributes"), packed.needed("attributes")
    accessors.document.item(packed, "bufferView", "bufferViews")
    data = bytes(accessors.buffers.view(packed.whole("bufferView"))[0])
    n_corners = accessors.count(primitive, "indices")
    _check_counts(data, accessors.count(names, "POSITION"), n_corners, packed.place)
    accessors.reserve(4 * n_corners, packed.place)
    library = LIBRARY.load()
    try:
        mesh = library.decode(data)
        held = {one["unique_id"]: np.asarray(one["data"]) for one in mesh.attributes}
        corners = np.asarray(mesh.faces).reshape(-1, 1)
    except Exception as error:  # DracoPy raises TypeError, ValueError and types of its own
        raise FormatError(f"{packed.place}: Draco cannot decode it ({error})") from None
    found = {"indices": Values(corners)}
    for name in ids.values:
        accessor = accessors.document.item(names, name, "accessors")
        found[name] = _values(held.get(ids.whole(name)), accessor, packed)
    return found


def _check_counts(data: bytes, n_verts: int, n_corners: int, place: str) -> None:
    """Refuse a stream that announces more than the file does: Draco takes memory for it."""
    if not data.startswith(HEAD) or data[8:9] not in (b"\x00", b"\x01"):
        raise FormatError(f"{place}: is no triangle mesh of Draco 2.2")
    is_sequential = data[8] == SEQUENTIAL
    try:
        first, position = read_varint(data, HEAD_BYTES + (0 if is_sequential else 1))
        second, _ = read_varint(data, position)
    except MeshReelError:
        raise FormatError(f"{place}: ends within the head of its Draco stream") from None
    announced_faces, announced_verts = (first, second) if is_sequential else (second, first)
    if announced_verts > n_verts or announced_faces * 3 > n_corners:
        raise FormatError(
            f"{place}: Draco holds {counted(announced_verts, 'vertex')} and "
            f"{counted(announced_faces, 'face')}; "
            f"the file announces {n_verts} and {n_corners // 3}"
        )


def _values(held: npt.NDArray[Any] | None, accessor: JsonObject, packed: JsonObject) -> Values:
    dtype, width = declared_type(accessor, tuple(WIDTHS))
    expected = accessor.whole("count"), width
    if held is None or held.shape != expected:
        came = "nothing" if held is None else f"values of shape {held.shape}"
        raise FormatError(
            f"{packed.place}: Draco holds {came} for {accessor.place}; expected {expected}"
        )
    return Values(held.astype(dtype), accessor.flag("normalized"))
