/* Decodes whole files through meshreel.h with two hosts: a reliable one, and a hostile one that
   fails, limits memory, and reorders tasks. Results must agree, and nothing may leak. */

#include <stdlib.h>
#include <string.h>

#include "../include/meshreel.h"
#include "fuzz.h"

#define LIMIT ((uint64_t)1 << 22)
#define MAX_BYTES ((uint64_t)1 << 18) /* limit of values decoded at once */
#define MAX_RETRIES 2000

/* ---- a host ---- */

typedef struct {
    fuzz_bytes bytes;
    uint64_t n_bytes, limit;
    int64_t fails_once_in; /* 0: never */
} host_state;

static bool fails(host_state *state) {
    return state->fails_once_in && fuzz_one_in(state->fails_once_in);
}

static void *allocate(void *user, size_t size) {
    host_state *state = user;
    void *memory = NULL;
    if (fails(state)) {
        return NULL;
    }
    FUZZ_CHECK(!posix_memalign(&memory, 64, size));
    memset(memory, fuzz_fill_byte(), size);
    state->n_bytes += size;
    FUZZ_CHECK(state->n_bytes <= 3 * state->limit); /* of a file, a segment and a decoder */
    return memory;
}

static void release(void *user, void *memory, size_t size) {
    host_state *state = user;
    FUZZ_CHECK(size <= state->n_bytes);
    state->n_bytes -= size;
    free(memory);
}

static int read_bytes(void *user, uint64_t offset, void *to, size_t size) {
    host_state *state = user;
    FUZZ_CHECK(size && offset <= state->bytes.size && size <= state->bytes.size - offset);
    if (fails(state)) {
        return 1;
    }
    memcpy(to, state->bytes.bytes + offset, size);
    return 0;
}

/* `run` of a host: runs the last task first. */
static void run_backward(void *user, void (*task)(void *shared, uint32_t i), void *shared,
                         uint32_t n_tasks) {
    (void)user;
    for (uint32_t i = n_tasks; i > 0; i--) {
        task(shared, i - 1);
    }
}

/* ---- calls ---- */

/* A file being read. */
typedef struct {
    host_state state;
    meshreel_source source;
    meshreel_host host;
    /* If a segment is open: the segment, and its file; else `whole` is NULL. */
    meshreel_file *file, *whole;
    meshreel_decoder *decoder;
} reading;

typedef struct {
    enum { OPEN, SEGMENT, CHECK, MESH, SURFACE, BEGIN, LOAD, DECODE, NORMALS } action;
    uint32_t track, first, count, n_modes;
    const meshreel_layout *layout;
    void *values;
    const void *positions;
} step;

static int run_step(reading *r, const step *s, meshreel_error *error) {
    switch (s->action) {
    case OPEN:
        return meshreel_open(&r->source, &r->host, &r->file, error);
    case SEGMENT:
        return meshreel_open_segment(r->whole, s->first, &r->file, error);
    case CHECK:
        return meshreel_check(r->file, 0, meshreel_info_of(r->file)->n_frames, s->n_modes, error);
    case MESH:
        return meshreel_read_mesh(r->file, error);
    case SURFACE:
        return meshreel_read_surface(r->file, error);
    case BEGIN:
        return meshreel_begin(r->file, &r->decoder, error);
    case LOAD:
        return meshreel_load(r->decoder, s->track, s->first, s->n_modes, error);
    case DECODE:
        return meshreel_decode(r->decoder, s->track, s->first, s->count, s->n_modes, s->layout,
                               s->values, error);
    default:
        return meshreel_normals(r->decoder, MESHREEL_FLOAT32, s->positions, s->values, error);
    }
}

/* Retry a step until neither allocation nor reading fails; returns its code. */
static int retry_step(reading *r, const step *s) {
    for (int tries = 0;; tries++) {
        meshreel_error error = {.code = -1};
        int code = run_step(r, s, &error);
        FUZZ_CHECK(error.code == code && error.message);
        bool may_pass = code == MESHREEL_NO_MEMORY || code == MESHREEL_UNREADABLE;
        FUZZ_CHECK(!may_pass || r->state.fails_once_in);
        FUZZ_CHECK(code != MESHREEL_INVALID && code >= 0 && code <= MESHREEL_LIMIT);
        FUZZ_CHECK(code != MESHREEL_RANGE || (s->layout && s->layout->type));
        FUZZ_CHECK(code != MESHREEL_LIMIT || error.size > r->state.limit);
        FUZZ_CHECK(code != MESHREEL_UNREADABLE || error.offset < r->state.bytes.size);
        if (!may_pass) {
            return code;
        }
        FUZZ_CHECK(tries < MAX_RETRIES);
        r->state.fails_once_in += tries % 2; /* fail less often, so that long steps end */
    }
}

