// The commands slaves, master, states, rescan, debug, version.
#include "ethercat/call.hpp"
#include "ethercat/commands.hpp"

#include "common/counted.hpp"
#include "common/slave_report.hpp"

#include <margay/version.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>

namespace margay::ethercat {
namespace {

constexpr auto kNothing = samples::exit_code::kWell;

std::string name_of(const SlaveFacts& slave) {
    if (!slave.name.empty()) return slave.name;
    return fmt::format("{:#010x}:{:#010x}", slave.identity.vendor, slave.identity.product);
}

char flag_of(const SlaveFacts& slave) { return slave.problem.empty() ? '+' : 'E'; }

struct Line {
    std::string position;
    std::string alias;
    std::string relative;
    std::string state;
    const SlaveFacts* slave = nullptr;
};

std::string lines_text(const std::vector<SlaveFacts>& selected, const std::vector<AliasAddress>& addresses) {
    std::vector<Line> lines;
    std::size_t widths[4] = {};
    for (const SlaveFacts& slave : selected) {
        const auto address = address_of(addresses, slave.position);
        lines.push_back({fmt::to_string(slave.position), fmt::to_string(address.alias),
                         fmt::to_string(address.relative), samples::al_text(slave.al), &slave});
        const Line& line = lines.back();
        const std::size_t sizes[] = {line.position.size(), line.alias.size(), line.relative.size(), line.state.size()};
        for (std::size_t n = 0; n < 4; ++n) widths[n] = std::max(widths[n], sizes[n]);
    }
    std::string text;
    for (const Line& line : lines)
        text +=
            fmt::format("{:>{}}  {:>{}}:{:<{}}  {:<{}}  {}  {}\n", line.position, widths[0], line.alias, widths[1],
                        line.relative, widths[2], line.state, widths[3], flag_of(*line.slave), name_of(*line.slave));
    return text;
}

using Bit = std::pair<unsigned, std::string_view>;
constexpr Bit kCoeDetails[] = {{coe_detail::kSdo, "SDO"},
                               {coe_detail::kSdoInformation, "SDO Info"},
                               {coe_detail::kPdoAssignment, "PDO Assign"},
                               {coe_detail::kPdoConfiguration, "PDO Configuration"},
                               {coe_detail::kUploadAtStartup, "Upload at startup"},
                               {coe_detail::kCompleteAccess, "SDO complete access"}};

std::vector<std::string> names_of(unsigned bits, std::span<const Bit> table) {
    std::vector<std::string> names;
    for (const auto& [bit, name] : table)
        if ((bits & bit) != 0) names.emplace_back(name);
    return names;
}

std::string_view port_text(PortType type) {
    switch (type) {
        case PortType::not_implemented: return "N/A";
        case PortType::not_configured: return "N/C";
        case PortType::ebus: return "EBUS";
        case PortType::mii: return "MII";
    }
    return "?";
}

const char* yes(bool value) { return value ? "yes" : "no"; }

// The clock itself is read, because the features register of some chips announces a clock that is switched off.
std::string_view clock_text(const SlaveFacts& slave, const ClockFacts& clock) {
    if (!clock.runs) return clock.measured ? "receive times only" : "no";
    return slave.dl.dc_64bit ? "yes, 64 bit" : "yes, 32 bit";
}

std::string dl_text(const SlaveFacts& s, const Answer<ClockFacts>& known) {
    const ClockFacts clock = known ? *known : ClockFacts();
    std::string text = fmt::format(
        "DL information:\n  ESC: type 0x{:02x}, revision {}, build {}\n  FMMUs: {}, SyncManagers: {}, RAM: {} KiB\n"
        "  FMMU bit operation: {}\n  Distributed clocks: {}\n  DC system time transmission delay: {} ns{}\n",
        s.dl.type, s.dl.revision, s.dl.build, s.dl.fmmus, s.dl.sync_managers, s.dl.ram_kib,
        yes((s.dl.features & 1U) == 0), known ? clock_text(s, clock) : "not known", clock.delay_ns,
        clock.reference ? " (reference clock)" : "");
    text += "Port  Type  Link  Loop    Signal  NextSlave  RxTime [ns]  Diff [ns]\n";
    for (std::size_t n = 0; n < s.ports.size(); ++n) {
        const Port& port = s.ports[n];
        const auto next = port.neighbour == 0 ? std::string("-") : fmt::to_string(port.neighbour - 1);
        const auto time = clock.measured && s.signal[n] ? fmt::to_string(clock.receive_ns[n]) : std::string("-");
        const auto difference = clock.measured && s.signal[n]
                                    ? fmt::to_string(clock.receive_ns[n] - clock.receive_ns[s.entry_port])
                                    : std::string("-");
        text += fmt::format("   {}  {:<4}  {:<4}  {:<6}  {:<6}  {:>9}  {:>11}  {:>9}\n", n, port_text(port.type),
                            port.link ? "up" : "down", port.open ? "open" : "closed", yes(s.signal[n]), next, time,
                            difference);
    }
    return text;
}

std::string mailboxes_text(const SlaveFacts& s) {
    if (!s.mailbox.present()) return "";
    std::string text = "Mailboxes:\n";
    if (s.boot_mailbox.present())
        text += fmt::format("  Bootstrap RX: 0x{:04x}/{}, TX: 0x{:04x}/{}\n", s.boot_mailbox.out_start,
                            s.boot_mailbox.out_bytes, s.boot_mailbox.in_start, s.boot_mailbox.in_bytes);
    text += fmt::format("  Standard  RX: 0x{:04x}/{}, TX: 0x{:04x}/{}\n  Supported protocols: {}\n",
                        s.mailbox.out_start, s.mailbox.out_bytes, s.mailbox.in_start, s.mailbox.in_bytes,
                        fmt::join(samples::protocol_names(s.mailbox.protocols), ", "));
    if ((s.mailbox.protocols & mailbox_protocol::kCoE) != 0)
        text += fmt::format("  CoE details: {}\n", fmt::join(names_of(s.coe_details, kCoeDetails), ", "));
    return text;
}

std::string details_text(const Master& master, const SlaveFacts& s, const Answer<SlaveTexts>& texts,
                         const Answer<ClockFacts>& clock) {
    std::string text = slave_heading(master, s);
    text += fmt::format("Alias: {}\nStation address: 0x{:04x}\nState: {}\nFlag: {}\n", s.alias, s.station_address,
                        samples::al_text(s.al), flag_of(s));
    if (!s.problem.empty()) text += fmt::format("Problem: {}\n", s.problem);
    text += fmt::format(
        "Identity:\n  Vendor Id:       0x{:08x}\n  Product code:    0x{:08x}\n  Revision number: 0x{:08x}\n"
        "  Serial number:   0x{:08x}\n",
        s.identity.vendor, s.identity.product, s.identity.revision, s.identity.serial);
    text += dl_text(s, clock) + mailboxes_text(s);
    if (!texts) return text + fmt::format("General: not known: {}\n\n", texts.problem().text);
    text += fmt::format(
        "General:\n  Group: {}\n  Order number: {}\n  Device name: {}\n  Enable SafeOp: {}\n  Enable notLRW: {}\n"
        "  Current consumption: {} mA\n",
        texts->group, texts->order, texts->name, yes(texts->enable_safeop), yes(texts->no_lrw), s.ebus_current_ma);
    return text + "\n";
}

nlohmann::ordered_json slave_json(const SlaveFacts& s, const AliasAddress& address) {
    auto ports = nlohmann::ordered_json::array();
    for (std::size_t n = 0; n < s.ports.size(); ++n)
        ports.push_back({{"type", port_text(s.ports[n].type)},
                         {"link", s.ports[n].link},
                         {"open", s.ports[n].open},
                         {"signal", s.signal[n]},
                         {"next", s.ports[n].neighbour == 0 ? nlohmann::ordered_json(nullptr)
                                                            : nlohmann::ordered_json(s.ports[n].neighbour - 1)}});
    return {{"position", s.position},
            {"alias", address.alias},
            {"relative_position", address.relative},
            {"own_alias", s.alias},
            {"station_address", s.station_address},
            {"state", to_text(s.al.state)},
            {"al_error", s.al.error},
            {"al_status_code", s.al.code},
            {"error", !s.problem.empty()},
            {"problem", s.problem.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(s.problem)},
            {"name", s.name},
            {"vendor", s.identity.vendor},
            {"product", s.identity.product},
            {"revision", s.identity.revision},
            {"serial", s.identity.serial},
            {"parent", s.parent ? nlohmann::ordered_json(*s.parent) : nlohmann::ordered_json(nullptr)},
            {"ports", ports},
            {"dc", s.dl.dc},
            {"protocols", samples::protocol_names(s.mailbox.present() ? s.mailbox.protocols : 0)},
            {"current_ma", s.ebus_current_ma}};
}

// The data of the slave is shown also if its EEPROM or its clock cannot be read.
Answer<> add_details(const Master& master, const SlaveFacts& slave, Output& output, nlohmann::ordered_json& json) {
    const auto texts = master.session->texts(slave.position);
    const auto clock = master.session->clock(slave.position);
    output.text += details_text(master, slave, texts, clock);
    if (texts) {
        json["order"] = texts->order;
        json["group"] = texts->group;
    }
    if (clock) {
        json["delay_ns"] = clock->delay_ns;
        json["receive_times_ns"] = clock->receive_ns;
    }
    if (!texts) return texts.problem();
    if (!clock) return clock.problem();
    return {};
}

std::string mac_text(const MacAddress& mac) {
    return fmt::format("{:02x}:{:02x}:{:02x}:{:02x}:{:02x}:{:02x}", mac[0], mac[1], mac[2], mac[3], mac[4], mac[5]);
}

std::optional<AlState> state_by_name(std::string_view name) {
    std::string upper(name);
    std::ranges::transform(upper, upper.begin(),
                           [](char c) { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 32) : c; });
    for (const auto state : {AlState::init, AlState::preop, AlState::boot, AlState::safeop, AlState::op})
        if (upper == to_text(state)) return state;
    return std::nullopt;
}

}  // namespace

