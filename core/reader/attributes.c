/* The section ATTRIBUTE: a table of rows, and the row of each item: docs/format.md. */

#include "attributes.h"

#include "mesh.h"
#include "polygons.h"

#define MAX_WIDTH 16
#define MAX_ROWS INT32_MAX
#define NONE (-1)

/* Items have their own rows, or name rows; SHARED ones do so only to save space. */
enum layout_number { EACH = 0, INDEXED = 1, SHARED = 2 };
enum reference_code { AGAIN = 0, NEW = 1, EXPLICIT = 2 };
enum expected_from { NOTHING = 0, ROW_BEFORE = 1, ALONG_FACES = 2 };

/* Forms of numbers: 0 to 9 are integers by a power of ten. */
enum number_form { BY_BYTE = 10, BY_SHORT = 11, GRID = 64, FINEST_GRID = 88, AS_THEY_ARE = 255 };

/* ---- type and layout ---- */

static int read_type(reel_call *call, reel_range *left, meshreel_attribute *found) {
    static const uint32_t types[] = {MESHREEL_UINT8, MESHREEL_INT32, MESHREEL_FLOAT32,
                                     MESHREEL_FLOAT64};
    uint8_t bytes[4];
    uint64_t at = left->at;
    int failed = reel_read_bytes(call, left, bytes, sizeof bytes);
    if (failed) {
        return failed;
    }
    if (bytes[0] > MESHREEL_OTHER || bytes[1] > MESHREEL_CORNERS || bytes[2] > 3) {
        return reel_corrupt(call, at, "the kind, domain or number type of an attribute is unknown");
    }
    if (!bytes[3] || bytes[3] > MAX_WIDTH) {
        return reel_corrupt(call, at + 3, "values of an attribute have not 1 to 16 numbers");
    }
    found->kind = bytes[0];
    found->domain = bytes[1];
    found->type = types[bytes[2]];
    found->width = bytes[3];
    return MESHREEL_OK;
}

static uint32_t count_items(const reel_outline *outline, uint32_t domain) {
    return (uint32_t)(domain == MESHREEL_VERTICES ? outline->n_verts
                      : domain == MESHREEL_FACES  ? outline->n_polygons
                                                  : outline->n_corners);
}

static size_t size_of(const meshreel_attribute *attribute) { return attribute->type & 15U; }

static bool is_float(const meshreel_attribute *attribute) {
    return attribute->type == MESHREEL_FLOAT32 || attribute->type == MESHREEL_FLOAT64;
}

/* How values are laid out: rows of the table, and the bytes of references to them. */
typedef struct {
    uint8_t number;
    uint64_t n_rows;
    reel_range references;
} value_layout;

static int read_layout(reel_call *call, reel_range *left, const meshreel_attribute *found,
                       value_layout *layout) {
    uint64_t at = left->at, size;
    int failed = reel_read_bytes(call, left, &layout->number, 1);
    failed = failed ? failed : reel_read_varint(call, left, &layout->n_rows);
    failed = failed ? failed : reel_read_varint(call, left, &size);
    if (failed) {
        return failed;
    }
    if (layout->number > SHARED) {
        return reel_corrupt(call, at, "the layout of an attribute is unknown");
    }
    if (layout->number == EACH && (layout->n_rows != found->n_items || size)) {
        return reel_corrupt(call, at, "an attribute has not one row for each item");
    }
    if (size > left->length) {
        return reel_fail(call, MESHREEL_TRUNCATED, left->at,
                         "an attribute ends inside its references");
    }
    layout->references = (reel_range){left->at, size};
    *left = (reel_range){left->at + size, left->length - size};
    return MESHREEL_OK;
}

/* Takes memory for the rows of the table. */
static int keep_values(reel_call *call, reel_pool *pool, const value_layout *layout,
                       meshreel_attribute *found, void **values) {
    *values = reel_pool_allocate(call, pool, layout->n_rows, found->width * size_of(found));
    if (!*values) {
        return call->error.code;
    }
    if (layout->n_rows > MAX_ROWS) {
        return reel_fail(call, MESHREEL_UNSUPPORTED, layout->references.at,
                         "an attribute has more than 2^31 - 1 rows");
    }
    found->values = *values;
    found->n_rows = (uint32_t)layout->n_rows;
    return MESHREEL_OK;
}

