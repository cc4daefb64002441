/* Stencils: the vertices that predict each vertex; see stencils.c. */

#ifndef REEL_STENCILS_H
#define REEL_STENCILS_H

#include "graph.h"

#define REEL_STATES 4       /* of vertices: in the coarser resolution, or in one of three levels */
#define REEL_VERTEX_BITS 27 /* bits of a vertex number */

/* Ends of the neighbors of each state but the last, in a row. */
typedef struct {
    int32_t by_state[REEL_STATES - 1];
} reel_row_ends;

/* Memory for graphs of up to n vertices and n_near neighbors. */
typedef struct {
    int32_t *rows; /* neighbors of each vertex, sorted by state */
    reel_row_ends *ends;
    /* Per vertex: last search that visited it, its ring, and its number of shortest paths. */
    uint64_t *visits;
    int32_t *ring; /* current ring of the search */
    int32_t *next;
    int32_t *keys; /* sort keys of stencil candidates */
    int lanes;     /* doubles in the widest vectors */
} reel_stencil_finder;

reel_stencil_finder reel_allocate_stencil_finder(reel_arena *arena, size_t n, size_t n_near);

/* Find the stencils of the vertices order[0 .. n - 1], whose states are 1 or more: up to `size`
   vertices of lower state, padded with -1, and their distances in edges. The stencils of midpoints
   of edges have neighbors only; `is_midpoint` may be NULL. */
void reel_find_stencils(reel_stencil_finder *finder, const reel_graph *graph, const uint8_t *states,
                        const uint8_t *is_midpoint, const int32_t *order, int32_t n, int32_t size,
                        int32_t *stencil, uint8_t *hops);

#endif
