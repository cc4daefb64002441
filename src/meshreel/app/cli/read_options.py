"""Inputs of commands, and options for reading them."""

from collections.abc import Callable, Sequence
from functools import wraps
from pathlib import Path
from typing import Any

import click

from meshreel.app.cli.parameters import Decorator, option
from meshreel.runtime.stores.address import is_remote, name_of, without_query

READING = "Input"

memory_option = option(
    "--memory",
    metavar="SIZE",
    help="Of a .reel: the most memory that its mesh, a block, or the frames needed at once may "
    "take, as in 500MB or 20GiB; what needs more is refused before it is decoded. "
    "[default: 8GiB]",
    panel=READING,
)
segment_option = option(
    "--segment",
    type=int,
    metavar="NUMBER",
    help="One segment of a .reel with several, from 0, as `meshreel info` lists them.",
    panel=READING,
)
split_option = option(
    "--split",
    is_flag=True,
    help="If the faces change, write one file per segment: consecutive frames with the same faces.",
    panel=READING,
)

MESHES = ("object", "merge", "skip_bad", "allow_outside", "animation")
"""Options that choose meshes of a file, by their names in `ReadOptions`."""

_OPTIONS = {
    "fps": option(
        "--fps", type=float, help="Frames per second. Default: what the input says.", panel=READING
    ),
    "object": option(
        "--object",
        metavar="PATH",
        help="The one mesh to take of a file that holds several (all are listed if none is "
        "chosen).",
        panel=READING,
    ),
    "merge": option(
        "--merge",
        is_flag=True,
        help="Take all meshes of a file as one; they are separated again on output.",
        panel=READING,
    ),
    "skip_bad": option(
        "--skip-bad",
        is_flag=True,
        help="Leave out meshes of a file that cannot be read, and take the others.",
        panel=READING,
    ),
    "allow_outside": option(
        "--allow-outside",
        is_flag=True,
        help="Read files that a file names outside of its folder: USD layers, glTF buffers, "
        "files of a .pvd or .xdmf.",
        panel=READING,
    ),
    "animation": option(
        "--animation",
        metavar="NAME",
        help="The animation to take of a glTF file that holds several, by its name or its number "
        "from 0 (`meshreel info` lists them). Default: the first that moves a mesh.",
        panel=READING,
    ),
    "memory": memory_option,
    "topology": option(
        "--topology",
        type=Path,
        metavar="MESH",
        help="A mesh file with the faces of a point cache (.pc2, .mdd). Default: the mesh of the "
        "same name in its folder.",
        panel=READING,
    ),
    "dataset": option(
        "--dataset",
        metavar="NAME",
        help="The dataset with the positions (.h5, .npz). Default: vertices.",
        panel=READING,
    ),
    "attributes": option(
        "--attributes",
        default="all",
        metavar="all|none|NAME,...",
        help="Attributes and groups to take, by name or kind: uv, color, material, ... Polygons "
        "and parts are always taken.",
        panel=READING,
    ),
}
"""By the names of the fields of `ReadOptions`."""


def reading_options(*names: str) -> Decorator:
    """A decorator that gives a command options of reading.

    The command gets them as one `ReadOptions`, its parameter `reading`.

    Parameters
    ----------
    *names
        Of fields of `ReadOptions`, in the order of the help.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def with_reading(*context: click.Context, **given: Any) -> None:
            from meshreel.formats.options import ReadOptions

            reading = ReadOptions(**{name: given.pop(name) for name in names})
            function(*context, **given, reading=reading)

        decorated: Callable[..., Any] = with_reading
        for name in reversed(names):
            decorated = _OPTIONS[name](decorated)
        return decorated

    return decorate


def source_of(inputs: Sequence[str]) -> "str | list[Path] | list[str]":
    """The only input, or all of them in natural order."""
    from meshreel.formats.sources import natural_order

    if len(inputs) == 1:
        return inputs[0]
    if not any(map(is_remote, inputs)):
        return natural_order(map(Path, inputs))
    by_path = {Path(given): given for given in inputs}
    return [by_path[path] for path in natural_order(by_path)]


def output_stem(source: str) -> str:
    """The name of the output for an input: the stem of a file, the folder name for a glob."""
    path = Path(name_of(source)) if is_remote(source) else Path(source).resolve()
    if any(mark in path.name for mark in "*?["):
        return Path(source).resolve().parent.name
    return path.name if path.is_dir() else path.stem


def is_stream_file(given: str) -> bool:
    """Whether a file is a .reel stream, by its name or its first bytes."""
    from meshreel.codec.bitstream.layout import MAGIC

    path = Path(without_query(given))
    if path.suffix.lower() == ".reel":
        return True
    if is_remote(given) or not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC
