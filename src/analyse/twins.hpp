// Frames that were recorded twice, as by a mirror port that copies both directions, or by two taps.
#pragma once

#include "util/bytes.hpp"

#include <margay/time.hpp>

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <utility>
#include <vector>

namespace margay::analyse {

// Where the second one of two equal frames is left out, by what Twins has found in the whole file.
struct Copies {
    bool all = false;                         // each frame is there twice
    std::vector<std::uint32_t> interfaces{};  // only here: nearly all of its frames, or each of them twice
    // An interface with copies of nearly all of its frames at another one, and that one: one of the two may be the
    // first to see a frame, and now one, now the other.
    std::map<std::uint32_t, std::uint32_t> same{};
    [[nodiscard]] bool any() const { return all || !interfaces.empty() || !same.empty(); }
    // The interface that stands for this one.
    [[nodiscard]] std::uint32_t common(std::uint32_t interface) const;
    // Whether the second one of two equal frames is left out: by the interfaces of both.
    [[nodiscard]] bool left_out(std::uint32_t first, std::uint32_t second) const;
};

// Show all packets with an EtherCAT frame in the order of time. Two packets with the same octets are twins when the
// second one is shortly behind the first one: a kernel may stamp the packets of a NIC in batches, so that others are
// between them. Frames without a working counter are no sign of it: a frame that no slave has processed comes back as it
// was.
class Twins {
  public:
    // The interface of the first one, if this packet is the second one. `frame`: the EtherCAT frame in it.
    [[nodiscard]] std::optional<std::uint32_t> first_of(Duration at, Bytes packet, Bytes frame,
                                                        std::uint32_t interface);
    [[nodiscard]] Copies copies() const;

  private:
    struct Packet {
        Duration at{};
        std::vector<std::byte> bytes{};
        std::uint32_t interface = 0;
        bool paired = false;  // it is a second one itself
    };
    struct Counts {
        std::uint64_t frames = 0, seconds = 0, touched = 0, touched_seconds = 0;
        [[nodiscard]] bool nearly_half() const;
    };
    struct Pairs {
        std::uint64_t all = 0, touched = 0;
        [[nodiscard]] bool nearly_all(const Counts& of) const;
    };
    std::deque<Packet> last_{};
    std::map<std::uint32_t, Counts> counts_{};                          // by the interface of the second one
    std::map<std::pair<std::uint32_t, std::uint32_t>, Pairs> pairs_{};  // by both interfaces, the lower one first
};

}  // namespace margay::analyse
