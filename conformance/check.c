/* Decodes a stream with the core alone: `check IN.reel OUT`, for machines without Python.

   OUT holds the internal faces (int32), and of `reel` for each block its basis and coefficients
   (int32) and its positions (of the vertex type, vertices in internal order), then the same of
   further tracks; of `lossless`, `grid` and exact tracks no integers. Of other methods only faces are
   decoded, and no tracks of faces and corners.
   Streams are those of conformance/streams: nothing that comes in is checked. */

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "reel.h"

enum { BLOCK = 16, BASIS = 17, COEFFICIENTS = 19, FIELDS = 21, CORRECTIONS = 22, TRACK_BLOCK = 23 };
enum { VALUES = 24, MISSING = 25 };
enum { TRACK = 138, REEL = 7, LOSSLESS = 8, GRID = 9, MOST_TRACKS = 8, MOST_BLOCKS = 100 };

typedef struct {
    const uint8_t *at, *end;
} bytes;

static void fail(const char *what) {
    fprintf(stderr, "%s failed\n", what);
    exit(1);
}

static int64_t done(int64_t result, const char *what) {
    if (result < 0) {
        fail(what);
    }
    return result;
}

static void *room(size_t size) {
    void *found = aligned_alloc(64, (size + 127) / 64 * 64);
    if (!found) {
        fail("memory");
    }
    return found;
}

static int64_t varint(bytes *in) {
    int64_t value = 0;
    for (int shift = 0;; shift += 7) {
        value |= (int64_t)(*in->at & 127) << shift;
        if (!(*in->at++ & 128)) {
            return value;
        }
    }
}

static void take(bytes *in, void *to, size_t size) {
    memcpy(to, in->at, size);
    in->at += size;
}

/* What a stream has for all its blocks. */
typedef struct {
    uint32_t n_verts, n_faces;
    uint8_t method, vertex_type;
    void *positions; /* of the block */
    int32_t *faces, *starts, *near;
    int64_t n_near;
} stream;

/* The hierarchy of its mesh for a size of stencils. */
typedef struct {
    reel_mesh mesh;
    int32_t *order, *columns, *near;
    int64_t *pass_starts, *near_starts;
    int64_t n_passes;
} hierarchy;

typedef struct {
    bool is_of_vertices, has_normals;
    uint8_t number_type, coding;
    int64_t n_columns, n_coded;
    double *placement; /* scale and origin */
    double rate;
} track;

enum { BY_MODES = 0, EXACT = 1, TURNS = 2, BACKWARD = 3, CENTRAL = 4, FORWARD = 5, EXACT_BACKWARD = 6 };

typedef struct {
    bool is_of_positions;
    int64_t n_frames, n_modes, precision, reference, size, n_learned, n_reused;
    float step, finer;
    double *values;  /* n_verts x n_modes */
    double *lengths; /* of the fields that are reused */
    uint8_t *rests;  /* of each time; NULL if none rests */
    int64_t rest_bits;
} block;

