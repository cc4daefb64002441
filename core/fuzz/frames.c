/* Basis vectors from any integers, and frames of any fields with any corrections. */

#include "fuzz.h"

static double *any_basis(int64_t n_modes, int64_t n_frames) {
    int64_t n = 3 * n_modes * n_frames;
    int32_t *integers = fuzz_take(n, sizeof *integers);
    for (int64_t i = 0; i < n; i++) {
        integers[i] = fuzz_integer();
    }
    size_t size = reel_basis_memory(n_frames);
    double *basis = fuzz_take(n, sizeof *basis);
    int64_t result = reel_basis(fuzz_take((int64_t)size, 1), size, integers, n_modes, n_frames,
                                basis);
    FUZZ_CLAIM(result == n_modes);
    fuzz_note_doubles(basis, n);
    return basis;
}

/* Where the corrections of each frame begin, and the end. */
static int64_t *any_starts(int64_t n_wanted) {
    int64_t *starts = fuzz_take(n_wanted + 1, sizeof *starts);
    starts[0] = 0;
    for (int64_t i = 0; i < n_wanted; i++) {
        starts[i + 1] = starts[i] + fuzz_below(5);
    }
    return starts;
}

static int32_t *any_numbers(int64_t n, int64_t below) {
    int32_t *found = fuzz_take(n, sizeof *found);
    for (int64_t i = 0; i < n; i++) {
        found[i] = fuzz_once_in(200) ? fuzz_integer() : (int32_t)fuzz_below(below);
    }
    return found;
}

void fuzz_frames(void) {
    static const int64_t layouts[] = {REEL_AXES, REEL_POSITIONS_4, REEL_POSITIONS_8};
    int64_t n_modes = fuzz_below(5), n_frames = 1 + fuzz_below(40), n_verts = fuzz_below(150);
    int64_t n_wanted = fuzz_below(40), layout = layouts[fuzz_below(3)];
    double *basis = any_basis(n_modes, n_frames), placement[4];
    double *fields = fuzz_take(n_modes * n_verts, sizeof *fields);
    for (int64_t i = 0; i < n_modes * n_verts; i++) {
        fields[i] = fuzz_float();
    }
    for (int i = 0; i < 4; i++) {
        placement[i] = fuzz_float();
    }
    bool by_mode = fuzz_once_in(2);
    int32_t *wanted = any_numbers(n_wanted, n_frames);
    int32_t *order = fuzz_once_in(2) ? any_numbers(n_verts, n_verts) : NULL;
    int64_t *starts = fuzz_once_in(2) ? any_starts(n_wanted) : NULL;
    int64_t n_moves = starts ? starts[n_wanted] : 0;
    int32_t *corrected = any_numbers(n_moves, n_verts + 1);
    double *moves = fuzz_take(3 * n_moves, sizeof *moves);
    for (int64_t i = 0; i < 3 * n_moves; i++) {
        moves[i] = fuzz_float();
    }
    size_t size = reel_frames_memory(n_modes, n_wanted), item = layout == 4 ? 4 : 8;
    void *out = fuzz_take(3 * n_wanted * n_verts, item);
    int64_t result = reel_frames(fuzz_take((int64_t)size, 1), size, basis, fields,
                                 by_mode ? n_verts : 1, by_mode ? 1 : n_modes, 0.5, order, n_frames,
                                 n_modes, n_verts, wanted, n_wanted, starts, corrected, moves,
                                 placement, layout, out);
    fuzz_claim_code(result);
    int64_t n_found = result < 0 ? 0 : 3 * n_wanted * n_verts;
    double *found = fuzz_take(n_found, sizeof *found);
    for (int64_t i = 0; i < n_found; i++) {
        found[i] = item == 4 ? (double)((const float *)out)[i] : ((const double *)out)[i];
    }
    fuzz_note_doubles(found, n_found);
}
