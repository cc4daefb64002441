/* The writer of the exact coder: which numbers there are, which frames resemble, how values are
   expected. A reader is told, and knows nothing of how this is chosen. */

#include "exact_state.h"

#define MOST_LAGS 512

/* Whether all finite floats have decimal indices that lead back to them; `step` apart, if there
   are many. */
static bool are_decimal(const exact_coder *f, const reel_numbers *numbers, int64_t step) {
    int64_t count = f->n_frames * f->n_items * f->width;
    int decade = 0;
    for (int64_t i = 0; i < count; i += step) {
        uint64_t pattern = reel_read_pattern(numbers, f->values, i);
        if (!reel_is_odd(numbers, pattern)) {
            uint64_t index = reel_index_of(numbers, pattern, &decade);
            if (reel_pattern_of(numbers, index, decade) != pattern) {
                return false;
            }
        }
    }
    return true;
}

/* How many octaves coarser decimal floats are than those with so many lowest bits 0, mostly. */
static double octaves_saved(const exact_coder *f, const reel_numbers *decimal, int64_t step) {
    reel_numbers plain = *decimal;
    plain.digits = 0;
    int decade = 0;
    int64_t count = f->n_frames * f->n_items * f->width, sum = 0, n = 0;
    for (int64_t i = 0; i < count; i += step) {
        uint64_t pattern = reel_read_pattern(decimal, f->values, i);
        if (!reel_is_odd(decimal, pattern)) {
            double value = reel_float_value(decimal, pattern) * decimal->down;
            int32_t coarse, fine;
            reel_expected_index(decimal, value, value, 0, &decade, &coarse);
            reel_expected_index(&plain, value, value, 0, &decade, &fine);
            sum += coarse - fine;
            n++;
        }
    }
    return n ? (double)sum / (double)n : 0;
}

/* Decimal floats of the fewest digits, then places, if they are coarser than all floats. */
static void choose_decimal(exact_coder *f) {
    int64_t count = f->n_frames * f->n_items * f->width, step = count / 1024 + 1;
    reel_numbers tried = f->numbers;
    int most = f->numbers.size == 4 ? 8 : REEL_MOST_DIGITS;
    for (int digits = 1; digits <= most; digits++) {
        reel_set_decimal(&tried, digits, REEL_MOST_PLACES);
        if (!are_decimal(f, &tried, step)) {
            continue;
        }
        int places = REEL_MOST_PLACES;
        do {
            reel_set_decimal(&tried, digits, places--);
        } while (places >= 0 && are_decimal(f, &tried, step));
        for (places += 2; places <= REEL_MOST_PLACES; places++) {
            reel_set_decimal(&tried, digits, places);
            if (octaves_saved(f, &tried, step) < 4) {
                break;
            }
            if (are_decimal(f, &tried, 1)) {
                f->numbers = tried;
                return;
            }
        }
    }
}

/* Which floats there are. */
static void choose_numbers(exact_coder *f) {
    reel_numbers *numbers = &f->numbers;
    if (numbers->type != REEL_FLOATS) {
        return;
    }
    int64_t count = f->n_frames * f->n_items * f->width;
    uint64_t any = 0, most = 0, magnitudes = reel_sign_bit(numbers) - 1;
    for (int64_t i = 0; i < count; i++) {
        uint64_t pattern = reel_read_pattern(numbers, f->values, i) & magnitudes;
        if (reel_is_odd(numbers, pattern)) {
            f->has_odd = true;
        } else {
            any |= pattern;
            most = pattern > most ? pattern : most;
        }
    }
    numbers->shift = any ? __builtin_ctzll(any) : 0;
    double largest = reel_float_value(numbers, most);
    int scale = (int)(reel_bits_of(largest) >> 52) - 1022;
    scale = scale < -REEL_MOST_SCALE ? -REEL_MOST_SCALE : scale;
    reel_set_scale(numbers, scale < REEL_MOST_SCALE ? scale : REEL_MOST_SCALE);
    choose_decimal(f);
}

/* Values of a frame beside those of the item before, at some items. */
static void take_samples(exact_coder *f) {
    for (int64_t t = 0; t < f->n_frames; t++) {
        for (int64_t i = 0; i < N_SAMPLES; i++) {
            int64_t place = i * f->n_items / N_SAMPLES, other = place ? place - 1 : 0;
            int64_t col = i % f->width;
            double values[2];
            for (int k = 0; k < 2; k++) {
                int64_t item = f->visits.order[k ? other : place];
                values[k] = reel_known_value(&f->numbers, pattern_at(f, t, item, col), 0);
            }
            f->samples[t * N_SAMPLES + i] = (float)(values[0] - values[1]);
        }
    }
}

