"""The animations of a glTF file: their keys, and the times at which they are sampled."""

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import FormatError, InvalidInputError, Keyword, Message
from meshreel.formats.gltf.document import POINTER, VISIBILITY, Document, JsonObject, unique_names
from meshreel.formats.gltf.scene import (
    CUBICSPLINE,
    INTERPOLATIONS,
    LINEAR,
    STEP,
    VISIBLE,
    Curve,
    Curves,
)
from meshreel.formats.kinds import AnimationInfo
from meshreel.model.notes import Notes, listed
from meshreel.model.timing import rounded_rate

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


class Channel(NamedTuple):
    """The animation of a property by a sampler."""

    node: int
    """The node, if the property is one of `PATHS`; else -1."""
    path: str
    """The property of the node, or a pointer to another property."""
    sampler: JsonObject
    interpolation: str
    place: str

    @property
    def input(self) -> str:
        """The accessor of the key times, as written."""
        return repr(self.sampler.values.get("input"))


@dataclass(frozen=True, eq=False)
class Clip:
    """An animation with its keys and values."""

    keys_s: Floats
    """float64 array of shape (N,). Key times of all channels, ascending; empty if the animation
    targets no node.
    """
    curves: Curves
    """Curves of the channels that move a mesh."""
    others: tuple[str, ...]
    """Properties that other channels animate."""
    malformed: tuple[str, ...]
    """Errors of the channels that are left out."""

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

    def select(self, animation: str | int | None, notes: Notes) -> Clip | None:
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
        if animation is None:
            return self._first_moving(notes)
        number = self._index(animation)
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

    def _index(self, animation: str | int) -> int:
        """Return the index of an animation by name or index."""
        if animation in self.names:
            return self.names.index(str(animation))
        if isinstance(animation, int) or animation.isdecimal():
            number = int(animation)
            if 0 <= number < len(self.names):
                return number
        if not self.names:
            raise InvalidInputError(
                f"has no animation {animation!r}; it contains no animations; omit ",
                Keyword("animation"),
            )
        raise InvalidInputError(
            f"has no animation {animation!r}; it contains {listed(self.names, MAX_LISTED)}; choose "
            f"one of these names, or an index from 0 to {len(self.names) - 1}"
        )

    def _read(self, number: int) -> Clip:
        """Return the keys and values of an animation; the last curve of several for a property.

        Malformed channels are left out; if no curve remains beside them, the first error is raised.
        """
        animation, document = self._animations[number], self._document
        animation.text("name", "")
        # Each loop reads one thing of all channels.
        failures = dict[str, FormatError]()
        channels = _read_channels(animation, failures)
        samplers = {channel.input: channel.sampler for channel in channels}
        keys, bad_keys = dict[str, Floats](), dict[str, FormatError]()
        for name, sampler in samplers.items():
            try:
                keys[name] = document.read_floats(sampler, "input", "SCALAR")[:, 0]
            except FormatError as error:
                bad_keys[name] = error
        for name, sampler in samplers.items():
            if name in keys and (np.diff(keys[name]) < 0).any():
                bad_keys[name] = FormatError(f"{sampler.place}: key times must be ascending")

        moving, used, others = list[Channel](), set[str](), list[str]()
        for channel in channels:
            if channel.input in bad_keys:
                failures[channel.place] = bad_keys[channel.input]
            elif channel.node >= 0 and channel.node in self._moving[channel.path]:
                moving.append(channel)
                continue
            else:
                node = document.lists["nodes"][channel.node] if channel.node >= 0 else None
                others.append(f"{channel.path} of {node.label()}" if node else channel.path)
                used.add(channel.input)
        values = dict[str, Floats]()
        for channel in moving:
            try:
                kind, _ = PATHS[channel.path]
                values[channel.place] = document.read_floats(channel.sampler, "output", kind)
            except FormatError as error:
                failures[channel.place] = error
        curves = dict[tuple[int, str], Curve]()
        for channel in moving:
            try:
                if channel.place in values:
                    numbers, keys_s = values[channel.place], keys[channel.input]
                    curves[channel.node, channel.path] = _curve(channel, keys_s, numbers, document)
                    used.add(channel.input)
            except FormatError as error:
                failures[channel.place] = error

        places = (each.place for each in animation.children("channels", "channel"))
        errors = [(place, failures[place]) for place in places if place in failures]
        if errors and not curves:
            raise errors[0][1]
        malformed = [str(e) if place in str(e) else f"{place}, {e}" for place, e in errors]
        used_keys = [keys_s for name, keys_s in keys.items() if name in used]
        keys_s = np.unique(np.concatenate(used_keys)) if used_keys else np.empty(0)
        return Clip(keys_s, curves, tuple(others), tuple(malformed))


