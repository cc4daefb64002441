/* The positions of a block as they are stored. */

#ifndef REEL_GROUP_H
#define REEL_GROUP_H

#include "container.h"

typedef struct {
    uint64_t n_frames, n_modes;
    /* How fields are predicted, of `reel`. */
    uint64_t precision, reference, stencil_size, n_learned;
    float step;
    /* Modes whose fields are those of the key block, and how much finer their vectors are. */
    uint64_t n_reused;
    float finer;
    /* Runs of resting times: how many, their integers, and the bits of their steps. */
    uint64_t n_rests, rest_bits;
    reel_stretch rests;
    reel_stretch basis, coefficients;
    /* Corrections: their step, how many vertices have some, how many there are; and the integers. */
    float moved_by;
    uint64_t n_moved, n_moves;
    reel_stretch moves;
    /* Of `lossless` and `grid`: the step, 0 without a grid; and the values. */
    double grid;
    reel_stretch values;
} reel_group;

/* Reads what the sections of a block say of themselves; their bytes are checked where `is_checked`
   says so. What it finds is within the limits of the format. */
int reel_read_group(const reel_outline *outline, const reel_place *place, bool is_checked,
                    reel_group *group);

/* Sets a byte for each of its frames, 1 where the time rests. Returns a code. */
int reel_read_rests(const meshreel_source *source, const reel_group *group, uint8_t *rests);

#endif
