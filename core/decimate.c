/* Decimation of triangle meshes by edge collapses, the cheapest first. Costs are those of quadrics
   (M. Garland, P. S. Heckbert, "Surface Simplification Using Quadric Error Metrics", 1997). A vertex
   moves to a neighbor, so that the vertices that remain keep their attributes. */

#include "base.h"

#define NONE (-1)
#define TERMS 10                 /* of a quadric */
#define MAX_NEIGHBORS 48         /* of a vertex that can be removed */
#define MIN_COSINE 0.3           /* between the normals of a face before and after a collapse */
#define MIN_HEIGHT 0.05          /* of a face after it, in longest sides, if it was higher before */

typedef struct {
    const double *points;
    int32_t *faces, *wedges; /* of three corners; the first vertex of a removed face is NONE */
    int32_t *first, *next;   /* corner of a vertex; the next corner of the same vertex */
    double *quadrics, *areas, *errors;
    int32_t *stamps, stamp;
    int32_t *heap, *places, n_heap; /* vertices by the cost of their best collapse */
    int32_t *targets;               /* the neighbor to which each would move */
    double *costs;
    double max_square, max_length; /* squared */
} decimation;

/* The neighbors of a vertex: with each, the number of common faces, whether the edge is a boundary
   or a seam between wedges, and the wedges of both vertices in the first face. */
typedef struct {
    int32_t n, n_features;
    bool is_fixed;
    int32_t vertices[MAX_NEIGHBORS], counts[MAX_NEIGHBORS];
    int32_t own[MAX_NEIGHBORS], other[MAX_NEIGHBORS];
    bool is_feature[MAX_NEIGHBORS];
} ring;

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

static const double *point_of(const decimation *of, int32_t vertex) {
    return of->points + 3 * (int64_t)vertex;
}

static void add_neighbor(ring *around, int32_t vertex, int32_t own, int32_t other) {
    int32_t i = 0;
    while (i < around->n && around->vertices[i] != vertex) {
        i++;
    }
    if (i == MAX_NEIGHBORS) {
        around->is_fixed = true;
    } else if (i == around->n) {
        around->vertices[i] = vertex;
        around->counts[i] = 1;
        around->own[i] = own;
        around->other[i] = other;
        around->is_feature[i] = true;
        around->n++;
    } else {
        around->counts[i]++;
        around->is_fixed |= around->counts[i] > 2;
        around->is_feature[i] = own != around->own[i] || other != around->other[i];
    }
}

/* The next corner of a vertex in a face that is left, from this one on. */
static int32_t corner_from(const decimation *of, int32_t corner) {
    while (corner != NONE && of->faces[corner / 3 * 3] == NONE) {
        corner = of->next[corner];
    }
    return corner;
}

#define EACH_CORNER(of, vertex, corner)                                   \
    for (int32_t corner = corner_from(of, (of)->first[vertex]); corner != NONE; \
         corner = corner_from(of, (of)->next[corner]))

static int32_t after(int32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }

static void find_ring(const decimation *of, int32_t vertex, ring *around) {
    around->n = around->n_features = 0;
    around->is_fixed = false;
    EACH_CORNER(of, vertex, corner) {
        for (int32_t at = after(corner); at != corner; at = after(at)) {
            around->is_fixed |= of->faces[at] == vertex;
            add_neighbor(around, of->faces[at], of->wedges[corner], of->wedges[at]);
        }
    }
    for (int32_t i = 0; i < around->n; i++) {
        around->n_features += around->is_feature[i];
    }
}

/* Squared distances times area, of a quadric at a point. */
static double error_at(const double *quadric, const double *p) {
    double x = p[0], y = p[1], z = p[2];
    double terms[TERMS] = {x * x, y * y, z * z, x * y, y * z, z * x, x, y, z, 1.0};
    double sum = 0.0;
    for (int i = 0; i < TERMS; i++) {
        sum += quadric[i] * terms[i];
    }
    return sum > 0 ? sum : 0.0;
}

static void add_plane(decimation *of, int32_t vertex, const double *normal, double offset,
                      double weight) {
    double a = normal[0], b = normal[1], c = normal[2], d = offset;
    double terms[TERMS] = {a * a,     b * b,     c * c,     2 * a * b, 2 * b * c,
                           2 * c * a, 2 * a * d, 2 * b * d, 2 * c * d, d * d};
    for (int i = 0; i < TERMS; i++) {
        of->quadrics[TERMS * (int64_t)vertex + i] += weight * terms[i];
    }
    of->areas[vertex] += weight;
}

