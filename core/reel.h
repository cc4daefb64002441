/* The core of meshreel: defines what a .reel stream means. docs/format.md specifies it in prose.
   The packages for Python and for web pages call it and ship the same version; C and C++ programs
   that decode files use include/meshreel.h, whose ABI is stable.

   Every function is pure: it reads and writes only the arrays that it is given, keeps no state, and
   may run on several threads at once. Nothing is allocated: the caller passes `memory`, aligned to
   64 bytes, of at least the size that the function `..._memory` of the same name returns.

   Functions return a number of at least 0 (bytes written, unless stated otherwise), or a failure
   -(code + 256 place) with a `reel_code` and the byte or item at which it was detected. */

#ifndef REEL_H
#define REEL_H

#include <stddef.h>
#include <stdint.h>

#if defined(REEL_PRIVATE) /* in a library that exports meshreel.h only */
#define REEL_API
#elif defined(_WIN32)
#define REEL_API __declspec(dllexport)
#else
#define REEL_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define REEL_ABI 25 /* changes whenever a function or struct below changes */

enum reel_code {
    REEL_OK = 0,
    REEL_NO_MEMORY = 1, /* `memory` or the output buffer is smaller than stated */
    REEL_TRUNCATED = 2, /* the input ends too early */
    REEL_CORRUPT = 3,   /* the input is damaged */
    REEL_INVALID = 4    /* the values to encode violate a limit of the format */
};

/* REEL_ABI of the loaded library. */
REEL_API int64_t reel_abi(void);

/* Code rows of integers in -(2^31-1)..2^31-1: row i has lengths[i] integers and uses table
   tables[i] of 0..n_tables-1. `values` holds all rows, concatenated. Writes at most 16 bytes for
   each integer and 16 more. */
REEL_API size_t reel_integers_memory(int64_t n_tables);
REEL_API int64_t reel_integers_encode(void *memory, size_t memory_size, int32_t *values,
                                      const int64_t *lengths, const int32_t *tables, int64_t n_rows,
                                      int64_t n_tables, uint8_t *out, size_t capacity);
REEL_API int64_t reel_integers_decode(void *memory, size_t memory_size, const uint8_t *in,
                                      size_t size, const int64_t *lengths, const int32_t *tables,
                                      int64_t n_rows, int64_t n_tables, int32_t *values);

/* ---- Connectivity, adjacency and hierarchy ----

   Adjacency of the vertices of a mesh: the neighbors of v are near[starts[v]] .. near[starts[v + 1]
   - 1], ascending, each once. `faces` has 3 n_faces vertices, at most (2^31 - 1) / 6 faces;
   `starts` has space for n_verts + 1 numbers, `near` for 6 n_faces. Returns the number of entries
   of `near`. */
REEL_API size_t reel_adjacency_memory(int64_t n_verts, int64_t n_faces);
REEL_API int64_t reel_adjacency(void *memory, size_t memory_size, const int32_t *faces,
                                int64_t n_faces, int64_t n_verts, int32_t *starts, int32_t *near);

/* Faces of the graph of items at the corners of triangles, items[3 i + k] at corner k of triangle
   i: items are adjacent in a triangle, and across an edge at the same vertex. `twins` as from
   reel_twins; `faces` has space for 4 n_triangles. Returns their number. */
REEL_API int64_t reel_item_faces(const int32_t *triangles, const int32_t *twins,
                                 const int32_t *items, int64_t n_triangles, int32_t *faces);

/* The hierarchy of a graph from `reel_adjacency`; `n_near` is starts[n_verts].

   `order` receives all vertices level by level, coarsest resolution first. This is the coding
   order; all other results number vertices by their position in it. `level_starts` receives where
   each level begins, and the end; `level_resolutions` the resolution of each level, 0 is the
   coarsest. `stencil` receives for each vertex the stencil_size (1..REEL_MAX_STENCIL) vertices that
   predict it, padded with -1, and `hops` their distances in edges of the resolution. Level 0 has no
   stencils; all other vertices have at least one entry. `contexts` receives the
   REEL_CONTEXT_NEIGHBORS context neighbors of each vertex, also padded with -1. `smooth` receives
   the smooth fields of all resolutions but the coarsest, finest last: those of vertex v are in row
   smooth_starts[level] + v; at most REEL_SMOOTH_ROWS n_verts rows, of which n_verts are of the
   finest resolution. NULL computes none, for weights from points.

   Returns the number of levels. */
