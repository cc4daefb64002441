/* Attributes: values of vertices, faces or corners that are constant over time. */

#ifndef REEL_ATTRIBUTES_H
#define REEL_ATTRIBUTES_H

#include "polygons.h"

/* Decode a section ATTRIBUTE or ATTRIBUTE_FROM_POINTS into memory of `pool`. */
int reel_read_attribute(reel_call *call, reel_pool *pool, const reel_faces *faces,
                        const reel_section *section, meshreel_attribute *result);

#endif
