/* Integers on a surface: a table whose rows are the corners of triangles, each row predicted from
   earlier rows around it by weights that the encoder fits. docs/format.md, "Integers on a
   surface". */

#include "base.h"

#define N_CLASSES 3 /* of rows: with 1, 2, or more parallelograms */
#define N_WEIGHTS (2 * N_CLASSES)
#define ONE 4096.0 /* a weight of 1 in fixed point */
#define MAX_WEIGHT 32767.0
#define PRIOR 1e-6    /* of the weights, relative to the squared differences that they scale */
#define N_CONTEXT 4   /* context neighbors of a row */
#define MAX_PREDICTION 1073741824.0 /* 2^30: residuals of allowed values fit into 31 bits */
#define MAX_COLUMNS REEL_MAX_SURFACE_COLUMNS

_Static_assert(sizeof(int16_t) * N_WEIGHTS == REEL_SURFACE_HEAD, "see reel.h");

/* The rows next to those at both ends of a side, and opposite to it on both faces. */
typedef struct {
    int32_t a, b, c;
} parallelogram;

typedef struct {
    int64_t n_rows, n_columns, n_faces;
    const int32_t *faces, *twins;
    int32_t *around_starts, *around; /* the earlier rows around each row */
    int32_t *starts;                 /* where the parallelograms of each row begin */
    parallelogram *parallelograms;
    int32_t *columns, *near; /* coding order of the rows, which is theirs; context neighbors */
    int64_t *near_starts;
    int32_t *residuals; /* n_columns x n_rows */
    void *fields_memory;
    size_t fields_size;
    double weights[N_WEIGHTS];
} surface_coder;

/* The rows around a row, as means for each column: of the ends of the sides of its parallelograms,
   of the rows opposite to it, and of all. */
typedef struct {
    double near[MAX_COLUMNS], opposite[MAX_COLUMNS], around[MAX_COLUMNS];
} row_means;

size_t reel_surface_integers_memory(int64_t n_rows, int64_t n_faces, int64_t n_columns) {
    size_t rows = (size_t)n_rows, sides = 3 * (size_t)n_faces;
    return 2 * reel_array_bytes(rows + 2, sizeof(int32_t)) +
           reel_array_bytes(sides, sizeof(int32_t)) +
           reel_array_bytes(sides, sizeof(parallelogram)) +
           reel_array_bytes(rows, sizeof(int32_t)) +
           reel_array_bytes(N_CONTEXT * rows, sizeof(int32_t)) +
           reel_array_bytes(rows + 1, sizeof(int64_t)) +
           reel_array_bytes((size_t)n_columns * rows, sizeof(int32_t)) +
           reel_array_bytes(reel_fields_memory(n_rows, 1, N_CONTEXT * n_rows), 1);
}

static int32_t third_corner(const int32_t *faces, int32_t side) {
    return faces[side % 3 ? side - 1 : side + 2];
}

/* Whether the faces at a side form a parallelogram with a row later than all others; finds both. */
static bool find_parallelogram(const surface_coder *coder, int32_t side, int32_t *row,
                               parallelogram *result) {
    int32_t twin = coder->twins[side];
    int32_t a = coder->faces[side], b = coder->faces[side % 3 == 2 ? side - 2 : side + 1];
    int32_t c = third_corner(coder->faces, side), d = third_corner(coder->faces, twin);
    *row = c > d ? c : d;
    *result = (parallelogram){a, b, c > d ? d : c};
    return twin != side && c != d && *row > a && *row > b;
}

