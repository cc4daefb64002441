/* Fields: rows of small integers over the same columns, most of them 0.

   docs/format.md, "Fields". A row is a mode, a column a vertex or a time. How large an integer will
   be is regressed, in whole numbers, from its column in the rows before, from its context
   neighbours and from what was coded just now; the weights are learned on the way. Its class of
   size is the context of the bits that say how large it is. Its sign follows the neighbours'.

   Columns are renumbered by place: the order in which they are coded. A value that is not 0 is
   pushed to the places that it is a neighbour of; the many zeros cost nothing there. Groups of
   places that are 0 row after row are one bit each, and are left as they are. */

#include "bits.h"

#define MOST_NEAR 16            /* context neighbours of a column */
#define MOST_BITS 31            /* of a magnitude */
#define ONE 4096                /* a magnitude of 1, in sums */
#define LARGEST 4095            /* larger magnitudes count as this when others are predicted */
#define N_CLASSES 48            /* half octaves of the expected magnitude, from 1 / ONE on */
#define N_SIZES (8 * N_CLASSES) /* sixteenths of an octave */
#define N_VOTES 13              /* bits of the largest vote, and 0 */
#define N_INPUTS 9              /* of the regression */
#define WELL_KNOWN 4096         /* sizes below a 15th are only learned from what is not 0 */
#define GROUP 64            /* places of a pass that may be 0 together */
#define N_QUIET 16          /* rows in which a group was 0, at most, plus 1 */
#define STRIDE 4 /* a row refreshes what is usual near one place in so many, the first rows all;
                    a power of 2 */

typedef struct {
    reel_model any[N_CLASSES];               /* is it not 0? */
    reel_model longer[MOST_BITS][N_CLASSES]; /* by length so far, less 1: is it longer? */
    reel_model upper[MOST_BITS][N_CLASSES];  /* by length, less 2: the second highest bit */
    reel_model wrong[N_VOTES];               /* by the vote: does the sign differ from it? */
    reel_model stirs[2][2][N_QUIET]; /* is a quiet group no longer 0? by the group before it, by its
                                        neighbours, by rows that it was 0 */
    uint16_t surplus[N_SIZES];               /* m / (1 + m) of each size m, by 65536 */
} reel_tables;

/* Magnitudes that neighbours have in this row. */
typedef struct {
    int32_t sum, largest;
} reel_near;

#define EIGHT 8 /* neighbours whose agreement is learned at once */
typedef int16_t eight __attribute__((vector_size(2 * EIGHT), may_alias, aligned(2)));

typedef struct {
    int64_t n_places, n_passes;
    const int64_t *pass_starts;
    const int32_t *columns;
    int64_t *starts, *later_starts; /* of the neighbours, and of those it is a neighbour of */
    int32_t *near, *later;          /* earlier places, and later ones */
    int16_t *agreement;             /* of signs, with each neighbour; EIGHT more are touched */
    reel_near *around;
    int16_t *shares;                 /* ONE by the number of neighbours, 0 if there are none */
    int16_t *magnitudes;             /* of the row, at most LARGEST */
    int8_t *signs;                   /* of the row: -1, 0 or 1 */
    int32_t *sums[3];                /* of magnitudes of earlier rows: fast, middle, slow */
    int16_t *slow, *fast, *middle;   /* logarithms of the sums, the last two less the first */
    int16_t *usual;                  /* mean of `slow` of the neighbours */
    int32_t *pass_means, *pass_bias; /* mean magnitude, first weight */
    uint8_t *quiet; /* for each GROUP places: rows before in which they were 0, N_QUIET - 1 at most */
    reel_tables *tables;
    int32_t weights[N_INPUTS];
} coder;

/* What was coded just now, and what is usual there. */
typedef struct {
    int32_t row, row_usual, local, local_usual, pass;
} reel_recent;

static const int16_t share_of[MOST_NEAR + 1] = {0,   4096, 2048, 1365, 1024, 819, 682, 585, 512,
                                                455, 409,  372,  341,  315,  292, 273, 256};

