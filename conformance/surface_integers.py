"""Tables of integers at the corners of triangles: "Integers on a surface" of docs/format.md."""

import struct

from conformance.bits import clip, need
from conformance.fields import read_fields, signed
from conformance.order import rotated, twins_of

WEIGHT_BYTES, WEIGHT_UNITS = 12, 4096
MAX_CONTEXTS, MAX_PREDICTION = 4, 2.0**30


def read_surface_integers(data, n_rows, width, triangles):
    """Return the rows of `surface(N, C)` of the page.

    `triangles` are the rows at the corners of each triangle.
    """
    need(1 <= width <= 16 and len(data) >= WEIGHT_BYTES)
    weights = [weight / WEIGHT_UNITS for weight in struct.unpack("<6h", data[:WEIGHT_BYTES])]
    around, parallelograms = find_predictors(triangles, n_rows)
    contexts = {row: near[:MAX_CONTEXTS] for row, near in enumerate(around)}
    columns = []
    for residuals in read_fields(data[WEIGHT_BYTES:], width, [contexts]):
        column = []
        for row, residual in enumerate(residuals):
            prediction = predict(column, around[row], parallelograms[row], weights)
            column.append(signed(prediction + residual))
        columns.append(column)
    return list(zip(*columns, strict=True))


def find_predictors(triangles, n_rows):
    """Return the rows around each row, and its parallelograms, all of earlier rows."""
    row_of = [row for triangle in triangles for row in triangle]
    around, parallelograms = ([[] for _ in range(n_rows)] for _ in range(2))
    for side, twin in enumerate(twins_of(triangles)):
        a, b = row_of[side], row_of[rotated(side, 1)]
        if side > twin or a == b:
            continue
        around[max(a, b)].append(min(a, b))
        third, row = sorted(row_of[rotated(one, 2)] for one in (side, twin))
        if side != twin and third != row and row > max(a, b):
            parallelograms[row].append((a, b, third))
    return around, parallelograms


def predict(column, around, parallelograms, weights):
    """Return the integer predicted from earlier rows of a column."""
    n = len(parallelograms)
    if n == 0:
        return column[around[0]] if around else column[-1] if column else 0
    p = float(sum(column[a] + column[b] for a, b, _ in parallelograms)) / (2 * n)
    q = float(sum(column[third] for *_, third in parallelograms)) / n
    r = float(sum(column[row] for row in around)) / len(around)
    k = min(n, 3)
    f, g = weights[2 * k - 2 : 2 * k]
    value = clip(p + (f * (p - q) + g * (r - p)), -MAX_PREDICTION, MAX_PREDICTION)
    return int(value - 0.5 if value < 0 else value + 0.5)
