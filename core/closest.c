/* Closest points of a triangle mesh, found with a tree of boxes.

   A node has FANOUT children, whose boxes are tested at once. To build the tree, faces are split
   recursively near the median of their centroids along the longest axis, such that all nodes of a
   level but the last one have the same number of faces. Nodes thus need no pointers. */

#include "cpu.h"

#define FANOUT 8
#define LEAF 4        /* triangles of a leaf */
#define MAX_LEVELS 10 /* of nodes: enough for MAX_FACES */
#define MAX_FACES (INT64_C(1) << 29)
#define MAX_PENDING (FANOUT * (MAX_LEVELS + 1))
#define KEY_BITS 30
#define DIGIT_BITS 10
#define N_DIGITS (1 << DIGIT_BITS)

/* Boxes are searched up to a bound that exceeds the least squared distance so far by these shares
   of it and of the squared size of the mesh. That covers rounding errors: the result does not
   depend on the order of the search. */
#define SLACK 0x1p-20
#define SLACK_OF_SIZE 0x1p-74

typedef struct {
    double center[3][FANOUT];
    double half[3][FANOUT]; /* half the size, -infinity if there is no child */
} boxes;

/* The triangles of a leaf. */
typedef struct {
    double origin[3][LEAF];   /* the first corner */
    double edges[2][3][LEAF]; /* from there to the others */
    double normal[3][LEAF];   /* divided by its squared length; not finite without area */
    double inverses[3][LEAF]; /* of the squared lengths of these edges and the third, or 0 */
    int64_t face[LEAF];
} triangles;

/* Nodes of level 0 have leaves; the last level has one node. */
typedef struct {
    boxes *levels[MAX_LEVELS];
    int64_t n_nodes[MAX_LEVELS];
    int n_levels;
    triangles *leaves;
    int64_t n_leaves;
} triangle_tree;

typedef struct {
    float centroid[3];
    int32_t face;
} item;

static double smaller(double a, double b) { return a < b ? a : b; }
static double larger(double a, double b) { return a > b ? a : b; }

static triangle_tree allocate_tree(reel_arena *arena, int64_t n_faces) {
    triangle_tree tree = {.n_leaves = (n_faces + LEAF - 1) / LEAF};
    int64_t n = tree.n_leaves;
    do {
        n = (n + FANOUT - 1) / FANOUT;
        tree.n_nodes[tree.n_levels] = n;
        tree.levels[tree.n_levels++] = reel_allocate(arena, (size_t)n, sizeof(boxes));
    } while (n > 1);
    tree.leaves = reel_allocate(arena, (size_t)tree.n_leaves, sizeof(triangles));
    return tree;
}

/* ---- building ---- */

/* Reorder items until no item before the nth has a higher centroid along an axis, and no item after
   it a lower one (C. A. R. Hoare's quickselect). */
static void split_items(item *items, int64_t n, int64_t nth, int axis) {
    int64_t first = 0, last = n - 1;
    while (first < last) {
        float pivot = items[first + (last - first) / 2].centroid[axis];
        int64_t low = first, high = last;
        while (low <= high) {
            while (items[low].centroid[axis] < pivot) {
                low++;
            }
            while (items[high].centroid[axis] > pivot) {
                high--;
            }
            if (low <= high) {
                item swapped = items[low];
                items[low++] = items[high];
                items[high--] = swapped;
            }
        }
        if (nth <= high) {
            last = high;
        } else if (nth >= low) {
            first = low;
        } else {
            return;
        }
    }
}

static int longest_axis(const item *items, int64_t n) {
    float low[3], high[3];
    reel_copy(low, items->centroid, sizeof low);
    reel_copy(high, items->centroid, sizeof high);
    for (int64_t i = 1; i < n; i++) {
        for (int axis = 0; axis < 3; axis++) {
            float coordinate = items[i].centroid[axis];
            low[axis] = coordinate < low[axis] ? coordinate : low[axis];
            high[axis] = coordinate > high[axis] ? coordinate : high[axis];
        }
    }
    int longest = 0;
    for (int axis = 1; axis < 3; axis++) {
        longest = high[axis] - low[axis] > high[longest] - low[longest] ? axis : longest;
    }
    return longest;
}

