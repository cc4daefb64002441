/* The coding order of the items of a graph, and the earlier items that predict each.

   docs/format.md, "Exact values". The next item is one with the most visited neighbors, so that
   several of its neighbors are known. Positions are those in this order. */

#ifndef REEL_EXACT_ORDER_H
#define REEL_EXACT_ORDER_H

#include "graph.h"

#define REEL_MAX_NEAR 10        /* earlier items that predict one */
#define REEL_QUEUES 4           /* by number of visited neighbors; the last holds all with more */
#define REEL_MAX_PATH_DEGREE 24 /* paths do not pass through items with more neighbors */
#define REEL_UNVISITED INT32_MAX

typedef struct {
    reel_graph graph;
    int32_t *order;      /* items by position */
    int32_t *position;   /* position of each item, or REEL_NOT_YET */
    int32_t *queues;     /* REEL_QUEUES x items */
    int32_t *counts;     /* scratch per item; 0 between calls */
    bool in_given_order; /* items are in the order of their numbers */
} reel_traversal;

REEL_INLINE void reel_allocate_traversal(reel_traversal *traversal, reel_arena *arena, size_t n) {
    traversal->order = reel_allocate(arena, n, sizeof(int32_t));
    traversal->position = reel_allocate(arena, n, sizeof(int32_t));
    traversal->counts = reel_allocate(arena, n, sizeof(int32_t));
    traversal->queues = reel_allocate(arena, REEL_QUEUES * n, sizeof(int32_t));
}

/* Whether the adjacency is valid: ascending starts, neighbors of 0..n-1. */
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

/* Pop the next unvisited item of the highest queue, or return -1. */
REEL_INLINE int32_t reel_next_item(reel_traversal *traversal, reel_queue_ends *ends) {
    for (int i = REEL_QUEUES - 1; i >= 0; i--) {
        const int32_t *queue = traversal->queues + (int64_t)i * traversal->graph.n;
        while (ends->first[i] < ends->end[i]) {
            int32_t item = queue[ends->first[i]++];
            if (traversal->position[item] == REEL_UNVISITED) {
                return item;
            }
        }
    }
    return -1;
}

/* Visit an item, and queue its unvisited neighbors by how many of theirs are visited. */
REEL_INLINE void reel_visit_item(reel_traversal *traversal, reel_queue_ends *ends, int32_t item,
                                 int32_t position) {
    const reel_graph *graph = &traversal->graph;
    traversal->order[position] = item;
    traversal->position[item] = position;
    for (int32_t i = graph->starts[item]; i < graph->starts[item + 1]; i++) {
        int32_t other = graph->near[i];
        if (traversal->position[other] == REEL_UNVISITED &&
            traversal->counts[other] < REEL_QUEUES) {
            int32_t queue = traversal->counts[other]++;
            traversal->queues[(int64_t)queue * graph->n + ends->end[queue]++] = other;
        }
    }
}

REEL_INLINE void reel_traverse_in_order(reel_traversal *traversal) {
    for (int32_t i = 0; i < traversal->graph.n; i++) {
        traversal->order[i] = traversal->position[i] = i;
        traversal->counts[i] = 0;
    }
    traversal->in_given_order = true;
}

REEL_INLINE void reel_traverse_graph(reel_traversal *traversal) {
    int32_t n = traversal->graph.n, seed = 0;
    reel_queue_ends ends = {0};
    for (int32_t i = 0; i < n; i++) {
        traversal->position[i] = REEL_UNVISITED;
        traversal->counts[i] = 0;
    }
    for (int32_t position = 0; position < n; position++) {
        int32_t item = reel_next_item(traversal, &ends);
        while (item < 0 && traversal->position[seed] != REEL_UNVISITED) {
            seed++;
        }
        reel_visit_item(traversal, &ends, item < 0 ? seed : item, position);
    }
    for (int32_t i = 0; i < n; i++) {
        traversal->counts[i] = 0;
    }
    traversal->in_given_order = false;
}

/* Insert a key into the `max_keys` highest keys, sorted descending; returns their number. */
REEL_INLINE int reel_insert_key(int64_t *keys, int n, int max_keys, int64_t key) {
    if (n == max_keys && key < keys[n - 1]) {
        return n;
    }
    int index = n < max_keys ? n : n - 1;
    for (; index > 0 && keys[index - 1] < key; index--) {
        keys[index] = keys[index - 1];
    }
    keys[index] = key;
    return n < max_keys ? n + 1 : n;
}

/* Count the paths of two edges to each earlier position that is not adjacent to the item; or, with
   `lists`, collect these positions as keys with the number of paths in the upper half, and reset
   the counts. */
REEL_INLINE int reel_walk_paths(reel_traversal *traversal, int32_t position, bool lists,
                                int64_t *keys, int n, int max_keys) {
    const reel_graph *graph = &traversal->graph;
    int32_t item = traversal->order[position];
    for (int32_t i = graph->starts[item]; i < graph->starts[item + 1]; i++) {
        int32_t middle = graph->near[i];
        int32_t degree = reel_degree(graph, middle);
        for (int32_t j = 0; degree <= REEL_MAX_PATH_DEGREE && j < degree; j++) {
            int32_t other = graph->near[graph->starts[middle] + j];
            int32_t *count = &traversal->counts[other];
            if (traversal->position[other] >= position || *count < 0) {
                continue;
            }
            if (!lists) {
                ++*count;
            } else if (*count) {
                n = reel_insert_key(keys, n, max_keys,
                                    (int64_t)*count << 32 | traversal->position[other]);
                *count = 0;
            }
        }
    }
    return n;
}

/* Find the earlier positions that predict an item: its neighbors, latest first, then items two
   edges away, by number of paths, then latest first. Returns how many. */
REEL_INLINE int reel_find_near(reel_traversal *traversal, int32_t position, int max_near,
                               int32_t *result) {
    const reel_graph *graph = &traversal->graph;
    int64_t keys[REEL_MAX_NEAR];
    int32_t item = traversal->order[position], first = graph->starts[item],
            end = graph->starts[item + 1];
    int n = 0;
    for (int32_t i = first; i < end; i++) {
        if (traversal->position[graph->near[i]] < position) {
            n = reel_insert_key(keys, n, max_near, traversal->position[graph->near[i]]);
            traversal->counts[graph->near[i]] = -1;
        }
    }
    for (int i = 0; i < n; i++) {
        result[i] = (int32_t)keys[i];
    }
    if (n < max_near) {
        reel_walk_paths(traversal, position, false, keys, 0, max_near - n);
        int n_distant = reel_walk_paths(traversal, position, true, keys, 0, max_near - n);
        for (int i = 0; i < n_distant; i++) {
            result[n + i] = (int32_t)(keys[i] & INT32_MAX);
        }
        n += n_distant;
    }
    for (int32_t i = first; i < end; i++) {
        traversal->counts[graph->near[i]] = 0;
    }
    return n;
}

/* Move or insert the previous position to the front of the predictors. */
REEL_INLINE int reel_prepend_position(int32_t previous, int32_t *result, int n, int max_near) {
    int index = 0;
    while (index < n && result[index] != previous) {
        index++;
    }
    n += index == n && n < max_near;
    for (index = index < n ? index : n - 1; index > 0; index--) {
        result[index] = result[index - 1];
    }
    result[0] = previous;
    return n;
}

#endif
