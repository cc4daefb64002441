/* Values of a tile of vertices, LANES doubles per vector; see frames.c and cpu.h. */

#define NUMBER double
#define NUMBERS LANES
#define SUM_NAME(name) NAMED(name##_double)
#include "frames_sums.h"
#undef NUMBER
#undef NUMBERS
#undef SUM_NAME

#define NUMBER float
#define NUMBERS (2 * LANES)
#define SUM_NAME(name) NAMED(name##_float)
#include "frames_sums.h"
#undef NUMBER
#undef NUMBERS
#undef SUM_NAME

/* Sum requested frame `number` of a tile over the modes. */
static void NAMED(sum_tile)(const frames_job *job, const void *tile, int64_t number,
                            double (*sums)[TILE]) {
    int64_t n = job->n_modes;
    if (job->single_basis) {
        NAMED(sum_tile_float)(job, job->single_basis + number * n, job->n_requested * n, tile,
                              sums);
    } else {
        NAMED(sum_tile_double)(job, job->basis + job->frames[number] * n, job->n_frames * n, tile,
                               sums);
    }
}

/* Convert up to three columns of a tile, starting at column x, to model units. */
#define DEFINE_PLACE(name, number)                                                                 \
    TARGET REEL_INLINE void name(const frames_job *job, double(*sums)[TILE], int64_t x,            \
                                 number(*values)[TILE]) {                                          \
        double scale = job->placement[0];                                                          \
        for (int64_t column = 0; column < 3 && x + column < job->n_columns; column++) {            \
            double origin = job->placement[1 + x + column];                                        \
            for (int i = 0; i < TILE; i++) {                                                       \
                values[column][i] = (number)(sums[x + column][i] * scale + origin);                \
            }                                                                                      \
        }                                                                                          \
    }

DEFINE_PLACE(NAMED(place_floats), float)
DEFINE_PLACE(NAMED(place_doubles), double)
#undef DEFINE_PLACE

/* Write a tile in model units, columns interleaved, starting at number `start` of the output. */
TARGET static void NAMED(place_tile)(const frames_job *job, double (*sums)[TILE], int64_t start,
                                     int count) {
    int64_t n_columns = job->n_columns;
    for (int64_t x = 0; x < n_columns; x += 3) {
        if (job->layout == REEL_VALUES_8) {
            double values[3][TILE];
            NAMED(place_doubles)(job, sums, x, values);
            write_doubles(values, n_columns - x, n_columns, count, (double *)job->out + start + x);
        } else {
            float values[3][TILE];
            NAMED(place_floats)(job, sums, x, values);
            write_floats(values, n_columns - x, n_columns, count, (float *)job->out + start + x);
        }
    }
}