/* List the rows around each row, and its parallelograms: counted first, then stored. */
static void find_neighbors(surface_coder *coder) {
    int32_t *around_ends = coder->around_starts + 1, *ends = coder->starts + 1;
    size_t size = ((size_t)coder->n_rows + 2) * sizeof *ends;
    reel_zero(coder->around_starts, size);
    reel_zero(coder->starts, size);
    for (int pass = 0; pass < 2; pass++) {
        for (int32_t side = 0; side < 3 * coder->n_faces; side++) {
            int32_t a = coder->faces[side], row;
            int32_t b = coder->faces[side % 3 == 2 ? side - 2 : side + 1];
            parallelogram found;
            if (coder->twins[side] < side || a == b) {
                continue;
            }
            if (pass) {
                coder->around[around_ends[a > b ? a : b]++] = a > b ? b : a;
            } else {
                around_ends[(a > b ? a : b) + 1]++;
            }
            if (!find_parallelogram(coder, side, &row, &found)) {
                continue;
            }
            if (pass) {
                coder->parallelograms[ends[row]++] = found;
            } else {
                ends[row + 1]++;
            }
        }
        for (int64_t i = 0; !pass && i < coder->n_rows; i++) {
            around_ends[i + 1] += around_ends[i];
            ends[i + 1] += ends[i];
        }
    }
}

static bool prepare(surface_coder *coder, void *memory, size_t memory_size) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    size_t rows = (size_t)coder->n_rows, sides = 3 * (size_t)coder->n_faces;
    coder->around_starts = reel_allocate(&arena, rows + 2, sizeof *coder->around_starts);
    coder->starts = reel_allocate(&arena, rows + 2, sizeof *coder->starts);
    coder->around = reel_allocate(&arena, sides, sizeof *coder->around);
    coder->parallelograms = reel_allocate(&arena, sides, sizeof *coder->parallelograms);
    coder->columns = reel_allocate(&arena, rows, sizeof *coder->columns);
    coder->near = reel_allocate(&arena, N_CONTEXT * rows, sizeof *coder->near);
    coder->near_starts = reel_allocate(&arena, rows + 1, sizeof *coder->near_starts);
    coder->residuals =
        reel_allocate(&arena, (size_t)coder->n_columns * rows, sizeof *coder->residuals);
    coder->fields_size = reel_fields_memory(coder->n_rows, 1, N_CONTEXT * coder->n_rows);
    coder->fields_memory = reel_allocate(&arena, coder->fields_size, 1);
    if (arena.failed) {
        return false;
    }
    find_neighbors(coder);
    int64_t count = 0;
    for (int64_t i = 0; i < coder->n_rows; i++) {
        coder->columns[i] = (int32_t)i;
        coder->near_starts[i] = count;
        const int32_t *around = coder->around + coder->around_starts[i];
        int32_t n = coder->around_starts[i + 1] - coder->around_starts[i];
        for (int32_t k = 0; k < n && k < N_CONTEXT; k++) {
            coder->near[count++] = around[k];
        }
    }
    coder->near_starts[coder->n_rows] = count;
    return true;
}

/* The class of a row by its parallelograms, or -1 if it has none. */
static int class_of(const surface_coder *coder, int64_t row) {
    int32_t n = coder->starts[row + 1] - coder->starts[row];
    return n < N_CLASSES ? n - 1 : N_CLASSES - 1;
}

static void find_means(const surface_coder *coder, int64_t row, const int32_t *values,
                       row_means *means) {
    int64_t near[MAX_COLUMNS] = {0}, opposite[MAX_COLUMNS] = {0}, around[MAX_COLUMNS] = {0};
    int64_t n_columns = coder->n_columns;
    for (int32_t i = coder->starts[row]; i < coder->starts[row + 1]; i++) {
        const parallelogram *one = &coder->parallelograms[i];
        const int32_t *a = values + one->a * n_columns, *b = values + one->b * n_columns,
                      *c = values + one->c * n_columns;
        for (int64_t k = 0; k < n_columns; k++) {
            near[k] += (int64_t)a[k] + b[k];
            opposite[k] += c[k];
        }
    }
    for (int32_t i = coder->around_starts[row]; i < coder->around_starts[row + 1]; i++) {
        for (int64_t k = 0; k < n_columns; k++) {
            around[k] += values[coder->around[i] * n_columns + k];
        }
    }
    double n = (double)(coder->starts[row + 1] - coder->starts[row]),
           n_around = (double)(coder->around_starts[row + 1] - coder->around_starts[row]);
    for (int64_t k = 0; k < n_columns; k++) {
        means->near[k] = (double)near[k] / (2.0 * n);
        means->opposite[k] = (double)opposite[k] / n;
        means->around[k] = (double)around[k] / n_around;
    }
}

