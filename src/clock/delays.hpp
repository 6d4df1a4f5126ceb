// Propagation delays from receive times and topology (ETG.1000.4 "Distributed clock"; ESC data sheets, "Propagation
// delay measurement"; ETG.8000).
#pragma once

#include "clock/port_times.hpp"

#include <cstdint>
#include <span>

namespace margay {

// One place of the ring. Places are counted from 1 in the order in which a frame passes their processing units.
struct DelayNode {
    std::uint16_t parent = 0;  // place; 0: the master
    std::uint8_t parent_port = 0;
    std::uint8_t entry_port = 0;
    // Bit p: a slave is connected behind port p. A port to the master's second NIC, or without a neighbour, is not set:
    // its receive time is old.
    std::uint8_t neighbours = 0;
    std::uint8_t open = 0;  // for find_ways(), bit p: frames pass port p
    // How much longer a frame needs through the processing unit than from port to port without it.
    std::uint16_t processing_ns = 0;
    const PortTimes* times = nullptr;  // nullptr: the slave has no receive times; it is a part of the cable

    [[nodiscard]] bool timed() const { return times != nullptr && times->count() != 0; }

    // Results. When the frame arrived, and when it passed the processing unit, in picoseconds from the arrival at the
    // first slave with receive times. For find_ways(), `arrival_ps` is an input: how long after its arrival the frame
    // arrives for the last time; negative: not known.
    std::int64_t arrival_ps = 0;
    std::int64_t passed_ps = 0;
    // The last place on the way to this node, or this place itself, to which the delay is assumed and not measured,
    // because a slave with branches and without receive times is before that place; 0: none. The delay between two
    // places with the same value is measured.
    std::uint16_t assumed = 0;

    // Used by the computation: the next place with receive times towards the master, the port of that place which leads
    // to this node, and whether the results are filled.
    std::uint16_t above = 0;
    std::uint8_t above_port = 0;
    bool placed = false;
    // If there is no such place: the place that is connected to the master, or the last place that was found.
    std::uint16_t root = 0;
};

// The order in which a frame passes the ports; the processing unit is behind port 0.
[[nodiscard]] constexpr std::uint8_t next_port(std::uint8_t port) {
    constexpr std::uint8_t kNext[4] = {3, 2, 0, 1};
    return kNext[port & 3];
}

// Fills the results of all nodes with receive times. A slave without receive times is computed as a part of the cable:
// the remaining time is divided equally between the cables. This is exact if such a slave has no branches. `nodes` are
// in the order of the ring; parents may follow their children. Several places may be connected to the master: the
// frames arrive at all of them at the same time.
void compute_delays(std::span<DelayNode> nodes);

// The port at which the frame arrives last before the processing unit of the node.
[[nodiscard]] std::uint8_t port_before_unit(const DelayNode& node);
// How long the frame is away from the node when it leaves by `port`; 0 where no slave is connected there.
[[nodiscard]] std::int64_t away_ps(const DelayNode& node, std::uint8_t port);
// From the processing unit of the node until the frame has left the node towards the master.
[[nodiscard]] std::int64_t way_back_ps(const DelayNode& node);

// The delay from `reference` to `node` in nanoseconds, rounded; negative when the frame passes `node` first.
[[nodiscard]] std::int64_t delay_between_ns(const DelayNode& reference, const DelayNode& node);

}  // namespace margay
