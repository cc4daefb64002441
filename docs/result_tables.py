"""Tables, and figures of sentences, that come from stored results.

    python docs/result_tables.py             lists the tables and figures
    python docs/result_tables.py --write     brings README and the pages up to date

`python bench/stored_results.py` measures the results in docs/results/, and those of `corpus`
bench/corpus_results.py. A table is between the lines ``<!-- results: NAME -->`` and
``<!-- end of results -->``, figures are between the same marks in one line; a test fails if one
differs from the results.
"""

import json
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import cache, partial
from pathlib import Path
from statistics import median
from typing import Any

from meshreel.paper.study.findings import CLAIMS
from meshreel.paper.study.tables import printed_rates, printed_seconds
from meshreel.rendering.documents import Table, number, significant
from meshreel.studies.rate_distortion import bd_rate

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "bench"))
from corpus.tables import TABLES as CORPUS_TABLES  # noqa: E402
from corpus.tables import n_broken  # noqa: E402

RESULTS = ROOT / "docs" / "results"
FROM_RESULTS = ("paper", "benchmarks", "codec", "corpus", "equations")
PAGES = ("README.md", *(f"docs/{name}.md" for name in FROM_RESULTS))
REGION = re.compile(
    r"(?P<begin><!-- results: (?P<name>[\w-]+) -->(?P<newline>\n?)).*?"
    r"(?P<end><!-- end of results -->)",
    re.DOTALL,
)

KINDS = {
    "samba": "captured",
    "jumping": "captured",
    "cow": "elastic simulation",
    "dance": "animation",
    "horse_gallop": "animation",
    "chicken": "animation, 41 components",
    "bone": "animation",
    "flag": "simulated",
}

RATES = ("q", "q_a", "q_d", "q_s")

OPEN_QUESTIONS = (
    "Deltas on eigen-trajectories beat vertices at the zero-order entropy",
    "Positions of anchors in all frames",
    "Variant (ii)",
)
"""Beginnings of the claims that are ours, on what the paper leaves open."""

SEPARATE = "commit_of_anchors_and_large_mesh"
"""Key of the commit of parts that were measured separately, if there are any."""


@cache
def results(name: str) -> dict[str, Any]:
    """The stored results of this name."""
    parsed: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
    return parsed


def with_tables(text: str) -> str:
    """A page with its tables and figures as the stored results have them."""
    makers = {**TABLES, **FIGURES}
    return REGION.sub(
        lambda found: f"{found['begin']}{makers[found['name']]()}{found['newline']}{found['end']}",
        text,
    )


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    first, *others = ("| " + " | ".join(line) + " |" for line in (header, *rows))
    return "\n".join([first, "|" + "---|" * len(header), *others])


def source(name: str, text: str, commit: str = "commit") -> str:
    """A table, with the commit that it was measured at, or another one stored under a name."""
    found = results(name)
    machine = found["machine"]
    measured = found.get(commit, found["commit"])
    return f"{text}\n\n(Commit `{measured}`, {machine['cpu']}, NumPy {machine['numpy']}.)"


def sequence_named(name: str) -> dict[str, Any]:
    """What was measured on a sequence."""
    return next(one for one in results("paper")["sequences"] if one["name"] == name)


def printed_beside(value: str, printed: float | None, digits: int = 4) -> str:
    """A figure with the printed one in brackets."""
    return value if printed is None else f"{value} ({printed:.{digits}f})"


def samba_rates() -> str:
    """Table I of samba, with the printed figures in brackets."""
    return source("paper", rates_table("samba", sequence_named("samba")["variants"]))


def printed_preset() -> str:
    """Table I of samba with 8 rows of 4 bits."""
    return rates_table("samba", results("paper")["printed_preset"])


def rates_table(name: str, variants: Sequence[dict[str, Any]]) -> str:
    """Rates by Eq. 13 with the printed ones, rates as stored, and rate and errors of the files."""
    header = ("variant", *RATES, *(f"{name} stored" for name in RATES),
              "bpvf of the file, order dropped", "KG error %", "STED")  # fmt: skip
    printed, rows = printed_rates(name), list[tuple[str, ...]]()
    for variant in variants:
        eq13, stored = variant["rates"]["eq13"], variant["rates"]["stored"]
        beside = printed.get(variant["label"])
        rows.append(
            (
                f"`{variant['label']}`",
                *(
                    printed_beside(number(eq13[part]), getattr(beside, part, None))
                    for part in RATES
                ),
                *(number(stored[part]) for part in RATES),
                number(variant["rate_order_dropped_bpvf"]),
                significant(variant["kg_error_percent"]),
                significant(variant["sted"]),
            )
        )
    return table(header, rows)


