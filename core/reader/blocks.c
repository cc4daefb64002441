/* Decoding of a track's block: docs/format.md, FIELDS to "Prediction", and VALUES. */

#include "blocks.h"

#include "cell_mesh.h"
#include "points.h"

/* Minimum number of modes that a preview decodes; static ones keep their mean over the block. */
#define MIN_PREVIEW_MODES 16
#define MIN_SHARED 512 /* minimum vertices of a level that is split among threads */
#define MAX_TASK 16384 /* vertices per task */
#define PACK_TILE 64 /* ranges of values begin at multiples of this */
#define BATCH 16     /* vertices that the predictor processes at once */
#define N_AXES 3
#define MAX_RELATIONS 8 /* in a chain of related tracks */

static int fail_corrupt(reel_call *call, const meshreel_decoder *decoder, uint64_t block,
                        uint32_t track, const char *message) {
    return reel_corrupt(call, reel_group_bytes(&decoder->file->outline, block, track).offset,
                        message);
}

/* ---- items and hierarchies ---- */

/* Whether two tracks have the same items: equal domains and equal bytes of rows. */
static int have_same_rows(reel_call *call, const reel_track *track, const reel_track *other,
                          bool *are_same) {
    const uint8_t *bytes_a, *bytes_b;
    *are_same = track->info.domain == other->info.domain && track->sharing == other->sharing &&
                track->rows.length == other->rows.length;
    if (!*are_same || !track->rows.length) {
        return MESHREEL_OK;
    }
    const reel_chunk *mark = call->scratch.last;
    *are_same = false;
    REEL_TRY(reel_view(call, track->rows, &bytes_a));
    REEL_TRY(reel_view(call, other->rows, &bytes_b));
    *are_same = reel_equal_bytes(bytes_a, bytes_b, (size_t)track->rows.length);
    reel_drop_scratch(call, mark);
    return MESHREEL_OK;
}

/* Share the items of another track on the same graph, if they are known. */
static int share_items(reel_call *call, meshreel_decoder *decoder, uint32_t number) {
    const reel_track *tracks = decoder->file->tracks;
    reel_track_state *state = &decoder->tracks[number];
    for (uint32_t i = 1; i < decoder->file->info.n_tracks && !state->has_items; i++) {
        if (decoder->tracks[i].has_items) {
            REEL_TRY(have_same_rows(call, &tracks[i], &tracks[number], &state->has_items));
            state->items = decoder->tracks[i].items;
        }
    }
    return MESHREEL_OK;
}

static int find_items(reel_call *call, meshreel_decoder *decoder, uint32_t number) {
    const meshreel_file *file = decoder->file;
    reel_track_state *state = &decoder->tracks[number];
    REEL_TRY(share_items(call, decoder, number));
    if (state->has_items) {
        return MESHREEL_OK;
    }
    reel_pool pool = {NULL, 0};
    int failed = reel_find_items(call, &pool, &file->faces, &file->mesh, &file->tracks[number],
                                 &state->items);
    state->has_items = !failed;
    return reel_append(&file->host, failed, &decoder->pool, &pool);
}

static bool is_mesh_of(const reel_field_mesh *mesh, const reel_graph *graph,
                       const reel_group *group) {
    return mesh && mesh->graph->near == graph->near &&
           mesh->mesh.stencil_size == (int64_t)group->stencil_size &&
           (mesh->mesh.smooth || group->nugget > 0.0);
}

/* The hierarchy of a track on the same graph, if it is known. */
static const reel_field_mesh *known_mesh(const meshreel_decoder *decoder, const reel_graph *graph,
                                         const reel_group *group) {
    if (is_mesh_of(decoder->file->field_mesh, graph, group)) {
        return decoder->file->field_mesh;
    }
    for (uint32_t i = 0; i < decoder->file->info.n_tracks; i++) {
        if (is_mesh_of(decoder->tracks[i].mesh, graph, group)) {
            return decoder->tracks[i].mesh;
        }
    }
    return NULL;
}

/* Find the hierarchy of a track, with smooth fields if the group needs them. */
static int find_mesh(reel_call *call, meshreel_decoder *decoder, reel_track_state *state,
                     const reel_group *group) {
    const reel_graph *graph = &state->items.graph;
    state->mesh = known_mesh(decoder, graph, group);
    if (state->mesh) {
        return MESHREEL_OK;
    }
    reel_pool pool = {NULL, 0};
    reel_hierarchy_job *job;
    int failed = reel_prepare_hierarchy(call, &pool, graph, (int64_t)group->stencil_size,
                                        group->nugget == 0.0, &job);
    if (!failed) {
        reel_find_hierarchy(job);
        failed = reel_finish_hierarchy(call, job, &state->mesh);
    }
    state->mesh = failed ? NULL : state->mesh;
    return reel_append(&decoder->file->host, failed, &decoder->pool, &pool);
}

