/* Values of frames, such as positions: decoded fields times basis vectors.

   docs/format.md, "Frames". In IEEE double or single, mode after mode, with nothing fused: every
   machine finds the same bits. Vertices are worked on in tiles. The fields of a tile are packed
   once: of each mode those of all its vertices side by side. They stay in the cache while frame
   after frame is written. */

#include "cpu.h"

#define TILE 64      /* vertices */
#define TOGETHER 256 /* frames: all of a tile are written before the next tile */

typedef struct {
    const double *basis;       /* n_columns x n_frames x n_modes */
    const float *single_basis; /* n_columns x n_wanted x n_modes, if sums are in single precision */
    const uint8_t *packed;
    size_t tile_bytes;
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

/* ---- packing ---- */

typedef struct {
    const double *values; /* of mode k at vertex v: [k mode_stride + v vertex_stride], in steps */
    int64_t mode_stride, vertex_stride, n_modes;
    double step;
} field_source;

/* Fields of a tile. Vertex after vertex: its modes are often together in memory. */
#define DEFINE_PACK(name, number)                                                                  \
    static void name(const field_source *fields, const int32_t *vertices, number *tile) {          \
        for (int i = 0; i < TILE; i++) {                                                           \
            const double *from = fields->values + vertices[i] * fields->vertex_stride;             \
            for (int64_t mode = 0; mode < fields->n_modes; mode++, from += fields->mode_stride) {  \
                tile[mode * TILE + i] = (number)(*from * fields->step);                            \
            }                                                                                      \
        }                                                                                          \
    }

DEFINE_PACK(pack_singles, float)
DEFINE_PACK(pack_doubles, double)
#undef DEFINE_PACK

static size_t tile_bytes(int64_t n_modes, int64_t precision) {
    return (size_t)n_modes * TILE * (size_t)precision;
}

size_t reel_packed_bytes(int64_t n_modes, int64_t n_verts, int64_t precision) {
    return (size_t)((n_verts + TILE - 1) / TILE) * tile_bytes(n_modes, precision);
}

int64_t reel_pack(const double *fields, int64_t mode_stride, int64_t vertex_stride, double step,
                  int64_t precision, const int32_t *order, int64_t n_modes, int64_t n_verts,
                  int64_t first, int64_t last, void *packed) {
    bool is_single = precision == REEL_SUMS_4;
    if ((!is_single && precision != REEL_SUMS_8) || first < 0 || first % TILE || last > n_verts) {
        return reel_failure(REEL_INVALID, 0);
    }
    field_source source = {fields, mode_stride, vertex_stride, n_modes, step};
    for (int64_t begin = first; begin < last; begin += TILE) {
        int32_t vertices[TILE];
        for (int64_t i = 0; i < TILE; i++) {
            int64_t place = begin + i < last ? begin + i : begin; /* for vectors that are not full */
            vertices[i] = order ? order[place] : (int32_t)place;
            if (vertices[i] < 0 || vertices[i] >= n_verts) {
                return reel_failure(REEL_INVALID, (uint64_t)place);
            }
        }
        void *tile = (uint8_t *)packed + (size_t)(begin / TILE) * tile_bytes(n_modes, precision);
        if (is_single) {
            pack_singles(&source, vertices, tile);
        } else {
            pack_doubles(&source, vertices, tile);
        }
    }
    return 0;
}

/* ---- frames ---- */

/* Three columns of a tile, or the `left` ones, to every `stride`-th number. */
#define DEFINE_SCATTER(name, number)                                                               \
    REEL_INLINE void name(number (*placed)[TILE], int64_t left, int64_t stride, int count,         \
                          number *restrict out) {                                                  \
        for (int64_t column = 0; column < 3 && column < left; column++) {                          \
            for (int i = 0; i < count; i++) {                                                      \
                out[stride * i + column] = placed[column][i];                                      \
            }                                                                                      \
        }                                                                                          \
    }

DEFINE_SCATTER(scatter_floats, float)
DEFINE_SCATTER(write_doubles, double)
#undef DEFINE_SCATTER

/* Compilers that know how to shuffle vectors; pages need small code. */
#if !defined(REEL_DECODER_ONLY) && (defined(__clang__) || __GNUC__ >= 12)
typedef float floats_4 __attribute__((vector_size(16), may_alias, aligned(4)));

/* Three columns of a whole tile, side by side. */
static void interleave(float (*placed)[TILE], float *out) {
    for (int i = 0; i < TILE; i += 4, out += 12) {
        floats_4 x = *(floats_4 *)&placed[0][i], y = *(floats_4 *)&placed[1][i];
        floats_4 z = *(floats_4 *)&placed[2][i];
        floats_4 low = __builtin_shufflevector(x, y, 0, 4, 1, 5);
        floats_4 middle = __builtin_shufflevector(y, z, 1, 5, 2, 6);
        floats_4 high = __builtin_shufflevector(x, y, 2, 6, 3, 7);
        *(floats_4 *)out = __builtin_shufflevector(low, z, 0, 1, 4, 2);
        *(floats_4 *)(out + 4) = __builtin_shufflevector(middle, high, 0, 1, 4, 5);
        *(floats_4 *)(out + 8) = __builtin_shufflevector(high, z, 6, 2, 3, 7);
    }
}
#define CAN_INTERLEAVE true
#else
#define CAN_INTERLEAVE false
static void interleave(float (*placed)[TILE], float *out) { (void)placed, (void)out; }
#endif

REEL_INLINE void write_floats(float (*placed)[TILE], int64_t left, int64_t stride, int count,
                              float *out) {
    if (CAN_INTERLEAVE && stride == 3 && count == TILE) {
        interleave(placed, out);
    } else {
        scatter_floats(placed, left, stride, count, out);
    }
}

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

static void sum(const frames_job *job, const void *tile, int64_t number, double (*sums)[TILE]) {
#ifdef REEL_HAS_WIDE
    if (job->widest > 2) {
        (job->widest == 8 ? sum_tile_8 : sum_tile_4)(job, tile, number, sums);
        return;
    }
#endif
    sum_tile_2(job, tile, number, sums);
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
static void write_tile(const frames_job *job, int64_t begin, int64_t end, int64_t first,
                       int count, double (*sums)[TILE]) {
    const uint8_t *tile = job->packed + (size_t)(first / TILE) * job->tile_bytes;
    for (int64_t number = begin; number < end; number++) {
        sum(job, tile, number, sums);
        if (job->corrections) {
            correct(job, number, first, sums);
        }
        if (job->layout == REEL_COLUMNS) {
            write_columns(job, number, first, count, sums);
        } else {
            write_values(job, number, first, count, sums);
        }
    }
}

/* Basis vectors of the wanted frames in single precision. */
static const float *rounded_basis(reel_arena *arena, const frames_job *job) {
    int64_t n = job->n_modes;
    float *found = reel_take(arena, (size_t)(job->n_columns * job->n_wanted * n), sizeof *found);
    float *next = found;
    for (int64_t column = 0; column < job->n_columns && !arena->failed; column++) {
        for (int64_t number = 0; number < job->n_wanted; number++) {
            const double *from = job->basis + (column * job->n_frames + job->wanted[number]) * n;
            for (int64_t mode = 0; mode < n; mode++) {
                *next++ = (float)from[mode];
            }
        }
    }
    return found;
}

size_t reel_frames_memory(int64_t n_columns, int64_t n_modes, int64_t n_wanted) {
    return reel_room((size_t)(n_columns * n_wanted * n_modes), sizeof(float)) +
           reel_room((size_t)n_columns * TILE, sizeof(double)) +
           reel_room((size_t)n_wanted, sizeof(int64_t));
}

int64_t reel_frames(void *memory, size_t memory_size, const double *basis, const void *packed,
                    int64_t precision, int64_t n_columns, int64_t n_frames, int64_t n_modes,
                    int64_t n_verts, const int32_t *wanted, int64_t n_wanted,
                    const int64_t *correction_starts, const int32_t *corrected,
                    const double *moves, const double *placement, int64_t layout, void *out) {
    if (precision != REEL_SUMS_4 && precision != REEL_SUMS_8) {
        return reel_failure(REEL_INVALID, 0);
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
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
    frames_job job = {basis, NULL, packed, tile_bytes(n_modes, precision), n_columns, n_frames,
                      n_modes, n_verts, wanted, n_wanted, correction_starts ? corrections : NULL,
                      correction_starts, corrected, moves, placement, layout, out, reel_widest()};
    if (precision == REEL_SUMS_4) {
        job.single_basis = rounded_basis(&arena, &job);
    }
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t begin = 0; begin < n_wanted; begin += TOGETHER) {
        int64_t end = n_wanted - begin < TOGETHER ? n_wanted : begin + TOGETHER;
        for (int64_t first = 0; first < n_verts; first += TILE) {
            int count = n_verts - first < TILE ? (int)(n_verts - first) : TILE;
            write_tile(&job, begin, end, first, count, sums);
        }
    }
    return n_wanted;
}
