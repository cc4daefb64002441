/* The tracks of a file: positions, and other quantities over time. */

#ifndef REEL_TRACKS_H
#define REEL_TRACKS_H

#include "container.h"

enum reel_coding {
    REEL_MODES = 0,
    REEL_EXACT = 1,
    REEL_ROTATIONS = 2, /* rotations of surface normals */
    REEL_BACKWARD = 3,
    REEL_CENTRAL = 4,
    REEL_FORWARD = 5,
    REEL_EXACT_BACKWARD = 6,
    REEL_EXACT_FORWARD = 8
};

/* Which corners of faces share values. */
enum reel_sharing { REEL_UNSHARED = 0, REEL_OF_VERTICES = 1, REEL_OF_ROWS = 2 };

typedef struct {
    meshreel_track info;
    uint32_t sharing;
    uint32_t n_coded;    /* coded columns */
    uint32_t difference; /* of positions, as predictor: REEL_BACKWARD to REEL_FORWARD, or 0 */
    uint32_t size;       /* bytes per number */
    bool is_float, is_signed;
    double *placement; /* scale, and origin of each coded column */
    double rate;     /* predicted velocity over difference */
    reel_range rows; /* for REEL_OF_ROWS */
} reel_track;

/* Parse the tracks of a file into memory of `pool`; positions come first. */
int reel_read_tracks(reel_call *call, reel_pool *pool, const reel_outline *outline,
                     reel_track **tracks);

#endif
