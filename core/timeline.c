/* Temporal basis vectors of a block: decoding from integers, and quantization.

   docs/format.md, "Times", "Adaptive times" and "Cosines". A value is predicted by the polynomial
   through known values at times around it; at a resting time, by the previous value. Values are
   multiples of 1/256, and exact below 2^44. Adaptive predictions add terms, with weights that adapt
   to decoded values. Alternatively, the integers are coefficients of a discrete cosine transform
   over time, whose cosines have the same bits on every machine. */

#include "rounding.h"

#define COARSEST 4 /* distance of the times of level 0, which are coded first */
#define N_LEVELS 3 /* levels of moving times; the distance halves from each to the next */

#define N_WEIGHTS 3       /* terms of an adaptive prediction: the plain one, and two differences */
#define RECOVERY 0.0625   /* share of the initial variances in those at the start of a mode */
#define ERROR_RATE 0.0625 /* share of the last squared error in its moving average */
#define CURRENT_ERROR_SHARE 4.0   /* weight of the current squared error in the observation noise */
#define LARGEST_PREDICTION 0x1p29 /* keeps values of hostile streams finite */

#define HALF_PI 0x1.921fb54442d18p+0
#define N_TERMS 11   /* terms of the cosine series after the 1, for angles up to 90 degrees */
#define FIRST_BAND 4 /* coefficients that share a dead zone; the next bands are octaves */

#define N_ROUNDS 2 /* iterations of a dead zone, which depends on the counts that it causes */
#define FIRST_DEAD_ZONE 0.6

/* Predict the value at a time from those at distances d and 3 d, as far as they exist. */
REEL_INLINE double predict_time(const double *values, int64_t time, int64_t d, int64_t n_frames) {
    if (time + d >= n_frames) {
        return values[time - d];
    }
    double before = values[time - d], after = values[time + d];
    bool has_first = time >= 3 * d, has_last = time + 3 * d < n_frames;
    if (has_first && has_last) {
        return (9.0 * (before + after) - (values[time - 3 * d] + values[time + 3 * d])) / 16.0;
    }
    if (has_first) {
        return (6.0 * before + 3.0 * after - values[time - 3 * d]) / 8.0;
    }
    if (has_last) {
        return (3.0 * before + 6.0 * after - values[time + 3 * d]) / 8.0;
    }
    return (before + after) / 2.0;
}

/* Weights of the adaptive predictions of a level: a Kalman filter without covariances, so that
   variances cannot become negative, even in hostile streams. */
typedef struct {
    double weights[N_WEIGHTS], variances[N_WEIGHTS];
    double error; /* running mean of squared prediction errors */
} level_filter;

typedef struct {
    level_filter levels[N_LEVELS];
} time_filter;

static const double initial_variances[N_WEIGHTS] = {0.0625, 0.015625, 0.015625};

static void start_filter(time_filter *filter) {
    for (int level = 0; level < N_LEVELS; level++) {
        level_filter *level_state = &filter->levels[level];
        *level_state = (level_filter){.error = 1.0};
        for (int i = 0; i < N_WEIGHTS; i++) {
            level_state->variances[i] = initial_variances[i];
        }
    }
}

/* Increase the variances, because the next mode may move differently. */
static void begin_mode(time_filter *filter) {
    for (int level = 0; level < N_LEVELS; level++) {
        for (int i = 0; i < N_WEIGHTS; i++) {
            double *variance = &filter->levels[level].variances[i];
            *variance = (1.0 - RECOVERY) * *variance + RECOVERY * initial_variances[i];
        }
    }
}

/* Compute the terms of an adaptive prediction; the first is the plain prediction. */
REEL_INLINE void find_terms(const double *values, int level, int64_t time, int64_t d,
                            int64_t n_frames, double *terms) {
    terms[1] = terms[2] = 0.0;
    if (!level) {
        terms[0] = time ? values[time - COARSEST] : 0.0;
        return;
    }
    terms[0] = predict_time(values, time, d, n_frames);
    if (time >= 5 * d && time + 5 * d < n_frames) {
        double middle = values[time - 3 * d] + values[time + 3 * d];
        terms[1] = (values[time - d] + values[time + d]) - middle;
        terms[2] = middle - (values[time - 5 * d] + values[time + 5 * d]);
    }
}