/* ---- references ---- */

/* Items at places: items[i] is at place of[i], or all at place 0 where `of` is NULL. */
typedef struct {
    const int32_t *of;
    int32_t *last; /* row of the last item of each place, NONE before the first */
    uint64_t n, n_items;
} item_places;

static void forget_rows(item_places *places) {
    for (uint64_t i = 0; i < places->n; i++) {
        places->last[i] = NONE;
    }
}

/* Places that have items. */
static uint64_t count_used(item_places *places) {
    uint64_t n_used = 0;
    forget_rows(places);
    for (uint64_t i = 0; i < places->n_items; i++) {
        int32_t *last = &places->last[places->of ? places->of[i] : 0];
        n_used += *last == NONE;
        *last = 0;
    }
    forget_rows(places);
    return n_used;
}

/* The places of items: corners of faces are at their vertices, all others at one place. */
static int find_places(reel_call *call, const reel_faces *faces, const meshreel_attribute *found,
                       item_places *places) {
    const reel_outline *outline = faces->outline;
    bool at_vertices = found->domain == MESHREEL_CORNERS;
    *places = (item_places){.n = at_vertices ? outline->n_verts : 1, .n_items = found->n_items};
    if (at_vertices) {
        int32_t *vertices = reel_scratch(call, outline->n_corners, sizeof *vertices);
        if (!vertices) {
            return call->error.code;
        }
        reel_find_corner_vertices(outline, faces->triangles, faces->sizes, vertices);
        places->of = vertices;
    }
    places->last = reel_scratch(call, places->n, sizeof *places->last);
    return places->last ? MESHREEL_OK : call->error.code;
}

/* What is decoded of references: codes of items that are the first of their place, and of others;
   differences of explicit rows. */
typedef struct {
    const int32_t *first, *later, *differences, *end;
} reference_codes;

static int decode_codes(reel_call *call, reel_range coded, item_places *places,
                        reference_codes *codes) {
    uint64_t at = coded.at, n_explicit;
    int failed = reel_read_varint(call, &coded, &n_explicit);
    if (failed) {
        return failed;
    }
    if (n_explicit > places->n_items) {
        return reel_corrupt(call, at, "an attribute has more explicit references than items");
    }
    uint64_t n_first = count_used(places);
    int64_t lengths[] = {(int64_t)n_first, (int64_t)(places->n_items - n_first),
                         (int64_t)n_explicit};
    int32_t tables[] = {0, 1, 2}, *values;
    failed = reel_decode_rows(call, coded, lengths, tables, 3, 3, &values);
    if (!failed) {
        *codes = (reference_codes){values, values + n_first, values + places->n_items,
                                   values + places->n_items + n_explicit};
    }
    return failed;
}

/* Finds the row of each item; returns NULL, or the message of a failure. */
static const char *follow_references(reference_codes codes, const item_places *places,
                                     int64_t n_rows, int32_t *rows) {
    int64_t n_new = 0, last_explicit = 0;
    for (uint64_t i = 0; i < places->n_items; i++) {
        int32_t *last = &places->last[places->of ? places->of[i] : 0];
        int32_t code = *last == NONE ? *codes.first++ : *codes.later++;
        int64_t row = *last;
        if (code == NEW) {
            row = n_new++;
        } else if (code == EXPLICIT) {
            if (codes.differences == codes.end) {
                return "an attribute has more explicit references than announced";
            }
            row = last_explicit += *codes.differences++;
        } else if (code != AGAIN) {
            return "a reference of an attribute is of an unknown kind";
        } else if (row == NONE) {
            return "a reference repeats the last of its place, which has none";
        }
        if (row < 0 || row >= n_rows) {
            return "an attribute refers to a row that does not exist";
        }
        *last = rows[i] = (int32_t)row;
    }
    return codes.differences == codes.end
               ? NULL
               : "an attribute has fewer explicit references than announced";
}