/* ---- results ---- */

/* Hash numbers, with canonical NaNs: processors differ in their bits. */
static void hash_numbers(const void *numbers, uint64_t count, uint32_t type) {
    for (uint64_t i = 0; i < count && type == MESHREEL_FLOAT32; i++) {
        float value = ((const float *)numbers)[i];
        value = value == value ? value : __builtin_nanf("");
        fuzz_hash(&value, 1, sizeof value);
    }
    if (type == MESHREEL_FLOAT64) {
        fuzz_hash_doubles(numbers, (int64_t)count);
    } else if (type != MESHREEL_FLOAT32) {
        fuzz_hash(numbers, (int64_t)count, type & 15U);
    }
}

static void hash_text(meshreel_text text) { fuzz_hash(text.bytes, (int64_t)text.size, 1); }

static void check_attribute(const meshreel_attribute *value) {
    hash_text(value->name);
    hash_numbers(value->values, (uint64_t)value->n_rows * value->width, value->type);
    FUZZ_CHECK(value->rows || value->n_rows == value->n_items);
    for (uint32_t i = 0; value->rows && i < value->n_items; i++) {
        FUZZ_CHECK(value->rows[i] >= 0 && (uint32_t)value->rows[i] < value->n_rows);
    }
}

static void check_surface(const reading *r) {
    const meshreel_surface *surface = meshreel_surface_of(r->file);
    const meshreel_info *info = meshreel_info_of(r->file);
    uint64_t n_corners = 0, n_verts = 0;
    for (uint32_t i = 0; surface->face_sizes && i < info->n_faces; i++) {
        FUZZ_CHECK(surface->face_sizes[i] >= 3);
        n_corners += surface->face_sizes[i];
    }
    FUZZ_CHECK(!surface->face_sizes || n_corners == info->n_corners);
    FUZZ_CHECK(!surface->face_sizes == !surface->triangle_corners);
    for (uint64_t i = 0; surface->triangle_corners && i < 3 * (uint64_t)info->n_triangles; i++) {
        FUZZ_CHECK(surface->triangle_corners[i] < info->n_corners);
    }
    for (uint32_t i = 0; i < surface->n_attributes; i++) {
        check_attribute(&surface->attributes[i]);
    }
    for (uint32_t i = 0; i < surface->n_groups; i++) {
        const meshreel_groups *groups = &surface->groups[i];
        for (uint32_t k = 0; k < groups->n_labels; k++) {
            hash_text(groups->labels[k]);
        }
        for (uint32_t k = 0; k < info->n_faces; k++) {
            FUZZ_CHECK(groups->of_faces[k] >= -1 &&
                       groups->of_faces[k] < (int64_t)groups->n_labels);
        }
    }
    for (uint32_t i = 0; i < surface->n_parts; i++) {
        n_verts += surface->parts[i].n_verts;
    }
    FUZZ_CHECK(!surface->n_parts || n_verts == info->n_verts);
    for (uint32_t i = 0; i < surface->n_materials; i++) {
        for (int slot = 0; slot < MESHREEL_SLOTS; slot++) {
            uint32_t image = surface->materials[i].textures[slot].image;
            FUZZ_CHECK(image == MESHREEL_NONE || image < surface->n_images);
        }
    }
    for (uint32_t i = 0; i < surface->n_images; i++) {
        uint64_t end = surface->images[i].offset + surface->images[i].size;
        FUZZ_CHECK(end <= r->state.bytes.size);
    }
}

static void check_layout(const reading *r) {
    const meshreel_info *info = meshreel_info_of(r->file);
    meshreel_section section;
    meshreel_error error;
    uint32_t frame = 0;
    for (uint64_t end = 0; !meshreel_section_at(r->file, end, 1, &section, &error);) {
        end = section.offset + section.size;
        FUZZ_CHECK(end <= info->size);
    }
    for (uint32_t i = 0; i < info->n_blocks; i++) {
        meshreel_block block;
        FUZZ_CHECK(meshreel_block_of(r->file, i, info->n_tracks - 1, &block) == MESHREEL_OK);
        FUZZ_CHECK(block.first_frame == frame && block.n_frames);
        FUZZ_CHECK(meshreel_block_of_frame(r->file, frame) == i);
        frame += block.n_frames;
    }
    FUZZ_CHECK(frame == info->n_frames);
}

