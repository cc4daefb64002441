/* Coding of the original order of faces and vertices, or of cells and vertices, relative to the
   internal order of the connectivity.

   docs/format.md, "ORDER". Face lists follow the mesh: the next face is usually near the last two,
   or across an open side of an earlier face. Open sides are kept in the order in which they opened,
   because lists that sweep over the mesh close them in about that order. Vertices and cells are
   coded likewise; vertices also follow the order in which the faces or cells first use them. */

#include "cells.h"
#include "integers.h"
#include "ranks.h"

#define N_ITEM_WAYS 7 /* ways in which a vertex or cell is coded */
#define OPEN 5        /* 0: the next item; 1..4: a neighbor; OPEN: an open item */
#define ANY 6
/* Ways in which a face is coded: 0..5: across a side; 6..17: across two sides; FAR: all else. */
#define FAR 18
#define N_LEAP_CLASSES 10 /* classes of leap lengths */
#define MAX_NEIGHBORS 16

typedef struct {
    reel_integer_model all;
    reel_integer_model by_last[N_LEAP_CLASSES];
    int32_t last;
} leap_model;

typedef struct {
    reel_model is_near[FAR + 1];
    reel_model is_near_in_context[FAR + 1][FAR + 1];
    reel_model near[FAR][FAR + 1];
    reel_model near_in_context[FAR][FAR + 1][FAR + 1];
    reel_model turn[FAR + 2][3];
    reel_model turn_in_context[FAR + 2][FAR + 1][3][3];
    reel_model open[FAR + 1];
    leap_model leap, leap_any;
    int last_ways[2]; /* ways of the last face, and of the one before it */
    int last_turn;    /* rotation of the last face */
} face_models;

typedef struct {
    reel_model next[N_ITEM_WAYS][N_ITEM_WAYS][2];
    reel_model near[5][N_ITEM_WAYS][N_ITEM_WAYS];
    reel_model open[N_ITEM_WAYS];
    leap_model leap, leap_any;
    int last_ways[2];
} item_models;

typedef struct {
    const int32_t *faces;
    const int32_t *twins;
    int64_t n_verts, n_faces;
    int32_t *corners;  /* first corner of each coded face */
    int32_t *sequence; /* vertex of each original number */
} mesh_order;

static void reset_models(void *models, size_t size) {
    reel_model *model = models;
    for (size_t i = 0; i < size / sizeof *model; i++) {
        model[i] = reel_model_of(32768, 0);
    }
}

static void reset_leaps(leap_model *model) {
    reel_reset_integer_model(&model->all);
    reel_zero(model->by_last, sizeof model->by_last);
    model->last = 0;
}

/* Code a leap between members of a nonempty set, from the rank of `from` to that of `to`, modulo
   its size. Returns the member reached. */
static int64_t code_leap(reel_range_coder *coder, leap_model *model, const reel_ranks *set,
                         int64_t from, int64_t to) {
    int64_t start = reel_ranks_rank(set, from);
    int64_t distance = reel_is_encoder(coder) ? reel_ranks_rank(set, to) - start : 0;
    distance += distance < -(set->size / 2)      ? set->size
                : distance > (set->size - 1) / 2 ? -set->size
                                                 : 0;
    int32_t leap = (int32_t)distance;
    uint32_t size = model->last < 0 ? 0U - (uint32_t)model->last : (uint32_t)model->last;
    int length = reel_bit_length(size), sign = model->last > 0 ? 1 : model->last < 0 ? 2 : 0;
    reel_integer_model *context =
        &model->by_last[length < N_LEAP_CLASSES ? length : N_LEAP_CLASSES - 1];
    leap = reel_code_integer_in_context(coder, &model->all, context, sign, leap);
    model->last = leap;
    int64_t rank = (start + leap) % set->size;
    return reel_ranks_select(set, rank < 0 ? rank + set->size : rank);
}

/* ---- faces ---- */

