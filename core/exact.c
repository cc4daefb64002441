/* Lossless values over time on a graph: each is predicted from its past and its neighbors.

   docs/format.md, "Exact values". Items are coded one by one, each with all its frames: earlier
   neighbors are then known at every time, and the state of an item stays in the fastest cache. A
   number is mapped to its index in the order of numbers; the difference of its index and the
   predicted one is coded. This file has the block header and the decoder's entry point;
   exact_items.c codes the items, exact_encode.c has the encoder's entry point. */

#include "exact_state.h"

static void allocate_state(exact_coder *coder, reel_arena *arena) {
    size_t n = (size_t)coder->n_items, n_rows = n * (size_t)coder->n_frames,
           n_numbers = n_rows * (size_t)coder->width;
    size_t row_size = (size_t)(coder->n_frames * coder->width);
    reel_allocate_traversal(&coder->traversal, arena, n);
    coder->models = reel_allocate(arena, 1, sizeof *coder->models);
    coder->columns = reel_allocate(arena, (size_t)coder->width, sizeof *coder->columns);
    coder->past.values = reel_allocate(arena, n_numbers, sizeof *coder->past.values);
    coder->past.sizes = reel_allocate(arena, n_numbers, sizeof *coder->past.sizes);
    coder->past.flags = reel_allocate(arena, n_rows, 1);
    coder->past.is_constant = reel_allocate(arena, n, 1);
    coder->lags = reel_allocate(arena, (size_t)coder->n_frames, sizeof *coder->lags);
    coder->samples =
        reel_allocate(arena, (size_t)coder->n_frames * N_SAMPLES, sizeof *coder->samples);
    coder->past.noises = reel_allocate(arena, n, sizeof *coder->past.noises);
    coder->item.patterns = reel_allocate(arena, row_size, sizeof *coder->item.patterns);
    coder->item.near_size_sums = reel_allocate(arena, row_size, sizeof *coder->item.near_size_sums);
    coder->item.max_near_sizes = reel_allocate(arena, row_size, sizeof *coder->item.max_near_sizes);
    coder->filter.motions =
        reel_allocate(arena, 2 * exact_motions_count(coder->width), sizeof *coder->filter.motions);
    coder->filter.lagged_motions =
        coder->filter.motions ? coder->filter.motions + exact_motions_count(coder->width) : NULL;
    coder->filter.n_filled = INPUTS;
}

size_t reel_exact_memory(int64_t n_frames, int64_t n_items, int64_t width) {
    exact_coder coder = {.n_frames = n_frames, .n_items = n_items, .width = width};
    reel_arena arena = REEL_MEASURE;
    allocate_state(&coder, &arena);
    return arena.used;
}

static void start_models(exact_coder *coder) {
    static const int32_t weights[N_INPUTS] = {0, 32768, 32768, 8192, 0, 0, 0};
    exact_models *models = coder->models;
    reel_model *all = (reel_model *)models;
    size_t count = offsetof(exact_models, weights) / sizeof *all;
    for (size_t i = 0; i < count; i++) {
        all[i] = reel_model_of(32768, 0);
    }
    reel_copy(models->weights, weights, sizeof weights);
    models->temporal[0] = models->temporal[1] = 0;
    models->last_special = 0;
    reel_zero(coder->columns, (size_t)coder->width * sizeof *coder->columns);
}

static void code_raw_values(exact_coder *coder) {
    int64_t size = coder->n_frames * coder->n_items * coder->width * coder->numbers.size;
    for (int64_t i = 0; i < size; i++) {
        coder->values[i] = (uint8_t)reel_code_raw(coder->range_coder, 8, coder->values[i]);
    }
}

/* ---- the header of a block ---- */

/* Code the lag of each frame: the distance of an earlier frame that it resembles, or 0. */
static void code_lags(exact_coder *coder) {
    int32_t last = 0;
    coder->lags[0] = 0;
    for (int64_t t = 1; t < coder->n_frames; t++) {
        int32_t lag = reel_is_encoder(coder->range_coder) ? coder->lags[t] : 0;
        if (!reel_bit(coder->range_coder, &coder->models->lag_repeats, lag == last)) {
            last = (int32_t)reel_code_raw(coder->range_coder, 28, (uint32_t)lag);
        }
        coder->lags[t] = last <= t ? last : 0; /* invalid only in damaged streams */
    }
}

