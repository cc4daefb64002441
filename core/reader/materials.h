/* Materials, their textures, and images. */

#ifndef REEL_MATERIALS_H
#define REEL_MATERIALS_H

#include "source.h"

/* Decode a section MATERIAL of a file with n_images images. */
int reel_read_material(reel_call *call, reel_pool *pool, reel_range payload, uint32_t n_images,
                       meshreel_material *result);

/* Decode a section IMAGE. */
int reel_read_image(reel_call *call, reel_pool *pool, reel_range payload, meshreel_image *result);

#endif
