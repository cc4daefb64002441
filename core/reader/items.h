/* What the values of a track lie on, and how they go out. */

#ifndef REEL_ITEMS_H
#define REEL_ITEMS_H

#include "mesh.h"
#include "tracks.h"

typedef struct {
    reel_graph graph;
    const int32_t *order;   /* the item of each value before they are spread, or NULL: its own */
    const int32_t *inverse; /* the value of each item, likewise */
    const int32_t *spread;  /* the value that goes out at each place, or NULL: its own */
    const int32_t *vertex;  /* as it goes out, that the normal of each value is of; NULL: its own */
    const int32_t *polygon; /* of each triangle, where values are of faces */
} reel_items;

/* Finds the items of a track in memory of `pool`. */
int reel_find_items(reel_call *call, reel_pool *pool, const reel_outline *outline,
                    const reel_mesh_data *mesh, const uint32_t *face_sizes, const reel_track *track,
                    reel_items *items);

#endif
