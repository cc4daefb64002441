"""Writing glTF: an animation of morph targets, which any viewer plays on its GPU."""

import base64
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshreel.codec.error_bounds import bound_of
from meshreel.errors import InvalidInputError
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.gltf.buffer_writer import BufferWriter, Json
from meshreel.formats.gltf.container_writer import write_container
from meshreel.formats.gltf.error_budget import ErrorBudget, share_budget
from meshreel.formats.gltf.material_writer import Materials
from meshreel.formats.gltf.mesh_writer import write_mesh
from meshreel.formats.gltf.moving_mesh import MovingMesh, Shaded, Wanted, fit_part
from meshreel.formats.gltf.node_tree import NodeTree, path_of
from meshreel.formats.gltf.normal_targets import NormalChoice
from meshreel.formats.gltf.placement import check_range
from meshreel.formats.gltf.seams import describe_left_out, split_at_seams
from meshreel.formats.options import WriteOptions
from meshreel.formats.scenes.parts import PartMesh, split_parts
from meshreel.formats.surfaces.polygons import describe_fans
from meshreel.model.geometry.fans import triangulate_fans
from meshreel.model.geometry.hard_edges import RowNormals
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Surface
from meshreel.runtime.counting import counted

DEFAULT_MAX_ERROR = 0.1
"""In percent of the diagonal: a pixel of a thousand, for a mesh that fills the picture."""

DEFAULT_FPS = 24.0

MANY_TARGETS = 256
"""Layers that a texture has on every GPU (WebGL 2); more targets than that some cannot play."""

CHOICES = {None: NormalChoice.SMOOTH, True: NormalChoice.ALL, False: NormalChoice.NONE}

WHY_FLAT = "creases are much of it (--normals, normals=True, writes them all the same)"

TOO_FEW_TARGETS = "they need two targets or more"

QUANTIZATION = "KHR_mesh_quantization"


@dataclass(frozen=True, eq=False)
class Scene:
    """The contents of a file.

    Attributes
    ----------
    document : dict
        The JSON, without the buffer.
    meshes : list of MovingMesh
        Of the parts that have faces.
    n_isolated : int
        Vertices that no face uses, which are left out.
    """

    document: Json
    buffer: BufferWriter
    meshes: list[MovingMesh]
    n_isolated: int
    has_hard_edges: bool

    @property
    def n_targets(self) -> list[int]:
        """Morph targets of each mesh that moves, ascending."""
        return sorted(len(one.morphs.targets) for one in self.meshes if one.morphs)


def write_glb(path: Path, stream: FrameStream, options: WriteOptions) -> None:
    """Write a ``.glb`` file, which holds everything.

    All frames are read into memory. `stream.notes` gains what was achieved.

    Raises
    ------
    InvalidInputError
        If the options are out of range, or the error that they allow cannot be kept.
    """
    achieved = _achieve(stream, options)
    scene = achieved.scene
    size = write_container(
        path, scene.document, scene.buffer, "allow a larger error (max_error), or fewer targets"
    )
    _note_achieved(stream.notes, achieved, size)
    _note_normals(stream.notes, scene, options)


def write_gltf(path: Path, stream: FrameStream, options: WriteOptions) -> None:
    """Write a ``.gltf`` file, whose JSON holds the buffer too, a third larger as text.

    Raises
    ------
    InvalidInputError
        As `write_glb`.
    """
    achieved = _achieve(stream, options)
    scene = achieved.scene
    data = base64.b64encode(b"".join(scene.buffer.pieces)).decode("ascii")
    uri = f"data:application/octet-stream;base64,{data}"
    buffers = [{"byteLength": scene.buffer.size_bytes, "uri": uri}]
    text = json.dumps(scene.document | {"buffers": buffers}, ensure_ascii=False, indent=1)
    _note_achieved(stream.notes, achieved, path.write_bytes(text.encode()))
    _note_normals(stream.notes, scene, options)


@dataclass(frozen=True, eq=False)
class _Achieved:
    """A scene, and how far the furthest vertex of each frame is off.

    Attributes
    ----------
    percents : float array of shape (T,)
        Of the diagonal of all frames.
    """

    scene: Scene
    percents: npt.NDArray[np.floating]
    budget: ErrorBudget
    n_frames: int


