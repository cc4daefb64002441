/* Coding of cells: as a list, or by a walk from cell to cell across their sides. Cells and nodes
   are numbered in the order of the walk; their "given" numbers are those of the input.
   docs/format.md, CELLS. */

#include "cells.h"
#include "integers.h"
#include "surface.h"

#define NONE (-1)
#define MAX_NODES 27
#define MAX_LOOKUPS 64   /* limit of searches in the open sides or the edges of a node */
#define MAX_PROPOSALS 8  /* nodes that are ranked as the likely next one */
#define MAX_CANDIDATES 4 /* first of these, which are coded by their rank */
#define MAX_AROUND 48    /* nodes near the entered side, which are coded by their place in a list */
#define ENTRY_BITS 7     /* bits of an entry: a side, a rotation and a direction */
#define AROUND_CLASSES 16
#define EDGE_CLASSES 8

/* A side of a visited cell; it is open while no cell across it was visited. The open sides at each
   node form a linked list; a link is side * REEL_MAX_SIDES + corner. */
typedef struct {
    int32_t cell;
    int32_t next[REEL_MAX_SIDE_CORNERS]; /* link after that of each corner */
    uint8_t number; /* number of the side in its cell */
    bool is_open;
} open_side;

/* An edge of visited cells, in a linked list at its lower node. */
typedef struct {
    int32_t high, next; /* higher node; next edge in the list */
    int32_t middle;     /* node on the edge, or NONE */
    int32_t n_cells;    /* visited cells at the edge */
} walked_edge;

typedef struct {
    reel_model is_next[5][5][REEL_MAX_SIDE_CORNERS + 1][EDGE_CLASSES];
    reel_model same_type[REEL_N_SHAPES];
    reel_model entry[REEL_N_SHAPES][REEL_MAX_SIDES][1 << ENTRY_BITS];
    reel_model candidate[REEL_N_SHAPES][MAX_CANDIDATES][MAX_CANDIDATES][3][EDGE_CLASSES];
    reel_model is_new[REEL_N_SHAPES][MAX_CANDIDATES + 1];
    reel_model is_around[AROUND_CLASSES];
    reel_integer_model place[AROUND_CLASSES];
    reel_model is_shared, is_new_middle;
    reel_integer_model far;
    reel_integer_model first[REEL_N_SHAPES], step[REEL_N_SHAPES][2]; /* used by list_cells */
} cell_models;

typedef struct {
    reel_range_coder coder;
    cell_models *models;
    uint8_t *types;
    int32_t *nodes, *starts;
    int64_t n_cells, n_nodes, n_verts;
    int64_t n_visited, n_numbered; /* visited cells; numbered nodes */
    open_side *sides;
    int32_t n_sides, next_side; /* sides are visited in the order in which they open */
    int32_t *sides_at;          /* link to the first open side at each node */
    uint8_t *is_outer;          /* whether a node is on a side without a cell across it */
    walked_edge *edges;
    int32_t n_edges;
    int32_t *edges_at; /* first edge of each lower node */
    bool failed;
    /* Encoder only. */
    reel_cell_list given; /* cells of the input */
    const int32_t *mates; /* per given side: the same side of another cell, or itself */
    int32_t *numbers;     /* internal number of each given node */
    int32_t *given_of, *given_cells; /* given number of each internal node, and cell */
    uint8_t *is_visited;  /* whether each given cell was visited */
} cell_walk;

/* The cell that is being coded. */
typedef struct {
    const reel_cell_type *type;
    const reel_cell_shape *shape;
    int32_t nodes[MAX_NODES];
    uint32_t known;       /* set of the nodes that are known, as bits */
    int entry;            /* number of the side through which the walk entered, or NONE */
    const int32_t *given; /* encoder: its given nodes; else NULL */
} new_cell;

/* A likely next node of a cell, proposed by open sides that share an edge with the cell. */
typedef struct {
    int32_t node;
    int votes;         /* open sides that propose it */
    int cells_at_edge; /* maximum of the numbers of visited cells at the shared edges */
} proposal;

typedef struct {
    proposal items[MAX_PROPOSALS];
    int n;
} proposal_list;

/* Two known, consecutive corners of a side of the new cell, and an unknown corner of this side. */
typedef struct {
    int32_t first, second; /* nodes of the edge */
    int side_size;         /* corners of the side */
    int steps;             /* from the first corner of the edge to the unknown one */
    int n_cells;           /* visited cells at the edge, clipped */
} proposing_edge;

