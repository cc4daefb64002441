/* The hierarchy of a mesh: resolutions from coarse to fine, and levels of mutually independent
   vertices in each.

   docs/format.md, "Resolutions". All is integer arithmetic on connectivity. Time and memory are
   linear in vertices and edges for any mesh: no resolution is larger than the next finer one.
   Stencils are computed in stencils.c. */

#include "adjacency.h"
#include "smooth.h"
#include "stencils.h"

/* Levels of a resolution; the last takes all remaining vertices. */
#define N_LEVELS (REEL_STATES - 1)

#define UNASSIGNED 8U /* state UNASSIGNED + n: not in a level after n thinnings */

/* Working memory; resolutions are processed from fine to coarse. */
typedef struct {
    reel_graph graph;
    int32_t *members;     /* mesh vertex of each vertex of the graph, ascending */
    int32_t *by_rank;     /* vertices of the graph by descending rank */
    uint8_t *states;      /* level of each vertex: 0 if the coarser resolution keeps it */
    uint8_t *is_midpoint; /* whether each vertex of the finest resolution splits an edge */
    int32_t *cells;       /* vertex of the coarser graph whose cell contains each vertex */
    int32_t *starts[2];   /* adjacency of coarser graphs, double buffered */
    int32_t *near[2];
    reel_adjacency_builder builder;
    reel_stencil_finder finder;
    reel_smoother smoother;
} workspace;

/* Results of all resolutions, filled from the end because the finest is computed first. */
typedef struct {
    int32_t *order;
    int32_t *stencil;
    uint8_t *hops;
    int32_t *contexts;
    float *smooth; /* smooth fields of the members of each resolution, finest first; or NULL */
    int64_t n_rows;
    int32_t size;
    int32_t n_levels;
    int32_t counts[REEL_MAX_LEVELS]; /* sizes of levels, last level first */
    int32_t resolutions[REEL_MAX_LEVELS];
} hierarchy_results;

/* Sort vertices 0 .. n - 1 by descending hash: a bucket sort by the highest bits, then an insertion
   sort, as buckets are small. */
static void rank_vertices(int32_t n, int32_t *by_rank, int32_t *ends) {
    int shift = 63 - reel_bit_length((uint32_t)n >> 2); /* n + 1 buckets suffice */
    reel_zero(ends, ((size_t)n + 1) * sizeof *ends);
    for (int32_t v = 0; v < n; v++) {
        ends[~reel_hash((uint64_t)v) >> shift]++;
    }
    reel_prefix_sum(ends, n);
    for (int32_t v = n - 1; v >= 0; v--) {
        by_rank[--ends[~reel_hash((uint64_t)v) >> shift]] = v;
    }
    for (int32_t i = 1; i < n; i++) {
        int32_t v = by_rank[i], place = i;
        uint64_t hash = reel_hash((uint64_t)v);
        for (; place > 0 && reel_hash((uint64_t)by_rank[place - 1]) < hash; place--) {
            by_rank[place] = by_rank[place - 1];
        }
        by_rank[place] = v;
    }
}

/* Whether a vertex has at least three neighbors, all with only two neighbors: likely midpoints. */
static bool has_split_edges(const reel_graph *graph, int32_t v) {
    bool result = reel_degree(graph, v) > 2;
    for (int32_t i = graph->starts[v]; result && i < graph->starts[v + 1]; i++) {
        result = reel_degree(graph, graph->near[i]) == 2;
    }
    return result;
}

/* Find the vertices in the middle of an edge, such as the mid-edge nodes of quadratic cells. They
   rank after all others, so that coarser resolutions prefer the ends. */
static void find_midpoints(workspace *work) {
    const reel_graph *graph = &work->graph;
    uint8_t *has_split = work->states;
    for (int32_t v = 0; v < graph->n; v++) {
        has_split[v] = has_split_edges(graph, v);
    }
    for (int32_t v = 0; v < graph->n; v++) {
        const int32_t *ends = graph->near + graph->starts[v];
        work->is_midpoint[v] =
            reel_degree(graph, v) == 2 && has_split[ends[0]] && has_split[ends[1]];
    }
    int32_t n_others = 0, n_midpoints = 0, *midpoints = work->cells;
    for (int32_t i = 0; i < graph->n; i++) {
        int32_t v = work->by_rank[i];
        if (work->is_midpoint[v]) {
            midpoints[n_midpoints++] = v;
        } else {
            work->by_rank[n_others++] = v;
        }
    }
    reel_copy(work->by_rank + n_others, midpoints, (size_t)n_midpoints * sizeof *midpoints);
}

/* Select a maximal independent set of the vertices in state `unassigned`, greedily by descending
   rank. Its members get the state `level`, the others `unassigned` + 1. */
