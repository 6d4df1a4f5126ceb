// The commands pdos, cstruct, xml.
#include "ethercat/call.hpp"
#include "ethercat/commands.hpp"

#include "common/xml_files.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace margay::ethercat {
namespace {

std::string pdos_text(const std::vector<SyncManagerFacts>& sms) {
    std::string text;
    for (const auto& sm : sms) {
        text += fmt::format("SM{}: PhysAddr 0x{:04x}, DefaultSize {:>4}, ControlRegister 0x{:02x}, Enable {}\n",
                            sm.number, sm.start, sm.default_bytes, sm.control, sm.enable);
        for (const auto& pdo : sm.pdos) {
            text += fmt::format("  {}xPDO 0x{:04x} \"{}\"\n", sm.outputs() ? 'R' : 'T', pdo.index, pdo.name);
            for (const auto& entry : pdo.entries)
                text += fmt::format("    PDO entry 0x{:04x}:{:02x}, {:>2} bit, \"{}\"\n", entry.index, entry.subindex,
                                    entry.bits, title_of(entry));
        }
    }
    return text;
}

nlohmann::ordered_json pdos_json(const std::vector<SyncManagerFacts>& sms) {
    auto all = nlohmann::ordered_json::array();
    for (const auto& sm : sms) {
        auto pdos = nlohmann::ordered_json::array();
        for (const auto& pdo : sm.pdos) {
            auto entries = nlohmann::ordered_json::array();
            for (const auto& entry : pdo.entries)
                entries.push_back({{"index", entry.index},
                                   {"subindex", entry.subindex},
                                   {"bits", entry.bits},
                                   {"name", entry.name},
                                   {"data_type", entry.data_type}});
            pdos.push_back({{"index", pdo.index}, {"name", pdo.name}, {"entries", entries}});
        }
        all.push_back({{"number", sm.number},
                       {"start", sm.start},
                       {"default_size", sm.default_bytes},
                       {"control", sm.control},
                       {"enable", sm.enable},
                       {"direction", sm.outputs() ? "outputs" : "inputs"},
                       {"mailbox", sm.mailbox},
                       {"pdos", pdos}});
    }
    return all;
}

// ------------------------------------------------------------------ etherlab

// The type of an entry in a template: by the data type where it is known, otherwise without a sign.
std::string matlab_type(const PdoEntryFacts& entry) {
    const auto* type = type_by_code(entry.data_type);
    if (type != nullptr && type->kind == DataType::Kind::real) return type->bytes == 4 ? "single" : "double";
    const bool is_signed = type != nullptr && type->kind == DataType::Kind::integer;
    return fmt::format("{}int({})", is_signed ? "s" : "u", entry.bits);
}

std::string matlab_text(std::string_view text) {
    std::string out;
    for (const char c : text) out += c == '\'' ? "''" : std::string(1, static_cast<unsigned char>(c) < 0x20 ? ' ' : c);
    return out;
}

std::string etherlab_text(const SlaveFacts& slave, const std::vector<SyncManagerFacts>& sms) {
    std::string text = fmt::format(
        "% Slave {}: {}\n\nslave_config.vendor = hex2dec('{:08x}');\nslave_config.product = hex2dec('{:08x}');\n"
        "slave_config.description = '{}';\nslave_config.sm = {{ ...\n",
        slave.position, matlab_text(slave.name), slave.identity.vendor, slave.identity.product,
        matlab_text(slave.name));
    std::string ports;
    unsigned numbers[2] = {};
    unsigned sm_place = 0;
    for (const auto& sm : sms) {
        if (sm.mailbox || sm.pdos.empty()) continue;
        text += fmt::format("    {{{}, {}, {{ ...\n", sm.number, sm.outputs() ? 0 : 1);
        for (std::size_t p = 0; p < sm.pdos.size(); ++p) {
            text += fmt::format("        {{hex2dec('{:04x}'), [ ...\n", sm.pdos[p].index);
            for (std::size_t e = 0; e < sm.pdos[p].entries.size(); ++e) {
                const auto& entry = sm.pdos[p].entries[e];
                text += fmt::format("            hex2dec('{:04x}'), hex2dec('{:02x}'), {}; ...\n", entry.index,
                                    entry.subindex, entry.bits);
                if (entry.index == 0) continue;
                const auto* kind = sm.outputs() ? "input" : "output";
                const unsigned number = ++numbers[sm.outputs() ? 0 : 1];
                ports +=
                    fmt::format("port_config.{}({}).pdo = [{}, {}, {}, 0];\nport_config.{}({}).pdo_data_type = {};\n",
                                kind, number, sm_place, p, e, kind, number, matlab_type(entry));
            }
            text += "            ]}, ...\n";
        }
        text += "        }}, ...\n";
        ++sm_place;
    }
    return text + "    };\n\n" + ports + "\n";
}

// ------------------------------------------------------------------ cstruct

// A text that cannot end a comment of C.
std::string comment(std::string text) {
    for (char& c : text)
        if (c == '*' || c == '\\' || static_cast<unsigned char>(c) < 0x20) c = ' ';
    return text;
}

class CStruct {
  public:
    explicit CStruct(const std::vector<SyncManagerFacts>& sms, std::string prefix) : prefix_(std::move(prefix)) {
        for (const auto& sm : sms)
            if (!sm.mailbox) add(sm);
    }

