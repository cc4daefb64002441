"""Values of fields from their residuals: "Prediction" of docs/format.md, in single precision."""

from conformance.hierarchy import SMALL_GRAPH
from conformance.rounding import single


class Filter:
    """The weights of one vertex, and the variances of their errors."""

    def __init__(self, hops):
        self.size = len(hops)
        self.d = [single(hops[0] ** 2 / one**2) for one in hops]
        total = 0.0
        for one in self.d:
            total = single(total + one)
        self.u = [single(one / total) for one in self.d]
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
        for weight, one in zip(self.w, z, strict=True):
            p = single(p + single(weight * one))
        return p

    def observe(self, z, p, e, q, t):
        z = [single(one - p) for one in z]
        g = [0.0] * self.size
        for i, row in enumerate(self.c):
            a = 0.0
            for j in range(i):
                a = single(a + single(row[j] * z[j]))
                g[j] = single(g[j] + single(row[j] * z[i]))
            g[i] = single(a + single(row[i] * z[i]))
        energy = 0.0
        for one in z:
            energy = single(energy + single(one * one))
        m = single(single(q + single(t * energy)) + single(single(e * e) / 32))
        for one, other in zip(z, g, strict=True):
            m = single(m + single(one * other))
        b = single(1 / m)
        for i, row in enumerate(self.c):
            c = single(g[i] * b)
            self.w[i] = single(self.w[i] + single(c * e))
            for j in range(i + 1):
                row[j] = single(row[j] - single(c * g[j]))


Q, T_OF_ALL = single(0.3), single(0.001)


def offsets(values, stencil, own):
    """z and y: values at the stencil, and at the vertex, less that at the first of the stencil."""
    first = values[stencil[0][0]]
    return [single(values[j] - first) for j, _ in stencil], single(values[own] - first)


def first_filter(vertex, size):
    """The filter of a vertex behind the smooth fields."""
    found = Filter([hops for _, hops in vertex.stencil])
    found.loosen(0.5)
    n_smooth = len(vertex.smooth[vertex.number])
    observed = []
    for f in range(n_smooth):
        values = {v: vertex.smooth[v][f] for v in [*(j for j, _ in vertex.stencil), vertex.number]}
        observed.append(offsets(values, vertex.stencil, vertex.number))
    q = 0.0
    for z, y in observed:
        for one in z:
            apart = single(one - y)
            q = single(q + single(apart * apart))
    noise = 0.0002 if len(vertex.smooth) > SMALL_GRAPH else 0.004
    q = single(single(single(single(noise) / size) * q) + 2.0**-32)
    for z, y in observed:
        p = found.predict(z)
        found.observe(z, p, single(y - p), q, 0.0)
    found.loosen(single(single(0.15) * 0.5))
    return found


def predict_fields(resolutions, residuals, size, n_learned, key=()):
    """Values in steps of each mode, by vertex: lists of dicts.

    Parameters
    ----------
    resolutions : list of list of Vertex
    residuals : list of list of int
        Of each mode, by column.
    size : int
        S.
    n_learned : int
        L.
    key : list of dict
        Values of the key block.
    """
    t = single(T_OF_ALL / size)
    fields = [{} for _ in residuals]
    for column, vertex in enumerate(one for level in resolutions for one in level):
        v = vertex.number
        if not vertex.stencil:
            for field, row in zip(fields, residuals, strict=True):
                field[v] = float(row[column])
            continue
        weights = first_filter(vertex, size)
        for field in key[:n_learned]:
            z, y = offsets(field, vertex.stencil, v)
            p = weights.predict(z)
            weights.observe(z, p, single(y - p), Q, t)
        for mode, (field, row) in enumerate(zip(fields, residuals, strict=True)):
            first = field[vertex.stencil[0][0]]
            z = [single(field[j] - first) for j, _ in vertex.stencil]
            p = weights.predict(z)
            field[v] = (first + p) + row[column]
            if mode < n_learned:
                weights.observe(z, p, single(row[column]), Q, t)
    return fields
