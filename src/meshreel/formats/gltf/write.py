"""Writing glTF: an animation of morph targets, or of bones with corrective morph targets."""

import math
from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Bytes
from meshreel.codec.error_bounds import bound_of
from meshreel.errors import InvalidInputError, Keyword, Message
from meshreel.formats.error_budget import requested_budget
from meshreel.formats.frames.frame_stream import FrameStream, SegmentedStream
from meshreel.formats.frames.shared_data import share_materials
from meshreel.formats.gltf.container import (
    IDENTITY,
    JOINTS,
    Json,
    document_bytes,
    path_of,
    write_document,
)
from meshreel.formats.gltf.materials import Materials
from meshreel.formats.gltf.mesh_writer import (
    MorphMesh,
    SceneWriter,
    ShadingMesh,
    add_attributes,
    describe_losses,
    fit_part,
    mesh_json,
    write_mesh,
)
from meshreel.formats.gltf.morphs import check_range, static_normals, wants_normals
from meshreel.formats.gltf.read import ERROR_BOUND, SEGMENT_START, list_animations, read_meshes
from meshreel.formats.kinds import SequenceFormat
from meshreel.formats.options import WriteOptions
from meshreel.formats.rigs import FittedRig, is_rigged
from meshreel.formats.scenes.parts import PartMesh, split_parts
from meshreel.model.notes import Notes, written_times
from meshreel.model.rig import Rig
from meshreel.model.rig_bounds import MAX_BONES
from meshreel.model.sequence import MeshSequence
from meshreel.runtime.counting import counted, size_text
from meshreel.runtime.progress import Progress

DEFAULT_MAX_ERROR = 0.1
"""Percent of the diagonal: one pixel in a thousand, for a mesh that fills the image."""

MAX_COMMON_TARGETS = 256
"""Texture layers that every GPU supports (WebGL 2); some viewers cannot play more targets."""

CREASED_REASON = "much of the surface is creased (--normals, normals=True, writes them anyway)"


def write_morphs(path: Path, stream: SegmentedStream, options: WriteOptions) -> int:
    """Fit all segments, write them, and note the errors; return the bytes of the file.

    All frames of a segment, and the file, are in memory. Each segment has its own meshes, below a
    node whose scale is 1 in its frames and 0 in the others.
    """
    _check_bound(options)
    notes = stream.notes

    shared_stream, _ = share_materials(
        stream, lambda mesh: notes.add_all(describe_losses(mesh.surface, len(mesh.faces)))
    )
    times_s = frame_times(stream)
    segments: Iterable[MeshSequence]
    if stream.n_segments == 1:
        [segments] = [[segment.gather()] for segment in stream.segments()]
        extent = segments[0].extent
        low, high = extent.low, extent.high
    else:
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for frame in stream.frames():
            low, high = np.minimum(low, frame.min(axis=0)), np.maximum(high, frame.max(axis=0))
        segments = (segment.gather() for segment in shared_stream.segments())
    check_range(low, high)
    allowed, budget = requested_budget(
        low, high, options, DEFAULT_MAX_ERROR, consumer="morph targets"
    )
    scene = _MorphScene(stream.name, times_s, budget.max_added, options, notes, stream.progress)
    for segment in segments:
        scene.add_segment(segment)
    document = scene.document()
    scene.note_isolated()
    errors = np.concatenate(scene.errors)
    percent, worst_frame = budget.percent(float(errors.max())), int(errors.argmax())
    added = "" if budget.origin is None else " added"
    error = f"the largest error{added} is {percent:.4f} % of the diagonal, in frame {worst_frame},"
    n_targets = sorted(len(mesh.morphs.targets) for mesh in scene.morph_meshes if mesh.morphs)
    if budget.max_added and n_targets and errors.max() > budget.max_added:
        remaining = budget.percent(budget.max_added)
        is_shared = not math.isclose(remaining, allowed)
        bound = f"{remaining:.4g} % of {allowed:g} % remain" if is_shared else f"{allowed:g} % is"
        raise InvalidInputError(
            f"{error} with {counted(n_targets[-1], 'morph target')}; {bound} allowed; allow a "
            "larger error (",
            Keyword("max_error"),
            ")",
        )
    document["asset"]["extras"] = {ERROR_BOUND: budget.total(float(errors.max()))}
    size = write_document(path, document, scene.buffer, "allow a larger error (max_error)")
    if n_targets:
        number = f"{n_targets[0]} to " if n_targets[0] < n_targets[-1] else ""
        suffix = f" in each of {len(n_targets)} meshes" if len(n_targets) > 1 else ""
        notes.result(
            f"{error} with {number}{counted(n_targets[-1], 'morph target')}{suffix}: "
            f"{size_text(size.stored)}"
        )
    elif len(times_s) > 1:
        notes.result("no vertex moves by more than the error bound: written as a static mesh")
    notes += budget.describe(budget.diagonal * (budget.percent(float(errors.max())) / 100))
    if n_targets and n_targets[-1] > MAX_COMMON_TARGETS:
        notes.result(
            Message(
                f"some viewers play at most {MAX_COMMON_TARGETS} morph targets per mesh; "
                "allow a larger error (",
                Keyword("max_error"),
                ") for fewer",
            )
        )
    _note_normals(notes, scene, options)
    scene.note_form(size)
    return size.stored


