/* The times of frames that are not evenly spaced: docs/format.md, "Times". */

#include "times.h"

/* Rank of a double among all doubles in ascending order; that of 0 is 0. */
static int64_t rank_of(double number) {
    int64_t bits;
    reel_copy(&bits, &number, sizeof bits);
    return bits < 0 ? INT64_MIN - bits : bits;
}

static double number_of(int64_t rank) {
    int64_t bits = rank < 0 ? INT64_MIN - rank : rank;
    double number;
    reel_copy(&number, &bits, sizeof number);
    return number;
}

/* Read time `i`, after those before it. */
static int read_time(reel_call *call, reel_range *input, uint64_t i, double *times) {
    uint64_t code, offset = input->offset;
    REEL_TRY(reel_read_varint(call, input, &code));
    if (!code) {
        REEL_TRY(reel_read_bytes(call, input, &times[i], sizeof times[i]));
    } else {
        REEL_CORRUPT_IF(i < 2, offset, "the first two times are not stored as they are");
        double expected = times[i - 1] + (times[i - 1] - times[i - 2]);
        uint64_t residual = ((code - 1) >> 1) ^ (0 - ((code - 1) & 1));
        times[i] = number_of((int64_t)((uint64_t)rank_of(expected) + residual));
    }
    bool is_ascending = reel_is_finite(times[i] - times[0]) && (!i || times[i] > times[i - 1]);
    return is_ascending ? MESHREEL_OK
                        : reel_corrupt(call, offset, "the times are not finite and ascending");
}

int reel_read_times(reel_call *call, reel_pool *pool, reel_range data, uint64_t n_frames,
                    bool is_cut, double **times) {
    const reel_chunk *mark = call->scratch.last;
    REEL_CORRUPT_IF(data.length < n_frames, data.offset, "there are fewer times than frames");
    double *result = reel_pool_allocate(call, pool, n_frames, sizeof *result);
    REEL_NEED(result);
    int failed = reel_cache(call, data);
    for (uint64_t i = 0; !failed && i < n_frames; i++) {
        failed = read_time(call, &data, i, result);
    }
    call->cached = NULL;
    reel_drop_scratch(call, mark);
    *times = result;
    if (failed == MESHREEL_TRUNCATED) {
        return reel_corrupt(call, data.offset, "there are fewer times than frames");
    }
    return failed || is_cut || !data.length
               ? failed
               : reel_corrupt(call, data.offset, "there are more times than frames");
}
