// Supervision of a segment: a request that stays busy, works beside the cycle, and brings lost slaves back.
#pragma once

#include <margay/event.hpp>
#include <margay/request.hpp>

#include <array>
#include <cstdint>
#include <span>

namespace margay {

// Sums of the error counters of one port of a slave since the supervision began (ESC registers 0x0300–0x0313; these
// stop at 255, so the supervision clears them in time).
struct PortErrors {
    std::uint32_t invalid_frames = 0;  // frames damaged before this port: CRC or alignment error
    std::uint32_t rx_errors = 0;       // receive errors of the physical layer
    std::uint32_t forwarded = 0;       // frames that the previous slave received damaged: this cable is not the cause
    std::uint32_t lost_links = 0;
};
// The error counters of one slave.
struct LineErrors {
    std::array<PortErrors, 4> ports{};
    std::uint32_t processing_unit = 0;  // frames that are not EtherCAT frames, or are damaged
    std::uint32_t pdi = 0;

  private:
    friend struct LineErrorsAccess;
    struct CableEnd {
        std::uint16_t slave = 0;  // 0: the master, or no known slave
        std::uint8_t port = 0;
        std::uint8_t reported = 0;  // interruptions that the other end counted first: they were reported already
    };
    std::array<std::uint8_t, 20> last_{};   // the registers as read last
    std::array<CableEnd, 4> other_ends_{};  // the other ends of the cables when the registers were read
    bool primed_ = false;                   // `last_` contains values that were read
};

// Starts the supervision. With every cycle it reads the AL status of all slaves (one BRD, in the free space of a
// frame). When the number of slaves or their states have changed, or a working counter is too low, it reads the state
// of each slave, finds the slaves that have changed and reports them by events. Then it acknowledges errors, assigns
// addresses again to slaves that have lost their power, repeats the whole start-up of these slaves, and brings them to
// `target`. It works on all such slaves at the same time while the process data of the others continues. If another
// slave is in the place of a lost one, that slave is reported and not started up. Before a slave is started again, its
// identity is compared with the known one.
//
// A slave that has lost its station address is found by the alias or the device id of its entry in the list of
// expect(). Without these it is found by its serial number, or by its place: between the slaves before and behind it in
// the ring. A place may fit several equal slaves, because others of them are lost too and one was bridged (taken out,
// with a cable between its neighbours). Then the slave is not started up, and EventKind::ambiguous reports it. A member
// of a hot connect group is found behind the first slave of its group only, also when it has kept its power.
//
// When the number of slaves has changed, the supervision scans the ring and updates slave(n).ring_position, parent and
// ports. Expected slaves that were missing are started up when they appear: SII, mailboxes, start-up commands, hooks,
// process data (ExpectedSlave says how they are identified). An unexpected slave is reported as EventKind::stranger,
// with the port to which it is connected, when it was found twice with `retry` between both times. It is not used until
// config_init() scans again.
//
// A slave that is held (Tolerance) is kept in PREOP or INIT. set_target() (margay/run.hpp) or a change of `target` sets
// the states of the slaves, up or down; a StateRequest or writestate() for another state is refused: Errc::supervised.
// EventKind::recovered is reported only when a slave is in its target state again, never in a lower one.
//
// Submit the request after config_map(); cancel() ends it. config_init() is refused while the request is busy. The
// hooks of slaves are called as at the first start-up: see hook.hpp.
struct SuperviseRequest : Request {
    SuperviseRequest();
    AlState target = AlState::op;  // INIT, PREOP, SAFEOP or OP; for all slaves without a target of their own
    // The time between two readings of the AL status while there are no cycles, and between two readings of the AL
    // status of each slave while the slaves are in different states or one of them is lost: then one BRD for all slaves
    // cannot show every change. Where such a reading takes more than a fifth of this time, because there is little room
    // for acyclic datagrams, the time between two readings becomes 5 times the duration of a reading (at most this
    // duration plus `retry`), so that mail gets the other four fifths. A state that changes and changes back between
    // two readings is not seen.
    Duration interval = std::chrono::milliseconds(10);
    Duration retry = std::chrono::milliseconds(500);  // waiting time after bringing a slave back has failed
    // How often the error counters of all slaves are read; zero: never. The sums go to line_errors[n - 1] of slave n,
    // for as many slaves as it has elements. The caller's memory.
    Duration line_interval{0};
    std::span<LineErrors> line_errors;
};

// Repeats the whole start-up of one slave. See reconfigure_slave().
struct ReconfigRequest : SlaveRequest {
    ReconfigRequest();
};

// Reads the states of all slaves and finds slaves that have lost their station address. `slave` not 0: fails if that
// slave does not answer afterwards. See recover_slave().
struct RecoverRequest : SlaveRequest {
    RecoverRequest();
    std::uint16_t found = 0;  // result: number of slaves found
};

}  // namespace margay
