/* Values of a tile of vertices, LANES at a time; see frames.c and cpu.h. */

#define NUMBER double
#define NUMBERS LANES
#define OF(name) NAMED(name##_double)
#include "frames_sums.h"
#undef NUMBER
#undef NUMBERS
#undef OF

#define NUMBER float
#define NUMBERS (2 * LANES)
#define OF(name) NAMED(name##_float)
#include "frames_sums.h"
#undef NUMBER
#undef NUMBERS
#undef OF

static void NAMED(pack_tile)(const frames_job *job, const int32_t *vertices, int count,
                             void *tile) {
    if (job->single_basis) {
        NAMED(pack_tile_float)(job, vertices, count, tile);
    } else {
        NAMED(pack_tile_double)(job, vertices, count, tile);
    }
}

static void NAMED(sum_tile)(const frames_job *job, const void *tile, int64_t frame,
                            double (*sums)[TILE]) {
    if (job->single_basis) {
        NAMED(sum_tile_float)(job, job->single_basis, tile, frame, sums);
    } else {
        NAMED(sum_tile_double)(job, job->basis, tile, frame, sums);
    }
}

/* Writes three columns, or fewer, of a tile; `out` is that of its first vertex. */
#define DEFINE_INTERLEAVE(name, type)                                                              \
    TARGET REEL_INLINE void name(double (*sums)[TILE], int64_t left, int64_t stride, int count,    \
                                 type *restrict out) {                                             \
        type placed[3][TILE];                                                                      \
        for (int64_t column = 0; column < 3 && column < left; column++) {                          \
            for (int i = 0; i < TILE; i++) {                                                       \
                placed[column][i] = (type)sums[column][i];                                         \
            }                                                                                      \
        }                                                                                          \
        for (int i = 0; i < count && left >= 3; i++) {                                             \
            out[stride * i] = placed[0][i];                                                        \
            out[stride * i + 1] = placed[1][i];                                                    \
            out[stride * i + 2] = placed[2][i];                                                    \
        }                                                                                          \
        for (int64_t column = 0; column < left && left < 3; column++) {                            \
            for (int i = 0; i < count; i++) {                                                      \
                out[stride * i + column] = placed[column][i];                                      \
            }                                                                                      \
        }                                                                                          \
    }

DEFINE_INTERLEAVE(NAMED(interleave_floats), float)
DEFINE_INTERLEAVE(NAMED(interleave_doubles), double)
#undef DEFINE_INTERLEAVE

/* Writes a tile in model units, the columns of each vertex together, from number `start` on. */
TARGET REEL_INLINE void NAMED(place_columns)(const frames_job *job, double (*sums)[TILE],
                                             int64_t start, int count, int64_t n_columns) {
    for (int64_t column = 0; column < n_columns; column++) {
        double scale = job->placement[0], origin = job->placement[1 + column];
        for (int i = 0; i < TILE; i++) {
            sums[column][i] = sums[column][i] * scale + origin;
        }
    }
    for (int64_t x = 0; x < n_columns; x += 3) {
        if (job->layout == REEL_VALUES_8) {
            NAMED(interleave_doubles)(sums + x, n_columns - x, n_columns, count,
                                      (double *)job->out + start + x);
        } else {
            NAMED(interleave_floats)(sums + x, n_columns - x, n_columns, count,
                                     (float *)job->out + start + x);
        }
    }
}

/* Positions have code of their own. */
TARGET static void NAMED(place_tile)(const frames_job *job, double (*sums)[TILE], int64_t start,
                                     int count) {
    if (job->n_columns == 3) {
        NAMED(place_columns)(job, sums, start, count, 3);
    } else {
        NAMED(place_columns)(job, sums, start, count, job->n_columns);
    }
}
