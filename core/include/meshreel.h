/* Decoder of .reel files for C and C++, and the library under meshreel's bindings for Python, web
   pages and C#. docs/guides/engines.md has examples; docs/format.md specifies the files.

   A file is opened from bytes in memory, or through a callback that reads ranges. Opening parses
   the container only. `meshreel_read_mesh` and `meshreel_read_surface` decode what all frames
   share; after that a file never changes, and any number of threads may use it. A decoder holds two
   blocks of frames of each track; only one thread may use it at a time. Several decoders of one
   file may work on several threads at once.

   A file holds one or more segments: animated meshes of constant connectivity, shown in order. Most
   files have one. If a file has several, `meshreel_open_segment` opens one of them as a separate
   `meshreel_file`, and functions that decode fail for the file itself.

   The library has no global state, opens no files and starts no threads. The host provides memory
   and threads (`meshreel_host`). Input may be hostile: no input makes a function crash, hang, or
   hold more memory than `memory_limit`.

   Functions that can fail return a `meshreel_code` and fill `error`, which may be NULL. After a
   failure output buffers hold unspecified values; the file and the decoder remain usable.

   This program reads a file and writes the positions of its first frame, as floats:

       #include <meshreel.h>
       #include <stdio.h>
       #include <stdlib.h>
       static void *allocate(void *user, size_t size) { return aligned_alloc(64, (size | 63) + 1); }
       static void release(void *user, void *memory, size_t size) { free(memory); }
       int main(void) {
           static char bytes[1 << 24]; // or a callback that reads ranges
           meshreel_source source = {.bytes = bytes, .size = fread(bytes, 1, sizeof bytes, stdin)};
           meshreel_host host = {.allocate = allocate, .release = release};
           meshreel_layout floats = {.type = MESHREEL_FLOAT32}; // converts doubles, too
           meshreel_file *file = NULL;
           meshreel_decoder *decoder = NULL;
           meshreel_error error;
           int failed = meshreel_open(&source, &host, &file, &error) ||
                        meshreel_read_mesh(file, &error) || meshreel_begin(file, &decoder, &error);
           size_t n_floats = failed ? 0 : 3 * (size_t)meshreel_info_of(file)->n_verts;
           float *positions = malloc(n_floats * sizeof(float));
           failed = failed || meshreel_decode(decoder, 0, 0, 1, 0, &floats, positions, &error);
           if (failed) fprintf(stderr, "%s\n", error.message);
           else fwrite(positions, sizeof(float), n_floats, stdout);
           free(positions);
           meshreel_end(decoder);
           meshreel_close(file);
           return failed;
       } */

#ifndef MESHREEL_H
#define MESHREEL_H

#include <stddef.h>
#include <stdint.h>

#if defined(_WIN32) && defined(MESHREEL_BUILD)
#define MESHREEL_API __declspec(dllexport)
#elif defined(__GNUC__) && !defined(_WIN32)
#define MESHREEL_API __attribute__((visibility("default")))
#else
#define MESHREEL_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define MESHREEL_VERSION "0.1.0"
#define MESHREEL_ABI 1 /* changes whenever a function or structure below changes */

/* Return MESHREEL_ABI of the library that is running. */
MESHREEL_API uint32_t meshreel_abi(void);

enum meshreel_code {
    MESHREEL_OK = 0,
    MESHREEL_NO_MEMORY = 1,   /* `allocate` returned NULL */
    MESHREEL_TRUNCATED = 2,   /* the file ends too early */
    MESHREEL_CORRUPT = 3,     /* the file is damaged, or is not a .reel file */
    MESHREEL_INVALID = 4,     /* an argument is out of range */
    MESHREEL_UNSUPPORTED = 5, /* the file needs a newer build, or exceeds what this one reads */
    MESHREEL_METHOD = 6,      /* the file uses a method of the paper, which only Python decodes */
    MESHREEL_UNREADABLE = 7,  /* `read` of the source failed */
    MESHREEL_RANGE = 8,       /* a number exceeds float; decode to doubles */
    MESHREEL_LIMIT = 9,       /* decoding would exceed `memory_limit` */
    MESHREEL_SEGMENTS = 10    /* the file has several segments: open one of them */
};

