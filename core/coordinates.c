/* Values of some vertices, such as coordinates, normalized and transposed to rows over time: the
   encoder's input to the analysis. No stream depends on it. */

#include "base.h"

#define TILE 512 /* vertices per tile, whose rows are written together */

typedef struct {
    const int32_t *order;    /* NULL: identity */
    const double *placement; /* scale, and the origin of each column */
    const double *signs;     /* NULL: overwrite rows rather than accumulate them */
    int64_t first, n, n_columns;
} selection;

/* Normalize a frame of `count` vertices, from `begin` on, into rows of columns, `stride` apart. */
#define DEFINE_ROWS(name, type)                                                                    \
    static void name(const type *frame, const selection *subset, int64_t begin, int64_t count,     \
                     double *out, int64_t stride) {                                                \
        for (int64_t column = 0; column < subset->n_columns; column++) {                           \
            const type *values = frame + column;                                                   \
            double scale = subset->placement[0], origin = subset->placement[1 + column];           \
            double *row = out + column * stride;                                                   \
            for (int64_t i = begin; i < begin + count; i++) {                                      \
                int64_t vertex =                                                                   \
                    subset->order ? subset->order[subset->first + i] : subset->first + i;          \
                double value = ((double)values[subset->n_columns * vertex] - origin) / scale;      \
                row[i] = subset->signs ? row[i] + subset->signs[i] * value : value;                \
            }                                                                                      \
        }                                                                                          \
    }

DEFINE_ROWS(rows_of_floats, float)
DEFINE_ROWS(rows_of_doubles, double)

int64_t reel_coordinates(const void *vertices, int64_t size, int64_t n_frames, int64_t n_verts,
                         int64_t n_columns, const int32_t *order, int64_t first, int64_t last,
                         const double *placement, const double *signs, double *out) {
    if (first < 0 || first > last || last > n_verts || n_columns < 1) {
        return reel_failure(REEL_INVALID, 0);
    }
    for (int64_t i = first; order && i < last; i++) {
        if (order[i] < 0 || order[i] >= n_verts) {
            return reel_failure(REEL_INVALID, (uint64_t)i);
        }
    }
    selection subset = {order, placement, signs, first, last - first, n_columns};
    for (int64_t begin = 0; begin < subset.n; begin += TILE) {
        int64_t count = subset.n - begin < TILE ? subset.n - begin : TILE;
        for (int64_t frame = 0; frame < n_frames; frame++) {
            double *rows = out + frame * subset.n;
            if (size == 4) {
                rows_of_floats((const float *)vertices + frame * n_verts * n_columns, &subset,
                               begin, count, rows, n_frames * subset.n);
            } else {
                rows_of_doubles((const double *)vertices + frame * n_verts * n_columns, &subset,
                                begin, count, rows, n_frames * subset.n);
            }
        }
    }
    return subset.n;
}