typedef struct {
    face_models *models;
    reel_ranks uncoded; /* faces not yet coded */
    reel_ranks open;    /* opening times of open sides: between coded and uncoded faces */
    int32_t *opened_at; /* opening time of each side, or -1 */
    int32_t *side_at;   /* side that opened at each time */
    int32_t clock;
    /* Positions of the last leaps: opening time of the side reached, and face reached. */
    int64_t last_open, last_any;
} face_state;

/* The side `by` corners (0..2) after a corner of its face. */
static int32_t side_of(int32_t corner, int by) {
    return corner + by - (corner % 3 + by > 2 ? 3 : 0);
}

/* The corner at which the face across a side is entered, or -1 if there is no uncoded face. */
static int32_t entry(const mesh_order *mesh, const face_state *state, int32_t side) {
    int32_t twin = mesh->twins[side];
    return twin != side && reel_ranks_has(&state->uncoded, twin / 3) ? twin : -1;
}

/* Distinct uncoded faces near the last two: where each is entered, and by which way. They are found
   lazily, as one of the first is usually the next face. */
typedef struct {
    int32_t last[2]; /* first corners of the last faces, latest first */
    int next_way, end;
    int32_t first[6]; /* entries of ways 0..5, or -1 */
    int n, ways[FAR];
    int32_t entries[FAR];
} near_faces;

static near_faces find_near(const mesh_order *mesh, int64_t listed) {
    near_faces near = {.end = listed < 2 ? (int)listed * 9 : FAR};
    for (int i = 0; i < 2 && i < listed; i++) {
        near.last[i] = mesh->corners[listed - 1 - i];
    }
    return near;
}

/* Find one more face next to the last two, or next to one of these; returns false if there is
   none. */
static bool find_next(const mesh_order *mesh, const face_state *state, near_faces *near) {
    int n_first = near->end / 3;
    while (near->next_way < near->end) {
        int way = near->next_way++;
        int32_t entered = -1;
        if (way < n_first) {
            entered = entry(mesh, state, side_of(near->last[way / 3], way % 3));
            near->first[way] = entered;
        } else if (near->first[(way - n_first) / 2] >= 0) {
            int32_t across = near->first[(way - n_first) / 2];
            entered = entry(mesh, state, side_of(across, 1 + (way - n_first) % 2));
        }
        bool is_new = entered >= 0;
        for (int i = 0; is_new && i < near->n; i++) {
            is_new = near->entries[i] / 3 != entered / 3;
        }
        if (is_new) {
            near->entries[near->n] = entered;
            near->ways[near->n++] = way < n_first ? way : way - n_first + 6;
            return true;
        }
    }
    return false;
}

/* Code whether the next face is near the last two, and which. Returns the corner entered, or -1;
   `way` is how it was found. */
static int32_t code_near(reel_range_coder *coder, const mesh_order *mesh, face_state *state,
                         int64_t listed, int32_t target, int *way) {
    face_models *models = state->models;
    near_faces near = find_near(mesh, listed);
    int last_way = models->last_ways[0], earlier = models->last_ways[1], index = 0,
        target_index = -1;
    bool has_more = find_next(mesh, state, &near), is_last = false;
    while (reel_is_encoder(coder) && target_index < 0 && has_more) {
        target_index = near.entries[near.n - 1] / 3 == target ? near.n - 1 : -1;
        has_more = target_index >= 0 || find_next(mesh, state, &near);
    }
    *way = FAR;
    if (!near.n ||
        !reel_bit_in_context(coder, &models->is_near[last_way],
                             &models->is_near_in_context[last_way][earlier], target_index >= 0)) {
        return -1;
    }
    for (;; index++) {
        is_last = index + 1 == near.n && !find_next(mesh, state, &near); /* the only one left */
        reel_model *all = &models->near[near.ways[index]][last_way];
        reel_model *context = &models->near_in_context[near.ways[index]][last_way][earlier];
        if (is_last || reel_bit_in_context(coder, all, context, index == target_index)) {
            break;
        }
    }
    *way = near.ways[index];
    return near.entries[index];
}

