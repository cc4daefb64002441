/* The triangles of a file, and the order in which its vertices go out. */

#ifndef REEL_TRIANGLES_H
#define REEL_TRIANGLES_H

#include "container.h"

/* Room that is needed to find them, beside the internal faces. */
size_t reel_triangles_scratch(const reel_outline *outline);

/* Decodes the internal faces, n_faces x 3; the internal number of each vertex that goes out,
   `sequence`, and back, `outward`; and the triangles as they go out. Returns a code. */
int reel_decode_triangles(const reel_outline *outline, reel_arena scratch, int32_t *faces,
                          int32_t *sequence, int32_t *outward, uint32_t *triangles);

#endif
