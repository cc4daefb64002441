/* Fuzz targets: encoders, whose input the decoder must restore. streams.c reaches all other code of
   the decoder. */

#include "fuzz.h"

#include <string.h>

/* ---- integers and connectivity ---- */

static int64_t decode_integers(fuzz_bytes bytes, const int64_t *lengths, const int32_t *tables,
                               int64_t n_rows, int64_t n_tables, int32_t *values) {
    int64_t result = reel_integers_decode(FUZZ_MEMORY(reel_integers_memory(n_tables)), bytes.bytes,
                                          bytes.size, lengths, tables, n_rows, n_tables, values);
    fuzz_check_code(result);
    return result;
}

void fuzz_integers(void) {
    int64_t n_rows = 1 + fuzz_below(8), n_tables = 1 + fuzz_below(4), n = 0;
    int64_t *lengths = fuzz_allocate(n_rows, sizeof *lengths);
    int32_t *tables = fuzz_allocate(n_rows, sizeof *tables), shift = (int32_t)fuzz_below(8);
    for (int64_t i = 0; i < n_rows; i++) {
        lengths[i] = fuzz_below(20);
        tables[i] = (int32_t)fuzz_below(n_tables);
        n += lengths[i];
    }
    int32_t *values = fuzz_allocate(n, sizeof *values), *output = fuzz_allocate(n, sizeof *output);
    for (int64_t i = 0; i < n; i++) {
        values[i] = fuzz_integer() >> shift;
    }
    int64_t capacity = 16 * n + 16;
    uint8_t *out = fuzz_allocate(capacity, 1);
    int64_t size = reel_integers_encode(FUZZ_MEMORY(reel_integers_memory(n_tables)),
                                        fuzz_copy(values, n, sizeof *values), lengths, tables,
                                        n_rows, n_tables, out, (size_t)capacity);
    fuzz_bytes bytes = fuzz_output(out, size);
    FUZZ_CHECK(decode_integers(bytes, lengths, tables, n_rows, n_tables, output) >= 0);
    FUZZ_CHECK(!memcmp(output, values, (size_t)n * sizeof *values));
    size = decode_integers(fuzz_mutate(bytes), lengths, tables, n_rows, n_tables, output);
    fuzz_hash(output, size < 0 ? 0 : n, sizeof *output);
}

static int64_t decode_faces(const fuzz_mesh *mesh, fuzz_bytes bytes, int32_t *faces,
                            int32_t *twins) {
    size_t size = reel_connectivity_decode_memory(mesh->n_verts, mesh->n_faces);
    int64_t result = reel_connectivity_decode(FUZZ_MEMORY(size), bytes.bytes, bytes.size,
                                              mesh->n_verts, mesh->n_faces, faces, twins);
    fuzz_check_code(result);
    return result;
}

void fuzz_connectivity(void) {
    fuzz_mesh mesh = fuzz_make_mesh(fuzz_one_in(30) ? 400 : 60);
    int64_t n = 3 * mesh.n_faces, capacity = 96 * mesh.n_faces + 1024;
    int32_t *faces = fuzz_allocate(n, sizeof *faces), *twins = fuzz_allocate(n, sizeof *twins);
    int32_t *order = fuzz_allocate(mesh.n_verts, sizeof *order);
    int32_t *decoded = fuzz_allocate(n, sizeof *decoded);
    int32_t *decoded_twins = fuzz_allocate(n, sizeof *decoded_twins);
    uint8_t *out = fuzz_allocate(capacity, 1);
    size_t size = reel_connectivity_encode_memory(mesh.n_verts, mesh.n_faces);
    int64_t length = reel_connectivity_encode(FUZZ_MEMORY(size), mesh.faces, mesh.n_faces,
                                              mesh.n_verts, fuzz_one_in(6), faces, twins, order,
                                              out, (size_t)capacity);
    fuzz_bytes bytes = fuzz_output(out, length);
    FUZZ_CHECK(decode_faces(&mesh, bytes, decoded, decoded_twins) >= 0);
    FUZZ_CHECK(!memcmp(decoded, faces, (size_t)n * sizeof *faces));
    FUZZ_CHECK(!memcmp(decoded_twins, twins, (size_t)n * sizeof *twins));
    fuzz_hash(order, mesh.n_verts, sizeof *order);
    if (decode_faces(&mesh, fuzz_mutate(bytes), decoded, decoded_twins) >= 0) {
        fuzz_hash(decoded, n, sizeof *decoded);
        fuzz_hash(decoded_twins, n, sizeof *decoded_twins);
    }
}

