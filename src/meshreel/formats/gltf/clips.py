"""The animations of a glTF file: names, durations, and selection of the one to read."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import FormatError, InvalidInputError, Keyword, Message
from meshreel.formats.animations import AnimationInfo
from meshreel.formats.gltf.accessors import Accessors
from meshreel.formats.gltf.animation import Channel, Curves, read_channels, read_curves, read_keys
from meshreel.formats.gltf.nodes import Nodes, unique_names
from meshreel.formats.notes import listed, note_left_out

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
                " (",
                Keyword("animation"),
                ")",
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
