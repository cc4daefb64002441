/* Reads .reel files frame by frame: for engines, viewers, and whatever else is written in C or C++.

   A file is open once its mesh is decoded; then it never changes, and any number of threads may use
   it. A decoder belongs to a file, and holds one block of frames; one thread uses it at a time. So
   a thread may load what comes next into one decoder while another draws from a second one.

   Nothing is allocated, and nothing has to be closed: whoever calls gives memory, of a size that
   `meshreel_inspect` states, keeps it as long as the file or the decoder is in use, and gives it
   back in its own way. Bytes may be hostile: no byte sequence makes a function crash, hang or step
   outside the memory that it was given. What it takes is stated before anything is decoded; a few
   bytes may state any amount, so compare it with what you want to spend before you get the memory:
   that is the limit on what a file may take. One block is decoded at once, never the whole file.

   Functions return MESHREEL_OK, or another `meshreel_code`; then whatever they should have filled
   holds anything, and the file or the decoder is as good as before.

   A library and a header of one MESHREEL_ABI fit each other. docs/guides/engines.md has examples. */

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

#define MESHREEL_VERSION "0.1.0" /* of meshreel */
#define MESHREEL_ABI 1           /* changes when a function or a structure below does */

enum meshreel_code {
    MESHREEL_OK = 0,
    MESHREEL_NO_MEMORY = 1,   /* less memory was given than is stated */
    MESHREEL_TRUNCATED = 2,   /* the bytes end too early */
    MESHREEL_CORRUPT = 3,     /* the bytes are damaged, or not those of a .reel file */
    MESHREEL_INVALID = 4,     /* an argument is out of its range */
    MESHREEL_UNSUPPORTED = 5, /* the file needs a newer build, or is larger than this one reads */
    MESHREEL_METHOD = 6,      /* it was encoded by a method of the paper, which Python decodes */
    MESHREEL_UNREADABLE = 7,  /* `read` of the source failed */
    MESHREEL_RANGE = 8        /* a position is beyond the numbers of float; ask for doubles */
};

/* What a code means, in a sentence. */
MESHREEL_API const char *meshreel_words(int code);

/* MESHREEL_ABI of the library that is running. */
MESHREEL_API uint32_t meshreel_abi(void);

/* Where the bytes of a file are: in memory, or behind a function. They must stay as they are, and
   be there, as long as the file is in use. */
typedef struct meshreel_source {
    const void *bytes; /* all of them, or NULL */
    uint64_t size;     /* how many they are */
    /* Without `bytes`: copies `size` bytes, from byte `offset` of the file on, to `to`, and returns
       0; or anything else if it cannot. Threads that use decoders at the same time call it at the
       same time. */
    int (*read)(void *user, uint64_t offset, void *to, size_t size);
    void *user;
} meshreel_source;

/* What is known of a file before it is opened. */
typedef struct meshreel_info {
    uint64_t file_bytes;    /* memory that `meshreel_open` needs; may be any amount: compare it */
    uint64_t decoder_bytes; /* memory that each decoder needs; likewise */
    double fps;             /* frames per second; 0: not known */
    double start_s;         /* time of the first frame, in seconds */
    double promise_percent; /* no vertex is displaced by more, in percent of `diagonal`; 0: no promise */
    double centre[3];       /* of the bounding box of all frames, in model units */
    double diagonal;        /* of that box */
    uint32_t n_frames, n_verts, n_triangles;
    uint32_t n_blocks;      /* stretches of frames that are decoded together */
    uint32_t longest_block; /* frames of the longest one */
    uint32_t n_tracks;      /* values over time beside the positions, which this library skips */
    uint32_t number_bytes;  /* 4: positions came as float, 8: as double */
    uint32_t method;        /* 7: reel; 8: lossless; 9: grid */
    uint32_t order;         /* kept: 0: of vertices and triangles, 1: of vertices, 2: of neither */
    uint32_t is_whole;      /* 0: writing was stopped, or the end was lost; all frames here are whole */
    uint64_t reserved[4];   /* 0 */
} meshreel_info;

/* Reads what a file says of itself, and how much memory it takes to open and decode it. Blocks are
   not decoded; how long this takes grows with their number. */
MESHREEL_API int meshreel_inspect(const meshreel_source *source, meshreel_info *info);

typedef struct meshreel_file meshreel_file;
typedef struct meshreel_decoder meshreel_decoder;

/* Opens a file in `size` bytes of memory, at least `file_bytes`. The source is copied. */
MESHREEL_API int meshreel_open(const meshreel_source *source, void *memory, size_t size,
                               const meshreel_file **file);

/* What `meshreel_inspect` said of it. */
MESHREEL_API const meshreel_info *meshreel_info_of(const meshreel_file *file);

/* The triangles: n_triangles times three vertices, the same in all frames, front faces anti-
   clockwise if they came so. They are part of the file's memory. */
MESHREEL_API const uint32_t *meshreel_triangles(const meshreel_file *file);

/* The block that a frame belongs to: its first frame, and how many frames it has. */
MESHREEL_API int meshreel_block_of(const meshreel_file *file, uint32_t frame, uint32_t *first,
                                   uint32_t *n_frames);

/* Begins a decoder of a file in `size` bytes of memory, at least `decoder_bytes`. */
MESHREEL_API int meshreel_begin(const meshreel_file *file, void *memory, size_t size,
                                meshreel_decoder **decoder);

/* Loads the block of a frame, unless the decoder holds it: this is what takes time, and is best
   done ahead. `meshreel_decode` does it where it was not done. */
MESHREEL_API int meshreel_load(meshreel_decoder *decoder, uint32_t frame);

/* The positions of a frame: x, y and z of each vertex, 3 n_verts numbers in model units, the same
   bits on every machine. In the order of the vertices that were encoded unless `order` is 2. */
MESHREEL_API int meshreel_decode(meshreel_decoder *decoder, uint32_t frame, float *positions);

/* The same of a file of doubles. */
MESHREEL_API int meshreel_decode_doubles(meshreel_decoder *decoder, uint32_t frame,
                                         double *positions);

/* Normals at the vertices of such positions, of length 1; or 0 where the surface has none: the sum of
   those of the triangles around, by their area. */
MESHREEL_API int meshreel_normals(meshreel_decoder *decoder, const float *positions,
                                  float *normals);

#ifdef __cplusplus
}
#endif

#endif
