/* Graphs of faces, corners and rows of corners: docs/format.md, "Tracks". */

#include "items.h"

#include "polygons.h"

/* Fan triangulation: the polygon corner, numbered face by face, at each corner of a triangle, and
   the polygon of each triangle. */
typedef struct {
    int32_t *corners;  /* 3 n_faces */
    int32_t *polygons; /* n_faces */
    uint64_t n_polygons, n_corners;
} fans;

static int find_fans(reel_call *call, reel_pool *pool, const reel_outline *outline,
                     const uint32_t *face_sizes, fans *result) {
    *result = (fans){.n_polygons = outline->n_polygons, .n_corners = outline->n_corners};
    result->corners = reel_scratch(call, 3 * outline->n_faces, sizeof *result->corners);
    result->polygons = reel_pool_allocate(call, pool, outline->n_faces, sizeof *result->polygons);
    REEL_NEED(result->corners && result->polygons);
    reel_find_fans(outline, face_sizes, result->corners);
    uint64_t triangle = 0;
    for (uint64_t polygon = 0; polygon < outline->n_polygons; polygon++) {
        uint32_t size = face_sizes ? face_sizes[polygon] : 3;
        for (uint32_t k = 2; k < size; k++) {
            result->polygons[triangle++] = (int32_t)polygon;
        }
    }
    return MESHREEL_OK;
}

/* ---- rows ---- */

typedef struct {
    int32_t *of_corners;
    uint64_t n_rows;
} corner_rows;

/* List corners by internal vertex, ascending: those of v are listed[starts[v]..starts[v + 1]). */
static int list_corners(reel_call *call, const int32_t *vertices, const int32_t *to_internal,
                        uint64_t n_corners, uint64_t n_verts, int32_t **starts, int32_t **listed) {
    *starts = reel_scratch(call, n_verts + 2, sizeof **starts);
    *listed = reel_scratch(call, n_corners, sizeof **listed);
    REEL_NEED(*starts && *listed);
    int32_t *next = *starts + 1; /* after filling, next[v] is the end of v */
    reel_zero(*starts, (n_verts + 2) * sizeof **starts);
    for (uint64_t i = 0; i < n_corners; i++) {
        next[to_internal[vertices[i]] + 1]++;
    }
    reel_prefix_sum(next, (int64_t)n_verts);
    for (uint64_t i = 0; i < n_corners; i++) {
        (*listed)[next[to_internal[vertices[i]]]++] = (int32_t)i;
    }
    return MESHREEL_OK;
}

static int damaged_rows(reel_call *call, const reel_track *track, const char *message) {
    return reel_corrupt(call, track->rows.at, message);
}

/* Assign rows to the corners of a vertex with several; returns the number of codes read, or -1 if
   invalid. */
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
    reel_range left = track->rows;
    int32_t *starts, *listed, *has_seam;
    REEL_TRY(reel_read_varint(call, &left, &n_codes));
    if (n_codes > n_corners) {
        return damaged_rows(call, track, "the row codes of corners exceed the number of corners");
    }
    const int64_t lengths[] = {(int64_t)n_verts, (int64_t)n_codes};
    const int32_t tables[] = {0, 1};
    REEL_TRY(reel_decode_rows(call, left, lengths, tables, 2, 2, &has_seam));
    REEL_TRY(list_corners(call, vertices, to_internal, n_corners, n_verts, &starts, &listed));
    rows->of_corners = reel_pool_allocate(call, pool, n_corners, sizeof *rows->of_corners);
    rows->n_rows = n_verts;
    REEL_NEED(rows->of_corners);
    const int32_t *codes = has_seam + n_verts;
    int64_t n_read = 0;
    for (uint64_t v = 0; v < n_verts; v++) {
        const int32_t *corners = listed + starts[v];
        int64_t count = starts[v + 1] - starts[v], used = 0;
        if (has_seam[v] != 0 && has_seam[v] != 1) {
            return damaged_rows(call, track,
                                "the flag of a vertex with several rows is neither 0 nor 1");
        }
        for (int64_t k = 0; k < count; k++) {
            rows->of_corners[corners[k]] = (int32_t)v;
        }
        if (has_seam[v]) {
            used = assign_rows(corners, count, codes + n_read, (int64_t)n_codes - n_read, rows);
        }
        if (used < 0) {
            return damaged_rows(call, track, "the row code of a corner is out of range");
        }
        n_read += used;
    }
    return n_read == (int64_t)n_codes
               ? MESHREEL_OK
               : damaged_rows(call, track, "there are more row codes than corners at seams");
}

/* Find the output vertex of each row. */
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

/* ---- graphs ---- */

/* Edges between items, as degenerate faces whose last corner is repeated. */
typedef struct {
    int32_t *faces;
    uint64_t count;
} edge_list;

