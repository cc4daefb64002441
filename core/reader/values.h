/* Values of frames of a loaded block. */

#ifndef REEL_VALUES_H
#define REEL_VALUES_H

#include "blocks.h"

/* Decode values of frames first..first+count-1 of the current block, before they are shared by
   corners: count x n_values x n_columns numbers of the track's type, or of float if `size` is 4. */
int reel_values(reel_call *call, meshreel_decoder *decoder, uint32_t track, uint64_t first,
                uint64_t count, uint32_t size, void *out);

/* Decode the positions of the first frame of a block in output order, of the file's type. */
int reel_first_positions(reel_call *call, meshreel_decoder *decoder, uint64_t block,
                         void *numbers);

#endif
