/* The sections of a surface: docs/format.md, "Attributes, groups, materials". */

#include "surfaces.h"

#include "attributes.h"
#include "hard_edges.h"
#include "materials.h"
#include "names.h"

#define LABEL_BYTES 1 /* minimum bytes of a label */
#define PART_BYTES 3  /* minimum bytes of a part */
#define MAX_ITEMS INT32_MAX

/* Read the number of items that follow, each of at least `min_bytes` bytes. */
static int read_count(reel_call *call, reel_range *input, uint64_t min_bytes, uint32_t *count) {
    uint64_t offset = input->offset, result;
    REEL_TRY(reel_read_varint(call, input, &result));
    REEL_CORRUPT_IF(result > input->length / min_bytes, offset,
                    "the count of labels or parts exceeds the section");
    REEL_UNSUPPORTED_IF(result > MAX_ITEMS, offset, "more than 2^31 - 1 labels or parts");
    *count = (uint32_t)result;
    return MESHREEL_OK;
}

/* ---- groups ---- */

static int read_labels(reel_call *call, reel_pool *pool, reel_range *input,
                       meshreel_groups *result) {
    REEL_TRY(read_count(call, input, LABEL_BYTES, &result->n_labels));
    meshreel_text *labels = reel_pool_allocate(call, pool, result->n_labels, sizeof *labels);
    REEL_NEED(labels);
    for (uint32_t i = 0; i < result->n_labels; i++) {
        REEL_TRY(reel_read_text(call, pool, input, &labels[i]));
    }
    result->labels = labels;
    return MESHREEL_OK;
}

static int read_groups(reel_call *call, reel_pool *pool, uint64_t n_faces, reel_range payload,
                       meshreel_groups *result) {
    reel_range input = payload;
    int64_t length = (int64_t)n_faces, label = 0;
    int32_t table = 0, *differences;
    *result = (meshreel_groups){0};
    REEL_TRY(reel_read_text(call, pool, &input, &result->name));
    REEL_TRY(read_labels(call, pool, &input, result));
    REEL_TRY(reel_decode_rows(call, input, &length, &table, 1, 1, &differences));
    int32_t *of_faces = reel_pool_allocate(call, pool, n_faces, sizeof *of_faces);
    REEL_NEED(of_faces);
    for (uint64_t i = 0; i < n_faces; i++) {
        label += differences[i];
        REEL_CORRUPT_IF(label < -1 || label >= result->n_labels, input.offset,
                        "a face is in a group that does not exist");
        of_faces[i] = (int32_t)label;
    }
    result->of_faces = of_faces;
    return MESHREEL_OK;
}

/* ---- parts ---- */

static int read_part(reel_call *call, reel_pool *pool, reel_range *input, uint64_t *n_verts,
                     uint64_t *n_faces, meshreel_part *result) {
    uint64_t offset = input->offset, part_verts, part_faces;
    REEL_TRY(reel_read_varint(call, input, &part_verts));
    REEL_TRY(reel_read_varint(call, input, &part_faces));
    REEL_TRY(reel_read_text(call, pool, input, &result->name));
    REEL_CORRUPT_IF(part_verts > *n_verts || part_faces > *n_faces, offset,
                    "parts have more vertices or faces than the mesh");
    result->n_verts = (uint32_t)part_verts;
    result->n_faces = (uint32_t)part_faces;
    *n_verts -= part_verts;
    *n_faces -= part_faces;
    return MESHREEL_OK;
}

static int read_parts(reel_call *call, reel_pool *pool, const reel_outline *outline,
                      reel_range payload, meshreel_surface *surface) {
    reel_range input = payload;
    uint64_t n_verts = outline->n_verts, n_faces = outline->n_polygons;
    REEL_TRY(read_count(call, &input, PART_BYTES, &surface->n_parts));
    meshreel_part *parts = reel_pool_allocate(call, pool, surface->n_parts, sizeof *parts);
    REEL_NEED(parts);
    for (uint32_t i = 0; i < surface->n_parts; i++) {
        REEL_TRY(read_part(call, pool, &input, &n_verts, &n_faces, &parts[i]));
    }
    REEL_CORRUPT_IF(input.length, input.offset, "bytes follow the last part or texture");
    REEL_CORRUPT_IF(surface->n_parts && (n_verts || n_faces), payload.offset,
                    "parts have fewer vertices or faces than the mesh");
    surface->parts = parts;
    return MESHREEL_OK;
}

/* ---- all sections ---- */

