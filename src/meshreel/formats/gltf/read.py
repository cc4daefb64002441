"""Reading glTF: every node with a mesh, animated in world space."""

import math
from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.gltf.animation import (
    PATHS,
    STATIC,
    Clip,
    Clips,
    Sampling,
    sample_times,
)
from meshreel.formats.gltf.document import GENERATOR, Document, JsonObject, unique_names
from meshreel.formats.gltf.geometry import GeometryReader
from meshreel.formats.gltf.scene import (
    STEP,
    VISIBLE,
    Curve,
    Motion,
    Nodes,
    PosedMesh,
    ShownMesh,
    Skin,
)
from meshreel.formats.gltf.unread import note_other_items, note_unread
from meshreel.formats.kinds import AnimationInfo
from meshreel.formats.options import Reading
from meshreel.formats.scenes.scene_mesh import SceneMesh, Visibility
from meshreel.model.notes import Notes
from meshreel.model.validation import validate_fps

SEGMENT_START = "meshreelSegmentStart"
"""Property of the extras of a node above the meshes of a segment: time of its first frame."""

ERROR_BOUND = "meshreelErrorBound"
"""Property of the extras of an asset that meshreel generated: largest error of a vertex relative to
the original, in model units; null if unknown."""


def read_meshes(path: Path, reading: Reading) -> list[SceneMesh]:
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
    document, notes = Document(path, reading), reading.notes
    error_bound = _error_bound(document)
    if reading.fps and error_bound:
        error_bound = None  # frames between those of the original
    nodes = Nodes(document)
    shown = shown_meshes(document, nodes, notes)
    if not shown:
        raise no_mesh_error(document, nodes)
    moving = _moving_nodes(shown, nodes)
    clip = Clips(document, moving).select(reading.animation, notes)
    motion, sampling = Motion(nodes, {}, moving["translation"]), STATIC
    if clip is not None:
        motion = Motion(nodes, clip.curves, moving["translation"])
        fps = validate_fps(reading.fps or 0.0)
        sampling = sample_times(clip.keys_s, fps, is_curved=clip.is_curved, notes=notes)
    _note_left_out(document, nodes, shown, clip, notes)
    default_names = [mesh.mesh.json.text("name", "") for mesh in shown]
    mesh_nodes = [mesh.node for mesh in shown]
    names = unique_names(nodes.paths(dict(zip(mesh_nodes, default_names, strict=True))))
    if reading.object is None and all(_is_of_segment(mesh, nodes) for mesh in shown):
        names = ["/" + name.strip("/").partition("/")[2] for name in names]
    reader, visibility = GeometryReader(document, notes), Visibilities(motion, sampling)
    note = partial(note_unread, document, nodes, shown, notes)
    meshes = []
    for name, mesh in zip(names, shown, strict=True):
        is_moved = not motion.animated.isdisjoint(mesh.carriers)
        is_animated = is_moved or (mesh.node, "weights") in motion.curves
        times = sampling if is_animated else sampling.first
        node = nodes.objects[mesh.node]
        posed = PosedMesh(mesh, motion, times.curve_times_s, node, reader.read)
        scene_mesh = SceneMesh(
            name, times.times_s, posed.frame, posed.surface, times.fps or None,
            positions=posed.positions, visibility=visibility.of(mesh), error_bound=error_bound,
            note_unread=note,
        )  # fmt: skip
        meshes.append(scene_mesh)
    if reading.merge and reading.object is None and not reading.skip_bad:
        for mesh, scene_mesh in zip(shown, meshes, strict=True):  # before any is posed
            if scene_mesh.visibility.is_shown.all():
                reader.read(mesh.mesh)
    return meshes


