/* Cutting of polygons into triangles: fans where they fit, otherwise by ear clipping (G. Meisters,
   "Polygons have ears", 1975). The triangles are in the order of docs/format.md, POLYGONS. */

#include "base.h"

#define NONE (-1)
#define TOLERANCE 1e-6             /* of the fan's area, up to which a triangle may be reversed */
#define MAX_TESTS ((int64_t)1 << 28) /* of corners in triangles, of all polygons together */

/* What is clipped: convex corners whose triangle contains no other; also those without area, or
   with others on its sides; anything. */
enum ears { STRICT, LENIENT, ALL };

typedef struct {
    double x, y;
} point;

/* A triangle that was clipped: its corners, the middle one is the ear; and the triangles clipped
   before across its first and second side, or NONE. */
typedef struct {
    int32_t corners[3], across[2];
} clipped;

/* A polygon in its plane, and its outline without the clipped ears. */
typedef struct {
    point *points;
    int32_t *previous, *next;
    int32_t *below; /* the triangle clipped from the side to the next corner, or NONE */
    bool *is_reflex;
    clipped *ears;
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
static double area_of(const polygon *of, int32_t a, int32_t b, int32_t c) {
    const point *p = &of->points[a], *q = &of->points[b], *r = &of->points[c];
    return (q->x - p->x) * (r->y - p->y) - (r->x - p->x) * (q->y - p->y);
}

/* Project a polygon along the axis nearest to its normal (Newell's method), so that its area is
   positive; returns twice the area of its fan, in which reversed triangles count as the others. */
static double project(polygon *of, const double *positions, const int32_t *corners, int32_t size) {
    const double *origin = positions + 3 * (int64_t)corners[0];
    double normal[3] = {0, 0, 0}, areas[3] = {0, 0, 0};
    for (int32_t i = 1; i < size - 1; i++) {
        const double *p = positions + 3 * (int64_t)corners[i];
        const double *q = positions + 3 * (int64_t)corners[i + 1];
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
        const double *p = positions + 3 * (int64_t)corners[i];
        of->points[i] = (point){p[x] - origin[x], p[y] - origin[y]};
    }
    return areas[axis];
}

static bool is_fan(const polygon *of, int32_t size) {
    for (int32_t i = 1; i < size - 1; i++) {
        if (area_of(of, 0, i, i + 1) < -of->tolerance) {
            return false;
        }
    }
    return true;
}

static bool are_equal(const point *p, const point *q) { return p->x == q->x && p->y == q->y; }

/* Whether the triangle at a corner is an ear. Only reflex corners can be inside. */
static bool is_ear(polygon *of, int32_t b, enum ears kind) {
    int32_t a = of->previous[b], c = of->next[b];
    double area = area_of(of, a, b, c);
    if (kind == ALL || !(kind == STRICT ? area > 0 : area >= -of->tolerance)) {
        return kind == ALL;
    }
    const point *p = of->points;
    for (int32_t i = of->next[c]; i != a; i = of->next[i], of->tests_left--) {
        if (!of->is_reflex[i] || are_equal(&p[i], &p[a]) || are_equal(&p[i], &p[b]) ||
            are_equal(&p[i], &p[c])) {
            continue;
        }
        double sides[3] = {area_of(of, a, b, i), area_of(of, b, c, i), area_of(of, c, a, i)};
        bool is_inside = kind == STRICT ? sides[0] >= 0 && sides[1] >= 0 && sides[2] >= 0
                                        : sides[0] > 0 && sides[1] > 0 && sides[2] > 0;
        if (is_inside) {
            return false;
        }
    }
    return true;
}

static void update_corner(polygon *of, int32_t i) {
    of->is_reflex[i] = !(area_of(of, of->previous[i], i, of->next[i]) > 0);
}

static void clip(polygon *of, int32_t b, int32_t number) {
    int32_t a = of->previous[b], c = of->next[b];
    of->ears[number] = (clipped){{a, b, c}, {of->below[a], of->below[b]}};
    of->below[a] = number;
    of->next[a] = c;
    of->previous[c] = a;
    update_corner(of, a);
    update_corner(of, c);
}

/* Clip ears until a triangle at corner 0 is left; returns whether they do not overlap. */
static bool clip_ears(polygon *of, int32_t size) {
    for (int32_t i = 0; i < size; i++) {
        of->previous[i] = i ? i - 1 : size - 1;
        of->next[i] = i < size - 1 ? i + 1 : 0;
        of->below[i] = NONE;
    }
    for (int32_t i = 0; i < size; i++) {
        update_corner(of, i);
    }
    enum ears kind = STRICT;
    bool was_forced = false;
    for (int32_t n_left = size, n_tried = 0, i = 1; n_left > 3;) {
        kind = of->tests_left < 0 ? ALL : kind;
        if (i && is_ear(of, i, kind)) {
            clip(of, i, size - n_left--);
            i = of->next[of->next[i]]; /* leaves wider triangles than the next corner */
            was_forced |= kind == ALL;
            kind = STRICT;
            n_tried = 0;
        } else {
            i = of->next[i];
            if (++n_tried > n_left) {
                kind++;
                n_tried = 0;
            }
        }
    }
    int32_t b = of->next[0];
    return !was_forced && area_of(of, 0, b, of->next[b]) >= -of->tolerance;
}

static void push(polygon *of, int32_t *depth, int32_t triangle) {
    if (triangle != NONE) {
        of->stack[(*depth)++] = triangle;
    }
}

/* List the triangle that is left, then each clipped one at a side of those before. */
static void list_triangles(polygon *of) {
    int32_t a = of->next[0], b = of->next[a], depth = 0, *corners = of->corners;
    *corners++ = 0;
    *corners++ = a;
    *corners++ = b;
    push(of, &depth, of->below[0]);
    push(of, &depth, of->below[a]);
    push(of, &depth, of->below[b]);
    while (depth) {
        const clipped *ear = &of->ears[of->stack[--depth]];
        *corners++ = ear->corners[2];
        *corners++ = ear->corners[0];
        *corners++ = ear->corners[1];
        push(of, &depth, ear->across[0]);
        push(of, &depth, ear->across[1]);
    }
}

static void list_fan(polygon *of, int32_t size) {
    int32_t *corners = of->corners;
    for (int32_t i = 1; i < size - 1; i++) {
        *corners++ = 0;
        *corners++ = i;
        *corners++ = i + 1;
    }
}

static void copy_vertices(const polygon *of, const int32_t *vertices, int32_t size,
                          int32_t *triangles) {
    for (int64_t i = 0; i < 3 * ((int64_t)size - 2); i++) {
        triangles[i] = vertices[of->corners[i]];
    }
}

/* Whether a reader finds the corners of the polygon in its triangles; not always with repeated
   vertices. */
static bool is_readable(const polygon *of, void *memory, size_t memory_size, int32_t size,
                        const int32_t *triangles, int32_t *read_corners) {
    if (reel_triangle_corners(memory, memory_size, triangles, &size, 1, size, read_corners) < 0) {
        return false;
    }
    return reel_equal_bytes((const uint8_t *)read_corners, (const uint8_t *)of->corners,
                            3 * ((size_t)size - 2) * sizeof *read_corners);
}

size_t reel_triangulate_memory(int64_t max_size) {
    reel_arena arena = REEL_MEASURE;
    polygon measured;
    (void)allocate_polygon(&arena, max_size, &measured);
    return arena.used + reel_array_bytes(3 * (size_t)max_size, sizeof(int32_t)) +
           reel_array_bytes(reel_triangle_corners_memory(max_size), 1);
}

int64_t reel_triangulate(void *memory, size_t memory_size, const double *positions,
                         const int32_t *sizes, int64_t n_polygons, int64_t max_size,
                         const int32_t *corners, int32_t *triangles) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    polygon of;
    size_t outline_size = reel_triangle_corners_memory(max_size);
    (void)allocate_polygon(&arena, max_size, &of);
    int32_t *read_corners = reel_allocate(&arena, 3 * (size_t)max_size, sizeof *read_corners);
    void *outline_memory = reel_allocate(&arena, outline_size, 1);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    int64_t n_overlapping = 0;
    of.tests_left = MAX_TESTS;
    for (int64_t i = 0; i < n_polygons; i++) {
        int32_t size = sizes[i];
        if (size > max_size) {
            return reel_failure(REEL_NO_MEMORY, 0);
        }
        bool is_convex = true, is_simple = true, is_cut = false;
        if (size > 3) {
            of.tolerance = TOLERANCE * project(&of, positions, corners, size);
            is_convex = is_fan(&of, size);
        }
        if (!is_convex) {
            is_simple = clip_ears(&of, size);
            list_triangles(&of);
            copy_vertices(&of, corners, size, triangles);
            is_cut = is_readable(&of, outline_memory, outline_size, size, triangles, read_corners);
        }
        if (!is_cut) {
            list_fan(&of, size);
            copy_vertices(&of, corners, size, triangles);
        }
        n_overlapping += !is_convex && !(is_simple && is_cut);
        corners += size;
        triangles += 3 * (size - 2);
    }
    return n_overlapping;
}
