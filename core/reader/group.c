/* The stored group of a track in a block: docs/format.md, BLOCK, TRACK_BLOCK, FIELDS, CORRECTIONS,
   VALUES, MISSING. */

#include "group.h"

#define FIRST_ID REEL_BLOCK
#define N_IDS (REEL_ANCHOR_RESIDUALS + 1 - FIRST_ID)
#define MAX_LEARNED 255U
#define MAX_STEP 1e6F
#define WITH_RESTS 16 /* flags added to the layout */
#define WITH_COSINES 32
#define ADAPTIVE 64
#define MAX_TIMES ((uint64_t)INT32_MAX)

/* The payload of each section of a group; `at` is 0 if it is missing. */
typedef struct {
    reel_range of[N_IDS];
} payloads;

static const reel_range *payload(const payloads *all, uint32_t id) {
    return &all->of[id - FIRST_ID];
}

static int find_payloads(reel_call *call, reel_range bytes, uint32_t first, bool is_checked,
                         payloads *all) {
    uint64_t end = bytes.at + bytes.length;
    bool is_begun = false;
    reel_zero(all, sizeof *all);
    int announced = is_checked ? reel_announce(call, bytes) : MESHREEL_OK;
    if (announced) {
        return announced;
    }
    for (uint64_t at = bytes.at; at < end;) {
        reel_section section;
        int failed = reel_section_at(call, at, end, &section);
        if (!failed && is_checked) {
            failed = reel_section_check(call, &section);
        }
        if (failed) {
            return failed;
        }
        bool is_known = reel_is_known(section.id);
        if (is_known && (section.id == first) == is_begun) {
            return reel_corrupt(
                call, at, "a block does not begin with its only section BLOCK or TRACK_BLOCK");
        }
        is_begun |= is_known;
        if (is_known && section.id >= FIRST_ID && !(section.id & REEL_OPTIONAL)) {
            reel_range *slot = &all->of[section.id - FIRST_ID];
            if (slot->at) {
                return reel_corrupt(call, at, "a block has a section twice");
            }
            *slot = section.payload;
        }
        at = section.end;
    }
    return is_begun ? MESHREEL_OK : reel_corrupt(call, bytes.at, "a block has no sections");
}

static int read_counts(reel_call *call, const payloads *all, uint32_t number,
                       const reel_track *track, uint64_t n_frames, reel_group *group) {
    reel_range left = *payload(all, number ? REEL_TRACK_BLOCK : REEL_BLOCK);
    uint64_t at = left.at;
    group->n_frames = n_frames;
    int failed = number ? MESHREEL_OK : reel_read_varint(call, &left, &group->n_frames);
    failed = failed ? failed : reel_read_varint(call, &left, &group->n_modes);
    if (failed) {
        return failed;
    }
    bool is_exact = track->info.coding == REEL_EXACT || track->info.is_exact;
    uint64_t min_modes = is_exact ? 0 : 1, max_modes = is_exact ? 0 : track->n_coded * n_frames;
    if (left.length || group->n_frames != n_frames) {
        return reel_corrupt(call, at, "the block and the index disagree on the number of frames");
    }
    if (max_modes > MAX_TIMES) {
        return reel_fail(call, MESHREEL_UNSUPPORTED, at, "a block has more than 2^31 times");
    }
    return group->n_modes >= min_modes && group->n_modes <= max_modes
               ? MESHREEL_OK
               : reel_corrupt(call, at, "a block has no modes, or more than its frames allow");
}

static int read_reused(reel_call *call, reel_range *left, reel_group *group) {
    if (!group->reference || !left->length) {
        return MESHREEL_OK;
    }
    uint64_t at = left->at;
    int failed = reel_read_varint(call, left, &group->n_reused);
    failed = failed ? failed : reel_read_bytes(call, left, &group->finer, sizeof group->finer);
    bool is_valid = group->n_reused >= 1 && group->n_reused <= group->n_modes &&
                    group->finer > 0.0F && group->finer < MAX_STEP;
    return failed || is_valid
               ? failed
               : reel_corrupt(call, at, "the number or scale of reused fields is out of range");
}