/* Predict a row without parallelograms: its first neighbor, or the row before it. */
static void copy_row(const surface_coder *coder, int64_t row, const int32_t *values,
                     int32_t *predicted) {
    bool has_neighbor = coder->around_starts[row] < coder->around_starts[row + 1];
    int64_t other = has_neighbor ? coder->around[coder->around_starts[row]] : row - 1;
    for (int64_t k = 0; k < coder->n_columns; k++) {
        predicted[k] = other < 0 ? 0 : values[other * coder->n_columns + k];
    }
}

static void predict_row(const surface_coder *coder, int64_t row, const int32_t *values,
                        int32_t *predicted) {
    int class = class_of(coder, row);
    if (class < 0) {
        copy_row(coder, row, values, predicted);
        return;
    }
    const double *weights = coder->weights + 2 * class;
    row_means means;
    find_means(coder, row, values, &means);
    for (int64_t k = 0; k < coder->n_columns; k++) {
        double near = means.near[k];
        double value = near + (weights[0] * (near - means.opposite[k]) +
                               weights[1] * (means.around[k] - near));
        value = value < MAX_PREDICTION ? value : MAX_PREDICTION;
        value = value > -MAX_PREDICTION ? value : -MAX_PREDICTION;
        predicted[k] = (int32_t)(value + (value < 0 ? -0.5 : 0.5));
    }
}

/* ---- weights ---- */

/* Sums of a least-squares fit of two weights. */
typedef struct {
    double xx, xy, yy, xz, yz;
} fit_sums;

static double to_weight(double value) {
    value = value * ONE;
    value = value < MAX_WEIGHT ? value : MAX_WEIGHT;
    value = value > -MAX_WEIGHT ? value : -MAX_WEIGHT;
    return (double)(int32_t)(value + (value < 0 ? -0.5 : 0.5)) / ONE;
}

/* Solve for two weights. A small prior prefers parallelograms where the rows do not determine
   them. */
static void solve(const fit_sums *sums, double weights[2]) {
    double prior = 1.0 + PRIOR * (sums->xx + sums->yy);
    double xx = sums->xx + prior, yy = sums->yy + prior, xz = sums->xz + prior;
    double determinant = xx * yy - sums->xy * sums->xy;
    weights[0] = to_weight((yy * xz - sums->xy * sums->yz) / determinant);
    weights[1] = to_weight((xx * sums->yz - sums->xy * xz) / determinant);
}

/* Fit the weights of each class to the table. */
static void fit_weights(surface_coder *coder, const int32_t *values) {
    fit_sums sums[N_CLASSES] = {0};
    row_means means;
    for (int64_t row = 0; row < coder->n_rows; row++) {
        int class = class_of(coder, row);
        if (class < 0) {
            continue;
        }
        find_means(coder, row, values, &means);
        for (int64_t k = 0; k < coder->n_columns; k++) {
            double x = means.near[k] - means.opposite[k], y = means.around[k] - means.near[k],
                   z = values[row * coder->n_columns + k] - means.near[k];
            sums[class].xx += x * x;
            sums[class].xy += x * y;
            sums[class].yy += y * y;
            sums[class].xz += x * z;
            sums[class].yz += y * z;
        }
    }
    for (int class = 0; class < N_CLASSES; class++) {
        solve(&sums[class], coder->weights + 2 * class);
    }
}

