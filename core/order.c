/* The order in which faces and vertices were given, for a mesh that is known without it.

   docs/format.md, "ORDER". Lists run along the mesh: the next face is near the last two, or across
   a side that is open since some face was listed. Open sides are in the order in which they opened,
   for lists that sweep over the mesh close them in this order, more or less. So it is with
   vertices, which also follow the first use that faces make of them. */

#include "integers.h"
#include "ranks.h"

#define CHOICES 7 /* how a vertex is found */
#define OPEN 5    /* 0: the next vertex; 1..4: a neighbour; across an open edge */
#define ANY 6
#define FAR 18 /* how a face is found; 0..5: across a side; 6..17: across two; and all else */
#define LEAPS 10 /* lengths of leaps that are told apart */
#define MOST_NEIGHBOURS 16

typedef struct {
    reel_integer_model all;
    reel_integer_model by_last[LEAPS];
    int32_t last;
} leap_model;

typedef struct {
    reel_model is_near[FAR + 1];
    reel_model is_near_within[FAR + 1][FAR + 1];
    reel_model near[FAR][FAR + 1];
    reel_model near_within[FAR][FAR + 1][FAR + 1];
    reel_model turn[FAR + 2][3];
    reel_model turn_within[FAR + 2][FAR + 1][3][3];
    reel_model open[FAR + 1];
    leap_model leap, any;
    int before[2]; /* how the last face was found, and the one before it */
    int turned;    /* and how the last is turned */
} face_models;

typedef struct {
    reel_model next[CHOICES][CHOICES][2];
    reel_model near[5][CHOICES][CHOICES];
    reel_model open[CHOICES];
    leap_model leap, any;
    int before[2];
} vertex_models;

typedef struct {
    const int32_t *faces;
    const int32_t *twins;
    int64_t n_verts, n_faces;
    int32_t *corners;  /* first corner of each listed face */
    int32_t *sequence; /* vertex of each given number */
} order;

static void fresh(void *models, size_t size) {
    reel_model *model = models;
    for (size_t i = 0; i < size / sizeof *model; i++) {
        model[i] = reel_model_of(32768, 0);
    }
}

static void start_leaps(leap_model *model) {
    reel_start_integers(&model->all);
    reel_zero(model->by_last, sizeof model->by_last);
    model->last = 0;
}

/* A leap among the ranks of a set, which is not empty, from that of `from` to that of `to`; the
   last is next to the first. The number reached. */
static int64_t code_leap(reel_port *port, leap_model *model, const reel_ranks *set, int64_t from,
                         int64_t to) {
    int64_t start = reel_ranks_below(set, from);
    int64_t way = reel_writes(port) ? reel_ranks_below(set, to) - start : 0;
    way += way < -(set->size / 2) ? set->size : way > (set->size - 1) / 2 ? -set->size : 0;
    int32_t leap = (int32_t)way;
    uint32_t size = model->last < 0 ? 0U - (uint32_t)model->last : (uint32_t)model->last;
    int length = reel_length(size), sign = model->last > 0 ? 1 : model->last < 0 ? 2 : 0;
    reel_integer_model *here = &model->by_last[length < LEAPS ? length : LEAPS - 1];
    leap = reel_code_integer_within(port, &model->all, here, sign, leap);
    model->last = leap;
    int64_t rank = (start + leap) % set->size;
    return reel_ranks_at(set, rank < 0 ? rank + set->size : rank);
}

/* ---- faces ---- */

typedef struct {
    face_models *models;
    reel_ranks unlisted; /* faces */
    reel_ranks open;     /* times of open sides: of listed faces, towards others */
    int32_t *time;       /* at which each side opened */
    int32_t *side;       /* that opened at each time */
    int32_t now;
    int64_t place, any; /* the time of the side last crossed by a leap; the face last found anew */
} face_state;

/* The side so many corners (0..2) behind a corner of its face. */
static int32_t side_of(int32_t corner, int by) {
    return corner + by - (corner % 3 + by > 2 ? 3 : 0);
}

/* The corner where a side is arrived at from a face, or -1 where there is no unlisted face. */
static int32_t arrival(const order *mesh, const face_state *state, int32_t side) {
    int32_t twin = mesh->twins[side];
    return twin != side && reel_ranks_has(&state->unlisted, twin / 3) ? twin : -1;
}

/* Unlisted faces, without repetition: where each is arrived at, and on which way. They
   are found one by one: most often one of the first is the next face. */
typedef struct {
    int32_t last[2]; /* corners of the last faces, the latest first */
    int next_way, end;
    int32_t first[6]; /* where ways 0..5 arrive, or -1 */
    int n, ways[FAR];
    int32_t arrivals[FAR];
} reached;

