/* Sums of a tile of vertices over the modes, in NUMBER: vectors of NUMBERS of them. OF(name) names
   each function. See frames_lanes.h. */

#define ABREAST (4 * NUMBERS) /* vertices whose sums are in registers at once */

typedef NUMBER OF(vector) __attribute__((vector_size(sizeof(NUMBER) * NUMBERS), may_alias));

TARGET REEL_INLINE void OF(write_sums)(const OF(vector) *sums, double *out) {
    REEL_UNROLLED for (int i = 0; i < ABREAST; i++) {
        out[i] = ((const NUMBER *)sums)[i];
    }
}

/* Sums over the modes in three columns, of ABREAST vertices: `fields` has a row of these for each
   mode. */
TARGET static void OF(sum_modes)(const NUMBER *fields, const NUMBER *x_basis,
                                 const NUMBER *y_basis, const NUMBER *z_basis, int64_t n_modes,
                                 double *x_out, double *y_out, double *z_out) {
    OF(vector) x[4] = {{0}}, y[4] = {{0}}, z[4] = {{0}};
    for (int64_t mode = 0; mode < n_modes; mode++, fields += ABREAST) {
        REEL_UNROLLED for (int part = 0; part < 4; part++) {
            OF(vector) field = ((const OF(vector) *)fields)[part];
            x[part] += x_basis[mode] * field;
            y[part] += y_basis[mode] * field;
            z[part] += z_basis[mode] * field;
        }
    }
    OF(write_sums)(x, x_out);
    OF(write_sums)(y, y_out);
    OF(write_sums)(z, z_out);
}

/* A frame of a tile, a row of `sums` for each column. Where less than three columns are left, the
   last is found as often as needed. */
TARGET static void OF(sum_tile)(const frames_job *job, const NUMBER *basis, const NUMBER *tile,
                                int64_t frame, double (*sums)[TILE]) {
    int64_t apart = job->n_frames * job->n_modes, last = job->n_columns - 1;
    basis += frame * job->n_modes;
    for (int64_t x = 0; x <= last; x += 3) {
        int64_t y = x < last ? x + 1 : last, z = x + 2 < last ? x + 2 : last;
        for (int first = 0; first < TILE; first += ABREAST) {
            OF(sum_modes)(tile + first * job->n_modes, basis + x * apart, basis + y * apart,
                          basis + z * apart, job->n_modes, sums[x] + first, sums[y] + first,
                          sums[z] + first);
        }
    }
}

/* Fields of the tile's vertices, as `sum_tile` reads them. Rows of vertices are read a few modes at
   a time, which are together in memory where the modes of a vertex are. */
static void OF(pack_tile)(const frames_job *job, const int32_t *vertices, int count,
                          NUMBER *tile) {
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
                        is_there ? (NUMBER)(field[mode * job->mode_stride] * step) : 0;
                }
            }
        }
    }
}

#undef ABREAST
