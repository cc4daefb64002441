/* Values of frames of a loaded block: docs/format.md, "Frames" and "Tracks". */

#include "values.h"

#define MAX_FRAMES_PER_CALL 256 /* frames per call of reel_frames */

static const uint32_t nan_of_float = 0x7FC00000U;
static const uint64_t nan_of_double = 0x7FF8000000000000U;

/* ---- products of modes ---- */

typedef struct {
    const meshreel_decoder *decoder;
    const reel_track_state *state;
    const double *placement;
    uint32_t n_columns;
    int64_t first, count, frames_per_task, layout;
    uint8_t *out, *memory;
    size_t frame_bytes, memory_size;
    int32_t *frames;
    int64_t *results; /* of each task: whether its values are finite, or a failure */
} product;

static void multiply_task(void *shared, uint32_t i) {
    const product *p = shared;
    const reel_track_state *state = p->state;
    int64_t begin = i * p->frames_per_task,
            end = begin + p->frames_per_task < p->count ? begin + p->frames_per_task : p->count;
    p->results[i] = true;
    for (int64_t start = begin; start < end && p->results[i] >= 0; start += MAX_FRAMES_PER_CALL) {
        int64_t count = end - start < MAX_FRAMES_PER_CALL ? end - start : MAX_FRAMES_PER_CALL;
        const int64_t *starts = state->current.corrections.starts
                                    ? state->current.corrections.starts + p->first + start
                                    : NULL;
        int64_t are_finite = reel_frames(
            p->memory + i * p->memory_size, p->memory_size, state->current.basis,
            state->current.packed, (int64_t)state->current.group.precision, p->n_columns,
            (int64_t)state->current.group.n_frames, (int64_t)state->current.n_modes,
            state->items.graph.n_items, p->frames + start, count, starts,
            state->current.corrections.items, state->current.corrections.offsets, p->placement,
            p->layout, p->out + (size_t)start * p->frame_bytes);
        p->results[i] = are_finite < 0 ? are_finite : p->results[i] & are_finite;
    }
}

/* Multiply the modes of some frames, into 4 or 8 byte floats. `are_finite` may be NULL. */
static int multiply(reel_call *call, const meshreel_decoder *decoder, reel_track_state *state,
                    const reel_track *track, uint64_t first, uint64_t count, int64_t layout,
                    void *out, bool *are_finite) {
    uint32_t n_tasks = reel_threads(call) < count ? reel_threads(call) : (uint32_t)count;
    product p = {.decoder = decoder,
                 .state = state,
                 .placement = track->placement,
                 .n_columns = track->n_coded,
                 .first = (int64_t)first,
                 .count = (int64_t)count,
                 .frames_per_task = ((int64_t)count + n_tasks - 1) / n_tasks,
                 .layout = layout,
                 .out = out};
    int64_t max_count =
        p.frames_per_task < MAX_FRAMES_PER_CALL ? p.frames_per_task : MAX_FRAMES_PER_CALL;
    REEL_TRY(reel_pack_fields(call, state));
    p.frame_bytes = (size_t)state->items.graph.n_items * track->n_coded * (size_t)layout;
    p.memory_size =
        (reel_frames_memory(track->n_coded, (int64_t)state->current.n_modes, max_count) +
         REEL_ALIGNMENT - 1) /
        REEL_ALIGNMENT * REEL_ALIGNMENT;
    p.memory = reel_scratch(call, n_tasks, p.memory_size);
    p.frames = reel_scratch(call, count, sizeof *p.frames);
    p.results = reel_scratch(call, n_tasks, sizeof *p.results);
    REEL_NEED(p.memory && p.frames && p.results);
    for (uint64_t i = 0; i < count; i++) {
        p.frames[i] = (int32_t)(first + i);
    }
    reel_run(call, multiply_task, &p, n_tasks,
             count * state->items.graph.n_items * track->n_coded);
    bool is_finite = true;
    for (uint32_t i = 0; i < n_tasks; i++) {
        is_finite &= p.results[i] != 0;
        REEL_TRY(reel_fail_core(call, p.results[i], 0, "the frames of a block are damaged"));
    }
    if (are_finite) {
        *are_finite = is_finite;
    }
    return MESHREEL_OK;
}

/* ---- numbers of any type ---- */