#define REEL_MAX_STENCIL 16
#define REEL_MAX_RESOLUTIONS 20 /* in addition to the coarsest */
#define REEL_MAX_LEVELS (1 + 3 * REEL_MAX_RESOLUTIONS)
#define REEL_SMOOTH_FIELDS 16
#define REEL_SMALL_GRAPH 4096 /* up to this many vertices, smooth fields diffuse less far */
#define REEL_SMOOTH_ROWS 4
#define REEL_CONTEXT_NEIGHBORS 8
REEL_API size_t reel_hierarchy_memory(int64_t n_verts, int64_t n_near, int64_t has_smooth);
REEL_API int64_t reel_hierarchy(void *memory, size_t memory_size, const int32_t *starts,
                                const int32_t *near, int64_t n_verts, int64_t stencil_size,
                                int32_t *order, int32_t *level_starts, int32_t *level_resolutions,
                                int64_t *smooth_starts, int32_t *stencil, uint8_t *hops,
                                int32_t *contexts, float *smooth);

/* ---- Prediction of fields over the mesh ----

   The hierarchy of a mesh, from `reel_hierarchy`. Vertices are numbered in coding order. */
typedef struct {
    int64_t n_verts;
    int64_t n_levels;
    int64_t stencil_size;        /* S, 1..16 */
    const int32_t *level_starts; /* n_levels + 1 */
    /* n_levels: first row of the smooth fields of the level's resolution */
    const int64_t *smooth_starts;
    const int32_t *stencil; /* n_verts x S: lower numbers, nearest first, padded with -1 */
    const uint8_t *hops;    /* n_verts x S: 1..3 edges of the resolution */
    const float *smooth;    /* rows of REEL_SMOOTH_FIELDS: vertex v has row start + v */
    const float *weights;   /* n_verts x S: initial weights; NULL derives them from `smooth` */
} reel_mesh;

/* Initial weights of vertices first..last-1 from their positions, n_verts x 3: a prediction by
   kriging, with a nugget above 0. Those without a stencil get 0. Returns 0. */
REEL_API int64_t reel_kriging(const reel_mesh *mesh, const double *points, double nugget,
                              int64_t first, int64_t last, float *weights);

typedef struct {
    int64_t n_verts;
    int64_t n_modes;
    int64_t n_learned;  /* modes that weights adapt to, of this block and of its key block */
    int64_t n_key;      /* modes of the key block, or 0 */
    int32_t *residuals; /* n_modes x n_verts */
    double *values;     /* n_verts x n_modes, decoded, in quantization steps */
    const double *key;  /* n_verts x n_key, in quantization steps */
    /* Fields of a related track, of which what the weights leave is regressed; these are needed. */
    int64_t n_related;     /* at most REEL_MAX_RELATED, or 0 */
    const double *related; /* n_verts x n_related, in any unit */
    double *regression;    /* n_related (n_related + 2 n_modes): scratch space */
} reel_fields;

#define REEL_MAX_RELATED 4
#define REEL_MAX_JOINT 8   /* modes that are quantized jointly */
#define REEL_MAGNITUDES 16 /* counters of residual magnitudes; the last counts all larger ones */

/* How the encoder quantizes. */
typedef struct {
    int64_t first_shaped;  /* first level with noise shaping */
    double gain;           /* gain of noise shaping */
    double rd_lambda;      /* cost of a bit in squared quantization steps; 0 rounds to nearest */
    const double *targets; /* n_verts x n_modes, in quantization steps */
    double *counts;        /* n_modes x 2: zeros and ones so far; initially 0 */
    double *zones;         /* n_modes: scratch space */
    /* The errors e of the first n_joint modes of a vertex count as a quadratic form, the sum over k
       of p_k (e_k + sum of c_kj e_j over j < k)^2; 0 if each mode counts alone. */
    int64_t n_joint;       /* at most REEL_MAX_JOINT and n_learned */
    const float *forms;    /* n_verts x n_joint (n_joint + 1) / 2: the c_kj of mode k, then p_k */
    double *magnitudes;    /* n_joint x REEL_MAGNITUDES: counts so far, initially positive */
} reel_quantizer;

/* Reconstruct the values of vertices first..last-1; those before must be complete. Vertices of one
   level are independent, and may be split among threads; with related fields, `first` is 0. The
   encoder writes the residuals too. Both return 0. */
REEL_API int64_t reel_predict_decode(const reel_mesh *mesh, reel_fields *fields, int64_t first,
                                     int64_t last);
