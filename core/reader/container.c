/* The container of a file: docs/format.md, the header, the sections, "Segments" and "Random
   access". */

#include "container.h"

#define EXPERIMENTAL 128 /* and later versions: never released */
#define HEAD_BYTES 9 /* magic and version */
#define N_PLACEMENT 4
#define MAX_NAME_BYTES 4096
#define VERSION 3
#define END_BYTES 14
#define MAX_COMPACT 1024
#define MAX_RATE ((uint64_t)1 << 32)
#define LAST_METHOD REEL_METHOD_GRID
#define MAX_TRACKS ((uint32_t)1 << 20)
#define MAX_SHARED 255
#define MAX_RANGES 2
#define MAX_CELLS ((uint64_t)1 << 26)
#define MAX_CELL_NODES ((uint64_t)1 << 28)

static const uint8_t magic[8] = {0x89, 0x52, 0x45, 0x45, 0x4C, 0x0D, 0x0A, 0x1A};

/* ---- the header ---- */

/* The form of the numbers of a mesh. */
enum {
    IS_DOUBLE = 1,
    ORDER_SHIFT = 1,
    LAPLACIAN_SHIFT = 3,
    IS_PLACED_BY_DOUBLES = 32,
    IS_COMPACT = 64,
    FORM_END = 128
};

static int check_counts(reel_call *call, uint64_t n_verts, uint64_t n_faces, uint64_t offset) {
    REEL_CORRUPT_IF(!n_verts || !n_faces, offset, "the mesh has 0 vertices or 0 faces");
    return n_verts > REEL_MAX_VERTS || n_faces > REEL_MAX_VERTS
               ? reel_fail(call, MESHREEL_UNSUPPORTED, offset, "more than 2^26 vertices or faces")
               : MESHREEL_OK;
}

static int read_counts(reel_call *call, reel_range *input, reel_outline *outline) {
    uint64_t offset = input->offset;
    REEL_TRY(reel_read_varint(call, input, &outline->n_verts));
    REEL_TRY(reel_read_varint(call, input, &outline->n_faces));
    return check_counts(call, outline->n_verts, outline->n_faces, offset);
}

/* Read the method, and the form of the numbers. */
static int read_codes(reel_call *call, reel_range *input, reel_outline *outline, uint8_t *form) {
    uint64_t offset = input->offset;
    uint8_t codes[2];
    REEL_TRY(reel_read_bytes(call, input, codes, sizeof codes));
    *form = codes[1];
    outline->method = codes[0];
    outline->number_bytes = *form & IS_DOUBLE ? 8 : 4;
    outline->order = *form >> ORDER_SHIFT & 3U;
    outline->laplacian = *form >> LAPLACIAN_SHIFT & 3U;
    bool is_newer = outline->method > LAST_METHOD || outline->laplacian > 2 ||
                    outline->order > REEL_ORDER_DROPPED || *form >= FORM_END;
    return is_newer
               ? reel_fail(call, MESHREEL_UNSUPPORTED, offset,
                           "the method, Laplacian or order needs a newer version; update meshreel")
               : MESHREEL_OK;
}

/* Read origin and scale, in floats or doubles. */
static int read_placement(reel_call *call, reel_range *input, reel_outline *outline, uint8_t form) {
    double doubles[N_PLACEMENT];
    float floats[N_PLACEMENT];
    uint64_t offset = input->offset;
    bool has_doubles = form & IS_PLACED_BY_DOUBLES, is_placed = true;
    REEL_TRY(has_doubles ? reel_read_bytes(call, input, doubles, sizeof doubles)
                         : reel_read_bytes(call, input, floats, sizeof floats));
    for (int i = 0; i < N_PLACEMENT; i++) { /* the scale is stored last, but kept first */
        double number = has_doubles ? doubles[i] : (double)floats[i];
        outline->placement[(i + 1) % N_PLACEMENT] = number;
        is_placed &= reel_is_finite(number);
    }
    return is_placed && outline->placement[0] > 0.0
               ? MESHREEL_OK
               : reel_corrupt(call, offset,
                              "the origin is not finite, or the scale is not positive and finite");
}

/* Read the frames per second: an integer plus 1, or 0 and a double. */
static int read_rate(reel_call *call, reel_range *input, double *fps) {
    uint64_t offset = input->offset, rate;
    REEL_TRY(reel_read_varint(call, input, &rate));
    *fps = (double)rate - 1.0;
    REEL_TRY(rate ? MESHREEL_OK : reel_read_bytes(call, input, fps, sizeof *fps));
    return rate <= MAX_RATE && reel_is_finite(*fps) && *fps >= 0.0
               ? MESHREEL_OK
               : reel_corrupt(call, offset,
                              "the frames per second are negative, not finite or above 2^32");
}

/* Verify the checksum of a compact stream, whose first section is at byte `offset`. */
static int check_compact(reel_call *call, uint64_t offset) {
    uint64_t size = call->source->size;
    reel_section section;
    REEL_CORRUPT_IF(size > MAX_COMPACT, 0, "a compact stream has more than 1024 bytes");
    do {
        REEL_TRY(reel_section_at(call, offset, size, &section));
        offset = section.end;
    } while (section.id != REEL_END);
    return reel_check_crc(call, 0, offset - 4);
}

