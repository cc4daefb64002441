/* The faces of a mesh, as a walk over its surface that names a vertex when it first meets one.

   docs/format.md, CONNECTIVITY. The part of the surface that is done is bounded by rings of nodes.
   A node knows how many edges of its point into the part that is not done are still to come, for
   the degree of a point is coded when it is first met. So most faces are known without a bit:
   what is coded is the degree of each point, and where a ring meets another, or itself. */

#include "integers.h"
#include "mixer.h"
#include "surface.h"

#define NONE (-1)
#define CAP (-1) /* the vertex of a point that is none */
#ifndef BUCKETS
#define BUCKETS 12
#endif
#define NEAR 24 /* nodes that are looked at before a meeting point is named by its number */
#define DECISIONS 16
#define OPINIONS 7
#define MEETING 3

typedef struct {
    int32_t next;   /* in the ring; the edge to it bounds a face that is not done, on its left */
    int32_t prev;
    int32_t vertex;
    int32_t degree; /* of its point */
    int32_t free;   /* edges to come between those to `prev` and `next` */
    int32_t across; /* degree of the third point of the face that is done, behind the edge to `next` */
    int32_t above, below; /* in its bucket */
} reel_node;

typedef struct {
    reel_odds_table odds;
    reel_model degree[OPINIONS][4096 * DECISIONS];
    reel_weights degree_weights[DECISIONS];
    reel_model meets[MEETING][4096];
    reel_weights meets_weights;
    reel_model is_cap, is_copy, starts_open, is_far, is_behind;
    reel_model turned[8];
    reel_integer_model high_degree, cap_degree, offset, share, copy, counts, corner[3];
} reel_walk_models;

typedef struct {
    reel_port port;
    reel_walk_models *models;
    reel_node *nodes;
    int32_t *side;    /* writer: of each node, the side to the next node, in a face to be done */
    int32_t room;     /* nodes there is memory for */
    int32_t n_nodes;  /* numbers given out so far */
    int32_t spare;    /* numbers that are free again, a list through `next` */
    int32_t top[BUCKETS];
    int32_t last[3];  /* degrees of the last points */
    int64_t n_verts, n_faces;
    int64_t n_named, n_done, n_closing, n_caps;
    bool turns, pinched;
    int32_t copied;   /* vertex that the last copy was of */
    int32_t *faces;   /* out */
    reel_surface surface; /* writer */
    int32_t *name;    /* writer: internal number of each vertex, or NONE */
    uint8_t *met;     /* writer: of each point */
    int32_t *given;   /* writer: the inverse of `name` */
    bool failed;
#ifdef STATS
    int64_t n_splits, n_far; double bits[8];
#endif
} reel_walk;

static int32_t bucket_of(const reel_node *node) {
    if (node->free == 0) {
        return 0;
    }
#ifndef CAPLAST
    if (node->vertex == CAP) {
        return 1;
    }
#endif
    return node->free + 1 < BUCKETS ? node->free + 1 : BUCKETS - 1;
}

static void file_node(reel_walk *walk, int32_t n) {
    reel_node *node = &walk->nodes[n];
    int32_t *top = &walk->top[bucket_of(node)];
    node->below = *top;
    node->above = NONE;
    if (*top != NONE) {
        walk->nodes[*top].above = n;
    }
    *top = n;
}

static void unfile_node(reel_walk *walk, int32_t n) {
    reel_node *node = &walk->nodes[n];
    if (node->above == NONE) {
        walk->top[bucket_of(node)] = node->below;
    } else {
        walk->nodes[node->above].below = node->below;
    }
    if (node->below != NONE) {
        walk->nodes[node->below].above = node->above;
    }
}

static void set_free(reel_walk *walk, int32_t n, int32_t free) {
    unfile_node(walk, n);
    walk->nodes[n].free = free;
    file_node(walk, n);
}

