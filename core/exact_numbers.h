/* Numbers of any type as indices in their order, and as they are scaled to be expected.

   docs/format.md, "Exact values". An integer is its own index. The index of a float counts the
   floats of a grid between it and 0: all of the type; those whose lowest bits are 0; or decimal
   ones, of so many digits and so many places behind the point. */

#ifndef REEL_EXACT_NUMBERS_H
#define REEL_EXACT_NUMBERS_H

#include "base.h"

#define REEL_MOST_SIZE 16000 /* of a difference, in sixteenths of octaves */
#define REEL_MOST_SCALE 1000 /* octaves by which floats are scaled */
#define REEL_MOST_DIGITS 15
#define REEL_MOST_PLACES 22
#define REEL_LEAST_TEN (-22)

typedef struct {
    int size; /* bytes: 1, 2, 4 or 8 */
    int type; /* of enum reel_type */
    int shift;  /* lowest bits of floats that are 0 */
    int digits; /* of decimal floats, or 0 */
    int places;
    int scale; /* values are scaled by 2^-scale */
    double down, up; /* 2^-scale, 2^scale */
    double rounding; /* least variance of an error, scaled */
    uint64_t least_of_ten; /* 10^(digits - 1) */
    uint64_t steps; /* indices of a decade: 9 x least_of_ten */
    uint64_t most; /* index of decimal floats */
} reel_numbers;

/* The floats nearest to 10^-22 .. 10^38. */
static const double reel_tens[] = {
    1e-22, 1e-21, 1e-20, 1e-19, 1e-18, 1e-17, 1e-16, 1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10,
    1e-9,  1e-8,  1e-7,  1e-6,  1e-5,  1e-4,  1e-3,  1e-2,  1e-1,  1e0,   1e1,   1e2,   1e3,
    1e4,   1e5,   1e6,   1e7,   1e8,   1e9,   1e10,  1e11,  1e12,  1e13,  1e14,  1e15,  1e16,
    1e17,  1e18,  1e19,  1e20,  1e21,  1e22,  1e23,  1e24,  1e25,  1e26,  1e27,  1e28,  1e29,
    1e30,  1e31,  1e32,  1e33,  1e34,  1e35,  1e36,  1e37,  1e38,
};

REEL_INLINE double reel_ten_to(int power) { return reel_tens[power - REEL_LEAST_TEN]; }

REEL_INLINE uint64_t reel_bits_of(double value) {
    uint64_t bits;
    reel_copy(&bits, &value, sizeof bits);
    return bits;
}

REEL_INLINE double reel_double_of(uint64_t bits) {
    double value;
    reel_copy(&value, &bits, sizeof value);
    return value;
}

REEL_INLINE uint32_t reel_bits_of_float(float value) {
    uint32_t bits;
    reel_copy(&bits, &value, sizeof bits);
    return bits;
}

REEL_INLINE uint64_t reel_sign_bit(const reel_numbers *numbers) {
    return (uint64_t)1 << (8 * numbers->size - 1);
}

/* Scales by a power of two, within -REEL_MOST_SCALE..REEL_MOST_SCALE. */
REEL_INLINE void reel_set_scale(reel_numbers *numbers, int scale) {
    numbers->scale = scale;
    numbers->down = reel_double_of((uint64_t)(1023 - scale) << 52);
    numbers->up = reel_double_of((uint64_t)(1023 + scale) << 52);
    numbers->rounding = numbers->type == REEL_FLOATS ? 0x1p-110 : numbers->down * numbers->down / 16;
}

REEL_INLINE void reel_set_decimal(reel_numbers *numbers, int digits, int places) {
    numbers->digits = digits;
    numbers->places = places;
    numbers->least_of_ten = 1;
    for (int i = 1; i < digits; i++) {
        numbers->least_of_ten *= 10;
    }
    numbers->steps = 9 * numbers->least_of_ten;
    uint64_t decades = (uint64_t)(places + REEL_MOST_PLACES);
    numbers->most = numbers->least_of_ten * (10 + 9 * decades) - 1;
}

REEL_INLINE uint64_t reel_read_pattern(const reel_numbers *numbers, const uint8_t *values,
                                       int64_t at) {
    uint64_t found = 0;
    switch (numbers->size) {
    case 1:
        return values[at];
    case 2:
        reel_copy(&found, values + 2 * at, 2);
        return found;
    case 4:
        reel_copy(&found, values + 4 * at, 4);
        return found;
    default:
        reel_copy(&found, values + 8 * at, 8);
        return found;
    }
}