static const reel_cell_shape *shape_of(const cell_walk *walk, int32_t cell) {
    return reel_shape_of(reel_find_cell_type(walk->types[cell]));
}

static int side_size(const cell_walk *walk, const open_side *side) {
    return shape_of(walk, side->cell)->side_sizes[side->number];
}

static int32_t side_node(const cell_walk *walk, const open_side *side, int corner) {
    const reel_cell_shape *shape = shape_of(walk, side->cell);
    return walk->nodes[walk->starts[side->cell] + shape->sides[side->number][corner]];
}

/* Return the first link from `link` on whose side is open; remove links before it from the list. */
static int32_t open_link(cell_walk *walk, int32_t *link) {
    while (*link != NONE && !walk->sides[*link / REEL_MAX_SIDES].is_open) {
        *link = walk->sides[*link / REEL_MAX_SIDES].next[*link % REEL_MAX_SIDES];
    }
    return *link;
}

static int32_t *link_after(cell_walk *walk, int32_t link) {
    return &walk->sides[link / REEL_MAX_SIDES].next[link % REEL_MAX_SIDES];
}

static walked_edge *find_edge(const cell_walk *walk, int32_t a, int32_t b) {
    int32_t low = a < b ? a : b, high = a < b ? b : a, index = walk->edges_at[low];
    for (int i = 0; i < MAX_LOOKUPS && index != NONE; i++, index = walk->edges[index].next) {
        if (walk->edges[index].high == high) {
            return &walk->edges[index];
        }
    }
    return NULL;
}

static int cells_at_edge(const cell_walk *walk, int32_t a, int32_t b) {
    const walked_edge *edge = find_edge(walk, a, b);
    return !edge ? 0 : edge->n_cells < EDGE_CLASSES ? edge->n_cells : EDGE_CLASSES - 1;
}

static int32_t fail(cell_walk *walk) {
    walk->failed = true;
    return 0;
}

/* ---- Nodes */

/* Encoder: the internal number of a node, or NONE if it is new. */
static int32_t number_of(const cell_walk *walk, const new_cell *cell, int slot) {
    return reel_is_encoder(&walk->coder) ? walk->numbers[cell->given[slot]] : NONE;
}

/* Code a node that is not a candidate: a new one, one of those around the entered side, or any
   other by its distance from the newest. */
static int32_t code_new_or_far(cell_walk *walk, const new_cell *cell, int slot, reel_model *model,
                               const int32_t *around, int n_around) {
    int32_t node = number_of(walk, cell, slot);
    if (reel_bit(&walk->coder, model, node == NONE)) {
        if (walk->n_numbered == walk->n_verts) {
            return fail(walk);
        }
        if (reel_is_encoder(&walk->coder)) {
            walk->numbers[cell->given[slot]] = (int32_t)walk->n_numbered;
            walk->given_of[walk->n_numbered] = cell->given[slot];
        }
        return (int32_t)walk->n_numbered++;
    }
    if (n_around > 0) {
        int place = 0, class = n_around < AROUND_CLASSES ? n_around : AROUND_CLASSES - 1;
        while (place < n_around && around[place] != node) {
            place++;
        }
        if (reel_bit(&walk->coder, &walk->models->is_around[class], place < n_around)) {
            uint32_t index =
                reel_code_count(&walk->coder, &walk->models->place[class], (uint32_t)place);
            return index < (uint32_t)n_around ? around[index] : fail(walk);
        }
    }
    int64_t last = walk->n_numbered - 1;
    uint32_t distance = reel_code_count(&walk->coder, &walk->models->far, (uint32_t)(last - node));
    return distance <= last ? (int32_t)(last - distance) : fail(walk);
}

/* Whether a node is a known corner of a cell. */
static bool contains(const new_cell *cell, int32_t node) {
    for (int i = 0; i < cell->shape->n_corners; i++) {
        if (cell->known >> i & 1U && cell->nodes[i] == node) {
            return true;
        }
    }
    return false;
}

/* Add a vote for a node, unless the cell has it or the list is full. */
static void vote_for(proposal_list *list, const new_cell *cell, int32_t node, int n_cells) {
    int i = 0;
    while (i < list->n && list->items[i].node != node) {
        i++;
    }
    if (contains(cell, node) || i == MAX_PROPOSALS) {
        return;
    }
    if (i == list->n) {
        list->items[list->n++] = (proposal){node, 0, 0};
    }
    proposal *item = &list->items[i];
    item->votes++;
    item->cells_at_edge = item->cells_at_edge > n_cells ? item->cells_at_edge : n_cells;
}

