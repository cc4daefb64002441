/* Unique names, checked by a merge sort because a file may have a million names. */

#include "names.h"

/* Compare two texts as bytes: negative, 0 or positive. */
static int compare(const meshreel_text *first, const meshreel_text *second) {
    size_t shorter = first->size < second->size ? first->size : second->size;
    for (size_t i = 0; i < shorter; i++) {
        uint8_t a = (uint8_t)first->bytes[i], b = (uint8_t)second->bytes[i];
        if (a != b) {
            return a < b ? -1 : 1;
        }
    }
    return first->size < second->size ? -1 : first->size > second->size;
}

/* Merge the sorted ranges from[start .. middle - 1] and from[middle .. end - 1]. */
static void merge(const meshreel_text *sorted, uint64_t start, uint64_t middle, uint64_t end,
                  meshreel_text *merged) {
    uint64_t left = start, right = middle;
    for (uint64_t i = start; i < end; i++) {
        bool takes_left =
            right == end || (left < middle && compare(&sorted[left], &sorted[right]) <= 0);
        merged[i] = sorted[takes_left ? left++ : right++];
    }
}

int reel_check_names(reel_call *call, meshreel_text *names, uint32_t count, uint64_t offset,
                     const char *message) {
    const reel_chunk *mark = call->scratch.last;
    meshreel_text *sorted = names, *merged = reel_scratch(call, count, sizeof *merged);
    REEL_NEED(merged);
    for (uint64_t run = 1; run < count; run *= 2) {
        for (uint64_t start = 0; start < count; start += 2 * run) {
            uint64_t middle = start + run < count ? start + run : count;
            uint64_t end = middle + run < count ? middle + run : count;
            merge(sorted, start, middle, end, merged);
        }
        meshreel_text *other = sorted;
        sorted = merged;
        merged = other;
    }
    bool are_unique = true;
    for (uint32_t i = 1; i < count; i++) {
        are_unique &= compare(&sorted[i - 1], &sorted[i]) != 0;
    }
    reel_drop_scratch(call, mark);
    return are_unique ? MESHREEL_OK : reel_corrupt(call, offset, message);
}
