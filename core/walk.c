/* The order of the traversal, and how each face changes the rings.

   docs/format.md, CONNECTIVITY, "The walk". The encoder knows the third point of each face; the
   decoder learns it through the functions of walk_codes.c, which both call in the same order. */

#include "walk.h"

static int stack_of(const reel_node *node) {
    int stack = node->remaining + 1 < REEL_STACKS ? node->remaining + 1 : REEL_STACKS - 1;
    stack = node->vertex == REEL_CAP ? 1 : stack;
    return node->remaining ? stack : 0;
}

static void push_node(reel_walk *walk, int32_t n) {
    reel_node *nodes = walk->nodes;
    int stack = stack_of(&nodes[n]);
    int32_t head = REEL_HEAD(stack), top = nodes[head].below;
    nodes[n].above = head;
    nodes[n].below = top;
    nodes[top].above = n;
    nodes[head].below = n;
    walk->filled |= 1U << stack;
}

static void remove_node(const reel_walk *walk, int32_t n) {
    const reel_node *node = &walk->nodes[n];
    walk->nodes[node->above].below = node->below;
    walk->nodes[node->below].above = node->above;
}

static void set_remaining(reel_walk *walk, int32_t n, int32_t remaining) {
    remove_node(walk, n);
    walk->nodes[n].remaining = remaining;
    push_node(walk, n);
}

/* Allocate a slot for a node, the last one freed first; fails if there are too many. */
static int32_t allocate_node(reel_walk *walk) {
    int32_t n = walk->free_slot;
    if (n != REEL_NONE) {
        walk->free_slot = walk->nodes[n].next;
        return n;
    }
    if (walk->n_nodes == walk->capacity) {
        walk->failed = true;
        return 0;
    }
    return walk->n_nodes++;
}

static void free_node(reel_walk *walk, int32_t n) {
    remove_node(walk, n);
    walk->nodes[n].degree = 0;
    walk->nodes[n].next = walk->free_slot;
    walk->free_slot = n;
}

static void link_nodes(reel_walk *walk, int32_t n, int32_t next) {
    walk->nodes[n].next = next;
    walk->nodes[next].prev = n;
}

/* Encoder: set the half-edge of a node. On a ring, -1 - node is stored as its twin. */
static void set_half_edge(reel_walk *walk, int32_t n, int32_t he) {
    if (reel_is_encoder(&walk->coder)) {
        walk->half_edge[n] = he;
        walk->surface.twin[he] = -1 - n;
    }
}

/* Encoder: the half-edge across the next or the previous edge of the face left of n's edge. */
static int32_t half_edge_behind(const reel_walk *walk, int32_t n, bool is_next) {
    if (!reel_is_encoder(&walk->coder)) {
        return REEL_NONE;
    }
    int32_t he = walk->half_edge[n];
    return walk->surface.twin[is_next ? reel_next_half_edge(he) : reel_previous_half_edge(he)];
}

/* A visited face a, b, c: whether it is flipped, and its half-edges between b and c, c and a. */
typedef struct {
    bool flipped;
    int32_t opposite, last;
} visited_face;

/* Make two half-edges twins, unless one is REEL_NONE. */
static void pair_twins(const reel_walk *walk, int32_t he, int32_t twin) {
    if (walk->twins && he != REEL_NONE && twin != REEL_NONE) {
        walk->twins[he] = twin;
        walk->twins[twin] = he;
    }
}

/* Add the face left of the edge from a to b, with third point c. */
static visited_face add_face(reel_walk *walk, int32_t a, int32_t b, int32_t c) {
    reel_node *nodes = walk->nodes;
    int32_t u = nodes[a].vertex, v = nodes[b].vertex, w = nodes[c].vertex;
    bool starts_part = walk->starts_part;
    walk->starts_part = false;
    if (u == REEL_CAP || v == REEL_CAP || w == REEL_CAP) {
        walk->n_closing++;
        walk->failed |= walk->n_closing > 3 * walk->n_faces;
        return (visited_face){nodes[a].flipped, REEL_NONE, REEL_NONE};
    }
    if (walk->n_visited == walk->n_faces) {
        walk->failed = true;
        return (visited_face){false, REEL_NONE, REEL_NONE};
    }
    bool flipped = reel_is_encoder(&walk->coder) && walk->surface.flipped[walk->half_edge[a] / 3];
    flipped = reel_code_flipped(walk, a, flipped);
    int32_t he = 3 * (int32_t)walk->n_visited++, *face = walk->faces + he;
    face[0] = u;
    face[1] = flipped ? w : v;
    face[2] = flipped ? v : w;
    int32_t first = flipped ? he + 2 : he;
    pair_twins(walk, first, nodes[a].behind);
    if (starts_part) {
        nodes[b].behind = first; /* both edges of the ring are the same edge */
    }
    return (visited_face){flipped, he + 1, flipped ? he : he + 2};
}

