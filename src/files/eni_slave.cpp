// One slave of an ENI file.
#include "files/eni_read.hpp"
#include "files/esi_read.hpp"
#include "files/modules.hpp"
#include "wire/fmmu.hpp"
#include "wire/sync_manager.hpp"

#include <algorithm>
#include <charconv>

namespace margay::files {
namespace {

namespace reg = wire::reg;

constexpr std::uint16_t kMailboxStatus = 0x080D;  // status of SyncManager 1

// `origin`: the name of the source of the address, for the remark.
void set_station_address(Reader& r, Node at, const char* origin, std::uint16_t address, EniSlaveData& s) {
    constexpr std::uint16_t kUnknown = 0x0C00;  // to 0x0FFF: see ExpectedSlave::station_address
    s.slave.station_address = address;
    if ((address & 0xFC00) == kUnknown)
        r.remark(at, std::string("the library needs the station addresses 0x0C00 to 0x0FFF: the slave gets another ") +
                         origin + " than " + hex(address));
    else
        s.expected.station_address = address;
}

// PhysAddr is optional. Without it, the station address comes from the init command that writes it.
void read_station_address(Reader& r, Node info, const std::vector<EniInit>& inits, EniSlaveData& s) {
    const Value given = child(info, "PhysAddr");
    if (given.there) set_station_address(r, info, "PhysAddr", r.number<std::uint16_t>(given), s);
    for (const EniInit& init : inits) {
        if (init.ado != reg::kStationAddress.address || !init.writes() || init.transitions == Transition::none)
            continue;
        const auto written = static_cast<std::uint16_t>(init.value(0, 2));
        if (init.data.size() < 2 || written == 0 || written == s.slave.station_address) continue;
        if (s.slave.station_address != 0)
            return r.remark(init.node, "an init command gives the slave the station address " + hex(written) +
                                           ": it gets " + hex(s.slave.station_address) +
                                           (given.there ? ", its PhysAddr" : ", as the command before it says"));
        set_station_address(r, init.node, "station address", written, s);
    }
}

void read_identification(Reader& r, Node id, EniSlaveData& s) {
    if (!attribute(id, "Value").there) return;
    const auto value = r.number<std::uint16_t>(attribute(id, "Value"));
    const Value at = child(id, "Ado").there ? child(id, "Ado") : attribute(id, "Ado");
    const auto ado = r.number<std::uint16_t>(at);
    if (ado == reg::kStationAlias.address)
        s.expected.alias = value;
    else if (ado == reg::kAlStatusCode.address)
        s.expected.device_id = value;
    else
        r.remark(id, (at.there ? "Identification by the register " + hex(ado) : "Identification without Ado") +
                         " is not supported: only the alias (0x0012) and the device id (0x0134) are compared");
}

void read_info(Reader& r, Node info, EniSlaveData& s) {
    s.slave.name = Reader::text(child(info, "Name"));
    s.slave.identity = {
        r.number<std::uint32_t>(child(info, "VendorId")), r.number<std::uint32_t>(child(info, "ProductCode")),
        r.number<std::uint32_t>(child(info, "RevisionNo")), r.number<std::uint32_t>(child(info, "SerialNo"))};
    if (const Value position = child(info, "AutoIncAddr"); position.there)
        s.slave.ring_position = static_cast<std::uint16_t>(-r.number<std::uint16_t>(position));
    read_identification(r, info.child("Identification"), s);
}

bool is_whole(std::span<const std::byte> mask) {
    return std::ranges::all_of(mask, [](std::byte one) { return one == std::byte{0xFF}; });
}

bool is_nothing(std::span<const std::byte> mask) {
    return std::ranges::all_of(mask, [](std::byte one) { return one == std::byte{0}; });
}

// Finds the identity that the init commands check: one command writes the word address to the SII interface, and the
// next one compares the data.
class IdentityChecks {
  public:
    void see(Reader& r, const EniInit& init, EniSlaveData& s) {
        constexpr std::uint16_t kControl = 0x0502;
        constexpr std::uint16_t kData = 0x0508;
        if (init.ado == kControl && init.writes() && init.data.size() >= 6)
            word_ = static_cast<std::uint32_t>(init.value(2, 4));
        if (init.ado != kData || !init.validates) return;
        constexpr std::size_t kWord = 2;  // octets; each part of the identity has two words
        for (std::size_t at = 0; at < init.wanted.size(); at += 2 * kWord)
            see(r, init, at, static_cast<std::uint32_t>(word_ + at / kWord), s);
        if (init.at_least && (word_ != 0x0C || init.wanted.size() > 2 * kWord))
            r.remark(init.node, "EQ_OR_G is supported for the revision only: the value is compared for equality");
    }
    bool any = false;

