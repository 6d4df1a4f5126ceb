// The clock of an ESC: local time with its own drift, and the time control loop that bends its rate so that
// the local copy of the system time follows the master's (ETG.1000.4 "Distributed clock"; ESC data sheets,
// "Distributed Clocks").
#pragma once

#include "sim/register_file.hpp"

#include <margay/time.hpp>

#include <cstdint>

namespace margay::sim {

class DcClock {
  public:
    void power_up(RegisterFile& registers, const ClockDescription& clock, bool bits64, Time now);

    // Local time at a moment: what the port receive times are taken from.
    [[nodiscard]] std::uint64_t local(Time at) const;
    // The local copy of the system time, without the delay of 0x0928.
    [[nodiscard]] std::uint64_t copy(Time at) const { return cut(local(at) + offset_); }
    // What the master reads at 0x0910: as the copy was when the frame passed the reference clock.
    [[nodiscard]] std::uint64_t system(Time at) const { return cut(copy(at) - delay_); }
    // How far the copy is from `copy_time` yet; negative where it is past it. Of 32 bits: within half a turn.
    [[nodiscard]] std::int64_t ahead(std::uint64_t copy_time, Time at) const;
    // The moment at which the copy has got to `time`, at the present rate; in the past where it has already.
    [[nodiscard]] Time moment_of(std::uint64_t copy_time, Time near) const;

    // The same for a start time: what has passed comes again when the copy has wrapped, which of 64 bits is
    // never.
    [[nodiscard]] Time start_moment(std::uint64_t copy_time, Time now) const;

    // 0x0910 was written, in a frame that began to pass at `at`: one step of the control loop.
    void compare(std::uint32_t received, Time at);
    // Offset, delay, speed counter start or filters were written.
    void reconfigure();
    void reset_loop(Time at);
    // The filter of the difference was written, which starts the mean over.
    void reset_difference();
    void set_drift(std::int32_t ppb, Time at);

  private:
    [[nodiscard]] std::uint64_t cut(std::uint64_t time) const { return bits64_ ? time : time & 0xFFFFFFFF; }
    void set_rate(double correction, Time at);
    void anchor(Time at);

    RegisterFile* registers_ = nullptr;
    bool bits64_ = true;
    double drift_ = 0;       // of the oscillator, 1 = as long as it takes
    double correction_ = 0;  // of the loop
    Time anchored_{};
    std::uint64_t anchor_local_ = 0;
    double anchor_part_ = 0;  // below a nanosecond
    std::uint64_t offset_ = 0;
    std::uint32_t delay_ = 0;
    double mean_ = 0;      // of the differences
    double integral_ = 0;  // of the loop, in units of the speed counter difference
    Time compared_ = kNever;
};

}  // namespace margay::sim
