/* Fields from their residuals: each vertex is predicted from its stencil, in closed loop, by
   weights that follow the modes decoded so far. docs/format.md, "Prediction".

   The weights of a vertex are the state of a Kalman filter: it starts with weights by distance,
   observes smooth fields, then every mode that is decoded. Vertices of a level do not depend on
   each other, so REEL_BATCH of them go together. They are numbered in coding order: what predicts
   a vertex has a lower number. Values are in quantisation steps. */

#include "cpu.h"
#include "rounding.h"

#define REEL_BATCH 8 /* vertices that go together */
#define MOST REEL_MAX_STENCIL

#define PRIOR_VARIANCE 0.5F   /* of the weight of the nearest vertices */
#define PRIOR_KEPT 0.15F      /* share of it that smooth fields leave in any case */
#define SMOOTH_NOISE 0.004F   /* of a smooth field, by the mean squared offset of all together */
#define SMOOTH_FLOOR 0x1p-24F /* its least: fields constant but for rounding tell nothing */
#define ROUNDING_NOISE 0.3F   /* of a mode, in squared steps */
#define RELATIVE_NOISE 0.001F /* and by its mean squared offset */
#define SURPRISE 0.03125F     /* and by its squared error: what no weights explain teaches little */

#define LARGEST_FEEDBACK 8.0  /* steps of noise feedback beyond which there is none */
#define FADED_COUNT 60.0      /* what the counts of earlier levels weigh */
#define COUNTED_BATCHES 8     /* after which the dead zone follows the counts */

#define FOR_LANES(l) for (int l = 0; l < REEL_BATCH; l++)

/* The residual of a value in steps; a mode's counts of zeros and ones follow. */
REEL_INLINE int32_t quantize(double scaled, bool is_plain, double *counts, double zone) {
    double size = reel_magnitude(scaled);
    if (size < zone) {
        counts[0] += 1.0;
    } else if (size < 1.5) {
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
#endif

static int64_t run(const reel_mesh *mesh, reel_fields *fields, const reel_choice *choice,
                   int64_t first, int64_t last) {
#ifdef REEL_HAS_WIDE
    if (reel_widest() >= 4) {
        return code_8(mesh, fields, choice, first, last);
    }
#endif
    return code_4(mesh, fields, choice, first, last);
}

int64_t reel_predict_decode(const reel_mesh *mesh, reel_fields *fields, int64_t first,
                            int64_t last) {
    return run(mesh, fields, NULL, first, last);
}

int64_t reel_predict_encode(const reel_mesh *mesh, reel_fields *fields, const reel_choice *choice,
                            int64_t first, int64_t last) {
    return run(mesh, fields, choice, first, last);
}
