#include "common/slave_report.hpp"

#include "common/counted.hpp"
#include "common/visible_text.hpp"
#include "wire/al_status_code.hpp"
#include "wire/sii_category.hpp"

#include <margay/redundancy.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <iterator>
#include <span>
#include <utility>
#include <vector>

namespace margay::samples {
namespace {

using NameOfBit = std::pair<unsigned, const char*>;

constexpr NameOfBit kProtocols[] = {{mailbox_protocol::kAoE, "AoE"}, {mailbox_protocol::kEoE, "EoE"},
                                    {mailbox_protocol::kCoE, "CoE"}, {mailbox_protocol::kFoE, "FoE"},
                                    {mailbox_protocol::kSoE, "SoE"}, {mailbox_protocol::kVoE, "VoE"}};
constexpr NameOfBit kCoeDetails[] = {{coe_detail::kSdo, "SDO"},
                                     {coe_detail::kSdoInformation, "SDO information"},
                                     {coe_detail::kPdoAssignment, "PDO assignment"},
                                     {coe_detail::kPdoConfiguration, "PDO configuration"},
                                     {coe_detail::kUploadAtStartup, "upload at startup"},
                                     {coe_detail::kCompleteAccess, "complete access"}};

template <std::size_t N>
std::vector<std::string> names_of(unsigned bits, const NameOfBit (&table)[N]) {
    std::vector<std::string> names;
    for (const auto& [bit, name] : table)
        if ((bits & bit) != 0) names.emplace_back(name);
    return names;
}

const char* port_type(PortType type) {
    switch (type) {
        case PortType::not_implemented: return "not implemented";
        case PortType::not_configured: return "not configured";
        case PortType::ebus: return "E-bus";
        case PortType::mii: return "MII";
    }
    return "?";
}

const char* sm_type(SmType type) {
    switch (type) {
        case SmType::unused: return "unused";
        case SmType::mailbox_out: return "mailbox out";
        case SmType::mailbox_in: return "mailbox in";
        case SmType::outputs: return "outputs";
        case SmType::inputs: return "inputs";
    }
    return "unknown type";
}

const char* fmmu_use(FmmuUse use) {
    switch (use) {
        case FmmuUse::unused: return "unused";
        case FmmuUse::outputs: return "outputs";
        case FmmuUse::inputs: return "inputs";
        case FmmuUse::mailbox_status: return "mailbox status";
    }
    return "unknown use";
}

const char* dc_text(const DlInformation& dl) { return !dl.dc ? "no" : dl.dc_64bit ? "64 bit" : "32 bit"; }

// The name of the slave, or its vendor ID and product code when it has no name.
std::string title(const Slave& slave) {
    if (!slave.name().empty()) return words_of_slave(slave.name());
    return fmt::format("(no name) {:#010x}:{:#010x}", slave.identity.vendor, slave.identity.product);
}

std::string ports_text(const Slave& slave) {
    std::string text;
    for (std::size_t p = 0; p < slave.ports.size(); ++p) {
        const Port& port = slave.ports[p];
        if (port.type == PortType::not_implemented && !port.link) continue;
        text += fmt::format("  Port {}            {}, {}, {}", p, port_type(port.type), port.link ? "link" : "no link",
                            port.open ? "open" : "closed");
        if (port.neighbour != 0)
            text += fmt::format(", to slave {}", port.neighbour);
        else if (slave.parent == 0 && p == slave.entry_port)
            text += ", to the master";
        text += '\n';
    }
    return text;
}

std::string mailbox_text(const Slave& slave) {
    if (!slave.mailbox.present()) return "  Mailbox           none\n";
    std::string text = fmt::format("  Mailbox           out {} bytes at {:#06x}, in {} bytes at {:#06x}: {}\n",
                                   slave.mailbox.out_bytes, slave.mailbox.out_start, slave.mailbox.in_bytes,
                                   slave.mailbox.in_start, fmt::join(protocol_names(slave.mailbox.protocols), ", "));
    if (slave.boot_mailbox.present())
        text += fmt::format("  Boot mailbox      out {} bytes at {:#06x}, in {} bytes at {:#06x}\n",
                            slave.boot_mailbox.out_bytes, slave.boot_mailbox.out_start, slave.boot_mailbox.in_bytes,
                            slave.boot_mailbox.in_start);
    if ((slave.mailbox.protocols & mailbox_protocol::kCoE) != 0)
        text += fmt::format("  CoE details       {}\n", fmt::join(coe_detail_names(slave.coe_details), ", "));
    return text;
}

nlohmann::ordered_json mailbox_json(const MailboxInfo& mailbox) {
    if (!mailbox.present()) return nullptr;
    return {{"out_start", mailbox.out_start},
            {"out_bytes", mailbox.out_bytes},
            {"in_start", mailbox.in_start},
            {"in_bytes", mailbox.in_bytes}};
}

nlohmann::ordered_json ports_json(const Slave& slave) {
    auto ports = nlohmann::ordered_json::array();
    for (const Port& port : slave.ports)
        ports.push_back(
            {{"type", port_type(port.type)}, {"link", port.link}, {"open", port.open}, {"neighbour", port.neighbour}});
    return ports;
}

nlohmann::ordered_json slave_json(const Slave& s) {
    auto sms = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < s.sm_count; ++i) {
        const SmInfo& sm = s.sync_managers[i];
        sms.push_back({{"start", sm.start},
                       {"length_bytes", sm.length_bytes},
                       {"control", sm.control},
                       {"enable", sm.enable},
                       {"type", sm_type(sm.type)}});
    }
    auto fmmus = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < s.fmmu_count; ++i) fmmus.push_back(fmmu_use(s.fmmu_use[i]));
    return {
        {"number", s.number},
        {"station_address", s.station_address.value},
        {"alias", s.alias},
        {"name", words_of_slave(s.name())},
        {"vendor", s.identity.vendor},
        {"product", s.identity.product},
        {"revision", s.identity.revision},
        {"serial", s.identity.serial},
        {"al_state", al_text(s.al)},
        {"al_status_code", s.al.code},
        {"al_status_text", wire::al_status_text(s.al.code)},
        {"esc", {{"type", s.dl.type}, {"revision", s.dl.revision}, {"build", s.dl.build}, {"ram_kib", s.dl.ram_kib}}},
        {"dc", dc_text(s.dl)},
        {"parent", s.parent},
        {"parent_port", s.parent_port},
        {"entry_port", s.entry_port},
        {"ports", ports_json(s)},
        {"sync_managers", sms},
        {"fmmus", fmmus},
        {"fmmus_of_esc", s.dl.fmmus},
        {"sync_managers_of_esc", s.dl.sync_managers},
        {"mailbox", mailbox_json(s.mailbox)},
        {"boot_mailbox", mailbox_json(s.boot_mailbox)},
        {"protocols", protocol_names(s.mailbox.protocols)},
        {"coe_details", coe_detail_names(s.coe_details)},
        {"ebus_current_ma", s.ebus_current_ma},
        {"sii_bytes", s.sii_bytes},
        {"error",
         s.error.code == Errc::none ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(sentence(s.error))}};
}

