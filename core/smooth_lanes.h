/* Smooth fields, LANES at a time; see smooth.c and cpu.h. Here LANES are floats. Parts of a row are
   unrolled, so that they stay in registers where compilers are asked for small code. */

#define VECTOR REEL_JOIN(reel_floats_, LANES)
#define PARTS (FIELDS / LANES)
#define FOR_PARTS(part) _Pragma("GCC unroll 4") for (int part = 0; part < PARTS; part++)

typedef uint32_t NAMED(words) __attribute__((vector_size(4 * LANES)));

/* A value times LANES signs: bit 0 of the part is that of the first, and set for a 1. */
TARGET REEL_INLINE VECTOR NAMED(signed_as)(uint32_t signs, int part, NAMED(words) shifts,
                                           VECTOR value) {
    NAMED(words) bits = (NAMED(words)){0} + (~signs >> part * LANES);
    return (VECTOR)((NAMED(words))value ^ bits >> shifts << 31);
}

/* A step of Clenshaw's sum at every vertex: b, which was two steps before, becomes
   factor W last - b + value Z, with the means W and the signs Z. */
TARGET static void NAMED(step)(const reel_smoother *own, const reel_graph *graph, float factor,
                               float value, const float *last, float *b) {
    NAMED(words) shifts;
    for (int lane = 0; lane < LANES; lane++) {
        shifts[lane] = (uint32_t)lane;
    }
    VECTOR values = value + (VECTOR){0};
    const int32_t *near = own->near;
    for (int32_t v = 0; v < graph->n; v++) {
        int32_t degree = reel_degree(graph, v);
        VECTOR sums[PARTS];
        FOR_PARTS(part) {
            sums[part] = (VECTOR){0};
        }
        for (int32_t left = degree; left > 0; left -= TOGETHER, near += TOGETHER) {
            REEL_UNROLLED for (int i = 0; i < TOGETHER; i++) {
                const VECTOR *one = (const VECTOR *)(last + near[i]);
                FOR_PARTS(part) {
                    sums[part] += one[part];
                }
            }
        }
        float share = degree ? factor / (float)degree : 0.0F;
        VECTOR *row = (VECTOR *)(b + FIELDS * (size_t)v);
        FOR_PARTS(part) {
            row[part] = (sums[part] * share - row[part]) +
                        NAMED(signed_as)(own->signs[v], part, shifts, values);
        }
    }
}

/* Smooth fields of the graph: the series of the signs, by Clenshaw's sum from its last term on. */
TARGET static const float *NAMED(diffuse)(const reel_smoother *own, const reel_graph *graph) {
    float *last = own->fields, *b = own->others;
    const series *chosen = graph->n > REEL_SMALL_GRAPH ? &large : &small;
    reel_zero(last, ((size_t)graph->n + 1) * FIELDS * sizeof *last);
    reel_zero(b, ((size_t)graph->n + 1) * FIELDS * sizeof *b);
    for (int term = chosen->n_terms - 1; term >= 0; term--) {
        NAMED(step)(own, graph, term ? 2.0F : 1.0F, chosen->terms[term], last, b);
        float *latest = b;
        b = last;
        last = latest;
    }
    return last;
}

#undef VECTOR
#undef PARTS
#undef FOR_PARTS