int run_slaves(Call& call) {
    bool faulty = false;
    const int code = call.each_master([&](Master& master, Output& output) -> Answer<> {
        const auto all = master.session->slaves();
        if (!all) return all.problem();
        const auto selected = call.selected(master);
        if (!selected) return selected.problem();
        const auto addresses = alias_addresses(*all);
        output.json["slaves"] = nlohmann::ordered_json::array();
        Answer<> first;
        for (const SlaveFacts& slave : *selected) {
            auto json = slave_json(slave, address_of(addresses, slave.position));
            if (call.has("verbose")) {
                const auto added = add_details(master, slave, output, json);
                if (!added) json["problem"] = added.problem().text;
                if (!added && !first) samples::fail(first.problem().text);  // the last problem is returned
                if (!added) first = added;
                if (!added && added.problem().code == samples::exit_code::kSystem) return added;
            }
            output.json["slaves"].push_back(std::move(json));
            if (slave.problem.empty()) continue;
            faulty = true;
            master.session->note(slave.problem);
        }
        if (!call.has("verbose")) output.text = lines_text(*selected, addresses);
        return first;
    });
    return code == kNothing && faulty ? samples::exit_code::kSegment : code;
}

int run_master(Call& call) {
    return call.each_master([&](Master& master, Output& output) -> Answer<> {
        const auto facts = master.session->master();
        if (!facts) return facts.problem();
        output.text = call.masters().size() > 1 ? "" : fmt::format("Master{}\n", master.index);
        output.text +=
            fmt::format("  Source: {}\n  Phase: {}\n  Active: {}\n  Slaves: {}\n  Ethernet devices:\n", facts->source,
                        facts->active ? "Operation" : "Idle", yes(facts->active), facts->slaves);
        auto devices = nlohmann::ordered_json::array();
        for (const DeviceFacts& device : facts->devices) {
            output.text +=
                fmt::format("    {}: {}\n      Link: {}\n", &device == facts->devices.data() ? "Main" : "Backup",
                            mac_text(device.mac), device.link ? "UP" : "DOWN");
            devices.push_back({{"name", device.name}, {"mac", mac_text(device.mac)}, {"link", device.link}});
        }
        output.text +=
            fmt::format("  Frames: {} sent, {} received, {} lost\n  Octets on the wire: {}\n", facts->frames_sent,
                        facts->frames_received, facts->frames_lost, facts->bytes_on_wire);
        output.json["source"] = facts->source;
        output.json["active"] = facts->active;
        output.json["slaves"] = facts->slaves;
        output.json["devices"] = devices;
        output.json["frames_sent"] = facts->frames_sent;
        output.json["frames_received"] = facts->frames_received;
        output.json["frames_lost"] = facts->frames_lost;
        output.json["bytes_on_wire"] = facts->bytes_on_wire;
        return {};
    });
}

