"""Options that several commands share, derived from fields, and the values of their texts."""

import shlex
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import click

from meshreel.app.cli.parameters import File, Group
from meshreel.codec.error_bounds import bound_of
from meshreel.codec.option import Option, options_of_fields
from meshreel.codec.options import option_named
from meshreel.codec.reel_options import ReelOptions
from meshreel.codec.targets import DIAGONAL_OF_ALL
from meshreel.errors import InvalidInputError
from meshreel.formats.options import BOUNDS, READING, LoadOptions, Reading, WriteOptions
from meshreel.model.rig_bounds import DEFAULT_KG_PERCENT
from meshreel.registration.options import RegisterOptions
from meshreel.rendering.looks import Look, TrackLook
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


_READING = {option.name: option for option in options_of_fields(LoadOptions)}
"""By name in `Reading`."""
_READING["topology"] = replace(_READING["topology"], annotation=Path)

MemoryOption = Annotated[str | None, _READING["memory"]]

_COMMON_READING = ("fps", "object", "merge", "attributes", "memory")
"""Options that `--help` shows."""


def reading(*names: str) -> Group:
    """Options for reading, in the order of the help; a command receives a `Reading`.

    Parameters
    ----------
    *names
        Fields of `Reading`.
    """
    return Group(
        [_READING[name] for name in names], lambda values: Reading(**values), _COMMON_READING
    )


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
    """Whether a file contains a .reel stream, by its extension or its first bytes."""
    from meshreel.codec.bitstream.layout import MAGIC
    from meshreel.formats.registry import STREAMS

    path = Path(without_query(source))
    if path.suffix.lower() in STREAMS or source == STANDARD_INPUT:
        return True
    if is_remote(source) or not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def refuse_other_formats(source: str, more: str = "") -> None:
    """Raise InvalidInputError, with remedies, for an input of `encode` in place of a stream."""
    from meshreel.formats.registry import FORMATS, extension_of

    path, output = Path(source), shlex.quote(f"{output_stem(source)}.reel")
    is_input = path.is_dir() or (path.is_file() and extension_of(path) in FORMATS)
    if is_input and not is_stream_file(source):
        command = f"meshreel encode {shlex.quote(source)} -o {output}"
        raise InvalidInputError(f"{source} is not a .reel file; encode it first: {command}{more}")


_COMMON_ENCODING = ("quality", "bound", "max_error", "size", "lossless", "order", "effort")
"""Options that `--help` shows."""

MAX_PERCENT = 100
"""A larger error bound on the command line is a mistake; in Python any is allowed."""

Encoding = dict[str, Any]
"""Values of the options for encoding, by name."""


ENCODING_OPTIONS = tuple(
    option for option in options_of_fields(ReelOptions) if option.name != "step"
)
"""Those of the paper's methods are for Python and `meshreel paper`, and a step is for Python."""


def _checked(values: Encoding) -> Encoding:
    for name in ("bound", "max_error"):
        try:
            percent = float((values[name] or "").removesuffix("%"))
        except ValueError:  # none, or of another unit
            continue
        if percent > MAX_PERCENT:
            raise click.UsageError(
                f"--{name.replace('_', '-')} must be at most {MAX_PERCENT}%, the size of the "
                f"model; got {values[name]}; 0.1% is invisible on most models, 1% visible; 5u is "
                "5 model units"
            )
    return values


def encoding(**other_help: str) -> Group:
    """All options for encoding.

    Parameters
    ----------
    **other_help
        Help of options with another meaning in a command, by name.
    """
    params = [
        replace(option, help=other_help.get(option.name, option.help))
        for option in ENCODING_OPTIONS
    ]
    return Group(params, _checked, _COMMON_ENCODING)


ENCODING = encoding()


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

_WRITING = {option.name: option for option in options_of_fields(WriteOptions)}
"""By name in `WriteOptions`."""
_WRITING["rig"] = replace(_WRITING["rig"], annotation=int)

SHARED_NAMES = ("max_error", "kg", "quality", "images", "max_image")
WRITING = Group([option for option in _WRITING.values() if option.name not in SHARED_NAMES], dict)
"""Options for other formats than `.reel`, without those that are also options for encoding."""


def _write_options(values: dict[str, Any]) -> WriteOptions:
    values["max_error"] = checked_bound(values["max_error"], values.pop("unit"))
    return WriteOptions(**values)


_UNIT = replace(option_named("unit"), group=BOUNDS)
WritingOption = Annotated[WriteOptions, Group((*_WRITING.values(), _UNIT), _write_options)]
"""All options for other formats than `.reel`."""


def checked_bound(text: str | None, unit: str | None) -> float | str | None:
    """The error bound of `--max-error` with `--unit`, for `WriteOptions`."""
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


