#include "network/members.hpp"

namespace margay {
namespace {

std::uint16_t changed(std::uint16_t counter, std::uint16_t by, bool more) {
    return static_cast<std::uint16_t>(more ? counter + by : counter - by);
}

}  // namespace

void set_takes_part(Network& network, Slave& slave, bool takes_part) {
    if (slave.takes_part == takes_part) return;
    slave.takes_part = takes_part;
    if (slave.config.group >= network.process.groups.size()) return;
    ProcessGroup& group = network.process.groups[slave.config.group];
    const auto fmmus = make_fmmus(slave, group.layout);
    if (!group.mapped || !fmmus) return;
    for (std::size_t n = 0; n < group.statuses.size(); ++n) {
        DatagramStatus& status = group.statuses[n];
        const std::uint16_t share = working_counter_of(*fmmus, group.plans[n]);
        status.accepted = changed(status.accepted, share, takes_part);
        if (!slave.config.optional) continue;
        status.expected = changed(status.expected, share, takes_part);
        group.expected_wkc = takes_part ? group.expected_wkc + share : group.expected_wkc - share;
    }
    for (PreparedFrame& frame : group.prepared) frame.settle();
    if (takes_part) note_joining(group, slave);
    settle_lost_inputs(group);
}

}  // namespace margay
