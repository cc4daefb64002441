/* Smooth fields, LANES at a time; see smooth.c and cpu.h. */

#define VECTOR REEL_JOIN(reel_vector_, LANES)
#define PARTS (FIELDS / LANES)
#define SIGN_CASES (1 << LANES)

/* The values that signs choose, LANES signs at a time: bit 0 is that of the first. */
TARGET static void NAMED(fill_signed)(double value, double (*chosen)[LANES]) {
    for (int bits = 0; bits < SIGN_CASES; bits++) {
        for (int lane = 0; lane < LANES; lane++) {
            chosen[bits][lane] = bits >> lane & 1 ? value : -value;
        }
    }
}

/* A step of Clenshaw's sum at every vertex: fields become factor W others - fields + value Z, with
   the means W and the signs Z. */
TARGET static void NAMED(step)(const reel_smoother *own, const reel_graph *graph, double factor,
                               double value) {
    double chosen[SIGN_CASES][LANES] __attribute__((aligned(64)));
    NAMED(fill_signed)(value, chosen);
    const double *others = own->others;
    for (int32_t v = 0; v < graph->n; v++) {
        VECTOR sums[PARTS];
        for (int part = 0; part < PARTS; part++) {
            sums[part] = (VECTOR){0};
        }
        for (int32_t i = graph->starts[v]; i < graph->starts[v + 1]; i++) {
            const VECTOR *near = (const VECTOR *)(others + FIELDS * (size_t)graph->near[i]);
            for (int part = 0; part < PARTS; part++) {
                sums[part] += near[part];
            }
        }
        int32_t degree = reel_degree(graph, v);
        double share = degree ? factor / degree : 0.0;
        VECTOR *fields = (VECTOR *)(own->fields + FIELDS * (size_t)v);
        uint32_t signs = own->signs[v];
        for (int part = 0; part < PARTS; part++) {
            const VECTOR *z = (const VECTOR *)chosen[signs >> part * LANES & (SIGN_CASES - 1)];
            fields[part] = (sums[part] * share - fields[part]) + *z;
        }
    }
}

#undef VECTOR
#undef PARTS
#undef SIGN_CASES
