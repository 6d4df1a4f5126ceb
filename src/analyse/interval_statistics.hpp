// Statistics of intervals without keeping them: extremes, mean, standard deviation, and percentiles within 3 per cent.
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

    static constexpr unsigned kFineBits = 5;  // 32 steps between powers of two
    static constexpr std::size_t kSteps = (64 - kFineBits) << kFineBits;
    Intervals facts_{};
    double mean_ = 0, squares_ = 0;
    std::vector<std::uint64_t> steps_{};
};

}  // namespace margay::analyse
