/* Rate-distortion optimised rounding: an encoder's choice, no stream depends on it.

   A magnitude becomes 1 instead of 0 only if the squared error that this saves is worth its bits.
   These are taken from how often the two occur. docs/codec.md, "Stage by stage". */

#ifndef REEL_ROUNDING_H
#define REEL_ROUNDING_H

#include "base.h"

#define REEL_ROUNDED_DOWN 0.04 /* of a step: by how much magnitudes above 1 are rounded down */
#define REEL_TOO_LARGE 1073741824.0
#define REEL_NO_ZONE 0.5 /* a dead zone that rounds to the nearest */

REEL_INLINE double reel_magnitude(double value) { return value < 0 ? -value : value; }

/* The base-2 logarithm of a positive, normal number, within 0.01. */
REEL_INLINE double reel_octaves(double number) {
    union {
        double number;
        uint64_t bits;
    } parts = {number};
    double octave = (double)((int64_t)(parts.bits >> 52) - 1023);
    parts.bits = (parts.bits & 0xFFFFFFFFFFFFFU) | 0x3FF0000000000000U;
    double part = parts.number - 1.0;
    return octave + part * (1.3465 - 0.3465 * part);
}

/* Magnitudes below this become 0, after so many zeros and ones, where a bit is worth `price`
   squared steps. Half an observation each, so that values without any have a length too. */
REEL_INLINE double reel_dead_zone(double n_zeros, double n_ones, double price) {
    double extra_bits = reel_octaves((n_zeros + 0.5) / (0.5 * n_ones + 0.5));
    double zone = 0.5 + 0.5 * price * extra_bits;
    return zone < 0.5 ? 0.5 : zone > 1.0 ? 1.0 : zone;
}

/* The integer near to a value below REEL_TOO_LARGE; a plain one is the nearest. */
REEL_INLINE int32_t reel_rounded(double scaled, double zone, bool is_plain) {
    double size = reel_magnitude(scaled);
    int32_t found = (int32_t)(size + (is_plain ? 0.5 : 0.5 - REEL_ROUNDED_DOWN));
    found = size < zone ? 0 : found < 1 ? 1 : found;
    return scaled < 0 ? -found : found;
}

#endif
