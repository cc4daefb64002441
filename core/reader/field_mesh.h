/* The hierarchy of a mesh for a size of stencils, and the order in which its fields are coded. */

#ifndef REEL_READER_FIELD_MESH_H
#define REEL_READER_FIELD_MESH_H

#include "../base.h"

/* The order in which the columns of fields are coded, as reel_fields_decode takes it. */
typedef struct {
    int64_t n_columns, n_passes;
    int32_t *columns, *near;
    int64_t *pass_starts, *near_starts;
} reel_coding_order;

typedef struct {
    reel_mesh mesh;
    reel_coding_order order;
    int32_t *rows; /* the place in coding order of each vertex that goes out */
} reel_field_mesh;

/* The vertices next to each vertex, as of reel_adjacency. */
typedef struct {
    int64_t n_verts;
    const int32_t *starts, *near;
} reel_neighbours;

/* Room that a hierarchy takes for good, and room that is needed to find it. */
size_t reel_field_mesh_room(int64_t n_verts, int64_t stencil_size);
size_t reel_field_mesh_scratch(int64_t n_verts, int64_t n_near);

/* Finds it; NULL where memory is too little. `sequence` is the internal number of each vertex that
   goes out. Returns a failure of the core, or 0. */
int64_t reel_find_field_mesh(reel_arena *arena, reel_arena scratch, const reel_neighbours *graph,
                             int64_t stencil_size, const int32_t *sequence,
                             reel_field_mesh **found);

/* The order in which the temporal basis of a track with n_columns is coded, for times that
   rest as reel_basis takes them. */
#define REEL_TIME_PASSES 4 /* at most */
size_t reel_time_order_room(int64_t n_columns, int64_t n_frames);
int64_t reel_time_neighbours(int64_t n_columns, int64_t n_frames); /* at most */
bool reel_find_time_order(reel_arena *arena, int64_t n_columns, int64_t n_frames,
                          const uint8_t *rests, reel_coding_order *found);

#endif
