/* Search of the tree of closest.c, LANES boxes or triangles per vector; see cpu.h. */

#define VEC NAMED(closest_vec)
#define VEC3 NAMED(closest_vec3)
#define MASK NAMED(closest_mask)
typedef double VEC __attribute__((vector_size(8 * LANES), may_alias));
typedef int64_t MASK __attribute__((vector_size(8 * LANES), may_alias));
typedef struct {
    VEC x, y, z;
} VEC3;

#define LOAD(rows, i) \
    ((VEC3){*(const VEC *)&(rows)[0][i], *(const VEC *)&(rows)[1][i], *(const VEC *)&(rows)[2][i]})
#define SELECT(mask, a, b) ((VEC)(((mask) & (MASK)(a)) | (~(mask) & (MASK)(b))))
#define POSITIVE_PART(v) ((VEC)((MASK)(v) & ((v) > 0.0))) /* max(v, 0) */

TARGET REEL_INLINE VEC NAMED(dot)(VEC3 a, VEC3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

TARGET REEL_INLINE VEC3 NAMED(cross)(VEC3 a, VEC3 b) {
    return (VEC3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/* a - factor * b */
TARGET REEL_INLINE VEC3 NAMED(subtract)(VEC3 a, VEC factor, VEC3 b) {
    return (VEC3){a.x - factor * b.x, a.y - factor * b.y, a.z - factor * b.z};
}

TARGET REEL_INLINE VEC NAMED(clamp_to_unit)(VEC v) {
    const VEC one = (VEC){0} + 1.0;
    v = POSITIVE_PART(v);
    return SELECT(v < one, v, one);
}

/* Return the lanes of a mask as bits: bit i is 1 if lane i is set. */
TARGET REEL_INLINE uint32_t NAMED(bits_of)(MASK mask) {
    uint32_t bits = 0;
    REEL_UNROLLED for (int lane = 0; lane < LANES; lane++) {
        bits |= (uint32_t)mask[lane] & 1U << lane;
    }
    return bits;
}

/* Compute the squared distances of a point from the boxes of a node; returns a bit for each that is
   below the bound. */
TARGET REEL_INLINE uint32_t NAMED(near_boxes)(const boxes *node, const double *point, double bound,
                                              double *squares) {
    const MASK not_sign = (MASK){0} + INT64_MAX;
    uint32_t bits = 0;
    REEL_UNROLLED for (int i = 0; i < FANOUT; i += LANES) {
        VEC3 center = LOAD(node->center, i), half = LOAD(node->half, i);
        VEC x = (VEC)((MASK)(point[0] - center.x) & not_sign) - half.x;
        VEC y = (VEC)((MASK)(point[1] - center.y) & not_sign) - half.y;
        VEC z = (VEC)((MASK)(point[2] - center.z) & not_sign) - half.z;
        VEC3 gap = {POSITIVE_PART(x), POSITIVE_PART(y), POSITIVE_PART(z)};
        VEC square = NAMED(dot)(gap, gap);
        *(VEC *)&squares[i] = square;
        bits |= NAMED(bits_of)(square < bound) << i;
    }
    return bits;
}

/* Replace the nearest point by that of a leaf if it is closer, or as close and on a lower face.

   The candidates are the closest points of the three edges, and the projection onto the plane if it
   is inside. All of them are on the triangle, so that rounding errors of slivers cannot make a
   distance too small. */
TARGET REEL_INLINE void NAMED(search_leaf)(const triangles *leaves, int64_t number,
                                           const double *point, const double *direction,
                                           nearest_point *nearest) {
    const triangles *leaf = leaves + number;
    REEL_UNROLLED for (int i = 0; i < LEAF; i += LANES) {
        VEC3 origin = LOAD(leaf->origin, i), normal = LOAD(leaf->normal, i);
        VEC3 first = LOAD(leaf->edges[0], i), second = LOAD(leaf->edges[1], i);
        VEC3 inverses = LOAD(leaf->inverses, i);
        VEC3 offset = {point[0] - origin.x, point[1] - origin.y, point[2] - origin.z};
        VEC3 third = {second.x - first.x, second.y - first.y, second.z - first.z};
        VEC3 end = {offset.x - first.x, offset.y - first.y, offset.z - first.z};
        VEC on_first = NAMED(clamp_to_unit)(NAMED(dot)(offset, first) * inverses.x);
        VEC on_second = NAMED(clamp_to_unit)(NAMED(dot)(offset, second) * inverses.y);
        VEC on_third = NAMED(clamp_to_unit)(NAMED(dot)(end, third) * inverses.z);
        VEC inside_s = NAMED(dot)(normal, NAMED(cross)(offset, second));
        VEC inside_t = NAMED(dot)(normal, NAMED(cross)(first, offset));

        VEC3 residual = NAMED(subtract)(offset, on_first, first);
        VEC square = NAMED(dot)(residual, residual), s = on_first, t = {0};

        residual = NAMED(subtract)(offset, on_second, second);
        VEC other = NAMED(dot)(residual, residual);
        MASK is_less = other < square;
        square = SELECT(is_less, other, square);
        s = (VEC)((MASK)s & ~is_less);
        t = SELECT(is_less, on_second, t);

        residual = NAMED(subtract)(end, on_third, third);
        other = NAMED(dot)(residual, residual);
        is_less = other < square;
        square = SELECT(is_less, other, square);
        s = SELECT(is_less, 1.0 - on_third, s);
        t = SELECT(is_less, on_third, t);

        residual = NAMED(subtract)(NAMED(subtract)(offset, inside_s, first), inside_t, second);
        other = NAMED(dot)(residual, residual);
        is_less = (other < square) & (inside_s >= 0.0) & (inside_t >= 0.0) &
                  (inside_s + inside_t <= 1.0);
        square = SELECT(is_less, other, square);
        s = SELECT(is_less, inside_s, s);
        t = SELECT(is_less, inside_t, t);

        MASK is_candidate = square <= nearest->square;
        if (direction) { /* product / |normal| >= 1, squared to avoid the root */
            VEC3 along = {(VEC){0} + direction[0], (VEC){0} + direction[1],
                          (VEC){0} + direction[2]};
            VEC product = NAMED(dot)(normal, along);
            is_candidate &= (product > 0.0) & (product * product >= NAMED(dot)(normal, normal));
        }
        uint32_t bits = NAMED(bits_of)(is_candidate);
        for (; bits; bits &= bits - 1) {
            int lane = __builtin_ctz(bits);
            int64_t face = leaf->face[i + lane];
            if (square[lane] < nearest->square ||
                (square[lane] == nearest->square && face < nearest->face)) {
                *nearest = (nearest_point){square[lane], s[lane], t[lane], face, number, i + lane};
            }
        }
    }
}

/* Find the point of the surface nearest to a point; the search starts in the leaf `nearest->leaf`.
   Without a face in reach, `nearest->face` is INT64_MAX. */
TARGET REEL_INLINE void NAMED(search_point)(const search_job *job, int64_t number,
                                            nearest_point *nearest) {
    const triangle_tree *tree = &job->tree;
    const double *point = job->points + 3 * number;
    const double *direction = job->directions ? job->directions + 3 * number : NULL;
    pending_node pending[MAX_PENDING];
    int n_pending = 1;
    pending[0] = (pending_node){0.0, 0, tree->n_levels - 1};
    *nearest = (nearest_point){job->reach_square, 0.0, 0.0, INT64_MAX, nearest->leaf, 0};
    int64_t first_leaf = nearest->leaf;
    NAMED(search_leaf)(tree->leaves, first_leaf, point, direction, nearest);
    double bound = nearest->square * (1.0 + SLACK) + job->slack;
    while (n_pending) {
        pending_node node = pending[--n_pending];
        if (node.square >= bound) {
            continue;
        }
        if (node.level < 0) {
            if (node.number != first_leaf) {
                NAMED(search_leaf)(tree->leaves, node.number, point, direction, nearest);
                bound = nearest->square * (1.0 + SLACK) + job->slack;
            }
            continue;
        }
        double squares[FANOUT] __attribute__((aligned(REEL_ALIGNMENT)));
        uint32_t bits =
            NAMED(near_boxes)(tree->levels[node.level] + node.number, point, bound, squares);
        int first = n_pending;
        for (; bits; bits &= bits - 1) { /* descending, so that the nearest box is popped first */
            int child = __builtin_ctz(bits), index = n_pending++;
            for (; index > first && pending[index - 1].square < squares[child]; index--) {
                pending[index] = pending[index - 1];
            }
            pending[index] =
                (pending_node){squares[child], FANOUT * node.number + child, node.level - 1};
        }
    }
}

TARGET static void NAMED(search)(const search_job *job) {
    nearest_point nearest = {.leaf = 0}; /* then the leaf of the previous point, which is nearby */
    for (int64_t i = 0; i < job->n_points; i++) {
        int64_t point = (int64_t)(job->order[i] & UINT32_MAX);
        NAMED(search_point)(job, point, &nearest);
        write_point(job, point, &nearest);
    }
}

#undef VEC
#undef VEC3
#undef MASK
#undef LOAD
#undef SELECT
#undef POSITIVE_PART
#undef LANES