// Sentences for errors whose sentence in the library names functions, because the user of a program calls no functions.
// Empty: the sentence of the library is used.
std::string_view words_for_users(Errc code) {
    switch (code) {
        case Errc::identity_unread: return "the slave was away, and its identity was not compared since";
        case Errc::no_place: return "the slave has process data, but no place in the image is reserved for it";
        case Errc::remapping_needed:
            return "its revision, SyncManagers or PDOs have changed since the process image was laid out";
        case Errc::unknown_group: return "there is no such group, or nothing is mapped in it";
        case Errc::not_polled: return "the program that runs the segment serves no requests";
        case Errc::no_cycle: return "no cycle is on the wire";
        case Errc::not_supervised: return "the states of the slaves were read more than a second ago";
        case Errc::place_unknown: return "no place in the image, the sizes of its process data are not known";
        case Errc::supervised: return "the supervision keeps the slave in another state";
        default: return {};
    }
}

std::string for_users(std::string text, const Error& error) {
    const auto ours = words_for_users(error.code);
    const auto theirs = to_text(error.code);
    if (const auto at = text.find(theirs); !ours.empty() && at != std::string::npos)
        return text.replace(at, theirs.size(), ours);
    const bool unmeasured = error.code == Errc::wrong_state && error.step == Step::configure_sync;
    const bool unmapped = error.code == Errc::unknown_group && error.step == Step::request_state;
    if (unmeasured) text = text.substr(0, text.find(" (call ")) + " (the clocks are not measured yet)";
    if (unmapped) text.resize(std::min(text.find(": call "), text.size()));
    return text;
}

// Writes a slave and all slaves behind it. A slave with one child has this child below it in the same column. The
// children of a slave with several children are indented. `first` is the beginning of the slave's line, `indent` the
// beginning of the lines behind it.
void add_line(Context& ctx, const Slave& slave, const std::string& first, const std::string& indent,
              std::string& text) {
    const Slave* at = &slave;
    for (const auto* begin = &first; at != nullptr; begin = &indent) {
        text += fmt::format("{}{} {}{}\n", *begin, at->number, title(*at),
                            at->parent == 0 ? std::string() : fmt::format(" (port {})", at->parent_port));
        std::vector<const Slave*> children;
        for (const Slave& other : ctx.slaves())
            if (other.parent == at->number && other.number != at->number) children.push_back(&other);
        at = children.size() == 1 ? children.front() : nullptr;
        if (at != nullptr) continue;
        for (const Slave* child : children) {
            const bool last = child == children.back();
            add_line(ctx, *child, indent + (last ? "└─ " : "├─ "), indent + (last ? "   " : "│  "), text);
        }
    }
}

}  // namespace