def seconds() -> str:
    """Table II of samba and the flag: processor seconds of one thread, and the printed ones."""
    header = ("sequence", "variant", "encode, s (printed)", "reconstruct, s (printed)")
    rows: list[tuple[str, ...]] = []
    for name in ("samba", "flag"):
        sequence = sequence_named(name)
        printed = printed_seconds(name, sequence["n_verts"])
        for one in sequence["variants"]:
            beside = printed.get(one["label"]) if one["label"] != "gft" else None
            cells = [
                printed_beside(
                    significant(one[f"{part}_processor_s"]), getattr(beside, part, None), 2
                )
                for part in ("encode", "decode")
            ]
            rows.append((name, f"`{one['label']}`", *cells))
        rows += _decomposed_each(name, sequence, printed.get("gft"))
    return source("paper", table(header, rows))


def _decomposed_each(
    name: str, sequence: dict[str, Any], printed: Any
) -> Iterable[tuple[str, ...]]:
    """Rows of `gft` with a decomposition for each frame, extrapolated: 5 % and all frequencies."""
    graph = next(one for one in sequence["variants"] if one["label"] == "gft")
    few, full = sequence["decompositions"], sequence["full_decomposition"]
    more = (sequence["n_frames"] - 1) * few["processor_seconds_each"]
    yield (
        name,
        f"`gft`, {few['n_modes']} frequencies, decomposed for each frame *",
        *(f"{graph[f'{part}_processor_s'] + more:.0f}" for part in ("encode", "decode")),
    )
    if full is not None and "refused" not in full:
        all_frames = f"{sequence['n_frames'] * full['processor_seconds']:.0f}"
        cells = [
            printed_beside(all_frames, getattr(printed, part, None), 2)
            for part in ("encode", "decode")
        ]
        yield name, "`gft`, all frequencies, decomposed for each frame *", *cells


def anchors() -> str:
    """KG errors with coefficients and with positions of anchors."""
    header = ("sequence, frames", "variant", "K", "KG %, coefficients", "KG %, positions",
              "q_a of the stream, coefficients", "positions", "bpvf of the file, coefficients",
              "positions")  # fmt: skip
    rows = [
        (
            f"{one['sequence']}, {one['n_frames']}",
            f"`{one['method']}`",
            str(one["n_modes"]),
            *(significant(one[kind]["kg_error_percent"]) for kind in KINDS_OF_ANCHORS),
            *(number(one[kind]["q_a"]) for kind in KINDS_OF_ANCHORS),
            *(f"{one[kind]['rate_bpvf']:.3f}" for kind in KINDS_OF_ANCHORS),
        )
        for one in results("paper")["anchors"]
    ]
    return source("paper", table(header, rows), SEPARATE)


KINDS_OF_ANCHORS = ("coefficients", "positions")


VERDICTS = ("yes", "weakly", "no")


def claims() -> str:
    """How many sequences support each claim, and the measures that decide it."""
    found: dict[str, list[dict[str, Any]]] = {}
    for sequence in results("paper")["sequences"]:
        for one in sequence["findings"]:
            found.setdefault(one["claim"], []).append(one)
    rows = []
    for claim, findings in found.items():
        counts = [sum(one["verdict"] == verdict for one in findings) for verdict in VERDICTS]
        values = [one["value"] for one in findings if one["verdict"] != "not judged"]
        measures = f"{min(values):.3g}, {median(values):.3g}, {max(values):.3g}" if values else "-"
        rows.append((claim, *map(str, counts), measures))
    header = ("claim", *VERDICTS, "measure: lowest, median, highest")
    unjudged = sum(one["verdict"] == "not judged" for each in found.values() for one in each)
    rest = f"\n\nNot judged: {unjudged}, for want of blocks or by their time." if unjudged else ""
    return source("paper", table(header, rows) + rest)


