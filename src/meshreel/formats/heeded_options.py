"""Which formats heed an option of reading or writing: one that chooses nothing is refused."""

import os
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import get_args

from meshreel.errors import InvalidInputError
from meshreel.formats.kinds import FrameFormat, ReadOption, SequenceFormat, WriteOption
from meshreel.formats.notes import listed
from meshreel.formats.options import ReadOptions, WriteOptions
from meshreel.formats.registry import FORMATS, SEQUENCE_FORMATS


def heeds(path: str | os.PathLike[str], option: ReadOption) -> bool:
    """Whether an option chooses something in a file of this ending."""
    found = FORMATS.get(Path(path).suffix.lower())
    return isinstance(found, SequenceFormat) and option in found.reads


def check_heeded(
    sources: Sequence[str | os.PathLike[str]], *, skip_bad: bool, allow_outside: bool
) -> None:
    """Refuse options that choose nothing in any of several sources.

    Raises
    ------
    InvalidInputError
        Naming the option and the formats that have it.
    """
    asked: dict[ReadOption, bool] = {"skip_bad": skip_bad, "allow_outside": allow_outside}
    for option, is_asked in asked.items():
        if is_asked and not any(heeds(source, option) for source in sources):
            raise InvalidInputError(
                f"{_named(option)} chooses nothing in {listed(map(str, sources))}; "
                f"it is for {_allowed(option)}"
            )


def check_read_options(found: FrameFormat | SequenceFormat, options: ReadOptions) -> None:
    """Refuse options that choose nothing in files of a format.

    Raises
    ------
    InvalidInputError
        Naming the option and the formats that have it.
    """
    heeded = found.reads if isinstance(found, SequenceFormat) else frozenset()
    if options.skip_bad and options.object is not None:
        raise InvalidInputError(
            "--object (object=) takes one mesh, so that --skip-bad (skip_bad=) leaves none out; "
            "give one of the two"
        )
    for option in get_args(ReadOption):
        # A single static mesh is what merging gives, so that a whole folder can be merged.
        is_asked = getattr(options, option) and option != "merge"
        if is_asked and option not in heeded:
            raise InvalidInputError(
                f"{_named(option)} chooses nothing in a {found.ending} file; "
                f"it is for {_allowed(option)}"
            )


def check_write_options(found: FrameFormat | SequenceFormat, options: WriteOptions) -> None:
    """Refuse options that choose nothing when files of a format are written.

    Raises
    ------
    InvalidInputError
        Naming the option and the formats that have it.
    """
    heeded = found.writes if isinstance(found, SequenceFormat) else frozenset()
    for option in (one for one in fields(options) if one.name in get_args(WriteOption)):
        if getattr(options, option.name) != option.default and option.name not in heeded:
            allowed = [one.ending for one in SEQUENCE_FORMATS.values() if option.name in one.writes]
            raise InvalidInputError(
                f"{_named(option.name)} chooses nothing in a {found.ending} file; "
                f"it is for {', '.join(allowed)}"
            )


def _named(option: str) -> str:
    """As people write it, in a command and in Python."""
    return f"--{option.replace('_', '-')} ({option}=)"


def _allowed(option: ReadOption) -> str:
    """The endings of the formats that heed an option."""
    return ", ".join(one.ending for one in SEQUENCE_FORMATS.values() if option in one.reads)
