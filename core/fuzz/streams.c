/* Whole streams for the reader of ../reader: sound ones with hostile payloads, and damaged ones. */

#include <string.h>

#include "../reader/meshreel.h"
#include "fuzz.h"

#define ROOM (1 << 16)
#define MOST_BLOCKS 4

enum { CONNECTIVITY = 1, ORDER = 2, BLOCK = 16, BASIS = 17, COEFFICIENTS = 19, FIELDS = 21 };
enum { CORRECTIONS = 22, TRACK_BLOCK = 23, VALUES = 24, UNKNOWN = 192, INDEX = 130, START = 135 };
enum { TRACK = 138, REEL = 7, GRID = 9 };

/* A stream that is written. */
typedef struct {
    uint8_t *bytes;
    size_t size;
    fuzz_mesh mesh;
    int method, order, n_tracks;
    int64_t n_frames[MOST_BLOCKS], n_blocks;
    size_t begins[MOST_BLOCKS + 1], groups[MOST_BLOCKS]; /* bytes of the positions */
} stream;

static void put(stream *s, const void *from, size_t size) {
    FUZZ_CLAIM(size <= ROOM - s->size);
    memcpy(s->bytes + s->size, from, size);
    s->size += size;
}

static void put_byte(stream *s, int64_t value) { put(s, &(uint8_t){(uint8_t)value}, 1); }

static void put_varint(stream *s, uint64_t value) {
    for (; value >= 0x80; value >>= 7) {
        put_byte(s, (int64_t)(value & 0x7F) | 0x80);
    }
    put_byte(s, (int64_t)value);
}

static void put_double(stream *s, double value) { put(s, &value, sizeof value); }

static void put_checksum(stream *s, size_t from) {
    uint32_t sum = ~0U;
    for (size_t i = from; i < s->size; i++) {
        sum ^= s->bytes[i];
        for (int bit = 0; bit < 8; bit++) {
            sum = sum >> 1 ^ (sum & 1U ? 0xEDB88320U : 0U);
        }
    }
    sum = fuzz_once_in(2000) ? sum : ~sum;
    put(s, &sum, sizeof sum);
}

/* What was written from `payload` on becomes a section. */
static void end_section(stream *s, int64_t id, size_t payload) {
    size_t length = s->size - payload;
    fuzz_bytes copy = {fuzz_copy(s->bytes + payload, (int64_t)length, 1), length};
    if (fuzz_once_in(60)) {
        copy = fuzz_mutated(copy); /* below a checksum that fits */
    }
    s->size = payload;
    put_byte(s, id);
    put_varint(s, copy.size);
    put(s, copy.bytes, copy.size);
    put_checksum(s, payload);
}

/* Some bytes at random; the last is rarely 0. */
static void put_bits(stream *s) {
    int64_t random = fuzz_below(12);
    for (int64_t i = 0; i < random; i++) {
        put_byte(s, i < random - 1 || fuzz_once_in(9) ? (int64_t)fuzz_next() : 1);
    }
}

static void put_header(stream *s, int64_t announced) {
    const uint8_t magic[10] = {0x89, 'R', 'E', 'E', 'L', '\r', '\n', 0x1A, 3, 0};
    const uint32_t counts[3] = {(uint32_t)announced, (uint32_t)s->mesh.n_verts,
                                (uint32_t)s->mesh.n_faces};
    put(s, magic, sizeof magic);
    put(s, counts, sizeof counts);
    put_double(s, (double)fuzz_below(50));
    put_byte(s, fuzz_once_in(3) ? 8 : 4);
    put_byte(s, s->method);
    put_byte(s, fuzz_below(2));
    put_byte(s, s->order);
    for (int axis = 0; axis < 3; axis++) {
        put_double(s, (double)fuzz_below(7));
    }
    put_double(s, 1.0 + (double)fuzz_below(9));
    put_byte(s, 0);
    put_byte(s, 0);
    put_checksum(s, 0);
}

