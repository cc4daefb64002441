"""Writing glTF: a skinned mesh, its bones with their keys, and corrective morph targets."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Bytes
from meshreel.formats.frames.frame_stream import SegmentedStream
from meshreel.formats.gltf.container import IDENTITY, JOINTS, Json, path_of, write_document
from meshreel.formats.gltf.materials import Materials
from meshreel.formats.gltf.mesh_writer import (
    SceneWriter,
    StoredValues,
    add_attributes,
    describe_losses,
    mesh_json,
)
from meshreel.formats.gltf.morphs import check_range, static_normals, wants_normals
from meshreel.formats.gltf.write import check_options, frame_times
from meshreel.formats.options import WriteOptions
from meshreel.formats.rigs import rig_of
from meshreel.formats.scenes.parts import PartMesh, split_parts
from meshreel.model.notes import Notes
from meshreel.model.sequence import MeshSequence
from meshreel.rigging.rig import Rig

NORMAL_LEVELS = 127
POSE_DIGITS, EXACT_DIGITS = 4, 9
"""Significant digits of the pose of nodes in the first frame, and of float32 values."""


def write_rigged(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Fit a rig, write it, and report the sizes.

    Raises
    ------
    InvalidInputError
        As `meshreel.formats.rigs.rig_of`, if the options are out of range, or if the file is too
        large.
    """
    check_options(options)
    times_s = np.asarray(frame_times(stream))
    sequence, rig = rig_of(stream, options, times_s)
    check_range(sequence.extent.low, sequence.extent.high)
    stream.notes.add_all(describe_losses(sequence.surface, len(sequence.faces)))
    scene = _RiggedScene(stream.name, sequence, rig, options, stream.notes)
    document = scene.document()
    size_bytes = write_document(path, document, scene.buffer, "allow larger errors (max_error)")
    sizes = scene.sizes_in_file(size_bytes)
    shown = ", ".join(f"{name} {size / 1e3:.0f}" for name, size in sizes.items())
    stream.report({"sizes_bytes": sizes}, f"{size_bytes / 1e3:.0f} kB: {shown}")
    scene.note_compression()


class _RiggedScene(SceneWriter):
    """Collects the meshes of a rigged sequence, with a skin and its bones.

    Attributes
    ----------
    sizes : dict of str to int
        Bytes of the buffer by purpose.
    """

    def __init__(
        self,
        name: str,
        sequence: MeshSequence,
        rig: Rig,
        options: WriteOptions,
        notes: Notes,
    ) -> None:
        super().__init__(name, rig.times_s.tolist(), options, notes)
        self.sizes: dict[str, int] = {}
        self._rig = rig
        self._materials = Materials(sequence.surface, self.buffer, notes)
        self._mesh_nodes: list[int] = []
        parts = split_parts(sequence.faces, sequence.surface, len(rig.coordinates), name)
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

    def sizes_in_file(self, size_bytes: int) -> dict[str, int]:
        """Return the bytes of the file by purpose."""
        parts = {**self.sizes, "description": size_bytes - sum(self.sizes.values())}
        return {name: size for name, size in parts.items() if size}

    def _count(self, purpose: str) -> None:
        """Count the bytes since the last count for a purpose."""
        new = self.buffer.size_bytes - sum(self.sizes.values())
        self.sizes[purpose] = self.sizes.get(purpose, 0) + new

    def _add_part(self, part: PartMesh) -> None:
        rig, buffer = self._rig, self.buffer
        split, shading, has_hard_edges = self._split(part)
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
        targets = self._add_targets(sources)
        self._count("correctives")
        first = rig.correctives.weights[0] if rig.n_targets else None
        path = path_of(part.name)
        self._mesh_nodes.append(self.tree.add(part.name, len(self.meshes), IDENTITY))
        self.tree.nodes[self._mesh_nodes[-1]]["skin"] = 0
        self.meshes.append(
            mesh_json(path[-1], split, base, targets, first, buffer, self._materials)
        )
        self._count("mesh")

    def _add_targets(self, sources: npt.NDArray[np.int64]) -> list[StoredValues]:
        targets = self._rig.correctives.targets
        if not len(targets):
            return []
        displacements = self.buffer.add_vertices([target[sources] for target in targets])
        return [{"POSITION": values} for values in displacements]

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
            above = nodes[armature if parent < 0 else bones[parent]]
            above.setdefault("children", []).append(len(nodes))
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
        codes = np.concatenate([track.codes for _, track in turning])
        rotations = buffer.add_curves(
            [track.rotations for _, track in turning], (codes, "QUATERNION")
        )
        for (node, track), values in zip(turning, rotations, strict=True):
            self._animate(node, "rotation", self._times(track.frames), values)
        if moving:
            translations = buffer.add_curves([track.translations for _, track in moving])
            for (node, track), values in zip(moving, translations, strict=True):
                self._animate(node, "translation", self._times(track.frames), values)
        if rig.n_targets:
            self._count("bones and keys")
            all_frames = np.arange(len(rig.times_s))
            weights = buffer.add_rows(rig.correctives.weights, width=1)
            for node in self._mesh_nodes:
                self._animate(node, "weights", self._times(all_frames), weights)
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
    for row, (own, shares) in enumerate(zip(joints.tolist(), weights.tolist(), strict=True)):
        influences = sorted(zip(shares, own, strict=True), reverse=True)
        pending = {joint: share for share, joint in influences if share}
        free = []
        for column, joint in enumerate(columns):
            if joint in pending:
                aligned_joints[row, column] = joint
                aligned_weights[row, column] = pending.pop(joint)
            else:
                free.append(column)
        for column, (joint, share) in zip(free, pending.items(), strict=False):
            columns[column] = joint
            aligned_joints[row, column], aligned_weights[row, column] = joint, share
    return aligned_joints, aligned_weights