/* Choose the open side to reach a face from: the one whose rank is nearest to that of the last. */
static int64_t best_time(const mesh_order *mesh, const face_state *state, int64_t face) {
    int64_t result = -1, min_distance = 0, here = reel_ranks_rank(&state->open, state->last_open);
    for (int i = 0; i < 3; i++) {
        int32_t twin = mesh->twins[3 * face + i];
        if (state->opened_at[twin] < 0 || twin == 3 * face + i) {
            continue;
        }
        int64_t far = reel_ranks_rank(&state->open, state->opened_at[twin]) - here;
        far = far < 0 ? -far : far;
        if (result < 0 || far < min_distance) {
            result = state->opened_at[twin];
            min_distance = far;
        }
    }
    return result;
}

/* Code a face across an open side, or among all. Returns the corner entered, or -1 - face for the
   latter. */
static int32_t code_far(reel_range_coder *coder, const mesh_order *mesh, face_state *state,
                        int64_t target) {
    face_models *models = state->models;
    int64_t time = reel_is_encoder(coder) ? best_time(mesh, state, target) : -1;
    if (state->open.size && reel_bit(coder, &models->open[models->last_ways[0]], time >= 0)) {
        time = code_leap(coder, &models->leap, &state->open, state->last_open, time);
        state->last_open = time;
        return mesh->twins[state->side_at[time]];
    }
    int64_t face = code_leap(coder, &models->leap_any, &state->uncoded, state->last_any, target);
    state->last_any = face;
    return -1 - (int32_t)face;
}

static int code_turn(reel_range_coder *coder, face_models *models, int way, int turn) {
    int last_way = models->last_ways[0], last_turn = models->last_turn;
    reel_model *all = models->turn[way], *here = models->turn_in_context[way][last_way][last_turn];
    if (!reel_bit_in_context(coder, &all[0], &here[0], turn > 0)) {
        return 0;
    }
    return 1 + reel_bit_in_context(coder, &all[1], &here[1], turn > 1);
}

/* Mark a face as coded: sides towards it close, its own open. */
static void mark_coded(const mesh_order *mesh, face_state *state, int32_t corner) {
    int32_t face = corner / 3;
    reel_ranks_change(&state->uncoded, face, -1);
    for (int i = 0; i < 3; i++) {
        int32_t side = side_of(corner, i), twin = mesh->twins[side];
        if (twin != side && state->opened_at[twin] >= 0) {
            reel_ranks_change(&state->open, state->opened_at[twin], -1);
            state->opened_at[twin] = -1;
        }
    }
    for (int i = 0; i < 3; i++) {
        int32_t side = side_of(corner, i);
        if (entry(mesh, state, side) >= 0) {
            state->opened_at[side] = state->clock;
            state->side_at[state->clock] = side;
            reel_ranks_change(&state->open, state->clock++, 1);
        }
    }
}

static size_t face_coder_bytes(int64_t n_faces) {
    return reel_array_bytes(1, sizeof(face_models)) + reel_ranks_bytes(n_faces) +
           reel_ranks_bytes(3 * n_faces) +
           2 * reel_array_bytes((size_t)(3 * n_faces), sizeof(int32_t));
}

static face_state start_face_coder(reel_arena *arena, const mesh_order *mesh) {
    int64_t n_sides = 3 * mesh->n_faces;
    face_state state = {.models = reel_allocate(arena, 1, sizeof(face_models))};
    state.uncoded = reel_ranks_of(arena, mesh->n_faces, true);
    state.open = reel_ranks_of(arena, n_sides, false);
    state.opened_at = reel_allocate(arena, (size_t)n_sides, sizeof(int32_t));
    state.side_at = reel_allocate(arena, (size_t)n_sides, sizeof(int32_t));
    if (arena->failed) {
        return state;
    }
    for (int64_t i = 0; i < n_sides; i++) {
        state.opened_at[i] = -1;
    }
    face_models *models = state.models;
    reel_zero(models, sizeof *models);
    reset_models(models->is_near, sizeof models->is_near);
    reset_models(models->near, sizeof models->near);
    reset_models(models->turn, sizeof models->turn);
    reset_models(models->open, sizeof models->open);
    reset_leaps(&models->leap);
    reset_leaps(&models->leap_any);
    models->last_ways[0] = models->last_ways[1] = FAR;
    return state;
}

