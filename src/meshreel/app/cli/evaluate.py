"""`meshreel evaluate`: our methods beside other codecs, on any sequences."""

from pathlib import Path

import click

from meshreel.app.cli.commands import command
from meshreel.app.cli.completing import input_files
from meshreel.app.cli.parameters import argument, option

METHODS = "pca-qp, pca, pca-q, v2v, pca-qs, blocks, gft, reel, lossless, grid"
DEFAULT = "reel,pca-qp,v2v"
PEERS = "draco,sz3,zfp,meshopt,pco,blosc2,npz"
TRACK_PEERS = "sz3,zfp,pco,fpzip"
"""Names of the evaluation, written out: help comes without importing it."""


@command
@argument(
    "inputs",
    nargs=-1,
    required=True,
    metavar="INPUT...",
    completion=input_files,
    help="Sequences: an .npz or .reel file, a folder or a quoted glob of frames, each.",
)
@option(
    "--out",
    type=Path,
    default=Path("evaluation"),
    help="Folder for results, plots and report; made if missing.",
)
@option(
    "--track",
    metavar="NAME",
    help="A track of the sequences, measured alone beside compressors of arrays, at equal "
    "largest error. Default: the positions.",
)
@option(
    "--methods",
    metavar="A,B,...",
    help=f"Our methods, of {METHODS}. Default: {DEFAULT}.",
)
@option(
    "--peers",
    metavar="A,B,...",
    help=f"Other codecs; 'none' for none of them. Default: {PEERS}; of a track {TRACK_PEERS}.",
)
@option(
    "--reference",
    type=Path,
    metavar="FILE.csv",
    help="Points measured elsewhere; its rows of the same name, vertices and frames are "
    "added. Columns: sequence, n, k, m, codec, params, bytes_total, bytes_connectivity, "
    "bpvf_total, kg_error_percent, max_err_over_diag, enc_s, dec_s, rms_err_over_diag.",
)
@option("--quick", is_flag=True, help="Few settings of each codec.")
@option("as_json", "--json", is_flag=True, help="Print all figures as JSON.")
def evaluate_command(
    inputs: tuple[str, ...],
    out: Path,
    track: str | None,
    methods: str | None,
    peers: str | None,
    reference: Path | None,
    quick: bool,
    as_json: bool,
) -> None:
    """Rate, distortion and seconds of our methods beside other codecs, on your data.

    With --track, of one track instead of the positions.

    Writes report.md, report.html, figures/ and results/ (each run as JSON). Runs that the folder
    has already are not done again. Codecs come with the extras [peers] and [meshopt]; those that
    are missing are named in the report. Drawing needs the extra [plot].

    Examples:

    - `meshreel evaluate walk.npz --quick`

    - `meshreel evaluate samba.npz cow.npz --out codecs --reference recorded.csv`

    - `meshreel evaluate walk.npz --methods pca-qp --peers draco,sz3`

    - `meshreel evaluate walk.npz --peers none --json`

    - `meshreel evaluate crash.vtkhdf --track stress --quick`
    """
    from meshreel.app.cli.reports import check_before_work, named, within, write_report
    from meshreel.evaluation.choices import checked_names
    from meshreel.evaluation.codecs.peers.registry import peers_named
    from meshreel.evaluation.codecs.recorded import read_recorded
    from meshreel.evaluation.codecs.settings import CODED_METHODS, DEFAULT_METHODS
    from meshreel.evaluation.codecs.study import CodecStudy
    from meshreel.evaluation.tracks.peers import track_peers_named
    from meshreel.evaluation.tracks.study import TrackStudy

    if track is not None and (methods is not None or reference is not None):
        given = "--methods" if methods is not None else "--reference"
        raise click.UsageError(
            f"{given} is about positions; it has no effect with --track, leave it out"
        )
    chosen: tuple[str, ...] = DEFAULT_METHODS
    if methods is not None:
        chosen = checked_names(named(methods), CODED_METHODS, "method")
    options: dict[str, str | None] = {
        "--track": track,
        "--methods": methods,
        "--peers": peers,
        "--reference": within(str(reference)) if reference else None,
    }
    options = {name: value for name, value in options.items() if value is not None}
    if quick:
        options["--quick"] = None
    if track is not None:
        arrays = track_peers_named(named(peers)) if peers is not None else track_peers_named()
        check_before_work(inputs, out)
        study = TrackStudy(track, arrays, quick)
        write_report(study, inputs, out, options, track=track, as_json=as_json)
        return
    others = peers_named(named(peers)) if peers is not None else peers_named()
    check_before_work(inputs, out, [reference] if reference else [])
    recorded = read_recorded(reference) if reference else []
    write_report(CodecStudy(chosen, others, recorded, quick), inputs, out, options, as_json=as_json)
