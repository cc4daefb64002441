/* Write the positions of all frames of a .reel file as float32: `frames FILE > positions`. */
#include <meshreel.h>
#include <stdio.h>
#include <stdlib.h>

static void need(int code, const meshreel_error *error) {
    if (code != MESHREEL_OK) {
        fprintf(stderr, "%s\n", error->message);
        exit(1);
    }
}

/* Allocate memory aligned to 64 bytes, preceded by the address of the whole block. */
static void *allocate(void *user, size_t size) {
    char *whole = (char *)malloc(size + 64 + sizeof(void *)), *aligned;
    (void)user;
    if (!whole) {
        return NULL;
    }
    aligned = whole + sizeof(void *);
    aligned += 63 - ((uintptr_t)aligned + 63) % 64;
    ((void **)aligned)[-1] = whole;
    return aligned;
}

static void release(void *user, void *memory, size_t size) {
    (void)user;
    (void)size;
    free(((void **)memory)[-1]);
}

static int read_bytes(void *user, uint64_t offset, void *to, size_t size) {
    FILE *input = (FILE *)user;
    return fseek(input, (long)offset, SEEK_SET) || fread(to, 1, size, input) != size;
}

int main(int count, char **words) {
    FILE *input = count > 1 ? fopen(words[1], "rb") : NULL;
    if (!input || fseek(input, 0, SEEK_END)) {
        fprintf(stderr, "usage: frames FILE > positions\n");
        return 1;
    }
    meshreel_source source = {NULL, (uint64_t)ftell(input), read_bytes, input, NULL};
    meshreel_host host = {NULL, allocate, release, NULL, 0, 0, 0};
    meshreel_layout floats = {MESHREEL_FLOAT32, 0, 0, 0}; /* converts doubles, too */
    meshreel_error error;
    meshreel_file *file;
    meshreel_decoder *decoder;
    need(meshreel_open(&source, &host, &file, &error), &error);
    need(meshreel_read_mesh(file, &error), &error);
    need(meshreel_begin(file, &decoder, &error), &error);
    const meshreel_info *info = meshreel_info_of(file);
    float *positions = (float *)malloc(info->n_verts * sizeof(float[3]));
    for (uint32_t frame = 0; frame < info->n_frames; frame++) {
        need(meshreel_decode(decoder, 0, frame, 1, 0, &floats, positions, &error), &error);
        fwrite(positions, sizeof(float[3]), info->n_verts, stdout);
    }
    free(positions);
    meshreel_end(decoder);
    meshreel_close(file);
    return fclose(input);
}
