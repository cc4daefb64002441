/* Values over time on a graph, exactly: each less what its past and its neighbours let expect.

   docs/format.md, "Exact values". Items are coded one after another, each with all its frames: so
   the neighbours that came before are known at every time, and what is learned of an item stays in
   the fastest memory. A number becomes an index in the order of numbers; what is coded is the index
   less that of the expected number. This file has what is told before the values, and the reader's
   entry; exact_items.c codes the items, exact_encode.c is the writer's entry. */

#include "exact_state.h"

size_t reel_exact_memory(int64_t n_frames, int64_t n_items, int64_t width) {
    size_t n = (size_t)n_items, rows = n * (size_t)n_frames, all = rows * (size_t)width;
    size_t row = (size_t)(n_frames * width);
    return reel_visits_room(n) + reel_room(1, sizeof(exact_models)) +
           reel_room((size_t)width, sizeof(exact_past)) + reel_room(all, sizeof(double)) +
           reel_room(all, sizeof(int16_t)) + reel_room(rows, 1) + reel_room(n, 1) +
           reel_room((size_t)n_frames, sizeof(int32_t)) +
           reel_room((size_t)n_frames * N_SAMPLES, sizeof(float)) + reel_room(n, sizeof(double)) +
           reel_room(row, sizeof(uint64_t)) + reel_room(row, sizeof(int32_t)) +
           reel_room(row, sizeof(int16_t)) +
           reel_room(2 * exact_moves_count(width), sizeof(double));
}

static bool take(exact_coder *f, void *memory, size_t memory_size) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    size_t n = (size_t)f->n_items, rows = n * (size_t)f->n_frames, all = rows * (size_t)f->width;
    size_t row = (size_t)(f->n_frames * f->width);
    reel_take_visits(&f->visits, &arena, n);
    f->models = reel_take(&arena, 1, sizeof *f->models);
    f->past = reel_take(&arena, (size_t)f->width, sizeof *f->past);
    f->known = reel_take(&arena, all, sizeof *f->known);
    f->sizes = reel_take(&arena, all, sizeof *f->sizes);
    f->flags = reel_take(&arena, rows, 1);
    f->constant = reel_take(&arena, n, 1);
    f->lags = reel_take(&arena, (size_t)f->n_frames, sizeof *f->lags);
    f->samples = reel_take(&arena, (size_t)f->n_frames * N_SAMPLES, sizeof *f->samples);
    f->noises = reel_take(&arena, n, sizeof *f->noises);
    f->own = reel_take(&arena, row, sizeof *f->own);
    f->sums = reel_take(&arena, row, sizeof *f->sums);
    f->most = reel_take(&arena, row, sizeof *f->most);
    f->moves = reel_take(&arena, 2 * exact_moves_count(f->width), sizeof *f->moves);
    f->again = arena.failed ? NULL : f->moves + exact_moves_count(f->width);
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
    models->last_odd = 0;
    reel_zero(f->past, (size_t)f->width * sizeof *f->past);
}

static void code_raw_values(exact_coder *f) {
    int64_t size = f->n_frames * f->n_items * f->width * f->numbers.size;
    for (int64_t i = 0; i < size; i++) {
        f->values[i] = (uint8_t)reel_code_raw(f->port, 8, f->values[i]);
    }
}

/* ---- what is told before the values ---- */

/* The lag of each frame: how many frames before it is one that it resembles, or 0. */
static void code_lags(exact_coder *f) {
    int32_t last = 0;
    f->lags[0] = 0;
    for (int64_t t = 1; t < f->n_frames; t++) {
        int32_t lag = reel_writes(f->port) ? f->lags[t] : 0;
        if (!reel_bit(f->port, &f->models->lag_again, lag == last)) {
            last = (int32_t)reel_code_raw(f->port, 28, (uint32_t)lag);
        }
        f->lags[t] = last <= t ? last : 0; /* of damaged bytes, none */
    }
}

static enum reel_code code_numbers_used(exact_coder *f) {
    reel_numbers *numbers = &f->numbers;
    reel_port *port = f->port;
    if (numbers->type != REEL_FLOATS) {
        reel_set_scale(numbers, 8 * numbers->size);
        return REEL_OK;
    }
    uint32_t shift = reel_code_raw(port, 6, (uint32_t)numbers->shift);
    uint32_t digits = reel_code_raw(port, 4, (uint32_t)numbers->digits);
    uint32_t places = reel_code_raw(port, 5, (uint32_t)numbers->places);
    uint32_t scale = reel_code_raw(port, 11, (uint32_t)(numbers->scale + REEL_MOST_SCALE));
    if (shift >= 8 * (uint32_t)numbers->size || places > REEL_MOST_PLACES ||
        scale > 2 * REEL_MOST_SCALE) {
        return REEL_CORRUPT;
    }
    numbers->shift = (int)shift;
    if (digits) {
        reel_set_decimal(numbers, (int)digits, (int)places);
    }
    reel_set_scale(numbers, (int)scale - REEL_MOST_SCALE);
    return REEL_OK;
}

int64_t reel_exact_block(exact_coder *f, int64_t count) {
    f->kind = (int)reel_code_raw(f->port, 2, (uint32_t)f->kind);
    if (f->kind == LABELS) { /* patterns as they are */
        f->numbers.shift = f->numbers.digits = 0;
    }
    f->are_listed = f->kind == LABELS && reel_code_raw(f->port, 1, f->are_listed);
    if (f->are_listed) {
        reel_list_visits(&f->visits);
    } else if (f->visits.are_listed) {
        reel_find_visits(&f->visits);
    }
    if (f->kind == RAW) {
        code_raw_values(f);
        return reel_end(f->port);
    }
    start_models(f);
    if (f->kind != LABELS) {
        if (code_numbers_used(f)) {
            return reel_failure(REEL_CORRUPT, 0);
        }
        f->has_odd = reel_code_raw(f->port, 1, f->has_odd);
    }
    f->has_stills = f->kind == LABELS || reel_code_raw(f->port, 1, f->has_stills);
    if (f->kind == FILTER) {
        f->has_lags = reel_code_raw(f->port, 1, f->has_lags);
        if (f->has_lags) {
            code_lags(f);
        } else {
            reel_zero(f->lags, (size_t)f->n_frames * sizeof *f->lags);
        }
    }
    reel_exact_items(f, count);
    return reel_end(f->port);
}

enum reel_code reel_exact_prepare(exact_coder *f, void *memory, size_t memory_size,
                                  const int32_t *starts, const int32_t *near) {
    f->visits.graph = (reel_graph){(int32_t)f->n_items, starts, near};
    if (!reel_is_graph(&f->visits.graph)) {
        return REEL_INVALID;
    }
    if (!take(f, memory, memory_size)) {
        return REEL_NO_MEMORY;
    }
    reel_find_visits(&f->visits);
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
    reel_port port = reel_reader(in, in_size);
    f.port = &port;
    return reel_exact_block(&f, n_items);
}
