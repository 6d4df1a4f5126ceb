// Writes ESI files, in the order of elements of ETG.2000.
#include <margay/files/esi.hpp>

#include "files/esi_types.hpp"
#include "files/transitions.hpp"
#include "files/xml_writer.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace margay::files {
namespace {

void named(Node parent, const char* element, const std::string& text) {
    set(add(parent, element, text), "LcId", std::string("1033"));
}

std::string physics(const EsiDevice& device) {
    std::string letters;
    for (const PortType port : device.ports)
        letters += port == PortType::ebus ? 'K' : port == PortType::mii ? 'Y' : ' ';
    while (!letters.empty() && letters.back() == ' ') letters.pop_back();
    return letters;
}

// The type in an ESI file. The name of a string type contains its length. A type without a name is written as octets or
// as bits.
std::string written_type(const std::string& name, std::uint32_t bits) {
    const bool is_whole = bits != 0 && bits % 8 == 0;
    if (is_whole && name == "VISIBLE_STRING") return "STRING(" + std::to_string(bits / 8) + ")";
    if (is_whole && name == "OCTET_STRING") return "OCTET_STRING(" + std::to_string(bits / 8) + ")";
    if (!name.empty()) return name;
    if (bits <= 8) return "BYTE";
    return bits % 8 == 0 ? "ARRAY [0.." + std::to_string(bits / 8 - 1) + "] OF BYTE"
                         : "ARRAY [0.." + std::to_string(bits - 1) + "] OF BIT";
}

void write_type(Node device, const EsiDevice& d) {
    static constexpr std::array kChecks{"NONE", "EQ", "EQ_OR_G", "LW_EQ", "LW_EQ_HW_EQ_OR_G"};
    Node type = add(device, "Type", d.type);
    set(type, "ProductCode", hex_dec(d.identity.product, 8));
    set(type, "RevisionNo", hex_dec(d.identity.revision, 8));
    if (d.identity.serial != 0) set(type, "SerialNo", hex_dec(d.identity.serial, 8));
    if (d.revision_check != RevisionCheck::none)
        set(type, "CheckRevisionNo", std::string(kChecks[static_cast<std::size_t>(d.revision_check)]));
    if (d.no_lrw) set(type, "UseLrdLwr", true);
    if (d.sysman_class != 0) set(type, "TcSmClass", std::to_string(d.sysman_class));
}

void write_info(Node device, const EsiDevice& d) {
    Node info = add(device, "Info");
    if (d.ebus_current_ma != 0) add(add(info, "Electrical"), "EBusCurrent", std::to_string(d.ebus_current_ma));
    const auto ms = [](Duration time) {
        return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::milliseconds>(time).count());
    };
    const bool times = d.times.to_preop > Duration{0} || d.times.to_op > Duration{0} || d.times.down > Duration{0};
    if (times || d.safeop_configuration) {
        Node machine = add(info, "StateMachine");
        if (times) {
            Node timeout = add(machine, "Timeout");
            if (d.times.to_preop > Duration{0}) add(timeout, "PreopTimeout", ms(d.times.to_preop));
            if (d.times.to_op > Duration{0}) add(timeout, "SafeopOpTimeout", ms(d.times.to_op));
            if (d.times.down > Duration{0}) add(timeout, "BackToInitTimeout", ms(d.times.down));
        }
        if (d.safeop_configuration) set(add(machine, "Behavior"), "StartToSafeop", true);
    }
    if (d.mailbox && (d.mailbox->request_timeout > Duration{0} || d.mailbox->response_timeout > Duration{0})) {
        Node timeout = add(add(info, "Mailbox"), "Timeout");
        add(timeout, "RequestTimeout", ms(d.mailbox->request_timeout));
        add(timeout, "ResponseTimeout", ms(d.mailbox->response_timeout));
    }
    if (d.device_id_address != 0) add(info, "IdentificationAdo", hex_dec(d.device_id_address));
    if (d.device_id_by_al_status) add(info, "IdentificationReg134", std::string("true"));
    if (!info.first_child()) device.remove_child(info);
}

