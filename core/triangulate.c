/* Cutting of polygons into triangles: fans where they fit, otherwise by ear clipping (G. Meisters,
   "Polygons have ears", 1975). The triangles are in the order of docs/format.md, POLYGONS. */

#include "base.h"

#define NONE (-1)
#define TOLERANCE 1e-6               /* of the fan's area, up to which a triangle may be reversed */
#define MAX_TESTS ((int64_t)1 << 28) /* of corners against triangles, in all polygons */

/* Corners that are clipped. STRICT: convex ones whose triangle contains no other corner; LENIENT:
   also those without area, or with corners on its sides; ALL: any. */
enum ears { STRICT, LENIENT, ALL };

typedef struct {
    double x, y;
} point;

/* A clipped triangle: its corners, with the ear in the middle, and the triangles clipped earlier
   across its first and second side, or NONE. */
typedef struct {
    int32_t corners[3], across[2];
} ear_triangle;

/* A polygon in its plane, and its outline without the clipped ears. */
typedef struct {
    point *points;
    int32_t *previous, *next;
    int32_t *below; /* the triangle clipped from the side to the next corner, or NONE */
    bool *is_reflex;
    ear_triangle *ears;
    int32_t *stack;
    int32_t *corners; /* of the triangles, in stored order */
    double tolerance;
    int64_t tests_left;
} polygon;

static bool allocate_polygon(reel_arena *arena, int64_t max_size, polygon *result) {
    size_t n = (size_t)max_size;
    result->points = reel_allocate(arena, n, sizeof *result->points);
    result->previous = reel_allocate(arena, n, sizeof *result->previous);
    result->next = reel_allocate(arena, n, sizeof *result->next);
    result->below = reel_allocate(arena, n, sizeof *result->below);
    result->is_reflex = reel_allocate(arena, n, sizeof *result->is_reflex);
    result->ears = reel_allocate(arena, n, sizeof *result->ears);
    result->stack = reel_allocate(arena, n, sizeof *result->stack);
    result->corners = reel_allocate(arena, 3 * n, sizeof *result->corners);
    return !arena->failed;
}

/* Twice the signed area of a triangle. */
static double area_of(const polygon *poly, int32_t a, int32_t b, int32_t c) {
    const point *p = &poly->points[a], *q = &poly->points[b], *r = &poly->points[c];
    return (q->x - p->x) * (r->y - p->y) - (r->x - p->x) * (q->y - p->y);
}

/* Project a polygon along the axis nearest to its normal (Newell's method), so that its area is
   positive; returns twice the area of its fan, in which reversed triangles count as positive. */
static double project(polygon *poly, const double *coords, const int32_t *corners, int32_t size) {
    const double *origin = coords + 3 * (int64_t)corners[0];
    double normal[3] = {0, 0, 0}, areas[3] = {0, 0, 0};
    for (int32_t i = 1; i < size - 1; i++) {
        const double *p = coords + 3 * (int64_t)corners[i];
        const double *q = coords + 3 * (int64_t)corners[i + 1];
        for (int k = 0; k < 3; k++) {
            int l = (k + 1) % 3, m = (k + 2) % 3;
            double area = (p[l] - origin[l]) * (q[m] - origin[m]) -
                          (p[m] - origin[m]) * (q[l] - origin[l]);
            normal[k] += area;
            areas[k] += __builtin_fabs(area);
        }
    }
    int axis = 0;
    double best = -1;
    for (int k = 0; k < 3; k++) {
        double weight = __builtin_fabs(normal[k]) + TOLERANCE * areas[k];
        axis = weight > best ? k : axis;
        best = weight > best ? weight : best;
    }
    int x = (axis + (normal[axis] < 0 ? 2 : 1)) % 3, y = 3 - axis - x;
    for (int32_t i = 0; i < size; i++) {
        const double *p = coords + 3 * (int64_t)corners[i];
        poly->points[i] = (point){p[x] - origin[x], p[y] - origin[y]};
    }
    return areas[axis];
}

static bool is_fan(const polygon *poly, int32_t size) {
    for (int32_t i = 1; i < size - 1; i++) {
        if (area_of(poly, 0, i, i + 1) < -poly->tolerance) {
            return false;
        }
    }
    return true;
}

static bool are_equal(const point *p, const point *q) { return p->x == q->x && p->y == q->y; }

/* Whether the triangle at a corner is an ear. Only reflex corners can be inside. */
static bool is_ear(polygon *poly, int32_t b, enum ears kind) {
    int32_t a = poly->previous[b], c = poly->next[b];
    double area = area_of(poly, a, b, c);
    if (kind == ALL || !(kind == STRICT ? area > 0 : area >= -poly->tolerance)) {
        return kind == ALL;
    }
    const point *p = poly->points;
    for (int32_t i = poly->next[c]; i != a; i = poly->next[i], poly->tests_left--) {
        if (!poly->is_reflex[i] || are_equal(&p[i], &p[a]) || are_equal(&p[i], &p[b]) ||
            are_equal(&p[i], &p[c])) {
            continue;
        }
        double sides[3] = {area_of(poly, a, b, i), area_of(poly, b, c, i), area_of(poly, c, a, i)};
        bool is_inside = kind == STRICT ? sides[0] >= 0 && sides[1] >= 0 && sides[2] >= 0
                                        : sides[0] > 0 && sides[1] > 0 && sides[2] > 0;
        if (is_inside) {
            return false;
        }
    }
    return true;
}

static void update_corner(polygon *poly, int32_t i) {
    poly->is_reflex[i] = !(area_of(poly, poly->previous[i], i, poly->next[i]) > 0);
}

