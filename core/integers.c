/* Rows of integers, each row in a table of its own or in one that it shares. */

#include "integers.h"

size_t reel_integers_memory(int64_t n_tables) {
    return reel_room((size_t)n_tables, sizeof(reel_integer_model));
}

static int64_t code_rows(reel_port *port, int32_t *values, const int64_t *lengths,
                         const int32_t *tables, int64_t n_rows, reel_integer_model *models) {
    for (int64_t row = 0; row < n_rows; row++) {
        reel_integer_model *model = &models[tables[row]];
        for (int64_t i = 0; i < lengths[row]; i++) {
            values[i] = reel_code_integer(port, model, values[i]);
        }
        values += lengths[row];
    }
    return reel_end(port);
}

static reel_integer_model *fresh_models(void *memory, size_t size, int64_t n_tables) {
    reel_arena arena = reel_arena_of(memory, size);
    reel_integer_model *models = reel_take(&arena, (size_t)n_tables, sizeof *models);
    for (int64_t i = 0; models && i < n_tables; i++) {
        reel_start_integers(&models[i]);
    }
    return models;
}

int64_t reel_integers_encode(void *memory, size_t memory_size, int32_t *values,
                             const int64_t *lengths, const int32_t *tables, int64_t n_rows,
                             int64_t n_tables, uint8_t *out, size_t room) {
    reel_integer_model *models = fresh_models(memory, memory_size, n_tables);
    if (!models && n_tables) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    reel_port port = reel_writer(out, room);
    return code_rows(&port, values, lengths, tables, n_rows, models);
}

int64_t reel_integers_decode(void *memory, size_t memory_size, const uint8_t *in, size_t size,
                             const int64_t *lengths, const int32_t *tables, int64_t n_rows,
                             int64_t n_tables, int32_t *values) {
    reel_integer_model *models = fresh_models(memory, memory_size, n_tables);
    if (!models && n_tables) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    reel_port port = reel_reader(in, size);
    return code_rows(&port, values, lengths, tables, n_rows, models);
}

int64_t reel_abi(void) { return REEL_ABI; }
