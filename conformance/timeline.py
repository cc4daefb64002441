"""Temporal basis, corrections and frames: "Times" to "Cosines", "Corrections", "Frames"."""

from array import array
from math import sqrt

from conformance.bits import integers, need
from conformance.container import Payload
from conformance.rounding import single


def levels_of(n_frames):
    """Return distance d and times of each level that has any; d of level 0 is 2."""
    levels = [(2, range(0, n_frames, 4)), (2, range(2, n_frames, 4)), (1, range(1, n_frames, 2))]
    return [(d, times) for d, times in levels if times]


def read_rests(layout, n_frames):
    """Return r of the resting times, and first time and end of each run."""
    r, n_runs, runs, end = layout.varint(), layout.varint(), [], 0
    need(r <= 8 and n_runs >= 1)
    for _ in range(n_runs):
        gap, length = layout.varint(), layout.varint()
        need(gap >= 1 and length >= 1 and end + gap + length <= n_frames)
        runs.append([end + gap, end + gap + length])
        end += gap + length
    return r, runs


def resting_times(runs):
    return {t for start, end in runs for t in range(start, end)}


def passes_by_times(n_columns, n_frames, rests=()):
    """Return, for each pass, the context neighbors of each time of each column."""
    moving, passes = [t for t in range(n_frames) if t not in rests], []
    for d, times in levels_of(len(moving)):
        passes.append({})
        for i in times:
            around = [] if times[0] == 0 else [i - d, i + d]
            around += [i - 2 * d, i - 4 * d]
            passes[-1][moving[i]] = [moving[j] for j in around if 0 <= j < len(moving)]
    if rests:
        passes.append({t: [u for u in (t - 1, t - 2) if u in rests] for t in sorted(rests)})
    return [in_columns(near_of, n_columns, n_frames) for near_of in passes]


def pass_of_cosines(n_columns, n_frames):
    """Return the single pass of cosines, as `passes_by_times`."""
    near_of = {k: [j for j in range(k - 1, k - 5, -1) if j >= 0] for k in range(n_frames)}
    return [in_columns(near_of, n_columns, n_frames)]


def in_columns(near_of, n_columns, n_frames):
    """Extend a pass of one column to all columns."""
    columns = {}
    for c in range(n_columns):
        for t, around in near_of.items():
            preceding = [other * n_frames + t for other in range(max(0, c - 2), c)]
            columns[c * n_frames + t] = [c * n_frames + u for u in around] + preceding
    return columns


def values_at_times(coded, rests=(), r=0, filters=None):
    """Return the values of one column; `filters` are those of adaptive times."""
    moving = values_at_moving([i for t, i in enumerate(coded) if t not in rests], filters)
    v, moving = [], iter(moving)
    for t, integer in enumerate(coded):
        v.append(v[-1] + integer / 2**r if t in rests else next(moving))
    return v


def values_at_moving(coded, filters):
    """Return the values of one column at moving times."""
    n_frames, v = len(coded), [0.0] * len(coded)
    for d, times in levels_of(n_frames):
        level = 3 - d if times[0] else 0
        for t in times:
            x = [(v[t - 4] if t else 0.0) if level == 0 else plain_prediction(v, t, d), 0.0, 0.0]
            if filters is None:
                v[t] = x[0] + coded[t]
                continue
            if level > 0 and t >= 5 * d and t + 5 * d < n_frames:
                y = v[t - 3 * d] + v[t + 3 * d]
                x[1:] = (v[t - d] + v[t + d]) - y, y - (v[t - 5 * d] + v[t + 5 * d])
            v[t] = filters[level].predict(x) + coded[t]
            filters[level].observe(x, float(coded[t]))
    return v


class Filter:
    """Weights and variances of a level of adaptive times."""

    initial = (1 / 16, 1 / 64, 1 / 64)

    def __init__(self):
        self.w, self.p, self.m = [0.0] * 3, list(self.initial), 1.0

    def begin_mode(self):
        self.p = [15 / 16 * p + 1 / 16 * q for p, q in zip(self.p, self.initial, strict=True)]

    def predict(self, x):
        w = self.w
        prediction = x[0] + ((w[0] * x[0] + w[1] * x[1]) + w[2] * x[2])
        return min(max(prediction, -(2.0**29)), 2.0**29)

    def observe(self, x, e):
        g = [self.p[j] * x[j] for j in range(3)]
        n = ((((1 + self.m) + 4 * (e * e)) + g[0] * x[0]) + g[1] * x[1]) + g[2] * x[2]
        u = 1 / n
        self.w = [self.w[j] + g[j] * (e * u) for j in range(3)]
        self.p = [self.p[j] * max(1 - (g[j] * x[j]) * u, 0.0) for j in range(3)]
        self.m = self.m + 1 / 16 * (e * e - self.m)


def plain_prediction(v, t, d):
    a = v[t - 3 * d] if t >= 3 * d else None
    c = v[t + d] if t + d < len(v) else None
    e = v[t + 3 * d] if t + 3 * d < len(v) else None
    b = v[t - d]
    if c is None:
        return b
    if a is not None and e is not None:
        return (9 * (b + c) - (a + e)) / 16
    if a is not None:
        return ((6 * b + 3 * c) - a) / 8
    if e is not None:
        return ((3 * b + 6 * c) - e) / 8
    return (b + c) / 2


