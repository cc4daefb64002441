/* How the modes of a block move: basis vectors over time, from integers.

   docs/format.md, "Times". A time is predicted from known ones around it by the polynomial through
   them. Values are multiples of 1/256, and exact as long as they stay below 2^44. */

#include "rounding.h"

#define COARSEST 4 /* frames between the times that come first */

#define N_ROUNDS 2           /* in which a dead zone follows the counts that it makes */
#define FIRST_DEAD_ZONE 0.6

/* The prediction of a time from those d before and behind it, and 3 d. */
REEL_INLINE double predict_time(const double *values, int64_t time, int64_t d, int64_t n_frames) {
    if (time + d >= n_frames) {
        return values[time - d];
    }
    double before = values[time - d], behind = values[time + d];
    bool has_first = time >= 3 * d, has_last = time + 3 * d < n_frames;
    if (has_first && has_last) {
        return (9.0 * (before + behind) - (values[time - 3 * d] + values[time + 3 * d])) / 16.0;
    }
    if (has_first) {
        return (6.0 * before + 3.0 * behind - values[time - 3 * d]) / 8.0;
    }
    if (has_last) {
        return (3.0 * before + 6.0 * behind - values[time + 3 * d]) / 8.0;
    }
    return (before + behind) / 2.0;
}

/* The values of a column over time. */
static void decode_times(const int32_t *integers, int64_t n_frames, double *values) {
    double latest = 0.0;
    for (int64_t time = 0; time < n_frames; time += COARSEST) {
        latest += integers[time];
        values[time] = latest;
    }
    for (int64_t d = COARSEST / 2; d; d /= 2) {
        for (int64_t time = d; time < n_frames; time += 2 * d) {
            values[time] = predict_time(values, time, d, n_frames) + integers[time];
        }
    }
}

size_t reel_basis_memory(int64_t n_columns, int64_t n_frames) {
    return reel_room((size_t)n_columns * (size_t)n_frames, sizeof(double));
}

int64_t reel_lengths(const double *values, int64_t n_verts, int64_t n_modes, int64_t n_reused,
                     double finer, double *lengths) {
    for (int64_t mode = 0; mode < n_reused; mode++) {
        lengths[mode] = 0.0;
    }
    for (int64_t v = 0; v < n_verts; v++) {
        const double *here = values + v * n_modes;
        for (int64_t mode = 0; mode < n_reused; mode++) {
            lengths[mode] += here[mode] * here[mode];
        }
    }
    for (int64_t mode = 0; mode < n_reused; mode++) {
        double size = lengths[mode] > 0.0 ? __builtin_sqrt(lengths[mode]) : 1.0;
        lengths[mode] = size / finer;
    }
    return n_reused;
}

int64_t reel_basis(void *memory, size_t memory_size, const int32_t *integers, int64_t n_modes,
                   int64_t n_columns, int64_t n_frames, const double *lengths, int64_t n_reused,
                   double *basis) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    int64_t length = n_columns * n_frames;
    double *values = reel_take(&arena, (size_t)length, sizeof *values);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t mode = 0; mode < n_modes; mode++) {
        double sum = 0.0;
        for (int64_t first = 0; first < length; first += n_frames) {
            decode_times(integers + mode * length + first, n_frames, values + first);
        }
        for (int64_t i = 0; i < length; i++) {
            sum += values[i] * values[i];
        }
        double size = sum > 0.0 ? __builtin_sqrt(sum) : 1.0;
        size = mode < n_reused ? lengths[mode] : size;
        for (int64_t i = 0; i < length; i++) {
            basis[i * n_modes + mode] = values[i] / size;
        }
    }
    return n_modes;
}

/* Magnitudes below this become 0: the bits that a 1 costs more than a 0 are taken from how often
   the two occur among `count` values, and are worth `price` squared steps each. */
static double dead_zone(const double *scaled, int64_t count, double price) {
    double zone = FIRST_DEAD_ZONE;
    for (int round = 0; round < N_ROUNDS && price > 0.0; round++) {
        double n_zeros = 0.0, n_ones = 0.0;
        for (int64_t i = 0; i < count; i++) {
            double size = reel_magnitude(scaled[i]);
            n_zeros += size < zone ? 1.0 : 0.0;
            n_ones += size >= zone && size < 1.5 ? 1.0 : 0.0;
        }
        zone = reel_dead_zone(n_zeros, n_ones, price);
    }
    return price > 0.0 ? zone : REEL_NO_ZONE;
}

/* The integer near to a value; false if it is too large. */
REEL_INLINE bool quantize(double scaled, double zone, double price, int32_t *integer) {
    if (!(reel_magnitude(scaled) < REEL_TOO_LARGE)) {
        return false;
    }
    *integer = reel_rounded(scaled, zone, !(price > 0.0));
    return true;
}

/* Times d, 3 d, 5 d, ... of a column. */
static bool encode_level(const double *wanted, int64_t n_frames, int64_t d, double price,
                         double *values, double *scaled, int32_t *integers) {
    int64_t count = 0;
    for (int64_t time = d; time < n_frames; time += 2 * d) {
        scaled[count++] = wanted[time] - predict_time(values, time, d, n_frames);
    }
    double zone = dead_zone(scaled, count, price);
    count = 0;
    for (int64_t time = d; time < n_frames; time += 2 * d) {
        if (!quantize(scaled[count++], zone, price, &integers[time])) {
            return false;
        }
        values[time] = predict_time(values, time, d, n_frames) + integers[time];
    }
    return true;
}

static bool encode_times(const double *wanted, int64_t n_frames, double price, double *values,
                         double *scaled, int32_t *integers) {
    int32_t latest = 0;
    for (int64_t time = 0; time < n_frames; time += COARSEST) {
        int32_t here;
        if (!quantize(wanted[time], REEL_NO_ZONE, 0.0, &here)) {
            return false;
        }
        values[time] = here;
        integers[time] = here - latest;
        latest = here;
    }
    for (int64_t d = COARSEST / 2; d; d /= 2) {
        if (!encode_level(wanted, n_frames, d, price, values, scaled, integers)) {
            return false;
        }
    }
    return true;
}

size_t reel_basis_encode_memory(int64_t n_frames) {
    return 2 * reel_room((size_t)n_frames, sizeof(double));
}

int64_t reel_basis_encode(void *memory, size_t memory_size, const double *wanted, int64_t n_modes,
                          int64_t n_columns, int64_t n_frames, double price, int32_t *integers) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    double *values = reel_take(&arena, (size_t)n_frames, sizeof *values);
    double *scaled = reel_take(&arena, (size_t)n_frames, sizeof *scaled);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t row = 0; row < n_columns * n_modes; row++) {
        if (!encode_times(wanted + row * n_frames, n_frames, price, values, scaled,
                          integers + row * n_frames)) {
            return reel_failure(REEL_INVALID, (uint64_t)row);
        }
    }
    return n_modes;
}
