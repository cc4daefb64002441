/* Logarithms for an encoder's choices, near enough; no stream depends on them. */

#ifndef REEL_OCTAVES_H
#define REEL_OCTAVES_H

#include "base.h"

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

#endif
