"""Tables of integers at the corners of triangles: "Integers on a surface" of docs/format.md."""

import struct

from conformance.bits import BitStream, Model, SymbolModel, clip, need, new_symbol_model, stripped
from conformance.fields import signed
from conformance.order import rotated

WEIGHT_BYTES, WEIGHT_UNITS = 12, 4096
MAX_CONTEXTS, MAX_PREDICTION, LARGEST = 4, 2.0**30, 4095
N_SIZES, LONG = 29, 192


class Residuals:
    """Reader of residuals by the size that is predicted for them."""

    def __init__(self, data):
        self.stream = BitStream(stripped(data))
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


def first_probabilities(size):
    """Return the probabilities below each token of a geometric distribution."""
    middle = (80 + 32 * (size % 2)) * 2 ** (size // 2)
    g = 65536 * (middle - 72) // (middle + 216)
    tails = [65536, g, g * g // 65536]
    tails.append(g * tails[2] // 65536)
    while len(tails) < 16:
        tails.append(tails[-2] ** 2 // 65536)
    return [(32768 - tail // 2) * 32736 // 32768 + 2 * i for i, tail in enumerate(tails)]


def read_surface_integers(data, n_rows, width, triangles, twins):
    """Return the rows of `surface(N, C)` of the page.

    `triangles` are the rows at the corners of each triangle, `twins` those of their sides.
    """
    need(1 <= width <= 16 and len(data) >= WEIGHT_BYTES)
    weights = [weight / WEIGHT_UNITS for weight in struct.unpack("<6h", data[:WEIGHT_BYTES])]
    around, parallelograms = find_predictors(triangles, twins, n_rows)
    residuals = Residuals(data[WEIGHT_BYTES:])
    rows, coded, recent = [], [], [48] * width
    for number in range(n_rows):
        near = [coded[one] for one in around[number][:MAX_CONTEXTS]]
        row, own_residuals, own = [], [], 0
        for k in range(width):
            near_sum = sum(abs(one[k]) for one in near)
            mean = near_sum * (48 // len(near)) if near else recent[k]
            column = [one[k] for one in rows]
            prediction = predict(column, around[number], parallelograms[number], weights)
            deviation = mean_deviation(column, parallelograms[number], prediction, mean)
            expected = 2 * recent[k] + 72 + 2 * deviation + (mean + 48 * own if k else 2 * mean)
            octave = expected.bit_length() - 1
            size = 2 * (octave - 6) + (expected >> (octave - 1)) % 2
            vote = sum((one[k] > 0) - (one[k] < 0) for one in near)
            residual = residuals.read(size, vote)
            limited = min(abs(residual), LARGEST)
            own = (own + limited) // 2 if k else limited
            recent[k] += (48 * limited - recent[k]) // 8
            own_residuals.append(-limited if residual < 0 else limited)
            row.append(signed(prediction + residual))
        rows.append(tuple(row))
        coded.append(own_residuals)
    residuals.stream.end()
    return rows


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