void write_flags(Node parent, const std::string& access, char mapping) {
    if (access.empty() && mapping == 0) return;
    Node flags = add(parent, "Flags");
    if (!access.empty()) add(flags, "Access", access);
    if (mapping != 0) add(flags, "PdoMapping", mapping == 'B' ? std::string("TR") : std::string(1, mapping));
}

// Every object with subindices has a data type of its own, which lists them.
void write_dictionary(Node device, const EsiDevice& d) {
    if (d.dictionary.empty()) return;
    Node dictionary = add(add(device, "Profile"), "Dictionary");
    Node types = add(dictionary, "DataTypes");
    Node objects = add(dictionary, "Objects");
    for (const EsiObject& object : d.dictionary) {
        std::string type = object.data_type.empty() ? "UDINT" : written_type(object.data_type, object.bits);
        std::uint64_t bits = object.bits;
        if (!object.items.empty()) {
            type = "DT" + hex(object.index).substr(2);
            Node data_type = add(types, "DataType");
            add(data_type, "Name", type);
            Node size = add(data_type, "BitSize", std::uint64_t{0});
            bits = 0;
            for (const EsiObject::Item& item : object.items) {
                Node sub = add(data_type, "SubItem");
                add(sub, "SubIdx", std::uint64_t{item.subindex});
                add(sub, "Name", item.name);
                add(sub, "Type", written_type(item.data_type, item.bits));
                add(sub, "BitSize", std::uint64_t{item.bits});
                add(sub, "BitOffs", bits);
                bits += item.subindex == 0 ? 16 : item.bits;  // subindex 0 is followed by a gap
                write_flags(sub, item.access, item.pdo_mapping);
            }
            size.text().set(std::to_string(bits).c_str());
        }
        Node node = add(objects, "Object");
        add(node, "Index", hex_dec(object.index));
        named(node, "Name", object.name);
        add(node, "Type", type);
        add(node, "BitSize", bits);
        if (!object.default_data.empty()) add(add(node, "Info"), "DefaultData", hex_octets(object.default_data));
        write_flags(node, object.access, object.pdo_mapping);
    }
    if (!types.first_child()) dictionary.remove_child(types);
}

void write_sync_managers(Node device, const EsiDevice& d) {
    static constexpr std::array kFmmus{"", "Outputs", "Inputs", "MBoxState"};
    for (const EsiFmmu& fmmu : d.fmmus)
        add(device, "Fmmu", fmmu.text.empty() ? std::string(kFmmus[static_cast<std::size_t>(fmmu.use)]) : fmmu.text);
    static constexpr std::array kUses{"", "MBoxOut", "MBoxIn", "Outputs", "Inputs"};
    for (const EsiSyncManager& sm : d.sync_managers) {
        const auto type = static_cast<std::size_t>(sm.type);
        const std::string use = type != 0 && type < kUses.size() ? kUses[type] : sm.use.empty() ? kUnusedSm : sm.use;
        Node node = add(device, "Sm", use);
        if (sm.least_bytes != 0) set(node, "MinSize", std::to_string(sm.least_bytes));
        if (sm.most_bytes != 0) set(node, "MaxSize", std::to_string(sm.most_bytes));
        if (sm.default_bytes != 0) set(node, "DefaultSize", std::to_string(sm.default_bytes));
        set(node, "StartAddress", hex_dec(sm.start));
        set(node, "ControlByte", hex_dec(sm.control, 2));
        set(node, "Enable", sm.enabled);
        if (sm.op_only) set(node, "OpOnly", true);
        if (sm.is_virtual) set(node, "Virtual", true);
    }
}

void write_index(Node parent, std::uint16_t index, bool depends_on_slot) {
    Node node = add(parent, "Index", hex_dec(index));
    if (depends_on_slot) set(node, "DependOnSlot", true);
}

