/* Fuzz target: one call for many points finds the same closest points as one call per point. */

#include "fuzz.h"

typedef struct {
    double *distances, *points, *weights;
    int32_t *faces;
} closest_points;

static closest_points find_closest(const void *tree, int64_t n_faces, const double *points,
                                   const double *directions, double reach, int64_t n) {
    closest_points closest = {
        fuzz_allocate(n, sizeof(double)), fuzz_allocate(3 * n, sizeof(double)),
        fuzz_allocate(3 * n, sizeof(double)), fuzz_allocate(n, sizeof(int32_t))};
    FUZZ_CHECK(reel_closest(FUZZ_MEMORY(reel_closest_memory(n)), tree, n_faces, points,
                            directions, reach, n, closest.distances, closest.faces,
                            closest.points, closest.weights) == n);
    return closest;
}

/* Random points, with small integer coordinates on request: then many distances are equal. */
static double *make_points(int64_t n, bool is_small) {
    double *points = fuzz_allocate(3 * n, sizeof *points);
    for (int64_t i = 0; i < 3 * n; i++) {
        points[i] = is_small ? (double)fuzz_below(4) : fuzz_float();
    }
    return points;
}

void fuzz_closest(void) {
    fuzz_mesh mesh = fuzz_make_mesh(400);
    bool is_small = fuzz_one_in(2);
    const double *vertices = make_points(mesh.n_verts, is_small);
    void *tree = fuzz_allocate((int64_t)reel_triangle_tree_bytes(mesh.n_faces), 1);
    int64_t result = reel_triangle_tree(FUZZ_MEMORY(reel_triangle_tree_memory(mesh.n_faces)),
                                        vertices, mesh.n_verts, mesh.faces, mesh.n_faces, tree);
    if (mesh.n_faces == 0) {
        fuzz_check_code(result);
        return;
    }
    FUZZ_CHECK(result == mesh.n_faces);
    int64_t n = fuzz_below(60);
    const double *points = make_points(n, is_small);
    const double *directions = fuzz_one_in(2) ? make_points(n, is_small) : NULL;
    double reach = fuzz_one_in(2) ? (double)fuzz_below(4) : __builtin_inf();
    closest_points closest = find_closest(tree, mesh.n_faces, points, directions, reach, n);
    fuzz_hash(closest.faces, n, sizeof *closest.faces);
    fuzz_hash_doubles(closest.distances, n);
    fuzz_hash_doubles(closest.points, 3 * n);
    fuzz_hash_doubles(closest.weights, 3 * n);
    for (int64_t i = 0; i < n && is_small; i++) {
        closest_points single = find_closest(tree, mesh.n_faces, points + 3 * i,
                                             directions ? directions + 3 * i : NULL, reach, 1);
        FUZZ_CHECK(*single.faces == closest.faces[i] && *single.distances == closest.distances[i]);
        FUZZ_CHECK(*single.faces >= -1 && *single.faces < mesh.n_faces);
        FUZZ_CHECK(*single.faces >= 0 || directions || reach < __builtin_inf());
    }
}
