/* Coded decisions of the traversal and their contexts: degrees, meetings of rings, copies of
   vertices.

   docs/format.md, CONNECTIVITY. */

#include "walk.h"

#define MAX_OFFSET 24     /* ring distance up to which a target is coded as an offset */
#define MAX_RING_LENGTH 9 /* ring lengths saturate here */
#define MAX_FLANK 3       /* nodes followed beyond n and m */
#define MIN_DEGREE 2      /* symbol 0 */
#define LONG_DEGREE 15    /* symbol of all larger degrees */

/* Context classes: of a degree 0..6, of a node 0..7, of a number of edges 0..7. */
static uint32_t degree_class(int32_t degree) {
    return degree < 4 ? 0 : degree > 9 ? 6 : (uint32_t)degree - 3;
}

static uint32_t node_class(const reel_node *node) {
    return node->vertex == REEL_CAP ? 7 : degree_class(node->degree);
}

static uint32_t remaining_class(const reel_node *node) {
    return node->remaining > 7 ? 7 : (uint32_t)node->remaining;
}

/* Sum the degree classes, relative to degree 6, of the nodes on one side, from `from` on, that a
   new point is certainly connected to; caps do not count. */
static int32_t flank_excess(const reel_walk *walk, int32_t from, bool backward) {
    const reel_node *end = &walk->nodes[from];
    int32_t excess = 0;
    for (int steps = 0;; steps++) {
        if (end->vertex != REEL_CAP) {
            excess += (int32_t)degree_class(end->degree) - 3;
        }
        if (steps == MAX_FLANK || end->remaining != 1) {
            return excess;
        }
        end = &walk->nodes[backward ? end->prev : end->next];
    }
}

/* Code the degree of a point first met behind the edge from n to m, or at a start. */
int32_t reel_code_degree(reel_walk *walk, int32_t n, int32_t m, int32_t degree) {
    uint32_t flanks = REEL_FLANK_CLASSES - 1, nodes = REEL_EDGE_CONTEXTS - 1;
    if (n != REEL_NONE) {
        const reel_node *a = &walk->nodes[n];
        int32_t excess = flank_excess(walk, n, true) + flank_excess(walk, m, false);
        flanks = (uint32_t)(excess < -7 ? 0 : excess > 8 ? 15 : excess + 7);
        nodes = node_class(a) << 6 | node_class(&walk->nodes[m]) << 3 | degree_class(a->across);
    }
    int symbol = degree - MIN_DEGREE < LONG_DEGREE ? degree - MIN_DEGREE : LONG_DEGREE;
    symbol = reel_code_symbol_in_context(&walk->coder, &walk->models->degree[flanks],
                                         &walk->models->degree_by_edge[nodes], symbol);
    if (symbol < LONG_DEGREE) {
        return MIN_DEGREE + symbol;
    }
    uint32_t excess = (uint32_t)(degree - MIN_DEGREE - LONG_DEGREE);
    excess = reel_code_count(&walk->coder, &walk->models->more_degree, excess);
    walk->failed |= excess > 12 * REEL_MAX_ITEMS;
    return walk->failed ? 6 : MIN_DEGREE + LONG_DEGREE + (int32_t)excess;
}

int32_t reel_code_cap_degree(reel_walk *walk, int32_t degree) {
    uint32_t excess = (uint32_t)(degree - 2);
    excess = reel_code_count(&walk->coder, &walk->models->cap_degree, excess);
    walk->failed |= excess > 3 * walk->n_faces;
    return walk->failed ? 2 : 2 + (int32_t)excess;
}

/* Code whether a new point, or the first of a part, is a cap. */
bool reel_code_is_cap(reel_walk *walk, bool cap, bool starts) {
    if (walk->n_caps == 0) {
        return false;
    }
    reel_model *model = starts ? &walk->models->starts_open : &walk->models->is_cap;
    cap = reel_bit(&walk->coder, model, cap);
    walk->n_caps -= cap;
    return cap;
}

