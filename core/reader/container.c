/* The parts of a stream: docs/format.md, the header, the sections, and "Random access". */

#include "container.h"

#define FIXED_BYTES 68
#define MOST_NAME 4096
#define VERSION 3
#define END_BYTES 14
#define LAST_METHOD REEL_METHOD_GRID
#define LARGEST 0x1.fffffffffffffp1023

static const uint8_t magic[8] = {0x89, 0x52, 0x45, 0x45, 0x4C, 0x0D, 0x0A, 0x1A};

static bool is_finite(double number) { return number >= -LARGEST && number <= LARGEST; }

/* ---- the header ---- */

static uint32_t uint32_at(const uint8_t *bytes) {
    uint32_t found;
    reel_copy(&found, bytes, sizeof found);
    return found;
}

static double double_at(const uint8_t *bytes) {
    double found;
    reel_copy(&found, bytes, sizeof found);
    return found;
}

static int check_numbers(const reel_outline *outline, uint32_t laplacian) {
    bool is_sound = outline->n_verts && outline->n_faces &&
                    (outline->number_bytes == 4 || outline->number_bytes == 8) &&
                    is_finite(outline->fps) && outline->fps >= 0.0 &&
                    is_finite(outline->placement[0]) && outline->placement[0] > 0.0;
    for (int axis = 1; axis < 4; axis++) {
        is_sound &= is_finite(outline->placement[axis]);
    }
    if (!is_sound) {
        return MESHREEL_CORRUPT;
    }
    if (outline->n_verts > REEL_MOST_VERTS || outline->n_faces > REEL_MOST_VERTS ||
        outline->method > LAST_METHOD || laplacian > 2 || outline->order > REEL_ORDER_DROPPED) {
        return MESHREEL_UNSUPPORTED;
    }
    return outline->method < REEL_METHOD_REEL ? MESHREEL_METHOD : MESHREEL_OK;
}

static int read_header(reel_outline *outline) {
    const meshreel_source *source = outline->source;
    uint8_t fixed[FIXED_BYTES];
    size_t here = source->size < FIXED_BYTES ? (size_t)source->size : FIXED_BYTES;
    int failed = reel_read(source, 0, fixed, here);
    if (failed) {
        return failed;
    }
    if (!reel_same(fixed, magic, here < sizeof magic ? here : sizeof magic)) {
        return MESHREEL_CORRUPT;
    }
    if (here < sizeof magic + 2) {
        return MESHREEL_TRUNCATED;
    }
    if (fixed[8] != VERSION || fixed[9] != 0) {
        return MESHREEL_UNSUPPORTED;
    }
    if (here < FIXED_BYTES) {
        return MESHREEL_TRUNCATED;
    }
    uint64_t name = fixed[66] | (uint64_t)fixed[67] << 8;
    failed = reel_check(source, 0, FIXED_BYTES + name);
    if (failed || name > MOST_NAME) {
        return failed ? failed : MESHREEL_CORRUPT;
    }
    outline->announced = uint32_at(fixed + 10);
    outline->n_verts = uint32_at(fixed + 14);
    outline->n_faces = uint32_at(fixed + 18);
    outline->fps = double_at(fixed + 22);
    outline->number_bytes = fixed[30];
    outline->method = fixed[31];
    outline->order = fixed[33];
    for (int axis = 0; axis < 3; axis++) {
        outline->placement[1 + axis] = double_at(fixed + 34 + 8 * axis);
    }
    outline->placement[0] = double_at(fixed + 58);
    outline->leading = FIXED_BYTES + name + 4;
    return check_numbers(outline, fixed[32]);
}

/* ---- sections before the first block ---- */

static int read_double(const reel_outline *outline, const reel_section *section, double *found) {
    if (section->payload.length != sizeof *found) {
        return MESHREEL_CORRUPT;
    }
    int failed = reel_read(outline->source, section->payload.at, found, sizeof *found);
    return failed ? failed : is_finite(*found) ? MESHREEL_OK : MESHREEL_CORRUPT;
}

static int note_leading(reel_outline *outline, const reel_section *section) {
    if (section->id == REEL_CONNECTIVITY) {
        outline->connectivity = section->payload;
        outline->n_connectivity++;
    } else if (section->id == REEL_ORDER) {
        outline->vertex_order = section->payload;
        outline->n_order++;
    } else if (section->id == REEL_TRACK) {
        outline->n_tracks++;
    } else if (section->id == REEL_START) {
        return read_double(outline, section, &outline->start_s);
    } else if (section->id == REEL_PROMISE) {
        int failed = read_double(outline, section, &outline->promise);
        return failed ? failed : outline->promise > 0.0 ? MESHREEL_OK : MESHREEL_CORRUPT;
    }
    return MESHREEL_OK;
}

