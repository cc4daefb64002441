/* Faces with more than three corners, as triangle fans: docs/format.md, POLYGONS. */

#ifndef REEL_POLYGONS_H
#define REEL_POLYGONS_H

#include "container.h"

/* The faces of a mesh: output triangles, and the sizes of faces, NULL if all are triangles. */
typedef struct {
    const reel_outline *outline;
    const uint32_t *triangles, *sizes;
} reel_faces;

/* Decode the sizes of faces, the section POLYGONS, into memory of `pool`; NULL if all faces are
   triangles. */
int reel_read_face_sizes(reel_call *call, reel_pool *pool, const reel_outline *outline,
                         const uint32_t **face_sizes);

/* Find the face corner at each corner of the triangles, n_faces x 3; face corners are numbered face
   by face. */
void reel_find_fans(const reel_outline *outline, const uint32_t *face_sizes, int32_t *corners);

/* Find the vertex at each of the n_corners corners of faces. */
void reel_find_corner_vertices(const reel_outline *outline, const uint32_t *triangles,
                               const uint32_t *face_sizes, int32_t *vertices);

#endif
