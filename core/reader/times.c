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
           reel_room(REEL_TIME_PASSES + 1, sizeof(int64_t)) +
           reel_room(n * MOST_NEAR, sizeof(int32_t)) +
           reel_room((size_t)n_frames, sizeof(int32_t));
}

int64_t reel_time_neighbours(int64_t n_columns, int64_t n_frames) {
    return n_columns * n_frames * MOST_NEAR;
}

/* Adds a time of a column, with these of its column and the columns before as context neighbours;
   -1 is none. */
static void add_time(reel_coding_order *order, int64_t n_frames, int64_t column, int64_t time,
                     const int64_t *near, int n_near) {
    int64_t place = order->pass_starts[order->n_passes]++, count = order->near_starts[place];
    order->columns[place] = (int32_t)(column * n_frames + time);
    for (int k = 0; k < n_near; k++) {
        if (near[k] >= 0) {
            order->near[count++] = (int32_t)(column * n_frames + near[k]);
        }
    }
    for (int64_t before = column - COLUMNS_BEFORE; before < column; before++) {
        if (before >= 0) {
            order->near[count++] = (int32_t)(before * n_frames + time);
        }
    }
    order->near_starts[place + 1] = count;
}

static void begin_pass(reel_coding_order *order) {
    order->pass_starts[order->n_passes + 1] = order->pass_starts[order->n_passes];
    order->n_passes++;
}

/* A level of the moving times, whose places among them are far apart. */
static void add_level(reel_coding_order *order, int level, int64_t n_columns, int64_t n_frames,
                      const int32_t *moving, int64_t n_moving) {
    int64_t known = known_of[level];
    for (int64_t column = 0; column < n_columns; column++) {
        for (int64_t i = first_of[level]; i < n_moving; i += apart_of[level]) {
            const int64_t places[] = {i - known, i + known, i - 2 * known, i - 4 * known};
            int64_t near[4];
            for (int k = 0; k < 4; k++) { /* on the first level none beside it are known */
                bool is_known = (level || k >= 2) && places[k] >= 0 && places[k] < n_moving;
                near[k] = is_known ? moving[places[k]] : -1;
            }
            add_time(order, n_frames, column, moving[i], near, 4);
        }
    }
}

static void add_resting(reel_coding_order *order, int64_t n_columns, int64_t n_frames,
                        const uint8_t *rests) {
    for (int64_t column = 0; column < n_columns; column++) {
        for (int64_t time = 1; time < n_frames; time++) {
            const int64_t near[] = {rests[time - 1] ? time - 1 : -1,
                                    time > 1 && rests[time - 2] ? time - 2 : -1};
            if (rests[time]) {
                add_time(order, n_frames, column, time, near, 2);
            }
        }
    }
}

bool reel_find_time_order(reel_arena *arena, int64_t n_columns, int64_t n_frames,
                          const uint8_t *rests, reel_coding_order *found) {
    size_t n = (size_t)(n_columns * n_frames);
    found->columns = reel_take(arena, n, sizeof *found->columns);
    found->near_starts = reel_take(arena, n + 1, sizeof *found->near_starts);
    found->pass_starts = reel_take(arena, REEL_TIME_PASSES + 1, sizeof *found->pass_starts);
    found->near = reel_take(arena, n * MOST_NEAR, sizeof *found->near);
    int32_t *moving = reel_take(arena, (size_t)n_frames, sizeof *moving);
    if (arena->failed) {
        return false;
    }
    int64_t n_moving = 0;
    for (int64_t time = 0; time < n_frames; time++) {
        if (!rests || !rests[time]) {
            moving[n_moving++] = (int32_t)time;
        }
    }
    found->n_columns = (int64_t)n;
    found->n_passes = 0;
    found->pass_starts[0] = found->near_starts[0] = 0;
    for (int level = 0; level < N_LEVELS; level++) {
        begin_pass(found);
        add_level(found, level, n_columns, n_frames, moving, n_moving);
    }
    if (rests) {
        begin_pass(found);
        add_resting(found, n_columns, n_frames, rests);
    }
    return true;
}
