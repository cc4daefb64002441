"""Reading meshes of a glTF file: primitives, joined and welded at seams, and joint influences."""

import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.container import read_varint
from meshreel.errors import FormatError, MeshReelError
from meshreel.formats.gltf.document import (
    DRACO,
    FAN,
    TRIANGLES,
    WIDTHS,
    Document,
    JsonObject,
    Mesh,
    Values,
    declared_type,
)
from meshreel.formats.gltf.materials import MaterialReader, set_label
from meshreel.formats.gltf.scene import Geometry, Influences
from meshreel.formats.surfaces.hard_edges import HardEdges, NormalNotes, find_hard_edges
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.surfaces.welding import SplitMesh, weld_rows
from meshreel.model.colors import colors_of_linear
from meshreel.model.notes import Notes
from meshreel.model.sequence import Faces
from meshreel.model.surface import Attribute, FaceGroups, Kind, Surface
from meshreel.runtime.counting import counted
from meshreel.runtime.extras import DRACO as LIBRARY

WELDED = "welded vertices"
"""Subject of the note on vertices that are split at seams in the file."""

ACCESSOR_TYPES: dict[str, tuple[str, ...]] = {
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


@dataclass(frozen=True, eq=False)
class Block:
    """Vertices shared by primitives, split at seams as in the file."""

    positions: npt.NDArray[Any]
    """float array of shape (N, 3)."""
    values: dict[str, Values]
    """Other values by attribute name, all with the same number of rows."""
    displacements: tuple[npt.NDArray[Any] | None, ...]
    """tuple of float arrays of shape (N, 3). Displacements by each morph target; None for a target
    without positions.
    """


class GeometryReader:
    """Reads each mesh of a file at rest, once.

    Parameters
    ----------
    notes : list of str
        Gains a sentence for everything that is left out, filled in or welded.

    Attributes
    ----------
    read : callable
        Returns a mesh with at least one triangle primitive, with its materials.
    """

    def __init__(self, document: Document, notes: Notes) -> None:
        self._document, self._notes = document, notes
        self._materials, self._normal_notes = MaterialReader(document, notes), NormalNotes(notes)
        self._n_split = self._n_welded = 0
        self.read: Callable[[Mesh], Geometry] = cache(self._read)

    def _read(self, mesh: Mesh) -> Geometry:
        geometry = read_geometry(mesh, self._document, self._materials.labels, self._notes)
        if geometry.hard_edges is not None:
            self._normal_notes.add(mesh.json.place, geometry.hard_edges)
        if geometry.materials:
            look, images = self._materials.look(geometry.materials)
            surface = replace(geometry.surface, materials=look, images=images)
            geometry = replace(geometry, surface=surface)
        if geometry.n_split > len(geometry.positions):
            self._n_split += geometry.n_split
            self._n_welded += len(geometry.positions)
            n_split = counted(self._n_split, "vertex")
            self._notes.discard(WELDED)  # one note counts the vertices of all meshes so far
            text = f"welded {n_split}, split at seams, to {self._n_welded}"
            self._notes.changed(WELDED, text)
        return geometry


def accessor_types(name: str) -> tuple[str, ...]:
    """Return the valid accessor types of an attribute; empty if it is not supported."""
    match = re.fullmatch(r"([A-Z]+)(?:_\d+)?", name)
    semantic = "" if name.startswith("_") else match[1] if match else name
    return ACCESSOR_TYPES.get(semantic, ())


def read_geometry(mesh: Mesh, document: Document, labels: Sequence[str], notes: Notes) -> Geometry:
    """Return a mesh of the file, from its triangle primitives.

    Vertices that always coincide, split at seams of UVs or normals, are welded; the order of
    vertices is that of the file.

    Parameters
    ----------
    mesh : Mesh
        A mesh with at least one triangle primitive.
    labels : sequence of str
        Names of the materials of the file; empty for those that form no group.
    notes : Notes
        Gains a sentence for each attribute that is left out or filled in.
    """
    blocks, triangles, materials = _read_primitives(mesh, document)
    positions = np.concatenate([block.positions for block in blocks])
    displacements = [
        np.concatenate(
            [
                np.zeros_like(block.positions, np.float32) if field is None else field
                for block, field in zip(blocks, fields, strict=True)
            ]
        )
        if any(field is not None for field in fields)
        else None
        for fields in zip(*(block.displacements for block in blocks), strict=True)
    ]
    influences = _read_influences(blocks, mesh.json.place) if "JOINTS_0" in mesh.names else None
    influence_arrays = [] if influences is None else [influences.joints, influences.weights]
    fields = [positions, *(field for field in displacements if field is not None)]
    vertex_of, first = weld_rows([*(rows + 0 for rows in fields), *influence_arrays])
    split = SplitMesh(vertex_of, first, triangles.ravel())
    attributes = tuple(_read_attributes(blocks, split, mesh.json.place, notes))
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
    mesh: Mesh, document: Document
) -> tuple[list[Block], npt.NDArray[np.int64], npt.NDArray[np.int32]]:
    """Return vertex blocks, triangles into their concatenation, and material indices or -1."""
    kinds = {name: types for name in mesh.names if (types := accessor_types(name))}
    blocks: dict[str, tuple[int, Block]] = {}
    n_verts, triangles, materials = 0, [], []
    n_targets = mesh.n_targets  # before reading, since primitives may differ in it
    for primitive in mesh.triangles:
        json, attributes = primitive.json, primitive.attributes.values
        compressed = json.extension(DRACO)
        decoded = {} if compressed is None else _decode_draco(json, compressed, document)
        key = repr((attributes, json.values.get("targets"), json.values.get("extensions")))
        count = primitive.attributes.item("POSITION", "accessors").integer("count")
        for target in primitive.targets[:n_targets] if "NORMAL" in attributes else ():
            target.get("NORMAL")  # those of each frame follow from its positions
        if key not in blocks:
            values = document.read_named(primitive.attributes, kinds, decoded, count=count)
            positions = values.pop("POSITION").floats()
            displacements = document.read_each(
                primitive.targets[:n_targets], "POSITION", "VEC3", count=count
            )
            blocks[key] = n_verts, Block(positions, values, displacements)
            n_verts += count
        if "indices" in decoded:
            corners = decoded["indices"].array[:, 0]
        elif "indices" in json.values:
            corners = document.read(json, "indices", "SCALAR").array[:, 0]
        else:
            corners = np.arange(count)
        mode, material = TRIANGLES if decoded else primitive.mode, primitive.material
        triangles.append(blocks[key][0] + _valid_triangles(corners, mode, count, json.place))
        materials.append(
            np.full(len(triangles[-1]), -1 if material is None else material, np.int32)
        )
    vertices = [block for _, block in blocks.values()]
    return vertices, np.concatenate(triangles), np.concatenate(materials)


