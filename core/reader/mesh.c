/* The triangles of a file, and the order of its vertices: docs/format.md, CONNECTIVITY, ORDER. */

#include "mesh.h"

#define VERTICES_ONLY 1
#define VERTICES_AND_FACES 2

int reel_find_neighbors(reel_call *call, reel_pool *pool, const int32_t *faces, uint64_t n_faces,
                        uint32_t n_items, reel_graph *graph) {
    int32_t *starts = reel_pool_allocate(call, pool, (uint64_t)n_items + 1, sizeof *starts);
    int32_t *near = reel_pool_allocate(call, pool, 6 * n_faces, sizeof *near);
    const reel_chunk *mark = call->scratch.last;
    size_t memory_size = reel_adjacency_memory(n_items, (int64_t)n_faces);
    void *memory = reel_scratch(call, memory_size, 1);
    REEL_NEED(starts && near && memory);
    int64_t result =
        reel_adjacency(memory, memory_size, faces, (int64_t)n_faces, n_items, starts, near);
    reel_drop_scratch(call, mark);
    *graph = (reel_graph){n_items, starts, near};
    return reel_fail_core(call, result, 0, "a face has a vertex that does not exist");
}

int reel_find_twins(reel_call *call, reel_pool *pool, const int32_t *faces, uint64_t n_faces,
                    uint64_t n_verts, int32_t **twins) {
    *twins = reel_pool_allocate(call, pool, 3 * n_faces, sizeof **twins);
    const reel_chunk *mark = call->scratch.last;
    size_t memory_size = reel_twins_memory((int64_t)n_verts, (int64_t)n_faces);
    void *memory = reel_scratch(call, memory_size, 1);
    REEL_NEED(*twins && memory);
    int64_t result =
        reel_twins(memory, memory_size, faces, (int64_t)n_faces, (int64_t)n_verts, *twins);
    reel_drop_scratch(call, mark);
    return reel_fail_core(call, result, 0, "a face has a vertex that does not exist");
}

int reel_decode_connectivity(reel_call *call, reel_pool *pool, const reel_outline *outline,
                             reel_mesh_data *mesh) {
    int64_t n_verts = (int64_t)outline->n_verts, n_faces = (int64_t)outline->n_faces;
    reel_range data;
    REEL_CORRUPT_IF(reel_count_sections(outline, REEL_CONNECTIVITY, &data) != 1, outline->begin,
                    "there is not exactly one section CONNECTIVITY");
    mesh->internal_faces = reel_pool_allocate(call, pool, 3 * outline->n_faces, sizeof(int32_t));
    bool may_be_on_grid = reel_may_be_on_grid(outline);
    if (may_be_on_grid) {
        mesh->twins = reel_pool_allocate(call, pool, 3 * outline->n_faces, sizeof(int32_t));
    }
    const reel_chunk *mark = call->scratch.last;
    size_t memory_size = reel_connectivity_decode_memory(n_verts, n_faces);
    void *memory = reel_scratch(call, memory_size, 1);
    const uint8_t *bytes;
    if (!mesh->internal_faces || (may_be_on_grid && !mesh->twins) || !memory) {
        return call->error.code;
    }
    REEL_TRY(reel_view(call, data, &bytes));
    int64_t result = reel_connectivity_decode(memory, memory_size, bytes, (size_t)data.length,
                                              n_verts, n_faces, mesh->internal_faces, mesh->twins);
    reel_drop_scratch(call, mark);
    return reel_fail_core(call, result, data.offset, "the connectivity is damaged");
}

struct reel_order_job {
    const reel_outline *outline;
    reel_mesh_data *mesh;
    const uint8_t *bytes; /* payload of the section, or NULL: output in internal order */
    size_t size;
    uint64_t offset;
    bool with_faces;
    int32_t *twins, *corners;
    void *twins_memory, *order_memory;
    size_t twins_size, order_size;
    int64_t result;
};

