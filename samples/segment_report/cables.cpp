#include "segment_report/cables.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace margay::segment_report {
namespace {

constexpr unsigned kFull = 255;  // a counter of an ESC stops here

const SlaveState* slave_at(const Report& report, std::optional<std::uint16_t> position) {
    if (!position) return nullptr;
    const auto at = std::ranges::find(report.slaves, *position, [](const SlaveState& s) { return s.facts.position; });
    return at == report.slaves.end() ? nullptr : &*at;
}

EndCounts counts_of(const std::optional<ErrorCounters>& counters, std::uint8_t port) {
    if (!counters) return {};
    return {.damaged = counters->invalid_frames[port],
            .symbols = counters->rx_errors[port],
            .forwarded = counters->forwarded[port],
            .lost_links = counters->lost_links[port]};
}

// The growth of the counts of the cable itself. A counter below its earlier value was cleared in the meantime.
unsigned growth_of(const EndCounts& before, const EndCounts& now) {
    const auto more = [](unsigned from, unsigned to) { return to >= from ? to - from : to; };
    return more(before.damaged, now.damaged) + more(before.symbols, now.symbols) +
           more(before.lost_links, now.lost_links);
}

void add_end(const Report& report, const CableEnd& end, Cable& cable, EndCounts& counts) {
    const SlaveState* slave = slave_at(report, end.slave);
    if (slave == nullptr) return;  // the master's NIC has no counters of an ESC
    cable.known &= slave->counters.has_value();
    counts = counts_of(slave->counters, end.port);
    if (!slave->counters) return;
    if (slave->counters_before) cable.growth += growth_of(counts_of(slave->counters_before, end.port), counts);
    cable.health = std::max(cable.health, ethercat::link_health(*slave->counters, end.port));
}

Cable cable_between(const Report& report, const CableEnd& near, const CableEnd& far, PortType medium) {
    Cable cable{.near = near, .far = far, .medium = medium};
    add_end(report, near, cable, cable.near_counts);
    add_end(report, far, cable, cable.far_counts);
    return cable;
}

std::string master_end_text(const CableEnd& end) {
    if (end.port == kUnknownEnd) return "a slave before the break";
    return end.port == 0 ? "the master" : "the NIC at the end of the ring";
}

std::string counter(unsigned value, std::string_view one, std::string_view many) {
    return fmt::format("{}{} {}", value, value >= kFull ? " or more" : "", value == 1 ? one : many);
}

// The counts at one end.
std::string arrived_text(const CableEnd& at, const CableEnd& from, const EndCounts& counts) {
    std::string text;
    if (counts.damaged != 0)
        text += fmt::format("{} from {} arrived at {}", counter(counts.damaged, "damaged frame", "damaged frames"),
                            end_text(from), end_text(at));
    if (counts.symbols != 0)
        text += fmt::format("{}{} at {}", text.empty() ? "" : ", and ",
                            counter(counts.symbols, "error of the physical layer", "errors of the physical layer"),
                            end_text(at));
    return text;
}

void add_sentence(std::string& text, const std::string& sentence) {
    if (sentence.empty()) return;
    if (!text.empty()) text += "; ";
    text += sentence;
}

// A port of a ring that leads to no slave of the list: to the NIC at the end of the ring, or to slaves that an
// application does not use.
bool leads_out(const Report& report, const SlaveFacts& slave, std::uint8_t port) {
    const Port& facts = slave.ports[port];
    if (!facts.link || !facts.open || facts.neighbour != 0 || port == slave.entry_port) return false;
    return std::ranges::none_of(report.slaves, [&](const SlaveState& other) {
        return other.facts.parent == slave.position && other.facts.parent_port == port;
    });
}

// The port of the last slave that leads to the NIC at the end of the ring: a frame leaves there, and no slave is behind
// it.
std::optional<CableEnd> second_end(const Report& report) {
    for (auto slave = report.slaves.rbegin(); slave != report.slaves.rend(); ++slave)
        for (std::uint8_t port = 0; port < 4; ++port)
            if (leads_out(report, slave->facts, port)) return CableEnd{slave->facts.position, port};
    return std::nullopt;
}

bool is_dark(const SlaveFacts& slave, std::uint8_t port) { return !slave.ports[port].link && !slave.ports[port].open; }

// The end of the cable towards the beginning of the ring, as the list has it.
CableEnd near_end(const SlaveFacts& slave) {
    return slave.parent ? CableEnd{slave.parent, slave.parent_port} : CableEnd{};
}

// Whether the cable towards the beginning of the ring has a link. An application keeps the places of the whole ring, so
// a slave behind the break may have a parent.
bool has_link_before(const Report& report, const SlaveFacts& slave) {
    const SlaveState* const parent = slave_at(report, slave.parent);
    return !is_dark(slave, slave.entry_port) && (parent == nullptr || !is_dark(parent->facts, slave.parent_port));
}

// The slaves behind `root`, and `root` itself.
std::vector<const SlaveState*> slaves_from(const Report& report, const SlaveState& root) {
    std::vector<const SlaveState*> all{&root};
    for (const SlaveState& slave : report.slaves)
        if (std::ranges::find(all, slave_at(report, slave.facts.parent)) != all.end()) all.push_back(&slave);
    return all;
}

// The end of the broken cable at the slaves before the break. Their list begins with `root`. Not set: several ports can
// be this end, because an unused port has no link either.
std::optional<CableEnd> end_before(const Report& report, const SlaveState& root, const SlaveState& behind) {
    const auto is_ebus = [](const SlaveState& slave, std::uint8_t port) {
        return slave.facts.ports[port].type == PortType::ebus;
    };
    std::vector<CableEnd> possible, had_link;
    bool leaves_list = false;  // slaves that are not in the list are behind a port
    for (const SlaveState* slave : slaves_from(report, root)) {
        const SlaveFacts& s = slave->facts;
        for (std::uint8_t port = 0; port < 4; ++port) {
            const bool out = leads_out(report, s, port);
            const bool dark = port != s.entry_port && is_dark(s, port) &&
                              s.ports[port].type != PortType::not_implemented &&
                              is_ebus(*slave, port) == is_ebus(behind, behind.facts.entry_port);
            leaves_list |= out;
            if (out || dark) possible.push_back({s.position, port});
            if (dark && (!slave->counters_before || slave->counters_before->lost_links[port] != 0))
                had_link.push_back(possible.back());
        }
    }
    // Both ends of the cable have counted the loss of the link.
    const bool counted =
        behind.counters_before && behind.counters_before->lost_links[behind.facts.entry_port] != 0 && !leaves_list;
    const auto& ends = counted ? had_link : possible;
    return ends.size() == 1 ? std::optional(ends.front()) : std::nullopt;
}

}  // namespace

