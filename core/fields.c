/* Entropy coding of fields: rows of small integers over the same columns, most of them 0.

   docs/format.md, "Fields". A row is a mode, a column a vertex or a time. The magnitude of each
   integer is regressed, in integer arithmetic, from earlier rows of its column, from its context
   neighbors and from recently coded values; the weights are learned online. The predicted
   magnitude, in classes, is the context of the bits that code the actual one. The sign is predicted
   from those of the neighbors.

   Columns are renumbered by their position in the coding order. A nonzero value is pushed to the
   positions that it is a neighbor of, so that the many zeros cost nothing. Groups of positions that
   stay 0 row after row are coded as one bit each and skipped. */

#include "bits.h"

#define MAX_NEAR 16             /* context neighbors of a column */
#define MAX_BITS 31             /* bits of a magnitude */
#define ONE 4096                /* a magnitude of 1 in fixed point */
#define LARGEST 4095            /* magnitudes saturate here in predictions */
#define N_CLASSES 48            /* half octaves of the predicted magnitude, starting at 1 / ONE */
#define N_SIZES (8 * N_CLASSES) /* the same range in sixteenths of an octave */
#define N_VOTES 13              /* bit lengths of a vote, 0 included */
#define N_INPUTS 9              /* inputs of the regression */
/* Zeros update the weights only if the predicted share exceeds this: a magnitude of 1/15. */
#define MIN_LEARNED_SHARE 4096
#define GROUP 64       /* consecutive positions of a pass that one bit can code as all 0 */
#define N_ZERO_ROWS 16 /* contexts by the number of latest rows in which a group was 0 */
/* To save time, a row updates `neighbor_mean` only at every STRIDE-th position, except for the
   first STRIDE rows. A power of 2. */
#define STRIDE 4

typedef struct {
    reel_model nonzero[N_CLASSES];          /* is the value nonzero? */
    reel_model longer[MAX_BITS][N_CLASSES]; /* by length so far, less 1: is the magnitude longer? */
    reel_model upper[MAX_BITS][N_CLASSES];  /* by length, less 2: second highest bit */
    reel_model sign_differs[N_VOTES]; /* by bit length of the vote: does the sign differ from it? */
    /* Does a zero group become nonzero? Contexts: was the previous group active, are its neighbors,
       and for how many rows was it 0. */
    reel_model becomes_active[2][2][N_ZERO_ROWS];
    uint16_t share[N_SIZES]; /* m / (1 + m) for each predicted magnitude m, Q16 */
} field_models;

/* Magnitudes of the neighbors of a position in the current row. */
typedef struct {
    int32_t sum, largest;
} near_magnitudes;

#define SIGN_LANES 8 /* neighbors whose agreement is updated per vector */
typedef int16_t vec8s __attribute__((vector_size(2 * SIGN_LANES), may_alias, aligned(2)));

typedef struct {
    int64_t n_positions, n_passes;
    const int64_t *pass_starts;
    const int32_t *columns;
    int64_t *starts, *dependent_starts; /* of each position, in `near` and in `dependents` */
    /* Earlier neighbors of each position, and later positions that it is a neighbor of. */
    int32_t *near, *dependents;
    int16_t *agreement; /* sign correlation with each neighbor; padded by one vector */
    near_magnitudes *near_sums;
    int16_t *inverse_counts; /* ONE / number of neighbors, 0 if there are none */
    int16_t *magnitudes;     /* magnitudes of the row, saturated at LARGEST */
    int8_t *signs;           /* signs of the row: -1, 0 or 1 */
    int32_t *sums[3];        /* decaying means of magnitudes of earlier rows: fast, middle, slow */
    int16_t *slow, *fast, *middle;   /* logarithms of the means; fast and middle relative to slow */
    int16_t *neighbor_mean;          /* mean of `slow` over the neighbors */
    int32_t *pass_means, *pass_bias; /* per pass: decaying mean magnitude, bias weight */
    /* Per group: number of latest rows in which it was 0, at most N_ZERO_ROWS - 1. */
    uint8_t *zero_rows;
    field_models *models;
    int32_t weights[N_INPUTS]; /* of the regression, Q16 */
} field_coder;

/* Decaying sums of the magnitudes coded recently in this row, and of their means. */
typedef struct {
    int32_t row, row_mean, local, local_mean, pass;
} recent_magnitudes;

