/* Coding of a permutation of items along a graph: vertices along edges, or cells across sides, in
   the order in which a file lists them. docs/format.md, "ORDER", "Vertices". */

#ifndef REEL_ORDER_ITEMS_H
#define REEL_ORDER_ITEMS_H

#include "integers.h"
#include "ranks.h"

#define REEL_N_LEAP_CLASSES 10 /* classes of leap lengths */

/* Models of leaps: a shared one, and one for each class of the previous leap, `last`. */
typedef struct {
    reel_integer_model shared;
    reel_integer_model by_last[REEL_N_LEAP_CLASSES];
    int32_t last;
} reel_leap_model;

/* Initialize all models of an array or struct of reel_model: both bits are equally likely. */
void reel_reset_models(void *models, size_t size);

void reel_reset_leaps(reel_leap_model *model);

/* Code a leap in a nonempty ordered set: the number of members from `from` to `to`, cyclically.
   Return the target. */
int64_t reel_code_leap(reel_range_coder *coder, reel_leap_model *model, const reel_ranks *set,
                       int64_t from, int64_t to);

/* Items with neighbors: vertices of faces or cells, or cells that share sides. The neighbors of
   item i are near[starts[i]] .. near[starts[i + 1] - 1], in a defined order, with repetitions. */
typedef struct {
    int64_t n;
    int64_t *starts; /* n + 2 entries; the last is used during construction only */
    int32_t *near;
} reel_item_graph;

size_t reel_item_graph_bytes(int64_t n, int64_t n_near);

reel_item_graph reel_allocate_item_graph(reel_arena *arena, int64_t n, int64_t n_near);

size_t reel_item_coder_bytes(int64_t n);

/* Code the order in which the file lists the items: `sequence`, which the decoder fills. */
int64_t reel_code_items(reel_range_coder *coder, reel_arena arena, const reel_item_graph *graph,
                        int32_t *sequence);

/* Names of vertices: numbers in the order of their first use. */
typedef struct {
    int64_t n_verts;
    int32_t n_named;
    int32_t *name_of;   /* name of each vertex, or -1 */
    int32_t *vertex_of; /* vertex of each name */
} reel_vertex_names;

size_t reel_vertex_names_bytes(int64_t n_verts);

reel_vertex_names reel_start_names(reel_arena *arena, int64_t n_verts);

/* Return the name of a vertex. At its first use, a vertex gets the next name. */
int32_t reel_name_vertex(reel_vertex_names *names, int32_t vertex);

/* Name the vertices that were not used, in ascending order. */
void reel_name_unused(reel_vertex_names *names);

/* Code the order in which the file lists the vertices, `sequence`; `graph` has vertex names. */
int64_t reel_code_named(reel_range_coder *coder, reel_arena arena, const reel_item_graph *graph,
                        const reel_vertex_names *names, int32_t *sequence);

#endif
