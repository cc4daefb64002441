/* Fuzz target: whole files for the decoder in ../reader, valid containers with hostile payloads,
   and damaged ones. */

#include <string.h>

#include "../reader/tracks.h"
#include "fuzz.h"

#define CAPACITY (1 << 18)
#define MAX_STEPS 4
#define MAX_SEGMENTS 4
#define MAX_BLOCKS 4
#define MAX_TRACKS 5

enum { UNKNOWN_SECTION = 192 };
enum { WITH_RESTS = 16, WITH_COSINES = 32, ADAPTIVE = 64 }; /* of the layout of FIELDS */

/* A track other than the positions. */
typedef struct {
    int coding;
    int64_t n_coded;
} track;

/* A file being written. */
typedef struct {
    uint8_t *bytes;
    size_t size;
    fuzz_mesh mesh;  /* of the segment; if it is edited, with other faces than decoded */
    fuzz_mesh base;  /* that CONNECTIVITY describes */
    bool is_edited;
    int32_t steps[2][3][MAX_STEPS]; /* of vertices and faces: kept, dropped, inserted */
    int64_t n_steps[2];
    int method, order, n_tracks; /* including the positions */
    track tracks[MAX_TRACKS];
    int64_t n_frames[MAX_BLOCKS], n_blocks, n_polygons;
    int64_t n_of_mesh; /* sections of the mesh in this segment */
    bool refers;       /* the first ones are those of an earlier segment */
    bool is_compact;
    size_t begins[MAX_BLOCKS + 1], ends[MAX_BLOCKS][MAX_TRACKS];
} stream;

static void put(stream *s, const void *from, size_t size) {
    FUZZ_CHECK(size <= CAPACITY - s->size);
    if (size) {
        memcpy(s->bytes + s->size, from, size);
        s->size += size;
    }
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
    sum = fuzz_one_in(2000) ? sum : ~sum;
    put(s, &sum, sizeof sum);
}

/* Turn the bytes written since `payload` into a section. */
static void end_section(stream *s, int64_t id, size_t payload) {
    size_t length = s->size - payload;
    fuzz_bytes copy = {fuzz_copy(s->bytes + payload, (int64_t)length, 1), length};
    if (fuzz_one_in(60)) {
        copy = fuzz_mutate(copy); /* under a valid checksum */
    }
    bool is_of_surface = id >= REEL_POLYGONS && id <= REEL_HARD_EDGES && id != REEL_TRACK &&
                         id != REEL_START;
    s->n_of_mesh += id == REEL_CONNECTIVITY || id == REEL_ORDER || id == REEL_EDIT || is_of_surface;
    s->size = payload;
    put_byte(s, id);
    put_varint(s, copy.size);
    put(s, copy.bytes, copy.size);
    if (!s->is_compact || id == REEL_END) {
        put_checksum(s, s->is_compact ? 0 : payload);
    }
}

static void put_text(stream *s, const char *text) {
    put_varint(s, strlen(text));
    put(s, text, strlen(text));
}

/* Write rows of integers with the core's coder. */
static void put_rows(stream *s, int32_t *values, const int64_t *lengths, int64_t n_rows) {
    int64_t count = 0, capacity;
    int32_t tables[REEL_CORNER_CONTEXTS + 1];
    for (int32_t i = 0; i < n_rows; i++) {
        count += lengths[i];
        tables[i] = i;
    }
    capacity = 16 * count + 16;
    uint8_t *out = fuzz_allocate(capacity, 1);
    int64_t length =
        reel_integers_encode(FUZZ_MEMORY(reel_integers_memory(n_rows)), values, lengths, tables,
                             n_rows, n_rows, out, (size_t)capacity);
    FUZZ_CHECK(length >= 0);
    put(s, out, (size_t)length);
}

/* Write some random bytes; the last is rarely 0. */
static void put_bits(stream *s) {
    int64_t random = fuzz_below(12);
    for (int64_t i = 0; i < random; i++) {
        put_byte(s, i < random - 1 || fuzz_one_in(9) ? (int64_t)fuzz_next() : 1);
    }
}

