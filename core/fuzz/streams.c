/* Fuzz target: the stored streams of conformance/, split into sections as in docs/format.md,
   changed, and written with valid checksums. */

#include <glob.h>
#include <stdio.h>
#include <string.h>

#include "../reader/source.h"
#include "fuzz.h"

#define CAPACITY (1 << 18)
#define MAX_FILES 1024
#define MAX_SECTIONS 512
#define MAX_CHANGES 3
#define HEAD_BYTES 9     /* magic and version */
#define LEADING_BYTES 16 /* of a payload, where most of its numbers are */

enum { HAS_DOUBLES = 32, IS_COMPACT = 64 }; /* of the form in the header */

typedef struct {
    uint8_t id;
    fuzz_bytes payload;
} section;

typedef struct {
    fuzz_bytes head, fields; /* of the header */
    bool is_compact;
    int64_t n_sections;
    section sections[MAX_SECTIONS];
} stream;

/* ---- stored streams ---- */

/* Remove and return the next `size` bytes, or what remains if fewer. */
static fuzz_bytes consume(fuzz_bytes *input, uint64_t size) {
    fuzz_bytes result = {input->bytes, size < input->size ? (size_t)size : input->size};
    *input = (fuzz_bytes){input->bytes + result.size, input->size - result.size};
    return result;
}

static uint64_t consume_varint(fuzz_bytes *input) {
    uint64_t result = 0, byte = 0x80;
    for (int shift = 0; shift < 63 && byte & 0x80 && input->size; shift += 7) {
        byte = *consume(input, 1).bytes;
        result |= (byte & 0x7F) << shift;
    }
    return result;
}

static fuzz_bytes read_file(const char *path) {
    static uint8_t buffer[1 << 20];
    static size_t n_read;
    FILE *file = fopen(path, "rb");
    FUZZ_CHECK(file);
    fuzz_bytes result = {buffer + n_read, fread(buffer + n_read, 1, sizeof buffer - n_read, file)};
    n_read += result.size;
    FUZZ_CHECK(n_read < sizeof buffer && !fclose(file));
    return result;
}

static stream *split(fuzz_bytes file) {
    stream *s = fuzz_allocate(1, sizeof *s);
    fuzz_bytes input = file;
    s->head = consume(&input, HEAD_BYTES);
    s->fields = input;
    for (int i = 0; i < 3; i++) { /* frames, vertices, faces */
        consume_varint(&input);
    }
    consume(&input, consume_varint(&input) ? 0 : sizeof(double));
    uint8_t form = consume(&input, 2).bytes[1];
    consume(&input, 4 * (form & HAS_DOUBLES ? sizeof(double) : sizeof(float)));
    consume(&input, consume_varint(&input));
    s->fields.size = (size_t)(input.bytes - s->fields.bytes);
    s->is_compact = form & IS_COMPACT;
    consume(&input, s->is_compact ? 0 : 4);
    for (s->n_sections = 0; input.size; s->n_sections++) {
        FUZZ_CHECK(s->n_sections < MAX_SECTIONS - MAX_CHANGES);
        section *next = &s->sections[s->n_sections];
        next->id = *consume(&input, 1).bytes;
        next->payload = consume(&input, consume_varint(&input));
        consume(&input, s->is_compact && next->id != REEL_END ? 0 : 4);
    }
    return s;
}

/* Stored streams by the ids of their sections, so that streams with rare sections are drawn too. */
static struct {
    fuzz_bytes files[MAX_FILES];
    int64_t n;
} with_id[256];

