/* What tests of the core with hostile bytes share: where choices come from, and memory.

   A run takes all that it does from some bytes: those that libFuzzer gives, or random ones. Every
   array lies in a block of its own, of the size that the core states, and what is around it is
   poisoned, so that the address sanitizer sees a step beside it. */

#ifndef REEL_FUZZ_H
#define REEL_FUZZ_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "../reel.h"

/* ---- choices ---- */

/* The next number that the bytes give; behind their end a random one that they decide. */
uint64_t fuzz_next(void);
/* One of 0..n-1. */
int64_t fuzz_below(int64_t n);
/* Is this the one case in n? */
bool fuzz_once_in(int64_t n);
/* An integer that is mostly small, at times as large as it can be. */
int32_t fuzz_integer(void);
/* A float that is mostly small, at times huge, infinite or not a number. */
double fuzz_float(void);

/* ---- memory ---- */

/* A block until the end of the run, aligned to 64 bytes. It is filled with what a caller's memory
   may hold: anything, and in the repetition of a run something else. */
void *fuzz_take(int64_t count, size_t item);
void *fuzz_copy(const void *from, int64_t count, size_t item);
/* The byte that this memory is filled with. */
int fuzz_filling(void);

typedef struct {
    uint8_t *bytes;
    size_t size;
} fuzz_bytes;

/* Bytes of `room` of which the core has written `size`, in a block of just this size. */
fuzz_bytes fuzz_written(const uint8_t *out, int64_t size);
/* The same bytes changed, cut, extended, or other ones. */
fuzz_bytes fuzz_mutated(fuzz_bytes from);

/* ---- what is claimed ---- */

#define FUZZ_CLAIM(holds) fuzz_claim((holds), #holds, __FILE__, __LINE__)
void fuzz_claim(bool holds, const char *claim, const char *file, int line);
/* Failures are those that reel.h names, and never for memory that was of the stated size. */
void fuzz_claim_code(int64_t result);
/* What a repetition of the run has to find again. */
void fuzz_note(const void *found, int64_t count, size_t item);
void fuzz_note_doubles(const double *found, int64_t count);

/* ---- meshes ---- */

typedef struct {
    int64_t n_verts, n_faces;
    int32_t *faces;
    int32_t *twins; /* the other side on the same edge of each, or itself */
} fuzz_mesh;

fuzz_mesh fuzz_any_mesh(int64_t most_verts);
/* Gives the sides of a mesh other twins: any involution. */
void fuzz_pair_sides(fuzz_mesh *mesh);
int32_t *fuzz_permutation(int64_t n);

/* ---- streams ---- */

/* Decodes a file by meshreel.h in several ways, which have to agree. */
void fuzz_read_stream(fuzz_bytes bytes);

/* ---- targets ---- */

void fuzz_integers(void);
void fuzz_fields(void);
void fuzz_connectivity(void);
void fuzz_order(void);
void fuzz_patterns(void);
void fuzz_exact(void);
void fuzz_hierarchy(void);
void fuzz_frames(void);
void fuzz_basis_encode(void);
void fuzz_coordinates(void);
void fuzz_streams(void);

#endif