static hierarchy hierarchy_of(const stream *s, int64_t size) {
    int64_t n = s->n_verts;
    hierarchy h = {.order = room(4 * n), .columns = room(4 * n), .near = room(32 * n)};
    int32_t *levels = room(4 * (REEL_MAX_LEVELS + 1)), *resolutions = room(4 * REEL_MAX_LEVELS);
    int64_t *smooth_starts = room(8 * REEL_MAX_LEVELS);
    int32_t *stencil = room(4 * n * size), *contexts = room(32 * n);
    uint8_t *hops = room(n * size);
    float *smooth = room(4UL * REEL_SMOOTH_ROWS * REEL_SMOOTH_FIELDS * n);
    size_t needed = reel_hierarchy_memory(n, s->n_near);
    int64_t n_levels = done(
        reel_hierarchy(room(needed), needed, s->starts, s->near, n, size, h.order, levels,
                       resolutions, smooth_starts, stencil, hops, contexts, smooth),
        "hierarchy");
    h.mesh = (reel_mesh){n, n_levels, size, levels, smooth_starts, stencil, hops, smooth};
    h.pass_starts = room(8 * (REEL_MAX_LEVELS + 1));
    h.near_starts = room(8 * (n + 1));
    h.pass_starts[0] = h.near_starts[0] = 0;
    for (int64_t i = 0; i < n_levels; i++) {
        if (i + 1 == n_levels || resolutions[i + 1] != resolutions[i]) {
            h.pass_starts[++h.n_passes] = levels[i + 1];
        }
    }
    int64_t count = 0;
    for (int64_t i = 0; i < n; i++) {
        h.columns[i] = (int32_t)i;
        for (int k = 0; k < REEL_NEIGHBOURS && contexts[i * REEL_NEIGHBOURS + k] >= 0; k++) {
            h.near[count++] = contexts[i * REEL_NEIGHBOURS + k];
        }
        h.near_starts[i + 1] = count;
    }
    return h;
}

static int32_t *read_fields(bytes in, int64_t n_rows, int64_t n_columns, const int32_t *columns,
                            const int64_t *pass_starts, int64_t n_passes,
                            const int64_t *near_starts, const int32_t *near, FILE *out) {
    int32_t *values = room(4 * n_rows * n_columns);
    size_t needed = reel_fields_memory(n_columns, n_passes, near_starts[n_columns]);
    done(reel_fields_decode(room(needed), needed, in.at, (size_t)(in.end - in.at), n_rows,
                            n_rows, n_columns, columns, pass_starts, n_passes, near_starts, near,
                            values),
         "fields");
    fwrite(values, 4, (size_t)(n_rows * n_columns), out);
    return values;
}

static uint8_t *read_rests(bytes *layout, int64_t n_frames, int64_t *rest_bits) {
    uint8_t *rests = room(n_frames);
    memset(rests, 0, (size_t)n_frames);
    *rest_bits = varint(layout);
    int64_t n_runs = varint(layout), end = 0;
    for (int64_t i = 0; i < n_runs; i++) {
        int64_t start = end + varint(layout);
        end = start + varint(layout);
        memset(rests + start, 1, (size_t)(end - start));
    }
    return rests;
}

/* "Passes by times" of the page: times of moving ones, in three levels, then those that rest. */
static int32_t *read_basis(bytes in, int64_t n_modes, int64_t width, int64_t n,
                           const uint8_t *rests, FILE *out) {
    int32_t *columns = room(4 * width * n), *near = room(4 * width * n * 6);
    int32_t *times = room(4 * n), *resting = room(4 * n);
    int64_t *near_starts = room(8 * (width * n + 1)), pass_starts[5] = {0}, n_passes = 0;
    int64_t place = 0, count = 0, n_moving = 0, n_resting = 0;
    const int64_t first[4] = {0, 2, 1, 0}, apart[4] = {4, 4, 2, 1}, d[3] = {2, 2, 1};
    for (int64_t t = 0; t < n; t++) {
        if (rests && rests[t]) {
            resting[n_resting++] = (int32_t)t;
        } else {
            times[n_moving++] = (int32_t)t;
        }
    }
    near_starts[0] = 0;
    for (int level = 0; level < (n_resting ? 4 : 3); level++) {
        bool is_last = level == 3;
        for (int64_t own = 0; own < width; own++) {
            for (int64_t i = first[level]; i < (is_last ? n_resting : n_moving); i += apart[level]) {
                int64_t t = is_last ? resting[i] : times[i];
                for (int k = level ? 0 : 2; k < 4 && !is_last; k++) {
                    const int64_t offsets[4] = {-1, 1, -2, -4};
                    int64_t other = i + offsets[k] * d[level];
                    if (other >= 0 && other < n_moving) {
                        near[count++] = (int32_t)(own * n + times[other]);
                    }
                }
                for (int64_t u = t - 1; u >= 0 && u >= t - 2 && is_last; u--) {
                    if (rests[u]) {
                        near[count++] = (int32_t)(own * n + u);
                    }
                }
                for (int64_t before = own < 2 ? 0 : own - 2; before < own; before++) {
                    near[count++] = (int32_t)(before * n + t);
                }
                columns[place++] = (int32_t)(own * n + t);
                near_starts[place] = count;
            }
        }
        pass_starts[++n_passes] = place;
    }
    return read_fields(in, n_modes, width * n, columns, pass_starts, n_passes, near_starts, near,
                       out);
}

