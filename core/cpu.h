/* Loops over vector lanes, compiled for the baseline vectors of the machine and, on x86-64, again
   for AVX2 or AVX-512, which are detected at run time.

   For each width, a file with such loops defines LANES, the number of doubles in a vector, and
   includes its `..._lanes.h`, which undefines it. There, TARGET is the attribute of functions, and
   NAMED(x) is x with LANES appended: a name for each width. Lanes are independent and no
   operations are fused, so all widths give the same bits. */

#ifndef REEL_CPU_H
#define REEL_CPU_H

#include "base.h"

/* REEL_NARROW disables wide vectors, to test that the bits are the same. */
#if defined(__x86_64__) && !defined(REEL_NARROW)
#define REEL_HAS_WIDE 1
#define REEL_TARGET_4 __attribute__((target("avx2")))
#define REEL_TARGET_8 __attribute__((target("avx512f")))
#endif

/* Call a function of the widest vectors that the processor has, or of up to 4 lanes. */
#ifdef REEL_HAS_WIDE
#define REEL_WIDEST(width, function, ...)                                                          \
    ((width) >= 8   ? function##_8(__VA_ARGS__)                                                    \
     : (width) == 4 ? function##_4(__VA_ARGS__)                                                    \
                    : function##_2(__VA_ARGS__))
#define REEL_UP_TO_4(width, function, ...)                                                         \
    ((width) >= 4 ? function##_4(__VA_ARGS__) : function##_2(__VA_ARGS__))
#else
#define REEL_WIDEST(width, function, ...) ((void)(width), function##_2(__VA_ARGS__))
#define REEL_UP_TO_4 REEL_WIDEST
#endif

#define REEL_TARGET_2
#define REEL_JOIN_(a, b) a##b
#define REEL_JOIN(a, b) REEL_JOIN_(a, b)
#define TARGET REEL_JOIN(REEL_TARGET_, LANES)
#define NAMED(name) REEL_JOIN(name, REEL_JOIN(_, LANES))

/* Precedes short loops over vectors whose values must stay in registers. Builds for pages prefer
   small code. */
#ifdef REEL_DECODER_ONLY
#define REEL_UNROLLED
#else
#define REEL_UNROLLED _Pragma("GCC unroll 32")
#endif

#ifdef REEL_HAS_WIDE

REEL_INLINE void reel_cpuid(uint32_t leaf, uint32_t *registers) {
    __asm__ volatile("cpuid"
                     : "=a"(registers[0]), "=b"(registers[1]), "=c"(registers[2]),
                       "=d"(registers[3])
                     : "a"(leaf), "c"(0U));
}

REEL_INLINE int reel_find_vector_width(void) {
    uint32_t registers[4], xcr0, high;
    reel_cpuid(0, registers);
    if (registers[0] < 7) {
        return 2;
    }
    reel_cpuid(1, registers);
    if (!(registers[2] >> 27 & 1U) || !(registers[2] >> 28 & 1U)) {
        return 2;
    }
    __asm__ volatile("xgetbv" : "=a"(xcr0), "=d"(high) : "c"(0U));
    reel_cpuid(7, registers);
    if ((xcr0 & 0xE6U) == 0xE6U && (registers[1] >> 16 & 1U)) {
        return 8;
    }
    return (xcr0 & 6U) == 6U && (registers[1] >> 5 & 1U) ? 4 : 2;
}

/* Doubles in the widest vectors that the processor has and whose registers the system saves. Found
   once: in a virtual machine, `cpuid` takes about 10 microseconds. */
REEL_INLINE int reel_vector_width(void) {
    static int cached_width; /* 0: not yet; all threads find the same */
    int width = __atomic_load_n(&cached_width, __ATOMIC_RELAXED);
    if (!width) {
        width = reel_find_vector_width();
        __atomic_store_n(&cached_width, width, __ATOMIC_RELAXED);
    }
    return width;
}

#else

REEL_INLINE int reel_vector_width(void) { return 2; }

#endif

#endif
