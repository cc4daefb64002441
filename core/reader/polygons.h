/* Faces with more corners than three, as fans of triangles: docs/format.md, POLYGONS. */

#ifndef REEL_POLYGONS_H
#define REEL_POLYGONS_H

#include "container.h"

/* The faces of a mesh: the triangles as they go out, and the sizes of faces, NULL where all are
   triangles. */
typedef struct {
    const reel_outline *outline;
    const uint32_t *triangles, *sizes;
} reel_faces;

/* Decodes the sizes of faces, the section POLYGONS, to memory of `pool`; NULL where all faces are
   triangles. */
int reel_read_face_sizes(reel_call *call, reel_pool *pool, const reel_outline *outline,
                         const uint32_t **face_sizes);

/* The corner of a face at each corner of the triangles, n_faces x 3; corners are numbered face by
   face. */
void reel_find_fans(const reel_outline *outline, const uint32_t *face_sizes, int32_t *corners);

/* The vertex at each of the n_corners corners of faces. */
void reel_find_corner_vertices(const reel_outline *outline, const uint32_t *triangles,
                               const uint32_t *face_sizes, int32_t *vertices);

#endif
