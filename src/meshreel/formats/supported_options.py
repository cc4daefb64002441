"""Checks that the read and write options have an effect for a format."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import fields, replace
from typing import get_args

from meshreel.codec.image_options import check_images
from meshreel.errors import InvalidInputError, Keyword
from meshreel.formats.kinds import (
    FolderFormat,
    FrameFormat,
    ReadOption,
    SequenceFormat,
    WriteOption,
)
from meshreel.formats.options import Reading, WriteOptions
from meshreel.formats.registry import FOLDER_FORMATS, FORMATS, extension_of
from meshreel.model.notes import listed


def supports(source: object, option: ReadOption) -> bool:
    """Whether a read option has an effect on a source, judging by the extension of its path."""
    if not isinstance(source, str | os.PathLike):
        return False
    file_format = FORMATS.get(extension_of(source))
    return file_format is not None and option in file_format.options


def check_supported(sources: Sequence[object], reading: Reading) -> None:
    """Raise an error for options that have no effect on any of the sources.

    Raises
    ------
    InvalidInputError
        If there is one; the message names it and the formats that support it.
    """
    requested: dict[ReadOption, bool] = {
        "skip_bad": reading.skip_bad,
        "allow_outside": reading.allow_outside,
        "animation": reading.animation is not None,
    }
    for option, is_requested in requested.items():
        if is_requested and not any(supports(source, option) for source in sources):
            raise _no_effect(option, listed(map(str, sources)))


def supported_only(reading: Reading, source: str | os.PathLike[str]) -> Reading:
    """Return the options without those that have no effect on the source."""
    return replace(
        reading,
        object=reading.object if supports(source, "object") else None,
        skip_bad=reading.skip_bad and supports(source, "skip_bad"),
        allow_outside=reading.allow_outside and supports(source, "allow_outside"),
        animation=reading.animation if supports(source, "animation") else None,
    )


def check_read_options(file_format: FrameFormat | SequenceFormat, reading: Reading) -> None:
    """Raise an error for read options that have no effect on a format.

    Raises
    ------
    InvalidInputError
        If there is one; the message names it and the formats that support it.
    """
    if reading.skip_bad and reading.object is not None:
        raise InvalidInputError(
            Keyword("object"),
            " selects one mesh, so ",
            Keyword("skip_bad"),
            " has no effect; use only one of them",
        )
    # Merging a single static mesh changes nothing; allowing it lets batches merge whole folders.
    requested = [arg for arg in get_args(ReadOption) if getattr(reading, arg) and arg != "merge"]
    is_number_0 = reading.animation == 0  # falsy, but a valid choice
    _check(file_format, [*requested, "animation"] if is_number_0 else requested)


def check_write_options(
    file_format: FrameFormat | SequenceFormat | FolderFormat, options: WriteOptions
) -> None:
    """Raise an error for write options that have no effect on a format.

    Raises
    ------
    InvalidInputError
        If there is one; the message names it and the formats that support it. Also if those of
        images are invalid, or need Pillow.
    """
    check_images(options.images, options.max_image)
    choices = [field for field in fields(options) if field.name in get_args(WriteOption)]
    _check(
        file_format,
        [choice.name for choice in choices if getattr(options, choice.name) != choice.default],
    )


def _check(
    file_format: FrameFormat | SequenceFormat | FolderFormat, requested: Iterable[str]
) -> None:
    for option in requested:
        if option not in file_format.options:
            kind = "folder" if isinstance(file_format, FolderFormat) else "file"
            raise _no_effect(option, f"a {file_format.extension} {kind}")


def _no_effect(option: str, inputs: str) -> InvalidInputError:
    """Error for an option that a format does not support."""
    formats = (*FORMATS.values(), *FOLDER_FORMATS.values())
    allowed = [entry.extension for entry in formats if option in entry.options]
    return InvalidInputError(
        Keyword(option), f" has no effect on {inputs}; it is for {', '.join(allowed)}"
    )
