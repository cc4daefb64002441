/* Builds manifold surfaces from a face list: joins half-edges to edges, orients faces consistently,
   closes boundaries, and splits non-manifold vertices.

   Encoder only; docs/format.md leaves the choices free. Time and memory are linear. */

#include "surface.h"

#define NONE (-1)
#define CANDIDATES 8 /* half-edges of an edge searched for the best twin */

/* Pairs of half-edges, as the faces are given. */
typedef struct {
    const int32_t *faces;
    int32_t *order;   /* half-edges, sorted by their lower end */
    int32_t *next;    /* of each of `order`: the next one with the same ends, or NONE */
    int32_t *first;   /* of each vertex: the first of `order` with it as higher end */
    int32_t *partner; /* partner of each half-edge; NONE on a boundary */
} pairing;

static int32_t end_of(const int32_t *faces, int32_t side) { return faces[reel_side_after(side)]; }

static int32_t apex_of(const int32_t *faces, int32_t side) {
    return faces[reel_side_before(side)];
}

static bool goes_up(const int32_t *faces, int32_t side) {
    return faces[side] < end_of(faces, side);
}

/* Pair the half-edges of one edge: first those of opposite direction and different third vertex,
   then of opposite direction, then any two. */
static void join_edge(pairing *sides, const int32_t *edge_sides, int64_t n) {
    const int32_t *faces = sides->faces;
    for (int round = 0; round < 3; round++) {
        for (int64_t i = 0; i < n; i++) {
            int32_t side = edge_sides[i];
            int64_t limit = n - i < CANDIDATES ? n : i + CANDIDATES;
            for (int64_t j = i + 1; j < limit && sides->partner[side] == NONE; j++) {
                int32_t candidate = edge_sides[j];
                bool opposite = goes_up(faces, side) != goes_up(faces, candidate);
                bool is_distinct = apex_of(faces, side) != apex_of(faces, candidate);
                if (sides->partner[candidate] == NONE && (round == 2 || opposite) &&
                    (round > 0 || is_distinct)) {
                    sides->partner[side] = candidate;
                    sides->partner[candidate] = side;
                }
            }
        }
    }
}

/* Find the degenerate faces; sort the half-edges of the others, unpaired, by their lower end. */
static void list_sides(pairing *sides, reel_surface *surface, int32_t *starts, int64_t n_verts) {
    int32_t *ends = starts + 1;
    reel_zero(starts, (size_t)(n_verts + 2) * sizeof *starts);
    for (int pass = 0; pass < 2; pass++) {
        for (int32_t f = 0; f < surface->n_faces; f++) {
            const int32_t *face = sides->faces + 3 * (int64_t)f;
            int32_t low[3] = {face[0] < face[1] ? face[0] : face[1],
                              face[1] < face[2] ? face[1] : face[2],
                              face[2] < face[0] ? face[2] : face[0]};
            if (!pass) {
                surface->flipped[f] = 0;
                surface->flat[f] = face[0] == face[1] || face[1] == face[2] || face[2] == face[0];
                surface->n_flat += surface->flat[f];
            }
            for (int32_t k = 0; k < 3 && !surface->flat[f]; k++) {
                if (pass) {
                    sides->order[ends[low[k]]++] = 3 * f + k;
                } else {
                    ends[low[k] + 1]++;
                }
            }
        }
        reel_prefix_sum(ends, pass ? 0 : n_verts);
    }
    for (int64_t i = 0; i < 3 * surface->n_faces; i++) {
        sides->partner[i] = NONE;
    }
}

/* Pair the half-edges order[start..end-1], those with the same lower end. `edge_sides` has space
   for all of them. */
static void join_sides(pairing *sides, int32_t start, int32_t end, int32_t *edge_sides) {
    const int32_t *faces = sides->faces;
    for (int32_t i = end - 1; i >= start; i--) {
        int32_t side = sides->order[i], a = faces[side], b = end_of(faces, side);
        int32_t *first = &sides->first[a < b ? b : a];
        sides->next[i] = *first >= start ? *first : NONE; /* entries before have other ends */
        *first = i;
    }
    for (int32_t i = start; i < end; i++) {
        int32_t side = sides->order[i], next = sides->next[i];
        if (sides->partner[side] != NONE || next == NONE) {
            continue;
        }
        if (sides->next[next] == NONE) {
            sides->partner[side] = sides->order[next];
            sides->partner[sides->order[next]] = side;
            continue;
        }
        int64_t n = 0;
        for (int32_t j = i; j != NONE; j = next) {
            next = sides->next[j];
            sides->next[j] = NONE; /* so that those without a partner are not tried again */
            edge_sides[n++] = sides->order[j];
        }
        join_edge(sides, edge_sides, n);
    }
}

