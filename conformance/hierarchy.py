"""Hierarchy, stencils and smooth fields: "Resolutions" and "Smooth fields" of the page."""

from dataclasses import dataclass

from conformance.rounding import single

SMALL_COEFFICIENTS = [
    float.fromhex(name)
    for name in [
        "0x1.dce1bep-4",
        "0x1.c88ecap-3",
        "0x1.90c9f2p-3",
        "0x1.42f624p-3",
        "0x1.de9dbep-4",
        "0x1.46d874p-4",
        "0x1.9c7d66p-5",
        "0x1.e26702p-6",
        "0x1.062d4cp-6",
        "0x1.09aa90p-7",
        "0x1.f76afep-9",
        "0x1.bf4530p-10",
        "0x1.75ae4ap-11",
        "0x1.265b92p-12",
        "0x1.b658c2p-14",
        "0x1.353e56p-15",
        "0x1.9e56bcp-17",
        "0x1.082416p-18",
        "0x1.411ce0p-20",
    ]
]
LARGE_COEFFICIENTS = [
    float.fromhex(name)
    for name in [
        "0x1.033016p-4",
        "0x1.ffdabcp-4",
        "0x1.ecc870p-4",
        "0x1.ce937cp-4",
        "0x1.a76582p-4",
        "0x1.79e596p-4",
        "0x1.48ec1ep-4",
        "0x1.17385ap-4",
        "0x1.ce63fcp-5",
        "0x1.757be8p-5",
        "0x1.2652a0p-5",
        "0x1.c4a532p-6",
        "0x1.53b0cap-6",
        "0x1.f1a970p-7",
        "0x1.63e6a6p-7",
        "0x1.f10ff8p-8",
        "0x1.530154p-8",
        "0x1.c3b76ap-9",
        "0x1.260d26p-9",
        "0x1.7623f4p-10",
        "0x1.d156b2p-11",
        "0x1.1af134p-11",
        "0x1.507faap-12",
        "0x1.8778c4p-13",
        "0x1.bd9c14p-14",
        "0x1.f06c7cp-15",
        "0x1.0eb08cp-15",
    ]
]
N_SMOOTH, SMALL_GRAPH = 16, 4096
MAX_RESOLUTIONS, MAX_PATH_DEGREE, MAX_PATHS, MAX_CONTEXTS = 20, 24, 15, 8


def scattered(number):
    """Return the hash h that ranks vertices and generates signs."""
    mixed = number * 0x9E3779B97F4A7C15 % 2**64
    return (mixed ^ (mixed >> 31)) * 0xBF58476D1CE4E5B9 % 2**64


def edges_of(faces, n_verts):
    """Return the neighbors of each vertex, as sets."""
    near = {v: set() for v in range(n_verts)}
    for face in faces:
        for v in face:
            near[v] |= set(face) - {v}
    return near


def dividing(near):
    """Return the vertices that divide an edge."""
    ends = {v for v in near if len(near[v]) > 2 and all(len(near[u]) == 2 for u in near[v])}
    return {v for v in near if len(near[v]) == 2 and near[v] <= ends}


def thinned(near, vertices, last):
    """Return an independent subset, selected by falling rank; those of `last` come last."""
    selected = set()
    for v in sorted(vertices, key=lambda v: (v not in last, scattered(v)), reverse=True):
        if not near[v] & selected:
            selected.add(v)
    return selected


def coarser_graph(near, kept):
    """Return the graph of the kept vertices, adjacent if an edge joins their cells."""
    cell = {v: v if v in kept else max(near[v] & kept) for v in near}
    coarser = {v: set() for v in sorted(kept)}
    for v, around in near.items():
        coarser[cell[v]] |= {cell[other] for other in around} - {cell[v]}
    return coarser