REEL_INLINE double predict_adaptive(const level_filter *filter, const double *terms) {
    const double *weights = filter->weights;
    double change = (weights[0] * terms[0] + weights[1] * terms[1]) + weights[2] * terms[2];
    double sum = terms[0] + change;
    sum = sum < LARGEST_PREDICTION ? sum : LARGEST_PREDICTION;
    return sum > -LARGEST_PREDICTION ? sum : -LARGEST_PREDICTION;
}

/* Update the weights with the error of a prediction: the decoded integer. */
REEL_INLINE void observe(level_filter *filter, const double *terms, double error) {
    double gains[N_WEIGHTS], square = error * error;
    double noise = (1.0 + filter->error) + CURRENT_ERROR_SHARE * square;
    for (int i = 0; i < N_WEIGHTS; i++) {
        gains[i] = filter->variances[i] * terms[i];
        noise += gains[i] * terms[i];
    }
    double inverse = 1.0 / noise;
    for (int i = 0; i < N_WEIGHTS; i++) {
        double remaining_share = 1.0 - (gains[i] * terms[i]) * inverse;
        filter->weights[i] += gains[i] * (error * inverse);
        filter->variances[i] *= remaining_share > 0.0 ? remaining_share : 0.0;
    }
    filter->error += ERROR_RATE * (square - filter->error);
}

/* Times of a level: first, first + step, ...; `d` is their distance to known times. */
typedef struct {
    int64_t d, first, step;
} level_times;

static level_times times_of_level(int level) {
    int64_t d = COARSEST >> level;
    return (level_times){d, level ? d : 0, level ? 2 * d : d};
}

/* Decode a column with adaptive predictions. */
static void decode_adaptive(const int32_t *integers, int64_t n_frames, time_filter *filter,
                            double *values) {
    for (int level = 0; level < N_LEVELS; level++) {
        level_times grid = times_of_level(level);
        for (int64_t time = grid.first; time < n_frames; time += grid.step) {
            double terms[N_WEIGHTS];
            find_terms(values, level, time, grid.d, n_frames, terms);
            values[time] = predict_adaptive(&filter->levels[level], terms) + integers[time];
            observe(&filter->levels[level], terms, integers[time]);
        }
    }
}

/* Whether the integers of a mode are all 0. Encoders drop such modes; weights ignore them. */
static bool is_zero(const int32_t *integers, int64_t n) {
    for (int64_t i = 0; i < n; i++) {
        if (integers[i]) {
            return false;
        }
    }
    return true;
}

/* Decode a column with plain predictions. */
static void decode_times(const int32_t *integers, int64_t n_frames, double *values) {
    double latest = 0.0;
    for (int64_t time = 0; time < n_frames; time += COARSEST) {
        latest += integers[time];
        values[time] = latest;
    }
    for (int64_t d = COARSEST / 2; d; d /= 2) {
        for (int64_t time = d; time < n_frames; time += 2 * d) {
            values[time] = predict_time(values, time, d, n_frames) + integers[time];
        }
    }
}

/* Moving and resting times of a block. */
typedef struct {
    int64_t n_frames, n_moving;
    int32_t *moving_times; /* moving times, ascending */
    const uint8_t *rests;  /* whether each time rests; NULL if none does */
    double unit;           /* step of the integers at resting times */
} timeline;

static size_t timeline_bytes(int64_t n_frames) {
    return reel_array_bytes((size_t)n_frames, sizeof(int32_t));
}