def sweeps() -> str:
    """Points of the sweeps behind the claims, and how far their envelopes are from settled."""
    sequences = results("paper")["sequences"]
    found: dict[str, list[dict[str, Any]]] = {}
    for one in (one for sequence in sequences for one in sequence["sweeps"]):
        found.setdefault(one["label"], []).append(one)
    texts, moves = [], list[float | None]()
    for label, each in found.items():
        points = [one["n_points"] for one in each]
        moves += [one["moved_percent"] for one in each]
        texts.append(f"`{label}` {min(points)} to {max(points)}")
    settled = [move for move in moves if move is not None]
    text = (
        f"Points: {', '.join(texts)}. The last rounds moved envelopes by up to {max(settled):.1f} %"
    )
    if len(settled) < len(moves):
        text += f"; {len(moves) - len(settled)} of {len(moves)} sweeps were cut short"
    return source("paper", f"{text}.")


def claim_rows() -> str:
    """The measure and the thresholds of every claim."""
    rows = [
        (claim.text, f"{claim.measure}; {claim.threshold}", faithful(claim.text))
        for claim in CLAIMS
    ]
    return table(("row", "measure and thresholds", "verdict"), rows)


def faithful(claim: str) -> str:
    """The verdict of the ledger on a claim, which says whether the paper makes it."""
    is_ours = claim.startswith(OPEN_QUESTIONS)
    return "faithful; a question of ours" if is_ours else "faithful"


def entropy() -> str:
    """Q as stored against zero-order entropy."""
    labels = ("pca-q", "v2v")
    rows = [
        (one["name"], *(_entropy_cell(one, label) for label in labels))
        for one in results("paper")["sequences"]
    ]
    return source("paper", table(("sequence", *(f"`{label}`" for label in labels)), rows))


def _entropy_cell(sequence: dict[str, Any], label: str) -> str:
    rates = next(one["rates"] for one in sequence["variants"] if one["label"] == label)
    stored, entropy = rates["stored"]["q"], rates["q_entropy"]
    return f"{entropy:.3f} to {stored:.3f} ({100 * (stored / entropy - 1):+.0f} %)"


def alternatives() -> str:
    """KG error and rate of each choice that the paper leaves open, over those of the usual one."""
    sequences = results("paper")["sequences"]
    labels = list(dict.fromkeys(one["label"] for each in sequences for one in each["alternatives"]))
    groups: dict[str, list[str]] = {}
    for label in labels:
        groups.setdefault(re.sub(r" \d\)$", ", mean of three sets)", label), []).append(label)
    rows = [
        (f"`{name}`", *(_changes(sequence, group) for sequence in sequences))
        for name, group in groups.items()
    ]
    return source("paper", table(("variant", *(one["name"] for one in sequences)), rows))


def _changes(sequence: dict[str, Any], labels: Sequence[str]) -> str:
    """Mean changes of KG error and rate by alternatives, in percent."""
    changes = _changes_by(sequence, labels)
    if not changes:
        return "-"
    return ", ".join(f"{sum(column) / len(changes):+.1f}" for column in zip(*changes, strict=True))


def _changes_by(sequence: dict[str, Any], labels: Sequence[str]) -> list[list[float]]:
    """Changes of KG error and rate by each alternative that has a result, in percent."""
    measured = {one["label"]: one for one in (*sequence["variants"], *sequence["alternatives"])}
    pairs = [(measured.get(label), measured.get(label.split(" (")[0])) for label in labels]
    return [
        [
            100 * (other[name] / usual[name] - 1)
            for name in ("kg_error_percent", "rate_order_dropped_bpvf")
        ]
        for other, usual in pairs
        if other and usual and "refused" not in other and "refused" not in usual
    ]


def ranges_of_changes(*labels: str) -> str:
    """The changes by these alternatives on all sequences."""
    sequences = results("paper")["sequences"]
    changes = [change for one in sequences for change in _changes_by(one, labels)]
    errors, rates = zip(*changes, strict=True)
    return f"KG changes by {span(errors, '+.1f')} % and the rate by {span(rates, '+.1f')} %"


def span(values: Iterable[float], form: str) -> str:
    """The smallest and the largest value."""
    numbers = sorted(values)
    return f"{numbers[0]:{form}} to {numbers[-1]:{form}}"


def labeled(variants: Iterable[dict[str, Any]], label: str) -> dict[str, Any]:
    """What was measured of a variant."""
    return next(one for one in variants if one["label"] == label)


