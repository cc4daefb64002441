/* The encoder of exact values: chooses the number grid, similar frames and the prediction mode.
   docs/format.md, "Exact values", leaves these choices free. */

#include "exact_state.h"

#define MAX_LAG 512
#define MIN_TRIED_ROWS 65536 /* of all frames, in each trial of a mode */

/* Whether decimal indices restore the finite floats, of which every `step`-th is tested. */
static bool restores_all(const exact_coder *coder, const reel_numbers *numbers, int64_t step) {
    int64_t count = coder->n_frames * coder->n_items * coder->width;
    int decade = 0;
    for (int64_t i = 0; i < count; i += step) {
        uint64_t pattern = reel_read_pattern(numbers, coder->values, i);
        if (!reel_is_special(numbers, pattern)) {
            uint64_t index = reel_index_of(numbers, pattern, &decade);
            if (reel_pattern_of(numbers, index, decade) != pattern) {
                return false;
            }
        }
    }
    return true;
}

/* Mean number of octaves by which the decimal grid is coarser than the binary one. */
static double octaves_saved(const exact_coder *coder, const reel_numbers *decimal, int64_t step) {
    reel_numbers plain = *decimal;
    plain.digits = 0;
    int decade = 0;
    int64_t count = coder->n_frames * coder->n_items * coder->width, sum = 0, n = 0;
    for (int64_t i = 0; i < count; i += step) {
        uint64_t pattern = reel_read_pattern(decimal, coder->values, i);
        if (!reel_is_special(decimal, pattern)) {
            double value = reel_float_value(decimal, pattern) * decimal->to_scaled;
            int32_t coarse, fine;
            reel_predict_index(decimal, value, value, 0, &decade, &coarse);
            reel_predict_index(&plain, value, value, 0, &decade, &fine);
            sum += coarse - fine;
            n++;
        }
    }
    return n ? (double)sum / (double)n : 0;
}

/* Choose the decimal grid with the fewest digits, then places, unless the binary one is coarser. */
static void choose_decimal(exact_coder *coder) {
    int64_t count = coder->n_frames * coder->n_items * coder->width, step = count / 1024 + 1;
    reel_numbers trial = coder->numbers;
    int max_digits = coder->numbers.size == 4 ? 8 : REEL_MAX_DIGITS;
    for (int digits = 1; digits <= max_digits; digits++) {
        reel_set_decimal(&trial, digits, REEL_MAX_PLACES);
        if (!restores_all(coder, &trial, step)) {
            continue;
        }
        int places = REEL_MAX_PLACES;
        do {
            reel_set_decimal(&trial, digits, places--);
        } while (places >= 0 && restores_all(coder, &trial, step));
        for (places += 2; places <= REEL_MAX_PLACES; places++) {
            reel_set_decimal(&trial, digits, places);
            if (octaves_saved(coder, &trial, step) < 4) {
                break;
            }
            if (restores_all(coder, &trial, 1)) {
                coder->numbers = trial;
                return;
            }
        }
    }
}

/* Choose the grid and scale of the floats. */
static void choose_numbers(exact_coder *coder) {
    reel_numbers *numbers = &coder->numbers;
    if (numbers->type != REEL_FLOATS) {
        return;
    }
    int64_t count = coder->n_frames * coder->n_items * coder->width;
    uint64_t union_bits = 0, max_pattern = 0, magnitude_mask = reel_sign_bit(numbers) - 1;
    for (int64_t i = 0; i < count; i++) {
        uint64_t pattern = reel_read_pattern(numbers, coder->values, i) & magnitude_mask;
        if (reel_is_special(numbers, pattern)) {
            coder->choices.has_special = true;
        } else {
            union_bits |= pattern;
            max_pattern = pattern > max_pattern ? pattern : max_pattern;
        }
    }
    numbers->shift = union_bits ? __builtin_ctzll(union_bits) : 0;
    double largest = reel_float_value(numbers, max_pattern);
    int scale = (int)(reel_bits_of(largest) >> 52) - 1022;
    scale = scale < -REEL_MAX_SCALE ? -REEL_MAX_SCALE : scale;
    reel_set_scale(numbers, scale < REEL_MAX_SCALE ? scale : REEL_MAX_SCALE);
    choose_decimal(coder);
}

/* Sample differences between the values of consecutive items in each frame. */
static void sample_frames(exact_coder *coder) {
    for (int64_t t = 0; t < coder->n_frames; t++) {
        for (int64_t i = 0; i < N_SAMPLES; i++) {
            int64_t position = i * coder->n_items / N_SAMPLES, last = position ? position - 1 : 0;
            int64_t col = i % coder->width;
            double values[2];
            for (int k = 0; k < 2; k++) {
                int64_t item = coder->traversal.order[k ? last : position];
                values[k] = reel_known_value(&coder->numbers, pattern_at(coder, t, item, col), 0);
            }
            coder->samples[t * N_SAMPLES + i] = (float)(values[0] - values[1]);
        }
    }
}

