/* References of corners to rows of a table: corners at a vertex mostly share a row, except across
   seams. docs/format.md, "References of corners". */

#include "base.h"

#define NONE (-1)
#define MAX_RECENT 8 /* distinct rows kept for each vertex */
#define MAX_CANDIDATES (2 + MAX_RECENT)

enum corner_code { BEST = 0, NEW = 1, EXPLICIT = 2 }; /* 3 and more: further candidates */

/* State of a half-edge at a corner, by the rows of this and the neighboring face at its other end.
   OPEN: this face's row is not coded yet; NO_NEIGHBOR: no coded face is across the half-edge. */
enum seam_state { SAME = 0, OPEN = 1, SEAM = 2, NO_NEIGHBOR = 3 };

typedef struct {
    const int32_t *triangles, *twins, *items;
    int32_t *rows;     /* of each item, NONE before it is coded */
    int32_t *recent;   /* MAX_RECENT rows of each vertex, the latest first */
    uint8_t *n_recent; /* of each vertex */
} corner_walk;

typedef struct {
    int context, n;
    int32_t rows[MAX_CANDIDATES];
} candidate_list;

static int32_t corner_after(int32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }

static int32_t row_at(const corner_walk *walk, int32_t corner) {
    return walk->rows[walk->items ? walk->items[corner] : corner];
}

static void add_candidate(candidate_list *list, int32_t row) {
    for (int i = 0; i < list->n; i++) {
        if (list->rows[i] == row) {
            return;
        }
    }
    list->rows[list->n++] = row;
}

/* Examine a half-edge between `corner` and `other`; returns its state, and the row of the
   neighboring face at the vertex of `corner`. */
static int examine_half_edge(const corner_walk *walk, int32_t he, int32_t corner, int32_t other,
                             int32_t *row) {
    int32_t twin = walk->twins[he];
    if (twin / 3 >= he / 3) {
        return NO_NEIGHBOR;
    }
    int32_t next = corner_after(twin);
    bool is_start = walk->triangles[twin] == walk->triangles[corner];
    int32_t neighbor_row = row_at(walk, is_start ? next : twin), other_row = row_at(walk, other);
    *row = row_at(walk, is_start ? twin : next);
    return other_row == NONE ? OPEN : other_row == neighbor_row ? SAME : SEAM;
}

static candidate_list find_candidates(const corner_walk *walk, int32_t corner) {
    int32_t next = corner_after(corner), previous = corner_after(next), rows[2];
    int states[2] = {examine_half_edge(walk, previous, corner, previous, &rows[0]),
                     examine_half_edge(walk, corner, corner, next, &rows[1])};
    int first = states[1] < states[0];
    int32_t vertex = walk->triangles[corner];
    const int32_t *recent = walk->recent + (int64_t)vertex * MAX_RECENT;
    candidate_list list = {0};
    for (int i = 0; i < 2; i++) {
        int number = i ? !first : first;
        if (states[number] != NO_NEIGHBOR) {
            add_candidate(&list, rows[number]);
        }
    }
    for (int i = 0; i < walk->n_recent[vertex]; i++) {
        add_candidate(&list, recent[i]);
    }
    if (list.n) {
        list.context = 1 + states[first] + (walk->n_recent[vertex] > 1 ? 4 : 0);
    }
    return list;
}

/* Set the row of an item, and move it to the front of the recent rows of its vertex. */
static void set_row(corner_walk *walk, int32_t corner, int32_t item, int32_t row) {
    int32_t vertex = walk->triangles[corner];
    int32_t *recent = walk->recent + (int64_t)vertex * MAX_RECENT;
    int n = walk->n_recent[vertex], index = 0;
    walk->rows[item] = row;
    while (index < n && recent[index] != row) {
        index++;
    }
    if (index == n && n < MAX_RECENT) {
        walk->n_recent[vertex] = (uint8_t)(n + 1);
    } else if (index == n) {
        index = MAX_RECENT - 1;
    }
    for (; index > 0; index--) {
        recent[index] = recent[index - 1];
    }
    recent[0] = row;
}

