/* Corrections of single positions: docs/format.md, "Corrections". */

#include "moves.h"

#define COLUMNS 3
#define ROWS (3 + COLUMNS)
#define N_TABLES 4

size_t reel_moves_room(uint64_t n_frames, uint64_t n_moves) {
    return n_moves ? reel_room((size_t)n_frames + 1, sizeof(int64_t)) +
                         reel_room((size_t)n_moves, sizeof(int32_t)) +
                         reel_room(COLUMNS * (size_t)n_moves, sizeof(double))
                   : 0;
}

size_t reel_moves_scratch(const reel_outline *outline, const reel_group *group) {
    size_t n = (size_t)group->n_moved, all = (size_t)group->n_moves;
    return all ? reel_view_room(outline->source, group->moves.length) +
                     reel_room(2 * n + (1 + COLUMNS) * all, sizeof(int32_t)) +
                     reel_room(n + 1, sizeof(int64_t)) +
                     reel_room((size_t)outline->n_verts, sizeof(int32_t)) +
                     reel_room(reel_integers_memory(N_TABLES), 1)
               : 0;
}

/* The rows of integers, as they are coded. */
typedef struct {
    int64_t n, all;
    const int32_t *vertices, *counts, *frames, *offsets[COLUMNS];
} rows;

static int read_rows(const reel_outline *outline, const reel_group *group, reel_arena *scratch,
                     rows *found) {
    int64_t n = (int64_t)group->n_moved, all = (int64_t)group->n_moves, count = 2 * n + 4 * all;
    const int64_t lengths[ROWS] = {n, n, all, all, all, all};
    const int32_t tables[ROWS] = {0, 1, 2, 3, 3, 3};
    int32_t *values = reel_take(scratch, (size_t)count, sizeof *values);
    reel_arena inner = *scratch;
    size_t needed = reel_integers_memory(N_TABLES), size = (size_t)group->moves.length;
    void *memory = reel_take(&inner, needed, 1);
    const uint8_t *bytes;
    if (inner.failed) {
        return MESHREEL_NO_MEMORY;
    }
    int failed = reel_view(outline->source, group->moves, &inner, &bytes);
    if (failed) {
        return failed;
    }
    if (!reel_ends(bytes, size)) {
        return MESHREEL_CORRUPT;
    }
    *found = (rows){n, all, values, values + n, values + 2 * n, {NULL}};
    for (int column = 0; column < COLUMNS; column++) {
        found->offsets[column] = values + 2 * n + (1 + column) * all;
    }
    return reel_code_of(reel_integers_decode(memory, needed, bytes, size, lengths, tables, ROWS,
                                             N_TABLES, values));
}

/* Whether vertices and frames exist and ascend, and counts add up. Notes where the corrections of
   each run begin, the run of each vertex that goes out, and how many are in each frame. */
static bool find_runs(const rows *coded, const int32_t *outward, int64_t n_verts, int64_t n_frames,
                      int64_t *begins, int32_t *run_of, int64_t *starts) {
    int64_t next = 0, vertex = 0;
    for (int64_t v = 0; v < n_verts; v++) {
        run_of[v] = -1;
    }
    for (int64_t i = 0; i < coded->n; i++) {
        vertex += coded->vertices[i];
        if (vertex < 0 || vertex >= n_verts || (i && coded->vertices[i] <= 0) ||
            coded->counts[i] < 0 || coded->counts[i] >= coded->all - next) {
            return false;
        }
        begins[i] = next;
        run_of[outward[vertex]] = (int32_t)i;
        int64_t end = next + coded->counts[i] + 1, frame = 0;
        for (int64_t first = next; next < end; next++) {
            frame += coded->frames[next];
            if (frame < 0 || frame >= n_frames || (next > first && coded->frames[next] <= 0)) {
                return false;
            }
            starts[frame + 1]++;
        }
    }
    begins[coded->n] = next;
    return next == coded->all;
}

/* Places the corrections of a run at the next places of their frames. */
static void place_run(const rows *coded, int64_t begin, int64_t end, int32_t vertex, double step,
                      int64_t *next, const reel_moves *found) {
    int64_t frame = 0, offsets[COLUMNS] = {0};
    for (int64_t i = begin; i < end; i++) {
        bool follows = i > begin && coded->frames[i] == 1;
        frame += coded->frames[i];
        int64_t place = next[frame]++;
        found->vertices[place] = vertex;
        for (int column = 0; column < COLUMNS; column++) {
            offsets[column] = (follows ? offsets[column] : 0) + coded->offsets[column][i];
            found->moves[COLUMNS * place + column] = (double)offsets[column] * step;
        }
    }
}

int reel_read_moves(const reel_outline *outline, const reel_group *group, const int32_t *outward,
                    reel_arena scratch, const reel_moves *found) {
    int64_t n_frames = (int64_t)group->n_frames, n_verts = (int64_t)outline->n_verts;
    int64_t *begins = reel_take(&scratch, (size_t)group->n_moved + 1, sizeof *begins);
    int32_t *run_of = reel_take(&scratch, (size_t)n_verts, sizeof *run_of);
    if (scratch.failed) {
        return MESHREEL_NO_MEMORY;
    }
    rows coded;
    int failed = read_rows(outline, group, &scratch, &coded);
    if (failed) {
        return failed;
    }
    int64_t *starts = found->starts;
    reel_zero(starts, (size_t)(n_frames + 1) * sizeof *starts);
    if (!find_runs(&coded, outward, n_verts, n_frames, begins, run_of, starts)) {
        return MESHREEL_CORRUPT;
    }
    for (int64_t t = 0; t < n_frames; t++) {
        starts[t + 1] += starts[t];
    }
    for (int64_t v = 0; v < n_verts; v++) { /* ascending in each frame */
        if (run_of[v] >= 0) {
            place_run(&coded, begins[run_of[v]], begins[run_of[v] + 1], (int32_t)v,
                      (double)group->moved_by, starts, found);
        }
    }
    for (int64_t t = n_frames; t > 0; t--) { /* each has moved to where the next begins */
        starts[t] = starts[t - 1];
    }
    starts[0] = 0;
    return MESHREEL_OK;
}