/* By 65536; they were learned on simulated cloth and on tubes, and rounded. */
static const int32_t first_weights[N_INPUTS] = {0,    0,     16384, 16384, 8192,
                                                8192, 24576, 8192,  -16384};

/* Sixteen times the logarithm to base 2 of 1..2^24, piecewise linear. They are integers that a
   float holds exactly; its highest bits are the logarithm. */
REEL_INLINE int32_t log_of(int32_t value) {
    float exact = (float)value;
    int32_t bits;
    __builtin_memcpy(&bits, &exact, sizeof bits);
    return (bits >> 19) - 16 * 127;
}

static void start_tables(reel_tables *tables) {
    for (uint32_t log = 0; log < N_SIZES; log++) {
        uint32_t size = (16 + log % 16) << (log / 16) >> 4;
        tables->surplus[log] = (uint16_t)(((uint64_t)size << 16) / (size + ONE));
    }
    for (int i = 0; i < N_CLASSES; i++) {
        uint32_t power = tables->surplus[8 * i + 4];
        tables->any[i] = reel_model_of(power, 32);
        for (int length = 0; length < MOST_BITS; length++) {
            uint32_t guess = power < 4096 ? 4096 : power; /* tails are long */
            tables->longer[length][i] = reel_model_of(guess, 32);
            tables->upper[length][i] = reel_model_of((guess << 16) / (65536 + guess), 32);
            power = power * power >> 16;
        }
    }
    for (int i = 0; i < N_VOTES; i++) {
        tables->wrong[i] = reel_model_of(32768, 8);
    }
    for (int i = 0; i < 4 * N_QUIET; i++) {
        tables->stirs[i / N_QUIET / 2][i / N_QUIET % 2][i % N_QUIET] = reel_model_of(16384, 8);
    }
}

/* A magnitude of 1..2^31-1. */
REEL_INLINE uint32_t code_size(reel_port *port, reel_tables *tables, int class, uint32_t size) {
    int length = 1, wanted = reel_length(size);
    while (length < MOST_BITS &&
           reel_bit(port, &tables->longer[length - 1][class], wanted > length)) {
        length++;
    }
    if (length == 1) {
        return 1;
    }
    int low = length - 2; /* bits below the second highest */
    uint32_t found = 2U | (uint32_t)reel_bit(port, &tables->upper[low][class], size >> low & 1U);
    while (low > 0) {
        int here = low < 16 ? low : 16;
        low -= here;
        found = found << here | reel_code_raw(port, here, size >> low);
    }
    return found;
}

/* Whether the value at a place is negative. Neighbours vote with their signs; how far each agrees
   with the place is learned from the rows in which neither is 0. */
REEL_INLINE int code_sign(reel_port *port, coder *f, int64_t place, int negative) {
    int16_t signs[MOST_NEAR] = {0};
    const int32_t *near = f->near + f->starts[place];
    int16_t *agreement = f->agreement + f->starts[place];
    int64_t n = f->starts[place + 1] - f->starts[place];
    int32_t vote = 0;
    for (int64_t i = 0; i < n; i++) {
        int32_t sign = f->signs[near[i]];
        signs[i] = (int16_t)sign;
        vote += agreement[i] * sign;
    }
    int expected = vote < 0;
    reel_model *model = &f->tables->wrong[reel_length((uint32_t)(vote < 0 ? -vote : vote))];
    negative = reel_bit(port, model, negative ^ expected) ^ expected;
    int16_t own = negative ? -16 : 16;
    for (int64_t i = 0; i < n; i += EIGHT) { /* where a sign is 0 nothing changes */
        eight *agreed = (eight *)(agreement + i), sign = *(eight *)(signs + i);
        *agreed += own * sign - ((*agreed >> 3) & -(sign & 1));
    }
    return negative;
}