RingState ring_of(const Report& report) {
    RingState state{.ring = report.master.devices.size() > 1};
    if (!state.ring) return state;
    const SlaveState* first = nullptr;  // before the break
    for (const SlaveState& slave : report.slaves) {
        const SlaveFacts& s = slave.facts;
        if (has_link_before(report, s) && (s.parent || first == nullptr)) {
            if (!s.parent) first = &slave;
            continue;
        }
        state.behind = s.position;
        state.before = near_end(s);
        if (!s.parent && first != nullptr) {
            const auto end = end_before(report, *first, slave);
            state.before = end.value_or(CableEnd{.port = kUnknownEnd});
        }
        break;
    }
    state.unconnected = !second_end(report);
    return state;
}

std::vector<Cable> cables_of(const Report& report) {
    const auto ring = ring_of(report);
    std::vector<Cable> all;
    for (const SlaveState& slave : report.slaves) {
        const SlaveFacts& s = slave.facts;
        CableEnd near = near_end(s);
        const bool behind = ring.behind == s.position;
        if (behind) near = ring.before;
        all.push_back(cable_between(report, near, {s.position, s.entry_port}, s.ports[s.entry_port].type));
        all.back().broken = behind;
        if (behind) all.back().health = Health::bad;
    }
    if (const auto end = ring.ring ? second_end(report) : std::nullopt) {
        const SlaveState* slave = slave_at(report, end->slave);
        all.push_back(cable_between(report, *end, {std::nullopt, 1}, slave->facts.ports[end->port].type));
    }
    return all;
}

