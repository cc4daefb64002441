/* Runs the core on hostile input: random content is encoded and decoded, its bytes are damaged and
   decoded again. A run is repeated in other memory, and has to find the same.

   Built for libFuzzer (-fsanitize=fuzzer), or with -DREEL_FUZZ_LOOP as a program of its own:
   `fuzz [seconds [seed [first [count]]]]`, 0 seconds for no end. A failure names what runs it
   again. A number stands for all that the runs have found: it is the same whatever compiler made
   the core and wherever it runs. */

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
#define GAP 64         /* between blocks; they begin at multiples of it */

static const uint8_t *given;
static size_t n_given;
static uint64_t state, noted, all_noted;
static uint8_t pool[POOL] __attribute__((aligned(GAP)));
static size_t used;
static int fill;

static void (*const targets[])(void) = {
    fuzz_integers, fuzz_fields, fuzz_connectivity, fuzz_order,
    fuzz_patterns, fuzz_hierarchy, fuzz_frames, fuzz_basis_encode, fuzz_coordinates,
    fuzz_exact, fuzz_streams,
};
#define N_TARGETS (sizeof targets / sizeof *targets)

static uint64_t scattered(uint64_t number) {
    number = (number ^ number >> 30) * 0xBF58476D1CE4E5B9U;
    number = (number ^ number >> 27) * 0x94D049BB133111EBU;
    return number ^ number >> 31;
}

uint64_t fuzz_next(void) {
    state += 0x9E3779B97F4A7C15U;
    if (n_given == 0) {
        return scattered(state);
    }
    uint64_t found = *given++;
    n_given--;
    state ^= found;
    return found | found << 8; /* small numbers follow single bytes */
}

int64_t fuzz_below(int64_t n) { return n > 1 ? (int64_t)(fuzz_next() % (uint64_t)n) : 0; }

bool fuzz_once_in(int64_t n) { return fuzz_below(n) == 0; }

int32_t fuzz_integer(void) {
    uint64_t found = fuzz_next();
    int shift = (int)(found >> 8 & 31U);
    shift = fuzz_once_in(8) ? shift : 28 + shift % 4;
    int32_t size = (int32_t)((uint32_t)(found >> 16 ^ found << 23) >> 1) >> shift;
    return found & 1U ? -size : size;
}

double fuzz_float(void) {
    if (fuzz_once_in(64)) {
        static const double odd[] = {0.0,   -0.0,  1e300,        -1e300,        1e-310,
                                     1e18,  -1e9,  __builtin_inf(), -__builtin_inf(),
                                     __builtin_nan("")};
        return odd[fuzz_below(sizeof odd / sizeof *odd)];
    }
    return (double)fuzz_integer() / 256.0;
}

void *fuzz_take(int64_t count, size_t item) {
    size_t size = (size_t)count * item, whole = (size + 2 * GAP - 1) / GAP * GAP;
    if (whole > POOL - used) {
        fprintf(stderr, "no memory\n");
        abort();
    }
    void *found = pool + used;
    used += whole;
    ASAN_UNPOISON_MEMORY_REGION(found, size);
    memset(found, fill, size);
    return found;
}

void *fuzz_copy(const void *from, int64_t count, size_t item) {
    void *found = fuzz_take(count, item);
    if (count) {
        memcpy(found, from, (size_t)count * item);
    }
    return found;
}

int fuzz_filling(void) { return fill; }

fuzz_bytes fuzz_written(const uint8_t *out, int64_t size) {
    FUZZ_CLAIM(size >= 0);
    fuzz_note(out, size, 1);
    return (fuzz_bytes){fuzz_copy(out, size, 1), (size_t)size};
}

fuzz_bytes fuzz_mutated(fuzz_bytes from) {
    int64_t kind = fuzz_below(4), size = (int64_t)from.size;
    int64_t kept = kind == 1 ? fuzz_below(size + 1) : size;
    int64_t more = kind == 2 ? fuzz_below(40) : 0;
    fuzz_bytes found = {fuzz_take(kept + more, 1), (size_t)(kept + more)};
    if (kept) {
        memcpy(found.bytes, from.bytes, (size_t)kept);
    }
    int64_t changes = kind == 3 ? kept : 1 + fuzz_below(4);
    for (int64_t i = 0; kept && i < changes; i++) {
        int64_t place = kind == 3 ? i : fuzz_below(kept);
        found.bytes[place] = (uint8_t)fuzz_next();
    }
    for (int64_t i = 0; i < more; i++) {
        found.bytes[kept + i] = (uint8_t)fuzz_next();
    }
    return found;
}

