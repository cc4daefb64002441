/* Graphs of faces, corners and rows of corners: docs/format.md, "Tracks". */

#include "items.h"

#include "cell_mesh.h"

/* Find the face of each triangle. */
static int find_polygons(reel_call *call, reel_pool *pool, const reel_faces *faces,
                         const int32_t **result) {
    const reel_outline *outline = faces->outline;
    int32_t *polygons = reel_pool_allocate(call, pool, outline->n_faces, sizeof *polygons);
    *result = polygons;
    REEL_NEED(polygons);
    for (uint64_t polygon = 0; polygon < outline->n_polygons; polygon++) {
        uint32_t size = faces->sizes ? faces->sizes[polygon] : 3;
        for (uint32_t k = 2; k < size; k++) {
            *polygons++ = (int32_t)polygon;
        }
    }
    return MESHREEL_OK;
}

/* ---- rows ---- */

typedef struct {
    int32_t *of_corners;
    uint64_t n_rows;
} corner_rows;

/* List corners by internal vertex, ascending: those of v are corners[starts[v]..starts[v + 1]). */
static int list_corners(reel_call *call, const int32_t *vertices, const int32_t *to_internal,
                        uint64_t n_corners, uint64_t n_verts, int32_t **starts, int32_t **corners) {
    *starts = reel_scratch(call, n_verts + 2, sizeof **starts);
    *corners = reel_scratch(call, n_corners, sizeof **corners);
    REEL_NEED(*starts && *corners);
    int32_t *next = *starts + 1; /* after filling, next[v] is the end of v */
    reel_zero(*starts, (n_verts + 2) * sizeof **starts);
    for (uint64_t i = 0; i < n_corners; i++) {
        next[to_internal[vertices[i]] + 1]++;
    }
    reel_prefix_sum(next, (int64_t)n_verts);
    for (uint64_t i = 0; i < n_corners; i++) {
        (*corners)[next[to_internal[vertices[i]]]++] = (int32_t)i;
    }
    return MESHREEL_OK;
}

static int fail_rows(reel_call *call, const reel_track *track, const char *message) {
    return reel_corrupt(call, track->rows.offset, message);
}

/* Assign rows to the corners of a vertex with several; returns the codes read, or -1 if invalid. */
static int64_t assign_rows(const int32_t *corners, int64_t n_corners, const int32_t *codes,
                           int64_t n_codes, corner_rows *rows) {
    if (n_corners - 1 > n_codes) {
        return -1;
    }
    for (int64_t k = 1; k < n_corners; k++) {
        int64_t code = codes[k - 1], back = code ? code : 1;
        if (code < 0 || (code != 1 && back > k)) {
            return -1;
        }
        rows->of_corners[corners[k]] = code == 1 ? (int32_t)rows->n_rows++
                                                 : rows->of_corners[corners[k - back]];
    }
    return n_corners > 1 ? n_corners - 1 : 0;
}

static int read_rows(reel_call *call, reel_pool *pool, const reel_outline *outline,
                     const reel_track *track, const int32_t *vertices, const int32_t *to_internal,
                     corner_rows *rows) {
    uint64_t n_codes, n_verts = outline->n_verts, n_corners = outline->n_corners;
    reel_range input = track->rows;
    int32_t *starts, *sorted_corners, *has_seam;
    REEL_TRY(reel_read_varint(call, &input, &n_codes));
    if (n_codes > n_corners) {
        return fail_rows(call, track, "the row codes of corners exceed the number of corners");
    }
    const int64_t lengths[] = {(int64_t)n_verts, (int64_t)n_codes};
    const int32_t tables[] = {0, 1};
    REEL_TRY(reel_decode_rows(call, input, lengths, tables, 2, 2, &has_seam));
    REEL_TRY(list_corners(call, vertices, to_internal, n_corners, n_verts, &starts,
                          &sorted_corners));
    rows->of_corners = reel_pool_allocate(call, pool, n_corners, sizeof *rows->of_corners);
    rows->n_rows = n_verts;
    REEL_NEED(rows->of_corners);
    const int32_t *codes = has_seam + n_verts;
    int64_t n_read = 0;
    for (uint64_t v = 0; v < n_verts; v++) {
        const int32_t *corners = sorted_corners + starts[v];
        int64_t count = starts[v + 1] - starts[v], n_used = 0;
        if (has_seam[v] != 0 && has_seam[v] != 1) {
            return fail_rows(call, track,
                             "the flag of a vertex with several rows is neither 0 nor 1");
        }
        for (int64_t k = 0; k < count; k++) {
            rows->of_corners[corners[k]] = (int32_t)v;
        }
        if (has_seam[v]) {
            n_used = assign_rows(corners, count, codes + n_read, (int64_t)n_codes - n_read, rows);
        }
        if (n_used < 0) {
            return fail_rows(call, track, "the row code of a corner is out of range");
        }
        n_read += n_used;
    }
    return n_read == (int64_t)n_codes
               ? MESHREEL_OK
               : fail_rows(call, track, "there are more row codes than corners at seams");
}