def _error_bound(document: Document) -> float | None:
    """Return the error that a file of meshreel declares; 0 for files of other programs."""
    asset = document.root.required_child("asset")
    extras = asset.values.get("extras")
    if asset.get("generator") != GENERATOR or ERROR_BOUND not in (extras or ()):
        return 0.0
    bound = asset.required_child("extras").get(ERROR_BOUND)
    if isinstance(bound, int | float) and 0 <= bound < math.inf:
        return float(bound)
    return None


def list_animations(path: Path, reading: Reading) -> list[AnimationInfo]:
    """Return the animations of a glTF file, in file order, without adding notes."""
    document = Document(path, reading)
    nodes = Nodes(document)
    shown = shown_meshes(document, nodes, Notes())
    return Clips(document, _moving_nodes(shown, nodes)).describe()


def _moving_nodes(shown: Sequence[ShownMesh], nodes: Nodes) -> dict[str, set[int]]:
    """Return, by animated property, the nodes where it moves, shows or hides a mesh."""
    mesh_nodes = {mesh.node for mesh in shown}
    above_carriers = set(nodes.with_ancestors({node for mesh in shown for node in mesh.carriers}))
    nodes_of_path = {"weights": mesh_nodes, VISIBLE: set(nodes.with_ancestors(mesh_nodes))}
    return dict.fromkeys(PATHS, above_carriers) | nodes_of_path


def _note_left_out(
    document: Document, nodes: Nodes, shown: Sequence[ShownMesh], clip: Clip | None, notes: Notes
) -> None:
    for mesh in dict.fromkeys(shown_mesh.mesh for shown_mesh in shown):
        total = len(mesh.triangles) + mesh.others.total()
        for kind, count in mesh.others.items():
            notes.left_out(kind, [f"{count} of {total} primitives of {mesh.json.place}"])
    unskinned = (mesh for mesh in shown if mesh.skin is None and mesh.mesh.has_joints)
    labels = (nodes.objects[mesh.node].label() for mesh in unskinned)
    notes.left_out("joints and weights without a skin", labels)
    if clip is not None:
        notes.left_out("animated properties", clip.others)
        notes.left_out("malformed channels", clip.malformed)
    note_other_items(document, nodes, shown, notes)


def shown_meshes(document: Document, nodes: Nodes, notes: Notes) -> list[ShownMesh]:
    """Return the triangle meshes of the default scene, or of all nodes without a scene.

    A scene may list nodes that are not roots, although glTF forbids it: each of these is included
    once, with the transforms of all its ancestors, even those outside of the scene.

    Parameters
    ----------
    notes : Notes
        Gains a sentence if the scene lists nodes that are not roots.
    """
    scene = _default_scene(document)
    roots = nodes.ordered if scene is None else scene.indices("nodes", "nodes")
    roots = list(dict.fromkeys(roots))
    inner = [node for node in roots if nodes.parents[node] >= 0]
    if scene is not None and inner:
        notes.changed(
            f"{scene.place} lists nodes that are not roots: {nodes.labels(inner)}; each is read "
            "once, with the transforms of all its ancestors"
        )
    below_roots = nodes.below(roots)
    read = cache(lambda number: _read_skin(document.lists["skins"][number], document))
    meshes: list[ShownMesh] = []
    for node in nodes.subtrees(root for root in roots if root not in below_roots):
        json = nodes.objects[node]
        number, skin_number = json.index("mesh", "meshes"), json.index("skin", "skins")
        if number is None:
            continue
        mesh = document.mesh(document.lists["meshes"][number])
        if mesh.triangles and skin_number is not None and mesh.has_joints:
            skin = read(skin_number)
            meshes.append(ShownMesh(node, mesh, skin, skin.joints))
        elif mesh.triangles:
            meshes.append(ShownMesh(node, mesh, None, [node]))
    return meshes


