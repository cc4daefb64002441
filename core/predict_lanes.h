/* What predict.c does with REEL_BATCH vertices at once. It is included once for each kind of
   registers; see cpu.h. FLOATS is how many floats a vector has; several make a lane. A lane is one
   vertex, and nothing is added up across lanes: the order of operations of a vertex is that of
   the code, and its bits are the same on all. No include guard. */

#define PARTS (REEL_BATCH / FLOATS)
#define part REEL_JOIN(reel_floats_, FLOATS)
#define lane NAMED(lane)

typedef part lane[PARTS];

/* Doubles of a vector, and as many values of other types; they may lie anywhere. */
#define WIDTH (FLOATS / 2)
typedef double NAMED(doubles) __attribute__((vector_size(8 * WIDTH), may_alias, aligned(8)));
typedef float NAMED(floats) __attribute__((vector_size(4 * WIDTH), may_alias, aligned(4)));
#if FLOATS >= 8
typedef float NAMED(eight) __attribute__((vector_size(32), may_alias, aligned(4)));
#endif
typedef int32_t NAMED(integers) __attribute__((vector_size(4 * WIDTH), may_alias, aligned(4)));
typedef int64_t NAMED(masks) __attribute__((vector_size(8 * WIDTH)));
#define doubles NAMED(doubles)
#define floats NAMED(floats)
#define integers NAMED(integers)
#define masks NAMED(masks)
#define WHERE(mask, values) ((doubles)((mask) & (masks)(values))) /* else 0 */

/* Numbers for a batch. */
typedef union {
    double number[REEL_BATCH];
    doubles vector[REEL_BATCH / WIDTH];
} NAMED(numbers);

/* Rows of variances that go together: registers bound them, and pages need small code. */
#ifdef REEL_DECODER_ONLY
#define ROWS 1
#define TOGETHER 1 /* vectors of modes */
#else
#define ROWS (FLOATS == 16 ? 4 : 3)
#define TOGETHER 2
#endif
/* Unrolled, so that parts stay in registers where compilers are asked for small code. */
#define FOR_PARTS(p) _Pragma("GCC unroll 4") for (int p = 0; p < PARTS; p++)
#define AT(lanes, l) (((float *)(lanes))[l]) /* the core is built without strict aliasing */

/* What is known about the weights. */
typedef struct {
    lane weight[MOST];
    lane variance[TRIANGLE]; /* its rows, up to the diagonal */
} NAMED(filter);

typedef struct {
    int n_lanes; /* that are vertices of their own; others repeat the last */
    int32_t near[PLACES][REEL_BATCH]; /* a place that is not there repeats the first */
    lane real[MOST];                  /* 1, or 0 where a place is not there */
    lane prior[MOST];                 /* variance by distance; 0 where a place is not there */
    NAMED(filter) filter;
    /* The variances are still to be changed by what was observed last: they are, on the way, once
       they are needed. */
    lane scaled[MOST], gains[2][MOST];
    int last; /* the gains of what was observed last */
} NAMED(batch);

/* Of some fields, their values less those at the first vertex of the stencil. */
typedef struct {
    double base[AT_ONCE][REEL_BATCH]; /* the latter */
    lane offset[AT_ONCE][PLACES];
} NAMED(offsets);

TARGET REEL_INLINE void NAMED(load_batch)(NAMED(batch) *b, const reel_mesh *mesh, int size,
                                          int64_t first, int64_t last) {
    b->n_lanes = last - first < REEL_BATCH ? (int)(last - first) : REEL_BATCH;
    FOR_LANES(l) {
        int64_t own = first + (l < b->n_lanes ? l : b->n_lanes - 1);
        const int32_t *near = mesh->stencil + own * size;
        const uint8_t *hops = mesh->hops + own * size;
        const float *shares = by_hops[hops[0] & 3];
        b->near[OWN][l] = (int32_t)own;
        for (int j = 0; j < size; j++) {
            bool is_there = near[j] >= 0;
            b->near[j][l] = is_there ? near[j] : near[0];
            AT(b->real[j], l) = is_there ? 1.0F : 0.0F;
            AT(b->prior[j], l) = is_there ? shares[hops[j] & 3] : 0.0F;
        }
    }
}

