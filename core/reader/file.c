/* Opens files, and decodes the mesh that their blocks share. docs/format.md, "Segments",
   CONNECTIVITY and ORDER. */

#include "file.h"

#include "cell_mesh.h"
#include "edit.h"
#include "group.h"
#include "surfaces.h"
#include "times.h"

#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "the core requires a little-endian machine"
#endif

uint32_t meshreel_abi(void) { return MESHREEL_ABI; }

reel_call reel_begin_file_call(const meshreel_file *file, uint64_t n_bytes) {
    reel_call call = reel_begin_call(&file->source, &file->host, n_bytes);
    call.is_compact = file->outline.is_compact;
    return call;
}

/* ---- opening ---- */

static void fill_info(meshreel_file *file) {
    const reel_outline *outline = &file->outline;
    file->info = (meshreel_info){
        .name = outline->name,
        .fps = outline->fps,
        .start_s = outline->start_s,
        .center = {outline->placement[1], outline->placement[2], outline->placement[3]},
        .diagonal = outline->placement[0],
        .size = outline->end,
        .n_frames = (uint32_t)file->segments.n_frames,
        .number_bytes = outline->number_bytes,
        .method = outline->method,
        .laplacian = outline->laplacian,
        .order = outline->order,
        .is_whole = outline->is_whole,
        .n_segments = (uint32_t)file->segments.count,
        .damage = outline->damage,
    };
}

static void fill_info_of_mesh(meshreel_file *file) {
    const reel_outline *outline = &file->outline;
    meshreel_info *info = &file->info;
    info->error_bound_percent = outline->error_bound_percent;
    info->n_verts = (uint32_t)outline->n_verts;
    info->n_triangles = (uint32_t)outline->n_faces;
    info->n_faces = (uint32_t)outline->n_polygons;
    info->n_corners = (uint32_t)outline->n_corners;
    info->n_cells = (uint32_t)outline->n_cells;
    info->n_blocks = (uint32_t)outline->n_blocks;
    info->longest_block = outline->max_block_frames;
    info->n_tracks = outline->n_tracks;
}

/* Set start and mean rate from the times of frames. */
static void set_timing(reel_outline *outline, const double *times, uint64_t n_frames) {
    double fps = (double)(n_frames - 1) / (times[n_frames - 1] - times[0]);
    outline->start_s = times[0];
    outline->fps = reel_is_finite(fps) ? fps : outline->fps;
}

static int parse(reel_call *call, meshreel_file *file) {
    REEL_CORRUPT_IF(reel_is_of_paper(file) &&
                    (file->outline.n_tracks > 1 || file->outline.edit.length), file->outline.begin,
                    "a file of a method of the paper has a track or an edit");
    bool has_other = reel_is_of_paper(file) || file->outline.edit.length ||
                     file->outline.order == REEL_ORDER_OF_VERTICES ||
                     reel_count_sections(&file->outline, REEL_CONNECTIVITY, NULL) ||
                     reel_count_sections(&file->outline, REEL_POLYGONS, NULL);
    REEL_CORRUPT_IF(file->outline.n_cells && has_other, file->outline.begin,
                    "cells come with faces, an edit, an order of vertices or a method of the "
                    "paper");
    bool needs_all = file->outline.method == REEL_METHOD_LOSSLESS || file->outline.n_cells;
    REEL_RETURN_IF(!REEL_IS_COMPLETE && needs_all, reel_incomplete(call, file->outline.begin));
    REEL_TRY(reel_read_tracks(call, &file->pool, &file->outline, &file->tracks));
    fill_info(file);
    fill_info_of_mesh(file);
    return MESHREEL_OK;
}

/* Read the times of frames, from which start and mean rate follow. */
static int read_times(reel_call *call, meshreel_file *file) {
    reel_outline *outline = &file->outline;
    uint64_t n_frames = file->segments.n_frames;
    if (!outline->times.length) {
        return MESHREEL_OK;
    }
    REEL_CORRUPT_IF(reel_count_sections(outline, REEL_START, NULL), outline->times.offset,
                    "there are a start and times");
    REEL_TRY(reel_read_times(call, &file->pool, outline->times, n_frames, !outline->is_whole,
                             &file->times));
    set_timing(outline, file->times, n_frames);
    return MESHREEL_OK;
}

