/* Coding orders of fields: docs/format.md, "Passes by vertices" and "Passes by times". */

#include "field_mesh.h"

struct reel_hierarchy_job {
    reel_field_mesh *field_mesh;
    int32_t *level_starts, *resolutions, *stencil;
    int64_t *smooth_starts;
    uint8_t *hops;
    float *smooth;
    void *memory;
    size_t memory_size;
    int64_t result;
};

int reel_reserve_hierarchy(reel_call *call, uint64_t n_items, int64_t stencil_size) {
    uint64_t smooth_bytes = REEL_SMOOTH_ROWS * REEL_SMOOTH_FIELDS * sizeof(float);
    uint64_t order_bytes = (3 + REEL_CONTEXT_NEIGHBORS) * sizeof(int32_t) + sizeof(int64_t);
    uint64_t stencil_bytes = (uint64_t)stencil_size * (sizeof(int32_t) + 1);
    REEL_TRY(reel_reserve(call, n_items, smooth_bytes + order_bytes + stencil_bytes));
    return reel_reserve(call, reel_hierarchy_memory((int64_t)n_items, 0, true), 1);
}

int reel_prepare_hierarchy(reel_call *call, reel_pool *pool, const reel_graph *graph,
                           int64_t stencil_size, bool has_smooth, reel_hierarchy_job **result) {
    uint64_t n = graph->n_items;
    reel_hierarchy_job *job = reel_scratch(call, 1, sizeof *job);
    reel_field_mesh *field_mesh = reel_pool_allocate(call, pool, 1, sizeof *field_mesh);
    REEL_NEED(job && field_mesh);
    *result = job;
    *job = (reel_hierarchy_job){.field_mesh = field_mesh};
    *field_mesh = (reel_field_mesh){.graph = graph};
    reel_coding_order *order = &field_mesh->order;
    order->n_columns = (int64_t)n;
    order->columns = reel_pool_allocate(call, pool, n, sizeof *order->columns);
    order->near_starts = reel_pool_allocate(call, pool, n + 1, sizeof *order->near_starts);
    order->near = reel_pool_allocate(call, pool, n * REEL_CONTEXT_NEIGHBORS, sizeof *order->near);
    order->pass_starts =
        reel_pool_allocate(call, pool, REEL_MAX_LEVELS + 1, sizeof *order->pass_starts);
    field_mesh->positions = reel_pool_allocate(call, pool, n, sizeof *field_mesh->positions);
    job->level_starts =
        reel_pool_allocate(call, pool, REEL_MAX_LEVELS + 1, sizeof *job->level_starts);
    job->smooth_starts =
        reel_pool_allocate(call, pool, REEL_MAX_LEVELS, sizeof *job->smooth_starts);
    job->stencil = reel_pool_allocate(call, pool, n * (uint64_t)stencil_size, sizeof *job->stencil);
    job->hops = reel_pool_allocate(call, pool, n * (uint64_t)stencil_size, 1);
    if (has_smooth) {
        job->smooth = reel_pool_allocate(call, pool, REEL_SMOOTH_ROWS * n,
                                         REEL_SMOOTH_FIELDS * sizeof *job->smooth);
    }
    field_mesh->items = reel_pool_allocate(call, pool, n, sizeof *field_mesh->items);
    job->resolutions = reel_scratch(call, REEL_MAX_LEVELS, sizeof *job->resolutions);
    job->memory_size = reel_hierarchy_memory((int64_t)n, graph->starts[n], has_smooth);
    job->memory = reel_scratch(call, job->memory_size, 1);
    field_mesh->mesh = (reel_mesh){.n_verts = (int64_t)n,
                                   .stencil_size = stencil_size,
                                   .level_starts = job->level_starts,
                                   .smooth_starts = job->smooth_starts,
                                   .stencil = job->stencil,
                                   .hops = job->hops,
                                   .smooth = job->smooth};
    bool has_all = order->columns && order->near_starts && order->near && order->pass_starts &&
                   field_mesh->positions && field_mesh->items && job->level_starts &&
                   job->smooth_starts && job->stencil && job->hops &&
                   (job->smooth || !has_smooth) && job->resolutions && job->memory;
    return has_all ? MESHREEL_OK : call->error.code;
}

/* Find the passes: one per resolution. */
static void find_passes(reel_coding_order *order, const int32_t *level_starts,
                        const int32_t *resolutions, int64_t n_levels) {
    order->n_passes = 0;
    order->pass_starts[0] = 0;
    for (int64_t i = 0; i < n_levels; i++) {
        if (i + 1 == n_levels || resolutions[i + 1] != resolutions[i]) {
            order->pass_starts[++order->n_passes] = level_starts[i + 1];
        }
    }
}

/* Remove the padding of the rows of context neighbors. */
static void pack_rows(reel_coding_order *order) {
    int64_t count = 0;
    for (int64_t i = 0; i < order->n_columns; i++) {
        const int32_t *row = order->near + i * REEL_CONTEXT_NEIGHBORS;
        order->near_starts[i] = count;
        for (int k = 0; k < REEL_CONTEXT_NEIGHBORS && row[k] >= 0; k++) {
            order->near[count++] = row[k];
        }
        order->columns[i] = (int32_t)i;
    }
    order->near_starts[order->n_columns] = count;
}

void reel_find_hierarchy(reel_hierarchy_job *job) {
    reel_field_mesh *field_mesh = job->field_mesh;
    const reel_graph *graph = field_mesh->graph;
    int64_t n = graph->n_items;
    job->result = reel_hierarchy(job->memory, job->memory_size, graph->starts, graph->near, n,
                                 field_mesh->mesh.stencil_size, field_mesh->items,
                                 job->level_starts, job->resolutions, job->smooth_starts,
                                 job->stencil, job->hops, field_mesh->order.near, job->smooth);
    if (job->result < 0) {
        return;
    }
    field_mesh->mesh.n_levels = job->result;
    find_passes(&field_mesh->order, job->level_starts, job->resolutions, job->result);
    pack_rows(&field_mesh->order);
    for (int64_t position = 0; position < n; position++) {
        field_mesh->positions[field_mesh->items[position]] = (int32_t)position;
    }
}

int reel_finish_hierarchy(reel_call *call, const reel_hierarchy_job *job,
                          const reel_field_mesh **output) {
    *output = job->field_mesh;
    return reel_fail_core(call, job->result, 0, "the hierarchy of the mesh is too large");
}

int reel_find_time_order(reel_call *call, int64_t n_columns, int64_t n_frames, bool has_cosines,
                         const uint8_t *rests, reel_coding_order *result) {
    uint64_t n = (uint64_t)(n_columns * n_frames);
    size_t memory_size = reel_time_order_memory(n_frames);
    void *memory = reel_scratch(call, memory_size, 1);
    result->n_columns = (int64_t)n;
    result->columns = reel_scratch(call, n, sizeof *result->columns);
    result->near_starts = reel_scratch(call, n + 1, sizeof *result->near_starts);
    result->pass_starts =
        reel_scratch(call, REEL_MAX_TIME_PASSES + 1, sizeof *result->pass_starts);
    result->near = reel_scratch(call, n * REEL_MAX_NEAR_TIMES, sizeof *result->near);
    REEL_NEED(memory && result->columns && result->near_starts);
    REEL_NEED(result->pass_starts && result->near);
    result->n_passes =
        reel_time_order(memory, memory_size, n_columns, n_frames, has_cosines, rests,
                        result->columns, result->pass_starts, result->near_starts, result->near);
    return reel_fail_core(call, result->n_passes, 0, "the first time of a block rests");
}