/* Weights by distance. They add up to 1, whatever is learned. */
TARGET REEL_INLINE void NAMED(start_weights)(NAMED(batch) *b, int size) {
    lane sum = {0};
    for (int j = 0; j < size; j++) {
        FOR_PARTS(p) sum[p] += b->prior[j][p];
    }
    for (int j = 0; j < size; j++) {
        FOR_PARTS(p) b->filter.weight[j][p] = b->prior[j][p] / sum[p];
    }
}

/* Nothing was observed that the variances do not know of. */
TARGET REEL_INLINE void NAMED(begin)(NAMED(batch) *b) {
    b->last = 0;
    reel_zero(b->scaled, sizeof b->scaled);
    reel_zero(b->gains[0], sizeof b->gains[0]);
}

/* Variances as they are after all that was observed. */
TARGET REEL_INLINE void NAMED(settle)(NAMED(batch) *b, int size) {
    lane *row = b->filter.variance, *gain = b->gains[b->last];
    for (int i = 0; i < size; row += ++i) {
        for (int j = 0; j <= i; j++) {
            FOR_PARTS(p) row[j][p] -= b->scaled[i][p] * gain[j][p];
        }
    }
    NAMED(begin)(b);
}

/* Adds a share of their variance by distance, which leaves their sum alone. */
TARGET REEL_INLINE void NAMED(add_variance)(NAMED(batch) *b, int size, const lane *by_distance,
                                            float share) {
    lane *row = b->filter.variance;
    for (int i = 0; i < size; row += ++i) {
        for (int j = 0; j < i; j++) {
            FOR_PARTS(p) row[j][p] -= share * (by_distance[i][p] * b->prior[j][p]);
        }
        FOR_PARTS(p) row[i][p] += share * (b->prior[i][p] - by_distance[i][p] * b->prior[i][p]);
    }
}

TARGET REEL_INLINE void NAMED(predict)(const NAMED(batch) *b, int size, const lane *offset,
                                       part *predicted) {
    FOR_PARTS(p) predicted[p] = (part){0};
    for (int j = 0; j < size; j++) {
        FOR_PARTS(p) predicted[p] += b->filter.weight[j][p] * offset[j][p];
    }
}

/* What was observed last changes the variances in rows i..i + n - 1; then they are multiplied by
   offsets, they and their columns below the diagonal. */
TARGET REEL_INLINE void NAMED(add_rows)(NAMED(batch) *b, int i, int n, const lane *offset,
                                        const lane *before, lane *gain) {
    lane *rows[ROWS];
    REEL_UNROLLED for (int r = 0; r < n; r++) {
        rows[r] = b->filter.variance + (i + r) * (i + r + 1) / 2;
    }
    FOR_PARTS(p) {
        part sums[ROWS], scaled[ROWS], own[ROWS];
        REEL_UNROLLED for (int r = 0; r < n; r++) {
            sums[r] = (part){0};
            scaled[r] = b->scaled[i + r][p];
            own[r] = offset[i + r][p];
        }
        for (int j = 0; j < i; j++) {
            part sum = gain[j][p];
            REEL_UNROLLED for (int r = 0; r < n; r++) {
                part variance = rows[r][j][p] - scaled[r] * before[j][p];
                rows[r][j][p] = variance;
                sums[r] += variance * offset[j][p];
                sum += variance * own[r];
            }
            gain[j][p] = sum;
        }
        REEL_UNROLLED for (int r = 0; r < n; r++) {
            REEL_UNROLLED for (int j = 0; j < r; j++) {
                part variance = rows[r][i + j][p] - scaled[r] * before[i + j][p];
                rows[r][i + j][p] = variance;
                sums[r] += variance * own[j];
                gain[i + j][p] += variance * own[r];
            }
            part variance = rows[r][i + r][p] - scaled[r] * before[i + r][p];
            rows[r][i + r][p] = variance;
            gain[i + r][p] = sums[r] + variance * own[r];
        }
    }
}

/* The filter observes a field: the weights go towards what would have predicted it without the
   error. Offsets become those to the prediction. */
