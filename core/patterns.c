/* Lossless tables of numbers: each row is predicted from earlier rows, and the differences are
   coded as adaptive bits.

   docs/format.md, "Patterns". Floats are mapped to integers in the order of their values. A row is
   predicted by the mean of parallelograms a + b - c of earlier rows, or by one earlier row; or it
   repeats one of the most recent distinct rows. */

#include "integers.h"

#define MAX_BITS 64       /* bits of a number */
#define N_MEAN_CLASSES 48 /* classes of the decaying mean of differences */
#define N_PREDICTORS 3    /* predictors of a row: none, a row, parallelograms */
#define RECENT_BITS 6
#define N_RECENT (1 << RECENT_BITS) /* distinct recent rows that may be repeated */

typedef struct {
    reel_model longer[MAX_BITS];
    reel_model second[MAX_BITS];
    reel_model third[MAX_BITS][2];
} pattern_model;

typedef struct {
    uint64_t scaled_mean; /* four times the decaying mean of the differences */
    int sign;             /* sign of the last difference: none, +, - */
} column_state;

typedef struct {
    pattern_model shared; /* for all contexts; see reel_bit_in_context */
    pattern_model contexts[N_PREDICTORS][N_MEAN_CLASSES];
    reel_model low[MAX_BITS];  /* by bit position: bits below the third */
    reel_model negative[3][3]; /* by the previous signs in the column and in the row */
    reel_model is_repeated[4]; /* by whether each of the last two rows repeated a recent one */
    reel_model repeated_index[N_RECENT]; /* bits of the index of a repeated row, by higher bits */
    int64_t recent_rows[N_RECENT];
    uint32_t hashes[N_RECENT]; /* hashes of the recent rows; the encoder compares them first */
    int n_recent;
    unsigned repeat_history;
} pattern_models;

typedef struct {
    uint8_t *values; /* rows of `width` numbers of `size` bytes */
    int64_t width;
    int size; /* 1, 4 or 8 */
    bool is_float;
} number_table;

size_t reel_patterns_memory(int64_t width) {
    return reel_array_bytes(1, sizeof(pattern_models)) +
           reel_array_bytes((size_t)width, sizeof(column_state));
}

static void start_patterns(pattern_models *models) {
    reel_zero(models, sizeof *models);
    reel_model *shared = (reel_model *)&models->shared;
    for (size_t i = 0; i < sizeof models->shared / sizeof *shared; i++) {
        shared[i] = reel_model_of(32768, 0);
    }
    for (int i = 0; i < MAX_BITS; i++) {
        models->low[i] = reel_model_of(32768, 0);
    }
    for (int i = 0; i < 9; i++) {
        models->negative[i / 3][i % 3] = reel_model_of(32768, 0);
    }
    for (int i = 0; i < N_RECENT; i++) {
        models->repeated_index[i] = models->is_repeated[i & 3] = reel_model_of(32768, 0);
    }
}

/* Bits of the number at an index. */
static uint64_t bits_at(const number_table *table, int64_t index) {
    uint64_t result = 0;
    reel_copy(&result, table->values + index * table->size, (size_t)table->size);
    return result;
}

static void set_bits(const number_table *table, int64_t index, uint64_t bits) {
    reel_copy(table->values + index * table->size, &bits, (size_t)table->size);
}

static uint64_t all_bits(const number_table *table) { return UINT64_MAX >> (64 - 8 * table->size); }

/* Map the bits of a float to an integer in the order of values, and back. */
static uint64_t to_ordered(const number_table *table, uint64_t bits) {
    uint64_t sign = (uint64_t)1 << (8 * table->size - 1);
    return !table->is_float ? bits : bits & sign ? ~bits & all_bits(table) : bits | sign;
}

static uint64_t from_ordered(const number_table *table, uint64_t number) {
    uint64_t sign = (uint64_t)1 << (8 * table->size - 1);
    return !table->is_float ? number : number & sign ? number ^ sign : ~number & all_bits(table);
}

