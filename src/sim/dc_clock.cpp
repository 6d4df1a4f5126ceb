#include "sim/dc_clock.hpp"

#include <algorithm>
#include <cmath>

namespace margay::sim {

namespace {

namespace reg = wire::reg;

// The data sheets describe the control loop (it adjusts the rate by the mean of the differences, whose filter depth is
// register 0x0934), but not its gains. The loop of this model corrects this part of the mean in one second. The filter
// delays the correction, so the part is smaller if comparisons are rare, in order to keep the loop stable.
constexpr double kFastest = 50.0;

// The clock rate for a speed counter difference, by the formula of the data sheets for 0x0932.
double rate_of(double difference, double start) {
    return difference / (5.0 * (start + difference + 2) * (start - difference + 2));
}

// The inverse function of rate_of().
double difference_of(double rate, double start) {
    const double tenth = 10.0 * rate;
    if (std::abs(rate) < 1e-12) return 0.0;
    return (std::sqrt(1.0 + tenth * tenth * (start + 2) * (start + 2)) - 1.0) / tenth;
}

}  // namespace

void DcClock::power_up(RegisterFile& registers, const ClockDescription& clock, bool bits64, Time now) {
    registers_ = &registers;
    bits64_ = bits64;
    drift_ = clock.drift_ppb * 1e-9;
    step_ns_ = std::max<std::uint8_t>(clock.step_ns, 1);
    jitter_ns_ = clock.jitter_ns;
    random_ = clock.start_ns * 2 + 1;
    correction_ = 0;
    anchored_ = now;
    anchor_local_ = clock.start_ns;
    anchor_part_ = 0;
    registers.set<std::uint16_t>(reg::kSpeedCounterStart.address, 0x1000);
    registers.set<std::uint8_t>(reg::kSystemTimeDifferenceFilter.address, 4);
    registers.set<std::uint8_t>(reg::kSpeedCounterFilter.address, 12);
    reconfigure();
    reset_loop(now);
}

std::uint64_t DcClock::local(Time at) const {
    const auto passed = (at - anchored_).count();
    const double bent = static_cast<double>(passed) * (drift_ + correction_) + anchor_part_;
    return anchor_local_ + static_cast<std::uint64_t>(passed) +
           static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(bent)));
}

std::uint64_t DcClock::stamp(Time at) {
    Duration away{0};
    if (jitter_ns_ != 0) {
        random_ = random_ * 6364136223846793005 + 1442695040888963407;
        away = Duration(static_cast<std::int64_t>((random_ >> 33) % (2 * jitter_ns_ + 1U)) - jitter_ns_);
    }
    const std::uint64_t exact = local(at + away);
    return exact - exact % step_ns_;
}

void DcClock::anchor(Time at) {
    const auto passed = (at - anchored_).count();
    const double bent = static_cast<double>(passed) * (drift_ + correction_) + anchor_part_;
    anchor_local_ = local(at);
    anchor_part_ = bent - std::floor(bent);
    anchored_ = at;
}

void DcClock::set_rate(double correction, Time at) {
    anchor(at);
    correction_ = correction;
}

std::int64_t DcClock::ahead(std::uint64_t copy_time, Time at) const {
    return bits64_ ? static_cast<std::int64_t>(copy_time - copy(at))
                   : std::int64_t{static_cast<std::int32_t>(copy_time - copy(at))};
}

// The master may write any offset, so limit differences that do not fit into a Duration.
Time DcClock::moment_of(std::uint64_t copy_time, Time near) const {
    constexpr std::int64_t kFar = std::int64_t{1} << 60;
    const auto ahead = std::clamp(this->ahead(copy_time, near), -kFar, kFar);
    const double rate = 1.0 + drift_ + correction_;
    return near + Duration(static_cast<std::int64_t>(std::ceil(static_cast<double>(ahead) / rate)));
}

Time DcClock::start_moment(std::uint64_t copy_time, Time now) const {
    const double rate = 1.0 + drift_ + correction_;
    if (!bits64_) {
        const auto ahead = static_cast<std::uint32_t>(copy_time - copy(now));
        return now + Duration(static_cast<std::int64_t>(std::ceil(ahead / rate)));
    }
    const auto ahead = static_cast<std::int64_t>(copy_time - copy(now));
    constexpr std::int64_t kTooFar = std::int64_t{1} << 62;
    return ahead < 0 || ahead > kTooFar ? kNever : moment_of(copy_time, now);
}

void DcClock::reconfigure() {
    offset_ = registers_->get<std::uint64_t>(reg::kSystemTimeOffset.address);
    delay_ = registers_->get<std::uint32_t>(reg::kSystemTimeDelay.address);
}

void DcClock::set_drift(std::int32_t ppb, Time at) {
    anchor(at);
    drift_ = ppb * 1e-9;
}

// A write to the speed counter start restarts the control loop.
void DcClock::reset_loop(Time at) {
    mean_ = integral_ = 0;
    compared_ = kNever;
    set_rate(0, at);
    registers_->set<std::uint16_t>(reg::kSpeedCounterDifference.address, 0);
    registers_->set<std::uint32_t>(reg::kSystemTimeDifference.address, 0);
}

void DcClock::reset_difference() {
    mean_ = 0;
    registers_->set<std::uint32_t>(reg::kSystemTimeDifference.address, 0);
}

void DcClock::compare(std::uint32_t received, Time at) {
    const auto difference =
        static_cast<double>(static_cast<std::int32_t>(static_cast<std::uint32_t>(system(at)) - received));
    const auto depth = registers_->get<std::uint8_t>(reg::kSystemTimeDifferenceFilter.address) & 0x0F;
    mean_ += (difference - mean_) / (1u << depth);
    // 0x092C contains sign and magnitude; the sign is set when the local copy is behind.
    const auto shown = static_cast<std::uint32_t>(std::min(std::abs(std::round(mean_)), 2147483647.0));
    registers_->set(reg::kSystemTimeDifference.address, shown | (mean_ < 0 && shown != 0 ? 0x80000000u : 0u));

    const double start = registers_->get<std::uint16_t>(reg::kSpeedCounterStart.address);
    const double limit = std::clamp(start - 0x7F, 0.0, 32767.0);  // the difference is a signed value
    const double seconds =
        compared_ == kNever ? 0.0 : std::min(static_cast<double>((at - compared_).count()) * 1e-9, 0.02);
    compared_ = at;
    const double lag = seconds * (1u << depth);
    const double part = lag * kFastest > 0.5 ? 0.5 / lag : kFastest;
    const double most = limit > 0 ? rate_of(limit, start) : 0.0;
    integral_ = std::clamp(integral_ - part * part / 4 * difference * 1e-9 * seconds, -most, most);
    const double wanted = std::clamp(integral_ - part * mean_ * 1e-9, -most, most);
    const auto counter = static_cast<std::int16_t>(std::clamp(std::round(difference_of(wanted, start)), -limit, limit));
    registers_->set(reg::kSpeedCounterDifference.address, static_cast<std::uint16_t>(counter));
    set_rate(wanted, at);
}

}  // namespace margay::sim
