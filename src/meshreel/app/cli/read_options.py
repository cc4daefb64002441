"""Inputs of commands, and options for reading them."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from meshreel.app.cli.parameters import Group
from meshreel.codec.option import Option, Range
from meshreel.runtime.stores.address import is_remote, name_of, without_query

if TYPE_CHECKING:
    from meshreel.formats.options import ReadOptions

READING = "Input"

MEMORY = Option(
    "Memory limit for decoding a .reel (its mesh, a block, or the frames needed at once), such as "
    "500MB or 20GiB; a larger file is rejected before decoding.",
    default_text="8GiB",
    metavar="SIZE",
    annotation=str,
    group=READING,
)
MemoryOption = Annotated[str | None, MEMORY]
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

MAX_FPS = 1e6
"""A larger rate on the command line is a mistake; files may have any."""

MESHES = ("object", "merge", "skip_bad", "allow_outside", "animation")
"""Options that select meshes of a file, by their names in `ReadOptions`."""

WHOLE_SEQUENCES = (
    "fps", *MESHES, "topology", "dataset", "displace", "resample", "keep_deleted", "attributes",
    "register",
)  # fmt: skip
"""All options of commands that read a sequence to write it."""


def _option(annotation: Any, help: str, metavar: str = "", **settings: Any) -> Option:
    return Option(help, metavar=metavar, annotation=annotation, group=READING, **settings)


_OPTIONS = {
    "fps": _option(
        float,
        "Frames per second, as in 25 or 30000/1001. Default: that of the input.",
        range=Range(0.0, MAX_FPS),
    ),
    "object": _option(
        str,
        "The mesh to read from a file with several (without this option, the error lists them).",
        "PATH",
    ),
    "merge": _option(
        bool,
        "Read all meshes of a file as one; they are separated again on output.",
        default=False,
    ),
    "skip_bad": _option(bool, "Skip meshes of a file that cannot be read.", default=False),
    "allow_outside": _option(
        bool,
        "Read referenced files outside the folder of the input: USD layers, glTF buffers, files of "
        "a .pvd or .xdmf.",
        default=False,
    ),
    "animation": _option(
        str,
        "Animation to read from a glTF file with several: its name or its number from 0 (`meshreel "
        "info` lists them). Default: the first that moves a mesh.",
        "NAME",
    ),
    "displace": _option(
        str,
        "Move the vertices by a result of three numbers per vertex, such as displacement of a "
        "simulation; a factor enlarges it. The result itself is not kept.",
        "NAME[:FACTOR]",
    ),
    "resample": _option(
        float,
        "Interpolate new frames at this rate, evenly spaced. Default: frames stay at their times.",
        "RATE",
        range=Range(0.0, MAX_FPS, is_open=True),
    ),
    "keep_deleted": _option(
        bool,
        "Keep elements that a simulation deletes in the mesh, with a track alive, 1 while they "
        "exist. Default: the mesh changes when elements are deleted.",
        default=False,
    ),
    "memory": MEMORY,
    "topology": _option(
        Path,
        "Mesh file with the faces of a point cache (.pc2, .mdd). Default: the mesh file of the "
        "same name in its folder.",
        "MESH",
    ),
    "dataset": _option(str, "Dataset with the positions (.h5, .npz). Default: vertices.", "NAME"),
    "register": _option(
        str,
        "Follow the surface of a raw capture, which has a new mesh in every frame, with few "
        "meshes, up to this distance: 0.2% of the diagonal, or 0.5u in model units (needs "
        "[register]; see `meshreel register`).",
        "TOLERANCE",
    ),
    "attributes": _option(
        str,
        "Attributes and groups to read, by name or kind: uv, color, material, ... Polygons and "
        "parts are always read.",
        "all|none|NAME,...",
        default="all",
    ),
}
"""By name in `ReadOptions`."""


COMMON = ("fps", "object", "merge", "attributes", "memory")
"""Options that `--help` shows."""


def reading(*names: str) -> Group:
    """Options for reading, in the order of the help; a command receives a `ReadOptions`.

    Parameters
    ----------
    *names
        Fields of `ReadOptions`.
    """
    options = [
        replace(_OPTIONS[name], name=name, flag=f"--{name.replace('_', '-')}") for name in names
    ]
    return Group(options, _read_options, COMMON)


def _read_options(values: dict[str, Any]) -> "ReadOptions":
    from meshreel.formats.options import ReadOptions

    return ReadOptions(**values)


def source_of(inputs: Sequence[str]) -> "str | list[Path] | list[str]":
    """The single input, or all inputs in natural order."""
    from meshreel.formats.sources import natural_order

    if len(inputs) == 1:
        return inputs[0]
    if not any(map(is_remote, inputs)):
        return natural_order(map(Path, inputs))
    by_path = {Path(address): address for address in inputs}
    return [by_path[path] for path in natural_order(by_path)]


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
    if path.suffix.lower() == ".reel":
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
