/* Fuzz targets of the entropy coders: round trips, then damaged bytes. */

#include "fuzz.h"

#include <string.h>

/* ---- integers ---- */

typedef struct {
    int64_t n_rows, n_tables, n_values;
    int64_t *lengths;
    int32_t *tables;
} rows;

static int32_t *decode_rows(const rows *all, fuzz_bytes from, int64_t *result) {
    size_t size = reel_integers_memory(all->n_tables);
    int32_t *values = fuzz_allocate(all->n_values, sizeof *values);
    *result = reel_integers_decode(fuzz_allocate((int64_t)size, 1), size, from.bytes, from.size,
                                   all->lengths, all->tables, all->n_rows, all->n_tables, values);
    fuzz_check_code(*result);
    return values;
}

void fuzz_integers(void) {
    int64_t n_rows = fuzz_below(6), n_tables = 1 + fuzz_below(3);
    rows all = {.n_rows = n_rows, .n_tables = n_tables};
    all.lengths = fuzz_allocate(all.n_rows, sizeof *all.lengths);
    all.tables = fuzz_allocate(all.n_rows, sizeof *all.tables);
    for (int64_t i = 0; i < all.n_rows; i++) {
        all.lengths[i] = fuzz_below(120);
        all.tables[i] = (int32_t)fuzz_below(all.n_tables);
        all.n_values += all.lengths[i];
    }
    int32_t *values = fuzz_allocate(all.n_values, sizeof *values);
    for (int64_t i = 0; i < all.n_values; i++) {
        values[i] = fuzz_integer();
    }
    int64_t capacity = 16 * all.n_values + 16, result;
    size_t size = reel_integers_memory(all.n_tables);
    uint8_t *out = fuzz_allocate(capacity, 1);
    result = reel_integers_encode(fuzz_allocate((int64_t)size, 1), size, values, all.lengths,
                                  all.tables, all.n_rows, all.n_tables, out, (size_t)capacity);
    fuzz_bytes bytes = fuzz_written(out, result);
    int32_t *output = decode_rows(&all, bytes, &result);
    FUZZ_CHECK(result == (int64_t)bytes.size);
    FUZZ_CHECK(!memcmp(output, values, (size_t)all.n_values * sizeof *values));
    for (int i = 0; i < 3; i++) {
        output = decode_rows(&all, fuzz_mutate(bytes), &result);
        fuzz_hash(output, result < 0 ? 0 : all.n_values, sizeof *output);
    }
}

/* ---- fields ---- */

typedef struct {
    int64_t n_rows, n_columns, n_passes;
    int32_t *columns;
    int64_t *pass_starts, *near_starts;
    int32_t *near;
} coding_plan;

static coding_plan make_plan(void) {
    int64_t n_rows = fuzz_below(6), n_columns = fuzz_below(80), n_passes = fuzz_below(5);
    coding_plan all = {.n_rows = n_rows, .n_columns = n_columns, .n_passes = n_passes};
    all.n_passes += all.n_columns > 0 && all.n_passes == 0;
    all.columns = fuzz_permutation(all.n_columns);
    all.pass_starts = fuzz_allocate(all.n_passes + 1, sizeof(int64_t));
    all.near_starts = fuzz_allocate(all.n_columns + 1, sizeof(int64_t));
    int32_t *near = fuzz_allocate(16 * all.n_columns, sizeof *near);
    int64_t n_near = 0, max_neighbors = fuzz_below(17);
    for (int64_t i = 0; i < all.n_columns; i++) {
        all.near_starts[i] = n_near;
        for (int64_t j = i ? fuzz_below(max_neighbors + 1) : 0; j > 0; j--) {
            near[n_near++] = all.columns[fuzz_below(i)];
        }
    }
    all.near_starts[all.n_columns] = n_near;
    for (int64_t i = 0; i <= all.n_passes; i++) {
        all.pass_starts[i] = i ? all.n_columns * i / all.n_passes : 0;
    }
    all.near = fuzz_copy(near, n_near, sizeof *near);
    return all;
}

static size_t plan_memory(const coding_plan *all) {
    return reel_fields_memory(all->n_columns, all->n_passes, all->near_starts[all->n_columns]);
}

static int32_t *decode_fields(const coding_plan *all, fuzz_bytes from, int64_t *result) {
    size_t size = plan_memory(all);
    int32_t *values = fuzz_allocate(all->n_rows * all->n_columns, sizeof *values);
    *result =
        reel_fields_decode(fuzz_allocate((int64_t)size, 1), size, from.bytes, from.size,
                           all->n_rows, all->n_rows, all->n_columns, all->columns, all->pass_starts,
                           all->n_passes, all->near_starts, all->near, values);
    fuzz_check_code(*result);
    return values;
}

