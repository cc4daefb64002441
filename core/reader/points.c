/* Points of items, and the weights that follow from them: docs/format.md, "Weights from points". */

#include "points.h"

#define MAX_TASK 4096 /* vertices per task */

/* Positions of one frame in output order. */
typedef struct {
    const void *numbers;
    uint32_t size;
} positions;

static double coordinate(const positions *p, uint64_t index) {
    return p->size == 4 ? (double)((const float *)p->numbers)[index]
                        : ((const double *)p->numbers)[index];
}

/* Mean of some vertices. */
static void mean_of(const positions *p, const int32_t *vertices, int64_t n, double *point) {
    for (uint64_t axis = 0; axis < 3; axis++) {
        double sum = 0.0;
        for (int64_t i = 0; i < n; i++) {
            sum += coordinate(p, 3 * (uint64_t)vertices[i] + axis);
        }
        point[axis] = sum / (double)n;
    }
}

/* Find the points of all items; `rows` are their places in coding order. */
static void find_points(const meshreel_file *file, const reel_track *track,
                        const reel_items *items, const int32_t *rows, const positions *p,
                        double *points) {
    if (REEL_IS_COMPLETE && track->info.domain == MESHREEL_CELLS) {
        const int32_t *nodes = (const int32_t *)file->mesh.cells.nodes;
        for (uint64_t i = 0; i < items->graph.n_items; i++) {
            int64_t size = reel_cell_size(file->mesh.cells.types[i]);
            mean_of(p, nodes, size, points + 3 * rows[i]);
            nodes += size;
        }
        return;
    }
    if (track->info.domain == MESHREEL_FACES) {
        const int32_t *triangles = (const int32_t *)file->mesh.triangles;
        for (uint64_t i = 0, end; i < file->outline.n_faces; i = end) {
            for (end = i + 1; end < file->outline.n_faces;) {
                if (items->polygon[end] != items->polygon[i]) {
                    break;
                }
                end++;
            }
            mean_of(p, triangles + 3 * i, 3 * (int64_t)(end - i),
                    points + 3 * rows[items->polygon[i]]);
        }
        return;
    }
    const int32_t *vertices = items->vertex ? items->vertex : items->inverse;
    for (uint64_t i = 0; i < items->graph.n_items; i++) {
        mean_of(p, vertices + i, 1, points + 3 * rows[i]);
    }
}

typedef struct {
    const reel_mesh *mesh;
    const double *points;
    double nugget;
    float *weights;
} weights_job;

static void weights_task(void *shared, uint32_t i) {
    const weights_job *job = shared;
    int64_t first = (int64_t)i * MAX_TASK, last = first + MAX_TASK, n = job->mesh->n_verts;
    reel_kriging(job->mesh, job->points, job->nugget, first, last < n ? last : n, job->weights);
}

int reel_find_weights(reel_call *call, const meshreel_file *file, const reel_track *track,
                      const reel_items *items, const reel_field_mesh *field_mesh,
                      const void *numbers, double nugget, const float **weights) {
    const reel_mesh *mesh = &field_mesh->mesh;
    uint64_t n = (uint64_t)mesh->n_verts, size = (uint64_t)mesh->stencil_size;
    float *results = reel_scratch(call, n * size, sizeof *results);
    const reel_chunk *mark = call->scratch.last;
    double *points = reel_scratch(call, 3 * n, sizeof *points);
    REEL_NEED(results && points);
    const positions p = {numbers, file->outline.number_bytes};
    find_points(file, track, items, field_mesh->positions, &p, points);
    weights_job job = {mesh, points, nugget, results};
    reel_run(call, weights_task, &job, (uint32_t)((n + MAX_TASK - 1) / MAX_TASK), n * size * size);
    reel_drop_scratch(call, mark);
    *weights = results;
    return MESHREEL_OK;
}
