"""The nodes of a glTF file, and the animations that move them."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import FormatError, InvalidInputError, Keyword, Message
from meshreel.formats.gltf.document import (
    POINTER,
    VISIBILITY,
    Document,
    JsonObject,
    unique_names,
)
from meshreel.formats.kinds import AnimationInfo
from meshreel.model.notes import Notes, listed

Matrices = npt.NDArray[np.float64]

LINEAR, STEP, CUBICSPLINE = INTERPOLATIONS = ("LINEAR", "STEP", "CUBICSPLINE")

MIN_ARC_RAD = 1e-6
"""Angle between rotations below which linear interpolation replaces the spherical one."""

VISIBLE = "visible"
"""Path of channels that animate the visibility of a node."""

PATHS = {
    "translation": ("VEC3", 3),
    "rotation": ("VEC4", 4),
    "scale": ("VEC3", 3),
    "weights": ("SCALAR", 0),
    VISIBLE: ("SCALAR", 1),
}
"""Properties that a channel can animate: accessor types and numbers of their values. Weights have
as many as the mesh has targets."""

POINTERS = re.compile(
    rf"/nodes/(\d{{1,9}})/(?:(translation|rotation|scale|weights)|extensions/{VISIBILITY}/({VISIBLE}))"
)
"""Pointers to the properties in `PATHS`."""

MAX_LISTED = 10
"""Maximum number of animation names in a message."""

MAX_PATH = 4096
"""Maximum length of a node path: deep hierarchies with long names would fill the memory."""


class Nodes:
    """The nodes of a file.

    Attributes
    ----------
    parents : list of int
        Parent of each node; -1 for a root.
    ordered : list of int
        All nodes, parents first.

    Raises
    ------
    FormatError
        If a node has several parents, or is its own ancestor.
    """

    def __init__(self, document: Document) -> None:
        self.objects: tuple[JsonObject, ...] = document.lists["nodes"]
        self.parents: list[int] = [-1] * len(self.objects)
        self._children = [node.indices("children", "nodes") for node in self.objects]
        for parent, children in enumerate(self._children):
            for child in children:
                if self.parents[child] >= 0:
                    raise FormatError(
                        f"node {child} is a child of nodes {self.parents[child]} and {parent}; "
                        "a node must have one parent"
                    )
                self.parents[child] = parent
        self.ordered: list[int] = [node for node, parent in enumerate(self.parents) if parent < 0]
        for node in self.ordered:  # the list grows during iteration
            self.ordered += self._children[node]
        if len(self.ordered) < len(self.objects):
            lost = min(set(range(len(self.objects))) - set(self.ordered))
            raise FormatError(f"node {lost} is its own ancestor: nodes must form a tree")

    def ancestors(self, node: int) -> list[int]:
        """Return a node, its parent, and so on up to the root."""
        ancestors = []
        while node >= 0:
            ancestors.append(node)
            node = self.parents[node]
        return ancestors

    def with_ancestors(self, nodes: Iterable[int]) -> list[int]:
        """Return nodes and all their ancestors, parents first."""
        visited: set[int] = set()
        for start in nodes:
            node = start
            while node >= 0 and node not in visited:
                visited.add(node)
                node = self.parents[node]
        return [node for node in self.ordered if node in visited]

    def below(self, nodes: Iterable[int]) -> set[int]:
        """Return all nodes below some nodes, without these unless they are below others."""
        above, below = set(nodes), set[int]()
        for node in self.ordered:
            if self.parents[node] in above or self.parents[node] in below:
                below.add(node)
        return below

    def with_below(self, nodes: set[int]) -> set[int]:
        """Return nodes and all nodes below them."""
        return nodes | self.below(nodes)

    def subtrees(self, roots: Iterable[int]) -> list[int]:
        """Return roots and all nodes below them, in depth-first order."""
        stack = list(roots)[::-1]
        subtrees = []
        while stack:
            node = stack.pop()
            subtrees.append(node)
            stack += self._children[node][::-1]
        return subtrees

    def paths(self, defaults: Mapping[int, str]) -> list[str]:
        """Return the paths of nodes: names from the root, each after a slash.

        Parameters
        ----------
        defaults : dict of int to str
            Name of each node if it has none.

        Raises
        ------
        FormatError
            If a path is longer than `MAX_PATH`.
        """
        above = self.with_ancestors(defaults)
        names = {node: self.objects[node].text("name", "") for node in above}
        paths = []
        for node, default in defaults.items():
            path: list[str] = []
            n_characters = 0
            for ancestor in self.ancestors(node):
                name = names[ancestor] or (default if ancestor == node else "")
                path.append(name or f"node_{ancestor}")
                n_characters += len(path[-1]) + 1
                if n_characters > MAX_PATH:
                    raise FormatError(
                        f"node {node}: its path is longer than {MAX_PATH} characters; "
                        "nodes are nested too deeply"
                    )
            paths.append("".join([f"/{name.replace('/', '_')}" for name in reversed(path)]))
        return paths

    def labels(self, nodes: Iterable[int]) -> str:
        """Return the names of some nodes for messages."""
        return listed(self.objects[node].label() for node in nodes)

    def hidden(self) -> list[int]:
        """Return the nodes that are hidden themselves without an animation."""
        extensions = [node.extension(VISIBILITY) for node in self.objects]
        return [
            node
            for node, extension in enumerate(extensions)
            if extension is not None and extension.values.get("visible") is False
        ]

    @cached_property
    def _rest(self) -> list[dict[str, Floats] | FormatError]:
        """Matrix or other properties of each node, or the error of one with invalid numbers."""
        properties: list[dict[str, Floats] | FormatError] = []
        for json in self.objects:
            try:
                matrix = {"matrix": json.numbers("matrix", 16)} if "matrix" in json.values else {}
                rest = json.vectors(translation=(0, 0, 0), rotation=(0, 0, 0, 1), scale=(1, 1, 1))
                length = float(np.linalg.norm(rest["rotation"]))
                if not 0 < length < np.inf:
                    raise json.error("rotation", "a quaternion of length 1")
                rest["rotation"] /= length
                properties.append(rest | matrix)
            except FormatError as error:
                properties.append(error)
        return properties

    def rest(self, node: int) -> dict[str, Floats]:
        """Return the translation, unit quaternion x y z w and scale of a node, and its matrix.

        The matrix is missing if the node has none.

        Raises
        ------
        FormatError
            If a number is not finite, or a rotation has length 0.
        """
        rest = self._rest[node]
        if isinstance(rest, FormatError):
            raise rest
        return rest


@dataclass(frozen=True, eq=False)
class Curve:
    """Keyframes of a property."""

    keys_s: Floats
    """float64 array of shape (N,). Key times, ascending, at least one."""
    values: Floats
    """float64 array of shape (N, C)."""
    interpolation: str
    """One of `INTERPOLATIONS`."""
    tangents: tuple[Floats, Floats] | None = None
    """tuple of two float64 arrays of shape (N, C). In-tangents and out-tangents of a cubic spline.
    """
    is_rotation: bool = False
    """Whether values are quaternions."""

    def at(self, times_s: Floats) -> Floats:
        """Return the values at times of shape (T,), as (T, C), constant beyond the keys."""
        values = self._interpolated(times_s)
        return unit(values) if self.is_rotation else values

    def _interpolated(self, times_s: Floats) -> Floats:
        last = len(self.keys_s) - 1
        before = np.clip(np.searchsorted(self.keys_s, times_s, "right") - 1, 0, last)
        after = np.minimum(before + 1, last)
        first, second = self.values[before], self.values[after]
        if self.interpolation == STEP:
            return first
        span = (self.keys_s[after] - self.keys_s[before])[:, np.newaxis]
        elapsed = (times_s - self.keys_s[before])[:, np.newaxis]
        weight = np.clip(elapsed / np.where(span > 0, span, np.inf), 0, 1)
        if self.tangents is not None:
            in_tangents, out_tangents = self.tangents[0][after], self.tangents[1][before]
            return hermite(first, span * out_tangents, second, span * in_tangents, weight)
        if self.is_rotation:
            return slerp(first, second, weight)
        return (1 - weight) * first + weight * second


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


class Channel(NamedTuple):
    """The animation of a property of a node, one of `PATHS`, by a sampler."""

    node: int
    path: str
    sampler: JsonObject
    interpolation: str
    place: str

    @property
    def input(self) -> str:
        """The accessor of the key times, as written."""
        return repr(self.sampler.values.get("input"))


Curves = dict[tuple[int, str], Curve]
"""The curve of each animated node and path."""


@dataclass(frozen=True, eq=False)
class Clip:
    """An animation with its keys and values."""

    keys_s: Floats
    """float64 array of shape (N,). Key times of all channels, ascending; empty if the animation
    targets no node.
    """
    curves: Curves
    """Curves of the channels that move a mesh."""

    @property
    def is_curved(self) -> bool:
        """Whether values between two keys of a curve are not on the straight line between them."""
        return any(
            len(curve.keys_s) > 1
            and curve.interpolation != STEP
            and (curve.is_rotation or curve.tangents is not None)
            for curve in self.curves.values()
        )


class Clips:
    """The animations of a file.

    Parameters
    ----------
    moving : dict of collections of int
        By path, the nodes whose animation moves a mesh that is read.

    Attributes
    ----------
    names : list of str
        Unique names of the animations; "animation_N" for unnamed ones.
    """

    def __init__(self, document: Document, moving: Mapping[str, Collection[int]]) -> None:
        self._document, self._moving = document, moving
        self._animations = document.lists["animations"]
        names = [animation.values.get("name") for animation in self._animations]
        self.names: list[str] = unique_names(
            [
                name if isinstance(name, str) and name else f"animation_{number}"
                for number, name in enumerate(names)
            ]
        )

    def select(self, wanted: str | int | None, notes: Notes) -> Clip | None:
        """Return an animation by name or index, or by default the first that moves a mesh.

        Parameters
        ----------
        notes : Notes
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
        clip = self._read(number)
        if not clip.curves:
            notes.result(f"the animation {self.names[number]} moves no mesh; read a single frame")
            return None
        return clip

    def describe(self) -> list[AnimationInfo]:
        """Return every animation with its duration, or the problem of a malformed one."""
        descriptions = []
        for number, name in enumerate(self.names):
            try:
                clip = self._read(number)
            except FormatError as error:
                descriptions.append(AnimationInfo(name, problem=str(error)))
                continue
            first, last = (clip.keys_s[[0, -1]] if len(clip.keys_s) else np.zeros(2)).tolist()
            descriptions.append(AnimationInfo(name, first, last - first, bool(clip.curves)))
        return descriptions

    def _first_moving(self, notes: Notes) -> Clip | None:
        malformed: dict[str, str] = {}
        selected = None
        for number, name in enumerate(self.names):
            try:
                clip = self._read(number)
            except FormatError as error:
                malformed[name] = str(error)
                continue
            if clip.curves:
                selected = clip
                if unread := [other for other in self.names if other not in {name, *malformed}]:
                    notes.result(
                        Message(
                            f"read the animation {name}, not {listed(unread, MAX_LISTED)}; choose "
                            "with ",
                            Keyword("animation"),
                        )
                    )
                break
        if malformed:
            reasons = (f"{name} ({reason})" for name, reason in malformed.items())
            notes.left_out(f"malformed animations: {listed(reasons)}")
        if selected is None and (unused := [name for name in self.names if name not in malformed]):
            names = listed(unused, MAX_LISTED)
            subject = f"animations {names} move" if len(unused) > 1 else f"animation {names} moves"
            notes.result(f"the {subject} no mesh; read a single frame")
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

    def _read(self, number: int) -> Clip:
        """Return the keys and values of an animation; the last curve of several for a property."""
        animation, document = self._animations[number], self._document
        animation.text("name", "")
        channels = _read_channels(animation)
        inputs = {channel.input: channel.sampler for channel in channels}
        keys = {
            name: document.read_floats(sampler, "input", "SCALAR")[:, 0]
            for name, sampler in inputs.items()
        }
        for name, sampler in inputs.items():
            if (np.diff(keys[name]) < 0).any():
                raise FormatError(f"{sampler.place}: key times must be ascending")
        keys_s = np.unique(np.concatenate([*keys.values()])) if keys else np.empty(0)
        moving = [channel for channel in channels if channel.node in self._moving[channel.path]]
        values = [
            document.read_floats(channel.sampler, "output", PATHS[channel.path][0])
            for channel in moving
        ]
        curves = {
            (channel.node, channel.path): _curve(channel, keys[channel.input], numbers, document)
            for channel, numbers in zip(moving, values, strict=True)
        }
        return Clip(keys_s, curves)


