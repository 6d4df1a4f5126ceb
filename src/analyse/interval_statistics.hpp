// Statistics of intervals without keeping them: extremes, mean, standard deviation, and percentiles within 1 per cent:
// each percentile is the mean of the intervals of about this length, so that the percentiles of a steady cycle are
// exact.
#pragma once

#include "analyse/analysis.hpp"

namespace margay::analyse {

class IntervalStatistics {
  public:
    void add(Duration interval, Moment at);
    [[nodiscard]] Intervals result() const;

    static constexpr Duration kPause = std::chrono::seconds(1);

  private:
    [[nodiscard]] Duration at_rank(std::uint64_t rank) const;

    // The intervals between two lengths.
    struct Step {
        std::uint64_t count = 0;
        std::uint64_t sum = 0;
    };
    static constexpr unsigned kFineBits = 7;  // 128 steps between powers of two
    static constexpr unsigned kBits = 30;     // of kPause in nanoseconds
    static constexpr std::size_t kSteps = std::size_t{kBits - kFineBits + 1} << kFineBits;
    Intervals facts_{};
    double mean_ = 0, squares_ = 0;
    std::vector<Step> steps_{};
};

}  // namespace margay::analyse
