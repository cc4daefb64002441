/* What predict.c does with REEL_BATCH vertices at once. It is included once for each kind of
   registers; see cpu.h. FLOATS is how many floats a vector has; several make a lane. A lane is one
   vertex, and nothing is added up across lanes: the order of operations of a vertex is that of
   the code, and its bits are the same on all. No include guard. */

#define PARTS (REEL_BATCH / FLOATS)
#define part REEL_JOIN(reel_floats_, FLOATS)
#define lane NAMED(lane)

typedef part lane[PARTS];

#define FOR_PARTS(p) for (int p = 0; p < PARTS; p++)
#define AT(lanes, l) (((float *)(lanes))[l]) /* the core is built without strict aliasing */

typedef struct {
    int n_lanes; /* that are vertices of their own; others repeat the last */
    int64_t own[REEL_BATCH];
    int32_t near[MOST][REEL_BATCH]; /* a place that is not there repeats the first */
    lane real[MOST];                /* 1, or 0 where a place is not there */
    lane prior[MOST];               /* variance by distance; 0 where a place is not there */
    lane weight[MOST];
    lane variance[MOST][MOST];      /* its lower triangle */
} NAMED(batch);

TARGET REEL_INLINE void NAMED(load_batch)(NAMED(batch) *b, const reel_mesh *mesh, int size,
                                          int64_t first, int64_t last) {
    b->n_lanes = last - first < REEL_BATCH ? (int)(last - first) : REEL_BATCH;
    FOR_LANES(l) {
        int64_t own = first + (l < b->n_lanes ? l : b->n_lanes - 1);
        const int32_t *near = mesh->stencil + own * size;
        const uint8_t *hops = mesh->hops + own * size;
        b->own[l] = own;
        for (int j = 0; j < size; j++) {
            bool is_there = near[j] >= 0;
            b->near[j][l] = is_there ? near[j] : near[0];
            AT(b->real[j], l) = is_there ? 1.0F : 0.0F;
            AT(b->prior[j], l) =
                is_there ? (float)(hops[0] * hops[0]) / (float)(hops[j] * hops[j]) : 0.0F;
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
        FOR_PARTS(p) b->weight[j][p] = b->prior[j][p] / sum[p];
    }
}

/* Adds a share of their variance by distance, which leaves their sum alone. */
TARGET REEL_INLINE void NAMED(add_variance)(NAMED(batch) *b, int size, const lane *by_distance,
                                            float share) {
    for (int i = 0; i < size; i++) {
        for (int j = 0; j < i; j++) {
            FOR_PARTS(p) b->variance[i][j][p] -= share * (by_distance[i][p] * b->prior[j][p]);
        }
        FOR_PARTS(p) b->variance[i][i][p] +=
            share * (b->prior[i][p] - by_distance[i][p] * b->prior[i][p]);
    }
}

TARGET REEL_INLINE void NAMED(predict)(const NAMED(batch) *b, int size, const lane *offset,
                                       part *predicted) {
    FOR_PARTS(p) predicted[p] = (part){0};
    for (int j = 0; j < size; j++) {
        FOR_PARTS(p) predicted[p] += b->weight[j][p] * offset[j][p];
    }
}

/* The filter observes a field: the weights go towards what would have predicted it without the
   error. Offsets become those to the prediction. */
TARGET REEL_INLINE void NAMED(observe)(NAMED(batch) *b, int size, lane *offset,
                                       const part *predicted, const part *error,
                                       const part *noise, float relative) {
    lane gain[MOST], total, energy = {0};
    for (int i = 0; i < size; i++) {
        FOR_PARTS(p) offset[i][p] = b->real[i][p] * (offset[i][p] - predicted[p]);
        FOR_PARTS(p) gain[i][p] = (part){0};
    }
    for (int i = 0; i < size; i++) {
        lane row = {0};
        for (int j = 0; j < i; j++) {
            FOR_PARTS(p) row[p] += b->variance[i][j][p] * offset[j][p];
            FOR_PARTS(p) gain[j][p] += b->variance[i][j][p] * offset[i][p];
        }
        FOR_PARTS(p) gain[i][p] = row[p] + b->variance[i][i][p] * offset[i][p];
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
        lane scaled;
        FOR_PARTS(p) scaled[p] = gain[i][p] * total[p];
        FOR_PARTS(p) b->weight[i][p] += scaled[p] * error[p];
        for (int j = 0; j <= i; j++) {
            FOR_PARTS(p) b->variance[i][j][p] -= scaled[p] * gain[j][p];
        }
    }
}

/* Offsets of a smooth field to the first vertex of the stencil; that of the vertex itself. */
TARGET REEL_INLINE void NAMED(gather_smooth)(const NAMED(batch) *b, int size, const float *smooth,
                                             lane *offset, part *own) {
    FOR_LANES(l) {
        float base = smooth[(int64_t)b->near[0][l] * REEL_SMOOTH_FIELDS];
        AT(own, l) = smooth[b->own[l] * REEL_SMOOTH_FIELDS] - base;
        for (int j = 0; j < size; j++) {
            AT(offset[j], l) = smooth[(int64_t)b->near[j][l] * REEL_SMOOTH_FIELDS] - base;
        }
    }
}

/* The filter observes the smooth fields of the resolution. */
TARGET REEL_INLINE void NAMED(observe_smooth)(NAMED(batch) *b, int size, const float *smooth) {
    lane offset[REEL_SMOOTH_FIELDS][MOST], own[REEL_SMOOTH_FIELDS];
    lane noise = {0}, predicted, error;
    for (int f = 0; f < REEL_SMOOTH_FIELDS; f++) {
        NAMED(gather_smooth)(b, size, smooth + f, offset[f], own[f]);
        for (int j = 0; j < size; j++) {
            FOR_PARTS(p) {
                part apart = b->real[j][p] * (offset[f][j][p] - own[f][p]);
                noise[p] += apart * apart;
            }
        }
    }
    FOR_PARTS(p) noise[p] = SMOOTH_NOISE / (float)size * noise[p] + SMOOTH_FLOOR;
    for (int f = 0; f < REEL_SMOOTH_FIELDS; f++) {
        NAMED(predict)(b, size, offset[f], predicted);
        FOR_PARTS(p) error[p] = own[f][p] - predicted[p];
        NAMED(observe)(b, size, offset[f], predicted, error, noise, 0.0F);
    }
}

/* Offsets of values, which stand `stride` apart, to the first vertex of the stencil. */
TARGET REEL_INLINE void NAMED(gather)(const NAMED(batch) *b, int size, const double *values,
                                      int64_t stride, double *base, lane *offset) {
    FOR_LANES(l) base[l] = values[b->near[0][l] * stride];
    for (int j = 0; j < size; j++) {
        float found[REEL_BATCH];
        FOR_LANES(l) found[l] = (float)(values[b->near[j][l] * stride] - base[l]);
        reel_copy(offset[j], found, sizeof found);
    }
}

/* The filter observes the first modes of the key block. */
TARGET REEL_INLINE void NAMED(observe_key)(NAMED(batch) *b, int size, const reel_fields *fields) {
    lane offset[MOST], predicted, error, noise;
    double base[REEL_BATCH];
    int64_t n_modes = fields->n_key < fields->n_learned ? fields->n_key : fields->n_learned;
    FOR_PARTS(p) noise[p] = ROUNDING_NOISE + (part){0};
    for (int64_t k = 0; k < n_modes; k++) {
        const double *key = fields->key + k;
        NAMED(gather)(b, size, key, fields->n_key, base, offset);
        NAMED(predict)(b, size, offset, predicted);
        FOR_LANES(l) AT(error, l) = (float)(key[b->own[l] * fields->n_key] - base[l]);
        FOR_PARTS(p) error[p] -= predicted[p];
        NAMED(observe)(b, size, offset, predicted, error, noise, RELATIVE_NOISE / (float)size);
    }
}

/* What is known about the weights before the block. */
TARGET REEL_INLINE void NAMED(prepare)(NAMED(batch) *b, int size, const reel_fields *fields,
                                       const float *smooth) {
    lane by_distance[MOST];
    NAMED(start_weights)(b, size);
    reel_copy(by_distance, b->weight, sizeof by_distance);
    for (int i = 0; i < size; i++) {
        reel_zero(b->variance[i], (size_t)(i + 1) * sizeof(lane));
    }
    NAMED(add_variance)(b, size, by_distance, PRIOR_VARIANCE);
    NAMED(observe_smooth)(b, size, smooth);
    NAMED(add_variance)(b, size, by_distance, PRIOR_KEPT * PRIOR_VARIANCE);
    NAMED(observe_key)(b, size, fields);
}

/* Chooses the residuals of a mode at the vertices of a batch; false if one is too large. */
TARGET REEL_INLINE bool NAMED(choose)(const NAMED(batch) *b, int size, bool is_plain,
                                      bool is_shaped, int64_t k, reel_fields *fields,
                                      const reel_choice *choice, const double *expected) {
    double base[REEL_BATCH], aim[REEL_BATCH];
    const double *wanted = choice->wanted + k;
    FOR_LANES(l) aim[l] = wanted[b->own[l] * fields->n_modes];
    if (is_shaped) {
        lane offset[MOST], predicted;
        NAMED(gather)(b, size, wanted, fields->n_modes, base, offset);
        NAMED(predict)(b, size, offset, predicted);
        FOR_LANES(l) {
            double feedback = choice->gain * (expected[l] - (base[l] + (double)AT(predicted, l)));
            bool is_small = feedback <= LARGEST_FEEDBACK && feedback >= -LARGEST_FEEDBACK;
            aim[l] += is_small ? feedback : 0.0;
        }
    }
    for (int l = 0; l < b->n_lanes; l++) {
        double scaled = aim[l] - expected[l];
        if (!(scaled < REEL_TOO_LARGE && scaled > -REEL_TOO_LARGE)) {
            return false;
        }
        fields->residuals[k * fields->n_verts + b->own[l]] =
            quantize(scaled, is_plain, choice->counts + 2 * k, choice->zones[k]);
    }
    return true;
}

/* All modes at the vertices of a batch; false if a residual is too large. */
TARGET REEL_INLINE bool NAMED(code_batch)(NAMED(batch) *b, int size, bool is_plain, bool is_shaped,
                            reel_fields *fields, const reel_choice *choice) {
    lane offset[MOST], predicted = {0}, error, noise;
    double base[REEL_BATCH] = {0}, expected[REEL_BATCH];
    int64_t n_modes = fields->n_modes;
    FOR_PARTS(p) noise[p] = ROUNDING_NOISE + (part){0};
    for (int64_t k = 0; k < n_modes; k++) {
        if (size) {
            NAMED(gather)(b, size, fields->values + k, n_modes, base, offset);
            NAMED(predict)(b, size, offset, predicted);
        }
        FOR_LANES(l) expected[l] = base[l] + (double)AT(predicted, l);
        if (choice && !NAMED(choose)(b, size, is_plain, is_shaped, k, fields, choice, expected)) {
            return false;
        }
        FOR_LANES(l) {
            int32_t residual = fields->residuals[k * fields->n_verts + b->own[l]];
            AT(error, l) = (float)residual;
            fields->values[b->own[l] * n_modes + k] = expected[l] + (double)residual;
        }
        if (size && k < fields->n_learned) {
            NAMED(observe)(b, size, offset, predicted, error, noise, RELATIVE_NOISE / (float)size);
        }
    }
    return true;
}

TARGET REEL_INLINE bool NAMED(code_level)(const reel_mesh *mesh, reel_fields *fields,
                                          const reel_choice *choice, int64_t level, int64_t first,
                                          int64_t last, int size) {
    NAMED(batch) b;
    const float *smooth = mesh->smooth + mesh->smooth_starts[level] * REEL_SMOOTH_FIELDS;
    bool is_shaped = choice && size && level >= choice->first_shaped;
    bool is_plain = choice && (level == 0 || choice->price == 0.0);
    for (int64_t n = 0; first < last; first += REEL_BATCH, n++) {
        if (choice && n % COUNTED_BATCHES == 0) {
            set_zones(choice, fields->n_modes, is_plain);
        }
        NAMED(load_batch)(&b, mesh, size, first, last);
        if (size) {
            NAMED(prepare)(&b, size, fields, smooth);
        }
        if (!NAMED(code_batch)(&b, size, is_plain, is_shaped, fields, choice)) {
            return false;
        }
    }
    return true;
}

/* Vertices first..last-1, level after level. Full stencils have code of their own. */
TARGET static int64_t NAMED(code)(const reel_mesh *mesh, reel_fields *fields,
                                  const reel_choice *choice, int64_t first, int64_t last) {
    for (int64_t level = 0; level < mesh->n_levels; level++) {
        int64_t start = mesh->level_starts[level], stop = mesh->level_starts[level + 1];
        start = start > first ? start : first;
        stop = stop < last ? stop : last;
        if (start >= stop) {
            continue;
        }
        int size = level ? (int)mesh->stencil_size : 0;
        if (choice) {
            fade(choice, fields->n_modes);
        }
        bool done = size == MOST && choice
                        ? NAMED(code_level)(mesh, fields, choice, level, start, stop, MOST)
                    : size == MOST
                        ? NAMED(code_level)(mesh, fields, NULL, level, start, stop, MOST)
                        : NAMED(code_level)(mesh, fields, choice, level, start, stop, size);
        if (!done) {
            return reel_failure(REEL_INVALID, (uint64_t)level);
        }
    }
    return 0;
}

#undef PARTS
#undef part
#undef lane
#undef FOR_PARTS
#undef AT
