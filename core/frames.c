/* Values of frames, such as positions: decoded fields times basis vectors.

   docs/format.md, "Frames". In IEEE double or single, mode after mode, with nothing fused: every
   machine finds the same bits. Vertices are worked on in tiles, whose fields stay in the cache while
   frame after frame is written. */

#include "cpu.h"

#define TILE 64     /* vertices */
#define MODES 8     /* of which the fields of a vertex are read at once */
#define TOGETHER 256 /* frames: all of a tile are written before the next tile */

typedef struct {
    const double *basis;       /* n_columns x n_frames x n_modes */
    const float *single_basis; /* the same, if sums are in single precision, or NULL */
    const double *fields; /* of mode k at vertex v: [k mode_stride + v vertex_stride], in steps */
    int64_t mode_stride, vertex_stride;
    double step;
    const int32_t *order; /* the field's vertex of each vertex that is written, or NULL */
    int64_t n_columns, n_frames, n_modes, n_verts;
    const int32_t *wanted; /* n_wanted frames */
    int64_t n_wanted;
    int64_t *corrections; /* for each wanted frame the next correction, or NULL */
    const int64_t *correction_starts;
    const int32_t *corrected;
    const double *moves;
    const double *placement; /* scale, and the origin of each column */
    int64_t layout;
    void *out;
    int widest;
} frames_job;

#define LANES 2
#define TARGET
#define NAMED(name) name##_2
#include "frames_lanes.h"
#undef LANES
#undef TARGET
#undef NAMED

#ifdef REEL_HAS_WIDE
#define LANES 4
#define TARGET REEL_TARGET_4
#define NAMED(name) name##_4
#include "frames_lanes.h"
#undef LANES
#undef TARGET
#undef NAMED

#define LANES 8
#define TARGET REEL_TARGET_8
#define NAMED(name) name##_8
#include "frames_lanes.h"
#undef LANES
#undef TARGET
#undef NAMED
#endif

static void pack(const frames_job *job, const int32_t *vertices, int count, void *tile) {
#ifdef REEL_HAS_WIDE
    if (job->widest > 2) {
        (job->widest == 8 ? pack_tile_8 : pack_tile_4)(job, vertices, count, tile);
        return;
    }
#endif
    pack_tile_2(job, vertices, count, tile);
}

static void sum(const frames_job *job, const void *tile, int64_t frame, double (*sums)[TILE]) {
#ifdef REEL_HAS_WIDE
    if (job->widest > 2) {
        (job->widest == 8 ? sum_tile_8 : sum_tile_4)(job, tile, frame, sums);
        return;
    }
#endif
    sum_tile_2(job, tile, frame, sums);
}

/* Adds what corrections of a wanted frame there are in a tile; they come by ascending vertices. */
static void correct(const frames_job *job, int64_t number, int64_t first, double (*sums)[TILE]) {
    int64_t next = job->corrections[number], end = job->correction_starts[number + 1];
    for (; next < end && job->corrected[next] < first + TILE; next++) {
        int64_t place = job->corrected[next] - first;
        for (int64_t column = 0; column < job->n_columns && place >= 0; column++) {
            sums[column][place] += job->moves[job->n_columns * next + column];
        }
    }
    job->corrections[number] = next;
}

/* Writes values in model units, all columns of a vertex together. */
static void write_values(const frames_job *job, int64_t number, int64_t first, int count,
                         double (*sums)[TILE]) {
    int64_t start = job->n_columns * (number * job->n_verts + first);
#ifdef REEL_HAS_WIDE
    if (job->widest > 2) {
        (job->widest == 8 ? place_tile_8 : place_tile_4)(job, sums, start, count);
        return;
    }
#endif
    place_tile_2(job, sums, start, count);
}

/* Writes sums as they are, each column by itself. */
static void write_columns(const frames_job *job, int64_t number, int64_t first, int count,
                          double (*sums)[TILE]) {
    double *out = (double *)job->out + number * job->n_verts + first;
    for (int64_t column = 0; column < job->n_columns; column++) {
        reel_copy(out, sums[column], (size_t)count * sizeof *out);
        out += job->n_wanted * job->n_verts;
    }
}

