"""The plan of a run: the inputs to encode, to skip and to refuse."""

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from meshreel.app.batch.discovery import OUTPUT_EXTENSION, BatchInput, find_inputs
from meshreel.app.batch.encode_input import EncodeOptions
from meshreel.app.batch.manifest import DONE, FAILED, PENDING, Manifest, Record, read_manifest
from meshreel.app.batch.out_folder import OutFolder, out_folder
from meshreel.errors import InvalidInputError, Keyword, MeshReelError, Message
from meshreel.formats.inspection import animations_of
from meshreel.formats.kinds import AnimationInfo
from meshreel.formats.options import ReadOptions
from meshreel.formats.remote import local_copy
from meshreel.formats.sources import find_files
from meshreel.formats.supported_options import check_supported, supports

NOT_PORTABLE = r"[^\w.+-]+"
"""Characters to replace in output names."""

MAX_NAME = 80
"""Maximum length of the name of an animation in an output name."""


@dataclass(frozen=True)
class Plan:
    """The inputs of a run: up to date, refused, or to be encoded."""

    input_dir: Path | str
    folder: OutFolder
    """The output folder."""
    options: EncodeOptions
    manifest: Manifest
    """Records of earlier runs."""
    up_to_date: list[str]
    """Names of inputs whose streams are up to date."""
    refused: dict[str, Record]
    """Inputs that cannot be encoded, with the reason."""
    to_encode: dict[BatchInput, Record]
    """The other inputs, with pending records."""
    replaced: set[BatchInput]
    """Inputs to encode whose outputs exist."""
    notes: list[str] = field(default_factory=list)
    """Notes on omitted animations, and on outputs with changed names."""

    def options_of(self, batch_input: BatchInput) -> EncodeOptions:
        """The options for an input."""
        reading = replace(self.options.reading, animation=batch_input.animation)
        return replace(self.options, reading=reading)


def plan_batch(
    input_dir: Path | str,
    out_dir: Path | str,
    options: EncodeOptions,
    *,
    force: bool = False,
    all_animations: bool = False,
) -> Plan:
    """Plan a run that encodes inputs that are new, have changed, or failed before.

    An input is up to date if its stream exists with the recorded size, and neither the input files
    nor the options have changed since. Nothing is written.

    Parameters
    ----------
    input_dir, out_dir : Path, or str of a remote folder
        The second need not exist.
    force : bool, default False
        Encode everything, and replace outputs of other programs or inputs.
    all_animations : bool, default False
        Whether each animation of a file is an input, as in `every_animation`; remote files that may
        have several are downloaded.

    Raises
    ------
    InvalidInputError
        If there are no inputs, the output folder belongs to another batch, or an option does not
        apply to any input.
    """
    out_folder(out_dir).check()
    inputs = find_inputs(input_dir, but_not=out_dir)
    check_supported([batch_input.source for batch_input in inputs], options.reading)
    notes: list[str] = []
    if all_animations:
        inputs = every_animation(inputs, notes, allow_outside=options.reading.allow_outside)
    manifest = read_manifest(input_dir, out_dir, force=force)
    plan = Plan(input_dir, manifest.folder, options, manifest, [], {}, {}, set(), notes)
    rivals = _rivals(inputs)
    for batch_input in inputs:
        earlier = manifest.records.get(batch_input.name)
        record = Record(
            PENDING,
            batch_input.output,
            True,
            batch_input.fingerprint(),
            plan.options_of(batch_input).as_dict(),
        )
        folder, is_there = plan.folder, plan.folder.has(batch_input.output)
        if batch_input in rivals:
            plan.refused[batch_input.name] = _refused(record, earlier, rivals[batch_input])
        elif not force and _is_up_to_date(record, earlier, folder):
            plan.up_to_date.append(batch_input.name)
        elif is_there and folder.is_one_of(batch_input.output, batch_input.files):
            plan.refused[batch_input.name] = _refused(
                record, earlier, _is_input(folder.called(batch_input.output))
            )
        elif is_there and not force and not _owns(earlier):
            plan.refused[batch_input.name] = _refused(
                record, earlier, _exists(folder.called(batch_input.output))
            )
        else:
            plan.to_encode[batch_input] = record
            plan.replaced.update([batch_input] if is_there else [])
    return plan


