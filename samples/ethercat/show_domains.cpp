// The commands config, domains, data.
#include "ethercat/call.hpp"
#include "ethercat/commands.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace margay::ethercat {
namespace {

std::string octets_line(std::span<const std::byte> octets) {
    std::string text;
    for (const std::byte b : octets)
        text += fmt::format("{}{:02x}", text.empty() ? "" : " ", std::to_integer<unsigned>(b));
    return text;
}

// ------------------------------------------------------------------ config

std::string config_line(const ConfigFacts& config) {
    return fmt::format("{}:{}  0x{:08x}/0x{:08x}  {}  {}\n", config.alias, config.relative, config.vendor,
                       config.product, config.position ? fmt::to_string(*config.position) : "-",
                       config.position ? std::string(to_text(config.state)) : "-");
}

std::string config_details(const ConfigFacts& config) {
    std::string text =
        fmt::format("Alias: {}\nPosition: {}\nVendor Id: 0x{:08x}\nProduct code: 0x{:08x}\nAttached slave: {}\n",
                    config.alias, config.relative, config.vendor, config.product,
                    config.position ? fmt::format("{} ({})", *config.position, to_text(config.state)) : "none");
    if (!config.problem.empty()) text += "SM: could not be read\n";
    for (const auto& sm : config.sync_managers) {
        text += fmt::format("SM{}, Dir: {}, Watchdog: {}\n", sm.number, sm.outputs() ? "Output" : "Input",
                            sm.watchdog() ? "Enable" : "Disable");
        for (const auto& pdo : sm.pdos) {
            text += fmt::format("  PDO 0x{:04x} \"{}\"\n", pdo.index, pdo.name);
            for (const auto& entry : pdo.entries)
                text += fmt::format("    PDO entry 0x{:04x}:{:02x}, {:>2} bit, \"{}\"\n", entry.index, entry.subindex,
                                    entry.bits, title_of(entry));
        }
    }
    text += "SDO configuration:\n";
    if (config.sdos.empty()) text += "  None.\n";
    for (const auto& sdo : config.sdos)
        text += fmt::format("  0x{:04x}:{}, {} byte: {}\n", sdo.index,
                            sdo.complete_access ? std::string("C") : fmt::format("{:02x}", sdo.subindex),
                            sdo.data.size(), octets_text(sdo.data));
    for (const auto& parameter : config.parameters)
        text += fmt::format("IDN: drive {}, 0x{:04x}, {} byte: {}\n", parameter.drive, parameter.idn,
                            parameter.data.size(), octets_text(parameter.data));
    if (config.assign_activate)
        text += fmt::format(
            "DC configuration:\n  AssignActivate: 0x{:04x}\n  SYNC0: cycle {} ns, shift {} ns\n"
            "  SYNC1: cycle {} ns\n",
            *config.assign_activate, config.sync0_cycle_ns, config.sync0_shift_ns, config.sync1_cycle_ns);
    return text + "\n";
}

nlohmann::ordered_json config_json(const ConfigFacts& config) {
    auto sdos = nlohmann::ordered_json::array();
    for (const auto& sdo : config.sdos)
        sdos.push_back({{"index", sdo.index},
                        {"subindex", sdo.subindex},
                        {"complete_access", sdo.complete_access},
                        {"octets", hex(sdo.data)}});
    auto sms = nlohmann::ordered_json::array();
    for (const auto& sm : config.sync_managers) {
        std::vector<unsigned> pdos;
        for (const auto& pdo : sm.pdos) pdos.push_back(pdo.index);
        sms.push_back({{"number", sm.number}, {"direction", sm.outputs() ? "outputs" : "inputs"}, {"pdos", pdos}});
    }
    auto parameters = nlohmann::ordered_json::array();
    for (const auto& parameter : config.parameters)
        parameters.push_back({{"drive", parameter.drive}, {"idn", parameter.idn}, {"octets", hex(parameter.data)}});
    nlohmann::ordered_json dc = nullptr;
    if (config.assign_activate)
        dc = {{"assign_activate", *config.assign_activate},
              {"sync0_cycle_ns", config.sync0_cycle_ns},
              {"sync0_shift_ns", config.sync0_shift_ns},
              {"sync1_cycle_ns", config.sync1_cycle_ns}};
    nlohmann::ordered_json all{
        {"alias", config.alias},
        {"position", config.relative},
        {"vendor", config.vendor},
        {"product", config.product},
        {"attached", config.position ? nlohmann::ordered_json(*config.position) : nlohmann::ordered_json(nullptr)},
        {"state", config.position ? nlohmann::ordered_json(to_text(config.state)) : nlohmann::ordered_json(nullptr)},
        {"sync_managers", sms},
        {"sdos", sdos},
        {"parameters", parameters},
        {"dc", dc}};
    if (!config.problem.empty()) all["error"] = config.problem;
    return all;
}

// ------------------------------------------------------------------ domains

// Alias addresses of the slaves.
Answer<std::vector<AliasAddress>> addresses_of(Session& session) {
    const auto slaves = session.slaves();
    if (!slaves) return slaves.problem();
    return alias_addresses(*slaves);
}

std::string fmmu_text(const DomainFacts& domain, const FmmuFacts& fmmu, const std::vector<AliasAddress>& addresses) {
    const auto address = address_of(addresses, fmmu.position);
    std::string text =
        fmt::format("  SlaveConfig {}:{}, SM{} ({:>6}), LogAddr 0x{:08x}, Size {}\n", address.alias, address.relative,
                    fmmu.sync_manager, fmmu.input ? "Input" : "Output", fmmu.logical, fmmu.bytes);
    const std::size_t at = fmmu.logical - domain.base;
    if (fmmu.logical < domain.base || at + fmmu.bytes > domain.data.size()) return text;
    return text + "    " + octets_line(std::span(domain.data).subspan(at, fmmu.bytes)) + "\n";
}

nlohmann::ordered_json domain_json(const DomainFacts& domain) {
    auto fmmus = nlohmann::ordered_json::array();
    for (const auto& fmmu : domain.fmmus)
        fmmus.push_back({{"position", fmmu.position},
                         {"sync_manager", fmmu.sync_manager},
                         {"direction", fmmu.input ? "inputs" : "outputs"},
                         {"logical_address", fmmu.logical},
                         {"bytes", fmmu.bytes}});
    return {{"index", domain.index},
            {"logical_base_address", domain.base},
            {"bytes", domain.data.size()},
            {"working_counter", domain.wkc},
            {"expected_working_counter", domain.expected_wkc},
            {"fmmus", fmmus},
            {"data", hex(domain.data)}};
}

// The domains that --domain selects.
Answer<std::vector<DomainFacts>> selected_domains(const Call& call, Master& master) {
    const auto wanted = call.option_numbers("domain");
    if (!wanted) return wanted.problem();
    auto all = master.session->domains();
    if (!all || !*wanted) return all;
    std::vector<std::uint32_t> known;
    for (const DomainFacts& domain : *all) known.push_back(domain.index);
    if (const auto missing = (*wanted)->missing(known)) return Problem{fmt::format("there is no domain {}", *missing)};
    std::erase_if(*all, [&](const DomainFacts& domain) { return !(*wanted)->contains(domain.index); });
    return all;
}

// The lines, or with --json the document. The octets of all domains are written to the file of --output-file, which is
// not given with lines.
int print_data_lines(Call& call) {
    Octets octets;
    bool complete = true;
    const auto path = call.has("output-file") ? call.value("output-file") : std::string("-");
    return call.each_master([&](Master& master, Output& output) -> Answer<> {
        const auto domains = selected_domains(call, master);
        complete &= static_cast<bool>(domains);
        if (!domains) return domains.problem();
        output.json["domains"] = nlohmann::ordered_json::array();
        for (const DomainFacts& domain : *domains) {
            output.text += fmt::format("Domain{}: {}\n", domain.index, octets_line(domain.data));
            output.json["domains"].push_back(domain_json(domain));
            octets.insert(octets.end(), domain.data.begin(), domain.data.end());
        }
        // The file is written before the document is printed, because the document contains the result.
        const bool write = path != "-" && complete && &master == &call.masters().back();
        return write ? write_octets(path, octets) : Answer<>();
    });
}

}  // namespace