/* Read the header from its counts on, from `input`, which then begins after it. */
static int read_fields(reel_call *call, reel_pool *pool, reel_range *input, reel_outline *outline) {
    uint8_t form;
    uint64_t name;
    REEL_TRY(reel_read_varint(call, input, &outline->header_frames));
    REEL_TRY(read_counts(call, input, outline));
    REEL_TRY(read_rate(call, input, &outline->fps));
    REEL_TRY(read_codes(call, input, outline, &form));
    REEL_TRY(read_placement(call, input, outline, form));
    uint64_t offset = input->offset;
    REEL_TRY(reel_read_varint(call, input, &name));
    REEL_CORRUPT_IF(name > MAX_NAME_BYTES, offset, "the name has more than 4096 bytes");
    REEL_TRY(reel_read_text_bytes(call, pool, input, name, &outline->name));
    outline->is_compact = call->is_compact = form & IS_COMPACT;
    outline->begin = input->offset + (call->is_compact ? 0 : 4);
    return call->is_compact ? MESHREEL_OK : reel_check_crc(call, 0, input->offset);
}

static int read_header(reel_call *call, reel_pool *pool, reel_outline *outline) {
    uint8_t head[HEAD_BYTES] = {0};
    uint64_t size = call->source->size;
    size_t n_head = size < HEAD_BYTES ? (size_t)size : HEAD_BYTES;
    REEL_TRY(reel_read(call, 0, head, n_head));
    REEL_CORRUPT_IF(!reel_equal_bytes(head, magic, n_head < sizeof magic ? n_head : sizeof magic),
                    0, "not a .reel stream");
    if (n_head == HEAD_BYTES && head[8] != VERSION) {
        return reel_fail(
            call, MESHREEL_UNSUPPORTED, 8,
            head[8] >= EXPERIMENTAL
                ? "the format is experimental; decode it with the build that wrote it"
            : head[8] && head[8] < VERSION
                ? "the format is older than the first release; encode the original again"
                : "the format version is not 3; update meshreel");
    }
    reel_range input = {n_head, size - n_head};
    int failed = read_fields(call, pool, &input, outline);
    if (failed == MESHREEL_TRUNCATED) {
        return reel_fail(call, MESHREEL_TRUNCATED, size, "the file ends inside its header");
    }
    outline->is_first = true;
    return failed || !call->is_compact ? failed : check_compact(call, outline->begin);
}

/* ---- leading sections ---- */

/* Make space for one more item of an array that grows in a pool. */
static int grow(reel_call *call, reel_pool *pool, void **items, uint64_t count, uint64_t *capacity,
                size_t item) {
    if (count < *capacity) {
        return MESHREEL_OK;
    }
    uint64_t new_capacity = *capacity ? 2 * *capacity : 16;
    void *moved = reel_pool_allocate(call, pool, new_capacity, item);
    REEL_NEED(moved);
    if (count) {
        reel_copy(moved, *items, (size_t)count * item);
    }
    *items = moved;
    *capacity = new_capacity;
    return MESHREEL_OK;
}

/* Read a number of the stream: a double, or a decimal. */
static int read_number(reel_call *call, const reel_section *section, double *result) {
    reel_range input = section->payload;
    if (input.length == sizeof *result) {
        REEL_TRY(reel_read_bytes(call, &input, result, sizeof *result));
    } else if (input.length) {
        uint8_t n_decimals;
        uint64_t digits;
        double power = 1.0;
        REEL_TRY(reel_read_bytes(call, &input, &n_decimals, 1));
        REEL_TRY(reel_read_varint(call, &input, &digits));
        for (; n_decimals; n_decimals--) {
            power *= 10.0;
        }
        *result = (double)digits / power;
    }
    bool is_number = section->payload.length && !input.length && reel_is_finite(*result);
    REEL_CORRUPT_IF(!is_number, section->payload.offset,
                    "the start or the error bound is not a finite number");
    return MESHREEL_OK;
}

static int read_polygons(reel_call *call, const reel_section *section, reel_outline *outline) {
    reel_range input = section->payload;
    REEL_TRY(reel_read_varint(call, &input, &outline->n_polygons));
    REEL_CORRUPT_IF(outline->n_polygons > outline->n_faces, section->payload.offset,
                    "there are more polygons than triangles");
    outline->n_corners = outline->n_faces + 2 * outline->n_polygons;
    return MESHREEL_OK;
}

static int read_cell_counts(reel_call *call, const reel_section *section, reel_outline *outline) {
    reel_range input = section->payload;
    REEL_TRY(reel_read_varint(call, &input, &outline->n_cells));
    REEL_TRY(reel_read_varint(call, &input, &outline->n_cell_nodes));
    REEL_TRY(reel_read_varint(call, &input, &outline->n_polygons));
    REEL_UNSUPPORTED_IF(outline->n_cells > MAX_CELLS || outline->n_cell_nodes > MAX_CELL_NODES,
                        section->payload.offset, "more than 2^26 cells, or 2^28 nodes of cells");
    REEL_CORRUPT_IF(!outline->n_cells || outline->n_cell_nodes < outline->n_cells ||
                        outline->n_polygons > outline->n_faces,
                    section->payload.offset, "the numbers of cells, nodes and faces do not match");
    outline->coded_cells = input;
    outline->n_corners = outline->n_faces + 2 * outline->n_polygons;
    return MESHREEL_OK;
}

/* Read the vertex and face counts of the mesh that EDIT changes. */
static int read_base(reel_call *call, const reel_section *section, reel_outline *outline) {
    reel_range input = outline->edit = section->payload;
    REEL_TRY(reel_read_varint(call, &input, &outline->coded_verts));
    REEL_TRY(reel_read_varint(call, &input, &outline->coded_faces));
    return check_counts(call, outline->coded_verts, outline->coded_faces, section->payload.offset);
}