/* Record that the face n, m, c now lies behind the edges n to c and c to m. */
static void set_behind(reel_walk *walk, int32_t n, int32_t m, int32_t c, visited_face face) {
    reel_node *nodes = walk->nodes;
    int32_t to_c = half_edge_behind(walk, n, false), to_m = half_edge_behind(walk, n, true);
    set_half_edge(walk, n, to_c);
    set_half_edge(walk, c, to_m);
    nodes[c].across = nodes[n].degree;
    nodes[n].across = nodes[m].degree;
    nodes[c].flipped = nodes[n].flipped = face.flipped;
    nodes[c].behind = face.opposite;
    nodes[n].behind = face.last;
}

/* Create a node for a new point, not yet in a ring; n and m are as in `reel_code_degree`. */
static int32_t meet_point(reel_walk *walk, int32_t n, int32_t m, int32_t point) {
    int32_t vertex = REEL_CAP, degree = 0;
    if (reel_is_encoder(&walk->coder)) {
        vertex = walk->surface.vertex[point];
        degree = walk->surface.degree[point];
        walk->is_met[point] = 1;
    }
    /* Only the first point of a part may be a cap; the second also has n = NONE, but m is the
       first. */
    bool starts = n == REEL_NONE;
    bool cap = (!starts || m == REEL_NONE) &&
               reel_code_is_cap(walk, vertex == REEL_CAP, starts);
    if (cap) {
        vertex = REEL_CAP;
        degree = reel_code_cap_degree(walk, degree);
    } else {
        degree = reel_code_degree(walk, n, m, degree);
        vertex = walk->failed ? 0 : reel_code_vertex(walk, vertex);
    }
    int32_t result = walk->failed ? 0 : allocate_node(walk);
    if (!walk->failed) {
        walk->nodes[result] =
            (reel_node){.vertex = vertex, .degree = degree, .remaining = degree - 2, .across = 6,
                        .behind = REEL_NONE};
    }
    return result;
}

/* Add the face left of the edge from n to m whose third point is new. */
static void grow_to_point(reel_walk *walk, int32_t n, int32_t m, int32_t point) {
    reel_node *nodes = walk->nodes;
    int32_t u = meet_point(walk, n, m, point);
    if (walk->failed) {
        return;
    }
    set_behind(walk, n, m, u, add_face(walk, n, m, u));
    link_nodes(walk, n, u);
    link_nodes(walk, u, m);
    push_node(walk, u);
    set_remaining(walk, n, nodes[n].remaining - 1);
    set_remaining(walk, m, nodes[m].remaining - 1);
}

/* Add the face left of the edge from n to m whose third point is node w: its ring splits, or two
   rings merge. `share` of the remaining edges at w lie between its edges to n and to its next. */
static void grow_to_node(reel_walk *walk, int32_t n, int32_t m, int32_t w, int32_t share) {
    reel_node *nodes = walk->nodes;
    if (walk->failed || w == n || w == m || nodes[w].degree == 0 || nodes[w].remaining < 2) {
        walk->failed = true;
        return;
    }
    int32_t max_share = nodes[w].remaining - 2;
    uint32_t result = reel_code_count(&walk->coder, &walk->models->share, (uint32_t)share);
    walk->failed |= result > (uint32_t)max_share;
    visited_face face = {false, REEL_NONE, REEL_NONE};
    if (!walk->failed) {
        face = add_face(walk, n, m, w);
    }
    int32_t copy = walk->failed ? 0 : allocate_node(walk);
    if (walk->failed) {
        return;
    }
    nodes[copy] = nodes[w];
    link_nodes(walk, nodes[w].prev, copy);
    link_nodes(walk, copy, m);
    link_nodes(walk, n, w);
    set_behind(walk, n, m, copy, face);
    nodes[copy].remaining = max_share - (int32_t)result;
    push_node(walk, copy);
    set_remaining(walk, w, (int32_t)result);
    set_remaining(walk, n, nodes[n].remaining - 1);
    set_remaining(walk, m, nodes[m].remaining - 1);
}