static int find_row_vertices(reel_call *call, reel_pool *pool, const corner_rows *rows,
                             const reel_mesh_data *mesh, uint64_t n_verts, uint64_t n_corners,
                             const int32_t *vertices, const int32_t **result) {
    int32_t *row_vertices = reel_pool_allocate(call, pool, rows->n_rows, sizeof *row_vertices);
    *result = row_vertices;
    REEL_NEED(row_vertices);
    reel_copy(row_vertices, mesh->to_output, n_verts * sizeof *row_vertices);
    for (uint64_t i = 0; i < n_corners; i++) {
        row_vertices[rows->of_corners[i]] = vertices[i];
    }
    return MESHREEL_OK;
}

/* Find the graph of the items at the corners of triangles. */
static int find_graph(reel_call *call, reel_pool *pool, const reel_outline *outline,
                      const reel_mesh_data *mesh, const int32_t *items, uint64_t n_items,
                      reel_graph *graph) {
    const int32_t *triangles = (const int32_t *)mesh->triangles;
    uint64_t n_triangles = outline->n_faces;
    int32_t *faces = reel_scratch(call, 3 * 4 * n_triangles, sizeof *faces), *twins;
    REEL_NEED(faces);
    REEL_TRY(reel_find_twins(call, &call->scratch, triangles, n_triangles, outline->n_verts,
                             &twins));
    int64_t n_faces = reel_item_faces(triangles, twins, items, (int64_t)n_triangles, faces);
    return reel_find_neighbors(call, pool, faces, (uint64_t)n_faces, (uint32_t)n_items, graph);
}

int reel_find_items(reel_call *call, reel_pool *pool, const reel_faces *faces,
                    const reel_mesh_data *mesh, const reel_track *track, reel_items *items) {
    const reel_outline *outline = faces->outline;
    uint32_t domain = track->info.domain;
    uint64_t n_corners = outline->n_corners;
    *items =
        (reel_items){.graph = mesh->graph, .order = mesh->to_internal, .inverse = mesh->to_output};
    if (domain == MESHREEL_VERTICES) {
        return MESHREEL_OK;
    }
    if (REEL_IS_COMPLETE && domain == MESHREEL_CELLS) {
        items->order = items->inverse = NULL;
        return reel_find_cell_graph(call, pool, outline, mesh, true, &items->graph);
    }
    int32_t *vertices = NULL;
    corner_rows rows = {NULL, 0};
    if (domain == MESHREEL_CORNERS) {
        vertices = reel_pool_allocate(call, pool, n_corners, sizeof *vertices);
        REEL_NEED(vertices);
        reel_find_corner_vertices(faces, vertices);
        items->vertex = vertices;
        items->value_of = track->sharing == REEL_OF_VERTICES ? vertices : NULL;
    }
    if (track->sharing == REEL_OF_VERTICES) {
        items->vertex = NULL;
        return MESHREEL_OK;
    }
    items->order = items->inverse = NULL;
    REEL_TRY(find_polygons(call, pool, faces, &items->polygon));
    uint64_t n_items = domain == MESHREEL_FACES ? outline->n_polygons : n_corners;
    if (track->sharing == REEL_OF_ROWS) {
        REEL_TRY(read_rows(call, pool, outline, track, vertices, mesh->to_internal, &rows));
        REEL_TRY(find_row_vertices(call, pool, &rows, mesh, outline->n_verts, n_corners, vertices,
                                   &items->vertex));
        items->value_of = rows.of_corners;
        n_items = rows.n_rows;
    }
    uint64_t n_triangle_corners = 3 * outline->n_faces;
    int32_t *triangle_items = reel_scratch(call, n_triangle_corners, sizeof *triangle_items);
    REEL_NEED(triangle_items);
    for (uint64_t i = 0; i < n_triangle_corners; i++) {
        int32_t corner = reel_corner_at(faces, i);
        triangle_items[i] = domain == MESHREEL_FACES ? items->polygon[i / 3]
                            : rows.of_corners        ? rows.of_corners[corner]
                                                     : corner;
    }
    return find_graph(call, pool, outline, mesh, triangle_items, n_items, &items->graph);
}
