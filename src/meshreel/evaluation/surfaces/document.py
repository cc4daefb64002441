"""The report of the comparison of codecs on sequences whose faces change."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from meshreel.evaluation.codecs.document import bd_text, refusals_of, seconds_rows
from meshreel.evaluation.codecs.peers.protocol import Peer
from meshreel.evaluation.pipeline import Measured
from meshreel.evaluation.rate_distortion import Point, bd_rate, rate_at_error
from meshreel.evaluation.report import codecs_document, sequence_opening
from meshreel.evaluation.runs.store import Result, done, without_identities
from meshreel.rendering.documents import (
    Bullets,
    Document,
    Paragraph,
    Part,
    Picture,
    Table,
    significant,
)

TITLE = "meshreel compared with Draco on changing faces: rate, distance between surfaces, time"

METHODOLOGY = (
    "**Data.** Positions and faces, without attributes and tracks. Codecs need not preserve the "
    "order of vertices and faces.",
    "**Rate.** All bits, including connectivity and headers, per frame. Draco codes each frame for "
    "itself; 4 bytes per frame for its length are counted.",
    "**Distance.** Root mean square over samples of equal density on one surface, of the distance "
    "to the closest point of the other surface; the worse direction, in percent of the diagonal of "
    "the compared frames. PSNR is 10 log10(3 p^2 / mse) with the longest side p of their bounding "
    "box, D1 and D2 as V-DMC defines them. 20,000 samples per surface; at most 10 frames (3 with "
    "--quick), evenly spaced, are compared.",
    "**Seconds.** Wall clock in one process, from arrays in memory to bytes in memory and back, "
    "with the default number of threads of each codec; the median of three runs if one takes less "
    "than two seconds.",
    "**BD-rate.** Mean difference of log rate over log distance in the common range of both "
    "envelopes (in parentheses), by piecewise cubic interpolation; -50 % is half the rate. Nothing "
    "is extrapolated.",
)

DISTANCE = "rms_distance_percent"

LEVELS = (0.1, 0.05, 0.02, 0.01)
"""RMS distances at which rates are listed, in percent of the diagonal."""


@dataclass(frozen=True)
class SurfaceResults:
    """All results of one sequence.

    Attributes
    ----------
    slug : str
        Prefix of the names of its plots.
    sequence : dict
        Name, shape and hash.
    measured : list of results
        Ours, then Draco's.
    """

    slug: str
    sequence: dict[str, Any]
    measured: list[Result]

    @property
    def name(self) -> str:
        """The name of the sequence in tables and plots."""
        return str(self.sequence["name"]) or self.slug

    def curves(self) -> dict[str, list[Point]]:
        """Points (kbit per frame, RMS distance above 0) by codec."""
        curves: dict[str, list[Point]] = {}
        for result in done(self.measured):
            if error := result["quality"][DISTANCE]:
                curves.setdefault(result["codec"], []).append((result["kbit_per_frame"], error))
        return {label: sorted(points) for label, points in curves.items()}

    def as_dict(self) -> dict[str, Any]:
        """All results in plain types."""
        return {**self.sequence, "measured": without_identities(self.measured)}


def surface_document(
    measured: Measured[SurfaceResults], peers: Sequence[Peer], notes: Sequence[str], command: str
) -> Document:
    """Build the report; see `codecs_document` for the parameters."""
    return codecs_document(
        TITLE, command, measured, _sequence_parts, methodology=METHODOLOGY, peers=peers, notes=notes
    )


def _sequence_parts(results: SurfaceResults, pictures: Sequence[Picture]) -> list[Part]:
    refused = refusals_of(results.measured, results.name)
    return [
        *sequence_opening(results.name, results.sequence),
        *pictures,
        rate_table(results),
        Paragraph("'-': the points of the codec do not enclose this distance."),
        *_bd_rates(results),
        _seconds_table(results),
        *([Bullets(refused)] if refused else []),
        runs_table(results),
    ]


def rate_table(results: SurfaceResults) -> Table:
    """Kilobits per frame at fixed distances, interpolated on each lower envelope."""
    rows = [
        (label, *(significant(rate_at_error(points, level)) for level in LEVELS))
        for label, points in results.curves().items()
    ]
    header = ("codec", *(f"{level:g} %" for level in LEVELS))
    return Table(f"Kilobits per frame at equal RMS distance, {results.name}", header, tuple(rows))


def _bd_rates(results: SurfaceResults) -> list[Part]:
    """The BD-rate of our codec relative to each other one."""
    curves = results.curves()
    ours, *others = curves or [""]
    rows = [(other, bd_text(bd_rate(curves[ours], curves[other]))) for other in others]
    title = f"BD-rate at equal RMS distance, {results.name}: the column relative to the row"
    return [Table(title, ("codec", ours), tuple(rows))] if rows else []


def _seconds_table(results: SurfaceResults) -> Table:
    header, rows = seconds_rows(results.measured, results.sequence["n_frames"])
    return Table(f"Seconds, {results.name}", header, rows)


def runs_table(results: SurfaceResults) -> Table:
    """Every measured point."""
    rows = []
    for result in done(results.measured):
        quality = result["quality"]
        decibels = [quality[name] for name in ("psnr_db", "d1_psnr_db", "d2_psnr_db")]
        distances = [quality[name] for name in (DISTANCE, "max_distance_percent")]
        seconds = [result["seconds"][part] for part in ("encode", "decode")]
        rates = [result[name] for name in ("kbit_per_frame", "rate_bpvf")]
        label = f"{result['codec']} {result['params']}".strip()
        figures = [significant(one) for one in (*rates, *decibels, *distances, *seconds)]
        rows.append((label, str(result["size_bytes"]), *figures))
    header = (
        "codec and setting", "bytes", "kbit per frame", "bpvf", "PSNR, dB", "D1, dB", "D2, dB",
        "RMS %", "largest %", "encode, s", "decode, s",
    )  # fmt: skip
    return Table(f"All runs, {results.name}", header, tuple(rows))
