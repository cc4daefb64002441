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

static int32_t end_of(const int32_t *faces, int32_t he) { return faces[reel_next_half_edge(he)]; }

static int32_t apex_of(const int32_t *faces, int32_t he) {
    return faces[reel_previous_half_edge(he)];
}

static bool goes_up(const int32_t *faces, int32_t he) {
    return faces[he] < end_of(faces, he);
}

/* Pair the half-edges of one edge: first those of opposite direction and different third vertex,
   then of opposite direction, then any two. */
static void join_edge(pairing *pairs, const int32_t *group, int64_t n) {
    const int32_t *faces = pairs->faces;
    for (int round = 0; round < 3; round++) {
        for (int64_t i = 0; i < n; i++) {
            int32_t he = group[i];
            int64_t limit = n - i < CANDIDATES ? n : i + CANDIDATES;
            for (int64_t j = i + 1; j < limit && pairs->partner[he] == NONE; j++) {
                int32_t candidate = group[j];
                bool opposite = goes_up(faces, he) != goes_up(faces, candidate);
                bool is_distinct = apex_of(faces, he) != apex_of(faces, candidate);
                if (pairs->partner[candidate] == NONE && (round == 2 || opposite) &&
                    (round > 0 || is_distinct)) {
                    pairs->partner[he] = candidate;
                    pairs->partner[candidate] = he;
                }
            }
        }
    }
}

/* Find the degenerate faces; sort the half-edges of the others, unpaired, by their lower end. */
static void start_pairs(pairing *pairs, reel_surface *surface, int32_t *starts, int64_t n_verts) {
    int32_t *ends = starts + 1;
    reel_zero(starts, (size_t)(n_verts + 2) * sizeof *starts);
    for (int pass = 0; pass < 2; pass++) {
        for (int32_t f = 0; f < surface->n_faces; f++) {
            const int32_t *face = pairs->faces + 3 * (int64_t)f;
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
                    pairs->order[ends[low[k]]++] = 3 * f + k;
                } else {
                    ends[low[k] + 1]++;
                }
            }
        }
        reel_prefix_sum(ends, pass ? 0 : n_verts);
    }
    for (int64_t i = 0; i < 3 * surface->n_faces; i++) {
        pairs->partner[i] = NONE;
    }
}

/* Pair the half-edges order[start..end-1], which have the same lower end. `group` has space for
   all of them. */
static void join_half_edges(pairing *pairs, int32_t start, int32_t end, int32_t *group) {
    const int32_t *faces = pairs->faces;
    for (int32_t i = end - 1; i >= start; i--) {
        int32_t he = pairs->order[i], a = faces[he], b = end_of(faces, he);
        int32_t *first = &pairs->first[a < b ? b : a];
        pairs->next[i] = *first >= start ? *first : NONE; /* entries before have other ends */
        *first = i;
    }
    for (int32_t i = start; i < end; i++) {
        int32_t he = pairs->order[i], next = pairs->next[i];
        if (pairs->partner[he] != NONE || next == NONE) {
            continue;
        }
        if (pairs->next[next] == NONE) {
            pairs->partner[he] = pairs->order[next];
            pairs->partner[pairs->order[next]] = he;
            continue;
        }
        int64_t n = 0;
        for (int32_t j = i; j != NONE; j = next) {
            next = pairs->next[j];
            pairs->next[j] = NONE; /* so that those without a partner are not tried again */
            group[n++] = pairs->order[j];
        }
        join_edge(pairs, group, n);
    }
}

/* Flip faces so that paired half-edges have opposite directions; unpair those that still agree. */
static void orient_faces(pairing *pairs, reel_surface *surface, int32_t *queue, uint8_t *is_seen) {
    reel_zero(is_seen, (size_t)surface->n_faces);
    for (int64_t seed = 0; seed < surface->n_faces; seed++) {
        int64_t n = 0;
        if (!is_seen[seed] && !surface->flat[seed]) {
            is_seen[seed] = 1;
            queue[n++] = (int32_t)seed;
        }
        for (int64_t i = 0; i < n; i++) {
            for (int32_t he = 3 * queue[i]; he < 3 * queue[i] + 3; he++) {
                int32_t partner = pairs->partner[he];
                if (partner == NONE) {
                    continue;
                }
                bool same_direction = goes_up(pairs->faces, he) == goes_up(pairs->faces, partner);
                uint8_t flipped = surface->flipped[queue[i]] ^ (uint8_t)same_direction;
                if (!is_seen[partner / 3]) {
                    is_seen[partner / 3] = 1;
                    surface->flipped[partner / 3] = flipped;
                    surface->has_flipped |= flipped;
                    queue[n++] = partner / 3;
                } else if (surface->flipped[partner / 3] != flipped) {
                    pairs->partner[he] = pairs->partner[partner] = NONE;
                }
            }
        }
    }
}

