/* The state of the exact coder, and what its files share; see exact.c. */

#ifndef REEL_EXACT_STATE_H
#define REEL_EXACT_STATE_H

#include "bits.h"
#include "cpu.h"
#include "exact_numbers.h"
#include "exact_order.h"

#define TEMPORAL 2                     /* inputs of the filter beside the neighbours */
#define INPUTS 12                      /* of the filter, and zeros behind them */
#define N_NEAR 6                       /* neighbours that tell sizes, and means */
#define N_VOTES 4                      /* neighbours whose rows may come again */
#define N_SIZES (16 * 64)              /* sixteenths of an octave of an expected magnitude */
#define N_CLASSES (N_SIZES / 4)
#define N_STEPS 16                     /* away from the expected length */
#define N_INPUTS 7                     /* of the regression of sizes */
#define MOVE_FRAMES 16                 /* whose moves are kept */
#define N_SAMPLES 64                   /* numbers of a frame that frames are compared by */

enum { LABELS = 0, MEANS = 1, FILTER = 2, RAW = 3 }; /* how values are expected */

#define MOVED 1U /* flags of a row: it is not as the row before */
#define ODD 2U   /* a number of it is not finite */

typedef struct {
    reel_model above[N_CLASSES];            /* is the length above the expected one? */
    reel_model longer[N_CLASSES][N_STEPS];
    reel_model shorter[N_CLASSES][N_STEPS];
    reel_model second[N_CLASSES][8];        /* by the length less the expected one */
    reel_model constant[4];                 /* by how many of two neighbours are */
    reel_model moved[N_VOTES + 1][4];       /* by how many neighbours did, and by the own past */
    reel_model candidate[2][N_VOTES + 1][N_VOTES + 1];
    reel_model odd[2][3];
    reel_model odd_again;
    reel_model lag_again;
    int32_t weights[N_INPUTS];
    double temporal[TEMPORAL];              /* weights of the filter that an item begins with */
    uint64_t last_odd;
} exact_models;

/* Of a column of the item: sizes of differences, in sixteenths of octaves, times 16. */
typedef struct {
    int32_t quick, slow, now, last, here;
    int decade; /* of the last number, if it is decimal */
} exact_past;

typedef struct {
    reel_port *port;
    reel_numbers numbers;
    uint8_t *values; /* frames x items x width numbers */
    int64_t n_frames, n_items, width;
    int kind;
    bool has_stills, has_odd, has_lags, are_listed;
    reel_visits visits;
    exact_models *models;
    exact_past *past;   /* of the columns */
    double *known;      /* items in order x frames x width: scaled; or their rows as they are */
    int16_t *sizes;     /* likewise: of the differences */
    uint8_t *flags;     /* items in order x frames */
    uint8_t *constant;  /* items in order */
    int32_t *lags;      /* frames */
    float *samples;     /* frames x N_SAMPLES */
    int32_t others;     /* how much larger differences of this row were */
    /* of the item */
    int64_t item, place;
    int32_t near[REEL_MOST_NEAR];
    int n_near;
    int widest; /* doubles of a vector */
    double weights[INPUTS] __attribute__((aligned(REEL_ALIGNMENT)));
    double gains[INPUTS] __attribute__((aligned(REEL_ALIGNMENT)));
    double doubt[INPUTS * INPUTS] __attribute__((aligned(REEL_ALIGNMENT)));
    double noise, quick_noise; /* variances of errors, of late ones most */
    double *noises;       /* items in order */
    uint64_t *own;        /* frames x width: patterns */
    int32_t *sums;        /* frames x width: of sizes of near items */
    int16_t *most;        /* frames x width: the largest of these */
    double *moves, *again; /* MOVE_FRAMES + 1 frames x width x INPUTS: of near items */
    int64_t first;        /* frame from which on there are moves, behind those of the one before */
    int n_filled;         /* near items that have moves */
} exact_coder;

/* Numbers that `moves` have. */
REEL_INLINE size_t exact_moves_count(int64_t width) {
    return (size_t)width * (MOVE_FRAMES + 1) * INPUTS;
}

/* Readies a coder for values on a graph, in the memory of a caller. */
enum reel_code reel_exact_prepare(exact_coder *f, void *memory, size_t memory_size,
                                  const int32_t *starts, const int32_t *near);

/* All of a block, or its first `count` items: its bytes, or a failure. */
int64_t reel_exact_block(exact_coder *f, int64_t count);

/* The first `count` items in order. */
void reel_exact_items(exact_coder *f, int64_t count);

REEL_INLINE exact_coder coder_of(void *values, int64_t n_frames, int64_t n_items, int64_t width,
                                 int64_t size, int64_t type) {
    return (exact_coder){.values = values,
                         .n_frames = n_frames,
                         .n_items = n_items,
                         .width = width,
                         .widest = reel_widest(),
                         .numbers = {.size = (int)size, .type = (int)type}};
}

REEL_INLINE uint64_t pattern_at(const exact_coder *f, int64_t t, int64_t item, int64_t col) {
    const reel_numbers *numbers = &f->numbers;
    return reel_read_pattern(numbers, f->values, (t * f->n_items + item) * f->width + col);
}

REEL_INLINE void put_pattern(const exact_coder *f, int64_t t, int64_t col, uint64_t pattern) {
    const reel_numbers *numbers = &f->numbers;
    f->own[t * f->width + col] = pattern;
    reel_write_pattern(numbers, f->values, (t * f->n_items + f->item) * f->width + col, pattern);
}

/* Whether the item has the same row at two frames. */
REEL_INLINE bool same_rows(const exact_coder *f, int64_t t, int64_t other) {
    size_t size = (size_t)(f->width * f->numbers.size);
    return reel_same(f->values + (size_t)(t * f->n_items + f->item) * size,
                     f->values + (size_t)(other * f->n_items + f->item) * size, size);
}

/* Whether the item has the same row at all frames. */
REEL_INLINE bool is_constant(const exact_coder *f) {
    int64_t t = 1;
    while (t < f->n_frames && same_rows(f, t, t - 1)) {
        t++;
    }
    return t == f->n_frames;
}

#endif
