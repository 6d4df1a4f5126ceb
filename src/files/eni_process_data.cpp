// The process data of the slaves of an ENI file, the Cyclic elements, and the variables.
#include "files/eni_read.hpp"

#include <algorithm>
#include <array>
#include <map>

namespace margay::files {
namespace {

// The logical range of one SyncManager.
struct Mapped {
    const EniSm* sm = nullptr;
    Direction direction = Direction::outputs;
    std::uint64_t begin = 0;
    std::uint64_t end = 0;
};

// Several FMMUs may map one SyncManager if they are contiguous in both address spaces.
std::vector<Mapped> mapped_sms(Reader& r, const EniSlaveData& s) {
    std::vector<Mapped> all;
    for (const auto& [number, fmmu] : s.fmmus) {
        const auto sm = std::ranges::find_if(s.sms, [&](const auto& one) {
            const std::uint64_t begin = one.second.start * 8U;
            return begin <= fmmu.physical_bit && fmmu.physical_bit < begin + one.second.bytes * 8U;
        });
        if (sm == s.sms.end()) {
            r.fail(fmmu.node, "FMMU " + std::to_string(number) +
                                  " maps memory of no SyncManager that the file sets, which "
                                  "is not supported");
            return {};
        }
        const Direction direction = fmmu.writes ? Direction::outputs : Direction::inputs;
        const std::uint64_t into = fmmu.physical_bit - sm->second.start * 8U;
        const auto same = std::ranges::find(all, &sm->second, &Mapped::sm);
        if (same != all.end() && same->direction == direction && same->end == fmmu.begin_bit &&
            same->end - same->begin == into) {
            same->end = fmmu.end_bit;
        } else if (same != all.end() || into != 0) {
            r.fail(fmmu.node, "FMMU " + std::to_string(number) + " maps a part of SyncManager " +
                                  std::to_string(sm->first) + " alone, which is not supported");
            return {};
        } else {
            all.push_back({&sm->second, direction, fmmu.begin_bit, fmmu.end_bit});
        }
    }
    std::ranges::sort(all, {}, [](const Mapped& m) { return std::pair(m.direction, m.begin); });
    return all;
}

// The SyncManagers of a direction must follow each other as the library places them: each on a new octet.
void check_order(Reader& r, const std::vector<Mapped>& all) {
    for (std::size_t n = 1; n < all.size(); ++n)
        if (all[n].direction == all[n - 1].direction && all[n].begin != up_to_octet(all[n - 1].end))
            r.fail(all[n].sm->node,
                   "SyncManager " + std::to_string(all[n].sm->number) +
                       " does not follow the data of the one before it in logical address space, which "
                       "is not supported");
}

std::uint32_t listed_bits(const EniSlaveData& s, std::uint8_t number) {
    std::uint32_t bits = 0;
    for (const SmPdos& list : s.lists)
        if (list.sync_manager == number)
            for (const Pdo& pdo : list.pdos)
                for (const PdoEntry& entry : pdo.entries) bits += entry.bits;
    return bits;
}

// Removes the lists that contradict their SyncManager, because they do not describe the exchanged data.
void drop_wrong_lists(Reader& r, EniSlaveData& s) {
    std::erase_if(s.lists, [&](const SmPdos& list) {
        const auto used = s.config.used_sms();
        const auto sm = std::ranges::find(used, list.sync_manager, &ProcessSm::number);
        const bool open = std::ranges::any_of(list.pdos, [](const Pdo& pdo) { return pdo.entries.empty(); });
        if (sm == used.end()) return true;
        const bool wrong = open || listed_bits(s, list.sync_manager) != sm->bits;
        if (wrong)
            r.remark(s.node, "the PDOs of SyncManager " + std::to_string(list.sync_manager) +
                                 " have another size than the SyncManager, or no entries: they name no entries");
        return wrong;
    });
}

struct Span {
    std::uint64_t begin = std::numeric_limits<std::uint64_t>::max();
    std::uint64_t end = 0;
    [[nodiscard]] bool empty() const { return end == 0; }
    void add(std::uint64_t first, std::uint64_t last) {
        begin = std::min(begin, first);
        end = std::max(end, last);
    }
    [[nodiscard]] bool touches(const Span& other) const {
        return !empty() && !other.empty() && begin < other.end && other.begin < end;
    }
};

struct CyclicCmd {
    Node node{};
    EniCmd cmd = EniCmd::nop;
    std::uint64_t begin = 0;  // bits
    std::uint64_t end = 0;
    std::optional<std::uint16_t> counter{};
    std::optional<std::uint64_t> inputs{};   // bit of the image of the file, from InputOffs
    std::optional<std::uint64_t> outputs{};  // and from OutputOffs
};

class CycleReader {
  public:
    CycleReader(Reader& r, std::deque<EniSlaveData>& slaves, EniConfiguration& into)
        : r_(r), slaves_(slaves), eni_(into) {}