REEL_INLINE void reel_write_pattern(const reel_numbers *numbers, uint8_t *values, int64_t at,
                                    uint64_t pattern) {
    switch (numbers->size) {
    case 1:
        values[at] = (uint8_t)pattern;
        break;
    case 2:
        reel_copy(values + 2 * at, &pattern, 2);
        break;
    case 4:
        reel_copy(values + 4 * at, &pattern, 4);
        break;
    default:
        reel_copy(values + 8 * at, &pattern, 8);
    }
}

/* The value of a pattern of a float. */
REEL_INLINE double reel_float_value(const reel_numbers *numbers, uint64_t pattern) {
    if (numbers->size == 8) {
        return reel_double_of(pattern);
    }
    uint32_t bits = (uint32_t)pattern;
    float value;
    reel_copy(&value, &bits, sizeof value);
    return (double)value;
}

/* Is it no number, or infinite? */
REEL_INLINE bool reel_is_odd(const reel_numbers *numbers, uint64_t pattern) {
    uint64_t exponent = numbers->size == 8 ? 0x7FFULL << 52 : 0xFFULL << 23;
    return (pattern & exponent) == exponent;
}

/* ---- decimal floats ---- */

/* By how many decades a magnitude is above those with all places; that of another is tried first. */
REEL_INLINE int reel_decade_of(const reel_numbers *numbers, double magnitude, int tried) {
    int first = numbers->digits - numbers->places; /* of those below 10^this it is 0 */
    int most = numbers->places + REEL_MOST_PLACES;
    if (magnitude < reel_ten_to(first + tried) &&
        (tried == 0 || magnitude >= reel_ten_to(first + tried - 1))) {
        return tried;
    }
    int octave = (int)(reel_bits_of(magnitude) >> 52) - 1023;
    int decade = (octave * 1233 >> 12) + 1 - first; /* or the next */
    decade = decade < 0 ? 0 : decade > most ? most : decade;
    return decade + (decade < most && magnitude >= reel_ten_to(first + decade));
}

REEL_INLINE uint64_t reel_decimal_index(const reel_numbers *numbers, double magnitude,
                                        int decade) {
    int places = numbers->places - decade;
    double count = places < 0 ? magnitude / reel_ten_to(-places) : magnitude * reel_ten_to(places);
    if (!(count < 1e16)) {
        return numbers->most;
    }
    uint64_t index = (uint64_t)(int64_t)(count + 0.5) + numbers->steps * (uint64_t)decade;
    return index < numbers->most ? index : numbers->most;
}

/* The magnitude with an index; a decade is tried first. */
REEL_INLINE uint64_t reel_decimal_pattern(const reel_numbers *numbers, uint64_t index, int tried) {
    uint64_t least = numbers->least_of_ten, steps = numbers->steps;
    index = index < numbers->most ? index : numbers->most;
    int decade = tried;
    if (index - (least + steps * (uint64_t)tried) >= steps) {
        decade = index < least ? 0 : (int)((index - least) / steps);
    }
    double count = (double)(int64_t)(index - steps * (uint64_t)decade);
    int places = numbers->places - decade;
    double value = places < 0 ? count * reel_ten_to(-places) : count / reel_ten_to(places);
    if (numbers->size == 8) {
        return reel_bits_of(value);
    }
    return reel_bits_of_float(value < 0x1.fffffep+127 ? (float)value : 0x1.fffffep+127F);
}

/* ---- all numbers ---- */

/* An integer, modulo 2^64. */
REEL_INLINE uint64_t reel_integer_of(const reel_numbers *numbers, uint64_t pattern) {
    uint64_t sign = numbers->type == REEL_SIGNED_INTEGERS ? reel_sign_bit(numbers) : 0;
    return (pattern ^ sign) - sign;
}

/* The index of a number, modulo 2^64: below 0, -1 - that of the magnitude. Of decimal floats a
   decade is tried first, and that of the number left. */
