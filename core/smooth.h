/* Weights of stencils that reproduce what is smooth on a graph. */

#ifndef REEL_SMOOTH_H
#define REEL_SMOOTH_H

#include "graph.h"

#define REEL_SMOOTH_FIELDS 16

/* Memory for graphs of up to so many vertices. */
typedef struct {
    double *fields; /* n x REEL_SMOOTH_FIELDS */
    double *others; /* n x REEL_SMOOTH_FIELDS */
    uint16_t *signs;
    bool wide; /* the machine has wider vectors */
} reel_smoother;

size_t reel_smoother_room(size_t n);
reel_smoother reel_take_smoother(reel_arena *arena, size_t n);

/* Smooth weights of each row of stencils, S for each; they sum to 1. */
void reel_smooth_weights(const reel_smoother *smoother, const reel_graph *graph,
                         const reel_stencils *stencils, double *weights);

#endif