def _refused(record: Record, earlier: Record | None, reason: str) -> Record:
    return Record(
        FAILED, record.output, _owns(earlier), record.fingerprint, record.options, error=reason
    )


def _owns(earlier: Record | None) -> bool:
    return earlier is not None and earlier.owns_output


def _is_up_to_date(record: Record, earlier: Record | None, folder: OutFolder) -> bool:
    if earlier is None or earlier.state != DONE:
        return False
    unchanged = (earlier.output, earlier.fingerprint, earlier.options) == (
        record.output,
        record.fingerprint,
        record.options,
    )
    return unchanged and folder.size_bytes(record.output) == earlier.size_bytes


def _exists(output: str) -> str:
    return Message(
        f"{output} exists and was not made from this input; use ",
        Keyword("force", True),
        " to replace it",
    )


def _is_input(output: str) -> str:
    return f"{output} is the input under another name, which is never replaced; remove the link"


def _rivals(inputs: list[BatchInput]) -> dict[BatchInput, str]:
    """Inputs that share an output, each with the reason to refuse it."""
    of_output = defaultdict(list)
    for batch_input in inputs:
        of_output[batch_input.output].append(batch_input)
    return {
        batch_input: f"{' and '.join(rival.name for rival in group)} would both become {output}; "
        "rename one of them"
        for output, group in of_output.items()
        if len(group) > 1
        for batch_input in group
    }


def every_animation(
    inputs: Iterable[BatchInput], notes: list[str], *, allow_outside: bool
) -> list[BatchInput]:
    """Replace each file with several animations by one input per animation.

    ``man.glb`` with the animations "run" and "jump" becomes ``man.run.reel`` and
    ``man.jump.reel``. Unreadable files are unchanged, and fail when encoded.

    Parameters
    ----------
    notes : list of str
        Receives notes on omitted animations, and on outputs with changed names.
    allow_outside : bool
        Whether to read files that an input refers to outside its folder.

    Raises
    ------
    InvalidInputError
        If no input has a format that supports several animations.
    """
    listed = list(inputs)
    if not any(supports(batch_input.source, "animation") for batch_input in listed):
        raise InvalidInputError(
            Keyword("animations"),
            " all has no effect: there is no .glb or .gltf file among the inputs",
        )
    return [
        part for batch_input in listed for part in _animations_of(batch_input, notes, allow_outside)
    ]


def _animations_of(
    batch_input: BatchInput, notes: list[str], allow_outside: bool
) -> Iterator[BatchInput]:
    if not supports(batch_input.source, "animation"):
        yield batch_input
        return
    try:
        with local_copy(batch_input.source) as files:
            animations = animations_of(find_files(files), ReadOptions(allow_outside=allow_outside))
    except MeshReelError:
        animations = ()  # encoding will report the error
    moving = [animation for animation in animations if animation.moves_mesh]
    if len(moving) < 2:
        yield batch_input
        return
    notes += [
        f"{batch_input.name}: {_why_left_out(animation)}"
        for animation in animations
        if not animation.moves_mesh
    ]
    stem = batch_input.output.removesuffix(OUTPUT_EXTENSION)
    for animation, word in zip(
        moving, _file_words([animation.name for animation in moving]), strict=True
    ):
        if word != animation.name:
            notes.append(
                f"{batch_input.name}: the animation {animation.name!r} is called {word} in its "
                "output"
            )
        yield replace(
            batch_input,
            name=f"{batch_input.name}#{animation.name}",
            output=f"{stem}.{word}{OUTPUT_EXTENSION}",
            animation=animation.name,
        )


def _why_left_out(animation: AnimationInfo) -> str:
    reason = f"malformed: {animation.problem}" if animation.problem else "it moves no mesh"
    return f"left out the animation {animation.name!r}: {reason}"


def _file_words(names: list[str]) -> list[str]:
    """Parts of file names for animations, unique regardless of case."""
    words: list[str] = []
    for name in names:
        plain = re.sub(NOT_PORTABLE, "_", name)[:MAX_NAME].strip("._") or "animation"
        word, number = plain, 0
        while word.lower() in {other.lower() for other in words}:
            number += 1
            word = f"{plain}_{number}"
        words.append(word)
    return words
