/* A mesh as an edit of another one: docs/format.md, EDIT. */

#include "edit.h"

enum { KEPT, DROPPED, INSERTED, N_COUNTS };

/* The coded edit: rows of counts for vertices and for faces, and the corners of new faces. */
typedef struct {
    uint64_t n_steps[2];    /* of vertices and of faces */
    const int32_t *rows[2]; /* N_COUNTS rows of n_steps each */
    uint64_t n_inserted;    /* faces */
    const int32_t *corners; /* differences, 3 per inserted face */
} mesh_edit;

/* Items of the base mesh and of the edited one. */
typedef struct {
    int32_t *to_new;    /* new number of each item of the base, or -1 */
    int32_t *from_base; /* number in the base of each new item, or -1 */
    uint64_t n_base, n_new;
} item_map;

static int fail(reel_call *call, uint64_t offset) {
    return reel_corrupt(call, offset, "the edit does not fit its mesh");
}

static int read_edit(reel_call *call, const reel_outline *outline, mesh_edit *edit) {
    reel_range input = outline->edit;
    uint64_t n_base, limits[3] = {outline->coded_verts + outline->n_verts,
                                  outline->coded_faces + outline->n_faces, outline->n_faces};
    uint64_t *numbers[3] = {&edit->n_steps[0], &edit->n_steps[1], &edit->n_inserted};
    REEL_TRY(reel_read_varint(call, &input, &n_base));
    REEL_TRY(reel_read_varint(call, &input, &n_base));
    for (int i = 0; i < 3; i++) {
        REEL_TRY(reel_read_varint(call, &input, numbers[i]));
        if (*numbers[i] > limits[i]) {
            return fail(call, outline->edit.offset);
        }
    }
    int64_t lengths[2 * N_COUNTS + 1];
    int32_t tables[2 * N_COUNTS + 1], *values;
    for (int i = 0; i < 2 * N_COUNTS; i++) {
        lengths[i] = (int64_t)edit->n_steps[i / N_COUNTS];
        tables[i] = i;
    }
    lengths[2 * N_COUNTS] = 3 * (int64_t)edit->n_inserted;
    tables[2 * N_COUNTS] = 2 * N_COUNTS;
    REEL_TRY(reel_decode_rows(call, input, lengths, tables, 2 * N_COUNTS + 1, 2 * N_COUNTS + 1,
                              &values));
    edit->rows[0] = values;
    edit->rows[1] = values + N_COUNTS * edit->n_steps[0];
    edit->corners = edit->rows[1] + N_COUNTS * edit->n_steps[1];
    return MESHREEL_OK;
}

/* Map the items of the base to the new ones; false if the counts do not fit. */
static bool fill_map(const mesh_edit *edit, int kind, item_map *map) {
    const int32_t *rows = edit->rows[kind];
    uint64_t n_steps = edit->n_steps[kind], base = 0, item = 0;
    for (uint64_t i = 0; i <= n_steps; i++) {
        uint64_t counts[N_COUNTS] = {map->n_base - base}; /* at the end, all others are kept */
        for (int k = 0; i < n_steps && k < N_COUNTS; k++) {
            int32_t count = rows[(uint64_t)k * n_steps + i];
            if (count < 0) {
                return false;
            }
            counts[k] = (uint64_t)count;
        }
        if (counts[KEPT] + counts[DROPPED] > map->n_base - base ||
            counts[KEPT] + counts[INSERTED] > map->n_new - item) {
            return false;
        }
        for (uint64_t k = 0; k < counts[KEPT]; k++) {
            map->from_base[item] = (int32_t)base;
            map->to_new[base++] = (int32_t)item++;
        }
        for (uint64_t k = 0; k < counts[DROPPED]; k++) {
            map->to_new[base++] = -1;
        }
        for (uint64_t k = 0; k < counts[INSERTED]; k++) {
            map->from_base[item++] = -1;
        }
    }
    return item == map->n_new;
}

static int map_items(reel_call *call, const mesh_edit *edit, int kind, uint64_t offset,
                     item_map *map) {
    map->to_new = reel_scratch(call, map->n_base, sizeof *map->to_new);
    map->from_base = reel_scratch(call, map->n_new, sizeof *map->from_base);
    REEL_NEED(map->to_new && map->from_base);
    return fill_map(edit, kind, map) ? MESHREEL_OK : fail(call, offset);
}

/* Number the vertices: those of the base in its internal order, then the new ones. */
static void number_vertices(const reel_mesh_data *base, const item_map *verts,
                            reel_mesh_data *mesh) {
    int32_t next = 0;
    for (uint64_t i = 0; i < verts->n_base; i++) {
        int32_t new_vertex = verts->to_new[base->to_output[i]];
        if (new_vertex >= 0) {
            mesh->to_output[next++] = new_vertex;
        }
    }
    for (uint64_t i = 0; i < verts->n_new; i++) {
        if (verts->from_base[i] < 0) {
            mesh->to_output[next++] = (int32_t)i;
        }
    }
    for (uint64_t i = 0; i < verts->n_new; i++) {
        mesh->to_internal[mesh->to_output[i]] = (int32_t)i;
    }
}

