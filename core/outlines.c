/* The corners of polygons, from the triangles that they are cut into: docs/format.md, POLYGONS. */

#include "base.h"

/* The outline of a polygon while its triangles are attached. Nodes are its corners, in the order
   of the triangles that add them. */
typedef struct {
    int32_t *vertex, *next; /* of each node; the next one in the outline */
    int32_t *from, *to;     /* stack of sides */
    int32_t depth;
} outline;

static bool allocate_outline(reel_arena *arena, int64_t max_size, outline *result) {
    int32_t **arrays[] = {&result->vertex, &result->next, &result->from, &result->to};
    for (int i = 0; i < 4; i++) {
        *arrays[i] = reel_allocate(arena, (size_t)max_size, sizeof(int32_t));
    }
    return !arena->failed;
}

static void insert_node(outline *polygon, int32_t start, int32_t node, int32_t end) {
    const int32_t sides[2][2] = {{start, node}, {node, end}};
    for (int i = 0; i < 2; i++) {
        polygon->next[sides[i][0]] = sides[i][1];
        polygon->from[polygon->depth] = sides[i][0];
        polygon->to[polygon->depth++] = sides[i][1];
    }
}

/* Attach the triangles of a polygon; sets the corner of the polygon, from `first` on, at each of
   theirs. Returns false if a triangle has no side of the outline. */
static bool attach_triangles(outline *polygon, const int32_t *triangles, int32_t size,
                             int32_t first, int32_t *corners) {
    int32_t *position = polygon->from;
    polygon->from[0] = 0;
    polygon->to[0] = 1;
    polygon->depth = 1;
    polygon->next[0] = 1;
    insert_node(polygon, 1, 2, 0);
    for (int32_t i = 0; i < 3; i++) {
        polygon->vertex[i] = triangles[i];
        corners[i] = i;
    }
    for (int32_t node = 3; node < size; node++) {
        triangles += 3;
        corners += 3;
        int32_t start, end;
        do {
            if (!polygon->depth) {
                return false;
            }
            start = polygon->from[--polygon->depth];
            end = polygon->to[polygon->depth];
        } while (polygon->vertex[end] != triangles[0] || polygon->vertex[start] != triangles[1]);
        polygon->vertex[node] = triangles[2];
        insert_node(polygon, start, node, end);
        corners[0] = end;
        corners[1] = start;
        corners[2] = node;
    }
    for (int32_t i = 0, node = 0; i < size; i++, node = polygon->next[node]) {
        position[node] = first + i;
    }
    corners -= 3 * (size - 3);
    for (int32_t i = 0; i < 3 * (size - 2); i++) {
        corners[i] = position[corners[i]];
    }
    return true;
}

size_t reel_triangle_corners_memory(int64_t max_size) {
    return 4 * reel_array_bytes((size_t)max_size, sizeof(int32_t));
}

int64_t reel_triangle_corners(void *memory, size_t memory_size, const int32_t *triangles,
                              const int32_t *sizes, int64_t n_polygons, int64_t max_size,
                              int32_t *corners) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    outline result;
    int32_t first = 0;
    if (!allocate_outline(&arena, max_size, &result)) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t i = 0; i < n_polygons; i++) {
        if (sizes[i] > max_size) {
            return reel_failure(REEL_NO_MEMORY, 0);
        }
        if (!attach_triangles(&result, triangles, sizes[i], first, corners)) {
            return reel_failure(REEL_CORRUPT, (uint64_t)i);
        }
        triangles += 3 * (sizes[i] - 2);
        corners += 3 * (sizes[i] - 2);
        first += sizes[i];
    }
    return first;
}
