/* The core of meshreel: what a .reel stream means. docs/format.md says it in words.

   Every function is pure: it reads and writes only the arrays that it is given, keeps nothing, and
   may run on several threads at once. Nothing is allocated: whoever calls gives `memory` of at
   least the size that the function `..._memory` of the same name states, aligned to 64 bytes.

   A function returns a number of at least 0 (bytes written, or as it says), or a failure:
   -(code + 256 place), with a code of `reel_code` and the byte or item at which it was seen. */

#ifndef REEL_H
#define REEL_H

#include <stddef.h>
#include <stdint.h>

#if defined(_WIN32)
#define REEL_API __declspec(dllexport)
#elif defined(__wasm__)
#define REEL_API __attribute__((visibility("default")))
#else
#define REEL_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define REEL_ABI 1 /* changes with every change of a function below */

enum reel_code {
    REEL_OK = 0,
    REEL_NO_MEMORY = 1, /* the caller gave less memory, or less room for the result, than stated */
    REEL_TRUNCATED = 2, /* the bytes end too early */
    REEL_CORRUPT = 3,   /* the bytes are not those of what they should be */
    REEL_INVALID = 4    /* what is to be coded breaks a limit of the format */
};

/* REEL_ABI of the library that was loaded. */
REEL_API int64_t reel_abi(void);

/* Rows of integers of -(2^31-1)..2^31-1: row i is lengths[i] long and uses table tables[i], of
   0..n_tables-1. `values` holds all rows, one after another. At most 16 bytes for each integer
   and 16 more are written. */
REEL_API size_t reel_integers_memory(int64_t n_tables);
REEL_API int64_t reel_integers_encode(void *memory, size_t memory_size, int32_t *values,
                                      const int64_t *lengths, const int32_t *tables,
                                      int64_t n_rows, int64_t n_tables, uint8_t *out, size_t room);
REEL_API int64_t reel_integers_decode(void *memory, size_t memory_size, const uint8_t *in,
                                      size_t size, const int64_t *lengths, const int32_t *tables,
                                      int64_t n_rows, int64_t n_tables, int32_t *values);

/* Faces of a mesh: `n_faces` rows of three corners 0..n_verts-1, both counts at most 2^26. The
   writer gives the faces in the order and the numbers that the reader will find, and the given
   vertex of each number; at most 96 bytes for each face and 1024 more are written. `listed` keeps
   faces and vertices in their given order, for more bytes. docs/format.md, CONNECTIVITY. */
REEL_API size_t reel_connectivity_encode_memory(int64_t n_verts, int64_t n_faces);
REEL_API size_t reel_connectivity_decode_memory(int64_t n_verts, int64_t n_faces);
REEL_API int64_t reel_connectivity_encode(void *memory, size_t memory_size, const int32_t *faces,
                                          int64_t n_faces, int64_t n_verts, int64_t listed,
                                          int32_t *internal_faces, int32_t *internal_to_given,
                                          uint8_t *out, size_t room);
REEL_API int64_t reel_connectivity_decode(void *memory, size_t memory_size, const uint8_t *in,
                                          size_t size, int64_t n_verts, int64_t n_faces,
                                          int32_t *faces);

#ifdef __cplusplus
}
#endif

#endif
