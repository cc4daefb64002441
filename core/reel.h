/* The core of meshreel: what a .reel stream means. docs/format.md says it in words. It is called by
   the package for Python and that for pages, which are of one version with it; programs that
   decode files in C or C++ have include/meshreel.h, which stays as it is.

   Every function is pure: it reads and writes only the arrays that it is given, keeps nothing, and
   may run on several threads at once. Nothing is allocated: whoever calls gives `memory` of at
   least the size that the function `..._memory` of the same name states, aligned to 64 bytes.

   A function returns a number of at least 0 (bytes written, or as it says), or a failure:
   -(code + 256 place), with a code of `reel_code` and the byte or item at which it was seen. */

#ifndef REEL_H
#define REEL_H

#include <stddef.h>
#include <stdint.h>

#if defined(REEL_PRIVATE) /* in a library that offers meshreel.h alone */
#define REEL_API
#elif defined(_WIN32)
#define REEL_API __declspec(dllexport)
#else
#define REEL_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define REEL_ABI 11 /* changes with every change of a function below */

enum reel_code {
    REEL_OK = 0,
    REEL_NO_MEMORY = 1, /* the caller gave less memory, or less room for the result, than stated */
    REEL_TRUNCATED = 2, /* the bytes end too early */
    REEL_CORRUPT = 3,   /* the bytes are not those of what they should be */
    REEL_INVALID = 4    /* what is to be coded breaks a limit of the format */
};

/* REEL_ABI of the library that was loaded. */
REEL_API int64_t reel_abi(void);

/* Rows of integers of -(2^31-1)..2^31-1: row i is lengths[i] long and uses table tables[i], of
   0..n_tables-1. `values` holds all rows, one after another. At most 16 bytes for each integer
   and 16 more are written. */
REEL_API size_t reel_integers_memory(int64_t n_tables);
REEL_API int64_t reel_integers_encode(void *memory, size_t memory_size, int32_t *values,
                                      const int64_t *lengths, const int32_t *tables,
                                      int64_t n_rows, int64_t n_tables, uint8_t *out, size_t room);
REEL_API int64_t reel_integers_decode(void *memory, size_t memory_size, const uint8_t *in,
                                      size_t size, const int64_t *lengths, const int32_t *tables,
                                      int64_t n_rows, int64_t n_tables, int32_t *values);

/* What follows from connectivity.

   The vertices next to each vertex of a mesh: those of v are near[starts[v]] .. near[starts[v + 1]
   - 1], ascending, each once. `faces` has 3 n_faces numbers of vertices, at most (2^31 - 1) / 6
   faces; `starts` has n_verts + 1 places, `near` 6 n_faces. Returns how many of `near` are used. */
REEL_API size_t reel_adjacency_memory(int64_t n_verts, int64_t n_faces);
REEL_API int64_t reel_adjacency(void *memory, size_t memory_size, const int32_t *faces,
                                int64_t n_faces, int64_t n_verts, int32_t *starts, int32_t *near);

/* The hierarchy of a graph, from `reel_adjacency`: all vertices level after level, the coarsest
   resolution first, `order`. This is the coding order; from here on vertices have their places in
   it. Where each level begins, and the end, `level_starts`; the resolution of each level, 0 is the
   coarsest. Of each vertex the stencil_size (1..REEL_MAX_STENCIL) ones that predict it, -1 where
   there are no more, and how many edges of the resolution away they are. Level 0 has none, all
   other vertices have at least one. The REEL_NEIGHBOURS context neighbours of each, likewise. The
   smooth fields of the resolutions but the coarsest, the finest last: of vertex v in row
   smooth_starts[level] + v; at most REEL_SMOOTH_ROWS n_verts rows. Where `smooth` is NULL they are
   not found, and where `stencil` is NULL nothing but them, the order and the levels: two calls may
   so share the work. Returns the number of levels. `n_near` is starts[n_verts]. */