/* Check that a section precedes the blocks, and that it may occur once more. */
static int check_leading(reel_call *call, reel_outline *outline, const reel_section *section) {
    uint32_t id = section->id;
    bool is_optional = id & REEL_OPTIONAL;
    REEL_CORRUPT_IF(is_optional ? id == REEL_INDEX : id < REEL_CONNECTIVITY || id >= REEL_BLOCK,
                    section->offset, "a section of a block is outside of blocks");
    REEL_CORRUPT_IF(id == REEL_SEGMENT, section->offset, "a segment is out of place");
    REEL_CORRUPT_IF(id == REEL_REFERENCE, section->offset,
                    "a reference does not follow the section SEGMENT");
    bool may_repeat = id == REEL_ATTRIBUTE || id == REEL_ATTRIBUTE_FROM_POINTS ||
                      id == REEL_GROUPS || id == REEL_MATERIAL || id == REEL_IMAGE ||
                      id == REEL_TRACK;
    uint32_t bit = 1U << (is_optional ? 16 + (id & 15U) : id);
    REEL_CORRUPT_IF(!may_repeat && outline->stored_ids & bit, section->offset,
                    "a section is stored twice that occurs at most once");
    outline->stored_ids |= bit;
    return MESHREEL_OK;
}

static int add_times(reel_call *call, reel_outline *outline, const reel_section *section) {
    REEL_CORRUPT_IF(outline->times.length, section->offset, "times are stored twice");
    REEL_CORRUPT_IF(!section->payload.length, section->offset, "there are fewer times than frames");
    outline->times = section->payload;
    return MESHREEL_OK;
}

static int add_leading(reel_call *call, reel_pool *pool, reel_outline *outline,
                       const reel_section *section) {
    REEL_TRY(check_leading(call, outline, section));
    uint64_t capacity = outline->leading_capacity;
    void *items = outline->leading;
    REEL_TRY(grow(call, pool, &items, outline->n_leading, &capacity, sizeof *outline->leading));
    outline->leading = items;
    outline->leading_capacity = (uint32_t)capacity;
    outline->leading[outline->n_leading++] = *section;
    outline->n_tracks += section->id == REEL_TRACK;
    REEL_UNSUPPORTED_IF(outline->n_tracks > MAX_TRACKS, section->offset, "more than 2^20 tracks");
    if (section->id == REEL_EDIT) {
        return read_base(call, section, outline);
    }
    if (section->id == REEL_CELLS) {
        return read_cell_counts(call, section, outline);
    }
    bool is_of_file = section->id == REEL_START || section->id == REEL_TIMES;
    REEL_CORRUPT_IF(is_of_file && !outline->is_first, section->offset,
                    "a start or times are stored behind the first segment");
    if (section->id == REEL_TIMES) {
        return add_times(call, outline, section);
    }
    if (section->id == REEL_START) {
        return read_number(call, section, &outline->start_s);
    }
    if (section->id == REEL_ERROR_BOUND) {
        REEL_TRY(read_number(call, section, &outline->error_bound_percent));
        return outline->error_bound_percent > 0.0
                   ? MESHREEL_OK
                   : reel_corrupt(call, section->payload.offset, "the error bound is not positive");
    }
    return section->id == REEL_POLYGONS ? read_polygons(call, section, outline) : MESHREEL_OK;
}

/* Reset the fields that sections set. */
static void reset_outline(reel_outline *outline) {
    outline->n_leading = outline->leading_capacity = outline->stored_ids = 0;
    outline->n_tracks = 1;
    outline->start_s = outline->error_bound_percent = 0.0;
    outline->coded_verts = outline->n_verts;
    outline->coded_faces = outline->n_faces;
    outline->edit = outline->times = outline->coded_cells = (reel_range){0, 0};
    outline->n_cells = outline->n_cell_nodes = 0;
    outline->n_polygons = outline->n_faces;
    outline->n_corners = 3 * outline->n_faces;
    outline->n_blocks = outline->n_frames = 0;
    outline->blocks_capacity = 0; /* `ends` must be reallocated: the number of tracks may differ */
    outline->max_block_frames = 0;
}

/* A web page shows a model before its images have arrived: their bytes are read on demand, and
   `page_check_image` verifies them. */
#ifdef __wasm__
#define DEFERS_IMAGES true
#else
#define DEFERS_IMAGES false
#endif

static int announce_leading(reel_call *call, reel_range range) {
    return DEFERS_IMAGES || !range.length ? MESHREEL_OK : reel_announce(call, range);
}

static int verify_leading(reel_call *call, const reel_section *section) {
    if (DEFERS_IMAGES) {
        if (section->id == REEL_IMAGE) {
            return MESHREEL_OK;
        }
        REEL_TRY(
            reel_announce(call, (reel_range){section->offset, section->end - section->offset}));
    }
    return reel_section_check(call, section);
}

static int read_leading(reel_call *call, reel_pool *pool, reel_outline *outline, uint64_t begin,
                        uint64_t end) {
    REEL_TRY(announce_leading(call, (reel_range){begin, begin < end ? end - begin : 0}));
    for (uint64_t offset = begin; offset < end;) {
        reel_section section;
        REEL_TRY(reel_section_at(call, offset, end, &section));
        REEL_TRY(verify_leading(call, &section));
        if (reel_is_known(section.id)) {
            REEL_TRY(add_leading(call, pool, outline, &section));
        }
        offset = section.end;
    }
    return MESHREEL_OK;
}

