/* Integers as adaptive bits: is it 0, its length in unary, its next two bits, its sign.

   docs/format.md, "Integers". Lower bits are noise that no context predicts: raw. A bit may be
   coded in a context beside the model of all contexts: then both learn, and both are asked. */

#ifndef REEL_INTEGERS_H
#define REEL_INTEGERS_H

#include "bits.h"

#define REEL_MOST_BITS 31 /* of a magnitude */

typedef struct {
    reel_model longer[REEL_MOST_BITS];   /* by length so far: is the magnitude longer? */
    reel_model second[REEL_MOST_BITS];   /* by length: the second highest bit */
    reel_model third[REEL_MOST_BITS][2]; /* by length and second bit: the third */
    reel_model negative[3];              /* by sign of the integer before: none, +, - */
} reel_integer_model;

REEL_INLINE void reel_start_integers(reel_integer_model *model) {
    for (int i = 0; i < REEL_MOST_BITS; i++) {
        model->longer[i] = reel_model_of(32768, 0);
        model->second[i] = reel_model_of(32768, 0);
        model->third[i][0] = model->third[i][1] = reel_model_of(32768, 0);
    }
    for (int i = 0; i < 3; i++) {
        model->negative[i] = reel_model_of(32768, 0);
    }
}

#define REEL_TRUSTED 3 /* bits that a context seems to have seen when it begins */

/* A bit in a context `here` (all zeros before its first bit, or NULL) of a model of all. */
REEL_INLINE int reel_bit_within(reel_port *port, reel_model *all, reel_model *here, int bit) {
    if (!here) {
        return reel_bit(port, all, bit);
    }
    if (!here->seen) {
        *here = *all;
        here->seen = all->seen < REEL_TRUSTED ? all->seen : REEL_TRUSTED;
    }
    bit = reel_code_bit(port, (3 * reel_probability(here) + reel_probability(all)) >> 2, bit);
    reel_learn(here, bit);
    reel_learn(all, bit);
    return bit;
}

/* Where a bit of a context is, if there is a context. */
#define REEL_HERE(here, bit) ((here) ? &(here)->bit : NULL)

REEL_INLINE uint32_t reel_code_count_within(reel_port *port, reel_integer_model *all,
                                            reel_integer_model *here, uint32_t value) {
    int length = 0, wanted = reel_length(value);
    while (length < REEL_MOST_BITS &&
           reel_bit_within(port, &all->longer[length], REEL_HERE(here, longer[length]),
                           wanted > length)) {
        length++;
    }
    if (length < 2) {
        return (uint32_t)length;
    }
    int low = length - 2; /* bits below the second highest */
    uint32_t found = 2U | (uint32_t)reel_bit_within(port, &all->second[length - 1],
                                                    REEL_HERE(here, second[length - 1]),
                                                    (int)(value >> low & 1U));
    if (low > 0) {
        reel_model *third = &all->third[length - 1][found & 1U];
        low--;
        found = found << 1 | (uint32_t)reel_bit(port, third, (int)(value >> low & 1U));
    }
    while (low > 0) {
        int part = low < 16 ? low : 16;
        low -= part;
        found = found << part | reel_code_raw(port, part, value >> low);
    }
    return found;
}

/* An integer of 0..2^31-1. */
REEL_INLINE uint32_t reel_code_count(reel_port *port, reel_integer_model *model, uint32_t value) {
    return reel_code_count_within(port, model, NULL, value);
}

REEL_INLINE int32_t reel_code_integer_within(reel_port *port, reel_integer_model *all,
                                             reel_integer_model *here, int sign, int32_t value) {
    uint32_t size = value < 0 ? 0U - (uint32_t)value : (uint32_t)value;
    size = reel_code_count_within(port, all, here, size);
    if (size == 0) {
        return 0;
    }
    int negative = reel_bit_within(port, &all->negative[sign], REEL_HERE(here, negative[sign]),
                                   value < 0);
    return negative ? -(int32_t)size : (int32_t)size;
}

/* An integer of -(2^31-1)..2^31-1. */
REEL_INLINE int32_t reel_code_integer(reel_port *port, reel_integer_model *model, int32_t value) {
    return reel_code_integer_within(port, model, NULL, 0, value);
}

#endif
