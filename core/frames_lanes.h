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

/* Sum requested frame `request` of a tile over the modes. */
static void NAMED(sum_tile)(const frames_job *job, const void *tile, int64_t request,
                            double (*sums)[TILE]) {
    int64_t n = job->n_modes;
    if (job->single_basis) {
        NAMED(sum_tile_float)(job, job->single_basis + request * n, job->n_requested * n, tile,
                              sums);
    } else {
        NAMED(sum_tile_double)(job, job->basis + job->frames[request] * n, job->n_frames * n, tile,
                               sums);
    }
}

/* Convert up to three columns of a tile, starting at column x, to model units. Returns whether the
   first `count` of each are finite: adding 1 to an exponent of all ones carries into the sign bit,
   which is masked out first. */
#define DEFINE_PLACE(name, number, bits)                                                           \
    TARGET REEL_INLINE bool name(const frames_job *job, double(*sums)[TILE], int64_t x, int count, \
                                 number(*values)[TILE]) {                                          \
        const bits sign = (bits)1 << (8 * sizeof(bits) - 1);                                       \
        const bits exponent_bit = sizeof(bits) == 4 ? (bits)1 << 23 : (bits)(UINT64_C(1) << 52);   \
        bits carries = 0;                                                                          \
        double scale = job->placement[0];                                                          \
        for (int64_t column = 0; column < 3 && x + column < job->n_columns; column++) {            \
            double origin = job->placement[1 + x + column];                                        \
            const bits *words = (const bits *)values[column];                                      \
            for (int i = 0; i < TILE; i++) {                                                       \
                values[column][i] = (number)(sums[x + column][i] * scale + origin);                \
            }                                                                                      \
            for (int i = 0; i < count; i++) {                                                      \
                carries |= (words[i] & ~sign) + exponent_bit;                                      \
            }                                                                                      \
        }                                                                                          \
        return !(carries & sign);                                                                  \
    }

DEFINE_PLACE(NAMED(place_floats), float, uint32_t)
DEFINE_PLACE(NAMED(place_doubles), double, uint64_t)
#undef DEFINE_PLACE

/* Write a tile in model units, columns interleaved, starting at number `start` of the output.
   Returns whether all values are finite. */
TARGET static bool NAMED(place_tile)(const frames_job *job, double (*sums)[TILE], int64_t start,
                                     int count) {
    int64_t n_columns = job->n_columns;
    bool is_finite = true;
    for (int64_t x = 0; x < n_columns; x += 3) {
        if (job->layout == REEL_VALUES_8) {
            double values[3][TILE];
            is_finite &= NAMED(place_doubles)(job, sums, x, count, values);
            write_doubles(values, n_columns - x, n_columns, count, (double *)job->out + start + x);
        } else {
            float values[3][TILE];
            is_finite &= NAMED(place_floats)(job, sums, x, count, values);
            write_floats(values, n_columns - x, n_columns, count, (float *)job->out + start + x);
        }
    }
    return is_finite;
}
#undef LANES
