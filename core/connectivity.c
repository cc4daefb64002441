/* Coding of the faces of a mesh: counts, then a traversal of each part of the surface, then the
   degenerate faces as a list. docs/format.md, CONNECTIVITY. */

#include "walk.h"

/* Code faces as a list of corner differences. */
static void code_face_list(reel_walk *walk, int32_t *faces, int64_t n_faces) {
    int64_t previous = 0;
    for (int64_t i = 0; i < n_faces && !walk->failed; i++) {
        int32_t *face = faces + 3 * i;
        for (int k = 0; k < 3; k++) {
            int64_t base = k ? face[0] : previous;
            int32_t step = reel_is_encoder(&walk->coder) ? (int32_t)(face[k] - base) : 0;
            int64_t value = base + reel_code_integer(&walk->coder, &walk->models->corner[k], step);
            if (value < 0 || value >= walk->n_verts) {
                walk->failed = true;
                return;
            }
            face[k] = (int32_t)value;
        }
        previous = face[0];
    }
}

static int64_t code_bounded_count(reel_walk *walk, int64_t count, int64_t limit) {
    count = reel_code_count(&walk->coder, &walk->models->amounts, (uint32_t)count);
    walk->failed |= count > limit;
    return count;
}

/* Encoder: traverse all parts, those with a boundary first, each from its first boundary edge or
   face. */
static void write_parts(reel_walk *walk) {
    const reel_surface *surface = &walk->surface;
    int64_t n_given = 3 * surface->n_faces, n_half_edges = n_given + 3 * surface->n_closing;
    for (int64_t he = n_given + 2; he < n_half_edges && !walk->failed; he += 3) {
        if (!walk->is_met[surface->point[he]]) {
            reel_walk_part(walk, (int32_t)he);
        }
    }
    for (int64_t f = 0; f < surface->n_faces && !walk->failed; f++) {
        if (!surface->flat[f] && !walk->is_met[surface->point[3 * f]]) {
            reel_walk_part(walk, (int32_t)(3 * f));
        }
    }
}

/* Encoder: number the vertices that no part uses, and renumber the degenerate faces. */
static void finish_numbers(reel_walk *walk, const int32_t *faces) {
    int64_t number = walk->n_numbered;
    for (int64_t v = 0; v < walk->n_verts; v++) {
        if (walk->numbers[v] == REEL_NONE) {
            walk->numbers[v] = (int32_t)number;
            walk->given[number++] = (int32_t)v;
        }
    }
    int32_t *flat = walk->faces + 3 * walk->n_visited;
    for (int64_t f = 0; f < walk->surface.n_faces; f++) {
        for (int k = 0; walk->surface.flat[f] && k < 3; k++) {
            *flat++ = walk->numbers[faces[3 * f + k]];
        }
    }
}

static int64_t code_faces(reel_walk *walk, const int32_t *given) {
    const reel_surface *surface = &walk->surface;
    int64_t n_unused = code_bounded_count(walk, walk->n_verts - surface->n_used, walk->n_verts);
    int64_t n_flat = code_bounded_count(walk, surface->n_flat, walk->n_faces);
    walk->n_faces -= walk->failed ? 0 : n_flat;
    walk->n_caps = code_bounded_count(walk, surface->n_caps, 3 * walk->n_faces);
    walk->pinched = reel_code_raw(&walk->coder, 1, surface->pinched);
    walk->has_flipped = reel_code_raw(&walk->coder, 1, surface->has_flipped);
    if (reel_is_encoder(&walk->coder)) {
        write_parts(walk);
        finish_numbers(walk, given);
    } else {
        while (walk->n_visited < walk->n_faces && !walk->failed) {
            reel_walk_part(walk, REEL_NONE);
        }
    }
    walk->failed |= walk->n_caps != 0 || walk->n_numbered + n_unused != walk->n_verts;
    code_face_list(walk, walk->faces + 3 * walk->n_visited, walk->failed ? 0 : n_flat);
    return walk->failed ? reel_failure(REEL_CORRUPT, walk->coder.position)
                        : reel_finish(&walk->coder);
}

/* Maximum number of nodes at a time: at most three quarters of all corners, closing faces
   included. */
static size_t max_nodes(int64_t n_faces) { return 3 * (size_t)n_faces + 4; }

static size_t walk_memory(int64_t n_faces) {
    return reel_array_bytes(1, sizeof(reel_walk_models)) +
           reel_array_bytes(REEL_STACKS + max_nodes(n_faces), sizeof(reel_node));
}

static reel_walk new_walk(reel_arena *arena, int64_t n_verts, int64_t n_faces) {
    reel_walk walk = {.n_verts = n_verts, .n_faces = n_faces, .free_slot = REEL_NONE};
    walk.capacity = (int32_t)max_nodes(n_faces);
    walk.models = reel_allocate(arena, 1, sizeof *walk.models);
    walk.nodes = reel_allocate(arena, REEL_STACKS + max_nodes(n_faces), sizeof *walk.nodes);
    if (!arena->failed) {
        reel_reset_walk_models(walk.models);
        walk.nodes += REEL_STACKS;
        for (int i = 0; i < REEL_STACKS; i++) {
            reel_node *head = &walk.nodes[REEL_HEAD(i)];
            head->above = head->below = REEL_HEAD(i);
        }
    }
    return walk;
}

