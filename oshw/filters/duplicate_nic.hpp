// A filter that delivers frames twice, like a wrongly configured bridge or a second listener.
#pragma once

#include "oshw/filter_nic.hpp"
#include "oshw/filters/chance.hpp"

#include <algorithm>
#include <array>

namespace margay {

class DuplicateNic final : public FilterNic {
  public:
    struct Options {
        std::uint64_t seed = 1;
        Rate sent{};      // sent twice: the slaves process the frame twice
        Rate received{};  // received twice
    };

    DuplicateNic(Nic& inner, const Options& options) noexcept
        : FilterNic(inner), options_(options), chance_(options.seed) {}

    // Returns the status of the first of the two frames.
    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override {
        const auto status = inner().send(frame);
        if (chance_.happens(options_.sent) && status == SendStatus::sent && inner().send(frame) == SendStatus::sent)
            ++duplicated_;
        return status;
    }
    // The second copy is delivered immediately after the first, before all later frames.
    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override {
        if (length_ != 0) {
            const auto length = std::min(length_, into.size());
            std::copy_n(copy_.begin(), length, into.begin());
            length_ = 0;
            return length;
        }
        const auto length = inner().receive(into);
        if (length != 0 && chance_.happens(options_.received)) {
            length_ = std::min(length, copy_.size());
            std::copy_n(into.begin(), length_, copy_.begin());
            ++duplicated_;
        }
        return length;
    }
    // A waiting copy has already arrived; any time in the past reports this.
    [[nodiscard]] Time next_arrival() const noexcept override { return length_ != 0 ? Time{} : inner().next_arrival(); }

    [[nodiscard]] std::uint64_t duplicated() const noexcept { return duplicated_; }

  private:
    Options options_;
    Chance chance_;
    std::uint64_t duplicated_ = 0;
    std::size_t length_ = 0;
    std::array<std::byte, 1518> copy_;
};

}  // namespace margay