/* Copy items of `item_bytes` bytes in an order. */
static void gather(const uint8_t *input, const int32_t *order, uint64_t n_items, size_t item_bytes,
                   uint8_t *output) {
    for (uint64_t i = 0; i < n_items; i++) {
        uint64_t source = order ? (uint64_t)order[i] : i;
        reel_copy(output + i * item_bytes, input + source * item_bytes, item_bytes);
    }
}

static double number_at(const void *numbers, uint32_t size, uint64_t i) {
    return size == 4 ? (double)((const float *)numbers)[i] : ((const double *)numbers)[i];
}

static void put_number(void *numbers, uint32_t size, uint64_t i, double value) {
    if (size == 4) {
        ((float *)numbers)[i] = (float)value;
    } else {
        ((double *)numbers)[i] = value;
    }
}

/* Convert the bits of a float, sign-extended, to its index in the order of its type, or back. */
static int64_t float_index(int64_t bits, uint32_t size) {
    return bits ^ ((bits >> 63) & (size == 4 ? INT32_MAX : INT64_MAX));
}

/* Put the float that is `offset` floats of its type after `value`, modulo their number. */
static void put_float_after(void *numbers, uint32_t size, uint64_t i, double value,
                            int64_t offset) {
    if (size == 4) {
        float single = (float)value;
        int32_t bits;
        reel_copy(&bits, &single, sizeof bits);
        bits = (int32_t)float_index((int32_t)(float_index(bits, size) + offset), size);
        reel_copy((uint8_t *)numbers + 4 * i, &bits, sizeof bits);
    } else {
        int64_t bits;
        reel_copy(&bits, &value, sizeof bits);
        bits = float_index((int64_t)((uint64_t)float_index(bits, size) + (uint64_t)offset), size);
        reel_copy((uint8_t *)numbers + 8 * i, &bits, sizeof bits);
    }
}

/* ---- values on a grid ---- */

/* The offset of the number at a coordinate. */
static int32_t rounding_at(const reel_rounding *rounding, uint32_t axis, int32_t coordinate) {
    int64_t i = (int64_t)coordinate - rounding->lowest[axis];
    return i >= 0 && i < rounding->n[axis] ? rounding->offsets[axis][i] : 0;
}

/* Store a frame of numbers of `number_bytes` bytes, converted to `size` bytes. */
static void store_grid(const reel_track_state *state, const reel_track *track, uint64_t frame,
                       uint32_t number_bytes, uint32_t size, void *out) {
    const reel_loaded_block *block = &state->current;
    uint64_t n_items = state->items.graph.n_items, n_columns = track->n_coded;
    const int32_t *units = (const int32_t *)block->exact + n_columns * n_items * frame;
    bool is_rounded = block->group.rounding.offset;
    for (uint64_t i = 0; i < n_items; i++) {
        uint64_t item = state->items.order ? (uint64_t)state->items.order[i] : i;
        for (uint32_t column = 0; column < n_columns; column++) {
            int32_t unit = units[n_columns * item + column];
            double value = (double)unit * block->group.grid;
            value = value * track->placement[0] + track->placement[1 + column];
            double number;
            put_float_after(&number, number_bytes, 0, value,
                            is_rounded ? rounding_at(&block->rounding, column, unit) : 0);
            put_number(out, size, n_columns * i + column, number_at(&number, number_bytes, 0));
        }
    }
}

/* Store the decoded numbers of some frames as floats or doubles, unrounded if these are longer. */
static int store_decoded(reel_call *call, const meshreel_decoder *decoder, reel_track_state *state,
                         const reel_track *track, uint64_t first, uint64_t count, uint32_t size,
                         void *out) {
    if (state->current.group.n_modes) {
        return multiply(call, decoder, state, track, first, count, size, out, NULL);
    }
    size_t frame_bytes = (size_t)state->items.graph.n_items * track->n_coded * size;
    for (uint64_t t = 0; t < count; t++) {
        store_grid(state, track, first + t, size, size, (uint8_t *)out + t * frame_bytes);
    }
    return MESHREEL_OK;
}

/* ---- positions ---- */

