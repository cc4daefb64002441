/* Decimation of triangle meshes by edge collapses, the cheapest first, at the cost of quadrics:
   M. Garland, P. S. Heckbert, "Surface Simplification Using Quadric Error Metrics", 1997. A vertex
   moves to a neighbor, so that the remaining vertices keep their attributes. */

#include "base.h"

#define NONE (-1)
#define TERMS 10                 /* of a quadric */
#define MAX_NEIGHBORS 48         /* of a vertex that can be removed */
#define MIN_COSINE 0.3           /* between the normals of a face before and after a collapse */
#define MIN_HEIGHT 0.05          /* of a face after it, in longest sides, if it was higher before */

typedef struct {
    const double *points, *weights; /* three coordinates, and one weight, of each vertex */
    int32_t *faces, *wedges; /* three per face; the first vertex of a removed face is NONE */
    int32_t *first, *next;   /* first corner of a vertex; next corner of the same vertex */
    double *quadrics, *areas, *errors;
    int32_t *stamps, stamp;
    int32_t *heap, *places, n_heap; /* vertices by the cost of their best collapse */
    int32_t *targets;               /* neighbor that each vertex would move to */
    double *costs;
    double max_square, max_length; /* squared */
} decimation;

/* The neighbors of a vertex. For each: the number of common faces, whether the edge is a feature (a
   boundary or a seam between wedges), and the wedges of both vertices in the first face. */
typedef struct {
    int32_t n, n_features;
    bool is_fixed;
    int32_t vertices[MAX_NEIGHBORS], counts[MAX_NEIGHBORS];
    int32_t wedges[MAX_NEIGHBORS], neighbor_wedges[MAX_NEIGHBORS];
    bool is_feature[MAX_NEIGHBORS];
} vertex_ring;

static void subtract(const double *a, const double *b, double *result) {
    for (int i = 0; i < 3; i++) {
        result[i] = a[i] - b[i];
    }
}

static double dot(const double *a, const double *b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double *a, const double *b, double *result) {
    result[0] = a[1] * b[2] - a[2] * b[1];
    result[1] = a[2] * b[0] - a[0] * b[2];
    result[2] = a[0] * b[1] - a[1] * b[0];
}

/* The normal of a triangle, twice as long as its area. */
static void normal_of(const double *a, const double *b, const double *c, double *normal) {
    double first[3], second[3];
    subtract(b, a, first);
    subtract(c, a, second);
    cross(first, second, normal);
}

static const double *point_of(const decimation *state, int32_t vertex) {
    return state->points + 3 * (int64_t)vertex;
}

static double *quadric_of(const decimation *state, int32_t vertex) {
    return state->quadrics + TERMS * (int64_t)vertex;
}

static void add_neighbor(vertex_ring *ring, int32_t vertex, int32_t wedge,
                         int32_t neighbor_wedge) {
    int32_t i = 0;
    while (i < ring->n && ring->vertices[i] != vertex) {
        i++;
    }
    if (i == MAX_NEIGHBORS) {
        ring->is_fixed = true;
    } else if (i == ring->n) {
        ring->vertices[i] = vertex;
        ring->counts[i] = 1;
        ring->wedges[i] = wedge;
        ring->neighbor_wedges[i] = neighbor_wedge;
        ring->is_feature[i] = true;
        ring->n++;
    } else {
        ring->counts[i]++;
        ring->is_fixed |= ring->counts[i] > 2;
        ring->is_feature[i] =
            wedge != ring->wedges[i] || neighbor_wedge != ring->neighbor_wedges[i];
    }
}

/* The first corner in the list of a vertex, starting with this one, whose face remains. */
static int32_t corner_from(const decimation *state, int32_t corner) {
    while (corner != NONE && state->faces[corner / 3 * 3] == NONE) {
        corner = state->next[corner];
    }
    return corner;
}

#define EACH_CORNER(state, vertex, corner)                                            \
    for (int32_t corner = corner_from(state, (state)->first[vertex]); corner != NONE; \
         corner = corner_from(state, (state)->next[corner]))

static int32_t next_corner(int32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }

static int32_t previous_corner(int32_t corner) { return next_corner(next_corner(corner)); }

