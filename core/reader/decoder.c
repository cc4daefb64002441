/* Decoders: frames of tracks in the caller's layout. docs/format.md, "Frames" and "Tracks". */

#include "values.h"

#define PIECE_BYTES ((uint64_t)16 << 20) /* of values converted or predicted at once */

int meshreel_begin(const meshreel_file *file, meshreel_decoder **decoder, meshreel_error *error) {
    REEL_INVALID_IF(!file || !decoder, "a pointer is NULL");
    *decoder = NULL;
    if (file->info.n_segments > 1) {
        return reel_refuse_several(error);
    }
    reel_call call = reel_begin_file_call(file, 0);
    if (reel_is_of_paper(file)) {
        return reel_end_call(
            &call,
            reel_fail(&call, MESHREEL_METHOD, 31,
                      "the file uses a method of the paper, which only Python decodes"),
            error);
    }
    REEL_INVALID_IF(!file->has_mesh, "the mesh of the file was not read");
    reel_pool pool = {NULL, 0};
    meshreel_decoder *new_decoder = reel_pool_allocate(&call, &pool, 1, sizeof *new_decoder);
    reel_track_state *tracks =
        reel_pool_allocate(&call, &pool, file->info.n_tracks, sizeof *tracks);
    if (!new_decoder || !tracks) {
        reel_release(&file->host, &pool);
        return reel_end_call(&call, call.error.code, error);
    }
    for (uint32_t i = 0; i < file->info.n_tracks; i++) {
        reel_loaded_block empty = {.block = REEL_NO_BLOCK, .fields = {.block = REEL_NO_BLOCK}};
        tracks[i] = (reel_track_state){
            .current = empty, .previous = empty, .key = {.block = REEL_NO_BLOCK}};
    }
    *new_decoder = (meshreel_decoder){.file = file,
                                      .read_positions = reel_first_positions,
                                      .pool = pool,
                                      .tracks = tracks};
    *decoder = new_decoder;
    return reel_end_call(&call, MESHREEL_OK, error);
}

void meshreel_end(meshreel_decoder *decoder) {
    if (!decoder) {
        return;
    }
    meshreel_host host = decoder->file->host;
    for (uint32_t i = 0; i < decoder->file->info.n_tracks; i++) {
        reel_track_state *state = &decoder->tracks[i];
        reel_release(&host, &state->current.pool);
        reel_release(&host, &state->current.fields.pool);
        reel_release(&host, &state->previous.pool);
        reel_release(&host, &state->previous.fields.pool);
        reel_release(&host, &state->key.pool);
    }
    reel_pool pool = decoder->pool; /* contains the decoder itself */
    reel_release(&host, &pool);
}

static reel_call begin_call(const meshreel_decoder *decoder) {
    const meshreel_file *file = decoder->file;
    return reel_begin_file_call(file, reel_decoder_bytes(decoder));
}

static int check_track(const meshreel_decoder *decoder, uint32_t track, uint32_t n_modes,
                       meshreel_error *error) {
    REEL_INVALID_IF(!decoder, "a pointer is NULL");
    REEL_INVALID_IF(track >= decoder->file->info.n_tracks, "the track does not exist");
    bool may_rest = !track && decoder->file->outline.method == REEL_METHOD_REEL;
    return n_modes && !may_rest
               ? reel_invalid(error, "only positions of the method reel have previews")
               : MESHREEL_OK;
}

int meshreel_load(meshreel_decoder *decoder, uint32_t track, uint32_t block, uint32_t n_modes,
                  meshreel_error *error) {
    REEL_TRY(check_track(decoder, track, n_modes, error));
    REEL_INVALID_IF(block >= decoder->file->info.n_blocks, "the block does not exist");
    reel_call call = begin_call(decoder);
    return reel_end_call(&call, reel_load(&call, decoder, track, block, n_modes), error);
}

int meshreel_modes_of(meshreel_decoder *decoder, uint32_t track, uint32_t block,
                      meshreel_modes *modes, meshreel_error *error) {
    REEL_TRY(modes ? meshreel_load(decoder, track, block, 0, error)
                   : reel_invalid(error, "a pointer is NULL"));
    int failed = MESHREEL_OK;
    const reel_track *definition = &decoder->file->tracks[track];
    reel_track_state *state = &decoder->tracks[track];
    reel_loaded_block *current = &state->current;
    *modes = (meshreel_modes){.n_frames = (uint32_t)current->group.n_frames,
                              .n_items = state->items.graph.n_items};
    if (!current->basis || definition->difference || definition->info.coding == REEL_ROTATIONS) {
        return MESHREEL_OK;
    }
    reel_call call = begin_call(decoder);
    if (!reel_loaded_fields(state)) { /* only the packed fields are left */
        reel_forget(&call, decoder, track);
        failed = reel_load(&call, decoder, track, block, 0);
    }
    if (!failed && !current->rows) {
        int32_t *rows = reel_pool_allocate(&call, &current->pool, modes->n_items, sizeof *rows);
        failed = rows ? MESHREEL_OK : call.error.code;
        if (rows) {
            reel_find_field_rows(state, rows);
        }
        current->rows = rows;
    }
    if (!failed) {
        modes->n_modes = (uint32_t)current->n_modes;
        modes->n_columns = definition->n_coded;
        modes->has_missing = current->missing != NULL;
        modes->step = (double)current->group.step;
        modes->scale = definition->placement[0];
        modes->origin = definition->placement + 1;
        modes->values = reel_loaded_fields(state);
        modes->rows = current->rows;
        modes->basis = current->basis;
        modes->shared = state->items.value_of;
        modes->correction_starts = current->corrections.starts;
        modes->corrected = current->corrections.items;
        modes->corrections = current->corrections.offsets;
    }
    return reel_end_call(&call, failed, error);
}