static void forget_leading(reel_outline *outline) {
    outline->n_connectivity = outline->n_order = 0;
    outline->n_tracks = 1;
    outline->start_s = outline->promise = 0.0;
}

static int read_leading(reel_outline *outline, uint64_t end) {
    for (uint64_t at = outline->leading; at < end;) {
        reel_section section;
        int failed = reel_section_at(outline->source, at, end, &section);
        failed = failed ? failed : reel_section_check(outline->source, &section);
        failed = failed ? failed : note_leading(outline, &section);
        if (failed) {
            return failed;
        }
        at = section.end;
    }
    return MESHREEL_OK;
}

/* ---- blocks, by the index ---- */

static int add_block(reel_outline *outline, uint64_t at, uint64_t size, uint64_t n_frames,
                     reel_visit visit, void *own) {
    if (!n_frames || !size || n_frames > outline->most_frames - outline->n_frames) {
        return MESHREEL_CORRUPT;
    }
    reel_place place = {at, size, (uint32_t)outline->n_frames, (uint32_t)n_frames};
    int failed = visit(own, outline, &place);
    outline->n_frames += n_frames;
    outline->n_blocks++;
    return failed;
}

static int find_index(reel_outline *outline, uint64_t *first) {
    const meshreel_source *source = outline->source;
    uint64_t size = source->size, end_at = size < END_BYTES ? 0 : size - END_BYTES;
    reel_section end, index;
    int failed = reel_section_at(source, end_at > outline->leading ? end_at : outline->leading,
                                 size, &end);
    failed = failed ? failed : reel_section_check(source, &end);
    if (failed || end.id != REEL_END || end.payload.length != sizeof outline->index_at) {
        return failed ? failed : MESHREEL_CORRUPT;
    }
    failed = reel_read(source, end.payload.at, &outline->index_at, sizeof outline->index_at);
    failed = failed ? failed : reel_section_at(source, outline->index_at, size, &index);
    failed = failed ? failed : reel_section_check(source, &index);
    if (failed || index.id != REEL_INDEX || outline->index_at < outline->leading) {
        return failed ? failed : MESHREEL_CORRUPT;
    }
    outline->index = index.payload;
    uint64_t at = index.payload.at;
    failed = reel_varint(source, &at, index.payload.at + index.payload.length, first);
    bool is_behind = *first >= outline->leading && *first <= outline->index_at;
    return failed ? failed : is_behind ? MESHREEL_OK : MESHREEL_CORRUPT;
}

/* The sizes of the groups of a block; the positions are the first. */
static int read_sizes(const reel_outline *outline, uint64_t *at, uint64_t end, uint64_t position,
                      uint64_t *own, uint64_t *all) {
    *all = 0;
    for (uint32_t track = 0; track < outline->n_tracks; track++) {
        uint64_t size;
        int failed = reel_varint(outline->source, at, end, &size);
        if (failed || !size || size > outline->index_at - position - *all) {
            return failed ? failed : MESHREEL_CORRUPT;
        }
        *own = track ? *own : size;
        *all += size;
    }
    return MESHREEL_OK;
}

static int walk_index(reel_outline *outline, reel_visit visit, void *own) {
    const meshreel_source *source = outline->source;
    uint64_t at = outline->index.at, end = at + outline->index.length, position, n_blocks;
    int failed = reel_varint(source, &at, end, &position);
    failed = failed ? failed : reel_varint(source, &at, end, &n_blocks);
    outline->n_blocks = outline->n_frames = 0;
    if (failed || position > outline->index_at) {
        return failed ? failed : MESHREEL_CORRUPT;
    }
    for (uint64_t i = 0; i < n_blocks && !failed; i++) {
        uint64_t n_frames, size = 0, all;
        failed = reel_varint(source, &at, end, &n_frames);
        failed = failed ? failed : read_sizes(outline, &at, end, position, &size, &all);
        failed = failed ? failed : add_block(outline, position, size, n_frames, visit, own);
        position += failed ? 0 : all;
    }
    bool is_whole = n_blocks && at == end && position == outline->index_at;
    return failed ? failed : is_whole ? MESHREEL_OK : MESHREEL_CORRUPT;
}

/* ---- blocks, section by section ---- */

typedef struct {
    reel_outline *outline;
    reel_visit visit;
    void *own;
    bool is_open; /* is a block? */
    uint64_t begin, behind, n_frames;
    uint32_t n_groups, last;
} scan;

