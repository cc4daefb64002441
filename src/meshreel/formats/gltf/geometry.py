"""Meshes of a glTF file: primitives are read, welded at seams, and posed by targets and joints."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.codec.bitstream.container import read_varint
from meshreel.errors import FormatError, MeshReelError
from meshreel.formats.gltf.document import (
    DRACO,
    WIDTHS,
    Document,
    JsonObject,
    Values,
    declared_type,
)
from meshreel.formats.surfaces.hard_edges import HardEdges, find_hard_edges
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.surfaces.welding import SplitMesh, weld_rows
from meshreel.model.notes import Notes
from meshreel.model.sequence import Faces
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.runtime.counting import counted
from meshreel.runtime.extras import DRACO as LIBRARY
from meshreel.runtime.threads import chunks, in_threads

Matrices = npt.NDArray[np.float64]

TRIANGLES, STRIP, FAN = 4, 5, 6
N_MODES = 7

ACCESSOR_TYPES = {
    "POSITION": ("VEC3",),
    "NORMAL": ("VEC3",),
    "JOINTS": ("VEC4",),
    "WEIGHTS": ("VEC4",),
    "TEXCOORD": ("VEC2",),
    "COLOR": ("VEC3", "VEC4"),
    "": ("SCALAR", "VEC2", "VEC3", "VEC4"),
}
"""Accessor types of each attribute semantic without set index; empty for application-specific ones,
whose names start with an underscore."""
NUMBERED = re.compile(r"(TEXCOORD|COLOR)_(\d{1,3})")

DRACO_START = b"DRACO\x02\x02\x01"
"""Start of a triangle mesh with bitstream version 2.2, the only one that glTF allows."""
DRACO_HEADER_BYTES = 11

PIECE_FRAMES = 8
"""Frames that a thread poses at once."""


@dataclass(frozen=True, eq=False)
class Block:
    """Vertices shared by primitives, split at seams as in the file."""

    values: dict[str, Values]
    """By attribute name, including "POSITION", all with the same number of rows."""
    displacements: tuple[npt.NDArray[Any] | None, ...]
    """tuple of float arrays of shape (N, 3). Displacements by each morph target; None for a target
    without positions.
    """

    @property
    def n_verts(self) -> int:
        """Number of vertices."""
        return len(self.values["POSITION"].array)


@dataclass(frozen=True, eq=False)
class Influences:
    """The joints that move each vertex, and their weights."""

    joints: npt.NDArray[np.int64]
    """int64 array of shape (V, K). Indices into the joints of a skin; 0 where the weight is 0."""
    weights: npt.NDArray[np.float64]
    """float64 array of shape (V, K). Nonnegative, with row sums of 1."""

    def blend(self, matrices: Matrices) -> Matrices:
        """Return the transform of each vertex, of shape (V, 3, 4), given those of the joints."""
        blended = np.zeros((len(self.joints), 3, 4))
        for joints, weights in zip(self.joints.T, self.weights.T, strict=True):
            blended += weights[:, np.newaxis, np.newaxis] * matrices[joints]
        return blended


@dataclass(frozen=True, eq=False)
class Geometry:
    """A mesh at rest."""

    positions: npt.NDArray[Any]
    """float array of shape (V, 3)."""
    displacements: tuple[npt.NDArray[Any] | None, ...]
    """tuple of float arrays of shape (V, 3). Displacements by each morph target; None for a target
    without positions.
    """
    influences: Influences | None
    """Influences of joints; None for a mesh without joints."""
    faces: Faces
    """int32 array of shape (M, 3)."""
    surface: Surface
    """Attributes, groups and hard edges, without materials."""
    materials: tuple[int, ...]
    """Indices of the materials in use."""
    n_split: int
    """Number of vertices in the file, before welding."""
    hard_edges: HardEdges | None
    """How normals were converted; None for a mesh without normals."""

    def posed(self, weights: Floats, transforms: Matrices) -> npt.NDArray[np.float32]:
        """Return the positions in several frames, of shape (T, V, 3).

        Parameters
        ----------
        weights : float64 array of shape (T, M)
            Weights of the morph targets.
        transforms : float64 array of shape (T, J, 3, 4)
            Transforms of the joints from the bind pose, or of the mesh if J is 1 without joints.
        """
        posed = np.empty((len(weights), *self.positions.shape), np.float32)
        rest = self.positions.astype(np.float64)
        fields = [
            None if field is None else np.asarray(field, np.float64) for field in self.displacements
        ]

        def pose(frames: slice) -> None:
            moved, product = np.empty_like(rest), np.empty_like(rest)
            for index in range(frames.start, frames.stop):
                moved[:] = rest
                for weight, field in zip(weights[index], fields, strict=True):
                    if field is not None and weight != 0:
                        np.multiply(field, weight, out=product)
                        moved += product
                if self.influences is None:
                    matrix = transforms[index, 0]
                    posed[index] = moved @ matrix[:, :3].T + matrix[:, 3]
                else:
                    blended = self.influences.blend(transforms[index])
                    rotated = np.einsum("vij,vj->vi", blended[:, :, :3], moved)
                    posed[index] = rotated + blended[:, :, 3]

        # By frames and not by a matrix product, whose rounding depends on the number of frames.
        in_threads(pose, chunks(len(posed), PIECE_FRAMES))
        return posed

    def with_reversed_faces(self) -> "Geometry":
        """Return the mesh with reversed faces, for a transform that mirrors."""
        attributes = tuple(
            replace(attribute, indices=reversed_triangles(indices.reshape(-1, 3)).ravel())
            if attribute.domain is Domain.CORNER and (indices := attribute.indices) is not None
            else attribute
            for attribute in self.surface.attributes
        )
        faces = np.ascontiguousarray(reversed_triangles(self.faces))
        return replace(self, faces=faces, surface=replace(self.surface, attributes=attributes))


def reversed_triangles(triangles: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return triangles of shape (..., 3) with reversed orientation."""
    return triangles[..., [0, 2, 1]]


