/* An open file: what its blocks share. It never changes. */

#ifndef REEL_FILE_H
#define REEL_FILE_H

#include "group.h"
#include "field_mesh.h"
#include "moves.h"

/* What blocks take at most, each for itself. */
typedef struct {
    size_t values, packed, basis, moves, exact; /* bytes of what is kept of a block */
    size_t scratch;                     /* while it is decoded, and while a frame is */
    uint32_t longest;                   /* frames of a block */
    uint32_t stencils;                  /* bit S: there are stencils of S */
    bool has_keys;                      /* do any refer to another block? */
} reel_needs;

struct meshreel_file {
    meshreel_source source;
    meshreel_info info;
    reel_outline outline;
    reel_needs needs;
    reel_place *places;
    uint32_t *triangles;
    int32_t *sequence; /* the internal number of each vertex that goes out */
    int32_t *outward;  /* and back */
    reel_neighbours neighbours; /* of internal vertices; of `lossless` and `grid` */
    const reel_field_mesh *meshes[REEL_MAX_STENCIL + 1]; /* by the size of stencils; of `reel` */
};

/* Adds what a block takes. */
void reel_add_needs(reel_needs *needs, const reel_outline *outline, const reel_group *group);

/* Memory of a decoder. */
size_t reel_decoder_room(const reel_needs *needs, uint64_t n_verts);

/* Bytes that memory of a caller may begin behind a multiple of the alignment. */
#define REEL_SLACK (REEL_ALIGNMENT - 1)

/* The arena of a caller's memory, from its first aligned byte on. */
REEL_INLINE reel_arena reel_aligned_arena(void *memory, size_t size) {
    size_t off = (size_t)(-(uintptr_t)memory & REEL_SLACK);
    bool fits = memory && size >= off;
    return reel_arena_of(fits ? (uint8_t *)memory + off : NULL, fits ? size - off : 0);
}

#endif
