// The parts of a device in an ESI file: PDOs, mailbox, operation modes, EEPROM, slots and modules.
#include "files/esi_read.hpp"

#include "files/mail_commands.hpp"
#include "files/transitions.hpp"

#include <algorithm>

namespace margay::files {
namespace {

EsiEntry read_entry(Reader& r, Node node) {
    EsiEntry entry;
    entry.index = r.required<std::uint16_t>(node, "Index");
    entry.subindex = r.number<std::uint8_t>(child(node, "SubIndex"));
    entry.bits = r.required<std::uint16_t>(node, "BitLen");
    entry.name = english(node, "Name");
    entry.data_type = Reader::text(child(node, "DataType"));
    if (entry.bits == 0) r.fail(node, "an entry has BitLen 0");
    return entry;
}

bool depends_on_slot(Reader& r, Node index) {
    return r.boolean(attribute(index, "DependOnSlot")) || attribute(index, "DependOnSlotGroup").there;
}

struct Flag {
    const char* name;
    std::uint8_t bit;
};
constexpr Flag kCoeFlags[] = {{"SdoInfo", coe_detail::kSdoInformation},
                              {"PdoAssign", coe_detail::kPdoAssignment},
                              {"PdoConfig", coe_detail::kPdoConfiguration},
                              {"PdoUpload", coe_detail::kUploadAtStartup},
                              {"CompleteAccess", coe_detail::kCompleteAccess}};

// Reads the object or parameter that the command writes.
void read_place(Reader& r, Node node, EsiCommand& command) {
    switch (command.protocol) {
        case mailbox_protocol::kCoE:
            command.index = r.required<std::uint16_t>(node, "Index");
            command.subindex = r.number<std::uint8_t>(child(node, "SubIndex"));
            command.complete_access = r.boolean(attribute(node, "CompleteAccess"));
            command.depends_on_slot = depends_on_slot(r, node.child("Index"));
            break;
        case mailbox_protocol::kSoE:
            command.index = r.required<std::uint16_t>(node, "IDN");
            command.subindex = r.number<std::uint8_t>(attribute(node, "Chn"));
            break;
        case mailbox_protocol::kEoE: command.index = r.number<std::uint8_t>(child(node, "Type")); break;
        default: break;
    }
}

void read_commands(Reader& r, Node protocol, std::uint16_t kind, std::vector<EsiCommand>& into) {
    for (const Node node : protocol.children("InitCmd")) {
        EsiCommand command{.protocol = kind};
        command.transitions = read_transitions(r, node);
        read_place(r, node, command);
        command.data = r.octets(child(node, "Data"));
        if (const char* const why = not_sent(command); why != nullptr) r.remark(node, why);
        command.comment = english(node, "Comment");
        if (attribute(node.child("Data"), "AdaptAutomatically").there)
            r.remark(node, "AdaptAutomatically is not done: the value of the file is written");
        if (command.transitions != Transition::none) into.push_back(std::move(command));
    }
}

EsiMode read_mode(Reader& r, Node node) {
    EsiMode mode;
    mode.name = english(node, "Name");
    mode.description = english(node, "Desc");
    mode.assign_activate = r.number<std::uint16_t>(child(node, "AssignActivate"));
    const Node cycle0 = node.child("CycleTimeSync0");
    mode.sync0_cycle_given = static_cast<bool>(cycle0);
    mode.sync0_cycle_ns = r.number<std::int64_t>(content(cycle0));
    mode.sync0_factor = r.number<std::int16_t>(attribute(cycle0, "Factor"));
    const Node shift0 = node.child("ShiftTimeSync0");
    mode.sync0_shift_ns = r.number<std::int64_t>(content(shift0));
    if (attribute(shift0, "Factor").there && r.number<std::int16_t>(attribute(shift0, "Factor")) != 0)
        r.remark(shift0, "the factor of ShiftTimeSync0 is not used");
    const Node cycle1 = node.child("CycleTimeSync1");
    mode.sync1_cycle_ns = r.number<std::int64_t>(content(cycle1));
    mode.sync1_factor = r.number<std::int16_t>(attribute(cycle1, "Factor"));
    if (mode.sync1_factor < 0 && mode.sync1_cycle_ns == 0)
        r.remark(cycle1, "a negative factor of CycleTimeSync1 is not used: SYNC1 has no cycle of its own");
    mode.sync1_shift_ns = r.number<std::int64_t>(child(node, "ShiftTimeSync1"));
    if (mode.sync1_shift_ns < 0)
        r.remark(node.child("ShiftTimeSync1"), "a negative ShiftTimeSync1 is not used: SYNC1 is not before its SYNC0");
    for (const Node sm : node.children("Sm")) {
        EsiModeSm one{.number = r.number<std::uint8_t>(attribute(sm, "No"))};
        for (const Node pdo : sm.children("Pdo")) {
            one.pdos.push_back(r.number<std::uint16_t>(content(pdo)));
            if (attribute(pdo, "OSFac").there) r.remark(pdo, "oversampling (OSFac) is not done");
        }
        mode.sync_managers.push_back(std::move(one));
    }
    const std::int64_t most = std::numeric_limits<std::uint32_t>::max();
    for (const std::int64_t time : {mode.sync0_cycle_ns, mode.sync1_cycle_ns})
        if (time < 0 || time > most) r.fail(node, "a cycle time of an operation mode is not between 0 and 4294967295");
    for (const std::int64_t time : {mode.sync0_shift_ns, mode.sync1_shift_ns})
        if (time < -most || time > most) r.fail(node, "a shift time of an operation mode has more than 32 bits");
    return mode;
}

EsiSlot read_slot(Reader& r, Node node) {
    EsiSlot slot;
    slot.name = english(node, "Name");
    slot.least = r.number<std::uint32_t>(attribute(node, "MinInstances"));
    slot.most = r.number<std::uint32_t>(attribute(node, "MaxInstances"), 1);
    if (slot.least > slot.most)
        r.remark(node, "MinInstances is " + std::to_string(slot.least) + ", and MaxInstances " +
                           std::to_string(slot.most) + ": there are as many slots as MaxInstances says");
    for (const Node ident : node.children("ModuleIdent"))
        slot.idents.push_back({r.number<std::uint32_t>(content(ident)), r.boolean(attribute(ident, "Default"))});
    for (const Node one : node.children("ModuleClass"))
        slot.classes.push_back(Reader::text(one.child("Class") ? child(one, "Class") : content(one)));
    return slot;
}

}  // namespace

Transition read_transitions(Reader& r, Node command) {
    Transition all = Transition::none;
    for (const Node node : command.children("Transition")) {
        const Transition one = transition_by_initials(content(node).text);
        if (one == Transition::none)
            r.remark(node,
                     "the transition '" + Reader::text(content(node)) + "' is not supported: nothing is sent then");
        all = all | one;
    }
    if (!command.child("Transition")) r.remark(command, "the command has no Transition: it is never sent");
    return all;
}

EsiPdo read_esi_pdo(Reader& r, Node node, Direction direction) {
    EsiPdo pdo{.direction = direction};
    if (node.child("Ref") && !node.child("Index"))
        r.fail(node, "a PDO by reference (Ref) is an old dialect that is not supported");
    else
        pdo.index = r.required<std::uint16_t>(node, "Index");
    pdo.name = english(node, "Name");
    if (const Value sm = attribute(node, "Sm"); sm.there) pdo.sync_manager = r.number<std::uint8_t>(sm);
    pdo.fixed = r.boolean(attribute(node, "Fixed"));
    pdo.mandatory = r.boolean(attribute(node, "Mandatory"));
    pdo.is_virtual = r.boolean(attribute(node, "Virtual"));
    pdo.overwritten_by_module = r.boolean(attribute(node, "OverwrittenByModule"));
    pdo.depends_on_slot = depends_on_slot(r, node.child("Index"));
    for (const Node exclude : node.children("Exclude"))
        pdo.excludes.push_back(r.number<std::uint16_t>(content(exclude)));
    for (const Node entry : node.children("Entry")) {
        if (pdo.entries.size() == 255) {
            r.fail(entry, "a PDO has more than 255 entries");
            break;
        }
        pdo.entries.push_back(read_entry(r, entry));
        pdo.entry_depends_on_slot.push_back(depends_on_slot(r, entry.child("Index")));
    }
    return pdo;
}

std::vector<EsiPdo> read_esi_pdos(Reader& r, Node parent) {
    std::vector<EsiPdo> pdos;
    for (const Node node : parent.children()) {
        const std::string_view name = node.name();
        if (name == "RxPdo") pdos.push_back(read_esi_pdo(r, node, Direction::outputs));
        if (name == "TxPdo") pdos.push_back(read_esi_pdo(r, node, Direction::inputs));
    }
    return pdos;
}

EsiMailbox read_esi_mailbox(Reader& r, Node node) {
    EsiMailbox mailbox;
    mailbox.data_link_layer = r.boolean(attribute(node, "DataLinkLayer"));
    static constexpr std::pair<const char*, std::uint16_t> kProtocols[] = {
        {"AoE", mailbox_protocol::kAoE}, {"EoE", mailbox_protocol::kEoE}, {"CoE", mailbox_protocol::kCoE},
        {"FoE", mailbox_protocol::kFoE}, {"SoE", mailbox_protocol::kSoE}, {"VoE", mailbox_protocol::kVoE}};
    for (const auto& [name, bit] : kProtocols) {
        const Node protocol = node.child(name);
        if (!protocol) continue;
        mailbox.protocols |= bit;
        if (bit != mailbox_protocol::kFoE && bit != mailbox_protocol::kVoE)
            read_commands(r, protocol, bit, mailbox.commands);
        else if (protocol.child("InitCmd"))
            r.remark(protocol.child("InitCmd"), std::string("start-up commands of ") + name + " are not supported");
    }
    if (const Node coe = node.child("CoE")) {
        mailbox.coe_details = coe_detail::kSdo;
        for (const Flag& flag : kCoeFlags)
            if (r.boolean(attribute(coe, flag.name))) mailbox.coe_details |= flag.bit;
        mailbox.ds402_channels = r.number<std::uint8_t>(attribute(coe, "DS402Channels"));
    }
    mailbox.soe_channels = r.number<std::uint8_t>(attribute(node.child("SoE"), "ChannelCount"),
                                                  node.child("SoE") ? std::uint8_t{1} : std::uint8_t{0});
    return mailbox;
}

std::vector<EsiMode> read_esi_modes(Reader& r, Node dc) {
    std::vector<EsiMode> modes;
    for (const Node node : dc.children("OpMode")) modes.push_back(read_mode(r, node));
    return modes;
}

EsiSlots read_esi_slots(Reader& r, Node node) {
    EsiSlots slots;
    slots.most = r.number<std::uint32_t>(attribute(node, "MaxSlotCount"));
    slots.pdo_increment = r.number<std::uint32_t>(attribute(node, "SlotPdoIncrement"));
    slots.index_increment = r.number<std::uint32_t>(attribute(node, "SlotIndexIncrement"));
    slots.download_ident_list = r.boolean(attribute(node, "DownloadModuleIdentList"));
    for (const Node slot : node.children("Slot")) slots.slots.push_back(read_slot(r, slot));
    return slots;
}

EsiModule read_esi_module(Reader& r, Node node) {
    EsiModule module;
    const Node type = node.child("Type");
    if (!type) r.fail(node, "Module has no Type");
    module.type = Reader::text(content(type));
    module.ident = r.number<std::uint32_t>(attribute(type, "ModuleIdent"));
    module.module_class = Reader::text(attribute(type, "ModuleClass"));
    module.name = english(node, "Name");
    module.pdos = read_esi_pdos(r, node);
    if (const Node mailbox = node.child("Mailbox")) module.commands = read_esi_mailbox(r, mailbox).commands;
    return module;
}

EsiEeprom read_esi_eeprom(Reader& r, Node node) {
    EsiEeprom eeprom;
    const Value size = child(node, "ByteSize");
    eeprom.bytes = r.number<std::uint32_t>(size);
    if (size.there && eeprom.bytes == 0) r.remark(node, "ByteSize is 0: the EEPROM is as large as its contents need");
    eeprom.whole = r.octets(child(node, "Data"));
    // The first words of an SII, up to its checksum.
    constexpr std::size_t kConfigurationBytes = 14;
    constexpr std::size_t kBootBytes = 8;
    const auto part = [&](const char* name, std::size_t most) {
        auto octets = r.octets(child(node, name));
        if (octets.size() > most) {
            r.remark(node.child(name), std::string(name) + " has " + std::to_string(octets.size()) +
                                           " octets: those behind the first " + std::to_string(most) + " are not used");
            octets.resize(most);
        }
        return octets;
    };
    eeprom.configuration = part("ConfigData", kConfigurationBytes);
    eeprom.boot_mailbox = part("BootStrap", kBootBytes);
    for (const Node one : node.children("Category")) {
        EsiCategory category{.type = r.required<std::uint16_t>(one, "CatNo")};
        category.content = r.octets(child(one, "Data"));
        if (const Value text = child(one, "DataString"); text.there)
            for (const char c : text.text) category.content.push_back(static_cast<std::byte>(c));
        const auto add = [&](std::uint32_t value, int octets) {
            for (int n = 0; n < octets; ++n) category.content.push_back(static_cast<std::byte>(value >> (8 * n)));
        };
        if (const Value value = child(one, "DataUINT"); value.there) add(r.number<std::uint16_t>(value), 2);
        if (const Value value = child(one, "DataUDINT"); value.there) add(r.number<std::uint32_t>(value), 4);
        eeprom.categories.push_back(std::move(category));
    }
    return eeprom;
}

}  // namespace margay::files
