/* The filter of the exact coder: weights of the neighbors that predict the motion of an item.

   docs/format.md, "Exact values". A Kalman filter per item, updated after each number. */

#ifndef REEL_EXACT_FILTER_H
#define REEL_EXACT_FILTER_H

#include "exact_state.h"

#define INITIAL_VARIANCE 1000.0        /* initial variance of the weights */
#define COVARIANCE_GROWTH (1.0 / 0.99) /* growth of the covariance per frame */

static void begin_item_filter(exact_coder *coder) {
    int n = coder->n_near, n_used = n + TEMPORAL;
    coder->noise = 0;
    for (; coder->n_filled > n; coder->n_filled--) { /* columns beyond the neighbors are 0 */
        for (size_t at = 0; at < 2 * exact_motions_count(coder->width); at += INPUTS) {
            coder->motions[at + (size_t)coder->n_filled - 1] = 0;
        }
    }
    coder->n_filled = n;
    coder->first = 1 - MOTION_FRAMES; /* no motions are stored yet; frame 0 has none */
    for (int i = 0; i < INPUTS; i++) {
        coder->weights[i] = i < n ? 1.0 / n : i < n_used ? coder->models->temporal[i - n] : 0;
        for (int j = 0; j < INPUTS; j++) {
            coder->covariance[INPUTS * i + j] = 0;
        }
        coder->covariance[INPUTS * i + i] = i < n        ? INITIAL_VARIANCE / (n + 1)
                                            : i < n_used ? INITIAL_VARIANCE
                                                         : 0;
    }
    for (int i = 0; i < n; i++) {
        coder->noise += coder->noises[coder->near[i]];
    }
    coder->noise = coder->fast_noise = n ? coder->noise / n : 0;
}

static void end_filter(exact_coder *coder) {
    coder->noises[coder->position] = coder->noise;
    for (int i = 0; i < TEMPORAL; i++) {
        double *weight = &coder->models->temporal[i];
        *weight += (coder->weights[coder->n_near + i] - *weight) / 64;
    }
}

/* Store the motions of the neighbors, from the previous and from the lagged frame, for
   MOTION_FRAMES frames starting at `first` and for the one before. */
static void load_motions(exact_coder *coder, int64_t first) {
    int64_t w = coder->width, stride = coder->n_frames * w, end = first + MOTION_FRAMES;
    int64_t from = first > 1 ? first - 1 : 1, origin = (first - 1) * w;
    end = end < coder->n_frames ? end : coder->n_frames;
    coder->first = first;
    for (int i = 0; i < coder->n_near; i++) {
        const double *row = coder->known + coder->near[i] * stride;
        for (int64_t at = from * w; at < end * w; at++) {
            coder->motions[(at - origin) * INPUTS + i] = row[at] - row[at - w];
        }
    }
    for (int64_t t = first; coder->has_lags && t < end; t++) {
        int64_t lag = coder->lags[t];
        for (int i = 0; lag && i < coder->n_near; i++) {
            const double *row = coder->known + coder->near[i] * stride;
            for (int64_t at = t * w; at < (t + 1) * w; at++) {
                coder->lagged_motions[(at - origin) * INPUTS + i] = row[at - lag * w] - row[at - w];
            }
        }
    }
}

#endif
