/* From which rows of a table each other is expected where faces say which rows are near.

   docs/format.md, "Along the faces". Faces are gone through across their sides; a row that is new
   is expected at the parallelograms of faces around it whose other rows have come, as many as there
   are. Sides that lead to rows with many of them go first. */

#include "base.h"

#define MOST_TRIPLES 8
#define MOST_AROUND 32 /* corners that are looked at around a row */
#define RANKS 4        /* of sides: by how many parallelograms expect the row behind them */

typedef struct {
    const int32_t *faces; /* rows of the corners */
    const int32_t *twins; /* of sides */
    int64_t n_rows, n_faces;
    int32_t *order, *triples;
    int64_t *starts;
    int64_t n_known, n_triples;
    bool *known, *visited;      /* rows; faces */
    int64_t *firsts;            /* where the corners of each row begin */
    int32_t *corners;           /* by row */
    int32_t *below, top[RANKS]; /* stacks of sides to cross, as linked lists */
} walk;

static int32_t turned(int32_t corner, int by) { return corner / 3 * 3 + (corner % 3 + by) % 3; }

static size_t walk_room(int64_t n_rows, int64_t n_faces) {
    size_t rows = (size_t)n_rows, faces = (size_t)n_faces;
    return reel_room(rows, sizeof(bool)) + reel_room(faces, sizeof(bool)) +
           reel_room(rows + 2, sizeof(int64_t)) + 2 * reel_room(3 * faces, sizeof(int32_t));
}

static void find_corners(walk *at) {
    int64_t *firsts = at->firsts;
    reel_zero(firsts, ((size_t)at->n_rows + 2) * sizeof *firsts);
    for (int64_t i = 0; i < 3 * at->n_faces; i++) {
        firsts[at->faces[i] + 2]++;
    }
    for (int64_t i = 0; i < at->n_rows; i++) {
        firsts[i + 2] += firsts[i + 1];
    }
    for (int64_t i = 0; i < 3 * at->n_faces; i++) {
        at->corners[firsts[at->faces[i] + 1]++] = (int32_t)i;
    }
}

static bool start_walk(walk *at, reel_arena *arena) {
    size_t rows = (size_t)at->n_rows, faces = (size_t)at->n_faces;
    at->known = reel_take(arena, rows, sizeof(bool));
    at->visited = reel_take(arena, faces, sizeof(bool));
    at->firsts = reel_take(arena, rows + 2, sizeof(int64_t));
    at->corners = reel_take(arena, 3 * faces, sizeof(int32_t));
    at->below = reel_take(arena, 3 * faces, sizeof(int32_t));
    if (arena->failed) {
        return false;
    }
    reel_zero(at->known, rows * sizeof(bool));
    reel_zero(at->visited, faces * sizeof(bool));
    find_corners(at);
    for (int i = 0; i < RANKS; i++) {
        at->top[i] = -1;
    }
    at->starts[0] = 0;
    return true;
}

/* Parallelograms of rows that have come, at the other side of a row; their number. */
static int parallelograms(const walk *at, int32_t row, int32_t *found) {
    int64_t first = at->firsts[row], end = at->firsts[row + 1];
    int n = 0;
    end = end - first > MOST_AROUND ? first + MOST_AROUND : end;
    for (int64_t i = first; i < end && n < MOST_TRIPLES; i++) {
        int32_t side = turned(at->corners[i], 1), twin = at->twins[side];
        int32_t a = at->faces[side], b = at->faces[turned(side, 1)];
        int32_t c = at->faces[turned(twin, 2)];
        if (twin != side && at->known[a] && at->known[b] && at->known[c]) {
            found[3 * n] = a;
            found[3 * n + 1] = b;
            found[3 * n + 2] = c;
            n++;
        }
    }
    return n;
}

/* The next row in the order, which is expected at parallelograms, else as `near` if that is one. */
static void add_row(walk *at, int32_t row, int32_t near) {
    int32_t *triples = at->triples + 3 * at->n_triples;
    int n = parallelograms(at, row, triples);
    if (n == 0 && near >= 0) {
        triples[0] = triples[1] = near;
        triples[2] = -1;
        n = 1;
    }
    at->n_triples += n;
    at->known[row] = true;
    at->order[at->n_known++] = row;
    at->starts[at->n_known] = at->n_triples;
}

static void push_side(walk *at, int32_t side) {
    int32_t twin = at->twins[side], found[3 * MOST_TRIPLES];
    if (twin == side || at->visited[twin / 3]) {
        return;
    }
    int32_t row = at->faces[turned(twin, 2)];
    int rank = at->known[row] ? RANKS - 1 : parallelograms(at, row, found);
    rank = rank < RANKS - 1 ? rank : RANKS - 1;
    at->below[side] = at->top[rank];
    at->top[rank] = side;
}

/* The side to cross next, or -1. */
static int32_t pop_side(walk *at) {
    for (int rank = RANKS - 1; rank >= 0; rank--) {
        int32_t side = at->top[rank];
        if (side >= 0) {
            at->top[rank] = at->below[side];
            return side;
        }
    }
    return -1;
}

/* Faces that are reached from one, across sides. */
static void walk_from(walk *at, int32_t face) {
    at->visited[face] = true;
    for (int i = 0; i < 3; i++) {
        int32_t row = at->faces[3 * face + i];
        int32_t last = at->n_known ? at->order[at->n_known - 1] : -1;
        if (!at->known[row]) {
            add_row(at, row, i > 0 ? at->faces[3 * face + i - 1] : last);
        }
    }
    for (int i = 0; i < 3; i++) {
        push_side(at, 3 * face + i);
    }
    for (int32_t side = pop_side(at); side >= 0; side = pop_side(at)) {
        int32_t twin = at->twins[side], row = at->faces[turned(twin, 2)];
        if (at->visited[twin / 3]) {
            continue;
        }
        at->visited[twin / 3] = true;
        if (!at->known[row]) {
            add_row(at, row, at->faces[twin]);
        }
        push_side(at, turned(twin, 1));
        push_side(at, turned(twin, 2));
    }
}

size_t reel_expected_memory(int64_t n_rows, int64_t n_faces) { return walk_room(n_rows, n_faces); }

int64_t reel_expected_find(void *memory, size_t memory_size, const int32_t *faces,
                           const int32_t *twins, int64_t n_rows, int64_t n_faces, int32_t *order,
                           int64_t *starts, int32_t *triples) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    walk at = {.faces = faces, .twins = twins, .n_rows = n_rows, .n_faces = n_faces,
               .order = order, .triples = triples, .starts = starts};
    if (!start_walk(&at, &arena)) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t i = 0; i < n_faces; i++) {
        if (!at.visited[i]) {
            walk_from(&at, (int32_t)i);
        }
    }
    for (int32_t i = 0; i < n_rows; i++) {
        if (!at.known[i]) {
            add_row(&at, i, i - 1);
        }
    }
    return at.n_triples;
}
