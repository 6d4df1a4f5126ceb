// The SYNC signals of a slave of an ENI file.
#include "files/eni_read.hpp"

namespace margay::files {
namespace {

// Settings of SYNC signals that the init commands contain.
struct SyncSeen {
    std::optional<std::uint16_t> activation{};
    std::optional<std::uint32_t> cycle0{};
    std::optional<std::uint32_t> cycle1{};
};

// The settings of the command, added to the known settings.
SyncSeen sync_of(const EniInit& init, const SyncSeen& known) {
    const auto covers = [&](std::uint16_t address) {
        return init.ado <= address && address < init.ado + init.data.size();
    };
    const auto at = [&](std::uint16_t address, std::size_t octets) {
        return static_cast<std::uint32_t>(init.value(address - init.ado, octets));
    };
    SyncSeen given;
    const std::uint32_t before = known.activation.value_or(0);  // the command may write either register or both
    const std::uint32_t low = covers(0x0980) ? at(0x0980, 1) : before & 0xFF;
    const std::uint32_t high = covers(0x0981) ? at(0x0981, 1) : before >> 8;
    if (covers(0x0980) || covers(0x0981)) given.activation = static_cast<std::uint16_t>(high << 8 | low);
    if (covers(0x09A0)) given.cycle0 = at(0x09A0, 4);
    if (covers(0x09A4)) given.cycle1 = at(0x09A4, 4);
    return given;
}

template <class T>
bool is_other(const std::optional<T>& given, const std::optional<T>& known) {
    return given && *given != 0 && given != known;
}

bool both_give(const SyncSeen& a, const SyncSeen& b) {
    return (a.activation && b.activation) || (a.cycle0 && b.cycle0) || (a.cycle1 && b.cycle1);
}

// The library sets the signals at PS. Settings of the file at another step on the way to OP are only used if the file
// has no settings at PS.
bool is_used(Reader& r, const EniInit& init, const SyncSeen& given, const SyncSeen& seen, const SyncSeen& at_ps) {
    if (contains(init.transitions, Transition::preop_to_safeop)) return true;
    const bool other = is_other(given.activation, seen.activation) || is_other(given.cycle0, seen.cycle0) ||
                       is_other(given.cycle1, seen.cycle1);
    if (!other) return false;
    const bool taken = both_give(given, seen);
    const bool up =
        contains(init.transitions, Transition::init_to_preop) || contains(init.transitions, Transition::safeop_to_op);
    const std::string what = "the init command for SYNC signals (" + hex(init.ado) + ") is not of PS: ";
    r.remark(init.node,
             what + (taken ? both_give(given, at_ps) ? "it is not sent, what the commands of PS give is used"
                                                     : "it is not sent, what a command before it gives is used"
                     : up  ? "the library sets SYNC signals at PS"
                           : "it is not sent, the library sets SYNC signals at PS"));
    return up && !taken;
}

}  // namespace

void read_eni_sync(Reader& r, EniSlaveData& s) {
    SyncSeen seen;
    SyncSeen seen_at_ps;
    for (const bool at_ps : {true, false}) {
        seen_at_ps = seen;
        for (const EniInit& init : s.inits) {
            const bool here = init.ado >= 0x0980 && init.ado < 0x09B0 && init.writes();
            if (!here || init.transitions == Transition::none) continue;
            if (contains(init.transitions, Transition::preop_to_safeop) != at_ps) continue;
            const SyncSeen given = sync_of(init, seen);
            if (!is_used(r, init, given, seen, seen_at_ps)) continue;
            if (given.activation) seen.activation = given.activation;
            if (given.cycle0) seen.cycle0 = given.cycle0;
            if (given.cycle1) seen.cycle1 = given.cycle1;
        }
    }
    SyncSettings& dc = s.setup.dc;
    if (seen.activation) dc.assign_activate = *seen.activation;
    s.uses_clock = seen.activation.value_or(0) != 0;
    if (s.uses_clock) dc.source = SyncSettings::Source::application;
    if (seen.cycle0) dc.sync0_cycle = Duration(*seen.cycle0);
    if (seen.cycle1) dc.sync1_cycle = Duration(*seen.cycle1);
}

}  // namespace margay::files
