/* Normals of a surface that moves, and normals that are turned from them.

   docs/format.md, "Tracks". In IEEE double, with nothing fused and `sqrt` the only function: every
   machine finds the same bits. */

#include "base.h"

#define LARGEST 0x1.fffffffffffffp1023
#define NEAR_POLE 0x1p-20 /* 1 + z below it: the tangents of a normal are those of (0, 0, -1) */
#define LEAST_UP -0.999 /* cosine of an angle, of 177 degrees, that the writer does not turn beyond */

static void position(const void *positions, int64_t size, int64_t vertex, double *found) {
    for (int axis = 0; axis < 3; axis++) {
        int64_t place = 3 * vertex + axis;
        found[axis] = size == 4 ? ((const float *)positions)[place] : ((const double *)positions)[place];
    }
}

/* Twice the area of a triangle times its normal. */
static void area_vector(const void *positions, int64_t size, const int32_t *face, double *found) {
    double a[3], b[3], c[3];
    position(positions, size, face[0], a);
    position(positions, size, face[1], b);
    position(positions, size, face[2], c);
    for (int axis = 0; axis < 3; axis++) {
        b[axis] -= a[axis];
        c[axis] -= a[axis];
    }
    found[0] = b[1] * c[2] - b[2] * c[1];
    found[1] = b[2] * c[0] - b[0] * c[2];
    found[2] = b[0] * c[1] - b[1] * c[0];
}

static void add(double *sum, const double *one) {
    for (int axis = 0; axis < 3; axis++) {
        sum[axis] += one[axis];
    }
}

/* Divides by the length; what has none, or one that is no number, becomes 0. */
static void to_unit_length(double *one) {
    double length = __builtin_sqrt((one[0] * one[0] + one[1] * one[1]) + one[2] * one[2]);
    bool is_there = length > 0.0 && length <= LARGEST;
    for (int axis = 0; axis < 3; axis++) {
        one[axis] = is_there ? one[axis] / length : 0.0;
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
        const uint8_t *here = (const uint8_t *)positions + frame * n_verts * 3 * size;
        double *found = normals + frame * n_items * 3;
        for (int64_t i = 0; i < 3 * n_items; i++) {
            found[i] = 0.0;
        }
        for (int64_t face = 0; face < n_faces; face++) {
            const int32_t *corners = faces + 3 * face;
            double one[3];
            area_vector(here, size, corners, one);
            if (items) {
                add(found + 3 * items[face], one);
                continue;
            }
            for (int corner = 0; corner < 3; corner++) {
                add(found + 3 * corners[corner], one);
            }
        }
        for (int64_t item = 0; item < n_items; item++) {
            to_unit_length(found + 3 * item);
        }
    }
    return n_frames;
}

/* The tangents along which a normal is turned: those of (0, 0, 1), turned with it on the shortest
   way; near (0, 0, -1), where that has no end, those of it. */
static void tangents(const double *n, double *along_a, double *along_b) {
    double x = n[0], y = n[1], side = 1.0 + n[2] < NEAR_POLE ? -1.0 : 1.0;
    double d = 1.0 + side * n[2], across = -(x * y / d);
    along_a[0] = 1.0 - x * x / d;
    along_a[1] = across;
    along_a[2] = -(side * x);
    along_b[0] = across;
    along_b[1] = 1.0 - y * y / d;
    along_b[2] = -(side * y);
}

static bool is_none(const double *n) { return n[0] == 0.0 && n[1] == 0.0 && n[2] == 0.0; }

/* The normal n turned by (a, b), as a stereographic projection from -n has it; 0 if that is too far
   for a number. */
static void turn(const double *n, double a, double b, double *found) {
    double along_a[3], along_b[3], k = (a * a + b * b) / 4.0;
    bool is_near = k <= LARGEST;
    tangents(n, along_a, along_b);
    for (int axis = 0; axis < 3 && is_near; axis++) {
        found[axis] = ((1.0 - k) * n[axis] + (a * along_a[axis] + b * along_b[axis])) / (1.0 + k);
    }
}

int64_t reel_turned(const double *normals, const double *turns, int64_t count, int64_t size,
                    void *turned) {
    if (size != 4 && size != 8) {
        return reel_failure(REEL_INVALID, 0);
    }
    for (int64_t i = 0; i < count; i++) {
        const double *n = normals + 3 * i;
        double found[3] = {0.0, 0.0, 0.0};
        if (!is_none(n)) {
            turn(n, turns[2 * i], turns[2 * i + 1], found);
        }
        for (int axis = 0; axis < 3; axis++) {
            if (size == 4) {
                ((float *)turned)[3 * i + axis] = (float)found[axis];
            } else {
                ((double *)turned)[3 * i + axis] = found[axis];
            }
        }
    }
    return count;
}

int64_t reel_turns(const double *normals, const void *turned, int64_t size, int64_t count,
                   double *turns) {
    if (size != 4 && size != 8) {
        return reel_failure(REEL_INVALID, 0);
    }
    for (int64_t i = 0; i < count; i++) {
        const double *n = normals + 3 * i;
        double one[3], along_a[3], along_b[3], up = 0.0, a = 0.0, b = 0.0;
        position(turned, size, i, one);
        to_unit_length(one);
        tangents(n, along_a, along_b);
        for (int axis = 0; axis < 3; axis++) {
            up += one[axis] * n[axis];
            a += one[axis] * along_a[axis];
            b += one[axis] * along_b[axis];
        }
        if (is_none(n) != is_none(one) || up <= LEAST_UP) {
            return reel_failure(REEL_INVALID, (uint64_t)i);
        }
        turns[2 * i] = is_none(n) ? 0.0 : 2.0 * a / (1.0 + up);
        turns[2 * i + 1] = is_none(n) ? 0.0 : 2.0 * b / (1.0 + up);
    }
    return count;
}