/* A value that is not 0: its magnitude, then its sign. */
REEL_INLINE int32_t code_rest(reel_port *port, coder *f, int64_t place, int class,
                         int32_t value) {
    uint32_t size = value < 0 ? 0U - (uint32_t)value : (uint32_t)value;
    size = code_size(port, f->tables, class, size);
    int32_t magnitude = (int32_t)(size < LARGEST ? size : LARGEST);
    int negative = code_sign(port, f, place, value < 0);
    f->magnitudes[place] = (int16_t)magnitude;
    f->signs[place] = negative ? -1 : 1;
    const int32_t *later = f->later + f->later_starts[place];
    const int32_t *end = f->later + f->later_starts[place + 1];
    for (; later < end; later++) {
        reel_near *one = &f->around[*later];
        one->sum += magnitude;
        one->largest = one->largest > magnitude ? one->largest : magnitude;
    }
    return negative ? -(int32_t)size : (int32_t)size;
}

REEL_INLINE void find_inputs(const coder *f, int64_t place, const reel_recent *recent,
                             int32_t inputs[N_INPUTS]) {
    const reel_near *around = &f->around[place];
    int32_t own = f->slow[place], usual = f->usual[place], share = f->shares[place];
    int32_t row = log_of(recent->row) - log_of(recent->row_usual);
    int32_t mean = log_of(around->sum * share + 100);
    inputs[0] = 32;
    inputs[1] = f->fast[place];
    inputs[2] = share ? mean - usual : 0;
    inputs[3] = row;
    inputs[4] = share ? usual - own : 0;
    inputs[5] = log_of(recent->pass + 16) - own;
    inputs[6] = f->middle[place];
    inputs[7] = log_of(recent->local + 32) - log_of(recent->local_usual + 32) - row;
    inputs[8] = log_of(around->largest * ONE + 100) - mean;
}

/* Logarithm of the expected magnitude, 0..N_SIZES-1. */
REEL_INLINE int expected_size(const int32_t *weights, int32_t bias, const int32_t *inputs,
                              int32_t own) {
    int64_t sum = (int64_t)bias * inputs[0];
    for (int i = 1; i < N_INPUTS; i++) {
        sum += (int64_t)weights[i] * inputs[i];
    }
    sum = own + (sum >> 16);
    return (int)(sum < 0 ? 0 : sum < N_SIZES ? sum : N_SIZES - 1);
}

/* Weights take a step towards a size that would have made the magnitude likelier: for geometric
   probabilities of mean m the slope is (magnitude - m) / (1 + m). */
REEL_INLINE void learn_size(int32_t *weights, int32_t *bias, const int32_t *inputs,
                            int32_t surplus, int32_t magnitude) {
    int32_t gain = magnitude * (65536 - surplus);
    int32_t error = (gain < 8 * 65536 ? gain : 8 * 65536) - surplus;
    *bias = (int32_t)((uint32_t)*bias + (uint32_t)((error * inputs[0] + 2048) >> 12));
    for (int i = 1; i < N_INPUTS; i++) {
        int32_t step = (error * inputs[i] + 2048) >> 12;
        weights[i] = (int32_t)((uint32_t)weights[i] + (uint32_t)step);
    }
}

REEL_INLINE void note_magnitude(reel_recent *recent, int32_t magnitude, int32_t usual) {
    recent->local += magnitude * 256 - (recent->local >> 2);
    recent->local_usual += (usual >> 4) - (recent->local_usual >> 2);
    recent->row += magnitude * 16;
    recent->row_usual += usual >> 8;
    if ((recent->row | recent->row_usual) >> 23) {
        recent->row = recent->row >> 1 | 1;
        recent->row_usual = recent->row_usual >> 1 | 1;
    }
    recent->pass += (magnitude * ONE - recent->pass) >> 4;
}

/* Some places of a pass; whether all are 0. */
REEL_INLINE bool code_places(reel_port *port, coder *f, int32_t *row, int64_t first, int64_t last,
                             reel_recent *recent, int32_t *bias) {
    int32_t inputs[N_INPUTS], all = 0;
    for (int64_t place = first; place < last; place++) {
        find_inputs(f, place, recent, inputs);
        int size = expected_size(f->weights, *bias, inputs, f->slow[place]);
        int32_t surplus = f->tables->surplus[size], magnitude = 0;
        int32_t *value = &row[f->columns[place]];
        if (reel_bit(port, &f->tables->any[size >> 3], *value != 0)) {
            *value = code_rest(port, f, place, size >> 3, *value);
            magnitude = f->magnitudes[place];
            learn_size(f->weights, bias, inputs, surplus, magnitude);
        } else {
            *value = f->magnitudes[place] = f->signs[place] = 0;
            if (surplus > WELL_KNOWN) {
                learn_size(f->weights, bias, inputs, surplus, 0);
            }
        }
        note_magnitude(recent, magnitude, f->sums[2][place]);
        all |= magnitude;
    }
    return !all;
}

