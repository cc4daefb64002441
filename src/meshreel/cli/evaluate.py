"""`meshreel evaluate`: our methods beside other codecs, on any sequences."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from meshreel.cli.completing import input_files
from meshreel.evaluation.codecs.peers.registry import NONE, PEER_NAMES
from meshreel.evaluation.codecs.settings import CODED_METHODS, DEFAULT_METHODS


def evaluate_command(
    inputs: Annotated[
        list[str],
        typer.Argument(
            metavar="INPUT",
            autocompletion=input_files,
            help="Sequences: an .npz or .reel file, a folder or a quoted glob of frames, each.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path, typer.Option(help="Folder for results, plots and report; made if missing.")
    ] = Path("evaluation"),
    methods: Annotated[
        str,
        typer.Option(metavar="A,B,...", help=f"Our methods, of {', '.join(CODED_METHODS)}."),
    ] = ",".join(DEFAULT_METHODS),
    peers: Annotated[
        str,
        typer.Option(metavar="A,B,...", help=f"Other codecs; '{NONE}' for none of them."),
    ] = ",".join(PEER_NAMES),
    reference: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.csv",
            help="Points measured elsewhere; its rows of the same name, vertices and frames are "
            "added. Columns: sequence, n, k, m, codec, params, bytes_total, bytes_connectivity, "
            "bpvf_total, kg_error_percent, max_err_over_diag, enc_s, dec_s, rms_err_over_diag.",
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Few settings of each codec.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print all figures as JSON.")] = False,
) -> None:
    """Rate, distortion and seconds of our methods beside other codecs, on your data.

    Writes report.md, report.html, figures/ and results/ (each run as JSON). Runs that the folder
    has already are not done again. Codecs come with the extras [peers] and [meshopt]; those that
    are missing are named in the report. Drawing needs the extra [plot].

    Examples:

    - `meshreel evaluate walk.npz --quick`

    - `meshreel evaluate samba.npz cow.npz --out codecs --reference recorded.csv`

    - `meshreel evaluate walk.npz --methods pca-qp --peers draco,sz3`

    - `meshreel evaluate walk.npz --peers none --json`
    """
    from meshreel.cli.console import print_notes, progress_bar
    from meshreel.cli.reports import print_report
    from meshreel.evaluation.codecs.peers.registry import checked_peers
    from meshreel.evaluation.codecs.recorded import read_recorded
    from meshreel.evaluation.codecs.settings import checked_coded_methods
    from meshreel.evaluation.codecs.study import evaluate
    from meshreel.formats.load import load
    from meshreel.formats.sources import files_of_source
    from meshreel.rendering.plots import require_matplotlib
    from meshreel.runtime.outputs.checks import check_output_folder

    chosen = checked_coded_methods(_names(methods))
    others = checked_peers(_names(peers))
    require_matplotlib()
    files = [file for given in inputs for file in files_of_source(given)]
    check_output_folder(out, inputs=[*files, *([reference] if reference else [])])
    recorded = read_recorded(reference) if reference else []
    notes: list[str] = []
    with progress_bar() as progress:
        sequences = [load(source, progress=progress, notes=notes) for source in inputs]
        made = evaluate(
            sequences, out,
            methods=chosen, peers=others, recorded=recorded, quick=quick,
            command=_command_line(inputs, out, methods, peers, reference, quick),
            progress=progress,
        )  # fmt: skip
    print_notes([*notes, *made.notes])
    print_report(made, out, notes, as_json=as_json)


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _command_line(
    inputs: list[str], out: Path, methods: str, peers: str, reference: Path | None, quick: bool
) -> str:
    """The command that makes the report again."""
    from meshreel.cli.reports import within

    words = ["meshreel", "evaluate", *map(within, inputs), "--out", within(str(out))]
    if methods != ",".join(DEFAULT_METHODS):
        words += ["--methods", methods]
    if peers != ",".join(PEER_NAMES):
        words += ["--peers", peers]
    if reference:
        words += ["--reference", within(str(reference))]
    if quick:
        words.append("--quick")
    return shlex.join(words)
