/* Smooth fields, FLOATS floats per vector; see smooth.c and cpu.h. Loops over the vectors of a row
   are unrolled, so that they stay in registers even where compilers optimize for size. */

#define FLOATS (2 * LANES)
#define VECTOR NAMED(vector)
#define N_VECS (FIELDS / FLOATS)
#define FOR_VECS(k) _Pragma("GCC unroll 4") for (int k = 0; k < N_VECS; k++)

typedef float VECTOR __attribute__((vector_size(8 * LANES), may_alias));
typedef uint32_t NAMED(bit_vector) __attribute__((vector_size(4 * FLOATS)));

/* A value times FLOATS signs: bit 0 of the vector's bits is its first lane's; 1 is positive. */
TARGET REEL_INLINE VECTOR NAMED(apply_signs)(uint32_t signs, int k, NAMED(bit_vector) shifts,
                                             VECTOR value) {
    NAMED(bit_vector) bits = (NAMED(bit_vector)){0} + (~signs >> k * FLOATS);
    return (VECTOR)((NAMED(bit_vector))value ^ bits >> shifts << 31);
}

/* One step of Clenshaw's recurrence at every vertex: b, from two steps before, becomes factor W
   last - b + value Z, where W averages over neighbors and Z are the signs. */
TARGET static void NAMED(step)(const reel_smoother *smoother, const reel_graph *graph, float factor,
                               float value, const float *current, float *b) {
    NAMED(bit_vector) shifts;
    for (int lane = 0; lane < FLOATS; lane++) {
        shifts[lane] = (uint32_t)lane;
    }
    VECTOR values = value + (VECTOR){0};
    const int32_t *near = smoother->near;
    for (int32_t v = 0; v < graph->n; v++) {
        int32_t degree = reel_degree(graph, v);
        VECTOR sums[N_VECS];
        FOR_VECS(k) { sums[k] = (VECTOR){0}; }
        for (int32_t remaining = degree; remaining > 0; remaining -= UNROLL, near += UNROLL) {
            REEL_UNROLLED for (int i = 0; i < UNROLL; i++) {
                const VECTOR *row = (const VECTOR *)(current + near[i]);
                FOR_VECS(k) { sums[k] += row[k]; }
            }
        }
        float scale = degree ? factor / (float)degree : 0.0F;
        VECTOR *row = (VECTOR *)(b + FIELDS * (size_t)v);
        FOR_VECS(k) {
            row[k] = (sums[k] * scale - row[k]) +
                     NAMED(apply_signs)(smoother->signs[v], k, shifts, values);
        }
    }
}

/* Smooth fields of a graph: the Chebyshev series of the diffusion applied to the signs, summed by
   Clenshaw's recurrence from the last term. */
TARGET static const float *NAMED(diffuse)(const reel_smoother *smoother, const reel_graph *graph) {
    float *current = smoother->fields, *b = smoother->previous;
    const series *diffusion = graph->n > REEL_SMALL_GRAPH ? &large : &small;
    reel_zero(current, ((size_t)graph->n + 1) * FIELDS * sizeof *current);
    reel_zero(b, ((size_t)graph->n + 1) * FIELDS * sizeof *b);
    for (int term = diffusion->n_terms - 1; term >= 0; term--) {
        NAMED(step)(smoother, graph, term ? 2.0F : 1.0F, diffusion->terms[term], current, b);
        float *next = b;
        b = current;
        current = next;
    }
    return current;
}

#undef VECTOR
#undef N_VECS
#undef FOR_VECS
#undef FLOATS
#undef LANES
