/* The stored group of a track in a block: docs/format.md, BLOCK, TRACK_BLOCK, FIELDS, CORRECTIONS,
   VALUES, MISSING. */

#include "group.h"

#define FIRST_ID REEL_BLOCK
#define N_IDS (REEL_ROUNDING + 1 - FIRST_ID)
#define MAX_LEARNED 255U
#define MAX_STEP 1e6F
#define WITH_RESTS 16 /* flags added to the layout */
#define WITH_COSINES 32
#define ADAPTIVE 64
#define FROM_POINTS 128
#define MAX_NUGGET_CODE 24
#define WITH_RELATED 32 /* flag added to the code of a nugget */
#define MAX_TIMES ((uint64_t)INT32_MAX)

#define BIT(id) (1U << ((id) - FIRST_ID))

/* Sections after BLOCK or TRACK_BLOCK: of stored values, of modes, and of the paper's methods. */
#define VALUES_IDS BIT(REEL_VALUES)
#define MODES_IDS \
    (BIT(REEL_BASIS) | BIT(REEL_COEFFICIENTS) | BIT(REEL_FIELDS) | BIT(REEL_CORRECTIONS))
#define PAPER_IDS \
    (BIT(REEL_BASIS) | BIT(REEL_ANCHORS) | BIT(REEL_COEFFICIENTS) | BIT(REEL_EXACT_POSITIONS) | \
     BIT(REEL_ANCHOR_RESIDUALS))

/* The payload of each section of a group; `offset` is 0 if it is missing. */
typedef struct {
    reel_range by_id[N_IDS];
} payloads;

static const reel_range *payload(const payloads *sections, uint32_t id) {
    return &sections->by_id[id - FIRST_ID];
}

/* Find the sections of a group: the section `first`, then those of the set `other_ids`, each at
   most once, COEFFICIENTS or VALUES last. */
static int find_payloads(reel_call *call, reel_range bytes, uint32_t first, uint32_t other_ids,
                         bool is_checked, payloads *sections) {
    uint64_t end = bytes.offset + bytes.length;
    uint32_t last = REEL_END;
    reel_zero(sections, sizeof *sections);
    int failure = is_checked ? reel_announce(call, bytes) : MESHREEL_OK;
    if (failure) {
        return failure;
    }
    for (uint64_t offset = bytes.offset; offset < end;) {
        reel_section section;
        REEL_TRY(reel_section_at(call, offset, end, &section));
        if (is_checked) {
            REEL_TRY(reel_section_check(call, &section));
        }
        if (reel_is_known(section.id)) {
            uint32_t id = section.id, allowed = last == REEL_END ? BIT(first) : other_ids;
            bool is_allowed = id >= FIRST_ID && id < FIRST_ID + N_IDS && allowed & BIT(id) &&
                              last != REEL_COEFFICIENTS && last != REEL_VALUES;
            REEL_CORRUPT_IF(!is_allowed || sections->by_id[id - FIRST_ID].offset, offset,
                            "a block has a section twice, or one that must not be there");
            sections->by_id[id - FIRST_ID] = section.payload;
            last = id;
        }
        offset = section.end;
    }
    return last == REEL_COEFFICIENTS || last == REEL_VALUES
               ? MESHREEL_OK
               : reel_corrupt(call, bytes.offset,
                              "a block does not end with COEFFICIENTS or VALUES");
}

static int read_counts(reel_call *call, const payloads *sections, uint32_t number,
                       const reel_track *track, uint64_t n_frames, reel_group *group) {
    reel_range input = *payload(sections, number ? REEL_TRACK_BLOCK : REEL_BLOCK);
    uint64_t offset = input.offset;
    group->n_frames = n_frames;
    REEL_TRY(number ? MESHREEL_OK : reel_read_varint(call, &input, &group->n_frames));
    REEL_TRY(reel_read_varint(call, &input, &group->n_modes));
    bool has_values = payload(sections, REEL_VALUES)->offset;
    uint64_t min_modes = has_values ? 0 : 1, max_modes = has_values ? 0 : track->n_coded * n_frames;
    REEL_CORRUPT_IF(input.length || group->n_frames != n_frames, offset,
                    "the block and the index disagree on the number of frames");
    REEL_UNSUPPORTED_IF(max_modes > MAX_TIMES, offset, "a block has more than 2^31 times");
    return group->n_modes >= min_modes && group->n_modes <= max_modes
               ? MESHREEL_OK
               : reel_corrupt(call, offset, "a block has no modes, or more than its frames allow");
}

