/* Bits to bytes and back: a range coder, and models whose probabilities both sides learn.

   docs/format.md, "Bits". Writer and reader share every function: `reel_bit` takes the bit that is
   to be written, or anything where it is read, and returns the bit either way. So a model is
   written once, and cannot differ between the two sides. */

#ifndef REEL_BITS_H
#define REEL_BITS_H

#include "base.h"

typedef struct {
    uint64_t range; /* of the numbers that are still possible; at least 2^32 between bits */
    uint64_t low;   /* writer: the least of them; reader: the coded number less the least */
    uint8_t *out;
    const uint8_t *in;
    size_t position; /* bytes written, or read, also beyond the end */
    size_t size;     /* room of the writer, bytes of the reader */
    bool writes;
    bool failed; /* the writer has no more room */
} reel_port;

/* With REEL_DECODER_ONLY compilers know that nothing is written, and leave out what would be. */
REEL_INLINE bool reel_writes(const reel_port *port) {
#ifdef REEL_DECODER_ONLY
    (void)port;
    return false;
#else
    return port->writes;
#endif
}

REEL_INLINE uint32_t reel_next_word(reel_port *port) {
    uint32_t word = 0;
    size_t left = port->position < port->size ? port->size - port->position : 0;
    for (size_t i = 0; i < 4; i++) { /* behind the end all bytes are 0 */
        word = word << 8 | (i < left ? port->in[port->position + i] : 0U);
    }
    port->position += 4;
    return word;
}

REEL_INLINE reel_port reel_writer(uint8_t *out, size_t room) {
    return (reel_port){.range = UINT64_MAX, .out = out, .size = room, .writes = true};
}

REEL_INLINE reel_port reel_reader(const uint8_t *in, size_t size) {
    reel_port port = {.range = UINT64_MAX, .in = in, .size = size};
    port.low = (uint64_t)reel_next_word(&port) << 32;
    port.low |= reel_next_word(&port);
    return port;
}

/* Adds 1 to the number that is written so far. */
REEL_INLINE void reel_carry(reel_port *port) {
    size_t place = port->position;
    while (place > 0 && ++port->out[place - 1] == 0) {
        place--;
    }
}

REEL_INLINE void reel_put_word(reel_port *port) {
    if (port->size - port->position < 4) {
        port->failed = true;
        port->position = 0; /* what was written is lost */
    }
    if (port->size >= 4) {
        for (int i = 0; i < 4; i++) {
            port->out[port->position + (size_t)i] = (uint8_t)(port->low >> (56 - 8 * i));
        }
        port->position += 4;
    }
}

/* The highest word of the range is 0: a word is written, or read. */
REEL_INLINE void reel_renew(reel_port *port) {
    if (reel_writes(port)) {
        reel_put_word(port);
        port->low <<= 32;
    } else {
        port->low = port->low << 32 | reel_next_word(port);
    }
    port->range <<= 32;
}

/* A bit that is 1 with probability ones / 65536, 0 < ones < 65536. */
REEL_INLINE int reel_code_bit(reel_port *port, uint32_t ones, int bit) {
    uint64_t part = (port->range >> 16) * ones;
    if (reel_writes(port)) {
        if (bit) {
            port->range = part;
        } else {
            uint64_t low = port->low + part;
            if (low < part) {
                reel_carry(port);
            }
            port->low = low;
            port->range -= part;
        }
    } else {
        bit = port->low < part;
        if (bit) {
            port->range = part;
        } else {
            port->low -= part;
            port->range -= part;
        }
    }
    if (port->range < (uint64_t)1 << 32) {
        reel_renew(port);
    }
    return bit;
}

/* The lowest `count` bits (0..28) of a value, all as likely as not. */
REEL_INLINE uint32_t reel_code_raw(reel_port *port, int count, uint32_t value) {
    uint32_t most = (1U << count) - 1;
    port->range >>= count; /* at least 2^4 */
    if (reel_writes(port)) {
        value &= most;
        uint64_t low = port->low + port->range * value;
        if (low < port->low) {
            reel_carry(port);
        }
        port->low = low;
    } else {
        uint64_t found = port->low / port->range;
        value = found < most ? (uint32_t)found : most; /* above it in damaged bytes only */
        port->low -= port->range * value;
    }
    if (port->range < (uint64_t)1 << 32) {
        reel_renew(port);
    }
    return value;
}

/* Ends a writer; the bytes of the stream, or a failure. The number of fewest bytes among the
   possible ones is written, without the zeros at its end: they are what a reader sees there. */
