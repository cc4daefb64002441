/* Fuzz targets: connectivity round trips and damage; references of corners; hierarchies of
   arbitrary meshes, and fields on them. */

#include "fuzz.h"

#include <string.h>

/* ---- hierarchy and prediction ---- */

typedef struct {
    int32_t *order, *level_starts, *level_resolutions, *stencil, *contexts;
    int64_t *smooth_starts;
    uint8_t *hops;
    float *smooth, *finest_smooth;
    int64_t n_verts, n_levels, size;
} levels;

static int64_t find_neighbors(const fuzz_mesh *mesh, int32_t *starts, int32_t *near) {
    size_t size = reel_adjacency_memory(mesh->n_verts, mesh->n_faces);
    int64_t n_near = reel_adjacency(fuzz_allocate((int64_t)size, 1), size, mesh->faces,
                                    mesh->n_faces, mesh->n_verts, starts, near);
    fuzz_check_code(n_near);
    return n_near;
}

static levels find_levels(const fuzz_mesh *mesh) {
    int64_t n = mesh->n_verts, size = 1 + fuzz_below(REEL_MAX_STENCIL);
    int32_t *starts = fuzz_allocate(n + 1, sizeof *starts);
    int32_t *near = fuzz_allocate(6 * mesh->n_faces, sizeof *near);
    int64_t n_near = find_neighbors(mesh, starts, near);
    FUZZ_CHECK(n_near >= 0 && starts[n] == n_near);
    near = fuzz_copy(near, n_near, sizeof *near);
    levels all = {.n_verts = n, .size = size};
    all.order = fuzz_allocate(n, sizeof(int32_t));
    all.level_starts = fuzz_allocate(REEL_MAX_LEVELS + 1, sizeof(int32_t));
    all.level_resolutions = fuzz_allocate(REEL_MAX_LEVELS, sizeof(int32_t));
    all.smooth_starts = fuzz_allocate(REEL_MAX_LEVELS, sizeof(int64_t));
    all.stencil = fuzz_allocate(n * size, sizeof(int32_t));
    all.hops = fuzz_allocate(n * size, 1);
    all.contexts = fuzz_allocate(n * REEL_CONTEXT_NEIGHBORS, sizeof(int32_t));
    all.smooth = fuzz_allocate(REEL_SMOOTH_ROWS * n, REEL_SMOOTH_FIELDS * sizeof(float));
    size_t capacity = reel_hierarchy_memory(n, n_near);
    all.n_levels =
        reel_hierarchy(fuzz_allocate((int64_t)capacity, 1), capacity, starts, near, n, size,
                       all.order, all.level_starts, all.level_resolutions, all.smooth_starts,
                       all.stencil, all.hops, all.contexts, all.smooth, fuzz_below(2));
    FUZZ_CHECK(all.n_levels >= 0 && all.n_levels <= REEL_MAX_LEVELS);
    all.finest_smooth = fuzz_allocate(n, REEL_SMOOTH_FIELDS * sizeof(float));
    capacity = reel_finest_smooth_memory(n, n_near);
    FUZZ_CHECK(reel_finest_smooth(fuzz_allocate((int64_t)capacity, 1), capacity, starts, near, n,
                                  all.order, all.finest_smooth) == n);
    return all;
}

/* Check that levels cover all vertices, and that stencils and contexts refer to earlier ones. */
static void check_levels(const levels *all) {
    FUZZ_CHECK(all->level_starts[all->n_levels] == all->n_verts);
    for (int64_t level = 0; level < all->n_levels; level++) {
        int32_t begin = all->level_starts[level], end = all->level_starts[level + 1];
        FUZZ_CHECK(begin <= end);
        for (int32_t v = begin; v < end; v++) {
            FUZZ_CHECK(level == 0 || all->stencil[v * all->size] >= 0);
            for (int64_t j = 0; j < all->size; j++) {
                FUZZ_CHECK(all->stencil[v * all->size + j] < begin || !begin);
            }
            for (int j = 0; j < REEL_CONTEXT_NEIGHBORS; j++) {
                FUZZ_CHECK(all->contexts[v * REEL_CONTEXT_NEIGHBORS + j] < v);
            }
        }
    }
    fuzz_hash(all->order, all->n_verts, sizeof *all->order);
    fuzz_hash(all->stencil, all->n_verts * all->size, sizeof *all->stencil);
}

