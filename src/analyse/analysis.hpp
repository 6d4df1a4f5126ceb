// The facts that a recording of EtherCAT traffic shows: plain data, filled in by Analyser. Slaves are identified by
// their place in Analysis::slaves. Lists have a limit; `left_out` counts the elements that did not fit.
#pragma once

#include "wire/datagram.hpp"
#include "wire/mailbox.hpp"

#include <margay/al_state.hpp>
#include <margay/time.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace margay::analyse {

// A place in the recording.
struct Moment {
    std::uint64_t frame = 0;  // number of the packet, from 1, as in Wireshark
    Duration at{};            // since the first packet of the file; negative: the packet is earlier
    // Compares the times; at equal times, the order of the file. Sorted packets are not in the order of the file.
    [[nodiscard]] bool is_before(const Moment& other) const {
        return at != other.at ? at < other.at : frame < other.frame;
    }
};

// A list that stops growing at a limit.
template <class T>
struct Bounded {
    std::vector<T> items{};
    std::uint64_t left_out = 0;
    void add(T item, std::size_t most) {
        if (items.size() < most)
            items.push_back(std::move(item));
        else
            ++left_out;
    }
};

// How requests and replies are distinguished in the recording.
enum class Directions : std::uint8_t {
    none,    // there is no EtherCAT frame
    marked,  // the first slave has set bit 1 of the source address of the replies
    // The address of the master has this bit already; the second frame with the same datagrams is the reply.
    same_address,
    replies_only,   // every frame has passed a slave
    requests_only,  // no frame has passed a slave
};

struct FrameCounts {
    std::uint64_t packets = 0;      // of the file, of all masters
    std::uint64_t ethercat = 0;     // frames with EtherCAT datagrams
    std::uint64_t vlan = 0;         // of them in VLAN tags
    std::uint64_t udp = 0;          // of them in UDP
    std::uint64_t other_types = 0;  // EtherCAT frames of another type than datagrams, for example of a mailbox gateway
    std::uint64_t cut = 0;          // EtherCAT frames that the recorder has cut; they are not read
    std::uint64_t dropped = 0;      // packets that the recorder has dropped, as the file says; of all masters
    std::uint64_t damaged = 0;      // EtherCAT frames whose lengths contradict each other
    std::uint64_t requests = 0;
    std::uint64_t replies = 0;
    std::uint64_t answered = 0;  // replies with a working counter that is not 0, so a slave has processed them
    std::uint64_t lost = 0;      // requests without a reply; 0 if Analysis::losses_known is false
    // Requests whose reply may come after the end of the recording; 0 if Analysis::losses_known is false.
    std::uint64_t open = 0;
    // Replies after the next request with the same process data; CyclicFrames with `overlapping` are not counted.
    std::uint64_t late = 0;
    std::uint64_t unasked = 0;  // replies without a request
    Duration shortest_trip{};   // the time between request and reply; all 0: not known
    Duration longest_trip{};
    Moment longest_trip_at{};
};

struct PdoEntry {
    std::uint16_t index = 0;  // index of the object; 0: a gap
    std::uint8_t subindex = 0;
    std::uint16_t bits = 0;
    std::string name{};
};
struct Pdo {
    std::uint16_t index = 0;
    int sync_manager = -1;  // -1: not assigned, or not seen
    bool input = false;     // TxPDO
    std::string name{};
    std::vector<PdoEntry> entries{};
};

struct Deviation {  // the difference of a clock to the reference clock: register 0x092C
    std::uint64_t count = 0;
    std::int64_t first_ns = 0;
    std::int64_t last_ns = 0;
    std::int64_t least_ns = 0;
    std::int64_t most_ns = 0;
    Moment largest_at{};  // the place of the value that is farthest from 0
};
struct Clock {
    std::optional<std::int64_t> offset_ns{};        // 0x0920
    std::optional<std::uint32_t> delay_ns{};        // 0x0928
    std::optional<std::uint8_t> activation{};       // 0x0981
    std::optional<std::uint64_t> start_ns{};        // 0x0990
    std::optional<std::uint32_t> sync0_cycle_ns{};  // 0x09A0
    std::optional<std::uint32_t> sync1_cycle_ns{};  // 0x09A4
    Deviation deviation{};
    [[nodiscard]] bool seen() const {
        return offset_ns || delay_ns || activation || start_ns || sync0_cycle_ns || sync1_cycle_ns ||
               deviation.count != 0;
    }
};
// The clock that FRMW or ARMW distributes.
struct ReferenceClock {
    std::optional<std::size_t> slave{};
    std::uint64_t readings = 0;
    std::uint64_t first_ns = 0, last_ns = 0;  // system times
    Moment first{}, last{};
    std::optional<double> drift_ppm{};  // of the system time against the clock of the recorder
    double drift_within_ppm = 0;        // uncertainty: the longest round trip in the time between first and last
};

struct MailCounts {
    std::uint64_t sent = 0;      // messages to the slave
    std::uint64_t received = 0;  // messages from the slave
    std::uint64_t sent_bytes = 0;
    std::uint64_t received_bytes = 0;
    std::uint64_t errors = 0;  // AoE: responses with an error
};

struct Slave {
    std::optional<std::uint16_t> position{};  // in the ring, from 0
    std::optional<std::uint16_t> station{};   // the last one
    std::optional<std::uint16_t> alias{};
    std::optional<std::uint32_t> vendor{}, product{}, revision{}, serial{};
    std::string name{};
    std::string order{};
    std::size_t sii_octets = 0;  // octets of the SII that the recording shows
    std::vector<Pdo> pdos{};
    bool pdos_by_coe = false;         // false: the PDOs are from the SII
    std::optional<AlStatus> state{};  // the last one
    std::uint64_t unanswered = 0;     // datagrams to its address with working counter 0; looks for mail are not counted
    Moment first_unanswered{};
    std::map<wire::MailboxType, MailCounts> mail{};
    Clock clock{};
};