static int read_reused(reel_call *call, reel_range *input, reel_group *group) {
    if (!group->reference || !input->length) {
        return MESHREEL_OK;
    }
    uint64_t offset = input->offset;
    REEL_TRY(reel_read_varint(call, input, &group->n_reused));
    REEL_TRY(reel_read_bytes(call, input, &group->finer, sizeof group->finer));
    bool is_valid = group->n_reused >= 1 && group->n_reused <= group->n_modes &&
                    group->finer > 0.0F && group->finer < MAX_STEP;
    return is_valid
               ? MESHREEL_OK
               : reel_corrupt(call, offset, "the number or scale of reused fields is out of range");
}

/* Read the next run of resting times after `end`, which receives its end. */
static int read_run(reel_call *call, reel_range *input, uint64_t n_frames, uint64_t *start,
                    uint64_t *end) {
    uint64_t gap, length, offset = input->offset;
    REEL_TRY(reel_read_varint(call, input, &gap));
    REEL_TRY(reel_read_varint(call, input, &length));
    REEL_CORRUPT_IF(!gap || !length || gap >= n_frames - *end || length > n_frames - *end - gap,
                    offset, "a run of resting times is not in its block");
    *start = *end + gap;
    *end = *start + length;
    return MESHREEL_OK;
}

static int read_resting_runs(reel_call *call, reel_range *input, reel_group *group) {
    uint64_t start, end = 0, offset = input->offset;
    REEL_TRY(reel_read_varint(call, input, &group->rest_bits));
    REEL_TRY(reel_read_varint(call, input, &group->n_rests));
    group->rests = *input;
    for (uint64_t i = 0; i < group->n_rests; i++) {
        REEL_TRY(read_run(call, input, group->n_frames, &start, &end));
    }
    bool is_valid = group->n_rests >= 1 && group->rest_bits <= REEL_MAX_REST_BITS;
    return is_valid ? MESHREEL_OK
                    : reel_corrupt(call, offset,
                                   "resting times have no runs, or too many fractional bits");
}

int reel_read_rests(reel_call *call, const reel_group *group, uint8_t **rests) {
    reel_range input = group->rests;
    uint64_t start, end = 0;
    *rests = NULL;
    if (!group->n_rests) {
        return MESHREEL_OK;
    }
    *rests = reel_scratch(call, group->n_frames, 1);
    REEL_NEED(*rests);
    reel_zero(*rests, (size_t)group->n_frames);
    for (uint64_t i = 0; i < group->n_rests; i++) {
        REEL_TRY(read_run(call, &input, group->n_frames, &start, &end));
        for (uint64_t time = start; time < end; time++) {
            (*rests)[time] = 1;
        }
    }
    return MESHREEL_OK;
}

/* Read the nugget of a track whose weights come from points, and its related track, if any. */
static int read_nugget(reel_call *call, reel_range *input, bool is_positions, reel_group *group) {
    uint8_t code;
    uint64_t offset = input->offset;
    REEL_TRY(reel_read_bytes(call, input, &code, sizeof code));
    bool has_related = code & WITH_RELATED;
    code &= (uint8_t)~WITH_RELATED;
    REEL_CORRUPT_IF(is_positions || code > MAX_NUGGET_CODE, offset,
                    "a nugget is out of range, or that of positions");
    group->nugget = 256.0 / (double)(1U << code);
    if (!has_related) {
        return MESHREEL_OK;
    }
    REEL_TRY(reel_read_varint(call, input, &group->related));
    return group->related ? MESHREEL_OK
                          : reel_corrupt(call, offset, "a track is related to itself");
}

static int read_fields(reel_call *call, reel_range input, bool is_positions, reel_group *group) {
    uint8_t layout;
    uint64_t offset = input.offset;
    REEL_CORRUPT_IF(!input.offset, REEL_UNKNOWN, "a block has no section FIELDS");
    REEL_TRY(reel_read_bytes(call, &input, &layout, 1));
    group->precision = layout & ~(WITH_RESTS | WITH_COSINES | ADAPTIVE | FROM_POINTS);
    group->has_cosines = layout & WITH_COSINES;
    group->is_adaptive = layout & ADAPTIVE;
    if (group->precision != REEL_SUMS_4 && group->precision != REEL_SUMS_8) {
        return reel_fail(call, MESHREEL_UNSUPPORTED, offset,
                         "the layout of the fields needs a newer version; update meshreel");
    }
    REEL_CORRUPT_IF(group->has_cosines &&
                        (layout & (WITH_RESTS | ADAPTIVE) || group->n_frames > REEL_MAX_COSINES),
                    offset, "a block with cosines over time rests, adapts or is too long");
    REEL_TRY(reel_read_varint(call, &input, &group->reference));
    REEL_TRY(reel_read_bytes(call, &input, &group->step, sizeof group->step));
    REEL_TRY(reel_read_varint(call, &input, &group->stencil_size));
    REEL_TRY(reel_read_varint(call, &input, &group->n_learned));
    if (layout & FROM_POINTS) {
        REEL_TRY(read_nugget(call, &input, is_positions, group));
    }
    if (layout & WITH_RESTS) {
        REEL_TRY(read_resting_runs(call, &input, group));
    }
    REEL_TRY(read_reused(call, &input, group));
    bool is_valid = !input.length && group->stencil_size >= 1 &&
                    group->stencil_size <= REEL_MAX_STENCIL && group->n_learned <= MAX_LEARNED &&
                    group->step > 0.0F && group->step < MAX_STEP;
    return is_valid ? MESHREEL_OK
                    : reel_corrupt(call, offset, "a number of a section FIELDS is out of range");
}