/* ---- both hosts ---- */

/* Take a step with both files; returns its code. */
static int run_both(reading *reliable, reading *hostile, const step *reliable_step,
                    const step *hostile_step) {
    int code = retry_step(reliable, reliable_step), other = retry_step(hostile, hostile_step);
    bool is_limited = code == MESHREEL_LIMIT || other == MESHREEL_LIMIT;
    FUZZ_CHECK(code == other || is_limited);
    fuzz_hash(&code, 1, sizeof code);
    return is_limited ? MESHREEL_LIMIT : code;
}

static int run_same(reading *reliable, reading *hostile, const step *s) {
    return run_both(reliable, hostile, s, s);
}

/* A random valid type and strides. */
static meshreel_layout any_layout(const meshreel_track *track) {
    meshreel_layout layout = {0};
    if (track->type == MESHREEL_FLOAT64 && fuzz_one_in(2)) {
        layout.type = MESHREEL_FLOAT32;
    }
    size_t size = (layout.type ? layout.type : track->type) & 15U;
    if (fuzz_one_in(2)) {
        layout.value_stride = size * (track->n_columns + (size_t)fuzz_below(3));
        layout.frame_stride = layout.value_stride * (track->n_items + (size_t)fuzz_below(3));
    }
    return layout;
}

/* Decode some frames of a track with both, into identically filled memory. */
static void decode_both(reading *reliable, reading *hostile) {
    const meshreel_info *info = meshreel_info_of(reliable->file);
    meshreel_track track;
    step s = {.action = DECODE, .track = (uint32_t)fuzz_below(info->n_tracks)};
    FUZZ_CHECK(meshreel_track_of(reliable->file, s.track, &track) == MESHREEL_OK);
    meshreel_layout layout = any_layout(&track);
    size_t size = (layout.type ? layout.type : track.type) & 15U;
    uint64_t frame_bytes = layout.frame_stride ? layout.frame_stride
                                               : size * track.n_columns * track.n_items;
    s.first = (uint32_t)fuzz_below(info->n_frames);
    uint64_t max_count = MAX_BYTES / frame_bytes, left = info->n_frames - s.first;
    s.count = (uint32_t)fuzz_below((int64_t)(max_count < left ? max_count : left) + 1);
    s.n_modes = !s.track && info->method == 7 && fuzz_one_in(3) ? 1 + (uint32_t)fuzz_below(20) : 0;
    s.layout = fuzz_one_in(4) && !layout.type && !layout.frame_stride ? NULL : &layout;
    step other = s;
    s.values = fuzz_allocate((int64_t)(s.count * frame_bytes), 1);
    other.values = fuzz_allocate((int64_t)(s.count * frame_bytes), 1);
    if (run_both(reliable, hostile, &s, &other) == MESHREEL_OK) {
        FUZZ_CHECK(!memcmp(s.values, other.values, s.count * frame_bytes));
        if (!layout.value_stride) {
            hash_numbers(s.values, s.count * frame_bytes / size,
                         layout.type ? layout.type : track.type);
        }
    }
}

static void find_normals(reading *reliable, reading *hostile) {
    const meshreel_info *info = meshreel_info_of(reliable->file);
    uint64_t count = 3 * (uint64_t)info->n_verts;
    meshreel_layout floats = {.type = MESHREEL_FLOAT32};
    float *positions = fuzz_allocate((int64_t)count, sizeof *positions);
    float *normals = fuzz_allocate((int64_t)count, sizeof *normals);
    step s = {.action = DECODE, .count = 1, .layout = &floats, .values = positions};
    if (count * sizeof *normals < MAX_BYTES && !run_same(reliable, hostile, &s)) {
        s = (step){.action = NORMALS, .positions = positions, .values = normals};
        if (!run_same(reliable, hostile, &s)) {
            hash_numbers(normals, count, MESHREEL_FLOAT32);
        }
    }
}

static void decode_blocks(reading *reliable, reading *hostile) {
    const meshreel_info *info = meshreel_info_of(reliable->file);
    for (int i = 0; i < 10; i++) {
        if (fuzz_one_in(4)) {
            step s = {.action = LOAD, .track = (uint32_t)fuzz_below(info->n_tracks),
                      .first = (uint32_t)fuzz_below(info->n_blocks)};
            meshreel_group group;
            if (!run_same(reliable, hostile, &s)) {
                FUZZ_CHECK(meshreel_group_of(reliable->file, s.first, s.track, 1, &group, NULL) ==
                           MESHREEL_OK);
                FUZZ_CHECK(group.key_block <= s.first);
            }
        } else {
            decode_both(reliable, hostile);
        }
    }
    find_normals(reliable, hostile);
}

