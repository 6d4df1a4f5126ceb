// The sizes of a context. The caller sets them before init(); nothing grows afterwards. init() refuses a limit that is
// out of its range (Errc::invalid_argument; detail: the Argument) and describe() names the limit.
#pragma once

#include <cstdint>

namespace margay {

struct Limits {
    // At least 1. Expected but missing slaves count too.
    std::uint16_t slaves = 64;
    // How many slaves one operation (scan, state change …) works on at the same time; the other slaves wait. 0: all
    // slaves.
    std::uint16_t tasks = 0;
    // Frames on the wire at the same time, 1 to 128.
    std::uint16_t frames = 64;
    // Groups of process data, 1 to 256.
    std::uint16_t groups = 4;
    // The number of frames of one cycle of all groups together, at least 1.
    std::uint16_t process_frames = 8;
    // Emergencies that the context keeps for each slave until the application reads them. 0: none are kept, but
    // their events are still reported.
    std::uint16_t emergencies = 8;
    // Errors that errors() keeps until they are read, and warnings that warnings() keeps.
    std::uint16_t errors = 64;
    // Events that events() keeps until they are read.
    std::uint16_t events = 64;
    // Slaves that may be in the ring in addition to `slaves` while the supervision looks for slaves.
    std::uint16_t guests = 16;
    // Octets of memory for running sequences and hooks. 0: as much as `tasks` sequences at the same time and requests
    // beside them need. Less memory makes the start-up slower: one slave for each 1024 * sizeof(void*) octets is
    // processed at a time, and at least one. If the memory is too small for the operation on one slave, the operation
    // ends with Errc::capacity. The simulated devices of this project, with a mailbox of 1 KiB each, need up to 8.6 KiB
    // with pointers of 64 bits, and up to 7 KiB (5.5 KiB without the supervision) with pointers of 32 bits.
    // Context::arena_peak_bytes() shows what a program has needed.
    std::uint32_t arena_bytes = 0;
    // False: no memory for distributed clocks (216 octets for each slave); configdc() fails with Errc::capacity.
    bool clocks = true;
    // True: memory for init_redundant(), which needs it: 3088 octets for each of `frames`, and for each of
    // `process_frames` twice, and one more.
    bool redundancy = false;
};

}  // namespace margay