REEL_API int64_t reel_predict_encode(const reel_mesh *mesh, reel_fields *fields,
                                     const reel_quantizer *quantizer, int64_t first, int64_t last);

/* ---- Temporal basis and frames ----

   A track has n_columns numbers at each vertex and frame; positions have x, y and z. Computes unit
   (or zero) basis vectors, n_columns x n_frames x n_modes, from coded integers: for each mode all
   times of the first column, then of the next. Times with rests[time] != 0 (none if `rests` is
   NULL, never the first) are predicted from the previous time, and their integers are divided by
   2^rest_bits, 0..REEL_MAX_REST_BITS. If is_adaptive is not 0, other times are predicted with
   weights that follow the decoded values. The fields of the first n_reused modes are those of a key
   block; their vectors are divided by `lengths` instead, which reel_lengths computes from the first
   modes of `values`, n_verts x n_modes: the norm of each field, divided by `finer`. Both return the
   number of vectors or lengths. */
#define REEL_MAX_REST_BITS 8
REEL_API size_t reel_basis_memory(int64_t n_columns, int64_t n_frames);
REEL_API int64_t reel_basis(void *memory, size_t memory_size, const int32_t *integers,
                            int64_t n_modes, int64_t n_columns, int64_t n_frames,
                            const uint8_t *rests, int64_t rest_bits, int64_t is_adaptive,
                            const double *lengths, int64_t n_reused, double *basis);
/* As reel_basis, from coefficients of a discrete cosine transform over time, for 1 to
   REEL_MAX_COSINES frames: for each mode all frequencies of the first column, then of the next. */
#define REEL_MAX_COSINES 1024
REEL_API size_t reel_cosine_basis_memory(int64_t n_columns, int64_t n_frames);
REEL_API int64_t reel_cosine_basis(void *memory, size_t memory_size, const int32_t *integers,
                                   int64_t n_modes, int64_t n_columns, int64_t n_frames,
                                   const double *lengths, int64_t n_reused, double *basis);
REEL_API int64_t reel_lengths(const double *values, int64_t n_verts, int64_t n_modes,
                              int64_t n_reused, double finer, double *lengths);

/* Quantize basis vectors `targets`, n_modes x n_columns x n_frames in steps, to integers. A bit
   costs `rd_lambda` squared steps; 0 rounds to nearest. REEL_INVALID if one is too large. */
REEL_API size_t reel_basis_encode_memory(int64_t n_frames);
REEL_API int64_t reel_basis_encode(void *memory, size_t memory_size, const double *targets,
                                   int64_t n_modes, int64_t n_columns, int64_t n_frames,
                                   const uint8_t *rests, int64_t rest_bits, int64_t is_adaptive,
                                   double rd_lambda, int32_t *integers);
REEL_API size_t reel_cosines_encode_memory(int64_t n_frames);
REEL_API int64_t reel_cosines_encode(void *memory, size_t memory_size, const double *targets,
                                     int64_t n_modes, int64_t n_columns, int64_t n_frames,
                                     double rd_lambda, int32_t *integers);

/* Pack the fields of a block for any number of calls of reel_frames, into reel_packed_bytes of
   memory aligned to 64 bytes. The field of mode k at vertex v is step times fields[k mode_stride +
   v vertex_stride], rounded to the precision of the sums. If `order` is not NULL, packed vertex i
   is vertex order[i]. Packs vertices first .. last - 1 of n_verts, `first` a multiple of 64:
   several threads may share the work. Returns 0. */
enum reel_precision { REEL_SUMS_4 = 4, REEL_SUMS_8 = 8 };
REEL_API size_t reel_packed_bytes(int64_t n_modes, int64_t n_verts, int64_t precision);
REEL_API int64_t reel_pack(const double *fields, int64_t mode_stride, int64_t vertex_stride,
                           double step, int64_t precision, const int32_t *order, int64_t n_modes,
                           int64_t n_verts, void *packed, int64_t first, int64_t last);

/* Reconstruct frames frames[0 .. n_requested - 1] of a block from packed fields. Products of fields
   and basis vectors are summed in IEEE single or double; `precision` must be that of reel_pack.
   Corrections, unless correction_starts is NULL: those of requested frame i are
   correction_starts[i] to correction_starts[i + 1] - 1, at correction_vertices[k], ascending, with
   n_columns numbers of `offsets`. `placement` is the scale, and the origin of each column.
   Layouts: the columns of each vertex together, as 4 or 8 byte floats; or the first column of all
   frames, then the next, without scale and origin, as 8 byte floats. There is at least one column.
   Returns 1 if all values are finite, else 0; those of REEL_COLUMNS are not checked. */
