/* Prediction and coding of numbers, on vectors of LANES doubles: see cpu.h and exact_items.c.

   Rows of the filter are padded to INPUTS numbers with zeros. Only sums of
   products are summed across lanes, in a fixed order.

     VEC            LANES doubles; a row has N_VECS of them
     FOR_VECS(k)    loop over the vectors of a row
     FOR_SUMS(k)    loop over the vectors that hold four partial sums */

#define N_VECS (INPUTS / LANES)
#define SUMS (4 / LANES)
#define FOR_VECS(k) REEL_UNROLLED for (int k = 0; k < N_VECS; k++)
#define FOR_SUMS(k) REEL_UNROLLED for (int k = 0; k < SUMS; k++)

#define VEC NAMED(vec)
typedef double VEC __attribute__((vector_size(8 * LANES), may_alias));

/* Inner product in four interleaved partial sums; the temporal inputs come last. */
TARGET REEL_INLINE double NAMED(filter_sum)(const double *a, const double *inputs, int n,
                                            const double *temporal) {
    VEC sums[SUMS];
    FOR_SUMS(k) { sums[k] = (VEC){0}; }
    FOR_VECS(k) { sums[k % SUMS] += ((const VEC *)a)[k] * ((const VEC *)inputs)[k]; }
    double *partial_sums = (double *)sums;
    for (int i = 0; temporal && i < TEMPORAL; i++) {
        partial_sums[(n + i) % 4] += a[n + i] * temporal[i];
    }
    return (partial_sums[0] + partial_sums[1]) + (partial_sums[2] + partial_sums[3]);
}

/* Compute the gains, covariance times inputs; returns the variance of the predicted motion. */
TARGET REEL_INLINE double NAMED(find_gains)(exact_coder *coder, const double *inputs,
                                            const double *temporal) {
    const VEC *row = (const VEC *)coder->filter.covariance;
    VEC sums[N_VECS];
    FOR_VECS(k) { sums[k] = (VEC){0}; }
    for (int j = 0; j < REEL_MAX_NEAR; j++) {
        FOR_VECS(k) { sums[k] += row[N_VECS * j + k] * inputs[j]; }
    }
    for (int i = 0; i < TEMPORAL; i++) {
        FOR_VECS(k) { sums[k] += row[N_VECS * (coder->item.n_near + i) + k] * temporal[i]; }
    }
    FOR_VECS(k) { ((VEC *)coder->filter.gains)[k] = sums[k]; }
    return NAMED(filter_sum)(coder->filter.gains, inputs, coder->item.n_near, temporal);
}

/* Kalman update with a prediction error and its variance: move the weights along the gains, and
   shrink the covariance. Returns false if the numbers are unusable. */
TARGET REEL_INLINE bool NAMED(update_filter)(motion_filter *filter, double error, double variance) {
    if (!(variance > 0 && variance < 1e100 && error * error < 1e100)) {
        return false;
    }
    double scale = 1.0 / variance, step = error * scale;
    VEC gains[N_VECS];
    FOR_VECS(k) {
        gains[k] = ((const VEC *)filter->gains)[k];
        ((VEC *)filter->weights)[k] += gains[k] * step;
    }
    for (int j = 0; j < INPUTS; j++) {
        VEC *row = (VEC *)(filter->covariance + INPUTS * j);
        double gain = filter->gains[j] * scale;
        FOR_VECS(k) { row[k] -= gains[k] * gain; }
    }
    return true;
}

/* Inflate the covariance, unless the weights are nearly unknown. */
TARGET REEL_INLINE void NAMED(inflate_covariance)(motion_filter *filter, int n_inputs) {
    double sum = 0;
    for (int i = 0; i < n_inputs; i++) {
        sum += filter->covariance[INPUTS * i + i];
    }
    if (!(sum < INITIAL_VARIANCE)) {
        return;
    }
    for (int k = 0; k < INPUTS * N_VECS; k++) {
        ((VEC *)filter->covariance)[k] *= COVARIANCE_GROWTH;
    }
}

/* Initialize the weights from the positions of the neighbors at frame 0. */
TARGET static void NAMED(update_from_positions)(exact_coder *coder, int64_t col, double mean,
                                                double value) {
    static const double zeros[TEMPORAL] = {0};
    int64_t stride = coder->n_frames * coder->width;
    double positions[INPUTS] __attribute__((aligned(REEL_ALIGNMENT))) = {0};
    for (int i = 0; i < coder->item.n_near; i++) {
        positions[i] = coder->past.values[coder->item.near[i] * stride + col] - mean;
    }
    double squares = NAMED(filter_sum)(positions, positions, 0, NULL);
    double sum = NAMED(filter_sum)(coder->filter.weights, positions, 0, NULL);
    double variance =
        NAMED(find_gains)(coder, positions, zeros) + 0.2 * (squares / coder->item.n_near);
    NAMED(update_filter)(&coder->filter, (value - mean) - sum, variance + coder->numbers.rounding);
}

/* Motion of the item relative to the weighted motions of its neighbors. */
TARGET REEL_INLINE double NAMED(residual_motion)(const exact_coder *coder, const double *motions,
                                                 double motion) {
    return motion - NAMED(filter_sum)(coder->filter.weights, motions, 0, NULL);
}

