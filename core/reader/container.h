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

/* A block. Its tracks are contiguous: track t ends at ends[block n_tracks + t], the first begins at
   `at`. */
typedef struct {
    uint64_t at;
    uint32_t first, n_frames;
} reel_block_entry;

typedef struct {
    uint64_t at;  /* offset of its first section */
    uint64_t end; /* end of its last block */
    uint64_t n_verts, n_faces;
    uint32_t first_frame, n_frames, n_tracks;
    uint64_t first_block; /* offset of its first block; 0 without an index */
    reel_range blocks;    /* their entries of the index */
} reel_segment;

typedef struct {
    reel_segment *all;
    uint64_t count, capacity, n_frames;
} reel_segments;

/* The outline of a segment. */
typedef struct {
    meshreel_text name;
    uint64_t announced; /* number of frames in the header; 0: not known */
    uint64_t n_verts, n_faces;
    uint64_t coded_verts, coded_faces; /* of CONNECTIVITY and ORDER; others if there is an edit */
    reel_range edit;                   /* payload of EDIT, or of length 0 */
    reel_range times;                  /* payload of TIMES, or of length 0 */
    uint64_t n_cells, n_cell_nodes;    /* 0 without CELLS */
    reel_range coded_cells;            /* payload of CELLS behind its counts */
    double fps, start_s, error_bound_percent;
    double placement[4]; /* scale, and origin of x, y and z */
    uint32_t number_bytes, method, laplacian, order;
    uint64_t begin;                /* offset of its first section */
    bool is_first;                 /* first segment of the file */
    /* Known leading sections, after those of an earlier segment that it refers to. */
    reel_section *leading;
    uint32_t n_leading, leading_capacity;
    uint32_t stored_ids; /* a bit for each id of a known leading section */
    uint32_t n_tracks; /* including the positions */
    reel_block_entry *blocks;
    uint64_t *ends;
    uint64_t n_blocks, blocks_capacity, n_frames;
    uint32_t longest; /* frames of the longest block */
    uint64_t end;     /* end of the complete blocks */
    bool is_compact, is_whole;
    meshreel_error damage; /* why it is not whole */
    uint64_t n_polygons, n_corners;
} reel_outline;

/* Parse a file into memory of `pool`: its segments, and the outline of the first. If there are
   several, `end`, `is_whole` and `damage` of the outline describe the file. */
int reel_read_outline(reel_call *call, reel_pool *pool, reel_outline *outline,
                      reel_segments *segments);

/* Parse one of several segments of a file with this outline. */
int reel_read_segment(reel_call *call, reel_pool *pool, const reel_outline *file,
                      const reel_segments *segments, uint32_t number, reel_outline *outline);

/* Count the leading sections with an id; `payload`, unless NULL, becomes that of the last. */
uint32_t reel_count_sections(const reel_outline *outline, uint32_t id, reel_range *payload);

/* Number of vertices, faces, corners of faces or cells: items of a meshreel_domain. */
uint32_t reel_count_items(const reel_outline *outline, uint32_t domain);

/* Byte range of a track in a block. */
reel_range reel_group_bytes(const reel_outline *outline, uint64_t block, uint32_t track);

#endif