static reached start_near(const order *mesh, int64_t listed) {
    reached near = {.end = listed < 2 ? (int)listed * 9 : FAR};
    for (int i = 0; i < 2 && i < listed; i++) {
        near.last[i] = mesh->corners[listed - 1 - i];
    }
    return near;
}

/* Faces next to the last two, then those next to these: whether there is one more. */
static bool find_next(const order *mesh, const face_state *state, reached *near) {
    int n_first = near->end / 3;
    while (near->next_way < near->end) {
        int way = near->next_way++;
        int32_t arrived = -1;
        if (way < n_first) {
            arrived = arrival(mesh, state, side_of(near->last[way / 3], way % 3));
            near->first[way] = arrived;
        } else if (near->first[(way - n_first) / 2] >= 0) {
            int32_t across = near->first[(way - n_first) / 2];
            arrived = arrival(mesh, state, side_of(across, 1 + (way - n_first) % 2));
        }
        bool is_new = arrived >= 0;
        for (int i = 0; is_new && i < near->n; i++) {
            is_new = near->arrivals[i] / 3 != arrived / 3;
        }
        if (is_new) {
            near->arrivals[near->n] = arrived;
            near->ways[near->n++] = way < n_first ? way : way - n_first + 6;
            return true;
        }
    }
    return false;
}

/* Tries the faces near the last two; the corner arrived at, or -1. `way` is what was found. */
static int32_t code_near(reel_port *port, const order *mesh, face_state *state, int64_t listed,
                         int32_t wanted, int *way) {
    face_models *models = state->models;
    reached near = start_near(mesh, listed);
    int before = models->before[0], earlier = models->before[1], found = 0, wants = -1;
    bool is_there = find_next(mesh, state, &near), is_last = false;
    while (reel_writes(port) && wants < 0 && is_there) {
        wants = near.arrivals[near.n - 1] / 3 == wanted ? near.n - 1 : -1;
        is_there = wants >= 0 || find_next(mesh, state, &near);
    }
    *way = FAR;
    if (!near.n || !reel_bit_within(port, &models->is_near[before],
                                    &models->is_near_within[before][earlier], wants >= 0)) {
        return -1;
    }
    for (;; found++) {
        is_last = found + 1 == near.n && !find_next(mesh, state, &near); /* what is left */
        reel_model *all = &models->near[near.ways[found]][before];
        reel_model *here = &models->near_within[near.ways[found]][before][earlier];
        if (is_last || reel_bit_within(port, all, here, found == wants)) {
            break;
        }
    }
    *way = near.ways[found];
    return near.arrivals[found];
}

/* The side through which a face is best reached: that whose rank is nearest to that of the last. */
static int64_t best_time(const order *mesh, const face_state *state, int64_t face) {
    int64_t found = -1, least = 0, here = reel_ranks_below(&state->open, state->place);
    for (int i = 0; i < 3; i++) {
        int32_t twin = mesh->twins[3 * face + i];
        if (state->time[twin] < 0 || twin == 3 * face + i) {
            continue;
        }
        int64_t far = reel_ranks_below(&state->open, state->time[twin]) - here;
        far = far < 0 ? -far : far;
        if (found < 0 || far < least) {
            found = state->time[twin];
            least = far;
        }
    }
    return found;
}

/* The corner arrived at across an open side, or -1 - a face found anew. */
static int32_t code_far(reel_port *port, const order *mesh, face_state *state, int64_t wanted) {
    face_models *models = state->models;
    int64_t time = reel_writes(port) ? best_time(mesh, state, wanted) : -1;
    if (state->open.size && reel_bit(port, &models->open[models->before[0]], time >= 0)) {
        time = code_leap(port, &models->leap, &state->open, state->place, time);
        state->place = time;
        return mesh->twins[state->side[time]];
    }
    int64_t face = code_leap(port, &models->any, &state->unlisted, state->any, wanted);
    state->any = face;
    return -1 - (int32_t)face;
}

static int code_turn(reel_port *port, face_models *models, int way, int turn) {
    int before = models->before[0], turned = models->turned;
    reel_model *all = models->turn[way], *here = models->turn_within[way][before][turned];
    if (!reel_bit_within(port, &all[0], &here[0], turn > 0)) {
        return 0;
    }
    return 1 + reel_bit_within(port, &all[1], &here[1], turn > 1);
}

