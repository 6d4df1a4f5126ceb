// A filter that loses frames, like a wire with a bad contact.
#pragma once

#include "oshw/filter_nic.hpp"
#include "oshw/filters/chance.hpp"

namespace margay {

class DropNic final : public FilterNic {
  public:
    struct Options {
        std::uint64_t seed = 1;
        Rate sent{};      // lost before the first slave: no slave has processed the frame
        Rate received{};  // lost after the last slave: all slaves have processed the frame
    };

    DropNic(Nic& inner, const Options& options) noexcept : FilterNic(inner), options_(options), chance_(options.seed) {}

    // A lost frame is reported as sent, as by a real NIC.
    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override {
        if (!chance_.happens(options_.sent)) return inner().send(frame);
        ++dropped_;
        return SendStatus::sent;
    }
    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override {
        while (const auto length = inner().receive(into)) {
            if (!chance_.happens(options_.received)) return length;
            ++dropped_;
        }
        return 0;
    }

    [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

  private:
    Options options_;
    Chance chance_;
    std::uint64_t dropped_ = 0;
};

}  // namespace margay
