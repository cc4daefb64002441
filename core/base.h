/* What every file of the core uses: failures, the arena, and copies without a library. */

#ifndef REEL_BASE_H
#define REEL_BASE_H

#include <stdbool.h>

#include "reel.h"

#ifndef REEL_INLINE
#define REEL_INLINE static inline __attribute__((always_inline))
#endif

#ifndef REEL_CALLED
#define REEL_CALLED static __attribute__((noinline))
#endif

#define REEL_ALIGNMENT 64

/* Failures: see reel.h. */
REEL_INLINE int64_t reel_failure(enum reel_code code, uint64_t place) {
    return -(int64_t)((uint64_t)code + 256U * (place & 0x7FFFFFFFFFFFU));
}

/* The memory of a caller, given out from its start; what does not fit is NULL, and `failed`. */
typedef struct {
    uint8_t *base;
    size_t size;
    size_t used;
    bool failed;
} reel_arena;

REEL_INLINE reel_arena reel_arena_of(void *memory, size_t size) {
    return (reel_arena){.base = memory, .size = size, .used = 0, .failed = false};
}

/* Where arrays lie in an arena side by side, no sanitizer sees a step from one into the next; for
   tests there are gaps between them. */
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

/* Bytes that `count` items of `item` bytes take in an arena; the caller bounds the product. */
REEL_INLINE size_t reel_room(size_t count, size_t item) {
    return (count * item + REEL_GAP + REEL_ALIGNMENT - 1) / REEL_ALIGNMENT * REEL_ALIGNMENT;
}

REEL_INLINE void *reel_take(reel_arena *arena, size_t count, size_t item) {
    size_t wanted = reel_room(count, item);
    if (wanted > arena->size - arena->used) {
        arena->failed = true;
        return NULL;
    }
    uint8_t *found = arena->base + arena->used;
    arena->used += wanted;
    REEL_GUARD(found, count * item, wanted);
    return found;
}

REEL_INLINE void reel_zero(void *to, size_t size) { __builtin_memset(to, 0, size); }

REEL_INLINE void reel_copy(void *to, const void *from, size_t size) {
    __builtin_memcpy(to, from, size);
}

REEL_INLINE bool reel_same(const uint8_t *these, const uint8_t *those, size_t size) {
    size_t i = 0;
    while (i < size && these[i] == those[i]) {
        i++;
    }
    return i == size;
}

/* Bits that hold a number: 0 of 0, 1 of 1, 2 of 2 and 3. */
REEL_INLINE int reel_length(uint32_t value) { return value ? 32 - __builtin_clz(value) : 0; }

#endif
