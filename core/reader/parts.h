/* Decoding of many small segments in one call, for hosts for which each call is expensive. */

#ifndef REEL_PARTS_H
#define REEL_PARTS_H

#include "../include/meshreel.h"
#include "../reel.h"

/* Frames of a segment. */
typedef struct {
    meshreel_file *file; /* an open segment that nothing else uses */
    uint32_t first, count;
    uint32_t n_modes;      /* of positions; as for `meshreel_load` */
    uint32_t with_surface; /* call meshreel_read_surface too */
    void *const *values;   /* packed values of these frames, for each track */
    meshreel_error error;  /* receives the result */
} reel_part;

/* Decode at least one part, each on one thread. All segments must be of one file, whose host must
   allow `allocate` and `release` on any thread, unlike in meshreel.h. */
REEL_API void reel_decode_parts(reel_part *parts, uint32_t n_parts);

#endif
