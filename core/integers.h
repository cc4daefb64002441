/* Adaptive integers: magnitude length in unary, the next two bits, then the sign.

   docs/format.md, "Integers". Lower bits are raw: no context predicts them. A bit may be coded in a
   context; its probability is then a mix of the context's model and the model shared by all
   contexts, and both adapt. */

#ifndef REEL_INTEGERS_H
#define REEL_INTEGERS_H

#include "bits.h"

#define REEL_MAX_MAGNITUDE_BITS 31

typedef struct {
    reel_model longer[REEL_MAX_MAGNITUDE_BITS]; /* by length so far: is the magnitude longer? */
    reel_model second[REEL_MAX_MAGNITUDE_BITS]; /* by length: second highest bit */
    /* By length and second highest bit: third highest bit. */
    reel_model third[REEL_MAX_MAGNITUDE_BITS][2];
    reel_model negative[3]; /* by the sign of the previous integer: none, +, - */
} reel_integer_model;

REEL_INLINE void reel_reset_integer_model(reel_integer_model *model) {
    for (int i = 0; i < REEL_MAX_MAGNITUDE_BITS; i++) {
        model->longer[i] = reel_model_of(32768, 0);
        model->second[i] = reel_model_of(32768, 0);
        model->third[i][0] = model->third[i][1] = reel_model_of(32768, 0);
    }
    for (int i = 0; i < 3; i++) {
        model->negative[i] = reel_model_of(32768, 0);
    }
}

#define REEL_MAX_INHERITED_COUNT 3 /* largest count that a new context takes over */

/* Code a bit with the model shared by all contexts and the model of its context: all zeros before
   its first bit, or NULL without a context. */
REEL_INLINE int reel_bit_in_context(reel_range_coder *coder, reel_model *shared,
                                    reel_model *context, int bit) {
    if (!context) {
        return reel_bit(coder, shared, bit);
    }
    if (!context->count) {
        *context = *shared;
        context->count =
            shared->count < REEL_MAX_INHERITED_COUNT ? shared->count : REEL_MAX_INHERITED_COUNT;
    }
    bit =
        reel_code_bit(coder, (3 * reel_probability(context) + reel_probability(shared)) >> 2, bit);
    reel_update_model(context, bit);
    reel_update_model(shared, bit);
    return bit;
}

/* The model of one bit of a context, or NULL without a context. */
#define REEL_CONTEXT_MODEL(context, bit) ((context) ? &(context)->bit : NULL)

REEL_INLINE uint32_t reel_code_count_in_context(reel_range_coder *coder, reel_integer_model *shared,
                                                reel_integer_model *context, uint32_t value) {
    int length = 0, target_length = reel_bit_length(value);
    while (length < REEL_MAX_MAGNITUDE_BITS &&
           reel_bit_in_context(coder, &shared->longer[length],
                               REEL_CONTEXT_MODEL(context, longer[length]),
                               target_length > length)) {
        length++;
    }
    if (length < 2) {
        return (uint32_t)length;
    }
    int low = length - 2; /* bits below the second highest */
    uint32_t result =
        2U | (uint32_t)reel_bit_in_context(coder, &shared->second[length - 1],
                                           REEL_CONTEXT_MODEL(context, second[length - 1]),
                                           (int)(value >> low & 1U));
    if (low > 0) {
        reel_model *third = &shared->third[length - 1][result & 1U];
        low--;
        result = result << 1 | (uint32_t)reel_bit(coder, third, (int)(value >> low & 1U));
    }
    while (low > 0) {
        int count = low < 16 ? low : 16;
        low -= count;
        result = result << count | reel_code_raw(coder, count, value >> low);
    }
    return result;
}

/* Code an integer of 0..2^31-1. */
REEL_INLINE uint32_t reel_code_count(reel_range_coder *coder, reel_integer_model *model,
                                     uint32_t value) {
    return reel_code_count_in_context(coder, model, NULL, value);
}

REEL_INLINE int32_t reel_code_integer_in_context(reel_range_coder *coder,
                                                 reel_integer_model *shared,
                                                 reel_integer_model *context, int sign,
                                                 int32_t value) {
    uint32_t size = value < 0 ? 0U - (uint32_t)value : (uint32_t)value;
    size = reel_code_count_in_context(coder, shared, context, size);
    if (size == 0) {
        return 0;
    }
    int negative = reel_bit_in_context(coder, &shared->negative[sign],
                                       REEL_CONTEXT_MODEL(context, negative[sign]), value < 0);
    return negative ? -(int32_t)size : (int32_t)size;
}

/* Code an integer of -(2^31-1)..2^31-1. */
REEL_INLINE int32_t reel_code_integer(reel_range_coder *coder, reel_integer_model *model,
                                      int32_t value) {
    return reel_code_integer_in_context(coder, model, NULL, 0, value);
}

#endif
