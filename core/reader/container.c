/* The container of a file: docs/format.md, the header, the sections, and "Random access". */

#include "container.h"

#define FIXED_BYTES 68
#define MOST_NAME 4096
#define VERSION 3
#define END_BYTES 14
#define LAST_METHOD REEL_METHOD_GRID
#define MOST_TRACKS ((uint32_t)1 << 20)

static const uint8_t magic[8] = {0x89, 0x52, 0x45, 0x45, 0x4C, 0x0D, 0x0A, 0x1A};

static int corrupt(reel_call *call, uint64_t at, const char *message) {
    return reel_fail(call, MESHREEL_CORRUPT, at, message);
}

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

static int check_header(reel_call *call, const reel_outline *outline) {
    if (!outline->n_verts || !outline->n_faces) {
        return corrupt(call, 14, "the header announces no vertices or no faces");
    }
    if (!reel_is_finite(outline->fps) || outline->fps < 0.0) {
        return corrupt(call, 22, "the frames per second are negative or not finite");
    }
    if (outline->number_bytes != 4 && outline->number_bytes != 8) {
        return corrupt(call, 30, "the vertex type is neither 4 nor 8");
    }
    bool is_placed = reel_is_finite(outline->placement[0]) && outline->placement[0] > 0.0;
    for (int axis = 1; axis < 4; axis++) {
        is_placed &= reel_is_finite(outline->placement[axis]);
    }
    if (!is_placed) {
        return corrupt(call, 34, "the origin is not finite, or the scale is not positive and finite");
    }
    if (outline->n_verts > REEL_MOST_VERTS || outline->n_faces > REEL_MOST_VERTS) {
        return reel_fail(call, MESHREEL_UNSUPPORTED, 14, "more than 2^26 vertices or faces");
    }
    if (outline->method > LAST_METHOD || outline->laplacian > 2 ||
        outline->order > REEL_ORDER_DROPPED) {
        return reel_fail(call, MESHREEL_UNSUPPORTED, 31,
                         "a method, Laplacian or order of a newer version; update meshreel");
    }
    return MESHREEL_OK;
}

static int read_header(reel_call *call, reel_pool *pool, reel_outline *outline) {
    uint8_t fixed[FIXED_BYTES] = {0};
    uint64_t size = call->source->size;
    size_t here = size < FIXED_BYTES ? (size_t)size : FIXED_BYTES;
    int failed = reel_read(call, 0, fixed, here);
    if (failed) {
        return failed;
    }
    if (!reel_same(fixed, magic, here < sizeof magic ? here : sizeof magic)) {
        return corrupt(call, 0, "not a .reel stream");
    }
    if (here >= sizeof magic + 2 && (fixed[8] != VERSION || fixed[9] != 0)) {
        return reel_fail(call, MESHREEL_UNSUPPORTED, 8,
                         "a format of another version than 3; update meshreel");
    }
    if (here < FIXED_BYTES) {
        return reel_fail(call, MESHREEL_TRUNCATED, size, "the file ends inside its header");
    }
    size_t name = (size_t)(fixed[66] | fixed[67] << 8);
    failed = reel_check(call, 0, FIXED_BYTES + name);
    if (failed) {
        return failed;
    }
    if (name > MOST_NAME) {
        return corrupt(call, 66, "the name has more than 4096 bytes");
    }
    outline->announced = uint32_at(fixed + 10);
    outline->n_verts = uint32_at(fixed + 14);
    outline->n_faces = uint32_at(fixed + 18);
    outline->fps = double_at(fixed + 22);
    outline->number_bytes = fixed[30];
    outline->method = fixed[31];
    outline->laplacian = fixed[32];
    outline->order = fixed[33];
    for (int axis = 0; axis < 3; axis++) {
        outline->placement[1 + axis] = double_at(fixed + 34 + 8 * axis);
    }
    outline->placement[0] = double_at(fixed + 58);
    outline->header_end = FIXED_BYTES + name + 4;
    reel_stretch left = {FIXED_BYTES, name};
    failed = reel_take_text_of(call, pool, &left, name, &outline->name);
    return failed ? failed : check_header(call, outline);
}

/* ---- leading sections ---- */

/* Room for one more item of an array that grows in a pool. */
static int grow(reel_call *call, reel_pool *pool, void **items, uint64_t count, uint64_t *room,
                size_t item) {
    if (count < *room) {
        return MESHREEL_OK;
    }
    uint64_t larger = *room ? 2 * *room : 16;
    void *moved = reel_keep(call, pool, larger, item);
    if (!moved) {
        return call->error.code;
    }
    if (count) {
        reel_copy(moved, *items, (size_t)count * item);
    }
    *items = moved;
    *room = larger;
    return MESHREEL_OK;
}