/* Sums in which older rows count less and less; restrict, so that compilers use vectors. */
REEL_INLINE void add_row(int64_t n, const int16_t *restrict magnitudes, int32_t *restrict fast_sums,
                         int32_t *restrict middle_sums, int32_t *restrict slow_sums,
                         int16_t *restrict fast, int16_t *restrict middle,
                         int16_t *restrict slow) {
    for (int64_t i = 0; i < n; i++) {
        int32_t magnitude = magnitudes[i] * ONE;
        fast_sums[i] += (magnitude - fast_sums[i]) >> 1;
        middle_sums[i] += (magnitude - middle_sums[i]) >> 2;
        slow_sums[i] += (magnitude - slow_sums[i]) >> 3;
        int32_t log = log_of(slow_sums[i] + 16);
        slow[i] = (int16_t)log;
        fast[i] = (int16_t)(log_of(fast_sums[i] + 16) - log);
        middle[i] = (int16_t)(log_of(middle_sums[i] + 16) - log);
    }
}

/* Forgets what neighbours have in this row. */
REEL_INLINE void clear_around(coder *f, int64_t first, int64_t last) {
    reel_zero(f->around + first, (size_t)(last - first) * sizeof *f->around);
}

/* What places that were coded are expected to have in the next row. Their neighbours are earlier
   places, which are up to date. */
REEL_INLINE void end_places(coder *f, int64_t row, int64_t first, int64_t last) {
    add_row(last - first, f->magnitudes + first, f->sums[0] + first, f->sums[1] + first,
            f->sums[2] + first, f->fast + first, f->middle + first, f->slow + first);
    clear_around(f, first, last);
    int64_t stride = row < STRIDE ? 1 : STRIDE;
    for (int64_t i = first + ((row - first) & (stride - 1)); i < last; i += stride) {
        int32_t sum = 0;
        for (int64_t j = f->starts[i]; j < f->starts[i + 1]; j++) {
            sum += f->slow[f->near[j]];
        }
        f->usual[i] = (int16_t)(sum * f->shares[i] >> 12);
    }
}

/* Whether a group that was 0 in the row before is 0 again, as one bit. Nothing is learned there. */
REEL_INLINE bool code_stillness(reel_port *port, coder *f, const int32_t *row, int64_t first,
                                int quiet, bool is_stirred) {
    int any = 0, pushed = 0;
    for (int64_t i = first; i < first + GROUP; i++) {
        pushed |= f->around[i].sum;
    }
    for (int64_t i = first; reel_writes(port) && i < first + GROUP; i++) {
        any |= row[f->columns[i]];
    }
    reel_model *model = &f->tables->stirs[is_stirred][pushed != 0][quiet];
    return !reel_bit(port, model, any != 0);
}

/* A row; what is decoded is 0 before. */
REEL_INLINE void code_row(reel_port *port, coder *f, int64_t number, int32_t *row) {
    reel_recent recent = {.row = 256, .row_usual = 256};
    for (int64_t pass = 0; pass < f->n_passes; pass++) {
        int32_t bias = f->pass_bias[pass];
        int64_t first = f->pass_starts[pass], end = f->pass_starts[pass + 1];
        bool is_stirred = true; /* the group before */
        recent.pass = f->pass_means[pass];
        for (; end - first >= GROUP; first += GROUP) {
            uint8_t *quiet = &f->quiet[first / GROUP];
            bool is_zero = *quiet && code_stillness(port, f, row, first, *quiet, is_stirred);
            if (is_zero) {
                clear_around(f, first, first + GROUP);
                recent.local = recent.local_usual = 0;
                recent.pass >>= 4;
            } else {
                is_zero = code_places(port, f, row, first, first + GROUP, &recent, &bias);
                end_places(f, number, first, first + GROUP);
            }
            *quiet = (uint8_t)(!is_zero ? 0 : *quiet < N_QUIET - 1 ? *quiet + 1 : *quiet);
            is_stirred = !is_zero;
        }
        code_places(port, f, row, first, end, &recent, &bias);
        end_places(f, number, first, end);
        f->pass_means[pass] = recent.pass;
        f->pass_bias[pass] = bias;
    }
}

