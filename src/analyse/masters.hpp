// Finds the master of a recording that has sent or will receive a frame.
#pragma once

#include "oshw/pcap/pcapng.hpp"
#include "util/bytes.hpp"

#include <array>
#include <map>
#include <optional>
#include <vector>

namespace margay::analyse {

inline constexpr std::size_t kMostPlaces = 4096;  // pairs of address and interface that are distinguished

// Call look() for all frames in the order of the file, then decide(), then the other functions.
class Masters {
  public:
    // `frame`: with an Ethernet header, as FrameFinder returns it.
    void look(Bytes frame, std::uint32_t interface);
    void decide();
    // The master of a frame, from 0 in the order of the first frames; kMostMasters or more: beyond the limit of
    // masters, or its address and interface were not among the first kMostPlaces that look() has seen. nullopt: the
    // frame has no datagrams that can be read.
    [[nodiscard]] std::optional<std::size_t> of(Bytes frame, std::uint32_t interface) const;
    [[nodiscard]] std::size_t count() const { return count_; }
    // The interface of the file, if another master of the file has the same address.
    [[nodiscard]] std::optional<std::uint32_t> interface_of(std::size_t master) const;

  private:
    using Address = std::array<std::byte, 6>;  // the source address without the mark of the first slave
    struct Seen {
        std::uint64_t marked = 0, unmarked = 0;    // frames with and without the mark of the first slave
        std::uint64_t touched = 0, untouched = 0;  // frames with a working counter that is not 0, and frames without
        std::size_t master = 0;
        [[nodiscard]] std::uint64_t frames() const { return marked + unmarked; }
    };
    struct Master {
        Address address{};
        std::vector<std::uint32_t> interfaces{};
        std::uint64_t frames = 0;
        bool whole = false;  // requests and replies were seen
    };
    using Place = std::pair<Address, std::uint32_t>;
    [[nodiscard]] static std::optional<Place> place_of(Bytes frame, std::uint32_t interface);
    [[nodiscard]] std::vector<Master> pairs_of_requests_and_replies();
    void join_strays(const std::vector<Master>& masters);

    std::map<Place, Seen> seen_{};
    std::vector<Place> order_{};                              // of the first frames
    std::vector<std::optional<std::uint32_t>> interfaces_{};  // by master
    std::size_t count_ = 0;
};

}  // namespace margay::analyse