static const int16_t inverses_of_counts[MAX_NEAR + 1] = {
    0, 4096, 2048, 1365, 1024, 819, 682, 585, 512, 455, 409, 372, 341, 315, 292, 273, 256};

/* Initial weights, Q16: learned on simulated cloth and on tubes, then rounded. */
static const int32_t initial_weights[N_INPUTS] = {0,    0,     16384, 16384, 8192,
                                                  8192, 24576, 8192,  -16384};

/* Return 16 log2 of a value of 1..2^24, piecewise linear. Such integers are exact floats, whose
   highest bits are the logarithm. */
REEL_INLINE int32_t log2_x16(int32_t value) {
    float exact = (float)value;
    int32_t bits;
    __builtin_memcpy(&bits, &exact, sizeof bits);
    return (bits >> 19) - 16 * 127;
}

static void start_tables(field_models *models) {
    for (uint32_t log = 0; log < N_SIZES; log++) {
        uint32_t size = (16 + log % 16) << (log / 16) >> 4;
        models->share[log] = (uint16_t)(((uint64_t)size << 16) / (size + ONE));
    }
    for (int i = 0; i < N_CLASSES; i++) {
        uint32_t power = models->share[8 * i + 4];
        models->nonzero[i] = reel_model_of(power, 32);
        for (int length = 0; length < MAX_BITS; length++) {
            uint32_t guess = power < 4096 ? 4096 : power; /* distributions have heavy tails */
            models->longer[length][i] = reel_model_of(guess, 32);
            models->upper[length][i] = reel_model_of((guess << 16) / (65536 + guess), 32);
            power = power * power >> 16;
        }
    }
    for (int i = 0; i < N_VOTES; i++) {
        models->sign_differs[i] = reel_model_of(32768, 8);
    }
    for (int i = 0; i < 4 * N_ZERO_ROWS; i++) {
        models->becomes_active[i / N_ZERO_ROWS / 2][i / N_ZERO_ROWS % 2][i % N_ZERO_ROWS] =
            reel_model_of(16384, 8);
    }
}

/* Code a magnitude of 1..2^31-1. */
REEL_INLINE uint32_t code_magnitude(reel_range_coder *coder, field_models *models, int class,
                                    uint32_t size) {
    int length = 1, target_length = reel_bit_length(size);
    while (length < MAX_BITS &&
           reel_bit(coder, &models->longer[length - 1][class], target_length > length)) {
        length++;
    }
    if (length == 1) {
        return 1;
    }
    int low = length - 2; /* bits below the second highest */
    uint32_t result = 2U | (uint32_t)reel_bit(coder, &models->upper[low][class], size >> low & 1U);
    while (low > 0) {
        int n_bits = low < 16 ? low : 16;
        low -= n_bits;
        result = result << n_bits | reel_code_raw(coder, n_bits, size >> low);
    }
    return result;
}

/* Code the sign of a value; returns whether it is negative. Neighbors vote with their signs,
   weighted by how often each agreed with this position in earlier rows. */
REEL_INLINE int code_sign(reel_range_coder *coder, field_coder *f, int64_t position, int negative) {
    int16_t signs[MAX_NEAR] = {0};
    const int32_t *near = f->near + f->starts[position];
    int16_t *agreement = f->agreement + f->starts[position];
    int64_t n = f->starts[position + 1] - f->starts[position];
    int32_t vote = 0;
    for (int64_t i = 0; i < n; i++) {
        int32_t sign = f->signs[near[i]];
        signs[i] = (int16_t)sign;
        vote += agreement[i] * sign;
    }
    int expected = vote < 0;
    reel_model *model =
        &f->models->sign_differs[reel_bit_length((uint32_t)(vote < 0 ? -vote : vote))];
    negative = reel_bit(coder, model, negative ^ expected) ^ expected;
    int16_t step = negative ? -16 : 16;
    for (int64_t i = 0; i < n; i += SIGN_LANES) { /* unchanged where a sign is 0 */
        vec8s *agreements = (vec8s *)(agreement + i), sign = *(vec8s *)(signs + i);
        *agreements += step * sign - ((*agreements >> 3) & -(sign & 1));
    }
    return negative;
}

