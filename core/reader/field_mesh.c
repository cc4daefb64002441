/* In which order fields are coded over the mesh: docs/format.md, "Passes by vertices". */

#include "field_mesh.h"

#define SMOOTH_ROW (REEL_SMOOTH_FIELDS * sizeof(float))

size_t reel_field_mesh_room(int64_t n_verts, int64_t stencil_size) {
    size_t n = (size_t)n_verts, size = (size_t)stencil_size;
    return reel_room(1, sizeof(reel_field_mesh)) + 2 * reel_room(n, sizeof(int32_t)) +
           reel_room(n + 1, sizeof(int64_t)) + reel_room(n * REEL_NEIGHBOURS, sizeof(int32_t)) +
           reel_room(REEL_MAX_LEVELS + 1, sizeof(int64_t)) +
           reel_room(REEL_MAX_LEVELS + 1, sizeof(int32_t)) +
           reel_room(REEL_MAX_LEVELS, sizeof(int64_t)) + reel_room(n * size, sizeof(int32_t)) +
           reel_room(n * size, 1) + reel_room(REEL_SMOOTH_ROWS * n, SMOOTH_ROW);
}

size_t reel_field_mesh_scratch(int64_t n_verts, int64_t n_near) {
    return reel_room((size_t)n_verts, sizeof(int32_t)) +
           reel_room(REEL_MAX_LEVELS, sizeof(int32_t)) +
           reel_room(reel_hierarchy_memory(n_verts, n_near), 1);
}

/* A pass ends with each resolution. */
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

/* Moves the rows of context neighbours, filled up with -1, to one another. */
static void join_rows(reel_coding_order *order) {
    int64_t count = 0;
    for (int64_t i = 0; i < order->n_columns; i++) {
        const int32_t *row = order->near + i * REEL_NEIGHBOURS;
        order->near_starts[i] = count;
        for (int k = 0; k < REEL_NEIGHBOURS && row[k] >= 0; k++) {
            order->near[count++] = row[k];
        }
        order->columns[i] = (int32_t)i;
    }
    order->near_starts[order->n_columns] = count;
}

int64_t reel_find_field_mesh(reel_arena *arena, reel_arena scratch, const reel_neighbours *graph,
                             int64_t stencil_size, const int32_t *sequence,
                             reel_field_mesh **found) {
    size_t n = (size_t)graph->n_verts, size = (size_t)stencil_size;
    reel_field_mesh *own = *found = reel_take(arena, 1, sizeof *own);
    int32_t *columns = reel_take(arena, n, sizeof *columns);
    int32_t *rows = reel_take(arena, n, sizeof *rows);
    int64_t *near_starts = reel_take(arena, n + 1, sizeof *near_starts);
    int32_t *near = reel_take(arena, n * REEL_NEIGHBOURS, sizeof *near);
    int64_t *pass_starts = reel_take(arena, REEL_MAX_LEVELS + 1, sizeof *pass_starts);
    int32_t *level_starts = reel_take(arena, REEL_MAX_LEVELS + 1, sizeof *level_starts);
    int64_t *smooth_starts = reel_take(arena, REEL_MAX_LEVELS, sizeof *smooth_starts);
    int32_t *stencil = reel_take(arena, n * size, sizeof *stencil);
    uint8_t *hops = reel_take(arena, n * size, 1);
    float *smooth = reel_take(arena, REEL_SMOOTH_ROWS * n, SMOOTH_ROW);
    int32_t *order = reel_take(&scratch, n, sizeof *order);
    int32_t *resolutions = reel_take(&scratch, REEL_MAX_LEVELS, sizeof *resolutions);
    size_t needed = reel_hierarchy_memory(graph->n_verts, graph->starts[n]);
    void *memory = reel_take(&scratch, needed, 1);
    if (arena->failed || scratch.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    int64_t n_levels = reel_hierarchy(memory, needed, graph->starts, graph->near, graph->n_verts,
                                      stencil_size, order, level_starts, resolutions,
                                      smooth_starts, stencil, hops, near, smooth);
    if (n_levels < 0) {
        return n_levels;
    }
    own->mesh = (reel_mesh){graph->n_verts, n_levels, stencil_size, level_starts, smooth_starts,
                            stencil, hops, smooth};
    own->order = (reel_coding_order){.n_columns = graph->n_verts, .columns = columns, .near = near,
                                     .pass_starts = pass_starts, .near_starts = near_starts};
    find_passes(&own->order, level_starts, resolutions, n_levels);
    join_rows(&own->order);
    own->rows = rows;
    for (size_t place = 0; place < n; place++) { /* `columns` has its own numbers behind this */
        columns[order[place]] = (int32_t)place;
    }
    for (size_t v = 0; v < n; v++) {
        rows[v] = columns[sequence[v]];
    }
    for (size_t i = 0; i < n; i++) {
        columns[i] = (int32_t)i;
    }
    return 0;
}