/* Write the method and the form of the numbers; returns whether origin and scale are doubles. */
static bool put_codes(stream *s) {
    bool has_doubles = fuzz_one_in(3);
    put_byte(s, s->method);
    put_byte(s, fuzz_one_in(3) + 2 * s->order + 8 * fuzz_below(2) + 32 * has_doubles +
                    64 * s->is_compact);
    return has_doubles;
}

static void put_placement(stream *s, bool has_doubles) {
    for (int i = 0; i < 4; i++) {
        double number = (double)fuzz_below(7) + (i == 3);
        if (has_doubles) {
            put_double(s, number);
        } else {
            put(s, &(float){(float)number}, sizeof(float));
        }
    }
}

static void put_header(stream *s, int64_t announced) {
    const uint8_t magic[9] = {0x89, 'R', 'E', 'E', 'L', '\r', '\n', 0x1A, 3};
    int64_t rate = fuzz_below(50);
    put(s, magic, sizeof magic);
    put_varint(s, (uint64_t)announced);
    put_varint(s, (uint64_t)s->mesh.n_verts);
    put_varint(s, (uint64_t)s->mesh.n_faces);
    put_varint(s, (uint64_t)rate);
    if (!rate) {
        put_double(s, (double)fuzz_below(50));
    }
    put_placement(s, put_codes(s));
    put_byte(s, 0);
    if (!s->is_compact) {
        put_checksum(s, 0);
    }
}

/* ---- the surface ---- */

/* Merge consecutive triangles to polygons. */
static void put_polygons(stream *s) {
    int64_t n = s->mesh.n_faces, left = n;
    int32_t *above = fuzz_allocate(n, sizeof *above);
    for (s->n_polygons = 0; left > 0; s->n_polygons++) {
        int64_t triangles = fuzz_one_in(3) ? 1 + fuzz_below(left < 4 ? left : 4) : 1;
        above[s->n_polygons] = (int32_t)(triangles - 1);
        left -= triangles;
    }
    size_t payload = s->size;
    put_varint(s, (uint64_t)s->n_polygons);
    put_rows(s, above, &s->n_polygons, 1);
    end_section(s, REEL_POLYGONS, payload);
}

static int64_t count_items(const stream *s, int64_t domain) {
    return domain == 0 ? s->mesh.n_verts : domain == 1 ? s->n_polygons
                                                       : s->mesh.n_faces + 2 * s->n_polygons;
}

/* Write references of vertices or faces to rows; returns the number of rows they need. */
static int64_t put_references(stream *s, int64_t domain) {
    int64_t n = count_items(s, domain), n_rows = 0, n_explicit = 0;
    int32_t *values = fuzz_allocate(2 * n, sizeof *values), last = 0;
    for (int64_t i = 0; i < n; i++) {
        values[i] = i ? (int32_t)fuzz_below(3) : 1;
        n_rows += values[i] == 1;
        if (values[i] == 2) {
            int32_t row = (int32_t)fuzz_below(n_rows + fuzz_one_in(20));
            values[n + n_explicit++] = row - last;
            last = row;
        }
    }
    const int64_t lengths[2] = {n, n_explicit};
    put_varint(s, (uint64_t)n_explicit);
    put_rows(s, values, lengths, 2);
    return n_rows;
}

/* Write codes of corners, mostly of one context and for new rows. */
static int64_t put_corner_references(stream *s) {
    int64_t n = count_items(s, 2), left = n, lengths[REEL_CORNER_CONTEXTS + 1] = {0};
    int64_t capacity = 2 * n + 2 * REEL_CORNER_CONTEXTS;
    int32_t *values = fuzz_allocate(capacity, sizeof *values);
    for (int i = 1; i < REEL_CORNER_CONTEXTS; i++) {
        lengths[i] = fuzz_below(left + (fuzz_one_in(30)));
        left -= lengths[i] < left ? lengths[i] : left;
        put_varint(s, (uint64_t)lengths[i]);
    }
    lengths[0] = left;
    lengths[REEL_CORNER_CONTEXTS] = fuzz_below(n + 1);
    put_varint(s, (uint64_t)lengths[REEL_CORNER_CONTEXTS]);
    for (int64_t i = 0; i < capacity; i++) {
        values[i] = fuzz_one_in(3) ? (int32_t)fuzz_below(5) : 1;
    }
    put_rows(s, values, lengths, REEL_CORNER_CONTEXTS + 1);
    return n;
}

