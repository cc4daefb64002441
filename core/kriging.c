/* Weights that predict a value from those at nearby points: docs/format.md, "Weights from points".

   Kriging with the generalized covariance r^3 and a linear trend, as in polyharmonic splines: smooth
   fields are predicted without error as far as they are linear, and the nugget, the variance of
   the noise, keeps the weights from amplifying rounding errors. The trend has a large variance
   instead of constraints, so that the matrix is positive definite for any points: on a line, in a
   plane, or coincident. */

#include "base.h"
#include "reel.h"

#define MAX_STENCIL REEL_MAX_STENCIL
#define TREND 10000.0 /* variance of the linear trend, relative to that of the field */
/* Vertices processed at once; builds for pages have vectors of two doubles. */
#ifdef REEL_DECODER_ONLY
#define LANES 2
#else
#define LANES 4
#endif

typedef double vec __attribute__((vector_size(8 * LANES), may_alias));

#define LANE(values, l) (((double *)&(values))[l])

REEL_INLINE void take_roots(const vec *squares, vec *roots) {
    for (int l = 0; l < LANES; l++) {
        LANE(*roots, l) = __builtin_sqrt(((const double *)squares)[l]);
    }
}

/* The stencils of LANES vertices: points relative to the vertex, in units of their mean distance.
   Missing entries have the vertex itself and a mask of 0, present ones a mask of 1. */
typedef struct {
    vec points[MAX_STENCIL][3], mask[MAX_STENCIL];
} stencils;

static void load(const reel_mesh *mesh, const double *points, int64_t first, int64_t last,
                 stencils *s) {
    int size = (int)mesh->stencil_size;
    vec sum = {0}, count = {0}, root;
    for (int j = 0; j < size; j++) {
        for (int l = 0; l < LANES; l++) {
            int64_t vertex = first + l < last ? first + l : last - 1;
            const int32_t *stencil = mesh->stencil + vertex * size;
            int64_t neighbor = stencil[j] >= 0 ? stencil[j] : vertex;
            LANE(s->mask[j], l) = stencil[j] >= 0 ? 1.0 : 0.0;
            for (int axis = 0; axis < 3; axis++) {
                LANE(s->points[j][axis], l) =
                    points[3 * neighbor + axis] - points[3 * vertex + axis];
            }
        }
        const vec *p = s->points[j];
        vec square = (p[0] * p[0] + p[1] * p[1]) + p[2] * p[2];
        take_roots(&square, &root);
        sum += s->mask[j] * root;
        count += s->mask[j];
    }
    for (int l = 0; l < LANES; l++) {
        double mean = LANE(sum, l) / LANE(count, l);
        LANE(sum, l) = mean == 0.0 ? 1.0 : mean;
    }
    for (int j = 0; j < size; j++) {
        for (int axis = 0; axis < 3; axis++) {
            s->points[j][axis] /= sum;
        }
    }
}

/* Covariance of the values at two points. */
REEL_INLINE void covariance(const vec *a, const vec *b, vec *result) {
    vec d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]}, root;
    vec square = (d[0] * d[0] + d[1] * d[1]) + d[2] * d[2];
    take_roots(&square, &root);
    *result = square * root + TREND * (1.0 + ((a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]));
}

/* Solve for the weights by the factorization L D L^T of the covariance matrix. */
static void solve(const stencils *s, int size, double nugget, vec *weights) {
    static const vec origin[3] = {{0}, {0}, {0}};
    vec lower[MAX_STENCIL][MAX_STENCIL], inverse[MAX_STENCIL];
    for (int i = 0; i < size; i++) {
        vec scaled[MAX_STENCIL], pivot, value, sum;
        covariance(s->points[i], s->points[i], &pivot);
        covariance(s->points[i], origin, &value);
        pivot += nugget;
        value *= s->mask[i];
        for (int j = 0; j < i; j++) {
            covariance(s->points[i], s->points[j], &sum);
            sum *= s->mask[i];
            for (int k = 0; k < j; k++) {
                sum -= scaled[k] * lower[j][k];
            }
            scaled[j] = sum;
            lower[i][j] = sum * inverse[j];
        }
        for (int j = 0; j < i; j++) {
            pivot -= scaled[j] * lower[i][j];
            value -= lower[i][j] * weights[j];
        }
        inverse[i] = 1.0 / pivot;
        weights[i] = value;
    }
    for (int i = size - 1; i >= 0; i--) {
        weights[i] *= inverse[i];
        for (int k = i + 1; k < size; k++) {
            weights[i] -= lower[k][i] * weights[k];
        }
    }
}

int64_t reel_kriging(const reel_mesh *mesh, const double *points, double nugget, int64_t first,
                     int64_t last, float *weights) {
    int size = (int)mesh->stencil_size;
    for (; first < last; first += LANES) {
        stencils s;
        vec solved[MAX_STENCIL];
        load(mesh, points, first, last, &s);
        solve(&s, size, nugget, solved);
        for (int64_t l = 0; l < LANES && first + l < last; l++) {
            float *row = weights + (first + l) * size;
            bool is_finite = true;
            for (int j = 0; j < size; j++) {
                row[j] = (float)LANE(solved[j], l);
                is_finite &= row[j] - row[j] == 0.0F;
            }
            for (int j = 0; j < size && !is_finite; j++) {
                row[j] = 0.0F;
            }
        }
    }
    return 0;
}
