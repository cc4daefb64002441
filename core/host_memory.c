/* Memory of a host whose allocator is slow, or is called under a lock: released blocks are kept for
   later ones of about the same size. The Python package lends it to the file reader.

   A flag protects the lists of blocks. A thread that finds it set does not wait: it takes a new
   block, or releases one, and a process that forked meanwhile does so from then on. */

#include "base.h"

/* What precedes each block, within REEL_ALIGNMENT bytes. */
typedef struct reel_block {
    struct reel_block *next;
    void *raw; /* from the allocator */
} reel_block;

_Static_assert(sizeof(reel_block) <= REEL_ALIGNMENT, "a block begins behind its header");

/* Round a size up to one of four per power of 2, whose number is `place`. */
static size_t rounded(size_t size, int *place) {
    size = size < REEL_ALIGNMENT ? REEL_ALIGNMENT : size;
    int shift = 61 - __builtin_clzll(size);
    size_t quarters = (size >> shift) + ((size & (((size_t)1 << shift) - 1)) != 0);
    *place = 4 * shift + (int)quarters - 4;
    return quarters << shift;
}

static bool begin(reel_block_store *store) {
    return !__atomic_test_and_set(&store->is_used, __ATOMIC_ACQUIRE);
}

static void end(reel_block_store *store) { __atomic_clear(&store->is_used, __ATOMIC_RELEASE); }

static reel_block *take(reel_block_store *store, int place, size_t size) {
    reel_block *block = NULL;
    if (begin(store)) {
        block = store->blocks[place];
        if (block) {
            store->blocks[place] = block->next;
            store->n_bytes -= size;
        }
        end(store);
    }
    return block;
}

static bool keep(reel_block_store *store, reel_block *block, int place, size_t size) {
    bool is_kept = false;
    if (begin(store)) {
        is_kept = size <= store->max_bytes && store->n_bytes <= store->max_bytes - size;
        if (is_kept) {
            block->next = store->blocks[place];
            store->blocks[place] = block;
            store->n_bytes += size;
        }
        end(store);
    }
    return is_kept;
}

void *reel_host_allocate(void *user, size_t size) {
    reel_host_memory *host = user;
    if (size > SIZE_MAX / 4) {
        return NULL;
    }
    int place;
    size_t capacity = rounded(size, &place);
    reel_block *block = take(host->store, place, capacity);
    if (!block) {
        void *raw = host->store->allocate(capacity + 2 * REEL_ALIGNMENT);
        if (!raw) {
            return NULL;
        }
        block = (reel_block *)(((uintptr_t)raw + REEL_ALIGNMENT - 1) / REEL_ALIGNMENT *
                               REEL_ALIGNMENT);
        block->raw = raw;
    }
    __atomic_add_fetch(&host->n_bytes, size, __ATOMIC_RELAXED);
    return (uint8_t *)block + REEL_ALIGNMENT;
}

void reel_host_release(void *user, void *memory, size_t size) {
    reel_host_memory *host = user;
    reel_block *block = (reel_block *)((uint8_t *)memory - REEL_ALIGNMENT);
    int place;
    size_t capacity = rounded(size, &place);
    __atomic_sub_fetch(&host->n_bytes, size, __ATOMIC_RELAXED);
    if (!keep(host->store, block, place, capacity)) {
        host->store->release(block->raw);
    }
}