static void put_attribute(stream *s) {
    int64_t domain = fuzz_below(3), layout = fuzz_below(3), type = fuzz_below(4);
    int64_t n_rows = count_items(s, domain);
    size_t payload = s->size, begin = s->size;
    fuzz_bytes references = {NULL, 0};
    if (layout) {
        n_rows = domain == 2 ? put_corner_references(s) : put_references(s, domain);
        n_rows += fuzz_one_in(9) ? fuzz_below(9) : 0;
        references = (fuzz_bytes){fuzz_copy(s->bytes + begin, (int64_t)(s->size - begin), 1),
                                  s->size - begin};
        s->size = begin;
    }
    put_byte(s, fuzz_below(3));
    put_byte(s, domain);
    put_byte(s, type);
    put_byte(s, 1 + fuzz_below(fuzz_one_in(9) ? 16 : 3));
    put_text(s, "uv");
    put_byte(s, layout);
    put_varint(s, (uint64_t)n_rows);
    put_varint(s, references.size);
    put(s, references.bytes, references.size);
    put_byte(s, type < 2 || fuzz_one_in(2) ? 255
                : fuzz_one_in(2)           ? fuzz_below(12)
                                           : 64 + fuzz_below(25));
    put_byte(s, fuzz_below(domain == 1 ? 2 : 3));
    put_bits(s);
    end_section(s, REEL_ATTRIBUTE, payload);
}

static void put_groups(stream *s) {
    int64_t n_labels = 1 + fuzz_below(4);
    int32_t *differences = fuzz_allocate(s->n_polygons, sizeof *differences), last = 0;
    for (int64_t i = 0; i < s->n_polygons; i++) {
        int32_t label = (int32_t)fuzz_below(n_labels + 1) - 1;
        differences[i] = label - last;
        last = label;
    }
    size_t payload = s->size;
    put_text(s, "material");
    put_varint(s, (uint64_t)n_labels);
    for (int64_t i = 0; i < n_labels; i++) {
        put_text(s, i ? "red" : "\xC3\xBC");
    }
    put_rows(s, differences, &s->n_polygons, 1);
    end_section(s, REEL_GROUPS, payload);
}

static void put_parts(stream *s) {
    int64_t verts = fuzz_below(s->mesh.n_verts + 1), faces = fuzz_below(s->n_polygons + 1);
    size_t payload = s->size;
    put_varint(s, 2);
    put_varint(s, (uint64_t)verts);
    put_varint(s, (uint64_t)faces);
    put_text(s, "left");
    put_varint(s, (uint64_t)(s->mesh.n_verts - verts));
    put_varint(s, (uint64_t)(s->n_polygons - faces));
    put_text(s, "");
    end_section(s, REEL_PARTS, payload);
}

/* Write the numbers of some edges, as differences; there may be fewer edges. */
static void put_hard_edges(stream *s) {
    int64_t count = 1 + fuzz_below(4);
    int32_t *between = fuzz_allocate(count, sizeof *between);
    for (int64_t i = 0; i < count; i++) {
        between[i] = (int32_t)fuzz_below(3) - fuzz_one_in(30);
    }
    size_t payload = s->size;
    put_varint(s, (uint64_t)count);
    put_rows(s, between, &count, 1);
    end_section(s, REEL_HARD_EDGES, payload);
}

static void put_numbers(stream *s, int64_t count) {
    int64_t present = fuzz_below((int64_t)1 << count);
    put_varint(s, (uint64_t)present);
    for (int64_t i = 0; i < count; i++) {
        if (present >> i & 1) {
            put_double(s, (double)fuzz_below(100) / 8.0);
        }
    }
}

