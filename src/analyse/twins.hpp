// Frames that were recorded twice, as by a mirror port that copies both directions, or by two taps.
#pragma once

#include "util/bytes.hpp"

#include <margay/time.hpp>

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace margay::analyse {

// Show all packets with a whole EtherCAT frame by look(), in the order of the file, call decide(), then ask.
//
// Copies are looked for in the order of time, whatever the order of the file is. Two interfaces are taps of one segment
// where nearly every frame of one of them is there at the other one, too, and its slaves have not answered otherwise
// there. An interface is doubled where nearly every frame is there again within 20 µs. A frame that
// no slave has processed is not enough to show this: such a frame comes back unchanged. Each frame of such an interface
// has one copy at the other one, within 20 µs, or else within 1 ms. The frame of the interface with the most frames
// stays, so that all times are of one clock; where it is 20 µs late or more, the first frame stays.
class Twins {
  public:
    // The frame as FrameFinder returns it: tags and what is behind the datagrams make no difference.
    void look(std::uint64_t number, Duration at, Bytes frame, std::uint32_t interface);
    void decide();
    // Whether the packet is a copy of another one that stays.
    [[nodiscard]] bool is_left_out(std::uint64_t number) const { return number < left_.size() && left_[number]; }
    // The interface that stands for this one: the lowest one of the taps of a segment.
    [[nodiscard]] std::uint32_t common(std::uint32_t interface) const;
    [[nodiscard]] std::uint64_t copies() const { return copies_; }
    // Nearly every frame was there twice.
    [[nodiscard]] bool each() const { return copies_ != 0 && 20 * copies_ >= 9 * frames_; }
    // The frames that have copies, and how many times one of them was there at most.
    [[nodiscard]] std::uint64_t repeated() const { return repeated_; }
    [[nodiscard]] std::uint64_t most_times() const { return most_times_; }
    // Packets of which copies were not looked for: the file is longer than kMostSeen, and they are out of their place
    // by more than a second.
    [[nodiscard]] std::uint64_t missed() const { return missed_; }

    static constexpr std::uint32_t kMostInterfaces = 32;            // higher numbers: no search for copies
    static constexpr std::size_t kMostSeen = std::size_t{8} << 20;  // packets at a time, 32 octets each
    // For tests of long files: another number of packets at a time.
    explicit Twins(std::size_t most_seen = kMostSeen) : most_seen_(most_seen) {}

  private:
    struct Seen {
        Duration at{};
        std::uint64_t octets = 0;  // a hash
        std::uint32_t shape = 0;   // a hash of what slaves do not change
        std::uint32_t number = 0;
        std::uint32_t places = 0;  // interfaces with a copy, one bit each
        std::uint8_t interface = 0;
        bool touched = false;    // slaves have processed it
        bool ambiguous = false;  // it may be a request or a reply
    };
    // Equal frames of several interfaces, treated as one frame.
    struct Cluster {
        Duration at{};
        std::uint32_t places = 0;
        std::uint32_t into = 0;  // the cluster that it was joined to, or itself
        std::uint32_t frames = 0;
        bool ambiguous = false;
    };
    struct Count {
        std::uint64_t all = 0, touched = 0;
    };
    // Frames of two interfaces.
    struct Pair {
        Count both{};              // copies
        std::uint64_t near = 0;    // copies that are usually close
        std::uint64_t differ = 0;  // the same frame came back with other data
        Count during{};            // frames of the first one, while the second one was recorded
    };
    struct Interface {
        Count frames{}, seconds{};
        Duration first = Duration::max(), last = Duration::min();
    };
    void relate();
    void count_seconds(std::span<const Seen> equal);
    void count_pairs(std::span<Seen> equal);
    void count_differences();
    void count_spans();
    [[nodiscard]] bool is_inside(std::size_t one, std::size_t other) const;
    [[nodiscard]] bool differ(std::size_t one, std::size_t other) const;
    void settle(bool end);
    void leave_out(std::span<const Seen> equal);
    void cluster(std::span<const Seen> equal, std::uint32_t doubled);
    void join_leftovers(std::uint32_t doubled);
    [[nodiscard]] std::uint32_t cluster_of(std::size_t n) const { return clusters_[of_[n]].into; }
    [[nodiscard]] Pair& pair(std::size_t one, std::size_t other) { return pairs_[one * kMostInterfaces + other]; }
    [[nodiscard]] const Pair& pair(std::size_t one, std::size_t other) const {
        return pairs_[one * kMostInterfaces + other];
    }

    std::size_t most_seen_;
    std::vector<Seen> seen_{};
    std::vector<Cluster> clusters_{};  // of equal frames
    std::vector<std::uint32_t> of_{};  // the cluster of each of them
    std::vector<Pair> pairs_{};
    std::array<Interface, kMostInterfaces> interfaces_{};
    std::array<std::uint32_t, kMostInterfaces> common_{};
    std::array<std::uint32_t, kMostInterfaces> best_{};  // by common(): the interface with the most frames
    std::uint32_t doubled_ = 0;                          // interfaces, one bit each
    bool related_ = false;
    std::vector<bool> left_{};            // by number
    Duration settled_ = Duration::min();  // packets before were looked at
    std::uint64_t frames_ = 0, copies_ = 0, missed_ = 0, repeated_ = 0, most_times_ = 0;
};

}  // namespace margay::analyse
