// Changes frames. On a real wire the FCS catches this and the frame is lost; what is let through here is what
// broken switches, drivers and memory do, and what a master must survive.
#pragma once

#include "oshw/filter_nic.hpp"
#include "oshw/filters/chance.hpp"

#include <array>

namespace margay {

class CorruptNic final : public FilterNic {
  public:
    struct Options {
        std::uint64_t seed = 1;
        Rate sent{};                  // frames changed on the way to the segment
        Rate received{};              // frames changed on the way back
        std::uint32_t max_flips = 8;  // 1 to so many bits are turned over
        Rate cut{};                   // of the changed frames, those that are cut short instead
        std::size_t from_octet = 0;   // the first octet that may be hit: 14 spares the Ethernet header
    };

    CorruptNic(Nic& inner, const Options& options) noexcept
        : FilterNic(inner), options_(options), chance_(options.seed) {}

    // Frames of more than 1518 octets, which the contract does not allow, pass as they are.
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
