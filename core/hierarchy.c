/* Vertices of a mesh in levels, each near those of earlier ones: one resolution after another.

   docs/format.md, "Resolutions". All is integer arithmetic on connectivity. Time and memory are
   linear in vertices and edges, whatever the mesh: a resolution is never larger than the one
   before. Stencils are found in stencils.c. */

#include "adjacency.h"
#include "smooth.h"
#include "stencils.h"

/* Levels of a resolution: the last takes what the others leave. */
#define N_COLOURS (REEL_STATES - 1)

#define LEFT 8U /* states from here on: not yet in a level, after so many thinnings */

/* What one resolution after another is worked on with. */
typedef struct {
    reel_graph graph;
    int32_t *members; /* vertices of the graph, ascending */
    int32_t *ranked;  /* vertices of the graph by falling rank */
    uint8_t *states;  /* level of each: 0 if the coarser resolution has it, too */
    int32_t *cells;   /* which vertex of the coarser graph each belongs to */
    int32_t *starts[2]; /* of coarser graphs, in turn */
    int32_t *near[2];
    reel_joiner joiner;
    reel_searcher searcher;
    reel_smoother smoother;
} workshop;

/* Of all resolutions: rows are filled from the end, as the finest is found first. */
typedef struct {
    int32_t *order;
    int32_t *stencil; /* or NULL, then without hops and contexts */
    uint8_t *hops;
    int32_t *contexts;
    float *smooth; /* or NULL; rows of the members of each resolution, as they are found */
    int64_t n_rows;
    int32_t size;
    int32_t n_levels;
    int32_t counts[REEL_MAX_LEVELS]; /* of levels, the last one first */
    int32_t resolutions[REEL_MAX_LEVELS];
} result;

/* The vertices 0 .. n - 1 by falling hash: by its highest bits, then each where it belongs among
   those that share them, which are few. */
static void rank_vertices(int32_t n, int32_t *ranked, int32_t *ends) {
    int shift = 63 - reel_length((uint32_t)n >> 2); /* n + 1 are enough */
    reel_zero(ends, ((size_t)n + 1) * sizeof *ends);
    for (int32_t v = 0; v < n; v++) {
        ends[~reel_scattered((uint64_t)v) >> shift]++;
    }
    for (int32_t i = 0; i < n; i++) {
        ends[i + 1] += ends[i];
    }
    for (int32_t v = n - 1; v >= 0; v--) {
        ranked[--ends[~reel_scattered((uint64_t)v) >> shift]] = v;
    }
    for (int32_t i = 1; i < n; i++) {
        int32_t v = ranked[i], place = i;
        uint64_t hash = reel_scattered((uint64_t)v);
        for (; place > 0 && reel_scattered((uint64_t)ranked[place - 1]) < hash; place--) {
            ranked[place] = ranked[place - 1];
        }
        ranked[place] = v;
    }
}

/* Takes the highest among those left, and none next to one that is taken, as many as fit: they get
   the state `colour`, the others among those left the next state. */
static void thin(workshop *shop, uint8_t left, uint8_t colour) {
    const reel_graph *graph = &shop->graph;
    uint8_t *states = shop->states;
    for (int32_t i = 0; i < graph->n; i++) {
        int32_t v = shop->ranked[i];
        if (states[v] != left) {
            continue;
        }
        states[v] = colour;
        for (int32_t k = graph->starts[v]; k < graph->starts[v + 1]; k++) {
            uint8_t *state = &states[graph->near[k]];
            *state = (uint8_t)(*state + (*state == left));
        }
    }
}

/* States to levels: 0 is kept, 1 .. N_COLOURS are predicted. */
static void colour(workshop *shop) {
    for (int32_t v = 0; v < shop->graph.n; v++) {
        shop->states[v] = LEFT;
    }
    for (uint8_t level = 0; level < N_COLOURS; level++) {
        thin(shop, (uint8_t)(LEFT + level), level);
    }
    for (int32_t v = 0; v < shop->graph.n; v++) {
        if (shop->states[v] >= LEFT) {
            shop->states[v] = N_COLOURS;
        }
    }
}

