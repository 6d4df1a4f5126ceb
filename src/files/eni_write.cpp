// Writes the segment of a context as an ENI, in the order of elements of ETG.2100.
#include <margay/files/eni.hpp>
#include <margay/files/esi.hpp>
#include <margay/margay.hpp>

#include "files/eni_write.hpp"
#include "files/said.hpp"
#include "wire/fmmu.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <vector>

namespace margay::files {
namespace {

namespace reg = wire::reg;

constexpr std::uint8_t kLrd = 10;
constexpr std::uint8_t kLwr = 11;

class EniWriter {
  public:
    EniWriter(Context& ctx, const EniSettings& settings) : ctx_(ctx), settings_(settings) {}

    Written run() {
        Node declaration = document_.append_child(pugi::node_declaration);
        set(declaration, "version", std::string("1.0"));
        set(declaration, "encoding", std::string("UTF-8"));
        Node root = add(document_, "EtherCATConfig");
        set(root, "Version", std::string("1.3"));
        Node config = add(root, "Config");
        write_master(config);
        for (const Slave& slave : ctx_.slaves()) {
            if (slave.ring_position == 0) {
                remarks_.push_back("slave " + std::to_string(slave.number) + " is missing and is left out");
                continue;
            }
            write_slave(config, slave);
            if (!error_.empty()) return {.error = error_};
        }
        for (std::size_t n = 0; n < ctx_.limits().groups; ++n) {
            if (!ctx_.group(n).mapped) continue;
            write_cyclic(config, n);
            if (!ctx_.group(n).config.copies.empty())
                remarks_.push_back("group " + std::to_string(n) + ": the copies from slave to slave are left out");
        }
        write_image(config);
        return {.text = to_string(document_), .remarks = std::move(remarks_)};
    }

  private:
    void write_master(Node config) {
        Node master = add(config, "Master");
        Node info = add(master, "Info");
        add(info, "Name", printable(settings_.master_name));
        add(info, "Destination", std::string("ffffffffffff"));
        add(info, "Source", std::string("000000000000"));
        add(info, "EtherType", std::string("a488"));
        if (!settings_.eoe) return;
        Node eoe = add(master, "EoE");
        add(eoe, "MaxPorts", std::uint64_t{settings_.eoe->ports});
        add(eoe, "MaxFrames", std::uint64_t{settings_.eoe->frames});
        add(eoe, "MaxMACs", std::uint64_t{settings_.eoe->macs});
    }

    [[nodiscard]] bool read(const Slave& slave, std::uint16_t address, std::span<std::byte> into) {
        const auto done = read_register(ctx_, slave.number, address, into);
        if (!done) error_ = said(done.error());
        return done.ok();
    }

    void write_slave(Node config, const Slave& slave) {
        SlaveRegisters registers;
        registers.station = slave.station_address.value;
        registers.fmmus.resize(std::min<std::size_t>(slave.dl.fmmus, 16) * reg::kFmmuStride);
        registers.sms.resize(std::min<std::size_t>(slave.dl.sync_managers, 8) * reg::kSyncManagerStride);
        if (!registers.fmmus.empty() && !read(slave, reg::kFmmuBase, registers.fmmus)) return;
        if (!registers.sms.empty() && !read(slave, reg::kSyncManagerBase, registers.sms)) return;
        const bool sync = slave_clock(ctx_, slave.number).sync_active;
        if (sync && (!read(slave, 0x0980, registers.assign_activate) || !read(slave, 0x09A0, registers.cycles))) return;
        registers.sync = sync;
        for (const std::uint16_t address : watchdogs_in_use(slave))
            if (!read(slave, address, registers.watchdogs.emplace_back(address, std::array<std::byte, 2>{}).second))
                return;
        fmmus_.push_back(registers.fmmus);
        const auto described = describe_of(slave);
        Node node = add(config, "Slave");
        write_slave_info(node, slave);
        write_process_data(node, slave, described);
        if (slave.mailbox.present()) write_mailbox(node, slave);
        keep(unwritable(slave));
        keep(write_slave_inits(add(node, "InitCmds"), slave, registers));
        if (slave.parent != 0) {
            Node port = add(node, "PreviousPort");
            set(port, "Selected", true);
            add(port, "Port", std::string(1, "ABCD"[slave.parent_port & 3]));
            add(port, "PhysAddr", std::uint64_t{ctx_.slave(slave.parent).station_address.value});
        }
        write_dc(node, slave, registers);
        keep(write_hot_connect(node, ctx_, slave));
        names_.push_back({slave.number, described});
    }

