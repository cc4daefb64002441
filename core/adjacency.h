/* Graphs from pairs of vertices, in linear time and without sorting. */

#ifndef REEL_ADJACENCY_H
#define REEL_ADJACENCY_H

#include "graph.h"

/* Memory to join pairs with: lists of `n` vertices with `pairs` entries in all. */
typedef struct {
    int32_t *starts; /* n + 1: where the highs of a low begin; later a cursor */
    int32_t *highs;  /* pairs */
    int32_t *firsts; /* n + 1: where the lows of a high begin */
    int32_t *ends;   /* n */
    int32_t *lows;   /* pairs */
} reel_joiner;

size_t reel_joiner_room(size_t n, size_t pairs);
reel_joiner reel_take_joiner(reel_arena *arena, size_t n, size_t pairs);

/* The graph of n vertices with edges low < high, given as low, high, low, high, ... in `near`,
   where the neighbours are written: it has room for 2 x pairs. Returns how many there are. */
int32_t reel_join(const reel_joiner *joiner, int32_t n, int32_t pairs, int32_t *starts,
                  int32_t *near);

#endif
