/* The section ATTRIBUTE: a table of rows, and the row of each item. docs/format.md, "Attributes,
   groups, materials". */

#include "attributes.h"

#include "mesh.h"
#include "polygons.h"

#define MAX_WIDTH 16
#define MAX_ROWS INT32_MAX
#define NONE (-1)
#define NUGGET 0.125 /* of weights from points */

/* EACH: every item has its own row. INDEXED: items refer to rows. SHARED: they do so only to save
   space. */
enum layout_number { PER_ITEM = 0, INDEXED = 1, SHARED = 2 };
enum reference_code { REPEAT = 0, NEW = 1, EXPLICIT = 2 };
enum row_predictor { ROW_BEFORE = 1, ALONG_FACES = 2, ON_SURFACE = 3, FROM_POINTS = 4 };

/* Stored forms of numbers; 0 to 9: integers divided by a power of ten. */
enum number_form {
    BY_BYTE = 10,
    BY_SHORT = 11,
    CUSTOM_GRID = 12,
    GRID = 64,
    FINEST_GRID = 88,
    PLAIN = 255
};

/* ---- type and layout ---- */

static int read_type(reel_call *call, reel_range *input, meshreel_attribute *result) {
    static const uint32_t types[] = {MESHREEL_UINT8, MESHREEL_INT32, MESHREEL_FLOAT32,
                                     MESHREEL_FLOAT64};
    uint8_t bytes[4];
    uint64_t offset = input->offset;
    REEL_TRY(reel_read_bytes(call, input, bytes, sizeof bytes));
    REEL_CORRUPT_IF(bytes[0] > MESHREEL_OTHER || bytes[1] > MESHREEL_CELLS || bytes[2] > 3, offset,
                    "the kind, domain or number type of an attribute is unknown");
    REEL_CORRUPT_IF(!bytes[3] || bytes[3] > MAX_WIDTH, offset + 3,
                    "the values of an attribute do not have 1 to 16 numbers");
    result->kind = bytes[0];
    result->domain = bytes[1];
    result->type = types[bytes[2]];
    result->width = bytes[3];
    return MESHREEL_OK;
}

static size_t size_of(const meshreel_attribute *attribute) { return attribute->type & 15U; }

static bool is_float(const meshreel_attribute *attribute) {
    return attribute->type == MESHREEL_FLOAT32 || attribute->type == MESHREEL_FLOAT64;
}

/* Layout of the values: rows of the table, and the coded references to them. */
typedef struct {
    uint8_t number;
    uint64_t n_rows;
    reel_range references;
} value_layout;

static int read_layout(reel_call *call, reel_range *input, const meshreel_attribute *result,
                       value_layout *layout) {
    uint64_t offset = input->offset, size;
    REEL_TRY(reel_read_bytes(call, input, &layout->number, 1));
    REEL_TRY(reel_read_varint(call, input, &layout->n_rows));
    REEL_TRY(reel_read_varint(call, input, &size));
    REEL_CORRUPT_IF(layout->number > SHARED, offset, "the layout of an attribute is unknown");
    REEL_CORRUPT_IF(layout->number == PER_ITEM && (layout->n_rows != result->n_items || size),
                    offset, "an attribute does not have one row for each item");
    if (size > input->length) {
        return reel_fail(call, MESHREEL_TRUNCATED, input->offset,
                         "an attribute ends inside its references");
    }
    layout->references = (reel_range){input->offset, size};
    *input = (reel_range){input->offset + size, input->length - size};
    return MESHREEL_OK;
}

static int allocate_values(reel_call *call, reel_pool *pool, const value_layout *layout,
                           meshreel_attribute *result, void **values) {
    *values = reel_pool_allocate(call, pool, layout->n_rows, result->width * size_of(result));
    REEL_NEED(*values);
    REEL_UNSUPPORTED_IF(layout->n_rows > MAX_ROWS, layout->references.offset,
                        "an attribute has more than 2^31 - 1 rows");
    result->values = *values;
    result->n_rows = (uint32_t)layout->n_rows;
    return MESHREEL_OK;
}

