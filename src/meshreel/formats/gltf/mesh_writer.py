"""Parts of a sequence as base mesh and morph targets, written as meshes of a glTF scene."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers
from meshreel.errors import Keyword, Message
from meshreel.formats.error_budget import MARGIN
from meshreel.formats.gltf.container import (
    QUANTIZATION,
    BufferWriter,
    FileSize,
    Json,
    NodeTree,
    Placement,
    VertexValues,
)
from meshreel.formats.gltf.document import GENERATOR
from meshreel.formats.gltf.materials import Materials
from meshreel.formats.gltf.morphs import (
    Morphs,
    NormalTargets,
    fit_morphs,
    fit_normals,
    max_displacements,
    place_frames,
    place_static,
    static_normals,
    wants_normals,
)
from meshreel.formats.options import WriteOptions
from meshreel.formats.scenes.parts import PartMesh
from meshreel.formats.surfaces.polygons import describe_triangles
from meshreel.formats.surfaces.welding import weld_rows
from meshreel.kernel.order import depth_first_order, number_by_use
from meshreel.kernel.polygons import triangle_corners
from meshreel.model.colors import linear_of_colors
from meshreel.model.geometry.hard_edges import RowNormals
from meshreel.model.notes import Note, NoteKind, Notes
from meshreel.model.sequence import Faces, Vertices
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.runtime.counting import counted, size_text
from meshreel.runtime.progress import Progress, silent
from meshreel.runtime.threads import one_blas_thread

Rows = npt.NDArray[Any]

MATERIAL = "material"
"""Name of the face groups that become materials."""

MAX_WIDTH = 4
"""Maximum number of components of an attribute in glTF."""

POSITION_SHARES = (0.98, 0.9)
"""Fractions of the bound for positions before normals scale targets down, which adds rounding
errors; the second is tried if the first exceeds the bound."""

LENGTH_ERROR = 0.1
"""Acceptable root mean square error of unit normals, about 3.5 degrees."""


@dataclass(frozen=True, eq=False)
class ShadingMesh:
    """A mesh with one normal per vertex, whose vertices are split at hard edges."""

    vertices: npt.NDArray[np.int64]
    """int64 array of shape (R,). Original vertex of each vertex."""
    faces: Faces
    """int32 array of shape (M, 3)."""
    has_hard_edges: bool


@dataclass(frozen=True, eq=False)
class MorphMesh:
    """A part as base mesh and morph targets; without targets, it is static."""

    placement: Placement
    base: npt.NDArray[Any]
    """int16 or float32 array of shape (V, 3)."""
    morphs: Morphs | None
    normals: NormalTargets | None
    errors: npt.NDArray[np.floating]
    """float array of shape (T,). Largest error of a vertex in each frame, in model units."""


def fit_part(
    frames: Vertices,
    faces: Faces,
    bound: float,
    options: WriteOptions,
    shading: ShadingMesh | None = None,
    progress: Progress = silent,
) -> MorphMesh:
    """Return a part fitted by a base mesh and morph targets.

    Parameters
    ----------
    frames : float array of shape (T, V, 3)
    faces : int32 array of shape (M, 3)
    bound : float
        Largest error of a vertex, in model units.
    options : WriteOptions
        Normals are animated by all targets if they are requested, by default by as few as needed.
    shading : ShadingMesh, optional
        For a mesh with hard edges, which always gets normals. Default: one normal per vertex.
    progress : callable, optional
        Called with the completed share of the fit.
    """
    if shading is None:
        shading = ShadingMesh(np.arange(frames.shape[1]), faces, has_hard_edges=False)
    base = frames.mean(axis=0, dtype=np.float64)
    distances = max_displacements(frames, base)
    has_normals = shading.has_hard_edges or wants_normals(options.normals, frames[0], faces)
    if distances.max() <= bound or len(frames) == 1:
        placement, rest = place_static(base if len(frames) > 1 else frames[0])
        normals = static_normals(rest[shading.vertices], shading.faces) if has_normals else None
        return MorphMesh(placement, rest, None, normals, distances)
    are_floats = not options.meshopt
    placement, placed, displacements = place_frames(frames, base, are_floats=are_floats)
    bound = max(0.0, bound / placement.scale - MARGIN)
    normals = None
    fit = partial(fit_morphs, displacements, are_floats=are_floats, progress=progress)
    with one_blas_thread():
        if has_normals:
            morphs, normals = _fit_both(frames, shading, displacements, bound, options, fit)
        else:
            morphs = fit(bound)
    return MorphMesh(placement, placed, morphs, normals, morphs.errors * placement.scale)


def _fit_both(
    frames: Vertices,
    shading: ShadingMesh,
    displacements: npt.NDArray[np.float32],
    bound: float,
    options: WriteOptions,
    fit: Callable[[float], Morphs],
) -> tuple[Morphs, NormalTargets]:
    """Return morphs of positions and normals, with the larger share of the bound that works."""
    length_error = LENGTH_ERROR if options.normals is None else 0.0
    shading_frames = frames[:, shading.vertices]
    for share in POSITION_SHARES:
        morphs = fit(share * bound)
        fitted = fit_normals(shading_frames, shading.faces, displacements, morphs, length_error)
        if fitted[0].error <= bound:
            break
    return fitted


@dataclass(frozen=True, eq=False)
class Primitive:
    """The triangles of one material."""

    material: str | None
    """None for faces without a material."""
    verts: slice
    """Its vertices among those of the mesh; primitives share no vertices."""
    triangles: Integers
    """int64 array of shape (M, 3). Indices into its own vertices."""


@dataclass(frozen=True, eq=False)
class SplitVertices:
    """A mesh whose vertices are split where attribute values or materials differ."""

    sources: Integers
    """int64 array of shape (N,). Original vertex of each vertex."""
    rows: Integers
    """int64 array of shape (N,). Row of its normal in `NormalRows`; the original vertex if no edge
    is hard.
    """
    attributes: dict[str, Rows]
    """dict of str to array of shape (N, C). By glTF attribute name."""
    primitives: tuple[Primitive, ...]

    def with_indices(self, vertex_indices: Integers, row_indices: Integers) -> "SplitVertices":
        """Return the same mesh with new indices of original vertices and normal rows."""
        return replace(self, sources=vertex_indices[self.sources], rows=row_indices[self.rows])

    def along_edges(self) -> "SplitVertices":
        """Return the same mesh with triangles next to their neighbors, and vertices by first use.

        Primitives remain contiguous. Compression depends on this order.
        """
        verts, primitives = np.empty_like(self.sources), []
        for primitive in self.primitives:
            sources = self.sources[primitive.verts]
            ordered = primitive.triangles[depth_first_order(sources[primitive.triangles])]
            by_use, numbers = number_by_use(ordered)
            verts[primitive.verts] = primitive.verts.start + by_use
            primitives.append(replace(primitive, triangles=numbers[ordered]))
        attributes = {name: values[verts] for name, values in self.attributes.items()}
        return SplitVertices(self.sources[verts], self.rows[verts], attributes, tuple(primitives))


def split_at_seams(
    part: PartMesh, rows_of_corners: npt.NDArray[np.integer] | None = None
) -> SplitVertices:
    """Return the vertices that faces use, in their original order within each material.

    Parameters
    ----------
    rows_of_corners : integer array of shape (C,), optional
        Row of the normal of each corner, if vertices have several. Default: the vertex.
    """
    corner_of = triangle_corners(part.counts, part.faces).ravel()
    items = {
        Domain.VERTEX: part.corners[corner_of].astype(np.int64),
        Domain.FACE: np.repeat(np.arange(len(part.counts)), part.counts)[corner_of],
        Domain.CORNER: corner_of.astype(np.int64),
    }
    labels, materials = _materials(part.surface, len(part.counts))
    named_values = dict(_named_attributes(part.surface))
    normal_rows = items[Domain.VERTEX]
    if rows_of_corners is not None:
        normal_rows = np.asarray(rows_of_corners, np.int64)[corner_of]
    keys = [materials[items[Domain.FACE]], items[Domain.VERTEX], normal_rows]
    for values, domain in named_values.values():
        if domain is not Domain.VERTEX:
            rows, _ = weld_rows([values + 0])  # + 0 makes -0.0 and 0.0 equal
            keys.append(rows[items[domain]])
    first, corner_vertices = _unique(keys)
    attributes = {
        name: np.ascontiguousarray(values[items[domain][first]])
        for name, (values, domain) in named_values.items()
    }
    primitives = tuple(_primitives(keys[0][first], corner_vertices.reshape(-1, 3), labels))
    return SplitVertices(items[Domain.VERTEX][first], normal_rows[first], attributes, primitives)


def describe_losses(surface: Surface, n_triangles: int) -> Iterator[Note]:
    """Yield a note on everything of a surface of triangles that glTF cannot store."""
    for attribute in surface.of_kind(Kind.COLOR):
        values, maximum = attribute.values, 1 if attribute.values.dtype.kind == "f" else 255
        if values.size and (values.min() < 0 or values.max() > maximum):
            yield Note(NoteKind.CHANGED, f"clipped colors {attribute.name!r} to 0..{maximum}")
    for attribute in surface.attributes:
        if _gltf_values(attribute) is None:
            width, dtype = attribute.values.shape[1], attribute.values.dtype
            label = f"attribute {attribute.name!r}"
            text = f"left out {label}: glTF does not support {width} components of {dtype}"
            yield Note(NoteKind.UNWRITTEN, text)
    for groups in surface.groups:
        if groups.name != MATERIAL:
            text = f"left out face groups {groups.name!r}: glTF supports only materials"
            yield Note(NoteKind.UNWRITTEN, text)
    if text := describe_triangles(surface.sizes(n_triangles)):
        yield Note(NoteKind.UNWRITTEN, text)


def _named_attributes(surface: Surface) -> Iterator[tuple[str, tuple[Rows, Domain]]]:
    """Yield the glTF names of attributes, with their values in glTF and domain."""
    numbers = {Kind.UV: 0, Kind.COLOR: 0}
    for attribute in surface.attributes:
        if (values := _gltf_values(attribute)) is None:
            continue
        if attribute.kind is Kind.OTHER:
            name = f"_{attribute.name.removeprefix('_')}"
        else:
            stem = "TEXCOORD" if attribute.kind is Kind.UV else "COLOR"
            name = f"{stem}_{numbers[attribute.kind]}"
            numbers[attribute.kind] += 1
        yield name, (values, attribute.domain)


def _gltf_values(attribute: Attribute) -> Rows | None:
    """Return the values per item as glTF stores them, or None if it cannot."""
    values = attribute.per_item()
    if attribute.kind is Kind.UV:
        u, v = values[:, 0].astype(np.float64), values[:, 1].astype(np.float64)
        return np.stack([u, 1 - v], axis=1).astype(np.float32)
    if attribute.kind is Kind.COLOR:
        clipped = values.clip(0, 1 if values.dtype.kind == "f" else 255)
        return linear_of_colors(clipped) if values.shape[1] in (3, 4) else None
    is_supported = values.dtype in (np.uint8, np.float32) and values.shape[1] <= MAX_WIDTH
    return values if is_supported else None


def _materials(surface: Surface, n_faces: int) -> tuple[tuple[str | None, ...], Integers]:
    """Return the labels, and the label index of each face; the last is for no material."""
    for groups in surface.groups:
        if groups.name == MATERIAL:
            numbers = groups.numbers.astype(np.int64)
            return (*groups.labels, None), np.where(numbers < 0, len(groups.labels), numbers)
    return (None,), np.zeros(n_faces, np.int64)


def _unique(keys: list[Integers]) -> tuple[Integers, Integers]:
    """Return the first position of each distinct combination of keys, sorted, and its index."""
    number = np.zeros(len(keys[0]), np.int64)
    for key in keys:
        combined_keys = number * (int(key.max()) + 1) + key
        _, first, number = np.unique(combined_keys, return_index=True, return_inverse=True)
    return first, number


def _primitives(
    materials: Integers, triangles: Integers, labels: tuple[str | None, ...]
) -> Iterator[Primitive]:
    """Yield the triangles of each material, whose vertices are contiguous."""
    triangle_materials = materials[triangles[:, 0]]
    for number in np.unique(materials):
        low, high = np.searchsorted(materials, [number, number + 1])
        material_triangles = triangles[triangle_materials == number] - low
        yield Primitive(labels[number], slice(int(low), int(high)), material_triangles)


def write_mesh(
    name: str,
    split: SplitVertices,
    morph_mesh: MorphMesh,
    buffer: BufferWriter,
    materials: Materials,
) -> Json:
    """Return the JSON of a mesh, whose values are added to the buffer.

    Parameters
    ----------
    split : SplitVertices
        Vertices that faces use, split at seams.
    morph_mesh : MorphMesh
        Motion of the vertices before the split.
    buffer, materials
        Receive the values and the materials of the mesh.
    """
    base, targets = _add_vertices(split, morph_mesh, buffer)
    weights = None if morph_mesh.morphs is None else morph_mesh.morphs.weights[0]
    return mesh_json(name, split, base, targets, weights, buffer, materials)


StoredValues = dict[str, VertexValues]
"""Buffer locations of vertex values, by attribute."""


def mesh_json(
    name: str,
    split: SplitVertices,
    base: StoredValues,
    targets: list[StoredValues],
    weights: npt.NDArray[np.floating] | None,
    buffer: BufferWriter,
    materials: Materials,
) -> Json:
    """Return the JSON of a mesh whose vertex values are in the buffer, and add its triangles.

    Parameters
    ----------
    weights : float array of shape (K,), optional
        Weights of the targets in the first frame, which viewers show when they do not play the
        animation; None without targets.
    """
    primitives = []
    for primitive in split.primitives:
        json: Json = {
            "attributes": buffer.vertex_accessors(base, primitive.verts),
            "indices": buffer.add_indices(primitive.triangles.ravel()),
            "material": materials.index(primitive.material),
        }
        if targets:
            json["targets"] = [
                buffer.vertex_accessors(values, primitive.verts) for values in targets
            ]
        primitives.append(json)
    mesh: Json = {"name": name, "primitives": primitives}
    if weights is None:
        return mesh
    return mesh | {
        "weights": weights.tolist(),
        "extras": {"targetNames": [f"mode {number + 1}" for number in range(len(targets))]},
    }


def add_attributes(attributes: Mapping[str, Rows], buffer: BufferWriter) -> StoredValues:
    """Add vertex attributes to the buffer."""
    return {
        name: buffer.add_vertices([values], are_unit=name == "NORMAL")[0]
        for name, values in attributes.items()
    }


def _add_vertices(
    split: SplitVertices, morph_mesh: MorphMesh, buffer: BufferWriter
) -> tuple[StoredValues, list[StoredValues]]:
    """Add the vertex attributes of a mesh and those of its morph targets."""
    morphs, normals = morph_mesh.morphs, morph_mesh.normals
    base = {"POSITION": morph_mesh.base[split.sources]}
    if normals is not None:
        base["NORMAL"] = normals.base[split.rows]
    base_values = add_attributes(base | split.attributes, buffer)
    if morphs is None:
        return base_values, []
    targets: list[StoredValues] = [{} for _ in range(len(morphs.targets))]
    levels = morphs.targets.levels
    for level in np.unique(levels):
        numbers: list[int] = np.flatnonzero(levels == level).tolist()
        arrays = [morphs.targets.stored(number).T[split.sources] for number in numbers]
        # In one buffer view.
        for index, values in zip(numbers, buffer.add_vertices(arrays), strict=True):
            targets[index]["POSITION"] = values
    if normals is not None:
        # All targets must have the same attributes, so those without normals share zeros.
        zeros = np.zeros((1, *normals.base.shape), normals.base.dtype)
        arrays = [field[split.rows] for field in np.concatenate([normals.targets, zeros])]
        *displacements, zero_field = buffer.add_vertices(arrays)
        by_target = dict(zip(normals.numbers.tolist(), displacements, strict=True))
        for number, target in enumerate(targets):
            target["NORMAL"] = by_target.get(number, zero_field)
    return base_values, targets


MESHOPT_NEEDS = (
    "vertices and triangles are reordered; viewers need a decoder: "
    "ModelViewerElement.meshoptDecoderLocation = URL in model-viewer, "
    "loader.setMeshoptDecoder(MeshoptDecoder) in three.js, the package "
    "com.unity.meshopt.decompress in Unity; Blender, Godot, assimp and trimesh have none: omit "
)


class SceneWriter:
    """Collects the meshes, nodes, animation and buffer of a scene.

    Parameters
    ----------
    name : str
        Of the sequence.
    times_s : sequence of float
        Times of all frames, not negative.
    notes : Notes
        Gains a sentence for every material property that glTF cannot store.
    """

    def __init__(
        self, name: str, times_s: Sequence[float], options: WriteOptions, notes: Notes
    ) -> None:
        self.buffer: BufferWriter = BufferWriter(is_compressed=options.meshopt)
        self._n_isolated = 0
        self._name, self._options, self._notes = name, options, notes
        self._times_s: Floats = np.asarray(times_s)
        self.tree: NodeTree = NodeTree()
        self.meshes: list[Json] = []
        self._samplers: list[Json] = []
        self._channels: list[Json] = []
        self._inputs: dict[bytes, int] = {}

    def note_isolated(self) -> None:
        """Add a note on vertices that no face uses."""
        if self._n_isolated:
            text = f"left out {counted(self._n_isolated, 'vertex')} that no face uses"
            self._notes.unwritten(text)

    def note_form(self, size: FileSize) -> None:
        """Add notes on the size behind a web server, and on what programs need to read the file."""
        served = f"serve gzipped: {size_text(size.gzipped)} instead of {size_text(size.stored)}"
        if not self._options.meshopt:
            smallest = " writes the smallest file, for viewers that load a decoder"
            self._notes.result(Message(f"{served}; ", Keyword("meshopt", value=True), smallest))
            return
        self._notes.result(served)
        for extension in self.buffer.required_extensions:
            needs = Message(f"compressed with {extension}: {MESHOPT_NEEDS}", Keyword("meshopt"))
            self._notes.result(needs)

    def _split_part(self, part: PartMesh) -> tuple[SplitVertices, RowNormals, bool]:
        """Return the split vertices of a part, its normals, and whether it has hard edges."""
        # Only normals use hard edges.
        hard_edges = None if self._options.normals is False else part.surface.hard_edges
        n_verts = part.verts.stop - part.verts.start
        shading = RowNormals(part.faces, part.counts, hard_edges, n_verts)
        split = split_at_seams(part, shading.rows.of_corner)
        if self._options.meshopt:
            split = split.along_edges()
        self._n_isolated += n_verts - len(np.unique(split.sources))
        return split, shading, hard_edges is not None

    def _add_times(self, frame_sets: Iterable[npt.NDArray[np.int64]]) -> None:
        """Add the times of several sets of frames in one buffer view, each once."""
        new = {frames.tobytes(): frames for frames in frame_sets}
        times = [self._times_s[frames, np.newaxis].astype("<f4") for frames in new.values()]
        self._inputs |= zip(new, self.buffer.add_curves(times, has_bounds=True), strict=True)

    def _times_accessor(self, frames: npt.NDArray[np.int64]) -> int:
        """Return the accessor of the times of frames, stored once."""
        if frames.tobytes() not in self._inputs:
            self._add_times([frames])
        return self._inputs[frames.tobytes()]

    def _animate(self, node: int, path: str, keys: int, values: int, **sampler: str) -> None:
        """Add a channel, given the accessors of its key times and values."""
        target = {"node": node, "path": path}
        self._channels.append({"sampler": len(self._samplers), "target": target})
        self._samplers.append({"input": keys, "output": values, **sampler})

    def assemble(self, materials: Materials) -> Json:
        """Return the JSON of the file, without the buffer; materials note those without use."""
        materials.note_unused()
        all_required = {*materials.required_extensions, *self.buffer.required_extensions}
        if self.buffer.is_quantized:
            all_required.add(QUANTIZATION)
        animation = {
            "name": self._name or "animation",
            "samplers": self._samplers,
            "channels": self._channels,
        }
        lists = {
            **materials.lists,
            "accessors": self.buffer.accessors,
            "bufferViews": self.buffer.views,
            "animations": [animation] if self._samplers else [],
            "extensionsUsed": sorted(all_required | materials.used_extensions),
            "extensionsRequired": sorted(all_required),
        }
        return {
            "asset": {"version": "2.0", "generator": GENERATOR},
            "scene": 0,
            "scenes": [{"name": self._name or "scene", "nodes": self.tree.roots}],
            "nodes": self.tree.nodes,
            "meshes": self.meshes,
            **{key: values for key, values in lists.items() if values},
        }
