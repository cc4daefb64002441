/* Items of the exact coder: numbers expected and coded, rows that repeat, labels.

   docs/format.md, "Exact values", "Rows". Writer and reader share all of it. */

#include "exact_filter.h"
#include "exact_sizes.h"

REEL_INLINE double mean_near(const exact_coder *f, int64_t t, int64_t col, int most) {
    int64_t stride = f->n_frames * f->width, at = t * f->width + col;
    int n = f->n_near < most ? f->n_near : most;
    double sum = 0;
    for (int i = 0; i < n; i++) {
        const double *row = f->known + f->near[i] * stride + at;
        sum += t ? row[0] - row[-f->width] : row[0];
    }
    return n ? sum / n : 0;
}

/* A number that is not finite, if this is one. */
REEL_INLINE bool code_odd(exact_coder *f, int64_t t, int64_t col, uint64_t *pattern) {
    int own = t && f->flags[f->place * f->n_frames + t - 1] & ODD, near = 0;
    for (int i = 0; i < f->n_near && i < 2; i++) {
        near += (f->flags[f->near[i] * f->n_frames + t] & ODD) != 0;
    }
    bool odd = reel_writes(f->port) && reel_is_odd(&f->numbers, *pattern);
    if (!reel_bit(f->port, &f->models->odd[own][near], odd)) {
        return false;
    }
    uint64_t last = f->models->last_odd;
    f->flags[f->place * f->n_frames + t] |= ODD;
    if (reel_bit(f->port, &f->models->odd_again, reel_writes(f->port) && *pattern == last)) {
        *pattern = last;
    } else {
        uint64_t found = 0;
        for (int i = f->numbers.size - 1; i >= 0; i--) {
            found = found << 8 | reel_code_raw(f->port, 8, (uint32_t)(*pattern >> 8 * i & 0xFF));
        }
        *pattern = f->models->last_odd = found;
    }
    (void)col;
    return true;
}

/* What is known of a number, and how far off its expectation was. */
REEL_INLINE void note(exact_coder *f, int64_t t, int64_t col, double value, int32_t size) {
    exact_past *past = &f->past[col];
    int64_t at = (f->place * f->n_frames + t) * f->width + col;
    f->known[at] = value;
    f->sizes[at] = (int16_t)size;
    int32_t more = size - (t > 1 ? past->quick >> 4 : past->here);
    f->others = col ? (f->others + more) >> 1 : more;
    past->now = past->last = size;
}

/* The past of the columns, behind a row. */
static void end_row(exact_coder *f, int64_t t) {
    for (int64_t col = 0; col < f->width; col++) {
        exact_past *past = &f->past[col];
        if (t < 2) {
            past->quick = past->slow = past->now * 16;
        } else {
            past->quick += (past->now * 16 - past->quick) >> 2;
            past->slow += (past->now * 16 - past->slow) >> 4;
        }
    }
}

typedef struct {
    double base;     /* what the item was, or its neighbours are */
    double value;    /* expected */
    double spread;   /* variance of that, or 0 */
    uint64_t index;  /* of the number at the base; of integers only */
} expectation;