/* Corrections by frame: where those of each begin, their vertices and how far they move. */
typedef struct {
    int64_t *starts;
    int32_t *vertices;
    double *moves;
} corrections;

static corrections read_corrections(bytes in, int64_t width, int64_t n_frames) {
    float step;
    take(&in, &step, 4);
    int64_t n = varint(&in), all = varint(&in), total = 2 * n + (1 + width) * all;
    int64_t *lengths = room(8 * (3 + width));
    int32_t *tables = room(4 * (3 + width));
    for (int32_t i = 0; i < 3 + width; i++) {
        lengths[i] = i < 2 ? n : all;
        tables[i] = i < 3 ? i : 3;
    }
    int32_t *v = room(4 * total);
    size_t needed = reel_integers_memory(4);
    done(reel_integers_decode(room(needed), needed, in.at, (size_t)(in.end - in.at), lengths,
                              tables, 3 + width, 4, v),
         "corrections");
    int32_t *frames = v + 2 * n, *offsets = frames + all, *vertex_of = room(4 * all), vertex = 0;
    for (int64_t i = 0, k = 0; i < n; i++) {
        vertex += v[i];
        for (int64_t j = 0; j <= v[n + i]; j++, k++) {
            bool follows = j && frames[k] == 1;
            frames[k] += j ? frames[k - 1] : 0;
            for (int64_t c = 0; c < width; c++) {
                offsets[c * all + k] += follows ? offsets[c * all + k - 1] : 0;
            }
            vertex_of[k] = vertex;
        }
    }
    corrections found = {room(8 * (n_frames + 1)), room(4 * all), room(8 * width * all)};
    int64_t count = 0;
    for (int64_t t = 0; t < n_frames; t++) { /* vertices ascend in the list, and so in a frame */
        found.starts[t] = count;
        for (int64_t k = 0; k < all; k++) {
            if (frames[k] == t) {
                found.vertices[count] = vertex_of[k];
                for (int64_t c = 0; c < width; c++) {
                    found.moves[width * count + c] = offsets[c * all + k] * (double)step;
                }
                count++;
            }
        }
    }
    found.starts[n_frames] = count;
    return found;
}

/* Divides normals by their lengths; one that is shorter than a half becomes 0. */
static void to_unit_length(void *normals, uint8_t number_type, int64_t count) {
    for (int64_t at = 0; at < count; at += 3) {
        double one[3];
        for (int i = 0; i < 3; i++) {
            one[i] = number_type == 4 ? ((float *)normals)[at + i] : ((double *)normals)[at + i];
        }
        double length = sqrt((one[0] * one[0] + one[1] * one[1]) + one[2] * one[2]);
        for (int i = 0; i < 3; i++) {
            double found = length < 0.5 ? 0.0 : one[i] / length;
            if (number_type == 4) {
                ((float *)normals)[at + i] = (float)found;
            } else {
                ((double *)normals)[at + i] = found;
            }
        }
    }
}

