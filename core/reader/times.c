/* In which order the temporal basis is coded: docs/format.md, "Passes by times". */

#include "field_mesh.h"

#define N_LEVELS 3
#define MOST_NEAR 6
#define COLUMNS_BEFORE 2

/* The first time of a level, how far its times are apart, and the distance of known ones. */
static const int64_t first_of[N_LEVELS] = {0, 2, 1}, apart_of[N_LEVELS] = {4, 4, 2},
                     known_of[N_LEVELS] = {2, 2, 1};

size_t reel_time_order_room(int64_t n_columns, int64_t n_frames) {
    size_t n = (size_t)(n_columns * n_frames);
    return reel_room(n, sizeof(int32_t)) + reel_room(n + 1, sizeof(int64_t)) +
           reel_room(N_LEVELS + 1, sizeof(int64_t)) + reel_room(n * MOST_NEAR, sizeof(int32_t));
}

int64_t reel_time_neighbours(int64_t n_columns, int64_t n_frames) {
    return n_columns * n_frames * MOST_NEAR;
}

/* The context neighbours of a time of a column, to `near`; returns how many they are. */
static int list_neighbours(int level, int64_t column, int64_t time, int64_t n_frames,
                           int32_t *near) {
    int64_t known = known_of[level];
    int64_t others[] = {time - known, time + known, time - 2 * known, time - 4 * known};
    int count = 0;
    for (int k = level ? 0 : 2; k < 4; k++) { /* on the first level none beside it are known */
        if (others[k] >= 0 && others[k] < n_frames) {
            near[count++] = (int32_t)(column * n_frames + others[k]);
        }
    }
    for (int64_t before = column - COLUMNS_BEFORE; before < column; before++) {
        if (before >= 0) {
            near[count++] = (int32_t)(before * n_frames + time);
        }
    }
    return count;
}

bool reel_find_time_order(reel_arena *arena, int64_t n_columns, int64_t n_frames,
                          reel_coding_order *found) {
    size_t n = (size_t)(n_columns * n_frames);
    found->columns = reel_take(arena, n, sizeof *found->columns);
    found->near_starts = reel_take(arena, n + 1, sizeof *found->near_starts);
    found->pass_starts = reel_take(arena, N_LEVELS + 1, sizeof *found->pass_starts);
    found->near = reel_take(arena, n * MOST_NEAR, sizeof *found->near);
    found->n_columns = (int64_t)n;
    found->n_passes = N_LEVELS;
    if (arena->failed) {
        return false;
    }
    int64_t place = 0, count = 0;
    for (int level = 0; level < N_LEVELS; level++) {
        found->pass_starts[level] = place;
        for (int64_t column = 0; column < n_columns; column++) {
            for (int64_t t = first_of[level]; t < n_frames; t += apart_of[level]) {
                found->columns[place] = (int32_t)(column * n_frames + t);
                found->near_starts[place++] = count;
                count += list_neighbours(level, column, t, n_frames, found->near + count);
            }
        }
    }
    found->pass_starts[N_LEVELS] = place;
    found->near_starts[place] = count;
    return true;
}