def _check_bound(options: WriteOptions) -> None:
    """Raise InvalidInputError if the error bound is out of range, before any work."""
    if options.max_error is not None:
        bound_of(options.max_error)


def frame_times(stream: SegmentedStream) -> Sequence[float]:
    """Return the times of frames in seconds; glTF has no negative times."""
    notes = stream.notes if stream.n_frames > 1 else Notes()
    times, start_s = written_times(stream.timing, stream.n_frames, notes), stream.timing.start_s
    if start_s < 0:
        stream.notes.changed(f"starts at 0 s, not {start_s:g} s: glTF has no time before 0")
        times = times - start_s
    if stream.timing.times is not None and (times.astype(np.float32) != times).any():
        notes.changed("frame times", "glTF stores times as float32, to which these are rounded")
    seconds: list[float] = times.tolist()
    return seconds


def _note_normals(notes: Notes, scene: "_MorphScene", options: WriteOptions) -> None:
    """Note which meshes have normals, and the error of animated normals."""
    if options.normals is False:
        return
    normals = [mesh.normals for mesh in scene.morph_meshes if mesh.normals is not None]
    if not normals:
        notes.unwritten(f"no normals, so viewers use flat shading: {CREASED_REASON}")
        return
    angle_deg = max(targets.angle_deg for targets in normals)
    error = f", with a mean error of {angle_deg:.1f} degrees in motion" if angle_deg else ""
    n_meshes = len(scene.morph_meshes)
    subset = f" of {len(normals)} of {n_meshes} meshes" if len(normals) < n_meshes else ""
    without_normals = f"; the others have none: {CREASED_REASON}" if subset else ""
    exception = " except at hard edges" if scene.has_hard_edges else ""
    if error or subset or exception:
        notes.result(f"normals{subset} are smooth{exception}{error}{without_normals}")