/* ---- hierarchy and prediction ---- */

typedef struct {
    int32_t *order, *level_starts, *level_resolutions, *stencil, *contexts;
    int64_t *smooth_starts;
    uint8_t *hops;
    float *smooth;
    int64_t n_verts, n_levels, size;
} mesh_levels;

static int64_t find_neighbors(const fuzz_mesh *mesh, int32_t *starts, int32_t *near) {
    size_t size = reel_adjacency_memory(mesh->n_verts, mesh->n_faces);
    int64_t n_near = reel_adjacency(FUZZ_MEMORY(size), mesh->faces, mesh->n_faces, mesh->n_verts,
                                    starts, near);
    fuzz_check_code(n_near);
    return n_near;
}

static mesh_levels find_levels(const fuzz_mesh *mesh) {
    int64_t n = mesh->n_verts, size = 1 + fuzz_below(REEL_MAX_STENCIL);
    int32_t *starts = fuzz_allocate(n + 1, sizeof *starts);
    int32_t *near = fuzz_allocate(6 * mesh->n_faces, sizeof *near);
    int64_t n_near = find_neighbors(mesh, starts, near);
    FUZZ_CHECK(n_near >= 0 && starts[n] == n_near);
    near = fuzz_copy(near, n_near, sizeof *near);
    mesh_levels result = {.n_verts = n, .size = size};
    result.order = fuzz_allocate(n, sizeof(int32_t));
    result.level_starts = fuzz_allocate(REEL_MAX_LEVELS + 1, sizeof(int32_t));
    result.level_resolutions = fuzz_allocate(REEL_MAX_LEVELS, sizeof(int32_t));
    result.smooth_starts = fuzz_allocate(REEL_MAX_LEVELS, sizeof(int64_t));
    result.stencil = fuzz_allocate(n * size, sizeof(int32_t));
    result.hops = fuzz_allocate(n * size, 1);
    result.contexts = fuzz_allocate(n * REEL_CONTEXT_NEIGHBORS, sizeof(int32_t));
    result.smooth = fuzz_allocate(REEL_SMOOTH_ROWS * n, REEL_SMOOTH_FIELDS * sizeof(float));
    result.n_levels =
        reel_hierarchy(FUZZ_MEMORY(reel_hierarchy_memory(n, n_near, 1)), starts, near, n, size,
                       result.order, result.level_starts, result.level_resolutions,
                       result.smooth_starts, result.stencil, result.hops, result.contexts,
                       result.smooth);
    FUZZ_CHECK(result.n_levels >= 0 && result.n_levels <= REEL_MAX_LEVELS);
    return result;
}

/* Check that levels cover all vertices, and that stencils and contexts refer to earlier ones. */
static void check_levels(const mesh_levels *levels) {
    FUZZ_CHECK(levels->level_starts[levels->n_levels] == levels->n_verts);
    for (int64_t level = 0; level < levels->n_levels; level++) {
        int32_t begin = levels->level_starts[level], end = levels->level_starts[level + 1];
        FUZZ_CHECK(begin <= end);
        for (int32_t v = begin; v < end; v++) {
            FUZZ_CHECK(level == 0 || levels->stencil[v * levels->size] >= 0);
            for (int64_t j = 0; j < levels->size; j++) {
                FUZZ_CHECK(levels->stencil[v * levels->size + j] < begin || !begin);
            }
            for (int j = 0; j < REEL_CONTEXT_NEIGHBORS; j++) {
                FUZZ_CHECK(levels->contexts[v * REEL_CONTEXT_NEIGHBORS + j] < v);
            }
        }
    }
    fuzz_hash(levels->order, levels->n_verts, sizeof *levels->order);
    fuzz_hash(levels->stencil, levels->n_verts * levels->size, sizeof *levels->stencil);
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

static void predict_on(const mesh_levels *levels) {
    reel_mesh mesh = {levels->n_verts,       levels->n_levels, levels->size, levels->level_starts,
                      levels->smooth_starts, levels->stencil,  levels->hops, levels->smooth};
    reel_fields fields = {.n_verts = levels->n_verts, .n_modes = fuzz_below(5)};
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
        int64_t index = fuzz_below(3 * mesh.n_faces);
        mesh.faces[index] = fuzz_one_in(2) ? -1 : (int32_t)mesh.n_verts;
        int32_t *starts = fuzz_allocate(mesh.n_verts + 1, sizeof *starts);
        int32_t *near = fuzz_allocate(6 * mesh.n_faces, sizeof *near);
        FUZZ_CHECK(find_neighbors(&mesh, starts, near) < 0);
        return;
    }
    mesh_levels levels = find_levels(&mesh);
    check_levels(&levels);
    predict_on(&levels);
}