def triangle_primitives(mesh: JsonObject) -> list[JsonObject]:
    """Return the primitives of a mesh that consist of triangles and have positions."""
    triangles = []
    for primitive in mesh.children("primitives", "primitive"):
        mode = primitive.index("mode", N_MODES)
        has_positions = "POSITION" in primitive.required_child("attributes")
        if has_positions and (mode is None or mode >= TRIANGLES):
            triangles.append(primitive)
    return triangles


def has_joints(mesh: JsonObject) -> bool:
    """Return whether a mesh can be skinned."""
    return any(
        {"JOINTS_0", "WEIGHTS_0"} <= primitive.required_child("attributes").values.keys()
        for primitive in triangle_primitives(mesh)
    )


def count_targets(mesh: JsonObject) -> int:
    """Return the number of morph targets of a mesh, the same for all of its primitives.

    Raises
    ------
    FormatError
        If primitives differ in it.
    """
    primitives = triangle_primitives(mesh)
    counts = {len(primitive.children("targets", "target")) for primitive in primitives}
    if len(counts) > 1:
        raise FormatError(
            f"{mesh.place}: its primitives have {' or '.join(map(str, sorted(counts)))} morph "
            "targets; expected the same number in all"
        )
    return counts.pop() if counts else 0


def accessor_types(name: str) -> tuple[str, ...]:
    """Return the valid accessor types of an attribute; empty if it is not supported."""
    match = re.fullmatch(r"([A-Z]+)(?:_\d+)?", name)
    semantic = "" if name.startswith("_") else match[1] if match else name
    return ACCESSOR_TYPES.get(semantic, ())


def read_geometry(
    mesh: JsonObject, document: Document, labels: Sequence[str], notes: Notes
) -> Geometry:
    """Return a mesh of the file, from its triangle primitives.

    Vertices that always coincide, split at seams of UVs or normals, are welded; the order of
    vertices is that of the file.

    Parameters
    ----------
    mesh : JsonObject
        A mesh with at least one triangle primitive.
    labels : sequence of str
        Names of the materials of the file; empty for those that form no group.
    notes : Notes
        Gains a sentence for each attribute that is left out or filled in.
    """
    count_targets(mesh)
    blocks, triangles, materials = _read_primitives(mesh, document)
    positions = np.concatenate([block.values["POSITION"].floats() for block in blocks])
    displacements = [
        _join_displacements(blocks, number) for number in range(len(blocks[0].displacements))
    ]
    influences = _read_influences(blocks, mesh.place)
    bound = [] if influences is None else [influences.joints, influences.weights]
    moved = [positions, *(field for field in displacements if field is not None)]
    vertex_of, first = weld_rows([*(rows + 0 for rows in moved), *bound])
    split = SplitMesh(vertex_of, first, triangles.ravel())
    attributes = tuple(_read_attributes(blocks, split, mesh.place, notes))
    faces = vertex_of[triangles].astype(np.int32)
    hard_edges = _find_hard_edges(blocks, triangles, positions[first], faces)
    edges = None if hard_edges is None else hard_edges.edges
    return Geometry(
        positions[first],
        tuple(None if field is None else field[first] for field in displacements),
        influences and Influences(influences.joints[first], influences.weights[first]),
        faces,
        Surface(None, attributes, _material_groups(materials, labels), hard_edges=edges),
        tuple(int(number) for number in np.unique(materials) if number >= 0),
        len(vertex_of),
        hard_edges,
    )


