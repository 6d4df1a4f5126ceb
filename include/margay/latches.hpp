// The latch inputs of a slave: the system time of each edge at its inputs LATCH0 and LATCH1 (ETG.1000.4 "Distributed
// clock", "Latch"; ESC registers 0x09A8 to 0x09CF).
//
//     LatchRequest latches;
//     latches.slave = 3;
//     submit(ctx, latches);
//     …                                            // poll(), or run_cycle()
//     if (latches.edges[0].count != seen) use(latches.edges[0].time_ns);
//     latches.cancel();
#pragma once

#include <margay/request.hpp>
#include <margay/time.hpp>

#include <array>
#include <cstdint>

namespace margay {

// One kind of edge at one input.
struct LatchEdge {
    // The system time of the edge in ns. It has 64 bits, also if the clock of the slave has 32 bits, provided that
    // configdc() was called. An edge of a clock of 32 bits that may be older than 4 s, because the slave was
    // disconnected, is left out: its time is not known.
    std::uint64_t time_ns = 0;
    std::uint32_t count = 0;  // edges since the request has begun
};

// Watches the latch inputs of one slave until it is cancelled: writes the latch control so that the slave keeps the
// time of an edge until it is read, reads the latch status every `interval`, and the times of the edges that have
// occurred. Each edge is reported as EventKind::latch_edge. When edges of one kind follow each other faster than they
// are read, only the first of them is seen.
//
// The request continues when the slave does not answer, and writes the latch control again when the slave has lost it.
// A slave that was reset keeps no edges until its clock shows the system time again. The slave needs a clock. Call
// configdc() before, so that the times can be compared with other slaves. Any thread may submit and cancel the request.
// While it is busy, only the thread that owns the context may read `edges`. Errors: no_clock (the slave has no latch
// registers), unsupported (the slave's processor controls a latch input, ESC register 0x0980), unknown_slave,
// invalid_argument (interval).
struct LatchRequest : SlaveRequest {
    LatchRequest();
    Duration interval = std::chrono::milliseconds(1);  // with a clock of 32 bits: at most 2 s
    // Results: input 0 rising, input 0 falling, input 1 rising, input 1 falling.
    std::array<LatchEdge, 4> edges{};
};

}  // namespace margay
