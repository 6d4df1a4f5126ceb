// The part of the page about cables.
#include "segment_report/page.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace margay::segment_report {
namespace {

std::string counts_text(const CableEnd& end, const EndCounts& counts) {
    if (!end.slave) return "—";
    return fmt::format("{} / {} / {} / {}", counts.damaged, counts.symbols, counts.forwarded, counts.lost_links);
}

Severity severity_of(const Cable& cable) {
    if (cable.health == Health::bad) return Severity::fault;
    return cable.health == Health::doubtful || !cable.known ? Severity::remark : Severity::good;
}

Markup verdict_of(const Cable& cable) {
    const auto found = findings_text(cable);
    if (found.empty()) return tag("span", "class=\"soft\"", "nothing counted");
    return Markup(found) + "." + (advice_text(cable).empty() ? Markup() : Markup::raw("<br/>") + advice_text(cable));
}

Markup cable_end(const CableEnd& end) {
    if (!end.slave && end.port == kUnknownEnd) return "a slave before the break";
    if (!end.slave) return end.port == 0 ? "master" : "NIC at the end of the ring";
    return slave_link(*end.slave) + fmt::format(" port {}", end.port);
}

Markup cables_table(const std::vector<const Cable*>& cables, std::string_view id) {
    Table table({{"From"}, {"To"}, {"Medium"}, {"Counters at From"}, {"Counters at To"}, {"Verdict and what to do"}});
    for (const Cable* cable : cables) {
        const auto severity = severity_of(*cable);
        table.add({cable_end(cable->near), cable_end(cable->far), medium_text(cable->medium),
                   code(counts_text(cable->near, cable->near_counts)), code(counts_text(cable->far, cable->far_counts)),
                   verdict_of(*cable)},
                  severity == Severity::fault    ? "fault"
                  : severity == Severity::remark ? "remark"
                                                 : "");
    }
    return table.markup(id);
}

Markup other_counters(const Report& report, const std::vector<Cable>& cables) {
    const bool damaged = std::ranges::any_of(cables, [](const Cable& cable) { return cable.damaged() != 0; });
    Table table({{"Pos.", true}, {"Name"}, {"Frames not processed", true}, {"PDI errors", true}, {"What to do"}});
    for (const SlaveState& slave : report.slaves) {
        if (!slave.counters || (slave.counters->processing_unit == 0 && slave.counters->pdi == 0)) continue;
        std::string advice;
        if (slave.counters->processing_unit != 0)
            advice = damaged
                         ? "Frames that a cable has damaged are not processed: mend the cable. "
                         : "Frames that are no EtherCAT frames, or were damaged before: keep other traffic off this "
                           "network. ";
        if (slave.counters->pdi != 0)
            advice += "The processor of the device and its ESC disagree: a matter of the device and its firmware.";
        table.add({slave_link(slave.facts.position), slave.facts.name, fmt::to_string(slave.counters->processing_unit),
                   fmt::to_string(slave.counters->pdi), advice},
                  "remark");
    }
    return table.empty() ? Markup() : tag("h3", "Counters inside of slaves") + table.markup("inner-counters");
}

}  // namespace

Markup cables_section(const Report& report, const std::vector<Cable>& cables) {
    constexpr std::size_t kShort = 24;  // a table that is shown as a whole
    if (cables.empty()) return {};
    std::vector<const Cable*> all, faulty;
    for (const Cable& cable : cables) {
        all.push_back(&cable);
        if (severity_of(cable) != Severity::good) faulty.push_back(&cable);
    }
    Markup content = paragraph(
        "Counters are: damaged frames / errors of the physical layer / frames that another slave had marked / lost "
        "links. They count what arrives at a port since the slave was switched on or the counters were cleared, and "
        "stop "
        "at 255. The fault is on the way to the port that counts: the cable, its plugs, or the sender.");
    if (all.size() <= kShort) return content + cables_table(all, "cable-table") + other_counters(report, cables);
    if (!faulty.empty())
        content += tag("h3", "Cables with errors") + cables_table(faulty, "faulty-cables");
    else
        content += paragraph("No error was counted on any cable.");
    return content + other_counters(report, cables) +
           folded(fmt::format("All {} cables", all.size()), cables_table(all, "cable-table"));
}

}  // namespace margay::segment_report
