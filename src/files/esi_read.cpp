// The devices of an ESI file.
#include "files/esi_read.hpp"

#include "files/esi_types.hpp"

#include <algorithm>
#include <array>
#include <map>

namespace margay::files {
namespace {

using Names = std::map<std::string, std::string, std::less<>>;

SmType sm_type(std::string_view text) {
    static constexpr std::array kNames{"MBoxOut", "MBoxIn", "Outputs", "Inputs"};
    for (std::size_t n = 0; n < kNames.size(); ++n)
        if (same_word(text, kNames[n])) return static_cast<SmType>(n + 1);
    return SmType::unused;
}

FmmuUse fmmu_use(std::string_view text) {
    if (same_word(text, "Outputs")) return FmmuUse::outputs;
    if (same_word(text, "Inputs")) return FmmuUse::inputs;
    return same_word(text, "MBoxState") ? FmmuUse::mailbox_status : FmmuUse::unused;
}

EsiSyncManager read_sm(Reader& r, Node node) {
    EsiSyncManager sm;
    sm.use = Reader::text(content(node));
    sm.type = sm_type(sm.use);
    sm.start = r.number<std::uint16_t>(attribute(node, "StartAddress"));
    sm.control = r.number<std::uint8_t>(attribute(node, "ControlByte"));
    sm.default_bytes = r.number<std::uint16_t>(attribute(node, "DefaultSize"));
    sm.least_bytes = r.number<std::uint16_t>(attribute(node, "MinSize"));
    sm.most_bytes = r.number<std::uint16_t>(attribute(node, "MaxSize"));
    // The schema requires a number (#x1); some files have a boolean.
    const Value enable = attribute(node, "Enable");
    const bool word = enable.there && (same_word(enable.text, "true") || same_word(enable.text, "false"));
    sm.enabled = word ? r.boolean(enable) : r.number<std::uint8_t>(enable) != 0;
    sm.op_only = r.boolean(attribute(node, "OpOnly"));
    sm.is_virtual = r.boolean(attribute(node, "Virtual"));
    if (sm.type == SmType::unused && !same_word(sm.use, kUnusedSm))
        r.remark(node, "the use '" + sm.use +
                           "' of a SyncManager is none of the standard: its direction follows from "
                           "the control octet");
    return sm;
}

RevisionCheck revision_check(Reader& r, Node type) {
    static constexpr std::array kNames{"NONE", "EQ", "EQ_OR_G", "LW_EQ", "LW_EQ_HW_EQ_OR_G"};
    const Value value = attribute(type, "CheckRevisionNo");
    if (!value.there) return RevisionCheck::none;
    for (std::size_t n = 0; n < kNames.size(); ++n)
        if (same_word(value.text, kNames[n])) return static_cast<RevisionCheck>(n);
    r.remark(type, "CheckRevisionNo '" + Reader::text(value) + "' is unknown: any revision is accepted");
    return RevisionCheck::none;
}

// This attribute belongs to one tool, so the device stays usable if the value does not fit.
std::uint8_t sysman_class(Reader& r, Node type) {
    const Value value = attribute(type, "TcSmClass");
    const Number number = parse_number(value.text);
    if (!value.there || (number.valid && !number.negative && number.magnitude <= 0xFF))
        return static_cast<std::uint8_t>(number.magnitude);
    r.remark(type, "TcSmClass is " + quoted(value.text) + ", which is no number from 0 to 255: it is not used");
    return 0;
}

std::array<PortType, 4> ports_of(Reader& r, Node device) {
    std::array<PortType, 4> ports{};
    const std::string_view physics = device.attribute("Physics").value();  // a blank means an absent port
    for (std::size_t n = 0; n < physics.size() && n < ports.size(); ++n) {
        const char c = physics[n];
        if (c == 'Y' || c == 'y' || c == 'H' || c == 'h') ports[n] = PortType::mii;
        if (c == 'K' || c == 'k' || c == 'B' || c == 'b') ports[n] = PortType::ebus;
        if (ports[n] == PortType::not_implemented && c != ' ')
            r.remark(device, "Physics '" + std::string(physics) + "' has a letter that stands for no kind of port");
    }
    return ports;
}

Duration milliseconds(Reader& r, const Value& value) {
    return std::chrono::milliseconds(r.number<std::uint32_t>(value));
}

void read_info(Reader& r, EsiDevice& device, Node info) {
    device.ebus_current_ma = r.number<std::int16_t>(child(info.child("Electrical"), "EBusCurrent"));
    const Node machine = info.child("StateMachine");
    const Node times = machine.child("Timeout");
    device.times.to_preop = milliseconds(r, child(times, "PreopTimeout"));
    // The file has one time for both transitions.
    device.times.to_safeop = device.times.to_op = milliseconds(r, child(times, "SafeopOpTimeout"));
    device.times.down = milliseconds(r, child(times, "BackToInitTimeout"));
    device.safeop_configuration = r.boolean(attribute(machine.child("Behavior"), "StartToSafeop"));
    const Node controller = info.child("EtherCATController");
    for (const Node at : {info, controller}) {
        if (const Value ado = child(at, "IdentificationAdo"); ado.there)
            device.device_id_address = r.number<std::uint16_t>(ado);
        if (const Value status = child(at, "IdentificationReg134"); status.there)
            device.device_id_by_al_status = r.boolean(status);
    }
}

// Adds remarks about invalid values in unused elements of Info, because they show that the file is faulty.
void name_odd_info(Reader& r, Node info) {
    const Node controller = info.child("EtherCATController");
    const Node times = info.child("StateMachine").child("Timeout");
    const auto name = [&r](const Value& value, const std::string& wanted) {
        r.remark(value.at, value.name + " is " + quoted(value.text) + ", which is " + wanted + ": it is not used");
    };
    for (const Value& value : {child(controller, "DpramSize"), child(controller, "SmCount"),
                               child(controller, "FmmuCount"), child(times, "BackToSafeopTimeout")}) {
        const Number number = parse_number(value.text);
        constexpr std::uint64_t kMost = 0xFFFF'FFFF;
        const bool right = number.valid && number.magnitude <= kMost && (!number.negative || number.magnitude == 0);
        if (value.there && !right) name(value, "no number from 0 to " + std::to_string(kMost));
    }
    for (const Node at : {info, controller}) {
        const Value alias = child(at, "StationAliasSupported");
        const bool right =
            alias.text == "0" || alias.text == "1" || same_word(alias.text, "true") || same_word(alias.text, "false");
        if (alias.there && !right) name(alias, "neither true nor false");
    }
}

void read_mail_times(Reader& r, EsiDevice& device, Node info) {
    if (!device.mailbox) return;
    const Node times = info.child("Mailbox").child("Timeout");
    device.mailbox->request_timeout = milliseconds(r, child(times, "RequestTimeout"));
    device.mailbox->response_timeout = milliseconds(r, child(times, "ResponseTimeout"));
}

void read_esc(Reader& r, EsiDevice& device, Node esc) {
    const auto set = [&](const char* name, std::optional<std::uint16_t>& into) {
        if (const Value value = child(esc, name); value.there) into = r.number<std::uint16_t>(value);
    };
    set("Reg0400", device.watchdog_divider);
    set("Reg0410", device.pdi_watchdog);
    set("Reg0420", device.process_data_watchdog);
    if (child(esc, "Reg0108").there) r.remark(esc.child("Reg0108"), "Reg0108 is not used");
}

// The limit of registers: a device cannot have more of these elements.
void limit(Reader& r, Node device, const char* name, unsigned most) {
    unsigned count = 0;
    for (const Node one : device.children(name))
        if (++count > most) return r.fail(one, "the device has more than " + std::to_string(most) + " " + name);
}

Names group_names(Node descriptions) {
    Names names;
    for (const Node group : descriptions.child("Groups").children("Group"))
        names.emplace(Reader::text(child(group, "Type")), english(group, "Name"));
    return names;
}

// Reads one element. An element with a fault is left out.
template <class T>
void collect(Reader& r, Node node, std::vector<T>& into, T (*read)(Reader&, Node), std::optional<Remark>& first) {
    T one = read(r, node);
    if (!r.failed()) {
        into.push_back(std::move(one));
        return;
    }
    Remark problem = r.take_problem();
    if (!first) first = problem;
    r.remark(node, std::string(node.name()) + " '" + Reader::text(child(node, "Type")) +
                       "' is left out: " + to_text(problem));
}

void read_descriptions(Reader& r, EsiFile& esi, Node root, std::optional<Remark>& first) {
    const Node descriptions = root.child("Descriptions");
    const Names groups = group_names(descriptions);
    for (const Node node : descriptions.child("Devices").children("Device")) {
        const std::size_t before = esi.devices.size();
        collect(r, node, esi.devices, read_esi_device, first);
        if (esi.devices.size() == before) continue;
        EsiDevice& device = esi.devices.back();
        device.identity.vendor = esi.vendor;
        if (const auto group = groups.find(device.group); group != groups.end()) device.group_name = group->second;
    }
    for (const Node parent : {descriptions, root})
        for (const Node node : parent.child("Modules").children("Module"))
            collect(r, node, esi.modules, read_esi_module, first);
}

}  // namespace

std::string english(Node parent, const char* name) {
    constexpr std::string_view kEnglish = "1033";
    const Node first = parent.child(name);
    for (const Node node : parent.children(name))
        if (attribute(node, "LcId").text == kEnglish) return Reader::text(content(node));
    return Reader::text(content(first));
}

// Adds remarks about PDOs whose SyncManager the device does not have.
void name_pdos_without_sm(Reader& r, const EsiDevice& device, Node node) {
    const std::size_t count = device.sync_managers.size();
    for (const char* const kind : {"RxPdo", "TxPdo"})
        for (const Node pdo : node.children(kind)) {
            const Value sm = attribute(pdo, "Sm");
            if (sm.there && r.number<std::uint8_t>(sm) >= count)
                r.remark(pdo, "the PDO is of SyncManager " + std::string(sm.text) + ", and the device has " +
                                  std::to_string(count));
        }
}

EsiDevice read_esi_device(Reader& r, Node node) {
    EsiDevice device;
    device.line = r.line_of(node);
    const Node type = node.child("Type");
    if (!type) r.fail(node, "Device has no Type");
    device.type = Reader::text(content(type));
    device.identity.product = r.number<std::uint32_t>(attribute(type, "ProductCode"));
    device.identity.revision = r.number<std::uint32_t>(attribute(type, "RevisionNo"));
    device.identity.serial = r.number<std::uint32_t>(attribute(type, "SerialNo"));
    device.sysman_class = sysman_class(r, type);
    device.revision_check = revision_check(r, type);
    device.no_lrw = r.boolean(attribute(type, "UseLrdLwr"));
    device.name = english(node, "Name");
    device.group = Reader::text(child(node, "GroupType"));
    device.ports = ports_of(r, node);
    read_info(r, device, node.child("Info"));
    name_odd_info(r, node.child("Info"));
    limit(r, node, "Sm", 16);
    limit(r, node, "Fmmu", 16);
    for (const Node fmmu : node.children("Fmmu")) {
        const std::string text = Reader::text(content(fmmu));
        device.fmmus.push_back({fmmu_use(text), text});
    }
    for (const Node sm : node.children("Sm")) device.sync_managers.push_back(read_sm(r, sm));
    device.pdos = read_esi_pdos(r, node);
    name_pdos_without_sm(r, device, node);
    if (const Node mailbox = node.child("Mailbox")) device.mailbox = read_esi_mailbox(r, mailbox);
    read_mail_times(r, device, node.child("Info"));
    if (const Node dc = node.child("Dc")) {
        device.has_dc = true;
        device.modes = read_esi_modes(r, dc);
    }
    device.dictionary = read_esi_dictionary(r, node);
    if (const Node slots = node.child("Slots")) device.slots = read_esi_slots(r, slots);
    if (const Node eeprom = node.child("Eeprom")) device.eeprom = read_esi_eeprom(r, eeprom);
    read_esc(r, device, node.child("ESC"));
    return device;
}

Read<EsiFile> read_esi(std::string_view octets) {
    Reader r;
    Read<EsiFile> result;
    const auto refuse = [&] {
        result.problem = r.take_problem();
        result.remarks = r.take_remarks();
        return std::move(result);
    };
    if (!r.open(octets)) return refuse();
    const Node root = r.root();
    const std::string_view kind = root.name();
    if (kind != "EtherCATInfo" && kind != "EtherCATModule") {
        r.fail(root, "the root element is " + std::string(kind) + ": an ESI has EtherCATInfo or EtherCATModule");
        return refuse();
    }
    EsiFile esi;
    const Node vendor = root.child("Vendor");
    esi.vendor = r.number<std::uint32_t>(child(vendor, "Id"));
    esi.vendor_name = english(vendor, "Name");
    if (!child(vendor, "Id").there) r.fail(vendor ? vendor : root, "the vendor has no Id");
    if (r.failed()) return refuse();
    for (const Node reference : root.children("InfoReference"))
        esi.further_files.push_back(Reader::text(content(reference)));
    std::optional<Remark> first;
    read_descriptions(r, esi, root, first);
    if (esi.devices.empty() && esi.modules.empty() && esi.further_files.empty()) {
        result.remarks = r.take_remarks();
        result.problem = first ? *first : r.remark_at(root, "the file describes no device and no module");
        return result;
    }
    result.value = std::move(esi);
    result.remarks = r.take_remarks();
    return result;
}

}  // namespace margay::files
