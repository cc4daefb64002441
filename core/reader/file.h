/* An open file, shared by the decoders of its blocks. */

#ifndef REEL_FILE_H
#define REEL_FILE_H

#include "field_mesh.h"
#include "polygons.h"
#include "tracks.h"

struct meshreel_file {
    meshreel_source source;
    meshreel_host host;
    reel_pool pool;
    meshreel_info info;
    double *times; /* of frames that are not evenly spaced, or NULL */
    reel_outline outline;
    reel_segments segments;
    bool is_segment; /* one of several segments of the source */
    reel_track *tracks;
    bool has_mesh, has_surface;
    reel_mesh_data mesh;
    reel_faces faces;
    /* Hierarchy of the vertices, for the stencil size of the first block; or NULL. */
    const reel_field_mesh *field_mesh;
    meshreel_surface surface;
};

/* Whether the file uses a method of the paper, of which only the container is read here. */
REEL_INLINE bool reel_is_of_paper(const meshreel_file *file) {
    return file->outline.method < REEL_METHOD_REEL;
}

/* Begin a call on an open file, whose object holds `n_bytes` bytes. */
reel_call reel_begin_file_call(const meshreel_file *file, uint64_t n_bytes);

/* Check what the counts of the header announce for the mesh against the limit, before work; finds
   the stencil size of the first block, or 0. */
int reel_check_mesh(reel_call *call, const meshreel_file *file, int64_t *stencil);

/* Fail a call that needs a single segment, for a file of several. */
int reel_refuse_several(meshreel_error *error);

#endif