static void store_exact(const meshreel_decoder *decoder, const reel_track_state *state,
                        uint64_t frame, uint32_t size, void *out) {
    const reel_outline *outline = &decoder->file->outline;
    uint64_t n_items = state->items.graph.n_items;
    uint32_t number_bytes = outline->number_bytes;
    if (state->current.group.grid > 0.0) {
        frame = state->current.group.is_still ? 0 : frame;
        store_grid(state, decoder->file->tracks, frame, number_bytes, size, out);
        return;
    }
    const uint8_t *numbers =
        (const uint8_t *)state->current.exact + (size_t)(3 * number_bytes * n_items * frame);
    if (size == number_bytes) {
        gather(numbers, state->items.order, n_items, 3 * (size_t)size, out);
        return;
    }
    for (uint64_t i = 0; i < 3 * n_items; i++) {
        uint64_t item = 3 * (uint64_t)state->items.order[i / 3] + i % 3;
        put_number(out, size, i, number_at(numbers, number_bytes, item));
    }
}

/* Whether floats or doubles are finite, 8 bytes at a time: adding 1 to an exponent of all ones
   carries into the sign bit, which is masked out first. */
static bool are_finite(const void *numbers, uint32_t size, uint64_t count) {
    uint64_t mask = size == 4 ? 0x7FFFFFFF7FFFFFFFU : 0x7FFFFFFFFFFFFFFFU;
    uint64_t exponent_bit = size == 4 ? 0x0080000000800000U : 0x0010000000000000U;
    const uint8_t *bytes = numbers;
    uint64_t n_bytes = count * size, n_words = n_bytes / 8, result = 0, word = 0;
    for (uint64_t i = 0; i < n_words; i++) {
        reel_copy(&word, bytes + 8 * i, sizeof word);
        result |= (word & mask) + exponent_bit;
    }
    word = 0;
    reel_copy(&word, bytes + 8 * n_words, (size_t)(n_bytes - 8 * n_words));
    result |= (word & mask) + exponent_bit;
    return !(result & ~mask);
}

static int positions_of(reel_call *call, const meshreel_decoder *decoder, uint64_t first,
                        uint64_t count, uint32_t size, void *out) {
    reel_track_state *state = decoder->tracks;
    const reel_outline *outline = &decoder->file->outline;
    uint64_t n_items = state->items.graph.n_items;
    bool is_finite;
    if (outline->method == REEL_METHOD_REEL) {
        REEL_TRY(multiply(call, decoder, state, decoder->file->tracks, first, count, size, out,
                          &is_finite));
    } else {
        for (uint64_t i = 0; i < count; i++) {
            store_exact(decoder, state, first + i, size,
                        (uint8_t *)out + (size_t)(3 * size * n_items * i));
        }
        is_finite = are_finite(out, size, 3 * n_items * count);
    }
    if (is_finite) {
        return MESHREEL_OK;
    }
    uint64_t offset = reel_group_bytes(outline, state->current.block, 0).offset;
    return size < outline->number_bytes
               ? reel_fail(call, MESHREEL_RANGE, offset,
                           "a number exceeds float; decode to doubles")
               : reel_fail(call, MESHREEL_CORRUPT, offset, "a position is not finite");
}

/* ---- tracks that positions predict ---- */

/* Positions of the frames around first..first+count-1 within the block; `n_before` is the number of
   frames before `first` among them. */
typedef struct {
    void *numbers;
    uint32_t size;
    uint64_t n_before, count, n_verts;
} position_window;

static int positions_around(reel_call *call, meshreel_decoder *decoder, uint64_t block,
                            uint64_t first, uint64_t count, uint64_t margin,
                            position_window *result) {
    const reel_outline *outline = &decoder->file->outline;
    uint64_t n_frames = outline->blocks[block].n_frames;
    uint64_t begin = first > margin ? first - margin : 0;
    uint64_t end = first + count + margin < n_frames ? first + count + margin : n_frames;
    *result = (position_window){NULL, outline->number_bytes, first - begin, end - begin,
                                outline->n_verts};
    REEL_TRY(reel_load(call, decoder, 0, block, 0));
    result->numbers = reel_scratch(call, 3 * outline->n_verts * result->count, result->size);
    return result->numbers
               ? positions_of(call, decoder, begin, result->count, result->size, result->numbers)
               : call->error.code;
}

static double coordinate(const position_window *p, uint64_t frame, uint64_t i) {
    return number_at(p->numbers, p->size, 3 * p->n_verts * frame + i);
}

/* Difference of positions over time that predicts a velocity, one-sided at the ends of the
   block. */
static double difference(const position_window *p, uint32_t kind, uint64_t frame, uint64_t i,
                         bool is_first, bool is_last) {
    if (is_first && is_last) {
        return 0.0;
    }
    if (is_first || (kind == REEL_FORWARD && !is_last)) {
        return coordinate(p, frame + 1, i) - coordinate(p, frame, i);
    }
    if (is_last || kind == REEL_BACKWARD) {
        return coordinate(p, frame, i) - coordinate(p, frame - 1, i);
    }
    return (coordinate(p, frame + 1, i) - coordinate(p, frame - 1, i)) / 2.0;
}

