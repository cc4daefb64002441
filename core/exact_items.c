/* The items of the exact coder. An item is a vertex, for example; its row at each frame has `width`
   numbers. Rows are predicted, repeat the previous frame or, for labels, repeat a neighbor.

   docs/format.md, "Exact values", "Rows". Encoder and decoder share this code. */

#include "exact_filter.h"
#include "exact_sizes.h"

/* Return the mean of a column over neighbors: of values at the first frame, then of their changes
   since the previous frame. */
REEL_INLINE double mean_near(const exact_coder *coder, int64_t t, int64_t col, int max_neighbors) {
    int64_t stride = coder->n_frames * coder->width, index = t * coder->width + col;
    int n = coder->item.n_near < max_neighbors ? coder->item.n_near : max_neighbors;
    double sum = 0;
    for (int i = 0; i < n; i++) {
        const double *row = coder->past.values + coder->item.near[i] * stride + index;
        sum += t ? row[0] - row[-coder->width] : row[0];
    }
    return n ? sum / n : 0;
}

/* Code whether a number is infinite or NaN, and if so its bit pattern; returns whether it is. */
REEL_INLINE bool code_special(exact_coder *coder, int64_t t, uint64_t *pattern) {
    int was_special = t && flags_of(coder, coder->item.position)[t - 1] & SPECIAL, n_special = 0;
    for (int i = 0; i < coder->item.n_near && i < 2; i++) {
        n_special += (flags_of(coder, coder->item.near[i])[t] & SPECIAL) != 0;
    }
    bool special =
        reel_is_encoder(coder->range_coder) && reel_is_special(&coder->numbers, *pattern);
    if (!reel_bit(coder->range_coder, &coder->models->special[was_special][n_special], special)) {
        return false;
    }
    uint64_t last = coder->models->last_special;
    flags_of(coder, coder->item.position)[t] |= SPECIAL;
    if (reel_bit(coder->range_coder, &coder->models->special_repeats,
                 reel_is_encoder(coder->range_coder) && *pattern == last)) {
        *pattern = last;
    } else {
        uint64_t result = 0;
        for (int i = coder->numbers.size - 1; i >= 0; i--) {
            result = result << 8 |
                     reel_code_raw(coder->range_coder, 8, (uint32_t)(*pattern >> 8 * i & 0xFF));
        }
        *pattern = coder->models->last_special = result;
    }
    return true;
}

/* Record a number and the size of its difference for later predictions. */
REEL_INLINE void record(exact_coder *coder, int64_t t, int64_t col, double value, int32_t size) {
    column_state *state = &coder->columns[col];
    int64_t index = (coder->item.position * coder->n_frames + t) * coder->width + col;
    coder->past.values[index] = value;
    coder->past.sizes[index] = (int16_t)size;
    int32_t excess = size - (t > 1 ? state->fast >> 4 : state->recent);
    coder->item.excess = col ? (coder->item.excess + excess) >> 1 : excess;
    state->last = size;
}

/* Update the size statistics of the columns after a row. */
static void update_columns(exact_coder *coder, int64_t t) {
    for (int64_t col = 0; col < coder->width; col++) {
        column_state *state = &coder->columns[col];
        if (t < 2) {
            state->fast = state->slow = state->last * 16;
        } else {
            state->fast += (state->last * 16 - state->fast) >> 2;
            state->slow += (state->last * 16 - state->slow) >> 4;
        }
    }
}

typedef struct {
    double base;     /* last value of the item, or of a neighbor */
    double value;    /* prediction */
    double variance; /* estimated variance of its error, or 0 */
    uint64_t index;  /* index of the base, for integers */
} prediction;

/* Predict a number of the first frame, from neighbors or the previous item. */
REEL_INLINE prediction predict_first(exact_coder *coder, int64_t col) {
    int64_t stride = coder->n_frames * coder->width;
    prediction result = {0};
    int64_t source = coder->item.n_near ? coder->item.near[0] : coder->item.position - 1;
    if (source < 0) {
        return result;
    }
    result.base = coder->past.values[source * stride + col];
    result.value = coder->item.n_near ? mean_near(coder, 0, col, REEL_MAX_NEAR) : result.base;
    if (coder->numbers.type != REEL_FLOATS) {
        uint64_t pattern = pattern_at(coder, 0, coder->traversal.order[source], col);
        result.index = reel_integer_of(&coder->numbers, pattern);
    }
    return result;
}

#define LANES 2
#include "exact_lanes.h"

#ifdef REEL_HAS_WIDE

#define LANES 4
#include "exact_lanes.h"

#endif

/* ---- rows ---- */

