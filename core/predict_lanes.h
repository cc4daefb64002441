/* The part of predict.c that processes a batch of REEL_BATCH vertices at once, one per lane of
   several vectors; see cpu.h for LANES, TARGET and NAMED. Nothing is summed across lanes: the
   operations of each vertex have the same order, so all vector widths give the same bits.

   Types:
     VEC         FLOATS floats, as many as fit in a vector
     BATCH_VEC   one float for each vertex of a batch, in N_VECS vectors
     VEC_D       LANES doubles, unaligned
     HALF_VEC_F  LANES floats, unaligned; HALF_VEC_I LANES integers, unaligned
     VEC_MASK    results of comparing LANES doubles
   Shorthands:
     FOR_VECS(p)         loop over the vectors of a batch
     AT(batch_vec, l)    the float of lane l
     SELECT(mask, v)     v, or 0 where the mask is clear
     SHUFFLE, INDICES, LOAD_ROW   transposition of eight fields; see `transpose` */

#define FLOATS (2 * LANES)
#define N_VECS (REEL_BATCH / FLOATS)
#define VEC NAMED(vec)
#define BATCH_VEC NAMED(batch_vec)
#define VEC_D NAMED(vec_d)
#define HALF_VEC_F NAMED(half_vec_f)
#define HALF_VEC_I NAMED(half_vec_i)
#define VEC_MASK NAMED(vec_mask)
typedef float VEC __attribute__((vector_size(8 * LANES), may_alias));
typedef VEC BATCH_VEC[N_VECS];
typedef double VEC_D __attribute__((vector_size(8 * LANES), may_alias, aligned(8)));
typedef float HALF_VEC_F __attribute__((vector_size(4 * LANES), may_alias, aligned(4)));
typedef int32_t HALF_VEC_I __attribute__((vector_size(4 * LANES), may_alias, aligned(4)));
typedef int64_t VEC_MASK __attribute__((vector_size(8 * LANES)));

/* Unrolled, so that the vectors stay in registers even where compilers optimize for size. */
#define FOR_VECS(p) _Pragma("GCC unroll 4") for (int p = 0; p < N_VECS; p++)
#define AT(batch_vec, l) (((float *)(batch_vec))[l]) /* valid without strict aliasing */
#define SELECT(mask, values) ((VEC_D)((mask) & (VEC_MASK)(values)))

/* How many rows of a covariance, and vectors of modes, are processed together. The number of
   registers limits both; builds for web pages prefer small code. */
#ifdef REEL_DECODER_ONLY
#define ROWS 1
#define MODE_VECS 1
#else
#define ROWS (LANES == 8 ? 4 : 3)
#define MODE_VECS 2
#endif

/* One number for each vertex of a batch. */
typedef union {
    double number[REEL_BATCH];
    VEC_D vector[REEL_BATCH / LANES];
} NAMED(batch_numbers);

/* State of the Kalman filters of a batch. */
typedef struct {
    BATCH_VEC weight[MAX_STENCIL];
    BATCH_VEC variance[N_COVARIANCES]; /* covariance, lower triangle row by row */
} NAMED(filter);

typedef struct {
    int n_lanes;                            /* lanes in use; others repeat the last vertex */
    int32_t neighbors[N_SLOTS][REEL_BATCH]; /* vertex numbers; missing entries repeat the first */
    BATCH_VEC mask[MAX_STENCIL];            /* 1, or 0 for a missing entry */
    BATCH_VEC prior[MAX_STENCIL]; /* relative variance, by hops; 0 for a missing entry */
    NAMED(filter) filter;
    /* The rank-1 update after the last observation, covariance -= scaled_gain gains[last]^T, is
       deferred until the covariance is next read, to save memory accesses. */
    BATCH_VEC scaled_gain[MAX_STENCIL], gains[2][MAX_STENCIL];
    int last; /* index of the gains of the last observation */
} NAMED(batch);

/* Values of some fields relative to the first vertex of the stencil. */
typedef struct {
    double base[FIELDS_PER_GATHER][REEL_BATCH]; /* values at the first vertex of the stencil */
    BATCH_VEC offset[FIELDS_PER_GATHER][N_SLOTS];
} NAMED(offsets);

