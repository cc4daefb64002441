/* Stencils: the vertices of earlier levels nearest to each vertex.

   docs/format.md, "Stencils". A breadth-first search grows ring by ring around each vertex. Rings
   are small and irregular, so branches would be mispredicted: the neighbor lists of a ring are
   gathered first, and new vertices among them are appended without branches. */

#include "cpu.h"
#include "stencils.h"

#define RADIUS 3              /* radius of a stencil, in edges of its resolution */
#define MAX_PASSAGE_DEGREE 24 /* searches do not pass through vertices with more neighbors */
#define MAX_PATHS 15          /* path counts saturate here */
#define MAX_GATHERED 256      /* neighbors gathered before they are filtered */
#define SMALL_SORT 48         /* arrays up to this size are sorted without branches */
#define WIDE 8                /* numbers copied and compared per vector */

typedef int32_t vec8i __attribute__((vector_size(32), aligned(4), may_alias));

/* Neighbors of a ring, possibly repeated. */
typedef struct {
    int32_t count;
    int32_t vertices[MAX_GATHERED + MAX_PASSAGE_DEGREE + WIDE];
    /* Shortest paths to the ring vertex that each comes from. */
    int32_t paths[MAX_GATHERED + MAX_PASSAGE_DEGREE + WIDE];
} neighbor_list;

reel_stencil_finder reel_allocate_stencil_finder(reel_arena *arena, size_t n, size_t n_near) {
    return (reel_stencil_finder){
        .rows = reel_allocate(arena, n_near + WIDE, sizeof(int32_t)),
        .ends = reel_allocate(arena, n, sizeof(reel_row_ends)),
        .visits = reel_allocate(arena, n, sizeof(uint64_t)),
        .ring = reel_allocate(arena, n + 1, sizeof(int32_t)),
        .next = reel_allocate(arena, n + 1, sizeof(int32_t)),
        .keys = reel_allocate(arena, n + WIDE, sizeof(int32_t)),
        .lanes = reel_vector_width(),
    };
}

/* Sort neighbor lists by state, so that those of earlier levels come first. */
static void sort_rows(const reel_stencil_finder *finder, const reel_graph *graph,
                      const uint8_t *states) {
    for (int32_t v = 0; v < graph->n; v++) {
        int32_t starts[REEL_STATES + 1] = {0}, begin = graph->starts[v], end = graph->starts[v + 1];
        for (int32_t i = begin; i < end; i++) {
            starts[states[graph->near[i]] + 1]++;
        }
        starts[0] = begin;
        for (int state = 0; state < REEL_STATES - 1; state++) {
            starts[state + 1] += starts[state];
            finder->ends[v].by_state[state] = starts[state + 1];
        }
        for (int32_t i = begin; i < end; i++) {
            int32_t u = graph->near[i];
            finder->rows[starts[states[u]]++] = u;
        }
    }
}

/* Entry of `visits`, without paths, of a vertex first met in a ring: larger than in earlier
   searches, smaller than in earlier rings of this search. */
REEL_INLINE uint64_t visit_mark(int32_t search, int distance) {
    return (uint64_t)(4 * search + RADIUS - distance) << 32;
}

REEL_INLINE int32_t paths_to(const reel_stencil_finder *finder, int32_t v) {
    int32_t paths = (int32_t)(uint32_t)finder->visits[v];
    return paths < MAX_PATHS ? paths : MAX_PATHS;
}

/* Append a row. Reads up to WIDE - 1 numbers past the row, and writes as many past its copy. */
REEL_INLINE void add_row(neighbor_list *list, const int32_t *row, int32_t length, int32_t paths) {
    for (int32_t i = 0; i < length; i += WIDE) {
        *(vec8i *)&list->vertices[list->count + i] = *(const vec8i *)&row[i];
        *(vec8i *)&list->paths[list->count + i] = paths - (vec8i){0};
    }
    list->count += length;
}

/* Append the gathered vertices that this search has not visited to `next`; returns its new length.
   Path counts of all vertices that belong to the marked ring increase. Masks replace conditions
   that compilers would turn into branches. */
static int32_t append_unvisited(const reel_stencil_finder *finder, uint64_t mark,
                                neighbor_list *list, int32_t n_next) {
    uint64_t *marks = finder->visits;
    int32_t *next = finder->next, count = list->count;
    for (int32_t i = 0; i < count; i++) {
        int32_t w = list->vertices[i];
        uint64_t visit = marks[w];
        next[n_next] = w; /* overwritten by the next vertex unless it is new */
        n_next += visit < mark;
        visit = visit > mark ? visit : mark;
        uint64_t in_ring = (visit - mark) >> 32 == 0;
        marks[w] = visit + ((uint64_t)list->paths[i] & (0 - in_ring));
    }
    list->count = 0;
    return n_next;
}

/* Grow the next ring from the n vertices of the current one; the last ring contains vertices of
   earlier levels only. */
static int32_t grow_ring(reel_stencil_finder *finder, const reel_graph *graph, int32_t search,
                         int distance, uint8_t level, int32_t n) {
    int32_t n_next = 0;
    neighbor_list list;
    list.count = 0;
    for (int32_t i = 0; i < n; i++) {
        int32_t u = finder->ring[i], begin = graph->starts[u], end = graph->starts[u + 1];
        if (end - begin <= MAX_PASSAGE_DEGREE) {
            int32_t last = distance < RADIUS ? end : finder->ends[u].by_state[level - 1];
            add_row(&list, finder->rows + begin, last - begin, paths_to(finder, u));
        }
        if (list.count > MAX_GATHERED) {
            n_next = append_unvisited(finder, visit_mark(search, distance), &list, n_next);
        }
    }
    return append_unvisited(finder, visit_mark(search, distance), &list, n_next);
}