enum reel_layout { REEL_COLUMNS = 0, REEL_VALUES_4 = 4, REEL_VALUES_8 = 8 };
REEL_API size_t reel_frames_memory(int64_t n_columns, int64_t n_modes, int64_t n_requested);
REEL_API int64_t reel_frames(void *memory, size_t memory_size, const double *basis,
                             const void *packed, int64_t precision, int64_t n_columns,
                             int64_t n_frames, int64_t n_modes, int64_t n_verts,
                             const int32_t *frames, int64_t n_requested,
                             const int64_t *correction_starts, const int32_t *correction_vertices,
                             const double *offsets, const double *placement, int64_t layout,
                             void *out);

/* Normalize values such as positions, 4 or 8 byte floats in columns, of the vertices
   order[first..last-1], or first..last-1 if `order` is NULL: subtract the origin of their column,
   divide by the scale of `placement`, and write the first column of all frames, then the next, to
   `out`. With `signs`, one per vertex, the results are multiplied by them and added to `out`
   instead. Returns last - first. */
REEL_API int64_t reel_coordinates(const void *vertices, int64_t size, int64_t n_frames,
                                  int64_t n_verts, int64_t n_columns, const int32_t *order,
                                  int64_t first, int64_t last, const double *placement,
                                  const double *signs, double *out);

/* Normals of a surface (normals.c): for each frame of positions, 4 or 8 byte floats, the sum of the
   cross products of the sides of triangles, in the order of `faces`, normalized, or 0 if its length
   is 0; n_frames x n_items x 3 numbers. Triangle i contributes to item items[i], or, if `items` is
   NULL, to its three vertices. Returns n_frames. */
REEL_API int64_t reel_normals(const void *positions, int64_t size, int64_t n_frames,
                              int64_t n_verts, const int32_t *faces, int64_t n_faces,
                              const int32_t *items, int64_t n_items, double *normals);

/* Rotate normals by two numbers each, into 4 or 8 byte floats; those of length 0 do not change. The
   inverse finds the rotations that map `normals` to `rotated`. It fails with REEL_INVALID at the
   first pair without one: only one of the two is 0, or they are nearly opposite. Both return
   `count`. docs/format.md, "Tracks". */
int64_t reel_rotate_normals(const double *normals, const double *rotations, int64_t count,
                            int64_t size, void *rotated);
REEL_API int64_t reel_find_rotations(const double *normals, const void *rotated, int64_t size,
                                     int64_t count, double *rotations);

/* ---- Entropy coding ---- */

/* Residuals of fields: rows of integers of -(2^31-1)..2^31-1 over the same columns, row by row in
   `values`. A row is coded in the order of `columns`; pass i covers pass_starts[i] to pass_starts[i
   + 1]. Column columns[i] has the context neighbors near[j] for j from near_starts[i] to
   near_starts[i + 1], at most 16, all coded before it. REEL_INVALID if they are not, or if the
   passes do not cover each column once. Decodes the first n_read rows; if these are not all, the
   rest of the input is ignored. The caller bounds the number of integers. */
REEL_API size_t reel_fields_memory(int64_t n_columns, int64_t n_passes, int64_t n_near);
REEL_API int64_t reel_fields_encode(void *memory, size_t memory_size, int32_t *values,
                                    int64_t n_rows, int64_t n_columns, const int32_t *columns,
                                    const int64_t *pass_starts, int64_t n_passes,
                                    const int64_t *near_starts, const int32_t *near, uint8_t *out,
                                    size_t capacity);
REEL_API int64_t reel_fields_decode(void *memory, size_t memory_size, const uint8_t *in,
                                    size_t size, int64_t n_rows, int64_t n_read, int64_t n_columns,
                                    const int32_t *columns, const int64_t *pass_starts,
                                    int64_t n_passes, const int64_t *near_starts,
                                    const int32_t *near, int32_t *values);

/* The coding order of a vector from reel_basis_encode, or with has_cosines from
   reel_cosines_encode, as reel_fields_encode takes it: for n = n_columns n_frames, `columns` has
   space for n numbers, `near_starts` for n + 1, `near` for REEL_MAX_NEAR_TIMES n, `pass_starts` for
   REEL_MAX_TIME_PASSES + 1. Returns the number of passes. */