typedef struct meshreel_error {
    int32_t code;
    uint32_t reserved;
    uint64_t offset; /* byte of the file at which the fault was detected; UINT64_MAX: unknown */
    /* MESHREEL_UNREADABLE: size of the range at `offset`; MESHREEL_LIMIT, MESHREEL_NO_MEMORY: bytes
       that would have been held */
    uint64_t size;
    const char *message; /* one sentence in English; valid as long as the library is loaded */
} meshreel_error;

/* The bytes of a file, in memory or behind a callback. They must not change while the file is in
   use. */
typedef struct meshreel_source {
    const void *bytes; /* the whole file, or NULL */
    uint64_t size;
    /* Used if `bytes` is NULL: copy `size` bytes from byte `offset` of the file to `to` and return
       0, or return another number to fail. Called on the thread that called the library. A host
       that fetches asynchronously may fail, fetch the range that `error` states, and call again. */
    int (*read)(void *user, uint64_t offset, void *to, size_t size);
    void *user;
    /* May be NULL. Called before a range is read in pieces, so that it can be fetched at once;
       fails as `read` does. */
    int (*announce)(void *user, uint64_t offset, uint64_t size);
} meshreel_source;

/* Memory and threads of the host program. `allocate` and `release` are only called on the thread
   that called the library. */
typedef struct meshreel_host {
    void *user;
    /* Return memory aligned to 64 bytes, or NULL. */
    void *(*allocate)(void *user, size_t size);
    void (*release)(void *user, void *memory, size_t size);
    /* Call task(shared, i) for each i in 0..n_tasks-1, on any threads and in any order, and return
       when all are done. NULL: tasks run on the calling thread. */
    void (*run)(void *user, void (*task)(void *shared, uint32_t i), void *shared,
                uint32_t n_tasks);
    uint32_t n_threads; /* number of threads that `run` uses; 0 and 1: work is not divided */
    uint32_t reserved;
    uint64_t memory_limit; /* limit of the bytes held by a file, and by each decoder; 0: 2 GiB */
} meshreel_host;

typedef struct meshreel_file meshreel_file;
typedef struct meshreel_decoder meshreel_decoder;

/* A UTF-8 text of `size` bytes, not terminated. */
typedef struct meshreel_text {
    const char *bytes;
    size_t size;
} meshreel_text;

/* Properties of a file, or of an open segment. For a file with several segments
   `error_bound_percent` and all counts but `n_frames` are 0, and `center`, `diagonal` and the codes
   from `number_bytes` to `order` are those of the first segment. */
typedef struct meshreel_info {
    meshreel_text name;
    double fps;     /* frames per second; 0: unknown */
    double start_s; /* time of the first frame, in seconds */
    /* Guaranteed bound of the displacement of any vertex from the original, in percent of
       `diagonal`; 0: none, or that positions are lossless. */
    double error_bound_percent;
    /* Center of the bounding box of all frames, in model units; segments may share the box of all
       of them. */
    double center[3];
    double diagonal; /* diagonal of that box; 1 if it is 0 */
    /* Bytes up to the end of the last complete block, or of the file; for a segment also counted
       from byte 0 of the file. */
    uint64_t size;
    uint32_t n_frames, n_verts, n_triangles;
    uint32_t n_faces;       /* polygons; n_triangles if all faces are triangles */
    uint32_t n_corners;     /* corners of all faces */
    uint32_t n_blocks;      /* blocks of frames that are decoded together */
    uint32_t longest_block; /* frames of the longest block */
    uint32_t n_tracks;      /* including the positions, which are track 0 */
    uint32_t number_bytes;  /* type of the original positions: 4: float, 8: double */
    uint32_t method;        /* 7: reel; 8: lossless; 9: grid; below: methods of the paper */
    uint32_t laplacian;     /* for methods of the paper */
    uint32_t order; /* preserved order: 0: of vertices and faces; 1: of vertices; 2: of neither */
    /* 0: the end of the file is missing or damaged; all blocks here are complete */
    uint32_t is_whole;
    uint32_t n_segments;   /* at least 1 */
    uint32_t n_cells;      /* 0: the mesh has faces only */
    uint32_t reserved;
    meshreel_error damage; /* why it is not whole */
} meshreel_info;