    void keep(const std::vector<std::string>& lost) { remarks_.insert(remarks_.end(), lost.begin(), lost.end()); }

    // The names come from the PDOs of the SII; without these PDOs the ENI has no names.
    EsiDevice describe_of(const Slave& slave) {
        if (!slave.sii_read) return {};
        std::vector<std::byte> image;
        if (const std::string error = read_sii_image(ctx_, slave.number, image); !error.empty()) {
            remarks_.push_back("slave " + std::to_string(slave.number) + ": names of PDOs are left out: " + error);
            return {};
        }
        auto device = describe_sii(image);
        return device ? std::move(*device) : EsiDevice{};
    }

    void write_dc(Node node, const Slave& slave, const SlaveRegisters& registers) {
        const SlaveClock& clock = slave_clock(ctx_, slave.number);
        if (!clock.synchronised) return;
        Node dc = add(node, "DC");
        add(dc, "PotentialReferenceClock", std::string("1"));
        add(dc, "ReferenceClock", std::string(reference_clock(ctx_) == slave.number ? "1" : "0"));
        const auto at = [&](std::size_t n) { return std::uint64_t{load_le<std::uint32_t>(registers.cycles, n)}; };
        if (registers.sync) {
            add(dc, "CycleTime0", at(0));
            add(dc, "CycleTime1", at(4));
            add(dc, "ShiftTime", std::to_string(slave.config.dc().shift.count()));
        }
    }

    void write_slave_info(Node node, const Slave& slave) {
        Node info = add(node, "Info");
        add(info, "Name", printable("Slave_" + std::to_string(slave.number) + " [" + std::string(slave.name()) + "]"));
        add(info, "PhysAddr", std::uint64_t{slave.station_address.value});
        add(info, "AutoIncAddr", std::uint64_t{static_cast<std::uint16_t>(1 - slave.ring_position)});
        add(info, "VendorId", std::uint64_t{slave.identity.vendor});
        add(info, "ProductCode", std::uint64_t{slave.identity.product});
        add(info, "RevisionNo", std::uint64_t{slave.identity.revision});
        add(info, "SerialNo", std::uint64_t{slave.identity.serial});
        keep(write_identification(info, ctx_, slave));
    }

    // The logical addresses that the cycle of a group exchanges.
    struct Range {
        std::uint64_t begin = 0;
        std::uint64_t end = 0;
        std::uint64_t before = 0;  // octets of the groups before it
    };
    // Both halves of the image of the file have the logical addresses of the groups, one group behind the other: so one
    // offset of a cyclic command is valid for the data of all slaves of this command.
    [[nodiscard]] const Range& range_of(std::size_t number) {
        for (std::size_t group = ranges_.size(); group <= number; ++group) {
            const Range last = ranges_.empty() ? Range() : ranges_.back();
            Range& range =
                ranges_.emplace_back(Range{.begin = UINT64_MAX, .before = last.before + (last.end - last.begin)});
            for (std::size_t n = 0; n < ctx_.group(group).datagrams.size(); ++n) {
                const PlannedDatagram datagram = process_datagram(ctx_, n, static_cast<std::uint8_t>(group));
                range.begin = std::min<std::uint64_t>(range.begin, datagram.address.value);
                range.end = std::max<std::uint64_t>(range.end, std::uint64_t{datagram.address.value} + datagram.bytes);
            }
            if (range.end == 0) range.begin = 0;  // no process data
        }
        return ranges_[number];
    }

    // The first bit of the slave's data in both halves of the image of the file.
    std::uint64_t file_bit(const Slave& slave, Direction direction) {
        const std::uint64_t before = range_of(slave.image.group).before * 8;
        const Group& group = ctx_.group(slave.image.group);
        if (direction == Direction::outputs) return before + slave.image.outputs.offset_bits;
        return before + slave.image.inputs.offset_bits - (group.config.overlapped ? group.output_bytes * 8 : 0);
    }