static bool is_number(double value, uint32_t size) {
    if (size == 4) {
        float single = (float)value;
        return single - single == 0.0F;
    }
    return value - value == 0.0;
}

/* Add a coded difference to the index of a predicted velocity. */
static void put_difference(const reel_track_state *state, uint32_t size, uint64_t index,
                           double expected, void *out, uint64_t i) {
    expected = is_number(expected, size) ? expected : 0.0;
    int64_t difference_value = size == 4 ? ((const int32_t *)state->current.exact)[index]
                                         : ((const int64_t *)state->current.exact)[index];
    put_float_after(out, size, i, expected, difference_value);
}

static int velocities_of(reel_call *call, meshreel_decoder *decoder, reel_track_state *state,
                         const reel_track *track, uint64_t first, uint64_t count, void *out) {
    position_window p;
    uint64_t n_items = state->items.graph.n_items, n = 3 * n_items;
    double *offsets = NULL;
    REEL_TRY(positions_around(call, decoder, state->current.block, first, count, 1, &p));
    if (!track->info.is_exact) {
        offsets = reel_scratch(call, n * count, sizeof *offsets);
        REEL_NEED(offsets);
        REEL_TRY(store_decoded(call, decoder, state, track, first, count, REEL_VALUES_8, offsets));
    }
    for (uint64_t t = 0; t < count; t++) {
        bool is_first = first + t == 0, is_last = first + t + 1 == state->current.group.n_frames;
        for (uint64_t i = 0; i < n; i++) {
            double step = difference(&p, track->difference, p.n_before + t, i, is_first, is_last);
            double expected = track->rate * step;
            if (offsets) {
                put_number(out, track->size, t * n + i, expected + offsets[t * n + i]);
            } else {
                uint64_t item = (uint64_t)state->items.order[i / 3];
                put_difference(state, track->size, ((first + t) * n_items + item) * 3 + i % 3,
                               expected, out, t * n + i);
            }
        }
    }
    return MESHREEL_OK;
}

/* Surface normals of a frame at the values of a track; `of_vertices` receives n_verts normals. */
static int surface_normals(reel_call *call, const meshreel_file *file,
                           const reel_track_state *state, uint32_t domain,
                           const int32_t *summation_faces, const void *positions,
                           double *of_vertices, double *normals) {
    const reel_outline *outline = &file->outline;
    int64_t n_verts = (int64_t)outline->n_verts, n_faces = (int64_t)outline->n_faces;
    int64_t size = outline->number_bytes, n_items = state->items.graph.n_items;
    bool is_of_faces = domain == MESHREEL_FACES;
    const int32_t *vertex = state->items.vertex;
    double *output = is_of_faces || !vertex ? normals : of_vertices;
    int64_t result = reel_normals(
        positions, size, 1, n_verts,
        is_of_faces ? (const int32_t *)file->mesh.triangles : summation_faces, n_faces,
        is_of_faces ? state->items.polygon : NULL, is_of_faces ? n_items : n_verts, output);
    for (int64_t i = 0; i < n_items && output != normals; i++) {
        reel_copy(normals + 3 * i, of_vertices + 3 * (int64_t)vertex[i], 3 * sizeof *normals);
    }
    return reel_fail_core(call, result, 0, "the normals of a surface cannot be found");
}

/* Triangles in internal order, in which vertex normals are summed, with output vertices. */
static int32_t *find_summation_faces(reel_call *call, const meshreel_file *file) {
    uint64_t count = 3 * file->outline.n_faces;
    int32_t *faces = reel_scratch(call, count, sizeof *faces);
    for (uint64_t i = 0; faces && i < count; i++) {
        faces[i] = file->mesh.to_output[file->mesh.internal_faces[i]];
    }
    return faces;
}