/* Neighbours as places; false unless every column has one place, and neighbours earlier ones. */
static bool place_neighbours(coder *f, const int64_t *starts, const int32_t *near,
                             int32_t *place_of) {
    for (int64_t i = 0; i < f->n_places; i++) {
        place_of[i] = -1;
    }
    for (int64_t i = 0; i < f->n_places; i++) {
        int64_t column = f->columns[i], n = starts[i + 1] - starts[i];
        if (column < 0 || column >= f->n_places || place_of[column] >= 0 || n < 0 ||
            n > MOST_NEAR || starts[i + 1] > starts[f->n_places]) {
            return false;
        }
        for (int64_t j = starts[i]; j < starts[i + 1]; j++) {
            if (near[j] < 0 || near[j] >= f->n_places || place_of[near[j]] < 0) {
                return false;
            }
            f->near[j] = place_of[near[j]];
            f->agreement[j] = 16;
        }
        place_of[column] = (int32_t)i;
        f->shares[i] = share_of[n];
    }
    reel_copy(f->starts, starts, ((size_t)f->n_places + 1) * sizeof *starts);
    return true;
}

/* The places that each place is a neighbour of, ascending. */
static void list_later(coder *f) {
    int64_t n = f->n_places;
    reel_zero(f->later_starts, ((size_t)n + 1) * sizeof *f->later_starts);
    for (int64_t i = 0; i < f->starts[n]; i++) {
        f->later_starts[f->near[i]]++;
    }
    for (int64_t i = 0; i < n; i++) { /* where the list of each place ends */
        f->later_starts[i + 1] += f->later_starts[i];
    }
    for (int64_t i = n - 1; i >= 0; i--) {
        for (int64_t j = f->starts[i]; j < f->starts[i + 1]; j++) {
            f->later[--f->later_starts[f->near[j]]] = (int32_t)i;
        }
    }
}

static void start_fields(coder *f) {
    start_tables(f->tables);
    reel_copy(f->weights, first_weights, sizeof first_weights);
    for (int64_t i = 0; i < f->n_places; i++) {
        f->sums[0][i] = f->sums[1][i] = f->sums[2][i] = ONE;
        f->slow[i] = f->usual[i] = 16 * 12; /* the logarithm of ONE */
        f->fast[i] = f->middle[i] = f->magnitudes[i] = f->signs[i] = 0;
    }
    clear_around(f, 0, f->n_places);
    reel_zero(f->quiet, (size_t)f->n_places / GROUP + 1);
    for (int64_t i = 0; i < f->n_passes; i++) {
        f->pass_means[i] = 8 * ONE;
        f->pass_bias[i] = 0;
    }
}

static void take_fields(reel_arena *arena, coder *f, size_t n_near) {
    size_t n = (size_t)f->n_places, n_passes = (size_t)f->n_passes;
    f->starts = reel_take(arena, n + 1, sizeof *f->starts);
    f->later_starts = reel_take(arena, n + 1, sizeof *f->later_starts);
    f->near = reel_take(arena, n_near, sizeof *f->near);
    f->later = reel_take(arena, n_near, sizeof *f->later);
    f->agreement = reel_take(arena, n_near + EIGHT, sizeof *f->agreement);
    f->around = reel_take(arena, n, sizeof *f->around);
    f->shares = reel_take(arena, n, sizeof *f->shares);
    f->magnitudes = reel_take(arena, n, sizeof *f->magnitudes);
    f->signs = reel_take(arena, n, sizeof *f->signs);
    f->slow = reel_take(arena, n, sizeof *f->slow);
    f->fast = reel_take(arena, n, sizeof *f->fast);
    f->middle = reel_take(arena, n, sizeof *f->middle);
    f->usual = reel_take(arena, n, sizeof *f->usual);
    for (int i = 0; i < 3; i++) {
        f->sums[i] = reel_take(arena, n, sizeof *f->sums[i]);
    }
    f->pass_means = reel_take(arena, n_passes, sizeof *f->pass_means);
    f->pass_bias = reel_take(arena, n_passes, sizeof *f->pass_bias);
    f->quiet = reel_take(arena, n / GROUP + 1, sizeof *f->quiet);
    f->tables = reel_take(arena, 1, sizeof *f->tables);
}

