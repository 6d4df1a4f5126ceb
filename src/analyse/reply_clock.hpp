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

// Call look() for the frames of one master in the order of the file, then behind().
class ReplyClock {
  public:
    void look(Duration at, Bytes frame);
    // The time that must be added to the replies so that most of them come after their requests. nullopt: only few
    // replies are shortly before a request with their content and long after the previous such request.
    [[nodiscard]] std::optional<Duration> behind();

    static constexpr std::size_t kMost = 1'000'000;  // frames that are examined

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

// The number of late replies, and of replies without a request while there are requests without a reply. These could be
// pairs if the packets were in another order.
[[nodiscard]] std::uint64_t unmatched(const FrameCounts& frames);

// Passes on the packets of one master, and corrects the times of its replies by the error of their clock.
class LaterReplies {
  public:
    LaterReplies(Analyser& analyser, Duration behind) : analyser_(analyser), behind_(behind) {}
    // Call it for the packets in order of time.
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
