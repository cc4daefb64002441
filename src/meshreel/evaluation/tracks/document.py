"""The report on a track: parts in their order."""

from collections.abc import Sequence

from meshreel.evaluation.pipeline import Measured
from meshreel.evaluation.report import codecs_document, sequence_opening
from meshreel.evaluation.runs.store import done
from meshreel.evaluation.tracks.measure import OURS
from meshreel.evaluation.tracks.peers import TrackPeer
from meshreel.evaluation.tracks.results import TrackResults
from meshreel.evaluation.tracks.settings import EXACTLY
from meshreel.rendering.documents.cells import NONE, significant
from meshreel.rendering.documents.parts import Bullets, Document, Paragraph, Part, Picture, Table

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


def size_table(results: TrackResults) -> Table:
    """Bytes of each codec at each largest error, and ours by the best of the others."""
    levels = results.levels
    rows = []
    for codec in results.codecs:
        sizes = [results.size_bytes(codec, level) for level in levels]
        rows.append((codec, *(NONE if size is None else f"{size:,}" for size in sizes)))
    shares = [share_of_best(results, level) for level in levels]
    if any(share is not None for share in shares):
        rows.append((f"{OURS} by the best of the others", *map(significant, shares)))
    title = f"Bytes of the track at equal largest error, {results.name}"
    return Table(title, ("codec", *map(_level_text, levels)), tuple(rows))


def share_of_best(results: TrackResults, level: str) -> float | None:
    """Bytes of ours by those of the smallest peer; None where either has no result."""
    ours = results.size_bytes(OURS, level)
    sizes = [results.size_bytes(codec, level) for codec in results.codecs if codec != OURS]
    there = [size for size in sizes if size is not None]
    return ours / min(there) if ours is not None and there else None


def runs_table(results: TrackResults) -> Table:
    """Every measured point."""
    unit = results.track["error_unit"]
    rows = []
    for one in done(results.measured):
        rows.append(
            (
                f"{one['codec']} {one['level']}",
                f"{one['size_bytes']:,}",
                significant(results.bits_per_number(one["size_bytes"])),
                significant(one["largest_error"]),
                significant(one["rms_error"]),
                one.get("order", NONE),
                significant(one["seconds"]["encode"]),
                significant(one["seconds"]["decode"]),
            )
        )
    of_error = f", {unit}" if unit else ""
    header = ("codec and bound", "bytes", "bits per number", f"largest error{of_error}",
              f"RMS error{of_error}", "order of vertices", "encode, s", "decode, s")  # fmt: skip
    return Table(f"All runs, {results.name}", header, tuple(rows))


def refusals(results: TrackResults) -> tuple[str, ...]:
    """Why runs have no figures, a line for each codec and reason."""
    found: dict[tuple[str, str], list[str]] = {}
    for one in results.measured:
        if "refused" in one:
            found.setdefault((one["codec"], one["refused"]), []).append(one["level"])
    return tuple(
        f"`{codec}` has no figures for {results.name} at {', '.join(levels)}: {why}"
        for (codec, why), levels in found.items()
    )


def _level_text(level: str) -> str:
    """Such as "0.1 %" or "0.5 deg"."""
    if level == EXACTLY:
        return level
    digits = level.rstrip("%abcdefghijklmnopqrstuvwxyz")
    return f"{digits} {level[len(digits) :]}"
