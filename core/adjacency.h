/* Graphs from lists of edges, in linear time and without comparison sorts. */

#ifndef REEL_ADJACENCY_H
#define REEL_ADJACENCY_H

#include "graph.h"

/* Memory for graphs of up to n vertices and n_edges edges. */
typedef struct {
    int32_t *starts; /* n + 1: where the upper ends of a lower end begin; later a cursor */
    int32_t *highs;  /* upper ends by lower end */
    int32_t *firsts; /* n + 1: where the lower ends of an upper end begin */
    int32_t *ends;   /* n: where the lists of lower ends end */
    int32_t *lows;   /* lower ends by upper end */
} reel_adjacency_builder;

reel_adjacency_builder reel_allocate_adjacency_builder(reel_arena *arena, size_t n, size_t n_edges);

/* Build the graph of n vertices with edges low < high. `near` holds the edges as low, high, low,
   high, ..., possibly repeated, and receives the neighbors: it has space for 2 n_edges numbers.
   Returns the number of neighbors. */
int32_t reel_build_adjacency(const reel_adjacency_builder *builder, int32_t n, int32_t n_edges,
                             int32_t *starts, int32_t *near);

#endif
