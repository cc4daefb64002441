"""Inputs of commands, and options for reading them."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from meshreel.app.cli.parameters import Group
from meshreel.codec.option import Option, options_of_fields
from meshreel.formats.options import READING, LoadOptions, Reading
from meshreel.runtime.stores.address import STANDARD_INPUT, is_remote, name_of, without_query

SegmentOption = Annotated[
    int | None,
    Option(
        "One segment of a .reel with several, from 0 (`meshreel info` lists them).",
        metavar="NUMBER",
        group=READING,
    ),
]
SplitOption = Annotated[
    bool,
    Option(
        "If the faces change, write one file per segment: consecutive frames with the same faces.",
        group=READING,
    ),
]

MESHES = ("object", "merge", "skip_bad", "allow_outside", "animation")
"""Options that select meshes of a file, by their names in `Reading`."""

WHOLE_SEQUENCES = (
    "fps", *MESHES, "topology", "dataset", "displace", "keep_deleted", "attributes",
)  # fmt: skip
"""All options of commands that read a sequence to write it."""


_OPTIONS = {option.name: option for option in options_of_fields(LoadOptions)}
"""By name in `Reading`."""
_OPTIONS["topology"] = replace(_OPTIONS["topology"], annotation=Path)

MemoryOption = Annotated[str | None, _OPTIONS["memory"]]

COMMON = ("fps", "object", "merge", "attributes", "memory")
"""Options that `--help` shows."""


def reading(*names: str) -> Group:
    """Options for reading, in the order of the help; a command receives a `Reading`.

    Parameters
    ----------
    *names
        Fields of `Reading`.
    """
    return Group([_OPTIONS[name] for name in names], lambda values: Reading(**values), COMMON)


def source_of(inputs: Sequence[str]) -> "str | list[Path] | list[str]":
    """The single input, or all inputs in natural order."""
    from meshreel.formats.sources import natural_order

    if len(inputs) == 1:
        return inputs[0]
    ordered = natural_order(inputs)
    return ordered if any(map(is_remote, inputs)) else [*map(Path, ordered)]


def output_stem(source: str) -> str:
    """Stem of the default output for an input: that of a file, or the folder of a glob."""
    path = Path(name_of(source)) if is_remote(source) else Path(source).resolve()
    if any(mark in path.name for mark in "*?["):
        return Path(source).resolve().parent.name
    return path.name if path.is_dir() else path.stem


def is_stream_file(source: str) -> bool:
    """Whether a file is a .reel stream, by its extension or its first bytes."""
    from meshreel.codec.bitstream.layout import MAGIC

    path = Path(without_query(source))
    if path.suffix.lower() == ".reel" or source == STANDARD_INPUT:
        return True
    if is_remote(source) or not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def refuse_other_formats(source: Path, remedy: str) -> None:
    """Raise InvalidInputError, with a remedy, for an input of `encode` in place of a stream."""
    from meshreel.errors import InvalidInputError
    from meshreel.formats.registry import FORMATS, extension_of

    is_input = source.is_dir() or (source.is_file() and extension_of(source) in FORMATS)
    if is_input and not is_stream_file(str(source)):
        raise InvalidInputError(f"{source} is not a .reel file; {remedy}")
