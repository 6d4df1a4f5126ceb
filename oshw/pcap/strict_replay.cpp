#include "oshw/pcap/replay.hpp"
#include "wire/text.hpp"

#include <algorithm>

namespace margay {
namespace {

// Describes the first datagram of a frame, or the frame if it has no readable datagram.
std::string in_words(Bytes frame) {
    std::array<char, 192> buffer;
    wire::DatagramReader reader(frame);
    const auto datagram = reader.next();
    std::string words = "[";
    words += datagram ? wire::describe(*datagram, buffer) : wire::to_text(reader.fault());
    words += ']';
    return words;
}

}  // namespace

void PcapStrictReplayNic::prepare() {
    diverged_ = false;
    next_ = 0;
    // Replies before the first request belong to an earlier run.
    while (next_ < capture().frames().size() && capture().frames()[next_].reply) ++next_;
}

SendStatus PcapStrictReplayNic::send(std::span<const std::byte> frame) noexcept {
    if (diverged_) return SendStatus::sent;
    const auto& frames = capture().frames();
    if (next_ == frames.size()) {
        diverged_ = true;
        complain("the recording is over, but there comes " + in_words(frame));
        return SendStatus::sent;
    }
    const auto& request = frames[next_];
    const auto expected = capture().bytes(request);
    if (!std::equal(expected.begin(), expected.end(), frame.begin(), frame.end())) {
        diverged_ = true;
        const auto same =
            std::mismatch(expected.begin(), expected.end(), frame.begin(), frame.end()).first - expected.begin();
        complain("packet " + std::to_string(request.number) + " of the recording differs from octet " +
                 std::to_string(same) + ": recorded " + std::to_string(expected.size()) + " octets " +
                 in_words(expected) + ", now " + std::to_string(frame.size()) + " octets " + in_words(frame));
        return SendStatus::sent;
    }
    const Time now = clock().now();
    for (++next_; next_ < frames.size() && frames[next_].reply; ++next_) {
        const auto due = now + std::max(Duration::zero(), frames[next_].at - request.at);
        if (!queue().put(due, capture().bytes(frames[next_]))) {
            diverged_ = true;
            complain("more replies at a time than a replay holds, from packet " + std::to_string(frames[next_].number));
            break;
        }
    }
    return SendStatus::sent;
}

}  // namespace margay
