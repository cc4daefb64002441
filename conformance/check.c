/* Decode a file with meshreel.h: `check IN.reel OUT`, for machines without Python.

   OUT is a sequence of arrays, each preceded by its size in bytes (uint64): the triangles (uint32);
   the number of corners of each face, and the face corner at each corner of the triangles (uint32;
   both empty if all faces are triangles); for each attribute its
   values and the row of each item (int32; empty if each has its own); for each group the label of
   each face (int32); and for each track, positions first, the values of all frames. Files of the
   paper's methods have no tracks here. */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "meshreel.h"

static void fail(const char *what) {
    fprintf(stderr, "%s\n", what);
    exit(1);
}

static void need(int code, const meshreel_error *error) {
    if (code != MESHREEL_OK) {
        fail(error->message);
    }
}

static void *allocate(void *user, size_t size) {
    (void)user;
    return aligned_alloc(64, (size + 63) / 64 * 64);
}

static void release(void *user, void *memory, size_t size) {
    (void)user;
    (void)size;
    free(memory);
}

static void *allocate_array(uint64_t size) {
    void *memory = malloc(size ? (size_t)size : 1);
    if (!memory) {
        fail("out of memory");
    }
    return memory;
}

static void write_array(FILE *out, const void *values, uint64_t size) {
    fwrite(&size, sizeof size, 1, out);
    if (size) {
        fwrite(values, 1, (size_t)size, out);
    }
}

static uint64_t size_of(uint32_t type) { return type & 15U; }

static void write_attribute(FILE *out, const meshreel_attribute *attribute) {
    uint64_t row = attribute->width * size_of(attribute->type), n_items = attribute->n_items;
    if (attribute->is_indexed || !attribute->rows) {
        write_array(out, attribute->values, attribute->n_rows * row);
        write_array(out, attribute->rows, attribute->rows ? n_items * sizeof *attribute->rows : 0);
        return;
    }
    uint8_t *values = allocate_array(n_items * row);
    for (uint64_t i = 0; i < n_items; i++) {
        memcpy(values + i * row, (const uint8_t *)attribute->values + (uint64_t)attribute->rows[i] * row, row);
    }
    write_array(out, values, n_items * row);
    write_array(out, NULL, 0);
    free(values);
}

static void write_surface(FILE *out, const meshreel_info *info, const meshreel_surface *surface) {
    uint64_t n_faces = info->n_faces;
    write_array(out, surface->face_sizes, surface->face_sizes ? n_faces * sizeof(uint32_t) : 0);
    write_array(out, surface->triangle_corners,
                surface->triangle_corners ? 3 * (uint64_t)info->n_triangles * sizeof(uint32_t) : 0);
    for (uint32_t i = 0; i < surface->n_attributes; i++) {
        write_attribute(out, &surface->attributes[i]);
    }
    for (uint32_t i = 0; i < surface->n_groups; i++) {
        write_array(out, surface->groups[i].of_faces, n_faces * sizeof(int32_t));
    }
}

enum { FIRST_WITH_TRACKS = 7 }; /* methods below are those of the paper */

static void write_tracks(FILE *out, const meshreel_file *file) {
    const meshreel_info *info = meshreel_info_of(file);
    meshreel_decoder *decoder;
    meshreel_error error;
    need(meshreel_begin(file, &decoder, &error), &error);
    for (uint32_t i = 0; i < info->n_tracks; i++) {
        meshreel_track track;
        need(meshreel_track_of(file, i, &track), &error);
        uint64_t value = track.n_columns * size_of(track.type);
        uint64_t size = value * track.n_items * info->n_frames;
        void *values = allocate_array(size);
        need(meshreel_decode(decoder, i, 0, info->n_frames, 0, NULL, values, &error), &error);
        write_array(out, values, size);
        free(values);
    }
    meshreel_end(decoder);
}

static meshreel_source whole_file(const char *name) {
    FILE *file = fopen(name, "rb");
    if (!file || fseek(file, 0, SEEK_END)) {
        fail("cannot open the file");
    }
    size_t size = (size_t)ftell(file);
    void *bytes = allocate_array(size);
    rewind(file);
    if (fread(bytes, 1, size, file) != size) {
        fail("cannot read the file");
    }
    fclose(file);
    return (meshreel_source){.bytes = bytes, .size = size};
}

int main(int count, char **names) {
    FILE *out = count == 3 ? fopen(names[2], "wb") : NULL;
    if (!out) {
        fail("usage: check IN.reel OUT");
    }
    meshreel_source source = whole_file(names[1]);
    meshreel_host host = {.allocate = allocate, .release = release};
    meshreel_file *file;
    meshreel_error error;
    need(meshreel_open(&source, &host, &file, &error), &error);
    need(meshreel_read_surface(file, &error), &error);
    const meshreel_info *info = meshreel_info_of(file);
    write_array(out, meshreel_triangles(file), 3 * sizeof(uint32_t) * (uint64_t)info->n_triangles);
    write_surface(out, info, meshreel_surface_of(file));
    if (info->method >= FIRST_WITH_TRACKS) {
        write_tracks(out, file);
    }
    meshreel_close(file);
    free((void *)source.bytes);
    return fclose(out) ? 1 : 0;
}
