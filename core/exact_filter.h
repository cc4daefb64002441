/* The filter of the exact coder: weights of the neighbors that predict the motion of an item.

   docs/format.md, "Exact values". A Kalman filter per item, updated after each number. */

#ifndef REEL_EXACT_FILTER_H
#define REEL_EXACT_FILTER_H

#include "exact_state.h"

#define INITIAL_VARIANCE 1000.0        /* initial variance of the weights */
#define COVARIANCE_GROWTH (1.0 / 0.99) /* growth of the covariance per frame */

static void begin_item_filter(exact_coder *f) {
    int n = f->n_near, n_used = n + TEMPORAL;
    f->noise = 0;
    for (; f->n_filled > n; f->n_filled--) { /* columns beyond the neighbors are 0 */
        for (size_t at = 0; at < 2 * exact_motions_count(f->width); at += INPUTS) {
            f->motions[at + (size_t)f->n_filled - 1] = 0;
        }
    }
    f->n_filled = n;
    f->first = 1 - MOTION_FRAMES; /* no motions are stored yet; frame 0 has none */
    for (int i = 0; i < INPUTS; i++) {
        f->weights[i] = i < n ? 1.0 / n : i < n_used ? f->models->temporal[i - n] : 0;
        for (int j = 0; j < INPUTS; j++) {
            f->covariance[INPUTS * i + j] = 0;
        }
        f->covariance[INPUTS * i + i] = i < n        ? INITIAL_VARIANCE / (n + 1)
                                        : i < n_used ? INITIAL_VARIANCE
                                                     : 0;
    }
    for (int i = 0; i < n; i++) {
        f->noise += f->noises[f->near[i]];
    }
    f->noise = f->fast_noise = n ? f->noise / n : 0;
}

static void end_filter(exact_coder *f) {
    f->noises[f->position] = f->noise;
    for (int i = 0; i < TEMPORAL; i++) {
        double *weight = &f->models->temporal[i];
        *weight += (f->weights[f->n_near + i] - *weight) / 64;
    }
}

/* Store the motions of the neighbors, from the previous and from the lagged frame, for
   MOTION_FRAMES frames starting at `first` and for the one before. */
static void load_motions(exact_coder *f, int64_t first) {
    int64_t w = f->width, stride = f->n_frames * w, end = first + MOTION_FRAMES;
    int64_t from = first > 1 ? first - 1 : 1, origin = (first - 1) * w;
    end = end < f->n_frames ? end : f->n_frames;
    f->first = first;
    for (int i = 0; i < f->n_near; i++) {
        const double *row = f->known + f->near[i] * stride;
        for (int64_t at = from * w; at < end * w; at++) {
            f->motions[(at - origin) * INPUTS + i] = row[at] - row[at - w];
        }
    }
    for (int64_t t = first; f->has_lags && t < end; t++) {
        int64_t lag = f->lags[t];
        for (int i = 0; lag && i < f->n_near; i++) {
            const double *row = f->known + f->near[i] * stride;
            for (int64_t at = t * w; at < (t + 1) * w; at++) {
                f->lagged_motions[(at - origin) * INPUTS + i] = row[at - lag * w] - row[at - w];
            }
        }
    }
}

#endif
