/* Fuzz targets: basis vectors from and to integers, coordinates, and frames with arbitrary fields
   and corrections. */

#include "fuzz.h"

/* Resting times: NULL, or any but the first. */
static uint8_t *any_rests(int64_t n_frames) {
    uint8_t *rests = fuzz_allocate(n_frames, sizeof *rests);
    for (int64_t time = 0; time < n_frames; time++) {
        rests[time] = time > 0 && fuzz_one_in(2);
    }
    return fuzz_one_in(2) ? rests : NULL;
}

static double *any_basis(int64_t n_modes, int64_t n_columns, int64_t n_frames) {
    int64_t n = n_columns * n_modes * n_frames;
    int32_t *integers = fuzz_allocate(n, sizeof *integers);
    for (int64_t i = 0; i < n; i++) {
        integers[i] = fuzz_integer();
    }
    int64_t n_reused = fuzz_below(n_modes + 1), n_verts = fuzz_below(4);
    double *values = fuzz_allocate(n_verts * n_modes, sizeof *values);
    for (int64_t i = 0; i < n_verts * n_modes; i++) {
        values[i] = (double)fuzz_integer();
    }
    double *lengths = fuzz_allocate(n_reused, sizeof *lengths);
    FUZZ_CHECK(reel_lengths(values, n_verts, n_modes, n_reused, 4.0, lengths) == n_reused);
    size_t size = reel_basis_memory(n_columns, n_frames);
    double *basis = fuzz_allocate(n, sizeof *basis);
    if (fuzz_one_in(3)) {
        size = reel_cosine_basis_memory(n_columns, n_frames);
        int64_t output = reel_cosine_basis(fuzz_allocate((int64_t)size, 1), size, integers, n_modes,
                                           n_columns, n_frames, lengths, n_reused, basis);
        FUZZ_CHECK(output == n_modes);
        fuzz_hash_doubles(basis, n);
        return basis;
    }
    const uint8_t *rests = any_rests(n_frames);
    int64_t rest_bits = fuzz_below(REEL_MAX_REST_BITS + 1);
    int64_t result = reel_basis(fuzz_allocate((int64_t)size, 1), size, integers, n_modes, n_columns,
                                n_frames, rests, rest_bits, fuzz_below(2), lengths, n_reused,
                                basis);
    FUZZ_CHECK(result == n_modes);
    fuzz_hash_doubles(basis, n);
    return basis;
}

/* Where the corrections of each frame begin, and the end. */
static int64_t *any_starts(int64_t n_requested) {
    int64_t *starts = fuzz_allocate(n_requested + 1, sizeof *starts);
    starts[0] = 0;
    for (int64_t i = 0; i < n_requested; i++) {
        starts[i + 1] = starts[i] + fuzz_below(5);
    }
    return starts;
}

static int32_t *any_numbers(int64_t n, int64_t below) {
    int32_t *result = fuzz_allocate(n, sizeof *result);
    for (int64_t i = 0; i < n; i++) {
        result[i] = fuzz_one_in(200) ? fuzz_integer() : (int32_t)fuzz_below(below);
    }
    return result;
}

void fuzz_frames(void) {
    static const int64_t layouts[] = {REEL_COLUMNS, REEL_VALUES_4, REEL_VALUES_8};
    int64_t n_modes = fuzz_below(5), n_frames = 1 + fuzz_below(40), n_verts = fuzz_below(150);
    int64_t n_requested = fuzz_below(40), layout = layouts[fuzz_below(3)];
    int64_t n_columns = fuzz_one_in(2) ? 3 : 1 + fuzz_below(8),
            n = n_columns * n_requested * n_verts;
    double *basis = any_basis(n_modes, n_columns, n_frames);
    double *placement = fuzz_allocate(1 + n_columns, sizeof *placement);
    double *fields = fuzz_allocate(n_modes * n_verts, sizeof *fields);
    for (int64_t i = 0; i < n_modes * n_verts; i++) {
        fields[i] = fuzz_float();
    }
    for (int64_t i = 0; i <= n_columns; i++) {
        placement[i] = fuzz_float();
    }
    bool by_mode = fuzz_one_in(2);
    int64_t precision = fuzz_one_in(2) ? REEL_SUMS_4 : REEL_SUMS_8;
    int32_t *targets = any_numbers(n_requested, n_frames);
    int32_t *order = fuzz_one_in(2) ? any_numbers(n_verts, n_verts) : NULL;
    int64_t *starts = fuzz_one_in(2) ? any_starts(n_requested) : NULL;
    int64_t n_moves = starts ? starts[n_requested] : 0;
    int32_t *corrected = any_numbers(n_moves, n_verts + 1);
    double *offsets = fuzz_allocate(n_columns * n_moves, sizeof *offsets);
    for (int64_t i = 0; i < n_columns * n_moves; i++) {
        offsets[i] = fuzz_float();
    }
    void *packed = fuzz_allocate((int64_t)reel_packed_bytes(n_modes, n_verts, precision), 1);
    int64_t half = fuzz_below(3) * 64, begin = half < n_verts ? half : 0;
    int64_t result = 0, begins[] = {0, begin}, ends[] = {begin, n_verts};
    for (int i = 0; i < 2 && result == 0; i++) {
        result = reel_pack(fields, by_mode ? n_verts : 1, by_mode ? 1 : n_modes, 0.5, precision,
                           order, n_modes, n_verts, begins[i], ends[i], packed);
        fuzz_check_code(result);
    }
    size_t size = reel_frames_memory(n_columns, n_modes, n_requested), item = layout == 4 ? 4 : 8;
    void *out = fuzz_allocate(n, item);
    if (result == 0) {
        result = reel_frames(fuzz_allocate((int64_t)size, 1), size, basis, packed, precision,
                             n_columns, n_frames, n_modes, n_verts, targets, n_requested, starts,
                             corrected, offsets, placement, layout, out);
        fuzz_check_code(result);
    }
    int64_t n_found = result < 0 ? 0 : n;
    double *output = fuzz_allocate(n_found, sizeof *output);
    for (int64_t i = 0; i < n_found; i++) {
        output[i] = item == 4 ? (double)((const float *)out)[i] : ((const double *)out)[i];
    }
    fuzz_hash_doubles(output, n_found);
}