def _read_channels(animation: JsonObject) -> list[Channel]:
    """Return the channels of an animation that target nodes; extensions define other targets."""
    samplers = animation.children("samplers", "sampler")
    channels = []
    for channel in animation.children("channels", "channel"):
        target = channel.required_child("target")
        path, node = target.text("path"), target.index("node", "nodes")
        if path == "pointer":
            extension = target.extension(POINTER)
            pointer = "" if extension is None else extension.text("pointer", "")
            match, n_nodes = POINTERS.fullmatch(pointer), len(target.lists["nodes"])
            node, path = (int(match[1]), match[2] or match[3]) if match else (None, path)
            if node is not None and node >= n_nodes:
                raise target.error("extensions", f"a pointer to one of {n_nodes} nodes")
        number = channel.index("sampler", len(samplers))
        if number is None:
            raise channel.error("sampler", "the index of a sampler")
        if node is not None and path in PATHS:
            interpolation = samplers[number].text("interpolation", LINEAR)
            channels.append(Channel(node, path, samplers[number], interpolation, channel.place))
    return channels


def other_pointers(animation: JsonObject) -> list[str]:
    """Return the pointers of channels that are not read."""
    pointers = []
    for channel in animation.children("channels", "channel"):
        target = channel.child("target")
        extension = None if target is None else target.extension(POINTER)
        pointers.append("" if extension is None else extension.text("pointer", ""))
    return [pointer for pointer in pointers if pointer and not POINTERS.fullmatch(pointer)]