/* The wanted frames begin .. end - 1 of the vertices first .. first + count - 1. */
static int64_t write_tile(const frames_job *job, int64_t begin, int64_t end, int64_t first,
                          int count, void *tile, double (*sums)[TILE]) {
    int32_t vertices[TILE];
    for (int i = 0; i < count; i++) {
        vertices[i] = job->order ? job->order[first + i] : (int32_t)(first + i);
        if (vertices[i] < 0 || vertices[i] >= job->n_verts) {
            return reel_failure(REEL_INVALID, (uint64_t)(first + i));
        }
    }
    pack(job, vertices, count, tile);
    for (int64_t number = begin; number < end; number++) {
        sum(job, tile, job->wanted[number], sums);
        if (job->corrections) {
            correct(job, number, first, sums);
        }
        if (job->layout == REEL_COLUMNS) {
            write_columns(job, number, first, count, sums);
        } else {
            write_values(job, number, first, count, sums);
        }
    }
    return 0;
}

/* All tiles of some frames after another. */
static int64_t write_frames(const frames_job *job, void *tile, double (*sums)[TILE]) {
    for (int64_t begin = 0; begin < job->n_wanted; begin += TOGETHER) {
        int64_t end = job->n_wanted - begin < TOGETHER ? job->n_wanted : begin + TOGETHER;
        for (int64_t first = 0; first < job->n_verts; first += TILE) {
            int count = job->n_verts - first < TILE ? (int)(job->n_verts - first) : TILE;
            int64_t failed = write_tile(job, begin, end, first, count, tile, sums);
            if (failed) {
                return failed;
            }
        }
    }
    return job->n_wanted;
}

/* Basis vectors in single precision. */
static const float *rounded_basis(reel_arena *arena, const double *basis, size_t n) {
    float *found = reel_take(arena, n, sizeof *found);
    for (size_t i = 0; i < n && !arena->failed; i++) {
        found[i] = (float)basis[i];
    }
    return found;
}

size_t reel_frames_memory(int64_t n_columns, int64_t n_frames, int64_t n_modes, int64_t n_wanted) {
    return reel_room((size_t)(n_columns * n_frames * n_modes), sizeof(float)) +
           reel_room((size_t)n_modes * TILE, sizeof(double)) +
           reel_room((size_t)n_columns * TILE, sizeof(double)) +
           reel_room((size_t)n_wanted, sizeof(int64_t));
}

int64_t reel_frames(void *memory, size_t memory_size, const double *basis, const double *fields,
                    int64_t mode_stride, int64_t vertex_stride, double step, int64_t precision,
                    const int32_t *order, int64_t n_columns, int64_t n_frames, int64_t n_modes, int64_t n_verts,
                    const int32_t *wanted, int64_t n_wanted, const int64_t *correction_starts,
                    const int32_t *corrected, const double *moves, const double *placement,
                    int64_t layout, void *out) {
    if (precision != REEL_SUMS_4 && precision != REEL_SUMS_8) {
        return reel_failure(REEL_INVALID, 0);
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
    const float *single_basis = NULL;
    if (precision == REEL_SUMS_4) {
        single_basis = rounded_basis(&arena, basis, (size_t)(n_columns * n_frames * n_modes));
    }
    void *tile = reel_take(&arena, (size_t)n_modes * TILE, sizeof(double));
    double(*sums)[TILE] = reel_take(&arena, (size_t)n_columns, sizeof *sums);
    int64_t *corrections = reel_take(&arena, (size_t)n_wanted, sizeof *corrections);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t number = 0; number < n_wanted; number++) {
        if (wanted[number] < 0 || wanted[number] >= n_frames) {
            return reel_failure(REEL_INVALID, (uint64_t)number);
        }
        corrections[number] = correction_starts ? correction_starts[number] : 0;
    }
    frames_job job = {basis, single_basis, fields, mode_stride, vertex_stride, step, order,
                      n_columns, n_frames, n_modes, n_verts, wanted, n_wanted,
                      correction_starts ? corrections : NULL, correction_starts, corrected, moves,
                      placement, layout, out, reel_widest()};
    return write_frames(&job, tile, sums);
}
