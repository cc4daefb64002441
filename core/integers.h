/* Integers as adaptive bits: is it 0, its sign, its length in unary, its second highest bit.

   docs/format.md, "Integers in contexts". Lower bits are noise that no context predicts: raw. */

#ifndef REEL_INTEGERS_H
#define REEL_INTEGERS_H

#include "bits.h"

#define REEL_MOST_BITS 31 /* of a magnitude */

typedef struct {
    reel_model longer[REEL_MOST_BITS]; /* by length so far: is the magnitude longer? */
    reel_model upper[REEL_MOST_BITS];  /* by length: the second highest bit */
    reel_model negative;
} reel_integer_model;

REEL_INLINE void reel_start_integers(reel_integer_model *model) {
    for (int i = 0; i < REEL_MOST_BITS; i++) {
        model->longer[i] = reel_model_of(32768, 0);
        model->upper[i] = reel_model_of(32768, 0);
    }
    model->negative = reel_model_of(32768, 0);
}

/* An integer of 0..2^31-1. */
REEL_INLINE uint32_t reel_code_count(reel_port *port, reel_integer_model *model, uint32_t value) {
    int length = 0, wanted = reel_length(value);
    while (length < REEL_MOST_BITS && reel_bit(port, &model->longer[length], wanted > length)) {
        length++;
    }
    if (length < 2) {
        return (uint32_t)length;
    }
    int low = length - 2; /* bits below the second highest */
    uint32_t found = 2U | (uint32_t)reel_bit(port, &model->upper[length - 1], value >> low & 1U);
    while (low > 0) {
        int here = low < 16 ? low : 16;
        low -= here;
        found = found << here | reel_code_raw(port, here, value >> low);
    }
    return found;
}

/* An integer of -(2^31-1)..2^31-1. */
REEL_INLINE int32_t reel_code_integer(reel_port *port, reel_integer_model *model, int32_t value) {
    uint32_t size = value < 0 ? 0U - (uint32_t)value : (uint32_t)value;
    size = reel_code_count(port, model, size);
    if (size == 0) {
        return 0;
    }
    return reel_bit(port, &model->negative, value < 0) ? -(int32_t)size : (int32_t)size;
}

#endif
