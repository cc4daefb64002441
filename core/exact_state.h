/* The state of the exact coder, shared by its files; see exact.c. */

#ifndef REEL_EXACT_STATE_H
#define REEL_EXACT_STATE_H

#include "bits.h"
#include "cpu.h"
#include "exact_numbers.h"
#include "exact_order.h"

#define TEMPORAL 2        /* inputs of the filter that are not motions of neighbors */
#define INPUTS 12         /* inputs of the filter, padded with zeros */
#define N_NEAR 6          /* neighbors used to predict sizes and means */
#define N_VOTES 4         /* neighbors whose rows may be repeated */
#define N_SIZES (16 * 64) /* predicted sizes: 16 per octave */
#define N_CLASSES (N_SIZES / 4)
#define N_STEPS 16       /* unary steps of a length that have their own model */
#define N_INPUTS 7       /* inputs of the regression of sizes */
#define MOTION_FRAMES 16 /* frames whose motions are stored at once */
#define N_SAMPLES 64     /* numbers per frame in the search for similar frames */

enum { LABELS = 0, MEANS = 1, FILTER = 2, RAW = 3 }; /* how values are predicted */

#define MOVED 1U   /* row flag: differs from the previous row */
#define SPECIAL 2U /* row flag: has a number that is not finite */

typedef struct {
    reel_model above[N_CLASSES]; /* whether the length exceeds the predicted one */
    reel_model longer[N_CLASSES][N_STEPS];
    reel_model shorter[N_CLASSES][N_STEPS];
    reel_model second[N_CLASSES][8];  /* second bit, by the length minus the predicted one */
    reel_model constant[4];           /* by the number of constant neighbors, of two */
    reel_model moved[N_VOTES + 1][4]; /* by the number of moved neighbors, and the last two rows */
    /* by whether there is an earlier frame, the index of the candidate, and its votes */
    reel_model candidate[2][N_VOTES + 1][N_VOTES + 1];
    /* by whether the previous row has special numbers, and how many of two neighbors have one */
    reel_model special[2][3];
    reel_model special_repeats;
    reel_model lag_repeats;
    int32_t weights[N_INPUTS]; /* of the regression of sizes, Q16 */
    double temporal[TEMPORAL]; /* initial temporal weights of the filter */
    uint64_t last_special;
} exact_models;

/* Size statistics of a column of the item; see exact_sizes.h. */
typedef struct {
    int32_t fast, slow; /* running means of the sizes over about 4 and 16 rows, in sixteenths */
    int32_t last;       /* size in the last row; for labels a running mean over about 4 rows */
    int32_t recent;     /* size relative to which the next one is predicted */
    int decade;         /* decade of the last number, for decimal floats */
} column_state;

/* Choices of the encoder for a block, stored in its header. */
typedef struct {
    int kind;         /* how values are predicted: LABELS, MEANS, FILTER or RAW */
    bool has_repeats; /* rows may repeat the previous frame */
    bool has_special; /* numbers may be infinite or NaN */
    bool has_lags;    /* frames may resemble earlier ones; see `lags` */
    bool in_given_order;
} exact_choices;

/* Results of coded items, in coding order, from which later ones are predicted. */
typedef struct {
    double *values;       /* items x frames x width: scaled values for prediction */
    int16_t *sizes;       /* items x frames x width: sizes of the differences */
    uint8_t *flags;       /* items x frames: row flags */
    uint8_t *is_constant; /* items: whether all rows are equal */
    double *noises;       /* items: final `noise` of the filter */
} coded_items;

/* The item that is being coded. */
typedef struct {
    int64_t index, position;     /* its number, and its place in coding order */
    int32_t near[REEL_MAX_NEAR]; /* positions of the earlier items that predict it */
    int n_near;
    uint64_t *patterns;      /* frames x width: bit patterns */
    int32_t *near_size_sums; /* frames x width: sums of the sizes of neighbors */
    int16_t *max_near_sizes; /* frames x width: maxima of the sizes of neighbors */
    int32_t excess; /* how much larger sizes of this row were than the average of their column */
} current_item;

