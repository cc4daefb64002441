/* The tracks of a file: docs/format.md, "Tracks". */

#include "tracks.h"

#include "names.h"

#define WITH_BOUND 16
#define SINGLE 32 /* the numbers of a track are floats */
#define OF_CELLS ((int)MESHREEL_CORNERS + (int)REEL_OF_ROWS + 1)

/* Least and greatest number of columns of each kind. */
static const uint16_t WIDTHS[][2] = {
    [MESHREEL_TRACK_OTHER] = {1, 256},
    [MESHREEL_TRACK_VECTOR] = {2, 3},
    [MESHREEL_TRACK_VELOCITY] = {3, 3},
    [MESHREEL_TRACK_NORMAL] = {3, 3},
    [MESHREEL_TRACK_COLOR] = {3, 4},
    [MESHREEL_TRACK_UV] = {2, 2},
    [MESHREEL_TRACK_SCALAR] = {1, 1},
};
#define N_KINDS (sizeof WIDTHS / sizeof *WIDTHS)

static int fail_track(reel_call *call, const reel_section *section, const char *message) {
    return reel_corrupt(call, section->payload.offset, message);
}

static bool has_type(reel_track *track, uint32_t code) {
    uint32_t size = code & 15U, kind = code >> 4;
    bool is_integer =
        (kind == 1 || kind == 2) && (size == 1 || size == 2 || size == 4 || size == 8);
    track->size = size;
    track->is_float = kind == 0;
    track->is_signed = kind == 2;
    return is_integer || (kind == 0 && (size == 4 || size == 8));
}

/* Whether a predicted coding matches the kind and domain of a track. */
static bool is_valid_coding(const reel_track *track) {
    const meshreel_track *info = &track->info;
    if (info->coding == REEL_ROTATIONS) {
        return info->kind == MESHREEL_TRACK_NORMAL && info->domain != MESHREEL_CELLS;
    }
    bool is_of_vertices = info->domain == MESHREEL_VERTICES || track->sharing == REEL_OF_VERTICES;
    return !track->difference || (info->kind == MESHREEL_TRACK_VELOCITY && is_of_vertices);
}

/* Read a float or double. */
static int read_number(reel_call *call, reel_range *input, bool is_single, double *number) {
    if (!is_single) {
        return reel_read_bytes(call, input, number, sizeof *number);
    }
    float single;
    REEL_TRY(reel_read_bytes(call, input, &single, sizeof single));
    *number = (double)single;
    return MESHREEL_OK;
}

/* Read the numbers of a track that its coding stores: bound, scale, origins, rate. */
static int read_numbers(reel_call *call, reel_range *input, reel_track *track, uint32_t flags) {
    meshreel_track *info = &track->info;
    bool has_bound = flags & WITH_BOUND, is_single = flags & SINGLE;
    double *scale = &track->placement[0];
    *scale = 1.0;
    if (has_bound || !info->is_exact) {
        REEL_TRY(read_number(call, input, is_single, &info->bound));
    }
    if (!info->is_exact) {
        REEL_TRY(read_number(call, input, is_single, scale));
    }
    bool are_valid = reel_is_finite(info->bound) && info->bound >= 0.0 &&
                     (info->bound > 0.0 || !has_bound) && reel_is_finite(*scale) && *scale > 0.0;
    for (uint32_t i = 0; i < track->n_coded; i++) {
        double *origin = &track->placement[1 + i];
        *origin = 0.0;
        if (info->coding == REEL_MODES) {
            REEL_TRY(read_number(call, input, is_single, origin));
        }
        are_valid &= reel_is_finite(*origin);
    }
    if (track->difference) {
        REEL_TRY(read_number(call, input, is_single, &track->rate));
        are_valid &= reel_is_finite(track->rate);
    }
    return are_valid
               ? MESHREEL_OK
               : reel_corrupt(call, input->offset,
                              "a track has a bound, scale, origin or rate that is out of range");
}