/* Quantize arbitrary basis vectors, to nearest or rate-distortion optimized. */
void fuzz_basis_encode(void) {
    int64_t n_modes = fuzz_below(5), n_columns = 1 + fuzz_below(5), n_frames = 1 + fuzz_below(40);
    int64_t n = n_modes * n_columns * n_frames;
    double *targets = fuzz_allocate(n, sizeof *targets), rd_lambda = fuzz_one_in(2) ? 0.0 : 0.12;
    for (int64_t i = 0; i < n; i++) {
        targets[i] = fuzz_float();
    }
    int32_t *integers = fuzz_allocate(n, sizeof *integers);
    if (fuzz_one_in(3)) {
        size_t needed = reel_cosines_encode_memory(n_frames);
        int64_t output = reel_cosines_encode(fuzz_allocate((int64_t)needed, 1), needed, targets,
                                             n_modes, n_columns, n_frames, rd_lambda, integers);
        fuzz_check_code(output);
        fuzz_hash(integers, output < 0 ? 0 : n, sizeof *integers);
        return;
    }
    size_t size = reel_basis_encode_memory(n_frames);
    uint8_t *rests = any_rests(n_frames);
    if (rests && fuzz_one_in(20)) {
        rests[0] = 1; /* must be rejected, like 9 bits */
    }
    int64_t result =
        reel_basis_encode(fuzz_allocate((int64_t)size, 1), size, targets, n_modes, n_columns,
                          n_frames, rests, fuzz_below(10), fuzz_below(2), rd_lambda, integers);
    fuzz_check_code(result);
    fuzz_hash(integers, result < 0 ? 0 : n, sizeof *integers);
}

/* Normalize arbitrary values of some vertices, which may be invalid. */
void fuzz_coordinates(void) {
    int64_t n_frames = fuzz_below(9), n_verts = fuzz_below(1200), size = fuzz_one_in(2) ? 4 : 8;
    int64_t n_columns = 1 + fuzz_below(4), n = n_columns * n_frames * n_verts;
    int64_t first = fuzz_below(n_verts + 2), count = fuzz_below(n_verts + 3);
    void *vertices = fuzz_allocate(n, (size_t)size);
    double placement[5], *out = fuzz_allocate(n_columns * n_frames * count, sizeof *out);
    for (int64_t i = 0; i < n; i++) {
        double one = fuzz_float();
        if (size == 4) {
            ((float *)vertices)[i] = (float)one;
        } else {
            ((double *)vertices)[i] = one;
        }
    }
    for (int i = 0; i < 5; i++) {
        placement[i] = fuzz_float();
    }
    int32_t *order = fuzz_one_in(2) ? any_numbers(n_verts, n_verts) : NULL;
    double *signs = fuzz_one_in(2) ? fuzz_allocate(count, sizeof *signs) : NULL;
    for (int64_t i = 0; signs && i < count; i++) {
        signs[i] = fuzz_one_in(2) ? 1.0 : -1.0;
    }
    for (int64_t i = 0; signs && i < n_columns * n_frames * count; i++) {
        out[i] = 0.0;
    }
    int64_t result = reel_coordinates(vertices, size, n_frames, n_verts, n_columns, order, first,
                                      first + count, placement, signs, out);
    fuzz_check_code(result);
    fuzz_hash_doubles(out, result < 0 ? 0 : n_columns * n_frames * count);
}