#define REEL_MAX_STENCIL 16
#define REEL_MAX_RESOLUTIONS 20 /* above the coarsest */
#define REEL_MAX_LEVELS (1 + 3 * REEL_MAX_RESOLUTIONS)
#define REEL_SMOOTH_FIELDS 16
#define REEL_SMALL_GRAPH 4096 /* vertices up to which smooth fields diffuse less far */
#define REEL_SMOOTH_ROWS 4
#define REEL_NEIGHBOURS 8
REEL_API size_t reel_hierarchy_memory(int64_t n_verts, int64_t n_near);
REEL_API int64_t reel_hierarchy(void *memory, size_t memory_size, const int32_t *starts,
                                const int32_t *near, int64_t n_verts, int64_t stencil_size,
                                int32_t *order, int32_t *level_starts, int32_t *level_resolutions,
                                int64_t *smooth_starts, int32_t *stencil, uint8_t *hops,
                                int32_t *contexts, float *smooth);

/* Prediction of fields over the mesh.

   The hierarchy of a mesh, from `reel_hierarchy`. Vertices are numbered in coding order. */
typedef struct {
    int64_t n_verts;
    int64_t n_levels;
    int64_t stencil_size;         /* S, 1..16 */
    const int32_t *level_starts;  /* n_levels + 1 */
    const int64_t *smooth_starts; /* n_levels: first row of the smooth fields of its resolution */
    const int32_t *stencil;       /* n_verts x S: lower numbers, nearest first; -1 behind them */
    const uint8_t *hops;          /* n_verts x S: 1..3 edges of the resolution */
    const float *smooth;          /* rows of REEL_SMOOTH_FIELDS: vertex v is row start + v */
} reel_mesh;

typedef struct {
    int64_t n_verts;
    int64_t n_modes;
    int64_t n_learned;  /* modes that weights follow, of this block and of its key block */
    int64_t n_key;      /* modes of the key block, or 0 */
    int32_t *residuals; /* n_modes x n_verts */
    double *values;     /* n_verts x n_modes, decoded, in quantisation steps */
    const double *key;  /* n_verts x n_key, likewise */
    void *prepared;     /* what reel_predict_prepare made of the mesh and the key, or NULL */
} reel_fields;

/* What an encoder chooses by. */
typedef struct {
    int64_t first_shaped; /* first level whose noise is shaped */
    double gain;          /* of noise shaping */
    double price;         /* squared steps that a bit is worth; 0 rounds to the nearest */
    const double *wanted; /* n_verts x n_modes, in quantisation steps */
    double *counts;       /* n_modes x 2: zeros and ones so far; 0 at first */
    double *zones;        /* n_modes, for its own use */
} reel_choice;

/* The values of vertices first..last-1, once those before are known. Those of one level do not
   depend on each other, and may be found on several threads. The encoder finds residuals too. */
REEL_API int64_t reel_predict_decode(const reel_mesh *mesh, reel_fields *fields, int64_t first,
                                     int64_t last);
REEL_API int64_t reel_predict_encode(const reel_mesh *mesh, reel_fields *fields,
                                     const reel_choice *choice, int64_t first, int64_t last);

/* What is known about the weights of vertices first..last-1 before the first mode, for several
   blocks with the same mesh, key block and n_learned: into fields->prepared, of as many bytes as
   reel_predict_prepare_memory states, 64 bytes aligned. Residuals and values are not used. It serves
   where each `first` here and there is the first vertex of a level, or multiples of 16 behind it,
   on this machine. */
REEL_API size_t reel_predict_prepare_memory(int64_t n_verts, int64_t n_levels);
REEL_API int64_t reel_predict_prepare(const reel_mesh *mesh, const reel_fields *fields,
                                      int64_t first, int64_t last);

/* How modes move, and the frames that they make.

   A track has n_columns numbers at each vertex and frame; positions have x, y and z. Basis vectors
   of length 1 (or 0): of each column n_frames times of n_modes numbers, from integers as they are
   coded: of each mode all times of the first column, then of the next. Times with rests[time] != 0,
   none if `rests` is NULL and never the first, are predicted from the time before, and their
   integers are divided by 2^rest_bits, 0..REEL_MAX_REST_BITS. Vectors of the first
   n_reused modes, whose fields are those of a key block, are divided by `lengths` instead: those of
   the first modes of `values`, n_verts x n_modes, by `finer`, as reel_lengths finds them. */
#define REEL_MAX_REST_BITS 8
REEL_API size_t reel_basis_memory(int64_t n_columns, int64_t n_frames);
REEL_API int64_t reel_basis(void *memory, size_t memory_size, const int32_t *integers,
                            int64_t n_modes, int64_t n_columns, int64_t n_frames,
                            const uint8_t *rests, int64_t rest_bits, const double *lengths,
                            int64_t n_reused, double *basis);
