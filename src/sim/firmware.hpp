// The program of a simulated slave: steps in the segment's time, on the PDI side of its ESC.
#pragma once

#include "sim/library/quirk.hpp"
#include "subdevice/esc_access.hpp"

#include <margay/time.hpp>

#include <vector>

namespace margay::sim {

class ProcessDataFirmware;

class Firmware {
  public:
    virtual ~Firmware() = default;

    // The device has been switched on; the ESC has just loaded its EEPROM. `esc` stays valid until the next
    // start.
    virtual void start(subdevice::EscAccess& esc, Time now) = 0;

    // Called when the AL event request (0x0220) has got a new bit, when the master has handed a buffer over, as
    // a program that polls would notice, and when the time has come that the last call returned. Returns when it wants
    // to be called at the latest, kNever when only events matter.
    virtual Time step(Time now) = 0;

    // A manner to show from the next start on; `sii` is the device's image. False: this firmware has none.
    virtual bool add_quirk(Quirk quirk, std::vector<std::byte>& sii) {
        (void)quirk, (void)sii;
        return false;
    }

    // The device's process data, where others may set and look at it; nullptr: it has none.
    [[nodiscard]] virtual ProcessDataFirmware* process_data() { return nullptr; }
};

}  // namespace margay::sim