    void write_process_data(Node node, const Slave& slave, const EsiDevice& described) {
        Node data = add(node, "ProcessData");
        if (slave.image.group == SlaveImage::kNoGroup) return;
        for (const auto& [name, direction, part] : {std::tuple{"Send", Direction::outputs, &slave.image.outputs},
                                                    std::tuple{"Recv", Direction::inputs, &slave.image.inputs}}) {
            if (part->bits == 0) continue;
            Node range = add(data, name);
            add(range, "BitStart", file_bit(slave, direction));
            add(range, "BitLength", std::uint64_t{part->bits});
        }
        const std::vector<EsiPdo> pdos = assigned_pdos(slave, described);
        for (const ProcessSm& sm : slave.config.used_sms()) {
            Node one = add(data, ("Sm" + std::to_string(sm.number)).c_str());
            add(one, "Type", std::string(sm.direction == Direction::outputs ? "Outputs" : "Inputs"));
            add(one, "DefaultSize", std::uint64_t{sm.bytes()});
            add(one, "StartAddress", std::uint64_t{sm.start});
            add(one, "ControlByte", std::uint64_t{sm.control});
            add(one, "Enable", std::string(sm.bits != 0 ? "1" : "0"));
            for (const EsiPdo& pdo : pdos)
                if (pdo.sync_manager == sm.number) add(one, "Pdo", std::uint64_t{pdo.index});
        }
        for (const EsiPdo& pdo : pdos) write_pdo(data, pdo);
    }

    static void write_pdo(Node data, const EsiPdo& pdo) {
        Node node = add(data, pdo.direction == Direction::outputs ? "RxPdo" : "TxPdo");
        set(node, "Sm", std::to_string(*pdo.sync_manager));
        add(node, "Index", hex_dec(pdo.index));
        add(node, "Name", printable(pdo.name));
        for (const EsiEntry& entry : pdo.entries) {
            Node one = add(node, "Entry");
            add(one, "Index", hex_dec(entry.index));
            if (entry.index != 0) add(one, "SubIndex", std::uint64_t{entry.subindex});
            add(one, "BitLen", std::uint64_t{entry.bits});
            if (entry.index == 0) continue;
            add(one, "Name", printable(entry.name));
            if (!entry.data_type.empty()) add(one, "DataType", entry.data_type);
        }
    }

    // The PDOs of the configuration, otherwise of the SII, if they have the size of the SyncManager.
    static std::vector<EsiPdo> assigned_pdos(const Slave& slave, const EsiDevice& described) {
        std::vector<EsiPdo> all;
        for (const ProcessSm& sm : slave.config.used_sms()) {
            std::vector<EsiPdo> some;
            for (const SmPdos& list : slave.config.pdos()) {
                if (list.sync_manager != sm.number) continue;
                for (const Pdo& pdo : list.pdos) some.push_back(named_pdo(pdo, sm, described));
            }
            if (some.empty())
                for (const EsiPdo& pdo : described.pdos)
                    if (pdo.sync_manager == sm.number) some.push_back(pdo);
            std::uint32_t bits = 0;
            for (const EsiPdo& pdo : some) bits += pdo.bits();
            if (bits == sm.bits) all.insert(all.end(), some.begin(), some.end());
        }
        return all;
    }

    // The type of an entry from the SII, because a configuration has no types. Empty: the SII has no entry of this size
    // at the index.
    static std::string entry_type(const EsiDevice& described, Direction direction, const PdoEntry& wanted) {
        for (const EsiPdo& pdo : described.pdos)
            for (const EsiEntry& entry : pdo.entries)
                if (pdo.direction == direction && entry.index == wanted.index && entry.subindex == wanted.subindex &&
                    entry.bits == wanted.bits && !entry.data_type.empty())
                    return entry.data_type;
        return {};
    }

    static EsiPdo named_pdo(const Pdo& pdo, const ProcessSm& sm, const EsiDevice& described) {
        EsiPdo named{.direction = sm.direction, .index = pdo.index};
        const EsiPdo* known = described.find_pdo(pdo.index);
        if (known != nullptr) named.name = known->name;
        named.sync_manager = sm.number;
        for (const PdoEntry& entry : pdo.entries) {
            EsiEntry one{entry.index, entry.subindex, entry.bits, {}, {}};
            one.name = entry_name(described, sm.direction, entry.index, entry.subindex);
            one.data_type = entry_type(described, sm.direction, entry);
            named.entries.push_back(one);
        }
        return named;
    }

    // Returns Recv.
    static Node write_places(Node node, const MailboxInfo& places) {
        Node send = add(node, "Send");
        add(send, "Start", std::uint64_t{places.out_start});
        add(send, "Length", std::uint64_t{places.out_bytes});
        Node receive = add(node, "Recv");
        add(receive, "Start", std::uint64_t{places.in_start});
        add(receive, "Length", std::uint64_t{places.in_bytes});
        return receive;
    }

