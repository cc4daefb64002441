/* Fuzz target of cells: coding, surface and adjacency. */

#include <string.h>

#include "fuzz.h"

typedef struct {
    int64_t n, n_nodes, n_verts;
    uint8_t *types;
    int32_t *nodes;
} cell_mesh;

static int64_t any_type(void) {
    for (;;) {
        int64_t type = fuzz_one_in(3) ? 12 : fuzz_one_in(2) ? 10 : fuzz_below(36);
        if (reel_cell_size(type)) {
            return type;
        }
    }
}

/* Make random cells that share nodes: there are few nodes, and most nodes of a cell are equal or
   next to nodes of the previous cell. */
static cell_mesh make_cells(void) {
    cell_mesh cells = {.n = 1 + fuzz_below(30), .n_verts = 1 + fuzz_below(60)};
    cells.types = fuzz_allocate(cells.n, 1);
    int64_t type = any_type();
    for (int64_t i = 0; i < cells.n; i++) {
        type = fuzz_one_in(4) ? any_type() : type;
        cells.types[i] = (uint8_t)type;
        cells.n_nodes += reel_cell_size(type);
    }
    cells.nodes = fuzz_allocate(cells.n_nodes, sizeof *cells.nodes);
    for (int64_t i = 0; i < cells.n_nodes; i++) {
        int64_t node = i >= 8 && !fuzz_one_in(4)
                           ? cells.nodes[i - 4 - fuzz_below(5)] + fuzz_below(2)
                           : fuzz_below(cells.n_verts);
        cells.nodes[i] = (int32_t)(node % cells.n_verts);
    }
    return cells;
}

static void check_surface(const cell_mesh *cells) {
    int64_t n_polygons = 0, capacity = fuzz_below(40);
    size_t size = reel_cells_memory(cells->n, cells->n_verts);
    for (int round = 0; round < 2; round++) {
        int32_t *triangles = fuzz_allocate(3 * capacity, sizeof *triangles);
        int32_t *sizes = fuzz_allocate(capacity, sizeof *sizes);
        int32_t *owners = fuzz_allocate(capacity, sizeof *owners);
        int64_t result = reel_cells_surface(FUZZ_MEMORY(size), cells->types, cells->n, cells->nodes,
                                            cells->n_nodes, cells->n_verts, capacity, triangles,
                                            sizes, owners, &n_polygons);
        FUZZ_CHECK(result >= n_polygons && n_polygons >= 0);
        if (result <= capacity) {
            fuzz_hash(triangles, 3 * result, sizeof *triangles);
            fuzz_hash(sizes, n_polygons, sizeof *sizes);
            fuzz_hash(owners, n_polygons, sizeof *owners);
        }
        capacity = result;
    }
}

static void check_adjacency(const cell_mesh *cells, int64_t of_cells) {
    int64_t n = of_cells ? cells->n : cells->n_verts;
    int64_t capacity = of_cells ? 8 * cells->n : 4 * cells->n_nodes;
    int32_t *starts = fuzz_allocate(n + 1, sizeof *starts);
    int32_t *near = fuzz_allocate(capacity, sizeof *near);
    size_t size = reel_cells_adjacency_memory(cells->n, cells->n_nodes, cells->n_verts, of_cells);
    int64_t result = reel_cells_adjacency(FUZZ_MEMORY(size), cells->types, cells->n, cells->nodes,
                                          cells->n_nodes, cells->n_verts, of_cells, starts, near);
    FUZZ_CHECK(result >= 0 && result == starts[n]);
    fuzz_hash(near, result, sizeof *near);
}

static int64_t decode(fuzz_bytes bytes, const cell_mesh *cells, uint8_t *types,
                      int32_t *nodes) {
    size_t size = reel_cells_code_memory(cells->n, cells->n_nodes, cells->n_verts);
    return reel_cells_decode(FUZZ_MEMORY(size), bytes.bytes, bytes.size, cells->n, cells->n_nodes,
                             cells->n_verts, types, nodes);
}

static int64_t decode_order(fuzz_bytes bytes, const cell_mesh *cells, int32_t *cell_sequence,
                            int32_t *vertex_sequence) {
    size_t size = reel_cells_order_memory(cells->n, cells->n_nodes, cells->n_verts);
    return reel_cells_order_decode(FUZZ_MEMORY(size), bytes.bytes, bytes.size, cells->types,
                                   cells->n, cells->nodes, cells->n_nodes, cells->n_verts,
                                   cell_sequence, vertex_sequence);
}

