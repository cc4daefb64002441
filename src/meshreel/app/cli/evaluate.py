"""`meshreel evaluate`: compare our methods with other codecs, on any sequences."""

from pathlib import Path
from typing import Annotated

from meshreel.app.cli.commands import command
from meshreel.app.cli.parameters import Argument, JsonOption
from meshreel.codec.option import Option

METHODS = "pca-qp, pca, pca-q, v2v, pca-qs, blocks, gft, reel, lossless, grid"
DEFAULT = "reel,pca-qp,v2v"
PEERS = "draco,sz3,zfp,meshopt,pco,blosc2,npz"
"""Names of `meshreel.evaluation`, repeated so that the help need not import it."""


@command
def evaluate_command(
    inputs: Annotated[
        tuple[str, ...],
        Argument(
            "INPUT...", "Sequences: .npz or .reel files, or folders or quoted globs of frames."
        ),
    ],
    out: Annotated[
        Path,
        Option("Folder for results, plots and report; created if missing.", flag="--out -o"),
    ] = Path("evaluation"),
    methods: Annotated[
        str | None, Option(f"Our methods: {METHODS}. Default: {DEFAULT}.", metavar="A,B,...")
    ] = None,
    peers: Annotated[
        str | None, Option(f"Other codecs, or 'none'. Default: {PEERS}.", metavar="A,B,...")
    ] = None,
    codec: Annotated[
        str | None,
        Option(
            "A codec of yours: module:encode,decode, with encode(vertices, faces, setting) -> "
            "bytes, decode(data, faces) -> vertices, and the module's SETTINGS, a list of numbers. "
            "Our coded faces are added to its bytes, unless the module sets HAS_FACES = True.",
            metavar="MODULE:ENCODE,DECODE",
        ),
    ] = None,
    reference: Annotated[
        Path | None,
        Option(
            "Points measured elsewhere, added for sequences of equal name, vertices and frames. "
            "Columns: sequence, n, k, m, codec, params, bytes_total, bytes_connectivity, "
            "bpvf_total, kg_error_percent, max_err_over_diag, enc_s, dec_s, rms_err_over_diag.",
            metavar="FILE.csv",
        ),
    ] = None,
    quick: Annotated[bool, Option("Run few settings of each codec.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Compare rate, distortion and speed of our methods with other codecs, on your data.

    The faces must be the same in every frame. For captures, run `meshreel register` first, or
    measure distances between surfaces with `meshreel compare`.

    Writes report.md, figures/ and results/ (each run as JSON). Existing results are
    not measured again. This needs the extras [peers] and [plot], and [paper] for methods of the
    paper; [meshopt] installs one more codec. The report lists missing codecs.

    Examples:

    - `meshreel evaluate walk.npz --quick`
    - `meshreel evaluate samba.npz cow.npz --out codecs --reference recorded.csv`
    - `meshreel evaluate walk.npz --methods pca-qp --peers draco,sz3`
    - `meshreel evaluate walk.npz --peers none --json`
    - `meshreel evaluate walk.npz --peers none --codec my_codec:encode,decode`
    """
    from meshreel.app.cli.reports import check_before_work, split_names, write_report
    from meshreel.codec.method_names import METHOD_NAMES, our_name
    from meshreel.codec.paper_options import PAPER_METHODS
    from meshreel.evaluation.own_codec import own_codec
    from meshreel.evaluation.peers import peers_named
    from meshreel.evaluation.positions import (
        DEFAULT_METHODS,
        PEERS,
        compare_positions,
        method_sweeps,
    )
    from meshreel.evaluation.recorded import read_recorded
    from meshreel.runtime.extras import PAPER
    from meshreel.studies.study import checked_names

    method_names: tuple[str, ...] = DEFAULT_METHODS
    if methods is not None:
        method_names = checked_names(map(our_name, split_names(methods)), METHOD_NAMES, "method")
    codecs = peers_named(None if peers is None else split_names(peers), PEERS)
    extras = [] if set(method_names).isdisjoint(PAPER_METHODS) else [PAPER]
    if codec is not None:
        codecs += (own_codec(codec, [*METHOD_NAMES, *(peer.name for peer in PEERS)]),)
    check_before_work(inputs, out, [reference] if reference else [], extras)

    from meshreel.paper.sweeps import option_sweeps  # imports SciPy

    recorded = read_recorded(reference) if reference else []
    sweeps = {**option_sweeps(quick=quick), **method_sweeps(quick=quick)}
    write_report(
        compare_positions(
            {name: sweeps[name] for name in method_names}, codecs, recorded, quick=quick
        ),
        inputs,
        out,
        as_json=as_json,
    )