/* The writable arrays of a surface. */
typedef struct {
    meshreel_attribute *attributes;
    meshreel_groups *groups;
    meshreel_material *materials;
    meshreel_image *images;
} surface_arrays;

static int allocate_arrays(reel_call *call, reel_pool *pool, const reel_outline *outline,
                           surface_arrays *arrays) {
    uint64_t n_attributes = reel_count_sections(outline, REEL_ATTRIBUTE, NULL) +
                            reel_count_sections(outline, REEL_ATTRIBUTE_FROM_POINTS, NULL);
    uint64_t n_groups = reel_count_sections(outline, REEL_GROUPS, NULL);
    uint64_t n_materials = reel_count_sections(outline, REEL_MATERIAL, NULL);
    uint64_t n_images = reel_count_sections(outline, REEL_IMAGE, NULL);
    arrays->attributes = reel_pool_allocate(call, pool, n_attributes, sizeof *arrays->attributes);
    arrays->groups = reel_pool_allocate(call, pool, n_groups, sizeof *arrays->groups);
    arrays->materials = reel_pool_allocate(call, pool, n_materials, sizeof *arrays->materials);
    arrays->images = reel_pool_allocate(call, pool, n_images, sizeof *arrays->images);
    return arrays->attributes && arrays->groups && arrays->materials && arrays->images
               ? MESHREEL_OK
               : call->error.code;
}

static int read_section(reel_call *call, reel_pool *pool, const reel_faces *faces,
                        const reel_section *section, uint32_t n_images,
                        const surface_arrays *arrays, meshreel_surface *surface) {
    const reel_outline *outline = faces->outline;
    reel_range payload = section->payload;
    switch (section->id) {
    case REEL_ATTRIBUTE:
    case REEL_ATTRIBUTE_FROM_POINTS:
        return reel_read_attribute(call, pool, faces, section,
                                   &arrays->attributes[surface->n_attributes++]);
    case REEL_GROUPS:
        return read_groups(call, pool, outline->n_polygons, payload,
                           &arrays->groups[surface->n_groups++]);
    case REEL_PARTS:
        return read_parts(call, pool, outline, payload, surface);
    case REEL_HARD_EDGES:
        return reel_read_hard_edges(call, pool, faces, payload, surface);
    case REEL_MATERIAL:
        return reel_read_material(call, pool, payload, n_images,
                                  &arrays->materials[surface->n_materials++]);
    case REEL_IMAGE:
        return reel_read_image(call, pool, payload, &arrays->images[surface->n_images++]);
    default:
        return MESHREEL_OK;
    }
}

static int check_materials(reel_call *call, const meshreel_material *materials, uint32_t count,
                           uint64_t offset) {
    meshreel_text *names = reel_scratch(call, count, sizeof *names);
    for (uint32_t i = 0; names && i < count; i++) {
        names[i] = materials[i].name;
    }
    return names ? reel_check_names(call, names, count, offset, "two materials have the same name")
                 : call->error.code;
}

static int read_sections(reel_call *call, reel_pool *pool, const reel_faces *faces,
                         const surface_arrays *arrays, meshreel_surface *surface) {
    const reel_outline *outline = faces->outline;
    uint32_t n_images = reel_count_sections(outline, REEL_IMAGE, NULL);
    uint64_t last_material = REEL_UNKNOWN;
    for (uint32_t i = 0; i < outline->n_leading; i++) {
        const reel_section *section = &outline->leading[i];
        const reel_chunk *mark = call->scratch.last;
        REEL_TRY(read_section(call, pool, faces, section, n_images, arrays, surface));
        last_material = section->id == REEL_MATERIAL ? section->payload.offset : last_material;
        reel_drop_scratch(call, mark);
    }
    return check_materials(call, arrays->materials, surface->n_materials, last_material);
}

int reel_read_surface(reel_call *call, reel_pool *pool, const reel_faces *faces,
                      meshreel_surface *surface) {
    const reel_outline *outline = faces->outline;
    surface_arrays arrays;
    *surface = (meshreel_surface){.face_sizes = faces->sizes,
                                  .triangle_corners = (const uint32_t *)faces->corners};
    REEL_TRY(allocate_arrays(call, pool, outline, &arrays));
    REEL_TRY(read_sections(call, pool, faces, &arrays, surface));
    surface->attributes = arrays.attributes;
    surface->groups = arrays.groups;
    surface->materials = arrays.materials;
    surface->images = arrays.images;
    return MESHREEL_OK;
}