    void read(Node cyclic) {
        const auto number = static_cast<std::uint8_t>(eni_.groups.size());
        EniGroup group;
        group.cycle = std::chrono::microseconds(r_.number<std::uint32_t>(child(cyclic, "CycleTime")));
        commands_.clear();
        for (const Node frame : cyclic.children("Frame"))
            for (const Node node : frame.children("Cmd")) command(node, group);
        if (!lay_out(number, group)) return;
        eni_.groups.push_back(group);
    }

  private:
    void command(Node node, EniGroup& group) {
        const auto number = r_.required<std::uint8_t>(node, "Cmd");
        const auto cmd = static_cast<EniCmd>(number);
        if (number > static_cast<std::uint8_t>(EniCmd::frmw)) {
            r_.fail(node, "Cmd is " + std::to_string(number) + ", which is no EtherCAT command");
            return;
        }
        const auto ado = r_.number<std::uint16_t>(child(node, "Ado"));
        auto length = static_cast<std::uint32_t>(r_.octets(child(node, "Data")).size());
        if (length == 0) length = r_.number<std::uint16_t>(child(node, "DataLength"));
        if (cmd == EniCmd::lrd || cmd == EniCmd::lwr || cmd == EniCmd::lrw) {
            CyclicCmd one{.node = node, .cmd = cmd};
            one.begin = std::uint64_t{r_.required<std::uint32_t>(node, "Addr")} * 8;
            one.end = one.begin + std::uint64_t{length} * 8;
            if (const Value counter = child(node, "Cnt"); counter.there)
                one.counter = r_.number<std::uint16_t>(counter);
            if (const Value offset = child(node, "InputOffs"); offset.there && cmd != EniCmd::lwr)
                one.inputs = std::uint64_t{r_.number<std::uint32_t>(offset)} * 8;
            if (const Value offset = child(node, "OutputOffs"); offset.there && cmd != EniCmd::lrd)
                one.outputs = std::uint64_t{r_.number<std::uint32_t>(offset)} * 8;
            if (commands_.size() == 1024) r_.fail(node, "a Cyclic element has more than 1024 commands of process data");
            if (!r_.failed()) commands_.push_back(one);
            if (node.child("CopyInfos")) r_.remark(node.child("CopyInfos"), "copies (CopyInfos) are not supported");
            return;
        }
        const bool time = ado == 0x0910 && (cmd == EniCmd::armw || cmd == EniCmd::frmw);
        if (time) {
            carries_time = true;
            by_position = cmd == EniCmd::armw;
            if (const Value adp = child(node, "Adp"); adp.there && !time_node) time_adp = r_.number<std::uint16_t>(adp);
            if (!time_node) time_node = node;
            time_group = static_cast<std::uint8_t>(eni_.groups.size());
        } else if (cmd == EniCmd::brd && ado == 0x0130) {
            group.config.al_status = true;
        } else if (cmd != EniCmd::nop && !(cmd == EniCmd::brd && ado == 0x092C)) {
            // A NOP has no effect, and the supervision watches the differences of the clocks.
            r_.remark(node,
                      "the cyclic command " + std::to_string(number) + " of register " + hex(ado) + " is not sent");
        }
    }

    [[nodiscard]] bool in_a_command(std::uint64_t begin, std::uint64_t end, bool writes) const {
        return std::ranges::any_of(commands_, [&](const CyclicCmd& one) {
            const bool kind = one.cmd == EniCmd::lrw || (one.cmd == EniCmd::lwr) == writes;
            return kind && begin < one.end && one.begin < end;
        });
    }

