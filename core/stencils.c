/* Stencils: the vertices of earlier levels that are nearest to each vertex.

   docs/format.md, "Stencils". A search goes out from a vertex, ring after ring. Rings are small and
   unlike each other, so that branches would be guessed wrongly: rows of neighbours are put side by
   side first, and what is new among them is listed without a branch. */

#include "cpu.h"
#include "stencils.h"

#define REACH 3            /* how far a stencil reaches, in edges of its resolution */
#define LARGEST_PASSAGE 24 /* stencils do not lead through vertices with more neighbours */
#define MOST_PATHS 15      /* more do not make a vertex nearer */
#define CROWD 256          /* neighbours that are put side by side */
#define FEW 48             /* numbers that are sorted without branches */
#define WIDE 8             /* numbers that are copied and compared at once */

typedef int32_t numbers_8 __attribute__((vector_size(32), aligned(4), may_alias));

/* Neighbours of a ring, some of them more than once. */
typedef struct {
    int32_t count;
    int32_t vertices[CROWD + LARGEST_PASSAGE + WIDE];
    int32_t paths[CROWD + LARGEST_PASSAGE + WIDE]; /* that lead there by way of the ring */
} crowd;

size_t reel_searcher_room(size_t n, size_t n_near) {
    return reel_room(n_near + WIDE, sizeof(int32_t)) + 2 * reel_room(n + 1, sizeof(int32_t)) +
           reel_room(n, sizeof(reel_ends)) + reel_room(n, sizeof(uint64_t)) +
           reel_room(n + WIDE, sizeof(int32_t));
}

reel_searcher reel_take_searcher(reel_arena *arena, size_t n, size_t n_near) {
    return (reel_searcher){
        .rows = reel_take(arena, n_near + WIDE, sizeof(int32_t)),
        .ends = reel_take(arena, n, sizeof(reel_ends)),
        .seen = reel_take(arena, n, sizeof(uint64_t)),
        .ring = reel_take(arena, n + 1, sizeof(int32_t)),
        .next = reel_take(arena, n + 1, sizeof(int32_t)),
        .found = reel_take(arena, n + WIDE, sizeof(int32_t)),
        .lanes = reel_widest(),
    };
}

/* Rows of neighbours by state: those of earlier levels then come first. */
static void sort_rows(const reel_searcher *own, const reel_graph *graph, const uint8_t *states) {
    for (int32_t v = 0; v < graph->n; v++) {
        int32_t places[REEL_STATES + 1] = {0}, begin = graph->starts[v], end = graph->starts[v + 1];
        for (int32_t i = begin; i < end; i++) {
            places[states[graph->near[i]] + 1]++;
        }
        places[0] = begin;
        for (int state = 0; state < REEL_STATES - 1; state++) {
            places[state + 1] += places[state];
            own->ends[v].of[state] = places[state + 1];
        }
        for (int32_t i = begin; i < end; i++) {
            int32_t u = graph->near[i];
            own->rows[places[states[u]]++] = u;
        }
    }
}

/* What `seen` has of a vertex that a search first meets in a ring, without paths: more than of those
   that no search has met since, less than of those that this one has met before. */
REEL_INLINE uint64_t mark_of(int32_t search, int distance) {
    return (uint64_t)(4 * search + REACH - distance) << 32;
}

REEL_INLINE int32_t paths_to(const reel_searcher *own, int32_t v) {
    int32_t paths = (int32_t)(uint32_t)own->seen[v];
    return paths < MOST_PATHS ? paths : MOST_PATHS;
}

/* Beside the row, up to WIDE - 1 numbers behind it are read, and written behind the crowd. */
REEL_INLINE void add_row(crowd *all, const int32_t *row, int32_t length, int32_t paths) {
    for (int32_t i = 0; i < length; i += WIDE) {
        *(numbers_8 *)&all->vertices[all->count + i] = *(const numbers_8 *)&row[i];
        *(numbers_8 *)&all->paths[all->count + i] = paths - (numbers_8){0};
    }
    all->count += length;
}

/* Lists those of a crowd that this search has not seen; how many are listed then. All that belong
   to the ring of the mark count their paths. Masks, where compilers would make a choice a branch. */
static int32_t list_new(const reel_searcher *own, uint64_t mark, crowd *all, int32_t n_next) {
    uint64_t *marks = own->seen;
    int32_t *next = own->next, count = all->count;
    for (int32_t i = 0; i < count; i++) {
        int32_t w = all->vertices[i];
        uint64_t seen = marks[w];
        next[n_next] = w; /* stays if it is new */
        n_next += seen < mark;
        seen = seen > mark ? seen : mark;
        uint64_t belongs = (seen - mark) >> 32 == 0;
        marks[w] = seen + ((uint64_t)all->paths[i] & (0 - belongs));
    }
    all->count = 0;
    return n_next;
}