    [[nodiscard]] std::string text() const {
        std::string out;
        if (entry_count_ != 0)
            out += fmt::format("ec_pdo_entry_info_t {}_pdo_entries[] = {{\n{}}};\n\n", prefix_, entries_);
        if (pdo_count_ != 0) out += fmt::format("ec_pdo_info_t {}_pdos[] = {{\n{}}};\n\n", prefix_, pdos_);
        return out + fmt::format("ec_sync_info_t {}_syncs[] = {{\n{}    {{0xff}}\n}};\n\n", prefix_, syncs_);
    }

  private:
    void add(const SyncManagerFacts& sm) {
        const auto list = sm.pdos.empty() ? std::string("NULL") : fmt::format("{}_pdos + {}", prefix_, pdo_count_);
        syncs_ +=
            fmt::format("    {{{}, {}, {}, {}, {}}},\n", sm.number, sm.outputs() ? "EC_DIR_OUTPUT" : "EC_DIR_INPUT",
                        sm.pdos.size(), list, sm.watchdog() ? "EC_WD_ENABLE" : "EC_WD_DISABLE");
        for (const auto& pdo : sm.pdos) {
            const auto first =
                pdo.entries.empty() ? std::string("NULL") : fmt::format("{}_pdo_entries + {}", prefix_, entry_count_);
            pdos_ += fmt::format("    {{0x{:04x}, {}, {}}}, /* {} */\n", pdo.index, pdo.entries.size(), first,
                                 comment(pdo.name));
            ++pdo_count_;
            for (const auto& entry : pdo.entries) {
                entries_ += fmt::format("    {{0x{:04x}, 0x{:02x}, {}}}, /* {} */\n", entry.index, entry.subindex,
                                        entry.bits, comment(title_of(entry)));
                ++entry_count_;
            }
        }
    }

