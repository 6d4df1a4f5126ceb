// The cables of a segment with the error counters at their ends.
#pragma once

#include "ethercat/link_health.hpp"
#include "segment_report/report.hpp"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace margay::segment_report {

// Instead of a port of the master: a slave before the break of a ring. It is not known which one.
inline constexpr std::uint8_t kUnknownEnd = 2;

struct CableEnd {
    std::optional<std::uint16_t> slave{};  // not set: the master
    std::uint8_t port = 0;  // of the slave; of the master: 1 the NIC at the end of a ring, or kUnknownEnd
};

// The counts at a port. A counter of an ESC stops at 255.
struct EndCounts {
    unsigned damaged = 0;    // frames that arrived damaged, for the first time at this port
    unsigned symbols = 0;    // errors of the physical layer
    unsigned forwarded = 0;  // frames that another slave has marked as damaged
    unsigned lost_links = 0;
};

using Health = ethercat::LinkHealth;

struct Cable {
    CableEnd near{};  // towards the master
    CableEnd far{};
    PortType medium = PortType::not_implemented;
    EndCounts near_counts{}, far_counts{};
    unsigned growth = 0;  // damaged frames, symbols and interruptions since the begin of the report
    bool known = true;    // the counters were read
    bool broken = false;  // of a ring: there is no link
    Health health = Health::good;

    // A counter ends at 255.
    [[nodiscard]] bool may_be_more() const { return std::max(near_counts.damaged, far_counts.damaged) >= 255; }
    [[nodiscard]] unsigned damaged() const { return near_counts.damaged + far_counts.damaged; }
    [[nodiscard]] unsigned symbols() const { return near_counts.symbols + far_counts.symbols; }
    // Both ends count the same interruption.
    [[nodiscard]] unsigned interruptions() const { return std::max(near_counts.lost_links, far_counts.lost_links); }
};

// All cables in the order of the slaves, with that of the NIC at the end of a ring behind them.
[[nodiscard]] std::vector<Cable> cables_of(const Report& report);

// A port without a link that has counted errors: a cable was or should be connected.
struct LooseEnd {
    CableEnd end{};
    Health health = Health::good;
    std::string text{};
};
[[nodiscard]] std::vector<LooseEnd> loose_ends(const Report& report, const std::vector<Cable>& cables);

// "slave 2, port 1", "the master", "the NIC at the end of the ring", "a slave before the break".
[[nodiscard]] std::string end_text(const CableEnd& end);
// "cable between slave 2 and slave 3", "E-bus contact between slave 2 and slave 3".
[[nodiscard]] std::string cable_text(const Cable& cable);
// A text about the counts; empty: nothing was counted.
[[nodiscard]] std::string findings_text(const Cable& cable);
// Advice for the user; empty: there is none.
[[nodiscard]] std::string advice_text(const Cable& cable);
[[nodiscard]] std::string_view medium_text(PortType type);

// The master of a ring has two NICs. Slaves that only the NIC at the end of the ring reaches are behind a break.
struct RingState {
    bool ring = false;
    std::optional<std::uint16_t> behind{};  // the first slave of the list behind the break
    CableEnd before{};         // the last end before the break: of a slave of the list, of the master, or not known
    bool unconnected = false;  // no slave has a link to the NIC at the end of the ring
    [[nodiscard]] bool whole() const { return ring && !behind && !unconnected; }
};
[[nodiscard]] RingState ring_of(const Report& report);

}  // namespace margay::segment_report