def one_step() -> str:
    """KG and q of `pca-q` on samba with one step for all rows, and with constant bits."""
    both = sequence_named("samba")["variants"], results("paper")["printed_preset"]
    usual, constant = (
        f"{significant(one['kg_error_percent'])} % at q = {number(one['rates']['eq13']['q'])}"
        for one in (labeled(variants, "pca-q") for variants in both)
    )
    return (
        f"KG of `pca-q` on samba {usual} with one step of 8 bits, {constant} with 4 constant bits "
        '(`allocation="constant"`)'
    )


def printed_q() -> str:
    """The q and q_a of samba with the preset of the printed rates."""
    preset = results("paper")["printed_preset"]
    pca, few, v2v, blocks = (
        number(labeled(preset, label)["rates"]["eq13"]["q"])
        for label in ("pca", "pca-q", "v2v", "blocks")
    )
    return (
        f"{pca}, {few} and {v2v} with 8 rows of 16, 4 and 10 bits, {blocks} with 2 rows of 4 bits "
        "in each block of 25 frames"
    )


def printed_q_a() -> str:
    """The q_a of samba with the preset of the printed rates."""
    return number(labeled(results("paper")["printed_preset"], "pca-qp")["rates"]["eq13"]["q_a"])


def printed_sums() -> str:
    """The sums of printed rates of samba that differ from the printed sums."""
    printed = {
        (one.q + (one.q_a or 0.0) + one.q_d, one.q_s) for one in printed_rates("samba").values()
    }
    pairs = sorted(pair for pair in printed if abs(pair[0] - pair[1]) > ROUNDING)
    sums, wrong = (", ".join(map(number, column)) for column in zip(*pairs, strict=True))
    return f"{sums} for the printed {wrong}"


ROUNDING = 5e-5
"""Half of the last printed digit."""


def dictionary(label: str, stored: str) -> str:
    """The q_d of a variant on cow, as stored and by Eq. 13."""
    rates = labeled(sequence_named("cow")["variants"], label)["rates"]
    flat = {**rates, **rates["stored"]}
    return f"{number(flat[stored])} on cow, where Eq. 13 counts {number(rates['eq13']['q_d'])}"


def exchange() -> str:
    """What an exchange of anchors gains, and its time."""
    sequences = results("anchors")["sequences"]
    gains = span((-one["kg_change_percent"] for one in sequences), ".0f")
    seconds = span((one["exchange_processor_s"] for one in sequences), ".1f")
    return f"{gains} % less KG than farthest points at equal rate, in {seconds} s of processor time"


RANDOM_ANCHORS = [f"pca-qp (random anchors {number})" for number in (1, 2, 3)]

FIGURES: dict[str, Callable[[], str]] = {
    "centering": partial(ranges_of_changes, "pca-qp (without centering)"),
    "rotation": partial(ranges_of_changes, "blocks (without rotation)"),
    "combinatorial": partial(ranges_of_changes, "pca-qp (combinatorial)"),
    "anchor-bits": partial(ranges_of_changes, "pca-qp (anchors of 16 bits)"),
    "quantized-deltas": partial(ranges_of_changes, "pca-q (quantized deltas)"),
    "random-anchors": partial(ranges_of_changes, *RANDOM_ANCHORS),
    "one-step": one_step,
    "printed-q": printed_q,
    "printed-q-a": printed_q_a,
    "printed-sums": printed_sums,
    "dictionary": partial(dictionary, "pca-qp", "q_d"),
    "dictionaries": partial(dictionary, "blocks", "q_d_per_block"),
    "exchange": exchange,
}
"""Figures in sentences of the pages, by name."""


def large_mesh() -> str:
    """Seconds of the per-mesh variant on meshes of more than 20,000 vertices."""
    one = results("paper")["large_mesh"]
    all_of_them = one["all_frequencies"]
    measured = ", ".join(
        f"{each['n_verts']:,} vertices {each['seconds']:.3g} s" for each in all_of_them["measured"]
    )
    text = (
        f"On a flag of {one['n_verts']:,} vertices one decomposition for {one['n_modes']:,} "
        f"frequencies takes {one['seconds_each']:.3g} s; {one['n_frames']} frames are encoded in "
        f"{one['encode_s']:.3g} s and decoded in {one['decode_s']:.3g} s, with one decomposition "
        f"each (KG {one['kg_error_percent']:.2g} %). "
        f"One decomposition with all frequencies: {measured}; the time grows with "
        f"V^{all_of_them['exponent']:.1f}. "
        + " ".join(each["text"] for each in all_of_them["extrapolated"])
    )
    return source("paper", text, SEPARATE)