    void write_mailbox(Node node, const Slave& slave) {
        Node mailbox = add(node, "Mailbox");
        Node receive = write_places(mailbox, slave.mailbox);
        if (slave.config.mailbox_status)
            add(receive, "StatusBitAddr", std::uint64_t{slave.image.mailbox_status_bit});
        else
            add(receive, "PollTime", std::uint64_t{20});
        if (slave.boot_mailbox.present()) (void)write_places(add(mailbox, "BootStrap"), slave.boot_mailbox);
        static constexpr std::pair<const char*, std::uint16_t> kProtocols[] = {
            {"AoE", mailbox_protocol::kAoE}, {"EoE", mailbox_protocol::kEoE}, {"CoE", mailbox_protocol::kCoE},
            {"FoE", mailbox_protocol::kFoE}, {"SoE", mailbox_protocol::kSoE}, {"VoE", mailbox_protocol::kVoE}};
        for (const auto& [name, bit] : kProtocols)
            if ((slave.mailbox.protocols & bit) != 0) add(mailbox, "Protocol", std::string(name));
        write_mail_commands(mailbox, ctx_, slave);
    }

    void write_cyclic(Node config, std::size_t number) {
        const Group& group = ctx_.group(number);
        Node cyclic = add(config, "Cyclic");
        const auto us = std::chrono::duration_cast<std::chrono::microseconds>(settings_.cycle).count();
        add(cyclic, "CycleTime", static_cast<std::uint64_t>(us));
        std::vector<Node> frames;
        const Range range = range_of(number);
        for (std::size_t n = 0; n < group.datagrams.size(); ++n) {
            const PlannedDatagram datagram = process_datagram(ctx_, n, static_cast<std::uint8_t>(number));
            while (frames.size() <= datagram.frame) frames.push_back(add(cyclic, "Frame"));
            Node cmd = cyclic_cmd(frames[datagram.frame], "process data", datagram.command, {"SAFEOP", "OP"});
            add(cmd, "Addr", std::uint64_t{datagram.address.value});
            add(cmd, "DataLength", std::uint64_t{datagram.bytes});
            add(cmd, "Cnt", std::uint64_t{counter_of(datagram)});
            const std::uint64_t offset = range.before + (datagram.address.value - range.begin);
            if (datagram.command != kLwr) add(cmd, "InputOffs", offset);
            if (datagram.command != kLrd) add(cmd, "OutputOffs", offset);
        }
        if (frames.empty()) frames.push_back(add(cyclic, "Frame"));
        const std::uint16_t clock = reference_clock(ctx_);
        if (clock != 0 && number == time_group()) {
            Node cmd = cyclic_cmd(frames[0], "time of the reference clock", 14, {"PREOP", "SAFEOP", "OP"});
            add(cmd, "Adp", std::uint64_t{ctx_.slave(clock).station_address.value});
            add(cmd, "Ado", std::uint64_t{0x0910});
            add(cmd, "DataLength", std::uint64_t{8});
        }
        if (group.config.al_status) {
            Node cmd = cyclic_cmd(frames[0], "AL status of all slaves", 7, {"PREOP", "SAFEOP", "OP"});
            add(cmd, "Adp", std::uint64_t{0});
            add(cmd, "Ado", std::uint64_t{0x0130});
            add(cmd, "DataLength", std::uint64_t{2});
            add(cmd, "Cnt", std::uint64_t{names_.size()});
        }
    }

    // The group whose cycle carries the time, by its last cycle or by its configuration; otherwise the first group.
    [[nodiscard]] std::size_t time_group() const {
        const auto find = [this](auto carries) {
            std::size_t n = 0;
            while (n < ctx_.limits().groups && !(ctx_.group(n).mapped && carries(ctx_.group(n)))) ++n;
            return n;
        };
        std::size_t found = find([](const Group& group) { return group.dc_time.slaves != 0; });
        if (found == ctx_.limits().groups) found = find([](const Group& g) { return g.config.dc_reference != 0; });
        return found == ctx_.limits().groups ? find([](const Group&) { return true; }) : found;
    }

