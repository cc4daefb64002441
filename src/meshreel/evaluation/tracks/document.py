"""The report of the comparison of a track."""

from collections.abc import Sequence

from meshreel.evaluation.pipeline import Measured
from meshreel.evaluation.report import codecs_document, sequence_opening
from meshreel.evaluation.runs.store import done
from meshreel.evaluation.tracks.measure import EXACTLY, OURS
from meshreel.evaluation.tracks.peers import TrackPeer
from meshreel.evaluation.tracks.results import TrackResults
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

TITLE = "A track compared with array compressors: rate, distortion, time"

METHODOLOGY = (
    "**Rate.** Bytes of the track alone, per number. Our track is part of a file with positions "
    "and faces, from which it is predicted; these are not counted but listed separately.",
    "**Largest error.** Distance of a value from its original: the length of the difference; for "
    "normals the angle; for colors the largest difference of a channel. Percentages refer to the "
    "range of the track; for vectors, to the diagonal of the bounding box of all values.",
    "**Equal largest error.** Our codec receives the error bound directly. The others receive the "
    "coarsest tolerance that keeps the same bound, found by search with their decoders: several "
    "have smaller errors than their tolerance.",
    "**Order.** The others receive the values of vertices in the original order or in the order of "
    "meshreel's coded connectivity, whichever takes fewer bytes; the order is not counted.",
    "**Seconds.** Wall clock in one process, from arrays in memory to bytes in memory and back; "
    "the median of three runs if one takes less than two seconds. Our encoding time is that of a "
    "file with the track minus that of one without; our decoding time is that of the track alone.",
)


def track_document(
    measured: Measured[TrackResults],
    peers: Sequence[TrackPeer],
    notes: Sequence[str],
    command: str,
) -> Document:
    """Build the report; see `codecs_document` for the parameters."""
    return codecs_document(
        TITLE, command, measured, _track_parts, methodology=METHODOLOGY, peers=peers, notes=notes
    )


def _track_parts(results: TrackResults, pictures: Sequence[Picture]) -> list[Part]:
    parts: list[Part] = [
        *sequence_opening(results.name, results.sequence),
        Paragraph(_about(results)),
        *pictures,
        size_table(results),
        Paragraph("'-': the codec has no result; the reason is listed below."),
    ]
    refused = refusals(results)
    parts += [Bullets(refused)] if refused else []
    return [*parts, runs_table(results)]


def _about(results: TrackResults) -> str:
    """Description of the track and the size of the rest of the file."""
    track, n_positions = results.track, results.positions_bytes
    text = f"`{track['name']}` is {track['described']}: {track['raw_bytes']:,} bytes uncompressed."
    if n_positions is None:
        return text
    return f"{text} Positions, faces and order take another {n_positions:,} bytes."


def size_table(results: TrackResults) -> Table:
    """Bytes of each codec at each error bound, and the ratio of ours to the best of the others."""
    levels = results.levels
    rows = []
    for codec in results.codecs:
        sizes = [results.size_bytes(codec, level) for level in levels]
        rows.append((codec, *(NONE if size is None else f"{size:,}" for size in sizes)))
    shares = [share_of_best(results, level) for level in levels]
    if any(share is not None for share in shares):
        rows.append((f"{OURS} / best of the others", *map(significant, shares)))
    title = f"Bytes of the track at equal largest error, {results.name}"
    return Table(title, ("codec", *map(_level_text, levels)), tuple(rows))


def share_of_best(results: TrackResults, level: str) -> float | None:
    """Our bytes divided by those of the smallest peer; None if either has no result."""
    ours = results.size_bytes(OURS, level)
    sizes = [results.size_bytes(codec, level) for codec in results.codecs if codec != OURS]
    peer_sizes = [size for size in sizes if size is not None]
    return ours / min(peer_sizes) if ours is not None and peer_sizes else None


def runs_table(results: TrackResults) -> Table:
    """Every measured point."""
    unit = results.track["error_unit"]
    rows = []
    for result in done(results.measured):
        rows.append(
            (
                f"{result['codec']} {result['level']}",
                f"{result['size_bytes']:,}",
                significant(results.bits_per_number(result["size_bytes"])),
                significant(result["largest_error"]),
                significant(result["rms_error"]),
                result.get("order", NONE),
                significant(result["seconds"]["encode"]),
                significant(result["seconds"]["decode"]),
            )
        )
    suffix = f", {unit}" if unit else ""
    header = ("codec and bound", "bytes", "bits per number", f"largest error{suffix}",
              f"RMS error{suffix}", "order of vertices", "encode, s", "decode, s")  # fmt: skip
    return Table(f"All runs, {results.name}", header, tuple(rows))


def refusals(results: TrackResults) -> tuple[str, ...]:
    """One line for each codec and reason of failed runs."""
    levels_of: dict[tuple[str, str], list[str]] = {}
    for result in results.measured:
        if "refused" in result:
            key = result["codec"], result["refused"]
            levels_of.setdefault(key, []).append(result["level"])
    return tuple(
        f"`{codec}` has no figures for {results.name} at {', '.join(levels)}: {reason}"
        for (codec, reason), levels in levels_of.items()
    )


def _level_text(level: str) -> str:
    """Text such as "0.1 %" or "0.5 deg"."""
    if level == EXACTLY:
        return level
    digits = level.rstrip("%abcdefghijklmnopqrstuvwxyz")
    return f"{digits} {level[len(digits) :]}"
