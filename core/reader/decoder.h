/* A decoder: of each track, the block that it holds. */

#ifndef REEL_DECODER_H
#define REEL_DECODER_H

#include "file.h"
#include "group.h"
#include "items.h"

#define REEL_NO_BLOCK UINT64_MAX

/* Decoded fields of a block: n_items x n_modes, in steps, in coding order. */
typedef struct {
    reel_pool pool;
    uint64_t block; /* or REEL_NO_BLOCK; blocks of which not all modes were read are not here */
    uint64_t reference, stencil_size, n_modes;
    double *values;
} reel_block_fields;

/* A track of a block. */
typedef struct {
    uint64_t block;      /* or REEL_NO_BLOCK */
    uint64_t n_moving;   /* modes that move; 0: all */
    reel_group group;
    reel_pool pool;      /* of what follows */
    uint64_t n_modes;    /* that were read */
    double *basis;       /* n_coded x n_frames x n_modes */
    uint8_t *packed;     /* the fields, in the order in which values go out; NULL before products */
    int32_t *rows;       /* of `fields`, of each item as it goes out; NULL before they are needed */
    reel_corrections moves;
    void *exact;         /* n_frames x n_items x n_coded */
    uint8_t *missing;    /* likewise, or NULL */
    reel_block_fields fields;
} reel_loaded_block;

/* What a decoder holds of a track: two blocks, so that seeking across a border costs nothing. */
typedef struct {
    bool has_items;
    reel_items items;
    const reel_field_mesh *mesh; /* of the size of stencils that was used last, or NULL */
    reel_loaded_block now, before; /* the block that was asked for last, and the one before */
    reel_block_fields key;
} reel_track_state;

struct meshreel_decoder {
    const meshreel_file *file;
    reel_pool pool;
    reel_track_state *tracks;
};

/* Bytes that a decoder holds. */
uint64_t reel_decoder_bytes(const meshreel_decoder *decoder);

/* Loads a track of a block, unless it is held: its modes, packed or not, or its exact values. */
int reel_load(reel_call *call, meshreel_decoder *decoder, uint32_t track, uint64_t block,
              uint64_t n_moving);

/* Lets the block of a track that is held go. */
void reel_forget(reel_call *call, meshreel_decoder *decoder, uint32_t track);

/* Fields of the block that is held: its own, or as those of the key block; NULL if they are gone. */
const double *reel_loaded_fields(const reel_track_state *held);

/* The row of these fields in which each item is. */
void reel_find_rows(const reel_track_state *held, int32_t *rows);

/* Packs them in the order in which values go out, unless they are. */
int reel_pack_fields(reel_call *call, reel_track_state *held);

/* Values of frames first..first+count-1 of the block that is held, as they are stored or predicted
   and before corners share them: count x n_values x n_columns numbers of the track's type, or of
   float where `size` is 4. */
int reel_values(reel_call *call, meshreel_decoder *decoder, uint32_t track, uint64_t first,
                uint64_t count, uint32_t size, void *out);

#endif