static int64_t code_faces(reel_range_coder *coder, reel_arena *arena, const mesh_order *mesh) {
    face_state state = start_face_coder(arena, mesh);
    if (arena->failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t i = 0; i < mesh->n_faces; i++) {
        int32_t target = reel_is_encoder(coder) ? mesh->corners[i] : 0;
        int way;
        int32_t entered = code_near(coder, mesh, &state, i, target / 3, &way);
        if (entered < 0) {
            entered = code_far(coder, mesh, &state, target / 3);
        }
        bool any_face = entered < 0;
        entered = any_face ? 3 * (-1 - entered) : entered;
        int turn = (int)((uint32_t)(target - entered + 3) % 3);
        turn = code_turn(coder, state.models, any_face ? FAR + 1 : way, turn);
        mesh->corners[i] = side_of(entered, turn);
        mark_coded(mesh, &state, mesh->corners[i]);
        state.models->last_ways[1] = state.models->last_ways[0];
        state.models->last_ways[0] = way;
        state.models->last_turn = turn;
    }
    return 0;
}

/* ---- vertices, and cells ---- */

/* Items with neighbors: vertices of faces or cells, or cells that share sides. The neighbors of
   item i are near[starts[i]] .. near[starts[i + 1] - 1], in a defined order, with repetitions. */
typedef struct {
    int64_t n;
    int64_t *starts; /* n + 2, of which the last is for construction */
    int32_t *near;
} item_graph;

typedef struct {
    item_models *models;
    const item_graph *graph;
    reel_ranks uncoded;
    reel_ranks open;    /* opening times of uncoded items with a coded neighbor */
    int32_t *opened_at; /* opening time of each item, or -1 */
    int32_t *item_at;   /* item that opened at each time */
    int32_t *opener;    /* item that opened each item */
    /* Of the items that an item opened, those that no other coded item has as a neighbor are at the
       end: their first time. */
    int32_t *first_once;
    int32_t clock;
    int64_t last_open, last_any;
} item_state;

static size_t graph_bytes(int64_t n, int64_t n_near) {
    return reel_array_bytes((size_t)n + 2, sizeof(int64_t)) +
           reel_array_bytes((size_t)n_near, sizeof(int32_t));
}

static item_graph allocate_graph(reel_arena *arena, int64_t n, int64_t n_near) {
    return (item_graph){.n = n,
                        .starts = reel_allocate(arena, (size_t)n + 2, sizeof(int64_t)),
                        .near = reel_allocate(arena, (size_t)n_near, sizeof(int32_t))};
}

static size_t item_coder_bytes(int64_t n) {
    return reel_array_bytes(1, sizeof(item_models)) + 2 * reel_ranks_bytes(n) +
           4 * reel_array_bytes((size_t)n, sizeof(int32_t));
}

/* List the neighbors of vertices face by face and corner by corner. */
static void find_neighbors(const item_graph *graph, const mesh_order *mesh) {
    int64_t *starts = graph->starts;
    reel_zero(starts, ((size_t)mesh->n_verts + 2) * sizeof *starts);
    for (int64_t i = 0; i < 3 * mesh->n_faces; i++) {
        starts[mesh->faces[i] + 2] += 2;
    }
    for (int64_t i = 0; i < mesh->n_verts; i++) {
        starts[i + 2] += starts[i + 1];
    }
    for (int64_t i = 0; i < 3 * mesh->n_faces; i++) {
        /* the cursor starts[v + 1] ends behind v's list */
        int64_t face = i / 3 * 3, *end = &starts[mesh->faces[i] + 1];
        graph->near[(*end)++] = mesh->faces[face + (i + 1) % 3];
        graph->near[(*end)++] = mesh->faces[face + (i + 2) % 3];
    }
}