def _curve(channel: Channel, keys_s: Floats, values: Floats, document: Document) -> Curve:
    """Return a curve of the numbers that its sampler stores."""
    _, path, sampler, interpolation, place = channel
    node = sampler.lists["nodes"][channel.node]
    if "matrix" in node.values and path not in ("weights", VISIBLE):
        raise FormatError(
            f"{place}: animates the {path} of {node.place}, which has a matrix instead"
        )
    if interpolation not in INTERPOLATIONS:
        raise sampler.error("interpolation", f"one of {', '.join(INTERPOLATIONS)}")
    if path == VISIBLE and interpolation != STEP:
        raise sampler.error("interpolation", "STEP, as visibility is not a number")
    width = PATHS[path][1] or document.mesh(node.item("mesh", "meshes")).n_targets
    n_each = 3 if interpolation == CUBICSPLINE else 1
    if values.size != len(keys_s) * n_each * width:
        raise FormatError(
            f"{sampler.place}: has {values.size} numbers for {len(keys_s)} keys; "
            f"expected {len(keys_s) * n_each * width}"
        )
    rows, is_rotation = values.reshape(len(keys_s), n_each, width), path == "rotation"
    if interpolation == CUBICSPLINE:
        return Curve(keys_s, rows[:, 1], interpolation, (rows[:, 0], rows[:, 2]), is_rotation)
    normalized = unit(rows[:, 0]) if is_rotation else rows[:, 0]
    return Curve(keys_s, normalized, interpolation, None, is_rotation)


