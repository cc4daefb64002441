/* Fields from their residuals: each vertex is predicted from its stencil, in closed loop, by
   weights that follow the modes decoded so far. docs/format.md, "Prediction".

   The weights of a vertex are the state of a Kalman filter: it starts with weights by distance,
   observes smooth fields, then every mode that is decoded. Vertices of a level do not depend on
   each other, so REEL_BATCH of them go together. They are numbered in coding order: what predicts
   a vertex has a lower number. Values are in quantisation steps. */

#include "cpu.h"
#include "rounding.h"

#define REEL_BATCH 16 /* vertices that go together */
#define AT_ONCE 8     /* fields whose values are gathered together */
#define MOST REEL_MAX_STENCIL
#define OWN MOST /* the place of the vertex itself, behind its stencil */
#define PLACES (MOST + 1)
#define TRIANGLE (MOST * (MOST + 1) / 2)

#define PRIOR_VARIANCE 0.5F   /* of the weight of the nearest vertices */
#define PRIOR_KEPT 0.15F      /* share of it that smooth fields leave in any case */
#define SMALL_NOISE 0.004F    /* of a smooth field, by the mean squared offset of all together */
#define LARGE_NOISE 0.0002F   /* the same in resolutions of more than REEL_SMALL_GRAPH vertices */
#define SMOOTH_FLOOR 0x1p-32F /* its least: fields constant but for rounding tell nothing */
#define ROUNDING_NOISE 0.3F   /* of a mode, in squared steps */
#define RELATIVE_NOISE 0.001F /* and by its mean squared offset */
#define SURPRISE 0.03125F     /* and by its squared error: what no weights explain teaches little */

#define LARGEST_ONE 1.5         /* steps that count as a one */
#define LARGEST_FEEDBACK 8.0  /* steps of noise feedback beyond which there is none */
#define FADED_COUNT 60.0      /* what the counts of earlier levels weigh */
#define COUNTED_BATCHES 4     /* after which the dead zone follows the counts */

#define FOR_LANES(l) for (int l = 0; l < REEL_BATCH; l++)

/* Variance of the weight of a vertex so many edges away, where the nearest is so many. */
static const float by_hops[4][4] = {
    {0.0F},
    {0.0F, 1.0F, 1.0F / 4.0F, 1.0F / 9.0F},
    {0.0F, 4.0F, 1.0F, 4.0F / 9.0F},
    {0.0F, 9.0F, 9.0F / 4.0F, 1.0F},
};

/* The residual of a value in steps; a mode's counts of zeros and ones follow. */
REEL_INLINE int32_t quantize(double scaled, bool is_plain, double *counts, double zone) {
    double size = reel_magnitude(scaled);
    if (size < zone) {
        counts[0] += 1.0;
    } else if (size < LARGEST_ONE) {
        counts[1] += 1.0;
    }
    return reel_rounded(scaled, zone, is_plain);
}

/* Counts of the levels before weigh little; each level soon goes by its own. */
static void fade(const reel_choice *choice, int64_t n_modes) {
    for (int64_t k = 0; k < n_modes; k++) {
        double *counts = choice->counts + 2 * k, sum = counts[0] + counts[1];
        double share = sum > FADED_COUNT ? FADED_COUNT / sum : 1.0;
        counts[0] *= share;
        counts[1] *= share;
    }
}

static void set_zones(const reel_choice *choice, int64_t n_modes, bool is_plain) {
    for (int64_t k = 0; k < n_modes; k++) {
        const double *counts = choice->counts + 2 * k;
        choice->zones[k] =
            is_plain ? REEL_NO_ZONE : reel_dead_zone(counts[0], counts[1], choice->price);
    }
}

/* The noise of smooth fields in the resolution of a level. */
static float smooth_noise(const reel_mesh *mesh, int64_t level) {
    int64_t start = mesh->smooth_starts[level];
    while (level + 1 < mesh->n_levels && mesh->smooth_starts[level + 1] == start) {
        level++;
    }
    return mesh->level_starts[level + 1] > REEL_SMALL_GRAPH ? LARGE_NOISE : SMALL_NOISE;
}

#define FLOATS 4
#define TARGET
#define NAMED(name) name##_4
#include "predict_lanes.h"
#undef FLOATS
#undef TARGET
#undef NAMED

