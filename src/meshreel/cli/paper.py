"""`meshreel paper`: the paper's evaluation on any sequences."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from meshreel.cli.completing import input_files, names_of
from meshreel.evaluation.paper.settings import METHOD_NAMES, PRESETS


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
    preset: Annotated[
        str,
        typer.Option(
            help="Modes and bits of the tables: usual (20 modes of 8 bits), or printed (8 of 4, "
            "close to the rates that the paper prints for Samba).",
            autocompletion=names_of(tuple(PRESETS)),
        ),
    ] = "usual",
    modes: Annotated[
        int | None, typer.Option(help="Modes of each axis in the tables, the paper's k_l.", min=1)
    ] = None,
    block_modes: Annotated[
        int | None, typer.Option(help="The same of each block of `blocks`.", min=1)
    ] = None,
    bits: Annotated[
        int | None,
        typer.Option(help="Bits of quantized coefficients in the tables; pca keeps 16."),
    ] = None,
    anchors: Annotated[
        float | None, typer.Option(metavar="SHARE", help="Share of the vertices that are anchors.")
    ] = None,
    choices: Annotated[
        str,
        typer.Option(
            metavar="NAME=VALUE[,...]",
            help="What the paper leaves open, as `encode --choices` takes it.",
        ),
    ] = "",
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

    - `meshreel paper samba.npz --preset printed --out printed-report`

    - `meshreel paper walk.npz --modes 30 --bits 9 --choices anchor-values=coefficients`
    """
    from meshreel.cli.reports import check_before_work, named, write_report
    from meshreel.evaluation.choices import checked_names
    from meshreel.evaluation.paper.settings import check_table
    from meshreel.evaluation.paper.study import PaperStudy

    chosen = checked_names(named(methods), METHOD_NAMES, "method")
    (preset,) = checked_names([preset], tuple(PRESETS), "preset")
    given = {"--modes": modes, "--block-modes": block_modes, "--bits": bits, "--anchors": anchors}
    changes: dict[str, Any] = {
        flag.removeprefix("--").replace("-", "_"): value
        for flag, value in given.items()
        if value is not None
    }
    if bits is not None:
        changes["vertex_bits"] = bits
    if choices:
        changes["choices"] = choices
    table = replace(PRESETS[preset], **changes)
    check_table(table, chosen)
    check_before_work(inputs or [], out)
    options: dict[str, str | None] = {}
    if not inputs:
        options["--frames"] = str(frames)
    if chosen != METHOD_NAMES:
        options["--methods"] = ",".join(chosen)
    if quick:
        options["--quick"] = None
    if preset != "usual":
        options["--preset"] = preset
    options |= {flag: str(value) for flag, value in given.items() if value is not None}
    if choices:
        options["--choices"] = choices
    study = PaperStudy(chosen, quick, table)
    write_report(study, inputs or [], out, options, flag_frames=frames, as_json=as_json)