static int read_corrections(reel_call *call, reel_range input, reel_group *group) {
    uint64_t offset = input.offset;
    if (!input.offset) {
        return MESHREEL_OK;
    }
    REEL_TRY(reel_read_bytes(call, &input, &group->correction_step, sizeof group->correction_step));
    REEL_TRY(reel_read_varint(call, &input, &group->n_corrected));
    REEL_TRY(reel_read_varint(call, &input, &group->n_corrections));
    bool is_valid = group->n_corrected <= group->n_corrections && group->correction_step > 0.0F &&
                    group->correction_step < MAX_STEP;
    group->corrections = input;
    return is_valid ? MESHREEL_OK
                    : reel_corrupt(call, offset,
                                   "the step or the counts of corrections are out of range");
}

/* Forms of the section VALUES: exact values without a grid; integers on a grid, as exact values or
   along the surface, for positions. Flags: the step has single precision; all frames equal the only
   one stored. */
enum { GRID_NONE, GRID_EXACT, GRID_ON_SURFACE, GRID_FORMS, GRID_SINGLE, GRID_STILL = 8 };

/* Read VALUES; those of positions in `lossless` are on a grid if they have a rounding. */
static int read_values(reel_call *call, bool is_grid, bool is_of_positions,
                       const payloads *sections, reel_group *group) {
    reel_range input = *payload(sections, REEL_VALUES);
    REEL_CORRUPT_IF(!input.offset, REEL_UNKNOWN, "a block has no section VALUES");
    uint64_t offset = input.offset;
    uint8_t form = GRID_NONE;
    if (is_grid || payload(sections, REEL_ROUNDING)->offset) {
        REEL_TRY(reel_read_bytes(call, &input, &form, sizeof form));
    }
    if (form & GRID_SINGLE) {
        float step;
        REEL_TRY(reel_read_bytes(call, &input, &step, sizeof step));
        group->grid = (double)step;
    } else if (form != GRID_NONE) {
        REEL_TRY(reel_read_bytes(call, &input, &group->grid, sizeof group->grid));
    }
    group->is_still = form & GRID_STILL;
    group->is_on_surface = (form & GRID_FORMS) == GRID_ON_SURFACE;
    group->values = input;
    group->rounding = *payload(sections, REEL_ROUNDING);
    bool is_exact = (form & ~GRID_SINGLE) == GRID_EXACT;
    bool is_known = is_exact || (form == GRID_NONE && (is_of_positions || !is_grid)) ||
                    (group->is_on_surface && form < 16 && is_of_positions);
    REEL_CORRUPT_IF(!is_known, offset, "the form of values on a grid is unknown");
    REEL_CORRUPT_IF(form != GRID_NONE && !(group->grid > 0.0 && group->grid <= 1.0), offset,
                    "the step of a grid is not above 0 and at most 1 diagonal");
    return group->grid > 0.0 || !group->rounding.offset
               ? MESHREEL_OK
               : reel_corrupt(call, group->rounding.offset, "there is no grid to round");
}