/* Sort the n items of some children of a node; a full child has `size` items. */
static void sort_items(item *items, int64_t n, int64_t size) {
    while (size > LEAF && n <= size) {
        size /= FANOUT;
    }
    if (n <= size) {
        return;
    }
    int64_t n_children = (n + size - 1) / size, middle = (n_children + 1) / 2 * size;
    split_items(items, n, middle, longest_axis(items, n));
    sort_items(items, middle, size);
    sort_items(items + middle, n - middle, size);
}

static void set_triangle(triangles *leaf, int slot, const double *vertices, const int32_t *faces,
                         int32_t face) {
    const double *corners[3];
    double edges[3][3], squares[3] = {0.0, 0.0, 0.0}, normal[3], square = 0.0;
    for (int corner = 0; corner < 3; corner++) {
        corners[corner] = vertices + 3 * (int64_t)faces[3 * (int64_t)face + corner];
    }
    for (int axis = 0; axis < 3; axis++) {
        edges[0][axis] = corners[1][axis] - corners[0][axis];
        edges[1][axis] = corners[2][axis] - corners[0][axis];
        edges[2][axis] = edges[1][axis] - edges[0][axis];
        for (int edge = 0; edge < 3; edge++) {
            squares[edge] += edges[edge][axis] * edges[edge][axis];
        }
    }
    for (int axis = 0; axis < 3; axis++) {
        int next = (axis + 1) % 3, last = (axis + 2) % 3;
        normal[axis] = edges[0][next] * edges[1][last] - edges[0][last] * edges[1][next];
        square += normal[axis] * normal[axis];
    }
    for (int axis = 0; axis < 3; axis++) {
        leaf->origin[axis][slot] = corners[0][axis];
        leaf->edges[0][axis][slot] = edges[0][axis];
        leaf->edges[1][axis][slot] = edges[1][axis];
        leaf->normal[axis][slot] = normal[axis] / square;
        leaf->inverses[axis][slot] = squares[axis] > 0.0 ? 1.0 / squares[axis] : 0.0;
    }
    leaf->face[slot] = face;
}

static void set_box(boxes *nodes, int64_t child, const double *low, const double *high) {
    for (int axis = 0; axis < 3; axis++) {
        double center = 0.5 * (low[axis] + high[axis]);
        double half = larger(center - low[axis], high[axis] - center);
        nodes[child / FANOUT].center[axis][child % FANOUT] = center;
        nodes[child / FANOUT].half[axis][child % FANOUT] = half * (1.0 + 0x1p-50);
    }
}

static void clear_node(boxes *node) {
    for (int child = 0; child < FANOUT; child++) {
        for (int axis = 0; axis < 3; axis++) {
            node->center[axis][child] = 0.0;
            node->half[axis][child] = -__builtin_inf();
        }
    }
}

/* The box of the children of a node. */
static void bound_node(const boxes *node, double *low, double *high) {
    for (int axis = 0; axis < 3; axis++) {
        low[axis] = __builtin_inf();
        high[axis] = -__builtin_inf();
        for (int child = 0; child < FANOUT; child++) {
            double center = node->center[axis][child], half = node->half[axis][child];
            low[axis] = smaller(low[axis], center - half);
            high[axis] = larger(high[axis], center + half);
        }
    }
}

/* Fill a leaf, and set its box. Slots after the last item repeat it. */
static void set_leaf(const triangle_tree *tree, int64_t number, const item *items, int64_t n,
                     const double *vertices, const int32_t *faces) {
    double low[3], high[3];
    for (int axis = 0; axis < 3; axis++) {
        low[axis] = __builtin_inf();
        high[axis] = -__builtin_inf();
    }
    for (int slot = 0; slot < LEAF; slot++) {
        int64_t index = LEAF * number + slot;
        int32_t face = items[index < n ? index : n - 1].face;
        set_triangle(tree->leaves + number, slot, vertices, faces, face);
        for (int i = 0; i < 9; i++) {
            double value = vertices[3 * (int64_t)faces[3 * (int64_t)face + i / 3] + i % 3];
            low[i % 3] = smaller(low[i % 3], value);
            high[i % 3] = larger(high[i % 3], value);
        }
    }
    set_box(tree->levels[0], number, low, high);
}

