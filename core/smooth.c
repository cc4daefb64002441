/* Smooth fields: what connectivity alone tells of how fields vary over a mesh.

   docs/format.md, "Smooth fields". Random signs diffuse over the graph of a resolution. In IEEE
   double, in the order of operations that is stated there, with nothing fused: both sides, on every
   machine, find the same bits. */

#include "smooth.h"
#include "cpu.h"

#define FIELDS REEL_SMOOTH_FIELDS
#define MOST_TERMS 27

typedef struct {
    int n_terms;
    double terms[MOST_TERMS];
} series;

/* c_k = (2 if k > 0, else 1) exp(-t) I_k(t): exp(-t (1 - w)) is the sum of c_k T_k(w); t is 12 for
   small graphs, else 40. */
static const series small = {
    19,
    {
        0x1.dce1bdc8232d5p-4,  0x1.c88eca01f7548p-3,  0x1.90c9f17279f49p-3,  0x1.42f6243124030p-3,
        0x1.de9dbeb3cfe63p-4,  0x1.46d873ea68172p-4,  0x1.9c7d66e0f2507p-5,  0x1.e26701e7bbbbcp-6,
        0x1.062d4b88def08p-6,  0x1.09aa8fb7cfa0dp-7,  0x1.f76afdf819befp-9,  0x1.bf452f2e2734bp-10,
        0x1.75ae4ae1d73adp-11, 0x1.265b91313fe79p-12, 0x1.b658c20e8fffep-14, 0x1.353e554609e80p-15,
        0x1.9e56bbb81cef0p-17, 0x1.0824165a5f9acp-18, 0x1.411ce06b569e5p-20,
    },
};
static const series large = {
    27,
    {
        0x1.033015e9c7c3dp-4,  0x1.ffdabb4e96ce7p-4,  0x1.ecc86f42d4ca0p-4,  0x1.ce937cfb1b20cp-4,
        0x1.a76582e9f71ecp-4,  0x1.79e595ff834dbp-4,  0x1.48ec1d6a164b7p-4,  0x1.173859f9496a5p-4,
        0x1.ce63fbd8df98fp-5,  0x1.757be8cf0630ep-5,  0x1.26529fe21ccfcp-5,  0x1.c4a531bbef924p-6,
        0x1.53b0cad00f756p-6,  0x1.f1a97017cc979p-7,  0x1.63e6a65d73887p-7,  0x1.f10ff7465dd65p-8,
        0x1.5301534620b01p-8,  0x1.c3b7694fba930p-9,  0x1.260d26a215fcap-9,  0x1.7623f37bb3f8bp-10,
        0x1.d156b25082001p-11, 0x1.1af134a6e5f14p-11, 0x1.507fa94287856p-12, 0x1.8778c4a2d405bp-13,
        0x1.bd9c13fa033b9p-14, 0x1.f06c7c3348542p-15, 0x1.0eb08cb3ec0dap-15,
    },
};

#define LANES 2
#define TARGET
#define NAMED(name) name##_2
#include "smooth_lanes.h"
#undef LANES
#undef TARGET
#undef NAMED

#ifdef REEL_HAS_WIDE
#define LANES 4
#define TARGET REEL_TARGET_4
#define NAMED(name) name##_4
#include "smooth_lanes.h"
#undef LANES
#undef TARGET
#undef NAMED
#define LANES 8
#define TARGET REEL_TARGET_8
#define NAMED(name) name##_8
#include "smooth_lanes.h"
#undef LANES
#undef TARGET
#undef NAMED
#endif

size_t reel_smoother_room(size_t n) {
    return 2 * reel_room(n, FIELDS * sizeof(double)) + reel_room(n, sizeof(uint16_t));
}

reel_smoother reel_take_smoother(reel_arena *arena, size_t n) {
    return (reel_smoother){
        .fields = reel_take(arena, n, FIELDS * sizeof(double)),
        .others = reel_take(arena, n, FIELDS * sizeof(double)),
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

static const double *diffuse(const reel_smoother *own, const reel_graph *graph) {
#ifdef REEL_HAS_WIDE
    if (own->lanes == 8) {
        return diffuse_8(own, graph);
    }
    if (own->lanes == 4) {
        return diffuse_4(own, graph);
    }
#endif
    return diffuse_2(own, graph);
}

void reel_smooth(const reel_smoother *smoother, const reel_graph *graph, float *rows) {
    scatter_signs(smoother->signs, graph->n);
    const double *fields = diffuse(smoother, graph);
    for (size_t i = 0; i < (size_t)graph->n * FIELDS; i++) {
        rows[i] = (float)fields[i];
    }
}