int reel_read_group(reel_call *call, const reel_outline *outline, const reel_track *track,
                    uint32_t number, uint64_t block, bool is_checked, reel_group *group) {
    payloads sections;
    reel_range bytes = reel_group_bytes(outline, block, number);
    *group = (reel_group){0};
    uint32_t first = number ? REEL_TRACK_BLOCK : REEL_BLOCK;
    bool is_exact = track->info.is_exact || track->info.coding == REEL_EXACT;
    bool is_grid = number ? !is_exact : outline->method == REEL_METHOD_GRID;
    uint32_t other_ids = is_exact ? VALUES_IDS | (number ? 0 : BIT(REEL_ROUNDING))
                                  : MODES_IDS | (number ? VALUES_IDS | BIT(REEL_MISSING) : 0);
    REEL_TRY(find_payloads(call, bytes, first, other_ids, is_checked, &sections));
    REEL_TRY(read_counts(call, &sections, number, track, outline->blocks[block].n_frames, group));
    group->missing = *payload(&sections, REEL_MISSING);
    if (payload(&sections, REEL_VALUES)->offset || is_exact) {
        bool has_modes = payload(&sections, REEL_FIELDS)->offset ||
                         payload(&sections, REEL_BASIS)->offset ||
                         payload(&sections, REEL_CORRECTIONS)->offset;
        REEL_CORRUPT_IF(has_modes, bytes.offset, "a block has both modes and VALUES");
        return read_values(call, is_grid, !number, &sections, group);
    }
    REEL_TRY(read_fields(call, *payload(&sections, REEL_FIELDS), !number, group));
    REEL_CORRUPT_IF(group->related && group->related >= number, bytes.offset,
                    "a track is related to one before the first");
    REEL_TRY(read_corrections(call, *payload(&sections, REEL_CORRECTIONS), group));
    group->basis = *payload(&sections, REEL_BASIS);
    group->coefficients = *payload(&sections, REEL_COEFFICIENTS);
    return group->basis.offset && group->coefficients.offset
               ? MESHREEL_OK
               : reel_corrupt(call, bytes.offset, "a block has no BASIS or COEFFICIENTS");
}

int reel_read_paper_group(reel_call *call, const reel_outline *outline, uint64_t block,
                          bool is_checked, reel_group *group) {
    payloads sections;
    *group = (reel_group){0};
    reel_range bytes = reel_group_bytes(outline, block, 0);
    REEL_TRY(find_payloads(call, bytes, REEL_BLOCK, PAPER_IDS, is_checked, &sections));
    reel_range input = *payload(&sections, REEL_BLOCK);
    REEL_TRY(reel_read_varint(call, &input, &group->n_frames));
    return reel_read_varint(call, &input, &group->n_modes);
}

/* ---- corrections ---- */

#define N_TABLES 4
#define MAX_ROWS (3 + 256)

/* The decoded rows of integers. */
typedef struct {
    int64_t n, n_all;
    uint32_t n_columns;
    const int32_t *items, *counts, *frames, *offsets; /* offsets: n_columns rows */
} correction_rows;

static int read_correction_rows(reel_call *call, const reel_group *group, uint32_t n_columns,
                                correction_rows *result) {
    int64_t n = (int64_t)group->n_corrected, n_all = (int64_t)group->n_corrections;
    int64_t lengths[MAX_ROWS] = {n, n, n_all};
    int32_t tables[MAX_ROWS] = {0, 1, 2}, *values;
    for (uint32_t i = 0; i < n_columns; i++) {
        lengths[3 + i] = n_all;
        tables[3 + i] = 3;
    }
    REEL_TRY(reel_decode_rows(call, group->corrections, lengths, tables, 3 + (int64_t)n_columns,
                              N_TABLES, &values));
    *result = (correction_rows){
        n, n_all, n_columns, values, values + n, values + 2 * n, values + 2 * n + n_all};
    return MESHREEL_OK;
}

/* Check that items and frames exist and ascend, and that counts add up. Finds where the corrections
   of each run begin, the run of each output item, and in starts[frame + 1] the number of
   corrections of each frame. */
static bool find_runs(const correction_rows *rows, const int32_t *inverse, int64_t n_items,
                      int64_t n_frames, int64_t *begins, int32_t *run_of, int64_t *starts) {
    int64_t next = 0, item = 0;
    for (int64_t i = 0; i < n_items; i++) {
        run_of[i] = -1;
    }
    for (int64_t i = 0; i < rows->n; i++) {
        item += rows->items[i];
        if (item < 0 || item >= n_items || (i && rows->items[i] <= 0) || rows->counts[i] < 0 ||
            rows->counts[i] >= rows->n_all - next) {
            return false;
        }
        begins[i] = next;
        run_of[inverse ? inverse[item] : item] = (int32_t)i;
        int64_t end = next + rows->counts[i] + 1, frame = 0;
        for (int64_t first = next; next < end; next++) {
            frame += rows->frames[next];
            if (frame < 0 || frame >= n_frames || (next > first && rows->frames[next] <= 0)) {
                return false;
            }
            starts[frame + 1]++;
        }
    }
    begins[rows->n] = next;
    return next == rows->n_all;
}

