// Remarks about contents of an ENI file that the library applies in its own way, or not at all.
#include <margay/margay.hpp>

#include "files/eni_read.hpp"
#include "wire/esc.hpp"
#include "wire/sync_manager.hpp"

#include <algorithm>

namespace margay::files {
namespace {

namespace reg = wire::reg;

// The octet that an init command writes to an address; nothing if it writes none there.
std::optional<std::uint8_t> written_at(const EniInit& init, unsigned address) {
    const bool changes =
        init.writes() || init.cmd == EniCmd::aprw || init.cmd == EniCmd::fprw || init.cmd == EniCmd::brw;
    if (!changes || init.transitions == Transition::none) return std::nullopt;
    if (address < init.ado || address - init.ado >= init.data.size()) return std::nullopt;
    return std::to_integer<std::uint8_t>(init.data[address - init.ado]);
}

// ------------------------------------------------------------------ registers of the clocks

using Asks = bool (*)(const EniInit&);

bool other_at(const EniInit& init, unsigned address, std::uint8_t usual) {
    return written_at(init, address).value_or(usual) != usual;
}
bool asks_latches(const EniInit& init) {
    return other_at(init, reg::kLatch0Control.address, 0) || other_at(init, reg::kLatch0Control.address + 1, 0);
}
// The library writes 0x1000.
bool asks_speed(const EniInit& init) {
    return other_at(init, reg::kSpeedCounterStart.address, 0x00) ||
           other_at(init, reg::kSpeedCounterStart.address + 1, 0x10);
}
// The depths after power-up. Many tools write 0 and 12.
bool asks_filters(const EniInit& init) {
    return other_at(init, reg::kSystemTimeDifferenceFilter.address, 4) ||
           other_at(init, reg::kSpeedCounterFilter.address, 12);
}

void name_first(Reader& r, const std::vector<EniInit>& inits, Asks asks, const char* text) {
    const auto first = std::ranges::find_if(inits, asks);
    if (first != inits.end()) r.remark(first->node, text);
}

void name_clock_registers(Reader& r, const std::vector<EniInit>& inits, bool clocks) {
    name_first(r, inits, asks_latches,
               "the init command for the latch control (0x09a8) is not sent: an application watches latch inputs by a "
               "LatchRequest");
    if (!clocks) return;  // the registers have no effect
    name_first(r, inits, asks_speed,
               "the init command for the speed counter (0x0930) is not sent: the library starts the control loops of "
               "the clocks with 0x1000");
    name_first(r, inits, asks_filters,
               "the init command for the filters of the clocks (0x0934) is not sent: the slaves keep the filter depths "
               "that they have, after power-up usually 4 and 12");
}

// If the start time in the file is only the shift, the start time that the library calculates has the same effect.
void name_start_times(Reader& r, const std::vector<EniInit>& inits, Duration shift) {
    const unsigned address = reg::kSyncStartTime.address;
    const auto asks = [&](const EniInit& init) {
        std::uint64_t value = 0;
        for (unsigned octet = 0; octet < 8; ++octet)
            value |= std::uint64_t{written_at(init, address + octet).value_or(0)} << (8 * octet);
        return value != 0 && value != static_cast<std::uint64_t>(shift.count());
    };
    const auto first = std::ranges::find_if(inits, asks);
    if (first != inits.end())
        r.remark(
            first->node,
            "the init command for the start time of SYNC0 (0x0990) is not sent: the library calculates it, from the "
            "system time and the ShiftTime of DC");
}

// If the octet is a part of DL control (0x0100), it is sent.
bool asks_alias(const EniInit& init) {
    return init.ado == reg::kAliasEnable.address && other_at(init, reg::kAliasEnable.address, 0);
}
void name_alias(Reader& r, const std::vector<EniInit>& inits) {
    name_first(r, inits, asks_alias,
               "the init command that switches the second address on (0x0103) is not sent: the library addresses all "
               "slaves by their station addresses");
}

// ------------------------------------------------------------------ mailboxes

struct Area {
    std::uint16_t start = 0;
    std::uint16_t bytes = 0;
    friend bool operator==(const Area&, const Area&) = default;
};
std::string words(Area range) { return hex(range.start) + ", " + std::to_string(range.bytes) + " octets"; }
std::string words(Area out, Area in) { return words(out) + ", and " + words(in); }

Area area_of(Reader& r, Node node) {
    return {r.number<std::uint16_t>(child(node, "Start")), r.number<std::uint16_t>(child(node, "Length"))};
}

// The mailboxes of a slave, also for BOOT. Tools also write the init commands for BOOT without an element.
class MailboxReader {
  public:
    MailboxReader(Reader& r, EniSlaveData& s, bool boot)
        : r_(r), s_(s), boot_(boot), mailbox_(boot ? bootstrap(s) : s.node.child("Mailbox")) {
        place_ = mailbox_;
        const Node recv = mailbox_.child("Recv");
        boxes_[0] = area_of(r, mailbox_.child("Send"));
        boxes_[1] = area_of(r, recv ? recv : mailbox_.child("Receive"));
    }

