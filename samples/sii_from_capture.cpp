// Rebuilds the SII images of the slaves in a recording from what the master read of them, and a segment
// description to go with them.
#include "common/capture_slaves.hpp"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <filesystem>
#include <fstream>

namespace {

bool write_file(const std::filesystem::path& path, const char* data, std::size_t size) {
    std::ofstream out(path, std::ios::binary);
    out.write(data, static_cast<std::streamsize>(size));
    out.close();
    return static_cast<bool>(out);
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Rebuilds SII images (slaveN.bin) and a segment description (segment.toml) from a recording.");
    std::string recording;
    std::string folder;
    app.add_option("CAPTURE", recording, "pcap or pcapng file with both ways of the traffic")->required();
    app.add_option("FOLDER", folder, "where the files go; made when it is not there")->required();
    CLI11_PARSE(app, argc, argv);

    using namespace margay::samples;
    const auto capture = load_capture(recording);
    if (!capture.error.empty()) {
        fmt::print(stderr, "{}\n", capture.error);
        return 1;
    }
    if (!capture.remark.empty()) fmt::print(stderr, "note: {}\n", capture.remark);
    const auto slaves = slaves_of(capture);
    if (slaves.empty()) {
        fmt::print(stderr, "{}: {}\n", recording, why_no_slaves(capture));
        return 1;
    }
    std::error_code problem;
    std::filesystem::create_directories(folder, problem);
    if (problem) {
        fmt::print(stderr, "cannot make the folder {}: {}\n", folder, problem.message());
        return 1;
    }
    for (const auto& slave : slaves) {
        const auto path = std::filesystem::path(folder) / fmt::format("slave{}.bin", slave.position + 1);
        if (!write_file(path, reinterpret_cast<const char*>(slave.sii.data()), slave.sii.size())) {
            fmt::print(stderr, "cannot write {}\n", path.string());
            return 1;
        }
        fmt::print("{}: {} octets, {} of them read in the recording\n", path.string(), slave.sii.size(),
                   slave.sii_octets_read);
    }
    const auto text = describe_segment(slaves, std::filesystem::path(recording).filename().string());
    const auto path = std::filesystem::path(folder) / "segment.toml";
    if (!write_file(path, text.data(), text.size())) {
        fmt::print(stderr, "cannot write {}\n", path.string());
        return 1;
    }
    fmt::print("{}\n", path.string());
    return 0;
}