static int read_double(reel_call *call, const reel_section *section, double *found) {
    reel_stretch left = section->payload;
    if (left.length != sizeof *found) {
        return corrupt(call, section->at, "the start or the promised error has not 8 bytes");
    }
    int failed = reel_take_bytes(call, &left, found, sizeof *found);
    if (!failed && !reel_is_finite(*found)) {
        return corrupt(call, section->payload.at, "the start or the promised error is not finite");
    }
    return failed;
}

static int read_polygons(reel_call *call, const reel_section *section, reel_outline *outline) {
    reel_stretch left = section->payload;
    int failed = reel_take_varint(call, &left, &outline->n_polygons);
    if (!failed && outline->n_polygons > outline->n_faces) {
        return corrupt(call, section->payload.at, "there are more polygons than triangles");
    }
    outline->n_corners = outline->n_faces + 2 * outline->n_polygons;
    return failed;
}

static int note_leading(reel_call *call, reel_pool *pool, reel_outline *outline,
                        const reel_section *section) {
    uint64_t room = outline->leading_room;
    void *items = outline->leading;
    int failed = grow(call, pool, &items, outline->n_leading, &room, sizeof *outline->leading);
    if (failed) {
        return failed;
    }
    outline->leading = items;
    outline->leading_room = (uint32_t)room;
    outline->leading[outline->n_leading++] = (reel_leading){section->id, section->payload};
    if (section->id == REEL_TRACK && ++outline->n_tracks > MOST_TRACKS) {
        return reel_fail(call, MESHREEL_UNSUPPORTED, section->at, "more than 2^20 tracks");
    }
    if (section->id == REEL_START) {
        return read_double(call, section, &outline->start_s);
    }
    if (section->id == REEL_PROMISE) {
        failed = read_double(call, section, &outline->promise);
        return failed || outline->promise > 0.0
                   ? failed
                   : corrupt(call, section->payload.at, "the promised error is not positive");
    }
    return section->id == REEL_POLYGONS ? read_polygons(call, section, outline) : MESHREEL_OK;
}

static void forget(reel_outline *outline) {
    outline->n_leading = 0;
    outline->n_tracks = 1;
    outline->start_s = outline->promise = 0.0;
    outline->n_polygons = outline->n_faces;
    outline->n_corners = 3 * outline->n_faces;
    outline->n_blocks = outline->n_frames = 0;
    outline->longest = 0;
}

static int read_leading(reel_call *call, reel_pool *pool, reel_outline *outline, uint64_t end) {
    uint64_t begin = outline->header_end;
    int failed = begin < end ? reel_announce(call, (reel_stretch){begin, end - begin}) : MESHREEL_OK;
    if (failed) {
        return failed;
    }
    for (uint64_t at = outline->header_end; at < end;) {
        reel_section section;
        failed = reel_section_at(call, at, end, &section);
        failed = failed ? failed : reel_section_check(call, &section);
        if (!failed && reel_is_known(section.id)) {
            bool is_of_block = section.id >= REEL_BLOCK && !(section.id & REEL_OPTIONAL);
            failed = is_of_block ? corrupt(call, at, "a section of a block is before the first block")
                                 : note_leading(call, pool, outline, &section);
        }
        if (failed) {
            return failed;
        }
        at = section.end;
    }
    return MESHREEL_OK;
}

/* ---- blocks ---- */

/* Adds a block, and makes room for the ends of its groups. */
static int add_block(reel_call *call, reel_pool *pool, reel_outline *outline, uint64_t at,
                     uint64_t n_frames, uint64_t **ends) {
    uint64_t most = REEL_MOST_NUMBERS / outline->n_verts;
    most = most < REEL_MOST_FRAMES ? most : REEL_MOST_FRAMES;
    if (!n_frames) {
        return corrupt(call, at, "a block has no frames");
    }
    if (n_frames > most - outline->n_frames) {
        return reel_fail(call, MESHREEL_UNSUPPORTED, at,
                         "more frames than this build reads for this number of vertices");
    }
    uint64_t room = outline->blocks_room, count = outline->n_blocks;
    void *places = outline->places, *all = outline->ends;
    int failed = grow(call, pool, &places, count, &room, sizeof *outline->places);
    room = outline->blocks_room; /* both arrays grow together */
    failed = failed ? failed
                    : grow(call, pool, &all, count, &room, outline->n_tracks * sizeof **ends);
    if (failed) {
        return failed;
    }
    outline->places = places;
    outline->ends = all;
    outline->blocks_room = room;
    outline->places[count] = (reel_place){at, (uint32_t)outline->n_frames, (uint32_t)n_frames};
    *ends = outline->ends + count * outline->n_tracks;
    outline->n_blocks++;
    outline->n_frames += n_frames;
    outline->longest = outline->longest > n_frames ? outline->longest : (uint32_t)n_frames;
    return MESHREEL_OK;
}