static int64_t integer_of(const number_table *table, uint64_t bits) {
    return table->size == 1 ? (int64_t)bits : (int64_t)(int32_t)(uint32_t)bits;
}

static double float_of(const number_table *table, uint64_t bits) {
    if (table->size == 8) {
        double result;
        reel_copy(&result, &bits, sizeof result);
        return result;
    }
    uint32_t word = (uint32_t)bits;
    float result;
    reel_copy(&result, &word, sizeof result);
    return (double)result;
}

/* Bits of a value as a float of the table's type, or `fallback` if out of range. */
static uint64_t bits_of_float(const number_table *table, double value, uint64_t fallback) {
    double largest = table->size == 8 ? 0x1.fffffffffffffp+1023 : 0x1.fffffep+127;
    if (!(value >= -largest && value <= largest)) { /* false for NaN, too */
        return fallback;
    }
    uint64_t bits = 0;
    if (table->size == 8) {
        reel_copy(&bits, &value, sizeof value);
    } else {
        float narrow = (float)value;
        reel_copy(&bits, &narrow, sizeof narrow);
    }
    return bits;
}

/* Predict the bits of a number in a column, from `count` triples of rows. */
static uint64_t predict_bits(const number_table *table, int64_t col, const int32_t *triples,
                             int64_t count) {
    if (count == 0) {
        return 0;
    }
    uint64_t first = bits_at(table, triples[0] * table->width + col);
    if (triples[2] < 0) {
        return first;
    }
    int64_t sum = 0;
    double float_sum = 0;
    for (int64_t i = 0; i < count; i++) {
        uint64_t a = bits_at(table, triples[3 * i] * table->width + col);
        uint64_t b = bits_at(table, triples[3 * i + 1] * table->width + col);
        uint64_t c = bits_at(table, triples[3 * i + 2] * table->width + col);
        if (table->is_float) {
            float_sum += float_of(table, a) + float_of(table, b) - float_of(table, c);
        } else {
            sum += integer_of(table, a) + integer_of(table, b) - integer_of(table, c);
        }
    }
    if (table->is_float) {
        return bits_of_float(table, float_sum / (double)count, first);
    }
    int64_t twice = 2 * sum + count, mean = twice / (2 * count);
    mean -= mean * 2 * count > twice; /* round down */
    int64_t min = table->size == 1 ? 0 : INT32_MIN, max = table->size == 1 ? 255 : INT32_MAX;
    mean = mean < min ? min : mean > max ? max : mean;
    return (uint64_t)mean & all_bits(table);
}

/* Predict the bits of a number in a column from the rows of a stencil. */
static uint64_t predict_by_weights(const number_table *table, int64_t col, const int32_t *stencil,
                                   const float *weights) {
    uint64_t first = bits_at(table, stencil[0] * table->width + col);
    double least = table->size == 1 ? 0 : INT32_MIN, most = table->size == 1 ? 255 : INT32_MAX;
    double origin = 0, sum = 0;
    for (int i = 0; i < REEL_MAX_STENCIL && stencil[i] >= 0; i++) {
        uint64_t bits = bits_at(table, stencil[i] * table->width + col);
        double value = table->is_float ? float_of(table, bits) : (double)integer_of(table, bits);
        origin = i ? origin : value;
        sum += (double)weights[i] * (value - origin);
    }
    sum += origin;
    if (table->is_float) {
        return bits_of_float(table, sum, first);
    }
    sum = sum < least ? least : sum > most ? most : sum;
    return (uint64_t)(int64_t)(sum + (sum < 0 ? -0.5 : 0.5)) & all_bits(table);
}

/* Class of the decaying mean; each octave has two classes. */
static int mean_class(uint64_t scaled_mean) {
    int octave = 61 - __builtin_clzll(scaled_mean + 4);
    int result = 2 * octave + (int)((scaled_mean + 4) >> (octave + 1) & 1U);
    return result < N_MEAN_CLASSES ? result : N_MEAN_CLASSES - 1;
}

