/* Coded decisions of the traversal and their contexts: degrees, meetings of rings, copies of
   vertices.

   docs/format.md, CONNECTIVITY. */

#include "walk.h"

#define MAX_OFFSET 24     /* ring distance up to which a target is coded as an offset */
#define MAX_RING_LENGTH 9 /* ring lengths saturate here */
#define MAX_FLANK 3       /* nodes followed beyond n and m */

/* Context classes: of a degree 0..6, of a node 0..7, of a number of edges 0..7. */
static uint32_t degree_class(int32_t degree) {
    return degree < 4 ? 0 : degree > 9 ? 6 : (uint32_t)degree - 3;
}

static uint32_t node_class(const reel_node *node) {
    return node->vertex == REEL_CAP ? 7 : degree_class(node->degree);
}

static uint32_t free_class(const reel_node *node) {
    return node->remaining > 7 ? 7 : (uint32_t)node->remaining;
}

/* The boundary nodes that are certainly connected to a new point at the edge n, m. */
typedef struct {
    int32_t steps;        /* number of such nodes beyond n, or m */
    const reel_node *end; /* the last one */
    int32_t excess;       /* sum of degree classes relative to degree 6; caps do not count */
} boundary_flank;

static boundary_flank flank_of(const reel_walk *walk, int32_t from, bool backward) {
    boundary_flank flank = {0, &walk->nodes[from], 0};
    for (;;) {
        if (flank.end->vertex != REEL_CAP) {
            flank.excess += (int32_t)degree_class(flank.end->degree) - 3;
        }
        if (flank.steps == MAX_FLANK || flank.end->remaining != 1) {
            return flank;
        }
        flank.end = &walk->nodes[backward ? flank.end->prev : flank.end->next];
        flank.steps++;
    }
}

/* First models of a degree in each context. */
static void find_contexts(const reel_walk *walk, int32_t n, int32_t m, uint32_t *row) {
    uint32_t contexts[REEL_DEGREE_CONTEXTS] = {3};
    if (n != REEL_NONE) {
        const reel_node *nodes = walk->nodes, *a = &nodes[n], *b = &nodes[m];
        boundary_flank left = flank_of(walk, n, true), right = flank_of(walk, m, false);
        int32_t excess = 7 + reel_clamp(left.excess + right.excess, 8);
        uint32_t sum = excess < 0 ? 0 : (uint32_t)excess;
        uint32_t da = node_class(a), db = node_class(b), y = degree_class(a->across);
        uint32_t fl = free_class(left.end);
        contexts[0] = a->vertex == REEL_CAP ? 1 : b->vertex == REEL_CAP ? 2 : 0;
        contexts[1] = da << 6 | db << 3 | y;
        contexts[2] = free_class(a) << 6 | free_class(b) << 3 | fl;
        contexts[3] = fl << 6 | degree_class(walk->last[0]) << 3 | degree_class(walk->last[1]);
        contexts[4] =
            node_class(&nodes[a->prev]) << 9 | da << 6 | db << 3 | node_class(&nodes[b->next]);
        contexts[5] = (uint32_t)left.steps << 6 | (uint32_t)right.steps << 4 | sum;
        contexts[6] = sum << 6 | da << 3 | y;
    }
    static const uint32_t starts[REEL_DEGREE_CONTEXTS] = {0, 4, 516, 1028, 1540, 5636, 5892};
    for (int i = 0; i < REEL_DEGREE_CONTEXTS; i++) {
        row[i] = (starts[i] + contexts[i]) * REEL_DECISIONS;
    }
}

static bool decide(reel_walk *walk, const uint32_t *row, int decision, bool bit) {
    reel_model *models[REEL_DEGREE_CONTEXTS];
    for (int i = 0; i < REEL_DEGREE_CONTEXTS; i++) {
        models[i] = &walk->models->degree[row[i] + (uint32_t)decision];
    }
    return reel_mixed_bit(&walk->coder, &walk->models->odds,
                          &walk->models->degree_weights[decision], models, REEL_DEGREE_CONTEXTS,
                          bit);
}