#define REEL_MAX_TIME_PASSES 4
#define REEL_MAX_NEAR_TIMES 6
REEL_API size_t reel_time_order_memory(int64_t n_frames);
REEL_API int64_t reel_time_order(void *memory, size_t memory_size, int64_t n_columns,
                                 int64_t n_frames, int64_t has_cosines, const uint8_t *rests,
                                 int32_t *columns, int64_t *pass_starts, int64_t *near_starts,
                                 int32_t *near);

/* Connectivity: `n_faces` triangles with vertices 0..n_verts-1, both counts at most 2^26. The
   encoder returns the faces as the decoder will restore them, in internal order and numbers, and
   the given vertex of each internal number; it writes at most 96 bytes for each face and 1024 more.
   `keep_order` keeps the order of faces and vertices, and takes more bytes. Unless `twins` is NULL,
   both fill in the twin of each internal half-edge, which is itself at a boundary.
   docs/format.md, CONNECTIVITY. */
REEL_API size_t reel_connectivity_encode_memory(int64_t n_verts, int64_t n_faces);
REEL_API size_t reel_connectivity_decode_memory(int64_t n_verts, int64_t n_faces);
REEL_API int64_t reel_connectivity_encode(void *memory, size_t memory_size, const int32_t *faces,
                                          int64_t n_faces, int64_t n_verts, int64_t keep_order,
                                          int32_t *internal_faces, int32_t *twins,
                                          int32_t *internal_to_given, uint8_t *out,
                                          size_t capacity);
REEL_API int64_t reel_connectivity_decode(void *memory, size_t memory_size, const uint8_t *in,
                                          size_t size, int64_t n_verts, int64_t n_faces,
                                          int32_t *faces, int32_t *twins);

/* ---- Cells (cells.c): types of VTK, and the nodes of all cells, concatenated; at most 2^26 cells
   and 2^28 nodes. docs/format.md, CELLS.

   Number of nodes of a cell type; 0 if the type is unknown. */
REEL_API int64_t reel_cell_size(int64_t type);

/* The polygons of the surface, in the order of cells, each a fan of triangles: their corners
   (sizes) and cells (owners). Returns the number of triangles; those beyond `capacity`, and
   polygons with these, are not written. REEL_INVALID at the first cell of an unknown type or with a
   node that does not exist. */
REEL_API size_t reel_cells_memory(int64_t n_cells, int64_t n_verts);
REEL_API int64_t reel_cells_surface(void *memory, size_t memory_size, const uint8_t *types,
                                    int64_t n_cells, const int32_t *nodes, int64_t n_nodes,
                                    int64_t n_verts, int64_t capacity, int32_t *triangles,
                                    int32_t *sizes, int32_t *owners, int64_t *n_polygons);

/* Adjacency of nodes along the edges of cells; or, with `of_cells`, of cells that share a side.
   As `reel_adjacency`; `near` has space for 4 n_nodes numbers, of cells for 8 n_cells. */
REEL_API size_t reel_cells_adjacency_memory(int64_t n_cells, int64_t n_nodes, int64_t n_verts,
                                            int64_t of_cells);
REEL_API int64_t reel_cells_adjacency(void *memory, size_t memory_size, const uint8_t *types,
                                      int64_t n_cells, const int32_t *nodes, int64_t n_nodes,
                                      int64_t n_verts, int64_t of_cells, int32_t *starts,
                                      int32_t *near);

/* Coding of cells (cell_walk.c). The encoder returns the cells as the decoder will restore them,
   the given cell of each, and the given vertex of each internal number. `listed` keeps the order of
   cells and vertices; otherwise it is that of a walk from cell to cell. Writes at most 16 bytes for
   each node and 64 more. */
REEL_API size_t reel_cells_code_memory(int64_t n_cells, int64_t n_nodes, int64_t n_verts);
REEL_API int64_t reel_cells_encode(void *memory, size_t memory_size, const uint8_t *types,
                                   int64_t n_cells, const int32_t *nodes, int64_t n_nodes,
                                   int64_t n_verts, int64_t listed, uint8_t *internal_types,
                                   int32_t *internal_nodes, int32_t *given_cells,
                                   int32_t *internal_to_given, uint8_t *out, size_t capacity);
REEL_API int64_t reel_cells_decode(void *memory, size_t memory_size, const uint8_t *in, size_t size,
                                   int64_t n_cells, int64_t n_nodes, int64_t n_verts,
                                   uint8_t *types, int32_t *nodes);

