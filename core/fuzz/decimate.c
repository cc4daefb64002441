/* Decimation of arbitrary triangles. */

#include "fuzz.h"

void fuzz_decimate(void) {
    fuzz_mesh mesh = fuzz_make_mesh(60);
    int64_t n_verts = mesh.n_verts, n_faces = mesh.n_faces;
    double *vertices = fuzz_allocate(3 * n_verts, sizeof *vertices);
    double *weights = fuzz_allocate(n_verts, sizeof *weights);
    int32_t *wedges = fuzz_allocate(3 * n_faces, sizeof *wedges);
    int64_t n_coordinates = 1 + fuzz_below(20), n_charts = 1 + fuzz_below(3);
    bool is_on_grid = fuzz_one_in(2), is_irregular = fuzz_one_in(2);
    for (int64_t i = 0; i < 3 * n_verts; i++) {
        vertices[i] = is_on_grid ? (double)fuzz_below(n_coordinates) : fuzz_float();
    }
    for (int64_t i = 0; i < n_verts; i++) {
        weights[i] = is_on_grid ? 1.0 : fuzz_float();
    }
    int32_t *faces = mesh.faces;
    for (int64_t i = 0; i < 3 * n_faces; i++) {
        if (is_irregular && fuzz_one_in(8)) {
            faces[i] = (int32_t)fuzz_below(n_verts);
        }
        wedges[i] = (int32_t)(faces[i] + n_verts * fuzz_below(n_charts));
    }
    size_t size = reel_decimate_memory(n_verts, n_faces);
    int64_t n_left =
        reel_decimate(FUZZ_MEMORY(size), vertices, weights, n_verts, faces, wedges, n_faces,
                      (double)fuzz_below(1000), (double)fuzz_below(1000), 1e9);
    FUZZ_CHECK(n_left >= 0 && n_left <= n_faces);
    for (int64_t i = 0; i < 3 * n_left; i++) {
        FUZZ_CHECK(faces[i] >= 0 && faces[i] < n_verts && wedges[i] % n_verts == faces[i]);
    }
    fuzz_hash(faces, 3 * n_left, sizeof *faces);
    if (n_faces) {
        faces[fuzz_below(3 * n_faces)] = (int32_t)n_verts;
        n_left = reel_decimate(FUZZ_MEMORY(size), vertices, weights, n_verts, faces, wedges,
                               n_faces, 1.0, 1.0, 1.0);
        FUZZ_CHECK(n_left < 0);
    }
}