TARGET REEL_INLINE void NAMED(load_batch)(NAMED(batch) *b, const reel_mesh *mesh, int size,
                                          int64_t first, int64_t last) {
    b->n_lanes = last - first < REEL_BATCH ? (int)(last - first) : REEL_BATCH;
    FOR_LANES(l) {
        int64_t vertex = first + (l < b->n_lanes ? l : b->n_lanes - 1);
        const int32_t *neighbors = mesh->stencil + vertex * size;
        const uint8_t *hops = mesh->hops + vertex * size;
        const float *shares = variance_by_hops[hops[0] & 3];
        b->neighbors[SELF][l] = (int32_t)vertex;
        for (int j = 0; j < size; j++) {
            bool is_present = neighbors[j] >= 0;
            b->neighbors[j][l] = is_present ? neighbors[j] : neighbors[0];
            AT(b->mask[j], l) = is_present ? 1.0F : 0.0F;
            AT(b->prior[j], l) = is_present ? shares[hops[j] & 3] : 0.0F;
        }
    }
}

/* Initialize the weights in proportion to the prior. They sum to 1; updates preserve the sum. */
TARGET REEL_INLINE void NAMED(start_weights)(NAMED(batch) *b, int size) {
    BATCH_VEC sum = {0};
    for (int j = 0; j < size; j++) {
        FOR_VECS(p) sum[p] += b->prior[j][p];
    }
    for (int j = 0; j < size; j++) {
        FOR_VECS(p) b->filter.weight[j][p] = b->prior[j][p] / sum[p];
    }
}

TARGET REEL_INLINE void NAMED(load_weights)(NAMED(batch) *b, int size, const float *weights) {
    for (int j = 0; j < size; j++) {
        FOR_LANES(l) {
            AT(b->filter.weight[j], l) = weights[(int64_t)b->neighbors[SELF][l] * size + j];
        }
    }
}

TARGET REEL_INLINE void NAMED(clear_update)(NAMED(batch) *b) {
    b->last = 0;
    reel_zero(b->scaled_gain, sizeof b->scaled_gain);
    reel_zero(b->gains[0], sizeof b->gains[0]);
}

/* Apply the deferred update to the covariance. */
TARGET REEL_INLINE void NAMED(apply_update)(NAMED(batch) *b, int size) {
    BATCH_VEC *row = b->filter.variance, *gain = b->gains[b->last];
    for (int i = 0; i < size; row += ++i) {
        for (int j = 0; j <= i; j++) {
            FOR_VECS(p) row[j][p] -= b->scaled_gain[i][p] * gain[j][p];
        }
    }
    NAMED(clear_update)(b);
}

/* Add `share` times the prior covariance, under which the sum of the weights has no variance. */
TARGET REEL_INLINE void NAMED(add_prior)(NAMED(batch) *b, int size,
                                         const BATCH_VEC *initial_weights, float share) {
    BATCH_VEC *row = b->filter.variance;
    for (int i = 0; i < size; row += ++i) {
        for (int j = 0; j < i; j++) {
            FOR_VECS(p) row[j][p] -= share * (initial_weights[i][p] * b->prior[j][p]);
        }
        FOR_VECS(p) row[i][p] += share * (b->prior[i][p] - initial_weights[i][p] * b->prior[i][p]);
    }
}

TARGET REEL_INLINE void NAMED(predict)(const NAMED(batch) *b, int size, const BATCH_VEC *offset,
                                       VEC *predicted) {
    FOR_VECS(p) predicted[p] = (VEC){0};
    for (int j = 0; j < size; j++) {
        FOR_VECS(p) predicted[p] += b->filter.weight[j][p] * offset[j][p];
    }
}

/* Apply the deferred update to rows i..i + n - 1 of the covariance, and accumulate their part of
   gain = covariance offset, by symmetry also for the columns below the diagonal. */
TARGET REEL_INLINE void NAMED(add_rows)(NAMED(batch) *b, int i, int n, const BATCH_VEC *offset,
                                        const BATCH_VEC *last_gain, BATCH_VEC *gain) {
    BATCH_VEC *rows[ROWS];
    REEL_UNROLLED for (int r = 0; r < n; r++) {
        rows[r] = b->filter.variance + (i + r) * (i + r + 1) / 2;
    }
    FOR_VECS(p) {
        VEC sums[ROWS], scaled_gain[ROWS], row_offsets[ROWS];
        REEL_UNROLLED for (int r = 0; r < n; r++) {
            sums[r] = (VEC){0};
            scaled_gain[r] = b->scaled_gain[i + r][p];
            row_offsets[r] = offset[i + r][p];
        }
        for (int j = 0; j < i; j++) {
            VEC sum = gain[j][p];
            REEL_UNROLLED for (int r = 0; r < n; r++) {
                VEC variance = rows[r][j][p] - scaled_gain[r] * last_gain[j][p];
                rows[r][j][p] = variance;
                sums[r] += variance * offset[j][p];
                sum += variance * row_offsets[r];
            }
            gain[j][p] = sum;
        }
        REEL_UNROLLED for (int r = 0; r < n; r++) {
            REEL_UNROLLED for (int j = 0; j < r; j++) {
                VEC variance = rows[r][i + j][p] - scaled_gain[r] * last_gain[i + j][p];
                rows[r][i + j][p] = variance;
                sums[r] += variance * row_offsets[j];
                gain[i + j][p] += variance * row_offsets[r];
            }
            VEC variance = rows[r][i + r][p] - scaled_gain[r] * last_gain[i + r][p];
            rows[r][i + r][p] = variance;
            gain[i + r][p] = sums[r] + variance * row_offsets[r];
        }
    }
}

