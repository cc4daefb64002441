/* Fields from their residuals: closed-loop prediction of each vertex from its stencil, by weights
   that adapt to the modes decoded so far. docs/format.md, "Prediction".

   The weights of a vertex are the state of a Kalman filter: it starts with weights by distance,
   observes smooth fields, then every decoded mode. Vertices of a level are independent, so
   REEL_BATCH of them are processed at once. Vertices are numbered in coding order: the stencil of a
   vertex has lower numbers. Values are in quantization steps. */

#include "cpu.h"
#include "rounding.h"

#define REEL_BATCH 16       /* vertices processed at once */
#define FIELDS_PER_GATHER 8 /* fields gathered at once */
#define MAX_STENCIL REEL_MAX_STENCIL
#define SELF MAX_STENCIL /* index of the vertex itself, behind its stencil */
#define N_SLOTS (MAX_STENCIL + 1)
#define N_COVARIANCES (MAX_STENCIL * (MAX_STENCIL + 1) / 2)

#define PRIOR_VARIANCE 0.5F  /* of the weights of the nearest vertices */
#define RESTORED_SHARE 0.15F /* share of it that is restored after the smooth fields */
/* Noise of a smooth field, relative to the mean squared offset of all fields. */
#define SMALL_NOISE 0.004F
#define LARGE_NOISE 0.0002F /* the same in resolutions of more than REEL_SMALL_GRAPH vertices */
/* Lower bound of that noise: fields that are constant up to rounding carry no information. */
#define SMOOTH_FLOOR 0x1p-32F
#define ROUNDING_NOISE 0.3F   /* quantization noise of a mode, in squared steps */
#define RELATIVE_NOISE 0.001F /* plus noise relative to its mean squared offset */
/* Plus noise relative to its squared error: errors that no weights explain are not informative. */
#define ERROR_NOISE 0.03125F

#define ONE_LIMIT 1.5          /* magnitudes below it, in steps, count as ones */
#define MAX_FEEDBACK 8.0       /* feedback beyond this many steps is dropped */
#define MAX_CARRIED_COUNT 60.0 /* weight of the counts of all earlier levels */
#define BATCHES_PER_ZONE 4     /* batches between updates of the dead zone */

#define MAX_COUNT_SUM 400.0 /* weight of all counted magnitudes of a mode */
#define COUNT_DECAY 0.75    /* share of the counts that remains beyond it */
#define MIN_COUNT 0.02
#define MAX_REDUCTION 12 /* by which joint quantization may shorten a residual */

#define FOR_LANES(l) for (int l = 0; l < REEL_BATCH; l++)

/* Relative variance of a weight, by the distance of the nearest vertex of the stencil and of the
   weight's vertex, in edges. */
static const float variance_by_hops[4][4] = {
    {0.0F},
    {0.0F, 1.0F, 1.0F / 4.0F, 1.0F / 9.0F},
    {0.0F, 4.0F, 1.0F, 4.0F / 9.0F},
    {0.0F, 9.0F, 9.0F / 4.0F, 1.0F},
};

/* Quantize a value in steps to its residual, and count zeros and ones. */
REEL_INLINE int32_t quantize(double scaled, bool to_nearest, double *counts, double zone) {
    double magnitude = reel_magnitude(scaled);
    if (magnitude < zone) {
        counts[0] += 1.0;
    } else if (magnitude < ONE_LIMIT) {
        counts[1] += 1.0;
    }
    return reel_round_rd(scaled, zone, to_nearest);
}

/* Discount the counts of earlier levels: each level soon follows its own statistics. */
static void discount_counts(const reel_quantizer *quantizer, int64_t n_modes) {
    for (int64_t k = 0; k < n_modes; k++) {
        double *counts = quantizer->counts + 2 * k, sum = counts[0] + counts[1];
        double share = sum > MAX_CARRIED_COUNT ? MAX_CARRIED_COUNT / sum : 1.0;
        counts[0] *= share;
        counts[1] *= share;
    }
}

