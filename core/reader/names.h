/* Unique names, of tracks and of materials. */

#ifndef REEL_READER_NAMES_H
#define REEL_READER_NAMES_H

#include "call.h"

/* Check that all names differ; sorts them. If not, fails at byte `offset` with `message`. */
int reel_check_names(reel_call *call, meshreel_text *names, uint32_t count, uint64_t offset,
                     const char *message);

#endif