class _MorphScene(SceneWriter):
    """Collects the segments of a sequence, with morph targets.

    Parameters
    ----------
    bound : float
        Largest error of a vertex, in model units.

    Attributes
    ----------
    morph_meshes : list of MorphMesh
        Meshes of the parts that have faces.
    errors : list of float arrays of shape (T,)
        Largest error of a vertex in each frame of each segment, in model units.
    """

    def __init__(
        self,
        name: str,
        times_s: Sequence[float],
        bound: float,
        options: WriteOptions,
        notes: Notes,
        progress: Progress,
    ) -> None:
        super().__init__(name, times_s, options, notes)
        self._progress, self._reported = progress, (0.0, 1.0)  # start and share of a part
        self.morph_meshes: list[MorphMesh] = []
        self.errors: list[npt.NDArray[np.floating]] = []
        self.has_hard_edges = False
        self._bound = bound
        self._materials: Materials | None = None
        self._nodes: list[tuple[int, slice]] = []
        self._segments: list[tuple[int, slice]] = []

    def add_segment(self, segment: MeshSequence) -> None:
        """Add the next segment; all have the same materials."""
        materials = self._materials or Materials(segment.surface, self.buffer, self._notes)
        self._materials = materials
        first = sum(map(len, self.errors))
        frames = slice(first, first + segment.n_frames)
        self.has_hard_edges = self.has_hard_edges or segment.surface.hard_edges is not None
        parent_path = "" if segment.n_frames == len(self._times_s) else self._group(frames)
        n_before = len(self.morph_meshes)
        parts = [*split_parts(segment.faces, segment.surface, segment.n_verts, self._name)]
        share = segment.n_frames / len(self._times_s) / len(parts)
        for number, part in enumerate(sorted(parts, key=lambda part: len(path_of(part.name)))):
            self._reported = first / len(self._times_s) + number * share, share
            path = "/".join([parent_path, *path_of(part.name)]) if parent_path else part.name
            self._add_part(replace(part, name=path), segment, frames, materials)
        errors = [mesh.errors for mesh in self.morph_meshes[n_before:]]
        self.errors.append(np.max(errors, axis=0) if errors else np.zeros(segment.n_frames))

    def _report(self, stage: str, share: float) -> None:
        """Report the share of all parts, given that of the current one."""
        first, part_share = self._reported
        self._progress(stage, first + part_share * share)

    def document(self) -> Json:
        """Return the JSON of the file, without the buffer, after adding the animation."""
        assert self._materials is not None
        self._add_animation()
        return self.assemble(self._materials)

    def _group(self, frames: slice) -> str:
        """Add a node above the meshes of a segment with these frames; return its path."""
        number = len(self._segments)
        label = f"{self._name or 'segment'} {number}".replace("/", "_")
        node = self.tree.group(label)
        json = self.tree.nodes[node]
        json["extras"] = {SEGMENT_START: float(self._times_s[frames.start])}
        # Without an animation, the first segment is shown.
        if number:
            json["scale"] = [0.0, 0.0, 0.0]
        self._segments.append((node, frames))
        return f"/{label}"

    def _add_part(
        self, part: PartMesh, sequence: MeshSequence, frames: slice, materials: Materials
    ) -> None:
        """Add a part of a segment with these frames; skip a part without faces."""
        split, shading, has_hard_edges = self._split_part(part)
        if not len(split.sources):
            return
        is_used_vertex = np.zeros(part.verts.stop - part.verts.start, bool)
        is_used_vertex[split.sources] = True
        vertex_indices = np.cumsum(is_used_vertex) - 1
        faces = vertex_indices[part.faces].astype(np.int32)
        is_used = is_used_vertex[shading.rows.vertices]
        row_indices = np.cumsum(is_used) - 1
        shading_mesh = ShadingMesh(
            vertex_indices[shading.rows.vertices[is_used]],
            row_indices[shading.triangles].astype(np.int32),
            has_hard_edges=has_hard_edges,
        )
        positions = sequence.vertices[:, part.verts]
        used_positions = positions if is_used_vertex.all() else positions[:, is_used_vertex]
        morph_mesh = fit_part(
            used_positions, faces, self._bound, self._options, shading_mesh, self._report
        )
        split = split.with_indices(vertex_indices, row_indices)
        node = self.tree.add(part.name, len(self.meshes), morph_mesh.placement)
        self._nodes.append((node, frames))
        name = path_of(part.name)[-1]
        self.meshes.append(write_mesh(name, split, morph_mesh, self.buffer, materials))
        self.morph_meshes.append(morph_mesh)

    def _add_animation(self) -> None:
        """Animate all segments, and meshes with targets."""
        for (node, frames), morph_mesh in zip(self._nodes, self.morph_meshes, strict=True):
            if morph_mesh.morphs is not None:
                keys = self._times_accessor(np.arange(frames.start, frames.stop))
                values = self.buffer.add_rows(morph_mesh.morphs.weights, width=1)
                self._animate(node, "weights", keys, values, interpolation="LINEAR")
        n_frames = len(self._times_s)
        for node, frames in self._segments:
            # The first segment has keys in all frames, so that readers find each of them even if no
            # vertex moves.
            switch_frames = sorted({0, frames.start, min(frames.stop, n_frames - 1)})
            indices = [*range(n_frames)] if frames.start == 0 else switch_frames
            scales = np.array([3 * [float(frames.start <= key < frames.stop)] for key in indices])
            keys = self.buffer.add_rows(self._times_s[indices, np.newaxis], has_bounds=True)
            values = self.buffer.add_rows(scales)
            self._animate(node, "scale", keys, values, interpolation="STEP")


