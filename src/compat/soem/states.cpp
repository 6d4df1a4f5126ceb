// The AL states of the slaves.
#include "compat/soem/facade.hpp"

namespace margay::soem {

void copy_state(ecx_contextt& context, Session& session, std::uint16_t number) {
    ec_slavet& slave = slaves_of(context)[number];
    const AlStatus& status = session.slave(number).al;
    slave.state = raw_state(status);
    slave.ALstatuscode = status.code;
}

namespace {

// No frame has come back, or none could be sent, or another thread closes the master.
bool is_silent(const Error& error) {
    return error.code == Errc::no_frame || error.code == Errc::nic || error.code == Errc::nic_busy ||
           error.code == Errc::link_down || error.code == Errc::canceled;
}

// Reads the AL status of all slaves. False: no slave answers.
bool read_all(Session& session) {
    if (!session.is_answered()) return false;
    ReadStateRequest request;
    const auto read = session.run(request);
    return read.ok() || !is_silent(read.error());
}

// Before a scan has shown slaves to the program, or when it has found too many, a broadcast reads the AL status of all
// slaves, combined by OR, and the AL status code. No value: a scan has found slaves.
struct Broadcast {
    std::uint16_t state = EC_STATE_NONE;
    std::uint16_t code = 0;
};
std::optional<Broadcast> ask_unknown(ecx_contextt& context, Session& session) {
    {
        const Session::Guard guard(session);
        if (slave_count(context) > 0 && !session.context().slaves().empty()) return std::nullopt;
    }
    std::array<std::byte, 6> octets{};
    const int wkc = session.exchange(DatagramCommand::brd, address_of(0, ECT_REG_ALSTAT), octets, us(EC_TIMEOUTRET));
    if (wkc <= 0) return Broadcast{};
    return Broadcast{.state = static_cast<std::uint16_t>(word_at(octets.data()) & 0x1F),
                     .code = word_at(octets.data() + 4)};
}

// Sets the state from the broadcast for each slave that was counted. With the lock.
void show_all(ecx_contextt& context, const Broadcast& all) {
    for (int n = 0; n <= slave_count(context); ++n) {
        slaves_of(context)[n].state = all.state;
        slaves_of(context)[n].ALstatuscode = all.code;
    }
}

// The AL status of all slaves at once: combined by OR, as a broadcast reads it. With the lock.
std::uint16_t combined(ecx_contextt& context, Session& session) {
    std::uint16_t all = 0;
    for (int n = 1; n <= slave_count(context); ++n) all |= raw_state(session.slave(static_cast<std::size_t>(n)).al);
    return all;
}

// A slave without a mailbox for BOOT gets the request too, and responds with an AL status code.
int write_boot(Session& session, std::uint16_t number, std::uint16_t value) {
    bool has_mailbox = false;
    std::uint16_t station = 0;
    {
        const Session::Guard guard(session);
        has_mailbox = session.slave(number).boot_mailbox.present();
        station = session.slave(number).station_address.value;
    }
    if (!has_mailbox) {
        std::array<std::byte, 2> octets{};
        put_word(octets.data(), value);
        return std::max(
            0, session.exchange(DatagramCommand::fpwr, address_of(station, ECT_REG_ALCTL), octets, us(EC_TIMEOUTRET3)));
    }
    StateRequest request;
    request.slave = number;
    request.wanted = AlState::boot;
    return session.run(request) ? 1 : 0;
}

}  // namespace
}  // namespace margay::soem

using namespace margay::soem;
using margay::DatagramCommand;