    // How many bits of a range the commands of one direction exchange.
    [[nodiscard]] std::uint64_t exchanged(const EniFmmu& fmmu) const {
        std::uint64_t bits = 0;
        for (const CyclicCmd& one : commands_)
            if (one.cmd == EniCmd::lrw || (one.cmd == EniCmd::lwr) == fmmu.writes)
                if (fmmu.begin_bit < one.end && one.begin < fmmu.end_bit)
                    bits += std::min(fmmu.end_bit, one.end) - std::max(fmmu.begin_bit, one.begin);
        return bits;
    }

    // Checks that one group exchanges all data of a slave, as the library does.
    bool check_exchanged(std::uint8_t number) {
        for (const EniSlaveData& slave : slaves_)
            for (const auto& [index, fmmu] : slave.fmmus)
                if (slave.group == number && exchanged(fmmu) < fmmu.end_bit - fmmu.begin_bit) {
                    r_.fail(fmmu.node, "the commands of the Cyclic element do not exchange all data of FMMU " +
                                           std::to_string(index) + " of the slave, which is not supported");
                    return false;
                }
        return true;
    }

    bool lay_out(std::uint8_t number, EniGroup& group) {
        Span out;
        Span in;
        for (EniSlaveData& slave : slaves_) {
            for (const auto& [index, fmmu] : slave.fmmus) {
                if (!in_a_command(fmmu.begin_bit, fmmu.end_bit, fmmu.writes)) continue;
                if (slave.group >= 0 && slave.group != number) {
                    r_.fail(fmmu.node, "the slave is exchanged by two Cyclic elements, which is not supported");
                    return false;
                }
                slave.group = number;
                (fmmu.writes ? out : in).add(fmmu.begin_bit, fmmu.end_bit);
                if (fmmu.begin_bit % 8 != 0 || fmmu.end_bit % 8 != 0) group.config.packing = Packing::bits;
            }
        }
        if (!check_exchanged(number)) return false;
        const bool any = !out.empty() || !in.empty();
        if (any) place(number, group, out, in);
        return any || group.config.al_status;
    }

    void place(std::uint8_t number, EniGroup& group, Span out, Span in) {
        group.config.overlapped = out.touches(in);
        const std::uint64_t first = std::min(out.begin, in.begin) / 8 * 8;
        const std::uint64_t outputs = out.empty() || group.config.overlapped ? first : out.begin / 8 * 8;
        std::uint64_t inputs = in.empty() || group.config.overlapped ? first : in.begin / 8 * 8;
        group.config.start = {
            static_cast<std::uint32_t>(group.config.overlapped || out.empty() ? first / 8 : outputs / 8)};
        const bool lrw = std::ranges::any_of(commands_, [](const CyclicCmd& c) { return c.cmd == EniCmd::lrw; });
        group.config.block_lrw = !lrw;
        if (!out.empty() && !in.empty() && !group.config.overlapped && inputs != up_to_octet(out.end))
            r_.remark(commands_.front().node, "the inputs are at logical address " + hex(inputs / 8, 8) +
                                                  " in the file; the library exchanges "
                                                  "them behind the outputs, at " +
                                                  hex(up_to_octet(out.end) / 8, 8));
        for (EniSlaveData& slave : slaves_) {
            if (slave.group != number) continue;
            slave.config.group = number;
            for (const auto& [index, fmmu] : slave.fmmus) {
                std::uint32_t& bit = fmmu.writes ? slave.setup.place.outputs_bit : slave.setup.place.inputs_bit;
                const auto here = static_cast<std::uint32_t>(fmmu.begin_bit - (fmmu.writes ? outputs : inputs));
                bit = std::min(bit, here);  // kNext is the greatest value
            }
        }
        const std::uint64_t octets = group.config.overlapped ? 2 * (up_to_octet(std::max(out.end, in.end)) - first)
                                                             : (out.empty() ? 0 : up_to_octet(out.end) - outputs) +
                                                                   (in.empty() ? 0 : up_to_octet(in.end) - inputs);
        constexpr std::uint64_t kMost = std::uint64_t{64} * 1024 * 1024 * 8;
        if (octets > kMost) r_.fail(commands_.front().node, "the process image has more than 64 MiB");
        bytes += octets / 8;
        check_counters(number);
        see_bit_starts(number);
    }

