/* Tables of numbers, exactly: each row less what others let expect, as adaptive bits.

   docs/format.md, "Patterns". Integers are coded as they are, floats as integers in the order of
   their values. A row is expected at the mean of parallelograms a + b - c of earlier rows, or at
   an earlier row; or it is one of the last few rows again. */

#include "integers.h"

#define MOST_BITS 64 /* of a number */
#define PASTS 48     /* classes of how far off the numbers before were */
#define WAYS 3       /* what a row is expected from: nothing, a row, parallelograms */
#define RECENT_BITS 6
#define RECENT (1 << RECENT_BITS) /* different rows that may come again at once */

typedef struct {
    reel_model longer[MOST_BITS];
    reel_model second[MOST_BITS];
    reel_model third[MOST_BITS][2];
} pattern_model;

typedef struct {
    uint64_t past; /* four times the mean of how far off, the last one most */
    int sign;      /* of the last: none, +, - */
} column;

typedef struct {
    pattern_model all;
    pattern_model here[WAYS][PASTS];
    reel_model low[MOST_BITS]; /* by place: bits below the third */
    reel_model negative[3][3]; /* by the signs before in the column and in the row */
    reel_model again[4];       /* by whether the last two rows came again: does this one? */
    reel_model which[RECENT];
    int64_t recent[RECENT];
    uint32_t marks[RECENT]; /* of the recent rows; the writer compares them first */
    int n_recent;
    unsigned came_again;
} pattern_models;

typedef struct {
    uint8_t *values; /* rows of `width` numbers of `size` bytes */
    int64_t width;
    int size; /* 1, 4 or 8 */
    bool is_float;
} number_table;

size_t reel_patterns_memory(int64_t width) {
    return reel_room(1, sizeof(pattern_models)) + reel_room((size_t)width, sizeof(column));
}

static void start_patterns(pattern_models *models) {
    reel_zero(models, sizeof *models);
    reel_model *all = (reel_model *)&models->all;
    for (size_t i = 0; i < sizeof models->all / sizeof *all; i++) {
        all[i] = reel_model_of(32768, 0);
    }
    for (int i = 0; i < MOST_BITS; i++) {
        models->low[i] = reel_model_of(32768, 0);
    }
    for (int i = 0; i < 9; i++) {
        models->negative[i / 3][i % 3] = reel_model_of(32768, 0);
    }
    for (int i = 0; i < RECENT; i++) {
        models->which[i] = models->again[i & 3] = reel_model_of(32768, 0);
    }
}

/* The number at a place, as its bits. */
static uint64_t bits_at(const number_table *table, int64_t place) {
    uint64_t found = 0;
    reel_copy(&found, table->values + place * table->size, (size_t)table->size);
    return found;
}

static void put_bits(const number_table *table, int64_t place, uint64_t bits) {
    reel_copy(table->values + place * table->size, &bits, (size_t)table->size);
}

static uint64_t all_bits(const number_table *table) { return UINT64_MAX >> (64 - 8 * table->size); }

/* Bits of a float as an integer in the order of values, and back. */
static uint64_t ordered(const number_table *table, uint64_t bits) {
    uint64_t sign = (uint64_t)1 << (8 * table->size - 1);
    return !table->is_float ? bits : bits & sign ? ~bits & all_bits(table) : bits | sign;
}

static uint64_t unordered(const number_table *table, uint64_t number) {
    uint64_t sign = (uint64_t)1 << (8 * table->size - 1);
    return !table->is_float ? number : number & sign ? number ^ sign : ~number & all_bits(table);
}

static int64_t integer_of(const number_table *table, uint64_t bits) {
    return table->size == 1 ? (int64_t)bits : (int64_t)(int32_t)(uint32_t)bits;
}

static double float_of(const number_table *table, uint64_t bits) {
    if (table->size == 8) {
        double found;
        reel_copy(&found, &bits, sizeof found);
        return found;
    }
    uint32_t half = (uint32_t)bits;
    float found;
    reel_copy(&found, &half, sizeof found);
    return (double)found;
}