void write_pdos(Node parent, const std::vector<EsiPdo>& pdos) {
    for (const Direction direction : {Direction::outputs, Direction::inputs})
        for (const EsiPdo& pdo : pdos) {
            if (pdo.direction != direction) continue;
            Node node = add(parent, direction == Direction::outputs ? "RxPdo" : "TxPdo");
            if (pdo.fixed) set(node, "Fixed", true);
            if (pdo.mandatory) set(node, "Mandatory", true);
            if (pdo.is_virtual) set(node, "Virtual", true);
            if (pdo.sync_manager) set(node, "Sm", std::to_string(*pdo.sync_manager));
            if (pdo.overwritten_by_module) set(node, "OverwrittenByModule", true);
            write_index(node, pdo.index, pdo.depends_on_slot);
            named(node, "Name", pdo.name);
            for (const std::uint16_t exclude : pdo.excludes) add(node, "Exclude", hex_dec(exclude));
            for (std::size_t n = 0; n < pdo.entries.size(); ++n) {
                const EsiEntry& entry = pdo.entries[n];
                Node one = add(node, "Entry");
                write_index(one, entry.index, n < pdo.entry_depends_on_slot.size() && pdo.entry_depends_on_slot[n]);
                if (entry.index != 0) add(one, "SubIndex", std::uint64_t{entry.subindex});
                add(one, "BitLen", std::uint64_t{entry.bits});
                if (entry.index == 0) continue;
                named(one, "Name", entry.name);
                add(one, "DataType", written_type(entry.data_type, entry.bits));
            }
        }
}

void write_commands(Node protocol, const std::vector<EsiCommand>& commands, std::uint16_t kind) {
    for (const EsiCommand& command : commands) {
        if (command.protocol != kind) continue;
        const bool soe = kind == mailbox_protocol::kSoE;
        Node node = add(protocol, "InitCmd");
        if (command.complete_access) set(node, "CompleteAccess", true);
        if (soe) set(node, "Chn", std::to_string(command.subindex));
        for (const Transition one : kTransitions)
            if (contains(command.transitions, one)) add(node, "Transition", std::string(initials(one)));
        if (soe) {
            add(node, "IDN", std::uint64_t{command.index});
        } else if (kind == mailbox_protocol::kEoE) {
            if (command.index != 0) add(node, "Type", std::uint64_t{command.index});
        } else if (kind == mailbox_protocol::kCoE) {
            write_index(node, command.index, command.depends_on_slot);
            add(node, "SubIndex", std::uint64_t{command.subindex});
        }
        add(node, "Data", hex_octets(command.data));
        if (!command.comment.empty()) named(node, "Comment", command.comment);
    }
}

// In the order of the schema.
void write_module_commands(Node mailbox, const std::vector<EsiCommand>& commands) {
    static constexpr std::pair<const char*, std::uint16_t> kProtocols[] = {{"AoE", mailbox_protocol::kAoE},
                                                                           {"EoE", mailbox_protocol::kEoE},
                                                                           {"CoE", mailbox_protocol::kCoE},
                                                                           {"SoE", mailbox_protocol::kSoE}};
    for (const auto& [name, bit] : kProtocols)
        if (std::ranges::find(commands, bit, &EsiCommand::protocol) != commands.end())
            write_commands(add(mailbox, name), commands, bit);
}

