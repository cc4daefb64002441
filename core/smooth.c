/* Smooth fields: what connectivity alone tells of how fields vary over a mesh.

   docs/format.md, "Smooth fields". Random signs diffuse over the graph of a resolution. In IEEE
   single, in the order of operations that is stated there, with nothing fused: both sides, on every
   machine, find the same bits. */

#include "smooth.h"
#include "cpu.h"

#define FIELDS REEL_SMOOTH_FIELDS
#define MOST_TERMS 27
#define TOGETHER 8 /* neighbours that are summed up without a branch: most vertices have fewer */

typedef struct {
    int n_terms;
    float terms[MOST_TERMS];
} series;

/* c_k = (2 if k > 0, else 1) exp(-t) I_k(t): exp(-t (1 - w)) is the sum of c_k T_k(w); t is 12 for
   small graphs, else 40. */
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

#define LANES 4
#define TARGET
#define NAMED(name) name##_4
#include "smooth_lanes.h"
#undef LANES
#undef TARGET
#undef NAMED

#ifdef REEL_HAS_WIDE
#define LANES 8
#define TARGET REEL_TARGET_4
#define NAMED(name) name##_8
#include "smooth_lanes.h"
#undef LANES
#undef TARGET
#undef NAMED
#define LANES 16
#define TARGET REEL_TARGET_8
#define NAMED(name) name##_16
#include "smooth_lanes.h"
#undef LANES
#undef TARGET
#undef NAMED
#endif

size_t reel_smoother_room(size_t n, size_t n_near) {
    return 2 * reel_room(n + 1, FIELDS * sizeof(float)) + reel_room(n, sizeof(uint16_t)) +
           reel_room(n_near + (TOGETHER - 1) * n, sizeof(int32_t));
}

reel_smoother reel_take_smoother(reel_arena *arena, size_t n, size_t n_near) {
    return (reel_smoother){
        .fields = reel_take(arena, n + 1, FIELDS * sizeof(float)),
        .others = reel_take(arena, n + 1, FIELDS * sizeof(float)),
        .near = reel_take(arena, n_near + (TOGETHER - 1) * n, sizeof(int32_t)),
        .signs = reel_take(arena, n, sizeof(uint16_t)),
        .lanes = reel_widest(),
    };
}

/* Random signs of all fields: bit f of a vertex is set for a 1, else it is a -1. */
static void scatter_signs(uint16_t *signs, int32_t n) {
    for (int32_t v = 0; v < n; v++) {
        uint32_t bits = 0;
        for (uint32_t field = 0; field < FIELDS; field++) {
            uint64_t number = (uint64_t)v * FIELDS + field;
            bits |= (uint32_t)(reel_scattered(number) >> 63) << field;
        }
        signs[v] = (uint16_t)bits;
    }
}

/* Rows of neighbours, filled up: where the fields of each begin. */
static void fill_rows(int32_t *near, const reel_graph *graph) {
    for (int32_t v = 0; v < graph->n; v++) {
        int32_t degree = reel_degree(graph, v), filled = (degree + TOGETHER - 1) & -TOGETHER;
        for (int32_t i = 0; i < degree; i++) {
            near[i] = FIELDS * graph->near[graph->starts[v] + i];
        }
        for (int32_t i = degree; i < filled; i++) {
            near[i] = FIELDS * graph->n; /* below 2^31: places have REEL_PLACE_BITS */
        }
        near += filled;
    }
}

static const float *diffuse(const reel_smoother *own, const reel_graph *graph) {
#ifdef REEL_HAS_WIDE
    if (own->lanes == 8) {
        return diffuse_16(own, graph);
    }
    if (own->lanes == 4) {
        return diffuse_8(own, graph);
    }
#endif
    return diffuse_4(own, graph);
}

void reel_smooth(const reel_smoother *smoother, const reel_graph *graph, float *rows) {
    scatter_signs(smoother->signs, graph->n);
    fill_rows(smoother->near, graph);
    const float *fields = diffuse(smoother, graph);
    reel_copy(rows, fields, (size_t)graph->n * FIELDS * sizeof *rows);
}
