// Files for the tests of recordings, written octet by octet from the description of the format, without the library
// under test.
#pragma once

#include "oshw/pcap/capture_file.hpp"

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace margay {

using Frame = std::vector<std::byte>;

// A folder of this process, removed with its content.
class TemporaryFolder {
  public:
    TemporaryFolder() : path_(std::filesystem::temp_directory_path() / ("margay-test-" + std::to_string(::getpid()))) {
        std::filesystem::create_directories(path_);
    }
    ~TemporaryFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;

    [[nodiscard]] std::string file(const std::string& name) const { return path_ / name; }
    std::string write(const std::string& name, const std::string& content) const {
        std::ofstream(file(name), std::ios::binary) << content;
        return file(name);
    }

  private:
    std::filesystem::path path_;
};

inline std::string read_file(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

inline std::string word32(std::uint32_t value) {
    std::string out;
    for (int i = 0; i < 4; ++i) out += static_cast<char>(value >> (8 * i));
    return out;
}
inline std::string word16(std::uint16_t value) { return word32(value).substr(0, 2); }
inline std::string octets(Bytes frame) { return {reinterpret_cast<const char*>(frame.data()), frame.size()}; }

// pcap, little-endian. The magic number gives the unit of the second field of a time stamp.
inline constexpr std::uint32_t kMicroseconds = 0xA1B2C3D4;
inline constexpr std::uint32_t kNanoseconds = 0xA1B23C4D;
inline constexpr std::uint32_t kEthernet = 1;

inline std::string pcap_header(std::uint32_t magic = kNanoseconds, std::uint32_t link_type = kEthernet) {
    return word32(magic) + word16(2) + word16(4) + word32(0) + word32(0) + word32(65535) + word32(link_type);
}
inline std::string pcap_packet(std::uint32_t seconds, std::uint32_t fraction, Bytes frame, std::size_t on_wire = 0) {
    return word32(seconds) + word32(fraction) + word32(static_cast<std::uint32_t>(frame.size())) +
           word32(static_cast<std::uint32_t>(on_wire == 0 ? frame.size() : on_wire)) + octets(frame);
}

// pcapng: section header, one interface with time stamps of 10^-resolution seconds, packets.
inline std::string pcapng_block(std::uint32_t type, std::string body) {
    body.resize((body.size() + 3) / 4 * 4);
    const auto length = static_cast<std::uint32_t>(body.size() + 12);
    return word32(type) + word32(length) + body + word32(length);
}
inline std::string pcapng_header(std::uint8_t resolution) {
    const auto section = word32(0x1A2B3C4D) + word16(1) + word16(0) + word32(0xFFFFFFFF) + word32(0xFFFFFFFF);
    const auto option = word16(9) + word16(1) + std::string(1, static_cast<char>(resolution)) + std::string(3, '\0');
    const auto interface = word16(kEthernet) + word16(0) + word32(0) + option + word32(0);
    return pcapng_block(0x0A0D0D0A, section) + pcapng_block(1, interface);
}
inline std::string pcapng_packet(std::uint64_t time, Bytes frame) {
    const auto size = static_cast<std::uint32_t>(frame.size());
    return pcapng_block(6, word32(0) + word32(static_cast<std::uint32_t>(time >> 32)) +
                               word32(static_cast<std::uint32_t>(time)) + word32(size) + word32(size) + octets(frame));
}

}  // namespace margay
