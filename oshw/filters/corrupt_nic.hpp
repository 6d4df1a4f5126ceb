// A filter that changes frames. On a real wire the FCS detects such errors and the frame is lost; this filter simulates
// broken switches, drivers and memory, which a master must tolerate.
#pragma once

#include "oshw/filter_nic.hpp"
#include "oshw/filters/chance.hpp"

#include <array>

namespace margay {

class CorruptNic final : public FilterNic {
  public:
    struct Options {
        std::uint64_t seed = 1;
        Rate sent{};                  // share of the frames to the segment that are changed
        Rate received{};              // share of the received frames that are changed
        std::uint32_t max_flips = 8;  // 1 to max_flips bits are inverted
        Rate cut{};                   // share of the changed frames that are shortened instead
        std::size_t from_octet = 0;   // the first octet that may be changed; 14 leaves the Ethernet header unchanged
    };

    CorruptNic(Nic& inner, const Options& options) noexcept
        : FilterNic(inner), options_(options), chance_(options.seed) {}

    // Frames longer than 1518 octets, which the NIC interface does not permit, are not changed.
    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override;
    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override;

    [[nodiscard]] std::uint64_t corrupted() const noexcept { return corrupted_; }

  private:
    [[nodiscard]] std::size_t corrupt(std::span<std::byte> frame) noexcept;

    Options options_;
    Chance chance_;
    std::uint64_t corrupted_ = 0;
    std::array<std::byte, 1518> buffer_;
};

}  // namespace margay
