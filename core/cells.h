/* Cells: lines, polygons and solids, with nodes on edges and sides. docs/format.md, CELLS. */

#ifndef REEL_CELLS_H
#define REEL_CELLS_H

#include "adjacency.h"

#define REEL_MAX_SIDES 8
#define REEL_MAX_SIDE_CORNERS 6
#define REEL_MAX_CELL_CORNERS 12
#define REEL_MAX_EDGES 18

/* Corners, edges and sides of a cell. Sides are the faces of a solid, counterclockwise as seen from
   outside, or the edges of a polygon; a line has none. */
typedef struct {
    uint8_t n_corners, n_edges, n_sides;
    bool is_solid;
    uint8_t edges[REEL_MAX_EDGES][2];
    uint8_t side_sizes[REEL_MAX_SIDES];
    uint8_t sides[REEL_MAX_SIDES][REEL_MAX_SIDE_CORNERS];
} reel_cell_shape;

/* Nodes of a cell: the corners, then one on each edge if `has_mids`, then one on each of the sides
   in `centers`, then one inside if `has_middle`. */
typedef struct {
    uint8_t code; /* cell type of VTK */
    uint8_t shape;
    bool has_mids, has_middle;
    uint8_t n_centers;
    uint8_t centers[REEL_MAX_SIDES];
} reel_cell_type;

#define REEL_N_SHAPES 10
#define REEL_N_CELL_TYPES 22

extern const reel_cell_shape reel_cell_shapes[REEL_N_SHAPES];
extern const reel_cell_type reel_cell_types[REEL_N_CELL_TYPES];

REEL_INLINE const reel_cell_shape *reel_shape_of(const reel_cell_type *type) {
    return &reel_cell_shapes[type->shape];
}

REEL_INLINE int reel_n_nodes(const reel_cell_type *type) {
    const reel_cell_shape *shape = reel_shape_of(type);
    return shape->n_corners + (type->has_mids ? shape->n_edges : 0) + type->n_centers +
           type->has_middle;
}

/* The type of a code, or NULL. */
const reel_cell_type *reel_find_cell_type(uint32_t code);

/* Sort up to REEL_MAX_SIDE_CORNERS nodes and drop duplicates; returns how many remain. */
int reel_sort_nodes(const int32_t *nodes, int n, int32_t *sorted);

/* Cells; the nodes of cell i are nodes[starts[i]] .. nodes[starts[i + 1] - 1]. */
typedef struct {
    const uint8_t *types; /* codes */
    const int32_t *nodes;
    const int32_t *starts; /* n + 1 */
    int64_t n;
} reel_cell_list;

/* Pair the sides of different cells that have the same nodes. Side k of cell c has the number
   8 c + k; its entry of `mates` is the number of its partner, or its own if it has none. Sides with
   the same nodes are paired in order. Returns false if the arena is too small. */
bool reel_match_sides(const reel_cell_list *cells, int64_t n_verts, reel_arena *arena,
                      int32_t *mates);

/* Bytes of arena that `reel_match_sides` needs. */
size_t reel_match_memory(int64_t n_cells, int64_t n_verts);

/* Check cells and fill starts[n_cells + 1]; returns 0 or a failure. */
int64_t reel_start_cells(const uint8_t *types, int64_t n_cells, const int32_t *nodes,
                         int64_t n_nodes, int64_t n_verts, int32_t *starts);

#endif
