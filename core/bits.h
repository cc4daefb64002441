/* Binary range coder and adaptive bit models.

   docs/format.md, "Bits". Encoder and decoder share every function: `reel_bit` takes the bit to
   encode, which the decoder ignores, and returns the bit on both sides. Each model is therefore
   written once, and the two sides cannot differ. */

#ifndef REEL_BITS_H
#define REEL_BITS_H

#include "base.h"

typedef struct {
    uint64_t range; /* width of the current interval; at least 2^32 between bits */
    uint64_t low;   /* encoder: lower end of the interval; decoder: code value less that end */
    uint8_t *out;
    const uint8_t *in;
    size_t position; /* bytes written or read; the decoder also counts bytes past the end */
    size_t size;     /* capacity of `out`, or size of `in` */
    bool writes;
    bool failed; /* the encoder ran out of capacity */
} reel_range_coder;

/* Whether the coder encodes. With REEL_DECODER_ONLY this is constant, so that compilers remove the
   encoder. */
REEL_INLINE bool reel_is_encoder(const reel_range_coder *coder) {
#ifdef REEL_DECODER_ONLY
    (void)coder;
    return false;
#else
    return coder->writes;
#endif
}

REEL_INLINE uint32_t reel_read_word(reel_range_coder *coder) {
    uint32_t word = 0;
    size_t remaining = coder->position < coder->size ? coder->size - coder->position : 0;
    for (size_t i = 0; i < 4; i++) { /* bytes past the end read as 0 */
        word = word << 8 | (i < remaining ? coder->in[coder->position + i] : 0U);
    }
    coder->position += 4;
    return word;
}

REEL_INLINE reel_range_coder reel_start_encoder(uint8_t *out, size_t capacity) {
    return (reel_range_coder){.range = UINT64_MAX, .out = out, .size = capacity, .writes = true};
}

REEL_INLINE reel_range_coder reel_start_decoder(const uint8_t *in, size_t size) {
    reel_range_coder coder = {.range = UINT64_MAX, .in = in, .size = size};
    coder.low = (uint64_t)reel_read_word(&coder) << 32;
    coder.low |= reel_read_word(&coder);
    return coder;
}

/* Propagate a carry into the bytes already written. */
REEL_INLINE void reel_propagate_carry(reel_range_coder *coder) {
    size_t index = coder->position;
    while (index > 0 && ++coder->out[index - 1] == 0) {
        index--;
    }
}

REEL_INLINE void reel_write_word(reel_range_coder *coder) {
    if (coder->size - coder->position < 4) {
        coder->failed = true;
        coder->position = 0; /* the output is discarded */
    }
    if (coder->size >= 4) {
        for (int i = 0; i < 4; i++) {
            coder->out[coder->position + (size_t)i] = (uint8_t)(coder->low >> (56 - 8 * i));
        }
        coder->position += 4;
    }
}

/* Shift one 32-bit word out of the interval (encoder), or into the code value (decoder). */
REEL_INLINE void reel_renormalize(reel_range_coder *coder) {
    if (reel_is_encoder(coder)) {
        reel_write_word(coder);
        coder->low <<= 32;
    } else {
        coder->low = coder->low << 32 | reel_read_word(coder);
    }
    coder->range <<= 32;
}

/* Code a bit that is 1 with a Q16 probability, 0 < probability < 65536. */
REEL_INLINE int reel_code_bit(reel_range_coder *coder, uint32_t probability, int bit) {
    uint64_t bound = (coder->range >> 16) * probability;
    if (reel_is_encoder(coder)) {
        if (bit) {
            coder->range = bound;
        } else {
            uint64_t low = coder->low + bound;
            if (low < bound) {
                reel_propagate_carry(coder);
            }
            coder->low = low;
            coder->range -= bound;
        }
    } else {
        bit = coder->low < bound;
        if (bit) {
            coder->range = bound;
        } else {
            coder->low -= bound;
            coder->range -= bound;
        }
    }
    if (coder->range < (uint64_t)1 << 32) {
        reel_renormalize(coder);
    }
    return bit;
}

