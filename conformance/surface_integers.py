"""Integers at the corners of triangles: "Integers on a surface" of docs/format.md."""

from conformance.bits import BitStream, Model, SymbolModel, clip, need, new_symbol_model, stripped
from conformance.fields import signed
from conformance.order import rotated

FITTED, BEST, COPIES, BY_CONTEXT = 1, 2, 4, 8
SAME, OWN, CHANGE, EXTRAPOLATED = range(4)
N_WEIGHTS, WEIGHT_UNITS = 6, 4096
MAX_CONTEXTS, MAX_PREDICTION, LARGEST = 4, 2.0**30, 4095
N_SIZES, LONG = 29, 192
LONGEST_RUN, MAX_HASH_BITS = 15, 15


class Residuals:
    """Reader of residuals by the size that is predicted for them."""

    def __init__(self, stream):
        self.stream = stream
        self.tokens = [SymbolModel(first_probabilities(size), 16) for size in range(N_SIZES)]
        self.long = new_symbol_model()
        self.negative = [Model(32768, 8) for _ in range(2 * MAX_CONTEXTS + 1)]

    def read(self, size, vote):
        magnitude = self.magnitude(size)
        if magnitude and self.stream.adaptive(self.negative[vote + MAX_CONTEXTS]):
            return -magnitude
        return magnitude

    def magnitude(self, size):
        token = self.stream.symbol(self.tokens[size])
        if token < 4:
            return token
        if token < 15:
            n = token // 2 - 1
            return (2 + token % 2) * 2**n + self.stream.raw(n)
        length = self.stream.symbol(self.long)
        high, n = 1, length
        if length == 15:
            n = self.stream.raw(4)
            high = 2**15 + self.stream.raw(15)
        return high * 2**n + self.stream.raw(n) + LONG - 1


class Copies:
    """Reader of whether a residual of a column repeats one that followed the same residuals."""

    def __init__(self, n_all_rows):
        self.hash_size = 2 ** min(n_all_rows.bit_length() + 3, MAX_HASH_BITS)
        self.latest = {}
        self.start_frame()

    def start_frame(self):
        self.hash, self.run, self.source = 0, 0, 0

    def read(self, stream, models, before, residual):
        """Return whether the next residual is a copy of `residual`, that of `self.source`."""
        key = before, residual == 0, self.run
        return stream.adaptive(models.setdefault(key, Model(60000 if self.run > 1 else 32768, 2)))

    def add(self, row, residual, is_copy):
        mixed = 2654435761 * residual % 2**32 // 2**17
        self.hash = (64 * self.hash + mixed) % self.hash_size
        if is_copy:
            self.source, self.run = self.source + 1, min(self.run + 1, LONGEST_RUN)
        else:
            self.source, self.run = self.latest.get(self.hash, 0), 0
        self.latest[self.hash] = row + 1


