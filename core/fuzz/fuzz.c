/* Fuzzes the core: random content is encoded and decoded, then its bytes are damaged and decoded
   again; stored streams are changed and decoded. Each run is repeated in other memory, and must
   produce the same results.

   Built for libFuzzer (-fsanitize=fuzzer), or with -DREEL_FUZZ_LOOP as a program: `fuzz [seconds
   [seed [first [count]]]]`, 0 seconds for no limit. -DREEL_FUZZ_STREAMS names the folder
   conformance/, whose streams are read. A failure prints the arguments that reproduce it with these
   streams. The final hash covers all results, and is the same for every compiler and machine. */

#include "fuzz.h"

#if __has_include(<sanitizer/asan_interface.h>)
#include <sanitizer/asan_interface.h>
#else
#define ASAN_POISON_MEMORY_REGION(from, size) ((void)(from), (void)(size))
#define ASAN_UNPOISON_MEMORY_REGION(from, size) ((void)(from), (void)(size))
#endif
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define POOL (1 << 26) /* bytes of all blocks of a run */
#define GAP 64         /* between blocks, which are aligned to it */

static const uint8_t *input;
static size_t input_size;
static uint64_t state, run_hash, total_hash;
static uint8_t pool[POOL] __attribute__((aligned(GAP)));
static size_t used;
static int fill;

static void (*const targets[])(void) = {
    fuzz_integers, fuzz_connectivity, fuzz_hierarchy, fuzz_basis_encode,
    fuzz_exact,    fuzz_polygons,     fuzz_cells,     fuzz_surface_integers,
    fuzz_closest,  fuzz_decimate,     fuzz_streams,   fuzz_streams,
    fuzz_streams,  fuzz_streams,      fuzz_streams,   fuzz_streams};
#define N_TARGETS (sizeof targets / sizeof *targets)

static uint64_t mix(uint64_t number) {
    number = (number ^ number >> 30) * 0xBF58476D1CE4E5B9U;
    number = (number ^ number >> 27) * 0x94D049BB133111EBU;
    return number ^ number >> 31;
}

uint64_t fuzz_next(void) {
    state += 0x9E3779B97F4A7C15U;
    if (input_size == 0) {
        return mix(state);
    }
    uint64_t result = *input++;
    input_size--;
    state ^= result;
    return result | result << 8; /* single bytes give small numbers */
}

int64_t fuzz_below(int64_t n) { return n > 1 ? (int64_t)(fuzz_next() % (uint64_t)n) : 0; }

bool fuzz_one_in(int64_t n) { return fuzz_below(n) == 0; }

int32_t fuzz_integer(void) {
    uint64_t result = fuzz_next();
    int shift = (int)(result >> 8 & 31U);
    shift = fuzz_one_in(8) ? shift : 28 + shift % 4;
    int32_t size = (int32_t)((uint32_t)(result >> 16 ^ result << 23) >> 1) >> shift;
    return result & 1U ? -size : size;
}

double fuzz_float(void) {
    if (fuzz_one_in(64)) {
        static const double special[] = {
            0.0,  -0.0, 1e300,           -1e300,           1e-310,
            1e18, -1e9, __builtin_inf(), -__builtin_inf(), __builtin_nan("")};
        return special[fuzz_below(sizeof special / sizeof *special)];
    }
    return (double)fuzz_integer() / 256.0;
}

void *fuzz_allocate(int64_t count, size_t item) {
    size_t size = (size_t)count * item, block = (size + 2 * GAP - 1) / GAP * GAP;
    if (block > POOL - used) {
        fprintf(stderr, "no memory\n");
        abort();
    }
    void *result = pool + used;
    used += block;
    ASAN_UNPOISON_MEMORY_REGION(result, size);
    memset(result, fill, size);
    return result;
}

void *fuzz_copy(const void *from, int64_t count, size_t item) {
    void *result = fuzz_allocate(count, item);
    if (count) {
        memcpy(result, from, (size_t)count * item);
    }
    return result;
}

int fuzz_fill_byte(void) { return fill; }

fuzz_bytes fuzz_output(const uint8_t *out, int64_t size) {
    FUZZ_CHECK(size >= 0);
    fuzz_hash(out, size, 1);
    return (fuzz_bytes){fuzz_copy(out, size, 1), (size_t)size};
}

fuzz_bytes fuzz_mutate(fuzz_bytes from) {
    int64_t kind = fuzz_below(4), size = (int64_t)from.size;
    int64_t n_copied = kind == 1 ? fuzz_below(size + 1) : size;
    int64_t n_added = kind == 2 ? fuzz_below(40) : 0;
    fuzz_bytes result = {fuzz_allocate(n_copied + n_added, 1), (size_t)(n_copied + n_added)};
    if (n_copied) {
        memcpy(result.bytes, from.bytes, (size_t)n_copied);
    }
    int64_t changes = kind == 3 ? n_copied : 1 + fuzz_below(4);
    for (int64_t i = 0; n_copied && i < changes; i++) {
        int64_t index = kind == 3 ? i : fuzz_below(n_copied);
        result.bytes[index] = (uint8_t)fuzz_next();
    }
    for (int64_t i = 0; i < n_added; i++) {
        result.bytes[n_copied + i] = (uint8_t)fuzz_next();
    }
    return result;
}