/* Parse the container of a file. The structures are copied; what they point to must remain valid.
   Files of the paper's methods can be opened to inspect their sections, but not decoded. */
MESHREEL_API int meshreel_open(const meshreel_source *source, const meshreel_host *host,
                               meshreel_file **file, meshreel_error *error);

/* Release a file, after its decoders. NULL is allowed. */
MESHREEL_API void meshreel_close(meshreel_file *file);

/* Return the properties of a file. Owned by the file. */
MESHREEL_API const meshreel_info *meshreel_info_of(const meshreel_file *file);

/* Return the times of the n_frames frames, in seconds, finite and ascending; `fps` is then the mean
   rate. NULL if they are evenly spaced: frame i is at start_s + i / fps. Owned by the file. */
MESHREEL_API const double *meshreel_times_of(const meshreel_file *file);

/* Return the frame that is shown at a time: the last one that is due, else frame 0. */
MESHREEL_API uint32_t meshreel_frame_at(const meshreel_file *file, double time_s);

/* ---- Segments ---- */

/* Frames are numbered across all segments of a file; in an open segment they begin at 0. */
typedef struct meshreel_segment {
    uint32_t first_frame; /* in the numbering of the file */
    uint32_t n_frames, n_verts, n_triangles;
    uint64_t offset, size; /* byte range of the segment, without the header of the file */
} meshreel_segment;

/* Describe segment `number` of 0..n_segments-1. */
MESHREEL_API int meshreel_segment_of(const meshreel_file *file, uint32_t number,
                                     meshreel_segment *segment);

/* Return the segment that contains a frame of 0..n_frames-1. */
MESHREEL_API uint32_t meshreel_segment_of_frame(const meshreel_file *file, uint32_t frame);

/* Open a segment as a separate file with one segment. All functions but this one apply to it, and
   its frames begin at 0. It uses the source and the host of `file`, which may be closed first. Also
   works for files with one segment. */
MESHREEL_API int meshreel_open_segment(const meshreel_file *file, uint32_t number,
                                       meshreel_file **segment, meshreel_error *error);

/* ---- Layout of the file ---- */

typedef struct meshreel_section {
    uint32_t id;
    uint32_t is_known;              /* whether this build knows it */
    uint64_t offset, size;          /* byte range of the whole section */
    uint64_t payload, payload_size; /* byte range of its payload */
} meshreel_section;

/* Describe the section at a byte of the file: `offset` 0 is the first one, section->offset +
   section->size the next. In an open segment these are its own sections. Verifies the checksum
   unless `check` is 0. Returns MESHREEL_INVALID after the last section. */
MESHREEL_API int meshreel_section_at(const meshreel_file *file, uint64_t offset, int check,
                                     meshreel_section *section, meshreel_error *error);

/* Describe a known section before the first block, `number` of 0, 1, ...; those of earlier segments
   that an open segment refers to come first. Returns MESHREEL_INVALID after the last. */
MESHREEL_API int meshreel_leading_of(const meshreel_file *file, uint32_t number,
                                     meshreel_section *section);

/* Byte range of a track in a block of frames. */
typedef struct meshreel_block {
    uint32_t first_frame, n_frames;
    uint64_t offset, size;
} meshreel_block;

/* Describe block `number` of 0..n_blocks-1; the byte range is that of one track, 0..n_tracks-1. */
MESHREEL_API int meshreel_block_of(const meshreel_file *file, uint32_t number, uint32_t track,
                                   meshreel_block *block);

/* Coding parameters of a track in a block. */
typedef struct meshreel_group {
    uint32_t key_block;     /* the block whose fields it refers to, or its own number */
    uint32_t n_modes;       /* 0: values are exact, or on a grid */
    uint64_t n_corrections; /* corrections of single values */
    double step;            /* quantization step of the fields, or of the grid, in diagonals */
} meshreel_group;

