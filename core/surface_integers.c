/* Integers on a surface: frames of a table whose rows are the vertices of triangles. Each row is
   predicted from earlier rows around it, with weights that the encoder may fit. A frame is coded
   directly, or as its difference from a prediction by previous frames. Where parts of a mesh
   repeat, residuals are copied from the earlier part. docs/format.md, "Integers on a surface". */

#include "symbols.h"

#define N_CLASSES 3 /* classes of rows: with 1, 2, or more parallelograms */
#define N_WEIGHTS (2 * N_CLASSES)
#define ONE 4096.0 /* a weight of 1 in fixed point */
#define MAX_WEIGHT 32767.0
#define PRIOR 1e-6                  /* regularization of the fit, relative to the sums of squares */
#define N_FITS 3                    /* iterations of the weight fit; see fit_weights */
#define MAX_PREDICTION 1073741824.0 /* 2^30: residuals of allowed values fit into 31 bits */
#define MAX_COLUMNS REEL_MAX_SURFACE_COLUMNS
#define LANES 4                     /* columns in a group, which is processed as a vector */
#define N_CONTEXT 4                 /* rows around a row whose residuals are the context */
#define LARGEST 4095                /* magnitudes of residuals are clipped to this in contexts */
#define N_SIZES 29                  /* classes of the expected magnitude, two per octave */
#define N_VOTES (2 * N_CONTEXT + 1) /* possible sums of N_CONTEXT signs */
#define N_RUNS 16                   /* classes of run lengths of copies: 0, 1, ..., 15 or more */
#define LIKELY_RUN 2                /* run length from which another copy is probable initially */
#define MAX_HASH_BITS 15            /* bits of the hash of the last residuals of a column */
#define N_CANDIDATES 5              /* predictions to select from: see predict_group */
#define N_CONTEXTS (3 * N_CLASSES)  /* contexts of the selection: see find_neighbors */
#define N_SAMPLED_ROWS 2048         /* rows that the encoder samples to choose a frame's kind */
#define N_TRIAL_ROWS 4096           /* rows that it encodes to make the choices of a kind */
#define LONG_TOKEN 15               /* token of all magnitudes of at least LONG */
#define LONG 192

/* Flags that the encoder chooses for each kind of frame. */
enum {
    FITTED = 1,     /* fitted weights are stored; otherwise parallelograms predict by their mean */
    BEST = 2,       /* predict by the candidate with the least error so far */
    COPIES = 4,     /* a bit before a residual may state that it copies an earlier one */
    BY_CONTEXT = 8, /* measure the errors of the candidates separately in each context */
    N_CHOICES = 4   /* bits of these flags */
};

/* How a frame is coded: it repeats the previous one; directly; as the difference from the previous
   one; or as the difference from the linear extrapolation of the previous two. */
enum { SAME, DIRECT, CHANGE, EXTRAPOLATED, N_KINDS };

typedef int32_t vec4i __attribute__((vector_size(4 * LANES), may_alias));
typedef uint32_t vec4u __attribute__((vector_size(4 * LANES), may_alias));
typedef int64_t vec4l __attribute__((vector_size(8 * LANES), aligned(16), may_alias));
typedef double vec4d __attribute__((vector_size(8 * LANES), aligned(16), may_alias));

/* Rows that predict a row as a + b - c: a and b are the ends of the half-edge opposite to the row
   in one of its triangles, and c is the vertex across this half-edge. */
typedef struct {
    int32_t a, b, c;
} parallelogram;

typedef struct {
    reel_symbol_model token[N_SIZES]; /* token of a magnitude, by its expected magnitude */
    reel_symbol_model long_token;     /* bits of a magnitude of at least LONG */
    reel_model negative[N_VOTES];     /* sign of a residual, by the sum of the signs around it */
    /* Whether a residual is a copy, by three contexts: the previous answer in the row (0: none,
       1: yes, 2: no), whether the copied value is 0, and the length of the run. */
    reel_model copy[3][2][N_RUNS];
} residual_models;

/* Copy source of a column: the residuals that followed the last few when they last occurred. */
typedef struct {
    uint32_t hash; /* hash of the last few residuals */
    int32_t next;  /* row, counted through all frames, of the next residual to copy; 0: none */
    int32_t run;   /* number of residuals copied without a break, at most N_RUNS - 1 */
} copy_source;

/* Parameters and adaptive state that the frames of a kind share. */
typedef struct {
    bool is_started; /* whether a frame of this kind was coded */
    uint32_t choices;
    double weights[N_WEIGHTS];
    residual_models models;
    int32_t recent[MAX_COLUMNS]; /* moving average of the magnitudes in each column, times 48 */
    /* Moving averages of the errors of the candidates in each context, times 64. */
    vec4i errors[N_CONTEXTS][MAX_COLUMNS / LANES][N_CANDIDATES];
} kind_state;

typedef struct {
    int64_t n_frames, n_rows, n_columns, n_groups, n_faces;
    const int32_t *faces, *twins; /* rows of each triangle; opposite half-edge of each half-edge */
    /* corners[starts[i]..starts[i + 1] - 1]: the corners, as 4 * face + corner, at which row i is
       the latest of its triangle. */
    int32_t *starts, *corners;
    int32_t *seen_at; /* for each row, the last row that had it as a neighbor */
    int32_t n_around, n_parallelograms, context; /* counts and context of the current row */
    int32_t *around;                             /* earlier rows around it */
    parallelogram *parallelograms;
    vec4d *values;     /* values of the current frame: n_groups vectors per row */
    vec4i *residuals;  /* residuals of all frames in the same layout, clipped to LARGEST */
    int64_t first_row; /* index of the current frame's first row among the rows of all frames */
    kind_state *states, *state; /* state of each kind; that of the current frame */
    reel_model kind_models[N_KINDS][4]; /* bits of a kind, by the previous kind and the first bit */
    int hash_bits;
    int32_t *latest; /* for each column and hash, the row after its last occurrence; 0: none */
    copy_source sources[MAX_COLUMNS];
} surface_coder;