size_t reel_corner_rows_memory(int64_t n_verts, int64_t n_items) {
    return reel_array_bytes((size_t)n_verts * MAX_RECENT, sizeof(int32_t)) +
           reel_array_bytes((size_t)n_verts, 1) +
           reel_array_bytes((size_t)n_items, sizeof(int32_t));
}

static bool begin_walk(reel_arena *arena, corner_walk *walk, int64_t n_verts) {
    walk->recent = reel_allocate(arena, (size_t)n_verts * MAX_RECENT, sizeof *walk->recent);
    walk->n_recent = reel_allocate(arena, (size_t)n_verts, 1);
    if (arena->failed) {
        return false;
    }
    reel_zero(walk->n_recent, (size_t)n_verts);
    return true;
}

int64_t reel_corner_codes(void *memory, size_t memory_size, const int32_t *triangles,
                          const int32_t *twins, const int32_t *items, int64_t n_triangles,
                          int64_t n_verts, int64_t n_items, const int32_t *rows, int32_t *order,
                          uint8_t *contexts, int32_t *codes) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    corner_walk walk = {.triangles = triangles, .twins = twins, .items = items};
    walk.rows = reel_allocate(&arena, (size_t)n_items, sizeof *walk.rows);
    if (!begin_walk(&arena, &walk, n_verts)) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t i = 0; i < n_items; i++) {
        walk.rows[i] = NONE;
    }
    int64_t n_coded = 0;
    int32_t n_new = 0;
    for (int32_t corner = 0; corner < 3 * n_triangles; corner++) {
        int32_t item = items ? items[corner] : corner, row = rows[item];
        if (walk.rows[item] != NONE) {
            continue;
        }
        if (row < 0) {
            return reel_failure(REEL_INVALID, (uint64_t)item);
        }
        candidate_list list = find_candidates(&walk, corner);
        int index = 0;
        while (index < list.n && list.rows[index] != row) {
            index++;
        }
        int32_t code = index < list.n ? index + 2 * (index > 0) : row == n_new ? NEW : EXPLICIT;
        n_new += code == NEW;
        order[n_coded] = item;
        contexts[n_coded] = (uint8_t)list.context;
        codes[n_coded++] = code;
        set_row(&walk, corner, item, row);
    }
    return n_coded;
}

int64_t reel_corner_rows(void *memory, size_t memory_size, const int32_t *triangles,
                         const int32_t *twins, const int32_t *items, int64_t n_triangles,
                         int64_t n_verts, int64_t n_items, int64_t n_rows, const int32_t *codes,
                         const int64_t *n_codes, const int32_t *differences, int64_t n_explicit,
                         int32_t *rows) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    corner_walk walk = {.triangles = triangles, .twins = twins, .items = items, .rows = rows};
    const int32_t *next[REEL_CORNER_CONTEXTS], *ends[REEL_CORNER_CONTEXTS];
    if (!begin_walk(&arena, &walk, n_verts)) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int i = 0; i < REEL_CORNER_CONTEXTS; i++) {
        next[i] = codes;
        codes += n_codes[i];
        ends[i] = codes;
    }
    for (int64_t i = 0; i < n_items; i++) {
        rows[i] = NONE;
    }
    int64_t n_new = 0, n_used = 0, last_explicit = 0;
    for (int32_t corner = 0; corner < 3 * n_triangles; corner++) {
        int32_t item = items ? items[corner] : corner;
        if (rows[item] != NONE) {
            continue;
        }
        candidate_list list = find_candidates(&walk, corner);
        if (next[list.context] == ends[list.context]) {
            return reel_failure(REEL_CORRUPT, (uint64_t)item);
        }
        int32_t code = *next[list.context]++;
        int64_t row = NONE, index = code > EXPLICIT ? (int64_t)code - EXPLICIT : 0;
        if (code == NEW) {
            row = n_new++;
        } else if (code == EXPLICIT && n_used < n_explicit) {
            row = last_explicit += differences[n_used++];
        } else if (code != EXPLICIT && code >= 0 && index < list.n) {
            row = list.rows[index];
        }
        if (row < 0 || row >= n_rows) {
            return reel_failure(REEL_CORRUPT, (uint64_t)item);
        }
        set_row(&walk, corner, item, (int32_t)row);
    }
    return n_used == n_explicit ? n_items : reel_failure(REEL_CORRUPT, (uint64_t)n_items);
}
