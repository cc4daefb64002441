/* Hard edges, across which faces do not share normals: docs/format.md, HARD_EDGES. */

#include "hard_edges.h"

/* Sides of faces: their lower vertices, then their higher ones. */
typedef struct {
    uint32_t *ends[2];
    uint64_t count;
} face_sides;

/* List the sides between two different vertices, in corner order. */
static int find_sides(reel_call *call, const reel_faces *faces, face_sides *sides) {
    const reel_outline *outline = faces->outline;
    int32_t *vertices = reel_scratch(call, outline->n_corners, sizeof *vertices);
    *sides = (face_sides){{NULL, NULL}, 0};
    for (int table = 0; table < 2; table++) {
        sides->ends[table] = reel_scratch(call, outline->n_corners, sizeof(uint32_t));
    }
    REEL_NEED(vertices && sides->ends[0] && sides->ends[1]);
    reel_find_corner_vertices(faces, vertices);
    for (uint64_t face = 0; face < outline->n_polygons; face++) {
        uint32_t size = faces->sizes ? faces->sizes[face] : 3;
        for (uint32_t k = 0; k < size; k++) {
            uint32_t a = (uint32_t)vertices[k], b = (uint32_t)vertices[(k + 1) % size];
            if (a != b) {
                sides->ends[0][sides->count] = a < b ? a : b;
                sides->ends[1][sides->count++] = a < b ? b : a;
            }
        }
        vertices += size;
    }
    return MESHREEL_OK;
}

/* Sort sides by one of their vertices, stably; `starts` has space for n_verts + 1 numbers. */
static void sort_by(const uint32_t *keys, uint64_t n_verts, const uint32_t *order, uint64_t count,
                    uint32_t *starts, uint32_t *sorted) {
    reel_zero(starts, (n_verts + 1) * sizeof *starts);
    for (uint64_t i = 0; i < count; i++) {
        starts[keys[i] + 1]++;
    }
    for (uint64_t v = 0; v < n_verts; v++) {
        starts[v + 1] += starts[v];
    }
    for (uint64_t i = 0; i < count; i++) {
        uint32_t side = order ? order[i] : (uint32_t)i;
        sorted[starts[keys[side]]++] = side;
    }
}

/* Find the edges of two or more sides, as pairs of vertices, in the order of their first sides. */
static int find_edges(reel_call *call, const reel_faces *faces, uint32_t **edges,
                      uint64_t *n_edges) {
    face_sides sides;
    uint64_t n_verts = faces->outline->n_verts;
    REEL_TRY(find_sides(call, faces, &sides));
    uint32_t *starts = reel_scratch(call, n_verts + 1, sizeof *starts);
    uint32_t *by_high = reel_scratch(call, sides.count, sizeof *by_high);
    uint32_t *sorted = reel_scratch(call, sides.count, sizeof *sorted);
    uint8_t *is_shared = reel_scratch(call, sides.count, 1);
    *edges = reel_scratch(call, 2 * sides.count, sizeof **edges);
    REEL_NEED(starts && by_high && sorted && is_shared && *edges);
    const uint32_t *low = sides.ends[0], *high = sides.ends[1];
    sort_by(high, n_verts, NULL, sides.count, starts, by_high);
    sort_by(low, n_verts, by_high, sides.count, starts, sorted);
    reel_zero(is_shared, sides.count);
    for (uint64_t i = 0, next; i < sides.count; i = next) {
        uint32_t first = sorted[i]; /* the sort is stable */
        for (next = i + 1; next < sides.count && low[sorted[next]] == low[first] &&
                           high[sorted[next]] == high[first]; next++) {
            is_shared[first] = 1;
        }
    }
    *n_edges = 0;
    for (uint64_t i = 0; i < sides.count; i++) {
        if (is_shared[i]) {
            (*edges)[2 * *n_edges] = low[i];
            (*edges)[2 * (*n_edges)++ + 1] = high[i];
        }
    }
    return MESHREEL_OK;
}

int reel_read_hard_edges(reel_call *call, reel_pool *pool, const reel_faces *faces,
                         reel_range payload, meshreel_surface *surface) {
    reel_range input = payload;
    uint32_t *edges;
    uint64_t n_hard, n_edges = 0;
    REEL_TRY(reel_read_varint(call, &input, &n_hard));
    REEL_TRY(find_edges(call, faces, &edges, &n_edges));
    REEL_CORRUPT_IF(!n_hard || n_hard > n_edges, payload.offset,
                    "the number of hard edges is 0, or exceeds the edges between faces");
    int64_t length = (int64_t)n_hard, number = -1;
    int32_t table = 0, *gaps;
    REEL_TRY(reel_decode_rows(call, input, &length, &table, 1, 1, &gaps));
    uint32_t *hard = reel_pool_allocate(call, pool, 2 * n_hard, sizeof *hard);
    REEL_NEED(hard);
    for (uint64_t i = 0; i < n_hard; i++) {
        number += (int64_t)gaps[i] + 1;
        REEL_CORRUPT_IF(gaps[i] < 0 || number >= (int64_t)n_edges, input.offset,
                        "a hard edge does not lie between faces");
        hard[2 * i] = edges[2 * number];
        hard[2 * i + 1] = edges[2 * number + 1];
    }
    surface->hard_edges = hard;
    surface->n_hard_edges = (uint32_t)n_hard;
    return MESHREEL_OK;
}
