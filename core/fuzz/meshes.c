/* Random meshes: grids, fans, closed surfaces, and arbitrary faces. */

#include "fuzz.h"

int32_t *fuzz_permutation(int64_t n) {
    int32_t *result = fuzz_allocate(n, sizeof *result);
    for (int64_t i = 0; i < n; i++) {
        int64_t j = fuzz_below(i + 1);
        result[i] = result[j];
        result[j] = (int32_t)i;
    }
    return result;
}

/* Pair the half-edges at random, and leave some unpaired. */
void fuzz_shuffle_twins(fuzz_mesh *mesh) {
    int64_t n_half_edges = 3 * mesh->n_faces, i = 0;
    const int32_t *order = fuzz_permutation(n_half_edges);
    for (; i + 1 < n_half_edges; i += 2) {
        bool is_unpaired = fuzz_one_in(6);
        mesh->twins[order[i]] = order[is_unpaired ? i : i + 1];
        mesh->twins[order[i + 1]] = order[is_unpaired ? i + 1 : i];
    }
    if (i < n_half_edges) {
        mesh->twins[order[i]] = order[i];
    }
}

static void make_grid(fuzz_mesh *mesh, int64_t he) {
    int32_t *face = mesh->faces;
    for (int64_t i = 0; i + 1 < he; i++) {
        for (int64_t j = 0; j + 1 < he; j++) {
            int32_t corner = (int32_t)(i * he + j), below = corner + (int32_t)he;
            int32_t corners[6] = {corner, below, corner + 1, corner + 1, below, below + 1};
            for (int k = 0; k < 6; k++) {
                *face++ = corners[k];
            }
        }
    }
    mesh->n_faces = (face - mesh->faces) / 3;
}

/* A fan around a hub, or a closed double fan around two. */
static void make_fan(fuzz_mesh *mesh, bool is_closed) {
    int32_t n = (int32_t)mesh->n_verts, rim = n - 2, *face = mesh->faces;
    for (int32_t i = 0; i < rim; i++) {
        int32_t next = i + 1 < rim ? i + 1 : 0;
        int32_t corners[6] = {i, next, n - 2, next, i, n - 1};
        for (int k = 0; k < (is_closed ? 6 : 3); k++) {
            *face++ = corners[k];
        }
    }
    mesh->n_faces = (face - mesh->faces) / 3;
}

static void damage_mesh(fuzz_mesh *mesh) {
    for (int64_t i = 1 + fuzz_below(6); i > 0 && mesh->n_faces; i--) {
        int64_t index = fuzz_below(3 * mesh->n_faces);
        mesh->faces[index] = (int32_t)fuzz_below(mesh->n_verts);
    }
    if (fuzz_one_in(3)) { /* permute and rotate the faces */
        int32_t *faces = fuzz_copy(mesh->faces, 3 * mesh->n_faces, sizeof *faces);
        const int32_t *order = fuzz_permutation(mesh->n_faces);
        for (int64_t i = 0; i < 3 * mesh->n_faces; i++) {
            mesh->faces[i] = faces[3 * order[i / 3] + (i + order[i / 3]) % 3];
        }
    }
}

fuzz_mesh fuzz_make_mesh(int64_t max_verts) {
    fuzz_mesh mesh = {.n_verts = fuzz_below(max_verts)};
    int64_t kind = fuzz_below(4), he = 0;
    while ((he + 1) * (he + 1) <= mesh.n_verts) {
        he++;
    }
    mesh.n_faces = mesh.n_verts ? fuzz_below(2 * mesh.n_verts) : 0;
    int32_t *faces = fuzz_allocate(6 * mesh.n_verts, sizeof *faces);
    mesh.faces = faces;
    if (kind == 0) {
        make_grid(&mesh, he);
    } else if (kind == 1 && mesh.n_verts > 4) {
        make_fan(&mesh, fuzz_one_in(2));
    } else {
        int64_t span = 2 + fuzz_below(mesh.n_verts);
        for (int64_t i = 0; i < 3 * mesh.n_faces; i++) {
            int64_t base = i % 3 ? mesh.faces[i - i % 3] : fuzz_below(mesh.n_verts);
            mesh.faces[i] = (int32_t)((base + fuzz_below(span)) % mesh.n_verts);
        }
    }
    if (fuzz_one_in(2)) {
        damage_mesh(&mesh);
    }
    mesh.faces = fuzz_copy(faces, 3 * mesh.n_faces, sizeof *faces);
    mesh.twins = fuzz_allocate(3 * mesh.n_faces, sizeof *mesh.twins);
    FUZZ_CHECK(reel_twins(FUZZ_MEMORY(reel_twins_memory(mesh.n_verts, mesh.n_faces)), mesh.faces,
                          mesh.n_faces, mesh.n_verts, mesh.twins) == mesh.n_faces);
    return mesh;
}
