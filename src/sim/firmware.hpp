// The program of a simulated slave. It uses the PDI side of its ESC and executes steps in the time of the segment.
#pragma once

#include "sim/library/quirk.hpp"
#include "subdevice/esc_access.hpp"

#include <margay/time.hpp>

#include <vector>

namespace margay::sim {

class BridgeHalf;
class EthernetPort;
class ProcessDataFirmware;

class Firmware {
  public:
    virtual ~Firmware() = default;

    // The device has been switched on, and the ESC has loaded its EEPROM. `esc` is valid until the next start().
    virtual void start(subdevice::EscAccess& esc, Time now) = 0;

    // Executes one step. Called at the time that the previous call returned, and while the PDI interrupt is active: the
    // AL event request (0x0220) has a bit that the AL event mask (0x0204) has too. Returns the latest time for the next
    // call; kNever when only events matter.
    virtual Time step(Time now) = 0;

    // Prefetches the memory that the next step needs into the processor's cache. Without other effects.
    virtual void fetch() const {}

    // True for a program that reads the ESC in a loop all the time. step() is called as soon as such a loop would
    // detect a change: a new bit in the AL event request, independent of the mask, or a buffer that the master has
    // handed over without an event.
    [[nodiscard]] virtual bool polls() const { return false; }

    // True: the program triggers the PDI watchdog in time, independent of the result of step(), because its loop (which
    // is not simulated) reads the ESC. False: only the accesses to the ESC that the program makes trigger it, so that
    // the watchdog expires while the program sleeps (registers 0x0410, 0x0443, bit 1 of 0x0110).
    [[nodiscard]] virtual bool feeds_pdi_watchdog() const { return polls(); }

    // Activates a quirk from the next start on. `sii` is the image of the device. Returns false when this firmware does
    // not support quirks.
    virtual bool add_quirk(Quirk quirk, std::vector<std::byte>& sii) {
        (void)quirk, (void)sii;
        return false;
    }

    // The process data of the device, for tests and programs that set or read it; nullptr: the device has none.
    [[nodiscard]] virtual ProcessDataFirmware* process_data() { return nullptr; }
    // The Ethernet port of a device with EoE; nullptr: the device has none.
    [[nodiscard]] virtual EthernetPort* ethernet() { return nullptr; }
    // One half of a bridge between two segments; nullptr: the device is none.
    [[nodiscard]] virtual BridgeHalf* bridge() { return nullptr; }
};

}  // namespace margay::sim