def _achieve(stream: FrameStream, options: WriteOptions) -> _Achieved:
    _check_options(options)
    stream.notes.extend(describe_left_out(stream.surface))
    if cut := describe_fans(stream.surface.sizes(len(stream.faces))):
        stream.notes.append(cut)
    times_s = _times(stream)
    sequence = stream.gather()
    extent = sequence.extent
    check_range(extent.low, extent.high)
    diagonal = float(np.linalg.norm(extent.high - extent.low))
    if options.max_error is not None:
        allowed = bound_of(options.max_error).percent(diagonal or 1.0)
    else:
        allowed = DEFAULT_MAX_ERROR if options.targets is None else 0.0
    budget = share_budget(allowed, diagonal, options.origin, is_total=options.max_error is not None)
    wanted = Wanted(options.targets, budget.added, CHOICES[options.normals])
    stream.progress("morph targets", 0.0)
    scene = make_scene(sequence, times_s, wanted, stream.notes)
    if scene.n_isolated:
        stream.notes.append(f"left out {counted(scene.n_isolated, 'vertex')} that no face uses")
    errors = np.max([one.errors for one in scene.meshes], axis=0)
    achieved = _Achieved(scene, 100 * errors / (budget.diagonal or 1.0), budget, len(times_s))
    if budget.added and scene.n_targets and errors.max() > budget.added:
        left = budget.percent(budget.added)
        is_shared = not math.isclose(left, allowed)
        bound = f"{left:.4g} % is left of the {allowed:g} %" if is_shared else f"{allowed:g} % was"
        raise InvalidInputError(
            f"{_largest(achieved)} with {counted(scene.n_targets[-1], 'morph target')}; {bound} "
            "asked for; allow more targets, or a larger error (max_error)"
        )
    return achieved


def _check_options(options: WriteOptions) -> None:
    least = 2 if options.normals else 1
    if options.targets is not None and options.targets < least:
        reason = " with normals" if options.normals else ""
        raise InvalidInputError(f"targets must be at least {least}{reason}; got {options.targets}")
    if options.max_error is not None:
        bound_of(options.max_error)


def _times(stream: FrameStream) -> Sequence[float]:
    """When frames are, in seconds; glTF has no time before 0."""
    if not stream.fps and stream.n_frames > 1:
        stream.notes.append(f"the frame rate is not known; written as {DEFAULT_FPS:g} fps")
    start_s = stream.start_s
    if start_s < 0:
        stream.notes.append(f"starts at 0 s, not {start_s:g} s: glTF has no time before 0")
        start_s = 0.0
    rate = stream.fps or DEFAULT_FPS
    return [start_s + number / rate for number in range(stream.n_frames)]


def _largest(achieved: _Achieved) -> str:
    percent, frame = float(achieved.percents.max()), int(achieved.percents.argmax())
    added = "" if achieved.budget.origin is None else " added"
    return f"the largest error{added} is {percent:.4f} % of the diagonal, in frame {frame},"


def _note_achieved(notes: list[str], achieved: _Achieved, size_bytes: int) -> None:
    counts = achieved.scene.n_targets
    added = achieved.budget.diagonal * float(achieved.percents.max()) / 100
    if not counts:
        if achieved.n_frames > 1:
            notes.append("no vertex moves by more than the error allowed: written at rest")
        notes += achieved.budget.describe(added)
        return
    number = f"{counts[0]} to " if counts[0] < counts[-1] else ""
    where = f" in each of {len(counts)} meshes" if len(counts) > 1 else ""
    notes.append(
        f"{_largest(achieved)} with {number}{counted(counts[-1], 'morph target')}{where}: "
        f"{size_bytes / 1e6:.3g} MB"
    )
    notes += achieved.budget.describe(added)
    if counts[-1] > MANY_TARGETS:
        notes.append(
            f"some viewers play no more than {MANY_TARGETS} morph targets of a mesh; "
            "allow a larger error (max_error) for fewer"
        )


def _note_normals(notes: list[str], scene: Scene, options: WriteOptions) -> None:
    """One sentence on which meshes have normals, and how near these are while they move."""
    if options.normals is False:
        return
    have = [one.normals for one in scene.meshes if one.normals is not None]
    if not have:
        reason = TOO_FEW_TARGETS if options.targets == 1 else WHY_FLAT
        notes.append(f"no normals, so viewers shade it flat: {reason}")
        return
    angle_deg = max(one.angle_deg for one in have)
    moving = f", off by {angle_deg:.1f} degrees in the mean as they move" if angle_deg else ""
    few = f" of {len(have)} of {len(scene.meshes)} meshes" if len(have) < len(scene.meshes) else ""
    rest = f"; of the others none: {WHY_FLAT}" if few else ""
    hard = " but at hard edges" if scene.has_hard_edges else ""
    if moving or few or hard:
        notes.append(f"normals{few} are smooth{hard}{moving}{rest}")


