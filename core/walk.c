/* The order of a walk, and what a face changes in the rings.

   docs/format.md, CONNECTIVITY, "The walk". The writer knows each third point; the reader is told
   it by the functions of walk_codes.c, which both call in the same order. */

#include "walk.h"

static int bucket_of(const reel_node *node) {
    if (node->free == 0) {
        return 0;
    }
    if (node->vertex == REEL_CAP) {
        return 1;
    }
    return node->free + 1 < REEL_BUCKETS ? node->free + 1 : REEL_BUCKETS - 1;
}

static void file_node(reel_walk *walk, int32_t n) {
    reel_node *node = &walk->nodes[n];
    int32_t *top = &walk->top[bucket_of(node)];
    node->above = REEL_NONE;
    node->below = *top;
    if (*top != REEL_NONE) {
        walk->nodes[*top].above = n;
    }
    *top = n;
}

static void unfile_node(reel_walk *walk, int32_t n) {
    const reel_node *node = &walk->nodes[n];
    if (node->above == REEL_NONE) {
        walk->top[bucket_of(node)] = node->below;
    } else {
        walk->nodes[node->above].below = node->below;
    }
    if (node->below != REEL_NONE) {
        walk->nodes[node->below].above = node->above;
    }
}

static void set_free(reel_walk *walk, int32_t n, int32_t free) {
    unfile_node(walk, n);
    walk->nodes[n].free = free;
    file_node(walk, n);
}

/* A number for a node, the last that became free; `failed` where there are too many. */
static int32_t take_number(reel_walk *walk) {
    int32_t n = walk->spare;
    if (n != REEL_NONE) {
        walk->spare = walk->nodes[n].next;
        return n;
    }
    if (walk->n_nodes == walk->room) {
        walk->failed = true;
        return 0;
    }
    return walk->n_nodes++;
}

static void drop_node(reel_walk *walk, int32_t n) {
    unfile_node(walk, n);
    walk->nodes[n].degree = 0;
    walk->nodes[n].next = walk->spare;
    walk->spare = n;
}

static void link_nodes(reel_walk *walk, int32_t n, int32_t next) {
    walk->nodes[n].next = next;
    walk->nodes[next].prev = n;
}

/* The writer's side of a node; the twin of a side on a ring is its node, as -1 - node. */
static void set_side(reel_walk *walk, int32_t n, int32_t side) {
    if (reel_writes(&walk->port)) {
        walk->side[n] = side;
        walk->surface.twin[side] = -1 - n;
    }
}

/* The sides behind the other two edges of the face that is on the left of the edge from n. */
static int32_t side_behind(const reel_walk *walk, int32_t n, bool after) {
    if (!reel_writes(&walk->port)) {
        return REEL_NONE;
    }
    int32_t side = walk->side[n];
    return walk->surface.twin[after ? reel_side_after(side) : reel_side_before(side)];
}

/* The face on the left of the edge from a to b, whose third point is c; is it turned over? */
static bool add_face(reel_walk *walk, int32_t a, int32_t b, int32_t c) {
    const reel_node *nodes = walk->nodes;
    int32_t u = nodes[a].vertex, v = nodes[b].vertex, w = nodes[c].vertex;
    if (u == REEL_CAP || v == REEL_CAP || w == REEL_CAP) {
        walk->n_closing++;
        walk->failed |= walk->n_closing > 3 * walk->n_faces;
        return nodes[a].turned;
    }
    if (walk->n_done == walk->n_faces) {
        walk->failed = true;
        return false;
    }
    bool turned = reel_writes(&walk->port) && walk->surface.turned[walk->side[a] / 3];
    turned = reel_code_turned(walk, a, turned);
    int32_t *face = walk->faces + 3 * walk->n_done++;
    face[0] = u;
    face[1] = turned ? w : v;
    face[2] = turned ? v : w;
    return turned;
}

/* Behind the edges n to c and c to m there is now the face n, m, c. */
static void set_behind(reel_walk *walk, int32_t n, int32_t m, int32_t c, bool turned) {
    reel_node *nodes = walk->nodes;
    int32_t to_c = side_behind(walk, n, false), to_m = side_behind(walk, n, true);
    set_side(walk, n, to_c);
    set_side(walk, c, to_m);
    nodes[c].across = nodes[n].degree;
    nodes[n].across = nodes[m].degree;
    nodes[c].turned = nodes[n].turned = turned;
}

/* A node, in no ring yet, for a point that is first met; n and m are as in `reel_code_degree`. */
static int32_t meet_point(reel_walk *walk, int32_t n, int32_t m, int32_t point) {
    int32_t vertex = REEL_CAP, degree = 0;
    if (reel_writes(&walk->port)) {
        vertex = walk->surface.vertex[point];
        degree = walk->surface.degree[point];
        walk->met[point] = 1;
    }
    /* Only the first point of a part starts an open one; the second follows n = m = NONE, too. */
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
    int32_t found = walk->failed ? 0 : take_number(walk);
    if (!walk->failed) {
        walk->nodes[found] =
            (reel_node){.vertex = vertex, .degree = degree, .free = degree - 2, .across = 6};
    }
    return found;
}

/* The face on the left of the edge from n to m reaches a point that is first met. */
static void grow_to_point(reel_walk *walk, int32_t n, int32_t m, int32_t point) {
    reel_node *nodes = walk->nodes;
    int32_t u = meet_point(walk, n, m, point);
    if (walk->failed) {
        return;
    }
    set_behind(walk, n, m, u, add_face(walk, n, m, u));
    link_nodes(walk, n, u);
    link_nodes(walk, u, m);
    file_node(walk, u);
    set_free(walk, n, nodes[n].free - 1);
    set_free(walk, m, nodes[m].free - 1);
}

