/* Surface and adjacency of cells: docs/format.md, CELLS. */

#include "cells.h"

enum { POINT, LINE, TRIANGLE, QUAD, TETRA, PYRAMID, WEDGE, HEXAHEDRON, PENTAGONAL, HEXAGONAL };

const reel_cell_shape reel_cell_shapes[REEL_N_SHAPES] = {
    [POINT] = {.n_corners = 1},
    [LINE] = {.n_corners = 2, .n_edges = 1, .edges = {{0, 1}}},
    [TRIANGLE] = {3, 3, 3, false, {{0, 1}, {1, 2}, {2, 0}}, {2, 2, 2}, {{0, 1}, {1, 2}, {2, 0}}},
    [QUAD] = {4,
              4,
              4,
              false,
              {{0, 1}, {1, 2}, {2, 3}, {3, 0}},
              {2, 2, 2, 2},
              {{0, 1}, {1, 2}, {2, 3}, {3, 0}}},
    [TETRA] = {4,
               6,
               4,
               true,
               {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}},
               {3, 3, 3, 3},
               {{0, 1, 3}, {1, 2, 3}, {2, 0, 3}, {0, 2, 1}}},
    [PYRAMID] = {5,
                 8,
                 5,
                 true,
                 {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {0, 4}, {1, 4}, {2, 4}, {3, 4}},
                 {4, 3, 3, 3, 3},
                 {{0, 3, 2, 1}, {0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}}},
    [WEDGE] = {6,
               9,
               5,
               true,
               {{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5}, {5, 3}, {0, 3}, {1, 4}, {2, 5}},
               {3, 3, 4, 4, 4},
               {{0, 2, 1}, {3, 4, 5}, {0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}}},
    [HEXAHEDRON] =
        {8,
         12,
         6,
         true,
         {{0, 1},
          {1, 2},
          {2, 3},
          {3, 0},
          {4, 5},
          {5, 6},
          {6, 7},
          {7, 4},
          {0, 4},
          {1, 5},
          {2, 6},
          {3, 7}},
         {4, 4, 4, 4, 4, 4},
         {{0, 4, 7, 3}, {1, 2, 6, 5}, {0, 1, 5, 4}, {3, 7, 6, 2}, {0, 3, 2, 1}, {4, 5, 6, 7}}},
    [PENTAGONAL] = {10,
                    15,
                    7,
                    true,
                    {{0, 1},
                     {1, 2},
                     {2, 3},
                     {3, 4},
                     {4, 0},
                     {5, 6},
                     {6, 7},
                     {7, 8},
                     {8, 9},
                     {9, 5},
                     {0, 5},
                     {1, 6},
                     {2, 7},
                     {3, 8},
                     {4, 9}},
                    {5, 5, 4, 4, 4, 4, 4},
                    {{0, 4, 3, 2, 1},
                     {5, 6, 7, 8, 9},
                     {0, 1, 6, 5},
                     {1, 2, 7, 6},
                     {2, 3, 8, 7},
                     {3, 4, 9, 8},
                     {4, 0, 5, 9}}},
    [HEXAGONAL] =
        {12,
         18,
         8,
         true,
         {{0, 1},
          {1, 2},
          {2, 3},
          {3, 4},
          {4, 5},
          {5, 0},
          {6, 7},
          {7, 8},
          {8, 9},
          {9, 10},
          {10, 11},
          {11, 6},
          {0, 6},
          {1, 7},
          {2, 8},
          {3, 9},
          {4, 10},
          {5, 11}},
         {6, 6, 4, 4, 4, 4, 4, 4},
         {{0, 5, 4, 3, 2, 1},
          {6, 7, 8, 9, 10, 11},
          {0, 1, 7, 6},
          {1, 2, 8, 7},
          {2, 3, 9, 8},
          {3, 4, 10, 9},
          {4, 5, 11, 10},
          {5, 0, 6, 11}}},
};

