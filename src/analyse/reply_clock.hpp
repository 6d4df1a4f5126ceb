// Finds out whether the replies of a recording have a clock of their own that is behind: each NIC of a tap may have
// one.
#pragma once

#include "analyse/analyser.hpp"

#include <margay/time.hpp>

#include <cstdint>
#include <deque>
#include <optional>
#include <unordered_map>
#include <vector>

namespace margay::analyse {

// Show the frames of one master by look(), in the order of the file, then ask.
class ReplyClock {
  public:
    void look(Duration at, Bytes frame);
    // The time by which most replies have to be moved so that they are behind their requests. nullopt: few replies are
    // shortly before a request with their content and long behind the request with this content before.
    [[nodiscard]] std::optional<Duration> behind();

    static constexpr std::size_t kMost = 1'000'000;  // frames that are looked at

  private:
    struct Frame {
        Duration at{};
        std::uint64_t content = 0, process_data = 0;
        bool reply = false;
    };
    using Requests = std::unordered_map<std::uint64_t, std::vector<Duration>>;  // times, by content
    [[nodiscard]] std::vector<Duration> leads() const;
    [[nodiscard]] std::uint64_t faults(Duration moved) const;

    std::vector<Frame> frames_{};
};

// Replies that are late, or that have no request while there are requests without a reply: pairs that packets in
// another order may have.
[[nodiscard]] std::uint64_t unmatched(const FrameCounts& frames);

// Passes the packets of one master on, its replies so much later as their clock is behind.
class LaterReplies {
  public:
    LaterReplies(Analyser& analyser, Duration behind) : analyser_(analyser), behind_(behind) {}
    // Packets in order of time.
    void packet(Moment when, Bytes packet, std::size_t length_on_wire, bool reply);
    void finish();

  private:
    struct Reply {
        Moment when{};
        std::vector<std::byte> bytes{};
        std::size_t length_on_wire = 0;
    };
    void pass_reply();

    Analyser& analyser_;
    Duration behind_{};
    std::deque<Reply> waiting_{};
};

}  // namespace margay::analyse
