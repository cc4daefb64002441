/* Play a .reel file in a window with SDL 2: `play FILE [FRAMES]`. */
#include <SDL.h>
#include <meshreel.h>
#include <stdio.h>
#include <stdlib.h>

enum { SIZE = 640 };
static float *positions, *normals;

static void need(int code, const meshreel_error *error) {
    if (code != MESHREEL_OK) {
        fprintf(stderr, "%s\n", error->message);
        exit(1);
    }
}
static void *allocate(void *user, size_t size) {
    (void)user;
    return aligned_alloc(64, (size + 63) / 64 * 64);
}
static void release(void *user, void *memory, size_t size) {
    (void)user, (void)size;
    free(memory);
}
static float depth(const uint32_t *t) {
    return positions[3 * t[0] + 2] + positions[3 * t[1] + 2] + positions[3 * t[2] + 2];
}
static int farthest_first(const void *one, const void *other) {
    return (depth(one) > depth(other)) - (depth(one) < depth(other));
}

int main(int count, char **words) {
    size_t size = 0, corners = sizeof(uint32_t[3]);
    void *bytes = count > 1 ? SDL_LoadFile(words[1], &size) : NULL;
    meshreel_source source = {.bytes = bytes, .size = size};
    meshreel_host host = {.allocate = allocate, .release = release};
    meshreel_layout floats = {.type = MESHREEL_FLOAT32}; /* converts doubles, too */
    meshreel_error error;
    meshreel_file *file;
    meshreel_decoder *decoder;
    need(meshreel_open(&source, &host, &file, &error), &error);
    need(meshreel_read_mesh(file, &error), &error);
    need(meshreel_begin(file, &decoder, &error), &error);
    meshreel_info info = *meshreel_info_of(file);
    positions = malloc(info.n_verts * sizeof(float[3]));
    normals = malloc(info.n_verts * sizeof(float[3]));
    SDL_Vertex *vertices = calloc(info.n_verts, sizeof *vertices);
    int *triangles = SDL_memcpy(malloc(info.n_triangles * corners), meshreel_triangles(file),
                                info.n_triangles * corners); /* a copy to sort */
    SDL_Init(SDL_INIT_VIDEO);
    SDL_Window *window = SDL_CreateWindow("meshreel", 0, 0, SIZE, SIZE, 0);
    SDL_Renderer *renderer = SDL_CreateRenderer(window, -1, 0);
    double fps = info.fps > 0 ? info.fps : 25, scale = SIZE / info.diagonal;
    long limit = count > 2 ? atol(words[2]) : -1, shown = 0;
    for (SDL_Event event = {0}; event.type != SDL_QUIT && shown != limit; shown++) {
        uint32_t frame = (uint32_t)(SDL_GetTicks() * fps / 1000) % info.n_frames;
        need(meshreel_decode(decoder, 0, frame, 1, 0, &floats, positions, &error), &error);
        need(meshreel_normals(decoder, MESHREEL_FLOAT32, positions, normals, &error), &error);
        for (uint32_t v = 0; v < info.n_verts; v++) { /* view and light along z */
            const float *at = positions + 3 * v, light = SDL_fabsf(normals[3 * v + 2]);
            vertices[v].position.x = (float)(SIZE / 2 + scale * (at[0] - info.center[0]));
            vertices[v].position.y = (float)(SIZE / 2 - scale * (at[1] - info.center[1]));
            vertices[v].color = (SDL_Color){(Uint8)(255 * light), (Uint8)(200 * light), 90, 255};
        }
        qsort(triangles, info.n_triangles, corners, farthest_first);
        SDL_RenderClear(renderer);
        SDL_RenderGeometry(renderer, NULL, vertices, (int)info.n_verts, triangles,
                           (int)(3 * info.n_triangles));
        SDL_RenderPresent(renderer);
        SDL_PollEvent(&event);
    }
    return printf("%ld frames of %u vertices\n", shown, info.n_verts) < 0;
}