def stencil_of(near, v, known, size, radius=3):
    """Return up to `size` pairs of a known vertex and its distance, nearest first."""
    stencil, ring, seen = [], {v: 1}, {v}
    for distance in range(1, radius + 1):
        following = {}
        for u, paths in ring.items():
            if u == v or len(near[u]) <= MAX_PATH_DEGREE:
                for w in near[u] - seen:
                    following[w] = following.get(w, 0) + paths
        seen |= set(following)
        nearest = set(following) & known
        stencil += [
            (w, distance) for w in sorted(nearest, key=lambda w: (-min(following[w], MAX_PATHS), w))
        ]
        ring = following
    return stencil[:size]


def smooth_fields(near):
    """Return the values of the smooth fields by vertex."""
    members, zero = sorted(near), [0.0] * N_SMOOTH
    position = {v: i for i, v in enumerate(members)}
    rows = [[position[u] for u in sorted(near[v])] for v in members]
    signs = [
        [1.0 if scattered(16 * i + f) >> 63 else -1.0 for f in range(N_SMOOTH)]
        for i in range(len(members))
    ]
    after, before = [zero] * len(members), [zero] * len(members)  # b_{k+1}, b_{k+2}
    coefficients = LARGE_COEFFICIENTS if len(near) > SMALL_GRAPH else SMALL_COEFFICIENTS
    for k in reversed(range(len(coefficients))):
        now = []
        for i, row in enumerate(rows):
            factor = single((2.0 if k else 1.0) / len(row)) if row else 0.0
            sums = zero
            for j in row:
                sums = [single(x + y) for x, y in zip(sums, after[j], strict=True)]
            now.append(
                [
                    single(single(single(factor * n) - b) + coefficients[k] * z)
                    for n, b, z in zip(sums, before[i], signs[i], strict=True)
                ]
            )
        after, before = now, after
    return {v: after[i] for v, i in position.items()}


@dataclass
class Vertex:
    """A vertex in coding order, with its stencil, context neighbors and smooth fields."""

    number: int
    stencil: list
    contexts: list
    smooth: dict
    level: tuple = ()
    """The number of vertices of the resolution, and the number of the level in it."""


def resolutions_of(faces, n_verts, size):
    """Return the vertices in coding order, a list per resolution, from the coarsest."""
    near, finest_first, n_total = edges_of(faces, n_verts), [], 0
    divide = dividing(near)
    while True:
        n_total += len(near)
        may_grow = len(finest_first) < MAX_RESOLUTIONS and n_total <= 4 * n_verts
        if not any(near.values()) or not may_grow:
            break
        kept = thinned(near, near, divide)
        levels, others = [], set(near) - kept
        for _ in range(2):
            levels.append(thinned(near, others, divide))
            others -= levels[-1]
        own = set() if finest_first else divide
        finest_first.append(vertices_of(near, kept, [*levels, others], size, own))
        near = coarser_graph(near, kept)
    coarsest = [Vertex(v, [], below(near, v, set(near)), {}) for v in sorted(near)]
    return [coarsest, *reversed(finest_first)]


def vertices_of(near, known, levels, size, divide):
    """Return the vertices of the levels of a resolution."""
    smooth, known, vertices = smooth_fields(near), set(known), []
    for number, level in enumerate(levels):
        for v in sorted(level):
            stencil = stencil_of(near, v, known, size, 1 if v in divide else 3)
            contexts = (below(near, v, level) + [u for u, _ in stencil])[:MAX_CONTEXTS]
            vertices.append(Vertex(v, stencil, contexts, smooth, (len(near), number)))
        known |= level
    return vertices


def below(near, v, level):
    """Return the lower neighbors in the level, the first context neighbors."""
    return sorted(u for u in near[v] & level if u < v)[:MAX_CONTEXTS]


def passes_of(resolutions):
    """Return the context neighbors of each column by pass; columns are in coding order."""
    order = [vertex.number for resolution in resolutions for vertex in resolution]
    column = {v: i for i, v in enumerate(order)}
    return [
        {column[v.number]: [column[u] for u in v.contexts] for v in resolution}
        for resolution in resolutions
    ]
