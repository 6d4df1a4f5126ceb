// sii_from_capture: rebuilds the SII images of the slaves in a recording from the EEPROM data that the master read,
// and writes a segment description for these images.
#include "common/arguments.hpp"
#include "common/capture_slaves.hpp"
#include "common/counted.hpp"
#include "common/program.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>

namespace {

using namespace margay::samples;

bool write_file(const std::filesystem::path& path, const char* data, std::size_t size) {
    std::ofstream out(path, std::ios::binary);
    out.write(data, static_cast<std::streamsize>(size));
    out.close();
    return static_cast<bool>(out);
}

int rebuild(const std::string& recording, const std::string& folder) {
    const auto capture = load_capture(recording);
    if (!capture.error.empty()) return fail(capture.error, exit_code::kSystem);
    if (!capture.remark.empty()) warn("note: " + capture.remark);
    const auto slaves = slaves_of(capture);
    if (slaves.empty()) return fail(fmt::format("{}: {}", recording, no_slaves_reason(capture)));
    std::error_code problem;
    std::filesystem::create_directories(folder, problem);
    if (problem)
        return fail(fmt::format("cannot make the folder {}: {}", folder, problem.message()), exit_code::kSystem);
    for (const auto& slave : slaves) {
        const auto path = std::filesystem::path(folder) / fmt::format("slave{}.bin", slave.position + 1);
        if (!write_file(path, reinterpret_cast<const char*>(slave.sii.data()), slave.sii.size()))
            return fail(fmt::format("cannot write {}", path.string()), exit_code::kSystem);
        print_out("{}: {}, {} of them read in the recording\n", path.string(), counted(slave.sii.size(), "octet"),
                  slave.sii_octets_read);
    }
    const auto text = describe_segment(slaves, std::filesystem::path(recording).filename().string());
    const auto path = std::filesystem::path(folder) / "segment.toml";
    if (!write_file(path, text.data(), text.size()))
        return fail(fmt::format("cannot write {}", path.string()), exit_code::kSystem);
    print_out("{}\n", path.string());
    return exit_code::kWell;
}

}  // namespace

int main(int argc, char** argv) {
    Arguments arguments("sii_from_capture",
                        "Rebuilds SII images (slaveN.bin) and a segment description (segment.toml) from a recording.");
    std::string recording;
    std::string folder;
    arguments.positional("CAPTURE", recording, "pcap or pcapng file with both ways of the traffic");
    arguments.positional("FOLDER", folder, "folder for the files; created if it does not exist");
    return arguments.run(argc, argv, [&] { return rebuild(recording, folder); });
}