    // Collects the distances of BitStart from the place of the data of each slave that follows from the cyclic command
    // and the FMMU.
    void see_bit_starts(std::uint8_t number) {
        for (const EniSlaveData& slave : slaves_)
            for (const bool out : {false, true}) {
                const auto& parts = out ? slave.outputs : slave.inputs;
                if (slave.group != number || parts.size() != 1) continue;
                std::optional<std::uint64_t> begin;
                for (const auto& [index, fmmu] : slave.fmmus)
                    if (fmmu.writes == out) begin = std::min(begin.value_or(fmmu.begin_bit), fmmu.begin_bit);
                if (!begin) continue;
                for (const CyclicCmd& one : commands_) {
                    if (*begin < one.begin || *begin >= one.end) continue;
                    if (one.cmd == (out ? EniCmd::lrd : EniCmd::lwr)) continue;
                    const auto& offset = out ? one.outputs : one.inputs;
                    const auto here = static_cast<std::int64_t>(offset.value_or(0) + *begin - one.begin);
                    const BitStart seen{parts[0].node, here, parts[0].begin - here};
                    (offset ? placed_ : beside_[{one.node.offset_debug(), out}]).push_back(seen);
                    break;
                }
            }
    }

    // Compares the counters of the file with the counters that the library expects (ETG.1000.4, working counter).
    void check_counters(std::uint8_t number) {
        for (const CyclicCmd& one : commands_) {
            if (!one.counter) continue;
            unsigned sum = 0;
            for (const EniSlaveData& slave : slaves_) {
                bool reads = false;
                bool writes = false;
                for (const EniFmmu& fmmu : slave.status_fmmus)  // also of a slave without process data
                    reads |= (slave.group == number || slave.group < 0) && fmmu.begin_bit < one.end &&
                             one.begin < fmmu.end_bit && one.cmd != EniCmd::lwr;
                for (const auto& [index, fmmu] : slave.fmmus) {
                    if (slave.group != number || fmmu.begin_bit >= one.end || one.begin >= fmmu.end_bit) continue;
                    reads |= fmmu.reads && one.cmd != EniCmd::lwr;
                    writes |= fmmu.writes && one.cmd != EniCmd::lrd;
                }
                sum += (reads ? 1U : 0U) + (writes ? (one.cmd == EniCmd::lrw ? 2U : 1U) : 0U);
            }
            if (sum != *one.counter)
                r_.remark(one.node, "Cnt is " + std::to_string(*one.counter) + ", and the FMMUs of the slaves give " +
                                        std::to_string(sum) + ": the library expects what the FMMUs give");
        }
    }

    Reader& r_;
    std::deque<EniSlaveData>& slaves_;
    EniConfiguration& eni_;
    std::vector<CyclicCmd> commands_;
    struct BitStart {
        Node node{};
        std::int64_t place = 0;     // the place that follows from the cyclic command and the FMMU
        std::int64_t distance = 0;  // the distance of BitStart from `place`
    };
    using BitStarts = std::vector<BitStart>;
    BitStarts placed_{};  // by InputOffs or OutputOffs
    // For each command and direction without these offsets.
    std::map<std::pair<std::ptrdiff_t, bool>, BitStarts> beside_{};

    // The most frequent one of the allowed distances.
    static std::int64_t usual_distance(const BitStarts& all, std::initializer_list<std::int64_t> allowed) {
        std::map<std::int64_t, std::size_t> counts;
        for (const std::int64_t one : allowed) counts[one] = 0;
        for (const BitStart& one : all)
            if (allowed.size() == 0 || counts.contains(one.distance)) ++counts[one.distance];
        return std::ranges::max_element(counts, {}, [](const auto& count) { return count.second; })->first;
    }

    void name_others(const BitStarts& all, std::int64_t usual, const std::string& source) {
        for (const BitStart& one : all)
            if (one.distance != usual)
                r_.remark(one.node, "BitStart is " + std::to_string(one.place + one.distance) + ", and by " + source +
                                        " the data begins at " + std::to_string(one.place + usual) +
                                        ": the variables of the slave are found by BitStart");
    }