static item_state start_item_coder(reel_arena *arena, const item_graph *graph) {
    size_t n = (size_t)graph->n;
    item_state state = {.models = reel_allocate(arena, 1, sizeof(item_models)), .graph = graph};
    state.uncoded = reel_ranks_of(arena, graph->n, true);
    state.open = reel_ranks_of(arena, graph->n, false);
    state.opened_at = reel_allocate(arena, n, sizeof(int32_t));
    state.item_at = reel_allocate(arena, n, sizeof(int32_t));
    state.opener = reel_allocate(arena, n, sizeof(int32_t));
    state.first_once = reel_allocate(arena, n, sizeof(int32_t));
    if (arena->failed) {
        return state;
    }
    for (size_t i = 0; i < n; i++) {
        state.opened_at[i] = -1;
    }
    item_models *models = state.models;
    reset_models(models->next, sizeof models->next);
    reset_models(models->near, sizeof models->near);
    reset_models(models->open, sizeof models->open);
    reset_leaps(&models->leap);
    reset_leaps(&models->leap_any);
    models->last_ways[0] = models->last_ways[1] = ANY;
    return state;
}

/* Find up to 16 distinct uncoded neighbors, except `next`, in the order in which they opened;
   returns their number. */
static int near_items(const item_state *state, int32_t last, int32_t next, int32_t *result) {
    const item_graph *graph = state->graph;
    int n = 0;
    for (int64_t i = graph->starts[last]; i < graph->starts[last + 1] && n < MAX_NEIGHBORS; i++) {
        int32_t here = graph->near[i];
        int last_open = n;
        if (here == next || !reel_ranks_has(&state->uncoded, here)) {
            continue;
        }
        while (last_open > 0 && state->opened_at[result[last_open - 1]] > state->opened_at[here]) {
            last_open--;
        }
        if (last_open > 0 && result[last_open - 1] == here) {
            continue;
        }
        for (int j = n++; j > last_open; j--) {
            result[j] = result[j - 1];
        }
        result[last_open] = here;
    }
    return n;
}

/* Code whether the next item follows the last or is a neighbor of it. Returns it, or -1; `way` is
   how it was found. */
static int32_t code_near_item(reel_range_coder *coder, item_state *state, int32_t last,
                              int32_t target, int *way) {
    item_models *models = state->models;
    int h = models->last_ways[0], g = models->last_ways[1];
    int32_t next = last + 1;
    if (next >= state->graph->n || !reel_ranks_has(&state->uncoded, next)) {
        next = -1;
    } else {
        *way = 0;
        if (reel_bit(coder, &models->next[h][g][state->opened_at[next] >= 0], target == next)) {
            return next;
        }
    }
    int32_t result[MAX_NEIGHBORS];
    int n = last < 0 ? 0 : near_items(state, last, next, result);
    for (int i = 0; i < n; i++) {
        reel_model *model =
            &models->near[i < 4 ? i : 4][n < N_ITEM_WAYS ? n - 1 : N_ITEM_WAYS - 1][h];
        if (reel_bit(coder, model, target == result[i])) {
            *way = 1 + (i < 4 ? i : 3);
            return result[i];
        }
    }
    return -1;
}

static int32_t code_far_item(reel_range_coder *coder, item_state *state, int32_t target,
                             int *way) {
    item_models *models = state->models;
    int64_t time = reel_is_encoder(coder) ? state->opened_at[target] : -1, result;
    if (state->open.size && reel_bit(coder, &models->open[models->last_ways[0]], time >= 0)) {
        *way = OPEN;
        result = code_leap(coder, &models->leap, &state->open, state->last_open, time);
        state->last_open = result;
        return state->item_at[result];
    }
    *way = ANY;
    result = code_leap(coder, &models->leap_any, &state->uncoded, state->last_any, target);
    state->last_any = result;
    return (int32_t)result;
}

/* Move an open item that a second coded item reached: before those of its opener that none did. */
static void reach_again(item_state *state, int32_t item) {
    int32_t *first_once = &state->first_once[state->opener[item]], time = state->opened_at[item];
    if (time < *first_once) {
        return;
    }
    while (!reel_ranks_has(&state->open, *first_once)) {
        ++*first_once;
    }
    int32_t earlier = (*first_once)++, other = state->item_at[earlier];
    state->item_at[time] = other;
    state->opened_at[other] = time;
    state->item_at[earlier] = item;
    state->opened_at[item] = earlier;
}