static void find_ring(const decimation *state, int32_t vertex, vertex_ring *ring) {
    ring->n = ring->n_features = 0;
    ring->is_fixed = false;
    EACH_CORNER(state, vertex, corner) {
        for (int32_t at = next_corner(corner); at != corner; at = next_corner(at)) {
            ring->is_fixed |= state->faces[at] == vertex;
            add_neighbor(ring, state->faces[at], state->wedges[corner], state->wedges[at]);
        }
    }
    for (int32_t i = 0; i < ring->n; i++) {
        ring->n_features += ring->is_feature[i];
    }
}

/* Sum of the squared distances of a point from the planes of a quadric, times their weights. */
static double evaluate_quadric(const double *quadric, const double *p) {
    double x = p[0], y = p[1], z = p[2];
    double terms[TERMS] = {x * x, y * y, z * z, x * y, y * z, z * x, x, y, z, 1.0};
    double sum = 0.0;
    for (int i = 0; i < TERMS; i++) {
        sum += quadric[i] * terms[i];
    }
    return sum > 0 ? sum : 0.0;
}

static void add_plane(decimation *state, int32_t vertex, const double *normal, double offset,
                      double area) {
    double weight = area * state->weights[vertex];
    double a = normal[0], b = normal[1], c = normal[2], d = offset;
    double terms[TERMS] = {a * a,     b * b,     c * c,     2 * a * b, 2 * b * c,
                           2 * c * a, 2 * a * d, 2 * b * d, 2 * c * d, d * d};
    for (int i = 0; i < TERMS; i++) {
        quadric_of(state, vertex)[i] += weight * terms[i];
    }
    state->areas[vertex] += weight;
}

/* Add the plane through some vertices, with a normal of any length, to their quadrics. */
static void add_planes(decimation *state, const int32_t *vertices, int n, const double *normal,
                       double area) {
    double length = __builtin_sqrt(dot(normal, normal)), direction[3];
    if (length > 0) {
        for (int i = 0; i < 3; i++) {
            direction[i] = normal[i] / length;
        }
        double offset = -dot(direction, point_of(state, vertices[0]));
        for (int i = 0; i < n; i++) {
            add_plane(state, vertices[i], direction, offset, area);
        }
    }
}

/* Set the quadrics: planes of faces, and planes through boundaries and seams, perpendicular to the
   faces. Returns the weighted area of all faces. */
static double set_quadrics(decimation *state, int32_t n_verts, int32_t n_faces) {
    double area = 0.0, normal[3], across[3], side[3];
    vertex_ring ring;
    for (int32_t face = 0; face < n_faces; face++) {
        const int32_t *corners = state->faces + 3 * (int64_t)face;
        normal_of(point_of(state, corners[0]), point_of(state, corners[1]),
                  point_of(state, corners[2]), normal);
        double face_area = __builtin_sqrt(dot(normal, normal)) / 2;
        add_planes(state, corners, 3, normal, face_area / 3);
        for (int k = 0; k < 3; k++) {
            area += face_area / 3 * state->weights[corners[k]];
        }
    }
    for (int32_t vertex = 0; vertex < n_verts; vertex++) {
        find_ring(state, vertex, &ring);
        EACH_CORNER(state, vertex, corner) { /* each half-edge belongs to one face */
            int32_t end = state->faces[next_corner(corner)], i = 0;
            while (i < ring.n && ring.vertices[i] != end) {
                i++;
            }
            if (i < ring.n && ring.is_feature[i]) {
                int32_t last = state->faces[previous_corner(corner)], ends[2] = {vertex, end};
                const double *a = point_of(state, vertex), *b = point_of(state, end);
                normal_of(a, b, point_of(state, last), normal);
                subtract(b, a, side);
                cross(side, normal, across);
                add_planes(state, ends, 2, across, dot(side, side) / 2);
            }
        }
    }
    for (int32_t vertex = 0; vertex < n_verts; vertex++) {
        state->errors[vertex] =
            evaluate_quadric(quadric_of(state, vertex), point_of(state, vertex));
    }
    return area;
}

/* The wedge of the target that replaces a wedge of the removed vertex; NONE if ambiguous. */
static int32_t new_wedge(const decimation *state, int32_t removed, int32_t target, int32_t wedge) {
    int32_t result = NONE;
    EACH_CORNER(state, removed, corner) {
        int32_t at = next_corner(corner);
        at = state->faces[at] == target ? at : next_corner(at);
        if (state->faces[at] == target && state->wedges[corner] == wedge) {
            if (result != NONE && result != state->wedges[at]) {
                return NONE;
            }
            result = state->wedges[at];
        }
    }
    return result;
}

