// A ring with two NICs, which the link sees as one NIC. Each frame is sent by both NICs; the replies are collected from
// both, merged datagram by datagram, and handed to the link once. Only init_redundant() names this class, so programs
// with one NIC do not link it.
//
// A copy is a frame as one of the NICs has sent it; the source address tells which one. A copy that comes back at its
// own NIC has passed the slaves at its end of a broken ring. A copy that comes back at the other NIC ("crossed") has
// passed the whole ring. In a whole ring mostly one copy is processed by all slaves, and the other copy passes them
// without being processed ("idle").
#pragma once

#include "link/link.hpp"

#include <margay/redundancy.hpp>

#include <array>
#include <atomic>
#include <span>
#include <utility>

namespace margay {

// A datagram that carries the time of a reference clock (FRMW or ARMW of the system time). Both copies of its frame
// must not bring the time of the same reference: behind a break, no slave would answer, and all clocks would take what
// the master has sent. The copy that is not sent by the head carries no time (NOP), or the time of the second
// reference.
struct TimeDatagram {
    std::uint16_t offset = 0;  // in the frame; 0: none
    std::uint16_t bytes = 0;   // of the data
    // Command, index and ADP in three forms: as the link has sent them, in the copy of the head, and in the other copy.
    enum Form : std::uint8_t { original, of_head, of_other, kForms };
    std::array<std::array<std::byte, 4>, kForms> forms{};
};

// How far the second reference is ahead of the first one, measured with frames of which both copies have come back. The
// value contains a constant that depends on the ways of the frames.
struct PartDifference {
    std::int64_t sum_ns = 0;
    std::uint32_t count = 0;
    std::int32_t least_ns = 0;
    std::int32_t most_ns = 0;
};

// A frame in flight on both cables.
struct FramePair {
    enum State : std::uint8_t {
        unused,
        open,  // copies are awaited
        held,  // one thread uses the pair: the receiving thread, or the thread that opens it
    };
    std::atomic<std::uint8_t> state{unused};
    // `sent` to `counted`: one bit for each NIC, for the copy that this NIC has sent. `sent` also has the number of
    // probes that the NIC has sent behind the copy, see Redundancy::probes_bit().
    std::atomic<std::uint8_t> sent{0};
    std::uint8_t came = 0;
    std::uint8_t crossed = 0;
    std::uint8_t idle = 0;
    std::uint8_t circulated = 0;  // the copy has passed a slave whose port 0 is closed: the first slave behind a break
    std::uint8_t counted = 0;     // `count` of the copy is known
    std::uint8_t index = 0;
    std::uint8_t head = 0;             // the NIC at the beginning of the ring, as known when the frame was sent
    bool times_held : 1 = false;       // the frame only reads the reference, and brings no clock a time
    bool second_is_first : 1 = false;  // all slaves with a clock are behind the break: the other copy has the only time
    std::uint8_t front = 0;            // the NIC whose copy has the positions as sent
    bool positions = false;            // some datagram is addressed by position
    std::uint16_t shift = 0;           // added to the positions of the other copy
    std::uint16_t size = 0;            // octets of the frame
    std::array<std::uint16_t, 2> count{};    // slaves that have processed the copy
    std::array<std::uint8_t, 2> arrivals{};  // of each NIC before the frame was sent: Redundancy::arrivals_
    std::uint16_t second_slaves = 0;  // answers and time that the other copy has last read from the second reference
    std::uint32_t second_ns = 0;
    std::array<TimeDatagram, 2> times{};
    std::array<std::byte, wire::kMaxFrameBytes> out;   // as sent, with the source address of the second NIC
    std::array<std::byte, wire::kMaxFrameBytes> back;  // the copy that came back first
};

class Redundancy final : public Nic, public Cables {
  public:
    // All parameters outlive this object. `overlapped`: for the thread that sends overlapped cycles.
    Redundancy(Nic& first, Nic& second, std::span<FramePair> own, std::span<FramePair> overlapped) noexcept;
    Redundancy(const Redundancy&) = delete;
    Redundancy& operator=(const Redundancy&) = delete;