/* Read the next run of resting times after `end`, which receives its end. */
static int read_run(reel_call *call, reel_range *left, uint64_t n_frames, uint64_t *start,
                    uint64_t *end) {
    uint64_t gap, length, at = left->at;
    int failed = reel_read_varint(call, left, &gap);
    failed = failed ? failed : reel_read_varint(call, left, &length);
    if (failed) {
        return failed;
    }
    if (!gap || !length || gap >= n_frames - *end || length > n_frames - *end - gap) {
        return reel_corrupt(call, at, "a run of resting times is not in its block");
    }
    *start = *end + gap;
    *end = *start + length;
    return MESHREEL_OK;
}

static int read_resting_runs(reel_call *call, reel_range *left, reel_group *group) {
    uint64_t start, end = 0, at = left->at;
    int failed = reel_read_varint(call, left, &group->rest_bits);
    failed = failed ? failed : reel_read_varint(call, left, &group->n_rests);
    group->rests = *left;
    for (uint64_t i = 0; !failed && i < group->n_rests; i++) {
        failed = read_run(call, left, group->n_frames, &start, &end);
    }
    bool is_valid = group->n_rests >= 1 && group->rest_bits <= REEL_MAX_REST_BITS;
    return failed || is_valid
               ? failed
               : reel_corrupt(call, at, "resting times have no runs, or too many fractional bits");
}

int reel_read_rests(reel_call *call, const reel_group *group, uint8_t **rests) {
    reel_range left = group->rests;
    uint64_t start, end = 0;
    *rests = NULL;
    if (!group->n_rests) {
        return MESHREEL_OK;
    }
    *rests = reel_scratch(call, group->n_frames, 1);
    int failed = *rests ? MESHREEL_OK : call->error.code;
    if (!failed) {
        reel_zero(*rests, (size_t)group->n_frames);
    }
    for (uint64_t i = 0; i < group->n_rests && !failed; i++) {
        failed = read_run(call, &left, group->n_frames, &start, &end);
        for (uint64_t time = start; time < end && !failed; time++) {
            (*rests)[time] = 1;
        }
    }
    return failed;
}

static int read_fields(reel_call *call, reel_range left, reel_group *group) {
    uint8_t layout;
    uint64_t at = left.at;
    if (!left.at) {
        return reel_corrupt(call, REEL_UNKNOWN, "a block has no section FIELDS");
    }
    int failed = reel_read_bytes(call, &left, &layout, 1);
    if (failed) {
        return failed;
    }
    group->precision = layout & ~(WITH_RESTS | WITH_COSINES | ADAPTIVE);
    group->has_cosines = layout & WITH_COSINES;
    group->is_adaptive = layout & ADAPTIVE;
    if (group->precision != REEL_SUMS_4 && group->precision != REEL_SUMS_8) {
        return reel_fail(call, MESHREEL_UNSUPPORTED, at,
                         "the layout of the fields needs a newer version; update meshreel");
    }
    if (group->has_cosines &&
        (layout & (WITH_RESTS | ADAPTIVE) || group->n_frames > REEL_MAX_COSINES)) {
        return reel_corrupt(call, at, "a block with cosines over time rests, adapts or is too long");
    }
    failed = reel_read_varint(call, &left, &group->reference);
    failed = failed ? failed : reel_read_bytes(call, &left, &group->step, sizeof group->step);
    failed = failed ? failed : reel_read_varint(call, &left, &group->stencil_size);
    failed = failed ? failed : reel_read_varint(call, &left, &group->n_learned);
    if (!failed && layout & WITH_RESTS) {
        failed = read_resting_runs(call, &left, group);
    }
    failed = failed ? failed : read_reused(call, &left, group);
    bool is_valid = !left.length && group->stencil_size >= 1 &&
                    group->stencil_size <= REEL_MAX_STENCIL && group->n_learned <= MAX_LEARNED &&
                    group->step > 0.0F && group->step < MAX_STEP;
    return failed || is_valid
               ? failed
               : reel_corrupt(call, at, "a number of a section FIELDS is out of range");
}