/* Kalman update by an observed field: move the weights, and defer the update of the covariance.
   Subtract the prediction from `offset`. */
TARGET REEL_INLINE void NAMED(observe_stencil)(NAMED(batch) *b, int size, BATCH_VEC *offset,
                                               const VEC *predicted, const VEC *error,
                                               const VEC *noise, float relative) {
    BATCH_VEC total, squares = {0};
    const BATCH_VEC *last_gain = b->gains[b->last];
    BATCH_VEC *gain = b->gains[b->last ^= 1];
    for (int i = 0; i < size; i++) {
        FOR_VECS(p) offset[i][p] = b->mask[i][p] * (offset[i][p] - predicted[p]);
    }
    int row = 0;
    for (; row + ROWS <= size; row += ROWS) {
        NAMED(add_rows)(b, row, ROWS, offset, last_gain, gain);
    }
    for (; row < size; row++) {
        NAMED(add_rows)(b, row, 1, offset, last_gain, gain);
    }
    for (int i = 0; i < size; i++) {
        FOR_VECS(p) squares[p] += offset[i][p] * offset[i][p];
    }
    FOR_VECS(p) total[p] = noise[p] + relative * squares[p] + ERROR_NOISE * (error[p] * error[p]);
    for (int i = 0; i < size; i++) {
        FOR_VECS(p) total[p] += offset[i][p] * gain[i][p];
    }
    FOR_VECS(p) total[p] = 1.0F / total[p];
    for (int i = 0; i < size; i++) {
        FOR_VECS(p) b->scaled_gain[i][p] = gain[i][p] * total[p];
        FOR_VECS(p) b->filter.weight[i][p] += b->scaled_gain[i][p] * error[p];
    }
}

/* observe_stencil takes most of the time, but if it were inlined everywhere, compiling would take
   minutes. So there are two copies: one for any stencil and, except in small builds, one
   for full stencils. */
TARGET REEL_CALLED void NAMED(observe_any)(NAMED(batch) *b, int size, BATCH_VEC *offset,
                                           const VEC *predicted, const VEC *error, const VEC *noise,
                                           float relative) {
    NAMED(observe_stencil)(b, size, offset, predicted, error, noise, relative);
}

#ifndef REEL_DECODER_ONLY
TARGET REEL_CALLED void NAMED(observe_full)(NAMED(batch) *b, BATCH_VEC *offset,
                                            const VEC *predicted, const VEC *error,
                                            const VEC *noise, float relative) {
    NAMED(observe_stencil)(b, MAX_STENCIL, offset, predicted, error, noise, relative);
}
#endif

TARGET REEL_INLINE void NAMED(observe)(NAMED(batch) *b, int size, BATCH_VEC *offset,
                                       const VEC *predicted, const VEC *error, const VEC *noise,
                                       float relative) {
#ifndef REEL_DECODER_ONLY
    if (size == MAX_STENCIL) {
        NAMED(observe_full)(b, offset, predicted, error, noise, relative);
        return;
    }
#endif
    NAMED(observe_any)(b, size, offset, predicted, error, noise, relative);
}

/* Whether to load eight fields of a vertex at once, and then transpose them. */
#if LANES >= 4 && (defined(__clang__) || __GNUC__ >= 12)
#define HAS_TRANSPOSE 1
#else
#define HAS_TRANSPOSE 0
#endif

#if HAS_TRANSPOSE
#define VEC_8F NAMED(vec_8f)
typedef float VEC_8F __attribute__((vector_size(32), may_alias, aligned(4)));
#define SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#if LANES == 8
#define INDICES(...) __VA_ARGS__ /* indices into two vectors, for vectors of 16 */
#else
#define INDICES(a, b, c, d, e, f, g, h, ...)                                                       \
    (a) < 16 ? (a) : (a) - 8, (b) < 16 ? (b) : (b) - 8, (c) < 16 ? (c) : (c) - 8,                  \
        (d) < 16 ? (d) : (d) - 8, (e) < 16 ? (e) : (e) - 8, (f) < 16 ? (f) : (f) - 8,              \
        (g) < 16 ? (g) : (g) - 8, (h) < 16 ? (h) : (h) - 8