/* A face is listed: sides towards it close, its own open. */
static void list_face(const order *mesh, face_state *state, int32_t corner) {
    int32_t face = corner / 3;
    reel_ranks_change(&state->unlisted, face, -1);
    for (int i = 0; i < 3; i++) {
        int32_t side = side_of(corner, i), twin = mesh->twins[side];
        if (twin != side && state->time[twin] >= 0) {
            reel_ranks_change(&state->open, state->time[twin], -1);
            state->time[twin] = -1;
        }
    }
    for (int i = 0; i < 3; i++) {
        int32_t side = side_of(corner, i);
        if (arrival(mesh, state, side) >= 0) {
            state->time[side] = state->now;
            state->side[state->now] = side;
            reel_ranks_change(&state->open, state->now++, 1);
        }
    }
}

static size_t face_room(int64_t n_faces) {
    return reel_room(1, sizeof(face_models)) + reel_ranks_room(n_faces) +
           reel_ranks_room(3 * n_faces) + 2 * reel_room((size_t)(3 * n_faces), sizeof(int32_t));
}

static face_state start_faces(reel_arena *arena, const order *mesh) {
    int64_t n_sides = 3 * mesh->n_faces;
    face_state state = {.models = reel_take(arena, 1, sizeof(face_models))};
    state.unlisted = reel_ranks_of(arena, mesh->n_faces, true);
    state.open = reel_ranks_of(arena, n_sides, false);
    state.time = reel_take(arena, (size_t)n_sides, sizeof(int32_t));
    state.side = reel_take(arena, (size_t)n_sides, sizeof(int32_t));
    if (arena->failed) {
        return state;
    }
    for (int64_t i = 0; i < n_sides; i++) {
        state.time[i] = -1;
    }
    face_models *models = state.models;
    reel_zero(models, sizeof *models);
    fresh(models->is_near, sizeof models->is_near);
    fresh(models->near, sizeof models->near);
    fresh(models->turn, sizeof models->turn);
    fresh(models->open, sizeof models->open);
    start_leaps(&models->leap);
    start_leaps(&models->any);
    models->before[0] = models->before[1] = FAR;
    return state;
}

static int64_t code_faces(reel_port *port, reel_arena *arena, const order *mesh) {
    face_state state = start_faces(arena, mesh);
    if (arena->failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t i = 0; i < mesh->n_faces; i++) {
        int32_t wanted = reel_writes(port) ? mesh->corners[i] : 0;
        int way;
        int32_t arrived = code_near(port, mesh, &state, i, wanted / 3, &way);
        if (arrived < 0) {
            arrived = code_far(port, mesh, &state, wanted / 3);
        }
        bool anew = arrived < 0;
        arrived = anew ? 3 * (-1 - arrived) : arrived;
        int turn = (int)((uint32_t)(wanted - arrived + 3) % 3);
        turn = code_turn(port, state.models, anew ? FAR + 1 : way, turn);
        mesh->corners[i] = side_of(arrived, turn);
        list_face(mesh, &state, mesh->corners[i]);
        state.models->before[1] = state.models->before[0];
        state.models->before[0] = way;
        state.models->turned = turn;
    }
    return 0;
}

/* ---- vertices ---- */

typedef struct {
    vertex_models *models;
    reel_ranks unnumbered;
    reel_ranks open; /* times of vertices without a number that have a neighbour with one */
    int32_t *time;   /* at which each vertex opened */
    int32_t *opened; /* the vertex that opened at each time */
    int64_t *starts; /* of the neighbours of each vertex, in the order of the faces, repeated */
    int32_t *neighbours;
    int32_t now;
    int64_t place, any;
} vertex_state;

static size_t vertex_room(int64_t n_verts, int64_t n_faces) {
    size_t verts = (size_t)n_verts;
    return reel_room(1, sizeof(vertex_models)) + 2 * reel_ranks_room(n_verts) +
           2 * reel_room(verts, sizeof(int32_t)) + reel_room(verts + 2, sizeof(int64_t)) +
           reel_room(6 * (size_t)n_faces, sizeof(int32_t));
}

static void find_neighbours(vertex_state *state, const order *mesh) {
    int64_t *starts = state->starts;
    reel_zero(starts, ((size_t)mesh->n_verts + 2) * sizeof *starts);
    for (int64_t i = 0; i < 3 * mesh->n_faces; i++) {
        starts[mesh->faces[i] + 2] += 2;
    }
    for (int64_t i = 0; i < mesh->n_verts; i++) {
        starts[i + 2] += starts[i + 1];
    }
    for (int64_t i = 0; i < 3 * mesh->n_faces; i++) { /* starts[v + 1] runs to the end of v's */
        int64_t face = i / 3 * 3, *end = &starts[mesh->faces[i] + 1];
        state->neighbours[(*end)++] = mesh->faces[face + (i + 1) % 3];
        state->neighbours[(*end)++] = mesh->faces[face + (i + 2) % 3];
    }
}

