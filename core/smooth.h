/* Fields that are smooth on a graph. */

#ifndef REEL_SMOOTH_H
#define REEL_SMOOTH_H

#include "graph.h"

/* Memory for graphs of up to so many vertices. */
typedef struct {
    double *fields; /* n x REEL_SMOOTH_FIELDS */
    double *others; /* n x REEL_SMOOTH_FIELDS */
    uint16_t *signs;
    int lanes; /* doubles of the machine's widest vectors */
} reel_smoother;

size_t reel_smoother_room(size_t n);
reel_smoother reel_take_smoother(reel_arena *arena, size_t n);

/* Smooth fields of a graph, REEL_SMOOTH_FIELDS of each vertex. */
void reel_smooth(const reel_smoother *smoother, const reel_graph *graph, float *rows);

#endif