/* ---- blocks ---- */

/* Check that n_frames may follow n_before frames of a segment. */
static int check_block(reel_call *call, uint64_t offset, uint64_t n_verts, uint64_t n_before,
                       uint64_t n_frames) {
    uint64_t max_frames = REEL_MAX_NUMBERS / n_verts;
    max_frames = max_frames < REEL_MAX_FRAMES ? max_frames : REEL_MAX_FRAMES;
    REEL_CORRUPT_IF(!n_frames, offset, "a block has no frames");
    return n_frames > max_frames - n_before
               ? reel_fail(call, MESHREEL_UNSUPPORTED, offset,
                           "more frames than this build reads for this number of vertices")
               : MESHREEL_OK;
}

/* Add a block; `ends` receives its row of track ends, to be filled in. */
static int add_block(reel_call *call, reel_pool *pool, reel_outline *outline, uint64_t offset,
                     uint64_t n_frames, uint64_t **ends) {
    REEL_TRY(check_block(call, offset, outline->n_verts, outline->n_frames, n_frames));
    uint64_t capacity = outline->blocks_capacity, count = outline->n_blocks;
    void *blocks = outline->blocks, *track_ends = outline->ends;
    REEL_TRY(grow(call, pool, &blocks, count, &capacity, sizeof *outline->blocks));
    capacity = outline->blocks_capacity; /* both arrays grow together */
    REEL_TRY(grow(call, pool, &track_ends, count, &capacity, outline->n_tracks * sizeof **ends));
    outline->blocks = blocks;
    outline->ends = track_ends;
    outline->blocks_capacity = capacity;
    outline->blocks[count] =
        (reel_block_entry){offset, (uint32_t)outline->n_frames, (uint32_t)n_frames};
    *ends = outline->ends + count * outline->n_tracks;
    outline->n_blocks++;
    outline->n_frames += n_frames;
    outline->max_block_frames =
        outline->max_block_frames > n_frames ? outline->max_block_frames : (uint32_t)n_frames;
    return MESHREEL_OK;
}

uint32_t reel_count_items(const reel_outline *outline, uint32_t domain) {
    return (uint32_t)(domain == MESHREEL_VERTICES  ? outline->n_verts
                      : domain == MESHREEL_FACES   ? outline->n_polygons
                      : domain == MESHREEL_CORNERS ? outline->n_corners
                                                   : outline->n_cells);
}

reel_range reel_group_bytes(const reel_outline *outline, uint64_t block, uint32_t track) {
    const uint64_t *ends = outline->ends + block * outline->n_tracks;
    uint64_t begin = track ? ends[track - 1] : outline->blocks[block].offset;
    return (reel_range){begin, ends[track] - begin};
}

/* ---- by the index ---- */

static int find_index(reel_call *call, const reel_outline *outline, reel_section *index,
                      uint64_t *first) {
    uint64_t size = call->source->size, end_at = size < END_BYTES ? 0 : size - END_BYTES, offset;
    reel_section end;
    REEL_TRY(reel_section_at(call, end_at > outline->begin ? end_at : outline->begin, size, &end));
    REEL_TRY(reel_section_check(call, &end));
    REEL_CORRUPT_IF(end.id != REEL_END || end.payload.length != sizeof offset, end_at,
                    "the end of the file does not lead to an index");
    REEL_TRY(reel_read(call, end.payload.offset, &offset, sizeof offset));
    REEL_TRY(reel_section_at(call, offset, size, index));
    REEL_TRY(reel_announce(call, (reel_range){offset, size - offset}));
    REEL_TRY(reel_section_check(call, index));
    REEL_CORRUPT_IF(index->id != REEL_INDEX || offset < outline->begin || index->end != end_at,
                    offset, "the end of the file does not lead to an index");
    reel_range input = index->payload;
    REEL_TRY(reel_read_varint(call, &input, first));
    bool is_behind = *first >= outline->begin && *first <= offset;
    return is_behind ? MESHREEL_OK
                     : reel_corrupt(call, offset, "the first block of the index is out of range");
}

/* Read the blocks of a segment, which end before `limit`, from the index: into the outline if not
   NULL, and the totals into `segment`. */
static int read_blocks(reel_call *call, reel_pool *pool, reel_outline *outline,
                       reel_segment *segment, reel_range *input, uint64_t limit) {
    uint64_t offset = segment->first_block, n_blocks, n_frames, *ends = NULL;
    segment->n_frames = 0;
    REEL_TRY(reel_read_varint(call, input, &n_blocks));
    REEL_CORRUPT_IF(!n_blocks, input->offset, "the index lists a segment without blocks");
    for (uint64_t i = 0; i < n_blocks; i++) {
        REEL_TRY(reel_read_varint(call, input, &n_frames));
        REEL_TRY(outline
                     ? add_block(call, pool, outline, offset, n_frames, &ends)
                     : check_block(call, offset, segment->n_verts, segment->n_frames, n_frames));
        segment->n_frames += (uint32_t)n_frames;
        for (uint32_t track = 0; track < segment->n_tracks; track++) {
            uint64_t size;
            REEL_TRY(reel_read_varint(call, input, &size));
            REEL_CORRUPT_IF(!size || size > limit - offset, input->offset,
                            "the index lists blocks that are not in the file");
            offset += size;
            if (outline) {
                ends[track] = offset;
            }
        }
    }
    segment->end = offset;
    return MESHREEL_OK;
}

