"""Inputs of a batch: each animation of a file is a separate input."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace

from meshreel.app.batch.discovery import OUTPUT_ENDING, BatchInput
from meshreel.errors import InvalidInputError, MeshReelError
from meshreel.formats.animations import AnimationInfo
from meshreel.formats.inspection import animations_of
from meshreel.formats.options import ReadOptions
from meshreel.formats.remote import at_hand
from meshreel.formats.sources import find_files
from meshreel.formats.supported_options import supports

NOT_PORTABLE = r"[^\w.+-]+"
"""Characters that are replaced in names of outputs."""
MAX_NAME = 80
"""Characters of the name of an animation in that of an output."""


def every_animation(
    inputs: Iterable[BatchInput], notes: list[str], *, allow_outside: bool
) -> list[BatchInput]:
    """The inputs, where files of several animations are replaced by one input for each of them.

    ``man.glb`` with the animations "run" and "jump" becomes ``man.run.reel`` and
    ``man.jump.reel``. Files that cannot be read stay as they are, and fail later with the reason.

    Parameters
    ----------
    inputs : iterable of BatchInput
    notes : list of str
        Gains a sentence on animations that are left out, or whose outputs have other names.
    allow_outside : bool
        Whether files are read that an input names outside of its folder.

    Raises
    ------
    InvalidInputError
        If no input is of a format whose files may hold several animations.
    """
    listed = list(inputs)
    if not any(supports(one.source, "animation") for one in listed):
        raise InvalidInputError(
            "--animations all has no effect: there is no .glb or .gltf file among the inputs"
        )
    return [each for one in listed for each in _animations_of(one, notes, allow_outside)]


def _animations_of(one: BatchInput, notes: list[str], allow_outside: bool) -> Iterator[BatchInput]:
    if not supports(one.source, "animation"):
        yield one
        return
    try:
        with at_hand(one.source) as files:
            found = animations_of(find_files(files), ReadOptions(allow_outside=allow_outside))
    except MeshReelError:
        found = ()  # encoding says what is wrong with the file
    moving = [animation for animation in found if animation.moves_mesh]
    if len(moving) < 2:
        yield one
        return
    notes += [f"{one.name}: {_why_left_out(each)}" for each in found if not each.moves_mesh]
    stem = one.output.removesuffix(OUTPUT_ENDING)
    for animation, word in zip(moving, _file_words([each.name for each in moving]), strict=True):
        if word != animation.name:
            notes.append(
                f"{one.name}: the animation {animation.name!r} is called {word} in its output"
            )
        yield replace(
            one,
            name=f"{one.name}#{animation.name}",
            output=f"{stem}.{word}{OUTPUT_ENDING}",
            animation=animation.name,
        )


def _why_left_out(animation: AnimationInfo) -> str:
    reason = f"malformed: {animation.problem}" if animation.problem else "it moves no mesh"
    return f"left out the animation {animation.name!r}: {reason}"


def _file_words(names: list[str]) -> list[str]:
    """Parts of file names for animations; no two alike, in upper or lower case."""
    words: list[str] = []
    for name in names:
        plain = re.sub(NOT_PORTABLE, "_", name)[:MAX_NAME].strip("._") or "animation"
        word, number = plain, 0
        while word.lower() in {other.lower() for other in words}:
            number += 1
            word = f"{plain}_{number}"
        words.append(word)
    return words
