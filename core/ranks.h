/* A set of numbers below n that knows how many of it are below another, and which is the k-th. */

#ifndef REEL_RANKS_H
#define REEL_RANKS_H

#include "base.h"

typedef struct {
    uint64_t *bits;  /* 64 numbers in each */
    int32_t *counts; /* how many of the set are in some words: a binary indexed tree */
    int64_t n_words;
    int64_t size;
} reel_ranks;

REEL_INLINE size_t reel_ranks_room(int64_t n) {
    size_t words = (size_t)(n / 64 + 1);
    return reel_room(words, sizeof(uint64_t)) + reel_room(words + 1, sizeof(int32_t));
}

/* The empty set, or with `full` all numbers below n. What does not fit fails the arena. */
REEL_INLINE reel_ranks reel_ranks_of(reel_arena *arena, int64_t n, bool full) {
    reel_ranks set = {.n_words = n / 64 + 1, .size = full ? n : 0};
    set.bits = reel_take(arena, (size_t)set.n_words, sizeof *set.bits);
    set.counts = reel_take(arena, (size_t)set.n_words + 1, sizeof *set.counts);
    for (int64_t i = 0; !arena->failed && i < set.n_words; i++) {
        int64_t left = n - 64 * i;
        set.bits[i] = !full || left <= 0 ? 0 : left >= 64 ? UINT64_MAX : UINT64_MAX >> (64 - left);
        int64_t end = 64 * (i + 1) < n ? 64 * (i + 1) : n;
        int64_t start = 64 * (i + 1 - ((i + 1) & -(i + 1)));
        set.counts[i + 1] = full && start < end ? (int32_t)(end - start) : 0;
    }
    return set;
}

REEL_INLINE bool reel_ranks_has(const reel_ranks *set, int64_t number) {
    return set->bits[number / 64] >> (number % 64) & 1U;
}

/* Puts a number in, or with `change` -1 takes it out; it is not in it, or it is. */
REEL_INLINE void reel_ranks_change(reel_ranks *set, int64_t number, int change) {
    set->bits[number / 64] ^= (uint64_t)1 << (number % 64);
    set->size += change;
    for (int64_t i = number / 64 + 1; i <= set->n_words; i += i & -i) {
        set->counts[i] += change;
    }
}

/* How many of the set are below a number. */
REEL_INLINE int64_t reel_ranks_below(const reel_ranks *set, int64_t number) {
    uint64_t before = set->bits[number / 64] & (((uint64_t)1 << (number % 64)) - 1);
    int64_t found = __builtin_popcountll(before);
    for (int64_t i = number / 64; i > 0; i -= i & -i) {
        found += set->counts[i];
    }
    return found;
}

/* The number that has `rank` others of the set below it, 0 <= rank < size. */
REEL_INLINE int64_t reel_ranks_at(const reel_ranks *set, int64_t rank) {
    int64_t word = 0, step = 1;
    while (2 * step <= set->n_words) {
        step *= 2;
    }
    for (; step > 0; step /= 2) {
        if (word + step <= set->n_words && set->counts[word + step] <= rank) {
            word += step;
            rank -= set->counts[word];
        }
    }
    uint64_t bits = set->bits[word];
    for (; rank > 0; rank--) {
        bits &= bits - 1;
    }
    return 64 * word + __builtin_ctzll(bits);
}

#endif
