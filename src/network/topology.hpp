// Computes the topology of the segment from the DL status of each slave: which slave is connected to which port.
#pragma once

#include <margay/result.hpp>
#include <margay/slave.hpp>

#include <array>
#include <span>

namespace margay {

// The slave seen at one place of the ring. Places are counted from 1; 0 is the master, or no slave.
struct RingPlace {
    std::uint16_t slave = 0;    // its number; 0: an unknown slave ("stranger")
    std::uint16_t address = 0;  // its station address
    std::uint16_t dl_status = 0;
    bool unasked : 1 = false;        // a newcomer whose identity could not be read
    bool at_second_nic : 1 = false;  // filled by find_topology(): the second NIC is connected to one of its ports
    // Filled by find_topology(): between a break of the ring and the second NIC, on the way of the frames. The slaves
    // above it are not known by their place, because the way to the master leads through the break.
    bool behind_break : 1 = false;

    // Filled by find_topology(). Parent and neighbours are places of the ring.
    std::uint16_t parent = 0;
    std::uint8_t parent_port = 0;
    std::uint8_t entry_port = 0;
    struct Port {
        bool link = false;
        bool open = false;
        std::uint16_t neighbour = 0;
    };
    std::array<Port, 4> ports{};
};

// A ring with two NICs.
struct RingParts {
    bool two_nics = false;
    bool whole = false;
    std::size_t front = 0;  // places that the frames of the NIC at the beginning reach; the others are at the other end

    // In a whole ring it does not matter which copies were processed.
    [[nodiscard]] bool divides_like(const RingParts& other) const {
        return two_nics == other.two_nics && whole == other.whole && (whole || front == other.front);
    }
};

// Fills in the parents and neighbours from the dl_status of all places. A frame leaves a slave by its open ports in the
// order 0, 3, 1, 2 (ESC datasheets, "Frame processing order"). Error: Errc::unstable (Step::topology) with the first
// place that cannot be connected to an open port, or that has an open port with no neighbour.
//
// With two NICs one open port has no neighbour: the second NIC is connected there. In a broken ring the first slave
// behind the break has the parent 0; it is the
// first place there whose port 0 is closed. The places before it are at branches behind the way to the next slave.
Result<> find_topology(std::span<RingPlace> ring, RingParts parts = {});

// Whether the places before `parts.front` are not at the beginning of the ring, but at its end: the cables of both NICs
// are swapped. In a whole ring, frames from the end reach only branches behind the ways to the next ring slaves; such a
// branch has one open port less than two for each slave, and the ring slaves have these ports more. In a ring of which
// one NIC reaches all slaves, the ports of the slaves fit only one of both ends. Fills the places as find_topology().
[[nodiscard]] bool begins_at_the_end(std::span<RingPlace> ring, RingParts parts);

// Copies the topology into the table of slaves, by their numbers. A stranger between two known slaves is left out. A
// slave that is not in the ring gets `ring` 0 and keeps the last parent. A closed port keeps its last neighbour, until
// that neighbour is seen at another place.
void store_topology(std::span<const RingPlace> ring, std::span<Slave> slaves);

}  // namespace margay