void write_mailbox(Node device, const EsiMailbox& m) {
    Node mailbox = add(device, "Mailbox");
    if (m.data_link_layer) set(mailbox, "DataLinkLayer", true);
    const auto has = [&](std::uint16_t bit) { return (m.protocols & bit) != 0; };
    if (has(mailbox_protocol::kAoE)) write_commands(add(mailbox, "AoE"), m.commands, mailbox_protocol::kAoE);
    if (has(mailbox_protocol::kEoE)) write_commands(add(mailbox, "EoE"), m.commands, mailbox_protocol::kEoE);
    if (has(mailbox_protocol::kCoE)) {
        Node coe = add(mailbox, "CoE");
        set(coe, "SdoInfo", (m.coe_details & coe_detail::kSdoInformation) != 0);
        set(coe, "PdoAssign", (m.coe_details & coe_detail::kPdoAssignment) != 0);
        set(coe, "PdoConfig", (m.coe_details & coe_detail::kPdoConfiguration) != 0);
        set(coe, "PdoUpload", (m.coe_details & coe_detail::kUploadAtStartup) != 0);
        set(coe, "CompleteAccess", (m.coe_details & coe_detail::kCompleteAccess) != 0);
        if (m.ds402_channels != 0) set(coe, "DS402Channels", std::to_string(m.ds402_channels));
        write_commands(coe, m.commands, mailbox_protocol::kCoE);
    }
    if (has(mailbox_protocol::kSoE)) {
        Node soe = add(mailbox, "SoE");
        set(soe, "ChannelCount", std::to_string(m.soe_channels));
        write_commands(soe, m.commands, mailbox_protocol::kSoE);
    }
    if (has(mailbox_protocol::kFoE)) add(mailbox, "FoE");
    if (has(mailbox_protocol::kVoE)) add(mailbox, "VoE");
}

void write_modes(Node device, const EsiDevice& d) {
    if (!d.has_dc && d.modes.empty()) return;
    Node dc = add(device, "Dc");
    for (const EsiMode& mode : d.modes) {
        Node node = add(dc, "OpMode");
        add(node, "Name", mode.name);
        if (!mode.description.empty()) add(node, "Desc", mode.description);
        add(node, "AssignActivate", hex_dec(mode.assign_activate));
        if (mode.sync0_cycle_given) {
            Node cycle = add(node, "CycleTimeSync0", std::to_string(mode.sync0_cycle_ns));
            if (mode.sync0_factor != 0) set(cycle, "Factor", std::to_string(mode.sync0_factor));
        }
        if (mode.sync0_shift_ns != 0) add(node, "ShiftTimeSync0", std::to_string(mode.sync0_shift_ns));
        if (mode.sync1_cycle_ns != 0 || mode.sync1_factor != 0)
            set(add(node, "CycleTimeSync1", std::to_string(mode.sync1_cycle_ns)), "Factor",
                std::to_string(mode.sync1_factor));
        if (mode.sync1_shift_ns != 0) add(node, "ShiftTimeSync1", std::to_string(mode.sync1_shift_ns));
        for (const EsiModeSm& sm : mode.sync_managers) {
            Node one = add(node, "Sm");
            set(one, "No", std::to_string(sm.number));
            for (const std::uint16_t pdo : sm.pdos) add(one, "Pdo", hex_dec(pdo));
        }
    }
}

void write_slots(Node device, const EsiSlots& s) {
    Node slots = add(device, "Slots");
    if (s.download_ident_list) set(slots, "DownloadModuleIdentList", true);
    if (s.most != 0) set(slots, "MaxSlotCount", std::to_string(s.most));
    set(slots, "SlotPdoIncrement", std::to_string(s.pdo_increment));
    set(slots, "SlotIndexIncrement", std::to_string(s.index_increment));
    for (const EsiSlot& slot : s.slots) {
        Node node = add(slots, "Slot");
        set(node, "MinInstances", std::to_string(slot.least));
        set(node, "MaxInstances", std::to_string(slot.most));
        named(node, "Name", slot.name);
        for (const EsiModuleIdent& ident : slot.idents) {
            Node one = add(node, "ModuleIdent", hex_dec(ident.ident, 8));
            if (ident.is_default) set(one, "Default", true);
        }
        for (const std::string& one : slot.classes) add(add(node, "ModuleClass"), "Class", one);
    }
}

void write_eeprom(Node device, const EsiEeprom& e) {
    Node eeprom = add(device, "Eeprom");
    if (!e.whole.empty()) {
        add(eeprom, "Data", hex_octets(e.whole));
        return;
    }
    add(eeprom, "ByteSize", std::uint64_t{e.bytes});
    add(eeprom, "ConfigData", hex_octets(e.configuration));
    if (!e.boot_mailbox.empty()) add(eeprom, "BootStrap", hex_octets(e.boot_mailbox));
    for (const EsiCategory& category : e.categories) {
        Node node = add(eeprom, "Category");
        add(node, "CatNo", std::uint64_t{category.type});
        add(node, "Data", hex_octets(category.content));
    }
}

