/* The bytes of a file, in memory or behind a callback: docs/format.md, the sections. */

#include "source.h"

#define MAX_VARINT_BYTES 9
#define PIECE 4096
#define MAX_DOUBLE 0x1.fffffffffffffp1023

bool reel_is_finite(double number) { return number >= -MAX_DOUBLE && number <= MAX_DOUBLE; }

static int fail_truncated(reel_call *call, uint64_t offset) {
    return reel_fail(call, MESHREEL_TRUNCATED, offset, "the file ends too early; fetch it again");
}

static int fail_cut_off(reel_call *call, uint64_t offset) {
    return reel_fail(call, MESHREEL_TRUNCATED, offset, "a section ends inside a number or a text");
}

/* Fail because a section exceeds `limit`: the end of the file, or of what the index lists. */
static int fail_at_limit(reel_call *call, uint64_t offset, uint64_t limit) {
    REEL_CORRUPT_IF(limit < call->source->size, offset,
                    "a section is longer than the index or the blocks allow");
    return fail_truncated(call, offset);
}

static int fail_unreadable(reel_call *call, reel_range range, const char *message) {
    reel_fail(call, MESHREEL_UNREADABLE, range.offset, message);
    call->error.size = range.length;
    return MESHREEL_UNREADABLE;
}

int reel_read(reel_call *call, uint64_t offset, void *to, size_t size) {
    const meshreel_source *source = call->source;
    if (offset > source->size || size > source->size - offset) {
        return fail_truncated(call, source->size);
    }
    if (!size) {
        return MESHREEL_OK;
    }
    if (source->bytes) {
        reel_copy(to, (const uint8_t *)source->bytes + offset, size);
        return MESHREEL_OK;
    }
    if (call->cached && offset >= call->cached_at &&
        offset - call->cached_at <= call->cached_size &&
        size <= call->cached_size - (offset - call->cached_at)) {
        reel_copy(to, call->cached + (offset - call->cached_at), size);
        return MESHREEL_OK;
    }
    if (source->read(source->user, offset, to, size)) {
        return fail_unreadable(call, (reel_range){offset, size},
                               "the function that reads the file failed");
    }
    return MESHREEL_OK;
}

int reel_announce(reel_call *call, reel_range range) {
    const meshreel_source *source = call->source;
    if (source->bytes || !source->announce ||
        !source->announce(source->user, range.offset, range.length)) {
        return MESHREEL_OK;
    }
    return fail_unreadable(call, range, "the function that announces a range failed");
}

int reel_view(reel_call *call, reel_range range, const uint8_t **result) {
    const meshreel_source *source = call->source;
    if (range.offset > source->size || range.length > source->size - range.offset) {
        return fail_truncated(call, source->size);
    }
    if (source->bytes) {
        *result = (const uint8_t *)source->bytes + range.offset;
        return MESHREEL_OK;
    }
    uint8_t *copy = reel_scratch(call, range.length, 1);
    *result = copy;
    return copy ? reel_read(call, range.offset, copy, (size_t)range.length) : call->error.code;
}

/* CRC-32 table of 4-bit values. */
static const uint32_t crc_table[16] = {
    0x00000000U, 0x1DB71064U, 0x3B6E20C8U, 0x26D930ACU, 0x76DC4190U, 0x6B6B51F4U,
    0x4DB26158U, 0x5005713CU, 0xEDB88320U, 0xF00F9344U, 0xD6D6A3E8U, 0xCB61B38CU,
    0x9B64C2B0U, 0x86D3D2D4U, 0xA00AE278U, 0xBDBDF21CU,
};

/* by_position[k]: CRC-32 of a 4-bit value that 28 - 4 k bits of 0 follow. */
typedef struct {
    uint32_t by_position[8][16];
} crc_tables;

static void compute_tables(crc_tables *tables) {
    reel_copy(tables->by_position[7], crc_table, sizeof crc_table);
    for (int k = 6; k >= 0; k--) {
        for (uint32_t i = 0; i < 16; i++) {
            uint32_t sum = tables->by_position[k + 1][i];
            tables->by_position[k][i] = sum >> 4 ^ crc_table[sum & 15U];
        }
    }
}

