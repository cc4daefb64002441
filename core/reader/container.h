/* The container: the segments of a file; what the header and the leading sections of a segment say,
   and where its blocks lie. */

#ifndef REEL_CONTAINER_H
#define REEL_CONTAINER_H

#include "source.h"

#define REEL_MAX_VERTS ((uint64_t)1 << 26) /* and faces: as many as connectivity can code */
#define REEL_MAX_FRAMES ((uint64_t)1 << 28)

enum reel_method_number { REEL_METHOD_REEL = 7, REEL_METHOD_LOSSLESS = 8, REEL_METHOD_GRID = 9 };
enum reel_kept_order { REEL_ORDER_KEPT = 0, REEL_ORDER_OF_VERTICES = 1, REEL_ORDER_DROPPED = 2 };

/* A section before the first block. */
typedef struct {
    uint32_t id;
    reel_range payload;
} reel_leading_section;

/* A block: its frames. Its bytes, track by track, end at ends[block n_tracks + track]; those of the
   first track begin at `at`. */
typedef struct {
    uint64_t at;
    uint32_t first, n_frames;
} reel_block_entry;

typedef struct {
    uint64_t at;  /* the byte at which its sections begin */
    uint64_t end; /* the byte behind its last block */
    uint64_t n_verts, n_faces;
    uint32_t first_frame, n_frames, n_tracks;
    uint64_t first_block; /* the byte at which the first one begins; 0 without an index */
    reel_range blocks;    /* what the index says of them */
} reel_segment;

typedef struct {
    reel_segment *all;
    uint64_t count, room, n_frames;
} reel_segments;

/* A segment. */
typedef struct {
    meshreel_text name;
    uint64_t announced; /* frames of the file, by the header; 0: not known */
    uint64_t n_verts, n_faces;
    double fps, start_s, promise;
    double placement[4]; /* scale, and origin of x, y and z */
    uint32_t number_bytes, method, laplacian, order;
    uint64_t begin;    /* the byte at which its sections begin */
    bool is_first;     /* segment of the file */
    reel_leading_section *leading; /* known ones */
    uint32_t n_leading, leading_room;
    uint32_t n_tracks; /* with the positions */
    reel_block_entry *places;
    uint64_t *ends;
    uint64_t n_blocks, blocks_room, n_frames;
    uint32_t longest;  /* frames of a block */
    uint64_t end;      /* the byte behind what is complete */
    bool is_whole;
    meshreel_error damage; /* why it is not */
    uint64_t n_polygons, n_corners;
} reel_outline;

/* Parses a file into memory of `pool`: its segments, and the first of them. If there are several,
   `end`, `is_whole` and `damage` of the outline are those of the file. */
int reel_read_outline(reel_call *call, reel_pool *pool, reel_outline *outline,
                      reel_segments *segments);

/* Parses a segment, one of several, of a file with this outline. */
int reel_read_segment(reel_call *call, reel_pool *pool, const reel_outline *file,
                      const reel_segments *segments, uint32_t number, reel_outline *outline);

/* The only leading section of an id. */
int reel_only_section(reel_call *call, const reel_outline *outline, uint32_t id,
                      reel_range *payload);

/* The bytes of a track in a block. */
reel_range reel_group_bytes(const reel_outline *outline, uint64_t block, uint32_t track);

#endif