/* Parse the group of a track after `find_items`. */
static int read_group(reel_call *call, const meshreel_decoder *decoder, uint32_t track,
                      uint64_t block, reel_group *group) {
    const reel_outline *outline = &decoder->file->outline;
    uint64_t n_items = decoder->tracks[track].items.graph.n_items;
    REEL_TRY(reel_read_group(call, outline, &decoder->file->tracks[track], track, block, true,
                             group));
    bool fits = group->n_corrected <= n_items &&
                group->n_corrections <= group->n_frames * n_items;
    return fits ? MESHREEL_OK
                : fail_corrupt(call, decoder, block, track,
                               "there are more corrections than values");
}

/* ---- fields ---- */

/* Coded rows of integers, and the order of their columns. */
typedef struct {
    const reel_coding_order *order;
    const uint8_t *bytes;
    uint64_t offset, size;
    int64_t n_rows, n_read;
    int32_t *values;
    void *memory;
    size_t memory_size;
    int64_t result;
} coded_fields;

static int prepare_rows(reel_call *call, reel_range data, const reel_coding_order *order,
                        uint64_t n_rows, uint64_t n_read, coded_fields *result) {
    *result = (coded_fields){.order = order,
                             .offset = data.offset,
                             .size = data.length,
                             .n_rows = (int64_t)n_rows,
                             .n_read = (int64_t)n_read};
    result->memory_size =
        reel_fields_memory(order->n_columns, order->n_passes, order->near_starts[order->n_columns]);
    result->memory = reel_scratch(call, result->memory_size, 1);
    bool is_small = n_read <= REEL_MAX_NUMBERS / (uint64_t)order->n_columns;
    result->values =
        reel_scratch(call, is_small ? n_read * (uint64_t)order->n_columns : REEL_MAX_NUMBERS,
                     sizeof *result->values);
    REEL_NEED(result->memory && result->values);
    REEL_TRY(reel_view(call, data, &result->bytes));
    return reel_is_stripped(result->bytes, data.length)
               ? MESHREEL_OK
               : reel_corrupt(call, data.offset + data.length - 1, "fields end with a zero byte");
}

static void decode_rows(coded_fields *rows) {
    const reel_coding_order *order = rows->order;
    rows->result = reel_fields_decode(
        rows->memory, rows->memory_size, rows->bytes, (size_t)rows->size, rows->n_rows,
        rows->n_read, order->n_columns, order->columns, order->pass_starts, order->n_passes,
        order->near_starts, order->near, rows->values);
}

/* The parts of a block that are decoded in parallel. */
typedef struct {
    coded_fields fields, times;
    reel_coding_order time_order;
    void *basis_memory;
    size_t basis_memory_size;
    int64_t n_columns, n_frames, n_reused, rest_bits;
    bool has_cosines, is_adaptive;
    uint8_t *rests;
    double *lengths, *basis; /* `basis` is NULL if only fields are needed */
    double finer;
    const reel_block_fields *key;
    const reel_mesh *mesh;
    reel_fields predicted;
    int64_t result;
} block_job;

static void decode_basis(block_job *job) {
    decode_rows(&job->times);
    if (job->times.result < 0) {
        return;
    }
    if (job->n_reused > 0) {
        reel_lengths(job->key->values, job->mesh->n_verts, (int64_t)job->key->n_modes,
                     job->n_reused, job->finer, job->lengths);
    }
    if (job->has_cosines) {
        job->result = reel_cosine_basis(job->basis_memory, job->basis_memory_size,
                                        job->times.values, job->times.n_read, job->n_columns,
                                        job->n_frames, job->lengths, job->n_reused, job->basis);
        return;
    }
    job->result =
        reel_basis(job->basis_memory, job->basis_memory_size, job->times.values, job->times.n_read,
                   job->n_columns, job->n_frames, job->rests, job->rest_bits, job->is_adaptive,
                   job->lengths, job->n_reused, job->basis);
}

static void run_block_job(void *shared, uint32_t i) {
    block_job *job = shared;
    if (!i) {
        decode_rows(&job->fields);
        return;
    }
    if (job->basis) {
        decode_basis(job);
    }
}

/* Independent ranges of a level, or one range that spans several levels. */
typedef struct {
    const reel_mesh *mesh;
    reel_fields *fields;
    int64_t first, end, task_size;
} level_tasks;