/* The vertices of the levels of a resolution, level after level, from `begin` on. */
static void list_levels(workshop *shop, result *all, int32_t begin, int32_t resolution) {
    int32_t ends[N_COLOURS + 1] = {0}, *order = all->order;
    for (int32_t v = 0; v < shop->graph.n; v++) {
        ends[shop->states[v]]++;
    }
    for (int level = N_COLOURS; level > 0; level--) {
        if (ends[level]) {
            all->counts[all->n_levels] = ends[level];
            all->resolutions[all->n_levels++] = resolution;
        }
    }
    ends[0] = begin;
    for (int level = 1; level <= N_COLOURS; level++) {
        int32_t count = ends[level];
        ends[level] = begin;
        begin += count;
    }
    for (int32_t v = 0; v < shop->graph.n; v++) {
        if (shop->states[v]) {
            order[ends[shop->states[v]]++] = v;
        }
    }
}

/* Context neighbours of a row: lower vertices of its level next to it, then its stencil. */
static void list_contexts(const workshop *shop, int32_t v, const int32_t *stencil, int32_t size,
                          int32_t *contexts) {
    const reel_graph *graph = &shop->graph;
    int32_t count = 0;
    for (int32_t i = graph->starts[v]; i < graph->starts[v + 1] && count < REEL_NEIGHBOURS; i++) {
        int32_t u = graph->near[i];
        if (u < v && shop->states[u] == shop->states[v]) {
            contexts[count++] = u;
        }
    }
    for (int32_t j = 0; j < size && stencil[j] >= 0 && count < REEL_NEIGHBOURS; j++) {
        contexts[count++] = stencil[j];
    }
    while (count < REEL_NEIGHBOURS) {
        contexts[count++] = -1;
    }
}

/* Places in the graph become vertices of the mesh. */
static void name_members(const workshop *shop, int32_t *places, size_t count) {
    for (size_t i = 0; i < count; i++) {
        places[i] = places[i] < 0 ? -1 : shop->members[places[i]];
    }
}

/* Stencils of the rows begin .. end - 1; their vertices become the mesh's. */
static void predict_rows(workshop *shop, result *all, int32_t begin, int32_t end) {
    size_t size = (size_t)all->size, n = (size_t)(end - begin);
    int32_t *order = all->order + begin, *stencil = all->stencil + (size_t)begin * size;
    int32_t *contexts = all->contexts + (size_t)begin * REEL_NEIGHBOURS;
    reel_find_stencils(&shop->searcher, &shop->graph, shop->states, order, end - begin, all->size,
                       stencil, all->hops + (size_t)begin * size);
    for (size_t i = 0; i < n; i++) {
        list_contexts(shop, order[i], stencil + i * size, all->size,
                      contexts + i * REEL_NEIGHBOURS);
    }
    name_members(shop, stencil, n * size);
    name_members(shop, contexts, n * REEL_NEIGHBOURS);
}

/* Cells of the coarser resolution: of what is kept, its place there; of all else that
   of the highest kept neighbour. Members and ranks become those of what is kept. */
static int32_t part_into_cells(workshop *shop) {
    const reel_graph *graph = &shop->graph;
    int32_t n_kept = 0, *cells = shop->cells;
    for (int32_t v = 0; v < graph->n; v++) {
        if (!shop->states[v]) {
            shop->members[n_kept] = shop->members[v];
            cells[v] = n_kept++;
        }
    }
    for (int32_t v = 0; v < graph->n; v++) {
        if (shop->states[v]) {
            int32_t last = graph->starts[v + 1] - 1; /* one is kept: as many are as fit */
            while (shop->states[graph->near[last]]) {
                last--;
            }
            cells[v] = cells[graph->near[last]];
        }
    }
    int32_t n_ranked = 0;
    for (int32_t i = 0; i < graph->n; i++) {
        int32_t v = shop->ranked[i];
        shop->ranked[n_ranked] = cells[v]; /* stays if it is kept */
        n_ranked += !shop->states[v];
    }
    return n_kept;
}