class _SceneWriter:
    """The scene so far."""

    def __init__(self, surface: Surface, notes: list[str]) -> None:
        self.buffer, self.tree = BufferWriter(), NodeTree()
        self.materials = Materials(surface, self.buffer, notes)
        self.meshes: list[Json] = []
        self.moving: list[MovingMesh] = []
        self.nodes: list[int] = []
        self.n_isolated = 0

    def add(self, part: PartMesh, sequence: MeshSequence, wanted: Wanted) -> None:
        """Add a part; one without faces has nothing to be seen."""
        hard_edges = part.surface.hard_edges
        if wanted.normals is NormalChoice.NONE:
            hard_edges = None  # vertices are split for normals only
        n_verts = part.verts.stop - part.verts.start
        shading = RowNormals(part.counts, part.corners, hard_edges, n_verts)
        split = split_at_seams(part, shading.rows.of_corner)
        used = np.zeros(n_verts, bool)
        used[split.sources] = True
        self.n_isolated += int((~used).sum())
        if not len(split.sources):
            return
        number = np.cumsum(used) - 1
        faces = number[triangulate_fans(part.counts, part.corners)].astype(np.int32)
        is_used = used[shading.rows.vertices]
        of_rows = np.cumsum(is_used) - 1
        shaded = Shaded(
            number[shading.rows.vertices[is_used]],
            of_rows[shading.triangles].astype(np.int32),
            has_hard_edges=hard_edges is not None,
        )
        positions = sequence.vertices[:, part.verts]
        moving = fit_part(positions if used.all() else positions[:, used], faces, wanted, shaded)
        split = split.renumbered(number, of_rows)
        name = path_of(part.name)[-1]
        self.nodes.append(self.tree.add(part.name, len(self.meshes), moving.placement))
        self.meshes.append(write_mesh(name, split, moving, self.buffer, self.materials))
        self.moving.append(moving)

    def animation(self, name: str, times_s: Sequence[float]) -> Json | None:
        """The animation of all meshes that move; None if none does."""
        samplers: list[Json] = []
        channels: list[Json] = []
        times = np.asarray(times_s, np.float32)
        for node, moving in zip(self.nodes, self.moving, strict=True):
            if moving.morphs is None:
                continue
            if not samplers:
                shared = self.buffer.add_samples(times, are_times=True)
            values = self.buffer.add_samples(moving.morphs.weights, are_times=False)
            target = {"node": node, "path": "weights"}
            channels.append({"sampler": len(samplers), "target": target})
            samplers.append({"input": shared, "output": values, "interpolation": "LINEAR"})
        return {"name": name, "samplers": samplers, "channels": channels} if samplers else None


def make_scene(
    sequence: MeshSequence, times_s: Sequence[float], wanted: Wanted, notes: list[str]
) -> Scene:
    """The scene that plays a sequence.

    Parameters
    ----------
    times_s : sequence of float
        When frames are, not negative.
    notes : list of str
        Gains a sentence for each thing of a material that glTF cannot have.
    """
    writer = _SceneWriter(sequence.surface, notes)
    parts = split_parts(sequence.faces, sequence.surface, sequence.n_verts, sequence.name)
    for part in sorted(parts, key=lambda one: len(path_of(one.name))):
        writer.add(part, sequence, wanted)
    animation = writer.animation(sequence.name or "animation", times_s)
    document: Json = {
        "asset": {"version": "2.0", "generator": "meshreel"},
        "scene": 0,
        "scenes": [{"name": sequence.name or "scene", "nodes": writer.tree.roots}],
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
        required.add(QUANTIZATION)
    has_hard_edges = sequence.surface.hard_edges is not None
    used = required | writer.materials.textures.used
    extensions = {"extensionsUsed": sorted(used), "extensionsRequired": sorted(required)}
    document |= {key: names for key, names in extensions.items() if names}
    return Scene(document, writer.buffer, writer.moving, writer.n_isolated, has_hard_edges)
