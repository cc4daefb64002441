"""Tables of results: Table I (rates), Table II (seconds), and errors."""

from collections.abc import Mapping, Sequence
from typing import TypeVar

from meshreel.evaluation.runs.store import Result
from meshreel.paper.study.printed import (
    PrintedRates,
    PrintedSeconds,
    printed_rates,
    printed_seconds,
)
from meshreel.paper.study.results import PaperResults, label_of_result, method_of_result
from meshreel.paper.sweeps import ANCHORS, Setting
from meshreel.rendering.documents import NONE, Table, number, scientific, significant

Printed = TypeVar("Printed")

RATES = ("q", "q_a", "q_d", "q_s")
EXTRA_COLUMNS = {"q": ("q_fixed", "q, fixed length"), "q_a": ("q_a_printed", "q_a at 16 bits")}
"""Key and heading of columns with an alternative count of the same part."""


def rate_table(results: PaperResults) -> Table:
    """Table I: the paper's count, its printed values if any, and true rates."""
    printed = printed_rates(results.name)
    header = ["variant"]
    for name in RATES:
        header.append(name)
        header += [EXTRA_COLUMNS[name][1]] if name in EXTRA_COLUMNS else []
        header += [f"{name}, paper"] if printed else []
    header += ["q_d as stored", "bpvf of the file", "bpvf, order dropped"]
    rows = []
    for result in results.variants:
        row = [label_of_result(result)]
        row += _rate_cells(result, _printed_for(result, printed), bool(printed))
        rows.append(_pad(row, result, len(header)))
    return Table(f"Table I, {results.name}: bits per vertex and frame", tuple(header), tuple(rows))


def _printed_for(result: Result, printed: Mapping[str, Printed]) -> Printed | None:
    """The printed values of a variant; the paper uses 1 % anchors."""
    setting = result["identity"]["setting"]
    is_default = setting["anchors"] in (0, ANCHORS) and not setting["choices"]
    return printed.get(method_of_result(result)) if is_default else None


def _rate_cells(
    result: Result, printed: PrintedRates | None, has_printed_columns: bool
) -> list[str]:
    if "refused" in result:
        return []
    count, cells = result["paper_count"], []
    for name in RATES:
        cells.append(number(count[name]))
        if name in EXTRA_COLUMNS:
            cells.append(number(count[EXTRA_COLUMNS[name][0]]))
        if has_printed_columns:
            cells.append(number(getattr(printed, name, None)))
    rates = count["q_d_as_stored"], result["rate_bpvf"], result["rate_order_dropped_bpvf"]
    return cells + [number(rate) for rate in rates]


def quality_table(results: PaperResults) -> Table:
    """The settings of the variants and the errors of their streams."""
    header = ("variant", "modes", "bits", "bpvf, order dropped", "KG error %", "STED",
              "NMSVE, mean", "largest error %", "normals, mean °")  # fmt: skip
    rows = []
    for result in results.variants:
        row = [label_of_result(result)]
        if "refused" not in result:
            quality = result["quality"]
            row += [
                _modes(result),
                str(result["identity"]["setting"]["bits"]),
                number(result["rate_order_dropped_bpvf"]),
                significant(quality["kg_error_percent"]),
                significant(quality["sted"]),
                scientific(quality["nmsve_mean"]),
                significant(quality["max_error_percent"]),
                significant(quality["normal_angle_mean_deg"]),
            ]
        rows.append(_pad(row, result, len(header)))
    return Table(f"Errors of the same streams, {results.name}", header, tuple(rows))


def alternatives_table(results: PaperResults) -> Table:
    """Rates and errors of variants with one changed choice, each below its default."""
    header = ("variant", "q", "q_a", "bpvf, order dropped", "KG error %", "STED",
              "NMSVE, mean")  # fmt: skip
    rows = []
    compared = {method_of_result(result) for result in results.alternatives}
    defaults = [result for result in results.variants if label_of_result(result) in compared]
    for result in (*defaults, *results.alternatives):
        row = [label_of_result(result)]
        if "refused" not in result:
            quality, count = result["quality"], result["paper_count"]
            row += [
                number(count["q"]),
                number(count["q_a"]),
                number(result["rate_order_dropped_bpvf"]),
                significant(quality["kg_error_percent"]),
                significant(quality["sted"]),
                scientific(quality["nmsve_mean"]),
            ]
        rows.append(_pad(row, result, len(header)))
    rows.sort(key=lambda row: row[0].split(" ")[0])
    return Table(f"What the paper leaves open, {results.name}", header, tuple(rows))


def seconds_table(results: PaperResults) -> Table:
    """Table II: seconds to process and encode, and to reconstruct, by both clocks."""
    printed = printed_seconds(results.name, results.sequence["n_verts"])
    header = ["variant", "processing and encoding, s", "processing and encoding, processor s",
              "reconstruction, s", "reconstruction, processor s"]  # fmt: skip
    if printed:
        header += ["paper: processing and encoding, s", "paper: reconstruction, s"]
    rows = []
    for result in results.variants:
        method = method_of_result(result)
        label = "gft, decomposed once" if method == "gft" else label_of_result(result)
        row = [label, *_seconds_cells(result)]
        if printed and "refused" not in result:
            # The paper decomposes for each frame, so its values belong to the row below.
            row += _printed_seconds(_printed_for(result, printed) if method != "gft" else None)
        rows.append(_pad(row, result, len(header)))
        extrapolated = _decomposed_each(result, results)
        if extrapolated:
            row = ["gft, decomposed for each frame *", *extrapolated]
            rows.append(tuple(row + (_printed_seconds(printed.get("gft")) if printed else [])))
    return Table(f"Table II, {results.name}", tuple(header), tuple(rows))


def _seconds_cells(result: Result) -> list[str]:
    if "refused" in result:
        return []
    parts = ("encode", "encode_processor", "decode", "decode_processor")
    return [significant(result["seconds"][part]) for part in parts]


def _decomposed_each(result: Result, results: PaperResults) -> list[str]:
    """Extrapolated seconds with a decomposition for each frame; empty if not available."""
    if method_of_result(result) != "gft" or "refused" in result or results.decompositions is None:
        return []
    n_extra, timing = results.sequence["n_frames"] - 1, results.decompositions
    extra = n_extra * timing["seconds_each"], n_extra * timing["processor_seconds_each"]
    return [
        f"{result['seconds'][part + clock] + seconds:.0f}"
        for part in ("encode", "decode")
        for clock, seconds in zip(("", "_processor"), extra, strict=True)
    ]


def _printed_seconds(printed: PrintedSeconds | None) -> list[str]:
    if printed is None:
        return [NONE, NONE]
    return [f"{printed.encode:.2f}", f"{printed.decode:.2f}"]


def _modes(result: Result) -> str:
    counts = sorted(set(result["stream"]["n_modes"]))
    return str(counts[0]) if len(counts) == 1 else f"{counts[0]}..{counts[-1]}"


def _pad(row: Sequence[str], result: Result, length: int) -> tuple[str, ...]:
    """Extend a row to its full length; a failed variant has no values."""
    mark = "refused" if "refused" in result else NONE
    return (*row, *[mark] * (length - len(row)))


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