/* Makes the graph of what is kept the one to work on: cells are next to each other along edges. */
static void coarsen(workshop *shop, int turn) {
    const reel_graph *graph = &shop->graph;
    int32_t n_kept = part_into_cells(shop), pairs = 0;
    int32_t *starts = shop->starts[turn], *near = shop->near[turn];
    for (int32_t v = 0; v < graph->n; v++) {
        int32_t own = shop->cells[v];
        for (int32_t i = graph->starts[v]; i < graph->starts[v + 1]; i++) {
            int32_t u = graph->near[i], other = shop->cells[u];
            if (u > v && own != other) {
                near[2 * pairs] = own < other ? own : other;
                near[2 * pairs + 1] = own < other ? other : own;
                pairs++;
            }
        }
    }
    reel_join(&shop->joiner, n_kept, pairs, starts, near);
    shop->graph = (reel_graph){n_kept, starts, near};
}

/* The coarsest resolution: all its vertices are a level that nothing predicts. */
static void end_with(workshop *shop, result *all, int32_t resolution) {
    size_t n = (size_t)shop->graph.n, filled = n * (size_t)all->size;
    reel_copy(all->order, shop->members, n * sizeof *all->order);
    if (all->stencil) {
        __builtin_memset(all->stencil, 0xFF, filled * sizeof *all->stencil);
        reel_zero(all->hops, filled);
        reel_zero(shop->states, n);
        for (int32_t v = 0; v < shop->graph.n; v++) {
            list_contexts(shop, v, NULL, 0, all->contexts + v * REEL_NEIGHBOURS);
        }
        name_members(shop, all->contexts, n * REEL_NEIGHBOURS);
    }
    all->counts[all->n_levels] = shop->graph.n;
    all->resolutions[all->n_levels++] = resolution;
}

static void build(workshop *shop, result *all) {
    int32_t end = shop->graph.n, resolution = 0;
    int64_t most = (int64_t)REEL_SMOOTH_ROWS * end;
    for (; shop->graph.starts[shop->graph.n] && resolution < REEL_MAX_RESOLUTIONS &&
           all->n_rows + shop->graph.n <= most; resolution++) {
        colour(shop);
        int32_t n_kept = 0;
        for (int32_t v = 0; v < shop->graph.n; v++) {
            n_kept += !shop->states[v];
        }
        list_levels(shop, all, n_kept, resolution);
        if (all->stencil) {
            predict_rows(shop, all, n_kept, end);
        }
        if (all->smooth) {
            float *rows = all->smooth + all->n_rows * REEL_SMOOTH_FIELDS;
            reel_smooth(&shop->smoother, &shop->graph, rows);
        }
        name_members(shop, all->order + n_kept, (size_t)(end - n_kept));
        all->n_rows += shop->graph.n;
        coarsen(shop, resolution & 1);
        end = n_kept;
    }
    end_with(shop, all, resolution);
}

static size_t shop_room(size_t n, size_t n_near) {
    return 5 * reel_room(n + 1, sizeof(int32_t)) + reel_room(n, 1) +
           2 * reel_room(n_near, sizeof(int32_t)) +
           reel_joiner_room(n, n_near / 2) + reel_searcher_room(n, n_near) + reel_smoother_room(n, n_near);
}

static workshop open_shop(reel_arena *arena, size_t n, size_t n_near) {
    return (workshop){
        .members = reel_take(arena, n + 1, sizeof(int32_t)),
        .ranked = reel_take(arena, n + 1, sizeof(int32_t)),
        .states = reel_take(arena, n, 1),
        .cells = reel_take(arena, n + 1, sizeof(int32_t)),
        .starts = {reel_take(arena, n + 1, sizeof(int32_t)),
                   reel_take(arena, n + 1, sizeof(int32_t))},
        .near = {reel_take(arena, n_near, sizeof(int32_t)),
                 reel_take(arena, n_near, sizeof(int32_t))},
        .joiner = reel_take_joiner(arena, n, n_near / 2),
        .searcher = reel_take_searcher(arena, n, n_near),
        .smoother = reel_take_smoother(arena, n, n_near),
    };
}