static enum reel_code code_grid(exact_coder *coder) {
    reel_numbers *numbers = &coder->numbers;
    reel_range_coder *range_coder = coder->range_coder;
    if (numbers->type != REEL_FLOATS) {
        reel_set_scale(numbers, 8 * numbers->size);
        return REEL_OK;
    }
    uint32_t shift = reel_code_raw(range_coder, 6, (uint32_t)numbers->shift);
    uint32_t digits = reel_code_raw(range_coder, 4, (uint32_t)numbers->digits);
    uint32_t places = reel_code_raw(range_coder, 5, (uint32_t)numbers->places);
    uint32_t scale = reel_code_raw(range_coder, 11, (uint32_t)(numbers->scale + REEL_MAX_SCALE));
    if (shift >= 8 * (uint32_t)numbers->size || places > REEL_MAX_PLACES ||
        scale > 2 * REEL_MAX_SCALE) {
        return REEL_CORRUPT;
    }
    numbers->shift = (int)shift;
    if (digits) {
        reel_set_decimal(numbers, (int)digits, (int)places);
    }
    reel_set_scale(numbers, (int)scale - REEL_MAX_SCALE);
    return REEL_OK;
}

int64_t reel_exact_block(exact_coder *coder, int64_t count) {
    coder->choices.kind = (int)reel_code_raw(coder->range_coder, 2, (uint32_t)coder->choices.kind);
    if (coder->choices.kind == LABELS) { /* bit patterns */
        coder->numbers.shift = coder->numbers.digits = 0;
    }
    coder->choices.in_given_order =
        coder->choices.kind == LABELS &&
        reel_code_raw(coder->range_coder, 1, coder->choices.in_given_order);
    if (coder->choices.in_given_order) {
        reel_traverse_in_order(&coder->traversal);
    } else if (coder->traversal.in_given_order) {
        reel_traverse_graph(&coder->traversal);
    }
    if (coder->choices.kind == RAW) {
        code_raw_values(coder);
        return reel_finish(coder->range_coder);
    }
    start_models(coder);
    if (coder->choices.kind != LABELS) {
        if (code_grid(coder)) {
            return reel_failure(REEL_CORRUPT, 0);
        }
        coder->choices.has_special =
            reel_code_raw(coder->range_coder, 1, coder->choices.has_special);
    }
    coder->choices.has_repeats = coder->choices.kind == LABELS ||
                                 reel_code_raw(coder->range_coder, 1, coder->choices.has_repeats);
    if (coder->choices.kind == FILTER) {
        coder->choices.has_lags = reel_code_raw(coder->range_coder, 1, coder->choices.has_lags);
        if (coder->choices.has_lags) {
            code_lags(coder);
        } else {
            reel_zero(coder->lags, (size_t)coder->n_frames * sizeof *coder->lags);
        }
    }
    reel_exact_items(coder, count);
    return reel_finish(coder->range_coder);
}

enum reel_code reel_exact_prepare(exact_coder *coder, void *memory, size_t memory_size,
                                  const int32_t *starts, const int32_t *near) {
    coder->traversal.graph = (reel_graph){(int32_t)coder->n_items, starts, near};
    if (!reel_is_graph(&coder->traversal.graph)) {
        return REEL_INVALID;
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
    allocate_state(coder, &arena);
    if (arena.failed) {
        return REEL_NO_MEMORY;
    }
    reel_traverse_graph(&coder->traversal);
    return REEL_OK;
}

int64_t reel_exact_decode(void *memory, size_t memory_size, const uint8_t *in, size_t in_size,
                          void *values, int64_t n_frames, int64_t n_items, int64_t width,
                          int64_t size, int64_t type, const int32_t *starts, const int32_t *near) {
    exact_coder coder = coder_of(values, n_frames, n_items, width, size, type);
    enum reel_code code = reel_exact_prepare(&coder, memory, memory_size, starts, near);
    if (code) {
        return reel_failure(code, 0);
    }
    reel_range_coder range_coder = reel_start_decoder(in, in_size);
    coder.range_coder = &range_coder;
    return reel_exact_block(&coder, n_items);
}
