/* Weights of predictions from positions. */

#ifndef REEL_POINTS_H
#define REEL_POINTS_H

#include "file.h"
#include "items.h"

/* Find the initial weights of the items of a track, n_items x stencil_size in coding order, in
   scratch memory. `numbers` are the positions of a frame in output order, of the file's type. */
int reel_find_weights(reel_call *call, const meshreel_file *file, const reel_track *track,
                      const reel_items *items, const reel_field_mesh *field_mesh,
                      const void *numbers, double nugget, const float **weights);

#endif
