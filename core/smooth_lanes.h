/* Smooth fields, LANES at a time; see smooth.c and cpu.h. */

#define VECTOR REEL_JOIN(reel_vector_, LANES)
#define PARTS (FIELDS / LANES)
#define SIGN_CASES (1 << LANES)

/* LANES signs at a time, as 1 and -1: bit 0 is that of the first. */
TARGET static void NAMED(fill_signs)(double (*all)[LANES]) {
    for (int bits = 0; bits < SIGN_CASES; bits++) {
        for (int lane = 0; lane < LANES; lane++) {
            all[bits][lane] = bits >> lane & 1 ? 1.0 : -1.0;
        }
    }
}

REEL_INLINE TARGET const VECTOR *NAMED(signs_of)(const double (*all)[LANES], uint32_t signs,
                                                 int part) {
    return (const VECTOR *)all[signs >> part * LANES & (SIGN_CASES - 1)];
}

/* The first term of the series: b becomes value Z, with the signs Z. */
TARGET static void NAMED(begin)(const reel_smoother *own, int32_t n, double value,
                                const double (*all)[LANES], double *b) {
    for (int32_t v = 0; v < n; v++) {
        VECTOR *row = (VECTOR *)(b + FIELDS * (size_t)v);
        for (int part = 0; part < PARTS; part++) {
            row[part] = *NAMED(signs_of)(all, own->signs[v], part) * value;
        }
    }
}

/* A step of Clenshaw's sum at every vertex: b, which was two steps before, becomes
   factor W last - b + value Z, with the means W. */
TARGET static void NAMED(step)(const reel_smoother *own, const reel_graph *graph, double factor,
                               double value, const double (*all)[LANES], const double *last,
                               double *b) {
    for (int32_t v = 0; v < graph->n; v++) {
        VECTOR sums[PARTS];
        for (int part = 0; part < PARTS; part++) {
            sums[part] = (VECTOR){0};
        }
        for (int32_t i = graph->starts[v]; i < graph->starts[v + 1]; i++) {
            const VECTOR *near = (const VECTOR *)(last + FIELDS * (size_t)graph->near[i]);
            for (int part = 0; part < PARTS; part++) {
                sums[part] += near[part];
            }
        }
        int32_t degree = reel_degree(graph, v);
        double share = degree ? factor / degree : 0.0;
        VECTOR *row = (VECTOR *)(b + FIELDS * (size_t)v);
        for (int part = 0; part < PARTS; part++) {
            const VECTOR *z = NAMED(signs_of)(all, own->signs[v], part);
            row[part] = (sums[part] * share - row[part]) + *z * value;
        }
    }
}

/* Smooth fields of the graph: the series of the signs, by Clenshaw's sum from its last term on. */
TARGET static const double *NAMED(diffuse)(const reel_smoother *own, const reel_graph *graph) {
    double all[SIGN_CASES][LANES] __attribute__((aligned(64)));
    double *last = own->fields, *b = own->others;
    NAMED(fill_signs)(all);
    const series *chosen = graph->n > REEL_SMALL_GRAPH ? &large : &small;
    NAMED(begin)(own, graph->n, chosen->terms[chosen->n_terms - 1], all, last);
    reel_zero(b, (size_t)graph->n * FIELDS * sizeof *b);
    for (int term = chosen->n_terms - 2; term >= 0; term--) {
        NAMED(step)(own, graph, term ? 2.0 : 1.0, chosen->terms[term], all, last, b);
        double *latest = b;
        b = last;
        last = latest;
    }
    return last;
}

#undef VECTOR
#undef PARTS
#undef SIGN_CASES
