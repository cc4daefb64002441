/* The positions of a block as they are stored: docs/format.md, BLOCK, FIELDS, CORRECTIONS, VALUES. */

#include "group.h"

#define FIRST REEL_BLOCK
#define N_IDS (REEL_ANCHOR_RESIDUALS + 1 - FIRST)
#define MOST_LEARNED 255U
#define MOST_STEP 1e6F
#define WITH_RESTS 16 /* is added to the layout */

/* The payload of each section of a block; has none where `at` is 0. */
typedef struct {
    reel_stretch of[N_IDS];
} payloads;

static const reel_stretch *payload(const payloads *all, uint32_t id) { return &all->of[id - FIRST]; }

static int find_payloads(const reel_outline *outline, const reel_place *place, bool is_checked,
                         payloads *all) {
    uint64_t end = place->at + place->size;
    reel_zero(all, sizeof *all);
    for (uint64_t at = place->at; at < end;) {
        reel_section section;
        int failed = reel_section_at(outline->source, at, end, &section);
        if (!failed && is_checked) {
            failed = reel_section_check(outline->source, &section);
        }
        bool is_known = !failed && reel_is_known(section.id);
        if (is_known && (section.id == REEL_BLOCK) != !all->of[0].at) {
            return MESHREEL_CORRUPT;
        }
        if (is_known && section.id >= FIRST && !(section.id & REEL_OPTIONAL)) {
            reel_stretch *own = &all->of[section.id - FIRST];
            failed = own->at ? MESHREEL_CORRUPT : MESHREEL_OK;
            *own = section.payload;
        }
        if (failed) {
            return failed;
        }
        at = section.end;
    }
    return all->of[0].at ? MESHREEL_OK : MESHREEL_CORRUPT;
}

/* Integers of variable length that are left of a payload. */
static int read_integers(const meshreel_source *source, reel_stretch *left, uint64_t **found,
                         int count) {
    uint64_t end = left->at + left->length, at = left->at;
    for (int i = 0; i < count; i++) {
        int failed = reel_varint(source, &at, end, found[i]);
        if (failed) {
            return failed;
        }
    }
    *left = (reel_stretch){at, end - at};
    return MESHREEL_OK;
}

static int read_float(const meshreel_source *source, reel_stretch *left, float *found) {
    if (left->length < sizeof *found) {
        return MESHREEL_TRUNCATED;
    }
    int failed = reel_read(source, left->at, found, sizeof *found);
    *left = (reel_stretch){left->at + sizeof *found, left->length - sizeof *found};
    return failed;
}

static int read_counts(const reel_outline *outline, reel_stretch left, const reel_place *place,
                       reel_group *group) {
    uint64_t *counts[] = {&group->n_frames, &group->n_modes};
    int failed = read_integers(outline->source, &left, counts, 2);
    if (failed) {
        return failed;
    }
    bool has_modes = outline->method == REEL_METHOD_REEL;
    uint64_t least = has_modes ? 1 : 0, most = has_modes ? 3 * (uint64_t)place->n_frames : 0;
    bool is_sound = !left.length && group->n_frames == place->n_frames &&
                    group->n_modes >= least && group->n_modes <= most;
    return is_sound ? MESHREEL_OK : MESHREEL_CORRUPT;
}

static int read_reused(const meshreel_source *source, reel_stretch *left, reel_group *group) {
    uint64_t *count = &group->n_reused;
    if (!group->reference || !left->length) {
        return MESHREEL_OK;
    }
    int failed = read_integers(source, left, &count, 1);
    failed = failed ? failed : read_float(source, left, &group->finer);
    if (failed) {
        return failed;
    }
    bool is_sound = group->n_reused >= 1 && group->n_reused <= group->n_modes &&
                    group->finer > 0.0F && group->finer < MOST_STEP;
    return is_sound ? MESHREEL_OK : MESHREEL_CORRUPT;
}

/* The next run of resting times behind `end`, which becomes where it ends. */
static int read_run(const meshreel_source *source, reel_stretch *left, uint64_t n_frames,
                    uint64_t *start, uint64_t *end) {
    uint64_t gap, length, *counts[] = {&gap, &length};
    int failed = read_integers(source, left, counts, 2);
    if (failed) {
        return failed;
    }
    bool is_sound = gap && length && gap < n_frames - *end && length <= n_frames - *end - gap;
    *start = *end + gap;
    *end = *start + length;
    return is_sound ? MESHREEL_OK : MESHREEL_CORRUPT;
}

static int find_rests(const meshreel_source *source, reel_stretch *left, reel_group *group) {
    uint64_t *counts[] = {&group->rest_bits, &group->n_rests}, start, end = 0;
    int failed = read_integers(source, left, counts, 2);
    group->rests = *left;
    for (uint64_t i = 0; !failed && i < group->n_rests; i++) {
        failed = read_run(source, left, group->n_frames, &start, &end);
    }
    bool is_sound = group->n_rests >= 1 && group->rest_bits <= REEL_MAX_REST_BITS;
    return failed ? failed : is_sound ? MESHREEL_OK : MESHREEL_CORRUPT;
}