/* Break a rule of a plan: the core must reject it, or decode it without harm. */
static void damage_plan(coding_plan *all) {
    int64_t n_near = all->near_starts[all->n_columns], kind = fuzz_below(4);
    int64_t column = fuzz_below(all->n_columns), pass = fuzz_below(all->n_passes + 1);
    if (kind == 0 && all->n_columns) {
        all->columns[column] = (int32_t)(fuzz_below(4 * all->n_columns) - 3);
    } else if (kind == 1 && n_near) {
        int64_t place = fuzz_below(n_near);
        all->near[place] = fuzz_integer();
    } else if (kind == 2 && all->n_columns) { /* the last entry is the length of the list */
        all->near_starts[column] = fuzz_integer();
    } else {
        all->pass_starts[pass] = fuzz_integer();
    }
}

void fuzz_fields(void) {
    coding_plan all = make_plan();
    int64_t n_values = all.n_rows * all.n_columns, capacity = 16 * n_values + 65536, result;
    int32_t *values = fuzz_allocate(n_values, sizeof *values);
    for (int64_t i = 0; i < n_values; i++) {
        values[i] = fuzz_one_in(3) ? fuzz_integer() : 0;
    }
    size_t size = plan_memory(&all);
    uint8_t *out = fuzz_allocate(capacity, 1);
    result = reel_fields_encode(fuzz_allocate((int64_t)size, 1), size, values, all.n_rows,
                                all.n_columns, all.columns, all.pass_starts, all.n_passes,
                                all.near_starts, all.near, out, (size_t)capacity);
    fuzz_bytes bytes = fuzz_written(out, result);
    int32_t *output = decode_fields(&all, bytes, &result);
    FUZZ_CHECK(result == (int64_t)bytes.size);
    FUZZ_CHECK(!memcmp(output, values, (size_t)n_values * sizeof *values));
    for (int i = 0; i < 3; i++) {
        output = decode_fields(&all, fuzz_mutate(bytes), &result);
        fuzz_hash(output, result < 0 ? 0 : n_values, sizeof *output);
    }
    damage_plan(&all);
    decode_fields(&all, bytes, &result);
}

/* ---- tables ---- */

typedef struct {
    int64_t n_rows, width, item, is_float, n_triples;
    int32_t *order;
    int64_t *starts;
    int32_t *triples;
} row_order;

static uint8_t *decode_table(const row_order *all, fuzz_bytes from, int64_t *result) {
    size_t size = reel_patterns_memory(all->width);
    uint8_t *values = fuzz_allocate(all->n_rows * all->width, (size_t)all->item);
    *result = reel_patterns_decode(fuzz_allocate((int64_t)size, 1), size, from.bytes, from.size,
                                   values, all->n_rows, all->width, all->item, all->is_float,
                                   all->order, all->starts, all->triples);
    fuzz_check_code(*result);
    return values;
}

/* Predict rows along the faces of a mesh. */
static row_order predict_along(const fuzz_mesh *mesh) {
    static const int64_t items[] = {1, 4, 8};
    row_order all = {.n_rows = mesh->n_verts, .width = 1 + fuzz_below(4)};
    all.item = items[fuzz_below(3)];
    all.is_float = all.item == 8 || (all.item == 4 && fuzz_one_in(2));
    all.order = fuzz_allocate(all.n_rows, sizeof *all.order);
    all.starts = fuzz_allocate(all.n_rows + 1, sizeof *all.starts);
    int64_t max_neighbors = 3 * mesh->n_faces + all.n_rows;
    int32_t *triples = fuzz_allocate(3 * max_neighbors, sizeof *triples);
    size_t size = reel_predictors_memory(all.n_rows, mesh->n_faces);
    all.n_triples =
        reel_predictors_find(fuzz_allocate((int64_t)size, 1), size, mesh->faces, mesh->twins,
                             all.n_rows, mesh->n_faces, all.order, all.starts, triples);
    FUZZ_CHECK(all.n_triples >= 0 && all.n_triples <= max_neighbors);
    all.triples = fuzz_copy(triples, 3 * all.n_triples, sizeof *triples);
    return all;
}