static int parse_whole(reel_call *call, meshreel_file *file) {
    REEL_TRY(reel_read_outline(call, &file->pool, &file->outline, &file->segments));
    REEL_TRY(read_times(call, file));
    if (file->segments.count == 1) {
        return parse(call, file);
    }
    fill_info(file);
    return MESHREEL_OK;
}

static int parse_segment(reel_call *call, meshreel_file *file, const meshreel_file *whole,
                         uint32_t number) {
    REEL_TRY(reel_read_segment(call, &file->pool, &whole->outline, &whole->segments, number,
                               &file->outline));
    reel_segment *segment = reel_pool_allocate(call, &file->pool, 1, sizeof *segment);
    REEL_NEED(segment);
    *segment = whole->segments.items[number];
    file->segments = (reel_segments){.items = segment, .count = 1, .n_frames = segment->n_frames};
    file->is_segment = true;
    if (whole->times) {
        file->times = reel_pool_allocate(call, &file->pool, segment->n_frames, sizeof *file->times);
        REEL_NEED(file->times);
        reel_copy(file->times, whole->times + segment->first_frame,
                  segment->n_frames * sizeof *file->times);
        set_timing(&file->outline, file->times, segment->n_frames);
    }
    return parse(call, file);
}

/* Open a file, or segment `number` of the file `whole` if that is not NULL. */
static int open_file(const meshreel_source *source, const meshreel_host *host,
                     const meshreel_file *whole, uint32_t number, meshreel_file **file,
                     meshreel_error *error) {
    *file = NULL;
    reel_pool first = {NULL, 0};
    reel_call call = reel_begin_call(source, host, 0);
    meshreel_file *new_file = reel_pool_allocate(&call, &first, 1, sizeof *new_file);
    if (!new_file) {
        return reel_end_call(&call, call.error.code, error);
    }
    *new_file = (meshreel_file){.source = *source, .host = *host, .pool = first};
    int failed =
        whole ? parse_segment(&call, new_file, whole, number) : parse_whole(&call, new_file);
    reel_end_call(&call, failed, error);
    if (failed) {
        meshreel_close(new_file);
        return failed;
    }
    *file = new_file;
    return MESHREEL_OK;
}

int meshreel_open(const meshreel_source *source, const meshreel_host *host, meshreel_file **file,
                  meshreel_error *error) {
    REEL_INVALID_IF(!source || !host || !file || (!source->bytes && !source->read) ||
                    !host->allocate || !host->release, "a pointer is NULL");
    return open_file(source, host, NULL, 0, file, error);
}

int meshreel_open_segment(const meshreel_file *file, uint32_t number, meshreel_file **segment,
                          meshreel_error *error) {
    REEL_INVALID_IF(!file || !segment || number >= file->info.n_segments,
                    "the segment does not exist, or a pointer is NULL");
    REEL_INVALID_IF(file->is_segment, "the file is a segment already");
    const meshreel_file *whole = file->info.n_segments > 1 ? file : NULL;
    return open_file(&file->source, &file->host, whole, number, segment, error);
}

void meshreel_close(meshreel_file *file) {
    if (file) {
        reel_pool pool = file->pool; /* contains the file itself */
        meshreel_host host = file->host;
        reel_release(&host, &pool);
    }
}

const meshreel_info *meshreel_info_of(const meshreel_file *file) { return &file->info; }

const double *meshreel_times_of(const meshreel_file *file) { return file->times; }

uint32_t meshreel_frame_at(const meshreel_file *file, double time_s) {
    const meshreel_info *info = &file->info;
    double frame = (time_s - info->start_s) * info->fps;
    uint32_t first = 0, end = info->n_frames;
    if (!file->times) {
        /* A frame is due a millionth of its duration before its time, for rounding errors. */
        frame += 1e-6;
        return !(frame >= 1.0) ? 0 : frame >= end ? end - 1 : (uint32_t)frame;
    }
    while (end - first > 1) {
        uint32_t middle = first + (end - first) / 2;
        if (file->times[middle] <= time_s) {
            first = middle;
        } else {
            end = middle;
        }
    }
    return first;
}