  public:
    // Variables are found by BitStart. Offsets of a file count from the data, or from its datagram, whose header has 80
    // bits. If commands have no offsets, the slaves of one command have the same distance.
    void check_bit_starts() {
        if (!placed_.empty()) name_others(placed_, usual_distance(placed_, {0, 80}), "the cyclic command and the FMMU");
        for (const auto& [command, all] : beside_)
            name_others(all, usual_distance(all, {}), "the FMMU and the BitStart of other slaves");
    }
    bool carries_time = false;
    bool by_position = false;
    std::uint8_t time_group = 0;
    std::optional<std::uint16_t> time_adp{};  // ADP of the first command for the time
    Node time_node{};
    std::uint64_t bytes = 0;
};

// The places of the slaves' data in one half of the image of the file.
class Places {
  public:
    Places(const std::deque<EniSlaveData>& slaves, Direction direction) {
        for (const EniSlaveData& s : slaves) {
            std::uint32_t before = 0;
            // No variable may be behind the exchanged data of the slave.
            std::uint64_t most = s.has_inits ? 0 : std::numeric_limits<std::uint32_t>::max();
            for (const ProcessSm& sm : s.config.used_sms())
                if (sm.direction == direction) most = up_to_octet(most) + sm.bits;
            for (const EniBits& part : direction == Direction::outputs ? s.outputs : s.inputs) {
                const std::uint64_t left = most - std::min<std::uint64_t>(most, before);
                const auto bits = static_cast<std::uint32_t>(std::min<std::uint64_t>(part.bits, left));
                places_.push_back({part.begin, bits, before, s.slave.number});
                before += part.bits;
            }
        }
        std::ranges::sort(places_, {}, &Place::begin);
    }
    void find(EniVariable& variable) const {
        const auto behind = std::ranges::upper_bound(places_, variable.file_bit, {}, &Place::begin);
        if (behind == places_.begin()) return;
        const Place& place = *std::prev(behind);
        if (std::uint64_t{variable.file_bit} + variable.bits > std::uint64_t{place.begin} + place.bits) return;
        variable.slave = place.slave;
        variable.bit = place.before + (variable.file_bit - place.begin);
    }