    std::string prefix_;
    std::string entries_{};
    std::string pdos_{};
    std::string syncs_{};
    std::size_t entry_count_ = 0;
    std::size_t pdo_count_ = 0;
};

std::string cstruct_text(const Master& master, const SlaveFacts& slave, const std::vector<SyncManagerFacts>& sms) {
    std::string text = fmt::format(
        "/* Master {}, Slave {}{}{}\n * Vendor ID:       0x{:08x}\n * Product code:    0x{:08x}\n"
        " * Revision number: 0x{:08x}\n */\n\n",
        master.index, slave.position, slave.name.empty() ? "" : ", ",
        slave.name.empty() ? "" : fmt::format("\"{}\"", comment(slave.name)), slave.identity.vendor,
        slave.identity.product, slave.identity.revision);
    const bool any = std::ranges::any_of(sms, [](const SyncManagerFacts& sm) { return !sm.mailbox; });
    if (!any) return text + "/* No process data. */\n\n";
    // Several masters have slaves at the same positions.
    const auto prefix = master.index == 0 ? fmt::format("slave_{}", slave.position)
                                          : fmt::format("master_{}_slave_{}", master.index, slave.position);
    return text + CStruct(sms, prefix).text();
}

using Render = std::string (*)(const Call& call, const Master& master, const SlaveFacts& slave,
                               const std::vector<SyncManagerFacts>& sms, bool several);

int each_slave(Call& call, Render render) {
    return call.each_master([&](Master& master, Output& output) -> Answer<> {
        const auto selected = call.selected(master);
        if (!selected) return selected.problem();
        output.json["slaves"] = nlohmann::ordered_json::array();
        return Call::each_slave(*selected, output, [&](const SlaveFacts& slave) -> Answer<> {
            const auto sms = master.session->sync_managers(slave.position);
            if (!sms) return sms.problem();
            const auto text = render(call, master, slave, *sms, selected->size() > 1);
            output.text += text;
            nlohmann::ordered_json json{{"position", slave.position}, {"sync_managers", pdos_json(*sms)}};
            if (call.arguments().command->name == "cstruct") json["source"] = text;
            output.json["slaves"].push_back(std::move(json));
            return {};
        });
    });
}

std::string render_pdos(const Call& call, const Master& master, const SlaveFacts& slave,
                        const std::vector<SyncManagerFacts>& sms, bool several) {
    if (call.value("skin") == "etherlab") return etherlab_text(slave, sms);
    return (several ? slave_heading(master, slave) : std::string()) + pdos_text(sms);
}

std::string render_cstruct(const Call&, const Master& master, const SlaveFacts& slave,
                           const std::vector<SyncManagerFacts>& sms, bool) {
    return cstruct_text(master, slave, sms);
}

}  // namespace

int run_pdos(Call& call) {
    const auto skin = call.value("skin");
    if (!skin.empty() && skin != "default" && skin != "etherlab")
        return call.fail({fmt::format("--skin: '{}' is none of default, etherlab", skin), samples::exit_code::kUsage});
    return each_slave(call, render_pdos);
}

int run_cstruct(Call& call) { return each_slave(call, render_cstruct); }

int run_xml(Call& call) {
    if (call.masters().size() != 1)
        return call.fail({"xml works on one master: use --master", samples::exit_code::kUsage});
    Master& master = call.masters()[0];
    const auto selected = call.selected(master);
    if (!selected) return call.fail(selected.problem());
    files::EsiFile esi;
    for (const SlaveFacts& slave : *selected) {
        auto described = master.session->describe(slave.position);
        if (!described) return call.fail(described.problem());
        for (const auto& remark : described->remarks) call.warn(fmt::format("slave {}: {}", slave.position, remark));
        const Identity& identity = described->device.identity;
        if (esi.devices.empty()) esi.vendor = identity.vendor;  // an EEPROM without an identity has vendor 0
        if (identity.vendor != esi.vendor)
            return call.fail({fmt::format("an ESI file has one vendor; slave {} is of vendor 0x{:08x}, and the slaves "
                                          "before it of 0x{:08x}: select slaves of one vendor",
                                          slave.position, identity.vendor, esi.vendor),
                              samples::exit_code::kUsage});
        if (!samples::has_device(esi, identity)) esi.devices.push_back(std::move(described->device));
    }
    esi.vendor_name = fmt::format("Vendor 0x{:08x}", esi.vendor);
    const auto written = files::write_esi(esi);
    if (!written) return call.fail({written.error});
    for (const auto& remark : written.remarks) call.warn(remark);
    Output output;
    output.json = {
        {"master", master.index}, {"vendor", esi.vendor}, {"devices", esi.devices.size()}, {"xml", written.text}};
    return call.print(output, std::as_bytes(std::span(written.text)));
}

}  // namespace margay::ethercat