static int bit_length(uint64_t value) { return value ? 64 - __builtin_clzll(value) : 0; }

static uint64_t code_magnitude(reel_range_coder *coder, pattern_models *models,
                               pattern_model *context, int max_bits, uint64_t value) {
    pattern_model *shared = &models->shared;
    int length = 0, target_length = bit_length(value);
    while (length < max_bits &&
           reel_bit_in_context(coder, &shared->longer[length], &context->longer[length],
                               target_length > length)) {
        length++;
    }
    if (length < 2) {
        return (uint64_t)length;
    }
    int low = length - 2;
    uint64_t result =
        2U | (uint64_t)reel_bit_in_context(coder, &shared->second[length - 1],
                                           &context->second[length - 1], (int)(value >> low & 1U));
    if (low > 0) {
        reel_model *third = &shared->third[length - 1][result & 1U];
        low--;
        result = result << 1 | (uint64_t)reel_bit(coder, third, (int)(value >> low & 1U));
    }
    while (low > 0) {
        low--;
        result =
            result << 1 | (uint64_t)reel_bit(coder, &models->low[low], (int)(value >> low & 1U));
    }
    return result;
}

/* Code a difference in a column. `previous_sign`, of the column before, becomes its sign. */
static uint64_t code_number(reel_range_coder *coder, pattern_models *models, int predictor,
                            column_state *column, int *previous_sign, int n_bits,
                            uint64_t difference) {
    uint64_t mask = UINT64_MAX >> (64 - n_bits), half = (uint64_t)1 << (n_bits - 1);
    bool negative = difference > half;
    uint64_t magnitude = negative ? mask - difference + 1 : difference;
    pattern_model *contexts = &models->contexts[predictor][mean_class(column->scaled_mean)];
    magnitude = code_magnitude(coder, models, contexts, n_bits, magnitude);
    int sign = 0;
    if (magnitude) {
        sign = 1 + reel_bit(coder, &models->negative[column->sign][*previous_sign], negative);
    }
    uint64_t bounded = magnitude >> 48 ? (uint64_t)1 << 48 : magnitude;
    column->scaled_mean = column->scaled_mean / 2 + 2 * bounded;
    column->sign = *previous_sign = sign;
    return sign == 2 ? (mask - magnitude + 1) & mask : magnitude & mask;
}

static uint32_t hash_of(const number_table *table, int64_t row) {
    size_t size = (size_t)(table->width * table->size);
    uint32_t hash = 0;
    for (size_t i = 0; i < size; i++) {
        hash = (hash ^ table->values[(size_t)row * size + i]) * 0x01000193U;
    }
    return hash;
}

/* Index of a row among the recent rows, or their number if it is not among them. */
static int recent_index(const pattern_models *models, const number_table *table, int64_t row,
                        uint32_t hash) {
    size_t size = (size_t)(table->width * table->size);
    for (int i = 0; i < models->n_recent; i++) {
        if (models->hashes[i] == hash &&
            reel_equal_bytes(table->values + (size_t)models->recent_rows[i] * size,
                             table->values + (size_t)row * size, size)) {
            return i;
        }
    }
    return models->n_recent;
}

static void move_to_front(pattern_models *models, int index, int64_t row, uint32_t hash) {
    for (; index > 0; index--) {
        models->recent_rows[index] = models->recent_rows[index - 1];
        models->hashes[index] = models->hashes[index - 1];
    }
    models->recent_rows[0] = row;
    models->hashes[0] = hash;
}