/* Code the lowest `count` bits (0..28) of a value as equiprobable bits. */
REEL_INLINE uint32_t reel_code_raw(reel_range_coder *coder, int count, uint32_t value) {
    uint32_t max = (1U << count) - 1;
    coder->range >>= count; /* at least 2^4 */
    if (reel_is_encoder(coder)) {
        value &= max;
        uint64_t low = coder->low + coder->range * value;
        if (low < coder->low) {
            reel_propagate_carry(coder);
        }
        coder->low = low;
    } else {
        uint64_t result = coder->low / coder->range;
        value = result < max ? (uint32_t)result : max; /* exceeds `max` only in damaged streams */
        coder->low -= coder->range * value;
    }
    if (coder->range < (uint64_t)1 << 32) {
        reel_renormalize(coder);
    }
    return value;
}

/* Finish encoding; returns the size of the stream, or a failure. Writes the number with the fewest
   bytes in the final interval, without trailing zero bytes, which the decoder supplies. */
REEL_INLINE int64_t reel_finish_encoder(reel_range_coder *coder) {
    uint64_t high = coder->low + (coder->range - 1); /* may wrap around, which carries once more */
    uint64_t shortest = high;
    bool carried = high < coder->low;
    for (int n_bits = 0; n_bits <= 64; n_bits += 8) { /* highest bits that a candidate keeps */
        uint64_t mask = n_bits == 0 ? 0 : n_bits == 64 ? UINT64_MAX : ~(UINT64_MAX >> n_bits);
        uint64_t candidate = high & mask;
        if (carried ? true : candidate >= coder->low) {
            shortest = candidate;
            break;
        }
    }
    if (carried) {
        reel_propagate_carry(coder);
    }
    coder->low = shortest;
    reel_write_word(coder);
    coder->low <<= 32;
    reel_write_word(coder);
    if (coder->failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    while (coder->position > 0 && coder->out[coder->position - 1] == 0) {
        coder->position--;
    }
    return (int64_t)coder->position;
}

/* Finish decoding; returns the size of the stream, or a failure if bytes other than 0 follow. */
REEL_INLINE int64_t reel_finish_decoder(const reel_range_coder *coder) {
    for (size_t i = coder->position; i < coder->size; i++) {
        if (coder->in[i]) {
            return reel_failure(REEL_CORRUPT, i);
        }
    }
    return (int64_t)coder->size;
}

REEL_INLINE int64_t reel_finish(reel_range_coder *coder) {
    return reel_is_encoder(coder) ? reel_finish_encoder(coder) : reel_finish_decoder(coder);
}

/* An adaptive bit: two Q16 probabilities of a 1, one adapting fast and one slowly. */
typedef struct {
    uint16_t fast;
    uint16_t slow;
    uint16_t count; /* bits coded so far, up to REEL_MAX_COUNT */
} reel_model;

#define REEL_FAST_SHIFT 6        /* the fast estimate adapts by at least 2^-REEL_FAST_SHIFT */
#define REEL_MAX_COUNT 256       /* the slow one by at least 1 / (REEL_MAX_COUNT + 1.5) */
#define REEL_MIN_PROBABILITY 32U /* lower bound of the probability of either value, Q16 */

/* Q16 adaptation rate after n bits: 131072 / (2 n + 3), rounded down. */
static const uint16_t reel_adaptation_rates[REEL_MAX_COUNT + 1] = {
    43690, 26214, 18724, 14563, 11915, 10082, 8738, 7710, 6898, 6241, 5698, 5242, 4854, 4519, 4228,
    3971,  3744,  3542,  3360,  3196,  3048,  2912, 2788, 2674, 2570, 2473, 2383, 2299, 2221, 2148,
    2080,  2016,  1956,  1899,  1846,  1795,  1747, 1702, 1659, 1618, 1579, 1542, 1506, 1472, 1440,
    1409,  1379,  1351,  1323,  1297,  1272,  1248, 1224, 1202, 1180, 1159, 1139, 1120, 1101, 1083,
    1065,  1048,  1032,  1016,  1000,  985,   970,  956,  942,  929,  916,  903,  891,  879,  868,
    856,   845,   834,   824,   814,   804,   794,  784,  775,  766,  757,  748,  740,  732,  724,
    716,   708,   700,   693,   686,   679,   672,  665,  658,  652,  645,  639,  633,  627,  621,
    615,   609,   604,   598,   593,   587,   582,  577,  572,  567,  562,  557,  553,  548,  543,
    539,   534,   530,   526,   522,   518,   514,  510,  506,  502,  498,  494,  490,  487,  483,
    480,   476,   473,   469,   466,   463,   459,  456,  453,  450,  447,  444,  441,  438,  435,
    432,   429,   426,   424,   421,   418,   416,  413,  410,  408,  405,  403,  400,  398,  395,
    393,   391,   388,   386,   384,   382,   379,  377,  375,  373,  371,  369,  367,  365,  363,
    361,   359,   357,   355,   353,   351,   349,  347,  345,  344,  342,  340,  338,  336,  335,
    333,   331,   330,   328,   326,   325,   323,  322,  320,  318,  317,  315,  314,  312,  311,
    309,   308,   306,   305,   304,   302,   301,  299,  298,  297,  295,  294,  293,  291,  290,
    289,   288,   286,   285,   284,   283,   281,  280,  279,  278,  277,  275,  274,  273,  272,
    271,   270,   269,   268,   266,   265,   264,  263,  262,  261,  260,  259,  258,  257,  256,
    255,   254,
};

REEL_INLINE reel_model reel_model_of(uint32_t probability, int count) {
    return (reel_model){(uint16_t)probability, (uint16_t)probability, (uint16_t)count};
}

REEL_INLINE uint32_t reel_probability(const reel_model *model) {
    uint32_t mean = ((uint32_t)model->fast + model->slow) >> 1;
    return mean < REEL_MIN_PROBABILITY            ? REEL_MIN_PROBABILITY
           : mean > 65536U - REEL_MIN_PROBABILITY ? 65536U - REEL_MIN_PROBABILITY
                                                  : mean;
}

REEL_INLINE void reel_update_model(reel_model *model, int bit) {
    uint32_t rate = reel_adaptation_rates[model->count];
    uint32_t fast = rate > 65536U >> REEL_FAST_SHIFT ? rate : 65536U >> REEL_FAST_SHIFT;
    uint32_t flip = bit ? 65535U : 0U; /* for a 1, decrease the complement 65535 - p instead */
    uint32_t p = model->fast ^ flip, q = model->slow ^ flip;
    model->fast = (uint16_t)((p - (p * fast >> 16)) ^ flip);
    model->slow = (uint16_t)((q - (q * rate >> 16)) ^ flip);
    model->count = (uint16_t)(model->count + (model->count < REEL_MAX_COUNT));
}

/* Code a bit with an adaptive model, and update the model. */
REEL_INLINE int reel_bit(reel_range_coder *coder, reel_model *model, int bit) {
    bit = reel_code_bit(coder, reel_probability(model), bit);
    reel_update_model(model, bit);
    return bit;
}

/* `reel_bit` for a bit that is about as often 1 as 0: decoders do not branch on it. */
REEL_INLINE int reel_even_bit(reel_range_coder *coder, reel_model *model, int bit) {
    if (reel_is_encoder(coder)) {
        return reel_bit(coder, model, bit);
    }
    uint64_t bound = (coder->range >> 16) * reel_probability(model), low = coder->low;
    bit = low < bound;
    uint64_t zero_mask = (uint64_t)bit - 1; /* all ones if the bit is 0 */
    coder->low = low - (bound & zero_mask);
    coder->range = (bound & ~zero_mask) + ((coder->range - bound) & zero_mask);
    if (coder->range < (uint64_t)1 << 32) {
        reel_renormalize(coder);
    }
    reel_update_model(model, bit);
    return bit;
}

#endif
