// The reference clock follows the clock of another segment.
#include "api/master.hpp"
#include "api/reference_clock.hpp"

#include <margay/external_clock.hpp>
#include <margay/margay.hpp>

#include <algorithm>

namespace margay {
namespace {

constexpr std::uint16_t kExternalSynchronization = 0x10F4;

}  // namespace

ExternalClock::ExternalClock(std::uint16_t bridge, const Settings& settings)
    : CycleClock([](CycleClock& self, Context& ctx, Duration lateness) {
          return static_cast<ExternalClock&>(self).update(ctx, lateness);
      }),
      settings_(settings),
      cycle_(settings.cycle),
      internal_(bridge, kExternalSynchronization, 0x11),
      external_(bridge, kExternalSynchronization, 0x12),
      not_connected_(bridge, kExternalSynchronization, 0x10) {
    settings_.phase.cycle = settings_.cycle.phase.cycle;
    if (settings_.grid <= Duration{0}) settings_.grid = settings_.phase.cycle;
    restart();
}

void ExternalClock::restart() {
    const auto mode = settings_.cycle.mode;
    const bool follows = mode == MasterClock::Mode::off || mode == MasterClock::Mode::master_shift;
    const bool right = settings_.grid > Duration{0} && is_in_cycle(settings_.cycle.set_value, settings_.phase.cycle);
    fault_ = !follows ? PhaseState::mode_wrong : right ? PhaseState::idle : PhaseState::set_value_wrong;
    cycle_.restart();
    reference_.start(for_bus_shift(settings_.phase));
    silent_ = kSilent;
}

// True when the bridge has noted both times again: `fresh` inputs, and another time. The "Time stamp update toggle"
// does not show this, because the bridge may note the times an even number of times in one cycle.
bool ExternalClock::take_stamps(bool fresh) {
    const std::uint64_t stamp_ns = fresh ? internal_.read() : stamp_ns_;
    const bool came = fresh && !not_connected_.read() && stamp_ns != stamp_ns_ && stamp_ns != 0;
    stamp_ns_ = stamp_ns;
    if (came) difference_ns_ = static_cast<std::int64_t>(stamp_ns - external_.read());
    silent_ = came ? std::uint8_t{0} : static_cast<std::uint8_t>(std::min<int>(silent_ + 1, kSilent));
    return came;
}

// The number of corrections that the time stamps do not include yet: a correction takes effect when the next cycle
// passes, or at once.
std::uint8_t ExternalClock::not_visible(bool waits) const {
    const auto age = static_cast<std::int64_t>(cycle_.record().bus_time_ns - internal_.read());
    const std::int64_t cycle = std::max<std::int64_t>(settings_.phase.cycle.count(), 1);
    if (age < 0 || age > cycle * PhaseSettings::kMostLate) return std::uint8_t{waits};
    return static_cast<std::uint8_t>((age + (waits ? cycle - 1 : 0)) / cycle);
}

Duration ExternalClock::update(Context& ctx, Duration lateness) {
    if (fault_ == PhaseState::mode_wrong || fault_ == PhaseState::set_value_wrong) return Duration{0};
    Master* master = master_of(ctx);
    if (master == nullptr || settings_.cycle.group >= master->network.process.groups.size()) return Duration{0};
    const Duration earlier = cycle_.update(ctx, lateness);
    Network& network = master->network;
    const std::uint16_t bridge = internal_.address().slave;
    const bool came = take_stamps(internal_.mapped() && inputs_fresh(ctx, bridge));
    const bool is_reference = internal_.mapped() && network.clocks.reference == bridge;
    fault_ = is_reference || !internal_.mapped() ? PhaseState::idle : PhaseState::not_reference;
    if (!is_reference) {
        reference_.observe_nothing(network.engine.now());
        return earlier;
    }
    const Time now = cycle_.record().at;
    if (!came) {
        (void)coast_reference(*master, reference_, cycle_.record().read, now, settings_.phase.cycle);
        return earlier;
    }
    const bool waits = waits_for_cycle(network, now, settings_.phase.cycle);
    const std::uint32_t under_way = cycles_without_time(network.process.groups[settings_.cycle.group]);
    const auto grid = static_cast<std::uint64_t>(settings_.grid.count());
    const std::uint64_t ahead = internal_.read() % grid + (grid - external_.read() % grid);
    const std::int64_t correction = reference_.update(phase_error_ns(ahead, grid, settings_.offset.count()), now,
                                                      static_cast<std::uint8_t>(not_visible(waits) + under_way));
    shift_reference(*master, correction, settings_.phase.cycle, waits);
    return earlier;
}

}  // namespace margay
