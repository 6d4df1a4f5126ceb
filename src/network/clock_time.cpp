// Reads the system time from the time that the cycles bring. This file is separate, because a program may use this
// function without the other functions of the clocks.
#include "network/clocks.hpp"
#include "network/network.hpp"

namespace margay {

void refresh_system_time(Network& network) {
    Clocks& clocks = network.clocks;
    const bool watched = network.supervised && clocks.settings.watch_interval > Duration{0};
    if (clocks.reference == 0 || watched) return;
    // Nothing looks at the reference here.
    if (clocks.odd_times >= Clocks::kManyOdd) clocks.trusts_next = true;
    for (const ProcessGroup& group : network.process.groups)
        if (group.mapped && group.dc_reference == clocks.reference && group.dc_time.came && group.dc_time.slaves != 0)
            clocks.note_seen_time(group.dc_time.value, is_time_whole(group),
                                  time_sent_at(group, network.engine.link()));
}

}  // namespace margay