static int32_t new_node(reel_walk *walk) {
    int32_t n = walk->spare;
    if (n != NONE) {
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
    walk->nodes[n].degree = 0; /* of no point: the number is free */
    walk->nodes[n].next = walk->spare;
    walk->spare = n;
}

static void link_nodes(reel_walk *walk, int32_t n, int32_t next) {
    walk->nodes[n].next = next;
    walk->nodes[next].prev = n;
}

/* The writer's side of a node, known to its twin as a side that is done up to there. */
static void set_side(reel_walk *walk, int32_t n, int32_t side) {
    if (walk->port.writes) {
        walk->side[n] = side;
        walk->surface.twin[side] = -1 - n;
    }
}

/* A face of which nothing but its third point was unknown. */
static void add_face(reel_walk *walk, int32_t a, int32_t b, int32_t c) {
    const reel_node *nodes = walk->nodes;
    int32_t u = nodes[a].vertex, v = nodes[b].vertex, w = nodes[c].vertex;
    if (u == CAP || v == CAP || w == CAP) {
        walk->n_closing++;
        walk->failed |= walk->n_closing > 3 * walk->n_faces;
        return;
    }
    if (walk->n_done >= walk->n_faces) {
        walk->failed = true;
        return;
    }
    if (walk->turns) {
        int turned = 0;
        if (walk->port.writes) {
            turned = walk->surface.turned[walk->side[a] / 3];
        }
        if (reel_bit(&walk->port, &walk->models->turned[0], turned)) {
            int32_t x = v;
            v = w;
            w = x;
        }
    }
    int32_t *face = walk->faces + 3 * walk->n_done++;
    face[0] = u;
    face[1] = v;
    face[2] = w;
}

/* Classes of degrees, and of edges to come: 0..7. */
static uint32_t degree_class(const reel_node *node) {
    if (node->vertex == CAP) {
        return 7;
    }
    return node->degree < 4 ? 0 : node->degree > 9 ? 6 : (uint32_t)node->degree - 3;
}
static uint32_t plain_class(int32_t degree) {
    return degree < 4 ? 0 : degree > 9 ? 6 : (uint32_t)degree - 3;
}
static uint32_t free_class(int32_t free) { return free > 7 ? 7 : (uint32_t)free; }

static int32_t code_degree(reel_walk *walk, const uint32_t *contexts, int32_t degree) {
    reel_walk_models *m = walk->models;
    reel_model *row[OPINIONS];
    for (int i = 0; i < OPINIONS; i++) {
        row[i] = &m->degree[i][contexts[i] * DECISIONS];
    }
    reel_model *here[OPINIONS];
#define DECIDE(which, bit)                                                                       \
    (reel_mixed_bit(&walk->port, &m->odds, &m->degree_weights[which],                            \
                    (for_decision(here, row, which), here), OPINIONS, bit))
#define for_decision(here, row, which) (here[0]=row[0]+which,here[1]=row[1]+which,here[2]=row[2]+which,here[3]=row[3]+which,here[4]=row[4]+which,here[5]=row[5]+which,here[6]=row[6]+which)
    if (DECIDE(0, degree == 6)) {
        return 6;
    }
    if (DECIDE(1, degree < 6)) {
        for (int32_t d = 5; d > 2; d--) {
            if (DECIDE(7 - d, degree == d)) {
                return d;
            }
        }
        return 2;
    }
    for (int32_t d = 7; d < 17; d++) {
        int which = d - 2 < DECISIONS ? d - 2 : DECISIONS - 1;
        if (DECIDE(which, degree == d)) {
            return d;
        }
    }
    uint32_t more = reel_code_count(&walk->port, &m->high_degree, (uint32_t)(degree - 17));
    if (more > INT32_MAX / 2) {
        walk->failed = true;
        return 6;
    }
    return 17 + (int32_t)more;
}

/* The vertex of a point that is no cap, when it is first met. */
static int32_t code_vertex(reel_walk *walk, int32_t point) {
    int32_t known = NONE, vertex = NONE;
    if (walk->port.writes) {
        vertex = walk->surface.vertex[point];
        known = walk->name[vertex];
    }
    if (walk->pinched && reel_bit(&walk->port, &walk->models->is_copy, known != NONE)) {
        int32_t back = reel_code_integer(&walk->port, &walk->models->copy, known - walk->copied);
        int64_t found = (int64_t)walk->copied + back;
        if (found < 0 || found >= walk->n_named) {
            walk->failed = true;
            return 0;
        }
        walk->copied = (int32_t)found;
        return (int32_t)found;
    }
    if (walk->n_named >= walk->n_verts) {
        walk->failed = true;
        return 0;
    }
    if (walk->port.writes) {
        walk->name[vertex] = (int32_t)walk->n_named;
        walk->given[walk->n_named] = vertex;
    }
    return (int32_t)walk->n_named++;
}

/* A node for a point that is first met; `n` and `m` are nodes it has edges with, or NONE. */
static int32_t code_point(reel_walk *walk, int32_t n, int32_t m, int32_t point, bool cap) {
    reel_walk_models *models = walk->models;
    int32_t degree = 0;
    if (walk->port.writes) {
        degree = walk->surface.degree[point];
        walk->met[point] = 1;
    }
    int32_t vertex = CAP;
    if (cap) {
        walk->n_caps--;
        degree = 2 + (int32_t)reel_code_count(&walk->port, &models->cap_degree, (uint32_t)(degree - 2));
        if (degree < 2 || degree > 3 * walk->n_faces) {
            walk->failed = true;
            degree = 2;
        }
    } else {
        uint32_t l1 = plain_class(walk->last[0]), l2 = plain_class(walk->last[1]), l3 = plain_class(walk->last[2]);
        uint32_t c[OPINIONS] = {0};
        c[0] = 3;
        if (m != NONE) {
            const reel_node *N = &walk->nodes[n], *M = &walk->nodes[m];
            const reel_node *P = &walk->nodes[N->prev], *Q = &walk->nodes[M->next];
            uint32_t dn = degree_class(N), dm = degree_class(M), y = plain_class(N->across);
            uint32_t fn = free_class(N->free), fm = free_class(M->free);
            uint32_t dp = degree_class(P), dq = degree_class(Q);
            c[0] = N->vertex == CAP ? 1 : M->vertex == CAP ? 2 : 0;
            c[1] = dn * 64 + dm * 8 + y;
            c[2] = fn * 64 + fm * 8 + y;
            c[3] = l1 * 64 + l2 * 8 + l3;
            c[4] = dp * 512 + dn * 64 + dm * 8 + dq;
            c[5] = fn * 64 + fm * 8 + l1;
            c[6] = dn * 512 + dm * 64 + fn * 8 + fm;
        }
        degree = code_degree(walk, c, degree);
        walk->last[2] = walk->last[1];
        walk->last[1] = walk->last[0];
        walk->last[0] = degree;
        vertex = code_vertex(walk, point);
    }
    int32_t found = new_node(walk);
    reel_node *node = &walk->nodes[found];
    node->vertex = vertex;
    node->degree = degree;
    node->free = degree - 2;
    return found;
}

/* Names the node at which the face behind n, m meets a ring. */
static int32_t code_meeting(reel_walk *walk, int32_t n, int32_t m, int32_t target) {
    reel_walk_models *models = walk->models;
    reel_node *nodes = walk->nodes;
    int32_t offset = 0;
    bool behind = false;
    if (walk->port.writes) {
        int32_t ahead = nodes[m].next, back = nodes[n].prev;
        while (offset < NEAR && ahead != target && back != target) {
            ahead = nodes[ahead].next;
            back = nodes[back].prev;
            offset++;
        }
        behind = ahead != target;
    }
#ifdef STATS
    walk->n_splits++;
    walk->n_far += offset == NEAR;
#endif
    if (reel_bit(&walk->port, &models->is_far, offset == NEAR)) {
        int bits = reel_length((uint32_t)walk->n_nodes - 1);
        uint32_t found = reel_code_raw(&walk->port, bits, (uint32_t)target);
        if (found >= (uint32_t)walk->n_nodes) {
            walk->failed = true;
            return m;
        }
        return (int32_t)found;
    }
    behind = reel_bit(&walk->port, &models->is_behind, behind);
    offset = (int32_t)reel_code_count(&walk->port, &models->offset, (uint32_t)offset);
    if (offset >= NEAR) {
        walk->failed = true;
        return m;
    }
    int32_t found = behind ? nodes[n].prev : nodes[m].next;
    for (int32_t i = 0; i < offset; i++) {
        found = behind ? nodes[found].prev : nodes[found].next;
    }
    return found;
}

/* Writer: the node of the ring around the side `start`, which begins at its point; and the number
   of faces there between the edge to the node's next, and the face of the side. */
static int32_t find_node(const reel_walk *walk, int32_t start, int32_t *share) {
    const int32_t *twin = walk->surface.twin;
    int32_t back = start, ahead = reel_side_before(start);
    for (int32_t steps = 0;; steps++) {
        if (twin[back] < 0) {
            *share = steps;
            return -1 - twin[back];
        }
        if (twin[ahead] < 0) {
            int32_t node = walk->nodes[-1 - twin[ahead]].next;
            *share = walk->nodes[node].free - steps;
            return node;
        }
        back = reel_side_after(twin[back]);
        ahead = reel_side_before(twin[ahead]);
    }
}

/* The face behind the edge from n to m has its third corner at node w, of any ring. */
static void meet(reel_walk *walk, int32_t n, int32_t m, int32_t w, int32_t share) {
    reel_node *nodes = walk->nodes;
    if (w == n || w == m || nodes[w].degree == 0 || nodes[w].free < 2) {
        walk->failed = true;
        return;
    }
    int32_t most = nodes[w].free - 2;
    share = (int32_t)reel_code_count(&walk->port, &walk->models->share, (uint32_t)share);
    if (share > most) {
        walk->failed = true;
        return;
    }
    add_face(walk, n, m, w);
    int32_t copy = new_node(walk);
    if (walk->failed) {
        return;
    }
    if (walk->port.writes) {
        int32_t side = walk->side[n];
        int32_t to_w = walk->surface.twin[reel_side_before(side)];
        int32_t to_m = walk->surface.twin[reel_side_after(side)];
        set_side(walk, n, to_w);
        set_side(walk, copy, to_m);
    }
    nodes[copy] = nodes[w];
    link_nodes(walk, nodes[w].prev, copy);
    link_nodes(walk, copy, m);
    link_nodes(walk, n, w);
    nodes[copy].free = most - share;
    nodes[copy].across = nodes[n].degree;
    nodes[n].across = nodes[m].degree;
    file_node(walk, copy);
    set_free(walk, w, share);
    set_free(walk, n, nodes[n].free - 1);
    set_free(walk, m, nodes[m].free - 1);
}

/* The face behind the edge from n to m has a point that is first met. */
static void meet_new(reel_walk *walk, int32_t n, int32_t m, int32_t point) {
    reel_node *nodes = walk->nodes;
    bool cap = walk->port.writes && walk->surface.vertex[point] == CAP;
    if (walk->n_caps > 0) {
        cap = reel_bit(&walk->port, &walk->models->is_cap, cap);
    }
    int32_t u = code_point(walk, n, m, point, cap);
    if (walk->failed) {
        return;
    }
    add_face(walk, n, m, u);
    if (walk->port.writes) {
        int32_t side = walk->side[n];
        int32_t to_u = walk->surface.twin[reel_side_before(side)];
        int32_t to_m = walk->surface.twin[reel_side_after(side)];
        set_side(walk, n, to_u);
        set_side(walk, u, to_m);
    }
    link_nodes(walk, n, u);
    link_nodes(walk, u, m);
    nodes[u].across = nodes[n].degree;
    nodes[n].across = nodes[m].degree;
    file_node(walk, u);
    set_free(walk, n, nodes[n].free - 1);
    set_free(walk, m, nodes[m].free - 1);
}

/* The one face at node z: between its neighbours in the ring. */
static void fill(reel_walk *walk, int32_t z) {
    reel_node *nodes = walk->nodes;
    int32_t p = nodes[z].prev, q = nodes[z].next;
    bool last = nodes[q].next == p && nodes[p].free == 0 && nodes[q].free == 0;
    if (p == q || (!last && (nodes[p].free == 0 || nodes[q].free == 0))) {
        walk->failed = true;
        return;
    }
    add_face(walk, z, q, p);
    if (last) {
        drop_node(walk, z);
        drop_node(walk, p);
        drop_node(walk, q);
        return;
    }
    if (walk->port.writes) {
        set_side(walk, p, walk->surface.twin[reel_side_after(walk->side[z])]);
    }
    nodes[p].across = nodes[z].degree;
    link_nodes(walk, p, q);
    drop_node(walk, z);
    set_free(walk, p, nodes[p].free - 1);
    set_free(walk, q, nodes[q].free - 1);
}

/* The face at node z, on the side where fewer edges are to come, whose third point is coded. */
static void grow(reel_walk *walk, int32_t z) {
    reel_node *nodes = walk->nodes;
    int32_t n = nodes[z].prev, m = z;
#if SIDE == 0
    if (nodes[nodes[z].next].free < nodes[n].free) {
        n = z;
        m = nodes[z].next;
    }
#elif SIDE == 2
        n = z;
        m = nodes[z].next;
#endif
    int32_t point = NONE, target = NONE, share = 0;
    bool meets = false;
    if (walk->port.writes) {
        int32_t third = reel_side_before(walk->side[n]);
        point = walk->surface.point[third];
        meets = walk->met[point];
        if (meets) {
            target = find_node(walk, third, &share);
            share -= 1;
        }
    }
    reel_walk_models *models = walk->models;
    uint32_t fn = free_class(nodes[n].free), fm = free_class(nodes[m].free);
    uint32_t fp = free_class(nodes[nodes[n].prev].free), fq = free_class(nodes[nodes[m].next].free);
    int32_t length = 2;
    for (int32_t i = nodes[m].next; i != n && length < 9; i = nodes[i].next) {
        length++;
    }
    reel_model *row[MEETING] = {
        &models->meets[0][length],
        &models->meets[1][fn * 64 + fm * 8 + (uint32_t)(length < 9 ? length - 2 : 7)],
        &models->meets[2][fn * 512 + fm * 64 + fp * 8 + fq],
    };
    if (reel_mixed_bit(&walk->port, &models->odds, &models->meets_weights, row, MEETING, meets)) {
        target = code_meeting(walk, n, m, target);
        meet(walk, n, m, target, share);
    } else {
        meet_new(walk, n, m, point);
    }
}

/* One whole part of the surface, from the edge at the start of side `side`. */
static void walk_part(reel_walk *walk, int32_t side) {
    bool open = walk->port.writes && walk->surface.vertex[walk->surface.point[side]] == CAP;
    if (walk->n_caps > 0) {
        open = reel_bit(&walk->port, &walk->models->starts_open, open);
    }
    int32_t other = walk->port.writes ? walk->surface.twin[side] : NONE;
    int32_t points[2] = {NONE, NONE};
    if (walk->port.writes) {
        points[0] = walk->surface.point[side];
        points[1] = walk->surface.point[other];
    }
    int32_t a = code_point(walk, NONE, NONE, points[0], open);
    int32_t b = code_point(walk, NONE, NONE, points[1], false);
    if (walk->failed) {
        return;
    }
    link_nodes(walk, a, b);
    link_nodes(walk, b, a);
    set_side(walk, a, side);
    set_side(walk, b, other);
    int32_t ends[2] = {a, b};
    for (int i = 0; i < 2; i++) {
        walk->nodes[ends[i]].across = 6;
        walk->nodes[ends[i]].free++; /* the edge between both is one, not two */
        file_node(walk, ends[i]);
    }
    while (!walk->failed) {
        int bucket = 0;
        while (bucket < BUCKETS && walk->top[bucket] == NONE) {
            bucket++;
        }
        if (bucket == BUCKETS) {
            return;
        }
        if (bucket == 0) {
            fill(walk, walk->top[0]);
        } else {
            grow(walk, walk->top[bucket]);
        }
    }
}

/* Faces as they are listed, each corner less one before it. */
static void code_listed(reel_walk *walk, int32_t *faces, int64_t n_faces) {
    int64_t above = 0;
    for (int64_t i = 0; i < n_faces && !walk->failed; i++) {
        int32_t *face = faces + 3 * i;
        for (int k = 0; k < 3; k++) {
            int64_t base = k ? face[0] : above, value = 0;
            if (walk->port.writes) {
                value = face[k] - base;
            }
            value = base + reel_code_integer(&walk->port, &walk->models->corner[k], (int32_t)value);
            if (value < 0 || value >= walk->n_verts) {
                walk->failed = true;
                return;
            }
            face[k] = (int32_t)value;
        }
        above = face[0];
    }
}

static int64_t code_amount(reel_walk *walk, int64_t value, int64_t most) {
    value = reel_code_count(&walk->port, &walk->models->counts, (uint32_t)value);
    walk->failed |= value > most;
    return value;
}

/* Writer: numbers of the vertices that no part names, and the degenerate faces in numbers. */
static void finish_names(reel_walk *walk, const int32_t *faces) {
    int64_t named = walk->n_named;
    for (int64_t v = 0; v < walk->n_verts; v++) {
        if (walk->name[v] == NONE) {
            walk->name[v] = (int32_t)named;
            walk->given[named++] = (int32_t)v;
        }
    }
    int32_t *flat = walk->faces + 3 * walk->n_done;
    for (int64_t f = 0; f < walk->n_faces + walk->surface.n_flat; f++) {
        for (int k = 0; walk->surface.flat[f] && k < 3; k++) {
            *flat++ = walk->name[faces[3 * f + k]];
        }
    }
}

/* Writer: all parts, the open ones first, each from its first open edge or face. */
static void write_parts(reel_walk *walk) {
    const reel_surface *surface = &walk->surface;
    int64_t n_given = 3 * surface->n_faces, n_all = n_given + 3 * surface->n_closing;
    for (int64_t side = n_given + 2; side < n_all && !walk->failed; side += 3) {
        if (!walk->met[surface->point[side]]) {
            walk_part(walk, (int32_t)side);
        }
    }
    for (int64_t f = 0; f < surface->n_faces && !walk->failed; f++) {
        if (!surface->flat[f] && !walk->met[surface->point[3 * f]]) {
            walk_part(walk, (int32_t)(3 * f));
        }
    }
}

static void start_models(reel_walk_models *models) {
    reel_fill_odds(&models->odds);
    reel_model even = reel_model_of(32768, 0);
    for (int i = 0; i < OPINIONS; i++) {
        for (int j = 0; j < 4096 * DECISIONS; j++) {
            models->degree[i][j] = even;
        }
    }
    for (int i = 0; i < MEETING; i++) {
        for (int j = 0; j < 4096; j++) {
            models->meets[i][j] = even;
        }
    }
    for (int d = 0; d < DECISIONS; d++) {
        for (int i = 0; i < REEL_MOST_OPINIONS; i++) {
            for (int t = 0; t < REEL_TRUST; t++) {
                models->degree_weights[d].weight[i][t] = 65536 / 3;
            }
        }
    }
    models->meets_weights = models->degree_weights[0];
    models->is_cap = models->is_copy = models->is_far = reel_model_of(2000, 4);
    models->starts_open = models->is_behind = even;
    for (int i = 0; i < 8; i++) {
        models->turned[i] = even;
    }
    reel_start_integers(&models->high_degree);
    reel_start_integers(&models->cap_degree);
    reel_start_integers(&models->offset);
    reel_start_integers(&models->share);
    reel_start_integers(&models->copy);
    reel_start_integers(&models->counts);
    for (int k = 0; k < 3; k++) {
        reel_start_integers(&models->corner[k]);
    }
}

static int64_t code_faces(reel_walk *walk, const int32_t *given) {
    reel_surface *surface = &walk->surface;
    int64_t all = walk->n_faces;
    int64_t n_flat = code_amount(walk, surface->n_flat, all);
    walk->n_faces = all - n_flat;
    walk->n_caps = code_amount(walk, surface->n_caps, 3 * walk->n_faces);
    walk->pinched = reel_code_raw(&walk->port, 1, surface->pinched);
    walk->turns = reel_code_raw(&walk->port, 1, surface->turns);
    if (walk->failed) {
        return reel_failure(REEL_CORRUPT, walk->port.position);
    }
    if (walk->port.writes) {
        write_parts(walk);
        finish_names(walk, given);
    } else {
        while (walk->n_done < walk->n_faces && !walk->failed) {
            walk_part(walk, NONE);
        }
    }
    code_listed(walk, walk->faces + 3 * walk->n_done, n_flat);
    if (walk->failed || walk->n_done < walk->n_faces) {
        return reel_failure(REEL_CORRUPT, walk->port.position);
    }
#ifdef STATS
    __builtin_printf("splits %ld far %ld peak %d caps %ld turns %d pinched %d flat %ld\n", (long)walk->n_splits, (long)walk->n_far, walk->n_nodes, (long)surface->n_caps, walk->turns, walk->pinched, (long)n_flat);
#endif
    return reel_end(&walk->port);
}

static size_t walk_memory(int64_t n_faces) {
    return reel_room(1, sizeof(reel_walk_models)) + reel_room(3 * (size_t)n_faces + 4, sizeof(reel_node));
}

static reel_walk new_walk(reel_arena *arena, int64_t n_verts, int64_t n_faces) {
    reel_walk walk = {.n_verts = n_verts, .n_faces = n_faces, .spare = NONE};
    walk.models = reel_take(arena, 1, sizeof *walk.models);
    walk.nodes = reel_take(arena, 3 * (size_t)n_faces + 4, sizeof *walk.nodes);
    walk.room = (int32_t)(3 * n_faces + 4);
    for (int i = 0; i < BUCKETS; i++) {
        walk.top[i] = NONE;
    }
    for (int i = 0; i < 3; i++) {
        walk.last[i] = 6;
    }
    if (!arena->failed) {
        start_models(walk.models);
    }
    return walk;
}

size_t reel_connectivity_decode_memory(int64_t n_verts, int64_t n_faces) {
    (void)n_verts;
    return walk_memory(n_faces);
}

size_t reel_connectivity_encode_memory(int64_t n_verts, int64_t n_faces) {
    size_t m = (size_t)n_faces;
    return walk_memory(n_faces) + reel_surface_memory(n_verts, n_faces) +
           reel_room((size_t)n_verts, sizeof(int32_t)) + reel_room(3 * m + 4, sizeof(int32_t)) +
           reel_room(6 * m, 1);
}

static bool within(int64_t n_verts, int64_t n_faces) {
    return n_verts >= 0 && n_faces >= 0 && n_verts <= REEL_MOST_ITEMS && n_faces <= REEL_MOST_ITEMS;
}

int64_t reel_connectivity_encode(void *memory, size_t memory_size, const int32_t *faces,
                                 int64_t n_faces, int64_t n_verts, int64_t listed,
                                 int32_t *internal_faces, int32_t *internal_to_given, uint8_t *out,
                                 size_t room) {
    if (!within(n_verts, n_faces)) {
        return reel_failure(REEL_INVALID, 0);
    }
    for (int64_t i = 0; i < 3 * n_faces; i++) {
        if (faces[i] < 0 || faces[i] >= n_verts) {
            return reel_failure(REEL_INVALID, (uint64_t)i / 3);
        }
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
    reel_walk walk = new_walk(&arena, n_verts, n_faces);
    walk.name = reel_take(&arena, (size_t)n_verts, sizeof(int32_t));
    walk.side = reel_take(&arena, 3 * (size_t)n_faces + 4, sizeof(int32_t));
    walk.met = reel_take(&arena, 6 * (size_t)n_faces, 1);
    if (arena.failed || !reel_find_surface(&arena, faces, n_faces, n_verts, &walk.surface)) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    walk.port = reel_writer(out, room);
    walk.faces = internal_faces;
    walk.given = internal_to_given;
    reel_code_raw(&walk.port, 1, (uint32_t)(listed != 0));
    if (listed) {
        reel_copy(internal_faces, faces, 3 * (size_t)n_faces * sizeof *faces);
        for (int64_t v = 0; v < n_verts; v++) {
            internal_to_given[v] = (int32_t)v;
        }
        code_listed(&walk, internal_faces, n_faces);
        return reel_end(&walk.port);
    }
    for (int64_t v = 0; v < n_verts; v++) {
        walk.name[v] = NONE;
    }
    reel_zero(walk.met, 6 * (size_t)n_faces);
    return code_faces(&walk, faces);
}

int64_t reel_connectivity_decode(void *memory, size_t memory_size, const uint8_t *in, size_t size,
                                 int64_t n_verts, int64_t n_faces, int32_t *faces) {
    if (!within(n_verts, n_faces)) {
        return reel_failure(REEL_INVALID, 0);
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
    reel_walk walk = new_walk(&arena, n_verts, n_faces);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    walk.port = reel_reader(in, size);
    walk.faces = faces;
    if (reel_code_raw(&walk.port, 1, 0)) {
        code_listed(&walk, faces, n_faces);
        return walk.failed ? reel_failure(REEL_CORRUPT, walk.port.position) : reel_end(&walk.port);
    }
    return code_faces(&walk, NULL);
}