  private:
    // The four octets that the command compares from `at` on belong to this word and the next word.
    void see(Reader& r, const EniInit& init, std::size_t at, std::uint32_t word, EniSlaveData& s) {
        const auto mask = std::span(init.mask).subspan(at);
        if (is_nothing(mask.first(std::min<std::size_t>(mask.size(), 4)))) return;  // it compares other octets
        const bool whole = init.wanted.size() >= at + 4 && is_whole(mask.first(4));
        const auto value = static_cast<std::uint32_t>(wanted_value(init, at));
        const bool identity = word == 0x08 || word == 0x0A || word == 0x0C || word == 0x0E;
        if (!identity) return r.remark(init.node, "the check of SII word " + hex(word) + " is not supported");
        if (!whole)
            return r.fail(init.node,
                          "the check of SII word " + hex(word) +
                              " compares a part of the value, by its size or by DataMask, which is not supported");
        any = true;
        std::optional<std::uint32_t>& part = word == 0x08   ? s.expected.vendor
                                             : word == 0x0A ? s.expected.product
                                             : word == 0x0C ? s.expected.revision
                                                            : s.expected.serial;
        if (part && *part != value)
            r.remark(init.node, "the check of SII word " + hex(word) + " wants " + hex(value, 8) +
                                    ", and one before it wants " + hex(*part, 8) + ": the last one is used");
        part = value;
        if (word == 0x0C) s.expected.newer_revision = init.at_least && init.wanted.size() == 4;
    }
    static std::uint64_t wanted_value(const EniInit& init, std::size_t at) {
        std::uint64_t value = 0;
        for (std::size_t n = 0; n < 4 && at + n < init.wanted.size(); ++n)
            value |= std::to_integer<std::uint64_t>(init.wanted[at + n]) << (8 * n);
        return value;
    }