static void predict_task(void *shared, uint32_t i) {
    level_tasks *tasks = shared;
    reel_fields fields = *tasks->fields;
    int64_t first = tasks->first + i * tasks->task_size, end = first + tasks->task_size;
    reel_predict_decode(tasks->mesh, &fields, first, end < tasks->end ? end : tasks->end);
}

static void run_tasks(const reel_call *call, level_tasks *tasks) {
    int64_t count = tasks->end - tasks->first;
    if (count > 0) {
        reel_run(call, predict_task, tasks,
                 (uint32_t)((count + tasks->task_size - 1) / tasks->task_size),
                 (uint64_t)(count * tasks->fields->n_modes));
    }
}

/* Vertices per task of a level: the same number of tasks for each thread, more in larger levels. */
static int64_t vertices_per_task(int64_t n_verts, int64_t n_threads) {
    int64_t per_thread = n_verts / n_threads / MIN_SHARED;
    per_thread = per_thread < 1 ? 1 : per_thread > 4 ? 4 : per_thread;
    int64_t n_batches = (n_verts + BATCH - 1) / BATCH, n_tasks = n_threads * per_thread;
    int64_t result = (n_batches + n_tasks - 1) / n_tasks * BATCH;
    return result < MAX_TASK ? result : MAX_TASK;
}

/* Predict fields level by level, splitting large levels among threads unless fields are related. */
static void predict(const reel_call *call, const reel_mesh *mesh, reel_fields *fields) {
    int64_t n_threads = fields->n_related ? 1 : reel_threads(call), n_done = 0;
    for (int64_t level = 0; level < mesh->n_levels; level++) {
        int64_t first = mesh->level_starts[level], end = mesh->level_starts[level + 1];
        if (n_threads > 1 && end - first >= MIN_SHARED) {
            run_tasks(call, &(level_tasks){mesh, fields, n_done, first, mesh->n_verts});
            run_tasks(call, &(level_tasks){mesh, fields, first, end,
                                           vertices_per_task(end - first, n_threads)});
            n_done = end;
        }
    }
    run_tasks(call, &(level_tasks){mesh, fields, n_done, mesh->n_verts, mesh->n_verts});
}

/* Concatenate, for each item, the reused fields of the key block and the new ones. */
static void concatenate_fields(const reel_block_fields *key, uint64_t n_reused,
                               const double *new_values, uint64_t n_new, uint64_t n_items,
                               double *values) {
    for (uint64_t i = 0; i < n_items; i++) {
        double *row = values + i * (n_reused + n_new);
        reel_copy(row, key->values + i * key->n_modes, (size_t)n_reused * sizeof *row);
        reel_copy(row + n_reused, new_values + i * n_new, (size_t)n_new * sizeof *row);
    }
}

static int prepare_basis(reel_call *call, const reel_group *group, uint32_t n_columns,
                         uint64_t n_modes, block_job *job) {
    job->n_columns = n_columns;
    job->n_frames = (int64_t)group->n_frames;
    job->n_reused = (int64_t)group->n_reused;
    job->finer = (double)group->finer;
    job->rest_bits = (int64_t)group->rest_bits;
    job->has_cosines = group->has_cosines;
    job->is_adaptive = group->is_adaptive;
    REEL_TRY(reel_read_rests(call, group, &job->rests));
    REEL_TRY(reel_find_time_order(call, n_columns, job->n_frames, job->has_cosines, job->rests,
                                  &job->time_order));
    REEL_TRY(prepare_rows(call, group->basis, &job->time_order, group->n_modes, n_modes,
                          &job->times));
    job->basis_memory_size = job->has_cosines ? reel_cosine_basis_memory(n_columns, job->n_frames)
                                              : reel_basis_memory(n_columns, job->n_frames);
    job->basis_memory = reel_scratch(call, job->basis_memory_size, 1);
    job->lengths = reel_scratch(call, group->n_reused, sizeof *job->lengths);
    return job->basis_memory && job->lengths ? MESHREEL_OK : call->error.code;
}

/* Find the initial weights of a track from the positions of a block, in scratch memory. */
static int find_weights(reel_call *call, meshreel_decoder *decoder, uint32_t track, uint64_t block,
                        double nugget, const float **weights) {
    const meshreel_file *file = decoder->file;
    const reel_track_state *state = &decoder->tracks[track];
    void *numbers = reel_scratch(call, 3 * file->outline.n_verts, file->outline.number_bytes);
    REEL_NEED(numbers);
    REEL_TRY(decoder->read_positions(call, decoder, block, numbers));
    return reel_find_weights(call, file, &file->tracks[track], &state->items, state->mesh, numbers,
                             nugget, weights);
}