/* Exact values of the vertices: of a number type as TRACK says it. */
static void *read_exact(const stream *s, bytes in, int64_t n_frames, int64_t width, int number_type) {
    int size = number_type % 16; /* 16 and 32 more of integers */
    int type = number_type < 16 ? REEL_FLOATS
               : number_type < 32 ? REEL_UNSIGNED_INTEGERS : REEL_SIGNED_INTEGERS;
    void *values = room((size_t)(n_frames * s->n_verts * width * size));
    size_t needed = reel_exact_memory(n_frames, s->n_verts, width);
    done(reel_exact_decode(room(needed), needed, in.at, (size_t)(in.end - in.at), values, n_frames,
                           s->n_verts, width, size, type, s->starts, s->near),
         "exact values");
    return values;
}

/* Positions of `grid`: behind the step, integers, or if it is 0 what they stand for. */
static void *read_grid(const stream *s, const track *of, bytes in, int64_t n_frames) {
    double step;
    memcpy(&step, in.at, 8);
    in.at += 8;
    if (step == 0) {
        return read_exact(s, in, n_frames, 3, of->number_type);
    }
    const int32_t *places = read_exact(s, in, n_frames, 3, 36);
    int64_t count = 3 * n_frames * s->n_verts;
    void *values = room(count * of->number_type);
    for (int64_t i = 0; i < count; i++) {
        double value = places[i] * step * of->placement[0] + of->placement[1 + i % 3];
        if (of->number_type == 4) {
            ((float *)values)[i] = (float)value;
        } else {
            ((double *)values)[i] = value;
        }
    }
    return values;
}

/* Makes NaN of the values that are missing. */
static void drop_missing(const stream *s, const track *of, bytes in, int64_t n_frames, void *values) {
    int64_t count = n_frames * s->n_verts * of->n_columns;
    uint8_t *is_missing = read_exact(s, in, n_frames, of->n_columns, 17);
    for (int64_t i = 0; i < count; i++) {
        if (is_missing[i] && of->number_type == 4) {
            ((float *)values)[i] = NAN;
        } else if (is_missing[i]) {
            ((double *)values)[i] = NAN;
        }
    }
}

static double number_at(const void *values, int number_type, int64_t place) {
    return number_type == 4 ? ((const float *)values)[place] : ((const double *)values)[place];
}

/* The difference of positions at a frame from those beside it: of number i of each frame. */
static double difference(const stream *s, int coding, int64_t n_frames, int64_t t, int64_t i) {
    int64_t first = t > 0 ? t - 1 : 0, second = t + 1 < n_frames ? t + 1 : t;
    bool is_inside = t > 0 && t + 1 < n_frames;
    if (is_inside && coding == BACKWARD) {
        second = t;
    } else if (is_inside && coding == FORWARD) {
        first = t;
    }
    int64_t row = 3LL * s->n_verts;
    double apart = number_at(s->positions, s->vertex_type, second * row + i) -
                   number_at(s->positions, s->vertex_type, first * row + i);
    return is_inside && coding == CENTRAL ? apart / 2.0 : apart;
}

/* Floats from the integers that lead to them from what differences of positions let expect. */
static void move_places(const stream *s, const track *of, int64_t n_frames, void *places) {
    int64_t row = 3LL * s->n_verts;
    for (int64_t i = 0; i < row * n_frames; i++) {
        double expected = of->rate * difference(s, of->coding - 3, n_frames, i / row, i % row);
        if (of->number_type == 4) {
            float rounded = isfinite((float)expected) ? (float)expected : 0.0F;
            uint32_t bits, by;
            memcpy(&bits, &rounded, 4);
            memcpy(&by, (uint8_t *)places + 4 * i, 4);
            bits = (bits >> 31 ? bits ^ 0x7FFFFFFFU : bits) + by;
            bits = bits >> 31 ? bits ^ 0x7FFFFFFFU : bits;
            memcpy((uint8_t *)places + 4 * i, &bits, 4);
        } else {
            double rounded = isfinite(expected) ? expected : 0.0;
            uint64_t bits, by;
            memcpy(&bits, &rounded, 8);
            memcpy(&by, (uint8_t *)places + 8 * i, 8);
            bits = (bits >> 63 ? bits ^ 0x7FFFFFFFFFFFFFFFU : bits) + by;
            bits = bits >> 63 ? bits ^ 0x7FFFFFFFFFFFFFFFU : bits;
            memcpy((uint8_t *)places + 8 * i, &bits, 8);
        }
    }
}