REEL_INLINE int64_t reel_end_writer(reel_port *port) {
    uint64_t high = port->low + (port->range - 1); /* may be carried once more */
    uint64_t chosen = high;
    bool carried = high < port->low;
    for (int kept = 0; kept <= 64; kept += 8) { /* the shortest number in low..high */
        uint64_t mask = kept == 0 ? 0 : kept == 64 ? UINT64_MAX : ~(UINT64_MAX >> kept);
        uint64_t candidate = high & mask;
        if (carried ? true : candidate >= port->low) {
            chosen = candidate;
            break;
        }
    }
    if (carried) {
        reel_carry(port);
    }
    port->low = chosen;
    reel_put_word(port);
    port->low <<= 32;
    reel_put_word(port);
    if (port->failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    while (port->position > 0 && port->out[port->position - 1] == 0) {
        port->position--;
    }
    return (int64_t)port->position;
}

/* Ends a reader: nothing but zeros may follow what it read; the bytes, or a failure. */
REEL_INLINE int64_t reel_end_reader(const reel_port *port) {
    for (size_t i = port->position; i < port->size; i++) {
        if (port->in[i]) {
            return reel_failure(REEL_CORRUPT, i);
        }
    }
    return (int64_t)port->size;
}

REEL_INLINE int64_t reel_end(reel_port *port) {
    return reel_writes(port) ? reel_end_writer(port) : reel_end_reader(port);
}

/* An adaptive bit: probabilities of a 1 by 65536 that follow quickly and slowly. */
typedef struct {
    uint16_t quick;
    uint16_t slow;
    uint16_t seen; /* bits so far, up to REEL_SLOW */
} reel_model;

#define REEL_QUICK 6   /* the quick one never moves by less than 2^-REEL_QUICK */
#define REEL_SLOW 256  /* nor the slow one by less than 1 / (REEL_SLOW + 1.5) */
#define REEL_LEAST 32U /* least probability of either value, by 65536 */

/* 131072 / (2 n + 3) for n = 0..REEL_SLOW, rounded down. */
static const uint16_t reel_rates[REEL_SLOW + 1] = {
    43690, 26214, 18724, 14563, 11915, 10082, 8738, 7710, 6898, 6241, 5698, 5242,
    4854, 4519, 4228, 3971, 3744, 3542, 3360, 3196, 3048, 2912, 2788, 2674,
    2570, 2473, 2383, 2299, 2221, 2148, 2080, 2016, 1956, 1899, 1846, 1795,
    1747, 1702, 1659, 1618, 1579, 1542, 1506, 1472, 1440, 1409, 1379, 1351,
    1323, 1297, 1272, 1248, 1224, 1202, 1180, 1159, 1139, 1120, 1101, 1083,
    1065, 1048, 1032, 1016, 1000, 985, 970, 956, 942, 929, 916, 903,
    891, 879, 868, 856, 845, 834, 824, 814, 804, 794, 784, 775,
    766, 757, 748, 740, 732, 724, 716, 708, 700, 693, 686, 679,
    672, 665, 658, 652, 645, 639, 633, 627, 621, 615, 609, 604,
    598, 593, 587, 582, 577, 572, 567, 562, 557, 553, 548, 543,
    539, 534, 530, 526, 522, 518, 514, 510, 506, 502, 498, 494,
    490, 487, 483, 480, 476, 473, 469, 466, 463, 459, 456, 453,
    450, 447, 444, 441, 438, 435, 432, 429, 426, 424, 421, 418,
    416, 413, 410, 408, 405, 403, 400, 398, 395, 393, 391, 388,
    386, 384, 382, 379, 377, 375, 373, 371, 369, 367, 365, 363,
    361, 359, 357, 355, 353, 351, 349, 347, 345, 344, 342, 340,
    338, 336, 335, 333, 331, 330, 328, 326, 325, 323, 322, 320,
    318, 317, 315, 314, 312, 311, 309, 308, 306, 305, 304, 302,
    301, 299, 298, 297, 295, 294, 293, 291, 290, 289, 288, 286,
    285, 284, 283, 281, 280, 279, 278, 277, 275, 274, 273, 272,
    271, 270, 269, 268, 266, 265, 264, 263, 262, 261, 260, 259,
    258, 257, 256, 255, 254,
};

REEL_INLINE reel_model reel_model_of(uint32_t ones, int seen) {
    return (reel_model){(uint16_t)ones, (uint16_t)ones, (uint16_t)seen};
}

REEL_INLINE uint32_t reel_probability(const reel_model *model) {
    uint32_t ones = ((uint32_t)model->quick + model->slow) >> 1;
    return ones < REEL_LEAST ? REEL_LEAST
           : ones > 65536U - REEL_LEAST ? 65536U - REEL_LEAST
                                        : ones;
}

REEL_INLINE void reel_learn(reel_model *model, int bit) {
    uint32_t rate = reel_rates[model->seen];
    uint32_t quick = rate > 65536U >> REEL_QUICK ? rate : 65536U >> REEL_QUICK;
    if (bit) {
        model->quick = (uint16_t)(model->quick + (((65535U - model->quick) * quick) >> 16));
        model->slow = (uint16_t)(model->slow + (((65535U - model->slow) * rate) >> 16));
    } else {
        model->quick = (uint16_t)(model->quick - ((model->quick * quick) >> 16));
        model->slow = (uint16_t)(model->slow - ((model->slow * rate) >> 16));
    }
    model->seen = (uint16_t)(model->seen + (model->seen < REEL_SLOW));
}

/* A bit in a context; both sides learn from it. */
REEL_INLINE int reel_bit(reel_port *port, reel_model *model, int bit) {
    bit = reel_code_bit(port, reel_probability(model), bit);
    reel_learn(model, bit);
    return bit;
}

#endif