@dataclass(frozen=True, eq=False)
class Motion:
    """The nodes of a file, and the curves that animate some of them."""

    nodes: Nodes
    curves: Curves
    """Empty if nothing is animated."""
    carriers: Collection[int]
    """Nodes whose transforms are needed."""

    @cached_property
    def animated(self) -> set[int]:
        """The nodes that are animated, or below an animated node."""
        return self.nodes.with_below({node for node, path in self.curves if path != "weights"})

    @cached_property
    def switched(self) -> set[int]:
        """The nodes whose visibility is animated, or below such a node."""
        return self.nodes.with_below({node for node, path in self.curves if path == VISIBLE})

    @cached_property
    def rest_worlds(self) -> dict[int, Matrices]:
        """World transforms of carriers that are not animated, of shape (1, 4, 4), by node.

        Nodes with invalid numbers are missing, and so are those below them.
        """
        worlds: dict[int, Matrices] = {}
        for node in self.nodes.with_ancestors(self.carriers):
            parent = self.nodes.parents[node]
            if node in self.animated or not (parent < 0 or parent in worlds):
                continue
            with suppress(FormatError), np.errstate(over="ignore", invalid="ignore"):
                local = self._local(node, np.zeros(1))
                worlds[node] = local if parent < 0 else worlds[parent] @ local
        return worlds

    def world(self, nodes: Sequence[int], times_s: Floats) -> Matrices:
        """Return the world transforms of some nodes, of shape (T, N, 3, 4)."""
        transforms: dict[int, Matrices] = {}
        for node in self.nodes.with_ancestors(nodes):
            if node in self.rest_worlds:
                transforms[node] = self.rest_worlds[node]
            else:
                local, parent = self._local(node, times_s), self.nodes.parents[node]
                transforms[node] = local if parent < 0 else transforms[parent] @ local
        worlds = np.empty((len(times_s), len(nodes), 3, 4))
        for index, node in enumerate(nodes):
            worlds[:, index] = transforms[node][:, :3]
        return worlds

    def _local(self, node: int, times_s: Floats) -> Matrices:
        """Return transforms of a node relative to its parent, of shape (T, 4, 4) or (1, 4, 4)."""
        rest = self.nodes.rest(node)
        if "matrix" in rest:
            return rest["matrix"].reshape(1, 4, 4).transpose(0, 2, 1)
        values = []
        for path in ("translation", "rotation", "scale"):
            curve = self.curves.get((node, path))
            values.append(rest[path][np.newaxis] if curve is None else curve.at(times_s))
        return compose(*values)


def compose(translations: Floats, rotations: Floats, scales: Floats) -> Matrices:
    """Return transforms that scale, then rotate, then translate, of shape (T, 4, 4).

    Parameters
    ----------
    translations, scales : float64 arrays of shape (T, 3)
    rotations : float64 array of shape (T, 4)
        Unit quaternions x y z w. Each of the three may have a single row, for all times.
    """
    x, y, z, w = rotations.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    n_times = max(len(translations), len(rotations), len(scales))
    transforms = np.zeros((n_times, 4, 4))
    transforms[:, :3, :3] = np.moveaxis(np.array(rows), 2, 0) * scales[:, np.newaxis]
    transforms[:, :3, 3] = translations
    transforms[:, 3, 3] = 1
    return transforms
