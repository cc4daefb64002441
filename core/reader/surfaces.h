/* The surface of a mesh: polygons, attributes, groups, parts, materials and images. */

#ifndef REEL_READER_SURFACE_H
#define REEL_READER_SURFACE_H

#include "polygons.h"

/* Decodes the sections of a surface to memory of `pool`. `triangles` are as they go out,
   `face_sizes` as reel_read_face_sizes finds them. */
int reel_read_surface(reel_call *call, reel_pool *pool, const reel_outline *outline,
                      const uint32_t *triangles, const uint32_t *face_sizes,
                      meshreel_surface *surface);

#endif