/* Code a random order of cells and vertices. */
static void check_order(const cell_mesh *cells) {
    int64_t capacity = 32 * (cells->n + cells->n_verts + 1);
    uint8_t *out = fuzz_allocate(capacity, 1);
    const int32_t *of_cells = fuzz_permutation(cells->n);
    const int32_t *of_verts = fuzz_permutation(cells->n_verts);
    size_t cells_size = (size_t)cells->n * sizeof *of_cells;
    size_t verts_size = (size_t)cells->n_verts * sizeof *of_verts;
    int32_t *cell_sequence = fuzz_allocate(cells->n, sizeof *cell_sequence);
    int32_t *vertex_sequence = fuzz_allocate(cells->n_verts, sizeof *vertex_sequence);
    memcpy(cell_sequence, of_cells, cells_size);
    memcpy(vertex_sequence, of_verts, verts_size);
    size_t size = reel_cells_order_memory(cells->n, cells->n_nodes, cells->n_verts);
    int64_t length = reel_cells_order_encode(
        FUZZ_MEMORY(size), cells->types, cells->n, cells->nodes, cells->n_nodes, cells->n_verts,
        cell_sequence, vertex_sequence, out, (size_t)capacity);
    FUZZ_CHECK(length >= 0 && !memcmp(vertex_sequence, of_verts, verts_size));
    memset(cell_sequence, 0, cells_size);
    memset(vertex_sequence, 0, verts_size);
    fuzz_bytes bytes = fuzz_output(out, length);
    FUZZ_CHECK(decode_order(bytes, cells, cell_sequence, vertex_sequence) >= 0);
    FUZZ_CHECK(!memcmp(cell_sequence, of_cells, cells_size));
    FUZZ_CHECK(!memcmp(vertex_sequence, of_verts, verts_size));
    fuzz_check_code(decode_order(fuzz_mutate(bytes), cells, cell_sequence, vertex_sequence));
}

void fuzz_cells(void) {
    cell_mesh cells = make_cells();
    int64_t capacity = 16 * cells.n_nodes + 64;
    uint8_t *out = fuzz_allocate(capacity, 1), *types = fuzz_allocate(cells.n, 1);
    uint8_t *decoded_types = fuzz_allocate(cells.n, 1);
    int32_t *nodes = fuzz_allocate(cells.n_nodes, sizeof *nodes);
    int32_t *decoded_nodes = fuzz_allocate(cells.n_nodes, sizeof *decoded_nodes);
    int32_t *given_cells = fuzz_allocate(cells.n, sizeof *given_cells);
    int32_t *given_vertices = fuzz_allocate(cells.n_verts, sizeof *given_vertices);
    check_surface(&cells);
    check_adjacency(&cells, 0);
    check_adjacency(&cells, 1);
    check_order(&cells);
    size_t size = reel_cells_code_memory(cells.n, cells.n_nodes, cells.n_verts);
    int64_t length = reel_cells_encode(FUZZ_MEMORY(size), cells.types, cells.n, cells.nodes,
                                       cells.n_nodes, cells.n_verts, fuzz_one_in(4), types, nodes,
                                       given_cells, given_vertices, out, (size_t)capacity);
    FUZZ_CHECK(length >= 0);
    fuzz_bytes bytes = fuzz_output(out, length);
    FUZZ_CHECK(decode(bytes, &cells, decoded_types, decoded_nodes) >= 0);
    FUZZ_CHECK(!memcmp(types, decoded_types, (size_t)cells.n));
    FUZZ_CHECK(!memcmp(nodes, decoded_nodes, (size_t)cells.n_nodes * sizeof *nodes));
    int32_t start = 0, *starts = fuzz_allocate(cells.n, sizeof *starts);
    for (int64_t i = 0; i < cells.n; i++) {
        starts[i] = start;
        start += (int32_t)reel_cell_size(cells.types[i]);
    }
    for (int64_t i = 0, k = 0; i < cells.n; i++) {
        FUZZ_CHECK(types[i] == cells.types[given_cells[i]]);
        for (int64_t j = 0; j < reel_cell_size(types[i]); j++, k++) {
            FUZZ_CHECK(given_vertices[nodes[k]] == cells.nodes[starts[given_cells[i]] + j]);
        }
    }
    int64_t result = decode(fuzz_mutate(bytes), &cells, decoded_types, decoded_nodes);
    fuzz_check_code(result);
    fuzz_hash(decoded_nodes, result < 0 ? 0 : cells.n_nodes, sizeof *decoded_nodes);
}
