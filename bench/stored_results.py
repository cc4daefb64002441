"""Measure the results in docs/paper.md and README, and store them in docs/results.

    python bench/stored_results.py paper samba.npz cow.npz --flag 1000 --work runs
    python bench/stored_results.py codecs samba.npz cow.npz --reference points.csv --work runs
    python bench/stored_results.py choices samba.npz cow.npz
    python bench/stored_results.py points samba.npz cow.npz --work runs
    python bench/stored_results.py anchors samba.npz cow.npz --flag 300
    python bench/stored_results.py checks

Writes docs/results/paper.json and others, with the commit; `points` writes rd.csv, which other
papers can plot; `checks` measures the small flag that tests re-encode. `python
docs/result_tables.py --write` then updates the pages. Results in the folder `--work` are reused, so
use a new folder for each commit.
"""

import argparse
import csv
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

import measuring
import meshreel
from anchor_exchange import better_anchors
from meshreel.evaluation.comparison import ERRORS, CodecResults
from meshreel.evaluation.positions import compare_positions, method_sweeps
from meshreel.evaluation.recorded import COLUMNS, read_recorded
from meshreel.model.sequence import MeshSequence
from meshreel.paper.study.findings import findings
from meshreel.paper.study.results import (
    PaperResults,
    extrapolated_basis,
    setting_of_result,
    summary,
)
from meshreel.paper.study.runs import decompositions_run, full_decomposition_run
from meshreel.paper.study.study import PaperStudy
from meshreel.paper.study.tables import SHAPES, settings_line
from meshreel.paper.sweeps import COEFFICIENTS, PRESETS, option_sweeps
from meshreel.studies.rate_distortion import bd_rate
from meshreel.studies.runs import Result, Store, file_name, result_of, usable, without_identities
from meshreel.studies.study import Study, Subject, measure
from meshreel.studies.timing import timed_once

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "docs" / "results"
CHECK_FRAMES = 60
"""Frames of the flag that tests re-encode."""

N_TIMES = 5
LARGE = 150
"""Vertices along each side of the flag for the per-mesh solve: 22,500 in total."""

FULL_SIDES = 50, 71, 100
"""Vertices along each side of flags of which all graph frequencies are computed."""

LARGE_MESHES = ("dinosaur", "camel")
"""Meshes of the paper with more than 20,000 vertices, for which it has no per-mesh result."""

ANCHOR_CASES = (
    ("samba", 60, "pca-qp", (4, 8, 20)),
    ("cow", None, "pca-qp", (4, 8, 20)),
    ("samba", None, "blocks", (4,)),
    ("cow", None, "blocks", (4,)),
)
"""Sequence, frames, method and modes of the comparison of both kinds of anchors at 8 bits."""


def commit() -> str:
    """The commit of the checkout, with a mark if files of the codec differ from it."""
    is_changed = git("status", "--porcelain", "--", "src", "core")
    return git("rev-parse", "--short=12", "HEAD") + ("+" if is_changed else "")


def git(*words: str) -> str:
    """Output of a git command in the checkout."""
    command = ["git", "-C", str(ROOT), *words]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def store(name: str, figures: dict[str, Any]) -> None:
    """Write a file of results with the commit and the machine."""
    measuring.store(RESULTS / f"{name}.json", commit=commit(), **figures)


def run_study(study: Study[Any], sequence: MeshSequence, folder: Path) -> Any:
    """Run a study on one sequence."""
    subject = Subject(sequence, file_name(sequence.name), Store.for_sequence(folder, sequence))
    return measure(study, subject, lambda stage, _: print(f"  {stage}", flush=True))


def paper_figures(sequence: MeshSequence, folder: Path) -> dict[str, Any]:
    """Tables, verdicts and curves of a sequence."""
    results: PaperResults = run_study(PaperStudy(), sequence, folder)
    figures = results.as_dict()
    figures["findings"] = [finding.as_dict() for finding in findings(results)]
    figures["decompositions"] = None
    figures["full_decomposition"] = None
    if results.decompositions is not None:
        names = ("n_modes", "seconds_each", "processor_seconds_each")
        figures["decompositions"] = {name: results.decompositions[name] for name in names}
    full = results.full_decomposition
    if full is not None:
        figures["full_decomposition"] = without_identities([full])[0]
    return figures


def printed_preset(sequence: MeshSequence, folder: Path) -> list[dict[str, Any]]:
    """Rows of Table I with modes and bits close to the printed rates."""
    study = PaperStudy(("pca", "pca-q", "v2v", "pca-qp", "blocks"), True, PRESETS["printed"])
    results = run_study(study, sequence, folder)
    return [summary(result) for result in results.variants]


