/* Shared by the fuzz targets of the core: the source of choices, memory, assertions.

   A run derives everything from some bytes: those of libFuzzer, or random ones. Every array is a
   separate block of the size that the core states, surrounded by poisoned memory, so that the
   address sanitizer detects overruns. */

#ifndef REEL_FUZZ_H
#define REEL_FUZZ_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "../reel.h"

/* ---- choices ---- */

/* Return the next number of the input; past its end, a pseudorandom one seeded by it. */
uint64_t fuzz_next(void);
/* Return one of 0..n-1. */
int64_t fuzz_below(int64_t n);
/* Return true once in n cases. */
bool fuzz_one_in(int64_t n);
/* Return an integer that is mostly small, at times as large as possible. */
int32_t fuzz_integer(void);
/* Return a float that is mostly small, at times huge, infinite or NaN. */
double fuzz_float(void);

/* ---- memory ---- */

/* Allocate a block until the end of the run, aligned to 64 bytes. It is filled with arbitrary
   contents, which differ when the run is repeated. */
void *fuzz_allocate(int64_t count, size_t item);
void *fuzz_copy(const void *from, int64_t count, size_t item);
/* Working memory for a function of the core, and its size. */
#define FUZZ_MEMORY(size) fuzz_allocate((int64_t)(size), 1), (size)
/* The byte that this memory is filled with. */
int fuzz_fill_byte(void);

typedef struct {
    uint8_t *bytes;
    size_t size;
} fuzz_bytes;

/* Copy the `size` bytes that the core has written to a block of exactly this size. */
fuzz_bytes fuzz_output(const uint8_t *out, int64_t size);
/* Return the bytes modified, truncated, extended, or replaced. */
fuzz_bytes fuzz_mutate(fuzz_bytes from);

/* ---- assertions ---- */

#define FUZZ_CHECK(condition) fuzz_check((condition), #condition, __FILE__, __LINE__)
void fuzz_check(bool condition, const char *text, const char *file, int line);
/* Assert that a failure is a code of reel.h other than lack of memory: the arena had the stated
   size. */
void fuzz_check_code(int64_t result);
/* Add a result to the hash of the run, which a repetition must reproduce. */
void fuzz_hash(const void *result, int64_t count, size_t item);
void fuzz_hash_doubles(const double *result, int64_t count);

/* ---- meshes ---- */

typedef struct {
    int64_t n_verts, n_faces;
    int32_t *faces;
    int32_t *twins; /* twin of each half-edge, or itself */
} fuzz_mesh;

fuzz_mesh fuzz_make_mesh(int64_t max_verts);
/* Replace the twins of a mesh by an arbitrary involution. */
void fuzz_shuffle_twins(fuzz_mesh *mesh);
int32_t *fuzz_permutation(int64_t n);

/* ---- streams ---- */

/* Decode a file through meshreel.h in two ways, which must agree. */
void fuzz_read_stream(fuzz_bytes bytes);

/* ---- targets ---- */

void fuzz_streams(void);
void fuzz_integers(void);
void fuzz_connectivity(void);
void fuzz_surface_integers(void);
void fuzz_cells(void);
void fuzz_decimate(void);
void fuzz_closest(void);
void fuzz_polygons(void);
void fuzz_exact(void);
void fuzz_hierarchy(void);
void fuzz_basis_encode(void);

#endif
