// NICs that answer from a recording, in virtual time: no segment is there.
//
// PcapReplayNic answers datagram by datagram, so that the order and the packing of requests may differ from
// the recorded ones. PcapStrictReplayNic wants every frame octet by octet and in order: for golden recordings
// of our own. Both deliver an answer as long after its request as it was recorded, and take the source
// address of the recorded requests as their own.
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

    // Reads a recording; on failure problem() says why. Allocates; afterwards nothing does but the text of
    // problem().
    [[nodiscard]] Result<> load(const std::string& path);

    // One sentence: why load() failed, or the first request that the recording has no answer for. Empty when
    // all is well.
    [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

    [[nodiscard]] std::size_t receive(std::span<std::byte> into) noexcept override;
    [[nodiscard]] LinkState link_state() noexcept override { return LinkState::up; }
    [[nodiscard]] MacAddress source_mac() const noexcept override { return source_mac_; }
    [[nodiscard]] Time next_arrival() const noexcept override { return queue_.next_due(); }

  protected:
    explicit ReplayNic(Osal& clock) noexcept;
    ~ReplayNic() = default;

    // Called by load() once the frames are there.
    virtual void prepare() = 0;
    // Keeps the first complaint: what comes behind it is mostly its consequence.
    void complain(const std::string& what);
    [[nodiscard]] const CaptureFile& capture() const noexcept { return capture_; }
    [[nodiscard]] Osal& clock() noexcept { return clock_; }
    [[nodiscard]] FrameQueue& queue() noexcept { return queue_; }

  private:
    Osal& clock_;
    CaptureFile capture_;
    std::string problem_;
    MacAddress source_mac_{};
    std::vector<HeldFrame> memory_;
    FrameQueue queue_;
};

class PcapReplayNic final : public ReplayNic {
  public:
    // What becomes of a request that was recorded less often than it is now sent.
    enum class UsedUp : std::uint8_t {
        repeat_last,  // its last answer again: what a master that polls a little more often needs
        unanswered
    };
    struct Counters {
        std::uint64_t answered = 0;          // frames
        std::uint64_t lost_as_recorded = 0;  // frames left unanswered because a datagram of theirs was, then
        std::uint64_t unknown = 0;           // frames left unanswered because a datagram is not in the recording
        std::uint64_t used_up = 0;           // … or not so often
        std::uint64_t repeated = 0;          // datagrams answered by the last answer again
        std::uint64_t malformed = 0;         // frames whose datagrams cannot be read, sent or in the file
        std::uint64_t stray = 0;             // replies in the file that belong to no request
    };

    explicit PcapReplayNic(Osal& clock, UsedUp used_up = UsedUp::repeat_last) noexcept
        : ReplayNic(clock), used_up_(used_up) {}

    // The n-th request of the same command, address and length gets the n-th recorded answer. Reads and
    // read-writes get the recorded data, writes keep theirs. A frame is answered as a whole or not at all; if
    // not, the answers to its other datagrams stay for the next time.
    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override;

    [[nodiscard]] const Counters& counters() const noexcept { return counters_; }

  private:
    // One recorded datagram, request and answer.
    struct Exchange {
        bool answered = false;
        bool used = false;
        std::uint32_t answer_offset = 0;  // of the datagram header, from the start of the frame
        std::uint32_t answer_frame = 0;   // in capture().frames()
        Duration latency{};
    };
    // All recorded datagrams of one command, address and length, in order.
    struct Series {
        std::vector<Exchange> exchanges;
        std::size_t next = 0;  // none before it is unused
    };
    // A recorded request frame whose answer has not come yet.
    struct Outstanding {
        std::size_t frame = 0;
        std::vector<std::size_t> at;  // per datagram, its place in its series
    };
    struct Use {
        Series* series = nullptr;
        std::size_t at = 0;
        bool fresh = false;  // not a repetition
    };
    static constexpr std::size_t kMaxDatagrams = wire::kMaxDatagramsBytes / wire::kDatagramOverheadBytes;

    void prepare() override;
    void take_request(std::size_t frame);
    void take_reply(std::size_t frame);
    [[nodiscard]] bool answers(const Outstanding& request, Bytes reply) const;
    void connect(const Outstanding& request, std::size_t reply_frame);
    // The exchange that answers this datagram now; no series when there is none.
    [[nodiscard]] Use find(const wire::DatagramHeader& header) noexcept;
    void write_answer(const Exchange& exchange, const wire::DatagramView& request, MutableBytes frame) const noexcept;

    UsedUp used_up_;
    Counters counters_;
    std::unordered_map<std::uint64_t, Series> series_;
    std::deque<Outstanding> outstanding_;
};

class PcapStrictReplayNic final : public ReplayNic {
  public:
    explicit PcapStrictReplayNic(Osal& clock) noexcept : ReplayNic(clock) {}

    // The frame must be the next request of the recording, octet by octet. From the first that is not,
    // nothing is answered any more.
    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override;

    // Whether a request differed from the recording; problem() says which and where.
    [[nodiscard]] bool diverged() const noexcept { return diverged_; }
    // Whether all requests of the recording have been made.
    [[nodiscard]] bool finished() const noexcept { return !diverged_ && next_ == capture().frames().size(); }

  private:
    void prepare() override;

    std::size_t next_ = 0;
    bool diverged_ = false;
};

}  // namespace margay
