// What happens to a segment while it runs: told by the supervision, and emergencies by whoever fetches mail (see
// watch_mailboxes()), as a queue that another thread may read and as a callback.
#pragma once

#include <margay/al_state.hpp>
#include <margay/error.hpp>
#include <margay/spsc_ring.hpp>
#include <margay/time.hpp>

#include <cstdint>
#include <span>
#include <string_view>

namespace margay {

enum class EventKind : std::uint8_t {
    state,        // a slave is in another state than it was: before, now
    lost,         // a slave does not answer any more; slave 0: no frame comes back from the segment
    found,        // a lost slave answers again; slave 0: frames come back again
    other_slave,  // in the place of a lost slave there is another one (expected, actual: product codes; detail: its
                  // vendor; error: what differs)
    stranger,     // somebody whom nobody expects hangs at `port` of `slave` (actual: product, expected: its revision,
                  // detail: vendor)
    missing,      // the hot connect group of `slave` is there, its head `other`, and `slave` is not
    recovered,    // a slave is where it belongs again
    recovery_failed,  // why is in `error`; it will be tried again
    fell_short,       // the working counter of a group's cycle is short of that of the slaves that should take part
                      // (expected, actual)
    right_again,      // and it is right again
    slave_count,      // so many slaves answer now (expected: before, actual: now)
    line_errors,      // frames were damaged on the way into a port: the cable between `slave` at `port` and `other`
                      // (actual: how many)
    link_lost,        // that cable was interrupted (actual: how often)
    emergency,        // a slave has sent a CoE emergency (detail: its code, actual: its error register)
    unsupervised,     // a SuperviseRequest has ended, by cancel(), by an error (`error`) or because it was destroyed:
                      // slaves that fall out from now on stay out
    overrun,          // the work of run_cycle() takes longer than a period (actual: periods left out since it was told
                      // last, expected: since run_cycle() began)
};

struct Event {
    Time at{};
    EventKind kind = EventKind::state;
    std::uint8_t group = 0;
    std::uint8_t port = 0;
    std::uint16_t slave = 0;  // 1 is the first; 0 the segment, or the master's port
    std::uint16_t other = 0;  // the slave at the other end of a cable; 0: nobody known
    AlStatus before{};
    AlStatus now{};
    std::uint32_t expected = 0;
    std::uint32_t actual = 0;
    std::uint32_t detail = 0;
    Error error{};
};

[[nodiscard]] std::string_view to_text(EventKind kind);

// Writes one sentence into `out` (cut where it does not fit, no zero behind it) and returns the part that was written.
// No allocation; callable from the cycle.
std::string_view describe(const Event& event, std::span<char> out);

// Events in the order in which they happened. The thread that polls writes, one other thread may read; when nobody
// reads, the oldest kCapacity events stay.
class EventQueue : public SpscRing<Event> {
  public:
    static constexpr std::uint32_t kCapacity = 64;

    // Called for each event by the thread that polls, from within poll(): must neither wait nor poll. Set it from that
    // thread. An event that the ring drops is given to the callback all the same.
    void (*callback)(const Event& event, void* user) = nullptr;
    void* user = nullptr;

    // For the library: tells the callback, and keeps the event.
    void add(const Event& event) {
        if (callback != nullptr) callback(event, user);
        (void)SpscRing<Event>::add(event);
    }
};

}  // namespace margay
