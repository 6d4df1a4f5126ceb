// The parts of the page about process data: image, alike devices, cycles, clock log.
#include "segment_report/page.hpp"

#include "ethercat/values.hpp"
#include "segment_report/image_entries.hpp"
#include "segment_report/plot.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace margay::segment_report {
namespace {

constexpr std::size_t kOpenEntries = 60;  // a table of this many entries is shown as a whole

Markup entry_title(const ImageEntry& entry) {
    if (entry.index == 0) return entry.name.empty() ? tag("span", "class=\"soft\"", "gap") : Markup(entry.name);
    return entry.name.empty() ? tag("span", "class=\"soft\"", "(no name)") : Markup(entry.name);
}

Markup entries_table(const std::vector<const ImageEntry*>& entries) {
    Table table(
        {{"Offset", true}, {"Bits", true}, {"Pos.", true}, {"SM"}, {"PDO"}, {"Object"}, {"Name"}, {"Type"}, {"Value"}});
    for (const ImageEntry* e : entries)
        table.add(
            {fmt::format("{}.{}", e->bit / 8, e->bit % 8), fmt::to_string(e->bits), slave_link(e->position),
             fmt::format("{} {}", e->sync_manager, e->input ? "in" : "out"),
             e->pdo == 0 ? Markup() : code(fmt::format("0x{:04X}", e->pdo)),
             e->index == 0 ? Markup() : code(fmt::format("0x{:04X}:{:02X}", e->index, e->subindex)), entry_title(*e),
             e->data_type == 0 || e->index == 0 ? std::string() : ethercat::type_text(e->data_type),
             e->value.size() > 16 ? tag("code", "class=\"long\"", e->value) : code(e->value)},
            e->index == 0 ? "gap" : "");
    return table.markup();
}

std::string name_at(const Report& report, std::uint16_t position) {
    for (const SlaveState& slave : report.slaves)
        if (slave.facts.position == position) return slave.facts.name;
    return {};
}

Markup domain_entries(const Report& report, const DomainFacts& domain) {
    const auto entries = image_entries(report, domain);
    std::vector<const ImageEntry*> all;
    for (const ImageEntry& entry : entries) all.push_back(&entry);
    if (all.size() <= kOpenEntries) return all.empty() ? Markup() : entries_table(all);
    Markup content;
    for (const SlaveState& slave : report.slaves) {
        std::vector<const ImageEntry*> own;
        for (const ImageEntry* entry : all)
            if (entry->position == slave.facts.position) own.push_back(entry);
        if (own.empty()) continue;
        const auto first = own.front()->bit;
        content +=
            folded(Markup(fmt::format("{} {}", slave.facts.position, name_at(report, slave.facts.position))) + " " +
                       tag("small", fmt::format("from offset {}.{}, {}", first / 8, first % 8,
                                                counted(own.size(), "entry", "entries"))),
                   entries_table(own));
    }
    return content;
}

std::string_view kind_text(Difference::Kind kind) {
    switch (kind) {
        case Difference::Kind::device: return "device";
        case Difference::Kind::setting: return "setting";
        case Difference::Kind::live: return "live value";
        case Difference::Kind::own: return "its own";
    }
    return "";
}

Markup variants_cell(const Difference& difference) {
    Markup cell;
    for (const Variant& variant : difference.variants)
        cell += tag("div", (variant.value.empty() ? tag("span", "class=\"soft\"", "(empty)")
                                                  : tag("code", "class=\"long\"", variant.value)) +
                               " " + tag("small", slaves_text(variant.positions)));
    return cell;
}

Markup differences_table(const std::vector<const Difference*>& differences) {
    Table table({{"Kind"}, {"What"}, {"Name"}, {"Values"}});
    for (const Difference* d : differences) {
        const bool matters = d->kind == Difference::Kind::device || d->kind == Difference::Kind::setting;
        table.add({kind_text(d->kind), d->what, d->name, variants_cell(*d)}, matters ? "remark" : "");
    }
    return table.markup();
}

Markup group_markup(const AlikeGroup& group) {
    Markup content =
        tag("h3", fmt::format("{}: {}", group.name.empty() ? "(no name)" : group.name, slaves_text(group.positions)));
    std::vector<const Difference*> matter, natural;
    for (const Difference& difference : group.differences)
        (difference.kind == Difference::Kind::live || difference.kind == Difference::Kind::own ? natural : matter)
            .push_back(&difference);
    content += paragraph("Vendor " + code(fmt::format("0x{:08x}", group.vendor)) + ", product " +
                         code(fmt::format("0x{:08x}", group.product)) +
                         (group.objects == 0 ? std::string("; no object dictionaries were compared.")
                                             : fmt::format("; {} of the dictionary compared.",
                                                           counted(group.objects, "entry", "entries"))));
    if (matter.empty())
        content += paragraph(tag("span", "class=\"good\"",
                                 !group.partly_read
                                     ? "Revision, firmware, EEPROM and settings are the same."
                                     : "What could be read of revision, firmware, EEPROM and settings is the same."));
    else
        content += differences_table(matter);
    if (!natural.empty())
        content += folded(counted(natural.size(), "value that differs by its nature or changes by itself",
                                  "values that differ by their nature or change by themselves"),
                          differences_table(natural));
    return content + list_of(group.remarks);
}

}  // namespace