    // `sent` when one of the NICs has accepted the frame.
    [[nodiscard]] SendStatus send(Bytes frame) noexcept override;
    [[nodiscard]] std::size_t receive(MutableBytes into) noexcept override;
    // down: both are down.
    [[nodiscard]] LinkState link_state() noexcept override;
    [[nodiscard]] MacAddress source_mac() const noexcept override { return source_[0]; }
    [[nodiscard]] int wait_handle() const noexcept override { return nics_[0]->wait_handle(); }
    [[nodiscard]] WaitHandles wait_handles() const noexcept override {
        return {nics_[0]->wait_handle(), nics_[1]->wait_handle()};
    }
    [[nodiscard]] Time next_arrival() const noexcept override;
    [[nodiscard]] int last_error() const noexcept override;

    void give_up(std::uint8_t index) noexcept override;
    [[nodiscard]] std::size_t half(const PreparedFrame& frame, std::uint8_t index, MutableBytes into) noexcept override;
    void split() noexcept override { split_ = true; }

    // Sets the slave whose time is in the copies that the head does not send; 0: these copies carry no time.
    // `reference`: the reference of the whole segment, where only these copies reach it. These copies carry the only
    // time, as long as the frames of the link address this reference. Then a change of the ways holds the times until
    // the next call.
    void set_second_reference(StationAddress slave, StationAddress reference = {}) noexcept {
        second_.store(packed(slave, reference), std::memory_order_relaxed);
        difference_ = {};
        if (!times_guarded_) times_held_.store(false, std::memory_order_relaxed);
    }
    // False if the second reference has not answered, because its slave is lost.
    [[nodiscard]] bool has_second_reference(StationAddress slave, StationAddress reference) const noexcept {
        return second_.load(std::memory_order_relaxed) == packed(slave, reference);
    }
    // While `guard` is true, each change of the ways of the frames holds the times: the frames read the reference, and
    // bring its time to no clock, until release_times(). For clocks whose delay depends on the way.
    void guard_times(bool guard) noexcept;
    [[nodiscard]] bool are_times_held() const noexcept { return times_held_.load(std::memory_order_relaxed); }
    void release_times() noexcept {
        difference_ = {};
        times_held_.store(false, std::memory_order_relaxed);
    }
    // How often the ways of the frames have changed: the state of the ring, or the slaves that a NIC reaches.
    [[nodiscard]] std::uint32_t ways() const noexcept { return ways_; }
    // The differences since the last call.
    [[nodiscard]] PartDifference take_difference() noexcept { return std::exchange(difference_, PartDifference{}); }
    // The library opens the ring itself: from the next frame on that writes the loop control of a slave, only the head
    // sends. Until end_opening(), replies do not change the state of the ring. Without `times`, the frames of the open
    // ring bring no time to the clocks: some times would change the rates of clocks that follow another reference.
    void begin_opening(bool times) noexcept {
        without_times_.store(!times, std::memory_order_relaxed);
        opening_.store(Opening::awaited, std::memory_order_relaxed);
    }
    // After the next frame that writes the loop control, both NICs send again.
    void begin_closing() noexcept { opening_.store(Opening::ends, std::memory_order_relaxed); }
    void end_opening() noexcept { opening_.store(Opening::none, std::memory_order_relaxed); }

    // For the application. It asks both NICs for their links, which may wait in the system: a network driver, or
    // another program that changes an interface.
    [[nodiscard]] RedundancyStatus status() const noexcept;
    // Whether a NIC has not accepted its last frame.
    [[nodiscard]] bool refuses() const noexcept {
        return refused_[0].load(std::memory_order_relaxed) || refused_[1].load(std::memory_order_relaxed);
    }
    [[nodiscard]] RingState ring() const noexcept { return ring_; }
    [[nodiscard]] CablingFault fault() const noexcept { return fault_; }
    // The NIC at the beginning of the ring.
    [[nodiscard]] unsigned head() const noexcept { return head_.load(std::memory_order_relaxed); }
    // Call it when the ports of the slaves show that the other NIC is at the beginning of the ring. If both copies
    // reach slaves, the frames of a whole ring do not show this. For the receiving thread; positions are valid again
    // after the next frame that counts slaves.
    void turn_round() noexcept {
        front_known_.store(false, std::memory_order_relaxed);
        head_.store(static_cast<std::uint8_t>(1 - head()), std::memory_order_relaxed);
        ++ways_;
    }
    // How many slaves the copies of a NIC reach. Known since the last change of the ring: counts_are_new().
    [[nodiscard]] std::uint16_t reached_by(unsigned nic) const noexcept {
        return slaves_[nic].load(std::memory_order_relaxed);
    }
    [[nodiscard]] bool counts_are_new() const noexcept;
    [[nodiscard]] bool ever_whole() const noexcept { return ever_whole_; }
    // How often the state of the ring has changed.
    [[nodiscard]] std::uint32_t changes() const noexcept { return changes_; }

