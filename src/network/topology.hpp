// Who hangs at which port of whom, from the DL status of each slave.
#pragma once

#include <margay/result.hpp>
#include <margay/slave.hpp>

#include <array>
#include <span>

namespace margay {

// What was seen at one place of the ring. Places are counted from 1; 0 is the master, or nobody.
struct RingPlace {
    std::uint16_t slave = 0;    // its number; 0: a stranger
    std::uint16_t address = 0;  // its station address
    std::uint16_t dl_status = 0;
    bool unasked = false;  // a newcomer who could not be asked who it is

    // By find_topology(). Parent and neighbours are places of the ring.
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

// Fills in what hangs where, from the dl_status of all places. A frame leaves a slave by its open ports in the order 0,
// 3, 1, 2 (ESC datasheets, "Frame processing order"). Error: Errc::unstable (Step::topology) naming the first place
// that has no open port left to hang at, or whose open port leads nowhere.
Result<> find_topology(std::span<RingPlace> ring);

// Takes it over into the table of slaves, by their numbers. Between two slaves that we know a stranger is passed over.
// Whoever is not in the ring has `ring` 0 and keeps the parent that it was seen at last, and so does a port that is
// closed its neighbour, until that one is seen elsewhere.
void store_topology(std::span<const RingPlace> ring, std::span<Slave> slaves);

}  // namespace margay