/* The same from coefficients of a discrete cosine transform over time, of 1 to REEL_MAX_COSINES
   frames: of each mode all frequencies of the first column, then of the next. */
#define REEL_MAX_COSINES 1024
REEL_API size_t reel_cosine_basis_memory(int64_t n_columns, int64_t n_frames);
REEL_API int64_t reel_cosine_basis(void *memory, size_t memory_size, const int32_t *integers,
                                   int64_t n_modes, int64_t n_columns, int64_t n_frames,
                                   const double *lengths, int64_t n_reused, double *basis);
REEL_API int64_t reel_lengths(const double *values, int64_t n_verts, int64_t n_modes,
                              int64_t n_reused, double finer, double *lengths);

/* The integers of basis vectors near to wanted ones, n_modes x n_columns x n_frames in steps; a bit
   is worth `price` squared steps, 0 rounds to the nearest. REEL_INVALID if one is too large. */
REEL_API size_t reel_basis_encode_memory(int64_t n_frames);
REEL_API int64_t reel_basis_encode(void *memory, size_t memory_size, const double *wanted,
                                   int64_t n_modes, int64_t n_columns, int64_t n_frames,
                                   const uint8_t *rests, int64_t rest_bits, double price,
                                   int32_t *integers);
REEL_API size_t reel_cosines_encode_memory(int64_t n_frames);
REEL_API int64_t reel_cosines_encode(void *memory, size_t memory_size, const double *wanted,
                                     int64_t n_modes, int64_t n_columns, int64_t n_frames,
                                     double price, int32_t *integers);

/* Fields of a block as reel_frames multiplies them, for any number of calls: reel_packed_bytes of
   memory, aligned to 64 bytes. They are those of all vertices in their order, or if `order` is not
   NULL those of vertex order[i] as vertex i. The field of mode k at vertex v is step times
   fields[k mode_stride + v vertex_stride]; it is rounded to the precision of the sums. Packs the
   vertices first .. last - 1 of n_verts, `first` a multiple of 64: several threads may share the
   work. */
enum reel_precision { REEL_SUMS_4 = 4, REEL_SUMS_8 = 8 };
REEL_API size_t reel_packed_bytes(int64_t n_modes, int64_t n_verts, int64_t precision);
REEL_API int64_t reel_pack(const double *fields, int64_t mode_stride, int64_t vertex_stride,
                           double step, int64_t precision, const int32_t *order, int64_t n_modes,
                           int64_t n_verts, int64_t first, int64_t last, void *packed);

/* Frames wanted[0 .. n_wanted - 1] of a block, from packed fields in the order of their vertices.
   Fields and basis vectors are multiplied, and the products summed up, in IEEE single or double,
   the precision that fields were packed for. Corrections, unless
   correction_starts is NULL: those of wanted frame i are from correction_starts[i] to the next,
   each of a vertex as it is written, `corrected`, ascending, with n_columns numbers of `moves`. The
   placement is the scale, and the origin of each column. Layouts: the values of each vertex
   together, as 4 or 8 byte floats; or the first column of all frames, then the next, neither scaled
   nor moved, as 8 byte floats. There is at least one column. */
enum reel_layout { REEL_COLUMNS = 0, REEL_VALUES_4 = 4, REEL_VALUES_8 = 8 };
REEL_API size_t reel_frames_memory(int64_t n_columns, int64_t n_modes, int64_t n_wanted);
REEL_API int64_t reel_frames(void *memory, size_t memory_size, const double *basis,
                             const void *packed, int64_t precision, int64_t n_columns,
                             int64_t n_frames, int64_t n_modes, int64_t n_verts,
                             const int32_t *wanted, int64_t n_wanted,
                             const int64_t *correction_starts, const int32_t *corrected,
                             const double *moves, const double *placement, int64_t layout,
                             void *out);

/* Values of the vertices order[first..last-1] (or first..last-1, where `order` is NULL), such as
   positions, which are 4 or 8 byte floats in columns: less the origin of their column and divided
   by the scale of `placement`, as rows of the first column of all frames, then of the next, in
   `out`; where there are `signs`, one of each vertex, times these and added to what is there.
   Returns last - first. */