/* ---- segments ---- */

int meshreel_segment_of(const meshreel_file *file, uint32_t number, meshreel_segment *segment) {
    if (!file || !segment || number >= file->info.n_segments) {
        return MESHREEL_INVALID;
    }
    const reel_segment *result = &file->segments.items[number];
    *segment = (meshreel_segment){
        result->first_frame,       result->n_frames, (uint32_t)result->n_verts,
        (uint32_t)result->n_faces, result->offset,   result->end - result->offset};
    return MESHREEL_OK;
}

uint32_t meshreel_segment_of_frame(const meshreel_file *file, uint32_t frame) {
    uint32_t first = 0, end = file->info.n_segments;
    while (end - first > 1) {
        uint32_t middle = first + (end - first) / 2;
        if (file->segments.items[middle].first_frame <= frame) {
            first = middle;
        } else {
            end = middle;
        }
    }
    return first;
}

/* ---- the layout ---- */

static meshreel_section describe_section(const reel_section *section) {
    return (meshreel_section){section->id,
                              reel_is_known(section->id),
                              section->offset,
                              section->end - section->offset,
                              section->payload.offset,
                              section->payload.length};
}

int meshreel_section_at(const meshreel_file *file, uint64_t offset, int check,
                        meshreel_section *section, meshreel_error *error) {
    REEL_INVALID_IF(!file || !section, "a pointer is NULL");
    uint64_t begin = offset ? offset : file->outline.begin;
    REEL_INVALID_IF(begin < file->outline.begin || begin >= file->outline.end,
                    "no section begins at this byte");
    reel_call call = reel_begin_file_call(file, 0);
    reel_section result;
    int failed = reel_section_at(&call, begin, file->outline.end, &result);
    if (!failed && check) {
        failed = reel_section_check(&call, &result);
    }
    if (!failed) {
        *section = describe_section(&result);
    }
    return reel_end_call(&call, failed, error);
}

int meshreel_leading_of(const meshreel_file *file, uint32_t number, meshreel_section *section) {
    if (!file || !section || file->info.n_segments > 1 || number >= file->outline.n_leading) {
        return MESHREEL_INVALID;
    }
    *section = describe_section(&file->outline.leading[number]);
    return MESHREEL_OK;
}

int meshreel_block_of(const meshreel_file *file, uint32_t number, uint32_t track,
                      meshreel_block *block) {
    if (!file || !block || number >= file->info.n_blocks || track >= file->info.n_tracks) {
        return MESHREEL_INVALID;
    }
    const reel_block_entry *entry = &file->outline.blocks[number];
    reel_range bytes = reel_group_bytes(&file->outline, number, track);
    *block = (meshreel_block){entry->first, entry->n_frames, bytes.offset, bytes.length};
    return MESHREEL_OK;
}

int meshreel_group_of(const meshreel_file *file, uint32_t number, uint32_t track, int check,
                      meshreel_group *group, meshreel_error *error) {
    if (!file || !group || number >= file->info.n_blocks || track >= file->info.n_tracks) {
        return reel_invalid(error, "the block or track does not exist, or a pointer is NULL");
    }
    reel_call call = reel_begin_file_call(file, 0);
    reel_group result;
    int failed = reel_is_of_paper(file)
                     ? reel_read_paper_group(&call, &file->outline, number, check != 0, &result)
                     : reel_read_group(&call, &file->outline, &file->tracks[track], track, number,
                                       check != 0, &result);
    *group = (meshreel_group){.key_block = number,
                              .n_modes = (uint32_t)result.n_modes,
                              .n_corrections = result.n_corrections,
                              .step = result.grid > 0.0 ? result.grid : (double)result.step};
    if (!failed && result.reference > number) {
        failed = reel_fail(&call, MESHREEL_CORRUPT, REEL_UNKNOWN,
                           "a block refers to one before the first");
    }
    group->key_block -= failed ? 0 : (uint32_t)result.reference;
    return reel_end_call(&call, failed, error);
}