/* Tables of numbers (patterns.c): n_rows x width values of `size` bytes (1: unsigned, 4, 8),
   integers or floats (4 and 8). Rows are coded in `order`, a permutation of 0..n_rows-1. The i-th
   of them is predicted from triples[3 starts[i]..3 starts[i + 1]): rows a, b, c coded before it,
   each giving a + b - c; or a single triple with c < 0, giving a. With `stencils`, from
   reel_predictors_find, rows that have one are instead predicted with these `weights`. Writes at
   most 24 bytes for each number, 32 for each row, and 32 more. */
REEL_API size_t reel_patterns_memory(int64_t width);
REEL_API int64_t reel_patterns_encode(void *memory, size_t memory_size, void *values,
                                      int64_t n_rows, int64_t width, int64_t size, int64_t is_float,
                                      const int32_t *order, const int64_t *starts,
                                      const int32_t *triples, const int32_t *stencils,
                                      const float *weights, uint8_t *out, size_t capacity);
REEL_API int64_t reel_patterns_decode(void *memory, size_t memory_size, const uint8_t *in,
                                      size_t in_size, void *values, int64_t n_rows, int64_t width,
                                      int64_t size, int64_t is_float, const int32_t *order,
                                      const int64_t *starts, const int32_t *triples,
                                      const int32_t *stencils, const float *weights);

/* Lossless numbers over time on a graph (exact.c): n_frames x n_items x width values of `size`
   bytes (1, 2, 4, 8; floats 4, 8), at most 2^28 frames and 2^31 - 1 items, at least 1 of each.
   `starts` and `near` are the adjacency of items, as from `reel_adjacency`. Writes at most the
   bytes of the values and 16 more; the encoder restores `values`. */
enum reel_type { REEL_UNSIGNED_INTEGERS = 0, REEL_SIGNED_INTEGERS = 1, REEL_FLOATS = 2 };
REEL_API size_t reel_exact_memory(int64_t n_frames, int64_t n_items, int64_t width);
REEL_API int64_t reel_exact_encode(void *memory, size_t memory_size, void *values, int64_t n_frames,
                                   int64_t n_items, int64_t width, int64_t size, int64_t type,
                                   const int32_t *starts, const int32_t *near, uint8_t *out,
                                   size_t capacity);
REEL_API int64_t reel_exact_decode(void *memory, size_t memory_size, const uint8_t *in,
                                   size_t in_size, void *values, int64_t n_frames, int64_t n_items,
                                   int64_t width, int64_t size, int64_t type,
                                   const int32_t *starts, const int32_t *near);

/* The twin twins[3 i + k] of half-edge k of face i, from corner k to the next; a half-edge without
   one is its own. More than two half-edges on an edge are paired in their order. At most 2^29
   faces. Returns n_faces. */
REEL_API size_t reel_twins_memory(int64_t n_verts, int64_t n_faces);
REEL_API int64_t reel_twins(void *memory, size_t memory_size, const int32_t *faces,
                            int64_t n_faces, int64_t n_verts, int32_t *twins);

/* The corner of its polygon at each corner of a triangle, 3 for each triangle (outlines.c). Corners
   are numbered polygon by polygon; a polygon of sizes[i] corners, at least 3, is the next sizes[i]
   - 2 triangles. `max_size` is the largest size. Returns the number of corners; fails with
   REEL_CORRUPT at the first polygon whose triangles do not adjoin. */
REEL_API size_t reel_triangle_corners_memory(int64_t max_size);
REEL_API int64_t reel_triangle_corners(void *memory, size_t memory_size, const int32_t *triangles,
                                       const int32_t *sizes, int64_t n_polygons, int64_t max_size,
                                       int32_t *corners);

/* Cut polygons into triangles (triangulate.c); `corners` are their vertices, polygon by polygon,
   and `positions` three coordinates of each vertex. Returns the number of polygons whose triangles
   may overlap, since they intersect themselves or are too large. */
REEL_API size_t reel_triangulate_memory(int64_t max_size);
REEL_API int64_t reel_triangulate(void *memory, size_t memory_size, const double *positions,
                                  const int32_t *sizes, int64_t n_polygons, int64_t max_size,
                                  const int32_t *corners, int32_t *triangles);