def stream_output(
    output: File | None,
    inputs: Sequence[str],
    extension: str = ".reel",
    advice: str = OTHER_OUTPUTS,
) -> File:
    """The file to write, by default named after the first input."""
    from meshreel.runtime.outputs.checks import check_extension

    output = output or File(f"{output_stem(inputs[0])}{extension}")
    check_extension(Path(output), (extension,), advice)
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
    if Path(output).suffix.lower() == ".reel":
        raise InvalidInputError(
            f"{output} would be re-encoded with an additional error; use `meshreel convert`, which "
            "has the options of `meshreel encode` and prints the error"
        )


TrackOption = Annotated[
    tuple[str, ...],
    Option(
        "Error bound of a track, once per track: stress=0.1% (of its range), stress=500Pa or =500 "
        "(in its unit), stress=1kPa, normal=0.5deg, color=8bit, id=exact, velocity=drop. Default: "
        "integers exact; others that of --bound; at --quality 80, and for --size, colors 8bit, "
        "velocities 1%, normals 1deg, others 0.2%; else colors 8bit, normals 0.5deg, others 0.1%.",
        metavar="NAME=BOUND",
        group="Tracks",
    ),
]


def track_targets(texts: Sequence[str] | None) -> dict[str, float | str] | None:
    """Error bounds by track name, from texts such as stress=0.1%.

    Raises
    ------
    click.UsageError
        If a text has no name, no bound or several, or a name is repeated.
    """
    if not texts:
        return None
    targets: dict[str, float | str] = {}
    for text in texts:
        name, equals, bound = text.partition("=")
        if not (name and equals and bound):
            raise click.UsageError(
                f"--track takes a name and a bound, as in stress=0.1%; got {text!r}"
            )
        if "=" in bound:
            raise click.UsageError(
                f"--track takes one name and bound; got {text!r}; repeat it for each track"
            )
        if name in targets:
            raise click.UsageError(f"--track names {name!r} twice; give it once")
        targets[name] = bound
    return targets


_REGISTERING = {option.name: option for option in options_of_fields(RegisterOptions)}
_OUTPUT = replace(
    _REGISTERING["texture_output"],
    annotation=Path,
    help=f"{_REGISTERING['texture_output'].help} Default: the output, a .mp4.",
)
_KEEPING = _REGISTERING["keep_holes"], _REGISTERING["keep_debris"]
_BAKING = *(_REGISTERING[name] for name in ("texture", "sound")), _OUTPUT
_WORKERS = _REGISTERING["workers"], _REGISTERING["scheduler"]
REGISTERING = Group((_REGISTERING["tolerance"], *_BAKING, *_KEEPING, *_WORKERS), dict)
"""Options of `meshreel register`."""

_REGISTER = replace(
    _REGISTERING["tolerance"],
    name="register",
    flag="--register",
    default=None,
    help="Follow the surface of a raw capture, which has a new mesh in every frame, with few "
    "meshes, up to this distance: 0.2% of the diagonal, or 0.5u in model units (needs [register]; "
    "see `meshreel register`).",
    group=_KEEPING[0].group,
    metavar="TOLERANCE",
)


def _registering(values: dict[str, Any]) -> RegisterOptions | None:
    tolerance, kept = values["register"], {option.name: values[option.name] for option in _KEEPING}
    if tolerance is None:
        if any(kept.values()):
            raise click.UsageError(
                "--keep-holes and --keep-debris are for captures; add --register"
            )
        return None
    return RegisterOptions(tolerance=bound_of(tolerance, option="register").plain, **kept)


RegisteringOption = Annotated[
    RegisterOptions | None, Group((_REGISTER, *_KEEPING), _registering, ())
]
"""Options of commands that can register their input before they write it."""


_NAME, *_OF_TRACK = options_of_fields(TrackLook)
_TRACK = replace(_NAME, name="track", default=None), *_OF_TRACK


def _track_look(values: dict[str, Any]) -> TrackLook | None:
    """Take the options of a track from values; None without a track."""
    name, *others = (values.pop(option.name) for option in _TRACK)
    if name is not None:
        return TrackLook(name, *others)
    for option, value in zip(_OF_TRACK, others, strict=True):
        if value is not None:
            raise click.UsageError(f"{option.flag} applies to a track; name it with --track")
    return None


TrackLookOption = Annotated[TrackLook | None, Group(_TRACK, _track_look)]
LookOption = Annotated[
    Look,
    Group(
        (*options_of_fields(Look), *_TRACK),
        lambda values: Look(track=_track_look(values), **values),
    ),
]


def frame_list(text: str | None) -> slice | tuple[int, ...] | None:
    """The frames of 'A:B' or 'N,N,...', where -1 is the last; None for all."""
    if text is None or ":" in text:
        return frame_slice(text)
    try:
        return tuple(map(int, text.split(",")))
    except ValueError:
        raise click.UsageError(
            f"--frames takes A:B or a list such as 0,10,20 with whole numbers; got {text!r}"
        ) from None