/* Read the coding parameters of a track in a block, without decoding it. Verifies its checksums
   unless `check` is 0, in which case only a few bytes of each section are read. For methods of the
   paper only n_modes is known. */
MESHREEL_API int meshreel_group_of(const meshreel_file *file, uint32_t number, uint32_t track,
                                   int check, meshreel_group *group, meshreel_error *error);

/* Return the block that contains a frame of 0..n_frames-1. */
MESHREEL_API uint32_t meshreel_block_of_frame(const meshreel_file *file, uint32_t frame);

/* ---- The mesh, shared by all frames ---- */

/* Decode the triangles and the vertex order, which decoders need. Does nothing when called again.
   No other thread may use the file meanwhile. */
MESHREEL_API int meshreel_read_mesh(meshreel_file *file, meshreel_error *error);

/* Return the n_triangles triangles as three vertices each, counterclockwise seen from the front if
   the original was; NULL before `meshreel_read_mesh`. Owned by the file. */
MESHREEL_API const uint32_t *meshreel_triangles(const meshreel_file *file);

/* Return the triangles in stored order, with vertices in stored order; `stored_vertices` receives
   the stored number of each of the n_verts vertices. Needed to decode methods of the paper. */
MESHREEL_API const int32_t *meshreel_stored_triangles(const meshreel_file *file,
                                                      const int32_t **stored_vertices);

/* Cells of a mesh, such as hexahedra: its faces are their surface. Types are those of VTK, and the
   nodes of all cells are vertices, concatenated, in the order of VTK. */
typedef struct meshreel_cells {
    uint32_t n_cells, n_nodes;
    const uint8_t *types;
    const uint32_t *nodes;
    const uint32_t *face_cells; /* cell of each of the n_faces faces */
} meshreel_cells;

/* Return the cells; NULL before `meshreel_read_mesh`, and if there are none. Owned by the file. */
MESHREEL_API const meshreel_cells *meshreel_cells_of(const meshreel_file *file);

#define MESHREEL_NONE UINT32_MAX

enum meshreel_domain {
    MESHREEL_VERTICES = 0,
    MESHREEL_FACES = 1,
    MESHREEL_CORNERS = 2,
    MESHREEL_CELLS = 3
};

/* Number types of attributes and tracks. */
enum meshreel_type {
    MESHREEL_FLOAT32 = 4,
    MESHREEL_FLOAT64 = 8,
    MESHREEL_UINT8 = 17,
    MESHREEL_UINT16 = 18,
    MESHREEL_UINT32 = 20,
    MESHREEL_UINT64 = 24,
    MESHREEL_INT8 = 33,
    MESHREEL_INT16 = 34,
    MESHREEL_INT32 = 36,
    MESHREEL_INT64 = 40
};

enum meshreel_attribute_kind { MESHREEL_UV = 0, MESHREEL_COLOR = 1, MESHREEL_OTHER = 2 };

/* Values that do not change over time. Colors are in sRGB (IEC 61966-2-1), their fourth number is
   opacity: floats in 0..1, integers in 0..255. Item i of the domain has row rows[i] of `values`, or row i
   if `rows` is NULL. */
typedef struct meshreel_attribute {
    meshreel_text name;
    uint32_t kind, domain, type;
    uint32_t width; /* numbers per row, 1..16 */
    uint32_t n_rows, n_items;
    /* 0: the file uses rows only to save space; logically each item has its own value */
    uint32_t is_indexed;
    uint32_t reserved;
    const void *values;  /* n_rows x width */
    const int32_t *rows; /* n_items, or NULL */
} meshreel_attribute;

typedef struct meshreel_groups {
    meshreel_text name; /* what the groups represent, such as "material" */
    uint32_t n_labels, reserved;
    const meshreel_text *labels;
    const int32_t *of_faces; /* label of each of the n_faces faces; -1: none */
} meshreel_groups;

/* A part: consecutive vertices and faces, after those of the previous part. */
typedef struct meshreel_part {
    meshreel_text name;
    uint32_t n_verts, n_faces;
} meshreel_part;

