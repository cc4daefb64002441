/* Coding of the original order of faces and vertices, relative to the internal order of the
   connectivity.

   docs/format.md, "ORDER". Face lists follow the mesh: the next face is usually near the last two,
   or across an open half-edge of an earlier face. Open half-edges are kept in the order in which
   they opened, because lists that sweep over the mesh close them in about that order. Vertices are
   coded likewise; they also follow the order in which the faces first use them. */

#include "order_items.h"

/* Codes of faces: 0..5: across a half-edge; 6..17: across two half-edges; FAR: all else. */
#define FAR 18

typedef struct {
    reel_model is_near[FAR + 1];
    reel_model is_near_in_context[FAR + 1][FAR + 1];
    reel_model near[FAR][FAR + 1];
    reel_model near_in_context[FAR][FAR + 1][FAR + 1];
    reel_model turn[FAR + 2][3];
    reel_model turn_in_context[FAR + 2][FAR + 1][3][3];
    reel_model open[FAR + 1];
    reel_leap_model leap, leap_any;
    int last_ways[2]; /* ways of the last face, and of the one before it */
    int last_turn;    /* rotation of the last face */
} face_models;

typedef struct {
    const int32_t *faces;
    const int32_t *twins;
    int64_t n_verts, n_faces;
    int32_t *corners;  /* first corner of each coded face */
    int32_t *sequence; /* vertex of each original number */
} mesh_order;

/* ---- faces ---- */

typedef struct {
    face_models *models;
    reel_ranks uncoded; /* faces not yet coded */
    reel_ranks open;    /* opening times of open half-edges: between coded and uncoded faces */
    int32_t *opened_at; /* opening time of each half-edge, or -1 */
    int32_t *half_edge_at;   /* half-edge that opened at each time */
    int32_t clock;
    /* Positions of the last leaps: opening time of the half-edge reached, and face reached. */
    int64_t last_open, last_any;
} face_state;

/* The half-edge `by` corners (0..2) after a corner of its face. */
static int32_t side_of(int32_t corner, int by) {
    return corner + by - (corner % 3 + by > 2 ? 3 : 0);
}

/* The corner at which the face across a half-edge is entered, or -1 if there is no uncoded face. */
static int32_t entry(const mesh_order *mesh, const face_state *state, int32_t he) {
    int32_t twin = mesh->twins[he];
    return twin != he && reel_ranks_has(&state->uncoded, twin / 3) ? twin : -1;
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

static near_faces find_near(const mesh_order *mesh, int64_t n_coded) {
    near_faces near = {.end = n_coded < 2 ? (int)n_coded * 9 : FAR};
    for (int i = 0; i < 2 && i < n_coded; i++) {
        near.last[i] = mesh->corners[n_coded - 1 - i];
    }
    return near;
}

/* Find another face next to the last two, or to one of these; returns false if none is left. */
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
                         int64_t n_coded, int32_t target, int *way) {
    face_models *models = state->models;
    near_faces near = find_near(mesh, n_coded);
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
        reel_model *shared = &models->near[near.ways[index]][last_way];
        reel_model *context = &models->near_in_context[near.ways[index]][last_way][earlier];
        if (is_last || reel_bit_in_context(coder, shared, context, index == target_index)) {
            break;
        }
    }
    *way = near.ways[index];
    return near.entries[index];
}

/* Choose the open half-edge from which to reach a face, of the rank nearest to that of the last. */
static int64_t best_time(const mesh_order *mesh, const face_state *state, int64_t face) {
    int64_t result = -1, min_distance = 0, last = reel_ranks_rank(&state->open, state->last_open);
    for (int i = 0; i < 3; i++) {
        int32_t twin = mesh->twins[3 * face + i];
        if (state->opened_at[twin] < 0 || twin == 3 * face + i) {
            continue;
        }
        int64_t distance = reel_ranks_rank(&state->open, state->opened_at[twin]) - last;
        distance = distance < 0 ? -distance : distance;
        if (result < 0 || distance < min_distance) {
            result = state->opened_at[twin];
            min_distance = distance;
        }
    }
    return result;
}

/* Code a face across an open half-edge, and return the corner entered; or among all: -1 - face. */
static int32_t code_far(reel_range_coder *coder, const mesh_order *mesh, face_state *state,
                        int64_t target) {
    face_models *models = state->models;
    int64_t time = reel_is_encoder(coder) ? best_time(mesh, state, target) : -1;
    if (state->open.size && reel_bit(coder, &models->open[models->last_ways[0]], time >= 0)) {
        time = reel_code_leap(coder, &models->leap, &state->open, state->last_open, time);
        state->last_open = time;
        return mesh->twins[state->half_edge_at[time]];
    }
    int64_t face =
        reel_code_leap(coder, &models->leap_any, &state->uncoded, state->last_any, target);
    state->last_any = face;
    return -1 - (int32_t)face;
}

static int code_turn(reel_range_coder *coder, face_models *models, int way, int turn) {
    int last_way = models->last_ways[0], last_turn = models->last_turn;
    reel_model *shared = models->turn[way],
               *context = models->turn_in_context[way][last_way][last_turn];
    if (!reel_bit_in_context(coder, &shared[0], &context[0], turn > 0)) {
        return 0;
    }
    return 1 + reel_bit_in_context(coder, &shared[1], &context[1], turn > 1);
}

