// Decode a .reel file on several threads, and print its contents: `threads FILE`.
#include <meshreel.h>
#include <meshreel_threads.hpp>

#include <cstdio>
#include <fstream>
#include <iterator>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

static void need(int code, const meshreel_error &error) {
    if (code != MESHREEL_OK) {
        throw std::runtime_error(error.message);
    }
}

struct Close {
    void operator()(meshreel_file *file) const { meshreel_close(file); }
    void operator()(meshreel_decoder *decoder) const { meshreel_end(decoder); }
};

static void decode(const std::string &name) {
    std::ifstream stream(name, std::ios::binary);
    const std::vector<char> bytes{std::istreambuf_iterator<char>(stream), {}};
    const meshreel_source source = {bytes.data(), bytes.size(), nullptr, nullptr, nullptr};
    const meshreel::Host host(0, uint64_t(1) << 30); // one thread per core; at most 1 GiB
    meshreel_error error;

    meshreel_file *opened = nullptr;
    need(meshreel_open(&source, host.get(), &opened, &error), error);
    const std::unique_ptr<meshreel_file, Close> file(opened);
    const meshreel_info &info = *meshreel_info_of(file.get());
    need(meshreel_read_surface(file.get(), &error), error); // includes the triangles
    const meshreel_surface &surface = *meshreel_surface_of(file.get());
    std::printf("%u triangles, %u attributes\n", info.n_triangles, surface.n_attributes);

    meshreel_decoder *begun = nullptr;
    need(meshreel_begin(file.get(), &begun, &error), error);
    const std::unique_ptr<meshreel_decoder, Close> decoder(begun);

    // Positions as floats in vertices of 8 numbers, followed by normals.
    const meshreel_layout packed = {MESHREEL_FLOAT32, 0, 0, 0};
    const meshreel_layout in_vertices = {MESHREEL_FLOAT32, 0, 8 * sizeof(float), 0};
    std::vector<float> positions(3 * size_t(info.n_verts)), normals(positions.size());
    std::vector<float> vertices(8 * size_t(info.n_verts));
    for (uint32_t frame = 0; frame < info.n_frames; frame++) {
        need(meshreel_decode(decoder.get(), 0, frame, 1, 0, &packed, positions.data(), &error),
             error);
        need(meshreel_normals(decoder.get(), MESHREEL_FLOAT32, positions.data(), normals.data(),
                              &error),
             error);
        need(meshreel_decode(decoder.get(), 0, frame, 1, 0, &in_vertices, vertices.data(), &error),
             error);
        for (size_t i = 0; i < positions.size(); i++) {
            vertices[8 * (i / 3) + 3 + i % 3] = normals[i];
        }
    }
    std::printf("%u frames of %u vertices\n", info.n_frames, info.n_verts);

    for (uint32_t number = 1; number < info.n_tracks; number++) {
        meshreel_track track;
        meshreel_track_of(file.get(), number, &track);
        const size_t size = size_t(track.type & 15) * track.n_columns * track.n_items;
        std::vector<double> values(size * info.n_frames / sizeof(double) + 1);
        need(meshreel_decode(decoder.get(), number, 0, info.n_frames, 0, nullptr, values.data(),
                             &error),
             error);
        std::printf("track %.*s: %u values of %u numbers\n", int(track.name.size),
                    track.name.bytes, track.n_items, track.n_columns);
    }
}

int main(int count, char **words) {
    try {
        decode(count > 1 ? words[1] : "");
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
}
