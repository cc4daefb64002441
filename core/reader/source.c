/* Bytes of a stream, wherever they are: docs/format.md, the sections. */

#include "source.h"

#define MOST_VARINT 9
#define PIECE 1024

int reel_code_of(int64_t result) {
    int code = result < 0 ? (int)(-result & 0xFF) : MESHREEL_OK;
    return code == REEL_INVALID ? MESHREEL_CORRUPT : code; /* all that is given follows from bytes */
}

int reel_read(const meshreel_source *source, uint64_t at, void *to, size_t size) {
    if (at > source->size || size > source->size - at) {
        return MESHREEL_TRUNCATED;
    }
    if (source->bytes) {
        reel_copy(to, (const uint8_t *)source->bytes + at, size);
        return MESHREEL_OK;
    }
    return source->read(source->user, at, to, size) ? MESHREEL_UNREADABLE : MESHREEL_OK;
}

size_t reel_view_room(const meshreel_source *source, uint64_t length) {
    return source->bytes ? 0 : reel_room((size_t)length, 1);
}

int reel_view(const meshreel_source *source, reel_stretch stretch, reel_arena *arena,
              const uint8_t **found) {
    if (source->bytes) {
        if (stretch.at > source->size || stretch.length > source->size - stretch.at) {
            return MESHREEL_TRUNCATED;
        }
        *found = (const uint8_t *)source->bytes + stretch.at;
        return MESHREEL_OK;
    }
    uint8_t *copy = reel_take(arena, (size_t)stretch.length, 1);
    *found = copy;
    return copy ? reel_read(source, stretch.at, copy, (size_t)stretch.length) : MESHREEL_NO_MEMORY;
}

/* CRC-32 of half a byte. */
static const uint32_t halves[16] = {
    0x00000000U, 0x1DB71064U, 0x3B6E20C8U, 0x26D930ACU, 0x76DC4190U, 0x6B6B51F4U,
    0x4DB26158U, 0x5005713CU, 0xEDB88320U, 0xF00F9344U, 0xD6D6A3E8U, 0xCB61B38CU,
    0x9B64C2B0U, 0x86D3D2D4U, 0xA00AE278U, 0xBDBDF21CU,
};

static uint32_t checksum(uint32_t sum, const uint8_t *bytes, size_t size) {
    for (size_t i = 0; i < size; i++) {
        sum ^= bytes[i];
        sum = sum >> 4 ^ halves[sum & 15U];
        sum = sum >> 4 ^ halves[sum & 15U];
    }
    return sum;
}

int reel_check(const meshreel_source *source, uint64_t at, uint64_t length) {
    uint8_t piece[PIECE];
    uint32_t sum = ~0U, said;
    for (uint64_t done = 0; done < length;) {
        size_t size = length - done < PIECE ? (size_t)(length - done) : PIECE;
        int failed = reel_read(source, at + done, piece, size);
        if (failed) {
            return failed;
        }
        sum = checksum(sum, piece, size);
        done += size;
    }
    int failed = reel_read(source, at + length, &said, sizeof said);
    if (failed) {
        return failed;
    }
    return said == ~sum ? MESHREEL_OK : MESHREEL_CORRUPT;
}

bool reel_ends(const uint8_t *bytes, uint64_t length) { return !length || bytes[length - 1]; }

int reel_varint(const meshreel_source *source, uint64_t *at, uint64_t end, uint64_t *value) {
    uint8_t bytes[MOST_VARINT];
    size_t size = *at < end && end - *at < MOST_VARINT ? (size_t)(end - *at) : MOST_VARINT;
    int failed = *at < end ? reel_read(source, *at, bytes, size) : MESHREEL_TRUNCATED;
    *value = 0;
    for (size_t i = 0; i < size && !failed; i++) {
        *value |= (uint64_t)(bytes[i] & 0x7FU) << (7 * i);
        if (bytes[i] < 0x80U) {
            *at += i + 1;
            return MESHREEL_OK;
        }
    }
    if (failed) {
        return failed;
    }
    return size < MOST_VARINT ? MESHREEL_TRUNCATED : MESHREEL_CORRUPT;
}

int reel_section_at(const meshreel_source *source, uint64_t at, uint64_t limit,
                    reel_section *found) {
    uint8_t id;
    uint64_t place = at + 1, length;
    int failed = at < limit ? reel_read(source, at, &id, 1) : MESHREEL_TRUNCATED;
    failed = failed ? failed : reel_varint(source, &place, limit, &length);
    if (failed) {
        return failed;
    }
    if (limit - place < 4 || length > limit - place - 4) {
        return MESHREEL_TRUNCATED;
    }
    *found = (reel_section){id, at, {place, length}, place + length + 4};
    return MESHREEL_OK;
}

bool reel_is_known(uint32_t id) {
    uint32_t last = id & REEL_OPTIONAL ? REEL_HARD_EDGES : REEL_ANCHOR_RESIDUALS;
    bool is_gap = (id > REEL_SHAPE && id < REEL_BLOCK) || id == REEL_OPTIONAL;
    return id <= last && !is_gap;
}

int reel_section_check(const meshreel_source *source, const reel_section *section) {
    uint64_t length = section->payload.at + section->payload.length - section->at;
    int failed = reel_check(source, section->at, length);
    if (failed) {
        return failed;
    }
    bool is_needed = !(section->id & REEL_OPTIONAL) && !reel_is_known(section->id);
    return is_needed ? MESHREEL_UNSUPPORTED : MESHREEL_OK;
}
