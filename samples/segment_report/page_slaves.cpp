// The parts of the page about slaves: identity and states, EEPROM, clocks.
#include "segment_report/page.hpp"

#include "common/slave_report.hpp"
#include "wire/esc.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace margay::segment_report {
namespace {

constexpr std::size_t kOpenSlaves = 4;  // this many slaves have their details unfolded

std::string hex32(std::uint32_t value) { return fmt::format("0x{:08x}", value); }

std::string esc_text(const DlInformation& dl) {
    return fmt::format("type 0x{:02x}, revision {}, build {}", dl.type, dl.revision, dl.build);
}

std::string clock_kind(const SlaveState& slave) {
    const ClockState& clock = slave.clock;
    const std::string width = slave.facts.dl.dc_64bit ? "64 bit" : "32 bit";
    if (clock.facts.runs) return width;
    if (clock.facts.measured) return "receive times only";
    return slave.facts.dl.dc ? width + ", not measured" : "none";
}

// ESC register 0x0008.
std::vector<std::string> feature_list(std::uint16_t features) {
    namespace bit = wire::features;
    constexpr std::pair<unsigned, std::string_view> kBits[] = {
        {bit::kFmmuBitOperationNotSupported, "FMMUs map whole octets only"},
        {bit::kNoRegisterAccessReserved, "no reserved registers"},
        {bit::kDistributedClocks, "distributed clocks"},
        {bit::kDistributedClocks64Bit, "clock of 64 bits"},
        {bit::kLowJitterEbus, "low jitter E-bus"},
        {bit::kEnhancedLinkDetectionEbus, "enhanced link detection on E-bus"},
        {bit::kEnhancedLinkDetectionMii, "enhanced link detection on MII"},
        {bit::kSeparateFcsErrorHandling, "separate handling of FCS errors"},
        {bit::kEnhancedSyncActivation, "enhanced activation of SYNC"},
        {bit::kLrwNotSupported, "no LRW"},
        {bit::kReadWriteNotSupported, "no BRW, APRW, FPRW"},
        {bit::kFixedFmmuAndSmConfiguration, "fixed FMMUs and SyncManagers"}};
    std::vector<std::string> names;
    for (const auto& [mask, name] : kBits)
        if ((features & mask) != 0) names.emplace_back(name);
    return names;
}

Markup state_cell(const SlaveState& slave) {
    const bool faulty = slave.now.error || !slave.facts.problem.empty();
    Markup cell = badge(faulty ? Severity::fault : Severity::good, samples::al_text(slave.now));
    if (slave.now.code != 0) cell += " " + Markup(state_text(slave.now).substr(samples::al_text(slave.now).size() + 2));
    if (!slave.facts.problem.empty()) cell += Markup::raw("<br/>") + problem_text(slave.facts);
    return cell;
}

Markup overview(const Report& report) {
    const bool found = std::ranges::any_of(report.slaves, [](const SlaveState& s) { return s.found.has_value(); });
    std::vector<Table::Column> columns{{"Pos.", true}, {"Name"}, {"State"}};
    if (found) columns.push_back({"Found in"});
    for (const Table::Column& column : std::initializer_list<Table::Column>{
             {"Vendor"}, {"Product"}, {"Revision"}, {"Serial"}, {"Alias", true}, {"Software"}, {"Clock"}, {"Mailbox"}})
        columns.push_back(column);
    Table table(columns);
    for (const SlaveState& slave : report.slaves) {
        const SlaveFacts& s = slave.facts;
        std::vector<Markup> cells{slave_link(s.position),
                                  s.name.empty() ? tag("span", "class=\"soft\"", "(no name)") : Markup(s.name),
                                  state_cell(slave)};
        if (found) cells.push_back(slave.found ? Markup(samples::al_text(*slave.found)) : Markup());
        for (const auto value : {s.identity.vendor, s.identity.product, s.identity.revision, s.identity.serial})
            cells.push_back(code(hex32(value)));
        cells.push_back(s.alias == 0 ? Markup() : Markup(fmt::to_string(s.alias)));
        cells.push_back(slave.versions.software);
        cells.push_back(clock_kind(slave));
        cells.push_back(
            fmt::format("{}", fmt::join(samples::protocol_names(s.mailbox.present() ? s.mailbox.protocols : 0), ", ")));
        const bool faulty = slave.now.error || !s.problem.empty();
        table.add(std::move(cells), faulty ? "fault" : "");
    }
    return table.markup("slave-table");
}

Markup ports_table(const SlaveState& slave) {
    Table table({{"Port", true},
                 {"Medium"},
                 {"Link"},
                 {"Loop"},
                 {"Leads to"},
                 {"Damaged frames", true},
                 {"Physical errors", true},
                 {"Forwarded errors", true},
                 {"Lost links", true}});
    for (std::uint8_t n = 0; n < 4; ++n) {
        const Port& port = slave.facts.ports[n];
        if (port.type == PortType::not_implemented && !port.link) continue;
        std::vector<Markup> cells{fmt::to_string(n), medium_text(port.type), port.link ? "up" : "down",
                                  port.open ? "open" : "closed"};
        cells.push_back(port.neighbour != 0 ? "slave " + slave_link(static_cast<std::uint16_t>(port.neighbour - 1))
                        : n == slave.facts.entry_port && !slave.facts.parent ? Markup("the master")
                                                                             : Markup());
        const auto& counters = slave.counters;
        for (const auto* list :
             {counters ? &counters->invalid_frames : nullptr, counters ? &counters->rx_errors : nullptr,
              counters ? &counters->forwarded : nullptr, counters ? &counters->lost_links : nullptr})
            cells.push_back(list == nullptr ? "?" : fmt::to_string((*list)[n]));
        table.add(std::move(cells));
    }
    return table.markup();
}

Markup sync_managers_table(const SlaveState& slave) {
    Table table({{"SM", true}, {"Use"}, {"Start"}, {"Octets", true}, {"Control"}, {"PDOs"}});
    for (const SyncManagerFacts& sm : slave.sync_managers) {
        std::vector<std::string> pdos;
        for (const auto& pdo : sm.pdos)
            pdos.push_back(fmt::format("0x{:04X}{}", pdo.index, pdo.name.empty() ? "" : " " + pdo.name));
        table.add({fmt::to_string(sm.number),
                   sm.mailbox     ? "mailbox"
                   : sm.outputs() ? "outputs"
                                  : "inputs",
                   code(fmt::format("0x{:04x}", sm.start)), fmt::to_string(sm.default_bytes),
                   code(fmt::format("0x{:02x}", sm.control)), fmt::format("{}", fmt::join(pdos, ", "))});
    }
    return table.empty() ? Markup() : tag("h3", "SyncManagers") + table.markup();
}

Markup details_of(const SlaveState& slave) {
    const SlaveFacts& s = slave.facts;
    Facts facts;
    facts.add("State", state_text(slave.now));
    if (slave.found) facts.add("Found in", state_text(*slave.found));
    facts.add("Problem", problem_text(s));
    facts.add("Order code", slave.texts.order);
    facts.add("Group", slave.texts.group);
    facts.add("Name (0x1008)", slave.versions.name == s.name ? std::string() : slave.versions.name);
    facts.add("Hardware (0x1009)", slave.versions.hardware);
    facts.add("Software (0x100A)", slave.versions.software);
    facts.add("Station address", code(fmt::format("0x{:04x}", s.station_address)));
    facts.add("ESC", fmt::format("{}; {} FMMUs, {} SyncManagers, {} KiB RAM", esc_text(s.dl), s.dl.fmmus,
                                 s.dl.sync_managers, s.dl.ram_kib));
    facts.add("ESC features", fmt::format("{}", fmt::join(feature_list(s.dl.features), "; ")));
    if (s.mailbox.present())
        facts.add("Mailbox", fmt::format("{} out, {} in", counted(s.mailbox.out_bytes, "octet"),
                                         counted(s.mailbox.in_bytes, "octet")));
    facts.add("CoE", fmt::format("{}", fmt::join(samples::coe_detail_names(s.coe_details), ", ")));
    if (s.ebus_current_ma != 0)
        facts.add("E-bus current", s.ebus_current_ma > 0 ? fmt::format("takes {} mA", s.ebus_current_ma)
                                                         : fmt::format("supplies {} mA", -s.ebus_current_ma));
    if (slave.counters)
        facts.add("Other counters",
                  fmt::format("{} not processed, {}", counted(slave.counters->processing_unit, "frame"),
                              counted(slave.counters->pdi, "PDI error")));
    Markup content = facts.markup() + ports_table(slave) + sync_managers_table(slave);
    if (!slave.problems.empty()) content += tag("h3", "Could not be read") + list_of(slave.problems);
    return content;
}

}  // namespace