/* Code a degree of at least 2: is it 6, is it less, then unary from there. */
static int32_t code_in_contexts(reel_walk *walk, const uint32_t *row, int32_t degree) {
    if (decide(walk, row, 0, degree == 6)) {
        return 6;
    }
    if (decide(walk, row, 1, degree < 6)) {
        int32_t result = 5;
        while (result > 2 && !decide(walk, row, 7 - result, degree == result)) {
            result--;
        }
        return result;
    }
    for (int32_t result = 7; result <= REEL_MAX_MODELED_DEGREE; result++) {
        if (decide(walk, row, result - 2, degree == result)) {
            return result;
        }
    }
    uint32_t more = (uint32_t)(degree - REEL_MAX_MODELED_DEGREE - 1);
    more = reel_code_count(&walk->coder, &walk->models->more_degree, more);
    walk->failed |= more > 12 * REEL_MAX_ITEMS;
    return walk->failed ? 6 : REEL_MAX_MODELED_DEGREE + 1 + (int32_t)more;
}

/* Code the degree of a point first met behind the edge from n to m, or at a start. */
int32_t reel_code_degree(reel_walk *walk, int32_t n, int32_t m, int32_t degree) {
    uint32_t row[REEL_DEGREE_CONTEXTS];
    find_contexts(walk, n, m, row);
    degree = code_in_contexts(walk, row, degree);
    walk->last[1] = walk->last[0];
    walk->last[0] = degree;
    return degree;
}

int32_t reel_code_cap_degree(reel_walk *walk, int32_t degree) {
    uint32_t more = (uint32_t)(degree - 2);
    more = reel_code_count(&walk->coder, &walk->models->cap_degree, more);
    walk->failed |= more > 3 * walk->n_faces;
    return walk->failed ? 2 : 2 + (int32_t)more;
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
    int32_t known = reel_is_encoder(&walk->coder) ? walk->name[vertex] : REEL_NONE;
    if (walk->pinched && reel_bit(&walk->coder, &walk->models->is_copy, known != REEL_NONE)) {
        int64_t result = walk->last_copied;
        result += reel_code_integer(&walk->coder, &walk->models->copy, known - walk->last_copied);
        walk->failed |= result < 0 || result >= walk->n_named;
        walk->last_copied = walk->failed ? 0 : (int32_t)result;
        return walk->last_copied;
    }
    if (walk->n_named == walk->n_verts) {
        walk->failed = true;
        return 0;
    }
    if (reel_is_encoder(&walk->coder)) {
        walk->name[vertex] = (int32_t)walk->n_named;
        walk->given[walk->n_named] = vertex;
    }
    return (int32_t)walk->n_named++;
}

/* Code whether a face is flipped; `behind` is the node before the edge at which it is met. */
bool reel_code_flipped(reel_walk *walk, int32_t behind, bool flipped) {
    int context = walk->nodes[behind].flipped;
    return walk->has_flipped && reel_bit(&walk->coder, &walk->models->flipped[context], flipped);
}

/* Code whether the third point of the face behind the edge from n to m is already on a ring. */
bool reel_code_meets(reel_walk *walk, int32_t n, int32_t m, bool meets) {
    const reel_node *nodes = walk->nodes, *a = &nodes[n], *b = &nodes[m];
    uint32_t length = 2;
    for (int32_t i = b->next; i != n && length < MAX_RING_LENGTH; i = nodes[i].next) {
        length++;
    }
    uint32_t fa = free_class(a), fb = free_class(b);
    uint32_t around =
        fa << 9 | fb << 6 | free_class(&nodes[a->prev]) << 3 | free_class(&nodes[b->next]);
    reel_model *meet = walk->models->meets;
    reel_model *models[REEL_MEET_CONTEXTS] = {
        &meet[length],
        &meet[16 + (fa << 6 | fb << 3 | (length - 2))],
        &meet[528 + around],
    };
    return reel_mixed_bit(&walk->coder, &walk->models->odds, &walk->models->meets_weights, models,
                          REEL_MEET_CONTEXTS, meets);
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
    /* Mixed models start without observations, except for ring lengths. */
    reel_zero(models, sizeof *models);
    reel_fill_logits(&models->odds);
    for (int i = 0; i < REEL_MAX_MIXED; i++) {
        for (int decision = 0; decision < REEL_DECISIONS; decision++) {
            models->degree_weights[decision].of[i] = 65536 / 4;
        }
        models->meets_weights.of[i] = 65536 / 4;
    }
    models->meets_weights.of[0] = 65536 / 2;
    for (int length = 0; length <= MAX_RING_LENGTH; length++) {
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