void fuzz_claim(bool holds, const char *claim, const char *file, int line) {
    if (!holds) {
        fprintf(stderr, "%s:%d: it does not hold that %s\n", file, line, claim);
        abort();
    }
}

void fuzz_claim_code(int64_t result) {
    if (result < 0) {
        int64_t code = -result & 0xFF;
        FUZZ_CLAIM(code == REEL_TRUNCATED || code == REEL_CORRUPT || code == REEL_INVALID);
    }
    fuzz_note(&result, 1, sizeof result);
}

void fuzz_note(const void *found, int64_t count, size_t item) {
    const uint8_t *bytes = found;
    for (size_t i = 0; i < (size_t)count * item; i++) {
        noted = (noted ^ bytes[i]) * 0x100000001B3U;
    }
}

/* Processors differ in the bits of what is no number. */
void fuzz_note_doubles(const double *found, int64_t count) {
    for (int64_t i = 0; i < count; i++) {
        double one = found[i] == found[i] ? found[i] : __builtin_nan("");
        fuzz_note(&one, 1, sizeof one);
    }
}

/* What a run finds, as one number. */
static uint64_t run_once(const uint8_t *data, size_t size, int filled) {
    given = data;
    n_given = size;
    state = size;
    noted = 0;
    fill = filled;
    ASAN_POISON_MEMORY_REGION(pool, used ? used : POOL);
    used = 0;
    targets[fuzz_next() % N_TARGETS]();
    return noted;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    uint64_t first = run_once(data, size, 0);
    FUZZ_CLAIM(run_once(data, size, 0xA5) == first);
    all_noted = scattered(all_noted ^ first);
    return 0;
}

#ifdef REEL_FUZZ_LOOP

#include <signal.h>
#include <time.h>
#include <unistd.h>

#define MAX_SECONDS 1.0 /* that a run and its repetition may take, of the processor */

static unsigned long long seed, number;

static void tell(void) {
    fprintf(stderr, "\nrun it again: fuzz 0 %llu %llu 1\n", seed, number);
}

static void die(int code) {
    tell();
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

/* The default quarantine of 256 MB never reuses pages, and clearing new ones takes a third of the time. */
const char *__asan_default_options(void) { return "quarantine_size_mb=16"; }

#define TELL_OF_DEATH __sanitizer_set_death_callback(tell)
#else
#define TELL_OF_DEATH (void)0
#endif

static double seconds(clockid_t kind) {
    struct timespec now;
    clock_gettime(kind, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* The input of a run: eight bytes that name it, and all else follows; or more, for variety. */
static size_t fill_input(uint8_t *input) {
    uint64_t random = scattered(seed * 0x9E3779B97F4A7C15U + number);
    size_t size = random & 7U ? 8 : 8 + (random >> 3) % 200;
    for (size_t i = 0; i < size; i++) {
        input[i] = (uint8_t)(scattered(random + i / 8) >> (8 * (i % 8)));
    }
    return size;
}

int main(int n, char **words) {
    double limit = n > 1 ? atof(words[1]) : 10.0, slowest = 0.0;
    seed = n > 2 ? strtoull(words[2], NULL, 10) : 1;
    unsigned long long first = n > 3 ? strtoull(words[3], NULL, 10) : 0, slowest_run = 0;
    unsigned long long most = n > 4 ? strtoull(words[4], NULL, 10) : UINT64_MAX;
    double end = seconds(CLOCK_MONOTONIC) + (limit > 0.0 ? limit : 1e9);
    TELL_OF_DEATH;
    signal(SIGABRT, die);
    signal(SIGALRM, die);
    for (number = first; number - first < most && seconds(CLOCK_MONOTONIC) < end; number++) {
        uint8_t input[256];
        size_t size = fill_input(input);
        double before = seconds(CLOCK_PROCESS_CPUTIME_ID);
        alarm(60);
        LLVMFuzzerTestOneInput(input, size);
        double took = seconds(CLOCK_PROCESS_CPUTIME_ID) - before;
        if (took > slowest) {
            slowest = took;
            slowest_run = number;
        }
        FUZZ_CLAIM(took < MAX_SECONDS);
    }
    printf("%llu runs of %zu targets, seed %llu; the slowest, %llu, took %.3f s\n", number - first,
           N_TARGETS, seed, slowest_run, slowest);
    printf("found %016llx\n", (unsigned long long)all_noted);
    return 0;
}

#endif