static void thin(workspace *work, uint8_t unassigned, uint8_t level) {
    const reel_graph *graph = &work->graph;
    uint8_t *states = work->states;
    for (int32_t i = 0; i < graph->n; i++) {
        int32_t v = work->by_rank[i];
        if (states[v] != unassigned) {
            continue;
        }
        states[v] = level;
        for (int32_t k = graph->starts[v]; k < graph->starts[v + 1]; k++) {
            uint8_t *state = &states[graph->near[k]];
            *state = (uint8_t)(*state + (*state == unassigned));
        }
    }
}

/* Assign levels: 0 is kept for the coarser resolution, 1 .. N_LEVELS are predicted. */
static void assign_levels(workspace *work) {
    for (int32_t v = 0; v < work->graph.n; v++) {
        work->states[v] = UNASSIGNED;
    }
    for (uint8_t level = 0; level < N_LEVELS; level++) {
        thin(work, (uint8_t)(UNASSIGNED + level), level);
    }
    for (int32_t v = 0; v < work->graph.n; v++) {
        if (work->states[v] >= UNASSIGNED) {
            work->states[v] = N_LEVELS;
        }
    }
}

/* List the vertices of the levels of a resolution, level by level, starting at `begin`. */
static void list_levels(workspace *work, hierarchy_results *results, int32_t begin,
                        int32_t resolution) {
    int32_t ends[N_LEVELS + 1] = {0}, *order = results->order;
    for (int32_t v = 0; v < work->graph.n; v++) {
        ends[work->states[v]]++;
    }
    for (int level = N_LEVELS; level > 0; level--) {
        if (ends[level]) {
            results->counts[results->n_levels] = ends[level];
            results->resolutions[results->n_levels++] = resolution;
        }
    }
    ends[0] = begin;
    for (int level = 1; level <= N_LEVELS; level++) {
        int32_t count = ends[level];
        ends[level] = begin;
        begin += count;
    }
    for (int32_t v = 0; v < work->graph.n; v++) {
        if (work->states[v]) {
            order[ends[work->states[v]]++] = v;
        }
    }
}

/* List the context neighbors of a vertex: lower neighbors in its level, then its stencil. */
static void list_contexts(const workspace *work, int32_t v, const int32_t *stencil, int32_t size,
                          int32_t *contexts) {
    const reel_graph *graph = &work->graph;
    int32_t count = 0;
    for (int32_t i = graph->starts[v]; i < graph->starts[v + 1] && count < REEL_CONTEXT_NEIGHBORS;
         i++) {
        int32_t u = graph->near[i];
        if (u < v && work->states[u] == work->states[v]) {
            contexts[count++] = u;
        }
    }
    for (int32_t j = 0; j < size && stencil[j] >= 0 && count < REEL_CONTEXT_NEIGHBORS; j++) {
        contexts[count++] = stencil[j];
    }
    while (count < REEL_CONTEXT_NEIGHBORS) {
        contexts[count++] = -1;
    }
}

static void to_mesh_vertices(const workspace *work, int32_t *vertices, size_t count) {
    for (size_t i = 0; i < count; i++) {
        vertices[i] = vertices[i] < 0 ? -1 : work->members[vertices[i]];
    }
}

/* Find the stencils and contexts of order[begin .. end - 1], as vertices of the mesh. */
static void find_stencils(workspace *work, hierarchy_results *results, int32_t begin, int32_t end) {
    size_t size = (size_t)results->size, n = (size_t)(end - begin);
    int32_t *order = results->order + begin, *stencil = results->stencil + (size_t)begin * size;
    int32_t *contexts = results->contexts + (size_t)begin * REEL_CONTEXT_NEIGHBORS;
    bool is_finest = !results->n_rows;
    reel_find_stencils(&work->finder, &work->graph, work->states,
                       is_finest ? work->is_midpoint : NULL, order, end - begin, results->size,
                       stencil, results->hops + (size_t)begin * size);
    for (size_t i = 0; i < n; i++) {
        list_contexts(work, order[i], stencil + i * size, results->size,
                      contexts + i * REEL_CONTEXT_NEIGHBORS);
    }
    to_mesh_vertices(work, stencil, n * size);
    to_mesh_vertices(work, contexts, n * REEL_CONTEXT_NEIGHBORS);
}

/* Assign each vertex to a cell of the coarser resolution: a kept vertex to its own, others to that
   of their highest kept neighbor. Reduce members and ranks to the kept vertices, and return their
   number. */
