/* Differences of the exact coder as bits, and how large they are expected to be.

   docs/format.md, "Exact values", "Sizes": the size of a difference is regressed, in integers, from
   those of the past, of neighbours and of other columns; its class is the context. */

#ifndef REEL_EXACT_SIZES_H
#define REEL_EXACT_SIZES_H

#include "exact_state.h"

#define RAW_BITS 24                    /* at once */
#define MOST_INPUT 128
#define MOST_ERROR 64

/* ---- differences ---- */

REEL_INLINE int bit_length(uint64_t value) { return value ? 64 - __builtin_clzll(value) : 0; }

REEL_INLINE int32_t within(int32_t value, int32_t most) {
    return value < -most ? -most : value > most ? most : value;
}

/* Sixteen times the logarithm to base 2 of 2 magnitude + 1, less 16: of the middle of the step. */
REEL_INLINE int32_t size_of(uint64_t magnitude) {
    uint64_t twice = magnitude >> 62 ? UINT64_MAX : 2 * magnitude + 1;
    int length = bit_length(twice);
    return 16 * (length - 2) + (int32_t)(twice << (64 - length) >> 59 & 15U);
}

/* How long a magnitude is, from the expected length up or down. */
REEL_INLINE int code_length(exact_coder *f, int class, int wanted) {
    exact_models *models = f->models;
    int length = class >> 2;
    if (reel_bit(f->port, &models->above[class], wanted > length)) {
        length++;
        for (int i = 0; length < 64; i += i < N_STEPS - 1) {
            if (!reel_bit(f->port, &models->longer[class][i], wanted > length)) {
                break;
            }
            length++;
        }
    } else {
        for (int i = 0; length > 0; i += i < N_STEPS - 1) {
            if (!reel_bit(f->port, &models->shorter[class][i], wanted < length)) {
                break;
            }
            length--;
        }
    }
    return length;
}

/* A difference of a class of expected sizes, modulo 2^64. */
REEL_INLINE uint64_t code_difference(exact_coder *f, int class, uint64_t difference) {
    exact_models *models = f->models;
    uint64_t magnitude = difference >> 63 ? 0 - difference : difference;
    int length = code_length(f, class, bit_length(magnitude));
    if (length == 0) {
        return 0;
    }
    uint64_t found = 1;
    int low = length - 1, away = length - (class >> 2) + 3;
    away = away < 0 ? 0 : away > 7 ? 7 : away;
    if (low > 0) {
        low--;
        found = 2U | (uint64_t)reel_bit(f->port, &models->second[class][away],
                                        (int)(magnitude >> low & 1U));
    }
    for (; low >= RAW_BITS; low -= RAW_BITS) {
        uint32_t part = (uint32_t)(magnitude >> (low - RAW_BITS));
        found = found << RAW_BITS | reel_code_raw(f->port, RAW_BITS, part);
    }
    uint32_t rest = (uint32_t)(magnitude << 1 | difference >> 63); /* and the sign */
    rest = reel_code_raw(f->port, low + 1, rest);
    found = found << low | rest >> 1;
    return rest & 1U ? 0 - found : found;
}

REEL_INLINE int class_of(int32_t size) {
    size += 16;
    return (size < 0 ? 0 : size < N_SIZES ? size : N_SIZES - 1) >> 2;
}

/* ---- what size a difference will have ---- */

/* In sixteenths of octaves, scaled: of a number of the item at a time. `spread` is the variance
   that the filter expects, or 0. */
static const int32_t shares[N_NEAR + 1] = {0, 65536, 32768, 21845, 16384, 13107, 10922};

REEL_INLINE int32_t expected_size(exact_coder *f, int64_t t, int64_t col, double spread,
                                  int32_t inputs[N_INPUTS]) {
    exact_past *past = &f->past[col];
    int n = f->n_near < N_NEAR ? f->n_near : N_NEAR;
    int64_t at = t * f->width + col;
    int32_t own = past->quick >> 4, here = n ? f->sums[at] * shares[n] >> 16 : t ? own : past->last;
    own = t > 1 ? own : here;
    int32_t before = n && t ? f->sums[at - f->width] * shares[n] >> 16 : own;
    past->here = own;
    inputs[0] = 16;
    inputs[1] = here - own;
    inputs[2] = col ? f->others : 0;
    inputs[3] = before - own;
    inputs[4] = t > 1 ? own - (past->slow >> 4) : 0;
    inputs[5] = n ? f->most[at] - here : 0;
    inputs[6] = spread > 0 ? reel_size_of_variance(spread) - own : 0;
    int64_t found = 0;
    for (int i = 0; i < N_INPUTS; i++) {
        inputs[i] = within(inputs[i], MOST_INPUT);
        found += (int64_t)f->models->weights[i] * inputs[i];
    }
    return own + (int32_t)(found >> 16);
}

/* The weights learn from the size that came instead of the expected one. */
REEL_INLINE void learn_size(exact_coder *f, const int32_t *inputs, int32_t missed) {
    missed = within(missed + 10, MOST_ERROR);
    for (int i = 0; i < N_INPUTS; i++) {
        uint32_t more = (uint32_t)(missed * inputs[i] >> 3);
        f->models->weights[i] = (int32_t)((uint32_t)f->models->weights[i] + more);
    }
}

#endif