REEL_API int64_t reel_coordinates(const void *vertices, int64_t size, int64_t n_frames,
                                  int64_t n_verts, int64_t n_columns, const int32_t *order,
                                  int64_t first, int64_t last, const double *placement,
                                  const double *signs, double *out);

/* Normals of a surface (normals.c): of each frame of positions, 4 or 8 byte floats, the sums of the
   cross products of the sides of triangles, in the order of `faces`, divided by their length, or 0
   where they have none; n_frames x n_items x 3 numbers. Triangle i is of the item items[i]; where
   `items` is NULL, items are vertices, and it is of its three. Returns n_frames. */
REEL_API int64_t reel_normals(const void *positions, int64_t size, int64_t n_frames,
                              int64_t n_verts, const int32_t *faces, int64_t n_faces,
                              const int32_t *items, int64_t n_items, double *normals);

/* Normals turned by two numbers each, as 4 or 8 byte floats, those of length 0 stay; and the numbers
   that turn them to given ones, REEL_INVALID at the first that cannot be reached: where only one
   of both has a length, or near to the opposite. Returns `count`. docs/format.md, "Tracks". */
int64_t reel_turned(const double *normals, const double *turns, int64_t count, int64_t size,
                    void *turned);
REEL_API int64_t reel_turns(const double *normals, const void *turned, int64_t size, int64_t count,
                            double *turns);

/* ---- Residuals of fields to bits ---- */

/* Fields: rows of integers of -(2^31-1)..2^31-1 over the same columns, row after row in `values`.
   A row is coded column after column as `columns` lists them; pass i is those from
   pass_starts[i] to pass_starts[i + 1]. Column columns[i] has the context neighbours near[j] for
   j from near_starts[i] to near_starts[i + 1], at most 16, which are columns that come before it.
   REEL_INVALID if they do not, or if the passes do not hold each column once. The first n_wanted
   rows are read; where these are not all, what follows is not looked at. The caller bounds the
   number of integers that are read. */
REEL_API size_t reel_fields_memory(int64_t n_columns, int64_t n_passes, int64_t n_near);
REEL_API int64_t reel_fields_encode(void *memory, size_t memory_size, int32_t *values,
                                    int64_t n_rows, int64_t n_columns, const int32_t *columns,
                                    const int64_t *pass_starts, int64_t n_passes,
                                    const int64_t *near_starts, const int32_t *near, uint8_t *out,
                                    size_t room);
REEL_API int64_t reel_fields_decode(void *memory, size_t memory_size, const uint8_t *in,
                                    size_t size, int64_t n_rows, int64_t n_wanted,
                                    int64_t n_columns, const int32_t *columns,
                                    const int64_t *pass_starts, int64_t n_passes,
                                    const int64_t *near_starts, const int32_t *near,
                                    int32_t *values);

/* Faces of a mesh: `n_faces` rows of three corners 0..n_verts-1, both counts at most 2^26. The
   writer gives the faces in the order and the numbers that the reader will find, and the given
   vertex of each number; at most 96 bytes for each face and 1024 more are written. `listed` keeps
   faces and vertices in their given order, for more bytes. docs/format.md, CONNECTIVITY. */
REEL_API size_t reel_connectivity_encode_memory(int64_t n_verts, int64_t n_faces);
REEL_API size_t reel_connectivity_decode_memory(int64_t n_verts, int64_t n_faces);
REEL_API int64_t reel_connectivity_encode(void *memory, size_t memory_size, const int32_t *faces,
                                          int64_t n_faces, int64_t n_verts, int64_t listed,
                                          int32_t *internal_faces, int32_t *internal_to_given,
                                          uint8_t *out, size_t room);
REEL_API int64_t reel_connectivity_decode(void *memory, size_t memory_size, const uint8_t *in,
                                          size_t size, int64_t n_verts, int64_t n_faces,
                                          int32_t *faces);

/* Tables of numbers (patterns.c): n_rows x width values of `size` bytes (1: unsigned, 4, 8),
   integers or floats (4 and 8). Rows are coded in `order`, which names each of 0..n_rows-1 once.
   The i-th of them is expected from triples[3 starts[i]..3 starts[i + 1]) of rows a, b, c named
   before it in `order`, all a + b - c; or a single one with c < 0, as a. At most 24 bytes for each
   number and 32 more for each row, and 32 more, are written. */
