#include "analyse/interval_statistics.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace margay::analyse {
namespace {

std::size_t step_of(std::uint64_t value, unsigned fine) {
    if (value < (1ULL << fine)) return static_cast<std::size_t>(value);
    const auto shift = static_cast<unsigned>(std::bit_width(value)) - fine - 1;
    return (std::size_t{shift} << fine) + static_cast<std::size_t>(value >> shift);
}

}  // namespace

void IntervalStatistics::add(Duration interval, Moment at) {
    if (interval > kPause) {
        ++facts_.pauses;
        return;
    }
    const auto ns = std::max<std::int64_t>(interval.count(), 0);  // the clock of a recorder may be set back
    if (steps_.empty()) steps_.resize(kSteps);
    Step& step = steps_[step_of(static_cast<std::uint64_t>(ns), kFineBits)];
    ++step.count;
    step.sum += static_cast<std::uint64_t>(ns);
    const Duration value{ns};
    if (facts_.count == 0 || value < facts_.least) facts_.least = value;
    if (facts_.count == 0 || value > facts_.most) {
        facts_.most = value;
        facts_.most_at = at;
    }
    ++facts_.count;
    const auto x = static_cast<double>(ns);
    const double before = mean_;
    mean_ += (x - mean_) / static_cast<double>(facts_.count);
    squares_ += (x - before) * (x - mean_);
}

Duration IntervalStatistics::at_rank(std::uint64_t rank) const {
    std::uint64_t seen = 0;
    for (const Step& step : steps_)
        if ((seen += step.count) > rank) return Duration(static_cast<std::int64_t>(step.sum / step.count));
    return facts_.most;
}

Intervals IntervalStatistics::result() const {
    Intervals all = facts_;
    if (all.count == 0) return all;
    all.mean_ns = mean_;
    all.deviation_ns = std::sqrt(squares_ / static_cast<double>(all.count));
    all.median = at_rank(all.count / 2);
    all.low_1 = at_rank(all.count / 100);
    all.high_99 = at_rank(all.count - 1 - all.count / 100);
    const auto limit = step_of(static_cast<std::uint64_t>((all.median + all.median / 2).count()), kFineBits);
    for (std::size_t i = limit + 1; i < steps_.size(); ++i) all.late += steps_[i].count;
    return all;
}

}  // namespace margay::analyse