/* Whether a triangle stays similar when a corner moves: its normal hardly turns, and it becomes
   neither a sliver nor longer than allowed, unless it was before. */
static bool is_similar(const decimation *state, const double *corner, const double *new_corner,
                       const double *a, const double *b) {
    double before[3], now[3], sides[3][3];
    normal_of(corner, a, b, before);
    normal_of(new_corner, a, b, now);
    double product = dot(before, now), square_before = dot(before, before);
    double square_now = dot(now, now);
    if (!(product > 0 &&
          product * product > MIN_COSINE * MIN_COSINE * square_before * square_now)) {
        return false;
    }
    double longest[2];
    for (int k = 0; k < 2; k++) {
        subtract(a, k ? new_corner : corner, sides[0]);
        subtract(b, k ? new_corner : corner, sides[1]);
        subtract(b, a, sides[2]);
        longest[k] = 0;
        for (int i = 0; i < 3; i++) {
            double square = dot(sides[i], sides[i]);
            longest[k] = square > longest[k] ? square : longest[k];
        }
    }
    if (longest[1] > state->max_length && longest[1] > longest[0]) {
        return false;
    }
    double height = square_now / (longest[1] * longest[1]);
    double height_before = square_before / (longest[0] * longest[0]);
    return height >= MIN_HEIGHT * MIN_HEIGHT || height >= height_before;
}

/* Whether there is a face with these vertices. */
static bool has_face(const decimation *state, int32_t vertex, int32_t a, int32_t b) {
    EACH_CORNER(state, vertex, corner) {
        int32_t first = state->faces[next_corner(corner)];
        int32_t second = state->faces[previous_corner(corner)];
        if ((first == a && second == b) || (first == b && second == a)) {
            return true;
        }
    }
    return false;
}

/* Whether a collapse keeps the topology, the normals, and the wedges. */
static bool is_valid_collapse(decimation *state, int32_t removed, const vertex_ring *ring,
                              int32_t i) {
    int32_t target = ring->vertices[i], n_common = 0;
    int32_t mark = state->stamp += 2; /* of neighbors of `removed`; the common ones get mark + 1 */
    for (int32_t k = 0; k < ring->n; k++) {
        state->stamps[ring->vertices[k]] = mark;
    }
    EACH_CORNER(state, target, corner) {
        for (int32_t at = next_corner(corner); at != corner; at = next_corner(at)) {
            if (state->stamps[state->faces[at]] == mark) {
                state->stamps[state->faces[at]]++;
                n_common++;
            }
        }
    }
    if (n_common != ring->counts[i]) {
        return false;
    }
    EACH_CORNER(state, removed, corner) {
        int32_t a = state->faces[next_corner(corner)];
        int32_t b = state->faces[previous_corner(corner)];
        if (a == target || b == target) {
            continue;
        }
        bool are_common = state->stamps[a] == mark + 1 && state->stamps[b] == mark + 1;
        if ((are_common && has_face(state, target, a, b)) ||
            new_wedge(state, removed, target, state->wedges[corner]) == NONE ||
            !is_similar(state, point_of(state, removed), point_of(state, target),
                        point_of(state, a), point_of(state, b))) {
            return false;
        }
    }
    return true;
}

/* Find the cheapest collapse of a vertex; its target is NONE if there is none. */
static void find_best_collapse(decimation *state, int32_t vertex) {
    vertex_ring ring;
    find_ring(state, vertex, &ring);
    state->targets[vertex] = NONE;
    if (ring.is_fixed || (ring.n_features != 0 && ring.n_features != 2)) {
        return;
    }
    for (int32_t i = 0; i < ring.n; i++) {
        int32_t target = ring.vertices[i];
        const double *point = point_of(state, target);
        double error = evaluate_quadric(quadric_of(state, vertex), point) +
                       evaluate_quadric(quadric_of(state, target), point);
        double cost = error - state->errors[vertex] - state->errors[target];
        bool is_near = error <= state->max_square * (state->areas[vertex] + state->areas[target]);
        bool is_cheaper = state->targets[vertex] == NONE || cost < state->costs[vertex];
        if ((ring.n_features == 0 || ring.is_feature[i]) && is_near && is_cheaper &&
            is_valid_collapse(state, vertex, &ring, i)) {
            state->targets[vertex] = target;
            state->costs[vertex] = cost > 0 ? cost : 0.0;
        }
    }
}

