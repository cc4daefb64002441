/* A bit that several models predict: their opinions are weighed, and the weights are learned.

   docs/format.md, "Mixed bits". An opinion is the logarithm of odds, in units of 1/256. A model
   that has seen nothing has no opinion, and begins with what the others say. All in integers. */

#ifndef REEL_MIXER_H
#define REEL_MIXER_H

#include "bits.h"

#define REEL_MOST_OPINIONS 8
#define REEL_ODDS 2047            /* opinions lie within -REEL_ODDS..REEL_ODDS */
#define REEL_LEAST_MIXED 24U      /* least probability of either value, by 65536 */
#define REEL_HEAVIEST (1 << 20)   /* weights lie within -REEL_HEAVIEST..REEL_HEAVIEST, by 65536 */
#define REEL_WEIGHT_SHIFT 14      /* how slowly weights are learned */

/* round(65536 / (1 + exp(-(i - 16) / 2))) for i = 0..32. */
static const uint16_t reel_logistic[33] = {
    22,    36,    60,    98,    162,   267,   439,   720,   1179,  1921,  3108,
    4971,  7812,  11955, 17625, 24743, 32768, 40793, 47911, 53581, 57724, 60565,
    62428, 63615, 64357, 64816, 65097, 65269, 65374, 65438, 65476, 65500, 65514,
};

/* The probability by 65536 of odds within -REEL_ODDS..REEL_ODDS. */
REEL_INLINE uint32_t reel_squash(int32_t odds) {
    uint32_t place = (uint32_t)(odds + 2048), above = place & 127U;
    const uint16_t *row = &reel_logistic[place >> 7];
    return (row[0] * (128U - above) + row[1] * above) >> 7;
}

/* Odds of probabilities by 4096: the inverse of `reel_squash`. */
typedef struct {
    int16_t odds[4096];
} reel_odds_table;

REEL_INLINE void reel_fill_odds(reel_odds_table *table) {
    int32_t odds = -REEL_ODDS;
    for (uint32_t p = 0; p < 4096; p++) {
        while (odds < REEL_ODDS && reel_squash(odds) < 16 * p + 8) {
            odds++;
        }
        table->odds[p] = (int16_t)odds;
    }
}

typedef struct {
    int32_t of[REEL_MOST_OPINIONS]; /* by 65536 */
} reel_weights;

REEL_INLINE int32_t reel_clamp(int64_t value, int32_t most) {
    return value < -most ? -most : value > most ? most : (int32_t)value;
}

/* value / 2^shift, rounded down. */
REEL_INLINE int64_t reel_halve(int64_t value, int shift) {
    return value < 0 ? -((((int64_t)1 << shift) - 1 - value) >> shift) : value >> shift;
}

/* A bit that models[0..n-1] predict; they and the weights learn from it. */
REEL_INLINE int reel_mixed_bit(reel_port *port, const reel_odds_table *table,
                               reel_weights *weights, reel_model *const *models, int n, int bit) {
    int32_t odds[REEL_MOST_OPINIONS];
    int64_t sum = 0;
    for (int i = 0; i < n; i++) {
        odds[i] = models[i]->seen ? table->odds[reel_probability(models[i]) >> 4] : 0;
        sum += (int64_t)odds[i] * weights->of[i];
    }
    uint32_t ones = reel_squash(reel_clamp(reel_halve(sum, 16), REEL_ODDS));
    ones = ones < REEL_LEAST_MIXED            ? REEL_LEAST_MIXED
           : ones > 65536U - REEL_LEAST_MIXED ? 65536U - REEL_LEAST_MIXED
                                              : ones;
    bit = reel_code_bit(port, ones, bit);
    int32_t missed = (bit ? 65536 : 0) - (int32_t)ones;
    for (int i = 0; i < n; i++) {
        int64_t change = reel_halve((int64_t)odds[i] * missed, REEL_WEIGHT_SHIFT);
        weights->of[i] = reel_clamp(weights->of[i] + change, REEL_HEAVIEST);
        if (models[i]->seen == 0) {
            *models[i] = reel_model_of(ones, 1);
        }
        reel_learn(models[i], bit);
    }
    return bit;
}

#endif