def _read_skin(skin: JsonObject, document: Document) -> Skin:
    joints = skin.indices("joints", "nodes")
    if not joints:
        raise skin.error("joints", "a list of at least one node")
    if "inverseBindMatrices" not in skin:
        return Skin(joints, np.tile(np.eye(4), (len(joints), 1, 1)))
    columns = document.read_floats(skin, "inverseBindMatrices", "MAT4")
    if len(columns) < len(joints):
        raise FormatError(
            f"{skin.place}: has {len(columns)} inverse bind matrices for {len(joints)} joints; "
            "expected one per joint"
        )
    return Skin(joints, columns[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1))


def _default_scene(document: Document) -> JsonObject | None:
    """Return the default scene of a file, or else the first; None without scenes."""
    scenes = document.lists["scenes"]
    return scenes[document.root.index("scene", "scenes") or 0] if scenes else None


def no_mesh_error(document: Document, nodes: Nodes) -> FormatError:
    """Return the error for a scene without triangle meshes, with the reason."""
    meshes = document.lists["meshes"]
    if not meshes:
        return FormatError("contains no mesh")
    readable = {number for number, mesh in enumerate(meshes) if document.mesh(mesh).triangles}
    if not readable:
        return FormatError("contains no triangle mesh; points and lines are not supported")
    users = [
        node for node, json in enumerate(nodes.objects) if json.index("mesh", "meshes") in readable
    ]
    scene = _default_scene(document)
    if not users or scene is None:
        noun = "triangle mesh" if len(readable) == 1 else "triangle meshes"
        return FormatError(
            f"contains {len(readable)} {noun}, but no node uses one; export it with its meshes in "
            "a scene"
        )
    return FormatError(
        f"{scene.place}, the default scene, has no triangle mesh; nodes outside of it have: "
        f"{nodes.labels(users)}; export them in the scene, or set 'scene' to another one"
    )


class Visibilities:
    """When meshes are shown: not below hidden nodes, nor at a scale that steps to zero.

    Parameters
    ----------
    sampling : Sampling
        Times at which visibility is evaluated.
    """

    def __init__(self, motion: Motion, sampling: Sampling) -> None:
        self._nodes, self._sampling = motion.nodes, sampling
        self._curves = {
            (node, path): curve
            for (node, path), curve in motion.curves.items()
            if path == VISIBLE or (path == "scale" and _steps_from_zero(curve))
        }
        hidden = {node for node in motion.nodes.hidden() if (node, VISIBLE) not in self._curves}
        self._hidden = motion.nodes.with_below(hidden)

    def of(self, mesh: ShownMesh) -> Visibility:
        """Return the visibility of a mesh; nodes above a skinned mesh do not scale it."""
        sampling, is_visible = self._sampling, mesh.node not in self._hidden
        if not self._curves:
            return Visibility(sampling.times_s[:1], np.array([is_visible]))
        paths = [VISIBLE] if mesh.skin is not None else [VISIBLE, "scale"]
        keys = ((node, path) for node in self._nodes.ancestors(mesh.node) for path in paths)
        curves = [self._curves[key] for key in keys if key in self._curves]
        if not curves:
            return Visibility(sampling.times_s[:1], np.array([is_visible]))
        shown = np.full(len(sampling.times_s), is_visible)
        for curve in curves:
            shown &= (curve.values_at(sampling.curve_times_s) != 0).any(axis=1)
        return Visibility(sampling.times_s, shown)


def _steps_from_zero(scale: Curve) -> bool:
    is_zero = scale.values == 0
    is_all_or_none = bool((is_zero.all(axis=1) | ~is_zero.any(axis=1)).all())
    return scale.interpolation == STEP and is_all_or_none and bool(is_zero.any())


def _is_of_segment(mesh: ShownMesh, nodes: Nodes) -> bool:
    """Return whether meshreel wrote a mesh as a segment, or a part of one."""
    above = [nodes.objects[node] for node in nodes.ancestors(mesh.node)]
    marked = (node for node in above if SEGMENT_START in (node.values.get("extras") or ()))
    return any(node.required_child("extras").get(SEGMENT_START) is not None for node in marked)