TARGET REEL_INLINE void NAMED(observe_places)(NAMED(batch) *b, int size, lane *offset,
                                              const part *predicted, const part *error,
                                              const part *noise, float relative) {
    lane total, energy = {0};
    const lane *before = b->gains[b->last];
    lane *gain = b->gains[b->last ^= 1];
    for (int i = 0; i < size; i++) {
        FOR_PARTS(p) offset[i][p] = b->real[i][p] * (offset[i][p] - predicted[p]);
    }
    int done = 0;
    for (; done + ROWS <= size; done += ROWS) {
        NAMED(add_rows)(b, done, ROWS, offset, before, gain);
    }
    for (; done < size; done++) {
        NAMED(add_rows)(b, done, 1, offset, before, gain);
    }
    for (int i = 0; i < size; i++) {
        FOR_PARTS(p) energy[p] += offset[i][p] * offset[i][p];
    }
    FOR_PARTS(p) total[p] = noise[p] + relative * energy[p] + SURPRISE * (error[p] * error[p]);
    for (int i = 0; i < size; i++) {
        FOR_PARTS(p) total[p] += offset[i][p] * gain[i][p];
    }
    FOR_PARTS(p) total[p] = 1.0F / total[p];
    for (int i = 0; i < size; i++) {
        FOR_PARTS(p) b->scaled[i][p] = gain[i][p] * total[p];
        FOR_PARTS(p) b->filter.weight[i][p] += b->scaled[i][p] * error[p];
    }
}

/* The same, called: it is most of the work, and in every place that needs it compilers would take
   minutes. Full stencils have code of their own, but where code has to be small. */
TARGET REEL_CALLED void NAMED(observe_any)(NAMED(batch) *b, int size, lane *offset,
                                           const part *predicted, const part *error,
                                           const part *noise, float relative) {
    NAMED(observe_places)(b, size, offset, predicted, error, noise, relative);
}

#ifndef REEL_DECODER_ONLY
TARGET REEL_CALLED void NAMED(observe_full)(NAMED(batch) *b, lane *offset, const part *predicted,
                                            const part *error, const part *noise,
                                            float relative) {
    NAMED(observe_places)(b, MOST, offset, predicted, error, noise, relative);
}
#endif

TARGET REEL_INLINE void NAMED(observe)(NAMED(batch) *b, int size, lane *offset,
                                       const part *predicted, const part *error,
                                       const part *noise, float relative) {
#ifndef REEL_DECODER_ONLY
    if (size == MOST) {
        NAMED(observe_full)(b, offset, predicted, error, noise, relative);
        return;
    }
#endif
    NAMED(observe_any)(b, size, offset, predicted, error, noise, relative);
}

/* Whether eight fields of a vertex are read at once, and turned to lanes. */
#if FLOATS >= 8 && (defined(__clang__) || __GNUC__ >= 12)
#define TURNS 1
#else
#define TURNS 0
#endif

#if TURNS
#define JOIN(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#if FLOATS == 16
#define ALONG(...) __VA_ARGS__ /* places of two vectors, for vectors of 16 */
#else
#define ALONG(a, b, c, d, e, f, g, h, ...)                                                         \
    (a) < 16 ? (a) : (a) - 8, (b) < 16 ? (b) : (b) - 8, (c) < 16 ? (c) : (c) - 8,                  \
        (d) < 16 ? (d) : (d) - 8, (e) < 16 ? (e) : (e) - 8, (f) < 16 ? (f) : (f) - 8,              \
        (g) < 16 ? (g) : (g) - 8, (h) < 16 ? (h) : (h) - 8
#endif

/* Eight floats of each of FLOATS vertices to eight lanes: rows are of eight vertices, or of i and
   i + 8 side by side. */