NORMAL_LEVELS = 127
POSE_DIGITS, EXACT_DIGITS = 3, 9
"""Significant digits of the pose of nodes in the first frame, and of float32 values."""


def write_rigged(
    path: Path,
    stream: SegmentedStream,
    options: WriteOptions,
    fitted: FittedRig,
    limit_bytes: float = math.inf,
) -> int:
    """Write a rig in place of the frames, and report the sizes; return the bytes of the file.

    A file of `limit_bytes` or more is not written.
    """
    _check_bound(options)
    times_s, mesh = frame_times(stream), stream.only()
    check_range(fitted.extent.low, fitted.extent.high)
    stream.notes.add_all(describe_losses(mesh.surface, len(mesh.faces)))
    scene = _RiggedScene(times_s, mesh, fitted.rig, options, stream.notes)
    document = scene.document()
    document["asset"]["extras"] = {ERROR_BOUND: fitted.error}
    if (size_bytes := document_bytes(document, scene.buffer)) >= limit_bytes:
        return size_bytes
    size = write_document(path, document, scene.buffer, "allow larger errors (max_error)")
    sizes = {**scene.sizes, "description": size.stored - sum(scene.sizes.values())}
    sizes = {name: size_bytes for name, size_bytes in sizes.items() if size_bytes}
    sizes_text = ", ".join(f"{name} {size / 1e3:.0f}" for name, size in sizes.items())
    stream.report({"sizes_bytes": sizes}, f"{size_text(size.stored)}: {sizes_text} kB")
    scene.note_form(size)
    return size_bytes


