"""Reading glTF: every node that shows a mesh, as it moves in the world.

The JSON is parsed by the standard library and checked here: libraries for glTF take indices and
sizes on trust, which files from anywhere do not earn.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property, partial
from pathlib import Path

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import FormatError
from meshreel.formats.animations import AnimationInfo
from meshreel.formats.gltf.accessors import Accessors
from meshreel.formats.gltf.animation import Channel
from meshreel.formats.gltf.clips import Clips
from meshreel.formats.gltf.document import INSTANCING, Document, read_document
from meshreel.formats.gltf.geometry import Geometry, read_geometry
from meshreel.formats.gltf.instancing import note_instances
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.material_reading import MaterialReader, note_unkept
from meshreel.formats.gltf.motion import Matrices, Motion
from meshreel.formats.gltf.nodes import Nodes, read_nodes, unique_names
from meshreel.formats.gltf.primitives import count_targets, is_read, surfaces
from meshreel.formats.gltf.sampling import STILL, Sampling, sample_times
from meshreel.formats.gltf.shown import (
    Placement,
    nothing_shown,
    placements_of,
    shape_of,
    shown_nodes,
)
from meshreel.formats.gltf.skinning import Skin, move
from meshreel.formats.notes import listed, note_kinds, note_left_out
from meshreel.formats.options import ReadOptions
from meshreel.formats.scenes.scene_mesh import SceneMesh, read_or_defer_error
from meshreel.formats.surfaces.hard_edges import NormalNotes
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh
from meshreel.model.sequence import validate_fps
from meshreel.model.surface import Surface
from meshreel.runtime.counting import counted

LIGHTS = "KHR_lights_punctual"

POSE_BYTES = 1 << 24
"""Transforms of nodes are computed for as many frames at once as take about this much memory."""


class WeldNote:
    """One sentence on all vertices that were welded, as meshes are read one after the other.

    Parameters
    ----------
    notes : list of str
        Gains the sentence, which changes later.
    """

    def __init__(self, notes: list[str]) -> None:
        self._notes, self._sentence = notes, ""
        self._n_split = self._n_verts = 0

    def add(self, n_split: int, n_verts: int) -> None:
        """Tell of a mesh that has so many vertices in the file, and here."""
        if n_split == n_verts:
            return
        self._n_split, self._n_verts = self._n_split + n_split, self._n_verts + n_verts
        if self._sentence in self._notes:
            self._notes.remove(self._sentence)
        self._sentence = (
            f"welded {counted(self._n_split, 'vertex')}, split at seams, to {self._n_verts}"
        )
        self._notes.append(self._sentence)


def read_meshes(path: Path, options: ReadOptions) -> list[SceneMesh]:
    """The meshes of the scene that a glTF file shows, named by the paths of their nodes.

    The animation is the one that the options name, or the first that moves a mesh; what it does
    not move has one frame.

    Raises
    ------
    FormatError
        If the file is damaged, shows no mesh, or needs an extension that is not read.
    InvalidInputError
        If it has no animation of the name or number that the options give.
    """
    document = read_document(path, allow_outside=options.allow_outside)
    accessors, nodes = Accessors(document), read_nodes(document)
    shown = shown_nodes(document, nodes, options.notes)
    placements = placements_of(document, shown, accessors)
    if not placements:
        raise nothing_shown(document, nodes)
    motion, sampling = _motion(placements, nodes, accessors, options)
    _note_left_out(document, placements, options.notes)
    read = _geometry_reader(accessors, options.notes)
    names = unique_names([nodes.path(one.node, _mesh_name(document, one)) for one in placements])
    moves = _mover(placements, motion)

    def shape(placement: Placement) -> Geometry:
        return shape_of(placement, read(placement.mesh), accessors)

    def scene_mesh(name: str, placement: Placement) -> SceneMesh:
        times = sampling if moves(placement) else sampling.first()
        return _scene_mesh(name, placement, motion, times, lambda: shape(placement), document)

    return [
        read_or_defer_error(name, partial(scene_mesh, name, one))
        for name, one in zip(names, placements, strict=True)
    ]


def list_animations(path: Path, options: ReadOptions) -> list[AnimationInfo]:
    """The animations of a glTF file, in its order; the notes of the options gain nothing.

    Raises
    ------
    FormatError
        If the file is damaged elsewhere than in an animation.
    """
    document = read_document(path, allow_outside=options.allow_outside)
    accessors, nodes = Accessors(document), read_nodes(document)
    placements = placements_of(document, shown_nodes(document, nodes, []), accessors)
    return Clips(nodes, accessors, _mesh_mover(placements, nodes)).described()


def _motion(
    placements: Sequence[Placement], nodes: Nodes, accessors: Accessors, options: ReadOptions
) -> tuple[Motion, Sampling]:
    """How nodes move that carry meshes, and when frames are."""
    clips = Clips(nodes, accessors, _mesh_mover(placements, nodes))
    clip = clips.chosen(options.animation, options.notes)
    if clip is None:
        return Motion(nodes, {}), STILL
    is_curved = any(curve.is_curved for curve in clip.curves.values())
    fps = validate_fps(options.fps or 0.0)
    sampling = sample_times(clip.keys_s, fps, is_curved=is_curved, notes=options.notes)
    return Motion(nodes, clip.curves), sampling


def _mesh_mover(placements: Sequence[Placement], nodes: Nodes) -> Callable[[Channel], bool]:
    """A function that tells whether a channel moves a mesh."""
    shown = {one.node for one in placements}
    carriers = {one.node for one in placements if one.skin is None}
    for skin in {one.skin for one in placements if one.skin is not None}:
        carriers.update(skin.joints)
    family = set(nodes.family(carriers))
    return lambda channel: channel.node in (shown if channel.path == "weights" else family)


def _mover(placements: Sequence[Placement], motion: Motion) -> Callable[[Placement], bool]:
    """A function that tells whether a mesh moves."""
    skins = {one.skin for one in placements if one.skin is not None}
    moving = {skin for skin in skins if not motion.moving.isdisjoint(skin.joints)}

    def moves(one: Placement) -> bool:
        is_carried = one.node in motion.moving if one.skin is None else one.skin in moving
        return is_carried or (one.node, "weights") in motion.curves

    return moves


def _geometry_reader(accessors: Accessors, notes: list[str]) -> Callable[[int], Geometry]:
    """A function from the number of a mesh to what it is, which reads each mesh once."""
    document = accessors.document
    materials = MaterialReader(document, accessors.buffers, notes)
    welded, normal_notes = WeldNote(notes), NormalNotes(notes)

    @cache
    def read(mesh: int) -> Geometry:
        found = read_geometry(
            document.lists["meshes"][mesh], accessors, materials, notes, normal_notes
        )
        welded.add(found.n_split, len(found.positions))
        return found

    return read


def _scene_mesh(
    name: str,
    placement: Placement,
    motion: Motion,
    sampling: Sampling,
    read: Callable[[], Geometry],
    document: Document,
) -> SceneMesh:
    mesh, node = document.lists["meshes"][placement.mesh], document.lists["nodes"][placement.node]
    n_targets = count_targets(mesh)
    default = mesh.numbers("weights", n_targets, np.zeros(n_targets))
    weights = node.numbers("weights", n_targets, default)
    baked = BakedMesh(placement.node, placement.skin, weights, motion, sampling.exact_s, read)
    return SceneMesh(name, sampling.times_s, baked.frame, baked.surface, sampling.fps or None)


def _mesh_name(document: Document, placement: Placement) -> str:
    return document.lists["meshes"][placement.mesh].text("name", "")


def _note_left_out(document: Document, placements: Sequence[Placement], notes: list[str]) -> None:
    meshes = [document.lists["meshes"][one] for one in sorted({one.mesh for one in placements})]
    for mesh in meshes:
        n_primitives = len(mesh.children("primitives", "primitive"))
        if n_left := n_primitives - len(surfaces(mesh)):
            note_left_out(
                notes, f"points and lines, {n_left} of {n_primitives} primitives of {mesh.place}"
            )
        _note_values(mesh, notes)
    nodes = document.lists["nodes"]
    note_instances([(nodes[one.node], one.instances) for one in placements], notes)
    skinned = [nodes[one.node] for one in placements if one.skin is not None]
    if copied := [one for one in skinned if one.extension(INSTANCING) is not None]:
        names = listed(one.text("name", "") or one.place for one in copied)
        note_left_out(notes, f"instances of skinned meshes: {names}")
    for what, n_there in (
        ("cameras", sum("camera" in node for node in nodes)),
        ("lights", sum(node.extension(LIGHTS) is not None for node in nodes)),
    ):
        if n_there:
            note_left_out(notes, f"{what} ({n_there})")
    note_unkept(document, meshes, notes)


def _note_values(mesh: JsonObject, notes: list[str]) -> None:
    """Add to the notes the attributes of vertices that are not read."""
    names = {name for one in surfaces(mesh) for name in one.needed("attributes").values}
    if "TANGENT" in names:
        note_left_out(notes, "tangents, which programs compute")
    note_kinds(
        notes, "attributes that glTF does not define", sorted(n for n in names if not is_read(n))
    )


@dataclass(frozen=True, eq=False)
class BakedMesh:
    """A mesh at a node, in the world.

    Parameters
    ----------
    skin : Skin, optional
        The joints that the mesh follows, in place of the node.
    weights : float64 array of shape (M,)
        Of the morph targets, while nothing moves them.
    times_s : float64 array of shape (T,)
        When frames are.
    read : function
        Gives the mesh at rest.
    """

    node: int
    skin: Skin | None
    weights: Floats
    motion: Motion
    times_s: Floats
    read: Callable[[], Geometry]
    _poses: dict[int, tuple[Matrices, Floats]] = field(default_factory=dict)

    def frame(self, index: int) -> PolygonMesh:
        """The mesh at a frame; float32, as positions of glTF are."""
        faces = self._faces
        with np.errstate(over="ignore", invalid="ignore"):  # positions are checked when all is done
            transforms, weights = self._pose(index)
            positions = self._geometry.morphed(weights)
            if self._geometry.influences is not None and self.skin is not None:
                moved = move(positions, self._geometry.influences.blend(transforms))
            else:
                moved = move(positions, transforms[0])
            return PolygonMesh(moved.astype(np.float32), faces.counts, faces.corners)

    def surface(self, index: int) -> Surface:
        """The surface of the mesh, in any frame."""
        return self._geometry.surface

    @cached_property
    def _geometry(self) -> Geometry:
        found = self.read()
        if self.skin is None:
            transforms, _ = self._pose(0)
            return found.mirrored() if np.linalg.det(transforms[0, :, :3]) < 0 else found
        n_joints = len(self.skin.joints)
        if found.influences is not None and found.influences.joints.max() >= n_joints:
            raise FormatError(
                f"node {self.node}: its mesh names joint {found.influences.joints.max()}; "
                f"its skin has {n_joints}"
            )
        return found

    @cached_property
    def _faces(self) -> PolygonMesh:
        geometry = self._geometry
        counts = np.full(len(geometry.faces), 3, np.int64)
        return polygon_mesh(geometry.positions, counts, geometry.faces.ravel())

    def _pose(self, index: int) -> tuple[Matrices, Floats]:
        """Transforms of the joints, or of the node, of shape (N, 3, 4), and weights of targets."""
        chunk, row = divmod(index, self._frames_at_once)
        if chunk not in self._poses:
            self._poses.clear()
            self._poses[chunk] = self._computed(chunk * self._frames_at_once)
        transforms, weights = self._poses[chunk]
        return transforms[row], weights[row]

    def _computed(self, start: int) -> tuple[Matrices, Floats]:
        times = self.times_s[start : start + self._frames_at_once]
        weights = self.motion.weights(self.node, self.weights, times)
        if self.skin is None:
            return self.motion.world([self.node], times), weights
        return self.motion.world(self.skin.joints, times) @ self.skin.inverse_binds, weights

    @cached_property
    def _frames_at_once(self) -> int:
        carriers = [self.node] if self.skin is None else self.skin.joints
        n_nodes = len(carriers) + len(self.motion.nodes.family(carriers))
        size_bytes = 8 * (16 * n_nodes + len(self.weights))
        return max(1, min(len(self.times_s), POSE_BYTES // size_bytes))
