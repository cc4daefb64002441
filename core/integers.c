/* Rows of adaptive integers; each row uses one of several tables of models.

   docs/format.md, "Integers". The context of an integer is a decaying mean of the magnitudes before
   it in its row; that of its sign is the previous sign. */

#include "integers.h"

#define N_MEAN_CLASSES 24 /* classes of the decaying mean */

typedef struct {
    reel_integer_model shared;
    reel_integer_model by_mean[N_MEAN_CLASSES];
} table;

size_t reel_integers_memory(int64_t n_tables) {
    return reel_array_bytes((size_t)n_tables, sizeof(table));
}

/* Class of the decaying mean, which is given times 4: each octave of `scaled_mean` + 4 has two. */
static int mean_class(uint64_t scaled_mean) {
    int octave = 61 - __builtin_clzll(scaled_mean + 4); /* index of the highest bit, less 2 */
    int result = 2 * octave + (int)((scaled_mean + 4) >> (octave + 1) & 1U);
    return result < N_MEAN_CLASSES ? result : N_MEAN_CLASSES - 1;
}

static void code_row(reel_range_coder *coder, table *models, int32_t *values, int64_t length) {
    uint64_t scaled_mean = 0;
    int sign = 0;
    for (int64_t i = 0; i < length; i++) {
        reel_integer_model *context = &models->by_mean[mean_class(scaled_mean)];
        int32_t value =
            reel_code_integer_in_context(coder, &models->shared, context, sign, values[i]);
        values[i] = value;
        sign = value > 0 ? 1 : value < 0 ? 2 : 0;
        scaled_mean = scaled_mean / 2 + 2 * (uint64_t)(value < 0 ? -value : value);
    }
}

static int64_t code_rows(reel_range_coder *coder, int32_t *values, const int64_t *lengths,
                         const int32_t *tables, int64_t n_rows, table *models) {
    for (int64_t row = 0; row < n_rows; row++) {
        code_row(coder, &models[tables[row]], values, lengths[row]);
        values += lengths[row];
    }
    return reel_finish(coder);
}

static table *new_tables(void *memory, size_t size, int64_t n_tables) {
    reel_arena arena = reel_arena_of(memory, size);
    table *models = reel_allocate(&arena, (size_t)n_tables, sizeof *models);
    for (int64_t i = 0; models && i < n_tables; i++) {
        reel_reset_integer_model(&models[i].shared);
        reel_zero(models[i].by_mean, sizeof models[i].by_mean);
    }
    return models;
}

int64_t reel_integers_encode(void *memory, size_t memory_size, int32_t *values,
                             const int64_t *lengths, const int32_t *tables, int64_t n_rows,
                             int64_t n_tables, uint8_t *out, size_t capacity) {
    table *models = new_tables(memory, memory_size, n_tables);
    if (!models && n_tables) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    reel_range_coder coder = reel_start_encoder(out, capacity);
    return code_rows(&coder, values, lengths, tables, n_rows, models);
}

int64_t reel_integers_decode(void *memory, size_t memory_size, const uint8_t *in, size_t size,
                             const int64_t *lengths, const int32_t *tables, int64_t n_rows,
                             int64_t n_tables, int32_t *values) {
    table *models = new_tables(memory, memory_size, n_tables);
    if (!models && n_tables) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    reel_range_coder coder = reel_start_decoder(in, size);
    return code_rows(&coder, values, lengths, tables, n_rows, models);
}

int64_t reel_abi(void) { return REEL_ABI; }