static int rotated_normals(reel_call *call, meshreel_decoder *decoder, reel_track_state *state,
                           const reel_track *track, uint64_t first, uint64_t count, void *out) {
    const meshreel_file *file = decoder->file;
    uint64_t n_items = state->items.graph.n_items, n_verts = file->outline.n_verts;
    uint32_t domain = track->sharing == REEL_OF_VERTICES ? MESHREEL_VERTICES : track->info.domain;
    position_window p;
    REEL_TRY(positions_around(call, decoder, state->current.block, first, count, 0, &p));
    double *rotations = reel_scratch(call, 2 * n_items * count, sizeof *rotations);
    double *normals = reel_scratch(call, 3 * n_items, sizeof *normals);
    double *of_vertices = reel_scratch(call, 3 * n_verts, sizeof *of_vertices);
    int32_t *summation_faces = find_summation_faces(call, file);
    REEL_NEED(rotations && normals && of_vertices && summation_faces);
    REEL_TRY(store_decoded(call, decoder, state, track, first, count, REEL_VALUES_8, rotations));
    for (uint64_t t = 0; t < count; t++) {
        const uint8_t *positions = (const uint8_t *)p.numbers + 3 * n_verts * p.size * t;
        REEL_TRY(surface_normals(call, file, state, domain, summation_faces, positions, of_vertices,
                                 normals));
        reel_rotate_normals(normals, rotations + 2 * n_items * t, (int64_t)n_items, track->size,
                            (uint8_t *)out + 3 * n_items * track->size * t);
    }
    return MESHREEL_OK;
}

/* ---- any track ---- */

/* Normalize; normals shorter than 1/2 become 0. */
static void to_unit_length(void *normals, uint32_t size, uint64_t count) {
    for (uint64_t i = 0; i < count; i++) {
        double n[3], length;
        for (uint32_t axis = 0; axis < 3; axis++) {
            n[axis] = number_at(normals, size, 3 * i + axis);
        }
        length = __builtin_sqrt((n[0] * n[0] + n[1] * n[1]) + n[2] * n[2]);
        for (uint32_t axis = 0; axis < 3; axis++) {
            put_number(normals, size, 3 * i + axis, length >= 0.5 ? n[axis] / length : 0.0);
        }
    }
}

static void store_missing(const reel_track_state *state, const reel_track *track, uint64_t first,
                          uint64_t count, uint8_t *out) {
    uint64_t n_items = state->items.graph.n_items, n_columns = track->info.n_columns;
    for (uint64_t i = 0; i < count * n_items && state->current.missing; i++) {
        uint64_t t = i / n_items, value = i % n_items;
        uint64_t item = state->items.order ? (uint64_t)state->items.order[value] : value;
        const uint8_t *flags = state->current.missing + ((first + t) * n_items + item) * n_columns;
        for (uint64_t column = 0; column < n_columns; column++) {
            uint8_t *number = out + (i * n_columns + column) * track->size;
            if (flags[column] && track->size == 4) {
                reel_copy(number, &nan_of_float, sizeof nan_of_float);
            } else if (flags[column]) {
                reel_copy(number, &nan_of_double, sizeof nan_of_double);
            }
        }
    }
}

int reel_values(reel_call *call, meshreel_decoder *decoder, uint32_t number, uint64_t first,
                uint64_t count, uint32_t size, void *out) {
    const reel_track *track = &decoder->file->tracks[number];
    reel_track_state *state = &decoder->tracks[number];
    uint64_t n_items = state->items.graph.n_items;
    if (!number) {
        return positions_of(call, decoder, first, count, size, out);
    }
    if (track->difference) {
        REEL_TRY(velocities_of(call, decoder, state, track, first, count, out));
    } else if (track->info.coding == REEL_ROTATIONS) {
        REEL_TRY(rotated_normals(call, decoder, state, track, first, count, out));
    } else if (track->info.coding == REEL_EXACT) {
        size_t item_bytes = (size_t)track->info.n_columns * track->size;
        for (uint64_t t = 0; t < count; t++) {
            gather((const uint8_t *)state->current.exact + (first + t) * n_items * item_bytes,
                   state->items.order, n_items, item_bytes,
                   (uint8_t *)out + t * n_items * item_bytes);
        }
    } else {
        REEL_TRY(store_decoded(call, decoder, state, track, first, count, track->size, out));
        if (track->info.kind == MESHREEL_TRACK_NORMAL) {
            to_unit_length(out, track->size, n_items * count);
        }
    }
    store_missing(state, track, first, count, out);
    return MESHREEL_OK;
}

int reel_first_positions(reel_call *call, meshreel_decoder *decoder, uint64_t block,
                         void *numbers) {
    REEL_TRY(reel_load(call, decoder, 0, block, 0));
    return positions_of(call, decoder, 0, 1, decoder->file->outline.number_bytes, numbers);
}
