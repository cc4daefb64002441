/* How the modes of a block move: basis vectors over time, from integers.

   docs/format.md, "Times". A time is predicted from known ones around it by the polynomial through
   them. Values are multiples of 1/256, and exact as long as they stay below 2^44. */

#include "base.h"

#define COARSEST 4 /* frames between the times that come first */

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

/* The values of an axis over time. */
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

size_t reel_basis_memory(int64_t n_frames) {
    return reel_room(3 * (size_t)n_frames, sizeof(double));
}

int64_t reel_basis(void *memory, size_t memory_size, const int32_t *integers, int64_t n_modes,
                   int64_t n_frames, double *basis) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    int64_t length = 3 * n_frames;
    double *values = reel_take(&arena, (size_t)length, sizeof *values);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t mode = 0; mode < n_modes; mode++) {
        double sum = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            decode_times(integers + mode * length + axis * n_frames, n_frames,
                         values + axis * n_frames);
        }
        for (int64_t i = 0; i < length; i++) {
            sum += values[i] * values[i];
        }
        double size = sum > 0.0 ? __builtin_sqrt(sum) : 1.0;
        for (int64_t i = 0; i < length; i++) {
            basis[i * n_modes + mode] = values[i] / size;
        }
    }
    return n_modes;
}