/* ---- temporal basis ---- */

/* Resting times: NULL, or any but the first. */
static uint8_t *any_rests(int64_t n_frames) {
    uint8_t *rests = fuzz_allocate(n_frames, sizeof *rests);
    for (int64_t time = 0; time < n_frames; time++) {
        rests[time] = time > 0 && fuzz_one_in(2);
    }
    return fuzz_one_in(2) ? rests : NULL;
}

/* Quantize arbitrary basis vectors, to nearest or rate-distortion optimized. */
void fuzz_basis_encode(void) {
    int64_t n_modes = fuzz_below(5), n_columns = 1 + fuzz_below(5), n_frames = 1 + fuzz_below(40);
    int64_t n = n_modes * n_columns * n_frames;
    double *targets = fuzz_allocate(n, sizeof *targets), rd_lambda = fuzz_one_in(2) ? 0.0 : 0.12;
    for (int64_t i = 0; i < n; i++) {
        targets[i] = fuzz_float();
    }
    int32_t *integers = fuzz_allocate(n, sizeof *integers);
    if (fuzz_one_in(3)) {
        int64_t output =
            reel_cosines_encode(FUZZ_MEMORY(reel_cosines_encode_memory(n_frames)), targets,
                                n_modes, n_columns, n_frames, rd_lambda, integers);
        fuzz_check_code(output);
        fuzz_hash(integers, output < 0 ? 0 : n, sizeof *integers);
        return;
    }
    uint8_t *rests = any_rests(n_frames);
    if (rests && fuzz_one_in(20)) {
        rests[0] = 1; /* invalid, like 9 bits */
    }
    int64_t result =
        reel_basis_encode(FUZZ_MEMORY(reel_basis_encode_memory(n_frames)), targets, n_modes,
                          n_columns, n_frames, rests, fuzz_below(10), fuzz_below(2), rd_lambda,
                          integers);
    fuzz_check_code(result);
    fuzz_hash(integers, result < 0 ? 0 : n, sizeof *integers);
}

/* ---- integers on a surface ---- */

static int32_t *decode_surface(const fuzz_mesh *mesh, int64_t n_frames, int64_t n_columns,
                               fuzz_bytes bytes, int64_t *result) {
    size_t size =
        reel_surface_integers_memory(n_frames, mesh->n_verts, n_columns, mesh->n_faces, 0);
    int32_t *values = fuzz_allocate(n_frames * mesh->n_verts * n_columns, sizeof *values);
    *result = reel_surface_integers_decode(FUZZ_MEMORY(size), bytes.bytes, bytes.size, n_frames,
                                           mesh->n_verts, n_columns, mesh->faces, mesh->twins,
                                           mesh->n_faces, values);
    fuzz_check_code(*result);
    return values;
}