REEL_INLINE uint64_t reel_index_of(const reel_numbers *numbers, uint64_t pattern, int *decade) {
    if (numbers->type != REEL_FLOATS) {
        return reel_integer_of(numbers, pattern);
    }
    uint64_t sign = reel_sign_bit(numbers);
    uint64_t index = pattern & (sign - 1);
    if (numbers->digits) {
        double magnitude = reel_float_value(numbers, index);
        *decade = reel_decade_of(numbers, magnitude, *decade);
        index = reel_decimal_index(numbers, magnitude, *decade);
    } else {
        index >>= numbers->shift;
    }
    return pattern & sign ? ~index : index;
}

/* The pattern with an index; of damaged bytes, any. */
REEL_INLINE uint64_t reel_pattern_of(const reel_numbers *numbers, uint64_t index, int decade) {
    uint64_t sign = reel_sign_bit(numbers);
    if (numbers->type != REEL_FLOATS) {
        return index & (sign | (sign - 1));
    }
    bool negative = index >> 63;
    index = negative ? ~index : index;
    uint64_t pattern = numbers->digits ? reel_decimal_pattern(numbers, index, decade)
                                       : index << numbers->shift & (sign - 1);
    return negative ? pattern | sign : pattern;
}

/* What is known of a number: its scaled value, or where this is not finite what was expected. */
REEL_INLINE double reel_known_value(const reel_numbers *numbers, uint64_t pattern,
                                    double expected) {
    if (numbers->type != REEL_FLOATS) {
        uint64_t index = reel_integer_of(numbers, pattern);
        return (numbers->type == REEL_SIGNED_INTEGERS ? (double)(int64_t)index : (double)index) *
               numbers->down;
    }
    if (reel_is_odd(numbers, pattern)) {
        return expected;
    }
    double value = reel_float_value(numbers, pattern) * numbers->down;
    return value >= -0x1p1000 && value <= 0x1p1000 ? value : expected;
}

/* The nearest float of the type to a value, as a pattern. */
REEL_INLINE uint64_t reel_nearest_float(const reel_numbers *numbers, double value) {
    double most = numbers->size == 8 ? 0x1.fffffffffffffp+1023 : 0x1.fffffep+127;
    value = value > most ? most : value < -most ? -most : value;
    return numbers->size == 8 ? reel_bits_of(value) : reel_bits_of_float((float)value);
}

/* The index that is expected for a scaled value, and the size of a step of the index there, in
   sixteenths of octaves of scaled values. An integer is expected as far from that of `index` as the
   value from its base. Of decimal floats a decade is tried first, and that of the value left. */
REEL_INLINE uint64_t reel_expected_index(const reel_numbers *numbers, double value, double base,
                                         uint64_t index, int *decade, int32_t *step) {
    if (numbers->type != REEL_FLOATS) {
        double move = (value - base) * numbers->up;
        move = move < -0x1p62 ? -0x1p62 : move > 0x1p62 ? 0x1p62 : move;
        *step = -16 * numbers->scale;
        return index + (uint64_t)(int64_t)(move < 0 ? move - 0.5 : move + 0.5);
    }
    uint64_t pattern = reel_nearest_float(numbers, value * numbers->up);
    uint64_t sign = reel_sign_bit(numbers), size = pattern & (sign - 1), found;
    if (numbers->digits) {
        double magnitude = reel_float_value(numbers, size);
        *decade = reel_decade_of(numbers, magnitude, *decade);
        found = reel_decimal_index(numbers, magnitude, *decade);
        *step = 53 * (*decade - numbers->places) - 16 * numbers->scale;
    } else {
        int mantissa = numbers->size == 8 ? 52 : 23, exponent = (int)(size >> mantissa);
        int least = numbers->size == 8 ? 1074 : 149;
        found = (size + ((uint64_t)1 << numbers->shift >> 1)) >> numbers->shift;
        *step = 16 * ((exponent ? exponent - 1 : 0) - least + numbers->shift - numbers->scale);
    }
    *step = *step < -REEL_MOST_SIZE ? -REEL_MOST_SIZE : *step;
    return pattern & sign ? ~found : found;
}

/* Of the square root of a variance, in sixteenths of octaves. */
REEL_INLINE int32_t reel_size_of_variance(double variance) {
    variance = variance < 1e100 ? variance : 1e100;
    return ((int32_t)(reel_bits_of(variance) >> 48) - 16 * 1023) / 2;
}

#endif
