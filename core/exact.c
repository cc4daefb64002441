/* Lossless values over time on a graph: each is predicted from its past and its neighbors.

   docs/format.md, "Exact values". Items are coded one by one, each with all its frames: earlier
   neighbors are then known at every time, and the state of an item stays in the fastest cache. A
   number is mapped to its index in the order of numbers; the difference of its index and the
   predicted one is coded. This file has the block header and the decoder's entry point;
   exact_items.c codes the items, exact_encode.c has the encoder's entry point. */

#include "exact_state.h"

size_t reel_exact_memory(int64_t n_frames, int64_t n_items, int64_t width) {
    size_t n = (size_t)n_items, rows = n * (size_t)n_frames, all = rows * (size_t)width;
    size_t row = (size_t)(n_frames * width);
    return reel_traversal_bytes(n) + reel_array_bytes(1, sizeof(exact_models)) +
           reel_array_bytes((size_t)width, sizeof(column_state)) +
           reel_array_bytes(all, sizeof(double)) + reel_array_bytes(all, sizeof(int16_t)) +
           reel_array_bytes(rows, 1) + reel_array_bytes(n, 1) +
           reel_array_bytes((size_t)n_frames, sizeof(int32_t)) +
           reel_array_bytes((size_t)n_frames * N_SAMPLES, sizeof(float)) +
           reel_array_bytes(n, sizeof(double)) + reel_array_bytes(row, sizeof(uint64_t)) +
           reel_array_bytes(row, sizeof(int32_t)) + reel_array_bytes(row, sizeof(int16_t)) +
           reel_array_bytes(2 * exact_motions_count(width), sizeof(double));
}

static bool allocate_state(exact_coder *f, void *memory, size_t memory_size) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    size_t n = (size_t)f->n_items, rows = n * (size_t)f->n_frames, all = rows * (size_t)f->width;
    size_t row = (size_t)(f->n_frames * f->width);
    reel_allocate_traversal(&f->traversal, &arena, n);
    f->models = reel_allocate(&arena, 1, sizeof *f->models);
    f->columns = reel_allocate(&arena, (size_t)f->width, sizeof *f->columns);
    f->known = reel_allocate(&arena, all, sizeof *f->known);
    f->sizes = reel_allocate(&arena, all, sizeof *f->sizes);
    f->flags = reel_allocate(&arena, rows, 1);
    f->constant = reel_allocate(&arena, n, 1);
    f->lags = reel_allocate(&arena, (size_t)f->n_frames, sizeof *f->lags);
    f->samples = reel_allocate(&arena, (size_t)f->n_frames * N_SAMPLES, sizeof *f->samples);
    f->noises = reel_allocate(&arena, n, sizeof *f->noises);
    f->patterns = reel_allocate(&arena, row, sizeof *f->patterns);
    f->sums = reel_allocate(&arena, row, sizeof *f->sums);
    f->max_sizes = reel_allocate(&arena, row, sizeof *f->max_sizes);
    f->motions = reel_allocate(&arena, 2 * exact_motions_count(f->width), sizeof *f->motions);
    f->lagged_motions = arena.failed ? NULL : f->motions + exact_motions_count(f->width);
    f->n_filled = INPUTS;
    return !arena.failed;
}

static void start_models(exact_coder *f) {
    static const int32_t weights[N_INPUTS] = {0, 32768, 32768, 8192, 0, 0, 0};
    exact_models *models = f->models;
    reel_model *all = (reel_model *)models;
    size_t count = offsetof(exact_models, weights) / sizeof *all;
    for (size_t i = 0; i < count; i++) {
        all[i] = reel_model_of(32768, 0);
    }
    reel_copy(models->weights, weights, sizeof weights);
    models->temporal[0] = models->temporal[1] = 0;
    models->last_special = 0;
    reel_zero(f->columns, (size_t)f->width * sizeof *f->columns);
}

static void code_raw_values(exact_coder *f) {
    int64_t size = f->n_frames * f->n_items * f->width * f->numbers.size;
    for (int64_t i = 0; i < size; i++) {
        f->values[i] = (uint8_t)reel_code_raw(f->coder, 8, f->values[i]);
    }
}

