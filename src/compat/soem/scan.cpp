// Finds the slaves, and fills in the data of each slave that is known before its process data is mapped.
#include "compat/soem/facade.hpp"
#include "compat/soem/inbox.hpp"

#include <cstring>

namespace margay::soem {
namespace {

void fill_sii(ec_slavet& s, const Slave& from) {
    s.eep_man = from.identity.vendor;
    s.eep_id = from.identity.product;
    s.eep_rev = from.identity.revision;
    set_serial(s, from.identity.serial);
    s.mbx_l = from.mailbox.out_bytes;
    s.mbx_wo = from.mailbox.out_start;
    s.mbx_rl = from.mailbox.in_bytes;
    s.mbx_ro = from.mailbox.in_start;
    s.mbx_proto = from.mailbox.protocols;
    s.CoEdetails = from.coe_details;
    s.FoEdetails = from.foe_details;
    s.EoEdetails = from.eoe_details;
    s.Ebuscurrent = from.ebus_current_ma;
    s.FMMU0func = static_cast<uint8>(from.fmmu_use[0]);
    s.FMMU1func = static_cast<uint8>(from.fmmu_use[1]);
    s.FMMU2func = static_cast<uint8>(from.fmmu_use[2]);
    s.FMMU3func = static_cast<uint8>(from.fmmu_use[3]);
    for (std::size_t n = 0; n < EC_MAXSM && n < from.sm_count; ++n) {
        const SmInfo& sm = from.sync_managers[n];
        s.SM[n].StartAddr = htoes(sm.start);
        s.SM[n].SMlength = htoes(sm.length_bytes);
        s.SM[n].SMflags = htoel(static_cast<uint32>(sm.control | (sm.enable & 1U) << 16));
        s.SMtype[n] = static_cast<uint8>(sm.type);
    }
    const auto name = from.name();
    const std::size_t size = std::min(name.size(), std::size_t{EC_MAXNAME});
    std::copy_n(name.data(), size, s.name);
    s.name[size] = '\0';
}

void fill_topology(ec_slavet& s, const Slave& from) {
    for (std::size_t n = 0; n < from.ports.size(); ++n) {
        if (from.ports[n].open) {
            s.activeports = static_cast<uint8>(s.activeports | 1U << n);
            ++s.topology;
        }
        s.ptype = static_cast<uint8>(s.ptype | static_cast<unsigned>(from.ports[n].type) << (2 * n));
    }
    s.consumedports = s.activeports;
    s.parent = from.parent;
    s.parentport = from.parent_port;
    s.entryport = from.entry_port;
}

// Reads data of the interface that no other part of the library reads.
void read_more(Session& session, ec_slavet& s) {
    std::array<std::byte, 2> word{};
    if (read_registers(session, s.configadr, ECT_REG_PDICTL, word, us(EC_TIMEOUTRET3)) > 0)
        s.Itype = word_at(word.data());
    if (read_registers(session, s.configadr, ECT_REG_EEPSTAT, word, us(EC_TIMEOUTRET3)) > 0)
        s.eep_8byte = (word_at(word.data()) & EC_ESTAT_R64) != 0 ? 1 : 0;
    if (read_registers(session, s.configadr, ECT_REG_EEPCFG, std::span(word).first(1), us(EC_TIMEOUTRET3)) > 0)
        s.eep_pdi = std::to_integer<uint8>(word[0] & std::byte{1});
}

void fill_slave(ecx_contextt& context, Session& session, std::uint16_t number) {
    ec_slavet& s = slaves_of(context)[number];
    {
        const Session::Guard guard(session);
        const Slave& from = session.slave(number);
        s.configadr = from.station_address.value;
        s.aliasadr = from.alias;
        s.hasdc = from.dl.dc ? TRUE : FALSE;
        s.state = from.al.state == AlState::none ? uint16{EC_STATE_NONE} : uint16{EC_STATE_INIT};
        fill_sii(s, from);
        fill_topology(s, from);
        // Set only if this chip refuses LRW or is configured without it. The program may set it for other slaves.
        constexpr unsigned kNoLrw = 0x0800;  // of the features register
        s.blockLRW = (from.dl.features & kNoLrw) != 0 || from.config.block_lrw ? 1 : 0;
    }
    read_more(session, s);
    // The name in the interface is the first string of the SII, not the string that the SII marks as the name.
    char first[EC_MAXNAME + 1] = "";
    ecx_siistring(&context, first, number, 1);
    const Session::Guard guard(session);
    if (first[0] != '\0') std::memcpy(s.name, first, sizeof(s.name));
    std::memcpy(session.shown(number).data(), s.SM, sizeof(s.SM));
    ec_slavet& all = slaves_of(context)[0];
    all.Ebuscurrent = static_cast<int16>(all.Ebuscurrent + s.Ebuscurrent);
    all.blockLRW = static_cast<uint8>(all.blockLRW + s.blockLRW);
    if (s.blockLRW != 0) ++groups_of(context)[0].blockLRW;
    groups_of(context)[0].Ebuscurrent = all.Ebuscurrent;
}

// Prints which contents of a slave's SII the library cannot use, for example mailboxes that do not fit into a frame.
// All services of the slave then return 0, and the list of errors stays empty.
void say_unusable_sii(Session& session, std::uint16_t number) {
    std::array<char, 256> text{};
    std::string_view sentence;
    {
        const Session::Guard guard(session);
        const Error& error = session.slave(number).error;
        if (error.step == Step::parse_sii) sentence = describe(error, text);
    }
    if (!sentence.empty()) say_once(std::string(sentence));
}

void clear(ecx_contextt& context, Session& session) {
    const Session::Guard guard(session);
    slave_count(context) = 0;
    std::memset(static_cast<void*>(slaves_of(context)), 0,
                sizeof(ec_slavet) * static_cast<std::size_t>(most_slaves(context)));
    std::memset(static_cast<void*>(groups_of(context)), 0,
                sizeof(ec_groupt) * static_cast<std::size_t>(most_groups(context)));
    for (int n = 0; n < most_groups(context); ++n)
        groups_of(context)[n].logstartaddr = static_cast<uint32>(n) << EC_LOGGROUPOFFSET;
    context.esislave = 0;
    std::fill_n(sii_known(context), EC_MAXEEPBITMAP, 0U);
}

// Reads the AL status of the slave, stores it, and returns the state.
int read_state(ecx_contextt& context, Session& session, std::uint16_t number) {
    std::array<std::byte, 6> octets{};
    ec_slavet& slave = slaves_of(context)[number];
    const std::uint16_t station = value_of(context, session, number, &ec_slavet::configadr);
    const bool there = read_registers(session, station, ECT_REG_ALSTAT, octets, us(EC_TIMEOUTRET3)) == 1;
    const auto state = there ? static_cast<uint16>(word_at(octets.data()) & 0x1F) : uint16{EC_STATE_NONE};
    const Session::Guard guard(session);
    slave.state = state;
    slave.ALstatuscode = there ? word_at(octets.data() + 4) : uint16{0};
    return state & 0xF;
}

std::vector<std::uint16_t> slaves_without_answer(ecx_contextt& context, Session& session) {
    ReadStateRequest states;
    static_cast<void>(session.run(states));
    const Session::Guard guard(session);
    std::vector<std::uint16_t> lost;
    for (int n = 1; n <= slave_count(context); ++n)
        if (session.slave(static_cast<std::size_t>(n)).al.state == AlState::none)
            lost.push_back(static_cast<std::uint16_t>(n));
    return lost;
}

bool no_slaves(const Error& error) {
    return error.slave == 0 && (error.code == Errc::no_slaves || error.code == Errc::no_frame ||
                                error.code == Errc::link_down || error.code == Errc::nic);
}

}  // namespace

namespace {

int find_slaves(ecx_contextt& context, Session& session) {
    session.forget_lost(0);
    // Waits for the link only as long as the interface waits for the first frame. The library would wait longer.
    for (const Time until = later(session.now(), us(EC_TIMEOUTSAFE)); session.link_is_down() && !session.closing();) {
        if (session.now() >= until) return EC_NOFRAME;
        session.pause(std::chrono::milliseconds(1));
    }
    if (!session.is_answered(us(3 * EC_TIMEOUTSAFE))) return EC_NOFRAME;
    constexpr int kMostTries = 3;  // all frames of the first step may be lost
    ScanRequest request;
    auto scanned = session.run(request);
    for (int n = 1; n < kMostTries && !scanned && scanned.error().slave == 0 && scanned.error().code == Errc::no_frame;
         ++n)
        scanned = session.run(request);
    if (!scanned && no_slaves(scanned.error())) return scanned.error().code == Errc::no_slaves ? 0 : EC_NOFRAME;
    if (!scanned && scanned.error().slave == 0 && scanned.error().code == Errc::capacity) return EC_SLAVECOUNTEXCEEDED;
    int found = 0;
    {
        const Session::Guard guard(session);
        session.inbox().clear();
        found = static_cast<int>(session.context().slaves().size());
        if (found >= most_slaves(context)) return EC_SLAVECOUNTEXCEEDED;
        slave_count(context) = found;
    }
    for (int n = 1; n <= found; ++n) {
        fill_slave(context, session, static_cast<std::uint16_t>(n));
        say_unusable_sii(session, static_cast<std::uint16_t>(n));
    }
    if (context.manualstatechange != 0) {
        WriteStateRequest down;
        down.wanted = AlState::init;
        static_cast<void>(session.run(down));
    }
    return found;
}

}  // namespace

int config_init(ecx_contextt& context) {
    const Pinned session = session_of(context);
    if (session == nullptr || HookCaller::is_refused(*session, "ecx_config_init")) return EC_NOFRAME;
    const auto configuring = session->lock_configuring();
    const auto eeproms = session->lock_eeproms();
    clear(context, *session);
    const int found = find_slaves(context, *session);
    if (!session->closing()) return found;
    clear(context, *session);  // another thread closes the master, and what was read of the slaves is not complete
    return EC_NOFRAME;
}

}  // namespace margay::soem

