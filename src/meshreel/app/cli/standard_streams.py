"""Standard input and standard output as files of a command, both named ``-``.

Readers and writers need paths: standard input is copied to a temporary file, and standard output
receives the complete output from one.
"""

import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory

import click

from meshreel.app.cli.messages import TEMPORARY_FOLDERS
from meshreel.codec.option import Option

STREAM_OPTIONS = {
    "encode": ("from",),
    "decode": ("to",),
    "convert": ("from", "to"),
    "info": ("from",),
    "compare": ("from",),
}
"""Commands that accept ``-``, and their options for its format, which is .reel without one."""

OPTIONS = {
    "from": Option(
        "Format of standard input (-), such as obj. Default: identified by its first bytes.",
        name="from", flag="--from", annotation=str, metavar="FORMAT", group="Input",
    ),
    "to": Option(
        "Format of standard output (-o -), such as glb.",
        name="to", flag="--to", annotation=str, metavar="FORMAT",
    ),
}  # fmt: skip

NO_EFFECT = {
    "force": "--force replaces files",
    "as_json": "--json prints on standard output",
    "split": "--split writes several files",
}
"""Why options cannot be combined with ``-o -``, by parameter."""


def refuse_standard_streams(ctx: click.Context, args: list[str]) -> None:
    """Raise UsageError for ``-`` among the arguments of a command that does not accept it."""
    if "-" in args:
        raise click.UsageError(
            f"`meshreel {ctx.info_name}` needs files; - (standard input or output) is accepted by "
            f"{', '.join(STREAM_OPTIONS)}, and a file of this name is ./-",
            ctx,
        )


@contextmanager
def standard_streams(ctx: click.Context) -> Iterator[None]:
    """Context manager that replaces ``-`` among the parameters of a command by temporary files.

    On success the output is copied to standard output; until then stdout is redirected to stderr.

    Raises
    ------
    UsageError
        If other parameters or a terminal exclude ``-``, or its format is unknown.
    InvalidInputError
        If standard input is empty, or the output has several files.
    """
    values = ctx.params
    arguments = [one.name or "" for one in ctx.command.params if isinstance(one, click.Argument)]
    reads, writes = _reads(ctx, arguments), values.get("output") == "-"
    formats = {name: values.pop(name) for name in OPTIONS if name in values}
    for name, used, file in (("from", reads, "input (-)"), ("to", writes, "output (-o -)")):
        if formats.get(name) is not None and not used:
            raise click.UsageError(f"--{name} is the format of standard {file}; omit it", ctx)
    if reads and "output" in values and values["output"] is None:
        raise click.UsageError("standard input has no name; name the output with -o", ctx)
    if not (reads or writes):
        yield
        return
    with TemporaryDirectory(prefix="meshreel-", ignore_cleanup_errors=True) as place:
        folder = Path(place).resolve()
        TEMPORARY_FOLDERS.add(f"{folder}{os.sep}")
        if writes:  # checked first, because reading the input may take long
            values["output"] = str(_output_path(ctx, folder, formats.get("to", "reel")))
        if reads:
            path = str(_copy_input(ctx, folder, formats.get("from", "reel")))
            for name in arguments:
                files = {"-": path, ("-",): (path,)}
                values[name] = files.get(values[name], values[name])
        with redirect_stdout(sys.stderr if writes else sys.stdout):
            yield
        if writes:
            _copy_output(Path(values["output"]))


def _reads(ctx: click.Context, arguments: list[str]) -> bool:
    """Whether an argument is standard input; raises UsageError unless only one is."""
    values = [ctx.params[name] for name in arguments]
    lists = [(value,) if isinstance(value, str) else value for value in values]
    n_reads = sum(words.count("-") for words in lists)
    if n_reads > 1 or any("-" in words and len(words) > 1 for words in lists):
        raise click.UsageError(
            "standard input (-) is one file, which cannot be repeated or be one of several frames; "
            "standard output is -o -",
            ctx,
        )
    return n_reads == 1


def _output_path(ctx: click.Context, folder: Path, extension: str | None) -> Path:
    """Path of the file for standard output, which must not be a terminal."""
    from meshreel.formats.outputs import check_output

    for name, reason in NO_EFFECT.items():
        if ctx.params.get(name):
            raise click.UsageError(f"{reason}, so it cannot be combined with -o -; omit one", ctx)
    if sys.stdout is None or sys.stdout.isatty():
        raise click.UsageError(
            "standard output is a terminal; redirect it to a file (> FILE) or pipe it", ctx
        )
    if extension is None:
        raise click.UsageError("the format of standard output is unknown; give it with --to", ctx)
    path = folder / f"stdout.{extension.lstrip('.')}"
    _check_single(path, check_output(path, overwrite=False))
    return path


def _check_single(path: Path, files: list[Path]) -> None:
    from meshreel.errors import InvalidInputError

    if others := sorted(file.name for file in files if file != path):
        raise InvalidInputError(
            f"a {path.suffix} output would have further files ({', '.join(others)}), and standard "
            f"output is one file; use -o NAME{path.suffix}, or another format"
        )


def _copy_input(ctx: click.Context, folder: Path, extension: str | None) -> Path:
    """Copy standard input to a file whose extension is its format."""
    from meshreel.errors import InvalidInputError
    from meshreel.formats.registry import SIGNATURE_BYTES, extension_of_bytes

    if sys.stdin is None or sys.stdin.isatty():
        raise click.UsageError("standard input is a terminal; pipe or redirect a file into it", ctx)
    path = folder / "stdin"
    with path.open("wb+") as file:
        shutil.copyfileobj(sys.stdin.buffer, file)
        file.seek(0)
        head = file.read(SIGNATURE_BYTES)
    if not head:
        raise InvalidInputError("standard input is empty; pipe or redirect a file into it")
    extension = extension_of_bytes(head) if extension is None else extension
    if extension is None:
        raise click.UsageError(
            f"the first bytes of standard input, {head[:12]!r}, do not identify its format; give "
            "it with --from, such as --from obj",
            ctx,
        )
    return path.rename(folder / f"stdin.{extension.lstrip('.')}")


def _copy_output(path: Path) -> None:
    """Copy the written file to standard output."""
    written = [one for one in path.parent.iterdir() if one.stem != "stdin"]
    _check_single(path, written)  # images may have been stored separately
    with path.open("rb") as file:
        shutil.copyfileobj(file, sys.stdout.buffer)
    sys.stdout.buffer.flush()