def _read_primitives(
    mesh: JsonObject, document: Document
) -> tuple[list[Block], npt.NDArray[np.int64], npt.NDArray[np.int32]]:
    """Return vertex blocks, triangles into their concatenation, and material indices or -1."""
    blocks: dict[str, tuple[int, Block]] = {}
    n_verts, triangles, materials = 0, [], []
    for primitive in triangle_primitives(mesh):
        decoded = _decode_draco(primitive, document)
        key = repr([primitive.values.get(key) for key in ("attributes", "targets", "extensions")])
        if key not in blocks:
            blocks[key] = n_verts, _read_block(primitive, document, decoded)
            n_verts += blocks[key][1].n_verts
        start, block = blocks[key]
        rows = _read_triangles(primitive, document, decoded, block.n_verts)
        material = primitive.index("material", "materials")
        triangles.append(start + rows)
        materials.append(np.full(len(rows), -1 if material is None else material, np.int32))
    vertices = [block for _, block in blocks.values()]
    return vertices, np.concatenate(triangles), np.concatenate(materials)


def _read_block(primitive: JsonObject, document: Document, decoded: dict[str, Values]) -> Block:
    """Return the vertices of a primitive; arrays decoded from Draco replace accessors."""
    attributes = primitive.required_child("attributes")
    n_verts = attributes.item("POSITION", "accessors").integer("count")
    values = {
        name: decoded[name]
        if name in decoded
        else document.read(attributes, name, *types, count=n_verts)
        for name in attributes.values
        if (types := accessor_types(name))
    }
    targets = primitive.children("targets", "target")
    return Block(values, document.read_each(targets, "POSITION", "VEC3", count=n_verts))


def _read_triangles(
    primitive: JsonObject, document: Document, decoded: dict[str, Values], n_verts: int
) -> npt.NDArray[np.int64]:
    """Return the triangles of a primitive as indices into its block, of shape (M, 3)."""
    if "indices" in decoded:
        corners = decoded["indices"].array[:, 0]
    elif "indices" in primitive:
        corners = document.read(primitive, "indices", "SCALAR").array[:, 0]
    else:
        corners = np.arange(n_verts)
    if corners.dtype.kind not in "iu":
        raise FormatError(f"{primitive.place}: its indices are not integers")
    corners = corners.astype(np.int64)
    if len(corners) and not 0 <= corners.min() <= corners.max() < n_verts:
        raise FormatError(
            f"{primitive.place}: has vertex indices {corners.min()}..{corners.max()}; "
            f"expected 0..{n_verts - 1}"
        )
    mode = TRIANGLES if "indices" in decoded else primitive.integer("mode", TRIANGLES)
    return assemble_triangles(corners, mode)


def assemble_triangles(corners: npt.NDArray[np.int64], mode: int) -> npt.NDArray[np.int64]:
    """Return the triangles of a list, strip or fan of corners, of shape (M, 3).

    Corners after the last complete triangle of a list are ignored, as in rendering.
    """
    if mode == TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    number = np.arange(max(0, len(corners) - 2))
    if mode == FAN:
        return corners[np.stack([number + 1, number + 2, 0 * number], axis=1)]
    # Every other triangle of a strip is reversed, for a consistent orientation.
    odd = number % 2
    return corners[np.stack([number, number + 1 + odd, number + 2 - odd], axis=1)]


def _join_displacements(blocks: Sequence[Block], target: int) -> npt.NDArray[Any] | None:
    """Return the concatenated displacements of all blocks by a morph target, or None."""
    if all(block.displacements[target] is None for block in blocks):
        return None
    stored = [(block.displacements[target], block.n_verts) for block in blocks]
    return np.concatenate(
        [np.zeros((count, 3), np.float32) if field is None else field for field, count in stored]
    )


