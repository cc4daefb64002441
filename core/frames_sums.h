/* Sums of a tile of vertices over the modes, in NUMBER: vectors of NUMBERS of them. OF(name) names
   each function. See frames_lanes.h. */

#define ABREAST (4 * NUMBERS) /* vertices whose sums are in registers at once */

typedef NUMBER OF(vector) __attribute__((vector_size(sizeof(NUMBER) * NUMBERS), may_alias));

TARGET REEL_INLINE void OF(write_sums)(const OF(vector) *sums, double *out) {
    REEL_UNROLLED for (int i = 0; i < ABREAST; i++) {
        out[i] = ((const NUMBER *)sums)[i];
    }
}

/* Sums over the modes in three columns, of ABREAST vertices; `fields` are those of the first one. */
TARGET static void OF(sum_modes)(const NUMBER *fields, const NUMBER *x_basis,
                                 const NUMBER *y_basis, const NUMBER *z_basis, int64_t n_modes,
                                 double *x_out, double *y_out, double *z_out) {
    OF(vector) x[4] = {{0}}, y[4] = {{0}}, z[4] = {{0}};
    for (int64_t mode = 0; mode < n_modes; mode++, fields += TILE) {
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

/* A frame of a tile, a row of `sums` for each column. Basis vectors of a column are `apart` numbers
   behind those of the one before. Where less than three columns are left, the last is found as often
   as needed. */
TARGET static void OF(sum_tile)(const frames_job *job, const NUMBER *basis, int64_t apart,
                                const NUMBER *tile, double (*sums)[TILE]) {
    int64_t last = job->n_columns - 1;
    for (int64_t x = 0; x <= last; x += 3) {
        int64_t y = x < last ? x + 1 : last, z = x + 2 < last ? x + 2 : last;
        for (int first = 0; first < TILE; first += ABREAST) {
            OF(sum_modes)(tile + first, basis + x * apart, basis + y * apart, basis + z * apart,
                          job->n_modes, sums[x] + first, sums[y] + first, sums[z] + first);
        }
    }
}

#undef ABREAST