/* ---- references ---- */

/* Find the rows of vertices or faces, in order; returns NULL, or an error message. */
static const char *follow_references(const int32_t *codes, uint64_t n_items,
                                     const int32_t *differences, const int32_t *end,
                                     int64_t n_rows, int32_t *rows) {
    int64_t n_new = 0, last_explicit = 0, row = NONE;
    for (uint64_t i = 0; i < n_items; i++) {
        if (codes[i] == NEW) {
            row = n_new++;
        } else if (codes[i] == EXPLICIT) {
            if (differences == end) {
                return "an attribute has more explicit references than announced";
            }
            row = last_explicit += *differences++;
        } else if (codes[i] != REPEAT) {
            return "a reference of an attribute is of an unknown kind";
        }
        if (row < 0 || row >= n_rows) {
            return "an attribute refers to a row that does not exist";
        }
        rows[i] = (int32_t)row;
    }
    return differences == end ? NULL : "an attribute has fewer explicit references than announced";
}

static int read_item_rows(reel_call *call, reel_range data, const meshreel_attribute *result,
                          int32_t *rows) {
    uint64_t offset = data.offset, n_items = result->n_items, n_explicit;
    REEL_TRY(reel_read_varint(call, &data, &n_explicit));
    REEL_CORRUPT_IF(n_explicit > n_items, offset,
                    "an attribute has more explicit references than items");
    int64_t lengths[] = {(int64_t)n_items, (int64_t)n_explicit};
    int32_t tables[] = {0, 1}, *values;
    REEL_TRY(reel_decode_rows(call, data, lengths, tables, 2, 2, &values));
    const int32_t *differences = values + n_items;
    const char *message = follow_references(values, n_items, differences, differences + n_explicit,
                                            result->n_rows, rows);
    return message ? reel_corrupt(call, offset, message) : MESHREEL_OK;
}

/* Read how many codes each context has, and how many rows are explicit. */
static int read_corner_counts(reel_call *call, reel_range *input, uint64_t n_items,
                              int64_t lengths[REEL_CORNER_CONTEXTS + 1]) {
    uint64_t offset = input->offset, total = 0;
    for (int i = 1; i <= REEL_CORNER_CONTEXTS; i++) {
        uint64_t count;
        REEL_TRY(reel_read_varint(call, input, &count));
        REEL_CORRUPT_IF(count > n_items, offset, "an attribute has more references than corners");
        lengths[i] = (int64_t)count;
        total += i < REEL_CORNER_CONTEXTS ? count : 0;
    }
    REEL_CORRUPT_IF(total > n_items, offset, "an attribute has more references than corners");
    lengths[0] = (int64_t)(n_items - total);
    return MESHREEL_OK;
}

static int read_corner_rows(reel_call *call, const reel_faces *faces, reel_range data,
                            const meshreel_attribute *result, int32_t *rows) {
    const reel_outline *outline = faces->outline;
    uint64_t offset = data.offset, n_items = result->n_items;
    int64_t lengths[REEL_CORNER_CONTEXTS + 1], n_faces = (int64_t)outline->n_faces;
    int32_t tables[REEL_CORNER_CONTEXTS + 1], *values, *twins;
    for (int32_t i = 0; i <= REEL_CORNER_CONTEXTS; i++) {
        tables[i] = i;
    }
    REEL_TRY(read_corner_counts(call, &data, n_items, lengths));
    REEL_TRY(reel_decode_rows(call, data, lengths, tables, REEL_CORNER_CONTEXTS + 1,
                              REEL_CORNER_CONTEXTS + 1, &values));
    const int32_t *triangles = (const int32_t *)faces->triangles;
    REEL_TRY(reel_find_twins(call, &call->scratch, triangles, outline->n_faces, outline->n_verts,
                             &twins));
    size_t size = reel_corner_rows_memory((int64_t)outline->n_verts, (int64_t)n_items);
    void *memory = reel_scratch(call, size, 1);
    REEL_NEED(memory);
    int64_t n_explicit = lengths[REEL_CORNER_CONTEXTS];
    int64_t code = reel_corner_rows(memory, size, triangles, twins, faces->corners, n_faces,
                                     (int64_t)outline->n_verts, (int64_t)n_items, result->n_rows,
                                     values, lengths, values + n_items, n_explicit, rows);
    return code < 0 ? reel_corrupt(call, offset, "the references of corners do not match the faces")
                    : MESHREEL_OK;
}

