/* Values over time on a graph, exactly: each less what its past and its neighbours let expect.

   docs/format.md, "Exact values". Items are coded one after another, each with all its frames: so
   the neighbours that came before are known at every time, and what is learned of an item stays in
   the fastest memory. A number becomes an index in the order of numbers; what is coded is the index
   less that of the expected number. How large the difference will be is regressed, in integers,
   from differences in time, at neighbours and in other columns; its class is the context. */

#include "bits.h"
#include "cpu.h"
#include "exact_numbers.h"
#include "exact_order.h"

#define TEMPORAL 2                     /* inputs of the filter beside the neighbours */
#define INPUTS 12                      /* of the filter, and zeros behind them */
#define N_NEAR 6                       /* neighbours that tell sizes, and means */
#define N_VOTES 4                      /* neighbours whose rows may come again */
#define N_SIZES (16 * 64)              /* sixteenths of an octave of an expected magnitude */
#define N_CLASSES (N_SIZES / 4)
#define N_STEPS 16                     /* away from the expected length */
#define N_INPUTS 7                     /* of the regression of sizes */
#define RAW_BITS 24                    /* at once */
#define MOST_INPUT 128
#define MOST_ERROR 64
#define WIDE 1000.0                    /* variance of weights that are not known */
#define FADING (1.0 / 0.99)            /* of what is known about weights, in a frame */
#define N_SAMPLES 64                   /* numbers of a frame that frames are compared by */
#define MOST_LAGS 512

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

/* Gains: the doubt times the inputs. */
REEL_INLINE void filter_gains(int widest, const double *doubt, const double *inputs, int n,
                              double *gains) {
#ifdef REEL_HAS_WIDE
    if (widest >= 4) {
        filter_gains_4(doubt, inputs, n, gains);
        return;
    }
#endif
    (void)widest;
    filter_gains_2(doubt, inputs, n, gains);
}

/* Weights take a step along the gains; the doubt along them shrinks. */
REEL_INLINE void filter_learn(int widest, double *weights, double *doubt, const double *gains,
                              int n, double by, double step) {
#ifdef REEL_HAS_WIDE
    if (widest >= 4) {
        filter_learn_4(weights, doubt, gains, n, by, step);
        return;
    }
#endif
    (void)widest;
    filter_learn_2(weights, doubt, gains, n, by, step);
}

enum { LABELS = 0, MEANS = 1, FILTER = 2, RAW = 3 }; /* how values are expected */

#define MOVED 1U /* flags of a row: it is not as the row before */
#define ODD 2U   /* a number of it is not finite */

typedef struct {
    reel_model above[N_CLASSES];            /* is the length above the expected one? */
    reel_model longer[N_CLASSES][N_STEPS];
    reel_model shorter[N_CLASSES][N_STEPS];
    reel_model second[N_CLASSES][8];        /* by the length less the expected one */
    reel_model third[N_CLASSES][8][2];
    reel_model constant[4];                 /* by how many of two neighbours are */
    reel_model moved[N_VOTES + 1][4];       /* by how many neighbours did, and by the own past */
    reel_model candidate[2][N_VOTES + 1][N_VOTES + 1];
    reel_model odd[2][3];
    reel_model odd_again;
    reel_model lag_again;
    int32_t weights[N_INPUTS];
    double temporal[TEMPORAL];              /* weights of the filter that an item begins with */
    uint64_t last_odd;
} exact_models;

/* Of a column of the item: sizes of differences, in sixteenths of octaves, times 16. */
typedef struct {
    int32_t quick, slow, now, last, here;
} exact_past;

typedef struct {
    reel_port *port;
    reel_numbers numbers;
    uint8_t *values; /* frames x items x width numbers */
    int64_t n_frames, n_items, width;
    int kind;
    bool has_stills, has_odd, has_lags;
    reel_visits visits;
    exact_models *models;
    exact_past *past;   /* of the columns */
    double *known;      /* items in order x frames x width: scaled; or their rows as they are */
    int16_t *sizes;     /* likewise: of the differences */
    uint8_t *flags;     /* items in order x frames */
    uint8_t *constant;  /* items in order */
    int32_t *lags;      /* frames */
    float *samples;     /* frames x N_SAMPLES */
    int32_t others;     /* how much larger differences of this row were */
    /* of the item */
    int64_t item, place;
    int32_t near[REEL_MOST_NEAR];
    int n_near;
    int widest; /* doubles of a vector */
    double weights[INPUTS] __attribute__((aligned(REEL_ALIGNMENT)));
    double gains[INPUTS] __attribute__((aligned(REEL_ALIGNMENT)));
    double inputs[INPUTS] __attribute__((aligned(REEL_ALIGNMENT)));
    double doubt[INPUTS * INPUTS] __attribute__((aligned(REEL_ALIGNMENT)));
    double noise, quick_noise; /* variances of errors, of late ones most */
    double *noises;       /* items in order */
} exact_coder;

