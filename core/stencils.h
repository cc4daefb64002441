/* Which vertices predict each other. */

#ifndef REEL_STENCILS_H
#define REEL_STENCILS_H

#include "graph.h"

#define REEL_STATES 4      /* of vertices: kept, or of one of three levels */
#define REEL_PLACE_BITS 27 /* of a vertex of a graph, at most */

/* Of a row: where the neighbours of each state but the last end. */
typedef struct {
    int32_t of[REEL_STATES - 1];
} reel_ends;

/* Memory for graphs of up to so many vertices and neighbours. */
typedef struct {
    int32_t *rows;   /* neighbours of each vertex by state */
    reel_ends *ends;
    uint64_t *seen;  /* the last search that came by, its ring, and its shortest paths */
    int32_t *ring;   /* what a search goes on from */
    int32_t *next;
    int32_t *found;  /* keys of what may be in a stencil */
    int lanes;       /* doubles of the widest vectors */
} reel_searcher;

size_t reel_searcher_room(size_t n, size_t n_near);
reel_searcher reel_take_searcher(reel_arena *arena, size_t n, size_t n_near);

/* Stencils of the vertices order[0 .. n - 1] of a graph, whose states are 1 or more: up to
   `size` vertices of lower state, -1 behind them, and how many edges away they are. */
void reel_find_stencils(reel_searcher *own, const reel_graph *graph, const uint8_t *states,
                        const int32_t *order, int32_t n, int32_t size, int32_t *stencil,
                        uint8_t *hops);

#endif
