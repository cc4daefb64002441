/* Fuzz target of closest points: one call for many points agrees with a call for each. */

#include "fuzz.h"

typedef struct {
    double *distances, *points, *weights;
    int32_t *faces;
} fuzz_found;

static fuzz_found find(const void *tree, int64_t n_faces, const double *points,
                       const double *directions, double reach, int64_t n) {
    fuzz_found found = {fuzz_allocate(n, sizeof(double)), fuzz_allocate(3 * n, sizeof(double)),
                        fuzz_allocate(3 * n, sizeof(double)), fuzz_allocate(n, sizeof(int32_t))};
    FUZZ_CHECK(reel_closest(FUZZ_MEMORY(reel_closest_memory(n)), tree, n_faces, points,
                            directions, reach, n, found.distances, found.faces, found.points,
                            found.weights) == n);
    return found;
}

/* Coordinates: small integers, so that many distances are equal, or arbitrary numbers. */
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
    int64_t built = reel_triangle_tree(FUZZ_MEMORY(reel_triangle_tree_memory(mesh.n_faces)),
                                       vertices, mesh.n_verts, mesh.faces, mesh.n_faces, tree);
    if (mesh.n_faces == 0) {
        fuzz_check_code(built);
        return;
    }
    FUZZ_CHECK(built == mesh.n_faces);
    int64_t n = fuzz_below(60);
    const double *points = make_points(n, is_small);
    const double *directions = fuzz_one_in(2) ? make_points(n, is_small) : NULL;
    double reach = fuzz_one_in(2) ? (double)fuzz_below(4) : __builtin_inf();
    fuzz_found found = find(tree, mesh.n_faces, points, directions, reach, n);
    fuzz_hash(found.faces, n, sizeof *found.faces);
    fuzz_hash_doubles(found.distances, n);
    fuzz_hash_doubles(found.points, 3 * n);
    fuzz_hash_doubles(found.weights, 3 * n);
    for (int64_t i = 0; i < n && is_small; i++) {
        fuzz_found alone = find(tree, mesh.n_faces, points + 3 * i,
                                directions ? directions + 3 * i : NULL, reach, 1);
        FUZZ_CHECK(*alone.faces == found.faces[i] && *alone.distances == found.distances[i]);
        FUZZ_CHECK(*alone.faces >= -1 && *alone.faces < mesh.n_faces);
        FUZZ_CHECK(*alone.faces >= 0 || directions || reach < __builtin_inf());
    }
}