#endif

/* Transpose eight floats of each of FLOATS vertices to vector p of eight batch vectors. Row i has
   the floats of vertex i or, with 16 floats per vector, of vertices i and i + 8. */
TARGET REEL_INLINE void NAMED(transpose)(const VEC *rows, BATCH_VEC *lanes, int p) {
    VEC pairs[8], quads[8];
    REEL_UNROLLED for (int i = 0; i < 8; i += 2) {
        pairs[i] = SHUFFLE(rows[i], rows[i + 1],
                           INDICES(0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29));
        pairs[i + 1] = SHUFFLE(rows[i], rows[i + 1],
                               INDICES(2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31));
    }
    REEL_UNROLLED for (int i = 0; i < 8; i++) {
        int a = i / 4 * 4 + i / 2 % 2; /* first of two interleaved pairs in this half */
        quads[i] =
            i % 2 ? SHUFFLE(pairs[a], pairs[a + 2],
                            INDICES(2, 3, 18, 19, 6, 7, 22, 23, 10, 11, 26, 27, 14, 15, 30, 31))
                  : SHUFFLE(pairs[a], pairs[a + 2],
                            INDICES(0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12, 13, 28, 29));
    }
    REEL_UNROLLED for (int i = 0; i < 4; i++) {
        VEC a = quads[i], b = quads[i + 4];
        lanes[i * N_SLOTS][p] =
            SHUFFLE(a, b, INDICES(0, 1, 2, 3, 16, 17, 18, 19, 8, 9, 10, 11, 24, 25, 26, 27));
        lanes[(i + 4) * N_SLOTS][p] =
            SHUFFLE(a, b, INDICES(4, 5, 6, 7, 20, 21, 22, 23, 12, 13, 14, 15, 28, 29, 30, 31));
    }
}

