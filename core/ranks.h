/* A set of integers below n with rank and select queries: how many members are below a number, and
   which is the k-th member. */

#ifndef REEL_RANKS_H
#define REEL_RANKS_H

#include "base.h"

/* Levels of counters; the first covers 64 numbers, each further one 16 times as many. */
#define REEL_RANK_LEVELS 7

typedef struct {
    uint64_t *bits; /* one bit per number */
    /* Members in each word, in each 16 words, in each 256, ... */
    int32_t *counts[REEL_RANK_LEVELS];
    int n_levels;
    int64_t size;
} reel_ranks;

/* Bytes of a set of numbers below n; n is below 2^34. */
REEL_INLINE size_t reel_ranks_bytes(int64_t n) {
    size_t count = (size_t)(n / 64 + 1), size = reel_array_bytes(count, sizeof(uint64_t));
    for (; count > 16; count = (count + 15) / 16) {
        size += reel_array_bytes(count, sizeof(int32_t));
    }
    return size + reel_array_bytes(count, sizeof(int32_t));
}

/* Create the empty set, or with `full` the set of all numbers below n. Sets arena->failed if it
   does not fit. */
REEL_INLINE reel_ranks reel_ranks_of(reel_arena *arena, int64_t n, bool full) {
    size_t count = (size_t)(n / 64 + 1);
    reel_ranks set = {.n_levels = 0, .size = full ? n : 0};
    set.bits = reel_allocate(arena, count, sizeof *set.bits);
    for (size_t i = 0; !arena->failed && i < count; i++) {
        int64_t remaining = n - 64 * (int64_t)i;
        set.bits[i] = !full || remaining <= 0 ? 0
                      : remaining >= 64       ? UINT64_MAX
                                              : UINT64_MAX >> (64 - remaining);
    }
    for (int64_t span = 64;; span *= 16, count = (count + 15) / 16) {
        int32_t *counts = set.counts[set.n_levels++] = reel_allocate(arena, count, sizeof *counts);
        for (size_t i = 0; !arena->failed && i < count; i++) {
            int64_t remaining = n - span * (int64_t)i;
            counts[i] = full ? (int32_t)(remaining < span ? remaining : span) : 0;
        }
        if (count <= 16) {
            return set;
        }
    }
}

REEL_INLINE bool reel_ranks_has(const reel_ranks *set, int64_t number) {
    return set->bits[number / 64] >> (number % 64) & 1U;
}

/* Insert a number that is not a member (`change` 1), or remove a member (-1). */
REEL_INLINE void reel_ranks_change(reel_ranks *set, int64_t number, int change) {
    uint64_t word = (uint64_t)number / 64;
    set->bits[word] ^= (uint64_t)1 << (number % 64);
    set->size += change;
    for (int level = 0; level < set->n_levels; level++, word /= 16) {
        set->counts[level][word] += change;
    }
}

/* Number of members below a number. */
REEL_INLINE int64_t reel_ranks_rank(const reel_ranks *set, int64_t number) {
    uint64_t word = (uint64_t)number / 64;
    uint64_t lower_bits = set->bits[word] & (((uint64_t)1 << (number % 64)) - 1);
    int64_t result = __builtin_popcountll(lower_bits);
    for (int level = 0; level < set->n_levels; level++, word /= 16) {
        for (uint64_t i = word / 16 * 16; i < word; i++) {
            result += set->counts[level][i];
        }
    }
    return result;
}

/* The member that has `rank` members below it, 0 <= rank < size. */
REEL_INLINE int64_t reel_ranks_select(const reel_ranks *set, int64_t rank) {
    int64_t word = 0;
    for (int level = set->n_levels - 1; level >= 0; level--) {
        const int32_t *counts = set->counts[level];
        for (word *= 16; counts[word] <= rank; word++) {
            rank -= counts[word];
        }
    }
    uint64_t bits = set->bits[word];
    for (; rank > 0; rank--) {
        bits &= bits - 1;
    }
    return 64 * word + __builtin_ctzll(bits);
}

#endif