reel_stretch reel_group_bytes(const reel_outline *outline, uint64_t block, uint32_t track) {
    const uint64_t *ends = outline->ends + block * outline->n_tracks;
    uint64_t begin = track ? ends[track - 1] : outline->places[block].at;
    return (reel_stretch){begin, ends[track] - begin};
}

/* ---- by the index ---- */

static int find_index(reel_call *call, const reel_outline *outline, reel_section *index,
                      uint64_t *first) {
    uint64_t size = call->source->size, end_at = size < END_BYTES ? 0 : size - END_BYTES, at;
    reel_section end;
    int failed = reel_section_at(call, end_at > outline->header_end ? end_at : outline->header_end,
                                 size, &end);
    failed = failed ? failed : reel_section_check(call, &end);
    if (failed) {
        return failed;
    }
    if (end.id != REEL_END || end.payload.length != sizeof at) {
        return corrupt(call, end_at, "the end of the file does not lead to an index");
    }
    failed = reel_read(call, end.payload.at, &at, sizeof at);
    failed = failed ? failed : reel_section_at(call, at, size, index);
    failed = failed ? failed : reel_section_check(call, index);
    if (failed) {
        return failed;
    }
    if (index->id != REEL_INDEX || at < outline->header_end) {
        return corrupt(call, at, "there is no index where the end of the file says");
    }
    reel_stretch left = index->payload;
    failed = reel_take_varint(call, &left, first);
    bool is_behind = *first >= outline->header_end && *first <= at;
    return failed || is_behind ? failed : corrupt(call, at, "the index lists blocks in the header");
}

static int read_index(reel_call *call, reel_pool *pool, reel_outline *outline,
                      const reel_section *index) {
    reel_stretch left = index->payload;
    uint64_t at, n_blocks, n_frames, *ends;
    int failed = reel_take_varint(call, &left, &at);
    failed = failed ? failed : reel_take_varint(call, &left, &n_blocks);
    for (uint64_t i = 0; !failed && i < n_blocks; i++) {
        failed = reel_take_varint(call, &left, &n_frames);
        failed = failed ? failed : add_block(call, pool, outline, at, n_frames, &ends);
        for (uint32_t track = 0; !failed && track < outline->n_tracks; track++) {
            uint64_t size;
            failed = reel_take_varint(call, &left, &size);
            if (!failed && (!size || size > index->at - at)) {
                return corrupt(call, left.at, "the index lists blocks that are not in the file");
            }
            at += failed ? 0 : size;
            ends[track] = at;
        }
    }
    bool is_whole = failed || (n_blocks && !left.length && at == index->at);
    return is_whole ? failed : corrupt(call, index->at, "the index does not list all blocks");
}

/* ---- section by section ---- */

typedef struct {
    reel_call *call;
    reel_pool *pool;
    reel_outline *outline;
    uint64_t *ends; /* of the block that is open, or NULL */
    uint32_t n_groups, last;
    uint64_t index_at; /* the byte at which INDEX begins, or 0 */
} scan;

static int open_block(scan *s, const reel_section *section) {
    reel_stretch left = section->payload;
    uint64_t n_frames;
    int failed = reel_take_varint(s->call, &left, &n_frames);
    s->n_groups = 1;
    return failed ? failed
                  : add_block(s->call, s->pool, s->outline, section->at, n_frames, &s->ends);
}

static int close_block(scan *s, uint64_t end) {
    uint64_t *ends = s->ends;
    s->ends = NULL;
    ends[s->n_groups - 1] = end;
    return s->n_groups == s->outline->n_tracks
               ? MESHREEL_OK
               : corrupt(s->call, end, "a block has not as many groups as there are tracks");
}

/* The block that is open is not complete. */
static void drop_block(scan *s) {
    if (s->ends) {
        s->outline->n_frames -= s->outline->places[--s->outline->n_blocks].n_frames;
    }
}

/* The end of the file leads to its index, if there is one. It is here because what it leads to is no
   index, or contradicts the blocks: a file without an index is sound. */
static int check_end(scan *s, const reel_section *section) {
    return !s->index_at && !section->payload.length
               ? MESHREEL_OK
               : corrupt(s->call, section->at, "the index contradicts the blocks");
}