/* List the moving times, which include the first. Return 0, or a failure. */
static int64_t find_timeline(reel_arena *arena, int64_t n_frames, const uint8_t *rests,
                             int64_t rest_bits, timeline *times) {
    *times = (timeline){.n_frames = n_frames, .rests = rests};
    times->moving_times = reel_allocate(arena, (size_t)n_frames, sizeof *times->moving_times);
    if (arena->failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    if (rests && (rest_bits < 0 || rest_bits > REEL_MAX_REST_BITS || (n_frames && rests[0]))) {
        return reel_failure(REEL_INVALID, 0);
    }
    times->unit = rests ? 1.0 / (double)((int64_t)1 << rest_bits) : 1.0;
    for (int64_t time = 0; time < n_frames; time++) {
        if (!rests || !rests[time]) {
            times->moving_times[times->n_moving++] = (int32_t)time;
        }
    }
    return 0;
}

/* Move the values of moving times, stored at the front, to their times. */
static void scatter(const timeline *times, double *values) {
    for (int64_t i = times->n_moving - 1; i >= 0; i--) { /* moving[i] >= i: none is overwritten */
        values[times->moving_times[i]] = values[i];
    }
}

/* Decode a column at all times. `moving_integers` has space for n_frames integers; `filter` is NULL
   for plain predictions. */
static void decode_column(const int32_t *integers, const timeline *times, time_filter *filter,
                          int32_t *moving_integers, double *values) {
    for (int64_t i = 0; i < times->n_moving; i++) {
        moving_integers[i] = integers[times->moving_times[i]];
    }
    if (filter) {
        decode_adaptive(moving_integers, times->n_moving, filter, values);
    } else {
        decode_times(moving_integers, times->n_moving, values);
    }
    scatter(times, values);
    for (int64_t time = 1; times->rests && time < times->n_frames; time++) {
        if (times->rests[time]) {
            values[time] = values[time - 1] + integers[time] * times->unit;
        }
    }
}

/* The coding order of the integers of a vector. The context of an integer consists of integers at
   other times of its column, and at its time in previous columns.
   docs/format.md, "Passes by times". */
#define NEAR_TIMES 4
#define PREVIOUS_COLUMNS 2

typedef struct {
    int64_t n_frames, n_added;
    int32_t *columns, *near;
    int64_t *near_starts;
} time_order;

/* Append a time of a column; `near` are the times of its context, -1 for none. */
static void add_time(time_order *order, int64_t column, int64_t time, const int64_t *near) {
    int64_t position = order->n_added++, count = order->near_starts[position];
    order->columns[position] = (int32_t)(column * order->n_frames + time);
    for (int k = 0; k < NEAR_TIMES; k++) {
        if (near[k] >= 0) {
            order->near[count++] = (int32_t)(column * order->n_frames + near[k]);
        }
    }
    for (int64_t previous = column - PREVIOUS_COLUMNS; previous < column; previous++) {
        if (previous >= 0) {
            order->near[count++] = (int32_t)(previous * order->n_frames + time);
        }
    }
    order->near_starts[position + 1] = count;
}

/* Append a level of the moving times of a column. */
static void add_level(time_order *order, int64_t column, int level, const timeline *times) {
    level_times grid = times_of_level(level);
    int64_t distance = level ? grid.d : grid.d / 2;
    for (int64_t i = grid.first; i < times->n_moving; i += grid.step) {
        const int64_t nearby[] = {i - distance, i + distance, i - 2 * distance, i - 4 * distance};
        int64_t near[NEAR_TIMES];
        for (int k = 0; k < NEAR_TIMES; k++) { /* level 0 is coded before times between its own */
            bool is_known = (level || k >= 2) && nearby[k] >= 0 && nearby[k] < times->n_moving;
            near[k] = is_known ? times->moving_times[nearby[k]] : -1;
        }
        add_time(order, column, times->moving_times[i], near);
    }
}

static void add_resting(time_order *order, int64_t column, const uint8_t *rests) {
    for (int64_t time = 1; time < order->n_frames; time++) {
        const int64_t near[] = {rests[time - 1] ? time - 1 : -1,
                                time > 1 && rests[time - 2] ? time - 2 : -1, -1, -1};
        if (rests[time]) {
            add_time(order, column, time, near);
        }
    }
}

static void add_frequencies(time_order *order, int64_t column) {
    for (int64_t k = 0; k < order->n_frames; k++) {
        add_time(order, column, k, (const int64_t[]){k - 1, k - 2, k - 3, k - 4});
    }
}

size_t reel_time_order_memory(int64_t n_frames) { return timeline_bytes(n_frames); }

int64_t reel_time_order(void *memory, size_t memory_size, int64_t n_columns, int64_t n_frames,
                        int64_t has_cosines, const uint8_t *rests, int32_t *columns,
                        int64_t *pass_starts, int64_t *near_starts, int32_t *near) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    time_order order = {n_frames, 0, columns, near, near_starts};
    timeline times;
    int64_t failure = find_timeline(&arena, n_frames, rests, 0, &times);
    if (failure) {
        return failure;
    }
    int n_passes = has_cosines ? 1 : rests ? N_LEVELS + 1 : N_LEVELS;
    pass_starts[0] = near_starts[0] = 0;
    for (int pass = 0; pass < n_passes; pass++) {
        for (int64_t column = 0; column < n_columns; column++) {
            if (has_cosines) {
                add_frequencies(&order, column);
            } else if (pass < N_LEVELS) {
                add_level(&order, column, pass, &times);
            } else {
                add_resting(&order, column, rests);
            }
        }
        pass_starts[pass + 1] = order.n_added;
    }
    return n_passes;
}

