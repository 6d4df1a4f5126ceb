// Finds the reply to each request.
#pragma once

#include "analyse/analysis.hpp"
#include "util/bytes.hpp"

#include <deque>
#include <functional>

namespace margay::analyse {

// A datagram as the master has sent it, and as it came back.
struct Exchanged {
    wire::DatagramHeader header{};  // of the request; with replies only, the address that the request must have had
    Bytes sent{};                   // for a reply without a request: the received octets
    Bytes received{};
    std::uint16_t wkc = 0;
    bool answered = false;
    // False: the recording has only replies, and the size of the ring is not known yet.
    bool address_known = true;
    std::optional<std::uint16_t> passed{};  // the number of slaves that it has passed, if its command counts them
    Moment sent_at{}, at{};                 // `at`: the time of the reply; without a reply, of the request
};

// A frame of the recording, kept until its reply comes.
struct KeptFrame {
    Moment when{};
    std::vector<std::byte> bytes{};
    std::uint64_t process_data = 0;  // a number for the datagrams of process data; 0: it has none
    std::uint64_t turn = 0;          // counts the frames with the same process data
};

class Exchanges {
  public:
    using Listener = std::function<void(const Exchanged& datagram, std::size_t number)>;
    // Called before the datagrams of the frame. A reply without a request has no octets.
    using FrameListener = std::function<void(const KeptFrame& request, bool answered, bool late)>;

    using SentListener = std::function<void(const KeptFrame& request)>;

    // `sent` is called for each frame when it is sent (in a recording with only replies: when it comes back), `frame`
    // and `datagram` when it has come back or is given up.
    Exchanges(FrameCounts& counts, SentListener sent, Listener datagram, FrameListener frame)
        : counts_(counts), sent_(std::move(sent)), datagram_(std::move(datagram)), frame_(std::move(frame)) {}

    // Adds a frame. The first frames of a recording determine its directions: see kLook.
    void take(Moment when, Bytes frame);
    // Requests of the last kPatience before `end` are open; other requests without a reply are lost.
    void finish(Duration end);
    [[nodiscard]] Directions directions() const { return directions_; }
    // Whether the recording has only replies and nearly each frame comes twice, the second time with equal or larger
    // working counters: the tap sees the frame after some slaves, and again after all slaves.
    [[nodiscard]] bool passes_twice() const { return passes_twice_; }
    // Calls `datagram` for the datagrams of a request, as if it had no reply.
    static void datagrams_of(const KeptFrame& request, const Listener& listener);

    static constexpr std::size_t kLook = 512;  // frames
    // A reply that comes after this number of later requests is not found.
    static constexpr std::size_t kPending = 256;
    static constexpr std::size_t kMostEarly = 256;  // replies before their requests

  private:
    struct Early {
        Moment when{};
        std::vector<std::byte> bytes{};
    };
    void decide();
    [[nodiscard]] bool come_again() const;
    void place(Moment when, Bytes frame);
    void request(Moment when, Bytes frame);
    // False: no request belongs to the reply.
    bool reply(Moment when, Bytes frame);
    void answer(std::size_t pending, Moment when, Bytes frame);
    void unasked(Moment when, Bytes frame);
    void keep_early_reply(Moment when, Bytes frame);
    void give_up_early_replies(Duration before);
    void give_up(const KeptFrame& request);
    void spread(const KeptFrame* request, Moment when, Bytes reply);
    [[nodiscard]] std::optional<std::size_t> find(Moment when, Bytes frame) const;
    [[nodiscard]] std::uint64_t& turn_of(std::uint64_t process_data);

    FrameCounts& counts_;
    SentListener sent_;
    Listener datagram_;
    FrameListener frame_;
    Directions directions_ = Directions::none;
    std::vector<Early> early_{};
    bool decided_ = false;
    bool passes_twice_ = false;
    std::deque<KeptFrame> pending_{};
    std::deque<Early> early_replies_{};  // replies whose requests may follow shortly
    std::map<std::uint64_t, std::uint64_t> turns_{};
    std::uint64_t trips_ = 0;
    std::optional<std::uint16_t> ring_{};
};

// The number for the datagrams of process data of a frame, 0 without: the same commands, logical addresses and lengths
// give the same number. Frames that only distribute the time of a clock have a number, too.
[[nodiscard]] std::uint64_t process_data_of(Bytes frame);
// A hash of the content that a request and its reply have in common: commands, indices, lengths, addresses and written
// data.
[[nodiscard]] std::uint64_t content_of(Bytes frame);
[[nodiscard]] bool is_process_data(const wire::DatagramHeader& header);

}  // namespace margay::analyse