/* Let the first two open sides at an edge vote: each for the node that would be the unknown corner
   if it were the side of the new cell. */
static void vote_across(cell_walk *walk, const new_cell *cell, proposing_edge edge,
                        proposal_list *list) {
    int size = edge.side_size, n_voters = 0, n_lookups = 0;
    for (int32_t *link = &walk->sides_at[edge.first];
         n_voters < 2 && n_lookups < MAX_LOOKUPS && open_link(walk, link) != NONE;
         n_lookups++, link = link_after(walk, *link)) {
        const open_side *side = &walk->sides[*link / REEL_MAX_SIDES];
        int corner = *link % REEL_MAX_SIDES;
        if (side_size(walk, side) != size) {
            continue;
        }
        bool follows = side_node(walk, side, (corner + 1) % size) == edge.second;
        if (!follows && side_node(walk, side, (corner + size - 1) % size) != edge.second) {
            continue;
        }
        n_voters++;
        int steps = follows ? edge.steps : size - edge.steps;
        vote_for(list, cell, side_node(walk, side, (corner + steps) % size), edge.n_cells);
    }
}

/* Find the candidates for a corner: the proposals with the most votes, then the most cells at the
   edge; equal ones keep their order. */
static void find_proposals(cell_walk *walk, const new_cell *cell, int slot, proposal_list *list) {
    list->n = 0;
    for (int k = 0; k < cell->shape->n_sides; k++) {
        const uint8_t *corners = cell->shape->sides[k];
        int size = cell->shape->side_sizes[k], place = 0;
        while (place < size && corners[place] != slot) {
            place++;
        }
        for (int i = 0; place < size && i < size; i++) {
            int first = corners[i], second = corners[(i + 1) % size];
            if (cell->known >> first & cell->known >> second & 1U) {
                int32_t a = cell->nodes[first], b = cell->nodes[second];
                int steps = (place - i + size) % size;
                proposing_edge edge = {a, b, size, steps, cells_at_edge(walk, a, b)};
                vote_across(walk, cell, edge, list);
                break;
            }
        }
    }
    proposal *proposals = list->items;
    for (int i = 1; i < list->n; i++) {
        proposal current = proposals[i];
        int index = i;
        while (index > 0 && (proposals[index - 1].votes < current.votes ||
                             (proposals[index - 1].votes == current.votes &&
                              proposals[index - 1].cells_at_edge < current.cells_at_edge))) {
            proposals[index] = proposals[index - 1];
            index--;
        }
        proposals[index] = current;
    }
    list->n = list->n < MAX_CANDIDATES ? list->n : MAX_CANDIDATES;
}

/* List the nodes of open sides at the corners of the entered side, except nodes of the cell and
   candidates. */
static int find_around(cell_walk *walk, const new_cell *cell, const proposal_list *candidates,
                       int32_t *around) {
    int n = 0;
    if (cell->entry == NONE) {
        return 0;
    }
    for (int i = 0; i < cell->shape->side_sizes[cell->entry]; i++) {
        int32_t corner = cell->nodes[cell->shape->sides[cell->entry][i]];
        int n_lookups = 0;
        for (int32_t *link = &walk->sides_at[corner];
             n_lookups < MAX_LOOKUPS && open_link(walk, link) != NONE;
             n_lookups++, link = link_after(walk, *link)) {
            const open_side *side = &walk->sides[*link / REEL_MAX_SIDES];
            for (int k = 0; k < side_size(walk, side); k++) {
                int32_t node = side_node(walk, side, k);
                bool is_known = contains(cell, node);
                for (int j = 0; j < candidates->n; j++) {
                    is_known |= candidates->items[j].node == node;
                }
                for (int j = 0; j < n; j++) {
                    is_known |= around[j] == node;
                }
                if (!is_known && n < MAX_AROUND) {
                    around[n++] = node;
                }
            }
        }
    }
    return n;
}