/* Encoder: find the node at whose corner the half-edge `start` begins, and the number of edges
   between it and the edge to the next node. Searches from both ends, as degrees may be high. */
static int32_t find_node(const reel_walk *walk, int32_t start, int32_t *share) {
    const int32_t *twin = walk->surface.twin;
    int32_t back = start, ahead = reel_previous_half_edge(start);
    for (int32_t steps = 0;; steps++) {
        if (twin[back] < 0) {
            *share = steps - 1;
            return -1 - twin[back];
        }
        if (twin[ahead] < 0) {
            int32_t node = walk->nodes[-1 - twin[ahead]].next;
            *share = walk->nodes[node].remaining - steps - 1;
            return node;
        }
        back = reel_next_half_edge(twin[back]);
        ahead = reel_previous_half_edge(twin[ahead]);
    }
}

/* Add the face left of the edge from n to its next; both have remaining edges. */
static void grow(reel_walk *walk, int32_t n) {
    int32_t m = walk->nodes[n].next;
    int32_t point = REEL_NONE, target = REEL_NONE, share = 0;
    bool meets = false;
    if (reel_is_encoder(&walk->coder)) {
        int32_t third = reel_previous_half_edge(walk->half_edge[n]);
        point = walk->surface.point[third];
        meets = walk->is_met[point];
        if (meets) {
            target = find_node(walk, third, &share);
        }
    }
    if (reel_code_meets(walk, n, m, meets)) {
        target = reel_code_target(walk, n, m, target);
        grow_to_node(walk, n, m, target, share);
    } else {
        grow_to_point(walk, n, m, point);
    }
}

/* Add the last face at node n, between its ring neighbors. */
static void fill(reel_walk *walk, int32_t n) {
    reel_node *nodes = walk->nodes;
    int32_t prev = nodes[n].prev, next = nodes[n].next;
    bool last =
        nodes[next].next == prev && nodes[prev].remaining == 0 && nodes[next].remaining == 0;
    if (prev == next || (!last && (nodes[prev].remaining == 0 || nodes[next].remaining == 0))) {
        walk->failed = true;
        return;
    }
    visited_face face = add_face(walk, n, next, prev);
    pair_twins(walk, face.last, nodes[prev].behind);
    if (!last) {
        set_half_edge(walk, prev, half_edge_behind(walk, n, true));
        nodes[prev].across = nodes[n].degree;
        nodes[prev].flipped = face.flipped;
        nodes[prev].behind = face.opposite;
        link_nodes(walk, prev, next);
        set_remaining(walk, prev, nodes[prev].remaining - 1);
        set_remaining(walk, next, nodes[next].remaining - 1);
    } else {
        pair_twins(walk, face.opposite, nodes[next].behind);
        free_node(walk, prev);
        free_node(walk, next);
    }
    free_node(walk, n);
}

/* Start a part with a ring of two nodes: one edge, seen from both of its faces. */
static void start_part(reel_walk *walk, int32_t he) {
    int32_t twin = REEL_NONE, points[2] = {REEL_NONE, REEL_NONE};
    if (reel_is_encoder(&walk->coder)) {
        twin = walk->surface.twin[he];
        points[0] = walk->surface.point[he];
        points[1] = walk->surface.point[twin];
    }
    int32_t a = meet_point(walk, REEL_NONE, REEL_NONE, points[0]);
    int32_t b = walk->failed ? a : meet_point(walk, REEL_NONE, a, points[1]);
    if (walk->failed) {
        return;
    }
    walk->starts_part = true;
    link_nodes(walk, a, b);
    link_nodes(walk, b, a);
    set_half_edge(walk, a, he);
    set_half_edge(walk, b, twin);
    walk->nodes[a].remaining++; /* both ring edges are the same edge */
    walk->nodes[b].remaining++;
    push_node(walk, a);
    push_node(walk, b);
}

void reel_walk_part(reel_walk *walk, int32_t he) {
    start_part(walk, he);
    while (!walk->failed && walk->filled) {
        int stack = __builtin_ctz(walk->filled);
        int32_t n = walk->nodes[REEL_HEAD(stack)].below;
        if (n < 0) {
            walk->filled &= walk->filled - 1;
        } else if (stack == 0) {
            fill(walk, n);
        } else {
            grow(walk, n);
        }
    }
}