static void set_zones(const reel_quantizer *quantizer, int64_t n_modes, bool to_nearest) {
    for (int64_t k = 0; k < n_modes; k++) {
        const double *counts = quantizer->counts + 2 * k;
        quantizer->zones[k] = to_nearest
                                  ? REEL_NEAREST_ZONE
                                  : reel_dead_zone(counts[0], counts[1], quantizer->rd_lambda);
    }
}

/* Noise of the smooth fields in the resolution of a level. */
static float smooth_noise(const reel_mesh *mesh, int64_t level) {
    int64_t start = mesh->smooth_starts[level];
    while (level + 1 < mesh->n_levels && mesh->smooth_starts[level + 1] == start) {
        level++;
    }
    return mesh->level_starts[level + 1] > REEL_SMALL_GRAPH ? LARGE_NOISE : SMALL_NOISE;
}

/* Smooth fields in the resolution of a level, by vertex. */
static const float *smooth_rows(const reel_mesh *mesh, int64_t level) {
    return mesh->smooth + mesh->smooth_starts[level] * REEL_SMOOTH_FIELDS;
}

/* Estimate the bits of the magnitudes of a mode, with their signs, from the counts so far, and
   discount these if they are many. */
static void estimate_bits(double *counts, double *bits) {
    double sum = 0.0;
    for (int i = 0; i < REEL_MAGNITUDES; i++) {
        sum += counts[i];
    }
    for (int i = 0; i < REEL_MAGNITUDES; i++) {
        bits[i] = reel_log2(sum / counts[i]) + (i ? 1.0 : 0.0);
        if (sum > MAX_COUNT_SUM) {
            counts[i] = COUNT_DECAY * counts[i] + MIN_COUNT;
        }
    }
}

/* Magnitude of the cheapest residual: its squared error times `weight`, plus rd_lambda per bit. */
static int32_t cheapest_magnitude(double magnitude, double weight, double rd_lambda,
                                  const double *bits) {
    const int32_t last = REEL_MAGNITUDES - 1, nearest = (int32_t)(magnitude + 0.5);
    int32_t best = 0, q = nearest > MAX_REDUCTION ? nearest - MAX_REDUCTION : 1;
    double min_cost = weight * magnitude * magnitude + rd_lambda * bits[0];
    for (; q <= nearest; q++) {
        double error = magnitude - q;
        double n_bits = q < last ? bits[q] : bits[last] + 1.0 + 2.0 * reel_log2(q - last + 1.0);
        double cost = weight * error * error + rd_lambda * n_bits;
        if (cost < min_cost) {
            min_cost = cost;
            best = q;
        }
    }
    return best;
}

/* Quantize mode k at some vertices, given the errors of the modes before it, which it may correct:
   later modes are assumed to correct the rest (as in successive interference cancellation, or
   Babai's nearest plane). Return false if a residual is too large. */
static bool quantize_jointly(const reel_quantizer *quantizer, int64_t k, const double *predictions,
                             const int32_t *vertices, int n_verts,
                             double (*errors)[REEL_BATCH], reel_fields *fields) {
    double bits[REEL_MAGNITUDES], *counts = quantizer->magnitudes + k * REEL_MAGNITUDES;
    int64_t form_size = quantizer->n_joint * (quantizer->n_joint + 1) / 2;
    estimate_bits(counts, bits);
    for (int l = 0; l < n_verts; l++) {
        const float *form = quantizer->forms + vertices[l] * form_size + k * (k + 1) / 2;
        double target = quantizer->targets[vertices[l] * fields->n_modes + k];
        double scaled = target - predictions[l];
        for (int64_t j = 0; j < k; j++) {
            scaled -= form[j] * errors[j][l];
        }
        double magnitude = reel_magnitude(scaled);
        if (!(magnitude < REEL_TOO_LARGE)) {
            return false;
        }
        int32_t best = cheapest_magnitude(magnitude, form[k], quantizer->rd_lambda, bits);
        counts[best < REEL_MAGNITUDES ? best : REEL_MAGNITUDES - 1] += 1.0;
        int32_t residual = scaled < 0 ? -best : best;
        fields->residuals[k * fields->n_verts + vertices[l]] = residual;
        errors[k][l] = predictions[l] + residual - target;
    }
    return true;
}