const reel_cell_type reel_cell_types[REEL_N_CELL_TYPES] = {
    {1, POINT, false, false, 0, {0}},
    {3, LINE, false, false, 0, {0}},
    {5, TRIANGLE, false, false, 0, {0}},
    {9, QUAD, false, false, 0, {0}},
    {10, TETRA, false, false, 0, {0}},
    {12, HEXAHEDRON, false, false, 0, {0}},
    {13, WEDGE, false, false, 0, {0}},
    {14, PYRAMID, false, false, 0, {0}},
    {15, PENTAGONAL, false, false, 0, {0}},
    {16, HEXAGONAL, false, false, 0, {0}},
    {21, LINE, true, false, 0, {0}},
    {22, TRIANGLE, true, false, 0, {0}},
    {23, QUAD, true, false, 0, {0}},
    {24, TETRA, true, false, 0, {0}},
    {25, HEXAHEDRON, true, false, 0, {0}},
    {26, WEDGE, true, false, 0, {0}},
    {27, PYRAMID, true, false, 0, {0}},
    {28, QUAD, true, true, 0, {0}},
    {29, HEXAHEDRON, true, true, 6, {0, 1, 2, 3, 4, 5}},
    {32, WEDGE, true, false, 3, {2, 3, 4}},
    {33, HEXAHEDRON, true, false, 4, {2, 1, 3, 0}},
    {34, TRIANGLE, true, true, 0, {0}},
};

/* Place of each code in `reel_cell_types`, plus 1. */
static const uint8_t places[] = {
    [1] = 1,   [3] = 2,   [5] = 3,   [9] = 4,   [10] = 5,  [12] = 6,  [13] = 7,  [14] = 8,
    [15] = 9,  [16] = 10, [21] = 11, [22] = 12, [23] = 13, [24] = 14, [25] = 15, [26] = 16,
    [27] = 17, [28] = 18, [29] = 19, [32] = 20, [33] = 21, [34] = 22,
};

const reel_cell_type *reel_find_cell_type(uint32_t code) {
    bool is_known = code < sizeof places && places[code];
    return is_known ? &reel_cell_types[places[code] - 1] : NULL;
}

int64_t reel_cell_size(int64_t code) {
    const reel_cell_type *type = reel_find_cell_type((uint32_t)code);
    return type ? reel_n_nodes(type) : 0;
}

int64_t reel_start_cells(const uint8_t *types, int64_t n_cells, const int32_t *nodes,
                         int64_t n_nodes, int64_t n_verts, int32_t *starts) {
    int64_t end = 0;
    for (int64_t i = 0; i < n_cells; i++) {
        const reel_cell_type *type = reel_find_cell_type(types[i]);
        starts[i] = (int32_t)end;
        end += type ? reel_n_nodes(type) : n_nodes + 1;
        if (end > n_nodes) {
            return reel_failure(REEL_INVALID, (uint64_t)i);
        }
        for (int64_t k = starts[i]; k < end; k++) {
            if (nodes[k] < 0 || nodes[k] >= n_verts) {
                return reel_failure(REEL_INVALID, (uint64_t)i);
            }
        }
    }
    starts[n_cells] = (int32_t)end;
    return end == n_nodes ? 0 : reel_failure(REEL_INVALID, (uint64_t)n_cells);
}

int reel_sort_nodes(const int32_t *nodes, int n, int32_t *sorted) {
    int count = 0;
    for (int i = 0; i < n; i++) {
        int index = count;
        while (index > 0 && sorted[index - 1] > nodes[i]) {
            index--;
        }
        if (index > 0 && sorted[index - 1] == nodes[i]) {
            continue;
        }
        for (int k = count++; k > index; k--) {
            sorted[k] = sorted[k - 1];
        }
        sorted[index] = nodes[i];
    }
    return count;
}

/* ---- Sides with the same nodes */

#define FEW_SIDES 64

typedef struct {
    int32_t nodes[REEL_MAX_SIDE_CORNERS]; /* sorted, then -1 */
    int n;
} side_key;

static const reel_cell_shape *shape_of_cell(const reel_cell_list *cells, int64_t cell) {
    return reel_shape_of(reel_find_cell_type(cells->types[cell]));
}

static int32_t lowest_node(const reel_cell_list *cells, const reel_cell_shape *shape,
                           int32_t side) {
    const int32_t *nodes = cells->nodes + cells->starts[side / REEL_MAX_SIDES];
    int local_side = side % REEL_MAX_SIDES;
    int32_t lowest = nodes[shape->sides[local_side][0]];
    for (int i = 1; i < shape->side_sizes[local_side]; i++) {
        int32_t node = nodes[shape->sides[local_side][i]];
        lowest = node < lowest ? node : lowest;
    }
    return lowest;
}

