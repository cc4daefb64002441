/* The context of a public API call: the bytes of the file, the host, memory that is released when
   the call ends, and the first failure. */

#ifndef REEL_CALL_H
#define REEL_CALL_H

#include "../base.h"
#include "../include/meshreel.h"

#define REEL_UNKNOWN UINT64_MAX /* offset of a failure without a position in the file */

/* Whether this build decodes exact values and cells. The smaller module of web pages does not: it
   fails with REEL_INCOMPLETE, a `meshreel_code` of that module only, and the page loads the other. */
#ifdef REEL_MESHES_ONLY
#define REEL_IS_COMPLETE false
#else
#define REEL_IS_COMPLETE true
#endif
#define REEL_INCOMPLETE 100

/* Memory from the host that is released together, last allocation first. */
typedef struct reel_chunk reel_chunk;
typedef struct {
    reel_chunk *last;
    uint64_t n_bytes;
} reel_pool;

typedef struct {
    const meshreel_source *source;
    const meshreel_host *host;
    uint64_t n_bytes; /* held by the object, counted against the limit */
    reel_pool scratch;
    bool is_compact; /* the sections have no checksums of their own */
    const uint8_t *cached; /* bytes of the file that are read without the source, or NULL */
    uint64_t cached_at, cached_size;
    meshreel_error error;
} reel_call;

/* Begin a call on an object that holds `size` bytes. */
reel_call reel_begin_call(const meshreel_source *source, const meshreel_host *host, uint64_t size);

/* End a call: release its scratch memory, copy its failure to `error`, and return its code. */
int reel_end_call(reel_call *call, int failed, meshreel_error *error);

/* Record a failure, and return its code. */
int reel_fail(reel_call *call, int code, uint64_t offset, const char *message);

/* Record MESHREEL_CORRUPT, and return it. */
int reel_corrupt(reel_call *call, uint64_t offset, const char *message);

/* Record REEL_INCOMPLETE, and return it. */
int reel_incomplete(reel_call *call, uint64_t offset);

/* Fill `error` with MESHREEL_INVALID before a call has begun, and return it. */
int reel_invalid(meshreel_error *error, const char *message);

/* Record the failure of a core function whose input begins at byte `payload`; returns MESHREEL_OK
   if `result` is not negative. */
int reel_fail_core(reel_call *call, int64_t result, uint64_t payload, const char *message);

/* Return from a function of the reader with the failure of a step, unless it is MESHREEL_OK. */
#define REEL_TRY(step)                                                                             \
    do {                                                                                           \
        int failed_step = (step);                                                                  \
        if (failed_step) {                                                                         \
            return failed_step;                                                                    \
        }                                                                                          \
    } while (0)

/* Return a failure if a condition holds; REEL_INVALID_IF is for checks before a call has begun. */
#define REEL_RETURN_IF(condition, failure)                                                         \
    do {                                                                                           \
        if (condition) {                                                                           \
            return failure;                                                                        \
        }                                                                                          \
    } while (0)
#define REEL_CORRUPT_IF(condition, offset, message)                                                \
    REEL_RETURN_IF(condition, reel_corrupt(call, offset, message))
#define REEL_UNSUPPORTED_IF(condition, offset, message)                                            \
    REEL_RETURN_IF(condition, reel_fail(call, MESHREEL_UNSUPPORTED, offset, message))
#define REEL_INVALID_IF(condition, message) REEL_RETURN_IF(condition, reel_invalid(error, message))

/* Return the failure that an allocation recorded, if `is_allocated` is false. */
#define REEL_NEED(is_allocated) REEL_RETURN_IF(!(is_allocated), call->error.code)

/* Count `count` items of `item` bytes as held, without allocating them; fails if they exceed the
   limit. */
int reel_reserve(reel_call *call, uint64_t count, uint64_t item);

/* Allocate `count` items of `item` bytes, aligned to 64 bytes. Returns NULL after recording a
   failure; 0 items are not NULL. */
void *reel_pool_allocate(reel_call *call, reel_pool *pool, uint64_t count, uint64_t item);

/* Allocate scratch memory, which is released at the end of the call or by `reel_drop_scratch`. */
void *reel_scratch(reel_call *call, uint64_t count, uint64_t item);

/* Release the scratch memory allocated after `mark`, an earlier value of call->scratch.last. */
void reel_drop_scratch(reel_call *call, const reel_chunk *mark);

/* Release all memory of a pool. */
void reel_release(const meshreel_host *host, reel_pool *pool);

/* Move the memory of `added` to `pool`, or release it if a step failed; returns `failed`. */
int reel_append(const meshreel_host *host, int failed, reel_pool *pool, reel_pool *added);

/* Run tasks that compute `n_numbers` together: on this thread if few, else on host threads. */
void reel_run(const reel_call *call, void (*task)(void *shared, uint32_t i), void *shared,
              uint32_t n_tasks, uint64_t n_numbers);

/* Number of threads to divide work among. */
REEL_INLINE uint32_t reel_threads(const reel_call *call) {
    return call->host->run && call->host->n_threads > 1 ? call->host->n_threads : 1;
}

#endif