static void put_leading(stream *s) {
    const fuzz_mesh *mesh = &s->mesh;
    size_t size = reel_connectivity_encode_memory(mesh->n_verts, mesh->n_faces);
    int64_t room = 96 * mesh->n_faces + 1024;
    uint8_t *out = fuzz_take(room, 1);
    int64_t length = reel_connectivity_encode(
        fuzz_take((int64_t)size, 1), size, mesh->faces, mesh->n_faces, mesh->n_verts,
        fuzz_once_in(6), fuzz_take(3 * mesh->n_faces, 4), fuzz_take(mesh->n_verts, 4), out,
        (size_t)room);
    FUZZ_CLAIM(length >= 0);
    size_t payload = s->size;
    put(s, out, (size_t)length);
    end_section(s, CONNECTIVITY, payload);
    payload = s->size;
    if (s->order < 2) {
        if (fuzz_once_in(2)) {
            put_byte(s, 1 + fuzz_below(2));
            put_bits(s);
            s->size -= s->bytes[s->size - 1] ? 0 : 1; /* zeros at the end are left out */
        }
        end_section(s, ORDER, payload);
    }
    for (int i = 1; i < s->n_tracks; i++) {
        payload = s->size;
        put_bits(s);
        end_section(s, TRACK, payload);
    }
    payload = s->size;
    put_double(s, fuzz_float());
    end_section(s, fuzz_once_in(8) ? START : UNKNOWN, payload);
}

static void put_corrections(stream *s, int64_t n_frames) {
    int64_t n = 1 + fuzz_below(s->mesh.n_verts), more = fuzz_below(n * n_frames - n + 1);
    size_t payload = s->size;
    put(s, &(float){0.25F}, sizeof(float));
    put_varint(s, (uint64_t)n);
    put_varint(s, (uint64_t)(n + more));
    put_bits(s);
    end_section(s, CORRECTIONS, payload);
}

static void put_fields(stream *s, int64_t number, int64_t n_frames, int64_t n_modes) {
    size_t payload = s->size;
    put_byte(s, fuzz_once_in(2) ? 8 : 4);
    put_varint(s, (uint64_t)(fuzz_once_in(20) ? fuzz_below(9) : fuzz_once_in(2) ? number : 0));
    put(s, &(float){0x1p-12F}, sizeof(float));
    put_varint(s, (uint64_t)(fuzz_once_in(9) ? 1 + fuzz_below(16) : 6));
    put_varint(s, (uint64_t)fuzz_below(9));
    end_section(s, FIELDS, payload);
    payload = s->size;
    put_bits(s);
    end_section(s, BASIS, payload);
    if (fuzz_once_in(3)) {
        put_corrections(s, n_frames);
    }
    payload = s->size;
    put_bits(s);
    end_section(s, COEFFICIENTS, payload);
}

static void put_block(stream *s, int64_t number, int64_t n_frames) {
    int64_t n_modes = s->method == REEL ? 1 + fuzz_below(3 * n_frames) : 0;
    s->begins[number] = s->size;
    s->n_frames[number] = n_frames;
    size_t payload = s->size;
    put_varint(s, (uint64_t)n_frames);
    put_varint(s, (uint64_t)n_modes);
    end_section(s, BLOCK, payload);
    payload = s->size;
    if (s->method == REEL) {
        put_fields(s, number, n_frames, n_modes);
    } else {
        if (s->method == GRID) {
            put_double(s, fuzz_once_in(4) ? 0.0 : 0x1p-20);
        }
        put_bits(s);
        end_section(s, VALUES, payload);
    }
    s->groups[number] = s->size - s->begins[number];
    for (int i = 1; i < s->n_tracks; i++) {
        payload = s->size;
        put_varint(s, 0);
        end_section(s, TRACK_BLOCK, payload);
        payload = s->size;
        end_section(s, VALUES, payload);
    }
    s->begins[number + 1] = s->size;
}

static void put_end(stream *s) {
    uint64_t at = s->size;
    size_t payload = s->size;
    put_varint(s, s->begins[0]);
    put_varint(s, (uint64_t)s->n_blocks);
    for (int64_t i = 0; i < s->n_blocks; i++) {
        put_varint(s, (uint64_t)s->n_frames[i]);
        put_varint(s, s->groups[i]);
        size_t rest = s->begins[i + 1] - s->begins[i] - s->groups[i];
        for (int k = 1; k < s->n_tracks; k++) {
            put_varint(s, rest / (size_t)(s->n_tracks - 1));
        }
    }
    end_section(s, INDEX, payload);
    payload = s->size;
    put(s, &at, sizeof at);
    end_section(s, 0, payload);
}

