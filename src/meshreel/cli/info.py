"""`meshreel info`: what a .reel holds and where its bytes go."""

from pathlib import Path
from typing import Annotated

import typer

from meshreel.cli.completing import input_files


def info_command(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.reel", autocompletion=input_files, help="The stream to look at."
        ),
    ],
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False,
) -> None:
    """Show the header of a .reel file and its byte budget by section.

    Example:

    - `meshreel info walk.reel`
    """
    from meshreel.cli.console import print_bars, print_json, print_table
    from meshreel.cli.figures import info_rows
    from meshreel.formats.naming import errors_naming
    from meshreel.formats.reel import open

    with open(source) as reel, errors_naming(source):
        stream = reel.info()
    if as_json:
        print_json(stream.as_dict())
        return
    print_table(str(source), info_rows(stream))
    print_bars("bytes", stream.budget_bytes)
