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

// Call look() for all packets with a whole EtherCAT frame in the order of the file, then decide(), then the other
// functions. Copies are searched in the order of time, independent of the order of the file. Two interfaces are taps of
// one segment if nearly every frame of one interface was also recorded at the other interface, with the same answers of
// the slaves. An interface is doubled if nearly every frame was recorded again within 20 µs. A frame that no slave has
// processed is not enough to show this: such a frame comes back unchanged. Each frame of such an interface has one copy
// at the other one, within 20 µs, or else within 1 ms. The frame of the interface with the most frames stays, so that
// all times come from one clock. If this frame is 20 µs late or more, the first frame stays.
class Twins {
  public:
    // The frame as FrameFinder returns it: tags and octets after the datagrams are not compared.
    void look(std::uint64_t number, Duration at, Bytes frame, std::uint32_t interface);
    void decide();
    // Whether the packet is a copy of another packet that stays.
    [[nodiscard]] bool is_left_out(std::uint64_t number) const { return number < left_.size() && left_[number]; }
    // The interface that represents this interface: the tap of the segment with the lowest number.
    [[nodiscard]] std::uint32_t common(std::uint32_t interface) const;
    [[nodiscard]] std::uint64_t copies() const { return copies_; }
    // Whether nearly every frame was recorded twice.
    [[nodiscard]] bool each() const { return copies_ != 0 && 20 * copies_ >= 9 * frames_; }
    // The number of frames with copies, and the greatest number of copies of one frame.
    [[nodiscard]] std::uint64_t repeated() const { return repeated_; }
    [[nodiscard]] std::uint64_t most_times() const { return most_times_; }
    // Packets without a search for copies: the file is longer than kMostSeen, and their order differs from their times
    // by more than a second.
    [[nodiscard]] std::uint64_t missed() const { return missed_; }

    static constexpr std::uint32_t kMostInterfaces = 32;  // higher numbers: no search for copies
    // Packets that are examined together, 32 octets each.
    static constexpr std::size_t kMostSeen = std::size_t{8} << 20;
    // For tests of long files: another number of packets at a time.
    explicit Twins(std::size_t most_seen = kMostSeen) : most_seen_(most_seen) {}

  private:
    struct Seen {
        Duration at{};
        std::uint64_t octets = 0;  // a hash
        std::uint32_t shape = 0;   // a hash of the octets that slaves do not change
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
        std::uint32_t into = 0;  // the cluster to which this one was joined, or its own number
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
    Duration settled_ = Duration::min();  // earlier packets were examined
    std::uint64_t frames_ = 0, copies_ = 0, missed_ = 0, repeated_ = 0, most_times_ = 0;
};

}  // namespace margay::analyse