def _read_influences(blocks: Sequence[Block], place: str) -> Influences | None:
    """Return the influences on the concatenated vertices of all blocks, or None without joints.

    Weights are normalized; a vertex without weights follows its first joint, as in other programs.
    FBX2glTF writes NaN as the weights of such a vertex.
    """
    counts = [_count_joint_sets(block) for block in blocks]
    if not any(counts):
        return None
    if 0 in counts:
        raise FormatError(f"{place}: only some of its primitives have joints")
    n_verts = sum(block.n_verts for block in blocks)
    joints, weights = np.zeros((2, n_verts, 4 * max(counts)))
    start = 0
    for block, count in zip(blocks, counts, strict=True):
        rows = slice(start, start := start + block.n_verts)
        for number in range(count):
            columns = slice(4 * number, 4 * number + 4)
            own_joints = block.values[f"JOINTS_{number}"].array
            if own_joints.dtype.kind != "u":
                raise FormatError(f"JOINTS_{number} must be unsigned integers")
            joints[rows, columns] = own_joints
            own_weights = block.values[f"WEIGHTS_{number}"].floats()
            is_missing = np.isnan(own_weights).all(axis=1, keepdims=True)
            weights[rows, columns] = np.where(is_missing, 0.0, own_weights)
    if not (np.isfinite(weights).all() and (weights >= 0).all()):
        raise FormatError(f"{place}: joint weights must be finite and at least 0")
    weights[weights.max(axis=1) == 0, 0] = 1.0
    weights /= weights.max(axis=1, keepdims=True)  # first, since sums of huge weights overflow
    weights /= weights.sum(axis=1, keepdims=True)
    return Influences(np.where(weights > 0, joints, 0).astype(np.int64), weights)


def _count_joint_sets(block: Block) -> int:
    number = 0
    while {f"JOINTS_{number}", f"WEIGHTS_{number}"} <= block.values.keys():
        number += 1
    return number


def _find_hard_edges(
    blocks: Sequence[Block],
    triangles: npt.NDArray[np.int64],
    positions: npt.NDArray[Any],
    faces: Faces,
) -> HardEdges | None:
    """Return the hard edges of the mesh at rest, or None without normals."""
    if not len(faces) or not any("NORMAL" in block.values for block in blocks):
        return None
    normals = [
        block.values["NORMAL"].floats()
        if "NORMAL" in block.values
        else np.zeros((block.n_verts, 3))
        for block in blocks
    ]
    mesh = PolygonMesh(positions, np.full(len(faces), 3, np.int64), faces.ravel())
    return find_hard_edges(mesh, np.concatenate(normals)[triangles.ravel()])


def _material_groups(
    materials: npt.NDArray[np.int32], labels: Sequence[str]
) -> tuple[FaceGroups, ...]:
    """Return the materials in use, in file order; unnamed ones form no group."""
    stored = np.unique(materials)
    used = np.array([index for index in stored if index >= 0 and labels[index]], np.int64)
    if len(used) == 0:
        return ()
    numbers = np.full(len(labels) + 1, -1, np.int32)  # the last is for faces without a material
    numbers[used] = np.arange(len(used))
    return (FaceGroups("material", tuple(labels[index] for index in used), numbers[materials]),)


def _read_attributes(
    blocks: Sequence[Block], mesh: SplitMesh, place: str, notes: Notes
) -> Iterator[Attribute]:
    """Yield the attributes of concatenated blocks; notes list omitted and filled ones.

    UVs come first, then colors, each by set index, then application-specific attributes.
    """
    ranked: list[tuple[int, int, str]] = []
    for name in {name for block in blocks for name in block.values}:
        if match := NUMBERED.fullmatch(name):
            ranked.append((0 if match[1] == "TEXCOORD" else 1, int(match[2]), name))
        elif name.startswith("_"):
            ranked.append((2, 0, name))
    for rank, number, name in sorted(ranked):
        kind, join = JOINS[rank]
        rows, note = join([block.values.get(name) for block in blocks], blocks)
        if note:
            notes.changed(f"{place}: {name} {note}")
        if rows is not None:
            label = name if kind is Kind.OTHER else set_label(kind, number)
            yield mesh.attribute(label, kind, rows)


def set_label(kind: Kind, number: int) -> str:
    """Return the name of a set of UVs or colors: "uv", "uv1", and so on."""
    return kind.value + (str(number) if number else "")


Joined = tuple[npt.NDArray[Any] | None, str]
"""Concatenated values of all blocks, and a note on them."""


