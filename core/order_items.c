/* Coding of a permutation of items along a graph, and names of vertices by their first use. */

#include "order_items.h"

/* Ways to code the next item: 0 is the item after the last one, 1..4 a neighbor of the last one. */
#define OPEN 5 /* a leap to an open item: one with a coded neighbor */
#define ANY 6  /* a leap to any uncoded item */
#define N_ITEM_WAYS 7
#define MAX_NEIGHBORS 16

typedef struct {
    reel_model next[N_ITEM_WAYS][N_ITEM_WAYS][2]; /* by the last two ways, and if it is open */
    reel_model near[5][N_ITEM_WAYS][N_ITEM_WAYS]; /* by index, number of neighbors, and last way */
    reel_model open[N_ITEM_WAYS];                 /* by the last way */
    reel_leap_model leap, leap_any;               /* leaps of OPEN and of ANY */
    int last_ways[2];
} item_models;

/* The open items: uncoded ones with a coded neighbor. Each has a time, by which they are sorted.

   Coding an item opens its other neighbors, at consecutive times. If another coded item reaches one
   of them, it moves to the front of these times, as it is likely to be coded sooner. */
typedef struct {
    reel_ranks times;    /* times of the open items */
    int32_t *time_of;    /* time of each item, or -1 if it was never open */
    int32_t *item_at;    /* item of each time */
    int32_t *opener;     /* coded neighbor that opened each item */
    int32_t *next_front; /* for each opener, the first time after those that moved to the front */
    int32_t clock;       /* time of the next item that opens */
} open_items;

typedef struct {
    item_models *models;
    const reel_item_graph *graph;
    reel_ranks uncoded; /* items that are not coded yet */
    open_items open;
    int64_t last_open, last_any; /* where the last leap of OPEN and of ANY went */
} item_state;

void reel_reset_models(void *models, size_t size) {
    reel_model *model = models;
    for (size_t i = 0; i < size / sizeof *model; i++) {
        model[i] = reel_model_of(32768, 0);
    }
}

void reel_reset_leaps(reel_leap_model *model) {
    reel_reset_integer_model(&model->shared);
    reel_zero(model->by_last, sizeof model->by_last);
    model->last = 0;
}

int64_t reel_code_leap(reel_range_coder *coder, reel_leap_model *model, const reel_ranks *set,
                       int64_t from, int64_t to) {
    int64_t start = reel_ranks_rank(set, from);
    int64_t distance = reel_is_encoder(coder) ? reel_ranks_rank(set, to) - start : 0;
    distance +=
        distance<-(set->size / 2) ? set->size : distance>(set->size - 1) / 2 ? -set->size : 0;
    int32_t leap = (int32_t)distance;
    uint32_t size = model->last < 0 ? 0U - (uint32_t)model->last : (uint32_t)model->last;
    int length = reel_bit_length(size), sign = model->last > 0 ? 1 : model->last < 0 ? 2 : 0;
    reel_integer_model *context =
        &model->by_last[length < REEL_N_LEAP_CLASSES ? length : REEL_N_LEAP_CLASSES - 1];
    leap = reel_code_integer_in_context(coder, &model->shared, context, sign, leap);
    model->last = leap;
    int64_t rank = (start + leap) % set->size;
    return reel_ranks_select(set, rank < 0 ? rank + set->size : rank);
}

size_t reel_item_graph_bytes(int64_t n, int64_t n_near) {
    return reel_array_bytes((size_t)n + 2, sizeof(int64_t)) +
           reel_array_bytes((size_t)n_near, sizeof(int32_t));
}

reel_item_graph reel_allocate_item_graph(reel_arena *arena, int64_t n, int64_t n_near) {
    return (reel_item_graph){.n = n,
                             .starts = reel_allocate(arena, (size_t)n + 2, sizeof(int64_t)),
                             .near = reel_allocate(arena, (size_t)n_near, sizeof(int32_t))};
}

size_t reel_item_coder_bytes(int64_t n) {
    return reel_array_bytes(1, sizeof(item_models)) + 2 * reel_ranks_bytes(n) +
           4 * reel_array_bytes((size_t)n, sizeof(int32_t));
}