/* Mark an item as coded: it closes, its neighbors open. */
static void mark_item_coded(item_state *state, int32_t item) {
    const item_graph *graph = state->graph;
    int32_t first_time = state->clock;
    reel_ranks_change(&state->uncoded, item, -1);
    if (state->opened_at[item] >= 0) {
        reel_ranks_change(&state->open, state->opened_at[item], -1);
    }
    for (int64_t i = graph->starts[item]; i < graph->starts[item + 1]; i++) {
        int32_t here = graph->near[i], time = state->opened_at[here];
        if (!reel_ranks_has(&state->uncoded, here)) {
            continue;
        }
        if (time < 0) {
            state->opened_at[here] = state->clock;
            state->item_at[state->clock] = here;
            state->opener[here] = item;
            reel_ranks_change(&state->open, state->clock++, 1);
        } else if (time < first_time) {
            reach_again(state, here);
        }
    }
    state->first_once[item] = first_time;
}

/* Code the items in their original order, `sequence`. */
static int64_t code_items(reel_range_coder *coder, reel_arena arena, const item_graph *graph,
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

/* Names of vertices: numbers in the order of their first use. */
typedef struct {
    int64_t n_verts;
    int32_t n_named;
    int32_t *name_of;   /* name of each vertex, or -1 */
    int32_t *vertex_of; /* vertex of each name */
} vertex_names;

static size_t names_bytes(int64_t n_verts) {
    return 2 * reel_array_bytes((size_t)n_verts, sizeof(int32_t));
}

static vertex_names start_names(reel_arena *arena, int64_t n_verts) {
    vertex_names names = {n_verts, 0, reel_allocate(arena, (size_t)n_verts, sizeof(int32_t)),
                          reel_allocate(arena, (size_t)n_verts, sizeof(int32_t))};
    for (int64_t i = 0; !arena->failed && i < n_verts; i++) {
        names.name_of[i] = -1;
    }
    return names;
}

/* The name of a vertex, which gets the next one at its first use. */
static int32_t name_vertex(vertex_names *names, int32_t vertex) {
    if (names->name_of[vertex] < 0) {
        names->vertex_of[names->n_named] = vertex;
        names->name_of[vertex] = names->n_named++;
    }
    return names->name_of[vertex];
}

static void name_unused(vertex_names *names) {
    for (int32_t i = 0; i < names->n_verts; i++) {
        name_vertex(names, i);
    }
}

static void rename_vertices(int32_t *vertices, int64_t n, const int32_t *names) {
    for (int64_t i = 0; i < n; i++) {
        vertices[i] = names[vertices[i]];
    }
}

/* Code vertices in their original order, `sequence`, given the graph of their names. */
static int64_t code_named(reel_range_coder *coder, reel_arena arena, const item_graph *graph,
                          const vertex_names *names, int32_t *sequence) {
    if (reel_is_encoder(coder)) {
        rename_vertices(sequence, names->n_verts, names->name_of);
    }
    int64_t result = code_items(coder, arena, graph, sequence);
    rename_vertices(sequence, result < 0 ? 0 : names->n_verts, names->vertex_of);
    return result;
}

/* ---- faces, then their vertices ---- */

static int64_t code_vertices(reel_range_coder *coder, reel_arena arena, const mesh_order *mesh) {
    item_graph graph = allocate_graph(&arena, mesh->n_verts, 6 * mesh->n_faces);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    find_neighbors(&graph, mesh);
    return code_items(coder, arena, &graph, mesh->sequence);
}

static int64_t code_face_vertices(reel_range_coder *coder, reel_arena arena,
                                  const mesh_order *mesh) {
    mesh_order named = *mesh;
    vertex_names names = start_names(&arena, mesh->n_verts);
    int32_t *faces = reel_allocate(&arena, 3 * (size_t)mesh->n_faces, sizeof *faces);
    item_graph graph = allocate_graph(&arena, mesh->n_verts, 6 * mesh->n_faces);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t i = 0; i < 3 * mesh->n_faces; i++) {
        faces[i] = name_vertex(&names, mesh->faces[side_of(mesh->corners[i / 3], (int)(i % 3))]);
    }
    name_unused(&names);
    named.faces = faces;
    find_neighbors(&graph, &named);
    return code_named(coder, arena, &graph, &names, mesh->sequence);
}

