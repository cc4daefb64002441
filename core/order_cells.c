/* Coding of the original order of cells, then of their vertices, relative to the internal order of
   the connectivity. docs/format.md, "ORDER", "Cells". */

#include "cells.h"
#include "order_items.h"

typedef struct {
    const uint8_t *types;
    const int32_t *nodes;
    int64_t n_cells, n_nodes, n_verts;
    int32_t *cell_sequence;   /* cell of each original number */
    int32_t *vertex_sequence; /* vertex of each original number */
} cell_order;

static int64_t max_neighbors(const cell_order *order, bool of_cells) {
    return of_cells ? REEL_MAX_SIDES * order->n_cells : 4 * order->n_nodes;
}

/* Find the neighbors of cells across sides, or of vertices along the edges of cells, ascending. */
static int64_t find_cell_graph(reel_arena *arena, const cell_order *order, bool of_cells,
                               reel_item_graph *graph) {
    int64_t n = of_cells ? order->n_cells : order->n_verts;
    *graph = reel_allocate_item_graph(arena, n, max_neighbors(order, of_cells));
    reel_arena scratch = *arena;
    size_t size =
        reel_cells_adjacency_memory(order->n_cells, order->n_nodes, order->n_verts, of_cells);
    int32_t *starts = reel_allocate(&scratch, (size_t)n + 1, sizeof *starts);
    void *memory = reel_allocate(&scratch, size, 1);
    if (scratch.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    int64_t result =
        reel_cells_adjacency(memory, size, order->types, order->n_cells, order->nodes,
                             order->n_nodes, order->n_verts, of_cells, starts, graph->near);
    for (int64_t i = 0; result >= 0 && i <= n; i++) {
        graph->starts[i] = starts[i];
    }
    return result;
}

static int64_t code_cells(reel_range_coder *coder, reel_arena arena, const cell_order *order) {
    reel_item_graph graph;
    int64_t result = find_cell_graph(&arena, order, true, &graph);
    return result < 0 ? result : reel_code_items(coder, arena, &graph, order->cell_sequence);
}

/* Name vertices by their first use in the cells in original order, unused ones last. `nodes`
   receives the new names of the cells' nodes; those of cell i begin at starts[i]. */
static void name_nodes(const cell_order *order, const int32_t *starts, reel_vertex_names *names,
                       int32_t *nodes) {
    for (int64_t i = 0; i < order->n_cells; i++) {
        int32_t cell = order->cell_sequence[i];
        for (int32_t k = starts[cell]; k < starts[cell + 1]; k++) {
            nodes[k] = reel_name_vertex(names, order->nodes[k]);
        }
    }
    reel_name_unused(names);
}

static int64_t code_cell_vertices(reel_range_coder *coder, reel_arena arena,
                                  const cell_order *order) {
    cell_order renumbered = *order;
    reel_item_graph graph;
    reel_vertex_names names = reel_start_names(&arena, order->n_verts);
    int32_t *nodes = reel_allocate(&arena, (size_t)order->n_nodes, sizeof *nodes);
    reel_arena scratch = arena;
    int32_t *starts = reel_allocate(&scratch, (size_t)order->n_cells + 1, sizeof *starts);
    if (scratch.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    int64_t result = reel_start_cells(order->types, order->n_cells, order->nodes, order->n_nodes,
                                      order->n_verts, starts);
    if (result < 0) {
        return result;
    }
    name_nodes(order, starts, &names, nodes);
    renumbered.nodes = nodes;
    result = find_cell_graph(&arena, &renumbered, false, &graph);
    return result < 0 ? result
                      : reel_code_named(coder, arena, &graph, &names, order->vertex_sequence);
}

static int64_t code_cell_order(reel_range_coder *coder, void *memory, size_t memory_size,
                               const cell_order *order) {
    int64_t result = code_cells(coder, reel_arena_of(memory, memory_size), order);
    if (result >= 0) {
        result = code_cell_vertices(coder, reel_arena_of(memory, memory_size), order);
    }
    return result < 0 ? result : reel_finish(coder);
}

size_t reel_cells_order_memory(int64_t n_cells, int64_t n_nodes, int64_t n_verts) {
    const cell_order order = {.n_cells = n_cells, .n_nodes = n_nodes, .n_verts = n_verts};
    size_t max_size = 0;
    for (int of_cells = 0; of_cells < 2; of_cells++) {
        int64_t n = of_cells ? n_cells : n_verts;
        size_t graph = reel_item_graph_bytes(n, max_neighbors(&order, of_cells));
        size_t adjacency =
            reel_array_bytes((size_t)n + 1, sizeof(int32_t)) +
            reel_array_bytes(reel_cells_adjacency_memory(n_cells, n_nodes, n_verts, of_cells), 1);
        size_t coder = reel_item_coder_bytes(n);
        size_t size = graph + (adjacency > coder ? adjacency : coder);
        max_size = max_size > size ? max_size : size;
    }
    return max_size + reel_vertex_names_bytes(n_verts) +
           reel_array_bytes((size_t)n_nodes, sizeof(int32_t)) +
           reel_array_bytes((size_t)n_cells + 1, sizeof(int32_t));
}

int64_t reel_cells_order_encode(void *memory, size_t memory_size, const uint8_t *types,
                                int64_t n_cells, const int32_t *nodes, int64_t n_nodes,
                                int64_t n_verts, int32_t *cell_sequence, int32_t *vertex_sequence,
                                uint8_t *out, size_t capacity) {
    cell_order order = {types, nodes, n_cells, n_nodes, n_verts, cell_sequence, vertex_sequence};
    reel_range_coder coder = reel_start_encoder(out, capacity);
    return code_cell_order(&coder, memory, memory_size, &order);
}

int64_t reel_cells_order_decode(void *memory, size_t memory_size, const uint8_t *in, size_t size,
                                const uint8_t *types, int64_t n_cells, const int32_t *nodes,
                                int64_t n_nodes, int64_t n_verts, int32_t *cell_sequence,
                                int32_t *vertex_sequence) {
    cell_order order = {types, nodes, n_cells, n_nodes, n_verts, cell_sequence, vertex_sequence};
    reel_range_coder coder = reel_start_decoder(in, size);
    return code_cell_order(&coder, memory, memory_size, &order);
}
