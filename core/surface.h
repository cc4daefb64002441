/* A face list as closed, oriented surfaces: what the encoder of connectivity walks over.

   Side 3 f + k of face f goes from its corner k to corner (k + 1) mod 3. Every side has a twin, the
   same edge seen from the other face. Where the given faces leave an edge open, a face is added
   behind it, whose third corner is a cap: a point that closes a whole loop of open edges. A point
   is a corner of all faces around it; a vertex at which several fans of faces meet is as many
   points. */

#ifndef REEL_SURFACE_H
#define REEL_SURFACE_H

#include "base.h"

#define REEL_MOST_ITEMS ((int64_t)1 << 26) /* vertices, and faces, of a mesh */

typedef struct {
    int64_t n_faces;   /* given ones, M; degenerate ones have no sides */
    int64_t n_flat;    /* degenerate ones among them */
    int64_t n_closing; /* faces M, M + 1, ... that are added: one for each open edge */
    int64_t n_used;    /* vertices of faces that are not degenerate */
    int64_t n_caps;    /* points that are no vertex */
    bool turns;        /* some faces are turned over */
    bool pinched;      /* some vertices are several points */
    int32_t *twin;     /* of each side */
    int32_t *point;    /* at which each side starts */
    int32_t *vertex;   /* of each point; -1 of a cap */
    int32_t *degree;   /* of each point: faces around it */
    uint8_t *turned;   /* is the given face turned over, to go the way of its neighbours? */
    uint8_t *flat;     /* is the given face degenerate? */
} reel_surface;

/* The side behind and before one of the same face. */
REEL_INLINE int32_t reel_side_after(int32_t side) {
    return side % 3 == 2 ? side - 2 : side + 1;
}

REEL_INLINE int32_t reel_side_before(int32_t side) {
    return side % 3 == 0 ? side + 2 : side - 1;
}

/* Bytes of an arena that `reel_find_surface` takes. */
size_t reel_surface_memory(int64_t n_verts, int64_t n_faces);

/* The surface of faces whose corners are 0..n_verts-1; false where the arena is too small. */
bool reel_find_surface(reel_arena *arena, const int32_t *faces, int64_t n_faces, int64_t n_verts,
                       reel_surface *found);

#endif
