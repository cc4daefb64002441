/* A bit that several models predict: their opinions are weighed, and the weights are learned.

   docs/format.md, "Mixed bits". Opinions are added as logarithms of odds, in units of 1/256. A
   model that has seen little has weights of its own; one that has seen nothing has no opinion,
   and begins with what the others said. All in integers. */

#ifndef REEL_MIXER_H
#define REEL_MIXER_H

#include "bits.h"

#define REEL_MOST_OPINIONS 8
#define REEL_TRUST 6     /* classes of how much a model has seen */
#define REEL_ODDS 2047   /* opinions lie within -REEL_ODDS..REEL_ODDS */
#define REEL_SURE 24U    /* least probability of either value, by 65536 */
#ifndef RATE
#define RATE 15
#endif
#ifndef INHERIT
#define INHERIT 2
#endif

/* round(65536 / (1 + exp(-(i - 16) / 2))) for i = 0..32. */
static const uint32_t reel_logistic[33] = {
    22, 36, 60, 98, 162, 267, 439, 720, 1179, 1921, 3108,
    4971, 7812, 11955, 17625, 24743, 32768, 40793, 47911, 53581, 57724, 60565,
    62428, 63615, 64357, 64816, 65097, 65269, 65374, 65438, 65476, 65500, 65514,
};

/* The probability by 65536 of odds within -REEL_ODDS - 1..REEL_ODDS + 1. */
REEL_INLINE uint32_t reel_squash(int32_t odds) {
    uint32_t place = (uint32_t)(odds + 2048);
    uint32_t left = reel_logistic[place >> 7], right = reel_logistic[(place >> 7) + 1];
    return (left * (128 - (place & 127U)) + right * (place & 127U)) >> 7;
}

typedef struct {
    int16_t odds[4096]; /* of probabilities, by 4096: the inverse of reel_squash */
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
    int32_t weight[REEL_MOST_OPINIONS][REEL_TRUST]; /* by 65536 */
} reel_weights;

REEL_INLINE int reel_trust(const reel_model *model) {
    int bits = reel_length(model->seen); /* 0, 1, 2..3, 4..7, 8..15, more */
    return bits < REEL_TRUST ? bits : REEL_TRUST - 1;
}

/* A bit that models[0..n-1] predict; all of them, and the weights, learn from it. */
REEL_INLINE int reel_mixed_bit(reel_port *port, const reel_odds_table *table,
                               reel_weights *weights, reel_model *const *models, int n, int bit) {
    int32_t odds[REEL_MOST_OPINIONS];
    int64_t sum = 0;
    for (int i = 0; i < n; i++) {
        odds[i] = models[i]->seen ? table->odds[reel_probability(models[i]) >> 4] : 0;
        sum += (int64_t)odds[i] * weights->weight[i][reel_trust(models[i])];
    }
    sum >>= 16;
    sum = sum < -REEL_ODDS ? -REEL_ODDS : sum > REEL_ODDS ? REEL_ODDS : sum;
    uint32_t ones = reel_squash((int32_t)sum);
    ones = ones < REEL_SURE ? REEL_SURE : ones > 65536U - REEL_SURE ? 65536U - REEL_SURE : ones;
    bit = reel_code_bit(port, ones, bit);
    int32_t missed = (bit ? 65536 : 0) - (int32_t)ones;
    for (int i = 0; i < n; i++) {
        if (models[i]->seen == 0) {
            *models[i] = reel_model_of(ones, INHERIT);
        } else {
            weights->weight[i][reel_trust(models[i])] += (odds[i] * missed) >> RATE;
        }
        reel_learn(models[i], bit);
    }
    return bit;
}

#endif
