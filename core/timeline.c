/* How the modes of a block move: basis vectors over time, from integers.

   docs/format.md, "Times", "Adaptive times" and "Cosines". A time is predicted from known ones
   around it by the polynomial through them, and one that rests from the time before it. Values are
   multiples of 1/256, and exact as long as they stay below 2^44. Adaptive times add terms to these
   predictions, whose weights follow what is decoded. Or integers are coefficients of a discrete
   cosine transform over time, whose cosines are the same bits on every machine. */

#include "rounding.h"

#define COARSEST 4 /* frames between the times that come first */
#define N_LEVELS 3 /* of times that do not rest */

#define N_WEIGHTS 3           /* of adaptive predictions: of the plain one, and two differences */
#define RETURNING 0.0625      /* share of the first variances that comes back with each mode */
#define FOLLOWED 0.0625       /* share of the latest square in the mean squared error */
#define OWN_NOISE 4.0         /* by the squared error of the observation itself */
#define LARGEST_PREDICTION 0x1p29 /* keeps values of hostile streams finite */

#define HALF_PI 0x1.921fb54442d18p+0
#define N_TERMS 11 /* of the series of a cosine, behind the first: up to a right angle */
#define LOWEST 4   /* coefficients that share a dead zone; then as many as all below them do */

#define N_ROUNDS 2           /* in which a dead zone follows the counts that it makes */
#define FIRST_DEAD_ZONE 0.6

/* The prediction of a time from those d before and behind it, and 3 d. */
REEL_INLINE double predict_time(const double *values, int64_t time, int64_t d, int64_t n_frames) {
    if (time + d >= n_frames) {
        return values[time - d];
    }
    double before = values[time - d], behind = values[time + d];
    bool has_first = time >= 3 * d, has_last = time + 3 * d < n_frames;
    if (has_first && has_last) {
        return (9.0 * (before + behind) - (values[time - 3 * d] + values[time + 3 * d])) / 16.0;
    }
    if (has_first) {
        return (6.0 * before + 3.0 * behind - values[time - 3 * d]) / 8.0;
    }
    if (has_last) {
        return (3.0 * before + 6.0 * behind - values[time + 3 * d]) / 8.0;
    }
    return (before + behind) / 2.0;
}

/* The weights of the adaptive predictions of a level: the state of a Kalman filter whose covariances
   are left out. Variances then cannot become negative, whatever is decoded. */
typedef struct {
    double weights[N_WEIGHTS], variances[N_WEIGHTS];
    double error; /* mean squared, of the latest predictions */
} level_filter;

typedef struct {
    level_filter levels[N_LEVELS];
} time_filter;

static const double first_variances[N_WEIGHTS] = {0.0625, 0.015625, 0.015625};

static void start_filter(time_filter *filter) {
    for (int level = 0; level < N_LEVELS; level++) {
        level_filter *here = &filter->levels[level];
        *here = (level_filter){.error = 1.0};
        for (int i = 0; i < N_WEIGHTS; i++) {
            here->variances[i] = first_variances[i];
        }
    }
}

/* The next mode may move otherwise. */
static void begin_mode(time_filter *filter) {
    for (int level = 0; level < N_LEVELS; level++) {
        for (int i = 0; i < N_WEIGHTS; i++) {
            double *variance = &filter->levels[level].variances[i];
            *variance = (1.0 - RETURNING) * *variance + RETURNING * first_variances[i];
        }
    }
}

/* The terms of an adaptive prediction; the first is the plain prediction. */
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
    double found = terms[0] + change;
    found = found < LARGEST_PREDICTION ? found : LARGEST_PREDICTION;
    return found > -LARGEST_PREDICTION ? found : -LARGEST_PREDICTION;
}