/* Read a segment other than the first from the index, up to its blocks. */
static int read_segment_entry(reel_call *call, reel_range *input, uint64_t limit,
                              reel_segment *segment) {
    uint64_t offset = input->offset, n_tracks, size;
    REEL_TRY(reel_read_varint(call, input, &segment->n_verts));
    REEL_TRY(reel_read_varint(call, input, &segment->n_faces));
    REEL_TRY(reel_read_varint(call, input, &n_tracks));
    REEL_TRY(reel_read_varint(call, input, &size));
    REEL_TRY(check_counts(call, segment->n_verts, segment->n_faces, offset));
    REEL_CORRUPT_IF(!n_tracks || n_tracks > MAX_TRACKS || size > limit - segment->offset, offset,
                    "the index lists a segment that is not in the file");
    segment->n_tracks = (uint32_t)n_tracks;
    segment->first_block = segment->offset + size;
    return MESHREEL_OK;
}

static int add_segment(reel_call *call, reel_pool *pool, reel_segments *segments,
                       reel_segment segment) {
    REEL_UNSUPPORTED_IF(segment.n_frames > REEL_MAX_FRAMES - segments->n_frames, segment.offset,
                        "more than 2^28 frames");
    void *items = segments->items;
    REEL_TRY(grow(call, pool, &items, segments->count, &segments->capacity, sizeof segment));
    segments->items = items;
    segment.first_frame = (uint32_t)segments->n_frames;
    segments->items[segments->count++] = segment;
    segments->n_frames += segment.n_frames;
    return MESHREEL_OK;
}

/* Read TIMES if it is stored between the last block and the index. */
static int read_trailing_times(reel_call *call, reel_outline *outline, uint64_t offset,
                               uint64_t index_at) {
    if (offset == index_at) {
        return MESHREEL_OK;
    }
    reel_section section;
    REEL_TRY(reel_section_at(call, offset, index_at, &section));
    REEL_TRY(reel_section_check(call, &section));
    REEL_CORRUPT_IF(section.id != REEL_TIMES || section.end != index_at, index_at,
                    "the index does not list all blocks");
    return add_times(call, outline, &section);
}

/* Read the index: the first segment into `outline`, all into `segments`. */
static int read_entries(reel_call *call, reel_pool *pool, reel_outline *outline,
                        const reel_section *index, reel_segments *segments) {
    reel_range input = index->payload;
    reel_segment segment = {.offset = outline->begin,
                            .n_verts = outline->n_verts,
                            .n_faces = outline->n_faces,
                            .n_tracks = outline->n_tracks};
    REEL_TRY(reel_read_varint(call, &input, &segment.first_block));
    for (bool is_first = true; is_first || input.length; is_first = false) {
        REEL_TRY(is_first ? MESHREEL_OK
                          : read_segment_entry(call, &input, index->offset, &segment));
        segment.blocks = input;
        REEL_TRY(
            read_blocks(call, pool, is_first ? outline : NULL, &segment, &input, index->offset));
        REEL_TRY(add_segment(call, pool, segments, segment));
        segment.offset = segment.end;
    }
    return read_trailing_times(call, outline, segment.end, index->offset);
}

/* Read the index from one copy of its bytes: it consists of many short numbers. */
static int read_index(reel_call *call, reel_pool *pool, reel_outline *outline,
                      const reel_section *index, reel_segments *segments) {
    const reel_chunk *mark = call->scratch.last;
    int failed = reel_cache(call, index->payload);
    failed = failed ? failed : read_entries(call, pool, outline, index, segments);
    call->cached = NULL;
    reel_drop_scratch(call, mark);
    return failed;
}

/* ---- section by section ---- */

typedef struct {
    reel_call *call;
    reel_pool *pool;
    reel_outline *outline;
    uint64_t *ends; /* row of the open block, or NULL */
    uint32_t n_groups, last_id;
    uint64_t index_at; /* offset of INDEX, or 0 */
    bool has_trailing_times;
} section_scan;

static int open_block(section_scan *s, const reel_section *section) {
    reel_range input = section->payload;
    uint64_t n_frames;
    REEL_TRY(reel_read_varint(s->call, &input, &n_frames));
    s->n_groups = 1;
    return add_block(s->call, s->pool, s->outline, section->offset, n_frames, &s->ends);
}

static int close_block(section_scan *s, uint64_t end) {
    if (s->n_groups != s->outline->n_tracks) {
        return reel_corrupt(s->call, end, "a block does not have one group per track");
    }
    s->ends[s->n_groups - 1] = end;
    s->ends = NULL;
    return MESHREEL_OK;
}

/* Drop the open block, which is incomplete. */
static void drop_block(section_scan *s) {
    if (s->ends) {
        s->outline->n_frames -= s->outline->blocks[--s->outline->n_blocks].n_frames;
    }
}

/* Check END after a scan, which an unusable index caused: a file without an index is valid, but one
   whose END refers to a bad index is not, and no damage explains it. */
static int check_end(section_scan *s, const reel_section *section) {
    if (section->end < s->call->source->size) {
        return reel_corrupt(s->call, section->end, "bytes follow the section END");
    }
    s->outline->is_contradicted = s->index_at || section->payload.length;
    return !s->outline->is_contradicted
               ? MESHREEL_OK
               : reel_corrupt(s->call, section->offset, "the index contradicts the blocks");
}

/* Check that a SEGMENT follows at least one block of a stream that may have several segments. */
static int check_next(section_scan *s, const reel_section *section) {
    return !s->outline->n_blocks || s->call->is_compact
               ? reel_corrupt(s->call, section->offset, "a segment is out of place")
               : MESHREEL_OK;
}