static uint32_t update_crc(const crc_tables *tables, uint32_t sum, const uint8_t *bytes,
                           size_t size) {
    for (; size >= 4; bytes += 4, size -= 4) {
        sum ^= bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 |
               (uint32_t)bytes[3] << 24;
        uint32_t next = 0;
        for (int k = 0; k < 8; k++) {
            next ^= tables->by_position[k][sum >> 4 * k & 15U];
        }
        sum = next;
    }
    for (; size; size--) {
        sum ^= *bytes++;
        sum = sum >> 4 ^ crc_table[sum & 15U];
        sum = sum >> 4 ^ crc_table[sum & 15U];
    }
    return sum;
}

int reel_cache(reel_call *call, reel_range range) {
    const uint8_t *bytes;
    REEL_TRY(reel_view(call, range, &bytes));
    call->cached = bytes;
    call->cached_at = range.offset;
    call->cached_size = range.length;
    return MESHREEL_OK;
}

int reel_check_crc(reel_call *call, uint64_t offset, uint64_t length) {
    uint8_t piece[PIECE];
    crc_tables tables;
    uint32_t sum = ~0U, expected;
    compute_tables(&tables);
    for (uint64_t n_read = 0; n_read < length;) {
        size_t size = length - n_read < PIECE ? (size_t)(length - n_read) : PIECE;
        REEL_TRY(reel_read(call, offset + n_read, piece, size));
        sum = update_crc(&tables, sum, piece, size);
        n_read += size;
    }
    REEL_TRY(reel_read(call, offset + length, &expected, sizeof expected));
    REEL_CORRUPT_IF(expected != ~sum, offset, "a checksum does not match; fetch the file again");
    return MESHREEL_OK;
}

int reel_read_bytes(reel_call *call, reel_range *input, void *to, size_t size) {
    if (input->length < size) {
        return fail_cut_off(call, input->offset);
    }
    REEL_TRY(reel_read(call, input->offset, to, size));
    *input = (reel_range){input->offset + size, input->length - size};
    return MESHREEL_OK;
}

int reel_read_varint(reel_call *call, reel_range *input, uint64_t *value) {
    uint8_t bytes[MAX_VARINT_BYTES];
    size_t size = input->length < MAX_VARINT_BYTES ? (size_t)input->length : MAX_VARINT_BYTES;
    REEL_TRY(reel_read(call, input->offset, bytes, size));
    *value = 0;
    for (size_t i = 0; i < size; i++) {
        *value |= (uint64_t)(bytes[i] & 0x7FU) << (7 * i);
        if (bytes[i] < 0x80U) {
            *input = (reel_range){input->offset + i + 1, input->length - i - 1};
            return MESHREEL_OK;
        }
    }
    return size < MAX_VARINT_BYTES
               ? fail_cut_off(call, input->offset)
               : reel_corrupt(call, input->offset, "an integer has more than 9 bytes");
}

/* Length of the UTF-8 character at the front of `bytes`, or 0 if invalid. */
static size_t utf8_length(const uint8_t *bytes, size_t size) {
    uint8_t first = bytes[0];
    size_t length = first < 0x80 ? 1 : first < 0xC2 ? 0 : first < 0xE0 ? 2 : first < 0xF0 ? 3
                  : first < 0xF5 ? 4 : 0;
    if (length > size) {
        return 0;
    }
    for (size_t i = 1; i < length; i++) {
        if ((bytes[i] & 0xC0U) != 0x80U) {
            return 0;
        }
    }
    bool is_overlong = (first == 0xE0 && bytes[1] < 0xA0) || (first == 0xF0 && bytes[1] < 0x90);
    bool is_surrogate = first == 0xED && bytes[1] > 0x9F;
    bool is_beyond = first == 0xF4 && bytes[1] > 0x8F;
    return is_overlong || is_surrogate || is_beyond ? 0 : length;
}

