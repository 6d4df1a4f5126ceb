// Finds the kind of clock of a slave by access to its clock registers, because the features register of some chips is
// wrong.
#include "network/clocks.hpp"

#include "network/network.hpp"
#include "station/register_access.hpp"

#include <array>

namespace margay {
namespace {

namespace reg = wire::reg;
using wire::Command;

constexpr Step kKindStep = Step::configure_clocks;

// A read without a reply: the slave has no such register, or the slave is lost. One frame reads the register again,
// together with the type register, which each slave has. Error unstable: the register answers now, so only one frame
// was lost.
Task<Result<ClockKind>> without_register(Station station, wire::Register missing, ClockKind kind) {
    std::array<std::byte, 4> value{};
    std::array<std::byte, 1> type{};
    Link& link = station.engine.link();
    Datagram again(link, Command::FPRD, {station.address, missing.address}, MutableBytes(value));
    Datagram any(link, Command::FPRD, {station.address, reg::kType.address}, MutableBytes(type));
    co_await together(again, any);
    const Error error = error_of_reply(station, any.reply(), kKindStep, reg::kType.address);
    if (error.code != Errc::none) co_return error;
    if (again.reply().ok() && again.reply().wkc == 0) co_return kind;
    co_return station.error(Errc::unstable, kKindStep);
}

// A clock runs if two readings of its time differ. With two different offsets, the upper half of a clock of 64 bits is
// 0 in one of the two readings at most.
Task<Result<ClockKind>> read_kind(Station station) {
    co_await required(read<std::uint8_t>(station, reg::kType, kKindStep));
    auto times = co_await read<std::uint32_t>(station, reg::kPortReceiveTime, kKindStep);
    if (does_not_answer(times.error()))
        co_return co_await required(without_register(station, reg::kPortReceiveTime, ClockKind::none));
    if (!times) co_return times.error();
    std::array<std::uint64_t, 2> seen{};
    for (std::uint64_t& time : seen) {
        const std::uint64_t offset = &time == seen.data() ? 0 : std::uint64_t{1} << 32;
        const auto written = co_await write_clock_register(station, reg::kSystemTimeOffset, offset);
        Result<std::uint64_t> read_time = written.error();
        if (written) read_time = co_await read<std::uint64_t>(station, reg::kSystemTime, kKindStep);
        if (does_not_answer(read_time.error()))
            co_return co_await required(without_register(station, reg::kSystemTime, ClockKind::receive_times));
        if (!read_time) co_return read_time.error();
        time = *read_time;
    }
    if (static_cast<std::uint32_t>(seen[0]) == static_cast<std::uint32_t>(seen[1])) co_return ClockKind::receive_times;
    co_return (seen[0] | seen[1]) >> 32 != 0 ? ClockKind::bits64 : ClockKind::bits32;
}

}  // namespace

Task<Result<>> probe_clock(Network& network, Slave& slave) {
    ClockEntry& clock = network.clocks.of(slave);
    clock.kind = ClockKind::unknown;
    clock.pulse_ns = -1;
    slave.dl.dc = slave.dl.dc_64bit = false;
    constexpr unsigned kMostTries = 3;
    auto kind = co_await read_kind(network.station(slave));
    for (unsigned n = 1; n < kMostTries && kind.error().code == Errc::unstable; ++n)
        kind = co_await read_kind(network.station(slave));
    // A register that can be read, and never accepts a write, is of no use.
    const bool useless = kind.error().code == Errc::unstable;
    if (!kind && !useless) co_return kind.error();
    clock.kind = useless ? ClockKind::receive_times : *kind;
    if (!is_clock(clock.kind)) co_return Nothing{};
    slave.dl.dc = true;
    slave.dl.dc_64bit = clock.kind == ClockKind::bits64;
    co_return co_await required(read_pulse_length(network, slave));
}

}  // namespace margay