def cosine(i, n_frames):
    """Return c(i) of the page."""
    if i > 2 * n_frames:
        return cosine(4 * n_frames - i, n_frames)
    if i > n_frames:
        return -cosine(2 * n_frames - i, n_frames)
    if i == n_frames:
        return 0.0
    angle = i * float.fromhex("0x1.921fb54442d18p+0") / n_frames
    square, z = angle * angle, 1.0
    for j in range(11, 0, -1):
        z = 1 - z * square / (2 * j * (2 * j - 1))
    return z


def values_of_cosines(coded):
    """Return the values of one column from cosine coefficients."""
    n_frames = len(coded)
    cosines = [cosine(i, n_frames) for i in range(4 * n_frames)]
    even, odd = [coded[0] * sqrt(1 / n_frames)] * n_frames, [0.0] * n_frames
    for k, coefficient in enumerate(coded[1:], start=1):
        sums = odd if k % 2 else even
        for t in range(n_frames):
            wave = sqrt(2 / n_frames) * cosines[(2 * t + 1) * k % (4 * n_frames)]
            sums[t] += coefficient * wave
    return [e + o for e, o in zip(even, odd, strict=True)]


def basis_vectors(rows, n_frames, lengths, n_reused=0, rests=(), r=0, kind=""):
    """Return the basis vectors, C T_b numbers each, divided by the given length or their own.

    The kind is "cosines", "adaptive" or "".
    """
    vectors, filters = [], None
    for number, (coded, length) in enumerate(zip(rows, lengths, strict=True)):
        if kind == "adaptive" and number in (0, n_reused):
            filters = [Filter() for _ in range(3)]
        if filters and any(coded):
            for level in filters:
                level.begin_mode()
        active = filters if any(coded) else None
        vectors.append(basis_vector(coded, n_frames, length, rests, r, kind == "cosines", active))
    return vectors


def basis_vector(coded, n_frames, length=None, rests=(), r=0, has_cosines=False, filters=None):
    values = []
    for first in range(0, len(coded), n_frames):
        column = coded[first : first + n_frames]
        if has_cosines:
            values += values_of_cosines(column)
        else:
            values += values_at_times(column, rests, r, filters)
    length = length or length_of(values)
    return [value / length for value in values]


def length_of(values):
    """Return the Euclidean norm, or 1 if it is 0."""
    total = 0.0
    for value in values:
        total += value * value
    return sqrt(total) or 1.0


def read_corrections(payload, n_columns, n_frames, n_verts):
    """Return the step, and the integers of corrections by frame and vertex."""
    payload = Payload(payload)
    step, n_corrected, n = payload.number("f"), payload.varint(), payload.varint()
    need(0 < step < 1e6 and n_corrected <= n_verts)
    need(n_corrected <= n <= n_frames * n_verts)
    lengths = [n_corrected, n_corrected, n, *[n] * n_columns]
    numbers = integers(payload.rest(), lengths, [0, 1, 2, *[3] * n_columns])
    vertex_steps, counts, frame_steps, *columns = numbers
    corrections, vertex, rows = {}, 0, iter(zip(frame_steps, *columns, strict=True))
    for vertex_step, count in zip(vertex_steps, counts, strict=True):
        vertex, frame, previous = vertex + vertex_step, 0, None
        for _ in range(count + 1):
            frame_step, *offset = next(rows)
            frame += frame_step
            if previous is not None and frame_step == 1:
                offset = [a + b for a, b in zip(offset, previous, strict=True)]
            corrections[frame, vertex] = previous = offset
    need(len(corrections) == n and next(rows, None) is None)
    need(all(0 <= t < n_frames and 0 <= v < n_verts for t, v in corrections))
    return step, corrections


def frames_of(bases, fields, precision, corrections, placement, order):
    """Return the values of a track, frame after frame, vertices in output order.

    Parameters
    ----------
    bases : list of list of float
    fields : list of dict
        Decoded, by vertex.
    precision : int
        Bytes of the numbers in which products are summed.
    corrections : pair of a step and a dict of (frame, vertex) to list of int
    placement : Placement
    order : list of int
    """
    n_frames = len(bases[0]) // len(placement.origin)
    step, offsets = corrections
    if precision == 4:
        bases = [[single(value) for value in basis] for basis in bases]
        fields = [{v: single(value) for v, value in field.items()} for field in fields]
    rounded = single if precision == 4 else float
    numbers = array("f" if placement.number_type == 4 else "d")
    for t in range(n_frames):
        for v in order:
            for c, origin in enumerate(placement.origin):
                total = 0.0
                for basis, field in zip(bases, fields, strict=True):
                    total = rounded(total + rounded(basis[c * n_frames + t] * field[v]))
                if (t, v) in offsets:
                    total += offsets[t, v][c] * step
                numbers.append(total * placement.scale + origin)
    return numbers