int reel_read_text(reel_call *call, reel_pool *pool, reel_range *input, meshreel_text *text) {
    uint64_t size;
    REEL_TRY(reel_read_varint(call, input, &size));
    return reel_read_text_bytes(call, pool, input, size, text);
}

int reel_read_text_bytes(reel_call *call, reel_pool *pool, reel_range *input, uint64_t size,
                         meshreel_text *text) {
    if (size > input->length) {
        return fail_cut_off(call, input->offset);
    }
    char *bytes = reel_pool_allocate(call, pool, size, 1);
    uint64_t offset = input->offset;
    REEL_NEED(bytes);
    REEL_TRY(reel_read_bytes(call, input, bytes, (size_t)size));
    *text = (meshreel_text){bytes, (size_t)size};
    for (size_t i = 0; i < size;) {
        size_t length = utf8_length((const uint8_t *)bytes + i, (size_t)size - i);
        REEL_CORRUPT_IF(!length, offset + i, "a text is not UTF-8");
        i += length;
    }
    return MESHREEL_OK;
}

bool reel_is_stripped(const uint8_t *bytes, uint64_t length) {
    return !length || bytes[length - 1];
}

int reel_decode_rows(reel_call *call, reel_range data, const int64_t *lengths,
                     const int32_t *tables, int64_t n_rows, int64_t n_tables, int32_t **values) {
    uint64_t count = 0;
    for (int64_t i = 0; i < n_rows; i++) {
        count += (uint64_t)lengths[i];
    }
    size_t memory_size = reel_integers_memory(n_tables);
    *values = reel_scratch(call, count, sizeof **values);
    const reel_chunk *mark = call->scratch.last;
    void *memory = reel_scratch(call, memory_size, 1);
    const uint8_t *bytes;
    REEL_NEED(*values && memory);
    REEL_TRY(reel_view(call, data, &bytes));
    REEL_CORRUPT_IF(!reel_is_stripped(bytes, data.length), data.offset + data.length - 1,
                    "integers end with a zero byte");
    int64_t result = reel_integers_decode(memory, memory_size, bytes, (size_t)data.length, lengths,
                                          tables, n_rows, n_tables, *values);
    reel_drop_scratch(call, mark);
    return reel_fail_core(call, result, data.offset, "integers are damaged");
}

int reel_section_at(reel_call *call, uint64_t offset, uint64_t limit, reel_section *result) {
    uint8_t id;
    if (offset >= limit) {
        return fail_at_limit(call, offset, limit);
    }
    reel_range input = {offset, limit - offset};
    uint64_t length;
    int failed = reel_read_bytes(call, &input, &id, 1);
    failed = failed ? failed : reel_read_varint(call, &input, &length);
    if (failed) {
        return failed == MESHREEL_TRUNCATED ? fail_at_limit(call, offset, limit) : failed;
    }
    uint64_t checksum = call->is_compact && id != REEL_END ? 0 : 4;
    if (input.length < checksum || length > input.length - checksum) {
        return fail_at_limit(call, offset, limit);
    }
    *result = (reel_section){id, offset, {input.offset, length}, input.offset + length + checksum};
    return MESHREEL_OK;
}

bool reel_is_known(uint32_t id) {
    uint32_t last = id & REEL_OPTIONAL ? REEL_ATTRIBUTE_FROM_POINTS : REEL_ROUNDING;
    bool is_gap = (id > REEL_CELLS && id < REEL_BLOCK) || id == REEL_OPTIONAL;
    return id <= last && !is_gap;
}

int reel_section_check(reel_call *call, const reel_section *section) {
    uint64_t length = section->payload.offset + section->payload.length - section->offset;
    REEL_TRY(call->is_compact ? MESHREEL_OK : reel_check_crc(call, section->offset, length));
    bool is_needed = !(section->id & REEL_OPTIONAL) && !reel_is_known(section->id);
    return is_needed ? reel_fail(call, MESHREEL_UNSUPPORTED, section->offset,
                                 "a section needs a newer version; update meshreel")
                     : MESHREEL_OK;
}