def _read_channels(animation: JsonObject, failures: dict[str, FormatError]) -> list[Channel]:
    """Return the channels of an animation, and collect the errors of others by their places.

    Extensions define targets other than nodes.
    """
    samplers, channels = animation.children("samplers", "sampler"), []
    for channel in animation.children("channels", "channel"):
        try:
            target = channel.required_child("target")
            path, node = target.text("path"), target.index("node", "nodes")
            if path == "pointer":
                extension = target.extension(POINTER)
                pointer = "" if extension is None else extension.text("pointer", "")
                match, n_nodes = POINTERS.fullmatch(pointer), len(target.lists["nodes"])
                node, path = (int(match[1]), match[2] or match[3]) if match else (None, pointer)
                if node is not None and node >= n_nodes:
                    raise target.error("extensions", f"a pointer to one of {n_nodes} nodes")
            number = channel.index("sampler", len(samplers))
            if number is None:
                raise channel.error("sampler", "the index of a sampler")
            interpolation = samplers[number].text("interpolation", LINEAR)
        except FormatError as error:
            failures[channel.place] = error
            continue
        node = -1 if node is None or path not in PATHS else node
        channels.append(Channel(node, path, samplers[number], interpolation, channel.place))
    return channels


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
    n_per_key = 3 if interpolation == CUBICSPLINE else 1
    if values.size != len(keys_s) * n_per_key * width:
        raise FormatError(
            f"{sampler.place}: has {values.size} numbers for {len(keys_s)} keys; "
            f"expected {len(keys_s) * n_per_key * width}"
        )
    rows, is_rotation = values.reshape(len(keys_s), n_per_key, width), path == "rotation"
    if interpolation == CUBICSPLINE:
        return Curve(keys_s, rows[:, 1], interpolation, (rows[:, 0], rows[:, 2]), is_rotation)
    return Curve(keys_s, rows[:, 0], interpolation, None, is_rotation)


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
    """
    start, end = float(keys_s[0]), float(keys_s[-1])
    if end - start < SAME_S:
        return Sampling(keys_s[:1], keys_s[:1], 0.0)
    if not fps and not is_curved and not common_rate(keys_s) and len(keys_s) < MAX_FRAMES:
        return Sampling(keys_s, keys_s, 0.0)
    fps = fps or _choose_rate(keys_s, is_curved, notes)
    n_frames = _count_frames(end - start, fps, _rounding(keys_s), notes)
    first_frame, tolerance = start * fps, min(max(TOLERANCE, _rounding(keys_s) * fps), 0.1)
    if abs(first_frame - round(first_frame)) <= tolerance:
        first_frame = round(first_frame)
    times: Floats = (first_frame + np.arange(n_frames, dtype=np.float64)) / fps
    # At the last key within the tolerance, since steps take effect at their key.
    last = keys_s[np.maximum(np.searchsorted(keys_s, times + tolerance / fps, "right") - 1, 0)]
    curve_times = np.where(np.abs(last - times) <= tolerance / fps, last, times)
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
        fps = rounded_rate(n_intervals / span, 2 * _rounding(distinct) / span)
        is_full = n_intervals + 1 == len(distinct)
        frames, rounding = (distinct - distinct[0]) * fps, 2 * _rounding(distinct) * fps
        is_on_grid = np.abs(frames - np.round(frames)).max() <= max(10 * TOLERANCE, rounding)
        if (is_full or fps <= MAX_SPARSE_FPS) and is_on_grid:
            return fps
    return 0.0


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