struct StateEvent {
    Moment when{};
    std::optional<std::size_t> slave{};  // nothing: all slaves
    bool requested = false;              // true: AL control; false: AL status
    AlStatus status{};
    bool acknowledge = false;  // of a request: bit 4
};

enum class Action : std::uint8_t {
    sdo_upload,
    sdo_download,
    object_list,
    object_description,
    entry_description,
    foe_read,
    foe_write,
    soe_read,
    soe_write,
};
enum class Outcome : std::uint8_t {
    done,
    refused,     // `code` and `reason`
    unanswered,  // the next conversation has begun before an answer came
    unfinished,  // the recording has ended before the answer
};
struct Conversation {
    Moment begin{}, end{};
    std::size_t slave = 0;
    Action action{};
    std::uint16_t index = 0;    // of the object; the IDN
    bool index_known = true;    // false: the recording does not show the IDN
    std::uint8_t subindex = 0;  // the drive
    std::uint8_t elements = 0;  // of SoE: bits of soe_element
    bool complete = false;      // complete access
    bool late = false;          // the answer came after the next request
    std::string name{};         // of the file, object or entry
    std::uint64_t bytes = 0;
    std::vector<std::byte> data{};  // the first kKept octets
    Outcome outcome = Outcome::unfinished;
    std::uint32_t code = 0;
    std::string reason{};
    static constexpr std::size_t kKept = 64;
};

struct Emergency {
    Moment when{};
    std::size_t slave = 0;
    std::uint16_t code = 0;
    std::uint8_t error_register = 0;
    std::array<std::byte, 5> data{};
};

struct Intervals {
    std::uint64_t count = 0;
    Duration least{}, most{};
    Moment most_at{};
    double mean_ns = 0, deviation_ns = 0;   // standard deviation
    Duration median{}, low_1{}, high_99{};  // within 1 per cent
    // Intervals of more than one and a half medians (counted from 1 per cent above this length on).
    std::uint64_t late = 0;
    std::uint64_t pauses = 0;  // intervals of more than a second, which the other members do not include
};

// Replies whose working counter was below the largest working counter that this datagram had before.
struct Shortfall {
    Moment begin{};
    std::optional<Moment> end{};  // the first frame that is complete again; nothing: until the end
    std::size_t cyclic_frame = 0, datagram = 0;
    std::uint16_t expected = 0;
    std::uint16_t least = 0;
    std::uint64_t frames = 0;
};
struct CyclicDatagram {
    wire::Command command{};
    std::uint32_t address = 0;
    std::uint16_t length = 0;
    std::uint16_t most_wkc = 0;
    std::map<std::uint16_t, std::uint64_t> wkcs{};  // number of replies with this working counter
};
// Frames with the same datagrams of process data.
struct CyclicFrame {
    std::vector<CyclicDatagram> datagrams{};
    Moment first{}, last{};
    std::uint64_t count = 0;
    std::uint64_t lost = 0;
    std::uint64_t late = 0;  // 0 if `overlapping`
    // Most replies came after the next request, because several frames are on the wire at the same time.
    bool overlapping = false;
    Intervals intervals{};
};

struct RingSize {
    Moment when{};
    std::uint16_t slaves = 0;
};

// The master that has sent the requests. `name` is only set if the recording proves it.
struct MasterGuess {
    std::string name{};                    // empty: unknown
    std::vector<std::string> reasons{};    // the observations that prove it
    std::vector<std::string> addresses{};  // source addresses of the requests
};

struct Analysis {
    // Not empty: the file cannot be read completely, and the other members describe the part before the fault.
    std::string problem{};
    std::string remark{};  // for example about a file that is cut off
    Duration duration{};   // from the first to the last EtherCAT frame
    Duration begin{};      // of the first EtherCAT frame, since the first packet
    Directions directions = Directions::none;
    bool losses_known = true;  // false: the recording has only requests, only replies, or a part of a ring
    // The recording is of a tap between slaves: cycles and working counters are not reported.
    bool passes_twice = false;
    // The recording is of both NICs of a ring: the copies of a frame are counted as one frame.
    bool ring = false;
    // The interface of the file, if two masters of the file have the same address.
    std::optional<std::uint32_t> interface {};
    FrameCounts frames{};
    MasterGuess master{};
    std::vector<Slave> slaves{};
    std::uint64_t slaves_left_out = 0;
    Bounded<RingSize> ring_sizes{};
    Bounded<StateEvent> states{};
    Bounded<Conversation> conversations{};
    Bounded<Emergency> emergencies{};
    std::vector<CyclicFrame> cyclic{};
    std::uint64_t cyclic_left_out = 0;
    Bounded<Shortfall> shortfalls{};
    ReferenceClock reference{};
    Deviation worst_deviation{};     // broadcast reads of 0x092C: the values of all slaves, combined by OR
    std::vector<Analysis> others{};  // the analyses of the other masters of the file
};

// Limits of the lists.
inline constexpr std::size_t kMostSlaves = 1024;
inline constexpr std::size_t kMostConversations = 100'000;
inline constexpr std::size_t kMostEvents = 10'000;  // each of states, emergencies, shortfalls, sizes of the ring
inline constexpr std::size_t kMostCyclicFrames = 64;

}  // namespace margay::analyse