static int read_rows(reel_call *call, reel_pool *pool, const reel_faces *faces, reel_range data,
                     meshreel_attribute *result) {
    const reel_chunk *mark = call->scratch.last;
    int32_t *rows = reel_pool_allocate(call, pool, result->n_items, sizeof *rows);
    REEL_NEED(rows);
    REEL_TRY(result->domain == MESHREEL_CORNERS ? read_corner_rows(call, faces, data, result, rows)
                                                : read_item_rows(call, data, result, rows));
    result->rows = rows;
    reel_drop_scratch(call, mark);
    return MESHREEL_OK;
}

/* ---- row predictors ---- */

/* The coding order of rows and their predictors, as reel_patterns_decode takes them. */
typedef struct {
    int32_t *rows, *triples, *stencils;
    int64_t *starts;
    float *weights;
} row_order;

static int allocate_row_order(reel_call *call, uint64_t n_rows, uint64_t n_triples,
                              row_order *order) {
    order->rows = reel_scratch(call, n_rows, sizeof *order->rows);
    order->starts = reel_scratch(call, n_rows + 1, sizeof *order->starts);
    order->triples = reel_scratch(call, n_triples, 3 * sizeof *order->triples);
    return order->rows && order->starts && order->triples ? MESHREEL_OK : call->error.code;
}

/* Code rows in table order, without predictor or each predicted by the previous one. */
static int predict_in_order(reel_call *call, uint32_t n_rows, bool from_previous,
                            row_order *order) {
    REEL_TRY(allocate_row_order(call, n_rows, from_previous ? n_rows : 0, order));
    order->starts[0] = 0;
    for (uint32_t i = 0; i < n_rows; i++) {
        order->rows[i] = (int32_t)i;
        order->starts[i + 1] = from_previous ? i : 0;
        if (from_previous && i) {
            int32_t *triple = order->triples + 3 * (size_t)(i - 1);
            triple[0] = triple[1] = (int32_t)i - 1;
            triple[2] = NONE;
        }
    }
    return MESHREEL_OK;
}

/* Find the row at each corner of the triangles. */
static void find_rows_of_triangles(const reel_faces *faces, const meshreel_attribute *result,
                                   int32_t *triangle_rows) {
    uint64_t count = 3 * faces->outline->n_faces;
    for (uint64_t i = 0; i < count; i++) {
        triangle_rows[i] = result->domain == MESHREEL_CORNERS ? reel_corner_at(faces, i)
                                                              : (int32_t)faces->triangles[i];
    }
    for (uint64_t i = 0; result->rows && i < count; i++) {
        triangle_rows[i] = result->rows[triangle_rows[i]];
    }
}

/* Find the row at each corner of a triangle, and the twins of their half-edges. */
static int find_row_faces(reel_call *call, const reel_faces *faces,
                          const meshreel_attribute *output, int32_t **triangles, int32_t **twins) {
    uint64_t n_faces = faces->outline->n_faces;
    *triangles = reel_scratch(call, 3 * n_faces, sizeof **triangles);
    REEL_NEED(*triangles);
    find_rows_of_triangles(faces, output, *triangles);
    return reel_find_twins(call, &call->scratch, *triangles, n_faces, output->n_rows, twins);
}