/* The face on the left of the edge from n to m reaches node w: its ring becomes two, or two one.
   `share` edges to come at w are between those to n and to its next. */
static void grow_to_ring(reel_walk *walk, int32_t n, int32_t m, int32_t w, int32_t share) {
    reel_node *nodes = walk->nodes;
    if (walk->failed || w == n || w == m || nodes[w].degree == 0 || nodes[w].free < 2) {
        walk->failed = true;
        return;
    }
    int32_t most = nodes[w].free - 2;
    uint32_t found = reel_code_count(&walk->port, &walk->models->share, (uint32_t)share);
    walk->failed |= found > (uint32_t)most;
    bool turned = !walk->failed && add_face(walk, n, m, w);
    int32_t copy = walk->failed ? 0 : take_number(walk);
    if (walk->failed) {
        return;
    }
    nodes[copy] = nodes[w];
    link_nodes(walk, nodes[w].prev, copy);
    link_nodes(walk, copy, m);
    link_nodes(walk, n, w);
    set_behind(walk, n, m, copy, turned);
    nodes[copy].free = most - (int32_t)found;
    file_node(walk, copy);
    set_free(walk, w, (int32_t)found);
    set_free(walk, n, nodes[n].free - 1);
    set_free(walk, m, nodes[m].free - 1);
}

/* Writer: the node in whose corner the side `start` begins, and how many edges are there between
   those of the side and to the node's next. From both ends, so that hubs take no long time. */
static int32_t find_node(const reel_walk *walk, int32_t start, int32_t *share) {
    const int32_t *twin = walk->surface.twin;
    int32_t back = start, ahead = reel_side_before(start);
    for (int32_t steps = 0;; steps++) {
        if (twin[back] < 0) {
            *share = steps - 1;
            return -1 - twin[back];
        }
        if (twin[ahead] < 0) {
            int32_t node = walk->nodes[-1 - twin[ahead]].next;
            *share = walk->nodes[node].free - steps - 1;
            return node;
        }
        back = reel_side_after(twin[back]);
        ahead = reel_side_before(twin[ahead]);
    }
}

/* The face on the left of the edge from n to its next, where both have edges to come. */
static void grow(reel_walk *walk, int32_t n) {
    int32_t m = walk->nodes[n].next;
    int32_t point = REEL_NONE, target = REEL_NONE, share = 0;
    bool meets = false;
    if (reel_writes(&walk->port)) {
        int32_t third = reel_side_before(walk->side[n]);
        point = walk->surface.point[third];
        meets = walk->met[point];
        if (meets) {
            target = find_node(walk, third, &share);
        }
    }
    if (reel_code_meets(walk, n, m, meets)) {
        target = reel_code_target(walk, n, m, target);
        grow_to_ring(walk, n, m, target, share);
    } else {
        grow_to_point(walk, n, m, point);
    }
}

/* The one face that is to come at node n: between its neighbours. */
static void fill(reel_walk *walk, int32_t n) {
    reel_node *nodes = walk->nodes;
    int32_t prev = nodes[n].prev, next = nodes[n].next;
    bool last = nodes[next].next == prev && nodes[prev].free == 0 && nodes[next].free == 0;
    if (prev == next || (!last && (nodes[prev].free == 0 || nodes[next].free == 0))) {
        walk->failed = true;
        return;
    }
    bool turned = add_face(walk, n, next, prev);
    if (!last) {
        set_side(walk, prev, side_behind(walk, n, true));
        nodes[prev].across = nodes[n].degree;
        nodes[prev].turned = turned;
        link_nodes(walk, prev, next);
        set_free(walk, prev, nodes[prev].free - 1);
        set_free(walk, next, nodes[next].free - 1);
    } else {
        drop_node(walk, prev);
        drop_node(walk, next);
    }
    drop_node(walk, n);
}

/* A ring of two nodes: the edge of a side, seen from both its faces. */
static void start_part(reel_walk *walk, int32_t side) {
    int32_t other = REEL_NONE, points[2] = {REEL_NONE, REEL_NONE};
    if (reel_writes(&walk->port)) {
        other = walk->surface.twin[side];
        points[0] = walk->surface.point[side];
        points[1] = walk->surface.point[other];
    }
    int32_t a = meet_point(walk, REEL_NONE, REEL_NONE, points[0]);
    int32_t b = walk->failed ? a : meet_point(walk, REEL_NONE, a, points[1]);
    if (walk->failed) {
        return;
    }
    link_nodes(walk, a, b);
    link_nodes(walk, b, a);
    set_side(walk, a, side);
    set_side(walk, b, other);
    walk->nodes[a].free++; /* both edges of the ring are one */
    walk->nodes[b].free++;
    file_node(walk, a);
    file_node(walk, b);
}

void reel_walk_part(reel_walk *walk, int32_t side) {
    start_part(walk, side);
    while (!walk->failed) {
        int bucket = 0;
        while (bucket < REEL_BUCKETS && walk->top[bucket] == REEL_NONE) {
            bucket++;
        }
        if (bucket == REEL_BUCKETS) {
            return;
        }
        if (bucket == 0) {
            fill(walk, walk->top[0]);
        } else {
            grow(walk, walk->top[bucket]);
        }
    }
}
