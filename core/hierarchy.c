/* Vertices of a mesh in levels, each near those of earlier ones, and the stencils between them.

   docs/format.md, "Resolutions" and "Stencils". All is integer arithmetic on connectivity. Time and
   memory are linear in vertices and edges, whatever the mesh: stencils do not reach through hubs,
   and a resolution is never larger than the one before. */

#include "adjacency.h"
#include "smooth.h"

#define N_COLOURS 3        /* levels of a resolution: the last takes what the others leave */
#define REACH 3            /* how far a stencil reaches, in edges of its resolution */
#define LARGEST_PASSAGE 24 /* stencils do not lead through vertices with more neighbours */
#define LEFT 8U            /* states from here on: not yet in a level, after so many thinnings */

#define FEW 48             /* numbers that are sorted without branches */
#define MOST_PATHS 15      /* more do not make a vertex nearer */
#define PLACE_BITS 27      /* of a vertex in a key that sorts by paths first */

typedef int32_t four __attribute__((vector_size(16), aligned(4), may_alias));

/* What one resolution after another is worked on with. */
typedef struct {
    reel_graph graph;
    int32_t *members; /* vertices of the graph, ascending */
    uint64_t *hashes; /* of the members; a higher one goes first */
    uint8_t *states;  /* level of each: 0 if the coarser resolution has it, too */
    int32_t *pending; /* thinning: higher neighbours that are still to be decided on; then ends */
    int32_t *marks;   /* stencils: the last search that came by, and its ring; else cells */
    int32_t *paths;   /* shortest paths by which this search came by */
    int32_t *queue;   /* vertices to go on from */
    int32_t *next;
    int32_t *found;
    int32_t *starts[2]; /* of coarser graphs, in turn */
    int32_t *near[2];
    reel_joiner joiner;
    reel_smoother smoother;
} workshop;

/* Of all resolutions: rows are filled from the end, as the finest is found first. */
typedef struct {
    int32_t *order;
    int32_t *stencil;
    uint8_t *hops;
    int32_t *contexts;
    float *smooth; /* rows of the members of each resolution, as they are found */
    int64_t n_rows;
    int32_t size;
    int32_t n_levels;
    int32_t counts[REEL_MAX_LEVELS]; /* of levels, the last one first */
    int32_t resolutions[REEL_MAX_LEVELS];
} result;

/* Takes the highest among those left, and none next to one that is taken, as many as fit: they get
   the state `colour`, the others among those left the next state. Ranks decide, not their order:
   a vertex is taken once no higher neighbour can be. */