/* Code the vertex of a new point: the next number, or a copy of an earlier vertex. */
int32_t reel_code_vertex(reel_walk *walk, int32_t vertex) {
    int32_t number = reel_is_encoder(&walk->coder) ? walk->numbers[vertex] : REEL_NONE;
    if (walk->pinched && reel_bit(&walk->coder, &walk->models->is_copy, number != REEL_NONE)) {
        int64_t result = walk->last_copied;
        result += reel_code_integer(&walk->coder, &walk->models->copy, number - walk->last_copied);
        walk->failed |= result < 0 || result >= walk->n_numbered;
        walk->last_copied = walk->failed ? 0 : (int32_t)result;
        return walk->last_copied;
    }
    if (walk->n_numbered == walk->n_verts) {
        walk->failed = true;
        return 0;
    }
    if (reel_is_encoder(&walk->coder)) {
        walk->numbers[vertex] = (int32_t)walk->n_numbered;
        walk->given[walk->n_numbered] = vertex;
    }
    return (int32_t)walk->n_numbered++;
}

/* Code whether a face is flipped; `node` is the node before the edge at which it is met. */
bool reel_code_flipped(reel_walk *walk, int32_t node, bool flipped) {
    int context = walk->nodes[node].flipped;
    return walk->has_flipped && reel_bit(&walk->coder, &walk->models->flipped[context], flipped);
}

/* Code whether the third point of the face behind the edge from n to m is already on a ring. */
bool reel_code_meets(reel_walk *walk, int32_t n, int32_t m, bool meets) {
    const reel_node *nodes = walk->nodes, *a = &nodes[n], *b = &nodes[m];
    uint32_t length = 2;
    for (int32_t i = b->next; i != n && length < MAX_RING_LENGTH; i = nodes[i].next) {
        length++;
    }
    uint32_t context = remaining_class(a) << 9 | remaining_class(b) << 6 |
                       remaining_class(&nodes[a->prev]) << 3 | remaining_class(&nodes[b->next]);
    return reel_bit_in_context(&walk->coder, &walk->models->meets[length],
                               &walk->models->meets_by_nodes[context], meets);
}

/* Code the node that the face behind the edge from n to m meets: as an offset in the ring, or as
   its number. */
int32_t reel_code_target(reel_walk *walk, int32_t n, int32_t m, int32_t target) {
    const reel_node *nodes = walk->nodes;
    int32_t offset = 0, ahead = nodes[m].next, back = nodes[n].prev;
    if (reel_is_encoder(&walk->coder)) {
        while (offset < MAX_OFFSET && ahead != target && back != target) {
            ahead = nodes[ahead].next;
            back = nodes[back].prev;
            offset++;
        }
    }
    if (reel_bit(&walk->coder, &walk->models->is_far, offset == MAX_OFFSET)) {
        int bits = reel_bit_length((uint32_t)walk->n_nodes - 1);
        target = (int32_t)reel_code_raw(&walk->coder, bits, (uint32_t)target);
        walk->failed |= target >= walk->n_nodes;
        return walk->failed ? m : target;
    }
    bool behind = reel_bit(&walk->coder, &walk->models->is_behind, ahead != target);
    uint32_t steps = reel_code_count(&walk->coder, &walk->models->offset, (uint32_t)offset);
    if (steps >= MAX_OFFSET) {
        walk->failed = true;
        return m;
    }
    target = behind ? nodes[n].prev : nodes[m].next;
    for (uint32_t i = 0; i < steps; i++) {
        target = behind ? nodes[target].prev : nodes[target].next;
    }
    return target;
}

void reel_reset_walk_models(reel_walk_models *models) {
    reel_zero(models, sizeof *models); /* models of contexts are copied from shared ones */
    for (int i = 0; i < REEL_FLANK_CLASSES; i++) {
        models->degree[i] = reel_new_symbol_model();
    }
    for (int length = 0; length < REEL_RING_LENGTHS; length++) {
        models->meets[length] = reel_model_of(512, 6);
    }
    models->is_cap = models->is_copy = models->is_far = reel_model_of(2048, 4);
    models->starts_open = models->is_behind = reel_model_of(32768, 0);
    models->flipped[0] = models->flipped[1] = reel_model_of(32768, 0);
    reel_integer_model *integers[] = {
        &models->more_degree, &models->cap_degree, &models->offset,
        &models->share,       &models->copy,       &models->amounts,
        &models->corner[0],   &models->corner[1],  &models->corner[2],
    };
    for (size_t i = 0; i < sizeof integers / sizeof *integers; i++) {
        reel_reset_integer_model(integers[i]);
    }
}
