/* Decodes blocks of a file, and frames of the block that it holds: docs/format.md, FIELDS to
   "Frames", and VALUES of `lossless` and `grid`. */

#include "file.h"

#define COLUMNS 3
#define NO_BLOCK UINT64_MAX

/* Decoded fields of a block: n_verts x n_modes, in steps, vertices in coding order. */
typedef struct {
    uint64_t block, reference, stencil_size;
    int64_t n_modes;
    double *values;
} block_fields;

struct meshreel_decoder {
    const meshreel_file *file;
    uint64_t block;   /* that is here whole, or NO_BLOCK */
    reel_group group; /* what it says of itself */
    block_fields fields, key;
    double *basis; /* COLUMNS x n_frames x n_modes */
    void *packed;  /* the fields, as frames are multiplied of them */
    reel_moves moves;
    void *exact; /* n_frames x n_verts x COLUMNS, of internal vertices */
    reel_arena for_moves, scratch;
};

/* ---- memory ---- */

static size_t larger(size_t one, size_t other) { return one > other ? one : other; }

static size_t basis_scratch(const reel_outline *outline, const reel_group *group) {
    int64_t n_frames = (int64_t)group->n_frames, n = COLUMNS * n_frames;
    int64_t n_near = reel_time_neighbours(COLUMNS, n_frames);
    size_t fields = reel_fields_memory(n, REEL_TIME_PASSES, n_near);
    size_t vectors = reel_basis_memory(COLUMNS, n_frames);
    return reel_room((size_t)n * (size_t)group->n_modes, sizeof(int32_t)) +
           reel_room((size_t)n_frames, 1) + reel_room((size_t)group->n_reused, sizeof(double)) +
           reel_view_room(outline->source, group->basis.length) +
           reel_time_order_room(COLUMNS, n_frames) + reel_room(larger(fields, vectors), 1);
}

static size_t fields_scratch(const reel_outline *outline, const reel_group *group) {
    int64_t n = (int64_t)outline->n_verts;
    size_t fields = reel_fields_memory(n, REEL_MAX_RESOLUTIONS + 1, n * REEL_NEIGHBOURS);
    size_t n_own = (size_t)(group->n_modes - group->n_reused);
    size_t apart = group->n_reused ? reel_room((size_t)n * n_own, sizeof(double)) : 0;
    return reel_room((size_t)n * n_own, sizeof(int32_t)) + apart +
           reel_view_room(outline->source, group->coefficients.length) + reel_room(fields, 1);
}

static size_t frame_scratch(const reel_group *group) {
    return reel_room(reel_frames_memory(COLUMNS, (int64_t)group->n_modes, 1), 1);
}

static size_t exact_scratch(const reel_outline *outline, const reel_group *group) {
    int64_t n_frames = (int64_t)group->n_frames, n_verts = (int64_t)outline->n_verts;
    return reel_view_room(outline->source, group->values.length) +
           reel_room(reel_exact_memory(n_frames, n_verts, COLUMNS), 1);
}

void reel_add_needs(reel_needs *needs, const reel_outline *outline, const reel_group *group) {
    size_t n_verts = (size_t)outline->n_verts, n_frames = (size_t)group->n_frames;
    size_t n_modes = (size_t)group->n_modes;
    if (outline->method != REEL_METHOD_REEL) {
        needs->exact = larger(needs->exact, COLUMNS * n_verts * n_frames * outline->number_bytes);
        needs->scratch = larger(needs->scratch, exact_scratch(outline, group));
        return;
    }
    needs->values = larger(needs->values, n_verts * n_modes * sizeof(double));
    size_t packed = reel_packed_bytes((int64_t)n_modes, (int64_t)n_verts, group->precision);
    needs->packed = larger(needs->packed, packed);
    needs->basis = larger(needs->basis, COLUMNS * n_frames * n_modes * sizeof(double));
    needs->moves = larger(needs->moves, reel_moves_room(n_frames, group->n_moves));
    needs->scratch = larger(needs->scratch, basis_scratch(outline, group));
    needs->scratch = larger(needs->scratch, reel_moves_scratch(outline, group));
    needs->scratch = larger(needs->scratch, fields_scratch(outline, group));
    needs->scratch = larger(needs->scratch, frame_scratch(group));
    needs->stencils |= 1U << group->stencil_size;
    needs->has_keys |= group->reference != 0;
}

/* For frames, and for their normals. */
static size_t scratch_room(const reel_needs *needs, uint64_t n_verts) {
    return larger(needs->scratch, reel_room(COLUMNS * (size_t)n_verts, sizeof(double)));
}

