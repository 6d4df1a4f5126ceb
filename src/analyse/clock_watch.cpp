#include "analyse/clock_watch.hpp"

#include "wire/esc.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace margay::analyse {

using wire::Command;
namespace reg = wire::reg;

namespace {

// Converts register 0x092C: bit 31 is set if the local copy of the system time is less than the received time.
std::int64_t deviation_of(std::uint32_t word) {
    const auto magnitude = static_cast<std::int64_t>(word & 0x7FFF'FFFF);
    return (word & 0x8000'0000) != 0 ? -magnitude : magnitude;
}

template <class T>
void note(std::optional<T>& fact, const Exchanged& e, Bytes data, wire::Register at) {
    if (const auto octets = octets_at(e, data, at.address, sizeof(T))) fact = load_le<T>(*octets);
}

void set(Clock& clock, const Exchanged& e) {
    note(clock.offset_ns, e, e.sent, reg::kSystemTimeOffset);
    if (const auto low = octets_at(e, e.sent, reg::kSystemTimeOffset.address, 4); low && e.sent.size() == 4)
        clock.offset_ns = load_le<std::int32_t>(*low);
    note(clock.delay_ns, e, e.sent, reg::kSystemTimeDelay);
    note(clock.activation, e, e.sent, reg::kSyncActivation);
    note(clock.start_ns, e, e.sent, reg::kSyncStartTime);
    note(clock.sync0_cycle_ns, e, e.sent, reg::kSync0CycleTime);
    note(clock.sync1_cycle_ns, e, e.sent, reg::kSync1CycleTime);
}

// The same as set(), but only for settings that were seen before.
void set_again(Clock& clock, const Exchanged& e) {
    Clock next = clock;
    set(next, e);
    const auto again = [](auto& fact, const auto& value) {
        if (fact) fact = value;
    };
    again(clock.offset_ns, next.offset_ns);
    again(clock.delay_ns, next.delay_ns);
    again(clock.activation, next.activation);
    again(clock.start_ns, next.start_ns);
    again(clock.sync0_cycle_ns, next.sync0_cycle_ns);
    again(clock.sync1_cycle_ns, next.sync1_cycle_ns);
}

}  // namespace

void ClockWatch::add(Deviation& deviation, std::uint32_t word, Moment at) {
    const auto value = deviation_of(word);
    if (deviation.count++ == 0) {
        deviation.first_ns = deviation.least_ns = deviation.most_ns = value;
        deviation.largest_at = at;
    }
    if (std::abs(value) > std::max(std::abs(deviation.least_ns), std::abs(deviation.most_ns)))
        deviation.largest_at = at;
    deviation.least_ns = std::min(deviation.least_ns, value);
    deviation.most_ns = std::max(deviation.most_ns, value);
    deviation.last_ns = value;
}

void ClockWatch::look(const Exchanged& e, SlaveTrack* slave) {
    const std::uint32_t ado = e.header.address.ado();
    if (!e.answered || e.wkc == 0 || wire::is_logical(e.header.command) || ado >= 0x0A00 ||
        ado + e.received.size() <= reg::kPortReceiveTime.address)
        return;
    look_at_reference(e, slave);
    const bool reads = reads_registers(e.header.command);
    if (slave == nullptr) {
        if (reads)
            if (const auto at = octets_at(e, e.received, reg::kSystemTimeDifference.address, 4))
                add(analysis_.worst_deviation, load_le<std::uint32_t>(*at), e.at);
        // A broadcast also reaches slaves without a clock. So it changes only settings that were seen before.
        if (e.header.command == Command::BWR)
            for (auto& track : slaves_.all()) set_again(slaves_.facts(track).clock, e);
        return;
    }
    auto& clock = slaves_.facts(*slave).clock;
    if (reads)
        if (const auto at = octets_at(e, e.received, reg::kSystemTimeDifference.address, 4))
            add(clock.deviation, load_le<std::uint32_t>(*at), e.at);
    // A read may include many registers, for example 0x0910 to 0x092F. Only written values are settings.
    if (writes_registers(e.header.command)) set(clock, e);
}

void ClockWatch::look_at_reference(const Exchanged& e, const SlaveTrack* slave) {
    if (e.header.command != Command::FRMW && e.header.command != Command::ARMW) return;
    if (e.header.address.ado() != reg::kSystemTime.address || e.received.size() < 4) return;
    auto& reference = analysis_.reference;
    if (slave != nullptr) reference.slave = slave->number;
    std::uint64_t time =
        e.received.size() >= 8 ? load_le<std::uint64_t>(e.received) : load_le<std::uint32_t>(e.received);
    // A time of 32 bits is extended to the time that is nearest to the expected time, because a late reply may be older
    // than the previous one.
    if (e.received.size() < 8 && reference.readings != 0) {
        const auto due = reference.last_ns + static_cast<std::uint64_t>((e.sent_at.at - reference.last.at).count());
        time = due + static_cast<std::uint64_t>(std::int64_t{static_cast<std::int32_t>(
                         static_cast<std::uint32_t>(time) - static_cast<std::uint32_t>(due))});
    }
    if (reference.readings++ == 0) {
        reference.first_ns = time;
        reference.first = e.sent_at;
    }
    reference.last_ns = time;
    reference.last = e.sent_at;
}

void ClockWatch::finish() {
    auto& reference = analysis_.reference;
    const auto recorded = static_cast<double>((reference.last.at - reference.first.at).count());
    const auto passed = static_cast<double>(static_cast<std::int64_t>(reference.last_ns - reference.first_ns));
    constexpr double kLeast = 1e9;  // a shorter time only shows the jitter of the recorder
    constexpr double kMost = 0.01;  // a larger difference: the clock was set
    if (recorded < kLeast) return;
    const double drift = passed / recorded - 1;
    reference.drift_within_ppm = static_cast<double>(analysis_.frames.longest_trip.count()) / recorded * 1e6;
    if (std::abs(drift) < kMost) reference.drift_ppm = drift * 1e6;
}

}  // namespace margay::analyse