/* Code whether a row differs from the previous one. */
REEL_INLINE bool code_moved(exact_coder *coder, int64_t t, bool moved) {
    const uint8_t *flags = flags_of(coder, coder->item.position) + t;
    int n_moved = 0;
    for (int i = 0; i < coder->item.n_near && i < N_VOTES; i++) {
        n_moved += flags_of(coder, coder->item.near[i])[t] & MOVED;
    }
    int history = (t > 1 ? flags[-1] & MOVED : 0) | (t > 2 ? (flags[-2] & MOVED) << 1 : 0);
    return reel_bit(coder->range_coder, &coder->models->moved[n_moved][history], moved);
}

static void copy_row(const exact_coder *coder, int64_t t, int64_t source) {
    size_t size = (size_t)(coder->width * coder->numbers.size);
    reel_copy(coder->values + (size_t)(t * coder->n_items + coder->item.index) * size,
              coder->values + (size_t)(source * coder->n_items + coder->item.index) * size, size);
}

/* Set a row to that of the previous frame, and update the statistics as for any row. */
static void repeat_row(exact_coder *coder, int64_t t) {
    uint8_t *flags = flags_of(coder, coder->item.position) + t;
    if (!reel_is_encoder(coder->range_coder)) {
        copy_row(coder, t, t - 1);
        for (int64_t index = t * coder->width;
             coder->choices.kind != LABELS && index < (t + 1) * coder->width; index++) {
            coder->item.patterns[index] = coder->item.patterns[index - coder->width];
        }
    }
    *flags = flags[-1] & SPECIAL;
    if (coder->choices.kind == LABELS) {
        return;
    }
    for (int64_t col = 0; col < coder->width; col++) {
        int64_t previous = (coder->item.position * coder->n_frames + t - 1) * coder->width + col;
        double value = coder->past.values[previous];
        int32_t step;
        reel_predict_index(&coder->numbers, value, value, 0, &coder->columns[col].decade, &step);
        record(coder, t, col, value, clamp(step - 16, REEL_MAX_SIZE));
    }
}

/* ---- labels: rows repeated from neighbors ---- */

static const uint8_t *row_of(const exact_coder *coder, int64_t t, int64_t item) {
    return coder->values +
           (size_t)((t * coder->n_items + item) * coder->width * coder->numbers.size);
}

/* Find the distinct rows that this row may repeat: the item's row two frames ago and its neighbors'
   rows in this frame, except the item's previous row. Return their number; `votes` counts the
   neighbors that have each row. */
static int find_candidates(const exact_coder *coder, int64_t t, const uint8_t **rows, int *votes) {
    size_t size = (size_t)(coder->width * coder->numbers.size);
    const uint8_t *previous = t ? row_of(coder, t - 1, coder->item.index) : NULL;
    int n = 0;
    for (int i = -1; i < coder->item.n_near && i < N_VOTES; i++) {
        if (i < 0 && t < 2) {
            continue;
        }
        const uint8_t *row = i < 0 ? row_of(coder, t - 2, coder->item.index)
                                   : row_of(coder, t, coder->traversal.order[coder->item.near[i]]);
        int index = 0;
        while (index < n && !reel_equal_bytes(rows[index], row, size)) {
            index++;
        }
        if (index < n) {
            votes[index]++;
        } else if (!previous || !reel_equal_bytes(previous, row, size)) {
            votes[n] = i >= 0;
            rows[n++] = row;
        }
    }
    return n;
}

/* Code the numbers of a label that repeats no candidate. */
static void code_new_row(exact_coder *coder, int64_t t) {
    const reel_numbers *numbers = &coder->numbers;
    int decade = 0; /* unused */
    for (int64_t col = 0; col < coder->width; col++) {
        column_state *state = &coder->columns[col];
        int64_t last = coder->item.position ? coder->traversal.order[coder->item.position - 1] : -1;
        uint64_t base = t           ? pattern_at(coder, t - 1, coder->item.index, col)
                        : last >= 0 ? pattern_at(coder, 0, last, col)
                                    : 0;
        uint64_t index = reel_index_of(numbers, base, &decade);
        uint64_t pattern =
            reel_is_encoder(coder->range_coder) ? pattern_at(coder, t, coder->item.index, col) : 0;
        uint64_t difference = reel_index_of(numbers, pattern, &decade) - index;
        difference = code_difference(coder, class_of(state->last >> 4), difference);
        int32_t size = size_of(difference >> 63 ? 0 - difference : difference);
        state->last += (size * 16 - state->last) >> 2;
        put_pattern(coder, t, col, reel_pattern_of(numbers, index + difference, decade));
    }
}

