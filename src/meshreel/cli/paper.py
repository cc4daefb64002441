"""`meshreel paper`: the paper's evaluation on any sequences."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from meshreel.cli.completing import input_files
from meshreel.evaluation.paper.settings import METHOD_NAMES


def paper_command(
    inputs: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="INPUT...",
            autocompletion=input_files,
            help="Sequences: an .npz or .reel file, a folder or a quoted glob of frames, each. "
            "Default: the embedded flag.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path, typer.Option(help="Folder for results, figures and report; made if missing.")
    ] = Path("report"),
    frames: Annotated[int, typer.Option(help="Frames of the flag, where there is no INPUT.")] = 300,
    methods: Annotated[
        str, typer.Option(metavar="A,B,...", help="Run only these methods.")
    ] = ",".join(METHOD_NAMES),
    quick: Annotated[
        bool, typer.Option("--quick", help="Few points in the rate-distortion plots.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print a summary as JSON.")] = False,
) -> None:
    """Run the variants of the paper, and write its tables and figures as a report.

    Writes report.md, report.html, figures/ and results/ (each result as JSON beside its .reel).
    Results that the folder has already are not computed again. Drawing needs the extra [plot].

    Examples:

    - `meshreel paper --quick --frames 100`

    - `meshreel paper samba.npz jumping.npz --out report`

    - `meshreel paper walk.npz --methods v2v,pca-qp --out walk-report`
    """
    from meshreel.cli.console import print_notes, progress_bar
    from meshreel.cli.reports import print_report
    from meshreel.evaluation.paper.settings import checked_methods
    from meshreel.evaluation.paper.study import reproduce
    from meshreel.flag import simulate_flag
    from meshreel.formats.load import load
    from meshreel.formats.sources import files_of_source
    from meshreel.rendering.plots import require_matplotlib
    from meshreel.runtime.outputs.checks import check_output_folder

    chosen = checked_methods(name.strip() for name in methods.split(","))
    require_matplotlib()
    files = [file for given in inputs or [] for file in files_of_source(given)]
    check_output_folder(out, inputs=files)
    notes: list[str] = []
    with progress_bar() as progress:
        if inputs:
            sequences = [load(source, progress=progress, notes=notes) for source in inputs]
        else:
            sequences = [simulate_flag(frames, progress=progress)]
        command = _command_line(inputs or [], out, frames, chosen, quick)
        made = reproduce(
            sequences, out, methods=chosen, quick=quick, command=command, progress=progress
        )
    print_notes(notes)
    print_report(made, out, notes, as_json=as_json)


def _command_line(
    inputs: list[str], out: Path, frames: int, methods: tuple[str, ...], quick: bool
) -> str:
    """The command that makes the report again."""
    from meshreel.cli.reports import within

    words = ["meshreel", "paper", *map(within, inputs), "--out", within(str(out))]
    if not inputs:
        words += ["--frames", str(frames)]
    if methods != METHOD_NAMES:
        words += ["--methods", ",".join(methods)]
    if quick:
        words.append("--quick")
    return shlex.join(words)