static int scan_section(section_scan *s, const reel_section *section) {
    uint32_t id = section->id;
    bool is_trailing = id == REEL_TIMES && s->outline->n_blocks;
    s->last_id = id;
    s->has_trailing_times |= is_trailing;
    s->index_at = id == REEL_INDEX ? section->offset : s->index_at;
    if (id == REEL_BLOCK || id == REEL_SEGMENT || id == REEL_INDEX || id == REEL_END ||
        is_trailing) {
        REEL_TRY(s->ends ? close_block(s, section->offset) : MESHREEL_OK);
        return id == REEL_END       ? check_end(s, section)
               : id == REEL_SEGMENT ? check_next(s, section)
               : id == REEL_BLOCK   ? open_block(s, section)
               : is_trailing        ? add_times(s->call, s->outline, section)
                                    : MESHREEL_OK;
    }
    if (s->ends) {
        if (id == REEL_TRACK_BLOCK) {
            if (s->n_groups == s->outline->n_tracks) {
                return reel_corrupt(s->call, section->offset,
                                    "a block has more groups than there are tracks");
            }
            s->ends[s->n_groups++ - 1] = section->offset;
        }
        return MESHREEL_OK;
    }
    return add_leading(s->call, s->pool, s->outline, section);
}

/* Scan sections up to the next segment, whose section is stored in `next`, or to END, or to damage:
   then `is_whole` is false. */
static int read_sections(reel_call *call, reel_pool *pool, reel_outline *outline, uint64_t begin,
                         reel_section *next) {
    section_scan s = {.call = call, .pool = pool, .outline = outline, .last_id = REEL_OPTIONAL};
    uint64_t offset = begin;
    int failed = MESHREEL_OK;
    next->id = REEL_END;
    while (!failed && s.last_id != REEL_END && s.last_id != REEL_SEGMENT) {
        reel_section section;
        failed = reel_section_at(call, offset, call->source->size, &section);
        failed = failed ? failed : reel_section_check(call, &section);
        bool is_last = section.id == REEL_END || (section.id == REEL_INDEX && !s.index_at);
        if (!failed && (s.index_at || s.has_trailing_times) && !is_last) {
            failed = reel_corrupt(call, offset, "a section follows the index or the times");
        } else if (!failed && reel_is_known(section.id)) {
            failed = scan_section(&s, &section);
        }
        if (!failed && s.last_id == REEL_SEGMENT) {
            *next = section;
        }
        offset = failed || s.last_id == REEL_SEGMENT ? offset : section.end;
    }
    if (outline->is_contradicted ||
        (failed && failed != MESHREEL_TRUNCATED && failed != MESHREEL_CORRUPT)) {
        return failed;
    }
    outline->is_whole = !failed;
    outline->damage = failed ? call->error : (meshreel_error){0};
    outline->end = offset;
    bool is_complete = s.ends && s.n_groups == outline->n_tracks &&
                       (s.last_id == REEL_COEFFICIENTS || s.last_id == REEL_VALUES);
    if (is_complete) {
        close_block(&s, offset);
    } else if (s.ends) {
        outline->end = outline->blocks[outline->n_blocks - 1].offset;
        drop_block(&s);
    }
    if (outline->n_blocks) {
        return MESHREEL_OK;
    }
    return failed ? failed : reel_corrupt(call, outline->begin, "a segment has no block of frames");
}

static uint64_t end_of_blocks(const reel_outline *outline) {
    return outline->ends[outline->n_blocks * outline->n_tracks - 1];
}

/* ---- segments ---- */

/* Begin a segment with the contents of its section SEGMENT. */
static int begin_segment(reel_call *call, const reel_section *section, const reel_outline *file,
                         reel_outline *outline) {
    reel_range input = section->payload;
    uint8_t form;
    *outline = (reel_outline){.fps = file->fps, .begin = section->offset};
    reel_copy(outline->placement, file->placement, sizeof outline->placement);
    REEL_TRY(read_counts(call, &input, outline));
    REEL_TRY(read_codes(call, &input, outline, &form));
    REEL_CORRUPT_IF(form & IS_COMPACT, section->offset, "a segment is compact");
    REEL_TRY(input.length ? read_placement(call, &input, outline, form) : MESHREEL_OK);
    REEL_CORRUPT_IF(input.length, section->offset,
                    "the section SEGMENT is longer than its numbers");
    reset_outline(outline);
    return MESHREEL_OK;
}

/* Read the section SEGMENT of a segment other than the first, found earlier by index or scan. */
static int read_beginning(reel_call *call, const reel_outline *file, const reel_segment *segment,
                          uint64_t limit, reel_section *section, reel_outline *outline) {
    REEL_TRY(announce_leading(call, (reel_range){segment->offset, limit - segment->offset}));
    REEL_TRY(reel_section_at(call, segment->offset, limit, section));
    REEL_TRY(verify_leading(call, section));
    REEL_CORRUPT_IF(section->id != REEL_SEGMENT, segment->offset,
                    "no segment begins where the index lists one");
    REEL_TRY(begin_segment(call, section, file, outline));
    bool differs = outline->n_verts != segment->n_verts || outline->n_faces != segment->n_faces;
    return !differs
               ? MESHREEL_OK
               : reel_corrupt(call, segment->offset, "the index contradicts the mesh of a segment");
}