void fuzz_surface_integers(void) {
    fuzz_mesh mesh = fuzz_make_mesh(60);
    if (fuzz_one_in(4)) {
        fuzz_shuffle_twins(&mesh);
    }
    int64_t n_columns = 1 + fuzz_below(REEL_MAX_SURFACE_COLUMNS), n_frames = 1 + fuzz_below(5);
    int64_t frame_values = mesh.n_verts * n_columns, n = n_frames * frame_values;
    int64_t capacity = 16 * n + (1 << 16), result;
    int32_t *values = fuzz_allocate(n, sizeof *values), shift = (int32_t)fuzz_below(8);
    bool is_allowed = true;
    for (int64_t i = 0; i < n; i++) {
        bool is_similar = i >= frame_values && fuzz_one_in(2);
        values[i] = is_similar ? values[i - frame_values] : fuzz_integer() >> shift;
        is_allowed = is_allowed && values[i] <= REEL_MAX_SURFACE_VALUE &&
                     values[i] >= -REEL_MAX_SURFACE_VALUE;
    }
    if (n_frames > 1 && fuzz_one_in(2)) { /* equal frames */
        memcpy(values + frame_values, values, (size_t)frame_values * sizeof *values);
    }
    uint8_t *out = fuzz_allocate(capacity, 1);
    size_t size = reel_surface_integers_memory(n_frames, mesh.n_verts, n_columns, mesh.n_faces, 1);
    result = reel_surface_integers_encode(FUZZ_MEMORY(size), values, n_frames, mesh.n_verts,
                                          n_columns, mesh.faces, mesh.twins, mesh.n_faces, out,
                                          (size_t)capacity);
    FUZZ_CHECK(result >= 0 || !is_allowed);
    if (result < 0) {
        return;
    }
    fuzz_bytes bytes = fuzz_output(out, result);
    int32_t *output = decode_surface(&mesh, n_frames, n_columns, bytes, &result);
    FUZZ_CHECK(result == (int64_t)bytes.size);
    FUZZ_CHECK(!memcmp(output, values, (size_t)n * sizeof *values));
    for (int i = 0; i < 3; i++) {
        output = decode_surface(&mesh, n_frames, n_columns, fuzz_mutate(bytes), &result);
        fuzz_hash(output, result < 0 ? 0 : n, sizeof *output);
    }
}

/* ---- polygons ---- */

void fuzz_polygons(void) {
    int64_t n_polygons = 1 + fuzz_below(6), n_verts = 3 + fuzz_below(20), max_size = 3, n = 0;
    bool is_on_grid = fuzz_one_in(2);
    int32_t *sizes = fuzz_allocate(n_polygons, sizeof *sizes);
    double *positions = fuzz_allocate(3 * n_verts, sizeof *positions);
    for (int64_t i = 0; i < n_polygons; i++) {
        sizes[i] = 3 + (int32_t)fuzz_below(12);
        max_size = sizes[i] > max_size ? sizes[i] : max_size;
        n += sizes[i];
    }
    for (int64_t i = 0; i < 3 * n_verts; i++) {
        positions[i] = is_on_grid ? (double)fuzz_below(i % 3 < 2 ? 6 : 1) : fuzz_float();
    }
    int32_t *corners = fuzz_allocate(n, sizeof *corners);
    for (int64_t i = 0; i < n; i++) {
        corners[i] = (int32_t)fuzz_below(n_verts);
    }
    int64_t n_corners = 3 * (n - 2 * n_polygons), result;
    int32_t *triangles = fuzz_allocate(n_corners, sizeof *triangles);
    int32_t *triangle_corners = fuzz_allocate(n_corners, sizeof *triangle_corners);
    result = reel_triangulate(FUZZ_MEMORY(reel_triangulate_memory(max_size)), positions, sizes,
                              n_polygons, max_size, corners, triangles);
    FUZZ_CHECK(result >= 0 && result <= n_polygons);
    fuzz_hash(triangles, n_corners, sizeof *triangles);
    size_t size = reel_triangle_corners_memory(max_size);
    result = reel_triangle_corners(FUZZ_MEMORY(size), triangles, sizes, n_polygons, max_size,
                                   triangle_corners);
    FUZZ_CHECK(result == n);
    for (int64_t i = 0; i < n_corners; i++) {
        FUZZ_CHECK(triangles[i] == corners[triangle_corners[i]]);
    }
    triangles[fuzz_below(n_corners)] = (int32_t)fuzz_below(n_verts);
    result = reel_triangle_corners(FUZZ_MEMORY(size), triangles, sizes, n_polygons, max_size,
                                   triangle_corners);
    fuzz_check_code(result);
    fuzz_hash(triangle_corners, result < 0 ? 0 : n_corners, sizeof *triangle_corners);
}