/* Code a corner of a cell: as one of the candidates, or otherwise. */
static int32_t code_corner(cell_walk *walk, const new_cell *cell, int slot) {
    proposal_list candidates;
    int32_t around[MAX_AROUND];
    find_proposals(walk, cell, slot, &candidates);
    int shape = cell->type->shape, n = candidates.n;
    for (int i = 0; i < n; i++) {
        const proposal *candidate = &candidates.items[i];
        int votes = candidate->votes > 3 ? 2 : candidate->votes - 1;
        reel_model *model =
            &walk->models->candidate[shape][i][n - 1][votes][candidate->cells_at_edge];
        if (reel_bit(&walk->coder, model, candidate->node == number_of(walk, cell, slot))) {
            return candidate->node;
        }
    }
    int n_around = find_around(walk, cell, &candidates, around);
    return code_new_or_far(walk, cell, slot, &walk->models->is_new[shape][n], around, n_around);
}

/* ---- Sides */

/* Find the open side with the same nodes as side `number` of a cell, or NONE. */
static int32_t find_side(cell_walk *walk, const reel_cell_shape *shape, const int32_t *nodes,
                         int number) {
    int size = shape->side_sizes[number], n_lookups = 0;
    int32_t corners[REEL_MAX_SIDE_CORNERS], sorted[REEL_MAX_SIDE_CORNERS];
    for (int i = 0; i < size; i++) {
        corners[i] = nodes[shape->sides[number][i]];
    }
    int n_sorted = reel_sort_nodes(corners, size, sorted);
    for (int32_t *link = &walk->sides_at[sorted[0]];
         n_lookups < MAX_LOOKUPS && open_link(walk, link) != NONE;
         n_lookups++, link = link_after(walk, *link)) {
        const open_side *side = &walk->sides[*link / REEL_MAX_SIDES];
        int32_t other_sorted[REEL_MAX_SIDE_CORNERS];
        for (int i = 0; i < side_size(walk, side); i++) {
            corners[i] = side_node(walk, side, i);
        }
        int n_other = reel_sort_nodes(corners, side_size(walk, side), other_sorted);
        bool is_same = n_sorted == n_other;
        for (int i = 0; i < n_sorted && is_same; i++) {
            is_same = sorted[i] == other_sorted[i];
        }
        if (is_same) {
            return *link / REEL_MAX_SIDES;
        }
    }
    return NONE;
}

/* Return the node in the middle of a side of a visited cell, or NONE. */
static int32_t center_of(const cell_walk *walk, int32_t side) {
    if (side == NONE) {
        return NONE;
    }
    const open_side *open = &walk->sides[side];
    const reel_cell_type *type = reel_find_cell_type(walk->types[open->cell]);
    const reel_cell_shape *shape = reel_shape_of(type);
    for (int i = 0; i < type->n_centers; i++) {
        if (type->centers[i] == open->number) {
            return walk->nodes[walk->starts[open->cell] + shape->n_corners + shape->n_edges + i];
        }
    }
    return NONE;
}

/* Code a node that is not a corner. `shared` is the node that a neighbor has there, or NONE. */
static int32_t code_middle(cell_walk *walk, const new_cell *cell, int slot, int32_t shared) {
    if (shared != NONE &&
        reel_bit(&walk->coder, &walk->models->is_shared, number_of(walk, cell, slot) == shared)) {
        return shared;
    }
    return code_new_or_far(walk, cell, slot, &walk->models->is_new_middle, NULL, 0);
}

/* Code the nodes on edges, on sides, and inside of a cell. */
static void code_middles(cell_walk *walk, new_cell *cell, int32_t entered) {
    const reel_cell_shape *shape = cell->shape;
    int slot = shape->n_corners;
    for (int i = 0; cell->type->has_mids && i < shape->n_edges; i++, slot++) {
        const walked_edge *edge =
            find_edge(walk, cell->nodes[shape->edges[i][0]], cell->nodes[shape->edges[i][1]]);
        cell->nodes[slot] = code_middle(walk, cell, slot, edge ? edge->middle : NONE);
    }
    for (int i = 0; i < cell->type->n_centers; i++, slot++) {
        int number = cell->type->centers[i];
        int32_t side =
            number == cell->entry ? entered : find_side(walk, shape, cell->nodes, number);
        cell->nodes[slot] = code_middle(walk, cell, slot, center_of(walk, side));
    }
    if (cell->type->has_middle) {
        cell->nodes[slot] = code_middle(walk, cell, slot, NONE);
    }
}