/* Code a nonzero value, magnitude then sign, and push its magnitude to its dependents. */
REEL_INLINE int32_t code_nonzero(reel_range_coder *coder, field_coder *f, int64_t position,
                                 int class, int32_t value) {
    uint32_t size = value < 0 ? 0U - (uint32_t)value : (uint32_t)value;
    size = code_magnitude(coder, f->models, class, size);
    int32_t magnitude = (int32_t)(size < LARGEST ? size : LARGEST);
    int negative = code_sign(coder, f, position, value < 0);
    f->magnitudes[position] = (int16_t)magnitude;
    f->signs[position] = negative ? -1 : 1;
    const int32_t *dependents = f->dependents + f->dependent_starts[position];
    const int32_t *end = f->dependents + f->dependent_starts[position + 1];
    for (; dependents < end; dependents++) {
        near_magnitudes *sums = &f->near_sums[*dependents];
        sums->sum += magnitude;
        sums->largest = sums->largest > magnitude ? sums->largest : magnitude;
    }
    return negative ? -(int32_t)size : (int32_t)size;
}

/* Inputs of the regression, logarithms in sixteenths of an octave; x_0 to x_8 in docs/format.md. */
REEL_INLINE void find_inputs(const field_coder *f, int64_t position,
                             const recent_magnitudes *recent, int32_t inputs[N_INPUTS]) {
    const near_magnitudes *near_sums = &f->near_sums[position];
    int32_t slow = f->slow[position], neighbor_mean = f->neighbor_mean[position],
            inverse_count = f->inverse_counts[position];
    int32_t row = log2_x16(recent->row) - log2_x16(recent->row_mean);
    int32_t mean = log2_x16(near_sums->sum * inverse_count + 100);
    inputs[0] = 32;
    inputs[1] = f->fast[position];
    inputs[2] = inverse_count ? mean - neighbor_mean : 0;
    inputs[3] = row;
    inputs[4] = inverse_count ? neighbor_mean - slow : 0;
    inputs[5] = log2_x16(recent->pass + 16) - slow;
    inputs[6] = f->middle[position];
    inputs[7] = log2_x16(recent->local + 32) - log2_x16(recent->local_mean + 32) - row;
    inputs[8] = log2_x16(near_sums->largest * ONE + 100) - mean;
}

/* Return the logarithm of the predicted magnitude, 0..N_SIZES-1. */
REEL_INLINE int predict_magnitude(const int32_t *weights, int32_t bias, const int32_t *inputs,
                                  int32_t slow) {
    int64_t sum = (int64_t)bias * inputs[0];
    for (int i = 1; i < N_INPUTS; i++) {
        sum += (int64_t)weights[i] * inputs[i];
    }
    sum = slow + (sum >> 16);
    return (int)(sum < 0 ? 0 : sum < N_SIZES ? sum : N_SIZES - 1);
}

/* Gradient step of the weights towards the coded magnitude: for a geometric distribution of mean m,
   the derivative of its log-likelihood is (magnitude - m) / (1 + m). */
REEL_INLINE void update_weights(int32_t *weights, int32_t *bias, const int32_t *inputs,
                                int32_t share, int32_t magnitude) {
    int32_t gain = magnitude * (65536 - share);
    int32_t error = (gain < 8 * 65536 ? gain : 8 * 65536) - share;
    *bias = (int32_t)((uint32_t)*bias + (uint32_t)((error * inputs[0] + 2048) >> 12));
    for (int i = 1; i < N_INPUTS; i++) {
        int32_t step = (error * inputs[i] + 2048) >> 12;
        weights[i] = (int32_t)((uint32_t)weights[i] + (uint32_t)step);
    }
}

REEL_INLINE void update_recent(recent_magnitudes *recent, int32_t magnitude, int32_t mean) {
    recent->local += magnitude * 256 - (recent->local >> 2);
    recent->local_mean += (mean >> 4) - (recent->local_mean >> 2);
    recent->row += magnitude * 16;
    recent->row_mean += mean >> 8;
    if ((recent->row | recent->row_mean) >> 23) {
        recent->row = recent->row >> 1 | 1;
        recent->row_mean = recent->row_mean >> 1 | 1;
    }
    recent->pass += (magnitude * ONE - recent->pass) >> 4;
}