/* Texture slots of a material. */
enum meshreel_slot {
    MESHREEL_BASE_COLOR = 0,
    MESHREEL_METALLIC = 1,
    MESHREEL_ROUGHNESS = 2,
    MESHREEL_NORMAL = 3,
    MESHREEL_OCCLUSION = 4,
    MESHREEL_EMISSIVE = 5,
    MESHREEL_SLOTS = 6
};

typedef struct meshreel_texture {
    uint32_t image;    /* index of the image, or MESHREEL_NONE: no texture in this slot */
    uint32_t channels; /* bits 0 to 3: red, green, blue, alpha */
    uint32_t wrap_u, wrap_v; /* 0: repeat, 1: mirror, 2: clamp, 3: black, 4: defined by the image */
    uint32_t magnified, shrunk; /* 0: any, 1: nearest, 2: linear, 3 to 6: with mipmaps */
    meshreel_text uv;           /* name of the attribute with its texture coordinates */
    double offset[2], rotation, scale[2];
} meshreel_texture;

typedef struct meshreel_material {
    meshreel_text name;
    uint32_t alpha_mode; /* 0: opaque, 1: mask, 2: blend */
    uint32_t is_double_sided, is_unlit, reserved;
    double base_color[4], metallic, roughness, emissive[3]; /* colors are linear */
    double normal_scale, occlusion_strength, alpha_cutoff;
    meshreel_texture textures[MESHREEL_SLOTS];
} meshreel_material;

/* An image file: `size` bytes at byte `offset` of the .reel file. */
typedef struct meshreel_image {
    meshreel_text name, media_type;
    uint64_t offset, size;
} meshreel_image;

typedef struct meshreel_surface {
    /* Corners of each face, or NULL if all are triangles. A face with n corners is the next n - 2
       triangles. */
    const uint32_t *face_sizes;
    /* The face corner, numbered face by face, at each corner of the triangles; NULL if all faces
       are triangles: then corner i of the triangles is corner i of the faces. */
    const uint32_t *triangle_corners;
    const meshreel_attribute *attributes;
    const meshreel_groups *groups;
    const meshreel_part *parts;
    const meshreel_material *materials;
    const meshreel_image *images;
    /* Two vertices each; faces do not share normals across these edges. */
    const uint32_t *hard_edges;
    uint32_t n_attributes, n_groups, n_parts, n_materials, n_images, n_hard_edges;
} meshreel_surface;

/* Decode polygons, attributes, groups, parts, materials and hard edges, and the mesh if necessary;
   also the first frame, if attributes depend on positions. Does nothing when called again. No other thread may use the file meanwhile. */
MESHREEL_API int meshreel_read_surface(meshreel_file *file, meshreel_error *error);

/* Return the surface; NULL before `meshreel_read_surface`. Owned by the file. */
MESHREEL_API const meshreel_surface *meshreel_surface_of(const meshreel_file *file);

/* ---- Frames and tracks ---- */

enum meshreel_track_kind {
    MESHREEL_TRACK_OTHER = 0,
    MESHREEL_TRACK_VECTOR = 1,
    MESHREEL_TRACK_VELOCITY = 2,
    MESHREEL_TRACK_NORMAL = 3,
    MESHREEL_TRACK_COLOR = 4,
    MESHREEL_TRACK_UV = 5,
    MESHREEL_TRACK_SCALAR = 6
};

/* A quantity that changes over time. Colors are as those of attributes, or uint16 in 0..65535. */
typedef struct meshreel_track {
    meshreel_text name, unit; /* empty for positions */
    uint32_t kind, domain, type;
    uint32_t n_columns; /* numbers per value */
    uint32_t n_items;   /* values per frame */
    uint32_t coding;    /* docs/format.md, TRACK */
    uint32_t is_exact;  /* lossless */
    uint32_t reserved;
    /* Guaranteed bound of the error of a value relative to the original, in its unit, for normals
       in degrees; 0: none, or that the track is exact. An exact track has a bound if its values
       come from a lossy file. */
    double bound;
} meshreel_track;

/* Describe track `number`; 0 is the positions. */
MESHREEL_API int meshreel_track_of(const meshreel_file *file, uint32_t number,
                                   meshreel_track *track);