size_t reel_exact_memory(int64_t n_frames, int64_t n_items, int64_t width) {
    size_t n = (size_t)n_items, rows = n * (size_t)n_frames, all = rows * (size_t)width;
    return reel_visits_room(n) + reel_room(1, sizeof(exact_models)) +
           reel_room((size_t)width, sizeof(exact_past)) + reel_room(all, sizeof(double)) +
           reel_room(all, sizeof(int16_t)) + reel_room(rows, 1) + reel_room(n, 1) +
           reel_room((size_t)n_frames, sizeof(int32_t)) +
           reel_room((size_t)n_frames * N_SAMPLES, sizeof(float)) + reel_room(n, sizeof(double));
}

static bool take(exact_coder *f, void *memory, size_t memory_size) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    size_t n = (size_t)f->n_items, rows = n * (size_t)f->n_frames, all = rows * (size_t)f->width;
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

/* ---- differences ---- */

REEL_INLINE int bit_length(uint64_t value) { return value ? 64 - __builtin_clzll(value) : 0; }

REEL_INLINE int32_t within(int32_t value, int32_t most) {
    return value < -most ? -most : value > most ? most : value;
}

/* Sixteen times the logarithm to base 2 of 2 magnitude + 1, less 16: of the middle of the step. */
REEL_INLINE int32_t size_of(uint64_t magnitude) {
    uint64_t twice = magnitude >> 62 ? UINT64_MAX : 2 * magnitude + 1;
    int length = bit_length(twice);
    return 16 * (length - 2) + (int32_t)(twice << (64 - length) >> 59 & 15U);
}

/* How long a magnitude is, from the expected length up or down. */
REEL_INLINE int code_length(exact_coder *f, int class, int wanted) {
    exact_models *models = f->models;
    int length = class >> 2;
    if (reel_bit(f->port, &models->above[class], wanted > length)) {
        length++;
        for (int i = 0; length < 64; i += i < N_STEPS - 1) {
            if (!reel_bit(f->port, &models->longer[class][i], wanted > length)) {
                break;
            }
            length++;
        }
    } else {
        for (int i = 0; length > 0; i += i < N_STEPS - 1) {
            if (!reel_bit(f->port, &models->shorter[class][i], wanted < length)) {
                break;
            }
            length--;
        }
    }
    return length;
}

/* A difference of a class of expected sizes, modulo 2^64. */
REEL_INLINE uint64_t code_difference(exact_coder *f, int class, uint64_t difference) {
    exact_models *models = f->models;
    uint64_t magnitude = difference >> 63 ? 0 - difference : difference;
    int length = code_length(f, class, bit_length(magnitude));
    if (length == 0) {
        return 0;
    }
    uint64_t found = 1;
    int low = length - 1, away = length - (class >> 2) + 3;
    away = away < 0 ? 0 : away > 7 ? 7 : away;
    if (low > 0) {
        low--;
        found = 2U | (uint64_t)reel_bit(f->port, &models->second[class][away],
                                        (int)(magnitude >> low & 1U));
    }
    if (low > 0) {
        low--;
        found = found << 1 | (uint64_t)reel_bit(f->port, &models->third[class][away][found & 1U],
                                                (int)(magnitude >> low & 1U));
    }
    for (; low >= RAW_BITS; low -= RAW_BITS) {
        uint32_t part = (uint32_t)(magnitude >> (low - RAW_BITS));
        found = found << RAW_BITS | reel_code_raw(f->port, RAW_BITS, part);
    }
    uint32_t rest = (uint32_t)(magnitude << 1 | difference >> 63); /* and the sign */
    rest = reel_code_raw(f->port, low + 1, rest);
    found = found << low | rest >> 1;
    return rest & 1U ? 0 - found : found;
}

REEL_INLINE int class_of(int32_t size) {
    size += 16;
    return (size < 0 ? 0 : size < N_SIZES ? size : N_SIZES - 1) >> 2;
}