    // The working counter of the slaves in the file (ETG.1000.4). The group may also have missing slaves, which are not
    // in the file.
    [[nodiscard]] unsigned counter_of(const PlannedDatagram& datagram) const {
        const std::uint64_t begin = std::uint64_t{datagram.address.value};
        unsigned sum = 0;
        for (const std::vector<std::byte>& fmmus : fmmus_) {
            bool reads = false;
            bool writes = false;
            for (std::size_t at = 0; at + reg::kFmmuStride <= fmmus.size(); at += reg::kFmmuStride) {
                const wire::Fmmu one = wire::load_fmmu(std::span(fmmus).subspan(at, reg::kFmmuStride));
                const std::uint64_t first = one.logical_start.value;
                if (!one.active || first >= begin + datagram.bytes || begin >= first + one.length_bytes) continue;
                reads |= one.read && datagram.command != kLwr;
                writes |= one.write && datagram.command != kLrd;
            }
            sum += (reads ? 1U : 0U) + (writes ? (datagram.command == kLrd || datagram.command == kLwr ? 1U : 2U) : 0U);
        }
        return sum;
    }

    static Node cyclic_cmd(Node frame, const char* comment, std::uint8_t command,
                           std::initializer_list<const char*> states) {
        Node cmd = add(frame, "Cmd");
        for (const char* state : states) add(cmd, "State", std::string(state));
        add(cmd, "Comment", std::string(comment));
        add(cmd, "Cmd", std::uint64_t{command});
        return cmd;
    }

    void write_image(Node config) {
        Node image = add(config, "ProcessImage");
        for (const auto& [name, direction] :
             {std::pair{"Inputs", Direction::inputs}, std::pair{"Outputs", Direction::outputs}}) {
            Node half = add(image, name);
            const Range last = range_of(ctx_.limits().groups - 1);
            add(half, "ByteSize", last.before + (last.end - last.begin));
            for (const auto& [number, described] : names_)
                write_variables(half, ctx_.slave(number), direction, described);
        }
    }

    // Writes one variable for each entry; for a SyncManager without known entries, one variable for the whole
    // SyncManager.
    void write_variables(Node half, const Slave& slave, Direction direction, const EsiDevice& described) {
        if (slave.image.group == SlaveImage::kNoGroup) return;
        const std::vector<EsiPdo> pdos = assigned_pdos(slave, described);
        const std::string prefix = "Slave_" + std::to_string(slave.number) + " [" + std::string(slave.name()) + "].";
        std::uint64_t at = file_bit(slave, direction);
        bool first = true;
        const bool bits = ctx_.group(slave.image.group).config.packing == Packing::bits;
        for (const ProcessSm& sm : slave.config.used_sms()) {
            if (sm.direction != direction || sm.bits == 0) continue;
            if (!first || sm.bits >= 8 || !bits) at = (at + 7) / 8 * 8;
            first = false;
            std::uint64_t bit = at;
            for (const EsiPdo& pdo : pdos)
                for (const EsiEntry& entry : pdo.entries) {
                    if (pdo.sync_manager != sm.number) continue;
                    if (entry.index != 0)
                        variable(half, prefix + pdo.name + "." + (entry.name.empty() ? hex(entry.index) : entry.name),
                                 entry.data_type, entry.bits, bit);
                    bit += entry.bits;
                }
            if (bit == at) variable(half, prefix + "SM" + std::to_string(sm.number), {}, sm.bits, at);
            at += sm.bits;
        }
    }

    // Makes a name unique: if several entries of a PDO have the same name, the second one gets a 2, and so on.
    std::string name_once(const std::string& name) {
        if (variable_names_.insert(name).second) return name;
        for (std::size_t& n = variable_counts_.try_emplace(name, 1).first->second;;) {
            auto other = name + " " + std::to_string(++n);
            if (variable_names_.insert(other).second) return other;
        }
    }

    void variable(Node half, const std::string& name, const std::string& type, std::uint64_t bits, std::uint64_t at) {
        Node node = add(half, "Variable");
        add(node, "Name", name_once(printable(name)));
        if (!type.empty()) add(node, "DataType", type);
        add(node, "BitSize", bits);
        add(node, "BitOffs", at);
    }

    Context& ctx_;
    std::vector<Range> ranges_{};  // the ranges of the groups that were read so far
    const EniSettings& settings_;
    pugi::xml_document document_;
    std::vector<std::pair<std::uint16_t, EsiDevice>> names_;
    std::set<std::string> variable_names_{};
    std::map<std::string, std::size_t> variable_counts_{};  // the counts of repeated names
    std::vector<std::vector<std::byte>> fmmus_{};           // of the slaves of the file
    std::vector<std::string> remarks_;
    std::string error_;
};

}  // namespace

Written write_eni(Context& ctx, const EniSettings& settings) { return EniWriter(ctx, settings).run(); }

}  // namespace margay::files
