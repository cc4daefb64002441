/* The surface of a mesh: polygons, attributes, groups, parts, materials and images. */

#ifndef REEL_READER_SURFACE_H
#define REEL_READER_SURFACE_H

#include "polygons.h"

/* Decode the sections of a surface into memory of `pool`. */
int reel_read_surface(reel_call *call, reel_pool *pool, const reel_faces *faces,
                      meshreel_surface *surface);

#endif