size_t reel_fields_memory(int64_t n_columns, int64_t n_passes, int64_t n_near) {
    size_t n = (size_t)n_columns, near = (size_t)n_near;
    return 2 * reel_room(n + 1, sizeof(int64_t)) + 2 * reel_room(near, sizeof(int32_t)) +
           reel_room(near + EIGHT, sizeof(int16_t)) + reel_room(n, sizeof(reel_near)) +
           6 * reel_room(n, sizeof(int16_t)) + reel_room(n, sizeof(int8_t)) + 3 * reel_room(n, sizeof(int32_t)) +
           2 * reel_room((size_t)n_passes, sizeof(int32_t)) +
           reel_room(n / GROUP + 1, sizeof(uint8_t)) + reel_room(1, sizeof(reel_tables));
}

/* Readies the fields, with the order and the neighbours that the caller gave. */
static enum reel_code prepare(coder *f, void *memory, size_t memory_size,
                              const int64_t *near_starts, const int32_t *near) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    int64_t before = 0;
    for (int64_t i = 0; i <= f->n_passes; i++) {
        if (f->pass_starts[i] < before || f->pass_starts[i] > f->n_places) {
            return REEL_INVALID;
        }
        before = f->pass_starts[i];
    }
    if (f->pass_starts[0] != 0 || before != f->n_places || near_starts[0] != 0 ||
        near_starts[f->n_places] < 0) {
        return REEL_INVALID;
    }
    take_fields(&arena, f, (size_t)near_starts[f->n_places]);
    if (arena.failed) {
        return REEL_NO_MEMORY;
    }
    if (!place_neighbours(f, near_starts, near, f->sums[0])) {
        return REEL_INVALID;
    }
    list_later(f);
    start_fields(f);
    return REEL_OK;
}

REEL_INLINE void code_rows(reel_port *port, coder *f, int32_t *values, int64_t n_rows) {
    for (int64_t row = 0; row < n_rows; row++) {
        code_row(port, f, row, values + row * f->n_places);
    }
}

int64_t reel_fields_encode(void *memory, size_t memory_size, int32_t *values, int64_t n_rows,
                           int64_t n_columns, const int32_t *columns, const int64_t *pass_starts,
                           int64_t n_passes, const int64_t *near_starts, const int32_t *near,
                           uint8_t *out, size_t room) {
    coder f = {.n_places = n_columns, .n_passes = n_passes};
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
    reel_port port = reel_writer(out, room);
    code_rows(&port, &f, values, n_rows);
    return reel_end(&port);
}

int64_t reel_fields_decode(void *memory, size_t memory_size, const uint8_t *in, size_t size,
                           int64_t n_rows, int64_t n_wanted, int64_t n_columns,
                           const int32_t *columns, const int64_t *pass_starts, int64_t n_passes,
                           const int64_t *near_starts, const int32_t *near, int32_t *values) {
    coder f = {.n_places = n_columns, .n_passes = n_passes};
    f.pass_starts = pass_starts;
    f.columns = columns;
    enum reel_code code = prepare(&f, memory, memory_size, near_starts, near);
    if (code) {
        return reel_failure(code, 0);
    }
    reel_port port = reel_reader(in, size);
    reel_zero(values, (size_t)(n_wanted * n_columns) * sizeof *values);
    code_rows(&port, &f, values, n_wanted);
    return n_wanted < n_rows ? (int64_t)size : reel_end(&port);
}
