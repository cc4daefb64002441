/* Positions of a tile of vertices, LANES at a time; see frames.c and cpu.h. */

#define VECTOR REEL_JOIN(reel_vector_, LANES)
#define ABREAST (4 * LANES) /* vertices whose sums are in registers at once */

/* Sums over the modes, of ABREAST vertices: `fields` has a row of these for each mode. */
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

/* A frame of a tile; rows of `sums` are x, y and z. */
TARGET static void NAMED(sum_tile)(const frames_job *job, const double *tile, int64_t frame,
                                   double (*sums)[TILE]) {
    const double *basis = job->basis + frame * job->n_modes;
    int64_t axis = job->n_frames * job->n_modes;
    for (int first = 0; first < TILE; first += ABREAST) {
        NAMED(sum_modes)(tile + first * job->n_modes, basis, basis + axis, basis + 2 * axis,
                         job->n_modes, sums[0] + first, sums[1] + first, sums[2] + first);
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

/* Writes a tile in model units, x, y, z of each vertex together, from number `start` on. */
TARGET static void NAMED(place_tile)(const frames_job *job, double (*sums)[TILE], int64_t start,
                                     int count) {
    for (int axis = 0; axis < 3; axis++) {
        double scale = job->placement[0], origin = job->placement[1 + axis];
        for (int i = 0; i < TILE; i++) {
            sums[axis][i] = sums[axis][i] * scale + origin;
        }
    }
    if (job->layout == REEL_POSITIONS_8) {
        double *restrict out = (double *)job->out + start;
        for (int i = 0; i < count; i++) {
            out[3 * i] = sums[0][i];
            out[3 * i + 1] = sums[1][i];
            out[3 * i + 2] = sums[2][i];
        }
        return;
    }
    float placed[3][TILE];
    for (int axis = 0; axis < 3; axis++) {
        for (int i = 0; i < TILE; i++) {
            placed[axis][i] = (float)sums[axis][i];
        }
    }
    float *restrict out = (float *)job->out + start;
    for (int i = 0; i < count; i++) {
        out[3 * i] = placed[0][i];
        out[3 * i + 1] = placed[1][i];
        out[3 * i + 2] = placed[2][i];
    }
}

#undef VECTOR
#undef ABREAST
