#include "api/reference_clock.hpp"

#include "api/master.hpp"
#include "network/wanted.hpp"

#include <algorithm>

namespace margay {
namespace {

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

}  // namespace

bool has_reference_clock(Network& network) {
    if (network.clocks.reference == 0) return false;
    const Slave& reference = network.slave(network.clocks.reference);
    const AlState state = reference.al.state;
    return state != AlState::none &&
           (!network.supervised || state >= AlState::safeop || state == wanted_state(network, reference));
}

namespace {

void lose_other_clocks(Network& network) {
    for (const Slave& slave : network.slaves())
        if (slave.number != network.clocks.reference) network.clocks.lose_sync(slave);
}

// The other clocks follow a change of the rate of the reference only after some milliseconds. So they are not in sync
// until the supervision has compared them again.
void note_shift(Network& network, std::int64_t correction_ns, Duration cycle) {
    constexpr std::int32_t kCycles = 16;
    constexpr std::int64_t kFarParts = 5000;  // 200 ppm
    Clocks& clocks = network.clocks;
    const auto change = static_cast<std::int32_t>(correction_ns) - clocks.shift_mean / kCycles;
    clocks.shift_mean += change;
    clocks.shifted_ns += change;
    const std::int64_t limit_ns = clocks.settings.limit_ns;
    // Directly after a step, the difference is the whole step, independent of the rate.
    const bool jumps = correction_ns > 4 * limit_ns || correction_ns < -4 * limit_ns;
    const std::int64_t far_ns = std::min(4 * limit_ns, cycle.count() / kFarParts);
    clocks.shifted_far |= std::abs(std::int64_t{clocks.shift_mean}) > kCycles * far_ns;
    const bool is_faster = std::abs(std::int64_t{clocks.shifted_ns}) > 2 * limit_ns;
    if (!network.supervised || (!jumps && !is_faster)) return;
    clocks.shifted_ns = 0;
    lose_other_clocks(network);
}

}  // namespace

void send_to_reference(Master& master, wire::Register r, std::uint64_t value, bool waits) {
    Network& network = master.network;
    if (r.address == wire::reg::kSystemTime.address) network.clocks.is_driven = true;
    if (!has_reference_clock(network)) return;
    (void)network.settling.start(write_reference(network, r, value));
    if (!waits) network.engine.link().send(master.osal.now());
}

bool waits_for_cycle(Network& network, Time sent, Duration cycle) {
    return network.engine.link().cycling(later(sent, cycle));
}

void shift_reference(Master& master, std::int64_t correction_ns, Duration cycle, bool waits) {
    Network& network = master.network;
    if (!has_reference_clock(network)) return;
    note_shift(network, correction_ns, cycle);
    if (correction_ns == 0) return;
    ClockEntry& reference = network.clocks.entries[network.clocks.reference - 1U];
    reference.offset_ns -= static_cast<std::uint64_t>(correction_ns);
    send_to_reference(master, wire::reg::kSystemTimeOffset, reference.offset_ns, waits);
}

std::int64_t coast_reference(Master& master, PhaseController& controller, bool read, Time sent, Duration cycle) {
    Network& network = master.network;
    const Time now = network.engine.now();
    const std::int64_t correction = read ? controller.coast(now) : controller.coast_unsure(now);
    const std::uint64_t limit_ns = 4 * std::uint64_t{network.clocks.settings.limit_ns};
    if (network.supervised && controller.unsure_ns() > limit_ns) lose_other_clocks(network);
    shift_reference(master, correction, cycle, waits_for_cycle(network, sent, cycle));
    return correction;
}

std::uint64_t whole_bus_time(Network& network, const ProcessGroup& group, Time at, std::uint64_t last, Time last_at) {
    const std::uint64_t seen = group.dc_time.value;
    if (is_time_whole(group)) return seen;
    const std::uint64_t about =
        last == 0 ? network.clocks.system_at_ns(at) : last + static_cast<std::uint64_t>((at - last_at).count());
    return extend_time_ns(static_cast<std::uint32_t>(seen), about);
}

}  // namespace margay
