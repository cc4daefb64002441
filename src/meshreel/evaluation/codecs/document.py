"""The report on codecs: parts in their order."""

from collections.abc import Sequence

from meshreel.evaluation.codecs.peers.protocol import Peer
from meshreel.evaluation.codecs.results import CodecResults
from meshreel.evaluation.codecs.tables import (
    COMPARED,
    bd_rate_parts,
    lossless_table,
    rate_table,
    refusals,
    runs_table,
    seconds_table,
)
from meshreel.evaluation.pipeline import Measured
from meshreel.evaluation.report.codecs import codecs_document
from meshreel.evaluation.report.openings import sequence_opening
from meshreel.evaluation.runs.store import done
from meshreel.rendering.documents.parts import Bullets, Document, Paragraph, Part, Picture

TITLE = "meshreel beside other codecs: rate, distortion, seconds"

HOW = (
    "**Rate.** Bits of everything by vertices and frames: three coordinates, connectivity, "
    "headers. No codec has to keep the order of vertices and faces.",
    "**Connectivity.** To codecs that do not code faces, the bytes and seconds of meshreel's coded "
    "connectivity are added, once for the sequence. They are given the vertices in the order that "
    "it leaves, or as they came where both are smaller together with that order stored. Draco "
    "codes the connectivity in every frame.",
    "**Errors.** Of every vertex against its original; Draco's order, which follows from the faces "
    "alone, is found outside of the seconds and not counted. Draco leaves out degenerate and "
    "repeated faces.",
    "**Seconds.** Wall clock in one process, arrays in memory to bytes in memory and back, each "
    "codec with its own default number of threads; the median of three runs where one takes less "
    "than two seconds.",
    "**BD-rate.** Mean difference of log rate over log error, where both envelopes have points "
    "(in brackets), by piecewise cubic interpolation; -50 % is half the rate. Nothing is "
    "extrapolated.",
)


def codec_document(
    measured: Measured[CodecResults], peers: Sequence[Peer], notes: Sequence[str], command: str
) -> Document:
    """The report on sequences and their plots.

    Parameters
    ----------
    measured : sequence of (CodecResults, pictures)
    peers : sequence of Peer
        Those that were asked for and are there.
    notes : sequence of str
        Lines on what was asked for and is not in the report.
    command : str
        The command line that made it.
    """
    finished = (one for results, _ in measured for one in done(results.measured))
    body = (part for results, pictures in measured for part in _sequence_parts(results, pictures))
    return codecs_document(TITLE, command, finished, body, how=HOW, peers=peers, notes=notes)


def _sequence_parts(results: CodecResults, pictures: Sequence[Picture]) -> list[Part]:
    parts: list[Part] = [
        *sequence_opening(results.name, results.sequence),
        *pictures,
        rate_table(results),
        Paragraph("'-': the codec has no points at either side of this error."),
    ]
    parts += [part for error in COMPARED for part in bd_rate_parts(results, error)]
    lossless = lossless_table(results)
    parts += [lossless] if lossless else []
    parts += [seconds_table(results)]
    refused = refusals(results)
    parts += [Bullets(refused)] if refused else []
    return [*parts, runs_table(results)]