size_t reel_decoder_room(const reel_needs *needs, uint64_t n_verts) {
    return REEL_SLACK + reel_room(1, sizeof(meshreel_decoder)) +
           (needs->has_keys ? 2 : 1) * reel_room(needs->values, 1) + reel_room(needs->packed, 1) +
           reel_room(needs->basis, 1) + reel_room(needs->moves, 1) + reel_room(needs->exact, 1) +
           reel_room(scratch_room(needs, n_verts), 1);
}

int meshreel_begin(const meshreel_file *file, void *memory, size_t size,
                   meshreel_decoder **decoder) {
    if (!file || !memory || !decoder) {
        return MESHREEL_INVALID;
    }
    const reel_needs *needs = &file->needs;
    reel_arena arena = reel_aligned_arena(memory, size);
    meshreel_decoder *own = reel_take(&arena, 1, sizeof *own);
    if (!own || size < file->info.decoder_bytes) {
        return MESHREEL_NO_MEMORY;
    }
    *own = (meshreel_decoder){.file = file, .block = NO_BLOCK};
    own->fields = own->key = (block_fields){.block = NO_BLOCK};
    own->fields.values = reel_take(&arena, needs->values, 1);
    own->key.values = needs->has_keys ? reel_take(&arena, needs->values, 1) : NULL;
    own->packed = reel_take(&arena, needs->packed, 1);
    own->basis = reel_take(&arena, needs->basis, 1);
    own->exact = reel_take(&arena, needs->exact, 1);
    own->for_moves = reel_arena_of(reel_take(&arena, needs->moves, 1), needs->moves);
    size_t scratch = scratch_room(needs, file->outline.n_verts);
    own->scratch = reel_arena_of(reel_take(&arena, scratch, 1), scratch);
    *decoder = own;
    return arena.failed ? MESHREEL_NO_MEMORY : MESHREEL_OK;
}

/* Whether what a block says of itself is still what it said when the file was opened. */
static bool is_within(const meshreel_file *file, const reel_group *group) {
    reel_needs with = file->needs;
    reel_add_needs(&with, &file->outline, group);
    const reel_needs *needs = &file->needs;
    return with.values == needs->values && with.packed == needs->packed &&
           with.basis == needs->basis && with.moves == needs->moves &&
           with.exact == needs->exact && with.scratch == needs->scratch &&
           with.stencils == needs->stencils && with.has_keys == needs->has_keys;
}

static int read_group(const meshreel_file *file, uint64_t number, reel_group *group) {
    int failed = reel_read_group(&file->outline, &file->places[number], true, group);
    return failed ? failed : is_within(file, group) ? MESHREEL_OK : MESHREEL_CORRUPT;
}

/* ---- blocks of `reel` ---- */

static int decode_rows(const meshreel_file *file, reel_stretch coded, int64_t n_rows,
                       const reel_coding_order *order, reel_arena scratch, int32_t *values) {
    size_t needed = reel_fields_memory(order->n_columns, order->n_passes,
                                       order->near_starts[order->n_columns]);
    const uint8_t *bytes;
    int failed = reel_view(&file->source, coded, &scratch, &bytes);
    void *memory = reel_take(&scratch, needed, 1);
    if (failed || !memory) {
        return failed ? failed : MESHREEL_NO_MEMORY;
    }
    if (!reel_ends(bytes, coded.length)) {
        return MESHREEL_CORRUPT;
    }
    return reel_code_of(reel_fields_decode(memory, needed, bytes, (size_t)coded.length, n_rows,
                                           n_rows, order->n_columns, order->columns,
                                           order->pass_starts, order->n_passes, order->near_starts,
                                           order->near, values));
}