static int read_corrections(reel_call *call, reel_range left, reel_group *group) {
    uint64_t at = left.at;
    if (!left.at) {
        return MESHREEL_OK;
    }
    int failed =
        reel_read_bytes(call, &left, &group->correction_step, sizeof group->correction_step);
    failed = failed ? failed : reel_read_varint(call, &left, &group->n_corrected);
    failed = failed ? failed : reel_read_varint(call, &left, &group->n_corrections);
    bool is_valid = group->n_corrected <= group->n_corrections && group->correction_step > 0.0F &&
                    group->correction_step < MAX_STEP;
    group->corrections = left;
    return failed || is_valid
               ? failed
               : reel_corrupt(call, at, "the step or the counts of corrections are out of range");
}

static int read_values(reel_call *call, bool is_grid, reel_range left, reel_group *group) {
    if (!left.at) {
        return reel_corrupt(call, REEL_UNKNOWN, "a block has no section VALUES");
    }
    uint64_t at = left.at;
    int failed =
        is_grid ? reel_read_bytes(call, &left, &group->grid, sizeof group->grid) : MESHREEL_OK;
    group->values = left;
    bool is_valid = group->grid >= 0.0 && group->grid <= 1.0;
    return failed || is_valid
               ? failed
               : reel_corrupt(call, at, "the step of a grid is not between 0 and 1 diagonal");
}

int reel_read_group(reel_call *call, const reel_outline *outline, const reel_track *track,
                    uint32_t number, uint64_t block, bool is_checked, reel_group *group) {
    payloads all;
    reel_range bytes = reel_group_bytes(outline, block, number);
    *group = (reel_group){0};
    int failed =
        find_payloads(call, bytes, number ? REEL_TRACK_BLOCK : REEL_BLOCK, is_checked, &all);
    failed = failed
                 ? failed
                 : read_counts(call, &all, number, track, outline->blocks[block].n_frames, group);
    if (failed) {
        return failed;
    }
    if (track->info.is_exact || track->info.coding == REEL_EXACT) {
        bool is_grid = !number && outline->method == REEL_METHOD_GRID;
        return read_values(call, is_grid, *payload(&all, REEL_VALUES), group);
    }
    failed = read_fields(call, *payload(&all, REEL_FIELDS), group);
    failed = failed ? failed : read_corrections(call, *payload(&all, REEL_CORRECTIONS), group);
    group->basis = *payload(&all, REEL_BASIS);
    group->coefficients = *payload(&all, REEL_COEFFICIENTS);
    group->missing = number ? *payload(&all, REEL_MISSING) : (reel_range){0, 0};
    bool has_all = failed || (group->basis.at && group->coefficients.at);
    return has_all ? failed : reel_corrupt(call, bytes.at, "a block has no BASIS or COEFFICIENTS");
}

int reel_read_paper_group(reel_call *call, const reel_outline *outline, uint64_t block,
                          bool is_checked, reel_group *group) {
    payloads all;
    *group = (reel_group){0};
    int failed =
        find_payloads(call, reel_group_bytes(outline, block, 0), REEL_BLOCK, is_checked, &all);
    reel_range left = *payload(&all, REEL_BLOCK);
    failed = failed ? failed : reel_read_varint(call, &left, &group->n_frames);
    return failed ? failed : reel_read_varint(call, &left, &group->n_modes);
}

/* ---- corrections ---- */

#define N_TABLES 4
#define MAX_ROWS (3 + 256)

/* The decoded rows of integers. */
typedef struct {
    int64_t n, n_all;
    uint32_t n_columns;
    const int32_t *items, *counts, *frames, *offsets; /* offsets: n_columns rows */
} coded_corrections;

static int read_correction_rows(reel_call *call, const reel_group *group, uint32_t n_columns,
                                coded_corrections *result) {
    int64_t n = (int64_t)group->n_corrected, n_all = (int64_t)group->n_corrections;
    int64_t lengths[MAX_ROWS] = {n, n, n_all};
    int32_t tables[MAX_ROWS] = {0, 1, 2}, *values;
    for (uint32_t i = 0; i < n_columns; i++) {
        lengths[3 + i] = n_all;
        tables[3 + i] = 3;
    }
    int failed = reel_decode_rows(call, group->corrections, lengths, tables, 3 + (int64_t)n_columns,
                                  N_TABLES, &values);
    *result = (coded_corrections){
        n, n_all, n_columns, values, values + n, values + 2 * n, values + 2 * n + n_all};
    return failed;
}