int run_config(Call& call) {
    const auto aliases = call.option_numbers("alias");
    if (!aliases) return call.fail(aliases.problem());
    const auto positions = call.option_numbers("position");
    if (!positions) return call.fail(positions.problem());
    return call.each_master([&](Master& master, Output& output) -> Answer<> {
        const auto configs = master.session->configs();
        if (!configs) return configs.problem();
        output.json["configs"] = nlohmann::ordered_json::array();
        std::string unread;  // the one-line form does not need it
        std::vector<std::uint32_t> known_aliases;
        std::vector<std::uint32_t> known_positions;  // of the configurations that --alias selects
        for (const ConfigFacts& config : *configs) {
            const bool by_alias = *aliases ? (*aliases)->contains(config.alias) : !*positions || config.alias == 0;
            known_aliases.push_back(config.alias);
            if (by_alias) known_positions.push_back(config.relative);
            if (!by_alias || (*positions && !(*positions)->contains(config.relative))) continue;
            output.text += call.has("verbose") ? config_details(config) : config_line(config);
            output.json["configs"].push_back(config_json(config));
            if (unread.empty()) unread = config.problem;
        }
        if (output.json["configs"].empty() && (*aliases || *positions))
            return Problem{"no configuration is selected by --alias and --position"};
        const auto no_alias = *aliases ? (*aliases)->missing(known_aliases) : std::nullopt;
        if (no_alias) return Problem{fmt::format("there is no configuration with alias {}", *no_alias)};
        const auto no_position = *positions ? (*positions)->missing(known_positions) : std::nullopt;
        if (no_position) return Problem{fmt::format("there is no configuration at position {}", *no_position)};
        if (!unread.empty() && call.has("verbose")) return Problem{unread};
        return {};
    });
}