static int decode_basis(meshreel_decoder *own, const reel_group *group) {
    int64_t n_frames = (int64_t)group->n_frames, n_modes = (int64_t)group->n_modes;
    reel_arena scratch = own->scratch;
    reel_coding_order order;
    int32_t *integers = reel_take(&scratch, (size_t)(COLUMNS * n_frames * n_modes),
                                  sizeof *integers);
    uint8_t *rests = reel_take(&scratch, (size_t)n_frames, 1);
    int failed = rests ? reel_read_rests(&own->file->source, group, rests) : MESHREEL_NO_MEMORY;
    if (failed) {
        return failed;
    }
    rests = group->n_rests ? rests : NULL;
    if (!reel_find_time_order(&scratch, COLUMNS, n_frames, rests, &order)) {
        return MESHREEL_NO_MEMORY;
    }
    failed = decode_rows(own->file, group->basis, n_modes, &order, scratch, integers);
    int64_t n_reused = (int64_t)group->n_reused;
    size_t needed = reel_basis_memory(COLUMNS, n_frames);
    void *memory = reel_take(&scratch, needed, 1);
    double *lengths = reel_take(&scratch, (size_t)n_reused, sizeof *lengths);
    if (failed || scratch.failed) {
        return failed ? failed : MESHREEL_NO_MEMORY;
    }
    if (n_reused > 0) {
        reel_lengths(own->key.values, (int64_t)own->file->outline.n_verts, own->key.n_modes,
                     n_reused, (double)group->finer, lengths);
    }
    return reel_code_of(reel_basis(memory, needed, integers, n_modes, COLUMNS, n_frames, rests,
                                   (int64_t)group->rest_bits, lengths, n_reused, own->basis));
}

static int decode_moves(meshreel_decoder *own, const reel_group *group) {
    reel_arena arena = own->for_moves;
    own->moves = (reel_moves){NULL, NULL, NULL};
    if (!group->n_moves) {
        return MESHREEL_OK;
    }
    reel_moves found;
    found.starts = reel_take(&arena, (size_t)group->n_frames + 1, sizeof *found.starts);
    found.vertices = reel_take(&arena, (size_t)group->n_moves, sizeof *found.vertices);
    found.moves = reel_take(&arena, COLUMNS * (size_t)group->n_moves, sizeof *found.moves);
    if (arena.failed) {
        return MESHREEL_NO_MEMORY;
    }
    own->moves = found;
    return reel_read_moves(&own->file->outline, group, own->file->outward, own->scratch, &found);
}

/* Puts fields of a block behind the first ones of its key block, vertex by vertex. */
static void join(const block_fields *key, size_t n_reused, const double *own, size_t n_own,
                 size_t n_verts, double *values) {
    for (size_t v = 0; v < n_verts; v++) {
        double *here = values + v * (n_reused + n_own);
        reel_copy(here, key->values + v * (size_t)key->n_modes, n_reused * sizeof *here);
        reel_copy(here + n_reused, own + v * n_own, n_own * sizeof *here);
    }
}

/* The fields of a block, which has a key block or none. */
static int decode_fields(meshreel_decoder *own, uint64_t block, const reel_group *group,
                         const block_fields *key, block_fields *found) {
    const reel_field_mesh *mesh = own->file->meshes[group->stencil_size];
    int64_t n_verts = (int64_t)own->file->outline.n_verts, n_modes = (int64_t)group->n_modes;
    int64_t n_reused = (int64_t)group->n_reused, n_own = n_modes - n_reused;
    reel_arena scratch = own->scratch;
    int32_t *residuals = reel_take(&scratch, (size_t)(n_verts * n_own), sizeof *residuals);
    found->block = NO_BLOCK;
    if (!residuals) {
        return MESHREEL_NO_MEMORY;
    }
    int failed = decode_rows(own->file, group->coefficients, n_own, &mesh->order, scratch,
                             residuals);
    double *values = found->values;
    if (n_reused > 0) {
        values = reel_take(&scratch, (size_t)(n_verts * n_own), sizeof *values);
    }
    if (failed || scratch.failed) {
        return failed ? failed : MESHREEL_NO_MEMORY;
    }
    reel_fields fields = {.n_verts = n_verts, .n_modes = n_own,
                          .n_learned = (int64_t)group->n_learned, .residuals = residuals,
                          .values = values};
    fields.n_key = key ? key->n_modes : 0;
    fields.key = key ? key->values : NULL;
    failed = reel_code_of(reel_predict_decode(&mesh->mesh, &fields, 0, n_verts));
    if (n_reused > 0) {
        join(key, (size_t)n_reused, values, (size_t)n_own, (size_t)n_verts, found->values);
    }
    *found = (block_fields){failed ? NO_BLOCK : block, group->reference, group->stencil_size,
                            n_modes, found->values};
    return failed;
}

