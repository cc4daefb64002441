/* Coding orders of fields: docs/format.md, "Passes by vertices" and "Passes by times". */

#include "field_mesh.h"

#define SMOOTH_ROW (REEL_SMOOTH_FIELDS * sizeof(float))

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

int reel_prepare_hierarchy(reel_call *call, reel_pool *pool, const reel_graph *graph,
                           int64_t stencil_size, reel_hierarchy_job **result) {
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
    job->smooth = reel_pool_allocate(call, pool, (REEL_SMOOTH_ROWS - 1) * n, SMOOTH_ROW);
    field_mesh->items = reel_pool_allocate(call, pool, n, sizeof *field_mesh->items);
    job->resolutions = reel_scratch(call, REEL_MAX_LEVELS, sizeof *job->resolutions);
    job->memory_size = reel_hierarchy_memory((int64_t)n, graph->starts[n]);
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
                   job->smooth_starts && job->stencil && job->hops && job->smooth &&
                   job->resolutions && job->memory;
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
                                 job->stencil, job->hops, field_mesh->order.near, job->smooth, 0);
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

int reel_copy_hierarchy(reel_call *call, reel_pool *pool, const reel_field_mesh *mesh,
                        reel_field_mesh **copy) {
    *copy = reel_pool_allocate(call, pool, 1, sizeof **copy);
    float *smooth = reel_pool_allocate(call, pool, (uint64_t)mesh->mesh.n_verts, SMOOTH_ROW);
    REEL_NEED(*copy && smooth);
    **copy = *mesh;
    (*copy)->finest_smooth = smooth;
    (*copy)->mesh.finest_smooth = smooth;
    return MESHREEL_OK;
}

/* ---- times ---- */

#define N_LEVELS 3
#define MAX_PASSES 4
#define MAX_NEAR 6
#define COLUMNS_BEFORE 2

/* Per level: its first time, the distance of its times, and the distance of their known
   neighbors. */
static const int64_t first_times[N_LEVELS] = {0, 2, 1}, time_strides[N_LEVELS] = {4, 4, 2},
                     known_distances[N_LEVELS] = {2, 2, 1};

/* Add a time of a column with its context neighbors: `near` in the same column (-1: none), and the
   same time in the columns before. */
static void add_time(reel_coding_order *order, int64_t n_frames, int64_t column, int64_t time,
                     const int64_t *near, int n_near) {
    int64_t position = order->pass_starts[order->n_passes]++, count = order->near_starts[position];
    order->columns[position] = (int32_t)(column * n_frames + time);
    for (int k = 0; k < n_near; k++) {
        if (near[k] >= 0) {
            order->near[count++] = (int32_t)(column * n_frames + near[k]);
        }
    }
    for (int64_t before = column - COLUMNS_BEFORE; before < column; before++) {
        if (before >= 0) {
            order->near[count++] = (int32_t)(before * n_frames + time);
        }
    }
    order->near_starts[position + 1] = count;
}

static void begin_pass(reel_coding_order *order) {
    order->pass_starts[order->n_passes + 1] = order->pass_starts[order->n_passes];
    order->n_passes++;
}

/* Add a level of the moving times, for all columns. */
static void add_level(reel_coding_order *order, int level, int64_t n_columns, int64_t n_frames,
                      const int32_t *moving, int64_t n_moving) {
    int64_t known = known_distances[level];
    for (int64_t column = 0; column < n_columns; column++) {
        for (int64_t i = first_times[level]; i < n_moving; i += time_strides[level]) {
            const int64_t positions[] = {i - known, i + known, i - 2 * known, i - 4 * known};
            int64_t near[4];
            for (int k = 0; k < 4; k++) { /* the first level has no neighbors on both sides */
                bool is_known = (level || k >= 2) && positions[k] >= 0 && positions[k] < n_moving;
                near[k] = is_known ? moving[positions[k]] : -1;
            }
            add_time(order, n_frames, column, moving[i], near, 4);
        }
    }
}

static void add_resting(reel_coding_order *order, int64_t n_columns, int64_t n_frames,
                        const uint8_t *rests) {
    for (int64_t column = 0; column < n_columns; column++) {
        for (int64_t time = 1; time < n_frames; time++) {
            const int64_t near[] = {rests[time - 1] ? time - 1 : -1,
                                    time > 1 && rests[time - 2] ? time - 2 : -1};
            if (rests[time]) {
                add_time(order, n_frames, column, time, near, 2);
            }
        }
    }
}

/* Add all frequencies as one pass; lower ones are context neighbors. */
static void add_frequencies(reel_coding_order *order, int64_t n_columns, int64_t n_frames) {
    for (int64_t column = 0; column < n_columns; column++) {
        for (int64_t k = 0; k < n_frames; k++) {
            const int64_t near[] = {k - 1, k - 2, k - 3, k - 4};
            add_time(order, n_frames, column, k, near, 4);
        }
    }
}

int reel_find_time_order(reel_call *call, int64_t n_columns, int64_t n_frames, bool has_cosines,
                         const uint8_t *rests, reel_coding_order *result) {
    uint64_t n = (uint64_t)(n_columns * n_frames);
    result->columns = reel_scratch(call, n, sizeof *result->columns);
    result->near_starts = reel_scratch(call, n + 1, sizeof *result->near_starts);
    result->pass_starts = reel_scratch(call, MAX_PASSES + 1, sizeof *result->pass_starts);
    result->near = reel_scratch(call, n * MAX_NEAR, sizeof *result->near);
    int32_t *moving = reel_scratch(call, (uint64_t)n_frames, sizeof *moving);
    REEL_NEED(result->columns && result->near_starts && result->pass_starts);
    REEL_NEED(result->near && moving);
    int64_t n_moving = 0;
    for (int64_t time = 0; time < n_frames; time++) {
        if (!rests || !rests[time]) {
            moving[n_moving++] = (int32_t)time;
        }
    }
    result->n_columns = (int64_t)n;
    result->n_passes = 0;
    result->pass_starts[0] = result->near_starts[0] = 0;
    if (has_cosines) {
        begin_pass(result);
        add_frequencies(result, n_columns, n_frames);
        return MESHREEL_OK;
    }
    for (int level = 0; level < N_LEVELS; level++) {
        begin_pass(result);
        add_level(result, level, n_columns, n_frames, moving, n_moving);
    }
    if (rests) {
        begin_pass(result);
        add_resting(result, n_columns, n_frames, rests);
    }
    return MESHREEL_OK;
}