/* Subtract eight doubles from eight others, and round to float. */
TARGET REEL_INLINE VEC_8F NAMED(difference)(const double *values, const double *base) {
#if LANES == 8
    return __builtin_convertvector(*(const VEC_D *)values - *(const VEC_D *)base, VEC_8F);
#else
    HALF_VEC_F low =
        __builtin_convertvector(*(const VEC_D *)values - *(const VEC_D *)base, HALF_VEC_F);
    HALF_VEC_F high = __builtin_convertvector(
        *(const VEC_D *)(values + 4) - *(const VEC_D *)(base + 4), HALF_VEC_F);
    return SHUFFLE(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
#endif
}

/* Load a row for `transpose`; load(l) loads the eight floats of vertex l. */
#if LANES == 8
#define LOAD_ROW(l, load)                                                                          \
    SHUFFLE(load(l), load((l) + 8), 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)
#else
#define LOAD_ROW(l, load) load(l)
#endif
#endif

/* Gather the offsets of FIELDS_PER_GATHER smooth fields at one entry of the stencil. */
TARGET REEL_INLINE void NAMED(gather_smooth)(const NAMED(batch) *b, const float *smooth, int slot,
                                             BATCH_VEC (*offset)[N_SLOTS]) {
    const int32_t *neighbors = b->neighbors[slot], *first = b->neighbors[0];
#if HAS_TRANSPOSE
#define SMOOTH(l)                                                                                  \
    (*(const VEC_8F *)(smooth + (int64_t)neighbors[l] * REEL_SMOOTH_FIELDS) -                      \
     *(const VEC_8F *)(smooth + (int64_t)first[l] * REEL_SMOOTH_FIELDS))
    FOR_VECS(p) {
        VEC rows[8];
        REEL_UNROLLED for (int l = 0; l < 8; l++) { rows[l] = LOAD_ROW(l + 8 * p, SMOOTH); }
        NAMED(transpose)(rows, offset[0] + slot, p);
    }
#undef SMOOTH
#else
    for (int f = 0; f < FIELDS_PER_GATHER; f++) {
        FOR_LANES(l) {
            AT(offset[f][slot], l) = smooth[(int64_t)neighbors[l] * REEL_SMOOTH_FIELDS + f] -
                                     smooth[(int64_t)first[l] * REEL_SMOOTH_FIELDS + f];
        }
    }
#endif
}

/* Update the filters with the smooth fields of this resolution. */
TARGET REEL_INLINE void NAMED(observe_smooth)(NAMED(batch) *b, int size, const float *smooth,
                                              float smooth_noise) {
    BATCH_VEC offset[REEL_SMOOTH_FIELDS][N_SLOTS], noise = {0}, predicted, error;
    for (int f = 0; f < REEL_SMOOTH_FIELDS; f += FIELDS_PER_GATHER) {
        for (int j = 0; j < size; j++) {
            NAMED(gather_smooth)(b, smooth + f, j, offset + f);
        }
        NAMED(gather_smooth)(b, smooth + f, SELF, offset + f);
    }
    for (int f = 0; f < REEL_SMOOTH_FIELDS; f++) {
        for (int j = 0; j < size; j++) {
            FOR_VECS(p) {
                VEC difference = b->mask[j][p] * (offset[f][j][p] - offset[f][SELF][p]);
                noise[p] += difference * difference;
            }
        }
    }
    FOR_VECS(p) noise[p] = smooth_noise / (float)size * noise[p] + SMOOTH_FLOOR;
    for (int f = 0; f < REEL_SMOOTH_FIELDS; f++) {
        NAMED(predict)(b, size, offset[f], predicted);
        FOR_VECS(p) error[p] = offset[f][SELF][p] - predicted[p];
        NAMED(observe)(b, size, offset[f], predicted, error, noise, 0.0F);
    }
}

/* Gather the offsets of n fields at one entry of the stencil. The values of a vertex are
   contiguous; those of consecutive vertices are `stride` apart. */
TARGET REEL_INLINE void NAMED(gather_slot)(const NAMED(batch) *b, const double *values,
                                           int64_t stride, int n, int slot,
                                           NAMED(offsets) *result) {
#if HAS_TRANSPOSE
#define VALUES(l)                                                                                  \
    NAMED(difference)(values + b->neighbors[slot][l] * stride, values + b->neighbors[0][l] * stride)
    if (n == FIELDS_PER_GATHER) {
        FOR_VECS(p) {
            VEC rows[8];
            REEL_UNROLLED for (int l = 0; l < 8; l++) { rows[l] = LOAD_ROW(l + 8 * p, VALUES); }
            NAMED(transpose)(rows, result->offset[0] + slot, p);
        }
        return;
    }
#undef VALUES
#endif
    for (int m = 0; m < n; m++) {
        float single[REEL_BATCH];
        FOR_LANES(l) {
            single[l] = (float)(values[b->neighbors[slot][l] * stride + m] - result->base[m][l]);
        }
        reel_copy(result->offset[m][slot], single, sizeof single);
    }
}

/* Gather the offsets of fields k..n_fields-1, or of the first FIELDS_PER_GATHER of them. */
TARGET REEL_CALLED void NAMED(gather)(const NAMED(batch) *b, int size, const double *values,
                                      int64_t k, int64_t n_fields, bool with_self,
                                      NAMED(offsets) *result) {
    int n = n_fields - k < FIELDS_PER_GATHER ? (int)(n_fields - k) : FIELDS_PER_GATHER;
    for (int m = 0; m < n; m++) {
        FOR_LANES(l) { result->base[m][l] = values[b->neighbors[0][l] * n_fields + k + m]; }
    }
    for (int j = 0; j < size; j++) {
        NAMED(gather_slot)(b, values + k, n_fields, n, j, result);
    }
    if (with_self) {
        NAMED(gather_slot)(b, values + k, n_fields, n, SELF, result);
    }
}

/* Update the filters with the first modes of the key block. */
TARGET REEL_INLINE void NAMED(observe_key)(NAMED(batch) *b, int size, const reel_fields *fields) {
    NAMED(offsets) result;
    BATCH_VEC predicted, error, noise;
    int64_t n_key = fields->n_key;
    int64_t n_modes = n_key < fields->n_learned ? n_key : fields->n_learned;
    FOR_VECS(p) noise[p] = ROUNDING_NOISE + (VEC){0};
    for (int64_t k = 0; k < n_modes; k++) {
        BATCH_VEC *offset = result.offset[k % FIELDS_PER_GATHER];
        if (k % FIELDS_PER_GATHER == 0) {
            NAMED(gather)(b, size, fields->key, k, n_key, true, &result);
        }
        NAMED(predict)(b, size, offset, predicted);
        FOR_VECS(p) error[p] = offset[SELF][p] - predicted[p];
        NAMED(observe)(b, size, offset, predicted, error, noise, RELATIVE_NOISE / (float)size);
    }
}

/* Initialize the filters before the first mode of the block. */
TARGET REEL_CALLED void NAMED(prepare)(NAMED(batch) *b, int size, const reel_fields *fields,
                                       const float *weights, const float *smooth,
                                       float smooth_noise) {
    BATCH_VEC initial_weights[MAX_STENCIL];
    NAMED(clear_update)(b);
    NAMED(start_weights)(b, size);
    reel_copy(initial_weights, b->filter.weight, sizeof initial_weights);
    reel_zero(b->filter.variance, sizeof b->filter.variance);
    if (weights) {
        NAMED(load_weights)(b, size, weights);
    } else {
        NAMED(add_prior)(b, size, initial_weights, PRIOR_VARIANCE);
        NAMED(observe_smooth)(b, size, smooth, smooth_noise);
        NAMED(apply_update)(b, size);
    }
    NAMED(add_prior)(b, size, initial_weights, RESTORED_SHARE * PRIOR_VARIANCE);
    NAMED(observe_key)(b, size, fields);
}

/* Quantize LANES modes of a vertex to residuals, and count the zeros and ones of each mode.
   `open_loop` are the predictions from unquantized values, or NULL if the quantization noise is not
   shaped. Return false if a residual is too large. */
TARGET REEL_INLINE bool NAMED(quantize_modes)(bool to_nearest, const reel_quantizer *quantizer,
                                              const VEC_D *zones, const VEC_D *predictions,
                                              const VEC_D *target_value, const VEC_D *open_loop,
                                              HALF_VEC_I *residuals, VEC_D *zeros, VEC_D *ones) {
    const VEC_D zero = {0}, one = zero + 1.0;
    VEC_D target = *target_value;
    if (open_loop) {
        VEC_D feedback = quantizer->gain * (*predictions - *open_loop);
        target += SELECT((feedback <= MAX_FEEDBACK) & (feedback >= -MAX_FEEDBACK), feedback);
    }
    VEC_D scaled = target - *predictions;
    VEC_MASK is_negative = scaled < zero;
    VEC_D size = SELECT(is_negative, -scaled) + SELECT(~is_negative, scaled);
    VEC_MASK fits = size < REEL_TOO_LARGE, is_zero = size < *zones;
    *zeros += SELECT(is_zero, one);
    *ones += SELECT(~is_zero & (size < ONE_LIMIT), one);
    /* Vectorized reel_round_rd. */
    VEC_D biased = SELECT(fits, size) + (to_nearest ? 0.5 : 0.5 - REEL_ROUNDING_BIAS);
    HALF_VEC_I whole = __builtin_convertvector(biased, HALF_VEC_I);
    VEC_D rounded = __builtin_convertvector(whole, VEC_D);
    rounded = SELECT(~is_zero, rounded + SELECT(rounded < one, one));
    rounded = SELECT(~is_negative, rounded) - SELECT(is_negative, rounded);
    *residuals = __builtin_convertvector(rounded, HALF_VEC_I);
    int n_fit = 0;
    for (int i = 0; i < LANES; i++) {
        n_fit -= (int)fits[i];
    }
    return n_fit == LANES;
}

/* Quantize one mode at the vertices of a batch. */
TARGET REEL_INLINE bool NAMED(quantize_batch)(const NAMED(batch) *b, int size, bool to_nearest,
                                              int64_t k, reel_fields *fields,
                                              const reel_quantizer *quantizer,
                                              const NAMED(batch_numbers) *predictions,
                                              const NAMED(offsets) *open_loop) {
    NAMED(batch_numbers) targets, open_loop_values, zones, zeros = {{0}}, ones = {{0}};
    union {
        int32_t number[REEL_BATCH];
        HALF_VEC_I vector[REEL_BATCH / LANES];
    } residuals;
    if (open_loop) {
        BATCH_VEC predicted;
        NAMED(predict)(b, size, open_loop->offset[k % FIELDS_PER_GATHER], predicted);
        FOR_LANES(l) {
            open_loop_values.number[l] =
                open_loop->base[k % FIELDS_PER_GATHER][l] + (double)AT(predicted, l);
        }
    }
    FOR_LANES(l) {
        targets.number[l] = quantizer->targets[b->neighbors[SELF][l] * fields->n_modes + k];
        zones.number[l] = quantizer->zones[k];
    }
    bool fits = true;
    for (int i = 0; i < REEL_BATCH / LANES; i++) {
        fits &= NAMED(quantize_modes)(to_nearest, quantizer, zones.vector + i,
                                      predictions->vector + i, targets.vector + i,
                                      open_loop ? open_loop_values.vector + i : NULL,
                                      residuals.vector + i, zeros.vector + i, ones.vector + i);
    }
    for (int l = 0; l < b->n_lanes; l++) {
        quantizer->counts[2 * k] += zeros.number[l];
        quantizer->counts[2 * k + 1] += ones.number[l];
        fields->residuals[k * fields->n_verts + b->neighbors[SELF][l]] = residuals.number[l];
    }
    return fits;
}

/* Code the first n_adaptive modes at the vertices of a batch, one by one; the weights adapt after
   each of the first n_learned. Return false if a residual is too large. */
TARGET REEL_INLINE bool NAMED(code_adaptive)(NAMED(batch) *b, int size, bool to_nearest,
                                             bool is_shaped, int64_t n_adaptive,
                                             reel_fields *fields, const reel_quantizer *quantizer) {
    NAMED(offsets) result, open_loop;
    BATCH_VEC predicted, error, noise;
    NAMED(batch_numbers) predictions;
    double errors[REEL_MAX_JOINT][REEL_BATCH];
    int64_t n_modes = fields->n_modes;
    FOR_VECS(p) noise[p] = ROUNDING_NOISE + (VEC){0};
    for (int64_t k = 0; k < n_adaptive; k++) {
        int m = (int)(k % FIELDS_PER_GATHER);
        if (!m) {
            NAMED(gather)(b, size, fields->values, k, n_modes, false, &result);
        }
        if (!m && is_shaped) {
            NAMED(gather)(b, size, quantizer->targets, k, n_modes, false, &open_loop);
        }
        NAMED(predict)(b, size, result.offset[m], predicted);
        FOR_LANES(l) { predictions.number[l] = result.base[m][l] + (double)AT(predicted, l); }
        for (int l = 0; fields->n_related && l < REEL_BATCH; l++) { /* the correction */
            predictions.number[l] += fields->values[b->neighbors[SELF][l] * n_modes + k];
        }
        bool is_joint = quantizer && k < quantizer->n_joint;
        if (is_joint && !quantize_jointly(quantizer, k, predictions.number, b->neighbors[SELF],
                                          b->n_lanes, errors, fields)) {
            return false;
        }
        if (quantizer && !is_joint &&
            !NAMED(quantize_batch)(b, size, to_nearest, k, fields, quantizer, &predictions,
                                   is_shaped ? &open_loop : NULL)) {
            return false;
        }
        FOR_LANES(l) {
            int32_t residual = fields->residuals[k * fields->n_verts + b->neighbors[SELF][l]];
            AT(error, l) = (float)residual;
            fields->values[b->neighbors[SELF][l] * n_modes + k] =
                predictions.number[l] + (double)residual;
        }
        if (k < fields->n_learned) {
            NAMED(observe)(b, size, result.offset[m], predicted, error, noise,
                           RELATIVE_NOISE / (float)size);
        }
    }
    return true;
}

/* Predict n * LANES modes at one vertex of a batch. */
TARGET REEL_INLINE void NAMED(predict_modes)(const NAMED(batch) *b, int size, int l, int n,
                                             const double *values, int64_t stride,
                                             VEC_D *predictions) {
    const VEC_D *base = (const VEC_D *)(values + b->neighbors[0][l] * stride);
    HALF_VEC_F sums[2] = {{0}, {0}};
    for (int j = 0; j < size; j++) {
        const VEC_D *neighbors = (const VEC_D *)(values + b->neighbors[j][l] * stride);
        float weight = AT(b->filter.weight[j], l);
        REEL_UNROLLED for (int i = 0; i < n; i++) {
            sums[i] += weight * __builtin_convertvector(neighbors[i] - base[i], HALF_VEC_F);
        }
    }
    REEL_UNROLLED for (int i = 0; i < n; i++) {
        predictions[i] = base[i] + __builtin_convertvector(sums[i], VEC_D);
    }
}

/* Load residuals that are `stride` apart. */
TARGET REEL_INLINE HALF_VEC_I NAMED(load_residuals)(const int32_t *base, int64_t stride) {
#if LANES == 2
    return (HALF_VEC_I){base[0], base[stride]};
#elif LANES == 4
    return (HALF_VEC_I){base[0], base[stride], base[2 * stride], base[3 * stride]};
#else
    return (HALF_VEC_I){base[0],          base[stride],     base[2 * stride], base[3 * stride],
                        base[4 * stride], base[5 * stride], base[6 * stride], base[7 * stride]};
#endif
}

/* Code n * LANES modes at the vertices of a batch, n = 1 or 2, with fixed weights. */
TARGET REEL_INLINE bool NAMED(code_fixed)(const NAMED(batch) *b, int size, int n, bool to_nearest,
                                          bool is_shaped, int64_t k, reel_fields *fields,
                                          const reel_quantizer *quantizer) {
    VEC_D predictions[2], open_loop[2], zeros[2] = {{0}, {0}}, ones[2] = {{0}, {0}};
    HALF_VEC_I residuals;
    int64_t n_modes = fields->n_modes, n_verts = fields->n_verts;
    bool fits = true;
    for (int m = 0; quantizer && m < n * LANES; m++) {
        zeros[m / LANES][m % LANES] = quantizer->counts[2 * (k + m)];
        ones[m / LANES][m % LANES] = quantizer->counts[2 * (k + m) + 1];
    }
    for (int l = 0; l < b->n_lanes; l++) {
        int64_t vertex = b->neighbors[SELF][l];
        NAMED(predict_modes)(b, size, l, n, fields->values + k, n_modes, predictions);
        if (is_shaped) {
            NAMED(predict_modes)(b, size, l, n, quantizer->targets + k, n_modes, open_loop);
        }
        VEC_D *values = (VEC_D *)(fields->values + vertex * n_modes + k);
        REEL_UNROLLED for (int i = 0; i < n; i++) {
            int32_t *residual = fields->residuals + (k + i * LANES) * n_verts + vertex;
            if (fields->n_related) {
                predictions[i] += values[i];
            }
            if (quantizer) {
                fits &= NAMED(quantize_modes)(
                    to_nearest, quantizer, (const VEC_D *)(quantizer->zones + k) + i,
                    &predictions[i], (const VEC_D *)(quantizer->targets + vertex * n_modes + k) + i,
                    is_shaped ? &open_loop[i] : NULL, &residuals, &zeros[i], &ones[i]);
                for (int m = 0; m < LANES; m++) {
                    residual[m * n_verts] = residuals[m];
                }
            } else {
                residuals = NAMED(load_residuals)(residual, n_verts);
            }
            values[i] = predictions[i] + __builtin_convertvector(residuals, VEC_D);
        }
    }
    for (int m = 0; quantizer && m < n * LANES; m++) {
        quantizer->counts[2 * (k + m)] = zeros[m / LANES][m % LANES];
        quantizer->counts[2 * (k + m) + 1] = ones[m / LANES][m % LANES];
    }
    return fits;
}

/* Code all modes at the vertices of a batch. Return false if a residual is too large. */
TARGET REEL_INLINE bool NAMED(code_batch)(NAMED(batch) *b, int size, bool to_nearest,
                                          bool is_shaped, reel_fields *fields,
                                          const reel_quantizer *quantizer) {
    int64_t n_modes = fields->n_modes, n_fixed = n_modes - fields->n_learned;
    int64_t n_adaptive = n_fixed < 0 ? n_modes : fields->n_learned + n_fixed % LANES;
    bool fits = NAMED(code_adaptive)(b, size, to_nearest, is_shaped, n_adaptive, fields, quantizer);
    int64_t k = n_adaptive;
    for (; MODE_VECS == 2 && fits && k + 2 * LANES <= n_modes; k += 2 * LANES) {
        fits = NAMED(code_fixed)(b, size, MODE_VECS, to_nearest, is_shaped, k, fields, quantizer);
    }
    for (; fits && k < n_modes; k += LANES) {
        fits = NAMED(code_fixed)(b, size, 1, to_nearest, is_shaped, k, fields, quantizer);
    }
    return fits;
}

/* Code vertices first..last-1 of a level above the coarsest. */
TARGET static bool NAMED(code)(const reel_mesh *mesh, reel_fields *fields,
                               const reel_quantizer *quantizer, int64_t level, int64_t first,
                               int64_t last) {
#ifdef REEL_DECODER_ONLY
    quantizer = NULL;
#endif
    NAMED(batch) b;
    int size = (int)mesh->stencil_size;
    const float *smooth = smooth_rows(mesh, level);
    float noise = smooth_noise(mesh, level);
    bool is_shaped = quantizer && quantizer->gain != 0.0 && level >= quantizer->first_shaped;
    bool to_nearest = quantizer && quantizer->rd_lambda == 0.0;
    for (int64_t n = 0; first < last; first += REEL_BATCH, n++) {
        if (quantizer && n % BATCHES_PER_ZONE == 0) {
            set_zones(quantizer, fields->n_modes, to_nearest);
        }
        NAMED(load_batch)(&b, mesh, size, first, last);
        NAMED(prepare)(&b, size, fields, mesh->weights, smooth, noise);
        if (!NAMED(code_batch)(&b, size, to_nearest, is_shaped, fields, quantizer)) {
            return false;
        }
    }
    return true;
}

#undef N_VECS
#undef VEC
#undef BATCH_VEC
#undef FOR_VECS
#undef AT
#undef ROWS
#undef FLOATS
#undef HAS_TRANSPOSE
#undef MODE_VECS
#undef VEC_8F
#undef SHUFFLE
#undef INDICES
#undef LOAD_ROW
#undef VEC_D
#undef HALF_VEC_F
#undef HALF_VEC_I
#undef VEC_MASK
#undef SELECT
#undef LANES