class _RiggedScene(SceneWriter):
    """Collects the meshes of a rigged sequence, with a skin and its bones.

    Attributes
    ----------
    sizes : dict of str to int
        Bytes of the buffer by purpose.
    """

    def __init__(
        self,
        times_s: Sequence[float],
        mesh: FrameStream,
        rig: Rig,
        options: WriteOptions,
        notes: Notes,
    ) -> None:
        super().__init__(mesh.name, times_s, options, notes)
        self.sizes: dict[str, int] = {}
        self._rig = rig
        self._materials = Materials(mesh.surface, self.buffer, notes)
        self._mesh_nodes: list[int] = []
        parts = split_parts(mesh.faces, mesh.surface, mesh.n_verts, mesh.name)
        for part in sorted(parts, key=lambda part: len(path_of(part.name))):
            self._add_part(part)
        self.note_isolated()

    def document(self) -> Json:
        """Return the JSON of the file, without the buffer, after adding the bones."""
        bones = self._add_bones()
        binds = self.buffer.add_rows(self._rig.inverse_binds.transpose(0, 2, 1).reshape(-1, 16))
        if len(self._times_s) > 1:
            self._add_animation(bones)
        self._count("bones and keys")
        document = self.assemble(self._materials)
        return document | {"skins": [{"inverseBindMatrices": binds, "joints": bones}]}

    def _count(self, purpose: str) -> None:
        """Count the bytes since the last count for a purpose."""
        new_bytes = self.buffer.size_bytes - sum(self.sizes.values())
        self.sizes[purpose] = self.sizes.get(purpose, 0) + new_bytes

    def _add_part(self, part: PartMesh) -> None:
        rig, buffer = self._rig, self.buffer
        split, shading, has_hard_edges = self._split_part(part)
        if not len(split.sources):
            return
        sources = split.sources + part.verts.start
        values: dict[str, npt.NDArray[Any]] = {"POSITION": rig.coordinates[sources]}
        rest = rig.rest[part.verts]
        has_normals = wants_normals(self._options.normals, rest, part.faces)
        if has_normals or has_hard_edges:
            normals = static_normals(rest[shading.rows.vertices], shading.triangles).base
            values["NORMAL"] = np.rint(normals * NORMAL_LEVELS).astype(np.int8)[split.rows]
        base = add_attributes(values | split.attributes, buffer)
        self._count("mesh")
        joints, weights = align_influences(rig.joints[sources], rig.weights[sources])
        base |= add_attributes({JOINTS: joints, "WEIGHTS_0": weights}, buffer)
        self._count("weights")
        moved = [target[sources] for target in rig.correctives.targets]
        targets = [{"POSITION": each} for each in buffer.add_vertices(moved)] if moved else []
        self._count("correctives")
        first_weights = rig.correctives.weights[0] if rig.n_targets else None
        path = path_of(part.name)
        self._mesh_nodes.append(self.tree.add(part.name, len(self.meshes), IDENTITY))
        self.tree.nodes[self._mesh_nodes[-1]]["skin"] = 0
        self.meshes.append(
            mesh_json(path[-1], split, base, targets, first_weights, buffer, self._materials)
        )
        self._count("mesh")

    def _add_bones(self) -> list[int]:
        """Add the nodes of the bones below one at the origin of the rig; return their indices."""
        rig, nodes = self._rig, self.tree.nodes
        armature = self.tree.group(f"{self._name or 'mesh'} skeleton".replace("/", "_"))
        if rig.origin.any():
            nodes[armature]["translation"] = rig.origin.tolist()
        bones: list[int] = []
        names, parents = rig.skeleton.names, rig.skeleton.parents.tolist()
        for name, parent, track in zip(names, parents, rig.tracks, strict=True):
            node: Json = {"name": name}
            quaternions, translations = track.poses(rig.times_s)
            for path, values in (("translation", translations), ("rotation", quaternions)):
                # Values without channel are exact; others only show while nothing plays.
                digits = POSE_DIGITS if moves(values) else EXACT_DIGITS
                node[path] = [float(f"{value:.{digits}g}") for value in values[0].tolist()]
            parent_node = nodes[armature if parent < 0 else bones[parent]]
            parent_node.setdefault("children", []).append(len(nodes))
            bones.append(len(nodes))
            nodes.append(node)
        return bones

    def _add_animation(self, bones: list[int]) -> None:
        """Animate the bones and correctives."""
        rig, buffer = self._rig, self.buffer
        pairs = [*zip(bones, rig.tracks, strict=True)]
        # The root has keys in all frames, even if it rests, so that readers find all of them.
        turning = [(node, track) for node, track in pairs if moves(track.codes) or node == bones[0]]
        moving = [(node, track) for node, track in pairs if moves(track.translations)]
        self._add_times(track.frames for _, track in [*turning, *moving])
        codes = np.concatenate([track.codes for _, track in turning])
        rotations = buffer.add_curves(
            [track.rotations for _, track in turning], (codes, "QUATERNION")
        )
        for (node, track), values in zip(turning, rotations, strict=True):
            self._animate(node, "rotation", self._times_accessor(track.frames), values)
        if moving:
            translations = buffer.add_curves([track.translations for _, track in moving])
            for (node, track), values in zip(moving, translations, strict=True):
                self._animate(node, "translation", self._times_accessor(track.frames), values)
        if rig.n_targets:
            self._count("bones and keys")
            all_frames = np.arange(len(rig.times_s))
            weights = buffer.add_rows(rig.correctives.weights, width=1)
            for node in self._mesh_nodes:
                self._animate(node, "weights", self._times_accessor(all_frames), weights)
            self._count("correctives")


