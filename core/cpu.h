/* Loops over lanes, compiled for the vectors that every machine of a kind has and, on x86-64, once
   more for AVX2 or AVX-512, which are asked for when they run.

   A file with such loops includes its `..._lanes.h` once or more, with LANES, TARGET and NAMED
   defined: how many doubles a vector has, the attribute of each function, and the name of each.
   Lanes do not know of one another, and nothing is fused: all give the same bits. */

#ifndef REEL_CPU_H
#define REEL_CPU_H

#include "base.h"

#if defined(__x86_64__) && !defined(REEL_NARROW) /* which shows that the bits are the same */
#define REEL_HAS_WIDE 1
#define REEL_TARGET_4 __attribute__((target("avx2")))
#define REEL_TARGET_8 __attribute__((target("avx512f")))
#endif

typedef double reel_vector_2 __attribute__((vector_size(16), may_alias));
typedef double reel_vector_4 __attribute__((vector_size(32), may_alias));
typedef double reel_vector_8 __attribute__((vector_size(64), may_alias));
typedef float reel_floats_4 __attribute__((vector_size(16), may_alias));
typedef float reel_floats_8 __attribute__((vector_size(32), may_alias));
typedef float reel_floats_16 __attribute__((vector_size(64), may_alias));

/* Before short loops over vectors, whose values are to stay in registers; pages need small code. */
#ifdef REEL_DECODER_ONLY
#define REEL_UNROLLED
#else
#define REEL_UNROLLED _Pragma("GCC unroll 32")
#endif

#define REEL_JOIN_(a, b) a##b
#define REEL_JOIN(a, b) REEL_JOIN_(a, b)

#ifdef REEL_HAS_WIDE

REEL_INLINE void reel_cpuid(uint32_t leaf, uint32_t *found) {
    __asm__ volatile("cpuid"
                     : "=a"(found[0]), "=b"(found[1]), "=c"(found[2]), "=d"(found[3])
                     : "a"(leaf), "c"(0U));
}

/* Doubles of the widest vectors that the processor has and whose registers the system keeps. */
REEL_INLINE int reel_widest(void) {
    uint32_t found[4], kept, high;
    reel_cpuid(0, found);
    if (found[0] < 7) {
        return 2;
    }
    reel_cpuid(1, found);
    if (!(found[2] >> 27 & 1U) || !(found[2] >> 28 & 1U)) {
        return 2;
    }
    __asm__ volatile("xgetbv" : "=a"(kept), "=d"(high) : "c"(0U));
    reel_cpuid(7, found);
    if ((kept & 0xE6U) == 0xE6U && (found[1] >> 16 & 1U)) {
        return 8;
    }
    return (kept & 6U) == 6U && (found[1] >> 5 & 1U) ? 4 : 2;
}

#else

REEL_INLINE int reel_widest(void) { return 2; }

#endif

#endif