extern "C" {

int ecx_readstate(ecx_contextt* context) {
    const Pinned session = session_of(context);
    if (session == nullptr) return EC_STATE_NONE;
    if (const auto all = ask_unknown(*context, *session)) {
        const Session::Guard guard(*session);
        show_all(*context, *all);
        return all->state & 0xF;
    }
    ec_slavet* const slaves = slaves_of(*context);
    const bool answered = read_all(*session);
    const Session::Guard guard(*session);
    std::uint16_t lowest = 0;
    std::uint16_t codes = 0;
    for (int n = 1; n <= slave_count(*context); ++n) {
        const auto number = static_cast<std::uint16_t>(n);
        copy_state(*context, *session, number);
        if (!answered) slaves[n].state = EC_STATE_NONE;
        codes |= slaves[n].ALstatuscode;
        if (n == 1 || (slaves[n].state & 0xF) < (lowest & 0xF)) lowest = slaves[n].state;
    }
    slaves[0].state = lowest;
    slaves[0].ALstatuscode = codes;
    return lowest & 0xF;
}

int ecx_writestate(ecx_contextt* context, uint16 slave) {
    const Pinned session = session_of(context);
    if (session == nullptr || slave >= most_slaves(*context)) return EC_NOFRAME;
    std::uint16_t value = 0;
    std::uint16_t station = 0;
    int slaves = 0;
    bool known = false;
    {
        const Session::Guard guard(*session);  // another thread may read the states, or search the slaves
        value = slaves_of(*context)[slave].state;
        station = slave == 0 ? std::uint16_t{0} : slaves_of(*context)[slave].configadr;
        slaves = slave_count(*context);
        known = slaves > 0 && session->slave(1).number == 1 && slave <= slaves;
    }
    const auto state = static_cast<margay::AlState>(value & 0xF);
    // In a hook the request would wait for the configuration that has called the hook.
    if (!known || state == margay::AlState::none || session->in_hook()) {
        std::array<std::byte, 2> octets{};
        put_word(octets.data(), value);
        const auto command = slave == 0 ? DatagramCommand::bwr : DatagramCommand::fpwr;
        return session->exchange(command, address_of(station, ECT_REG_ALCTL), octets, us(EC_TIMEOUTRET3));
    }
    if (!session->is_answered()) return EC_NOFRAME;
    (void)session->settle_lost(slave);
    const int all = slave == 0 ? slaves : 1;
    const int first = slave == 0 ? 1 : slave;
    const int last = slave == 0 ? slaves : slave;
    if (state == margay::AlState::boot || state == margay::AlState::preop)
        for (int n = first; n <= last; ++n) take_mailboxes(*context, *session, static_cast<std::uint16_t>(n), state);
    if (state == margay::AlState::boot) {
        int changed = 0;
        for (int n = first; n <= last; ++n) changed += write_boot(*session, static_cast<std::uint16_t>(n), value);
        return changed;
    }
    margay::WriteStateRequest request;
    request.slave = slave;
    request.wanted = state;
    const auto written = session->run(request);
    if (written) return all;
    if (is_silent(written.error())) return EC_NOFRAME;
    // The request was sent to all slaves that respond.
    return slave == 0 ? session->answers() : 0;
}

uint16 ecx_statecheck(ecx_contextt* context, uint16 slave, uint16 reqstate, int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr || (slave != 0 && !is_slave(*context, *session, slave))) return 0;
    ec_slavet& asked = slaves_of(*context)[slave];
    const margay::Time until = margay::later(session->now(), us(timeout));
    for (;;) {
        const auto unknown = slave == 0 ? ask_unknown(*context, *session) : std::nullopt;
        const bool answered = unknown || read_all(*session);
        std::uint16_t low = 0;
        {
            const Session::Guard guard(*session);
            if (unknown)
                asked.state = unknown->state;
            else if (!answered)
                asked.state = EC_STATE_NONE;
            else if (slave == 0)
                asked.state = combined(*context, *session);
            else
                copy_state(*context, *session, slave);
            low = asked.state & 0xF;
        }
        if (low == (reqstate & 0xF) || session->now() >= until || session->closing()) return low;
        session->pause(std::chrono::milliseconds(1));
    }
}

}  // extern "C"
