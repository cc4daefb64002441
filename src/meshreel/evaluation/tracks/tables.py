"""Tables of a track: bytes at equal largest error, and all runs."""

from meshreel.evaluation.runs.store import done
from meshreel.evaluation.tracks.measure import OURS
from meshreel.evaluation.tracks.results import TrackResults
from meshreel.evaluation.tracks.settings import EXACTLY
from meshreel.rendering.documents.cells import NONE, significant
from meshreel.rendering.documents.parts import Table


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