def anchor_rows(sequences: Sequence[MeshSequence]) -> list[dict[str, Any]]:
    """KG errors and rates of streams with both kinds of anchors."""
    by_name = {sequence.name: sequence for sequence in sequences}
    rows = []
    for name, n_frames, method, mode_counts in ANCHOR_CASES:
        if name not in by_name:
            continue
        sequence = by_name[name].replace(vertices=by_name[name].vertices[:n_frames])
        size = sequence.n_verts * sequence.n_frames
        for n_modes in mode_counts:
            row: dict[str, Any] = {
                "sequence": name,
                "n_frames": sequence.n_frames,
                "method": method,
                "n_modes": n_modes,
            }
            for kind, choices in KINDS_OF_ANCHORS.items():
                data = meshreel.encode(sequence, method, n_modes=n_modes, bits=8, choices=choices)
                budget = meshreel.info(data).budget_bytes
                n_bytes = budget["anchors"] + budget.get("anchor residuals", 0)
                row[kind] = {**figures_of(sequence, data), "q_a": 8 * n_bytes / 3 / size}
            rows.append(row)
    return rows


def large_mesh(folder: Path) -> dict[str, Any]:
    """Seconds of the per-mesh variant beyond 20,000 vertices."""
    sequence = meshreel.simulate_flag(3, n_rows=LARGE, n_columns=LARGE)
    n_modes = sequence.n_verts // 50
    subject = Store.for_sequence(folder, sequence)
    once = result_of(decompositions_run(sequence, n_modes), subject)
    data, encoding = timed_once(partial(meshreel.encode, sequence, "gft", n_modes=n_modes))
    decoded, decoding = timed_once(partial(meshreel.decode, data))
    return {
        "n_verts": sequence.n_verts,
        "n_frames": sequence.n_frames,
        "n_modes": n_modes,
        "seconds_each": once["seconds_each"],
        "encode_s": encoding.wall,
        "decode_s": decoding.wall,
        "kg_error_percent": meshreel.compare(sequence, decoded).kg_error_percent,
        "all_frequencies": full_bases(folder),
    }


def full_bases(folder: Path) -> dict[str, Any]:
    """Seconds of all graph frequencies of flags, extrapolated to meshes of the paper."""
    measured: list[Result] = []
    for side in FULL_SIDES:
        sequence = meshreel.simulate_flag(3, n_rows=side, n_columns=side)
        run = full_decomposition_run(sequence)
        measured += usable([result_of(run, Store.for_sequence(folder, sequence))])
    n_verts, seconds = ([basis[name] for basis in measured] for name in ("n_verts", "seconds"))
    exponent = np.polyfit(np.log(n_verts), np.log(seconds), 1)[0]
    extrapolated = [extrapolated_basis(measured[-1], *SHAPES[name]) for name in LARGE_MESHES]
    return {
        "measured": without_identities(measured),
        "exponent": float(exponent),
        "extrapolated": [
            {**asdict(basis), "seconds": basis.seconds, "text": basis.text}
            for basis in extrapolated
        ],
    }


def default_figures(sequence: MeshSequence) -> dict[str, Any]:
    """Rate, errors and processor seconds with default options."""
    data = meshreel.encode(sequence)
    quality = meshreel.compare(sequence, meshreel.decode(data))
    info = meshreel.info(data)
    tasks = {"encode": lambda: meshreel.encode(sequence), "decode": lambda: meshreel.decode(data)}
    seconds = measuring.medians(measuring.rounds(tasks, N_TIMES))
    return {
        "ratio": info.ratio,
        "rate_bpvf": info.rate_bpvf,
        "rate_order_dropped_bpvf": meshreel.info(meshreel.encode(sequence, order="drop")).rate_bpvf,
        "kg_error_percent": quality.kg_error_percent,
        "sted": quality.sted,
        "max_error_percent": quality.max_error_percent,
        "encode_processor_s": seconds["encode"].processor,
        "decode_processor_s": seconds["decode"].processor,
    }