/* Has the fields of the block that another one refers to in `key`. */
static int find_key(meshreel_decoder *own, uint64_t block, const reel_group *group) {
    if (group->reference > block) {
        return MESHREEL_CORRUPT;
    }
    uint64_t wanted = block - group->reference;
    if (own->key.block != wanted && own->fields.block == wanted) {
        block_fields before = own->key;
        own->key = own->fields;
        own->fields = before;
    }
    if (own->key.block != wanted) {
        reel_group of_key;
        int failed = read_group(own->file, wanted, &of_key);
        failed = failed || !of_key.reference ? failed : MESHREEL_CORRUPT;
        failed = failed ? failed : decode_fields(own, wanted, &of_key, NULL, &own->key);
        if (failed) {
            return failed;
        }
    }
    bool fits = !own->key.reference && own->key.stencil_size == group->stencil_size &&
                (int64_t)group->n_reused <= own->key.n_modes;
    return fits ? MESHREEL_OK : MESHREEL_CORRUPT;
}

static int pack_fields(meshreel_decoder *own, const reel_group *group) {
    const meshreel_file *file = own->file;
    int64_t n_modes = own->fields.n_modes, n_verts = (int64_t)file->outline.n_verts;
    return reel_code_of(reel_pack(own->fields.values, 1, n_modes, (double)group->step,
                                  (int64_t)group->precision, file->meshes[group->stencil_size]->rows,
                                  n_modes, n_verts, 0, n_verts, own->packed));
}

static int load_fields(meshreel_decoder *own, uint64_t block, const reel_group *group) {
    int failed = group->reference ? find_key(own, block, group) : MESHREEL_OK;
    failed = failed ? failed : decode_basis(own, group);
    failed = failed ? failed : decode_moves(own, group);
    const block_fields *key = group->reference ? &own->key : NULL;
    failed = failed ? failed : decode_fields(own, block, group, key, &own->fields);
    return failed ? failed : pack_fields(own, group);
}

/* ---- blocks of `lossless` and `grid` ---- */

static bool is_on_grid(const meshreel_decoder *own) {
    return own->file->outline.method == REEL_METHOD_GRID && own->group.grid > 0.0;
}

static int load_exact(meshreel_decoder *own, const reel_group *group) {
    const meshreel_file *file = own->file;
    int64_t n_frames = (int64_t)group->n_frames, n_verts = (int64_t)file->outline.n_verts;
    reel_arena scratch = own->scratch;
    size_t needed = reel_exact_memory(n_frames, n_verts, COLUMNS);
    const uint8_t *bytes;
    int failed = reel_view(&file->source, group->values, &scratch, &bytes);
    void *memory = reel_take(&scratch, needed, 1);
    if (failed || !memory) {
        return failed ? failed : MESHREEL_NO_MEMORY;
    }
    bool is_grid = is_on_grid(own);
    int64_t size = is_grid ? (int64_t)sizeof(int32_t) : (int64_t)file->outline.number_bytes;
    return reel_code_of(reel_exact_decode(
        memory, needed, bytes, (size_t)group->values.length, own->exact, n_frames, n_verts, COLUMNS,
        size, is_grid ? REEL_SIGNED_INTEGERS : REEL_FLOATS, file->neighbours.starts,
        file->neighbours.near));
}

/* ---- frames ---- */

/* The number of the block of a frame, which exists. */
static uint64_t block_number(const meshreel_file *file, uint32_t frame) {
    uint64_t first = 0, end = file->outline.n_blocks;
    while (end - first > 1) {
        uint64_t middle = first + (end - first) / 2;
        if (file->places[middle].first <= frame) {
            first = middle;
        } else {
            end = middle;
        }
    }
    return first;
}

int meshreel_block_of(const meshreel_file *file, uint32_t frame, uint32_t *first,
                      uint32_t *n_frames) {
    if (!file || !first || !n_frames || frame >= file->info.n_frames) {
        return MESHREEL_INVALID;
    }
    const reel_place *place = &file->places[block_number(file, frame)];
    *first = place->first;
    *n_frames = place->n_frames;
    return MESHREEL_OK;
}

int meshreel_load(meshreel_decoder *decoder, uint32_t frame) {
    if (!decoder || frame >= decoder->file->info.n_frames) {
        return MESHREEL_INVALID;
    }
    uint64_t block = block_number(decoder->file, frame);
    if (decoder->block == block) {
        return MESHREEL_OK;
    }
    decoder->block = NO_BLOCK;
    int failed = read_group(decoder->file, block, &decoder->group);
    if (failed) {
        return failed;
    }
    failed = decoder->file->outline.method == REEL_METHOD_REEL
                 ? load_fields(decoder, block, &decoder->group)
                 : load_exact(decoder, &decoder->group);
    decoder->block = failed ? NO_BLOCK : block;
    return failed;
}