/* Copy the first fields of a loaded block, or numbers of its first frames on a grid, in coding
   order. */
static void copy_related(const reel_track_state *state, const reel_field_mesh *mesh,
                         uint64_t n_numbers, int64_t n, double *related) {
    const double *fields = state->current.n_modes ? reel_loaded_fields(state) : NULL;
    const int32_t *units = state->current.exact;
    uint64_t n_items = (uint64_t)mesh->mesh.n_verts, n_modes = state->current.n_modes;
    for (uint64_t i = 0; i < n_items; i++) {
        uint64_t item = (uint64_t)mesh->items[i];
        for (uint64_t r = 0; r < (uint64_t)n; r++) {
            related[i * (uint64_t)n + r] =
                fields ? fields[i * n_modes + r]
                       : units[(r / n_numbers * n_items + item) * n_numbers + r % n_numbers];
        }
    }
}

/* Find the fields of the related track of a block, in scratch memory. */
static int find_related(reel_call *call, meshreel_decoder *decoder, uint32_t track,
                        uint64_t block, const reel_group *group, reel_fields *fields) {
    uint32_t other = track - (uint32_t)group->related;
    reel_track_state *state = &decoder->tracks[other];
    const reel_track *definitions = decoder->file->tracks;
    uint64_t n_columns = definitions[other].n_coded;
    bool fits;
    REEL_TRY(have_same_rows(call, &definitions[track], &definitions[other], &fits));
    if (!fits || decoder->n_relations >= MAX_RELATIONS) {
        return fail_corrupt(
            call, decoder, block, track,
            "a track is related to one of other items, or in a chain that is too long");
    }
    decoder->n_relations++;
    int failed = reel_load(call, decoder, other, block, 0);
    if (!failed && state->current.basis && !reel_loaded_fields(state)) {
        reel_forget(call, decoder, other); /* only its packed fields are left */
        failed = reel_load(call, decoder, other, block, 0);
    }
    decoder->n_relations--;
    REEL_TRY(failed);
    decoder->tracks[track].current.n_relations = state->current.n_relations + 1;
    if (decoder->tracks[track].current.n_relations > MAX_RELATIONS) {
        return fail_corrupt(call, decoder, block, track, "a chain of related tracks is too long");
    }
    bool is_grid = state->current.group.grid > 0.0;
    if (!is_grid && !state->current.n_modes) {
        return fail_corrupt(call, decoder, block, track, "a track is related to an exact one");
    }
    uint64_t n_fields =
        is_grid ? n_columns * state->current.group.n_frames : state->current.n_modes;
    int64_t n = n_fields < REEL_MAX_RELATED ? (int64_t)n_fields : REEL_MAX_RELATED;
    double *related = reel_scratch(call, (uint64_t)(fields->n_verts * n), sizeof *related);
    fields->regression = reel_scratch(call, (uint64_t)(n * (n + 2 * fields->n_modes)),
                                      sizeof *fields->regression);
    REEL_NEED(related && fields->regression);
    copy_related(state, decoder->tracks[track].mesh, n_columns, n, related);
    fields->n_related = n;
    fields->related = related;
    return MESHREEL_OK;
}