uint32_t meshreel_block_of_frame(const meshreel_file *file, uint32_t frame) {
    uint32_t first = 0, end = file->info.n_blocks;
    while (end - first > 1) {
        uint32_t middle = first + (end - first) / 2;
        if (file->outline.blocks[middle].first <= frame) {
            first = middle;
        } else {
            end = middle;
        }
    }
    return first;
}

int meshreel_track_of(const meshreel_file *file, uint32_t number, meshreel_track *track) {
    if (!file || !track || number >= file->info.n_tracks) {
        return MESHREEL_INVALID;
    }
    *track = file->tracks[number].info;
    return MESHREEL_OK;
}

/* ---- the mesh ---- */

int reel_refuse_several(meshreel_error *error) {
    if (error) {
        *error = (meshreel_error){.code = MESHREEL_SEGMENTS, .offset = REEL_UNKNOWN,
                                  .message = "the file has several segments with different meshes; "
                                             "open one of them"};
    }
    return MESHREEL_SEGMENTS;
}

/* Find the stencil size of the first block, to compute the hierarchy in advance; 0 if none is
   needed, or if the block is damaged, which is reported when it is loaded. */
static int first_stencil(reel_call *call, const meshreel_file *file, int64_t *size) {
    const reel_outline *outline = &file->outline;
    *size = 0;
    if (outline->method != REEL_METHOD_REEL) {
        return MESHREEL_OK;
    }
    reel_group group;
    int failed = reel_read_group(call, outline, file->tracks, 0, 0, false, &group);
    *size = failed ? 0 : (int64_t)group.stencil_size;
    return failed == MESHREEL_UNREADABLE ? failed : MESHREEL_OK;
}

typedef struct {
    reel_order_job *order;
    reel_hierarchy_job *hierarchy;
} mesh_jobs;

static void run_mesh_job(void *shared, uint32_t i) {
    mesh_jobs *jobs = shared;
    if (i && jobs->order) {
        reel_decode_order(jobs->order);
    } else if (!i && jobs->hierarchy) {
        reel_find_hierarchy(jobs->hierarchy);
    }
}

int reel_check_mesh(reel_call *call, const meshreel_file *file, int64_t *stencil) {
    const reel_outline *outline = &file->outline;
    uint64_t n_verts = outline->n_verts, n_faces = outline->n_faces, before = call->n_bytes;
    uint64_t n_nodes = outline->n_cell_nodes, n_near = n_nodes ? 4 * n_nodes : 6 * n_faces;
    bool has_graph = outline->max_block_frames > 1 || outline->n_tracks > 1;
    REEL_TRY(first_stencil(call, file, stencil));
    /* Faces and vertices in internal and in output order, cells in both, and the graph. */
    REEL_TRY(reel_reserve(call, 6 * n_faces + 2 * n_verts + 2 * n_nodes, sizeof(int32_t)));
    REEL_TRY(reel_reserve(call, has_graph ? n_verts + n_near : 0, sizeof(int32_t)));
    if (*stencil) {
        REEL_TRY(reel_reserve_hierarchy(call, n_verts, *stencil));
    }
    call->n_bytes = before;
    return MESHREEL_OK;
}