def codec_figures(sequence: MeshSequence, folder: Path, reference: Path | None) -> dict[str, Any]:
    """Results with default options, and BD-rates of `reel` relative to `pca-qp` and FAMC."""
    recorded = read_recorded(reference) if reference else []
    sweeps = {**method_sweeps(quick=False), **option_sweeps(quick=False)}
    study = compare_positions({name: sweeps[name] for name in ("reel", "pca-qp")}, (), recorded)
    results: CodecResults = run_study(study, sequence, folder)
    kg, sted = (results.curves(error) for error in ERRORS[:2])
    more_anchors = [
        point(sequence, "pca-qp", n_modes=n_modes, bits=bits, anchors=share)
        for share in MORE_ANCHORS
        for n_modes in (5, 10, 20, 40)
        for bits in (6, 8, 10)
    ]
    more = {
        error: [(each["rate_bpvf"], each[error]) for each in more_anchors]
        for error in ("kg_error_percent", "sted")
    }
    pairs = {
        "kg_pca_qp": (kg["reel-geometry"], kg["pca-qp"]),
        "sted_pca_qp": (sted["reel"], sted["pca-qp"]),
        "kg_famc": (kg["reel-geometry"], kg.get("famc (recorded)", [])),
        "kg_more_anchors": (kg["reel-geometry"], kg["pca-qp"] + more["kg_error_percent"]),
        "sted_more_anchors": (sted["reel"], sted["pca-qp"] + more["sted"]),
    }
    rates = {name: bd_rate(*pair) for name, pair in pairs.items()}
    shape = {name: results.sequence[name] for name in ("name", "n_frames", "n_verts")}
    bd_rates = {name: asdict(rate) for name, rate in rates.items()}
    return {**shape, **default_figures(sequence), "bd_rates": bd_rates}


def choice_figures(sequence: MeshSequence) -> dict[str, Any]:
    """Results of `pca-qp` by Laplacian and fraction of anchors, and of `v2v` by bits."""
    curves = {
        laplacian: [
            point(sequence, "pca-qp", n_modes=MODES, bits=bits, laplacian=laplacian)
            for bits in (7, 8, 9, 10)
        ]
        for laplacian in LAPLACIANS
    }
    shares = {
        kind: [
            point(sequence, "pca-qp", n_modes=MODES, bits=8, anchors=share, choices=choices)
            for share in ANCHOR_SHARES
        ]
        for kind, choices in KINDS_OF_ANCHORS.items()
    }
    vertex_bits = {
        str(bits): [
            point(sequence, "v2v", n_modes=modes, bits=bits)
            for modes in (5, 10, 20, 40)
            if modes <= sequence.n_frames
        ]
        for bits in VERTEX_BITS
    }
    return {
        "name": sequence.name,
        "laplacians": curves,
        "anchors": shares,
        "vertex_bits": vertex_bits,
    }


MODES = 20
LAPLACIANS = ("normalized", "combinatorial", "cotangent")
ANCHOR_SHARES = (0.0, 0.005, 0.01, 0.03, 0.1)
VERTEX_BITS = (9, 10, 11, 12, 13)


KINDS_OF_ANCHORS = {"positions": None, "coefficients": COEFFICIENTS}
"""Choices of the paper's methods by the coded values of anchors."""


def point(sequence: MeshSequence, method: str, **options: Any) -> dict[str, float]:
    """Rate of a stream without vertex order, and its errors."""
    smallest = meshreel.info(meshreel.encode(sequence, method, order="drop", **options))
    figures = figures_of(sequence, meshreel.encode(sequence, method, **options))
    return {**figures, "rate_bpvf": smallest.rate_bpvf}


def figures_of(sequence: MeshSequence, data: bytes) -> dict[str, float]:
    """Rate and errors of a stream."""
    quality = meshreel.compare(sequence, meshreel.decode(data))
    return {
        "rate_bpvf": meshreel.info(data).rate_bpvf,
        "kg_error_percent": quality.kg_error_percent,
        "sted": quality.sted,
    }


MORE_ANCHORS = (0.03, 0.1)
"""Fractions of anchors that the paper does not use."""


def check_figures() -> dict[str, Any]:
    """Rates and errors of the small flag, by method."""
    flag = meshreel.simulate_flag(CHECK_FRAMES)
    methods = {
        method: {"options": options, **figures_of(flag, meshreel.encode(flag, method, **options))}
        for method, options in CHECKED.items()
    }
    return {"n_frames": CHECK_FRAMES, "methods": methods}


def exchange_figures(sequence: MeshSequence) -> dict[str, Any]:
    """`pca-qp` with farthest points, and with anchors exchanged for better ones."""
    encode = partial(meshreel.encode, sequence, "pca-qp", n_modes=MODES)
    streams = [encode(bits=bits, anchors=0.01) for bits in (7, 8, 9)]
    task = partial(better_anchors, sequence, meshreel.paper.read(streams[1]))
    anchors, seconds = timed_once(task)
    points = [figures_of(sequence, data) for data in streams]
    exchanged = figures_of(sequence, encode(bits=8, anchors=anchors.tolist()))
    rates, errors = ([one[name] for one in points] for name in ("rate_bpvf", "kg_error_percent"))
    at_equal_rate = np.exp(np.interp(exchanged["rate_bpvf"], rates, np.log(errors)))
    return {
        "name": sequence.name,
        "n_anchors": len(anchors),
        "farthest": points[1],
        "exchanged": exchanged,
        "kg_change_percent": 100 * float(exchanged["kg_error_percent"] / at_equal_rate - 1),
        "exchange_processor_s": seconds.processor,
    }


