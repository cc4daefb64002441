/* Values of frames, such as positions: the product of decoded fields and basis vectors.

   docs/format.md, "Frames". Sums over the modes are IEEE double or single, in order, with nothing
   fused, so that every machine computes the same bits. Vertices are processed in tiles: the fields
   of a tile are packed once, mode by mode, and stay in the cache while many frames are written. */

#include "cpu.h"

#define TILE 64             /* vertices */
#define FRAMES_PER_PASS 256 /* frames per pass over the tiles */

typedef struct {
    const double *basis;       /* n_columns x n_frames x n_modes */
    const float *single_basis; /* n_columns x n_requested x n_modes, for single precision */
    const uint8_t *packed;
    size_t tile_bytes;
    int64_t n_columns, n_frames, n_modes, n_verts;
    const int32_t *frames; /* n_requested frames */
    int64_t n_requested;
    int64_t *corrections; /* for each requested frame the next correction, or NULL */
    const int64_t *correction_starts;
    const int32_t *correction_vertices;
    const double *offsets;
    const double *placement; /* scale, and the origin of each column */
    int64_t layout;
    void *out;
    int vector_width;
} frames_job;

/* ---- packing ---- */

typedef struct {
    const double *values; /* in steps, of mode k at vertex v: [k mode_stride + v vertex_stride] */
    int64_t mode_stride, vertex_stride, n_modes;
    double step;
} field_source;

