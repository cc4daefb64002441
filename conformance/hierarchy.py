"""What predicts each vertex, and smooth fields: "Resolutions" and "Smooth fields" of the page."""

from dataclasses import dataclass

from conformance.rounding import single

SMALL_COEFFICIENTS = [
    float.fromhex(one)
    for one in [
        "0x1.dce1bdc8232d5p-4",
        "0x1.c88eca01f7548p-3",
        "0x1.90c9f17279f49p-3",
        "0x1.42f6243124030p-3",
        "0x1.de9dbeb3cfe63p-4",
        "0x1.46d873ea68172p-4",
        "0x1.9c7d66e0f2507p-5",
        "0x1.e26701e7bbbbcp-6",
        "0x1.062d4b88def08p-6",
        "0x1.09aa8fb7cfa0dp-7",
        "0x1.f76afdf819befp-9",
        "0x1.bf452f2e2734bp-10",
        "0x1.75ae4ae1d73adp-11",
        "0x1.265b91313fe79p-12",
        "0x1.b658c20e8fffep-14",
        "0x1.353e554609e80p-15",
        "0x1.9e56bbb81cef0p-17",
        "0x1.0824165a5f9acp-18",
        "0x1.411ce06b569e5p-20",
    ]
]
LARGE_COEFFICIENTS = [
    float.fromhex(one)
    for one in [
        "0x1.033015e9c7c3dp-4",
        "0x1.ffdabb4e96ce7p-4",
        "0x1.ecc86f42d4ca0p-4",
        "0x1.ce937cfb1b20cp-4",
        "0x1.a76582e9f71ecp-4",
        "0x1.79e595ff834dbp-4",
        "0x1.48ec1d6a164b7p-4",
        "0x1.173859f9496a5p-4",
        "0x1.ce63fbd8df98fp-5",
        "0x1.757be8cf0630ep-5",
        "0x1.26529fe21ccfcp-5",
        "0x1.c4a531bbef924p-6",
        "0x1.53b0cad00f756p-6",
        "0x1.f1a97017cc979p-7",
        "0x1.63e6a65d73887p-7",
        "0x1.f10ff7465dd65p-8",
        "0x1.5301534620b01p-8",
        "0x1.c3b7694fba930p-9",
        "0x1.260d26a215fcap-9",
        "0x1.7623f37bb3f8bp-10",
        "0x1.d156b25082001p-11",
        "0x1.1af134a6e5f14p-11",
        "0x1.507fa94287856p-12",
        "0x1.8778c4a2d405bp-13",
        "0x1.bd9c13fa033b9p-14",
        "0x1.f06c7c3348542p-15",
        "0x1.0eb08cb3ec0dap-15",
    ]
]
N_SMOOTH, SMALL_GRAPH = 16, 4096
MOST_RESOLUTIONS, LARGEST_PASSAGE, MOST_PATHS, MOST_CONTEXTS = 20, 24, 15, 8


def scattered(number):
    """The hash of a number by which vertices are ranked and signs are made."""
    mixed = number * 0x9E3779B97F4A7C15 % 2**64
    return (mixed ^ (mixed >> 31)) * 0xBF58476D1CE4E5B9 % 2**64


def edges_of(faces, n_verts):
    """The vertices next to each vertex, as sets."""
    near = {v: set() for v in range(n_verts)}
    for face in faces:
        for v in face:
            near[v] |= set(face) - {v}
    return near


def thinned(near, left):
    """Of a set of vertices those that are taken by falling rank, none next to another."""
    taken = set()
    for v in sorted(left, key=scattered, reverse=True):
        if not near[v] & taken:
            taken.add(v)
    return taken


def coarser_graph(near, kept):
    """The graph of what is kept: two are next to each other if an edge joins their cells."""
    cell = {v: v if v in kept else max(near[v] & kept) for v in near}
    coarser = {v: set() for v in sorted(kept)}
    for v, around in near.items():
        coarser[cell[v]] |= {cell[other] for other in around} - {cell[v]}
    return coarser


