// The rate of the second reference of a broken ring. The master steers the second reference by its offset, once in each
// round. So between two rounds the second reference moves at its own rate, and the clocks that follow it move too.
#include "network/ring_watch.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace reg = wire::reg;
using namespace std::chrono_literals;

// Writes the time of the reference to the second reference.
Task<Result<>> write_time(Network& network, const Slave& second) {
    const std::size_t octets = network.clocks.of(second).kind == ClockKind::bits64 ? 8 : 4;
    std::array<std::byte, 8> time{};
    store_le<std::uint64_t>(time, 0, network.clocks.system_at_ns(leaves_at(network)));
    Datagram write(network.engine.link(), wire::Command::FPWR, {second.station_address, reg::kSystemTime.address},
                   Bytes(time).first(octets), Repeat::no);
    (void)co_await write;  // a lost frame is one of many
    co_return Nothing{};
}

}  // namespace

// The second reference follows another clock from now on. Until now the master has compensated its rate, and the clock
// has not learned the rate of the other clock. So it moves away until it is compared for the first time.
void RingWatch::lose_own_rate(Network& network) const {
    if (second_ == 0 || second_is_first_ || !is_steered()) return;
    Duration cycle = std::chrono::milliseconds(1);
    for (const ProcessGroup& group : network.process.groups)
        if (group.mapped && group.dc_reference == network.clocks.reference && group.pace.before != Time::min())
            cycle = group.pace.last - group.pace.before;
    const Duration until_compared = ClockEntry::kTimesOfMean * cycle + 2 * network.clocks.settings.watch_interval;
    const std::int64_t moves_ns = std::abs(std::int64_t{phase_.drift_ppb()}) * (until_compared / 1us) / 1'000'000;
    if (moves_ns > network.clocks.settings.limit_ns) network.clocks.lose_sync(network.slave(second_));
}

// The second reference has never been compared with the reference, and would drift away because both oscillators
// differ. So the master writes the time of the reference to the second reference until its control loop has learned the
// rate.
Task<Result<>> RingWatch::teach_rate(Network& network, Slave& second) {
    constexpr Duration kLesson = std::chrono::seconds(1);
    const Time give_up = network.engine.now() + kLesson;
    for (std::uint16_t n = 0; n < network.clocks.settings.burst_frames && network.engine.now() < give_up; ++n) {
        co_await required(send_time(network));  // reads the time of the reference
        co_await required(write_time(network, second));
    }
    co_return Nothing{};
}

// Whether the clock that will be the second reference has not learned the rate of the reference yet. A slave that had
// no power has lost this rate.
bool RingWatch::lacks_rate(Network& network, std::uint16_t wanted) const {
    const Clocks& clocks = network.clocks;
    return wanted != 0 && wanted != second_ && wanted != clocks.reference && !has_beside_ && !parts().whole &&
           !clocks.entries[wanted - 1U].knows_rate && network.slave(clocks.reference).al.state != AlState::none;
}

// Whether the difference of both clocks changes by `most_ns` at most in 20 ms. While no time arrives, a clock keeps
// its rate.
Task<Result<bool>> RingWatch::runs_alike(Network& network, Slave& slave, Slave& present, std::int64_t most_ns) const {
    constexpr Duration kLook = std::chrono::milliseconds(20);
    const auto before = co_await required(measure_ahead(network, slave, present));
    co_await network.engine.sleep_for(kLook);
    const auto ahead = co_await required(measure_ahead(network, slave, present));
    co_return std::abs(ahead - before) <= most_ns;
}

// A lesson for a clock behind a break, while cycles run: each cycle takes one frame with the time.
Task<Result<>> RingWatch::teach_in_cycles(Network& network, const Slave& slave) const {
    constexpr Duration kLesson = std::chrono::milliseconds(300);
    const Time give_up = network.engine.now() + kLesson;
    const std::uint32_t ways = ring_.ways();
    const std::uint16_t most = network.clocks.settings.burst_frames;
    for (std::uint16_t n = 0; n < most && network.engine.now() < give_up && ring_.ways() == ways; ++n) {
        Crew reading(1);  // with the same cycle
        if (!reading.start(send_time(network)))
            co_return Error{.code = Errc::capacity, .step = Step::configure_clocks, .detail = Error::kTasks};
        co_await required(write_time(network, slave));
        co_await reading.all();
    }
    co_return Nothing{};
}

// Finds out whether a clock behind the break has learned the rate of the reference, before it becomes the second
// reference: at its own rate it would move by more than the limit between two corrections. Before the present second
// reference, the clock learns the rate from the time that the master sends. If there is none, the master writes the
// time to the clock. The jitter of the master changes the rate from frame to frame. So the time is stopped, the rate is
// measured by receive times, and the clock is tried again later if its rate is not good enough. A clock with a good
// rate is set to the time of the present second reference.
Task<Result<bool>> RingWatch::prepare_second(Network& network, Slave& slave) {
    constexpr unsigned kMostLessons = 4;
    constexpr std::uint8_t kStrictRounds = 100;
    constexpr std::int64_t kMostChange_ns = 50;
    const std::int64_t limit_ns = network.clocks.settings.limit_ns;
    const bool follows = has_present_second(network);
    Slave& present = network.slave(follows ? second_ : network.clocks.reference);
    const std::uint32_t ways = ring_.ways();
    ring_.set_second_reference({});
    const bool strict = rounds_seen_ <= kStrictRounds;
    auto learned = co_await required(runs_alike(network, slave, present, strict ? kMostChange_ns : limit_ns));
    if (!learned && !follows) lose_behind(network);  // no time reaches these clocks during the lessons
    for (unsigned n = 0; !learned && !follows && n < kMostLessons && ring_.ways() == ways; ++n) {
        co_await required(teach_in_cycles(network, slave));
        learned = co_await required(runs_alike(network, slave, present, n == 0 ? kMostChange_ns : limit_ns));
    }
    if (!learned) co_return false;
    // The mean of the differences is cleared, because it contains the jitter: the rate stays.
    const wire::Register filter = reg::kSystemTimeDifferenceFilter;
    const auto depth = co_await required(read<std::uint8_t>(network.station(slave), filter, Step::configure_clocks));
    co_await required(write_clock_register(network.station(slave), filter, depth));
    const auto ahead = co_await required(measure_ahead(network, slave, present));
    // The other clock has lost its power meanwhile.
    if (std::abs(ahead) > kNear_ns) co_return false;
    co_await required(move_clock(network, slave, -ahead));
    network.clocks.of(slave).knows_rate = true;
    co_return true;
}

// Whether the present second reference is kept for some more rounds, because the next one has not learned the rate yet.
Task<Result<bool>> RingWatch::is_second_late(Network& network, std::uint16_t wanted) {
    constexpr std::uint8_t kMostRounds = 200;
    constexpr std::uint8_t kRounds = 10;
    if (!lacks_rate(network, wanted) || rounds_seen_ >= kMostRounds) co_return false;
    // The reference was behind the break until now, so this part has no second reference yet.
    if (second_is_first_) co_await required(change_second(network, 0));
    if (rounds_seen_++ % kRounds != 0 || network.searching || network.clocks.paused) co_return true;
    const auto learned = co_await prepare_second(network, network.slave(wanted));
    const bool changes = !learned && learned.error().code == Errc::unstable;
    const bool again = changes || (learned && !*learned && has_present_second(network));
    const bool late = again || choose_second(network) != wanted;
    // The preparation may have ended while no frame brought the time of the present second reference.
    if (late && has_present_second(network)) co_await required(change_second(network, second_));
    co_return late;
}

}  // namespace margay