#ifdef REEL_HAS_WIDE
#define FLOATS 8
#define TARGET REEL_TARGET_4
#define NAMED(name) name##_8
#include "predict_lanes.h"
#undef FLOATS
#undef TARGET
#undef NAMED

#if defined(__clang__) || __GNUC__ >= 12 /* which know how to shuffle vectors */
#define HAS_WIDEST 1
#define FLOATS 16
#define TARGET REEL_TARGET_8
#define NAMED(name) name##_16
#include "predict_lanes.h"
#undef FLOATS
#undef TARGET
#undef NAMED
#endif
#endif

/* The coarsest level: values are their residuals. */
static bool code_coarsest(reel_fields *fields, const reel_choice *choice, int64_t first,
                          int64_t last) {
    for (int64_t v = first; v < last; v++) {
        for (int64_t k = 0; k < fields->n_modes; k++) {
            int32_t *residual = fields->residuals + k * fields->n_verts + v;
            if (choice) {
                double scaled = choice->wanted[v * fields->n_modes + k];
                if (!(scaled < REEL_TOO_LARGE && scaled > -REEL_TOO_LARGE)) {
                    return false;
                }
                *residual = quantize(scaled, true, choice->counts + 2 * k, REEL_NO_ZONE);
            }
            fields->values[v * fields->n_modes + k] = *residual;
        }
    }
    return true;
}

REEL_INLINE int64_t larger(int64_t a, int64_t b) { return a > b ? a : b; }
REEL_INLINE int64_t smaller(int64_t a, int64_t b) { return a < b ? a : b; }

static bool code_level(int widest, const reel_mesh *mesh, reel_fields *fields,
                       const reel_choice *choice, int64_t level, int64_t first, int64_t last) {
    if (choice) {
        fade(choice, fields->n_modes);
    }
    if (!level) {
        return code_coarsest(fields, choice, first, last);
    }
#ifdef HAS_WIDEST
    if (widest >= 8) {
        return code_16(mesh, fields, choice, level, first, last);
    }
#endif
#ifdef REEL_HAS_WIDE
    if (widest >= 4) {
        return code_8(mesh, fields, choice, level, first, last);
    }
#endif
    (void)widest;
    return code_4(mesh, fields, choice, level, first, last);
}

static void keep_level(int widest, const reel_mesh *mesh, const reel_fields *fields, int64_t level,
                       int64_t first, int64_t last) {
#ifdef HAS_WIDEST
    if (widest >= 8) {
        keep_16(mesh, fields, level, first, last);
        return;
    }
#endif
#ifdef REEL_HAS_WIDE
    if (widest >= 4) {
        keep_8(mesh, fields, level, first, last);
        return;
    }
#endif
    (void)widest;
    keep_4(mesh, fields, level, first, last);
}

/* Vertices first..last-1, level after level. */
static int64_t run(const reel_mesh *mesh, reel_fields *fields, const reel_choice *choice,
                   int64_t first, int64_t last) {
    int widest = reel_widest();
    for (int64_t level = 0; level < mesh->n_levels; level++) {
        int64_t start = larger(first, mesh->level_starts[level]);
        int64_t stop = smaller(last, mesh->level_starts[level + 1]);
        if (start < stop && !code_level(widest, mesh, fields, choice, level, start, stop)) {
            return reel_failure(REEL_INVALID, (uint64_t)level);
        }
    }
    return 0;
}

int64_t reel_predict_decode(const reel_mesh *mesh, reel_fields *fields, int64_t first,
                            int64_t last) {
    return run(mesh, fields, NULL, first, last);
}

int64_t reel_predict_encode(const reel_mesh *mesh, reel_fields *fields, const reel_choice *choice,
                            int64_t first, int64_t last) {
    return run(mesh, fields, choice, first, last);
}

size_t reel_predict_prepare_memory(int64_t n_verts, int64_t n_levels) {
    return ((size_t)n_verts / REEL_BATCH + (size_t)n_levels) * sizeof(filter_4);
}

int64_t reel_predict_prepare(const reel_mesh *mesh, const reel_fields *fields, int64_t first,
                             int64_t last) {
    int widest = reel_widest();
    for (int64_t level = 1; level < mesh->n_levels; level++) {
        int64_t start = larger(first, mesh->level_starts[level]);
        int64_t stop = smaller(last, mesh->level_starts[level + 1]);
        if (start < stop) {
            keep_level(widest, mesh, fields, level, start, stop);
        }
    }
    return 0;
}
