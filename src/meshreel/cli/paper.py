"""`meshreel paper`: the paper's evaluation on any sequences."""

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
    from meshreel.cli.reports import check_before_work, named, write_report
    from meshreel.evaluation.choices import checked_names
    from meshreel.evaluation.paper.study import PaperStudy

    chosen = checked_names(named(methods), METHOD_NAMES, "method")
    check_before_work(inputs or [], out)
    options: dict[str, str | None] = {}
    if not inputs:
        options["--frames"] = str(frames)
    if chosen != METHOD_NAMES:
        options["--methods"] = ",".join(chosen)
    if quick:
        options["--quick"] = None
    study = PaperStudy(chosen, quick)
    write_report(study, inputs or [], out, options, flag_frames=frames, as_json=as_json)
