// The link packs the queued datagrams into as few frames as possible, sends the frames, matches the replies, and times
// out the frames that do not come back.
#pragma once

#include "link/datagram.hpp"
#include "link/frame_table.hpp"
#include "link/prepared_frame.hpp"
#include "oshw/nic.hpp"

#include <margay/link_settings.hpp>
#include <margay/statistics.hpp>

#include <array>
#include <span>
#include <utility>

namespace margay {

// The times of the last two cycles of one group, and how many octets of queued datagrams may be sent with each cycle.
// The group owns it; its destructor removes it from the link.
struct CyclePace : ListNode {
    Time last = Time::min();
    Time before = Time::min();
    std::size_t budget_bytes = 0;
};

// The interface of the merging of two cables (link/redundancy.hpp) for the link.
class Cables {
  public:
    // The link does not wait for the frame with this index any more.
    virtual void give_up(std::uint8_t index) noexcept = 0;
    // The indices are divided between two threads from now on, see FrameTable::split().
    virtual void split() noexcept = 0;
    // Copies the reply of one NIC to this frame, if the copy of the other NIC has not come back and every slave took
    // part in all datagrams of the frame. Call it before give_up(). Returns the octets of the reply; 0: there is no
    // such reply.
    [[nodiscard]] virtual std::size_t half(const PreparedFrame& frame, std::uint8_t index,
                                           MutableBytes into) noexcept = 0;

  protected:
    ~Cables() = default;
};

class Link {
  public:
    // `nic` and the memory of `slots` outlive the link.
    Link(Nic& nic, std::span<FrameSlot> slots) : nic_(nic), frames_(slots), source_(nic.source_mac()) {}
    Link(const Link&) = delete;
    Link& operator=(const Link&) = delete;

    LinkSettings settings;

    // Receives all frames that the NIC has, and closes the frames whose time is over. Appends the waiters whose
    // datagrams have ended to `ready`. Resumes no coroutine.
    void receive(Time now, List<Waiter>& ready);
    // Receives one frame; false when the NIC has none.
    bool receive_one(Time now, List<Waiter>& ready);
    // Packs and sends the queued datagrams.
    void send(Time now);

    // The cycle, implemented in link/cycle.hpp. Each group of frames registers its own pace once.
    void add_pace(CyclePace& pace) { paces_.push_back(pace); }
    // Sends the frames of a cycle. Does not wait or allocate. Queued datagrams are sent with the cycle: up to
    // `rider_budget_bytes` octets with their headers, or one datagram if it is longer. They use the free room in the
    // frames of the cycle, then frames of their own. While the cycles of any group keep their interval, send() leaves
    // the queue to the cycles; groups with a budget of zero do not count. If a frame of the previous cycle is still in
    // flight, its reply is given up. A result other than `sent` is the status of the last frame that could not be sent.
    [[nodiscard]] SendStatus send_cycle(std::span<PreparedFrame> frames, CyclePace& pace, Time now,
                                        std::size_t rider_budget_bytes);
    // Receives frames from the NIC until all of these frames are back, or the NIC has none.
    [[nodiscard]] CycleEnd receive_cycle(std::span<PreparedFrame> frames, Time now, List<Waiter>& ready);
    // Commits the reply that is parked in a held frame; see PreparedFrame::is_held().
    static void commit_held(PreparedFrame& frame);
    // When a cycle of any group was sent last.
    [[nodiscard]] Time last_cycle() const { return last_cycle_; }
    // Whether cycles keep their interval, so that queued datagrams wait for the next cycle.
    [[nodiscard]] bool cycling(Time now) { return now < cycles_until(); }
    // Stops waiting for a prepared frame. If its reply arrives later, it is dropped.
    void give_up_prepared(PreparedFrame& frame, Time now);
    // Call it before give_up_prepared(): commits the reply of one of two NICs, if this reply is complete, and ends the
    // waiting for the frame. False: there is no complete reply.
    [[nodiscard]] bool take_half(PreparedFrame& frame, Time now);
    // Marks all datagrams and readings of the frame as not received in this cycle.
    static void mark_not_received(PreparedFrame& frame);
    // The same for its readings only. The application may send the next cycle without receiving this one.
    static void lose_readings(PreparedFrame& frame);