/* Reserve what the tracks of a block announce; a damaged block fails as loading it does. */
static int reserve_block(reel_call *call, const meshreel_file *file, uint32_t block,
                         uint32_t n_modes) {
    for (uint32_t i = 0; i < file->info.n_tracks; i++) {
        const reel_track *track = &file->tracks[i];
        reel_group group;
        int failed = reel_read_group(call, &file->outline, track, i, block, false, &group);
        failed = failed ? failed : reel_reserve_group(call, file, i, &group, i ? 0 : n_modes);
        if (failed) {
            meshreel_error limit = call->error;
            REEL_TRY(reel_read_group(call, &file->outline, track, i, block, true, &group));
            call->error = limit;
            return failed;
        }
    }
    return MESHREEL_OK;
}

int meshreel_check(const meshreel_file *file, uint32_t first, uint32_t count, uint32_t n_modes,
                   meshreel_error *error) {
    REEL_INVALID_IF(!file, "a pointer is NULL");
    const meshreel_info *info = &file->info;
    REEL_INVALID_IF(first > info->n_frames || count > info->n_frames - first,
                    "the frames do not exist");
    if (info->n_segments > 1) {
        return reel_refuse_several(error);
    }
    int64_t stencil;
    reel_call call = reel_begin_file_call(file, file->pool.n_bytes);
    bool is_of_paper = reel_is_of_paper(file);
    int failed = is_of_paper || file->has_mesh ? MESHREEL_OK
                                               : reel_check_mesh(&call, file, &stencil);
    uint64_t own, previous = call.n_bytes = 0, end = is_of_paper ? 0 : (uint64_t)first + count;
    for (uint32_t i = meshreel_block_of_frame(file, first);
         !failed && i < info->n_blocks && file->outline.blocks[i].first < end; i++) {
        failed = reserve_block(&call, file, i, n_modes);
        own = call.n_bytes - previous; /* a decoder keeps the previous block */
        previous = call.n_bytes = own;
    }
    return reel_end_call(&call, failed, error);
}

/* ---- layouts ---- */

typedef struct {
    const int32_t *value_of; /* index of the value of each output item, or NULL */
    uint64_t n_values, n_places;
    uint32_t n_columns, track_bytes, output_bytes; /* bytes per number */
    size_t value_stride, frame_stride;
    bool is_packed;
} output_layout;

static int find_layout(const meshreel_decoder *decoder, uint32_t number,
                       const meshreel_layout *layout, output_layout *result,
                       meshreel_error *error) {
    const reel_track *track = &decoder->file->tracks[number];
    const meshreel_track *info = &track->info;
    uint32_t type = layout && layout->type ? layout->type : info->type;
    if (type != info->type && !(type == MESHREEL_FLOAT32 && info->type == MESHREEL_FLOAT64)) {
        return reel_invalid(error, "a track is decoded to its own type, or from doubles to floats");
    }
    *result = (output_layout){.n_places = info->n_items,
                              .n_columns = info->n_columns,
                              .track_bytes = track->size,
                              .output_bytes = type == info->type ? track->size : 4};
    size_t value = result->output_bytes * result->n_columns;
    result->value_stride = layout && layout->value_stride ? layout->value_stride : value;
    size_t frame = result->value_stride * (size_t)result->n_places;
    result->frame_stride = layout && layout->frame_stride ? layout->frame_stride : frame;
    REEL_INVALID_IF(result->value_stride < value,
                    "values overlap: their stride is below their size");
    REEL_INVALID_IF(result->value_stride % result->output_bytes ||
                        result->frame_stride % result->output_bytes,
                    "a stride is not a multiple of the size of a number");
    result->is_packed = result->value_stride == value && result->frame_stride == frame;
    return MESHREEL_OK;
}

static int store_frame(reel_call *call, const output_layout *output, const uint8_t *values,
                       uint8_t *out) {
    size_t bytes = output->track_bytes * output->n_columns;
    bool is_finite = true;
    for (uint64_t i = 0; i < output->n_places; i++) {
        const uint8_t *value =
            values + bytes * (output->value_of ? (uint64_t)output->value_of[i] : i);
        uint8_t *target = out + output->value_stride * i;
        if (output->output_bytes == output->track_bytes) {
            reel_copy(target, value, bytes);
            continue;
        }
        for (uint32_t column = 0; column < output->n_columns; column++) {
            double number = ((const double *)value)[column];
            float rounded = (float)number;
            is_finite &= rounded - rounded == 0.0F || number - number != 0.0;
            ((float *)target)[column] = rounded;
        }
    }
    return is_finite ? MESHREEL_OK
                     : reel_fail(call, MESHREEL_RANGE, REEL_UNKNOWN,
                                 "a number exceeds float; decode to doubles");
}