/* The filter that predicts the motion of the current item. */
typedef struct {
    double weights[INPUTS] __attribute__((aligned(REEL_ALIGNMENT)));
    double gains[INPUTS] __attribute__((aligned(REEL_ALIGNMENT)));
    double covariance[INPUTS * INPUTS] __attribute__((aligned(REEL_ALIGNMENT)));
    double noise, fast_noise; /* slow and fast moving averages of squared errors */
    /* Motions of neighbors since the previous and since the lagged frame: MOTION_FRAMES + 1 frames
       x width x INPUTS. All frames of an item would not fit into the fastest cache. */
    double *motions, *lagged_motions;
    int64_t first_frame; /* first frame of `motions`, which also hold the frame before */
    int n_filled;        /* neighbors that have motions; the columns of others are 0 */
} motion_filter;

typedef struct {
    reel_range_coder *range_coder;
    uint8_t *values; /* frames x items x width numbers */
    int64_t n_frames, n_items, width;
    reel_numbers numbers;
    exact_choices choices;
    reel_traversal traversal;
    exact_models *models;
    column_state *columns;
    coded_items past;
    current_item item;
    int32_t *lags;    /* frames: distance to a frame with similar motion before it; 0: none */
    float *samples;   /* frames x N_SAMPLES: changes of sampled numbers, to find such frames */
    int vector_width; /* doubles per vector */
    motion_filter filter;
} exact_coder;

/* Length of `motions`. */
REEL_INLINE size_t exact_motions_count(int64_t width) {
    return (size_t)width * (MOTION_FRAMES + 1) * INPUTS;
}

/* Set up a coder for values on a graph, in the caller's memory. */
enum reel_code reel_exact_prepare(exact_coder *coder, void *memory, size_t memory_size,
                                  const int32_t *starts, const int32_t *near);

/* Code a block, or its first `count` items; returns its size in bytes, or a failure. */
int64_t reel_exact_block(exact_coder *coder, int64_t count);

/* Code the first `count` items in coding order. */
void reel_exact_items(exact_coder *coder, int64_t count);

REEL_INLINE exact_coder coder_of(void *values, int64_t n_frames, int64_t n_items, int64_t width,
                                 int64_t size, int64_t type) {
    return (exact_coder){.values = values,
                         .n_frames = n_frames,
                         .n_items = n_items,
                         .width = width,
                         .vector_width = reel_vector_width(),
                         .numbers = {.size = (int)size, .type = (int)type}};
}

REEL_INLINE uint64_t pattern_at(const exact_coder *coder, int64_t t, int64_t item, int64_t col) {
    const reel_numbers *numbers = &coder->numbers;
    return reel_read_pattern(numbers, coder->values,
                             (t * coder->n_items + item) * coder->width + col);
}

REEL_INLINE void put_pattern(const exact_coder *coder, int64_t t, int64_t col, uint64_t pattern) {
    const reel_numbers *numbers = &coder->numbers;
    coder->item.patterns[t * coder->width + col] = pattern;
    reel_write_pattern(numbers, coder->values,
                       (t * coder->n_items + coder->item.index) * coder->width + col, pattern);
}

/* Return the row flags of an item at each frame. */
REEL_INLINE uint8_t *flags_of(const exact_coder *coder, int64_t position) {
    return coder->past.flags + position * coder->n_frames;
}

/* Whether the item has equal rows at two frames. */
REEL_INLINE bool same_rows(const exact_coder *coder, int64_t t, int64_t other) {
    size_t size = (size_t)(coder->width * coder->numbers.size);
    return reel_equal_bytes(
        coder->values + (size_t)(t * coder->n_items + coder->item.index) * size,
        coder->values + (size_t)(other * coder->n_items + coder->item.index) * size, size);
}

/* Whether the item has equal rows at all frames. */
REEL_INLINE bool is_constant(const exact_coder *coder) {
    int64_t t = 1;
    while (t < coder->n_frames && same_rows(coder, t, t - 1)) {
        t++;
    }
    return t == coder->n_frames;
}

#endif