static void load_files(void) {
    glob_t paths; /* sorted, so that runs are reproducible */
    FUZZ_CHECK(!glob(REEL_FUZZ_STREAMS "/*/*.reel", 0, NULL, &paths));
    FUZZ_CHECK(paths.gl_pathc <= MAX_FILES);
    for (size_t i = 0; i < paths.gl_pathc; i++) {
        fuzz_bytes file = read_file(paths.gl_pathv[i]);
        const stream *s = split(file);
        bool is_new[256];
        memset(is_new, true, sizeof is_new);
        for (int64_t k = 0; k < s->n_sections; k++) {
            uint8_t id = s->sections[k].id;
            if (is_new[id]) {
                with_id[id].files[with_id[id].n++] = file;
            }
            is_new[id] = false;
        }
    }
    globfree(&paths);
}

static uint8_t any_id(void) {
    uint8_t id;
    do {
        id = (uint8_t)fuzz_next();
    } while (!with_id[id].n);
    return id;
}

/* Return a random stream, split, that has a section with this id if any stream has. */
static stream *any_stream(uint8_t id) {
    id = with_id[id].n ? id : any_id();
    return split(with_id[id].files[fuzz_below(with_id[id].n)]);
}

/* ---- writing ---- */

static void put(fuzz_bytes *to, const void *from, size_t size) {
    FUZZ_CHECK(size <= CAPACITY - to->size);
    memcpy(to->bytes + to->size, from, size);
    to->size += size;
}

static void put_byte(fuzz_bytes *to, uint64_t value) { put(to, &(uint8_t){(uint8_t)value}, 1); }

static void put_varint(fuzz_bytes *to, uint64_t value) {
    for (; value >= 0x80; value >>= 7) {
        put_byte(to, value | 0x80);
    }
    put_byte(to, value);
}

static void put_checksum(fuzz_bytes *to, size_t begin) {
    uint32_t sum = ~0U;
    for (size_t i = begin; i < to->size; i++) {
        sum ^= to->bytes[i];
        for (int bit = 0; bit < 8; bit++) {
            sum = sum >> 1 ^ (sum & 1U ? 0xEDB88320U : 0U);
        }
    }
    sum = fuzz_one_in(2000) ? sum : ~sum;
    put(to, &sum, sizeof sum);
}

/* Write a stream with the offset of INDEX in END; in half of all streams, omit INDEX. */
static fuzz_bytes join(const stream *s) {
    fuzz_bytes out = {fuzz_allocate(CAPACITY, 1), 0};
    bool has_index = fuzz_one_in(2);
    uint64_t index_at = 0;
    put(&out, s->head.bytes, s->head.size);
    put(&out, s->fields.bytes, s->fields.size);
    if (!s->is_compact) {
        put_checksum(&out, 0);
    }
    for (int64_t i = 0; i < s->n_sections; i++) {
        section next = s->sections[i];
        size_t begin = out.size;
        if (next.id == REEL_INDEX && !has_index) {
            continue;
        }
        index_at = next.id == REEL_INDEX ? begin : index_at;
        if (next.id == REEL_END && next.payload.size == sizeof index_at) {
            next.payload = (fuzz_bytes){(uint8_t *)&index_at, index_at ? sizeof index_at : 0};
        }
        put_byte(&out, next.id);
        put_varint(&out, fuzz_one_in(2000) ? fuzz_next() >> fuzz_below(64) : next.payload.size);
        put(&out, next.payload.bytes, next.payload.size);
        if (!s->is_compact || next.id == REEL_END) {
            put_checksum(&out, s->is_compact ? 0 : begin);
        }
    }
    return (fuzz_bytes){fuzz_copy(out.bytes, (int64_t)out.size, 1), out.size};
}

/* ---- changes ---- */