/* Mark a face as coded: half-edges towards it close, its own open. */
static void mark_coded(const mesh_order *mesh, face_state *state, int32_t corner) {
    int32_t face = corner / 3;
    reel_ranks_change(&state->uncoded, face, -1);
    for (int i = 0; i < 3; i++) {
        int32_t he = side_of(corner, i), twin = mesh->twins[he];
        if (twin != he && state->opened_at[twin] >= 0) {
            reel_ranks_change(&state->open, state->opened_at[twin], -1);
            state->opened_at[twin] = -1;
        }
    }
    for (int i = 0; i < 3; i++) {
        int32_t he = side_of(corner, i);
        if (entry(mesh, state, he) >= 0) {
            state->opened_at[he] = state->clock;
            state->half_edge_at[state->clock] = he;
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
    int64_t n_half_edges = 3 * mesh->n_faces;
    face_state state = {.models = reel_allocate(arena, 1, sizeof(face_models))};
    state.uncoded = reel_ranks_of(arena, mesh->n_faces, true);
    state.open = reel_ranks_of(arena, n_half_edges, false);
    state.opened_at = reel_allocate(arena, (size_t)n_half_edges, sizeof(int32_t));
    state.half_edge_at = reel_allocate(arena, (size_t)n_half_edges, sizeof(int32_t));
    if (arena->failed) {
        return state;
    }
    for (int64_t i = 0; i < n_half_edges; i++) {
        state.opened_at[i] = -1;
    }
    face_models *models = state.models;
    reel_zero(models, sizeof *models);
    reel_reset_models(models->is_near, sizeof models->is_near);
    reel_reset_models(models->near, sizeof models->near);
    reel_reset_models(models->turn, sizeof models->turn);
    reel_reset_models(models->open, sizeof models->open);
    reel_reset_leaps(&models->leap);
    reel_reset_leaps(&models->leap_any);
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
        bool is_any = entered < 0;
        entered = is_any ? 3 * (-1 - entered) : entered;
        int turn = (int)((uint32_t)(target - entered + 3) % 3);
        turn = code_turn(coder, state.models, is_any ? FAR + 1 : way, turn);
        mesh->corners[i] = side_of(entered, turn);
        mark_coded(mesh, &state, mesh->corners[i]);
        state.models->last_ways[1] = state.models->last_ways[0];
        state.models->last_ways[0] = way;
        state.models->last_turn = turn;
    }
    return 0;
}

/* ---- vertices ---- */

/* List the neighbors of vertices face by face and corner by corner. */
static void find_neighbors(const reel_item_graph *graph, const int32_t *faces, int64_t n_faces) {
    int64_t *starts = graph->starts;
    reel_zero(starts, ((size_t)graph->n + 2) * sizeof *starts);
    for (int64_t i = 0; i < 3 * n_faces; i++) {
        starts[faces[i] + 2] += 2;
    }
    for (int64_t i = 0; i < graph->n; i++) {
        starts[i + 2] += starts[i + 1];
    }
    for (int64_t i = 0; i < 3 * n_faces; i++) {
        /* the cursor starts[v + 1] ends behind v's list */
        int64_t face = i / 3 * 3, *end = &starts[faces[i] + 1];
        graph->near[(*end)++] = faces[face + (i + 1) % 3];
        graph->near[(*end)++] = faces[face + (i + 2) % 3];
    }
}

/* Code vertices by their first use in the faces if the order of these is known, else by their
   internal numbers. */
static int64_t code_vertices(reel_range_coder *coder, reel_arena arena, const mesh_order *mesh,
                             bool with_faces) {
    reel_vertex_names names = reel_start_names(&arena, mesh->n_verts);
    int32_t *faces = reel_allocate(&arena, 3 * (size_t)mesh->n_faces, sizeof *faces);
    reel_item_graph graph = reel_allocate_item_graph(&arena, mesh->n_verts, 6 * mesh->n_faces);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t i = 0; with_faces && i < 3 * mesh->n_faces; i++) {
        int32_t corner = side_of(mesh->corners[i / 3], (int)(i % 3));
        faces[i] = reel_name_vertex(&names, mesh->faces[corner]);
    }
    reel_name_unused(&names);
    find_neighbors(&graph, with_faces ? faces : mesh->faces, mesh->n_faces);
    return reel_code_named(coder, arena, &graph, &names, mesh->sequence);
}

static int64_t code_order(reel_range_coder *coder, void *memory, size_t memory_size,
                          const mesh_order *mesh, bool with_faces) {
    reel_arena arena = reel_arena_of(memory, memory_size), for_faces = arena;
    int64_t result = with_faces ? code_faces(coder, &for_faces, mesh) : 0;
    if (result >= 0) { /* memory of the faces is reused for the vertices */
        result = code_vertices(coder, arena, mesh, with_faces);
    }
    return result < 0 ? result : reel_finish(coder);
}

size_t reel_order_memory(int64_t n_verts, int64_t n_faces) {
    size_t faces = face_coder_bytes(n_faces);
    size_t verts = reel_vertex_names_bytes(n_verts) +
                   reel_array_bytes(3 * (size_t)n_faces, sizeof(int32_t)) +
                   reel_item_graph_bytes(n_verts, 6 * n_faces) + reel_item_coder_bytes(n_verts);
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