static int predict_along_faces(reel_call *call, const reel_faces *faces,
                               const meshreel_attribute *output, row_order *order) {
    int64_t n_faces = (int64_t)faces->outline->n_faces, n_rows = output->n_rows;
    uint64_t n_sides = 3 * faces->outline->n_faces;
    int32_t *triangles, *twins;
    REEL_TRY(allocate_row_order(call, (uint64_t)n_rows, n_sides + (uint64_t)n_rows, order));
    const reel_chunk *mark = call->scratch.last;
    REEL_TRY(find_row_faces(call, faces, output, &triangles, &twins));
    size_t memory_size = reel_predictors_memory(n_rows, n_faces);
    void *memory = reel_scratch(call, memory_size, 1);
    REEL_NEED(memory);
    int64_t result = reel_predictors_find(memory, memory_size, triangles, twins, n_rows, n_faces,
                                          order->rows, order->starts, order->triples,
                                          order->stencils);
    reel_drop_scratch(call, mark);
    return reel_fail_core(call, result, REEL_UNKNOWN, "an attribute does not match the faces");
}

/* Predict rows along the faces, and those with a stencil by weights from points. */
static int predict_from_points(reel_call *call, const reel_faces *faces,
                               const meshreel_attribute *output, row_order *order) {
    uint64_t n_rows = output->n_rows, n_corners = 3 * faces->outline->n_faces;
    order->stencils = reel_scratch(call, n_rows, REEL_MAX_STENCIL * sizeof *order->stencils);
    order->weights = reel_scratch(call, n_rows, REEL_MAX_STENCIL * sizeof *order->weights);
    REEL_NEED(order->stencils && order->weights);
    REEL_TRY(predict_along_faces(call, faces, output, order));
    int32_t *triangles = reel_scratch(call, n_corners, sizeof *triangles);
    double *points = reel_scratch(call, n_rows, 3 * sizeof *points);
    REEL_NEED(triangles && points);
    find_rows_of_triangles(faces, output, triangles);
    reel_zero(points, n_rows * 3 * sizeof *points);
    for (uint64_t i = 3 * n_corners; i-- > 0;) { /* the first corner of a row sets its point */
        uint64_t from = 3 * (uint64_t)faces->triangles[i / 3] + i % 3;
        points[3 * (uint64_t)triangles[i / 3] + i % 3] =
            faces->outline->number_bytes == 4 ? (double)((const float *)faces->positions)[from]
                                              : ((const double *)faces->positions)[from];
    }
    const reel_mesh rows = {.stencil_size = REEL_MAX_STENCIL, .stencil = order->stencils};
    reel_kriging(&rows, points, NUGGET, 0, (int64_t)n_rows, order->weights);
    return MESHREEL_OK;
}

static int find_row_order(reel_call *call, const reel_faces *faces,
                          const meshreel_attribute *result, uint8_t predictor, row_order *order) {
    *order = (row_order){0};
    return predictor == FROM_POINTS   ? predict_from_points(call, faces, result, order)
           : predictor == ALONG_FACES ? predict_along_faces(call, faces, result, order)
                                      : predict_in_order(call, result->n_rows,
                                                         predictor == ROW_BEFORE, order);
}

/* ---- values ---- */

/* Decode a table of numbers of `size` bytes. */
static int decode_patterns(reel_call *call, reel_range data, const meshreel_attribute *output,
                           const row_order *order, size_t size, bool of_floats, void *values) {
    size_t memory_size = reel_patterns_memory(output->width);
    void *memory = reel_scratch(call, memory_size, 1);
    const uint8_t *bytes;
    REEL_NEED(memory);
    REEL_TRY(reel_view(call, data, &bytes));
    REEL_CORRUPT_IF(!reel_is_stripped(bytes, data.length), data.offset + data.length - 1,
                    "the values of an attribute end with a zero byte");
    reel_zero(values, (size_t)output->n_rows * output->width * size);
    int64_t result = reel_patterns_decode(memory, memory_size, bytes, (size_t)data.length, values,
                                          output->n_rows, output->width, (int64_t)size, of_floats,
                                          order->rows, order->starts, order->triples,
                                          order->stencils, order->weights);
    return reel_fail_core(call, result, data.offset, "the values of an attribute are damaged");
}

