"""Weights from points: the paragraph of this name in "Prediction" of docs/format.md."""

import math

from conformance.rounding import single

TREND = 10000.0


def points_of(domain, positions, items, polygons, cells):
    """Return the point of each item, given the positions of a frame in output order.

    Parameters
    ----------
    domain : int
        Of TRACK.
    positions : list of float
    items : Items
    polygons : Polygons
    cells : list of list of int, or None
        Nodes of each cell.
    """
    vertices = [positions[at : at + 3] for at in range(0, len(positions), 3)]
    if domain == 1:
        corners = [[] for _ in polygons.sizes]
        faces = (face for face, size in enumerate(polygons.sizes) for _ in range(size - 2))
        for face, triangle in zip(faces, polygons.triangles, strict=True):
            corners[face] += triangle
    elif domain == 2:
        corners = [[vertex] for vertex in polygons.vertices_of_corners()]
    elif domain == 4:
        corners = [[items.vertices[row]] for row in range(items.n)]
    elif domain == 5:
        corners = cells
    else:
        corners = [[vertex] for _, vertex in sorted(zip(items.order, range(items.n), strict=True))]
    return [mean_of([vertices[corner] for corner in some]) for some in corners]


def mean_of(points):
    sums = [0.0] * 3
    for point in points:
        sums = [s + x for s, x in zip(sums, point, strict=True)]
    return [s / len(points) for s in sums]


def square(p):
    a, b, c = p
    return (a * a + b * b) + c * c


def k(s):
    return s * math.sqrt(s)


def covariance(p, q):
    a, b, c = (x * y for x, y in zip(p, q, strict=True))
    difference = [x - y for x, y in zip(p, q, strict=True)]
    return k(square(difference)) + TREND * (1 + ((a + b) + c))


def factorized(matrix):
    """Return l and g of a symmetric matrix, given as rows up to the diagonal."""
    lower, g = [], []
    for i, a in enumerate(matrix):
        c, row = [], []
        for j in range(i):
            c_ij = a[j]
            for c_ik, l_jk in zip(c, lower[j], strict=True):
                c_ij -= c_ik * l_jk
            c.append(c_ij)
            row.append(c_ij * g[j])
        pivot = a[i]
        for c_ij, l_ij in zip(c, row, strict=True):
            pivot -= c_ij * l_ij
        lower.append(row)
        g.append(1 / pivot)
    return lower, g


def solved(lower, g, b):
    """Return the solution for the right side b, given l and g."""
    y, n = [], len(b)
    for i in range(n):
        y_i = b[i]
        for l_ij, y_j in zip(lower[i], y, strict=True):
            y_i -= l_ij * y_j
        y.append(y_i)
    w = [0.0] * n
    for i in reversed(range(n)):
        w[i] = y[i] * g[i]
        for j in range(i + 1, n):
            w[i] -= lower[j][i] * w[j]
    return w


def weights_of(x, near, nugget):
    """Return the weights that predict a value at x from those at the points `near`."""
    offsets = [[a - b for a, b in zip(x_j, x, strict=True)] for x_j in near]
    total = 0.0
    for offset in offsets:
        total += math.sqrt(square(offset))
    h, n = total / len(near) or 1.0, len(near)
    p = [[a / h for a in offset] for offset in offsets]
    matrix = [[covariance(p[i], p[j]) for j in range(i + 1)] for i in range(n)]
    for i in range(n):
        matrix[i][i] += nugget
    lower, g = factorized(matrix)
    w = solved(lower, g, [covariance(p_i, [0.0] * 3) for p_i in p])
    weights = [single(w_i) for w_i in w]
    return weights if all(map(math.isfinite, weights)) else [0.0] * n