/* Code positions first..last-1 of a pass; returns whether all are 0. */
REEL_INLINE bool code_positions(reel_range_coder *coder, field_coder *f, int32_t *row,
                                int64_t first, int64_t last, recent_magnitudes *recent,
                                int32_t *bias) {
    int32_t inputs[N_INPUTS], any_nonzero = 0;
    for (int64_t position = first; position < last; position++) {
        find_inputs(f, position, recent, inputs);
        int size = predict_magnitude(f->weights, *bias, inputs, f->slow[position]);
        int32_t share = f->models->share[size], magnitude = 0;
        int32_t *value = &row[f->columns[position]];
        if (reel_bit(coder, &f->models->nonzero[size >> 3], *value != 0)) {
            *value = code_nonzero(coder, f, position, size >> 3, *value);
            magnitude = f->magnitudes[position];
            update_weights(f->weights, bias, inputs, share, magnitude);
        } else {
            *value = f->magnitudes[position] = f->signs[position] = 0;
            if (share > MIN_LEARNED_SHARE) {
                update_weights(f->weights, bias, inputs, share, 0);
            }
        }
        update_recent(recent, magnitude, f->sums[2][position]);
        any_nonzero |= magnitude;
    }
    return !any_nonzero;
}

/* Update the decaying means with a row; `restrict` lets compilers vectorize it. */
REEL_INLINE void add_row(int64_t n, const int16_t *restrict magnitudes, int32_t *restrict fast_sums,
                         int32_t *restrict middle_sums, int32_t *restrict slow_sums,
                         int16_t *restrict fast, int16_t *restrict middle,
                         int16_t *restrict slow) {
    for (int64_t i = 0; i < n; i++) {
        int32_t magnitude = magnitudes[i] * ONE;
        fast_sums[i] += (magnitude - fast_sums[i]) >> 1;
        middle_sums[i] += (magnitude - middle_sums[i]) >> 2;
        slow_sums[i] += (magnitude - slow_sums[i]) >> 3;
        int32_t log = log2_x16(slow_sums[i] + 16);
        slow[i] = (int16_t)log;
        fast[i] = (int16_t)(log2_x16(fast_sums[i] + 16) - log);
        middle[i] = (int16_t)(log2_x16(middle_sums[i] + 16) - log);
    }
}

/* Clear the neighbor magnitudes of positions first..last-1 for the next row. */
REEL_INLINE void clear_near_sums(field_coder *f, int64_t first, int64_t last) {
    reel_zero(f->near_sums + first, (size_t)(last - first) * sizeof *f->near_sums);
}

/* Update the statistics of coded positions for the next row. Their neighbors are at earlier
   positions, already up to date. */
REEL_INLINE void end_positions(field_coder *f, int64_t row, int64_t first, int64_t last) {
    add_row(last - first, f->magnitudes + first, f->sums[0] + first, f->sums[1] + first,
            f->sums[2] + first, f->fast + first, f->middle + first, f->slow + first);
    clear_near_sums(f, first, last);
    int64_t stride = row < STRIDE ? 1 : STRIDE;
    for (int64_t i = first + ((row - first) & (stride - 1)); i < last; i += stride) {
        int32_t sum = 0;
        for (int64_t j = f->starts[i]; j < f->starts[i + 1]; j++) {
            sum += f->slow[f->near[j]];
        }
        f->neighbor_mean[i] = (int16_t)(sum * f->inverse_counts[i] >> 12);
    }
}

/* Code whether a zero group stays 0, as one bit; if so, its statistics do not change. */
REEL_INLINE bool code_stays_zero(reel_range_coder *coder, field_coder *f, const int32_t *row,
                                 int64_t first, int zero_rows, bool was_active) {
    int nonzero = 0, near_sum = 0;
    for (int64_t i = first; i < first + GROUP; i++) {
        near_sum |= f->near_sums[i].sum;
    }
    for (int64_t i = first; reel_is_encoder(coder) && i < first + GROUP; i++) {
        nonzero |= row[f->columns[i]];
    }
    reel_model *model = &f->models->becomes_active[was_active][near_sum != 0][zero_rows];
    return !reel_bit(coder, model, nonzero != 0);
}