/* Decode the first n_modes fields of a block, and its basis unless `basis` is NULL. */
static int decode_fields(reel_call *call, meshreel_decoder *decoder, uint32_t track,
                         uint64_t block, const reel_group *group, uint64_t n_modes,
                         const reel_block_fields *key, double *basis, reel_block_fields *output) {
    const reel_field_mesh *field_mesh = decoder->tracks[track].mesh;
    reel_mesh mesh = field_mesh->mesh;
    uint32_t n_columns = decoder->file->tracks[track].n_coded;
    uint64_t n_items = (uint64_t)mesh.n_verts, n_reused = group->n_reused;
    uint64_t n_new = n_modes - n_reused;
    block_job job = {.mesh = &mesh, .key = key, .basis = basis};
    const reel_chunk *mark = call->scratch.last;
    if (group->nugget > 0.0) {
        REEL_TRY(find_weights(call, decoder, track, block, group->nugget, &mesh.weights));
    }
    output->values =
        reel_pool_allocate(call, &output->pool, n_items * n_modes, sizeof *output->values);
    double *new_values =
        n_reused ? reel_scratch(call, n_items * n_new, sizeof *new_values) : output->values;
    REEL_NEED(output->values && new_values);
    REEL_TRY(prepare_rows(call, group->coefficients, &field_mesh->order, group->n_modes - n_reused,
                          n_new, &job.fields));
    if (basis) {
        REEL_TRY(prepare_basis(call, group, n_columns, n_modes, &job));
    }
    job.predicted = (reel_fields){.n_verts = (int64_t)n_items,
                                  .n_modes = (int64_t)n_new,
                                  .n_learned = (int64_t)group->n_learned,
                                  .residuals = job.fields.values,
                                  .values = new_values,
                                  .n_key = key ? (int64_t)key->n_modes : 0,
                                  .key = key ? key->values : NULL};
    if (group->related) {
        REEL_TRY(find_related(call, decoder, track, block, group, &job.predicted));
    }
    reel_run(call, run_block_job, &job, 2, (n_items + n_columns * group->n_frames) * n_modes);
    REEL_TRY(reel_fail_core(call, job.fields.result, job.fields.offset, "the fields are damaged"));
    REEL_TRY(
        reel_fail_core(call, job.times.result, job.times.offset, "the temporal basis is damaged"));
    REEL_TRY(reel_fail_core(call, job.result, job.times.offset, "the temporal basis is damaged"));
    if (n_new) {
        predict(call, &mesh, &job.predicted);
    }
    if (n_reused) {
        concatenate_fields(key, n_reused, new_values, n_new, n_items, output->values);
    }
    reel_drop_scratch(call, mark);
    output->block = n_modes == group->n_modes ? block : REEL_NO_BLOCK;
    output->reference = group->reference;
    output->stencil_size = group->stencil_size;
    output->n_modes = n_modes;
    return MESHREEL_OK;
}

static void release_fields(reel_call *call, reel_block_fields *fields) {
    call->n_bytes -= fields->pool.n_bytes;
    reel_release(call->host, &fields->pool);
    *fields = (reel_block_fields){.block = REEL_NO_BLOCK};
}

/* Load the fields of the key block of a group into state->key. */
static int find_key(reel_call *call, meshreel_decoder *decoder, uint32_t track, uint64_t block,
                    const reel_group *group) {
    reel_track_state *state = &decoder->tracks[track];
    if (group->reference > block) {
        return fail_corrupt(call, decoder, block, track, "a block refers to one before the first");
    }
    uint64_t key_block = block - group->reference;
    if (state->key.block != key_block && state->previous.fields.block == key_block) {
        release_fields(call, &state->key);
        state->key = state->previous.fields;
        state->previous.fields = (reel_block_fields){.block = REEL_NO_BLOCK};
    }
    if (state->key.block != key_block) {
        reel_group key_group;
        release_fields(call, &state->key);
        int failed = read_group(call, decoder, track, key_block, &key_group);
        if (!failed && (key_group.reference || key_group.stencil_size != group->stencil_size)) {
            failed = fail_corrupt(
                call, decoder, block, track,
                "a block refers to a block that is not a key block, or has other stencils");
        }
        failed = failed ? failed : find_mesh(call, decoder, state, &key_group);
        failed = failed ? failed
                        : decode_fields(call, decoder, track, key_block, &key_group,
                                        key_group.n_modes, NULL, NULL, &state->key);
        if (failed) {
            release_fields(call, &state->key);
            return failed;
        }
    }
    bool fits = !state->key.reference && state->key.stencil_size == group->stencil_size &&
                group->n_reused <= state->key.n_modes;
    return fits ? MESHREEL_OK
                : fail_corrupt(
                      call, decoder, block, track,
                      "a block refers to a block that is not a key block, or has too few fields");
}

/* Preview: replace the basis vectors after the first n_moving by their mean. */
static void freeze_modes(double *basis, int64_t n_columns, int64_t n_frames, int64_t n_modes,
                         int64_t n_moving) {
    for (int64_t column = 0; column < n_columns; column++) {
        double *rows = basis + column * n_frames * n_modes;
        for (int64_t mode = n_moving; mode < n_modes; mode++) {
            double mean = 0.0;
            for (int64_t t = 0; t < n_frames; t++) {
                mean += rows[t * n_modes + mode];
            }
            mean /= (double)n_frames;
            for (int64_t t = 0; t < n_frames; t++) {
                rows[t * n_modes + mode] = mean;
            }
        }
    }
}

/* ---- packed fields ---- */

const double *reel_loaded_fields(const reel_track_state *state) {
    if (state->current.fields.values) {
        return state->current.fields.values;
    }
    return state->key.block == state->current.block ? state->key.values : NULL;
}

