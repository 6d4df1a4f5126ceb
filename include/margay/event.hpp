// Events: changes in a running segment. The supervision reports them; emergencies are reported when a mailbox message
// is fetched (see watch_mailboxes()). Events go to a queue that another thread may read, and to a callback.
#pragma once

#include <margay/al_state.hpp>
#include <margay/error.hpp>
#include <margay/spsc_ring.hpp>
#include <margay/time.hpp>

#include <cstdint>
#include <span>
#include <string_view>

namespace margay {

// The kind of an event. In brackets: which members of Event have a value, and their meaning.
enum class EventKind : std::uint8_t {
    state,        // the AL status of a slave has changed (before, now)
    lost,         // a slave does not answer any more; slave 0: no frame comes back from the segment
    found,        // a lost slave answers again; slave 0: frames come back again
    other_slave,  // another slave is in the place of a lost slave (expected, actual: product codes; detail: vendor of
                  // the other slave; error: what differs)
    stranger,  // a slave that is not expected is connected to `port` of `slave`: not in the list of expect(), without a
               // list not found by the scan (actual: product, expected: revision, detail: vendor)
    ambiguous,  // a device is connected to `port` of slave `expected` (0: a NIC). `slave` and `other` are lost, and the
                // device may be either of them: its identity and its place are right for both. It gets no outputs until
                // other lost slaves have returned and only one slave is left for it, or until config_init() scans again
    missing,    // `other`, the first slave of the hot connect group of `slave`, is present, but `slave` is missing
    recovered,  // a slave has reached its target state again
    recovery_failed,  // bringing a slave back has failed (`error`: the reason); the supervision will try again
    fell_short,   // the working counter of a group's cycle is too low for the slaves that should take part (expected,
                  // actual)
    right_again,  // the working counter of the group is right again
    slave_count,  // the number of slaves that answer has changed (expected: before, actual: now)
    line_errors,  // frames were damaged on the cable between `slave` at `port` and `other` (actual: how many);
                  // 0: the wiring has changed meanwhile
    link_lost,    // the link of that cable was lost (actual: how often); `other`: the slave at the other end before the
                  // link was lost; 0: it is not known, or the master
    emergency,    // a slave has sent a CoE emergency (detail: its code, actual: its error register)
    unsupervised,  // a SuperviseRequest has ended (error: the error of the request; canceled after cancel() and when it
                   // was destroyed): slaves that are lost from now on are not brought back
    clock_in_sync,      // the clock of a slave is in sync (actual: its difference to the reference clock in ns)
    clock_out_of_sync,  // the clock of a slave has left the limit (actual: its difference in ns, expected: the limit)
    reference_clock,  // the clock of `slave` is the reference clock now, instead of the clock of `other`, which is lost
                      // or is behind `slave` in the ring
    clock_not_reached,  // the clock of `slave` is in the ring before the chosen reference clock (of `other`), and is
                        // not synchronised
    reference_lost,  // the slave with the reference clock is lost; reference_clock follows when another one takes over
    latch_edge,  // an edge at a latch input (port: the input, 0 or 1; detail: 0 rising, 1 falling; expected, actual:
                 // the upper and the lower half of the system time of the edge)
    master_in_sync,      // MasterClock: the phase of the cycle is in sync (actual: the error in ns)
    master_out_of_sync,  // the phase has left the limit (actual: the error in ns)
    overrun,      // the work of run_cycle() takes longer than a period (actual: periods left out since the last report,
                  // expected: since run_cycle() began)
    ring_broken,  // with two NICs: the ring is open between `slave` at `port` (0: the first NIC) and `other` (0: the
                  // second NIC). actual 1: the cables of the NICs are swapped, so `slave` 0 is the second NIC, and
                  // `other` 0 the first one. Slaves between these two ends are lost. The slaves outside answer as
                  // before
    ring_closed,  // the ring is whole again; `slave`, `other` and `actual` as in ring_broken
    second_reference,  // with two NICs: clocks that the reference clock (of `other`) does not reach (behind a break,
                       // or at branches that only the second NIC reaches) follow the clock of `slave`, which the
                       // master keeps in step with the reference clock
    second_cable_missing,  // the second NIC reaches no slave since init_redundant(): the ring was never closed
    nics_on_same_port,     // both NICs receive the same frames: they are connected to the same end of the segment
    second_segment,        // the second NIC is connected to the first slave of another segment
    cables_swapped,        // the first NIC is connected to the end of the ring and the second one to its beginning
    delays_assumed,  // `slave` has branches and no receive times. The delays of the clocks at its branches are computed
                     // as if its cables were equally long (detail 0). Where no slave before it has receive times, they
                     // are computed as if its cables had no delay (detail 1). actual: how many clocks
                     // (SlaveClock::delay_assumed)
};

// One event. Unused members are 0.
struct Event {
    Time at{};
    EventKind kind = EventKind::state;
    std::uint8_t group = 0;
    std::uint8_t port = 0;
    std::uint16_t slave = 0;  // the first slave is 1; 0: the segment, or the master's port
    std::uint16_t other = 0;  // the slave at the other end of a cable; 0: unknown
    AlStatus before{};
    AlStatus now{};
    std::uint32_t expected = 0;
    std::uint32_t actual = 0;
    std::uint32_t detail = 0;
    Error error{};
};

// The text of a kind. A static string, callable from anywhere.
[[nodiscard]] std::string_view to_text(EventKind kind);

// Writes a sentence into `out` (cut if it does not fit, without a terminating zero) and returns the written part. No
// allocation; callable from the cycle.
std::string_view describe(const Event& event, std::span<char> out);

// The events in the order in which they occurred. The thread that polls writes; one other thread may read. If no thread
// reads, the queue keeps the oldest Limits::events events.
class EventQueue : public SpscRing<Event> {
  public:
    // Called by poll() for each event, in the thread that polls: must neither wait nor poll; an exception that leaves
    // it ends the program. Set it in that thread. The callback also receives the events that do not fit the ring.
    void (*callback)(const Event& event, void* user) = nullptr;
    void* user = nullptr;

  protected:
    // Calls the callback, and stores the event.
    void add(const Event& event) {
        if (callback != nullptr) callback(event, user);
        (void)SpscRing<Event>::add(event);
    }
};

}  // namespace margay