static void thin(workshop *shop, uint8_t left, uint8_t colour) {
    const reel_graph *graph = &shop->graph;
    uint8_t *states = shop->states, passed = (uint8_t)(left + 1);
    const uint64_t *hashes = shop->hashes;
    int32_t waiting = 0;
    for (int32_t v = 0; v < graph->n; v++) {
        if (states[v] != left) {
            continue;
        }
        int32_t higher = 0;
        for (int32_t i = graph->starts[v]; i < graph->starts[v + 1]; i++) {
            int32_t u = graph->near[i];
            higher += (states[u] == left) & (hashes[u] > hashes[v]);
        }
        shop->pending[v] = higher;
        if (!higher) {
            shop->queue[waiting++] = v;
        }
    }
    while (waiting) {
        int32_t v = shop->queue[--waiting];
        states[v] = colour;
        for (int32_t i = graph->starts[v]; i < graph->starts[v + 1]; i++) {
            int32_t u = graph->near[i];
            if (states[u] != left) {
                continue;
            }
            states[u] = passed;
            for (int32_t k = graph->starts[u]; k < graph->starts[u + 1]; k++) {
                int32_t w = graph->near[k];
                if (states[w] == left && hashes[w] < hashes[u] && !--shop->pending[w]) {
                    shop->queue[waiting++] = w;
                }
            }
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

/* Rows of neighbours by state, then by number: those of earlier levels then come first. */
static void sort_rows(workshop *shop, int32_t *sorted) {
    const reel_graph *graph = &shop->graph;
    const uint8_t *states = shop->states;
    for (int32_t v = 0; v < graph->n; v++) {
        int32_t places[N_COLOURS + 2] = {0}, begin = graph->starts[v], end = graph->starts[v + 1];
        for (int32_t i = begin; i < end; i++) {
            places[states[graph->near[i]] + 1]++;
        }
        places[0] = begin;
        for (int state = 0; state < N_COLOURS; state++) {
            places[state + 1] += places[state];
        }
        for (int32_t i = begin; i < end; i++) {
            int32_t u = graph->near[i];
            sorted[places[states[u]]++] = u;
        }
    }
}

/* Moves the end of the part of each row that a level may use, from the level before. */
static void advance_ends(workshop *shop, const int32_t *sorted, uint8_t level) {
    for (int32_t v = 0; v < shop->graph.n; v++) {
        int32_t end = shop->pending[v];
        while (end < shop->graph.starts[v + 1] && shop->states[sorted[end]] < level) {
            end++;
        }
        shop->pending[v] = end;
    }
}

/* The lowest of `count` numbers, all different, ascending: at most `room`. */
static void keep_lowest(const int32_t *numbers, int32_t count, int32_t *lowest, int32_t room) {
    int32_t kept = 0;
    for (int32_t i = 0; i < count; i++) {
        int32_t number = numbers[i], place = kept;
        if (kept == room && lowest[room - 1] < number) {
            continue;
        }
        kept += kept < room;
        place -= place == room;
        for (; place > 0 && lowest[place - 1] > number; place--) {
            lowest[place] = lowest[place - 1];
        }
        lowest[place] = number;
    }
}

/* The same for few numbers, whose list has room for 3 more: each is put where it belongs. */
REEL_INLINE void rank_lowest(int32_t *numbers, int32_t count, int32_t *lowest, int32_t room) {
    numbers[count] = numbers[count + 1] = numbers[count + 2] = INT32_MAX;
    for (int32_t i = 0; i < count; i += 4) {
        four four_numbers = *(const four *)(numbers + i), ranks = {0};
        for (int32_t j = 0; j < count; j++) {
            ranks -= four_numbers > numbers[j];
        }
        for (int32_t lane = 0; lane < 4 && i + lane < count; lane++) {
            if (ranks[lane] < room) {
                lowest[ranks[lane]] = four_numbers[lane];
            }
        }
    }
}

/* Lists those of a part of a row that this search has not seen; how many are listed then. `ring`
   is 4 times the search plus the distance; all that the ring reaches count their paths. */
REEL_INLINE int32_t list_new(workshop *shop, int32_t ring, int32_t paths, const int32_t *part,
                             const int32_t *end, int32_t *list, int32_t count) {
    for (; part < end; part++) {
        int32_t w = *part, mark = shop->marks[w];
        bool is_new = mark >> 2 != ring >> 2;
        int32_t before = is_new || mark != ring ? 0 : shop->paths[w];
        list[count] = w; /* stays if it is new */
        count += is_new;
        shop->marks[w] = is_new ? ring : mark;
        shop->paths[w] = is_new || mark == ring ? before + paths : shop->paths[w];
    }
    return count;
}

/* Keys of what a ring found: many shortest paths first, then the lowest place. */
static void key_by_paths(const workshop *shop, int32_t *found, int32_t count) {
    for (int32_t i = 0; i < count; i++) {
        int32_t paths = shop->paths[found[i]];
        found[i] |= (MOST_PATHS - (paths < MOST_PATHS ? paths : MOST_PATHS)) << PLACE_BITS;
    }
}

/* What is next to the vertices of a ring and was not seen: those of earlier levels to `found`,
   others to `next`, as long as another ring follows. Returns how many were found. */
REEL_INLINE int32_t grow_ring(workshop *shop, const int32_t *sorted, int32_t search, int distance,
                              int32_t *n_ring) {
    const int32_t *starts = shop->graph.starts;
    int32_t found = 0, n_next = 0, mark = 4 * search + distance;
    for (int32_t i = 0; i < *n_ring; i++) {
        int32_t u = shop->queue[i], begin = starts[u], end = starts[u + 1];
        if (distance > 1 && end - begin > LARGEST_PASSAGE) {
            continue;
        }
        const int32_t *row = sorted + begin, *later = sorted + shop->pending[u];
        int32_t before = found, paths = shop->paths[u];
        found = list_new(shop, mark, paths, row, later, shop->found, found);
        if (distance < REACH) {
            for (int32_t k = before; k < found; k++) {
                shop->next[n_next++] = shop->found[k];
            }
            n_next = list_new(shop, mark, paths, later, sorted + end, shop->next, n_next);
        }
    }
    *n_ring = n_next;
    return found;
}

/* The vertices of earlier levels nearest to v, as places in the graph: by distance, then by
   shortest paths. */
static void find_nearest(workshop *shop, const int32_t *sorted, int32_t search, int32_t v,
                         int32_t size, int32_t *stencil, uint8_t *hops) {
    int32_t n_found = 0, n_ring = 1;
    shop->queue[0] = v;
    shop->marks[v] = 4 * search;
    shop->paths[v] = 1;
    for (int distance = 1; distance <= REACH && n_found < size && n_ring; distance++) {
        int32_t more = grow_ring(shop, sorted, search, distance, &n_ring), room = size - n_found;
        key_by_paths(shop, shop->found, more);
        if (more <= FEW) {
            rank_lowest(shop->found, more, stencil + n_found, room);
        } else {
            keep_lowest(shop->found, more, stencil + n_found, room);
        }
        for (int32_t end = n_found + (more < room ? more : room); n_found < end; n_found++) {
            hops[n_found] = (uint8_t)distance;
            stencil[n_found] &= (1 << PLACE_BITS) - 1;
        }
        int32_t *ring = shop->queue;
        shop->queue = shop->next;
        shop->next = ring;
    }
    for (; n_found < size; n_found++) {
        stencil[n_found] = -1;
        hops[n_found] = 0;
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

/* Stencils and smooth fields of the rows begin .. end - 1; their vertices become the mesh's. */
static void predict_rows(workshop *shop, result *all, int32_t begin, int32_t end,
                         int32_t *sorted) {
    size_t size = (size_t)all->size, first = (size_t)begin * size;
    int32_t *order = all->order + begin, *stencil = all->stencil + first, n = end - begin;
    uint8_t *hops = all->hops + first;
    int32_t *contexts = all->contexts + (size_t)begin * REEL_NEIGHBOURS;
    reel_zero(shop->marks, (size_t)shop->graph.n * sizeof *shop->marks);
    sort_rows(shop, sorted);
    reel_copy(shop->pending, shop->graph.starts, (size_t)shop->graph.n * sizeof *shop->pending);
    uint8_t level = 0;
    for (int32_t i = 0; i < n; i++) {
        size_t row = (size_t)i * size;
        if (shop->states[order[i]] != level) {
            level = shop->states[order[i]];
            advance_ends(shop, sorted, level);
        }
        find_nearest(shop, sorted, i + 1, order[i], all->size, stencil + row, hops + row);
        list_contexts(shop, order[i], stencil + row, all->size, contexts + i * REEL_NEIGHBOURS);
    }
    reel_smooth(&shop->smoother, &shop->graph, all->smooth + all->n_rows * REEL_SMOOTH_FIELDS);
    all->n_rows += shop->graph.n;
    name_members(shop, order, (size_t)n);
    name_members(shop, stencil, (size_t)n * size);
    name_members(shop, contexts, (size_t)n * REEL_NEIGHBOURS);
}

/* Cells of the coarser resolution, in `marks`: of what is kept, its place there; of all else that
   of the highest kept neighbour. Members and hashes become those of what is kept. */
static int32_t part_into_cells(workshop *shop) {
    const reel_graph *graph = &shop->graph;
    int32_t n_kept = 0, *cells = shop->marks;
    for (int32_t v = 0; v < graph->n; v++) {
        if (!shop->states[v]) {
            shop->members[n_kept] = shop->members[v];
            shop->hashes[n_kept] = shop->hashes[v];
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
    return n_kept;
}

/* Makes the graph of what is kept the one to work on: cells are next to each other along edges. */
static void coarsen(workshop *shop, int turn) {
    const reel_graph *graph = &shop->graph;
    int32_t n_kept = part_into_cells(shop), pairs = 0;
    int32_t *starts = shop->starts[turn], *near = shop->near[turn];
    for (int32_t v = 0; v < graph->n; v++) {
        int32_t own = shop->marks[v];
        for (int32_t i = graph->starts[v]; i < graph->starts[v + 1]; i++) {
            int32_t u = graph->near[i], other = shop->marks[u];
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
    __builtin_memset(all->stencil, 0xFF, filled * sizeof *all->stencil);
    reel_zero(all->hops, filled);
    reel_zero(shop->states, n);
    for (int32_t v = 0; v < shop->graph.n; v++) {
        list_contexts(shop, v, NULL, 0, all->contexts + v * REEL_NEIGHBOURS);
    }
    name_members(shop, all->contexts, n * REEL_NEIGHBOURS);
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
        predict_rows(shop, all, n_kept, end, shop->near[resolution & 1]);
        coarsen(shop, resolution & 1);
        end = n_kept;
    }
    end_with(shop, all, resolution);
}

static size_t shop_room(size_t n, size_t n_near) {
    return 6 * reel_room(n + 1, sizeof(int32_t)) + 3 * reel_room(n + 4, sizeof(int32_t)) +
           reel_room(n, sizeof(uint64_t)) + reel_room(n, 1) +
           2 * reel_room(n_near, sizeof(int32_t)) + reel_joiner_room(n, n_near / 2);
}

static workshop open_shop(reel_arena *arena, size_t n, size_t n_near) {
    return (workshop){
        .members = reel_take(arena, n + 1, sizeof(int32_t)),
        .hashes = reel_take(arena, n, sizeof(uint64_t)),
        .states = reel_take(arena, n, 1),
        .pending = reel_take(arena, n + 1, sizeof(int32_t)),
        .marks = reel_take(arena, n + 1, sizeof(int32_t)),
        .paths = reel_take(arena, n + 1, sizeof(int32_t)),
        .queue = reel_take(arena, n + 4, sizeof(int32_t)),
        .next = reel_take(arena, n + 4, sizeof(int32_t)),
        .found = reel_take(arena, n + 4, sizeof(int32_t)),
        .starts = {reel_take(arena, n + 1, sizeof(int32_t)),
                   reel_take(arena, n + 1, sizeof(int32_t))},
        .near = {reel_take(arena, n_near, sizeof(int32_t)),
                 reel_take(arena, n_near, sizeof(int32_t))},
        .joiner = reel_take_joiner(arena, n, n_near / 2),
    };
}

size_t reel_hierarchy_memory(int64_t n_verts, int64_t n_near) {
    size_t n = (size_t)n_verts, row = REEL_SMOOTH_FIELDS * sizeof(float);
    return shop_room(n, (size_t)n_near) + reel_smoother_room(n) +
           reel_room(REEL_SMOOTH_ROWS * n, row);
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

/* Vertices get their places in coding order; so do the rows of smooth fields. */
static void number_in_order(const result *all, int32_t n, int32_t n_levels, const int32_t *starts,
                            const int32_t *resolutions, const int64_t *smooth_starts,
                            int32_t *numbers, float *smooth) {
    for (int32_t i = 0; i < n; i++) {
        numbers[all->order[i]] = i;
    }
    for (size_t i = 0; i < (size_t)n * (size_t)all->size; i++) {
        all->stencil[i] = all->stencil[i] < 0 ? -1 : numbers[all->stencil[i]];
    }
    for (size_t i = 0; i < (size_t)n * REEL_NEIGHBOURS; i++) {
        all->contexts[i] = all->contexts[i] < 0 ? -1 : numbers[all->contexts[i]];
    }
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
        n_verts >= 1 << PLACE_BITS) {
        return reel_failure(REEL_INVALID, 0);
    }
    size_t n = (size_t)n_verts;
    reel_arena arena = reel_arena_of(memory, memory_size);
    workshop shop = open_shop(&arena, n, (size_t)starts[n]);
    shop.smoother = reel_take_smoother(&arena, n);
    float *rows = reel_take(&arena, REEL_SMOOTH_ROWS * n, REEL_SMOOTH_FIELDS * sizeof(float));
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    shop.graph = (reel_graph){(int32_t)n, starts, near};
    for (int32_t v = 0; v < (int32_t)n; v++) {
        shop.members[v] = v;
        shop.hashes[v] = reel_scattered((uint64_t)v);
    }
    result all = {.order = order, .stencil = stencil, .hops = hops, .contexts = contexts,
                  .smooth = rows, .size = (int32_t)stencil_size};
    build(&shop, &all);
    int32_t n_levels = write_levels(&all, level_starts, level_resolutions, smooth_starts);
    number_in_order(&all, (int32_t)n, n_levels, level_starts, level_resolutions, smooth_starts,
                    shop.members, smooth);
    return n_levels;
}