CHECKED: dict[str, dict[str, Any]] = {
    "reel": {},
    "pca-qp": {"n_modes": 20, "bits": 8},
    "v2v": {"n_modes": 20, "bits": 11},
    "blocks": {"n_modes": 4, "bits": 8, "block_frames": 20},
}
"""Options of the streams that tests re-encode."""


def point_rows(sequence: MeshSequence, folder: Path) -> list[dict[str, Any]]:
    """Rows of rd.csv: streams of the paper's variants in the tables and Fig. 3, and of `reel`."""
    paper: PaperResults = run_study(PaperStudy(), sequence, folder)
    sweeps = method_sweeps(quick=True)
    study = compare_positions({name: sweeps[name] for name in ("reel", "lossless")}, ())
    ours: CodecResults = run_study(study, sequence, folder)
    rows = [
        _point_row(
            paper.sequence,
            setting_of_result(each).method,
            settings_line(setting_of_result(each)),
            each["size_order_dropped_bytes"],
            each["budget_order_dropped_bytes"].get("connectivity", 0),
            each,
        )
        for each in usable([*paper.variants, *paper.rows])
    ]
    return rows + [
        _point_row(
            paper.sequence,
            each["codec"],
            each["params"],
            each["size_bytes"],
            each["connectivity_bytes"],
            each,
        )
        for each in usable(ours.measured)
    ]


def _point_row(
    shape: dict[str, Any],
    method: str,
    params: str,
    size_bytes: int,
    connectivity_bytes: int,
    result: Result,
) -> dict[str, Any]:
    quality, seconds = result["quality"], result["seconds"]
    return {
        "sequence": shape["name"],
        "n": shape["n_verts"],
        "k": shape["n_frames"],
        "m": shape["n_faces"],
        "codec": f"meshreel {method}",
        "params": params,
        "bytes_total": size_bytes,
        "bytes_connectivity": connectivity_bytes,
        "bpvf_total": f"{8 * size_bytes / (shape['n_verts'] * shape['n_frames']):.6g}",
        "kg_error_percent": f"{quality['kg_error_percent']:.6g}",
        "max_err_over_diag": f"{quality['max_error_percent'] / 100:.6g}",
        "enc_s": f"{seconds['encode_processor']:.3g}",
        "dec_s": f"{seconds['decode_processor']:.3g}",
        "rms_err_over_diag": f"{quality['rms_error_percent'] / 100:.6g}",
        "sted": f"{quality['sted']:.6g}",
        "commit": commit(),
    }


def store_points(rows: Sequence[dict[str, Any]]) -> None:
    """Write rd.csv."""
    with (RESULTS / "rd.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, [*COLUMNS, "sted", "commit"], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


WHAT = ("paper", "codecs", "choices", "points", "anchors", "checks")


def main() -> None:
    """Measure and store the requested results."""
    parser = argparse.ArgumentParser(description="Measure and store figures of the documentation.")
    parser.add_argument("what", choices=WHAT)
    parser.add_argument("inputs", nargs="*", help="sequences")
    parser.add_argument("--flag", type=int, default=0, help="frames of the flag, after the inputs")
    parser.add_argument("--reference", type=Path, help="recorded points of other codecs (codecs)")
    parser.add_argument("--work", type=Path, default=Path("runs"), help="folder for the runs")
    arguments = parser.parse_args()
    if arguments.what == "checks":
        store("checks", check_figures())
        return
    sequences = [meshreel.load(path).replace(tracks={}) for path in arguments.inputs]
    if arguments.flag:
        sequences.append(meshreel.simulate_flag(arguments.flag))
    if arguments.what == "points":
        found = (point_rows(sequence, arguments.work) for sequence in sequences)
        store_points([*chain.from_iterable(found)])
        return
    measures: dict[str, Callable[[MeshSequence], dict[str, Any]]] = {
        "paper": partial(paper_figures, folder=arguments.work),
        "codecs": partial(codec_figures, folder=arguments.work, reference=arguments.reference),
        "choices": choice_figures,
        "anchors": exchange_figures,
    }
    figures: dict[str, Any] = {"sequences": []}
    for sequence in sequences:
        print(sequence.name, flush=True)
        figures["sequences"].append(measures[arguments.what](sequence))
    if arguments.what == "paper":
        for sequence in sequences:
            if sequence.name == "samba":
                figures["printed_preset"] = printed_preset(sequence, arguments.work)
        figures["anchors"] = anchor_rows(sequences)
        figures["large_mesh"] = large_mesh(arguments.work)
    store(arguments.what, figures)


if __name__ == "__main__":
    main()
