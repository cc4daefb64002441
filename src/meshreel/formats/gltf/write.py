"""Writing glTF: an animation of morph targets, which viewers play on the GPU."""

import base64
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.codec.error_bounds import bound_of
from meshreel.errors import InvalidInputError, Keyword, Message
from meshreel.formats.error_budget import ErrorBudget, share_budget
from meshreel.formats.frames.frame_stream import FrameStream, SegmentedStream
from meshreel.formats.frames.shared_data import sharing_materials
from meshreel.formats.gltf.container import BufferWriter, Json, write_container
from meshreel.formats.gltf.material_writer import Materials
from meshreel.formats.gltf.mesh_writer import describe_losses, split_at_seams, write_mesh
from meshreel.formats.gltf.morph_mesh import (
    MorphMesh,
    MorphOptions,
    NormalChoice,
    ShadingMesh,
    fit_part,
)
from meshreel.formats.gltf.morphs import IDENTITY, Placement, check_range
from meshreel.formats.notes import note_written_rate
from meshreel.formats.options import WriteOptions
from meshreel.formats.scenes.parts import PartMesh, split_parts
from meshreel.formats.surfaces.polygons import describe_fans
from meshreel.model.geometry.hard_edges import RowNormals
from meshreel.model.geometry.polygons import triangulate_fans
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Surface
from meshreel.runtime.counting import counted

NodePath = tuple[str, ...]

SEGMENT_START = "meshreelSegmentStart"
"""Property of the extras of a node above the meshes of a segment: time of its first frame."""


class NodeTree:
    """The nodes of a scene, with parents created on demand.

    Attributes
    ----------
    nodes : list of dict
        Entries of the JSON.
    roots : list of int
    """

    def __init__(self) -> None:
        self.nodes: list[Json] = []
        self.roots: list[int] = []
        self._numbers: dict[NodePath, int] = {}
        self._placements: list[Placement] = []

    def add(self, name: str, mesh: int, placement: Placement) -> int:
        """Add a node with a mesh, and return its index; add shorter paths first.

        Parameters
        ----------
        name : str
            Name, or path of nodes if it starts with a slash.
        mesh : int
        placement : Placement
            Placement of the mesh in the world, independent of its parents.
        """
        path = path_of(name)
        parent = self._parent(path)
        above = self._placements[parent] if parent is not None else IDENTITY
        node: Json = {"name": path[-1], "mesh": mesh}
        shift = (placement.offset - above.offset) / above.scale
        if shift.any():
            node["translation"] = shift.tolist()
        if placement.scale != above.scale:
            node["scale"] = [placement.scale / above.scale] * 3
        return self._append(path, node, placement, parent)

    def group(self, name: str) -> int:
        """Return the index of a root node without a mesh, added if it is missing."""
        parent = self._parent((name, ""))
        assert parent is not None
        return parent

    def _parent(self, path: NodePath) -> int | None:
        parent = None
        for end in range(1, len(path)):
            inherited = self._placements[parent] if parent is not None else IDENTITY
            if (number := self._numbers.get(path[:end])) is None:
                number = self._append(path[:end], {"name": path[end - 1]}, inherited, parent)
            parent = number
        return parent

    def _append(self, path: NodePath, node: Json, placement: Placement, parent: int | None) -> int:
        number = len(self.nodes)
        self.nodes.append(node)
        self._placements.append(placement)
        self._numbers.setdefault(path, number)
        siblings = self.roots if parent is None else self.nodes[parent].setdefault("children", [])
        siblings.append(number)
        return number


def path_of(name: str) -> NodePath:
    """Return the node names from the root to a mesh; a single one unless its name is a path."""
    elements = tuple(element for element in name.split("/") if element)
    return elements if name.startswith("/") and elements else (name or "mesh",)


DEFAULT_MAX_ERROR = 0.1
"""Percent of the diagonal: one pixel in a thousand, for a mesh that fills the image."""

DEFAULT_FPS = 24.0

