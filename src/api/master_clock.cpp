// The clock of the master against the reference clock.
#include <margay/master_clock.hpp>

#include "api/master.hpp"
#include "api/reference_clock.hpp"

#include <algorithm>
#include <utility>

namespace margay {

namespace reg = wire::reg;

MasterClock::MasterClock(const Settings& settings)
    : CycleClock([](CycleClock& self, Context& ctx, Duration lateness) {
          return static_cast<MasterClock&>(self).update(ctx, lateness);
      }),
      settings_(settings) {
    restart();
}

void MasterClock::restart() {
    const PhaseSettings phase = settings_.mode == Mode::bus_shift ? for_bus_shift(settings_.phase) : settings_.phase;
    controller_.start(phase);
    record_ = {.set_value_ns = settings_.set_value.count(), .cycle_ns = phase.cycle.count()};
    fault_ = is_in_cycle(settings_.set_value, phase.cycle) ? PhaseState::idle : PhaseState::set_value_wrong;
    record_.state = state();
    was_in_sync_ = false;
    length_.reset();
    filtered_ps_ = 0;
    has_shift_ = false;
}

Duration MasterClock::update(Context& ctx, Duration lateness) {
    Master* master = master_of(ctx);
    if (master == nullptr || settings_.group >= master->network.process.groups.size()) return Duration{0};
    if (fault_ == PhaseState::set_value_wrong) return Duration{0};
    Network& network = master->network;
    network.clocks.is_paced = true;
    network.clocks.paced_ns = 0;
    const ProcessGroup& group = network.process.groups[settings_.group];
    record_.at = time_sent_at(group, network.engine.link());
    record_.read = group.dc_time.came && group.dc_time.slaves != 0;
    record_.clocks_in_sync = network.clocks.all_in_sync;
    record_.difference_ns = network.clocks.greatest_ns;
    const auto tell_state = [this, &network] {
        record_.state = state();
        const bool in_sync = record_.state == PhaseState::in_sync;
        if (in_sync == was_in_sync_) return false;
        was_in_sync_ = in_sync;
        network.report({.kind = in_sync ? EventKind::master_in_sync : EventKind::master_out_of_sync,
                        .actual = static_cast<std::uint32_t>(record_.error_ns)});
        return in_sync;
    };
    if (!record_.read) {
        length_.skip();
        record_.adjust_ns = 0;
        if (settings_.mode == Mode::bus_shift)
            record_.adjust_ns = coast_reference(*master, controller_, false, record_.at, settings_.phase.cycle);
        else if (settings_.mode == Mode::master_shift)
            record_.adjust_ns = controller_.coast(network.engine.now());
        else
            controller_.observe_nothing(network.engine.now());
        record_.adjusted_ns += record_.adjust_ns;
        (void)tell_state();
        return Duration(settings_.mode == Mode::master_shift ? record_.adjust_ns : 0);
    }
    const auto cycle = static_cast<std::uint64_t>(settings_.phase.cycle.count());
    record_.bus_time_ns = whole_bus_time(network, group, record_.at, record_.bus_time_ns, read_at_);
    record_.bus_time_off_ns = record_.bus_time_ns % cycle;
    read_at_ = record_.at;
    refresh_system_time(network);
    const std::uint64_t due_ns = record_.bus_time_ns - static_cast<std::uint64_t>(lateness.count());
    length_.add(due_ns, settings_.phase.cycle.count(), settings_.mode == Mode::master_shift ? record_.adjust_ns : 0);
    fault_ = length_.is_wrong() ? PhaseState::cycle_wrong : PhaseState::idle;
    const Duration earlier = correct(ctx, due_ns, record_.at);
    const bool begins = tell_state();
    network.clocks.paced_ns = was_in_sync_ ? cycle : 0;
    if (begins) note_sync_cycles(network, cycle, UINT64_MAX);
    return earlier;
}

// One step of the controller.
Duration MasterClock::correct(Context& ctx, std::uint64_t due_ns, Time now) {
    Master& master = *master_of(ctx);
    Network& network = master.network;
    const auto cycle = static_cast<std::uint64_t>(settings_.phase.cycle.count());
    const std::int64_t error = phase_error_ns(due_ns, cycle, settings_.set_value.count());
    const bool bus_shift = settings_.mode == Mode::bus_shift;
    const bool writes = bus_shift || settings_.mode == Mode::master_reference;
    const bool waits = writes && waits_for_cycle(network, now, settings_.phase.cycle);
    // Cycles that are under way do not show a correction, and neither does the cycle with which the correction is sent.
    const std::uint32_t under_way = cycles_without_time(network.process.groups[settings_.group]);
    const auto hidden = static_cast<std::uint8_t>(bus_shift ? under_way + waits : settings_.phase.cycles_late);
    const std::int64_t correction = corrects() ? controller_.update(error, now, hidden) : 0;
    if (!corrects()) controller_.observe(error, now);
    constexpr std::int64_t kMost_ns = INT64_MAX / 2000;
    filtered_ps_ += (std::clamp(error, -kMost_ns, kMost_ns) * 1000 - filtered_ps_) / 16;
    record_.error_ns = error;
    record_.filtered_ns = filtered_ps_ / 1000;
    record_.drift_ppb = controller_.drift_ppb();
    record_.adjust_ns = correction;
    record_.adjusted_ns += record_.adjust_ns;
    if (network.clocks.reference != 0)
        record_.start_time_ns = network.clocks.entries[network.clocks.reference - 1U].sync_start_ns;
    if (settings_.mode == Mode::master_shift) return Duration(correction);
    if (bus_shift) shift_reference(master, correction, settings_.phase.cycle, waits);
    if (settings_.mode == Mode::master_reference) {
        // The time at which the next cycle is due, or the present time if the write does not wait for the cycle. The
        // phase of the cycles in the time of the master is arbitrary.
        const std::uint64_t late = record_.bus_time_ns - due_ns;
        const auto at_zero = static_cast<std::uint64_t>(network.clocks.settings.system_time_at_zero.count());
        const std::uint64_t next = static_cast<std::uint64_t>((now - Time{}).count()) - late + (1 + under_way) * cycle;
        if (!std::exchange(has_shift_, true))
            shift_ns_ = -phase_error_ns(next + at_zero, cycle, settings_.set_value.count());
        const std::uint64_t at = waits ? next : static_cast<std::uint64_t>((master.osal.now() - Time{}).count());
        send_to_reference(master, reg::kSystemTime, at + at_zero + static_cast<std::uint64_t>(shift_ns_), waits);
    }
    return Duration{0};
}

std::string_view to_text(PhaseState state) {
    switch (state) {
        case PhaseState::idle: return "not running";
        case PhaseState::busy: return "not in sync yet";
        case PhaseState::in_sync: return "in sync";
        case PhaseState::drift_too_high: return "the drift between both clocks is too high";
        case PhaseState::error_too_large:
            return "an error has exceeded the limit, or the jitter exceeds the gate of outliers";
        case PhaseState::set_value_wrong: return "the set value is not less than a cycle, or there is no cycle";
        case PhaseState::cycle_wrong: return "the cycle is not that of the settings";
        case PhaseState::mode_wrong: return "the mode of the cycle steers the reference clock too";
        case PhaseState::not_reference: return "the bridge is not the reference clock of its segment";
    }
    return "unknown";
}

}  // namespace margay