/* Check that items and frames exist and ascend, and that counts add up. Finds where the corrections
   of each run begin, the run of each output item, and in starts[frame + 1] the number of
   corrections of each frame. */
static bool find_runs(const coded_corrections *coded, const int32_t *inverse, int64_t n_items,
                      int64_t n_frames, int64_t *begins, int32_t *run_of, int64_t *starts) {
    int64_t next = 0, item = 0;
    for (int64_t i = 0; i < n_items; i++) {
        run_of[i] = -1;
    }
    for (int64_t i = 0; i < coded->n; i++) {
        item += coded->items[i];
        if (item < 0 || item >= n_items || (i && coded->items[i] <= 0) || coded->counts[i] < 0 ||
            coded->counts[i] >= coded->n_all - next) {
            return false;
        }
        begins[i] = next;
        run_of[inverse ? inverse[item] : item] = (int32_t)i;
        int64_t end = next + coded->counts[i] + 1, frame = 0;
        for (int64_t first = next; next < end; next++) {
            frame += coded->frames[next];
            if (frame < 0 || frame >= n_frames || (next > first && coded->frames[next] <= 0)) {
                return false;
            }
            starts[frame + 1]++;
        }
    }
    begins[coded->n] = next;
    return next == coded->n_all;
}

/* Store the corrections of a run at the next free index of their frames. */
static void store_run(const coded_corrections *coded, int64_t begin, int64_t end, int32_t item,
                      double step, int64_t *offsets, int64_t *next,
                      const reel_corrections *result) {
    int64_t frame = 0;
    uint32_t n_columns = coded->n_columns;
    for (int64_t i = begin; i < end; i++) {
        bool follows = i > begin && coded->frames[i] == 1;
        frame += coded->frames[i];
        int64_t place = next[frame]++;
        result->items[place] = item;
        for (uint32_t column = 0; column < n_columns; column++) {
            int32_t offset = coded->offsets[column * coded->n_all + i];
            offsets[column] = (follows ? offsets[column] : 0) + offset;
            result->offsets[n_columns * place + column] = (double)offsets[column] * step;
        }
    }
}

int reel_read_corrections(reel_call *call, reel_pool *pool, const reel_group *group,
                          uint32_t n_columns, uint64_t n_items, const int32_t *inverse,
                          reel_corrections *result) {
    coded_corrections coded;
    *result = (reel_corrections){NULL, NULL, NULL};
    if (!group->corrections.at) {
        return MESHREEL_OK;
    }
    const reel_chunk *mark = call->scratch.last;
    int failed = read_correction_rows(call, group, n_columns, &coded);
    uint64_t n_frames = group->n_frames;
    int64_t *starts = result->starts = reel_pool_allocate(call, pool, n_frames + 1, sizeof *starts);
    result->items = reel_pool_allocate(call, pool, group->n_corrections, sizeof *result->items);
    result->offsets =
        reel_pool_allocate(call, pool, group->n_corrections, n_columns * sizeof *result->offsets);
    int64_t *begins = reel_scratch(call, group->n_corrected + 1, sizeof *begins);
    int32_t *run_of = reel_scratch(call, n_items, sizeof *run_of);
    if (failed || !starts || !result->items || !result->offsets || !begins || !run_of) {
        return call->error.code;
    }
    reel_zero(starts, (n_frames + 1) * sizeof *starts);
    if (!find_runs(&coded, inverse, (int64_t)n_items, (int64_t)n_frames, begins, run_of, starts)) {
        return reel_corrupt(call, group->corrections.at,
                            "a correction is out of order, or its value does not exist");
    }
    for (uint64_t t = 0; t < n_frames; t++) {
        starts[t + 1] += starts[t];
    }
    for (uint64_t i = 0; i < n_items; i++) {
        /* By output item, so that items ascend in each frame. */
        if (run_of[i] >= 0) {
            int64_t offsets[256];
            store_run(&coded, begins[run_of[i]], begins[run_of[i] + 1], (int32_t)i,
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