static item_state start_item_coder(reel_arena *arena, const reel_item_graph *graph) {
    size_t n = (size_t)graph->n;
    item_state state = {.models = reel_allocate(arena, 1, sizeof(item_models)), .graph = graph};
    state.uncoded = reel_ranks_of(arena, graph->n, true);
    open_items *open = &state.open;
    open->times = reel_ranks_of(arena, graph->n, false);
    open->time_of = reel_allocate(arena, n, sizeof(int32_t));
    open->item_at = reel_allocate(arena, n, sizeof(int32_t));
    open->opener = reel_allocate(arena, n, sizeof(int32_t));
    open->next_front = reel_allocate(arena, n, sizeof(int32_t));
    if (arena->failed) {
        return state;
    }
    for (size_t i = 0; i < n; i++) {
        open->time_of[i] = -1;
    }
    item_models *models = state.models;
    reel_reset_models(models->next, sizeof models->next);
    reel_reset_models(models->near, sizeof models->near);
    reel_reset_models(models->open, sizeof models->open);
    reel_reset_leaps(&models->leap);
    reel_reset_leaps(&models->leap_any);
    models->last_ways[0] = models->last_ways[1] = ANY;
    return state;
}

/* Find up to 16 distinct uncoded neighbors of `last`, except `next`, in the order in which they
   opened. Return their number. */
static int near_items(const item_state *state, int32_t last, int32_t next, int32_t *result) {
    const reel_item_graph *graph = state->graph;
    int n = 0;
    for (int64_t i = graph->starts[last]; i < graph->starts[last + 1] && n < MAX_NEIGHBORS; i++) {
        int32_t neighbor = graph->near[i];
        int index = n;
        if (neighbor == next || !reel_ranks_has(&state->uncoded, neighbor)) {
            continue;
        }
        while (index > 0 &&
               state->open.time_of[result[index - 1]] > state->open.time_of[neighbor]) {
            index--;
        }
        if (index > 0 && result[index - 1] == neighbor) {
            continue;
        }
        for (int j = n++; j > index; j--) {
            result[j] = result[j - 1];
        }
        result[index] = neighbor;
    }
    return n;
}

/* Code the next item if it has the number after the last one, or is its neighbor. Return it and set
   `way`; return -1 if it is neither. */
static int32_t code_near_item(reel_range_coder *coder, item_state *state, int32_t last,
                              int32_t target, int *way) {
    item_models *models = state->models;
    int last_way = models->last_ways[0], earlier_way = models->last_ways[1];
    int32_t next = last + 1;
    if (next >= state->graph->n || !reel_ranks_has(&state->uncoded, next)) {
        next = -1;
    } else {
        *way = 0;
        if (reel_bit(coder, &models->next[last_way][earlier_way][state->open.time_of[next] >= 0],
                     target == next)) {
            return next;
        }
    }
    int32_t neighbors[MAX_NEIGHBORS];
    int n = last < 0 ? 0 : near_items(state, last, next, neighbors);
    for (int i = 0; i < n; i++) {
        reel_model *model =
            &models->near[i < 4 ? i : 4][n < N_ITEM_WAYS ? n - 1 : N_ITEM_WAYS - 1][last_way];
        if (reel_bit(coder, model, target == neighbors[i])) {
            *way = 1 + (i < 4 ? i : 3);
            return neighbors[i];
        }
    }
    return -1;
}

/* Code the next item by a leap: among the open items, or among all uncoded ones. */
static int32_t code_far_item(reel_range_coder *coder, item_state *state, int32_t target, int *way) {
    item_models *models = state->models;
    int64_t time = reel_is_encoder(coder) ? state->open.time_of[target] : -1, result;
    if (state->open.times.size && reel_bit(coder, &models->open[models->last_ways[0]], time >= 0)) {
        *way = OPEN;
        result = reel_code_leap(coder, &models->leap, &state->open.times, state->last_open, time);
        state->last_open = result;
        return state->open.item_at[result];
    }
    *way = ANY;
    result = reel_code_leap(coder, &models->leap_any, &state->uncoded, state->last_any, target);
    state->last_any = result;
    return (int32_t)result;
}

/* Open an item, as a neighbor of a coded one. */
REEL_INLINE void open_item(open_items *open, int32_t item, int32_t opener) {
    open->time_of[item] = open->clock;
    open->item_at[open->clock] = item;
    open->opener[item] = opener;
    reel_ranks_change(&open->times, open->clock++, 1);
}