Markup slaves_section(const Report& report) {
    if (!report.failure.empty()) return paragraph(report.failure);
    if (report.slaves.empty()) return {};
    Markup all = overview(report) + tag("h3", "Slave by slave");
    if (report.origin == Origin::segment)
        all = paragraph(
                  "The states are those at the end of this report: the program brings the slaves to PREOP, to SAFEOP "
                  "to map their process data, and to OP for --cycles. “Found in” is the state before.") +
              all;
    all += list_of(report.missing);
    for (const SlaveState& slave : report.slaves) {
        const auto title = fmt::format("{} {}", slave.facts.position, slave.facts.name);
        all += tag("div", fmt::format("id=\"slave{}\"", slave.facts.position),
                   folded(Markup(title) + " " + tag("small", samples::al_text(slave.now)), details_of(slave),
                          report.slaves.size() <= kOpenSlaves));
    }
    return all;
}

Markup eeprom_section(const Report& report) {
    if (report.slaves.empty()) return {};
    Table table({{"Pos.", true}, {"Order code"}, {"Size", true}, {"Used", true}, {"Checksum"}, {"Findings"}});
    for (const SlaveState& slave : report.slaves) {
        const EepromContent& eeprom = slave.eeprom;
        const bool read = eeprom.problem.empty();
        Markup findings = read ? list_of(eeprom.findings) : Markup(eeprom.problem);
        if (read && eeprom.findings.empty()) findings = tag("span", "class=\"soft\"", "none");
        table.add(
            {slave_link(slave.facts.position), slave.texts.order,
             eeprom.size == 0 ? Markup("?") : Markup(fmt::to_string(eeprom.size)), fmt::to_string(eeprom.used.size()),
             !read ? Markup("?")
                   : code(fmt::format("0x{:02x}", eeprom.checksum)) + (eeprom.checksum_wrong ? " wrong" : " right"),
             findings},
            eeprom.checksum_wrong || !read ? "fault"
            : eeprom.findings.empty()      ? ""
                                           : "remark");
    }
    return paragraph(
               "The EEPROM (SII) was read up to the end of its categories; sizes are in octets. The checksum covers "
               "the configuration area. The command eepromtool SOURCE NUMBER dump shows the whole content. NUMBER is "
               "the position plus 1, because eepromtool counts the slaves from 1.") +
           table.markup("eeprom-table");
}