/* Whether the collapse of vertex `a` comes before that of `b`. */
static bool precedes(const decimation *state, int32_t a, int32_t b) {
    return state->costs[a] < state->costs[b] || (state->costs[a] == state->costs[b] && a < b);
}

static void heap_set(decimation *state, int32_t place, int32_t vertex) {
    state->heap[place] = vertex;
    state->places[vertex] = place;
}

/* Restore the order of the heap after a change at one place. */
static void heap_sift(decimation *state, int32_t place) {
    int32_t vertex = state->heap[place];
    while (place > 0 && precedes(state, vertex, state->heap[(place - 1) / 2])) {
        heap_set(state, place, state->heap[(place - 1) / 2]);
        place = (place - 1) / 2;
    }
    for (int32_t child; (child = 2 * place + 1) < state->n_heap; place = child) {
        if (child + 1 < state->n_heap &&
            precedes(state, state->heap[child + 1], state->heap[child])) {
            child++;
        }
        if (!precedes(state, state->heap[child], vertex)) {
            break;
        }
        heap_set(state, place, state->heap[child]);
    }
    heap_set(state, place, vertex);
}

/* Remove a vertex from the heap, if the heap contains it. */
static void heap_remove(decimation *state, int32_t vertex) {
    int32_t place = state->places[vertex], last = state->n_heap - 1;
    if (place != NONE) {
        state->places[vertex] = NONE;
        state->n_heap = last;
        if (place < last) {
            heap_set(state, place, state->heap[last]);
            heap_sift(state, place);
        }
    }
}

/* Find the cheapest collapse of a vertex after changes around it. */
static void update_collapse(decimation *state, int32_t vertex) {
    heap_remove(state, vertex);
    find_best_collapse(state, vertex);
    if (state->targets[vertex] != NONE) {
        heap_set(state, state->n_heap++, vertex);
        heap_sift(state, state->n_heap - 1);
    }
}

/* Whether a vertex is at one of the two other corners of a face. */
static bool is_at_other_corner(const decimation *state, int32_t corner, int32_t vertex) {
    return state->faces[next_corner(corner)] == vertex ||
           state->faces[previous_corner(corner)] == vertex;
}

/* Move the corners of a vertex to its target, and remove the faces that both belong to. */
static void collapse(decimation *state, int32_t removed) {
    int32_t target = state->targets[removed], moved_corners = NONE;
    EACH_CORNER(state, removed, corner) { /* first, since `new_wedge` needs the removed faces */
        int32_t wedge = new_wedge(state, removed, target, state->wedges[corner]);
        if (!is_at_other_corner(state, corner, target)) {
            state->wedges[corner] = wedge;
        }
    }
    for (int32_t corner = corner_from(state, state->first[removed]), next; corner != NONE;
         corner = next) {
        next = corner_from(state, state->next[corner]);
        if (is_at_other_corner(state, corner, target)) {
            state->faces[corner / 3 * 3] = NONE;
        } else {
            state->faces[corner] = target;
            state->next[corner] = moved_corners;
            moved_corners = corner;
        }
    }
    state->first[removed] = NONE;
    while (moved_corners != NONE) {
        int32_t next = state->next[moved_corners];
        state->next[moved_corners] = state->first[target];
        state->first[target] = moved_corners;
        moved_corners = next;
    }
    for (int i = 0; i < TERMS; i++) {
        quadric_of(state, target)[i] += quadric_of(state, removed)[i];
    }
    state->areas[target] += state->areas[removed];
    state->errors[target] = evaluate_quadric(quadric_of(state, target), point_of(state, target));
}