Markup image_section(const Report& report) {
    if (!report.domains_problem.empty())
        return paragraph("The process data could not be mapped: " + report.domains_problem);
    if (report.slaves.empty() || (report.domains.empty() && !report.mapped)) return {};
    Markup content;
    for (const DomainFacts& domain : report.domains) {
        const bool right = domain.wkc == domain.expected_wkc;
        content += tag("h3", fmt::format("Group {}", domain.index)) +
                   paragraph(fmt::format("{} from logical address 0x{:08x}; working counter ",
                                         counted(domain.data.size(), "octet"), domain.base) +
                             tag("span", right ? "class=\"good\"" : "class=\"fault-text\"",
                                 fmt::format("{} of {}", domain.wkc, domain.expected_wkc)) +
                             ".") +
                   domain_entries(report, domain);
    }
    if (content.empty()) return paragraph("No slave has process data.");
    if (report.origin == Origin::segment && !report.cycles)
        content = paragraph(
                      "This is the image as this program maps the slaves by default, or by the ENI that was given. "
                      "The slaves were in SAFEOP: values of outputs are 0.") +
                  content;
    return paragraph("Offsets are octet.bit within the image of the group.") + content;
}

Markup alike_section(const Report& report, const std::vector<AlikeGroup>& groups) {
    if (report.slaves.empty() || report.origin == Origin::recording) return {};
    if (groups.empty()) return paragraph("No two slaves are of the same product.");
    Markup content =
        paragraph("Slaves with the same vendor ID and product code should be the same and be set up the same.");
    if (!report.read_dictionaries) content += paragraph("The dictionaries were not read (--no-dictionary).");
    for (const AlikeGroup& group : groups) content += group_markup(group);
    return content;
}

namespace {

Markup cycle_picture(const samples::CycleFigures& figures) {
    return tag("div", "class=\"wide\"", Markup::raw(samples::cycle_svg(figures)));
}

}  // namespace

Markup cycles_section(const Report& report) {
    Markup content;
    if (report.cycle_log)
        content += paragraph("From the file " + code(report.cycle_log_file) +
                             fmt::format(": {} of the application.", counted(report.cycle_log->cycles, "cycle"))) +
                   cycle_picture(*report.cycle_log);
    if (!report.cycles) return content;
    if (!report.cycles->problem.empty()) content += paragraph(report.cycles->problem);
    if (report.cycles->figures.cycles == 0) return content;
    content += paragraph(fmt::format("{} with a period of {} µs, outputs 0{}.",
                                     counted(report.cycles->figures.cycles, "cycle"), report.cycles->period_us,
                                     report.virtual_time ? ", in virtual time" : ""));
    return content + cycle_picture(report.cycles->figures);
}

Markup clock_log_section(const Report& report) {
    if (!report.clock_log) return {};
    const auto& log = *report.clock_log;
    const double duration = log.times_s.empty() ? 0 : log.times_s.back();
    Markup content = paragraph("From the file " + code(report.clock_log_file) +
                               fmt::format(": {} in {:.3f} s.", counted(log.times_s.size(), "line"), duration));
    for (const auto& diagram : samples::clock_diagrams(log))
        for (const auto& curve : diagram.curves)
            content += curve_picture(diagram.title, diagram.unit, log.times_s, curve.values);
    return content;
}

}  // namespace margay::segment_report
