/* Numbers of rows, expected and coded, on vectors of LANES doubles: see cpu.h and exact_items.c.

   Rows of the filter are INPUTS numbers, of which the last are 0. Nothing is added up across lanes
   but the gains, in the order of the inputs, and sums of products. */

#define PARTS (INPUTS / LANES)
#define SUMS (4 / LANES)
#define FOR_PARTS(k) REEL_UNROLLED for (int k = 0; k < PARTS; k++)
#define FOR_SUMS(k) REEL_UNROLLED for (int k = 0; k < SUMS; k++)

#define vector REEL_JOIN(reel_vector_, LANES)

/* The sum of products, of every fourth by itself; temporal inputs come last. */
TARGET REEL_INLINE double NAMED(filter_sum)(const double *a, const double *inputs, int n,
                                            const double *temporal) {
    vector sums[SUMS];
    FOR_SUMS(k) {
        sums[k] = (vector){0};
    }
    FOR_PARTS(k) {
        sums[k % SUMS] += ((const vector *)a)[k] * ((const vector *)inputs)[k];
    }
    double *each = (double *)sums;
    for (int i = 0; temporal && i < TEMPORAL; i++) {
        each[(n + i) % 4] += a[n + i] * temporal[i];
    }
    return (each[0] + each[1]) + (each[2] + each[3]);
}

/* Variance of the expected move, with gains, the doubt times the inputs, on the way. */
TARGET REEL_INLINE double NAMED(find_gains)(exact_coder *f, const double *inputs,
                                            const double *temporal) {
    const vector *row = (const vector *)f->doubt;
    vector sums[PARTS];
    FOR_PARTS(k) {
        sums[k] = (vector){0};
    }
    for (int j = 0; j < REEL_MOST_NEAR; j++) {
        FOR_PARTS(k) {
            sums[k] += row[PARTS * j + k] * inputs[j];
        }
    }
    for (int i = 0; i < TEMPORAL; i++) {
        FOR_PARTS(k) {
            sums[k] += row[PARTS * (f->n_near + i) + k] * temporal[i];
        }
    }
    FOR_PARTS(k) {
        ((vector *)f->gains)[k] = sums[k];
    }
    return NAMED(filter_sum)(f->gains, inputs, f->n_near, temporal);
}

/* Learns from an error of variance `spread`, where they are numbers to learn from: weights take a
   step along the gains, and the doubt along them shrinks. */
TARGET REEL_INLINE bool NAMED(observe)(exact_coder *f, double error, double spread) {
    if (!(spread > 0 && spread < 1e100 && error * error < 1e100)) {
        return false;
    }
    double by = 1.0 / spread, step = error * by;
    vector parts[PARTS];
    FOR_PARTS(k) {
        parts[k] = ((const vector *)f->gains)[k];
        ((vector *)f->weights)[k] += parts[k] * step;
    }
    for (int j = 0; j < INPUTS; j++) {
        vector *row = (vector *)(f->doubt + INPUTS * j);
        double gain = f->gains[j] * by;
        FOR_PARTS(k) {
            row[k] -= parts[k] * gain;
        }
    }
    return true;
}

/* What is known about weights fades, unless it is next to nothing. */
TARGET REEL_INLINE void NAMED(fade)(exact_coder *f) {
    double sum = 0;
    for (int i = 0; i < f->n_near + TEMPORAL; i++) {
        sum += f->doubt[INPUTS * i + i];
    }
    if (!(sum < WIDE)) {
        return;
    }
    for (int k = 0; k < INPUTS * PARTS; k++) {
        ((vector *)f->doubt)[k] *= FADING;
    }
}

/* Weights are known a little from where neighbours are at frame 0. */
TARGET static void NAMED(observe_places)(exact_coder *f, int64_t col, double mean, double value) {
    static const double none[TEMPORAL] = {0};
    int64_t stride = f->n_frames * f->width;
    double places[INPUTS] __attribute__((aligned(REEL_ALIGNMENT))) = {0};
    for (int i = 0; i < f->n_near; i++) {
        places[i] = f->known[f->near[i] * stride + col] - mean;
    }
    double squares = NAMED(filter_sum)(places, places, 0, NULL);
    double sum = NAMED(filter_sum)(f->weights, places, 0, NULL);
    double spread = NAMED(find_gains)(f, places, none) + 0.2 * (squares / f->n_near);
    NAMED(observe)(f, (value - mean) - sum, spread + f->numbers.rounding);
}

