/* Numbers of any type as indices in their order, and as scaled values for prediction.

   docs/format.md, "Exact values". An integer is its own index. The index of a float is its position
   in the ascending list of floats from 0 that can occur: all floats of the type; those whose lowest
   `shift` bits are 0; or decimal numbers with a given number of digits and of decimal places. */

#ifndef REEL_EXACT_NUMBERS_H
#define REEL_EXACT_NUMBERS_H

#include "base.h"

#define REEL_MAX_SIZE 16000 /* sizes of differences, 16 log2, are clipped to this */
#define REEL_MAX_SCALE 1000 /* largest scale exponent of floats */
#define REEL_MAX_DIGITS 15
#define REEL_MAX_PLACES 22
#define REEL_MIN_POWER (-22)

typedef struct {
    int size;                      /* bytes: 1, 2, 4 or 8 */
    int type;                      /* of enum reel_type */
    int shift;                     /* number of lowest mantissa bits that are 0 in all floats */
    int digits;                    /* significant digits of decimal floats; 0: not decimal */
    int places;                    /* decimal places of decimal floats */
    int scale;                     /* values are scaled by 2^-scale */
    double to_scaled, from_scaled; /* 2^-scale, 2^scale */
    double rounding;               /* lower bound of the variance of prediction errors, scaled */
    uint64_t min_of_decade;        /* smallest number with all digits: 10^(digits - 1) */
    uint64_t decade_size;          /* indices per decade: 9 x min_of_decade */
    uint64_t max_index;            /* largest index of decimal floats */
} reel_numbers;

/* The doubles nearest to 10^-22 .. 10^38. */
static const double reel_powers_of_ten[] = {
    1e-22, 1e-21, 1e-20, 1e-19, 1e-18, 1e-17, 1e-16, 1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10,
    1e-9,  1e-8,  1e-7,  1e-6,  1e-5,  1e-4,  1e-3,  1e-2,  1e-1,  1e0,   1e1,   1e2,   1e3,
    1e4,   1e5,   1e6,   1e7,   1e8,   1e9,   1e10,  1e11,  1e12,  1e13,  1e14,  1e15,  1e16,
    1e17,  1e18,  1e19,  1e20,  1e21,  1e22,  1e23,  1e24,  1e25,  1e26,  1e27,  1e28,  1e29,
    1e30,  1e31,  1e32,  1e33,  1e34,  1e35,  1e36,  1e37,  1e38,
};

REEL_INLINE double reel_power_of_ten(int power) {
    return reel_powers_of_ten[power - REEL_MIN_POWER];
}

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

/* Set the scale to a power of two within -REEL_MAX_SCALE..REEL_MAX_SCALE. */
REEL_INLINE void reel_set_scale(reel_numbers *numbers, int scale) {
    numbers->scale = scale;
    numbers->to_scaled = reel_double_of((uint64_t)(1023 - scale) << 52);
    numbers->from_scaled = reel_double_of((uint64_t)(1023 + scale) << 52);
    numbers->rounding =
        numbers->type == REEL_FLOATS ? 0x1p-110 : numbers->to_scaled * numbers->to_scaled / 16;
}

REEL_INLINE void reel_set_decimal(reel_numbers *numbers, int digits, int places) {
    numbers->digits = digits;
    numbers->places = places;
    numbers->min_of_decade = 1;
    for (int i = 1; i < digits; i++) {
        numbers->min_of_decade *= 10;
    }
    numbers->decade_size = 9 * numbers->min_of_decade;
    uint64_t decades = (uint64_t)(places + REEL_MAX_PLACES);
    numbers->max_index = numbers->min_of_decade * (10 + 9 * decades) - 1;
}

REEL_INLINE uint64_t reel_read_pattern(const reel_numbers *numbers, const uint8_t *values,
                                       int64_t index) {
    uint64_t pattern = 0;
    switch (numbers->size) {
    case 1:
        return values[index];
    case 2:
        reel_copy(&pattern, values + 2 * index, 2);
        return pattern;
    case 4:
        reel_copy(&pattern, values + 4 * index, 4);
        return pattern;
    default:
        reel_copy(&pattern, values + 8 * index, 8);
        return pattern;
    }
}