/* Code a row. The decoder's `row` must be 0 before, since groups of zeros are skipped. */
REEL_INLINE void code_row(reel_range_coder *coder, field_coder *f, int64_t number, int32_t *row) {
    recent_magnitudes recent = {.row = 256, .row_mean = 256};
    for (int64_t pass = 0; pass < f->n_passes; pass++) {
        int32_t bias = f->pass_bias[pass];
        int64_t first = f->pass_starts[pass], end = f->pass_starts[pass + 1];
        bool was_active = true; /* whether the previous group was active */
        recent.pass = f->pass_means[pass];
        for (; end - first >= GROUP; first += GROUP) {
            uint8_t *zero_rows = &f->zero_rows[first / GROUP];
            bool is_zero =
                *zero_rows && code_stays_zero(coder, f, row, first, *zero_rows, was_active);
            if (is_zero) {
                clear_near_sums(f, first, first + GROUP);
                recent.local = recent.local_mean = 0;
                recent.pass >>= 4;
            } else {
                is_zero = code_positions(coder, f, row, first, first + GROUP, &recent, &bias);
                end_positions(f, number, first, first + GROUP);
            }
            *zero_rows = (uint8_t)(!is_zero                       ? 0
                                   : *zero_rows < N_ZERO_ROWS - 1 ? *zero_rows + 1
                                                                  : *zero_rows);
            was_active = !is_zero;
        }
        code_positions(coder, f, row, first, end, &recent, &bias);
        end_positions(f, number, first, end);
        f->pass_means[pass] = recent.pass;
        f->pass_bias[pass] = bias;
    }
}

/* Convert neighbors to positions; returns false if a column repeats or a neighbor is later. */
static bool convert_neighbors(field_coder *f, const int64_t *starts, const int32_t *near,
                              int32_t *position_of) {
    for (int64_t i = 0; i < f->n_positions; i++) {
        position_of[i] = -1;
    }
    for (int64_t i = 0; i < f->n_positions; i++) {
        int64_t column = f->columns[i], n = starts[i + 1] - starts[i];
        if (column < 0 || column >= f->n_positions || position_of[column] >= 0 || n < 0 ||
            n > MAX_NEAR || starts[i + 1] > starts[f->n_positions]) {
            return false;
        }
        for (int64_t j = starts[i]; j < starts[i + 1]; j++) {
            if (near[j] < 0 || near[j] >= f->n_positions || position_of[near[j]] < 0) {
                return false;
            }
            f->near[j] = position_of[near[j]];
            f->agreement[j] = 16;
        }
        position_of[column] = (int32_t)i;
        f->inverse_counts[i] = inverses_of_counts[n];
    }
    reel_copy(f->starts, starts, ((size_t)f->n_positions + 1) * sizeof *starts);
    return true;
}

/* List the dependents of each position, ascending. */
static void list_dependents(field_coder *f) {
    int64_t n = f->n_positions;
    reel_zero(f->dependent_starts, ((size_t)n + 1) * sizeof *f->dependent_starts);
    for (int64_t i = 0; i < f->starts[n]; i++) {
        f->dependent_starts[f->near[i]]++;
    }
    for (int64_t i = 0; i < n; i++) { /* where each list ends */
        f->dependent_starts[i + 1] += f->dependent_starts[i];
    }
    for (int64_t i = n - 1; i >= 0; i--) {
        for (int64_t j = f->starts[i]; j < f->starts[i + 1]; j++) {
            f->dependents[--f->dependent_starts[f->near[j]]] = (int32_t)i;
        }
    }
}

static void start_fields(field_coder *f) {
    start_tables(f->models);
    reel_copy(f->weights, initial_weights, sizeof initial_weights);
    for (int64_t i = 0; i < f->n_positions; i++) {
        f->sums[0][i] = f->sums[1][i] = f->sums[2][i] = ONE;
        f->slow[i] = f->neighbor_mean[i] = 16 * 12; /* log of ONE */
        f->fast[i] = f->middle[i] = f->magnitudes[i] = f->signs[i] = 0;
    }
    clear_near_sums(f, 0, f->n_positions);
    reel_zero(f->zero_rows, (size_t)f->n_positions / GROUP + 1);
    for (int64_t i = 0; i < f->n_passes; i++) {
        f->pass_means[i] = 8 * ONE;
        f->pass_bias[i] = 0;
    }
}

