/* Corrections of single positions of a block, by frame. */

#ifndef REEL_MOVES_H
#define REEL_MOVES_H

#include "group.h"

/* Those of frame t are starts[t] .. starts[t + 1] - 1, each of a vertex as it goes out, ascending,
   with three numbers of `moves`, in diagonals. */
typedef struct {
    int64_t *starts;
    int32_t *vertices;
    double *moves;
} reel_moves;

/* Room that they take for good, and room that is needed to read them; 0 where there are none. */
size_t reel_moves_room(uint64_t n_frames, uint64_t n_moves);
size_t reel_moves_scratch(const reel_outline *outline, const reel_group *group);

/* Reads them into arrays of that room; `outward` is the number of each internal vertex as it goes
   out. Returns a code. */
int reel_read_moves(const reel_outline *outline, const reel_group *group, const int32_t *outward,
                    reel_arena scratch, const reel_moves *found);

#endif