def _valid_triangles(
    corners: npt.NDArray[Any], mode: int, n_verts: int, place: str
) -> npt.NDArray[np.int64]:
    """Return the triangles of corners as indices below the number of vertices, of shape (M, 3)."""
    if corners.dtype.kind not in "iu":
        raise FormatError(f"{place}: its indices are not integers")
    corners = corners.astype(np.int64)
    if len(corners) and not 0 <= corners.min() <= corners.max() < n_verts:
        raise FormatError(
            f"{place}: has vertex indices {corners.min()}..{corners.max()}; "
            f"expected 0..{n_verts - 1}"
        )
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


def _read_influences(blocks: Sequence[Block], place: str) -> Influences | None:
    """Return the influences on the concatenated vertices of all blocks, or None without joints.

    Weights are normalized; a vertex without weights follows its first joint, as in other programs.
    FBX2glTF writes NaN as the weights of such a vertex.
    """
    counts = [
        next(
            n
            for n in itertools.count()
            if not {f"JOINTS_{n}", f"WEIGHTS_{n}"} <= block.values.keys()
        )
        for block in blocks
    ]
    if not any(counts):
        return None
    if 0 in counts:
        raise FormatError(f"{place}: only some of its primitives have joints")
    n_verts = sum(len(block.positions) for block in blocks)
    joints, weights = np.zeros((2, n_verts, 4 * max(counts)))
    start = 0
    for block, n_sets in zip(blocks, counts, strict=True):
        rows = slice(start, start := start + len(block.positions))
        for number in range(n_sets):
            columns = slice(4 * number, 4 * number + 4)
            set_joints = block.values[f"JOINTS_{number}"].array
            if set_joints.dtype.kind != "u":
                raise FormatError(f"JOINTS_{number} must be unsigned integers")
            joints[rows, columns] = set_joints
            set_weights = block.values[f"WEIGHTS_{number}"].floats()
            is_missing = np.isnan(set_weights).all(axis=1, keepdims=True)
            weights[rows, columns] = np.where(is_missing, 0.0, set_weights)
    if not (np.isfinite(weights).all() and (weights >= 0).all()):
        raise FormatError(f"{place}: joint weights must be finite and at least 0")
    weights[weights.max(axis=1) == 0, 0] = 1.0
    weights /= weights.max(axis=1, keepdims=True)  # first, since sums of huge weights overflow
    weights /= weights.sum(axis=1, keepdims=True)
    return Influences(np.where(weights > 0, joints, 0).astype(np.int64), weights)


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
        else np.zeros((len(block.positions), 3))
        for block in blocks
    ]
    mesh = PolygonMesh(positions, np.full(len(faces), 3, np.int64), faces.ravel())
    return find_hard_edges(mesh, np.concatenate(normals)[triangles.ravel()])


