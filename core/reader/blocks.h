/* Loaded blocks: the current and the previous block of each track of a decoder. */

#ifndef REEL_BLOCKS_H
#define REEL_BLOCKS_H

#include "file.h"
#include "group.h"
#include "items.h"

#define REEL_NO_BLOCK UINT64_MAX

/* Decoded fields of a block: n_items x n_modes, in quantization steps, in coding order. */
typedef struct {
    reel_pool pool;
    uint64_t block; /* or REEL_NO_BLOCK, also if only some modes are decoded */
    uint64_t reference, stencil_size, n_modes;
    double *values;
} reel_block_fields;

/* A loaded block of a track. */
typedef struct {
    uint64_t block;    /* or REEL_NO_BLOCK */
    uint64_t n_moving; /* preview: modes that move; 0: all */
    reel_group group;
    reel_pool pool;   /* owns the arrays below */
    uint64_t n_modes; /* decoded modes */
    uint32_t n_relations; /* length of the chain of related tracks */
    double *basis;    /* n_coded x n_frames x n_modes */
    uint8_t *packed;  /* fields packed in output order; NULL until needed */
    int32_t *rows;    /* row of `fields` of each output item; NULL until needed */
    reel_corrections corrections;
    reel_rounding rounding;
    void *exact;      /* n_frames x n_items x n_coded */
    uint8_t *missing; /* flags of missing values, of the same shape, or NULL */
    reel_block_fields fields;
} reel_loaded_block;

/* State of a track. Two blocks are kept, so that seeking across a block boundary is free. */
typedef struct {
    bool has_items;
    reel_items items;
    const reel_field_mesh *mesh;         /* hierarchy of the last stencil size, or NULL */
    reel_loaded_block current, previous; /* the requested block, and the one before */
    reel_block_fields key;
} reel_track_state;

struct meshreel_decoder {
    const meshreel_file *file;
    /* Decodes the positions of the first frame of a block in output order, of the file's type, for
       tracks with weights from points. */
    int (*read_positions)(reel_call *call, meshreel_decoder *decoder, uint64_t block,
                          void *numbers);
    reel_pool pool;
    reel_track_state *tracks;
    uint32_t n_relations; /* related tracks that are being loaded, one within the other */
};

/* Bytes held by a decoder. */
uint64_t reel_decoder_bytes(const meshreel_decoder *decoder);

/* Load a track of a block, its modes or its exact values, unless it is loaded. */
int reel_load(reel_call *call, meshreel_decoder *decoder, uint32_t track, uint64_t block,
              uint64_t n_moving);

/* Reserve what a track of a block takes at least while it is loaded, as its group announces. Fails
   if loading it would take more than the limit. */
int reel_reserve_group(reel_call *call, const meshreel_file *file, uint32_t number,
                       const reel_group *group, uint64_t n_moving);

/* Release the current block of a track. */
void reel_forget(reel_call *call, meshreel_decoder *decoder, uint32_t track);

/* Fields of the current block: its own, or those of the key block if it is one; NULL if they were
   released. */
const double *reel_loaded_fields(const reel_track_state *state);

/* Find the row of these fields for each output item. */
void reel_find_field_rows(const reel_track_state *state, int32_t *rows);

/* Pack these fields in output order, unless they are packed. */
int reel_pack_fields(reel_call *call, reel_track_state *state);

#endif