static int read_track(reel_call *call, reel_pool *pool, const reel_outline *outline,
                      const reel_section *section, reel_track *track) {
    reel_range input = section->payload;
    meshreel_track *info = &track->info;
    uint8_t codes[4];
    uint64_t n_columns;
    REEL_TRY(reel_read_bytes(call, &input, codes, sizeof codes));
    REEL_TRY(reel_read_text(call, pool, &input, &info->name));
    REEL_TRY(reel_read_text(call, pool, &input, &info->unit));
    REEL_TRY(reel_read_varint(call, &input, &n_columns));
    uint32_t flags = codes[3] & (WITH_BOUND | SINGLE), coding = codes[3] - flags;
    if (codes[0] >= N_KINDS || codes[1] > OF_CELLS || !has_type(track, codes[2]) ||
        coding > REEL_EXACT_FORWARD) {
        return reel_fail(call, MESHREEL_UNSUPPORTED, section->payload.offset,
                         "a track needs a newer version; update meshreel");
    }
    if (n_columns < WIDTHS[codes[0]][0] || n_columns > WIDTHS[codes[0]][1]) {
        return fail_track(call, section,
                          "the number of columns of a track does not match its kind");
    }
    bool is_of_cells = codes[1] == OF_CELLS, is_shared = codes[1] > MESHREEL_CORNERS;
    track->sharing = is_shared && !is_of_cells ? codes[1] - MESHREEL_CORNERS : REEL_UNSHARED;
    info->kind = codes[0];
    info->domain = is_of_cells ? MESHREEL_CELLS : codes[1] - track->sharing;
    info->type = codes[2];
    info->coding = coding;
    info->n_columns = (uint32_t)n_columns;
    info->n_items = reel_count_items(outline, info->domain);
    if (!info->n_items) {
        return fail_track(call, section, "a track is of cells, and the mesh has none");
    }
    info->is_exact = info->coding == REEL_EXACT || info->coding >= REEL_EXACT_BACKWARD;
    track->difference = info->coding >= REEL_EXACT_BACKWARD
                            ? info->coding - REEL_EXACT_BACKWARD + REEL_BACKWARD
                        : info->coding >= REEL_BACKWARD ? info->coding
                                                        : 0;
    track->n_coded = info->coding == REEL_ROTATIONS ? 2 : (uint32_t)n_columns;
    if (!is_valid_coding(track) || (flags & WITH_BOUND && !info->is_exact)) {
        return fail_track(call, section, "the coding of a track does not match its kind");
    }
    if (!track->is_float && info->coding != REEL_EXACT) {
        return fail_track(call, section, "a track of integers is not exact");
    }
    track->placement = reel_pool_allocate(call, pool, 1 + track->n_coded, sizeof(double));
    REEL_NEED(track->placement);
    REEL_TRY(read_numbers(call, &input, track, flags));
    if (input.length && track->sharing != REEL_OF_ROWS) {
        return fail_track(call, section, "bytes follow a track");
    }
    track->rows = input;
    return MESHREEL_OK;
}

static int read_positions(reel_call *call, reel_pool *pool, const reel_outline *outline,
                          reel_track *track) {
    bool has_modes = outline->method == REEL_METHOD_REEL;
    double bound = outline->error_bound_percent / 100.0 * outline->placement[0];
    track->info = (meshreel_track){.name = {"", 0},
                                   .unit = {"", 0},
                                   .kind = MESHREEL_TRACK_VECTOR,
                                   .domain = MESHREEL_VERTICES,
                                   .type = outline->number_bytes,
                                   .n_columns = 3,
                                   .n_items = (uint32_t)outline->n_verts,
                                   .coding = has_modes ? REEL_MODES : REEL_EXACT,
                                   .is_exact = outline->method == REEL_METHOD_LOSSLESS,
                                   .bound = bound};
    track->n_coded = 3;
    track->size = outline->number_bytes;
    track->is_float = true;
    track->placement = reel_pool_allocate(call, pool, 4, sizeof(double));
    REEL_NEED(track->placement);
    reel_copy(track->placement, outline->placement, sizeof outline->placement);
    return MESHREEL_OK;
}

static int check_names(reel_call *call, const reel_track *tracks, uint32_t count, uint64_t offset) {
    meshreel_text *names = reel_scratch(call, count, sizeof *names);
    for (uint32_t i = 0; names && i < count; i++) {
        names[i] = tracks[i].info.name;
    }
    return names ? reel_check_names(call, names, count, offset, "two tracks have the same name")
                 : call->error.code;
}

int reel_read_tracks(reel_call *call, reel_pool *pool, const reel_outline *outline,
                     reel_track **tracks) {
    reel_track *result = reel_pool_allocate(call, pool, outline->n_tracks, sizeof *result);
    REEL_NEED(result);
    reel_zero(result, outline->n_tracks * sizeof *result);
    *tracks = result;
    REEL_TRY(read_positions(call, pool, outline, result));
    uint32_t count = 1;
    uint64_t offset = outline->begin;
    for (uint32_t i = 0; i < outline->n_leading; i++) {
        const reel_section *section = &outline->leading[i];
        if (section->id != REEL_TRACK) {
            continue;
        }
        REEL_TRY(read_track(call, pool, outline, section, &result[count++]));
        offset = section->payload.offset;
    }
    return count == 1 ? MESHREEL_OK : check_names(call, result + 1, count - 1, offset);
}