/* Fail with MESHREEL_LIMIT if the mesh, or all tracks of a block with one of the frames
   first..first+count-1, announce more than the memory limit allows. Reads only the headers of
   groups. Without it, decoding may fail after much work. `n_modes` as for `meshreel_load`. */
MESHREEL_API int meshreel_check(const meshreel_file *file, uint32_t first, uint32_t count,
                                uint32_t n_modes, meshreel_error *error);

/* Create a decoder for a file after `meshreel_read_mesh`. */
MESHREEL_API int meshreel_begin(const meshreel_file *file, meshreel_decoder **decoder,
                                meshreel_error *error);

/* Release a decoder. NULL is allowed. */
MESHREEL_API void meshreel_end(meshreel_decoder *decoder);

/* Load a track of a block unless the decoder holds it. This takes most of the time; decoding does
   it if necessary. With `n_modes` above 0, positions of the method `reel` are a preview: only the
   first n_modes modes move, further ones of the first 16 stay at their mean over the block, and
   corrections are omitted. */
MESHREEL_API int meshreel_load(meshreel_decoder *decoder, uint32_t track, uint32_t block,
                               uint32_t n_modes, meshreel_error *error);

/* Output layout: value i of frame t begins at byte t frame_stride + i value_stride. A stride of 0
   means packed. */
typedef struct meshreel_layout {
    uint32_t type; /* 0: the track's own; MESHREEL_FLOAT32 is allowed for a track of doubles */
    uint32_t reserved;
    size_t value_stride, frame_stride;
} meshreel_layout;

/* Decode frames first..first+count-1 of a track, to the same bits on every machine. Vertices, faces
   and corners are in the original order as far as `order` of the file preserves it. `n_modes` as
   for `meshreel_load`; a NULL `layout` means packed numbers of the track's type. `values` must be
   aligned to that type. */
MESHREEL_API int meshreel_decode(meshreel_decoder *decoder, uint32_t track, uint32_t first,
                                 uint32_t count, uint32_t n_modes, const meshreel_layout *layout,
                                 void *values, meshreel_error *error);

/* A track in a block as a sum of modes, for players that multiply on a graphics card. The number in
   column c of item i at frame t of the block is

       origin[c] + scale * (step * sum over k of values[rows[i] n_modes + k] *
                            basis[(c n_frames + t) n_modes + k])

   plus scale times its correction. Normals are not yet divided by their length. */
typedef struct meshreel_modes {
    uint32_t n_frames, n_modes, n_columns;
    uint32_t n_items;     /* items of the track, or fewer if corners share them */
    uint32_t has_missing; /* some numbers may be missing, which `meshreel_decode` returns as NaN */
    uint32_t reserved;
    double step, scale;
    const double *origin;  /* n_columns */
    const double *values;  /* n_items x n_modes, in quantization steps */
    const int32_t *rows;   /* n_items */
    const double *basis;   /* n_columns x n_frames x n_modes */
    const int32_t *shared; /* item of each of the track's values; NULL: value i is item i */
    /* Corrections of frame t are correction_starts[t] .. correction_starts[t + 1] - 1: items,
       ascending, with n_columns numbers each. NULL: none. */
    const int64_t *correction_starts;
    const int32_t *corrected;
    const double *corrections;
} meshreel_modes;

/* Load a track of a block and describe its modes; n_modes is 0 if it is not a sum of modes:
   lossless values, and values predicted from positions. The decoder owns the arrays until it loads
   another block of this track. */
MESHREEL_API int meshreel_modes_of(meshreel_decoder *decoder, uint32_t track, uint32_t block,
                                   meshreel_modes *modes, meshreel_error *error);

/* Compute vertex normals of length 1, or 0 where undefined: the area-weighted sum of the normals of
   adjacent triangles. `positions` and `normals` are n_verts x 3 packed numbers of `type`,
   MESHREEL_FLOAT32 or MESHREEL_FLOAT64. */
MESHREEL_API int meshreel_normals(meshreel_decoder *decoder, uint32_t type, const void *positions,
                                  void *normals, meshreel_error *error);

#ifdef __cplusplus
}
#endif

#endif