/* The ring behind that of n vertices; of the last one only vertices of earlier levels. */
static int32_t grow_ring(reel_searcher *own, const reel_graph *graph, int32_t search, int distance,
                         uint8_t level, int32_t n) {
    int32_t n_next = 0;
    crowd all;
    all.count = 0;
    for (int32_t i = 0; i < n; i++) {
        int32_t u = own->ring[i], begin = graph->starts[u], end = graph->starts[u + 1];
        if (end - begin <= LARGEST_PASSAGE) {
            int32_t last = distance < REACH ? end : own->ends[u].of[level - 1];
            add_row(&all, own->rows + begin, last - begin, paths_to(own, u));
        }
        if (all.count > CROWD) {
            n_next = list_new(own, mark_of(search, distance), &all, n_next);
        }
    }
    return list_new(own, mark_of(search, distance), &all, n_next);
}

/* The first ring is all that is next to v. */
static int32_t begin_ring(reel_searcher *own, const reel_graph *graph, int32_t search, int32_t v) {
    int32_t begin = graph->starts[v], n = graph->starts[v + 1] - begin;
    own->seen[v] = mark_of(search, 0);
    for (int32_t i = 0; i < n; i++) {
        int32_t u = own->rows[begin + i];
        own->seen[u] = mark_of(search, 1) + 1;
        own->next[i] = u;
    }
    return n;
}

/* Keys of those of a ring that are of earlier levels: many shortest paths first, then the lowest
   place. How many there are. */
static int32_t list_keys(const reel_searcher *own, const uint8_t *states, uint8_t level, int32_t n) {
    int32_t count = 0;
    for (int32_t i = 0; i < n; i++) {
        int32_t u = own->next[i];
        own->found[count] = (MOST_PATHS - paths_to(own, u)) << REEL_PLACE_BITS | u;
        count += states[u] < level;
    }
    return count;
}

/* Few numbers, all different, ascending: each is put where it belongs. */
#define DEFINE_SORT(name, target)                                                                  \
    target static void name(int32_t *numbers, int32_t count, int32_t *sorted) {                    \
        *(numbers_8 *)&numbers[count] = INT32_MAX - (numbers_8){0};                                \
        for (int32_t i = 0; i < count; i += WIDE) {                                                \
            numbers_8 some = *(const numbers_8 *)&numbers[i], ranks = {0};                         \
            for (int32_t j = 0; j < count; j++) {                                                  \
                ranks -= some > numbers[j];                                                        \
            }                                                                                      \
            for (int lane = 0; lane < WIDE; lane++) {                                              \
                sorted[ranks[lane]] = some[lane];                                                  \
            }                                                                                      \
        }                                                                                          \
    }

DEFINE_SORT(sort_few, )
#ifdef REEL_HAS_WIDE
DEFINE_SORT(sort_few_wide, REEL_TARGET_4)
#endif
#undef DEFINE_SORT

static void sort(const reel_searcher *own, int32_t count, int32_t *sorted) {
#ifdef REEL_HAS_WIDE
    if (own->lanes > 2) {
        sort_few_wide(own->found, count, sorted);
        return;
    }
#endif
    sort_few(own->found, count, sorted);
}

/* The lowest of `count` numbers, all different, ascending: at most `room`. */
static void keep_lowest(const int32_t *numbers, int32_t count, int32_t *lowest, int32_t room) {
    int32_t kept = 0;
    for (int32_t i = 0; i < count; i++) {
        int32_t number = numbers[i], place = kept;
        if (kept == room && lowest[room - 1] < number) {
            continue;
        }
        kept += kept < room;
        place -= place == room;
        for (; place > 0 && lowest[place - 1] > number; place--) {
            lowest[place] = lowest[place - 1];
        }
        lowest[place] = number;
    }
}

/* The vertices of earlier levels nearest to v: by distance, then by shortest paths. */
static void find_nearest(reel_searcher *own, const reel_graph *graph, const uint8_t *states,
                         int32_t search, int32_t v, int32_t size, int32_t *stencil,
                         uint8_t *hops) {
    int32_t n_found = 0, n_ring = 0, sorted[FEW + 1];
    for (int distance = 1; distance <= REACH && n_found < size; distance++) {
        n_ring = distance == 1 ? begin_ring(own, graph, search, v)
                               : grow_ring(own, graph, search, distance, states[v], n_ring);
        int32_t count = list_keys(own, states, states[v], n_ring), room = size - n_found;
        if (count <= FEW) {
            sort(own, count, sorted);
        } else {
            keep_lowest(own->found, count, sorted, room);
        }
        count = count < room ? count : room;
        for (int32_t i = 0; i < count; i++) {
            stencil[n_found] = sorted[i] & ((1 << REEL_PLACE_BITS) - 1);
            hops[n_found++] = (uint8_t)distance;
        }
        int32_t *ring = own->ring;
        own->ring = own->next;
        own->next = ring;
    }
    for (; n_found < size; n_found++) {
        stencil[n_found] = -1;
        hops[n_found] = 0;
    }
}

void reel_find_stencils(reel_searcher *own, const reel_graph *graph, const uint8_t *states,
                        const int32_t *order, int32_t n, int32_t size, int32_t *stencil,
                        uint8_t *hops) {
    reel_zero(own->seen, (size_t)graph->n * sizeof *own->seen);
    sort_rows(own, graph, states);
    for (int32_t i = 0; i < n; i++) {
        size_t row = (size_t)i * (size_t)size;
        find_nearest(own, graph, states, i + 1, order[i], size, stencil + row, hops + row);
    }
}