/* Weights follow the error of a prediction, an integer. */
REEL_INLINE void observe(level_filter *filter, const double *terms, double error) {
    double gains[N_WEIGHTS], square = error * error;
    double noise = (1.0 + filter->error) + OWN_NOISE * square;
    for (int i = 0; i < N_WEIGHTS; i++) {
        gains[i] = filter->variances[i] * terms[i];
        noise += gains[i] * terms[i];
    }
    double inverse = 1.0 / noise;
    for (int i = 0; i < N_WEIGHTS; i++) {
        double unknown = 1.0 - (gains[i] * terms[i]) * inverse;
        filter->weights[i] += gains[i] * (error * inverse);
        filter->variances[i] *= unknown > 0.0 ? unknown : 0.0;
    }
    filter->error += FOLLOWED * (square - filter->error);
}

/* The times of a level: `first`, and every `step` after it; `d` is the distance to known ones. */
typedef struct {
    int64_t d, first, step;
} level_times;

static level_times times_of_level(int level) {
    int64_t d = COARSEST >> level;
    return (level_times){d, level ? d : 0, level ? 2 * d : d};
}

/* The values of a column at adaptive times. */
static void decode_adaptive(const int32_t *integers, int64_t n_frames, time_filter *filter,
                            double *values) {
    for (int level = 0; level < N_LEVELS; level++) {
        level_times at = times_of_level(level);
        for (int64_t time = at.first; time < n_frames; time += at.step) {
            double terms[N_WEIGHTS];
            find_terms(values, level, time, at.d, n_frames, terms);
            values[time] = predict_adaptive(&filter->levels[level], terms) + integers[time];
            observe(&filter->levels[level], terms, integers[time]);
        }
    }
}

/* Whether the integers of a mode are all 0: encoders drop such modes, and weights ignore them. */
static bool is_zero(const int32_t *integers, int64_t n) {
    for (int64_t i = 0; i < n; i++) {
        if (integers[i]) {
            return false;
        }
    }
    return true;
}

/* The values of a column over time. */
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

/* The times of a block by whether they rest. */
typedef struct {
    int64_t n_frames, n_moving;
    int32_t *moving;       /* the times that do not rest, ascending */
    const uint8_t *rests;  /* NULL if none does */
    double unit;           /* what an integer of a resting time stands for */
} timeline;

static size_t timeline_room(int64_t n_frames) {
    return reel_array_bytes((size_t)n_frames, sizeof(int32_t));
}