/* Store the corrections of a run at the next free index of their frames. */
static void store_run(const correction_rows *rows, int64_t begin, int64_t end, int32_t item,
                      double step, int64_t *offsets, int64_t *next,
                      const reel_corrections *result) {
    int64_t frame = 0;
    uint32_t n_columns = rows->n_columns;
    for (int64_t i = begin; i < end; i++) {
        bool follows = i > begin && rows->frames[i] == 1;
        frame += rows->frames[i];
        int64_t index = next[frame]++;
        result->items[index] = item;
        for (uint32_t column = 0; column < n_columns; column++) {
            int32_t offset = rows->offsets[column * rows->n_all + i];
            offsets[column] = (follows ? offsets[column] : 0) + offset;
            result->offsets[n_columns * index + column] = (double)offsets[column] * step;
        }
    }
}

int reel_read_corrections(reel_call *call, reel_pool *pool, const reel_group *group,
                          uint32_t n_columns, uint64_t n_items, const int32_t *inverse,
                          reel_corrections *result) {
    correction_rows rows;
    *result = (reel_corrections){NULL, NULL, NULL};
    if (!group->corrections.offset) {
        return MESHREEL_OK;
    }
    const reel_chunk *mark = call->scratch.last;
    REEL_TRY(read_correction_rows(call, group, n_columns, &rows));
    uint64_t n_frames = group->n_frames;
    int64_t *starts = result->starts = reel_pool_allocate(call, pool, n_frames + 1, sizeof *starts);
    result->items = reel_pool_allocate(call, pool, group->n_corrections, sizeof *result->items);
    result->offsets =
        reel_pool_allocate(call, pool, group->n_corrections, n_columns * sizeof *result->offsets);
    int64_t *begins = reel_scratch(call, group->n_corrected + 1, sizeof *begins);
    int32_t *run_of = reel_scratch(call, n_items, sizeof *run_of);
    REEL_NEED(starts && result->items && result->offsets && begins && run_of);
    reel_zero(starts, (n_frames + 1) * sizeof *starts);
    if (!find_runs(&rows, inverse, (int64_t)n_items, (int64_t)n_frames, begins, run_of, starts)) {
        return reel_corrupt(call, group->corrections.offset,
                            "a correction is out of order, or its value does not exist");
    }
    for (uint64_t t = 0; t < n_frames; t++) {
        starts[t + 1] += starts[t];
    }
    for (uint64_t i = 0; i < n_items; i++) {
        /* By output item, so that items ascend in each frame. */
        if (run_of[i] >= 0) {
            int64_t offsets[256];
            store_run(&rows, begins[run_of[i]], begins[run_of[i] + 1], (int32_t)i,
                      (double)group->correction_step, offsets, starts, result);
        }
    }
    for (uint64_t t = n_frames; t > 0; t--) {
        /* Each start has advanced to that of the next frame. */
        starts[t] = starts[t - 1];
    }
    starts[0] = 0;
    reel_drop_scratch(call, mark);
    return MESHREEL_OK;
}

/* ---- numbers on a grid ---- */

int reel_read_rounding(reel_call *call, reel_pool *pool, const reel_group *group, uint64_t max_rows,
                       reel_rounding *result) {
    reel_range input = group->rounding;
    int64_t lengths[6] = {1, 1, 1}, n_all = 0;
    int32_t tables[6] = {0, 1, 2, 3, 4, 5}, *values;
    *result = (reel_rounding){{0}, {0}, {NULL}};
    if (!input.offset) {
        return MESHREEL_OK;
    }
    for (uint32_t axis = 0; axis < 3; axis++) {
        uint64_t count;
        REEL_TRY(reel_read_varint(call, &input, &count));
        REEL_CORRUPT_IF(count > max_rows, group->rounding.offset,
                        "there are more rounded coordinates than positions");
        lengths[3 + axis] = result->n[axis] = (int64_t)count;
        n_all += result->n[axis];
    }
    const reel_chunk *mark = call->scratch.last;
    REEL_TRY(reel_decode_rows(call, input, lengths, tables, 6, 6, &values));
    int32_t *offsets = reel_pool_allocate(call, pool, (uint64_t)n_all, sizeof *offsets);
    REEL_NEED(offsets);
    reel_copy(offsets, values + 3, (size_t)n_all * sizeof *offsets);
    for (uint32_t axis = 0; axis < 3; axis++) {
        result->lowest[axis] = values[axis];
        result->offsets[axis] = offsets;
        offsets += result->n[axis];
    }
    reel_drop_scratch(call, mark);
    return MESHREEL_OK;
}