static int read_rows(reel_call *call, reel_pool *pool, const reel_faces *faces, reel_range coded,
                     meshreel_attribute *found) {
    const reel_chunk *mark = call->scratch.last;
    item_places places;
    reference_codes codes = {0};
    int failed = find_places(call, faces, found, &places);
    failed = failed ? failed : decode_codes(call, coded, &places, &codes);
    if (failed) {
        return failed;
    }
    int32_t *rows = reel_pool_allocate(call, pool, found->n_items, sizeof *rows);
    if (!rows) {
        return call->error.code;
    }
    const char *message = follow_references(codes, &places, found->n_rows, rows);
    if (message) {
        return reel_corrupt(call, coded.at, message);
    }
    found->rows = rows;
    reel_drop_scratch(call, mark);
    return MESHREEL_OK;
}

/* ---- from which rows others are expected ---- */

/* As reel_patterns_decode takes it. */
typedef struct {
    int32_t *order, *triples;
    int64_t *starts;
} expectation;

static int take_expectation(reel_call *call, uint64_t n_rows, uint64_t n_triples,
                            expectation *expected) {
    expected->order = reel_scratch(call, n_rows, sizeof *expected->order);
    expected->starts = reel_scratch(call, n_rows + 1, sizeof *expected->starts);
    expected->triples = reel_scratch(call, n_triples, 3 * sizeof *expected->triples);
    return expected->order && expected->starts && expected->triples ? MESHREEL_OK
                                                                    : call->error.code;
}

/* Rows in the order of the table, expected from nothing or each as the one before. */
static int expect_in_order(reel_call *call, uint32_t n_rows, bool from_before,
                           expectation *expected) {
    int failed = take_expectation(call, n_rows, from_before ? n_rows : 0, expected);
    if (failed) {
        return failed;
    }
    expected->starts[0] = 0;
    for (uint32_t i = 0; i < n_rows; i++) {
        expected->order[i] = (int32_t)i;
        expected->starts[i + 1] = from_before ? i : 0;
        if (from_before && i) {
            int32_t *triple = expected->triples + 3 * (size_t)(i - 1);
            triple[0] = triple[1] = (int32_t)i - 1;
            triple[2] = NONE;
        }
    }
    return MESHREEL_OK;
}

/* The row at each corner of the triangles. */
static void find_rows_of_triangles(const reel_faces *faces, const meshreel_attribute *found,
                                   int32_t *used) {
    uint64_t count = 3 * faces->outline->n_faces;
    if (found->domain == MESHREEL_CORNERS) {
        reel_find_fans(faces->outline, faces->sizes, used);
    } else {
        reel_copy(used, faces->triangles, (size_t)count * sizeof *used);
    }
    for (uint64_t i = 0; found->rows && i < count; i++) {
        used[i] = found->rows[used[i]];
    }
}

static int expect_along_faces(reel_call *call, const reel_faces *faces,
                              const meshreel_attribute *found, expectation *expected) {
    int64_t n_faces = (int64_t)faces->outline->n_faces, n_rows = found->n_rows;
    uint64_t n_sides = 3 * faces->outline->n_faces;
    int failed = take_expectation(call, (uint64_t)n_rows, n_sides + (uint64_t)n_rows, expected);
    const reel_chunk *mark = call->scratch.last;
    int32_t *used = failed ? NULL : reel_scratch(call, n_sides, sizeof *used), *twins;
    if (!used) {
        return call->error.code;
    }
    find_rows_of_triangles(faces, found, used);
    failed = reel_find_twins(call, used, faces->outline->n_faces, found->n_rows, &twins);
    size_t needed = reel_predictors_memory(n_rows, n_faces);
    void *memory = failed ? NULL : reel_scratch(call, needed, 1);
    if (!memory) {
        return call->error.code;
    }
    int64_t result = reel_predictors_find(memory, needed, used, twins, n_rows, n_faces,
                                          expected->order, expected->starts, expected->triples);
    reel_drop_scratch(call, mark);
    return reel_fail_core(call, result, REEL_UNKNOWN, "an attribute does not fit the faces");
}

static int find_expectation(reel_call *call, const reel_faces *faces,
                            const meshreel_attribute *found, uint8_t way, expectation *expected) {
    return way == ALONG_FACES
               ? expect_along_faces(call, faces, found, expected)
               : expect_in_order(call, found->n_rows, way == ROW_BEFORE, expected);
}

/* ---- values ---- */