/* Sections of the mesh that an earlier segment stores, and that a segment shares. */
typedef struct {
    const reel_segment *segment;
    uint64_t n_skipped, n_sections; /* counted among those that it stores */
} shared_range;

/* A segment's reference to sections of earlier segments. */
typedef struct {
    shared_range ranges[MAX_RANGES];
    uint32_t n_ranges; /* 0: there is no reference */
    uint64_t offset;   /* offset of its payload */
    uint64_t end;      /* end of the section, or of SEGMENT */
} mesh_reference;

/* Read a range of the reference of segment `number`. */
static int read_range(reel_call *call, reel_range *input, const reel_segments *segments,
                      uint64_t number, uint64_t offset, shared_range *range) {
    uint64_t distance;
    REEL_TRY(reel_read_varint(call, input, &distance));
    REEL_TRY(reel_read_varint(call, input, &range->n_skipped));
    REEL_TRY(reel_read_varint(call, input, &range->n_sections));
    REEL_CORRUPT_IF(!range->n_sections || range->n_sections > MAX_SHARED ||
                        range->n_skipped > MAX_SHARED - range->n_sections,
                    offset, "a reference shares no section, or one after the first 255");
    REEL_CORRUPT_IF(!distance || distance > number, offset,
                    "a segment refers to one that does not precede it");
    range->segment = &segments->items[number - distance];
    return MESHREEL_OK;
}

/* Read the section REFERENCE of segment `number`, if it is stored at `begin`. */
static int read_reference(reel_call *call, const reel_segments *segments, uint64_t number,
                          uint64_t begin, uint64_t limit, mesh_reference *reference) {
    uint8_t id = REEL_END;
    reel_section section;
    *reference = (mesh_reference){.end = begin};
    REEL_TRY(begin < limit ? reel_read(call, begin, &id, sizeof id) : MESHREEL_OK);
    if (id != REEL_REFERENCE) {
        return MESHREEL_OK;
    }
    REEL_TRY(reel_section_at(call, begin, limit, &section));
    REEL_TRY(reel_section_check(call, &section));
    reference->offset = section.payload.offset;
    reference->end = section.end;
    reel_range input = section.payload;
    while (input.length || !reference->n_ranges) {
        REEL_CORRUPT_IF(reference->n_ranges == MAX_RANGES, reference->offset,
                        "a reference has more than two ranges");
        shared_range *range = &reference->ranges[reference->n_ranges++];
        REEL_TRY(read_range(call, &input, segments, number, reference->offset, range));
    }
    return MESHREEL_OK;
}

/* Whether a REFERENCE counts sections with this id: those of a mesh. */
static bool is_of_mesh(uint32_t id) {
    bool is_of_surface = id >= REEL_POLYGONS && id <= REEL_HARD_EDGES && id != REEL_START &&
                         id != REEL_TRACK;
    return id == REEL_CONNECTIVITY || id == REEL_ORDER || id == REEL_EDIT || id == REEL_CELLS ||
           id == REEL_ATTRIBUTE_FROM_POINTS || is_of_surface;
}

/* Whether a section is behind the leading ones of the segment that begins at `begin`. */
static bool is_after_leading(const reel_section *section, uint64_t begin) {
    bool is_of_block = section->id >= REEL_BLOCK && !(section->id & REEL_OPTIONAL);
    return is_of_block || section->id == REEL_END ||
           (section->id == REEL_SEGMENT && section->offset != begin);
}

/* Add a range of sections that a segment refers to. */
static int add_range(reel_call *call, reel_pool *pool, const shared_range *range,
                     uint64_t reference_at, reel_outline *outline) {
    const reel_segment *segment = range->segment;
    uint64_t limit = segment->first_block ? segment->first_block : segment->end,
             offset = segment->offset;
    REEL_TRY(announce_leading(call, (reel_range){offset, limit - offset}));
    for (uint64_t i = 0; i < range->n_skipped + range->n_sections;) {
        reel_section section = {.id = REEL_BLOCK};
        REEL_TRY(offset < limit ? reel_section_at(call, offset, limit, &section) : MESHREEL_OK);
        REEL_CORRUPT_IF(is_after_leading(&section, segment->offset), reference_at,
                        "a segment refers to more sections than the other one has");
        if (i >= range->n_skipped && is_of_mesh(section.id)) {
            REEL_CORRUPT_IF(section.id == REEL_ATTRIBUTE_FROM_POINTS, reference_at,
                            "a segment refers to an attribute that depends on positions");
            REEL_TRY(verify_leading(call, &section));
            REEL_TRY(add_leading(call, pool, outline, &section));
        }
        i += is_of_mesh(section.id);
        offset = section.end;
    }
    return MESHREEL_OK;
}

static int add_shared(reel_call *call, reel_pool *pool, const mesh_reference *reference,
                      reel_outline *outline) {
    for (uint32_t i = 0; i < reference->n_ranges; i++) {
        REEL_TRY(add_range(call, pool, &reference->ranges[i], reference->offset, outline));
    }
    return MESHREEL_OK;
}

static int parse_segment(reel_call *call, reel_pool *pool, const reel_segment *segment,
                         uint64_t begin, reel_outline *outline) {
    reel_section next;
    if (!segment->first_block) {
        return read_sections(call, pool, outline, begin, &next);
    }
    reel_segment result = *segment;
    reel_range input = segment->blocks;
    REEL_TRY(read_leading(call, pool, outline, begin, segment->first_block));
    REEL_CORRUPT_IF(outline->n_tracks != segment->n_tracks, segment->offset,
                    "the index contradicts the tracks of a segment");
    outline->is_whole = true;
    return read_blocks(call, pool, outline, &result, &input, segment->end);
}

