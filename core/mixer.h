/* Logistic mixing: a bit that several adaptive models predict, with weights learned online.

   docs/format.md, "Mixed bits". Models are mixed in the logit domain, in units of 1/256, all in
   integers. A model without observations contributes nothing, and is initialized with the mixed
   prediction. */

#ifndef REEL_MIXER_H
#define REEL_MIXER_H

#include "bits.h"

#define REEL_MAX_MIXED 8
#define REEL_MAX_LOGIT 2047            /* logits lie within -REEL_MAX_LOGIT..REEL_MAX_LOGIT */
#define REEL_MIN_MIXED_PROBABILITY 24U /* lower bound of the probability of either value, Q16 */
#define REEL_MAX_WEIGHT (1 << 20)      /* Q16 weights lie within +-REEL_MAX_WEIGHT */
#define REEL_WEIGHT_SHIFT 14           /* learning rate of the weights */

/* round(65536 / (1 + exp(-(i - 16) / 2))) for i = 0..32. */
static const uint16_t reel_logistic_table[33] = {
    22,    36,    60,    98,    162,   267,   439,   720,   1179,  1921,  3108,
    4971,  7812,  11955, 17625, 24743, 32768, 40793, 47911, 53581, 57724, 60565,
    62428, 63615, 64357, 64816, 65097, 65269, 65374, 65438, 65476, 65500, 65514,
};

/* Q16 probability of a logit: the logistic function, piecewise linear. */
REEL_INLINE uint32_t reel_logistic_of(int32_t logit) {
    uint32_t offset = (uint32_t)(logit + 2048), above = offset & 127U;
    const uint16_t *row = &reel_logistic_table[offset >> 7];
    return (row[0] * (128U - above) + row[1] * above) >> 7;
}

/* Logits of probabilities in units of 1/4096: the inverse of `reel_logistic_of`. */
typedef struct {
    int16_t logits[4096];
} reel_logit_table;

REEL_INLINE void reel_fill_logits(reel_logit_table *table) {
    int32_t logit = -REEL_MAX_LOGIT;
    for (uint32_t p = 0; p < 4096; p++) {
        while (logit < REEL_MAX_LOGIT && reel_logistic_of(logit) < 16 * p + 8) {
            logit++;
        }
        table->logits[p] = (int16_t)logit;
    }
}

typedef struct {
    int32_t of[REEL_MAX_MIXED]; /* Q16 */
} reel_weights;

REEL_INLINE int32_t reel_clamp(int64_t value, int32_t limit) {
    return value < -limit ? -limit : value > limit ? limit : (int32_t)value;
}

/* Return value / 2^shift, rounded down. */
REEL_INLINE int64_t reel_shift_down(int64_t value, int shift) {
    return value < 0 ? -((((int64_t)1 << shift) - 1 - value) >> shift) : value >> shift;
}

/* Code a bit that models[0..n-1] predict; update them and the weights. */
REEL_INLINE int reel_mixed_bit(reel_range_coder *coder, const reel_logit_table *table,
                               reel_weights *weights, reel_model *const *models, int n, int bit) {
    int32_t logits[REEL_MAX_MIXED];
    int64_t sum = 0;
    for (int i = 0; i < n; i++) {
        logits[i] = models[i]->count ? table->logits[reel_probability(models[i]) >> 4] : 0;
        sum += (int64_t)logits[i] * weights->of[i];
    }
    uint32_t probability = reel_logistic_of(reel_clamp(reel_shift_down(sum, 16), REEL_MAX_LOGIT));
    probability = probability < REEL_MIN_MIXED_PROBABILITY ? REEL_MIN_MIXED_PROBABILITY
                  : probability > 65536U - REEL_MIN_MIXED_PROBABILITY
                      ? 65536U - REEL_MIN_MIXED_PROBABILITY
                      : probability;
    bit = reel_code_bit(coder, probability, bit);
    int32_t error = (bit ? 65536 : 0) - (int32_t)probability;
    for (int i = 0; i < n; i++) {
        int64_t step = reel_shift_down((int64_t)logits[i] * error, REEL_WEIGHT_SHIFT);
        weights->of[i] = reel_clamp(weights->of[i] + step, REEL_MAX_WEIGHT);
        if (models[i]->count == 0) {
            *models[i] = reel_model_of(probability, 1);
        }
        reel_update_model(models[i], bit);
    }
    return bit;
}

#endif