    // Overlapped cycles, implemented in link/overlap.cpp. After this call the indices of frames are divided between the
    // thread that sends overlapped cycles and the owner's thread.
    void allow_overlapping() {
        frames_.split();
        if (cables_ != nullptr) cables_->split();
    }
    // The NIC consists of two NICs. Call it before the first frame is sent.
    void use(Cables& cables) { cables_ = &cables; }
    // Sends frames that the owner has finished with; called by the sending thread. A result other than `sent` is the
    // status of the last frame that could not be sent.
    [[nodiscard]] SendStatus send_overlapped(std::span<PreparedFrame> frames, Duration since_last);
    // The owner's thread calls both functions. receive_overlapped() receives frames from the NIC until all of these
    // frames are back; false when some are missing. end_overlapped() ends their cycle: copies inputs and working
    // counters, and closes the frames that are not back.
    [[nodiscard]] bool receive_overlapped(std::span<PreparedFrame> frames, Time now, List<Waiter>& ready);
    void end_overlapped(std::span<PreparedFrame> frames, Time sent_at, Time now);
    // Call it only while no thread sends.
    void forget_overlapped(PreparedFrame& frame, Time now);

    // The latest time at which receive() or send() must be called again.
    [[nodiscard]] Time next_deadline(Time now);

    [[nodiscard]] const LinkStatistics& statistics() const { return statistics_; }
    // The greatest number of frames in succession that did not come back, since the last call.
    [[nodiscard]] std::uint32_t take_longest_silence() { return std::exchange(longest_silence_, 0); }
    [[nodiscard]] std::uint32_t longest_silence() const { return longest_silence_; }
    // How many frames did not come back since a frame came back last.
    [[nodiscard]] std::uint32_t silence() const {
        return received_before_ == statistics_.frames_received ? silence_ : 0;
    }
    // Whether no cycle was sent for longer than kPause, since the last call: now, or between two cycles.
    [[nodiscard]] bool take_pause(Time now) {
        note_cycle(last_cycle_, now);
        return std::exchange(paused_, false);
    }
    void keep_pause() { paused_ = true; }
    static constexpr Duration kPause = std::chrono::seconds(1);
    [[nodiscard]] Nic& nic() { return nic_; }
    // Asks the NIC for its link state if the last answer is older than `age`. The call to the operating system may take
    // long.
    void look_at_cable(Time now, std::chrono::milliseconds age) {
        const auto at = in_steps(now.time_since_epoch());  // wraps: the difference of two times is right
        if (at - cable_seen_ < in_steps(age)) return;
        cable_seen_ = at;
        down_ = nic_.link_state() == LinkState::down;
    }
    // Whether the NIC had no link when it was asked last.
    [[nodiscard]] bool is_down() const { return down_; }

  private:
    friend class Datagram;

    // Converts a time to steps of 65 536 ns, without a division of 64 bits: the code of such a division has 0.9 KiB on
    // a processor without this instruction.
    static constexpr std::uint32_t in_steps(Duration time) { return static_cast<std::uint32_t>(time.count() >> 16); }

    // The settings, with the default in place of a value that is out of range.
    [[nodiscard]] Duration frame_timeout() const {
        return settings.frame_timeout > Duration{0} ? settings.frame_timeout : LinkSettings{}.frame_timeout;
    }
    [[nodiscard]] Duration queue_timeout() const {
        return settings.queue_timeout > Duration{0} ? settings.queue_timeout : LinkSettings{}.queue_timeout;
    }