static double frames_apart(const exact_coder *f, int64_t t, int64_t other) {
    const float *a = f->samples + t * N_SAMPLES, *b = f->samples + other * N_SAMPLES;
    float sum = 0;
    for (int i = 0; i < N_SAMPLES; i++) {
        sum += a[i] < b[i] ? b[i] - a[i] : a[i] - b[i];
    }
    return (double)sum;
}

/* Frames resemble earlier ones where a motion comes again. */
static void choose_lags(exact_coder *f) {
    int64_t n_found = 0;
    take_samples(f);
    for (int64_t t = 0; t < f->n_frames; t++) {
        double best = t ? frames_apart(f, t, t - 1) / 2 : 0;
        f->lags[t] = 0;
        for (int32_t lag = 3; lag <= t && lag < MOST_LAGS; lag++) {
            double found = frames_apart(f, t, t - lag);
            if (found < best) {
                best = found;
                f->lags[t] = lag;
            }
        }
        n_found += f->lags[t] > 0;
    }
    f->has_lags = n_found >= f->n_frames / 8 + 1;
}

/* Whether many rows are as the row before: one in 16, in 256? */
static void count_stills(exact_coder *f, bool *many, bool *some) {
    int64_t n_still = 0, n_rows = 0, n_constant = 0;
    for (f->item = 0; f->item < f->n_items; f->item++) {
        if (is_constant(f)) {
            n_constant++;
            continue;
        }
        for (int64_t t = 1; t < f->n_frames; t++) {
            n_still += same_rows(f, t, t - 1);
        }
        n_rows += f->n_frames - 1;
    }
    *some = n_still > n_rows / 256;
    *many = n_still > n_rows / 2 || n_constant > f->n_items / 2;
}

/* How values may be expected; labels also as they are listed. */
enum { LISTED = RAW + 1 };

static void set_way(exact_coder *f, int way) {
    f->are_listed = way == LISTED;
    f->kind = f->are_listed ? LABELS : way;
}

/* Bytes of some items, if values are expected in a way. */
static int64_t try_way(exact_coder *f, int way, uint8_t *out, size_t room) {
    exact_coder tried = *f;
    reel_port port = reel_writer(out, room);
    int64_t count = f->n_items / 32 + 64;
    set_way(&tried, way);
    tried.port = &port;
    int64_t found = reel_exact_block(&tried, count < f->n_items ? count : f->n_items);
    f->visits = tried.visits;
    return found < 0 ? INT64_MAX : found;
}

static void choose_way(exact_coder *f, uint8_t *out, size_t room) {
    static const int others[] = {LABELS, MEANS, LISTED};
    bool many_stills;
    count_stills(f, &many_stills, &f->has_stills);
    bool is_float = f->numbers.type == REEL_FLOATS;
    int best = f->n_frames > 1 && (is_float || f->numbers.size > 1) ? FILTER : MEANS;
    if (!is_float || many_stills) {
        int numeric = best;
        int64_t least = try_way(f, numeric, out, room);
        for (int i = 0; i < 3; i++) {
            bool is_new = others[i] != numeric && !(is_float && others[i] == MEANS);
            int64_t found = is_new ? try_way(f, others[i], out, room) : INT64_MAX;
            if (found < least) {
                least = found;
                best = others[i];
            }
        }
    }
    set_way(f, best);
}

int64_t reel_exact_encode(void *memory, size_t memory_size, void *values, int64_t n_frames,
                          int64_t n_items, int64_t width, int64_t size, int64_t type,
                          const int32_t *starts, const int32_t *near, uint8_t *out, size_t room) {
    exact_coder f = coder_of(values, n_frames, n_items, width, size, type);
    enum reel_code code = reel_exact_prepare(&f, memory, memory_size, starts, near);
    if (code) {
        return reel_failure(code, 0);
    }
    choose_numbers(&f);
    if (type != REEL_FLOATS) {
        reel_set_scale(&f.numbers, 8 * f.numbers.size);
    }
    choose_lags(&f);
    choose_way(&f, out, room);
    reel_port port = reel_writer(out, room);
    f.port = &port;
    int64_t found = reel_exact_block(&f, n_items);
    if (found < 0) { /* they are noise */
        port = reel_writer(out, room);
        f.kind = RAW;
        found = reel_exact_block(&f, n_items);
    }
    return found;
}