TARGET REEL_INLINE void NAMED(turn)(const part *rows, lane *lanes, int p) {
    part pairs[8], fours[8];
    REEL_UNROLLED for (int i = 0; i < 8; i += 2) {
        pairs[i] = JOIN(rows[i], rows[i + 1],
                        ALONG(0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29));
        pairs[i + 1] = JOIN(rows[i], rows[i + 1],
                            ALONG(2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31));
    }
    REEL_UNROLLED for (int i = 0; i < 8; i++) {
        int a = i / 4 * 4 + i / 2 % 2; /* pairs of rows 0..1 or 4..5; its place in a half */
        fours[i] = i % 2 ? JOIN(pairs[a], pairs[a + 2],
                                ALONG(2, 3, 18, 19, 6, 7, 22, 23, 10, 11, 26, 27, 14, 15, 30, 31))
                         : JOIN(pairs[a], pairs[a + 2],
                                ALONG(0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12, 13, 28, 29));
    }
    REEL_UNROLLED for (int i = 0; i < 4; i++) {
        part a = fours[i], b = fours[i + 4];
        lanes[i * PLACES][p] =
            JOIN(a, b, ALONG(0, 1, 2, 3, 16, 17, 18, 19, 8, 9, 10, 11, 24, 25, 26, 27));
        lanes[(i + 4) * PLACES][p] =
            JOIN(a, b, ALONG(4, 5, 6, 7, 20, 21, 22, 23, 12, 13, 14, 15, 28, 29, 30, 31));
    }
}

