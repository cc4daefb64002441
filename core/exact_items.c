/* The items of the exact coder: predicted numbers, repeated rows, labels.

   docs/format.md, "Exact values", "Rows". Encoder and decoder share all of it. */

#include "exact_filter.h"
#include "exact_sizes.h"

REEL_INLINE double mean_near(const exact_coder *f, int64_t t, int64_t col, int max_neighbors) {
    int64_t stride = f->n_frames * f->width, at = t * f->width + col;
    int n = f->n_near < max_neighbors ? f->n_near : max_neighbors;
    double sum = 0;
    for (int i = 0; i < n; i++) {
        const double *row = f->known + f->near[i] * stride + at;
        sum += t ? row[0] - row[-f->width] : row[0];
    }
    return n ? sum / n : 0;
}

/* Code whether a number is not finite, and if so its bit pattern. */
REEL_INLINE bool code_special(exact_coder *f, int64_t t, int64_t col, uint64_t *pattern) {
    int own = t && f->flags[f->position * f->n_frames + t - 1] & SPECIAL, near = 0;
    for (int i = 0; i < f->n_near && i < 2; i++) {
        near += (f->flags[f->near[i] * f->n_frames + t] & SPECIAL) != 0;
    }
    bool special = reel_is_encoder(f->coder) && reel_is_special(&f->numbers, *pattern);
    if (!reel_bit(f->coder, &f->models->special[own][near], special)) {
        return false;
    }
    uint64_t last = f->models->last_special;
    f->flags[f->position * f->n_frames + t] |= SPECIAL;
    if (reel_bit(f->coder, &f->models->special_repeats,
                 reel_is_encoder(f->coder) && *pattern == last)) {
        *pattern = last;
    } else {
        uint64_t result = 0;
        for (int i = f->numbers.size - 1; i >= 0; i--) {
            result = result << 8 | reel_code_raw(f->coder, 8, (uint32_t)(*pattern >> 8 * i & 0xFF));
        }
        *pattern = f->models->last_special = result;
    }
    (void)col;
    return true;
}

/* Record a number and the size of its difference for later predictions. */
REEL_INLINE void record(exact_coder *f, int64_t t, int64_t col, double value, int32_t size) {
    column_state *state = &f->columns[col];
    int64_t at = (f->position * f->n_frames + t) * f->width + col;
    f->known[at] = value;
    f->sizes[at] = (int16_t)size;
    int32_t more = size - (t > 1 ? state->fast >> 4 : state->here);
    f->excess = col ? (f->excess + more) >> 1 : more;
    state->now = state->last = size;
}

/* Update the size statistics of the columns after a row. */
static void update_columns(exact_coder *f, int64_t t) {
    for (int64_t col = 0; col < f->width; col++) {
        column_state *state = &f->columns[col];
        if (t < 2) {
            state->fast = state->slow = state->now * 16;
        } else {
            state->fast += (state->now * 16 - state->fast) >> 2;
            state->slow += (state->now * 16 - state->slow) >> 4;
        }
    }
}

typedef struct {
    double base;    /* last value of the item, or of a neighbor */
    double value;   /* prediction */
    double spread;  /* its variance, or 0 */
    uint64_t index; /* index of the base, for integers */
} prediction;

REEL_INLINE prediction predict_first(exact_coder *f, int64_t col) {
    int64_t stride = f->n_frames * f->width;
    prediction result = {0};
    int64_t source = f->n_near ? f->near[0] : f->position - 1;
    if (source < 0) {
        return result;
    }
    result.base = f->known[source * stride + col];
    result.value = f->n_near ? mean_near(f, 0, col, REEL_MAX_NEAR) : result.base;
    if (f->numbers.type != REEL_FLOATS) {
        uint64_t pattern = pattern_at(f, 0, f->traversal.order[source], col);
        result.index = reel_integer_of(&f->numbers, pattern);
    }
    return result;
}

#define LANES 2
#define TARGET
#define NAMED(name) REEL_JOIN(name, _2)
#include "exact_lanes.h"
#undef LANES
#undef TARGET
#undef NAMED

#ifdef REEL_HAS_WIDE

#define LANES 4
#define TARGET REEL_TARGET_4
#define NAMED(name) REEL_JOIN(name, _4)
#include "exact_lanes.h"
#undef LANES
#undef TARGET
#undef NAMED