    std::uint32_t word_ = 0;
};

// Adds a remark if Info has another identity than the init commands. The init commands decide which slave is accepted,
// as in the master for which the file was made.
void name_other_identity(Reader& r, const EniSlaveData& s) {
    const auto compare = [&](const char* name, std::uint32_t said, const std::optional<std::uint32_t>& checked) {
        if (said != 0 && checked && *checked != said)
            r.remark(s.node.child("Info").child(name), std::string(name) + " is " + hex(said, 8) +
                                                           ", and an init command checks for " + hex(*checked, 8) +
                                                           ": the init command decides which slave is accepted");
    };
    compare("VendorId", s.slave.identity.vendor, s.expected.vendor);
    compare("ProductCode", s.slave.identity.product, s.expected.product);
}

// Reads the timeouts of the states.
void read_times(const EniInit& init, SlaveTimes& times) {
    if (init.ado != reg::kAlStatus.address || !init.validates) return;
    const auto set = [&](Transition one, Duration& into) {
        if (contains(init.transitions, one)) into = std::max(into, init.timeout);
    };
    // At IP, the command that checks INIT has the same timeout as the command that checks PREOP.
    set(Transition::init_to_preop, times.to_preop);
    set(Transition::preop_to_safeop, times.to_safeop);
    set(Transition::safeop_to_op, times.to_op);
    for (const Transition down : {Transition::op_to_safeop, Transition::op_to_preop, Transition::op_to_init,
                                  Transition::safeop_to_preop, Transition::safeop_to_init, Transition::preop_to_init})
        set(down, times.down);
}

void see_fmmus(Reader& r, const EniInit& init, EniSlaveData& s) {
    if (!init.writes() || init.is_zero()) return;
    if (!contains(init.transitions, Transition::preop_to_safeop) &&
        contains(init.transitions, Transition::safeop_to_op))
        r.remark(init.node, "the FMMU is set at SO: the library sets it at PS");
    const std::size_t offset = init.ado - reg::kFmmuBase;
    if (offset % reg::kFmmuStride != 0 || init.data.size() % reg::kFmmuStride != 0) {
        r.fail(init.node, "an init command writes a part of an FMMU, which is not supported");
        return;
    }
    for (std::size_t at = 0; at < init.data.size(); at += reg::kFmmuStride) {
        const wire::Fmmu f = wire::load_fmmu(std::span(init.data).subspan(at, reg::kFmmuStride));
        const std::uint64_t first = std::uint64_t{f.logical_start.value} * 8;
        const EniFmmu fmmu{.node = init.node,
                           .begin_bit = first + f.logical_start_bit,
                           .end_bit = first + (std::uint64_t{f.length_bytes} - 1) * 8 + f.logical_end_bit + 1U,
                           .physical_bit = std::uint64_t{f.physical_start} * 8 + f.physical_start_bit,
                           .reads = f.read,
                           .writes = f.write};
        if (!f.active) continue;
        if (f.physical_start == kMailboxStatus) {
            s.config.mailbox_status = true;
            s.status_fmmus.push_back(fmmu);
            continue;
        }
        const auto number = static_cast<unsigned>((offset + at) / reg::kFmmuStride);
        if (f.length_bytes == 0 || f.logical_start_bit > 7 || f.logical_end_bit > 7 || f.physical_start_bit > 7 ||
            fmmu.end_bit <= fmmu.begin_bit || f.read == f.write)
            r.fail(init.node, "FMMU " + std::to_string(number) +
                                  " has values that no FMMU of process data has: length, bits or direction are wrong");
        s.fmmus[number] = fmmu;
    }
}

void see_sync_managers(Reader& r, const EniInit& init, EniSlaveData& s) {
    // Outputs with OpOnly are set, or enabled, at SO.
    const bool in_time =
        contains(init.transitions, Transition::preop_to_safeop) || contains(init.transitions, Transition::safeop_to_op);
    if (!init.writes() || !in_time) return;
    const std::size_t offset = init.ado - reg::kSyncManagerBase;
    if (init.is_zero()) return;
    if (!contains(init.transitions, Transition::preop_to_safeop))
        r.remark(init.node, "the SyncManager is set at SO (OpOnly): the library sets it at PS");
    if (offset % reg::kSyncManagerStride != 0 || init.data.size() % reg::kSyncManagerStride != 0) {
        r.fail(init.node, "an init command writes a part of a SyncManager, which is not supported");
        return;
    }
    for (std::size_t at = 0; at < init.data.size(); at += reg::kSyncManagerStride) {
        const auto number = static_cast<std::uint8_t>((offset + at) / reg::kSyncManagerStride);
        const auto octet = [&](std::size_t n) { return static_cast<std::uint8_t>(init.value(at + n, 1)); };
        s.sms[number] = {init.node,
                         number,
                         static_cast<std::uint16_t>(init.value(at, 2)),
                         static_cast<std::uint16_t>(init.value(at + 2, 2)),
                         octet(4),
                         octet(6)};
    }
}

void read_dc(Reader& r, Node dc, EniSlaveData& s) {
    s.reference_clock = r.boolean(child(dc, "ReferenceClock"));
    const auto cycle0 = r.number<std::uint32_t>(child(dc, "CycleTime0"));
    s.setup.dc.shift = Duration(r.number<std::int32_t>(child(dc, "ShiftTime")));
    if (s.setup.dc.sync0_cycle < Duration{0} && cycle0 != 0) s.setup.dc.sync0_cycle = Duration(cycle0);
}

void read_inits(Reader& r, Node node, EniSlaveData& s) {
    std::vector<EniInit> inits = read_eni_inits(r, node);
    read_station_address(r, node.child("Info"), inits, s);
    s.has_inits = !inits.empty();
    IdentityChecks checks;
    for (EniInit& init : inits) {
        const bool by_position = init.cmd == EniCmd::aprd || init.cmd == EniCmd::apwr;
        const bool by_station = init.cmd == EniCmd::fprd || init.cmd == EniCmd::fpwr;
        const bool other =
            (by_position && s.slave.ring_position && static_cast<std::uint16_t>(-init.adp) != *s.slave.ring_position) ||
            (by_station && s.slave.station_address != 0 && init.adp != s.slave.station_address);
        if (other) {
            r.remark(init.node, "an init command of this slave addresses another slave, " + std::to_string(init.adp) +
                                    ", and is not sent");
            continue;
        }
        checks.see(r, init, s);
        read_times(init, s.setup.times);
        if (init.ado >= reg::kFmmuBase && init.ado < reg::kFmmuBase + 0x100) see_fmmus(r, init, s);
        if (init.ado >= reg::kSyncManagerBase && init.ado < reg::kSyncManagerBase + 0x80) see_sync_managers(r, init, s);
        name_library_register(r, init);
        const std::size_t commands = s.registers.size();
        add_register_command(r, init, s);
        if (init.cmd == EniCmd::bwr && s.registers.size() != commands)
            r.remark(init.node, "the BWR of register " + hex(init.ado) +
                                    " is an init command of this slave: it is sent to this slave only");
        s.inits.push_back(std::move(init));
    }
    read_eni_sync(r, s);
    if (checks.any) return name_other_identity(r, s);
    // A file without checks still contains the identity of its slave.
    if (s.slave.identity.vendor == 0 && s.slave.identity.product == 0 && !s.node.child("HotConnect"))
        r.remark(s.node,
                 "the slave has neither VendorId nor ProductCode, and no init command checks them: any slave is "
                 "accepted in its place");
    if (s.slave.identity.vendor != 0) s.expected.vendor = s.slave.identity.vendor;
    if (s.slave.identity.product != 0) s.expected.product = s.slave.identity.product;
}

void read_coe(Reader& r, Node protocol, EniSlaveData& s) {
    for (const Node node : protocol.child("InitCmds").children("InitCmd")) {
        if (r.boolean(child(node, "Disabled"))) continue;
        StartupCommand command{.kind = StartupCommand::Kind::write_object};
        command.transitions = read_transitions(r, node);
        command.index = r.required<std::uint16_t>(node, "Index");
        command.subindex = r.number<std::uint8_t>(child(node, "SubIndex"));
        command.complete_access = r.boolean(attribute(node, "CompleteAccess"));
        command.timeout = read_eni_time(r, child(node, "Timeout"));
        // 1 is a download; some producers write 2, an upload, at a download.
        const auto ccs = r.number<std::uint8_t>(child(node, "Ccs"), 1);
        if (ccs != 1 && ccs != 2)
            r.remark(node, "Ccs is " + std::to_string(ccs) + ", which is no SDO download: it is sent as a download");
        std::vector<std::byte> data = r.octets(child(node, "Data"));
        if (command.complete_access && command.subindex > 1)
            r.fail(node, "complete access begins at subindex 0 or 1, and not " + std::to_string(command.subindex));
        if (data.empty()) {
            r.remark(node, "the CoE command for " + hex(command.index) + " has no data: it is not sent");
            continue;
        }
        if (command.transitions == Transition::none) continue;
        command.data = Borrowed<std::byte>(std::span<const std::byte>(s.octets.emplace_back(std::move(data))));
        s.mail.push_back(command);
    }
}

bool selects_pdos(const StartupCommand& command) {
    const auto within = [&](unsigned first, unsigned end) { return command.index >= first && command.index < end; };
    return within(0x1600, 0x1C00) || within(0x1C10, 0x1C30);
}

// A file without init commands contains no SyncManagers, so the library reads the PDOs from the slave in PREOP. The
// commands that select the PDOs, and the commands before them, must be executed before this reading.
void advance_pdo_commands(Reader& r, Node protocol, EniSlaveData& s) {
    const auto last = std::find_if(s.mail.rbegin(), s.mail.rend(), [](const StartupCommand& command) {
        return selects_pdos(command) && contains(command.transitions, Transition::preop_to_safeop);
    });
    if (s.has_inits || last == s.mail.rend()) return;
    for (auto& command : std::span(s.mail).first(static_cast<std::size_t>(s.mail.rend() - last)))
        if (contains(command.transitions, Transition::preop_to_safeop))
            command.transitions = command.transitions | Transition::init_to_preop;
    r.remark(protocol,
             "the slave has no init commands for its SyncManagers: its CoE commands at PS up to the last one that "
             "selects PDOs are executed at IP, too, because the library reads the PDOs before PS");
}

// The reason why a command of SoE is not sent; empty: it writes the value of a parameter, and is sent.
std::string not_a_value(Reader& r, Node node, const StartupCommand& command, bool no_data) {
    constexpr unsigned kWriteRequest = 3;
    constexpr unsigned kValue = 0x40;  // the element of the IDN, a bit of the SoE header
    const auto code = r.number<std::uint8_t>(child(node, "OpCode"), kWriteRequest);
    const auto elements = r.number<std::uint8_t>(child(node, "Elements"), kValue);
    if (command.subindex > 7) return "the drive number " + std::to_string(command.subindex) + " is more than 7";
    if (no_data || code != kWriteRequest) return "only writing a value is";
    if (elements != kValue) return "Elements is " + std::to_string(elements) + ", and only the value (64) is written";
    return {};
}

void read_soe(Reader& r, Node protocol, EniSlaveData& s) {
    for (const Node node : protocol.child("InitCmds").children("InitCmd")) {
        if (r.boolean(child(node, "Disabled"))) continue;
        StartupCommand command{.kind = StartupCommand::Kind::write_parameter, .mail = &detail::kSoeStartup};
        command.transitions = read_transitions(r, node);
        command.index = r.required<std::uint16_t>(node, "IDN");
        command.subindex = r.number<std::uint8_t>(child(node, "DriveNo"));
        command.timeout = read_eni_time(r, child(node, "Timeout"));
        std::vector<std::byte> data = r.octets(child(node, "Data"));
        if (const std::string why = not_a_value(r, node, command, data.empty()); !why.empty()) {
            r.remark(node, "the SoE command for IDN " + hex(command.index) + " is not supported: " + why);
            continue;
        }
        if (command.transitions == Transition::none) continue;
        command.data = Borrowed<std::byte>(std::span<const std::byte>(s.octets.emplace_back(std::move(data))));
        s.mail.push_back(command);
    }
}

void read_mailbox(Reader& r, Node mailbox, EniSlaveData& s) {
    read_coe(r, mailbox.child("CoE"), s);
    advance_pdo_commands(r, mailbox.child("CoE"), s);
    read_soe(r, mailbox.child("SoE"), s);
    read_eni_mail(r, mailbox, s);
    s.slave.modules = configured_modules(s.mail);
}

// The PDOs of SyncManager `number` in Sm<n>/Pdo; without such a list, the PDOs with the attribute Sm.
void read_pdos(Reader& r, Node data, EniSlaveData& s) {
    std::map<std::uint16_t, EsiPdo> known;
    std::map<unsigned, std::vector<std::uint16_t>> assigned;
    for (const EsiPdo& pdo : read_esi_pdos(r, data)) {
        if (pdo.sync_manager) assigned[*pdo.sync_manager].push_back(pdo.index);
        known.emplace(pdo.index, pdo);
    }
    for (const Node sm : data.children()) {
        const std::string_view name = sm.name();
        if (name.size() != 3 || !name.starts_with("Sm") || name[2] < '0' || name[2] > '9') continue;
        if (!sm.child("Pdo")) continue;
        auto& list = assigned[static_cast<unsigned>(name[2] - '0')];
        list.clear();
        for (const Node pdo : sm.children("Pdo")) list.push_back(r.number<std::uint16_t>(content(pdo)));
    }
    for (const auto& [number, list] : assigned) {
        auto& pdos = s.pdos.emplace_back();
        for (const std::uint16_t index : list) {
            auto& entries = s.entries.emplace_back();
            if (const auto pdo = known.find(index); pdo != known.end() && r.expand(data, pdo->second.entries.size()))
                for (const EsiEntry& entry : pdo->second.entries)
                    if (entry.bits <= 255)
                        entries.push_back({entry.index, entry.index == 0 ? std::uint8_t{0} : entry.subindex,
                                           static_cast<std::uint8_t>(entry.bits)});
            pdos.push_back({index, std::span<const PdoEntry>(entries)});
        }
        s.lists.push_back({static_cast<std::uint8_t>(number), std::span<const Pdo>(pdos)});
    }
}

void read_hot_connect(Reader& r, Node node, EniSlaveData& s) {
    for (const Node identify : node.children("IdentifyCmd")) {
        const auto ado = r.number<std::uint16_t>(child(identify, "Ado"));
        const Node validate = identify.child("Validate");
        const std::vector<std::byte> wanted = r.octets(child(validate, "Data"));
        const bool known = ado == reg::kStationAlias.address || ado == reg::kAlStatusCode.address;
        if (!known || wanted.size() < 2) {
            if (validate && ado != 0x0508)  // a check of the identity by the SII
                r.remark(identify, known ? "IdentifyCmd compares " + std::to_string(wanted.size()) +
                                               " octet of the register " + hex(ado) + ", which has 2: it is not used"
                                         : "this way to identify a hot connect group is not supported: only the "
                                           "registers 0x0012 and 0x0134 are");
            continue;
        }
        const std::vector<std::byte> mask = r.octets(child(validate, "DataMask"));
        if (!is_whole(std::span(mask).first(std::min<std::size_t>(mask.size(), 2))))
            r.fail(identify,
                   "IdentifyCmd compares a part of the register " + hex(ado) + ", by DataMask, which is not supported");
        const auto value = static_cast<std::uint16_t>(std::to_integer<unsigned>(wanted[0]) |
                                                      std::to_integer<unsigned>(wanted[1]) << 8);
        (ado == reg::kStationAlias.address ? s.expected.alias : s.expected.device_id) = value;
    }
    if (!s.expected.alias && !s.expected.device_id)
        r.fail(node,
               "the first slave of the hot connect group is identified neither by its alias (0x0012) nor by its device "
               "id (0x0134)");
}

std::vector<EniBits> read_bits(Reader& r, Node data, const char* name) {
    std::vector<EniBits> all;
    for (const Node node : data.children(name))
        all.push_back({r.number<std::uint32_t>(child(node, "BitStart")),
                       r.number<std::uint32_t>(child(node, "BitLength")), node});
    return all;
}

}  // namespace

EniSlaveData read_eni_slave(Reader& r, Node node, std::uint16_t position) {
    EniSlaveData s{.node = node};
    s.slave.line = r.line_of(node);
    const Node info = node.child("Info");
    if (!info) r.fail(node, "Slave has no Info");
    read_info(r, info, s);
    if (!s.slave.ring_position) s.slave.ring_position = position;
    read_inits(r, node, s);
    const Node data = node.child("ProcessData");
    s.outputs = read_bits(r, data, "Send");
    s.inputs = read_bits(r, data, "Recv");
    read_pdos(r, data, s);
    if (const Node mailbox = node.child("Mailbox")) {
        read_mailbox(r, mailbox, s);
        if (child(mailbox.child("Recv"), "StatusBitAddr").there) s.config.mailbox_status = true;
    } else if (s.has_inits) {
        s.config.no_mailbox = true;
    }
    if (const Node dc = node.child("DC")) read_dc(r, dc, s);
    if (const Node hot = node.child("HotConnect")) read_hot_connect(r, hot, s);
    return s;
}

}  // namespace margay::files