void write_esc(Node device, const EsiDevice& d) {
    if (!d.watchdog_divider && !d.pdi_watchdog && !d.process_data_watchdog) return;
    Node esc = add(device, "ESC");
    if (d.watchdog_divider) add(esc, "Reg0400", std::uint64_t{*d.watchdog_divider});
    if (d.pdi_watchdog) add(esc, "Reg0410", std::uint64_t{*d.pdi_watchdog});
    if (d.process_data_watchdog) add(esc, "Reg0420", std::uint64_t{*d.process_data_watchdog});
}

void write_device(Node devices, const EsiDevice& d) {
    Node device = add(devices, "Device");
    if (const std::string letters = physics(d); !letters.empty()) set(device, "Physics", letters);
    write_type(device, d);
    named(device, "Name", d.name);
    write_info(device, d);
    add(device, "GroupType", d.group.empty() ? "Devices" : d.group);
    write_dictionary(device, d);
    write_sync_managers(device, d);
    write_pdos(device, d.pdos);
    if (d.mailbox) write_mailbox(device, *d.mailbox);
    write_modes(device, d);
    if (d.slots) write_slots(device, *d.slots);
    write_esc(device, d);
    if (d.eeprom) write_eeprom(device, *d.eeprom);
}

// Returns the data that an ESI or this writer cannot express.
std::vector<std::string> left_out(const EsiFile& esi) {
    std::vector<std::string> lost;
    for (const EsiDevice& d : esi.devices)
        if (d.mailbox && d.mailbox->ds402_channels != 0 && (d.mailbox->protocols & mailbox_protocol::kCoE) == 0)
            lost.push_back(d.type + ": the number of DS402 channels is left out: an ESI has it for slaves with CoE");
    if (!esi.further_files.empty()) lost.push_back("the references to further files (InfoReference) are left out");
    return lost;
}

}  // namespace

Written write_esi(const EsiFile& esi) {
    pugi::xml_document document;
    Node declaration = document.append_child(pugi::node_declaration);
    set(declaration, "version", std::string("1.0"));
    set(declaration, "encoding", std::string("UTF-8"));
    Node root = add(document, "EtherCATInfo");
    set(root, "Version", std::string("1.6"));
    Node vendor = add(root, "Vendor");
    add(vendor, "Id", hex_dec(esi.vendor, 8));
    named(vendor, "Name", esi.vendor_name);
    Node descriptions = add(root, "Descriptions");
    Node groups = add(descriptions, "Groups");
    std::vector<std::string> done;
    for (const EsiDevice& device : esi.devices) {
        const std::string type = printable(device.group.empty() ? "Devices" : device.group);
        if (std::ranges::find(done, type) != done.end()) continue;
        done.push_back(type);
        Node group = add(groups, "Group");
        add(group, "Type", type);
        named(group, "Name", device.group_name.empty() ? type : device.group_name);
    }
    Node devices = add(descriptions, "Devices");
    for (const EsiDevice& device : esi.devices) write_device(devices, device);
    if (!esi.modules.empty()) {
        Node modules = add(descriptions, "Modules");
        for (const EsiModule& m : esi.modules) {
            Node module = add(modules, "Module");
            Node type = add(module, "Type", m.type);
            set(type, "ModuleIdent", hex_dec(m.ident, 8));
            if (!m.module_class.empty()) set(type, "ModuleClass", m.module_class);
            named(module, "Name", m.name);
            write_pdos(module, m.pdos);
            if (!m.commands.empty()) write_module_commands(add(module, "Mailbox"), m.commands);
        }
    }
    return {.text = to_string(document), .remarks = left_out(esi)};
}

}  // namespace margay::files
