// Two segments, one clock ("DCX", external synchronisation): the reference clock of this segment follows the clock of
// another segment, by a bridge device that is a slave in both. The bridge notes the time of both clocks at the same
// moment, and shows both times in its inputs (object 0x10F4, ETG.1020 "External synchronization"). The master of the
// other segment does nothing for this; it may be another library.
//
// The bridge is the reference clock of this segment, so it must be the first slave with a clock: a bridge whose clock
// follows another slave shows each correction late, and only a part of it. In the other segment it may be any slave
// with a clock that is synchronised.
//
//     ExternalClock clock(2, {.cycle = {.set_value = -500us, .phase = {.cycle = 1ms}}});   // slave 2 is the bridge
//     const auto entries = clock.entries();
//     ctx.group(0).config.entries = entries;                  // before config_map()
//     …
//     run_cycle(ctx, {.period = 1ms, .clock = &clock}, work);
#pragma once

#include <margay/entry.hpp>
#include <margay/master_clock.hpp>

#include <array>

namespace margay {

struct ExternalClockSettings {
    // How the cycle of this segment follows the reference clock of this segment: master_shift, or off. The modes that
    // steer the reference clock are not possible here (PhaseState::mode_wrong).
    MasterClockSettings cycle{};
    // The controller of the reference clock against the other segment. The library sets its `cycle` to the cycle above.
    PhaseSettings phase{};
    // The system time of this segment minus the system time of the other segment, modulo `grid`, when both are in sync.
    // So the SYNC signals of this segment come at the same time as in the other segment, or `offset` later.
    Duration offset{0};
    Duration grid{0};  // a multiple of the SYNC cycles of both segments; zero: the cycle;
                       // without a cycle the state is PhaseState::set_value_wrong
};

class ExternalClock : public CycleClock {
  public:
    using Settings = ExternalClockSettings;

    // `bridge`: the slave with object 0x10F4.
    ExternalClock(std::uint16_t bridge, const Settings& settings);
    // Not copyable: the list of the group points to members of this object.
    ExternalClock(const ExternalClock&) = delete;
    ExternalClock& operator=(const ExternalClock&) = delete;

    // The entries of the bridge that config_map() must find. Set GroupConfiguration::entries to this list, or to a list
    // that also has the entries of the application.
    [[nodiscard]] std::array<EntryHandle*, 3> entries() { return {&internal_, &external_, &not_connected_}; }

    // The same as MasterClock::update(). While the bridge provides no new time stamps (the other half is not connected,
    // or the slave does not take part), the reference clock keeps the rate that it has learned.
    [[nodiscard]] Duration update(Context& ctx, Duration lateness);
    void restart();

    // The state of the reference clock against the clock of the bridge in the other segment. Whether that clock is in
    // sync with its own reference, only the other master knows. `idle` until the first time stamp.
    // EventKind::master_in_sync and master_out_of_sync are reported for the cycle.
    [[nodiscard]] PhaseState state() const { return fault_ == PhaseState::idle ? reference_.state() : fault_; }
    // The error of the reference clock against the other segment in ns; positive when this segment is ahead.
    [[nodiscard]] std::int64_t error_ns() const { return reference_.error_ns(); }
    // Whether the bridge has provided a new time stamp within the last 16 cycles.
    [[nodiscard]] bool connected() const { return silent_ < kSilent; }
    // The system time of this segment minus the system time of the other segment, by the bridge's last time stamps.
    [[nodiscard]] std::int64_t difference_ns() const { return difference_ns_; }
    [[nodiscard]] const PhaseController& reference() const { return reference_; }
    // The clock that keeps the cycle in step with the reference clock of this segment. While no frame comes back,
    // nothing steers the reference clock, and the cycle keeps the rate that it has learned: then state() is right, and
    // the state of the cycle only after a second.
    [[nodiscard]] const MasterClock& cycle() const { return cycle_; }

  private:
    static constexpr std::uint8_t kSilent = 16;  // cycles without a new time stamp
    [[nodiscard]] bool take_stamps(bool fresh);
    [[nodiscard]] std::uint8_t not_visible(bool waits) const;

    Settings settings_;
    MasterClock cycle_;
    PhaseController reference_;
    Input<std::uint64_t> internal_;
    Input<std::uint64_t> external_;
    Input<bool> not_connected_;
    std::int64_t difference_ns_ = 0;
    std::uint8_t silent_ = kSilent;
    std::uint64_t stamp_ns_ = 0;  // internal time stamp of the last cycle
    PhaseState fault_ = PhaseState::idle;
};

}  // namespace margay
