/* Builds manifold surfaces from a face list: joins half-edges to edges, orients faces consistently,
   closes boundaries, and splits non-manifold vertices.

   Encoder only; docs/format.md leaves the choices free. Time and memory are linear. */

#include "surface.h"

#define NONE (-1)
#define CANDIDATES 8 /* half-edges of an edge searched for the best twin */

/* Pairs of half-edges, as the faces are given. */
typedef struct {
    const int32_t *faces;
    int32_t *order; /* half-edges, sorted by their ends */
    int32_t *pair;  /* partner of each half-edge; NONE on a boundary */
} pairing;

static int32_t end_of(const int32_t *faces, int32_t side) { return faces[reel_side_after(side)]; }

static int32_t low_of(const int32_t *faces, int32_t side) {
    int32_t a = faces[side], b = end_of(faces, side);
    return a < b ? a : b;
}

static int32_t high_of(const int32_t *faces, int32_t side) {
    int32_t a = faces[side], b = end_of(faces, side);
    return a < b ? b : a;
}

static int32_t apex_of(const int32_t *faces, int32_t side) {
    return faces[reel_side_before(side)];
}

static bool goes_up(const int32_t *faces, int32_t side) {
    return faces[side] < end_of(faces, side);
}

/* Sort half-edges by one of their ends, stably. */
static void sort_by(const int32_t *faces, int32_t (*key)(const int32_t *, int32_t),
                    const int32_t *from, int32_t *to, int64_t n, int32_t *starts, int64_t n_verts) {
    reel_zero(starts, (size_t)(n_verts + 1) * sizeof *starts);
    for (int64_t i = 0; i < n; i++) {
        starts[key(faces, from[i]) + 1]++;
    }
    for (int64_t v = 0; v < n_verts; v++) {
        starts[v + 1] += starts[v];
    }
    for (int64_t i = 0; i < n; i++) {
        to[starts[key(faces, from[i])]++] = from[i];
    }
}

/* Pair the half-edges order[start..end-1] of one edge: first those of opposite direction and
   different third vertex, then of opposite direction, then any two. */
static void join_edge(pairing *sides, int64_t start, int64_t end) {
    const int32_t *faces = sides->faces;
    for (int round = 0; round < 3; round++) {
        for (int64_t i = start; i < end; i++) {
            int32_t side = sides->order[i];
            int64_t limit = end - i < CANDIDATES ? end : i + CANDIDATES;
            for (int64_t j = i + 1; j < limit && sides->pair[side] == NONE; j++) {
                int32_t other = sides->order[j];
                bool opposite = goes_up(faces, side) != goes_up(faces, other);
                bool is_distinct = apex_of(faces, side) != apex_of(faces, other);
                if (sides->pair[other] == NONE && (round == 2 || opposite) &&
                    (round > 0 || is_distinct)) {
                    sides->pair[side] = other;
                    sides->pair[other] = side;
                }
            }
        }
    }
}

/* List the half-edges of non-degenerate faces, all unpaired; returns their number. */
static int64_t list_sides(pairing *sides, reel_surface *surface) {
    int64_t n_sides = 0;
    for (int32_t f = 0; f < surface->n_faces; f++) {
        const int32_t *face = sides->faces + 3 * (int64_t)f;
        surface->flipped[f] = 0;
        surface->flat[f] = face[0] == face[1] || face[1] == face[2] || face[2] == face[0];
        surface->n_flat += surface->flat[f];
        for (int32_t k = 0; k < 3; k++) {
            sides->pair[3 * f + k] = NONE;
            if (!surface->flat[f]) {
                sides->order[n_sides++] = 3 * f + k;
            }
        }
    }
    return n_sides;
}

static void join_sides(pairing *sides, int64_t n_sides) {
    const int32_t *faces = sides->faces;
    int64_t start = 0;
    for (int64_t i = 1; i <= n_sides; i++) {
        int32_t here = sides->order[start];
        if (i == n_sides || low_of(faces, sides->order[i]) != low_of(faces, here) ||
            high_of(faces, sides->order[i]) != high_of(faces, here)) {
            join_edge(sides, start, i);
            start = i;
        }
    }
}

/* Flip faces so that paired half-edges have opposite directions; unpair those for which that is
   impossible. */
static void orient_faces(pairing *sides, reel_surface *surface, int32_t *queue, uint8_t *reached) {
    reel_zero(reached, (size_t)surface->n_faces);
    for (int64_t seed = 0; seed < surface->n_faces; seed++) {
        int64_t n = 0;
        if (!reached[seed] && !surface->flat[seed]) {
            reached[seed] = 1;
            queue[n++] = (int32_t)seed;
        }
        for (int64_t i = 0; i < n; i++) {
            for (int32_t side = 3 * queue[i]; side < 3 * queue[i] + 3; side++) {
                int32_t other = sides->pair[side];
                if (other == NONE) {
                    continue;
                }
                bool same_direction = goes_up(sides->faces, side) == goes_up(sides->faces, other);
                uint8_t flipped = surface->flipped[queue[i]] ^ (uint8_t)same_direction;
                if (!reached[other / 3]) {
                    reached[other / 3] = 1;
                    surface->flipped[other / 3] = flipped;
                    surface->has_flipped |= flipped;
                    queue[n++] = other / 3;
                } else if (surface->flipped[other / 3] != flipped) {
                    sides->pair[side] = sides->pair[other] = NONE;
                }
            }
        }
    }
}

