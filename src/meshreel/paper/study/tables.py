"""Tables of results, with the paper's values: Table I (rates), Table II (seconds), and errors."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, TypeVar

from meshreel.paper.study.results import (
    RATE,
    PaperResults,
    extrapolated_basis,
    label_of_result,
    method_of_result,
)
from meshreel.paper.sweeps import ANCHORS, Setting
from meshreel.rendering.documents import NONE, Table, number, scientific, significant
from meshreel.studies.runs import Result

Printed = TypeVar("Printed")

RATES = ("q", "q_a", "q_d", "q_s")


class PrintedRates(NamedTuple):
    """A column of Table I, in bits per vertex and frame; None is a dash in the paper."""

    q: float
    q_a: float | None
    q_d: float
    q_s: float

    @property
    def total(self) -> float:
        """The sum of q, q_a and q_d, which q_s should be."""
        return self.q + (self.q_a or 0.0) + self.q_d


class PrintedSeconds(NamedTuple):
    """A column of Table II: processing and encoding, and reconstruction."""

    encode: float
    decode: float


_HANDSTAND_SERIAL = PrintedRates(0.2893, 0.1600, 0.2799, 0.7292)
_SAMBA_SERIAL = PrintedRates(0.1827, 0.1595, 0.2808, 0.6226)

TABLE_1 = {
    "handstand": {
        "pca": PrintedRates(1.2215, None, 0.2799, 1.5014),
        "pca-q": PrintedRates(0.2893, None, 0.2799, 0.5692),
        "v2v": PrintedRates(0.5783, 0.1600, 0.2799, 1.0182),
        "pca-qs": _HANDSTAND_SERIAL,
        "pca-qp": _HANDSTAND_SERIAL,
        "blocks": PrintedRates(0.4006, 0.1600, 0.1847, 0.7453),
    },
    "samba": {
        "pca": PrintedRates(0.7289, None, 0.2808, 1.0088),
        "pca-q": PrintedRates(0.1827, None, 0.2808, 0.4635),
        "v2v": PrintedRates(0.4362, 0.1595, 0.2808, 0.8761),
        "pca-qs": _SAMBA_SERIAL,
        "pca-qp": _SAMBA_SERIAL,
        "blocks": PrintedRates(0.3057, 0.1595, 0.1498, 0.6155),
    },
}

TABLE_2 = {
    "dinosaur": {
        "pca-q": PrintedSeconds(0.69, 40.63),
        "pca-qs": PrintedSeconds(0.69, 6920.56),
        "pca-qp": PrintedSeconds(0.69, 45.53),
        "blocks": PrintedSeconds(0.06, 37.19),
    },
    "chinchilla": {
        "pca-q": PrintedSeconds(0.17, 4.41),
        "pca-qs": PrintedSeconds(0.17, 476.04),
        "pca-qp": PrintedSeconds(0.10, 4.68),
        "blocks": PrintedSeconds(0.07, 4.22),
        "gft": PrintedSeconds(22.49, 476.04),
    },
    "camel": {
        "pca-q": PrintedSeconds(0.12, 54.27),
        "pca-qs": PrintedSeconds(0.12, 2730.24),
        "pca-qp": PrintedSeconds(0.12, 56.88),
        "blocks": PrintedSeconds(0.06, 51.27),
    },
    "flag": {
        "pca-q": PrintedSeconds(2.38, 2.22),
        "pca-qs": PrintedSeconds(2.38, 2633.36),
        "pca-qp": PrintedSeconds(2.38, 2.37),
        "blocks": PrintedSeconds(0.07, 1.84),
        "gft": PrintedSeconds(7062.21, 2633.36),
    },
    "handstand": {
        "pca-q": PrintedSeconds(0.89, 26.47),
        "pca-qs": PrintedSeconds(0.89, 4736.25),
        "pca-qp": PrintedSeconds(0.89, 28.67),
        "blocks": PrintedSeconds(0.07, 22.12),
        "gft": PrintedSeconds(39557.42, 4736.25),
    },
    "samba": {
        "pca-q": PrintedSeconds(0.87, 24.86),
        "pca-qs": PrintedSeconds(0.87, 4214.55),
        "pca-qp": PrintedSeconds(0.87, 26.17),
        "blocks": PrintedSeconds(0.07, 20.89),
        "gft": PrintedSeconds(37314.55, 4214.55),
    },
}

SHAPES = {
    "handstand": (10002, 175),
    "dinosaur": (20218, 152),
    "samba": (9971, 175),
    "chinchilla": (4307, 84),
    "camel": (21887, 48),
    "flag": (2704, 1000),
}
"""Vertices and frames of the sequences in Table II."""

REMARKS = {
    "flag": "The flag is our own simulation with the vertex count of the paper's Flag (2704 "
    "vertices, 1000 frames): compare its seconds with the printed ones by order of magnitude only.",
    "jumping": "`jumping` is from the same family of captures as the paper's Handstand, with the "
    "same vertex count, but it is another sequence, so no printed values are shown.",
}


def printed_rates(sequence_name: str) -> dict[str, PrintedRates]:
    """Table I by method; empty unless the sequence is one of the paper's."""
    return TABLE_1.get(sequence_name.lower(), {})


