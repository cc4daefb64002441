"""The `meshreel` program: global options, and error messages with exit codes."""

import sys

import click

from meshreel.app.cli.commands import Program
from meshreel.app.cli.messages import print_error
from meshreel.errors import MeshReelError
from meshreel.runtime.version import __version__

NAME = "meshreel"
HELP_WIDTH = 100
"""Largest width of the help in columns."""


@click.group(
    NAME,
    cls=Program,
    invoke_without_command=True,
    context_settings={"max_content_width": HELP_WIDTH, "help_option_names": ["-h", "--help"]},
)
@click.version_option(
    __version__, "-V", "--version", message=f"{NAME} {__version__}", help="Print the version."
)
@click.pass_context
def app(context: click.Context) -> None:
    """Compress and decompress animated triangle meshes."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


def main() -> None:
    """Run the program; exit with 0, or print a one-line error on stderr and exit with 1, 2 or 130.

    Click's code of usage errors, such as an unknown option, is 2; that of ctrl-C is 130.
    """
    try:
        status = app(prog_name=NAME, standalone_mode=False)
    except click.ClickException as error:
        context = getattr(error, "ctx", None)
        command = f"{context.info_name} " if context and context.parent else ""
        remedy = f"(meshreel {command}--help lists the options)"
        _fail(f"{error.format_message()} {remedy}", error.exit_code)
    except MeshReelError as error:
        _fail(error.message)
    except MemoryError:
        _fail("not enough memory; encode with fewer --block-frames to need less")
    except FileNotFoundError as error:
        # The message is the same as that of `find_files`.
        from meshreel.formats.sources import missing_source

        _fail(missing_source(error.filename) if error.filename else str(error))
    except OSError as error:
        _fail(f"{error.strerror or error}: {error.filename}" if error.filename else str(error))
    except (KeyboardInterrupt, click.Abort):
        _fail("stopped", 130)  # 128 and the number of the signal
    sys.exit(status if isinstance(status, int) else 0)


def _fail(message: str, exit_code: int = 1) -> None:
    """Print one line on stderr, and exit."""
    print_error(message)
    sys.exit(exit_code)
