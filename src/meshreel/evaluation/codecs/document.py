"""The report of the comparison of codecs."""

from collections.abc import Sequence

from meshreel.evaluation.codecs.peers.protocol import Peer
from meshreel.evaluation.codecs.results import ERRORS, RECORDED, CodecResults
from meshreel.evaluation.pipeline import Measured
from meshreel.evaluation.rate_distortion import RateDifference, bd_rate, rate_at_error
from meshreel.evaluation.report import codecs_document, sequence_opening
from meshreel.evaluation.runs.store import Result, done
from meshreel.rendering.documents import (
    NONE,
    Bullets,
    Document,
    Paragraph,
    Part,
    Picture,
    Table,
    significant,
)

TITLE = "meshreel compared with other codecs: rate, distortion, time"

METHODOLOGY = (
    "**Rate.** All bits, including connectivity and headers, per vertex and frame. Codecs need not "
    "preserve the order of vertices and faces.",
    "**Connectivity.** For codecs that do not code faces, the bytes and seconds of meshreel's "
    "coded connectivity are added, once per sequence. These codecs receive the vertices in the "
    "order of the coded connectivity, or in the original order if that is smaller in total with "
    "the order stored. Draco codes the connectivity in every frame.",
    "**Errors.** Distance of every vertex from its original. Draco's vertex order follows from the "
    "faces alone; it is reconstructed outside the timing and not counted. Draco drops degenerate "
    "and repeated faces.",
    "**Seconds.** Wall clock in one process, from arrays in memory to bytes in memory and back, "
    "with the default number of threads of each codec; the median of three runs if one takes less "
    "than two seconds.",
    "**BD-rate.** Mean difference of log rate over log error in the common range of both envelopes "
    "(in parentheses), by piecewise cubic interpolation; -50 % is half the rate. Nothing is "
    "extrapolated.",
)

KG_LEVELS = (0.5, 0.2, 0.1)  # percent

STED_LEVELS = (0.05, 0.02, 0.01)

COMPARED = {"kg_error_percent": "KG error", "sted": "STED", "max_error_percent": "largest error"}


def codec_document(
    measured: Measured[CodecResults], peers: Sequence[Peer], notes: Sequence[str], command: str
) -> Document:
    """Build the report; see `codecs_document` for the parameters."""
    return codecs_document(
        TITLE, command, measured, _sequence_parts, methodology=METHODOLOGY, peers=peers, notes=notes
    )


def _sequence_parts(results: CodecResults, pictures: Sequence[Picture]) -> list[Part]:
    parts: list[Part] = [
        *sequence_opening(results.name, results.sequence),
        *pictures,
        rate_table(results),
        Paragraph("'-': the points of the codec do not enclose this error."),
    ]
    parts += [part for error in COMPARED for part in bd_rate_parts(results, error)]
    lossless = lossless_table(results)
    parts += [lossless] if lossless else []
    parts += [seconds_table(results)]
    refused = refusals_of(results.measured, results.name)
    parts += [Bullets(refused)] if refused else []
    return [*parts, runs_table(results)]


def rate_table(results: CodecResults) -> Table:
    """Bits per vertex and frame at fixed errors, interpolated on each lower envelope."""
    curves = {error: results.curves(error) for error in ("kg_error_percent", "sted")}
    columns = [("kg_error_percent", level) for level in KG_LEVELS]
    columns += [("sted", level) for level in STED_LEVELS]
    header = ("codec", *(f"KG {level:g} %" for level in KG_LEVELS),
              *(f"STED {level:g}" for level in STED_LEVELS))  # fmt: skip
    rows = []
    for label in dict.fromkeys(label for group in curves.values() for label in group):
        rates = [rate_at_error(curves[error].get(label, []), level) for error, level in columns]
        if any(rate is not None for rate in rates):
            rows.append((label, *map(significant, rates)))
    title = f"Bits per vertex and frame at equal error, {results.name}"
    return Table(title, header, tuple(rows))


