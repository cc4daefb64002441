"""Promises of a decoded sequence, judged in long double, without the measures of the product."""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

ROUNDING = 1 + 1e-9
"""Tolerance of figures that were computed in another order."""


@dataclass(frozen=True)
class Promise:
    """What options promise, besides what a stream states."""

    percent: float | None = None
    """Largest error of positions, in percent of the diagonal of all frames."""
    share: float | None = None
    """Largest bound of tracks, in percent of their ranges."""
    bounds: dict[str, float] = field(default_factory=dict)
    """Largest errors of tracks; 0 for lossless ones."""
    lossless: bool = False


def parts_of(sequence):
    return sequence.segments if sequence.n_segments > 1 else [sequence]


def values_of(source):
    """Return the values of a track, or the positions of a segment, of shape (T, N, C)."""
    return np.ascontiguousarray(source.read(0, source.shape[0]))


def assert_same_bits(values, values_hat, what):
    assert (values.dtype, values.shape) == (values_hat.dtype, values_hat.shape), what
    assert values.tobytes() == values_hat.tobytes(), f"{what}: other bits"


def extent_of(sources):
    """Return the diagonal of the range of all finite values."""
    values = np.concatenate([values_of(one).reshape(-1, one.shape[2]) for one in sources])
    wide = values.astype(np.longdouble)
    high = np.max(wide, 0, where=np.isfinite(wide), initial=-np.inf)
    low = np.min(wide, 0, where=np.isfinite(wide), initial=np.inf)
    return float(np.sqrt((np.where(high >= low, high - low, 0) ** 2).sum()))


def errors_of(kind, values, values_hat):
    """Return the error of each value, of shape (..., C), by the measure of its kind."""
    wide, wide_hat = values.astype(np.longdouble), values_hat.astype(np.longdouble)
    is_same = (values == values_hat) | (np.isnan(wide) & np.isnan(wide_hat))
    with np.errstate(all="ignore"):
        errors = np.where(is_same, 0, np.abs(wide - wide_hat))
        errors[np.isnan(errors)] = np.inf
        if kind == "color":
            return errors.max(-1)
        if kind != "normal":
            return np.sqrt((errors**2).sum(-1))
        units = [one / np.sqrt((one**2).sum(-1, keepdims=True)) for one in (wide, wide_hat)]
        chords = np.sqrt(((units[0] - units[1]) ** 2).sum(-1))
        angles = 2 * np.degrees(np.arcsin(np.minimum(chords / 2, 1)))
    return np.where(is_same.all(-1), 0, np.where(np.isnan(angles), np.inf, angles))


def largest_error(kind, source, source_hat):
    return float(errors_of(kind, values_of(source), values_of(source_hat)).max())


def position_error(original, decoded):
    pairs = zip(parts_of(original), parts_of(decoded), strict=True)
    return max(largest_error("vector", *pair) for pair in pairs)


def polygons_of(part):
    """Return the directed edges of each polygon: those of its triangles without inner ones."""
    polygons = []
    for first, end in pairwise(np.cumsum([0, *(part.surface.sizes(len(part.faces)) - 2)])):
        triangles = part.faces[first:end].tolist()
        edges = {edge for a, b, c in triangles for edge in ((a, b), (b, c), (c, a))}
        polygons.append(edges - {(b, a) for a, b in edges})
    return polygons


def times_of(sequence):
    is_timed = sequence.fps or sequence.times is not None
    return np.asarray(sequence.timing.seconds(sequence.n_frames)) if is_timed else None


def assert_same_times(original, decoded, tolerance=0.0):
    times, times_hat = times_of(original), times_of(decoded)
    assert (times is None) == (times_hat is None), f"times: {times} became {times_hat}"
    if times is not None:
        np.testing.assert_allclose(times_hat, times, rtol=tolerance, atol=tolerance)


def judge(original, decoded, promise):
    """Assert what was requested, and what the decoded sequence states."""
    assert decoded.starts == original.starts, f"segments: {original.starts} became {decoded.starts}"
    assert_same_times(original, decoded)
    error, stated = position_error(original, decoded), decoded.error_bound
    assert stated is None or error <= stated * ROUNDING, f"positions: {error} above {stated}"
    if promise.percent:
        limit = promise.percent / 100 * extent_of(parts_of(original))
        assert stated is not None, "positions: no bound is stated"
        assert error <= limit * ROUNDING, f"positions: {error} above the requested {limit}"
    for part, part_hat in zip(parts_of(original), parts_of(decoded), strict=True):
        judge_mesh(part, part_hat, promise)
        assert set(part.tracks) == set(part_hat.tracks), "tracks are missing"
        for name, track in part.tracks.items():
            limit = promise.bounds.get(name, np.inf)
            if promise.share and track.dtype.kind == "f" and track.kind != "normal":
                sources = [one.tracks[name] for one in parts_of(original)]
                limit = promise.share / 100 * extent_of(sources) * (1 + 1e-6)
            judge_track(name, track, part_hat.tracks[name], 0 if promise.lossless else limit)


def judge_mesh(part, part_hat, promise):
    assert polygons_of(part) == polygons_of(part_hat), "polygons differ"
    np.testing.assert_array_equal(part_hat.faces, part.faces)
    cells = [one.surface.cells and one.surface.cells.nodes for one in (part, part_hat)]
    np.testing.assert_array_equal(*cells)
    assert part.dtype == part_hat.dtype
    if promise.lossless:
        assert_same_bits(values_of(part), values_of(part_hat), "positions")
    for one, other in zip(part.surface.attributes, part_hat.surface.attributes, strict=True):
        assert_same_bits(one.per_item(), other.per_item(), f"attribute {one.name}")
    for one, other in zip(part.surface.groups, part_hat.surface.groups, strict=True):
        assert one.labels == other.labels
        np.testing.assert_array_equal(one.numbers, other.numbers)


def judge_track(name, track, track_hat, limit):
    described = [(t.kind, t.domain, t.unit, t.dtype, t.shape) for t in (track, track_hat)]
    assert described[0] == described[1], f"track {name}: {described[0]} became {described[1]}"
    stated = track_hat.error_bound
    assert stated is not None, f"track {name}: no bound is stated"
    if limit == 0 or track.dtype.kind != "f":
        assert_same_bits(values_of(track), values_of(track_hat), f"track {name}")
    error = largest_error(track.kind, track, track_hat)
    assert error <= min(stated, limit) * ROUNDING, f"track {name}: {error} > {stated} or {limit}"
    assert stated <= limit, f"track {name}: {stated} is stated, above {limit}"
