/* The items that the values of a track belong to, and their output order. */

#ifndef REEL_ITEMS_H
#define REEL_ITEMS_H

#include "mesh.h"
#include "polygons.h"
#include "tracks.h"

typedef struct {
    reel_graph graph;
    /* The first four are NULL if they would be 0, 1, 2, ... */
    const int32_t *order;    /* item of each value, before values are shared */
    const int32_t *inverse;  /* value of each item */
    const int32_t *value_of; /* value of each output item */
    const int32_t *vertex;   /* output vertex that each value's normal belongs to */
    const int32_t *polygon;  /* polygon of each triangle, for values of faces */
} reel_items;

/* Find the items of a track, in memory of `pool`. */
int reel_find_items(reel_call *call, reel_pool *pool, const reel_faces *faces,
                    const reel_mesh_data *mesh, const reel_track *track, reel_items *items);

#endif