#endif

/* Code a row number by number. */
REEL_INLINE void code_numbers(exact_coder *f, int64_t t) {
#ifdef REEL_HAS_WIDE
    if (f->vector_width >= 4) {
        code_numbers_4(f, t);
        return;
    }
#endif
    code_numbers_2(f, t);
}

/* ---- rows ---- */

/* Code whether a row differs from the previous one. */
REEL_INLINE bool code_moved(exact_coder *f, int64_t t, bool moved) {
    const uint8_t *own = f->flags + f->position * f->n_frames + t;
    int near = 0;
    for (int i = 0; i < f->n_near && i < N_VOTES; i++) {
        near += f->flags[f->near[i] * f->n_frames + t] & MOVED;
    }
    int history = (t > 1 ? own[-1] & MOVED : 0) | (t > 2 ? (own[-2] & MOVED) << 1 : 0);
    return reel_bit(f->coder, &f->models->moved[near][history], moved);
}

static void copy_row(const exact_coder *f, int64_t t, int64_t from) {
    size_t size = (size_t)(f->width * f->numbers.size);
    reel_copy(f->values + (size_t)(t * f->n_items + f->item) * size,
              f->values + (size_t)(from * f->n_items + f->item) * size, size);
}

/* Repeat the previous row. */
static void repeat_row(exact_coder *f, int64_t t) {
    uint8_t *flags = f->flags + f->position * f->n_frames + t;
    if (!reel_is_encoder(f->coder)) {
        copy_row(f, t, t - 1);
        for (int64_t at = t * f->width; f->kind != LABELS && at < (t + 1) * f->width; at++) {
            f->patterns[at] = f->patterns[at - f->width];
        }
    }
    *flags = flags[-1] & SPECIAL;
    if (f->kind == LABELS) {
        return;
    }
    for (int64_t col = 0; col < f->width; col++) {
        double value = f->known[(f->position * f->n_frames + t - 1) * f->width + col];
        int32_t step;
        reel_predict_index(&f->numbers, value, value, 0, &f->columns[col].decade, &step);
        record(f, t, col, value, clamp(step - 16, REEL_MAX_SIZE));
    }
}

/* ---- labels: rows repeated from neighbors ---- */

static const uint8_t *row_of(const exact_coder *f, int64_t t, int64_t item) {
    return f->values + (size_t)((t * f->n_items + item) * f->width * f->numbers.size);
}

/* Find the distinct rows that this row may repeat: that of two frames before, and those of
   neighbors. Returns how many; votes count the neighbors that have each. */
static int find_candidates(const exact_coder *f, int64_t t, const uint8_t **rows, int *votes) {
    size_t size = (size_t)(f->width * f->numbers.size);
    const uint8_t *before = t ? row_of(f, t - 1, f->item) : NULL;
    int n = 0;
    for (int i = -1; i < f->n_near && i < N_VOTES; i++) {
        if (i < 0 && t < 2) {
            continue;
        }
        const uint8_t *row =
            i < 0 ? row_of(f, t - 2, f->item) : row_of(f, t, f->traversal.order[f->near[i]]);
        int same = 0;
        while (same < n && !reel_equal_bytes(rows[same], row, size)) {
            same++;
        }
        if (same < n) {
            votes[same]++;
        } else if (!before || !reel_equal_bytes(before, row, size)) {
            votes[n] = i >= 0;
            rows[n++] = row;
        }
    }
    return n;
}

static void code_new_row(exact_coder *f, int64_t t) {
    const reel_numbers *numbers = &f->numbers;
    int decade = 0; /* unused */
    for (int64_t col = 0; col < f->width; col++) {
        column_state *state = &f->columns[col];
        int64_t from = f->position ? f->traversal.order[f->position - 1] : -1;
        uint64_t base = t          ? pattern_at(f, t - 1, f->item, col)
                        : from >= 0 ? pattern_at(f, 0, from, col)
                                    : 0;
        uint64_t index = reel_index_of(numbers, base, &decade);
        uint64_t pattern = reel_is_encoder(f->coder) ? pattern_at(f, t, f->item, col) : 0;
        uint64_t difference = reel_index_of(numbers, pattern, &decade) - index;
        difference = code_difference(f, class_of(state->last >> 4), difference);
        int32_t size = size_of(difference >> 63 ? 0 - difference : difference);
        state->last += (size * 16 - state->last) >> 2;
        put_pattern(f, t, col, reel_pattern_of(numbers, index + difference, decade));
    }
}

