/* Coding of the original order of faces and vertices, relative to the internal order of the
   connectivity.

   docs/format.md, "ORDER". Face lists follow the mesh: the next face is usually near the last two,
   or across an open side of an earlier face. Open sides are kept in the order in which they opened,
   because lists that sweep over the mesh close them in about that order. Vertices are coded
   likewise; they also follow the order in which the faces first use them. */

#include "integers.h"
#include "ranks.h"

#define N_VERTEX_WAYS 7 /* ways in which a vertex is coded */
#define OPEN 5          /* 0: the next vertex; 1..4: a neighbor; OPEN: across an open edge */
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
    reel_model next[N_VERTEX_WAYS][N_VERTEX_WAYS][2];
    reel_model near[5][N_VERTEX_WAYS][N_VERTEX_WAYS];
    reel_model open[N_VERTEX_WAYS];
    leap_model leap, leap_any;
    int last_ways[2];
} vertex_models;

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

/* ---- vertices ---- */

typedef struct {
    vertex_models *models;
    reel_ranks uncoded;
    reel_ranks open;    /* opening times of uncoded vertices with a coded neighbor */
    int32_t *opened_at; /* opening time of each vertex, or -1 */
    int32_t *vertex_at; /* vertex that opened at each time */
    /* Where the neighbors of each vertex begin; listed face by face, with repetitions. */
    int64_t *starts;
    int32_t *neighbours;
    int32_t clock;
    int64_t last_open, last_any;
} vertex_state;

static size_t vertex_coder_bytes(int64_t n_verts, int64_t n_faces) {
    size_t verts = (size_t)n_verts;
    return reel_array_bytes(1, sizeof(vertex_models)) + 2 * reel_ranks_bytes(n_verts) +
           2 * reel_array_bytes(verts, sizeof(int32_t)) +
           reel_array_bytes(verts + 2, sizeof(int64_t)) +
           reel_array_bytes(6 * (size_t)n_faces, sizeof(int32_t));
}

static void find_neighbours(vertex_state *state, const mesh_order *mesh) {
    int64_t *starts = state->starts;
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
        state->neighbours[(*end)++] = mesh->faces[face + (i + 1) % 3];
        state->neighbours[(*end)++] = mesh->faces[face + (i + 2) % 3];
    }
}