int run_states(Call& call) {
    const auto wanted = state_by_name(call.words()[0]);
    if (!wanted)
        return call.fail({fmt::format("'{}' is no state: INIT, PREOP, BOOT, SAFEOP or OP", call.words()[0]),
                          samples::exit_code::kUsage});
    return call.each_master([&](Master& master, Output& output) -> Answer<> {
        const auto selected = call.some_selected(master);
        if (!selected) return selected.problem();
        std::vector<std::uint16_t> positions;
        for (const SlaveFacts& slave : *selected) positions.push_back(slave.position);
        const auto done = master.session->set_states(positions, *wanted);
        if (!done) return done;
        output.json["state"] = to_text(*wanted);
        output.json["positions"] = positions;
        const auto now = master.session->slaves();
        if (!now) return now.problem();
        if (call.has("verbose"))
            for (const SlaveFacts& slave : *now)
                if (std::ranges::find(positions, slave.position) != positions.end())
                    output.text += fmt::format("{}  {}\n", slave.position, samples::al_text(slave.al));
        return {};
    });
}

int run_rescan(Call& call) {
    return call.each_master([&](Master& master, Output& output) -> Answer<> {
        const auto found = master.session->rescan();
        if (!found) return found.problem();
        output.json["slaves"] = found->slaves;
        output.json["scanned"] = found->whole;
        output.json["missing"] = found->missing;
        output.json["unused"] = found->unused;
        if (!call.has("verbose")) return {};
        output.text =
            fmt::format("{}{}\n", samples::counted(found->slaves, "slave"),
                        found->whole ? "" : "; compared with those of the application, whose process data goes on");
        return {};
    });
}

int run_debug(Call& call) {
    const auto level = Call::number("LEVEL", call.words()[0], 2);
    if (!level) return call.fail(level.problem());
    return call.each_master([&](Master& master, Output& output) -> Answer<> {
        const auto set = master.session->set_debug_level(static_cast<unsigned>(*level));
        if (!set) return set;
        const auto found = master.session->slaves();  // a source of its own is scanned at this level
        if (!found) return found.problem();
        output.json["level"] = *level;
        output.json["slaves"] = found->size();
        return {};
    });
}

int run_version(Call& call) {
    Output output;
    output.text = fmt::format("ethercat (Margay) {}\n", MARGAY_VERSION_TEXT);
    output.json = {{"program", "ethercat"}, {"version", MARGAY_VERSION_TEXT}};
    return call.print(output);
}

}  // namespace margay::ethercat
