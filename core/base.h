/* Failures, the arena, and byte operations, which the core uses instead of libc. */

#ifndef REEL_BASE_H
#define REEL_BASE_H

#include <stdbool.h>

#include "reel.h"

/* Functions that are inlined, unless a build defines otherwise for small code. */
#ifndef REEL_INLINE
#define REEL_INLINE static inline __attribute__((always_inline))
#endif

#define REEL_CALLED static __attribute__((noinline))

#define REEL_ALIGNMENT 64

/* Return the failure -(code + 256 place) that reel.h describes. */
REEL_INLINE int64_t reel_failure(enum reel_code code, uint64_t place) {
    return -(int64_t)((uint64_t)code + 256U * (place & 0x7FFFFFFFFFFFU));
}

/* An arena over the caller's memory, allocated from its start. An allocation that does not fit
   returns NULL and sets `failed`. */
typedef struct {
    uint8_t *base;
    size_t size;
    size_t used;
    bool failed;
} reel_arena;

REEL_INLINE reel_arena reel_arena_of(void *memory, size_t size) {
    return (reel_arena){.base = memory, .size = size, .used = 0, .failed = false};
}

/* An arena that measures: allocations return NULL, and `used` becomes the size that they need. */
#define REEL_MEASURE {.size = SIZE_MAX}

/* Arrays in an arena are adjacent, so no sanitizer sees an overrun from one into the next. Builds
   with REEL_GUARDED poison a gap behind each of them. */
#ifdef REEL_GUARDED
#include <sanitizer/asan_interface.h>
#define REEL_GAP REEL_ALIGNMENT
#define REEL_GUARD(block, size, whole)                                   \
    (ASAN_UNPOISON_MEMORY_REGION(block, size),                           \
     ASAN_POISON_MEMORY_REGION((block) + (size), (whole) - (size)))
#else
#define REEL_GAP 0
#define REEL_GUARD(block, size, whole) (void)0
#endif

/* Bytes of an array of `count` items of `item` bytes in an arena. The caller bounds the product. */
REEL_INLINE size_t reel_array_bytes(size_t count, size_t item) {
    return (count * item + REEL_GAP + REEL_ALIGNMENT - 1) / REEL_ALIGNMENT * REEL_ALIGNMENT;
}

REEL_INLINE void *reel_allocate(reel_arena *arena, size_t count, size_t item) {
    size_t size = reel_array_bytes(count, item);
    if (size > arena->size - arena->used) {
        arena->failed = true;
        return NULL;
    }
    size_t first = arena->used;
    arena->used += size;
    if (!arena->base) {
        return NULL;
    }
    uint8_t *block = arena->base + first;
    REEL_GUARD(block, count * item, size);
    return block;
}

REEL_INLINE void reel_zero(void *target, size_t size) { __builtin_memset(target, 0, size); }

REEL_INLINE void reel_copy(void *target, const void *source, size_t size) {
    __builtin_memcpy(target, source, size);
}

REEL_INLINE bool reel_equal_bytes(const uint8_t *a, const uint8_t *b, size_t size) {
    size_t i = 0;
    while (i < size && a[i] == b[i]) {
        i++;
    }
    return i == size;
}

/* Turn the lengths of n lists, in starts[1..n], into their bounds: list i is starts[i] ..
   starts[i + 1] - 1. */
REEL_INLINE void reel_prefix_sum(int32_t *starts, int64_t n) {
    for (int64_t i = 0; i < n; i++) {
        starts[i + 1] += starts[i];
    }
}

/* Number of significant bits: 0 for 0, 1 for 1, 2 for 2 and 3. */
REEL_INLINE int reel_bit_length(uint32_t value) { return value ? 32 - __builtin_clz(value) : 0; }

#endif
