/* Finds the rows that predict each row of a table, along the faces of the mesh.

   docs/format.md, "Along the faces". Faces are traversed across their half-edges. A new row is
   predicted by the parallelograms of the faces around it whose other rows are coded. Half-edges
   that lead to rows with many parallelograms go first. */

#include "base.h"

#define MAX_TRIPLES 8
#define MAX_CORNERS 32 /* corners of a row that are searched */
/* Priorities of half-edges, by the number of parallelograms that predict the row across. */
#define N_PRIORITIES 4

typedef struct {
    const int32_t *faces; /* row of each corner */
    const int32_t *twins; /* of half-edges */
    int64_t n_rows, n_faces;
    int32_t *order, *triples, *stencils;
    int64_t *starts;
    int64_t n_coded, n_triples;
    bool *is_coded, *is_visited; /* per row; per face */
    int64_t *firsts;             /* start of the corners of each row in `corners` */
    int32_t *corners;            /* corners by row */
    /* Stacks of half-edges to cross, one per priority, as linked lists. */
    int32_t *below, top[N_PRIORITIES];
} traversal;

static int32_t rotated_corner(int32_t corner, int by) {
    return corner / 3 * 3 + (corner % 3 + by) % 3;
}

static size_t traversal_bytes(int64_t n_rows, int64_t n_faces) {
    size_t rows = (size_t)n_rows, faces = (size_t)n_faces;
    return reel_array_bytes(rows, sizeof(bool)) + reel_array_bytes(faces, sizeof(bool)) +
           reel_array_bytes(rows + 2, sizeof(int64_t)) +
           2 * reel_array_bytes(3 * faces, sizeof(int32_t));
}

static void find_corners(traversal *walk) {
    int64_t *firsts = walk->firsts;
    reel_zero(firsts, ((size_t)walk->n_rows + 2) * sizeof *firsts);
    for (int64_t i = 0; i < 3 * walk->n_faces; i++) {
        firsts[walk->faces[i] + 2]++;
    }
    for (int64_t i = 0; i < walk->n_rows; i++) {
        firsts[i + 2] += firsts[i + 1];
    }
    for (int64_t i = 0; i < 3 * walk->n_faces; i++) {
        walk->corners[firsts[walk->faces[i] + 1]++] = (int32_t)i;
    }
}

static bool start_traversal(traversal *walk, reel_arena *arena) {
    size_t rows = (size_t)walk->n_rows, faces = (size_t)walk->n_faces;
    walk->is_coded = reel_allocate(arena, rows, sizeof(bool));
    walk->is_visited = reel_allocate(arena, faces, sizeof(bool));
    walk->firsts = reel_allocate(arena, rows + 2, sizeof(int64_t));
    walk->corners = reel_allocate(arena, 3 * faces, sizeof(int32_t));
    walk->below = reel_allocate(arena, 3 * faces, sizeof(int32_t));
    if (arena->failed) {
        return false;
    }
    reel_zero(walk->is_coded, rows * sizeof(bool));
    reel_zero(walk->is_visited, faces * sizeof(bool));
    find_corners(walk);
    for (int i = 0; i < N_PRIORITIES; i++) {
        walk->top[i] = -1;
    }
    walk->starts[0] = 0;
    return true;
}

/* Find the parallelograms of coded rows opposite to a row; returns their number. */
static int parallelograms(const traversal *walk, int32_t row, int32_t *triples_out) {
    int64_t first = walk->firsts[row], end = walk->firsts[row + 1];
    int n = 0;
    end = end - first > MAX_CORNERS ? first + MAX_CORNERS : end;
    for (int64_t i = first; i < end && n < MAX_TRIPLES; i++) {
        int32_t he = rotated_corner(walk->corners[i], 1), twin = walk->twins[he];
        int32_t a = walk->faces[he], b = walk->faces[rotated_corner(he, 1)];
        int32_t c = walk->faces[rotated_corner(twin, 2)];
        if (twin != he && walk->is_coded[a] && walk->is_coded[b] && walk->is_coded[c]) {
            triples_out[3 * n] = a;
            triples_out[3 * n + 1] = b;
            triples_out[3 * n + 2] = c;
            n++;
        }
    }
    return n;
}