def stencil_of(near, v, known, size):
    """Up to `size` pairs of a known vertex and its distance, the nearest first."""
    found, ring, seen = [], {v: 1}, {v}
    for distance in (1, 2, 3):
        following = {}
        for u, paths in ring.items():
            if u == v or len(near[u]) <= LARGEST_PASSAGE:
                for w in near[u] - seen:
                    following[w] = following.get(w, 0) + paths
        seen |= set(following)
        nearest = set(following) & known
        found += [
            (w, distance)
            for w in sorted(nearest, key=lambda w: (-min(following[w], MOST_PATHS), w))
        ]
        ring = following
    return found[:size]


def smooth_fields(near):
    """Of each vertex of a graph its values in the smooth fields, of single precision."""
    members, zero = sorted(near), [0.0] * N_SMOOTH
    place = {v: i for i, v in enumerate(members)}
    rows = [[place[u] for u in sorted(near[v])] for v in members]
    signs = [
        [1.0 if scattered(16 * i + f) >> 63 else -1.0 for f in range(N_SMOOTH)]
        for i in range(len(members))
    ]
    after, before = [zero] * len(members), [zero] * len(members)  # b_{k+1}, b_{k+2}
    coefficients = LARGE_COEFFICIENTS if len(near) > SMALL_GRAPH else SMALL_COEFFICIENTS
    for k in reversed(range(len(coefficients))):
        now = []
        for i, row in enumerate(rows):
            factor = (2.0 if k else 1.0) / len(row) if row else 0.0
            sums = zero
            for j in row:
                sums = [one + other for one, other in zip(sums, after[j], strict=True)]
            now.append(
                [
                    ((factor * n) - b) + coefficients[k] * z
                    for n, b, z in zip(sums, before[i], signs[i], strict=True)
                ]
            )
        after, before = now, after
    return {v: [single(one) for one in after[i]] for v, i in place.items()}


@dataclass
class Vertex:
    """A vertex in coding order: its stencil with distances, its contexts, its smooth fields."""

    number: int
    stencil: list
    contexts: list
    smooth: dict


def resolutions_of(faces, n_verts, size):
    """Vertices in coding order, a list for each resolution, from the coarsest."""
    near, finest_first, n_together = edges_of(faces, n_verts), [], 0
    while True:
        n_together += len(near)
        has_room = len(finest_first) < MOST_RESOLUTIONS and n_together <= 4 * n_verts
        if not any(near.values()) or not has_room:
            break
        kept = thinned(near, near)
        levels, left = [], set(near) - kept
        for _ in range(2):
            levels.append(thinned(near, left))
            left -= levels[-1]
        finest_first.append(vertices_of(near, kept, [*levels, left], size))
        near = coarser_graph(near, kept)
    coarsest = [Vertex(v, [], below(near, v, set(near)), {}) for v in sorted(near)]
    return [coarsest, *reversed(finest_first)]


def vertices_of(near, known, levels, size):
    """Vertices of the levels of a resolution."""
    smooth, known, found = smooth_fields(near), set(known), []
    for level in levels:
        for v in sorted(level):
            stencil = stencil_of(near, v, known, size)
            contexts = (below(near, v, level) + [u for u, _ in stencil])[:MOST_CONTEXTS]
            found.append(Vertex(v, stencil, contexts, smooth))
        known |= level
    return found


def below(near, v, level):
    """The first context neighbours: lower ones of the level that are next to it."""
    return sorted(u for u in near[v] & level if u < v)[:MOST_CONTEXTS]


def passes_of(resolutions):
    """Context neighbours of each column, by pass; columns are vertices in coding order."""
    order = [vertex.number for one in resolutions for vertex in one]
    column = {v: i for i, v in enumerate(order)}
    return [{column[v.number]: [column[u] for u in v.contexts] for v in one} for one in resolutions]