static void fill_tree(const triangle_tree *tree, const item *items, int64_t n,
                      const double *vertices, const int32_t *faces) {
    for (int level = 0; level < tree->n_levels; level++) {
        clear_node(tree->levels[level] + tree->n_nodes[level] - 1);
    }
    for (int64_t i = 0; i < tree->n_leaves; i++) {
        set_leaf(tree, i, items, n, vertices, faces);
    }
    for (int level = 1; level < tree->n_levels; level++) {
        for (int64_t i = 0; i < tree->n_nodes[level - 1]; i++) {
            double low[3], high[3];
            bound_node(tree->levels[level - 1] + i, low, high);
            set_box(tree->levels[level], i, low, high);
        }
    }
}

size_t reel_triangle_tree_bytes(int64_t n_faces) {
    reel_arena arena = REEL_MEASURE;
    allocate_tree(&arena, n_faces);
    return arena.used;
}

size_t reel_triangle_tree_memory(int64_t n_faces) {
    return reel_array_bytes((size_t)n_faces, sizeof(item));
}

int64_t reel_triangle_tree(void *memory, size_t memory_size, const double *vertices,
                           int64_t n_verts, const int32_t *faces, int64_t n_faces, void *tree) {
    if (n_faces < 1 || n_faces > MAX_FACES) {
        return reel_failure(REEL_INVALID, 0);
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
    reel_arena tree_arena = reel_arena_of(tree, reel_triangle_tree_bytes(n_faces));
    item *items = reel_allocate(&arena, (size_t)n_faces, sizeof *items);
    triangle_tree new_tree = allocate_tree(&tree_arena, n_faces);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    for (int64_t i = 0; i < 3 * n_faces; i++) {
        if (faces[i] < 0 || faces[i] >= n_verts) {
            return reel_failure(REEL_INVALID, (uint64_t)i / 3);
        }
    }
    const double *origin = vertices + 3 * (int64_t)faces[0]; /* keeps digits far from zero */
    for (int64_t i = 0; i < n_faces; i++) {
        items[i].face = (int32_t)i;
        for (int axis = 0; axis < 3; axis++) {
            double sum = 0.0;
            for (int corner = 0; corner < 3; corner++) {
                sum += vertices[3 * (int64_t)faces[3 * i + corner] + axis] - origin[axis];
            }
            items[i].centroid[axis] = (float)sum;
        }
    }
    int64_t size = LEAF;
    while (size < n_faces) {
        size *= FANOUT;
    }
    sort_items(items, n_faces, size);
    fill_tree(&new_tree, items, n_faces, vertices, faces);
    return n_faces;
}

/* ---- searching ---- */

typedef struct {
    triangle_tree tree;
    double slack;
    const double *points, *directions; /* `directions` may be NULL */
    double reach_square;
    const uint64_t *order; /* numbers of the points, in the lower 32 bits */
    int64_t n_points;
    double *distances;
    int32_t *faces;
    double *closest, *weights;
} search_job;

typedef struct {
    double square; /* of the distance */
    double s, t;   /* coordinates along the edges of the triangle */
    int64_t face, leaf;
    int slot; /* in the leaf */
} nearest_point;

typedef struct {
    double square; /* of the distance from its box */
    int64_t number;
    int level; /* -1 for leaves */
} pending_node;

static void write_point(const search_job *job, int64_t point, const nearest_point *nearest) {
    if (nearest->face == INT64_MAX) {
        job->distances[point] = __builtin_inf();
        job->faces[point] = -1;
        for (int axis = 0; axis < 3; axis++) {
            job->closest[3 * point + axis] = job->weights[3 * point + axis] = 0.0;
        }
        return;
    }
    const triangles *leaf = job->tree.leaves + nearest->leaf;
    job->distances[point] = __builtin_sqrt(nearest->square);
    job->faces[point] = (int32_t)nearest->face;
    for (int axis = 0; axis < 3; axis++) {
        double along = nearest->s * leaf->edges[0][axis][nearest->slot] +
                       nearest->t * leaf->edges[1][axis][nearest->slot];
        job->closest[3 * point + axis] = leaf->origin[axis][nearest->slot] + along;
    }
    job->weights[3 * point] = larger(1.0 - nearest->s - nearest->t, 0.0);
    job->weights[3 * point + 1] = nearest->s;
    job->weights[3 * point + 2] = nearest->t;
}

#define LANES 2
#include "closest_lanes.h"

#ifdef REEL_HAS_WIDE
#define LANES 4
#include "closest_lanes.h"
#endif

/* Insert two zeros before each of 10 bits. */
static uint64_t spread_bits(uint64_t bits) {
    bits = (bits | bits << 16) & 0x030000FFU;
    bits = (bits | bits << 8) & 0x0300F00FU;
    bits = (bits | bits << 4) & 0x030C30C3U;
    return (bits | bits << 2) & 0x09249249U;
}

/* Sort the numbers of points, in the lower 32 bits, along a Morton curve: neighbors visit the same
   nodes. Returns `keys` or `sorted`. */
static uint64_t *sort_points(const double *points, int64_t n, uint64_t *keys, uint64_t *sorted) {
    double low[3], size = 0.0;
    for (int axis = 0; axis < 3; axis++) {
        double high = points[axis];
        low[axis] = high;
        for (int64_t i = 1; i < n; i++) {
            low[axis] = smaller(low[axis], points[3 * i + axis]);
            high = larger(high, points[3 * i + axis]);
        }
        size = larger(size, high - low[axis]);
    }
    double scale = size > 0.0 ? (N_DIGITS - 1) / size : 0.0;
    for (int64_t i = 0; i < n; i++) {
        uint64_t key = 0;
        for (int axis = 0; axis < 3; axis++) {
            double coordinate = larger((points[3 * i + axis] - low[axis]) * scale, 0.0);
            key |= spread_bits((uint64_t)smaller(coordinate, N_DIGITS - 1)) << axis;
        }
        keys[i] = key << 32 | (uint64_t)i;
    }
    for (int shift = 32; shift < 32 + KEY_BITS; shift += DIGIT_BITS) {
        int32_t starts[N_DIGITS + 1] = {0};
        for (int64_t i = 0; i < n; i++) {
            starts[1 + (keys[i] >> shift & (N_DIGITS - 1))]++;
        }
        reel_prefix_sum(starts, N_DIGITS);
        for (int64_t i = 0; i < n; i++) {
            sorted[starts[keys[i] >> shift & (N_DIGITS - 1)]++] = keys[i];
        }
        uint64_t *swapped = keys;
        keys = sorted;
        sorted = swapped;
    }
    return keys;
}

size_t reel_closest_memory(int64_t n_points) {
    return 2 * reel_array_bytes((size_t)n_points, sizeof(uint64_t));
}

int64_t reel_closest(void *memory, size_t memory_size, const void *tree, int64_t n_faces,
                     const double *points, const double *directions, double reach,
                     int64_t n_points, double *distances, int32_t *faces, double *closest,
                     double *weights) {
    if (n_faces < 1 || n_faces > MAX_FACES || n_points < 0 || n_points > INT32_MAX) {
        return reel_failure(REEL_INVALID, 0);
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
    reel_arena tree_arena = reel_arena_of((void *)tree, reel_triangle_tree_bytes(n_faces));
    uint64_t *keys = reel_allocate(&arena, (size_t)n_points, sizeof *keys);
    uint64_t *sorted = reel_allocate(&arena, (size_t)n_points, sizeof *sorted);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    if (n_points == 0) {
        return 0;
    }
    search_job job = {.tree = allocate_tree(&tree_arena, n_faces),
                      .points = points,
                      .directions = directions,
                      .reach_square = reach * reach,
                      .order = sort_points(points, n_points, keys, sorted),
                      .n_points = n_points,
                      .distances = distances,
                      .faces = faces,
                      .closest = closest,
                      .weights = weights};
    double low[3], high[3], size = 0.0;
    bound_node(job.tree.levels[job.tree.n_levels - 1], low, high);
    for (int axis = 0; axis < 3; axis++) {
        size += (high[axis] - low[axis]) * (high[axis] - low[axis]);
    }
    job.slack = SLACK_OF_SIZE * size + 0x1p-1000;
    REEL_UP_TO_4(reel_vector_width(), search, &job);
    return n_points;
}
