/* What the blocks of a file share: triangles, the order of vertices, and neighbors. */

#ifndef REEL_READER_MESH_H
#define REEL_READER_MESH_H

#include "container.h"

/* Items that values are stored for, and those next to each: of item i near[starts[i]] to
   near[starts[i + 1] - 1], as of reel_adjacency. */
typedef struct {
    uint32_t n_items;
    const int32_t *starts, *near;
} reel_graph;

typedef struct {
    int32_t *internal_faces; /* n_faces x 3, of internal vertices */
    uint32_t *triangles;     /* n_faces x 3, as they go out */
    int32_t *sequence;       /* the internal number of each vertex that goes out */
    int32_t *outward;        /* and back */
    reel_graph graph;        /* of internal vertices */
} reel_mesh_data;

/* Decodes the faces in internal order, and finds the neighbors of vertices. */
int reel_read_connectivity(reel_call *call, reel_pool *pool, const reel_outline *outline,
                           reel_mesh_data *mesh);

/* Decodes the order in which vertices and triangles go out, in memory that is prepared before: then
   it may run on another thread. */
typedef struct reel_order_job reel_order_job;
int reel_prepare_order(reel_call *call, reel_pool *pool, const reel_outline *outline,
                       reel_mesh_data *mesh, reel_order_job **job);
void reel_decode_order(reel_order_job *job);
int reel_finish_order(reel_call *call, const reel_order_job *job);

/* The neighbors of items that faces join: n_faces x 3 items. */
int reel_find_neighbors(reel_call *call, reel_pool *pool, const int32_t *faces, uint64_t n_faces,
                        uint32_t n_items, reel_graph *graph);

/* The opposite side of each side of faces, in scratch memory. */
int reel_find_twins(reel_call *call, const int32_t *faces, uint64_t n_faces, uint64_t n_verts,
                    int32_t **twins);

#endif
