/* A group: the stored sections of one track in one block. */

#ifndef REEL_GROUP_H
#define REEL_GROUP_H

#include "tracks.h"

typedef struct {
    uint64_t n_frames, n_modes;
    /* Prediction of the fields. */
    uint64_t precision, reference, stencil_size, n_learned;
    float step;
    /* Modes that reuse fields of the key block, and how much finer their basis vectors are. */
    uint64_t n_reused;
    float finer;
    /* Runs of resting times: their number, the fractional bits of their integers, and the coded
       runs. */
    uint64_t n_rests, rest_bits;
    reel_range rests;
    bool has_cosines; /* BASIS holds coefficients of a cosine transform over time */
    bool is_adaptive; /* BASIS holds times whose predictions adapt */
    double nugget;    /* of the initial weights, from points; 0: from connectivity */
    uint64_t related; /* tracks from the related one to this one; 0: none */
    reel_range basis, coefficients;
    /* Corrections: their step, number of corrected items, number of corrections, and the coded
       integers. */
    float correction_step;
    uint64_t n_corrected, n_corrections;
    reel_range corrections;
    /* Stored values: the step of their grid, or 0 if they are exact; whether these are integers on
       the surface, and of one frame, which all repeat; and the bits. */
    double grid;
    bool is_on_surface, is_still;
    reel_range values, rounding, missing;
} reel_group;

/* Parse the sections of track `number` in a block, with `is_checked` also their checksums. The
   number of corrections is not yet bounded by the number of values. */
int reel_read_group(reel_call *call, const reel_outline *outline, const reel_track *track,
                    uint32_t number, uint64_t block, bool is_checked, reel_group *group);

/* Find the resting frames of a block: a flag per frame in scratch memory; NULL if none rests. */
int reel_read_rests(reel_call *call, const reel_group *group, uint8_t **rests);

/* As reel_read_group for a method of the paper: read only the numbers of frames and modes. */
int reel_read_paper_group(reel_call *call, const reel_outline *outline, uint64_t block,
                          bool is_checked, reel_group *group);

/* Corrections by frame: those of frame t are starts[t]..starts[t + 1] - 1, each of an output item,
   ascending, with n_columns numbers of `offsets` in diagonals. */
typedef struct {
    int64_t *starts;
    int32_t *items;
    double *offsets;
} reel_corrections;

/* Decode the corrections into memory of `pool`. `inverse` is the output index of items, or NULL. */
int reel_read_corrections(reel_call *call, reel_pool *pool, const reel_group *group,
                          uint32_t n_columns, uint64_t n_items, const int32_t *inverse,
                          reel_corrections *result);

/* Offsets of the numbers on a grid, for the coordinates lowest[axis]..lowest[axis] + n[axis] - 1 of
   each axis. */
typedef struct {
    int64_t lowest[3], n[3];
    int32_t *offsets[3];
} reel_rounding;

/* Decode the offsets into memory of `pool`; `max_rows` bounds those of an axis. */
int reel_read_rounding(reel_call *call, reel_pool *pool, const reel_group *group, uint64_t max_rows,
                       reel_rounding *result);

#endif
