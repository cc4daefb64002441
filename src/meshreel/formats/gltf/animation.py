"""Animations of a glTF file: their selection, curves by node, and transforms of nodes."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import FormatError, InvalidInputError, Keyword, Message
from meshreel.formats.animations import AnimationInfo
from meshreel.formats.gltf.accessors import Accessors
from meshreel.formats.gltf.document import JsonObject
from meshreel.formats.gltf.nodes import Nodes, unique_names
from meshreel.formats.gltf.primitives import count_targets
from meshreel.formats.notes import listed, note_left_out

MIN_ARC_RAD = 1e-6
"""Angle between rotations below which linear interpolation replaces the spherical one."""


class Interpolation(StrEnum):
    """Interpolation modes of glTF."""

    LINEAR = "LINEAR"
    STEP = "STEP"
    CUBICSPLINE = "CUBICSPLINE"


@dataclass(frozen=True, eq=False)
class Curve:
    """Keyframes of a property.

    Attributes
    ----------
    keys_s : float64 array of shape (N,)
        Key times, ascending, at least one.
    values : float64 array of shape (N, C)
    interpolation : Interpolation
    tangents : tuple of two float64 arrays of shape (N, C), optional
        In-tangents and out-tangents of a cubic spline.
    is_rotation : bool
        Whether values are quaternions.
    """

    keys_s: Floats
    values: Floats
    interpolation: Interpolation
    tangents: tuple[Floats, Floats] | None = None
    is_rotation: bool = False

    @property
    def is_curved(self) -> bool:
        """Whether values between two keys are not on the straight line between them."""
        if len(self.keys_s) == 1 or self.interpolation is Interpolation.STEP:
            return False
        return self.is_rotation or self.interpolation is Interpolation.CUBICSPLINE

    def at(self, times_s: Floats) -> Floats:
        """Return the values at times of shape (T,), as (T, C), constant beyond the keys."""
        last = len(self.keys_s) - 1
        before = np.clip(np.searchsorted(self.keys_s, times_s, "right") - 1, 0, last)
        after = np.minimum(before + 1, last)
        if self.interpolation is Interpolation.STEP:
            return self._unit(self.values[before])
        span = self.keys_s[after] - self.keys_s[before]
        elapsed = times_s - self.keys_s[before]
        weight = np.clip(elapsed / np.where(span > 0, span, np.inf), 0, 1)[:, np.newaxis]
        first, second = self.values[before], self.values[after]
        if self.tangents is not None:
            in_tangents, out_tangents = self.tangents[0][after], self.tangents[1][before]
            span = span[:, np.newaxis]
            return self._unit(
                hermite(first, span * out_tangents, second, span * in_tangents, weight)
            )
        if self.is_rotation:
            return self._unit(slerp(first, second, weight))
        return (1 - weight) * first + weight * second

    def _unit(self, values: Floats) -> Floats:
        return unit(values) if self.is_rotation else values


def hermite(
    first: Floats, out_tangent: Floats, second: Floats, in_tangent: Floats, s: Floats
) -> Floats:
    """Return values of a cubic spline at parameters s from 0 to 1, all of shape (T, C).

    Tangents are scaled by the interval between the keys.
    """
    return (
        (2 * s**3 - 3 * s**2 + 1) * first
        + (s**3 - 2 * s**2 + s) * out_tangent
        + (3 * s**2 - 2 * s**3) * second
        + (s**3 - s**2) * in_tangent
    )


def slerp(first: Floats, second: Floats, weight: Floats) -> Floats:
    """Return rotations interpolated spherically along the shorter arc, of shape (T, 4).

    Parameters
    ----------
    first, second : float64 arrays of shape (T, 4)
        Unit quaternions.
    weight : float64 array of shape (T, 1)
    """
    cosine = (first * second).sum(axis=1, keepdims=True)
    nearer = np.where(cosine < 0, -second, second)
    # From the chord, which is accurate for small angles, unlike the arc cosine.
    chord = np.linalg.norm(nearer - first, axis=1, keepdims=True)
    angle = 2 * np.arcsin(np.minimum(chord / 2, 1))
    is_arc = angle > MIN_ARC_RAD
    sine = np.where(is_arc, np.sin(angle), 1)
    before = np.where(is_arc, np.sin((1 - weight) * angle) / sine, 1 - weight)
    after = np.where(is_arc, np.sin(weight * angle) / sine, weight)
    interpolated: Floats = before * first + after * nearer
    return interpolated


def unit(quaternions: Floats) -> Floats:
    """Return quaternions of shape (T, 4) with length 1; identity where all components are 0."""
    lengths = np.linalg.norm(quaternions, axis=1, keepdims=True)
    return np.where(lengths > 0, quaternions / np.where(lengths > 0, lengths, 1), [0.0, 0, 0, 1])


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


MAX_LISTED = 10
"""Maximum number of animation names in a message."""


@dataclass(frozen=True, eq=False)
class Clip:
    """An animation with its keys and values.

    Attributes
    ----------
    keys_s : float64 array of shape (N,)
        Key times of all channels, ascending; empty if the animation targets no node.
    curves : Curves
        Curves of the channels that move a mesh.
    """

    keys_s: Floats
    curves: Curves


class Clips:
    """The animations of a file.

    Parameters
    ----------
    nodes : Nodes
    accessors : Accessors
    moves_mesh : function of a channel
        Returns whether it moves a mesh that is read.

    Attributes
    ----------
    names : list of str
        Unique names of the animations; "animation_N" for unnamed ones.
    """

    def __init__(
        self, nodes: Nodes, accessors: Accessors, moves_mesh: Callable[[Channel], bool]
    ) -> None:
        self._nodes, self._accessors, self._moves_mesh = nodes, accessors, moves_mesh
        self._animations = accessors.document.lists["animations"]
        stored = [one.values.get("name") for one in self._animations]
        self.names: list[str] = unique_names(
            [
                name if isinstance(name, str) and name else f"animation_{number}"
                for number, name in enumerate(stored)
            ]
        )

    def read(self, number: int) -> Clip:
        """Return the keys and values of an animation.

        Raises
        ------
        FormatError
            If it is malformed.
        """
        animation = self._animations[number]
        animation.text("name", "")
        channels = read_channels(animation, len(self._nodes.objects))
        animated = [one for one in channels if self._moves_mesh(one)]
        keys_s = read_keys(channels, self._accessors) if channels else np.empty(0)
        return Clip(keys_s, read_curves(animated, self._nodes, self._accessors))

    def describe(self) -> list[AnimationInfo]:
        """Return every animation with its duration, or the problem of a malformed one."""
        return [self._describe(number) for number in range(len(self.names))]

    def select(self, wanted: str | int | None, notes: list[str]) -> Clip | None:
        """Return an animation by name or index, or by default the first that moves a mesh.

        Parameters
        ----------
        wanted : str, int or None
        notes : list of str
            Gains sentences on malformed animations, and on those not read by default.

        Returns
        -------
        Clip, or None if no mesh would move.

        Raises
        ------
        InvalidInputError
            If there is no such animation.
        FormatError
            If the requested animation is malformed.
        """
        if wanted is None:
            return self._first_moving(notes)
        number = self._index(wanted)
        clip = self.read(number)
        if not clip.curves:
            notes.append(f"the animation {self.names[number]} moves no mesh; read a single frame")
            return None
        return clip

    def _first_moving(self, notes: list[str]) -> Clip | None:
        malformed: dict[str, str] = {}
        selected = None
        for number, name in enumerate(self.names):
            try:
                clip = self.read(number)
            except FormatError as error:
                malformed[name] = str(error)
                continue
            if clip.curves:
                selected = clip
                if others := [one for one in self.names if one != name and one not in malformed]:
                    notes.append(
                        Message(
                            f"read the animation {name}, not {listed(others, MAX_LISTED)}; choose "
                            "with ",
                            Keyword("animation"),
                        )
                    )
                break
        if malformed:
            reasons = (f"{name} ({reason})" for name, reason in malformed.items())
            note_left_out(notes, f"malformed animations: {listed(reasons)}")
        if selected is None and (unused := [one for one in self.names if one not in malformed]):
            names = listed(unused, MAX_LISTED)
            subject = f"animations {names} move" if len(unused) > 1 else f"animation {names} moves"
            notes.append(f"the {subject} no mesh; read a single frame")
        return selected

    def _index(self, wanted: str | int) -> int:
        """Return the index of an animation by name or index."""
        if wanted in self.names:
            return self.names.index(str(wanted))
        if isinstance(wanted, int) or wanted.isdecimal():
            number = int(wanted)
            if 0 <= number < len(self.names):
                return number
        if not self.names:
            raise InvalidInputError(
                f"has no animation {wanted!r}; it contains no animations; omit ",
                Keyword("animation"),
            )
        raise InvalidInputError(
            f"has no animation {wanted!r}; it contains {listed(self.names, MAX_LISTED)}; choose "
            f"one of these names, or an index from 0 to {len(self.names) - 1}"
        )

    def _describe(self, number: int) -> AnimationInfo:
        name = self.names[number]
        try:
            clip = self.read(number)
        except FormatError as error:
            return AnimationInfo(name, problem=str(error))
        if not len(clip.keys_s):
            return AnimationInfo(name)
        first, last = float(clip.keys_s[0]), float(clip.keys_s[-1])
        return AnimationInfo(name, first, last - first, bool(clip.curves))
