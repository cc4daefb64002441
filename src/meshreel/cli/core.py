"""`meshreel core`: how programs in C and C++ find the library that reads streams."""

from typing import Annotated

import typer


def core_command(
    cflags: Annotated[
        bool, typer.Option("--cflags", help="Print what compilers need: where `meshreel.h` is.")
    ] = False,
    libs: Annotated[
        bool, typer.Option("--libs", help="Print what linkers need: the library of this package.")
    ] = False,
) -> None:
    """Print how to compile and link programs in C or C++ that read .reel files.

    Examples:

    - `cc play.c $(meshreel core --cflags --libs) -o play`
    """
    from meshreel.errors import InvalidInputError
    from meshreel.kernel.linking import compiler_flags, linker_flags

    if not (cflags or libs):
        raise InvalidInputError("nothing was asked for; give --cflags, --libs, or both")
    found = [*(compiler_flags() if cflags else []), *(linker_flags() if libs else [])]
    typer.echo(" ".join(found))