typedef struct {
    const reel_track_state *state;
    const int32_t *rows;
    int64_t task_size;
    uint8_t *packed;
} pack_job;

static void pack_task(void *shared, uint32_t i) {
    const pack_job *job = shared;
    const reel_track_state *state = job->state;
    int64_t n_items = state->items.graph.n_items, n_modes = (int64_t)state->current.n_modes;
    int64_t first = i * job->task_size, last = first + job->task_size;
    reel_pack(reel_loaded_fields(state), 1, n_modes, (double)state->current.group.step,
              (int64_t)state->current.group.precision, job->rows, n_modes, n_items,
              job->packed, first, last < n_items ? last : n_items);
}

void reel_find_field_rows(const reel_track_state *state, int32_t *rows) {
    for (uint32_t i = 0; i < state->items.graph.n_items; i++) {
        rows[i] = state->mesh->positions[state->items.order ? state->items.order[i] : (int32_t)i];
    }
}

int reel_pack_fields(reel_call *call, reel_track_state *state) {
    if (state->current.packed) {
        return MESHREEL_OK;
    }
    uint32_t n_items = state->items.graph.n_items;
    const reel_chunk *mark = call->scratch.last;
    int32_t *rows = reel_scratch(call, n_items, sizeof *rows);
    uint64_t size = reel_packed_bytes((int64_t)state->current.n_modes, n_items,
                                      (int64_t)state->current.group.precision);
    uint8_t *packed = rows ? reel_pool_allocate(call, &state->current.pool, size, 1) : NULL;
    REEL_NEED(packed);
    reel_find_field_rows(state, rows);
    int64_t task_size = n_items / reel_threads(call) / PACK_TILE * PACK_TILE;
    pack_job job = {state, rows, task_size + PACK_TILE, packed};
    reel_run(call, pack_task, &job, (uint32_t)((n_items + job.task_size - 1) / job.task_size),
             state->current.n_modes * n_items);
    reel_drop_scratch(call, mark);
    state->current.packed = packed;
    return MESHREEL_OK;
}

/* Number of modes to decode of a group, of which `n_moving` move in a preview. */
static uint64_t count_modes(const reel_group *group, uint64_t n_moving) {
    uint64_t n_read = n_moving > MIN_PREVIEW_MODES ? n_moving : MIN_PREVIEW_MODES;
    return n_moving && !group->reference && n_read < group->n_modes ? n_read : group->n_modes;
}

static int load_modes(reel_call *call, meshreel_decoder *decoder, uint32_t track, uint64_t block,
                      uint64_t n_moving) {
    reel_track_state *state = &decoder->tracks[track];
    const reel_group *group = &state->current.group;
    uint64_t n_modes = count_modes(group, n_moving);
    uint32_t n_columns = decoder->file->tracks[track].n_coded;
    REEL_TRY(find_mesh(call, decoder, state, group));
    if (group->reference) {
        REEL_TRY(find_key(call, decoder, track, block, group));
        REEL_TRY(find_mesh(call, decoder, state, group)); /* the key may need another one */
    }
    state->current.n_modes = n_modes;
    state->current.basis =
        reel_pool_allocate(call, &state->current.pool, n_columns * group->n_frames * n_modes,
                           sizeof *state->current.basis);
    REEL_NEED(state->current.basis);
    REEL_TRY(decode_fields(call, decoder, track, block, group, n_modes,
                           group->reference ? &state->key : NULL, state->current.basis,
                           &state->current.fields));
    if (!n_moving) {
        REEL_TRY(reel_read_corrections(call, &state->current.pool, group, n_columns,
                                       state->items.graph.n_items, state->items.inverse,
                                       &state->current.corrections));
    }
    if (n_moving) {
        freeze_modes(state->current.basis, n_columns, (int64_t)group->n_frames, (int64_t)n_modes,
                     (int64_t)n_moving);
    }
    return MESHREEL_OK;
}

/* ---- stored values ---- */

/* Decode exact numbers on the graph of a track into memory of `pool`. */
static int decode_exact(reel_call *call, reel_pool *pool, reel_range data, const reel_graph *graph,
                        uint64_t n_frames, uint32_t n_columns, uint32_t size, enum reel_type type,
                        void **output) {
    REEL_RETURN_IF(!REEL_IS_COMPLETE, reel_incomplete(call, data.offset));
    int64_t frames = (int64_t)n_frames, columns = n_columns;
    *output = reel_pool_allocate(call, pool, n_frames * graph->n_items, (uint64_t)n_columns * size);
    const reel_chunk *mark = call->scratch.last;
    size_t memory_size = reel_exact_memory(frames, graph->n_items, columns);
    void *memory = reel_scratch(call, memory_size, 1);
    const uint8_t *bytes;
    REEL_NEED(*output && memory);
    REEL_TRY(reel_view(call, data, &bytes));
    int64_t result =
        reel_exact_decode(memory, memory_size, bytes, (size_t)data.length, *output, frames,
                          graph->n_items, columns, size, type, graph->starts, graph->near);
    reel_drop_scratch(call, mark);
    return reel_fail_core(call, result, data.offset, "exact values are damaged");
}

