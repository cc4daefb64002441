/* Faces and their corners: docs/format.md, POLYGONS. */

#include "polygons.h"

/* Whether the corners of all faces yield the number of triangles; `above` are their counts less
   3. */
static bool fits_triangles(const reel_outline *outline, const int32_t *above) {
    int64_t left = (int64_t)(outline->n_faces - outline->n_polygons);
    for (uint64_t i = 0; i < outline->n_polygons; i++) {
        if (above[i] < 0 || above[i] > left) {
            return false;
        }
        left -= above[i];
    }
    return left == 0;
}

int reel_read_face_sizes(reel_call *call, reel_pool *pool, const reel_outline *outline,
                         const uint32_t **face_sizes) {
    reel_range payload, left;
    uint32_t n_sections = reel_count_sections(outline, REEL_POLYGONS, &payload);
    uint64_t n_polygons;
    *face_sizes = NULL;
    if (!n_sections) {
        return MESHREEL_OK;
    }
    REEL_CORRUPT_IF(n_sections > 1, payload.at, "the file has more than one section POLYGONS");
    left = payload;
    REEL_TRY(reel_read_varint(call, &left, &n_polygons));
    REEL_CORRUPT_IF(n_polygons != outline->n_polygons || n_polygons > outline->n_faces, payload.at,
                    "there are more polygons than triangles");
    const reel_chunk *mark = call->scratch.last;
    int64_t length = (int64_t)n_polygons;
    int32_t table = 0, *above;
    REEL_TRY(reel_decode_rows(call, left, &length, &table, 1, 1, &above));
    REEL_CORRUPT_IF(!fits_triangles(outline, above), payload.at,
                    "the corners of polygons do not fit the number of triangles");
    if (n_polygons < outline->n_faces) { /* otherwise all are triangles */
        uint32_t *sizes = reel_pool_allocate(call, pool, n_polygons, sizeof *sizes);
        REEL_NEED(sizes);
        for (uint64_t i = 0; i < n_polygons; i++) {
            sizes[i] = 3U + (uint32_t)above[i];
        }
        *face_sizes = sizes;
    }
    reel_drop_scratch(call, mark);
    return MESHREEL_OK;
}

void reel_find_fans(const reel_outline *outline, const uint32_t *face_sizes, int32_t *corners) {
    int32_t first = 0;
    for (uint64_t i = 0; i < outline->n_polygons; i++) {
        int32_t size = face_sizes ? (int32_t)face_sizes[i] : 3;
        for (int32_t k = 1; k < size - 1; k++) {
            corners[0] = first;
            corners[1] = first + k;
            corners[2] = first + k + 1;
            corners += 3;
        }
        first += size;
    }
}

void reel_find_corner_vertices(const reel_outline *outline, const uint32_t *triangles,
                               const uint32_t *face_sizes, int32_t *vertices) {
    for (uint64_t i = 0; i < outline->n_polygons; i++) {
        uint32_t size = face_sizes ? face_sizes[i] : 3;
        *vertices++ = (int32_t)triangles[0];
        *vertices++ = (int32_t)triangles[1];
        for (uint32_t k = 2; k < size; k++) {
            *vertices++ = (int32_t)triangles[2];
            triangles += 3;
        }
    }
}