class Kind:
    """State of the frames of a kind."""

    def __init__(self, stream, width):
        self.choices = stream.raw(4)
        self.weights = [1.0, 0.0] * (N_WEIGHTS // 2)
        if self.choices & FITTED:
            self.weights = [int16_of(stream.raw(16)) / WEIGHT_UNITS for _ in range(N_WEIGHTS)]
        self.residuals = Residuals(stream)
        self.copy_models, self.recent, self.errors = {}, [48] * width, {}


def first_probabilities(size):
    """Return the probabilities below each token of a geometric distribution."""
    middle = (80 + 32 * (size % 2)) * 2 ** (size // 2)
    g = 65536 * (middle - 72) // (middle + 216)
    tails = [65536, g, g * g // 65536]
    tails.append(g * tails[2] // 65536)
    while len(tails) < 16:
        tails.append(tails[-2] ** 2 // 65536)
    return [(32768 - tail // 2) * 32736 // 32768 + 2 * i for i, tail in enumerate(tails)]


def read_surface_integers(data, n_frames, n_rows, width, triangles, twins):
    """Return the frames of `surface(T, N, C)` of the page, each a list of rows.

    `triangles` are the rows at the corners of each triangle, `twins` those of their sides.
    """
    need(1 <= width <= 16)
    stream = BitStream(stripped(data))
    predictors = find_predictors(triangles, twins, n_rows)
    copies = [Copies(n_frames * n_rows) for _ in range(width)]
    kinds, kind, kind_models, frames, coded = {}, OWN, {}, [], []
    for number in range(n_frames):
        if number:
            before, kind = kind, 0
            for node in (1, 2):
                model = kind_models.setdefault((before, node + kind), Model(32768, 0))
                kind = 2 * kind + stream.adaptive(model)
        if kind == SAME:
            frames.append(frames[-1])
            coded += [[0] * width] * n_rows
            continue
        if kind not in kinds:
            kinds[kind] = Kind(stream, width)
        rows = read_frame(stream, kinds[kind], copies, coded, predictors, width)
        one, other = ([[0] * width] * n_rows for _ in range(2))
        if kind in (CHANGE, EXTRAPOLATED):
            one = frames[-1]
        if kind == EXTRAPOLATED:
            need(number > 1, "the second frame is extrapolated")
            one = [[2 * x for x in row] for row in one]
            other = frames[-2]
        frames.append(
            [
                tuple(signed(d + x - y) for d, x, y in zip(*three, strict=True))
                for three in zip(rows, one, other, strict=True)
            ]
        )
    stream.end()
    return frames


def read_frame(stream, kind, copies, coded, predictors, width):
    """Return the rows of a frame, and append their residuals to those of all frames."""
    around, parallelograms = predictors
    rows, first, choices, recent = [], len(coded), kind.choices, kind.recent
    for one in copies:
        one.start_frame()
    for number in range(len(around)):
        near = [coded[first + one] for one in around[number][:MAX_CONTEXTS]]
        row, own_residuals, own, before = [], [], 0, 0
        context = context_of(number, parallelograms[number]) if choices & BY_CONTEXT else 0
        for k in range(width):
            near_sum = sum(abs(one[k]) for one in near)
            mean = near_sum * (48 // len(near)) if near else recent[k]
            column = [one[k] for one in rows]
            prediction = predict(column, around[number], parallelograms[number], kind.weights)
            candidates, earlier_size = [], recent[k]
            if choices & BEST and parallelograms[number]:
                candidates = [*ends(column, parallelograms[number]), prediction]
                candidates += [column[one] for one in around[number][:2]]
                errors = kind.errors.setdefault((k, context), [0] * 5)
                prediction = candidates[errors.index(min(errors))]
                earlier_size = 3 * min(errors) // 4
            deviation = mean_deviation(column, parallelograms[number], prediction, mean)
            expected = 2 * earlier_size + 72 + 2 * deviation + (mean + 48 * own if k else 2 * mean)
            octave = expected.bit_length() - 1
            size = 2 * (octave - 6) + (expected >> (octave - 1)) % 2
            vote = sum((one[k] > 0) - (one[k] < 0) for one in near)
            is_copy = False
            if choices & COPIES and copies[k].source:
                source = coded[copies[k].source][k]
                is_copy = copies[k].read(stream, kind.copy_models, before, source)
                before = 1 if is_copy else 2
            residual = source if is_copy else kind.residuals.read(size, vote)
            limited = clip(residual, -LARGEST, LARGEST)
            own = (own + abs(limited)) // 2 if k else abs(limited)
            recent[k] += (48 * abs(limited) - recent[k]) // 8
            if choices & COPIES:
                copies[k].add(first + number, limited, is_copy)
            own_residuals.append(limited)
            row.append(signed(prediction + residual))
            for i, candidate in enumerate(candidates):
                distance = min(abs(signed(row[k] - candidate)), LARGEST)
                errors[i] += (64 * distance - errors[i]) // 4
        rows.append(tuple(row))
        coded.append(own_residuals)
    return rows


def int16_of(bits):
    return bits - 65536 if bits >= 32768 else bits


def find_predictors(triangles, twins, n_rows):
    """Return the rows around each row, and its parallelograms, all of earlier rows."""
    row_of = [row for triangle in triangles for row in triangle]
    around, parallelograms = ([[] for _ in range(n_rows)] for _ in range(2))
    for number, triangle in enumerate(triangles):
        if len(set(triangle)) < 3:
            continue
        row = max(triangle)
        side = rotated(3 * number + triangle.index(row), 1)
        a, b = row_of[side], row_of[rotated(side, 1)]
        around[row] += [one for one in (a, b) if one not in around[row]]
        third = row_of[rotated(twins[side], 2)]
        if twins[side] != side and third < row:
            parallelograms[row].append((a, b, third))
    return around, parallelograms


def context_of(row, parallelograms):
    """Return the number of parallelograms, and which end of the first side is the previous row."""
    if not parallelograms:
        return 0
    a, b, _ = parallelograms[0]
    end = 1 if a == row - 1 else 2 if b == row - 1 else 0
    return min(len(parallelograms), 3), end


def ends(column, parallelograms):
    """Return the integers that the first and the last parallelogram predict."""
    points = [column[a] + column[b] - column[third] for a, b, third in parallelograms]
    return [int(clip(point, -MAX_PREDICTION, MAX_PREDICTION)) for point in (points[0], points[-1])]


def predict(column, around, parallelograms, weights):
    """Return the integer predicted from earlier rows of a column."""
    n = len(parallelograms)
    if n == 0:
        return column[around[0]] if around else column[-1] if column else 0
    share, share_around = 1.0 / n, 1.0 / len(around)
    p = float(sum(column[a] + column[b] for a, b, _ in parallelograms)) * (0.5 * share)
    q = float(sum(column[third] for *_, third in parallelograms)) * share
    r = float(sum(column[row] for row in around)) * share_around
    k = min(n, 3)
    f, g = weights[2 * k - 2 : 2 * k]
    value = clip(p + (f * (p - q) + g * (r - p)), -MAX_PREDICTION, MAX_PREDICTION)
    return int(value - 0.5 if value < 0 else value + 0.5)


def mean_deviation(column, parallelograms, prediction, mean):
    """Return 48 times the mean distance of parallelograms from a prediction.

    Without parallelograms this is `mean`.
    """
    if not parallelograms:
        return mean
    points = [column[a] + column[b] - column[third] for a, b, third in parallelograms]
    total = float(sum(abs(point - prediction) for point in points))
    return int(min(total * (48.0 / len(points)), 48.0 * LARGEST))