/* ---- what size a difference will have ---- */

/* In sixteenths of octaves, scaled: of a number of the item at a time. `spread` is the variance
   that the filter expects, or 0. */
static const int32_t shares[N_NEAR + 1] = {0, 65536, 32768, 21845, 16384, 13107, 10922};

REEL_INLINE int32_t expected_size(exact_coder *f, int64_t t, int64_t col, double spread,
                                  int32_t inputs[N_INPUTS]) {
    exact_past *past = &f->past[col];
    int n = f->n_near < N_NEAR ? f->n_near : N_NEAR;
    int64_t at = t * f->width + col, stride = f->n_frames * f->width;
    int32_t sum = 0, sum_before = 0, most = INT16_MIN;
    for (int i = 0; i < n; i++) {
        const int16_t *row = f->sizes + f->near[i] * stride + at;
        sum += row[0];
        sum_before += row[t ? -f->width : 0];
        most = row[0] > most ? row[0] : most;
    }
    int32_t here = n ? sum * shares[n] >> 16 : t ? past->quick >> 4 : past->last;
    int32_t own = t > 1 ? past->quick >> 4 : here, before = n && t ? sum_before * shares[n] >> 16 : own;
    past->here = own;
    inputs[0] = 16;
    inputs[1] = here - own;
    inputs[2] = col ? f->others : 0;
    inputs[3] = before - own;
    inputs[4] = t > 1 ? own - (past->slow >> 4) : 0;
    inputs[5] = n ? most - here : 0;
    inputs[6] = spread > 0 ? reel_size_of_variance(spread) - own : 0;
    int64_t found = 0;
    for (int i = 0; i < N_INPUTS; i++) {
        inputs[i] = within(inputs[i], MOST_INPUT);
        found += (int64_t)f->models->weights[i] * inputs[i];
    }
    return own + (int32_t)(found >> 16);
}

/* The weights learn from the size that came instead of the expected one. */
REEL_INLINE void learn_size(exact_coder *f, const int32_t *inputs, int32_t missed) {
    missed = within(missed + 10, MOST_ERROR);
    for (int i = 0; i < N_INPUTS; i++) {
        uint32_t more = (uint32_t)(missed * inputs[i] >> 3);
        f->models->weights[i] = (int32_t)((uint32_t)f->models->weights[i] + more);
    }
}

/* ---- the filter: weights of neighbours that predict the item's moves ---- */