int reel_read_segment(reel_call *call, reel_pool *pool, const reel_outline *file,
                      const reel_segments *segments, uint32_t number, reel_outline *outline) {
    const reel_segment *segment = &segments->items[number];
    mesh_reference reference = {.end = segment->offset};
    if (number) {
        reel_section section;
        uint64_t limit = segment->first_block ? segment->first_block : segment->end;
        REEL_TRY(read_beginning(call, file, segment, limit, &section, outline));
        REEL_TRY(read_reference(call, segments, number, section.end, limit, &reference));
        REEL_TRY(add_shared(call, pool, &reference, outline));
    } else {
        *outline = *file;
        reset_outline(outline);
    }
    REEL_TRY(parse_segment(call, pool, segment, reference.end, outline));
    char *name = reel_pool_allocate(call, pool, file->name.size, 1);
    REEL_NEED(name);
    reel_copy(name, file->name.bytes, file->name.size);
    outline->name = (meshreel_text){name, file->name.size};
    outline->end = end_of_blocks(outline);
    outline->start_s = file->start_s;
    if (file->fps > 0.0) {
        outline->start_s += (double)segment->first_frame / file->fps;
    }
    return MESHREEL_OK;
}

/* ---- the file ---- */

static int check_frames(reel_call *call, const reel_outline *outline,
                        const reel_segments *segments) {
    bool differs = outline->header_frames && outline->header_frames != segments->n_frames;
    return outline->is_whole && differs
               ? reel_corrupt(call, 10,
                              "the blocks have fewer or more frames than the header states")
               : MESHREEL_OK;
}

static int read_indexed(reel_call *call, reel_pool *pool, reel_outline *outline,
                        reel_segments *segments) {
    reel_section index;
    uint64_t first;
    REEL_TRY(find_index(call, outline, &index, &first));
    REEL_TRY(read_leading(call, pool, outline, outline->begin, first));
    REEL_TRY(read_index(call, pool, outline, &index, segments));
    outline->is_whole = true;
    outline->end = call->source->size;
    return check_frames(call, outline, segments);
}

static int add_scanned(reel_call *call, reel_pool *pool, const reel_outline *outline,
                       reel_segments *segments) {
    return add_segment(call, pool, segments,
                       (reel_segment){.offset = outline->begin,
                                      .end = end_of_blocks(outline),
                                      .n_verts = outline->n_verts,
                                      .n_faces = outline->n_faces,
                                      .n_frames = (uint32_t)outline->n_frames,
                                      .n_tracks = outline->n_tracks});
}

/* Scan the segment that begins with section `next`, which is replaced by the section after it. A
   damaged segment without a complete block is dropped. */
static int scan_segment(reel_call *call, reel_pool *pool, reel_outline *file, reel_section *next,
                        reel_segments *segments) {
    const reel_chunk *mark = call->scratch.last;
    reel_outline outline;
    mesh_reference reference;
    uint64_t offset = next->offset;
    int failed = begin_segment(call, next, file, &outline);
    outline.times = file->times; /* at most once in a file */
    failed = failed ? failed
                    : read_reference(call, segments, segments->count, next->end,
                                     call->source->size, &reference);
    failed = failed ? failed
                    : read_sections(call, &call->scratch, &outline, reference.end, next);
    if ((failed == MESHREEL_TRUNCATED || failed == MESHREEL_CORRUPT) &&
        !outline.is_contradicted) {
        next->id = REEL_END;
        file->is_whole = false;
        file->end = offset;
        file->damage = call->error;
        failed = MESHREEL_OK;
    } else if (!failed) {
        file->is_whole = outline.is_whole;
        file->end = outline.end;
        file->damage = outline.damage;
        file->times = outline.times;
        failed = add_scanned(call, pool, &outline, segments);
    }
    reel_drop_scratch(call, mark);
    return failed;
}

static int read_scanned(reel_call *call, reel_pool *pool, reel_outline *outline,
                        reel_segments *segments) {
    reel_section next;
    REEL_TRY(read_sections(call, pool, outline, outline->begin, &next));
    REEL_TRY(add_scanned(call, pool, outline, segments));
    while (next.id == REEL_SEGMENT) {
        REEL_TRY(scan_segment(call, pool, outline, &next, segments));
    }
    return check_frames(call, outline, segments);
}

int reel_read_outline(reel_call *call, reel_pool *pool, reel_outline *outline,
                      reel_segments *segments) {
    *outline = (reel_outline){0};
    *segments = (reel_segments){0};
    REEL_UNSUPPORTED_IF(call->source->size > REEL_MAX_FILE_BYTES, 0, "more than 2^40 bytes");
    REEL_TRY(read_header(call, pool, outline));
    reset_outline(outline);
    if (!outline->is_compact) {
        int failed = read_indexed(call, pool, outline, segments);
        if (failed != MESHREEL_TRUNCATED && failed != MESHREEL_CORRUPT) {
            return failed;
        }
        reset_outline(outline);
        *segments = (reel_segments){0};
    }
    return read_scanned(call, pool, outline, segments);
}

uint32_t reel_count_sections(const reel_outline *outline, uint32_t id, reel_range *payload) {
    uint32_t count = 0;
    for (uint32_t i = 0; i < outline->n_leading; i++) {
        if (outline->leading[i].id == id) {
            count++;
            if (payload) {
                *payload = outline->leading[i].payload;
            }
        }
    }
    return count;
}