/* The row that is being coded, and statistics of its columns so far. */
typedef struct {
    const int32_t *input;   /* encoder: its values */
    int32_t *decoded;       /* decoder: memory of its values */
    int32_t mean_magnitude; /* moving average of the magnitudes of residuals */
    int copy_answer;        /* last answer of code_copy: 0: none yet, 1: yes, 2: no */
} current_row;

/* Means of neighbors of a row, for a group of columns: of a and b and of c of its parallelograms,
   and of all earlier rows around it. */
typedef struct {
    vec4d near, opposite, around;
} row_means;

/* Candidate predictions of a group of columns, and the average error of the selected one. */
typedef struct {
    vec4i values[N_CANDIDATES], error;
} candidates;

/* ---- neighbors ---- */

static bool has_valid_faces(const surface_coder *coder) {
    bool valid = true;
    for (int64_t i = 0; i < 3 * coder->n_faces; i++) {
        valid &= (uint32_t)coder->faces[i] < coder->n_rows;
    }
    return valid;
}

/* Return the corner 0..2 of a face that has the highest row. */
REEL_INLINE int32_t latest_corner(const int32_t *face) {
    int32_t latest = face[1] > face[0];
    return face[2] > face[latest] ? 2 : latest;
}

/* Fill `starts` and `corners`: a counting sort of the faces by their highest row. */
static void sort_faces(surface_coder *coder) {
    int32_t *ends = coder->starts + 1;
    reel_zero(coder->starts, ((size_t)coder->n_rows + 2) * sizeof *coder->starts);
    for (int32_t i = 0; i < coder->n_faces; i++) {
        const int32_t *face = coder->faces + 3 * (int64_t)i;
        ends[face[latest_corner(face)] + 1]++;
    }
    reel_prefix_sum(ends, coder->n_rows);
    for (int32_t i = 0; i < coder->n_faces; i++) {
        const int32_t *face = coder->faces + 3 * (int64_t)i;
        int32_t latest = latest_corner(face);
        coder->corners[ends[face[latest]]++] = 4 * i + latest;
    }
}

/* Prepare find_neighbors for the rows of a frame. */
static void start_rows(surface_coder *coder) {
    for (int64_t i = 0; i < coder->n_rows; i++) {
        coder->seen_at[i] = -1;
    }
}

/* Return the class of the current row by its number of parallelograms; -1 if it has none. */
REEL_INLINE int class_of(const surface_coder *coder) {
    int32_t n = coder->n_parallelograms;
    return n < N_CLASSES ? n - 1 : N_CLASSES - 1;
}

/* Find the earlier rows around a row, its parallelograms, and its context: its class, and whether a
   or b of the first parallelogram is the previous row. In a regular mesh the context determines
   which candidate predicts well. */
REEL_INLINE void find_neighbors(surface_coder *coder, int32_t row) {
    static const int8_t after[] = {1, 2, 0}, before[] = {2, 0, 1};
    int32_t n_around = 0, n_parallelograms = 0;
    for (int32_t i = coder->starts[row]; i < coder->starts[row + 1]; i++) {
        int32_t first = coder->corners[i] / 4 * 3, corner = coder->corners[i] & 3;
        int32_t he = first + after[corner], twin = coder->twins[he];
        int32_t a = coder->faces[he], b = coder->faces[first + before[corner]];
        int32_t c = coder->faces[twin % 3 ? twin - 1 : twin + 2];
        if (a == b || a == row || b == row) {
            continue;
        }
        coder->around[n_around] = a;
        n_around += coder->seen_at[a] != row;
        coder->seen_at[a] = row;
        coder->around[n_around] = b;
        n_around += coder->seen_at[b] != row;
        coder->seen_at[b] = row;
        coder->parallelograms[n_parallelograms] = (parallelogram){a, b, c};
        n_parallelograms += (twin != he) & (c < row);
    }
    coder->n_around = n_around;
    coder->n_parallelograms = n_parallelograms;
    coder->context = 0;
    if (n_parallelograms && coder->state->choices & BY_CONTEXT) {
        const parallelogram *first_shape = coder->parallelograms;
        int32_t end = first_shape->a == row - 1 ? 1 : first_shape->b == row - 1 ? 2 : 0;
        coder->context = class_of(coder) + N_CLASSES * end;
    }
}

/* Initialize the models. Those of tokens are geometric distributions whose mean is the expected
   magnitude: the probability of magnitudes >= i is the i-th power of that of magnitudes >= 1. */
static void start_models(residual_models *models) {
    for (uint32_t class = 0; class < N_SIZES; class++) {
        uint32_t middle = (80 + 32 * (class & 1U)) << (class / 2), tail[REEL_SYMBOLS];
        tail[0] = 65536;
        tail[1] = (uint32_t)(((uint64_t)(middle - 72) << 16) / (middle + 216));
        tail[2] = (uint32_t)((uint64_t)tail[1] * tail[1] >> 16);
        tail[3] = (uint32_t)((uint64_t)tail[1] * tail[2] >> 16);
        for (int i = 4; i < REEL_SYMBOLS; i++) {
            tail[i] = (uint32_t)((uint64_t)tail[i - 2] * tail[i - 2] >> 16);
        }
        reel_symbol_model *model = &models->token[class];
        for (uint32_t i = 0; i < REEL_SYMBOLS; i++) {
            uint32_t below = REEL_SYMBOL_ONE - (tail[i] >> 1);
            uint32_t free = REEL_SYMBOL_ONE - REEL_SYMBOLS * REEL_MIN_SYMBOL;
            model->below[i] = (int16_t)((below * free >> REEL_SYMBOL_BITS) + i * REEL_MIN_SYMBOL);
        }
        model->count = 16;
    }
    models->long_token = reel_new_symbol_model();
    for (int i = 0; i < N_VOTES; i++) {
        models->negative[i] = reel_model_of(32768, 8);
    }
    for (int run = 0; run < N_RUNS; run++) {
        reel_model model = reel_model_of(run < LIKELY_RUN ? 32768 : 60000, 2);
        for (int context = 0; context < 3; context++) {
            models->copy[context][0][run] = models->copy[context][1][run] = model;
        }
    }
}