static vertex_state start_vertex_coder(reel_arena *arena, const mesh_order *mesh) {
    size_t verts = (size_t)mesh->n_verts;
    vertex_state state = {.models = reel_allocate(arena, 1, sizeof(vertex_models))};
    state.uncoded = reel_ranks_of(arena, mesh->n_verts, true);
    state.open = reel_ranks_of(arena, mesh->n_verts, false);
    state.opened_at = reel_allocate(arena, verts, sizeof(int32_t));
    state.vertex_at = reel_allocate(arena, verts, sizeof(int32_t));
    state.starts = reel_allocate(arena, verts + 2, sizeof(int64_t));
    state.neighbours = reel_allocate(arena, 6 * (size_t)mesh->n_faces, sizeof(int32_t));
    if (arena->failed) {
        return state;
    }
    for (size_t i = 0; i < verts; i++) {
        state.opened_at[i] = -1;
    }
    find_neighbours(&state, mesh);
    vertex_models *models = state.models;
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
static int near_vertices(const vertex_state *state, int32_t last, int32_t next, int32_t *result) {
    int n = 0;
    for (int64_t i = state->starts[last]; i < state->starts[last + 1] && n < MAX_NEIGHBORS; i++) {
        int32_t here = state->neighbours[i];
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

/* Code whether the next vertex follows the last or is a neighbor of it. Returns it, or -1; `way` is
   how it was found. */
static int32_t code_near_vertex(reel_range_coder *coder, vertex_state *state, int64_t n_verts,
                                int32_t last, int32_t target, int *way) {
    vertex_models *models = state->models;
    int h = models->last_ways[0], g = models->last_ways[1];
    int32_t next = last + 1;
    if (next >= n_verts || !reel_ranks_has(&state->uncoded, next)) {
        next = -1;
    } else {
        *way = 0;
        if (reel_bit(coder, &models->next[h][g][state->opened_at[next] >= 0], target == next)) {
            return next;
        }
    }
    int32_t result[MAX_NEIGHBORS];
    int n = last < 0 ? 0 : near_vertices(state, last, next, result);
    for (int i = 0; i < n; i++) {
        reel_model *model =
            &models->near[i < 4 ? i : 4][n < N_VERTEX_WAYS ? n - 1 : N_VERTEX_WAYS - 1][h];
        if (reel_bit(coder, model, target == result[i])) {
            *way = 1 + (i < 4 ? i : 3);
            return result[i];
        }
    }
    return -1;
}

static int32_t code_far_vertex(reel_range_coder *coder, vertex_state *state, int32_t target,
                               int *way) {
    vertex_models *models = state->models;
    int64_t time = reel_is_encoder(coder) ? state->opened_at[target] : -1, result;
    if (state->open.size && reel_bit(coder, &models->open[models->last_ways[0]], time >= 0)) {
        *way = OPEN;
        result = code_leap(coder, &models->leap, &state->open, state->last_open, time);
        state->last_open = result;
        return state->vertex_at[result];
    }
    *way = ANY;
    result = code_leap(coder, &models->leap_any, &state->uncoded, state->last_any, target);
    state->last_any = result;
    return (int32_t)result;
}

/* Mark a vertex as coded: it closes, its neighbors open. */
static void mark_vertex_coded(vertex_state *state, int32_t vertex) {
    reel_ranks_change(&state->uncoded, vertex, -1);
    if (state->opened_at[vertex] >= 0) {
        reel_ranks_change(&state->open, state->opened_at[vertex], -1);
    }
    for (int64_t i = state->starts[vertex]; i < state->starts[vertex + 1]; i++) {
        int32_t here = state->neighbours[i];
        if (state->opened_at[here] < 0 && reel_ranks_has(&state->uncoded, here)) {
            state->opened_at[here] = state->clock;
            state->vertex_at[state->clock] = here;
            reel_ranks_change(&state->open, state->clock++, 1);
        }
    }
}

static int64_t code_vertices(reel_range_coder *coder, reel_arena *arena, const mesh_order *mesh) {
    vertex_state state = start_vertex_coder(arena, mesh);
    if (arena->failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    int32_t last = -1;
    for (int64_t i = 0; i < mesh->n_verts; i++) {
        int32_t target = reel_is_encoder(coder) ? mesh->sequence[i] : -1;
        int way;
        int32_t result = code_near_vertex(coder, &state, mesh->n_verts, last, target, &way);
        if (result < 0) {
            result = code_far_vertex(coder, &state, target, &way);
        }
        mesh->sequence[i] = last = result;
        mark_vertex_coded(&state, result);
        state.models->last_ways[1] = state.models->last_ways[0];
        state.models->last_ways[0] = way;
    }
    return 0;
}

/* ---- both ---- */

/* Rename vertices by their first use in the coded faces, unused ones last: `faces` receives the
   faces in new names, `vertex_of` the vertex of each name, `name_of` the name of each vertex. */
static void name_vertices(const mesh_order *mesh, int32_t *faces, int32_t *name_of,
                          int32_t *vertex_of) {
    int32_t clock = 0;
    for (int64_t i = 0; i < mesh->n_verts; i++) {
        name_of[i] = -1;
    }
    for (int64_t i = 0; i < 3 * mesh->n_faces; i++) {
        int32_t vertex = mesh->faces[side_of(mesh->corners[i / 3], (int)(i % 3))];
        if (name_of[vertex] < 0) {
            vertex_of[clock] = vertex;
            name_of[vertex] = clock++;
        }
        faces[i] = name_of[vertex];
    }
    for (int32_t i = 0; i < mesh->n_verts; i++) {
        if (name_of[i] < 0) {
            vertex_of[clock] = i;
            name_of[i] = clock++;
        }
    }
}

static void rename_vertices(int32_t *vertices, int64_t n, const int32_t *names) {
    for (int64_t i = 0; i < n; i++) {
        vertices[i] = names[vertices[i]];
    }
}

static int64_t code_order(reel_range_coder *coder, reel_arena arena, const mesh_order *mesh,
                          bool with_faces) {
    if (!with_faces) {
        int64_t failed = code_vertices(coder, &arena, mesh);
        return failed ? failed : reel_finish(coder);
    }
    size_t verts = (size_t)mesh->n_verts;
    mesh_order named = *mesh;
    int32_t *faces = reel_allocate(&arena, 3 * (size_t)mesh->n_faces, sizeof *faces);
    int32_t *name_of = reel_allocate(&arena, verts, sizeof *name_of);
    int32_t *vertex_of = reel_allocate(&arena, verts, sizeof *vertex_of);
    reel_arena for_faces = arena; /* memory of the faces is reused for the vertices */
    int64_t failed = arena.failed ? 0 : code_faces(coder, &for_faces, mesh);
    if (arena.failed || failed) {
        return failed ? failed : reel_failure(REEL_NO_MEMORY, 0);
    }
    name_vertices(mesh, faces, name_of, vertex_of);
    named.faces = faces;
    if (reel_is_encoder(coder)) {
        rename_vertices(mesh->sequence, mesh->n_verts, name_of);
    }
    failed = code_vertices(coder, &arena, &named);
    if (failed) {
        return failed;
    }
    rename_vertices(mesh->sequence, mesh->n_verts, vertex_of);
    return reel_finish(coder);
}

size_t reel_order_memory(int64_t n_verts, int64_t n_faces) {
    size_t faces = face_coder_bytes(n_faces), verts = vertex_coder_bytes(n_verts, n_faces);
    return (faces > verts ? faces : verts) +
           reel_array_bytes(3 * (size_t)n_faces, sizeof(int32_t)) +
           2 * reel_array_bytes((size_t)n_verts, sizeof(int32_t));
}

int64_t reel_order_encode(void *memory, size_t memory_size, const int32_t *faces,
                          const int32_t *twins, int64_t n_verts, int64_t n_faces,
                          int64_t with_faces, int32_t *corners, int32_t *sequence, uint8_t *out,
                          size_t capacity) {
    mesh_order mesh = {faces, twins, n_verts, n_faces, corners, sequence};
    reel_range_coder coder = reel_start_encoder(out, capacity);
    return code_order(&coder, reel_arena_of(memory, memory_size), &mesh, with_faces != 0);
}

int64_t reel_order_decode(void *memory, size_t memory_size, const uint8_t *in, size_t size,
                          const int32_t *faces, const int32_t *twins, int64_t n_verts,
                          int64_t n_faces, int64_t with_faces, int32_t *corners,
                          int32_t *sequence) {
    mesh_order mesh = {faces, twins, n_verts, n_faces, corners, sequence};
    reel_range_coder coder = reel_start_decoder(in, size);
    return code_order(&coder, reel_arena_of(memory, memory_size), &mesh, with_faces != 0);
}
