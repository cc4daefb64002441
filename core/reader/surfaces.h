/* The surface of a mesh: polygons, attributes, groups, parts, materials and images. */

#ifndef REEL_READER_SURFACE_H
#define REEL_READER_SURFACE_H

#include "polygons.h"

/* Decode the sections of a surface into memory of `pool`, for output triangles and the face sizes
   from reel_read_face_sizes. */
int reel_read_surface(reel_call *call, reel_pool *pool, const reel_outline *outline,
                      const uint32_t *triangles, const uint32_t *face_sizes,
                      meshreel_surface *surface);

#endif