/* Add the plane through the corners' points with a normal of any length. */
static void add_planes(decimation *of, const int32_t *vertices, int n, const double *normal,
                       double weight) {
    double length = __builtin_sqrt(dot(normal, normal)), direction[3];
    if (length > 0) {
        for (int i = 0; i < 3; i++) {
            direction[i] = normal[i] / length;
        }
        double offset = -dot(direction, point_of(of, vertices[0]));
        for (int i = 0; i < n; i++) {
            add_plane(of, vertices[i], direction, offset, weight);
        }
    }
}

/* Set the quadrics: planes of faces, and those through boundaries and seams, across the faces.
   Returns the area of all faces. */
static double set_quadrics(decimation *of, int32_t n_verts, int32_t n_faces) {
    double area = 0.0, normal[3], across[3], side[3];
    ring around;
    for (int32_t face = 0; face < n_faces; face++) {
        const int32_t *corners = of->faces + 3 * (int64_t)face;
        normal_of(point_of(of, corners[0]), point_of(of, corners[1]), point_of(of, corners[2]),
                  normal);
        double part = __builtin_sqrt(dot(normal, normal)) / 2;
        add_planes(of, corners, 3, normal, part / 3);
        area += part;
    }
    for (int32_t vertex = 0; vertex < n_verts; vertex++) {
        find_ring(of, vertex, &around);
        EACH_CORNER(of, vertex, corner) { /* of each side the face that is on its left */
            int32_t end = of->faces[after(corner)], i = 0;
            while (i < around.n && around.vertices[i] != end) {
                i++;
            }
            if (i < around.n && around.is_feature[i]) {
                int32_t last = of->faces[after(after(corner))], ends[2] = {vertex, end};
                normal_of(point_of(of, vertex), point_of(of, end), point_of(of, last), normal);
                subtract(point_of(of, end), point_of(of, vertex), side);
                cross(side, normal, across);
                add_planes(of, ends, 2, across, dot(side, side) / 2);
            }
        }
    }
    for (int32_t vertex = 0; vertex < n_verts; vertex++) {
        of->errors[vertex] = error_at(of->quadrics + TERMS * (int64_t)vertex, point_of(of, vertex));
    }
    return area;
}

/* The wedge that replaces one of a removed vertex, or NONE. */
static int32_t new_wedge(const decimation *of, int32_t removed, int32_t kept, int32_t wedge) {
    int32_t result = NONE;
    EACH_CORNER(of, removed, corner) {
        int32_t at = after(corner);
        at = of->faces[at] == kept ? at : after(at);
        if (of->faces[at] == kept && of->wedges[corner] == wedge) {
            if (result != NONE && result != of->wedges[at]) {
                return NONE;
            }
            result = of->wedges[at];
        }
    }
    return result;
}

/* Whether a triangle faces as before, and is no sliver unless it was, and has no long sides unless
   it had, if its corner moves. */