static decimation allocate(reel_arena *arena, int64_t n_verts, int64_t n_faces) {
    size_t verts = (size_t)n_verts, corners = 3 * (size_t)n_faces;
    return (decimation){
        .first = reel_allocate(arena, verts, sizeof(int32_t)),
        .next = reel_allocate(arena, corners, sizeof(int32_t)),
        .quadrics = reel_allocate(arena, verts, TERMS * sizeof(double)),
        .areas = reel_allocate(arena, verts, sizeof(double)),
        .errors = reel_allocate(arena, verts, sizeof(double)),
        .stamps = reel_allocate(arena, verts, sizeof(int32_t)),
        .heap = reel_allocate(arena, verts, sizeof(int32_t)),
        .places = reel_allocate(arena, verts, sizeof(int32_t)),
        .targets = reel_allocate(arena, verts, sizeof(int32_t)),
        .costs = reel_allocate(arena, verts, sizeof(double)),
    };
}

/* List the corners of each vertex; returns the first face with an invalid vertex, or NONE. */
static int32_t list_corners(decimation *state, int32_t n_verts, int32_t n_faces) {
    for (int32_t vertex = 0; vertex < n_verts; vertex++) {
        state->first[vertex] = NONE;
    }
    for (int32_t corner = 3 * n_faces; corner-- > 0;) {
        int32_t vertex = state->faces[corner];
        if (vertex < 0 || vertex >= n_verts) {
            return corner / 3;
        }
        state->next[corner] = state->first[vertex];
        state->first[vertex] = corner;
    }
    return NONE;
}

/* Collapse vertices, the cheapest first, while the sum of the costs is within the budget. */
static void collapse_all(decimation *state, double budget) {
    vertex_ring ring;
    while (state->n_heap && state->costs[state->heap[0]] <= budget) {
        int32_t vertex = state->heap[0], target = state->targets[vertex];
        double cost = state->costs[vertex];
        update_collapse(state, vertex); /* the neighbors of its target may have changed */
        if (state->targets[vertex] != target || state->costs[vertex] != cost) {
            continue;
        }
        heap_remove(state, vertex);
        collapse(state, vertex);
        budget -= cost;
        find_ring(state, target, &ring);
        update_collapse(state, target);
        for (int32_t i = 0; i < ring.n; i++) {
            update_collapse(state, ring.vertices[i]);
        }
    }
}

/* Move the remaining faces and their wedges to the front; returns their number. */
static int64_t compact_faces(int32_t *faces, int32_t *wedges, int64_t n_faces) {
    int64_t n_remaining = 0;
    for (int64_t face = 0; face < n_faces; face++) {
        if (faces[3 * face] != NONE) {
            for (int k = 0; k < 3; k++) {
                faces[3 * n_remaining + k] = faces[3 * face + k];
                wedges[3 * n_remaining + k] = wedges[3 * face + k];
            }
            n_remaining++;
        }
    }
    return n_remaining;
}

size_t reel_decimate_memory(int64_t n_verts, int64_t n_faces) {
    reel_arena arena = REEL_MEASURE;
    allocate(&arena, n_verts, n_faces);
    return arena.used;
}

int64_t reel_decimate(void *memory, size_t memory_size, const double *vertices,
                      const double *weights, int64_t n_verts, int32_t *faces, int32_t *wedges,
                      int64_t n_faces, double max_rms, double max_distance, double max_length) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    decimation state = allocate(&arena, n_verts, n_faces);
    if (arena.failed || n_faces > INT32_MAX / 3 || n_verts > INT32_MAX) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    state.points = vertices;
    state.weights = weights;
    state.faces = faces;
    state.wedges = wedges;
    state.max_square = max_distance * max_distance;
    state.max_length = max_length * max_length;
    reel_zero(state.quadrics, (size_t)n_verts * TERMS * sizeof *state.quadrics);
    reel_zero(state.areas, (size_t)n_verts * sizeof *state.areas);
    reel_zero(state.stamps, (size_t)n_verts * sizeof *state.stamps);
    int32_t invalid_face = list_corners(&state, (int32_t)n_verts, (int32_t)n_faces);
    if (invalid_face != NONE) {
        return reel_failure(REEL_INVALID, (uint64_t)invalid_face);
    }
    double budget = max_rms * max_rms * set_quadrics(&state, (int32_t)n_verts, (int32_t)n_faces);
    for (int32_t vertex = 0; vertex < n_verts; vertex++) {
        state.places[vertex] = NONE;
        update_collapse(&state, vertex);
    }
    collapse_all(&state, budget);
    return compact_faces(faces, wedges, n_faces);
}