int reel_read_rests(const meshreel_source *source, const reel_group *group, uint8_t *rests) {
    reel_stretch left = group->rests;
    uint64_t start, end = 0;
    reel_zero(rests, (size_t)group->n_frames);
    for (uint64_t i = 0; i < group->n_rests; i++) {
        int failed = read_run(source, &left, group->n_frames, &start, &end);
        if (failed) {
            return failed;
        }
        for (uint64_t time = start; time < end; time++) {
            rests[time] = 1;
        }
    }
    return MESHREEL_OK;
}

static int read_layout(const meshreel_source *source, reel_stretch left, reel_group *group) {
    uint8_t layout;
    uint64_t *counts[] = {&group->stencil_size, &group->n_learned}, *reference = &group->reference;
    if (!left.at) {
        return MESHREEL_CORRUPT;
    }
    if (!left.length) {
        return MESHREEL_TRUNCATED;
    }
    int failed = reel_read(source, left.at, &layout, 1);
    group->precision = layout & ~WITH_RESTS;
    if (failed || (group->precision != REEL_SUMS_4 && group->precision != REEL_SUMS_8)) {
        return failed ? failed : MESHREEL_UNSUPPORTED;
    }
    left = (reel_stretch){left.at + 1, left.length - 1};
    failed = read_integers(source, &left, &reference, 1);
    failed = failed ? failed : read_float(source, &left, &group->step);
    failed = failed ? failed : read_integers(source, &left, counts, 2);
    if (!failed && layout & WITH_RESTS) {
        failed = find_rests(source, &left, group);
    }
    failed = failed ? failed : read_reused(source, &left, group);
    if (failed) {
        return failed;
    }
    bool is_sound = !left.length && group->stencil_size >= 1 &&
                    group->stencil_size <= REEL_MAX_STENCIL && group->n_learned <= MOST_LEARNED &&
                    group->step > 0.0F && group->step < MOST_STEP;
    return is_sound ? MESHREEL_OK : MESHREEL_CORRUPT;
}

/* Whether a payload is there, and its integers are few enough for their sizes not to overflow. */
static bool is_usable(const reel_stretch *coded, uint64_t count) {
    return coded->at && count <= REEL_MOST_NUMBERS;
}

static int read_moves(const reel_outline *outline, reel_stretch left, reel_group *group) {
    uint64_t *counts[] = {&group->n_moved, &group->n_moves}, n_verts = outline->n_verts;
    if (!left.at) {
        return MESHREEL_OK;
    }
    int failed = read_float(outline->source, &left, &group->moved_by);
    failed = failed ? failed : read_integers(outline->source, &left, counts, 2);
    if (failed) {
        return failed;
    }
    bool is_sound = group->n_moved <= n_verts && group->n_moved <= group->n_moves &&
                    group->n_moves <= group->n_frames * n_verts && group->moved_by > 0.0F &&
                    group->moved_by < MOST_STEP;
    group->moves = left;
    bool has_all = is_sound && is_usable(&left, 2 * group->n_moved + 4 * group->n_moves);
    return has_all ? MESHREEL_OK : MESHREEL_CORRUPT;
}

static int read_values(const reel_outline *outline, reel_stretch left, reel_group *group) {
    if (!left.at) {
        return MESHREEL_CORRUPT;
    }
    group->values = left;
    if (outline->method != REEL_METHOD_GRID) {
        return MESHREEL_OK;
    }
    if (left.length < sizeof group->grid) {
        return MESHREEL_TRUNCATED;
    }
    int failed = reel_read(outline->source, left.at, &group->grid, sizeof group->grid);
    group->values = (reel_stretch){left.at + sizeof group->grid, left.length - sizeof group->grid};
    bool is_sound = group->grid >= 0.0 && group->grid <= 1.0;
    return failed ? failed : is_sound ? MESHREEL_OK : MESHREEL_CORRUPT;
}

int reel_read_group(const reel_outline *outline, const reel_place *place, bool is_checked,
                    reel_group *group) {
    payloads all;
    *group = (reel_group){0};
    int failed = find_payloads(outline, place, is_checked, &all);
    failed = failed ? failed : read_counts(outline, *payload(&all, REEL_BLOCK), place, group);
    if (failed || outline->method != REEL_METHOD_REEL) {
        return failed ? failed : read_values(outline, *payload(&all, REEL_VALUES), group);
    }
    failed = read_layout(outline->source, *payload(&all, REEL_FIELDS), group);
    failed = failed ? failed : read_moves(outline, *payload(&all, REEL_CORRECTIONS), group);
    group->basis = *payload(&all, REEL_BASIS);
    group->coefficients = *payload(&all, REEL_COEFFICIENTS);
    bool has_all = is_usable(&group->basis, 3 * group->n_frames * group->n_modes) &&
                   is_usable(&group->coefficients,
                              outline->n_verts * (group->n_modes - group->n_reused));
    return failed ? failed : has_all ? MESHREEL_OK : MESHREEL_CORRUPT;
}