void fuzz_patterns(void) {
    fuzz_mesh mesh = fuzz_make_mesh(60);
    row_order all = predict_along(&mesh);
    int64_t n_bytes = all.n_rows * all.width * all.item, result;
    int64_t capacity = 24 * all.n_rows * all.width + 32 * all.n_rows + 32;
    uint8_t *values = fuzz_allocate(n_bytes, 1), *out = fuzz_allocate(capacity, 1);
    int64_t variety = 1 + fuzz_below(256);
    for (int64_t i = 0; i < n_bytes; i++) {
        values[i] = (uint8_t)fuzz_below(variety);
    }
    uint8_t *original = fuzz_copy(values, n_bytes, 1);
    size_t size = reel_patterns_memory(all.width);
    result = reel_patterns_encode(fuzz_allocate((int64_t)size, 1), size, values, all.n_rows,
                                  all.width, all.item, all.is_float, all.order, all.starts,
                                  all.triples, out, (size_t)capacity);
    fuzz_bytes bytes = fuzz_written(out, result);
    uint8_t *output = decode_table(&all, bytes, &result);
    FUZZ_CHECK(result == (int64_t)bytes.size);
    FUZZ_CHECK(!memcmp(output, original, (size_t)n_bytes));
    for (int i = 0; i < 3; i++) {
        output = decode_table(&all, fuzz_mutate(bytes), &result);
        fuzz_hash(output, result < 0 ? 0 : n_bytes, 1);
    }
}

/* ---- integers on a surface ---- */

static int32_t *decode_surface(const fuzz_mesh *mesh, int64_t n_columns, fuzz_bytes from,
                               int64_t *result) {
    size_t size = reel_surface_integers_memory(mesh->n_verts, mesh->n_faces, n_columns);
    int32_t *values = fuzz_allocate(mesh->n_verts * n_columns, sizeof *values);
    *result = reel_surface_integers_decode(fuzz_allocate((int64_t)size, 1), size, from.bytes,
                                           from.size, mesh->n_verts, n_columns, mesh->faces,
                                           mesh->twins, mesh->n_faces, values);
    fuzz_check_code(*result);
    return values;
}

void fuzz_surface_integers(void) {
    fuzz_mesh mesh = fuzz_make_mesh(60);
    if (fuzz_one_in(4)) {
        fuzz_shuffle_twins(&mesh);
    }
    int64_t n_columns = 1 + fuzz_below(REEL_MAX_SURFACE_COLUMNS), n = mesh.n_verts * n_columns;
    int64_t capacity = REEL_SURFACE_HEAD + 16 * n + (1 << 16), result;
    int32_t *values = fuzz_allocate(n, sizeof *values), shift = (int32_t)fuzz_below(8);
    bool is_allowed = true;
    for (int64_t i = 0; i < n; i++) {
        values[i] = fuzz_integer() >> shift;
        is_allowed = is_allowed && values[i] <= REEL_MAX_SURFACE_VALUE &&
                     values[i] >= -REEL_MAX_SURFACE_VALUE;
    }
    uint8_t *out = fuzz_allocate(capacity, 1);
    size_t size = reel_surface_integers_memory(mesh.n_verts, mesh.n_faces, n_columns);
    result = reel_surface_integers_encode(fuzz_allocate((int64_t)size, 1), size, values,
                                          mesh.n_verts, n_columns, mesh.faces, mesh.twins,
                                          mesh.n_faces, out, (size_t)capacity);
    FUZZ_CHECK((result >= 0) == is_allowed);
    if (result < 0) {
        return;
    }
    fuzz_bytes bytes = fuzz_written(out, result);
    int32_t *output = decode_surface(&mesh, n_columns, bytes, &result);
    FUZZ_CHECK(result == (int64_t)bytes.size);
    FUZZ_CHECK(!memcmp(output, values, (size_t)n * sizeof *values));
    for (int i = 0; i < 3; i++) {
        output = decode_surface(&mesh, n_columns, fuzz_mutate(bytes), &result);
        fuzz_hash(output, result < 0 ? 0 : n, sizeof *output);
    }
}

/* ---- orders ---- */

static int64_t decode_order(const fuzz_mesh *mesh, bool with_faces, fuzz_bytes from,
                            int32_t *corners, int32_t *sequence) {
    size_t size = reel_order_memory(mesh->n_verts, mesh->n_faces);
    int64_t result = reel_order_decode(fuzz_allocate((int64_t)size, 1), size, from.bytes, from.size,
                                       mesh->faces, with_faces ? mesh->twins : NULL, mesh->n_verts,
                                       mesh->n_faces, with_faces, corners, sequence);
    fuzz_check_code(result);
    return result;
}

static int32_t *any_corners(int64_t n_faces) {
    int32_t *result = fuzz_permutation(n_faces);
    for (int64_t i = 0; i < n_faces; i++) {
        result[i] = 3 * result[i] + (int32_t)fuzz_below(3);
    }
    return result;
}

/* Check that found[i] / share is a permutation of 0..n-1. */
static void check_permutation(const int32_t *result, int64_t n, int32_t share) {
    uint8_t *seen = fuzz_allocate(n, 1);
    memset(seen, 0, (size_t)n);
    for (int64_t i = 0; i < n; i++) {
        FUZZ_CHECK(result[i] >= 0 && result[i] / share < n && !seen[result[i] / share]);
        seen[result[i] / share] = 1;
    }
}