/* Decode frames of the current block into the output layout. */
static int decode_to(reel_call *call, meshreel_decoder *decoder, uint32_t number, uint64_t first,
                     uint64_t count, const output_layout *output, uint8_t *out) {
    const reel_track *track = &decoder->file->tracks[number];
    bool is_direct = output->is_packed && !output->value_of &&
                     (!number || output->output_bytes == output->track_bytes);
    bool is_predicted = track->difference || track->info.coding == REEL_ROTATIONS;
    if (is_direct && !is_predicted) {
        return reel_values(call, decoder, number, first, count, output->output_bytes, out);
    }
    uint64_t frame_bytes = output->n_values * output->n_columns * output->track_bytes;
    uint64_t piece_frames = PIECE_BYTES / (frame_bytes + 1) + reel_threads(call);
    for (uint64_t begin = 0; begin < count; begin += piece_frames) {
        uint64_t n = count - begin < piece_frames ? count - begin : piece_frames;
        const reel_chunk *mark = call->scratch.last;
        uint8_t *values =
            is_direct ? out + begin * output->frame_stride : reel_scratch(call, n, frame_bytes);
        REEL_NEED(values);
        REEL_TRY(reel_values(call, decoder, number, first + begin, n, output->track_bytes, values));
        for (uint64_t t = 0; t < n && !is_direct; t++) {
            REEL_TRY(store_frame(call, output, values + t * frame_bytes,
                                 out + (begin + t) * output->frame_stride));
        }
        reel_drop_scratch(call, mark);
    }
    return MESHREEL_OK;
}

int meshreel_decode(meshreel_decoder *decoder, uint32_t track, uint32_t first, uint32_t count,
                    uint32_t n_modes, const meshreel_layout *layout, void *values,
                    meshreel_error *error) {
    output_layout output = {0};
    REEL_TRY(check_track(decoder, track, n_modes, error));
    REEL_TRY(find_layout(decoder, track, layout, &output, error));
    const reel_outline *outline = &decoder->file->outline;
    REEL_INVALID_IF(first > outline->n_frames || count > outline->n_frames - first ||
                    (!values && count), "the frames do not exist, or a pointer is NULL");
    REEL_INVALID_IF((uintptr_t)values % output.output_bytes,
                    "values are not aligned to their number type");
    reel_call call = begin_call(decoder);
    uint64_t n_decoded = 0;
    int failed = MESHREEL_OK;
    while (n_decoded < count && !failed) {
        uint64_t frame = first + n_decoded;
        uint32_t block = meshreel_block_of_frame(decoder->file, (uint32_t)frame);
        uint64_t first_in_block = frame - outline->blocks[block].first;
        uint64_t n = outline->blocks[block].n_frames - first_in_block;
        n = n < count - n_decoded ? n : count - n_decoded;
        failed = reel_load(&call, decoder, track, block, n_modes);
        if (!failed) {
            output.value_of = decoder->tracks[track].items.value_of;
            output.n_values = decoder->tracks[track].items.graph.n_items;
            failed = decode_to(&call, decoder, track, first_in_block, n, &output,
                               (uint8_t *)values + n_decoded * output.frame_stride);
        }
        reel_drop_scratch(&call, NULL);
        n_decoded += n;
    }
    return reel_end_call(&call, failed, error);
}

int meshreel_normals(meshreel_decoder *decoder, uint32_t type, const void *positions,
                     void *normals, meshreel_error *error) {
    REEL_INVALID_IF(!decoder || !positions || !normals, "a pointer is NULL");
    REEL_INVALID_IF(type != MESHREEL_FLOAT32 && type != MESHREEL_FLOAT64,
                    "normals are floats or doubles");
    REEL_INVALID_IF((uintptr_t)positions % type || (uintptr_t)normals % type,
                    "positions or normals are not aligned to their number type");
    const meshreel_file *file = decoder->file;
    int64_t n_verts = file->info.n_verts, n_faces = file->info.n_triangles;
    reel_call call = begin_call(decoder);
    double *output = type == MESHREEL_FLOAT64
                         ? normals
                         : reel_scratch(&call, 3 * (uint64_t)n_verts, sizeof *output);
    if (!output) {
        return reel_end_call(&call, call.error.code, error);
    }
    int64_t result =
        reel_normals(positions, type, 1, n_verts, (const int32_t *)file->mesh.triangles, n_faces,
                     NULL, n_verts, output);
    for (int64_t i = 0; i < 3 * n_verts && type == MESHREEL_FLOAT32; i++) {
        ((float *)normals)[i] = (float)output[i];
    }
    return reel_end_call(
        &call, reel_fail_core(&call, result, 0, "a triangle has an invalid vertex"), error);
}
