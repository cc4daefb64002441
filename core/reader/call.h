/* What a call of the public API carries downward: the bytes of the file, the host, memory that ends
   with the call, and the first failure. */

#ifndef REEL_CALL_H
#define REEL_CALL_H

#include "../base.h"
#include "../include/meshreel.h"

/* 1: this build decodes positions of the method reel alone, as pages load it first. */
#ifndef REEL_ONLY_POSITIONS
#define REEL_ONLY_POSITIONS 0
#endif

#define REEL_UNKNOWN UINT64_MAX /* offset of a failure that belongs to no byte of the file */

/* Memory from the host that is released together, last first. */
typedef struct reel_chunk reel_chunk;
typedef struct {
    reel_chunk *last;
    uint64_t held;
} reel_pool;

typedef struct {
    const meshreel_source *source;
    const meshreel_host *host;
    uint64_t held; /* by the object that is called, counted against the limit */
    reel_pool scratch;
    meshreel_error error;
} reel_call;

/* Begin a call on an object that holds `held` bytes. */
reel_call reel_begin_call(const meshreel_source *source, const meshreel_host *host, uint64_t held);

/* Releases the scratch memory of a call, copies its failure, and returns its code. */
int reel_end_call(reel_call *call, int failed, meshreel_error *error);

/* Notes a failure, and returns its code. */
int reel_fail(reel_call *call, int code, uint64_t offset, const char *message);

/* The same for MESHREEL_CORRUPT. */
int reel_corrupt(reel_call *call, uint64_t offset, const char *message);

/* Notes MESHREEL_INVALID for a call that does not begin, and returns it. */
int reel_invalid(meshreel_error *error, const char *message);

/* The same as `reel_fail` for a result of the core that is below 0; MESHREEL_OK for others. The
   payload that it decoded begins at `payload`. */
int reel_fail_core(reel_call *call, int64_t result, uint64_t payload, const char *message);

/* Memory for `count` items of `item` bytes, aligned to 64 bytes; NULL after a failure, which is
   noted. Memory for 0 items is not NULL. */
void *reel_pool_allocate(reel_call *call, reel_pool *pool, uint64_t count, uint64_t item);

/* The same, released at the end of the call or by `reel_drop_scratch`. */
void *reel_scratch(reel_call *call, uint64_t count, uint64_t item);

/* Releases the scratch memory that was taken after `mark`, a value of call->scratch.last. */
void reel_drop_scratch(reel_call *call, const reel_chunk *mark);

/* Releases all memory of a pool. */
void reel_release(const meshreel_host *host, reel_pool *pool);

/* Moves the memory of `more` to `pool`. */
void reel_append(reel_pool *pool, reel_pool *more);

/* Runs tasks on the threads of the host. */
void reel_run(const reel_call *call, void (*task)(void *shared, uint32_t i), void *shared,
              uint32_t n_tasks);

/* Threads that work is divided among. */
REEL_INLINE uint32_t reel_threads(const reel_call *call) {
    return call->host->run && call->host->n_threads > 1 ? call->host->n_threads : 1;
}

#endif
