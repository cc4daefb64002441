/* Cells of a volume mesh; the faces are their surface. docs/format.md, CELLS. */

#ifndef REEL_READER_CELL_MESH_H
#define REEL_READER_CELL_MESH_H

#include "mesh.h"

/* Decode cells, and the faces of their surface, in internal order. */
int reel_decode_cells(reel_call *call, reel_pool *pool, const reel_outline *outline,
                      reel_mesh_data *mesh);

/* Restore the output order of vertices and cells, and find the faces of their surface. */
int reel_order_cells(reel_call *call, reel_pool *pool, const reel_outline *outline,
                     reel_mesh_data *mesh);

/* Find the neighbors of internal vertices along edges, or of output cells across sides. */
int reel_find_cell_graph(reel_call *call, reel_pool *pool, const reel_outline *outline,
                         const reel_mesh_data *mesh, bool of_cells, reel_graph *graph);

/* Find the neighbors of internal vertices. */
int reel_find_vertex_graph(reel_call *call, reel_pool *pool, const reel_outline *outline,
                           const reel_mesh_data *mesh, reel_graph *graph);

/* Find the neighbors of vertices. Single frames that may be on a grid wait for their block, which
   may not need them: then `starts` is NULL. */
int reel_find_graph(reel_call *call, reel_pool *pool, const reel_outline *outline,
                    reel_mesh_data *mesh);

#endif
