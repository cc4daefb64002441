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

/* Normalize one frame of `count` vertices, starting at `from`, into the rows of each column,
   `stride` apart. */
#define DEFINE_ROWS(name, type)                                                                    \
    static void name(const type *frame, const selection *selected, int64_t from, int64_t count,    \
                     double *out, int64_t stride) {                                                \
        for (int64_t column = 0; column < selected->n_columns; column++) {                         \
            const type *values = frame + column;                                                   \
            double scale = selected->placement[0], origin = selected->placement[1 + column];       \
            double *row = out + column * stride;                                                   \
            for (int64_t i = from; i < from + count; i++) {                                        \
                int64_t vertex =                                                                   \
                    selected->order ? selected->order[selected->first + i] : selected->first + i;  \
                double value = ((double)values[selected->n_columns * vertex] - origin) / scale;    \
                row[i] = selected->signs ? row[i] + selected->signs[i] * value : value;            \
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
    selection selected = {order, placement, signs, first, last - first, n_columns};
    for (int64_t from = 0; from < selected.n; from += TILE) {
        int64_t count = selected.n - from < TILE ? selected.n - from : TILE;
        for (int64_t frame = 0; frame < n_frames; frame++) {
            double *rows = out + frame * selected.n;
            if (size == 4) {
                rows_of_floats((const float *)vertices + frame * n_verts * n_columns, &selected,
                               from, count, rows, n_frames * selected.n);
            } else {
                rows_of_doubles((const double *)vertices + frame * n_verts * n_columns, &selected,
                                from, count, rows, n_frames * selected.n);
            }
        }
    }
    return selected.n;
}