static reel_mesh mesh_of(const levels *all) {
    return (reel_mesh){all->n_verts,       all->n_levels, all->size, all->level_starts,
                       all->smooth_starts, all->stencil,  all->hops, all->smooth,
                       all->finest_smooth};
}

static double *any_floats(int64_t n) {
    double *result = fuzz_allocate(n, sizeof *result);
    for (int64_t i = 0; i < n; i++) {
        result[i] = fuzz_float();
    }
    return result;
}

/* Decode the vertices in two ranges that may split a level. */
static int64_t decode_values(const reel_mesh *mesh, reel_fields *fields) {
    int64_t middle = fuzz_below(mesh->n_verts + 1);
    int64_t first = reel_predict_decode(mesh, fields, 0, middle);
    int64_t second = reel_predict_decode(mesh, fields, middle, mesh->n_verts);
    return first ? first : second;
}

/* Check that encoded values are decoded bit for bit, or rejected. */
static void encode_fields(const reel_mesh *mesh, reel_fields *fields) {
    int64_t n_values = fields->n_verts * fields->n_modes;
    reel_quantizer quantizer = {.first_shaped = fuzz_below(mesh->n_levels + 1)};
    quantizer.gain = (double)fuzz_below(3) / 2.0;
    quantizer.rd_lambda = (double)fuzz_below(3) / 8.0;
    quantizer.targets = any_floats(n_values);
    double *counts = fuzz_allocate(2 * fields->n_modes, sizeof *counts);
    memset(counts, 0, 2 * (size_t)fields->n_modes * sizeof *counts);
    quantizer.counts = counts;
    quantizer.zones = fuzz_allocate(fields->n_modes, sizeof(double));
    int64_t result = reel_predict_encode(mesh, fields, &quantizer, 0, mesh->n_verts);
    fuzz_check_code(result);
    if (result < 0) {
        return;
    }
    double *values = fields->values;
    fields->values = fuzz_allocate(n_values, sizeof(double));
    FUZZ_CHECK(decode_values(mesh, fields) == 0);
    FUZZ_CHECK(!memcmp(values, fields->values, (size_t)n_values * sizeof *values));
}

static void predict_on(const levels *all) {
    reel_mesh mesh = mesh_of(all);
    reel_fields fields = {.n_verts = all->n_verts, .n_modes = fuzz_below(5)};
    int64_t n_values = fields.n_verts * fields.n_modes;
    fields.n_learned = fuzz_below(fields.n_modes + 2);
    fields.n_key = fuzz_below(3);
    fields.residuals = fuzz_allocate(n_values, sizeof(int32_t));
    fields.values = fuzz_allocate(n_values, sizeof(double));
    fields.key = fields.n_key ? any_floats(fields.n_key * fields.n_verts) : NULL;
    for (int64_t i = 0; i < n_values; i++) {
        fields.residuals[i] = fuzz_integer();
    }
    FUZZ_CHECK(decode_values(&mesh, &fields) == 0);
    fuzz_hash_doubles(fields.values, n_values);
    encode_fields(&mesh, &fields);
}

void fuzz_hierarchy(void) {
    fuzz_mesh mesh = fuzz_make_mesh(fuzz_one_in(8) ? 400 : 60);
    if (mesh.n_faces && fuzz_one_in(16)) { /* an invalid vertex */
        int64_t place = fuzz_below(3 * mesh.n_faces);
        mesh.faces[place] = fuzz_one_in(2) ? -1 : (int32_t)mesh.n_verts;
        int32_t *starts = fuzz_allocate(mesh.n_verts + 1, sizeof *starts);
        int32_t *near = fuzz_allocate(6 * mesh.n_faces, sizeof *near);
        FUZZ_CHECK(find_neighbors(&mesh, starts, near) < 0);
        return;
    }
    levels all = find_levels(&mesh);
    check_levels(&all);
    predict_on(&all);
}

/* ---- connectivity ---- */