static vertex_state start_vertices(reel_arena *arena, const order *mesh) {
    size_t verts = (size_t)mesh->n_verts;
    vertex_state state = {.models = reel_take(arena, 1, sizeof(vertex_models))};
    state.unnumbered = reel_ranks_of(arena, mesh->n_verts, true);
    state.open = reel_ranks_of(arena, mesh->n_verts, false);
    state.time = reel_take(arena, verts, sizeof(int32_t));
    state.opened = reel_take(arena, verts, sizeof(int32_t));
    state.starts = reel_take(arena, verts + 2, sizeof(int64_t));
    state.neighbours = reel_take(arena, 6 * (size_t)mesh->n_faces, sizeof(int32_t));
    if (arena->failed) {
        return state;
    }
    for (size_t i = 0; i < verts; i++) {
        state.time[i] = -1;
    }
    find_neighbours(&state, mesh);
    vertex_models *models = state.models;
    fresh(models->next, sizeof models->next);
    fresh(models->near, sizeof models->near);
    fresh(models->open, sizeof models->open);
    start_leaps(&models->leap);
    start_leaps(&models->any);
    models->before[0] = models->before[1] = ANY;
    return state;
}

/* Up to 16 different neighbours without a number, but not `next`, as they opened; their number. */
static int near_vertices(const vertex_state *state, int32_t last, int32_t next, int32_t *found) {
    int n = 0;
    for (int64_t i = state->starts[last]; i < state->starts[last + 1] && n < MOST_NEIGHBOURS; i++) {
        int32_t here = state->neighbours[i];
        int place = n;
        if (here == next || !reel_ranks_has(&state->unnumbered, here)) {
            continue;
        }
        while (place > 0 && state->time[found[place - 1]] > state->time[here]) {
            place--;
        }
        if (place > 0 && found[place - 1] == here) {
            continue;
        }
        for (int j = n++; j > place; j--) {
            found[j] = found[j - 1];
        }
        found[place] = here;
    }
    return n;
}

/* Tries the vertex behind the last and its neighbours; the one found, or -1. `way` is how. */
static int32_t code_near_vertex(reel_port *port, vertex_state *state, int64_t n_verts, int32_t last,
                                int32_t wanted, int *way) {
    vertex_models *models = state->models;
    int h = models->before[0], g = models->before[1];
    int32_t next = last + 1;
    if (next >= n_verts || !reel_ranks_has(&state->unnumbered, next)) {
        next = -1;
    } else {
        *way = 0;
        if (reel_bit(port, &models->next[h][g][state->time[next] >= 0], wanted == next)) {
            return next;
        }
    }
    int32_t found[MOST_NEIGHBOURS];
    int n = last < 0 ? 0 : near_vertices(state, last, next, found);
    for (int i = 0; i < n; i++) {
        reel_model *model = &models->near[i < 4 ? i : 4][n < CHOICES ? n - 1 : CHOICES - 1][h];
        if (reel_bit(port, model, wanted == found[i])) {
            *way = 1 + (i < 4 ? i : 3);
            return found[i];
        }
    }
    return -1;
}

static int32_t code_far_vertex(reel_port *port, vertex_state *state, int32_t wanted, int *way) {
    vertex_models *models = state->models;
    int64_t time = reel_writes(port) ? state->time[wanted] : -1, found;
    if (state->open.size && reel_bit(port, &models->open[models->before[0]], time >= 0)) {
        *way = OPEN;
        found = code_leap(port, &models->leap, &state->open, state->place, time);
        state->place = found;
        return state->opened[found];
    }
    *way = ANY;
    found = code_leap(port, &models->any, &state->unnumbered, state->any, wanted);
    state->any = found;
    return (int32_t)found;
}

/* A vertex has its number: it is open no more, its neighbours are. */
static void number_vertex(vertex_state *state, int32_t vertex) {
    reel_ranks_change(&state->unnumbered, vertex, -1);
    if (state->time[vertex] >= 0) {
        reel_ranks_change(&state->open, state->time[vertex], -1);
    }
    for (int64_t i = state->starts[vertex]; i < state->starts[vertex + 1]; i++) {
        int32_t here = state->neighbours[i];
        if (state->time[here] < 0 && reel_ranks_has(&state->unnumbered, here)) {
            state->time[here] = state->now;
            state->opened[state->now] = here;
            reel_ranks_change(&state->open, state->now++, 1);
        }
    }
}

