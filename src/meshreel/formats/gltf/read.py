"""Reading glTF: every node with a mesh, animated in world space."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from pathlib import Path

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import FormatError, Keyword, Message
from meshreel.formats.gltf.animation import (
    PATHS,
    STEP,
    VISIBLE,
    Clips,
    Curve,
    Curves,
    Motion,
    Nodes,
    other_pointers,
)
from meshreel.formats.gltf.document import Document, unique_names
from meshreel.formats.gltf.geometry import GeometryReader, accessor_types
from meshreel.formats.gltf.materials import note_extensions
from meshreel.formats.gltf.scene import PosedMesh, ShownMesh, no_mesh_error, shown_meshes
from meshreel.formats.kinds import AnimationInfo
from meshreel.formats.options import ReadOptions
from meshreel.formats.scenes.merging import merge_meshes
from meshreel.formats.scenes.scene_mesh import SceneMesh
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.notes import Notes, listed
from meshreel.model.surface import Surface
from meshreel.model.timing import Timing
from meshreel.model.validation import validate_fps

LIGHTS, INSTANCING = "KHR_lights_punctual", "EXT_mesh_gpu_instancing"

SEGMENT_START = "meshreelSegmentStart"
"""Property of the extras of a node above the meshes of a segment: time of its first frame."""

DEFAULT_FPS = 30.0
MAX_FRAMES = 100_000
"""More than an hour at 24 frames per second; an invalid key time must not fill the memory."""
MAX_SPARSE_FPS = 120.0
"""Highest rate that is derived from keys with gaps; above it, any keys fit some rate by chance."""
MIN_CURVED_FPS = 10.0
"""Rate of keys below which curved motion between them must be sampled more densely."""
TOLERANCE = 1e-3
"""Deviation of times from whole frames that counts as rounding, in frames."""
MAX_TOLERANCE = 0.4
"""Limit of that deviation for the last key, where float32 is coarse, in frames."""
SAME_S = 1e-5
"""Time difference below which keys are the same."""


@dataclass(frozen=True, eq=False)
class Sampling:
    """The times of frames."""

    times_s: Floats
    """float64 array of shape (T,). Nominal times of the frames."""
    curve_times_s: Floats
    """float64 array of shape (T,). Times at which curves are evaluated: key times that differ from
    frames only by rounding replace the nominal times.
    """
    fps: float
    """Frames per second; 0 for a single frame."""

    @cached_property
    def first(self) -> "Sampling":
        """The sampling of the first frame only."""
        return Sampling(self.times_s[:1], self.curve_times_s[:1], 0.0)


STATIC = Sampling(np.zeros(1), np.zeros(1), 0.0)
"""One frame, for a file without animation."""


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
    document, notes = Document(path, options), options.notes
    nodes = Nodes(document)
    shown = shown_meshes(document, nodes, notes)
    if not shown:
        raise no_mesh_error(document, nodes)
    motion, sampling = _select_motion(shown, nodes, document, options)
    shown = _visible(shown, motion, notes)
    _note_left_out(document, shown, notes)
    defaults = [mesh.mesh.json.text("name", "") for mesh in shown]
    holders = [mesh.node for mesh in shown]
    names = unique_names(nodes.paths(dict(zip(holders, defaults, strict=True))))
    reader = GeometryReader(document, notes)
    meshes = []
    for name, mesh in zip(names, shown, strict=True):
        times = sampling if _is_animated(mesh, motion) else sampling.first
        node = nodes.objects[mesh.node]
        posed = PosedMesh(mesh, motion, times.curve_times_s, node, reader.read)
        meshes.append(SceneMesh(name, times.times_s, posed.frame, posed.surface, times.fps or None))
    switching = find_switching(shown, motion, sampling.curve_times_s)
    if switching is not None and options.object is None:
        if all(_is_of_segment(mesh, nodes) for mesh in shown):
            names = ["/" + name.strip("/").partition("/")[2] for name in names]
            meshes = [replace(mesh, name=name) for mesh, name in zip(meshes, names, strict=True)]
        return [_join(meshes, *switching, sampling, notes)]
    pairs = zip(names, shown, strict=True)
    if changing := [name for name, mesh in pairs if mesh.node in motion.switched]:
        notes.left_out(f"changes of the visibility of {listed(changing)}")
    if options.merge and options.object is None and not options.skip_bad:
        reader.read_all([mesh.mesh for mesh in shown])  # before any is posed
    return meshes


def list_animations(path: Path, options: ReadOptions) -> list[AnimationInfo]:
    """Return the animations of a glTF file, in file order, without adding notes.

    Raises
    ------
    FormatError
        If the file is damaged outside of its animations.
    """
    document = Document(path, options)
    nodes = Nodes(document)
    shown = shown_meshes(document, nodes, Notes())
    return Clips(document, _moving_nodes(shown, nodes)).describe()


def _select_motion(
    shown: Sequence[ShownMesh], nodes: Nodes, document: Document, options: ReadOptions
) -> tuple[Motion, Sampling]:
    """Return the motion of nodes with meshes, and the sampling of frames."""
    moving = _moving_nodes(shown, nodes)
    carriers, clips = moving["translation"], Clips(document, moving)
    clip = clips.select(options.animation, options.notes)
    if clip is None:
        return Motion(nodes, {}, carriers), STATIC
    fps = validate_fps(options.fps or 0.0)
    sampling = sample_times(clip.keys_s, fps, is_curved=clip.is_curved, notes=options.notes)
    return Motion(nodes, clip.curves, carriers), sampling


def _moving_nodes(shown: Sequence[ShownMesh], nodes: Nodes) -> dict[str, set[int]]:
    """Return the nodes where animating a property moves or shows a mesh, by path."""
    holders = {mesh.node for mesh in shown}
    above_carriers = set(nodes.with_ancestors({node for mesh in shown for node in mesh.carriers}))
    nodes_of_path = {"weights": holders, VISIBLE: set(nodes.with_ancestors(holders))}
    return dict.fromkeys(PATHS, above_carriers) | nodes_of_path


def _is_animated(mesh: ShownMesh, motion: Motion) -> bool:
    is_moved = not motion.animated.isdisjoint(mesh.carriers)
    return is_moved or (mesh.node, "weights") in motion.curves


def _visible(shown: list[ShownMesh], motion: Motion, notes: Notes) -> list[ShownMesh]:
    """Return the meshes that are visible at some time; all if none is."""
    nodes = motion.nodes
    unchanging = {node for node in nodes.hidden() if (node, VISIBLE) not in motion.curves}
    never = nodes.with_below(unchanging)
    hidden = [mesh.node for mesh in shown if mesh.node in never]
    if len(hidden) == len(shown):
        notes.changed("all meshes are hidden (KHR_node_visibility); read as if they were visible")
        return shown
    if hidden:
        notes.left_out(f"hidden meshes: {nodes.labels(hidden)}")
    return [mesh for mesh in shown if mesh.node not in never]


def _note_left_out(document: Document, shown: Sequence[ShownMesh], notes: Notes) -> None:
    used = {mesh.mesh.json: mesh.mesh for mesh in shown}
    meshes = [used[json] for json in document.lists["meshes"] if json in used]
    names = frozenset().union(*[mesh.names for mesh in meshes]) - {"TANGENT"}
    unknown = sorted(name for name in names if not accessor_types(name))
    for mesh in meshes:
        if n_left := mesh.n_primitives - len(mesh.triangles):
            primitives = f"{n_left} of {mesh.n_primitives} primitives of {mesh.json.place}"
            notes.left_out(f"points and lines, {primitives}")
        if "TANGENT" in mesh.names:
            notes.left_out("tangents, which programs compute")
        if own := [name for name in unknown if name in mesh.names]:
            notes.left_out("attributes that glTF does not define", own)
    nodes = document.lists["nodes"]
    holders = [nodes[mesh.node] for mesh in shown]
    copied = [node.label() for node in holders if node.extension(INSTANCING) is not None]
    notes.left_out(f"copies of a mesh ({INSTANCING}), which is read once", copied)
    cameras = [node for node in nodes if "camera" in node]
    lights = [node for node in nodes if node.extension(LIGHTS) is not None]
    for what, users in (("cameras", cameras), ("lights", lights)):
        if users:
            notes.left_out(f"{what} ({len(users)})")
    pointers = map(other_pointers, document.lists["animations"])
    notes.left_out("animated properties", chain.from_iterable(pointers))
    note_extensions(document, meshes, notes)


def sample_times(keys_s: Floats, fps: float, *, is_curved: bool, notes: Notes) -> Sampling:
    """Return the times of frames from the first key to the last.

    If motion between keys is straight and their times have no common rate, the frames are the keys.
    Otherwise frames are evenly spaced, and the last one shows the pose of the last key: if that is
    between two frames, it is shown by the later one, and a note says so.

    Parameters
    ----------
    keys_s : float64 array of shape (N,)
        Distinct key times of all channels, ascending; at least one.
    fps : float
        Requested frames per second; 0 for the rate of the keys, or 30 if they are curved and have
        none.
    is_curved : bool
        Whether motion between keys may be curved.
    notes : Notes
        Gains a sentence if the keys have no suitable rate, or the last is between two frames.

    Raises
    ------
    FormatError
        If there would be too many frames.
    """
    start, end = float(keys_s[0]), float(keys_s[-1])
    if end - start < SAME_S:
        return Sampling(keys_s[:1], keys_s[:1], 0.0)
    if not fps and not is_curved and not common_rate(keys_s) and len(keys_s) < MAX_FRAMES:
        return Sampling(keys_s, keys_s, 0.0)
    fps = fps or _choose_rate(keys_s, is_curved, notes)
    n_frames = _count_frames(end - start, fps, _rounding(keys_s), notes)
    first, tolerance = start * fps, min(max(TOLERANCE, _rounding(keys_s) * fps), 0.1)
    if abs(first - round(first)) <= tolerance:
        first = round(first)
    times: Floats = (first + np.arange(n_frames, dtype=np.float64)) / fps
    curve_times = _snap_to_keys(times, keys_s, tolerance / fps)
    curve_times[-1] = end
    return Sampling(times, curve_times, fps)


def common_rate(keys_s: Floats) -> float:
    """Return the lowest frame rate at which every key is on a frame; 0 if there is none.

    Frames count from the first key. The rate is at most four times that of the closest keys.
    """
    distinct = keys_s[np.diff(keys_s, prepend=-np.inf) > SAME_S]
    if len(distinct) < 2:
        return 0.0
    span = float(distinct[-1] - distinct[0])
    rate = 1 / float(np.diff(distinct).min())
    for multiple in (1, 2, 3, 4):
        n_intervals = round(span * rate * multiple)
        if n_intervals >= MAX_FRAMES:
            return 0.0
        grid = np.linspace(distinct[0], distinct[-1], n_intervals + 1)
        fps = Timing.of_times(grid, resolution_s=_rounding(distinct)).fps
        is_full = n_intervals + 1 == len(distinct)
        if (is_full or fps <= MAX_SPARSE_FPS) and _is_on_grid(distinct, fps):
            return fps
    return 0.0


def _is_on_grid(keys_s: Floats, fps: float) -> bool:
    frames, tolerance = (keys_s - keys_s[0]) * fps, max(10 * TOLERANCE, 2 * _rounding(keys_s) * fps)
    return bool(np.abs(frames - np.round(frames)).max() <= tolerance)


def _rounding(keys_s: Floats) -> float:
    """Return the float32 resolution of the key times, in seconds."""
    return float(np.spacing(np.float32(np.abs(keys_s).max())))


def _choose_rate(keys_s: Floats, is_curved: bool, notes: Notes) -> float:
    rate = common_rate(keys_s)
    if rate and (rate >= MIN_CURVED_FPS or not is_curved):
        return rate
    reason = (
        f"at {rate:g} per second with curved motion between them" if rate else "not evenly spaced"
    )
    notes.changed(
        Message(
            f"keys of the animation are {reason}; sampled at {DEFAULT_FPS:g} frames per second; "
            "choose another rate with ",
            Keyword("fps"),
        )
    )
    return DEFAULT_FPS


def _count_frames(span_s: float, fps: float, rounding_s: float, notes: Notes) -> int:
    n_intervals = span_s * fps
    if n_intervals >= MAX_FRAMES:
        raise FormatError(
            f"its animation takes {span_s:g} s, which is {n_intervals:.0f} frames at {fps:g} per "
            f"second; the limit is {MAX_FRAMES}; choose a lower rate with ",
            Keyword("fps"),
        )
    nearest = round(n_intervals)
    tolerance = min(max(TOLERANCE, n_intervals * 1e-6, rounding_s * fps), MAX_TOLERANCE)
    is_whole = nearest > 0 and abs(n_intervals - nearest) <= tolerance
    if is_whole:
        return nearest + 1
    n_covering = math.ceil(n_intervals)
    notes.changed(
        f"the animation takes {span_s:.6g} s, which is {n_intervals:.4g} frames at {fps:g} per "
        f"second; the last frame, {n_covering / fps:.6g} s after the first, shows its final pose"
    )
    return n_covering + 1


def _snap_to_keys(times_s: Floats, keys_s: Floats, tolerance_s: float) -> Floats:
    """Return the times, moved to the last key within the tolerance."""
    # The last one, since steps take effect at their key.
    last = keys_s[np.maximum(np.searchsorted(keys_s, times_s + tolerance_s, "right") - 1, 0)]
    return np.where(np.abs(last - times_s) <= tolerance_s, last, times_s)


def find_switching(
    shown: Sequence[ShownMesh], motion: Motion, times_s: Floats
) -> tuple[int, list[tuple[int, ...]]] | None:
    """Return the first frame with a mesh, and the indices of the meshes in it and each later frame.

    Meshes are hidden by visibility, or by a scale of zero that steps to another value. Frames
    before the first and after the last mesh may be empty. None unless there are at least two groups
    of meshes, of which each frame shows one.
    """
    showing = {
        (node, path): curve
        for (node, path), curve in motion.curves.items()
        if path == VISIBLE or (path == "scale" and _steps_from_zero(curve))
    }
    switches = [_switches(showing, motion, mesh) for mesh in shown] if showing else []
    if not any(switches):
        return None
    visible = np.ones((len(times_s), len(shown)), np.bool_)
    for column, curves in zip(visible.T, switches, strict=True):
        for curve in curves:
            column &= (curve.at(times_s) != 0).any(axis=1)
    filled = np.flatnonzero(visible.any(axis=1))
    if not len(filled):
        return None
    groups = [tuple(np.flatnonzero(row).tolist()) for row in visible[filled[0] : filled[-1] + 1]]
    members = list(chain.from_iterable(set(groups)))
    if len(set(groups)) < 2 or () in groups or len(set(members)) < len(members):
        return None
    return int(filled[0]), groups


def _switches(showing: Curves, motion: Motion, mesh: ShownMesh) -> list[Curve]:
    """Return the curves that show and hide a mesh; nodes above a skinned mesh do not scale it."""
    paths = [VISIBLE] if mesh.skin is not None else [VISIBLE, "scale"]
    keys = [(node, path) for node in motion.nodes.ancestors(mesh.node) for path in paths]
    return [showing[key] for key in keys if key in showing]


def _steps_from_zero(scale: Curve) -> bool:
    is_zero = scale.values == 0
    has_only_whole = bool((is_zero.all(axis=1) | ~is_zero.any(axis=1)).all())
    return scale.interpolation == STEP and has_only_whole and bool(is_zero.any())


def _is_of_segment(mesh: ShownMesh, nodes: Nodes) -> bool:
    """Return whether meshreel wrote a mesh as a segment, or a part of one."""
    extras = [nodes.objects[node].values.get("extras") for node in nodes.ancestors(mesh.node)]
    return any(isinstance(values, dict) and SEGMENT_START in values for values in extras)


def _join(
    meshes: Sequence[SceneMesh],
    first: int,
    groups: Sequence[tuple[int, ...]],
    sampling: Sampling,
    notes: Notes,
) -> SceneMesh:
    """Return a mesh whose faces change: from frame `first` on, the meshes of a group per frame."""
    segments: dict[tuple[int, ...], SceneMesh] = {}
    for group in dict.fromkeys(groups):
        parts = [meshes[number] for number in group]
        segments[group] = parts[0] if len(parts) == 1 else merge_meshes(parts, "", notes)

    def at(index: int) -> tuple[SceneMesh, int]:
        mesh = segments[groups[index]]
        return mesh, min(first + index, len(mesh.times_s) - 1)

    def frame(index: int) -> PolygonMesh:
        mesh, own_index = at(index)
        return mesh.frame(own_index)

    def surface(index: int) -> Surface:
        mesh, own_index = at(index)
        return mesh.surface(own_index)

    times_s = sampling.times_s[first : first + len(groups)]
    return SceneMesh(segments[groups[0]].name, times_s, frame, surface, sampling.fps or None)