/* Code a row of labels: which candidate it repeats, or else its numbers. */
static void code_label(exact_coder *coder, int64_t t) {
    const uint8_t *rows[N_VOTES + 1];
    int votes[N_VOTES + 1], n = find_candidates(coder, t, rows, votes);
    size_t size = (size_t)(coder->width * coder->numbers.size);
    uint8_t *row = coder->values + (row_of(coder, t, coder->item.index) - coder->values);
    flags_of(coder, coder->item.position)[t] = MOVED;
    for (int i = 0; i < n; i++) {
        bool same = reel_is_encoder(coder->range_coder) && reel_equal_bytes(rows[i], row, size);
        int vote = votes[i] < N_VOTES ? votes[i] : N_VOTES;
        if (reel_bit(coder->range_coder, &coder->models->candidate[t > 0][i][vote], same)) {
            if (!reel_is_encoder(coder->range_coder)) {
                reel_copy(row, rows[i], size);
            }
            return;
        }
    }
    code_new_row(coder, t);
}

/* ---- items ---- */

/* Code whether the item has the same row at all frames. */
static bool code_constant(exact_coder *coder) {
    bool constant =
        coder->n_frames > 1 && reel_is_encoder(coder->range_coder) && is_constant(coder);
    int n_constant = coder->item.n_near ? 1 : 0;
    for (int i = 0; i < coder->item.n_near && i < 2; i++) {
        n_constant += coder->past.is_constant[coder->item.near[i]];
    }
    if (coder->n_frames > 1) {
        constant = reel_bit(coder->range_coder, &coder->models->constant[n_constant], constant);
    }
    coder->past.is_constant[coder->item.position] = constant;
    return constant;
}

/* Load the bit patterns of the item (encoder), and sum the sizes of its neighbors. */
static void load_item(exact_coder *coder) {
    int64_t count = coder->n_frames * coder->width;
    int n = coder->item.n_near < N_NEAR ? coder->item.n_near : N_NEAR;
    if (reel_is_encoder(coder->range_coder)) {
        for (int64_t t = 0; t < coder->n_frames; t++) {
            for (int64_t col = 0; col < coder->width; col++) {
                coder->item.patterns[t * coder->width + col] =
                    pattern_at(coder, t, coder->item.index, col);
            }
        }
    }
    reel_zero(coder->item.near_size_sums, (size_t)count * sizeof *coder->item.near_size_sums);
    for (int i = 0; i < n; i++) {
        const int16_t *row = coder->past.sizes + coder->item.near[i] * count;
        for (int64_t index = 0; index < count; index++) {
            coder->item.near_size_sums[index] += row[index];
            coder->item.max_near_sizes[index] = i && coder->item.max_near_sizes[index] > row[index]
                                                    ? coder->item.max_near_sizes[index]
                                                    : row[index];
        }
    }
}

static void code_item(exact_coder *coder) {
    int64_t position = coder->item.position + 1;
    int64_t next = position < coder->n_items ? coder->traversal.order[position] : coder->item.index;
    bool constant = code_constant(coder);
    if (coder->choices.kind != LABELS) {
        load_item(coder);
    }
    if (coder->choices.kind == FILTER) {
        start_filter(coder);
    }
    for (int64_t t = 0; t < coder->n_frames; t++) {
        __builtin_prefetch(row_of(coder, t, next));
        bool moved = !constant || t == 0;
        if (t && !constant && coder->choices.has_repeats) {
            moved = reel_is_encoder(coder->range_coder) && !same_rows(coder, t, t - 1);
            moved = code_moved(coder, t, moved);
        }
        if (!moved) {
            repeat_row(coder, t);
        } else if (coder->choices.kind == LABELS) {
            code_label(coder, t);
        } else {
            if (coder->choices.kind == FILTER && t >= coder->filter.first_frame + MOTION_FRAMES) {
                load_motions(coder, t);
            }
            REEL_UP_TO_4(coder->vector_width, code_numbers, coder, t);
        }
    }
    if (coder->choices.kind == FILTER) {
        end_filter(coder);
    }
}

void reel_exact_items(exact_coder *coder, int64_t count) {
    int max_near = coder->choices.kind == LABELS ? N_VOTES : REEL_MAX_NEAR;
    current_item *item = &coder->item;
    for (int32_t position = 0; position < count; position++) {
        item->position = position;
        item->index = coder->traversal.order[position];
        item->n_near = reel_find_near(&coder->traversal, position, max_near, item->near);
        if (coder->choices.in_given_order && position) {
            item->n_near = reel_prepend_position(position - 1, item->near, item->n_near, max_near);
        }
        code_item(coder);
    }
}