/* Flip faces so that paired half-edges have opposite directions; unpair those that still agree. */
static void orient_faces(pairing *sides, reel_surface *surface, int32_t *queue, uint8_t *is_seen) {
    reel_zero(is_seen, (size_t)surface->n_faces);
    for (int64_t seed = 0; seed < surface->n_faces; seed++) {
        int64_t n = 0;
        if (!is_seen[seed] && !surface->flat[seed]) {
            is_seen[seed] = 1;
            queue[n++] = (int32_t)seed;
        }
        for (int64_t i = 0; i < n; i++) {
            for (int32_t side = 3 * queue[i]; side < 3 * queue[i] + 3; side++) {
                int32_t partner = sides->partner[side];
                if (partner == NONE) {
                    continue;
                }
                bool same_direction = goes_up(sides->faces, side) == goes_up(sides->faces, partner);
                uint8_t flipped = surface->flipped[queue[i]] ^ (uint8_t)same_direction;
                if (!is_seen[partner / 3]) {
                    is_seen[partner / 3] = 1;
                    surface->flipped[partner / 3] = flipped;
                    surface->has_flipped |= flipped;
                    queue[n++] = partner / 3;
                } else if (surface->flipped[partner / 3] != flipped) {
                    sides->partner[side] = sides->partner[partner] = NONE;
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

static void join(reel_surface *surface, int32_t side, int32_t twin) {
    surface->twin[side] = twin;
    surface->twin[twin] = side;
}

/* Set the twins of all given half-edges, and close boundary edges with additional faces. */
static void close_surface(reel_surface *surface, const int32_t *partner) {
    int32_t n_sides = (int32_t)(3 * surface->n_faces), next = n_sides;
    for (int32_t given_side = 0; given_side < n_sides; given_side++) {
        if (surface->flat[given_side / 3]) {
            surface->twin[given_side] = NONE;
            continue;
        }
        int32_t side = flipped_side(surface, given_side);
        if (partner[given_side] == NONE) {
            join(surface, side, next);
            next += 3;
        } else {
            surface->twin[side] = flipped_side(surface, partner[given_side]);
        }
    }
    surface->n_closing = (next - n_sides) / 3;
    for (int32_t closing_side = n_sides; closing_side < next; closing_side += 3) {
        /* Its corners are b, a, cap, behind the half-edge a to b. Rotate around a to the next
           boundary edge. */
        int32_t side = reel_side_before(surface->twin[closing_side]);
        while (surface->twin[side] < n_sides) {
            side = reel_side_before(surface->twin[side]);
        }
        join(surface, closing_side + 1, surface->twin[side] + 2);
    }
}

/* Make a new point of all corners around the origin of a half-edge. */
static void set_point(reel_surface *surface, int32_t side, int64_t number, int32_t vertex) {
    int32_t degree = 0, current = side;
    do {
        surface->point[current] = (int32_t)number;
        degree++;
        current = surface->twin[reel_side_before(current)];
    } while (current != side);
    surface->vertex[number] = vertex;
    surface->degree[number] = degree;
}

static void set_points(reel_surface *surface, const int32_t *faces, uint8_t *is_used) {
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
            bool is_swapped = surface->flipped[face] && corner;
            vertex = faces[3 * face + (is_swapped ? 3 - corner : corner)];
            surface->pinched |= is_used[vertex];
            surface->n_used += !is_used[vertex];
            is_used[vertex] = 1;
        } else {
            surface->n_caps++;
        }
        set_point(surface, side, n_points++, vertex);
    }
}

size_t reel_surface_memory(int64_t n_verts, int64_t n_faces) {
    size_t v = (size_t)n_verts, m = (size_t)n_faces, word = sizeof(int32_t);
    return 2 * reel_array_bytes(12 * m, word) + 2 * reel_array_bytes(6 * m, word) +
           2 * reel_array_bytes(m, 1) + 3 * reel_array_bytes(3 * m, word) +
           reel_array_bytes(v + 2, word) + reel_array_bytes(v, word) + reel_array_bytes(m + v, 1);
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
    sides.partner = reel_allocate(arena, 3 * m, word);
    sides.next = reel_allocate(arena, 3 * m, word);
    sides.first = reel_allocate(arena, v, word);
    int32_t *starts = reel_allocate(arena, v + 2, word);
    uint8_t *marks = reel_allocate(arena, m + v, 1);
    if (arena->failed) {
        return false;
    }
    list_sides(&sides, result, starts, n_verts);
    for (int64_t i = 0; i < n_verts; i++) {
        sides.first[i] = NONE;
    }
    for (int64_t i = 0; i < n_verts; i++) {
        join_sides(&sides, starts[i], starts[i + 1], result->twin); /* twin: scratch space */
    }
    orient_faces(&sides, result, sides.next, marks);
    close_surface(result, sides.partner);
    reel_zero(marks, m + v);
    set_points(result, faces, marks);
    return true;
}
