/* A walk over a surface, face by face: what is known on the way, and what is coded.

   docs/format.md, CONNECTIVITY. The part of the surface that is done is bounded by rings of
   nodes. A node is a point between two edges of a ring; the corner between them is not done. The
   degree of a point is coded when it is first met, so that a node knows how many edges are still
   to come there, and most faces are known without a bit. */

#ifndef REEL_WALK_H
#define REEL_WALK_H

#include "integers.h"
#include "mixer.h"
#include "surface.h"

#define REEL_NONE (-1)
#define REEL_CAP (-1)       /* the vertex of a point that is none */
#define REEL_BUCKETS 12     /* nodes by what is to come: nothing, at a cap, 1, 2, ... 10 or more */
#define REEL_DECISIONS 15   /* bits of a degree that have models */
#define REEL_MODELLED 16    /* greatest degree that they tell */
#define REEL_OPINIONS 7     /* contexts of a degree */
#define REEL_CONTEXTS (4 + 3 * 512 + 4096 + 256 + 1024)
#define REEL_MEETS 3        /* contexts of whether rings meet */

typedef struct {
    int32_t next; /* in the ring: the edge to it is on the left of what is done, seen outwards */
    int32_t prev;
    int32_t vertex;
    int32_t degree; /* of the point; 0 of a number that is no node now */
    int32_t free;   /* edges to come, between the two of the ring */
    int32_t across; /* degree of the third point of the face that is done at the edge to `next` */
    int32_t turned; /* is that face turned over? */
    int32_t above, below; /* in the bucket */
} reel_node;

typedef struct {
    reel_odds_table odds;
    reel_model degree[REEL_CONTEXTS * REEL_DECISIONS];
    reel_weights degree_weights[REEL_DECISIONS];
    reel_model meets[16 + 512 + 4096];
    reel_weights meets_weights;
    reel_model is_cap, is_copy, starts_open, is_far, is_behind, turned[2];
    reel_integer_model more_degree, cap_degree, offset, share, copy, amounts, corner[3];
} reel_walk_models;

typedef struct {
    reel_port port;
    bool failed;
    reel_walk_models *models;
    int64_t n_verts, n_faces; /* of the mesh; n_faces without degenerate ones */
    int64_t n_named, n_done;  /* of those, so far */
    int64_t n_closing;        /* faces with a cap so far */
    int64_t n_caps;           /* still to come */
    bool turns, pinched;
    int32_t copied;   /* vertex that the last copy was of */
    int32_t last[2];  /* degrees of the last two points, the last first */
    int32_t *faces;   /* that are done */
    reel_node *nodes;
    int32_t room;     /* nodes there is memory for */
    int32_t n_nodes;  /* numbers given out so far */
    int32_t spare;    /* the last number that is no node any more; others follow by `next` */
    int32_t top[REEL_BUCKETS];
    /* What only the writer knows. */
    reel_surface surface;
    int32_t *side;  /* of each node: the side from it to its next, of a face that is not done */
    uint8_t *met;   /* of each point */
    int32_t *name;  /* of each given vertex: its number */
    int32_t *given; /* the inverse */
} reel_walk;

/* Things that are coded; the writer passes what is so, and both sides get it back. */
void reel_start_walk_models(reel_walk_models *models);
bool reel_code_turned(reel_walk *walk, int32_t behind, bool turned);
bool reel_code_meets(reel_walk *walk, int32_t n, int32_t m, bool meets);
int32_t reel_code_target(reel_walk *walk, int32_t n, int32_t m, int32_t target);
bool reel_code_is_cap(reel_walk *walk, bool cap, bool starts);
int32_t reel_code_cap_degree(reel_walk *walk, int32_t degree);
int32_t reel_code_degree(reel_walk *walk, int32_t n, int32_t m, int32_t degree);
int32_t reel_code_vertex(reel_walk *walk, int32_t vertex);

/* One connected part of the surface; the writer says from which side. */
void reel_walk_part(reel_walk *walk, int32_t side);

#endif
