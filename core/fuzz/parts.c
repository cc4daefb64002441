/* Compares segments decoded by one call of ../reader/parts.h, in the memory of ../host_memory.c,
   with each decoded alone. */

#include <stdlib.h>
#include <string.h>

#include "../reader/parts.h"
#include "fuzz.h"

#define LIMIT ((uint64_t)1 << 22)
#define MAX_BYTES ((uint64_t)1 << 17) /* limit of the values of a track */
#define MAX_PARTS 6

/* ---- memory ---- */

/* Of the allocator below the store, which has no argument for them. */
static int64_t n_raw, raw_fails_once_in; /* 0: never */

static void *allocate_raw(size_t size) {
    if (raw_fails_once_in && fuzz_one_in(raw_fails_once_in)) {
        return NULL;
    }
    void *raw = malloc(size);
    FUZZ_CHECK(raw);
    n_raw++;
    return raw;
}

static void release_raw(void *raw) {
    n_raw--;
    free(raw);
}

static reel_block_store make_store(void) {
    n_raw = 0;
    raw_fails_once_in = fuzz_one_in(4) ? 2 + fuzz_below(60) : 0;
    return (reel_block_store){.allocate = allocate_raw,
                              .release = release_raw,
                              .max_bytes = fuzz_one_in(4) ? 0 : (uint64_t)1 << fuzz_below(21)};
}

/* Release the blocks that a store keeps, which must be all that is left. */
static void end_store(reel_block_store *store) {
    reel_host_memory host = {.store = store};
    FUZZ_CHECK(store->n_bytes <= store->max_bytes && !store->is_locked);
    store->max_bytes = 0;
    for (int list = 0; list < REEL_BLOCK_SIZES; list++) {
        while (store->blocks[list]) {
            size_t size = (size_t)(4 + list % 4) << list / 4;
            reel_host_release(&host, reel_host_allocate(&host, size), size);
        }
    }
    FUZZ_CHECK(n_raw == 0 && store->n_bytes == 0 && host.n_bytes == 0);
}

/* What a block that is released contains cannot be used until it is allocated again. */
static void *allocate(void *user, size_t size) {
    void *memory = reel_host_allocate(user, size);
    if (memory) {
        fuzz_unpoison(memory, size);
        memset(memory, fuzz_fill_byte(), size);
    }
    return memory;
}

static void release(void *user, void *memory, size_t size) {
    fuzz_poison(memory, size);
    reel_host_release(user, memory, size);
}

/* ---- parts ---- */

/* Values of the frames of a part, for each track, in separate memory. */
static void *const *allocate_values(const reel_part *part, uint32_t n_frames) {
    uint32_t n_tracks = meshreel_info_of(part->file)->n_tracks;
    void **values = fuzz_allocate(n_tracks, sizeof *values);
    for (uint32_t i = 0; i < n_tracks; i++) {
        meshreel_track track;
        FUZZ_CHECK(meshreel_track_of(part->file, i, &track) == MESHREEL_OK);
        values[i] = fuzz_allocate((int64_t)n_frames * track.n_items * track.n_columns,
                                  track.type & 15U);
    }
    return values;
}

/* Return the largest number of frames whose values are within the limit, for every track. */
static uint64_t most_frames(const meshreel_file *file) {
    uint64_t most = MAX_BYTES;
    for (uint32_t i = 0; i < meshreel_info_of(file)->n_tracks; i++) {
        meshreel_track track;
        FUZZ_CHECK(meshreel_track_of(file, i, &track) == MESHREEL_OK);
        uint64_t frame_bytes = (uint64_t)track.n_items * track.n_columns * (track.type & 15U);
        most = frame_bytes * most > MAX_BYTES ? MAX_BYTES / frame_bytes : most;
    }
    return most;
}

static reel_part make_part(meshreel_file *file) {
    const meshreel_info *info = meshreel_info_of(file);
    reel_part part = {.file = file, .with_surface = fuzz_one_in(2), .error = {.code = -1}};
    part.first = (uint32_t)fuzz_below(info->n_frames);
    uint64_t most = most_frames(file), left = info->n_frames - part.first;
    part.count = (uint32_t)fuzz_below((int64_t)(most < left ? most : left) + 1);
    part.n_modes = info->method == 7 && fuzz_one_in(3) ? 1 + (uint32_t)fuzz_below(20) : 0;
    part.values = allocate_values(&part, part.count);
    if (fuzz_one_in(20)) { /* frames that do not exist */
        part.count = UINT32_MAX - (uint32_t)fuzz_below(part.first + 1);
    }
    return part;
}