REEL_INLINE void reel_write_pattern(const reel_numbers *numbers, uint8_t *values, int64_t index,
                                    uint64_t pattern) {
    switch (numbers->size) {
    case 1:
        values[index] = (uint8_t)pattern;
        break;
    case 2:
        reel_copy(values + 2 * index, &pattern, 2);
        break;
    case 4:
        reel_copy(values + 4 * index, &pattern, 4);
        break;
    default:
        reel_copy(values + 8 * index, &pattern, 8);
    }
}

/* Value of a float's bit pattern. */
REEL_INLINE double reel_float_value(const reel_numbers *numbers, uint64_t pattern) {
    if (numbers->size == 8) {
        return reel_double_of(pattern);
    }
    uint32_t bits = (uint32_t)pattern;
    float value;
    reel_copy(&value, &bits, sizeof value);
    return (double)value;
}

/* Whether a float is NaN or infinite. */
REEL_INLINE bool reel_is_special(const reel_numbers *numbers, uint64_t pattern) {
    uint64_t exponent = numbers->size == 8 ? 0x7FFULL << 52 : 0xFFULL << 23;
    return (pattern & exponent) == exponent;
}

/* ---- decimal floats ---- */

/* Return the decade of a magnitude: the number of decimal places by which its digits are coarser
   than the finest. `guess`, the result for a similar number, is tried first. */
REEL_INLINE int reel_decade_of(const reel_numbers *numbers, double magnitude, int guess) {
    int first = numbers->digits - numbers->places; /* magnitudes below 10^first have decade 0 */
    int max_decade = numbers->places + REEL_MAX_PLACES;
    if (magnitude < reel_power_of_ten(first + guess) &&
        (guess == 0 || magnitude >= reel_power_of_ten(first + guess - 1))) {
        return guess;
    }
    int octave = (int)(reel_bits_of(magnitude) >> 52) - 1023;
    int decade = (octave * 1233 >> 12) + 1 - first; /* or one less than the decade */
    decade = decade < 0 ? 0 : decade > max_decade ? max_decade : decade;
    return decade + (decade < max_decade && magnitude >= reel_power_of_ten(first + decade));
}

/* Return the index of a magnitude among the decimal numbers; its decade is known. */
REEL_INLINE uint64_t reel_decimal_index(const reel_numbers *numbers, double magnitude,
                                        int decade) {
    int places = numbers->places - decade;
    double coefficient =
        places < 0 ? magnitude / reel_power_of_ten(-places) : magnitude * reel_power_of_ten(places);
    if (!(coefficient < 1e16)) {
        return numbers->max_index;
    }
    uint64_t index =
        (uint64_t)(int64_t)(coefficient + 0.5) + numbers->decade_size * (uint64_t)decade;
    return index < numbers->max_index ? index : numbers->max_index;
}

/* Return the bit pattern of the magnitude with a decimal index; `guess` is a likely decade. */
REEL_INLINE uint64_t reel_decimal_pattern(const reel_numbers *numbers, uint64_t index, int guess) {
    uint64_t min_index = numbers->min_of_decade, decade_size = numbers->decade_size;
    index = index < numbers->max_index ? index : numbers->max_index;
    int decade = guess;
    if (index - (min_index + decade_size * (uint64_t)guess) >= decade_size) {
        decade = index < min_index ? 0 : (int)((index - min_index) / decade_size);
    }
    double coefficient = (double)(int64_t)(index - decade_size * (uint64_t)decade);
    int places = numbers->places - decade;
    double value = places < 0 ? coefficient * reel_power_of_ten(-places)
                              : coefficient / reel_power_of_ten(places);
    if (numbers->size == 8) {
        return reel_bits_of(value);
    }
    return reel_bits_of_float(value < 0x1.fffffep+127 ? (float)value : 0x1.fffffep+127F);
}

/* ---- all numbers ---- */