/* Eight values less eight others, rounded. */
TARGET REEL_INLINE NAMED(eight) NAMED(apart)(const double *at, const double *base) {
#if FLOATS == 16
    return __builtin_convertvector(*(const doubles *)at - *(const doubles *)base, NAMED(eight));
#else
    floats low = __builtin_convertvector(*(const doubles *)at - *(const doubles *)base, floats);
    floats high = __builtin_convertvector(
        *(const doubles *)(at + 4) - *(const doubles *)(base + 4), floats);
    return JOIN(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
#endif
}

/* Rows of vertices l and l + 8 side by side, or that of one. */
#if FLOATS == 16
#define ROW_OF(l, of) JOIN(of(l), of((l) + 8), 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)
#else
#define ROW_OF(l, of) of(l)
#endif
#endif

/* Offsets of AT_ONCE smooth fields at a place. */
TARGET REEL_INLINE void NAMED(gather_smooth)(const NAMED(batch) *b, const float *smooth, int place,
                                             lane (*offset)[PLACES]) {
    const int32_t *near = b->near[place], *first = b->near[0];
#if TURNS
#define SMOOTH(l)                                                                                  \
    (*(const NAMED(eight) *)(smooth + (int64_t)near[l] * REEL_SMOOTH_FIELDS) -                     \
     *(const NAMED(eight) *)(smooth + (int64_t)first[l] * REEL_SMOOTH_FIELDS))
    FOR_PARTS(p) {
        part rows[8];
        REEL_UNROLLED for (int l = 0; l < 8; l++) {
            rows[l] = ROW_OF(l + 8 * p, SMOOTH);
        }
        NAMED(turn)(rows, offset[0] + place, p);
    }
#undef SMOOTH
#else
    for (int f = 0; f < AT_ONCE; f++) {
        FOR_LANES(l) {
            AT(offset[f][place], l) = smooth[(int64_t)near[l] * REEL_SMOOTH_FIELDS + f] -
                                      smooth[(int64_t)first[l] * REEL_SMOOTH_FIELDS + f];
        }
    }
#endif
}

/* The filter observes the smooth fields of the resolution. */
TARGET REEL_INLINE void NAMED(observe_smooth)(NAMED(batch) *b, int size, const float *smooth,
                                              float smooth_noise) {
    lane offset[REEL_SMOOTH_FIELDS][PLACES], noise = {0}, predicted, error;
    for (int f = 0; f < REEL_SMOOTH_FIELDS; f += AT_ONCE) {
        for (int j = 0; j < size; j++) {
            NAMED(gather_smooth)(b, smooth + f, j, offset + f);
        }
        NAMED(gather_smooth)(b, smooth + f, OWN, offset + f);
    }
    for (int f = 0; f < REEL_SMOOTH_FIELDS; f++) {
        for (int j = 0; j < size; j++) {
            FOR_PARTS(p) {
                part apart = b->real[j][p] * (offset[f][j][p] - offset[f][OWN][p]);
                noise[p] += apart * apart;
            }
        }
    }
    FOR_PARTS(p) noise[p] = smooth_noise / (float)size * noise[p] + SMOOTH_FLOOR;
    for (int f = 0; f < REEL_SMOOTH_FIELDS; f++) {
        NAMED(predict)(b, size, offset[f], predicted);
        FOR_PARTS(p) error[p] = offset[f][OWN][p] - predicted[p];
        NAMED(observe)(b, size, offset[f], predicted, error, noise, 0.0F);
    }
}

/* Offsets of n fields at a place. Vertices have their values side by side, `stride` apart. */
TARGET REEL_INLINE void NAMED(gather_place)(const NAMED(batch) *b, const double *values,
                                            int64_t stride, int n, int place,
                                            NAMED(offsets) *found) {
#if TURNS
#define VALUES(l)                                                                                  \
    NAMED(apart)(values + b->near[place][l] * stride, values + b->near[0][l] * stride)
    if (n == AT_ONCE) {
        FOR_PARTS(p) {
            part rows[8];
            REEL_UNROLLED for (int l = 0; l < 8; l++) {
                rows[l] = ROW_OF(l + 8 * p, VALUES);
            }
            NAMED(turn)(rows, found->offset[0] + place, p);
        }
        return;
    }
#undef VALUES
#endif
    for (int m = 0; m < n; m++) {
        float single[REEL_BATCH];
        FOR_LANES(l) {
            single[l] = (float)(values[b->near[place][l] * stride + m] - found->base[m][l]);
        }
        reel_copy(found->offset[m][place], single, sizeof single);
    }
}

/* Offsets of the fields k..n_fields-1, at most AT_ONCE. */
TARGET REEL_CALLED void NAMED(gather)(const NAMED(batch) *b, int size, const double *values,
                                      int64_t k, int64_t n_fields, bool with_own,
                                      NAMED(offsets) *found) {
    int n = n_fields - k < AT_ONCE ? (int)(n_fields - k) : AT_ONCE;
    for (int m = 0; m < n; m++) {
        FOR_LANES(l) found->base[m][l] = values[b->near[0][l] * n_fields + k + m];
    }
    for (int j = 0; j < size; j++) {
        NAMED(gather_place)(b, values + k, n_fields, n, j, found);
    }
    if (with_own) {
        NAMED(gather_place)(b, values + k, n_fields, n, OWN, found);
    }
}

/* The filter observes the first modes of the key block. */
TARGET REEL_INLINE void NAMED(observe_key)(NAMED(batch) *b, int size, const reel_fields *fields) {
    NAMED(offsets) found;
    lane predicted, error, noise;
    int64_t n_key = fields->n_key;
    int64_t n_modes = n_key < fields->n_learned ? n_key : fields->n_learned;
    FOR_PARTS(p) noise[p] = ROUNDING_NOISE + (part){0};
    for (int64_t k = 0; k < n_modes; k++) {
        lane *offset = found.offset[k % AT_ONCE];
        if (k % AT_ONCE == 0) {
            NAMED(gather)(b, size, fields->key, k, n_key, true, &found);
        }
        NAMED(predict)(b, size, offset, predicted);
        FOR_PARTS(p) error[p] = offset[OWN][p] - predicted[p];
        NAMED(observe)(b, size, offset, predicted, error, noise, RELATIVE_NOISE / (float)size);
    }
}

/* What is known about the weights before the block. */
TARGET REEL_CALLED void NAMED(prepare)(NAMED(batch) *b, int size, const reel_fields *fields,
                                       const float *smooth, float smooth_noise) {
    lane by_distance[MOST];
    NAMED(begin)(b);
    NAMED(start_weights)(b, size);
    reel_copy(by_distance, b->filter.weight, sizeof by_distance);
    reel_zero(b->filter.variance, sizeof b->filter.variance);
    NAMED(add_variance)(b, size, by_distance, PRIOR_VARIANCE);
    NAMED(observe_smooth)(b, size, smooth, smooth_noise);
    NAMED(settle)(b, size);
    NAMED(add_variance)(b, size, by_distance, PRIOR_KEPT * PRIOR_VARIANCE);
    NAMED(observe_key)(b, size, fields);
}

/* Chooses residuals, given the values that they are to come near to and, where noise is shaped,
   what these would be predicted as. Counts zeros and ones of each; false if one is too large. */
TARGET REEL_INLINE bool NAMED(choose)(bool is_plain, const reel_choice *choice,
                                      const doubles *zones, const doubles *expected,
                                      const doubles *wanted, const doubles *would,
                                      integers *residuals, doubles *zeros,
                                      doubles *ones) {
    const doubles none = {0}, one = none + 1.0;
    doubles aim = *wanted;
    if (would) {
        doubles feedback = choice->gain * (*expected - *would);
        aim += WHERE((feedback <= LARGEST_FEEDBACK) & (feedback >= -LARGEST_FEEDBACK), feedback);
    }
    doubles scaled = aim - *expected;
    masks is_negative = scaled < none;
    doubles size = WHERE(is_negative, -scaled) + WHERE(~is_negative, scaled);
    masks is_fine = size < REEL_TOO_LARGE, is_zero = size < *zones;
    *zeros += WHERE(is_zero, one);
    *ones += WHERE(~is_zero & (size < LARGEST_ONE), one);
    /* as reel_rounded, which see */
    doubles raised = WHERE(is_fine, size) + (is_plain ? 0.5 : 0.5 - REEL_ROUNDED_DOWN);
    integers whole = __builtin_convertvector(raised, integers);
    doubles found = __builtin_convertvector(whole, doubles);
    found = WHERE(~is_zero, found + WHERE(found < one, one));
    found = WHERE(~is_negative, found) - WHERE(is_negative, found);
    *residuals = __builtin_convertvector(found, integers);
    int n_fine = 0;
    for (int i = 0; i < WIDTH; i++) {
        n_fine -= (int)is_fine[i];
    }
    return n_fine == WIDTH;
}

/* The same of a mode at the vertices of a batch. */
TARGET REEL_INLINE bool NAMED(choose_lanes)(const NAMED(batch) *b, int size, bool is_plain,
                                            int64_t k, reel_fields *fields,
                                            const reel_choice *choice,
                                            const NAMED(numbers) *expected,
                                            const NAMED(offsets) *shaped) {
    NAMED(numbers) aims, would, zones, zeros = {{0}}, ones = {{0}};
    union {
        int32_t number[REEL_BATCH];
        integers vector[REEL_BATCH / WIDTH];
    } residuals;
    if (shaped) {
        lane predicted;
        NAMED(predict)(b, size, shaped->offset[k % AT_ONCE], predicted);
        FOR_LANES(l) would.number[l] = shaped->base[k % AT_ONCE][l] + (double)AT(predicted, l);
    }
    FOR_LANES(l) {
        aims.number[l] = choice->wanted[b->near[OWN][l] * fields->n_modes + k];
        zones.number[l] = choice->zones[k];
    }
    bool is_fine = true;
    for (int i = 0; i < REEL_BATCH / WIDTH; i++) {
        is_fine &= NAMED(choose)(is_plain, choice, zones.vector + i, expected->vector + i,
                                 aims.vector + i, shaped ? would.vector + i : NULL,
                                 residuals.vector + i, zeros.vector + i, ones.vector + i);
    }
    for (int l = 0; l < b->n_lanes; l++) {
        choice->counts[2 * k] += zeros.number[l];
        choice->counts[2 * k + 1] += ones.number[l];
        fields->residuals[k * fields->n_verts + b->near[OWN][l]] = residuals.number[l];
    }
    return is_fine;
}

/* The first modes at the vertices of a batch; weights follow those that are learned. False if a
   residual is too large. */
TARGET REEL_INLINE bool NAMED(code_first)(NAMED(batch) *b, int size, bool is_plain, bool is_shaped,
                                          int64_t n_first, reel_fields *fields,
                                          const reel_choice *choice) {
    NAMED(offsets) found, shaped;
    lane predicted, error, noise;
    NAMED(numbers) expected;
    int64_t n_modes = fields->n_modes;
    FOR_PARTS(p) noise[p] = ROUNDING_NOISE + (part){0};
    for (int64_t k = 0; k < n_first; k++) {
        int m = (int)(k % AT_ONCE);
        if (!m) {
            NAMED(gather)(b, size, fields->values, k, n_modes, false, &found);
        }
        if (!m && is_shaped) {
            NAMED(gather)(b, size, choice->wanted, k, n_modes, false, &shaped);
        }
        NAMED(predict)(b, size, found.offset[m], predicted);
        FOR_LANES(l) expected.number[l] = found.base[m][l] + (double)AT(predicted, l);
        if (choice && !NAMED(choose_lanes)(b, size, is_plain, k, fields, choice, &expected,
                                           is_shaped ? &shaped : NULL)) {
            return false;
        }
        FOR_LANES(l) {
            int32_t residual = fields->residuals[k * fields->n_verts + b->near[OWN][l]];
            AT(error, l) = (float)residual;
            fields->values[b->near[OWN][l] * n_modes + k] = expected.number[l] + (double)residual;
        }
        if (k < fields->n_learned) {
            NAMED(observe)(b, size, found.offset[m], predicted, error, noise,
                           RELATIVE_NOISE / (float)size);
        }
    }
    return true;
}

/* What n WIDTH modes are expected to be at a vertex of a batch. */
TARGET REEL_INLINE void NAMED(expect)(const NAMED(batch) *b, int size, int l, int n,
                                      const double *values, int64_t stride, doubles *expected) {
    const doubles *base = (const doubles *)(values + b->near[0][l] * stride);
    floats sums[2] = {{0}, {0}};
    for (int j = 0; j < size; j++) {
        const doubles *near = (const doubles *)(values + b->near[j][l] * stride);
        float weight = AT(b->filter.weight[j], l);
        REEL_UNROLLED for (int i = 0; i < n; i++) {
            sums[i] += weight * __builtin_convertvector(near[i] - base[i], floats);
        }
    }
    REEL_UNROLLED for (int i = 0; i < n; i++) {
        expected[i] = base[i] + __builtin_convertvector(sums[i], doubles);
    }
}

/* Residuals that are `stride` apart. */
TARGET REEL_INLINE integers NAMED(collect)(const int32_t *from, int64_t stride) {
#if WIDTH == 2
    return (integers){from[0], from[stride]};
#elif WIDTH == 4
    return (integers){from[0], from[stride], from[2 * stride], from[3 * stride]};
#else
    return (integers){from[0],          from[stride],     from[2 * stride], from[3 * stride],
                      from[4 * stride], from[5 * stride], from[6 * stride], from[7 * stride]};
#endif
}

/* n WIDTH modes at the vertices of a batch, n of 1 or 2, by weights that no longer change. */
TARGET REEL_INLINE bool NAMED(code_settled)(const NAMED(batch) *b, int size, int n, bool is_plain,
                                            bool is_shaped, int64_t k, reel_fields *fields,
                                            const reel_choice *choice) {
    doubles expected[2], would[2], zeros[2] = {{0}, {0}}, ones[2] = {{0}, {0}};
    integers residuals;
    int64_t n_modes = fields->n_modes, n_verts = fields->n_verts;
    bool is_fine = true;
    for (int m = 0; choice && m < n * WIDTH; m++) {
        zeros[m / WIDTH][m % WIDTH] = choice->counts[2 * (k + m)];
        ones[m / WIDTH][m % WIDTH] = choice->counts[2 * (k + m) + 1];
    }
    for (int l = 0; l < b->n_lanes; l++) {
        int64_t own = b->near[OWN][l];
        NAMED(expect)(b, size, l, n, fields->values + k, n_modes, expected);
        if (is_shaped) {
            NAMED(expect)(b, size, l, n, choice->wanted + k, n_modes, would);
        }
        doubles *values = (doubles *)(fields->values + own * n_modes + k);
        REEL_UNROLLED for (int i = 0; i < n; i++) {
            int32_t *given = fields->residuals + (k + i * WIDTH) * n_verts + own;
            if (choice) {
                is_fine &= NAMED(choose)(
                    is_plain, choice, (const doubles *)(choice->zones + k) + i, &expected[i],
                    (const doubles *)(choice->wanted + own * n_modes + k) + i,
                    is_shaped ? &would[i] : NULL, &residuals, &zeros[i], &ones[i]);
                for (int m = 0; m < WIDTH; m++) {
                    given[m * n_verts] = residuals[m];
                }
            } else {
                residuals = NAMED(collect)(given, n_verts);
            }
            values[i] = expected[i] + __builtin_convertvector(residuals, doubles);
        }
    }
    for (int m = 0; choice && m < n * WIDTH; m++) {
        choice->counts[2 * (k + m)] = zeros[m / WIDTH][m % WIDTH];
        choice->counts[2 * (k + m) + 1] = ones[m / WIDTH][m % WIDTH];
    }
    return is_fine;
}

/* All modes at the vertices of a batch; false if a residual is too large. */
TARGET REEL_INLINE bool NAMED(code_batch)(NAMED(batch) *b, int size, bool is_plain, bool is_shaped,
                                          reel_fields *fields, const reel_choice *choice) {
    int64_t n_modes = fields->n_modes, n_settled = n_modes - fields->n_learned;
    int64_t n_first = n_settled < 0 ? n_modes : fields->n_learned + n_settled % WIDTH;
    bool is_fine = NAMED(code_first)(b, size, is_plain, is_shaped, n_first, fields, choice);
    int64_t k = n_first;
    for (; TOGETHER == 2 && is_fine && k + 2 * WIDTH <= n_modes; k += 2 * WIDTH) {
        is_fine = NAMED(code_settled)(b, size, TOGETHER, is_plain, is_shaped, k, fields, choice);
    }
    for (; is_fine && k < n_modes; k += WIDTH) {
        is_fine = NAMED(code_settled)(b, size, 1, is_plain, is_shaped, k, fields, choice);
    }
    return is_fine;
}

/* Where the filter of a batch is kept. Those of a level lie behind all of the levels before. */
TARGET REEL_INLINE NAMED(filter) *NAMED(place_of)(const reel_fields *fields, int64_t level,
                                                  int64_t first) {
    return (NAMED(filter) *)fields->prepared + first / REEL_BATCH + level;
}

TARGET REEL_INLINE void NAMED(prepare_level)(const reel_mesh *mesh, const reel_fields *fields,
                                             int64_t level, int64_t first, int64_t last,
                                             int size) {
    NAMED(batch) b;
    const float *smooth = mesh->smooth + mesh->smooth_starts[level] * REEL_SMOOTH_FIELDS;
    float noise = smooth_noise(mesh, level);
    for (; first < last; first += REEL_BATCH) {
        NAMED(load_batch)(&b, mesh, size, first, last);
        NAMED(prepare)(&b, size, fields, smooth, noise);
        NAMED(settle)(&b, size);
        *NAMED(place_of)(fields, level, first) = b.filter;
    }
}

TARGET static void NAMED(keep)(const reel_mesh *mesh, const reel_fields *fields, int64_t level,
                               int64_t first, int64_t last) {
    NAMED(prepare_level)(mesh, fields, level, first, last, (int)mesh->stencil_size);
}

TARGET REEL_INLINE bool NAMED(code_level)(const reel_mesh *mesh, reel_fields *fields,
                                          const reel_choice *choice, int64_t level, int64_t first,
                                          int64_t last, int size) {
    NAMED(batch) b;
    const float *smooth = mesh->smooth + mesh->smooth_starts[level] * REEL_SMOOTH_FIELDS;
    float noise = smooth_noise(mesh, level);
    bool is_shaped = choice && level >= choice->first_shaped;
    bool is_plain = choice && choice->price == 0.0;
    for (int64_t n = 0; first < last; first += REEL_BATCH, n++) {
        if (choice && n % COUNTED_BATCHES == 0) {
            set_zones(choice, fields->n_modes, is_plain);
        }
        NAMED(load_batch)(&b, mesh, size, first, last);
        if (fields->prepared) {
            b.filter = *NAMED(place_of)(fields, level, first);
            NAMED(begin)(&b);
        } else {
            NAMED(prepare)(&b, size, fields, smooth, noise);
        }
        if (!NAMED(code_batch)(&b, size, is_plain, is_shaped, fields, choice)) {
            return false;
        }
    }
    return true;
}

/* Vertices first..last-1 of a level above the coarsest. */
TARGET static bool NAMED(code)(const reel_mesh *mesh, reel_fields *fields,
                               const reel_choice *choice, int64_t level, int64_t first,
                               int64_t last) {
#ifdef REEL_DECODER_ONLY
    choice = NULL;
#endif
    return NAMED(code_level)(mesh, fields, choice, level, first, last, (int)mesh->stencil_size);
}

#undef PARTS
#undef part
#undef lane
#undef FOR_PARTS
#undef AT
#undef ROWS
#undef WIDTH
#undef TURNS
#undef TOGETHER
#undef JOIN
#undef ALONG
#undef ROW_OF
#undef doubles
#undef floats
#undef integers
#undef masks
#undef WHERE