static void put_material(stream *s, int64_t number, int64_t n_images) {
    const char *const names[] = {"red", "", "gold"};
    int64_t slots = n_images ? fuzz_below(64) : 0;
    size_t payload = s->size;
    put_text(s, names[fuzz_one_in(20) ? 0 : number]);
    put_byte(s, fuzz_below(3) | fuzz_below(4) << 2);
    put_numbers(s, 12);
    put_byte(s, slots);
    for (int slot = 0; slot < 6; slot++) {
        if (slots >> slot & 1) {
            bool is_color = slot == 0 || slot == 3 || slot == 5;
            put_varint(s, (uint64_t)fuzz_below(n_images));
            put_text(s, "uv");
            put_byte(s, is_color ? (fuzz_one_in(2) ? 7 : 15) : 1 << fuzz_below(4));
            put_byte(s, fuzz_below(5) | fuzz_below(5) << 4);
            put_byte(s, fuzz_below(3) | fuzz_below(7) << 4);
            put_numbers(s, 5);
        }
    }
    end_section(s, REEL_MATERIAL, payload);
}

static void put_surface(stream *s) {
    int64_t n_images = fuzz_below(3), n_materials = fuzz_below(4);
    for (int64_t i = fuzz_below(3); i > 0; i--) {
        put_attribute(s);
    }
    if (fuzz_one_in(2)) {
        put_groups(s);
    }
    if (fuzz_one_in(3)) {
        put_parts(s);
    }
    if (fuzz_one_in(3)) {
        put_hard_edges(s);
    }
    for (int64_t i = 0; i < n_materials; i++) {
        put_material(s, i, n_images);
    }
    for (int64_t i = 0; i < n_images; i++) {
        size_t payload = s->size;
        put_text(s, "wood");
        put_text(s, "image/png");
        put_bits(s);
        end_section(s, REEL_IMAGE, payload);
    }
}

/* ---- tracks ---- */

/* Write rows of corners: the vertices with several, and the codes of their corners. */
static void put_corner_rows(stream *s) {
    int64_t n_verts = s->mesh.n_verts, n_corners = count_items(s, 2), n_codes = 0;
    int32_t *values = fuzz_allocate(n_verts + n_corners, sizeof *values);
    for (int64_t v = 0; v < n_verts; v++) {
        int64_t n_here = 0;
        for (int64_t i = 0; i < 3 * s->mesh.n_faces; i++) { /* as if all faces were triangles */
            n_here += s->mesh.faces[i] == v;
        }
        values[v] = n_here > 1 && n_codes + n_here - 1 <= n_corners && fuzz_one_in(3);
        for (int64_t k = 1; k < n_here && values[v]; k++) {
            values[n_verts + n_codes++] = (int32_t)fuzz_below(fuzz_one_in(9) ? k + 2 : 2);
        }
    }
    const int64_t lengths[2] = {n_verts, n_codes};
    put_varint(s, (uint64_t)n_codes);
    put_rows(s, values, lengths, 2);
}

static void put_track(stream *s, int number) {
    static const uint8_t types[] = {4, 8, 17, 18, 20, 24, 33, 34, 36, 40};
    char name[] = {(char)('a' + number), 0};
    track *own = &s->tracks[number];
    int64_t domain = fuzz_below(5), type = types[fuzz_below(fuzz_one_in(2) ? 2 : 10)];
    int64_t n_columns = 1 + fuzz_below(fuzz_one_in(9) ? 9 : 3),
            kind = n_columns == 1 ? MESHREEL_TRACK_SCALAR : MESHREEL_TRACK_OTHER;
    bool is_of_vertices = domain == 0 || domain == 3;
    own->coding = type > 8 || fuzz_one_in(3) ? REEL_EXACT : REEL_MODES;
    if (type <= 8 && fuzz_one_in(3)) {
        n_columns = 3;
        kind = is_of_vertices && fuzz_one_in(2) ? MESHREEL_TRACK_VELOCITY : MESHREEL_TRACK_NORMAL;
        own->coding = kind == MESHREEL_TRACK_VELOCITY ? REEL_BACKWARD + (int)fuzz_below(6)
                      : fuzz_one_in(3)                ? REEL_MODES
                                                      : REEL_ROTATIONS;
    }
    own->n_coded = own->coding == REEL_ROTATIONS ? 2 : n_columns;
    bool is_exact = own->coding == REEL_EXACT || own->coding >= REEL_EXACT_BACKWARD;
    size_t payload = s->size;
    put_byte(s, kind);
    put_byte(s, domain);
    put_byte(s, type);
    put_byte(s, own->coding);
    put_text(s, fuzz_one_in(50) ? "a" : name);
    put_text(s, "K");
    put_varint(s, (uint64_t)n_columns);
    if (!is_exact) {
        put_double(s, 0.5);
        put_double(s, 1.0 + (double)fuzz_below(9));
    }
    for (int64_t i = 0; i < n_columns && own->coding == REEL_MODES; i++) {
        put_double(s, (double)fuzz_below(9));
    }
    if (own->coding >= REEL_BACKWARD) {
        put_double(s, fuzz_float());
    }
    if (domain == 4) {
        put_corner_rows(s);
    }
    end_section(s, REEL_TRACK, payload);
}