REEL_INLINE expectation expected_at_first(exact_coder *f, int64_t col) {
    int64_t stride = f->n_frames * f->width;
    expectation found = {0};
    int64_t from = f->n_near ? f->near[0] : f->place - 1;
    if (from < 0) {
        return found;
    }
    found.base = f->known[from * stride + col];
    found.value = f->n_near ? mean_near(f, 0, col, REEL_MOST_NEAR) : found.base;
    if (f->numbers.type != REEL_FLOATS) {
        uint64_t pattern = pattern_at(f, 0, f->visits.order[from], col);
        found.index = reel_integer_of(&f->numbers, pattern);
    }
    return found;
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

/* A row of which nothing else is known. */
REEL_INLINE void code_numbers(exact_coder *f, int64_t t) {
#ifdef REEL_HAS_WIDE
    if (f->widest >= 4) {
        code_numbers_4(f, t);
        return;
    }
#endif
    code_numbers_2(f, t);
}

/* ---- rows ---- */

/* Is a row other than the one before? */
REEL_INLINE bool code_moved(exact_coder *f, int64_t t, bool moved) {
    const uint8_t *own = f->flags + f->place * f->n_frames + t;
    int near = 0;
    for (int i = 0; i < f->n_near && i < N_VOTES; i++) {
        near += f->flags[f->near[i] * f->n_frames + t] & MOVED;
    }
    int past = (t > 1 ? own[-1] & MOVED : 0) | (t > 2 ? (own[-2] & MOVED) << 1 : 0);
    return reel_bit(f->port, &f->models->moved[near][past], moved);
}

static void copy_row(const exact_coder *f, int64_t t, int64_t from) {
    size_t size = (size_t)(f->width * f->numbers.size);
    reel_copy(f->values + (size_t)(t * f->n_items + f->item) * size,
              f->values + (size_t)(from * f->n_items + f->item) * size, size);
}

/* A row as the one before. */
static void repeat_row(exact_coder *f, int64_t t) {
    uint8_t *flags = f->flags + f->place * f->n_frames + t;
    if (!reel_writes(f->port)) {
        copy_row(f, t, t - 1);
        for (int64_t at = t * f->width; f->kind != LABELS && at < (t + 1) * f->width; at++) {
            f->own[at] = f->own[at - f->width];
        }
    }
    *flags = flags[-1] & ODD;
    if (f->kind == LABELS) {
        return;
    }
    for (int64_t col = 0; col < f->width; col++) {
        double value = f->known[(f->place * f->n_frames + t - 1) * f->width + col];
        int32_t step;
        reel_expected_index(&f->numbers, value, value, 0, &f->past[col].decade, &step);
        note(f, t, col, value, within(step - 16, REEL_MOST_SIZE));
    }
}

/* ---- labels: rows that come again at neighbours ---- */

static const uint8_t *row_of(const exact_coder *f, int64_t t, int64_t item) {
    return f->values + (size_t)((t * f->n_items + item) * f->width * f->numbers.size);
}

/* Different rows that this one may be: as it was before the last one, as neighbours are. */
static int find_candidates(const exact_coder *f, int64_t t, const uint8_t **rows, int *votes) {
    size_t size = (size_t)(f->width * f->numbers.size);
    const uint8_t *before = t ? row_of(f, t - 1, f->item) : NULL;
    int n = 0;
    for (int i = -1; i < f->n_near && i < N_VOTES; i++) {
        if (i < 0 && t < 2) {
            continue;
        }
        const uint8_t *row = i < 0 ? row_of(f, t - 2, f->item)
                                   : row_of(f, t, f->visits.order[f->near[i]]);
        int same = 0;
        while (same < n && !reel_same(rows[same], row, size)) {
            same++;
        }
        if (same < n) {
            votes[same]++;
        } else if (!before || !reel_same(before, row, size)) {
            votes[n] = i >= 0;
            rows[n++] = row;
        }
    }
    return n;
}

static void code_new_row(exact_coder *f, int64_t t) {
    const reel_numbers *numbers = &f->numbers;
    int decade = 0; /* there are none */
    for (int64_t col = 0; col < f->width; col++) {
        exact_past *past = &f->past[col];
        int64_t from = f->place ? f->visits.order[f->place - 1] : -1;
        uint64_t base = t          ? pattern_at(f, t - 1, f->item, col)
                        : from >= 0 ? pattern_at(f, 0, from, col)
                                    : 0;
        uint64_t index = reel_index_of(numbers, base, &decade);
        uint64_t pattern = reel_writes(f->port) ? pattern_at(f, t, f->item, col) : 0;
        uint64_t difference = reel_index_of(numbers, pattern, &decade) - index;
        difference = code_difference(f, class_of(past->last >> 4), difference);
        int32_t found = size_of(difference >> 63 ? 0 - difference : difference);
        past->last += (found * 16 - past->last) >> 2;
        put_pattern(f, t, col, reel_pattern_of(numbers, index + difference, decade));
    }
}

static void code_label(exact_coder *f, int64_t t) {
    const uint8_t *rows[N_VOTES + 1];
    int votes[N_VOTES + 1], n = find_candidates(f, t, rows, votes);
    size_t size = (size_t)(f->width * f->numbers.size);
    uint8_t *row = f->values + (row_of(f, t, f->item) - f->values);
    f->flags[f->place * f->n_frames + t] = MOVED;
    for (int i = 0; i < n; i++) {
        bool same = reel_writes(f->port) && reel_same(rows[i], row, size);
        int vote = votes[i] < N_VOTES ? votes[i] : N_VOTES;
        if (reel_bit(f->port, &f->models->candidate[t > 0][i][vote], same)) {
            if (!reel_writes(f->port)) {
                reel_copy(row, rows[i], size);
            }
            return;
        }
    }
    code_new_row(f, t);
}

/* ---- items ---- */

static bool code_constant(exact_coder *f) {
    bool constant = f->n_frames > 1 && reel_writes(f->port) && is_constant(f);
    int near = f->n_near ? 1 : 0;
    for (int i = 0; i < f->n_near && i < 2; i++) {
        near += f->constant[f->near[i]];
    }
    if (f->n_frames > 1) {
        constant = reel_bit(f->port, &f->models->constant[near], constant);
    }
    f->constant[f->place] = constant;
    return constant;
}

/* The patterns of the item, for the writer, and what sizes near items have. */
static void take_item(exact_coder *f) {
    int64_t count = f->n_frames * f->width;
    int n = f->n_near < N_NEAR ? f->n_near : N_NEAR;
    if (reel_writes(f->port)) {
        for (int64_t t = 0; t < f->n_frames; t++) {
            for (int64_t col = 0; col < f->width; col++) {
                f->own[t * f->width + col] = pattern_at(f, t, f->item, col);
            }
        }
    }
    reel_zero(f->sums, (size_t)count * sizeof *f->sums);
    for (int i = 0; i < n; i++) {
        const int16_t *row = f->sizes + f->near[i] * count;
        for (int64_t at = 0; at < count; at++) {
            f->sums[at] += row[at];
            f->most[at] = i && f->most[at] > row[at] ? f->most[at] : row[at];
        }
    }
}

static void code_item(exact_coder *f) {
    int64_t next = f->visits.order[f->place + 1 < f->n_items ? f->place + 1 : f->place];
    bool constant = code_constant(f);
    if (f->kind != LABELS) {
        take_item(f);
    }
    if (f->kind == FILTER) {
        start_filter(f);
    }
    for (int64_t t = 0; t < f->n_frames; t++) {
        __builtin_prefetch(row_of(f, t, next));
        bool moved = !constant || t == 0;
        if (t && !constant && f->has_stills) {
            moved = reel_writes(f->port) && !same_rows(f, t, t - 1);
            moved = code_moved(f, t, moved);
        }
        if (!moved) {
            repeat_row(f, t);
        } else if (f->kind == LABELS) {
            code_label(f, t);
        } else {
            if (f->kind == FILTER && t >= f->first + MOVE_FRAMES) {
                find_moves(f, t);
            }
            code_numbers(f, t);
        }
    }
    if (f->kind == FILTER) {
        end_filter(f);
    }
}

void reel_exact_items(exact_coder *f, int64_t count) {
    for (f->place = 0; f->place < count; f->place++) {
        f->item = f->visits.order[f->place];
        int most = f->kind == LABELS ? N_VOTES : REEL_MOST_NEAR;
        f->n_near = reel_find_near(&f->visits, (int32_t)f->place, most, f->near);
        if (f->are_listed && f->place) {
            f->n_near = reel_put_first((int32_t)f->place - 1, f->near, f->n_near, most);
        }
        code_item(f);
    }
}