std::vector<LooseEnd> loose_ends(const Report& report, const std::vector<Cable>& cables) {
    const auto has_cable = [&](std::uint16_t slave, std::uint8_t port) {
        return std::ranges::any_of(cables, [&](const Cable& cable) {
            return (cable.near.slave == slave && cable.near.port == port) ||
                   (cable.far.slave == slave && cable.far.port == port);
        });
    };
    std::vector<LooseEnd> all;
    for (const SlaveState& slave : report.slaves)
        for (std::uint8_t port = 0; port < 4 && slave.counters; ++port) {
            const CableEnd end{slave.facts.position, port};
            const Health health = ethercat::link_health(*slave.counters, port);
            if (slave.facts.ports[port].link || health == Health::good || has_cable(slave.facts.position, port))
                continue;
            const EndCounts counts = counts_of(slave.counters, port);
            std::string text;
            if (counts.damaged != 0) text = counter(counts.damaged, "damaged frame", "damaged frames");
            if (counts.symbols != 0)
                text += (text.empty() ? "" : ", ") +
                        counter(counts.symbols, "error of the physical layer", "errors of the physical layer");
            if (counts.lost_links != 0)
                text += (text.empty() ? "" : ", ") + counter(counts.lost_links, "interruption", "interruptions");
            all.push_back({end, health, std::move(text)});
        }
    return all;
}

std::string end_text(const CableEnd& end) {
    return end.slave ? fmt::format("slave {}, port {}", *end.slave, end.port) : master_end_text(end);
}

std::string_view medium_text(PortType type) {
    switch (type) {
        case PortType::ebus: return "E-bus";
        case PortType::mii: return "Ethernet";
        case PortType::not_implemented: return "not there";
        case PortType::not_configured: return "not configured";
    }
    return "?";
}

std::string cable_text(const Cable& cable) {
    const auto name = [](const CableEnd& end) {
        return end.slave ? fmt::format("slave {}", *end.slave) : master_end_text(end);
    };
    return fmt::format("{} between {} and {}", cable.medium == PortType::ebus ? "E-bus contact" : "cable",
                       name(cable.near), name(cable.far));
}

std::string findings_text(const Cable& cable) {
    if (!cable.known) return "the counters could not be read";
    std::string text;
    if (cable.broken) text = "there is no link: the ring is broken here";
    add_sentence(text, arrived_text(cable.far, cable.near, cable.far_counts));
    add_sentence(text, arrived_text(cable.near, cable.far, cable.near_counts));
    if (cable.interruptions() != 0)
        add_sentence(text, "the link was interrupted " + counter(cable.interruptions(), "time", "times"));
    const unsigned marked = std::max(cable.near_counts.forwarded, cable.far_counts.forwarded);
    if (marked != 0 && cable.damaged() == 0)
        add_sentence(text, fmt::format("{} that another slave had marked as damaged passed: their cause is elsewhere",
                                       counter(marked, "frame", "frames")));
    if (cable.growth != 0) add_sentence(text, fmt::format("{} of it came during this report", cable.growth));
    return text;
}

std::string advice_text(const Cable& cable) {
    if (!cable.known || cable.health == ethercat::LinkHealth::good) return {};
    if (cable.broken) return "Connect this cable, or exchange it with its plugs; then check both ports.";
    const bool ebus = cable.medium == PortType::ebus;
    if (cable.damaged() == 0 && cable.symbols() == 0)
        return ebus ? "Each restart of a neighbour counts once. If the number grows in operation: push the terminals "
                      "together, and check the supply of the E-bus."
                    : "Each power-up of a neighbour and each unplugging counts once. If the number grows in operation: "
                      "check the plugs at both ends, the strain relief, and the supply of both devices.";
    if (cable.damaged() == 0)
        return "No frame was damaged yet. Look for electrical disturbance: shield, earthing, cables of motors nearby; "
               "a plug that is not tight.";
    return ebus ? "Push the terminals together and clean the contacts. If it goes on, exchange the device on either "
                  "side, one after the other."
                : "Exchange this cable with its plugs; check shield, earthing and bending radius. If it goes on with "
                  "a new cable, exchange the device that sends towards the counting port, then the other one.";
}

}  // namespace margay::segment_report