    void read() {
        const auto described = boxes_;
        for (const EniInit& init : s_.inits) see(init);
        if ((!mailbox_ && !boot_) || boxes_[0].bytes == 0 || boxes_[1].bytes == 0) return;
        for (std::size_t n = 0; n < 2; ++n)
            if (described[n].bytes != 0 && described[n] != boxes_[n])
                name(place_, "the init commands set SyncManager " + std::to_string(n) + " to " + words(boxes_[n]) +
                                 ", and " + element() + " gives it " + words(described[n]) +
                                 ": neither is used, but what the SII of the slave gives it");
        (boot_ ? s_.slave.boot_mailbox : s_.slave.mailbox) = {boxes_[0].start, boxes_[0].bytes, boxes_[1].start,
                                                              boxes_[1].bytes};
        (boot_ ? s_.slave.boot_mailbox_place : s_.slave.mailbox_place) = r_.remark_at(place_, {});
    }

  private:
    static constexpr unsigned kEnd = reg::kSyncManagerBase + 2 * reg::kSyncManagerStride;

    static Node bootstrap(const EniSlaveData& s) {
        const Node mailbox = s.node.child("Mailbox");
        const Node node = mailbox.child("BootStrap");
        return node ? node : mailbox.child("Bootstrap");
    }
    [[nodiscard]] std::string element() const { return boot_ ? "BootStrap" : "Mailbox"; }
    [[nodiscard]] std::string at_step() const { return boot_ ? "at IB" : "at IP"; }

    // One remark for each slave.
    void name(Node at, std::string text) {
        if (!named_) r_.remark(at, std::move(text));
        named_ = true;
    }

    void see(const EniInit& init) {
        const bool here = init.ado < kEnd && init.ado + init.data.size() > reg::kSyncManagerBase;
        const auto step = boot_ ? Transition::init_to_boot : Transition::init_to_preop;
        if (!here || !init.writes() || !contains(init.transitions, step) || init.is_zero()) return;
        // A SyncManager that is also set at PS belongs to process data.
        if (contains(init.transitions, Transition::preop_to_safeop)) return;
        const std::size_t stride = reg::kSyncManagerStride;
        if (init.ado % stride != 0 || init.data.size() % stride != 0)
            return name(init.node, "an init command " + at_step() +
                                       " writes a part of a SyncManager of the mailbox: it is not sent");
        for (std::size_t at = 0; at < init.data.size() && init.ado + at < kEnd; at += stride)
            if (init.ado + at >= reg::kSyncManagerBase) see(init, at, (init.ado + at - reg::kSyncManagerBase) / stride);
    }

