// The clock of the master against the reference clock.
#include <margay/master_clock.hpp>

#include "api/master.hpp"
#include "network/clocks.hpp"

namespace margay {
namespace {

namespace reg = wire::reg;

// The reference clock: the value of one of its registers, sent beside the cycle. A value that is lost is followed by
// the next one.
Task<Result<>> write_reference(Network& network, wire::Register r, std::uint64_t value) {
    const Slave& reference = network.slave(network.clocks.reference);
    const bool wide = network.clocks.of(reference).kind == ClockKind::bits64;
    std::array<std::byte, 8> bytes{};
    store_le<std::uint64_t>(bytes, 0, value);
    Datagram write(network.engine.link(), wire::Command::FPWR, {reference.station_address, r.address},
                   Bytes(bytes).first(wide ? 8U : 4U), Repeat::no);
    auto reply = co_await write;
    (void)reply;
    co_return Result<>();
}

void send_to_reference(Network& network, wire::Register r, std::uint64_t value) {
    (void)network.settling.start(write_reference(network, r, value));
}

}  // namespace

MasterClock::MasterClock(const Settings& settings) : settings_(settings) {
    PhaseSettings phase = settings.phase;
    if (settings.mode == Mode::bus_shift) {
        phase.cycles_late = 1;  // the offset is sent with the next cycle, behind its reading
        if (phase.most_step_ns == 0)
            phase.most_step_ns = static_cast<std::uint32_t>(phase.cycle.count() * phase.most_drift_ppm / 1'000'000);
    }
    controller_.start(phase);
}

Duration MasterClock::update(Context& ctx, Duration lateness) {
    Master* master = master_of(ctx);
    if (master == nullptr || settings_.group >= master->network.process.groups.size()) return Duration{0};
    Network& network = master->network;
    const ProcessGroup& group = network.process.groups[settings_.group];
    const bool read = group.dc_time.came && group.dc_time.slaves != 0;
    if (!read) return settings_.mode == Mode::master_shift ? Duration(controller_.coast()) : Duration{0};
    const Time now = network.engine.link().last_cycle();
    const auto cycle = static_cast<std::uint64_t>(settings_.phase.cycle.count());
    const std::uint64_t due_ns = group.dc_time.value - static_cast<std::uint64_t>(lateness.count());
    const std::int64_t correction = controller_.update(phase_error_ns(due_ns, cycle, settings_.set_value.count()), now);
    if (settings_.mode == Mode::master_shift) return Duration(correction);
    if (network.clocks.reference == 0) return Duration{0};
    ClockEntry& reference = network.clocks.entries[network.clocks.reference - 1U];
    if (settings_.mode == Mode::bus_shift && correction != 0) {
        reference.offset_ns -= static_cast<std::uint64_t>(correction);
        send_to_reference(network, reg::kSystemTimeOffset, reference.offset_ns);
    }
    if (settings_.mode == Mode::master_reference) {
        const Duration time = now + settings_.phase.cycle - Time{} + network.clocks.settings.system_time_at_zero;
        send_to_reference(network, reg::kSystemTime, static_cast<std::uint64_t>((time + settings_.set_value).count()));
    }
    return Duration{0};
}

std::string_view to_text(PhaseState state) {
    switch (state) {
        case PhaseState::idle: return "not running";
        case PhaseState::busy: return "not in sync yet";
        case PhaseState::in_sync: return "in sync";
        case PhaseState::drift_too_high: return "the drift between both clocks is too high";
        case PhaseState::error_too_large: return "the error has exceeded the limit";
    }
    return "unknown";
}

}  // namespace margay