/* List the output triangles; false if one has a vertex that does not exist. */
static bool list_triangles(const mesh_edit *edit, const reel_mesh_data *base, const item_map *verts,
                           const item_map *faces, uint32_t *triangles) {
    const int32_t *differences = edit->corners;
    const int32_t *end = differences + 3 * edit->n_inserted;
    int64_t last = 0;
    for (uint64_t i = 0; i < faces->n_new; i++) {
        int32_t base_face = faces->from_base[i];
        if (base_face < 0 && differences == end) {
            return false;
        }
        for (int k = 0; k < 3; k++) {
            int64_t vertex = base_face < 0
                                 ? (last += *differences++)
                                 : verts->to_new[base->triangles[3 * (int64_t)base_face + k]];
            if (vertex < 0 || vertex >= (int64_t)verts->n_new) {
                return false;
            }
            triangles[3 * i + (uint64_t)k] = (uint32_t)vertex;
        }
    }
    return differences == end;
}

/* List the internal faces: those of the base in its internal order, then the new ones. `corners`
   are the first corners of the base's output faces, or NULL if these are in internal order. */
static int list_internal(reel_call *call, const reel_mesh_data *base, const int32_t *corners,
                         const item_map *verts, const item_map *faces, reel_mesh_data *mesh) {
    int32_t *numbers = reel_scratch(call, faces->n_base, sizeof *numbers);
    REEL_NEED(numbers);
    for (uint64_t i = 0; i < faces->n_base; i++) {
        numbers[corners ? corners[i] / 3 : (int32_t)i] = faces->to_new[i];
    }
    int32_t *next = mesh->internal_faces;
    for (uint64_t i = 0; i < 3 * faces->n_base; i++) {
        if (numbers[i / 3] >= 0) {
            int32_t vertex = base->to_output[base->internal_faces[i]];
            *next++ = mesh->to_internal[verts->to_new[vertex]];
        }
    }
    for (uint64_t i = 0; i < 3 * faces->n_new; i++) {
        if (faces->from_base[i / 3] < 0) {
            *next++ = mesh->to_internal[mesh->triangles[i]];
        }
    }
    return MESHREEL_OK;
}

static int apply_edit(reel_call *call, const reel_outline *outline, const reel_mesh_data *base,
                      const int32_t *corners, reel_mesh_data *mesh) {
    mesh_edit edit;
    item_map verts = {.n_base = outline->coded_verts, .n_new = outline->n_verts};
    item_map faces = {.n_base = outline->coded_faces, .n_new = outline->n_faces};
    REEL_TRY(read_edit(call, outline, &edit));
    REEL_TRY(map_items(call, &edit, 0, outline->edit.offset, &verts));
    REEL_TRY(map_items(call, &edit, 1, outline->edit.offset, &faces));
    number_vertices(base, &verts, mesh);
    return list_triangles(&edit, base, &verts, &faces, mesh->triangles)
               ? list_internal(call, base, corners, &verts, &faces, mesh)
               : fail(call, outline->edit.offset);
}

int reel_read_edited_mesh(reel_call *call, reel_pool *pool, const reel_outline *outline,
                          reel_mesh_data *mesh) {
    const reel_chunk *mark = call->scratch.last;
    reel_outline base_outline = *outline;
    reel_mesh_data base = {0};
    reel_order_job *order;
    base_outline.n_verts = outline->coded_verts;
    base_outline.n_faces = outline->coded_faces;
    mesh->internal_faces = reel_pool_allocate(call, pool, 3 * outline->n_faces, sizeof(int32_t));
    mesh->triangles = reel_pool_allocate(call, pool, 3 * outline->n_faces, sizeof(uint32_t));
    mesh->to_internal = reel_pool_allocate(call, pool, outline->n_verts, sizeof(int32_t));
    mesh->to_output = reel_pool_allocate(call, pool, outline->n_verts, sizeof(int32_t));
    REEL_NEED(mesh->internal_faces && mesh->triangles && mesh->to_internal && mesh->to_output);
    REEL_TRY(reel_decode_connectivity(call, &call->scratch, &base_outline, &base));
    REEL_TRY(reel_prepare_order(call, &call->scratch, &base_outline, &base, &order));
    reel_decode_order(order);
    REEL_TRY(reel_finish_order(call, order));
    REEL_TRY(apply_edit(call, outline, &base, reel_order_corners(order), mesh));
    reel_drop_scratch(call, mark);
    return reel_may_be_on_grid(outline)
               ? reel_find_twins(call, pool, mesh->internal_faces, outline->n_faces,
                                 outline->n_verts, &mesh->twins)
               : MESHREEL_OK;
}
