"""The `meshreel` program: how it starts, and how errors leave it."""

import sys
from typing import Any

import typer

from meshreel import __version__
from meshreel.cli.commands import MARKUP, Group
from meshreel.cli.lines import print_error
from meshreel.errors import MeshReelError

# Base class of all usage errors: from click, or from typer's own copy of it.
CommandLineError: type[Exception] = typer.BadParameter.mro()[2]

app = typer.Typer(
    name="meshreel",
    cls=Group,
    help="Compress and decompress animated triangle meshes of fixed connectivity.",
    invoke_without_command=True,
    rich_markup_mode=MARKUP,
    pretty_exceptions_enable=False,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"meshreel {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    context: typer.Context,
    version: bool = typer.Option(
        False, "--version", callback=_print_version, is_eager=True, help="Print the version."
    ),
) -> None:
    """Compress and decompress animated triangle meshes of fixed connectivity."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def main() -> None:
    """Run the program: exit code 0, or 1 with an error message of one line on stderr."""
    try:
        status = app(prog_name="meshreel", standalone_mode=False)
    except CommandLineError as error:
        _fail(_described(error))
    except MeshReelError as error:
        _fail(str(error))
    except MemoryError:
        _fail("not enough memory; a shorter --block-frames needs less")
    except FileNotFoundError as error:
        _fail(_missing(error.filename) if error.filename else str(error))
    except OSError as error:
        _fail(f"{error.strerror or error}: {error.filename}" if error.filename else str(error))
    except (KeyboardInterrupt, typer.Abort):
        _fail("stopped")
    sys.exit(status if isinstance(status, int) else 0)


def _missing(path: str) -> str:
    """Message for a missing input; the same as that of `find_files`."""
    return f"there is no file or folder {str(path)!r}; check it"


def _described(error: Any) -> str:
    context = getattr(error, "ctx", None)
    command = f"{context.info_name} " if context and context.parent else ""
    return f"{error.format_message()} (meshreel {command}--help shows what is allowed)"


def _fail(message: str) -> None:
    """End with code 1 and one line on stderr."""
    print_error(message)
    sys.exit(1)
