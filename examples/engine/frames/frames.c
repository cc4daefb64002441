/* Writes the positions of all frames of a .reel file, as float32: `frames FILE > positions`. */
#include <meshreel.h>
#include <stdio.h>
#include <stdlib.h>

static void need(int code) {
    if (code != MESHREEL_OK) {
        fprintf(stderr, "%s\n", meshreel_words(code));
        exit(1);
    }
}

/* Bytes of the file as they are asked for. */
static int read_bytes(void *user, uint64_t offset, void *to, size_t size) {
    FILE *given = (FILE *)user;
    return fseek(given, (long)offset, SEEK_SET) || fread(to, 1, size, given) != size;
}

int main(int count, char **words) {
    FILE *given = count > 1 ? fopen(words[1], "rb") : NULL;
    if (!given || fseek(given, 0, SEEK_END)) {
        fprintf(stderr, "usage: frames FILE > positions\n");
        return 1;
    }
    meshreel_source source = {NULL, (uint64_t)ftell(given), read_bytes, given};
    meshreel_info info;
    const meshreel_file *file;
    meshreel_decoder *decoder;
    need(meshreel_inspect(&source, &info));
    need(meshreel_open(&source, malloc(info.file_bytes), info.file_bytes, &file));
    need(meshreel_begin(file, malloc(info.decoder_bytes), info.decoder_bytes, &decoder));
    float *positions = (float *)malloc(info.n_verts * sizeof(float[3]));
    for (uint32_t frame = 0; frame < info.n_frames; frame++) {
        need(meshreel_decode(decoder, frame, positions));
        fwrite(positions, sizeof(float[3]), info.n_verts, stdout);
    }
    return fclose(given);
}