static void write_weights(const surface_coder *coder, uint8_t *out) {
    for (int i = 0; i < N_WEIGHTS; i++) {
        uint32_t weight = (uint32_t)(int32_t)(coder->weights[i] * ONE);
        out[2 * i] = (uint8_t)(weight & 0xFF);
        out[2 * i + 1] = (uint8_t)(weight >> 8 & 0xFF);
    }
}

static void read_weights(surface_coder *coder, const uint8_t *in) {
    for (int i = 0; i < N_WEIGHTS; i++) {
        int32_t weight = in[2 * i] | in[2 * i + 1] << 8;
        coder->weights[i] = (double)(weight < 0x8000 ? weight : weight - 0x10000) / ONE;
    }
}

/* ---- tables ---- */

int64_t reel_surface_integers_encode(void *memory, size_t memory_size, const int32_t *values,
                                     int64_t n_rows, int64_t n_columns, const int32_t *faces,
                                     const int32_t *twins, int64_t n_faces, uint8_t *out,
                                     size_t capacity) {
    surface_coder coder = {.n_rows = n_rows,
                           .n_columns = n_columns,
                           .n_faces = n_faces,
                           .faces = faces,
                           .twins = twins};
    if (capacity < REEL_SURFACE_HEAD || !prepare(&coder, memory, memory_size)) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t i = 0; i < n_rows * n_columns; i++) {
        if (values[i] > REEL_MAX_SURFACE_VALUE || values[i] < -REEL_MAX_SURFACE_VALUE) {
            return reel_failure(REEL_INVALID, (uint64_t)i);
        }
    }
    fit_weights(&coder, values);
    write_weights(&coder, out);
    int32_t predicted[MAX_COLUMNS];
    for (int64_t row = 0; row < n_rows; row++) {
        predict_row(&coder, row, values, predicted);
        for (int64_t k = 0; k < n_columns; k++) {
            coder.residuals[k * n_rows + row] = values[row * n_columns + k] - predicted[k];
        }
    }
    int64_t pass_starts[] = {0, n_rows};
    int64_t size = reel_fields_encode(coder.fields_memory, coder.fields_size, coder.residuals,
                                      n_columns, n_rows, coder.columns, pass_starts, 1,
                                      coder.near_starts, coder.near, out + REEL_SURFACE_HEAD,
                                      capacity - REEL_SURFACE_HEAD);
    return size < 0 ? size : size + REEL_SURFACE_HEAD;
}

int64_t reel_surface_integers_decode(void *memory, size_t memory_size, const uint8_t *in,
                                     size_t size, int64_t n_rows, int64_t n_columns,
                                     const int32_t *faces, const int32_t *twins, int64_t n_faces,
                                     int32_t *values) {
    surface_coder coder = {.n_rows = n_rows,
                           .n_columns = n_columns,
                           .n_faces = n_faces,
                           .faces = faces,
                           .twins = twins};
    if (size < REEL_SURFACE_HEAD) {
        return reel_failure(REEL_TRUNCATED, size);
    }
    if (size > REEL_SURFACE_HEAD && !in[size - 1]) {
        return reel_failure(REEL_CORRUPT, size - 1);
    }
    if (!prepare(&coder, memory, memory_size)) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    read_weights(&coder, in);
    int64_t pass_starts[] = {0, n_rows};
    int64_t used = reel_fields_decode(coder.fields_memory, coder.fields_size,
                                      in + REEL_SURFACE_HEAD, size - REEL_SURFACE_HEAD, n_columns,
                                      n_columns, n_rows, coder.columns, pass_starts, 1,
                                      coder.near_starts, coder.near, coder.residuals);
    if (used < 0) {
        return used;
    }
    int32_t predicted[MAX_COLUMNS];
    for (int64_t row = 0; row < n_rows; row++) {
        predict_row(&coder, row, values, predicted);
        for (int64_t k = 0; k < n_columns; k++) {
            values[row * n_columns + k] =
                (int32_t)((uint32_t)predicted[k] + (uint32_t)coder.residuals[k * n_rows + row]);
        }
    }
    return used + REEL_SURFACE_HEAD;
}
