// NICs that answer from a recording in virtual time, without a segment.
//
// PcapReplayNic answers single datagrams, so the requests may have another order or another grouping into frames than
// in the recording. A request that the recording does not have, or has not so often, gets no answer: so a program that
// was recorded in real time may lose single frames in the replay. PcapStrictReplayNic requires every frame to be
// identical and in the recorded order: it is for golden recordings of our own. Both deliver an answer with the recorded
// delay after its request, and use the source address of the recorded requests as their own.
#pragma once

#include "osal/osal.hpp"
#include "oshw/frame_queue.hpp"
#include "oshw/nic.hpp"
#include "oshw/pcap/capture_file.hpp"
#include "wire/datagram.hpp"

#include <array>
#include <deque>
#include <string>
#include <unordered_map>
#include <vector>

namespace margay {

class ReplayNic : public Nic {
  public:
    ReplayNic(const ReplayNic&) = delete;
    ReplayNic& operator=(const ReplayNic&) = delete;

    // Reads a recording; on failure, problem() describes the reason. Allocates memory; after load(), only the text of
    // problem() allocates.
    [[nodiscard]] Result<> load(const std::string& path) { return load_end(path, nullptr, 0); }

    // One sentence: the reason why load() failed, or the first request without an answer in the recording. Empty if
    // there is no error.
    [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override;
    [[nodiscard]] LinkState link_state() noexcept override { return LinkState::up; }
    [[nodiscard]] MacAddress source_mac() const noexcept override { return source_mac_; }
    [[nodiscard]] Time next_arrival() const noexcept override { return queue_.next_due(); }
    [[nodiscard]] const CaptureFile& capture() const noexcept { return capture_; }

  protected:
    // `macs`: the addresses of both NICs of a ring; nullptr: there is one NIC. `end`: the NIC of the ring that this one
    // replays.
    [[nodiscard]] Result<> load_end(const std::string& path, const std::array<MacAddress, 2>* macs, unsigned end);
    static constexpr unsigned kNobody = 2;
    // The NIC of the ring that has sent this copy of a frame; 0 without a ring; kNobody: neither of them.
    [[nodiscard]] unsigned sender_of(const CapturedFrame& frame) const noexcept;
    // False: the frame was sent, whether the NIC has accepted it or not.
    [[nodiscard]] bool was_received(const CapturedFrame& frame) const noexcept;
    [[nodiscard]] unsigned end() const noexcept { return end_; }
    [[nodiscard]] bool in_ring() const noexcept { return in_ring_; }

    explicit ReplayNic(Osal& clock) noexcept;
    ~ReplayNic() = default;

    // Called by load() after the frames are read.
    virtual void prepare() = 0;
    // Keeps the first error, because later errors are usually its consequence.
    void complain(const std::string& what);
    [[nodiscard]] Osal& clock() noexcept { return clock_; }
    [[nodiscard]] FrameQueue& queue() noexcept { return queue_; }

  private:
    Osal& clock_;
    CaptureFile capture_;
    std::string problem_;
    MacAddress source_mac_{};
    bool in_ring_ = false;
    unsigned end_ = 0;
    std::array<MacAddress, 2> macs_{};
    std::vector<HeldFrame> memory_;
    FrameQueue queue_;
};

class PcapReplayNic final : public ReplayNic {
  public:
    // The answer of the NIC to a request that is sent more often than it was recorded.
    enum class UsedUp : std::uint8_t {
        repeat_last,  // repeats the last answer, for a master that polls slightly more often
        unanswered
    };
    struct Counters {
        std::uint64_t answered = 0;  // frames
        // Frames without answer because one of their datagrams had no answer in the recording.
        std::uint64_t lost_as_recorded = 0;
        std::uint64_t unknown = 0;  // frames without answer because a datagram is not in the recording
        // Frames without answer because a datagram was sent more often than recorded.
        std::uint64_t used_up = 0;
        std::uint64_t repeated = 0;   // datagrams that got a repeated last answer
        std::uint64_t malformed = 0;  // sent or recorded frames whose datagrams cannot be read
        std::uint64_t stray = 0;      // replies in the file without a request
    };

