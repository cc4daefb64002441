/* Smooth fields and weights, LANES at a time; see smooth.c and cpu.h. */

#define VECTOR REEL_JOIN(reel_vector_, LANES)
#define PARTS (FIELDS / LANES)
#define SIGN_CASES (1 << LANES)

/* The values that signs choose, LANES signs at a time: bit 0 is that of the first. */
TARGET static void NAMED(fill_signed)(double value, double (*chosen)[LANES]) {
    for (int bits = 0; bits < SIGN_CASES; bits++) {
        for (int lane = 0; lane < LANES; lane++) {
            chosen[bits][lane] = bits >> lane & 1 ? value : -value;
        }
    }
}

/* A step of Clenshaw's sum at every vertex: fields become factor W others - fields + value Z, with
   the means W and the signs Z. */
TARGET static void NAMED(step)(const reel_smoother *own, const reel_graph *graph, double factor,
                               double value) {
    double chosen[SIGN_CASES][LANES] __attribute__((aligned(64)));
    NAMED(fill_signed)(value, chosen);
    const double *others = own->others;
    for (int32_t v = 0; v < graph->n; v++) {
        VECTOR sums[PARTS];
        for (int part = 0; part < PARTS; part++) {
            sums[part] = (VECTOR){0};
        }
        for (int32_t i = graph->starts[v]; i < graph->starts[v + 1]; i++) {
            const VECTOR *near = (const VECTOR *)(others + FIELDS * (size_t)graph->near[i]);
            for (int part = 0; part < PARTS; part++) {
                sums[part] += near[part];
            }
        }
        int32_t degree = reel_degree(graph, v);
        double share = degree ? factor / degree : 0.0;
        VECTOR *fields = (VECTOR *)(own->fields + FIELDS * (size_t)v);
        uint32_t signs = own->signs[v];
        for (int part = 0; part < PARTS; part++) {
            const VECTOR *z = (const VECTOR *)chosen[signs >> part * LANES & (SIGN_CASES - 1)];
            fields[part] = (sums[part] * share - fields[part]) + *z;
        }
    }
}

/* Offsets of the stencils of LANES rows from their vertices; places that are not there have 0. */
TARGET static void NAMED(take_offsets)(const double *fields, const reel_stencils *stencils,
                                       int32_t first, double (*offsets)[FIELDS][LANES],
                                       double (*penalties)[LANES], double (*ones)[LANES]) {
    for (int lane = 0; lane < LANES; lane++) {
        int32_t row = first + lane < stencils->n ? first + lane : stencils->n - 1;
        const double *own = fields + FIELDS * (size_t)stencils->predicted[row];
        const int32_t *stencil = stencils->stencil + (size_t)row * (size_t)stencils->size;
        const uint8_t *hops = stencils->hops + (size_t)row * (size_t)stencils->size;
        for (int j = 0; j < stencils->size; j++) {
            bool is_there = stencil[j] >= 0;
            const double *near = is_there ? fields + FIELDS * (size_t)stencil[j] : own;
            penalties[j][lane] = is_there ? (double)(hops[j] * hops[j]) : 0.0;
            ones[j][lane] = is_there ? 1.0 : 0.0;
            for (int field = 0; field < FIELDS; field++) {
                offsets[j][field][lane] = near[field] - own[field];
            }
        }
    }
}

/* Sums of products of offsets, from the diagonal on, four places at a time. */
TARGET static void NAMED(multiply)(double (*offsets)[FIELDS][LANES], int width,
                                   double (*system)[REEL_MAX_STENCIL][LANES]) {
    for (int i = 0; i < width; i++) {
        const VECTOR *own = (const VECTOR *)offsets[i];
        for (int j = i / BLOCK * BLOCK; j < width; j += BLOCK) {
            VECTOR sums[BLOCK];
            for (int k = 0; k < BLOCK; k++) {
                sums[k] = (VECTOR){0};
            }
            for (int field = 0; field < FIELDS; field++) {
                for (int k = 0; k < BLOCK; k++) {
                    sums[k] += own[field] * ((const VECTOR *)offsets[j + k])[field];
                }
            }
            for (int k = 0; k < BLOCK; k++) {
                *(VECTOR *)system[i][j + k] = sums[k];
            }
        }
    }
}

/* Adds the ridge: a share of the mean squared offset and a constant, times the penalty. Places
   that are not there get a diagonal of 1. */