def comparison() -> str:
    """README's table: sizes at default options, and rates at equal error against others."""
    header = ("sequence (vertices x frames)", "times smaller than float32", "largest error %",
              "than the paper's best variant", "than FAMC")  # fmt: skip
    rows = [
        (
            f"{one['name']} ({KINDS[one['name']]}, {one['n_verts']} x {one['n_frames']})",
            f"{one['ratio']:.0f}",
            f"{one['max_error_percent']:.2f}",
            *(_percent(one["bd_rates"][name]) for name in ("kg_pca_qp", "kg_famc")),
        )
        for one in results("codecs")["sequences"]
        if one["bd_rates"]["kg_famc"]["percent"] is not None
    ]
    return table(header, rows)


BD_RATES = ("kg_pca_qp", "sted_pca_qp", "kg_famc")


def bd_rates() -> str:
    """The BD-rates of the same table with the errors that they are over."""
    header = ("sequence", "equal KG, `pca-qp`", "equal STED, `pca-qp`", "equal KG, FAMC",
              "equal KG, `pca-qp` with up to 10 % anchors", "equal STED")  # fmt: skip
    names = (*BD_RATES, "kg_more_anchors", "sted_more_anchors")
    rows = [
        (one["name"], *(_percent(one["bd_rates"][name], True) for name in names))
        for one in results("codecs")["sequences"]
    ]
    return source("codecs", table(header, rows))


def _percent(rate: dict[str, Any], with_range: bool = False) -> str:
    if rate["percent"] is None:
        return "-"
    text = f"{rate['percent']:+.1f} %"
    low, high = significant(rate["low_error"]), significant(rate["high_error"])
    return f"{text} ({low} to {high})" if with_range else text


def laplacians() -> str:
    """BD-rates of other Laplacians against the normalized one."""
    header = ("sequence", *(
        f"{name}, equal {error}" for name in OTHER_LAPLACIANS for error in ("KG", "STED")
    ))  # fmt: skip
    rows = []
    for one in results("choices")["sequences"]:
        cells = [
            _bd_text(one["laplacians"][name], one["laplacians"]["normalized"], error)
            for name in OTHER_LAPLACIANS
            for error in ("kg_error_percent", "sted")
        ]
        rows.append((one["name"], *cells))
    return source("choices", table(header, rows))


def corpus_table(make: Callable[[Sequence[dict[str, Any]]], Table]) -> Callable[[], str]:
    """A function for a table of the corpus, without the commit, which the page states once."""

    def text() -> str:
        made = make(results("corpus")["sequences"])
        return table(made.header, made.rows)

    text.__doc__ = make.__doc__
    return text


def corpus_bounds() -> str:
    """Error bounds of the corpus that were not met, and the commit."""
    broken, total = n_broken(results("corpus")["sequences"])
    return source("corpus", f"{total} streams have an error bound; {broken} exceed it.")


OTHER_LAPLACIANS = ("combinatorial", "cotangent")


def _bd_text(
    points: Sequence[dict[str, float]], others: Sequence[dict[str, float]], error: str
) -> str:
    pairs = [[(one["rate_bpvf"], one[error]) for one in each] for each in (points, others)]
    difference = bd_rate(*pairs)
    return difference.reason if difference.percent is None else f"{difference.percent:+.1f} %"


TABLES: dict[str, Callable[[], str]] = {
    "samba-rates": samba_rates,
    "printed-preset": printed_preset,
    "seconds": seconds,
    "anchors": anchors,
    "claims": claims,
    "sweeps": sweeps,
    "claim-rows": claim_rows,
    "entropy": entropy,
    "alternatives": alternatives,
    "large-mesh": large_mesh,
    "comparison": comparison,
    "bd-rates": bd_rates,
    "laplacians": laplacians,
    "corpus-bounds": corpus_bounds,
    **{name: corpus_table(make) for name, make in CORPUS_TABLES.items()},
}
"""Tables of the pages, by name."""

if __name__ == "__main__":
    if sys.argv[1:] == ["--write"]:
        for page in PAGES:
            path = ROOT / page
            path.write_text(with_tables(path.read_text(encoding="utf-8")), encoding="utf-8")
    else:
        for name, make in TABLES.items():
            print(f"{name}: {(make.__doc__ or '').splitlines()[0]}")
        for name, make in FIGURES.items():
            print(f"{name}: {make()}")