static int note_section(scan *s, const reel_section *section) {
    uint32_t id = section->id;
    s->last = id;
    s->index_at = id == REEL_INDEX ? section->at : s->index_at;
    if (id == REEL_BLOCK || id == REEL_INDEX || id == REEL_END) {
        int failed = s->ends ? close_block(s, section->at) : MESHREEL_OK;
        failed = failed || id != REEL_END ? failed : check_end(s, section);
        return failed || id != REEL_BLOCK ? failed : open_block(s, section);
    }
    if (s->ends) {
        if (id == REEL_TRACK_BLOCK) {
            if (s->n_groups == s->outline->n_tracks) {
                return corrupt(s->call, section->at, "a block has more groups than there are tracks");
            }
            s->ends[s->n_groups++ - 1] = section->at;
        }
        return MESHREEL_OK;
    }
    bool is_of_block = id >= REEL_BLOCK && !(id & REEL_OPTIONAL);
    if (is_of_block) {
        return corrupt(s->call, section->at, "a section of a block is outside of blocks");
    }
    return s->outline->n_blocks ? corrupt(s->call, section->at, "a section is behind the blocks")
                                : note_leading(s->call, s->pool, s->outline, section);
}

/* Up to END, or up to what is damaged: then `is_whole` is false. */
static int read_sections(reel_call *call, reel_pool *pool, reel_outline *outline) {
    scan s = {.call = call, .pool = pool, .outline = outline, .last = REEL_OPTIONAL};
    uint64_t at = outline->header_end;
    int failed = MESHREEL_OK;
    while (!failed && s.last != REEL_END) {
        reel_section section;
        failed = reel_section_at(call, at, call->source->size, &section);
        failed = failed ? failed : reel_section_check(call, &section);
        if (!failed && reel_is_known(section.id)) {
            failed = note_section(&s, &section);
        }
        at = failed ? at : section.end;
    }
    if (failed && failed != MESHREEL_TRUNCATED && failed != MESHREEL_CORRUPT) {
        return failed;
    }
    outline->is_whole = !failed;
    outline->damage = failed ? call->error : (meshreel_error){0};
    outline->end = at;
    bool is_complete = s.ends && s.n_groups == outline->n_tracks &&
                       (s.last == REEL_COEFFICIENTS || s.last == REEL_VALUES);
    if (is_complete) {
        close_block(&s, at);
    } else if (s.ends) {
        outline->end = outline->places[outline->n_blocks - 1].at;
        drop_block(&s);
    }
    return outline->n_blocks ? MESHREEL_OK : failed;
}

/* ---- the whole ---- */

static int check_frames(reel_call *call, const reel_outline *outline) {
    if (!outline->n_blocks) {
        return corrupt(call, outline->header_end, "the file holds no block of frames");
    }
    bool is_other = outline->announced && outline->announced != outline->n_frames;
    return outline->is_whole && is_other
               ? corrupt(call, 10, "the blocks do not hold as many frames as the header announces")
               : MESHREEL_OK;
}

static int read_indexed(reel_call *call, reel_pool *pool, reel_outline *outline) {
    reel_section index;
    uint64_t first;
    int failed = find_index(call, outline, &index, &first);
    failed = failed ? failed : read_leading(call, pool, outline, first);
    failed = failed ? failed : read_index(call, pool, outline, &index);
    outline->is_whole = true;
    outline->end = call->source->size;
    return failed ? failed : check_frames(call, outline);
}

int reel_read_outline(reel_call *call, reel_pool *pool, reel_outline *outline) {
    *outline = (reel_outline){0};
    if (call->source->size > REEL_MOST_BYTES) {
        return reel_fail(call, MESHREEL_UNSUPPORTED, 0, "more than 2^40 bytes");
    }
    int failed = read_header(call, pool, outline);
    if (failed) {
        return failed;
    }
    forget(outline);
    failed = read_indexed(call, pool, outline);
    if (failed != MESHREEL_TRUNCATED && failed != MESHREEL_CORRUPT) {
        return failed;
    }
    forget(outline);
    outline->blocks_room = 0; /* the ends of groups are as many as tracks, which may be others now */
    failed = read_sections(call, pool, outline);
    return failed ? failed : check_frames(call, outline);
}

int reel_only_section(reel_call *call, const reel_outline *outline, uint32_t id,
                      reel_stretch *payload) {
    uint32_t count = 0;
    for (uint32_t i = 0; i < outline->n_leading; i++) {
        if (outline->leading[i].id == id) {
            *payload = outline->leading[i].payload;
            count++;
        }
    }
    return count == 1 ? MESHREEL_OK
                      : corrupt(call, outline->header_end,
                                id == REEL_CONNECTIVITY
                                    ? "there is not exactly one section CONNECTIVITY"
                                    : "there is not exactly one section ORDER");
}