static double frame_distance(const exact_coder *coder, int64_t t, int64_t other) {
    const float *a = coder->samples + t * N_SAMPLES, *b = coder->samples + other * N_SAMPLES;
    float sum = 0;
    for (int i = 0; i < N_SAMPLES; i++) {
        sum += a[i] < b[i] ? b[i] - a[i] : a[i] - b[i];
    }
    return (double)sum;
}

/* Choose the lags of frames that resemble earlier ones, as in cyclic motion. */
static void choose_lags(exact_coder *coder) {
    int64_t n_similar = 0;
    sample_frames(coder);
    for (int64_t t = 0; t < coder->n_frames; t++) {
        double best = t ? frame_distance(coder, t, t - 1) / 2 : 0;
        coder->lags[t] = 0;
        for (int32_t lag = 3; lag <= t && lag < MAX_LAG; lag++) {
            double distance = frame_distance(coder, t, t - lag);
            if (distance < best) {
                best = distance;
                coder->lags[t] = lag;
            }
        }
        n_similar += coder->lags[t] > 0;
    }
    coder->choices.has_lags = n_similar >= coder->n_frames / 8 + 1;
}

/* Find whether many rows repeat the previous row (more than half), or some (more than 1 in 256). */
static void count_repeats(exact_coder *coder, bool *has_many, bool *has_some) {
    int64_t n_repeated = 0, n_rows = 0, n_constant = 0;
    for (coder->item.index = 0; coder->item.index < coder->n_items; coder->item.index++) {
        if (is_constant(coder)) {
            n_constant++;
            continue;
        }
        for (int64_t t = 1; t < coder->n_frames; t++) {
            n_repeated += same_rows(coder, t, t - 1);
        }
        n_rows += coder->n_frames - 1;
    }
    *has_some = n_repeated > n_rows / 256;
    *has_many = n_repeated > n_rows / 2 || n_constant > coder->n_items / 2;
}

/* An additional mode to try: labels in the given order. */
enum { LABELS_IN_GIVEN_ORDER = RAW + 1 };

static void set_mode(exact_coder *coder, int mode) {
    coder->choices.in_given_order = mode == LABELS_IN_GIVEN_ORDER;
    coder->choices.kind = coder->choices.in_given_order ? LABELS : mode;
}

/* Return the size of the first items when coded in a mode. */
static int64_t try_mode(exact_coder *coder, int mode, uint8_t *out, size_t capacity) {
    exact_coder trial = *coder;
    reel_range_coder range_coder = reel_start_encoder(out, capacity);
    int64_t count = coder->n_items / 32 + 64, least = MIN_TRIED_ROWS / coder->n_frames;
    count = count < least ? least : count;
    set_mode(&trial, mode);
    trial.range_coder = &range_coder;
    int64_t size = reel_exact_block(&trial, count < coder->n_items ? count : coder->n_items);
    coder->traversal = trial.traversal;
    return size < 0 ? INT64_MAX : size;
}

/* Floats over time are filtered, unless many rows repeat. */
static void choose_mode(exact_coder *coder, uint8_t *out, size_t capacity) {
    bool many_repeats;
    count_repeats(coder, &many_repeats, &coder->choices.has_repeats);
    bool is_float = coder->numbers.type == REEL_FLOATS, is_single = coder->n_frames == 1;
    bool may_be_labels = !is_float || many_repeats;
    const bool is_tried[] = {[LABELS] = may_be_labels,
                             [MEANS] = !is_float || is_single,
                             [FILTER] = is_float || is_single || coder->numbers.size > 1,
                             [RAW] = false,
                             [LABELS_IN_GIVEN_ORDER] = may_be_labels};
    int best = FILTER;
    int64_t min_bytes = INT64_MAX;
    for (int mode = 0; mode <= LABELS_IN_GIVEN_ORDER && (may_be_labels || is_single); mode++) {
        int64_t result = is_tried[mode] ? try_mode(coder, mode, out, capacity) : INT64_MAX;
        if (result < min_bytes) {
            min_bytes = result;
            best = mode;
        }
    }
    set_mode(coder, best);
}

int64_t reel_exact_encode(void *memory, size_t memory_size, void *values, int64_t n_frames,
                          int64_t n_items, int64_t width, int64_t size, int64_t type,
                          const int32_t *starts, const int32_t *near, uint8_t *out,
                          size_t capacity) {
    exact_coder coder = coder_of(values, n_frames, n_items, width, size, type);
    enum reel_code code = reel_exact_prepare(&coder, memory, memory_size, starts, near);
    if (code) {
        return reel_failure(code, 0);
    }
    choose_numbers(&coder);
    if (type != REEL_FLOATS) {
        reel_set_scale(&coder.numbers, 8 * coder.numbers.size);
    }
    choose_lags(&coder);
    choose_mode(&coder, out, capacity);
    reel_range_coder range_coder = reel_start_encoder(out, capacity);
    coder.range_coder = &range_coder;
    int64_t n_bytes = reel_exact_block(&coder, n_items);
    if (n_bytes < 0) { /* incompressible */
        range_coder = reel_start_encoder(out, capacity);
        coder.choices.kind = RAW;
        n_bytes = reel_exact_block(&coder, n_items);
    }
    return n_bytes;
}