static int64_t code_vertices(reel_port *port, reel_arena *arena, const order *mesh) {
    vertex_state state = start_vertices(arena, mesh);
    if (arena->failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    int32_t last = -1;
    for (int64_t i = 0; i < mesh->n_verts; i++) {
        int32_t wanted = reel_writes(port) ? mesh->sequence[i] : -1;
        int way;
        int32_t found = code_near_vertex(port, &state, mesh->n_verts, last, wanted, &way);
        if (found < 0) {
            found = code_far_vertex(port, &state, wanted, &way);
        }
        mesh->sequence[i] = last = found;
        number_vertex(&state, found);
        state.models->before[1] = state.models->before[0];
        state.models->before[0] = way;
    }
    return 0;
}

/* ---- both ---- */

/* Names the vertices by their first use in the listed faces, then those without, ascending: the
   faces in these names; `vertex_of` has the vertex of each name, `name_of` the name of each. */
static void name_vertices(const order *mesh, int32_t *faces, int32_t *name_of, int32_t *vertex_of) {
    int32_t now = 0;
    for (int64_t i = 0; i < mesh->n_verts; i++) {
        name_of[i] = -1;
    }
    for (int64_t i = 0; i < 3 * mesh->n_faces; i++) {
        int32_t vertex = mesh->faces[side_of(mesh->corners[i / 3], (int)(i % 3))];
        if (name_of[vertex] < 0) {
            vertex_of[now] = vertex;
            name_of[vertex] = now++;
        }
        faces[i] = name_of[vertex];
    }
    for (int32_t i = 0; i < mesh->n_verts; i++) {
        if (name_of[i] < 0) {
            vertex_of[now] = i;
            name_of[i] = now++;
        }
    }
}

static void rename_all(int32_t *vertices, int64_t n, const int32_t *names) {
    for (int64_t i = 0; i < n; i++) {
        vertices[i] = names[vertices[i]];
    }
}

static int64_t code_order(reel_port *port, reel_arena arena, const order *mesh, bool with_faces) {
    if (!with_faces) {
        int64_t failed = code_vertices(port, &arena, mesh);
        return failed ? failed : reel_end(port);
    }
    size_t verts = (size_t)mesh->n_verts;
    order named = *mesh;
    int32_t *faces = reel_take(&arena, 3 * (size_t)mesh->n_faces, sizeof *faces);
    int32_t *name_of = reel_take(&arena, verts, sizeof *name_of);
    int32_t *vertex_of = reel_take(&arena, verts, sizeof *vertex_of);
    reel_arena for_faces = arena; /* what faces need is free again behind them */
    int64_t failed = arena.failed ? 0 : code_faces(port, &for_faces, mesh);
    if (arena.failed || failed) {
        return failed ? failed : reel_failure(REEL_NO_MEMORY, 0);
    }
    name_vertices(mesh, faces, name_of, vertex_of);
    named.faces = faces;
    if (reel_writes(port)) {
        rename_all(mesh->sequence, mesh->n_verts, name_of);
    }
    failed = code_vertices(port, &arena, &named);
    if (failed) {
        return failed;
    }
    rename_all(mesh->sequence, mesh->n_verts, vertex_of);
    return reel_end(port);
}

size_t reel_order_memory(int64_t n_verts, int64_t n_faces) {
    size_t faces = face_room(n_faces), verts = vertex_room(n_verts, n_faces);
    return (faces > verts ? faces : verts) + reel_room(3 * (size_t)n_faces, sizeof(int32_t)) +
           2 * reel_room((size_t)n_verts, sizeof(int32_t));
}

int64_t reel_order_encode(void *memory, size_t memory_size, const int32_t *faces,
                          const int32_t *twins, int64_t n_verts, int64_t n_faces,
                          int64_t with_faces, int32_t *corners, int32_t *sequence, uint8_t *out,
                          size_t room) {
    order mesh = {faces, twins, n_verts, n_faces, corners, sequence};
    reel_port port = reel_writer(out, room);
    return code_order(&port, reel_arena_of(memory, memory_size), &mesh, with_faces != 0);
}

int64_t reel_order_decode(void *memory, size_t memory_size, const uint8_t *in, size_t size,
                          const int32_t *faces, const int32_t *twins, int64_t n_verts,
                          int64_t n_faces, int64_t with_faces, int32_t *corners,
                          int32_t *sequence) {
    order mesh = {faces, twins, n_verts, n_faces, corners, sequence};
    reel_port port = reel_reader(in, size);
    return code_order(&port, reel_arena_of(memory, memory_size), &mesh, with_faces != 0);
}