    void see(const EniInit& init, std::size_t at, std::size_t number) {
        const Area range{static_cast<std::uint16_t>(init.value(at, 2)),
                         static_cast<std::uint16_t>(init.value(at + 2, 2))};
        if (range.bytes == 0) return;
        const std::string sm = "SyncManager " + std::to_string(number);
        if (!mailbox_ && !boot_)
            return name(init.node,
                        sm + " is set " + at_step() + ", and the slave has no Mailbox: the init command is not sent");
        constexpr std::uint64_t kModeAndDirection = 0x0F;
        const std::uint64_t usual = wire::sm_control::kModeMailbox | (number == 0 ? wire::sm_control::kEcatWrites : 0);
        const std::uint64_t control = init.value(at + 4, 1);
        if ((control & kModeAndDirection) != usual || (init.value(at + 6, 1) & wire::sm_activate::kEnable) == 0)
            return name(init.node, "an init command " + at_step() + " sets " + sm +
                                       " to something else than an enabled mailbox of its direction: it is not sent");
        boxes_[number] = range;
        if (number == 0 || place_ == mailbox_) place_ = init.node;
        if (!boot_)
            s_.slave.sync_managers.push_back({static_cast<std::uint8_t>(number), static_cast<std::uint8_t>(control),
                                              false, r_.remark_at(init.node, {})});
    }

