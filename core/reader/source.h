/* The bytes of a file: ranges, numbers, texts and sections, all bounds-checked. */

#ifndef REEL_SOURCE_H
#define REEL_SOURCE_H

#include "call.h"

/* Limits of a file, and of the numbers in a block, so that no product of sizes overflows. */
#define REEL_MAX_FILE_BYTES ((uint64_t)1 << 40)
#define REEL_MAX_NUMBERS ((uint64_t)1 << 48)
#define REEL_OPTIONAL 0x80U

enum reel_section_id {
    REEL_END = 0,
    REEL_CONNECTIVITY = 1,
    REEL_ORDER = 2,
    REEL_SHAPE = 4,
    REEL_SEGMENT = 5,
    REEL_REFERENCE = 6,
    REEL_EDIT = 7,
    REEL_CELLS = 8,
    REEL_BLOCK = 16,
    REEL_BASIS = 17,
    REEL_ANCHORS = 18,
    REEL_COEFFICIENTS = 19,
    REEL_EXACT_POSITIONS = 20,
    REEL_FIELDS = 21,
    REEL_CORRECTIONS = 22,
    REEL_TRACK_BLOCK = 23,
    REEL_VALUES = 24,
    REEL_MISSING = 25,
    REEL_ANCHOR_RESIDUALS = 26,
    REEL_ROUNDING = 27,
    REEL_ERROR_BOUND = 129,
    REEL_INDEX = 130,
    REEL_POLYGONS = 131,
    REEL_ATTRIBUTE = 132,
    REEL_GROUPS = 133,
    REEL_PARTS = 134,
    REEL_START = 135,
    REEL_MATERIAL = 136,
    REEL_IMAGE = 137,
    REEL_TRACK = 138,
    REEL_HARD_EDGES = 139,
    REEL_TIMES = 140,
    REEL_ATTRIBUTE_FROM_POINTS = 141
};

/* A range of bytes of the file; readers consume it from the front. */
typedef struct {
    uint64_t offset, length;
} reel_range;

typedef struct {
    uint32_t id;
    uint64_t offset;
    reel_range payload; /* followed by its checksum, but in compact streams only that of END */
    uint64_t end;       /* end of the checksum */
} reel_section;

/* Copy bytes of the file; MESHREEL_TRUNCATED past its end. */
int reel_read(reel_call *call, uint64_t offset, void *to, size_t size);

/* Announce to the host that a range is about to be read. */
int reel_announce(reel_call *call, reel_range range);

/* Return a range of the file: in place if it is in memory, else a copy in scratch memory. */
int reel_view(reel_call *call, reel_range range, const uint8_t **result);

/* Copy a range of many short numbers to scratch memory, and read it from there until the caller
   sets `call->cached` to NULL and drops that memory. */
int reel_cache(reel_call *call, reel_range range);

/* Verify that `length` bytes are followed by their CRC-32. */
int reel_check_crc(reel_call *call, uint64_t offset, uint64_t length);

/* Read bytes or a varint from the front of a range. */
int reel_read_bytes(reel_call *call, reel_range *input, void *to, size_t size);
int reel_read_varint(reel_call *call, reel_range *input, uint64_t *value);

/* Read a UTF-8 text from the front of a range into memory of `pool`: a length and its bytes, or
   bytes of a known length. */
int reel_read_text(reel_call *call, reel_pool *pool, reel_range *input, meshreel_text *text);
int reel_read_text_bytes(reel_call *call, reel_pool *pool, reel_range *input, uint64_t size,
                         meshreel_text *text);

/* Decode rows of integers, "Integers" in docs/format.md, from a whole range into scratch memory.
   Row i has lengths[i] integers and uses table tables[i] of n_tables. */
int reel_decode_rows(reel_call *call, reel_range data, const int64_t *lengths,
                     const int32_t *tables, int64_t n_rows, int64_t n_tables, int32_t **values);

/* Parse the section at a byte of the file, which must end before `limit`. */
int reel_section_at(reel_call *call, uint64_t offset, uint64_t limit, reel_section *result);

/* Verify the checksum of a section, if it has its own, and that it is known or optional. */
int reel_section_check(reel_call *call, const reel_section *section);

/* Whether this build knows sections with this id. */
bool reel_is_known(uint32_t id);

/* Whether a bit stream is empty or ends with a nonzero byte. */
bool reel_is_stripped(const uint8_t *bytes, uint64_t length);

bool reel_is_finite(double number);

#endif
