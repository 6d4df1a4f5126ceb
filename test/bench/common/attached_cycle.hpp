// The cycle of an application that serves other programs (AttachServer): its instructions and its lost cycles, without
// clients and with clients that send requests without a pause.
#pragma once

#include <cstdint>
#include <string>

namespace margay::bench {

// The requests that the clients send, and the time at which their datagrams are sent.
enum class Clients {
    none,
    facts,     // slaves, process data, events, statistics, EoE ports, level of messages: no datagrams
    between,   // also registers, SII and rescans; the group has no acyclic budget, so these datagrams go in frames of
               // their own, and a cycle receives the frames that come back during it
    in_cycle,  // as `between`, but the datagrams ride in the frames of the cycle
};

// What a child process executes: `attached CLIENTS SLAVES OCTETS CYCLES` (the application; callgrind counts in it) and
// `client PATH CLIENTS` (a client). -1: another command line.
[[nodiscard]] int attached_child(int argc, char** argv);

struct AttachedCount {
    double instructions = -1;  // per cycle, without NIC and clock; negative: not counted
    unsigned long cycles = 0;
    unsigned long lost = 0;      // cycles that were not sent, did not come back, or fell short
    unsigned long requests = 0;  // requests of clients that were executed beside these cycles
    unsigned long failed = 0;    // requests that were not answered with success
};
// Runs the application as a child process, with four clients (or none), under callgrind where `counted` is true.
[[nodiscard]] AttachedCount run_attached(const std::string& self, Clients clients, std::uint32_t slaves,
                                         std::uint32_t octets, bool counted);

// Prints a line for each kind of clients. Returns false when a cycle is lost, when requests fail, or when clients that
// request facts make the cycle of the application more expensive. Datagrams of clients cost the same as all acyclic
// datagrams; their cost is printed and has no limit.
[[nodiscard]] bool check_attached(const std::string& self, bool counted);

}  // namespace margay::bench
