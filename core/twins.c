/* The twin of each half-edge of a triangle mesh: docs/format.md, "ORDER". Time is linear for any
   mesh. */

#include "base.h"

typedef struct {
    const int32_t *faces;
    int64_t n_half_edges, n_verts;
    int32_t *starts;
} sorter;

/* The lower or the higher vertex of a half-edge. */
REEL_INLINE int32_t end_of(const sorter *s, int32_t he, bool higher) {
    int32_t a = s->faces[he], b = s->faces[he % 3 == 2 ? he - 2 : he + 1];
    return (a < b) == higher ? b : a;
}

/* Sort half-edges by one of their vertices, stably. */
static void sort_by_end(const sorter *s, bool higher, const int32_t *half_edges, int32_t *sorted) {
    reel_zero(s->starts, ((size_t)s->n_verts + 1) * sizeof *s->starts);
    for (int64_t i = 0; i < s->n_half_edges; i++) {
        s->starts[end_of(s, (int32_t)i, higher) + 1]++;
    }
    reel_prefix_sum(s->starts, s->n_verts);
    for (int64_t i = 0; i < s->n_half_edges; i++) {
        int32_t he = half_edges ? half_edges[i] : (int32_t)i;
        sorted[s->starts[end_of(s, he, higher)]++] = he;
    }
}

size_t reel_twins_memory(int64_t n_verts, int64_t n_faces) {
    return 2 * reel_array_bytes(3 * (size_t)n_faces, sizeof(int32_t)) +
           reel_array_bytes((size_t)n_verts + 1, sizeof(int32_t));
}

int64_t reel_twins(void *memory, size_t memory_size, const int32_t *faces, int64_t n_faces,
                   int64_t n_verts, int32_t *twins) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    sorter s = {.faces = faces, .n_half_edges = 3 * n_faces, .n_verts = n_verts};
    int32_t *by_higher = reel_allocate(&arena, (size_t)s.n_half_edges, sizeof *by_higher);
    int32_t *sorted = reel_allocate(&arena, (size_t)s.n_half_edges, sizeof *sorted);
    s.starts = reel_allocate(&arena, (size_t)n_verts + 1, sizeof *s.starts);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t i = 0; i < s.n_half_edges; i++) {
        if (faces[i] < 0 || faces[i] >= n_verts) {
            return reel_failure(REEL_INVALID, (uint64_t)i);
        }
        twins[i] = (int32_t)i;
    }
    sort_by_end(&s, true, NULL, by_higher);
    sort_by_end(&s, false, by_higher, sorted);
    for (int64_t i = 0; i + 1 < s.n_half_edges; i++) { /* pair half-edges with the same ends */
        int32_t he = sorted[i], other = sorted[i + 1];
        if (end_of(&s, he, false) == end_of(&s, other, false) &&
            end_of(&s, he, true) == end_of(&s, other, true)) {
            twins[he] = other;
            twins[other] = he;
            i++;
        }
    }
    return n_faces;
}
