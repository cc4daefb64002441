"""Results of the corpus as tables."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from corpus.measure import MIN_TIMED, SETTINGS
from corpus.sources import KINDS
from meshreel.rendering.documents import Table, significant

Row = Mapping[str, Any]
"""A sequence in docs/results/corpus.json."""

PEERS = ("draco", "meshopt", "sz3", "zfp")
PERCENTILES = (5, 50, 95)
N_WORST = 5
POSITION_BYTES = 12
"""Of a vertex in float32; speeds count these bytes."""
HEADER_BYTES = 120
"""Of our smallest files with a bound."""


def counts_table(rows: Sequence[Row]) -> Table:
    """Sequences, frames and vertices of each kind."""
    header = ("kind", "sequences", "measured", "frames", "vertices, median", "largest mesh")
    body = []
    for name, group in _groups(rows):
        done = _measured(group)
        n_verts = [row["n_verts"] for row in done]
        body.append(
            (
                name,
                str(len(group)),
                str(len(done)),
                f"{sum(row['n_frames'] for row in done):,}",
                f"{int(np.median(n_verts)):,}",
                f"{max(n_verts):,}",
            )
        )
    return Table("Sequences", header, tuple(body))


def ratios_table(rows: Sequence[Row]) -> Table:
    """Percentiles of the ratio of float32 arrays to our file."""
    return _by_kind(rows, ("q80", "0.1%"), ratio_of, significant)


def errors_table(rows: Sequence[Row]) -> Table:
    """Percentiles of errors over all sequences."""
    titles = {"max": "largest", "rms": "RMS"}
    return _errors(rows, "error, % of the diagonal", titles, list(SETTINGS))


def visible_table(rows: Sequence[Row]) -> Table:
    """Percentiles of visible errors over all sequences, of settings without a bound."""
    titles = {
        "flip": "FLIP",
        "silhouette_px": "silhouette, pixels",
        "normal": "normals, mean, degrees",
        "flicker": "normals, change between frames, degrees",
    }
    settings = [name for name, options in SETTINGS.items() if "quality" in options]
    return _errors(rows, "error", titles, settings)


def _errors(
    rows: Sequence[Row], title: str, titles: Mapping[str, str], settings: Sequence[str]
) -> Table:
    header = ("setting", title, *(f"{p} %" for p in PERCENTILES), "largest")
    body = []
    for name in settings:
        every = [row["settings"][name] for row in _measured(rows)]
        for key, text in titles.items():
            values = [figures[key] for figures in every if key in figures] or [math.nan]
            cells = map(significant, [*_percentiles(values), max(values)])
            body.append((f"`{name}`", text, *cells))
    return Table("Errors", header, tuple(body))


def speeds_table(rows: Sequence[Row]) -> Table:
    """Percentiles of speeds over sequences of at least `MIN_TIMED` vertices in all frames."""
    header = ("setting", "direction", *(f"{p} %" for p in PERCENTILES))
    rows = _measured(rows, MIN_TIMED)
    body = [
        (f"`{name}`", direction, *map(significant, _percentiles(_values(rows, name, speed))))
        for name in ("q80", "0.1%")
        for direction, speed in (("encode", encode_speed), ("decode", decode_speed))
    ]
    return Table("MB per second", header, tuple(body))


def memory_table(rows: Sequence[Row]) -> Table:
    """Percentiles of memory over sequences of at least `MIN_TIMED` vertices in all frames."""
    header = ("direction", *(f"{p} %" for p in PERCENTILES), "largest")
    body = []
    for direction in ("encode", "decode"):
        values = [
            row["memory"][direction] / row["n_positions"]
            for row in _measured(rows)
            if "memory" in row
        ]
        if values:
            body.append((direction, *map(significant, [*_percentiles(values), max(values)])))
    return Table("Bytes per vertex and frame", header, tuple(body))


def peers_table(rows: Sequence[Row]) -> Table:
    """Sizes relative to other codecs at equal error."""
    header = (
        "setting",
        "codec",
        "sequences",
        *(f"{p} %" for p in PERCENTILES),
        "smaller than ours",
    )
    body = []
    for name in SETTINGS:
        for peer in PEERS:
            values = [
                size_of(one) / one[peer]
                for row in _measured(rows)
                if peer in (one := row["settings"][name])
            ]
            if values:
                body.append(
                    (
                        f"`{name}`",
                        peer,
                        str(len(values)),
                        *map(significant, _percentiles(values)),
                        str(sum(value > 1 for value in values)),
                    )
                )
    return Table("Our size over theirs", header, tuple(body))


def worst_table(rows: Sequence[Row]) -> Table:
    """The sequences with the smallest ratio, the largest error and the slowest encoding."""
    done = _measured(rows)
    columns: dict[str, tuple[Callable[[Row, Row], float], int]] = {
        "ratio": (ratio_of, 1),
        "largest error, %": (lambda _, one: float(one["max"]), -1),
        "RMS error, %": (lambda _, one: float(one["rms"]), -1),
        "encode, MB / s": (encode_speed, 1),
        "decode, MB / s": (decode_speed, 1),
    }
    cells = []
    for measure, sign in columns.values():
        chosen = _measured(done, MIN_TIMED) if measure in (encode_speed, decode_speed) else done
        values = [(measure(row, row["settings"]["q80"]), _name(row)) for row in chosen]
        values.sort(key=lambda pair: sign * pair[0])
        cells.append([f"{name}: {significant(value)}" for value, name in values[:N_WORST]])
    body = tuple((str(i + 1), *line) for i, line in enumerate(zip(*cells, strict=True)))
    return Table("The worst at quality 80", ("", *columns), body)


def losses_table(rows: Sequence[Row]) -> Table:
    """Every sequence for which another codec is smaller at equal error, with the reason."""
    header = ("sequence", "frames x vertices", "settings and codecs: our bytes, theirs", "reason")
    body = []
    for row in _measured(rows):
        found = losses_of(row)
        if found:
            texts = [f"`{name}` {peer} {mine:,}, {other:,}" for name, peer, mine, other in found]
            body.append(
                (_name(row), f"{row['n_frames']} x {row['n_verts']:,}", "; ".join(texts),
                 reason_of(row))
            )  # fmt: skip
    return Table("Other codecs are smaller", header, tuple(body))


def n_broken(rows: Sequence[Row]) -> tuple[int, int]:
    """Error bounds that were not met, and all error bounds."""
    bounds = [
        one
        for row in _measured(rows)
        for name, one in row["settings"].items()
        if "max_error" in SETTINGS[name]
    ]
    return sum("is_broken" in one for one in bounds), len(bounds)


def losses_of(row: Row) -> list[tuple[str, str, int, int]]:
    """Setting, codec and both sizes where another codec is smaller."""
    return [
        (name, peer, size_of(one), one[peer])
        for name, one in row["settings"].items()
        for peer in PEERS
        if peer in one and one[peer] < size_of(one)
    ]


def reason_of(row: Row) -> str:
    """Why another codec is smaller, by the properties in `measure.features`."""
    losses, found = losses_of(row), row["features"]
    reasons = []
    if max(mine - other for _, _, mine, other in losses) <= HEADER_BYTES:
        reasons.append("small file: headers")
    if row["n_frames"] > row["n_segments"] and found["resting"] > 0.5:
        reasons.append(f"{found['resting']:.0%} of the vertices rest")
    if found["repeated"] > 0.5:
        reasons.append(f"repeated parts or spacing ({found['repeated']:.0%})")
    elif found["distinct"] < 0.4:
        reasons.append(f"few distinct coordinates ({found['distinct']:.0%})")
    return "; ".join(reasons) or "not explained"


def size_of(one: Row) -> int:
    """Bytes without the order of vertices and faces, which the others do not keep."""
    return int(one["size"] - one["order"])


def ratio_of(row: Row, one: Row) -> float:
    """Float32 positions and int32 faces over our whole file."""
    return float(row["raw"] / one["size"])


def encode_speed(row: Row, one: Row) -> float:
    """MB of float32 positions per processor second."""
    return float(POSITION_BYTES * row["n_positions"] / one["encode_s"] / 1e6)


def decode_speed(row: Row, one: Row) -> float:
    """MB of float32 positions per processor second."""
    return float(POSITION_BYTES * row["n_positions"] / one["decode_s"] / 1e6)


def _groups(rows: Sequence[Row]) -> Iterable[tuple[str, list[Row]]]:
    """Rows by kind, in the order of `KINDS`, then all."""
    for kind, title in KINDS.items():
        group = [row for row in rows if row["kind"] == kind]
        if _measured(group):
            yield title, group
    yield "all", list(rows)


def _measured(rows: Iterable[Row], n_positions: int = 0) -> list[Row]:
    """Rows with results, of at least this many vertices in all frames."""
    return [row for row in rows if "refused" not in row and row["n_positions"] >= n_positions]


def _name(row: Row) -> str:
    return str(row["name"]).replace("|", "\\|")


def _values(rows: Sequence[Row], name: str, measure: Callable[[Row, Row], float]) -> list[float]:
    return [measure(row, row["settings"][name]) for row in _measured(rows)]


def _percentiles(values: Sequence[float]) -> list[float]:
    return [float(value) for value in np.percentile(values, PERCENTILES)]


def _by_kind(
    rows: Sequence[Row],
    names: Sequence[str],
    measure: Callable[[Row, Row], float],
    text: Callable[[float | None], str],
) -> Table:
    header = ("kind", *(f"`{name}`, {p} %" for name in names for p in PERCENTILES))
    body = [
        (
            title,
            *(
                text(value)
                for name in names
                for value in _percentiles(_values(group, name, measure))
            ),
        )
        for title, group in _groups(rows)
    ]
    return Table("Ratios", header, tuple(body))


TABLES: dict[str, Callable[[Sequence[Row]], Table]] = {
    "corpus-counts": counts_table,
    "corpus-ratios": ratios_table,
    "corpus-errors": errors_table,
    "corpus-visible": visible_table,
    "corpus-speeds": speeds_table,
    "corpus-memory": memory_table,
    "corpus-peers": peers_table,
    "corpus-worst": worst_table,
    "corpus-losses": losses_table,
}