/* Lists the moving times; returns a failure, or 0. The first time cannot rest. */
static int64_t find_timeline(reel_arena *arena, int64_t n_frames, const uint8_t *rests,
                             int64_t rest_bits, timeline *found) {
    *found = (timeline){.n_frames = n_frames, .rests = rests};
    found->moving = reel_allocate(arena, (size_t)n_frames, sizeof *found->moving);
    if (arena->failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    if (rests && (rest_bits < 0 || rest_bits > REEL_MAX_REST_BITS || (n_frames && rests[0]))) {
        return reel_failure(REEL_INVALID, 0);
    }
    found->unit = rests ? 1.0 / (double)((int64_t)1 << rest_bits) : 1.0;
    for (int64_t time = 0; time < n_frames; time++) {
        if (!rests || !rests[time]) {
            found->moving[found->n_moving++] = (int32_t)time;
        }
    }
    return 0;
}

/* Spreads the values of moving times, which are the first ones, over all times. */
static void spread(const timeline *times, double *values) {
    for (int64_t i = times->n_moving - 1; i >= 0; i--) { /* moving[i] >= i: none is lost */
        values[times->moving[i]] = values[i];
    }
}

/* The values of a column at all times; `gathered` has space for n_frames integers. `filter` is that
   of adaptive times, or NULL. */
static void decode_column(const int32_t *integers, const timeline *times, time_filter *filter,
                          int32_t *gathered, double *values) {
    for (int64_t i = 0; i < times->n_moving; i++) {
        gathered[i] = integers[times->moving[i]];
    }
    if (filter) {
        decode_adaptive(gathered, times->n_moving, filter, values);
    } else {
        decode_times(gathered, times->n_moving, values);
    }
    spread(times, values);
    for (int64_t time = 1; times->rests && time < times->n_frames; time++) {
        if (times->rests[time]) {
            values[time] = values[time - 1] + integers[time] * times->unit;
        }
    }
}

size_t reel_basis_memory(int64_t n_columns, int64_t n_frames) {
    return reel_array_bytes((size_t)n_columns * (size_t)n_frames, sizeof(double)) +
           timeline_room(n_frames) + reel_array_bytes((size_t)n_frames, sizeof(int32_t));
}

int64_t reel_lengths(const double *values, int64_t n_verts, int64_t n_modes, int64_t n_reused,
                     double finer, double *lengths) {
    for (int64_t mode = 0; mode < n_reused; mode++) {
        lengths[mode] = 0.0;
    }
    for (int64_t v = 0; v < n_verts; v++) {
        const double *here = values + v * n_modes;
        for (int64_t mode = 0; mode < n_reused; mode++) {
            lengths[mode] += here[mode] * here[mode];
        }
    }
    for (int64_t mode = 0; mode < n_reused; mode++) {
        double size = lengths[mode] > 0.0 ? __builtin_sqrt(lengths[mode]) : 1.0;
        lengths[mode] = size / finer;
    }
    return n_reused;
}

/* Writes a basis vector, values divided by their length or by `size` where that is not NULL. */
static void write_vector(const double *values, int64_t length, const double *size, double *vector,
                         int64_t stride) {
    double sum = 0.0;
    for (int64_t i = 0; i < length; i++) {
        sum += values[i] * values[i];
    }
    double divisor = size ? *size : sum > 0.0 ? __builtin_sqrt(sum) : 1.0;
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
    int32_t *gathered = reel_allocate(&arena, (size_t)n_frames, sizeof *gathered);
    int64_t failed = find_timeline(&arena, n_frames, rests, rest_bits, &times);
    if (failed) {
        return failed;
    }
    for (int64_t mode = 0; mode < n_modes; mode++) {
        const int32_t *coded = integers + mode * length;
        bool adapts = is_adaptive && !is_zero(coded, length);
        if (!mode || mode == n_reused) {
            start_filter(&filter);
        }
        if (adapts) {
            begin_mode(&filter);
        }
        for (int64_t first = 0; first < length; first += n_frames) {
            decode_column(coded + first, &times, adapts ? &filter : NULL, gathered,
                          values + first);
        }
        write_vector(values, length, mode < n_reused ? lengths + mode : NULL, basis + mode,
                     n_modes);
    }
    return n_modes;
}

/* What each coefficient of a discrete cosine transform is worth at the first n_times times: that of
   frequency k at time t is waves[k frequency_stride + t time_stride]. `cosines` has space for 4
   n_frames. */
static void find_waves(int64_t n_frames, int64_t n_times, double *cosines,
                       int64_t frequency_stride, int64_t time_stride, double *waves) {
    int64_t turn = 4 * n_frames;
    double mean = __builtin_sqrt(1.0 / (double)n_frames);
    double scale = __builtin_sqrt(2.0 / (double)n_frames);
    for (int64_t i = 0; i < n_frames; i++) {
        double angle = (double)i * HALF_PI / (double)n_frames, square = angle * angle, found = 1.0;
        for (int j = N_TERMS; j > 0; j--) {
            found = 1.0 - found * square / (double)(2 * j * (2 * j - 1));
        }
        cosines[i] = found;
    }
    cosines[n_frames] = 0.0;
    for (int64_t i = n_frames + 1; i < turn; i++) {
        cosines[i] = i <= 2 * n_frames ? -cosines[2 * n_frames - i] : cosines[turn - i];
    }
    for (int64_t k = 0; k < n_frames; k++) {
        for (int64_t t = 0, place = k; t < n_times; t++) {
            waves[k * frequency_stride + t * time_stride] = k ? scale * cosines[place] : mean;
            place += 2 * k;
            place -= place >= turn ? turn : 0;
        }
    }
}

/* Adds a multiple of a row to another; restrict, so that compilers use vectors. */
REEL_INLINE void add_multiple(int64_t n, double factor, const double *restrict row,
                              double *restrict sums) {
    for (int64_t i = 0; i < n; i++) {
        sums[i] += factor * row[i];
    }
}

/* The same of two rows, one after the other, which halves the steps to memory. */
REEL_INLINE void add_multiples(int64_t n, const double *factors, const double *restrict row,
                               const double *restrict next, double *restrict sums) {
    double factor = factors[0], next_factor = factors[1];
    for (int64_t i = 0; i < n; i++) {
        sums[i] = (sums[i] + factor * row[i]) + next_factor * next[i];
    }
}

/* The first half of the sum of the waves of every other frequency, which repeats itself, or its
   opposite, backwards. Coefficients that are 0 change nothing. */
static void add_waves(const int32_t *coefficients, int64_t n_frames, int64_t first,
                      const double *waves, double *sums) {
    int64_t half = (n_frames + 1) / 2;
    const double *waiting = NULL;
    double factors[2] = {0.0, 0.0};
    reel_zero(sums, (size_t)half * sizeof *sums);
    for (int64_t k = first; k < n_frames; k += 2) {
        const double *row = waves + k * half;
        if (!coefficients[k]) {
            continue;
        }
        factors[waiting != NULL] = coefficients[k];
        if (waiting) {
            add_multiples(half, factors, waiting, row, sums);
        }
        waiting = waiting ? NULL : row;
    }
    if (waiting) {
        add_multiple(half, factors[0], waiting, sums);
    }
}

/* The values of a column over time from its coefficients. `sums` has space for n_frames + 1. */
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

/* Memory of the waves of a block, which none above the limit has. */
static size_t waves_room(int64_t n_frames) {
    size_t n = may_have_cosines(n_frames) ? (size_t)n_frames : 0;
    return reel_array_bytes(4 * n, sizeof(double)) + reel_array_bytes(n * n, sizeof(double));
}

size_t reel_cosine_basis_memory(int64_t n_columns, int64_t n_frames) {
    return reel_array_bytes((size_t)n_columns * (size_t)n_frames, sizeof(double)) +
           reel_array_bytes((size_t)n_frames + 1, sizeof(double)) + waves_room(n_frames);
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

/* Magnitudes below this become 0: the bits that a 1 costs more than a 0 are taken from how often
   the two occur among `count` values, and are worth `price` squared steps each. */
static double dead_zone(const double *scaled, int64_t count, double price) {
    double zone = FIRST_DEAD_ZONE;
    for (int round = 0; round < N_ROUNDS && price > 0.0; round++) {
        double n_zeros = 0.0, n_ones = 0.0;
        for (int64_t i = 0; i < count; i++) {
            double size = reel_magnitude(scaled[i]);
            n_zeros += size < zone ? 1.0 : 0.0;
            n_ones += size >= zone && size < 1.5 ? 1.0 : 0.0;
        }
        zone = reel_dead_zone(n_zeros, n_ones, price);
    }
    return price > 0.0 ? zone : REEL_NEAREST_ZONE;
}

/* The integer near to a value; false if it is too large. */
REEL_INLINE bool quantize(double scaled, double zone, double price, int32_t *integer) {
    if (!(reel_magnitude(scaled) < REEL_TOO_LARGE)) {
        return false;
    }
    *integer = reel_round_rd(scaled, zone, !(price > 0.0));
    return true;
}

/* Times d, 3 d, 5 d, ... of a column. */
static bool encode_level(const double *wanted, int64_t n_frames, int64_t d, double price,
                         double *values, double *scaled, int32_t *integers) {
    int64_t count = 0;
    for (int64_t time = d; time < n_frames; time += 2 * d) {
        scaled[count++] = wanted[time] - predict_time(values, time, d, n_frames);
    }
    double zone = dead_zone(scaled, count, price);
    count = 0;
    for (int64_t time = d; time < n_frames; time += 2 * d) {
        if (!quantize(scaled[count++], zone, price, &integers[time])) {
            return false;
        }
        values[time] = predict_time(values, time, d, n_frames) + integers[time];
    }
    return true;
}

static bool encode_times(const double *wanted, int64_t n_frames, double price, double *values,
                         double *scaled, int32_t *integers) {
    int32_t latest = 0;
    for (int64_t time = 0; time < n_frames; time += COARSEST) {
        int32_t here;
        if (!quantize(wanted[time], REEL_NEAREST_ZONE, 0.0, &here)) {
            return false;
        }
        values[time] = here;
        integers[time] = here - latest;
        latest = here;
    }
    for (int64_t d = COARSEST / 2; d; d /= 2) {
        if (!encode_level(wanted, n_frames, d, price, values, scaled, integers)) {
            return false;
        }
    }
    return true;
}

/* Zeros and ones of a mode at the adaptive times of a level. */
typedef struct {
    double n_zeros, n_ones;
} level_counts;

static bool encode_adaptive(const double *wanted, int64_t n_frames, double price,
                            time_filter *filter, level_counts *counts, double *values,
                            int32_t *integers) {
    for (int level = 0; level < N_LEVELS; level++) {
        level_times at = times_of_level(level);
        for (int64_t time = at.first; time < n_frames; time += at.step) {
            double terms[N_WEIGHTS];
            find_terms(values, level, time, at.d, n_frames, terms);
            double predicted = predict_adaptive(&filter->levels[level], terms);
            double scaled = wanted[time] - predicted, size = reel_magnitude(scaled);
            level_counts *here = &counts[level];
            bool is_plain = !level || !(price > 0.0); /* other levels depend on the first */
            double zone = is_plain ? REEL_NEAREST_ZONE
                                   : reel_dead_zone(here->n_zeros, here->n_ones, price);
            if (!quantize(scaled, zone, is_plain ? 0.0 : price, &integers[time])) {
                return false;
            }
            here->n_zeros += size < zone ? 1.0 : 0.0;
            here->n_ones += size >= zone && size < 1.5 ? 1.0 : 0.0;
            values[time] = predicted + integers[time];
            observe(&filter->levels[level], terms, integers[time]);
        }
    }
    return true;
}

/* What the encoder needs for a column. */
typedef struct {
    double *wanted, *values, *scaled;
    int32_t *integers;
    time_filter *filter; /* of adaptive times, or NULL */
    level_counts counts[N_LEVELS];
} column_work;

/* A time that rests moves as the wanted one does, from what the last moving time became: its error
   stays as it is instead of being corrected, which would be seen as motion. */
static bool encode_rests(const double *wanted, const timeline *times, double price, double *values,
                         int32_t *integers) {
    double zone = price > 0.0 ? FIRST_DEAD_ZONE : REEL_NEAREST_ZONE, error = 0.0;
    for (int64_t time = 1; times->rests && time < times->n_frames; time++) {
        if (!times->rests[time]) {
            continue;
        }
        if (!times->rests[time - 1]) {
            error = values[time - 1] - wanted[time - 1];
        }
        double move = wanted[time] + error - values[time - 1];
        if (!quantize(move / times->unit, zone, price, &integers[time])) {
            return false;
        }
        values[time] = values[time - 1] + integers[time] * times->unit;
    }
    return true;
}

static bool encode_column(const double *wanted, const timeline *times, double price,
                          column_work *work, int32_t *integers) {
    for (int64_t i = 0; i < times->n_moving; i++) {
        work->wanted[i] = wanted[times->moving[i]];
    }
    bool is_done = work->filter
                       ? encode_adaptive(work->wanted, times->n_moving, price, work->filter,
                                         work->counts, work->values, work->integers)
                       : encode_times(work->wanted, times->n_moving, price, work->values,
                                      work->scaled, work->integers);
    if (!is_done) {
        return false;
    }
    for (int64_t i = 0; i < times->n_moving; i++) {
        integers[times->moving[i]] = work->integers[i];
    }
    spread(times, work->values);
    return encode_rests(wanted, times, price, work->values, integers);
}

/* All columns of a mode. Weights stay as they were if its integers are 0. */
static bool encode_mode(const double *wanted, int64_t n_columns, const timeline *times,
                        double price, column_work *work, int32_t *integers) {
    time_filter before;
    reel_zero(work->counts, sizeof work->counts);
    if (work->filter) {
        before = *work->filter;
        begin_mode(work->filter);
    }
    for (int64_t first = 0; first < n_columns * times->n_frames; first += times->n_frames) {
        if (!encode_column(wanted + first, times, price, work, integers + first)) {
            return false;
        }
    }
    if (work->filter && is_zero(integers, n_columns * times->n_frames)) {
        *work->filter = before;
    }
    return true;
}

size_t reel_basis_encode_memory(int64_t n_frames) {
    return 3 * reel_array_bytes((size_t)n_frames, sizeof(double)) +
           reel_array_bytes((size_t)n_frames, sizeof(int32_t)) + timeline_room(n_frames);
}

int64_t reel_basis_encode(void *memory, size_t memory_size, const double *wanted, int64_t n_modes,
                          int64_t n_columns, int64_t n_frames, const uint8_t *rests,
                          int64_t rest_bits, int64_t is_adaptive, double price,
                          int32_t *integers) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    timeline times;
    time_filter filter;
    column_work work = {.filter = is_adaptive ? &filter : NULL};
    work.wanted = reel_allocate(&arena, (size_t)n_frames, sizeof *work.wanted);
    work.values = reel_allocate(&arena, (size_t)n_frames, sizeof *work.values);
    work.scaled = reel_allocate(&arena, (size_t)n_frames, sizeof *work.scaled);
    work.integers = reel_allocate(&arena, (size_t)n_frames, sizeof *work.integers);
    int64_t failed = find_timeline(&arena, n_frames, rests, rest_bits, &times);
    if (failed) {
        return failed;
    }
    start_filter(&filter);
    for (int64_t mode = 0; mode < n_modes; mode++) {
        int64_t first = mode * n_columns * n_frames;
        if (!encode_mode(wanted + first, n_columns, &times, price, &work, integers + first)) {
            return reel_failure(REEL_INVALID, (uint64_t)mode);
        }
    }
    return n_modes;
}

/* Coefficients of a column, rounded: low frequencies, then octave by octave. */
static bool round_coefficients(const double *coefficients, int64_t n, double price,
                               int32_t *integers) {
    for (int64_t first = 0, end = LOWEST; first < n; first = end, end *= 2) {
        end = end < n ? end : n;
        double zone = dead_zone(coefficients + first, end - first, price);
        for (int64_t k = first; k < end; k++) {
            if (!quantize(coefficients[k], zone, price, &integers[k])) {
                return false;
            }
        }
    }
    return true;
}

size_t reel_cosines_encode_memory(int64_t n_frames) {
    return reel_array_bytes((size_t)n_frames, sizeof(double)) + waves_room(n_frames);
}

int64_t reel_cosines_encode(void *memory, size_t memory_size, const double *wanted,
                            int64_t n_modes, int64_t n_columns, int64_t n_frames, double price,
                            int32_t *integers) {
    if (!may_have_cosines(n_frames)) {
        return reel_failure(REEL_INVALID, 0);
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
    double *found = reel_allocate(&arena, (size_t)n_frames, sizeof *found);
    double *cosines = reel_allocate(&arena, 4 * (size_t)n_frames, sizeof *cosines);
    double *waves = reel_allocate(&arena, (size_t)(n_frames * n_frames), sizeof *waves);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    find_waves(n_frames, n_frames, cosines, 1, n_frames, waves);
    for (int64_t row = 0; row < n_columns * n_modes; row++) {
        reel_zero(found, (size_t)n_frames * sizeof *found);
        for (int64_t t = 0; t < n_frames; t++) {
            add_multiple(n_frames, wanted[row * n_frames + t], waves + t * n_frames, found);
        }
        if (!round_coefficients(found, n_frames, price, integers + row * n_frames)) {
            return reel_failure(REEL_INVALID, (uint64_t)row);
        }
    }
    return n_modes;
}
