// The reference clock and the master's cycle follow the clock of the NIC.
#include "api/master.hpp"
#include "api/reference_clock.hpp"

#include <margay/link_layer_clock.hpp>

namespace margay {

LinkLayerClock::LinkLayerClock(SendClock& nic, const Settings& settings)
    : CycleClock([](CycleClock& self, Context& ctx, Duration lateness) {
          return static_cast<LinkLayerClock&>(self).update(ctx, lateness);
      }),
      nic_(nic),
      settings_(settings) {
    restart();
}

void LinkLayerClock::restart() {
    PhaseSettings cycle = settings_.phase;
    cycle.outlier_ns = 0;
    cycle_.start(cycle);
    reference_.start(for_bus_shift(settings_.phase));
    record_ = {.set_value_ns = settings_.set_value.count(), .cycle_ns = settings_.phase.cycle.count()};
    wrong_ = !is_in_cycle(settings_.set_value, settings_.phase.cycle);
    record_.state = state();
    length_.reset();
    earlier_ns_ = 0;
    is_pending_ = was_in_sync_ = false;
    pending_ = {};
    sent_ = {};
    without_stamp_ = 0;
}

// Compares one reading with its time stamp, if the NIC has it.
std::optional<Duration> LinkLayerClock::take(Context& ctx, const Reading& reading) {
    const auto sent_ns = nic_.send_time_ns(reading.head);
    if (!sent_ns) return std::nullopt;
    Master& master = *master_of(ctx);
    Network& network = master.network;
    const auto cycle = static_cast<std::uint64_t>(settings_.phase.cycle.count());
    const std::int64_t set_value = settings_.set_value.count();
    const std::int64_t error =
        phase_error_ns(reading.bus_time_ns % cycle + (cycle - *sent_ns % cycle), cycle, set_value);
    const Time last = time_sent_at(network.process.groups[settings_.group], network.engine.link());
    const bool waits = waits_for_cycle(network, last, settings_.phase.cycle);
    // A pending reading does not show the corrections of the last update() either, and neither does a cycle that is
    // under way.
    const std::uint8_t pending = is_pending_ ? 1 : 0;
    const std::uint32_t under_way = cycles_without_time(network.process.groups[settings_.group]);
    const std::int64_t correction =
        reference_.update(error, reading.at, static_cast<std::uint8_t>(pending + under_way + (waits ? 1 : 0)));
    shift_reference(master, correction, settings_.phase.cycle, waits);
    record_.at = reading.at;
    record_.bus_time_ns = reading.bus_time_ns;
    record_.bus_time_off_ns = reading.bus_time_ns % cycle;
    record_.error_ns = error;
    record_.filtered_ns += (error - record_.filtered_ns) / 16;
    record_.drift_ppb = reference_.drift_ppb();
    record_.adjust_ns = correction;
    record_.adjusted_ns += correction;
    if (network.clocks.reference != 0)
        record_.start_time_ns = network.clocks.entries[network.clocks.reference - 1U].sync_start_ns;
    const std::uint64_t due_ns = *sent_ns - static_cast<std::uint64_t>(reading.lateness.count());
    length_.add(due_ns, settings_.phase.cycle.count(), earlier_ns_);
    return Duration(cycle_.update(phase_error_ns(due_ns, cycle, 0), reading.at,
                                  static_cast<std::uint8_t>(settings_.phase.cycles_late + pending)));
}

Duration LinkLayerClock::update(Context& ctx, Duration lateness) {
    Master* master = master_of(ctx);
    if (wrong_ || master == nullptr || settings_.group >= master->network.process.groups.size()) return Duration{0};
    Network& network = master->network;
    const ProcessGroup& group = network.process.groups[settings_.group];
    record_.clocks_in_sync = network.clocks.all_in_sync;
    record_.difference_ns = network.clocks.greatest_ns;
    std::optional<Duration> earlier;
    if (is_pending_) {
        earlier = take(ctx, pending_);
        if (!earlier) ++without_stamp_;
    }
    is_pending_ = false;
    // If the next cycle is under way already, its frame was sent in place of the frame that has brought the time.
    const bool single = !group.prepared.empty() && group.overlap.sets <= 1;
    const Sent before = sent_;
    if (single) {
        sent_.at = group.pace.last;
        std::copy_n(group.prepared.front().bytes.begin(), sent_.head.size(), sent_.head.begin());
    }
    const Sent& brought = single && is_time_awaited(group) ? before : sent_;
    const Time at = time_sent_at(group, network.engine.link());
    if (single && group.dc_time.came && group.dc_time.slaves != 0 && brought.at == at) {
        const std::uint64_t time = whole_bus_time(network, group, at, pending_.bus_time_ns, pending_.at);
        pending_ = {.head = brought.head, .bus_time_ns = time, .at = at, .lateness = lateness};
        is_pending_ = earlier.has_value();  // a correction that was made in this update()
        const auto now = take(ctx, pending_);
        is_pending_ = !now;
        if (now) earlier = earlier.value_or(Duration{0}) + *now;
    }
    record_.read = earlier.has_value();
    if (!earlier) earlier = coast(*master, at);
    earlier_ns_ = earlier->count();
    record_.state = state();
    const bool in_sync = record_.state == PhaseState::in_sync;
    if (in_sync != was_in_sync_)
        network.report({.kind = in_sync ? EventKind::master_in_sync : EventKind::master_out_of_sync,
                        .actual = static_cast<std::uint32_t>(record_.error_ns)});
    was_in_sync_ = in_sync;
    return *earlier;
}

// One cycle without a comparison. `sent`: when it was sent.
Duration LinkLayerClock::coast(Master& master, Time sent) {
    length_.skip();
    record_.at = sent;
    const ProcessGroup& group = master.network.process.groups[settings_.group];
    const bool read = group.dc_time.came && group.dc_time.slaves != 0;
    record_.adjust_ns = coast_reference(master, reference_, read, sent, settings_.phase.cycle);
    record_.adjusted_ns += record_.adjust_ns;
    return Duration(cycle_.coast(master.network.engine.now()));
}

}  // namespace margay