/* Values that positions let expect, changed by what is decoded. */
static void *predicted(const stream *s, const track *of, const double *decoded, int64_t n_frames) {
    int64_t n = s->n_verts, count = 3 * n * n_frames;
    void *values = room((size_t)(count * of->number_type));
    if (of->coding == TURNS) {
        double *normals = room((size_t)(8 * count));
        done(reel_normals(s->positions, s->vertex_type, n_frames, n, s->faces, s->n_faces, NULL, n,
                          normals),
             "normals");
        done(reel_turned(normals, decoded, n * n_frames, of->number_type, values), "turning");
        return values;
    }
    for (int64_t i = 0; i < count; i++) {
        double apart = difference(s, of->coding, n_frames, i / (3 * n), i % (3 * n));
        double found = of->rate * apart + decoded[i];
        if (of->number_type == 4) {
            ((float *)values)[i] = (float)found;
        } else {
            ((double *)values)[i] = found;
        }
    }
    return values;
}

static void write_frames(stream *s, const track *of, const hierarchy *h, const block *b,
                         const int32_t *integers, bytes coded_moves, bytes missing, FILE *out) {
    int64_t n = s->n_verts, n_modes = b->n_modes, n_frames = b->n_frames, width = of->n_coded;
    int64_t decoded_type = of->coding == BY_MODES ? of->number_type : 8;
    double *basis = room(8 * width * n_frames * n_modes), *fields = room(8 * n_modes * n);
    size_t needed = reel_basis_memory(width, n_frames);
    done(reel_basis(room(needed), needed, integers, n_modes, width, n_frames, b->rests,
                    b->rest_bits, b->lengths, b->n_reused, basis),
         "basis");
    for (int64_t i = 0; i < n; i++) {
        for (int64_t mode = 0; mode < n_modes; mode++) {
            fields[mode * n + h->order[i]] = (double)b->step * b->values[i * n_modes + mode];
        }
    }
    corrections moved = {NULL, NULL, NULL};
    if (coded_moves.at) {
        moved = read_corrections(coded_moves, width, n_frames);
    }
    int32_t *wanted = room(4 * n_frames);
    for (int64_t t = 0; t < n_frames; t++) {
        wanted[t] = (int32_t)t;
    }
    size_t count = (size_t)(width * n_frames * n);
    void *values = room(count * (size_t)decoded_type);
    void *packed = room(reel_packed_bytes(n_modes, n, b->precision));
    done(reel_pack(fields, n, 1, 1.0, b->precision, NULL, n_modes, n, 0, n, packed), "fields");
    needed = reel_frames_memory(width, n_modes, n_frames);
    done(reel_frames(room(needed), needed, basis, packed, b->precision, width, n_frames, n_modes,
                     n, wanted, n_frames, moved.starts, moved.vertices, moved.moves, of->placement,
                     decoded_type, values),
         "frames");
    if (b->is_of_positions) {
        s->positions = values;
    }
    if (of->coding != BY_MODES) {
        values = predicted(s, of, values, n_frames);
        count = (size_t)(of->n_columns * n_frames * n);
    } else if (of->has_normals) {
        to_unit_length(values, of->number_type, (int64_t)count);
    }
    if (missing.at) {
        drop_missing(s, of, missing, n_frames, values);
    }
    fwrite(values, of->number_type, count, out);
}

/* Fields of a block, behind the first ones of its key block. */
static double *with_reused(double *own, int64_t n_own, const block *key, int64_t n_reused, int64_t n_verts) {
    if (!n_reused) {
        return own;
    }
    int64_t n_modes = n_reused + n_own;
    double *all = room(8UL * (size_t)(n_verts * n_modes));
    for (int64_t v = 0; v < n_verts; v++) {
        memcpy(all + v * n_modes, key->values + v * key->n_modes, 8UL * (size_t)n_reused);
        memcpy(all + v * n_modes + n_reused, own + v * n_own, 8UL * (size_t)n_own);
    }
    return all;
}

