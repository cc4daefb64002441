/* Entropy coding of the differences between numbers and their predictions.

   docs/format.md, "Exact values", "Sizes". The size of a difference is 16 log2 of its magnitude.
   Before a difference is coded, its size is predicted by an adaptive linear regression in integers,
   from the sizes in earlier rows, of neighbors and in earlier columns. Four consecutive predicted
   sizes form a class, which has its own bit models. */

#ifndef REEL_EXACT_SIZES_H
#define REEL_EXACT_SIZES_H

#include "exact_state.h"

#define RAW_BITS 24   /* raw bits coded at once */
#define MAX_INPUT 128 /* inputs of the regression are clipped to this */
#define MAX_ERROR 64  /* errors that update its weights are clipped to this */

/* ---- differences ---- */

REEL_INLINE int bit_length(uint64_t value) { return value ? 64 - __builtin_clzll(value) : 0; }

REEL_INLINE int32_t clamp(int32_t value, int32_t limit) {
    return value < -limit ? -limit : value > limit ? limit : value;
}

/* Size of a magnitude: 16 log2(magnitude + 1 / 2), linear between powers of 2 and rounded down. */
REEL_INLINE int32_t size_of(uint64_t magnitude) {
    uint64_t doubled = magnitude >> 62 ? UINT64_MAX : 2 * magnitude + 1;
    int length = bit_length(doubled);
    return 16 * (length - 2) + (int32_t)(doubled << (64 - length) >> 59 & 15U);
}

/* Code the number of bits of a magnitude, in unary steps up or down from the number that its class
   predicts. */
REEL_INLINE int code_length(exact_coder *coder, int class, int actual) {
    exact_models *models = coder->models;
    int length = class >> 2;
    if (reel_bit(coder->range_coder, &models->above[class], actual > length)) {
        length++;
        for (int i = 0; length < 64; i += i < N_STEPS - 1) {
            if (!reel_bit(coder->range_coder, &models->longer[class][i], actual > length)) {
                break;
            }
            length++;
        }
    } else {
        for (int i = 0; length > 0; i += i < N_STEPS - 1) {
            if (!reel_bit(coder->range_coder, &models->shorter[class][i], actual < length)) {
                break;
            }
            length--;
        }
    }
    return length;
}

/* Code a difference modulo 2^64: the number of bits of its magnitude, the bit below the highest,
   then the remaining bits and the sign, which have no model. */
REEL_INLINE uint64_t code_difference(exact_coder *coder, int class, uint64_t difference) {
    exact_models *models = coder->models;
    uint64_t magnitude = difference >> 63 ? 0 - difference : difference;
    int length = code_length(coder, class, bit_length(magnitude));
    if (length == 0) {
        return 0;
    }
    uint64_t result = 1;
    int low = length - 1, relative = length - (class >> 2) + 3;
    relative = relative < 0 ? 0 : relative > 7 ? 7 : relative;
    if (low > 0) {
        low--;
        result = 2U | (uint64_t)reel_bit(coder->range_coder, &models->second[class][relative],
                                         (int)(magnitude >> low & 1U));
    }
    for (; low >= RAW_BITS; low -= RAW_BITS) {
        uint32_t bits = (uint32_t)(magnitude >> (low - RAW_BITS));
        result = result << RAW_BITS | reel_code_raw(coder->range_coder, RAW_BITS, bits);
    }
    uint32_t tail = (uint32_t)(magnitude << 1 | difference >> 63); /* the lowest bit is the sign */
    tail = reel_code_raw(coder->range_coder, low + 1, tail);
    result = result << low | tail >> 1;
    return tail & 1U ? 0 - result : result;
}

/* Return the class of a predicted size, which selects the bit models. */
REEL_INLINE int class_of(int32_t size) {
    size += 16;
    return (size < 0 ? 0 : size < N_SIZES ? size : N_SIZES - 1) >> 2;
}

/* ---- predicted sizes ---- */

static const int32_t inverses_q16[N_NEAR + 1] = {0, 65536, 32768, 21845, 16384, 13107, 10922};

/* Predict the size of the next difference. Store the inputs of the regression, a constant and
   differences of sizes, for `update_size_weights`. */
REEL_INLINE int32_t predict_size(exact_coder *coder, int64_t t, int64_t col, double variance,
                                 int32_t inputs[N_INPUTS]) {
    column_state *state = &coder->columns[col];
    int n = coder->item.n_near < N_NEAR ? coder->item.n_near : N_NEAR;
    int64_t index = t * coder->width + col;
    int32_t recent = state->fast >> 4; /* moving average of the sizes in this column */
    int32_t neighbors =
        n   ? coder->item.near_size_sums[index] * inverses_q16[n] >> 16 /* their mean size */
        : t ? recent
            : state->last;
    recent = t > 1 ? recent : neighbors;
    int32_t neighbors_before =
        n && t ? coder->item.near_size_sums[index - coder->width] * inverses_q16[n] >> 16 : recent;
    state->recent = recent;
    inputs[0] = 16;
    inputs[1] = neighbors - recent;
    inputs[2] = col ? coder->item.excess : 0;
    inputs[3] = neighbors_before - recent;
    inputs[4] = t > 1 ? recent - (state->slow >> 4) : 0;
    inputs[5] = n ? coder->item.max_near_sizes[index] - neighbors : 0;
    inputs[6] = variance > 0 ? reel_size_of_variance(variance) - recent : 0;
    int64_t sum = 0;
    for (int i = 0; i < N_INPUTS; i++) {
        inputs[i] = clamp(inputs[i], MAX_INPUT);
        sum += (int64_t)coder->models->weights[i] * inputs[i];
    }
    return recent + (int32_t)(sum >> 16);
}

/* Update the weights of the regression by a gradient step; `error` is the actual minus the
   predicted size. The offset of 10 keeps predictions 10/16 octaves above the mean size, near the
   size of the mean magnitude. */
REEL_INLINE void update_size_weights(exact_coder *coder, const int32_t *inputs, int32_t error) {
    error = clamp(error + 10, MAX_ERROR);
    for (int i = 0; i < N_INPUTS; i++) {
        uint32_t step = (uint32_t)(error * inputs[i] >> 3);
        coder->models->weights[i] = (int32_t)((uint32_t)coder->models->weights[i] + step);
    }
}

#endif