REEL_API size_t reel_patterns_memory(int64_t width);
REEL_API int64_t reel_patterns_encode(void *memory, size_t memory_size, void *values,
                                      int64_t n_rows, int64_t width, int64_t size,
                                      int64_t is_float, const int32_t *order,
                                      const int64_t *starts, const int32_t *triples, uint8_t *out,
                                      size_t room);
REEL_API int64_t reel_patterns_decode(void *memory, size_t memory_size, const uint8_t *in,
                                      size_t in_size, void *values, int64_t n_rows, int64_t width,
                                      int64_t size, int64_t is_float, const int32_t *order,
                                      const int64_t *starts, const int32_t *triples);

/* Numbers over time on a graph, exactly (exact.c): n_frames x n_items x width values of `size` bytes
   (1, 2, 4, 8; floats 4, 8), at most 2^28 frames and 2^31 - 1 items, at least 1 of each. The
   neighbours of each item are as of `reel_adjacency`. At most the bytes of the values and 16 more
   are written; `values` come back to the writer as they were. */
enum reel_type { REEL_UNSIGNED_INTEGERS = 0, REEL_SIGNED_INTEGERS = 1, REEL_FLOATS = 2 };
REEL_API size_t reel_exact_memory(int64_t n_frames, int64_t n_items, int64_t width);
REEL_API int64_t reel_exact_encode(void *memory, size_t memory_size, void *values,
                                   int64_t n_frames, int64_t n_items, int64_t width, int64_t size,
                                   int64_t type, const int32_t *starts, const int32_t *near,
                                   uint8_t *out, size_t room);
REEL_API int64_t reel_exact_decode(void *memory, size_t memory_size, const uint8_t *in,
                                   size_t in_size, void *values, int64_t n_frames, int64_t n_items,
                                   int64_t width, int64_t size, int64_t type,
                                   const int32_t *starts, const int32_t *near);

/* The opposite side twins[3 i + k] of side k of face i, from corner k to the next, or itself. Where
   more than two sides lie on an edge they are paired in their order. At most 2^29 faces. */
REEL_API size_t reel_twins_memory(int64_t n_verts, int64_t n_faces);
REEL_API int64_t reel_twins(void *memory, size_t memory_size, const int32_t *faces,
                            int64_t n_faces, int64_t n_verts, int32_t *twins);

/* From which rows each is expected (expected.c), as reel_patterns_encode takes it, where `faces`
   are rows of 0..n_rows-1 and twins[side] is the other side with the same two rows of each side
   3 face + corner, or itself, an involution. There is room for 3 n_faces + n_rows triples; their
   number is returned. */
REEL_API size_t reel_expected_memory(int64_t n_rows, int64_t n_faces);
REEL_API int64_t reel_expected_find(void *memory, size_t memory_size, const int32_t *faces,
                                    const int32_t *twins, int64_t n_rows, int64_t n_faces,
                                    int32_t *order, int64_t *starts, int32_t *triples);

/* The given order of a known mesh (order.c). `faces` are vertices of 0..n_verts-1, and `twins` as
   above; n_faces is at most 2^29. corners[i] is 3 face + first corner of the i-th given face, and
   sequence[i] the vertex that is given as the i-th; they are filled in by the reader, and
   `sequence` comes back to the writer as it was. Without faces, twins and corners are not used. At
   most 32 bytes for each vertex and face, and 32 more, are written. */
REEL_API size_t reel_order_memory(int64_t n_verts, int64_t n_faces);
REEL_API int64_t reel_order_encode(void *memory, size_t memory_size, const int32_t *faces,
                                   const int32_t *twins, int64_t n_verts, int64_t n_faces,
                                   int64_t with_faces, int32_t *corners, int32_t *sequence,
                                   uint8_t *out, size_t room);
REEL_API int64_t reel_order_decode(void *memory, size_t memory_size, const uint8_t *in, size_t size,
                                   const int32_t *faces, const int32_t *twins, int64_t n_verts,
                                   int64_t n_faces, int64_t with_faces, int32_t *corners,
                                   int32_t *sequence);

#ifdef __cplusplus
}
#endif

#endif
