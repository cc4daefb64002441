/* In which order items of a graph are coded exactly, and by which earlier ones each is expected.

   docs/format.md, "Exact values". Next comes an item with the most neighbours that have come: so
   each lies beside several that are known. Places are positions in this order. */

#ifndef REEL_EXACT_ORDER_H
#define REEL_EXACT_ORDER_H

#include "graph.h"

#define REEL_MOST_NEAR 10   /* earlier items that expect one */
#define REEL_QUEUES 4       /* by how many neighbours have come, the last of all that have more */
#define REEL_MOST_PATHS 24  /* no path leads through an item with more neighbours */
#define REEL_NOT_YET INT32_MAX

typedef struct {
    reel_graph graph;
    int32_t *order;  /* items by place */
    int32_t *place;  /* of each item; REEL_NOT_YET */
    int32_t *queues; /* REEL_QUEUES x items */
    int32_t *counts; /* of each item, between calls 0 */
    bool are_listed; /* items come in the order of their numbers */
} reel_visits;

REEL_INLINE size_t reel_visits_room(size_t n) {
    return 3 * reel_room(n, sizeof(int32_t)) + reel_room(REEL_QUEUES * n, sizeof(int32_t));
}

REEL_INLINE void reel_take_visits(reel_visits *visits, reel_arena *arena, size_t n) {
    visits->order = reel_take(arena, n, sizeof(int32_t));
    visits->place = reel_take(arena, n, sizeof(int32_t));
    visits->counts = reel_take(arena, n, sizeof(int32_t));
    visits->queues = reel_take(arena, REEL_QUEUES * n, sizeof(int32_t));
}

/* Whether the graph is one of its n items. */
REEL_INLINE bool reel_is_graph(const reel_graph *graph) {
    if (graph->starts[0] != 0) {
        return false;
    }
    for (int32_t i = 0; i < graph->n; i++) {
        if (graph->starts[i + 1] < graph->starts[i]) {
            return false;
        }
    }
    for (int32_t i = 0; i < graph->starts[graph->n]; i++) {
        if (graph->near[i] < 0 || graph->near[i] >= graph->n) {
            return false;
        }
    }
    return true;
}

typedef struct {
    int32_t first[REEL_QUEUES];
    int32_t end[REEL_QUEUES];
} reel_queue_ends;

/* The first item of the highest queue that has not come, or -1. */
REEL_INLINE int32_t reel_next_item(reel_visits *visits, reel_queue_ends *ends) {
    for (int i = REEL_QUEUES - 1; i >= 0; i--) {
        const int32_t *queue = visits->queues + (int64_t)i * visits->graph.n;
        while (ends->first[i] < ends->end[i]) {
            int32_t item = queue[ends->first[i]++];
            if (visits->place[item] == REEL_NOT_YET) {
                return item;
            }
        }
    }
    return -1;
}

/* An item comes; its neighbours that have not are queued by how many of theirs have. */
REEL_INLINE void reel_visit(reel_visits *visits, reel_queue_ends *ends, int32_t item,
                            int32_t place) {
    const reel_graph *graph = &visits->graph;
    visits->order[place] = item;
    visits->place[item] = place;
    for (int32_t i = graph->starts[item]; i < graph->starts[item + 1]; i++) {
        int32_t other = graph->near[i];
        if (visits->place[other] == REEL_NOT_YET && visits->counts[other] < REEL_QUEUES) {
            int32_t queue = visits->counts[other]++;
            visits->queues[(int64_t)queue * graph->n + ends->end[queue]++] = other;
        }
    }
}

REEL_INLINE void reel_list_visits(reel_visits *visits) {
    for (int32_t i = 0; i < visits->graph.n; i++) {
        visits->order[i] = visits->place[i] = i;
        visits->counts[i] = 0;
    }
    visits->are_listed = true;
}