    explicit PcapReplayNic(Osal& clock, UsedUp used_up = UsedUp::repeat_last) noexcept
        : ReplayNic(clock), used_up_(used_up) {}

    // Loads a recording of both NICs of a ring: pcapng with two interfaces (PcapRingRecorder). This NIC replays the
    // first interface, and `second` the other one. An answer comes back at the NIC at which it was recorded. A frame
    // that a NIC had not accepted is not accepted again, and the link is down until one is accepted.
    [[nodiscard]] Result<> load_ring(const std::string& path, PcapReplayNic& second);
    [[nodiscard]] LinkState link_state() noexcept override { return refused_ ? LinkState::down : LinkState::up; }

    // The n-th request with the same command, address and length gets the n-th recorded answer. Reads and read-writes
    // get the recorded data, writes keep their data. A frame is answered completely or not at all; if it is not
    // answered, the answers to its other datagrams remain for the next request.
    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override;

    [[nodiscard]] const Counters& counters() const noexcept { return counters_; }

  private:
    // One recorded datagram: request and answer.
    struct Exchange {
        bool answered = false;
        bool used = false;
        bool refused = false;             // the NIC had not accepted the frame
        std::uint32_t answer_offset = 0;  // offset of the datagram header from the start of the frame
        std::uint32_t answer_frame = 0;   // index in capture().frames()
        Duration latency{};
    };
    // All recorded datagrams with one command, address and length, in order.
    struct Series {
        std::vector<Exchange> exchanges;
        std::size_t next = 0;  // all exchanges before this index are used
    };
    // A recorded request frame without a reply yet.
    struct Outstanding {
        std::size_t frame = 0;
        std::vector<std::size_t> at;  // for each datagram, its index in its series
    };
    struct Use {
        Series* series = nullptr;
        std::size_t at = 0;
        bool fresh = false;  // false: a repeated answer
    };
    static constexpr std::size_t kMaxDatagrams = wire::kMaxDatagramsBytes / wire::kDatagramOverheadBytes;

    void prepare() override;
    void take_request(std::size_t frame);
    void take_reply(std::size_t frame);
    [[nodiscard]] bool answers(const Outstanding& request, Bytes reply) const;
    void connect(const Outstanding& request, std::size_t reply_frame);
    // Finds the exchange that answers this datagram now; the series is nullptr if there is none.
    [[nodiscard]] Use find(const wire::DatagramHeader& header) noexcept;
    void write_answer(const Exchange& exchange, const wire::DatagramView& request, MutableBytes frame) const noexcept;
    // The NIC at which the answer arrives, and whether a slave has marked it.
    void deliver(const Exchange* latest, Duration latency, MutableBytes answer) noexcept;

    UsedUp used_up_;
    Counters counters_;
    PcapReplayNic* other_ = nullptr;  // the other NIC of the ring
    bool refused_ = false;            // the last frame was refused in the recording
    std::unordered_map<std::uint64_t, Series> series_;
    std::deque<Outstanding> outstanding_;
};

class PcapStrictReplayNic final : public ReplayNic {
  public:
    explicit PcapStrictReplayNic(Osal& clock) noexcept : ReplayNic(clock) {}

    // The frame must be identical to the next request of the recording. After the first difference no frame is answered
    // any more.
    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override;

    // Whether a request differed from the recording; problem() describes the difference.
    [[nodiscard]] bool diverged() const noexcept { return diverged_; }
    // Whether all requests of the recording have been sent.
    [[nodiscard]] bool finished() const noexcept { return !diverged_ && next_ == capture().frames().size(); }

  private:
    void prepare() override;

    std::size_t next_ = 0;
    bool diverged_ = false;
};

}  // namespace margay
