/* Cells of a volume mesh: docs/format.md, CELLS and ORDER. */

#include "cell_mesh.h"

#define CELLS_AND_VERTICES 3

/* Extract the surface of cells in order: triangles, and the corners and cell of each polygon. */
static int find_surface(reel_call *call, const reel_outline *outline, const uint8_t *types,
                        const int32_t *nodes, int32_t *triangles, int32_t *sizes, int32_t *owners) {
    int64_t n_polygons = 0, n_cells = (int64_t)outline->n_cells;
    const reel_chunk *mark = call->scratch.last;
    size_t size = reel_cells_memory(n_cells, (int64_t)outline->n_verts);
    void *memory = reel_scratch(call, size, 1);
    REEL_NEED(memory);
    int64_t n_triangles =
        reel_cells_surface(memory, size, types, n_cells, nodes, (int64_t)outline->n_cell_nodes,
                           (int64_t)outline->n_verts, (int64_t)outline->n_faces, triangles, sizes,
                           owners, &n_polygons);
    reel_drop_scratch(call, mark);
    REEL_TRY(
        reel_fail_core(call, n_triangles, outline->coded_cells.offset, "the cells are damaged"));
    REEL_CORRUPT_IF(n_triangles != (int64_t)outline->n_faces ||
                        n_polygons != (int64_t)outline->n_polygons,
                    outline->coded_cells.offset, "the surface of the cells has other faces");
    return MESHREEL_OK;
}

int reel_decode_cells(reel_call *call, reel_pool *pool, const reel_outline *outline,
                      reel_mesh_data *mesh) {
    int64_t n_cells = (int64_t)outline->n_cells, n_nodes = (int64_t)outline->n_cell_nodes;
    int64_t n_verts = (int64_t)outline->n_verts;
    reel_range data = outline->coded_cells;
    const uint8_t *bytes;
    mesh->cell_types = reel_pool_allocate(call, pool, outline->n_cells, 1);
    mesh->cell_nodes = reel_pool_allocate(call, pool, outline->n_cell_nodes, sizeof(int32_t));
    mesh->internal_faces = reel_pool_allocate(call, pool, 3 * outline->n_faces, sizeof(int32_t));
    const reel_chunk *mark = call->scratch.last;
    size_t size = reel_cells_code_memory(n_cells, n_nodes, n_verts);
    void *memory = reel_scratch(call, size, 1);
    REEL_NEED(mesh->cell_types && mesh->cell_nodes && mesh->internal_faces && memory);
    REEL_TRY(reel_view(call, data, &bytes));
    REEL_CORRUPT_IF(!reel_is_stripped(bytes, data.length), data.offset + data.length - 1,
                    "the cells end with a zero byte");
    int64_t result = reel_cells_decode(memory, size, bytes, (size_t)data.length, n_cells, n_nodes,
                                       n_verts, mesh->cell_types, mesh->cell_nodes);
    REEL_TRY(reel_fail_core(call, result, data.offset, "the cells are damaged"));
    reel_drop_scratch(call, mark);
    int32_t *sizes = reel_scratch(call, outline->n_faces, sizeof *sizes);
    int32_t *owners = reel_scratch(call, outline->n_faces, sizeof *owners);
    REEL_NEED(sizes && owners);
    REEL_TRY(find_surface(call, outline, mesh->cell_types, mesh->cell_nodes, mesh->internal_faces,
                          sizes, owners));
    reel_drop_scratch(call, mark);
    return reel_may_be_on_grid(outline)
               ? reel_find_twins(call, pool, mesh->internal_faces, outline->n_faces,
                                 outline->n_verts, &mesh->twins)
               : MESHREEL_OK;
}

/* ---- order */

/* Read the order of cells and vertices; `given_cells` becomes the internal number of each output
   cell, or NULL if all are in output order. */
static int read_order(reel_call *call, const reel_outline *outline, reel_mesh_data *mesh,
                      int32_t **given_cells) {
    reel_range data = {0, 0};
    const uint8_t *bytes;
    int64_t n_cells = (int64_t)outline->n_cells, n_nodes = (int64_t)outline->n_cell_nodes;
    int64_t n_verts = (int64_t)outline->n_verts;
    *given_cells = NULL;
    uint32_t count = reel_count_sections(outline, REEL_ORDER, &data);
    REEL_CORRUPT_IF(count != (outline->order == REEL_ORDER_KEPT), outline->begin,
                    "a section ORDER is missing, or is not needed");
    for (int32_t v = 0; v < n_verts; v++) {
        mesh->to_internal[v] = mesh->to_output[v] = v;
    }
    if (!data.length) {
        return MESHREEL_OK;
    }
    *given_cells = reel_scratch(call, outline->n_cells, sizeof **given_cells);
    const reel_chunk *mark = call->scratch.last;
    size_t size = reel_cells_order_memory(n_cells, n_nodes, n_verts);
    void *memory = reel_scratch(call, size, 1);
    REEL_NEED(*given_cells && memory);
    REEL_TRY(reel_view(call, data, &bytes));
    REEL_CORRUPT_IF(bytes[0] != CELLS_AND_VERTICES, data.offset,
                    "the order of cells begins without a 3");
    REEL_CORRUPT_IF(data.length > 1 && !bytes[data.length - 1], data.offset + data.length - 1,
                    "the order ends with a zero byte");
    int64_t result = reel_cells_order_decode(memory, size, bytes + 1, (size_t)data.length - 1,
                                             mesh->cell_types, n_cells, mesh->cell_nodes, n_nodes,
                                             n_verts, *given_cells, mesh->to_internal);
    reel_drop_scratch(call, mark);
    REEL_TRY(reel_fail_core(call, result, data.offset, "the order of cells is damaged"));
    for (int32_t v = 0; v < n_verts; v++) {
        mesh->to_output[mesh->to_internal[v]] = v;
    }
    return MESHREEL_OK;
}