size_t reel_basis_memory(int64_t n_columns, int64_t n_frames) {
    return reel_array_bytes((size_t)n_columns * (size_t)n_frames, sizeof(double)) +
           timeline_bytes(n_frames) + reel_array_bytes((size_t)n_frames, sizeof(int32_t));
}

int64_t reel_lengths(const double *values, int64_t n_verts, int64_t n_modes, int64_t n_reused,
                     double finer, double *lengths) {
    for (int64_t mode = 0; mode < n_reused; mode++) {
        lengths[mode] = 0.0;
    }
    for (int64_t v = 0; v < n_verts; v++) {
        const double *row = values + v * n_modes;
        for (int64_t mode = 0; mode < n_reused; mode++) {
            lengths[mode] += row[mode] * row[mode];
        }
    }
    for (int64_t mode = 0; mode < n_reused; mode++) {
        double norm = lengths[mode] > 0.0 ? __builtin_sqrt(lengths[mode]) : 1.0;
        lengths[mode] = norm / finer;
    }
    return n_reused;
}

/* Write a basis vector: the values divided by `norm` or, if that is NULL, by their norm. */
static void write_vector(const double *values, int64_t length, const double *norm, double *vector,
                         int64_t stride) {
    double sum = 0.0;
    for (int64_t i = 0; i < length; i++) {
        sum += values[i] * values[i];
    }
    double divisor = norm ? *norm : sum > 0.0 ? __builtin_sqrt(sum) : 1.0;
    for (int64_t i = 0; i < length; i++) {
        vector[i * stride] = values[i] / divisor;
    }
}

int64_t reel_basis(void *memory, size_t memory_size, const int32_t *integers, int64_t n_modes,
                   int64_t n_columns, int64_t n_frames, const uint8_t *rests, int64_t rest_bits,
                   int64_t is_adaptive, const double *lengths, int64_t n_reused, double *basis) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    int64_t length = n_columns * n_frames;
    timeline times;
    time_filter filter;
    double *values = reel_allocate(&arena, (size_t)length, sizeof *values);
    int32_t *moving_integers = reel_allocate(&arena, (size_t)n_frames, sizeof *moving_integers);
    int64_t failure = find_timeline(&arena, n_frames, rests, rest_bits, &times);
    if (failure) {
        return failure;
    }
    for (int64_t mode = 0; mode < n_modes; mode++) {
        const int32_t *mode_integers = integers + mode * length;
        bool adapts = is_adaptive && !is_zero(mode_integers, length);
        if (!mode || mode == n_reused) {
            start_filter(&filter);
        }
        if (adapts) {
            begin_mode(&filter);
        }
        for (int64_t first = 0; first < length; first += n_frames) {
            decode_column(mode_integers + first, &times, adapts ? &filter : NULL, moving_integers,
                          values + first);
        }
        write_vector(values, length, mode < n_reused ? lengths + mode : NULL, basis + mode,
                     n_modes);
    }
    return n_modes;
}