static void allocate_coder(surface_coder *coder, reel_arena *arena) {
    size_t rows = (size_t)coder->n_rows, faces = (size_t)coder->n_faces;
    coder->n_groups = (coder->n_columns + LANES - 1) / LANES;
    size_t groups = (size_t)coder->n_groups * rows;
    coder->starts = reel_allocate(arena, rows + 2, sizeof *coder->starts);
    coder->seen_at = reel_allocate(arena, rows, sizeof *coder->seen_at);
    coder->corners = reel_allocate(arena, faces, sizeof *coder->corners);
    coder->around = reel_allocate(arena, 2 * faces + 1, sizeof *coder->around);
    coder->parallelograms = reel_allocate(arena, faces + 1, sizeof *coder->parallelograms);
    coder->values = reel_allocate(arena, groups, sizeof *coder->values);
    coder->residuals =
        reel_allocate(arena, (size_t)coder->n_frames * groups, sizeof *coder->residuals);
    coder->states = reel_allocate(arena, N_KINDS, sizeof *coder->states);
    int bits = reel_bit_length((uint32_t)(coder->n_frames * coder->n_rows)) + 3;
    coder->hash_bits = bits < MAX_HASH_BITS ? bits : MAX_HASH_BITS;
    size_t n_hashes = (size_t)coder->n_columns << coder->hash_bits;
    coder->latest = reel_allocate(arena, n_hashes, sizeof *coder->latest);
}

/* Initialize the adaptive state of a kind; choices and weights remain. */
static void start_kind(kind_state *state) {
    start_models(&state->models);
    for (int k = 0; k < MAX_COLUMNS; k++) {
        state->recent[k] = 48;
    }
    reel_zero(state->errors, sizeof state->errors);
}

/* Initialize the state that the frames of all kinds share. */
static void start_frames(surface_coder *coder) {
    coder->first_row = 0;
    size_t n_hashes = (size_t)coder->n_columns << coder->hash_bits;
    reel_zero(coder->latest, n_hashes * sizeof *coder->latest);
    for (int i = 0; i < 4 * N_KINDS; i++) {
        coder->kind_models[i / 4][i % 4] = reel_model_of(32768, 0);
    }
}

/* Compute the means of a group of columns; the current row must have a parallelogram. */
REEL_INLINE void find_means(const surface_coder *coder, int64_t group, int64_t n_groups,
                            row_means *means) {
    const vec4d *rows = coder->values + group;
    vec4d near = {0}, opposite = {0}, around = {0};
    for (int32_t i = 0; i < coder->n_parallelograms; i++) {
        const parallelogram *shape = &coder->parallelograms[i];
        near += rows[shape->a * n_groups] + rows[shape->b * n_groups];
        opposite += rows[shape->c * n_groups];
    }
    for (int32_t i = 0; i < coder->n_around; i++) {
        around += rows[coder->around[i] * n_groups];
    }
    double share = 1.0 / (double)coder->n_parallelograms;
    means->near = near * (0.5 * share);
    means->opposite = opposite * share;
    means->around = around * (1.0 / (double)coder->n_around);
}

REEL_INLINE void limit_group(vec4d *values, double limit) {
    const vec4d limits = {limit, limit, limit, limit};
    vec4l is_less = *values < limits;
    *values = (vec4d)(((vec4l)*values & is_less) | ((vec4l)limits & ~is_less));
}

/* Round to integers, halves away from 0, and clip the magnitudes to MAX_PREDICTION. */
REEL_INLINE vec4i round_group(vec4d value) {
    const vec4d half = {0.5, 0.5, 0.5, 0.5};
    vec4l sign = (vec4l)value & INT64_MIN;
    vec4d size = (vec4d)((vec4l)value ^ sign);
    limit_group(&size, MAX_PREDICTION);
    size += half;
    return __builtin_convertvector((vec4d)((vec4l)size | sign), vec4i);
}

/* Return lanes of `first` where the mask is set, and of `second` elsewhere. */
REEL_INLINE vec4i select_group(vec4i is_first, vec4i first, vec4i second) {
    return (first & is_first) | (second & ~is_first);
}

/* Return a + b - c of a parallelogram. */
REEL_INLINE vec4i complete(const vec4d *rows, const parallelogram *shape, int64_t n_groups) {
    return round_group(rows[shape->a * n_groups] + rows[shape->b * n_groups] -
                       rows[shape->c * n_groups]);
}

/* Predict a group of columns of the current row. Without parallelograms, its first neighbor
   predicts, or the previous row. Otherwise the weighted means do; with BEST, they are one of five
   candidates: the first and the last parallelogram, the weighted means, and two neighbors. */