  private:
    struct Counters {
        std::atomic<std::uint32_t> sent{0}, refused{0}, received{0}, lost{0}, late{0};
    };
    using Numbers = std::array<std::atomic<std::uint16_t>, 256>;
    static constexpr std::uint16_t kNoPair = 0xFFFF;
    // A NIC is silent when so many of its frames did not come back in succession. They are two copies and the probes:
    // after the first lost copy, the NIC sends probes with the next frame. So two copies that are lost by chance do not
    // make it silent. If the NIC accepts fewer probes, more copies decide.
    static constexpr unsigned kProbes = 6;
    static constexpr unsigned kMissesUntilSilent = 2 + kProbes;
    static constexpr unsigned probes_bit(unsigned nic) { return 2 + 3 * nic; }  // of 3 bits in FramePair::sent
    [[nodiscard]] bool is_silent(unsigned nic) const noexcept {
        return hearing_[nic].load(std::memory_order_relaxed) == Hearing::silent;
    }

    [[nodiscard]] FramePair& pair(std::size_t number) noexcept {
        return number < own_.size() ? own_[number] : overlapped_[number - own_.size()];
    }
    [[nodiscard]] FramePair* pair_of(std::uint8_t index) noexcept;
    // False: the pair is in another state than `from`, or another thread holds it.
    [[nodiscard]] static bool hold(FramePair& pair, FramePair::State from = FramePair::open) noexcept;
    [[nodiscard]] FramePair* open(std::uint8_t index) noexcept;
    [[nodiscard]] FramePair* free_pair(std::span<FramePair> pairs, std::size_t& next) noexcept;
    [[nodiscard]] FramePair* find_pair(std::span<FramePair> pairs, std::size_t& next) noexcept;
    [[nodiscard]] bool reaches_nothing(unsigned nic) const noexcept;
    [[nodiscard]] SendStatus send_by(unsigned nic, FramePair& pair, Bytes frame) noexcept;
    [[nodiscard]] unsigned sender_of(Bytes frame) const noexcept;
    // Collects a frame that was received by NIC `at`. Returns the length of the frame for the link; 0: there is none
    // yet.
    [[nodiscard]] std::size_t collect(unsigned at, MutableBytes frame) noexcept;
    [[nodiscard]] bool awaits(const FramePair& pair, unsigned nic) const noexcept;
    // Times of reference clocks (link/redundancy_time.cpp).
    void divide_times(FramePair& pair) const noexcept;
    static void set_times(const FramePair& pair, MutableBytes frame, TimeDatagram::Form form) noexcept;
    [[nodiscard]] static bool is_reply_to(const FramePair& pair, Bytes reply, unsigned from) noexcept;
    void take_second_time(FramePair& pair, MutableBytes frame, unsigned from) noexcept;
    void compare_times(const FramePair& pair, Bytes frame) noexcept;
    void note_late(const FramePair& pair, unsigned at, unsigned from, bool idle, bool marked) noexcept;
    void note_copy(FramePair& pair, unsigned from, Bytes frame) noexcept;
    void note_ring(const FramePair& pair, unsigned processed) noexcept;
    void note_two_ends(const FramePair& pair) noexcept;
    void set_ring(RingState state) noexcept;
    void note_way() noexcept;
    void store_count(unsigned nic, std::uint16_t slaves) noexcept;
    void set_fault(CablingFault fault) noexcept {
        fault_ = fault;
        foreign_.store(fault == CablingFault::second_segment, std::memory_order_relaxed);
    }
    void place(FramePair& pair, bool head_only) const noexcept;
    [[nodiscard]] bool is_opened_by(Bytes frame) noexcept;
    [[nodiscard]] SendStatus send_by_head(FramePair& pair, Bytes frame) noexcept;
    // Frames without commands (link/redundancy_probe.cpp).
    [[nodiscard]] SendStatus send_probe(unsigned nic) noexcept;
    void send_probes(FramePair& pair, unsigned nic) noexcept;
    [[nodiscard]] static bool is_probe(Bytes frame) noexcept;
    void note_miss(const FramePair& pair, unsigned nic) noexcept;
    void note_probe(Bytes frame, unsigned at, unsigned from) noexcept;
    [[nodiscard]] static bool is_misplaced(const FramePair& pair, unsigned processed) noexcept;
    // The ring has changed between both copies: one copy has passed all slaves, and the other copy some of them. What
    // only the other copy has read from or written to a slave by its station address comes into the complete copy.
    // `last`: the copy that came last.
    static void take_messages(FramePair& pair, MutableBytes last, bool last_is_complete) noexcept;
    [[nodiscard]] std::size_t finish(FramePair& pair, MutableBytes frame, unsigned from) noexcept;

