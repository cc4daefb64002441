/* Rows of integers, each row in a table of its own or in one that it shares.

   docs/format.md, "Integers". The context of an integer is how large those before it in its row
   were, the last one most, and the sign of the last one. */

#include "integers.h"

#define PASTS 24 /* classes of how large the integers before were */

typedef struct {
    reel_integer_model all;
    reel_integer_model by_past[PASTS];
} table;

size_t reel_integers_memory(int64_t n_tables) { return reel_room((size_t)n_tables, sizeof(table)); }

/* Two classes for each doubling of four times the mean magnitude before, plus 4. */
static int past_class(uint64_t past) {
    int above = 61 - __builtin_clzll(past + 4); /* the highest bit, less 2 */
    int found = 2 * above + (int)((past + 4) >> (above + 1) & 1U);
    return found < PASTS ? found : PASTS - 1;
}

static void code_row(reel_port *port, table *of, int32_t *values, int64_t length) {
    uint64_t past = 0;
    int sign = 0;
    for (int64_t i = 0; i < length; i++) {
        reel_integer_model *here = &of->by_past[past_class(past)];
        int32_t value = reel_code_integer_within(port, &of->all, here, sign, values[i]);
        values[i] = value;
        sign = value > 0 ? 1 : value < 0 ? 2 : 0;
        past = past / 2 + 2 * (uint64_t)(value < 0 ? -value : value);
    }
}

static int64_t code_rows(reel_port *port, int32_t *values, const int64_t *lengths,
                         const int32_t *tables, int64_t n_rows, table *models) {
    for (int64_t row = 0; row < n_rows; row++) {
        code_row(port, &models[tables[row]], values, lengths[row]);
        values += lengths[row];
    }
    return reel_end(port);
}

static table *fresh_tables(void *memory, size_t size, int64_t n_tables) {
    reel_arena arena = reel_arena_of(memory, size);
    table *models = reel_take(&arena, (size_t)n_tables, sizeof *models);
    for (int64_t i = 0; models && i < n_tables; i++) {
        reel_start_integers(&models[i].all);
        reel_zero(models[i].by_past, sizeof models[i].by_past);
    }
    return models;
}

int64_t reel_integers_encode(void *memory, size_t memory_size, int32_t *values,
                             const int64_t *lengths, const int32_t *tables, int64_t n_rows,
                             int64_t n_tables, uint8_t *out, size_t room) {
    table *models = fresh_tables(memory, memory_size, n_tables);
    if (!models && n_tables) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    reel_port port = reel_writer(out, room);
    return code_rows(&port, values, lengths, tables, n_rows, models);
}

int64_t reel_integers_decode(void *memory, size_t memory_size, const uint8_t *in, size_t size,
                             const int64_t *lengths, const int32_t *tables, int64_t n_rows,
                             int64_t n_tables, int32_t *values) {
    table *models = fresh_tables(memory, memory_size, n_tables);
    if (!models && n_tables) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    reel_port port = reel_reader(in, size);
    return code_rows(&port, values, lengths, tables, n_rows, models);
}

int64_t reel_abi(void) { return REEL_ABI; }