std::string sentence(const Error& error) {
    std::array<char, 400> buffer{};
    std::string text = for_users(std::string(describe(error, buffer)), error);
    constexpr std::uint16_t kDetectedModules = 0xF050;  // its subindices count from 1, slots from 0
    if (error.code == Errc::check_failed && error.index == kDetectedModules && error.subindex != 0)
        text += fmt::format("; slot {} has another module than the ENI file says", error.subindex - 1);
    return text;
}

std::string sentence(const Event& event) {
    std::array<char, 400> buffer{};
    return for_users(std::string(describe(event, buffer)), event.error);
}

std::string sentence_without_slave(const Error& error) {
    std::string text = sentence(error);
    const std::string front = fmt::format("slave {}: ", error.slave);
    return error.slave != 0 && text.starts_with(front) ? text.substr(front.size()) : text;
}

std::vector<std::string> take_errors(Context& ctx, const std::string& printed) {
    std::vector<std::string> sentences;
    while (const auto error = ctx.errors().take())
        if (std::string text = sentence(*error); text != printed) sentences.push_back(std::move(text));
    return sentences;
}

std::string words_of_slave(std::string_view octets) {
    std::string text(2 * octets.size(), '\0');  // a character of ISO 8859-1 becomes two octets
    text.resize(wire::sii::to_utf8(std::as_bytes(std::span(octets)), text).size());
    return visible(text);
}

std::string al_text(const AlStatus& al) { return fmt::format("{}{}", to_text(al.state), al.error ? " + ERROR" : ""); }

std::vector<std::string> protocol_names(unsigned bits) { return names_of(bits, kProtocols); }

std::vector<std::string> coe_detail_names(unsigned bits) { return names_of(bits, kCoeDetails); }

std::string slave_text(const Slave& s) {
    std::string text = fmt::format("Slave {}: {}\n", s.number, title(s));
    text += fmt::format("  Station address   {:#06x}    alias {}\n", s.station_address.value, s.alias);
    text += fmt::format("  Vendor {:#010x}  product {:#010x}  revision {:#010x}  serial {:#010x}\n", s.identity.vendor,
                        s.identity.product, s.identity.revision, s.identity.serial);
    text += fmt::format("  AL state          {}", al_text(s.al));
    if (s.al.code != 0 || s.al.error) text += fmt::format(", {:#06x}: {}", s.al.code, wire::al_status_text(s.al.code));
    text += fmt::format(
        "\n  ESC               type {:#04x}, revision {}, build {}, {} FMMUs, {} SyncManagers, {} KiB RAM\n", s.dl.type,
        s.dl.revision, s.dl.build, s.dl.fmmus, s.dl.sync_managers, s.dl.ram_kib);
    text += fmt::format("  Distributed clock {}\n", dc_text(s.dl));
    text += s.parent == 0 ? std::string("  Parent            the master\n")
                          : fmt::format("  Parent            slave {}, port {}\n", s.parent, s.parent_port);
    text += ports_text(s);
    for (std::size_t i = 0; i < s.sm_count; ++i) {
        const SmInfo& sm = s.sync_managers[i];
        text += fmt::format("  SM{}               {:#06x}, {:4} bytes, control {:#04x}, enable {}, {}\n", i, sm.start,
                            sm.length_bytes, sm.control, sm.enable, sm_type(sm.type));
    }
    for (std::size_t i = 0; i < s.fmmu_count; ++i)
        text += fmt::format("  FMMU{}             {}\n", i, fmmu_use(s.fmmu_use[i]));
    text += mailbox_text(s);
    text += fmt::format("  E-bus current     {} mA\n", s.ebus_current_ma);
    if (s.error.code != Errc::none) text += fmt::format("  Problem           {}\n", sentence(s.error));
    return text;
}

std::string topology_text(Context& ctx) {
    std::string text = "Topology\n  master\n";
    for (const Slave& slave : ctx.slaves()) {
        if (slave.parent != 0) continue;
        add_line(ctx, slave, "  └─ ", "     ", text);
    }
    return text;
}

nlohmann::ordered_json segment_json(Context& ctx) {
    auto slaves = nlohmann::ordered_json::array();
    for (const Slave& slave : ctx.slaves()) slaves.push_back(slave_json(slave));
    return {{"slaves", slaves}};
}

std::string ring_remark(Context& ctx) {
    const RedundancyStatus ring = redundancy(ctx);
    if (!ring.redundant) return {};
    if (ring.ring == RingState::whole)
        return ring.swapped
                   ? "the cables of the two interfaces are interchanged: the first one is at the end of the ring"
                   : "";
    const auto& [first, second] = ring.cables;
    if (first.slaves == 0 || second.slaves == 0)
        return fmt::format("the ring is not closed: the {} interface reaches no slave",
                           first.slaves == 0 ? "first" : "second");
    return fmt::format("the ring is broken: the first interface reaches {}, the second one {}",
                       counted(first.slaves, "slave"), second.slaves);
}

}  // namespace margay::samples