static block read_block(stream *s, const track *of, const bytes *sections, int64_t n_frames,
                        const block *before, FILE *out) {
    bytes head = sections[sections[BLOCK].at ? BLOCK : TRACK_BLOCK], layout = sections[FIELDS];
    if (sections[BLOCK].at) {
        varint(&head);
    }
    block b = {.n_frames = n_frames, .is_of_positions = sections[BLOCK].at != NULL};
    b.n_modes = varint(&head);
    uint8_t number = *layout.at++;
    b.precision = number & ~16;
    b.reference = varint(&layout);
    take(&layout, &b.step, 4);
    b.size = varint(&layout);
    b.n_learned = varint(&layout);
    if (number & 16) {
        b.rests = read_rests(&layout, n_frames, &b.rest_bits);
    }
    if (layout.at < layout.end) {
        b.n_reused = varint(&layout);
        take(&layout, &b.finer, 4);
    }
    int64_t n_own = b.n_modes - b.n_reused;
    hierarchy h = hierarchy_of(s, b.size);
    int32_t *basis = read_basis(sections[BASIS], b.n_modes, of->n_coded, n_frames, b.rests, out);
    int32_t *residuals = read_fields(sections[COEFFICIENTS], n_own, s->n_verts, h.columns,
                                     h.pass_starts, h.n_passes, h.near_starts, h.near, out);
    const block *key = b.reference ? before - b.reference : NULL;
    double *own = room(8UL * s->n_verts * (size_t)n_own);
    reel_fields fields = {s->n_verts, n_own, b.n_learned, key ? key->n_modes : 0,
                          residuals,  own,   key ? key->values : NULL};
    done(reel_predict_decode(&h.mesh, &fields, 0, s->n_verts), "prediction");
    b.values = with_reused(own, n_own, key, b.n_reused, s->n_verts);
    if (b.n_reused) {
        b.lengths = room(8UL * (size_t)b.n_reused);
        done(reel_lengths(key->values, s->n_verts, key->n_modes, b.n_reused, b.finer, b.lengths), "lengths");
    }
    write_frames(s, of, &h, &b, basis, sections[CORRECTIONS], sections[MISSING], out);
    return b;
}

static stream read_header(bytes *in, track *positions) {
    stream s = {0};
    uint16_t length;
    memcpy(&s.n_verts, in->at + 14, 4);
    memcpy(&s.n_faces, in->at + 18, 4);
    s.vertex_type = in->at[30];
    *positions = (track){true, false, in->at[30], BY_MODES, 3, 3, room(32), 0.0};
    s.method = in->at[31];
    memcpy(positions->placement + 1, in->at + 34, 24);
    memcpy(positions->placement, in->at + 58, 8);
    memcpy(&length, in->at + 66, 2);
    in->at += 72 + length;
    return s;
}

static track read_track(bytes in) {
    track found = {.is_of_vertices = in.at[1] == 0, .has_normals = in.at[0] == 3, .number_type = in.at[2]};
    found.coding = in.at[3];
    in.at += 4;
    for (int text = 0; text < 2; text++) { /* name and unit */
        int64_t length = varint(&in);
        in.at += length;
    }
    found.n_columns = varint(&in);
    found.n_coded = found.coding == TURNS ? 2 : found.n_columns;
    if (found.coding >= EXACT_BACKWARD) {
        memcpy(&found.rate, in.at, 8);
    }
    if (found.coding == EXACT || found.coding >= EXACT_BACKWARD) {
        return found;
    }
    found.placement = room(8 * (1 + found.n_columns));
    for (int64_t i = 0; i <= found.n_columns; i++) {
        found.placement[i] = 0.0;
    }
    int64_t given = found.coding == BY_MODES ? 1 + found.n_columns : 1;
    memcpy(found.placement, in.at + 8, (size_t)(8 * given)); /* behind the bound */
    if (found.coding >= BACKWARD) {
        memcpy(&found.rate, in.at + 16, 8);
    }
    return found;
}

