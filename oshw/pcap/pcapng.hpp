// Packets of several interfaces in one file, with the interface and the direction of each packet, which libpcap neither
// writes nor reads.
#pragma once

#include "util/bytes.hpp"

#include <margay/result.hpp>
#include <margay/time.hpp>

#include <cstdint>
#include <cstdio>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace margay {

// The facts of a pcapng file about a packet, beside its octets.
struct PacketOrigin {
    enum class Direction : std::uint8_t {
        unknown,
        received,
        sent,
        refused  // the NIC has not accepted the frame; the file contains it as a sent frame with a comment
    };
    std::uint32_t interface = 0;  // number among the Ethernet interfaces of the file
    Direction direction = Direction::unknown;
};

// Writes a pcapng file of Ethernet frames with time stamps in nanoseconds.
class PcapngWriter {
  public:
    // Creates the file with an interface for each name, and overwrites an existing file. Allocates memory.
    [[nodiscard]] Result<> open(const std::string& path, std::span<const std::string_view> interfaces);
    // `at`: since 1970. An error of the file is reported by close().
    void write(const PacketOrigin& origin, Duration at, std::span<const std::byte> frame) noexcept;
    // An error means that the file is not complete. It is no error to close twice or without open().
    [[nodiscard]] Result<> close();
    // One sentence about the last error; empty if there was none.
    [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

  private:
    struct Closer {
        void operator()(std::FILE* file) const { (void)std::fclose(file); }
    };
    [[nodiscard]] Result<> fail(const std::string& what);

    std::unique_ptr<std::FILE, Closer> file_;
    std::string path_;
    std::string problem_;
};

}  // namespace margay
