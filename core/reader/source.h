/* Bytes of a stream, wherever they are: stretches, numbers and sections of it, each checked. */

#ifndef REEL_SOURCE_H
#define REEL_SOURCE_H

#include "../base.h"
#include "meshreel.h"

#define REEL_MOST_BYTES ((uint64_t)1 << 40) /* of a stream; so that no product of sizes overflows */
#define REEL_MOST_NUMBERS ((uint64_t)1 << 48) /* of a block, for the same reason */
#define REEL_OPTIONAL 0x80U

enum reel_section_id {
    REEL_END = 0,
    REEL_CONNECTIVITY = 1,
    REEL_ORDER = 2,
    REEL_SHAPE = 4,
    REEL_BLOCK = 16,
    REEL_BASIS = 17,
    REEL_COEFFICIENTS = 19,
    REEL_FIELDS = 21,
    REEL_CORRECTIONS = 22,
    REEL_TRACK_BLOCK = 23,
    REEL_VALUES = 24,
    REEL_MISSING = 25,
    REEL_ANCHOR_RESIDUALS = 26,
    REEL_PROMISE = 129,
    REEL_INDEX = 130,
    REEL_START = 135,
    REEL_TRACK = 138,
    REEL_HARD_EDGES = 139
};

/* Bytes of a stream, and the section that they are the payload of. */
typedef struct {
    uint64_t at, length;
} reel_stretch;

typedef struct {
    uint32_t id;
    uint64_t at;          /* the byte at which it begins */
    reel_stretch payload; /* its checksum is behind it */
    uint64_t end;         /* the byte behind it */
} reel_section;

/* What a result of the core is to a caller of the reader. */
int reel_code_of(int64_t result);

/* Copies bytes of a stream; MESHREEL_TRUNCATED where it ends before. */
int reel_read(const meshreel_source *source, uint64_t at, void *to, size_t size);

/* Bytes of a stream: where they are in memory, or a copy in the arena. `reel_view_room` is what they
   take of it. */
int reel_view(const meshreel_source *source, reel_stretch stretch, reel_arena *arena,
              const uint8_t **found);
size_t reel_view_room(const meshreel_source *source, uint64_t length);

/* CRC-32 of bytes of a stream, and whether it stands behind them. */
int reel_check(const meshreel_source *source, uint64_t at, uint64_t length);

/* Whether bits end as they should: nothing, or a byte that is not 0. */
bool reel_ends(const uint8_t *bytes, uint64_t length);

/* An integer of variable length before byte `end`; `at` is moved behind it. */
int reel_varint(const meshreel_source *source, uint64_t *at, uint64_t end, uint64_t *value);

/* The section at a byte of a stream, which ends before `limit`: where it lies; and whether it is
   sound, and known or optional. */
int reel_section_at(const meshreel_source *source, uint64_t at, uint64_t limit,
                    reel_section *found);
int reel_section_check(const meshreel_source *source, const reel_section *section);

/* Whether this build knows sections of this id; others are optional. */
bool reel_is_known(uint32_t id);

#endif