static void clip(polygon *poly, int32_t b, int32_t number) {
    int32_t a = poly->previous[b], c = poly->next[b];
    poly->ears[number] = (ear_triangle){{a, b, c}, {poly->below[a], poly->below[b]}};
    poly->below[a] = number;
    poly->next[a] = c;
    poly->previous[c] = a;
    update_corner(poly, a);
    update_corner(poly, c);
}

/* Clip ears until a triangle at corner 0 remains; returns whether no triangles overlap. */
static bool clip_ears(polygon *poly, int32_t size) {
    for (int32_t i = 0; i < size; i++) {
        poly->previous[i] = i ? i - 1 : size - 1;
        poly->next[i] = i < size - 1 ? i + 1 : 0;
        poly->below[i] = NONE;
    }
    for (int32_t i = 0; i < size; i++) {
        update_corner(poly, i);
    }
    enum ears kind = STRICT;
    bool was_forced = false;
    for (int32_t n_left = size, n_tried = 0, i = 1; n_left > 3;) {
        kind = poly->tests_left < 0 ? ALL : kind;
        if (i && is_ear(poly, i, kind)) {
            clip(poly, i, size - n_left--);
            i = poly->next[poly->next[i]]; /* leaves wider triangles than the next corner */
            was_forced |= kind == ALL;
            kind = STRICT;
            n_tried = 0;
        } else {
            i = poly->next[i];
            if (++n_tried > n_left) {
                kind++;
                n_tried = 0;
            }
        }
    }
    int32_t b = poly->next[0];
    return !was_forced && area_of(poly, 0, b, poly->next[b]) >= -poly->tolerance;
}

static void push(polygon *poly, int32_t *depth, int32_t triangle) {
    if (triangle != NONE) {
        poly->stack[(*depth)++] = triangle;
    }
}

/* List the last triangle, then each clipped one after a triangle that shares a side with it. */
static void list_triangles(polygon *poly) {
    int32_t a = poly->next[0], b = poly->next[a], depth = 0, *corners = poly->corners;
    *corners++ = 0;
    *corners++ = a;
    *corners++ = b;
    push(poly, &depth, poly->below[0]);
    push(poly, &depth, poly->below[a]);
    push(poly, &depth, poly->below[b]);
    while (depth) {
        const ear_triangle *ear = &poly->ears[poly->stack[--depth]];
        *corners++ = ear->corners[2];
        *corners++ = ear->corners[0];
        *corners++ = ear->corners[1];
        push(poly, &depth, ear->across[0]);
        push(poly, &depth, ear->across[1]);
    }
}

static void list_fan(polygon *poly, int32_t size) {
    int32_t *corners = poly->corners;
    for (int32_t i = 1; i < size - 1; i++) {
        *corners++ = 0;
        *corners++ = i;
        *corners++ = i + 1;
    }
}

static void copy_vertices(const polygon *poly, const int32_t *vertices, int32_t size,
                          int32_t *triangles) {
    for (int64_t i = 0; i < 3 * ((int64_t)size - 2); i++) {
        triangles[i] = vertices[poly->corners[i]];
    }
}

/* Whether a reader can restore the corners from the triangles; repeated vertices may prevent it. */
static bool is_readable(const polygon *poly, void *memory, size_t memory_size, int32_t size,
                        const int32_t *triangles, int32_t *restored) {
    if (reel_triangle_corners(memory, memory_size, triangles, &size, 1, size, restored) < 0) {
        return false;
    }
    return reel_equal_bytes((const uint8_t *)restored, (const uint8_t *)poly->corners,
                            3 * ((size_t)size - 2) * sizeof *restored);
}

size_t reel_triangulate_memory(int64_t max_size) {
    reel_arena arena = REEL_MEASURE;
    polygon layout;
    (void)allocate_polygon(&arena, max_size, &layout);
    return arena.used + reel_array_bytes(3 * (size_t)max_size, sizeof(int32_t)) +
           reel_array_bytes(reel_triangle_corners_memory(max_size), 1);
}

int64_t reel_triangulate(void *memory, size_t memory_size, const double *positions,
                         const int32_t *sizes, int64_t n_polygons, int64_t max_size,
                         const int32_t *corners, int32_t *triangles) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    polygon poly;
    size_t outline_size = reel_triangle_corners_memory(max_size);
    (void)allocate_polygon(&arena, max_size, &poly);
    int32_t *restored = reel_allocate(&arena, 3 * (size_t)max_size, sizeof *restored);
    void *outline_memory = reel_allocate(&arena, outline_size, 1);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    int64_t n_overlapping = 0;
    poly.tests_left = MAX_TESTS;
    for (int64_t i = 0; i < n_polygons; i++) {
        int32_t size = sizes[i];
        if (size > max_size) {
            return reel_failure(REEL_NO_MEMORY, 0);
        }
        bool is_convex = true, is_simple = true, is_cut = false;
        if (size > 3) {
            poly.tolerance = TOLERANCE * project(&poly, positions, corners, size);
            is_convex = is_fan(&poly, size);
        }
        if (!is_convex) {
            is_simple = clip_ears(&poly, size);
            list_triangles(&poly);
            copy_vertices(&poly, corners, size, triangles);
            is_cut = is_readable(&poly, outline_memory, outline_size, size, triangles, restored);
        }
        if (!is_cut) {
            list_fan(&poly, size);
            copy_vertices(&poly, corners, size, triangles);
        }
        n_overlapping += !is_convex && !(is_simple && is_cut);
        corners += size;
        triangles += 3 * (size - 2);
    }
    return n_overlapping;
}