static int view_order(reel_call *call, const reel_outline *outline, reel_order_job *job) {
    reel_range data = {0, 0};
    if (outline->order == REEL_ORDER_DROPPED) {
        return MESHREEL_OK;
    }
    REEL_CORRUPT_IF(reel_count_sections(outline, REEL_ORDER, &data) != 1, outline->begin,
                    "there is not exactly one section ORDER");
    if (!data.length) {
        return MESHREEL_OK;
    }
    REEL_TRY(reel_view(call, data, &job->bytes));
    job->size = (size_t)data.length;
    job->offset = data.offset;
    job->with_faces = job->bytes[0] == VERTICES_AND_FACES;
    REEL_CORRUPT_IF(!job->with_faces && job->bytes[0] != VERTICES_ONLY, data.offset,
                    "the order begins with neither 1 nor 2");
    return data.length == 1 || job->bytes[data.length - 1]
               ? MESHREEL_OK
               : reel_corrupt(call, data.offset + data.length - 1,
                              "the order ends with a zero byte");
}

int reel_prepare_order(reel_call *call, reel_pool *pool, const reel_outline *outline,
                       reel_mesh_data *mesh, reel_order_job **result) {
    int64_t n_verts = (int64_t)outline->n_verts, n_faces = (int64_t)outline->n_faces;
    reel_order_job *job = reel_scratch(call, 1, sizeof *job);
    mesh->to_internal = reel_pool_allocate(call, pool, outline->n_verts, sizeof(int32_t));
    mesh->to_output = reel_pool_allocate(call, pool, outline->n_verts, sizeof(int32_t));
    mesh->triangles = reel_pool_allocate(call, pool, 3 * outline->n_faces, sizeof(uint32_t));
    REEL_NEED(job && mesh->to_internal && mesh->to_output && mesh->triangles);
    *job = (reel_order_job){.outline = outline, .mesh = mesh};
    *result = job;
    REEL_TRY(view_order(call, outline, job));
    if (!job->bytes) {
        return MESHREEL_OK;
    }
    job->order_size = reel_order_memory(n_verts, n_faces);
    job->order_memory = reel_scratch(call, job->order_size, 1);
    if (job->with_faces) {
        job->twins_size = reel_twins_memory(n_verts, n_faces);
        job->twins_memory = reel_scratch(call, job->twins_size, 1);
        job->twins = reel_scratch(call, 3 * outline->n_faces, sizeof *job->twins);
        job->corners = reel_scratch(call, outline->n_faces, sizeof *job->corners);
    }
    bool has_memory = job->order_memory &&
                      (!job->with_faces || (job->twins_memory && job->twins && job->corners));
    return has_memory ? MESHREEL_OK : call->error.code;
}

/* Write the output triangles, which start at `corners`, by default at the first of each. */
static void list_faces(int64_t n_faces, const int32_t *faces, const int32_t *to_output,
                       const int32_t *corners, uint32_t *triangles) {
    if (!corners) {
        for (int64_t i = 0; i < 3 * n_faces; i++) {
            triangles[i] = (uint32_t)to_output[faces[i]];
        }
        return;
    }
    for (int64_t i = 0; i < n_faces; i++) {
        int64_t face = corners[i] / 3 * 3, first = corners[i] % 3;
        for (int64_t k = 0; k < 3; k++) {
            triangles[3 * i + k] = (uint32_t)to_output[faces[face + (first + k) % 3]];
        }
    }
}

void reel_decode_order(reel_order_job *job) {
    reel_mesh_data *mesh = job->mesh;
    int64_t n_verts = (int64_t)job->outline->n_verts, n_faces = (int64_t)job->outline->n_faces;
    const int32_t *faces = mesh->internal_faces;
    for (int32_t v = 0; v < n_verts && !job->bytes; v++) {
        mesh->to_internal[v] = v;
    }
    if (job->with_faces) {
        job->result =
            reel_twins(job->twins_memory, job->twins_size, faces, n_faces, n_verts, job->twins);
    }
    if (job->bytes && job->result >= 0) {
        job->result = reel_order_decode(job->order_memory, job->order_size, job->bytes + 1,
                                        job->size - 1, faces, job->twins, n_verts, n_faces,
                                        job->with_faces, job->corners, mesh->to_internal);
    }
    if (job->result < 0) {
        return;
    }
    for (int32_t v = 0; v < n_verts; v++) {
        mesh->to_output[mesh->to_internal[v]] = v;
    }
    list_faces(n_faces, faces, mesh->to_output, job->corners, mesh->triangles);
}

const int32_t *reel_order_corners(const reel_order_job *job) { return job->corners; }

int reel_finish_order(reel_call *call, const reel_order_job *job) {
    return reel_fail_core(call, job->result, job->offset, "the order of vertices is damaged");
}