/* Predict the motion of a number since the last frame, from its neighbors' motions and its own
   recent ones. */
TARGET REEL_INLINE double NAMED(predict_motion)(exact_coder *coder, int64_t t, int64_t col,
                                                double *variance) {
    int64_t w = coder->width, lag = coder->lags[t],
            index = (t - coder->filter.first_frame + 1) * w + col;
    const double *patterns =
        coder->past.values + (coder->item.position * coder->n_frames + t) * w + col;
    const double *motions = coder->filter.motions + index * INPUTS;
    double temporal[TEMPORAL] = {0};
    if (t > 1) {
        temporal[0] =
            NAMED(residual_motion)(coder, motions - w * INPUTS, patterns[-w] - patterns[-2 * w]);
    }
    if (lag) {
        temporal[1] = NAMED(residual_motion)(coder, coder->filter.lagged_motions + index * INPUTS,
                                             patterns[-lag * w] - patterns[-w]);
    }
    double fast = 4 * coder->filter.fast_noise,
           noise = coder->filter.noise < fast ? coder->filter.noise : fast;
    *variance = (NAMED(find_gains)(coder, motions, temporal) + noise) + coder->numbers.rounding;
    return NAMED(filter_sum)(coder->filter.weights, motions, coder->item.n_near, temporal);
}

TARGET REEL_INLINE prediction NAMED(predict_at)(exact_coder *coder, int64_t t, int64_t col) {
    prediction result = {0};
    result.base =
        coder->past.values[(coder->item.position * coder->n_frames + t - 1) * coder->width + col];
    if (coder->choices.kind == FILTER) {
        result.value = result.base + NAMED(predict_motion)(coder, t, col, &result.variance);
    } else {
        result.value = result.base + mean_near(coder, t, col, N_NEAR);
    }
    if (coder->numbers.type != REEL_FLOATS) {
        result.index =
            reel_integer_of(&coder->numbers, coder->item.patterns[(t - 1) * coder->width + col]);
    }
    return result;
}

TARGET REEL_INLINE void NAMED(learn_motion)(exact_coder *coder, const prediction *predicted,
                                            double value) {
    double error = value - predicted->value;
    if (NAMED(update_filter)(&coder->filter, error, predicted->variance)) {
        coder->filter.noise += (error * error - coder->filter.noise) / 20;
        coder->filter.fast_noise += (error * error - coder->filter.fast_noise) / 8;
    }
}

TARGET REEL_INLINE void NAMED(code_number)(exact_coder *coder, int64_t t, int64_t col) {
    const reel_numbers *numbers = &coder->numbers;
    prediction predicted = t ? NAMED(predict_at)(coder, t, col) : predict_first(coder, col);
    uint64_t pattern = coder->item.patterns[t * coder->width + col];
    if (!(predicted.value >= -0x1p1000 && predicted.value <= 0x1p1000)) {
        predicted.value = predicted.base;
    }
    int32_t step;
    int decade = coder->columns[col].decade;
    uint64_t index = reel_predict_index(numbers, predicted.value, predicted.base, predicted.index,
                                        &decade, &step);
    coder->columns[col].decade = decade;
    int32_t inputs[N_INPUTS], size = predict_size(coder, t, col, predicted.variance, inputs);
    if (coder->choices.has_special && code_special(coder, t, &pattern)) {
        put_pattern(coder, t, col, pattern);
        record(coder, t, col, predicted.value, clamp(size, REEL_MAX_SIZE));
        return;
    }
    uint64_t difference = reel_index_of(numbers, pattern, &decade) - index;
    difference = code_difference(coder, class_of(size - step), difference);
    if (!reel_is_encoder(coder->range_coder)) {
        pattern = reel_pattern_of(numbers, index + difference, decade);
        put_pattern(coder, t, col, pattern);
    }
    int32_t coded_size = size_of(difference >> 63 ? 0 - difference : difference) + step;
    coded_size = clamp(coded_size, REEL_MAX_SIZE);
    update_size_weights(coder, inputs, coded_size - size);
    double value = reel_known_value(numbers, pattern, predicted.value);
    record(coder, t, col, value, coded_size);
    if (coder->choices.kind != FILTER) {
        return;
    }
    if (t) {
        NAMED(learn_motion)(coder, &predicted, value);
    } else if (coder->item.n_near) {
        NAMED(update_from_positions)(coder, col, predicted.value, value);
    }
}

TARGET static void NAMED(code_numbers)(exact_coder *coder, int64_t t) {
    flags_of(coder, coder->item.position)[t] = MOVED;
    for (int64_t col = 0; col < coder->width; col++) {
        NAMED(code_number)(coder, t, col);
    }
    update_columns(coder, t);
    if (t && coder->choices.kind == FILTER) {
        NAMED(inflate_covariance)(&coder->filter, coder->item.n_near + TEMPORAL);
    }
}

#undef N_VECS
#undef SUMS
#undef FOR_VECS
#undef FOR_SUMS
#undef VEC
#undef LANES
