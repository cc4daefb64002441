/* Smooth fields: what connectivity alone predicts about the variation of fields over a mesh.

   docs/format.md, "Smooth fields". Random signs are diffused over the graph of a resolution. All
   arithmetic is IEEE single precision in the specified order, without fused operations, so that
   encoder and decoder compute the same bits on any machine. */

#include "smooth.h"
#include "cpu.h"

#define FIELDS REEL_SMOOTH_FIELDS
#define MAX_TERMS 27
#define UNROLL 8 /* neighbors summed without a branch: most vertices have fewer */

typedef struct {
    int n_terms;
    float terms[MAX_TERMS];
} series;

/* Chebyshev coefficients c_k = (2 if k > 0, else 1) exp(-t) I_k(t): exp(-t (1 - w)) is the sum of
   c_k T_k(w); t is 12 for small graphs, else 40. */
static const series small = {
    19,
    {
        0x1.dce1bep-4F,   0x1.c88ecap-3F,   0x1.90c9f2p-3F,   0x1.42f624p-3F,   0x1.de9dbep-4F,
        0x1.46d874p-4F,   0x1.9c7d66p-5F,   0x1.e26702p-6F,   0x1.062d4cp-6F,   0x1.09aa90p-7F,
        0x1.f76afep-9F,   0x1.bf4530p-10F,  0x1.75ae4ap-11F,  0x1.265b92p-12F,  0x1.b658c2p-14F,
        0x1.353e56p-15F,  0x1.9e56bcp-17F,  0x1.082416p-18F,  0x1.411ce0p-20F,
    },
};
static const series large = {
    27,
    {
        0x1.033016p-4F,   0x1.ffdabcp-4F,   0x1.ecc870p-4F,   0x1.ce937cp-4F,   0x1.a76582p-4F,
        0x1.79e596p-4F,   0x1.48ec1ep-4F,   0x1.17385ap-4F,   0x1.ce63fcp-5F,   0x1.757be8p-5F,
        0x1.2652a0p-5F,   0x1.c4a532p-6F,   0x1.53b0cap-6F,   0x1.f1a970p-7F,   0x1.63e6a6p-7F,
        0x1.f10ff8p-8F,   0x1.530154p-8F,   0x1.c3b76ap-9F,   0x1.260d26p-9F,   0x1.7623f4p-10F,
        0x1.d156b2p-11F,  0x1.1af134p-11F,  0x1.507faap-12F,  0x1.8778c4p-13F,  0x1.bd9c14p-14F,
        0x1.f06c7cp-15F,  0x1.0eb08cp-15F,
    },
};

#define LANES 2
#include "smooth_lanes.h"

#ifdef REEL_HAS_WIDE
#define LANES 4
#include "smooth_lanes.h"
#define LANES 8
#include "smooth_lanes.h"
#endif

reel_smoother reel_allocate_smoother(reel_arena *arena, size_t n, size_t n_near) {
    return (reel_smoother){
        .fields = reel_allocate(arena, n + 1, FIELDS * sizeof(float)),
        .previous = reel_allocate(arena, n + 1, FIELDS * sizeof(float)),
        .near = reel_allocate(arena, n_near + (UNROLL - 1) * n, sizeof(int32_t)),
        .signs = reel_allocate(arena, n, sizeof(uint16_t)),
        .lanes = reel_vector_width(),
    };
}

/* Random signs of all fields: bit f of a vertex is set for +1, and clear for -1. */
static void fill_signs(uint16_t *signs, int32_t n) {
    for (int32_t v = 0; v < n; v++) {
        uint32_t bits = 0;
        for (uint32_t field = 0; field < FIELDS; field++) {
            uint64_t index = (uint64_t)v * FIELDS + field;
            bits |= (uint32_t)(reel_hash(index) >> 63) << field;
        }
        signs[v] = (uint16_t)bits;
    }
}

/* Write the neighbor lists of all vertices as offsets into the fields, padded to multiples of
   UNROLL with the zero row. */
static void write_neighbor_rows(int32_t *near, const reel_graph *graph) {
    for (int32_t v = 0; v < graph->n; v++) {
        int32_t degree = reel_degree(graph, v), padded_degree = (degree + UNROLL - 1) & -UNROLL;
        for (int32_t i = 0; i < degree; i++) {
            near[i] = FIELDS * graph->near[graph->starts[v] + i];
        }
        for (int32_t i = degree; i < padded_degree; i++) {
            near[i] = FIELDS * graph->n; /* below 2^31: vertex numbers have REEL_VERTEX_BITS */
        }
        near += padded_degree;
    }
}

void reel_smooth(const reel_smoother *smoother, const reel_graph *graph, float *rows) {
    fill_signs(smoother->signs, graph->n);
    write_neighbor_rows(smoother->near, graph);
    const float *fields = REEL_WIDEST(smoother->lanes, diffuse, smoother, graph);
    reel_copy(rows, fields, (size_t)graph->n * FIELDS * sizeof *rows);
}