/* Index of a given half-edge after its face is flipped. */
static int32_t flipped_side(const reel_surface *surface, int32_t side) {
    int32_t face = side / 3;
    return surface->flipped[face] ? 6 * face + 2 - side : side;
}

static void join(reel_surface *surface, int32_t side, int32_t other) {
    surface->twin[side] = other;
    surface->twin[other] = side;
}

/* Set the twins of all given half-edges, and close boundary edges with additional faces. */
static void close_surface(reel_surface *surface, const int32_t *pair) {
    int32_t n_sides = (int32_t)(3 * surface->n_faces), next = n_sides;
    for (int32_t given = 0; given < n_sides; given++) {
        if (surface->flat[given / 3]) {
            surface->twin[given] = NONE;
            continue;
        }
        int32_t side = flipped_side(surface, given);
        if (pair[given] == NONE) {
            join(surface, side, next);
            next += 3;
        } else {
            surface->twin[side] = flipped_side(surface, pair[given]);
        }
    }
    surface->n_closing = (next - n_sides) / 3;
    for (int32_t added = n_sides; added < next; added += 3) {
        /* Its corners are b, a, cap, behind the half-edge a to b. Rotate around a to the next
           boundary edge. */
        int32_t side = reel_side_before(surface->twin[added]);
        while (surface->twin[side] < n_sides) {
            side = reel_side_before(surface->twin[side]);
        }
        join(surface, added + 1, surface->twin[side] + 2);
    }
}

/* Make a new point of all corners around the origin of a half-edge. */
static void name_point(reel_surface *surface, int32_t side, int64_t number, int32_t vertex) {
    int32_t degree = 0, here = side;
    do {
        surface->point[here] = (int32_t)number;
        degree++;
        here = surface->twin[reel_side_before(here)];
    } while (here != side);
    surface->vertex[number] = vertex;
    surface->degree[number] = degree;
}

static void name_points(reel_surface *surface, const int32_t *faces, uint8_t *used) {
    int32_t n_sides = (int32_t)(3 * surface->n_faces);
    int32_t n_all = n_sides + (int32_t)(3 * surface->n_closing);
    int64_t n_points = 0;
    for (int32_t side = 0; side < n_all; side++) {
        surface->point[side] = NONE;
    }
    for (int32_t side = 0; side < n_all; side++) {
        if (surface->point[side] != NONE || surface->twin[side] == NONE) {
            continue;
        }
        int32_t vertex = -1;
        if (side < n_sides) {
            int32_t face = side / 3, corner = side % 3;
            bool swaps = surface->flipped[face] && corner;
            vertex = faces[3 * face + (swaps ? 3 - corner : corner)];
            surface->pinched |= used[vertex];
            surface->n_used += !used[vertex];
            used[vertex] = 1;
        } else {
            surface->n_caps++;
        }
        name_point(surface, side, n_points++, vertex);
    }
}

size_t reel_surface_memory(int64_t n_verts, int64_t n_faces) {
    size_t v = (size_t)n_verts, m = (size_t)n_faces, word = sizeof(int32_t);
    return 2 * reel_array_bytes(12 * m, word) + 2 * reel_array_bytes(6 * m, word) +
           2 * reel_array_bytes(m, 1) + 3 * reel_array_bytes(3 * m, word) +
           reel_array_bytes(v + 1, word) + reel_array_bytes(m + v, 1);
}

bool reel_find_surface(reel_arena *arena, const int32_t *faces, int64_t n_faces, int64_t n_verts,
                       reel_surface *result) {
    size_t v = (size_t)n_verts, m = (size_t)n_faces, word = sizeof(int32_t);
    *result = (reel_surface){.n_faces = n_faces};
    result->twin = reel_allocate(arena, 12 * m, word);
    result->point = reel_allocate(arena, 12 * m, word);
    result->vertex = reel_allocate(arena, 6 * m, word);
    result->degree = reel_allocate(arena, 6 * m, word);
    result->flipped = reel_allocate(arena, m, 1);
    result->flat = reel_allocate(arena, m, 1);
    pairing sides = {.faces = faces};
    sides.order = reel_allocate(arena, 3 * m, word);
    sides.pair = reel_allocate(arena, 3 * m, word);
    int32_t *scratch = reel_allocate(arena, 3 * m, word);
    int32_t *starts = reel_allocate(arena, v + 1, word);
    uint8_t *marks = reel_allocate(arena, m + v, 1);
    if (arena->failed) {
        return false;
    }
    int64_t n_sides = list_sides(&sides, result);
    sort_by(faces, high_of, sides.order, scratch, n_sides, starts, n_verts);
    sort_by(faces, low_of, scratch, sides.order, n_sides, starts, n_verts);
    if (n_sides) {
        join_sides(&sides, n_sides);
    }
    orient_faces(&sides, result, scratch, marks);
    close_surface(result, sides.pair);
    reel_zero(marks, m + v);
    name_points(result, faces, marks);
    return true;
}
