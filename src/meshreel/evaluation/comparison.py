"""Comparison of codecs at equal error: results of a sequence, their tables, plots and report."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from meshreel.evaluation.peers import Peer, why_missing
from meshreel.rendering.documents import NONE, Part, Picture, Table, bullets, significant
from meshreel.rendering.plots import blank_figure, save_figure
from meshreel.runtime.progress import Progress
from meshreel.studies.plots import codec_of, draw_envelopes
from meshreel.studies.rate_distortion import Point, RateDifference, bd_rate, rate_at_error
from meshreel.studies.runs import (
    Outcome,
    Result,
    Run,
    file_name,
    finite,
    usable,
    without_identities,
)
from meshreel.studies.study import Subject
from meshreel.studies.timing import machine_facts

RECORDED = " (recorded)"
"""Suffix of codecs that were measured elsewhere."""

Measure = Callable[[Progress], dict[str, Any]]
"""Returns the figures of a run, without the machine."""

METHOD, PEER = "method", "peer"
"""Kinds of runs."""


@dataclass(frozen=True)
class Error:
    """An error by which codecs are compared."""

    key: str
    """Its key in the quality of a result."""
    name: str
    """Its name in sentences."""
    axis: str
    """Name and unit, for plots."""
    levels: tuple[float, ...] = ()
    """Errors at which rates are listed."""
    unit: str = " %"
    """Follows a level."""


TITLE = "meshreel compared with other codecs: rate, distortion, time"

RATE_NAME = "bits per vertex and frame"

ERRORS = (
    Error("kg_error_percent", "KG error", "KG error (%)", (0.5, 0.2, 0.1)),
    Error("sted", "STED", "STED", (0.05, 0.02, 0.01), ""),
    Error("max_error_percent", "largest error", "largest error (% of the diagonal)"),
)
"""Errors at which codecs are compared."""

COLUMNS = {
    "bpvf": "rate_bpvf",
    "KG error %": "quality.kg_error_percent",
    "STED": "quality.sted",
    "largest error %": "quality.max_error_percent",
    "encode, s": "seconds.encode",
    "decode, s": "seconds.decode",
}
"""Headings of the table of all runs, with the keys of a result separated by dots."""

METHODOLOGY = (
    "**Rate.** All bits, including connectivity and headers, per vertex and frame. Codecs need "
    "not preserve the order of vertices and faces.",
    "**Connectivity.** For codecs that do not code faces, the bytes and seconds of meshreel's "
    "coded connectivity are added, once per sequence. These codecs receive the vertices in the "
    "order of the coded connectivity, or in the original order if that is smaller in total "
    "with the order stored. Draco codes the connectivity in every frame.",
    "**Errors.** Distance of every vertex from its original. Draco's vertex order follows from "
    "the faces alone; it is reconstructed outside the timing and not counted. Draco drops "
    "degenerate and repeated faces.",
    "**BD-rate.** Mean difference of log rate over log error in the common range of both envelopes "
    "(in parentheses), by piecewise cubic interpolation; -50 % is half the rate. Nothing is "
    "extrapolated.",
    "**Seconds.** Wall clock in one process, from arrays in memory to bytes in memory and back, "
    "with the default number of threads of each codec; the median of three runs if one takes less "
    "than two seconds.",
)


@dataclass(frozen=True)
class CodecResults:
    """All results of one sequence."""

    slug: str
    """Prefix of the names of its plots."""
    sequence: dict[str, Any]
    """Name, shape and hash."""
    measured: list[Result] = field(default_factory=list)
    """Our methods, then peers."""
    recorded: list[Result] = field(default_factory=list)
    """Measured elsewhere, on a sequence with the same name and shape."""

    @property
    def name(self) -> str:
        """The name of the sequence in tables and plots."""
        return str(self.sequence["name"]) or self.slug

    @property
    def methods(self) -> list[str]:
        """Our methods with results."""
        kinds = {r["codec"]: r["identity"]["setting"]["kind"] for r in usable(self.measured)}
        return [codec for codec, kind in kinds.items() if kind == METHOD]

    @property
    def points(self) -> list[Result]:
        """Results with figures: methods, then peers, then recorded codecs."""
        return [*usable(self.measured), *self.recorded]

    def curves(self, error: Error) -> dict[str, list[Point]]:
        """Points (rate, error above 0) by codec."""
        curves: dict[str, list[Point]] = {}
        for result in self.points:
            if value := result["quality"].get(error.key):
                curves.setdefault(result["codec"], []).append((result["rate_bpvf"], value))
        return {codec: sorted(points) for codec, points in curves.items()}

    def as_dict(self) -> dict[str, Any]:
        """All results in plain types."""
        measured = without_identities(self.measured)
        return {**self.sequence, "measured": measured, "recorded": self.recorded}


@dataclass(frozen=True)
class Comparison:
    """A study that compares codecs."""

    runs: Callable[[Any], list[Run]]
    """Returns the runs of a sequence, our methods first."""
    peers: Sequence[Peer]
    """The report lists those whose package is missing."""
    recorded: Sequence[Result] = ()
    """From `read_recorded`; points of other sequences are ignored."""
    program: str = "meshreel evaluate"
    introduction: str = "Created by"
    title: str = TITLE

    def plan(self, sequence: Any) -> dict[str, list[Run]]:
        """All runs, in one group."""
        return {"measured": self.runs(sequence)}

    def collect(
        self, subject: Subject, groups: Mapping[str, list[Result]], progress: Progress
    ) -> CodecResults:
        """The results of all runs."""
        sequence = subject.store.sequence
        recorded = matching(self.recorded, sequence)
        return CodecResults(subject.slug, sequence, groups["measured"], recorded)

    def drawings(
        self, subject: Subject, results: CodecResults, folder: Path
    ) -> Iterator[Callable[[], Picture]]:
        """Functions that each draw a plot of rate and one error, if there are points."""
        for error in ERRORS:
            if curves := shown_curves(results.curves(error)):
                yield partial(draw_curves, results, error, curves, folder)

    def notes(self, measured: Sequence[CodecResults]) -> list[str]:
        """Missing packages, and sequences without recorded points."""
        unrecorded = [
            f"no recorded row matches {results.sequence['name'] or 'a sequence without a name'} "
            f"with {results.sequence['n_verts']} vertices (n) and {results.sequence['n_frames']} "
            "frames (k)"
            for results in measured
            if self.recorded and not results.recorded
        ]
        return why_missing(self.peers) + unrecorded

    def preface(self, measured: Sequence[CodecResults]) -> list[Part]:
        """The notes."""
        notes = self.notes(measured)
        return ["## Not measured", bullets(notes)] if notes else []

    def section(self, results: CodecResults, pictures: Sequence[Picture]) -> list[Part]:
        """Plots and tables of a sequence."""
        parts = [*pictures, *equal_error_tables(results)]
        refused = refusals_of(results)
        parts += [bullets(refused)] if refused else []
        return [*parts, runs_table(results)]

    def appendix(self) -> list[Part]:
        """The methodology, and the codecs."""
        available = [peer for peer in self.peers if peer.is_available]
        lines = [f"`{peer.name}`: {peer.summary}" for peer in available]
        parts: list[Part] = ["## How it was measured", bullets(METHODOLOGY)]
        return [*parts, "## Other codecs", bullets(lines)] if lines else parts


def matching(points: Iterable[Result], sequence: Mapping[str, Any]) -> list[Result]:
    """The points of the sequence with this name, vertex count and frame count."""
    shape = {name: sequence[name] for name in ("name", "n_verts", "n_frames")}
    return [point for point in points if point["sequence"] == shape]


def draw_curves(
    results: CodecResults, error: Error, curves: Mapping[str, Sequence[Point]], folder: Path
) -> Picture:
    """Draw the curves of rate and one error."""
    figure = blank_figure(9.5, 5.6)
    draw_envelopes(figure.add_subplot(), curves, error.axis, RATE_NAME)
    path = folder / f"{results.slug}-{file_name(error.name)}.png"
    save_figure(figure, path, overwrite=True)
    caption = (
        "Total rate without vertex order. A point is a stream; a line connects the Pareto-optimal "
        "points of a codec. Lossless streams do not appear on a log axis of errors."
    )
    if any(codec.endswith(RECORDED) for codec in curves):
        caption += (
            " Dashed: recorded elsewhere; recorded points of codecs that were measured here appear "
            "only in the tables."
        )
    return Picture(path, f"Rate and {error.name}, {results.name}", caption, 1)


def shown_curves(curves: Mapping[str, Sequence[Point]]) -> dict[str, Sequence[Point]]:
    """The curves without recorded ones of codecs that were measured here."""
    measured = {codec_of(codec) for codec in curves if not codec.endswith(RECORDED)}
    return {
        codec: points
        for codec, points in curves.items()
        if not codec.endswith(RECORDED) or codec_of(codec) not in measured
    }


def equal_error_tables(results: CodecResults) -> list[Part]:
    """Tables of rates at equal error, BD-rates, lossless codecs, and seconds."""
    parts: list[Part] = [
        rate_table(results),
        "'-': the points of the codec do not enclose this error.",
    ]
    for error in ERRORS:
        parts += bd_rate_parts(results, error)
    lossless = lossless_table(results)
    return [*parts, *([lossless] if lossless else []), seconds_table(results)]


def rate_table(results: CodecResults) -> Table:
    """Rates at fixed errors, interpolated on each lower envelope."""
    columns = [(error, level) for error in ERRORS for level in error.levels]
    curves = {error: results.curves(error) for error in ERRORS}
    rows = []
    for codec in dict.fromkeys(codec for group in curves.values() for codec in group):
        rates = [rate_at_error(curves[error].get(codec, []), level) for error, level in columns]
        if any(rate is not None for rate in rates):
            rows.append((codec, *map(significant, rates)))
    rate_name = RATE_NAME.capitalize()
    headings = (f"{error.name} {level:g}{error.unit}" for error, level in columns)
    return Table(f"{rate_name} at equal error, {results.name}", ("codec", *headings), tuple(rows))


def bd_rate_parts(results: CodecResults, error: Error) -> list[Part]:
    """BD-rates of our methods relative to all other codecs, and the codecs without one."""
    curves = results.curves(error)
    methods = [name for name in results.methods if name in curves]
    rows: list[tuple[str, ...]] = []
    excluded: dict[str, list[str]] = {}
    for codec in curves:
        others = [name for name in methods if name != codec]
        differences = {name: bd_rate(curves[name], curves[codec]) for name in others}
        if any(difference.percent is not None for difference in differences.values()):
            rows.append((codec, *(bd_text(differences.get(name)) for name in methods)))
        elif differences and codec not in methods:
            excluded.setdefault(differences[others[0]].reason, []).append(codec)
    title = f"BD-rate at equal {error.name}, {results.name}: each column relative to the row"
    parts: list[Part] = [Table(title, ("codec", *methods), tuple(rows))] if rows else []
    if excluded:
        texts = (f"{', '.join(codecs)} ({reason})" for reason, codecs in excluded.items())
        parts.append(f"Not compared at equal {error.name}: {'; '.join(texts)}.")
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
    rows = [
        (result["codec"], *map(significant, (result["rate_bpvf"], *_seconds(result))))
        for result in results.points
        if result["quality"].get("max_error_percent") == 0
    ]
    header = ("codec", RATE_NAME, "encode, s", "decode, s")
    return Table(f"Lossless, {results.name}", header, tuple(rows)) if rows else None


def _seconds(result: Result) -> tuple[float, float]:
    return result["seconds"]["encode"], result["seconds"]["decode"]


def seconds_table(results: CodecResults) -> Table:
    """Range of seconds over the settings of each codec, and the lowest frames per second."""
    runs: dict[str, list[tuple[float, float]]] = {}
    for result in usable(results.measured):
        runs.setdefault(result["codec"], []).append(_seconds(result))
    rows = []
    for codec, pairs in runs.items():
        cells = [codec, str(len(pairs))]
        for seconds in zip(*pairs, strict=True):
            ends = dict.fromkeys(map(significant, (min(seconds), max(seconds))))
            rate = results.sequence["n_frames"] / max(seconds)
            cells += [" to ".join(ends), significant(rate)]
        rows.append(tuple(cells))
    header = ("codec", "settings", "encode, s", "frames/s, slowest", "decode, s",
              "frames/s, slowest")  # fmt: skip
    return Table(f"Seconds, {results.name}", header, tuple(rows))


def runs_table(results: CodecResults) -> Table:
    """Every measured point."""
    rows = [
        (
            f"{result['codec']} {result['params']}".strip(),
            str(result["size_bytes"]),
            *(_cell(result, keys) for keys in COLUMNS.values()),
        )
        for result in usable(results.measured)
    ]
    header = ("codec and setting", "bytes", *COLUMNS)
    return Table(f"All runs, {results.name}", header, tuple(rows))


def _cell(result: Result, keys: str) -> str:
    value: Any = result
    for key in keys.split("."):
        value = value.get(key)
    return significant(value)


def refusals_of(results: CodecResults) -> tuple[str, ...]:
    """One line for each codec and reason of failed runs."""
    settings_of: dict[tuple[str, str], list[str]] = {}
    for result in results.measured:
        if "refused" in result:
            settings = settings_of.setdefault((result["codec"], result["refused"]), [])
            settings.append(result["params"])
    return tuple(
        f"`{codec}` has no figures for {results.name} "
        f"({', '.join(settings) or 'its one setting'}): {reason}"
        for (codec, reason), settings in settings_of.items()
    )


def method_run(method: str, options: dict[str, Any], measure: Measure, **context: Any) -> Run:
    """A run of one of our methods with options of `meshreel.encode`; each tune is a codec.

    Its figures depend on `context` besides the options.
    """
    tune = options.get("tune", "visual")
    label = method if tune == "visual" else f"{method}-{tune}"
    names = {"n_modes": "modes", "block_frames": "frames"}
    params = " ".join(f"{names.get(name, name)} {value}" for name, value in options.items())
    setting = {"kind": METHOD, "method": method, "options": options, **context}
    return codec_run(label, params, setting, measure)


def peer_run(peer: Peer, params: str, measure: Measure, **context: Any) -> Run:
    """A run of another codec; its figures depend on `context`."""
    codec = {"codec": peer.name, "summary": peer.summary, "version": peer.version}
    setting = {"kind": PEER, **codec, **context}
    return codec_run(peer.name, params, setting, measure, is_foreign=True)


def codec_run(
    codec: str,
    params: str,
    setting: dict[str, Any],
    measure: Measure,
    *,
    is_foreign: bool = False,
) -> Run:
    """A run of a codec; it records the machine."""
    name = f"{codec} {params}".strip()
    return Run(
        name=name,
        key=file_name(name),
        setting=setting,
        measure=lambda progress: Outcome(finite({**measure(progress), "machine": machine_facts()})),
        facts={"codec": codec, "params": params},
        is_foreign=is_foreign,
    )
