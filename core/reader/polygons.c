/* Faces and their corners: docs/format.md, POLYGONS. */

#include "polygons.h"

/* Whether all polygons together have the number of triangles; a polygon has 1 + extra[i]. */
static bool fits_triangles(const reel_outline *outline, const int32_t *n_extra) {
    int64_t n_left = (int64_t)(outline->n_faces - outline->n_polygons);
    for (uint64_t i = 0; i < outline->n_polygons; i++) {
        if (n_extra[i] < 0 || n_extra[i] > n_left) {
            return false;
        }
        n_left -= n_extra[i];
    }
    return n_left == 0;
}

int reel_read_face_sizes(reel_call *call, reel_pool *pool, const reel_outline *outline,
                         reel_faces *faces) {
    reel_range payload, input;
    uint64_t n_polygons;
    *faces = (reel_faces){.outline = outline};
    if (!reel_count_sections(outline, REEL_POLYGONS, &payload)) {
        return MESHREEL_OK;
    }
    input = payload;
    REEL_TRY(reel_read_varint(call, &input, &n_polygons));
    REEL_CORRUPT_IF(n_polygons != outline->n_polygons || n_polygons > outline->n_faces,
                    payload.offset, "there are more polygons than triangles");
    const reel_chunk *mark = call->scratch.last;
    int64_t length = (int64_t)n_polygons;
    int32_t table = 0, *n_extra;
    REEL_TRY(reel_decode_rows(call, input, &length, &table, 1, 1, &n_extra));
    REEL_CORRUPT_IF(!fits_triangles(outline, n_extra), payload.offset,
                    "the corners of polygons do not fit the number of triangles");
    if (n_polygons < outline->n_faces) { /* otherwise all are triangles */
        uint32_t *sizes = reel_pool_allocate(call, pool, n_polygons, sizeof *sizes);
        REEL_NEED(sizes);
        for (uint64_t i = 0; i < n_polygons; i++) {
            sizes[i] = 3U + (uint32_t)n_extra[i];
        }
        faces->sizes = sizes;
    }
    reel_drop_scratch(call, mark);
    return MESHREEL_OK;
}

int reel_find_triangle_corners(reel_call *call, reel_pool *pool, reel_faces *faces) {
    const reel_outline *outline = faces->outline;
    if (!faces->sizes) {
        return MESHREEL_OK;
    }
    reel_range payload;
    reel_count_sections(outline, REEL_POLYGONS, &payload);
    uint32_t max_size = 3;
    for (uint64_t i = 0; i < outline->n_polygons; i++) {
        max_size = faces->sizes[i] > max_size ? faces->sizes[i] : max_size;
    }
    const reel_chunk *mark = call->scratch.last;
    size_t size = reel_triangle_corners_memory(max_size);
    int32_t *corners = reel_pool_allocate(call, pool, 3 * outline->n_faces, sizeof *corners);
    void *memory = reel_scratch(call, size, 1);
    REEL_NEED(corners && memory);
    int64_t n_corners = reel_triangle_corners(memory, size, (const int32_t *)faces->triangles,
                                              (const int32_t *)faces->sizes,
                                              (int64_t)outline->n_polygons, max_size, corners);
    REEL_CORRUPT_IF(n_corners < 0, payload.offset, "the triangles of a polygon do not adjoin");
    faces->corners = corners;
    reel_drop_scratch(call, mark);
    return MESHREEL_OK;
}

void reel_find_corner_vertices(const reel_faces *faces, int32_t *vertices) {
    for (uint64_t i = 0; i < 3 * faces->outline->n_faces; i++) {
        vertices[reel_corner_at(faces, i)] = (int32_t)faces->triangles[i];
    }
}