    Reader& r_;
    EniSlaveData& s_;
    bool boot_;
    Node mailbox_;
    Node place_;
    std::array<Area, 2> boxes_{};
    bool named_ = false;
};

// Tools write 20 ms if the user has not chosen a time.
void name_poll_times(Reader& r, const std::deque<EniSlaveData>& slaves) {
    Node first{};
    unsigned count = 0;
    for (const EniSlaveData& s : slaves) {
        const Node mailbox = s.node.child("Mailbox");
        const Node recv = mailbox.child("Recv");
        const Value time = child(recv ? recv : mailbox.child("Receive"), "PollTime");
        constexpr std::uint32_t kUsual_ms = 20;
        if (!time.there || s.config.mailbox_status || r.number<std::uint32_t>(time) == kUsual_ms) continue;
        if (count++ == 0) first = time.at;
    }
    if (count != 0)
        r.remark(first, "PollTime is not used (" + std::to_string(count) +
                            (count == 1 ? " slave has" : " slaves have") +
                            " another one than 20 ms): watch_mailboxes() gives all slaves one interval, and without it "
                            "the library reads a mailbox only for a request");
}

// ------------------------------------------------------------------ after the scan

Remark at(Remark place, std::string text) {
    place.text = std::move(text);
    return place;
}

void compare_mailboxes(const EniSlave& one, const Slave& slave, bool boot, std::vector<Remark>& into) {
    const MailboxInfo& given = boot ? one.boot_mailbox : one.mailbox;
    const MailboxInfo& own = boot ? slave.boot_mailbox : slave.mailbox;
    if (!given.present()) return;
    const Area out{given.out_start, given.out_bytes};
    const Area in{given.in_start, given.in_bytes};
    const Area own_out{own.out_start, own.out_bytes};
    const Area own_in{own.in_start, own.in_bytes};
    if (out == own_out && in == own_in) return;
    into.push_back(at(boot ? one.boot_mailbox_place : one.mailbox_place,
                      std::string(boot ? "the mailboxes of BOOT" : "the mailboxes") + " that the file gives slave " +
                          std::to_string(one.number) + " (" + words(out, in) + ") are not used: its SII gives " +
                          (own.present() ? words(own_out, own_in) : "none")));
}

std::string control_words(unsigned differ, unsigned control) {
    std::string text;
    const auto add = [&](unsigned bits, const char* yes, const char* no) {
        if ((differ & bits) == 0) return;
        text += (text.empty() ? "" : ", ") + std::string((control & bits) != 0 ? yes : no);
    };
    if ((differ & (wire::sm_control::kModeMask | wire::sm_control::kDirectionMask)) != 0)
        text = "another mode or direction";
    add(wire::sm_control::kPdiInterrupt, "with an interrupt to the slave's processor",
        "without an interrupt to the slave's processor");
    add(wire::sm_control::kWatchdogTrigger, "with a trigger of the watchdog", "without a trigger of the watchdog");
    return text;
}

// The interrupt to the master (bit 4) is left out: neither the library nor a slave uses it.
void compare_controls(const EniSlave& one, const Slave& slave, std::vector<Remark>& into) {
    constexpr unsigned kCompared = wire::sm_control::kModeMask | wire::sm_control::kDirectionMask |
                                   wire::sm_control::kPdiInterrupt | wire::sm_control::kWatchdogTrigger;
    for (const EniSyncManager& sm : one.sync_managers) {
        if (sm.number >= Slave::kSyncManagers) continue;
        const SmInfo& own = slave.sync_managers[sm.number];
        const unsigned differ = (sm.control ^ own.control) & kCompared;
        if (own.type == SmType::unused || differ == 0) continue;
        into.push_back(at(sm.place, "the file gives SyncManager " + std::to_string(sm.number) + " of slave " +
                                        std::to_string(one.number) + " the control octet " + hex(sm.control, 2) + " (" +
                                        control_words(differ, sm.control) + "), and its SII " + hex(own.control, 2) +
                                        ": that of the " + (sm.is_used ? "file" : "SII") + " is used"));
    }
}

std::string port_words(std::uint16_t slave, unsigned port) {
    if (slave == 0) return "the master";
    return std::string("port ") + "ABCD"[port & 3] + " of slave " + std::to_string(slave);
}

// If several ports are listed, each of them is allowed.
void compare_ports(const EniConfiguration& eni, const EniSlave& one, const Slave& slave, std::vector<Remark>& into) {
    if (one.previous_ports.empty() || slave.ring_position == 0) return;
    std::string named;
    for (const EniPort& port : one.previous_ports) {
        const auto before = std::ranges::find(eni.slaves, port.station_address, &EniSlave::station_address);
        // The address belongs to no slave of the file.
        if (before == eni.slaves.end() || port.station_address == 0) return;
        if (before->number == slave.parent && port.port == slave.parent_port) return;
        if (named.empty()) named = port_words(before->number, port.port);
    }
    into.push_back(at(one.ports_place, "slave " + std::to_string(one.number) + " is at " + named +
                                           " in the file, and here at " + port_words(slave.parent, slave.parent_port) +
                                           ": the library requires the order of the slaves only"));
}

void read_previous_ports(Reader& r, EniSlaveData& s) {
    for (const Node node : s.node.children("PreviousPort")) {
        const std::string_view name = child(node, "Port").text;
        if (name.size() != 1 || name[0] < 'A' || name[0] > 'D') continue;
        if (s.slave.previous_ports.empty()) s.slave.ports_place = r.remark_at(node, {});
        s.slave.previous_ports.push_back(
            {static_cast<std::uint8_t>(name[0] - 'A'), r.number<std::uint16_t>(child(node, "PhysAddr"))});
    }
}

}  // namespace

void name_unused(Reader& r, const std::vector<EniInit>& master, std::deque<EniSlaveData>& slaves, bool clocks) {
    name_clock_registers(r, master, clocks);
    name_alias(r, master);
    for (EniSlaveData& s : slaves) {
        name_clock_registers(r, s.inits, clocks);
        if (clocks) name_start_times(r, s.inits, s.setup.dc.shift);
        name_alias(r, s.inits);
        for (const bool boot : {false, true}) MailboxReader(r, s, boot).read();
        read_previous_ports(r, s);
    }
    name_poll_times(r, slaves);
    name_nonsense(r, slaves);
}

std::vector<Remark> remarks_after_scan(Context& ctx, const EniConfiguration& eni) {
    std::vector<Remark> all;
    for (const EniSlave& one : eni.slaves) {
        if (one.number == 0 || one.number > ctx.slaves().size()) continue;
        const Slave& slave = ctx.slave(one.number);
        if (slave.sii_read) {
            for (const bool boot : {false, true}) compare_mailboxes(one, slave, boot, all);
            compare_controls(one, slave, all);
        }
        compare_ports(eni, one, slave, all);
    }
    return all;
}

}  // namespace margay::files