/* What the initial weights leave of the related fields at a vertex. */
static void find_innovations(const reel_mesh *mesh, const reel_fields *fields, int64_t vertex,
                             double *innovations) {
    int64_t size = mesh->stencil_size, n = fields->n_related;
    const int32_t *stencil = mesh->stencil + vertex * size;
    const float *weights = mesh->weights + vertex * size;
    for (int64_t r = 0; r < n; r++) {
        double base = fields->related[stencil[0] * n + r];
        float predicted = 0.0F;
        for (int64_t j = 0; j < size && stencil[j] >= 0; j++) {
            predicted += weights[j] * (float)(fields->related[stencil[j] * n + r] - base);
        }
        innovations[r] = (double)((float)(fields->related[vertex * n + r] - base) - predicted);
    }
}

/* Sum over r of factors[r] innovations[r] for mode k. */
static double correction_of(const reel_fields *fields, const double *factors, int64_t k,
                            const double *innovations) {
    double sum = 0.0;
    for (int64_t r = 0; r < fields->n_related; r++) {
        sum += factors[r * fields->n_modes + k] * innovations[r];
    }
    return sum;
}

/* Add the vertices of a level to the normal equations of the regression. */
static void add_level(const reel_mesh *mesh, const reel_fields *fields, int64_t level,
                      double *gram, double *products, const double *factors) {
    double innovations[REEL_MAX_RELATED];
    for (int64_t v = mesh->level_starts[level]; v < mesh->level_starts[level + 1]; v++) {
        find_innovations(mesh, fields, v, innovations);
        for (int64_t r = 0; r < fields->n_related; r++) {
            for (int64_t s = 0; s <= r; s++) {
                gram[r * fields->n_related + s] += innovations[r] * innovations[s];
            }
        }
        for (int64_t k = 0; k < fields->n_modes; k++) {
            double innovation = correction_of(fields, factors, k, innovations) +
                                (double)fields->residuals[k * fields->n_verts + v];
            for (int64_t r = 0; r < fields->n_related; r++) {
                products[r * fields->n_modes + k] += innovations[r] * innovation;
            }
        }
    }
}

/* Solve (gram + I) factors = products by the factorization L D L^T, then halve both. */
static void solve_regression(int64_t n, int64_t n_modes, double *gram, double *products,
                             double *factors) {
    double lower[REEL_MAX_RELATED][REEL_MAX_RELATED], inverse[REEL_MAX_RELATED];
    for (int64_t i = 0; i < n; i++) {
        double scaled[REEL_MAX_RELATED], pivot = gram[i * n + i] + 1.0;
        for (int64_t j = 0; j < i; j++) {
            scaled[j] = gram[i * n + j];
            for (int64_t k = 0; k < j; k++) {
                scaled[j] -= scaled[k] * lower[j][k];
            }
            lower[i][j] = scaled[j] * inverse[j];
            pivot -= scaled[j] * lower[i][j];
            gram[i * n + j] *= 0.5;
        }
        inverse[i] = 1.0 / pivot;
        gram[i * n + i] *= 0.5;
    }
    for (int64_t k = 0; k < n_modes; k++) {
        double *x = factors + k;
        for (int64_t i = 0; i < n; i++) {
            x[i * n_modes] = products[i * n_modes + k];
            for (int64_t j = 0; j < i; j++) {
                x[i * n_modes] -= lower[i][j] * x[j * n_modes];
            }
            products[i * n_modes + k] *= 0.5;
        }
        for (int64_t i = n - 1; i >= 0; i--) {
            x[i * n_modes] *= inverse[i];
            for (int64_t j = i + 1; j < n; j++) {
                x[i * n_modes] -= lower[j][i] * x[j * n_modes];
            }
        }
    }
}