/* Code whether a row repeats a recent one; if so, restore it. The row becomes the most recent. */
static bool code_repetition(reel_range_coder *coder, pattern_models *models,
                            const number_table *table, int64_t row) {
    int n = models->n_recent, index = 0;
    uint32_t hash = reel_is_encoder(coder) ? hash_of(table, row) : 0;
    if (reel_is_encoder(coder)) {
        index = recent_index(models, table, row, hash);
    }
    bool is_repeated =
        n && reel_bit(coder, &models->is_repeated[models->repeat_history & 3U], index < n);
    models->repeat_history = models->repeat_history << 1 | is_repeated;
    if (!is_repeated) {
        models->n_recent += n < N_RECENT;
        move_to_front(models, n < N_RECENT ? n : N_RECENT - 1, row, hash);
        return false;
    }
    int node = 1;
    for (int i = RECENT_BITS - 1; i >= 0; i--) {
        node = node << 1 | reel_bit(coder, &models->repeated_index[node], index >> i & 1);
    }
    index = node - N_RECENT < n ? node - N_RECENT : n - 1; /* only damaged streams exceed it */
    if (!reel_is_encoder(coder)) {
        size_t size = (size_t)(table->width * table->size);
        reel_copy(table->values + (size_t)row * size,
                  table->values + (size_t)models->recent_rows[index] * size, size);
    }
    move_to_front(models, index, row, hash);
    return true;
}

static void code_row(reel_range_coder *coder, pattern_models *models, column_state *columns,
                     const number_table *table, int64_t row, const int32_t *triples, int64_t count,
                     const int32_t *stencil, const float *weights) {
    bool is_weighted = stencil && stencil[0] >= 0;
    int previous_sign = 0, predictor = is_weighted ? 2 : count == 0 ? 0 : triples[2] < 0 ? 1 : 2;
    for (int64_t i = 0; i < table->width; i++) {
        int64_t index = row * table->width + i;
        uint64_t predicted =
            to_ordered(table, is_weighted ? predict_by_weights(table, i, stencil, weights)
                                          : predict_bits(table, i, triples, count));
        uint64_t difference =
            (to_ordered(table, bits_at(table, index)) - predicted) & all_bits(table);
        difference = code_number(coder, models, predictor, &columns[i], &previous_sign,
                                 8 * table->size, difference);
        set_bits(table, index, from_ordered(table, (predicted + difference) & all_bits(table)));
    }
}

static int64_t code_table(reel_range_coder *coder, void *memory, size_t memory_size,
                          const number_table *table, int64_t n_rows, const int32_t *order,
                          const int64_t *starts, const int32_t *triples, const int32_t *stencils,
                          const float *weights) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    pattern_models *models = reel_allocate(&arena, 1, sizeof *models);
    column_state *columns = reel_allocate(&arena, (size_t)table->width, sizeof *columns);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    start_patterns(models);
    reel_zero(columns, (size_t)table->width * sizeof *columns);
    for (int64_t i = 0; i < n_rows; i++) {
        int64_t row = order[i], count = starts[i + 1] - starts[i];
        if (!code_repetition(coder, models, table, row)) {
            int64_t first = REEL_MAX_STENCIL * row;
            code_row(coder, models, columns, table, row, triples + 3 * starts[i], count,
                     stencils ? stencils + first : NULL, stencils ? weights + first : NULL);
        }
    }
    return reel_finish(coder);
}

int64_t reel_patterns_encode(void *memory, size_t memory_size, void *values, int64_t n_rows,
                             int64_t width, int64_t size, int64_t is_float, const int32_t *order,
                             const int64_t *starts, const int32_t *triples,
                             const int32_t *stencils, const float *weights, uint8_t *out,
                             size_t capacity) {
    number_table table = {values, width, (int)size, is_float != 0};
    reel_range_coder coder = reel_start_encoder(out, capacity);
    return code_table(&coder, memory, memory_size, &table, n_rows, order, starts, triples, stencils,
                      weights);
}

int64_t reel_patterns_decode(void *memory, size_t memory_size, const uint8_t *in, size_t in_size,
                             void *values, int64_t n_rows, int64_t width, int64_t size,
                             int64_t is_float, const int32_t *order, const int64_t *starts,
                             const int32_t *triples, const int32_t *stencils,
                             const float *weights) {
    number_table table = {values, width, (int)size, is_float != 0};
    reel_range_coder coder = reel_start_decoder(in, in_size);
    return code_table(&coder, memory, memory_size, &table, n_rows, order, starts, triples, stencils,
                      weights);
}