def bd_rate_parts(results: CodecResults, error: str) -> list[Part]:
    """BD-rates of our methods relative to all other codecs, and the codecs without one."""
    curves = results.curves(error)
    methods = [name for name in results.methods if name in curves]
    rows: list[tuple[str, ...]] = []
    excluded: dict[str, list[str]] = {}
    for label in curves:
        others = [name for name in methods if name != label]
        differences = {name: bd_rate(curves[name], curves[label]) for name in others}
        if any(difference.percent is not None for difference in differences.values()):
            rows.append((label, *(bd_text(differences.get(name)) for name in methods)))
        elif differences and label not in methods:
            excluded.setdefault(differences[others[0]].reason, []).append(label)
    title = f"BD-rate at equal {COMPARED[error]}, {results.name}: each column relative to the row"
    parts: list[Part] = [Table(title, ("codec", *methods), tuple(rows))] if rows else []
    if excluded:
        texts = (f"{', '.join(labels)} ({reason})" for reason, labels in excluded.items())
        parts.append(Paragraph(f"Not compared at equal {COMPARED[error]}: {'; '.join(texts)}."))
    return parts


def bd_text(difference: RateDifference | None) -> str:
    """Text such as "-62.3 % (0.1 to 1.5)", or the reason for its absence; a dash for None."""
    if difference is None:
        return NONE
    if difference.percent is None:
        return difference.reason
    low, high = significant(difference.low_error), significant(difference.high_error)
    return f"{difference.percent:+.1f} % ({low} to {high})"


def lossless_table(results: CodecResults) -> Table | None:
    """Rates and seconds of lossless codecs; None without any."""
    rows: list[tuple[str, ...]] = [
        (r["codec"], significant(r["rate_bpvf"]), *_seconds(r))
        for r in done(results.measured)
        if r["quality"]["max_error_percent"] == 0
    ]
    rows += [
        (p.codec + RECORDED, significant(p.rate_bpvf), significant(p.encode_s),
         significant(p.decode_s))
        for p in results.recorded
        if p.quality["max_error_percent"] == 0
    ]  # fmt: skip
    header = ("codec", "bits per vertex and frame", "encode, s", "decode, s")
    return Table(f"Lossless, {results.name}", header, tuple(rows)) if rows else None


def seconds_table(results: CodecResults) -> Table:
    """Range of seconds over the settings of each codec, and the lowest frames per second."""
    header, rows = seconds_rows(results.measured, results.sequence["n_frames"])
    return Table(f"Seconds, {results.name}", header, rows)


def seconds_rows(
    measured: Sequence[Result], n_frames: int
) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Header and rows of a table of seconds by codec."""
    rows = []
    for codec in dict.fromkeys(result["codec"] for result in done(measured)):
        runs = [result for result in done(measured) if result["codec"] == codec]
        row = [codec, str(len(runs))]
        for part in ("encode", "decode"):
            seconds = [result["seconds"][part] for result in runs]
            row += [_range(seconds), significant(n_frames / max(seconds))]
        rows.append(tuple(row))
    header = ("codec", "settings", "encode, s", "frames/s, slowest", "decode, s",
              "frames/s, slowest")  # fmt: skip
    return header, tuple(rows)


def runs_table(results: CodecResults) -> Table:
    """Every measured point."""
    rows = []
    for result in done(results.measured):
        errors = [significant(result["quality"][error]) for error in ERRORS]
        label = f"{result['codec']} {result['params']}".strip()
        row = (label, str(result["size_bytes"]), significant(result["rate_bpvf"]), *errors)
        rows.append((*row, *_seconds(result)))
    header = ("codec and setting", "bytes", "bpvf", "KG error %", "STED", "largest error %",
              "encode, s", "decode, s")  # fmt: skip
    return Table(f"All runs, {results.name}", header, tuple(rows))


def refusals_of(measured: Sequence[Result], name: str) -> tuple[str, ...]:
    """One line for each codec and reason of failed runs on the sequence of this name."""
    settings_of: dict[tuple[str, str], list[str]] = {}
    for result in measured:
        if "refused" in result:
            settings = settings_of.setdefault((result["codec"], result["refused"]), [])
            settings.append(result["params"])
    return tuple(
        f"`{codec}` has no figures for {name} "
        f"({', '.join(settings) or 'its one setting'}): {reason}"
        for (codec, reason), settings in settings_of.items()
    )


def _seconds(result: Result) -> tuple[str, str]:
    return significant(result["seconds"]["encode"]), significant(result["seconds"]["decode"])


def _range(seconds: Sequence[float]) -> str:
    low, high = significant(min(seconds)), significant(max(seconds))
    return low if low == high else f"{low} to {high}"