REEL_INLINE vec4i predict_group(const surface_coder *coder, int64_t row, int64_t group,
                                int64_t n_groups, candidates *candidate_set) {
    int class = class_of(coder);
    const vec4d *rows = coder->values + group;
    if (class < 0) {
        int64_t neighbor = coder->n_around ? coder->around[0] : row - 1;
        vec4d values = {0};
        return __builtin_convertvector(neighbor < 0 ? values : rows[neighbor * n_groups], vec4i);
    }
    double f = coder->state->weights[2 * class], g = coder->state->weights[2 * class + 1];
    row_means means;
    find_means(coder, group, n_groups, &means);
    vec4d near = means.near;
    vec4i mean = round_group(near + (f * (near - means.opposite) + g * (means.around - near)));
    if (!(coder->state->choices & BEST)) {
        return mean;
    }
    const vec4i *errors = coder->state->errors[coder->context][group];
    vec4i *values = candidate_set->values;
    values[0] = complete(rows, coder->parallelograms, n_groups);
    values[1] = complete(rows, &coder->parallelograms[coder->n_parallelograms - 1], n_groups);
    values[2] = mean;
    values[3] = __builtin_convertvector(rows[coder->around[0] * n_groups], vec4i);
    values[4] = __builtin_convertvector(rows[coder->around[1] * n_groups], vec4i);
    vec4i best = values[0];
    candidate_set->error = errors[0];
    for (int i = 1; i < N_CANDIDATES; i++) {
        vec4i is_better = errors[i] < candidate_set->error;
        best = select_group(is_better, values[i], best);
        candidate_set->error = select_group(is_better, errors[i], candidate_set->error);
    }
    return best;
}

/* Update the average errors of the candidates with the actual values. */
REEL_INLINE void compare_candidates(surface_coder *coder, int64_t group,
                                    const candidates *candidate_set, vec4i actual) {
    const vec4i largest = {LARGEST, LARGEST, LARGEST, LARGEST};
    for (int i = 0; i < N_CANDIDATES; i++) {
        vec4i *error = &coder->state->errors[coder->context][group][i];
        vec4i size = (vec4i)((vec4u)actual - (vec4u)candidate_set->values[i]);
        vec4i is_negative = size < 0; /* -1 if true */
        size = (vec4i)((vec4u)(size ^ is_negative) - (vec4u)is_negative);
        size = select_group((size < largest) & (size >= 0), size, largest);
        *error += (64 * size - *error) >> 2;
    }
}

/* Return the mean absolute deviation of the parallelograms, at least one, from the prediction of
   each column, times 48. */
REEL_INLINE vec4i mean_deviation(const surface_coder *coder, int64_t group, int64_t n_groups,
                                 vec4i predicted) {
    const vec4d *rows = coder->values + group;
    vec4d prediction = __builtin_convertvector(predicted, vec4d), sum = {0};
    for (int32_t i = 0; i < coder->n_parallelograms; i++) {
        const parallelogram *shape = &coder->parallelograms[i];
        vec4d difference = rows[shape->a * n_groups] + rows[shape->b * n_groups] -
                           rows[shape->c * n_groups] - prediction;
        sum += (vec4d)((vec4l)difference & INT64_MAX);
    }
    sum *= 48.0 / (double)coder->n_parallelograms;
    limit_group(&sum, 48.0 * LARGEST);
    return __builtin_convertvector(sum, vec4i);
}

/* ---- residuals ---- */

/* Code a magnitude of 0..2^31-1; `size` is the class of its expected value. */
REEL_INLINE uint32_t code_magnitude(reel_range_coder *coder, residual_models *models, int size,
                                    uint32_t magnitude) {
    int token = 0, length = reel_bit_length(magnitude);
    if (reel_is_encoder(coder)) {
        token = magnitude < 4      ? (int)magnitude
                : magnitude < LONG ? 2 * (length - 1) + (int)(magnitude >> (length - 2) & 1U)
                                   : LONG_TOKEN;
    }
    token = reel_code_symbol(coder, &models->token[size], token);
    if (token < 4) {
        return (uint32_t)token;
    }
    if (token < LONG_TOKEN) {
        int n_raw = token / 2 - 1;
        return (2U | (token & 1U)) << n_raw | reel_code_raw(coder, n_raw, magnitude);
    }
    uint32_t extra = magnitude - (LONG - 1);
    length = reel_bit_length(extra) - 1;
    token = reel_code_symbol(coder, &models->long_token, length < LONG_TOKEN ? length : LONG_TOKEN);
    if (token == LONG_TOKEN) {
        length = LONG_TOKEN + (int)reel_code_raw(coder, 4, (uint32_t)(length - LONG_TOKEN));
        uint32_t high = reel_code_raw(coder, 15, extra >> (length - 15));
        extra = 1U << 15 | high;
        extra = extra << (length - 15) | reel_code_raw(coder, length - 15, magnitude - (LONG - 1));
    } else {
        extra = 1U << token | reel_code_raw(coder, token, extra);
    }
    return extra + (LONG - 1);
}

/* Code a residual. `size` is the class of its expected magnitude, `votes` the sum of the signs of
   the residuals around it. */
REEL_INLINE int32_t code_residual(reel_range_coder *coder, residual_models *models, int size,
                                  int votes, int32_t residual) {
    uint32_t magnitude = residual < 0 ? 0U - (uint32_t)residual : (uint32_t)residual;
    magnitude = code_magnitude(coder, models, size, magnitude);
    uint32_t negative = 0;
    if (magnitude) {
        reel_model *model = &models->negative[votes + N_CONTEXT];
        negative = 0U - (uint32_t)reel_even_bit(coder, model, residual < 0);
    }
    return (int32_t)((magnitude ^ negative) - negative);
}

/* Code whether a residual equals its copy source, and set it if so. */
REEL_INLINE bool code_copy(reel_range_coder *range_coder, const surface_coder *coder,
                           int32_t source, int run, current_row *row, int32_t *residual) {
    reel_model *model = &coder->state->models.copy[row->copy_answer][source == 0][run];
    bool is_copy = reel_even_bit(range_coder, model, *residual == source);
    row->copy_answer = is_copy ? 1 : 2;
    *residual = is_copy ? source : *residual;
    return is_copy;
}

