/* The allocator that the Python package gives to the file reader. It keeps released blocks in a
   store, by size, and reuses them for later requests of about their size.

   One lock protects the lists of free blocks, but no thread waits for it: a thread that finds it
   taken uses the allocator below the store instead. In a process that was forked while another
   thread held the lock, it is never released, and all blocks come from that allocator. */

#include "base.h"

/* Header of a block, in the REEL_ALIGNMENT bytes before the memory that callers use. */
typedef struct reel_block {
    struct reel_block *next;
    void *raw; /* what the allocator returned */
} reel_block;

_Static_assert(sizeof(reel_block) <= REEL_ALIGNMENT, "the header precedes an aligned address");

/* Round a size up to a multiple of a quarter of its power of 2, so that few sizes exist; `list`
   becomes the number of the list of blocks of this size. */
static size_t block_size(size_t size, int *list) {
    size = size < REEL_ALIGNMENT ? REEL_ALIGNMENT : size;
    int shift = 61 - __builtin_clzll(size);
    size_t quarters = (size >> shift) + ((size & (((size_t)1 << shift) - 1)) != 0);
    *list = 4 * shift + (int)quarters - 4;
    return quarters << shift;
}

static bool try_lock(reel_block_store *store) {
    return !__atomic_test_and_set(&store->is_locked, __ATOMIC_ACQUIRE);
}

static void unlock(reel_block_store *store) {
    __atomic_clear(&store->is_locked, __ATOMIC_RELEASE);
}

/* Return a free block, or NULL if there is none, or another thread holds the lock. */
static reel_block *pop_block(reel_block_store *store, int list, size_t size) {
    reel_block *block = NULL;
    if (try_lock(store)) {
        block = store->blocks[list];
        if (block) {
            store->blocks[list] = block->next;
            store->n_bytes -= size;
        }
        unlock(store);
    }
    return block;
}

/* Add a free block; returns false if the store is full, or another thread holds the lock. */
static bool push_block(reel_block_store *store, reel_block *block, int list, size_t size) {
    bool fits = false;
    if (try_lock(store)) {
        fits = size <= store->max_bytes && store->n_bytes <= store->max_bytes - size;
        if (fits) {
            block->next = store->blocks[list];
            store->blocks[list] = block;
            store->n_bytes += size;
        }
        unlock(store);
    }
    return fits;
}

void *reel_host_allocate(void *user, size_t size) {
    reel_host_memory *host = user;
    if (size > SIZE_MAX / 4) {
        return NULL;
    }
    int list;
    size_t capacity = block_size(size, &list);
    reel_block *block = pop_block(host->store, list, capacity);
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
    int list;
    size_t capacity = block_size(size, &list);
    __atomic_sub_fetch(&host->n_bytes, size, __ATOMIC_RELAXED);
    if (!push_block(host->store, block, list, capacity)) {
        host->store->release(block->raw);
    }
}