static void read_faces(stream *s, bytes in, FILE *out) {
    s->faces = room(12UL * s->n_faces);
    s->starts = room(4UL * (s->n_verts + 1));
    s->near = room(24UL * s->n_faces);
    size_t needed = reel_connectivity_decode_memory(s->n_verts, s->n_faces);
    done(reel_connectivity_decode(room(needed), needed, in.at, (size_t)(in.end - in.at),
                                  s->n_verts, s->n_faces, s->faces),
         "connectivity");
    fwrite(s->faces, 12, s->n_faces, out);
    needed = reel_adjacency_memory(s->n_verts, s->n_faces);
    s->n_near = done(reel_adjacency(room(needed), needed, s->faces, s->n_faces, s->n_verts,
                                    s->starts, s->near),
                     "adjacency");
}

static bytes whole_file(const char *name) {
    FILE *file = fopen(name, "rb");
    if (!file) {
        fail("opening");
    }
    uint8_t *data = room(1 << 20);
    size_t size = fread(data, 1, 1 << 20, file);
    fclose(file);
    return (bytes){data, data + size};
}

int main(int count, char **names) {
    FILE *out = count == 3 ? fopen(names[2], "wb") : NULL;
    if (!out) {
        fail("usage: check IN.reel OUT");
    }
    bytes in = whole_file(names[1]), sections[256];
    track tracks[MOST_TRACKS];
    stream s = read_header(&in, tracks);
    static block blocks[MOST_TRACKS][MOST_BLOCKS];
    int n_tracks = 1, number = 0, n_blocks = 0;
    memset(sections, 0, sizeof sections);
    for (int id = -1; id != 0;) {
        id = *in.at++;
        int64_t size = varint(&in);
        if (id == BLOCK || id == TRACK_BLOCK) {
            memset(sections, 0, sizeof sections);
            number = id == BLOCK ? 0 : number + 1;
            n_blocks += id == BLOCK;
        }
        sections[id] = (bytes){in.at, in.at + size};
        if (id == 1) {
            read_faces(&s, sections[id], out);
        } else if (id == TRACK) {
            tracks[n_tracks++] = read_track(sections[id]);
        } else if (id == BLOCK) {
            bytes head = sections[id];
            blocks[0][n_blocks - 1].n_frames = varint(&head);
        }
        bool has_tracks = s.method == REEL || s.method == LOSSLESS || s.method == GRID;
        if (id == COEFFICIENTS && has_tracks && tracks[number].is_of_vertices) {
            block *own = blocks[number] + n_blocks - 1; /* the section is the last of a track */
            int64_t n_frames = blocks[0][n_blocks - 1].n_frames;
            *own = read_block(&s, tracks + number, sections, n_frames, own, out);
        }
        if (id == VALUES && tracks[number].is_of_vertices) {
            track *of = tracks + number;
            int64_t n_frames = blocks[0][n_blocks - 1].n_frames;
            int64_t one = of->number_type % 16;
            int type = of->coding >= EXACT_BACKWARD ? of->number_type + 32 : of->number_type;
            void *values = number == 0 && s.method == GRID
                               ? read_grid(&s, of, sections[id], n_frames)
                               : read_exact(&s, sections[id], n_frames, of->n_columns, type);
            if (of->coding >= EXACT_BACKWARD) {
                move_places(&s, of, n_frames, values);
            }
            s.positions = number ? s.positions : values;
            fwrite(values, one, n_frames * s.n_verts * of->n_columns, out);
        }
        in.at += size + 4;
    }
    return fclose(out) ? 1 : 0;
}