/* Decode positions on a grid along the surface. */
static int load_on_surface(reel_call *call, const meshreel_decoder *decoder,
                           reel_track_state *state) {
    const reel_outline *outline = &decoder->file->outline;
    const int32_t *faces = decoder->file->mesh.internal_faces;
    int64_t n_verts = (int64_t)outline->n_verts, n_faces = (int64_t)outline->n_faces;
    int64_t n_frames = state->current.group.is_still ? 1 : (int64_t)state->current.group.n_frames;
    reel_range data = state->current.group.values;
    int32_t *positions =
        reel_pool_allocate(call, &state->current.pool, (uint64_t)n_frames * outline->n_verts,
                           N_AXES * sizeof *positions);
    const reel_chunk *mark = call->scratch.last;
    size_t memory_size = reel_surface_integers_memory(n_frames, n_verts, N_AXES, n_faces, 0);
    void *memory = positions ? reel_scratch(call, memory_size, 1) : NULL;
    REEL_NEED(memory);
    const uint8_t *bytes;
    REEL_TRY(reel_view(call, data, &bytes));
    int64_t result = reel_surface_integers_decode(memory, memory_size, bytes, (size_t)data.length,
                                                  n_frames, n_verts, N_AXES, faces,
                                                  decoder->file->mesh.twins, n_faces, positions);
    reel_drop_scratch(call, mark);
    state->current.exact = positions;
    return reel_fail_core(call, result, data.offset, "positions on a grid are damaged");
}

static int load_stored(reel_call *call, meshreel_decoder *decoder, uint32_t track) {
    reel_track_state *state = &decoder->tracks[track];
    const reel_track *definition = &decoder->file->tracks[track];
    const reel_group *group = &state->current.group;
    uint64_t n_stored = group->is_still ? 1 : group->n_frames;
    uint64_t n_positions = n_stored * decoder->file->outline.n_verts;
    REEL_TRY(reel_read_rounding(call, &state->current.pool, group, n_positions,
                                &state->current.rounding));
    uint32_t size = definition->size;
    enum reel_type type = definition->is_float    ? REEL_FLOATS
                          : definition->is_signed ? REEL_SIGNED_INTEGERS
                                                  : REEL_UNSIGNED_INTEGERS;
    if (definition->difference) {
        type = REEL_SIGNED_INTEGERS;
    }
    if (group->is_on_surface) {
        return load_on_surface(call, decoder, state);
    }
    if (group->grid > 0.0) {
        type = REEL_SIGNED_INTEGERS;
        size = sizeof(int32_t);
    }
    reel_graph *graph = &state->items.graph;
    if (!graph->starts) { /* no block needed it before: positions on the surface do not */
        REEL_TRY(reel_find_vertex_graph(call, &decoder->pool, &decoder->file->outline,
                                        &decoder->file->mesh, graph));
    }
    return decode_exact(call, &state->current.pool, group->values, graph,
                        group->n_frames, definition->n_coded, size, type, &state->current.exact);
}

/* Load the flags of missing values, 1 or 0. */
static int load_missing(reel_call *call, meshreel_decoder *decoder, uint32_t track) {
    reel_loaded_block *current = &decoder->tracks[track].current;
    const reel_graph *graph = &decoder->tracks[track].items.graph;
    uint32_t n_columns = decoder->file->tracks[track].info.n_columns;
    void *result;
    REEL_TRY(decode_exact(call, &current->pool, current->group.missing, graph,
                          current->group.n_frames, n_columns, 1, REEL_UNSIGNED_INTEGERS, &result));
    current->missing = result;
    for (uint64_t i = 0; i < current->group.n_frames * graph->n_items * n_columns; i++) {
        if (current->missing[i] > 1) {
            REEL_TRY(reel_corrupt(call, current->group.missing.offset,
                                  "the flag of a missing value is neither 0 nor 1"));
        }
    }
    return MESHREEL_OK;
}

/* ---- a block ---- */