REEL_INLINE void reel_find_visits(reel_visits *visits) {
    int32_t n = visits->graph.n, seed = 0;
    reel_queue_ends ends = {0};
    for (int32_t i = 0; i < n; i++) {
        visits->place[i] = REEL_NOT_YET;
        visits->counts[i] = 0;
    }
    for (int32_t place = 0; place < n; place++) {
        int32_t item = reel_next_item(visits, &ends);
        while (item < 0 && visits->place[seed] != REEL_NOT_YET) {
            seed++;
        }
        reel_visit(visits, &ends, item < 0 ? seed : item, place);
    }
    for (int32_t i = 0; i < n; i++) {
        visits->counts[i] = 0;
    }
    visits->are_listed = false;
}

/* Keeps the `most` of the highest keys, highest first. */
REEL_INLINE int reel_keep(int64_t *keys, int n, int most, int64_t key) {
    if (n == most && key < keys[n - 1]) {
        return n;
    }
    int at = n < most ? n : n - 1;
    for (; at > 0 && keys[at - 1] < key; at--) {
        keys[at] = keys[at - 1];
    }
    keys[at] = key;
    return n < most ? n + 1 : n;
}

/* Counts the paths of two edges to each earlier place that is not next to the item; or lists these
   places, with the number of paths above the place in `keys`, and forgets the counts. */
REEL_INLINE int reel_walk_paths(reel_visits *visits, int32_t place, bool lists, int64_t *keys,
                                int n, int most) {
    const reel_graph *graph = &visits->graph;
    int32_t item = visits->order[place];
    for (int32_t i = graph->starts[item]; i < graph->starts[item + 1]; i++) {
        int32_t middle = graph->near[i];
        int32_t degree = reel_degree(graph, middle);
        for (int32_t j = 0; degree <= REEL_MOST_PATHS && j < degree; j++) {
            int32_t other = graph->near[graph->starts[middle] + j];
            int32_t *count = &visits->counts[other];
            if (visits->place[other] >= place || *count < 0) {
                continue;
            }
            if (!lists) {
                ++*count;
            } else if (*count) {
                n = reel_keep(keys, n, most, (int64_t)*count << 32 | visits->place[other]);
                *count = 0;
            }
        }
    }
    return n;
}

/* Earlier places that expect that at a place: next to it, the latest first; then those two edges
   away, first to which most paths lead, of these the latest. Returns how many. */
REEL_INLINE int reel_find_near(reel_visits *visits, int32_t place, int most, int32_t *found) {
    const reel_graph *graph = &visits->graph;
    int64_t keys[REEL_MOST_NEAR];
    int32_t item = visits->order[place], first = graph->starts[item], end = graph->starts[item + 1];
    int n = 0;
    for (int32_t i = first; i < end; i++) {
        if (visits->place[graph->near[i]] < place) {
            n = reel_keep(keys, n, most, visits->place[graph->near[i]]);
            visits->counts[graph->near[i]] = -1;
        }
    }
    for (int i = 0; i < n; i++) {
        found[i] = (int32_t)keys[i];
    }
    if (n < most) {
        reel_walk_paths(visits, place, false, keys, 0, most - n);
        int more = reel_walk_paths(visits, place, true, keys, 0, most - n);
        for (int i = 0; i < more; i++) {
            found[n + i] = (int32_t)(keys[i] & INT32_MAX);
        }
        n += more;
    }
    for (int32_t i = first; i < end; i++) {
        visits->counts[graph->near[i]] = 0;
    }
    return n;
}

/* Puts the place before first among those that expect one. */
REEL_INLINE int reel_put_first(int32_t before, int32_t *found, int n, int most) {
    int at = 0;
    while (at < n && found[at] != before) {
        at++;
    }
    n += at == n && n < most;
    for (at = at < n ? at : n - 1; at > 0; at--) {
        found[at] = found[at - 1];
    }
    found[0] = before;
    return n;
}

#endif