static void put_edit(stream *s) {
    int64_t lengths[7], n_corners = 0, size = 0;
    for (int kind = 0; kind < 2; kind++) {
        size += 3 * s->n_steps[kind];
        for (int64_t i = 0; kind && i < s->n_steps[kind]; i++) {
            n_corners += 3 * s->steps[kind][2][i];
        }
    }
    n_corners += fuzz_one_in(50) ? 3 : 0;
    int32_t *values = fuzz_allocate(size + n_corners, sizeof *values), *next = values;
    for (int row = 0; row < 6; row++) {
        lengths[row] = s->n_steps[row / 3];
        memcpy(next, s->steps[row / 3][row % 3], (size_t)lengths[row] * sizeof *next);
        next += lengths[row];
    }
    lengths[6] = n_corners;
    for (int64_t i = 0, last = 0; i < n_corners; i++) {
        int64_t vertex = fuzz_one_in(100) ? -1 : fuzz_below(s->mesh.n_verts);
        next[i] = (int32_t)(vertex - last);
        last = vertex;
    }
    size_t payload = s->size;
    put_varint(s, (uint64_t)s->base.n_verts);
    put_varint(s, (uint64_t)s->base.n_faces);
    put_varint(s, (uint64_t)s->n_steps[0]);
    put_varint(s, (uint64_t)s->n_steps[1]);
    put_varint(s, (uint64_t)(n_corners / 3));
    put_rows(s, values, lengths, 7);
    end_section(s, REEL_EDIT, payload);
}

static void put_mesh(stream *s) {
    const fuzz_mesh *mesh = &s->base;
    size_t size = reel_connectivity_encode_memory(mesh->n_verts, mesh->n_faces);
    int64_t capacity = 96 * mesh->n_faces + 1024;
    uint8_t *out = fuzz_allocate(capacity, 1);
    int64_t length =
        reel_connectivity_encode(FUZZ_MEMORY(size), mesh->faces, mesh->n_faces,
                                 mesh->n_verts, fuzz_one_in(6), fuzz_allocate(3 * mesh->n_faces, 4),
                                 NULL, fuzz_allocate(mesh->n_verts, 4), out, (size_t)capacity);
    FUZZ_CHECK(length >= 0);
    size_t payload = s->size;
    put(s, out, (size_t)length);
    end_section(s, REEL_CONNECTIVITY, payload);
    payload = s->size;
    if (s->order < 2) {
        if (fuzz_one_in(2)) {
            put_byte(s, 1 + fuzz_below(2));
            put_bits(s);
            s->size -= s->bytes[s->size - 1] ? 0 : 1; /* trailing zeros are not allowed */
        }
        end_section(s, REEL_ORDER, payload);
    }
    if (s->is_edited) {
        put_edit(s);
    }
    s->n_polygons = s->mesh.n_faces;
    if (fuzz_one_in(3)) {
        put_polygons(s);
    }
}

static void put_leading(stream *s) {
    if (!s->refers) {
        put_mesh(s);
    }
    if (fuzz_one_in(s->refers ? 5 : 2)) {
        put_surface(s);
    }
    for (int i = 1; i < s->n_tracks; i++) {
        put_track(s, i);
    }
    size_t payload = s->size;
    put_double(s, fuzz_float());
    end_section(s, fuzz_one_in(8) ? REEL_START : UNKNOWN_SECTION, payload);
}

/* ---- blocks ---- */

