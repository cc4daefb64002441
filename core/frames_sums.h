/* Sums of a tile of vertices over the modes, in vectors of NUMBERS values of type NUMBER;
   SUM_NAME(name) names each function. See frames_lanes.h. */

/* Vertices whose sums are in registers at once. */
#define VERTICES_PER_STEP (4 * NUMBERS)

typedef NUMBER SUM_NAME(vector) __attribute__((vector_size(sizeof(NUMBER) * NUMBERS), may_alias));

TARGET REEL_INLINE void SUM_NAME(write_sums)(const SUM_NAME(vector) *sums, double *out) {
    REEL_UNROLLED for (int i = 0; i < VERTICES_PER_STEP; i++) {
        out[i] = ((const NUMBER *)sums)[i];
    }
}

/* Sum basis times field over the modes, for three columns and VERTICES_PER_STEP consecutive
   vertices; `fields` points to the first of them in the row of the first mode. */
TARGET static void SUM_NAME(sum_modes)(const NUMBER *fields, const NUMBER *x_basis,
                                       const NUMBER *y_basis, const NUMBER *z_basis,
                                       int64_t n_modes, double *x_out, double *y_out,
                                       double *z_out) {
    SUM_NAME(vector) x[4] = {{0}}, y[4] = {{0}}, z[4] = {{0}};
    for (int64_t mode = 0; mode < n_modes; mode++, fields += TILE) {
        REEL_UNROLLED for (int k = 0; k < 4; k++) {
            SUM_NAME(vector) field = ((const SUM_NAME(vector) *)fields)[k];
            x[k] += x_basis[mode] * field;
            y[k] += y_basis[mode] * field;
            z[k] += z_basis[mode] * field;
        }
    }
    SUM_NAME(write_sums)(x, x_out);
    SUM_NAME(write_sums)(y, y_out);
    SUM_NAME(write_sums)(z, z_out);
}

/* Sum a frame of a tile over the modes, into a row of `sums` for each column. The basis vectors of
   consecutive columns are `stride` apart. If fewer than three columns are left, the last is
   recomputed. */
TARGET static void SUM_NAME(sum_tile)(const frames_job *job, const NUMBER *basis, int64_t stride,
                                      const NUMBER *tile, double (*sums)[TILE]) {
    int64_t last = job->n_columns - 1;
    for (int64_t x = 0; x <= last; x += 3) {
        int64_t y = x < last ? x + 1 : last, z = x + 2 < last ? x + 2 : last;
        for (int first = 0; first < TILE; first += VERTICES_PER_STEP) {
            SUM_NAME(sum_modes)
            (tile + first, basis + x * stride, basis + y * stride, basis + z * stride, job->n_modes,
             sums[x] + first, sums[y] + first, sums[z] + first);
        }
    }
}

#undef VERTICES_PER_STEP
