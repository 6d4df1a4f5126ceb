// The link packs the datagrams that are due into as few frames as fit, sends them, matches what comes back, and gives
// up what does not.
#pragma once

#include "link/datagram.hpp"
#include "link/frame_table.hpp"
#include "link/prepared_frame.hpp"
#include "oshw/nic.hpp"

#include <margay/link_settings.hpp>
#include <margay/statistics.hpp>

#include <array>
#include <span>

namespace margay {

// When the cycles of one group come, and how many octets of queued datagrams may travel with each. The group owns it;
// destroying it takes it off the link.
struct CyclePace : ListNode {
    Time last = Time::min();
    Time before = Time::min();
    std::size_t budget_bytes = 0;
};

class Link {
  public:
    // `nic` and the memory of `slots` outlive the link.
    Link(Nic& nic, std::span<FrameSlot> slots) : nic_(nic), frames_(slots), source_(nic.source_mac()) {}
    Link(const Link&) = delete;
    Link& operator=(const Link&) = delete;

    LinkSettings settings;

    // Takes in all frames that the NIC has and gives up those whose time is over. Waiters whose datagrams are done end
    // up in `ready`. Resumes nobody.
    void receive(Time now, List<Waiter>& ready);
    // Takes in one frame; false when the NIC has none.
    bool receive_one(Time now, List<Waiter>& ready);
    // Packs and sends what is queued.
    void send(Time now);

    // The cycle, in link/cycle.hpp. Each group of frames has a pace of its own, which the link is told of once.
    void add_pace(CyclePace& pace) { paces_.push_back(pace); }
    // Sends the frames of a cycle. Does not wait or allocate. Queued datagrams travel with the cycle,
    // `rider_budget_bytes` of them with their headers, or one datagram if it is longer, in a frame of their own where
    // the frames of the cycle have no room left. While the cycles of any group go on, send() leaves the queue to them;
    // cycles without a budget do not count. A flight that is not over yet is given up. Anything but `sent`: of the last
    // frame that is not in flight.
    [[nodiscard]] SendStatus send_cycle(std::span<PreparedFrame> frames, CyclePace& pace, Time now,
                                        std::size_t rider_budget_bytes);
    // Takes in what the NIC has until all of these frames are back.
    [[nodiscard]] CycleEnd receive_cycle(std::span<PreparedFrame> frames, Time now, List<Waiter>& ready);
    // When any group was sent last.
    [[nodiscard]] Time last_cycle() const { return last_cycle_; }
    // Cycles go on, and what is queued waits for the next one.
    [[nodiscard]] bool cycling(Time now) { return now < cycles_until(); }
    // A prepared frame that is not waited for any more; its reply, should it come, is dropped.
    void give_up_prepared(PreparedFrame& frame, Time now);
    // Nothing came of it in this cycle.
    static void nothing_came(PreparedFrame& frame);

    // Overlapped cycles, in link/overlap.cpp. From the first of them on the indices of frames are split between the
    // thread that sends them and the owner.
    void allow_overlapping() { frames_.split(); }
    // The sending thread's, for frames that the owner has done with: sends them. Anything but `sent`: of the last frame
    // that is not in flight.
    [[nodiscard]] SendStatus send_overlapped(std::span<PreparedFrame> frames);
    // The owner's: takes in what the NIC has until all of these frames are back; false when some are not. And the end
    // of their cycle: inputs and working counters are taken over, what is not back is given up.
    [[nodiscard]] bool receive_overlapped(std::span<PreparedFrame> frames, Time now, List<Waiter>& ready);
    void end_overlapped(std::span<PreparedFrame> frames, Time sent_at, Time now);
    // While nobody sends.
    void forget_overlapped(PreparedFrame& frame, Time now);

    // When receive() or send() should be called again at the latest.
    [[nodiscard]] Time next_deadline(Time now);

    [[nodiscard]] const LinkStatistics& statistics() const { return statistics_; }
    [[nodiscard]] Nic& nic() { return nic_; }

  private:
    friend class Datagram;

    void take(Bytes frame, Time now, List<Waiter>& ready);
    // Whether a frame is no echo of an own one.
    [[nodiscard]] bool is_genuine(Bytes frame) const;
    void drop_unmarked(Bytes frame, FrameSlot* slot);
    void note_stuck(Time now);
    void end_queued(List<Waiter>& ready);
    [[nodiscard]] static bool matches(FrameSlot& slot, Bytes frame);
    void complete(Datagram& datagram, Errc errc, List<Waiter>& ready);
    void give_up(FrameSlot& slot, Time now, List<Waiter>& ready);
    void pack(FrameSlot& slot, wire::FrameBuilder& builder);
    [[nodiscard]] bool send_one(FrameSlot& slot, Time now, std::size_t room = wire::kMaxFrameBytes);
    void unpack(FrameSlot& slot);
    void deliver(FrameSlot& slot, Bytes frame, Time now, List<Waiter>& ready);
    void deliver_riders(FrameSlot& slot, Bytes frame, List<Waiter>& ready);
    static void take_degraded(const PreparedFrame& frame, const PreparedDatagram& datagram, const std::byte* inputs);
    void not_sent(PreparedFrame& frame, Time now);
    static void fill_plain(PreparedFrame& frame, std::uint8_t index);
    static void fill(PreparedFrame& frame, std::uint8_t index);
    void note_prepared(const PreparedFrame& frame);
    [[nodiscard]] SendStatus send_with_queue(std::span<PreparedFrame> frames, Time now, std::size_t budget_bytes);
    // Whatever these come to, `all` is the status of one that went wrong before.
    [[nodiscard]] SendStatus send_rest(std::span<PreparedFrame> frames, SendStatus all, Time now);
    [[nodiscard]] SendStatus send_with_riders(PreparedFrame& frame, Time now);
    [[nodiscard]] SendStatus send_prepared(PreparedFrame& frame, Time now);
    void send_riders(Time now);
    void take_plain(PreparedFrame& frame);
    // The others of a cycle in which one was not right.
    [[nodiscard]] CycleEnd receive_rest(std::span<PreparedFrame> frames, Time now, List<Waiter>& ready);
    [[nodiscard]] bool is_reply(FrameSlot& slot, Bytes frame) const;
    static void take_datagrams(PreparedFrame& sent, Bytes frame);
    [[nodiscard]] bool take_prepared(Bytes frame, Time now, List<Waiter>& ready);
    static void park(PreparedFrame& sent, Bytes reply);
    void take_any(Bytes frame, Time now, List<Waiter>& ready);
    // Until then the queue is left to the cycle.
    [[nodiscard]] Time cycles_until();
    static void strip(PreparedFrame& frame);
    [[nodiscard]] Bytes add_riders(PreparedFrame& frame, FrameSlot& slot);
    [[nodiscard]] std::size_t rider_room();
    void note_riders(std::size_t bytes);
    void note_sent(FrameSlot& slot);

    Nic& nic_;
    FrameTable frames_;
    List<Datagram> queue_;
    LinkStatistics statistics_;
    MacAddress source_;
    bool nic_busy_ = false;
    Time stuck_since_ = kNever;  // since then the NIC takes nothing of the queue
    List<CyclePace> paces_;
    Time last_cycle_ = Time::min();
    std::size_t rider_budget_ = 0;                          // what this cycle has left for what rides
    bool riders_ = false;                                   // some have ridden in this cycle
    std::array<std::byte, wire::kMaxFrameBytes> buffer_{};  // the frame being built, or being read
};

}  // namespace margay