int run_domains(Call& call) {
    return call.each_master([&](Master& master, Output& output) -> Answer<> {
        const auto domains = selected_domains(call, master);
        if (!domains) return domains.problem();
        const auto addresses = addresses_of(*master.session);
        if (!addresses) return addresses.problem();
        output.json["domains"] = nlohmann::ordered_json::array();
        for (const DomainFacts& domain : *domains) {
            output.text += fmt::format("Domain{}: LogBaseAddr 0x{:08x}, Size {:>3}, WorkingCounter {}/{}\n",
                                       domain.index, domain.base, domain.data.size(), domain.wkc, domain.expected_wkc);
            if (call.has("verbose"))
                for (const FmmuFacts& fmmu : domain.fmmus) output.text += fmmu_text(domain, fmmu, *addresses);
            output.json["domains"].push_back(domain_json(domain));
        }
        return {};
    });
}

int run_data(Call& call) {
    const bool again = call.has("watch") || call.has("count");
    if (again && call.has("output-file"))
        return call.fail(
            {"--output-file takes the octets of one cycle: leave out --watch and --count", samples::exit_code::kUsage});
    if (again || call.json()) return call.repeat([&] { return print_data_lines(call); });
    Octets all;
    for (Master& master : call.masters()) {
        const auto domains = selected_domains(call, master);
        if (!domains) return call.fail(domains.problem());
        for (const DomainFacts& domain : *domains) all.insert(all.end(), domain.data.begin(), domain.data.end());
    }
    const auto path = call.has("output-file") ? call.value("output-file") : std::string("-");
    const auto written = write_octets(path, all);
    return written ? samples::exit_code::kWell : call.fail(written.problem());
}

}  // namespace margay::ethercat