/* Count a cell at its edges, and record the nodes on them. */
static void visit_edges(cell_walk *walk, const new_cell *cell) {
    const reel_cell_shape *shape = cell->shape;
    for (int i = 0; i < shape->n_edges; i++) {
        int32_t a = cell->nodes[shape->edges[i][0]], b = cell->nodes[shape->edges[i][1]];
        walked_edge *edge = find_edge(walk, a, b);
        if (!edge) {
            int32_t low = a < b ? a : b;
            edge = &walk->edges[walk->n_edges];
            *edge = (walked_edge){a < b ? b : a, walk->edges_at[low], NONE, 0};
            walk->edges_at[low] = walk->n_edges++;
        }
        edge->n_cells++;
        if (cell->type->has_mids && edge->middle == NONE) {
            edge->middle = cell->nodes[shape->n_corners + i];
        }
    }
}

/* Close the sides that a cell shares with visited cells, and open the others. */
static void visit_sides(cell_walk *walk, const new_cell *cell, int32_t number) {
    const reel_cell_shape *shape = cell->shape;
    for (int k = 0; k < shape->n_sides; k++) {
        int32_t visited_side = k == cell->entry ? NONE : find_side(walk, shape, cell->nodes, k);
        if (visited_side != NONE) {
            walk->sides[visited_side].is_open = false;
        }
        if (visited_side != NONE || k == cell->entry) {
            continue;
        }
        int32_t index = walk->n_sides++;
        open_side *side = &walk->sides[index];
        *side = (open_side){.cell = number, .number = (uint8_t)k, .is_open = true};
        for (int i = 0; i < shape->side_sizes[k]; i++) {
            int32_t node = cell->nodes[shape->sides[k][i]];
            side->next[i] = walk->sides_at[node];
            walk->sides_at[node] = REEL_MAX_SIDES * index + i;
        }
    }
}

/* ---- Cells */

/* Code the type of a cell: that of the previous cell, or its index. */
static const reel_cell_type *code_type(cell_walk *walk, const uint8_t *given_type) {
    const reel_cell_type *last = &reel_cell_types[0];
    if (walk->n_visited) {
        last = reel_find_cell_type(walk->types[walk->n_visited - 1]);
    }
    if (reel_bit(&walk->coder, &walk->models->same_type[last->shape],
                 given_type && *given_type == last->code)) {
        return last;
    }
    int index = 0;
    while (given_type && reel_cell_types[index].code != *given_type) {
        index++;
    }
    index = (int)reel_code_raw(&walk->coder, 5, (uint32_t)index);
    if (index >= REEL_N_CELL_TYPES) {
        walk->failed = true;
        return last;
    }
    return &reel_cell_types[index];
}

/* Encoder: return the entry of a cell through side `number`: this side, and how it is rotated and
   reversed relative to an open side. NONE if no rotation makes the corners equal. */
static int entry_of(const cell_walk *walk, const open_side *gate, const reel_cell_shape *shape,
                    const int32_t *nodes, int number) {
    int size = shape->side_sizes[number];
    if (size != side_size(walk, gate)) {
        return NONE;
    }
    for (int turn = 0; turn < size; turn++) {
        for (int forward = 0; forward < 2; forward++) {
            bool fits = true;
            for (int i = 0; i < size; i++) {
                int corner = (forward ? turn + i : turn - i + size) % size;
                int32_t node = walk->numbers[nodes[shape->sides[number][i]]];
                fits &= node == side_node(walk, gate, corner);
            }
            if (fits) {
                return 2 * (REEL_MAX_SIDE_CORNERS * number + turn) + forward;
            }
        }
    }
    return NONE;
}

static int code_entry(cell_walk *walk, const open_side *gate, int shape, int entry) {
    reel_model *models = walk->models->entry[shape][gate->number];
    uint32_t node = 1;
    for (int i = ENTRY_BITS - 1; i >= 0; i--) {
        node = node << 1 | (uint32_t)reel_bit(&walk->coder, &models[node], entry >> i & 1);
    }
    return (int)(node - (1U << ENTRY_BITS));
}

/* Set the corners of the entered side; return false if the entry is invalid. */
static bool enter(cell_walk *walk, const open_side *gate, new_cell *cell, int entry) {
    int forward = entry % 2, turn = entry / 2 % REEL_MAX_SIDE_CORNERS;
    int number = entry / 2 / REEL_MAX_SIDE_CORNERS, size = side_size(walk, gate);
    const reel_cell_shape *shape = cell->shape;
    if (number >= shape->n_sides || shape->side_sizes[number] != size || turn >= size) {
        return false;
    }
    for (int i = 0; i < size; i++) {
        int corner = (forward ? turn + i : turn - i + size) % size;
        cell->nodes[shape->sides[number][i]] = side_node(walk, gate, corner);
        cell->known |= 1U << shape->sides[number][i];
    }
    cell->entry = number;
    return true;
}

