/* Coordinates of some vertices as rows of frames, about a centre and in units of a size: what an
   encoder analyses. No stream depends on it. */

#include "base.h"

#define TOGETHER 512 /* vertices whose rows are written at once */

typedef struct {
    const int32_t *order; /* NULL: as they are */
    const double *placement; /* scale, and the origin */
    int64_t first, n;
} place;

/* A frame of `count` vertices from `from` on, to rows that are `apart`. */
#define DEFINE_ROWS(name, type)                                                                    \
    static void name(const type *frame, const place *at, int64_t from, int64_t count, double *out, \
                     int64_t apart) {                                                              \
        double scale = at->placement[0], x0 = at->placement[1], y0 = at->placement[2];             \
        double z0 = at->placement[3];                                                              \
        for (int64_t i = from; i < from + count; i++) {                                            \
            const type *one = frame + 3 * (at->order ? at->order[at->first + i] : at->first + i);  \
            out[i] = ((double)one[0] - x0) / scale;                                                \
            out[apart + i] = ((double)one[1] - y0) / scale;                                        \
            out[2 * apart + i] = ((double)one[2] - z0) / scale;                                    \
        }                                                                                          \
    }

DEFINE_ROWS(rows_of_floats, float)
DEFINE_ROWS(rows_of_doubles, double)

int64_t reel_coordinates(const void *vertices, int64_t size, int64_t n_frames, int64_t n_verts,
                         const int32_t *order, int64_t first, int64_t last,
                         const double *placement, double *out) {
    if (first < 0 || first > last || last > n_verts) {
        return reel_failure(REEL_INVALID, 0);
    }
    for (int64_t i = first; order && i < last; i++) {
        if (order[i] < 0 || order[i] >= n_verts) {
            return reel_failure(REEL_INVALID, (uint64_t)i);
        }
    }
    place at = {order, placement, first, last - first};
    for (int64_t from = 0; from < at.n; from += TOGETHER) {
        int64_t count = at.n - from < TOGETHER ? at.n - from : TOGETHER;
        for (int64_t frame = 0; frame < n_frames; frame++) {
            double *rows = out + frame * at.n;
            if (size == 4) {
                rows_of_floats((const float *)vertices + 3 * frame * n_verts, &at, from, count,
                               rows, n_frames * at.n);
            } else {
                rows_of_doubles((const double *)vertices + 3 * frame * n_verts, &at, from, count,
                                rows, n_frames * at.n);
            }
        }
    }
    return at.n;
}
