/* A set of numbers below n that knows how many of it are below another, and which is the k-th. */

#ifndef REEL_RANKS_H
#define REEL_RANKS_H

#include "base.h"

#define REEL_RANK_LEVELS 7 /* each counts 16 times as much as the one before; the first 64 */

typedef struct {
    uint64_t *bits;                    /* 64 numbers in each */
    int32_t *counts[REEL_RANK_LEVELS]; /* of the set in each word, in each 16 words, in 256, ... */
    int n_levels;
    int64_t size;
} reel_ranks;

/* Below 2^34 numbers. */
REEL_INLINE size_t reel_ranks_room(int64_t n) {
    size_t count = (size_t)(n / 64 + 1), room = reel_room(count, sizeof(uint64_t));
    for (; count > 16; count = (count + 15) / 16) {
        room += reel_room(count, sizeof(int32_t));
    }
    return room + reel_room(count, sizeof(int32_t));
}

/* The empty set, or with `full` all numbers below n. What does not fit fails the arena. */
REEL_INLINE reel_ranks reel_ranks_of(reel_arena *arena, int64_t n, bool full) {
    size_t count = (size_t)(n / 64 + 1);
    reel_ranks set = {.n_levels = 0, .size = full ? n : 0};
    set.bits = reel_take(arena, count, sizeof *set.bits);
    for (size_t i = 0; !arena->failed && i < count; i++) {
        int64_t left = n - 64 * (int64_t)i;
        set.bits[i] = !full || left <= 0 ? 0 : left >= 64 ? UINT64_MAX : UINT64_MAX >> (64 - left);
    }
    for (int64_t each = 64;; each *= 16, count = (count + 15) / 16) {
        int32_t *counts = set.counts[set.n_levels++] = reel_take(arena, count, sizeof *counts);
        for (size_t i = 0; !arena->failed && i < count; i++) {
            int64_t left = n - each * (int64_t)i;
            counts[i] = full ? (int32_t)(left < each ? left : each) : 0;
        }
        if (count <= 16) {
            return set;
        }
    }
}

REEL_INLINE bool reel_ranks_has(const reel_ranks *set, int64_t number) {
    return set->bits[number / 64] >> (number % 64) & 1U;
}

/* Puts a number in, or with `change` -1 takes it out; it is not in it, or it is. */
REEL_INLINE void reel_ranks_change(reel_ranks *set, int64_t number, int change) {
    uint64_t place = (uint64_t)number / 64;
    set->bits[place] ^= (uint64_t)1 << (number % 64);
    set->size += change;
    for (int level = 0; level < set->n_levels; level++, place /= 16) {
        set->counts[level][place] += change;
    }
}

/* How many of the set are below a number. */
REEL_INLINE int64_t reel_ranks_below(const reel_ranks *set, int64_t number) {
    uint64_t place = (uint64_t)number / 64;
    uint64_t before = set->bits[place] & (((uint64_t)1 << (number % 64)) - 1);
    int64_t found = __builtin_popcountll(before);
    for (int level = 0; level < set->n_levels; level++, place /= 16) {
        for (uint64_t i = place / 16 * 16; i < place; i++) {
            found += set->counts[level][i];
        }
    }
    return found;
}

/* The number that has `rank` others of the set below it, 0 <= rank < size. */
REEL_INLINE int64_t reel_ranks_at(const reel_ranks *set, int64_t rank) {
    int64_t place = 0;
    for (int level = set->n_levels - 1; level >= 0; level--) {
        const int32_t *counts = set->counts[level];
        for (place *= 16; counts[place] <= rank; place++) {
            rank -= counts[place];
        }
    }
    uint64_t bits = set->bits[place];
    for (; rank > 0; rank--) {
        bits &= bits - 1;
    }
    return 64 * place + __builtin_ctzll(bits);
}

#endif