/* Move an open item, which now has a second coded neighbor, to the front of those with the same
   opener: it swaps times with the first one that was not moved. */
REEL_INLINE void move_to_front(open_items *open, int32_t item) {
    int32_t *front = &open->next_front[open->opener[item]], time = open->time_of[item];
    if (time < *front) {
        return;
    }
    while (!reel_ranks_has(&open->times, *front)) {
        ++*front;
    }
    int32_t earlier = (*front)++, other = open->item_at[earlier];
    open->item_at[time] = other;
    open->time_of[other] = time;
    open->item_at[earlier] = item;
    open->time_of[item] = earlier;
}

/* Mark an item as coded: it is no longer open, and its uncoded neighbors become open. */
static void mark_item_coded(item_state *state, int32_t item) {
    const reel_item_graph *graph = state->graph;
    open_items *open = &state->open;
    int32_t first_time = open->clock;
    reel_ranks_change(&state->uncoded, item, -1);
    if (open->time_of[item] >= 0) {
        reel_ranks_change(&open->times, open->time_of[item], -1);
    }
    for (int64_t i = graph->starts[item]; i < graph->starts[item + 1]; i++) {
        int32_t neighbor = graph->near[i], time = open->time_of[neighbor];
        if (!reel_ranks_has(&state->uncoded, neighbor)) {
            continue;
        }
        if (time < 0) {
            open_item(open, neighbor, item);
        } else if (time < first_time) { /* otherwise this item opened it: a repeated edge */
            move_to_front(open, neighbor);
        }
    }
    open->next_front[item] = first_time;
}

int64_t reel_code_items(reel_range_coder *coder, reel_arena arena, const reel_item_graph *graph,
                        int32_t *sequence) {
    item_state state = start_item_coder(&arena, graph);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    int32_t last = -1;
    for (int64_t i = 0; i < graph->n; i++) {
        int32_t target = reel_is_encoder(coder) ? sequence[i] : -1;
        int way;
        int32_t result = code_near_item(coder, &state, last, target, &way);
        if (result < 0) {
            result = code_far_item(coder, &state, target, &way);
        }
        sequence[i] = last = result;
        mark_item_coded(&state, result);
        state.models->last_ways[1] = state.models->last_ways[0];
        state.models->last_ways[0] = way;
    }
    return 0;
}

/* ---- names of vertices ---- */

size_t reel_vertex_names_bytes(int64_t n_verts) {
    return 2 * reel_array_bytes((size_t)n_verts, sizeof(int32_t));
}

reel_vertex_names reel_start_names(reel_arena *arena, int64_t n_verts) {
    reel_vertex_names names = {n_verts, 0, reel_allocate(arena, (size_t)n_verts, sizeof(int32_t)),
                               reel_allocate(arena, (size_t)n_verts, sizeof(int32_t))};
    for (int64_t i = 0; !arena->failed && i < n_verts; i++) {
        names.name_of[i] = -1;
    }
    return names;
}

int32_t reel_name_vertex(reel_vertex_names *names, int32_t vertex) {
    if (names->name_of[vertex] < 0) {
        names->vertex_of[names->n_named] = vertex;
        names->name_of[vertex] = names->n_named++;
    }
    return names->name_of[vertex];
}

void reel_name_unused(reel_vertex_names *names) {
    for (int32_t i = 0; i < names->n_verts; i++) {
        reel_name_vertex(names, i);
    }
}

static void rename_vertices(int32_t *vertices, int64_t n, const int32_t *names) {
    for (int64_t i = 0; i < n; i++) {
        vertices[i] = names[vertices[i]];
    }
}

int64_t reel_code_named(reel_range_coder *coder, reel_arena arena, const reel_item_graph *graph,
                        const reel_vertex_names *names, int32_t *sequence) {
    if (reel_is_encoder(coder)) {
        rename_vertices(sequence, names->n_verts, names->name_of);
    }
    int64_t result = reel_code_items(coder, arena, graph, sequence);
    rename_vertices(sequence, result < 0 ? 0 : names->n_verts, names->vertex_of);
    return result;
}
