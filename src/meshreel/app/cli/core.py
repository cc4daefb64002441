"""`meshreel core`: how programs in C and C++ find the library that decodes files."""

import click

from meshreel.app.cli.commands import command
from meshreel.app.cli.parameters import option


@command
@option("--cflags", is_flag=True, help="Print what compilers need: where `meshreel.h` is.")
@option("--libs", is_flag=True, help="Print what linkers need: the library of this package.")
def core_command(
    cflags: bool,
    libs: bool,
) -> None:
    """Print how to compile and link programs in C or C++ that decode .reel files.

    Examples:

    - `cc play.c $(meshreel core --cflags --libs) -o play`
    """
    from meshreel.errors import InvalidInputError
    from meshreel.kernel.linking import compiler_flags, linker_flags

    if not (cflags or libs):
        raise InvalidInputError("nothing was asked for; give --cflags, --libs, or both")
    found = [*(compiler_flags() if cflags else []), *(linker_flags() if libs else [])]
    click.echo(" ".join(found))