/* Decodes a table of numbers of `size` bytes. */
static int decode_patterns(reel_call *call, reel_range coded, const meshreel_attribute *found,
                           const expectation *expected, size_t size, bool of_floats, void *values) {
    size_t needed = reel_patterns_memory(found->width);
    void *memory = reel_scratch(call, needed, 1);
    const uint8_t *bytes;
    int failed = memory ? reel_view(call, coded, &bytes) : call->error.code;
    if (failed) {
        return failed;
    }
    if (!reel_is_stripped(bytes, coded.length)) {
        return reel_corrupt(call, coded.at + coded.length - 1,
                            "the values of an attribute end with a byte of 0");
    }
    reel_zero(values, (size_t)found->n_rows * found->width * size);
    int64_t result = reel_patterns_decode(memory, needed, bytes, (size_t)coded.length, values,
                                          found->n_rows, found->width, (int64_t)size, of_floats,
                                          expected->order, expected->starts, expected->triples);
    return reel_fail_core(call, result, coded.at, "the values of an attribute are damaged");
}

static double divisor_of(uint8_t form) {
    static const double powers[] = {1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9};
    return form < BY_BYTE     ? powers[form]
           : form == BY_BYTE  ? 255.0
           : form == BY_SHORT ? 65535.0
                              : (double)(1U << (form - GRID));
}

/* One division of exact numbers and one rounding: the same on every machine. */
static void divide(const meshreel_attribute *found, const int32_t *integers, uint8_t form,
                   void *values) {
    uint64_t count = (uint64_t)found->n_rows * found->width;
    double divisor = divisor_of(form), *doubles = values;
    float *floats = values;
    for (uint64_t i = 0; i < count; i++) {
        double value = (double)integers[i] / divisor;
        if (found->type == MESHREEL_FLOAT64) {
            doubles[i] = value;
        } else {
            floats[i] = (float)value;
        }
    }
}

static int check_form(reel_call *call, uint64_t at, const meshreel_attribute *found, uint8_t form,
                      uint8_t way) {
    bool is_divided = form <= BY_SHORT || (form >= GRID && form <= FINEST_GRID);
    if (form != AS_THEY_ARE && !(is_divided && is_float(found))) {
        return reel_corrupt(call, at, "the form of the numbers of an attribute is unknown");
    }
    if (way > (found->domain == MESHREEL_FACES ? ROW_BEFORE : ALONG_FACES)) {
        return reel_corrupt(call, at + 1, "the way in which rows are expected is unknown");
    }
    return MESHREEL_OK;
}

static int read_values(reel_call *call, const reel_faces *faces, reel_range coded,
                       const meshreel_attribute *found, void *values) {
    uint8_t head[2];
    uint64_t at = coded.at;
    expectation expected;
    int failed = reel_read_bytes(call, &coded, head, sizeof head);
    failed = failed ? failed : check_form(call, at, found, head[0], head[1]);
    failed = failed ? failed : find_expectation(call, faces, found, head[1], &expected);
    if (failed || head[0] == AS_THEY_ARE) {
        return failed ? failed
                      : decode_patterns(call, coded, found, &expected, size_of(found),
                                        is_float(found), values);
    }
    int32_t *integers = reel_scratch(call, found->n_rows, found->width * sizeof *integers);
    failed = integers ? decode_patterns(call, coded, found, &expected, sizeof *integers, false,
                                        integers)
                      : call->error.code;
    if (!failed) {
        divide(found, integers, head[0], values);
    }
    return failed;
}

int reel_read_attribute(reel_call *call, reel_pool *pool, const reel_faces *faces,
                        reel_range payload, meshreel_attribute *found) {
    const reel_chunk *mark = call->scratch.last;
    reel_range left = payload;
    value_layout layout;
    void *values;
    *found = (meshreel_attribute){0};
    int failed = read_type(call, &left, found);
    failed = failed ? failed : reel_read_text(call, pool, &left, &found->name);
    found->n_items = count_items(faces->outline, found->domain);
    failed = failed ? failed : read_layout(call, &left, found, &layout);
    failed = failed ? failed : keep_values(call, pool, &layout, found, &values);
    if (!failed && layout.number != EACH) {
        found->is_indexed = layout.number == INDEXED;
        failed = read_rows(call, pool, faces, layout.references, found);
    }
    failed = failed ? failed : read_values(call, faces, left, found, values);
    reel_drop_scratch(call, mark);
    return failed;
}