    void accept_datagrams(Bytes frame, Time now, List<Waiter>& ready);
    // Whether a frame has passed the segment, so that it is not the echo of an own frame.
    [[nodiscard]] bool is_genuine(Bytes frame) const;
    void drop_unmarked(Bytes frame, FrameSlot* slot);
    void note_stuck(Time now);
    void end_queued(List<Waiter>& ready);
    [[nodiscard]] static bool matches(FrameSlot& slot, Bytes frame);
    void complete(Datagram& datagram, Errc errc, List<Waiter>& ready);
    void give_up(FrameSlot& slot, Time now, List<Waiter>& ready);
    // Counts one more frame that did not come back.
    void note_silence();
    // Receives all frames that the NIC has. The coroutines that become ready are returned by the next receive().
    void drain(Time now);
    // Closes the slot of a frame that is lost.
    void close_lost(FrameSlot& slot, Time now);
    void pack(FrameSlot& slot, wire::FrameBuilder& builder);
    [[nodiscard]] bool send_one(FrameSlot& slot, Time now, std::size_t room = wire::kMaxFrameBytes);
    void unpack(FrameSlot& slot);
    void deliver(FrameSlot& slot, Bytes frame, Time now, List<Waiter>& ready);
    void deliver_riders(FrameSlot& slot, Bytes frame, List<Waiter>& ready);
    [[nodiscard]] static bool commit(const PreparedDatagram& datagram, const std::byte* data);
    static void commit_short(PreparedFrame& frame, const PreparedDatagram& datagram, const std::byte* data);
    // Separates the frame from its slot. nullptr: riders are awaited in the slot until their own deadline.
    [[nodiscard]] FrameSlot* leave_slot(PreparedFrame& frame);
    void keep_half(PreparedFrame& frame, Time now);
    void not_sent(PreparedFrame& frame, Time now);
    static void fill_plain(PreparedFrame& frame, std::uint8_t index);
    static void fill(PreparedFrame& frame, std::uint8_t index);
    void note_prepared(const PreparedFrame& frame);
    [[nodiscard]] SendStatus send_with_queue(std::span<PreparedFrame> frames, Time now, std::size_t budget_bytes);
    // Sends the remaining frames of a cycle. `all` is the status so far; the result is the status of the last frame
    // that could not be sent.
    [[nodiscard]] SendStatus send_rest(std::span<PreparedFrame> frames, SendStatus all, Time now);
    [[nodiscard]] SendStatus send_with_riders(PreparedFrame& frame, Time now);
    [[nodiscard]] SendStatus send_prepared(PreparedFrame& frame, Time now);
    void send_riders(Time now);
    void commit_plain(PreparedFrame& frame);
    // Receives the remaining frames of a cycle whose first frame has come back and is not `right`.
    [[nodiscard]] CycleEnd receive_rest(std::span<PreparedFrame> frames, Time now, List<Waiter>& ready);
    [[nodiscard]] bool is_reply(FrameSlot& slot, Bytes frame) const;
    static void commit_frame(PreparedFrame& sent, Bytes frame);
    [[nodiscard]] bool accept_prepared(Bytes frame, Time now, List<Waiter>& ready);
    static void keep(PreparedFrame& sent, Bytes reply);
    static void drop_held(PreparedFrame& frame);
    void accept_frame(Bytes frame, Time now, List<Waiter>& ready);
    [[gnu::cold]] void accept_in_cycle(const PreparedFrame& awaited, std::size_t length, Time now, List<Waiter>& ready);
    // Until this time, queued datagrams are sent only with cycles.
    [[nodiscard]] Time cycles_until();
    static void remove_riders(PreparedFrame& frame);
    [[nodiscard]] Bytes add_riders(PreparedFrame& frame, FrameSlot& slot);
    [[nodiscard]] std::size_t rider_room();
    void note_riders(std::size_t bytes);
    void note_sent(FrameSlot& slot, Time now);
    void note_cycle(Time before, Time now) {
        // Unsigned, so that the time from Time::min() (before the first cycle) is a pause, too.
        const auto nanoseconds = [](Time time) { return static_cast<std::uint64_t>(time.time_since_epoch().count()); };
        if (nanoseconds(now) - nanoseconds(before) > static_cast<std::uint64_t>(kPause.count())) [[unlikely]]
            paused_ = true;
    }

    Nic& nic_;
    Cables* cables_ = nullptr;
    FrameTable frames_;
    List<Datagram> queue_;
    LinkStatistics statistics_;
    std::uint64_t received_before_ = 0;  // frames received before the last one that did not come back
    std::uint32_t silence_ = 0;          // frames that did not come back since a frame was received
    std::uint32_t longest_silence_ = 0;
    // While the application sends cycles and receives none, the NIC is drained each time this number of frames did not
    // come back: well before the index of one of these frames is used again.
    static constexpr std::uint32_t kMostUnread = 32;
    bool paused_ = false;  // more than kPause between two cycles, since take_pause()
    MacAddress source_;
    bool nic_busy_ = false;
    Time stuck_since_ = kNever;  // since this time the NIC has accepted no queued datagram
    List<CyclePace> paces_;
    Time last_cycle_ = Time::min();
    std::size_t rider_budget_ = 0;  // octets of queued datagrams that may still be sent with this cycle
    bool riders_ = false;           // queued datagrams were sent with this cycle
    bool down_ = false;             // the NIC had no link at cable_seen_
    std::array<std::byte, wire::kMaxFrameBytes> buffer_{};  // the frame that is being built or read
    std::uint32_t cable_seen_ = 0;
    List<Waiter> early_;                               // received by drain()
    std::uint16_t receiving_ = PreparedFrame::kNever;  // PreparedFrame::park of the cycle that is being received
};

}  // namespace margay
