/* A traversal of a surface, face by face: its state, and the functions that code its decisions.

   docs/format.md, CONNECTIVITY. The visited region of a part is bounded by rings of nodes. A node
   is a point between two consecutive edges of a ring; the corner between them is not yet visited.
   The degree of a point is coded when it is first met, so that a node knows how many of its edges
   remain, and most faces cost no bits. */

#ifndef REEL_WALK_H
#define REEL_WALK_H

#include "integers.h"
#include "surface.h"
#include "symbols.h"

#define REEL_NONE (-1)
#define REEL_CAP (-1) /* the vertex of a cap */
/* Stacks of nodes: complete, at a cap, then by remaining edges 1, 2, ... 10 or more. */
#define REEL_STACKS 12
#define REEL_HEAD(stack) (-1 - (stack)) /* index in `nodes` of the head of a stack */
#define REEL_FLANK_CLASSES 17   /* of the degrees around a new point, and of the start of a part */
#define REEL_EDGE_CONTEXTS 513  /* of the edge at which a point is met, and of a start */
#define REEL_RING_LENGTHS 10    /* lengths of a ring: 2 to 9 or more */
#define REEL_MEET_CONTEXTS 4096 /* of the edge at which rings may meet */

typedef struct {
    int32_t next; /* next in the ring; the visited region is on the left of the edge to it */
    int32_t prev;
    int32_t vertex;
    int32_t degree;       /* degree of the point; 0 for a free slot */
    int32_t remaining;    /* remaining edges between the two ring edges */
    int32_t across;       /* degree of the third point of the visited face at the edge to `next` */
    int32_t flipped;      /* is that face flipped? */
    int32_t behind;       /* its half-edge at this edge, in `faces`, or REEL_NONE */
    /* Neighbors in the stack, a ring that its head closes: `below` of the head is the top. */
    int32_t above, below;
} reel_node;

typedef struct {
    reel_symbol_model degree[REEL_FLANK_CLASSES], degree_by_edge[REEL_EDGE_CONTEXTS];
    reel_model meets[REEL_RING_LENGTHS], meets_by_nodes[REEL_MEET_CONTEXTS];
    reel_model is_cap, is_copy, starts_open, is_far, is_behind, flipped[2];
    reel_integer_model more_degree, cap_degree, offset, share, copy, amounts, corner[3];
} reel_walk_models;

typedef struct {
    reel_range_coder coder;
    bool failed;
    reel_walk_models *models;
    int64_t n_verts, n_faces;      /* of the mesh; n_faces without degenerate faces */
    int64_t n_numbered, n_visited; /* vertices numbered and faces visited so far */
    int64_t n_closing;             /* faces with a cap so far */
    int64_t n_caps;                /* caps not yet coded */
    bool has_flipped, pinched;
    int32_t last_copied; /* vertex of the last copy */
    int32_t *faces;      /* visited faces */
    int32_t *twins;      /* of their half-edges, or NULL */
    bool starts_part;    /* is the next face the first of a part? */
    reel_node *nodes;    /* the heads of the stacks lie before them */
    int32_t capacity;  /* capacity of `nodes` */
    int32_t n_nodes;   /* slots used so far */
    int32_t free_slot; /* free list of slots, linked by `next` */
    uint32_t filled;   /* one bit per stack: 0 if it is empty */
    /* Encoder only. */
    reel_surface surface;
    int32_t *half_edge; /* per node: the half-edge to its next, of an unvisited face */
    uint8_t *is_met;    /* per point: was it met? */
    int32_t *numbers;   /* internal number of each given vertex */
    int32_t *given;     /* its inverse */
} reel_walk;

/* Coded decisions: the encoder passes the actual value, and both sides get it back. */
void reel_reset_walk_models(reel_walk_models *models);
bool reel_code_flipped(reel_walk *walk, int32_t node, bool flipped);
bool reel_code_meets(reel_walk *walk, int32_t n, int32_t m, bool meets);
int32_t reel_code_target(reel_walk *walk, int32_t n, int32_t m, int32_t target);
bool reel_code_is_cap(reel_walk *walk, bool cap, bool starts);
int32_t reel_code_cap_degree(reel_walk *walk, int32_t degree);
int32_t reel_code_degree(reel_walk *walk, int32_t n, int32_t m, int32_t degree);
int32_t reel_code_vertex(reel_walk *walk, int32_t vertex);

/* Traverse one connected part of the surface; the encoder passes the half-edge to start from. */
void reel_walk_part(reel_walk *walk, int32_t he);

#endif