def _join_uvs(stored: Sequence[Values | None], blocks: Sequence[Block]) -> Joined:
    filled = [
        np.zeros((block.n_verts, 2)) if values is None else values.floats()
        for values, block in zip(stored, blocks, strict=True)
    ]
    # In glTF, v points down. Adding zero turns -0.0 into 0.0, for bitwise comparisons.
    flipped = [np.stack([uv[:, 0] + 0.0, 1 - uv[:, 1]], axis=1) for uv in filled]
    note = "is 0 1 on primitives without it" if None in stored else ""
    return np.concatenate(flipped).astype(np.float32), note


def _join_colors(stored: Sequence[Values | None], blocks: Sequence[Block]) -> Joined:
    arrays = [values.array for values in stored if values is not None]
    width = max(array.shape[1] for array in arrays)
    are_bytes = all(array.dtype == np.uint8 for array in arrays)
    white, dtype = (255, np.uint8) if are_bytes else (1, np.float32)
    rows = [np.full((block.n_verts, width), white, dtype) for block in blocks]
    for values, filled in zip(stored, rows, strict=True):
        if values is not None:
            colors = Values(values.array, is_normalized=True).floats() + 0.0
            filled[:, : colors.shape[1]] = values.array if are_bytes else colors
    return np.concatenate(rows), "is white on primitives without it" if None in stored else ""


def _join_custom(stored: Sequence[Values | None], blocks: Sequence[Block]) -> Joined:
    present = [values for values in stored if values is not None]
    types = {(each.array.dtype, each.array.shape[1], each.is_normalized) for each in present}
    if len(types) > 1 or len(present) < len(blocks):
        return None, "is left out, since not all primitives have it with the same type"
    rows = np.concatenate([each.floats() if each.is_normalized else each.array for each in present])
    if rows.dtype == np.uint8:
        return rows, ""
    if rows.dtype.kind == "f":
        return rows.astype(np.float32) + np.float32(0), ""
    return rows.astype(np.float64 if rows.dtype == np.uint32 else np.int32), ""


Join = Callable[[Sequence[Values | None], Sequence[Block]], Joined]
JOINS: tuple[tuple[Kind, Join], ...] = (
    (Kind.UV, _join_uvs),
    (Kind.COLOR, _join_colors),
    (Kind.OTHER, _join_custom),
)


def _decode_draco(primitive: JsonObject, document: Document) -> dict[str, Values]:
    """Return the Draco-compressed arrays of a primitive, by attribute name and "indices".

    The result is empty if the primitive is not compressed.
    """
    compressed = primitive.extension(DRACO)
    if compressed is None:
        return {}
    names, ids = primitive.required_child("attributes"), compressed.required_child("attributes")
    data = bytes(document.view(compressed)[0])
    n_corners = primitive.item("indices", "accessors").integer("count")
    n_verts = names.item("POSITION", "accessors").integer("count")
    _check_draco_counts(data, n_verts, n_corners, compressed.place)
    document.reserve(4 * n_corners, compressed.place)
    library = LIBRARY.load()
    try:
        mesh = library.decode(data)
        arrays = {each["unique_id"]: np.asarray(each["data"]) for each in mesh.attributes}
        decoded = {"indices": Values(np.asarray(mesh.faces).reshape(-1, 1))}
    except Exception as error:  # DracoPy raises TypeError, ValueError and its own types
        raise FormatError(f"{compressed.place}: Draco cannot decode it ({error})") from None
    for name in ids.values:
        accessor, array = names.item(name, "accessors"), arrays.get(ids.integer(name))
        dtype, width = declared_type(accessor, tuple(WIDTHS))
        expected = accessor.integer("count"), width
        if array is None or array.shape != expected:
            description = "no values" if array is None else f"values of shape {array.shape}"
            raise FormatError(
                f"{compressed.place}: the Draco stream has {description} for {accessor.place}; "
                f"expected {expected}"
            )
        decoded[name] = Values(array.astype(dtype), accessor.flag("normalized"))
    return decoded


def _check_draco_counts(data: bytes, n_verts: int, n_corners: int, place: str) -> None:
    """Reject a stream with larger counts than the file declares, which Draco would allocate."""
    if not data.startswith(DRACO_START) or data[8:9] not in (b"\x00", b"\x01"):
        raise FormatError(f"{place}: is not a triangle mesh of Draco 2.2")
    is_sequential = data[8] == 0
    try:
        first, position = read_varint(data, DRACO_HEADER_BYTES + (0 if is_sequential else 1))
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