static int64_t code_order(reel_range_coder *coder, void *memory, size_t memory_size,
                          const mesh_order *mesh, bool with_faces) {
    int64_t result = 0;
    if (with_faces) {
        reel_arena arena = reel_arena_of(memory, memory_size);
        result = code_faces(coder, &arena, mesh);
    }
    if (result >= 0) { /* memory of the faces is reused for the vertices */
        reel_arena arena = reel_arena_of(memory, memory_size);
        result = with_faces ? code_face_vertices(coder, arena, mesh)
                            : code_vertices(coder, arena, mesh);
    }
    return result < 0 ? result : reel_finish(coder);
}

size_t reel_order_memory(int64_t n_verts, int64_t n_faces) {
    size_t faces = face_coder_bytes(n_faces);
    size_t verts = names_bytes(n_verts) + reel_array_bytes(3 * (size_t)n_faces, sizeof(int32_t)) +
                   graph_bytes(n_verts, 6 * n_faces) + item_coder_bytes(n_verts);
    return faces > verts ? faces : verts;
}

int64_t reel_order_encode(void *memory, size_t memory_size, const int32_t *faces,
                          const int32_t *twins, int64_t n_verts, int64_t n_faces,
                          int64_t with_faces, int32_t *corners, int32_t *sequence, uint8_t *out,
                          size_t capacity) {
    mesh_order mesh = {faces, twins, n_verts, n_faces, corners, sequence};
    reel_range_coder coder = reel_start_encoder(out, capacity);
    return code_order(&coder, memory, memory_size, &mesh, with_faces != 0);
}

int64_t reel_order_decode(void *memory, size_t memory_size, const uint8_t *in, size_t size,
                          const int32_t *faces, const int32_t *twins, int64_t n_verts,
                          int64_t n_faces, int64_t with_faces, int32_t *corners,
                          int32_t *sequence) {
    mesh_order mesh = {faces, twins, n_verts, n_faces, corners, sequence};
    reel_range_coder coder = reel_start_decoder(in, size);
    return code_order(&coder, memory, memory_size, &mesh, with_faces != 0);
}

/* ---- cells, then their vertices ---- */

typedef struct {
    const uint8_t *types;
    const int32_t *nodes;
    int64_t n_cells, n_nodes, n_verts;
    int32_t *cell_sequence;   /* cell of each original number */
    int32_t *vertex_sequence; /* vertex of each original number */
} cell_order;

static int64_t most_neighbors(const cell_order *order, bool of_cells) {
    return of_cells ? REEL_MAX_SIDES * order->n_cells : 4 * order->n_nodes;
}

