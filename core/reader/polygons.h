/* Faces with more than three corners, cut into triangles: docs/format.md, POLYGONS. */

#ifndef REEL_POLYGONS_H
#define REEL_POLYGONS_H

#include "container.h"

/* The faces of a mesh: output triangles, and if some have more than three corners, the sizes of all
   and the face corner at each corner of the triangles, n_faces x 3; otherwise NULL. Face corners
   are numbered face by face. With ATTRIBUTE_FROM_POINTS, also the positions of the first frame. */
typedef struct {
    const reel_outline *outline;
    const uint32_t *triangles, *sizes;
    const int32_t *corners;
    const void *positions;
} reel_faces;

/* Decode the sizes of faces, the section POLYGONS, into memory of `pool`. */
int reel_read_face_sizes(reel_call *call, reel_pool *pool, const reel_outline *outline,
                         reel_faces *faces);

/* Find the face corners of the triangles, after the sizes, in memory of `pool`. */
int reel_find_triangle_corners(reel_call *call, reel_pool *pool, reel_faces *faces);

REEL_INLINE int32_t reel_corner_at(const reel_faces *faces, uint64_t triangle_corner) {
    return faces->corners ? faces->corners[triangle_corner] : (int32_t)triangle_corner;
}

/* Find the vertex at each of the n_corners corners of faces. */
void reel_find_corner_vertices(const reel_faces *faces, int32_t *vertices);

#endif
