"""`meshreel paper`: the paper's evaluation on any sequences."""

from pathlib import Path
from typing import Any

from meshreel.app.cli.commands import command
from meshreel.app.cli.completing import input_files, names_of
from meshreel.app.cli.parameters import argument, option
from meshreel.codec.option import COUNT

METHODS = "pca,pca-q,v2v,pca-qs,pca-qp,blocks,gft"
PRESET_NAMES = ("usual", "printed")
"""Of `evaluation.paper.settings`, written out: help comes without importing the evaluation."""


@command
@argument(
    "inputs",
    nargs=-1,
    required=False,
    metavar="INPUT...",
    completion=input_files,
    help="Sequences: an .npz or .reel file, a folder or a quoted glob of frames, each. "
    "Default: the embedded flag.",
)
@option(
    "--out",
    type=Path,
    default=Path("report"),
    help="Folder for results, figures and report; made if missing.",
)
@option("--frames", type=int, default=300, help="Frames of the flag, where there is no INPUT.")
@option("--methods", default=METHODS, metavar="A,B,...", help="Run only these methods.")
@option(
    "--preset",
    default=PRESET_NAMES[0],
    help="Modes and bits of the tables: usual (20 modes of 8 bits), or printed (8 of 4, "
    "close to the rates that the paper prints for Samba).",
    completion=names_of(PRESET_NAMES),
)
@option(
    "--modes",
    type=int,
    range=COUNT,
    help="Modes of each axis in the tables, the paper's k_l.",
)
@option(
    "--block-modes",
    type=int,
    range=COUNT,
    help="The same of each block of `blocks`.",
)
@option("--bits", type=int, help="Bits of quantized coefficients in the tables; pca keeps 16.")
@option("--anchors", type=float, metavar="SHARE", help="Share of the vertices that are anchors.")
@option(
    "--choices",
    default="",
    metavar="NAME=VALUE[,...]",
    help="What the paper leaves open, as `encode --choices` takes it.",
)
@option("--quick", is_flag=True, help="Few points in the rate-distortion plots.")
@option("as_json", "--json", is_flag=True, help="Print a summary as JSON.")
def paper_command(
    inputs: tuple[str, ...],
    out: Path,
    frames: int,
    methods: str,
    preset: str,
    modes: int | None,
    block_modes: int | None,
    bits: int | None,
    anchors: float | None,
    choices: str,
    quick: bool,
    as_json: bool,
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
    from dataclasses import replace

    from meshreel.app.cli.reports import check_before_work, named, write_report
    from meshreel.evaluation.choices import checked_names
    from meshreel.paper.study.study import PaperStudy
    from meshreel.paper.sweeps import METHOD_NAMES, PRESETS, check_table

    chosen = checked_names(named(methods), METHOD_NAMES, "method")
    (preset,) = checked_names([preset], PRESET_NAMES, "preset")
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
