"""Animations of a glTF file: curves by node and property, and world transforms of the nodes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import FormatError
from meshreel.formats.gltf.accessors import Accessors
from meshreel.formats.gltf.interpolation import Curve, Interpolation, unit
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.nodes import Nodes
from meshreel.formats.gltf.primitives import count_targets

VISIBILITY, POINTER = "KHR_node_visibility", "KHR_animation_pointer"

VISIBLE = "visible"
"""Path of channels that animate the visibility of a node."""

PATHS = {
    "translation": ("VEC3",),
    "rotation": ("VEC4",),
    "scale": ("VEC3",),
    "weights": ("SCALAR",),
    VISIBLE: ("SCALAR",),
}
"""Properties that a channel can animate, and the accessor types of their values."""

Matrices = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Channel:
    """A channel: the animation of a property of a node.

    Attributes
    ----------
    node : int
    path : str
        One of `PATHS`.
    sampler : JsonObject
    json : JsonObject
        The channel in the file.
    """

    node: int
    path: str
    sampler: JsonObject
    json: JsonObject


POINTERS = re.compile(
    rf"/nodes/(\d{{1,9}})/(?:(translation|rotation|scale|weights)|extensions/{VISIBILITY}/({VISIBLE}))"
)
"""Pointers to the properties in `PATHS`."""

Curves = dict[tuple[int, str], Curve]
"""The curve of each animated node and path."""


def read_channels(animation: JsonObject, n_nodes: int) -> list[Channel]:
    """Return the channels of an animation that target nodes; extensions define other targets.

    Raises
    ------
    FormatError
        If a channel refers to a missing node or sampler.
    """
    samplers = animation.children("samplers", "sampler")
    channels = []
    for channel in animation.children("channels", "channel"):
        target = channel.required_child("target")
        node, path = _target_of(target, n_nodes)
        number = channel.index("sampler", len(samplers))
        if number is None:
            raise channel.error("sampler", "the index of a sampler")
        if node is not None and path in PATHS:
            channels.append(Channel(node, path, samplers[number], channel))
    return channels


def _target_of(target: JsonObject, n_nodes: int) -> tuple[int | None, str]:
    """Return the node and the path of the target of a channel; None for other targets."""
    path = target.text("path")
    if path != "pointer":
        return target.index("node", n_nodes), path
    found = POINTERS.fullmatch(pointer_of(target))
    if found is None:
        return None, path
    node = int(found[1])
    if node >= n_nodes:
        raise target.error("extensions", f"a pointer to one of {n_nodes} nodes")
    return node, found[2] or found[3]


def pointer_of(target: JsonObject) -> str:
    """Return the JSON pointer of the target of a channel; empty if it has none."""
    extension = target.extension(POINTER)
    return "" if extension is None else extension.text("pointer", "")


def other_pointers(animation: JsonObject) -> list[str]:
    """Return the pointers of channels that are not read."""
    targets = (one.child("target") for one in animation.children("channels", "channel"))
    pointers = [pointer_of(one) for one in targets if one is not None]
    return [one for one in pointers if one and not POINTERS.fullmatch(one)]


def read_keys(channels: list[Channel], accessors: Accessors) -> Floats:
    """Return the distinct key times of all channels, in seconds, ascending.

    Raises
    ------
    FormatError
        If keys are not ascending, or a time is not finite.
    """
    samplers = {id(one.sampler): one.sampler for one in channels}
    inputs = {repr(one.values.get("input")): one for one in samplers.values()}
    return np.unique(np.concatenate([_keys(one, accessors) for one in inputs.values()]))


def read_curves(channels: list[Channel], nodes: Nodes, accessors: Accessors) -> Curves:
    """Return the curves of channels; the last one of several for the same property.

    Raises
    ------
    FormatError
        As `read_keys`, or if values are not finite, or their number does not match the keys.
    """
    return {(one.node, one.path): _read_curve(one, nodes, accessors) for one in channels}


def _read_curve(channel: Channel, nodes: Nodes, accessors: Accessors) -> Curve:
    sampler, node = channel.sampler, nodes.objects[channel.node]
    if "matrix" in node and channel.path not in ("weights", VISIBLE):
        raise FormatError(
            f"{channel.json.place}: animates the {channel.path} of {node.place}, "
            "which has a matrix instead"
        )
    name = sampler.text("interpolation", "LINEAR")
    if name not in list(Interpolation):
        raise sampler.error("interpolation", f"one of {', '.join(Interpolation)}")
    if channel.path == VISIBLE and name != Interpolation.STEP:
        raise sampler.error("interpolation", "STEP, as visibility is not a number")
    values = accessors.read(sampler, "output", *PATHS[channel.path]).floats().astype(np.float64)
    if not np.isfinite(values).all():
        raise FormatError(f"{sampler.place}: key values must be finite")
    width = _width(channel, nodes, accessors)
    return _curve(channel, _keys(sampler, accessors), values, Interpolation(name), width)


def _keys(sampler: JsonObject, accessors: Accessors) -> Floats:
    keys = accessors.read(sampler, "input", "SCALAR").floats()[:, 0].astype(np.float64)
    if not np.isfinite(keys).all() or (np.diff(keys) < 0).any():
        raise FormatError(f"{sampler.place}: key times must be finite and ascending")
    return keys


def _curve(
    channel: Channel, keys: Floats, values: Floats, interpolation: Interpolation, width: int
) -> Curve:
    is_rotation = channel.path == "rotation"
    n_each = 3 if interpolation is Interpolation.CUBICSPLINE else 1
    if values.size != len(keys) * n_each * width:
        raise FormatError(
            f"{channel.sampler.place}: has {values.size} numbers for {len(keys)} keys; "
            f"expected {len(keys) * n_each * width}"
        )
    rows = values.reshape(len(keys), n_each, width)
    if interpolation is Interpolation.CUBICSPLINE:
        return Curve(keys, rows[:, 1], interpolation, (rows[:, 0], rows[:, 2]), is_rotation)
    normalized = unit(rows[:, 0]) if is_rotation else rows[:, 0]
    return Curve(keys, normalized, interpolation, None, is_rotation)


def _width(channel: Channel, nodes: Nodes, accessors: Accessors) -> int:
    """Return the number of components of a key value."""
    if channel.path != "weights":
        return {"rotation": 4, VISIBLE: 1}.get(channel.path, 3)
    document = accessors.document
    return count_targets(document.item(nodes.objects[channel.node], "mesh", "meshes"))


@dataclass(frozen=True, eq=False)
class Motion:
    """The nodes of a file, and the curves that animate some of them.

    Parameters
    ----------
    nodes : Nodes
    curves : Curves
        Empty if nothing is animated.
    """

    nodes: Nodes
    curves: Curves

    @cached_property
    def animated(self) -> frozenset[int]:
        """The nodes that are animated, or below an animated node."""
        nodes = {node for node, path in self.curves if path != "weights"}
        parents, depths = self.nodes.parents, self.nodes.depths
        for node in sorted(range(len(parents)), key=depths.__getitem__):
            if parents[node] in nodes:
                nodes.add(node)
        return frozenset(nodes)

    def world(self, nodes: Sequence[int], times_s: Floats) -> Matrices:
        """Return the world transforms of some nodes, of shape (T, N, 3, 4)."""
        transforms: dict[int, Matrices] = {}
        for node in self.nodes.with_ancestors(nodes):
            local, parent = self._local(node, times_s), self.nodes.parents[node]
            transforms[node] = local if parent < 0 else transforms[parent] @ local
        worlds = np.empty((len(times_s), len(nodes), 3, 4))
        for index, node in enumerate(nodes):
            worlds[:, index] = transforms[node][:, :3]
        return worlds

    def weights(self, node: int, default: Floats, times_s: Floats) -> Floats:
        """Return the weights of morph targets at a node, of shape (T, M)."""
        curve = self.curves.get((node, "weights"))
        return np.tile(default, (len(times_s), 1)) if curve is None else curve.at(times_s)

    def _local(self, node: int, times_s: Floats) -> Matrices:
        """Return the transforms to the parent, of shape (T, 4, 4), or (1, 4, 4) if static."""
        rest = self.nodes.transform(node)
        if rest.matrix is not None:
            return rest.matrix[np.newaxis]
        transforms = []
        for path in ("translation", "rotation", "scale"):
            curve = self.curves.get((node, path))
            transforms.append(
                getattr(rest, path)[np.newaxis] if curve is None else curve.at(times_s)
            )
        return compose(*transforms)


def compose(translations: Floats, rotations: Floats, scales: Floats) -> Matrices:
    """Return transforms that scale, then rotate, then translate, of shape (T, 4, 4).

    Parameters
    ----------
    translations, scales : float64 arrays of shape (T, 3)
    rotations : float64 array of shape (T, 4)
        Unit quaternions x y z w. Each of the three may have a single row, for all times.
    """
    n_times = max(len(translations), len(rotations), len(scales))
    transforms = np.zeros((n_times, 4, 4))
    transforms[:, :3, :3] = rotation_matrices(rotations) * scales[:, np.newaxis]
    transforms[:, :3, 3] = translations
    transforms[:, 3, 3] = 1
    return transforms


def rotation_matrices(quaternions: Floats) -> Matrices:
    """Return the matrices of unit quaternions x y z w, of shape (T, 3, 3)."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