    std::array<Nic*, 2> nics_;
    std::array<MacAddress, 2> source_;
    std::span<FramePair> own_;
    std::span<FramePair> overlapped_;
    std::size_t next_own_ = 0;
    std::size_t next_overlapped_ = 0;
    bool split_ = false;
    Numbers number_of_;  // by index
    std::array<Counters, 2> counters_;

    // The receiving thread writes these members, and the sending threads write some of them.
    std::array<std::atomic<bool>, 2> refused_{};  // the NIC has not accepted the last frame
    std::array<std::atomic<bool>, 2> busy_{};     // the NIC was busy for the last frame
    enum class Hearing : std::uint8_t {
        heard,
        doubted,  // the next frame shows by its probes whether the NIC is silent
        silent,   // copies do not come back, although the NIC accepts them
    };
    std::array<std::atomic<Hearing>, 2> hearing_{};
    std::array<std::atomic<std::uint8_t>, 2> arrivals_{};  // frames that the NIC has sent and that came back; wraps
    std::array<std::atomic<std::uint16_t>, 2> slaves_{};
    std::atomic<std::uint8_t> head_{0};
    static constexpr std::uint32_t packed(StationAddress slave, StationAddress reference) {
        return slave.value | std::uint32_t{reference.value} << 16;
    }
    std::atomic<std::uint32_t> second_{0};  // see set_second_reference()
    std::atomic<bool> times_held_{false};
    enum class Opening : std::uint8_t { none, awaited, open, ends, closed };
    std::atomic<Opening> opening_{Opening::none};
    std::atomic<bool> without_times_{false};
    // Another segment is behind the NIC that is not the head. The slaves of that segment must not process any frame. So
    // that NIC only sends a frame of NOPs from time to time, whose return shows that the NIC is connected to the ring
    // again.
    std::atomic<bool> foreign_{false};
    std::atomic<std::uint8_t> probe_turn_{0};
    std::atomic<bool> front_known_{false};  // see place()
    std::atomic<bool> by_head_{false};      // in the whole ring, slaves process only the copies of the head
    static constexpr std::uint8_t kFramesPerProbe = 64;

    // Members of the receiving thread.
    std::array<unsigned, 2> missed_{};  // copies and probes that did not come back since a frame came back
    std::array<bool, 2> idle_{};        // in the whole ring, no slave processes the copy
    std::array<bool, 2> count_is_new_{};
    unsigned turn_ = 0;  // the NIC that is asked first
    unsigned clean_ = 0;
    static constexpr unsigned kTwoBeginnings = 8;
    unsigned two_beginnings_ = 0;
    RingState ring_ = RingState::unknown;
    CablingFault fault_ = CablingFault::none;
    bool ever_whole_ = false;
    bool ever_parted_ = false;  // a copy has passed the first slave behind a break
    bool times_guarded_ = false;
    std::uint32_t ways_ = 0;
    std::uint32_t changes_ = 0;
    std::uint32_t breaks_ = 0;
    std::uint32_t heals_ = 0;
    std::uint32_t merged_ = 0;
    std::uint32_t repeated_ = 0;
    PartDifference difference_;
};

// Merges the replies to two copies of a frame: what a slave has changed in either of them is changed in the result, and
// the working counters are added. `sent` is the frame that was sent; `into` is one reply, and the result. Each bit has
// one slave that may change it, whatever the command: FPRD and APRD by the addressed slave, LRD and LRW by the slave
// that maps it, FRMW and ARMW by the reference; of BRD all slaves may set it (OR). The frames have the same datagrams.
void merge_replies(MutableBytes into, Bytes other, Bytes sent) noexcept;

}  // namespace margay
