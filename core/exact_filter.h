/* The filter of the exact coder: weights of neighbours that predict the moves of an item.

   docs/format.md, "Exact values": one of Kalman's, which learns from each number of the item. */

#ifndef REEL_EXACT_FILTER_H
#define REEL_EXACT_FILTER_H

#include "exact_state.h"

#define WIDE 1000.0                    /* variance of weights that are not known */
#define FADING (1.0 / 0.99)            /* of what is known about weights, in a frame */

static void start_filter(exact_coder *f) {
    int n = f->n_near, n_used = n + TEMPORAL;
    f->noise = 0;
    for (; f->n_filled > n; f->n_filled--) { /* numbers behind those of near items are 0 */
        for (size_t at = 0; at < 2 * exact_moves_count(f->width); at += INPUTS) {
            f->moves[at + (size_t)f->n_filled - 1] = 0;
        }
    }
    f->n_filled = n;
    f->first = 1 - MOVE_FRAMES; /* there are none, and none for frame 0 */
    for (int i = 0; i < INPUTS; i++) {
        f->weights[i] = i < n ? 1.0 / n : i < n_used ? f->models->temporal[i - n] : 0;
        for (int j = 0; j < INPUTS; j++) {
            f->doubt[INPUTS * i + j] = 0;
        }
        f->doubt[INPUTS * i + i] = i < n ? WIDE / (n + 1) : i < n_used ? WIDE : 0;
    }
    for (int i = 0; i < n; i++) {
        f->noise += f->noises[f->near[i]];
    }
    f->noise = f->quick_noise = n ? f->noise / n : 0;
}

static void end_filter(exact_coder *f) {
    f->noises[f->place] = f->noise;
    for (int i = 0; i < TEMPORAL; i++) {
        double *weight = &f->models->temporal[i];
        *weight += (f->weights[f->n_near + i] - *weight) / 64;
    }
}

/* Moves of the near items, from a frame on and at the one before, for as many as are kept. */
static void find_moves(exact_coder *f, int64_t first) {
    int64_t w = f->width, stride = f->n_frames * w, end = first + MOVE_FRAMES;
    int64_t from = first > 1 ? first - 1 : 1, none = (first - 1) * w;
    end = end < f->n_frames ? end : f->n_frames;
    f->first = first;
    for (int i = 0; i < f->n_near; i++) {
        const double *row = f->known + f->near[i] * stride;
        for (int64_t at = from * w; at < end * w; at++) {
            f->moves[(at - none) * INPUTS + i] = row[at] - row[at - w];
        }
    }
    for (int64_t t = first; f->has_lags && t < end; t++) {
        int64_t lag = f->lags[t];
        for (int i = 0; lag && i < f->n_near; i++) {
            const double *row = f->known + f->near[i] * stride;
            for (int64_t at = t * w; at < (t + 1) * w; at++) {
                f->again[(at - none) * INPUTS + i] = row[at - lag * w] - row[at - w];
            }
        }
    }
}

#endif