static side_key key_of(const reel_cell_list *cells, int32_t side) {
    const reel_cell_shape *shape = shape_of_cell(cells, side / REEL_MAX_SIDES);
    const int32_t *nodes = cells->nodes + cells->starts[side / REEL_MAX_SIDES];
    int local_side = side % REEL_MAX_SIDES;
    int32_t corners[REEL_MAX_SIDE_CORNERS];
    for (int i = 0; i < shape->side_sizes[local_side]; i++) {
        corners[i] = nodes[shape->sides[local_side][i]];
    }
    side_key key = {.nodes = {-1, -1, -1, -1, -1, -1}};
    key.n = reel_sort_nodes(corners, shape->side_sizes[local_side], key.nodes);
    return key;
}

/* Negative, 0 or positive: the order of two keys. */
static int compare_keys(const side_key *a, const side_key *b) {
    for (int i = 0; i < REEL_MAX_SIDE_CORNERS; i++) {
        if (a->nodes[i] != b->nodes[i]) {
            return a->nodes[i] < b->nodes[i] ? -1 : 1;
        }
    }
    return 0;
}

/* Order of two sides: by nodes, then by number. */
static bool is_before(const reel_cell_list *cells, int32_t a, int32_t b) {
    side_key first = key_of(cells, a), second = key_of(cells, b);
    int order = compare_keys(&first, &second);
    return order < 0 || (!order && a < b);
}

static void match(int32_t a, int32_t b, int32_t *mates) {
    mates[a] = b;
    mates[b] = a;
}

/* Move side `parent` of a heap of n sides down until none of its children is after it. */
static void sift(const reel_cell_list *cells, int32_t *sides, int64_t parent, int64_t n) {
    for (int64_t child = 2 * parent + 1; child < n; parent = child, child = 2 * parent + 1) {
        if (child + 1 < n && is_before(cells, sides[child], sides[child + 1])) {
            child++;
        }
        if (!is_before(cells, sides[parent], sides[child])) {
            return;
        }
        int32_t swapped = sides[parent];
        sides[parent] = sides[child];
        sides[child] = swapped;
    }
}

/* Sort a few sides, whose numbers ascend, and match neighbors with equal nodes. */
static void match_few_sides(const reel_cell_list *cells, int32_t *sides, int64_t n,
                            int32_t *mates) {
    side_key keys[FEW_SIDES];
    for (int64_t i = 0; i < n; i++) {
        int32_t side = sides[i];
        side_key key = key_of(cells, side);
        int64_t index = i;
        for (; index > 0 && compare_keys(&keys[index - 1], &key) > 0; index--) {
            keys[index] = keys[index - 1];
            sides[index] = sides[index - 1];
        }
        keys[index] = key;
        sides[index] = side;
    }
    for (int64_t i = 0; i + 1 < n; i++) {
        if (!compare_keys(&keys[i], &keys[i + 1])) {
            match(sides[i], sides[i + 1], mates);
            i++;
        }
    }
}

/* The same for many sides, by a heap sort. */
static void match_many_sides(const reel_cell_list *cells, int32_t *sides, int64_t n,
                             int32_t *mates) {
    for (int64_t i = n / 2; i-- > 0;) {
        sift(cells, sides, i, n);
    }
    for (int64_t last = n - 1; last > 0; last--) {
        int32_t greatest = sides[0];
        sides[0] = sides[last];
        sides[last] = greatest;
        sift(cells, sides, 0, last);
    }
    for (int64_t i = 0; i + 1 < n; i++) {
        side_key key = key_of(cells, sides[i]), next = key_of(cells, sides[i + 1]);
        if (!compare_keys(&key, &next)) {
            match(sides[i], sides[i + 1], mates);
            i++;
        }
    }
}

size_t reel_match_memory(int64_t n_cells, int64_t n_verts) {
    return reel_array_bytes((size_t)n_verts + 1, sizeof(int32_t)) +
           reel_array_bytes(REEL_MAX_SIDES * (size_t)n_cells, sizeof(int32_t));
}

