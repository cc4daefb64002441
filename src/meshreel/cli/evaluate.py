"""`meshreel evaluate`: our methods beside other codecs, on any sequences."""

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
    from meshreel.cli.reports import check_before_work, named, within, write_report
    from meshreel.evaluation.choices import checked_names
    from meshreel.evaluation.codecs.peers.registry import peers_named
    from meshreel.evaluation.codecs.recorded import read_recorded
    from meshreel.evaluation.codecs.study import CodecStudy

    chosen = checked_names(named(methods), CODED_METHODS, "method")
    others = peers_named(named(peers))
    check_before_work(inputs, out, [reference] if reference else [])
    recorded = read_recorded(reference) if reference else []
    options: dict[str, str | None] = {}
    if methods != ",".join(DEFAULT_METHODS):
        options["--methods"] = methods
    if peers != ",".join(PEER_NAMES):
        options["--peers"] = peers
    if reference:
        options["--reference"] = within(str(reference))
    if quick:
        options["--quick"] = None
    study = CodecStudy(chosen, others, recorded, quick)
    write_report(study, inputs, out, options, as_json=as_json)