static void put_corrections(stream *s, int64_t n_frames) {
    int64_t n = 1 + fuzz_below(s->mesh.n_verts), more = fuzz_below(n * n_frames - n + 1);
    size_t payload = s->size;
    put(s, &(float){0.25F}, sizeof(float));
    put_varint(s, (uint64_t)n);
    put_varint(s, (uint64_t)(n + more));
    put_bits(s);
    end_section(s, REEL_CORRECTIONS, payload);
}

static void put_fields(stream *s, int64_t number, int64_t n_frames, int64_t n_modes,
                       bool may_miss) {
    size_t payload = s->size;
    int64_t reference = fuzz_one_in(20) ? fuzz_below(9) : fuzz_one_in(2) ? number : 0;
    int64_t flags = fuzz_one_in(4) ? WITH_COSINES : ADAPTIVE * fuzz_below(2);
    flags |= n_frames > 2 && (flags != WITH_COSINES || fuzz_one_in(30)) && fuzz_one_in(2)
                 ? WITH_RESTS
                 : 0;
    put_byte(s, (fuzz_one_in(2) ? 8 : 4) | flags);
    put_varint(s, (uint64_t)reference);
    put(s, &(float){0x1p-12F}, sizeof(float));
    put_varint(s, (uint64_t)(fuzz_one_in(9) ? 1 + fuzz_below(16) : 6));
    put_varint(s, (uint64_t)fuzz_below(9));
    if (flags & WITH_RESTS) { /* fractional bits, and a run: how long after the start, its length */
        put_varint(s, (uint64_t)fuzz_below(REEL_MAX_REST_BITS + 1));
        put_varint(s, 1);
        put_varint(s, (uint64_t)(1 + fuzz_below(n_frames - 1)));
        put_varint(s, (uint64_t)(fuzz_one_in(9) ? n_frames : 1));
    }
    if (reference && fuzz_one_in(3)) {
        put_varint(s, (uint64_t)(1 + fuzz_below(n_modes < 3 ? n_modes : 3)));
        put(s, &(float){2.0F}, sizeof(float));
    }
    end_section(s, REEL_FIELDS, payload);
    payload = s->size;
    put_bits(s);
    end_section(s, REEL_BASIS, payload);
    if (fuzz_one_in(3)) {
        put_corrections(s, n_frames);
    }
    if (may_miss && fuzz_one_in(3)) {
        payload = s->size;
        put_bits(s);
        end_section(s, REEL_MISSING, payload);
    }
    payload = s->size;
    put_bits(s);
    end_section(s, REEL_COEFFICIENTS, payload);
}

static void put_exact(stream *s, bool is_grid, bool has_rounding) {
    size_t payload = s->size;
    if (has_rounding) {
        for (int axis = 0; axis < 3; axis++) {
            put_varint(s, (uint64_t)fuzz_below(4));
        }
        put_bits(s);
        end_section(s, REEL_ROUNDING, payload);
        payload = s->size;
    }
    if (is_grid || has_rounding) {
        double step = fuzz_one_in(4) ? 0.0 : 0x1p-20;
        put_double(s, fuzz_one_in(3) ? -step : step); /* negative: equal frames */
    }
    put_bits(s);
    end_section(s, REEL_VALUES, payload);
}

static void put_block(stream *s, int64_t number, int64_t n_frames) {
    int64_t n_modes = s->method == REEL_METHOD_REEL ? 1 + fuzz_below(3 * n_frames) : 0;
    s->begins[number] = s->size;
    s->n_frames[number] = n_frames;
    size_t payload = s->size;
    put_varint(s, (uint64_t)n_frames);
    put_varint(s, (uint64_t)n_modes);
    end_section(s, REEL_BLOCK, payload);
    if (s->method == REEL_METHOD_REEL) {
        put_fields(s, number, n_frames, n_modes, false);
    } else {
        put_exact(s, s->method == REEL_METHOD_GRID, fuzz_one_in(4));
    }
    s->ends[number][0] = s->size;
    for (int i = 1; i < s->n_tracks; i++) {
        const track *own = &s->tracks[i];
        bool is_exact = own->coding == REEL_EXACT || own->coding >= REEL_EXACT_BACKWARD;
        n_modes = is_exact ? 0 : 1 + fuzz_below(own->n_coded * n_frames);
        payload = s->size;
        put_varint(s, (uint64_t)n_modes);
        end_section(s, REEL_TRACK_BLOCK, payload);
        if (is_exact) {
            put_exact(s, false, false);
        } else {
            put_fields(s, number, n_frames, n_modes, true);
        }
        s->ends[number][i] = s->size;
    }
    s->begins[number + 1] = s->size;
}