static void code_label(exact_coder *f, int64_t t) {
    const uint8_t *rows[N_VOTES + 1];
    int votes[N_VOTES + 1], n = find_candidates(f, t, rows, votes);
    size_t size = (size_t)(f->width * f->numbers.size);
    uint8_t *row = f->values + (row_of(f, t, f->item) - f->values);
    f->flags[f->position * f->n_frames + t] = MOVED;
    for (int i = 0; i < n; i++) {
        bool same = reel_is_encoder(f->coder) && reel_equal_bytes(rows[i], row, size);
        int vote = votes[i] < N_VOTES ? votes[i] : N_VOTES;
        if (reel_bit(f->coder, &f->models->candidate[t > 0][i][vote], same)) {
            if (!reel_is_encoder(f->coder)) {
                reel_copy(row, rows[i], size);
            }
            return;
        }
    }
    code_new_row(f, t);
}

/* ---- items ---- */

static bool code_constant(exact_coder *f) {
    bool constant = f->n_frames > 1 && reel_is_encoder(f->coder) && is_constant(f);
    int near = f->n_near ? 1 : 0;
    for (int i = 0; i < f->n_near && i < 2; i++) {
        near += f->constant[f->near[i]];
    }
    if (f->n_frames > 1) {
        constant = reel_bit(f->coder, &f->models->constant[near], constant);
    }
    f->constant[f->position] = constant;
    return constant;
}

/* Load the bit patterns of the item (encoder), and the sizes of its neighbors. */
static void load_item(exact_coder *f) {
    int64_t count = f->n_frames * f->width;
    int n = f->n_near < N_NEAR ? f->n_near : N_NEAR;
    if (reel_is_encoder(f->coder)) {
        for (int64_t t = 0; t < f->n_frames; t++) {
            for (int64_t col = 0; col < f->width; col++) {
                f->patterns[t * f->width + col] = pattern_at(f, t, f->item, col);
            }
        }
    }
    reel_zero(f->sums, (size_t)count * sizeof *f->sums);
    for (int i = 0; i < n; i++) {
        const int16_t *row = f->sizes + f->near[i] * count;
        for (int64_t at = 0; at < count; at++) {
            f->sums[at] += row[at];
            f->max_sizes[at] = i && f->max_sizes[at] > row[at] ? f->max_sizes[at] : row[at];
        }
    }
}

static void code_item(exact_coder *f) {
    int64_t next = f->traversal.order[f->position + 1 < f->n_items ? f->position + 1 : f->position];
    bool constant = code_constant(f);
    if (f->kind != LABELS) {
        load_item(f);
    }
    if (f->kind == FILTER) {
        begin_item_filter(f);
    }
    for (int64_t t = 0; t < f->n_frames; t++) {
        __builtin_prefetch(row_of(f, t, next));
        bool moved = !constant || t == 0;
        if (t && !constant && f->has_repeats) {
            moved = reel_is_encoder(f->coder) && !same_rows(f, t, t - 1);
            moved = code_moved(f, t, moved);
        }
        if (!moved) {
            repeat_row(f, t);
        } else if (f->kind == LABELS) {
            code_label(f, t);
        } else {
            if (f->kind == FILTER && t >= f->first + MOTION_FRAMES) {
                load_motions(f, t);
            }
            code_numbers(f, t);
        }
    }
    if (f->kind == FILTER) {
        end_filter(f);
    }
}

void reel_exact_items(exact_coder *f, int64_t count) {
    for (f->position = 0; f->position < count; f->position++) {
        f->item = f->traversal.order[f->position];
        int max_neighbors = f->kind == LABELS ? N_VOTES : REEL_MAX_NEAR;
        f->n_near = reel_find_near(&f->traversal, (int32_t)f->position, max_neighbors, f->near);
        if (f->in_given_order && f->position) {
            f->n_near =
                reel_prepend_position((int32_t)f->position - 1, f->near, f->n_near, max_neighbors);
        }
        code_item(f);
    }
}