/* Update the copy source of a column after the residual of a row: it advances after a copy;
   otherwise it becomes the residual that followed the last occurrence of the same hash. */
REEL_INLINE void find_source(surface_coder *coder, int64_t row, int64_t column, int32_t residual,
                             bool is_copy) {
    copy_source *source = &coder->sources[column];
    uint32_t mixed = (uint32_t)residual * 0x9E3779B1U >> (32 - MAX_HASH_BITS);
    source->hash = (64 * source->hash + mixed) & ((1U << coder->hash_bits) - 1);
    int32_t *latest = &coder->latest[((uint32_t)column << coder->hash_bits) + source->hash];
    source->run = is_copy ? source->run + (source->run < N_RUNS - 1) : 0;
    source->next = is_copy ? source->next + 1 : *latest;
    *latest = (int32_t)(coder->first_row + row) + 1;
}

/* Residuals of the first n rows around a row: sums of their magnitudes and of their signs. */
typedef struct {
    vec4i sizes, signs;
    int32_t n;
} near_residuals;

REEL_INLINE near_residuals sum_near(const surface_coder *coder, int64_t group, int64_t n_groups) {
    near_residuals near = {.n = coder->n_around < N_CONTEXT ? coder->n_around : N_CONTEXT};
    const vec4i *residuals_of_frame = coder->residuals + coder->first_row * n_groups + group;
    for (int32_t i = 0; i < near.n; i++) {
        vec4i residuals = residuals_of_frame[coder->around[i] * n_groups];
        vec4i is_negative = residuals < 0; /* -1 if true */
        near.sizes += (residuals ^ is_negative) - is_negative;
        near.signs += is_negative - (residuals > 0);
    }
    return near;
}

/* Code a group of columns of a row. The models of a residual depend on its expected magnitude: a
   weighted sum of how much the parallelograms differ, or else of the residuals around; of the
   errors of the selected candidate, or else of the residuals of the column; and of the residuals in
   earlier columns of the row. */
REEL_INLINE void code_columns(reel_range_coder *range_coder, surface_coder *coder, current_row *row,
                              int64_t index, int64_t group, int64_t n_groups, int64_t n_columns) {
    static const int32_t shares[N_CONTEXT + 1] = {0, 48, 24, 16, 12}; /* 48 / number of rows */
    int32_t value[LANES] = {0}, clipped[LANES] = {0};
    candidates candidate_set = {0};
    vec4i predicted = predict_group(coder, index, group, n_groups, &candidate_set);
    near_residuals near = sum_near(coder, group, n_groups);
    bool has_deviation = coder->n_parallelograms != 0;
    bool has_candidates = has_deviation && coder->state->choices & BEST;
    vec4i deviation = {0};
    if (has_deviation) {
        deviation = mean_deviation(coder, group, n_groups, predicted);
    }
    for (int k = 0; k < LANES && LANES * group + k < n_columns; k++) {
        int64_t column = LANES * group + k;
        int32_t *recent = &coder->state->recent[column];
        int32_t mean = near.n ? near.sizes[k] * shares[near.n] : *recent;
        int32_t earlier = has_candidates ? 3 * candidate_set.error[k] >> 2 : *recent;
        int32_t sum = 2 * (has_deviation ? deviation[k] : mean) + 2 * earlier + 72;
        float expected = (float)(sum + (column ? mean + 48 * row->mean_magnitude : 2 * mean));
        int32_t bits;
        __builtin_memcpy(&bits, &expected, sizeof bits);
        int size = (bits >> 22) - 2 * (127 + 6); /* half octaves above 64 */
        int32_t residual = 0;
        if (reel_is_encoder(range_coder)) {
            residual = (int32_t)((uint32_t)row->input[column] - (uint32_t)predicted[k]);
        }
        const copy_source *copied = &coder->sources[column];
        bool is_copy = false;
        if (copied->next) {
            int32_t source = coder->residuals[copied->next * n_groups + group][k];
            is_copy = code_copy(range_coder, coder, source, copied->run, row, &residual);
        }
        if (!is_copy) {
            residual =
                code_residual(range_coder, &coder->state->models, size, near.signs[k], residual);
        }
        value[k] = (int32_t)((uint32_t)predicted[k] + (uint32_t)residual);
        if (!reel_is_encoder(range_coder)) {
            row->decoded[column] = value[k];
        }
        residual = residual < LARGEST ? residual : LARGEST;
        residual = residual > -LARGEST ? residual : -LARGEST;
        clipped[k] = residual;
        if (coder->state->choices & COPIES) {
            find_source(coder, index, column, residual, is_copy);
        }
        int32_t magnitude = residual < 0 ? -residual : residual;
        *recent += (48 * magnitude - *recent) >> 3;
        row->mean_magnitude = column ? (row->mean_magnitude + magnitude) >> 1 : magnitude;
    }
    vec4i values = {value[0], value[1], value[2], value[3]};
    if (has_candidates) {
        compare_candidates(coder, group, &candidate_set, values);
    }
    coder->values[index * n_groups + group] = __builtin_convertvector(values, vec4d);
    coder->residuals[(coder->first_row + index) * n_groups + group] =
        (vec4i){clipped[0], clipped[1], clipped[2], clipped[3]};
}