static void put_end(stream *s, const stream *index) {
    uint64_t at = s->size;
    size_t payload = s->size;
    if (s->is_compact && !fuzz_one_in(9)) {
        end_section(s, REEL_END, payload);
        return;
    }
    put(s, index->bytes, index->size);
    end_section(s, REEL_INDEX, payload);
    payload = s->size;
    put(s, &at, sizeof at);
    end_section(s, REEL_END, payload);
}

/* ---- segments ---- */

/* Choose steps from `count` items to others; returns the number of these. Few items are dropped if
   others depend on them. */
static int64_t choose_steps(stream *s, int kind, int64_t count) {
    int64_t left = count, result = count;
    s->n_steps[kind] = fuzz_below(MAX_STEPS + 1);
    for (int64_t i = 0; i < s->n_steps[kind]; i++) {
        int64_t kept = fuzz_below(left + 1);
        int64_t dropped = kind || fuzz_one_in(8) ? fuzz_below(left - kept + 1) : 0;
        int64_t inserted = fuzz_one_in(2) ? fuzz_below(4) : 0;
        left -= kept + dropped;
        result += inserted - dropped;
        s->steps[kind][0][i] = (int32_t)(fuzz_one_in(200) ? -1 : kept);
        s->steps[kind][1][i] = (int32_t)dropped;
        s->steps[kind][2][i] = (int32_t)inserted;
    }
    return result ? result : 1;
}

static void choose_mesh(stream *s) {
    s->mesh = fuzz_make_mesh(fuzz_one_in(30) ? 400 : 40);
    if (!s->mesh.n_faces) { /* a file has at least one face */
        s->mesh = (fuzz_mesh){3, 1, fuzz_copy((int32_t[3]){0, 1, 2}, 3, sizeof(int32_t)), NULL};
    }
    s->base = s->mesh;
    s->is_edited = fuzz_one_in(4);
    if (s->is_edited) {
        s->mesh.n_verts = choose_steps(s, 0, s->base.n_verts);
        s->mesh.n_faces = choose_steps(s, 1, s->base.n_faces);
        s->mesh.faces = fuzz_allocate(3 * s->mesh.n_faces, sizeof *s->mesh.faces);
        for (int64_t i = 0; i < 3 * s->mesh.n_faces; i++) {
            s->mesh.faces[i] = (int32_t)fuzz_below(s->mesh.n_verts);
        }
    }
    s->method = fuzz_one_in(40)  ? (int)fuzz_below(11)
                : fuzz_one_in(4) ? 8 + (int)fuzz_below(2)
                                 : REEL_METHOD_REEL;
    s->order = (int)fuzz_below(3);
    s->n_tracks = 1 + (fuzz_one_in(2) ? 1 + (int)fuzz_below(MAX_TRACKS - 1) : 0);
}

static void put_segment(stream *s) {
    size_t payload = s->size;
    put_varint(s, (uint64_t)s->mesh.n_verts);
    put_varint(s, (uint64_t)s->mesh.n_faces);
    bool has_doubles = put_codes(s);
    if (fuzz_one_in(2)) {
        put_placement(s, has_doubles);
    }
    end_section(s, REEL_SEGMENT, payload);
}