/* The bits of a float of the table's type, or `otherwise` if that cannot hold it. */
static uint64_t bits_of_float(const number_table *table, double value, uint64_t otherwise) {
    double largest = table->size == 8 ? 0x1.fffffffffffffp+1023 : 0x1.fffffep+127;
    if (!(value >= -largest && value <= largest)) { /* not a number neither */
        return otherwise;
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

/* The bits expected in a column, from `count` triples of rows. */
static uint64_t expected(const number_table *table, int64_t col, const int32_t *triples,
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
    mean -= mean * 2 * count > twice; /* rounded down */
    int64_t least = table->size == 1 ? 0 : INT32_MIN, most = table->size == 1 ? 255 : INT32_MAX;
    mean = mean < least ? least : mean > most ? most : mean;
    return (uint64_t)mean & all_bits(table);
}

/* Two classes for each doubling of the mean before. */
static int past_class(uint64_t past) {
    int above = 61 - __builtin_clzll(past + 4);
    int found = 2 * above + (int)((past + 4) >> (above + 1) & 1U);
    return found < PASTS ? found : PASTS - 1;
}

static int bit_length(uint64_t value) { return value ? 64 - __builtin_clzll(value) : 0; }

static uint64_t code_magnitude(reel_port *port, pattern_models *models, pattern_model *here,
                               int most_bits, uint64_t value) {
    pattern_model *all = &models->all;
    int length = 0, wanted = bit_length(value);
    while (length < most_bits && reel_bit_within(port, &all->longer[length], &here->longer[length],
                                                 wanted > length)) {
        length++;
    }
    if (length < 2) {
        return (uint64_t)length;
    }
    int low = length - 2;
    uint64_t found = 2U | (uint64_t)reel_bit_within(port, &all->second[length - 1],
                                                    &here->second[length - 1],
                                                    (int)(value >> low & 1U));
    if (low > 0) {
        reel_model *third = &all->third[length - 1][found & 1U];
        low--;
        found = found << 1 | (uint64_t)reel_bit(port, third, (int)(value >> low & 1U));
    }
    while (low > 0) {
        low--;
        found = found << 1 | (uint64_t)reel_bit(port, &models->low[low], (int)(value >> low & 1U));
    }
    return found;
}

/* A number of a column; `before` is the sign in the row before it, and then that of this one. */
static uint64_t code_number(reel_port *port, pattern_models *models, int way, column *of,
                            int *before, int n_bits, uint64_t off) {
    uint64_t most = UINT64_MAX >> (64 - n_bits), half = (uint64_t)1 << (n_bits - 1);
    bool negative = off > half;
    uint64_t size = negative ? most - off + 1 : off;
    pattern_model *here = &models->here[way][past_class(of->past)];
    size = code_magnitude(port, models, here, n_bits, size);
    int sign = 0;
    if (size) {
        sign = 1 + reel_bit(port, &models->negative[of->sign][*before], negative);
    }
    uint64_t bounded = size >> 48 ? (uint64_t)1 << 48 : size;
    of->past = of->past / 2 + 2 * bounded;
    of->sign = *before = sign;
    return sign == 2 ? (most - size + 1) & most : size & most;
}

static uint32_t mark_of(const number_table *table, int64_t row) {
    size_t size = (size_t)(table->width * table->size);
    uint32_t mark = 0;
    for (size_t i = 0; i < size; i++) {
        mark = (mark ^ table->values[(size_t)row * size + i]) * 0x01000193U;
    }
    return mark;
}

/* The place of a row among the recent ones; behind the last if it is none of them. */
static int recent_place(const pattern_models *models, const number_table *table, int64_t row,
                        uint32_t mark) {
    size_t size = (size_t)(table->width * table->size);
    for (int i = 0; i < models->n_recent; i++) {
        if (models->marks[i] == mark &&
            reel_same(table->values + (size_t)models->recent[i] * size,
                      table->values + (size_t)row * size, size)) {
            return i;
        }
    }
    return models->n_recent;
}

static void move_to_front(pattern_models *models, int place, int64_t row, uint32_t mark) {
    for (; place > 0; place--) {
        models->recent[place] = models->recent[place - 1];
        models->marks[place] = models->marks[place - 1];
    }
    models->recent[0] = row;
    models->marks[0] = mark;
}

/* Whether a row is one of the recent ones; if so it is filled in. It becomes the most recent. */
static bool code_again(reel_port *port, pattern_models *models, const number_table *table,
                       int64_t row) {
    int n = models->n_recent, place = 0;
    uint32_t mark = reel_writes(port) ? mark_of(table, row) : 0;
    if (reel_writes(port)) {
        place = recent_place(models, table, row, mark);
    }
    bool again = n && reel_bit(port, &models->again[models->came_again & 3U], place < n);
    models->came_again = models->came_again << 1 | again;
    if (!again) {
        models->n_recent += n < RECENT;
        move_to_front(models, n < RECENT ? n : RECENT - 1, row, mark);
        return false;
    }
    int node = 1;
    for (int i = RECENT_BITS - 1; i >= 0; i--) {
        node = node << 1 | reel_bit(port, &models->which[node], place >> i & 1);
    }
    place = node - RECENT < n ? node - RECENT : n - 1; /* of damaged bytes, the last */
    if (!reel_writes(port)) {
        size_t size = (size_t)(table->width * table->size);
        reel_copy(table->values + (size_t)row * size,
                  table->values + (size_t)models->recent[place] * size, size);
    }
    move_to_front(models, place, row, mark);
    return true;
}

static void code_row(reel_port *port, pattern_models *models, column *columns,
                     const number_table *table, int64_t row, const int32_t *triples,
                     int64_t count) {
    int way = count == 0 ? 0 : triples[2] < 0 ? 1 : 2, before = 0;
    for (int64_t i = 0; i < table->width; i++) {
        int64_t place = row * table->width + i;
        uint64_t from = ordered(table, expected(table, i, triples, count));
        uint64_t off = (ordered(table, bits_at(table, place)) - from) & all_bits(table);
        off = code_number(port, models, way, &columns[i], &before, 8 * table->size, off);
        put_bits(table, place, unordered(table, (from + off) & all_bits(table)));
    }
}

static int64_t code_table(reel_port *port, void *memory, size_t memory_size,
                          const number_table *table, int64_t n_rows, const int32_t *order,
                          const int64_t *starts, const int32_t *triples) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    pattern_models *models = reel_take(&arena, 1, sizeof *models);
    column *columns = reel_take(&arena, (size_t)table->width, sizeof *columns);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    start_patterns(models);
    reel_zero(columns, (size_t)table->width * sizeof *columns);
    for (int64_t i = 0; i < n_rows; i++) {
        int64_t row = order[i], count = starts[i + 1] - starts[i];
        if (!code_again(port, models, table, row)) {
            code_row(port, models, columns, table, row, triples + 3 * starts[i], count);
        }
    }
    return reel_end(port);
}

int64_t reel_patterns_encode(void *memory, size_t memory_size, void *values, int64_t n_rows,
                             int64_t width, int64_t size, int64_t is_float, const int32_t *order,
                             const int64_t *starts, const int32_t *triples, uint8_t *out,
                             size_t room) {
    number_table table = {values, width, (int)size, is_float != 0};
    reel_port port = reel_writer(out, room);
    return code_table(&port, memory, memory_size, &table, n_rows, order, starts, triples);
}

int64_t reel_patterns_decode(void *memory, size_t memory_size, const uint8_t *in, size_t in_size,
                             void *values, int64_t n_rows, int64_t width, int64_t size,
                             int64_t is_float, const int32_t *order, const int64_t *starts,
                             const int32_t *triples) {
    number_table table = {values, width, (int)size, is_float != 0};
    reel_port port = reel_reader(in, in_size);
    return code_table(&port, memory, memory_size, &table, n_rows, order, starts, triples);
}