int reel_reserve_group(reel_call *call, const meshreel_file *file, uint32_t number,
                       const reel_group *group, uint64_t n_moving) {
    const reel_track *track = &file->tracks[number];
    uint64_t n_verts = file->outline.n_verts, n_columns = track->n_coded;
    uint64_t n_items = track->sharing ? n_verts : track->info.n_items; /* rows: at least */
    uint64_t n_frames = group->is_still ? 1 : group->n_frames, n_values = n_items * n_frames;
    uint64_t n_modes = count_modes(group, n_moving), kept, scratch;
    if (n_modes) {
        REEL_TRY(reel_reserve(call, n_items, n_modes * sizeof(double)));
        REEL_TRY(reel_reserve(call, n_columns * n_frames, n_modes * sizeof(double)));
        uint64_t n_corrections = n_moving ? 0 : group->n_corrections; /* more than values: damage */
        REEL_TRY(reel_reserve(call, n_corrections < n_values ? n_corrections : n_values,
                              sizeof(int32_t) + n_columns * sizeof(double)));
        kept = call->n_bytes;
        uint64_t n_times = n_columns * n_frames; /* each with its neighbors and a start */
        scratch = n_items * (n_modes - group->n_reused) +
                  n_times * (n_modes + REEL_MAX_NEAR_TIMES + 3);
        scratch *= sizeof(int32_t);
    } else {
        uint32_t size = group->grid > 0.0 ? sizeof(int32_t) : track->size;
        REEL_TRY(reel_reserve(call, n_values, n_columns * size));
        kept = call->n_bytes;
        scratch = group->is_on_surface
                      ? reel_surface_integers_memory((int64_t)n_frames, (int64_t)n_verts, N_AXES,
                                                     (int64_t)file->outline.n_faces, 0)
                      : reel_exact_memory((int64_t)n_frames, (int64_t)n_items, (int64_t)n_columns);
    }
    REEL_TRY(reel_reserve(call, scratch, 1));
    call->n_bytes = kept;
    return reel_reserve(call, group->missing.offset ? n_values : 0, track->info.n_columns);
}

uint64_t reel_decoder_bytes(const meshreel_decoder *decoder) {
    uint64_t n_bytes = decoder->pool.n_bytes;
    for (uint32_t i = 0; i < decoder->file->info.n_tracks; i++) {
        const reel_track_state *track = &decoder->tracks[i];
        n_bytes += track->current.pool.n_bytes + track->current.fields.pool.n_bytes +
                   track->previous.pool.n_bytes + track->previous.fields.pool.n_bytes +
                   track->key.pool.n_bytes;
    }
    return n_bytes;
}

static void release_block(reel_call *call, reel_loaded_block *block) {
    call->n_bytes -= block->pool.n_bytes;
    reel_release(call->host, &block->pool);
    release_fields(call, &block->fields);
    *block = (reel_loaded_block){.block = REEL_NO_BLOCK, .fields = {.block = REEL_NO_BLOCK}};
}

/* Whether a block is loaded, with its fields if they are needed: `find_key` may have moved them to
   `key`, and released them since. */
static bool is_loaded(const reel_track_state *state, uint64_t block, uint64_t n_moving) {
    const reel_loaded_block *current = &state->current;
    return current->block == block && current->n_moving == n_moving &&
           (!current->basis || current->packed || reel_loaded_fields(state));
}

void reel_forget(reel_call *call, meshreel_decoder *decoder, uint32_t track) {
    release_block(call, &decoder->tracks[track].current);
}

int reel_load(reel_call *call, meshreel_decoder *decoder, uint32_t track, uint64_t block,
              uint64_t n_moving) {
    reel_track_state *state = &decoder->tracks[track];
    if (is_loaded(state, block, n_moving)) {
        return MESHREEL_OK;
    }
    reel_loaded_block other = state->previous;
    state->previous = state->current;
    state->current = other;
    if (is_loaded(state, block, n_moving)) {
        return MESHREEL_OK;
    }
    release_block(call, &state->current);
    call->n_bytes = reel_decoder_bytes(decoder) + call->scratch.n_bytes;
    REEL_TRY(find_items(call, decoder, track));
    REEL_TRY(read_group(call, decoder, track, block, &state->current.group));
    int failed = state->current.group.n_modes ? load_modes(call, decoder, track, block, n_moving)
                                              : load_stored(call, decoder, track);
    if (!failed && state->current.group.missing.offset) {
        failed = load_missing(call, decoder, track);
    }
    if (failed) {
        release_block(call, &state->current);
        return failed;
    }
    state->current.block = block;
    state->current.n_moving = n_moving;
    return MESHREEL_OK;
}