/* Code all rows of a frame: `input` in the encoder, `decoded` in the decoder; the other is NULL. */
REEL_INLINE void code_rows(reel_range_coder *range_coder, surface_coder *coder, int64_t n_groups,
                           int64_t n_columns, const int32_t *input, int32_t *decoded) {
    for (int64_t index = 0; index < coder->n_rows; index++) {
        current_row row = {.input = input, .decoded = decoded};
        find_neighbors(coder, (int32_t)index);
        for (int64_t group = 0; group < n_groups; group++) {
            code_columns(range_coder, coder, &row, index, group, n_groups, n_columns);
        }
        input = input ? input + n_columns : NULL; /* NULL + 0 is undefined */
        decoded = decoded ? decoded + n_columns : NULL;
    }
}

/* Code a frame that is not SAME, as its difference from the prediction by previous frames. */
static void code_frame(reel_range_coder *range_coder, surface_coder *coder, const int32_t *input,
                       int32_t *decoded) {
    start_rows(coder);
    reel_zero(coder->sources, sizeof coder->sources);
    if (coder->n_columns == 3) { /* positions: constants make the common case faster */
        code_rows(range_coder, coder, 1, 3, input, decoded);
    } else {
        code_rows(range_coder, coder, coder->n_groups, coder->n_columns, input, decoded);
    }
}

/* ---- weights ---- */

/* Normal equations of a least-squares fit of z by weights of x and y: sums of products. */
typedef struct {
    double xx, xy, yy, xz, yz;
} fit_sums;

/* Round a weight to the stored fixed point, in its range. */
static double to_weight(double value) {
    value = value * ONE;
    value = value < MAX_WEIGHT ? value : MAX_WEIGHT;
    value = value > -MAX_WEIGHT ? value : -MAX_WEIGHT;
    return (double)(int32_t)(value + (value < 0 ? -0.5 : 0.5)) / ONE;
}

/* Solve for two weights. A small regularization pulls them to 1 and 0, the parallelogram rule,
   where the rows do not determine them. */
static void solve(const fit_sums *sums, double weights[2]) {
    double prior = 1.0 + PRIOR * (sums->xx + sums->yy);
    double xx = sums->xx + prior, yy = sums->yy + prior, xz = sums->xz + prior;
    double determinant = xx * yy - sums->xy * sums->xy;
    weights[0] = to_weight((yy * xz - sums->xy * sums->yz) / determinant);
    weights[1] = to_weight((xx * sums->yz - sums->xy * xz) / determinant);
}

/* Add a group of columns of the current row to the normal equations. A robust fit divides each
   term by 1 + the magnitude of its residual. */
static void add_to_fit(const surface_coder *coder, int64_t row, int64_t group, bool is_robust,
                       fit_sums *sums) {
    const double *weights = coder->state->weights + 2 * class_of(coder);
    vec4d actual = coder->values[row * coder->n_groups + group];
    row_means means;
    find_means(coder, group, coder->n_groups, &means);
    for (int k = 0; k < LANES; k++) {
        double x = means.near[k] - means.opposite[k], y = means.around[k] - means.near[k],
               z = actual[k] - means.near[k];
        double residual = z - (weights[0] * x + weights[1] * y);
        double share = is_robust ? 1.0 / (1.0 + (residual < 0 ? -residual : residual)) : 1.0;
        sums->xx += share * x * x;
        sums->xy += share * x * y;
        sums->yy += share * y * y;
        sums->xz += share * x * z;
        sums->yz += share * y * z;
    }
}

/* Fit the weights of each class to a frame: by least squares, then by iteratively reweighted least
   squares, which approximate least absolute residuals, so that few large ones do not dominate. */
static void fit_weights(surface_coder *coder, const int32_t *values) {
    for (int64_t i = 0; i < coder->n_rows * coder->n_groups; i++) {
        int64_t row = i / coder->n_groups, first = LANES * (i % coder->n_groups);
        for (int64_t k = 0; k < LANES; k++) {
            bool is_column = first + k < coder->n_columns;
            coder->values[i][k] =
                is_column ? (double)values[row * coder->n_columns + first + k] : 0.0;
        }
    }
    for (int n = 0; n < N_FITS; n++) {
        fit_sums sums[N_CLASSES] = {0};
        start_rows(coder);
        for (int64_t row = 0; row < coder->n_rows; row++) {
            find_neighbors(coder, (int32_t)row);
            int class = class_of(coder);
            for (int64_t group = 0; class >= 0 && group < coder->n_groups; group++) {
                add_to_fit(coder, row, group, n > 0, &sums[class]);
            }
        }
        for (int class = 0; class < N_CLASSES; class++) {
            solve(&sums[class], coder->state->weights + 2 * class);
        }
    }
}

/* Code the choices of a kind, and its weights if they are fitted. */
static void code_head(reel_range_coder *range_coder, kind_state *state) {
    state->choices = reel_code_raw(range_coder, N_CHOICES, state->choices);
    for (int i = 0; i < N_WEIGHTS; i++) {
        double *weight = &state->weights[i];
        if (state->choices & FITTED) {
            uint32_t bits = (uint32_t)(int32_t)(*weight * ONE);
            *weight = (double)(int16_t)reel_code_raw(range_coder, 16, bits) / ONE;
        } else {
            *weight = i & 1 ? 0.0 : 1.0;
        }
    }
}

/* ---- frames ---- */

static size_t n_values(const surface_coder *coder) {
    return (size_t)(coder->n_rows * coder->n_columns);
}

/* Predict value i of a frame from the previous frames, which precede it in memory; modulo 2^32. */
static uint32_t predicted_value(const surface_coder *coder, int kind, const int32_t *frame,
                                size_t i) {
    if (kind == DIRECT) {
        return 0;
    }
    const int32_t *previous = frame - n_values(coder);
    uint32_t value = (uint32_t)previous[i];
    return kind == EXTRAPOLATED ? 2 * value - (uint32_t)(previous - n_values(coder))[i] : value;
}