static fuzz_bytes make_stream(void) {
    stream s = {.bytes = fuzz_take(ROOM, 1), .mesh = fuzz_any_mesh(40), .n_tracks = 1};
    if (!s.mesh.n_faces) { /* a stream has one at least */
        s.mesh = (fuzz_mesh){3, 1, fuzz_copy((int32_t[3]){0, 1, 2}, 3, sizeof(int32_t)), NULL};
    }
    s.method = fuzz_once_in(40) ? (int)fuzz_below(11) : fuzz_once_in(4) ? 8 + (int)fuzz_below(2) : REEL;
    s.order = (int)fuzz_below(3);
    s.n_tracks += fuzz_once_in(5) ? 1 + (int)fuzz_below(2) : 0;
    s.n_blocks = 1 + fuzz_below(MOST_BLOCKS);
    int64_t n_frames[MOST_BLOCKS], announced = 0;
    for (int64_t i = 0; i < s.n_blocks; i++) {
        n_frames[i] = 1 + fuzz_below(9);
        announced += n_frames[i];
    }
    put_header(&s, fuzz_once_in(2) ? 0 : announced);
    put_leading(&s);
    for (int64_t i = 0; i < s.n_blocks; i++) {
        put_block(&s, i, n_frames[i]);
    }
    if (!fuzz_once_in(5)) {
        put_end(&s);
    }
    return (fuzz_bytes){fuzz_copy(s.bytes, (int64_t)s.size, 1), s.size};
}

/* ---- reading ---- */

static int read_bytes(void *user, uint64_t offset, void *to, size_t size) {
    const fuzz_bytes *all = user;
    FUZZ_CLAIM(offset <= all->size && size <= all->size - offset);
    memcpy(to, all->bytes + offset, size);
    return 0;
}

static int claim_code(int code) {
    FUZZ_CLAIM(code == MESHREEL_OK || code == MESHREEL_TRUNCATED || code == MESHREEL_CORRUPT ||
               code == MESHREEL_UNSUPPORTED || code == MESHREEL_METHOD || code == MESHREEL_RANGE);
    fuzz_note(&code, 1, sizeof code);
    return code;
}

static void decode_frames(const meshreel_file *file, const meshreel_info *info) {
    meshreel_decoder *decoder;
    void *memory = fuzz_take((int64_t)info->decoder_bytes, 1);
    float *positions = fuzz_take(3 * (int64_t)info->n_verts, sizeof *positions);
    float *normals = fuzz_take(3 * (int64_t)info->n_verts, sizeof *normals);
    FUZZ_CLAIM(meshreel_begin(file, memory, info->decoder_bytes, &decoder) == MESHREEL_OK);
    for (int i = 0; i < 12; i++) {
        uint32_t frame = (uint32_t)fuzz_below(info->n_frames);
        if (!claim_code(meshreel_decode(decoder, frame, positions))) {
            fuzz_note(positions, 3 * (int64_t)info->n_verts, sizeof *positions);
            FUZZ_CLAIM(meshreel_normals(decoder, positions, normals) == MESHREEL_OK);
            fuzz_note(normals, 3 * (int64_t)info->n_verts, sizeof *normals);
        }
    }
    FUZZ_CLAIM(meshreel_load(decoder, info->n_frames) == MESHREEL_INVALID);
}

static void read_stream(fuzz_bytes from) {
    meshreel_source source = {from.bytes, from.size, NULL, NULL};
    if (fuzz_once_in(2)) {
        source = (meshreel_source){NULL, from.size, read_bytes, &from};
    }
    meshreel_info info;
    const meshreel_file *file;
    if (claim_code(meshreel_inspect(&source, &info)) || info.file_bytes > 1 << 24 ||
        info.decoder_bytes > 1 << 24) {
        return;
    }
    void *memory = fuzz_take((int64_t)info.file_bytes, 1);
    if (claim_code(meshreel_open(&source, memory, info.file_bytes, &file))) {
        return;
    }
    const uint32_t *triangles = meshreel_triangles(file);
    for (uint32_t i = 0; i < 3 * info.n_triangles; i++) {
        FUZZ_CLAIM(triangles[i] < info.n_verts);
    }
    fuzz_note(triangles, 3 * (int64_t)info.n_triangles, sizeof *triangles);
    decode_frames(file, &info);
}

void fuzz_streams(void) {
    fuzz_bytes bytes = make_stream();
    read_stream(bytes);
    if (fuzz_once_in(3)) {
        read_stream(fuzz_mutated(bytes));
    }
}