def misprints(sequence_name: str) -> str:
    """A sentence about printed q_s that are not the sums of their parts; empty if there are none.

    Rounding of the parts explains a difference of 1.5e-4.
    """
    texts = [
        f"{method} {rates.q_s:.4f} (the sum is {rates.total:.4f})"
        for method, rates in printed_rates(sequence_name).items()
        if abs(rates.q_s - rates.total) > 1.5e-4
    ]
    return f"Printed q_s that are not the sums of their parts: {', '.join(texts)}." if texts else ""


def printed_seconds(sequence_name: str, n_verts: int) -> dict[str, PrintedSeconds]:
    """Table II by method; empty unless the sequence has the name and vertices of the paper's.

    The name may have a suffix, as in "camel-gallop".
    """
    for name, (printed_verts, _) in SHAPES.items():
        if sequence_name.lower().startswith(name) and n_verts == printed_verts:
            return TABLE_2[name]
    return {}


def rate_table(results: PaperResults) -> Table:
    """Table I: rates by Eq. 13 with the printed values, rates as stored, and true rates."""
    printed = printed_rates(results.name)
    header = []
    for name in RATES:
        header += [name, f"{name}, paper"] if printed else [name]
    header += [f"{name} as stored" for name in RATES]
    header += ["q, zero-order entropy", "bpvf of the file", "bpvf, order dropped"]

    def cells(result: Result) -> list[str]:
        rates, paper_values = result["rates"], _printed_for(result, printed)
        values = []
        for name in RATES:
            values.append(rates["eq13"][name])
            values += [getattr(paper_values, name, None)] if printed else []
        values += [rates["stored"][name] for name in RATES]
        return [number(rate) for rate in (*values, rates["q_entropy"], result["rate_bpvf"],
                                          result[RATE])]  # fmt: skip

    title = f"Table I, {results.name}: bits per vertex and frame"
    return _table(title, header, results.variants, cells)


def _table(
    title: str,
    header: Sequence[str],
    results: Sequence[Result],
    cells: Callable[[Result], list[str]],
) -> Table:
    """A table with a row for each variant; failed ones have no values."""
    rows = [
        (
            label_of_result(result),
            *(["refused"] * len(header) if "refused" in result else cells(result)),
        )
        for result in results
    ]
    return Table(title, ("variant", *header), tuple(rows))


def _printed_for(result: Result, printed: Mapping[str, Printed]) -> Printed | None:
    """The printed values of a variant; the paper uses 1 % anchors."""
    setting = result["identity"]["setting"]
    is_default = setting["anchors"] in (0, ANCHORS) and not setting["choices"]
    return printed.get(method_of_result(result)) if is_default else None


def quality_table(results: PaperResults) -> Table:
    """The settings of the variants and the errors of their streams."""
    header = ("modes", "bits", "bpvf, order dropped", "KG error %", "STED", "NMSVE, mean",
              "largest error %", "normals, mean °")  # fmt: skip

    def cells(result: Result) -> list[str]:
        quality = result["quality"]
        return [
            _modes(result),
            str(result["identity"]["setting"]["bits"]),
            *_rate_and_errors(result),
            significant(quality["max_error_percent"]),
            significant(quality["normal_angle_mean_deg"]),
        ]

    title = f"Errors of the same streams, {results.name}"
    return _table(title, header, results.variants, cells)