/* Begin a search: the first ring consists of all neighbors of v. */
static int32_t begin_ring(reel_stencil_finder *finder, const reel_graph *graph, int32_t search,
                          int32_t v) {
    int32_t begin = graph->starts[v], n = graph->starts[v + 1] - begin;
    finder->visits[v] = visit_mark(search, 0);
    for (int32_t i = 0; i < n; i++) {
        int32_t u = finder->rows[begin + i];
        finder->visits[u] = visit_mark(search, 1) + 1;
        finder->next[i] = u;
    }
    return n;
}

/* List the sort keys of the vertices of a ring that are of earlier levels: by descending number of
   shortest paths, then ascending vertex number. Returns their number. */
static int32_t list_keys(const reel_stencil_finder *finder, const uint8_t *states, uint8_t level,
                         int32_t n) {
    int32_t count = 0;
    for (int32_t i = 0; i < n; i++) {
        int32_t u = finder->next[i];
        finder->keys[count] = (MAX_PATHS - paths_to(finder, u)) << REEL_VERTEX_BITS | u;
        count += states[u] < level;
    }
    return count;
}

/* Sort a few distinct numbers, each to the index given by its rank. */
#define DEFINE_SORT(name, target)                                                                  \
    target static void name(int32_t *numbers, int32_t count, int32_t *sorted) {                    \
        *(vec8i *)&numbers[count] = INT32_MAX - (vec8i){0};                                        \
        for (int32_t i = 0; i < count; i += WIDE) {                                                \
            vec8i values = *(const vec8i *)&numbers[i], ranks = {0};                               \
            for (int32_t j = 0; j < count; j++) {                                                  \
                ranks -= values > numbers[j];                                                      \
            }                                                                                      \
            for (int lane = 0; lane < WIDE; lane++) {                                              \
                sorted[ranks[lane]] = values[lane];                                                \
            }                                                                                      \
        }                                                                                          \
    }

DEFINE_SORT(sort_few, )
#ifdef REEL_HAS_WIDE
DEFINE_SORT(sort_few_wide, REEL_TARGET_4)
#endif
#undef DEFINE_SORT

static void sort(const reel_stencil_finder *finder, int32_t count, int32_t *sorted) {
#ifdef REEL_HAS_WIDE
    if (finder->lanes > 2) {
        sort_few_wide(finder->keys, count, sorted);
        return;
    }
#endif
    sort_few(finder->keys, count, sorted);
}

/* Keep the lowest `capacity` of `count` distinct numbers, ascending. */
static void keep_lowest(const int32_t *numbers, int32_t count, int32_t *lowest, int32_t capacity) {
    int32_t n_lowest = 0;
    for (int32_t i = 0; i < count; i++) {
        int32_t number = numbers[i], index = n_lowest;
        if (n_lowest == capacity && lowest[capacity - 1] < number) {
            continue;
        }
        n_lowest += n_lowest < capacity;
        index -= index == capacity;
        for (; index > 0 && lowest[index - 1] > number; index--) {
            lowest[index] = lowest[index - 1];
        }
        lowest[index] = number;
    }
}

/* Find the vertices of earlier levels nearest to v, at most `radius` edges away, by distance, then
   by number of shortest paths. */
static void find_nearest(reel_stencil_finder *finder, const reel_graph *graph,
                         const uint8_t *states, int32_t search, int32_t v, int radius,
                         int32_t size, int32_t *stencil, uint8_t *hops) {
    int32_t n_found = 0, n_ring = 0, sorted[SMALL_SORT + 1];
    for (int distance = 1; distance <= radius && n_found < size; distance++) {
        n_ring = distance == 1 ? begin_ring(finder, graph, search, v)
                               : grow_ring(finder, graph, search, distance, states[v], n_ring);
        int32_t count = list_keys(finder, states, states[v], n_ring), capacity = size - n_found;
        if (count <= SMALL_SORT) {
            sort(finder, count, sorted);
        } else {
            keep_lowest(finder->keys, count, sorted, capacity);
        }
        count = count < capacity ? count : capacity;
        for (int32_t i = 0; i < count; i++) {
            stencil[n_found] = sorted[i] & ((1 << REEL_VERTEX_BITS) - 1);
            hops[n_found++] = (uint8_t)distance;
        }
        int32_t *ring = finder->ring;
        finder->ring = finder->next;
        finder->next = ring;
    }
    for (; n_found < size; n_found++) {
        stencil[n_found] = -1;
        hops[n_found] = 0;
    }
}

void reel_find_stencils(reel_stencil_finder *finder, const reel_graph *graph, const uint8_t *states,
                        const uint8_t *is_midpoint, const int32_t *order, int32_t n, int32_t size,
                        int32_t *stencil, uint8_t *hops) {
    reel_zero(finder->visits, (size_t)graph->n * sizeof *finder->visits);
    sort_rows(finder, graph, states);
    for (int32_t i = 0; i < n; i++) {
        size_t row = (size_t)i * (size_t)size;
        int radius = is_midpoint && is_midpoint[order[i]] ? 1 : RADIUS;
        find_nearest(finder, graph, states, i + 1, order[i], radius, size, stencil + row,
                     hops + row);
    }
}