static int32_t assign_cells(workspace *work) {
    const reel_graph *graph = &work->graph;
    int32_t n_kept = 0, *cells = work->cells;
    for (int32_t v = 0; v < graph->n; v++) {
        if (!work->states[v]) {
            work->members[n_kept] = work->members[v];
            cells[v] = n_kept++;
        }
    }
    for (int32_t v = 0; v < graph->n; v++) {
        if (work->states[v]) {
            int32_t last = graph->starts[v + 1] - 1; /* exists: the independent set is maximal */
            while (work->states[graph->near[last]]) {
                last--;
            }
            cells[v] = cells[graph->near[last]];
        }
    }
    int32_t n_ranked = 0;
    for (int32_t i = 0; i < graph->n; i++) {
        int32_t v = work->by_rank[i];
        work->by_rank[n_ranked] = cells[v]; /* overwritten next unless v is kept */
        n_ranked += !work->states[v];
    }
    return n_kept;
}

/* Replace the graph by that of the kept vertices: two are connected if an edge of the finer graph
   connects their cells. */
static void coarsen(workspace *work, int buffer) {
    const reel_graph *graph = &work->graph;
    int32_t n_kept = assign_cells(work), n_edges = 0;
    int32_t *starts = work->starts[buffer], *near = work->near[buffer];
    for (int32_t v = 0; v < graph->n; v++) {
        int32_t cell = work->cells[v];
        for (int32_t i = graph->starts[v]; i < graph->starts[v + 1]; i++) {
            int32_t u = graph->near[i], other_cell = work->cells[u];
            if (u > v && cell != other_cell) {
                near[2 * n_edges] = cell < other_cell ? cell : other_cell;
                near[2 * n_edges + 1] = cell < other_cell ? other_cell : cell;
                n_edges++;
            }
        }
    }
    reel_build_adjacency(&work->builder, n_kept, n_edges, starts, near);
    work->graph = (reel_graph){n_kept, starts, near};
}

/* Add the coarsest resolution: all its vertices form one level without prediction. */
static void add_coarsest(workspace *work, hierarchy_results *results, int32_t resolution) {
    size_t n = (size_t)work->graph.n, n_entries = n * (size_t)results->size;
    reel_copy(results->order, work->members, n * sizeof *results->order);
    __builtin_memset(results->stencil, 0xFF, n_entries * sizeof *results->stencil);
    reel_zero(results->hops, n_entries);
    reel_zero(work->states, n);
    for (int32_t v = 0; v < work->graph.n; v++) {
        list_contexts(work, v, NULL, 0, results->contexts + v * REEL_CONTEXT_NEIGHBORS);
    }
    to_mesh_vertices(work, results->contexts, n * REEL_CONTEXT_NEIGHBORS);
    results->counts[results->n_levels] = work->graph.n;
    results->resolutions[results->n_levels++] = resolution;
}

static void build(workspace *work, hierarchy_results *results) {
    int32_t end = work->graph.n, resolution = 0;
    int64_t max_rows = (int64_t)REEL_SMOOTH_ROWS * end;
    for (; work->graph.starts[work->graph.n] && resolution < REEL_MAX_RESOLUTIONS &&
           results->n_rows + work->graph.n <= max_rows;
         resolution++) {
        assign_levels(work);
        int32_t n_kept = 0;
        for (int32_t v = 0; v < work->graph.n; v++) {
            n_kept += !work->states[v];
        }
        list_levels(work, results, n_kept, resolution);
        find_stencils(work, results, n_kept, end);
        if (results->smooth) {
            reel_smooth(&work->smoother, &work->graph,
                        results->smooth + results->n_rows * REEL_SMOOTH_FIELDS);
        }
        to_mesh_vertices(work, results->order + n_kept, (size_t)(end - n_kept));
        results->n_rows += work->graph.n;
        coarsen(work, resolution & 1);
        end = n_kept;
    }
    add_coarsest(work, results, resolution);
}

static workspace allocate_workspace(reel_arena *arena, size_t n, size_t n_near, bool has_smooth) {
    workspace result = {
        .members = reel_allocate(arena, n + 1, sizeof(int32_t)),
        .by_rank = reel_allocate(arena, n + 1, sizeof(int32_t)),
        .states = reel_allocate(arena, n, 1),
        .is_midpoint = reel_allocate(arena, n, 1),
        .cells = reel_allocate(arena, n + 1, sizeof(int32_t)),
        .starts = {reel_allocate(arena, n + 1, sizeof(int32_t)),
                   reel_allocate(arena, n + 1, sizeof(int32_t))},
        .near = {reel_allocate(arena, n_near, sizeof(int32_t)),
                 reel_allocate(arena, n_near, sizeof(int32_t))},
        .builder = reel_allocate_adjacency_builder(arena, n, n_near / 2),
        .finder = reel_allocate_stencil_finder(arena, n, n_near),
    };
    if (has_smooth) {
        result.smoother = reel_allocate_smoother(arena, n, n_near);
    }
    return result;
}

