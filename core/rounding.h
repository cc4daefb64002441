/* Rate-distortion optimized rounding. An encoder's choice: no stream depends on it.

   A magnitude becomes 1 rather than 0 only if the squared error that this saves is worth the extra
   bits, which are estimated from how often both values occurred. docs/codec.md, "Stage by
   stage". */

#ifndef REEL_ROUNDING_H
#define REEL_ROUNDING_H

#include "base.h"

/* Magnitudes above 1 are rounded down by this part of a step more. */
#define REEL_ROUNDING_BIAS 0.04
#define REEL_TOO_LARGE 1073741824.0
#define REEL_NEAREST_ZONE 0.5 /* dead zone of rounding to nearest */

REEL_INLINE double reel_magnitude(double value) { return value < 0 ? -value : value; }

/* Base-2 logarithm of a positive, normal number, within 0.01. */
REEL_INLINE double reel_log2(double number) {
    union {
        double number;
        uint64_t bits;
    } parts = {number};
    double exponent = (double)((int64_t)(parts.bits >> 52) - 1023);
    parts.bits = (parts.bits & 0xFFFFFFFFFFFFFU) | 0x3FF0000000000000U;
    double fraction = parts.number - 1.0;
    return exponent + fraction * (1.3465 - 0.3465 * fraction);
}

/* Dead zone: magnitudes below it become 0. `n_zeros` and `n_ones` count values so far; a bit is
   worth `rd_lambda` squared steps. Half an observation is added to each, so that the estimate is
   finite without any. */
REEL_INLINE double reel_dead_zone(double n_zeros, double n_ones, double rd_lambda) {
    double extra_bits = reel_log2((n_zeros + 0.5) / (0.5 * n_ones + 0.5));
    double zone = 0.5 + 0.5 * rd_lambda * extra_bits;
    return zone < 0.5 ? 0.5 : zone > 1.0 ? 1.0 : zone;
}

/* Round a value of magnitude below REEL_TOO_LARGE, to nearest or with the dead zone. */
REEL_INLINE int32_t reel_round_rd(double scaled, double zone, bool to_nearest) {
    double magnitude = reel_magnitude(scaled);
    int32_t rounded = (int32_t)(magnitude + (to_nearest ? 0.5 : 0.5 - REEL_ROUNDING_BIAS));
    rounded = magnitude < zone ? 0 : rounded < 1 ? 1 : rounded;
    return scaled < 0 ? -rounded : rounded;
}

#endif