/* Compute the basis of a discrete cosine transform at the first n_times times: frequency k has the
   value waves[k * frequency_stride + t * time_stride] at time t. `cosines` has space for 4 n_frames
   numbers. */
static void find_waves(int64_t n_frames, int64_t n_times, double *cosines,
                       int64_t frequency_stride, int64_t time_stride, double *waves) {
    int64_t period = 4 * n_frames;
    double mean = __builtin_sqrt(1.0 / (double)n_frames);
    double scale = __builtin_sqrt(2.0 / (double)n_frames);
    for (int64_t i = 0; i < n_frames; i++) {
        double angle = (double)i * HALF_PI / (double)n_frames, square = angle * angle, cosine = 1.0;
        for (int j = N_TERMS; j > 0; j--) {
            cosine = 1.0 - cosine * square / (double)(2 * j * (2 * j - 1));
        }
        cosines[i] = cosine;
    }
    cosines[n_frames] = 0.0;
    for (int64_t i = n_frames + 1; i < period; i++) {
        cosines[i] = i <= 2 * n_frames ? -cosines[2 * n_frames - i] : cosines[period - i];
    }
    for (int64_t k = 0; k < n_frames; k++) {
        for (int64_t t = 0, index = k; t < n_times; t++) {
            waves[k * frequency_stride + t * time_stride] = k ? scale * cosines[index] : mean;
            index += 2 * k;
            index -= index >= period ? period : 0;
        }
    }
}

/* Add a multiple of a row to the sums; `restrict` lets compilers vectorize the loop. */
REEL_INLINE void add_multiple(int64_t n, double factor, const double *restrict row,
                              double *restrict sums) {
    for (int64_t i = 0; i < n; i++) {
        sums[i] += factor * row[i];
    }
}

/* Add multiples of two rows to the sums, which halves the memory accesses to the sums. */
REEL_INLINE void add_multiples(int64_t n, const double *factors, const double *restrict row,
                               const double *restrict next, double *restrict sums) {
    double factor = factors[0], next_factor = factors[1];
    for (int64_t i = 0; i < n; i++) {
        sums[i] = (sums[i] + factor * row[i]) + next_factor * next[i];
    }
}

/* Sum the waves of every other frequency over the first half of the times; the second half mirrors
   it, with the opposite sign for odd frequencies. Skips zero coefficients. */
static void add_waves(const int32_t *coefficients, int64_t n_frames, int64_t first,
                      const double *waves, double *sums) {
    int64_t half = (n_frames + 1) / 2;
    const double *pending = NULL;
    double factors[2] = {0.0, 0.0};
    reel_zero(sums, (size_t)half * sizeof *sums);
    for (int64_t k = first; k < n_frames; k += 2) {
        const double *row = waves + k * half;
        if (!coefficients[k]) {
            continue;
        }
        factors[pending != NULL] = coefficients[k];
        if (pending) {
            add_multiples(half, factors, pending, row, sums);
        }
        pending = pending ? NULL : row;
    }
    if (pending) {
        add_multiple(half, factors[0], pending, sums);
    }
}

/* Decode a column from its coefficients; `sums` has space for n_frames + 1 numbers. */
static void decode_cosines(const int32_t *coefficients, int64_t n_frames, const double *waves,
                           double *sums, double *values) {
    int64_t half = (n_frames + 1) / 2;
    double *even = sums, *odd = sums + half;
    add_waves(coefficients, n_frames, 0, waves, even);
    add_waves(coefficients, n_frames, 1, waves, odd);
    for (int64_t t = 0; t < half; t++) {
        values[t] = even[t] + odd[t];
        values[n_frames - 1 - t] = even[t] - odd[t];
    }
}

static bool may_have_cosines(int64_t n_frames) {
    return n_frames >= 1 && n_frames <= REEL_MAX_COSINES;
}