static int decode_on_surface(reel_call *call, reel_range data, const reel_faces *faces,
                             const meshreel_attribute *output, int32_t *values) {
    int64_t n_rows = output->n_rows, n_faces = (int64_t)faces->outline->n_faces;
    size_t memory_size = reel_surface_integers_memory(1, n_rows, output->width, n_faces, 0);
    int32_t *triangles, *twins;
    const uint8_t *bytes;
    REEL_TRY(find_row_faces(call, faces, output, &triangles, &twins));
    REEL_TRY(reel_view(call, data, &bytes));
    void *memory = reel_scratch(call, memory_size, 1);
    REEL_NEED(memory);
    int64_t result =
        reel_surface_integers_decode(memory, memory_size, bytes, (size_t)data.length, 1, n_rows,
                                     output->width, triangles, twins, n_faces, values);
    return reel_fail_core(call, result, data.offset, "the values of an attribute are damaged");
}

/* Decode a table of integers in the order of a predictor. */
static int decode_integers(reel_call *call, const reel_faces *faces, reel_range data,
                           const meshreel_attribute *result, uint8_t predictor, int32_t *integers) {
    row_order order;
    if (predictor == ON_SURFACE) {
        return decode_on_surface(call, data, faces, result, integers);
    }
    REEL_TRY(find_row_order(call, faces, result, predictor, &order));
    return decode_patterns(call, data, result, &order, sizeof *integers, false, integers);
}

static double divisor_of(uint8_t form) {
    static const double powers[] = {1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9};
    return form < BY_BYTE     ? powers[form]
           : form == BY_BYTE  ? 255.0
           : form == BY_SHORT ? 65535.0
                              : (double)(1U << (form - GRID));
}

/* Divide integers; one division and one rounding give the same result on every machine. */
static void divide(const meshreel_attribute *result, const int32_t *integers, uint8_t form,
                   void *values) {
    uint64_t count = (uint64_t)result->n_rows * result->width;
    double divisor = divisor_of(form), *doubles = values;
    float *floats = values;
    for (uint64_t i = 0; i < count; i++) {
        double value = (double)integers[i] / divisor;
        if (result->type == MESHREEL_FLOAT64) {
            doubles[i] = value;
        } else {
            floats[i] = (float)value;
        }
    }
}

/* How the numbers of a table are stored. */
typedef struct {
    uint8_t form, predictor;
    float step, origins[MAX_WIDTH]; /* of OWN_GRID */
} number_layout;

static bool is_form(const meshreel_attribute *result, uint8_t form) {
    bool is_divided = form <= BY_SHORT || (form >= GRID && form <= FINEST_GRID);
    return form == PLAIN || (is_divided && is_float(result)) ||
           (form == CUSTOM_GRID && result->type == MESHREEL_FLOAT32);
}

static int read_grid(reel_call *call, reel_range *input, const meshreel_attribute *result,
                     number_layout *layout) {
    uint64_t offset = input->offset;
    REEL_TRY(reel_read_bytes(call, input, &layout->step, sizeof layout->step));
    REEL_TRY(
        reel_read_bytes(call, input, layout->origins, result->width * sizeof *layout->origins));
    bool is_valid = layout->step > 0.0F && reel_is_finite((double)layout->step);
    for (uint32_t i = 0; i < result->width; i++) {
        is_valid = is_valid && reel_is_finite((double)layout->origins[i]);
    }
    REEL_CORRUPT_IF(!is_valid, offset,
                    "the step of an attribute is not above 0, or an origin is not finite");
    return MESHREEL_OK;
}

