/* The twin of each half-edge of a triangle mesh: docs/format.md, "ORDER". Time is linear for any
   mesh. */

#include "base.h"

typedef struct {
    const int32_t *faces;
    int64_t n_sides, n_verts;
    int32_t *starts;
} sorter;

/* The lower or the higher vertex of a half-edge. */
REEL_INLINE int32_t end_of(const sorter *s, int32_t side, bool higher) {
    int32_t a = s->faces[side], b = s->faces[side % 3 == 2 ? side - 2 : side + 1];
    return (a < b) == higher ? b : a;
}

/* Sort half-edges by one of their vertices, stably. */
static void sort_by_end(const sorter *s, bool higher, const int32_t *sides, int32_t *sorted) {
    reel_zero(s->starts, ((size_t)s->n_verts + 1) * sizeof *s->starts);
    for (int64_t i = 0; i < s->n_sides; i++) {
        s->starts[end_of(s, (int32_t)i, higher) + 1]++;
    }
    reel_prefix_sum(s->starts, s->n_verts);
    for (int64_t i = 0; i < s->n_sides; i++) {
        int32_t side = sides ? sides[i] : (int32_t)i;
        sorted[s->starts[end_of(s, side, higher)]++] = side;
    }
}

size_t reel_twins_memory(int64_t n_verts, int64_t n_faces) {
    return 2 * reel_array_bytes(3 * (size_t)n_faces, sizeof(int32_t)) +
           reel_array_bytes((size_t)n_verts + 1, sizeof(int32_t));
}

int64_t reel_twins(void *memory, size_t memory_size, const int32_t *faces, int64_t n_faces,
                   int64_t n_verts, int32_t *twins) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    sorter s = {.faces = faces, .n_sides = 3 * n_faces, .n_verts = n_verts};
    int32_t *by_higher = reel_allocate(&arena, (size_t)s.n_sides, sizeof *by_higher);
    int32_t *sorted = reel_allocate(&arena, (size_t)s.n_sides, sizeof *sorted);
    s.starts = reel_allocate(&arena, (size_t)n_verts + 1, sizeof *s.starts);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t i = 0; i < s.n_sides; i++) {
        if (faces[i] < 0 || faces[i] >= n_verts) {
            return reel_failure(REEL_INVALID, (uint64_t)i);
        }
        twins[i] = (int32_t)i;
    }
    sort_by_end(&s, true, NULL, by_higher);
    sort_by_end(&s, false, by_higher, sorted);
    for (int64_t i = 0; i + 1 < s.n_sides; i++) { /* pair half-edges with the same ends */
        int32_t side = sorted[i], other = sorted[i + 1];
        if (end_of(&s, side, false) == end_of(&s, other, false) &&
            end_of(&s, side, true) == end_of(&s, other, true)) {
            twins[side] = other;
            twins[other] = side;
            i++;
        }
    }
    return n_faces;
}