static int64_t decode_faces(fuzz_bytes from, fuzz_mesh *mesh) {
    size_t size = reel_connectivity_decode_memory(mesh->n_verts, mesh->n_faces);
    mesh->faces = fuzz_allocate(3 * mesh->n_faces, sizeof *mesh->faces);
    mesh->twins = fuzz_allocate(3 * mesh->n_faces, sizeof *mesh->twins);
    int64_t result = reel_connectivity_decode(fuzz_allocate((int64_t)size, 1), size, from.bytes,
                                              from.size, mesh->n_verts, mesh->n_faces, mesh->faces,
                                              mesh->twins);
    fuzz_check_code(result);
    return result;
}

static fuzz_bytes encode_faces(const fuzz_mesh *mesh, bool listed, int32_t *faces, int32_t *twins,
                               int32_t *given) {
    int64_t capacity = 96 * mesh->n_faces + 1024;
    size_t size = reel_connectivity_encode_memory(mesh->n_verts, mesh->n_faces);
    uint8_t *out = fuzz_allocate(capacity, 1);
    int64_t result =
        reel_connectivity_encode(fuzz_allocate((int64_t)size, 1), size, mesh->faces, mesh->n_faces,
                                 mesh->n_verts, listed, faces, twins, given, out, (size_t)capacity);
    return fuzz_written(out, result);
}

/* Check that twins join the ends of the same edge. */
static void check_twins(const fuzz_mesh *mesh) {
    for (int64_t side = 0; side < 3 * mesh->n_faces; side++) {
        int64_t twin = mesh->twins[side];
        FUZZ_CHECK(twin >= 0 && twin < 3 * mesh->n_faces && mesh->twins[twin] == side);
        int64_t after = side % 3 == 2 ? side - 2 : side + 1;
        int64_t other = twin % 3 == 2 ? twin - 2 : twin + 1;
        int32_t a = mesh->faces[side], b = mesh->faces[after];
        int32_t c = mesh->faces[twin], d = mesh->faces[other];
        FUZZ_CHECK((a == c && b == d) || (a == d && b == c));
    }
}

/* Check that a mesh from damaged bytes is valid, and survives a round trip. */
static void check_mesh(const fuzz_mesh *mesh) {
    for (int64_t i = 0; i < 3 * mesh->n_faces; i++) {
        FUZZ_CHECK(mesh->faces[i] >= 0 && mesh->faces[i] < mesh->n_verts);
    }
    size_t n_sides = 3 * (size_t)mesh->n_faces;
    int32_t *faces = fuzz_allocate((int64_t)n_sides, sizeof *faces);
    int32_t *twins = fuzz_allocate((int64_t)n_sides, sizeof *twins);
    int32_t *given = fuzz_allocate(mesh->n_verts, sizeof *given);
    check_twins(mesh);
    fuzz_bytes bytes = encode_faces(mesh, fuzz_one_in(4), faces, twins, given);
    fuzz_mesh result = *mesh;
    FUZZ_CHECK(decode_faces(bytes, &result) == (int64_t)bytes.size);
    FUZZ_CHECK(!memcmp(result.faces, faces, n_sides * sizeof *faces));
    FUZZ_CHECK(!memcmp(result.twins, twins, n_sides * sizeof *twins));
    fuzz_hash(faces, 3 * mesh->n_faces, sizeof *faces);
}

void fuzz_connectivity(void) {
    fuzz_mesh mesh = fuzz_make_mesh(60);
    int32_t *faces = fuzz_allocate(3 * mesh.n_faces, sizeof *faces);
    int32_t *twins = fuzz_allocate(3 * mesh.n_faces, sizeof *twins);
    int32_t *given = fuzz_allocate(mesh.n_verts, sizeof *given);
    fuzz_bytes bytes = encode_faces(&mesh, fuzz_one_in(6), faces, twins, given);
    fuzz_mesh result = mesh;
    FUZZ_CHECK(decode_faces(bytes, &result) == (int64_t)bytes.size);
    FUZZ_CHECK(!memcmp(result.faces, faces, 3 * (size_t)mesh.n_faces * sizeof *faces));
    for (int64_t v = 0; v < mesh.n_verts; v++) {
        FUZZ_CHECK(given[v] >= 0 && given[v] < mesh.n_verts);
    }
    for (int i = 0; i < 2; i++) {
        if (fuzz_one_in(3)) { /* wrong counts */
            result.n_verts = fuzz_below(2 * mesh.n_verts + 3);
            result.n_faces = fuzz_below(2 * mesh.n_faces + 3);
        }
        if (decode_faces(fuzz_mutate(bytes), &result) >= 0) {
            check_mesh(&result);
        }
    }
}

