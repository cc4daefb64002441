/* Graphs of vertices, and the hash that orders vertices in the hierarchy. */

#ifndef REEL_GRAPH_H
#define REEL_GRAPH_H

#include "base.h"

/* The neighbors of vertex v are near[starts[v]] .. near[starts[v + 1] - 1], strictly ascending. */
typedef struct {
    int32_t n;
    const int32_t *starts;
    const int32_t *near;
} reel_graph;

REEL_INLINE int32_t reel_degree(const reel_graph *graph, int32_t v) {
    return graph->starts[v + 1] - graph->starts[v];
}

/* A bijective hash that ranks vertices and generates random signs. */
REEL_INLINE uint64_t reel_hash(uint64_t number) {
    uint64_t mixed = number * 0x9E3779B97F4A7C15U;
    mixed ^= mixed >> 31;
    return mixed * 0xBF58476D1CE4E5B9U;
}

#endif
