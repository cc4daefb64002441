/* Opens a stream: its parts, its triangles, and what its blocks share. */

#include "file.h"
#include "triangles.h"

#if SIZE_MAX < UINT64_MAX || __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "meshreel.h is for machines of 64 bits whose low bytes come first"
#endif

static const char *const words[] = {
    [MESHREEL_OK] = "all went well",
    [MESHREEL_NO_MEMORY] = "the memory is smaller than meshreel_inspect states; give as much as that",
    [MESHREEL_TRUNCATED] = "the file ends too early; get it again",
    [MESHREEL_CORRUPT] = "the file is damaged, or no .reel file; get it again",
    [MESHREEL_INVALID] = "an argument is out of its range: a frame that does not exist, or a null pointer",
    [MESHREEL_UNSUPPORTED] =
        "the file needs a newer build, or is larger than this one reads; update meshreel",
    [MESHREEL_METHOD] =
        "the file was encoded by a method of the paper, which the command `meshreel decode` decodes",
    [MESHREEL_UNREADABLE] = "the function that reads the file has failed",
    [MESHREEL_RANGE] = "positions are beyond the numbers of float; use meshreel_decode_doubles",
};

const char *meshreel_words(int code) {
    bool is_known = code >= 0 && (size_t)code < sizeof words / sizeof *words;
    return is_known ? words[code] : "there is no such code";
}

uint32_t meshreel_abi(void) { return MESHREEL_ABI; }

/* ---- memory ---- */

static int32_t smallest_stencil(uint32_t stencils) { return stencils ? __builtin_ctz(stencils) : 0; }

/* Neighbours are kept where values are exact. */
static bool keeps_neighbours(const reel_outline *outline) {
    return outline->method != REEL_METHOD_REEL;
}

static size_t neighbours_room(const reel_outline *outline) {
    return reel_room((size_t)outline->n_verts + 1, sizeof(int32_t)) +
           reel_room(6 * (size_t)outline->n_faces, sizeof(int32_t));
}

static size_t graph_scratch(const reel_outline *outline) {
    int64_t n_verts = (int64_t)outline->n_verts, n_faces = (int64_t)outline->n_faces;
    size_t joining = reel_room(reel_adjacency_memory(n_verts, n_faces), 1);
    if (keeps_neighbours(outline)) {
        return joining;
    }
    size_t ranking = reel_field_mesh_scratch(n_verts, 6 * n_faces);
    return neighbours_room(outline) + (joining > ranking ? joining : ranking);
}

static size_t file_room(const reel_outline *outline, const reel_needs *needs) {
    size_t n_verts = (size_t)outline->n_verts, n_faces = (size_t)outline->n_faces;
    size_t kept = REEL_SLACK + reel_room(1, sizeof(meshreel_file)) +
                  reel_room((size_t)outline->n_blocks, sizeof(reel_place)) +
                  reel_room(3 * n_faces, sizeof(uint32_t)) + 2 * reel_room(n_verts, sizeof(int32_t)) +
                  (keeps_neighbours(outline) ? neighbours_room(outline) : 0);
    for (uint32_t left = needs->stencils; left; left &= left - 1) {
        kept += reel_field_mesh_room((int64_t)n_verts, smallest_stencil(left));
    }
    size_t triangles = reel_triangles_scratch(outline), graph = graph_scratch(outline);
    return kept + reel_room(3 * n_faces, sizeof(int32_t)) + (triangles > graph ? triangles : graph);
}

/* ---- what a file says of itself ---- */

static int add_block(void *own, const reel_outline *outline, const reel_place *place) {
    reel_needs *needs = own;
    reel_group group;
    int failed = reel_read_group(outline, place, false, &group);
    if (!failed) {
        reel_add_needs(needs, outline, &group);
    }
    needs->longest = needs->longest > place->n_frames ? needs->longest : place->n_frames;
    return failed == MESHREEL_UNREADABLE ? failed : MESHREEL_OK; /* a damaged block fails by itself */
}

static void forget_blocks(void *own) { *(reel_needs *)own = (reel_needs){0}; }

static int inspect(const meshreel_source *source, reel_outline *outline, reel_needs *needs,
                   meshreel_info *info) {
    if (!source->bytes && !source->read) {
        return MESHREEL_INVALID;
    }
    forget_blocks(needs);
    int failed = reel_find_parts(source, outline, add_block, forget_blocks, needs);
    if (failed) {
        return failed;
    }
    *info = (meshreel_info){
        .file_bytes = file_room(outline, needs),
        .decoder_bytes = reel_decoder_room(needs, outline->n_verts),
        .fps = outline->fps,
        .start_s = outline->start_s,
        .promise_percent = outline->promise,
        .centre = {outline->placement[1], outline->placement[2], outline->placement[3]},
        .diagonal = outline->placement[0],
        .n_frames = (uint32_t)outline->n_frames,
        .n_verts = (uint32_t)outline->n_verts,
        .n_triangles = (uint32_t)outline->n_faces,
        .n_blocks = (uint32_t)outline->n_blocks,
        .longest_block = needs->longest,
        .n_tracks = outline->n_tracks - 1,
        .number_bytes = outline->number_bytes,
        .method = outline->method,
        .order = outline->order,
        .is_whole = outline->is_whole,
    };
    return MESHREEL_OK;
}