/* Find the twins of listed faces if requested; returns false if the arena is too small. */
static bool find_twins(const reel_walk *walk, reel_arena *arena) {
    if (!walk->twins) {
        return true;
    }
    size_t size = reel_twins_memory(walk->n_verts, walk->n_faces);
    void *memory = reel_allocate(arena, size, 1);
    return memory && reel_twins(memory, size, walk->faces, walk->n_faces, walk->n_verts,
                                walk->twins) >= 0;
}

/* Before the walk, each half-edge is its own twin. */
static void start_twins(const reel_walk *walk) {
    for (int32_t he = 0; walk->twins && he < 3 * walk->n_faces; he++) {
        walk->twins[he] = he;
    }
}

static bool is_within(int64_t n_verts, int64_t n_faces) {
    return n_verts >= 0 && n_faces >= 0 && n_verts <= REEL_MAX_ITEMS && n_faces <= REEL_MAX_ITEMS;
}

size_t reel_connectivity_decode_memory(int64_t n_verts, int64_t n_faces) {
    return is_within(n_verts, n_faces)
               ? walk_memory(n_faces) + reel_array_bytes(reel_twins_memory(n_verts, n_faces), 1)
               : 0;
}

size_t reel_connectivity_encode_memory(int64_t n_verts, int64_t n_faces) {
    if (!is_within(n_verts, n_faces)) {
        return 0;
    }
    return walk_memory(n_faces) + reel_array_bytes(reel_twins_memory(n_verts, n_faces), 1) +
           reel_surface_memory(n_verts, n_faces) +
           reel_array_bytes((size_t)n_verts, sizeof(int32_t)) +
           reel_array_bytes(max_nodes(n_faces), sizeof(int32_t)) +
           reel_array_bytes(6 * (size_t)n_faces, 1);
}

static int64_t write_face_list(reel_walk *walk, const int32_t *faces) {
    reel_copy(walk->faces, faces, 3 * (size_t)walk->n_faces * sizeof *faces);
    for (int64_t v = 0; v < walk->n_verts; v++) {
        walk->given[v] = (int32_t)v;
    }
    code_face_list(walk, walk->faces, walk->n_faces);
    return reel_finish(&walk->coder);
}

static int64_t write_walks(reel_walk *walk, reel_arena *arena, const int32_t *faces) {
    size_t n_verts = (size_t)walk->n_verts, n_faces = (size_t)walk->n_faces;
    walk->numbers = reel_allocate(arena, n_verts, sizeof *walk->numbers);
    walk->half_edge = reel_allocate(arena, max_nodes(walk->n_faces), sizeof *walk->half_edge);
    walk->is_met = reel_allocate(arena, 6 * n_faces, 1);
    if (arena->failed ||
        !reel_find_surface(arena, faces, walk->n_faces, walk->n_verts, &walk->surface)) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    reel_zero(walk->is_met, 6 * n_faces);
    for (int64_t v = 0; v < walk->n_verts; v++) {
        walk->numbers[v] = REEL_NONE;
    }
    return code_faces(walk, faces);
}

int64_t reel_connectivity_encode(void *memory, size_t memory_size, const int32_t *faces,
                                 int64_t n_faces, int64_t n_verts, int64_t keep_order,
                                 int32_t *internal_faces, int32_t *twins,
                                 int32_t *internal_to_given, uint8_t *out, size_t capacity) {
    if (!is_within(n_verts, n_faces)) {
        return reel_failure(REEL_INVALID, 0);
    }
    for (int64_t i = 0; i < 3 * n_faces; i++) {
        if (faces[i] < 0 || faces[i] >= n_verts) {
            return reel_failure(REEL_INVALID, (uint64_t)i / 3);
        }
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
    reel_walk walk = new_walk(&arena, n_verts, n_faces);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    walk.coder = reel_start_encoder(out, capacity);
    walk.faces = internal_faces;
    walk.twins = twins;
    walk.given = internal_to_given;
    start_twins(&walk);
    reel_code_raw(&walk.coder, 1, keep_order != 0);
    if (!keep_order) {
        return write_walks(&walk, &arena, faces);
    }
    int64_t size = write_face_list(&walk, faces);
    return find_twins(&walk, &arena) ? size : reel_failure(REEL_NO_MEMORY, 0);
}

int64_t reel_connectivity_decode(void *memory, size_t memory_size, const uint8_t *in, size_t size,
                                 int64_t n_verts, int64_t n_faces, int32_t *faces,
                                 int32_t *twins) {
    if (!is_within(n_verts, n_faces)) {
        return reel_failure(REEL_INVALID, 0);
    }
    reel_arena arena = reel_arena_of(memory, memory_size);
    reel_walk walk = new_walk(&arena, n_verts, n_faces);
    if (arena.failed) {
        return reel_failure(REEL_NO_MEMORY, 0);
    }
    walk.coder = reel_start_decoder(in, size);
    walk.faces = faces;
    walk.twins = twins;
    start_twins(&walk);
    if (!reel_code_raw(&walk.coder, 1, 0)) {
        return code_faces(&walk, NULL);
    }
    code_face_list(&walk, faces, n_faces);
    if (walk.failed) {
        return reel_failure(REEL_CORRUPT, walk.coder.position);
    }
    return find_twins(&walk, &arena) ? reel_finish(&walk.coder) : reel_failure(REEL_NO_MEMORY, 0);
}