/* Memory of the waves of a block; 0 above the limit of frames, which is invalid. */
static size_t waves_bytes(int64_t n_frames) {
    size_t n = may_have_cosines(n_frames) ? (size_t)n_frames : 0;
    return reel_array_bytes(4 * n, sizeof(double)) + reel_array_bytes(n * n, sizeof(double));
}

size_t reel_cosine_basis_memory(int64_t n_columns, int64_t n_frames) {
    return reel_array_bytes((size_t)n_columns * (size_t)n_frames, sizeof(double)) +
           reel_array_bytes((size_t)n_frames + 1, sizeof(double)) + waves_bytes(n_frames);
}

int64_t reel_cosine_basis(void *memory, size_t memory_size, const int32_t *integers,
                          int64_t n_modes, int64_t n_columns, int64_t n_frames,
                          const double *lengths, int64_t n_reused, double *basis) {
    if (!may_have_cosines(n_frames)) {
        return reel_failure(REEL_INVALID, 0);
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
    int64_t length = n_columns * n_frames, half = (n_frames + 1) / 2;
    double *values = reel_allocate(&arena, (size_t)length, sizeof *values);
    double *sums = reel_allocate(&arena, (size_t)n_frames + 1, sizeof *sums);
    double *cosines = reel_allocate(&arena, 4 * (size_t)n_frames, sizeof *cosines);
    double *waves = reel_allocate(&arena, (size_t)(n_frames * half), sizeof *waves);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    find_waves(n_frames, half, cosines, half, 1, waves);
    for (int64_t mode = 0; mode < n_modes; mode++) {
        for (int64_t first = 0; first < length; first += n_frames) {
            decode_cosines(integers + mode * length + first, n_frames, waves, sums,
                           values + first);
        }
        write_vector(values, length, mode < n_reused ? lengths + mode : NULL, basis + mode,
                     n_modes);
    }
    return n_modes;
}

/* Return the magnitude below which `count` values are quantized to 0. The bits of a 1 and of a 0
   are estimated from their frequencies; a bit is worth `rd_lambda` squared steps of error. */
static double dead_zone(const double *scaled, int64_t count, double rd_lambda) {
    double zone = FIRST_DEAD_ZONE;
    for (int round = 0; round < N_ROUNDS && rd_lambda > 0.0; round++) {
        double n_zeros = 0.0, n_ones = 0.0;
        for (int64_t i = 0; i < count; i++) {
            double size = reel_magnitude(scaled[i]);
            n_zeros += size < zone ? 1.0 : 0.0;
            n_ones += size >= zone && size < 1.5 ? 1.0 : 0.0;
        }
        zone = reel_dead_zone(n_zeros, n_ones, rd_lambda);
    }
    return rd_lambda > 0.0 ? zone : REEL_NEAREST_ZONE;
}

/* Quantize a value; return false if it is too large. */
REEL_INLINE bool quantize(double scaled, double zone, double rd_lambda, int32_t *integer) {
    if (!(reel_magnitude(scaled) < REEL_TOO_LARGE)) {
        return false;
    }
    *integer = reel_round_rd(scaled, zone, !(rd_lambda > 0.0));
    return true;
}

/* Quantize times d, 3 d, 5 d, ... of a column; return false if a value is too large. */
static bool encode_level(const double *targets, int64_t n_frames, int64_t d, double rd_lambda,
                         double *values, double *scaled, int32_t *integers) {
    int64_t count = 0;
    for (int64_t time = d; time < n_frames; time += 2 * d) {
        scaled[count++] = targets[time] - predict_time(values, time, d, n_frames);
    }
    double zone = dead_zone(scaled, count, rd_lambda);
    count = 0;
    for (int64_t time = d; time < n_frames; time += 2 * d) {
        if (!quantize(scaled[count++], zone, rd_lambda, &integers[time])) {
            return false;
        }
        values[time] = predict_time(values, time, d, n_frames) + integers[time];
    }
    return true;
}

static bool encode_times(const double *targets, int64_t n_frames, double rd_lambda, double *values,
                         double *scaled, int32_t *integers) {
    int32_t latest = 0;
    for (int64_t time = 0; time < n_frames; time += COARSEST) {
        int32_t integer;
        if (!quantize(targets[time], REEL_NEAREST_ZONE, 0.0, &integer)) {
            return false;
        }
        values[time] = integer;
        integers[time] = integer - latest;
        latest = integer;
    }
    for (int64_t d = COARSEST / 2; d; d /= 2) {
        if (!encode_level(targets, n_frames, d, rd_lambda, values, scaled, integers)) {
            return false;
        }
    }
    return true;
}

/* Numbers of zeros and ones of a mode so far at the adaptive times of a level. */
typedef struct {
    double n_zeros, n_ones;
} level_counts;

static bool encode_adaptive(const double *targets, int64_t n_frames, double rd_lambda,
                            time_filter *filter, level_counts *counts, double *values,
                            int32_t *integers) {
    for (int level = 0; level < N_LEVELS; level++) {
        level_times grid = times_of_level(level);
        for (int64_t time = grid.first; time < n_frames; time += grid.step) {
            double terms[N_WEIGHTS];
            find_terms(values, level, time, grid.d, n_frames, terms);
            double predicted = predict_adaptive(&filter->levels[level], terms);
            double scaled = targets[time] - predicted, size = reel_magnitude(scaled);
            level_counts *tally = &counts[level];
            bool is_plain = !level || !(rd_lambda > 0.0); /* level 0 predicts the others */
            double zone = is_plain ? REEL_NEAREST_ZONE
                                   : reel_dead_zone(tally->n_zeros, tally->n_ones, rd_lambda);
            if (!quantize(scaled, zone, is_plain ? 0.0 : rd_lambda, &integers[time])) {
                return false;
            }
            tally->n_zeros += size < zone ? 1.0 : 0.0;
            tally->n_ones += size >= zone && size < 1.5 ? 1.0 : 0.0;
            values[time] = predicted + integers[time];
            observe(&filter->levels[level], terms, integers[time]);
        }
    }
    return true;
}

/* Working memory for a column. */
typedef struct {
    double *targets, *values, *scaled;
    int32_t *integers;
    time_filter *filter; /* NULL unless times are adaptive */
    level_counts counts[N_LEVELS];
} column_work;

/* Quantize resting times. They keep the quantization error of the last moving time, because its
   correction would be visible as motion. */
static bool encode_rests(const double *targets, const timeline *times, double rd_lambda,
                         double *values, int32_t *integers) {
    double zone = rd_lambda > 0.0 ? FIRST_DEAD_ZONE : REEL_NEAREST_ZONE, error = 0.0;
    for (int64_t time = 1; times->rests && time < times->n_frames; time++) {
        if (!times->rests[time]) {
            continue;
        }
        if (!times->rests[time - 1]) {
            error = values[time - 1] - targets[time - 1];
        }
        double move = targets[time] + error - values[time - 1];
        if (!quantize(move / times->unit, zone, rd_lambda, &integers[time])) {
            return false;
        }
        values[time] = values[time - 1] + integers[time] * times->unit;
    }
    return true;
}

static bool encode_column(const double *targets, const timeline *times, double rd_lambda,
                          column_work *work, int32_t *integers) {
    for (int64_t i = 0; i < times->n_moving; i++) {
        work->targets[i] = targets[times->moving_times[i]];
    }
    bool is_done = work->filter
                       ? encode_adaptive(work->targets, times->n_moving, rd_lambda, work->filter,
                                         work->counts, work->values, work->integers)
                       : encode_times(work->targets, times->n_moving, rd_lambda, work->values,
                                      work->scaled, work->integers);
    if (!is_done) {
        return false;
    }
    for (int64_t i = 0; i < times->n_moving; i++) {
        integers[times->moving_times[i]] = work->integers[i];
    }
    scatter(times, work->values);
    return encode_rests(targets, times, rd_lambda, work->values, integers);
}

/* Quantize all columns of a mode. If its integers are all 0, restore the filter. */
static bool encode_mode(const double *targets, int64_t n_columns, const timeline *times,
                        double rd_lambda, column_work *work, int32_t *integers) {
    time_filter saved;
    reel_zero(work->counts, sizeof work->counts);
    if (work->filter) {
        saved = *work->filter;
        begin_mode(work->filter);
    }
    for (int64_t first = 0; first < n_columns * times->n_frames; first += times->n_frames) {
        if (!encode_column(targets + first, times, rd_lambda, work, integers + first)) {
            return false;
        }
    }
    if (work->filter && is_zero(integers, n_columns * times->n_frames)) {
        *work->filter = saved;
    }
    return true;
}

size_t reel_basis_encode_memory(int64_t n_frames) {
    return 3 * reel_array_bytes((size_t)n_frames, sizeof(double)) +
           reel_array_bytes((size_t)n_frames, sizeof(int32_t)) + timeline_bytes(n_frames);
}

int64_t reel_basis_encode(void *memory, size_t memory_size, const double *targets, int64_t n_modes,
                          int64_t n_columns, int64_t n_frames, const uint8_t *rests,
                          int64_t rest_bits, int64_t is_adaptive, double rd_lambda,
                          int32_t *integers) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    timeline times;
    time_filter filter;
    column_work work = {.filter = is_adaptive ? &filter : NULL};
    work.targets = reel_allocate(&arena, (size_t)n_frames, sizeof *work.targets);
    work.values = reel_allocate(&arena, (size_t)n_frames, sizeof *work.values);
    work.scaled = reel_allocate(&arena, (size_t)n_frames, sizeof *work.scaled);
    work.integers = reel_allocate(&arena, (size_t)n_frames, sizeof *work.integers);
    int64_t failure = find_timeline(&arena, n_frames, rests, rest_bits, &times);
    if (failure) {
        return failure;
    }
    start_filter(&filter);
    for (int64_t mode = 0; mode < n_modes; mode++) {
        int64_t first = mode * n_columns * n_frames;
        if (!encode_mode(targets + first, n_columns, &times, rd_lambda, &work, integers + first)) {
            return reel_failure(REEL_INVALID, (uint64_t)mode);
        }
    }
    return n_modes;
}

