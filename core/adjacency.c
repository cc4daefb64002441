/* Which vertices of a mesh are next to each other.

   docs/format.md, "Resolutions". Degenerate faces and repeated edges are allowed. */

#include "adjacency.h"

#define MOST_FACES ((int64_t)INT32_MAX / 6)

size_t reel_joiner_room(size_t n, size_t pairs) {
    return 3 * reel_room(n + 1, sizeof(int32_t)) + 2 * reel_room(pairs, sizeof(int32_t));
}

reel_joiner reel_take_joiner(reel_arena *arena, size_t n, size_t pairs) {
    return (reel_joiner){
        .starts = reel_take(arena, n + 1, sizeof(int32_t)),
        .highs = reel_take(arena, pairs, sizeof(int32_t)),
        .firsts = reel_take(arena, n + 1, sizeof(int32_t)),
        .ends = reel_take(arena, n + 1, sizeof(int32_t)),
        .lows = reel_take(arena, pairs, sizeof(int32_t)),
    };
}

/* Counts at starts[1 ..] to where each list begins, at starts[0 ..]. */
static void add_up(int32_t *starts, int32_t n) {
    for (int32_t i = 0; i < n; i++) {
        starts[i + 1] += starts[i];
    }
}

/* Highs of each low, in the order of the pairs. */
static void list_highs(const reel_joiner *joiner, int32_t n, int32_t pairs, const int32_t *pair) {
    int32_t *starts = joiner->starts, *firsts = joiner->firsts, *cursor = joiner->ends;
    reel_zero(starts, ((size_t)n + 1) * sizeof *starts);
    reel_zero(firsts, ((size_t)n + 1) * sizeof *firsts);
    for (int32_t i = 0; i < pairs; i++) {
        starts[pair[2 * i] + 1]++;
        firsts[pair[2 * i + 1] + 1]++;
    }
    add_up(starts, n);
    add_up(firsts, n);
    reel_copy(cursor, starts, (size_t)n * sizeof *starts);
    for (int32_t i = 0; i < pairs; i++) {
        joiner->highs[cursor[pair[2 * i]]++] = pair[2 * i + 1];
    }
}

/* Lows of each high, ascending, each once. */
static void list_lows(const reel_joiner *joiner, int32_t n) {
    int32_t *ends = joiner->ends, *lows = joiner->lows;
    reel_copy(ends, joiner->firsts, (size_t)n * sizeof *ends);
    for (int32_t low = 0; low < n; low++) {
        for (int32_t i = joiner->starts[low]; i < joiner->starts[low + 1]; i++) {
            int32_t high = joiner->highs[i], end = ends[high];
            if (end == joiner->firsts[high] || lows[end - 1] != low) {
                lows[end] = low;
                ends[high] = end + 1;
            }
        }
    }
}

int32_t reel_join(const reel_joiner *joiner, int32_t n, int32_t pairs, int32_t *starts,
                  int32_t *near) {
    list_highs(joiner, n, pairs, near);
    list_lows(joiner, n);
    reel_zero(starts, ((size_t)n + 1) * sizeof *starts);
    for (int32_t v = 0; v < n; v++) {
        starts[v + 1] += joiner->ends[v] - joiner->firsts[v];
        for (int32_t i = joiner->firsts[v]; i < joiner->ends[v]; i++) {
            starts[joiner->lows[i] + 1]++;
        }
    }
    add_up(starts, n);
    int32_t *cursor = joiner->starts;
    reel_copy(cursor, starts, (size_t)n * sizeof *cursor);
    for (int32_t v = 0; v < n; v++) { /* what is below v comes before what is above it */
        for (int32_t i = joiner->firsts[v]; i < joiner->ends[v]; i++) {
            int32_t low = joiner->lows[i];
            near[cursor[v]++] = low;
            near[cursor[low]++] = v;
        }
    }
    return starts[n];
}

/* Edges of faces as pairs; how many, or -1 - the face that names a vertex which is not there. */
static int64_t pairs_of_faces(const int32_t *faces, int32_t n_faces, int32_t n_verts,
                              int32_t *pair) {
    int64_t pairs = 0;
    for (int32_t face = 0; face < n_faces; face++, faces += 3) {
        for (int corner = 0; corner < 3; corner++) {
            int32_t a = faces[corner], b = faces[corner == 2 ? 0 : corner + 1];
            if (a < 0 || a >= n_verts) {
                return -1 - face;
            }
            if (a != b) {
                pair[2 * pairs] = a < b ? a : b;
                pair[2 * pairs + 1] = a < b ? b : a;
                pairs++;
            }
        }
    }
    return pairs;
}

size_t reel_adjacency_memory(int64_t n_verts, int64_t n_faces) {
    return reel_joiner_room((size_t)n_verts, 3 * (size_t)n_faces);
}

int64_t reel_adjacency(void *memory, size_t memory_size, const int32_t *faces, int64_t n_faces,
                       int64_t n_verts, int32_t *starts, int32_t *near) {
    if (n_faces < 0 || n_faces > MOST_FACES || n_verts < 0 || n_verts >= INT32_MAX) {
        return reel_failure(REEL_INVALID, 0);
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
    reel_joiner joiner = reel_take_joiner(&arena, (size_t)n_verts, 3 * (size_t)n_faces);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    int64_t pairs = pairs_of_faces(faces, (int32_t)n_faces, (int32_t)n_verts, near);
    if (pairs < 0) {
        return reel_failure(REEL_INVALID, (uint64_t)(-1 - pairs));
    }
    return reel_join(&joiner, (int32_t)n_verts, (int32_t)pairs, starts, near);
}