void fuzz_check(bool holds, const char *text, const char *file, int line) {
    if (!holds) {
        fprintf(stderr, "%s:%d: check failed: %s\n", file, line, text);
        abort();
    }
}

void fuzz_check_code(int64_t result) {
    if (result < 0) {
        int64_t code = -result & 0xFF;
        FUZZ_CHECK(code == REEL_TRUNCATED || code == REEL_CORRUPT || code == REEL_INVALID);
    }
    fuzz_hash(&result, 1, sizeof result);
}

void fuzz_hash(const void *result, int64_t count, size_t item) {
    const uint8_t *bytes = result;
    for (size_t i = 0; i < (size_t)count * item; i++) {
        run_hash = (run_hash ^ bytes[i]) * 0x100000001B3U;
    }
}

/* NaNs are canonicalized: processors differ in their bits. */
void fuzz_hash_doubles(const double *result, int64_t count) {
    for (int64_t i = 0; i < count; i++) {
        double value = result[i] == result[i] ? result[i] : __builtin_nan("");
        fuzz_hash(&value, 1, sizeof value);
    }
}

/* Return the hash of the results of one run. */
static uint64_t run_once(const uint8_t *data, size_t size, int fill_byte) {
    input = data;
    input_size = size;
    state = size;
    run_hash = 0;
    fill = fill_byte;
    ASAN_POISON_MEMORY_REGION(pool, used ? used : POOL);
    used = 0;
    targets[fuzz_next() % N_TARGETS]();
    return run_hash;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    uint64_t first = run_once(data, size, 0);
    FUZZ_CHECK(run_once(data, size, 0xA5) == first);
    total_hash = mix(total_hash ^ first);
    return 0;
}

#ifdef REEL_FUZZ_LOOP

#include <signal.h>
#include <time.h>
#include <unistd.h>

#define MAX_SECONDS 1.0 /* processor seconds that a run and its repetition may take */

static unsigned long long seed, number;

static void print_reproducer(void) {
    fprintf(stderr, "\nreproduce with: fuzz 0 %llu %llu 1\n", seed, number);
}

static void die(int code) {
    print_reproducer();
    _exit(128 + code);
}

#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define __SANITIZE_ADDRESS__ 1
#endif
#endif
#ifdef __SANITIZE_ADDRESS__
void __sanitizer_set_death_callback(void (*callback)(void));
const char *__asan_default_options(void);

/* The default quarantine of 256 MB never reuses pages, and clearing new ones takes a third of the
   time. */
const char *__asan_default_options(void) { return "quarantine_size_mb=16"; }

#define PRINT_ON_DEATH __sanitizer_set_death_callback(print_reproducer)
#else
#define PRINT_ON_DEATH (void)0
#endif

static double seconds(clockid_t kind) {
    struct timespec now;
    clock_gettime(kind, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Generate the input of a run: eight bytes seed everything; longer inputs add variety. */
static size_t fill_input(uint8_t *input) {
    uint64_t random = mix(seed * 0x9E3779B97F4A7C15U + number);
    size_t size = random & 7U ? 8 : 8 + (random >> 3) % 200;
    for (size_t i = 0; i < size; i++) {
        input[i] = (uint8_t)(mix(random + i / 8) >> (8 * (i % 8)));
    }
    return size;
}

int main(int n, char **arguments) {
    double limit = n > 1 ? atof(arguments[1]) : 10.0, slowest = 0.0;
    seed = n > 2 ? strtoull(arguments[2], NULL, 10) : 1;
    unsigned long long first = n > 3 ? strtoull(arguments[3], NULL, 10) : 0, slowest_run = 0;
    unsigned long long max_runs = n > 4 ? strtoull(arguments[4], NULL, 10) : UINT64_MAX;
    double end = seconds(CLOCK_MONOTONIC) + (limit > 0.0 ? limit : 1e9);
    PRINT_ON_DEATH;
    signal(SIGABRT, die);
    signal(SIGALRM, die);
    for (number = first; number - first < max_runs && seconds(CLOCK_MONOTONIC) < end; number++) {
        uint8_t input[256];
        size_t size = fill_input(input);
        double start = seconds(CLOCK_PROCESS_CPUTIME_ID);
        alarm(60);
        LLVMFuzzerTestOneInput(input, size);
        double elapsed = seconds(CLOCK_PROCESS_CPUTIME_ID) - start;
        if (elapsed > slowest) {
            slowest = elapsed;
            slowest_run = number;
        }
        FUZZ_CHECK(elapsed < MAX_SECONDS);
    }
    printf("%llu runs of %zu targets, seed %llu; the slowest, %llu, took %.3f s\n", number - first,
           N_TARGETS, seed, slowest_run, slowest);
    printf("found %016llx\n", (unsigned long long)total_hash);
    return 0;
}

#endif
