// Distributed clocks.
#include "compat/soem/facade.hpp"

#include <array>
#include <cstring>
#include <ctime>
#include <string>

namespace margay::soem {
namespace {

constexpr std::int64_t kEpoch2000 = 946684800;  // seconds from 1970 to 2000
constexpr std::int64_t kSyncDelay = 100000000;  // SYNC begins at least that much later, ns

// The system time of the clocks at time 0 of the session.
Duration system_time_at_zero(Session& session) {
    timespec now{};
    clock_gettime(CLOCK_REALTIME, &now);
    const std::int64_t wall = (now.tv_sec - kEpoch2000) * 1000000000 + now.tv_nsec;
    return Duration(wall) - session.now().time_since_epoch();
}

void show_receive_times(Session& session, ec_slavet& s) {
    std::array<std::byte, 16> octets{};
    if (read_registers(session, s.configadr, ECT_REG_DCTIME0, octets, us(EC_TIMEOUTRET3)) <= 0) return;
    int32* const times[] = {&s.DCrtA, &s.DCrtB, &s.DCrtC, &s.DCrtD};
    for (std::size_t n = 0; n < 4; ++n) {
        uint32 time = 0;
        std::memcpy(&time, octets.data() + 4 * n, sizeof(time));
        *times[n] = static_cast<int32>(etohl(time));
    }
}

// The chain of clocks, and the first of them for each group.
void link_clocks(ecx_contextt& context) {
    ec_slavet* const slaves = slaves_of(context);
    std::uint16_t before = 0;
    for (int n = 1; n <= slave_count(context); ++n) {
        if (slaves[n].hasdc == 0) continue;
        const auto number = static_cast<uint16>(n);
        slaves[before].DCnext = number;
        slaves[n].DCprevious = before;
        slaves[n].DCnext = 0;
        before = number;
        for (const unsigned group : {0U, unsigned{slaves[n].group}}) {
            if (static_cast<int>(group) >= most_groups(context)) continue;
            ec_groupt& g = groups_of(context)[group];
            if (g.hasdc == 0) g.DCnext = number;
            g.hasdc = TRUE;
        }
    }
    slaves[0].hasdc = before != 0 ? TRUE : FALSE;
}

// The registers of the SYNC signals. `cycle0` 0: a single pulse.
void set_sync(ecx_contextt& context, std::uint16_t number, bool on, std::uint32_t cycle0, std::uint32_t cycle1,
              std::int32_t shift, bool two) {
    const Pinned session = session_of(context);
    if (session == nullptr) return;
    const auto lock = session->lock_eeproms();
    if (!is_slave(context, *session, number)) return;
    ec_slavet& s = slaves_of(context)[number];
    const auto write = [&](std::uint16_t reg, std::uint64_t value, std::size_t size) {
        std::array<std::byte, 8> octets{};
        for (std::size_t n = 0; n < size; ++n) octets[n] = static_cast<std::byte>(value >> (8 * n));
        write_registers(*session, s.configadr, reg, std::span(octets).first(size), us(EC_TIMEOUTRET));
    };
    write(ECT_REG_DCSYNCACT, 0, 1);
    write(ECT_REG_DCCUC, 0, 1);  // the master writes the SYNC registers
    std::array<std::byte, 8> octets{};
    read_registers(*session, s.configadr, ECT_REG_DCSYSTIME, octets, us(EC_TIMEOUTRET));
    std::int64_t now = 0;
    for (std::size_t n = 8; n > 0; --n) now = now << 8 | std::to_integer<std::int64_t>(octets[n - 1]);
    // Both signals together repeat after a whole number of cycles of the first.
    const std::int64_t period =
        two && cycle0 > 0 ? (std::int64_t{cycle1} / cycle0 + 1) * std::int64_t{cycle0} : std::int64_t{cycle0};
    std::int64_t start = now + kSyncDelay + shift;
    if (period > 0) start = (now + kSyncDelay) / period * period + period + shift;
    write(ECT_REG_DCSTART0, static_cast<std::uint64_t>(start), 8);
    write(ECT_REG_DCCYCLE0, cycle0, 4);
    if (two) write(ECT_REG_DCCYCLE1, cycle1, 4);
    if (on) write(ECT_REG_DCSYNCACT, two ? 7 : 3, 1);
    s.DCactive = on ? 1 : 0;
    s.DCshift = shift;
    s.DCcycle = static_cast<int32>(cycle0);
}

}  // namespace
}  // namespace margay::soem

using namespace margay::soem;

extern "C" {

boolean ecx_configdc(ecx_contextt* context) {
    const Pinned session = session_of(context);
    if (session == nullptr || HookCaller::is_refused(*session, "ecx_configdc")) return FALSE;
    // The request of this function waits until no slave is being configured. A hook that is executed during this time
    // needs the second lock.
    const auto configuring = session->lock_configuring();
    const auto eeproms = session->lock_eeproms();
    link_clocks(*context);
    if (slaves_of(*context)[0].hasdc == 0 || !session->is_answered(us(EC_TIMEOUTSAFE))) return FALSE;
    margay::ClockRequest request;
    request.settings.system_time_at_zero = system_time_at_zero(*session);
    // The interface writes delays and offsets, and does not wait until the clocks have adjusted their rates. The frames
    // of the cycle adjust the rates.
    request.settings.burst_frames = 0;
    request.settings.measurements = 1;
    request.settings.settle = margay::Duration{0};
    request.settings.timeout = margay::Duration{0};
    // Frames or a slave may be lost. When the slave is known to be lost, the other slaves get their delays and offsets
    // without it.
    constexpr int kMostTries = 5;
    const auto failed = [](const auto& done) { return !done && done.error().code != margay::Errc::not_in_sync; };
    auto done = session->run(request);
    for (int n = 1; n < kMostTries && failed(done); ++n) {
        margay::ReadStateRequest states;
        static_cast<void>(session->run(states));
        done = session->run(request);
    }
    if (failed(done)) {
        if (session->closing()) return FALSE;
        std::array<char, 384> text{};
        say("ec_configdc: " + std::string(describe(done.error(), text)));
        return FALSE;
    }
    for (int n = 1; n <= slave_count(*context); ++n) {
        ec_slavet& s = slaves_of(*context)[n];
        if (s.hasdc == 0) continue;
        show_receive_times(*session, s);
        const Session::Guard guard(*session);
        s.pdelay = static_cast<int32>(slave_clock(session->context(), static_cast<uint16>(n)).delay_ns);
    }
    return TRUE;
}

void ecx_dcsync0(ecx_contextt* context, uint16 slave, boolean act, uint32 CyclTime, int32 CyclShift) {
    set_sync(*context, slave, act != FALSE, CyclTime, 0, CyclShift, false);
}

void ecx_dcsync01(ecx_contextt* context, uint16 slave, boolean act, uint32 CyclTime0, uint32 CyclTime1,
                  int32 CyclShift) {
    set_sync(*context, slave, act != FALSE, CyclTime0, CyclTime1, CyclShift, true);
}

}  // extern "C"