/* Regress the innovations of the levels before on those of the related fields, and store the
   corrections of a level in the place of its values. */
static void relate_level(const reel_mesh *mesh, reel_fields *fields, int64_t level) {
    int64_t n = fields->n_related, n_modes = fields->n_modes;
    double *gram = fields->regression, *products = gram + n * n, *factors = products + n * n_modes;
    double innovations[REEL_MAX_RELATED];
    if (level > 1) {
        add_level(mesh, fields, level - 1, gram, products, factors);
    } else {
        reel_zero(gram, (size_t)(n * (n + n_modes)) * sizeof *gram);
    }
    solve_regression(n, n_modes, gram, products, factors);
    for (int64_t v = mesh->level_starts[level]; v < mesh->level_starts[level + 1]; v++) {
        find_innovations(mesh, fields, v, innovations);
        for (int64_t k = 0; k < n_modes; k++) {
            fields->values[v * n_modes + k] = correction_of(fields, factors, k, innovations);
        }
    }
}

#define LANES 2
#include "predict_lanes.h"

#ifdef REEL_HAS_WIDE
#define LANES 4
#include "predict_lanes.h"

#if defined(__clang__) || __GNUC__ >= 12 /* which have __builtin_shufflevector */
#define LANES 8
#include "predict_lanes.h"
#else
#define code_8 code_4
#endif
#endif

/* Code the coarsest level, whose values are their residuals. */
static bool code_coarsest(reel_fields *fields, const reel_quantizer *quantizer, int64_t first,
                          int64_t last) {
    for (int64_t v = first; v < last; v++) {
        for (int64_t k = 0; k < fields->n_modes; k++) {
            int32_t *residual = fields->residuals + k * fields->n_verts + v;
            if (quantizer) {
                double scaled = quantizer->targets[v * fields->n_modes + k];
                if (!(scaled < REEL_TOO_LARGE && scaled > -REEL_TOO_LARGE)) {
                    return false;
                }
                *residual = quantize(scaled, true, quantizer->counts + 2 * k, REEL_NEAREST_ZONE);
            }
            fields->values[v * fields->n_modes + k] = *residual;
        }
    }
    return true;
}

REEL_INLINE int64_t max(int64_t a, int64_t b) { return a > b ? a : b; }
REEL_INLINE int64_t min(int64_t a, int64_t b) { return a < b ? a : b; }

static bool code_level(int vector_width, const reel_mesh *mesh, reel_fields *fields,
                       const reel_quantizer *quantizer, int64_t level, int64_t first,
                       int64_t last) {
    if (quantizer) {
        discount_counts(quantizer, fields->n_modes);
    }
    if (!level) {
        return code_coarsest(fields, quantizer, first, last);
    }
    if (fields->n_related) {
        relate_level(mesh, fields, level);
    }
    return REEL_WIDEST(vector_width, code, mesh, fields, quantizer, level, first, last);
}

/* Code vertices first..last-1, level by level. */
static int64_t code_levels(const reel_mesh *mesh, reel_fields *fields,
                           const reel_quantizer *quantizer, int64_t first, int64_t last) {
    int vector_width = reel_vector_width();
    for (int64_t level = 0; level < mesh->n_levels; level++) {
        int64_t start = max(first, mesh->level_starts[level]);
        int64_t stop = min(last, mesh->level_starts[level + 1]);
        if (start < stop &&
            !code_level(vector_width, mesh, fields, quantizer, level, start, stop)) {
            return reel_failure(REEL_INVALID, (uint64_t)level);
        }
    }
    return 0;
}

int64_t reel_predict_decode(const reel_mesh *mesh, reel_fields *fields, int64_t first,
                            int64_t last) {
    return code_levels(mesh, fields, NULL, first, last);
}

int64_t reel_predict_encode(const reel_mesh *mesh, reel_fields *fields,
                            const reel_quantizer *quantizer, int64_t first, int64_t last) {
    return code_levels(mesh, fields, quantizer, first, last);
}