TARGET static void NAMED(add_ridge)(double (*system)[REEL_MAX_STENCIL][LANES], int size, int width,
                                    double (*penalties)[LANES], double (*ones)[LANES]) {
    VECTOR sum = {0}, count = {0};
    for (int j = 0; j < size; j++) {
        sum += *(VECTOR *)system[j][j];
        count += *(VECTOR *)ones[j];
    }
    VECTOR ridge = RELATIVE_RIDGE * (sum / count) + ABSOLUTE_RIDGE;
    for (int j = 0; j < width; j++) {
        VECTOR missing = 1.0 - *(VECTOR *)ones[j];
        *(VECTOR *)system[j][j] += ridge * *(VECTOR *)penalties[j] + missing;
    }
}

/* Brings symmetric systems to triangular form, row by row; `right` is the right side. */
TARGET static void NAMED(eliminate)(double (*system)[REEL_MAX_STENCIL][LANES], int size, int width,
                                    VECTOR *pivots, VECTOR *right) {
    VECTOR factors[REEL_MAX_STENCIL];
    for (int i = 0; i < size; i++) {
        VECTOR side = right[i];
        for (int k = 0; k < i; k++) {
            factors[k] = *(VECTOR *)system[k][i] * pivots[k];
            side -= factors[k] * right[k];
        }
        right[i] = side;
        for (int j = i / BLOCK * BLOCK; j < width; j += BLOCK) {
            VECTOR row[BLOCK];
            for (int b = 0; b < BLOCK; b++) {
                row[b] = *(VECTOR *)system[i][j + b];
            }
            for (int k = 0; k < i; k++) {
                for (int b = 0; b < BLOCK; b++) {
                    row[b] -= factors[k] * *(VECTOR *)system[k][j + b];
                }
            }
            for (int b = 0; b < BLOCK; b++) {
                *(VECTOR *)system[i][j + b] = row[b];
            }
        }
        pivots[i] = 1.0 / *(VECTOR *)system[i][i];
    }
}

/* Solutions, divided by their sum: weights of LANES rows. */
TARGET static void NAMED(substitute)(double (*system)[REEL_MAX_STENCIL][LANES], int size,
                                     const VECTOR *pivots, const VECTOR *right,
                                     double (*weights)[LANES]) {
    VECTOR sum = {0};
    for (int i = size - 1; i >= 0; i--) {
        VECTOR later = {0};
        for (int j = i + 1; j < size; j++) {
            later += *(VECTOR *)system[i][j] * *(VECTOR *)weights[j];
        }
        *(VECTOR *)weights[i] = pivots[i] * (right[i] - later);
    }
    for (int i = 0; i < size; i++) {
        sum += *(VECTOR *)weights[i];
    }
    for (int i = 0; i < size; i++) {
        *(VECTOR *)weights[i] /= sum;
    }
}

TARGET static void NAMED(weigh)(const double *fields, const reel_stencils *stencils,
                                double *weights) {
    double offsets[REEL_MAX_STENCIL][FIELDS][LANES] __attribute__((aligned(64)));
    double system[REEL_MAX_STENCIL][REEL_MAX_STENCIL][LANES] __attribute__((aligned(64)));
    double penalties[REEL_MAX_STENCIL][LANES] __attribute__((aligned(64)));
    double ones[REEL_MAX_STENCIL][LANES] __attribute__((aligned(64)));
    double found[REEL_MAX_STENCIL][LANES] __attribute__((aligned(64)));
    VECTOR pivots[REEL_MAX_STENCIL], right[REEL_MAX_STENCIL];
    int size = stencils->size, width = (size + BLOCK - 1) / BLOCK * BLOCK;
    reel_zero(offsets, sizeof offsets);
    reel_zero(penalties, sizeof penalties);
    reel_zero(ones, sizeof ones);
    for (int32_t first = 0; first < stencils->n; first += LANES) {
        NAMED(take_offsets)(fields, stencils, first, offsets, penalties, ones);
        NAMED(multiply)(offsets, width, system);
        NAMED(add_ridge)(system, size, width, penalties, ones);
        reel_copy(right, ones, sizeof right);
        NAMED(eliminate)(system, size, width, pivots, right);
        NAMED(substitute)(system, size, pivots, right, found);
        for (int lane = 0; lane < LANES && first + lane < stencils->n; lane++) {
            double *row = weights + (size_t)(first + lane) * (size_t)size;
            for (int j = 0; j < size; j++) {
                row[j] = found[j][lane];
            }
        }
    }
}

#undef VECTOR
#undef PARTS
#undef SIGN_CASES
