// Keeping a segment alive: a request that stays busy and works beside the cycle.
#pragma once

#include <margay/event.hpp>
#include <margay/request.hpp>

#include <array>
#include <cstdint>
#include <span>

namespace margay {

// What the counters of a slave's port have counted since the supervision began (ESC registers 0x0300–0x0313, which stop
// at 255 and are cleared in time).
struct PortErrors {
    std::uint32_t invalid_frames = 0;  // damaged on the way into this port: CRC, alignment
    std::uint32_t rx_errors = 0;       // of the physical layer
    std::uint32_t forwarded = 0;  // damaged before the slave in front, which has counted them: not this cable's fault
    std::uint32_t lost_links = 0;
};
struct LineErrors {
    std::array<PortErrors, 4> ports{};
    std::uint32_t processing_unit = 0;  // no EtherCAT frames, or mutilated ones
    std::uint32_t pdi = 0;
    std::array<std::uint8_t, 20> last{};  // the registers as they were read last
    bool primed = false;                  // they were read
};

// The supervision. It takes the roll of the slaves with every cycle (one BRD of AL status, in what is left of a frame),
// and looks closer when the number of slaves or their states have changed or a working counter fell short: it finds the
// slave and tells by an event what has happened to it. Then it acknowledges errors, gives slaves that have lost their
// power their addresses back, goes through their whole start-up again and brings them to `target`, all at once, while
// the others' process data goes on. A slave in whose place there is another one is left alone, and told.
//
// When the number of slaves has changed it goes through the ring and keeps slave(n).ring, parent and ports right.
// Expected slaves that were missing are taken in when they appear, from nothing: SII, mailboxes, start-up lists, hooks,
// process data (ExpectedSlave says how they are known). Whoever is nobody's is told as stranger, with where it hangs,
// once it was found twice, `retry` apart, and left alone until config_init() scans anew.
//
// A slave that is held (Tolerance) is kept in PREOP or INIT. Where slaves shall go is said by set_target()
// (margay/run.hpp) or by a change of `target`, up or down; a StateRequest or writestate() for another state is refused:
// Errc::supervised. EventKind::recovered tells that a slave is where it is wanted again, never less than that.
//
// Submit it when config_map() is through; cancel() ends it. While it is busy config_init() is refused. The hooks of
// slaves mean the same as at the first start-up: see hook.hpp.
struct SuperviseRequest : Request {
    SuperviseRequest();
    AlState target = AlState::op;  // INIT, PREOP, SAFEOP or OP; of all slaves without a target of their own
    Duration interval = std::chrono::milliseconds(10);  // between rolls while there are no cycles
    Duration retry = std::chrono::milliseconds(500);    // after an attempt to bring a slave back has failed
    // The error counters of all slaves are read this often; zero: never. Sums go to line_errors, as far as it reaches:
    // slave 1 first. The caller's memory.
    Duration line_interval{0};
    std::span<LineErrors> line_errors;
};

// Goes through the whole start-up of one slave again. See reconfig_slave().
struct ReconfigRequest : SlaveRequest {
    ReconfigRequest();
};

// Reads the states of all slaves and looks for slaves that are back without their station address. `slave` not 0: fails
// where that slave does not answer afterwards. See recover_slave().
struct RecoverRequest : SlaveRequest {
    RecoverRequest();
    std::uint16_t found = 0;  // result: how many
};

}  // namespace margay