static int read_mesh(reel_call *call, meshreel_file *file, reel_pool *pool) {
    const reel_outline *outline = &file->outline;
    reel_mesh_data *mesh = &file->mesh;
    mesh_jobs jobs = {NULL, NULL};
    int64_t stencil;
    REEL_TRY(reel_check_mesh(call, file, &stencil));
    REEL_TRY(outline->edit.length
                 ? reel_read_edited_mesh(call, pool, outline, mesh)
             : reel_has_cells(outline) ? reel_decode_cells(call, pool, outline, mesh)
                                       : reel_decode_connectivity(call, pool, outline, mesh));
    REEL_TRY(reel_find_graph(call, pool, outline, mesh));
    REEL_TRY(reel_read_face_sizes(call, pool, outline, &file->faces));
    if (reel_has_cells(outline)) {
        REEL_TRY(reel_order_cells(call, pool, outline, mesh));
        bool is_plain = outline->n_polygons == outline->n_faces;
        file->faces.sizes = is_plain ? NULL : (const uint32_t *)mesh->face_sizes;
    } else if (!outline->edit.length) {
        REEL_TRY(reel_prepare_order(call, pool, outline, mesh, &jobs.order));
    }
    if (stencil) {
        REEL_TRY(reel_prepare_hierarchy(call, pool, &mesh->graph, stencil, true, &jobs.hierarchy));
    }
    reel_run(call, run_mesh_job, &jobs, 2, outline->n_verts * REEL_MAX_STENCIL);
    REEL_TRY(jobs.order ? reel_finish_order(call, jobs.order) : MESHREEL_OK);
    file->faces.triangles = mesh->triangles;
    REEL_TRY(reel_find_triangle_corners(call, pool, &file->faces));
    if (jobs.hierarchy) {
        REEL_TRY(reel_finish_hierarchy(call, jobs.hierarchy, &file->field_mesh));
    }
    return MESHREEL_OK;
}

int meshreel_read_mesh(meshreel_file *file, meshreel_error *error) {
    REEL_INVALID_IF(!file, "a pointer is NULL");
    if (file->info.n_segments > 1) {
        return reel_refuse_several(error);
    }
    reel_call call = reel_begin_file_call(file, file->pool.n_bytes);
    reel_pool pool = {NULL, 0};
    int failed = file->has_mesh ? MESHREEL_OK : read_mesh(&call, file, &pool);
    file->has_mesh = !failed;
    file->field_mesh = failed ? NULL : file->field_mesh;
    return reel_end_call(&call, reel_append(&file->host, failed, &file->pool, &pool), error);
}

const uint32_t *meshreel_triangles(const meshreel_file *file) {
    return file->has_mesh ? file->mesh.triangles : NULL;
}

const meshreel_cells *meshreel_cells_of(const meshreel_file *file) {
    return file->has_mesh && file->mesh.cells.n_cells ? &file->mesh.cells : NULL;
}

const int32_t *meshreel_stored_triangles(const meshreel_file *file,
                                         const int32_t **stored_vertices) {
    *stored_vertices = file->has_mesh ? file->mesh.to_internal : NULL;
    return file->has_mesh ? file->mesh.internal_faces : NULL;
}

/* Decode the positions of the first frame into scratch memory, if an attribute depends on them. */
static int read_positions(reel_call *call, const meshreel_file *file, reel_faces *faces) {
    const reel_outline *outline = faces->outline;
    if (!reel_count_sections(outline, REEL_ATTRIBUTE_FROM_POINTS, NULL)) {
        return MESHREEL_OK;
    }
    REEL_CORRUPT_IF(reel_is_of_paper(file), REEL_UNKNOWN,
                    "an attribute depends on positions, which this method does not define");
    meshreel_decoder *decoder = NULL;
    void *positions = reel_scratch(call, 3 * outline->n_verts, outline->number_bytes);
    REEL_NEED(positions);
    int failed = meshreel_begin(file, &decoder, &call->error);
    failed = failed ? failed : meshreel_decode(decoder, 0, 0, 1, 0, NULL, positions, &call->error);
    meshreel_end(decoder);
    faces->positions = positions;
    return failed;
}

int meshreel_read_surface(meshreel_file *file, meshreel_error *error) {
    int failed = meshreel_read_mesh(file, error);
    if (failed || file->has_surface) {
        return failed;
    }
    reel_call call = reel_begin_file_call(file, file->pool.n_bytes);
    reel_pool pool = {NULL, 0};
    reel_faces faces = file->faces;
    failed = read_positions(&call, file, &faces);
    failed = failed ? failed : reel_read_surface(&call, &pool, &faces, &file->surface);
    file->has_surface = !failed;
    return reel_end_call(&call, reel_append(&file->host, failed, &file->pool, &pool), error);
}

const meshreel_surface *meshreel_surface_of(const meshreel_file *file) {
    return file->has_surface ? &file->surface : NULL;
}
