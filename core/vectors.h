/* Vectors of floats for arithmetic on several vertices at once, the same bits at any width.

   Every machine has vectors of 16 bytes (SSE2, NEON, WebAssembly). x86-64 with AVX2 has wider
   ones; what uses them is compiled between REEL_WIDE_BEGIN and REEL_WIDE_END, and called where
   `reel_has_wide` says so. No fused operations: they round differently. */

#ifndef REEL_VECTORS_H
#define REEL_VECTORS_H

#include "base.h"

#define REEL_LANES 8 /* vertices that go together */

typedef float reel_part_16 __attribute__((vector_size(16)));

#if defined(__x86_64__) && !defined(REEL_NARROW)
#define REEL_WIDE
typedef float reel_part_32 __attribute__((vector_size(32)));

#if defined(__clang__)
#define REEL_WIDE_BEGIN \
    _Pragma("clang attribute push(__attribute__((target(\"avx2\"))), apply_to = function)")
#define REEL_WIDE_END _Pragma("clang attribute pop")
#else
#define REEL_WIDE_BEGIN _Pragma("GCC push_options") _Pragma("GCC target(\"avx2\")")
#define REEL_WIDE_END _Pragma("GCC pop_options")
#endif

/* Whether the processor has AVX2, and the system saves its registers. */
static inline bool reel_has_wide(void) {
    uint32_t a = 0, b, c = 0, d, low, high;
    __asm__ volatile("cpuid" : "+a"(a), "=b"(b), "+c"(c), "=d"(d));
    if (a < 7) {
        return false;
    }
    a = 1, c = 0;
    __asm__ volatile("cpuid" : "+a"(a), "=b"(b), "+c"(c), "=d"(d));
    if (!(c >> 27 & 1U)) { /* OSXSAVE */
        return false;
    }
    __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    if ((low & 6U) != 6U) {
        return false;
    }
    a = 7, c = 0;
    __asm__ volatile("cpuid" : "+a"(a), "=b"(b), "+c"(c), "=d"(d));
    return b >> 5 & 1U;
}
#endif

#endif