Markup clocks_section(const Report& report) {
    const auto runs = [](const SlaveState& slave) { return slave.clock.facts.runs; };
    if (std::ranges::none_of(report.slaves, runs)) return {};
    Table table(
        {{"Pos.", true}, {"Name"}, {"Clock"}, {"Delay, ns", true}, {"Offset, ns", true}, {"Deviation, ns", true}});
    for (const SlaveState& slave : report.slaves) {
        const ClockState& clock = slave.clock;
        if (!clock.facts.runs) continue;
        table.add({slave_link(slave.facts.position), slave.facts.name,
                   clock_kind(slave) + (clock.facts.reference ? ", reference clock" : ""),
                   fmt::to_string(clock.facts.delay_ns), clock.offset_ns ? fmt::to_string(*clock.offset_ns) : "?",
                   clock.deviation_ns ? fmt::to_string(*clock.deviation_ns) : "?"});
    }
    const bool kept = report.origin == Origin::application || report.cycles.has_value();
    return paragraph(
               "The delay is that of a frame from the reference clock to the slave. The offset (register 0x0920) "
               "is added to the clock of the slave. The deviation (0x092C) is what the slave has measured against "
               "the distributed time last.") +
           (kept ? Markup()
                 : paragraph(
                       "The time was not distributed when this report was read, so the deviations say little; with "
                       "--cycles they are those behind the cycles.")) +
           table.markup("clock-table");
}

}  // namespace margay::segment_report
