"""The report on a track: parts in their order."""

from collections.abc import Sequence

from meshreel.evaluation.pipeline import Measured
from meshreel.evaluation.report.codecs import codecs_document
from meshreel.evaluation.report.openings import sequence_opening
from meshreel.evaluation.runs.store import done
from meshreel.evaluation.tracks.peers import TrackPeer
from meshreel.evaluation.tracks.results import TrackResults
from meshreel.evaluation.tracks.tables import refusals, runs_table, size_table
from meshreel.rendering.documents.parts import Bullets, Document, Paragraph, Part, Picture

TITLE = "A track beside compressors of arrays: rate, distortion, seconds"

HOW = (
    "**Rate.** Bytes of the track alone by its numbers. Ours lies in a file with positions and "
    "faces, which it is predicted from; these are not counted, and stated apart.",
    "**Largest error.** Of a value against its original: the length of the difference; of normals "
    "the angle between them; of colours the largest difference of a number. Percent are of the "
    "range of the track, of vectors of the diagonal of the box of all.",
    "**Equal largest error.** Ours is asked for a bound once. Each of the others gets the coarsest "
    "tolerance that keeps the same bound, which is searched for with its own decoder: several are "
    "more cautious than they are asked to be.",
    "**Order.** The others are given the values of vertices as they came, or in the order in which "
    "meshreel walks over the mesh, whichever takes fewer bytes; that order is not counted.",
    "**Seconds.** Wall clock in one process, arrays in memory to bytes in memory and back; the "
    "median of three runs where one takes less than two seconds. Encoding of ours is that of a "
    "file with the track less that of one without; its decoding is of the track alone.",
)


def track_document(
    measured: Measured[TrackResults],
    peers: Sequence[TrackPeer],
    notes: Sequence[str],
    command: str,
) -> Document:
    """The report on a track of sequences.

    Parameters
    ----------
    measured : sequence of (TrackResults, pictures)
    peers : sequence of TrackPeer
        Those that were asked for and are there.
    notes : sequence of str
        Lines on what was asked for and is not in the report.
    command : str
        The command line that made it.
    """
    finished = (one for results, _ in measured for one in done(results.measured))
    body = (part for results, pictures in measured for part in _track_parts(results, pictures))
    return codecs_document(TITLE, command, finished, body, how=HOW, peers=peers, notes=notes)


def _track_parts(results: TrackResults, pictures: Sequence[Picture]) -> list[Part]:
    parts: list[Part] = [
        *sequence_opening(results.name, results.sequence),
        Paragraph(_about(results)),
        *pictures,
        size_table(results),
        Paragraph("'-': the codec has no figures there; why is said below."),
    ]
    refused = refusals(results)
    parts += [Bullets(refused)] if refused else []
    return [*parts, runs_table(results)]


def _about(results: TrackResults) -> str:
    """What the track is, and what lies beside it."""
    track, n_positions = results.track, results.positions_bytes
    text = f"`{track['name']}` is {track['described']}: {track['raw_bytes']:,} bytes as they are."
    if n_positions is None:
        return text
    return f"{text} Positions, faces and order take {n_positions:,} bytes beside it."