static bool is_similar(const decimation *of, const double *corner, const double *new_corner,
                       const double *a, const double *b) {
    double before[3], now[3], sides[3][3];
    normal_of(corner, a, b, before);
    normal_of(new_corner, a, b, now);
    double cosine = dot(before, now), was = dot(before, before), is = dot(now, now);
    if (!(cosine > 0 && cosine * cosine > MIN_COSINE * MIN_COSINE * was * is)) {
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
    if (longest[1] > of->max_length && longest[1] > longest[0]) {
        return false;
    }
    double height = is / (longest[1] * longest[1]), height_before = was / (longest[0] * longest[0]);
    return height >= MIN_HEIGHT * MIN_HEIGHT || height >= height_before;
}

/* Whether a face of these vertices exists. */
static bool has_face(const decimation *of, int32_t vertex, int32_t a, int32_t b) {
    EACH_CORNER(of, vertex, corner) {
        int32_t first = of->faces[after(corner)], second = of->faces[after(after(corner))];
        if ((first == a && second == b) || (first == b && second == a)) {
            return true;
        }
    }
    return false;
}

/* Whether a collapse keeps the topology, the normals, and the wedges. */
static bool is_valid(decimation *of, int32_t removed, const ring *around, int32_t i) {
    int32_t kept = around->vertices[i], n_common = 0;
    int32_t mark = of->stamp += 2; /* of neighbors; those of both have the next number */
    for (int32_t k = 0; k < around->n; k++) {
        of->stamps[around->vertices[k]] = mark;
    }
    EACH_CORNER(of, kept, corner) {
        for (int32_t at = after(corner); at != corner; at = after(at)) {
            if (of->stamps[of->faces[at]] == mark) {
                of->stamps[of->faces[at]]++;
                n_common++;
            }
        }
    }
    if (n_common != around->counts[i]) {
        return false;
    }
    EACH_CORNER(of, removed, corner) {
        int32_t a = of->faces[after(corner)], b = of->faces[after(after(corner))];
        if (a == kept || b == kept) {
            continue;
        }
        bool are_common = of->stamps[a] == mark + 1 && of->stamps[b] == mark + 1;
        if ((are_common && has_face(of, kept, a, b)) ||
            new_wedge(of, removed, kept, of->wedges[corner]) == NONE ||
            !is_similar(of, point_of(of, removed), point_of(of, kept), point_of(of, a),
                        point_of(of, b))) {
            return false;
        }
    }
    return true;
}

/* Find the cheapest collapse of a vertex; its target is NONE if there is none. */
static void find_best(decimation *of, int32_t vertex) {
    ring around;
    find_ring(of, vertex, &around);
    of->targets[vertex] = NONE;
    if (around.is_fixed || (around.n_features != 0 && around.n_features != 2)) {
        return;
    }
    const double *own = of->quadrics + TERMS * (int64_t)vertex;
    for (int32_t i = 0; i < around.n; i++) {
        int32_t kept = around.vertices[i];
        const double *other = of->quadrics + TERMS * (int64_t)kept, *at = point_of(of, kept);
        double error = error_at(own, at) + error_at(other, at);
        double cost = error - of->errors[vertex] - of->errors[kept];
        bool is_near = error <= of->max_square * (of->areas[vertex] + of->areas[kept]);
        bool is_cheaper = of->targets[vertex] == NONE || cost < of->costs[vertex];
        if ((around.n_features == 0 || around.is_feature[i]) && is_near && is_cheaper &&
            is_valid(of, vertex, &around, i)) {
            of->targets[vertex] = kept;
            of->costs[vertex] = cost > 0 ? cost : 0.0;
        }
    }
}

/* Whether the collapse of one vertex comes before that of another. */
static bool precedes(const decimation *of, int32_t a, int32_t b) {
    return of->costs[a] < of->costs[b] || (of->costs[a] == of->costs[b] && a < b);
}

static void put(decimation *of, int32_t place, int32_t vertex) {
    of->heap[place] = vertex;
    of->places[vertex] = place;
}

/* Move the vertex at a place of the heap to where it belongs. */
static void settle(decimation *of, int32_t place) {
    int32_t vertex = of->heap[place];
    while (place > 0 && precedes(of, vertex, of->heap[(place - 1) / 2])) {
        put(of, place, of->heap[(place - 1) / 2]);
        place = (place - 1) / 2;
    }
    for (int32_t child; (child = 2 * place + 1) < of->n_heap; place = child) {
        if (child + 1 < of->n_heap && precedes(of, of->heap[child + 1], of->heap[child])) {
            child++;
        }
        if (!precedes(of, of->heap[child], vertex)) {
            break;
        }
        put(of, place, of->heap[child]);
    }
    put(of, place, vertex);
}

/* Take a vertex out of the heap, if it is in it. */
static void take(decimation *of, int32_t vertex) {
    int32_t place = of->places[vertex], last = of->n_heap - 1;
    if (place != NONE) {
        of->places[vertex] = NONE;
        of->n_heap = last;
        if (place < last) {
            put(of, place, of->heap[last]);
            settle(of, place);
        }
    }
}

/* Find the cheapest collapse of a vertex again. */
static void update(decimation *of, int32_t vertex) {
    take(of, vertex);
    find_best(of, vertex);
    if (of->targets[vertex] != NONE) {
        put(of, of->n_heap++, vertex);
        settle(of, of->n_heap - 1);
    }
}

static void collapse(decimation *of, int32_t removed) {
    int32_t kept = of->targets[removed], moved = NONE;
    double *quadric = of->quadrics + TERMS * (int64_t)kept;
    EACH_CORNER(of, removed, corner) { /* wedges first: `new_wedge` needs the faces that vanish */
        int32_t wedge = new_wedge(of, removed, kept, of->wedges[corner]);
        if (of->faces[after(corner)] != kept && of->faces[after(after(corner))] != kept) {
            of->wedges[corner] = wedge;
        }
    }
    for (int32_t corner = corner_from(of, of->first[removed]), next; corner != NONE;
         corner = next) {
        next = corner_from(of, of->next[corner]);
        if (of->faces[after(corner)] == kept || of->faces[after(after(corner))] == kept) {
            of->faces[corner / 3 * 3] = NONE;
        } else {
            of->faces[corner] = kept;
            of->next[corner] = moved;
            moved = corner;
        }
    }
    of->first[removed] = NONE;
    while (moved != NONE) {
        int32_t next = of->next[moved];
        of->next[moved] = of->first[kept];
        of->first[kept] = moved;
        moved = next;
    }
    for (int i = 0; i < TERMS; i++) {
        quadric[i] += of->quadrics[TERMS * (int64_t)removed + i];
    }
    of->areas[kept] += of->areas[removed];
    of->errors[kept] = error_at(quadric, point_of(of, kept));
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

size_t reel_decimate_memory(int64_t n_verts, int64_t n_faces) {
    reel_arena arena = REEL_MEASURE;
    allocate(&arena, n_verts, n_faces);
    return arena.used;
}

int64_t reel_decimate(void *memory, size_t memory_size, const double *vertices, int64_t n_verts,
                      int32_t *faces, int32_t *wedges, int64_t n_faces, double max_rms,
                      double max_distance, double max_length) {
    reel_arena arena = reel_arena_of(memory, memory_size);
    decimation of = allocate(&arena, n_verts, n_faces);
    if (arena.failed || n_faces > INT32_MAX / 3 || n_verts > INT32_MAX) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    of.points = vertices;
    of.faces = faces;
    of.wedges = wedges;
    of.max_square = max_distance * max_distance;
    of.max_length = max_length * max_length;
    reel_zero(of.quadrics, (size_t)n_verts * TERMS * sizeof *of.quadrics);
    reel_zero(of.areas, (size_t)n_verts * sizeof *of.areas);
    reel_zero(of.stamps, (size_t)n_verts * sizeof *of.stamps);
    for (int32_t vertex = 0; vertex < n_verts; vertex++) {
        of.first[vertex] = of.places[vertex] = NONE;
    }
    for (int32_t corner = 3 * (int32_t)n_faces; corner-- > 0;) {
        int32_t vertex = faces[corner];
        if (vertex < 0 || vertex >= n_verts) {
            return reel_failure(REEL_INVALID, (uint64_t)corner / 3);
        }
        of.next[corner] = of.first[vertex];
        of.first[vertex] = corner;
    }
    double budget = max_rms * max_rms * set_quadrics(&of, (int32_t)n_verts, (int32_t)n_faces);
    for (int32_t vertex = 0; vertex < n_verts; vertex++) {
        update(&of, vertex);
    }
    ring around;
    while (of.n_heap && of.costs[of.heap[0]] <= budget) {
        int32_t vertex = of.heap[0], kept = of.targets[vertex];
        double cost = of.costs[vertex];
        update(&of, vertex); /* its neighbor may have other neighbors by now */
        if (of.targets[vertex] != kept || of.costs[vertex] != cost) {
            continue;
        }
        take(&of, vertex);
        collapse(&of, vertex);
        budget -= cost;
        find_ring(&of, kept, &around);
        update(&of, kept);
        for (int32_t i = 0; i < around.n; i++) {
            update(&of, around.vertices[i]);
        }
    }
    int64_t n_left = 0;
    for (int64_t face = 0; face < n_faces; face++) {
        if (faces[3 * face] != NONE) {
            for (int k = 0; k < 3; k++) {
                faces[3 * n_left + k] = faces[3 * face + k];
                wedges[3 * n_left + k] = wedges[3 * face + k];
            }
            n_left++;
        }
    }
    return n_left;
}