/* Continue the mesh of an earlier segment, `distance` before. */
static void put_reference(stream *s, const stream *to, int64_t distance) {
    s->mesh = to->mesh;
    s->order = to->order;
    s->n_polygons = to->n_polygons;
    s->refers = true;
    put_segment(s);
    size_t payload = s->size;
    bool is_wrong = fuzz_one_in(8);
    put_varint(s, (uint64_t)(is_wrong ? fuzz_below(distance + 3) : distance));
    put_varint(s, (uint64_t)(is_wrong ? fuzz_below(3) : 0));
    put_varint(s, (uint64_t)(is_wrong ? fuzz_below(to->n_of_mesh + 2) : to->n_of_mesh));
    for (int i = fuzz_one_in(8) ? 1 + (int)fuzz_below(2) : 0; i > 0; i--) {
        put_varint(s, 1 + (uint64_t)fuzz_below(distance));
        put_varint(s, (uint64_t)fuzz_below(to->n_of_mesh + 1));
        put_varint(s, 1 + (uint64_t)fuzz_below(2));
    }
    end_section(s, REEL_REFERENCE, payload);
}

/* Write a number of the index; rarely any other one. */
static void put_index_number(stream *index, uint64_t value) {
    put_varint(index, fuzz_one_in(200) ? fuzz_next() >> fuzz_below(64) : value);
}

/* Write the index entry of the segment that begins at `at`; 0 for the first. */
static void put_index_entry(stream *index, const stream *s, size_t at) {
    if (at) {
        put_index_number(index, (uint64_t)s->mesh.n_verts);
        put_index_number(index, (uint64_t)s->mesh.n_faces);
        put_index_number(index, (uint64_t)s->n_tracks);
    }
    put_index_number(index, s->begins[0] - at);
    put_index_number(index, (uint64_t)s->n_blocks);
    for (int64_t i = 0; i < s->n_blocks; i++) {
        size_t begin = s->begins[i];
        put_index_number(index, (uint64_t)s->n_frames[i]);
        for (int k = 0; k < s->n_tracks; k++) {
            put_index_number(index, s->ends[i][k] - begin);
            begin = s->ends[i][k];
        }
    }
}

static fuzz_bytes make_stream(void) {
    stream s = {.bytes = fuzz_allocate(CAPACITY, 1)}, index = {.bytes = fuzz_allocate(CAPACITY, 1)};
    int64_t n_segments = fuzz_one_in(3) ? 1 + fuzz_below(MAX_SEGMENTS) : 1, announced = 0;
    int64_t n_blocks[MAX_SEGMENTS], n_frames[MAX_SEGMENTS][MAX_BLOCKS];
    stream written[MAX_SEGMENTS];
    s.is_compact = fuzz_one_in(n_segments == 1 ? 6 : 99);
    for (int64_t k = 0; k < n_segments; k++) {
        n_blocks[k] = 1 + fuzz_below(MAX_BLOCKS);
        for (int64_t i = 0; i < n_blocks[k]; i++) {
            n_frames[k][i] = 1 + fuzz_below(9);
            announced += n_frames[k][i];
        }
    }
    for (int64_t k = 0; k < n_segments; k++) {
        size_t at = s.size;
        choose_mesh(&s);
        s.n_of_mesh = s.refers = 0;
        const stream *earlier = &written[k ? fuzz_below(k) : 0];
        if (k && fuzz_one_in(2) && (!earlier->refers || fuzz_one_in(8))) {
            put_reference(&s, earlier, k - (earlier - written));
        } else if (k) {
            put_segment(&s);
        } else {
            put_header(&s, fuzz_one_in(2) ? 0 : announced);
        }
        put_leading(&s);
        written[k] = s;
        s.n_blocks = n_blocks[k];
        for (int64_t i = 0; i < s.n_blocks; i++) {
            put_block(&s, i, n_frames[k][i]);
        }
        put_index_entry(&index, &s, at);
    }
    if (!fuzz_one_in(5)) {
        put_end(&s, &index);
    } else if (fuzz_one_in(2)) { /* interrupted */
        s.size -= (size_t)fuzz_below((int64_t)s.size / 2);
    }
    return (fuzz_bytes){fuzz_copy(s.bytes, (int64_t)s.size, 1), s.size};
}

static void read_stream(fuzz_bytes bytes) {
    if (fuzz_one_in(3)) {
        fuzz_read_parts(bytes);
    } else {
        fuzz_read_stream(bytes);
    }
}

void fuzz_streams(void) {
    fuzz_bytes bytes = make_stream();
    read_stream(bytes);
    if (fuzz_one_in(3)) {
        read_stream(fuzz_mutate(bytes));
    }
}
