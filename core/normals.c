/* Predict normals from decoded positions, and rotate them to those of a track: docs/format.md,
   "Tracks".

   Encoder and decoder predict the same bits only if all machines round alike. So this file computes
   in double precision, calls no math function but the exactly rounded square root, and is compiled
   without fused multiply-add. */

#include "base.h"

#define MAX_DOUBLE 0x1.fffffffffffffp1023
#define NEAR_POLE 0x1p-20 /* if 1 + z is below it, the tangent frame of (0, 0, -1) is used */
#define MIN_COSINE -0.999 /* cosine of 177 degrees, the largest rotation that the encoder codes */

static void load_vector(const void *positions, int64_t size, int64_t vertex, double *result) {
    for (int axis = 0; axis < 3; axis++) {
        int64_t index = 3 * vertex + axis;
        result[axis] =
            size == 4 ? ((const float *)positions)[index] : ((const double *)positions)[index];
    }
}

/* Twice the area of a triangle times its normal. */
static void area_vector(const void *positions, int64_t size, const int32_t *face, double *result) {
    double a[3], b[3], c[3];
    load_vector(positions, size, face[0], a);
    load_vector(positions, size, face[1], b);
    load_vector(positions, size, face[2], c);
    for (int axis = 0; axis < 3; axis++) {
        b[axis] -= a[axis];
        c[axis] -= a[axis];
    }
    result[0] = b[1] * c[2] - b[2] * c[1];
    result[1] = b[2] * c[0] - b[0] * c[2];
    result[2] = b[0] * c[1] - b[1] * c[0];
}

static void add_vector(double *sum, const double *vector) {
    for (int axis = 0; axis < 3; axis++) {
        sum[axis] += vector[axis];
    }
}

/* Normalize; a vector whose length is 0 or not finite becomes 0. */
static void to_unit_length(double *vector) {
    double length =
        __builtin_sqrt((vector[0] * vector[0] + vector[1] * vector[1]) + vector[2] * vector[2]);
    bool has_length = length > 0.0 && length <= MAX_DOUBLE;
    for (int axis = 0; axis < 3; axis++) {
        vector[axis] = has_length ? vector[axis] / length : 0.0;
    }
}

int64_t reel_normals(const void *positions, int64_t size, int64_t n_frames, int64_t n_verts,
                     const int32_t *faces, int64_t n_faces, const int32_t *items, int64_t n_items,
                     double *normals) {
    if (size != 4 && size != 8) {
        return reel_failure(REEL_INVALID, 0);
    }
    for (int64_t i = 0; i < 3 * n_faces; i++) {
        int64_t item = items ? items[i / 3] : faces[i];
        if (faces[i] < 0 || faces[i] >= n_verts || item < 0 || item >= n_items) {
            return reel_failure(REEL_INVALID, (uint64_t)i);
        }
    }
    for (int64_t frame = 0; frame < n_frames; frame++) {
        const uint8_t *frame_positions = (const uint8_t *)positions + frame * n_verts * 3 * size;
        double *sums = normals + frame * n_items * 3;
        for (int64_t i = 0; i < 3 * n_items; i++) {
            sums[i] = 0.0;
        }
        for (int64_t face = 0; face < n_faces; face++) {
            const int32_t *corners = faces + 3 * face;
            double vector[3];
            area_vector(frame_positions, size, corners, vector);
            if (items) {
                add_vector(sums + 3 * items[face], vector);
                continue;
            }
            for (int corner = 0; corner < 3; corner++) {
                add_vector(sums + 3 * corners[corner], vector);
            }
        }
        for (int64_t item = 0; item < n_items; item++) {
            to_unit_length(sums + 3 * item);
        }
    }
    return n_frames;
}

/* Tangents of a normal: x and y, rotated by the shortest rotation of z to the normal; mirrored near
   (0, 0, -1), where that rotation is undefined. */
static void tangents(const double *n, double *along_a, double *along_b) {
    double x = n[0], y = n[1], hemisphere = 1.0 + n[2] < NEAR_POLE ? -1.0 : 1.0;
    double d = 1.0 + hemisphere * n[2], off_diagonal = -(x * y / d);
    along_a[0] = 1.0 - x * x / d;
    along_a[1] = off_diagonal;
    along_a[2] = -(hemisphere * x);
    along_b[0] = off_diagonal;
    along_b[1] = 1.0 - y * y / d;
    along_b[2] = -(hemisphere * y);
}

static bool is_zero(const double *n) { return n[0] == 0.0 && n[1] == 0.0 && n[2] == 0.0; }

/* Rotate the normal n by (a, b), by the inverse stereographic projection from -n; 0 if a or b are
   too large. */
static void rotate(const double *n, double a, double b, double *result) {
    double along_a[3], along_b[3], k = (a * a + b * b) / 4.0;
    bool is_finite = k <= MAX_DOUBLE;
    tangents(n, along_a, along_b);
    for (int axis = 0; axis < 3 && is_finite; axis++) {
        result[axis] = ((1.0 - k) * n[axis] + (a * along_a[axis] + b * along_b[axis])) / (1.0 + k);
    }
}

int64_t reel_rotate_normals(const double *normals, const double *rotations, int64_t count,
                            int64_t size, void *rotated) {
    if (size != 4 && size != 8) {
        return reel_failure(REEL_INVALID, 0);
    }
    for (int64_t i = 0; i < count; i++) {
        const double *n = normals + 3 * i;
        double result[3] = {0.0, 0.0, 0.0};
        if (!is_zero(n)) {
            rotate(n, rotations[2 * i], rotations[2 * i + 1], result);
        }
        for (int axis = 0; axis < 3; axis++) {
            if (size == 4) {
                ((float *)rotated)[3 * i + axis] = (float)result[axis];
            } else {
                ((double *)rotated)[3 * i + axis] = result[axis];
            }
        }
    }
    return count;
}

int64_t reel_find_rotations(const double *normals, const void *rotated, int64_t size, int64_t count,
                            double *rotations) {
    if (size != 4 && size != 8) {
        return reel_failure(REEL_INVALID, 0);
    }
    for (int64_t i = 0; i < count; i++) {
        const double *n = normals + 3 * i;
        double vector[3], along_a[3], along_b[3], cosine = 0.0, a = 0.0, b = 0.0;
        load_vector(rotated, size, i, vector);
        to_unit_length(vector);
        tangents(n, along_a, along_b);
        for (int axis = 0; axis < 3; axis++) {
            cosine += vector[axis] * n[axis];
            a += vector[axis] * along_a[axis];
            b += vector[axis] * along_b[axis];
        }
        if (is_zero(n) != is_zero(vector) || cosine <= MIN_COSINE) {
            return reel_failure(REEL_INVALID, (uint64_t)i);
        }
        rotations[2 * i] = is_zero(n) ? 0.0 : 2.0 * a / (1.0 + cosine);
        rotations[2 * i + 1] = is_zero(n) ? 0.0 : 2.0 * b / (1.0 + cosine);
    }
    return count;
}
