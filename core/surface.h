/* A face list as closed, oriented manifold surfaces: what the connectivity encoder traverses.

   Half-edge he = 3 f + k of face f goes from its corner k to corner (k + 1) mod 3. Every
   half-edge has a twin, the same edge seen from the other face. Each boundary edge is closed by an
   additional face whose third corner is a cap: a virtual point that closes a whole boundary loop. A
   point is a corner shared by the faces around it; a vertex where several fans of faces meet is
   split into as many points. */

#ifndef REEL_SURFACE_H
#define REEL_SURFACE_H

#include "base.h"

#define REEL_MAX_ITEMS ((int64_t)1 << 26) /* vertices, and faces, of a mesh */

typedef struct {
    int64_t n_faces;   /* given faces, M; degenerate ones have no half-edges */
    int64_t n_flat;    /* degenerate faces among them */
    int64_t n_closing; /* closing faces M, M + 1, ...: one per boundary edge */
    int64_t n_used;    /* vertices used by non-degenerate faces */
    int64_t n_caps;    /* caps */
    bool has_flipped;  /* some faces are flipped */
    bool pinched;      /* some vertices are several points */
    int32_t *twin;     /* of each half-edge */
    int32_t *point;    /* origin of each half-edge */
    int32_t *vertex;   /* of each point; -1 for caps */
    int32_t *degree;   /* of each point: number of faces around it */
    uint8_t *flipped;  /* is the given face flipped to agree with its neighbors? */
    uint8_t *flat;     /* is the given face degenerate? */
} reel_surface;

/* The next and the previous half-edge of the same face. */
REEL_INLINE int32_t reel_next_half_edge(int32_t he) {
    return he % 3 == 2 ? he - 2 : he + 1;
}

REEL_INLINE int32_t reel_previous_half_edge(int32_t he) {
    return he % 3 == 0 ? he + 2 : he - 1;
}

/* Bytes of the arena that `reel_find_surface` takes. */
size_t reel_surface_memory(int64_t n_verts, int64_t n_faces);

/* Build the surface of faces of vertices 0..n_verts-1; returns false if the arena is too small. */
bool reel_find_surface(reel_arena *arena, const int32_t *faces, int64_t n_faces, int64_t n_verts,
                       reel_surface *result);

#endif