static int read_number_layout(reel_call *call, reel_range *input, bool is_from_points,
                              const meshreel_attribute *result, number_layout *layout) {
    uint64_t offset = input->offset;
    REEL_TRY(reel_read_bytes(call, input, &layout->form, 1));
    REEL_CORRUPT_IF(!is_form(result, layout->form), offset,
                    "the form of the numbers of an attribute is unknown");
    if (layout->form == CUSTOM_GRID) {
        REEL_TRY(read_grid(call, input, result, layout));
    }
    offset = input->offset;
    REEL_TRY(reel_read_bytes(call, input, &layout->predictor, 1));
    bool has_integers = layout->form != PLAIN || result->type == MESHREEL_INT32;
    bool is_of_faces = result->domain == MESHREEL_FACES || result->domain == MESHREEL_CELLS;
    uint8_t last = is_of_faces ? ROW_BEFORE : has_integers ? ON_SURFACE : ALONG_FACES;
    bool is_valid = is_from_points ? layout->predictor == FROM_POINTS && !is_of_faces
                                   : layout->predictor <= last;
    REEL_CORRUPT_IF(!is_valid, offset,
                    "the row predictor of an attribute is unknown");
    return MESHREEL_OK;
}

/* Multiply by the step and add the origin, each rounded to single precision on every machine. */
static void place_on_grid(const meshreel_attribute *result, const int32_t *integers,
                          const number_layout *layout, float *values) {
    uint64_t count = (uint64_t)result->n_rows * result->width;
    for (uint64_t i = 0; i < count; i++) {
        float offset = (float)integers[i] * layout->step;
        values[i] = layout->origins[i % result->width] + offset;
    }
}

static int read_values(reel_call *call, const reel_faces *faces, bool is_from_points,
                       reel_range data, const meshreel_attribute *result, void *values) {
    number_layout layout;
    REEL_TRY(read_number_layout(call, &data, is_from_points, result, &layout));
    if (layout.form == PLAIN && result->type == MESHREEL_INT32) {
        return decode_integers(call, faces, data, result, layout.predictor, values);
    }
    if (layout.form == PLAIN) {
        row_order order;
        REEL_TRY(find_row_order(call, faces, result, layout.predictor, &order));
        return decode_patterns(call, data, result, &order, size_of(result), is_float(result),
                               values);
    }
    int32_t *integers = reel_scratch(call, result->n_rows, result->width * sizeof *integers);
    REEL_NEED(integers);
    REEL_TRY(decode_integers(call, faces, data, result, layout.predictor, integers));
    if (layout.form == CUSTOM_GRID) {
        place_on_grid(result, integers, &layout, values);
    } else {
        divide(result, integers, layout.form, values);
    }
    return MESHREEL_OK;
}

int reel_read_attribute(reel_call *call, reel_pool *pool, const reel_faces *faces,
                        const reel_section *section, meshreel_attribute *result) {
    const reel_chunk *mark = call->scratch.last;
    reel_range input = section->payload;
    value_layout layout;
    void *values;
    *result = (meshreel_attribute){0};
    REEL_TRY(read_type(call, &input, result));
    REEL_TRY(reel_read_text(call, pool, &input, &result->name));
    result->n_items = reel_count_items(faces->outline, result->domain);
    REEL_TRY(read_layout(call, &input, result, &layout));
    REEL_TRY(allocate_values(call, pool, &layout, result, &values));
    if (layout.number != PER_ITEM) {
        result->is_indexed = layout.number == INDEXED;
        REEL_TRY(read_rows(call, pool, faces, layout.references, result));
    }
    bool is_from_points = section->id == REEL_ATTRIBUTE_FROM_POINTS;
    REEL_TRY(read_values(call, faces, is_from_points, input, result, values));
    reel_drop_scratch(call, mark);
    return MESHREEL_OK;
}
