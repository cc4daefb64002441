/* The filter of exact.c on vectors of LANES doubles: see cpu.h. Rows of INPUTS numbers, of which the
   last are 0; nothing is added up across lanes but the gains, in the order of the inputs. */

#define PARTS (INPUTS / LANES)

#define vector REEL_JOIN(reel_vector_, LANES)

TARGET static __attribute__((noinline)) void NAMED(filter_gains)(
    const double *doubt, const double *inputs, int n, double *gains) {
    vector sums[PARTS];
    for (int k = 0; k < PARTS; k++) {
        sums[k] = (vector){0};
    }
    for (int j = 0; j < n; j++) {
        const vector *row = (const vector *)(doubt + INPUTS * j);
        for (int k = 0; k < PARTS; k++) {
            sums[k] += row[k] * inputs[j];
        }
    }
    for (int k = 0; k < PARTS; k++) {
        ((vector *)gains)[k] = sums[k];
    }
}

TARGET static __attribute__((noinline)) void NAMED(filter_learn)(
    double *weights, double *doubt, const double *gains, int n, double by, double step) {
    vector parts[PARTS];
    for (int k = 0; k < PARTS; k++) {
        parts[k] = ((const vector *)gains)[k];
        ((vector *)weights)[k] += parts[k] * step;
    }
    for (int j = 0; j < n; j++) {
        vector *row = (vector *)(doubt + INPUTS * j);
        double gain = gains[j] * by;
        for (int k = 0; k < PARTS; k++) {
            row[k] -= parts[k] * gain;
        }
    }
}

#undef PARTS
#undef vector
