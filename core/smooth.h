/* Smooth fields of a graph; see smooth.c. */

#ifndef REEL_SMOOTH_H
#define REEL_SMOOTH_H

#include "graph.h"

/* Memory for graphs of up to n vertices. */
typedef struct {
    float *fields;   /* n + 1 x REEL_SMOOTH_FIELDS; the last row is 0 */
    float *previous; /* previous step of the recurrence, of the same size */
    int32_t *near;   /* neighbor lists as offsets into fields, padded */
    uint16_t *signs;
    int lanes; /* doubles in the widest vectors */
} reel_smoother;

reel_smoother reel_allocate_smoother(reel_arena *arena, size_t n, size_t n_near);

/* Compute the smooth fields of a graph, a row of REEL_SMOOTH_FIELDS for each vertex. */
void reel_smooth(const reel_smoother *smoother, const reel_graph *graph, float *rows);

#endif
