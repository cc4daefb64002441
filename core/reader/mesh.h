/* Data shared by the blocks of a file: triangles, vertex order, and adjacency. */

#ifndef REEL_READER_MESH_H
#define REEL_READER_MESH_H

#include "container.h"

/* The graph of the items that values are stored for: the neighbors of item i are near[starts[i]] to
   near[starts[i + 1] - 1], as from reel_adjacency. */
typedef struct {
    uint32_t n_items;
    const int32_t *starts, *near;
} reel_graph;

typedef struct {
    int32_t *internal_faces; /* n_faces x 3 internal vertices */
    int32_t *twins;          /* of their half-edges; NULL unless the method is lossless or grid */
    uint32_t *triangles;     /* n_faces x 3 output vertices */
    int32_t *to_internal;    /* internal number of each output vertex */
    int32_t *to_output;      /* output number of each internal vertex */
    reel_graph graph;        /* adjacency of internal vertices; see reel_find_graph */
    uint8_t *cell_types;     /* in internal order; these four are NULL or empty without cells */
    int32_t *cell_nodes;     /* internal vertices */
    meshreel_cells cells;    /* in output order */
    int32_t *face_sizes;     /* corners of the faces of their surface */
} reel_mesh_data;

/* Decode the faces in internal order from CONNECTIVITY. */
int reel_decode_connectivity(reel_call *call, reel_pool *pool, const reel_outline *outline,
                             reel_mesh_data *mesh);

/* Whether positions may be on a grid; decoding a single frame on a grid needs twins. */
REEL_INLINE bool reel_may_be_on_grid(const reel_outline *outline) {
    return outline->method == REEL_METHOD_LOSSLESS || outline->method == REEL_METHOD_GRID;
}

/* Decode the output order of vertices and triangles. Preparation allocates all memory, so that
   decoding may run on another thread. */
typedef struct reel_order_job reel_order_job;
int reel_prepare_order(reel_call *call, reel_pool *pool, const reel_outline *outline,
                       reel_mesh_data *mesh, reel_order_job **job);
void reel_decode_order(reel_order_job *job);
int reel_finish_order(reel_call *call, const reel_order_job *job);

/* First corner of each output face in the internal faces, or NULL if these are in output order. */
const int32_t *reel_order_corners(const reel_order_job *job);

/* Find the adjacency of items joined by faces, n_faces x 3 items. */
int reel_find_neighbors(reel_call *call, reel_pool *pool, const int32_t *faces, uint64_t n_faces,
                        uint32_t n_items, reel_graph *graph);

/* Find the twin of each half-edge. */
int reel_find_twins(reel_call *call, reel_pool *pool, const int32_t *faces, uint64_t n_faces,
                    uint64_t n_verts, int32_t **twins);

#endif
