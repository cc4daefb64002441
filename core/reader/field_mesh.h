/* The hierarchy of a graph, and the coding orders of fields and temporal bases. */

#ifndef REEL_READER_FIELD_MESH_H
#define REEL_READER_FIELD_MESH_H

#include "mesh.h"

/* The coding order of the columns of fields, as reel_fields_decode takes it. */
typedef struct {
    int64_t n_columns, n_passes;
    int32_t *columns, *near;
    int64_t *pass_starts, *near_starts;
} reel_coding_order;

typedef struct {
    reel_mesh mesh;
    reel_coding_order order;
    const reel_graph *graph;
    int32_t *items;     /* item at each position of the coding order */
    int32_t *positions; /* position of each item in coding order */
} reel_field_mesh;

/* Compute the hierarchy of a graph. Preparation allocates all memory, so that the computation may
   run on another thread. */
typedef struct reel_hierarchy_job reel_hierarchy_job;
int reel_prepare_hierarchy(reel_call *call, reel_pool *pool, const reel_graph *graph,
                           int64_t stencil_size, bool has_smooth, reel_hierarchy_job **job);

/* Reserve what the computation takes at least, if it has smooth fields. */
int reel_reserve_hierarchy(reel_call *call, uint64_t n_items, int64_t stencil_size);
void reel_find_hierarchy(reel_hierarchy_job *job);
int reel_finish_hierarchy(reel_call *call, const reel_hierarchy_job *job,
                          const reel_field_mesh **result);

/* Find the coding order of the temporal basis of a track, in scratch memory: for coefficients of a
   cosine transform, or for times with the flags `rests` of reel_basis. */
int reel_find_time_order(reel_call *call, int64_t n_columns, int64_t n_frames, bool has_cosines,
                         const uint8_t *rests, reel_coding_order *result);

#endif