int reel_order_cells(reel_call *call, reel_pool *pool, const reel_outline *outline,
                     reel_mesh_data *mesh) {
    uint64_t n_cells = outline->n_cells, n_nodes = outline->n_cell_nodes;
    uint8_t *types = reel_pool_allocate(call, pool, n_cells, 1);
    int32_t *nodes = reel_pool_allocate(call, pool, n_nodes, sizeof *nodes), *given_cells;
    int32_t *owners = reel_pool_allocate(call, pool, outline->n_faces, sizeof *owners);
    mesh->face_sizes = reel_pool_allocate(call, pool, outline->n_faces, sizeof(int32_t));
    mesh->triangles = reel_pool_allocate(call, pool, 3 * outline->n_faces, sizeof(uint32_t));
    mesh->to_internal = reel_pool_allocate(call, pool, outline->n_verts, sizeof(int32_t));
    mesh->to_output = reel_pool_allocate(call, pool, outline->n_verts, sizeof(int32_t));
    REEL_NEED(types && nodes && owners && mesh->face_sizes);
    REEL_NEED(mesh->triangles && mesh->to_internal && mesh->to_output);
    const reel_chunk *mark = call->scratch.last;
    REEL_TRY(read_order(call, outline, mesh, &given_cells));
    int64_t *starts = reel_scratch(call, n_cells, sizeof *starts), end = 0;
    REEL_NEED(starts);
    for (uint64_t i = 0; i < n_cells; i++) {
        starts[i] = end;
        end += reel_cell_size(mesh->cell_types[i]);
    }
    int32_t *next = nodes;
    for (uint64_t i = 0; i < n_cells; i++) {
        int32_t cell = given_cells ? given_cells[i] : (int32_t)i;
        types[i] = mesh->cell_types[cell];
        for (int64_t k = 0; k < reel_cell_size(types[i]); k++) {
            *next++ = mesh->to_output[mesh->cell_nodes[starts[cell] + k]];
        }
    }
    REEL_TRY(find_surface(call, outline, types, nodes, (int32_t *)mesh->triangles, mesh->face_sizes,
                          owners));
    reel_drop_scratch(call, mark);
    mesh->cells = (meshreel_cells){(uint32_t)n_cells, (uint32_t)n_nodes, types,
                                   (const uint32_t *)nodes, (const uint32_t *)owners};
    return MESHREEL_OK;
}

int reel_find_cell_graph(reel_call *call, reel_pool *pool, const reel_outline *outline,
                         const reel_mesh_data *mesh, bool of_cells, reel_graph *graph) {
    int64_t n_cells = (int64_t)outline->n_cells, n_nodes = (int64_t)outline->n_cell_nodes;
    int64_t n_verts = (int64_t)outline->n_verts;
    uint64_t n_items = of_cells ? outline->n_cells : outline->n_verts;
    uint64_t capacity = of_cells ? 8 * outline->n_cells : 4 * outline->n_cell_nodes;
    int32_t *starts = reel_pool_allocate(call, pool, n_items + 1, sizeof *starts);
    int32_t *near = reel_pool_allocate(call, pool, capacity, sizeof *near);
    const reel_chunk *mark = call->scratch.last;
    size_t size = reel_cells_adjacency_memory(n_cells, n_nodes, n_verts, of_cells);
    void *memory = reel_scratch(call, size, 1);
    REEL_NEED(starts && near && memory);
    int64_t result =
        reel_cells_adjacency(memory, size, of_cells ? mesh->cells.types : mesh->cell_types, n_cells,
                             of_cells ? (const int32_t *)mesh->cells.nodes : mesh->cell_nodes,
                             n_nodes, n_verts, of_cells, starts, near);
    reel_drop_scratch(call, mark);
    *graph = (reel_graph){(uint32_t)n_items, starts, near};
    return reel_fail_core(call, result, 0, "a cell has a node that does not exist");
}

int reel_find_vertex_graph(reel_call *call, reel_pool *pool, const reel_outline *outline,
                           const reel_mesh_data *mesh, reel_graph *graph) {
    return reel_has_cells(outline)
               ? reel_find_cell_graph(call, pool, outline, mesh, false, graph)
               : reel_find_neighbors(call, pool, mesh->internal_faces, outline->n_faces,
                                     (uint32_t)outline->n_verts, graph);
}

int reel_find_graph(reel_call *call, reel_pool *pool, const reel_outline *outline,
                    reel_mesh_data *mesh) {
    mesh->graph = (reel_graph){.n_items = (uint32_t)outline->n_verts};
    return reel_may_be_on_grid(outline) && outline->max_block_frames == 1 && outline->n_tracks == 1
               ? MESHREEL_OK
               : reel_find_vertex_graph(call, pool, outline, mesh, &mesh->graph);
}
