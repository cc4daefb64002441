/* Hard edges, across which faces do not share normals. */

#ifndef REEL_HARD_EDGES_H
#define REEL_HARD_EDGES_H

#include "polygons.h"

/* Decode hard edges as pairs of vertices into memory of `pool`. */
int reel_read_hard_edges(reel_call *call, reel_pool *pool, const reel_faces *faces,
                         reel_range payload, meshreel_surface *surface);

#endif