/* Remove vertices of a triangle mesh while its surface stays near the given one (decimate.c), for
   analysis: no stream depends on it. `vertices` are three coordinates each, `weights` those of the
   squared distances at each vertex. `faces` and `wedges` are n_faces triples. Faces refer to vertices 0..n_verts-1. Wedges are any numbers: corners of a
   vertex with different wedges have different attributes; such seams are kept like boundaries. The
   root mean square distance over all faces is at most about max_rms, that around a vertex at most
   max_distance, as quadrics measure; edges that become longer are at most max_length. Returns the
   number of faces that remain, which replace the first ones; fails with REEL_INVALID at the first
   face with a vertex that does not exist. */
REEL_API size_t reel_decimate_memory(int64_t n_verts, int64_t n_faces);
REEL_API int64_t reel_decimate(void *memory, size_t memory_size, const double *vertices,
                               const double *weights, int64_t n_verts, int32_t *faces,
                               int32_t *wedges, int64_t n_faces, double max_rms,
                               double max_distance, double max_length);

/* Codes of the rows that corners refer to (corner_rows.c). `triangles` are vertices 0..n_verts-1,
   `twins` as above, and items[corner] is the item, 0..n_items-1, that has a row; NULL: each corner
   is an item. Sets for each item, in coding order, its number, its context and its code; returns
   the number of items. Fails if a row is negative. */
enum { REEL_CORNER_CONTEXTS = 9 };
REEL_API size_t reel_corner_rows_memory(int64_t n_verts, int64_t n_items);
REEL_API int64_t reel_corner_codes(void *memory, size_t memory_size, const int32_t *triangles,
                                   const int32_t *twins, const int32_t *items, int64_t n_triangles,
                                   int64_t n_verts, int64_t n_items, const int32_t *rows,
                                   int32_t *order, uint8_t *contexts, int32_t *codes);
/* Decode the rows, in 0..n_rows-1, from the n_codes[c] codes of each context c in turn, and the
   differences of explicit rows. Returns n_items. */
REEL_API int64_t reel_corner_rows(void *memory, size_t memory_size, const int32_t *triangles,
                                  const int32_t *twins, const int32_t *items, int64_t n_triangles,
                                  int64_t n_verts, int64_t n_items, int64_t n_rows,
                                  const int32_t *codes, const int64_t *n_codes,
                                  const int32_t *differences, int64_t n_explicit, int32_t *rows);

/* The rows that predict each row of a table along the faces (row_predictors.c), as
   reel_patterns_encode takes them. `faces` are triples of rows 0..n_rows-1, and twins[h] is the
   other half-edge with the same two rows, or itself; an involution. `triples` has space for 3
   n_faces + n_rows triples; returns their number. Unless NULL, `stencils` receives for each row up
   to REEL_MAX_STENCIL rows coded before it, padded with -1. */
REEL_API size_t reel_predictors_memory(int64_t n_rows, int64_t n_faces);
REEL_API int64_t reel_predictors_find(void *memory, size_t memory_size, const int32_t *faces,
                                      const int32_t *twins, int64_t n_rows, int64_t n_faces,
                                      int32_t *order, int64_t *starts, int32_t *triples,
                                      int32_t *stencils);

/* Integers on a surface (surface_integers.c): n_frames x n_rows x n_columns values within
   +-REEL_MAX_SURFACE_VALUE, at most REEL_MAX_SURFACE_COLUMNS columns and INT32_MAX rows in all;
   `faces` and `twins` as above, but twins may have different rows. Writes at most 10 bytes for each
   value, and 64 more; REEL_INVALID at the first value that exceeds the limit, or if a face has a
   row that does not exist. Every row is read or written. `encodes` is 0 for the decoder, which
   needs less memory. */
#define REEL_MAX_SURFACE_VALUE (1 << 29)
#define REEL_MAX_SURFACE_COLUMNS 16
REEL_API size_t reel_surface_integers_memory(int64_t n_frames, int64_t n_rows, int64_t n_columns,
                                             int64_t n_faces, int64_t encodes);
REEL_API int64_t reel_surface_integers_encode(void *memory, size_t memory_size,
                                              const int32_t *values, int64_t n_frames,
                                              int64_t n_rows, int64_t n_columns,
                                              const int32_t *faces, const int32_t *twins,
                                              int64_t n_faces, uint8_t *out, size_t capacity);
REEL_API int64_t reel_surface_integers_decode(void *memory, size_t memory_size, const uint8_t *in,
                                              size_t size, int64_t n_frames, int64_t n_rows,
                                              int64_t n_columns, const int32_t *faces,
                                              const int32_t *twins, int64_t n_faces,
                                              int32_t *values);

