// The clock of an ESC: the local time with its own drift, and the time control loop. The loop adjusts the rate of the
// local time so that the local copy of the system time follows the master's reference time (ETG.1000.4 "Distributed
// clock"; ESC data sheets, "Distributed Clocks").
#pragma once

#include "sim/register_file.hpp"

#include <margay/time.hpp>

#include <cstdint>

namespace margay::sim {

class DcClock {
  public:
    void power_up(RegisterFile& registers, const ClockDescription& clock, bool bits64, Time now);

    // Local time at `at`. The port receive times are local times.
    [[nodiscard]] std::uint64_t local(Time at) const;
    // The local time that the chip notes for a frame that arrives at `at`: in steps of the counter, with the jitter of
    // the receiver.
    [[nodiscard]] std::uint64_t stamp(Time at);
    // The local copy of the system time, without the delay of 0x0928.
    [[nodiscard]] std::uint64_t copy(Time at) const { return cut(local(at) + offset_); }
    // The value that the master reads at 0x0910: the copy at the time when the frame passed the reference clock.
    [[nodiscard]] std::uint64_t system(Time at) { return cut(stamp(at) + offset_ - delay_); }
    // Difference from the copy to `copy_time`; negative when the copy has passed it. With 32 bits the result is within
    // ± 2³¹ ns.
    [[nodiscard]] std::int64_t ahead(std::uint64_t copy_time, Time at) const;
    // Time at which the copy reaches `copy_time` at the present rate; in the past when the copy has already passed it.
    [[nodiscard]] Time moment_of(std::uint64_t copy_time, Time near) const;

    // The same for a start time. With 32 bits, a start time that has passed occurs again after the copy wraps around;
    // with 64 bits it never occurs again.
    [[nodiscard]] Time start_moment(std::uint64_t copy_time, Time now) const;

    // 0x0910 was written in a frame that reached the ESC at `at`: executes one step of the control loop.
    void compare(std::uint32_t received, Time at);
    // Call it after a write to offset, delay, speed counter start or filters.
    void reconfigure();
    void reset_loop(Time at);
    // The filter of the difference was written: the mean value starts again.
    void reset_difference();
    void set_drift(std::int32_t ppb, Time at);

  private:
    [[nodiscard]] std::uint64_t cut(std::uint64_t time) const { return bits64_ ? time : time & 0xFFFFFFFF; }
    void set_rate(double correction, Time at);
    void anchor(Time at);

    RegisterFile* registers_ = nullptr;
    bool bits64_ = true;
    std::uint8_t step_ns_ = 1;
    std::uint8_t jitter_ns_ = 0;
    std::uint64_t random_ = 1;
    double drift_ = 0;       // relative rate error of the oscillator
    double correction_ = 0;  // rate correction by the control loop
    Time anchored_{};
    std::uint64_t anchor_local_ = 0;
    double anchor_part_ = 0;  // fraction of a nanosecond
    std::uint64_t offset_ = 0;
    std::uint32_t delay_ = 0;
    double mean_ = 0;      // mean of the differences
    double integral_ = 0;  // integral part of the loop, as a rate
    Time compared_ = kNever;
};

}  // namespace margay::sim
