"""Inputs of commands, and options for reading them."""

from collections.abc import Callable, Sequence
from functools import wraps
from pathlib import Path
from typing import Any

import click

from meshreel.app.cli.parameters import Decorator, option
from meshreel.runtime.stores.address import is_remote, name_of, without_query

READING = "Input"

memory_option: Decorator = option(
    "--memory",
    metavar="SIZE",
    help="Memory limit for decoding a .reel (its mesh, a block, or the frames needed at once), "
    "such as 500MB or 20GiB; a larger file is rejected before decoding. [default: 8GiB]",
    panel=READING,
)
segment_option: Decorator = option(
    "--segment",
    type=int,
    metavar="NUMBER",
    help="One segment of a .reel with several, from 0 (`meshreel info` lists them).",
    panel=READING,
)
split_option: Decorator = option(
    "--split",
    is_flag=True,
    help="If the faces change, write one file per segment: consecutive frames with the same faces.",
    panel=READING,
)

MESHES = ("object", "merge", "skip_bad", "allow_outside", "animation")
"""Options that select meshes of a file, by their names in `ReadOptions`."""

_OPTIONS = {
    "fps": option(
        "--fps", type=float, help="Frames per second. Default: that of the input.", panel=READING
    ),
    "object": option(
        "--object",
        metavar="PATH",
        help="The mesh to read from a file with several (without this option, the error lists "
        "them).",
        panel=READING,
    ),
    "merge": option(
        "--merge",
        is_flag=True,
        help="Read all meshes of a file as one; they are separated again on output.",
        panel=READING,
    ),
    "skip_bad": option(
        "--skip-bad",
        is_flag=True,
        help="Skip meshes of a file that cannot be read.",
        panel=READING,
    ),
    "allow_outside": option(
        "--allow-outside",
        is_flag=True,
        help="Read referenced files outside the folder of the input: USD layers, glTF buffers, "
        "files of a .pvd or .xdmf.",
        panel=READING,
    ),
    "animation": option(
        "--animation",
        metavar="NAME",
        help="Animation to read from a glTF file with several: its name or its number from 0 "
        "(`meshreel info` lists them). Default: the first that moves a mesh.",
        panel=READING,
    ),
    "memory": memory_option,
    "topology": option(
        "--topology",
        type=Path,
        metavar="MESH",
        help="Mesh file with the faces of a point cache (.pc2, .mdd). Default: the mesh file of "
        "the same name in its folder.",
        panel=READING,
    ),
    "dataset": option(
        "--dataset",
        metavar="NAME",
        help="Dataset with the positions (.h5, .npz). Default: vertices.",
        panel=READING,
    ),
    "register": option(
        "--register",
        metavar="TOLERANCE",
        help="Follow the surface of a raw capture, which has a new mesh in every frame, with few "
        "meshes, up to this distance: 0.2% of the diagonal, or 0.5u in model units (needs "
        "[register]; see `meshreel register`).",
        panel=READING,
    ),
    "attributes": option(
        "--attributes",
        default="all",
        metavar="all|none|NAME,...",
        help="Attributes and groups to read, by name or kind: uv, color, material, ... Polygons "
        "and parts are always read.",
        panel=READING,
    ),
}
"""By name in `ReadOptions`."""


def reading_options(*names: str) -> Decorator:
    """Decorator: add options for reading to a command.

    The command receives them as a `ReadOptions` in its parameter `reading`.

    Parameters
    ----------
    *names
        Fields of `ReadOptions`, in the order of the help.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def with_reading(*context: click.Context, **values: Any) -> None:
            from meshreel.formats.options import ReadOptions

            reading = ReadOptions(**{name: values.pop(name) for name in names})
            function(*context, **values, reading=reading)

        decorated: Callable[..., Any] = with_reading
        for name in reversed(names):
            decorated = _OPTIONS[name](decorated)
        return decorated

    return decorate


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
