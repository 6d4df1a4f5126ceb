// Delivers frames twice: what a bridge that learns the wrong thing, or a second listener, does.
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
        Rate sent{};      // sent twice: the segment acts twice
        Rate received{};  // received twice
    };

    DuplicateNic(Nic& inner, const Options& options) noexcept
        : FilterNic(inner), options_(options), chance_(options.seed) {}

    // The answer is that for the first of the two.
    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override {
        const auto status = inner().send(frame);
        if (chance_.happens(options_.sent) && status == SendStatus::sent && inner().send(frame) == SendStatus::sent)
            ++duplicated_;
        return status;
    }
    // The second one is there at once, ahead of all frames behind the first.
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
    // A duplicate that waits is there already, which any time in the past says.
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
