/* The times of frames that are not evenly spaced: docs/format.md, "Times". */

#ifndef REEL_TIMES_H
#define REEL_TIMES_H

#include "container.h"

/* Read the times of the first `n_frames` frames, in seconds, into memory of `pool`. There may be
   more if `is_cut`. */
int reel_read_times(reel_call *call, reel_pool *pool, reel_range data, uint64_t n_frames,
                    bool is_cut, double **times);

#endif
