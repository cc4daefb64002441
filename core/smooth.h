/* Fields that are smooth on a graph. */

#ifndef REEL_SMOOTH_H
#define REEL_SMOOTH_H

#include "graph.h"

/* Memory for graphs of up to so many vertices. */
typedef struct {
    float *fields; /* n + 1 x REEL_SMOOTH_FIELDS; the last of these rows is 0 */
    float *others; /* the same */
    int32_t *near; /* rows of neighbours, filled up with n to multiples of some number */
    uint16_t *signs;
    int lanes; /* doubles of the machine's widest vectors */
} reel_smoother;

size_t reel_smoother_room(size_t n, size_t n_near);
reel_smoother reel_take_smoother(reel_arena *arena, size_t n, size_t n_near);

/* Smooth fields of a graph, REEL_SMOOTH_FIELDS of each vertex. */
void reel_smooth(const reel_smoother *smoother, const reel_graph *graph, float *rows);

#endif
