// Decode all tracks of files with two decoders on two threads, which share a host with two threads:
// `two_decoders FILE...`. tests/conformance builds it with the thread sanitizer.
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "meshreel_threads.hpp"

static void need(int code, const meshreel_error &error) {
    if (code != MESHREEL_OK) {
        std::fprintf(stderr, "%s\n", error.message);
        std::exit(2);
    }
}

static std::vector<unsigned char> decode(const meshreel_file *file) {
    const meshreel_info &info = *meshreel_info_of(file);
    std::vector<unsigned char> all;
    meshreel_error error;
    meshreel_decoder *decoder;
    need(meshreel_begin(file, &decoder, &error), error);
    for (uint32_t number = 0; number < info.n_tracks; number++) {
        meshreel_track track;
        meshreel_track_of(file, number, &track);
        const size_t value = size_t(track.type & 15) * track.n_columns;
        std::vector<double> values(value * track.n_items * info.n_frames / sizeof(double) + 1);
        need(meshreel_decode(decoder, number, 0, info.n_frames, 0, nullptr, values.data(), &error),
             error);
        const unsigned char *begin = reinterpret_cast<const unsigned char *>(values.data());
        all.insert(all.end(), begin, begin + value * track.n_items * info.n_frames);
    }
    meshreel_end(decoder);
    return all;
}

static bool decode_twice(const char *name) {
    std::ifstream stream(name, std::ios::binary);
    const std::vector<char> bytes{std::istreambuf_iterator<char>(stream), {}};
    const meshreel_source source = {bytes.data(), bytes.size(), nullptr, nullptr,
                                    nullptr};
    const meshreel::Host host(2), alone(1);
    std::vector<unsigned char> found[2], wanted;
    meshreel_error error;
    meshreel_file *file;
    need(meshreel_open(&source, host.get(), &file, &error), error);
    need(meshreel_read_surface(file, &error), error);
    std::thread other([&] { found[1] = decode(file); });
    found[0] = decode(file);
    other.join();
    meshreel_close(file);
    need(meshreel_open(&source, alone.get(), &file, &error), error);
    need(meshreel_read_mesh(file, &error), error);
    wanted = decode(file);
    meshreel_close(file);
    return found[0] == wanted && found[1] == wanted;
}

int main(int count, char **names) {
    for (int i = 1; i < count; i++) {
        if (!decode_twice(names[i])) {
            std::fprintf(stderr, "%s differs between threads\n", names[i]);
            return 1;
        }
    }
}