static void allocate_fields(reel_arena *arena, field_coder *f, size_t n_near) {
    size_t n = (size_t)f->n_positions, n_passes = (size_t)f->n_passes;
    f->starts = reel_allocate(arena, n + 1, sizeof *f->starts);
    f->dependent_starts = reel_allocate(arena, n + 1, sizeof *f->dependent_starts);
    f->near = reel_allocate(arena, n_near, sizeof *f->near);
    f->dependents = reel_allocate(arena, n_near, sizeof *f->dependents);
    f->agreement = reel_allocate(arena, n_near + SIGN_LANES, sizeof *f->agreement);
    f->near_sums = reel_allocate(arena, n, sizeof *f->near_sums);
    f->inverse_counts = reel_allocate(arena, n, sizeof *f->inverse_counts);
    f->magnitudes = reel_allocate(arena, n, sizeof *f->magnitudes);
    f->signs = reel_allocate(arena, n, sizeof *f->signs);
    f->slow = reel_allocate(arena, n, sizeof *f->slow);
    f->fast = reel_allocate(arena, n, sizeof *f->fast);
    f->middle = reel_allocate(arena, n, sizeof *f->middle);
    f->neighbor_mean = reel_allocate(arena, n, sizeof *f->neighbor_mean);
    for (int i = 0; i < 3; i++) {
        f->sums[i] = reel_allocate(arena, n, sizeof *f->sums[i]);
    }
    f->pass_means = reel_allocate(arena, n_passes, sizeof *f->pass_means);
    f->pass_bias = reel_allocate(arena, n_passes, sizeof *f->pass_bias);
    f->zero_rows = reel_allocate(arena, n / GROUP + 1, sizeof *f->zero_rows);
    f->models = reel_allocate(arena, 1, sizeof *f->models);
}

size_t reel_fields_memory(int64_t n_columns, int64_t n_passes, int64_t n_near) {
    field_coder f = {.n_positions = n_columns, .n_passes = n_passes};
    reel_arena arena = REEL_MEASURE;
    allocate_fields(&arena, &f, (size_t)n_near);
    return arena.used;
}

/* Set up the coder with the order and neighbors of the caller. */
static enum reel_code prepare(field_coder *f, void *memory, size_t memory_size,
                              const int64_t *near_starts, const int32_t *near) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    int64_t previous_start = 0;
    for (int64_t i = 0; i <= f->n_passes; i++) {
        if (f->pass_starts[i] < previous_start || f->pass_starts[i] > f->n_positions) {
            return REEL_INVALID;
        }
        previous_start = f->pass_starts[i];
    }
    if (f->pass_starts[0] != 0 || previous_start != f->n_positions || near_starts[0] != 0 ||
        near_starts[f->n_positions] < 0) {
        return REEL_INVALID;
    }
    allocate_fields(&arena, f, (size_t)near_starts[f->n_positions]);
    if (arena.failed) {
        return REEL_NO_MEMORY;
    }
    if (!convert_neighbors(f, near_starts, near, f->sums[0])) {
        return REEL_INVALID;
    }
    list_dependents(f);
    start_fields(f);
    return REEL_OK;
}

REEL_INLINE void code_rows(reel_range_coder *coder, field_coder *f, int32_t *values,
                           int64_t n_rows) {
    for (int64_t row = 0; row < n_rows; row++) {
        code_row(coder, f, row, values + row * f->n_positions);
    }
}

int64_t reel_fields_encode(void *memory, size_t memory_size, int32_t *values, int64_t n_rows,
                           int64_t n_columns, const int32_t *columns, const int64_t *pass_starts,
                           int64_t n_passes, const int64_t *near_starts, const int32_t *near,
                           uint8_t *out, size_t capacity) {
    field_coder f = {.n_positions = n_columns, .n_passes = n_passes};
    f.pass_starts = pass_starts;
    f.columns = columns;
    enum reel_code code = prepare(&f, memory, memory_size, near_starts, near);
    if (code) {
        return reel_failure(code, 0);
    }
    for (int64_t i = 0; i < n_rows * n_columns; i++) {
        if (values[i] == INT32_MIN) {
            return reel_failure(REEL_INVALID, (uint64_t)i);
        }
    }
    reel_range_coder coder = reel_start_encoder(out, capacity);
    code_rows(&coder, &f, values, n_rows);
    return reel_finish(&coder);
}

int64_t reel_fields_decode(void *memory, size_t memory_size, const uint8_t *in, size_t size,
                           int64_t n_rows, int64_t n_read, int64_t n_columns,
                           const int32_t *columns, const int64_t *pass_starts, int64_t n_passes,
                           const int64_t *near_starts, const int32_t *near, int32_t *values) {
    field_coder f = {.n_positions = n_columns, .n_passes = n_passes};
    f.pass_starts = pass_starts;
    f.columns = columns;
    enum reel_code code = prepare(&f, memory, memory_size, near_starts, near);
    if (code) {
        return reel_failure(code, 0);
    }
    reel_range_coder coder = reel_start_decoder(in, size);
    reel_zero(values, (size_t)(n_read * n_columns) * sizeof *values);
    code_rows(&coder, &f, values, n_read);
    return n_read < n_rows ? (int64_t)size : reel_finish(&coder);
}
