"""Fields from their residuals: "Prediction" of docs/format.md, in single precision."""

from conformance.hierarchy import SMALL_GRAPH
from conformance.points import factorized, solved, weights_of
from conformance.rounding import single


class Filter:
    """Predictor weights of one vertex, and their covariances."""

    def __init__(self, hops):
        self.size = len(hops)
        self.d = [single(hops[0] ** 2 / h**2) for h in hops]
        total = 0.0
        for d in self.d:
            total = single(total + d)
        self.u = [single(d / total) for d in self.d]
        self.w = list(self.u)
        self.c = [[0.0] * (i + 1) for i in range(self.size)]

    def loosen(self, r):
        d, u = self.d, self.u
        for i, row in enumerate(self.c):
            for j in range(i):
                row[j] = single(row[j] - single(r * single(u[i] * d[j])))
            row[i] = single(row[i] + single(r * single(d[i] - single(u[i] * d[i]))))

    def predict(self, z):
        p = 0.0
        for w, z_j in zip(self.w, z, strict=True):
            p = single(p + single(w * z_j))
        return p

    def observe(self, z, p, e, q, t):
        z = [single(z_j - p) for z_j in z]
        g = [0.0] * self.size
        for i, row in enumerate(self.c):
            a = 0.0
            for j in range(i):
                a = single(a + single(row[j] * z[j]))
                g[j] = single(g[j] + single(row[j] * z[i]))
            g[i] = single(a + single(row[i] * z[i]))
        energy = 0.0
        for z_j in z:
            energy = single(energy + single(z_j * z_j))
        m = single(single(q + single(t * energy)) + single(single(e * e) / 32))
        for z_j, g_j in zip(z, g, strict=True):
            m = single(m + single(z_j * g_j))
        b = single(1 / m)
        for i, row in enumerate(self.c):
            c = single(g[i] * b)
            self.w[i] = single(self.w[i] + single(c * e))
            for j in range(i + 1):
                row[j] = single(row[j] - single(c * g[j]))


NOISE, RELATIVE_NOISE = single(0.3), single(0.001)


def offsets(values, stencil, own):
    """Return z and y: values at the stencil and at the vertex, minus that at the first."""
    first = values[stencil[0][0]]
    return [single(values[j] - first) for j, _ in stencil], single(values[own] - first)


def initial_filter(vertex, size, points, nugget):
    """Return the filter of a vertex after the smooth fields, or with weights from points."""
    weights = Filter([hops for _, hops in vertex.stencil])
    if points is None:
        observe_smooth(weights, vertex, size)
    else:
        near = [points[j] for j, _ in vertex.stencil]
        weights.w = weights_of(points[vertex.number], near, nugget)
    weights.loosen(single(single(0.15) * 0.5))
    return weights


def observe_smooth(weights, vertex, size):
    weights.loosen(0.5)
    n_smooth = len(vertex.smooth[vertex.number])
    observed = []
    for f in range(n_smooth):
        values = {v: vertex.smooth[v][f] for v in [*(j for j, _ in vertex.stencil), vertex.number]}
        observed.append(offsets(values, vertex.stencil, vertex.number))
    q = 0.0
    for z, y in observed:
        for z_j in z:
            difference = single(z_j - y)
            q = single(q + single(difference * difference))
    noise = 0.0002 if len(vertex.smooth) > SMALL_GRAPH else 0.004
    q = single(single(single(single(noise) / size) * q) + 2.0**-32)
    for z, y in observed:
        p = weights.predict(z)
        weights.observe(z, p, single(y - p), q, 0.0)


MAX_RELATED = 4


class Regression:
    """Regression of innovations on those of the fields of a related track."""

    def __init__(self, related, n_modes):
        self.related, n = related[:MAX_RELATED], len(related[:MAX_RELATED])
        self.gram = [[0.0] * n for _ in range(n)]
        self.products = [[0.0] * n_modes for _ in range(n)]
        self.factors = []
        self.level = ()

    def innovations(self, weights, vertex):
        results = []
        for field in self.related:
            z, y = offsets(field, vertex.stencil, vertex.number)
            results.append(single(y - weights.predict(z)))
        return results

    def begin(self, level):
        """Solve the normal equations at the beginning of a level, and halve them."""
        if level == self.level:
            return
        self.level, n = level, len(self.gram)
        rows = [[*self.gram[i][:i], self.gram[i][i] + 1.0] for i in range(n)]
        lower, inverse = factorized(rows)
        columns = zip(*self.products, strict=True)
        solutions = [solved(lower, inverse, list(column)) for column in columns]
        self.factors = [list(row) for row in zip(*solutions, strict=True)]
        self.gram = [[0.5 * number for number in row] for row in self.gram]
        self.products = [[0.5 * number for number in row] for row in self.products]

    def correction(self, known, mode):
        total = 0.0
        for row, innovation in zip(self.factors, known, strict=True):
            total += row[mode] * innovation
        return total

    def add(self, known, own):
        """Add a vertex: the innovations of the related fields, and those of the modes."""
        for i, a in enumerate(known):
            for j in range(i + 1):
                self.gram[i][j] += a * known[j]
            for mode, innovation in enumerate(own):
                self.products[i][mode] += a * innovation


def predict_fields(
    resolutions, residuals, size, n_learned, key=(), points=None, nugget=0.0, related=()
):
    """Return the values of each mode in steps, as dicts by vertex.

    Parameters
    ----------
    resolutions : list of list of Vertex
    residuals : list of list of int
        For each mode, by column.
    size : int
        S.
    n_learned : int
        L.
    key : list of dict
        Values of the modes of the key block.
    points : list, optional
        Point of each vertex, if the initial weights follow from points.
    nugget : float
    related : list of dict
        Values of the fields of the related track.
    """
    regression = Regression(related, len(residuals))
    t = single(RELATIVE_NOISE / size)
    fields = [{} for _ in residuals]
    for column, vertex in enumerate(v for resolution in resolutions for v in resolution):
        v = vertex.number
        if not vertex.stencil:
            for field, row in zip(fields, residuals, strict=True):
                field[v] = float(row[column])
            continue
        weights = initial_filter(vertex, size, points, nugget)
        regression.begin(vertex.level)
        known, own = regression.innovations(weights, vertex), []
        for field in key[:n_learned]:
            z, y = offsets(field, vertex.stencil, v)
            p = weights.predict(z)
            weights.observe(z, p, single(y - p), NOISE, t)
        for mode, (field, row) in enumerate(zip(fields, residuals, strict=True)):
            first = field[vertex.stencil[0][0]]
            z = [single(field[j] - first) for j, _ in vertex.stencil]
            p = weights.predict(z)
            correction = regression.correction(known, mode)
            field[v] = ((first + p) + correction if related else first + p) + row[column]
            own.append(correction + row[column])
            if mode < n_learned:
                weights.observe(z, p, single(row[column]), NOISE, t)
        regression.add(known, own)
    return fields