/* Code the cell across the open side `gate` or, if that is NONE, any unvisited cell. */
static void code_cell(cell_walk *walk, int32_t gate, int32_t given, int entry) {
    new_cell cell = {.entry = NONE};
    bool writes = reel_is_encoder(&walk->coder);
    cell.given = writes ? walk->given.nodes + walk->given.starts[given] : NULL;
    cell.type = code_type(walk, writes ? &walk->given.types[given] : NULL);
    cell.shape = reel_shape_of(cell.type);
    int64_t start = walk->starts[walk->n_visited];
    if (walk->failed || start + reel_n_nodes(cell.type) > walk->n_nodes) {
        walk->failed = true;
        return;
    }
    if (gate != NONE) {
        const open_side *side = &walk->sides[gate];
        entry = code_entry(walk, side, cell.type->shape, entry);
        if (!enter(walk, side, &cell, entry)) {
            walk->failed = true;
            return;
        }
    }
    for (int slot = 0; slot < cell.shape->n_corners; slot++) {
        if (!(cell.known >> slot & 1U)) {
            cell.nodes[slot] = code_corner(walk, &cell, slot);
            cell.known |= 1U << slot;
        }
    }
    code_middles(walk, &cell, gate);
    if (walk->failed) {
        return;
    }
    int32_t number = (int32_t)walk->n_visited++;
    walk->types[number] = cell.type->code;
    walk->starts[number + 1] = (int32_t)(start + reel_n_nodes(cell.type));
    reel_copy(walk->nodes + start, cell.nodes, (size_t)reel_n_nodes(cell.type) * sizeof(int32_t));
    if (writes) {
        walk->given_cells[number] = given;
        walk->is_visited[given] = 1;
    }
    visit_edges(walk, &cell);
    visit_sides(walk, &cell, number);
}

/* Encoder: return the unvisited cell across an open side, or NONE, and its entry. */
static int32_t cell_behind(const cell_walk *walk, int32_t gate, int *entry) {
    const open_side *side = &walk->sides[gate];
    int32_t side_number = REEL_MAX_SIDES * walk->given_cells[side->cell] + side->number;
    int32_t mate = walk->mates[side_number], given = mate / REEL_MAX_SIDES;
    if (mate == side_number || walk->is_visited[given]) {
        return NONE;
    }
    const reel_cell_shape *shape = reel_shape_of(reel_find_cell_type(walk->given.types[given]));
    *entry = entry_of(walk, side, shape, walk->given.nodes + walk->given.starts[given],
                      mate % REEL_MAX_SIDES);
    return *entry == NONE ? NONE : given;
}

/* Code whether the next cell is across an open side. The contexts are: corners known to be on the
   surface, edges with another open side, corners, and the maximum of visited cells at these. */
static bool code_is_next(cell_walk *walk, const open_side *gate, bool is_next) {
    int size = side_size(walk, gate), n_outer = 0, n_met = 0, max_cells = 0;
    for (int i = 0; i < size; i++) {
        int32_t a = side_node(walk, gate, i), b = side_node(walk, gate, (i + 1) % size);
        n_outer += walk->is_outer[a];
        int n_lookups = 0;
        for (int32_t *link = &walk->sides_at[a];
             n_lookups < MAX_LOOKUPS && open_link(walk, link) != NONE;
             n_lookups++, link = link_after(walk, *link)) {
            const open_side *side = &walk->sides[*link / REEL_MAX_SIDES];
            int corner = *link % REEL_MAX_SIDES, n = side_size(walk, side);
            if (side_node(walk, side, (corner + 1) % n) == b ||
                side_node(walk, side, (corner + n - 1) % n) == b) {
                int n_cells = cells_at_edge(walk, a, b);
                max_cells = max_cells > n_cells ? max_cells : n_cells;
                n_met++;
                break;
            }
        }
    }
    reel_model *model =
        &walk->models->is_next[n_outer < 4 ? n_outer : 4][n_met < 4 ? n_met : 4][size][max_cells];
    return reel_bit(&walk->coder, model, is_next);
}

