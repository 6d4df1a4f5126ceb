// The content of the messages. fields() lists the members of a type once, for writing and for reading.
#pragma once

#include "attach/message.hpp"

#include <margay/clocks.hpp>
#include <margay/eoe.hpp>
#include <margay/event.hpp>
#include <margay/group.hpp>
#include <margay/slave.hpp>
#include <margay/statistics.hpp>

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <vector>

namespace margay::attach {

// The arguments of all operations; an operation uses the arguments that it needs, and the others are 0.
struct Arguments {
    std::uint16_t slave = 0;    // number; of the operation `group`: the group
    std::uint16_t index = 0;    // object, IDN, ESC register
    std::uint8_t subindex = 0;  // subindex, or number of the drive
    std::uint8_t elements = 0;  // soe_element bits
    bool complete_access = false;
    bool urgent = false;
    AlState state = AlState::none;
    // SII word, first slave, offset in the image, password of a file, number of an event, level of messages
    std::uint32_t from = 0;
    std::uint32_t bytes = 0;  // how many to read
    std::string name{};       // of a file
    std::vector<std::byte> data{};
};
template <class A>
void fields(A& a, Arguments& v) {
    a(v.slave, v.index, v.subindex, v.elements, v.complete_access, v.urgent, v.state, v.from, v.bytes, v.name, v.data);
}

struct MasterFacts {
    std::uint16_t slaves = 0;  // in the table
    std::uint16_t groups = 0;
    std::uint16_t reference_clock = 0;
    LinkStatistics link{};
};
template <class A>
void fields(A& a, MasterFacts& v) {
    a(v.slaves, v.groups, v.reference_clock);
    auto& l = v.link;
    a(l.frames_sent, l.frames_received, l.datagrams_sent, l.bursts, l.bytes_on_wire, l.lost, l.retried, l.echoes,
      l.unmarked, l.foreign, l.malformed, l.unexpected, l.mismatched, l.send_refused);
}

struct PortFacts {
    PortType type = PortType::not_implemented;
    bool link = false;
    bool open = false;
    std::uint16_t neighbour = 0;  // number
};
struct PartFacts {
    std::uint32_t offset_bits = 0;
    std::uint32_t bits = 0;
};

// A slave. Its strings are arrays: poll() fills it without a heap.
struct SlaveFacts {
    std::uint16_t number = 0;
    std::uint16_t ring_position = 0;
    std::uint16_t station_address = 0;
    std::uint16_t alias = 0;
    std::uint16_t dl_status = 0;
    Identity identity{};
    Identity wanted{};  // the identity in the list of expect(); 0: any
    DlInformation dl{};
    AlStatus al{};
    AlState target = AlState::none;
    bool seen = false;
    bool takes_part = false;
    Error error{};
    std::uint16_t parent = 0;
    std::uint8_t parent_port = 0;
    std::uint8_t entry_port = 0;
    std::array<PortFacts, 4> ports{};
    MailboxInfo mailbox{};
    MailboxInfo boot_mailbox{};
    std::uint8_t coe_details = 0;
    std::int16_t ebus_current_ma = 0;
    std::uint8_t sm_count = 0;
    std::array<SmInfo, Slave::kSyncManagers> sync_managers{};
    std::uint16_t group = SlaveImage::kNoGroup;
    PartFacts outputs{};
    PartFacts inputs{};
    ClockKind clock = ClockKind::unknown;
    std::uint32_t delay_ns = 0;
    std::int32_t difference_ns = 0;
    bool in_sync = false;
    bool may_be_missing = false;
    std::array<char, Slave::kNameBytes> name_text{};
    std::uint8_t name_bytes = 0;
    [[nodiscard]] std::string name() const {
        return {name_text.data(), std::min<std::size_t>(name_bytes, name_text.size())};
    }
};

struct GroupFacts {
    bool mapped = false;
    std::uint32_t mappings = 0;
    std::uint32_t base = 0;  // logical address of the first octet
    std::uint32_t output_bytes = 0;
    std::uint32_t input_bytes = 0;
    std::uint32_t wkc = 0;
    std::uint32_t expected_wkc = 0;
    std::uint32_t cycle = 0;  // the last cycle that was received
    std::uint16_t frames = 0;
    // One answer contains at most this many octets of the image. A larger image is read in parts, which come from
    // different cycles.
    static constexpr std::size_t kOnce = 32768;
};

struct StartupFacts {
    bool object = false;  // true: an object; false: a parameter of a drive
    bool complete_access = false;
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    std::vector<std::byte> data{};
};
template <class A>
void fields(A& a, StartupFacts& v) {
    a(v.object, v.complete_access, v.index, v.subindex, v.data);
}

// An event and its sentence, so that a client need not know the kinds of events.
struct EventFacts {
    std::uint64_t number = 0;  // the first is 1
    std::int64_t at_ns = 0;    // in the time of the osal of the application
    EventKind kind = EventKind::state;
    std::uint16_t slave = 0;
    std::string text{};
};
template <class A>
void fields(A& a, EventFacts& v) {
    a(v.number, v.at_ns, v.kind, v.slave, v.text);
}

// The result of a rescan.
struct RescanFacts {
    // True: all slaves were scanned again; false: the ring was compared with the known slaves.
    bool whole = false;
    std::uint16_t slaves = 0;   // that answer
    std::uint16_t missing = 0;  // expected slaves that do not answer
    std::uint16_t unused = 0;   // slaves that answer and are not in the table
};
template <class A>
void fields(A& a, RescanFacts& v) {
    a(v.whole, v.slaves, v.missing, v.unused);
}

// A busy EoePort.
struct EoePortFacts {
    std::uint16_t slave = 0;  // number
    bool open = false;        // the mailbox of the slave can exchange frames now
    EoeStatistics counted{};
    std::array<char, EoePort::kNameBytes> name_text{};
    std::uint8_t name_bytes = 0;
    [[nodiscard]] std::string name() const {
        return {name_text.data(), std::min<std::size_t>(name_bytes, name_text.size())};
    }
    static constexpr std::size_t kOctets = 2 + 1 + 10 * 4 + EoePort::kNameBytes + 1;  // in a message
    static constexpr std::size_t kOnce = 512;                                         // ports in an answer
};

struct ObjectFacts {
    std::string name{};
    std::uint8_t code = 0;
    std::uint8_t max_subindex = 0;
    std::uint16_t data_type = 0;
};
template <class A>
void fields(A& a, ObjectFacts& v) {
    a(v.name, v.code, v.max_subindex, v.data_type);
}

struct EntryFacts {
    std::uint8_t subindex = 0;
    std::uint16_t access = 0;
    std::uint16_t data_type = 0;
    std::uint16_t bits = 0;
    std::string name{};
};
template <class A>
void fields(A& a, EntryFacts& v) {
    a(v.subindex, v.access, v.data_type, v.bits, v.name);
}

template <class A>
void fields(A& a, SlaveFacts& v) {
    a(v.number, v.ring_position, v.station_address, v.alias, v.dl_status, v.identity, v.wanted, v.dl, v.al, v.target,
      v.seen, v.takes_part, v.error, v.parent, v.parent_port, v.entry_port, v.ports, v.mailbox, v.boot_mailbox,
      v.coe_details, v.ebus_current_ma, v.sm_count, v.sync_managers, v.group, v.outputs, v.inputs, v.clock, v.delay_ns,
      v.difference_ns, v.in_sync, v.may_be_missing, v.name_text, v.name_bytes);
}
template <class A>
void fields(A& a, GroupFacts& v) {
    a(v.mapped, v.mappings, v.base, v.output_bytes, v.input_bytes, v.wkc, v.expected_wkc, v.cycle, v.frames);
}
template <class A>
void fields(A& a, PortFacts& v) {
    a(v.type, v.link, v.open, v.neighbour);
}
template <class A>
void fields(A& a, EoePortFacts& v) {
    a(v.slave, v.open, v.counted, v.name_text, v.name_bytes);
}
template <class A>
void fields(A& a, PartFacts& v) {
    a(v.offset_bits, v.bits);
}

// An optional parameter: whether it has a value, then its octets.
template <class A, class T>
void optional_field(A& a, std::optional<T>& v) {
    bool there = v.has_value();
    T value = v.value_or(T{});
    a(there, value);
    v = there ? std::optional<T>(value) : std::nullopt;
}

}  // namespace margay::attach