/* How the item moved beside its neighbours, which moved so, between two of its numbers. */
TARGET REEL_INLINE double NAMED(own_move)(const exact_coder *f, const double *moves, double move) {
    return move - NAMED(filter_sum)(f->weights, moves, 0, NULL);
}

/* The expected move of a number since the last frame: from those of near items, and from the own
   ones of late. */
TARGET REEL_INLINE double NAMED(expected_move)(exact_coder *f, int64_t t, int64_t col,
                                               double *spread) {
    int64_t w = f->width, lag = f->lags[t], at = (t - f->first + 1) * w + col;
    const double *own = f->known + (f->place * f->n_frames + t) * w + col;
    const double *moves = f->moves + at * INPUTS;
    double temporal[TEMPORAL] = {0};
    if (t > 1) {
        temporal[0] = NAMED(own_move)(f, moves - w * INPUTS, own[-w] - own[-2 * w]);
    }
    if (lag) {
        temporal[1] = NAMED(own_move)(f, f->again + at * INPUTS, own[-lag * w] - own[-w]);
    }
    double quick = 4 * f->quick_noise, noise = f->noise < quick ? f->noise : quick;
    *spread = (NAMED(find_gains)(f, moves, temporal) + noise) + f->numbers.rounding;
    return NAMED(filter_sum)(f->weights, moves, f->n_near, temporal);
}

TARGET REEL_INLINE expectation NAMED(expected_at)(exact_coder *f, int64_t t, int64_t col) {
    expectation found = {0};
    found.base = f->known[(f->place * f->n_frames + t - 1) * f->width + col];
    if (f->kind == FILTER) {
        found.value = found.base + NAMED(expected_move)(f, t, col, &found.spread);
    } else {
        found.value = found.base + mean_near(f, t, col, N_NEAR);
    }
    if (f->numbers.type != REEL_FLOATS) {
        found.index = reel_integer_of(&f->numbers, f->own[(t - 1) * f->width + col]);
    }
    return found;
}

TARGET REEL_INLINE void NAMED(learn_move)(exact_coder *f, const expectation *from, double value) {
    double error = value - from->value;
    if (NAMED(observe)(f, error, from->spread)) {
        f->noise += (error * error - f->noise) / 20;
        f->quick_noise += (error * error - f->quick_noise) / 8;
    }
}

/* A number of a row of which nothing else is known. */
TARGET REEL_INLINE void NAMED(code_number)(exact_coder *f, int64_t t, int64_t col) {
    const reel_numbers *numbers = &f->numbers;
    expectation from = t ? NAMED(expected_at)(f, t, col) : expected_at_first(f, col);
    uint64_t pattern = f->own[t * f->width + col];
    if (!(from.value >= -0x1p1000 && from.value <= 0x1p1000)) {
        from.value = from.base;
    }
    int32_t step;
    int decade = f->past[col].decade;
    uint64_t index =
        reel_expected_index(numbers, from.value, from.base, from.index, &decade, &step);
    f->past[col].decade = decade;
    int32_t inputs[N_INPUTS], size = expected_size(f, t, col, from.spread, inputs);
    if (f->has_odd && code_odd(f, t, col, &pattern)) {
        put_pattern(f, t, col, pattern);
        note(f, t, col, from.value, within(size, REEL_MOST_SIZE));
        return;
    }
    uint64_t difference = reel_index_of(numbers, pattern, &decade) - index;
    difference = code_difference(f, class_of(size - step), difference);
    if (!reel_writes(f->port)) {
        pattern = reel_pattern_of(numbers, index + difference, decade);
        put_pattern(f, t, col, pattern);
    }
    int32_t found = size_of(difference >> 63 ? 0 - difference : difference) + step;
    found = within(found, REEL_MOST_SIZE);
    learn_size(f, inputs, found - size);
    double value = reel_known_value(numbers, pattern, from.value);
    note(f, t, col, value, found);
    if (f->kind != FILTER) {
        return;
    }
    if (t) {
        NAMED(learn_move)(f, &from, value);
    } else if (f->n_near) {
        NAMED(observe_places)(f, col, from.value, value);
    }
}

TARGET static void NAMED(code_numbers)(exact_coder *f, int64_t t) {
    f->flags[f->place * f->n_frames + t] = MOVED;
    for (int64_t col = 0; col < f->width; col++) {
        NAMED(code_number)(f, t, col);
    }
    end_row(f, t);
    if (t && f->kind == FILTER) {
        NAMED(fade)(f);
    }
}

#undef PARTS
#undef SUMS
#undef FOR_PARTS
#undef FOR_SUMS
#undef vector