void fuzz_order(void) {
    fuzz_mesh mesh = fuzz_make_mesh(60);
    bool with_faces = !fuzz_one_in(3);
    if (fuzz_one_in(4)) {
        fuzz_shuffle_twins(&mesh);
    }
    int32_t *given_corners = with_faces ? any_corners(mesh.n_faces) : NULL;
    int32_t *given_sequence = fuzz_permutation(mesh.n_verts);
    int64_t capacity = 32 * (mesh.n_verts + mesh.n_faces) + 32, result;
    int32_t *corners = with_faces ? fuzz_copy(given_corners, mesh.n_faces, 4) : NULL;
    int32_t *sequence = fuzz_copy(given_sequence, mesh.n_verts, 4);
    size_t size = reel_order_memory(mesh.n_verts, mesh.n_faces);
    uint8_t *out = fuzz_allocate(capacity, 1);
    result = reel_order_encode(fuzz_allocate((int64_t)size, 1), size, mesh.faces,
                               with_faces ? mesh.twins : NULL, mesh.n_verts, mesh.n_faces,
                               with_faces, corners, sequence, out, (size_t)capacity);
    fuzz_bytes bytes = fuzz_written(out, result);
    FUZZ_CHECK(!memcmp(sequence, given_sequence, (size_t)mesh.n_verts * sizeof *sequence));
    for (int i = 0; i < 4; i++) {
        corners = with_faces ? fuzz_allocate(mesh.n_faces, sizeof *corners) : NULL;
        sequence = fuzz_allocate(mesh.n_verts, sizeof *sequence);
        fuzz_bytes from = i ? fuzz_mutate(bytes) : bytes;
        result = decode_order(&mesh, with_faces, from, corners, sequence);
        FUZZ_CHECK(i || result == (int64_t)bytes.size);
        if (result >= 0) {
            check_permutation(sequence, mesh.n_verts, 1);
            fuzz_hash(sequence, mesh.n_verts, sizeof *sequence);
        }
        if (result >= 0 && with_faces) {
            check_permutation(corners, mesh.n_faces, 3);
            fuzz_hash(corners, mesh.n_faces, sizeof *corners);
        }
        FUZZ_CHECK(i || !memcmp(sequence, given_sequence, (size_t)mesh.n_verts * 4));
        FUZZ_CHECK(i || !with_faces || !memcmp(corners, given_corners, (size_t)mesh.n_faces * 4));
    }
}

/* ---- numbers over time on a graph ---- */

/* Random neighbors of items, mostly of nearby numbers. */
static int32_t *any_neighbors(int64_t n_items, int32_t **near) {
    int32_t *starts = fuzz_allocate(n_items + 1, sizeof *starts);
    *near = fuzz_allocate(8 * n_items, sizeof **near);
    int64_t max_neighbors = fuzz_below(9);
    starts[0] = 0;
    for (int64_t i = 0; i < n_items; i++) {
        int32_t at = starts[i];
        for (int64_t j = fuzz_below(max_neighbors + 1); j > 0; j--) {
            int64_t other = fuzz_one_in(8) ? fuzz_below(n_items) : i + fuzz_below(7) - 3;
            (*near)[at++] = (int32_t)(other < 0 || other >= n_items ? i : other);
        }
        starts[i + 1] = at;
    }
    return starts;
}

/* Store a random number: decimal floats, floats of few bits, any floats, or integers. */
static void put_number(uint8_t *at, int64_t size, int64_t type, int64_t kind) {
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
    memcpy(at, &bits, (size_t)size);
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
    uint8_t *given = fuzz_copy(values, count, (size_t)size);
    size_t memory_size = reel_exact_memory(n_frames, n_items, width);
    int64_t capacity = count * size + 16;
    uint8_t *out = fuzz_allocate(capacity, 1);
    int64_t result =
        reel_exact_encode(fuzz_allocate((int64_t)memory_size, 1), memory_size, values, n_frames,
                          n_items, width, size, type, starts, near, out, (size_t)capacity);
    fuzz_bytes bytes = fuzz_written(out, result);
    FUZZ_CHECK(!memcmp(values, given, (size_t)(count * size)));
    for (int i = 0; i < 4; i++) {
        fuzz_bytes from = i ? fuzz_mutate(bytes) : bytes;
        uint8_t *back = fuzz_allocate(count, (size_t)size);
        result =
            reel_exact_decode(fuzz_allocate((int64_t)memory_size, 1), memory_size, from.bytes,
                              from.size, back, n_frames, n_items, width, size, type, starts, near);
        fuzz_check_code(result);
        FUZZ_CHECK(i || result == (int64_t)bytes.size);
        FUZZ_CHECK(i || !memcmp(back, given, (size_t)(count * size)));
        if (result >= 0) {
            fuzz_hash(back, count, (size_t)size);
        }
    }
}