/* Find the nearest coded rows by breadth-first search from a row, through coded rows. */
static void find_stencil(const traversal *walk, int32_t row, int32_t *stencil) {
    int n = 0;
    for (int center = -1; center < n; center++) {
        int32_t from = center < 0 ? row : stencil[center];
        int64_t first = walk->firsts[from], end = walk->firsts[from + 1];
        end = end - first > MAX_CORNERS ? first + MAX_CORNERS : end;
        for (int64_t i = 2 * first; i < 2 * end && n < REEL_MAX_STENCIL; i++) {
            int32_t near = walk->faces[rotated_corner(walk->corners[i / 2], 1 + (int)(i & 1))];
            bool is_new = walk->is_coded[near];
            for (int k = 0; k < n; k++) {
                is_new &= stencil[k] != near;
            }
            stencil[n] = near;
            n += is_new;
        }
    }
    while (n < REEL_MAX_STENCIL) {
        stencil[n++] = -1;
    }
}

/* Append a row to the order, with its parallelograms; without any, row `fallback` predicts it,
   unless that is negative. */
static void add_row(traversal *walk, int32_t row, int32_t fallback) {
    int32_t *triples = walk->triples + 3 * walk->n_triples;
    int n = parallelograms(walk, row, triples);
    if (n == 0 && fallback >= 0) {
        triples[0] = triples[1] = fallback;
        triples[2] = -1;
        n = 1;
    }
    walk->n_triples += n;
    if (walk->stencils) {
        find_stencil(walk, row, walk->stencils + REEL_MAX_STENCIL * (int64_t)row);
    }
    walk->is_coded[row] = true;
    walk->order[walk->n_coded++] = row;
    walk->starts[walk->n_coded] = walk->n_triples;
}

static void push_half_edge(traversal *walk, int32_t he) {
    int32_t twin = walk->twins[he], triples_out[3 * MAX_TRIPLES];
    if (twin == he || walk->is_visited[twin / 3]) {
        return;
    }
    int32_t row = walk->faces[rotated_corner(twin, 2)];
    int priority = walk->is_coded[row] ? N_PRIORITIES - 1 : parallelograms(walk, row, triples_out);
    priority = priority < N_PRIORITIES - 1 ? priority : N_PRIORITIES - 1;
    walk->below[he] = walk->top[priority];
    walk->top[priority] = he;
}

/* Pop the half-edge to cross next, or return -1. */
static int32_t pop_half_edge(traversal *walk) {
    for (int priority = N_PRIORITIES - 1; priority >= 0; priority--) {
        int32_t he = walk->top[priority];
        if (he >= 0) {
            walk->top[priority] = walk->below[he];
            return he;
        }
    }
    return -1;
}

/* Traverse the faces connected to one across half-edges. */
static void traverse_from(traversal *walk, int32_t face) {
    walk->is_visited[face] = true;
    for (int i = 0; i < 3; i++) {
        int32_t row = walk->faces[3 * face + i];
        int32_t last = walk->n_coded ? walk->order[walk->n_coded - 1] : -1;
        if (!walk->is_coded[row]) {
            add_row(walk, row, i > 0 ? walk->faces[3 * face + i - 1] : last);
        }
    }
    for (int i = 0; i < 3; i++) {
        push_half_edge(walk, 3 * face + i);
    }
    for (int32_t he = pop_half_edge(walk); he >= 0; he = pop_half_edge(walk)) {
        int32_t twin = walk->twins[he], row = walk->faces[rotated_corner(twin, 2)];
        if (walk->is_visited[twin / 3]) {
            continue;
        }
        walk->is_visited[twin / 3] = true;
        if (!walk->is_coded[row]) {
            add_row(walk, row, walk->faces[twin]);
        }
        push_half_edge(walk, rotated_corner(twin, 1));
        push_half_edge(walk, rotated_corner(twin, 2));
    }
}

size_t reel_predictors_memory(int64_t n_rows, int64_t n_faces) {
    return traversal_bytes(n_rows, n_faces);
}

int64_t reel_predictors_find(void *memory, size_t memory_size, const int32_t *faces,
                             const int32_t *twins, int64_t n_rows, int64_t n_faces, int32_t *order,
                             int64_t *starts, int32_t *triples, int32_t *stencils) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    traversal walk = {.faces = faces,
                      .twins = twins,
                      .n_rows = n_rows,
                      .n_faces = n_faces,
                      .order = order,
                      .triples = triples,
                      .stencils = stencils,
                      .starts = starts};
    if (!start_traversal(&walk, &arena)) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t i = 0; i < n_faces; i++) {
        if (!walk.is_visited[i]) {
            traverse_from(&walk, (int32_t)i);
        }
    }
    for (int32_t i = 0; i < n_rows; i++) {
        if (!walk.is_coded[i]) {
            add_row(&walk, i, i - 1);
        }
    }
    return walk.n_triples;
}