/* Value of an integer's bit pattern, modulo 2^64. */
REEL_INLINE uint64_t reel_integer_of(const reel_numbers *numbers, uint64_t pattern) {
    uint64_t sign = numbers->type == REEL_SIGNED_INTEGERS ? reel_sign_bit(numbers) : 0;
    return (pattern ^ sign) - sign;
}

/* Return the index of a number, modulo 2^64; that of a negative float is -1 minus the index of its
   magnitude. For decimal floats `decade` is a likely decade, and becomes the actual one. */
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

/* Bit pattern of the number with an index; arbitrary for damaged input. */
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

/* Return the scaled value of a number for later predictions: the predicted value if the number is
   not finite, or too large. */
REEL_INLINE double reel_known_value(const reel_numbers *numbers, uint64_t pattern,
                                    double predicted) {
    if (numbers->type != REEL_FLOATS) {
        uint64_t index = reel_integer_of(numbers, pattern);
        return (numbers->type == REEL_SIGNED_INTEGERS ? (double)(int64_t)index : (double)index) *
               numbers->to_scaled;
    }
    if (reel_is_special(numbers, pattern)) {
        return predicted;
    }
    double value = reel_float_value(numbers, pattern) * numbers->to_scaled;
    return value >= -0x1p1000 && value <= 0x1p1000 ? value : predicted;
}

/* Bit pattern of the float nearest to a value. */
REEL_INLINE uint64_t reel_nearest_float(const reel_numbers *numbers, double value) {
    double limit = numbers->size == 8 ? 0x1.fffffffffffffp+1023 : 0x1.fffffep+127;
    value = value > limit ? limit : value < -limit ? -limit : value;
    return numbers->size == 8 ? reel_bits_of(value) : reel_bits_of_float((float)value);
}

/* Convert a predicted scaled value to a predicted index. `step` becomes 16 log2 of the scaled
   distance between consecutive indices there. The index of an integer is `index`, that of `base`,
   plus the rounded difference value - base, because large integers are not exact as doubles. For
   decimal floats `decade` is a likely decade, and becomes the actual one. */
REEL_INLINE uint64_t reel_predict_index(const reel_numbers *numbers, double value, double base,
                                        uint64_t index, int *decade, int32_t *step) {
    if (numbers->type != REEL_FLOATS) {
        double difference = (value - base) * numbers->from_scaled;
        difference = difference < -0x1p62 ? -0x1p62 : difference > 0x1p62 ? 0x1p62 : difference;
        *step = -16 * numbers->scale;
        return index + (uint64_t)(int64_t)(difference < 0 ? difference - 0.5 : difference + 0.5);
    }
    uint64_t pattern = reel_nearest_float(numbers, value * numbers->from_scaled);
    uint64_t sign = reel_sign_bit(numbers), bits = pattern & (sign - 1), result;
    if (numbers->digits) {
        double magnitude = reel_float_value(numbers, bits);
        *decade = reel_decade_of(numbers, magnitude, *decade);
        result = reel_decimal_index(numbers, magnitude, *decade);
        *step = 53 * (*decade - numbers->places) - 16 * numbers->scale;
    } else {
        int mantissa_bits = numbers->size == 8 ? 52 : 23, exponent = (int)(bits >> mantissa_bits);
        int min_exponent = numbers->size == 8 ? 1074 : 149;
        result = (bits + ((uint64_t)1 << numbers->shift >> 1)) >> numbers->shift;
        *step =
            16 * ((exponent ? exponent - 1 : 0) - min_exponent + numbers->shift - numbers->scale);
    }
    *step = *step < -REEL_MAX_SIZE ? -REEL_MAX_SIZE : *step;
    return pattern & sign ? ~result : result;
}

/* Return 16 log2 of a standard deviation, approximately, from its variance. */
REEL_INLINE int32_t reel_size_of_variance(double variance) {
    variance = variance < 1e100 ? variance : 1e100;
    return ((int32_t)(reel_bits_of(variance) >> 48) - 16 * 1023) / 2;
}

#endif