def _material_groups(
    materials: npt.NDArray[np.int32], labels: Sequence[str]
) -> tuple[FaceGroups, ...]:
    """Return the materials in use, in file order; unnamed ones form no group."""
    indices = np.unique(materials)
    labeled = np.array([index for index in indices if index >= 0 and labels[index]], np.int64)
    if len(labeled) == 0:
        return ()
    numbers = np.full(len(labels) + 1, -1, np.int32)  # the last is for faces without a material
    numbers[labeled] = np.arange(len(labeled))
    return (FaceGroups("material", tuple(labels[index] for index in labeled), numbers[materials]),)


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


Joined = tuple[npt.NDArray[Any] | None, str]
"""Concatenated values of all blocks, and a note on them."""


def _join_uvs(block_values: Sequence[Values | None], blocks: Sequence[Block]) -> Joined:
    uvs = [
        np.zeros((len(block.positions), 2)) if values is None else values.floats()
        for values, block in zip(block_values, blocks, strict=True)
    ]
    # In glTF, v points down. Adding zero turns -0.0 into 0.0, for bitwise comparisons.
    flipped = [np.stack([uv[:, 0] + 0.0, 1 - uv[:, 1]], axis=1) for uv in uvs]
    note = "is 0 1 on primitives without it" if None in block_values else ""
    return np.concatenate(flipped).astype(np.float32), note


def _join_colors(block_values: Sequence[Values | None], blocks: Sequence[Block]) -> Joined:
    arrays = [values.array for values in block_values if values is not None]
    width, dtype = max(array.shape[1] for array in arrays), np.result_type(*arrays)
    dtype = dtype if dtype in (np.uint8, np.uint16) else np.dtype(np.float32)
    white = 1 if dtype.kind == "f" else np.iinfo(dtype).max
    rows = [np.full((len(block.positions), width), white, dtype) for block in blocks]
    for values, filled in zip(block_values, rows, strict=True):
        if values is not None:
            colors = Values(values.array, is_normalized=True).floats() + 0.0
            filled[:, : colors.shape[1]] = colors if dtype.kind == "f" else np.rint(white * colors)
    note = "is white on primitives without it" if None in block_values else ""
    return colors_of_linear(np.concatenate(rows)), note


def _join_custom(block_values: Sequence[Values | None], blocks: Sequence[Block]) -> Joined:
    present = [values for values in block_values if values is not None]
    types = {(item.array.dtype, item.array.shape[1], item.is_normalized) for item in present}
    if len(types) > 1 or len(present) < len(blocks):
        return None, "is left out, since not all primitives have it with the same type"
    rows = np.concatenate([item.floats() if item.is_normalized else item.array for item in present])
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


def _decode_draco(
    primitive: JsonObject, compressed: JsonObject, document: Document
) -> dict[str, Values]:
    """Return the Draco-compressed arrays of a primitive, by attribute name and "indices"."""
    names, ids = primitive.required_child("attributes"), compressed.required_child("attributes")
    data = bytes(document.view(compressed)[0])
    n_corners = primitive.item("indices", "accessors").integer("count")
    n_verts = names.item("POSITION", "accessors").integer("count")
    _check_draco_counts(data, n_verts, n_corners, compressed.place)
    document.reserve(4 * n_corners + 12 * n_verts, compressed.place)
    library = LIBRARY.load()
    try:
        mesh = library.decode(data)
        arrays = {item["unique_id"]: np.asarray(item["data"]) for item in mesh.attributes}
        decoded = {"indices": Values(np.asarray(mesh.faces).reshape(-1, 1))}
    except Exception as error:  # DracoPy raises TypeError, ValueError and its own types
        raise FormatError(f"{compressed.place}: Draco cannot decode it ({error})") from None
    for name in filter(accessor_types, ids.values):
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