using namespace margay::soem;

extern "C" {

int ecx_recover_slave(ecx_contextt* context, uint16 slave, int timeout) {
    const Pinned session = session_of(context);
    if (session == nullptr) return 0;
    const auto configuring = session->lock_configuring();
    const auto eeproms = session->lock_eeproms();
    if (!is_slave(*context, *session, slave)) return 0;
    std::array<std::byte, 2> octets{};
    const std::uint16_t station = slaves_of(*context)[slave].configadr;
    if (read_registers(*session, station, ECT_REG_STADR, octets, us(timeout)) == 1)
        return session->settle_lost(slave) ? 1 : 0;
    if (HookCaller::is_refused(*session, "ecx_recover_slave")) return 0;
    // When frames are lost, slaves may have their addresses again without the library knowing them.
    constexpr int kMostTries = 5;
    margay::RecoverRequest request;
    request.slave = slave;
    bool found = false;
    for (int n = 0; n < kMostTries && !found; ++n) {
        if (!session->is_answered(us(EC_TIMEOUTSAFE))) return 0;
        session->note_lost(slaves_without_answer(*context, *session));
        found = session->run(request).ok();
    }
    return found && session->settle_lost(slave) ? 1 : 0;
}

int ecx_reconfig_slave(ecx_contextt* context, uint16 slave, int) {
    const Pinned session = session_of(context);
    if (session == nullptr || !is_slave(*context, *session, slave)) return 0;
    if (HookCaller::is_refused(*session, "ecx_reconfig_slave")) return 0;
    bool configured = false;
    if (session->is_answered(us(EC_TIMEOUTSAFE))) {
        HookCaller hooks(*context, *session, kVersionCallsContextHooks);
        if (!is_slave(*context, *session, slave)) return 0;  // there was another scan
        hooks.attach(slave);
        take_mailboxes(*context, *session, slave, margay::AlState::preop);
        margay::ReconfigRequest request;
        request.slave = slave;
        configured = session->run(request, &hooks).ok();
        if (configured) session->forget_lost(slave);
    }
    const int state = read_state(*context, *session, slave);
    return configured || state < EC_STATE_SAFE_OP ? state : 0;
}

}  // extern "C"
