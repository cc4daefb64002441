"""Reading glTF: every node with a mesh, animated in world space.

The JSON is parsed with the standard library and validated here, since libraries for glTF do not
validate indices and sizes, and files may come from anywhere.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import FormatError
from meshreel.formats.animations import AnimationInfo
from meshreel.formats.gltf.accessors import Accessors
from meshreel.formats.gltf.animation import (
    VISIBILITY,
    VISIBLE,
    Channel,
    Clips,
    Curve,
    Interpolation,
    Matrices,
    Motion,
    other_pointers,
)
from meshreel.formats.gltf.document import INSTANCING, Document, JsonObject, read_document
from meshreel.formats.gltf.geometry import (
    Geometry,
    Skin,
    read_geometry,
    read_skin,
    transform_points,
)
from meshreel.formats.gltf.instancing import note_instances, read_instances, repeat_geometry
from meshreel.formats.gltf.materials import MaterialReader, note_extensions
from meshreel.formats.gltf.nodes import Nodes, read_nodes, unique_names
from meshreel.formats.gltf.primitives import (
    count_targets,
    has_joints,
    is_supported_attribute,
    triangle_primitives,
)
from meshreel.formats.gltf.sampling import STATIC, Sampling, sample_times
from meshreel.formats.gltf.write import SEGMENT_START
from meshreel.formats.notes import listed, note_kinds, note_left_out
from meshreel.formats.options import ReadOptions
from meshreel.formats.scenes.merging import merge_meshes
from meshreel.formats.scenes.scene_mesh import SceneMesh, read_or_defer_error
from meshreel.formats.surfaces.hard_edges import NormalNotes
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh
from meshreel.model.surface import Surface
from meshreel.model.validation import validate_fps
from meshreel.runtime.counting import counted


def scene_nodes(document: Document, nodes: Nodes, notes: list[str]) -> list[int]:
    """Return the nodes of the default scene, parents first; all nodes without a scene.

    A scene may list nodes that are not roots, although glTF forbids it: each of these is included
    once, with the transforms of all its ancestors, even those outside of the scene.

    Parameters
    ----------
    document : Document
    nodes : Nodes
    notes : list of str
        Gains a sentence if the scene lists nodes that are not roots.
    """
    scene = _scene(document)
    if scene is None:
        return _subtrees([node for node, parent in enumerate(nodes.parents) if parent < 0], nodes)
    listed_nodes = list(dict.fromkeys(scene.indices("nodes", len(nodes.parents))))
    if inner := [node for node in listed_nodes if nodes.parents[node] >= 0]:
        notes.append(
            f"{scene.place} lists nodes that are not roots: {_names(inner, nodes)}; each is read "
            "once, with the transforms of all its ancestors"
        )
    covered = _is_below(set(listed_nodes), nodes)
    return _subtrees([node for node in listed_nodes if not covered[node]], nodes)


def no_mesh_error(document: Document, nodes: Nodes) -> FormatError:
    """Return the error for a scene without triangle meshes, with the reason."""
    meshes = document.lists["meshes"]
    if not meshes:
        return FormatError("contains no mesh")
    readable = {number for number, mesh in enumerate(meshes) if triangle_primitives(mesh)}
    if not readable:
        return FormatError("contains no triangle mesh; points and lines are not supported")
    users = [
        node
        for node, json in enumerate(nodes.objects)
        if document.index(json, "mesh", "meshes") in readable
    ]
    scene = _scene(document)
    if not users or scene is None:
        return FormatError(
            f"contains {_counted(len(readable), 'triangle mesh', 'triangle meshes')}, but no node "
            "uses one; "
            "export it with its meshes in a scene"
        )
    return FormatError(
        f"{scene.place}, the default scene, has no triangle mesh; nodes outside of it have: "
        f"{_names(users, nodes)}; export them in the scene, or set 'scene' to another one"
    )


def _names(chosen: Iterable[int], nodes: Nodes) -> str:
    objects = [nodes.objects[node] for node in chosen]
    return listed(one.text("name", "") or one.place for one in objects)


def _counted(number: int, one: str, several: str) -> str:
    return f"{number} {one if number == 1 else several}"


def _scene(document: Document) -> JsonObject | None:
    """Return the default scene of a file, or else the first; None without scenes."""
    scenes = document.lists["scenes"]
    return scenes[document.index(document.root, "scene", "scenes") or 0] if scenes else None


def _is_below(ancestors: set[int], nodes: Nodes) -> list[bool]:
    """Return for each node whether it is below one of these."""
    covered = [False] * len(nodes.parents)
    for node in sorted(range(len(covered)), key=nodes.depths.__getitem__):
        parent = nodes.parents[node]
        covered[node] = parent >= 0 and (parent in ancestors or covered[parent])
    return covered


def _subtrees(roots: Iterable[int], nodes: Nodes) -> list[int]:
    """Return roots and all nodes below them, in depth-first order."""
    stack = list(roots)[::-1]
    subtrees = []
    while stack:
        node = stack.pop()
        subtrees.append(node)
        stack += nodes.objects[node].indices("children", len(nodes.parents))[::-1]
    return subtrees


@dataclass(frozen=True, eq=False)
class ShownMesh:
    """A mesh at a node.

    Attributes
    ----------
    node, mesh : int
    skin : Skin, optional
        Joints that move the mesh instead of the node.
    instances : float64 array of shape (I, 4, 4), optional
        Transforms of instances, relative to the node; None for a single mesh.
    """

    node: int
    mesh: int
    skin: Skin | None
    instances: Matrices | None


def shown_meshes(document: Document, nodes: Sequence[int], accessors: Accessors) -> list[ShownMesh]:
    """Return the triangle meshes at some nodes, in their order."""
    read = cache(lambda number: read_skin(document.lists["skins"][number], accessors))
    meshes = []
    for node in nodes:
        json = document.lists["nodes"][node]
        mesh = document.index(json, "mesh", "meshes")
        skin = document.index(json, "skin", "skins")
        if mesh is not None and triangle_primitives(document.lists["meshes"][mesh]):
            is_bound = skin is not None and has_joints(document.lists["meshes"][mesh])
            instances = None if is_bound else read_instances(json, accessors)
            meshes.append(ShownMesh(node, mesh, read(skin) if is_bound else None, instances))
    return meshes


def instanced_geometry(shown: ShownMesh, mesh: Geometry, accessors: Accessors) -> Geometry:
    """Return the mesh at a node at rest, with all its instances."""
    if shown.instances is None:
        return mesh
    place = accessors.document.lists["nodes"][shown.node].place
    return repeat_geometry(mesh, shown.instances, accessors, place)


Booleans = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Switching:
    """Groups of meshes, one of which is shown in each frame.

    Attributes
    ----------
    group_of_mesh : list of int
        -1 for a mesh that no frame shows.
    first : int
        The first frame that shows a group; later frames, up to the last of `group_of_frame`, do.
    group_of_frame : int array of shape (T,)
    """

    group_of_mesh: list[int]
    first: int
    group_of_frame: npt.NDArray[np.signedinteger]


def is_hidden(nodes: Nodes, motion: Motion, node: int) -> bool:
    """Return whether a node is invisible at all times, itself or by a node above it."""
    return any(
        (one, VISIBLE) not in motion.curves and not _is_visible(nodes, one)
        for one in nodes.ancestors(node)
    )


def find_switching(
    placements: Sequence[ShownMesh], motion: Motion, times_s: Floats
) -> Switching | None:
    """Return the groups of meshes if each is shown alone at its time; otherwise None.

    Meshes are hidden by visibility, or by a scale of zero that steps to another value. Frames
    before the first and after the last group may be empty.
    """
    if not any(_has_switch(motion, one) for one in placements):
        return None
    shown = np.array([_shown_at(motion, one, times_s) for one in placements])
    patterns, group_of_mesh = np.unique(shown, axis=0, return_inverse=True)
    filled = np.flatnonzero(patterns.any(axis=1))
    filled = filled[np.argsort(patterns[filled].argmax(axis=1), kind="stable")]  # by first frame
    numbers = np.full(len(patterns), -1)
    numbers[filled] = np.arange(len(filled))
    counts = patterns[filled].sum(axis=0)
    frames = np.flatnonzero(counts)
    if len(filled) < 2 or (counts[frames[0] : frames[-1] + 1] != 1).any():
        return None
    group_of_frame = patterns[filled][:, frames[0] : frames[-1] + 1].argmax(axis=0)
    return Switching(numbers[group_of_mesh.ravel()].tolist(), int(frames[0]), group_of_frame)


def has_visibility_curve(motion: Motion, node: int) -> bool:
    """Return whether the visibility of a node, or of one above it, changes over time."""
    return any((one, VISIBLE) in motion.curves for one in motion.nodes.ancestors(node))


def _has_switch(motion: Motion, mesh: ShownMesh) -> bool:
    return any(
        (one, VISIBLE) in motion.curves or _scale_switch(motion, mesh, one) is not None
        for one in motion.nodes.ancestors(mesh.node)
    )


def _shown_at(motion: Motion, mesh: ShownMesh, times_s: Floats) -> Booleans:
    """Return whether a mesh is shown at each time, of shape (T,)."""
    shown = np.ones(len(times_s), np.bool_)
    for node in motion.nodes.ancestors(mesh.node):
        curve = motion.curves.get((node, VISIBLE))
        if curve is not None:
            shown &= curve.at(times_s)[:, 0] != 0
        elif not _is_visible(motion.nodes, node):
            shown[:] = False
        if (scale := _scale_switch(motion, mesh, node)) is not None:
            shown &= scale.at(times_s).any(axis=1)
    return shown


def _scale_switch(motion: Motion, mesh: ShownMesh, node: int) -> Curve | None:
    """Return the scale of a node if it steps between zero and other values.

    Nodes above a skinned mesh do not scale it.
    """
    curve = motion.curves.get((node, "scale"))
    if mesh.skin is not None or curve is None or curve.interpolation is not Interpolation.STEP:
        return None
    is_zero = curve.values == 0
    has_only_whole = (is_zero.all(axis=1) | ~is_zero.any(axis=1)).all()
    return curve if has_only_whole and is_zero.any() else None


def _is_visible(nodes: Nodes, node: int) -> bool:
    """Return whether a node itself is visible without an animation."""
    extension = nodes.objects[node].extension(VISIBILITY)
    return extension is None or extension.values.get("visible", True) is not False


LIGHTS = "KHR_lights_punctual"

POSE_BYTES = 1 << 24
"""Memory for node transforms, which are computed for several frames at once."""


class WeldNote:
    """A note on welded vertices, which grows with each mesh.

    Parameters
    ----------
    notes : list of str
        Gains the sentence, which changes later.
    """

    def __init__(self, notes: list[str]) -> None:
        self._notes, self._sentence = notes, ""
        self._n_split = self._n_verts = 0

    def add(self, n_split: int, n_verts: int) -> None:
        """Add a mesh by its number of vertices in the file and after welding."""
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
    """Return the meshes of the scene of a glTF file, named by the paths of their nodes.

    The animation is that of the options, or the first one that moves a mesh; meshes that it does
    not move have one frame.

    Raises
    ------
    FormatError
        If the file is damaged, its scene has no mesh, or it requires an unsupported extension.
    InvalidInputError
        If it does not have the requested animation.
    """
    document = read_document(path, allow_outside=options.allow_outside)
    accessors, nodes = Accessors(document), read_nodes(document)
    placements = shown_meshes(document, scene_nodes(document, nodes, options.notes), accessors)
    if not placements:
        raise no_mesh_error(document, nodes)
    motion, sampling = _motion(placements, nodes, accessors, options)
    placements = _without_hidden(placements, nodes, motion, options.notes)
    _note_left_out(document, placements, options.notes)
    read = _geometry_reader(accessors, options.notes)
    names = unique_names([nodes.path(one.node, _mesh_name(document, one)) for one in placements])
    is_animated = _animation_test(placements, motion)

    def shape(placement: ShownMesh) -> Geometry:
        return instanced_geometry(placement, read(placement.mesh), accessors)

    def scene_mesh(name: str, placement: ShownMesh) -> SceneMesh:
        times = sampling if is_animated(placement) else sampling.first()
        return _scene_mesh(name, placement, motion, times, lambda: shape(placement), document)

    meshes = [
        read_or_defer_error(name, partial(scene_mesh, name, one))
        for name, one in zip(names, placements, strict=True)
    ]
    if options.object is None:
        starts = [_segment_start(document, nodes, one.node) for one in placements]
        if (switching := _stored_segments(starts, sampling)) is not None:
            names = ["/" + mesh.name.strip("/").partition("/")[2] for mesh in meshes]
            own = [replace(mesh, name=name) for mesh, name in zip(meshes, names, strict=True)]
            return [_joined(own, switching, sampling, options.notes)]
        switching = find_switching(placements, motion, sampling.curve_times_s)
        if switching is not None:
            return [_joined(meshes, switching, sampling, options.notes)]
    shown = [
        name
        for name, one in zip(names, placements, strict=True)
        if has_visibility_curve(motion, one.node)
    ]
    if shown:
        note_left_out(options.notes, f"changes of the visibility of {listed(shown)}")
    return meshes


def _without_hidden(
    placements: Sequence[ShownMesh], nodes: Nodes, motion: Motion, notes: list[str]
) -> list[ShownMesh]:
    """Return the meshes that are visible at some time; all if none is."""
    hidden = [is_hidden(nodes, motion, one.node) for one in placements]
    if all(hidden):
        notes.append("all meshes are hidden (KHR_node_visibility); read as if they were visible")
        return list(placements)
    names = [
        nodes.objects[one.node].text("name", "") or nodes.objects[one.node].place
        for one, is_left in zip(placements, hidden, strict=True)
        if is_left
    ]
    if names:
        note_left_out(notes, f"hidden meshes: {listed(names)}")
    return [one for one, is_left in zip(placements, hidden, strict=True) if not is_left]


def _segment_start(document: Document, nodes: Nodes, node: int) -> float | None:
    """Return the time at which the segment of a node begins, if meshreel wrote it as one."""
    for above in nodes.ancestors(node):
        extras = document.lists["nodes"][above].values.get("extras")
        if isinstance(extras, dict) and isinstance(extras.get(SEGMENT_START), int | float):
            return float(extras[SEGMENT_START])
    return None


def _stored_segments(starts: Sequence[float | None], sampling: Sampling) -> Switching | None:
    """Return the segments that meshreel wrote, given the start of each mesh."""
    own = [one for one in starts if one is not None]
    if len(own) < len(starts):
        return None
    firsts = sorted(set(own))
    half_frame_s = 0.5 / sampling.fps if sampling.fps else 0.0
    borders = np.array(firsts[1:]) - half_frame_s
    group_of_frame = np.searchsorted(borders, sampling.times_s, side="right")
    return Switching([firsts.index(one) for one in own], 0, group_of_frame)


def _joined(
    meshes: Sequence[SceneMesh], switching: Switching, sampling: Sampling, notes: list[str]
) -> SceneMesh:
    """Return a mesh whose faces change: in each frame the meshes of one group."""
    segments = []
    for number in range(max(switching.group_of_mesh) + 1):
        pairs = zip(meshes, switching.group_of_mesh, strict=True)
        parts = [mesh for mesh, group in pairs if group == number]
        segments.append(parts[0] if len(parts) == 1 else merge_meshes(parts, "", notes))

    def at(index: int) -> tuple[SceneMesh, int]:
        mesh = segments[int(switching.group_of_frame[index])]
        return mesh, min(switching.first + index, len(mesh.times_s) - 1)

    def frame(index: int) -> PolygonMesh:
        mesh, own_index = at(index)
        return mesh.frame(own_index)

    def surface(index: int) -> Surface:
        mesh, own_index = at(index)
        return mesh.surface(own_index)

    end = switching.first + len(switching.group_of_frame)
    times_s = sampling.times_s[switching.first : end]
    return SceneMesh(segments[0].name, times_s, frame, surface, sampling.fps or None)


def list_animations(path: Path, options: ReadOptions) -> list[AnimationInfo]:
    """Return the animations of a glTF file, in file order, without adding notes.

    Raises
    ------
    FormatError
        If the file is damaged outside of its animations.
    """
    document = read_document(path, allow_outside=options.allow_outside)
    accessors, nodes = Accessors(document), read_nodes(document)
    placements = shown_meshes(document, scene_nodes(document, nodes, []), accessors)
    return Clips(nodes, accessors, _mesh_channel_test(placements, nodes)).describe()


def _motion(
    placements: Sequence[ShownMesh], nodes: Nodes, accessors: Accessors, options: ReadOptions
) -> tuple[Motion, Sampling]:
    """Return the motion of nodes with meshes, and the sampling of frames."""
    clips = Clips(nodes, accessors, _mesh_channel_test(placements, nodes))
    clip = clips.select(options.animation, options.notes)
    if clip is None:
        return Motion(nodes, {}), STATIC
    is_curved = any(curve.is_curved for curve in clip.curves.values())
    fps = validate_fps(options.fps or 0.0)
    sampling = sample_times(clip.keys_s, fps, is_curved=is_curved, notes=options.notes)
    return Motion(nodes, clip.curves), sampling


def _mesh_channel_test(placements: Sequence[ShownMesh], nodes: Nodes) -> Callable[[Channel], bool]:
    """Return a function that tells whether a channel moves a mesh."""
    shown = {one.node for one in placements}
    carriers = {one.node for one in placements if one.skin is None}
    for skin in {one.skin for one in placements if one.skin is not None}:
        carriers.update(skin.joints)
    above = set(nodes.with_ancestors(carriers))
    seen = set(nodes.with_ancestors(shown))
    carriers_of = {"weights": shown, VISIBLE: seen}
    return lambda channel: channel.node in carriers_of.get(channel.path, above)


def _animation_test(placements: Sequence[ShownMesh], motion: Motion) -> Callable[[ShownMesh], bool]:
    """Return a function that tells whether a mesh is animated."""
    skins = {one.skin for one in placements if one.skin is not None}
    animated = {skin for skin in skins if not motion.animated.isdisjoint(skin.joints)}

    def is_animated(one: ShownMesh) -> bool:
        is_moved = one.node in motion.animated if one.skin is None else one.skin in animated
        return is_moved or (one.node, "weights") in motion.curves

    return is_animated


def _geometry_reader(accessors: Accessors, notes: list[str]) -> Callable[[int], Geometry]:
    """Return a function that reads a mesh by index, with a cache."""
    document = accessors.document
    materials = MaterialReader(document, accessors.buffers, notes)
    welded, normal_notes = WeldNote(notes), NormalNotes(notes)

    @cache
    def read(mesh: int) -> Geometry:
        geometry = read_geometry(
            document.lists["meshes"][mesh], accessors, materials, notes, normal_notes
        )
        welded.add(geometry.n_split, len(geometry.positions))
        return geometry

    return read


def _scene_mesh(
    name: str,
    placement: ShownMesh,
    motion: Motion,
    sampling: Sampling,
    read: Callable[[], Geometry],
    document: Document,
) -> SceneMesh:
    mesh, node = document.lists["meshes"][placement.mesh], document.lists["nodes"][placement.node]
    n_targets = count_targets(mesh)
    default = mesh.numbers("weights", n_targets, np.zeros(n_targets))
    weights = node.numbers("weights", n_targets, default)
    baked = BakedMesh(placement.node, placement.skin, weights, motion, sampling.curve_times_s, read)
    return SceneMesh(name, sampling.times_s, baked.frame, baked.surface, sampling.fps or None)


def _mesh_name(document: Document, placement: ShownMesh) -> str:
    return document.lists["meshes"][placement.mesh].text("name", "")


def _note_left_out(document: Document, placements: Sequence[ShownMesh], notes: list[str]) -> None:
    meshes = [document.lists["meshes"][one] for one in sorted({one.mesh for one in placements})]
    for mesh in meshes:
        n_primitives = len(mesh.children("primitives", "primitive"))
        if n_left := n_primitives - len(triangle_primitives(mesh)):
            note_left_out(
                notes, f"points and lines, {n_left} of {n_primitives} primitives of {mesh.place}"
            )
        _note_values(mesh, notes)
    nodes = document.lists["nodes"]
    note_instances([(nodes[one.node], one.instances) for one in placements], notes)
    skinned = [nodes[one.node] for one in placements if one.skin is not None]
    if instanced := [one for one in skinned if one.extension(INSTANCING) is not None]:
        names = listed(one.text("name", "") or one.place for one in instanced)
        note_left_out(notes, f"instances of skinned meshes: {names}")
    for what, count in (
        ("cameras", sum("camera" in node for node in nodes)),
        ("lights", sum(node.extension(LIGHTS) is not None for node in nodes)),
    ):
        if count:
            note_left_out(notes, f"{what} ({count})")
    pointers = [one for each in document.lists["animations"] for one in other_pointers(each)]
    note_kinds(notes, "animated properties", pointers)
    note_extensions(document, meshes, notes)


def _note_values(mesh: JsonObject, notes: list[str]) -> None:
    """Note the vertex attributes that are not read."""
    names = {
        name
        for one in triangle_primitives(mesh)
        for name in one.required_child("attributes").values
    }
    if "TANGENT" in names:
        note_left_out(notes, "tangents, which programs compute")
    note_kinds(
        notes,
        "attributes that glTF does not define",
        sorted(n for n in names if not is_supported_attribute(n)),
    )


@dataclass(frozen=True, eq=False)
class BakedMesh:
    """A mesh at a node, animated in world space.

    Parameters
    ----------
    node : int
    skin : Skin, optional
        Joints that move the mesh instead of the node.
    weights : float64 array of shape (M,)
        Default weights of the morph targets.
    motion : Motion
    times_s : float64 array of shape (T,)
        Times at which curves are evaluated for the frames.
    read : function
        Returns the mesh at rest.
    """

    node: int
    skin: Skin | None
    weights: Floats
    motion: Motion
    times_s: Floats
    read: Callable[[], Geometry]
    _poses: dict[int, tuple[Matrices, Floats]] = field(default_factory=dict)

    def frame(self, index: int) -> PolygonMesh:
        """Return the mesh in a frame, with float32 positions."""
        faces = self._faces
        with np.errstate(over="ignore", invalid="ignore"):  # positions are validated later
            transforms, weights = self._pose(index)
            positions = self._geometry.morphed(weights)
            if self._geometry.influences is not None and self.skin is not None:
                moved = transform_points(positions, self._geometry.influences.blend(transforms))
            else:
                moved = transform_points(positions, transforms[0])
            return PolygonMesh(moved.astype(np.float32), faces.counts, faces.corners)

    def surface(self, index: int) -> Surface:
        """Return the surface of the mesh, which is the same in all frames."""
        return self._geometry.surface

    @cached_property
    def _geometry(self) -> Geometry:
        geometry = self.read()
        if self.skin is None:
            transforms, _ = self._pose(0)
            is_mirrored = np.linalg.det(transforms[0, :, :3]) < 0
            return geometry.with_reversed_faces() if is_mirrored else geometry
        n_joints = len(self.skin.joints)
        if geometry.influences is not None and geometry.influences.joints.max() >= n_joints:
            raise FormatError(
                f"node {self.node}: its mesh refers to joint {geometry.influences.joints.max()}, "
                f"but its skin has {n_joints} joints"
            )
        return geometry

    @cached_property
    def _faces(self) -> PolygonMesh:
        geometry = self._geometry
        counts = np.full(len(geometry.faces), 3, np.int64)
        return polygon_mesh(geometry.positions, counts, geometry.faces.ravel())

    def _pose(self, index: int) -> tuple[Matrices, Floats]:
        """Return transforms of the joints or the node, of shape (N, 3, 4), and target weights."""
        chunk, row = divmod(index, self._piece_frames)
        if chunk not in self._poses:
            self._poses.clear()
            self._poses[chunk] = self._compute_poses(chunk * self._piece_frames)
        transforms, weights = self._poses[chunk]
        return transforms[row], weights[row]

    def _compute_poses(self, start: int) -> tuple[Matrices, Floats]:
        times = self.times_s[start : start + self._piece_frames]
        weights = self.motion.weights(self.node, self.weights, times)
        if self.skin is None:
            return self.motion.world([self.node], times), weights
        return self.motion.world(self.skin.joints, times) @ self.skin.inverse_binds, weights

    @cached_property
    def _piece_frames(self) -> int:
        carriers = [self.node] if self.skin is None else self.skin.joints
        n_nodes = len(carriers) + len(self.motion.nodes.with_ancestors(carriers))
        size_bytes = 8 * (16 * n_nodes + len(self.weights))
        return max(1, min(len(self.times_s), POSE_BYTES // size_bytes))