MAX_COMMON_TARGETS = 256
"""Texture layers that every GPU supports (WebGL 2); some viewers cannot play more targets."""

CHOICES = {None: NormalChoice.SMOOTH, True: NormalChoice.ALL, False: NormalChoice.NONE}

CREASED_REASON = "much of the surface is creased (--normals, normals=True, writes them anyway)"

TOO_FEW_TARGETS = "normals need at least two targets"

QUANTIZATION = "KHR_mesh_quantization"


@dataclass(frozen=True, eq=False)
class Scene:
    """The contents of a file.

    Attributes
    ----------
    document : dict
        The JSON, without the buffer.
    buffer : BufferWriter
    meshes : list of MorphMesh
        Meshes of the parts that have faces.
    errors : float array of shape (T,)
        Largest error of a vertex in each frame, in model units.
    n_isolated : int
        Number of vertices that no face uses, which are left out.
    has_hard_edges : bool
    """

    document: Json
    buffer: BufferWriter
    meshes: list[MorphMesh]
    errors: npt.NDArray[np.floating]
    n_isolated: int
    has_hard_edges: bool

    @property
    def n_targets(self) -> list[int]:
        """Number of morph targets of each animated mesh, ascending."""
        return sorted(len(mesh.morphs.targets) for mesh in self.meshes if mesh.morphs)