  private:
    struct Place {
        std::uint32_t begin = 0;
        std::uint32_t bits = 0;
        std::uint32_t before = 0;
        std::uint16_t slave = 0;
    };
    std::vector<Place> places_;
};

}  // namespace

void make_process_data(Reader& r, EniSlaveData& s) {
    if (!s.has_inits) return;
    const std::vector<Mapped> all = mapped_sms(r, s);
    check_order(r, all);
    if (r.failed()) return;
    s.config.source = ConfigurationSource::file;
    for (const Mapped& one : all) {
        const auto bits = static_cast<std::uint32_t>(one.end - one.begin);
        if ((bits + 7) / 8 != one.sm->bytes) {
            r.fail(one.sm->node, "SyncManager " + std::to_string(one.sm->number) + " has " +
                                     std::to_string(one.sm->bytes) + " octets, and its FMMU maps " +
                                     std::to_string(bits) + " bits");
            return;
        }
        if (one.sm->number >= Slave::kSyncManagers || one.sm->activate != 1)
            r.fail(one.sm->node, "SyncManager " + std::to_string(one.sm->number) +
                                     " is not supported: its number is above 7, or its activate octet is not 1");
        // The FMMU of a slave without bit operation maps whole octets. The PDOs contain the number of bits.
        const std::uint32_t listed = listed_bits(s, one.sm->number);
        const bool fits = listed != 0 && (listed + 7) / 8 == one.sm->bytes && bits % 8 == 0;
        if (!s.config.add({one.sm->number, one.direction, one.sm->control, one.sm->start, fits ? listed : bits}))
            r.fail(one.sm->node, "a slave has more than 8 SyncManagers of process data");
        s.slave.sync_managers.push_back({one.sm->number, one.sm->control, true, r.remark_at(one.sm->node, {})});
    }
    for (const auto& [number, sm] : s.sms)
        if (sm.bytes != 0 && sm.activate != 0 && std::ranges::find(all, &sm, &Mapped::sm) == all.end() && number > 1)
            r.remark(sm.node, "no FMMU maps SyncManager " + std::to_string(number) + ": it is not configured");
    drop_wrong_lists(r, s);
    s.config.fixed_pdos = true;  // the start-up commands of the file write the PDOs
}

namespace {

// The slave with the reference clock: the slave that the command for the time addresses, otherwise the slave with
// ReferenceClock. 0: there is none.
std::uint16_t reference_of(Reader& r, const CycleReader& cycles, const std::deque<EniSlaveData>& slaves) {
    const auto by_dc = std::ranges::find_if(slaves, &EniSlaveData::reference_clock);
    const std::uint16_t said = by_dc == slaves.end() ? std::uint16_t{0} : by_dc->slave.number;
    if (!cycles.time_adp) return said;
    const auto addressed = std::ranges::find_if(slaves, [&](const EniSlaveData& s) {
        if (!cycles.by_position) return s.slave.station_address == *cycles.time_adp;
        return s.slave.ring_position == static_cast<std::uint16_t>(-*cycles.time_adp);
    });
    const std::string begin = "the cyclic command for the time addresses ";
    if (addressed == slaves.end()) {
        r.remark(cycles.time_node, begin + "no slave of the file: the reference clock is " +
                                       (said == 0 ? "the first one" : "that of slave " + std::to_string(said)));
        return said;
    }
    if (said != 0 && said != addressed->slave.number)
        r.remark(cycles.time_node, begin + "slave " + std::to_string(addressed->slave.number) +
                                       ", and ReferenceClock is at slave " + std::to_string(said) +
                                       ": the command decides");
    return addressed->slave.number;
}

}  // namespace

void read_eni_cycles(Reader& r, Node config, std::deque<EniSlaveData>& slaves, EniConfiguration& into) {
    CycleReader cycles(r, slaves, into);
    for (const Node cyclic : config.children("Cyclic")) {
        if (into.groups.size() == 256) {
            r.fail(cyclic, "there are more than 256 Cyclic elements");
            return;
        }
        cycles.read(cyclic);
        if (r.failed()) return;
    }
    cycles.check_bit_starts();
    // For the mailbox status bits, perhaps in both halves.
    for (const EniSlaveData& s : slaves) cycles.bytes += s.config.mailbox_status ? 2 : 0;
    into.image_bytes = static_cast<std::uint32_t>(std::min<std::uint64_t>(cycles.bytes, 0xFFFF'FFFF));
    bool wanted = cycles.carries_time;
    for (const EniSlaveData& s : slaves) wanted |= s.uses_clock;
    if (!wanted) return;
    // A Cyclic element that only carries the time is no group.
    if (cycles.time_group >= into.groups.size()) cycles.time_group = 0;
    ClockSettings clocks{.group = cycles.time_group, .by_position = cycles.by_position};
    if (!into.groups.empty() && into.groups[clocks.group].cycle > Duration{0})
        clocks.cycle = into.groups[clocks.group].cycle;
    clocks.reference = reference_of(r, cycles, slaves);
    for (const EniSlaveData& s : slaves) {
        // If the file has no CycleTime, the cycle is the SYNC0 cycle of the slaves.
        const bool said = !into.groups.empty() && into.groups[clocks.group].cycle > Duration{0};
        if (!said && s.uses_clock && s.setup.dc.sync0_cycle > Duration{0}) clocks.cycle = s.setup.dc.sync0_cycle;
    }
    into.clocks = clocks;
}

void read_eni_variables(Reader& r, Node config, const std::deque<EniSlaveData>& slaves, EniConfiguration& into) {
    const Node image = config.child("ProcessImage");
    for (const auto& [name, direction] :
         {std::pair{"Inputs", Direction::inputs}, std::pair{"Outputs", Direction::outputs}}) {
        const Places places(slaves, direction);
        const std::size_t first = into.variables.size();
        std::vector<Node> nodes;
        for (const Node node : image.child(name).children("Variable")) {
            EniVariable variable{.name = Reader::text(child(node, "Name")),
                                 .comment = Reader::text(child(node, "Comment")),
                                 .data_type = Reader::text(child(node, "DataType")),
                                 .direction = direction};
            variable.bits = r.required<std::uint32_t>(node, "BitSize");
            variable.file_bit = r.required<std::uint32_t>(node, "BitOffs");
            places.find(variable);
            into.variables.push_back(std::move(variable));
            nodes.push_back(node);
        }
        name_odd_variables(r, std::span(into.variables).subspan(first), nodes);
    }
}

}  // namespace margay::files
