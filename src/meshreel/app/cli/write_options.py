"""Options for writing files of other formats, and figures of the written files."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import click

from meshreel.app.cli.parameters import File, Group
from meshreel.app.cli.read_options import output_stem
from meshreel.codec.option import Option, options_of_fields
from meshreel.codec.targets import DIAGONAL_OF_ALL
from meshreel.formats.options import WriteOptions
from meshreel.model.rig_bounds import DEFAULT_KG_PERCENT

OutputOption = Annotated[
    File,
    Option(
        "A file for all frames (.abc, .usdc, .glb, .npz, ...: see `meshreel formats`); a pattern "
        "such as out/frame_%04d.obj for one file per frame, in a folder that is created if "
        "missing; or a folder such as walk.vat/ for vertex animation textures.",
        flag="--output -o",
    ),
]
StreamOption = Annotated[
    File | None,
    Option(
        "The .reel to write. Default: named after the input, in the current folder.",
        flag="--output -o",
    ),
]
FramesOption = Annotated[str | None, Option("Only frames A to B - 1. Default: all.", metavar="A:B")]
StartNumberOption = Annotated[
    int | None,
    Option("Number of the first file of a pattern. Default: number of its frame.", metavar="N"),
]
OUTPUT_KG = (
    "Smallest .reel of at most this KG error, relative to the shape's extent. With {rig}: largest "
    f"KG error of the rig. Default: {DEFAULT_KG_PERCENT:g}."
)
"""Help of `--kg` for all outputs."""
OUTPUT_QUALITY = (
    "Visual quality of a .reel. With {rig}: position errors at most those of such a .reel, in "
    "place of {max_error} and {kg}; normals are worse."
)
"""Help of `--quality` for all outputs."""
OUTPUT_ERROR = (
    "Error bound of every vertex in every frame of a .reel. For glTF and .vat: bound of the error "
    f"that morph targets, bones or textures add. 0.1 or 0.1%: percent {DIAGONAL_OF_ALL}; 0.5u: "
    "model units; 0.5mm: a length, see {unit}."
)
"""Help of `--max-error` for all outputs."""


OTHER_OUTPUTS = (
    "`meshreel convert` writes other formats, `meshreel render` pictures and films, "
    "`meshreel export` pages"
)
"""Advice for outputs of `meshreel encode` with other extensions."""

_OPTIONS = {option.name: option for option in options_of_fields(WriteOptions)}
"""By name in `WriteOptions`."""
_OPTIONS["rig"] = replace(_OPTIONS["rig"], annotation=int)

WRITING_DECODED = Group(tuple(_OPTIONS.values()), dict)
"""Options for other formats than `.reel`."""

SHARED_NAMES = ("max_error", "kg", "quality")
WRITING = Group([option for option in _OPTIONS.values() if option.name not in SHARED_NAMES], dict)
"""`WRITING_DECODED` without the options that are also options for encoding."""


def checked_bound(text: str | None, unit: str | None) -> float | str | None:
    """The error bound of `--max-error` with `--unit`, for `WriteOptions`."""
    from meshreel.codec.error_bounds import bound_of

    if text is not None:
        return bound_of(text, unit).plain
    if unit is not None:
        raise click.UsageError("--unit is the unit of a length in --max-error; give both")
    return None


def frame_slice(text: str | None) -> slice | None:
    """The slice of 'A:B', 'A:', ':B' or 'A'."""
    if text is None:
        return None
    first, colon, last = text.partition(":")
    try:
        start = int(first) if first else None
        stop = int(last) if last else None
    except ValueError:
        raise click.UsageError(f"--frames takes A:B with whole numbers; got {text!r}") from None
    if not colon:
        if start is None:
            raise click.UsageError("--frames takes A:B; got nothing")
        return slice(start, start + 1 or None)
    return slice(start, stop)


def stream_output(output: File | None, inputs: Sequence[str]) -> File:
    """The .reel to write, by default named after the first input."""
    from meshreel.runtime.outputs.checks import check_extension

    output = output or File(f"{output_stem(inputs[0])}.reel")
    check_extension(Path(output), (".reel",), OTHER_OUTPUTS)
    return output


def refuse_stream_options(names: Collection[str], output: str) -> None:
    """Reject options of these names on the command line, as they do not apply to the output."""
    context = click.get_current_context()
    for param in context.command.params:
        source = context.get_parameter_source(param.name or "")
        if param.name in names and source is not None and source.name == "COMMANDLINE":
            raise click.UsageError(f"{param.opts[0]} applies to .reel outputs, not to {output}")


def refuse_stream(output: str) -> None:
    """Reject a .reel as an output of decoding; the message names the command that re-encodes."""
    from meshreel.errors import InvalidInputError

    if Path(output).suffix.lower() == ".reel":
        raise InvalidInputError(
            f"{output} would be re-encoded with an additional error; use `meshreel convert`, which "
            "has the options of `meshreel encode` and prints the error"
        )
