/* Memory, threads and failures of a call. */

#include "call.h"

#define DEFAULT_LIMIT ((uint64_t)2 << 30)
#define MIN_SHARED 8192 /* numbers that are worth waking a thread */

struct reel_chunk {
    reel_chunk *previous;
    uint64_t size; /* including this header */
};

_Static_assert(sizeof(reel_chunk) <= REEL_ALIGNMENT, "the header of a chunk preserves alignment");

reel_call reel_begin_call(const meshreel_source *source, const meshreel_host *host, uint64_t size) {
    return (reel_call){.source = source, .host = host, .n_bytes = size};
}

int reel_end_call(reel_call *call, int failed, meshreel_error *error) {
    reel_release(call->host, &call->scratch);
    if (error) {
        *error = failed ? call->error : (meshreel_error){.offset = REEL_UNKNOWN, .message = ""};
    }
    return failed;
}

int reel_fail(reel_call *call, int code, uint64_t offset, const char *message) {
    call->error = (meshreel_error){.code = code, .offset = offset, .message = message};
    return code;
}

int reel_corrupt(reel_call *call, uint64_t offset, const char *message) {
    return reel_fail(call, MESHREEL_CORRUPT, offset, message);
}

int reel_incomplete(reel_call *call, uint64_t offset) {
    return reel_fail(call, REEL_INCOMPLETE, offset,
                     "this module lacks exact values and cells: use reel_full.wasm");
}

int reel_invalid(meshreel_error *error, const char *message) {
    if (error) {
        *error = (meshreel_error){.code = MESHREEL_INVALID, .offset = REEL_UNKNOWN,
                                  .message = message};
    }
    return MESHREEL_INVALID;
}

int reel_fail_core(reel_call *call, int64_t result, uint64_t payload, const char *message) {
    if (result >= 0) {
        return MESHREEL_OK;
    }
    uint64_t code = (uint64_t)-result & 0xFFU, place = (uint64_t)-result >> 8;
    if (code == REEL_NO_MEMORY) { /* a bug of the reader: less memory than the core states */
        return reel_fail(call, MESHREEL_INVALID, REEL_UNKNOWN, "internal error: too little memory");
    }
    return reel_fail(call, code == REEL_TRUNCATED ? MESHREEL_TRUNCATED : MESHREEL_CORRUPT,
                     payload + place, message);
}

int reel_reserve(reel_call *call, uint64_t count, uint64_t item) {
    uint64_t limit = call->host->memory_limit ? call->host->memory_limit : DEFAULT_LIMIT;
    limit = limit < SIZE_MAX / 2 ? limit : SIZE_MAX / 2;
    bool fits = !item || count <= (UINT64_MAX >> 8) / item;
    uint64_t payload = fits ? count * item : UINT64_MAX >> 8;
    uint64_t size = payload + REEL_ALIGNMENT;
#ifndef REEL_GUARDED /* unrounded sizes, so that sanitizers detect overruns */
    size = (size + REEL_ALIGNMENT - 1) / REEL_ALIGNMENT * REEL_ALIGNMENT;
#endif
    if (call->n_bytes > limit || size > limit - call->n_bytes) {
        reel_fail(call, MESHREEL_LIMIT, REEL_UNKNOWN,
                  "decoding needs more memory than the limit allows");
        call->error.size = call->n_bytes + size;
        return call->error.code;
    }
    call->n_bytes += size;
    return MESHREEL_OK;
}

void *reel_pool_allocate(reel_call *call, reel_pool *pool, uint64_t count, uint64_t item) {
    uint64_t before = call->n_bytes;
    if (reel_reserve(call, count, item)) {
        return NULL;
    }
    uint64_t size = call->n_bytes - before;
    reel_chunk *chunk = call->host->allocate(call->host->user, (size_t)size);
    if (!chunk) {
        reel_fail(call, MESHREEL_NO_MEMORY, REEL_UNKNOWN, "the host failed to allocate memory");
        call->error.size = call->n_bytes;
        call->n_bytes = before;
        return NULL;
    }
    *chunk = (reel_chunk){pool->last, size};
    pool->last = chunk;
    pool->n_bytes += size;
    return (uint8_t *)chunk + REEL_ALIGNMENT;
}

void *reel_scratch(reel_call *call, uint64_t count, uint64_t item) {
    return reel_pool_allocate(call, &call->scratch, count, item);
}

static void release_last(const meshreel_host *host, reel_pool *pool) {
    reel_chunk *chunk = pool->last;
    uint64_t size = chunk->size;
    pool->last = chunk->previous;
    pool->n_bytes -= size;
    host->release(host->user, chunk, (size_t)size);
}

void reel_drop_scratch(reel_call *call, const reel_chunk *mark) {
    uint64_t n_before = call->scratch.n_bytes;
    while (call->scratch.last != mark) {
        release_last(call->host, &call->scratch);
    }
    call->n_bytes -= n_before - call->scratch.n_bytes;
}

void reel_release(const meshreel_host *host, reel_pool *pool) {
    while (pool->last) {
        release_last(host, pool);
    }
}

int reel_append(const meshreel_host *host, int failed, reel_pool *pool, reel_pool *added) {
    reel_chunk **end = &added->last;
    if (failed) {
        reel_release(host, added);
        return failed;
    }
    while (*end) {
        end = &(*end)->previous;
    }
    *end = pool->last;
    pool->last = added->last;
    pool->n_bytes += added->n_bytes;
    return MESHREEL_OK;
}

void reel_run(const reel_call *call, void (*task)(void *shared, uint32_t i), void *shared,
              uint32_t n_tasks, uint64_t n_numbers) {
    if (n_tasks > 1 && n_numbers >= MIN_SHARED && reel_threads(call) > 1) {
        call->host->run(call->host->user, task, shared, n_tasks);
        return;
    }
    for (uint32_t i = 0; i < n_tasks; i++) {
        task(shared, i);
    }
}
