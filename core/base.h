/* What every file of the core uses: failures, the arena, and copies without a library. */

#ifndef REEL_BASE_H
#define REEL_BASE_H

#include <stdbool.h>

#include "reel.h"

#define REEL_INLINE static inline __attribute__((always_inline))

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

/* Bytes that `count` items of `item` bytes take in an arena; the caller bounds the product. */
REEL_INLINE size_t reel_room(size_t count, size_t item) {
    return (count * item + REEL_ALIGNMENT - 1) / REEL_ALIGNMENT * REEL_ALIGNMENT;
}

REEL_INLINE void *reel_take(reel_arena *arena, size_t count, size_t item) {
    size_t wanted = reel_room(count, item);
    if (wanted > arena->size - arena->used) {
        arena->failed = true;
        return NULL;
    }
    void *found = arena->base + arena->used;
    arena->used += wanted;
    return found;
}

REEL_INLINE void reel_zero(void *to, size_t size) { __builtin_memset(to, 0, size); }

REEL_INLINE void reel_copy(void *to, const void *from, size_t size) {
    __builtin_memcpy(to, from, size);
}

/* Bits that hold a number: 0 of 0, 1 of 1, 2 of 2 and 3. */
REEL_INLINE int reel_length(uint32_t value) { return value ? 32 - __builtin_clz(value) : 0; }

#endif
