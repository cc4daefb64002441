/* The triangles of a file, and the order of its vertices: docs/format.md, CONNECTIVITY and ORDER. */

#include "triangles.h"

#define VERTICES_ONLY 1
#define VERTICES_AND_FACES 2

size_t reel_triangles_scratch(const reel_outline *outline) {
    int64_t n_verts = (int64_t)outline->n_verts, n_faces = (int64_t)outline->n_faces;
    size_t walk = reel_view_room(outline->source, outline->connectivity.length) +
                  reel_room(reel_connectivity_decode_memory(n_verts, n_faces), 1);
    size_t twins = reel_room(reel_twins_memory(n_verts, n_faces), 1);
    size_t order = reel_room(reel_order_memory(n_verts, n_faces), 1);
    size_t ordering = reel_view_room(outline->source, outline->vertex_order.length) +
                      reel_room(3 * (size_t)n_faces, sizeof(int32_t)) +
                      reel_room((size_t)n_faces, sizeof(int32_t)) + (twins > order ? twins : order);
    return walk > ordering ? walk : ordering;
}

static int decode_faces(const reel_outline *outline, reel_arena scratch, int32_t *faces) {
    int64_t n_verts = (int64_t)outline->n_verts, n_faces = (int64_t)outline->n_faces;
    size_t needed = reel_connectivity_decode_memory(n_verts, n_faces);
    void *memory = reel_take(&scratch, needed, 1);
    const uint8_t *bytes;
    if (!memory) {
        return MESHREEL_NO_MEMORY;
    }
    int failed = reel_view(outline->source, outline->connectivity, &scratch, &bytes);
    return failed ? failed
                  : reel_code_of(reel_connectivity_decode(memory, needed, bytes,
                                                          (size_t)outline->connectivity.length,
                                                          n_verts, n_faces, faces));
}

static int64_t find_twins(const reel_outline *outline, reel_arena scratch, const int32_t *faces,
                          int32_t *twins) {
    int64_t n_verts = (int64_t)outline->n_verts, n_faces = (int64_t)outline->n_faces;
    size_t needed = reel_twins_memory(n_verts, n_faces);
    void *memory = reel_take(&scratch, needed, 1);
    return memory ? reel_twins(memory, needed, faces, n_faces, n_verts, twins)
                  : reel_failure(REEL_NO_MEMORY, 0);
}

/* The first corners of faces, or NULL where they are in their order, and the vertices. */
static int decode_order(const reel_outline *outline, reel_arena *scratch, const int32_t *faces,
                        int32_t **corners, int32_t *sequence) {
    int64_t n_verts = (int64_t)outline->n_verts, n_faces = (int64_t)outline->n_faces;
    size_t size = (size_t)outline->vertex_order.length;
    int32_t *twins = reel_take(scratch, 3 * (size_t)n_faces, sizeof *twins);
    *corners = reel_take(scratch, (size_t)n_faces, sizeof **corners);
    reel_arena inner = *scratch;
    const uint8_t *bytes;
    int failed = inner.failed ? MESHREEL_NO_MEMORY
                              : reel_view(outline->source, outline->vertex_order, &inner, &bytes);
    if (failed) {
        return failed;
    }
    bool with_faces = bytes[0] == VERTICES_AND_FACES;
    if ((!with_faces && bytes[0] != VERTICES_ONLY) || (size > 1 && !bytes[size - 1])) {
        return MESHREEL_CORRUPT;
    }
    if (with_faces) {
        int64_t found = find_twins(outline, inner, faces, twins);
        if (found < 0) {
            return reel_code_of(found);
        }
    }
    size_t needed = reel_order_memory(n_verts, n_faces);
    void *memory = reel_take(&inner, needed, 1);
    if (!memory) {
        return MESHREEL_NO_MEMORY;
    }
    int64_t result = reel_order_decode(memory, needed, bytes + 1, size - 1, faces,
                                       with_faces ? twins : NULL, n_verts, n_faces, with_faces,
                                       with_faces ? *corners : NULL, sequence);
    *corners = with_faces ? *corners : NULL;
    return reel_code_of(result);
}

/* The faces with the numbers of vertices that go out, by their first corners. */
static void list_faces(int64_t n_faces, const int32_t *faces, const int32_t *outward,
                       const int32_t *corners, uint32_t *triangles) {
    for (int64_t i = 0; i < n_faces; i++) {
        int64_t first = corners ? corners[i] : 3 * i, face = first / 3 * 3;
        for (int64_t k = 0; k < 3; k++) {
            int64_t corner = face + (first - face + k) % 3;
            triangles[3 * i + k] = (uint32_t)outward[faces[corner]];
        }
    }
}

int reel_decode_triangles(const reel_outline *outline, reel_arena scratch, int32_t *faces,
                          int32_t *sequence, int32_t *outward, uint32_t *triangles) {
    bool has_order = outline->order != REEL_ORDER_DROPPED;
    if (outline->n_connectivity != 1 || (has_order && outline->n_order != 1)) {
        return MESHREEL_CORRUPT;
    }
    int32_t n_verts = (int32_t)outline->n_verts, *corners = NULL;
    int failed = decode_faces(outline, scratch, faces);
    if (!failed && has_order && outline->vertex_order.length) {
        failed = decode_order(outline, &scratch, faces, &corners, sequence);
    } else {
        for (int32_t v = 0; v < n_verts; v++) {
            sequence[v] = v;
        }
    }
    if (failed) {
        return failed;
    }
    for (int32_t v = 0; v < n_verts; v++) {
        outward[sequence[v]] = v;
    }
    list_faces((int64_t)outline->n_faces, faces, outward, corners, triangles);
    return MESHREEL_OK;
}
