// Distributed clocks in a ring with two NICs. While the ring is whole, the copy of each frame that begins at the head
// of the ring passes the processing units of all slaves, and brings them the time of the reference clock. Behind a
// break, the frames of the second NIC pass the processing units in the same order, so the delays stay right; the first
// clock behind the break becomes the second reference. Both references are compared by the two copies of each frame,
// and the master steers the second one by its offset.
#include "network/ring_watch.hpp"
#include "network/wanted.hpp"

#include <algorithm>
#include <utility>

namespace margay {
namespace {

namespace reg = wire::reg;

constexpr wire::Register kLoops{reg::kDlControl.address, 2};
constexpr std::uint16_t kTemporary = 0x0002;  // the loop settings are valid for about a second

// Shorter than the time after which the chip opens the port by itself.
constexpr Duration kLongest = std::chrono::milliseconds(800);

constexpr std::uint16_t closed(std::uint8_t port) { return static_cast<std::uint16_t>(0x0300U << (2 * port)); }

Error ring_error(Errc code, std::uint16_t slave = 0) {
    return {.code = code, .step = Step::configure_clocks, .slave = slave, .detail = Error::kRedundancy};
}

// A slave with a clock that only the frames of the second NIC reach while the ring is whole; 0: none. The delay from
// the reference to this slave is another one after each break.
std::uint16_t clock_beside_the_ring(Network& network, RingParts parts) {
    for (const Slave& slave : network.slaves())
        if (slave.ring_position > parts.front && is_clock(network.clocks.of(slave).kind)) return slave.number;
    return 0;
}

}  // namespace

Task<Result<>> RingWatch::open_ring(Network& network) {
    const RingParts now = parts();
    last_ = 0;
    constants_ = {};
    if (!now.two_nics) co_return Nothing{};
    std::uint8_t port = 0;
    const Slave* const last = last_slave(network, port);
    // Broken at the cable of the second NIC: a line.
    if (!now.whole && now.front >= network.ring_count) co_return Nothing{};
    if (!now.whole || last == nullptr) co_return ring_error(Errc::wrong_state);
    const std::uint16_t beside = clock_beside_the_ring(network, now);
    if (beside != 0) co_return ring_error(Errc::unsupported, beside);
    const Station station = network.station(*last);
    const auto control = co_await required(read<std::uint16_t>(station, reg::kDlControl, Step::configure_clocks));
    ring_.use_head_only(true);
    opened_ = network.engine.now();
    last_ = last->number;
    last_control_ = control;
    const auto written = co_await write_clock_register(station, kLoops, control | kTemporary | closed(port));
    if (!written) {  // perhaps only the reply was lost
        co_await completion(close_ring(network));
    }
    co_return written;
}

Task<Result<>> RingWatch::close_ring(Network& network) {
    if (last_ == 0 || last_ > network.count) co_return Nothing{};
    const auto written =
        co_await write_clock_register(network.station(network.slave(last_)), kLoops, last_control_ & ~kTemporary);
    last_ = 0;
    ring_.use_head_only(false);
    if (written && network.engine.now() - opened_ > kLongest) co_return ring_error(Errc::unstable);
    co_return written;
}

std::uint16_t RingWatch::reference_of(Network& network, const Slave& slave) const {
    const RingParts now = parts();
    const bool behind = now.two_nics && !now.whole && slave.ring_position > now.front;
    return behind && second_ != 0 && second_ != slave.number ? second_ : network.clocks.reference;
}

// The first clock behind the break that follows the reference; 0 while the ring is whole.
std::uint16_t RingWatch::choose_second(Network& network) const {
    const RingParts now = parts();
    if (!now.two_nics || now.whole || network.clocks.reference == 0) return 0;
    // A NIC whose copies were lost some times is taken for silent: then the counts are not those of the ring.
    std::size_t there = 0;
    for (const Slave& slave : network.slaves())
        if (slave.al.state != AlState::none && slave.ring_position != 0) ++there;
    const std::size_t seen = std::size_t{ring_.reached_by(0)} + ring_.reached_by(1);
    if (!ring_.counts_are_new() || seen < there) return second_;
    std::uint16_t best = 0;
    for (const Slave& slave : network.slaves()) {
        // Below SAFEOP, a slave that has come back may not have its clock yet.
        const bool settled = slave.number == second_ || slave.al.state >= AlState::safeop ||
                             slave.al.state == wanted_state(network, slave);
        const bool candidate = slave.ring_position > now.front && slave.al.state != AlState::none && settled &&
                               network.clocks.of(slave).synchronised;
        if (candidate && (best == 0 || slave.ring_position < network.slave(best).ring_position)) best = slave.number;
    }
    return best;
}

Task<Result<>> RingWatch::change_second(Network& network, std::uint16_t second) {
    const bool is_first = second != 0 && second == network.clocks.reference;
    if (second == second_ && is_first == second_is_first_) {
        if (second != 0 && !ring_.has_second_reference())  // one answer was lost, or had the time that was sent
            ring_.set_second_reference(network.slave(second).station_address, is_first);
        co_return Nothing{};
    }
    second_ = second;
    second_is_first_ = is_first;
    known_ = false;
    first_ = {};
    if (const Constant* const constant = known_constant(); constant != nullptr) {
        constant_ns_ = constant->ns;
        begin_to_steer(network);
    }
    ring_.set_second_reference(second == 0 ? StationAddress{} : network.slave(second).station_address, is_first);
    if (second == 0 || is_first) co_return Nothing{};
    network.report({.kind = EventKind::second_reference, .slave = second, .other = network.clocks.reference});
    // See replace_reference(): a clock keeps the rate that it has learned, unless its comparisons were wrong.
    Slave& slave = network.slave(second);
    co_await required(read_difference(network, slave));
    if (std::abs(std::int64_t{network.clocks.of(slave).difference_ns}) <= network.clocks.settings.limit_ns)
        co_return Nothing{};
    co_return co_await required(reset_control_loop(network.station(slave)));
}

const RingWatch::Constant* RingWatch::known_constant() const {
    const auto found = std::ranges::find(constants_, second_, &Constant::slave);
    return second_ == 0 || found == constants_.end() ? nullptr : &*found;
}

void RingWatch::begin_to_steer(Network& network) {
    known_ = true;
    phase_.start(for_bus_shift({.cycle = network.clocks.settings.watch_interval, .gain_ppt = 50, .outlier_ns = 0}));
}

// One step of the controller of the second reference.
Task<Result<>> RingWatch::steer(Network& network) {
    constexpr std::uint32_t kEnough = 16;
    const PartDifference seen = ring_.take_difference();
    if (seen.count == 0) co_return Nothing{};
    if (!known_) {
        first_.sum_ns += seen.sum_ns;
        first_.count += seen.count;
        if (first_.count < kEnough) co_return Nothing{};
        constant_ns_ = first_.sum_ns / first_.count;
        constants_[next_constant_++ % constants_.size()] = {second_, constant_ns_};
        begin_to_steer(network);
        co_return Nothing{};
    }
    const std::int64_t error = seen.sum_ns / seen.count - constant_ns_;
    const std::int64_t correction = phase_.update(error, network.engine.now());
    if (correction == 0) co_return Nothing{};
    ClockEntry& clock = network.clocks.entries[second_ - 1U];
    clock.offset_ns -= static_cast<std::uint64_t>(correction);
    wire::Register offset = reg::kSystemTimeOffset;
    if (clock.kind == ClockKind::bits32) offset.length = 4;
    co_return co_await required(write_clock_register(network.station(network.slave(second_)), offset, clock.offset_ns));
}

Task<Result<>> RingWatch::watch_clocks(Network& network) {
    constexpr std::uint8_t kEnough = 2;
    const std::uint16_t wanted = choose_second(network);
    if (wanted != std::exchange(wanted_second_, wanted))
        rounds_seen_ = 0;
    else if (rounds_seen_ < kEnough)
        ++rounds_seen_;
    if (wanted == 0 || wanted == second_ || rounds_seen_ >= kEnough) {
        co_await required(change_second(network, wanted));
    }
    if (second_ == 0 || second_is_first_) co_return Nothing{};
    co_return co_await required(steer(network));
}

}  // namespace margay
