/* The allocator that the Python package gives to the file reader: aligns the memory of another
   allocator, and counts the bytes that the reader holds. */

#include "base.h"

void *reel_host_allocate(void *user, size_t size) {
    reel_host_memory *host = user;
    void *raw = size > SIZE_MAX / 4 ? NULL : host->allocate(size + 2 * REEL_ALIGNMENT);
    if (!raw) {
        return NULL;
    }
    uintptr_t address = ((uintptr_t)raw / REEL_ALIGNMENT + 2) * REEL_ALIGNMENT;
    ((void **)address)[-1] = raw;
    __atomic_add_fetch(&host->n_bytes, size, __ATOMIC_RELAXED);
    return (void *)address;
}

void reel_host_release(void *user, void *memory, size_t size) {
    reel_host_memory *host = user;
    __atomic_sub_fetch(&host->n_bytes, size, __ATOMIC_RELAXED);
    host->release(((void **)memory)[-1]);
}