/* Code all cells by a breadth-first walk across their sides. */
static void walk_cells(cell_walk *walk) {
    bool writes = reel_is_encoder(&walk->coder);
    for (int64_t seed = 0; walk->n_visited < walk->n_cells && !walk->failed;) {
        if (walk->next_side == walk->n_sides) {
            while (writes && walk->is_visited[seed]) {
                seed++;
            }
            code_cell(walk, NONE, (int32_t)seed, NONE);
            continue;
        }
        int32_t gate = walk->next_side++;
        open_side *side = &walk->sides[gate];
        if (!side->is_open) {
            continue;
        }
        int entry = NONE;
        int32_t given = writes ? cell_behind(walk, gate, &entry) : NONE;
        side->is_open = false;
        if (code_is_next(walk, side, given != NONE)) {
            code_cell(walk, gate, given, entry);
            continue;
        }
        for (int i = 0; i < side_size(walk, side); i++) {
            walk->is_outer[side_node(walk, side, i)] = 1;
        }
    }
}

/* ---- Lists */

/* Code cells in their given order. A node differs from the same node of the previous cell of this
   type by about as much as the node before it. */
static void list_cells(cell_walk *walk) {
    int32_t last_nodes[REEL_N_CELL_TYPES][MAX_NODES] = {{0}};
    bool writes = reel_is_encoder(&walk->coder);
    for (; walk->n_visited < walk->n_cells && !walk->failed; walk->n_visited++) {
        const int32_t *input_nodes =
            writes ? walk->given.nodes + walk->given.starts[walk->n_visited] : NULL;
        const reel_cell_type *type =
            code_type(walk, writes ? &walk->given.types[walk->n_visited] : NULL);
        int64_t start = walk->starts[walk->n_visited], step = 0;
        int n = reel_n_nodes(type), context = 0;
        if (walk->failed || start + n > walk->n_nodes) {
            walk->failed = true;
            return;
        }
        int32_t *previous = last_nodes[type - reel_cell_types];
        for (int i = 0; i < n; i++) {
            reel_integer_model *model =
                i ? &walk->models->step[type->shape][context] : &walk->models->first[type->shape];
            int64_t residual = input_nodes ? input_nodes[i] - previous[i] - step : 0;
            residual = reel_code_integer(&walk->coder, model, (int32_t)residual);
            context = residual != 0;
            step += residual;
            int64_t node = previous[i] + step;
            if (node < 0 || node >= walk->n_verts) {
                walk->failed = true;
                return;
            }
            walk->nodes[start + i] = previous[i] = (int32_t)node;
        }
        walk->types[walk->n_visited] = type->code;
        walk->starts[walk->n_visited + 1] = (int32_t)(start + n);
    }
}

/* ---- Streams */

static int64_t max_sides(int64_t n_nodes) { return n_nodes; }

static int64_t max_edges(int64_t n_nodes) { return 2 * n_nodes; }

size_t reel_cells_code_memory(int64_t n_cells, int64_t n_nodes, int64_t n_verts) {
    size_t cells = (size_t)n_cells, verts = (size_t)n_verts;
    return reel_array_bytes(1, sizeof(cell_models)) +
           2 * reel_array_bytes(cells + 1, sizeof(int32_t)) +
           reel_array_bytes((size_t)max_sides(n_nodes), sizeof(open_side)) +
           reel_array_bytes((size_t)max_edges(n_nodes), sizeof(walked_edge)) +
           3 * reel_array_bytes(verts, sizeof(int32_t)) + reel_array_bytes(verts, 1) +
           reel_array_bytes(REEL_MAX_SIDES * cells, sizeof(int32_t)) + reel_array_bytes(cells, 1) +
           reel_match_memory(n_cells, n_verts);
}

static void reset_models(cell_models *models) {
    reel_model *first = (reel_model *)models;
    for (size_t i = 0; i < sizeof *models / sizeof *first; i++) {
        first[i] = reel_model_of(32768, 0); /* integer models consist of bit models too */
    }
}

