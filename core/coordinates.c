/* Values of some vertices, such as coordinates, as rows of frames, about a centre and in units of a
   size: what an encoder analyses. No stream depends on it. */

#include "base.h"

#define TOGETHER 512 /* vertices whose rows are written at once */

typedef struct {
    const int32_t *order; /* NULL: as they are */
    const double *placement; /* scale, and the origin of each column */
    const double *signs;     /* NULL: rows are written, not added to with a sign */
    int64_t first, n, n_columns;
} place;

/* A frame of `count` vertices from `from` on, to rows that are `apart`. */
#define DEFINE_ROWS(name, type)                                                                    \
    static void name(const type *frame, const place *at, int64_t from, int64_t count, double *out, \
                     int64_t apart) {                                                              \
        for (int64_t column = 0; column < at->n_columns; column++) {                               \
            const type *values = frame + column;                                                   \
            double scale = at->placement[0], origin = at->placement[1 + column];                   \
            double *row = out + column * apart;                                                    \
            for (int64_t i = from; i < from + count; i++) {                                        \
                int64_t vertex = at->order ? at->order[at->first + i] : at->first + i;             \
                double value = ((double)values[at->n_columns * vertex] - origin) / scale;          \
                row[i] = at->signs ? row[i] + at->signs[i] * value : value;                        \
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
    place at = {order, placement, signs, first, last - first, n_columns};
    for (int64_t from = 0; from < at.n; from += TOGETHER) {
        int64_t count = at.n - from < TOGETHER ? at.n - from : TOGETHER;
        for (int64_t frame = 0; frame < n_frames; frame++) {
            double *rows = out + frame * at.n;
            if (size == 4) {
                rows_of_floats((const float *)vertices + frame * n_verts * n_columns, &at, from,
                               count, rows, n_frames * at.n);
            } else {
                rows_of_doubles((const double *)vertices + frame * n_verts * n_columns, &at, from,
                                count, rows, n_frames * at.n);
            }
        }
    }
    return at.n;
}
