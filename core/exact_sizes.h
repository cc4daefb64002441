/* Differences of the exact coder as bits, and the prediction of their size.

   docs/format.md, "Exact values", "Sizes". The size of a difference is regressed, in integer
   arithmetic, from earlier sizes, from those of neighbors and of other columns; its class is the
   context. */

#ifndef REEL_EXACT_SIZES_H
#define REEL_EXACT_SIZES_H

#include "exact_state.h"

#define RAW_BITS 24 /* raw bits coded at once */
#define MAX_INPUT 128
#define MAX_ERROR 64

/* ---- differences ---- */

REEL_INLINE int bit_length(uint64_t value) { return value ? 64 - __builtin_clzll(value) : 0; }

REEL_INLINE int32_t clamp(int32_t value, int32_t limit) {
    return value < -limit ? -limit : value > limit ? limit : value;
}

/* Size of a magnitude: 16 log2(2 magnitude + 1) - 16, that is the logarithm of the middle of its
   step. */
REEL_INLINE int32_t size_of(uint64_t magnitude) {
    uint64_t twice = magnitude >> 62 ? UINT64_MAX : 2 * magnitude + 1;
    int length = bit_length(twice);
    return 16 * (length - 2) + (int32_t)(twice << (64 - length) >> 59 & 15U);
}

/* Code the length of a magnitude, relative to the predicted length of the class. */
REEL_INLINE int code_length(exact_coder *f, int class, int target_length) {
    exact_models *models = f->models;
    int length = class >> 2;
    if (reel_bit(f->coder, &models->above[class], target_length > length)) {
        length++;
        for (int i = 0; length < 64; i += i < N_STEPS - 1) {
            if (!reel_bit(f->coder, &models->longer[class][i], target_length > length)) {
                break;
            }
            length++;
        }
    } else {
        for (int i = 0; length > 0; i += i < N_STEPS - 1) {
            if (!reel_bit(f->coder, &models->shorter[class][i], target_length < length)) {
                break;
            }
            length--;
        }
    }
    return length;
}

/* Code a difference modulo 2^64 in a class of predicted sizes. */
REEL_INLINE uint64_t code_difference(exact_coder *f, int class, uint64_t difference) {
    exact_models *models = f->models;
    uint64_t magnitude = difference >> 63 ? 0 - difference : difference;
    int length = code_length(f, class, bit_length(magnitude));
    if (length == 0) {
        return 0;
    }
    uint64_t result = 1;
    int low = length - 1, relative = length - (class >> 2) + 3;
    relative = relative < 0 ? 0 : relative > 7 ? 7 : relative;
    if (low > 0) {
        low--;
        result = 2U | (uint64_t)reel_bit(f->coder, &models->second[class][relative],
                                         (int)(magnitude >> low & 1U));
    }
    for (; low >= RAW_BITS; low -= RAW_BITS) {
        uint32_t bits = (uint32_t)(magnitude >> (low - RAW_BITS));
        result = result << RAW_BITS | reel_code_raw(f->coder, RAW_BITS, bits);
    }
    uint32_t rest = (uint32_t)(magnitude << 1 | difference >> 63); /* with the sign below */
    rest = reel_code_raw(f->coder, low + 1, rest);
    result = result << low | rest >> 1;
    return rest & 1U ? 0 - result : result;
}

REEL_INLINE int class_of(int32_t size) {
    size += 16;
    return (size < 0 ? 0 : size < N_SIZES ? size : N_SIZES - 1) >> 2;
}

/* ---- predicted sizes ---- */

/* Q16 inverses of the number of neighbors. */
static const int32_t inverses[N_NEAR + 1] = {0, 65536, 32768, 21845, 16384, 13107, 10922};

REEL_INLINE int32_t predict_size(exact_coder *f, int64_t t, int64_t col, double spread,
                                 int32_t inputs[N_INPUTS]) {
    column_state *state = &f->columns[col];
    int n = f->n_near < N_NEAR ? f->n_near : N_NEAR;
    int64_t at = t * f->width + col;
    int32_t own = state->fast >> 4, here = n   ? f->sums[at] * inverses[n] >> 16
                                           : t ? own
                                               : state->last;
    own = t > 1 ? own : here;
    int32_t before = n && t ? f->sums[at - f->width] * inverses[n] >> 16 : own;
    state->here = own;
    inputs[0] = 16;
    inputs[1] = here - own;
    inputs[2] = col ? f->excess : 0;
    inputs[3] = before - own;
    inputs[4] = t > 1 ? own - (state->slow >> 4) : 0;
    inputs[5] = n ? f->max_sizes[at] - here : 0;
    inputs[6] = spread > 0 ? reel_size_of_variance(spread) - own : 0;
    int64_t sum = 0;
    for (int i = 0; i < N_INPUTS; i++) {
        inputs[i] = clamp(inputs[i], MAX_INPUT);
        sum += (int64_t)f->models->weights[i] * inputs[i];
    }
    return own + (int32_t)(sum >> 16);
}

/* Update the weights by the difference of actual and predicted size. */
REEL_INLINE void update_size_weights(exact_coder *f, const int32_t *inputs, int32_t error) {
    error = clamp(error + 10, MAX_ERROR);
    for (int i = 0; i < N_INPUTS; i++) {
        uint32_t more = (uint32_t)(error * inputs[i] >> 3);
        f->models->weights[i] = (int32_t)((uint32_t)f->models->weights[i] + more);
    }
}

#endif