def _rate_and_errors(result: Result) -> list[str]:
    """Rate without order, KG error, STED and NMSVE."""
    quality = result["quality"]
    return [
        number(result[RATE]),
        significant(quality["kg_error_percent"]),
        significant(quality["sted"]),
        scientific(quality["nmsve_mean"]),
    ]


def alternatives_table(results: PaperResults) -> Table:
    """Rates and errors of variants with one changed choice, each below its default."""
    header = ("q as stored", "q_a as stored", "bpvf, order dropped", "KG error %", "STED",
              "NMSVE, mean")  # fmt: skip

    def cells(result: Result) -> list[str]:
        stored = result["rates"]["stored"]
        return [number(stored["q"]), number(stored["q_a"]), *_rate_and_errors(result)]

    methods = {method_of_result(result) for result in results.alternatives}
    defaults = [result for result in results.variants if label_of_result(result) in methods]
    ordered = sorted((*defaults, *results.alternatives), key=method_of_result)
    return _table(f"What the paper leaves open, {results.name}", header, ordered, cells)


def seconds_table(results: PaperResults) -> Table:
    """Table II: processor seconds of one thread to process and encode, and to reconstruct."""
    printed = printed_seconds(results.name, results.sequence["n_verts"])
    header = ["variant", "processing and encoding, s", "reconstruction, s"]
    if printed:
        header += ["paper: processing and encoding, s", "paper: reconstruction, s"]
    rows: list[list[str]] = []
    for result in results.variants:
        is_graph, label = method_of_result(result) == "gft", label_of_result(result)
        if "refused" in result:
            rows.append([label, *["refused"] * (len(header) - 1)])
        else:
            if is_graph:
                label = f"gft, {_modes(result)} frequencies"
            seconds = [result["seconds"][part] for part in PHASES]
            name = f"{label}, decomposed once" if is_graph else label
            # The paper's values of `gft` belong to the row with all frequencies.
            paper_values = None if is_graph else _printed_for(result, printed)
            rows.append([name, *map(significant, seconds), *_printed_seconds(paper_values)])
            if is_graph and results.decompositions is not None:
                costs, n_more = results.decompositions, results.sequence["n_frames"] - 1
                cost = costs["processor_seconds_each"]
                cells = [f"{once + n_more * cost:.0f}" for once in seconds]
                rows.append([f"{label}, decomposed for each frame *", *cells])
        # This row compares with the paper; it has no values if they were not measured. Both phases
        # compute as many decompositions.
        full, paper_values = results.full_basis, printed.get("gft")
        if is_graph and (full is not None or paper_values is not None):
            cells = [NONE] * 2
            if full is not None:
                shape = results.sequence["n_verts"], results.sequence["n_frames"]
                cells = 2 * [f"{extrapolated_basis(full, *shape).processor_seconds:.0f}"]
            name = "gft, all frequencies, decomposed for each frame *"
            rows.append([name, *cells, *_printed_seconds(paper_values)])
    padded = ((*row, *[NONE] * len(header))[: len(header)] for row in rows)
    return Table(f"Table II, {results.name}", tuple(header), tuple(padded))


PHASES = ("encode_processor", "decode_processor")


def _printed_seconds(printed: PrintedSeconds | None) -> list[str]:
    return [NONE, NONE] if printed is None else [f"{seconds:.2f}" for seconds in printed]


def _modes(result: Result) -> str:
    counts = sorted(set(result["stream"]["n_modes"]))
    return str(counts[0]) if len(counts) == 1 else f"{counts[0]}..{counts[-1]}"


def refusals(results: PaperResults) -> list[str]:
    """A sentence for each variant without results."""
    return [
        f"`{label_of_result(result)}` refused {results.name}: {result['refused']}"
        for result in results.variants
        if "refused" in result
    ]


def settings_line(setting: Setting) -> str:
    """A setting as text."""
    modes = "default number of" if setting.n_modes is None else str(setting.n_modes)
    words = [f"{modes} modes", f"{setting.bits} bits"]
    if setting.anchors:
        words.append(f"{100 * setting.anchors:g} % anchors")
    words += [setting.options()["choices"]] if "choices" in setting.options() else []
    if setting.block_frames:
        words.append(f"blocks of {setting.block_frames} frames")
    return ", ".join(words)