static void check_segments(const meshreel_file *whole) {
    const meshreel_info *info = meshreel_info_of(whole);
    uint64_t frame = 0, end = 0;
    for (uint32_t i = 0; i < info->n_segments; i++) {
        meshreel_segment segment;
        FUZZ_CHECK(meshreel_segment_of(whole, i, &segment) == MESHREEL_OK);
        FUZZ_CHECK(segment.first_frame == frame && segment.n_frames);
        FUZZ_CHECK(meshreel_segment_of_frame(whole, segment.first_frame) == i);
        FUZZ_CHECK(segment.n_verts && segment.n_triangles && segment.size);
        FUZZ_CHECK(segment.offset >= end && (!end || segment.offset == end));
        frame += segment.n_frames;
        end = segment.offset + segment.size;
    }
    FUZZ_CHECK(frame == info->n_frames && end <= info->size);
    FUZZ_CHECK(meshreel_segment_of(whole, info->n_segments, NULL) == MESHREEL_INVALID);
}

/* Open a random segment with both. */
static int open_any_segment(reading *reliable, reading *hostile) {
    uint32_t n_segments = meshreel_info_of(reliable->file)->n_segments;
    step s = {.action = SEGMENT, .first = (uint32_t)fuzz_below(n_segments)};
    for (int i = 0; i < 2; i++) {
        reading *r = i ? hostile : reliable;
        r->whole = r->file;
        r->file = NULL;
    }
    return run_same(reliable, hostile, &s);
}

static void read_both(reading *reliable, reading *hostile) {
    if (run_same(reliable, hostile, &(step){.action = OPEN})) {
        return;
    }
    check_segments(reliable->file);
    if (meshreel_info_of(reliable->file)->n_segments > 1) {
        FUZZ_CHECK(meshreel_read_mesh(reliable->file, NULL) == MESHREEL_SEGMENTS);
        if (open_any_segment(reliable, hostile)) {
            return;
        }
    }
    check_layout(reliable);
    step check = {.action = CHECK, .n_modes = (uint32_t)fuzz_below(20)};
    retry_step(reliable, &check); /* a lower limit verifies checksums, so that codes may differ */
    retry_step(hostile, &check);
    if (run_same(reliable, hostile, &(step){.action = MESH})) {
        return;
    }
    const meshreel_info *info = meshreel_info_of(reliable->file);
    const uint32_t *triangles = meshreel_triangles(reliable->file);
    for (uint64_t i = 0; i < 3 * (uint64_t)info->n_triangles; i++) {
        FUZZ_CHECK(triangles[i] < info->n_verts);
    }
    fuzz_hash(triangles, 3 * (int64_t)info->n_triangles, sizeof *triangles);
    if (!run_same(reliable, hostile, &(step){.action = SURFACE})) {
        check_surface(reliable);
    }
    if (!run_same(reliable, hostile, &(step){.action = BEGIN})) {
        decode_blocks(reliable, hostile);
    }
}

static void end_reading(reading *r) {
    meshreel_end(r->decoder);
    meshreel_close(r->whole);
    meshreel_close(r->file);
    FUZZ_CHECK(r->state.n_bytes == 0);
}

void fuzz_read_stream(fuzz_bytes bytes) {
    reading reliable = {.state = {.bytes = bytes, .limit = LIMIT},
                        .source = {.bytes = bytes.bytes, .size = bytes.size}};
    reading hostile = {.state = {.bytes = bytes, .limit = LIMIT},
                       .source = {.read = read_bytes, .size = bytes.size}};
    reliable.host = hostile.host =
        (meshreel_host){.allocate = allocate, .release = release, .memory_limit = LIMIT};
    reliable.host.user = &reliable.state;
    hostile.host.user = hostile.source.user = &hostile.state;
    hostile.state.fails_once_in = fuzz_one_in(3) ? 2 + fuzz_below(60) : 0;
    if (fuzz_one_in(3)) {
        hostile.state.limit = hostile.host.memory_limit = (uint64_t)1 << (9 + fuzz_below(13));
    }
    if (fuzz_one_in(2)) {
        hostile.host.run = run_backward;
        hostile.host.n_threads = 1 + (uint32_t)fuzz_below(5);
    }
    read_both(&reliable, &hostile);
    end_reading(&reliable);
    end_reading(&hostile);
}
