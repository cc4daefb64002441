"""Visibility of nodes, and meshes that are shown in turn: the segments of a sequence."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.formats.gltf.animation import VISIBILITY, VISIBLE, Motion
from meshreel.formats.gltf.interpolation import Curve, Interpolation
from meshreel.formats.gltf.nodes import Nodes
from meshreel.formats.gltf.scene import ShownMesh

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