/* The original order of the vertices and faces of a mesh (order.c). `faces` are vertices
   0..n_verts-1, and `twins` as above; n_faces is at most 2^29. corners[i] is 3 face + first corner
   of the i-th original face, and sequence[i] the i-th original vertex; the decoder fills them in,
   and the encoder restores `sequence`. Without faces, `twins` and `corners` are not used. Writes at
   most 32 bytes for each vertex and face, and 32 more. */
REEL_API size_t reel_order_memory(int64_t n_verts, int64_t n_faces);
REEL_API int64_t reel_order_encode(void *memory, size_t memory_size, const int32_t *faces,
                                   const int32_t *twins, int64_t n_verts, int64_t n_faces,
                                   int64_t with_faces, int32_t *corners, int32_t *sequence,
                                   uint8_t *out, size_t capacity);
REEL_API int64_t reel_order_decode(void *memory, size_t memory_size, const uint8_t *in, size_t size,
                                   const int32_t *faces, const int32_t *twins, int64_t n_verts,
                                   int64_t n_faces, int64_t with_faces, int32_t *corners,
                                   int32_t *sequence);

/* The original order of cells, then of their vertices (order_cells.c). Cells and nodes are valid;
   cell_sequence[i] and vertex_sequence[i] are the i-th original cell and vertex. The decoder fills
   them in, and the encoder restores them. Writes at most 32 bytes for each, and 32 more. */
REEL_API size_t reel_cells_order_memory(int64_t n_cells, int64_t n_nodes, int64_t n_verts);
REEL_API int64_t reel_cells_order_encode(void *memory, size_t memory_size, const uint8_t *types,
                                         int64_t n_cells, const int32_t *nodes, int64_t n_nodes,
                                         int64_t n_verts, int32_t *cell_sequence,
                                         int32_t *vertex_sequence, uint8_t *out, size_t capacity);
REEL_API int64_t reel_cells_order_decode(void *memory, size_t memory_size, const uint8_t *in,
                                         size_t size, const uint8_t *types, int64_t n_cells,
                                         const int32_t *nodes, int64_t n_nodes, int64_t n_verts,
                                         int32_t *cell_sequence, int32_t *vertex_sequence);

/* Closest points of a triangle mesh (closest.c), for analysis: no stream depends on them.
   `vertices` are three coordinates each, and `faces` n_faces triples of 0..n_verts-1, at least one
   and at most 2^29. `tree` has reel_triangle_tree_bytes(n_faces) bytes, aligned to 64. Returns
   n_faces; fails with REEL_INVALID at the first face with a vertex that does not exist. */
REEL_API size_t reel_triangle_tree_bytes(int64_t n_faces);
REEL_API size_t reel_triangle_tree_memory(int64_t n_faces);
REEL_API int64_t reel_triangle_tree(void *memory, size_t memory_size, const double *vertices,
                                    int64_t n_verts, const int32_t *faces, int64_t n_faces,
                                    void *tree);
/* For each of n_points points, at most 2^31 - 1: its distance from the closest point of the n_faces
   faces of a tree, the face (the lowest of those whose computed distances are equal), three
   coordinates, and three barycentric ones. Any number of calls may share a tree.

   Unless `directions` is NULL, it has a vector for each point, and only faces count whose unit
   normal has a dot product of at least 1 with it. Without a face within `reach`, which may be
   infinite, the distance is infinite, the face -1, and the other numbers are 0. Returns
   n_points. */
REEL_API size_t reel_closest_memory(int64_t n_points);
REEL_API int64_t reel_closest(void *memory, size_t memory_size, const void *tree, int64_t n_faces,
                              const double *points, const double *directions, double reach,
                              int64_t n_points, double *distances, int32_t *faces, double *closest,
                              double *weights);

/* Memory for the host of include/meshreel.h (host_memory.c), whose `user` is a reel_host_memory.
   Several threads may call these functions, which are not pure: they change the structure. */
typedef struct {
    void *(*allocate)(size_t size); /* called by several threads; returns NULL if it fails */
    void (*release)(void *memory);
    uint64_t n_bytes; /* bytes that the core holds */
} reel_host_memory;
REEL_API void *reel_host_allocate(void *user, size_t size);
REEL_API void reel_host_release(void *user, void *memory, size_t size);

#ifdef __cplusplus
}
#endif

#endif
