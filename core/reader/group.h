/* A track of a block as it is stored. */

#ifndef REEL_GROUP_H
#define REEL_GROUP_H

#include "tracks.h"

typedef struct {
    uint64_t n_frames, n_modes;
    /* How fields are predicted. */
    uint64_t precision, reference, stencil_size, n_learned;
    float step;
    /* Modes whose fields are those of the key block, and how much finer their vectors are. */
    uint64_t n_reused;
    float finer;
    /* Runs of resting times: how many, their integers, and the bits of their steps. */
    uint64_t n_rests, rest_bits;
    reel_range rests;
    bool has_cosines; /* BASIS holds coefficients of a cosine transform over time */
    reel_range basis, coefficients;
    /* Corrections: their step, how many items have some, how many there are; and the integers. */
    float correction_step;
    uint64_t n_corrected, n_corrections;
    reel_range moves;
    /* Exact values: the step of a grid of positions, 0 without one; and the bits. */
    double grid;
    reel_range values, missing;
} reel_group;

/* Reads what the sections of track `number` of a block say of themselves, and where `is_checked`
   says so compares their checksums. Corrections may be more than there are values. */
int reel_read_group(reel_call *call, const reel_outline *outline, const reel_track *track,
                    uint32_t number, uint64_t block, bool is_checked, reel_group *group);

/* Finds which of the frames of a block rest: a byte for each, 1 where one does, in scratch memory;
   NULL where none rests. */
int reel_read_rests(reel_call *call, const reel_group *group, uint8_t **rests);

/* The same of a method of the paper, whose number of modes alone is read. */
int reel_read_paper_group(reel_call *call, const reel_outline *outline, uint64_t block,
                          bool is_checked, reel_group *group);

/* Corrections by frame: those of frame t are starts[t]..starts[t + 1] - 1, each of an item as it
   goes out, ascending, with n_columns numbers of `moves` in diagonals. */
typedef struct {
    int64_t *starts;
    int32_t *items;
    double *moves;
} reel_corrections;

/* Reads them to memory of `pool`. `inverse` is the number of each item as it goes out, or NULL. */
int reel_read_corrections(reel_call *call, reel_pool *pool, const reel_group *group,
                          uint32_t n_columns, uint64_t n_items, const int32_t *inverse,
                          reel_corrections *found);

#endif