size_t reel_hierarchy_memory(int64_t n_verts, int64_t n_near, int64_t has_smooth) {
    size_t n = (size_t)n_verts, row = REEL_SMOOTH_FIELDS * sizeof(float);
    reel_arena arena = REEL_MEASURE;
    allocate_workspace(&arena, n, (size_t)n_near, has_smooth != 0);
    return arena.used + (has_smooth ? reel_array_bytes(REEL_SMOOTH_ROWS * n, row) : 0);
}

/* Write the levels, coarsest first, and where the smooth fields of each resolution begin. Levels
   were listed in reverse. */
static int32_t write_levels(const hierarchy_results *results, int32_t *starts, int32_t *resolutions,
                            int64_t *smooth_starts) {
    int32_t n = results->n_levels, coarsest = results->resolutions[n - 1];
    int64_t row = 0;
    starts[0] = 0;
    for (int32_t i = 0; i < n; i++) {
        starts[i + 1] = starts[i] + results->counts[n - 1 - i];
        resolutions[i] = coarsest - results->resolutions[n - 1 - i];
    }
    for (int32_t i = 0; i < n; i++) {
        smooth_starts[i] = row;
        if (resolutions[i] > 0 && (i + 1 == n || resolutions[i + 1] != resolutions[i])) {
            row += starts[i + 1]; /* all vertices of this and coarser resolutions */
        }
    }
    return n;
}

/* Renumber the vertices in stencils and contexts in coding order. */
static void renumber_stencils(const hierarchy_results *results, int32_t n, const int32_t *numbers) {
    for (size_t i = 0; i < (size_t)n * (size_t)results->size; i++) {
        results->stencil[i] = results->stencil[i] < 0 ? -1 : numbers[results->stencil[i]];
    }
    for (size_t i = 0; i < (size_t)n * REEL_CONTEXT_NEIGHBORS; i++) {
        results->contexts[i] = results->contexts[i] < 0 ? -1 : numbers[results->contexts[i]];
    }
}

/* Copy the rows of smooth fields, in coding order. */
static void reorder_smooth(const hierarchy_results *results, int32_t n, int32_t n_levels,
                           const int32_t *starts, const int32_t *resolutions,
                           const int64_t *smooth_starts, const int32_t *numbers, float *smooth) {
    const size_t size = REEL_SMOOTH_FIELDS * sizeof *smooth;
    const float *row = results->smooth;
    for (int32_t i = n_levels - 1; i >= 0; i--) {
        bool is_last = i + 1 == n_levels || resolutions[i + 1] != resolutions[i];
        if (!is_last || !resolutions[i]) {
            continue;
        }
        for (int32_t v = 0; v < n; v++) {
            if (numbers[v] < starts[i + 1]) {
                reel_copy(smooth + (smooth_starts[i] + numbers[v]) * REEL_SMOOTH_FIELDS, row, size);
                row += REEL_SMOOTH_FIELDS;
            }
        }
    }
}

int64_t reel_hierarchy(void *memory, size_t memory_size, const int32_t *starts,
                       const int32_t *near, int64_t n_verts, int64_t stencil_size, int32_t *order,
                       int32_t *level_starts, int32_t *level_resolutions, int64_t *smooth_starts,
                       int32_t *stencil, uint8_t *hops, int32_t *contexts, float *smooth) {
    if (stencil_size < 1 || stencil_size > REEL_MAX_STENCIL || n_verts < 0 ||
        n_verts >= 1 << REEL_VERTEX_BITS) {
        return reel_failure(REEL_INVALID, 0);
    }
    size_t n = (size_t)n_verts;
    reel_arena arena = reel_arena_of(memory, memory_size);
    workspace work = allocate_workspace(&arena, n, (size_t)starts[n], smooth != NULL);
    float *rows = NULL;
    if (smooth) {
        rows = reel_allocate(&arena, REEL_SMOOTH_ROWS * n, REEL_SMOOTH_FIELDS * sizeof(float));
    }
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    work.graph = (reel_graph){(int32_t)n, starts, near};
    for (int32_t v = 0; v < (int32_t)n; v++) {
        work.members[v] = v;
    }
    rank_vertices((int32_t)n, work.by_rank, work.cells);
    find_midpoints(&work);
    hierarchy_results results = {.order = order,
                                 .stencil = stencil,
                                 .hops = hops,
                                 .contexts = contexts,
                                 .smooth = rows,
                                 .size = (int32_t)stencil_size};
    build(&work, &results);
    int32_t n_levels = write_levels(&results, level_starts, level_resolutions, smooth_starts);
    int32_t *numbers = work.members;
    for (int32_t i = 0; i < (int32_t)n; i++) {
        numbers[order[i]] = i;
    }
    renumber_stencils(&results, (int32_t)n, numbers);
    if (smooth) {
        reorder_smooth(&results, (int32_t)n, n_levels, level_starts, level_resolutions,
                       smooth_starts, numbers, smooth);
    }
    return n_levels;
}