static int multiply(meshreel_decoder *own, int64_t time, int64_t layout, void *out) {
    const reel_outline *outline = &own->file->outline;
    const reel_group *group = &own->group;
    int64_t n_modes = (int64_t)group->n_modes, n_frames = (int64_t)group->n_frames;
    size_t needed = reel_frames_memory(COLUMNS, n_modes, 1);
    reel_arena scratch = own->scratch;
    void *memory = reel_take(&scratch, needed, 1);
    if (!memory) {
        return MESHREEL_NO_MEMORY;
    }
    int32_t wanted = (int32_t)time;
    const int64_t *moved = own->moves.starts ? own->moves.starts + time : NULL;
    return reel_code_of(reel_frames(memory, needed, own->basis, own->packed,
                                    (int64_t)group->precision, COLUMNS, n_frames, n_modes,
                                    (int64_t)outline->n_verts, &wanted, 1, moved,
                                    own->moves.vertices, own->moves.moves, outline->placement,
                                    layout, out));
}

/* A number of a frame of exact positions: of internal vertex and column. */
static double exact_number(const meshreel_decoder *own, int64_t place, int column) {
    const reel_outline *outline = &own->file->outline;
    if (is_on_grid(own)) {
        double units = (double)((const int32_t *)own->exact)[place] * own->group.grid;
        double found = units * outline->placement[0] + outline->placement[1 + column];
        return outline->number_bytes == 4 ? (double)(float)found : found;
    }
    return outline->number_bytes == 4 ? (double)((const float *)own->exact)[place]
                                      : ((const double *)own->exact)[place];
}

static void place_exact(const meshreel_decoder *own, int64_t time, int64_t layout, void *out) {
    int64_t n_verts = (int64_t)own->file->outline.n_verts;
    for (int64_t v = 0; v < n_verts; v++) {
        int64_t from = COLUMNS * (time * n_verts + own->file->sequence[v]);
        for (int column = 0; column < COLUMNS; column++) {
            double found = exact_number(own, from + column, column);
            if (layout == REEL_VALUES_4) {
                ((float *)out)[COLUMNS * v + column] = (float)found;
            } else {
                ((double *)out)[COLUMNS * v + column] = found;
            }
        }
    }
}

static bool are_finite(const void *numbers, int64_t layout, int64_t count) {
    bool are = true;
    for (int64_t i = 0; i < count; i++) {
        double one = layout == REEL_VALUES_4 ? (double)((const float *)numbers)[i]
                                             : ((const double *)numbers)[i];
        are &= one - one == 0.0;
    }
    return are;
}

static int decode_frame(meshreel_decoder *decoder, uint32_t frame, int64_t layout, void *out) {
    int failed = out ? meshreel_load(decoder, frame) : MESHREEL_INVALID;
    if (failed) {
        return failed;
    }
    const reel_outline *outline = &decoder->file->outline;
    int64_t time = (int64_t)(frame - decoder->file->places[decoder->block].first);
    if (outline->method == REEL_METHOD_REEL) {
        failed = multiply(decoder, time, layout, out);
    } else {
        place_exact(decoder, time, layout, out);
    }
    if (failed || are_finite(out, layout, COLUMNS * (int64_t)outline->n_verts)) {
        return failed;
    }
    return layout < outline->number_bytes ? MESHREEL_RANGE : MESHREEL_CORRUPT;
}

int meshreel_decode(meshreel_decoder *decoder, uint32_t frame, float *positions) {
    return decode_frame(decoder, frame, REEL_VALUES_4, positions);
}

int meshreel_decode_doubles(meshreel_decoder *decoder, uint32_t frame, double *positions) {
    bool has_doubles = decoder && decoder->file->info.number_bytes == sizeof(double);
    return has_doubles ? decode_frame(decoder, frame, REEL_VALUES_8, positions) : MESHREEL_INVALID;
}

int meshreel_normals(meshreel_decoder *decoder, const float *positions, float *normals) {
    if (!decoder || !positions || !normals) {
        return MESHREEL_INVALID;
    }
    const meshreel_info *info = &decoder->file->info;
    size_t count = COLUMNS * (size_t)info->n_verts;
    reel_arena scratch = decoder->scratch;
    double *found = reel_take(&scratch, count, sizeof *found);
    if (!found) {
        return MESHREEL_NO_MEMORY;
    }
    int64_t result = reel_normals(positions, REEL_VALUES_4, 1, info->n_verts,
                                  (const int32_t *)decoder->file->triangles, info->n_triangles,
                                  NULL, info->n_verts, found);
    for (size_t i = 0; i < count; i++) {
        normals[i] = (float)found[i];
    }
    return reel_code_of(result);
}