static void start_filter(exact_coder *f) {
    int n = f->n_near, n_used = n + TEMPORAL;
    f->noise = 0;
    for (int i = 0; i < INPUTS; i++) {
        f->weights[i] = i < n ? 1.0 / n : i < n_used ? f->models->temporal[i - n] : 0;
        f->inputs[i] = 0;
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

/* The sum of products, of every fourth by itself. */
REEL_INLINE double filter_sum(const double *a, const double *b) {
    double sums[4] = {0, 0, 0, 0};
    for (int i = 0; i < INPUTS; i += 4) {
        sums[0] += a[i] * b[i];
        sums[1] += a[i + 1] * b[i + 1];
        sums[2] += a[i + 2] * b[i + 2];
        sums[3] += a[i + 3] * b[i + 3];
    }
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

/* Variance of the expected move, with gains on the way. */
REEL_INLINE double find_gains(exact_coder *f) {
    filter_gains(f->widest, f->doubt, f->inputs, f->n_near + TEMPORAL, f->gains);
    return filter_sum(f->gains, f->inputs);
}

/* Learns from an error of variance `spread`, where they are numbers to learn from. */
REEL_INLINE bool observe(exact_coder *f, double error, double spread) {
    if (!(spread < 1e100 && error * error < 1e100)) {
        return false;
    }
    double by = 1.0 / spread;
    filter_learn(f->widest, f->weights, f->doubt, f->gains, f->n_near + TEMPORAL, by, error * by);
    return true;
}

/* What is known about weights fades, unless it is next to nothing. */
static void fade(exact_coder *f) {
    double sum = 0;
    for (int i = 0; i < f->n_near + TEMPORAL; i++) {
        sum += f->doubt[INPUTS * i + i];
    }
    if (!(sum < WIDE)) {
        return;
    }
    for (int i = 0; i < INPUTS * (f->n_near + TEMPORAL); i++) {
        f->doubt[i] *= FADING;
    }
}

/* How an item moved beside its neighbours between two places in `known` of its row. */
REEL_INLINE double own_move(const exact_coder *f, int64_t to, int64_t from) {
    int64_t stride = f->n_frames * f->width;
    const double *own = f->known + f->place * stride;
    double moves[INPUTS] __attribute__((aligned(REEL_ALIGNMENT))) = {0};
    for (int i = 0; i < f->n_near; i++) {
        const double *row = f->known + f->near[i] * stride;
        moves[i] = row[to] - row[from];
    }
    return (own[to] - own[from]) - filter_sum(f->weights, moves);
}

REEL_INLINE void find_inputs(exact_coder *f, int64_t t, int64_t col) {
    int64_t stride = f->n_frames * f->width, w = f->width, at = t * w + col;
    for (int i = 0; i < f->n_near; i++) {
        const double *row = f->known + f->near[i] * stride;
        f->inputs[i] = row[at] - row[at - w];
    }
    f->inputs[f->n_near] = t > 1 ? own_move(f, at - w, at - 2 * w) : 0;
    int64_t lag = f->lags[t];
    f->inputs[f->n_near + 1] = lag ? own_move(f, at - lag * w, at - w) : 0;
}

/* ---- numbers ---- */

REEL_INLINE uint64_t pattern_at(const exact_coder *f, int64_t t, int64_t item, int64_t col) {
    const reel_numbers *numbers = &f->numbers;
    return reel_read_pattern(numbers, f->values, (t * f->n_items + item) * f->width + col);
}

REEL_INLINE void put_pattern(const exact_coder *f, int64_t t, int64_t col, uint64_t pattern) {
    const reel_numbers *numbers = &f->numbers;
    reel_write_pattern(numbers, f->values, (t * f->n_items + f->item) * f->width + col, pattern);
}

/* The mean of neighbours, as they are at frame 0 or as they move. */
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

/* Weights are known a little from where neighbours are at frame 0. */
static void observe_places(exact_coder *f, int64_t col, double mean, double value) {
    int64_t stride = f->n_frames * f->width;
    for (int i = 0; i < f->n_near; i++) {
        f->inputs[i] = f->known[f->near[i] * stride + col] - mean;
    }
    f->inputs[f->n_near] = f->inputs[f->n_near + 1] = 0;
    double squares = filter_sum(f->inputs, f->inputs), sum = filter_sum(f->weights, f->inputs);
    double spread = (find_gains(f) + 0.2 * (squares / f->n_near)) + 0x1p-110;
    observe(f, (value - mean) - sum, spread);
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
        found.index = reel_index_of(&f->numbers, pattern);
    }
    return found;
}

REEL_INLINE expectation expected_at(exact_coder *f, int64_t t, int64_t col) {
    expectation found = {0};
    found.base = f->known[(f->place * f->n_frames + t - 1) * f->width + col];
    if (f->kind == FILTER) {
        find_inputs(f, t, col);
        found.value = found.base + filter_sum(f->weights, f->inputs);
        double quick = 4 * f->quick_noise, noise = f->noise < quick ? f->noise : quick;
        found.spread = (find_gains(f) + noise) + 0x1p-110;
    } else {
        found.value = found.base + mean_near(f, t, col, N_NEAR);
    }
    if (f->numbers.type != REEL_FLOATS) {
        found.index = reel_index_of(&f->numbers, pattern_at(f, t - 1, f->item, col));
    }
    return found;
}

REEL_INLINE void learn_move(exact_coder *f, const expectation *from, double value) {
    double error = value - from->value;
    if (observe(f, error, from->spread)) {
        f->noise += (error * error - f->noise) / 20;
        f->quick_noise += (error * error - f->quick_noise) / 8;
    }
}

/* A number of a row of which nothing else is known. */
REEL_INLINE void code_number(exact_coder *f, int64_t t, int64_t col) {
    const reel_numbers *numbers = &f->numbers;
    expectation from = t ? expected_at(f, t, col) : expected_at_first(f, col);
    uint64_t pattern = reel_writes(f->port) ? pattern_at(f, t, f->item, col) : 0;
    if (!(from.value >= -0x1p1000 && from.value <= 0x1p1000)) {
        from.value = from.base;
    }
    int32_t step;
    uint64_t index = reel_expected_index(numbers, from.value, from.base, from.index, &step);
    int32_t inputs[N_INPUTS], size = expected_size(f, t, col, from.spread, inputs);
    if (f->has_odd && code_odd(f, t, col, &pattern)) {
        put_pattern(f, t, col, pattern);
        note(f, t, col, from.value, within(size, REEL_MOST_SIZE));
        return;
    }
    uint64_t difference = reel_index_of(numbers, pattern) - index;
    difference = code_difference(f, class_of(size - step), difference);
    if (!reel_writes(f->port)) {
        pattern = reel_pattern_of(numbers, index + difference);
        put_pattern(f, t, col, pattern);
    }
    int32_t found = size_of(difference >> 63 ? 0 - difference : difference) + step;
    found = within(found, REEL_MOST_SIZE);
    learn_size(f, inputs, found - size);
    double value = reel_known_value(numbers, pattern, from.value);
    note(f, t, col, value, found);
    if (f->kind != FILTER) {
        return;
    }
    if (t) {
        learn_move(f, &from, value);
    } else if (f->n_near) {
        observe_places(f, col, from.value, value);
    }
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

/* Whether the item has the same row at two frames. */
static bool same_rows(const exact_coder *f, int64_t t, int64_t other) {
    size_t size = (size_t)(f->width * f->numbers.size);
    return reel_same(f->values + (size_t)(t * f->n_items + f->item) * size,
                     f->values + (size_t)(other * f->n_items + f->item) * size, size);
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
    }
    *flags = flags[-1] & ODD;
    if (f->kind == LABELS) {
        return;
    }
    for (int64_t col = 0; col < f->width; col++) {
        double value = f->known[(f->place * f->n_frames + t - 1) * f->width + col];
        int32_t step;
        reel_expected_index(&f->numbers, value, value, 0, &step);
        note(f, t, col, value, within(step - 16, REEL_MOST_SIZE));
    }
}

static void code_numbers(exact_coder *f, int64_t t) {
    f->flags[f->place * f->n_frames + t] = MOVED;
    for (int64_t col = 0; col < f->width; col++) {
        code_number(f, t, col);
    }
    end_row(f, t);
    if (t && f->kind == FILTER) {
        fade(f);
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
    for (int64_t col = 0; col < f->width; col++) {
        exact_past *past = &f->past[col];
        int64_t from = f->place ? f->visits.order[f->place - 1] : -1;
        uint64_t base = t          ? pattern_at(f, t - 1, f->item, col)
                        : from >= 0 ? pattern_at(f, 0, from, col)
                                    : 0;
        uint64_t index = reel_index_of(numbers, base);
        uint64_t pattern = reel_writes(f->port) ? pattern_at(f, t, f->item, col) : 0;
        uint64_t difference = reel_index_of(numbers, pattern) - index;
        difference = code_difference(f, class_of(past->last >> 4), difference);
        int32_t found = size_of(difference >> 63 ? 0 - difference : difference);
        past->last += (found * 16 - past->last) >> 2;
        put_pattern(f, t, col, reel_pattern_of(numbers, index + difference));
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

static bool is_constant(const exact_coder *f) {
    int64_t t = 1;
    while (t < f->n_frames && same_rows(f, t, t - 1)) {
        t++;
    }
    return t == f->n_frames;
}

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

static void code_item(exact_coder *f) {
    bool constant = code_constant(f);
    if (f->kind == FILTER) {
        start_filter(f);
    }
    for (int64_t t = 0; t < f->n_frames; t++) {
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
            code_numbers(f, t);
        }
    }
    if (f->kind == FILTER) {
        end_filter(f);
    }
}

/* The first `count` items in order. */
static void code_items(exact_coder *f, int64_t count) {
    for (f->place = 0; f->place < count; f->place++) {
        f->item = f->visits.order[f->place];
        int most = f->kind == LABELS ? N_VOTES : REEL_MOST_NEAR;
        f->n_near = reel_find_near(&f->visits, (int32_t)f->place, most, f->near);
        code_item(f);
    }
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

/* All of a block, or its first `count` items. */
static int64_t code_block(exact_coder *f, int64_t count) {
    f->kind = (int)reel_code_raw(f->port, 2, (uint32_t)f->kind);
    if (f->kind == LABELS) { /* patterns as they are */
        f->numbers.shift = f->numbers.digits = 0;
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
    code_items(f, count);
    return reel_end(f->port);
}

static enum reel_code prepare(exact_coder *f, void *memory, size_t memory_size,
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

/* ---- what the writer chooses ---- */

/* Whether all finite floats have decimal indices that lead back to them; `step` apart, if there
   are many. */
static bool are_decimal(const exact_coder *f, const reel_numbers *numbers, int64_t step) {
    int64_t count = f->n_frames * f->n_items * f->width;
    for (int64_t i = 0; i < count; i += step) {
        uint64_t pattern = reel_read_pattern(numbers, f->values, i);
        if (!reel_is_odd(numbers, pattern) &&
            reel_pattern_of(numbers, reel_index_of(numbers, pattern)) != pattern) {
            return false;
        }
    }
    return true;
}

/* How many octaves coarser decimal floats are than those with so many lowest bits 0, mostly. */
static double octaves_saved(const exact_coder *f, const reel_numbers *decimal, int64_t step) {
    reel_numbers plain = *decimal;
    plain.digits = 0;
    int64_t count = f->n_frames * f->n_items * f->width, sum = 0, n = 0;
    for (int64_t i = 0; i < count; i += step) {
        uint64_t pattern = reel_read_pattern(decimal, f->values, i);
        if (!reel_is_odd(decimal, pattern)) {
            double value = reel_float_value(decimal, pattern) * decimal->down;
            int32_t coarse, fine;
            reel_expected_index(decimal, value, value, 0, &coarse);
            reel_expected_index(&plain, value, value, 0, &fine);
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

/* Bytes of some items, if values are expected in a way. */
static int64_t try_kind(exact_coder *f, int kind, uint8_t *out, size_t room) {
    exact_coder tried = *f;
    reel_port port = reel_writer(out, room);
    int64_t count = f->n_items / 32 + 64;
    tried.kind = kind;
    tried.port = &port;
    int64_t found = code_block(&tried, count < f->n_items ? count : f->n_items);
    return found < 0 ? INT64_MAX : found;
}

static void choose_kind(exact_coder *f, uint8_t *out, size_t room) {
    bool many_stills;
    count_stills(f, &many_stills, &f->has_stills);
    bool is_float = f->numbers.type == REEL_FLOATS;
    int numeric = f->n_frames > 1 && (is_float || f->numbers.size > 1) ? FILTER : MEANS;
    f->kind = numeric;
    if (is_float && !many_stills) {
        return;
    }
    int64_t least = try_kind(f, numeric, out, room);
    for (int kind = LABELS; kind < numeric; kind++) {
        int64_t found = is_float && kind == MEANS ? INT64_MAX : try_kind(f, kind, out, room);
        if (found < least) {
            least = found;
            f->kind = kind;
        }
    }
}

static exact_coder coder_of(void *values, int64_t n_frames, int64_t n_items, int64_t width,
                            int64_t size, int64_t type) {
    return (exact_coder){.values = values,
                         .n_frames = n_frames,
                         .n_items = n_items,
                         .width = width,
                         .widest = reel_widest(),
                         .numbers = {.size = (int)size, .type = (int)type}};
}

int64_t reel_exact_encode(void *memory, size_t memory_size, void *values, int64_t n_frames,
                          int64_t n_items, int64_t width, int64_t size, int64_t type,
                          const int32_t *starts, const int32_t *near, uint8_t *out, size_t room) {
    exact_coder f = coder_of(values, n_frames, n_items, width, size, type);
    enum reel_code code = prepare(&f, memory, memory_size, starts, near);
    if (code) {
        return reel_failure(code, 0);
    }
    choose_numbers(&f);
    if (type != REEL_FLOATS) {
        reel_set_scale(&f.numbers, 8 * f.numbers.size);
    }
    choose_lags(&f);
    choose_kind(&f, out, room);
    reel_port port = reel_writer(out, room);
    f.port = &port;
    int64_t found = code_block(&f, n_items);
    if (found < 0) { /* they are noise */
        port = reel_writer(out, room);
        f.kind = RAW;
        found = code_block(&f, n_items);
    }
    return found;
}

int64_t reel_exact_decode(void *memory, size_t memory_size, const uint8_t *in, size_t in_size,
                          void *values, int64_t n_frames, int64_t n_items, int64_t width,
                          int64_t size, int64_t type, const int32_t *starts,
                          const int32_t *near) {
    exact_coder f = coder_of(values, n_frames, n_items, width, size, type);
    enum reel_code code = prepare(&f, memory, memory_size, starts, near);
    if (code) {
        return reel_failure(code, 0);
    }
    reel_port port = reel_reader(in, in_size);
    f.port = &port;
    return code_block(&f, n_items);
}
