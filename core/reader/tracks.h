/* The tracks of a file: the positions and other quantities over time. */

#ifndef REEL_TRACKS_H
#define REEL_TRACKS_H

#include "container.h"

enum reel_coding {
    REEL_MODES = 0,
    REEL_EXACT = 1,
    REEL_ROTATIONS = 2, /* of the normals of the surface */
    REEL_BACKWARD = 3,
    REEL_CENTRAL = 4,
    REEL_FORWARD = 5,
    REEL_EXACT_BACKWARD = 6,
    REEL_EXACT_FORWARD = 8
};

/* Which corners of faces have equal values. */
enum reel_sharing { REEL_EACH = 0, REEL_OF_VERTICES = 1, REEL_OF_ROWS = 2 };

typedef struct {
    meshreel_track info;
    uint32_t sharing;
    uint32_t n_coded;    /* columns of what is coded */
    uint32_t difference; /* REEL_BACKWARD to REEL_FORWARD, of positions; or 0 */
    uint32_t size;       /* bytes of a number */
    bool is_float, is_signed;
    double *placement;   /* scale, and origin of each column that is coded */
    double rate;
    reel_range rows; /* of REEL_OF_ROWS */
} reel_track;

/* Parses what the file says of its tracks, into memory of `pool`; the positions are the first. */
int reel_read_tracks(reel_call *call, reel_pool *pool, const reel_outline *outline,
                     reel_track **tracks);

#endif