/* Find the neighbors of cells across sides, or of vertices along the edges of cells, ascending. */
static int64_t find_cell_graph(reel_arena *arena, const cell_order *order, bool of_cells,
                               item_graph *graph) {
    int64_t n = of_cells ? order->n_cells : order->n_verts;
    *graph = allocate_graph(arena, n, most_neighbors(order, of_cells));
    reel_arena scratch = *arena;
    size_t size =
        reel_cells_adjacency_memory(order->n_cells, order->n_nodes, order->n_verts, of_cells);
    int32_t *starts = reel_allocate(&scratch, (size_t)n + 1, sizeof *starts);
    void *memory = reel_allocate(&scratch, size, 1);
    if (scratch.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    int64_t result =
        reel_cells_adjacency(memory, size, order->types, order->n_cells, order->nodes,
                             order->n_nodes, order->n_verts, of_cells, starts, graph->near);
    for (int64_t i = 0; result >= 0 && i <= n; i++) {
        graph->starts[i] = starts[i];
    }
    return result;
}

static int64_t code_cells(reel_range_coder *coder, reel_arena arena, const cell_order *order) {
    item_graph graph;
    int64_t result = find_cell_graph(&arena, order, true, &graph);
    return result < 0 ? result : code_items(coder, arena, &graph, order->cell_sequence);
}

/* Name vertices by their first use in the cells in original order, unused ones last: `nodes`
   receives the nodes of the cells in new names. `starts` is scratch for n_cells + 1 numbers. */
static void name_nodes(const cell_order *order, vertex_names *names, int32_t *starts,
                       int32_t *nodes) {
    starts[0] = 0;
    for (int64_t i = 0; i < order->n_cells; i++) {
        starts[i + 1] = starts[i] + (int32_t)reel_cell_size(order->types[i]);
    }
    for (int64_t i = 0; i < order->n_cells; i++) {
        int32_t cell = order->cell_sequence[i];
        for (int32_t k = starts[cell]; k < starts[cell + 1]; k++) {
            nodes[k] = name_vertex(names, order->nodes[k]);
        }
    }
    name_unused(names);
}

static int64_t code_cell_vertices(reel_range_coder *coder, reel_arena arena,
                                  const cell_order *order) {
    cell_order named = *order;
    item_graph graph;
    vertex_names names = start_names(&arena, order->n_verts);
    int32_t *nodes = reel_allocate(&arena, (size_t)order->n_nodes, sizeof *nodes);
    reel_arena scratch = arena;
    int32_t *starts = reel_allocate(&scratch, (size_t)order->n_cells + 1, sizeof *starts);
    if (scratch.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    name_nodes(order, &names, starts, nodes);
    named.nodes = nodes;
    int64_t result = find_cell_graph(&arena, &named, false, &graph);
    return result < 0 ? result
                      : code_named(coder, arena, &graph, &names, order->vertex_sequence);
}

static int64_t code_cell_order(reel_range_coder *coder, void *memory, size_t memory_size,
                               const cell_order *order) {
    int64_t result = code_cells(coder, reel_arena_of(memory, memory_size), order);
    if (result >= 0) {
        result = code_cell_vertices(coder, reel_arena_of(memory, memory_size), order);
    }
    return result < 0 ? result : reel_finish(coder);
}

size_t reel_cells_order_memory(int64_t n_cells, int64_t n_nodes, int64_t n_verts) {
    const cell_order order = {.n_cells = n_cells, .n_nodes = n_nodes, .n_verts = n_verts};
    size_t most = 0;
    for (int of_cells = 0; of_cells < 2; of_cells++) {
        int64_t n = of_cells ? n_cells : n_verts;
        size_t graph = graph_bytes(n, most_neighbors(&order, of_cells));
        size_t adjacency =
            reel_array_bytes((size_t)n + 1, sizeof(int32_t)) +
            reel_array_bytes(reel_cells_adjacency_memory(n_cells, n_nodes, n_verts, of_cells), 1);
        size_t coder = item_coder_bytes(n);
        size_t size = graph + (adjacency > coder ? adjacency : coder);
        most = most > size ? most : size;
    }
    return most + names_bytes(n_verts) + reel_array_bytes((size_t)n_nodes, sizeof(int32_t)) +
           reel_array_bytes((size_t)n_cells + 1, sizeof(int32_t));
}

int64_t reel_cells_order_encode(void *memory, size_t memory_size, const uint8_t *types,
                                int64_t n_cells, const int32_t *nodes, int64_t n_nodes,
                                int64_t n_verts, int32_t *cell_sequence, int32_t *vertex_sequence,
                                uint8_t *out, size_t capacity) {
    cell_order order = {types, nodes, n_cells, n_nodes, n_verts, cell_sequence, vertex_sequence};
    reel_range_coder coder = reel_start_encoder(out, capacity);
    return code_cell_order(&coder, memory, memory_size, &order);
}

int64_t reel_cells_order_decode(void *memory, size_t memory_size, const uint8_t *in, size_t size,
                                const uint8_t *types, int64_t n_cells, const int32_t *nodes,
                                int64_t n_nodes, int64_t n_verts, int32_t *cell_sequence,
                                int32_t *vertex_sequence) {
    cell_order order = {types, nodes, n_cells, n_nodes, n_verts, cell_sequence, vertex_sequence};
    reel_range_coder coder = reel_start_decoder(in, size);
    return code_cell_order(&coder, memory, memory_size, &order);
}
