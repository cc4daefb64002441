/* The container: the segments of a file, the header and leading sections of a segment, and the byte
   ranges of its blocks. */

#ifndef REEL_CONTAINER_H
#define REEL_CONTAINER_H

#include "source.h"

/* Limit of vertices, and of faces, of the connectivity coder. */
#define REEL_MAX_VERTS ((uint64_t)1 << 26)
#define REEL_MAX_FRAMES ((uint64_t)1 << 28)

enum reel_method_number { REEL_METHOD_REEL = 7, REEL_METHOD_LOSSLESS = 8, REEL_METHOD_GRID = 9 };
enum reel_kept_order { REEL_ORDER_KEPT = 0, REEL_ORDER_OF_VERTICES = 1, REEL_ORDER_DROPPED = 2 };

/* A block. Its tracks are contiguous: the first begins at `offset`, and track t ends at
   ends[block * n_tracks + t] of the outline. */
typedef struct {
    uint64_t offset;
    uint32_t first, n_frames; /* first frame, and number of frames */
} reel_block_entry;

typedef struct {
    uint64_t offset; /* of its first section */
    uint64_t end;    /* of its last block */
    uint64_t n_verts, n_faces;
    uint32_t first_frame, n_frames, n_tracks;
    uint64_t first_block; /* offset of its first block; 0 without an index */
    reel_range blocks;    /* entries of its blocks in the index */
} reel_segment;

typedef struct {
    reel_segment *items;
    uint64_t count, capacity, n_frames;
} reel_segments;

/* The outline of a segment: its header, and where its sections and blocks are. */
typedef struct {
    meshreel_text name;
    uint64_t header_frames; /* as the header states; 0: not known */
    uint64_t n_verts, n_faces;
    uint64_t coded_verts, coded_faces; /* counts in CONNECTIVITY and ORDER, before an edit */
    reel_range edit;                   /* payload of EDIT; empty without one */
    reel_range times;                  /* payload of TIMES; empty without one */
    uint64_t n_cells, n_cell_nodes;    /* 0 without CELLS */
    reel_range coded_cells;            /* payload of CELLS after its counts */
    double fps, start_s, error_bound_percent;
    double placement[4]; /* scale, and origin of x, y and z */
    uint32_t number_bytes, method, laplacian, order;
    uint64_t begin;                /* offset of its first section */
    bool is_first;                 /* first segment of the file */
    /* Known leading sections. Those of an earlier segment that this one refers to come first. */
    reel_section *leading;
    uint32_t n_leading, leading_capacity;
    uint32_t stored_ids; /* set of the ids of these sections, as bits */
    uint32_t n_tracks; /* including the positions */
    reel_block_entry *blocks;
    uint64_t *ends;
    uint64_t n_blocks, blocks_capacity, n_frames;
    uint32_t max_block_frames; /* number of frames in the longest block */
    uint64_t end;              /* end of the complete blocks */
    bool is_compact, is_whole;
    bool is_contradicted; /* by its index, which is intact */
    meshreel_error damage; /* why the segment is not whole */
    uint64_t n_polygons, n_corners;
} reel_outline;

/* Parse a file into memory of `pool`: its segments, and the outline of the first. If there are
   several, `end`, `is_whole` and `damage` of the outline describe the file. */
int reel_read_outline(reel_call *call, reel_pool *pool, reel_outline *outline,
                      reel_segments *segments);

/* Parse one of several segments of a file with this outline. */
int reel_read_segment(reel_call *call, reel_pool *pool, const reel_outline *file,
                      const reel_segments *segments, uint32_t number, reel_outline *outline);

/* Count the leading sections with an id. Unless `payload` is NULL, set it to that of the last. */
uint32_t reel_count_sections(const reel_outline *outline, uint32_t id, reel_range *payload);

/* Whether the mesh is the surface of cells; a constant in builds without them. */
REEL_INLINE bool reel_has_cells(const reel_outline *outline) {
    return REEL_IS_COMPLETE && outline->n_cells;
}

/* Return the number of items in a meshreel_domain: vertices, faces, face corners or cells. */
uint32_t reel_count_items(const reel_outline *outline, uint32_t domain);

/* Return the byte range of a track in a block. */
reel_range reel_group_bytes(const reel_outline *outline, uint64_t block, uint32_t track);

#endif
