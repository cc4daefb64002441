"""`meshreel paper`: run the paper's evaluation on any sequences."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from meshreel.app.cli.commands import command
from meshreel.app.cli.parameters import Argument, JsonOption
from meshreel.codec.option import COUNT, Option

METHODS = "pca,pca-q,v2v,pca-qs,pca-qp,blocks,gft"
"""Names of `paper.sweeps`, repeated so that the help need not import them."""


@command
def paper_command(
    inputs: Annotated[
        tuple[str, ...],
        Argument(
            "INPUT...",
            "Sequences: .npz or .reel files, or folders or quoted globs of frames. Default: the "
            "simulated flag.",
        ),
    ] = (),
    out: Annotated[
        Path,
        Option("Folder for results, figures and report; created if missing.", flag="--out -o"),
    ] = Path("report"),
    frames: Annotated[int, Option("Number of frames of the flag, without INPUT.")] = 300,
    methods: Annotated[str, Option("Run only these methods.", metavar="A,B,...")] = METHODS,
    preset: Annotated[
        Literal["usual", "printed"],
        Option(
            "Modes and bits in the tables: usual (20 modes, 8 bits, one step for all rows), or "
            "printed (8 modes of 4 bits each, close to the rates that the paper prints for Samba)."
        ),
    ] = "usual",
    modes: Annotated[
        int | None,
        Option("Number of modes per axis in the tables, the paper's k_l.", range=COUNT),
    ] = None,
    block_modes: Annotated[
        int | None,
        Option("Number of modes per axis and block of method `blocks`.", range=COUNT),
    ] = None,
    bits: Annotated[
        int | None, Option("Bits of coefficients in the tables; pca always uses 16.")
    ] = None,
    allocation: Annotated[
        Literal["energy", "constant"] | None,
        Option(
            "How bits are distributed over the rows of the tables: energy (one step for all), or "
            "constant (the same bits in every row). Default: that of the preset."
        ),
    ] = None,
    anchors: Annotated[
        float | None, Option("Fraction of the vertices that are anchors.", metavar="SHARE")
    ] = None,
    choices: Annotated[
        str,
        Option(
            "Choices that the paper leaves open; see `meshreel encode --help`.",
            metavar="NAME=VALUE[,...]",
        ),
    ] = "",
    quick: Annotated[bool, Option("Run few points of the rate-distortion plots.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Run the variants of the paper, and write its tables and figures as a report.

    Writes report.md, figures/ and results/ (each result as JSON and .reel). Existing
    results are not computed again. This needs the extras [paper] and [plot].

    Examples:

    - `meshreel paper --quick --frames 100`
    - `meshreel paper samba.npz jumping.npz --out report`
    - `meshreel paper walk.npz --methods v2v,pca-qp --out walk-report`
    - `meshreel paper samba.npz --preset printed --out printed-report`
    - `meshreel paper walk.npz --bits 6 --allocation constant --methods pca-q,pca-qp`
    - `meshreel paper walk.npz --modes 30 --bits 9 --choices anchor-values=coefficients`
    """
    from meshreel.operations.inputs import check_inputs
    from meshreel.runtime.extras import PAPER, PLOT

    check_inputs(inputs, PAPER, PLOT)  # the modules of the study import SciPy

    from meshreel.app.cli.reports import check_before_work, split_names, write_report
    from meshreel.codec.method_names import our_name
    from meshreel.paper.study.study import PaperStudy
    from meshreel.paper.sweeps import METHOD_NAMES, PRESETS, check_table
    from meshreel.studies.study import checked_names

    method_names = checked_names(map(our_name, split_names(methods)), METHOD_NAMES, "method")
    changes: dict[str, Any] = {
        "modes": modes,
        "block_modes": block_modes,
        "bits": bits,
        "vertex_bits": bits,
        "allocation": allocation,
        "anchors": anchors,
        "choices": choices or None,
    }
    changes = {name: value for name, value in changes.items() if value is not None}
    table = replace(PRESETS[preset], **changes)
    check_table(table, method_names)
    check_before_work(inputs or [], out)
    study = PaperStudy(method_names, quick, table)
    write_report(study, inputs or [], out, flag_frames=frames, as_json=as_json)