def moves(keys: npt.NDArray[np.generic]) -> bool:
    """Return whether keys of shape (N, C) differ."""
    return bool((keys != keys[0]).any())


def align_influences(joints: Bytes, weights: Bytes) -> tuple[Bytes, Bytes]:
    """Return the influences of vertices, of shape (V, 4), in an order that compresses well.

    A bone stays in the column in which the last vertex had it. Unused joints are 0, as glTF
    recommends.
    """
    columns = [0, 0, 0, 0]
    aligned_joints, aligned_weights = np.zeros_like(joints), np.zeros_like(weights)
    for row, (bones, shares) in enumerate(zip(joints.tolist(), weights.tolist(), strict=True)):
        influences = sorted(zip(shares, bones, strict=True), reverse=True)
        pending = {joint: share for share, joint in influences if share}
        free_columns = []
        for column, joint in enumerate(columns):
            if joint in pending:
                aligned_joints[row, column] = joint
                aligned_weights[row, column] = pending.pop(joint)
            else:
                free_columns.append(column)
        for column, (joint, share) in zip(free_columns, pending.items(), strict=False):
            columns[column] = joint
            aligned_joints[row, column], aligned_weights[row, column] = joint, share
    return aligned_joints, aligned_weights


def write_gltf(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write a self-contained file: a rig if the options request one, or morph targets.

    With an error bound, the smaller of both, unless the options decide. A ``.gltf`` file is a third
    larger than a ``.glb`` file, since its buffer is base64. Adds the achieved errors to
    `stream.notes`.

    Raises
    ------
    InvalidInputError
        If the options are out of range, their error bound cannot be met, or the file is too large.
    """
    if is_rigged(options):
        assert stream.rig is not None  # see `save_part`
        write_rigged(path, stream, options, stream.rig)
        return
    n_notes = len(stream.notes)
    n_bytes = write_morphs(path, stream, options)
    if options.max_error is None or options.rig is not None or stream.fit_rig is None:
        return
    mesh = next(stream.meshes())
    n_vertex_bytes = mesh.n_verts * (MIN_VERTEX_BYTES if options.meshopt else PLAIN_VERTEX_BYTES)
    max_bones = min((n_bytes - n_vertex_bytes) // BONE_BYTES, MAX_BONES)
    if stream.n_segments > 1 or stream.n_frames < 2 or max_bones < 1:
        return
    other = copy(stream)
    other.notes, other.figures = Notes(), None if stream.figures is None else {}
    fitted = stream.fit_rig(other, options, max_bones)
    if fitted is None:
        return
    n_rig_bytes = write_rigged(path, other, options, fitted, n_bytes)
    if n_rig_bytes < n_bytes:
        del stream.notes[n_notes:]
        stream.notes.add_all(other.notes)
        text = f"written as a rig, since morph targets within the bound take {size_text(n_bytes)} ("
        stream.notes.result(Message(text, Keyword("rig", "0"), " writes those)"))
        if stream.figures is not None:
            stream.figures |= other.figures or {}


PLAIN_VERTEX_BYTES, MIN_VERTEX_BYTES, BONE_BYTES = 20, 8, 300
"""Lower estimates of the bytes that a rig takes: a vertex, also compressed, and a bone."""

FORMATS = tuple(
    SequenceFormat(
        extension,
        title,
        read_meshes=read_meshes,
        write=write_gltf,
        holds_segments=True,
        refers_to_files=True,
        write_options=frozenset({"max_error", "normals", "meshopt", "rig", "kg", "quality"}),
        holds_materials=True,
        list_animations=list_animations,
    )
    for extension, title in (
        (".glb", "glTF, binary"),
        (".gltf", "glTF, text"),
    )
)
