/* Finds the surface of a face list: which sides are the same edge, which faces go the other way
   round, where it is open, and where one vertex is several points.

   Only the encoder does so; docs/format.md leaves it free. Time and memory are linear. */

#include "surface.h"

#define NONE (-1)
#define CANDIDATES 8 /* sides of an edge that are looked at for the best twin */

/* Which sides are the same edge; here a side is one of a face as it is given. */
typedef struct {
    const int32_t *faces;
    int32_t *order; /* sides, sorted by their ends */
    int32_t *pair;  /* of each side, the one that it is joined with; NONE if open */
} reel_joining;

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

/* Sorts sides by one of their ends, keeping the order of equal ones. */
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

/* Joins the sides order[start..end-1], which are all those of one edge: first those that go
   opposite ways and belong to different triangles, then opposite ones, then any two. */
static void join_edge(reel_joining *joining, int64_t start, int64_t end) {
    const int32_t *faces = joining->faces;
    for (int round = 0; round < 3; round++) {
        for (int64_t i = start; i < end; i++) {
            int32_t side = joining->order[i];
            int64_t limit = end - i < CANDIDATES ? end : i + CANDIDATES;
            for (int64_t j = i + 1; j < limit && joining->pair[side] == NONE; j++) {
                int32_t other = joining->order[j];
                bool opposite = goes_up(faces, side) != goes_up(faces, other);
                bool apart = apex_of(faces, side) != apex_of(faces, other);
                if (joining->pair[other] == NONE && (round == 2 || opposite) &&
                    (round > 0 || apart)) {
                    joining->pair[side] = other;
                    joining->pair[other] = side;
                }
            }
        }
    }
}

/* Lists the sides of faces that are not degenerate, none of them joined; how many they are. */
static int64_t list_sides(reel_joining *joining, reel_surface *surface) {
    int64_t n_sides = 0;
    for (int32_t f = 0; f < surface->n_faces; f++) {
        const int32_t *face = joining->faces + 3 * (int64_t)f;
        surface->turned[f] = 0;
        surface->flat[f] = face[0] == face[1] || face[1] == face[2] || face[2] == face[0];
        surface->n_flat += surface->flat[f];
        for (int32_t k = 0; k < 3; k++) {
            joining->pair[3 * f + k] = NONE;
            if (!surface->flat[f]) {
                joining->order[n_sides++] = 3 * f + k;
            }
        }
    }
    return n_sides;
}

static void join_sides(reel_joining *joining, int64_t n_sides) {
    const int32_t *faces = joining->faces;
    int64_t start = 0;
    for (int64_t i = 1; i <= n_sides; i++) {
        int32_t here = joining->order[start];
        if (i == n_sides || low_of(faces, joining->order[i]) != low_of(faces, here) ||
            high_of(faces, joining->order[i]) != high_of(faces, here)) {
            join_edge(joining, start, i);
            start = i;
        }
    }
}

/* Turns faces over so that joined sides go opposite ways; parts them where that cannot be. */
static void turn_faces(reel_joining *joining, reel_surface *surface, int32_t *queue,
                       uint8_t *reached) {
    reel_zero(reached, (size_t)surface->n_faces);
    for (int64_t seed = 0; seed < surface->n_faces; seed++) {
        int64_t n = 0;
        if (!reached[seed] && !surface->flat[seed]) {
            reached[seed] = 1;
            queue[n++] = (int32_t)seed;
        }
        for (int64_t i = 0; i < n; i++) {
            for (int32_t side = 3 * queue[i]; side < 3 * queue[i] + 3; side++) {
                int32_t other = joining->pair[side];
                if (other == NONE) {
                    continue;
                }
                bool alike = goes_up(joining->faces, side) == goes_up(joining->faces, other);
                uint8_t turned = surface->turned[queue[i]] ^ (uint8_t)alike;
                if (!reached[other / 3]) {
                    reached[other / 3] = 1;
                    surface->turned[other / 3] = turned;
                    surface->turns |= turned;
                    queue[n++] = other / 3;
                } else if (surface->turned[other / 3] != turned) {
                    joining->pair[side] = joining->pair[other] = NONE;
                }
            }
        }
    }
}

/* The number of a given side when its face is turned over as it is to be. */
static int32_t turned_side(const reel_surface *surface, int32_t side) {
    int32_t face = side / 3;
    return surface->turned[face] ? 6 * face + 2 - side : side;
}

static void join(reel_surface *surface, int32_t side, int32_t other) {
    surface->twin[side] = other;
    surface->twin[other] = side;
}

/* Sets the twins of all given sides, and closes open edges with faces of their own. */
static void close_surface(reel_surface *surface, const int32_t *pair) {
    int32_t n_sides = (int32_t)(3 * surface->n_faces), next = n_sides;
    for (int32_t given = 0; given < n_sides; given++) {
        if (surface->flat[given / 3]) {
            surface->twin[given] = NONE;
            continue;
        }
        int32_t side = turned_side(surface, given);
        if (pair[given] == NONE) {
            join(surface, side, next);
            next += 3;
        } else {
            surface->twin[side] = turned_side(surface, pair[given]);
        }
    }
    surface->n_closing = (next - n_sides) / 3;
    for (int32_t added = n_sides; added < next; added += 3) {
        /* Its corners are b, a, cap, behind the side a to b. Around a to the next open edge. */
        int32_t side = reel_side_before(surface->twin[added]);
        while (surface->twin[side] < n_sides) {
            side = reel_side_before(surface->twin[side]);
        }
        join(surface, added + 1, surface->twin[side] + 2);
    }
}

/* A new point of all corners around the start of a side. */
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
            bool swaps = surface->turned[face] && corner;
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
    return 2 * reel_room(12 * m, word) + 2 * reel_room(6 * m, word) + 2 * reel_room(m, 1) +
           3 * reel_room(3 * m, word) + reel_room(v + 1, word) + reel_room(m + v, 1);
}

bool reel_find_surface(reel_arena *arena, const int32_t *faces, int64_t n_faces, int64_t n_verts,
                       reel_surface *found) {
    size_t v = (size_t)n_verts, m = (size_t)n_faces, word = sizeof(int32_t);
    *found = (reel_surface){.n_faces = n_faces};
    found->twin = reel_take(arena, 12 * m, word);
    found->point = reel_take(arena, 12 * m, word);
    found->vertex = reel_take(arena, 6 * m, word);
    found->degree = reel_take(arena, 6 * m, word);
    found->turned = reel_take(arena, m, 1);
    found->flat = reel_take(arena, m, 1);
    reel_joining joining = {.faces = faces};
    joining.order = reel_take(arena, 3 * m, word);
    joining.pair = reel_take(arena, 3 * m, word);
    int32_t *spare = reel_take(arena, 3 * m, word);
    int32_t *starts = reel_take(arena, v + 1, word);
    uint8_t *marks = reel_take(arena, m + v, 1);
    if (arena->failed) {
        return false;
    }
    int64_t n_sides = list_sides(&joining, found);
    sort_by(faces, high_of, joining.order, spare, n_sides, starts, n_verts);
    sort_by(faces, low_of, spare, joining.order, n_sides, starts, n_verts);
    if (n_sides) {
        join_sides(&joining, n_sides);
    }
    turn_faces(&joining, found, spare, marks);
    close_surface(found, joining.pair);
    reel_zero(marks, m + v);
    name_points(found, faces, marks);
    return true;
}
