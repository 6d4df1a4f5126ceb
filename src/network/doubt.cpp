#include "network/doubt.hpp"

#include "network/mailbox_setup.hpp"
#include "network/members.hpp"
#include "network/newcomer.hpp"
#include "network/process_data.hpp"
#include "network/recovery.hpp"
#include "network/transition.hpp"
#include "network/wanted.hpp"

namespace margay {
namespace {

// Whether the cycles of its group show that the slave is present: the interval of the last two cycles was short, and
// the next cycle is not overdue.
bool is_shown_by_cycles(Network& network, const Slave& slave) {
    if (!slave.takes_part || !is_mapped(network, slave)) return false;
    const ProcessGroup& group = network.process.groups[slave.image.group];
    if (group.overlap.sets > 1) return true;
    const CyclePace& pace = group.pace;
    return pace.last <= later(pace.before, Link::kPause) && network.engine.now() <= later(pace.last, Link::kPause);
}

// Doubts the slaves that no cycle shows: they may have been exchanged while the cycles of other slaves continued.
bool doubt_unshown(Network& network) {
    bool any = false;
    for (const Slave& slave : network.slaves()) {
        if (!is_known(slave) || slave.al.state == AlState::none || is_shown_by_cycles(network, slave)) continue;
        network.marks(slave).doubt(false);
        any = true;
    }
    return any;
}

}  // namespace

void doubt_all(Network& network, bool away) {
    for (const Slave& slave : network.slaves())
        if (is_known(slave)) network.marks(slave).doubt(away);
    if (!away) return;
    for (const Slave& slave : network.slaves()) {
        if (!is_known(slave)) continue;
        drop_work(network, slave);  // a waiting sequence, for example a hook, could continue with another machine
        // Mail of a slave in BOOT continues: its firmware may be incomplete, and a device that was exchanged is
        // normally not in BOOT.
        if (network.has_mailbox(slave) && slave.al.state != AlState::boot)
            network.mailbox(slave).interrupt(Errc::identity_unread);
    }
    settle_groups(network);
}

bool note_silence(Network& network) {
    if (network.supervised) return network.silence_noted = false;
    network.silence_noted |= network.engine.link().take_longest_silence() >= kSilentFrames;
    return network.silence_noted;
}

bool doubt_unseen(Network& network) {
    if (network.supervised) return false;
    const bool long_ago = network.is_unobserved();
    bool unseen = network.engine.link().take_pause(network.engine.now()) && long_ago;
    for (ProcessGroup& group : network.process.groups) {
        if (!group.mapped || group.mapping || !is_right(group)) continue;
        unseen |= group.fell_short && group.was_right;
        group.fell_short = false;
        group.was_right = true;
    }
    if (unseen) doubt_all(network, false);
    return unseen || (long_ago && doubt_unshown(network));
}

void doubt_reply(Network& network) {
    if (!network.supervised || network.engine.link().longest_silence() < kSilentFrames) return;
    bool more = false;
    for (const Slave& slave : network.slaves()) {
        if (!is_known(slave) || network.marks(slave).was_away) continue;
        network.marks(slave).doubt(true);
        more = true;
    }
    if (more) settle_groups(network);
}

bool doubt_after_silence(Network& network) {
    if (!note_silence(network)) return false;
    network.silence_noted = false;
    doubt_all(network, true);
    return true;
}

bool is_identity_unread(const Network& network, const Slave& slave) {
    const SlaveMarks& marks = network.marks(slave);
    return marks.was_away && !(slave.al.state == AlState::boot && marks.boot_read);
}

}  // namespace margay