int meshreel_inspect(const meshreel_source *source, meshreel_info *info) {
    reel_outline outline;
    reel_needs needs;
    return source && info ? inspect(source, &outline, &needs, info) : MESHREEL_INVALID;
}

/* ---- opening ---- */

typedef struct {
    reel_place *places;
    uint64_t count, most;
} place_list;

static int list_place(void *own, const reel_outline *outline, const reel_place *place) {
    place_list *list = own;
    (void)outline;
    if (list->count == list->most) {
        return MESHREEL_CORRUPT; /* the source has changed */
    }
    list->places[list->count++] = *place;
    return MESHREEL_OK;
}

static int list_places(meshreel_file *file, reel_arena *arena) {
    place_list list = {.most = file->outline.n_blocks};
    list.places = file->places = reel_take(arena, (size_t)list.most, sizeof *list.places);
    if (arena->failed) {
        return MESHREEL_NO_MEMORY;
    }
    int failed = reel_walk_blocks(&file->outline, list_place, &list);
    return failed ? failed : list.count == list.most ? MESHREEL_OK : MESHREEL_CORRUPT;
}

/* The neighbours of internal vertices, in an arena. */
static int find_neighbours(const reel_outline *outline, reel_arena *arena, reel_arena scratch,
                           const int32_t *faces, reel_neighbours *found) {
    int64_t n_verts = (int64_t)outline->n_verts, n_faces = (int64_t)outline->n_faces;
    int32_t *starts = reel_take(arena, (size_t)n_verts + 1, sizeof *starts);
    int32_t *near = reel_take(arena, 6 * (size_t)n_faces, sizeof *near);
    size_t needed = reel_adjacency_memory(n_verts, n_faces);
    void *memory = reel_take(&scratch, needed, 1);
    if (arena->failed || scratch.failed) {
        return MESHREEL_NO_MEMORY;
    }
    *found = (reel_neighbours){n_verts, starts, near};
    return reel_code_of(reel_adjacency(memory, needed, faces, n_faces, n_verts, starts, near));
}

static int find_meshes(meshreel_file *file, reel_arena *arena, reel_arena scratch,
                       const int32_t *faces) {
    reel_neighbours graph;
    reel_arena inner = scratch;
    inner.used += neighbours_room(&file->outline); /* behind the neighbours */
    int failed = inner.used > inner.size
                     ? MESHREEL_NO_MEMORY
                     : find_neighbours(&file->outline, &scratch, inner, faces, &graph);
    for (uint32_t left = file->needs.stencils; left && !failed; left &= left - 1) {
        int32_t size = smallest_stencil(left);
        reel_field_mesh *found;
        failed = reel_code_of(
            reel_find_field_mesh(arena, scratch, &graph, size, file->sequence, &found));
        file->meshes[size] = found;
    }
    return failed;
}

static int decode_mesh(meshreel_file *file, reel_arena *arena) {
    const reel_outline *outline = &file->outline;
    size_t n_verts = (size_t)outline->n_verts, n_faces = (size_t)outline->n_faces;
    file->triangles = reel_take(arena, 3 * n_faces, sizeof *file->triangles);
    file->sequence = reel_take(arena, n_verts, sizeof *file->sequence);
    file->outward = reel_take(arena, n_verts, sizeof *file->outward);
    size_t kept = keeps_neighbours(outline) ? neighbours_room(outline) : 0;
    for (uint32_t left = file->needs.stencils; left; left &= left - 1) {
        kept += reel_field_mesh_room((int64_t)n_verts, smallest_stencil(left));
    }
    if (arena->failed || kept > arena->size - arena->used) {
        return MESHREEL_NO_MEMORY;
    }
    reel_arena scratch = *arena; /* behind what is kept */
    scratch.used += kept;
    int32_t *faces = reel_take(&scratch, 3 * n_faces, sizeof *faces);
    if (scratch.failed) {
        return MESHREEL_NO_MEMORY;
    }
    int failed = reel_decode_triangles(outline, scratch, faces, file->sequence, file->outward,
                                       file->triangles);
    if (failed) {
        return failed;
    }
    return keeps_neighbours(outline)
               ? find_neighbours(outline, arena, scratch, faces, &file->neighbours)
               : find_meshes(file, arena, scratch, faces);
}

int meshreel_open(const meshreel_source *source, void *memory, size_t size,
                  const meshreel_file **file) {
    if (!source || !memory || !file) {
        return MESHREEL_INVALID;
    }
    reel_arena arena = reel_aligned_arena(memory, size);
    meshreel_file *own = reel_take(&arena, 1, sizeof *own);
    if (!own) {
        return MESHREEL_NO_MEMORY;
    }
    *own = (meshreel_file){.source = *source};
    int failed = inspect(&own->source, &own->outline, &own->needs, &own->info);
    failed = failed ? failed : size < own->info.file_bytes ? MESHREEL_NO_MEMORY : MESHREEL_OK;
    failed = failed ? failed : list_places(own, &arena);
    failed = failed ? failed : decode_mesh(own, &arena);
    *file = failed ? NULL : own;
    return failed;
}

const meshreel_info *meshreel_info_of(const meshreel_file *file) { return &file->info; }

const uint32_t *meshreel_triangles(const meshreel_file *file) { return file->triangles; }
