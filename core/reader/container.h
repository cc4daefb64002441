/* The parts of a stream: what its header and its leading sections say, and where its blocks lie. */

#ifndef REEL_CONTAINER_H
#define REEL_CONTAINER_H

#include "source.h"

#define REEL_MOST_VERTS ((uint64_t)1 << 26) /* and faces: as many as connectivity can code */
#define REEL_MOST_FRAMES ((uint64_t)1 << 28)

enum reel_method_number { REEL_METHOD_REEL = 7, REEL_METHOD_LOSSLESS = 8, REEL_METHOD_GRID = 9 };
enum reel_kept_order { REEL_ORDER_KEPT = 0, REEL_ORDER_OF_VERTICES = 1, REEL_ORDER_DROPPED = 2 };

/* Where the positions of a block lie. */
typedef struct {
    uint64_t at, size; /* of their group */
    uint32_t first, n_frames;
} reel_place;

typedef struct {
    const meshreel_source *source;
    uint64_t announced; /* frames, by the header; 0 where they were not known */
    uint64_t n_verts, n_faces;
    double fps, start_s, promise;
    double placement[4]; /* scale, and origin of x, y and z */
    uint32_t number_bytes, method, order;
    uint64_t leading; /* the byte behind the header */
    reel_stretch connectivity, vertex_order;
    uint32_t n_connectivity, n_order; /* sections of these ids */
    uint32_t n_tracks;                /* with the positions */
    bool has_index, is_whole;
    uint64_t index_at;   /* the byte at which the section INDEX begins */
    reel_stretch index;
    uint64_t n_blocks, n_frames;
    uint64_t most_frames; /* that this build reads */
} reel_outline;

/* Is told of each block; returns a code, and anything but MESHREEL_OK ends the walk. */
typedef int (*reel_visit)(void *own, const reel_outline *outline, const reel_place *place);

/* Finds the parts of a stream, and tells of its blocks. Where the index is damaged `restart` is
   called, and the blocks are told of again, as they are found section by section. */
int reel_find_parts(const meshreel_source *source, reel_outline *outline, reel_visit visit,
                    void (*restart)(void *own), void *own);

/* Tells of the blocks again. */
int reel_walk_blocks(reel_outline *outline, reel_visit visit, void *own);

#endif