bool reel_match_sides(const reel_cell_list *cells, int64_t n_verts, reel_arena *arena,
                      int32_t *mates) {
    int32_t *starts = reel_allocate(arena, (size_t)n_verts + 1, sizeof *starts);
    int32_t *sides = reel_allocate(arena, REEL_MAX_SIDES * (size_t)cells->n, sizeof *sides);
    if (arena->failed) {
        return false;
    }
    reel_zero(starts, ((size_t)n_verts + 1) * sizeof *starts);
    for (int pass = 0; pass < 2; pass++) { /* count, then list, the sides of each lowest node */
        for (int32_t cell = 0; cell < cells->n; cell++) {
            const reel_cell_shape *shape = shape_of_cell(cells, cell);
            for (int k = 0; k < shape->n_sides; k++) {
                int32_t side = REEL_MAX_SIDES * cell + k, low = lowest_node(cells, shape, side);
                if (pass) {
                    sides[starts[low]++] = side;
                } else {
                    starts[low + 1]++;
                }
                mates[side] = side;
            }
        }
        if (!pass) {
            reel_prefix_sum(starts, n_verts);
        }
    }
    for (int64_t low = 0, begin = 0; low < n_verts; begin = starts[low++]) {
        int64_t n = starts[low] - begin;
        (n <= FEW_SIDES ? match_few_sides : match_many_sides)(cells, sides + begin, n, mates);
    }
    return true;
}

/* ---- The surface */

size_t reel_cells_memory(int64_t n_cells, int64_t n_verts) {
    return reel_array_bytes((size_t)n_cells + 1, sizeof(int32_t)) +
           reel_array_bytes(REEL_MAX_SIDES * (size_t)n_cells, sizeof(int32_t)) +
           reel_match_memory(n_cells, n_verts);
}

/* Allocate and fill the starts of cells, and the mates of their sides; returns 0 or a failure. */
static int64_t prepare(reel_arena *arena, const uint8_t *types, int64_t n_cells,
                       const int32_t *nodes, int64_t n_nodes, int64_t n_verts,
                       reel_cell_list *cells, int32_t **mates) {
    int32_t *starts = reel_allocate(arena, (size_t)n_cells + 1, sizeof *starts);
    *mates = reel_allocate(arena, REEL_MAX_SIDES * (size_t)n_cells, sizeof **mates);
    if (arena->failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    int64_t failure = reel_start_cells(types, n_cells, nodes, n_nodes, n_verts, starts);
    *cells = (reel_cell_list){types, nodes, starts, n_cells};
    if (!failure && !reel_match_sides(cells, n_verts, arena, *mates)) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    return failure;
}

/* List the different nodes of a polygon in order; returns their number. */
static int outline(const int32_t *nodes, const uint8_t *corners, int n, int32_t *polygon) {
    int count = 0;
    for (int i = 0; i < n; i++) {
        int32_t node = nodes[corners ? corners[i] : i];
        bool is_new = true;
        for (int k = 0; k < count; k++) {
            is_new &= polygon[k] != node;
        }
        if (is_new) {
            polygon[count++] = node;
        }
    }
    return count;
}

int64_t reel_cells_surface(void *memory, size_t memory_size, const uint8_t *types, int64_t n_cells,
                           const int32_t *nodes, int64_t n_nodes, int64_t n_verts, int64_t capacity,
                           int32_t *triangles, int32_t *sizes, int32_t *owners,
                           int64_t *n_polygons) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    reel_cell_list cells;
    int32_t *mates;
    int64_t failure = prepare(&arena, types, n_cells, nodes, n_nodes, n_verts, &cells, &mates);
    if (failure) {
        return failure;
    }
    int64_t n_triangles = 0;
    *n_polygons = 0;
    for (int32_t cell = 0; cell < n_cells; cell++) {
        const reel_cell_shape *shape = shape_of_cell(&cells, cell);
        const int32_t *cell_nodes = nodes + cells.starts[cell];
        int n_outlines = shape->is_solid ? shape->n_sides : shape->n_sides > 0;
        for (int k = 0; k < n_outlines; k++) {
            int32_t polygon[REEL_MAX_SIDE_CORNERS], side = REEL_MAX_SIDES * cell + k;
            int n = shape->is_solid
                        ? outline(cell_nodes, shape->sides[k], shape->side_sizes[k], polygon)
                        : outline(cell_nodes, NULL, shape->n_corners, polygon);
            if (n < 3 || (shape->is_solid && mates[side] != side)) {
                continue;
            }
            for (int i = 0; i + 2 < n && n_triangles + i < capacity; i++) {
                int32_t *triangle = triangles + 3 * (n_triangles + i);
                triangle[0] = polygon[0];
                triangle[1] = polygon[i + 1];
                triangle[2] = polygon[i + 2];
            }
            if (n_triangles + n - 2 <= capacity) {
                sizes[*n_polygons] = n;
                owners[*n_polygons] = cell;
            }
            n_triangles += n - 2;
            ++*n_polygons;
        }
    }
    return n_triangles;
}

