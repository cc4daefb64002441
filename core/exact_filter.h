/* The filter of the exact coder: weights of the neighbors that predict the motion of an item.

   docs/format.md, "Exact values". A Kalman filter per item, updated after each number. */

#ifndef REEL_EXACT_FILTER_H
#define REEL_EXACT_FILTER_H

#include "exact_state.h"

#define INITIAL_VARIANCE 1000.0        /* initial variance of the weights */
#define COVARIANCE_GROWTH (1.0 / 0.99) /* growth of the covariance per frame */

/* Start from equal weights of the neighbors, and from their noise. */
static void start_filter(exact_coder *coder) {
    motion_filter *filter = &coder->filter;
    int n = coder->item.n_near, n_used = n + TEMPORAL;
    for (; filter->n_filled > n; filter->n_filled--) {
        for (size_t row = 0; row < 2 * exact_motions_count(coder->width); row += INPUTS) {
            filter->motions[row + (size_t)filter->n_filled - 1] = 0;
        }
    }
    filter->n_filled = n;
    filter->first_frame = 1 - MOTION_FRAMES; /* no motions are stored yet; frame 0 has none */
    for (int i = 0; i < INPUTS; i++) {
        filter->weights[i] = i < n ? 1.0 / n : i < n_used ? coder->models->temporal[i - n] : 0;
        for (int j = 0; j < INPUTS; j++) {
            filter->covariance[INPUTS * i + j] = 0;
        }
        filter->covariance[INPUTS * i + i] = i < n        ? INITIAL_VARIANCE / (n + 1)
                                             : i < n_used ? INITIAL_VARIANCE
                                                          : 0;
    }
    double noise = 0;
    for (int i = 0; i < n; i++) {
        noise += coder->past.noises[coder->item.near[i]];
    }
    filter->noise = filter->fast_noise = n ? noise / n : 0;
}

/* Store the noise and the temporal weights, from which the filters of later items start. */
static void end_filter(exact_coder *coder) {
    coder->past.noises[coder->item.position] = coder->filter.noise;
    for (int i = 0; i < TEMPORAL; i++) {
        double *weight = &coder->models->temporal[i];
        *weight += (coder->filter.weights[coder->item.n_near + i] - *weight) / 64;
    }
}

/* Store the motions of the neighbors, from the previous and from the lagged frame, for
   MOTION_FRAMES frames starting at `first` and for the one before. */
static void load_motions(exact_coder *coder, int64_t first) {
    int64_t w = coder->width, stride = coder->n_frames * w, end = first + MOTION_FRAMES;
    int64_t begin = first > 1 ? first - 1 : 1, origin = (first - 1) * w;
    end = end < coder->n_frames ? end : coder->n_frames;
    motion_filter *filter = &coder->filter;
    const current_item *item = &coder->item;
    filter->first_frame = first;
    for (int i = 0; i < item->n_near; i++) {
        const double *row = coder->past.values + item->near[i] * stride;
        for (int64_t index = begin * w; index < end * w; index++) {
            filter->motions[(index - origin) * INPUTS + i] = row[index] - row[index - w];
        }
    }
    for (int64_t t = first; coder->choices.has_lags && t < end; t++) {
        int64_t lag = coder->lags[t];
        for (int i = 0; lag && i < item->n_near; i++) {
            const double *row = coder->past.values + item->near[i] * stride;
            for (int64_t index = t * w; index < (t + 1) * w; index++) {
                filter->lagged_motions[(index - origin) * INPUTS + i] =
                    row[index - lag * w] - row[index - w];
            }
        }
    }
}

#endif