static void subtract_prediction(const surface_coder *coder, int kind, const int32_t *frame,
                                int32_t *difference) {
    for (size_t i = 0; i < n_values(coder); i++) {
        uint32_t predicted = predicted_value(coder, kind, frame, i);
        difference[i] = (int32_t)((uint32_t)frame[i] - predicted);
    }
}

/* Code the kind of a frame with two bits. */
static int code_kind(reel_range_coder *range_coder, surface_coder *coder, int previous, int kind) {
    reel_model *models = coder->kind_models[previous];
    int high = reel_bit(range_coder, &models[1], kind >> 1);
    return 2 * high + (int)reel_bit(range_coder, &models[2 + high], kind & 1);
}

/* Code all frames. The encoder passes their values, a buffer for the differences of one frame, and
   the kind of each frame; the choices and weights of these kinds are set. The decoder passes
   `decoded` instead. Return false if it reads that the second frame is extrapolated. */
static bool code_frames(reel_range_coder *range_coder, surface_coder *coder, const int32_t *input,
                        int32_t *difference, const uint8_t *kinds, int32_t *decoded) {
    start_frames(coder);
    for (int kind = 0, t = 0; t < coder->n_frames; t++) {
        size_t n = n_values(coder), offset = n * (size_t)t;
        kind = t ? code_kind(range_coder, coder, kind, kinds ? kinds[t] : 0) : DIRECT;
        if (kind == EXTRAPOLATED && t < 2) {
            return false;
        }
        coder->first_row = t * coder->n_rows;
        coder->state = &coder->states[kind];
        if (kind != SAME && !coder->state->is_started) {
            code_head(range_coder, coder->state);
            start_kind(coder->state);
            coder->state->is_started = true;
        }
        if (kind == SAME) {
            reel_zero(coder->residuals + coder->first_row * coder->n_groups,
                      (size_t)(coder->n_rows * coder->n_groups) * sizeof *coder->residuals);
        } else if (input) {
            subtract_prediction(coder, kind, input + offset, difference);
            code_frame(range_coder, coder, difference, NULL);
        } else {
            code_frame(range_coder, coder, NULL, decoded + offset);
        }
        for (size_t i = 0; decoded && kind != DIRECT && i < n; i++) {
            uint32_t predicted = predicted_value(coder, kind, decoded + offset, i);
            uint32_t value = kind == SAME ? 0U : (uint32_t)decoded[offset + i];
            decoded[offset + i] = (int32_t)(predicted + value);
        }
    }
    return true;
}

/* ---- encoder ---- */

/* Return the number of bits of the magnitude of an int32. */
static int size_of(uint32_t value) {
    return reel_bit_length(value & 0x80000000U ? 0U - value : value);
}

/* Choose the kind of a frame after the first. Sum the bits of two simple residuals at sampled rows,
   from a neighbor and from a parallelogram, and return the kind with the smallest sum of either. */
static int choose_kind(surface_coder *coder, const int32_t *frame, bool can_extrapolate) {
    int n_kinds = can_extrapolate ? N_KINDS : EXTRAPOLATED;
    int64_t costs[N_KINDS][2] = {0}, n = coder->n_columns;
    start_rows(coder);
    for (int64_t row = 0; row < coder->n_rows; row += 1 + coder->n_rows / N_SAMPLED_ROWS) {
        find_neighbors(coder, (int32_t)row);
        int64_t neighbor = coder->n_around ? coder->around[0] : row ? row - 1 : row;
        const parallelogram *shape = coder->n_parallelograms ? coder->parallelograms : NULL;
        int64_t rows[] = {row, neighbor, 0, 0};
        if (shape) {
            rows[1] = shape->a, rows[2] = shape->b, rows[3] = shape->c;
        }
        for (int64_t i = n * DIRECT; i < n * n_kinds; i++) {
            int64_t kind = i / n, column = i % n;
            uint32_t values[4];
            for (int k = 0; k < (shape ? 4 : 2); k++) {
                size_t item = (size_t)(rows[k] * n + column);
                values[k] = (uint32_t)frame[item] - predicted_value(coder, (int)kind, frame, item);
            }
            int size = size_of(values[0] - values[1]);
            costs[kind][0] += size;
            costs[kind][1] += shape ? size_of(values[0] - values[1] - values[2] + values[3]) : size;
        }
    }
    int best = DIRECT;
    int64_t min_cost = INT64_MAX;
    for (int i = 2 * DIRECT; i < 2 * n_kinds; i++) {
        best = costs[i / 2][i % 2] < min_cost ? i / 2 : best;
        min_cost = costs[i / 2][i % 2] < min_cost ? costs[i / 2][i % 2] : min_cost;
    }
    return best;
}

/* Encode one frame with these choices, fitted weights if they are stored, and initial models.
   Return its size in bytes, or a negative number if it exceeds the capacity. */
static int64_t encoded_size(surface_coder *coder, uint32_t choices, const int32_t *values,
                            uint8_t *out, size_t capacity) {
    reel_range_coder range_coder = reel_start_encoder(out, capacity);
    coder->state->choices = choices;
    if (choices & FITTED) {
        fit_weights(coder, values);
    }
    start_frames(coder);
    code_head(&range_coder, coder->state);
    start_kind(coder->state);
    code_frame(&range_coder, coder, values, NULL);
    return reel_finish(&range_coder);
}

/* Set the choices and weights of the current kind to those with which a frame is smallest. For a
   table of several frames, only the first N_CHOSEN rows are encoded. */