/* Decode the frames of a part track by track, into `values`; returns the code. */
static int decode_alone(meshreel_file *file, const reel_part *part, void *const *values) {
    meshreel_error error;
    meshreel_decoder *decoder = NULL;
    int code = part->with_surface ? meshreel_read_surface(file, &error)
                                  : meshreel_read_mesh(file, &error);
    code = code ? code : meshreel_begin(file, &decoder, &error);
    for (uint32_t i = 0; i < meshreel_info_of(file)->n_tracks && !code; i++) {
        code = meshreel_decode(decoder, i, part->first, part->count, i ? 0 : part->n_modes, NULL,
                               values[i], &error);
    }
    meshreel_end(decoder);
    return code;
}

static bool lacks_memory(int code) {
    return code == MESHREEL_LIMIT || code == MESHREEL_NO_MEMORY;
}

/* Compare a part with its segment opened and decoded alone. */
static void check_part(meshreel_file *whole, uint32_t segment, const reel_part *part) {
    const meshreel_info *info = meshreel_info_of(part->file);
    meshreel_file *file = NULL;
    int code = part->error.code;
    FUZZ_CHECK(code >= 0 && code <= MESHREEL_LIMIT && part->error.message);
    fuzz_hash(&code, 1, sizeof code);
    if (part->count > info->n_frames) {
        FUZZ_CHECK(code != MESHREEL_OK);
        return;
    }
    FUZZ_CHECK(code != MESHREEL_INVALID);
    if (meshreel_open_segment(whole, segment, &file, NULL) == MESHREEL_OK) {
        void *const *values = allocate_values(part, part->count);
        int other = decode_alone(file, part, values);
        FUZZ_CHECK(!code == !other || lacks_memory(code) || lacks_memory(other));
        for (uint32_t i = 0; i < info->n_tracks && !code && !other; i++) {
            meshreel_track track;
            FUZZ_CHECK(meshreel_track_of(file, i, &track) == MESHREEL_OK);
            size_t size = (size_t)track.n_items * track.n_columns * (track.type & 15U);
            FUZZ_CHECK(!memcmp(part->values[i], values[i], part->count * size));
        }
    }
    meshreel_close(file);
}

static void decode_parts(meshreel_file *whole) {
    reel_part parts[MAX_PARTS];
    uint32_t segments[MAX_PARTS], n_parts = 0;
    int64_t n_wanted = 1 + fuzz_below(MAX_PARTS);
    for (int64_t i = 0; i < n_wanted; i++) {
        meshreel_file *file = NULL;
        segments[n_parts] = (uint32_t)fuzz_below(meshreel_info_of(whole)->n_segments);
        if (meshreel_open_segment(whole, segments[n_parts], &file, NULL) == MESHREEL_OK) {
            parts[n_parts++] = make_part(file);
        }
    }
    if (n_parts) {
        reel_decode_parts(parts, n_parts);
    }
    raw_fails_once_in = 0;
    for (uint32_t i = 0; i < n_parts; i++) {
        check_part(whole, segments[i], &parts[i]);
    }
    for (uint32_t i = 0; i < n_parts; i++) {
        meshreel_close(parts[i].file);
    }
}

void fuzz_read_parts(fuzz_bytes bytes) {
    reel_block_store store = make_store();
    reel_host_memory memory = {.store = &store};
    meshreel_source source = {.bytes = bytes.bytes, .size = bytes.size};
    meshreel_host host = {.user = &memory,
                          .allocate = allocate,
                          .release = release,
                          .memory_limit = LIMIT};
    if (fuzz_one_in(4)) {
        host.memory_limit = (uint64_t)1 << (12 + fuzz_below(10));
    }
    if (fuzz_one_in(2)) {
        host.run = fuzz_run_backward;
        host.n_threads = 1 + (uint32_t)fuzz_below(5);
    }
    meshreel_file *whole = NULL;
    if (meshreel_open(&source, &host, &whole, NULL) == MESHREEL_OK) {
        decode_parts(whole);
    }
    meshreel_close(whole);
    FUZZ_CHECK(memory.n_bytes == 0);
    end_store(&store);
}
