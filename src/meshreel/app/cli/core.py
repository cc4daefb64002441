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
    from meshreel.errors import InvalidInputError
    from meshreel.kernel.library import FOLDER, NAME

    flags = []
    if cflags:
        headers = (FOLDER, FOLDER.parents[2] / "core" / "include")  # the latter in a checkout
        folder = next((it for it in headers if (it / "meshreel.h").exists()), None)
        if folder is None:
            raise InvalidInputError(f"meshreel.h is not in {FOLDER}; install meshreel again")
        flags.append(f"-I{folder}")
    if libs and sys.platform == "win32":
        flags.append(str(FOLDER / NAME))
    elif libs:
        library = NAME.removeprefix("lib").split(".")[0]
        flags += [f"-L{FOLDER}", f"-l{library}", f"-Wl,-rpath,{FOLDER}"]
    click.echo(shlex.join(flags))