// The types of the public API: fields() is found in the namespace of its second argument.
namespace margay {

template <class A>
void fields(A& a, Identity& v) {
    a(v.vendor, v.product, v.revision, v.serial);
}
template <class A>
void fields(A& a, DlInformation& v) {
    a(v.type, v.revision, v.build, v.fmmus, v.sync_managers, v.ram_kib, v.features, v.dc, v.dc_64bit);
}
template <class A>
void fields(A& a, AlStatus& v) {
    a(v.state, v.error, v.code);
}
template <class A>
void fields(A& a, Error& v) {
    a(v.code, v.step, v.slave, v.index, v.subindex, v.place, v.detail, v.expected, v.actual);
}
template <class A>
void fields(A& a, MailboxInfo& v) {
    a(v.out_start, v.out_bytes, v.in_start, v.in_bytes, v.protocols);
}
template <class A>
void fields(A& a, SmInfo& v) {
    a(v.start, v.length_bytes, v.control, v.enable, v.type);
}
template <class A>
void fields(A& a, EoeStatistics& v) {
    a(v.sent, v.sent_octets, v.refused, v.not_sent, v.received, v.received_octets, v.overrun, v.incomplete, v.malformed,
      v.too_long);
}
template <class A>
void fields(A& a, EoeIp& v) {
    attach::optional_field(a, v.mac);
    attach::optional_field(a, v.address);
    attach::optional_field(a, v.subnet_mask);
    attach::optional_field(a, v.default_gateway);
    attach::optional_field(a, v.dns_server);
    a(v.append_time_stamp, v.has_host_name, v.host_name_octets);
}

}  // namespace margay
