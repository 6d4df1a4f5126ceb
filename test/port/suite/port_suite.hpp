// The conformance suite for ports: it checks an Osal and a Nic against the contracts in osal/osal.hpp and oshw/nic.hpp.
// It needs no test framework, no heap and no exceptions, so that it also runs on a microcontroller.
//
// The far end of the cable is any EtherCAT slave: a real one, `virtual_segment` on another computer, or the simulated
// segment. The suite sends frames with one NOP datagram, which every slave returns with unchanged data.
//
// To run it, describe the port and call check_port(). Each check prints "run" and its name when it begins, and one line
// at its end: "ok", "FAIL" with the reason, or "skip" with what the port would have to provide. A suite that stops has
// stopped in the check of its last line. README.md beside this folder says more.
#pragma once

#include <margay/parts/osal/osal.hpp>
#include <margay/parts/oshw/nic.hpp>

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace margay::port {

// The functions and values of a port that the suite needs. All functions receive `user`; if a function is nullptr, its
// checks are skipped.
struct Port {
    Osal* osal = nullptr;
    Nic* nic = nullptr;  // nullptr: only the Osal is checked
    void* user = nullptr;

    // Prints one line; the text contains no line end.
    void (*print)(void* user, std::string_view line) = nullptr;

    // Calls `function(argument)` once, about `delay` later, outside the calling thread: in another thread or task, or
    // in an interrupt. A task needs a priority above that of the caller, which polls for the end of some calls. For the
    // checks of wake(), sleep_while() and thread_number().
    void (*call_later)(void* user, Duration delay, void (*function)(void*), void* argument) = nullptr;
    // call_later() uses another thread or task, not an interrupt. Then threads must have different numbers.
    bool several_threads = false;
    // How many calls call_later() carries at the same time, each in a thread of its own. With two of them the suite
    // checks that all sleeping threads are woken.
    unsigned calls_at_once = 1;

    // A second clock that does not depend on the clock of the osal, for example another timer of the board.
    Duration (*second_clock)(void* user) = nullptr;

    // Plugs the cable in or out, or asks a person to do this. Returns at once; the suite waits for the result.
    void (*plug)(void* user, bool in) = nullptr;
    Duration longest_plugging = std::chrono::seconds(10);  // a person needs longer

    // How long send() and receive() may take in the median, and link_state() ten times as long, because it reads the
    // PHY. The default is below the 123 µs that a frame of full size needs on the wire, so that a send() that waits for
    // the end of the frame is found.
    Duration longest_call = std::chrono::microseconds(100);
    // How much later than requested wait() and sleep_while() may return in the median, and wait() after a frame.
    Duration latest = std::chrono::milliseconds(2);
    // How long a reply may take. An event that has not occurred after ten of these periods does not occur any more.
    Duration reply = std::chrono::milliseconds(200);
    // How many frames the NIC can store between two calls of receive(): at least as many as the application sends
    // between two polls.
    std::size_t burst = 8;
    // How many frames of full size may be on the way while the suite fetches all replies at once. More than the NIC can
    // queue, so that a queue that loses frames is found; fewer if the far end is a program that cannot keep up.
    std::size_t on_the_way = 64;
    // How long the clock is watched at least. The default is longer than 32 bits of nanoseconds.
    Duration watched = std::chrono::seconds(5);
};

struct Verdict {
    unsigned passed = 0;
    unsigned failed = 0;
    unsigned skipped = 0;
};

// Runs all checks and prints the verdict. Takes some seconds, `port.watched` at least. `port.osal` and `port.print` are
// required. The thread that calls it must be the only one that uses the NIC.
[[nodiscard]] Verdict check_port(const Port& port);

}  // namespace margay::port