static int close_block(scan *s, uint64_t end) {
    s->is_open = false;
    if (s->n_groups != s->outline->n_tracks) {
        return MESHREEL_CORRUPT;
    }
    uint64_t behind = s->n_groups > 1 ? s->behind : end;
    return add_block(s->outline, s->begin, behind - s->begin, s->n_frames, s->visit, s->own);
}

static int open_block(scan *s, const reel_section *section) {
    uint64_t at = section->payload.at, end = at + section->payload.length;
    int failed = reel_varint(s->outline->source, &at, end, &s->n_frames);
    if (failed || !s->n_frames) {
        return failed ? failed : MESHREEL_CORRUPT;
    }
    s->is_open = true;
    s->begin = section->at;
    s->n_groups = 1;
    return MESHREEL_OK;
}

static int note_section(scan *s, const reel_section *section) {
    uint32_t id = section->id;
    s->last = id;
    if (id == REEL_BLOCK || id == REEL_INDEX || id == REEL_END) {
        int failed = s->is_open ? close_block(s, section->at) : MESHREEL_OK;
        return failed || id != REEL_BLOCK ? failed : open_block(s, section);
    }
    if (!s->is_open) {
        bool is_of_block = id >= REEL_BLOCK && !(id & REEL_OPTIONAL);
        return is_of_block ? MESHREEL_CORRUPT : note_leading(s->outline, section);
    }
    if (id == REEL_TRACK_BLOCK && s->n_groups++ == 1) {
        s->behind = section->at;
    }
    return MESHREEL_OK;
}

/* Up to the end marker, or up to what is damaged: then `is_whole` is false. */
static int walk_sections(reel_outline *outline, reel_visit visit, void *own) {
    scan s = {.outline = outline, .visit = visit, .own = own, .last = REEL_OPTIONAL};
    uint64_t at = outline->leading;
    int failed = MESHREEL_OK;
    outline->n_blocks = outline->n_frames = 0;
    outline->is_whole = true;
    while (s.last != REEL_END) {
        reel_section section;
        failed = reel_section_at(outline->source, at, outline->source->size, &section);
        failed = failed ? failed : reel_section_check(outline->source, &section);
        if (!failed && reel_is_known(section.id)) {
            failed = note_section(&s, &section);
        }
        if (failed) {
            break;
        }
        at = section.end;
    }
    if (failed != MESHREEL_OK && failed != MESHREEL_TRUNCATED && failed != MESHREEL_CORRUPT) {
        return failed;
    }
    outline->is_whole = failed == MESHREEL_OK;
    bool is_complete = s.is_open && s.n_groups == outline->n_tracks &&
                       (s.last == REEL_COEFFICIENTS || s.last == REEL_VALUES);
    if (failed && is_complete) {
        return close_block(&s, at);
    }
    return outline->n_blocks ? MESHREEL_OK : failed;
}

/* ---- the whole ---- */

static int check_frames(const reel_outline *outline) {
    bool is_other = outline->announced && outline->announced != outline->n_frames;
    return !outline->n_blocks || (outline->is_whole && is_other) ? MESHREEL_CORRUPT : MESHREEL_OK;
}

int reel_walk_blocks(reel_outline *outline, reel_visit visit, void *own) {
    if (outline->has_index) {
        return walk_index(outline, visit, own);
    }
    forget_leading(outline);
    return walk_sections(outline, visit, own);
}

int reel_find_parts(const meshreel_source *source, reel_outline *outline, reel_visit visit,
                    void (*restart)(void *own), void *own) {
    *outline = (reel_outline){.source = source, .is_whole = true, .has_index = true};
    forget_leading(outline);
    if (source->size > REEL_MOST_BYTES) {
        return MESHREEL_UNSUPPORTED;
    }
    uint64_t first;
    int failed = read_header(outline);
    if (failed) {
        return failed;
    }
    uint64_t most = REEL_MOST_NUMBERS / outline->n_verts;
    outline->most_frames = most < REEL_MOST_FRAMES ? most : REEL_MOST_FRAMES;
    failed = find_index(outline, &first);
    failed = failed ? failed : read_leading(outline, first);
    failed = failed ? failed : walk_index(outline, visit, own);
    failed = failed ? failed : check_frames(outline);
    if (failed == MESHREEL_TRUNCATED || failed == MESHREEL_CORRUPT) {
        restart(own);
        outline->has_index = false;
        failed = reel_walk_blocks(outline, visit, own);
    }
    return failed ? failed : check_frames(outline);
}