/* ---- Adjacency */

typedef struct {
    int32_t *edges;
    int64_t n;
} edge_list;

static void add_edge(edge_list *list, int32_t a, int32_t b) {
    if (a != b) {
        list->edges[2 * list->n] = a < b ? a : b;
        list->edges[2 * list->n++ + 1] = a < b ? b : a;
    }
}

/* Add the edges of a cell. A node on an edge splits it. A node on a side is adjacent to the nodes
   on the edges of the side; a node inside to those on the sides or, without any, on the edges. */
static void add_cell_edges(edge_list *list, const reel_cell_type *type, const int32_t *nodes) {
    const reel_cell_shape *shape = reel_shape_of(type);
    const int32_t *mids = nodes + shape->n_corners, *centers = mids + shape->n_edges;
    for (int i = 0; i < shape->n_edges; i++) {
        int32_t a = nodes[shape->edges[i][0]], b = nodes[shape->edges[i][1]];
        add_edge(list, a, type->has_mids ? mids[i] : b);
        if (type->has_mids) {
            add_edge(list, b, mids[i]);
        }
    }
    for (int i = 0; i < type->n_centers; i++) {
        uint32_t corners = 0;
        for (int k = 0; k < shape->side_sizes[type->centers[i]]; k++) {
            corners |= 1U << shape->sides[type->centers[i]][k];
        }
        for (int k = 0; k < shape->n_edges; k++) {
            if (corners >> shape->edges[k][0] & corners >> shape->edges[k][1] & 1U) {
                add_edge(list, mids[k], centers[i]);
            }
        }
    }
    if (type->has_middle) {
        int n = type->n_centers ? type->n_centers : shape->n_edges;
        for (int i = 0; i < n; i++) {
            add_edge(list, type->n_centers ? centers[i] : mids[i], centers[type->n_centers]);
        }
    }
}

size_t reel_cells_adjacency_memory(int64_t n_cells, int64_t n_nodes, int64_t n_verts,
                                   int64_t of_cells) {
    reel_arena arena = REEL_MEASURE;
    size_t edges = of_cells ? REEL_MAX_SIDES / 2 * (size_t)n_cells : 2 * (size_t)n_nodes;
    reel_allocate(&arena, (size_t)n_cells + 1, sizeof(int32_t));
    reel_allocate_adjacency_builder(&arena, (size_t)(of_cells ? n_cells : n_verts), edges);
    return arena.used + (of_cells ? reel_cells_memory(n_cells, n_verts) : 0);
}

int64_t reel_cells_adjacency(void *memory, size_t memory_size, const uint8_t *types,
                             int64_t n_cells, const int32_t *nodes, int64_t n_nodes,
                             int64_t n_verts, int64_t of_cells, int32_t *starts, int32_t *near) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    edge_list list = {.edges = near};
    reel_cell_list cells;
    int64_t n = of_cells ? n_cells : n_verts;
    if (of_cells) {
        int32_t *mates;
        int64_t failure = prepare(&arena, types, n_cells, nodes, n_nodes, n_verts, &cells, &mates);
        for (int32_t cell = 0; !failure && cell < n_cells; cell++) {
            for (int k = 0; k < shape_of_cell(&cells, cell)->n_sides; k++) {
                int32_t mate = mates[REEL_MAX_SIDES * cell + k] / REEL_MAX_SIDES;
                if (mate > cell) {
                    add_edge(&list, cell, mate);
                }
            }
        }
        if (failure) {
            return failure;
        }
    } else {
        int32_t *cell_starts = reel_allocate(&arena, (size_t)n_cells + 1, sizeof *cell_starts);
        int64_t failure =
            arena.failed ? reel_failure(REEL_NO_MEMORY, 0)
                         : reel_start_cells(types, n_cells, nodes, n_nodes, n_verts, cell_starts);
        if (failure) {
            return failure;
        }
        for (int64_t i = 0; i < n_cells; i++) {
            add_cell_edges(&list, reel_find_cell_type(types[i]), nodes + cell_starts[i]);
        }
    }
    reel_adjacency_builder builder =
        reel_allocate_adjacency_builder(&arena, (size_t)n, (size_t)list.n);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    return reel_build_adjacency(&builder, (int32_t)n, (int32_t)list.n, starts, near);
}