/* Quantize the coefficients of a column: the first FIRST_BAND, and then each octave, with a dead
   zone of their own. */
static bool round_coefficients(const double *coefficients, int64_t n, double rd_lambda,
                               int32_t *integers) {
    for (int64_t first = 0, end = FIRST_BAND; first < n; first = end, end *= 2) {
        end = end < n ? end : n;
        double zone = dead_zone(coefficients + first, end - first, rd_lambda);
        for (int64_t k = first; k < end; k++) {
            if (!quantize(coefficients[k], zone, rd_lambda, &integers[k])) {
                return false;
            }
        }
    }
    return true;
}

size_t reel_cosines_encode_memory(int64_t n_frames) {
    return reel_array_bytes((size_t)n_frames, sizeof(double)) + waves_bytes(n_frames);
}

int64_t reel_cosines_encode(void *memory, size_t memory_size, const double *targets,
                            int64_t n_modes, int64_t n_columns, int64_t n_frames, double rd_lambda,
                            int32_t *integers) {
    if (!may_have_cosines(n_frames)) {
        return reel_failure(REEL_INVALID, 0);
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
    double *coefficients = reel_allocate(&arena, (size_t)n_frames, sizeof *coefficients);
    double *cosines = reel_allocate(&arena, 4 * (size_t)n_frames, sizeof *cosines);
    double *waves = reel_allocate(&arena, (size_t)(n_frames * n_frames), sizeof *waves);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    find_waves(n_frames, n_frames, cosines, 1, n_frames, waves);
    for (int64_t row = 0; row < n_columns * n_modes; row++) {
        reel_zero(coefficients, (size_t)n_frames * sizeof *coefficients);
        for (int64_t t = 0; t < n_frames; t++) {
            add_multiple(n_frames, targets[row * n_frames + t], waves + t * n_frames, coefficients);
        }
        if (!round_coefficients(coefficients, n_frames, rd_lambda, integers + row * n_frames)) {
            return reel_failure(REEL_INVALID, (uint64_t)row);
        }
    }
    return n_modes;
}
