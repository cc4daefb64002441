/* Values of a tile of vertices, LANES at a time; see frames.c and cpu.h. */

#define VECTOR REEL_JOIN(reel_vector_, LANES)
#define ABREAST (4 * LANES) /* vertices whose sums are in registers at once */

/* Sums over the modes in three columns, of ABREAST vertices: `fields` has a row of these for each
   mode. */
TARGET static void NAMED(sum_modes)(const double *fields, const double *x_basis,
                                    const double *y_basis, const double *z_basis, int64_t n_modes,
                                    double *x_out, double *y_out, double *z_out) {
    VECTOR x[4] = {{0}}, y[4] = {{0}}, z[4] = {{0}};
    for (int64_t mode = 0; mode < n_modes; mode++, fields += ABREAST) {
        for (int part = 0; part < 4; part++) {
            VECTOR field = ((const VECTOR *)fields)[part];
            x[part] += x_basis[mode] * field;
            y[part] += y_basis[mode] * field;
            z[part] += z_basis[mode] * field;
        }
    }
    for (int part = 0; part < 4; part++) {
        ((VECTOR *)x_out)[part] = x[part];
        ((VECTOR *)y_out)[part] = y[part];
        ((VECTOR *)z_out)[part] = z[part];
    }
}

/* A frame of a tile, a row of `sums` for each column. Where less than three columns are left, the
   last is found as often as needed. */
TARGET static void NAMED(sum_tile)(const frames_job *job, const double *tile, int64_t frame,
                                   double (*sums)[TILE]) {
    const double *basis = job->basis + frame * job->n_modes;
    int64_t apart = job->n_frames * job->n_modes, last = job->n_columns - 1;
    for (int64_t x = 0; x <= last; x += 3) {
        int64_t y = x < last ? x + 1 : last, z = x + 2 < last ? x + 2 : last;
        for (int first = 0; first < TILE; first += ABREAST) {
            NAMED(sum_modes)(tile + first * job->n_modes, basis + x * apart, basis + y * apart,
                             basis + z * apart, job->n_modes, sums[x] + first, sums[y] + first,
                             sums[z] + first);
        }
    }
}

/* Fields of the tile's vertices, as `sum_tile` reads them. Rows of vertices are read a few modes at
   a time, which are together in memory where the modes of a vertex are. */
static void NAMED(pack_tile)(const frames_job *job, const int32_t *vertices, int count,
                             double *tile) {
    double step = job->step;
    for (int first = 0; first < TILE; first += ABREAST, tile += ABREAST * job->n_modes) {
        for (int64_t begin = 0; begin < job->n_modes; begin += MODES) {
            int64_t end = begin + MODES < job->n_modes ? begin + MODES : job->n_modes;
            for (int i = 0; i < ABREAST; i++) {
                bool is_there = first + i < count;
                const double *field =
                    job->fields + (is_there ? vertices[first + i] * job->vertex_stride : 0);
                for (int64_t mode = begin; mode < end; mode++) {
                    tile[mode * ABREAST + i] =
                        is_there ? field[mode * job->mode_stride] * step : 0.0;
                }
            }
        }
    }
}

/* Writes three columns, or fewer, of a tile; `out` is that of its first vertex. */
#define DEFINE_INTERLEAVE(name, type)                                                              \
    TARGET REEL_INLINE void name(double (*sums)[TILE], int64_t left, int64_t stride, int count,    \
                                 type *restrict out) {                                             \
        type placed[3][TILE];                                                                      \
        for (int64_t column = 0; column < 3 && column < left; column++) {                          \
            for (int i = 0; i < TILE; i++) {                                                       \
                placed[column][i] = (type)sums[column][i];                                         \
            }                                                                                      \
        }                                                                                          \
        for (int i = 0; i < count && left >= 3; i++) {                                             \
            out[stride * i] = placed[0][i];                                                        \
            out[stride * i + 1] = placed[1][i];                                                    \
            out[stride * i + 2] = placed[2][i];                                                    \
        }                                                                                          \
        for (int64_t column = 0; column < left && left < 3; column++) {                            \
            for (int i = 0; i < count; i++) {                                                      \
                out[stride * i + column] = placed[column][i];                                      \
            }                                                                                      \
        }                                                                                          \
    }

DEFINE_INTERLEAVE(NAMED(interleave_floats), float)
DEFINE_INTERLEAVE(NAMED(interleave_doubles), double)
#undef DEFINE_INTERLEAVE

/* Writes a tile in model units, the columns of each vertex together, from number `start` on. */
TARGET REEL_INLINE void NAMED(place_columns)(const frames_job *job, double (*sums)[TILE],
                                             int64_t start, int count, int64_t n_columns) {
    for (int64_t column = 0; column < n_columns; column++) {
        double scale = job->placement[0], origin = job->placement[1 + column];
        for (int i = 0; i < TILE; i++) {
            sums[column][i] = sums[column][i] * scale + origin;
        }
    }
    for (int64_t x = 0; x < n_columns; x += 3) {
        if (job->layout == REEL_VALUES_8) {
            NAMED(interleave_doubles)(sums + x, n_columns - x, n_columns, count,
                                      (double *)job->out + start + x);
        } else {
            NAMED(interleave_floats)(sums + x, n_columns - x, n_columns, count,
                                     (float *)job->out + start + x);
        }
    }
}

/* Positions have code of their own. */
TARGET static void NAMED(place_tile)(const frames_job *job, double (*sums)[TILE], int64_t start,
                                     int count) {
    if (job->n_columns == 3) {
        NAMED(place_columns)(job, sums, start, count, 3);
    } else {
        NAMED(place_columns)(job, sums, start, count, job->n_columns);
    }
}

#undef VECTOR
#undef ABREAST
