"""The animations of a glTF file: their names and durations, and the one that is read."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.animations import AnimationInfo
from meshreel.formats.gltf.accessors import Accessors
from meshreel.formats.gltf.animation import Channel, Curves, read_channels, read_curves, read_keys
from meshreel.formats.gltf.nodes import Nodes, unique_names
from meshreel.formats.notes import listed, note_left_out

MAX_LISTED = 10
"""Names of animations in a note or an error."""


@dataclass(frozen=True, eq=False)
class Clip:
    """An animation whose keys and values were read.

    Attributes
    ----------
    keys_s : float64 array of shape (N,)
        Times of the keys of all its channels, ascending; empty if it moves no node.
    curves : Curves
        Of the channels that move a mesh; empty if none does.
    """

    keys_s: Floats
    curves: Curves


class Clips:
    """The animations of a file.

    Parameters
    ----------
    moves_mesh : function of a channel
        Whether it moves a mesh that is read.

    Attributes
    ----------
    names : list of str
        Of each animation, no two alike; "animation_N" for one without a name.
    """

    def __init__(
        self, nodes: Nodes, accessors: Accessors, moves_mesh: Callable[[Channel], bool]
    ) -> None:
        self._nodes, self._accessors, self._moves_mesh = nodes, accessors, moves_mesh
        self._animations = accessors.document.lists["animations"]
        given = [one.values.get("name") for one in self._animations]
        self.names = unique_names(
            [
                name if isinstance(name, str) and name else f"animation_{number}"
                for number, name in enumerate(given)
            ]
        )

    def read(self, number: int) -> Clip:
        """The keys and values of an animation.

        Raises
        ------
        FormatError
            If it is malformed.
        """
        animation = self._animations[number]
        animation.text("name", "")
        channels = read_channels(animation, len(self._nodes.objects))
        moving = [one for one in channels if self._moves_mesh(one)]
        keys_s = read_keys(channels, self._accessors) if channels else np.empty(0)
        return Clip(keys_s, read_curves(moving, self._nodes, self._accessors))

    def described(self) -> list[AnimationInfo]:
        """Every animation with its duration, malformed ones with the reason."""
        return [self._described(number) for number in range(len(self.names))]

    def chosen(self, wanted: str | int | None, notes: list[str]) -> Clip | None:
        """The animation of this name or number, or else the first that moves a mesh.

        Parameters
        ----------
        wanted : str, int or None
        notes : list of str
            Extended by notes on malformed animations, and on the others if none was selected.

        Returns
        -------
        Clip, or None if it would move no mesh.

        Raises
        ------
        InvalidInputError
            If there is no such animation.
        FormatError
            If it is malformed.
        """
        if wanted is None:
            return self._first_moving(notes)
        number = self._number(wanted)
        clip = self.read(number)
        if not clip.curves:
            notes.append(f"the animation {self.names[number]} moves no mesh; took one frame")
            return None
        return clip

    def _first_moving(self, notes: list[str]) -> Clip | None:
        malformed: dict[str, str] = {}
        found = None
        for number, name in enumerate(self.names):
            try:
                clip = self.read(number)
            except FormatError as error:
                malformed[name] = str(error)
                continue
            if clip.curves:
                found = clip
                if others := [one for one in self.names if one != name and one not in malformed]:
                    notes.append(
                        f"took the animation {name}, not {listed(others, MAX_LISTED)}; choose "
                        "with --animation (animation=)"
                    )
                break
        if malformed:
            reasons = (f"{name} ({reason})" for name, reason in malformed.items())
            note_left_out(notes, f"malformed animations: {listed(reasons)}")
        if found is None and (still := [one for one in self.names if one not in malformed]):
            notes.append(
                f"no mesh is moved by the animation {listed(still, MAX_LISTED)}; took one frame"
            )
        return found

    def _number(self, wanted: str | int) -> int:
        """Index of the animation with a name or a number, from 0."""
        if wanted in self.names:
            return self.names.index(str(wanted))
        if isinstance(wanted, int) or wanted.isdecimal():
            number = int(wanted)
            if 0 <= number < len(self.names):
                return number
        if not self.names:
            raise InvalidInputError(
                f"has no animation {wanted!r}, for it holds none; leave --animation (animation=) "
                "out"
            )
        raise InvalidInputError(
            f"has no animation {wanted!r}; it holds {listed(self.names, MAX_LISTED)}; give one of "
            f"these names, or a number from 0 to {len(self.names) - 1}"
        )

    def _described(self, number: int) -> AnimationInfo:
        name = self.names[number]
        try:
            clip = self.read(number)
        except FormatError as error:
            return AnimationInfo(name, problem=str(error))
        if not len(clip.keys_s):
            return AnimationInfo(name)
        first, last = float(clip.keys_s[0]), float(clip.keys_s[-1])
        return AnimationInfo(name, first, last - first, bool(clip.curves))