static bool start_walk(cell_walk *walk, reel_arena *arena) {
    size_t verts = (size_t)walk->n_verts;
    walk->models = reel_allocate(arena, 1, sizeof *walk->models);
    walk->starts = reel_allocate(arena, (size_t)walk->n_cells + 1, sizeof *walk->starts);
    walk->sides = reel_allocate(arena, (size_t)max_sides(walk->n_nodes), sizeof *walk->sides);
    walk->edges = reel_allocate(arena, (size_t)max_edges(walk->n_nodes), sizeof *walk->edges);
    walk->sides_at = reel_allocate(arena, verts, sizeof *walk->sides_at);
    walk->edges_at = reel_allocate(arena, verts, sizeof *walk->edges_at);
    walk->is_outer = reel_allocate(arena, verts, 1);
    if (arena->failed) {
        return false;
    }
    reset_models(walk->models);
    walk->starts[0] = 0;
    for (size_t v = 0; v < verts; v++) {
        walk->sides_at[v] = walk->edges_at[v] = NONE;
        walk->is_outer[v] = 0;
    }
    return true;
}

static bool is_within(int64_t n_cells, int64_t n_nodes, int64_t n_verts) {
    return n_cells >= 1 && n_cells <= REEL_MAX_ITEMS && n_nodes >= n_cells &&
           n_nodes <= 4 * REEL_MAX_ITEMS && n_verts >= 1 && n_verts <= REEL_MAX_ITEMS;
}

static int64_t code_cells(cell_walk *walk, bool listed) {
    if (reel_code_raw(&walk->coder, 1, listed)) {
        list_cells(walk);
    } else {
        walk_cells(walk);
    }
    walk->failed |= walk->starts[walk->n_visited] != walk->n_nodes;
    return walk->failed ? reel_failure(REEL_CORRUPT, walk->coder.position)
                        : reel_finish(&walk->coder);
}

int64_t reel_cells_encode(void *memory, size_t memory_size, const uint8_t *types, int64_t n_cells,
                          const int32_t *nodes, int64_t n_nodes, int64_t n_verts, int64_t listed,
                          uint8_t *internal_types, int32_t *internal_nodes, int32_t *given_cells,
                          int32_t *internal_to_given, uint8_t *out, size_t capacity) {
    if (!is_within(n_cells, n_nodes, n_verts)) {
        return reel_failure(REEL_INVALID, 0);
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
    cell_walk walk = {.types = internal_types,
                      .nodes = internal_nodes,
                      .n_cells = n_cells,
                      .n_nodes = n_nodes,
                      .n_verts = n_verts,
                      .given_cells = given_cells,
                      .given_of = internal_to_given};
    int32_t *starts = reel_allocate(&arena, (size_t)n_cells + 1, sizeof *starts);
    int32_t *mates = reel_allocate(&arena, REEL_MAX_SIDES * (size_t)n_cells, sizeof *mates);
    walk.numbers = reel_allocate(&arena, (size_t)n_verts, sizeof *walk.numbers);
    walk.is_visited = reel_allocate(&arena, (size_t)n_cells, 1);
    if (!start_walk(&walk, &arena)) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    int64_t failure = reel_start_cells(types, n_cells, nodes, n_nodes, n_verts, starts);
    if (failure) {
        return failure;
    }
    walk.given = (reel_cell_list){types, nodes, starts, n_cells};
    walk.mates = mates;
    if (!reel_match_sides(&walk.given, n_verts, &arena, mates)) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t v = 0; v < n_verts; v++) {
        walk.numbers[v] = NONE;
    }
    reel_zero(walk.is_visited, (size_t)n_cells);
    walk.coder = reel_start_encoder(out, capacity);
    int64_t size = code_cells(&walk, listed != 0);
    for (int32_t i = 0; listed && i < n_cells; i++) {
        given_cells[i] = i;
    }
    for (int32_t v = 0; v < n_verts; v++) { /* nodes that no cell uses get the last numbers */
        if (listed) {
            internal_to_given[v] = v;
        } else if (walk.numbers[v] == NONE) {
            internal_to_given[walk.n_numbered++] = v;
        }
    }
    return size;
}

int64_t reel_cells_decode(void *memory, size_t memory_size, const uint8_t *in, size_t size,
                          int64_t n_cells, int64_t n_nodes, int64_t n_verts, uint8_t *types,
                          int32_t *nodes) {
    if (!is_within(n_cells, n_nodes, n_verts)) {
        return reel_failure(REEL_INVALID, 0);
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
    cell_walk walk = {
        .types = types, .nodes = nodes, .n_cells = n_cells, .n_nodes = n_nodes, .n_verts = n_verts};
    if (!start_walk(&walk, &arena)) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    walk.coder = reel_start_decoder(in, size);
    return code_cells(&walk, false);
}