/* ---- the header of a block ---- */

/* Code the lag of each frame: the distance of an earlier frame that it resembles, or 0. */
static void code_lags(exact_coder *f) {
    int32_t last = 0;
    f->lags[0] = 0;
    for (int64_t t = 1; t < f->n_frames; t++) {
        int32_t lag = reel_is_encoder(f->coder) ? f->lags[t] : 0;
        if (!reel_bit(f->coder, &f->models->lag_repeats, lag == last)) {
            last = (int32_t)reel_code_raw(f->coder, 28, (uint32_t)lag);
        }
        f->lags[t] = last <= t ? last : 0; /* invalid only in damaged streams */
    }
}

static enum reel_code code_grid(exact_coder *f) {
    reel_numbers *numbers = &f->numbers;
    reel_range_coder *coder = f->coder;
    if (numbers->type != REEL_FLOATS) {
        reel_set_scale(numbers, 8 * numbers->size);
        return REEL_OK;
    }
    uint32_t shift = reel_code_raw(coder, 6, (uint32_t)numbers->shift);
    uint32_t digits = reel_code_raw(coder, 4, (uint32_t)numbers->digits);
    uint32_t places = reel_code_raw(coder, 5, (uint32_t)numbers->places);
    uint32_t scale = reel_code_raw(coder, 11, (uint32_t)(numbers->scale + REEL_MAX_SCALE));
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

int64_t reel_exact_block(exact_coder *f, int64_t count) {
    f->kind = (int)reel_code_raw(f->coder, 2, (uint32_t)f->kind);
    if (f->kind == LABELS) { /* bit patterns */
        f->numbers.shift = f->numbers.digits = 0;
    }
    f->in_given_order = f->kind == LABELS && reel_code_raw(f->coder, 1, f->in_given_order);
    if (f->in_given_order) {
        reel_traverse_in_order(&f->traversal);
    } else if (f->traversal.in_given_order) {
        reel_traverse_graph(&f->traversal);
    }
    if (f->kind == RAW) {
        code_raw_values(f);
        return reel_finish(f->coder);
    }
    start_models(f);
    if (f->kind != LABELS) {
        if (code_grid(f)) {
            return reel_failure(REEL_CORRUPT, 0);
        }
        f->has_special = reel_code_raw(f->coder, 1, f->has_special);
    }
    f->has_repeats = f->kind == LABELS || reel_code_raw(f->coder, 1, f->has_repeats);
    if (f->kind == FILTER) {
        f->has_lags = reel_code_raw(f->coder, 1, f->has_lags);
        if (f->has_lags) {
            code_lags(f);
        } else {
            reel_zero(f->lags, (size_t)f->n_frames * sizeof *f->lags);
        }
    }
    reel_exact_items(f, count);
    return reel_finish(f->coder);
}

enum reel_code reel_exact_prepare(exact_coder *f, void *memory, size_t memory_size,
                                  const int32_t *starts, const int32_t *near) {
    f->traversal.graph = (reel_graph){(int32_t)f->n_items, starts, near};
    if (!reel_is_graph(&f->traversal.graph)) {
        return REEL_INVALID;
    }
    if (!allocate_state(f, memory, memory_size)) {
        return REEL_NO_MEMORY;
    }
    reel_traverse_graph(&f->traversal);
    return REEL_OK;
}

int64_t reel_exact_decode(void *memory, size_t memory_size, const uint8_t *in, size_t in_size,
                          void *values, int64_t n_frames, int64_t n_items, int64_t width,
                          int64_t size, int64_t type, const int32_t *starts,
                          const int32_t *near) {
    exact_coder f = coder_of(values, n_frames, n_items, width, size, type);
    enum reel_code code = reel_exact_prepare(&f, memory, memory_size, starts, near);
    if (code) {
        return reel_failure(code, 0);
    }
    reel_range_coder coder = reel_start_decoder(in, in_size);
    f.coder = &coder;
    return reel_exact_block(&f, n_items);
}
