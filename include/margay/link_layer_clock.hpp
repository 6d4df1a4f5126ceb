// The clock of the NIC as the reference of the whole bus ("link-layer reference clock"): the reference clock of the
// slaves follows the clock of the NIC, and the master's cycle follows it too. The NIC notes when each frame has left
// (SendClock), so that neither the wake-up of the cycle nor the driver falsifies the comparison. A NIC with a hardware
// clock that PTP disciplines brings the time of a network to the slaves in this way.
//
//     PacketNic nic;
//     nic.open("eth1");
//     nic.stamp_frames(PacketNic::Stamps::hardware);
//     …
//     configdc(ctx, {.cycle = 1ms});
//     LinkLayerClock clock(nic, {.set_value = -500us, .phase = {.cycle = 1ms}});
//     reach(ctx, AlState::op, 10s, {.period = 1ms, .clock = &clock});
//     run_cycle(ctx, {.period = 1ms, .clock = &clock}, work);
#pragma once

#include <margay/master_clock.hpp>
#include <margay/send_clock.hpp>

#include <array>

namespace margay {

struct LinkLayerClockSettings {
    std::uint8_t group = 0;  // whose cycle carries the time of the reference clock
    // The phase at which the frame passes the reference clock, from a whole multiple of the cycle in system time (SYNC0
    // without a shift) on; negative: before it. The magnitude is less than a cycle. The frames leave at whole multiples
    // of the cycle in the time of the NIC, so that the system time is the time of the NIC plus set_value, modulo the
    // cycle.
    Duration set_value{0};
    // The settings of both controllers. The controller of the cycle treats no error as an outlier, because its errors
    // contain the jitter of the driver.
    PhaseSettings phase{};
};

class LinkLayerClock : public CycleClock {
  public:
    using Settings = LinkLayerClockSettings;

    // `nic` is the clock of the NIC that sends the cycle; it must outlive this object.
    LinkLayerClock(SendClock& nic, const Settings& settings);

    // As MasterClock::update(): call it once in each cycle, after receive_processdata(); run_cycle() and reach() do it.
    // The next cycle may have been sent before, or be sent afterwards. `lateness` belongs to the cycle that was
    // received. Returns by how much the next cycle must come earlier, so that the frames leave at the whole multiples
    // of the cycle. EventKind::master_in_sync and master_out_of_sync are reported for the reference clock. A cycle
    // whose frame has no time stamp yet is compared one cycle later. A cycle that never gets a time stamp corrects
    // nothing, and neither do overlapping cycles (GroupConfiguration::cycles_in_flight).
    [[nodiscard]] Duration update(Context& ctx, Duration lateness);
    void restart();

    // State and error of the reference clock against the clock of the NIC. set_value_wrong: see MasterClock.
    // cycle_wrong: the time between the frames, as the NIC has stamped them, is not PhaseSettings::cycle.
    [[nodiscard]] PhaseState state() const {
        return wrong_ ? PhaseState::set_value_wrong : length_.is_wrong() ? PhaseState::cycle_wrong : reference_.state();
    }
    [[nodiscard]] std::int64_t error_ns() const { return reference_.error_ns(); }
    // The two controllers: one steers the reference clock, one the cycle. Both follow the clock of the NIC.
    [[nodiscard]] const PhaseController& reference() const { return reference_; }
    [[nodiscard]] const PhaseController& cycle() const { return cycle_; }
    // How many cycles have brought the time of the reference clock, but no time stamp.
    [[nodiscard]] std::uint64_t without_stamp() const { return without_stamp_; }
    // For the log (write_clock_log()). adjust_ns and drift_ppb belong to the reference clock.
    [[nodiscard]] const ClockRecord& record() const { return record_; }

  private:
    struct Sent {
        std::array<std::byte, SendClock::kHeadBytes> head{};
        Time at{};
    };
    struct Reading {
        std::array<std::byte, SendClock::kHeadBytes> head{};
        std::uint64_t bus_time_ns = 0;
        Time at{};
        Duration lateness{};
    };
    [[nodiscard]] std::optional<Duration> take(Context& ctx, const Reading& reading);
    [[nodiscard]] Duration coast(Master& master, Time sent);

    SendClock& nic_;
    Settings settings_;
    PhaseController reference_;
    PhaseController cycle_;
    ClockRecord record_;
    Reading pending_;
    Sent sent_;  // the first frame of the last cycle, as update() has seen it
    CycleCheck length_;
    std::int64_t earlier_ns_ = 0;  // the correction of the last cycle
    std::uint64_t without_stamp_ = 0;
    bool is_pending_ = false;
    bool was_in_sync_ = false;
    bool wrong_ = false;
};

}  // namespace margay