/* Pack the fields of a tile. The outer loop is over vertices because the modes of a vertex are
   often contiguous. */
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
                  void *packed, int64_t first, int64_t last) {
    bool is_single = precision == REEL_SUMS_4;
    if ((!is_single && precision != REEL_SUMS_8) || first < 0 || first % TILE || last > n_verts) {
        return reel_failure(REEL_INVALID, 0);
    }
    field_source source = {fields, mode_stride, vertex_stride, n_modes, step};
    for (int64_t begin = first; begin < last; begin += TILE) {
        int32_t vertices[TILE];
        for (int64_t i = 0; i < TILE; i++) {
            int64_t index = begin + i < last ? begin + i : begin; /* pads the last vectors */
            vertices[i] = order ? order[index] : (int32_t)index;
            if (vertices[i] < 0 || vertices[i] >= n_verts) {
                return reel_failure(REEL_INVALID, (uint64_t)index);
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

/* Store three columns of a tile, or the `left` remaining ones, with the given stride. */
#define DEFINE_SCATTER(name, number)                                                               \
    REEL_INLINE void name(number(*values)[TILE], int64_t left, int64_t stride, int count,          \
                          number *restrict out) {                                                  \
        for (int64_t column = 0; column < 3 && column < left; column++) {                          \
            for (int i = 0; i < count; i++) {                                                      \
                out[stride * i + column] = values[column][i];                                      \
            }                                                                                      \
        }                                                                                          \
    }

DEFINE_SCATTER(write_floats, float)
DEFINE_SCATTER(write_doubles, double)
#undef DEFINE_SCATTER

#define LANES 2
#include "frames_lanes.h"

#ifdef REEL_HAS_WIDE
#define LANES 4
#include "frames_lanes.h"

#define LANES 8
#include "frames_lanes.h"
#endif

/* Add the corrections of a requested frame within a tile; corrections ascend by vertex. */
static void add_corrections(const frames_job *job, int64_t request, int64_t first,
                            double (*sums)[TILE]) {
    int64_t next = job->corrections[request], end = job->correction_starts[request + 1];
    for (; next < end && job->correction_vertices[next] < first + TILE; next++) {
        int64_t lane = job->correction_vertices[next] - first;
        for (int64_t column = 0; column < job->n_columns && lane >= 0; column++) {
            sums[column][lane] += job->offsets[job->n_columns * next + column];
        }
    }
    job->corrections[request] = next;
}

/* Write values in model units, columns interleaved; returns whether all are finite. */
static bool write_values(const frames_job *job, int64_t request, int64_t first, int count,
                         double (*sums)[TILE]) {
    int64_t start = job->n_columns * (request * job->n_verts + first);
    return REEL_WIDEST(job->vector_width, place_tile, job, sums, start, count);
}

/* Write sums without scale and origin, each column separately. */
static void write_columns(const frames_job *job, int64_t request, int64_t first, int count,
                          double (*sums)[TILE]) {
    double *out = (double *)job->out + request * job->n_verts + first;
    for (int64_t column = 0; column < job->n_columns; column++) {
        reel_copy(out, sums[column], (size_t)count * sizeof *out);
        out += job->n_requested * job->n_verts;
    }
}

/* Write requested frames begin .. end - 1 of the vertices first .. first + count - 1. Returns
   whether all values in model units are finite. */
static bool write_tile(const frames_job *job, int64_t begin, int64_t end, int64_t first,
                       int count, double (*sums)[TILE]) {
    bool is_finite = true;
    const uint8_t *tile = job->packed + (size_t)(first / TILE) * job->tile_bytes;
    for (int64_t request = begin; request < end; request++) {
        REEL_WIDEST(job->vector_width, sum_tile, job, tile, request, sums);
        if (job->corrections) {
            add_corrections(job, request, first, sums);
        }
        if (job->layout == REEL_COLUMNS) {
            write_columns(job, request, first, count, sums);
        } else {
            is_finite &= write_values(job, request, first, count, sums);
        }
    }
    return is_finite;
}

/* Basis vectors of the requested frames, rounded to single precision. */
static const float *rounded_basis(reel_arena *arena, const frames_job *job) {
    int64_t n = job->n_modes;
    float *singles =
        reel_allocate(arena, (size_t)(job->n_columns * job->n_requested * n), sizeof *singles);
    float *next = singles;
    for (int64_t column = 0; column < job->n_columns && !arena->failed; column++) {
        for (int64_t request = 0; request < job->n_requested; request++) {
            const double *from = job->basis + (column * job->n_frames + job->frames[request]) * n;
            for (int64_t mode = 0; mode < n; mode++) {
                *next++ = (float)from[mode];
            }
        }
    }
    return singles;
}

size_t reel_frames_memory(int64_t n_columns, int64_t n_modes, int64_t n_requested) {
    return reel_array_bytes((size_t)(n_columns * n_requested * n_modes), sizeof(float)) +
           reel_array_bytes((size_t)n_columns * TILE, sizeof(double)) +
           reel_array_bytes((size_t)n_requested, sizeof(int64_t));
}

int64_t reel_frames(void *memory, size_t memory_size, const double *basis, const void *packed,
                    int64_t precision, int64_t n_columns, int64_t n_frames, int64_t n_modes,
                    int64_t n_verts, const int32_t *frames, int64_t n_requested,
                    const int64_t *correction_starts, const int32_t *correction_vertices,
                    const double *offsets, const double *placement, int64_t layout, void *out) {
    if (precision != REEL_SUMS_4 && precision != REEL_SUMS_8) {
        return reel_failure(REEL_INVALID, 0);
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
    double(*sums)[TILE] = reel_allocate(&arena, (size_t)n_columns, sizeof *sums);
    int64_t *corrections = reel_allocate(&arena, (size_t)n_requested, sizeof *corrections);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t request = 0; request < n_requested; request++) {
        if (frames[request] < 0 || frames[request] >= n_frames) {
            return reel_failure(REEL_INVALID, (uint64_t)request);
        }
        corrections[request] = correction_starts ? correction_starts[request] : 0;
    }
    frames_job job = {basis,
                      NULL,
                      packed,
                      tile_bytes(n_modes, precision),
                      n_columns,
                      n_frames,
                      n_modes,
                      n_verts,
                      frames,
                      n_requested,
                      correction_starts ? corrections : NULL,
                      correction_starts,
                      correction_vertices,
                      offsets,
                      placement,
                      layout,
                      out,
                      reel_vector_width()};
    if (precision == REEL_SUMS_4) {
        job.single_basis = rounded_basis(&arena, &job);
    }
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    bool is_finite = true;
    for (int64_t begin = 0; begin < n_requested; begin += FRAMES_PER_PASS) {
        int64_t end = n_requested - begin < FRAMES_PER_PASS ? n_requested : begin + FRAMES_PER_PASS;
        for (int64_t first = 0; first < n_verts; first += TILE) {
            int count = n_verts - first < TILE ? (int)(n_verts - first) : TILE;
            is_finite &= write_tile(&job, begin, end, first, count, sums);
        }
    }
    return is_finite;
}