/* ---- numbers over time on a graph ---- */

/* Random neighbors of items, mostly of nearby numbers. */
static int32_t *any_neighbors(int64_t n_items, int32_t **near) {
    int32_t *starts = fuzz_allocate(n_items + 1, sizeof *starts);
    *near = fuzz_allocate(8 * n_items, sizeof **near);
    int64_t max_neighbors = fuzz_below(9);
    starts[0] = 0;
    for (int64_t i = 0; i < n_items; i++) {
        int32_t end = starts[i];
        for (int64_t j = fuzz_below(max_neighbors + 1); j > 0; j--) {
            int64_t other = fuzz_one_in(8) ? fuzz_below(n_items) : i + fuzz_below(7) - 3;
            (*near)[end++] = (int32_t)(other < 0 || other >= n_items ? i : other);
        }
        starts[i + 1] = end;
    }
    return starts;
}

/* Store a random number: decimal floats, floats of few bits, any floats, or integers. */
static void put_number(uint8_t *target, int64_t size, int64_t type, int64_t kind) {
    uint64_t bits = fuzz_next();
    double value = kind ? (double)(fuzz_integer() / 64) / 1000.0 : fuzz_float();
    float single = value > 1e30 || value < -1e30 ? 1e30F : (float)value;
    if (type == REEL_FLOATS && size == 8) {
        memcpy(&bits, &value, sizeof bits);
    } else if (type == REEL_FLOATS) {
        bits = 0;
        memcpy(&bits, &single, sizeof single);
    } else if (kind) {
        bits = (uint64_t)(int64_t)fuzz_integer();
    }
    memcpy(target, &bits, (size_t)size);
}

void fuzz_exact(void) {
    int64_t type = fuzz_below(3), kind = fuzz_below(3), repetition = 1 + fuzz_below(4);
    int64_t size = type == REEL_FLOATS ? 4 << fuzz_below(2) : 1 << fuzz_below(4);
    int64_t n_frames = 1 + fuzz_below(9), n_items = 1 + fuzz_below(40), width = 1 + fuzz_below(4);
    int64_t count = n_frames * n_items * width, row = n_items * width;
    int32_t *near, *starts = any_neighbors(n_items, &near);
    uint8_t *values = fuzz_allocate(count, (size_t)size);
    for (int64_t i = 0; i < count; i++) {
        if (i >= row && fuzz_below(repetition)) {
            memcpy(values + i * size, values + (i - row) * size, (size_t)size);
        } else {
            put_number(values + i * size, size, type, kind);
        }
    }
    uint8_t *original = fuzz_copy(values, count, (size_t)size);
    size_t memory_size = reel_exact_memory(n_frames, n_items, width);
    int64_t capacity = count * size + 16;
    uint8_t *out = fuzz_allocate(capacity, 1);
    int64_t result =
        reel_exact_encode(FUZZ_MEMORY(memory_size), values, n_frames, n_items, width, size, type,
                          starts, near, out, (size_t)capacity);
    fuzz_bytes bytes = fuzz_output(out, result);
    FUZZ_CHECK(!memcmp(values, original, (size_t)(count * size)));
    for (int i = 0; i < 4; i++) {
        fuzz_bytes input = i ? fuzz_mutate(bytes) : bytes;
        uint8_t *decoded = fuzz_allocate(count, (size_t)size);
        result = reel_exact_decode(FUZZ_MEMORY(memory_size), input.bytes, input.size, decoded,
                                   n_frames, n_items, width, size, type, starts, near);
        fuzz_check_code(result);
        FUZZ_CHECK(i || result == (int64_t)bytes.size);
        FUZZ_CHECK(i || !memcmp(decoded, original, (size_t)(count * size)));
        if (result >= 0) {
            fuzz_hash(decoded, count, (size_t)size);
        }
    }
}
