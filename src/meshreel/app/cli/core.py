"""`meshreel core`: compiler and linker flags for programs that use the C library."""

import shlex
import sys
from typing import Annotated

import click

from meshreel.app.cli.commands import command
from meshreel.codec.option import Option


@command
def core_command(
    cflags: Annotated[bool, Option("Print compiler flags: the folder of `meshreel.h`.")] = False,
    libs: Annotated[bool, Option("Print linker flags: the library of this package.")] = False,
) -> None:
    """Print how to compile and link programs in C or C++ that decode .reel files.

    Examples:

    - `cc play.c $(meshreel core --cflags --libs) -o play`
    """
    if not (cflags or libs):
        raise click.UsageError("give --cflags, --libs, or both")
    click.echo(
        shlex.join([*(_compiler_flags() if cflags else []), *(_linker_flags() if libs else [])])
    )


def _compiler_flags() -> list[str]:
    from meshreel.errors import InvalidInputError
    from meshreel.kernel.library import FOLDER

    for folder in (FOLDER, FOLDER.parents[2] / "core" / "include"):  # the latter in a checkout
        if (folder / "meshreel.h").exists():
            return [f"-I{folder}"]
    raise InvalidInputError(f"meshreel.h is not in {FOLDER}; install meshreel again")


def _linker_flags() -> list[str]:
    from meshreel.kernel.library import FOLDER, NAME

    if sys.platform == "win32":
        return [str(FOLDER / NAME)]
    return [f"-L{FOLDER}", f"-l{NAME.removeprefix('lib').split('.')[0]}", f"-Wl,-rpath,{FOLDER}"]