static void add_edge(edge_list *all, int32_t first_item, int32_t second_item) {
    int32_t *face = all->faces + 3 * all->count++;
    face[0] = first_item;
    face[1] = face[2] = second_item;
}

static uint64_t side_after(uint64_t side) { return side % 3 == 2 ? side - 2 : side + 1; }

/* Connect the corners at both ends of an edge with those of its twin; with rows, those rows that
   differ. */
static void join_corners(edge_list *all, const uint32_t *triangles, const fans *of, uint64_t side,
                         uint64_t twin, const int32_t *rows) {
    bool is_opposite = triangles[side] == triangles[side_after(twin)];
    uint64_t first = is_opposite ? side_after(twin) : twin;
    uint64_t second = is_opposite ? twin : side_after(twin);
    int32_t ends[2][2] = {{of->corners[side], of->corners[first]},
                          {of->corners[side_after(side)], of->corners[second]}};
    for (int k = 0; k < 2; k++) {
        int32_t first_item = rows ? rows[ends[k][0]] : ends[k][0];
        int32_t second_item = rows ? rows[ends[k][1]] : ends[k][1];
        if (!rows || first_item != second_item) {
            add_edge(all, first_item, second_item);
        }
    }
}

/* Build the graph of faces, of corners, or of rows of corners. */
static int find_graph(reel_call *call, reel_pool *pool, const reel_outline *outline,
                      const reel_mesh_data *mesh, const fans *of, uint32_t domain,
                      const int32_t *rows, uint64_t n_items, reel_graph *graph) {
    uint64_t n_faces = outline->n_faces;
    edge_list all = {reel_scratch(call, 3 * 6 * n_faces, sizeof *all.faces), 0};
    int32_t *twins;
    REEL_NEED(all.faces);
    REEL_TRY(reel_find_twins(call, &call->scratch, (const int32_t *)mesh->triangles, n_faces,
                             outline->n_verts, &twins));
    for (uint64_t side = 0; side < 3 * n_faces; side++) {
        uint64_t twin = (uint64_t)twins[side];
        if (domain == MESHREEL_CORNERS && !rows) {
            add_edge(&all, of->corners[side], of->corners[side_after(side)]);
        } else if (rows && side % 3 == 0) {
            int32_t *face = all.faces + 3 * all.count++;
            for (int k = 0; k < 3; k++) {
                face[k] = rows[of->corners[side + (uint64_t)k]];
            }
        }
        if (twin <= side) {
            continue;
        }
        if (domain == MESHREEL_FACES) {
            add_edge(&all, of->polygons[side / 3], of->polygons[twin / 3]);
        } else {
            join_corners(&all, mesh->triangles, of, side, twin, rows);
        }
    }
    return reel_find_neighbors(call, pool, all.faces, all.count, (uint32_t)n_items, graph);
}

int reel_find_items(reel_call *call, reel_pool *pool, const reel_outline *outline,
                    const reel_mesh_data *mesh, const uint32_t *face_sizes, const reel_track *track,
                    reel_items *items) {
    uint32_t domain = track->info.domain;
    *items =
        (reel_items){.graph = mesh->graph, .order = mesh->to_internal, .inverse = mesh->to_output};
    if (domain == MESHREEL_VERTICES) {
        return MESHREEL_OK;
    }
    fans of;
    int32_t *vertices = NULL;
    corner_rows rows = {NULL, 0};
    REEL_TRY(find_fans(call, pool, outline, face_sizes, &of));
    if (domain == MESHREEL_CORNERS) {
        vertices = reel_pool_allocate(call, pool, of.n_corners, sizeof *vertices);
        REEL_NEED(vertices);
        reel_find_corner_vertices(outline, mesh->triangles, face_sizes, vertices);
        items->vertex = vertices;
        items->value_of = track->sharing == REEL_OF_VERTICES ? vertices : NULL;
    }
    if (track->sharing == REEL_OF_VERTICES) {
        items->vertex = NULL;
        return MESHREEL_OK;
    }
    items->order = items->inverse = NULL;
    items->polygon = of.polygons;
    uint64_t n_items = domain == MESHREEL_FACES ? of.n_polygons : of.n_corners;
    if (track->sharing == REEL_OF_ROWS) {
        REEL_TRY(read_rows(call, pool, outline, track, vertices, mesh->to_internal, &rows));
        REEL_TRY(find_row_vertices(call, pool, &rows, mesh, outline->n_verts, of.n_corners,
                                   vertices, &items->vertex));
        items->value_of = rows.of_corners;
        n_items = rows.n_rows;
    }
    return find_graph(call, pool, outline, mesh, &of, domain, rows.of_corners, n_items,
                      &items->graph);
}
