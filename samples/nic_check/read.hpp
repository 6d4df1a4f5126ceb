// Reads the facts. Only try_xdp() and probe() affect the interface. All other functions change nothing.
#pragma once

#include "nic_check/facts.hpp"

#include <string>

namespace margay::nic_check {

// Folders of the system; tests give others.
struct Places {
    std::string proc = "/proc";
    std::string sys = "/sys";
    std::string run = "/run";
    std::string dev = "/dev";
};

// Returns a sentence when there is no such interface or when it is not an Ethernet interface; empty: `facts` is filled.
[[nodiscard]] std::string read_interface(const std::string& name, const Places& places, InterfaceFacts& facts);

// The interrupts of the device, by its folder in /sys or by its name in /proc/interrupts. Part of read_interface().
[[nodiscard]] std::vector<Interrupt> read_interrupts(const std::string& name, const Places& places);

// Opens an AF_XDP socket on the interface in each mode, the best first, until one is accepted. Meanwhile another master
// on the interface receives nothing, and some drivers restart the link.
void try_xdp(InterfaceFacts& facts);

[[nodiscard]] MachineFacts read_machine(const Places& places);

// Sends broadcast reads (BRD) of register 0 one after the other and measures the time until each is back. A BRD changes
// nothing in a slave.
[[nodiscard]] ProbeFacts probe(const std::string& name, unsigned frames);

}  // namespace margay::nic_check