def write_glb(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write a self-contained ``.glb`` file.

    All frames of a segment, and the file, are in memory. Each segment has its own meshes, below a
    node whose scale is 1 in its frames and 0 in the others. `stream.notes` gains the errors
    achieved.

    Raises
    ------
    InvalidInputError
        If the options are out of range, or their error bound cannot be met.
    """
    result = _build_result(stream, options)
    scene = result.scene
    size = write_container(
        path, scene.document, scene.buffer, "allow a larger error (max_error), or use fewer targets"
    )
    _note_achieved(stream.notes, result, size)
    _note_normals(stream.notes, scene, options)


def write_gltf(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write a ``.gltf`` file with the buffer as base64, which is a third larger.

    Raises
    ------
    InvalidInputError
        As `write_glb`.
    """
    result = _build_result(stream, options)
    scene = result.scene
    data = base64.b64encode(b"".join(scene.buffer.pieces)).decode("ascii")
    uri = f"data:application/octet-stream;base64,{data}"
    buffers = [{"byteLength": scene.buffer.size_bytes, "uri": uri}]
    text = json.dumps(scene.document | {"buffers": buffers}, ensure_ascii=False, indent=1)
    _note_achieved(stream.notes, result, path.write_bytes(text.encode()))
    _note_normals(stream.notes, scene, options)


@dataclass(frozen=True, eq=False)
class _Result:
    """A scene and its errors.

    Attributes
    ----------
    scene : Scene
    percents : float array of shape (T,)
        Largest error of a vertex in each frame, in percent of the diagonal of all frames.
    budget : ErrorBudget
    n_frames : int
    """

    scene: Scene
    percents: npt.NDArray[np.floating]
    budget: ErrorBudget
    n_frames: int


def _build_result(stream: SegmentedStream, options: WriteOptions) -> _Result:
    _check_options(options)

    def note_losses(mesh: FrameStream) -> None:
        losses = [*describe_losses(mesh.surface)]
        losses.append(describe_fans(mesh.surface.sizes(len(mesh.faces))))
        stream.notes.extend(loss for loss in losses if loss and loss not in stream.notes)

    sharing, _ = sharing_materials(stream, note_losses)
    times_s = _times(stream)
    segments: Iterable[MeshSequence]
    if stream.n_segments == 1:
        [segments] = [[segment.gather()] for segment in stream.segments()]
        extent = segments[0].extent
        low, high = extent.low, extent.high
    else:
        low, high = _box(stream)
        segments = (segment.gather() for segment in sharing.segments())
    check_range(low, high)
    diagonal = float(np.linalg.norm(high - low))
    if options.max_error is not None:
        allowed = bound_of(options.max_error).percent(diagonal or 1.0)
    else:
        allowed = DEFAULT_MAX_ERROR if options.targets is None else 0.0
    budget = share_budget(allowed, diagonal, options.origin, is_total=options.max_error is not None)
    morph_options = MorphOptions(options.targets, budget.added, CHOICES[options.normals])
    stream.progress("morph targets", 0.0)
    scene = build_scene(segments, stream.name, times_s, morph_options, stream.notes)
    if scene.n_isolated:
        stream.notes.append(f"left out {counted(scene.n_isolated, 'vertex')} that no face uses")
    errors = scene.errors
    result = _Result(scene, 100 * errors / (budget.diagonal or 1.0), budget, len(times_s))
    if budget.added and scene.n_targets and errors.max() > budget.added:
        remaining = budget.percent(budget.added)
        is_shared = not math.isclose(remaining, allowed)
        bound = f"{remaining:.4g} % of {allowed:g} % remain" if is_shared else f"{allowed:g} % is"
        raise InvalidInputError(
            f"{_describe_error(result)} with {counted(scene.n_targets[-1], 'morph target')}; "
            f"{bound} allowed; use more targets, or allow a larger error (",
            Keyword("max_error"),
            ")",
        )
    return result


def _box(stream: SegmentedStream) -> tuple[Floats, Floats]:
    """Return the corners of the bounding box of all frames, each of shape (3,)."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for frame in stream.frames():
        low, high = np.minimum(low, frame.min(axis=0)), np.maximum(high, frame.max(axis=0))
    return low, high


def _check_options(options: WriteOptions) -> None:
    minimum = 2 if options.normals else 1
    if options.targets is not None and options.targets < minimum:
        reason = " with normals" if options.normals else ""
        raise InvalidInputError(
            f"targets must be at least {minimum}{reason}; got {options.targets}"
        )
    if options.max_error is not None:
        bound_of(options.max_error)


def _times(stream: SegmentedStream) -> Sequence[float]:
    """Return the times of frames in seconds; glTF has no negative times."""
    if not stream.fps and stream.n_frames > 1:
        note_written_rate(stream.notes, DEFAULT_FPS)
    start_s = stream.start_s
    if start_s < 0:
        stream.notes.append(f"starts at 0 s, not {start_s:g} s: glTF has no time before 0")
        start_s = 0.0
    rate = stream.fps or DEFAULT_FPS
    return [start_s + number / rate for number in range(stream.n_frames)]


def _describe_error(result: _Result) -> str:
    percent, frame = float(result.percents.max()), int(result.percents.argmax())
    added = "" if result.budget.origin is None else " added"
    return f"the largest error{added} is {percent:.4f} % of the diagonal, in frame {frame},"


def _note_achieved(notes: list[str], result: _Result, size_bytes: int) -> None:
    counts = result.scene.n_targets
    added = result.budget.diagonal * float(result.percents.max()) / 100
    if not counts:
        if result.n_frames > 1:
            notes.append("no vertex moves by more than the error bound: written as a static mesh")
        notes += result.budget.describe(added)
        return
    number = f"{counts[0]} to " if counts[0] < counts[-1] else ""
    where = f" in each of {len(counts)} meshes" if len(counts) > 1 else ""
    notes.append(
        f"{_describe_error(result)} with {number}{counted(counts[-1], 'morph target')}{where}: "
        f"{size_bytes / 1e6:.3g} MB"
    )
    notes += result.budget.describe(added)
    if counts[-1] > MAX_COMMON_TARGETS:
        notes.append(
            Message(
                f"some viewers play at most {MAX_COMMON_TARGETS} morph targets per mesh; "
                "allow a larger error (",
                Keyword("max_error"),
                ") for fewer",
            )
        )


def _note_normals(notes: list[str], scene: Scene, options: WriteOptions) -> None:
    """Note which meshes have normals, and the error of animated normals."""
    if options.normals is False:
        return
    normals = [mesh.normals for mesh in scene.meshes if mesh.normals is not None]
    if not normals:
        reason = TOO_FEW_TARGETS if options.targets == 1 else CREASED_REASON
        notes.append(f"no normals, so viewers use flat shading: {reason}")
        return
    angle_deg = max(targets.angle_deg for targets in normals)
    error = f", with a mean error of {angle_deg:.1f} degrees in motion" if angle_deg else ""
    n_meshes = len(scene.meshes)
    few = f" of {len(normals)} of {n_meshes} meshes" if len(normals) < n_meshes else ""
    others = f"; the others have none: {CREASED_REASON}" if few else ""
    hard = " except at hard edges" if scene.has_hard_edges else ""
    if error or few or hard:
        notes.append(f"normals{few} are smooth{hard}{error}{others}")


class _SceneWriter:
    """Collects the meshes, nodes and buffer of a scene."""

    def __init__(self, surface: Surface, notes: list[str]) -> None:
        self.buffer, self.tree = BufferWriter(), NodeTree()
        self.materials = Materials(surface, self.buffer, notes)
        self.meshes: list[Json] = []
        self.morph_meshes: list[MorphMesh] = []
        self.n_isolated = 0
        self._nodes: list[tuple[int, slice]] = []
        self._segments: list[tuple[int, slice]] = []

    def begin_segment(self, number: int, name: str, frames: slice, start_s: float) -> str:
        """Add a node above the meshes of a segment; return its path.

        Parameters
        ----------
        frames : slice
            Its frames.
        start_s : float
            Time of the first frame.
        """
        label = f"{name or 'segment'} {number}".replace("/", "_")
        node = self.tree.group(label)
        self.tree.nodes[node]["extras"] = {SEGMENT_START: start_s}
        if number:  # without an animation, the first segment is shown
            self.tree.nodes[node]["scale"] = [0.0, 0.0, 0.0]
        self._segments.append((node, frames))
        return f"/{label}"

    def add(
        self, part: PartMesh, sequence: MeshSequence, options: MorphOptions, frames: slice
    ) -> None:
        """Add a part of a segment with these frames; skip a part without faces."""
        hard_edges = part.surface.hard_edges
        if options.normals is NormalChoice.NONE:
            hard_edges = None  # only normals use them
        n_verts = part.verts.stop - part.verts.start
        shading = RowNormals(part.counts, part.corners, hard_edges, n_verts)
        split = split_at_seams(part, shading.rows.of_corner)
        used = np.zeros(n_verts, bool)
        used[split.sources] = True
        self.n_isolated += int((~used).sum())
        if not len(split.sources):
            return
        of_vertices = np.cumsum(used) - 1
        faces = of_vertices[triangulate_fans(part.counts, part.corners)].astype(np.int32)
        is_used = used[shading.rows.vertices]
        of_rows = np.cumsum(is_used) - 1
        shading_mesh = ShadingMesh(
            of_vertices[shading.rows.vertices[is_used]],
            of_rows[shading.triangles].astype(np.int32),
            has_hard_edges=hard_edges is not None,
        )
        positions = sequence.vertices[:, part.verts]
        used_positions = positions if used.all() else positions[:, used]
        morph_mesh = fit_part(used_positions, faces, options, shading_mesh)
        split = split.with_indices(of_vertices, of_rows)
        name = path_of(part.name)[-1]
        node = self.tree.add(part.name, len(self.meshes), morph_mesh.placement)
        self._nodes.append((node, frames))
        self.meshes.append(write_mesh(name, split, morph_mesh, self.buffer, self.materials))
        self.morph_meshes.append(morph_mesh)

    def animation(self, name: str, times_s: Sequence[float]) -> Json | None:
        """Return the animation of all segments, and of meshes with targets; None without any."""
        samplers: list[Json] = []
        channels: list[Json] = []
        times = np.asarray(times_s, np.float32)
        inputs: dict[tuple[int, int], int] = {}
        for (node, frames), morph_mesh in zip(self._nodes, self.morph_meshes, strict=True):
            if morph_mesh.morphs is None:
                continue
            key = frames.start, frames.stop
            if key not in inputs:
                inputs[key] = self.buffer.add_samples(times[frames], are_times=True)
            values = self.buffer.add_samples(morph_mesh.morphs.weights, are_times=False)
            channels.append({"sampler": len(samplers), "target": {"node": node, "path": "weights"}})
            samplers.append({"input": inputs[key], "output": values, "interpolation": "LINEAR"})
        for node, frames in self._segments:
            keys = _scale_keys(frames, len(times))
            shown = np.array([frames.start <= key < frames.stop for key in keys], np.float32)
            sampled = self.buffer.add_samples(times[keys], are_times=True)
            scales = np.repeat(shown[:, np.newaxis], 3, axis=1)
            values = self.buffer.add_vectors(scales)
            channels.append({"sampler": len(samplers), "target": {"node": node, "path": "scale"}})
            samplers.append({"input": sampled, "output": values, "interpolation": "STEP"})
        return {"name": name, "samplers": samplers, "channels": channels} if samplers else None


def _scale_keys(frames: slice, n_frames: int) -> list[int]:
    """Return the frames at which the scale of a segment has keys.

    The first segment has keys in all frames, so that readers find each of them even if no vertex
    moves.
    """
    if frames.start == 0:
        return [*range(n_frames)]
    return sorted({0, frames.start, min(frames.stop, n_frames - 1)})


def build_scene(
    segments: Iterable[MeshSequence],
    name: str,
    times_s: Sequence[float],
    options: MorphOptions,
    notes: list[str],
) -> Scene:
    """Return the scene that plays the segments of a sequence.

    Parameters
    ----------
    segments : iterable of MeshSequence
        In order, at least one; all with the same materials.
    name : str
        Of the sequence.
    times_s : sequence of float
        Times of the frames of all segments, not negative.
    options : MorphOptions
    notes : list of str
        Gains a sentence for every material property that glTF cannot store.
    """
    writer: _SceneWriter | None = None
    errors: list[npt.NDArray[np.floating]] = []
    has_hard_edges, first = False, 0
    for number, segment in enumerate(segments):
        writer = writer or _SceneWriter(segment.surface, notes)
        frames = slice(first, first + segment.n_frames)
        first = frames.stop
        has_hard_edges = has_hard_edges or segment.surface.hard_edges is not None
        above = ""
        if segment.n_frames < len(times_s):
            above = writer.begin_segment(number, name, frames, times_s[frames.start])
        n_before = len(writer.morph_meshes)
        parts = split_parts(segment.faces, segment.surface, segment.n_verts, name)
        for part in sorted(parts, key=lambda part: len(path_of(part.name))):
            placed = part
            if above:
                placed = replace(part, name="/".join([above, *path_of(part.name)]))
            writer.add(placed, segment, options, frames)
        own = [mesh.errors for mesh in writer.morph_meshes[n_before:]]
        errors.append(np.max(own, axis=0) if own else np.zeros(segment.n_frames))
    assert writer is not None
    animation = writer.animation(name or "animation", times_s)
    document: Json = {
        "asset": {"version": "2.0", "generator": "meshreel"},
        "scene": 0,
        "scenes": [{"name": name or "scene", "nodes": writer.tree.roots}],
        "nodes": writer.tree.nodes,
        "meshes": writer.meshes,
        **writer.materials.document(),
        "accessors": writer.buffer.accessors,
        "bufferViews": writer.buffer.views,
    }
    writer.materials.note_unused()
    required = set(writer.materials.textures.required)
    if animation:
        document["animations"] = [animation]
    if any(mesh.morphs is not None for mesh in writer.morph_meshes):
        required.add(QUANTIZATION)
    used = required | writer.materials.textures.used
    extensions = {"extensionsUsed": sorted(used), "extensionsRequired": sorted(required)}
    document |= {key: names for key, names in extensions.items() if names}
    return Scene(
        document,
        writer.buffer,
        writer.morph_meshes,
        np.concatenate(errors),
        writer.n_isolated,
        has_hard_edges,
    )
