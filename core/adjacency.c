/* Adjacency of the vertices of a mesh: docs/format.md, "Resolutions".

   Degenerate faces and repeated edges are allowed. */

#include "adjacency.h"

#define MAX_FACES ((int64_t)INT32_MAX / 6)

reel_adjacency_builder reel_allocate_adjacency_builder(reel_arena *arena, size_t n,
                                                       size_t n_edges) {
    return (reel_adjacency_builder){
        .starts = reel_allocate(arena, n + 1, sizeof(int32_t)),
        .highs = reel_allocate(arena, n_edges, sizeof(int32_t)),
        .firsts = reel_allocate(arena, n + 1, sizeof(int32_t)),
        .ends = reel_allocate(arena, n + 1, sizeof(int32_t)),
        .lows = reel_allocate(arena, n_edges, sizeof(int32_t)),
    };
}

/* List the upper ends of each lower end, in the order of the edges. */
static void list_highs(const reel_adjacency_builder *builder, int32_t n, int32_t n_edges,
                       const int32_t *edges) {
    int32_t *starts = builder->starts, *firsts = builder->firsts, *cursor = builder->ends;
    reel_zero(starts, ((size_t)n + 1) * sizeof *starts);
    reel_zero(firsts, ((size_t)n + 1) * sizeof *firsts);
    for (int32_t i = 0; i < n_edges; i++) {
        starts[edges[2 * i] + 1]++;
        firsts[edges[2 * i + 1] + 1]++;
    }
    reel_prefix_sum(starts, n);
    reel_prefix_sum(firsts, n);
    reel_copy(cursor, starts, (size_t)n * sizeof *starts);
    for (int32_t i = 0; i < n_edges; i++) {
        builder->highs[cursor[edges[2 * i]]++] = edges[2 * i + 1];
    }
}

/* List the lower ends of each upper end, ascending, each once. */
static void list_lows(const reel_adjacency_builder *builder, int32_t n) {
    int32_t *ends = builder->ends, *lows = builder->lows;
    reel_copy(ends, builder->firsts, (size_t)n * sizeof *ends);
    for (int32_t low = 0; low < n; low++) {
        for (int32_t i = builder->starts[low]; i < builder->starts[low + 1]; i++) {
            int32_t high = builder->highs[i], end = ends[high];
            if (end == builder->firsts[high] || lows[end - 1] != low) {
                lows[end] = low;
                ends[high] = end + 1;
            }
        }
    }
}

int32_t reel_build_adjacency(const reel_adjacency_builder *builder, int32_t n, int32_t n_edges,
                             int32_t *starts, int32_t *near) {
    list_highs(builder, n, n_edges, near);
    list_lows(builder, n);
    reel_zero(starts, ((size_t)n + 1) * sizeof *starts);
    for (int32_t v = 0; v < n; v++) {
        starts[v + 1] += builder->ends[v] - builder->firsts[v];
        for (int32_t i = builder->firsts[v]; i < builder->ends[v]; i++) {
            starts[builder->lows[i] + 1]++;
        }
    }
    reel_prefix_sum(starts, n);
    int32_t *cursor = builder->starts;
    reel_copy(cursor, starts, (size_t)n * sizeof *cursor);
    for (int32_t v = 0; v < n; v++) { /* lower neighbors of v precede upper ones */
        for (int32_t i = builder->firsts[v]; i < builder->ends[v]; i++) {
            int32_t low = builder->lows[i];
            near[cursor[v]++] = low;
            near[cursor[low]++] = v;
        }
    }
    return starts[n];
}

/* List the edges of faces; returns their number, or -1 - face for a face with an invalid vertex. */
static int64_t list_edges(const int32_t *faces, int32_t n_faces, int32_t n_verts, int32_t *edges) {
    int64_t n_edges = 0;
    for (int32_t face = 0; face < n_faces; face++, faces += 3) {
        for (int corner = 0; corner < 3; corner++) {
            int32_t a = faces[corner], b = faces[corner == 2 ? 0 : corner + 1];
            if (a < 0 || a >= n_verts) {
                return -1 - face;
            }
            if (a != b) {
                edges[2 * n_edges] = a < b ? a : b;
                edges[2 * n_edges + 1] = a < b ? b : a;
                n_edges++;
            }
        }
    }
    return n_edges;
}

size_t reel_adjacency_memory(int64_t n_verts, int64_t n_faces) {
    reel_arena arena = REEL_MEASURE;
    reel_allocate_adjacency_builder(&arena, (size_t)n_verts, 3 * (size_t)n_faces);
    return arena.used;
}

int64_t reel_adjacency(void *memory, size_t memory_size, const int32_t *faces, int64_t n_faces,
                       int64_t n_verts, int32_t *starts, int32_t *near) {
    if (n_faces < 0 || n_faces > MAX_FACES || n_verts < 0 || n_verts >= INT32_MAX) {
        return reel_failure(REEL_INVALID, 0);
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
    reel_adjacency_builder builder =
        reel_allocate_adjacency_builder(&arena, (size_t)n_verts, 3 * (size_t)n_faces);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    int64_t n_edges = list_edges(faces, (int32_t)n_faces, (int32_t)n_verts, near);
    if (n_edges < 0) {
        return reel_failure(REEL_INVALID, (uint64_t)(-1 - n_edges));
    }
    return reel_build_adjacency(&builder, (int32_t)n_verts, (int32_t)n_edges, starts, near);
}

/* Add a face unless its corners are all equal; returns the end of the faces. */
static int32_t *add_face(int32_t *end, int32_t a, int32_t b, int32_t c) {
    end[0] = a;
    end[1] = b;
    end[2] = c;
    return a != b || b != c ? end + 3 : end;
}

static int64_t half_edge_after(int64_t he) { return he % 3 == 2 ? he - 2 : he + 1; }

int64_t reel_item_faces(const int32_t *triangles, const int32_t *twins, const int32_t *items,
                        int64_t n_triangles, int32_t *faces) {
    int32_t *end = faces;
    for (int64_t he = 0; he < 3 * n_triangles; he++) {
        int64_t twin = twins[he], after = half_edge_after(he), twin_after = half_edge_after(twin);
        if (he % 3 == 0) {
            end = add_face(end, items[he], items[he + 1], items[he + 2]);
        }
        if (twin <= he) {
            continue;
        }
        bool is_opposite = triangles[he] == triangles[twin_after];
        int32_t first = items[is_opposite ? twin_after : twin];
        int32_t second = items[is_opposite ? twin : twin_after];
        end = add_face(end, items[he], first, first);
        if (items[after] != items[he] || second != first) {
            end = add_face(end, items[after], second, second);
        }
    }
    return (end - faces) / 3;
}