static void set_flags(surface_coder *coder, const int32_t *values, uint8_t *out, size_t capacity) {
    /* Flip these flags in turn, and keep each change that saves bytes. */
    static const uint32_t changes[] = {BEST | BY_CONTEXT, COPIES, BY_CONTEXT, BEST, FITTED};
    int64_t n_rows = coder->n_rows;
    coder->n_rows = coder->n_frames > 1 && n_rows > N_TRIAL_ROWS ? N_TRIAL_ROWS : n_rows;
    uint32_t best = FITTED;
    int64_t smallest = encoded_size(coder, best, values, out, capacity);
    for (size_t i = 0; i < sizeof changes / sizeof *changes; i++) {
        int64_t size = encoded_size(coder, best ^ changes[i], values, out, capacity);
        if (size >= 0 && size < smallest) {
            smallest = size;
            best ^= changes[i];
        }
    }
    coder->state->choices = best;
    if (best & FITTED) {
        fit_weights(coder, values);
    }
    coder->n_rows = n_rows;
}

/* Choose the kind of each frame, and the choices and weights of each kind by its first frame. */
static void choose_kinds(surface_coder *coder, const int32_t *input, int32_t *difference,
                         uint8_t *kinds, uint8_t *out, size_t capacity) {
    size_t n = n_values(coder);
    bool has_choices[N_KINDS] = {0};
    for (int64_t t = 0; t < coder->n_frames; t++) {
        const int32_t *frame = input + (size_t)t * n;
        bool is_same = t > 0;
        for (size_t i = 0; is_same && i < n; i++) {
            is_same = frame[i] == (frame - n)[i];
        }
        kinds[t] = (uint8_t)(is_same ? SAME : t ? choose_kind(coder, frame, t > 1) : DIRECT);
        if (!is_same && !has_choices[kinds[t]]) {
            has_choices[kinds[t]] = true;
            subtract_prediction(coder, kinds[t], frame, difference);
            coder->state = &coder->states[kinds[t]];
            set_flags(coder, difference, out, capacity);
        }
    }
}

/* ---- tables ---- */

static surface_coder coder_of(int64_t n_frames, int64_t n_rows, int64_t n_columns,
                              const int32_t *faces, const int32_t *twins, int64_t n_faces) {
    return (surface_coder){.n_frames = n_frames,
                           .n_rows = n_rows,
                           .n_columns = n_columns,
                           .n_faces = n_faces,
                           .faces = faces,
                           .twins = twins};
}

/* Allocate the arrays of the encoder: the differences of a frame, and the kind of each frame. */
static void allocate_choices(const surface_coder *coder, reel_arena *arena, int32_t **difference,
                             uint8_t **kinds) {
    *difference = reel_allocate(arena, n_values(coder), sizeof **difference);
    *kinds = reel_allocate(arena, (size_t)coder->n_frames, sizeof **kinds);
}

size_t reel_surface_integers_memory(int64_t n_frames, int64_t n_rows, int64_t n_columns,
                                    int64_t n_faces, int64_t encodes) {
    surface_coder coder = coder_of(n_frames, n_rows, n_columns, NULL, NULL, n_faces);
    reel_arena arena = REEL_MEASURE;
    allocate_coder(&coder, &arena);
    int32_t *difference;
    uint8_t *kinds;
    if (encodes) {
        allocate_choices(&coder, &arena, &difference, &kinds);
    }
    return arena.used;
}

/* Check the faces, allocate memory, and sort the faces; returns 0 or a failure. */
static int64_t prepare(surface_coder *coder, reel_arena *arena) {
    if (coder->n_rows > INT32_MAX / coder->n_frames || !has_valid_faces(coder)) {
        return reel_failure(REEL_INVALID, 0);
    }
    allocate_coder(coder, arena);
    if (arena->failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    sort_faces(coder);
    for (int i = 0; i < N_KINDS; i++) {
        coder->states[i].is_started = false;
    }
    return 0;
}

int64_t reel_surface_integers_encode(void *memory, size_t memory_size, const int32_t *values,
                                     int64_t n_frames, int64_t n_rows, int64_t n_columns,
                                     const int32_t *faces, const int32_t *twins, int64_t n_faces,
                                     uint8_t *out, size_t capacity) {
    surface_coder coder = coder_of(n_frames, n_rows, n_columns, faces, twins, n_faces);
    reel_arena arena = reel_arena_of(memory, memory_size);
    int64_t failure = prepare(&coder, &arena);
    if (failure < 0) {
        return failure;
    }
    int32_t *difference;
    uint8_t *kinds;
    allocate_choices(&coder, &arena, &difference, &kinds);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t i = 0; i < n_frames * n_rows * n_columns; i++) {
        if (values[i] > REEL_MAX_SURFACE_VALUE || values[i] < -REEL_MAX_SURFACE_VALUE) {
            return reel_failure(REEL_INVALID, (uint64_t)i);
        }
    }
    choose_kinds(&coder, values, difference, kinds, out, capacity);
    reel_range_coder range_coder = reel_start_encoder(out, capacity);
    code_frames(&range_coder, &coder, values, difference, kinds, NULL);
    return reel_finish(&range_coder);
}

int64_t reel_surface_integers_decode(void *memory, size_t memory_size, const uint8_t *in,
                                     size_t size, int64_t n_frames, int64_t n_rows,
                                     int64_t n_columns, const int32_t *faces, const int32_t *twins,
                                     int64_t n_faces, int32_t *values) {
    surface_coder coder = coder_of(n_frames, n_rows, n_columns, faces, twins, n_faces);
    if (size && !in[size - 1]) {
        return reel_failure(REEL_CORRUPT, size - 1);
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
    int64_t failure = prepare(&coder, &arena);
    if (failure < 0) {
        return failure;
    }
    reel_range_coder range_coder = reel_start_decoder(in, size);
    return code_frames(&range_coder, &coder, NULL, NULL, NULL, values)
               ? reel_finish(&range_coder)
               : reel_failure(REEL_CORRUPT, range_coder.position);
}
