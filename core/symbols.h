/* Adaptive symbols of 0..15, coded with the range coder.

   docs/format.md, "Symbols". A model is a table of cumulative probabilities that moves towards the
   coded symbol, fast at first. A symbol in a context has the mean probability of two models. */

#ifndef REEL_SYMBOLS_H
#define REEL_SYMBOLS_H

#include "bits.h"

#define REEL_SYMBOLS 16
#define REEL_SYMBOL_BITS 15   /* probabilities are in units of 2^-15 */
#define REEL_SYMBOL_ONE 32768 /* 2^REEL_SYMBOL_BITS */
#define REEL_MIN_SYMBOL 2     /* lower bound of the probability of a symbol */
/* A model moves by at least 2^-7; in contexts, where fewer symbols are seen, by 2^-5. */
#define REEL_SLOWEST_SYMBOL 7
#define REEL_SLOWEST_IN_CONTEXT 5

typedef int16_t reel_vec8s __attribute__((vector_size(16), may_alias));

/* `below[i]` is the probability of a symbol less than i; below[16] would exceed int16_t. */
typedef struct {
    _Alignas(16) int16_t below[REEL_SYMBOLS];
    uint16_t count; /* symbols coded so far, plus 1; 0 before the first use */
} reel_symbol_model;

/* Return a model in which all symbols are equally probable. */
REEL_INLINE reel_symbol_model reel_new_symbol_model(void) {
    reel_symbol_model model = {.count = 1};
    for (int i = 0; i < REEL_SYMBOLS; i++) {
        model.below[i] = (int16_t)(i * (REEL_SYMBOL_ONE / REEL_SYMBOLS));
    }
    return model;
}

/* Table i is where a model moves after symbol i. */
#define REEL_LOW(i) ((i) * REEL_MIN_SYMBOL)
#define REEL_HIGH(i) (REEL_SYMBOL_ONE - (REEL_SYMBOLS - (i)) * REEL_MIN_SYMBOL)
#define REEL_AT(s, i) ((i) <= (s) ? REEL_LOW(i) : REEL_HIGH(i))
#define REEL_ROW(s)                                                                        \
    {REEL_AT(s, 0),  REEL_AT(s, 1),  REEL_AT(s, 2),  REEL_AT(s, 3),  REEL_AT(s, 4),          \
     REEL_AT(s, 5),  REEL_AT(s, 6),  REEL_AT(s, 7),  REEL_AT(s, 8),  REEL_AT(s, 9),          \
     REEL_AT(s, 10), REEL_AT(s, 11), REEL_AT(s, 12), REEL_AT(s, 13), REEL_AT(s, 14),         \
     REEL_AT(s, 15)}
_Alignas(16) static const int16_t reel_symbol_targets[REEL_SYMBOLS][REEL_SYMBOLS] = {
    REEL_ROW(0),  REEL_ROW(1),  REEL_ROW(2),  REEL_ROW(3),  REEL_ROW(4),  REEL_ROW(5),
    REEL_ROW(6),  REEL_ROW(7),  REEL_ROW(8),  REEL_ROW(9),  REEL_ROW(10), REEL_ROW(11),
    REEL_ROW(12), REEL_ROW(13), REEL_ROW(14), REEL_ROW(15),
};

REEL_INLINE void reel_update_symbol_model(reel_symbol_model *model, int symbol, int slowest) {
    int rate = reel_bit_length(model->count);
    rate = rate < slowest ? rate : slowest;
    const reel_vec8s *target = (const reel_vec8s *)reel_symbol_targets[symbol];
    reel_vec8s *below = (reel_vec8s *)model->below;
    below[0] += (target[0] - below[0]) >> rate;
    below[1] += (target[1] - below[1]) >> rate;
    model->count = (uint16_t)(model->count + (model->count < 1 << REEL_SLOWEST_SYMBOL));
}

/* Return the index of the last of 16 ascending numbers, the first 0, that is at most `value`. */
REEL_INLINE int reel_find_symbol(const int16_t *below, uint32_t value) {
    const reel_vec8s *all = (const reel_vec8s *)below;
    reel_vec8s limit = {0};
    limit += (int16_t)value;
    union {
        reel_vec8s lanes;
        uint64_t words[2];
    } counts = {.lanes = -((all[0] <= limit) + (all[1] <= limit))};
    return (int)((counts.words[0] + counts.words[1]) * 0x0001000100010001U >> 48) - 1;
}

/* Code a symbol of cumulative probabilities that differ by at least 1. */
REEL_INLINE int reel_code_symbol_of(reel_range_coder *coder, const int16_t *below, int symbol) {
    uint64_t unit = coder->range >> REEL_SYMBOL_BITS;
    if (!reel_is_encoder(coder)) {
        uint64_t value = coder->low / unit; /* 2^15 or more by rounding, or in damaged streams */
        value = value < REEL_SYMBOL_ONE ? value : REEL_SYMBOL_ONE - 1;
        symbol = reel_find_symbol(below, (uint32_t)value);
    }
    uint32_t lower = (uint32_t)below[symbol];
    uint32_t upper = symbol + 1 < REEL_SYMBOLS ? (uint32_t)below[symbol + 1] : REEL_SYMBOL_ONE;
    if (reel_is_encoder(coder)) {
        uint64_t low = coder->low + unit * lower;
        if (low < coder->low) {
            reel_propagate_carry(coder);
        }
        coder->low = low;
    } else {
        coder->low -= unit * lower;
    }
    coder->range = unit * (upper - lower);
    if (coder->range < (uint64_t)1 << 32) {
        reel_renormalize(coder);
    }
    return symbol;
}

REEL_INLINE int reel_code_symbol(reel_range_coder *coder, reel_symbol_model *model, int symbol) {
    symbol = reel_code_symbol_of(coder, model->below, symbol);
    reel_update_symbol_model(model, symbol, REEL_SLOWEST_SYMBOL);
    return symbol;
}

/* Code a symbol with a shared model and that of its context, all zeros before its first use. */
REEL_INLINE int reel_code_symbol_in_context(reel_range_coder *coder, reel_symbol_model *shared,
                                            reel_symbol_model *context, int symbol) {
    if (!context->count) {
        *context = *shared;
        context->count = shared->count < 2 ? shared->count : 2;
    }
    union {
        reel_vec8s lanes[2];
        int16_t below[REEL_SYMBOLS];
    } mean;
    for (int i = 0; i < 2; i++) {
        const reel_vec8s *a = (const reel_vec8s *)shared->below + i;
        const reel_vec8s *b = (const reel_vec8s *)context->below + i;
        mean.lanes[i] = (*a >> 1) + (*b >> 1);
    }
    symbol = reel_code_symbol_of(coder, mean.below, symbol);
    reel_update_symbol_model(shared, symbol, REEL_SLOWEST_IN_CONTEXT);
    reel_update_symbol_model(context, symbol, REEL_SLOWEST_IN_CONTEXT);
    return symbol;
}

#endif
