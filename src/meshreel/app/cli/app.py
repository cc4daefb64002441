"""The `meshreel` program: how it starts, and how errors leave it."""

import sys
from typing import Any

import click
from click.shell_completion import get_completion_class

from meshreel import __version__
from meshreel.app.cli.commands import Program
from meshreel.app.cli.messages import print_error
from meshreel.errors import MeshReelError

NAME = "meshreel"
COMPLETION_VARIABLE = "_MESHREEL_COMPLETE"
SHELLS = ("bash", "zsh", "fish")


def _print_version(context: click.Context, _param: click.Parameter, is_wanted: bool) -> None:
    if is_wanted:
        click.echo(f"{NAME} {__version__}")
        context.exit()


def _print_completion(context: click.Context, _param: click.Parameter, shell: str | None) -> None:
    if shell is not None:
        kind = get_completion_class(shell)
        assert kind is not None  # the choices are Click's own
        click.echo(kind(app, {}, NAME, COMPLETION_VARIABLE).source())
        context.exit()


@click.group(NAME, cls=Program, invoke_without_command=True)
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_print_version,
    help="Print the version.",
)
@click.option(
    "--show-completion",
    type=click.Choice(SHELLS),
    is_eager=True,
    expose_value=False,
    callback=_print_completion,
    help="Print the script by which a shell completes commands, options and files: bash runs it "
    'with `eval "$(meshreel --show-completion bash)"` in ~/.bashrc.',
)
@click.pass_context
def app(context: click.Context) -> None:
    """Compress and decompress animated triangle meshes of fixed connectivity."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


def main() -> None:
    """Run the program: exit code 0, or 1 with an error message of one line on stderr."""
    try:
        status = app(prog_name=NAME, standalone_mode=False)
    except click.ClickException as error:
        _fail(_described(error))
    except MeshReelError as error:
        _fail(str(error))
    except MemoryError:
        _fail("not enough memory; a shorter --block-frames needs less")
    except FileNotFoundError as error:
        _fail(_missing(error.filename) if error.filename else str(error))
    except OSError as error:
        _fail(f"{error.strerror or error}: {error.filename}" if error.filename else str(error))
    except (KeyboardInterrupt, click.Abort):
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
