/* A mesh as an edit of another one: docs/format.md, EDIT. */

#ifndef REEL_READER_EDIT_H
#define REEL_READER_EDIT_H

#include "mesh.h"

/* Decode the base mesh from CONNECTIVITY and ORDER, and apply EDIT, which must be present. */
int reel_read_edited_mesh(reel_call *call, reel_pool *pool, const reel_outline *outline,
                          reel_mesh_data *mesh);

#endif