/* Index of a given half-edge after its face is flipped. */
static int32_t flipped_half_edge(const reel_surface *surface, int32_t he) {
    int32_t face = he / 3;
    return surface->flipped[face] ? 6 * face + 2 - he : he;
}

static void join(reel_surface *surface, int32_t he, int32_t twin) {
    surface->twin[he] = twin;
    surface->twin[twin] = he;
}

/* Set the twins of all given half-edges, and close boundary edges with additional faces. */
static void close_surface(reel_surface *surface, const int32_t *partner) {
    int32_t n_half_edges = (int32_t)(3 * surface->n_faces), next = n_half_edges;
    for (int32_t given = 0; given < n_half_edges; given++) {
        if (surface->flat[given / 3]) {
            surface->twin[given] = NONE;
            continue;
        }
        int32_t he = flipped_half_edge(surface, given);
        if (partner[given] == NONE) {
            join(surface, he, next);
            next += 3;
        } else {
            surface->twin[he] = flipped_half_edge(surface, partner[given]);
        }
    }
    surface->n_closing = (next - n_half_edges) / 3;
    for (int32_t closing = n_half_edges; closing < next; closing += 3) {
        /* Its corners are b, a, cap, behind the half-edge a to b. Rotate around a to the next
           boundary edge. */
        int32_t he = reel_previous_half_edge(surface->twin[closing]);
        while (surface->twin[he] < n_half_edges) {
            he = reel_previous_half_edge(surface->twin[he]);
        }
        join(surface, closing + 1, surface->twin[he] + 2);
    }
}

/* Make a new point of all corners around the origin of a half-edge. */
static void set_point(reel_surface *surface, int32_t he, int64_t number, int32_t vertex) {
    int32_t degree = 0, current = he;
    do {
        surface->point[current] = (int32_t)number;
        degree++;
        current = surface->twin[reel_previous_half_edge(current)];
    } while (current != he);
    surface->vertex[number] = vertex;
    surface->degree[number] = degree;
}

static void set_points(reel_surface *surface, const int32_t *faces, uint8_t *is_used) {
    int32_t n_half_edges = (int32_t)(3 * surface->n_faces);
    int32_t n_all = n_half_edges + (int32_t)(3 * surface->n_closing);
    int64_t n_points = 0;
    for (int32_t he = 0; he < n_all; he++) {
        surface->point[he] = NONE;
    }
    for (int32_t he = 0; he < n_all; he++) {
        if (surface->point[he] != NONE || surface->twin[he] == NONE) {
            continue;
        }
        int32_t vertex = -1;
        if (he < n_half_edges) {
            int32_t face = he / 3, corner = he % 3;
            bool is_swapped = surface->flipped[face] && corner;
            vertex = faces[3 * face + (is_swapped ? 3 - corner : corner)];
            surface->pinched |= is_used[vertex];
            surface->n_used += !is_used[vertex];
            is_used[vertex] = 1;
        } else {
            surface->n_caps++;
        }
        set_point(surface, he, n_points++, vertex);
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
    pairing pairs = {.faces = faces};
    pairs.order = reel_allocate(arena, 3 * m, word);
    pairs.partner = reel_allocate(arena, 3 * m, word);
    pairs.next = reel_allocate(arena, 3 * m, word);
    pairs.first = reel_allocate(arena, v, word);
    int32_t *starts = reel_allocate(arena, v + 2, word);
    uint8_t *marks = reel_allocate(arena, m + v, 1);
    if (arena->failed) {
        return false;
    }
    start_pairs(&pairs, result, starts, n_verts);
    for (int64_t i = 0; i < n_verts; i++) {
        pairs.first[i] = NONE;
    }
    for (int64_t i = 0; i < n_verts; i++) {
        join_half_edges(&pairs, starts[i], starts[i + 1], result->twin); /* twin: scratch space */
    }
    orient_faces(&pairs, result, pairs.next, marks);
    close_surface(result, pairs.partner);
    reel_zero(marks, m + v);
    set_points(result, faces, marks);
    return true;
}