size_t reel_hierarchy_memory(int64_t n_verts, int64_t n_near) {
    size_t n = (size_t)n_verts, row = REEL_SMOOTH_FIELDS * sizeof(float);
    return shop_room(n, (size_t)n_near) + reel_room(REEL_SMOOTH_ROWS * n, row);
}

/* Levels were listed from the last one. Rows of smooth fields go from the coarsest on. */
static int32_t write_levels(const result *all, int32_t *starts, int32_t *resolutions,
                            int64_t *smooth_starts) {
    int32_t n = all->n_levels, coarsest = all->resolutions[n - 1];
    int64_t row = 0;
    starts[0] = 0;
    for (int32_t i = 0; i < n; i++) {
        starts[i + 1] = starts[i] + all->counts[n - 1 - i];
        resolutions[i] = coarsest - all->resolutions[n - 1 - i];
    }
    for (int32_t i = 0; i < n; i++) {
        smooth_starts[i] = row;
        if (resolutions[i] > 0 && (i + 1 == n || resolutions[i + 1] != resolutions[i])) {
            row += starts[i + 1]; /* all vertices of this resolution, and of coarser ones */
        }
    }
    return n;
}

/* The vertices of stencils and contexts become places in coding order. */
static void number_stencils(const result *all, int32_t n, const int32_t *numbers) {
    for (size_t i = 0; i < (size_t)n * (size_t)all->size; i++) {
        all->stencil[i] = all->stencil[i] < 0 ? -1 : numbers[all->stencil[i]];
    }
    for (size_t i = 0; i < (size_t)n * REEL_NEIGHBOURS; i++) {
        all->contexts[i] = all->contexts[i] < 0 ? -1 : numbers[all->contexts[i]];
    }
}

/* Rows of smooth fields get their places in coding order. */
static void place_smooth(const result *all, int32_t n, int32_t n_levels, const int32_t *starts,
                         const int32_t *resolutions, const int64_t *smooth_starts,
                         const int32_t *numbers, float *smooth) {
    const size_t size = REEL_SMOOTH_FIELDS * sizeof *smooth;
    const float *row = all->smooth;
    for (int32_t i = n_levels - 1; i >= 0; i--) {
        bool is_last = i + 1 == n_levels || resolutions[i + 1] != resolutions[i];
        for (int32_t v = 0; is_last && resolutions[i] > 0 && v < n; v++) {
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
        n_verts >= 1 << REEL_PLACE_BITS) {
        return reel_failure(REEL_INVALID, 0);
    }
    size_t n = (size_t)n_verts;
    reel_arena arena = reel_arena_of(memory, memory_size);
    workshop shop = open_shop(&arena, n, (size_t)starts[n]);
    float *rows = reel_take(&arena, REEL_SMOOTH_ROWS * n, REEL_SMOOTH_FIELDS * sizeof(float));
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    shop.graph = (reel_graph){(int32_t)n, starts, near};
    for (int32_t v = 0; v < (int32_t)n; v++) {
        shop.members[v] = v;
    }
    rank_vertices((int32_t)n, shop.ranked, shop.cells);
    result all = {.order = order, .stencil = stencil, .hops = hops, .contexts = contexts,
                  .smooth = smooth ? rows : NULL, .size = (int32_t)stencil_size};
    build(&shop, &all);
    int32_t n_levels = write_levels(&all, level_starts, level_resolutions, smooth_starts);
    int32_t *numbers = shop.members;
    for (int32_t i = 0; i < (int32_t)n; i++) {
        numbers[order[i]] = i;
    }
    if (stencil) {
        number_stencils(&all, (int32_t)n, numbers);
    }
    if (smooth) {
        place_smooth(&all, (int32_t)n, n_levels, level_starts, level_resolutions, smooth_starts,
                     numbers, smooth);
    }
    return n_levels;
}
