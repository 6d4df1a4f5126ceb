// A histogram of durations. Each power of two has 16 buckets, so every quantile is correct to 6.25 % from nanoseconds
// to hours, with a fixed amount of memory. Recording takes a few instructions and is callable from the cycle; only one
// thread may record.
#pragma once

#include <margay/time.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

class DurationHistogram {
  public:
    struct Bucket {
        Duration from{};  // the smallest duration in the bucket
        Duration to{};    // the smallest duration above the bucket
        std::uint64_t count = 0;
    };

    // Negative durations count as zero.
    constexpr void record(Duration duration) {
        const auto ns = static_cast<std::uint64_t>(std::max<Duration::rep>(duration.count(), 0));
        ++counts_[std::min(index(ns), kBuckets - 1)];
        ++count_;
        sum_ += ns;
        most_ = std::max(most_, ns);
        least_ = std::min(least_, ns);
    }
    constexpr void clear() { *this = {}; }

    // Copies the content of another histogram, for example from a file: its buckets that have a count, in their order,
    // and its shortest, mean and longest duration. False when this class has no such buckets, or when the durations
    // contradict the buckets; then the histogram is empty. Not for the cycle.
    [[nodiscard]] constexpr bool restore(std::span<const Bucket> buckets, Duration least, Duration mean,
                                         Duration most) {
        clear();
        std::uint64_t total = 0;
        std::size_t next = 0;
        for (const Bucket& one : buckets) {
            while (next < kBuckets && (bucket(next).from != one.from || bucket(next).to != one.to)) ++next;
            if (next == kBuckets || one.count == 0 || one.count > UINT64_MAX - total) {
                clear();
                return false;
            }
            counts_[next++] = one.count;
            total += one.count;
        }
        if (total == 0) return true;
        const bool right = buckets.front().from <= least && least < buckets.front().to && least <= mean &&
                           mean <= most && buckets.back().from <= most &&
                           (most < buckets.back().to || next == kBuckets) &&
                           static_cast<std::uint64_t>(mean.count()) <= UINT64_MAX / total;
        if (!right) {
            clear();
            return false;
        }
        count_ = total;
        sum_ = static_cast<std::uint64_t>(mean.count()) * total;
        most_ = static_cast<std::uint64_t>(most.count());
        least_ = static_cast<std::uint64_t>(least.count());
        return true;
    }

    [[nodiscard]] constexpr std::uint64_t count() const { return count_; }
    [[nodiscard]] constexpr Duration min() const { return ns(count_ == 0 ? 0 : least_); }
    [[nodiscard]] constexpr Duration max() const { return ns(most_); }
    [[nodiscard]] constexpr Duration mean() const { return ns(count_ == 0 ? 0 : sum_ / count_); }

    // At most a share of 1 - `q` of all durations is longer than the returned value (plus one sixteenth of it).
    [[nodiscard]] constexpr Duration quantile(double q) const {
        const auto wanted = static_cast<std::uint64_t>(static_cast<double>(count_) * q + 0.999999);
        std::uint64_t seen = 0;
        for (std::size_t i = 0; i < kBuckets; ++i) {
            seen += counts_[i];
            if (seen >= wanted && seen > 0) return std::min(ns(start(i + 1) - 1), max());
        }
        return max();
    }

    // Up to 2^42 ns, 73 minutes; the last bucket also counts longer durations.
    static constexpr std::size_t kBuckets = 16 * 39;
    [[nodiscard]] constexpr Bucket bucket(std::size_t i) const { return {ns(start(i)), ns(start(i + 1)), counts_[i]}; }

  private:
    static constexpr Duration ns(std::uint64_t n) { return Duration(static_cast<Duration::rep>(n)); }
    // 0 to 15 have one bucket each; larger values have sixteen buckets per power of two.
    static constexpr std::size_t index(std::uint64_t n) {
        if (n < 16) return n;
        const auto power = static_cast<unsigned>(std::bit_width(n)) - 5;
        return std::size_t{16} * power + (n >> power);
    }
    static constexpr std::uint64_t start(std::size_t i) {
        if (i < 32) return i;
        const std::size_t power = i / 16 - 1;
        return std::uint64_t{i % 16 + 16} << power;
    }

    std::array<std::uint64_t, kBuckets> counts_{};
    std::uint64_t count_ = 0;
    std::uint64_t sum_ = 0;
    std::uint64_t most_ = 0;
    std::uint64_t least_ = UINT64_MAX;
};

}  // namespace margay