/* ---- references of corners ---- */

/* Merge triangles to fans at random; returns the number of their corners. */
static int64_t find_fans(int64_t n_triangles, int32_t *items) {
    int64_t n_items = 0;
    for (int64_t i = 0; i < n_triangles; i++) {
        bool is_first = !i || !fuzz_one_in(4);
        int32_t *item = items + 3 * i;
        item[0] = is_first ? (int32_t)n_items : item[-3];
        item[1] = is_first ? (int32_t)n_items + 1 : item[-1];
        n_items += is_first ? 3 : 1;
        item[2] = (int32_t)n_items - 1;
    }
    return n_items;
}

typedef struct {
    const fuzz_mesh *mesh;
    const int32_t *items;
    int64_t n_items, n_rows;
} corners;

static int32_t *decode_corners(const corners *all, const int32_t *codes, const int64_t *n_codes,
                               const int32_t *differences, int64_t n_explicit, int64_t *result) {
    const fuzz_mesh *mesh = all->mesh;
    size_t size = reel_corner_rows_memory(mesh->n_verts, all->n_items);
    int32_t *rows = fuzz_allocate(all->n_items, sizeof *rows);
    *result = reel_corner_rows(fuzz_allocate((int64_t)size, 1), size, mesh->faces, mesh->twins,
                               all->items, mesh->n_faces, mesh->n_verts, all->n_items, all->n_rows,
                               codes, n_codes, differences, n_explicit, rows);
    fuzz_check_code(*result);
    for (int64_t i = 0; *result >= 0 && i < all->n_items; i++) {
        FUZZ_CHECK(rows[i] >= 0 && rows[i] < all->n_rows);
    }
    return rows;
}

void fuzz_corner_rows(void) {
    fuzz_mesh mesh = fuzz_make_mesh(30);
    corners all = {.mesh = &mesh, .n_items = 3 * mesh.n_faces, .n_rows = 1 + fuzz_below(40)};
    if (fuzz_one_in(2)) {
        int32_t *items = fuzz_allocate(3 * mesh.n_faces, sizeof *items);
        all.n_items = find_fans(mesh.n_faces, items);
        all.items = items;
    }
    int64_t n = all.n_items, n_codes[REEL_CORNER_CONTEXTS] = {0}, n_explicit = 0, result;
    int32_t *rows = fuzz_allocate(n, sizeof *rows), *order = fuzz_allocate(n, sizeof *order);
    int32_t *codes = fuzz_allocate(n, sizeof *codes), *sorted = fuzz_allocate(n, sizeof *sorted);
    int32_t *differences = fuzz_allocate(n, sizeof *differences), last = 0;
    uint8_t *contexts = fuzz_allocate(n, 1);
    for (int64_t i = 0; i < n; i++) {
        rows[i] = (int32_t)fuzz_below(all.n_rows);
    }
    size_t size = reel_corner_rows_memory(mesh.n_verts, n);
    FUZZ_CHECK(reel_corner_codes(fuzz_allocate((int64_t)size, 1), size, mesh.faces, mesh.twins,
                                 all.items, mesh.n_faces, mesh.n_verts, n, rows, order, contexts,
                                 codes) == n);
    for (int64_t i = 0, context = 0; context < REEL_CORNER_CONTEXTS; context++) {
        for (int64_t k = 0; k < n; k++) {
            FUZZ_CHECK(contexts[k] < REEL_CORNER_CONTEXTS);
            if (contexts[k] == context) {
                sorted[i++] = codes[k];
                n_codes[context]++;
            }
        }
    }
    for (int64_t k = 0; k < n; k++) {
        if (codes[k] == 2) {
            differences[n_explicit++] = rows[order[k]] - last;
            last = rows[order[k]];
        }
    }
    int32_t *decoded = decode_corners(&all, sorted, n_codes, differences, n_explicit, &result);
    FUZZ_CHECK(result == n && !memcmp(decoded, rows, (size_t)n * sizeof *rows));
    for (int i = 0; n && i < 3; i++) {
        sorted[fuzz_below(n)] = fuzz_integer();
        decoded = decode_corners(&all, sorted, n_codes, differences, n_explicit, &result);
        fuzz_hash(decoded, result < 0 ? 0 : n, sizeof *decoded);
    }
}