/* Return a payload with some bytes replaced: a bit, a number, bytes of another payload. */
static fuzz_bytes change(fuzz_bytes from, fuzz_bytes donor) {
    fuzz_bytes result = {fuzz_allocate(CAPACITY, 1), 0}, input = from;
    int64_t size = (int64_t)from.size, kind = fuzz_below(8);
    int64_t span = size > LEADING_BYTES && fuzz_one_in(2) ? LEADING_BYTES : size + 1;
    fuzz_bytes prefix = consume(&input, (uint64_t)fuzz_below(span));
    put(&result, prefix.bytes, prefix.size);
    if (kind == 0) {
        return fuzz_mutate(from);
    }
    if (kind == 1 && input.size) {
        put_byte(&result, *consume(&input, 1).bytes ^ 1U << fuzz_below(8));
    } else if (kind == 2 || kind == 3) {
        uint64_t number = consume_varint(&input);
        put_varint(&result, fuzz_one_in(3) ? fuzz_next() >> fuzz_below(64)
                                           : number + (uint64_t)fuzz_below(9) - 4);
    } else if (kind == 4) {
        double number = fuzz_float();
        bool is_double = fuzz_one_in(2);
        put(&result, is_double ? (void *)&number : &(float){(float)number}, is_double ? 8 : 4);
        consume(&input, is_double ? sizeof(double) : sizeof(float));
    } else if (kind == 5) {
        consume(&donor, (uint64_t)fuzz_below((int64_t)donor.size + 1));
        donor.size = (size_t)fuzz_below((int64_t)donor.size + 1);
        put(&result, donor.bytes, donor.size);
        consume(&input, fuzz_one_in(2) ? donor.size : 0);
    } else { /* other bits at the end; they are valid unless they end in zeros */
        input.size = 0;
        for (int64_t i = fuzz_below(12); i > 0; i--) {
            put_byte(&result, i > 1 || fuzz_one_in(9) ? fuzz_next() : 1);
        }
    }
    if (fuzz_one_in(3)) { /* fewer numbers take fewer bits */
        input.size = (size_t)fuzz_below((int64_t)input.size + 1);
    }
    put(&result, input.bytes, input.size);
    return (fuzz_bytes){fuzz_copy(result.bytes, (int64_t)result.size, 1), result.size};
}

/* Return the index of a random section of the stream, with this id if there is any. */
static int64_t any_section(const stream *s, uint8_t id) {
    int64_t n = s->n_sections, first = fuzz_below(n);
    for (int64_t i = 0; i < n; i++) {
        if (s->sections[(first + i) % n].id == id) {
            return (first + i) % n;
        }
    }
    return first;
}

static void change_stream(stream *s, uint8_t id) {
    int64_t n = s->n_sections, i = any_section(s, id);
    section *target = &s->sections[i], *other = &s->sections[fuzz_below(n)], old = *target;
    const stream *from = fuzz_one_in(2) ? s : any_stream(target->id);
    section donor = from->sections[any_section(from, target->id)];
    switch (fuzz_below(16)) {
    case 0:
        s->fields = change(s->fields, donor.payload);
        break;
    case 1:
        s->n_sections -= n > 1;
        memmove(target, target + 1, (size_t)(n - 1 - i) * sizeof *target);
        break;
    case 2:
        s->n_sections++;
        memmove(target + 1, target, (size_t)(n - i) * sizeof *target);
        *target = fuzz_one_in(2) ? donor : target[1];
        break;
    case 3:
        *target = *other;
        *other = old;
        break;
    case 4:
        target->id = fuzz_one_in(2) ? other->id : (uint8_t)fuzz_next();
        break;
    case 5:
        target->payload = donor.payload;
        break;
    default:
        target->payload = change(target->payload, donor.payload);
    }
}

/* ---- the target ---- */

void fuzz_streams(void) {
    if (!with_id[REEL_END].n) {
        load_files();
    }
    uint8_t id = any_id();
    stream *s = any_stream(id);
    for (int i = 0; i < MAX_CHANGES && !fuzz_one_in(i ? 2 : 10); i++) {
        change_stream(s, fuzz_one_in(i ? 3 : 100) ? any_id() : id);
    }
    fuzz_bytes bytes = join(s);
    bytes = fuzz_one_in(12) ? fuzz_mutate(bytes) : bytes; /* truncated, or with wrong checksums */
    fuzz_read_stream(bytes);
}
